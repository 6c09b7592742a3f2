"""Magnetometer of a capture: which samples count, and which fit runs."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.harness.room import room_of
from plumbob import Frame, simulate
from plumbob.calibration.acc import calibrate_accel, poses_at_rest
from plumbob.calibration.calibrate_mag import calibrate_mag
from plumbob.calibration.calibration import Capture
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.predicted import REGIONS
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, ParameterError, ShapeError
from plumbob.core.units import g
from plumbob.data import ImuData, ImuMeta
from plumbob.data.cards import UNITS, CalibrationCard, TriadCalibration
from plumbob.fleet.experiments.trials import read_trial
from plumbob.rotations import dcm_from_quat, in_body_axes, quat_from_rotvec, signed_axes
from tests.helpers import mag_scene as mags
from tests.helpers.mag_scene import DIP, field, force, rates, trajectory, unit_of
from tests.helpers.pose_capture import BIAS, GAIN, NOISE, RATE, pose_capture, symmetric
from tests.helpers.refusals import reason_kinds, reasons

COUNT = 400
NONE, ACC, GYR = {"with_": "none"}, {"with_": "acc"}, {"with_": "gyr"}
FLAT, STEEP = {"dip": np.radians(40.0)}, {"dip": np.radians(65.0)}


@pytest.fixture(scope="module")
def scene():
    rng = np.random.default_rng(21)
    unit, q_nb = mags.unit_of(rng), mags.attitudes(rng, COUNT)
    t = 0.02 * np.arange(COUNT)
    return unit, ImuData(t=t, acc=mags.force(rng, q_nb), mag=mags.field(rng, unit, q_nb), meta=ImuMeta(device="SN1"))


def first_remark(imu, **options):
    return calibrate_mag(imu, strength=mags.STRENGTH, **options).remarks[0]


def sensed(imu, **triads):
    return imu.corrected(meta=imu.meta, **triads)


def negated(imu):
    return sensed(imu, mag=-imu.mag)


def test_a_steady_accelerometer_helps_and_finds_the_turn(scene):
    unit, imu = scene
    helped = calibrate_mag(imu, strength=mags.STRENGTH, acc_calibrated=True)
    alone = calibrate_mag(imu, strength=mags.STRENGTH, with_="none")
    assert str(helped.remarks[0]).startswith(
        "Fitted with the accelerometer, whose specific force is gravity: 400 of 400"
    )
    assert str(alone.remarks[0]) == "Fitted without other sensors: as asked for."
    assert np.degrees(mags.heading_rms(helped.calibration, unit)) < 0.2  # 0.05° at 1000 poses, by the root 0.08°
    assert np.degrees(mags.heading_rms(alone.calibration, unit)) > 0.5  # turned by 2° or more, which no length shows


def test_samples_that_tell_nothing_do_not_count(scene):
    _, imu = scene
    acc = imu.acc.copy()
    acc[5] = 0.0
    assert calibrate_mag(replace(imu, acc=acc), with_="none").calibration.quality.heading_sd < np.radians(2.0)
    mag = imu.mag.copy()
    mag[::2] = np.nan
    mag[1] = [200.0, 0.0, 0.0]
    fit = calibrate_mag(replace(imu, mag=mag, meta=replace(imu.meta, mag_range=200.0)), strength=mags.STRENGTH)
    assert len(fit.measured) == COUNT // 2 - 1


@pytest.fixture(scope="module")
def restricted():
    """Half a minute of turning with the inclination below 12°, and shaken too much to tell a vertical."""
    rng = np.random.default_rng(22)
    unit = mags.unit_of(rng)
    t, q_nb, true = mags.trajectory(rng, duration=30.0, tilt=np.radians(12.0))
    acc = mags.force(rng, q_nb) + rng.normal(size=(len(t), 3))
    return unit, ImuData(
        t=t, gyr=mags.rates(rng, true), acc=acc, mag=mags.field(rng, unit, q_nb), meta=ImuMeta(device="SN1")
    )


def test_the_gyroscope_rescues_restricted_motion(restricted):
    unit, imu = restricted
    fit = calibrate_mag(imu, strength=mags.STRENGTH, gyr_calibrated=True)
    assert str(fit.remarks[0]).startswith("Fitted with the gyroscope, because otherwise no ellipsoid fits")
    assert mags.heading_rms(fit.calibration, unit) < 3.0 * fit.calibration.quality.heading_sd
    assert first_remark(imu, with_="gyr", gyr_calibrated=True) == "Fitted with the gyroscope, as asked for."


@pytest.fixture(scope="module")
def level():
    rng = np.random.default_rng(23)
    q_nb = mags.attitudes(rng, COUNT, np.radians(0.5))
    return ImuData(t=0.02 * np.arange(COUNT), acc=mags.force(rng, q_nb), mag=mags.field(rng, mags.unit_of(rng), q_nb))


def test_level_is_asked_for(level):
    fit = calibrate_mag(level, shape="level")
    assert fit.calibration.matrix[2].tolist() == [0.0, 0.0, 1.0]
    assert "ONLY LEVEL" in str(fit.remarks[1])


def ring(duration, **triads):
    """Turns about the vertical, level to a degree."""
    rng = np.random.default_rng(24)
    t, q_nb, true = mags.trajectory(rng, duration=duration, tilt=np.radians(1.0))
    imu = ImuData(
        t=t, gyr=mags.rates(rng, true), acc=mags.force(rng, q_nb), mag=mags.field(rng, mags.unit_of(rng), q_nb)
    )
    return replace(imu, **triads)


Z_NEGATED, EX_Y = np.diag([1.0, 1.0, -1.0]), np.array([1.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def tumbled():
    """A minute of turning through all attitudes, slowly enough for a vertical, with a gyroscope's bias of 15 °/s."""
    rng = np.random.default_rng(25)
    unit = mags.unit_of(rng)
    t, q_nb, true = mags.trajectory(rng, duration=120.0, tilt=np.pi)
    gyr = mags.rates(rng, true) + np.radians([15.0, 0.0, 0.0])
    meta = ImuMeta(device="SN1")
    return unit, ImuData(t=t, gyr=gyr, acc=mags.force(rng, q_nb), mag=mags.field(rng, unit, q_nb), meta=meta)


