"""Exports of Xsens MT Manager as text, and its MTB logs.

Acceleration is specific force in m/s² and rate of turn in rad/s, in the sensor's axes S as printed on its case (MTi
Family Reference Manual, 4.2). The magnetic field is in arbitrary units, 1 at the place of calibration; its size in µT
is not known. The quaternion turns S to the local frame L, scalar first (MTi and MTx User Manual MT0100P, 4.3.1). L is
East-North-Up by default and was North-West-Up up to the third generation (MTi User Manual MT0605P, "NWU and NED
reference coordinate frames"), so an attitude counts only where the file says which.

SampleTimeFine counts 0.1 ms in 32 bits (MT0605P, 4.12.3), and PacketCounter wraps at 65536. The columns and the lines
before them are those of OpenSim's example (opensim-core, testXsensDataReader.cpp) and of MT Manager 2022. The messages
of an MTB log are taken apart by `xbus`, into the same columns.

Increments are integrals over one sample: a rate of turn is the rotation vector of OriInc divided by the step of time,
and an acceleration is VelInc, turned from the axes at the beginning of the sample to those at its end, divided by it.
So a unit makes its own: packets that MT Manager recorded from an MTi-300 hold all four, and agree so to float32, in a
shake at 12 rad/s, too. They are taken where a file has neither rates nor accelerations.
"""

import re
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob import rotations
from plumbob.core import flags, units
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, DecodeError, excerpt
from plumbob.core.findings import Note, info, warning
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.foreign import xbus
from plumbob.files.foreign.logged import RELATIVE_NOTE, LoggedAttitude, SensorLog, first_bytes, vectors
from plumbob.files.foreign.parts import names_in, sheet
from plumbob.rotations import Frame, North

COMMENT: Final = "//"
TICK_NS: Final = 100_000
_TRIADS: Final = {
    kind: tuple(f"{what}_{axis}" for axis in "XYZ") for kind, what in (("gyr", "Gyr"), ("acc", "Acc"), ("mag", "Mag"))
}
_INCREMENTS: Final = {"gyr": tuple(f"OriInc_q{k}" for k in range(4)), "acc": tuple(f"VelInc_{axis}" for axis in "XYZ")}
# bits of StatusWord that say of an axis that it is at the end of its range (xsstatusflag.h)
_CLIPPED: Final = {flags.ACC_CLIPPED: 0x0700, flags.GYR_CLIPPED: 0x3800, flags.MAG_CLIPPED: 0x1C000}
_ATTITUDES: Final = (
    tuple(f"Quat_q{k}" for k in range(4)),
    tuple(f"Mat[{row}][{column}]" for row in (1, 2, 3) for column in (1, 2, 3)),
    ("Yaw", "Pitch", "Roll"),
)
_SENSORS: Final = (*_TRIADS.values(), *_INCREMENTS.values())
_UTC: Final = tuple(f"UTC_{part}" for part in ("Year", "Month", "Day", "Hour", "Minute", "Second", "Nano"))
_SOURCE: Final = "the sensor's own attitude (Xsens), which is an estimate and not a reference"


Columns = Mapping[str, Floats]


def accepts(path: Path) -> bool:
    """Whether a text is an export of MT Manager, by its columns, or a file is called as an MTB log is."""
    if path.suffix.lower() == ".mtb":
        return True
    names = names_in(first_bytes(path), comment=COMMENT)
    return "PacketCounter" in names and any(columns[0] in names for columns in (*_SENSORS, *_ATTITUDES))


def read(path: Path, unit: str | None = None) -> Recording:
    """Read an export of MT Manager, or one unit of an MTB log, by its identity or its number from 1."""
    if path.suffix.lower() == ".mtb":
        content = xbus.read_unit(path.read_bytes(), unit)
        return _recording(path.stem, content.columns, content.head, content.notes)
    return _exported(path).of_unit(unit)


def _exported(file: Path) -> Recording:
    """An export as text, which holds one unit."""
    raw = file.read_bytes()
    export = sheet(file.name, raw, comment=COMMENT)
    there = set(export.names)
    triads = [columns for columns in _SENSORS if set(columns) <= there]
    attitude = _attitude_columns(there)
    if not triads and not attitude:
        raise DecodeError(
            f"it has no Acc_X, Gyr_X or Mag_X and no attitude; it has {excerpt(', '.join(export.names), 200)}."
        )
    times = [column for column in ("PacketCounter", "SampleTimeFine", *_UTC) if column in there]
    table = export.table([*times, *(column for columns in triads for column in columns), *attitude])
    if table is None:
        raise DecodeError("it has a row of names and no row of numbers; export it again.")
    omitted = [f"left out: {column}" for column in ("FreeAcc_E", "FreeAcc_X", "Pressure") if column in there]
    columns = {str(ref): values for ref, values in table.columns.items()}
    text = raw[: 1 << 16].decode("utf-8-sig", "replace")
    lines = (line[len(COMMENT) :] for line in text.splitlines()[:200] if line.startswith(COMMENT))
    facts = (line.partition(":") for line in lines)
    head = {key.strip().lower(): value.strip() for key, colon, value in facts if colon}
    return _recording(file.stem, columns, head, [*table.notes, *omitted])


