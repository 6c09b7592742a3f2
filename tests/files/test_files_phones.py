"""Recordings of phone apps: hand-written in the forms that the apps document, and four real Android folders."""

import struct

import numpy as np
import pytest

from plumbob.core.constants import G0
from plumbob.core.errors import ClockError, DecodeError
from plumbob.files import kind_of, read
from plumbob.files.foreign import phones
from plumbob.rotations import Frame, North, quat_rotate
from tests.helpers import file_kinds as kinds
from tests.helpers.io_samples import put, refused
from tests.helpers.real_data import DATA, needs


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), ("\t", "."), (";", "."), (";", ","), ("\t", ",")])
@pytest.mark.parametrize("put", [kinds.zipped, kinds.foldered])
def test_phyphox_reads_in_each_of_its_layouts(tmp_path, separator, decimal, put):
    path = put(tmp_path / "swing.zip", kinds.phyphox_files(separator=separator, decimal=decimal))
    recording = read(path)
    imu = recording.imu
    assert imu.meta.device == "google Pixel 6a"
    np.testing.assert_allclose(imu.acc, np.tile(kinds.REST, (200, 1)), rtol=1e-9)
    np.testing.assert_allclose(imu.gyr, np.tile(kinds.RATE, (200, 1)), rtol=1e-9)
    known = np.isfinite(imu.mag).all(axis=1)
    np.testing.assert_allclose(imu.mag[known], np.tile(kinds.FIELD, (known.sum(), 1)), rtol=1e-9)
    assert any("Linear Accelerometer.csv" in str(note) for note in recording.notes)


def test_phyphox_pauses_short_names_and_single_tables(tmp_path):
    imu = read(kinds.zipped(tmp_path / "swing.zip", kinds.phyphox_files())).imu
    assert imu.meta.t0_ns == kinds.T0
    # 1 s of the experiment, then 4.5 s of pause: from 10:20:01.000 to 10:20:05.500
    np.testing.assert_allclose(imu.t[[0, 99, 100, 199]], [0.0, 0.99, 5.5, 6.49], atol=1e-9)
    assert np.count_nonzero(np.diff(imu.t) > 1.0) == 1
    files = {
        "Gyroscope.csv": kinds.phyphox_table("", "rad/s", kinds.RATE),
        "Accelerometer.csv": kinds.phyphox_table("", "m/s^2", kinds.REST),
        "Linear Acceleration.csv": kinds.phyphox_table("", "m/s^2", (0, 0, 0)),
    }
    recording = read(kinds.foldered(tmp_path / "run", files))
    np.testing.assert_allclose(recording.imu.acc[5], kinds.REST)
    assert recording.imu.meta.t0_ns == 0
    assert any("the start and any pauses are not known" in str(note) for note in recording.notes)
    path = put(tmp_path / "Raw Data.csv", kinds.phyphox_table("Gyroscope ", "rad/s", kinds.RATE))
    imu = read(path).imu
    assert (kind_of(path).name, imu.triads, imu.gyr.tolist()) == ("phone", ("gyr",), [[*kinds.RATE]] * 200)
    path.write_text(path.read_text().replace("Time (s)", "Time (ms)"))  # of another logger
    assert kind_of(path).name == "text"


def test_phyphox_takes_no_acceleration_without_gravity_and_all_of_a_table_of_several(tmp_path):
    files = {
        "Gyroscope.csv": kinds.phyphox_table("Gyroscope ", "rad/s", kinds.RATE),
        "Linear Accelerometer.csv": kinds.phyphox_table("Linear Acceleration ", "m/s^2", (0.0, 0.0, 0.0)),
        "Accelerometer without g.csv": kinds.phyphox_table("Acceleration ", "m/s^2", (0.0, 0.0, 0.0)),
        "Pressure.csv": '"Time (s)","Pressure (hPa)"\n0.0,1000.0\n',
    }
    recording = read(kinds.zipped(tmp_path / "swing.zip", files))
    assert recording.imu.acc is None
    assert any("Accelerometer without g.csv" in str(note) for note in recording.notes)
    assert any("Pressure.csv" in str(note) for note in recording.notes)
    columns = [
        f"{what} {a} ({unit})" for what, unit in (("Gyroscope", "rad/s"), ("Acceleration", "m/s^2")) for a in "xyz"
    ]
    head = ",".join(f'"{name}"' for name in ["Time (s)", *columns])
    rows = [",".join(f"{v:.9E}" for v in (i / 100, *kinds.RATE, *kinds.REST)) for i in range(100)]
    recording = read(kinds.zipped(tmp_path / "swing.zip", {"Raw Data.csv": "\n".join([head, *rows, ""])}))
    np.testing.assert_allclose(recording.imu.gyr, np.tile(kinds.RATE, (100, 1)))
    np.testing.assert_allclose(recording.imu.acc, np.tile(kinds.REST, (100, 1)))


