"""Which reader claims each kind of file, one or none; and damaged copies: read, or refused in a line that names it.

What a kind promises beyond that, as which rows of a cut file come back, stands in its own tests.
"""

import errno
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import scipy.io

from plumbob.core.errors import PlumbobError
from plumbob.files import formats, read
from plumbob.files.arrow import intact
from plumbob.files.draft import known_profile
from tests.helpers import file_kinds as kinds
from tests.helpers import log_samples as logs
from tests.helpers.real_data import DATA

CUTS, COPIES = 12, 20


class Kind(NamedTuple):
    """How it is made below a folder from a motion; which of its files is damaged; how many copies may be refused.

    A log outlives most of a few changed bytes; of what has a checksum, every copy may be refused.
    """

    put: Callable[[Path, kinds.Motion], Path]
    damaged: str = ""
    refused: float = 1.0


def content(name, made):
    """A file of these bytes, or of this text."""

    def put(folder, moving):
        raw = made(moving)
        (folder / name).write_bytes(raw.encode() if isinstance(raw, str) else raw)
        return folder / name

    return put


def arrays(name, save, inside="imu/"):
    """Named arrays of a few rows, and their profile beside them."""

    def put(folder, moving):
        found = kinds.arrays_of(moving.every(16))
        save(folder / name, found if inside else found | found.pop("imu"))
        (folder / name).with_suffix(".toml").write_text(kinds.profile_of_arrays(inside))
        return folder / name

    return put


def bag(container):
    def put(folder, moving):
        pytest.importorskip("rosbags")
        from tests.helpers import ros_bags

        return ros_bags.CONTAINERS[container](folder, kinds.ros_rows(moving))

    return put


def euroc(folder, moving):
    return kinds.asl(folder / "MH_04", moving=moving)


def kitti(folder, moving):
    return kinds.drive(folder / "drive", moving=moving.every(16))


KINDS = {
    "PX4": Kind(content("m.ulg", kinds.px4_of), refused=0.5),
    "DataFlash": Kind(content("m.bin", lambda _: logs.dataflash()), refused=0.5),
    "DataFlash, text": Kind(content("m.log", kinds.dataflash_text_of), refused=0.5),
    "telemetry": Kind(content("m.tlog", kinds.tlog_of), refused=0.5),
    "MTB": Kind(content("m.mtb", kinds.mtb_of), refused=0.5),
    "MT Manager": Kind(lambda folder, moving: kinds.xsens_of(folder / "m.txt", moving)),
    "x-IMU3": Kind(content("m.ximu3", kinds.ximu3_of)),
    "phone": Kind(lambda folder, moving: kinds.zipped(folder / "m.zip", kinds.sensor_logger_of(moving))),
    "RepoIMU": Kind(content("T.csv", kinds.repoimu_of)),
    "EuRoC, samples": Kind(euroc, "mav0/imu0/data.csv"),
    "EuRoC, sensor": Kind(euroc, "mav0/imu0/sensor.yaml"),
    "EuRoC, truth": Kind(euroc, "mav0/state_groundtruth_estimate0/data.csv"),
    "KITTI, stamps": Kind(kitti, "oxts/timestamps.txt"),
    "KITTI, sample": Kind(kitti, "oxts/data/0000000003.txt"),
    "MATLAB": Kind(arrays("m.mat", scipy.io.savemat)),
    "MATLAB, packed": Kind(arrays("m.mat", lambda path, found: scipy.io.savemat(path, found, do_compression=True))),
    "NumPy": Kind(arrays("m.npz", lambda path, found: np.savez(path, **found), inside="")),
    **{f"ROS, {name}": Kind(bag(name)) for name in ("bag", "bag, bz2", "bag, lz4", "db3", "mcap")},
    "ROS, folder, mcap": Kind(bag("folder, mcap"), "a.mcap"),
}


