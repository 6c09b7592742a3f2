"""plumbob calibrate as a user meets it, on files that other verbs wrote."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from plumbob import CalibrationCard, ImuData, ImuMeta, apply_card, calibrate
from plumbob import files as io
from plumbob.calibration.acc import normal_gravity
from plumbob.calibration.predicted import REGIONS
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps
from plumbob.rotations import Frame, quat_angle, quat_conjugate, quat_from_rotvec, quat_multiply, quat_rotate
from plumbob.simulation import Module, TriadErrors, simulate
from tests.helpers.commandline import answer, refused, typed
from tests.helpers.mag_scene import Unit, attitudes, field, force, heading_rms, rates, trajectory, tumbling, unit_of
from tests.helpers.pose_capture import BIAS, GAIN, NOISE, pose_capture, symmetric

UP = np.array([0.2, -0.35, 0.9]) / np.linalg.norm([0.2, -0.35, 0.9])


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Captures of 18 poses and of a level unit, and a minute at rest in another attitude."""
    folder = tmp_path_factory.mktemp("accel")
    io.write(folder / "poses.parquet", pose_capture(REGIONS))
    io.write(folder / "level.parquet", pose_capture(np.tile([0.0, 0.0, 1.0], (6, 1))))
    rng = np.random.default_rng(9)
    acc = G0 * GAIN @ UP + BIAS + NOISE * rng.standard_normal((6000, 3))
    io.write(folder / "rest.parquet", ImuData(t=0.01 * np.arange(6000), acc=acc, gyr=np.zeros((6000, 3)), meta=META))
    return folder


META = ImuMeta(device="bench-1")


def test_from_a_capture_to_a_right_horizon(files, tmp_path):
    """Lengths leave a turn of the axes free; but for that, the inclination is right, and without the card it is not."""
    card = tmp_path / "card.json"
    assert "18 poses were found at rest" in typed(f"calibrate accel poses.parquet --out {card}", cwd=files).stdout
    model = CalibrationCard.load(card).acc
    assert model.reference == G0
    seen = symmetric(np.linalg.inv(GAIN)) @ GAIN @ UP  # what is up but for the turn
    words = "run rest.parquet --filter mahony --frame ENU --params kp=0.5,ki=0.03,gate=off"
    with_card, without = (answer(words, *more, cwd=files) for more in (("--calibration", card), ()))
    # what the filter leaves of the noise of a minute at rest comes on top of the calibration's own error
    assert angle(with_card, seen) < 4.0 * model.quality.tilt_sd + deg(0.02)
    assert angle(without, seen) > deg(1.0)


def angle(report, up):
    last = report["last_attitude_deg"]
    roll, pitch = deg(last["roll"]), deg(last["pitch"])
    told = np.array([-math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)])
    return float(np.arcsin(np.linalg.norm(np.cross(told, up))))


def test_json_and_the_options_of_gravity(files):
    words = "calibrate accel poses.parquet"
    plain = answer(words, cwd=files)
    assert (plain["refused"], plain["card"]["acc"]["quality"]["grade"]) == ([], "good")
    local = answer(f"{words} --latitude '52.5 deg' --height '40 m'", cwd=files)["card"]["acc"]
    assert local["reference"] == normal_gravity(deg(52.5), 40.0)
    given = answer(f"{words} --gravity '9.8123 m/s2' --shape axes", cwd=files)["card"]["acc"]
    assert given["reference"] == 9.8123
    assert given["matrix"][0][1] == 0.0


def test_level_only_and_another_unit_than_declared_are_refused_and_leave_no_card(files, tmp_path):
    out = tmp_path / "card.json"
    refusal = answer(f"calibrate accel level.parquet --out {out}", cwd=files, code=1)
    assert refusal["refused"][0]["kind"] == "too-few-regions"
    assert "REFUSED, too-few-regions" in typed(f"calibrate accel level.parquet --out {out}", cwd=files, code=1).stderr
    assert not out.exists()
    six = answer("calibrate accel poses.parquet --shape six", cwd=files, code=1)
    assert "18 poses are not the six faces" in str(six["refused"])
    # 1 g written as 1 m/s²
    imu = pose_capture(REGIONS)
    table = np.column_stack((imu.t, imu.acc / G0))
    head = "t [s],acc_x [m/s2],acc_y [m/s2],acc_z [m/s2]"
    np.savetxt(tmp_path / "g.csv", table, delimiter=",", header=head, comments="", fmt="%.9g")
    assert refused("calibrate", "accel", tmp_path / "g.csv", "--device", "bench-1")


