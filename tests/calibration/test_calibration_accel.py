"""Accelerometers from poses at rest: planted sensors come back, intervals hold, and what says nothing is refused."""

import itertools
import math
import tracemalloc

import numpy as np
import pytest

from plumbob.calibration.acc import CROSS_AXIS, fit_accel, normal_gravity, six_positions
from plumbob.calibration.fit import TILT
from plumbob.calibration.predicted import REGIONS
from plumbob.core.constants import EARTH_RATE, G0, WGS84_A, WGS84_F
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import deg, g
from tests.helpers.pose_capture import BIAS, GAIN, symmetric
from tests.helpers.refusals import reasons

EPS = np.finfo(float).eps
FACES = REGIONS[:6]
NINE = REGIONS[[0, 1, 2, 3, 4, 5, 6, 10, 14]]
CORNERS = np.array(list(itertools.product((1.0, -1.0), repeat=3))) / np.sqrt(3.0)
ACROSS = [3 + 1, 3 + 2, 3 + 5]  # xy, xz, yz of the matrix in the covariance of bias and matrix


def measured(directions, *, gain=GAIN, noise=0.0, jitter=0.0, seed=0):
    """Means of poses whose directions are meant, and held with some jitter (rad)."""
    rng = np.random.default_rng(seed)
    held = directions + jitter * rng.standard_normal(directions.shape)
    held = held / np.linalg.norm(held, axis=1, keepdims=True)
    return G0 * held @ gain.T + BIAS + noise * rng.standard_normal(directions.shape)


TRUE = symmetric(np.linalg.inv(GAIN))


def test_gravity_at_the_place_scales_the_result_and_scatter_is_told():
    poses = measured(REGIONS, noise=0.01)
    standard, local = fit_accel(poses).calibration, fit_accel(poses, gravity=9.81).calibration
    np.testing.assert_allclose(local.matrix, standard.matrix * 9.81 / G0, rtol=4 * EPS)
    assert (local.bias == standard.bias).all() and local.reference == 9.81
    for noise in (0.0, 0.01, 0.001):  # more than the noise that is told
        assert any("times as much" in str(r) for r in fit_accel(poses, noise=noise).remarks) is (noise == 0.001)


def test_without_noise_the_sensor_comes_back_but_for_a_turn():
    fit = fit_accel(measured(np.vstack((REGIONS, CORNERS))))
    np.testing.assert_allclose(fit.calibration.bias, BIAS, atol=1e-10)
    np.testing.assert_allclose(fit.calibration.matrix, TRUE, atol=1e-11)
    assert (fit.calibration.quality.grade, fit.calibration.quality.regions) == ("good", 18)
    assert "calibrate mount" in str(fit.remarks[-1])


def test_intervals_hold_the_truth_and_the_predicted_tilt_is_that_of_the_errors():
    """18 poses leave 9 degrees of freedom: Student's t has 65.7 % within one sd, and 900 draws scatter by 1.6 %."""
    inside, tilts, predicted = [], [], []
    for seed in range(100):
        found = fit_accel(measured(REGIONS, noise=g(6e-4), jitter=deg(2.0), seed=seed)).calibration
        errors = np.append(found.bias - BIAS, (found.matrix - TRUE).ravel())
        sd = np.sqrt(np.diag(found.covariance))
        inside.append((np.abs(errors) < sd)[[0, 1, 2, 3, 4, 5, 7, 8, 11]])
        tilts.append(tilt_errors(found, np.random.default_rng(seed)) ** 2)
        predicted.append(found.quality.tilt_sd)
    assert 0.60 < np.mean(inside) < 0.78
    # a tilt's square is the sum of two or three of a normal error: its mean over 100 scatters by 8 % or 10 %, the root
    # by half of that, and the prediction, of 9 degrees of freedom each, by 2.4 %; together 5.6 %
    assert np.sqrt(np.mean(tilts)) == pytest.approx(np.sqrt(np.mean(np.square(predicted))), rel=0.17)