ECHO = "%time,field.header.stamp," + ",".join(f"field.angular_velocity.{axis}" for axis in "xyz") + "\n"
CLAIMS = {
    **{name: (kind.put, name.partition(",")[0]) for name, kind in KINDS.items()},
    "phyphox": (lambda folder, m: kinds.foldered(folder / "a", kinds.phyphox_of(m)), "phone"),
    "SensorLog": (content("a.csv", kinds.sensorlog_of), "phone"),
    "phyphox, table": (content("Gyroscope.csv", lambda m: kinds.phyphox_table("Gyroscope ", "rad/s", m.gyr)), "phone"),
    "MT Manager, commas": (lambda folder, m: kinds.xsens_of(folder / "a.csv", m), "Xsens"),
    "EuRoC, table": (lambda folder, m: euroc(folder, m) / "mav0" / "imu0" / "data.csv", "EuRoC"),
    "x-IMU3, folder": (lambda folder, m: kinds.ximu3_folder(folder / "a", m), "x-IMU3"),
    "x-IMU3, table": (lambda folder, m: kinds.ximu3_folder(folder / "a", m) / "Inertial.csv", "x-IMU3"),
    "OpenSim": (content("a.sto", lambda _: "DataType=Quaternion\nendheader\ntime a\n0 1,0,0,0\n1 1,0,0,0"), "OpenSim"),
    "echo": (content("a.csv", lambda m: ECHO + "".join(f"{t},{t},.1,.2,.3\n" for t in m.t_ns)), "rostopic echo -p"),
    "text": (content("a.csv", lambda m: kinds.text_of(m)[0]), ""),
    **{head: (content("a.csv", lambda _, head=head: f"{head}\n" + "1,2,3,4\n2,3,4,5\n3,4,5,6\n"), "")
       for head in ("Time (s),X (m/s^2),Y (m/s^2)", "t,gx,gy,gz", "time,x,y,z", "Time (s),Voltage (V)")},
    **{f"{raw[:4]!r} as {suffix}": (content(f"a{suffix}", lambda _, raw=raw: raw), "")
       for suffix in (".bag", ".db3", ".mcap", ".ulg", ".bin", ".txt", ".zip") for raw in (b"t,x\n1,2\n", bytes(4000))},
}  # fmt: skip
READERS = {"PX4": "ULog", "telemetry": "DataFlash", "MTB": "Xsens", "MT Manager": "Xsens", "MATLAB": "", "NumPy": ""}


def claims(path):
    """Readers that take a path for theirs by its content, and the known log that it is."""
    suffix = "" if path.is_dir() else path.suffix.lower()
    asked = [kind for kind in formats.FORMATS if kind.accepts and suffix in kind.suffixes]
    known = known_profile(path) if suffix in {".csv", ".txt"} else None
    return [kind.name for kind in asked if kind.claims(path)] + ([known.origin] if known else [])


@pytest.mark.parametrize("name", CLAIMS)
def test_one_reader_or_none_claims_a_file(tmp_path, moving, name):
    put, claim = CLAIMS[name]
    path, claim = put(tmp_path, moving), READERS.get(claim, claim)
    assert claims(path) == [claim] * bool(claim)
    assert not claim or read(path).name


def test_at_most_one_reader_claims_a_real_file():
    roots = [DATA / name for name in ("formats", "ferraris", "static_l3gd20", "phones/Jakob_Nexus5_NoDist_Texting")]
    roots.append(DATA.parent / "cases")
    for path in (path for root in roots for path in root.rglob("*")):
        if path.suffix in formats.suffixes() or path.is_dir():
            assert len(claims(path)) <= 1, path


@pytest.fixture(scope="module")
def moving():
    return kinds.real_motion(80)


def copies(raw):
    """Cut alone, from nothing on; with one byte changed, or up to seven; a fifth of these are cut too."""
    rng = np.random.default_rng(3)
    yield from (raw[: len(raw) * part // CUTS] for part in range(CUTS))
    for number in range(COPIES):
        damaged = bytearray(raw)
        for place in rng.integers(0, len(raw), rng.integers(1, 8) if number % 2 else 1):
            damaged[place] = rng.integers(0, 256)
        yield bytes(damaged[: rng.integers(0, len(raw))] if number % 5 == 0 else damaged)


def test_an_error_of_the_disk_is_not_called_damage():
    """What the system says keeps its number; /proc/self/mem has no first byte that can be read."""
    with pytest.raises(OSError) as raised, intact(), Path("/proc/self/mem").open("rb", 0) as disk:
        disk.read(1)
    assert raised.value.errno == errno.EIO


@pytest.mark.parametrize("name", KINDS)
def test_damaged_copies_are_read_or_refused(tmp_path, moving, name):
    put, damaged, most = KINDS[name]
    path = put(tmp_path, moving)
    rows = len(read(path).imu)
    assert rows >= 5
    refusals, damaged = [], path / damaged if damaged else path
    for number, raw in enumerate(copies(damaged.read_bytes())):
        damaged.write_bytes(raw)
        try:
            assert len(read(path).imu) <= rows
        except PlumbobError as error:
            refusals.append(number)
            assert "\n" not in str(error)
            assert path.name in str(error) or damaged.name in str(error)
    assert 0 in refusals or name == "EuRoC, sensor", "an empty file is refused, if it holds samples"
    assert sum(number >= CUTS for number in refusals) <= most * COPIES
