"""Files of every kind through the command line: `info`, `run`, `convert` there and back, and what each step changes.

Files are real where PLUMBOB_DATA has some; others are written by the format's own library, or by hand from its
description (`tests/helpers/file_kinds.py`), of a motion that was measured. Each is read by `info`, filtered by `run`,
and converted to all that `convert` writes; what is read back is compared with what the first file gives, number by
number. Whatever the new file lacks must be in a note of `convert`: a loss without one is counted as silent. With
--page, the table goes to docs/file-kinds.md.
"""

import argparse
import io
import json
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.harness.bar import Bar, bar_lines
from plumbob.cli.main import main as plumbob
from plumbob.core import flags
from plumbob.core.errors import PlumbobError
from plumbob.core.time import to_ns
from plumbob.data import AttitudeTrack, ImuData, ImuMeta
from plumbob.data.recording import Recording
from plumbob.files import read
from plumbob.files.formats import is_own
from plumbob.live.recorded import read_recorded
from plumbob.rotations import North, change_frame, quat_angle, quat_from_xyzw, quat_multiply
from tests.helpers import file_kinds as kinds
from tests.helpers import ros_bags as ros_made
from tests.helpers.file_kinds import DATA

PAGE = Path(__file__).parents[1] / "docs" / "file-kinds.md"
BROAD = DATA / "broad" / "01_undisturbed_slow_rotation_A.mat"
BROAD_HDF5 = DATA / "broad" / "36_disturbed_attached_magnet_5cm.hdf5"


class Kind(NamedTuple):
    """A kind of file: its name, the format of FORMATS, where it comes from, and what makes or finds one."""

    name: str
    format: str
    source: str
    make: Callable[[Path], Path]
    words: Sequence[str] = ()
    frame: str = "ENU"


class Target(NamedTuple):
    """What `convert` makes: its name, the file, and the options."""

    name: str
    file: str
    words: Sequence[str] = ()


TARGETS = (
    Target("Parquet", "b.parquet"),
    Target("CSV", "b.csv"),
    Target("MATLAB", "b.mat"),
    Target("NetCDF", "b.nc"),
    Target("MCAP", "b.mcap"),
    Target("ROS 2 MCAP", "ros.mcap", ("--as", "ros2")),
    Target("rosbag2", "bag", ("--as", "rosbag2")),
    Target("ROS 1 bag", "b.bag"),
    Target("EuRoC", "euroc", ("--as", "euroc")),
    Target("TUM", "b.tum"),
)
SAID = {
    "samples": r"\bsamples\b",
    "attitude": r"\battitude\b",
    "units": r"unit",
    "some rows": r"left out",
    "mag": r"\bmag\b",
    "temp_c": r"\btemp_c\b",
    "start": r"start|t = 0",
    "body axes": r"body axes",
    "flags": r"\bflags\b",
    "full scales": r"full scales",
    "calibration": r"\bcalibration\b",
    "nominal rate": r"nominal rate",
    "what headings count from": r"what headings count from",
    "declination": r"declination",
    "mounting of the axes": r"mounting of the axes",
    "device": r"device",
    "bias": r"\bbias",
    "covariance": r"covariance",
    "scores": r"scores",
    "source": r"source",
    "notes": r"\bnotes\b",
}
"""What a file may lose, and the words by which a note of `convert` says so."""


def found(name: str) -> Callable[[Path], Path]:
    """A file under PLUMBOB_DATA."""
    return lambda folder: DATA / name


def put(name: str, content: Callable[[kinds.Motion], bytes | str]) -> Callable[[Path], Path]:
    """A file of the motion."""

    def make(folder: Path) -> Path:
        made = content(kinds.real_motion())
        (folder / name).write_bytes(made if isinstance(made, bytes) else made.encode())
        return folder / name

    return make