@pytest.fixture(scope="module")
def captures(scene, restricted, level, tumbled):
    """What rows of tables make their captures of: a perfect magnetometer, turned for 15 s, too."""
    rng = np.random.default_rng(41)
    t, q_nb, _ = mags.tumbling(rng, duration=15.0)
    perfect = ImuData(t=t, mag=mags.field(rng, mags.Unit(np.eye(3), np.zeros(3)), q_nb), meta=ImuMeta(device="SN1"))
    return SimpleNamespace(
        scene=scene[1], restricted=restricted[1], level=level, tumbled=tumbled[1], perfect=perfect,
        mirrored=sensed(scene[1], mag=scene[1].mag @ Z_NEGATED.T),
    )  # fmt: skip


SHAKEN = 3.0 * np.random.default_rng(1).normal(size=(COUNT, 3))
STILL = np.array([20.0, 0.0, 40.0]) + 0.2 * np.random.default_rng(2).normal(size=(COUNT, 3))
LEAN = dcm_from_quat(quat_from_rotvec(np.radians([0.0, 0.0, 30.0])))


def leaning(imu):
    """A specific force of the right size, but turned by 30° in the unit."""
    return replace(slowed(imu), acc=imu.acc @ LEAN.T)


def clipped(imu):
    return replace(imu, meta=replace(imu.meta, mag_range=0.95 * float(np.abs(imu.mag).max())))


