"""Exports of Xsens MT Manager as text, and its MTB logs.

Acceleration is specific force in m/s² and rate of turn in rad/s, in the sensor's axes S as printed on its case (MTi
Family Reference Manual, 4.2). The magnetic field is in arbitrary units, 1 at the place of calibration; its size in µT
is not known. The quaternion turns S to the local frame L, scalar first (MTi and MTx User Manual MT0100P, 4.3.1). L is
East-North-Up by default and was North-West-Up up to the third generation (MTi User Manual MT0605P, "NWU and NED
reference coordinate frames"), so an attitude counts only where the file says which.

SampleTimeFine counts 0.1 ms in 32 bits (MT0605P, 4.12.3), and PacketCounter wraps at 65536. The columns and the lines
before them are those of OpenSim's example (opensim-core, testXsensDataReader.cpp) and of MT Manager 2022.
"""

import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import units
from plumbob.core.check import Floats
from plumbob.core.constants import NOMINAL_FIELD
from plumbob.core.errors import ClockError, DecodeError, excerpt
from plumbob.core.files import existing_file, reading
from plumbob.core.text import counted
from plumbob.data import AttitudeTrack, ImuMeta
from plumbob.files.foreign.join import Stream, joined
from plumbob.files.foreign.logged import attitude_at
from plumbob.files.foreign.parts import HEAD_BYTES, Sheet, names_in, sheet
from plumbob.files.notes import Recording
from plumbob.files.text_table import Table
from plumbob.rotations import Frame, North, quat_from_dcm, quat_from_euler_zyx

COMMENT: Final = "//"
TICK_NS: Final = 100_000
_COUNTER_WRAPS: Final = 1 << 16
_TIME_WRAPS: Final = 1 << 32
_TRIADS: Final = {"gyr": ("Gyr", "rad/s"), "acc": ("Acc", "m/s2"), "mag": ("Mag", "relative")}
_ATTITUDES: Final = (
    tuple(f"Quat_q{k}" for k in range(4)),
    tuple(f"Mat[{row}][{column}]" for row in (1, 2, 3) for column in (1, 2, 3)),
    ("Yaw", "Pitch", "Roll"),
)
_UTC: Final = tuple(f"UTC_{part}" for part in ("Year", "Month", "Day", "Hour", "Minute", "Second", "Nano"))
_SOURCE: Final = "the sensor's own attitude (Xsens), which is an estimate and not a reference"
_RATE_FITS: Final = 0.1


def accepts(path: Path) -> bool:
    """Whether a text is an export of MT Manager, by its columns, or a file begins as an MTB log does."""
    with path.open("rb") as stream:
        start = stream.read(HEAD_BYTES)
    if path.suffix.lower() == ".mtb":
        return True
    names = names_in(start, comment=COMMENT)
    return "PacketCounter" in names and any(f"{what}_X" in names for what, _ in _TRIADS.values())


def read(path: Path) -> Recording:
    """Read an export of MT Manager.

    Raises
    ------
    DecodeError
        If it has no sensor values, or nothing that time can be made of.
    ClockError
        If SampleTimeFine and the update rate contradict each other, or stamps go back.
    """
    file = existing_file(path)
    with reading(file):
        if file.suffix.lower() == ".mtb":
            raise DecodeError("MTB logs are not read yet; export it as text with MT Manager (File, Export).")
        raw = file.read_bytes()
        return _recording(file.stem, sheet(file.name, raw, comment=COMMENT), _head(raw))


def _head(raw: bytes) -> dict[str, str]:
    """What the lines before the table say, by key in small letters."""
    text = raw[: 1 << 16].decode("utf-8-sig", "replace")
    lines = (line[len(COMMENT) :] for line in text.splitlines()[:200] if line.startswith(COMMENT))
    return {
        key.strip().lower(): value.strip() for key, colon, value in (line.partition(":") for line in lines) if colon
    }


def _recording(name: str, one: Sheet, head: Mapping[str, str]) -> Recording:
    triads = {
        kind: [f"{what}_{letter}" for letter in "XYZ"]
        for kind, (what, _) in _TRIADS.items()
        if {f"{what}_{letter}" for letter in "XYZ"} <= set(one.names)
    }
    if not triads:
        raise DecodeError(f"it has no Acc_X, Gyr_X or Mag_X; it has {excerpt(', '.join(one.names), 200)}.")
    attitude = next((columns for columns in _ATTITUDES if set(columns) <= set(one.names)), ())
    times = [column for column in ("PacketCounter", "SampleTimeFine", *_UTC) if column in one.names]
    table = one.table([*times, *(column for columns in triads.values() for column in columns), *attitude])
    if table is None:
        raise DecodeError("it has a row of names and no row of numbers; export it again.")
    notes = ["MT Manager: m/s² (specific force) and rad/s in the sensor's axes", *table.notes]
    stamps = _stamps(table, head, notes)
    streams: dict[str, Stream] = {}
    for kind, columns in triads.items():
        values = np.stack([table.columns[column] for column in columns], axis=1)
        if np.isfinite(values).any():
            streams[kind] = Stream(stamps, units.to_si(values, _TRIADS[kind][1]))
        else:
            notes.append(f"{kind}: {columns[0]} and its axes have no value")
    if "mag" in streams:
        notes.append(
            f"mag is in arbitrary units, 1 at the place of calibration, which is taken for {NOMINAL_FIELD:g} µT"
        )
    notes += [f"left out: {column}" for column in ("FreeAcc_E", "FreeAcc_X", "Pressure") if column in one.names]
    frame = _frame(head)
    meta = ImuMeta(
        device=" ".join(filter(None, (head.get("productcode", "Xsens"), head.get("deviceid", "")))),
        rate_nominal=_rate(head),
        frame=frame,
        unit_check=False,
    )
    imu, rows_ns, joints = joined(streams, meta=meta, epoch_ns=_epoch(table, stamps))
    track = None
    if attitude and frame is None:
        notes.append("left out: the attitude, as the file does not say its frame (a line '// Coordinate system: ENU')")
    elif attitude:
        q_nb = attitude_at(rows_ns, stamps, _attitude(table, attitude), notes)
        if q_nb is not None:
            track = AttitudeTrack(t=imu.t, q_nb=q_nb, frame=frame, north=North.MAGNETIC, source=_SOURCE)  # type: ignore[arg-type]
            notes.append(
                f"attitude: {_SOURCE}; {frame}, magnetic north, as it counts without GNSS and a declination set"
            )
    return Recording(imu=imu, track=track, name=name, notes=(*notes, *joints))