def ios_files(sign, unit=1.0):
    """What iOS writes of one motion; `sign` is that of CoreMotion, -1, or of Android [COORDINATES.md]."""
    user, gravity = np.array([0.5, 0.0, 0.0]), np.array([0.0, 0.0, G0])
    return {
        "Accelerometer.csv": kinds.logger_table(sign * user),
        "Gravity.csv": kinds.logger_table(sign * gravity),
        "AccelerometerUncalibrated.csv": kinds.logger_table(sign * (user + gravity) / unit),
        "Gyroscope.csv": kinds.logger_table(kinds.RATE),
        "Magnetometer.csv": kinds.logger_table(kinds.FIELD),
        "Orientation.csv": "time,seconds_elapsed,qz,qy,qx,qw,roll,pitch,yaw\n",
    }


@pytest.mark.parametrize(("told", "sign"), [("false", -1.0), ("true", 1.0)])
def test_sensor_logger_on_ios_gives_specific_force_whatever_its_setting(tmp_path, told, sign):
    files = ios_files(sign) | {"Metadata.csv": kinds.LOGGER_META.format("ios", told)}
    recording = read(kinds.zipped(tmp_path / "walk.zip", files))
    np.testing.assert_allclose(recording.imu.acc, np.tile([0.5, 0.0, G0], (100, 1)), rtol=1e-12)
    np.testing.assert_allclose(recording.imu.gyr, np.tile(kinds.RATE, (100, 1)))
    np.testing.assert_allclose(recording.imu.mag, np.tile(kinds.FIELD, (100, 1)))
    assert recording.imu.meta.t0_ns == kinds.T0
    assert recording.imu.meta.device == "My phone"
    assert any("left out: Orientation" in str(note) for note in recording.notes)


@pytest.mark.parametrize(("told", "sign", "unit"), [("false", -1.0, G0), ("true", 1.0, 1.0)])
def test_uncalibrated_acceleration_of_ios_is_in_g_unless_standardised(tmp_path, told, sign, unit):
    files = ios_files(sign, unit) | {"Metadata.csv": kinds.LOGGER_META.format("ios", told)}
    del files["Gravity.csv"]
    imu = read(kinds.zipped(tmp_path / "walk.zip", files)).imu
    np.testing.assert_allclose(imu.acc, np.tile([0.5, 0.0, G0], (100, 1)), rtol=1e-12)


def test_sensor_logger_on_android_takes_total_acceleration(tmp_path):
    files = {
        "Accelerometer.csv": kinds.logger_table((0.0, 0.0, 0.0)),
        "TotalAcceleration.csv": kinds.logger_table(kinds.REST, late_ns=3_000_000),
        "GyroscopeUncalibrated.csv": kinds.logger_table((9.0, 9.0, 9.0)),
        "Gyroscope.csv": kinds.logger_table(kinds.RATE),
    }
    imu = read(kinds.foldered(tmp_path / "walk", files)).imu
    np.testing.assert_allclose(imu.acc[1:-1], np.tile(kinds.REST, (98, 1)), rtol=1e-12)
    np.testing.assert_allclose(imu.gyr, np.tile(kinds.RATE, (100, 1)))


def test_sensor_logger_adds_gravity_between_its_own_stamps(tmp_path):
    files = {
        "Accelerometer.csv": kinds.logger_table((0.5, 0.0, 0.0)),
        "Gravity.csv": kinds.logger_table((0.0, 0.0, G0), late_ns=-4_000_000),
        "Metadata.csv": kinds.LOGGER_META.format("android", "false"),
        "Gyroscope.csv": kinds.logger_table(kinds.RATE),
    }
    imu = read(kinds.foldered(tmp_path / "walk", files)).imu
    np.testing.assert_allclose(imu.acc[:-1], np.tile([0.5, 0.0, G0], (99, 1)), rtol=1e-12)
    assert np.isnan(imu.acc[-1]).all()  # gravity ended before