def _arrays(name: str, save: Callable[[Path, dict[str, Any]], object], inside: str = "imu/") -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        content = kinds.arrays_of(kinds.real_motion())
        save(folder / name, content if inside else {k: v for k, v in content.items() if k != "imu"} | content["imu"])
        (folder / name).with_suffix(".toml").write_text(kinds.profile_of_arrays(inside))
        return folder / name

    return make


def _text(folder: Path) -> Path:
    table, profile = kinds.text_of(kinds.real_motion())
    (folder / "log.csv").write_text(table)
    (folder / "log.toml").write_text(profile)
    return folder / "log.csv"


def _savemat(path: Path, content: dict[str, Any]) -> None:
    from scipy.io import savemat

    savemat(path, content)


def _mcap_of_ros(folder: Path) -> Path:
    bag = ros_made.write_2(folder / "bag", kinds.ros_rows(kinds.real_motion()), "MCAP")
    return next(bag.glob("*.mcap"))


def _recorded(folder: Path) -> Path:
    """Bytes of a unit with a session, as the recorder writes them."""
    from tests.helpers import live_samples

    live_samples.record(folder / "line.mcap", live_samples.reads(live_samples.stream(10.0)))
    return folder / "line.mcap"


def _for_viewers(folder: Path) -> Path:
    from plumbob import convert

    convert(DATA / "formats" / "px4_small.ulg", folder / "flight.mcap")
    return folder / "flight.mcap"


def _ros(write: Callable[..., Path], *more: str) -> Callable[[Path], Path]:
    return lambda folder: write(folder / ("a.bag" if not more else "a"), kinds.ros_rows(kinds.real_motion()), *more)


def _asl(name: str, truth: str) -> Callable[[Path], Path]:
    return lambda folder: kinds.asl(folder / name, truth, moving=kinds.real_motion())


def _phyphox(put_: Callable[..., Path], name: str) -> Callable[[Path], Path]:
    return lambda folder: put_(folder / name, kinds.phyphox_of(kinds.real_motion()))


