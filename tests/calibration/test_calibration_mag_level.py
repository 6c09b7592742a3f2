"""Magnetometer of a vehicle that only turns level: the ellipse, its covariance, and refusals."""

import numpy as np
import pytest

from plumbob.calibration.mag.ellipsoid import fit_ellipse, fit_mag_level
from plumbob.core.constants import G0
from tests.helpers.mag_scene import DIP, STRENGTH
from tests.helpers.refusals import reason_kinds, reasons

BIAS, SHAPE = np.array([6.0, -9.0]), np.array([[1.1, 0.15], [0.15, 0.9]]) / 25.0
LEVEL = STRENGTH * np.cos(DIP)


def ring(rng, count=400, *, upright=2, sd=0.2, cover=2.0 * np.pi, first=0.0):
    """A field of 25 µT about the upright axis, which itself measures 30 µT."""
    course = first + rng.uniform(0.0, cover, count)
    points = np.column_stack((np.cos(course), np.sin(course))) @ np.linalg.inv(SHAPE) + BIAS
    mag = np.insert(points, upright, 30.0, axis=1)
    return mag + sd * rng.normal(size=mag.shape)


OWN = [0, 1, 3, 4, 6]  # centre and xx, yy, xy of the ellipse among the parameters of an ellipsoid


def z_scores(fit):
    shape = fit.ellipsoid.shape
    found = np.array([*fit.ellipsoid.centre[:2], shape[0, 0], shape[1, 1], shape[0, 1]])
    true = np.array([*BIAS, SHAPE[0, 0], SHAPE[1, 1], SHAPE[0, 1]])
    return (found - true) / np.sqrt(np.diag(fit.covariance)[OWN])


def test_covariance_is_honest_the_truth_comes_back_and_outliers_are_set_aside():
    z = np.array([z_scores(fit_ellipse(ring(np.random.default_rng([1, k]))[:, :2])) for k in range(100)])
    assert abs(np.mean(np.abs(z) < 1.0) - 0.683) < 4.0 * np.sqrt(0.683 * 0.317 / 500)
    assert np.abs(z.mean(axis=0)).max() < 4.0 / np.sqrt(100)
    fit = fit_ellipse(ring(np.random.default_rng(2), sd=0.0)[:, :2])
    assert fit.ellipsoid.centre == pytest.approx([*BIAS, 0.0], abs=1e-9)
    assert fit.ellipsoid.shape == pytest.approx(np.diag([0.0, 0.0, 1.0]) + np.pad(SHAPE, (0, 1)), abs=1e-11)
    mag = ring(np.random.default_rng(5))
    mag[:20] += 8.0
    fit = fit_mag_level(mag)
    assert np.count_nonzero(~fit.used) >= 18  # where the push is along the ellipse, the distance is small
    assert not fit.used[:20].all()
    assert np.abs(fit.calibration.bias[:2] - BIAS).max() < 5.0 * float(fit.calibration.bias_sd.max())


@pytest.mark.parametrize("upright", [0, 1, 2])
def test_two_axes_are_calibrated_and_the_third_stays(upright):
    rng = np.random.default_rng(3)
    mag = ring(rng, upright=upright)
    acc = np.tile(G0 * np.eye(3)[upright], (len(mag), 1)) + 0.2 * rng.normal(size=mag.shape)
    fit = fit_mag_level(mag, acc=acc, strength=STRENGTH, dip=DIP)
    c = fit.calibration
    level = [i for i in range(3) if i != upright]
    assert c.matrix[upright].tolist() == np.eye(3)[upright].tolist()
    assert c.bias[upright] == 0.0
    assert c.matrix[np.ix_(level, level)] == pytest.approx(LEVEL * SHAPE, abs=6.0 * float(c.matrix_sd.max()))
    assert (c.bias[level], c.quality.tilt_range) == (pytest.approx(BIAS, abs=5.0 * float(c.bias_sd.max())), 0.0)
    assert f"the {'xyz'[upright]} axis is upright" in str(fit.remarks[0])
    told = fit_mag_level(mag)  # by the axis along which the field changed least
    assert told.calibration.bias.tolist() == c.bias.tolist()
    level_matrix = told.calibration.matrix[np.ix_(level, level)]
    assert np.linalg.det(level_matrix) == pytest.approx(1.0, rel=1e-12)