REFUSED = {
    "clipping": (lambda c: clipped(c.scene), {}, "^clipping"),
    "restricted and no gyroscope": (lambda c: replace(c.restricted, gyr=None), {}, "too-few-regions"),
    "ring and gyroscope": (lambda _: ring(20.0), {}, "level-ring.*choose the gyroscope to help.*--shape level"),
    "no card of the gyroscope": (lambda _: ring(10.0, acc=None), GYR, "ill-conditioned.*Calibrate the gyroscope first"),
    "level and not asked for": (lambda c: c.level, {}, "level-ring"),
    "force in g": (lambda c: sensed(c.scene, acc=c.scene.acc / G0), ACC, "3 % of gravity; at least 14 are needed"),
    "mirrored, biased rates": (lambda c: sensed(c.tumbled, mag=c.tumbled.mag * [1, 1, -1]), NONE, "^mirrored: "),
    "negated, dip of the north": (lambda c: negated(c.scene), {"dip": mags.DIP}, "wrong-field: the field dips by -60"),
    "another dip": (lambda c: c.scene, NONE | FLAT, "wrong-field: .* in the capture, but by 40.0° at the place"),
    "another dip beside a force": (lambda c: c.scene, ACC | FLAT, "wrong-field"),
    "a vertical by chance": (lambda c: leaning(c.tumbled), ACC, "not-still: the field is turned by (29|30|31)°"),
    "mirrored beside a force": (lambda c: c.mirrored, {}, r"mirrored: .*turned by 1[78]\d°.*with a dip of -60°"),
    "no gain": (lambda c: c.perfect, {}, r"no-gain: .* may itself be wrong by .*Do not use it.*force=True"),
    "a dead axis": (
        lambda c: sensed(c.scene, mag=c.scene.mag * EX_Y + 3 * (1 - EX_Y)),
        ACC,
        "implausible: y of the magnetometer always reads 3 µT",
    ),
    "still": (lambda c: replace(c.scene, mag=STILL), NONE, "no-motion"),
}
CHOICES = {
    "no such help": ({"with_": "barometer"}, ShapeError, "with_ must be one of"),
    "no such shape": ({"shape": "cube"}, ShapeError, "shape must be one of"),
    "help and axes": (ACC | {"shape": "axes"}, ParameterError, "whole matrix"),
    "no gyr": (GYR, CalibrationError, "no gyr"),
}


@pytest.mark.parametrize("case", [*REFUSED, *CHOICES])
def test_refusals(captures, case):
    if case in CHOICES:
        make, (options, error, words) = (lambda c: c.scene), CHOICES[case]
    else:
        (make, options, words), error = REFUSED[case], CaptureRefusedError
    with pytest.raises(error, match=words):
        calibrate_mag(make(captures), **options)


def holed(imu):
    """Every third field and every fifth force are not there."""
    mag, acc = imu.mag.copy(), imu.acc.copy()
    mag[::3], acc[::5] = np.nan, np.nan
    return sensed(imu, mag=mag, acc=acc)


def five_rates(imu):
    gyr = imu.usable("gyr").copy()
    gyr[5:] = np.nan
    return replace(imu, gyr=gyr, flags=None)


REMARKS = {
    "shaken": (lambda c: sensed(c.scene, acc=c.scene.acc + SHAKEN), {}, "which moved or is not calibrated", 1),
    "biased": (lambda c: sensed(c.scene, acc=c.scene.acc + 0.05 * G0), {}, "which moved or is not calibrated", 1),
    "asked for": (lambda c: c.scene, ACC, "as asked for", 1),
    "not there": (lambda c: replace(c.scene, acc=None), {}, "there is no acc", 1),
    "fewer parameters": (lambda c: c.scene, {"shape": "axes"}, "smaller shape", 1),
    "negated": (lambda c: negated(c.scene), {}, "FIELD POINTS UP: a dip of -60°", 1),
    "dip of the place": (lambda c: c.scene, NONE | {"dip": np.radians(59.0)}, "DIP OFF", 0),
    "doubtful dip": (lambda c: c.scene, NONE | STEEP, "in the capture, but by 65.0°", 1),
    "of samples with both": (lambda c: holed(c.scene), NONE | STEEP, "in the capture, but by 65.0°", 1),
    "uncalibrated": (lambda c: c.scene, {}, "UNCALIBRATED accelerometer", 1),
    "calibrated": (lambda c: c.scene, {"acc_calibrated": True}, "UNCALIBRATED", 0),
    "turned, and no mirror": (lambda c: c.mirrored, {"dip": -mags.DIP}, "TURNED BY 1", 1),
    "forced": (lambda c: c.perfect, {"force": True}, "DO NOT USE: the calibration changes headings by", 1),
    "iron": (lambda c: replace(c.perfect, mag=c.perfect.mag + [10.0, 0.0, 0.0]), {}, "DO NOT USE", 0),
    "right axes": (lambda c: c.tumbled, NONE, "mirrored", 0),
    "no rates": (lambda c: replace(c.tumbled, gyr=None), NONE, "of the rates", 0),
    "five rates": (lambda c: five_rates(c.tumbled), NONE, "of the rates", 0),
}


