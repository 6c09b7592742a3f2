"""What logs of flight controllers and data sets share: records of fixed layout, stamps, and an attitude on the rows.

An attitude that a log holds has stamps of its own. It is brought to the rows of the samples along the shorter arc
between its two neighbours, where these are not farther apart than a gap; elsewhere it is NaN, 'not known'.
"""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, DecodeError, ParameterError, one_line
from plumbob.core.files import existing_file
from plumbob.core.text import counted, first_words
from plumbob.core.time import LONGEST, longest_bridged
from plumbob.data.reading import read_rows
from plumbob.files.foreign.join import Readings
from plumbob.files.stamps import time_line
from plumbob.rotations import quat_normalize

MOST: Final = 2 << 30
"""Bytes of a log at most: it is kept in memory while it is searched."""
_PART: Final = 1 << 14
_NORM: Final = 1e-3


def records(raw: NDArray[np.uint8], places: NDArray[np.int64], layout: "np.dtype[Any]") -> NDArray[Any]:
    """Records (N,) of one layout that begin at these places in a file's bytes."""
    rows = np.empty((places.size, layout.itemsize), dtype=np.uint8)
    within = np.arange(layout.itemsize)
    for start in range(0, places.size, _PART):
        rows[start : start + _PART] = raw[places[start : start + _PART, None] + within]
    return rows.view(layout)[:, 0] if layout.itemsize else np.empty(0, layout)


def triad(table: NDArray[Any] | Mapping[str, NDArray[Any]], *names: str) -> Floats:
    """Three columns of records as (N, 3), or one that holds three numbers in each record."""
    if len(names) == 1:
        return np.asarray(table[names[0]], dtype=np.float64)
    return np.column_stack([np.asarray(table[name], dtype=np.float64) for name in names])


