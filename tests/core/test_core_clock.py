"""Nanoseconds in, nanoseconds out."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import example, given

from plumbob.core.errors import ClockError
from plumbob.core.time import Timing, is_gap, timing, to_ns, to_s

DAY_NS = 86_400 * 10**9
LIMIT_NS = 2**23 * 10**9  # up to 2²³ s neighbouring float64 are 2⁻³⁰ s = 0.93 ns apart or less

nanoseconds = st.integers(-LIMIT_NS + 1, LIMIT_NS - 1)


@given(nanoseconds)
@example(LIMIT_NS - 1)
@example(int(50.2 * DAY_NS) + 1)
@example(123_456_789)
def test_every_nanosecond_comes_back(t_ns):
    assert to_ns(to_s(np.array([t_ns])))[0] == t_ns


@pytest.mark.parametrize("days", [0, 1, 26, 48.6, 50, 52, 53, 97])
def test_runs_of_neighbouring_nanoseconds_come_back(days):
    """Between 48 and 52 days ``rint(t * 1e9)``, with its two roundings, misses every fourth one by 1 ns."""
    t_ns = int(days * DAY_NS) + np.arange(10_000)
    t = to_s(t_ns)
    assert (np.diff(t) > 0).all() and np.array_equal(to_ns(t), t_ns)


def test_seconds_are_the_decimal_number_up_to_the_limit():
    assert to_s(np.array([300_000_000, 1, -10_000_000])).tolist() == [0.3, 1e-9, -0.01]
    assert to_ns(np.array([0.1 + 0.2, -0.3, 1e-9, 4e-10, 6e-10])).tolist() == [300_000_000, -300_000_000, 1, 0, 1]
    assert to_ns(np.array([np.nextafter(2.0**23, 0)]))[0] == LIMIT_NS - 1
    assert to_ns(np.array([1.0])).dtype == np.int64
    assert to_s(np.array([1], dtype=np.int64)).dtype == np.float64
    for t in (2.0**23, -(2.0**23), 1.7e9, 1e300, np.inf, np.nan):
        with pytest.raises(ClockError, match=r"seconds count from the start.*end at 8388608 s.*t - t\[0\]"):
            to_ns(np.array([0.0, t]))


class TestTiming:
    def test_gaps_are_steps_longer_than_five_medians_and_jitter_the_spread_of_regular_ones(self):
        assert timing(0.01 * np.arange(101)) == Timing(101, 1.0, 100.0, 0.0, 0, 0.01)
        dt_ns = np.full(100, 10_000_000)
        dt_ns[[20, 50, 80]] = 50_000_000, 50_000_001, 3_000_000_000  # exactly five medians is no gap
        t = to_s(np.concatenate(([0], np.cumsum(dt_ns))))
        found = timing(t)
        assert (found.gaps, found.longest, found.rate) == (2, 3.0, 100.0)
        assert np.flatnonzero(is_gap(np.diff(to_ns(t)))).tolist() == [50, 80]
        dt_ns = np.tile([9_000_000, 11_000_000], 50)
        t = to_s(np.concatenate(([0], np.cumsum(dt_ns))))
        assert timing(t).jitter == pytest.approx(1e-3, rel=1e-12)
        one = timing(np.array([5.0]))
        assert (one.samples, one.duration, one.gaps) == (1, 0.0, 0)
        assert np.isnan(one.rate)
        assert is_gap(np.zeros(0, dtype=np.int64)).tolist() == []
        assert is_gap(np.array([4_000_000_000])).tolist() == [False]

    @pytest.mark.parametrize(
        ("hertz", "lost", "late"),
        [(286.0, 0.05, 0), (104.0, 0.05, 0), (60.0, 0.0, 0), (850.0, 0.0, 0), (1000.0, 0.01, 0), (104.0, 0.0, 0.2)],
    )
    def test_the_rate_of_stamps_in_whole_milliseconds_is_that_of_the_samples(self, hertz, lost, late):
        scatter = late * np.sin(np.arange(5000.0) ** 2)  # of stamps, in steps
        ms = np.floor(1e3 / hertz * (np.arange(5000) + scatter) + 1e-6)[np.random.default_rng(1).random(5000) >= lost]
        assert timing(ms / 1e3).rate == pytest.approx(hertz, rel=1e-3)

    @pytest.mark.parametrize("start", [0.0, 0.1, 1e6, 8e6])
    def test_the_verdict_does_not_depend_on_the_start(self, start):
        """In float64 differences, five steps of 0.01 s are sometimes longer than 5 × 0.01 s."""
        t = start + 0.01 * np.concatenate((np.arange(50), np.arange(54, 100)))
        assert timing(t).gaps == 0
