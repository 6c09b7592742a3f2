"""The grade of a recording: each planted fault costs its own criterion, the more the larger it is, and no other."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from plumbob import AttitudeTrack, Frame, ImuArray, ImuData, North, Recording, doctor, flags, info, simulate, write
from plumbob.cli.main import main
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError
from plumbob.quality.grade import WORDS, Criterion, Grade, grade, grade_track

LITTLE = 1.0
"""What another criterion may lose by a fault that is not its own, points."""


@cache
def good(duration=60.0, rate=100.0):
    made = simulate("ball", frame="ENU", sensors="mpu6000+hmc5983", unit="calibrated", seed=3, rate=rate,
                    duration=duration, mag_rate=rate)  # fmt: skip
    return made.imu


def made(imu, *, t=None, keep=None, meta=None, **values):
    """The recording again, with other times, values or meta, or without rows."""
    keep = slice(None) if keep is None else keep
    triads = {name: np.array(values.get(name, getattr(imu, name)))[keep] for name in imu.triads}
    return ImuData(t=np.array(imu.t if t is None else t)[keep], **triads, meta=meta or imu.meta)


def gap(imu, size):
    """A hole of a share of the recording."""
    n, middle = len(imu), len(imu) // 2
    keep = np.ones(n, dtype=bool)
    keep[middle : middle + max(8, int(size * n))] = False
    return made(imu, keep=keep)


def loss(imu, size):
    rng = np.random.default_rng(1)
    return made(imu, keep=rng.random(len(imu)) >= size)


def clipping(imu, size):
    gyr = np.array(imu.gyr)
    rows = np.linspace(0, len(imu) - 1, max(1, int(size * len(imu)))).astype(int)
    gyr[rows, 0] = imu.meta.full_scale("gyr")[0]
    return made(imu, gyr=gyr)


def stuck(imu, size):
    acc = np.array(imu.acc)
    start = len(imu) // 2
    acc[start : start + int(size * len(imu)), 1] = acc[start, 1]
    return made(imu, acc=acc)


def units(imu, size):
    """Factor between right and wrong."""
    return made(imu, acc=np.array(imu.acc) / (1.0 + 30.0 * size), meta=replace(imu.meta, unit_check=False))


def jitter(imu, size):
    rng = np.random.default_rng(2)
    step = 1.0 / imu.meta.rate_nominal if imu.meta.rate_nominal else float(np.median(np.diff(imu.t)))
    return made(imu, t=imu.t + step * np.clip(rng.normal(0.0, size, len(imu)), -0.45, 0.45))


def duplicates(imu, size):
    t = np.array(imu.t)
    rows = np.linspace(2, len(imu) - 1, max(1, int(size * len(imu)))).astype(int)
    t[rows] = t[rows - 1] + 1e-9
    return made(imu, t=t)


def absent(imu, size):
    gyr = np.array(imu.gyr)
    start = len(imu) // 2
    gyr[start : start + int(size * len(imu))] = np.nan
    return made(imu, gyr=gyr)


FAULTS = {
    "gaps": (gap, (0.05, 0.2, 0.4)),
    "loss": (loss, (0.005, 0.02, 0.1)),
    "clipping": (clipping, (0.002, 0.005, 0.05)),
    "stuck": (stuck, (0.15, 0.3, 0.5)),
    "plausibility": (units, (0.1, 0.3)),
    "jitter": (jitter, (0.06, 0.1, 0.2)),
    "clock": (duplicates, (0.002, 0.01, 0.05)),
    "loss ": (absent, (0.01, 0.05, 0.2)),
}


@cache
def graded(duration, rate):
    return grade(good(duration, rate))


def costs(found):
    return {one.name: one.lost for one in found.criteria}


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize(
    ("duration", "rate"),
    [
        (60.0, 100.0),
        (10.0, 100.0),
        (60.0, 10.0),
        pytest.param(600.0, 10.0, marks=pytest.mark.long),
        pytest.param(60.0, 1000.0, marks=pytest.mark.long),
        pytest.param(3600.0, 100.0, marks=pytest.mark.long),
    ],
)
def test_a_fault_costs_its_criterion_the_more_the_larger_it_is_and_no_other(name, duration, rate):
    imu = good(duration, rate)
    plant, sizes = FAULTS[name]
    if name == "stuck" and min(sizes) * duration * min(rate, 100.0) < 150:
        sizes = tuple(size for size in sizes if size * duration * rate >= 60 and size * duration > 1.2)
    before, points = costs(graded(duration, rate)), graded(duration, rate).points
    last = before[name.strip()]
    for size in sizes:
        found = grade(plant(imu, size))
        assert found[name.strip()].lost >= last
        assert found[name.strip()].advice
        last = found[name.strip()].lost
        other = {key: lost - before[key] for key, lost in costs(found).items() if key != name.strip()}
        assert max(other.values()) <= LITTLE, other
        assert found.points <= points
    assert last > before[name.strip()] + 2.0 or not sizes


def test_a_good_recording_is_good_without_calibration_less_and_held_values_cost_resolution():
    imu, found = good(), graded(60.0, 100.0)
    assert found.word == "GOOD"
    bare = grade(made(imu, meta=replace(imu.meta, calibration=None)))
    assert bare["calibration"].lost == 10.0
    assert bare.points == pytest.approx(found.points - 10.0)
    held = np.repeat(np.array(imu.gyr)[::2], 2, axis=0)
    assert grade(made(imu, gyr=held))["resolution"].value == pytest.approx(0.5, abs=0.01)


def test_a_constant_axis_is_stuck_a_simulation_that_never_changes_is_not_and_bursts_are_the_clock_s_fault():
    imu = good(10.0)
    acc = np.array(imu.acc)
    acc[:, 2] = 0.5
    assert grade(made(imu, acc=acc))["stuck"].lost == 30.0
    still = ImuData(t=imu.t, gyr=np.zeros((len(imu), 3)), acc=np.tile([0.0, 0.0, G0], (len(imu), 1)))
    assert grade(still)["stuck"].lost == 0.0
    for count, steps in ((50, 49), (49, 0)):  # from fifty samples on
        acc = np.array(imu.acc)
        acc[100 : 100 + count] = acc[100]
        assert grade(made(imu, acc=acc))["stuck"].value == pytest.approx(steps * np.diff(imu.t).mean())
    imu = good()
    n = len(imu)
    t = 0.1 * (np.arange(n) // 10) + 0.0005 * (np.arange(n) % 10)  # ten rows at a time
    found = grade(made(imu, t=t))
    assert found["clock"].lost == 15.0
    assert "bursts" in found["clock"].measured
    assert found["loss"].lost == 0.0


def test_a_slower_magnetometer_loses_nothing_and_two_steps_that_alternate_are_jitter_but_no_loss():
    slow = simulate("ball", frame="ENU", sensors="mpu6000+hmc5983", unit="calibrated", seed=3, duration=20.0).imu
    assert grade(slow)["loss"].lost == 0.0
    imu = good()
    steps = np.where(np.arange(len(imu)) % 2, 0.004, 0.006)
    found = grade(made(imu, t=np.cumsum(steps)))
    assert found["loss"].lost == 0.0
    assert found["rate"].value == pytest.approx(200.0, rel=1e-3)
    assert found["jitter"].value == pytest.approx(0.2, rel=0.01)  # 1 ms of 5 ms
    in_ms = np.floor(np.arange(len(imu)) / 0.85) / 1e3
    assert grade(made(imu, t=in_ms))["rate"].value == pytest.approx(850.0, rel=1e-3)


def test_missing_sensors_cost_a_rest_at_the_start_is_seen_and_several_units_are_as_good_as_the_worst():
    imu = good(10.0)
    for lost, triads in ((5.0, ("gyr", "acc")), (20.0, ("acc", "mag"))):
        values = {name: getattr(imu, name) for name in triads}
        assert grade(ImuData(t=imu.t, **values, meta=imu.meta))["sensors"].lost == lost
    rest = simulate("static", frame="ENU", sensors="mpu6000", unit="calibrated", seed=1, duration=20.0).imu
    assert (grade(rest)["rest"].lost, grade(rest)["rest"].value) == (0.0, pytest.approx(20.0, abs=1.0))
    shaken = rest.acc + np.where(rest.t < 0.5, np.sin(50.0 * rest.t), 0.0)[:, np.newaxis]
    for wait, value in ((4.0, 19.25), (5.0, 0.0)):  # between the first sample and the second; a rest later than 5 s
        late = made(rest, t=np.where(rest.t > 0.0, rest.t + wait, 0.0), acc=shaken)
        assert grade(late)["rest"].value == pytest.approx(value, abs=0.5)
    found = info(Recording(array=ImuArray({"a": imu, "b": clipping(imu, 0.05)})))
    report = found.summary()["grade"]
    assert set(report["units"]) == {"a", "b"}
    assert report["points"] == report["units"]["b"]["points"] < report["units"]["a"]["points"]


def test_an_attitude_is_graded_by_its_own_criteria():
    n = 1000
    t = np.arange(n) / 100.0
    angle = 0.5 * t
    q = np.column_stack((np.cos(angle / 2), np.zeros((n, 2)), np.sin(angle / 2)))
    whole = AttitudeTrack(t=t, q_nb=q, frame=Frame.ENU, north=North.TRUE)
    assert costs(grade_track(whole)) == {
        "rate": 0.0, "jitter": 0.0, "gaps": 0.0, "loss": 0.0, "converged": 0.0, "jumps": 0.0, "heading": 0.0,
        "uncertainty": 5.0,
    }  # fmt: skip
    lost = q.copy()
    lost[300:500] = np.nan
    assert grade_track(replace(whole, q_nb=lost))["loss"].lost == 25.0
    jumping = q.copy()
    jumping[::50] = [0.0, 1.0, 0.0, 0.0]
    assert grade_track(replace(whole, q_nb=jumping))["jumps"].lost == 25.0
    early = np.where(t < 5.0, np.uint32(flags.NOT_CONVERGED), np.uint32(0)).astype(np.uint32)
    assert grade_track(replace(whole, flags=early))["converged"].lost > 10.0
    assert grade_track(replace(whole, north=North.FREE))["heading"].lost == 10.0


def test_exit_codes_and_json(tmp_path, capsys):
    file = tmp_path / "a.parquet"
    write(file, Recording(imu=clipping(good(10.0), 0.05)))
    points = info(file).grade.points
    assert main(["info", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["grade"]["points"] == points
    assert main(["info", str(file), "--min-grade", str(points)]) == 0
    assert main(["info", str(file), "--min-grade", str(points + 0.1)]) == 3
    assert main(["info", str(file), "--require", "GOOD"]) == (0 if points >= 80 else 3)
    assert main(["info", str(file), "--require", "POOR"]) == 0
    assert main(["info", str(file), "--min-grade", "101"]) == 1
    with pytest.raises(ParameterError, match="GOOD"):
        info(file).reaches("great")
    words = [Grade((Criterion("any", 100.0, lost, ()),)).word for lost in (0.0, 20.0, 20.1, 40.0, 40.1, 100.0)]
    assert words == [word for word, _ in WORDS for _ in range(2)] == ["GOOD"] * 2 + ["FAIR"] * 2 + ["POOR"] * 2


@pytest.mark.parametrize(
    ("triad", "matrix"),
    [("gyr", 2.0 * np.eye(3)), ("gyr", np.eye(3)[[1, 0, 2]]), ("acc", np.eye(3)[[0, 2, 1]]), ("mag", np.eye(3))],
)
def test_what_the_doctor_calls_wrong_is_never_good(triad, matrix):
    imu, right = good(), bool((matrix == np.eye(3)).all())
    recording = Recording(imu=made(imu, **{triad: getattr(imu, triad) @ matrix}), name="ball")
    assert doctor(recording).wrong != right
    assert info(recording).reaches("GOOD") == right