COUNT = 300


@pytest.fixture(scope="module")
def unit():
    return unit_of(np.random.default_rng(31))


@pytest.fixture(scope="module")
def mag_files(tmp_path_factory, unit):
    """A capture through all attitudes, and one of turning level."""
    folder = tmp_path_factory.mktemp("mag")
    rng = np.random.default_rng(32)
    for name, tilt in (("all", None), ("level", np.radians(1.0))):
        q_nb = attitudes(rng, COUNT, tilt)
        meta = ImuMeta(device="SN7")
        imu = ImuData(t=0.05 * np.arange(COUNT), acc=force(rng, q_nb), mag=field(rng, unit, q_nb), meta=meta)
        io.write(folder / f"{name}.parquet", imu)
    return folder


def test_a_card_is_written_and_used(mag_files, unit, tmp_path):
    card = tmp_path / "card.json"
    typed(f"calibrate mag all.parquet --strength '500 mgauss' --out {card}", cwd=mag_files)
    found = CalibrationCard.load(card)
    assert found.device == "SN7"
    assert found.mag.reference == 50.0
    assert np.degrees(heading_rms(found.mag, unit)) < 0.25  # 0.05° at 1000 poses, by the root 0.09°


def test_a_smaller_shape_may_be_asked_for_and_turning_level_is_refused(mag_files, tmp_path):
    told = answer("calibrate mag all.parquet --shape sphere --tilt 10deg", cwd=mag_files)
    assert told["card"]["mag"]["method"] == "magnetometer alone: sphere, 4 parameters"
    assert told["card"]["mag"]["quality"]["tilt_range"] == pytest.approx(np.radians(10.0))
    card = tmp_path / "card.json"
    refusal = answer(f"calibrate mag level.parquet --out {card}", cwd=mag_files, code=1)
    assert (refusal["refused"][0]["kind"], card.exists()) == ("level-ring", False)


def test_a_place_tells_the_strength(mag_files):
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    mag = answer("calibrate mag all.parquet --place 42.283,-71.35,1000", cwd=mag_files)["card"]["mag"]
    assert any(re.search(r"declination -13\.\d\d deg, by WMM-2025", remark["text"]) for remark in mag["remarks"])
    # 51.4 µT in 2025 and 50.9 in 2029 by the World Magnetic Model; the recording has no date, so today's counts
    assert mag["reference"] == pytest.approx(51.2, abs=0.5)


def test_a_card_that_would_rather_harm_needs_force(tmp_path):
    rng = np.random.default_rng(41)
    t, q_nb, _ = tumbling(rng, duration=15.0)
    perfect = field(rng, Unit(np.eye(3), np.zeros(3)), q_nb)
    io.write(tmp_path / "perfect.parquet", ImuData(t=t, mag=perfect, meta=ImuMeta(device="SN7")))
    card, words = tmp_path / "card.json", "calibrate mag perfect.parquet --out card.json"
    assert answer(words, cwd=tmp_path, code=1)["refused"][0]["kind"] == "no-gain"
    assert not card.exists()
    typed(f"{words} --force", cwd=tmp_path)
    assert str(CalibrationCard.load(card).mag.remarks[0]).startswith("DO NOT USE")


@pytest.fixture(scope="module")
def deployed(tmp_path_factory, unit):
    """Ten minutes of a vessel with inclinations up to 15°, in a field that turns by 4° a minute, too much for one."""
    rng = np.random.default_rng(51)
    t, q_nb, true = trajectory(rng, duration=600.0, rate=10.0)
    about = quat_from_rotvec(np.radians(4.0) * t[:, None] / 60.0 * np.array([0.0, 0.0, -1.0]))
    seen = field(rng, unit, quat_multiply(about, q_nb))
    gyr = rates(rng, true, rate=10.0, gain_sd=0.002)
    file = tmp_path_factory.mktemp("deployed") / "deployed.parquet"
    io.write(file, ImuData(t=t, acc=force(rng, q_nb), gyr=gyr, mag=seen, meta=ImuMeta(device="SN7")))
    return file


