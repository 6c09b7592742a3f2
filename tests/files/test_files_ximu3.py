"""Logs of x-IMU3: the vector of its protocol, tables in the form of x-IMU3-CSV's examples, and damage."""

import numpy as np
import pytest

from plumbob.core.constants import G0
from plumbob.files import read
from plumbob.rotations import Frame, North
from tests.helpers.file_kinds import binary
from tests.helpers.io_samples import put, refused

# 0.5, -0.25, 0 deg/s; 0, 0, 1 g; t = 1 s
VECTOR = bytes.fromhex("C940420F00000000000000003F000080BE0000000000000000000000000000803F0A")


def test_the_vector_of_the_protocol_escapes_other_messages_and_junk(tmp_path):
    imu = read(put(tmp_path / "a.ximu3", VECTOR + b"I,1010000,0.5,-0.25,0.0,0.0,0.0,1.0\r\n")).imu
    np.testing.assert_allclose(imu.t, [0.0, 0.01])
    np.testing.assert_allclose(imu.gyr, np.tile(np.deg2rad([0.5, -0.25, 0.0]), (2, 1)))
    np.testing.assert_allclose(imu.acc, np.tile([0.0, 0.0, G0], (2, 1)))
    raw = b""
    for i in range(30):
        us = 0x0A0A + 0xDB * 256 * i  # stamps with line feeds and escapes in them
        raw += binary("I", us, 1.0, 2.0, 3.0, 0.0, 0.0, 1.0)
        if i % 5 == 0:
            raw += binary("M", us, 0.6, 0.0, -0.8) + binary("T", us, 21.5) + binary("Q", us, 1.0, 0.0, 0.0, 0.0)
    raw += (
        b'{"ping":{}}\n' + binary("B", 1, 50.0, 3.9, 0.0) + b"rubbish\n" + b"\xc9short\n" + b"I,1,2\r\n" + b"\xc9\x40"
    )
    recording = read(put(tmp_path / "a.ximu3", raw))
    imu = recording.imu
    assert len(imu) == 30
    np.testing.assert_allclose(np.diff(imu.t), 0xDB * 256 / 1e6, atol=1e-9)
    known = np.isfinite(imu.mag).all(axis=1)
    np.testing.assert_allclose(imu.mag[known], np.tile([30.0, 0.0, -40.0], (6, 1)), rtol=1e-6)
    told = " ".join(map(str, recording.notes))
    assert "2 messages of other kinds" in told and "3 lines that are not a message" in told and "cut: " in told


# headings and rows of x-IMU3-CSV, Examples/Logged Data/x-IMU3 673B204B (UDP)
INERTIAL = (
    "Timestamp (us),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),"
    "Accelerometer Y (g),Accelerometer Z (g)\n"
    "19150794,0.013032,-0.038818,0.066303,0.000251,0.002156,0.996598\n"
    "19170785,-0.017099,-0.023405,0.013023,-0.000452,0.003719,0.996662\n"
    "19190775,0.089343,0.060296,0.051176,0.001046,0.003720,0.999147\n"
)


@pytest.mark.parametrize(
    ("told", "frame", "north"),
    [
        ("[]", Frame.NWU, North.FREE),
        ('[{"ahrs_axes_convention":1},{"ahrs_ignore_magnetometer":false}]', Frame.ENU, North.MAGNETIC),
        ('[{"ahrs_axes_convention":2},{"ahrs_ignore_magnetometer":true}]', Frame.NED, North.FREE),
    ],
)
def test_the_folder_of_the_gui(tmp_path, told, frame, north):
    files = {
        "Inertial.csv": INERTIAL,
        "Magnetometer.csv": "Timestamp (us),X (a.u.),Y (a.u.),Z (a.u.)\n19146542,-0.173422,-0.415600,-1.137092\n",
        "Quaternion.csv": "Timestamp (us),W,X,Y,Z\n19150794,1.000121,0.001371,-0.000304,-0.000178\n"
        "19170785,1.000121,0.001373,-0.000303,-0.000175\n19190775,1.000121,0.001393,-0.000295,-0.000166\n",
        "Temperature.csv": "Timestamp (us),Temperature (degC)\n19170675,32.250000\n",
        "Command.json": told,
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    recording = read(tmp_path)
    imu, track = recording.imu, recording.track
    np.testing.assert_allclose(imu.gyr[0], np.deg2rad([0.013032, -0.038818, 0.066303]))
    np.testing.assert_allclose(imu.acc[2], np.array([0.001046, 0.003720, 0.999147]) * G0)
    np.testing.assert_allclose(imu.mag[0], np.array([-0.173422, -0.415600, -1.137092]) * 50.0)
    np.testing.assert_allclose(
        track.q_nb[1], np.array([1.000121, 0.001373, -0.000303, -0.000175]) / 1.000122, atol=1e-6
    )
    assert (track.frame, track.north) == (frame, north)
    assert len(read(tmp_path / "Inertial.csv").imu) == 3


def test_tables_with_other_units_are_refused(tmp_path):
    (tmp_path / "Inertial.csv").write_text(INERTIAL.replace("Accelerometer X (g)", "Accelerometer X (m/s2)"))
    refused(read, tmp_path, match="which x-IMU3 does not write")