@pytest.mark.parametrize("case", REMARKS)
def test_remarks(captures, case):
    make, options, words, times = REMARKS[case]
    assert sum(words in str(remark) for remark in calibrate_mag(make(captures), **options).remarks) == times


@pytest.mark.parametrize(
    ("variances", "calibrated"),
    [(None, False), ([1e-8] * 3 + [0.0] * 9, False), ([0.0] * 3 + [1e-6] * 9, True)],
    ids=["no covariance", "a bias at rest", "a matrix"],
)
def test_a_bias_alone_is_no_gain_of_the_gyroscope(scene, variances, calibrated):
    covariance = None if variances is None else np.diag(variances)
    gyr = TriadCalibration(np.eye(3), np.zeros(3), UNITS["gyr"], UNITS["gyr"], covariance=covariance)
    card = CalibrationCard(device="SN1", date="2026-01-01", method="rest", gyr=gyr)
    assert Capture(scene[1], "SN1", card, "2026-01-01").calibrated("gyr") == calibrated
    assert not Capture(scene[1], "SN1", None, "2026-01-01").calibrated("gyr")


def slowed(imu):
    """The same a third as fast, and without the gyroscope's bias."""
    return replace(imu, t=3.0 * imu.t, gyr=(imu.gyr - np.radians([15.0, 0.0, 0.0])) / 3.0)


def test_fast_turning_tells_no_vertical(tumbled):
    """Of a slow trajectory, what is below 15 °/s; twenty times as fast, hardly anything."""
    imu = slowed(tumbled[1])
    gyr = imu.gyr
    calm = int(np.count_nonzero(np.linalg.norm(gyr, axis=1) < np.radians(15.0)))
    told = first_remark(imu, with_="acc")
    assert "the accelerometer, as asked for" in told
    # the bias is known by the field, 10 to 20 % of soft iron in it, and few samples are so near the limit
    assert int(told.split(": ")[1].split(" of")[0]) == pytest.approx(calm, rel=0.1)
    fast = replace(imu, t=0.05 * imu.t, gyr=20.0 * gyr)
    assert "the unit turned too fast" in first_remark(fast)


@pytest.mark.parametrize(
    "trial", [mags.TURNED[0], *(pytest.param(t, marks=pytest.mark.long(reason="other rooms")) for t in mags.TURNED[1:])]
)
def test_a_calibration_in_a_room_says_how_good_it_is(broad_folder, trial):
    """Within 2.6 times the predicted error, beyond which one of six trials lies once in twenty times."""
    imu, reference = read_trial(broad_folder / trial)
    room = room_of(imu, reference)
    fit = calibrate_mag(imu, force=True)  # whether it is worth using or not, its figure must hold
    assert room.heading_off(fit.calibration) < 2.6 * fit.calibration.quality.heading_sd
    assert fit.calibration.quality.grade != "good"


def test_where_the_field_is_uneven_the_gyroscope_helps_unasked(broad_folder):
    """Alone, this trial has seven directions, and a misfit that stays; the heading would be off by 4.5°."""
    imu, _ = read_trial(broad_folder / mags.TURNED[3])
    with pytest.raises(CaptureRefusedError, match="uneven-field: the residuals do not average out"):
        calibrate_mag(imu, with_="none")
    reason = "Fitted with the gyroscope, because otherwise the residuals do not average out"
    assert str(calibrate_mag(imu).remarks[0]).startswith(reason)


def by_gyroscope(imu, **options):
    (remark,) = [remark for remark in map(str, calibrate_mag(imu, **options).remarks) if "of the rates" in remark]
    return remark


def degrees_turned(remark):
    return float(remark.split("turned by ")[1].split("°")[0])


def test_every_fit_is_held_against_the_gyroscope(tumbled):
    """A unit mounted askew by 2° is told in figures; rates that are 8 % off, more than any data sheet, as a doubt."""
    imu = tumbled[1]
    remarks = {helper: by_gyroscope(imu, with_=helper) for helper in ("none", "gyr")}
    for remark in remarks.values():
        assert remark.startswith("Against the gyroscope, the calibrated field turns at 1.00 of")
    assert 1.0 < degrees_turned(remarks["none"]) < 4.0  # its axes are not at right angles
    assert degrees_turned(remarks["gyr"]) < 0.3
    wrong = replace(imu, gyr=1.08 * imu.gyr)
    assert by_gyroscope(wrong, with_="none").startswith("GYROSCOPE DISAGREES: the calibrated field turns at 0.9")


