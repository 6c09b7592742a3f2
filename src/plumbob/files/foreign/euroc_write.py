"""Recordings as folders of EuRoC (the ASL data set format), as visual-inertial programs read them.

`mav0/imu0/data.csv` holds rates and specific forces in the sensor's axes S, `sensor.yaml` beside it how they sit on
the body B; `mav0/state_groundtruth_estimate0/data.csv` an attitude of the same axes in a world R with z up, here ENU.
Columns and units are those of the data set (Burri et al. 2016, doi:10.1177/0278364915620033, and the files themselves).
Stamps are UTC, ns, or the time itself where UTC is not known. Numbers are the shortest that read back to the same bits.
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import ShapeError
from plumbob.core.files import replacing_folder
from plumbob.core.text import counted
from plumbob.core.time import to_ns
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.array import UnitMount
from plumbob.data.recording import Recording
from plumbob.rotations import Frame, change_frame

_RATE, _FORCE, _SPEED = "[rad s^-1]", "[m s^-2]", "[m s^-1]"
_IMU: Final = ",".join(
    ("#timestamp [ns]", *(f"w_RS_S_{x} {_RATE}" for x in "xyz"), *(f"a_RS_S_{x} {_FORCE}" for x in "xyz"))
)
_STATE: Final = ",".join(
    (
        "#timestamp [ns]",
        *(f"p_RS_R_{x} [m]" for x in "xyz"),
        *(f"q_RS_{x} []" for x in "wxyz"),
        *(f"v_RS_R_{x} {_SPEED}" for x in "xyz"),
        *(f"b_w_RS_S_{x} {_RATE}" for x in "xyz"),
        *(f"b_a_RS_S_{x} {_FORCE}" for x in "xyz"),
    )
)
_IMU_YAML: Final = """\
%YAML:1.0
sensor_type: imu
comment: written by Plumbob
T_BS:
  cols: 4
  rows: 4
  data: [{data}]
rate_hz: {rate!r}
"""
_STATE_YAML: Final = """\
%YAML:1.0
sensor_type: visual-inertial
comment: written by Plumbob; attitude in ENU, positions, velocities and accelerometer biases are not known and zero
T_BS:
  cols: 4
  rows: 4
  data: [{data}]
"""


def write_euroc(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write the folder; errors as in `plumbob.write`.

    Raises
    ------
    ShapeError
        If there are no samples, or a unit has no gyroscope or no accelerometer.
    """
    units: Mapping[str, ImuData] = {} if recording.imu is None else {"": recording.imu}
    units = units if recording.array is None else recording.array.units
    if not units:
        raise ShapeError(f"{path}: EuRoC holds the samples of an IMU, and there are none; write an attitude as .tum.")
    for imu in units.values():
        if not _complete(imu).any():
            raise ShapeError(f"{path}: EuRoC holds rates with accelerations, and no sample has both.")
    with replacing_folder(path, overwrite=overwrite, known=is_euroc) as folder:
        for number, (name, imu) in enumerate(units.items()):
            mount = UnitMount() if recording.array is None else recording.array.mounts[name]
            rate = 1.0 / float(np.median(np.diff(imu.t))) if len(imu) > 1 else 0.0
            sensor = _IMU_YAML.format(data=_pose(mount), rate=float(imu.meta.rate_nominal or rate))
            _write(folder / "mav0" / f"imu{number}", sensor, _IMU, _samples(imu))
        if (track := recording.track) is not None:
            t0_ns = next((imu.meta.t0_ns for imu in units.values()), 0)
            state = folder / "mav0" / "state_groundtruth_estimate0"
            _write(state, _STATE_YAML.format(data=_pose(UnitMount())), _STATE, _states(track, t0_ns))


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


def _write(folder: Path, sensor: str, head: str, lines: Iterable[str]) -> None:
    folder.mkdir(parents=True)
    (folder / "sensor.yaml").write_text(sensor, encoding="utf-8")
    with (folder / "data.csv").open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"{head}\n")
        file.writelines(lines)


def _samples(imu: ImuData) -> Iterator[str]:
    assert imu.gyr is not None and imu.acc is not None
    mask = _complete(imu)
    table = np.concatenate((imu.gyr, imu.acc), axis=1)[mask].tolist()
    for t_ns, row in zip((imu.t_ns + imu.meta.t0_ns)[mask].tolist(), table, strict=True):
        yield f"{t_ns},{','.join(map(repr, row))}\n"


def _states(track: AttitudeTrack, t0_ns: int) -> Iterator[str]:
    valid = track.known
    q_nb = change_frame(track.q_nb, to=Frame.ENU, from_=track.frame)[valid].tolist()
    bias = np.zeros((len(track), 3)) if track.bias_b is None else np.nan_to_num(track.bias_b)
    zeros = ",".join(["0.0"] * 3)
    for t_ns, q, b in zip((to_ns(track.t) + t0_ns)[valid].tolist(), q_nb, bias[valid].tolist(), strict=True):
        yield f"{t_ns},{zeros},{','.join(map(repr, q))},{zeros},{','.join(map(repr, b))},{zeros}\n"