def test_a_unit_at_work_is_calibrated_in_use_and_a_long_record_that_nobody_turned_told_of_it(deployed, unit, tmp_path):
    card = tmp_path / "card.json"
    done = typed(f"calibrate mag {deployed} --in-use --out card.json", cwd=tmp_path)
    assert "150 windows of 4 s in 10 min" in done.stdout
    found = CalibrationCard.load(card).mag
    # no card of the gyroscope: its axes may turn the whole by 0.25° about each of three, and turn it by less here
    assert np.degrees(heading_rms(found, unit)) < 2.0 * np.degrees(found.quality.heading_sd) < 2.0
    rng = np.random.default_rng(52)
    for duration, told in ((100.0, False), (400.0, True)):
        t, q_nb, true = trajectory(rng, duration=duration, rate=10.0, tilt=np.radians(4.0))
        imu = ImuData(t=t, gyr=rates(rng, true, rate=10.0), mag=field(rng, unit, q_nb), meta=ImuMeta(device="SN7"))
        io.write(tmp_path / f"{told}.parquet", imu)
        assert ("--in-use" in typed(f"calibrate mag {told}.parquet", cwd=tmp_path, code=1).stderr) is told


UNIT = "--frame NED --sensors mpu6000+hmc5983 --unit random --seed 5"
SLOWLY = "--set number=24,move=2s,mag_rate=20Hz"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Captures of one unit: by hand, and of turning level; and the card of the first."""
    folder = tmp_path_factory.mktemp("hand")
    typed(f"sim poses {UNIT} {SLOWLY} --out poses.parquet --card truth.json", cwd=folder)
    typed(f"sim levelring {UNIT} --duration 20s --out ring.parquet", cwd=folder)
    typed("calibrate hand poses.parquet --strength '50 uT' --out card.json", cwd=folder)
    return folder


def test_hand_and_mounting_give_the_horizon_of_the_body(folder, tmp_path):
    """Poses leave a turn of the axes open, which the mounting takes; then gravity is where it is, in any pose."""
    hand = folder / "card.json"
    typed(f"sim raise {UNIT} --out raise.parquet", cwd=tmp_path)
    typed(f"calibrate mount raise.parquet --frame NED --calibration {hand} --out card.json", cwd=tmp_path)
    typed(f"sim bands {UNIT} --out bands.parquet", cwd=tmp_path)
    card = CalibrationCard.load(tmp_path / "card.json")
    without, mounted = (tilt_errors(tmp_path / "bands.parquet", each) for each in (CalibrationCard.load(hand), card))
    noise = 4e-3 * np.sqrt(2.0 / 200.0)  # 0.4 mg/√Hz by the sheet, at 100 Hz, on two axes, in a mean of 200
    assert mounted.max() < 4.0 * np.sqrt(card.acc.quality.tilt_sd**2 + np.square(card.mount.sd).sum() + noise**2)
    assert without.max() > 2.0 * mounted.max()


def tilt_errors(path, card):
    """Angles between measured and true vertical, one for each pose."""
    recording = io.read(path)
    imu, truth = apply_card(card, recording.imu), recording.track
    rests = [slice(first + 50, first + 250) for first in range(0, len(imu), 400)]  # 2 of 3 s, after each move of 1 s
    force = np.array([imu.acc[rest].mean(axis=0) for rest in rests])
    up = np.array([quat_rotate(quat_conjugate(truth.q_nb[rest.start]), Frame.NED.up) for rest in rests])
    return np.arctan2(np.linalg.norm(np.cross(force, up), axis=1), (force * up).sum(axis=1))


def test_what_the_recording_lacks_is_said_and_turning_level_is_refused(tmp_path, folder):
    unit = UNIT.replace("+hmc5983", "")
    typed(f"sim poses {unit} --set number=18 --out nomag.parquet", cwd=tmp_path)
    report = answer("calibrate hand nomag.parquet", cwd=tmp_path)
    assert (report["card"]["mag"], set(report["remarks"])) == (None, {"acc", "gyr"})
    card = tmp_path / "card.json"
    done = typed(f"calibrate hand ring.parquet --out {card}", cwd=folder, code=1)
    assert ("REFUSED, too-few-regions" in done.stderr, card.exists()) == (True, False)


def test_the_place_tells_gravity_and_field(folder):
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    typed(f"sim poses {UNIT} {SLOWLY},strength=31.8uT,dip=-30deg --out equator.parquet", cwd=folder)
    card = answer("calibrate hand equator.parquet --place 0,0", cwd=folder)["card"]
    assert card["acc"]["reference"] == pytest.approx(9.7803253359, abs=1e-10)  # at the equator, by GRS 80 and WGS 84
    assert 30.0 < card["mag"]["reference"] < 33.0  # 31.8 µT at 0° N 0° E in 2025 by the World Magnetic Model
    given = answer("calibrate hand poses.parquet --gravity '9.81 m/s2'", cwd=folder)["card"]
    assert (given["acc"]["reference"], CalibrationCard.load(folder / "card.json").acc.reference) == (9.81, G0)


Q_BS = np.array([0.5, -0.7, 0.1, 0.4]) / np.linalg.norm([0.5, -0.7, 0.1, 0.4])
MOUNTED = Module(
    "unit", "test", gyr=TriadErrors(white_rpsd=dps(0.005), bias=dps(1.0)), acc=TriadErrors(white_rpsd=4e-3)
)


@pytest.fixture(scope="module")
def mounted(tmp_path_factory):
    """Recording of a mounted unit whose body is raised after 5 s, its attitude, and that of the body."""
    folder = tmp_path_factory.mktemp("mount")
    sim = simulate("raise", frame="NED", sensors=MOUNTED, unit="random", seed=1)
    turned = {name: quat_rotate(quat_conjugate(Q_BS), getattr(sim.imu, name)) for name in ("gyr", "acc")}
    io.write(folder / "unit.parquet", sim.imu.corrected(meta=sim.imu.meta, **turned))
    io.write(folder / "estimate.parquet", sim.truth.with_attitude(quat_multiply(sim.truth.q_nb, Q_BS)))
    io.write(folder / "body.parquet", sim.truth)
    return folder


def test_poses_give_a_card_with_the_mounting_which_joins_another_and_a_moving_body_none(mounted, tmp_path):
    card = tmp_path / "card.json"
    done = typed(f"calibrate mount unit.parquet --frame NED --out {card}", cwd=mounted)
    assert "- the accelerometer is not calibrated" in done.stdout
    mount = CalibrationCard.load(card).mount
    assert quat_angle(mount.q_bs, Q_BS) < 5.0 * np.linalg.norm(mount.sd)
    assert mount.method.startswith("level pose and nose raised by 30.0°, body axes of NED") and mount.date
    report = answer("calibrate mount unit.parquet --frame NED --level 0s..5s --raised 8s..13s", cwd=mounted)
    assert quat_angle(np.array(report["card"]["mount"]["q_bs"]), Q_BS) < 5.0 * np.linalg.norm(mount.sd)
    assert report["remarks"]["mount"][0]["text"].startswith("the accelerometer is not calibrated")
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    typed(f"calibrate mount unit.parquet --frame NED --level-only --out {first}", cwd=mounted)
    tracks = "--estimate estimate.parquet --reference body.parquet"
    typed(f"calibrate mount unit.parquet {tracks} --calibration {first} --out {second}", cwd=mounted)
    assert quat_angle(CalibrationCard.load(second).mount.q_bs, Q_BS) < 1e-6
    refusal = answer("calibrate mount unit.parquet --frame NED --from 5.3s --to 7.7s", cwd=mounted, code=1)
    assert refusal["refused"][0]["kind"] == "not-still"


RATES = "--rates '50, 100, 200 deg/s'"


def test_from_the_simulated_session_to_a_card_that_run_takes_or_a_refusal(tmp_path):
    unit = "--sensors mpu6000 --unit random --seed 3"
    typed(f"sim ratetable --frame NED {unit} --set hold=4s --out session.parquet", cwd=tmp_path)
    card = tmp_path / "card.json"
    typed(f"calibrate table session.parquet {RATES} --latitude '0 deg' --out {card}", cwd=tmp_path)
    gyr = CalibrationCard.load(card).gyr
    assert gyr.method == "rate table, 42 plateaus, 21 parameters"
    assert gyr.quality.grade in {"good", "fair"}
    typed(f"run session.parquet --filter integrate --calibration {card}", cwd=tmp_path)
    imu = io.read(tmp_path / "session.parquet").imu
    for gain in 0.89, 1.0, 1.12:  # of y, as ADXRS290 are delivered
        turned = replace(imu, gyr=imu.gyr * [1.0, gain, 1.0])
        card_of = calibrate(turned, "table", rates="50, 100, 200 deg/s", latitude="0 deg").card
        np.testing.assert_allclose(card_of.gyr.matrix * [1.0, gain, 1.0], gyr.matrix, atol=1e-6)
    chosen = answer(f"calibrate table session.parquet {RATES} --model 12", cwd=tmp_path)
    assert chosen["card"]["method"].endswith("12 parameters")
    card = tmp_path / "none.json"
    refusal = answer(f"calibrate table session.parquet --rates '2, 3 rad/s' --out {card}", cwd=tmp_path, code=1)
    assert (refusal["refused"][0]["kind"], card.exists()) == ("no-motion", False)


TABLED = "--frame NED --sensors mpu6000+hmc5983 --unit random --seed 3 --rate 20Hz"


@pytest.fixture(scope="module")
def tabled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("statictest")
    typed(f"sim table36 {TABLED} --out a.parquet --card card.json", cwd=folder)
    return folder


def test_triads_that_the_card_leaves_uncalibrated_are_named_and_the_reference_may_be_elsewhere(tabled):
    typed("calibrate statictest a.parquet --calibration card.json --html whole.html", cwd=tabled)
    CalibrationCard.load(tabled / "card.json").without("gyr", "mag").save(tabled / "acc.json")
    typed("calibrate statictest a.parquet --calibration acc.json --html acc.html", cwd=tabled)
    pages = [(tabled / f"{name}.html").read_text() for name in ("whole", "acc")]
    assert ["NOT calibrated: gyr, mag" in page for page in pages] == [False, True]
    assert [page.count("<svg") for page in pages] == [1, 1]
    typed("sim table36 --frame NED --rate 20Hz --out truth.parquet", cwd=tabled)
    report = answer("calibrate statictest a.parquet --reference truth.parquet --calibration card.json", cwd=tabled)
    for figures in report["summary"].values():
        assert figures["max_after_deg"] < 0.25  # a perfect card leaves the noise
        assert figures["max_before_deg"] > 1.0


def test_from_captures_by_hand_to_the_static_test(tabled):
    typed(f"sim faces {TABLED} --set edges=on,wobble=3deg --out faces.parquet", cwd=tabled)
    typed("calibrate accel faces.parquet --out hand-acc.json", cwd=tabled)
    typed("calibrate mag faces.parquet --calibration hand-acc.json --out hand.json", cwd=tabled)
    summary = answer("calibrate statictest a.parquet --calibration hand.json --align mounting", cwd=tabled)["summary"]
    # poses show the accelerometer no turn of its own, which --align mounting takes off; what is left are the predicted
    # errors of both triads and the noise of a rest: 0.2 µT over the level 32 µT, of 45 samples, 0.05°
    card = CalibrationCard.load(tabled / "hand.json")
    sd = math.degrees(math.hypot(card.mag.quality.heading_sd, card.acc.quality.tilt_sd, 0.2 / 32.0 / math.sqrt(45)))
    assert max(figures["max_after_deg"] for figures in summary.values()) < 4.0 * sd
    assert summary["yaw"]["max_before_deg"] > 10.0 * sd