def tilt_errors(found, rng, count=200):
    """Angles between calibrated and true vertical, up to 45° from level."""
    tilt, course = rng.uniform(0.0, np.pi / 4.0, count), rng.uniform(0.0, 2.0 * np.pi, count)
    up = np.column_stack((np.sin(tilt) * np.cos(course), np.sin(tilt) * np.sin(course), np.cos(tilt)))
    told = (np.linalg.solve(TRUE, G0 * up.T).T + BIAS - found.bias) @ found.matrix
    return np.linalg.norm(np.cross(told, up), axis=1) / np.linalg.norm(told, axis=1)


def test_as_many_poses_as_parameters_do_where_the_noise_is_known_but_are_never_called_good():
    poses = measured(NINE, noise=g(5e-5), jitter=deg(0.5))
    found = fit_accel(poses, noise=g(5e-5))
    sd = np.sqrt(np.diag(found.calibration.covariance))
    assert (np.abs(found.calibration.bias - BIAS) < 4.0 * sd[:3]).all()
    assert (np.abs(found.calibration.matrix - TRUE).ravel() < 4.0 * sd[3:]).all()
    assert found.calibration.quality.tilt_sd < TILT.good
    assert found.calibration.quality.grade == "fair"
    assert any("too few to notice a bad one" in str(remark) for remark in found.remarks)


def test_a_sensor_without_misalignment_keeps_the_doubt_about_it():
    """Of two shapes that noise explains the smaller is taken; the larger one says how well that is known."""
    found = fit_accel(measured(REGIONS, gain=np.diag([1.02, 0.99, 1.01]), noise=g(6e-4), jitter=deg(1.0)))
    assert "bias and scale, 6 parameters" in found.calibration.method
    assert (np.diag(found.calibration.matrix, 1) == 0.0).all()
    full = fit_accel(found.measured, shape="ellipsoid")
    across = [np.diag(fit.calibration.covariance)[ACROSS] for fit in (found, full)]
    np.testing.assert_allclose(across[0], across[1], rtol=1e-5)  # where the iterations end
    assert (across[0] > 0.0).all()


@pytest.mark.parametrize("poses", [np.vstack((FACES, FACES)), REGIONS[[0, 1, 2, 3, 4, 5, 10]]])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_poses_that_cannot_tell_misalignment_say_so(poses, noise):
    """Faces alone, each twice, hold nine parameters apart by rounding only; the figure of data sheets stands in."""
    found = fit_accel(measured(poses, noise=noise), noise=noise)
    sd = np.sqrt(np.diag(found.calibration.covariance)[ACROSS])
    assert sd == pytest.approx([CROSS_AXIS] * 3, rel=0.03)  # of gravity in the sensor's scale, 2 % off
    assert found.calibration.quality.grade == "poor"
    assert found.calibration.quality.tilt_sd > CROSS_AXIS
    assert any("Misalignment was left at zero" in str(remark) for remark in found.remarks)


def test_intervals_without_misalignment_hold_where_data_sheets_are_right():
    """Bias and scale err by what misalignment spoils; 540 draws, nine of a unit with common causes: 68 ± 4 %."""
    inside = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        across = CROSS_AXIS * np.triu(rng.standard_normal((3, 3)), 1)
        true = np.eye(3) + across + across.T
        directions = FACES + 0.1 * rng.standard_normal((6, 3))
        found = fit_accel(measured(directions, gain=np.linalg.inv(true), noise=1e-3, seed=seed), noise=1e-3).calibration
        errors = np.append(found.bias - BIAS, (found.matrix - true).ravel())
        inside.append((np.abs(errors) < np.sqrt(np.diag(found.covariance)))[[0, 1, 2, 3, 4, 5, 7, 8, 11]])
    assert 0.60 < np.mean(inside) < 0.78