@pytest.fixture(scope="module")
def capture():
    """Three minutes of slow turning through all attitudes, in most of which the vertical is told."""
    rng = np.random.default_rng(25)
    t, q_nb, true = trajectory(rng, duration=60.0, rate=10.0, tilt=np.pi)
    triads = {"gyr": rates(rng, true, rate=10.0) / 3.0, "acc": force(rng, q_nb), "mag": field(rng, unit_of(rng), q_nb)}
    return ImuData(t=3.0 * t, meta=ImuMeta(device="SN1"), **triads)


def turned(imu, sensor, axes):
    """The capture of a sensor that measures the case's x, y, z as its own `axes`."""
    return imu.corrected(meta=imu.meta, **{sensor: imu.usable(sensor) @ signed_axes(axes).T})


def refusal(imu, **options):
    return reasons(calibrate_mag, imu, **options)[0]


def line(advice):
    """The first line of a profile in an advice: its table, its axes, and whether they are mirrored."""
    table, axes, mirrored = re.search(r'\[(\w+)\] axes = "([^"]+)"( with mirrored = true)?', advice).groups()
    return table, axes, mirrored is not None


MIRRORS = {  # what a sensor measures of x, y, z, and what is told of it
    "x y -z": "mirrored: z reversed",
    "y x z": "mirrored: x and y swapped",
    "y z -x": "mirrored: its x, y, z are y, z, −x of the others",
}
TURNS = {"x -y -z": "y and z reversed", "y -x z": "its x, y, z are y, −x, z of the others"}


@pytest.mark.parametrize("helper", ["auto", "none", "acc", "gyr"])
def test_axes_that_are_right_are_not_spoken_of(capture, helper):
    assert sum("axes of" in str(remark) for remark in calibrate_mag(capture, with_=helper).remarks) == 0


@pytest.mark.parametrize(
    ("axes", "words", "helper"),
    [(axes, words, helper) for axes, words in MIRRORS.items() for helper in ("none", "acc")]
    + [("y z -x", MIRRORS["y z -x"], "auto"), ("y z -x", MIRRORS["y z -x"], "gyr")],
)
def test_a_mirrored_magnetometer_is_refused_whatever_helps(capture, axes, words, helper):
    reason = refusal(turned(capture, "mag", axes), with_=helper)
    assert reason.kind == "mirrored" and f"the magnetometer are wrong ({words})" in reason.text
    table, told, mirrored = line(reason.advice)
    np.testing.assert_array_equal(signed_axes(told) @ signed_axes(axes), np.eye(3))
    assert (table, mirrored) == ("mag", True)


@pytest.mark.parametrize(("axes", "words"), TURNS.items())
def test_a_turned_magnetometer_is_refused_alone_and_taken_with_a_remark_else(capture, axes, words):
    """By itself a card has no turn; and no half turn passes for axes that are all reversed."""
    wrong = turned(capture, "mag", axes)
    reason = refusal(wrong, with_="none")
    assert reason.kind == "turned-axes" and f"wrong ({words})" in reason.text and "--with acc or gyr" in reason.advice
    for helper in ("acc", "gyr"):
        (told,) = [one for one in map(str, calibrate_mag(wrong, with_=helper).remarks) if "axes of the" in one]
        assert told.startswith("TURNED BY") and f"({words})" in told and "all axes" not in told
        assert line(told)[2] is False


@pytest.mark.parametrize(("sensor", "helper", "free"), [("acc", "acc", "none"), ("gyr", "gyr", "acc")])
def test_wrong_axes_of_another_sensor_are_refused_where_the_card_rests_on_them(capture, sensor, helper, free):
    wrong = turned(capture, sensor, "x y -z")
    reason = refusal(wrong, with_=helper)
    assert reason.kind == "mirrored" and line(reason.advice) == (sensor, "x y -z", True)
    (told,) = [one for one in map(str, calibrate_mag(wrong, with_=free).remarks) if "axes of the" in one]
    assert told.startswith("AXES: ") and line(told) == (sensor, "x y -z", True)


