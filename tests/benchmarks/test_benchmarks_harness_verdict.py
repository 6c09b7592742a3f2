"""The judge on traces made by hand, one for each verdict; expected figures follow from counting samples."""

import math

import numpy as np
import pytest

from benchmarks.harness.verdict import Trace, Verdict, judge

N = 9000


def judged(*bumps, raised=(), errors=(), clear=True, begin=30.0, end=30.01, judged_from=30.0):
    """Judge 90 s at 100 Hz; each bump is (first sample, sample after the last, degrees)."""
    excess = np.zeros(N)
    for first, stop, size in bumps:
        excess[first:stop] = size
    up = np.zeros(N, dtype=bool)
    up[list(raised)] = True
    trace = Trace(np.arange(N) / 100.0, excess, up, errors, clear)
    return judge(trace, begin=begin, end=end, judged_from=judged_from)


def test_nothing_happens():
    found = judged()
    assert (found.verdict, found.peak_deg, found.recover_s, found.cell()) == (Verdict.OK, 0.0, 0.0, "ok")


def test_two_degrees_are_still_ok_and_a_flag_shows_as_a_star():
    found = judged((3000, 3500, 2.0), raised=[3001])
    assert (found.verdict, found.peak_deg, found.cell()) == (Verdict.OK, 2.0, "ok*")
    assert judged((3000, 3500, 2.001)).verdict == Verdict.SILENT


@pytest.mark.parametrize("when", [3000, 3001, 3499, 3500])
def test_a_flag_from_the_fault_to_the_recovery_counts(when):
    found = judged((3000, 3500, 30.0), raised=[when])
    assert (found.verdict, found.peak_deg) == (Verdict.FLAGGED, 30.0)
    assert found.recover_s == pytest.approx(35.0 - 30.01)
    assert found.cell() == "30°/5s*"


@pytest.mark.parametrize("when", [0, 2999, 3501, 8999])
def test_a_flag_before_or_after_is_none(when):
    found = judged((3000, 3500, 30.0), raised=[when])
    assert (found.verdict, found.flagged, found.cell()) == (Verdict.SILENT, False, "30°/5s")


def test_a_flag_after_a_deviation_that_ended_with_the_fault_is_none():
    assert judged((3000, 3100, 30.0), raised=[3200], end=31.0).verdict == Verdict.SILENT
    assert judged((3000, 3100, 30.0), raised=[3200], end=35.0).verdict == Verdict.FLAGGED


def test_off_at_the_end_is_wrong_with_or_without_a_flag():
    assert judged((3000, N, 3.4)).cell() == "WRONG 3°"
    found = judged((3000, N, 3.4), raised=[3000])
    assert (found.verdict, found.recover_s, found.cell()) == (Verdict.WRONG, None, "WRONG 3°*")
    assert judged((3000, 3100, 40.0), (3100, N, 1.0)).verdict == Verdict.SILENT  # one degree is back


def test_the_mean_of_the_last_five_seconds_decides_where_it_ends():
    """501 samples lie within the last 5 s: 40 of them 12° off are a mean of 0.96°, 45 one of 1.08°."""
    assert judged((8959, 8999, 12.0)).verdict == Verdict.SILENT
    assert judged((8954, 8999, 12.0)).verdict == Verdict.WRONG


def test_not_finite_at_the_end_is_nan_for_ever():
    found = judged((3000, N, math.nan), raised=[3000])
    assert (found.verdict, found.peak_deg, found.recover_s, found.cell()) == (Verdict.NAN, 180.0, None, "NaN*")


def test_not_finite_for_a_while_is_as_far_off_as_can_be():
    found = judged((3000, 3100, math.nan), raised=[3000])
    assert (found.verdict, found.peak_deg) == (Verdict.FLAGGED, 180.0)


def test_a_clear_error_excuses_what_recovers():
    assert judged(errors=("ValueError: no",)).verdict == Verdict.CLEAR_ERROR
    assert judged((3000, 3500, 30.0), errors=("ValueError: no",)).cell() == "error"
    assert judged((3000, N, 3.0), errors=("ValueError: no",)).verdict == Verdict.WRONG


def test_an_error_without_a_text_excuses_nothing():
    assert judged(errors=("AssertionError: ",), clear=False).verdict == Verdict.SILENT
    assert judged((3000, N, 3.0), errors=("AssertionError: ",), clear=False).verdict == Verdict.WRONG


def test_a_start_has_one_second():
    start = {"begin": 0.0, "end": 0.01, "judged_from": 1.0}
    assert judged((0, 100, 90.0), **start).verdict == Verdict.OK
    found = judged((0, 101, 90.0), raised=[5], **start)
    assert (found.verdict, found.recover_s) == (Verdict.FLAGGED, pytest.approx(1.0))


def test_a_fault_that_lasts_is_timed_from_its_beginning():
    found = judged((3000, 5000, 20.0), raised=[3000], end=math.inf)
    assert (found.verdict, found.recover_s) == (Verdict.FLAGGED, pytest.approx(20.0))
