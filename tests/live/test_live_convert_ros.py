"""convert for ROS and EuRoC: what the formats' own libraries read of it, the way back, and whole or nothing."""

import errno
import os
import sys

import numpy as np
import pytest

import plumbob
from plumbob.core import files as core_files
from plumbob.core.errors import ClockError, DecodeError, MissingExtraError, ParameterError, ShapeError
from plumbob.door.allan import load_static
from plumbob.rotations import Frame, North, dcm_from_quat
from tests.helpers.commandline import ok

rosbags = pytest.importorskip("rosbags")

ROWS = 120
T0 = 1_700_000_000_987_654_321
FLU = np.array([1.0, -1.0, -1.0])
"""Forward, right, down as forward, left, up (REP 103): half a turn about x."""
LAYOUTS = {"a.bag": None, "a.mcap": "ros2", "a": "rosbag2"}


@pytest.fixture
def recording():
    """In NED, with a magnetometer that has a value in three of four samples, and one triad and axis missing once."""
    rng = np.random.default_rng(4)
    t = np.cumsum(rng.uniform(0.005, 0.015, ROWS)).round(9)
    gyr, acc = rng.normal(size=(ROWS, 3)), rng.normal(size=(ROWS, 3)) + [0.0, 0.0, -9.8]
    gyr[7], acc[9, 1] = np.nan, np.nan
    mag = rng.normal(size=(ROWS, 3)) + [20.0, 0.0, 40.0]
    mag[::4] = np.nan
    temp = np.where(np.arange(ROWS) % 10 == 0, 20.0 + rng.normal(size=ROWS), np.nan)
    q_nb = rng.normal(size=(ROWS, 4))
    q_nb /= np.linalg.norm(q_nb, axis=1, keepdims=True)
    q_nb[11] = np.nan
    root = rng.normal(size=(ROWS, 3, 3)) * 0.01
    meta = plumbob.ImuMeta(device="board 7", t0_ns=T0, frame=Frame.NED)
    track = plumbob.AttitudeTrack(
        t=t, q_nb=q_nb, frame=Frame.NED, north=North.MAGNETIC, cov_b=root @ np.swapaxes(root, 1, 2)
    )
    imu = plumbob.ImuData(t=t, gyr=gyr, acc=acc, mag=mag, temp_c=temp, meta=meta)
    return plumbob.Recording(imu=imu, track=track, name="a")


def messages(path):
    """Messages by topic, as rosbags reads them."""
    from rosbags.highlevel import AnyReader

    found = {}
    with AnyReader([path]) as bag:
        for connection, log_ns, raw in bag.messages():
            one = bag.deserialize(raw, connection.msgtype)
            assert one.header.stamp.sec * 10**9 + one.header.stamp.nanosec == log_ns
            found.setdefault((connection.topic, connection.msgtype), []).append((log_ns, one))
    return found


def xyz(vector):
    return [vector.x, vector.y, vector.z]