DOUBTS = [  # what is not there, how it is asked for, what is said of z reversed, and whether the south is named
    ({"gyr": None}, {}, "the accelerometer, unless the axes of that are wrong", True),
    ({"acc": None}, {"with_": "none"}, '"-x -y z", or [mag] axes = "x y -z" with mirrored = true', False),
    ({}, {"with_": "acc"}, "South of the magnetic equator it is", True),
    ({}, {"with_": "acc", "dip": DIP}, "mirrored = true", False),
]


@pytest.mark.parametrize(("missing", "options", "words", "south"), DOUBTS)
def test_what_else_it_may_be_is_said(capture, missing, options, words, south):
    """Without a dip a mirror and a turn are one; north of the magnetic equator is assumed, or the place says so."""
    reason = refusal(replace(turned(capture, "mag", "x y -z"), **missing), **options)
    assert words in f"{reason.text} {reason.advice}"
    assert ("South" in reason.advice) == south


def test_the_place_and_the_axes_of_a_recording_count(capture):
    remarks = calibrate_mag(turned(capture, "mag", "x y -z"), with_="acc", dip=-DIP).remarks
    assert [remark[:14] for remark in map(str, remarks) if "(x and y reversed)" in remark] == ["TURNED BY 180°"]
    # A sensor that sits a quarter turn about its x, in a case that sits a quarter turn about its z
    own, case = signed_axes("x z -y"), signed_axes("y -x z")
    meta = replace(capture.meta, axes="y -x z")
    wrong = capture.corrected(meta=meta, mag=capture.mag @ (case @ own @ case.T).T)  # case of true, sensor, body
    axes = line(refusal(wrong, with_="none").advice)[1]
    np.testing.assert_array_equal(in_body_axes(axes, own @ np.array([1.0, 2.0, 3.0])), [1.0, 2.0, 3.0])


def test_a_capture_that_is_refused_anyway_names_wrong_axes_too(capture):
    """First where they mirror; a turn, which a card may take up, after what the capture lacks."""
    fast = replace(capture, t=capture.t / 9.0, gyr=9.0 * capture.gyr, flags=None)
    for axes, kinds in (
        ("x y z", ["not-still"]),
        ("x y -z", ["mirrored", "not-still"]),
        ("x -y -z", ["not-still", "turned-axes"]),
    ):
        assert reason_kinds(calibrate_mag, turned(fast, "mag", axes), with_="acc") == kinds


TRUE = symmetric(np.linalg.inv(GAIN))
HAND = np.random.default_rng(5).standard_normal((40, 3))
LEVEL = np.tile([0.0, 0.02, 1.0], (12, 1)) + 0.02 * HAND[:12]


def assert_found(found):
    """Within four standard deviations as told, which are small."""
    sd = np.sqrt(np.diag(found.calibration.covariance))
    assert (np.abs(found.calibration.bias - BIAS) < 4.0 * sd[:3]).all()
    assert (np.abs(found.calibration.matrix - TRUE).ravel() < 4.0 * sd[3:]).all()
    assert found.calibration.quality.grade == "good"


@pytest.mark.parametrize("gyr", [True, False])
@pytest.mark.parametrize("directions", [REGIONS, HAND], ids=["18 positions", "40 by hand"])
def test_every_pose_is_found_and_the_sensor_comes_back(directions, gyr):
    imu = pose_capture(directions, gyr=gyr)
    found = calibrate_accel(imu)
    assert_found(found)
    assert len(found.measured) == len(directions)
    assert str(found.remarks[0]).startswith(f"{len(directions)} poses were found at rest")


@pytest.mark.parametrize("seed", range(4))
def test_a_simulated_unit_held_by_hand_comes_back_with_its_flicker_and_steps(seed):
    """40 poses of a drawn MPU-6000; its noise is not white, and the intervals are those of the residuals."""
    run = simulate("poses", frame=Frame.NED, sensors="mpu6000+hmc5983", unit="random", seed=seed)
    found = calibrate_accel(run.imu).calibration
    true = run.calibration.acc
    assert (np.abs(found.bias - true.bias) < 4.5 * found.bias_sd).all()
    assert (np.abs(found.matrix - symmetric(true.matrix)) < 4.5 * found.matrix_sd).all()
    assert found.quality.grade == "good"


