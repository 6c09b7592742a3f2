"""EuRoC, TUM VI, KITTI and RepoIMU, written by hand as their head lines and descriptions have them."""

import os

import numpy as np
import pytest

from plumbob.files import kind_of, read
from plumbob.rotations import Frame, North, quat_angle, quat_multiply, quat_rotate
from tests.helpers import log_samples as made
from tests.helpers.file_kinds import HEAD, IDENTITY, IMU_HEAD, QUARTER, START, asl, drive, yaml
from tests.helpers.io_samples import put, refused


def test_euroc_has_the_units_and_frames_of_its_head_lines_and_its_truth_the_axes_of_the_imu(tmp_path):
    recording = read(asl(tmp_path / "MH_01_easy"))
    imu, track = recording.imu, recording.track
    assert recording.name == "MH_01_easy"
    np.testing.assert_allclose(imu.gyr, [[0.1, -0.2, 0.3]] * 100)
    np.testing.assert_allclose(imu.acc, [[made.G, 0, 0]] * 100)
    assert imu.meta.t0_ns == START and imu.meta.rate_nominal == 200.0
    np.testing.assert_array_equal(np.diff(imu.t_ns), 5_000_000)
    assert track.frame is Frame.ENU and track.north is North.FREE
    known = track.known
    assert known.sum() == 80 and not known[:10].any() and not known[90:].any()
    # at rest the specific force points up in the navigation frame
    np.testing.assert_allclose(quat_rotate(track.q_nb[known], imu.acc[known]), [[0, 0, made.G]] * 80, atol=1e-9)
    plain = read(asl(tmp_path / "plain")).track.q_nb[50]
    about_z = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    both = read(asl(tmp_path / "both", imu_turn=QUARTER, truth_turn=QUARTER)).track.q_nb[50]
    assert quat_angle(both, plain) < 1e-9  # the same sensor axes
    one = read(asl(tmp_path / "one", imu_turn=QUARTER))
    assert quat_angle(one.track.q_nb[50], quat_multiply(plain, about_z)) < 1e-9
    assert any("T_BS turns its axes" in str(note) for note in one.notes)


def test_tum_vi_has_motion_capture_and_a_table_alone_has_no_reference(tmp_path):
    folder = asl(tmp_path / "room1", truth="mocap0")
    assert "motion capture" in read(folder).track.source
    assert "motion capture" in read(folder / "mav0").track.source
    alone = read(folder / "mav0" / "imu0" / "data.csv")
    assert alone.track is None and alone.name == "room1" and len(alone.imu) == 100


def test_columns_are_those_of_the_row_of_names(tmp_path):
    table = asl(tmp_path / "MH_03") / "mav0" / "imu0" / "data.csv"
    right = read(table).imu
    lines = [line.split(",") for line in table.read_text().splitlines()]
    swapped = "\n".join(",".join([row[0], *row[4:], *row[1:4]]) for row in lines)
    imu = read(put(table, swapped + "\n")).imu
    np.testing.assert_array_equal(imu.acc, right.acc)
    np.testing.assert_array_equal(imu.gyr, right.gyr)
    table.write_text(swapped.replace("rad s^-1", "deg s^-1") + "\n")
    np.testing.assert_allclose(read(table).imu.gyr, np.radians(right.gyr), rtol=1e-12)
    table.write_text(swapped.replace("rad s^-1", "V") + "\n")
    refused(read, table, match="its row of names is not that of the ASL layout")


def test_damaged_sequences_are_refused(tmp_path):
    folder = asl(tmp_path / "MH_02")
    sensor, table = folder / "mav0" / "imu0" / "sensor.yaml", folder / "mav0" / "imu0" / "data.csv"
    for turn, match in (
        ("[1, 2, 3]", "16 numbers"),
        (IDENTITY.replace("1.0", "x"), "16 numbers"),
        (IDENTITY.replace("1.0", "2.0"), "not a rotation"),
    ):
        sensor.write_text(yaml(turn))
        refused(read, folder, match=match)
    sensor.unlink()
    assert any("no sensor.yaml" in str(note) for note in read(folder).notes)
    whole = table.read_text()
    for row in ("1,2,3", f"{START},a,0,0,0,0,0", f"{10**30},0,0,0,0,0,0"):
        table.write_text(f"{whole}{row}\n")
        assert any(note.code == "reading.lines_left_out" for note in read(folder).notes)
    table.write_text(IMU_HEAD)
    refused(read, folder, match="row")
    (tmp_path / "elsewhere.csv").write_text(whole)
    for target, match in (("/dev/zero", "MH_02 is a folder"), (tmp_path / "elsewhere.csv", "leads out of the folder")):
        table.unlink()
        table.symlink_to(target)
        refused(read, folder, match=match)


