"""The judge of silence on traces made by hand; expected figures follow from counting samples."""

import math

import numpy as np
import pytest

from benchmarks.harness.silence import Claimed, Outcome, Run, judge

N = 9000


def bumps(*given):
    """90 s at 100 Hz; each bump is (first sample, sample after the last, size)."""
    found = np.zeros(N)
    for first, stop, size in given:
        found[first:stop] = size
    return found


def judged(*off, warned=(0, 0), heading_sd=None, judged_from=30.0, t=None):
    """Judge errors of the heading; `warned` are the first sample with a flag and the one after the last."""
    excess, up = bumps(*off), bumps((*warned, 1.0)) != 0.0
    claimed = None
    if heading_sd is not None:
        error = np.stack((np.abs(excess), np.zeros(N)), axis=1)
        claimed = Claimed(error, np.stack((np.full(N, heading_sd), np.ones(N)), axis=1))
    return judge(Run(np.arange(N) / 100.0 if t is None else t, excess, up, claimed), judged_from=judged_from)


def test_nothing_happens():
    found = judged()
    assert (found.by_flags, found.by_both, found.cell()) == (Outcome.RIGHT, Outcome.RIGHT, "right")
    assert (found.peak_deg, found.end_deg, found.off_s, found.silent_s, found.ratio) == (0.0, 0.0, 0.0, 0.0, None)


def test_two_degrees_are_right_and_a_smaller_error_than_that_of_the_clean_run_too():
    assert judged((3000, N, 2.0)).by_both == Outcome.RIGHT
    assert judged((3000, N, -9.0)).by_both == Outcome.RIGHT
    assert judged((3000, N, 2.001)).by_both == Outcome.WRONG


@pytest.mark.parametrize(("samples", "outcome"), [(100, Outcome.SAID), (101, Outcome.SILENT)])
def test_a_second_of_silence_is_allowed(samples, outcome):
    found = judged((3000, 3000 + samples, 9.0))
    assert (found.by_flags, found.by_both) == (outcome, outcome)
    assert found.silent_s == pytest.approx(samples / 100.0)
    assert found.peak_deg == 9.0


def test_silence_adds_up_over_a_run():
    found = judged((3000, 3060, 9.0), (5000, 5060, 9.0))
    assert (found.by_both, found.cell()) == (Outcome.SILENT, "9°/1.2s")


def test_a_flag_counts_while_it_is_up():
    found = judged((3000, 4000, 9.0), warned=(3050, 3950))
    assert (found.by_both, found.cell()) == (Outcome.SAID, "said 9°")
    assert (found.off_s, found.silent_s) == (pytest.approx(10.0), pytest.approx(1.0))
    assert judged((3000, 4000, 9.0), warned=(2000, 3000)).by_both == Outcome.SILENT


def test_wrong_at_the_end_is_the_mean_of_the_last_five_seconds_and_silent_for_most_of_them():
    assert judged((3000, N, 3.4)).cell() == "WRONG 3°"
    assert judged((3000, N, 3.4), warned=(8700, N)).by_both == Outcome.SILENT
    assert judged((3000, N, 3.4), warned=(3000, N)).by_both == Outcome.SAID
    assert judged((8800, N, 4.9)).by_both == Outcome.SILENT  # 200 of 501 samples: 1.96° on average


def test_what_is_not_finite_is_as_far_off_as_can_be():
    found = judged((3000, N, math.nan))
    assert (found.by_both, found.peak_deg, found.end_deg) == (Outcome.WRONG, 180.0, 180.0)


def test_what_comes_before_it_is_judged_does_not_count():
    assert judged((0, 3000, 90.0)).by_both == Outcome.RIGHT


def test_a_sample_behind_a_gap_stands_for_a_tenth_of_a_second():
    t = np.arange(N) / 100.0
    t[3000:] += 20.0
    found = judged((3000, 3091, 9.0), t=t)
    assert (found.by_both, found.silent_s) == (Outcome.SAID, pytest.approx(0.1 + 0.90))


@pytest.mark.parametrize(("sd", "outcome"), [(3.0, Outcome.SAID), (2.99, Outcome.WRONG)])
def test_an_error_of_three_claimed_standard_deviations_is_said(sd, outcome):
    found = judged((3000, N, 9.0), heading_sd=sd)
    assert (found.by_flags, found.by_both) == (Outcome.WRONG, outcome)
    assert found.silent_flags_s == pytest.approx(60.0)
    assert found.ratio == pytest.approx(9.0 / sd)
    assert not found.beyond


def test_both_parts_of_the_error_must_be_claimed_unless_they_are_small():
    heading, tilt = np.array([[90.0, 0.9], [90.0, 1.1]]), np.array([[60.0, 0.1], [60.0, 0.1]])
    assert Claimed(heading, tilt).said.tolist() == [True, False]
    assert Claimed(heading, tilt).ratio == pytest.approx([9.0, 11.0])
    assert Claimed(heading, np.zeros((2, 2))).ratio.tolist() == [math.inf, math.inf]


@pytest.mark.parametrize(("samples", "beyond"), [(10, False), (11, True)])
def test_an_error_beyond_five_claimed_standard_deviations_counts_from_a_tenth_of_a_second_on(samples, beyond):
    found = judged((3000, 3000 + samples, 9.0), heading_sd=1.5)
    assert (found.beyond, found.by_both) == (beyond, Outcome.SAID)
    assert found.cell() == ("said 9° 6σ" if beyond else "said 9°")
    assert not judged((0, 3000, 9.0), heading_sd=1.5).beyond
