"""Exports of MT Manager, written by hand in the form of OpenSim's example and of MT Manager 2022."""

import numpy as np
import pytest

from plumbob.core.errors import ClockError, DecodeError, ParameterError
from plumbob.files import read
from plumbob.rotations import Frame, quat_from_dcm
from tests.helpers.file_kinds import NEW, OLD, SENSORS, export
from tests.helpers.io_samples import refused

# the row in opensim-core's testXsensDataReader.cpp, of sensor 00B421AF
VALUES = [3.030769, 5.254238, -7.714005, 0.005991, -0.032133, 0.022713, -0.045410, -0.266113, 0.897217]
MATRIX = [f"Mat[{row}][{column}]" for column in (1, 2, 3) for row in (1, 2, 3)]
TURN = [0.609684, 0.730843, 0.306845, 0.519480, -0.660808, 0.541732, 0.598686, -0.170885, -0.782543]


@pytest.mark.parametrize("separator", ["\t", ",", ";"])
def test_counter_and_declared_rate_with_a_wrap_and_a_lost_packet(tmp_path, separator):
    counts = [(65530 + i) % 65536 for i in range(20) if i != 12]
    rows = [[f"{count:05d}", "", *VALUES, *TURN] for count in counts]
    path = export(tmp_path / "a.txt", OLD, ["PacketCounter", "SampleTimeFine", *SENSORS, *MATRIX], rows, separator)
    recording = read(path)
    imu = recording.imu
    np.testing.assert_allclose(imu.t, [i / 100 for i in range(20) if i != 12], atol=1e-9)
    np.testing.assert_allclose(imu.acc[0], VALUES[:3])
    np.testing.assert_allclose(imu.gyr[0], VALUES[3:6])
    np.testing.assert_allclose(imu.mag[0], np.array(VALUES[6:9]) * 50.0)  # a.u., of a nominal field of 50 µT
    assert imu.meta.rate_nominal == 100.0
    assert recording.track is None  # the old head does not say the frame
    told = " ".join(map(str, recording.notes))
    assert "leaves out 1 packet" in told and "the file does not say its frame" in told and "arbitrary units" in told


def test_sample_time_fine_counts_tenths_of_milliseconds_and_wraps(tmp_path):
    ticks = [(2**32 - 500 + 100 * i) % 2**32 for i in range(20)]
    rows = [[i, tick, *VALUES, *TURN] for i, tick in enumerate(ticks)]
    columns = ["PacketCounter", "SampleTimeFine", *SENSORS, *MATRIX]
    recording = read(export(tmp_path / "a.txt", NEW, columns, rows))
    np.testing.assert_allclose(recording.imu.t, np.arange(20) / 100, atol=1e-9)
    assert recording.imu.meta.device == "MTW2-3A7G6 00B4D6D1"
    track = recording.track
    assert track.frame is Frame.ENU
    # columns of the file run down the columns of the matrix, which turns sensor to ENU
    dcm = np.array(TURN).reshape(3, 3).T
    np.testing.assert_allclose(track.q_nb[3], quat_from_dcm(dcm, tolerance=1e-4), atol=1e-9)
    up = dcm @ VALUES[:3]
    assert up[2] > 9.5  # the specific force of that row points up, as of a sensor nearly at rest


def test_quaternions_first_and_start_in_utc(tmp_path):
    columns = ["PacketCounter", *SENSORS, "Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3", "Roll", "Pitch", "Yaw"]
    rows = [[i, *VALUES, 0.5, -0.5, 0.5, 0.5, 1, 2, 3] for i in range(10)]
    track = read(export(tmp_path / "a.txt", OLD + "// Coordinate system: NED\n", columns, rows)).track
    assert track.frame is Frame.NED
    np.testing.assert_array_equal(track.q_nb, np.tile([0.5, -0.5, 0.5, 0.5], (10, 1)))
    utc = ["UTC_Nano", "UTC_Year", "UTC_Month", "UTC_Day", "UTC_Hour", "UTC_Minute", "UTC_Second", "UTC_Valid"]
    rows = [[i, 100 * i, 250_000_000, 2024, 5, 1, 12, 30, 5 + i, 7, *VALUES] for i in range(10)]
    imu = read(export(tmp_path / "a.txt", NEW, ["PacketCounter", "SampleTimeFine", *utc, *SENSORS], rows)).imu
    assert imu.meta.t0_ns == 1_714_566_605_250_000_000  # date -u -d '2024-05-01 12:30:05.25' +%s%N


