"""Times, rates and signs that are declared wrongly are noticed in Python too, and right ones are not."""

import re
import warnings

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, PlumbobWarning
from plumbob.data import ENOUGH
from plumbob.data.plausibility import ALL_AXES, NOT_KNOWN, bursts, doubts, statistics, upside_down

N = 3000
T = 0.01 * np.arange(N)


def nodding(*, t=T, rate=1.0, sign=1.0):
    """A body with z up that nods by 0.3 rad about y, acc = R(−angle) g by hand."""
    angle = 0.3 * np.sin(1.3 * T)
    acc = sign * 9.80665 * np.column_stack((-np.sin(angle), np.zeros(N), np.cos(angle)))
    gyr = rate * np.outer(0.39 * np.cos(1.3 * T), [0.0, 1.0, 0.0])
    return ImuData(t=t, gyr=gyr, acc=acc)


def told(imu, frame=Frame.ENU):
    """What `process` warns of, and nothing at the next chunk."""
    made = Filter("madgwick", frame=frame)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made.process(imu)
    assert all(issubclass(one.category, PlumbobWarning) and one.filename == __file__ for one in caught)
    return [str(one.message) for one in caught]


DOUBTFUL = {
    "milliseconds": (nodding(t=1e3 * T), r"^time: the usual step is 10 s, too long to follow a gyroscope.*t / 1000"),
    "too short": (nodding(t=1e-4 * T), "shorter than any MEMS part's"),
    # Nodding at up to 22 °/s: no value is impossible in rad/s, and no range is known.
    "°/s, small": (nodding(rate=180.0 / np.pi), "they look like °/s declared as rad/s"),
    # About the vertical by 23 °/s, of which the acceleration tells nothing.
    "°/s, level": (
        ImuData(t=T, gyr=np.tile([0.0, 0.0, 23.0], (N, 1)), acc=np.tile([0.0, 0.0, 9.81], (N, 1))),
        r"^gyroscope: \|gyr\| is 23 rad/s \(1318 °/s\) in the middle of 3000 samples.*units\.dps\(gyr\)",
    ),
}


@pytest.mark.parametrize("name", DOUBTFUL)
def test_what_is_wrong_is_doubted_and_what_is_right_is_not(name):
    imu, says = DOUBTFUL[name]
    (message,) = told(imu)
    assert re.search(says, message)
    assert told(nodding()) == []
    assert doubts(nodding(t=0.1 * np.arange(N))) == ()  # ten times slower: no unit of time is a factor of ten


@pytest.mark.parametrize(("frame", "sign"), [(Frame.ENU, -1.0), (Frame.NWU, -1.0), (Frame.NED, 1.0)])
def test_the_wrong_sign_of_gravity(frame, sign):
    (message,) = told(nodding(sign=sign), frame)
    assert f"{upside_down(nodding(sign=sign), frame)[0]}".replace("?.", "?") == message
    assert re.search("the unit is upside down throughout.*`sign`.*`axes`", message)
    assert upside_down(nodding(sign=-sign), frame) == ()


def test_upside_down_for_a_while_is_a_motion_and_one_window_alone_tells_nothing():
    imu = nodding()
    acc = imu.acc.copy()
    acc[: int(0.95 * N)] *= -1.0
    assert upside_down(ImuData(t=T, acc=acc), Frame.ENU) == ()
    assert upside_down(ImuData(t=T, gyr=imu.gyr), Frame.ENU) == ()
    # at rest, then a spin that begins within a window: whatever a mean of 0.2 s makes of it, it is one
    gyr = np.random.default_rng(0).normal(scale=0.003, size=(N, 3))
    acc = np.tile([0.0, 0.0, 9.81], (N, 1))
    gyr[-25:, 0] = 12.0
    acc[-25:] = 9.81 * np.array([0.0, -np.sin(0.4), np.cos(0.4)])  # turned against the rate
    assert doubts(ImuData(t=T, gyr=gyr, acc=acc)) == ()


