"""Some faults for real: our filters, the battery of arguments, and peers where they are installed."""

import math
import sys

import numpy as np
import pytest

from benchmarks.harness.battery import ApiVerdict, child, run_battery
from benchmarks.harness.contender import OurFilter, contender_of
from benchmarks.harness.fault_cases import CASES, GROUPS, choose
from benchmarks.harness.fault_scene import USUAL, record
from benchmarks.harness.faults import listen, measure_faults
from benchmarks.harness.peers import peers
from benchmarks.harness.verdict import Verdict
from plumbob.core.errors import ParameterError
from plumbob.filters.offline import Stage


def ours(name, **params):
    return OurFilter(Stage(name, params))


def measured(contender, *names):
    return measure_faults([contender], choose(names, CASES, GROUPS), arguments=False).verdicts[contender.name]


@pytest.fixture(scope="module")
def some():
    """Cases that say something about the harness, whatever becomes of the filters' tuning."""
    names = ["nan_gyr_1", "zero_gyr_5s", "dt_nan_1", "mag_skipped_30s", "gap_60s", "start_clean"]
    return measure_faults([ours("integrate"), ours("mahony")], choose(names, CASES, GROUPS), arguments=False)


@pytest.mark.parametrize("name", ["integrate", "mahony"])
def test_an_absent_sample_is_flagged_and_a_time_that_is_nan_a_clear_error(some, name):
    absent, timeless = some.verdicts[name]["nan_gyr_1"], some.verdicts[name]["dt_nan_1"]
    assert (absent.verdict, absent.flags) == (Verdict.OK, ("gyr-absent", "gyr-held"))
    assert timeless.verdict == Verdict.CLEAR_ERROR
    assert timeless.errors == ("ClockError: t_ns must be a whole number of nanoseconds, but it is nan.",)
    assert timeless.peak_deg < 2.0  # the next step is twice as long


def test_a_dead_gyroscope_leaves_an_integrator_wrong_and_says_which_sensor(some):
    dead = some.verdicts["integrate"]["zero_gyr_5s"]
    assert (dead.verdict, dead.recover_s) == (Verdict.WRONG, None)
    assert "gyr-stuck" in dead.flags
    assert some.verdicts["mahony"]["start_clean"].flags == ()  # those of the clean run do not count
    assert "mag-absent" in some.verdicts["mahony"]["mag_skipped_30s"].flags
    assert "gap" in some.verdicts["mahony"]["gap_60s"].flags
    assert all(word in some.text() for word in ("integrate", "mahony", "dt_nan_1", "WRONG"))


def test_scores_add_up_and_leave_out_the_clean_start(some):
    for name in ("integrate", "mahony"):
        score = some.score(name)
        assert score.cases == sum(score.counts.values()) == 5
        good = score.counts[Verdict.OK] + score.counts[Verdict.CLEAR_ERROR]
        assert score.strict == pytest.approx(100.0 * good / 5)
        assert score.passed == pytest.approx(100.0 * (good + score.counts[Verdict.FLAGGED]) / 5)
    # an integrator turns away with |bias| = √3 · 0.1 °/s at most: 26° in 150 s
    assert 0.0 < some.clean_rms_deg["integrate"] < math.sqrt(3.0) * 0.1 * 150.0
    again = measure_faults([ours("integrate")], some.cases, arguments=False)
    assert again.verdicts["integrate"] == some.verdicts["integrate"]
    without = measured(ours("mahony", mag=False), "huge1e30_mag_1")["huge1e30_mag_1"]
    assert without.peak_deg == 0.0  # parameters reach the filter


def test_the_smoother_takes_part_without_a_lag():
    smoother = contender_of(Stage("smoother", {}))
    found = measured(smoother, "nan_gyr_1", "dt_nan_1", "reordered_pairs_1s")
    assert {one.verdict for one in found.values()} <= {Verdict.OK, Verdict.FLAGGED}
    assert "gyr-absent" in found["nan_gyr_1"].flags and "time-fault" in found["dt_nan_1"].flags
    assert "time-fault" in found["reordered_pairs_1s"].flags


TAKEN = (
    "negative stride, every second of six, column of a Fortran table, read-only, memoryview, list, tuple, int64, "
    "float32, float16, big-endian, None"
)


def test_arguments_that_mean_something_are_taken_with_the_same_bits_and_others_are_refused():
    """Of constructors, a declination has a sign, and an infinite max_gap is none."""
    verdicts = run_battery(ours("mahony")).verdicts
    assert set(verdicts.values()) == {ApiVerdict.ACCEPTED, ApiVerdict.CLEAR_ERROR}
    accepted = {name.partition(": ")[2] for name, verdict in verdicts.items() if verdict == ApiVerdict.ACCEPTED}
    assert accepted == {*TAKEN.split(", "), "declination=-1.0", "max_gap=inf"}
    for parameter in ("kp", "ki", "gate", "declination", "max_gap"):
        assert {f"construct: {parameter}={v}" for v in ("nan", "inf", "-1.0", "much")} <= set(verdicts)


def test_a_peer_that_is_not_installed_is_left_out_with_its_reason_and_no_peer_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, "vqf", None)  # Python's own way to say that there is none
    installed, absent = peers("vqf")
    assert installed == []
    result = measure_faults([ours("integrate")], [], arguments=False, absent=absent)
    assert result.summary()["absent"] == absent == {"vqf": absent["vqf"]}
    assert result.score("integrate").passed is None
    assert peers("none") == ([], {})
    with pytest.raises(ParameterError, match="there is no peer 'px4'; known: vqf, imufusion, ahrs, all, none"):
        peers("px4")
    with pytest.raises(ParameterError, match="there is no construction 'rate 7'"):
        child("ahrs.Mahony", "rate 7")


@pytest.mark.parametrize("library", ["vqf", "imufusion", "ahrs"])
def test_clean_peers_agree_with_the_truth(library):
    """Every adapter's frame and signs: ahrs.Madgwick, the slowest to forget, has errors of 2.3°; a wrong axis 37°."""
    pytest.importorskip(library)
    for contender in peers(library)[0]:
        heard = listen(contender, record(USUAL, 6000))
        assert heard.errors == ()
        assert np.sqrt(np.mean(heard.error_deg[5000:] ** 2)) < 5.0, contender.name


def test_a_peer_without_time_is_not_asked_about_stamps():
    pytest.importorskip("vqf")
    contender = peers("vqf")[0][0]
    found = measured(contender, "dt_nan_1", "nan_mag_1", "mag_glitch_x100_1")
    assert found["dt_nan_1"].verdict == Verdict.NOT_APPLICABLE
    assert found["nan_mag_1"].verdict == Verdict.NAN  # as measured with vqf 2.1.2: one NaN, and it is over
    assert found["mag_glitch_x100_1"].flags == ("magDistDetected",)
