"""Hand motion whose axes, signs or range are not what was declared, and the grade of what it gives."""

import numpy as np
import pytest

from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.gyr.hand import fit_hand, flat_tops
from plumbob.calibration.gyr.plausible import Rates
from plumbob.core.units import dps
from tests.helpers.gyro_sessions import hand


def fit(session):
    return fit_hand(Rates(session.t, session.gyr, session.acc, acc_calibrated=True))


def refusal(t, gyr, acc):
    with pytest.raises(CaptureRefusedError) as refused:
        fit_hand(Rates(t, gyr, acc, acc_calibrated=True))
    return refused.value.reasons[0]


@pytest.mark.parametrize(
    ("way", "named"),
    [
        (-np.eye(3), "−x, −y, −z"),
        (np.diag([1.0, 1.0, -1.0]), "x, y, −z"),
        (np.eye(3)[[1, 0, 2]], "y, x, z"),
        (np.eye(3)[[1, 2, 0]], "z, x, y"),
    ],
)
def test_wrong_axes_of_the_gyroscope_are_named(way, named):
    session = hand(1)
    reason = refusal(session.t, session.gyr @ way.T, session.acc)
    assert reason.kind == "implausible" and f"taken as {named} " in reason.text and "axes and signs" in reason.advice


def test_an_axis_that_answers_with_noise_only_is_no_lack_of_turns():
    session = hand(1)
    gyr = session.gyr * [0.0, 1.0, 1.0] + dps(0.01) * np.random.default_rng(0).standard_normal(session.gyr.shape)
    reason = refusal(session.t, gyr, session.acc)
    assert reason.kind == "implausible" and "each axis of the gyroscope answers" in reason.advice


def test_swapped_axes_of_the_accelerometer_are_named():
    """A swap is a reflection, under which rates change their sign besides."""
    session = hand(1)
    reason = refusal(session.t, session.gyr, session.acc[:, [1, 0, 2]])
    assert reason.kind == "implausible" and "taken as −y, −x, −z " in reason.text


def test_flat_tops_that_no_range_declares_are_left_out():
    session = hand(1)
    fastest = np.abs(session.gyr).max()
    limit = 0.8 * fastest
    result = fit_hand(Rates(session.t, np.clip(session.gyr, -limit, limit), session.acc, acc_calibrated=True))
    assert any("does not declare" in remark for remark in result.remarks)
    found = result.calibration
    assert (np.abs(found.matrix - session.matrix) <= 5.0 * found.matrix_sd).all()
    assert not any("does not declare" in r for r in fit(session).remarks)


def test_a_slow_sensor_repeats_itself_without_a_flat_top():
    rate = dps(200.0) * np.sin(np.linspace(0.0, np.pi, 25))
    held = np.repeat(rate, 4)[:, np.newaxis] * np.ones(3)
    where = [slice(0, 0), slice(100, 100)]
    assert not flat_tops(held, where).any()
    assert flat_tops(np.minimum(held, dps(150.0)), where).any()
    assert not flat_tops(0.2 * np.minimum(held, dps(150.0)), where).any()  # 30 °/s is no end of a range


def test_the_grade_is_the_worse_of_scale_and_bias():
    """Rest with noise of 0.1 °/s/√Hz over some 70 s leaves 0.01 °/s, which is fair, whatever the scale is."""
    found = fit(hand(1, white=dps(0.1))).calibration
    assert dps(0.005) < found.bias_sd.max() <= dps(0.05)
    assert found.quality.grade != "good"
    alone = fit(hand(1, white=dps(0.06))).calibration
    assert alone.bias_sd.max() > dps(0.005) and alone.matrix_sd.max() <= 0.002
    assert alone.quality.grade == "fair"
