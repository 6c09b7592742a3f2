"""Logs of PX4."""

import struct

import numpy as np
import pytest
import pyulog

from plumbob.core.errors import ParameterError
from plumbob.files import read
from plumbob.files.foreign import ulog as reader
from plumbob.rotations import Frame, North, quat_angle
from tests.helpers import log_samples as made
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


@pytest.mark.parametrize(
    ("raw", "match"),
    [
        (made.px4(flags=bytes(8) + b"\x02" + bytes(7) + bytes(24)), "incompatible flags"),
        (made.ulog(topics=LOOP), "holds itself"),
        (made.ulog(topics=LAYERS), "a.ulg"),
        (b"ULog", "its content is not"),
        (made.ulog(topics=[("sensor_mag", 0, made.SINGLE, [])]), "no samples of a gyroscope"),
    ],
)
def test_what_is_no_log_of_samples_is_refused(tmp_path, raw, match):
    refused(read, put(tmp_path / "a.ulg", raw), match=match)
    assert reader.accepts(tmp_path / "a.ulg") == (len(raw) > 16)


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
