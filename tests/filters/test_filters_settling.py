"""When a start is converged: at once at rest, by an upright mean in motion, after a time at the latest."""

import math

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, flags
from plumbob.core.constants import G0
from plumbob.filters.settling import LONGEST, REST_TURN, SIZE_BAND, STEADY, STEADY_FOR, UPRIGHT_FOR, trial_time
from plumbob.filters.start import upright
from plumbob.rotations import quat_angle, quat_rotate


def level(seconds=10.0, *, rate=100.0, turning=0.5, force=(0.0, 0.0, G0)):
    """A unit that turns about the vertical, under a specific force that is constant in the body."""
    t = np.arange(round(seconds * rate)) / rate
    alive = 1e-9 * np.random.default_rng(0).normal(size=(t.size, 3))  # the same bits for long would be stuck sensors
    return ImuData(t=t, gyr=[0.0, 0.0, turning] + alive, acc=force + alive)


def flagged(data, name="complementary", **settings):
    return (Filter(name, frame=Frame.ENU, **settings).process(data).flags & flags.NOT_CONVERGED) != 0


def converged_after(data, name="complementary"):
    """Time of the first sample that is converged, s; it stays so."""
    bad = flagged(data, name)
    first = int(np.argmin(bad))
    assert not bad[first:].any()
    return data.t[first]


ONE_STEP = 0.011
"""A step, s, and the rounding of its sum."""


def test_in_motion_an_upright_mean_converges():
    """A slow accelerometer takes as long; the time counts from its first force; while it is silent it shows nothing."""
    data, fast = level(), level(rate=400.0)
    assert converged_after(data) == pytest.approx(UPRIGHT_FOR, abs=ONE_STEP)
    t = data.t[:, np.newaxis]
    for of, absent, expected, within in (
        (fast, np.arange(len(fast))[:, np.newaxis] % 4 != 0, UPRIGHT_FOR, ONE_STEP),
        (data, t < 2.0, 2.0 + UPRIGHT_FOR, ONE_STEP),
        (data, (t > 1.0) & (t < 6.0), 5.0 + UPRIGHT_FOR, 0.11),  # its last value holds for 0.1 s
    ):
        imu = ImuData(t=of.t, gyr=of.gyr, acc=np.where(absent, np.nan, of.acc))
        assert converged_after(imu) == pytest.approx(expected, abs=within)


@pytest.mark.parametrize(("turning", "size", "at_once"), [
    (0.99 * REST_TURN, G0 + 0.99 * SIZE_BAND, True),
    (1.01 * REST_TURN, G0, False),
    (0.0, G0 + 1.01 * SIZE_BAND, False),
    (0.0, G0 - 1.01 * SIZE_BAND, False),
])  # fmt: skip
def test_at_rest_the_first_sample_converges(turning, size, at_once):
    bad = flagged(level(1.0, turning=turning, force=(0.0, 0.0, size)))
    assert bad.all() != at_once
    assert bad.any() != at_once


@pytest.mark.parametrize(("turning", "size", "rests"), [
    (0.34, 1.09 * G0, True),  # a gyroscope of 20 °/s of bias and an accelerometer of 9 %
    (0.36, 1.09 * G0, False),
    (0.34, 1.11 * G0, False),
])  # fmt: skip
def test_an_uncalibrated_unit_at_rest_takes_a_second(turning, size, rests):
    after = converged_after(level(turning=turning, force=(0.0, 0.0, size)))
    assert after == pytest.approx(STEADY_FOR if rests else UPRIGHT_FOR, abs=ONE_STEP)


@pytest.mark.parametrize("which", ["gyr", "acc"])
@pytest.mark.parametrize(("change", "rests"), [(0.9, True), (1.1, False)])
def test_what_moves_in_that_second_does_not_rest(which, change, rests):
    """Half a second after the start, on one axis, by a little less or more than a unit at rest may."""
    data = level(turning=0.34, force=(0.0, 0.0, 1.09 * G0))
    values = {"gyr": data.gyr.copy(), "acc": data.acc.copy()}
    values[which][50:, 0] += change * dict(zip(("acc", "gyr"), STEADY, strict=True))[which]
    after = converged_after(ImuData(t=data.t, **values))
    assert (after == pytest.approx(STEADY_FOR, abs=ONE_STEP)) == rests


def test_a_gap_is_another_start_and_its_length_does_not_count():
    data = level()
    t = np.where(data.t < 5.0, data.t, data.t + 2.0 * LONGEST)
    bad = flagged(ImuData(t=t, gyr=data.gyr, acc=data.acc))
    again = np.flatnonzero(bad & (t > 5.0))
    assert again[0] == 500
    assert t[again[-1]] - t[500] == pytest.approx(UPRIGHT_FOR, abs=ONE_STEP)


def test_the_longest_trial_is_by_what_a_filter_can_forget():
    """A unit that leans at once, and for ever, by 6°, as the force says: an acceleration without an end.

    A filter that integrates is flagged as long. Of one that corrects a minute of time constant holds the lean above 3°
    for 42 s; ten minutes, beyond the longest trial.
    """
    assert (trial_time(("acc",)), trial_time(("gyr", "acc")), trial_time(("gyr",))) == (0.0, LONGEST, math.inf)
    data = level(LONGEST + 2.0)
    lean = np.where(data.t[:, np.newaxis] == 0.0, [0.0, 0.0, 0.0], [math.tan(math.radians(6.0)) * G0, 0.0, 0.0])
    data = ImuData(t=data.t, gyr=[0.0, 0.0, 1e-3] + 0.0 * data.gyr, acc=data.acc * [1, 1, 1.05] + lean)
    assert flagged(data, "integrate").all()
    bad = flagged(data, "complementary", params={"tau_tilt": "10 min"})
    assert data.t[np.argmin(bad)] == pytest.approx(LONGEST, abs=ONE_STEP)


@pytest.mark.parametrize("up", [1.0, -1.0])
@pytest.mark.parametrize("angle", [0.0, 1e-8, 1.0, math.pi / 2.0, 3.0, math.pi - 1e-8, math.pi])
def test_upright_is_the_shortest_turn(up, angle):
    """The turn is as large as the angle between the vector and up; upside down it is a half turn about x."""
    e = up * np.array([math.sin(angle) * 0.6, math.sin(angle) * 0.8, math.cos(angle)])
    if angle == math.pi:
        e = np.array([0.0, 0.0, -up])
        assert upright(up, *e) == (0.0, 1.0, 0.0, 0.0)
    q = np.array(upright(up, *e))
    np.testing.assert_allclose(quat_rotate(q, e), [0.0, 0.0, up], rtol=0.0, atol=1e-15)  # a few roundings
    assert (quat_angle(q, [1.0, 0.0, 0.0, 0.0]), q[3]) == (pytest.approx(angle, abs=1e-15), 0.0)


def test_a_unit_that_is_upside_down_though_level_was_said_is_turned_up():
    data = ImuData(t=np.arange(1000) / 100.0, gyr=np.zeros((1000, 3)), acc=np.tile([0.0, 0.0, -G0], (1000, 1)))
    q = Filter("vqf", frame=Frame.ENU, init="level").process(data).q_nb[-1]
    np.testing.assert_allclose(quat_rotate(q, [0.0, 0.0, -1.0]), [0.0, 0.0, 1.0], rtol=0.0, atol=1e-9)
