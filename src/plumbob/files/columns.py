"""A recording as flat named columns, and back: the one list of names, units and types that files share."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, DecodeError
from plumbob.core.time import to_ns, to_s
from plumbob.data import TRIADS, AttitudeTrack, ImuData, ImuMeta
from plumbob.data.cards import UNITS
from plumbob.files.recording import Recording
from plumbob.rotations import Frame, North

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Column:
    """Unit and NumPy type of a column."""

    unit: str
    dtype: str = "float64"


TIME: Final = "t_ns"
GROUPS: Final[dict[str, tuple[str, ...]]] = {
    **{name: tuple(f"{name}_{axis}" for axis in "xyz") for name in TRIADS},
    "q": ("q_w", "q_x", "q_y", "q_z"),
    "bias": ("bias_x", "bias_y", "bias_z"),
    "cov": tuple(f"cov_{row}{column}" for row in "xyz" for column in "xyz"),
}
COLUMNS: Final[dict[str, Column]] = {
    TIME: Column("ns", "int64"),
    **{name: Column(UNITS[triad]) for triad in TRIADS for name in GROUPS[triad]},
    "temp_c": Column("degC"),
    "flags": Column("1", "uint32"),
    **{name: Column("1") for name in GROUPS["q"]},
    **{name: Column(UNITS["gyr"]) for name in GROUPS["bias"]},
    **{name: Column("rad2") for name in GROUPS["cov"]},
    "track_flags": Column("1", "uint32"),
    "score": Column("1", "bool"),
}


def to_columns(recording: Recording) -> Columns:
    """Columns of a recording, in the order of `COLUMNS`.

    Raises
    ------
    ClockError
        If imu and track have different time stamps.
    PlumbobError
        If a part of a recording cannot stand alone: a slice may hold a triad that is absent throughout.
    """
    imu, track = recording.imu, recording.track
    columns: Columns = {}
    if imu is not None:
        columns |= _imu_columns(replace(imu))
    if track is not None:
        t_ns = to_ns(track.t)
        if TIME in columns and not np.array_equal(columns[TIME], t_ns):
            raise ClockError(
                f"imu and track must share their time stamps in one file, but imu has {columns[TIME].size} and track "
                f"{t_ns.size}, and they differ; write them in two files."
            )
        columns |= {TIME: t_ns} | _track_columns(track)
    return {name: columns[name] for name in COLUMNS if name in columns}


def require(names: Iterable[str], *, imu: bool, track: bool) -> None:
    """Refuse a set of column names that no recording with these parts has.

    Raises
    ------
    DecodeError
        If columns are missing or unknown, or belong to a part that is not there.
    """
    found = set(names)
    needed = {TIME} | ({"flags"} if imu else set()) | (set(GROUPS["q"]) if track else set())
    for group in GROUPS.values():
        needed |= set(group) if found & set(group) else set()
    allowed = set(_allowed(imu, track))
    if missing := sorted(needed - found):
        raise DecodeError(f"the columns {', '.join(missing)} are missing; write the recording again.")
    if extra := sorted(found - allowed):
        raise DecodeError(f"the columns {', '.join(extra)} do not belong here; known are {', '.join(COLUMNS)}.")


def imu_from(columns: Mapping[str, NDArray[Any]], meta: ImuMeta) -> ImuData:
    """Samples from their columns."""
    triads = {name: _joined(columns, name) for name in TRIADS}
    return ImuData(
        t=to_s(columns[TIME]),
        temp_c=columns.get("temp_c"),
        flags=columns["flags"],
        meta=meta,
        **triads,
    )


def track_from(columns: Mapping[str, NDArray[Any]], frame: Frame, north: North, source: str) -> AttitudeTrack:
    """Attitude from its columns."""
    cov = _joined(columns, "cov")
    return AttitudeTrack(
        t=to_s(columns[TIME]),
        q_nb=np.stack([columns[name] for name in GROUPS["q"]], axis=1),
        frame=frame,
        north=north,
        bias_b=_joined(columns, "bias"),
        cov_b=None if cov is None else cov.reshape(-1, 3, 3),
        flags=columns.get("track_flags"),
        score=columns.get("score"),
        source=source,
    )


def _imu_columns(imu: ImuData) -> Columns:
    columns: Columns = {TIME: imu.t_ns, "flags": imu.flags}
    for name in imu.triads:
        columns |= _split(name, getattr(imu, name))
    if imu.temp_c is not None:
        columns["temp_c"] = imu.temp_c
    return columns


def _track_columns(track: AttitudeTrack) -> Columns:
    columns = _split("q", track.q_nb)
    if track.bias_b is not None:
        columns |= _split("bias", track.bias_b)
    if track.cov_b is not None:
        columns |= _split("cov", track.cov_b.reshape(-1, 9))
    if track.flags is not None:
        columns["track_flags"] = track.flags
    if track.score is not None:
        columns["score"] = track.score
    return columns


def _split(group: str, table: Floats) -> Columns:
    return dict(zip(GROUPS[group], np.ascontiguousarray(table.T), strict=True))


def _joined(columns: Mapping[str, NDArray[Any]], group: str) -> Floats | None:
    names = GROUPS[group]
    return np.stack([columns[name] for name in names], axis=1) if names[0] in columns else None


def _allowed(imu: bool, track: bool) -> list[str]:
    of_imu = [name for triad in TRIADS for name in GROUPS[triad]] + ["temp_c", "flags"]
    return [name for name in COLUMNS if name == TIME or (imu if name in of_imu else track)]
