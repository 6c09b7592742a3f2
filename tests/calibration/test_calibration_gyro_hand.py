"""Scale and misalignment of a gyroscope by hand motion."""

import numpy as np
import pytest

from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.gyr.hand import fit_hand
from plumbob.calibration.gyr.plausible import Rates
from plumbob.core.constants import G0
from plumbob.core.units import dps
from tests.helpers.gyro_sessions import hand


def fit(session, **options):
    return fit_hand(Rates(session.t, session.gyr, session.acc, **({"acc_calibrated": True} | options)))


def kinds(refused):
    return [reason.kind for reason in refused.value.reasons]


def test_truth_lies_where_the_standard_deviations_say():
    inside, size = [], []
    for seed in range(12):
        session = hand(seed)
        found = fit(session).calibration
        z = np.concatenate((((found.matrix - session.matrix) / found.matrix_sd).ravel(),
                            (found.bias - session.bias) / found.bias_sd))  # fmt: skip
        inside.append(np.abs(z) < 1.0)
        size.append(float(np.mean(z**2)))
    assert 0.60 <= np.mean(inside) <= 0.78  # 144 of them, 68 % ± 2 × 3.9 %
    assert 0.6 <= np.mean(size) <= 1.5


def test_without_noise_the_matrix_is_exact_up_to_the_rule_of_integration():
    session = hand(1, rate=200.0, white=0.0, acc_sd=0.0)
    found = fit(session).calibration
    # The trapezoidal rule is exact for 1 − cos over its period, and the last instant at rest sees no rate.
    assert np.abs(found.matrix - session.matrix).max() < 1e-9
    assert np.abs(found.bias - session.bias).max() < 1e-12


def test_quality_and_method_tell_what_was_used():
    result = fit(hand(2))
    quality = result.calibration.quality
    assert quality.grade == "good"
    assert quality.samples + quality.outliers == len(result.measured) == len(result.residuals)
    assert 1.0 <= quality.condition < 20.0
    assert "motions against the accelerometer" in result.calibration.method
    assert not any("UNCALIBRATED" in remark for remark in result.remarks)


def test_an_uncalibrated_accelerometer_is_said_loudly():
    assert any("UNCALIBRATED" in remark for remark in fit(hand(2), acc_calibrated=False).remarks)


def test_one_motion_that_does_not_fit_is_set_aside():
    session = hand(3)
    gyr = session.gyr.copy()
    moving = np.abs(gyr - session.bias).max(axis=1) > dps(20.0)
    first = np.flatnonzero(moving)[:20]
    gyr[first] *= 1.3
    result = fit(session._replace(gyr=gyr))
    assert result.calibration.quality.outliers == 1
    assert np.abs(result.calibration.matrix - session.matrix).max() < 5.0 * result.calibration.matrix_sd.max()


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({"axis": [1.0, 0.0, 0.0]}, "ill-conditioned"),
        ({"axis": [0.0, 0.0, 1.0]}, "no-motion"),
        ({"motions": 5}, "too-few"),
    ],
)
def test_a_capture_that_cannot_tell_is_refused(change, kind):
    with pytest.raises(CaptureRefusedError) as refused:
        fit(hand(4, **change))
    assert kinds(refused)[0] == kind


def test_no_rest_is_refused():
    session = hand(5)
    rng = np.random.default_rng(0)
    shaken = session._replace(acc=session.acc + rng.normal(0.0, 3.0, session.acc.shape))
    with pytest.raises(CaptureRefusedError) as refused:
        fit(shaken)
    assert kinds(refused) == ["not-still"]


def test_clipped_motions_are_left_out_and_too_many_refused():
    session = hand(6)
    fast = np.abs(session.gyr).max(axis=1)
    few, many = fast > np.sort(fast)[-3], fast > dps(60.0)
    assert any("clipping" in remark for remark in fit(session, clipped=few).remarks)
    with pytest.raises(CaptureRefusedError) as refused:
        fit(session, clipped=many)
    assert kinds(refused) == ["clipping"]


def test_gravity_in_the_wrong_unit_is_refused():
    session = hand(7)
    with pytest.raises(CaptureRefusedError) as refused:
        fit(session._replace(acc=session.acc / G0 * 8.0))
    assert kinds(refused)[0] == "wrong-gravity"


def test_rates_in_the_wrong_unit_are_no_gyroscope():
    session = hand(8)
    with pytest.raises(CaptureRefusedError) as refused:
        fit(session._replace(gyr=session.bias + 0.5 * (session.gyr - session.bias)))
    assert kinds(refused)[0] in {"implausible", "ill-conditioned"}