def test_an_attitude_alone_is_a_track(tmp_path):
    """As OpenSense takes it; the file must say the frame."""
    table = [[i, *TURN] for i in range(10)]
    path = export(tmp_path / "a.txt", OLD + "// Coordinate system: ENU\n", ["PacketCounter", *MATRIX], table)
    recording = read(path)
    assert recording.imu is None
    assert recording.track.t == pytest.approx(np.arange(10) / 100.0)
    dcm = np.array(TURN).reshape(3, 3).T
    np.testing.assert_allclose(recording.track.q_nb[3], quat_from_dcm(dcm, tolerance=1e-4), atol=1e-9)
    refused(read, export(tmp_path / "b.txt", OLD, ["PacketCounter", *MATRIX], table), match="does not say its frame")


def test_increments_stand_for_rates_and_accelerations(tmp_path):
    """A turn of 0.02 rad about z in each sample of 10 ms, and gravity along z with 1 m/s² along x when it begins."""
    columns = [
        "PacketCounter",
        "SampleTimeFine",
        *(f"VelInc_{axis}" for axis in "XYZ"),
        *(f"OriInc_q{k}" for k in range(4)),
    ]
    row = [0.01, 0.0, 0.0981, np.cos(0.01), 0.0, 0.0, np.sin(0.01)]
    recording = read(export(tmp_path / "a.txt", NEW, columns, [[i, 100 * i, *row] for i in range(10)]))
    np.testing.assert_allclose(recording.imu.gyr, [[0.0, 0.0, 2.0]] * 10, atol=1e-12)
    # seen from axes that have turned left by 0.02 rad, what lay along x lies 0.02 rad to the right
    np.testing.assert_allclose(recording.imu.acc, [[np.cos(0.02), -np.sin(0.02), 9.81]] * 10, atol=1e-12)
    path = export(tmp_path / "b.txt", NEW, columns[:5], [[i, 100 * i, *row[:3]] for i in range(10)])
    recording = read(path)
    np.testing.assert_allclose(recording.imu.acc, [[1.0, 0.0, 9.81]] * 10, atol=1e-12)
    assert any("in the axes at its beginning, as no rate is known" in str(note) for note in recording.notes)
    with pytest.raises(ParameterError, match="holds one unit without a name"):
        read(path, unit="2")


COUNTED, TIMED = ["PacketCounter", *SENSORS], ["PacketCounter", "SampleTimeFine", *SENSORS]
REFUSED = [
    (NEW, COUNTED, [[1, *VALUES]] * 5, "add that line"),
    (OLD, TIMED, [[1, "x", *VALUES]] * 5, "line 6, column 'Sample"),
    (OLD, COUNTED, [[1.5, *VALUES]] * 5, "time: PacketCounter has cells that are not whole numbers below 65536"),
    (OLD, COUNTED, [["", *VALUES]] * 5, "neither SampleTimeFine nor"),
    (OLD, COUNTED, [[7, *VALUES]] * 5, "all 5 time stamps are 0", ClockError),
    # microseconds, as Xsens DOT has them
    (OLD, TIMED, [[i, 10_000 * i, *VALUES] for i in range(10)], "100 Hz", ClockError),
]


@pytest.mark.parametrize("case", REFUSED, ids=range(len(REFUSED)))
def test_what_has_no_time_is_refused(tmp_path, case):
    head, columns, rows, match, error = (*case, DecodeError)[:5]
    refused(read, export(tmp_path / "a.txt", head, columns, rows), match=match, error=error, name="a.txt")
