"""Which reader claims which file: one, or none; a table that none claims needs a profile."""

import pytest
from scipy.io import savemat

import plumbob
from plumbob.files import FORMATS, formats
from plumbob.files.draft import known_profile
from tests.helpers import file_kinds as kinds
from tests.helpers import log_samples
from tests.helpers.real_data import DATA, needs

ros_bags = pytest.importorskip("tests.helpers.ros_bags")
M = kinds.real_motion(80)
ROS = {
    name: lambda folder, write=write: write(folder, kinds.ros_rows(M)) for name, write in ros_bags.CONTAINERS.items()
}


def file(name, content):
    """Maker of a file, in a folder of its own."""

    def put(folder):
        made = content() if callable(content) else content
        (folder / name).write_bytes(made if isinstance(made, bytes) else made.encode())
        return folder / name

    return put


def rostopic():
    names = "%time,field.header.stamp,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z"
    return "\n".join(
        [names, *(f"{t + kinds.T0},{t + kinds.T0},{kinds._csv(gyr)}" for t, gyr in zip(M.t_ns, M.gyr, strict=True)), ""]
    )


CLAIMS = {
    **{f"ROS, {name}": (maker, "ROS") for name, maker in ROS.items()},
    "PX4": (file("a.ulg", lambda: kinds.px4_of(M)), "ULog"),
    "DataFlash, bytes": (file("a.bin", log_samples.dataflash), "DataFlash"),
    "DataFlash, text": (file("a.log", lambda: kinds.dataflash_text_of(M)), "DataFlash"),
    "MAVLink": (file("a.tlog", lambda: kinds.tlog_of(M)), "DataFlash"),
    "EuRoC": (lambda folder: kinds.asl(folder / "a"), "EuRoC"),
    "EuRoC, table": (lambda folder: kinds.asl(folder / "a") / "mav0" / "imu0" / "data.csv", "EuRoC"),
    "KITTI": (lambda folder: kinds.drive(folder / "a"), "KITTI"),
    "RepoIMU": (file("a.csv", lambda: kinds.repoimu_of(M)), "RepoIMU"),
    "phyphox": (lambda folder: kinds.zipped(folder / "a.zip", kinds.phyphox_of(M)), "phone"),
    "phyphox, folder": (lambda folder: kinds.foldered(folder / "a", kinds.phyphox_of(M)), "phone"),
    "phyphox, table": (file("Gyroscope.csv", kinds.phyphox_table("Gyroscope ", "rad/s", M.gyr)), "phone"),
    "Sensor Logger": (lambda folder: kinds.foldered(folder / "a", kinds.sensor_logger_of(M)), "phone"),
    "SensorLog": (file("a.csv", lambda: kinds.sensorlog_of(M)), "phone"),
    "MT Manager": (lambda folder: kinds.xsens_of(folder / "a.txt", M), "Xsens"),
    "MT Manager, commas": (lambda folder: kinds.xsens_of(folder / "a.csv", M), "Xsens"),
    "MTB": (file("a.mtb", lambda: kinds.mtb_of(M)), "Xsens"),
    "x-IMU3": (file("a.ximu3", lambda: kinds.ximu3_of(M)), "x-IMU3"),
    "x-IMU3, folder": (lambda folder: kinds.ximu3_folder(folder / "a", M), "x-IMU3"),
    "x-IMU3, table": (lambda folder: kinds.ximu3_folder(folder / "a", M) / "Inertial.csv", "x-IMU3"),
    "rostopic echo -p": (file("a.csv", rostopic), "rostopic echo -p"),
    "text": (file("a.csv", lambda: kinds.text_of(M)[0]), None),
    "voltage": (file("a.csv", "Time (s),Voltage (V)\n1,2\n2,3\n3,4\n"), None),
    "two axes": (file("a.csv", "Time (s),X (m/s^2),Y (m/s^2)\n1,2,3\n2,3,4\n3,4,5\n"), None),
    "letters": (file("a.csv", "time,x,y,z\n1,2,3,4\n2,3,4,5\n3,4,5,6\n"), None),
    **{f"{content[:4]!r} as {suffix}": (file(f"a{suffix}", content), None)
       for suffix in (".bag", ".db3", ".mcap", ".ulg", ".bin", ".csv", ".txt", ".zip")
       for content in (b"time,gx\n1,2\n", bytes(4000))},
}  # fmt: skip


def claims(path):
    """Readers that take a path for theirs by its content, and the known log that it is."""
    suffix = "" if path.is_dir() else path.suffix.lower()
    asked = [kind for kind in FORMATS if kind.accepts and suffix in kind.suffixes]
    names = [kind.name for kind in asked if formats._named(kind.accepts)(path)]
    known = known_profile(path) if suffix in {".csv", ".txt"} else None
    return names if known is None else [*names, known.origin]


@pytest.mark.parametrize("kind", CLAIMS)
def test_one_reader_or_none_claims_a_file(kind, tmp_path):
    maker, name = CLAIMS[kind]
    path = maker(tmp_path)
    assert claims(path) == ([] if name is None else [name])
    assert name is None or plumbob.read(path).name


def test_recordings_of_plumbob_and_arrays_are_claimed_by_no_reader_of_others(tmp_path):
    recording = plumbob.Recording(imu=plumbob.ImuData(t=M.t_ns / 1e9, gyr=M.gyr, acc=M.acc))
    for name in ("a.parquet", "a.csv", "a.mcap"):
        plumbob.convert(recording, tmp_path / name)
        assert claims(tmp_path / name) == [] and len(plumbob.read(tmp_path / name).imu) == 80
    savemat(tmp_path / "a.mat", {"gyr": M.gyr})
    assert claims(tmp_path / "a.mat") == [] and formats.kind_of(tmp_path / "a.mat").name == "arrays"


@needs("formats/px4_small.ulg")
def test_at_most_one_reader_claims_a_real_file():
    roots = [DATA / name for name in ("formats", "ferraris", "static_l3gd20", "phones")] + [DATA.parent / "cases"]
    for path in (path for root in roots for path in root.rglob("*")):
        if path.suffix in formats.suffixes() or path.is_dir():
            assert len(claims(path)) <= 1, path
