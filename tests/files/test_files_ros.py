"""Bags of ROS, written by rosbags and by mcap-ros2-support, and real ones; damaged and hostile ones."""

import bz2
import contextlib
import os
import sqlite3
import struct
import sys

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType

import plumbob
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, UnitError
from plumbob.core.files import MAX_TEXT
from plumbob.files.foreign import ros
from plumbob.rotations import Frame, North, dcm_from_quat
from tests.helpers.io_samples import put, refused
from tests.helpers.real_data import DATA, needs
from tests.helpers.record_samples import flipped

rosbags = pytest.importorskip("rosbags")
from tests.helpers import ros_bags as made  # noqa: E402 - it needs rosbags

REAL = DATA / "formats"
real = needs("formats/ros1_example.bag")


def check_common(found, given):
    """What `ros_bags.all_rows` holds: rates and forces to the bit; the slow ones at their own stamps alone."""
    imu = found.imu
    assert np.array_equal(imu.gyr, given["gyr"]) and np.array_equal(imu.acc, given["acc"])
    assert np.array_equal(imu.t_ns, np.arange(made.ROWS) * made.STEP)
    assert imu.meta.t0_ns == made.T0  # the header's stamp, not the recorder's 5 ms later
    np.testing.assert_allclose(imu.mag[::4], given["mag"][::4] * 1e6, rtol=1e-15)  # 1 T is 1e6 µT
    assert np.isnan(np.delete(imu.mag, np.s_[::4], axis=0)).all()
    assert np.array_equal(imu.temp_c[::10], given["temp_c"][::10])
    assert (imu.meta.device, imu.meta.frame) == ("imu_link", Frame.ENU)
    assert (found.track.frame, found.track.north) == (Frame.ENU, North.FREE)
    np.testing.assert_allclose(found.track.q_nb, given["xyzw"][:, [3, 0, 1, 2]], rtol=0, atol=1e-15)
    assert any("left out: /chatter (std_msgs/String, 1)" in str(note) for note in found.notes)


@pytest.mark.parametrize("container", made.CONTAINERS)
def test_every_container_gives_the_same_samples(container, tmp_path):
    given = made.samples()
    path = made.CONTAINERS[container](tmp_path, made.all_rows(given))
    check_common(plumbob.read(path), given)


def test_mcap_by_the_library_of_mcap(tmp_path):
    """mcap-ros2-support serialises by the schema's text; its file has the profile ros2."""
    from mcap_ros2.writer import Writer

    given = made.samples()
    with (tmp_path / "a.mcap").open("wb") as file:
        writer, schemas = Writer(file), {}
        for row in made.all_rows(given):
            if row.kind not in schemas:
                schemas[row.kind] = writer.register_msgdef(
                    row.kind, made.ROS2.generate_msgdef(row.kind, ros_version=2)[0]
                )
            fields = dict(row.fields)
            if "header" in fields:
                sec, nanosec = divmod(fields["header"]["stamp"], 10**9)
                fields["header"] = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": fields["header"]["frame_id"]}
            for name in ("orientation", "angular_velocity", "linear_acceleration", "magnetic_field"):
                if name in fields:
                    fields[name] = dict(zip("xyzw", map(float, fields[name]), strict=False))
            fields = {name: one.tolist() if isinstance(one, np.ndarray) else one for name, one in fields.items()}
            writer.write_message(row.topic, schemas[row.kind], fields, row.log_ns)
        writer.finish()
    check_common(plumbob.read(tmp_path / "a.mcap"), given)


@pytest.mark.parametrize("gone", [-1.0, np.nan])
def test_absent_by_the_covariance(gone, tmp_path):
    """The first number of a covariance is -1 (Imu.msg) or NaN (REP 145) where a quantity is not there."""
    given = made.samples()
    found = plumbob.read(made.write_1(tmp_path / "a.bag", made.imu_rows(given, covs=(gone, 0.0, gone))))
    assert found.track is None and found.imu.acc is None
    assert np.array_equal(found.imu.gyr, given["gyr"])
    assert "/imu/data: no acc: absent by its covariance, or exactly zero in every message" in map(str, found.notes)


