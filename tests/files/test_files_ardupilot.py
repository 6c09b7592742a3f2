"""Logs of ArduPilot, and telemetry of MAVLink."""

import contextlib
import struct

import numpy as np
import pytest

from plumbob.core.errors import ParameterError
from plumbob.files import read, write
from plumbob.rotations import Frame, North, quat_angle
from tests.helpers import log_samples as made
from tests.helpers.file_kinds import telemetry
from tests.helpers.io_samples import put, refused
from tests.helpers.real_data import DATA, needs

REAL = DATA / "formats" / "ardupilot_test.bin"
real = needs("formats/ardupilot_test.bin")


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
    match = r"no unit 'IMU.2' in the log; there are IMU.0 \(1\), IMU.1 \(2\)"
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


@real
@pytest.mark.parametrize(("unit", "other"), [("IMU", "IMU2"), ("IMU2", "IMU")])
def test_a_real_log_agrees_with_pymavlink(unit, other):
    reader = pytest.importorskip("pymavlink.DFReader", reason="the format's own package is not installed")
    rows, angles = [], []
    with contextlib.closing(reader.DFReader_binary(str(REAL))) as log:
        while (one := log.recv_match(type=[unit, "NKQ1"])) is not None:
            if one.get_type() == unit:
                rows.append([one.TimeUS, one.GyrX, one.GyrY, one.GyrZ, one.AccX, one.AccY, one.AccZ])
            else:
                angles.append([one.Q1, one.Q2, one.Q3, one.Q4])
    theirs, recording = np.array(rows), read(REAL, unit=unit)
    np.testing.assert_allclose(np.column_stack([recording.imu.gyr, recording.imu.acc]), theirs[:, 1:], rtol=1e-7)
    np.testing.assert_allclose(recording.imu.t, (theirs[:, 0] - theirs[0, 0]) / 1e6, atol=1e-9)
    np.testing.assert_array_equal(read(REAL, unit="all").array.units[unit].acc, recording.imu.acc)
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
        ("lie.bin", LIE, "no samples of a gyroscope"),  # a definition of another length than its letters
        ("raw.bin", b"\x55\x51" * 500, "its content is not"),
        ("a.tlog", lambda: telemetry(lambda *a: sent_raw(*a, autopilot=12)), "units are those of an unknown maker"),
    ],
)
def test_what_is_no_log_of_samples_is_refused(tmp_path, name, raw, match):
    (tmp_path / name).write_bytes(raw() if callable(raw) else raw)
    refused(read, tmp_path / name, match=match, name=name)
