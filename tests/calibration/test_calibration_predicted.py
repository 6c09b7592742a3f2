"""The 18 directions, and predicted errors: closed forms, and beside drawn parameters."""

import numpy as np
import pytest

from plumbob.calibration.predicted import (
    NAMES,
    REGIONS,
    attitudes,
    filled,
    heading_sd,
    region_index,
    region_names,
    tilt_sd,
)
from plumbob.rotations import quat_from_dcm, quat_rotate
from tests.helpers.mag_scene import DIP, STRENGTH, in_body


def covariance(**sds):
    out = np.zeros((12, 12))
    for place, sd in sds.items():
        out[int(place[1:]), int(place[1:])] = sd * sd
    return out


def test_attitudes_are_rotations_within_the_range():
    axes = attitudes(np.radians(30.0))
    np.testing.assert_allclose(
        np.einsum("nij,nik->njk", axes, axes), np.broadcast_to(np.eye(3), axes.shape), atol=1e-14
    )
    assert np.allclose(np.linalg.det(axes), 1.0)
    assert np.degrees(np.arccos(axes[:, 2, 2].min())) == pytest.approx(30.0)


def test_level_closed_forms():
    """Level: a bias δ in x turns the heading by δ sin ψ / H, so by δ/(√2 H) rms; the horizon by δ/g."""
    heading = heading_sd(np.eye(3), covariance(p0=0.5), size=STRENGTH, dip=DIP, tilt_range=0.0)
    assert heading == pytest.approx(0.5 / np.sqrt(2.0) / (STRENGTH * np.cos(DIP)), rel=1e-12)
    assert tilt_sd(np.eye(3), covariance(p0=0.05), size=10.0, tilt_range=0.0) == pytest.approx(0.005, rel=1e-12)
    assert tilt_sd(np.eye(3), covariance(p2=0.05), size=10.0, tilt_range=0.0) == pytest.approx(0.0, abs=1e-15)
    # a sensor that reads half needs a matrix of 2: its bias counts twice
    once, twice = (heading_sd(m * np.eye(3), covariance(p1=0.3), size=STRENGTH, dip=DIP) for m in (1.0, 2.0))
    assert twice == pytest.approx(2.0 * once)
    # a fit that determines nothing may leave negative variances by rounding
    assert heading_sd(np.eye(3), -np.eye(12), size=50.0, dip=1.0, tilt_range=0.5) == np.inf


def test_drawn_parameters_scatter_as_predicted():
    """Root mean square heading over 400 draws of the 12 parameters: known to about 1/√(2 · 400 · some) < 5 %."""
    rng = np.random.default_rng(0)
    root = 0.02 * rng.normal(size=(12, 12)) * np.r_[np.full(3, 5.0), np.full(9, 0.05)][:, np.newaxis]
    matrix = np.array([[1.1, 0.02, 0.0], [-0.03, 0.95, 0.01], [0.0, 0.05, 1.02]])
    q_nb = quat_from_dcm(np.swapaxes(attitudes(np.radians(45.0)), 1, 2)[::3])
    measured, found = in_body(q_nb) @ np.linalg.inv(matrix).T, []
    for _ in range(400):
        change = root @ rng.normal(size=12)
        calibrated = (measured - change[:3]) @ (matrix + change[3:].reshape(3, 3)).T
        north, east, _ = quat_rotate(q_nb, calibrated).T
        found.append(np.mean(np.arctan2(east, north) ** 2))
    predicted = heading_sd(matrix, root @ root.T, size=STRENGTH, dip=DIP)
    assert np.sqrt(np.mean(found)) == pytest.approx(predicted, rel=0.12)


def test_regions_are_as_counted_named_and_placed():
    """A cube has 6 faces and 12 edges; their directions have one and two non-zero components."""
    parts = np.count_nonzero(np.abs(REGIONS) > 0.1, axis=1)
    assert parts.tolist() == [1] * 6 + [2] * 12
    np.testing.assert_allclose(np.linalg.norm(REGIONS, axis=1), 1.0, rtol=4e-16)
    assert len(set(NAMES)) == 18
    # the closest two directions are 45° apart, so 22° from one are still its own
    rng = np.random.default_rng(0)
    for i, direction in enumerate(REGIONS):
        across = np.cross(direction, rng.normal(size=3))
        near = direction * np.cos(np.radians(22)) + np.sin(np.radians(22)) * across / np.linalg.norm(across)
        assert region_index(np.stack((direction, 40.0 * near))).tolist() == [i, i]
    counts = filled(np.array([[1, 0, 0], [2, 0.1, 0], [0, -3, 3.0]]))
    assert (counts[NAMES.index("+x")], counts[NAMES.index("−y+z")], counts.sum()) == (2, 1, 3)
    assert region_names([0, 1]) == "+x, −x"
    many = filled(np.tile(REGIONS, (10_000, 1)))  # very many are counted evenly
    assert (many > 0).sum() >= 1 and many.sum() <= 40_000