def test_six_positions_are_half_sums_and_half_differences():
    poses = np.diag([1.02, 0.99, 1.01]) @ (G0 * FACES.T) + BIAS[:, np.newaxis]
    shuffled = poses.T[[4, 0, 3, 5, 1, 2]]
    found = fit_accel(shuffled, shape="six").calibration
    np.testing.assert_allclose(found.bias, BIAS, atol=16 * EPS * G0)
    np.testing.assert_allclose(found.matrix, np.diag(1.0 / np.array([1.02, 0.99, 1.01])), rtol=16 * EPS)
    assert "by pairs" in found.method


def test_pairs_take_a_slant_face_for_upright_and_the_fit_does_not():
    """A face at the angle θ reads low by 1 − cos θ; the norm of all three axes does not."""
    tilt = deg(8.0)
    slant = FACES.copy()
    slant[0] = np.cos(tilt), np.sin(tilt), 0.0
    poses = measured(slant, gain=np.eye(3))
    low = -G0 * (1.0 - np.cos(tilt))
    pairs = six_positions(poses)
    assert pairs.ellipsoid.centre[0] - BIAS[0] == pytest.approx(0.5 * low, rel=1e-9)
    assert 1.0 / pairs.ellipsoid.shape[0, 0] - G0 == pytest.approx(0.5 * low, rel=1e-9)
    np.testing.assert_allclose(fit_accel(poses, shape="axes", noise=1e-3).calibration.bias, BIAS, atol=1e-10)


@pytest.mark.parametrize("poses", [REGIONS[:5], np.vstack((FACES[:5], FACES[:1])), REGIONS[6:12]])
def test_six_positions_want_six_faces(poses):
    assert six_positions(measured(poses)) is None


def test_a_disturbed_pose_is_set_aside_and_named():
    """The residual is that of the others: root mean square of | M (a − b) | − g, by hand; with the disturbed one, off
    by 1 % of g, it would be ten times as much."""
    poses = measured(np.vstack((REGIONS, CORNERS)), noise=g(1e-4), jitter=deg(2.0), seed=3)
    poses[4] *= 1.01
    fit, without = fit_accel(poses), fit_accel(np.delete(poses, 4, axis=0))
    c = fit.calibration
    assert np.flatnonzero(~fit.used).tolist() == [4]
    assert any("poses 5 of 26" in str(remark) for remark in fit.remarks)
    assert (np.abs(c.bias - without.calibration.bias) < 1e-3 * without.calibration.bias_sd).all()
    sizes = [np.linalg.norm(c.matrix @ (pose - c.bias)) for i, pose in enumerate(poses) if i != 4]
    assert c.residual_rms == pytest.approx(np.sqrt(np.mean(np.square(np.array(sizes) - G0))), rel=1e-9)
    # along each of 26 poses 1e-4 g, of which the fit takes 9 degrees of freedom
    assert c.residual_rms == pytest.approx(g(1e-4) * np.sqrt(16.0 / 25.0), rel=4.0 / np.sqrt(2.0 * 16.0))


ANGLES = np.linspace(0.0, 2.0 * np.pi, 18, endpoint=False)
RING = np.column_stack((np.cos(ANGLES), np.sin(ANGLES), 0.02 * np.ones(18)))
CAP = np.column_stack((0.3 * np.cos(ANGLES), 0.3 * np.sin(ANGLES), np.ones(18)))
DISTURBED = measured(np.vstack((REGIONS, CORNERS)), noise=g(1e-4), jitter=deg(2.0))
DISTURBED[[3, 9, 15]] *= 1.01