def _attitude_columns(names: AbstractSet[str]) -> tuple[str, ...]:
    """Columns of the first attitude that is there; none without one."""
    return next((columns for columns in _ATTITUDES if set(columns) <= names), ())


def _recording(name: str, columns: Columns, head: Mapping[str, str], left_out: list[Note]) -> Recording:
    """Recording of columns by the names of an export."""
    notes: list[Note] = [info("source.mt_manager"), *left_out]
    stamps = _stamps(columns, head, notes)
    words = head.get("coordinate system", "").split()
    frame = Frame(words[0].upper()) if words and words[0].upper() in list(Frame) else None
    attitude = _attitude_columns(columns.keys())
    measured = any(set(names) <= columns.keys() for names in _SENSORS)
    meta = ImuMeta(
        device=" ".join(filter(None, (head.get("productcode", "Xsens"), head.get("deviceid", "")))),
        rate_nominal=_rate(head),
        frame=frame,
        unit_check=False,
    )
    log = SensorLog(notes, meta, _epoch(columns, stamps))
    if measured:
        _add_streams(log, columns, stamps)
    if log.epoch_ns is None and set(_UTC) <= columns.keys():
        notes.append(info("source.no_utc_without_date"))
    if attitude and frame is None:
        if not measured:  # as OpenSense takes it
            raise DecodeError(
                "it holds an attitude alone and does not say its frame; add a line '// Coordinate system: ENU'."
            )
        notes.append(warning("source.no_coordinate_system"))
    elif attitude and frame is not None:
        note = f"{_SOURCE}; {frame}, magnetic north, as it counts without GNSS and a declination set"
        q_nb = _attitude(columns, attitude)
        log.attitudes.append(LoggedAttitude(stamps, q_nb, _SOURCE, frame, North.MAGNETIC, note))
        notes += [] if measured else [info("source.xsens_attitude", source=_SOURCE, frame=frame)]
    status = columns.get("StatusWord")
    return log.recording(name, flags=None if status is None else partial(_clipped, status, stamps))


def _add_streams(log: SensorLog, columns: Columns, stamps: NDArray[np.int64]) -> None:
    """Add the triads and the temperature, each at the rows where the leading one has a value."""
    values: dict[str, Floats] = {}
    for kind, names in _TRIADS.items():
        if set(names) <= columns.keys():
            values[kind] = vectors(columns, *names)
        elif kind in _INCREMENTS and set(_INCREMENTS[kind]) <= columns.keys():
            values[kind] = _means(vectors(columns, *_INCREMENTS[kind]), values.get("gyr"), stamps, log.notes)
    for kind in [kind for kind, samples in values.items() if not np.isfinite(samples).any()]:
        del values[kind]
        log.notes.append(info("source.columns_empty", kind=kind, columns=_TRIADS[kind][0]))
    if not values:
        raise DecodeError("none of its rates, accelerations and magnetic fields is a number; export it again.")
    there = {kind: np.isfinite(samples).any(axis=1) for kind, samples in values.items()}
    lead = there["gyr"] if "gyr" in there else np.ones(stamps.size, dtype=bool)
    if "Temperature" in columns and np.isfinite(columns["Temperature"]).any():
        values["temp_c"], there["temp_c"] = columns["Temperature"], np.isfinite(columns["Temperature"])
    for kind, samples in values.items():
        unit, mask = "relative" if kind == "mag" else "", there[kind]
        log.add(kind, stamps, samples, unit, valid=lead if not (mask & ~lead).any() else mask)
    if "mag" in values:
        log.notes.append(RELATIVE_NOTE)


def _means(increments: Floats, gyr: Floats | None, stamps: NDArray[np.int64], notes: list[Note]) -> Floats:
    """Means (N, 3) over the sample before each row of its increments.

    Of orientations (N, 4) they are rates of turn, rad/s; of velocities (N, 3) specific forces, m/s², in the axes at the
    end of each sample.
    """
    there = np.isfinite(increments).all(axis=1)
    means = np.full((len(increments), 3), np.nan)
    if not there.any():
        return means
    step, changes = _step(stamps[there]), increments[there]
    if changes.shape[1] == len("wxyz"):
        means[there] = rotations.rotvec_from_quat(changes) / step
        notes.append(info("source.orientation_increments", step=step))
    else:
        back = np.zeros_like(changes) if gyr is None else -step * np.nan_to_num(gyr[there])
        means[there] = rotations.quat_rotate(rotations.quat_from_rotvec(back), changes) / step
        axes = "at its beginning, as no rate is known" if gyr is None else "at its end"
        notes.append(info("source.velocity_increments", step=step, axes=axes))
    return means