def test_a_few_samples_and_the_next_chunk_are_not_looked_at():
    wrong = nodding(t=1e3 * T)
    assert told(wrong[: ENOUGH - 1]) == []
    running = Filter("mahony", frame=Frame.ENU)
    running.process(wrong[:10])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        running.process(wrong[10:])
        Filter("mahony", frame=Frame.ENU).process(wrong, look=False)


def test_bursts_are_even_over_a_second_and_gaps_are_not():
    rng = np.random.default_rng(1)
    even = np.arange(6000) * 0.01
    burst = np.floor(np.arange(6000) / 10) * 0.1 + (np.arange(6000) % 10) * 1e-3
    assert bursts(even) is None and bursts(even + 0.002 * rng.uniform(size=6000)) is None
    told = bursts(burst)
    assert str(told).startswith(
        "time: the stamps come in bursts: the usual step is 0.001 s, but 6000 rows in 59.909 s are one every"
    )
    assert 'rate = "100.135 Hz" alone' in str(told)  # 5999 steps in 59.909 s: without the last burst's pause
    assert bursts(np.cumsum(np.where(rng.random(6000) < 0.02, rng.exponential(2.0, 6000), 0.001))) is None
    assert bursts(np.concatenate((even[:3000], even[3000:] + 40.0))) is None


def test_the_statistics_of_a_triad_are_those_of_its_usable_samples():
    """One pass in blocks, against NumPy over the whole; absent and impossible samples do not count."""
    n = 40_000  # more than two blocks
    gyr = np.random.default_rng(3).normal(5.0, 1.0, (n, 3))
    gyr[::7] = np.nan
    gyr[5] = 1e6
    gyr[20_000:20_010] = gyr[19_999]
    gyr[30_001, 1] = gyr[30_000, 1]
    imu = ImuData(t=0.01 * np.arange(n), gyr=gyr)
    found, known = statistics(imu, "gyr"), np.isfinite(gyr).all(axis=1) & (np.abs(gyr) < 1e5).all(axis=1)
    assert found.samples == np.count_nonzero(known)
    assert found.mean == pytest.approx(gyr[known].mean(axis=0), rel=1e-12)
    assert found.std == pytest.approx(gyr[known].std(axis=0), rel=1e-12)
    assert found.norm == pytest.approx(np.median(np.linalg.norm(gyr[known], axis=1)), rel=1e-14)
    expected = np.full(n, NOT_KNOWN, dtype=np.uint8)
    expected[known] = 0
    expected[20_000:20_010][known[20_000:20_010]] = ALL_AXES
    expected[30_001] = 2 if known[30_001] and known[30_000] else expected[30_001]
    assert np.array_equal(found.repeats, expected)
    assert statistics(imu, "gyr") is found, "who asks again is not made to wait again"


def test_ends_of_a_range_that_nobody_declared():
    rng = np.random.default_rng(1)
    swing = np.outer(np.sin(2.6 * T), [2.0, 1.2, 0.1])
    noisy = swing + 0.01 * rng.standard_normal((N, 3))
    steady = np.where(np.abs(swing) < 0.8, 0.0, np.sign(swing))  # turns to and fro at one speed, with rests
    axes = {
        "xy": np.clip(noisy, -1.0, 1.0), "x": np.clip(noisy, -1.5, 1.6), "y": np.clip(noisy, -3.0, [3.0, 0.9, 3.0]),
        "": noisy,
    }  # fmt: skip
    for ends, gyr in axes.items():
        assert "".join(statistics(ImuData(t=T, gyr=gyr), "gyr").piles) == ends
    few = slice(0, 500)  # one swing: visited once, but at one size on both sides
    assert "".join(statistics(ImuData(t=T[few], gyr=np.clip(noisy, -1.0, 1.0)[few]), "gyr").piles) == "xy"
    for gyr in (np.round(swing, 2), np.round(10.0 * swing) / 10.0, steady[few]):  # coarse apexes, coarse plateaus
        assert not statistics(ImuData(t=T[: len(gyr)], gyr=gyr), "gyr").piles