def test_a_frame_of_ned_and_an_orientation_that_was_never_set(tmp_path):
    """REP 145: imu_link_ned is the frame of an IMU whose world is north, east, down."""
    found = plumbob.read(made.write_1(tmp_path / "a.bag", made.imu_rows(made.samples(), frame="imu_link_ned")))
    assert (found.track.frame, found.imu.meta.frame) == (Frame.NED, Frame.NED)
    given = made.samples() | {"xyzw": np.tile([0.0, 0.0, 0.0, 1.0], (made.ROWS, 1))}  # the default in ROS 2
    found = plumbob.read(made.write_2(tmp_path / "a", made.imu_rows(given, covs=(0.0, 0.0, 0.0))))
    assert found.track is None and any("every message has the default" in str(note) for note in found.notes)


@pytest.mark.parametrize("norm", [0.0, 0.9])
def test_an_orientation_that_is_no_rotation_is_left_out_and_the_rest_is_read(norm, tmp_path):
    given = made.samples()
    given["xyzw"] *= norm
    found = plumbob.read(made.write_1(tmp_path / "a.bag", made.imu_rows(given)))
    assert found.track is None and np.array_equal(found.imu.gyr, given["gyr"])
    told = "/imu/data: 150 quaternions not of norm 1 (median 0.9), taken as unknown"
    unset = "/imu/data: its orientation is left out: every message has the default one"
    assert (told if norm else unset) in map(str, found.notes)
    alone = made.imu_rows(given | {"gyr": 0.0 * given["gyr"], "acc": 0.0 * given["acc"]})
    with pytest.raises(DecodeError, match="neither rates, accelerations nor orientations of norm 1"):
        plumbob.read(made.write_1(tmp_path / "b.bag", alone))


def test_covariance_of_the_orientation_turns_into_body_axes(tmp_path):
    given = made.samples()
    found = plumbob.read(made.write_1(tmp_path / "a.bag", made.imu_rows(given)))
    c_nb = dcm_from_quat(found.track.q_nb)
    told = np.einsum("nij,njk,nlk->nil", c_nb, found.track.cov_b, c_nb)  # C P Cᵀ: back about the world's axes
    np.testing.assert_allclose(told, np.broadcast_to(np.diag([0.01, 0.02, 0.03]), told.shape), atol=1e-15)


@pytest.mark.parametrize(
    ("how", "start", "why"),
    [
        ({"stamped": False}, made.T0 + made.LATE, "no stamp is set"),  # the recorder's time counts
        ({"t0": 0}, 0, "UTC is not known"),  # stamps of a simulation
    ],
)
def test_time_without_stamps_or_of_a_simulation(tmp_path, how, start, why):
    found = plumbob.read(made.write_2(tmp_path / "a", made.imu_rows(made.samples(), **how)))
    assert (found.imu.meta.t0_ns, found.imu.t[0], len(found.imu)) == (start, 0.0, made.ROWS)
    assert any(why in str(note) for note in found.notes)


class TestSeveral:
    def test_on_the_same_stamps_they_are_an_array(self, tmp_path):
        a, b = made.samples(1), made.samples(2)
        rows = [*made.imu_rows(a, "/left", "l"), *made.imu_rows(b, "/right", "r"), *made.mag_rows(b, "/m", "r")]
        path = made.write_1(tmp_path / "a.bag", sorted(rows, key=lambda row: row.log_ns))
        found = plumbob.read(path)
        assert found.array.names == ("/left", "/right")
        assert np.array_equal(found.array.units["/right"].gyr, b["gyr"])
        assert found.array.units["/left"].mag is None  # it is in the other's frame
        np.testing.assert_allclose(found.array.units["/right"].mag, b["mag"] * 1e6, rtol=1e-15)
        one = plumbob.read(path, unit="right")
        assert np.array_equal(one.imu.gyr, b["gyr"]) and one.track is not None

    def test_on_their_own_stamps_one_is_chosen(self, tmp_path):
        a, b = made.samples(1), made.samples(2)
        rows = [*made.imu_rows(a, "/left"), *made.imu_rows(b, "/right", t0=made.T0 + 1)]
        path = made.write_2(tmp_path / "a", sorted(rows, key=lambda row: row.log_ns))
        with pytest.raises(ParameterError, match=r"/left \(sensor_msgs/Imu, 150\), /right .* --unit /left"):
            plumbob.read(path)
        for unit in ("/right", "right", "2"):
            found = plumbob.read(path, unit=unit)
            assert np.array_equal(found.imu.gyr, b["gyr"]) and found.imu.meta.t0_ns == made.T0 + 1

    def test_data_and_data_raw_are_one(self, tmp_path):
        """imu_tools: data is data_raw with an orientation."""
        a, b = made.samples(1), made.samples(2)
        rows = [*made.imu_rows(a, "/imu/data_raw"), *made.imu_rows(b, "/imu/data")]
        path = made.write_2(tmp_path / "a", sorted(rows, key=lambda row: row.log_ns))
        assert np.array_equal(plumbob.read(path).imu.gyr, b["gyr"])
        assert np.array_equal(plumbob.read(path, unit="/imu/data_raw").imu.gyr, a["gyr"])


