"""The 18 directions: what they are, and which one a vector points into."""

import numpy as np

from plumbob.calibration.predicted import NAMES, REGIONS, filled, names_of, region_of


def test_six_faces_and_twelve_edges_of_length_one():
    """A cube has 6 faces and 12 edges; their directions have one and two non-zero components."""
    parts = np.count_nonzero(np.abs(REGIONS) > 0.1, axis=1)
    assert parts.tolist() == [1] * 6 + [2] * 12
    np.testing.assert_allclose(np.linalg.norm(REGIONS, axis=1), 1.0, rtol=4e-16)
    assert len(set(NAMES)) == 18


def test_each_direction_is_in_its_own_region_and_so_is_what_is_near():
    """The closest two directions are 45° apart, so 22° from one are still its own."""
    rng = np.random.default_rng(0)
    for i, direction in enumerate(REGIONS):
        across = np.cross(direction, rng.normal(size=3))
        near = direction * np.cos(np.radians(22)) + np.sin(np.radians(22)) * across / np.linalg.norm(across)
        assert region_of(np.stack((direction, 40.0 * near))).tolist() == [i, i]


def test_counts_and_names():
    counts = filled(np.array([[1, 0, 0], [2, 0.1, 0], [0, -3, 3.0]]))
    assert counts[NAMES.index("+x")] == 2
    assert counts[NAMES.index("−y+z")] == 1
    assert counts.sum() == 3
    assert names_of([0, 1]) == "+x, −x"


def test_very_many_are_counted_evenly():
    counts = filled(np.tile(REGIONS, (10_000, 1)))
    assert (counts > 0).sum() >= 1
    assert counts.sum() <= 40_000