@pytest.mark.parametrize("name", LAYOUTS)
def test_rosbags_reads_it(recording, tmp_path, name):
    notes = []
    plumbob.convert(recording, tmp_path / name, layout=LAYOUTS[name], note=notes.append)
    assert any("ROS has no place for what headings count from: left out" in note for note in notes)
    assert any("turned to forward, left and up (REP 103)" in note for note in notes)
    imu, found = recording.imu, messages(tmp_path / name)
    assert {topic: len(rows) for (topic, _), rows in found.items()} == {
        "/imu/data": ROWS, "/imu/mag": ROWS * 3 // 4, "/imu/temperature": ROWS // 10,
    }  # fmt: skip
    rows = [one for _, one in found["/imu/data", "sensor_msgs/msg/Imu"]]
    stamps = [log_ns for log_ns, _ in found["/imu/data", "sensor_msgs/msg/Imu"]]
    assert stamps == (imu.t_ns + T0).tolist()
    assert {one.header.frame_id for one in rows} == {"board 7"}
    rates = np.array([xyz(one.angular_velocity) for one in rows])
    assert np.array_equal(np.delete(rates, 7, axis=0), np.delete(imu.gyr * FLU, 7, axis=0))
    assert [i for i, one in enumerate(rows) if one.angular_velocity_covariance[0] == -1.0] == [7]
    forces = np.array([xyz(one.linear_acceleration) for one in rows])
    assert np.array_equal(forces, imu.acc * FLU, equal_nan=True)  # one axis alone has no word but NaN
    assert [i for i, one in enumerate(rows) if one.orientation_covariance[0] == -1.0] == [11]
    xyzw = np.array([[*xyz(one.orientation), one.orientation.w] for one in rows])
    assert np.nanmedian(forces[:, 2]) > 9.0  # at rest the force points up, and so does z of the body
    # NED to ENU swaps x and y and turns z over: a vector of the body must come out so
    known = recording.track.known
    down, up = dcm_from_quat(recording.track.q_nb[known]), dcm_from_quat(xyzw[known][:, [3, 0, 1, 2]])
    np.testing.assert_allclose(up, down[:, [1, 0, 2], :] * [[1.0], [1.0], [-1.0]] * FLU, atol=1e-12)
    covs = np.array([one.orientation_covariance for one in rows]).reshape(-1, 3, 3)[known]
    told = recording.track.cov_b[known] * np.outer(FLU, FLU)
    np.testing.assert_allclose(np.swapaxes(up, 1, 2) @ covs @ up, told, atol=1e-15)
    fields = np.array([xyz(one.magnetic_field) for _, one in found["/imu/mag", "sensor_msgs/msg/MagneticField"]])
    np.testing.assert_allclose(fields, (imu.mag * FLU)[np.isfinite(imu.mag[:, 0])] * 1e-6, rtol=1e-15)  # tesla
    heat = [one.temperature for _, one in found["/imu/temperature", "sensor_msgs/msg/Temperature"]]
    assert heat == imu.temp_c[::10].tolist()