@pytest.mark.parametrize(("factor", "frame", "why"), [(1.0, "mast", "/imu/mag"), (1e6, "imu_link", "unlikely to be")])
def test_a_magnetometer_in_another_frame_or_in_microtesla_is_left_out(tmp_path, factor, frame, why):
    given = made.samples()
    field = made.mag_rows(given | {"mag": given["mag"] * factor}, frame=frame)
    rows = sorted([*made.imu_rows(given), *field], key=lambda row: row.log_ns)
    found = plumbob.read(made.write_1(tmp_path / "a.bag", rows))
    assert found.imu.mag is None and any(why in str(note) for note in found.notes)


class TestPoses:
    CASES = {  # noqa: RUF012 - what a type's fields are, https://github.com/ros2/common_interfaces
        "geometry_msgs/msg/PoseStamped": lambda p, q: {
            "pose": ("geometry_msgs/msg/Pose", {"position": p, "orientation": q})
        },
        "geometry_msgs/msg/PoseWithCovarianceStamped": lambda p, q: {"pose": TestPoses.with_cov(p, q)},
        "geometry_msgs/msg/QuaternionStamped": lambda p, q: {"quaternion": q},
        "geometry_msgs/msg/TransformStamped": lambda p, q: {
            "child_frame_id": "rigid_body",
            "transform": ("geometry_msgs/msg/Transform", {"translation": p, "rotation": q}),
        },
        "nav_msgs/msg/Odometry": lambda p, q: {
            "child_frame_id": "base_link",
            "pose": TestPoses.with_cov(p, q),
            "twist": (
                "geometry_msgs/msg/TwistWithCovariance",
                {
                    "twist": ("geometry_msgs/msg/Twist", {"linear": TestPoses.still(), "angular": TestPoses.still()}),
                    "covariance": np.zeros(36),
                },
            ),
        },
    }

    @staticmethod
    def still():
        return ("geometry_msgs/msg/Vector3", {"x": 0.5, "y": 0.25, "z": 0.125})

    @staticmethod
    def with_cov(p, q):
        pose = ("geometry_msgs/msg/Pose", {"position": p, "orientation": q})
        return ("geometry_msgs/msg/PoseWithCovariance", {"pose": pose, "covariance": np.arange(36.0)})

    @classmethod
    def rows(cls, kind, given, topic="/pose", shift=0):
        for i, xyzw in enumerate(given["xyzw"]):
            stamp = made.T0 + i * made.STEP + shift
            fields = {"header": made.header(stamp, "map"), **cls.CASES[kind](given["gyr"][i], xyzw)}
            yield made.Row(stamp + made.LATE, topic, kind, fields)

    @pytest.mark.parametrize("kind", CASES)
    @pytest.mark.parametrize("write", [made.write_1, made.write_2])
    def test_every_type(self, kind, write, tmp_path):
        given = made.samples()
        found = plumbob.read(write(tmp_path / ("a.bag" if write is made.write_1 else "a"), self.rows(kind, given)))
        assert found.imu is None and (found.track.frame, found.track.north) == (Frame.ENU, North.FREE)
        np.testing.assert_allclose(found.track.q_nb, given["xyzw"][:, [3, 0, 1, 2]], rtol=0, atol=1e-15)
        assert "it holds no inertial data (sensor_msgs/Imu); a pose is read as an attitude" in map(str, found.notes)

    def test_beside_an_imu_it_is_read_when_asked_for_and_shares_its_time(self, tmp_path):
        given = made.samples()
        rows = [*made.imu_rows(given), *self.rows("geometry_msgs/msg/PoseStamped", given, shift=3_000_000)]
        path = made.write_2(tmp_path / "a", sorted(rows, key=lambda row: row.log_ns))
        assert any("left out: /pose" in str(note) for note in plumbob.read(path).notes)
        pose = plumbob.read(path, unit="/pose")
        np.testing.assert_allclose(pose.track.t, np.arange(made.ROWS) * 0.01 + 0.003, atol=1e-9)


