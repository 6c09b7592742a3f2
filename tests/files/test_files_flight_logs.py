"""Logs of PX4 and of ArduPilot, and telemetry of MAVLink."""

import contextlib
import struct

import numpy as np
import pytest
import pyulog

from plumbob.core.errors import ParameterError
from plumbob.files import read, write
from plumbob.rotations import Frame, North, quat_angle
from tests.helpers import log_samples as made
from tests.helpers.file_kinds import telemetry
from tests.helpers.io_samples import put, refused
from tests.helpers.real_data import DATA, needs
from tests.helpers.real_data import real as real_file

REAL = DATA / "formats" / "px4_small.ulg"
real = needs("formats/px4_small.ulg")


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "flight.ulg"
    path.write_bytes(made.px4(told=[("float", "EKF2_MAG_DECL", struct.pack("<f", 4.0))], dropouts=[30, 20]))
    return path


def test_samples_have_the_units_and_frames_of_px4(log):
    recording = read(log)
    _, gyr, acc, q_nb = made.motion()
    imu, track = recording.imu, recording.track
    np.testing.assert_allclose(imu.gyr, gyr, atol=1e-7)
    np.testing.assert_allclose(imu.acc, acc, rtol=1e-6)
    known = np.isfinite(imu.mag).all(axis=1)
    assert known.sum() == 40
    np.testing.assert_allclose(imu.mag[known], [[20.0, 0.0, 40.0]] * 40, rtol=1e-6)  # 1 gauss is 100 µT
    assert imu.meta.frame is Frame.NED
    assert imu.meta.declination == pytest.approx(4.0 * np.pi / 180)
    assert imu.meta.t0_ns == 1_700_000_000_000_000_000 - 1_000_000_000  # GPS at 2 s of a clock whose first row is 1 s
    assert track.frame is Frame.NED and track.north is North.TRUE
    assert quat_angle(track.q_nb, q_nb).max() < 1e-3
    assert "not a reference" in track.source
    assert any("agreement, not accuracy" in str(note) for note in recording.notes)
    assert any("dropouts: the logger lost data 2 times, 0.05 s" in str(note) for note in recording.notes)


def test_a_new_acceleration_has_its_own_stamp(tmp_path):
    rows = [
        struct.pack("<Q3fIi3f", 1_000_000 + 5000 * i, 0, 0, 0, 5000, 0x7FFFFFFF if i % 2 else 1000, i, 0, -9.8)
        for i in range(100)
    ]
    imu = read(put(tmp_path / "a.ulg", made.ulog(topics=[("sensor_combined", 0, made.COMBINED, rows)]))).imu
    known = np.isfinite(imu.acc[:, 0])
    # every other row has none; each of the others is 1 ms later than its row: linear in time, x(t) = (t − 1 ms) / 5 ms
    np.testing.assert_allclose(imu.acc[known, 0], imu.t[known] / 0.005 - 0.2, atol=1e-6)


def test_single_sensors_are_taken_where_there_is_nothing_else(tmp_path):
    rows = [struct.pack("<QQI3f", 900 + 1000 * i, 1000 * i, 7, 0.1, 0.2, 0.3) for i in range(200)]
    topics = [
        ("sensor_gyro", 0, made.SINGLE, rows),
        ("sensor_gyro", 1, made.SINGLE, rows),
        ("sensor_accel", 0, made.SINGLE, rows),
        ("sensor_mag", 0, made.SINGLE, rows),
    ]
    recording = read(put(tmp_path / "single.ulg", made.ulog(topics=topics)))
    np.testing.assert_allclose(recording.imu.gyr, [[0.1, 0.2, 0.3]] * 200, rtol=1e-6)
    np.testing.assert_allclose(recording.imu.mag, [[10.0, 20.0, 30.0]] * 200, rtol=1e-6)
    assert recording.track is None
    said = " ".join(map(str, recording.notes))
    assert "samples: sensor_gyro.0, 200 records; not taken: sensor_gyro.1 (200); --unit sensor_gyro.1 takes" in said
    assert "axes of the board" in said and "acc: sensor_accel.0, of the same device" in said
    assert any("UTC: not known" in str(note) for note in recording.notes)