def test_noise_of_a_mean_and_lost_samples():
    """40 poses with 3 degrees of freedom each tell it to 6.5 %."""
    poses = poses_at_rest(pose_capture(HAND))
    counts = np.array([round((stop - start) * RATE) + 1 for start, stop in poses.spans])
    assert ((counts >= 100) & (counts <= 200)).all()
    assert poses.noise == pytest.approx(NOISE * np.sqrt(np.mean(1.0 / counts)), rel=0.2)
    imu = pose_capture(HAND)
    acc, gyr = imu.acc.copy(), imu.gyr.copy()
    acc[np.random.default_rng(1).random(len(acc)) < 0.05, 0] = np.nan
    gyr[np.arange(len(gyr)) % 4 != 0] = np.nan
    assert_found(calibrate_accel(replace(imu, acc=acc, gyr=gyr, flags=None)))


def test_a_moved_pose_is_named_and_the_temperature_is_kept():
    imu = pose_capture(np.vstack((REGIONS, HAND[:8])))
    acc = imu.acc.copy()
    start = round(4 * 2.6 * RATE)
    acc[start : start + 200] *= 1.02
    found = calibrate_accel(replace(imu, acc=acc, flags=None))
    assert_found(found)
    assert np.flatnonzero(~found.used).tolist() == [4]
    assert any(str(r).startswith("Pose 5 is from 10.") for r in found.remarks)
    imu = pose_capture(HAND)
    warm = replace(imu, temp_c=np.linspace(21.0, 24.0, len(imu)))
    found = calibrate_accel(warm).calibration
    low, high = found.temp_span_c
    assert 21.0 <= low < 21.1
    assert 23.9 < high <= 24.0
    assert found.temp_ref_c == pytest.approx(22.5, abs=0.1)
    unknown = calibrate_accel(replace(imu, temp_c=np.full(len(imu), np.nan))).calibration
    assert unknown.temp_span_c is None


def shaken(imu):
    t = np.arange(len(imu)) / RATE
    return replace(imu, acc=imu.acc + 3.0 * np.sin(40.0 * t)[:, np.newaxis], flags=None)


def clipped_poses(imu):
    limit = g(0.9)
    meta = ImuMeta(device="d", acc_range=limit)
    return replace(imu, acc=np.clip(imu.acc, -limit, limit), flags=None, meta=meta)


IN_G = {"flags": None, "meta": ImuMeta(unit_check=False)}
REFUSED_POSES = {
    "never at rest": (HAND, shaken, "not-still", "nothing in 103.4 s"),
    "a tenth of a second": (HAND, lambda imu: imu[:10], "not-still", ""),
    "level only": (LEVEL, lambda imu: imu, "too-few-regions", "+x, −x, +y, −y, −z"),
    "a range below gravity": (REGIONS, clipped_poses, "clipping", "±8.826 m/s²"),
    "values in g": (
        REGIONS,
        lambda imu: replace(imu, acc=imu.acc / G0, **IN_G),
        "wrong-gravity",
        "the values are in g",
    ),
    "half as much again": (REGIONS, lambda imu: replace(imu, acc=1.5 * imu.acc, flags=None), "wrong-gravity", ""),
}


@pytest.mark.parametrize("case", REFUSED_POSES)
def test_poses_that_are_refused(case):
    directions, change, kind, words = REFUSED_POSES[case]
    reason, *_ = reasons(calibrate_accel, change(pose_capture(directions)))
    assert (reason.kind, words in reason.text) == (kind, True)


def test_a_gravity_that_is_nowhere_on_earth_is_refused():
    with pytest.raises(ParameterError, match=r"gravity on Earth is from 9.76 to 9.84"):
        calibrate_accel(pose_capture(REGIONS), gravity=1.0)


@pytest.mark.parametrize("factor", [1.0, 1.03, 0.92, 1.08])
def test_a_scale_far_from_one_is_told(factor):
    """Data sheets allow 3 %; a factor of 8 % is calibrated away, and is as a rule a wrong unit or range."""
    imu = pose_capture(REGIONS)
    true = float(np.cbrt(np.linalg.det(GAIN)))  # of the planted sensor, 1 ± 1 %
    remarks = calibrate_accel(replace(imu, acc=BIAS + (imu.acc - BIAS) * factor / true, flags=None)).remarks
    expected = [f"SCALE OFF BY {100.0 * (factor - 1.0):+.1f}"] if abs(factor - 1.0) > 0.03001 else []
    assert [remark[:17] for remark in map(str, remarks) if remark.startswith("SCALE OFF BY")] == expected