class TestReal:
    @real
    def test_poses_of_ros_1(self):
        path = REAL / "ros1_example.bag"
        with pytest.raises(ParameterError, match=r"groundtruth \(geometry_msgs/PoseStamped, 12765\), ORB-SLAM .*8362"):
            plumbob.read(path)
        self.compare(path, "groundtruth", 12765)

    @real
    def test_odometry_of_ros_2(self):
        path = REAL / "ros2_turtlebot.mcap"
        with pytest.raises(ParameterError, match=r"no inertial data .*/odom \(nav_msgs/Odometry, 2639\), /amcl_pose"):
            plumbob.read(path)
        self.compare(path, "/amcl_pose", 135)
        assert any("/tf (tf2_msgs/TFMessage, 5422)" in str(note) for note in plumbob.read(path, unit="/odom").notes)

    @staticmethod
    def compare(path, topic, count):
        """Quaternions and stamps are those that rosbags reads."""
        from rosbags.highlevel import AnyReader

        stamps, xyzw = [], []
        with AnyReader([path]) as bag:
            chosen = [one for one in bag.connections if one.topic == topic]
            for connection, _, raw in bag.messages(chosen):
                found = bag.deserialize(raw, connection.msgtype)
                pose = getattr(found.pose, "pose", found.pose)
                stamps.append(found.header.stamp.sec * 10**9 + found.header.stamp.nanosec)
                xyzw.append([pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w])
        track = plumbob.read(path, unit=topic).track
        assert len(stamps) == count
        kept = np.flatnonzero(np.diff(np.maximum.accumulate(stamps), prepend=-1) > 0)
        np.testing.assert_allclose(np.diff(track.t), np.diff(np.array(stamps)[kept]) / 1e9, atol=2e-9)
        np.testing.assert_allclose(track.q_nb, np.array(xyzw)[kept][:, [3, 0, 1, 2]], atol=1e-8)


