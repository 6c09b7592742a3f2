"""EuRoC MAV and TUM VI: folders in the ASL layout, ``mav0/imu0``, or the table ``data.csv`` of an IMU alone.

By the data sets' own head lines and papers (Burri et al., IJRR 2016, doi:10.1177/0278364915620033; Schubert et al.,
IROS 2018):

- ``timestamp [ns]`` since 1970 by the recorder's clock, ``w_RS_S`` in rad/s, ``a_RS_S`` in m/s²: angular rate and
  specific force of the sensor S against the reference frame R, in axes of the sensor;
- ``q_RS``, scalar first, turns axes of the sensor into those of R, whose z axis points up; its heading has an arbitrary
  zero, so the frame is called ENU with a free heading;
- ``T_BS`` in ``sensor.yaml`` turns axes of a sensor into those of the body. Samples stay in axes of the IMU, and the
  ground truth is brought to them: q_R,imu = q_R,S · (T_BS of the truth)⁻¹ · T_BS of the IMU.

The ground truth is ``state_groundtruth_estimate0`` of EuRoC, a batch estimate from laser tracker or Vicon **and this
IMU**, or ``mocap0`` of TUM VI, poses of the IMU by motion capture.

Recordings are written as such folders too: stamps are UTC, ns, or the time itself where UTC is not known, and numbers
the shortest that read back to the same bits.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ShapeError, excerpt
from plumbob.core.files import existing_file, replacing_folder, text_of
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import counted
from plumbob.core.time import to_ns
from plumbob.core.units import QUANTITY_BY_TRIAD, is_name
from plumbob.data import ImuData, ImuMeta
from plumbob.data.array import UnitMount
from plumbob.data.recording import Recording
from plumbob.files.column_names import taken_apart
from plumbob.files.foreign.logged import MOST, LoggedAttitude, SensorLog, first_bytes, inside, numbers_in, vectors
from plumbob.files.foreign.parts import Sheet
from plumbob.files.profile import TextLayout
from plumbob.rotations import Frame, North, change_frame
from plumbob.rotations.quaternions import quat_conjugate, quat_from_dcm, quat_multiply

_TRUTHS: Final = {
    "state_groundtruth_estimate0": "EuRoC ground truth: batch estimate from laser tracker or Vicon and this IMU",
    "mocap0": "TUM VI motion capture: poses of the IMU",
}
_LAYOUT: Final = TextLayout(",", comment="#", missing=("NaN", "nan"), names=False)
_PLACES: Final = {"gyr": ([0, 1, 2], "rad/s"), "acc": ([3, 4, 5], "m/s2")}


def accepts(path: Path) -> bool:
    """Whether a folder has the IMU of the ASL layout, or a table begins with its head line."""
    if path.is_dir():
        return _home(path) is not None
    head = first_bytes(path, 512).partition(b"\n")[0]
    return head.startswith(b"#timestamp") and b"w_RS_S_x" in head and b"a_RS_S_x" in head


def _home(folder: Path) -> Path | None:
    """Folder that holds ``imu0``."""
    return next((path for path in (folder / "mav0", folder) if (path / "imu0" / "data.csv").is_file()), None)


def read(path: Path) -> Recording:
    """Read samples, and the ground truth where a folder has one."""
    home = _home(path) if path.is_dir() else None
    table, name = path if home is None else inside(home, "imu0", "data.csv"), path.stem
    if home is not None or name == "data":  # that of the folder about mav0
        name = ["imu0", *(part for part in table.resolve().parts[:-1] if part not in ("mav0", "imu0", "data"))][-1]
    notes: list[Note] = [info("source.euroc")]
    t_ns, values = _rows(table, 6, notes)
    q_b_imu, rate = _sensor(table.with_name("sensor.yaml"), "imu0", notes)
    meta = ImuMeta(device="ASL imu0", rate_nominal=rate, frame=Frame.ENU, north=North.FREE)
    log = SensorLog(notes, meta, epoch_ns=0)
    for sensor, (columns, unit) in _places(table).items():
        log.add(sensor, t_ns, values[:, columns], unit)
    for kind, source in _TRUTHS.items():
        if home is not None and (home / kind / "data.csv").exists():
            t_ns, poses = _rows(inside(home, kind, "data.csv"), 7, notes)
            q_b_s, _ = _sensor(home / kind / "sensor.yaml", kind, notes)
            q_nb = quat_multiply(quat_multiply(poses[:, 3:], quat_conjugate(q_b_s)), q_b_imu)
            note = (
                f"{kind}, {counted(t_ns.size, 'pose')}, axes of the IMU to a frame with z up whose heading has an "
                "arbitrary zero"
            )
            log.attitudes.append(LoggedAttitude(t_ns, q_nb, source, Frame.ENU, North.FREE, note, "reference"))
    return log.recording(name, none="" if home is None else f"reference: none at its times ({' or '.join(_TRUTHS)})")


def _rows(file: Path, count: int, notes: list[Note]) -> tuple[NDArray[np.int64], Floats]:
    """Stamps (N,), ns, and the numbers behind them (N, `count`)."""
    refs = range(1, count + 2)
    table = Sheet(file.name, existing_file(file, MOST).read_bytes(), _LAYOUT, ()).table(refs, exact=1)
    if table is None:
        raise DecodeError(f"{file.name} holds no rows; use an intact copy.")
    notes += table.notes
    return int(table.zero) + np.rint(table.columns[1]).astype(np.int64), vectors(table.columns, *refs[1:])


def _places(table: Path) -> dict[str, tuple[list[int], str]]:
    """Columns behind the stamp of each triad, and their unit, as the row of names says; of the layout without one."""
    with table.open(encoding="utf-8-sig", errors="replace") as stream:
        head = stream.readline()
    if not head.startswith("#"):
        return dict(_PLACES)
    axes_by_triad: dict[str, dict[str, tuple[int, str]]] = {}
    for place, name in enumerate(head.lstrip("#").strip().split(",")[1:]):
        symbol = re.match(r"\s*([wa])_", name)
        column = taken_apart(name)
        triad = {"w": "gyr", "a": "acc"}[symbol[1]] if symbol else column.sensor
        if triad in _PLACES and column.axis:
            unit = column.unit_as(QUANTITY_BY_TRIAD[triad]) or column.unit
            axes_by_triad.setdefault(triad, {})[column.axis] = (place, unit)
    places = {}
    for triad, axes in axes_by_triad.items():
        units = {unit for _, unit in axes.values()}
        if set(axes) != set("xyz") or len(units) != 1 or not is_name(next(iter(units)), QUANTITY_BY_TRIAD[triad]):
            break
        places[triad] = ([axes[axis][0] for axis in "xyz"], units.pop())
    if set(places) != set(_PLACES):
        raise DecodeError(
            f"its row of names is not that of the ASL layout: {excerpt(head.strip(), 200)}. Rates and accelerations "
            "are looked for by these names and units; describe the table with a profile: plumbob profile data.csv."
        )
    return places


def _sensor(file: Path, name: str, notes: list[Note]) -> tuple[Floats, float | None]:
    """Rotation of ``T_BS`` as a quaternion, sensor to body, and the rate, Hz, as far as ``sensor.yaml`` says them."""
    identity = np.array([1.0, 0.0, 0.0, 0.0])
    if not file.is_file():
        notes.append(warning("source.euroc_no_sensor", name=name))
        return identity, None
    text = re.sub(r"#.*", "", text_of(inside(file.parent.parent, file.parent.name, file.name)))
    rate = re.search(r"^rate_hz:[ \t]*([0-9.]{1,24})[ \t]*$", text, re.MULTILINE)
    where = f"{file.parent.name}/{file.name}"
    hertz = float(numbers_in([rate[1]], 1, f"rate_hz in {where}")[0]) if rate else None
    listed = re.search(r"^T_BS:[^\[\]]{0,200}?data:\s{0,80}\[([^\]]{0,2000})\]", text, re.MULTILINE)
    if listed is None:
        notes.append(warning("source.euroc_no_axes", name=name))
        return identity, hertz
    numbers = numbers_in(listed[1].replace(",", " ").split(), 16, f"T_BS in {where}")
    c_bs = numbers.reshape(4, 4)[:3, :3]
    try:
        turn = quat_from_dcm(c_bs, tolerance=1e-3)
    except ShapeError as error:
        raise DecodeError(f"T_BS in {where} is not a rotation: {error}") from error
    if not np.allclose(c_bs, np.eye(3), atol=1e-6):
        notes.append(info("source.euroc_axes", name=name))
    return turn, hertz if hertz else None


_IMU: Final = {"w_RS_S": "rad s^-1", "a_RS_S": "m s^-2"}  # columns and their units
_STATE: Final = {"p_RS_R": "m", "q_RS": "", "v_RS_R": "m s^-1", "b_w_RS_S": "rad s^-1", "b_a_RS_S": "m s^-2"}
_YAML: Final = """\
%YAML:1.0
sensor_type: {kind}
comment: written by Plumbob{comment}
T_BS:
  cols: 4
  rows: 4
  data: [{data}]
