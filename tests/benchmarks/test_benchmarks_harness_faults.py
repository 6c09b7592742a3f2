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

BY_NAME = {case.name: case for case in CASES}


def ours(name, **params):
    return OurFilter(Stage(name, params))


def measured(contender, *names):
    return measure_faults([contender], choose(names, CASES, GROUPS), arguments=False).verdicts[contender.name]


@pytest.fixture(scope="module")
def some():
    """Cases that say something about the harness, whatever becomes of the filters' tuning."""
    names = [
        "nan_gyr_1",
        "zero_gyr_5s",
        "dt_nan_1",
        "dt_zero_equal_stamps_1s",
        "mag_skipped_30s",
        "gap_60s",
        "start_clean",
    ]
    return measure_faults([ours("integrate"), ours("mahony")], choose(names, CASES, GROUPS), arguments=False)


@pytest.mark.parametrize("name", ["integrate", "mahony"])
def test_one_absent_sample_is_ok_and_flagged(some, name):
    found = some.verdicts[name]["nan_gyr_1"]
    assert (found.verdict, found.flags) == (Verdict.OK, ("gyr-absent", "gyr-held"))


def test_a_dead_gyroscope_leaves_an_integrator_wrong_and_says_which_sensor(some):
    found = some.verdicts["integrate"]["zero_gyr_5s"]
    assert found.verdict == Verdict.WRONG
    assert "gyr-stuck" in found.flags
    assert found.recover_s is None


@pytest.mark.parametrize("name", ["integrate", "mahony"])
def test_a_time_that_is_nan_is_a_clear_error_and_the_loop_goes_on(some, name):
    found = some.verdicts[name]["dt_nan_1"]
    assert found.verdict == Verdict.CLEAR_ERROR
    assert found.errors == ("ClockError: t_ns must be a whole number of nanoseconds, but it is nan.",)
    assert found.peak_deg < 2.0  # the next step is twice as long


def test_flags_of_the_clean_run_do_not_count(some):
    assert some.verdicts["mahony"]["start_clean"].flags == ()
    assert "mag-absent" in some.verdicts["mahony"]["mag_skipped_30s"].flags
    assert "gap" in some.verdicts["mahony"]["gap_60s"].flags


def test_scores_add_up_and_leave_out_the_clean_start(some):
    for name in ("integrate", "mahony"):
        score = some.score(name)
        assert score.cases == sum(score.counts.values()) == 6
        good = score.counts[Verdict.OK] + score.counts[Verdict.CLEAR_ERROR]
        assert score.strict == pytest.approx(100.0 * good / 6)
        assert score.passed == pytest.approx(100.0 * (good + score.counts[Verdict.FLAGGED]) / 6)


def test_the_same_measurement_twice_gives_the_same_figures(some):
    again = measure_faults([ours("integrate"), ours("mahony")], some.cases, arguments=False)
    assert again.as_dict() == some.as_dict()


def test_clean_errors_have_the_size_of_the_bias(some):
    """An integrator turns away with |bias| = √3 · 0.1 °/s at most: 26° in 150 s."""
    assert 0.0 < some.clean_rms_deg["integrate"] < math.sqrt(3.0) * 0.1 * 150.0


def test_parameters_reach_the_filter():
    without = measured(ours("mahony", mag=False), "huge1e30_mag_1")["huge1e30_mag_1"]
    assert without.peak_deg == 0.0


def test_the_smoother_takes_part_without_a_lag():
    smoother = contender_of(Stage("smoother", {}))
    found = measured(smoother, "nan_gyr_1", "dt_nan_1", "dt_clock_jump_1e6s", "reordered_pairs_1s")
    assert {one.verdict for one in found.values()} <= {Verdict.OK, Verdict.FLAGGED}
    assert "gyr-absent" in found["nan_gyr_1"].flags
    assert "time-fault" in found["dt_nan_1"].flags
    assert "gap" in found["dt_clock_jump_1e6s"].flags
    assert "time-fault" in found["reordered_pairs_1s"].flags


def test_text_names_every_case_and_contender(some):
    text = some.text()
    for word in ("integrate", "mahony", "dt_nan_1", "error", "WRONG", "pass", "strict", "clean rms"):
        assert word in text


# --- arguments ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def arguments():
    return run_battery(ours("mahony")).verdicts


@pytest.mark.parametrize(
    "name",
    ["negative stride", "every second of six", "column of a Fortran table", "read-only", "memoryview", "list", "tuple",
     "int64", "float32", "float16", "big-endian", "None"],
)  # fmt: skip
def test_what_means_three_numbers_is_taken_with_the_same_bits(arguments, name):
    assert arguments[f"sample: {name}"] == ApiVerdict.ACCEPTED


@pytest.mark.parametrize(
    "name",
    ["shape (0,)", "shape (2,)", "shape (4,)", "shape (1, 3)", "shape (3, 1)", "numpy matrix", "nested list",
     "empty list", "complex", "datetime64", "structured", "masked", "list of str", "str", "NaN", "object"],
)  # fmt: skip
def test_what_cannot_is_refused_clearly_and_leaves_the_state_alone(arguments, name):
    assert arguments[f"sample: {name}"] == ApiVerdict.CLEAR_ERROR


def test_constructors_refuse_what_is_outside_their_domain(arguments):
    built = {name: verdict for name, verdict in arguments.items() if name.startswith("construct: ")}
    accepted = {name for name, verdict in built.items() if verdict == ApiVerdict.ACCEPTED}
    assert accepted == {"construct: declination=-1.0", "construct: max_gap=inf"}  # angles have signs; off for the gap
    assert set(built.values()) == {ApiVerdict.ACCEPTED, ApiVerdict.CLEAR_ERROR}
    for parameter in ("kp", "ki", "gate", "declination", "max_gap"):
        assert {f"construct: {parameter}={v}" for v in ("nan", "inf", "-1.0", "much")} <= set(built)


# --- peers --------------------------------------------------------------------------------------------------


def test_a_peer_that_is_not_installed_is_left_out_with_its_reason(monkeypatch):
    monkeypatch.setitem(sys.modules, "vqf", None)  # Python's own way to say that there is none
    found, absent = peers("vqf")
    assert found == []
    assert "pip install vqf" in absent["vqf"]
    result = measure_faults([ours("integrate")], [], arguments=False, absent=absent)
    assert "peer left out: " in result.text()
    assert result.as_dict()["absent"] == absent
    assert result.score("integrate").passed is None


def test_an_unknown_peer_is_refused_by_name():
    with pytest.raises(ParameterError, match="there is no peer 'px4'; known are vqf, imufusion, ahrs, all and none"):
        peers("px4")
    assert peers("none") == ([], {})


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


def test_a_constructor_that_may_abort_runs_in_a_process_of_its_own():
    """With vqf 2.1.2 an assertion in C ends the process; a later one may refuse clearly."""
    pytest.importorskip("vqf")
    contender = next(c for c in peers("vqf")[0] if c.name == "vqf.BasicVQF")
    found = run_battery(contender).verdicts
    assert found["construct: rate 0"] in (ApiVerdict.KILLED, ApiVerdict.CLEAR_ERROR)
    assert found["sample: masked"] in (ApiVerdict.SILENT, ApiVerdict.CLEAR_ERROR)
    assert found["sample: list"] == ApiVerdict.CLEAR_ERROR


def test_the_child_knows_what_it_is_asked_for():
    with pytest.raises(ParameterError, match="there is no construction 'rate 7'"):
        child("ahrs.Mahony", "rate 7")