def _rate(head: Mapping[str, str]) -> float | None:
    found = re.fullmatch(r"(\d{1,5}(?:\.\d{1,6})?) ?Hz", head.get("update rate", ""), re.IGNORECASE)
    return float(found[1]) if found and float(found[1]) > 0.0 else None


def _frame(head: Mapping[str, str]) -> Frame | None:
    told = head.get("coordinate system", "").split()
    return Frame(told[0].upper()) if told and told[0].upper() in list(Frame) else None


def _stamps(table: Table, head: Mapping[str, str], notes: list[str]) -> NDArray[np.int64]:
    """Time of each row, ns, from SampleTimeFine, or from PacketCounter and the rate that the head declares."""
    counter = _unwrapped(table, "PacketCounter", _COUNTER_WRAPS)
    ticks = _unwrapped(table, "SampleTimeFine", _TIME_WRAPS)
    rate = _rate(head)
    if counter is not None and counter.size > 1:
        steps = np.diff(counter)
        usual = max(1, int(np.median(steps)))
        if lost := int(np.maximum(steps // usual - 1, 0).sum()):
            notes.append(f"PacketCounter leaves out {counted(lost, 'packet')}")
    if ticks is not None:
        step = float(np.median(np.diff(ticks))) * TICK_NS / 1e9 if ticks.size > 1 else 0.0
        if rate is not None and step > 0.0 and abs(step * rate - 1.0) > _RATE_FITS:
            raise ClockError(
                f"SampleTimeFine steps by {step:g} s, as its ticks are 0.1 ms, but the head says {rate:g} Hz; one of "
                "them is wrong."
            )
        notes.append("clock: SampleTimeFine, ticks of 0.1 ms")
        return ticks * TICK_NS
    if counter is None or rate is None:
        raise DecodeError(
            "it has neither SampleTimeFine nor PacketCounter with a line '// Update Rate: 100.0Hz', so its time is not "
            "known; add that line, or describe the file with a profile that has [time] rate."
        )
    notes.append(f"clock: PacketCounter at {rate:g} Hz, as the head says")
    return np.asarray(np.round((counter - counter[0]) * (1e9 / rate)).astype(np.int64))


def _unwrapped(table: Table, column: str, wraps: int) -> NDArray[np.int64] | None:
    """Count of a counter that begins again after so many; None where the table has none."""
    values: Any = table.columns.get(column)
    if values is None or not np.isfinite(values).any():
        return None
    if not np.isfinite(values).all() or not ((values >= 0) & (values < wraps)).all() or (values % 1.0).any():
        raise DecodeError(f"{column} has cells that are not whole numbers from 0 to {wraps - 1}; export it again.")
    counts = values.astype(np.int64)
    turns = np.cumsum(np.concatenate([[0], (np.diff(counts) < -wraps // 2).astype(np.int64)]))
    return np.asarray(counts + wraps * turns)


def _epoch(table: Table, stamps: NDArray[np.int64]) -> int | None:
    """UTC of the stamp 0, ns, by the first row that has a date and a time."""
    if not set(_UTC) <= set(table.columns):
        return None
    told = np.stack([table.columns[column] for column in _UTC], axis=1)
    rows = np.flatnonzero(np.isfinite(told).all(axis=1) & (told[:, 0] > 2000))
    if not rows.size:
        return None
    *parts, nano = (int(value) for value in told[rows[0]])
    try:
        moment = datetime(*parts, tzinfo=UTC)  # type: ignore[arg-type,misc]
    except ValueError as error:
        raise DecodeError(f"UTC_Year to UTC_Second hold no date: {error}.") from error
    return int(moment.timestamp()) * 10**9 + nano - int(stamps[rows[0]])


def _attitude(table: Table, columns: tuple[str, ...]) -> Floats:
    values = np.stack([table.columns[column] for column in columns], axis=1)
    if len(columns) == 4:
        return values
    if len(columns) == 3:
        return quat_from_euler_zyx(units.to_si(values, "deg"))
    found = np.full((len(values), 4), np.nan)
    known = np.isfinite(values).all(axis=1)
    found[known] = quat_from_dcm(values[known].reshape(-1, 3, 3), tolerance=1e-4)  # six digits are kept
    return found
