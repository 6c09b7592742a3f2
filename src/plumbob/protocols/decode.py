"""Bytes to numbers with units: every byte belongs to a frame or is counted as junk, and nothing on the wire raises."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.findings import Finding
from plumbob.core.series import data_frame
from plumbob.core.text import one_line, small_table
from plumbob.core.units import unit
from plumbob.data import TRIADS, ImuData
from plumbob.protocols import scan
from plumbob.protocols.field import Field
from plumbob.protocols.format import Format, Message
from plumbob.protocols.format_toml import find_format
from plumbob.protocols.scan import Reads, format_plan
from plumbob.protocols.unpack import Column, Unpacker

Ints = NDArray[np.int64]

_SLICE: Final = 1 << 20  # bytes that are searched and taken apart at a time, so that they stay in the processor's cache


@dataclass(frozen=True, eq=False, slots=True)
class Frames:
    """Frames of one message."""

    message: Message
    start: Ints  # byte of the stream with which each begins (N,)
    t_ns: Ints  # host's time at which that byte was read, ns (N,)
    columns: Mapping[str, Column]  # values (N,) by field, in units inside; whole numbers for what is not measured
    flags: Mapping[str, NDArray[np.uint32]]  # (N,) by unit: the prefix of its fields, empty where it is the only one

    def __len__(self) -> int:
        return int(self.start.size)


@dataclass(slots=True)
class Counts:
    """What became of every byte, and why frames were rejected."""

    received: int = 0  # bytes handed in
    framed: int = 0  # bytes of frames, unknown messages included
    junk: int = 0  # bytes that belong to no frame
    pending: int = 0  # bytes that wait for more
    frames: dict[str, int] = field(default_factory=dict)  # frames by message
    unknown: int = 0  # frames that pass their check and are of no known message
    # bad_checksum, bad_content, bad_length: candidates rejected for their check; for constants, digits or parity; for
    # an impossible length
    bad_checksum: int = 0
    bad_content: int = 0
    bad_length: int = 0

    def summary(self) -> dict[str, int | dict[str, int]]:
        """Everything by name, for JSON."""
        return {name: getattr(self, name) for name in self.__slots__}

    def why_rejected(self) -> str:
        """Which checks candidates for a frame failed, to stand behind a sentence; empty where there was none."""
        reasons = {"checksum": self.bad_checksum, "content": self.bad_content, "length": self.bad_length}
        rejections = ", ".join(f"{count} for their {word}" for word, count in reasons.items() if count)
        return f"; candidates rejected: {rejections}" if rejections else ""


class Decoder:
    """Decodes a stream in any chunking; equal bytes give equal frames.

    Parameters
    ----------
    form : Format
        Format; its options must be settled, or all have defaults.

    Raises
    ------
    ParameterError
        If an option is missing.
    """

    def __init__(self, form: Format) -> None:
        self.form = check.kind("form", form, Format, hint="find_format(name) gives one.").bind()
        self._plan = format_plan(self.form)
        self._unpackers = [Unpacker(message) for message in self.form.messages]
        self._state: Ints = np.zeros(scan.STATE, dtype=np.int64)
        self._state[scan.HUNTING] = 1
        self._pending = b""
        self._reads = Reads()
        self._done = 0
        self._found: Ints = np.empty((_room(self.form), 3), dtype=np.int64)
        self.counts = Counts(frames={m.name: 0 for m in self.form.messages})
        self.notes: tuple[Finding, ...] = ()

    @property
    def remembered(self) -> int:
        """Number of reads whose time is still needed: those with bytes that wait, and the last."""
        return len(self._reads)

    def feed(self, data: bytes, t_ns: int = 0) -> dict[str, Frames]:
        """Take bytes, and return the frames that they complete, by message; messages without any are left out.

        Parameters
        ----------
        data : bytes
            Next bytes of the stream; another buffer, such as a bytearray or an array of uint8, is copied.
        t_ns : int
            Host's time at which they were read, ns.
        """
        try:
            data = data if isinstance(data, bytes) else bytes(memoryview(data))
        except TypeError:
            raise ShapeError(f"data must be bytes, but it is {check.said(data)}.") from None
        return self._take(data, t_ns, final=False)

    def finish(self) -> dict[str, Frames]:
        """Say that the stream has ended, or was interrupted: what is pending is searched, and its rest is junk."""
        return self._take(b"", 0, final=True)

    def _take(self, data: bytes, t_ns: int, *, final: bool) -> dict[str, Frames]:
        if data:
            self._reads.add(self._done + len(self._pending), t_ns)
        self.counts.received += len(data)
        buffer = self._pending + data if self._pending else data
        parts: dict[int, list[Frames]] = {}
        at = 0
        while True:
            end = min(len(buffer), at + _SLICE)
            last = end == len(buffer)
            at, full = self._slice(buffer, at, end, final and last, parts)
            if last and not full:
                break
        self._pending = buffer[at:]
        self._done += at
        self._reads.forget(self._done)
        self._count()
        return {self.form.messages[m].name: joined(frames) for m, frames in sorted(parts.items())}

    def _slice(self, buffer: bytes, at: int, end: int, final: bool, parts: dict[int, list[Frames]]) -> tuple[int, bool]:
        view = np.frombuffer(buffer, dtype=np.uint8)[at:end]
        count, done = scan.scan(view, view.size, final, self._plan, self._state, self._found)
        places = self._found[:count]
        for m, message in enumerate(self.form.messages):
            mine = places if len(self.form.messages) == 1 else places[places[:, 2] == m]
            if mine.shape[0]:
                start = mine[:, 0] + (self._done + at)
                unpacked = self._unpackers[m].take(view, np.ascontiguousarray(mine[:, 0]))
                parts.setdefault(m, []).append(Frames(message, start, self._reads.times(start), *unpacked))
                self.counts.frames[message.name] += mine.shape[0]
        return at + done, count == self._found.shape[0]

    def _count(self) -> None:
        c, s = self.counts, self._state
        c.pending = len(self._pending)
        c.junk, c.unknown = int(s[scan.JUNK]), int(s[scan.UNKNOWN])
        c.framed = c.received - c.junk - c.pending
        c.bad_checksum, c.bad_content, c.bad_length = (
            int(s[i]) for i in (scan.BAD_CHECKSUM, scan.BAD_CONTENT, scan.BAD_LENGTH)
        )


class Decoded(NamedTuple):
    """A decoded stream."""

    frames: Mapping[str, Frames]  # by message; empty where they were handed on as they came
    counts: Counts

    def facts(self) -> Mapping[str, str]:
        """Frames of each message, and bytes that belong to none."""
        facts = {name: str(count) for name, count in self.counts.frames.items()}
        return {**facts, "junk": f"{self.counts.junk} of {self.counts.received} bytes"}

    def __repr__(self) -> str:
        return one_line("Decoded", self.facts())

    def _repr_html_(self) -> str:
        return small_table("Decoded", self.facts())

    def to_frame(self, message: str = "") -> Any:
        """Table for pandas of one message, by default the first that occurs; a column each, by name with unit."""
        frames = self.frames[message or min(self.frames, key=lambda name: int(self.frames[name].start[0]))]
        titles = {format_title(f): frames.columns[f.name] for f in frames.message.fields if f.name in frames.columns}
        return data_frame({"byte": frames.start, **titles})


def format_title(one: Field) -> str:
    """Name of a field with its unit, as a table has it."""
    name = unit(one.unit).quantity.value if one.physical else one.tick
    return one.name if name in ("", "1") else f"{one.name} [{name}]"


def decode(
    data: bytes | str | Path | Iterable[bytes],
    format: Format | str | Path,
    *,
    options: Mapping[str, str] | None = None,
    t_ns: int = 0,
    each: Callable[[dict[str, Frames], Counts], object] | None = None,
) -> Decoded:
    """Decode bytes of a device into rows of numbers, one a frame, in SI units; damaged bytes are skipped and counted.

    Parameters
    ----------
    data : bytes, path or iterable of bytes
        The stream, the file that holds it, or its pieces in their order.
    format : Format, str or path
        What the bytes mean: a device or a rig ('plumbob list devices'), or a ``.toml`` file.
    options : mapping of str to str, optional
        Options of the format, as ``{"gyr_range": "500 deg/s"}``.
    t_ns : int
        Host's time to give to every frame, ns.
    each : callable, optional
        Called with the frames that each piece completes, which the result then does not hold, and the counts so far.

    Returns
    -------
    Decoded

    Raises
    ------
    ParameterError
        If the format or an option is not known, or an option is missing.
    """
    form = format if isinstance(format, Format) else find_format(format)
    decoder = Decoder(form.bind(options) if options else form)
    parts: list[dict[str, Frames]] = []
    use = (lambda frames, _: parts.append(frames)) if each is None else each
    for piece in stream_pieces(data):
        use(decoder.feed(piece, t_ns), decoder.counts)
    use(decoder.finish(), decoder.counts)
    names = [m.name for m in decoder.form.messages]
    frames = {n: joined([p[n] for p in parts if n in p]) for n in names if any(n in p for p in parts)}
    return Decoded(frames, decoder.counts)


def stream_pieces(data: bytes | str | Path | Iterable[bytes]) -> Iterator[bytes]:
    """Pieces of a stream; of a file that is open, what is there already."""
    if isinstance(data, str | Path):
        with Path(data).open("rb") as file:
            yield from iter(lambda: file.read(_SLICE), b"")
    elif isinstance(data, bytes | bytearray | memoryview) or hasattr(data, "__array__"):
        yield data  # type: ignore[misc]
    else:
        yield from data


def _room(form: Format) -> int:
    least = min(m.length for m in form.messages)
    if least < 1:
        raise ParameterError(f"{form.name}: a message must be at least 1 byte long.")
    return _SLICE // least + 1


def joined(parts: list[Frames]) -> Frames:
    """Frames of one message that follow each other."""
    if len(parts) == 1:
        return parts[0]
    first = parts[0]
    return Frames(
        first.message,
        np.concatenate([p.start for p in parts]),
        np.concatenate([p.t_ns for p in parts]),
        {name: np.concatenate([p.columns[name] for p in parts]) for name in first.columns},
        {unit: np.concatenate([p.flags[unit] for p in parts]) for unit in first.flags},
    )


_AXES = "xyz"


def triads_of(frames: Frames, unit: str = "") -> dict[str, Floats]:
    """Triads (N, 3) that a unit of the message has, by its prefix; an axis that it lacks is NaN."""
    triads: dict[str, Floats] = {}
    for triad in TRIADS:
        columns = [frames.columns.get(name) for name in _axis_names(unit, triad)]
        if any(column is not None for column in columns):
            triads[triad] = np.empty((len(frames), 3))
            for i, column in enumerate(columns):
                triads[triad][:, i] = np.nan if column is None else column
    return triads


@cache  # for every part of a stream
def _axis_names(unit: str, triad: str) -> tuple[str, ...]:
    return tuple(_name(unit, triad, axis) for axis in _AXES)


def prefix_by_unit(message: Message) -> tuple[str, ...]:
    """Prefixes of a message's units with a triad, in the order of their fields; empty for the only one."""
    return tuple(dict.fromkeys(f.triad.rpartition(".")[0] for f in message.fields if f.triad))