@pytest.mark.parametrize(("poses", "options", "kind", "words"), [
    (measured(CAP, noise=1e-4), {}, "too-few-regions", "no pose had +x, −x, +y, −y, −z up"),
    (measured(RING, noise=1e-4), {}, "too-few-regions", "no pose had +z, −z up"),
    (measured(FACES[:4]), {}, "too-few", "4 poses; bias and scale, 6 parameters need 7 at least."),
    (measured(NINE, noise=g(5e-5)), {"shape": "ellipsoid"}, "too-few", "9 parameters need 10 at least"),
    (np.zeros((0, 3)), {}, "too-few", "0 poses"),
    (measured(REGIONS) / G0, {}, "wrong-gravity", "the values are in g."),
    (2.0 * measured(REGIONS), {}, "wrong-gravity", "times gravity (9.80665 m/s²)"),
    (1.12 * measured(REGIONS), {}, "wrong-gravity", "1.13 times"),
    (np.zeros((18, 3)), {}, "wrong-gravity", "measures 0 m/s²"),
    (measured(REGIONS, noise=1.0), {}, "ill-conditioned", "inclination error"),
    (measured(np.vstack((FACES, FACES))), {"shape": "ellipsoid"}, "ill-conditioned", "condition"),
    (measured(np.vstack((FACES, REGIONS[6:7]))), {"shape": "six"}, "ill-conditioned", ""),
    (np.full((18, 3), np.nan), {}, "not-still", "no finite mean"),
    (DISTURBED, {}, "outliers", "3 of 26 poses"),
])  # fmt: skip
def test_what_calibrates_nothing_is_refused_with_the_reason(poses, options, kind, words):
    reason = {reason.kind: reason for reason in reasons(fit_accel, poses, **options)}[kind]
    assert words in reason.text and reason.advice
    with pytest.raises(ShapeError, match="auto, six, axes, ellipsoid"):
        fit_accel(poses, shape="cube")


def test_thousands_of_poses_take_no_more_memory_than_a_few_copies():
    """All pairs of 2500 poses would be 3 million; the robust fit keeps some arrays of (2500, 9)."""
    rng = np.random.default_rng(0)
    poses = measured(rng.normal(size=(2500, 3)), noise=0.005)
    poses[7] += 1.0
    tracemalloc.start()
    try:
        fit = fit_accel(poses, noise=0.005)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert not fit.used[7] and peak < 20e6


E2 = WGS84_F * (2.0 - WGS84_F)


def test_equator_and_poles_have_the_ellipsoids_constants():
    assert normal_gravity(0.0) == 9.7803253359
    assert normal_gravity(math.pi / 2.0) == pytest.approx(9.8321849379, rel=1e-15)
    assert normal_gravity(-math.pi / 2.0) == normal_gravity(math.pi / 2.0)


@pytest.mark.parametrize("latitude", [15.0, 45.0, 60.0])
def test_at_latitudes_in_between(latitude):
    """The 1980 formula of GRS 80 as a series, 9.780327 (1 + 0.0053024 sin²φ − 0.0000058 sin²2φ): good to 1e-6 m/s²,
    and GRS 80 and WGS 84 differ by 1.5e-6 m/s²."""
    sin2, sin22 = math.sin(deg(latitude)) ** 2, math.sin(2.0 * deg(latitude)) ** 2
    series = 9.780327 * (1.0 + 0.0053024 * sin2 - 0.0000058 * sin22)
    assert normal_gravity(deg(latitude)) == pytest.approx(series, abs=3e-6)


@pytest.mark.parametrize("latitude", [0.0, 30.0, 52.0, 90.0])
def test_the_gradient_with_height_is_that_of_bruns(latitude):
    """dγ/dh = −γ (1/M + 1/N) − 2 ω², with the ellipsoid's radii of curvature; the series leaves out terms in f²."""
    w = math.sqrt(1.0 - E2 * math.sin(deg(latitude)) ** 2)
    curvature = w**3 / (WGS84_A * (1.0 - E2)) + w / WGS84_A
    ground = normal_gravity(deg(latitude))
    slope = (normal_gravity(deg(latitude), 1.0) - normal_gravity(deg(latitude), -1.0)) / 2.0
    assert slope == pytest.approx(-ground * curvature - 2.0 * EARTH_RATE**2, rel=10.0 * WGS84_F**2)


@pytest.mark.parametrize(("latitude", "height"), [(91.0, 0.0), (float("nan"), 0.0), (0.0, 1e5), (0.0, float("nan"))])
def test_what_is_no_place_is_refused(latitude, height):
    with pytest.raises(ParameterError):
        normal_gravity(deg(latitude), height)
