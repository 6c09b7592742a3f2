"""The judges on traces made by hand, one for each verdict; expected figures follow from counting samples."""

import math

import numpy as np
import pytest

from benchmarks.harness import silence
from benchmarks.harness.silence import Claimed, Outcome, Run
from benchmarks.harness.verdict import Trace, Verdict, judge

N = 9000
T = np.arange(N) / 100.0
OFF = (3000, 3500, 30.0)
TO_THE_END = (3000, N, 3.4)
NO = {"errors": ("ValueError: no",)}
BARE = {"errors": ("AssertionError: ",), "clear": False}
START = {"begin": 0.0, "end": 0.01, "judged_from": 1.0}


def bumps(*given):
    """90 s at 100 Hz; each bump is (first sample, sample after the last, size)."""
    trace = np.zeros(N)
    for first, stop, size in given:
        trace[first:stop] = size
    return trace


def judged(*off, raised=(), errors=(), clear=True, begin=30.0, end=30.01, judged_from=30.0):
    up = np.isin(np.arange(N), raised)
    return judge(Trace(T, bumps(*off), up, errors, clear), begin=begin, end=end, judged_from=judged_from)


@pytest.mark.parametrize(("off", "how", "verdict", "cell"), [
    ([], {}, Verdict.OK, "ok"),
    ([(3000, 3500, 2.0)], {"raised": [3001]}, Verdict.OK, "ok*"),  # two degrees are still ok
    ([(3000, 3500, 2.001)], {}, Verdict.SILENT, "2°/5s"),
    # a flag counts from the fault to the recovery
    *(([OFF], {"raised": [when]}, Verdict.FLAGGED, "30°/5s*") for when in (3000, 3500)),
    *(([OFF], {"raised": [when]}, Verdict.SILENT, "30°/5s") for when in (0, 2999, 3501, 8999)),
    ([(3000, 3100, 30.0)], {"raised": [3200], "end": 31.0}, Verdict.SILENT, None),
    ([(3000, 3100, 30.0)], {"raised": [3200], "end": 35.0}, Verdict.FLAGGED, None),
    ([TO_THE_END], {}, Verdict.WRONG, "WRONG 3°"),
    ([TO_THE_END], {"raised": [3000]}, Verdict.WRONG, "WRONG 3°*"),
    ([(3000, 3100, 40.0), (3100, N, 1.0)], {}, Verdict.SILENT, None),  # one degree is back
    # 501 samples lie within the last 5 s: 40 of them 12° off are a mean of 0.96°, 45 one of 1.08°
    ([(8959, 8999, 12.0)], {}, Verdict.SILENT, None),
    ([(8954, 8999, 12.0)], {}, Verdict.WRONG, None),
    ([(3000, N, math.nan)], {"raised": [3000]}, Verdict.NAN, "NaN*"),
    ([(3000, 3100, math.nan)], {"raised": [3000]}, Verdict.FLAGGED, "180°/1s*"),  # as far off as can be
    ([], NO, Verdict.CLEAR_ERROR, "error"),
    ([OFF], NO, Verdict.CLEAR_ERROR, "error"),  # excuses what recovers
    ([TO_THE_END], NO, Verdict.WRONG, None),
    ([], BARE, Verdict.SILENT, None),
    ([TO_THE_END], BARE, Verdict.WRONG, None),
    ([(0, 100, 90.0)], START, Verdict.OK, "ok"),  # a start has one second
    ([(0, 101, 90.0)], START | {"raised": [5]}, Verdict.FLAGGED, "90°/1s*"),
    ([(3000, 5000, 20.0)], {"raised": [3000], "end": math.inf}, Verdict.FLAGGED, "20°/20s*"),
])  # fmt: skip
def test_a_verdict_follows_from_errors_and_flags(off, how, verdict, cell):
    found = judged(*off, **how)
    assert found.verdict == verdict
    assert cell is None or found.cell() == cell