@pytest.mark.parametrize("of_motion", ["motionTimestamp_sinceReboot(s)", "label(N)"])  # another sensor's clock then
def test_sensorlog_turns_the_sign_of_ios_and_takes_each_sample_once(tmp_path, of_motion):
    names = "loggingTime(txt),accelerometerTimestamp_sinceReboot(s)," + ",".join(
        [f"accelerometerAcceleration{a}(G)" for a in "XYZ"]
        + [of_motion]
        + [f"motionRotationRate{a}(rad/s)" for a in "XYZ"]
        + [f"motionMagneticField{a}(µT)" for a in "XYZ"]
        + ["motionQuaternionW(R)"]
    )
    lines = []
    for i in range(100):
        sampled = 5000 + (i // 2) * 0.02  # rows come at twice the rate of the sensors
        stamp = f"2025-10-05 10:20:{i * 0.01:06.3f} +0200"
        values = (0.01, -0.02, -1.0, sampled, *kinds.RATE, *kinds.FIELD, 1.0)
        lines.append(",".join([stamp, f"{sampled:.4f}", *(f"{v}" for v in values)]))
    recording = read(put(tmp_path / "2025-10-05_10_20_00_iPhone.csv", "\n".join([names, *lines, ""])))
    imu = recording.imu
    assert len(imu) == 50
    # face up at rest: CoreMotion's z is -1, and the specific force points up [CMAccelerometerData]
    np.testing.assert_allclose(imu.acc, np.tile([-0.01 * G0, 0.02 * G0, G0], (50, 1)), rtol=1e-12)
    np.testing.assert_allclose(imu.gyr, np.tile(kinds.RATE, (50, 1)))
    np.testing.assert_allclose(np.diff(imu.t), 0.02, atol=1e-9)
    assert imu.meta.t0_ns == 1_759_652_400_000_000_000  # 2025-10-05 08:20:00 UTC
    assert any("motionQuaternion" in str(note) for note in recording.notes)


def test_sensorlog_of_device_motion_alone_adds_gravity_and_takes_no_field_of_zeros(tmp_path):
    forms = ("motionUserAcceleration{}(G)", "motionGravity{}(G)", "motionRotationRate{}(rad/s)")
    forms += ("motionMagneticField{}(µT)", "magnetometer{}(µT)")
    names = ["motionTimestamp_sinceReboot(s)", "magnetometerTimestamp_sinceReboot(s)"]
    names += [form.format(a) for form in forms for a in "XYZ"]
    user, gravity = (0.1, 0.0, -0.2), (0.0, 0.6, -0.8)
    # CoreMotion gives a field of zeros while it is not calibrated, or the attitude asks for none
    rows = [[i / 100, i / 100, *user, *gravity, *kinds.RATE, 0.0, 0.0, 0.0, *kinds.FIELD] for i in range(100)]
    path = put(tmp_path / "log.csv", "\n".join([",".join(names), *(",".join(map(str, row)) for row in rows), ""]))
    imu = read(path).imu
    # what iOS measures is gravity and user acceleration together, and specific force its opposite
    np.testing.assert_allclose(imu.acc, np.tile([-0.1 * G0, -0.6 * G0, 1.0 * G0], (100, 1)), rtol=1e-12)
    np.testing.assert_allclose(imu.mag, np.tile(kinds.FIELD, (100, 1)))


def test_what_is_no_specific_force_or_no_field_is_left_out(tmp_path):
    zeros = kinds.phyphox_table("Magnetic field ", "µT", (0.0, 0.0, 0.0))
    recording = read(kinds.zipped(tmp_path / "swing.zip", {**kinds.phyphox_files(), "Magnetometer.csv": zeros}))
    assert recording.imu.mag is None
    assert any("mag: 200 samples of exactly zero" in str(note) for note in recording.notes)
    files = {"Accelerometer.csv": kinds.logger_table((0, 0, 0)), "Gyroscope.csv": kinds.logger_table(kinds.RATE)}
    recording = read(kinds.zipped(tmp_path / "walk.zip", files))
    assert recording.imu.acc is None
    assert any("without gravity; record Gravity" in str(note) for note in recording.notes)


HEAD = kinds.phyphox_table("Gyroscope ", "rad/s", kinds.RATE, rows=3)
GYR = {"Gyroscope.csv": kinds.logger_table(kinds.RATE)}
LINES = kinds.logger_table(kinds.RATE).splitlines()
NO_SENSOR = "no gyroscope, accelerometer or magnetometer"


def listed(files, place, value):
    """Maker of an archive in whose list of members a byte or more are others [APPNOTE 4.3.12]."""

    def put(path):
        raw = bytearray(kinds.zipped(path, files).read_bytes())
        at = raw.rfind(b"PK\x01\x02") + place
        raw[at : at + len(value)] = value
        path.write_bytes(raw)

    return put


REFUSED = [
    *(
        (ios_files(-1.0) | meta, r"Metadata\.csv does not say")
        for meta in ({}, *({"Metadata.csv": kinds.LOGGER_META.format(*how)} for how in (("", ""), ("ios", ""))))
    ),
    (listed({"Gyroscope.csv": HEAD}, 24, struct.pack("<I", 1 << 30)), "unpack to"),  # by what it claims
    (listed({"Gyroscope.csv": HEAD}, 24, struct.pack("<I", 200)), "cut or damaged"),  # it unpacks to more
    (listed(GYR, 8, b"\x09"), "encrypted"),  # general purpose bit 0 [APPNOTE 4.4.4]
    ({"../Gyroscope.csv": "x"}, "it needs --profile"),  # nothing is unpacked to a path
    ({f"{i}.csv": "" for i in range(1001)}, "1001 members"),
    (
        {"a/Gyroscope.csv": kinds.logger_table(kinds.RATE), "b/Gyroscope.csv": kinds.logger_table(kinds.RATE)},
        "2 folders",
    ),
    ({"Gyroscope.csv": kinds.logger_table(kinds.RATE).replace(",-0.03", ",x")}, "Gyroscope.csv: line 2, column 'z'"),
    ({"Gyroscope.csv": "time,seconds_elapsed,z,y,x\n"}, NO_SENSOR),
    ({"Gyroscope.csv": "time,seconds_elapsed,z,y\n1,2,3,4\n"}, NO_SENSOR),
    (lambda path: path.touch(), r"walk.zip is empty: it has 0 bytes"),
    (
        {"Gyroscope.csv": "\n".join([LINES[0], *reversed(LINES[1:])])},
        "no time stamp is later than the one before",
        ClockError,
    ),
]


@pytest.mark.parametrize("case", REFUSED, ids=range(len(REFUSED)))
def test_archives_that_are_no_recording_or_hostile_say_why(tmp_path, case):
    files, match, error = (*case, DecodeError)[:3]
    path = tmp_path / "walk.zip"
    if callable(files):
        files(path)
    else:
        kinds.zipped(path, files)
    refused(read, path, match=match, error=error, name="walk.zip")


def test_links_in_a_folder_are_not_followed(tmp_path):
    outside = put(tmp_path / "Gyroscope.csv", kinds.logger_table(kinds.RATE))
    folder = tmp_path / "walk"
    folder.mkdir()
    (folder / "Gyroscope.csv").symlink_to(outside)
    assert not phones.accepts(folder)


FOLDERS = sorted(path for path in (DATA / "phones").glob("*") if path.is_dir())


@needs("phones")
@pytest.mark.parametrize("number", [0, 3])
def test_a_real_phone_folder_agrees_with_its_own_attitude(number):
    folder = FOLDERS[number]
    recording = read(folder)
    imu, track = recording.imu, recording.track
    direct = np.loadtxt(folder / "gyroscope-calibrated.txt")
    np.testing.assert_array_equal(imu.gyr[:1000], direct[:1000, 1:])
    assert imu.meta.device == "LGE Nexus 5"
    assert (track.frame, track.north) == (Frame.ENU, North.MAGNETIC)
    known = np.isfinite(track.q_nb).all(axis=1) & np.isfinite(imu.acc).all(axis=1)
    up = quat_rotate(track.q_nb[known], imu.acc[known]).mean(axis=0)
    # the mean specific force of a walk that begins and ends at rest is g upwards; with a wrong order of components,
    # or the attitude the wrong way round, it is not
    assert np.linalg.norm(up - [0.0, 0.0, 9.81]) < 0.5
    # the heading: the field turned to East-North-Up must lie in the north, as the rotation vector was made with it
    both = np.isfinite(track.q_nb).all(axis=1) & np.isfinite(imu.mag).all(axis=1)
    north = quat_rotate(track.q_nb[both], imu.mag[both])
    assert np.median(north[:, 1]) > 0.0 and abs(np.median(north[:, 0])) < 0.5 * np.median(north[:, 1])