class TestOwn:
    """A recording of ours is never taken for another program's."""

    def test_accepts(self, tmp_path):
        imu = plumbob.ImuData(t=np.arange(20) / 100, gyr=np.zeros((20, 3)), acc=np.tile([0, 0, 9.8], (20, 1)))
        path = tmp_path / "a.mcap"
        plumbob.convert(plumbob.Recording(imu=imu), path)
        assert not ros.accepts(path)
        whole = path.read_bytes()
        for at in range(0, 60):
            assert not ros.accepts(put(path, flipped(whole, at, 0x41)))
        assert not ros.accepts(put(path, whole[: len(whole) // 2]))


@pytest.mark.parametrize("container", ["bag", "bag, bz2", "bag, lz4", "db3", "mcap", "folder, mcap"])
def test_cut_anywhere_gives_what_comes_before_or_an_error(container, tmp_path):
    given = made.samples()
    path = made.CONTAINERS[container](tmp_path, made.all_rows(given))
    file = path / "a.mcap" if path.is_dir() else path
    whole = file.read_bytes()
    for size in np.linspace(1, len(whole) - 1, 25).astype(int):
        file.write_bytes(whole[:size])
        try:
            found = plumbob.read(path)
        except PlumbobError as error:
            assert "\n" not in str(error)
        else:
            assert np.array_equal(found.imu.gyr, given["gyr"][: len(found.imu)])
            # behind the messages lie an index or a summary, which nothing is lost with
            complete = found.imu.temp_c is not None and np.isfinite(found.imu.temp_c[-10])
            cut = any(str(note).startswith("cut: ") for note in found.notes)
            assert cut or (complete and len(found.imu) == made.ROWS)


def test_files_that_were_never_closed(tmp_path):
    """Without an index, as a recorder that lost its power leaves one; rosbags itself refuses it."""
    given = made.samples()
    path = made.write_1(tmp_path / "a.bag", made.all_rows(given))
    whole = bytearray(path.read_bytes())
    at = whole.index(b"index_pos=") + 10
    (index,) = struct.unpack_from("<Q", whole, at)
    whole[at : at + 8] = bytes(8)
    check_common(plumbob.read(put(path, whole[:index])), given)
    path = made.write_2(tmp_path / "a", made.all_rows()) / "a.db3"
    path.with_name("a.db3-wal").write_bytes(b"x")
    found = plumbob.read(path)
    assert len(found.imu) == made.ROWS
    assert any(str(note).startswith("cut: the recorder did not close it") for note in found.notes)


def wrong_checksum(folder):
    """One bit of a rate in a chunk that is not compressed, so that nothing else shows it."""
    given = made.samples()
    path = made.write_mcap(folder / "a.mcap", made.imu_rows(given), "ros2", 2, compression=CompressionType.NONE)
    whole = bytearray(path.read_bytes())
    whole[whole.index(struct.pack("<d", given["gyr"][5, 1]))] ^= 1
    path.write_bytes(whole)
    return path


def missing_part(folder):
    path = made.write_2(folder / "a", made.all_rows())
    (path / "a.db3").rename(path / "b.db3")
    return path


def endless_metadata(folder):
    path = made.write_2(folder / "a", made.all_rows())
    os.truncate(path / "metadata.yaml", MAX_TEXT + 1)
    return path


def part_elsewhere(folder):
    path = made.write_2(folder / "a", made.all_rows())
    (path / "a.db3").unlink()
    (path / "a.db3").symlink_to("/dev/zero")
    return path


def chunk(how, pack, size, beyond=0):
    """Maker of an MCAP of one chunk that says it unpacks to `size` bytes, and has so many `beyond` what it has."""

    def put(folder):
        stored, name = pack(), how.encode()
        body = struct.pack("<QQQII", 0, 0, size, 0, len(name)) + name + struct.pack("<Q", len(stored) + beyond)
        body += stored
        head = struct.pack("<I", 4) + b"ros2" + struct.pack("<I", 1) + b"x"
        records = struct.pack("<BQ", 1, len(head)) + head + struct.pack("<BQ", 6, len(body)) + body
        (folder / "a.mcap").write_bytes(b"\x89MCAP0\r\n" + records)
        return folder / "a.mcap"

    return put


def zstd_file(folder):
    path = made.write_2(folder / "a", made.all_rows(), mode="FILE")
    (path / "a.db3.zstd").write_bytes(zstandard.ZstdCompressor().compress(bytes(80 << 20)))
    return path


def bz2_bomb(folder):
    """A chunk of ROS 1 whose bz2 holds more than its size says."""
    path = made.write_1(folder / "a.bag", made.all_rows(), "BZ2")
    whole, stored = path.read_bytes(), bz2.compress(bytes(10 << 20))
    path.write_bytes(whole[: whole.index(b"BZh") - 4] + struct.pack("<I", len(stored)) + stored)
    return path


def changed(*commands, rows=()):
    """Maker of a file of SQLite in which commands were run, with messages or with nothing before."""

    def put(folder):
        if rows:
            made.write_2(folder / "a", rows)
        path = folder / "a" / "a.db3" if rows else folder / "a.db3"
        with contextlib.closing(sqlite3.connect(path)) as tables:
            for command in commands:
                tables.execute(command)
            tables.commit()
        return path

    return put


def pipe(folder):
    os.mkfifo(folder / "p.bag")
    return folder / "p.bag"


TOPICS = "CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT)"
ENDLESS = (  # a view may be a query that never ends
    "CREATE VIEW messages AS WITH RECURSIVE n(topic_id, timestamp, data) AS "
    "(SELECT 1, 1, x'00' UNION ALL SELECT 1, timestamp + 1, x'00' FROM n) SELECT * FROM n"
)
SHORTER = "UPDATE messages SET data = substr(data, 1, 200) WHERE id = 20"
CHATTER = [made.Row(made.T0, "/chatter", "std_msgs/msg/String", {"data": "hello"})]
NO_IMU = r"it holds /chatter \(std_msgs/String, 1\), but neither inertial data"
UNSIZED = zstandard.ZstdCompressor(write_content_size=False)
IN_G = made.samples() | {"acc": made.samples()["acc"] / 9.80665}
TURN = {"header": made.header(made.T0, "world"), "quaternion": np.ones(4)}
NO_TURN = [made.Row(made.T0, "/turn", "geometry_msgs/msg/QuaternionStamped", TURN)]
REFUSED = {
    "no rotation": (lambda folder: made.write_1(folder / "a.bag", NO_TURN), "/turn holds no quaternion of norm 1"),
    "g": (lambda folder: made.write_1(folder / "a.bag", made.imu_rows(IN_G)), "looks like g"),
    "no inertial data, ROS 1": (lambda folder: made.write_1(folder / "a.bag", CHATTER), NO_IMU),
    "no inertial data, ROS 2": (lambda folder: made.write_2(folder / "a", CHATTER), NO_IMU),
    "nothing": (lambda folder: made.write_2(folder / "a", []), "holds no message"),
    "checksum": (wrong_checksum, "crc validation failed in Chunk"),
    "missing part": (missing_part, r"names a\.db3, which is not there"),
    "endless metadata": (endless_metadata, f"needs a metadata.yaml of at most {MAX_TEXT} bytes"),
    "a link for a part": (part_elsewhere, "is not there"),
    "terabytes of zstd": (chunk("zstd", lambda: b"\x28\xb5\x2f\xfd", 1 << 40), "unpack to 1099511627776"),
    "too much, zstd": (chunk("zstd", lambda: UNSIZED.compress(bytes(80 << 20)), 1000), "does not inflate to the 1000 "),
    "more than a file has": (chunk("zstd", bytes, 1, 1 << 63), "damaged .*index-sized"),
    "more than stated, lz4": (chunk("lz4", lambda: lz4.frame.compress(bytes(80 << 20)), 1000), "does not inflate to"),
    "more than stated, bz2": (bz2_bomb, "does not inflate to"),
    "more than allowed": (zstd_file, "are allowed"),
    "a view for a table": (changed(TOPICS, ENDLESS), "without the tables"),
    "a message shorter than its type": (
        changed(SHORTER, rows=[*made.imu_rows(made.samples())]),
        r"/imu/data: a message has 196 bytes, but one of sensor_msgs/Imu",
    ),
    "a pipe": (pipe, "not a regular file"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_bag_of_an_imu_or_hostile_is_refused(tmp_path, case):
    put, match = REFUSED[case]
    path = put(tmp_path)
    refused(plumbob.read, path, match=match, error=UnitError if case == "g" else DecodeError)


def test_it_is_read_without_rosbags(tmp_path, monkeypatch):
    """Reading needs no package beyond those that recordings of Plumbob need."""
    path = made.write_2(tmp_path / "a", made.all_rows())
    for name in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.setitem(sys.modules, name, None)
    assert len(plumbob.read(path).imu) == made.ROWS


def test_one_imu_whose_sensors_have_topics_of_their_own_is_one_recording(tmp_path):
    """As depth cameras record it: what a topic does not measure is zero, and clocks differ."""
    given = made.samples(rows=200)
    gyr = made.imu_rows(given | {"acc": np.zeros((200, 3))}, "/camera/gyro/sample", "imu", covs=(-1.0, 0.0, 0.0))
    late = given | {"gyr": np.zeros((200, 3)), "t_ns": made.STEP // 4 + made.STEP * np.arange(200)}
    acc = made.imu_rows(late, "/camera/accel/sample", "imu", covs=(-1.0, 0.0, 0.0))
    made.write_1(path := tmp_path / "a.bag", sorted([*gyr, *acc], key=lambda row: row.log_ns))
    recording = plumbob.read(path)
    assert recording.array is None
    np.testing.assert_array_equal(recording.imu.gyr, given["gyr"][1:])  # the first rate is before the first force
    np.testing.assert_allclose(recording.imu.acc, 0.25 * given["acc"][:-1] + 0.75 * given["acc"][1:], atol=1e-9)
    assert any("are one IMU, whose sensors have topics of their own" in str(note) for note in recording.notes)
    assert "gyr" not in plumbob.read(path, unit="/camera/accel/sample").imu.triads
