"""Gyroscopes by hand motion: scale, misalignment, sensitivity to force; wrong axes, units and ranges are refused."""

import numpy as np
import pytest
from scipy import stats

from plumbob.calibration.gyr.hand import FEWEST_RATES as FEWEST
from plumbob.calibration.gyr.hand import coupling_at_rest, fit_hand, flat_tops
from plumbob.calibration.gyr.rest import Rates
from plumbob.core.constants import G0
from plumbob.core.units import dps, g
from tests.helpers.gyro_sessions import hand
from tests.helpers.refusals import reason_kinds, reasons


def fit(session, **options):
    return fit_hand(Rates(session.t, session.gyr, session.acc, **({"acc_calibrated": True} | options)))


def test_truth_lies_where_the_standard_deviations_say():
    inside, size = [], []
    for seed in range(12):
        session = hand(seed)
        made = fit(session).calibration
        z = np.append((made.matrix - session.matrix) / made.matrix_sd, (made.bias - session.bias) / made.bias_sd)
        inside.append(np.abs(z) < 1.0)
        size.append(float(np.mean(z**2)))
    assert 0.60 <= np.mean(inside) <= 0.78  # 144 of them, 68 % ± 2 × 3.9 %
    assert 0.6 <= np.mean(size) <= 1.5


def test_quality_and_method_tell_what_was_used():
    result = fit(hand(2))
    quality = result.calibration.quality
    assert quality.grade == "good"
    assert quality.samples + quality.outliers == len(result.measured) == len(result.residuals)
    assert 1.0 <= quality.condition < 20.0
    assert "motions against the accelerometer" in result.calibration.method
    for calibrated in (True, False):
        remarks = fit(hand(2), acc_calibrated=calibrated).remarks
        assert any("UNCALIBRATED" in str(remark) for remark in remarks) is not calibrated


def test_without_noise_the_matrix_is_exact_up_to_the_rule_of_integration():
    session = hand(1, rate=200.0, white=0.0, acc_sd=0.0)
    found = fit(session).calibration
    # The trapezoidal rule is exact for 1 − cos over its period, and the last instant at rest sees no rate.
    assert np.abs(found.matrix - session.matrix).max() < 1e-9
    assert np.abs(found.bias - session.bias).max() < 1e-12


def test_one_motion_that_does_not_fit_is_set_aside():
    session = hand(3)
    gyr = session.gyr.copy()
    moving = np.abs(gyr - session.bias).max(axis=1) > dps(20.0)
    first = np.flatnonzero(moving)[:20]
    gyr[first] *= 1.3
    result = fit(session._replace(gyr=gyr))
    assert result.calibration.quality.outliers == 1
    assert np.abs(result.calibration.matrix - session.matrix).max() < 5.0 * result.calibration.matrix_sd.max()


def test_flat_tops_that_no_range_declares_are_left_out_and_a_slow_sensor_has_none():
    session = hand(1)
    fastest = np.abs(session.gyr).max()
    limit = 0.8 * fastest
    result = fit_hand(Rates(session.t, np.clip(session.gyr, -limit, limit), session.acc, acc_calibrated=True))
    assert any("does not declare" in str(remark) for remark in result.remarks)
    found = result.calibration
    assert (np.abs(found.matrix - session.matrix) <= 5.0 * found.matrix_sd).all()
    assert not any("does not declare" in str(r) for r in fit(session).remarks)
    rate = dps(200.0) * np.sin(np.linspace(0.0, np.pi, 25))
    held = np.repeat(rate, 4)[:, np.newaxis] * np.ones(3)
    where = [slice(0, 0), slice(100, 100)]
    assert not flat_tops(held, where).any() and flat_tops(np.minimum(held, dps(150.0)), where).any()
    assert not flat_tops(0.2 * np.minimum(held, dps(150.0)), where).any()  # 30 °/s is no end of a range


def test_the_grade_is_the_worse_of_scale_and_bias():
    """Rest with noise of 0.1 °/s/√Hz over some 70 s leaves 0.01 °/s, which is fair, whatever the scale is."""
    found = fit(hand(1, white=dps(0.1))).calibration
    assert dps(0.005) < found.bias_sd.max() <= dps(0.05)
    assert found.quality.grade != "good"
    alone = fit(hand(1, white=dps(0.06))).calibration
    assert alone.bias_sd.max() > dps(0.005) and alone.matrix_sd.max() <= 0.002
    assert alone.quality.grade == "fair"


COUPLING = dps(0.1) / g(1.0) * np.array([[0.5, -0.3, 0.2], [0.9, 1.0, -0.7], [0.0, 0.4, -0.2]])
BIAS = dps(np.array([1.0, -12.0, 3.0]))


def poses(rng, count, noise, matrix=COUPLING):
    forces = rng.normal(size=(count, 3))
    forces *= G0 / np.linalg.norm(forces, axis=1, keepdims=True)
    return BIAS + forces @ matrix.T + noise * rng.normal(size=(count, 3)), forces