def heard(*off, warned=(0, 0), heading_sd=None, judged_from=30.0, t=T):
    """Judge errors of the heading; `warned` are the first sample with a flag and the one after the last."""
    excess, up = bumps(*off), bumps((*warned, 1.0)) != 0.0
    claimed = None
    if heading_sd is not None:
        error = np.stack((np.abs(excess), np.zeros(N)), axis=1)
        claimed = Claimed(error, np.stack((np.full(N, heading_sd), np.ones(N)), axis=1))
    return silence.judge(Run(t, excess, up, claimed), judged_from=judged_from)


@pytest.mark.parametrize(("off", "how", "outcome", "silent_s"), [
    ([], {}, Outcome.RIGHT, 0.0),
    ([(3000, N, 2.0)], {}, Outcome.RIGHT, 0.0),
    ([(3000, N, -9.0)], {}, Outcome.RIGHT, 0.0),  # a smaller error than that of the clean run
    ([(3000, N, 2.001)], {}, Outcome.WRONG, 60.0),
    ([(3000, 3100, 9.0)], {}, Outcome.SAID, 1.0),  # a second of silence is allowed
    ([(3000, 3101, 9.0)], {}, Outcome.SILENT, 1.01),
    ([(3000, 3060, 9.0), (5000, 5060, 9.0)], {}, Outcome.SILENT, 1.2),
    ([(3000, 4000, 9.0)], {"warned": (3050, 3950)}, Outcome.SAID, 1.0),
    ([(3000, 4000, 9.0)], {"warned": (2000, 3000)}, Outcome.SILENT, 10.0),
    ([(3000, N, 3.4)], {"warned": (8700, N)}, Outcome.SILENT, 57.0),
    ([(3000, N, 3.4)], {"warned": (3000, N)}, Outcome.SAID, 0.0),
    ([(8800, N, 4.9)], {}, Outcome.SILENT, 2.0),  # 200 of the last 501 samples: 1.96° on average
    ([(3000, N, math.nan)], {}, Outcome.WRONG, 60.0),
    ([(0, 3000, 90.0)], {}, Outcome.RIGHT, 0.0),
    # a sample behind a gap stands for a tenth of a second
    ([(3000, 3091, 9.0)], {"t": T + 20.0 * (np.arange(N) >= 3000)}, Outcome.SAID, 0.1 + 0.90),
])  # fmt: skip
def test_an_outcome_follows_from_how_long_nothing_was_said(off, how, outcome, silent_s):
    found = heard(*off, **how)
    assert (found.by_flags, found.by_both) == (outcome, outcome)
    assert found.silent_s == pytest.approx(silent_s)


@pytest.mark.parametrize(("sd", "outcome"), [(3.0, Outcome.SAID), (2.99, Outcome.WRONG)])
def test_an_error_of_three_claimed_standard_deviations_is_said(sd, outcome):
    found = heard((3000, N, 9.0), heading_sd=sd)
    assert (found.by_flags, found.by_both, found.beyond) == (Outcome.WRONG, outcome, False)
    assert (found.silent_flags_s, found.ratio) == (pytest.approx(60.0), pytest.approx(9.0 / sd))
    # both parts of the error must be claimed unless they are small
    heading, tilt = np.array([[90.0, 0.9], [90.0, 1.1]]), np.array([[60.0, 0.1], [60.0, 0.1]])
    assert Claimed(heading, tilt).said.tolist() == [True, False]
    assert Claimed(heading, tilt).ratio == pytest.approx([9.0, 11.0])
    assert Claimed(heading, np.zeros((2, 2))).ratio.tolist() == [math.inf, math.inf]


@pytest.mark.parametrize(("samples", "beyond"), [(10, False), (11, True)])
def test_an_error_beyond_five_claimed_standard_deviations_counts_from_a_tenth_of_a_second_on(samples, beyond):
    found = heard((3000, 3000 + samples, 9.0), heading_sd=1.5)
    assert (found.beyond, found.by_both) == (beyond, Outcome.SAID)
    assert not heard((0, 3000, 9.0), heading_sd=1.5).beyond
    assert (found.peak_deg, heard((3000, N, math.nan)).peak_deg) == (9.0, 180.0)  # not finite: as far off as can be