def steady(t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which stamps fit between their neighbours (N,): a damaged one that leaps ahead would make all after it late."""
    keep = np.ones(t_ns.size, dtype=bool)
    if t_ns.size > 2:
        keep &= np.abs(t_ns - np.median(t_ns)) < LONGEST / 2 * 1e9
        indices = np.flatnonzero(keep)
        inner = t_ns[indices]
        keep[indices[1:-1][(inner[1:-1] >= inner[2:]) & (inner[2:] > inner[:-2])]] = False
    return keep


def stream(name: str, t_ns: NDArray[np.int64], values: Floats, notes: list[str]) -> Readings:
    """A sensor's stream, without rows whose stamps leap; their count becomes a note."""
    keep = steady(t_ns)
    if lost := t_ns.size - int(keep.sum()):
        notes.append(f"{name}: {counted(lost, 'sample')} left out, whose stamps leap away from their neighbours'")
    return Readings(t_ns[keep], values[keep])


def micro(stamps: NDArray[Any]) -> NDArray[np.int64]:
    """Integer ns of µs (N,), as flight controllers count them; what no clock of 64 bit ns holds becomes its end."""
    most = np.iinfo(np.int64).max // 1000
    return np.minimum(stamps.astype(np.uint64), np.uint64(most)).astype(np.int64) * 1000


def attitude_at(rows_ns: NDArray[np.int64], t_ns: NDArray[np.int64], q_nb: Floats, notes: list[str]) -> Floats | None:
    """Attitude of a log at the rows of its samples.

    Parameters
    ----------
    rows_ns : ndarray (N,) of int64
        Stamps of the samples, ns.
    t_ns : ndarray (M,) of int64
        Stamps of the attitude by the same clock, ns.
    q_nb : ndarray (M, 4)
        Body to navigation, wxyz; what is not a rotation (a norm that is not 1 within 1e-3) is taken for 'not known'.
    notes : list of str
        What was left out is added here.

    Returns
    -------
    ndarray (N, 4) or None
        Quaternions, NaN where the log has no attitude, within 1e-3 of norm 1; None where it has none at all.
    """
    valid = np.abs(np.sqrt(np.sum(q_nb * q_nb, axis=1)) - 1.0) < _NORM
    valid &= steady(t_ns)
    if not valid.any():
        return None
    if lost := valid.size - int(valid.sum()):
        what = counted(lost, "attitude")
        notes.append(f"attitude: {what} left out of {valid.size}, not rotations or with a stamp far off")
    if np.array_equal(t_ns, rows_ns):  # in one table with the samples: what is not known there stays so
        return np.where(valid[:, None], q_nb, np.nan)
    try:
        line = time_line(t_ns[valid])
    except ClockError as error:  # the samples have a clock of their own
        notes.append(f"attitude: left out: {error}")
        return None
    stamps = line.t_ns
    notes += (f"attitude: {note.removeprefix('time: ')}" for note in line.notes)
    attitude = read_rows(stamps, quat_normalize(q_nb[valid]), rows_ns, max_gap=longest_bridged(stamps))
    missing = attitude.outside | attitude.gap
    if missing.all():
        return None
    if not attitude.exact.all():
        notes.append(
            f"attitude: {counted(stamps.size, 'quaternion')} on stamps of its own, interpolated along the shorter arc "
            f"at those of the samples; not known in {int(np.count_nonzero(missing))} of {rows_ns.size}"
        )
    return attitude.q_nb


def chosen(names: Sequence[str], unit: str | None) -> str:
    """One of the units of a log: by its name, as ``IMU.1`` (or ``imu1``), by its number from 1, or the first.

    Raises
    ------
    ParameterError
        If there is no such unit.
    """
    if unit is None:
        return names[0]
    for alike in (str, _letters):
        for name in names:
            if alike(name) == alike(unit):
                return name
    if unit.isdecimal() and 1 <= int(unit) <= len(names):
        return names[int(unit) - 1]
    listed = ", ".join(f"{name} ({number})" for number, name in enumerate(names[:20], 1))
    raise ParameterError(f"there is no unit '{unit}' in the log; there are {listed}.")


def _letters(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter.isalnum())


def others_note(taken: str, others: Mapping[str, int]) -> str:
    """A note of what was taken of several units, and of how the others, with their counts, are chosen."""
    if not others:
        return taken
    listed = first_words([f"{name} ({count})" for name, count in others.items()], 20)
    return f"{taken}; not taken: {listed}; --unit {next(iter(others))} takes another"


def require_gyroscope(streams: dict[str, Readings], where: str) -> None:
    """Refuse a log without angular rates, which lead the rows."""
    if "gyr" not in streams or not np.asarray(streams["gyr"].t_ns).size:
        raise DecodeError(f"it holds no samples of a gyroscope ({where}); log them, or take another file.")


def inside(folder: Path, *parts: str) -> Path:
    """Path of a file in a folder, refused where a link leads out of it.

    Raises
    ------
    DecodeError
        If it is not in the folder.
    """
    path = folder.joinpath(*parts)
    if not path.resolve().is_relative_to(folder.resolve()):
        raise DecodeError(f"{'/'.join(parts)} leads out of the folder; copy the data set with its files.")
    return path


def text_rows(path: Path, layout: Any, columns: int, **how: Any) -> NDArray[Any]:
    """Rows (N,) of a text table with stamps and numbers, of a type with the fields ``t`` and ``values``.

    Raises
    ------
    DecodeError
        If a row has too few columns or holds what is not a number, or there is none.
    """
    file = existing_file(path, MOST)
    try:
        with file.open(encoding="utf-8-sig") as text, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # no rows, which is said below
            rows = np.loadtxt(text, dtype=layout, usecols=range(columns), ndmin=1, **how)
    except (ValueError, UnicodeDecodeError, OverflowError) as error:
        raise DecodeError(f"{path.name} holds a row that is not {columns} numbers: {one_line(error)}.") from error
    if not rows.size:
        raise DecodeError(f"{path.name} holds no rows; take a copy that is whole.")
    return rows
