"""KITTI raw: the folder of a drive, whose ``oxts`` holds one text file for each sample of a GPS/IMU unit (OXTS RT3003).

By ``oxts/dataformat.txt`` of each drive, and Geiger et al., IJRR 2013:

- ``ax ay az`` m/s², specific force, and ``wx wy wz`` rad/s in axes of the vehicle: forward, left, up (FLU);
- ``roll pitch yaw`` rad; roll positive with the left side up, pitch positive with the front down, yaw 0 = East and
  counter-clockwise: turns about x, y, z of FLU against ENU. It is the unit's own solution with GPS and two antennas;
- ``timestamps.txt``: one line for each sample, to the ns, in a time zone that it does not say.

Drives called ``_sync`` have 10 Hz (one sample for each image), ``_extract`` 100 Hz.
"""

import re
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError
from plumbob.core.files import text_of
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import counted
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.columns import StampError, stamps_ns
from plumbob.files.foreign.logged import LoggedAttitude, SensorLog, first_bytes, inside, numbers_in
from plumbob.rotations import Frame, North
from plumbob.rotations.quaternions import quat_from_euler_zyx

_COLUMNS: Final = 30
_YPR, _ACC, _GYR = [5, 4, 3], [11, 12, 13], [17, 18, 19]  # places, from 0 (`dataformat.txt`)
_MOST_BYTES: Final = 4096


def accepts(path: Path) -> bool:
    """Whether a folder has ``oxts/timestamps.txt`` and ``oxts/data``."""
    return path.is_dir() and _home(path) is not None


def _home(folder: Path) -> Path | None:
    """Folder of the GPS/IMU unit."""
    for path in (folder / "oxts", folder):
        if path.name == "oxts" and (path / "timestamps.txt").is_file() and (path / "data").is_dir():
            return path
    return None


def read(path: Path) -> Recording:
    """Read samples and the unit's own attitude of a drive."""
    home = _home(path) or path
    rows, table = _table(home)
    lines = [line for line in text_of(inside(home, "timestamps.txt")).splitlines() if line.strip()]
    try:
        stamps = np.array(stamps_ns(lines, None)[0], np.int64)  # since 1970 if their zone were UTC
    except StampError as error:
        raise DecodeError(f"timestamps.txt, line {error.row + 1}: {error}") from error
    if rows[-1] >= stamps.size:
        raise DecodeError(f"sample {rows[-1]} has no stamp, as timestamps.txt has {counted(stamps.size, 'line')}.")
    t_ns, name = stamps[rows], path.resolve().name if path.name != "oxts" else path.resolve().parent.name
    notes: list[Note] = [info("source.kitti"), info("source.kitti_no_zone")]
    if missing := stamps.size - t_ns.size:
        notes.append(warning("reading.kitti_missing", missing=missing, stamped=stamps.size))
    meta = ImuMeta(device="OXTS RT3003", frame=Frame.ENU, north=North.TRUE, unit_check=False)
    log = SensorLog(notes, meta)
    log.add("gyr", t_ns, table[:, _GYR])
    log.add("acc", t_ns, table[:, _ACC])
    source = "OXTS RT3003: the unit's own solution with GPS of two antennas and this IMU"
    note = f"{source}; its heading counts from true north"
    q_nb = quat_from_euler_zyx(table[:, _YPR])
    log.attitudes.append(LoggedAttitude(t_ns, q_nb, source, Frame.ENU, note=note, kind="reference"))
    return log.recording(name)


def _table(home: Path) -> tuple[NDArray[np.int64], Floats]:
    """Numbers of the samples, and their values (N, 30)."""
    names = [file.name for file in inside(home, "data").iterdir() if re.fullmatch(r"[0-9]+\.txt", file.name)]
    if not names:
        raise DecodeError("oxts/data holds no files such as 0000000000.txt; use an intact copy.")
    numbered = sorted((int(name[:-4][:18]), name) for name in names)
    words = (
        (name, first_bytes(inside(home, "data", name), _MOST_BYTES).decode("latin-1").split()) for _, name in numbered
    )
    values = np.stack([numbers_in(of, _COLUMNS, f"oxts/data/{name}") for name, of in words])
    return np.array([number for number, _ in numbered], dtype=np.int64), values