def test_the_library_of_mcap_reads_the_schemas(recording, tmp_path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    plumbob.convert(recording, tmp_path / "a.mcap", layout="ros2")
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        rows = [one for _, channel, _, one in reader.iter_decoded_messages() if channel.topic == "/imu/data"]
    forces = np.array([xyz(one.linear_acceleration) for one in rows])
    assert np.array_equal(forces, recording.imu.acc * FLU, equal_nan=True)


@pytest.mark.parametrize("name", LAYOUTS)
def test_there_and_back_is_the_same_to_the_bit(recording, tmp_path, name):
    plumbob.convert(recording, tmp_path / name, layout=LAYOUTS[name])
    back, imu = plumbob.read(tmp_path / name), recording.imu
    assert np.array_equal(back.imu.t_ns + back.imu.meta.t0_ns, imu.t_ns + T0)  # a bag's time begins with its first row
    assert back.imu.meta.frame is Frame.ENU
    for key in ("gyr", "acc"):  # signs alone change, so that nothing is lost
        assert np.array_equal(getattr(back.imu, key) * FLU, getattr(imu, key), equal_nan=True), key
    assert np.array_equal(back.imu.temp_c, imu.temp_c, equal_nan=True)
    assert back.imu.meta.device == "board 7"
    np.testing.assert_allclose(back.imu.mag * FLU, imu.mag, rtol=3e-16)  # µT to T and back: the last bit at most
    again = tmp_path / f"again{name}"
    plumbob.convert(back, again, layout=LAYOUTS[name])
    assert np.array_equal(plumbob.read(again).track.q_nb, back.track.q_nb, equal_nan=True)
    assert np.array_equal(plumbob.read(again).imu.gyr, back.imu.gyr, equal_nan=True)  # it is turned once


def test_axes_that_nothing_tells_stay_and_attitudes_or_samples_may_be_alone(recording, tmp_path):
    notes = []
    bare = recording.imu.corrected(meta=plumbob.ImuMeta(t0_ns=T0))
    plumbob.convert(plumbob.Recording(imu=bare, name="a"), tmp_path / "a.bag", note=notes.append)
    assert np.array_equal(plumbob.read(tmp_path / "a.bag").imu.acc, bare.acc, equal_nan=True)
    assert any("body axes stay as they are: nothing says" in note for note in notes)
    plumbob.convert(recording, tmp_path / "c.bag", what="attitude")
    found = messages(tmp_path / "c.bag")["/imu/data", "sensor_msgs/msg/Imu"]
    assert all(one.linear_acceleration_covariance[0] == -1.0 for _, one in found)
    back = plumbob.read(tmp_path / "c.bag")
    assert back.imu is None and int(back.track.known.sum()) == ROWS - 1
    plumbob.convert(recording, tmp_path / "b.bag", what="samples")
    assert ("/imu/data_raw", "sensor_msgs/msg/Imu") in messages(tmp_path / "b.bag")
    assert plumbob.read(tmp_path / "b.bag").track is None


def test_several_units(recording, tmp_path):
    from plumbob.data.array import ImuArray, UnitMount

    one = recording.imu
    other = plumbob.ImuData(t=one.t, gyr=one.gyr * 2.0, acc=one.acc, mag=one.mag + 1.0, meta=one.meta)
    array = ImuArray({"u1": one, "2nd": other}, {"2nd": UnitMount((0.0, 1.0, 0.0, 0.0), (0.1, 0.2, 0.3))})
    plumbob.convert(plumbob.Recording(array=array, name="a"), tmp_path / "a.bag")
    back = plumbob.read(tmp_path / "a.bag").array
    assert back.names == ("/u1/imu/data_raw", "/u2nd/imu/data_raw")
    assert np.array_equal(back.units["/u2nd/imu/data_raw"].gyr, other.gyr, equal_nan=True)
    np.testing.assert_allclose(back.units["/u2nd/imu/data_raw"].mag, other.mag, rtol=3e-16)
    plumbob.convert(plumbob.Recording(array=array, name="a"), tmp_path / "e", layout="euroc")
    sensor = (tmp_path / "e" / "mav0" / "imu1" / "sensor.yaml").read_text()
    assert "data: [1.0, 0.0, 0.0, 0.1, 0.0, -1.0, 0.0, 0.2, 0.0, 0.0, -1.0, 0.3, 0.0, 0.0, 0.0, 1.0]" in sensor


def test_euroc_holds_every_bit_and_the_rate(recording, tmp_path):
    """Columns as the data set's own files have them; read by NumPy."""
    notes = []
    plumbob.convert(recording, tmp_path / "a", layout="euroc", note=notes.append)
    lines = (tmp_path / "a/mav0/imu0/data.csv").read_text().splitlines()
    assert lines[0].startswith("#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y") and lines[0].endswith(
        "a_RS_S_z [m s^-2]"
    )
    imu, kept = recording.imu, np.delete(np.arange(ROWS), [7, 9])
    assert [int(line.partition(",")[0]) for line in lines[1:]] == (imu.t_ns + T0)[kept].tolist()
    table = np.loadtxt(tmp_path / "a/mav0/imu0/data.csv", delimiter=",")
    assert np.array_equal(table[:, 1:4], imu.gyr[kept]) and np.array_equal(table[:, 4:], imu.acc[kept])
    state = np.loadtxt(tmp_path / "a/mav0/state_groundtruth_estimate0/data.csv", delimiter=",")
    assert state.shape == (ROWS - 1, 17) and not state[:, 1:4].any()
    down = dcm_from_quat(recording.track.q_nb[recording.track.known])
    np.testing.assert_allclose(dcm_from_quat(state[:, 4:8]), down[:, [1, 0, 2], :] * [[1.0], [1.0], [-1.0]], atol=1e-12)
    assert any("EuRoC has no place for mag, temp_c, device" in note for note in notes)
    assert any("2 samples without" in note for note in notes)
    with pytest.raises(ShapeError, match="samples of an IMU, and there are none"):
        plumbob.convert(recording, tmp_path / "b", layout="euroc", what="attitude")
    meta = plumbob.ImuMeta(t0_ns=T0, rate_nominal=2000.0 / 7.0)
    fast = plumbob.Recording(imu=recording.imu.corrected(meta=meta))
    plumbob.convert(fast, tmp_path / "fast", layout="euroc")
    assert plumbob.read(tmp_path / "fast").imu.meta.rate_nominal == 2000.0 / 7.0


def contents(folder):
    return {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_nothing_is_replaced_without_force(recording, tmp_path):
    out, strange = tmp_path / "a", tmp_path / "a" / "thesis.tex"
    plumbob.convert(recording, out, layout="rosbag2")
    before = contents(out)
    for given, layout, overwrite, words in (
        (recording, "rosbag2", False, "exists already"),
        (recording, "euroc", True, "folder of something else"),
        (out, "rosbag2", True, "is or holds the input"),
        (out / "a.mcap", "rosbag2", True, "is or holds the input"),
    ):
        with pytest.raises(ParameterError, match=words):
            plumbob.convert(given, out, layout=layout, overwrite=overwrite)
    strange.write_text("years of work")
    with pytest.raises(ParameterError, match="folder of something else"):
        plumbob.convert(recording, out, layout="rosbag2", overwrite=True)
    strange.unlink()
    assert contents(out) == before
    (tmp_path / ".a.plumbob-0123abcd.tmp" / "a").mkdir(parents=True)  # what a killed process left is removed
    plumbob.convert(recording, out, layout="rosbag2", what="samples", overwrite=True)
    assert plumbob.read(out).track is None
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize("layout", ["rosbag2", "euroc"])
def test_a_full_disk_leaves_what_was_there(recording, tmp_path, layout, monkeypatch):
    plumbob.convert(recording, tmp_path / "a", layout=layout)
    before = contents(tmp_path)

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(core_files.os, "fsync", full)
    for name, words in (("a", r"written: No space left on device\. Nothing was changed there"), ("b", "No space left")):
        with pytest.raises(DecodeError, match=words):
            plumbob.convert(recording, tmp_path / name, layout=layout, overwrite=True)
    assert list(tmp_path.iterdir()) == [tmp_path / "a"]
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("name", "writes"), [("a.bag", "rosbags.rosbag1.Writer.write"), ("a.mcap", "mcap.writer.Writer.add_message")]
)
def test_a_failure_leaves_no_file(recording, tmp_path, name, writes, monkeypatch):
    def fail(*given):
        raise ValueError("midway")

    monkeypatch.setattr(writes, fail)
    with pytest.raises(ValueError, match="midway"):
        plumbob.convert(recording, tmp_path / name, layout=LAYOUTS[name])
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written(recording, tmp_path, monkeypatch):
    later = plumbob.AttitudeTrack(t=recording.track.t + 1.0, q_nb=recording.track.q_nb, frame="NED", north="true")
    beyond = recording.imu.corrected(meta=plumbob.ImuMeta(t0_ns=(1 << 31) * 10**9))
    for given, name, layout, error, words in (
        (recording, "a.bin", None, ParameterError, r"convert writes .*\.bag.*; and folders with --as rosbag2 or --as"),
        (recording, "a", None, ParameterError, "folders with --as"),
        (recording, "a.bag", "ros2", ParameterError, r"the layout ros2 is a file whose name ends in \.mcap"),
        (recording, "a.mcap", "rosbag2", ParameterError, "the layout rosbag2 is a folder"),
        (recording, "a.mcap", "ros3", ParameterError, "there is no layout 'ros3'"),
        (plumbob.Recording(imu=recording.imu, track=later), "a.bag", None, ShapeError, "different times; convert one"),
        (plumbob.Recording(imu=beyond), "a.bag", None, ClockError, "after 2038"),
        (None, "a.bag", None, MissingExtraError, r"pip install \"plumbob\[ros\]\""),
    ):
        if given is None:
            monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
        with pytest.raises(error, match=words):
            plumbob.convert(given or recording, tmp_path / name, layout=layout)
    assert list(tmp_path.iterdir()) == []


def test_the_verb_and_a_noise_analysis_takes_a_folder(recording, tmp_path):
    plumbob.write(tmp_path / "sea.parquet", recording)
    done = ok("convert", "sea.parquet", "a", "--as", "rosbag2", cwd=tmp_path)
    assert f"{ROWS} samples, {ROWS} attitudes" in done.stdout
    assert "no place for what headings count from" in done.stderr
    ok("convert", "a", "b.csv", "--what", "samples", cwd=tmp_path)
    ok("convert", "sea.parquet", "c.bag", cwd=tmp_path)
    assert np.array_equal(plumbob.read(tmp_path / "c.bag").imu.acc * FLU, recording.imu.acc, equal_nan=True)
    rng = np.random.default_rng(2)
    acc = np.array([0.0, 0.0, 9.8]) + 0.01 * rng.normal(size=(2000, 3))
    imu = plumbob.ImuData(t=np.arange(2000) / 100, gyr=0.001 * rng.normal(size=(2000, 3)), acc=acc)
    plumbob.convert(plumbob.Recording(imu=imu), tmp_path / "rest", layout="rosbag2")
    assert len(load_static(tmp_path / "rest").groups) > 0