def test_coupling_at_rest_comes_back_with_errors_as_large_as_said_and_few_poses_tell_nothing():
    found = coupling_at_rest(*poses(np.random.default_rng(0), 20, 0.0))
    np.testing.assert_allclose(found.matrix, COUPLING, rtol=0, atol=1e-12)
    # its significance is that of the F test of nine coefficients: squares of a regression without them and with
    rates, forces = poses(np.random.default_rng(5), 12, dps(0.1))
    rows = np.column_stack((np.ones(12), forces))
    squares = np.sum((rates - rows @ np.linalg.lstsq(rows, rates)[0]) ** 2)
    gained = 12.0 * np.var(rates, axis=0).sum() - squares
    expected = stats.f.sf(gained / 9.0 / (squares / 24.0), 9, 24)
    assert coupling_at_rest(rates, forces).chance == pytest.approx(expected, rel=1e-6) and 1e-12 < expected < 0.01
    # nine entries of 40 captures: mean square over the variance said, 1.06 for t of 36, ± √(2 / 360)
    rng, squares = np.random.default_rng(1), []
    for _ in range(40):
        found = coupling_at_rest(*poses(rng, 40, dps(0.01)))
        squares.append(((found.matrix - COUPLING) / found.sd) ** 2)
    assert 0.8 < np.mean(squares) < 1.3
    # By its significance of 1 %: of 200 captures, more than 8 have a probability of 2e-4.
    rng = np.random.default_rng(3)
    assert coupling_at_rest(*poses(rng, FEWEST - 1, 0.0)) is None
    rates, forces = poses(rng, 30, dps(0.01))
    level = np.tile([0.0, 0.0, G0], (30, 1)) + 0.01 * forces
    assert coupling_at_rest(rates, level) is None
    none = [coupling_at_rest(*poses(rng, 30, dps(0.01), 0.0 * COUPLING)) for _ in range(200)]
    assert sum(coupling is not None for coupling in none) <= 8


@pytest.mark.parametrize("calibrated", [True, False])
def test_hand_motion_finds_it_with_a_calibrated_accelerometer_only(calibrated):
    session = hand(5)
    fit = fit_hand(Rates(session.t, session.gyr + session.acc @ COUPLING.T, session.acc, acc_calibrated=calibrated))
    made = fit.calibration
    if not calibrated:
        assert not made.g_sensitivity.any()
        return
    assert np.abs((made.g_sensitivity - COUPLING) / made.g_sensitivity_sd).max() < 4.5
    assert np.abs((made.bias - session.bias) / made.bias_sd).max() < 5.0
    assert any("depends on specific force" in str(remark) for remark in fit.remarks)


SESSION = hand(4, motions=16)
NOISE = np.random.default_rng(0).standard_normal(SESSION.gyr.shape)
RATE = np.abs(SESSION.gyr).max(axis=1)


@pytest.mark.parametrize(
    ("session", "kind"),
    [
        (hand(4, axis=[1.0, 0.0, 0.0]), "ill-conditioned"),
        (hand(4, axis=[0.0, 0.0, 1.0]), "no-motion"),
        (hand(4, motions=5), "too-few"),
        (SESSION._replace(acc=SESSION.acc + 3.0 * NOISE), "not-still"),
        (SESSION._replace(acc=SESSION.acc / G0 * 8.0), "wrong-gravity"),
        (SESSION._replace(gyr=SESSION.bias + 0.5 * (SESSION.gyr - SESSION.bias)), "implausible"),
        (SESSION._replace(gyr=SESSION.gyr * [0.0, 1.0, 1.0] + dps(0.01) * NOISE), "implausible"),
    ],
    ids=["one axis", "upright axis", "few", "shaken", "another gravity", "another unit", "an axis without answer"],
)
def test_a_capture_that_cannot_tell_is_refused(session, kind):
    assert reason_kinds(fit, session)[0] == kind


def test_few_clipped_motions_are_left_out_and_many_are_refused():
    assert any("clipping" in str(remark) for remark in fit(SESSION, clipped=np.sort(RATE)[-3] < RATE).remarks)
    assert reason_kinds(fit, SESSION, clipped=dps(60.0) < RATE) == ["clipping"]


@pytest.mark.parametrize(("gyr", "acc", "named"), [
    (-np.eye(3), np.eye(3), "−x, −y, −z"),
    (np.diag([1.0, 1.0, -1.0]), np.eye(3), "x, y, −z"),
    (np.eye(3)[[1, 0, 2]], np.eye(3), "y, x, z"),
    (np.eye(3)[[1, 2, 0]], np.eye(3), "z, x, y"),
    (np.eye(3), np.eye(3)[[1, 0, 2]], "−y, −x, −z"),  # a swap is a reflection: rates change their sign besides
])  # fmt: skip
def test_wrong_axes_are_named(gyr, acc, named):
    (reason, *_) = reasons(fit, SESSION._replace(gyr=SESSION.gyr @ gyr.T, acc=SESSION.acc @ acc.T))
    assert reason.kind == "implausible" and f"taken as {named} " in reason.text
