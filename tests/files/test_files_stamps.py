"""Stamps that are no clock: every sample keeps its place, and what was done is said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plumbob.core.errors import ClockError
from plumbob.files.stamps import time_line, utc_of_gps

MS = 1e6


def test_stamps_that_increase_are_taken_as_they_are():
    line = time_line(np.array([3.0, 4.0, 4.5, 9.0]), MS)
    assert (line.t_ns.tolist(), line.notes) == ([3_000_000, 4_000_000, 4_500_000, 9_000_000], ())


@settings(deadline=None)
@given(
    rate=st.floats(150.0, 5000.0),
    quantum=st.sampled_from([1.0, 2.0, 5.0, 10.0]),
    jitter=st.floats(0.0, 0.5),
    seed=st.integers(0, 99),
)
def test_coarse_and_late_stamps_become_the_clock_that_made_them(rate, quantum, jitter, seed):
    """Host stamps in whole quanta of ms, late by up to a part of one: the true time is known within one of them."""
    true = np.arange(3000) / rate * 1e3
    late = np.random.default_rng(seed).uniform(0.0, jitter * quantum, true.size)
    stamps = np.floor((true + late) / quantum) * quantum
    line = time_line(stamps, MS)
    assert (np.diff(line.t_ns) > 0).all()
    error = line.t_ns / MS - true
    assert np.ptp(error) <= 2.0 * quantum
    if (np.diff(stamps) <= 0.0).any():
        assert np.ptp(error) <= 0.5 * quantum  # a line through them is far better than any of them
        assert f"of {true.size} stamps repeat or go back" in str(line.notes[0])


@pytest.mark.parametrize(
    ("first", "step", "wraps", "unit_ns", "said"),
    [
        (2**32 - 500_000, 10_000, 2**32, 1e3, "4294967296"),
        (65_000, 10, 2**16, 1e6, "65536"),
        (86_399.0, 0.01, 86_400, 1e9, "midnight"),
        (604_799.5, 0.005, 604_800, 1e9, "the end of the week"),
        (700, 10, 1000, 1e6, "1000"),
        (3_599.0, 0.01, 3600, 1e9, "the hour"),
        (58.0, 0.01, 60, 1e9, "the minute"),
    ],
)
def test_counters_and_clocks_that_begin_again_go_on(first, step, wraps, unit_ns, said):
    counts = first + step * np.arange(1200)
    line = time_line(counts % wraps, unit_ns)
    assert np.diff(line.t_ns) == pytest.approx(step * unit_ns, abs=1.0)
    assert said in str(line.notes[0])


def test_bursts_are_spread_a_gap_stays_one_and_a_stamp_that_is_wrong_moves_alone():
    stamps = np.repeat(np.arange(100) * 32.0, 16)  # sixteen samples of 500 Hz at a time
    assert np.diff(time_line(stamps, MS).t_ns) == pytest.approx(2e6, rel=1e-3)
    seconds = np.floor(np.arange(0.37, 5.37, 0.01))
    assert np.diff(time_line(seconds, 1e9).t_ns) == pytest.approx(1e7, rel=2.5e-3)  # a new one is known to 10 ms in 4 s
    stamps = np.floor(np.concatenate([np.arange(900), 12_000 + np.arange(900)]) / 0.9)
    steps = np.diff(time_line(stamps, MS).t_ns) / MS
    assert (np.flatnonzero(steps > 5.0).tolist(), steps[899]) == ([899], pytest.approx(11_101 / 0.9, abs=2.0))
    stamps = np.where(np.arange(1000) == 500, 1e9, np.arange(1000.0))
    assert time_line(stamps, MS).t_ns == pytest.approx(np.arange(1000) * MS, abs=MS)


@pytest.mark.parametrize("is_last", [False, True])
def test_rows_without_a_stamp_lie_evenly_in_their_burst_and_do_not_fill_a_gap(is_last):
    """Bursts of 8 at 200 Hz, 20 of them lost behind the fourth: 5 ms a step, but 20 bursts of 40 ms more once."""
    true = 5.0 * np.arange(12 * 8) + np.where(np.arange(12 * 8) < 4 * 8, 0.0, 20 * 40.0)
    line = time_line(np.where(np.arange(true.size) % 8 == (7 if is_last else 0), true, np.nan), MS)
    assert line.t_ns.tolist() == (true * MS).astype(int).tolist()
    assert "84 of 96 rows have no stamp" in str(line.notes[0])
    assert f"the {'last' if is_last else 'first'} row of its burst" in str(line.notes[0])
    assert line.notes[0].values["rate"] == pytest.approx(200.0)


@pytest.mark.parametrize(
    ("stamps", "match"),
    [
        (np.r_[np.arange(100.0), np.arange(100.0)], "begins again at row 101: 99 is followed by 0"),
        (np.tile(np.arange(1000.0), 2), "begins again at row 1001"),  # a second recording as well as a counter
        (np.zeros(5), "all 5 time stamps are 0"),
        (np.arange(5.0)[::-1], "no time stamp is later than the one before"),
        (np.random.default_rng(0).permutation(np.arange(500.0)), "not as a clock jitters"),
        (np.array([0.0, np.nan, np.nan]), "row 2 has no time stamp"),
    ],
)
def test_what_is_no_time_is_refused_and_nothing_is_said_of_sorting_or_dropping(stamps, match):
    with pytest.raises(ClockError, match=match) as refusal:
        time_line(stamps, MS)
    assert not any(word in str(refusal.value) for word in ("sort", "drop"))


def test_gps_time_is_utc_less_the_leap_seconds_of_then():
    """IS-GPS-200: week 0 began on 1980-01-06; 18 leap seconds from 2017 on, 13 from 1999 to 2006, none in 1980."""
    assert utc_of_gps(0, 0) == np.datetime64("1980-01-06T00:00:00", "ns").astype(int)
    assert utc_of_gps(1969, 137_649_863_104_000) == np.datetime64("2017-10-02T14:13:51.863104", "ns").astype(int)
    assert utc_of_gps(1042, 345_600 * 10**9) == np.datetime64("1999-12-29T23:59:47", "ns").astype(int)