def unit_prefix(message: Message, label: str) -> str:
    """Prefix of the fields of one of a message's units, by its name or its number from 1."""
    names = prefix_by_unit(message)
    if label in names or not (names or label):
        return label
    if label.isdecimal() and 1 <= int(label) <= len(names):
        return names[int(label) - 1]
    if not names:
        raise ParameterError(
            f"message {message.name} carries no gyr, acc or mag, so there is nothing to estimate from."
        )
    if names == ("",):
        raise ParameterError(
            f"message {message.name} has one unit without a name, but '{label}' was asked for; leave it out."
        )
    listed = ", ".join(f"{name} ({number})" for number, name in enumerate(names, 1))
    got = f"but '{label}' was asked for" if label else "and none was named"
    how = f'name one, as --unit {names[0]} or unit = "{names[0]}" in [format]'
    raise ParameterError(f"message {message.name} has the units {listed}, {got}; {how}.")


def unit_temperature(frames: Frames, unit: str = "") -> Floats | None:
    """Temperature (N,) of a unit, °C; None where the message has none."""
    column = frames.columns.get(_name(unit, "temp_c"))
    return None if column is None else np.asarray(column, dtype=np.float64)


def full_scales(message: Message, unit: str = "") -> dict[str, Floats]:
    """Full scale (3,) of each triad of a unit, in the units used inside: the greatest value of each axis both ways.

    An axis that the message lacks takes the largest of the others. A triad with an axis of floating point, of which
    the message knows no largest value, is left out.
    """
    fields = {f.name: f for f in message.fields}
    scales: dict[str, Floats] = {}
    for triad in TRIADS:
        axes = [fields.get(name) for name in _axis_names(unit, triad)]
        present = [f for f in axes if f is not None]
        if present and all(f.type[0] != "f" for f in present):
            largest = max(f.full_scale for f in present)
            scales[triad] = np.array([largest if f is None else f.full_scale for f in axes])
    return scales


def values_by_field(imu: ImuData, message: Message, unit: str = "") -> dict[str, Floats]:
    """Values by field of what a recording has and a unit of the message carries, for `encode.encode`."""
    values: Mapping[str, Floats | None] = {"temp_c": imu.temp_c} | {
        f"{triad}.{axis}": None if getattr(imu, triad) is None else getattr(imu, triad)[:, i]
        for triad in TRIADS
        for i, axis in enumerate(_AXES)
    }
    wanted = {f.name for f in message.fields if f.physical}
    named = {_name(unit, *name.split(".")): value for name, value in values.items()}
    return {name: value for name, value in named.items() if value is not None and name in wanted}


def _name(*parts: str) -> str:
    return ".".join(part for part in parts if part)