def _opal(folder: Path) -> Path:
    """A monitor of APDM, version 5, whose world is north, west and up."""
    import h5py

    m, path = kinds.real_motion(), folder / "gait.h5"
    triads = {"Gyroscope": m.gyr, "Accelerometer": m.acc, "Magnetometer": m.mag, "Temperature": m.temp_c}
    with h5py.File(path, "w") as file:
        file.attrs["FileFormatVersion"] = 5
        for name, values in ({"Time": m.t_ns // 1000} | triads).items():
            file[f"Sensors/1262/{name}"] = values
        file.create_group("Sensors/1262/Configuration").attrs["Label 0"] = b"Lumbar"
        file["Processed/1262/Orientation"] = quat_multiply([np.sqrt(0.5), 0.0, 0.0, -np.sqrt(0.5)], m.q_nb)
    return path


def _sto(folder: Path) -> Path:
    """Orientations of OpenSense, whose world has y up."""
    m, path = kinds.real_motion(), folder / "orientations.sto"
    cells = [f"{t!r}\t{','.join(map(repr, q))}" for t, q in zip((m.t_ns / 1e9).tolist(), m.q_nb.tolist(), strict=True)]
    head = ["DataRate=100.0", "DataType=Quaternion", "version=3", "OpenSimVersion=4.2", "endheader", "time\tpelvis_imu"]
    path.write_text("\n".join([*head, *cells, ""]))
    return path


HAND = "description"
MADE = (
    Kind("native Parquet", "native", "real", found("foreign/robot_arm/openaxes_triangle-150_radius.parquet")),
    Kind("ROS 1 bag", "ROS", "library: rosbags", _ros(ros_made.write_1)),
    Kind("ROS 1 bag of poses", "ROS", "real", found("formats/ros1_example.bag"), ("--unit", "ORB-SLAM")),
    Kind("rosbag2, db3", "ROS", "library: rosbags", _ros(ros_made.write_2, "SQLITE3")),
    Kind("rosbag2, MCAP", "ROS", "library: rosbags", _ros(ros_made.write_2, "MCAP")),
    Kind("MCAP of ROS 2", "ROS", "library: rosbags", _mcap_of_ros),
    Kind("MCAP of poses", "ROS", "real", found("formats/ros2_turtlebot.mcap"), ("--unit", "odom")),
    Kind("ULog", "ULog", "real", found("formats/px4_small.ulg"), frame="NED"),
    Kind("ULog of a motion", "ULog", HAND, put("flight.ulg", kinds.px4_of), frame="NED"),
    Kind("DataFlash, bytes", "DataFlash", "real", found("formats/ardupilot_test.bin"), frame="NED"),
    Kind("DataFlash, text", "DataFlash", HAND, put("flight.log", kinds.dataflash_text_of), frame="NED"),
    Kind("tlog", "DataFlash", "library: pymavlink", put("flight.tlog", kinds.tlog_of), frame="NED"),
    Kind("APDM Opal", "APDM", HAND, _opal),
    Kind("OpenSim", "OpenSim", HAND, _sto),
    Kind("EuRoC", "EuRoC", HAND, _asl("MH_01", "state_groundtruth_estimate0")),
    Kind("TUM VI", "EuRoC", HAND, _asl("room1", "mocap0")),
    Kind("KITTI raw", "KITTI", HAND, lambda to: kinds.drive(to / "drive", moving=kinds.real_motion().every(3))),
    Kind("RepoIMU", "text", HAND, put("TStick_Test01.csv", kinds.repoimu_of)),
    Kind("phyphox, zip", "phone", HAND, _phyphox(kinds.zipped, "swing.zip")),
    Kind("phyphox, folder", "phone", HAND, _phyphox(kinds.foldered, "swing")),
    Kind("phyphox, CSV", "phone", HAND, put("Raw Data.csv", lambda m: kinds.phyphox_of(m)["Gyroscope.csv"])),
    Kind(
        "Sensor Logger, zip",
        "phone",
        HAND,
        lambda to: kinds.zipped(to / "walk.zip", kinds.sensor_logger_of(kinds.real_motion())),
    ),
    Kind("SensorLog, CSV", "phone", HAND, put("2025-10-05_10_20_00_iPhone.csv", kinds.sensorlog_of)),
    Kind("Android, folder", "phone", "real", found("phones/Jakob_Nexus5_NoDist_Swinging")),
    Kind("Xsens, text", "Xsens", HAND, lambda to: kinds.xsens_of(to / "MT_1.txt", kinds.real_motion())),
    Kind("Xsens, MTB", "Xsens", HAND, put("MT_1.mtb", kinds.mtb_of)),
    Kind("x-IMU3, log", "x-IMU3", HAND, put("a.ximu3", kinds.ximu3_of)),
    Kind("x-IMU3, folder", "x-IMU3", HAND, lambda to: kinds.ximu3_folder(to / "x", kinds.real_motion())),
    Kind("CSV with a profile", "text", "library: Python", _text),
    Kind("BROAD, HDF5", "arrays", "real", lambda folder: BROAD_HDF5),
    Kind("BROAD, MATLAB", "arrays", "real", lambda folder: BROAD),
    Kind("arrays, .mat", "arrays", "library: SciPy", _arrays("a.mat", _savemat)),
    Kind("arrays, .h5", "arrays", "library: h5py", _arrays("a.h5", kinds.hdf5)),
    Kind("arrays, .npz", "arrays", "library: NumPy", _arrays("a.npz", lambda p, c: np.savez(p, **c), "")),
    Kind("recording of a line", "recording", "own", _recorded),
    Kind("MCAP for viewers", "recording", "own", _for_viewers, frame="NED"),
)
"""Kinds of files."""


@dataclass
class Row:
    """What the command line made of a file."""

    kind: Kind
    grade: str = ""
    run: str = ""
    cells: dict[str, str] = field(default_factory=dict)
    said: dict[str, set[str]] = field(default_factory=dict)
    silent: list[str] = field(default_factory=list)
    tracebacks: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)
    worst: float = 0.0
    mag_ulp: float = 0.0
    cpu: float = 0.0
    missing: bool = False


def call(*words: object) -> tuple[int, str, str]:
    """The command line in this process: exit code, output, messages."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = plumbob([str(word) for word in words])
        except SystemExit as left:
            code = left.code if isinstance(left.code, int) else 1
        except Exception as error:
            print(f"Traceback: {error!r}", file=err)
            code = 70
    return int(code or 0), out.getvalue(), err.getvalue()


def loaded(path: Path, words: Sequence[str] = ()) -> Recording:
    """What `convert` takes of a file, and what is read of a new one."""
    unit = words[words.index("--unit") + 1] if "--unit" in words else None
    return read_recorded(path, estimated=True, unit=unit) if is_own(path) else read(path, unit=unit)


def row_of(kind: Kind, folder: Path) -> Row:
    """All that is done to a file of a kind."""
    row = Row(kind)
    path = kind.make(folder)
    if not path.exists():
        row.missing = True
        return row
    began = time.process_time()
    _look(row, path)
    _run(row, path, folder)
    whole = loaded(path, kind.words)
    for target in TARGETS:
        new = folder / "out" / target.file
        new.parent.mkdir(exist_ok=True)
        _convert(row, path, whole, target, new)
    row.cpu = time.process_time() - began
    return row


def _failed(row: Row, step: str, code: int, messages: str) -> str:
    if code == 70 or "Traceback" in messages:
        row.tracebacks.append(f"{row.kind.name}: {step}: {messages[-2000:]}")
    errors = [line for line in messages.splitlines() if not line.startswith("note: ")]
    return " ".join(errors)[-160:] if code else ""


def _look(row: Row, path: Path) -> None:
    code, out, err = call("info", path, "--json", *row.kind.words)
    error = _failed(row, "info", code, err)
    grade = {} if error else json.loads(out).get("grade") or {}
    row.grade = error or (f"{grade['points']:.0f}, {grade['word'].lower()}" if grade else "poses alone")


def _run(row: Row, path: Path, folder: Path) -> None:
    words = ("--filter", "vqf", "--json", "--out", folder / "track.parquet", *row.kind.words)
    code, out, err = call("run", path, *words)
    if code and "--frame" in err:
        code, out, err = call("run", path, *words, "--frame", row.kind.frame)
    if error := _failed(row, "run", code, err):
        row.run = "an attitude alone" if "no sensor data" in error else error.rpartition(": ")[2]
        return
    errors = json.loads(out).get("errors") or {}
    rmse = errors.get("inclination_rmse_deg")
    why = errors.get("not_compared", "no attitude beside the samples").partition(":")[0]
    row.run = why if rmse is None else f"{rmse:.2f}°"


def _convert(row: Row, path: Path, whole: Recording, target: Target, new: Path) -> None:
    code, _, err = call("convert", path, new, *target.words, *row.kind.words)
    if error := _failed(row, f"convert to {target.name}", code, err):
        row.cells[target.name] = f"refused: {error.rpartition(': ')[2]}"
        return
    notes = "\n".join(line for line in err.splitlines() if line.startswith("note: "))
    try:
        back = tum(new) if target.name == "TUM" else loaded(new)
    except PlumbobError as error:
        row.changed.append(f"{row.kind.name} to {target.name}: cannot be read back: {error}")
        return
    differences, lost = compared(whole, back)
    row.said[target.name] = {name for name in lost if re.search(SAID[name], notes)}
    row.silent += [f"{row.kind.name} to {target.name}: {name}" for name in lost - row.said[target.name]]
    row.cells[target.name] = ", ".join(f"{name} {text}" for name, text in differences.items()) or "="
    row.changed += [
        f"{row.kind.name} to {target.name}: {k} {v}" for k, v in differences.items() if k not in {"q", "mag"}
    ]
    row.worst = max(row.worst, float(differences.get("q", "0").split()[0]))
    row.mag_ulp = max(row.mag_ulp, float(differences.get("mag", "0").split()[0]))


def tum(path: Path) -> Recording:
    """A trajectory as evo reads it: eight numbers a line, behind a head that begins with #."""
    table = np.loadtxt(path, ndmin=2)
    head = re.search(r"body to (\w+), heading from (\w+) north.*; by (.*)", path.read_text().partition("\n")[0])
    assert table.shape[1] == 8 and head is not None
    frame, north, source = head.groups()
    q_nb = quat_from_xyzw(table[:, 4:])
    return Recording(track=AttitudeTrack(t=table[:, 0], q_nb=q_nb, frame=frame, north=north, source=source))


def compared(a: Recording, b: Recording) -> tuple[dict[str, str], set[str]]:
    """Numbers that differ, by name, and names of what is not there any more."""
    differences: dict[str, str] = {}
    lost: set[str] = set()
    one = a.imu if a.array is None else next(iter(a.array.units.values()))
    other = b.imu if b.array is None else next(iter(b.array.units.values()))
    if (a.array is None) != (b.array is None):
        lost.add("units")
    turned = False
    if one is not None and other is None:
        lost.add("samples")
    elif one is not None and other is not None:
        turned = _samples(one, other, differences, lost)
    if a.track is not None and b.track is None:
        lost.add("attitude")
    elif a.track is not None and b.track is not None:
        _attitudes(a, b, differences, lost, turned)
    if set(a.notes) - set(b.notes) and not _findings_alone(a, b):
        lost.add("notes")
    return differences, lost


def _findings_alone(a: Recording, b: Recording) -> bool:
    """Whether the notes that went are findings, which a reader makes of the data again."""
    from plumbob.core.findings import lasting

    return set(lasting(a.notes)) <= set(b.notes)


def _samples(a: ImuData, b: ImuData, differences: dict[str, str], lost: set[str]) -> bool:
    """Compare samples; return whether the body axes were turned by half a turn about x."""
    stamps_a, stamps_b = a.t_ns + a.meta.t0_ns, b.t_ns + b.meta.t0_ns
    if not a.meta.t0_ns and not b.meta.t0_ns and stamps_a[0] != stamps_b[0]:
        stamps_b = stamps_b + (stamps_a[0] - stamps_b[0])
        lost.add("start")
    common, ia, ib = np.intersect1d(stamps_a, stamps_b, return_indices=True)
    if len(common) < len(b):
        differences["stamps"] = f"{len(b) - len(common)} of {len(b)} differ"
    if len(common) < len(a):
        lost.add("some rows")
    turned = False
    for name in ("gyr", "acc", "mag", "temp_c"):
        x, y = getattr(a, name), getattr(b, name)
        if x is None:
            continue
        if y is None:
            lost.add(name)
            continue
        x, y = x[ia], y[ib]
        if (
            name in ("gyr", "acc")
            and not turned
            and np.array_equal(x * [1.0, -1.0, -1.0], y, equal_nan=True)
            and np.any(x)
        ):
            turned = not np.array_equal(x, y, equal_nan=True)
        x = x * [1.0, -1.0, -1.0] if turned and x.ndim == 2 else x
        if not np.array_equal(np.isnan(x), np.isnan(y)):
            differences[name] = f"{np.count_nonzero(np.isnan(x) != np.isnan(y))} values come or go"
        elif not np.array_equal(x, y, equal_nan=True):
            differences[name] = f"{np.nanmax(np.abs(x - y) / np.spacing(np.abs(x))):.0f} ulp"
    if turned:
        lost.add("body axes")
    lost |= {name for name, gone in _meta(a, b, ia, ib).items() if gone}
    return turned


def _meta(a: ImuData, b: ImuData, ia: Any, ib: Any) -> dict[str, bool]:
    of, now = a.meta, b.meta
    absent = np.uint32(flags.GYR_ABSENT | flags.ACC_ABSENT | flags.MAG_ABSENT)  # which the values themselves say

    def gone(*names: str) -> bool:
        return any(getattr(of, n) != getattr(now, n) and getattr(of, n) != getattr(ImuMeta(), n) for n in names)

    return {
        "flags": not np.array_equal(a.flags[ia] & ~absent, b.flags[ib] & ~absent),
        "full scales": gone("gyr_range", "acc_range", "mag_range"),
        "calibration": gone("calibration"),
        "nominal rate": gone("rate_nominal"),
        "what headings count from": of.north is not North.FREE and gone("north"),
        "declination": gone("declination"),
        "mounting of the axes": gone("axes"),
        "device": gone("device"),
    }


def _attitudes(a: Recording, b: Recording, differences: dict[str, str], lost: set[str], turned: bool) -> None:
    one, other = a.track, b.track
    assert one is not None and other is not None
    t0_a, t0_b = (0 if r.imu is None else r.imu.meta.t0_ns for r in (a, b))
    stamps_a, stamps_b = to_ns(one.t) + t0_a, to_ns(other.t) + t0_b
    shift = int(stamps_a[0] - stamps_b[0])
    if b.imu is None and shift:  # a track alone knows no UTC
        known = np.flatnonzero(one.known)
        shift = 0 if stamps_b[0] == stamps_a[known[0]] - t0_a and not t0_b else shift
        stamps_b = stamps_b + (t0_a if shift == 0 else shift)
        if shift and a.imu is None:
            lost.add("start")
    common, ia, ib = np.intersect1d(stamps_a, stamps_b, return_indices=True)
    if len(common) < len(stamps_b):
        differences["stamps of attitudes"] = f"{len(stamps_b) - len(common)} of {len(stamps_b)} differ"
    q = one.q_nb[ia]
    q = quat_multiply(q, [0.0, 1.0, 0.0, 0.0]) if turned else q
    q = change_frame(q, to=other.frame, from_=one.frame)
    seen = other.q_nb[ib]
    q = np.where(np.sum(q * seen, axis=1, keepdims=True) < 0.0, -q, q)  # of both signs the same attitude
    if not np.array_equal(np.isnan(q), np.isnan(seen)) or int(one.known[ia].sum()) != int(other.known.sum()):
        differences["q"] = "9 attitudes come or go"
    elif not np.array_equal(q, seen, equal_nan=True):
        differences["q"] = f"{np.nanmax(quat_angle(q, seen)):.1g} rad"
    for name, words in (
        ("bias_b", "bias"),
        ("cov_b", "covariance"),
        ("flags", "flags"),
        ("score", "scores"),
        ("mag_weight", "scores"),
    ):
        x, y = getattr(one, name), getattr(other, name)
        if x is not None and (y is None or not np.allclose(np.nan_to_num(x[ia]), np.nan_to_num(y[ib]), 1e-9, 1e-15)):
            lost.add(words)
    if one.north != other.north and one.north is not North.FREE:
        lost.add("what headings count from")
    if one.source and one.source != other.source:
        lost.add("source")


def rows(names: Sequence[str] = ()) -> Iterator[Row]:
    """A row of each kind, or of those whose name contains a word."""
    for kind in MADE:
        if names and not any(name.lower() in kind.name.lower() for name in names):
            continue
        with tempfile.TemporaryDirectory() as folder:
            yield row_of(kind, Path(folder))


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table, and whether each bar is met."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="kinds whose names contain one of these words")
    parser.add_argument("--page", action="store_true", help="write docs/file-kinds.md")
    args = parser.parse_args(argv)
    began = time.process_time()
    done: list[Row] = []
    for row in rows(args.names):
        done.append(row)
        print("\n".join(_shown(row)), flush=True)
    there = [row for row in done if not row.missing]
    bars = [
        Bar("tracebacks", sum(len(row.tracebacks) for row in done), 0, 0),
        Bar("losses that no note says", sum(len(row.silent) for row in done), 0, 0),
        Bar("stamps, gyr, acc, temp_c not to the bit", sum(len(row.changed) for row in done), 0, 0),
        Bar("largest change of mag, units of the last place", max((row.mag_ulp for row in there), default=0.0), 0, 1),
        Bar("largest change of an attitude, 1e-15 rad", 1e15 * max((row.worst for row in there), default=0.0), 0, 1),
        Bar("kinds without a file", len(done) - len(there), 0, 0),
        Bar("CPU, s", time.process_time() - began, 0, 120),
    ]
    print("\n".join(bar_lines(bars)))
    if args.page:
        PAGE.write_text(page(there), encoding="utf-8")
    return 0 if all(bar.met for bar in bars) else 1


def _shown(row: Row) -> Iterator[str]:
    """Lines of a row."""
    if row.missing:
        yield f"{row.kind.name:22}no file under PLUMBOB_DATA"
        return
    yield f"{row.kind.name:22}{row.kind.source:20}{row.grade:24}{row.run:40}{row.cpu:6.1f} s"
    for name, cell in row.cells.items():
        yield f"    {name:12}{cell:40} {', '.join(sorted(row.said.get(name, ())))}"
    for line in (*row.silent, *row.changed, *row.tracebacks):
        yield f"  ! {line}"


HEAD = """\
# Files of every kind, there and back

Made by `make formats`: each file is graded by `info`, filtered by `run --filter vqf`, and converted to all that
`convert` writes; what is read back is compared with what the first file gives.

*Real* files are recordings of others. The rest hold a part of a real recording (BROAD, trial 03), written by the
format's own library, or by hand from its description; no file is written by Plumbob but those marked *own*. `run` gives
the rms error of the inclination against the attitude in the file; in logs and phones, that is agreement with their own
estimate.

`=` means that every stamp, rate, force, field, temperature and attitude is the same to the bit. *mag* is the largest
change of the field in units of the last place (ROS has tesla, Plumbob µT), *q* that of an attitude in rad (its world is
turned from NED to ENU, or it is normalised again).
"""
_ROS = ("ROS 2 MCAP", "rosbag2", "ROS 1 bag")


def page(done: Sequence[Row]) -> str:
    """The page of the documentation."""
    names = [target.name for target in TARGETS if target.name not in _ROS]
    names.insert(names.index("MCAP") + 1, "ROS")
    lines = [HEAD, f"| file | from | `info` | `run` | {' | '.join(names)} |", "|---" * (len(names) + 4) + "|"]
    reasons: dict[str, int] = {}
    for row in done:
        cells = row.cells | {"ROS": "; ".join(sorted({row.cells[name] for name in _ROS}))}
        run, *told = (_noted(cell, reasons) for cell in [row.run, *(cells[name] for name in names)])
        kind = row.kind
        lines.append(f"| {kind.name} | {kind.source} | {row.grade} | {run} | {' | '.join(told)} |")
    lines += ["", *(f"{number}. {reason.rstrip('.')}." for reason, number in reasons.items())]
    lines += ["", "## What is left out", ""]
    lines += ["`convert` says in a note what the new format has no place for, where the recording has it:", ""]
    lines += ["| to | left out |", "|---|---|"]
    for target in TARGETS:
        left = sorted(set().union(*(row.said.get(target.name, set()) for row in done)))
        lines.append(f"| {target.name} | {', '.join(left) or 'nothing'} |")
    lines += ["", "*Body axes*: ROS has them forward, left, up (REP 103), so y and z of a unit in NED change sign."]
    return "\n".join([*lines, ""])


def _noted(cell: str, reasons: dict[str, int]) -> str:
    """A cell, or the number of the line below the table that says why there is none."""
    reason = cell.strip().removeprefix("refused: ")
    if reason.endswith("°") or (reason == cell and len(reason) < 20):
        return cell
    return f"– ({reasons.setdefault(reason, len(reasons) + 1)})"


if __name__ == "__main__":
    sys.exit(main())
