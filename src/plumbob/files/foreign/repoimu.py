"""RepoIMU: trials of an Xsens MTi on a wand (TStick) or a pendulum, with Vicon, as text.

By the head lines of the files and Szczęsna et al., ICCVG 2016 (doi:10.1007/978-3-319-46418-3_45): two head lines, then
14 columns, separated by semicolons: time in s; the orientation by Vicon, W X Y Z; acceleration, m/s²; angular rate,
rad/s; magnetic field, in units of the local field, as Xsens gives it.

- The field is scaled by 50 µT, so that directions are right and its size is nominal.
- The axes of the IMU and those of the markers, and the frames, are **not aligned** in the files (the paper's section
  4), so a comparison needs ``--align heading,mounting``.
- Where Vicon lost the markers the quaternion is zero, or not of norm 1: then the attitude is not known.
"""

from pathlib import Path
from typing import Final

from plumbob.core.constants import NOMINAL_FIELD
from plumbob.core.findings import Note, info
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.foreign.logged import LoggedAttitude, SensorLog, seconds_to_ns, text_rows
from plumbob.rotations import Frame, North

_HEAD: Final = 512


def accepts(path: Path) -> bool:
    """Whether a table has the two head lines of a trial."""
    return bool(_separator(path))


def _separator(path: Path) -> str:
    """What separates the columns: a semicolon, or a comma in copies; empty where it is not a trial."""
    with path.open("rb") as stream:
        names, axes = stream.readline(_HEAD).lower(), stream.readline(_HEAD).lower()
    if not (b"time" in names and b"vicon" in names and b"imu" in names):
        return ""
    for separator in (";", ","):
        letters = [cell.strip(b' "') for cell in axes.strip().split(separator.encode())]
        if letters[1:5] == [b"w", b"x", b"y", b"z"] and letters[5:14] == [b"x", b"y", b"z"] * 3:
            return separator
    return ""


def read(path: Path) -> Recording:
    """Read samples and the orientation by Vicon."""
    time, values = text_rows(path, 13, stamps="f8", delimiter=_separator(path), skiprows=2)
    notes: list[Note] = [info("source.repoimu", field=NOMINAL_FIELD)]
    meta = ImuMeta(device="Xsens MTi (RepoIMU)", frame=Frame.ENU, unit_check=False)
    log, t_ns = SensorLog(notes, meta), seconds_to_ns("time", time)
    for sensor, first, unit in (("gyr", 7, ""), ("acc", 4, ""), ("mag", 10, "relative")):
        log.add(sensor, t_ns, values[:, first : first + 3], unit)
    note = (
        "Vicon, axes of the markers to a frame with z up; neither axes nor frames are aligned with the IMU's, so a "
        "comparison needs --align heading,mounting"
    )
    vicon = LoggedAttitude(t_ns, values[:, :4], "Vicon (RepoIMU)", Frame.ENU, North.FREE, note, "reference")
    log.attitudes.append(vicon)
    return log.recording(path.stem)