"""
_UNKNOWN: Final = "; attitude in ENU, positions, velocities and accelerometer biases are not known and zero"


def write_euroc(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write the folder; errors as in `plumbob.write`; ShapeError if a unit has no gyroscope or no accelerometer."""
    units: Mapping[str, ImuData] = {} if recording.imu is None else {"": recording.imu}
    units = units if recording.array is None else recording.array.units
    if not units:
        raise ShapeError(f"{path}: EuRoC holds the samples of an IMU, and there are none; write an attitude as .tum.")
    for imu in units.values():
        if not _complete(imu).any():
            raise ShapeError(f"{path}: EuRoC holds rates with accelerations, and no sample has both.")
    with replacing_folder(path, overwrite=overwrite, may_replace=is_euroc) as folder:
        for number, (name, imu) in enumerate(units.items()):
            mount = UnitMount() if recording.array is None else recording.array.mounts[name]
            rate = 1.0 / float(np.median(np.diff(imu.t))) if len(imu) > 1 else 0.0
            sensor = _YAML.format(kind="imu", comment="", data=_pose(mount))
            sensor += f"rate_hz: {float(imu.meta.rate_nominal or rate)!r}\n"
            assert imu.gyr is not None and imu.acc is not None
            samples = _lines(imu.t_ns + imu.meta.t0_ns, imu.gyr, imu.acc, valid=_complete(imu))
            _write(folder / "mav0" / f"imu{number}", sensor, _IMU, samples)
        if (track := recording.track) is not None:
            t0_ns = next((imu.meta.t0_ns for imu in units.values()), 0)
            state = folder / "mav0" / "state_groundtruth_estimate0"
            sensor = _YAML.format(kind="visual-inertial", comment=_UNKNOWN, data=_pose(UnitMount()))
            q_nb = change_frame(track.q_nb, to=Frame.ENU, from_=track.frame)
            zero = np.zeros((len(track), 3))
            bias_b = zero if track.bias_b is None else np.nan_to_num(track.bias_b)
            lines = _lines(to_ns(track.t) + t0_ns, zero, q_nb, zero, bias_b, zero, valid=track.known)
            _write(state, sensor, _STATE, lines)


