"""The convention doctor on motions of closed form: what is planted is found, what cannot be seen is not answered."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plumbob import ImuData, ImuMeta, Recording, doctor, simulate
from plumbob.core.units import from_si
from plumbob.quality.arrangement import ARRANGEMENTS, Samples, fit
from plumbob.quality.derotated import fit_force
from plumbob.quality.diagnosis import Diagnosis, unit_odds, unusable
from plumbob.rotations import (
    dcm_from_quat,
    quat_chained,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_multiply,
    quat_rotate,
    rotvec_from_quat,
    signed_axes,
)
from tests.helpers import beside
from tests.helpers.commandline import call, ok

G = 9.81
FIELD = np.array([0.0, 20.0, -44.0])  # ENU, µT: a dip of 65.6°, as in the north
RATE = 100.0
AMPLITUDES = (1.1, 0.8, 1.3)
Arrays = dict[str, np.ndarray]


def attitude(t: np.ndarray, amplitudes: tuple[float, float, float] = AMPLITUDES) -> np.ndarray:
    """Body to ENU: yaw, pitch and roll swing with periods that do not match."""
    angles = [
        a * np.sin(2.0 * np.pi * f * t + p)
        for a, f, p in zip(amplitudes, (0.23, 0.31, 0.41), (0.3, 1.0, 2.0), strict=True)
    ]
    return dcm_from_quat(quat_from_euler_zyx(np.stack(angles, axis=1)))


@cache
def sensors(amplitudes: tuple[float, float, float] = AMPLITUDES, seconds: float = 40.0, late: float = 0.0) -> Arrays:
    """Time, rates and vectors; those of the magnetometer are stamped `late` seconds late. Noise is that of a phone."""
    t = np.arange(round(seconds * RATE)) / RATE
    dcm, h = attitude(t, amplitudes), 1e-4
    turn = np.einsum("nji,njk->nik", attitude(t - h, amplitudes), attitude(t + h, amplitudes))
    gyr = np.stack([turn[:, j, i] - turn[:, i, j] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
    rng = np.random.default_rng(7)
    noise = rng.standard_normal((3, t.size, 3)) * np.array([0.002, 0.05, 0.3])[:, None, None]
    return {
        "t": t,
        "gyr": gyr / (4.0 * h) + np.array([0.01, -0.02, 0.005]) + noise[0],
        "acc": np.einsum("nji,j->ni", dcm, [0.0, 0.0, G]) + noise[1],
        "mag": np.einsum("nji,j->ni", attitude(t - late, amplitudes), FIELD) + np.array([3.0, -2.0, 4.0]) + noise[2],
    }


def diagnosed(data: Arrays, **more: str | None) -> Diagnosis:
    imu = ImuData(**data, meta=ImuMeta(unit_check=False))
    return doctor(Recording(imu=imu, name="planted"), **more)


def answers(found: Diagnosis) -> dict[str, tuple[str, bool]]:
    return {f"{one.sensor} {one.question}": (str(one.answer), one.wrong) for one in found.findings}


def test_right_conventions_are_confirmed() -> None:
    found = diagnosed(sensors(seconds=90.0), hemisphere="north")
    assert not found.wrong and not found.lines
    assert "doctor.assumed" in [one.code for one in found.remarks]  # that acc is specific force: no turning shows it
    told = answers(found)
    for question in ("gyr axes", "gyr unit", "acc axes", "acc unit", "mag axes", "mag unit", "mag sign", "mag delay"):
        assert told[question] == ("sure", False), (question, found.text())


@pytest.mark.parametrize(
    ("axes", "hemisphere", "lines", "answer"),
    [
        ("-x -y -z", None, None, ("mag sign", "unknown", False)),  # without a hemisphere it stays open
        ("-x -y -z", "south", None, ("mag sign", "sure", False)),
        ("-x -y -z", "north", None, ("mag sign", "sure", True)),
        # LSM9DS1: its x points the other way; the magnetometers inside ICM-20948 and MPU-9250, AK09916 and AK8963
        ("-x y z", "north", ("[mag]", 'axes = "-x y z"', "mirrored = true"), ("mag axes", "sure", True)),
        ("x -y -z", "north", ("[mag]", 'axes = "x -y -z"'), ("mag axes", "sure", True)),
        ("y x -z", "north", ("[mag]", 'axes = "y x -z"'), ("mag axes", "sure", True)),
    ],
)
def test_magnetometers_of_common_parts(axes: str, hemisphere: str | None, lines: Any, answer: Any) -> None:
    found = diagnosed(sensors() | {"mag": sensors()["mag"] @ signed_axes(axes).T}, hemisphere=hemisphere)
    told, (question, *answered) = answers(found), answer
    assert told["gyr axes"] == told["acc unit"] == ("sure", False)
    assert told[question] == tuple(answered)
    assert lines in {None, found.lines}, found.text()


@pytest.mark.parametrize("n", [3, 17, 24, 41])
def test_arrangements_of_rates_in_the_axes_of_a_sensor(n: int) -> None:
    # u = P v gives du/dt = −(det(P) P ω) × u: the sensor's own handedness cannot be seen, that of the rates can.
    data, w = sensors(seconds=30.0), ARRANGEMENTS[n]
    rates = data["gyr"] @ w  # W ω' = ω for ω' = Wᵀ ω
    for found in (fit(data["t"], rates, data["mag"], offset=0.5), fit_force(data["t"], [rates], data["acc"], (1.0,))):
        assert found is not None and found.best == n and found.margin > 7.0 and found.agrees
        assert found.scale == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("late", [-0.1737, 0.0412])
def test_delay_of_the_magnetometer(late: float) -> None:
    found = diagnosed(sensors(seconds=90.0, late=late))
    assert found.values["mag"]["delay_s"] == pytest.approx(late, abs=0.002)
    assert answers(found)["mag delay"] == ("sure", True)


def test_a_delay_between_the_steps_of_the_search_feigns_no_factor() -> None:
    """A fin swings to and fro: what 8 ms more turn it by looks like a bias, and 4 % of the rates."""
    fin = simulate("fin", frame="ENU", sensors="mpu6050+hmc5983", unit="calibrated", seed=29, duration=60.0).imu
    late = np.concatenate((np.full((54, 3), np.nan), fin.mag[:-54]))  # at 500 Hz
    found = fit(fin.t, fin.gyr, late, offset=0.5)
    assert (found.delay, found.scale) == (pytest.approx(0.108, abs=1e-3), pytest.approx(1.0, abs=0.01))


@pytest.mark.parametrize(("unit", "mag"), [("deg/s", False), ("rpm", True), ("mrad/s", True)])
def test_unit_of_the_rates(unit: str, mag: bool) -> None:
    """By the accelerometer alone, too."""
    data = {name: values for name, values in sensors().items() if mag or name != "mag"}
    found = diagnosed(data | {"gyr": from_si(data["gyr"], unit)})
    assert found.values["gyr"]["unit"] == unit
    assert f'unit = "{unit}"' in found.lines
    assert answers(found)["acc axes"] == ("sure", False)


@pytest.mark.parametrize("factor", [0.1, 0.5, 0.9, 1.1, 2.0])
def test_a_factor_that_is_no_unit_is_named_and_no_unit_is_prescribed(factor: float) -> None:
    """Of the rates by a wrong full scale, or of time by a wrong rate or a counter of samples: both show alike."""
    data = sensors()
    t = data["t"] * factor if factor > 0.2 else 1e-3 * np.arange(len(data["t"]))  # rows at 100 Hz, taken for ms
    for wrong in (data | {"gyr": data["gyr"] * factor}, data | {"t": t}):
        found = diagnosed(wrong)
        (unit,) = [one for one in found.findings if (one.sensor, one.question) == ("gyr", "unit")]
        assert unit.wrong and str(unit.answer) == "sure"
        assert unit.finding.code == "doctor.factor"
        assert found.values["gyr"]["scale"] == pytest.approx(1.0 / factor, rel=0.03)
        assert not [line for line in found.lines if "unit" in line]


def held(name: str) -> Arrays:
    values = sensors()[name].copy()
    values[2000:] = values[2000]
    return {name: values}


CLIPPED = sensors()["mag"].clip(-25.0, 25.0)
DEAD = sensors()["mag"] * [1.0, 1.0, 0.0]


@pytest.mark.parametrize(
    ("values", "out"),
    [
        (held("gyr"), np.arange(4000) >= 2000), (held("acc"), np.arange(4000) >= 2000), ({"mag": DEAD}, True),
        ({"mag": CLIPPED}, np.abs(CLIPPED).max(axis=1) == 25.0), ({}, False),
        ({"mag": np.repeat(sensors()["mag"][::4], 4, axis=0)}, False), ({"mag": sensors()["mag"].round()}, False),
    ],
)  # fmt: skip
def test_samples_that_say_nothing_are_left_out_and_no_convention_is_wrong(values: Arrays, out: Any) -> None:
    """Held, at the end of the range, or of a dead axis; but not those of a slower sensor or of a coarse step."""
    data = sensors() | values
    name = next(iter(values), "mag")
    assert (unusable(ImuData(**data), name) == out).all()
    never = {name: np.tile(sensors()[name][:1], (4000, 1))}  # changes: a simulated rest
    assert not unusable(ImuData(**data | never), name).any()
    found = diagnosed(data)
    assert not any(one.wrong for one in found.findings), found.text()
    assert ("samples.stuck_axis" in [one.code for one in found.remarks]) == (values.get("mag") is DEAD) == found.wrong
    assert answers(diagnosed(data | {"gyr": from_si(data["gyr"], "deg/s")}))["gyr unit"] == ("sure", True)


ROLL, PITCH = sensors((1.2, 0.0, 0.0)), {name: sensors((0.0, 1.2, 0.0))[name] for name in ("t", "gyr", "acc")}
PLANTED = {
    "half the rates, about one axis": (ROLL | {"gyr": 0.5 * ROLL["gyr"]}, "gyr unit", ("likely", True), "as declared"),
    "one axis does not tell all": (ROLL, "mag axes", ("unknown", False), "turn it about"),
    "nor by gravity": (ROLL, "acc axes", ("unknown", False), "turn it"),
    "iron that turns along": (sensors() | {"mag": sensors((0.66, 0.48, 0.78))["mag"]}, "gyr unit", ("sure", False), ""),
    "wrong, though others tie": (PITCH | {"gyr": PITCH["gyr"][:, [1, 0, 2]]}, "acc axes", ("unknown", True), "turn it"),
    "upright": (sensors() | {"acc": sensors()["acc"][:, [1, 0, 2]]}, "acc axes", ("sure", True), ""),
    "11 ms late": (sensors(seconds=90.0, late=0.011), "mag delay", ("sure", False), "° of attitude in this motion"),
    "80 ms late, not exact": (sensors(seconds=30.0, late=0.08), "mag delay", ("likely", True), ""),
}


@pytest.mark.parametrize("name", PLANTED)
def test_what_is_wrong_and_what_does_not_matter(name: str) -> None:
    data, question, answer, why = PLANTED[name]
    found = diagnosed(data)
    assert answers(found)[question] == answer
    assert any(why in one.why for one in found.findings if f"{one.sensor} {one.question}" == question)
    assert name != "upright" or found.lines == ("[acc]", 'axes = "y x z"', "mirrored = true")


def test_negated_rates_are_a_mirrored_gyroscope() -> None:
    found = diagnosed(sensors() | {"gyr": -sensors()["gyr"]})
    assert answers(found)["gyr axes"] == ("sure", True)
    assert found.lines[:3] == ("[gyr]", 'axes = "-x -y -z"', "mirrored = true")


def test_units_by_size() -> None:
    assert unit_odds("acc", 1.0, 0.0, "m/s2").unit == "g"
    close = unit_odds("acc", 990.0, 0.0, "m/s2")  # 980.665 cm/s² and 1000 mg are 2 % apart
    assert {close.unit, close.next} == {"mg", "cm/s2"} and close.log_odds < 2.0
    assert unit_odds("mag", 0.48, 0.0, "uT").unit == "gauss"
    counts = unit_odds("gyr", 400.0, 0.0, "rad/s")
    assert counts.unit is None and counts.factor == pytest.approx(1.0 / 400.0)
    data = sensors()
    found = diagnosed(data | {"acc": data["acc"] * 101.0})  # mg or cm/s², but not m/s²
    assert answers(found)["acc unit"] == ("unknown", True) and found.wrong
    assert not [line for line in found.lines if "unit" in line]


def test_rest_tells_nothing_of_axes_and_nothing_wrong() -> None:
    found = diagnosed(sensors((0.0, 0.0, 0.0)))
    told = answers(found)
    assert not found.wrong
    for question in ("acc axes", "mag axes", "gyr unit"):
        assert told[question][0] == "unknown", found.text()
    assert told["acc unit"][0] == told["mag unit"][0] == "sure"


def test_means_of_straight_lines_and_pauses() -> None:
    t = np.array([0.0, 0.1, 0.2, 0.3, 2.0, 2.1])
    found = Samples(t, np.stack((t, 2.0 * t, 0.0 * t), axis=1)).means(np.array([0.0, 0.15, 0.25, 1.0, 2.05]))
    assert found[:2] == pytest.approx(np.array([[0.075, 0.15, 0.0], [0.2, 0.4, 0.0]]))
    assert np.isnan(found[2:]).all()


PROFILE = beside(__file__, "log.profile.toml")


def written(folder: Path, data: Arrays, profile: str) -> Path:
    file = folder / "log.csv"
    table = np.column_stack([data[name] for name in ("t", "gyr", "acc", "mag")])
    np.savetxt(file, table, delimiter=",", header="t,gx,gy,gz,ax,ay,az,mx,my,mz", comments="", fmt="%.8g")
    (folder / "log.toml").write_text(profile, encoding="utf-8")
    return file


def test_the_lines_mend_the_profile(tmp_path: Path) -> None:
    data = sensors(seconds=90.0, late=0.08)
    data = data | {"gyr": from_si(data["gyr"], "deg/s"), "mag": data["mag"] @ np.diag([-1.0, 1.0, 1.0])}
    told = call("doctor", written(tmp_path, data, PROFILE), "--hemisphere", "north", "--json")
    assert told.returncode == 3
    lines = json.loads(told.stdout)["profile"]
    assert lines[:3] == ["[gyr]", 'unit = "deg/s"', "[mag]"]
    mended = PROFILE.replace('unit = "rad/s"', lines[1]).replace('unit = "uT"', "\n".join(['unit = "uT"', *lines[3:]]))
    ok("doctor", written(tmp_path, data, mended), "--hemisphere", "north")


def test_strides_that_push_harder_than_gravity_do_not_mislead() -> None:
    """A leg that swings at 3.5 rad/s and is pushed along its own axes, in step: short windows alone say nothing."""
    lean = (2.0, 0.3, 0.2)
    data = sensors(lean, seconds=90.0)
    stride = 2.0 * np.pi * 1.4 * data["t"]
    swing = np.stack((0.2 * np.sin(stride), 3.5 * np.cos(stride), np.zeros_like(stride)), axis=1)
    turned = dcm_from_quat(quat_chained(swing / RATE)[: len(stride)])
    pushes = 20.0 * np.stack((np.cos(stride), 0.3 * np.sin(stride), np.sin(2.0 * stride)), axis=1)
    acc = np.einsum("nji,nj->ni", turned, data["acc"]) + pushes
    gyr = np.einsum("nji,nj->ni", turned, data["gyr"]) + swing
    found = fit_force(data["t"], [gyr], acc, (1.0, 57.3))  # turned back so fast, all averages out: nothing stands still
    assert found is not None and found.margin > 7.0 and found.agrees and not found.torn and found.scale < 1.2
    assert (ARRANGEMENTS[found.best] == np.eye(3)).all()
    push = 15.0 * np.sin(stride)[:, np.newaxis] * [0.0, 0.3, 1.0]
    for mostly, answer in ((0.1, "sure"), (1.0, "likely")):  # most of what is measured is not gravity
        pushed = data | {"acc": data["acc"] + mostly * push}
        assert answers(diagnosed(pushed))["acc axes"] == (answer, False)
        apart = {name: pushed[name] @ signed_axes(axes).T for name, axes in (("acc", "y z x"), ("mag", "y x -z"))}
        told = answers(diagnosed(pushed | apart))  # no two are alike, and the odds of both are overwhelming
        assert told["acc axes"] == (answer, True) and told["mag axes"] == ("sure", True)


@pytest.mark.parametrize("seed", [10, 14, 23])
def test_steps_in_step_with_the_turning_do_not_turn_the_axes_of_one_sensor_alone(seed: int) -> None:
    """A shank: pushes come at multiples of the stride; the magnetometer confirms the rates beyond doubt."""
    rng, t = np.random.default_rng(seed), np.arange(2400) / 120.0
    stride, a = 2.0 * np.pi * (0.9 + 0.1 * rng.random()) * t, rng.normal(size=(3, 3))
    yaw = 0.15 * np.sin(stride + a[0, 0]) + 0.1 * np.sin(0.3 * t + a[1, 0])
    pitch, roll = 0.6 * np.sin(stride) + 0.2 * np.sin(2.0 * stride + a[0, 1]), 0.1 * np.sin(stride + a[0, 2])
    q = quat_from_euler_zyx(np.stack([yaw, pitch, roll + 0.3 * np.sin(0.2 * t)], axis=1))
    gyr = 120.0 * rotvec_from_quat(quat_multiply(quat_conjugate(q), np.roll(q, -1, axis=0)))
    gyr[-1] = 0.0
    pushes = [
        rng.normal(size=3) * 6.0 / k * np.cos(k * stride + rng.random() * 6.28)[:, np.newaxis]
        * (1.0 + 0.2 * rng.normal(size=1)) for k in (1, 2, 3)
    ]  # fmt: skip
    acc = quat_rotate(quat_conjugate(q), [0.0, 0.0, G] + sum(pushes)) + 0.3 * rng.normal(size=gyr.shape)
    mag = quat_rotate(quat_conjugate(q), [5.0, 20.0, -43.0]) + 0.3 * rng.normal(size=gyr.shape)
    said = answers(diagnosed({"t": t, "gyr": gyr + 0.005 * rng.normal(size=gyr.shape), "acc": acc, "mag": mag}))
    assert said["acc axes"] == ("unknown", False) and said["gyr axes"] == ("sure", False)


def test_pauses_of_the_gyroscope_do_not_count() -> None:
    """While the rates are missing the body turns unseen: what comes after is compared with what comes after."""
    data = sensors(seconds=90.0)
    second = np.floor(data["t"]).astype(int)
    rates = np.where((second % 6 >= 4)[:, np.newaxis], np.nan, data["gyr"])
    quarters = np.pi / 2 * np.eye(3)[np.random.default_rng(1).integers(0, 3, 15)]
    turned = dcm_from_quat(quat_chained(quarters))[second // 6]
    acc = np.einsum("nji,nj->ni", turned, data["acc"])
    gyr = np.einsum("nji,nj->ni", turned, rates)
    found = fit_force(data["t"], [gyr], acc, (1.0,))
    assert found is not None and found.margin > 7.0 and found.agrees and found.explained > 0.99
    assert (ARRANGEMENTS[found.best] == np.eye(3)).all()


@pytest.mark.parametrize("seconds", [0.5, 1.0, 2.0, 3.0, 5.0])
def test_a_recording_of_a_single_block_is_examined_and_nothing_is_sure(seconds):
    """Halves of one block are one block and none: that is little evidence, not a fault."""
    found = simulate("tumble", frame="ENU", sensors="mpu6000+hmc5983", unit="random", seed=1, duration=seconds)
    answers = doctor(found.imu).findings
    assert not any(answer.wrong and str(answer.answer) == "sure" for answer in answers)