def _step(stamps: NDArray[np.int64]) -> float:
    """Time of a sample, s: a lost one's increment is lost with it, so that gaps do not count."""
    steps = np.diff(stamps)
    steps = steps[steps > 0]
    if not steps.size:
        raise DecodeError("it has increments and no two stamps, so that the time of a sample is not known.")
    return float(steps[steps < 1.5 * np.quantile(steps, 0.5, method="lower")].mean()) / 1e9


def _clipped(words: Floats, stamps: NDArray[np.int64], rows_ns: NDArray[np.int64]) -> NDArray[np.uint32]:
    """Flags of the rows (N,) whose status says that an axis is at the end of its range."""
    unique, first = np.unique(stamps, return_index=True)
    status = np.nan_to_num(words[first[np.minimum(np.searchsorted(unique, rows_ns), unique.size - 1)]]).astype(
        np.uint32
    )
    clipped = np.zeros(rows_ns.size, dtype=np.uint32)
    for flag, bits in _CLIPPED.items():
        clipped[(status & np.uint32(bits)) != 0] |= np.uint32(flag)
    return clipped


def _rate(head: Mapping[str, str]) -> float | None:
    match = re.fullmatch(r"(\d{1,5}(?:\.\d{1,6})?) ?Hz", head.get("update rate", ""), re.IGNORECASE)
    return float(match[1]) if match and float(match[1]) > 0.0 else None


def _stamps(columns: Columns, head: Mapping[str, str], notes: list[Note]) -> NDArray[np.int64]:
    """Time of each row, ns, from SampleTimeFine, or from PacketCounter and the rate that the head declares."""
    counter = _unwrapped(columns, "PacketCounter", 1 << 16)
    ticks = _unwrapped(columns, "SampleTimeFine", 1 << 32)
    rate = _rate(head)
    if counter is not None and counter.size > 1:
        steps = np.diff(counter)
        usual = max(1, int(np.median(steps)))
        if lost := int(np.maximum(steps // usual - 1, 0).sum()):
            notes.append(warning("reading.packets_lost", lost=lost))
    if ticks is not None:
        step = float(np.median(np.diff(ticks))) * TICK_NS / 1e9 if ticks.size > 1 else 0.0
        if rate is not None and step > 0.0 and abs(step * rate - 1.0) > 0.1:
            raise ClockError(
                f"SampleTimeFine steps by {step:g} s, as its ticks are 0.1 ms, but the head says {rate:g} Hz; one of "
                "them is wrong."
            )
        notes.append(info("source.sample_time_fine"))
        return ticks * TICK_NS
    if counter is None or rate is None:
        raise DecodeError(
            "it has neither SampleTimeFine nor PacketCounter with a line '// Update Rate: 100.0Hz', so its time is not "
            "known; add that line, or describe the file with a profile that has [time] rate."
        )
    notes.append(info("source.packet_counter_clock", rate=rate))
    return np.asarray(np.round((counter - counter[0]) * (1e9 / rate)).astype(np.int64))


def _unwrapped(columns: Columns, column: str, wraps: int) -> NDArray[np.int64] | None:
    """Count of a counter that begins again after so many; None where there is none."""
    values = columns.get(column)
    if values is None or not np.isfinite(values).any():
        return None
    if not np.isfinite(values).all() or not ((values >= 0) & (values < wraps)).all() or (values % 1.0).any():
        raise DecodeError(f"time: {column} has cells that are not whole numbers below {wraps}; export it again.")
    counts = values.astype(np.int64)
    turns = np.cumsum(np.concatenate([[0], (np.diff(counts) < -wraps // 2).astype(np.int64)]))
    return np.asarray(counts + wraps * turns)


def _epoch(columns: Columns, stamps: NDArray[np.int64]) -> int | None:
    """UTC of the stamp 0, ns, by the first row that has a date and a time."""
    if not set(_UTC) <= columns.keys():
        return None
    utc = vectors(columns, *_UTC)
    rows = np.flatnonzero(np.isfinite(utc).all(axis=1) & (utc[:, 0] > 2000))
    if not rows.size:
        return None
    *parts, nano = (int(value) for value in utc[rows[0]])
    try:
        moment = datetime(*parts, tzinfo=UTC)  # type: ignore[arg-type,misc]
    except ValueError as error:
        raise DecodeError(f"UTC_Year to UTC_Second hold no date: {error}.") from error
    return int(moment.timestamp()) * 10**9 + nano - int(stamps[rows[0]])


def _attitude(columns: Columns, names: tuple[str, ...]) -> Floats:
    values = vectors(columns, *names)
    if len(names) == 4:
        return values
    if len(names) == 3:
        return rotations.quat_from_euler_zyx(units.to_si(values, "deg"))
    q_nb = np.full((len(values), 4), np.nan)
    valid = np.isfinite(values).all(axis=1)
    q_nb[valid] = rotations.quat_from_dcm(values[valid].reshape(-1, 3, 3), tolerance=1e-4)  # six digits are kept
    return q_nb