def is_euroc(path: Path) -> bool:
    """Whether a folder holds a EuRoC sequence and nothing besides."""
    return [entry.name for entry in path.iterdir()] == ["mav0"] and (path / "mav0" / "imu0" / "data.csv").is_file()


def lost(recording: Recording) -> Iterator[str]:
    """What the format cannot hold of a recording, a line each."""
    units = {} if recording.array is None else recording.array.units
    for name, imu in units.items() if units else [("", recording.imu)]:
        if imu is None:
            continue
        of = f"{name}: " if name else ""
        if count := len(imu) - int(_complete(imu).sum()):
            yield f"{of}{counted(count, 'sample')} without a rate or an acceleration left out"
    if recording.track is not None:
        yield "positions, velocities and accelerometer biases are not known: EuRoC has zeros there"


def _complete(imu: ImuData) -> NDArray[np.bool_]:
    """Which samples have all of a rate and an acceleration, (N,)."""
    if imu.gyr is None or imu.acc is None:
        return np.zeros(len(imu), dtype=bool)
    return np.asarray(np.isfinite(np.concatenate((imu.gyr, imu.acc), axis=1)).all(axis=1))


def _pose(mount: UnitMount) -> str:
    """Matrix from the axes of the sensor to those of the body, row by row."""
    rows = np.vstack((np.column_stack((mount.dcm, mount.lever_b)), [0.0, 0.0, 0.0, 1.0]))
    return ", ".join(map(repr, rows.ravel().tolist()))


def _write(folder: Path, sensor: str, columns: Mapping[str, str], lines: Iterable[str]) -> None:
    axes = {name: "wxyz" if name == "q_RS" else "xyz" for name in columns}
    head = ",".join(["#timestamp [ns]", *(f"{c}_{x} [{unit}]" for c, unit in columns.items() for x in axes[c])])
    folder.mkdir(parents=True)
    (folder / "sensor.yaml").write_text(sensor, encoding="utf-8")
    with (folder / "data.csv").open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"{head}\n")
        file.writelines(lines)


def _lines(t_ns: NDArray[np.int64], *columns: Floats, valid: NDArray[np.bool_]) -> Iterator[str]:
    """Rows of stamps and of columns (N, k) beside each other, where they are valid."""
    for stamp, row in zip(t_ns[valid].tolist(), np.concatenate(columns, axis=1)[valid].tolist(), strict=True):
        yield f"{stamp},{','.join(map(repr, row))}\n"