def test_predicted_heading_error_is_that_of_the_heading():
    """Root mean square over the ring of a heading's error, against the prediction."""
    course = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    exact = np.column_stack((np.cos(course), np.sin(course))) @ np.linalg.inv(SHAPE) + BIAS
    ratios = []
    for k in range(50):
        c = fit_mag_level(ring(np.random.default_rng([4, k]), 100)).calibration
        x, y = ((exact - c.bias[:2]) @ c.matrix[:2, :2]).T
        off = (np.arctan2(y, x) - course + np.pi) % (2.0 * np.pi) - np.pi
        ratios.append(np.mean(off**2) / c.quality.heading_sd**2)
    assert abs(np.mean(ratios) - 1.0) < 4.0 * np.sqrt(2.0 / 3.0 / 50)  # as of chi-square with 3 degrees or more


def test_the_matrix_keeps_the_sensor_s_scale_or_takes_the_field_s():
    """The covariance of the matrix, from that of the ellipse: without a strength, det M is 1 and known exactly.

    With a strength the size is the level field, so M is that constant times the shape.
    """
    mag = ring(np.random.default_rng(7))
    fit = fit_ellipse(mag[:, :2])
    c = fit_mag_level(mag).calibration
    ellipse, own = fit.ellipsoid.shape[:2, :2], fit.covariance[np.ix_(OWN[2:], OWN[2:])]
    size = 1.0 / np.sqrt(np.linalg.det(ellipse))
    places = [3, 7, 4]  # of M₀₀, M₁₁ and M₀₁ behind the bias
    shared = c.covariance[0, 0] / fit.covariance[0, 0]
    m = c.matrix
    slope = np.zeros(12)
    slope[[3, 4, 6, 7]] = m[1, 1], -m[1, 0], -m[0, 1], m[0, 0]  # d det M
    assert slope @ c.covariance @ slope < 1e-12 * np.trace(c.covariance[3:, 3:])
    along = np.array([[size, 0, 0], [0, size, 0], [0, 0, size]])
    shape = np.array([ellipse[0, 0], ellipse[1, 1], ellipse[0, 1]])
    slope = np.array([shape[1], shape[0], -2.0 * shape[2]]) / np.linalg.det(ellipse)  # d ln det S
    along -= 0.5 * size * np.outer(shape, slope)
    assert c.covariance[np.ix_(places, places)] == pytest.approx(shared * along @ own @ along.T)
    known = fit_mag_level(mag, strength=STRENGTH, dip=DIP).calibration
    expected = shared * LEVEL**2 * own
    assert known.covariance[np.ix_(places, places)] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("first", [-130.0, -30.0, 50.0, 140.0])
def test_headings_that_were_not_seen_are_counted_wherever_they_lie(first):
    """A gap of 100° is refused and one of 80° is not, be it across ±180° or elsewhere.

    400 places in 260° leave steps of 0.65° on average, which widen a gap by several degrees at most.
    """
    rng, first = np.random.default_rng(8), np.radians(first)
    refused = reasons(fit_mag_level, ring(rng, cover=np.radians(260.0), first=first))
    (text,) = [reason.text for reason in refused if reason.kind == "too-few-regions"]
    covered = float(text.split("cover ")[1].split("°")[0])
    assert 255.0 < covered < 262.0
    assert fit_mag_level(ring(rng, cover=np.radians(280.0), first=first)).calibration.bias[2] == 0.0


@pytest.mark.parametrize(("capture", "kind"), [
    (lambda rng: {"mag": ring(rng, 19)}, "too-few"),
    (lambda rng: {"mag": ring(rng, cover=np.radians(260.0))}, "too-few-regions"),
    (lambda rng: {"mag": ring(rng), "acc": np.tile([3.0, 0.0, 9.0], (400, 1))}, "not-level"),
    (lambda rng: {"mag": ring(rng, sd=4.0)}, "not-level"),
    (lambda rng: {"mag": 100.0 * ring(rng)}, "wrong-field"),
    (lambda rng: {"mag": ring(rng) * [5.0, 1.0, 1.0]}, "implausible"),
])  # fmt: skip
def test_what_cannot_calibrate_is_refused(capture, kind):
    assert reason_kinds(fit_mag_level, **capture(np.random.default_rng(6)))[0] == kind