def test_kitti_has_the_units_and_frames_of_its_description(tmp_path):
    folder = drive(tmp_path / "2011_09_26_drive_0001_sync")
    recording = read(folder)
    imu, track = recording.imu, recording.track
    assert recording.name == folder.name and kind_of(folder).name == "KITTI"
    np.testing.assert_allclose(imu.gyr, [[0.01, 0.02, 0.03]] * 50)
    np.testing.assert_allclose(np.diff(imu.t), 0.1, atol=1e-8)
    assert track.frame is Frame.ENU and track.north is North.TRUE
    np.testing.assert_allclose(quat_rotate(track.q_nb, imu.acc), [[0, 0, made.G]] * 50, atol=1e-9)
    front = quat_rotate(track.q_nb[0], [1.0, 0, 0])
    assert front[2] == pytest.approx(-np.sin(0.1))  # pitch positive: front down
    assert np.arctan2(front[1], front[0]) == pytest.approx(0.3)  # 0 = East, counter-clockwise
    assert quat_rotate(track.q_nb[0], [0, 1.0, 0])[2] < 0  # roll negative: left side down
    assert imu.meta.t0_ns == 0 and any("time zone" in str(note) for note in recording.notes)


def test_a_drive_with_missing_samples_keeps_their_time(tmp_path):
    folder = drive(tmp_path / "d")
    for i in range(20, 30):
        (folder / "oxts" / "data" / f"{i:010d}.txt").unlink()
    recording = read(folder)
    assert len(recording.imu) == 40
    assert recording.imu.t[20] - recording.imu.t[19] == pytest.approx(1.1)
    assert any("10 samples of 50 have a stamp and no file" in str(note) for note in recording.notes)


def test_damaged_drives_are_refused(tmp_path):
    folder = drive(tmp_path / "d")
    stamps, sample = folder / "oxts" / "timestamps.txt", folder / "oxts" / "data" / "0000000007.txt"
    no_row, no_stamp, no_date = "30 numbers", "no stamp", "not a time"
    for path, text, match in (
        *((sample, text, no_row) for text in ("1 2 3", sample.read_text() + " 1", "x " * 30, "")),
        (stamps, "2011-09-26 13:02:25\n", no_stamp),
        *((stamps, text, no_date) for text in ("yesterday\n", "NaT\n" * 50)),
    ):
        whole = path.read_text()
        path.write_text(text)
        refused(read, folder, match=match)
        path.write_text(whole)
    assert len(read(folder).imu) == 50
    sample.unlink()
    os.mkfifo(sample)
    refused(read, folder, match="30 numbers")


def test_repoimu_has_the_units_of_its_description(tmp_path):
    path = tmp_path / "TStick_Test01.csv"
    rows = [f"{0.01 * i:.2f};1;0;0;0;0;0;9.81;0.1;0.2;0.3;0;0.4;-0.9\n" for i in range(1, 101)]
    rows[10] = rows[10].replace(";1;0;0;0;0", ";0;0;0;0;0")  # Vicon lost the markers
    recording = read(put(path, HEAD + "".join(rows)))
    np.testing.assert_allclose(recording.imu.acc, [[0, 0, 9.81]] * 100)
    np.testing.assert_allclose(recording.imu.gyr, [[0.1, 0.2, 0.3]] * 100)
    np.testing.assert_allclose(recording.imu.mag, [[0, 20.0, -45.0]] * 100)  # local fields of 50 µT
    np.testing.assert_allclose(np.diff(recording.imu.t), 0.01)
    assert recording.track.north is North.FREE
    assert np.flatnonzero(~recording.track.known).tolist() == [10]
    assert "--align heading,mounting" in recording.track.source
    assert len(read(put(path, HEAD + "".join(rows) + "1;2;3\n")).imu) == 100