def several(turned=0):
    """The log of a vehicle with two IMUs, whose accelerometers are numbered the other way round."""
    t_us = [1_000_000 + 4000 * i for i in range(300)]

    def single(device, x):
        return [struct.pack("<QQI3f", t + 100, t, device, x, 0.2, 0.3) for t in t_us]

    increments = [struct.pack("<QQII6fII", t + 90, t, 1, 1, 2e-3, 0, 0, 0, 0, -0.0392, 4000, 4000) for t in t_us]
    combined = [struct.pack("<Q3fIi3f", t, 0.5, 0, 0, 4000, 0, 0, 0, -9.8) for t in t_us]
    topics = [
        ("sensor_combined", 0, made.COMBINED, combined),
        ("vehicle_imu", 1, made.INCREMENTS, increments),
        ("sensor_gyro", 0, made.SINGLE, single(0x260209, 1.0)),
        ("sensor_gyro", 1, made.SINGLE, single(0x230309, 2.0)),
        ("sensor_accel", 0, made.SINGLE, single(0x130309, 12.0)),
        ("sensor_accel", 1, made.SINGLE, single(0x160209, 11.0)),
        ("vehicle_magnetometer", 0, made.MAG, [struct.pack("<Q3f", t, 0.2, 0.0, 0.4) for t in t_us]),
    ]
    return made.ulog(topics=topics, told=[("int32_t", "SENS_BOARD_ROT", struct.pack("<i", turned))])


def test_another_imu_is_taken_where_it_is_asked_for(tmp_path):
    path = put(tmp_path / "several.ulg", several())
    first = read(path)
    assert first.imu.gyr[0, 0] == 0.5
    assert any(
        "not taken: vehicle_imu.1 (300), sensor_gyro.0 (300), sensor_gyro.1 (300); --unit vehicle_imu.1 takes"
        in str(note)
        for note in first.notes
    )
    for unit, rate, force in (("sensor_gyro.1", 2.0, 12.0), ("SensorGyro0", 1.0, 11.0), ("3", 1.0, 11.0)):
        recording = read(path, unit=unit)
        assert (recording.imu.gyr[0, 0], recording.imu.acc[0, 0]) == (rate, force)
        assert any("on the same bus and address" in str(note) for note in recording.notes)
        assert recording.imu.mag is not None
    means = read(path, unit="vehicle_imu.1").imu  # 2 mrad and -39.2 mm/s in 4 ms
    np.testing.assert_allclose(means.gyr, [[0.5, 0.0, 0.0]] * 300, rtol=1e-6)
    np.testing.assert_allclose(means.acc, [[0.0, 0.0, -9.8]] * 300, rtol=1e-6)
    listed = r"there are sensor_combined \(1\), vehicle_imu.1 \(2\)"
    refused(read, path, unit="sensor_gyro.7", match=listed, error=ParameterError)


def test_a_turned_boards_single_sensors_stand_alone(tmp_path):
    path = put(tmp_path / "turned.ulg", several(turned=4))
    recording = read(path, unit="sensor_gyro.0")
    assert recording.imu.mag is None and recording.track is None
    assert any("which are in body axes, as the board is turned" in str(note) for note in recording.notes)
    assert read(path).imu.mag is not None


def test_damage_between_messages_is_skipped_and_said(tmp_path):
    raw = made.px4()
    middle = raw.find(b"D", len(raw) // 2) - 2
    recording = read(put(tmp_path / "damaged.ulg", raw[:middle] + bytes(100) + raw[middle:]))
    assert len(recording.imu) >= 390
    assert any("skipped" in str(note) for note in recording.notes)


def test_what_a_crash_cut_is_read_up_to_the_cut(tmp_path):
    cut = len(made.px4(flags=bytes(40))) - 60  # within a message
    rest = made.message("D", struct.pack("<HQ3fIi3f", 0, 9_000_000, 0, 0, 0.5, 5000, 0, 0, 0, -9.8))
    flags = bytes(8) + b"\x01" + bytes(7) + struct.pack("<3Q", cut, 0, 0)
    (path := tmp_path / "crash.ulg").write_bytes(made.px4(flags=flags)[:cut] + rest)
    recording = read(path)
    assert len(recording.imu) == 399  # the last was cut; pyulog leaves out what follows, and that is said
    assert any("damage" in str(note) for note in recording.notes)
    assert "cut: the file ends within a message" in map(str, read(put(path, made.px4()[:-60])).notes)


LOOP = [("sensor_combined", 0, "uint64_t timestamp;sensor_combined x;", [bytes(20)])]
LAYERS = [("sensor_combined", 0, "n0[9] timestamp;", [bytes(20)])]
LAYERS += [(f"n{i}", 0, f"n{i + 1}[65535] a;", []) for i in range(7)]


@real
def test_a_real_log_agrees_with_pyulog_and_with_px4s_own_attitude():
    theirs = {one.name: one.data for one in pyulog.ULog(str(REAL)).data_list if one.multi_id == 0}
    recording = read(REAL)
    imu, track = recording.imu, recording.track
    combined = theirs["sensor_combined"]
    for axis in range(3):
        np.testing.assert_array_equal(imu.gyr[:, axis], combined[f"gyro_rad[{axis}]"].astype(float))
        np.testing.assert_array_equal(imu.acc[:, axis], combined[f"accelerometer_m_s2[{axis}]"].astype(float))
    np.testing.assert_array_equal(imu.t_ns // 1000, combined["timestamp"] - combined["timestamp"][0])
    assert np.isfinite(imu.mag).all(axis=1).sum() == len(theirs["vehicle_magnetometer"]["timestamp"]) == 319
    q = np.column_stack([theirs["vehicle_attitude"][f"q[{i}]"] for i in range(4)]).astype(float)
    assert quat_angle(track.q_nb, q).max() < 1e-6
    gps = theirs["vehicle_gps_position"]
    boot = np.median(gps["time_utc_usec"].astype(np.int64) - gps["timestamp"].astype(np.int64))
    assert abs(imu.meta.t0_ns / 1000 - boot - combined["timestamp"][0]) < 1000


@real
@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_real_logs_imus_agree_with_pyulog(number):
    theirs = {(one.name, one.multi_id): one.data for one in pyulog.ULog(str(REAL)).data_list}
    imu = read(REAL, unit=f"sensor_gyro.{number}").imu
    gyr, acc = theirs["sensor_gyro", number], theirs["sensor_accel", number]
    assert gyr["device_id"][0] == acc["device_id"][0]
    np.testing.assert_array_equal(imu.gyr, np.column_stack([gyr[axis] for axis in "xyz"]).astype(float))
    np.testing.assert_array_equal(imu.t_ns // 1000, gyr["timestamp_sample"] - gyr["timestamp_sample"][0])
    known = np.isfinite(imu.acc).all(axis=1)
    low, high = (getattr(np, what)([acc[axis] for axis in "xyz"], axis=1) for what in ("min", "max"))
    assert known.sum() >= 4 and ((imu.acc[known] >= low) & (imu.acc[known] <= high)).all()
    means, own = read(REAL, unit=f"vehicle_imu.{number}").imu, theirs["vehicle_imu", number]
    assert len(means) == len(own["timestamp"]) == 12
    np.testing.assert_allclose(means.gyr[:, 2] * own["delta_angle_dt"] / 1e6, own["delta_angle[2]"], rtol=1e-6)
    np.testing.assert_allclose(means.acc[:, 2] * own["delta_velocity_dt"] / 1e6, own["delta_velocity[2]"], rtol=1e-6)


@pytest.mark.parametrize(("name", "most"), [("px4_small.ulg", 0.5), ("ardupilot_test.bin", 1.5)])
def test_real_logs_frames_fit_gravity(name, most):
    recording = read(real_file(f"formats/{name}"))
    up_b = recording.imu.acc / np.linalg.norm(recording.imu.acc, axis=1)[:, None]
    w, x, y, z = recording.track.q_nb.T
    down_b = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    angle = np.rad2deg(np.arccos(np.clip(-(up_b * down_b).sum(axis=1), -1, 1)))
    assert np.nanmedian(angle) < most  # at rest before the flight: specific force points up


ARDUPILOT = DATA / "formats" / "ardupilot_test.bin"


def test_samples_have_the_units_and_frames_of_ardupilot(tmp_path):
    recording = read(put(tmp_path / "00000001.BIN", made.dataflash()))
    imu, track = recording.imu, recording.track
    _, gyr, acc, q_nb = made.motion()
    np.testing.assert_allclose(imu.gyr, gyr, atol=1e-7)
    np.testing.assert_allclose(imu.acc, acc, rtol=1e-6)
    known = np.isfinite(imu.mag).all(axis=1)
    np.testing.assert_allclose(imu.mag[known], [[20.0, 0.0, 40.0]] * 40)  # 1 milligauss is .1 µT
    assert imu.meta.frame is Frame.NED and imu.meta.declination == pytest.approx(0.2)
    assert track.frame is Frame.NED and track.north is North.TRUE
    assert quat_angle(track.q_nb, q_nb).max() < np.deg2rad(0.011)  # letter C counts .01°
    # week 2290, 4 days into it: 2023-11-30 00:00:00 GPS, 18 s less in UTC; the GPS message is 1 s after the first row
    assert imu.meta.t0_ns == (1_701_302_400 - 18 - 1) * 10**9
    assert "not a reference" in track.source


def test_the_first_of_several_units_is_taken_and_the_others_are_listed(tmp_path):
    path = put(tmp_path / "two.bin", made.dataflash(instances=True))
    recording = read(path)
    np.testing.assert_allclose(recording.imu.gyr[:, 2], 0.5, atol=1e-6)
    assert any("400 messages; not taken: IMU.1 (400); --unit IMU.1 takes" in str(note) for note in recording.notes)
    for unit in ("IMU.1", "imu1", "IMU[1]", "2"):
        other = read(path, unit=unit)
        np.testing.assert_allclose(other.imu.gyr, recording.imu.gyr + 1.0, atol=1e-6)
        assert quat_angle(other.track.q_nb, recording.track.q_nb).max() < 1e-9
    match = r"no unit 'IMU.2'; there are IMU.0 \(1\), IMU.1 \(2\)"
    refused(read, path, unit="IMU.2", match=match, error=ParameterError)


def test_all_units_on_the_same_stamps_are_an_array(tmp_path):
    path = put(tmp_path / "two.bin", made.dataflash(instances=True))
    array = read(path, unit="all").array
    assert array.names == ("IMU.0", "IMU.1")
    np.testing.assert_allclose(array.units["IMU.1"].gyr - array.units["IMU.0"].gyr, 1.0, atol=1e-6)
    again = read(write(tmp_path / "two.parquet", array)).array
    np.testing.assert_array_equal(again.units["IMU.1"].gyr, array.units["IMU.1"].gyr)
    path.write_bytes(path.read_bytes()[: -2 * 36 - 40])  # a message of one unit fewer
    refused(read, path, unit="all", match=r"stamps of their own.*--unit IMU.0", error=ParameterError)
    assert read(put(path, made.dataflash()), unit="all").imu is not None


def test_text_and_bytes_say_the_same(tmp_path):
    whole = made.dataflash_text(*made.motion())
    text, binary = tmp_path / "a.log", tmp_path / "a.bin"
    text.write_text(whole + "\nIMU, 1, 2\nIMU, x, 0, 0, 0, 0, 0, 0")
    of_text, of_bytes = read(text), read(put(binary, made.dataflash()))
    np.testing.assert_allclose(of_text.imu.acc, of_bytes.imu.acc, rtol=1e-6)
    assert quat_angle(of_text.track.q_nb, of_bytes.track.q_nb).max() < 1e-3
    assert of_text.imu.meta.declination == pytest.approx(0.2)
    assert any("2 lines left out" in str(note) for note in of_text.notes)


def test_old_logs_count_ms(tmp_path):
    out = made.fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89)
    out += made.fmt(129, "IMU", "Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", 31)
    for i in range(100):
        out += b"\xa3\x95\x81" + struct.pack("<I6f", 1000 + 20 * i, 0, 0, 0.1, 0, 0, -9.8)
    np.testing.assert_allclose(np.diff(read(put(tmp_path / "old.bin", out)).imu.t), 0.02)


@needs("formats/ardupilot_test.bin")
@pytest.mark.parametrize(("unit", "other"), [("IMU", "IMU2"), ("IMU2", "IMU")])
def test_a_real_log_agrees_with_pymavlink(unit, other):
    reader = pytest.importorskip("pymavlink.DFReader", reason="the format's own package is not installed")
    rows, angles = [], []
    with contextlib.closing(reader.DFReader_binary(str(ARDUPILOT))) as log:
        while (one := log.recv_match(type=[unit, "NKQ1"])) is not None:
            if one.get_type() == unit:
                rows.append([one.TimeUS, one.GyrX, one.GyrY, one.GyrZ, one.AccX, one.AccY, one.AccZ])
            else:
                angles.append([one.Q1, one.Q2, one.Q3, one.Q4])
    theirs, recording = np.array(rows), read(ARDUPILOT, unit=unit)
    np.testing.assert_allclose(np.column_stack([recording.imu.gyr, recording.imu.acc]), theirs[:, 1:], rtol=1e-7)
    np.testing.assert_allclose(recording.imu.t, (theirs[:, 0] - theirs[0, 0]) / 1e6, atol=1e-9)
    np.testing.assert_array_equal(read(ARDUPILOT, unit="all").array.units[unit].acc, recording.imu.acc)
    assert np.isfinite(recording.track.q_nb).all(axis=1).sum() == 44
    assert quat_angle(recording.track.q_nb[1], np.array(angles[0])) < 1e-2
    assert any(f"not taken: {other} (45); --unit {other} takes another" in str(note) for note in recording.notes)


def sent_highres(sender, wire, mavlink):
    t_us, gyr, acc, q_nb = made.motion(200)
    for i, t in enumerate(t_us.tolist()):
        wire.us = 1_700_000_000_000_000 + t + 3000 + (i % 7) * 1000
        sender.highres_imu_send(t, *acc[i], *gyr[i], 0.2, 0.0, 0.4, 1000.0, 0.0, 0.0, 25.0, 0x1FF)
        sender.attitude_quaternion_send(t // 1000, *q_nb[i], *gyr[i])


def sent_raw(sender, wire, mavlink, autopilot=3):
    t_us, _, _, _ = made.motion(200)
    for t in t_us.tolist():
        wire.us = 1_700_000_000_000_000 + t
        sender.heartbeat_send(2, autopilot, 0, 0, 0)
        sender.raw_imu_send(t, 0, 0, -1000, 0, 0, 500, 200, 0, 400)


def test_telemetry_in_si(tmp_path):
    recording = read(put(tmp_path / "a.tlog", telemetry(sent_highres)))
    _, gyr, acc, q_nb = made.motion(200)
    np.testing.assert_allclose(recording.imu.gyr, gyr, atol=1e-7)
    np.testing.assert_allclose(recording.imu.acc, acc, rtol=1e-6)
    np.testing.assert_allclose(recording.imu.mag[0], [20.0, 0.0, 40.0], rtol=1e-6)
    assert quat_angle(recording.track.q_nb, q_nb)[:-1].max() < 1e-3
    assert recording.imu.meta.t0_ns == 1_700_000_000_000_000_000 + 1_003_000_000  # the soonest packet's delay: 3 ms


def test_telemetry_in_milli_units_where_ardupilot_sent_it(tmp_path):
    imu = read(put(tmp_path / "a.tlog", telemetry(sent_raw))).imu
    np.testing.assert_allclose(imu.acc, [[0.0, 0.0, -made.G]] * 200)  # −1000 mg
    np.testing.assert_allclose(imu.gyr, [[0.0, 0.0, 0.5]] * 200)  # 500 mrad/s
    np.testing.assert_allclose(imu.mag, [[20.0, 0.0, 40.0]] * 200)  # 200 and 400 mgauss


def test_another_imu_of_telemetry(tmp_path):
    def sent(sender, wire, mavlink):
        for i in range(50):
            wire.us = 1_700_000_000_000_000 + 20_000 * i
            sender.scaled_imu_send(20 * i, 0, 0, -1000, 100, 0, 0, 0, 0, 0)
            sender.scaled_imu2_send(20 * i, 0, 0, -1000, 200, 0, 0, 0, 0, 0)

    path = put(tmp_path / "a.tlog", telemetry(sent))
    assert any("not taken: SCALED_IMU2 (50); --unit SCALED_IMU2" in str(note) for note in read(path).notes)
    np.testing.assert_allclose(read(path, unit="scaled_imu2").imu.gyr, [[0.2, 0.0, 0.0]] * 50)


def test_a_packet_with_a_wrong_crc_is_left_out(tmp_path):
    raw = bytearray(telemetry(sent_highres))
    raw[8 + 10 + 12] ^= 1  # in the first packet's payload
    recording = read(put(tmp_path / "a.tlog", bytes(raw)))
    assert len(recording.imu) == 199
    assert any("1 packet left out" in str(note) for note in recording.notes)


LIE = made.fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89)
LIE += made.fmt(129, "IMU", "Qffffff", "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", 50) + b"\xa3\x95\x81" + bytes(47)


@pytest.mark.parametrize(
    ("name", "raw", "match"),
    [
        ("a.ulg", made.px4(flags=bytes(8) + b"\x02" + bytes(7) + bytes(24)), "incompatible flags"),
        ("a.ulg", made.ulog(topics=LOOP), "holds itself"),
        ("a.ulg", made.ulog(topics=LAYERS), "a.ulg"),
        ("a.ulg", b"ULog", "its content is not"),
        ("a.ulg", made.ulog(topics=[("sensor_mag", 0, made.SINGLE, [])]), "no samples of a gyroscope"),
        ("lie.bin", LIE, "no samples of a gyroscope"),  # a definition of another length than its letters
        ("raw.bin", b"\x55\x51" * 500, "its content is not"),
        ("a.tlog", lambda: telemetry(lambda *a: sent_raw(*a, autopilot=12)), "units are those of an unknown maker"),
    ],
)
def test_what_is_no_log_of_samples_is_refused(tmp_path, name, raw, match):
    refused(read, put(tmp_path / name, raw() if callable(raw) else raw), match=match, name=name)
