"""Text lines as a live format: a profile says what they are, and the functions that read a file read them row by row.

A line counts once its end has come, so that it does not matter how the bytes were cut; the last one counts as a file's
last line does. A line that cannot be read is left out, counted and named. Time goes on where a counter comes round, a
clock begins again (by the time that passed at the host) or stamps repeat (spread over their tick); a stamp far from its
neighbours waits for the next one, which says whether it was wrong. Sensors with rows of their own are joined at the
row of the gyroscope that is nearest in time, as `plumbob.files.foreign.logged` joins slower ones.
"""

import re
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from itertools import chain
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import units
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.findings import Finding, warning
from plumbob.core.time import GAP_FACTOR
from plumbob.data import TRIADS
from plumbob.data.cards import UNITS
from plumbob.files import text_table
from plumbob.files.columns import stamps_ns
from plumbob.files.profile import JSON, Profile
from plumbob.files.stamps import WEEK, turn_lengths
from plumbob.files.text import inside, reference_attitudes, row_flags, to_vectors
from plumbob.protocols.decode import Counts, Decoder, Frames, Ints
from plumbob.protocols.field import Field
from plumbob.protocols.format import Format, Framing, Message
from plumbob.protocols.scan import Reads

CLOCK: Final = "t_ns"  # field with the time of the device
_ATTITUDE: Final = ("qw", "qx", "qy", "qz")
_LINE: Final = re.compile(rb"([^\r\n]+)[\r\n]+")
_WORD: Final = (1 << 62) - 1  # bits of a clock that are looked at
_MOST_BYTES: Final = 1 << 16  # bytes without a line end that are waited for; no logger writes such a row
_REMEMBERED: Final = 20  # rows that tell whether the last one was cut, as of a file
_MOST_JOINED: Final = 512  # lines of which one row may be made
_ALL_ODD: Final = 8
_MEMORY: Final = 16


@dataclass(frozen=True, slots=True)
class LineFormat(Format):
    """Format of text lines."""

    profile: Profile | None = None  # what they mean
    # whether the source may begin within a line, as a serial port does, so that what comes before the first line end is
    # left out
    midway: bool = False


def line_format(profile: Profile, *, midway: bool) -> LineFormat:
    """Format of the lines that a profile describes; ParameterError where it needs a whole file, or has no sensor."""
    parts = [part for _, part in profile.streams] or [profile]
    triads = [name for name in TRIADS if any(name in part.triads for part in parts)]
    encodings = {part.layout.encoding for part in parts}
    for_files = {
        f"the encoding {min(encodings)}": any("\n".encode(name) != b"\n" for name in encodings),
        "header.channels": any(part.layout.channels for part in parts),
        "[flags] of words": any(part.flag_words for part in parts),
        "delay of a sensor": any(group.delay for part in parts for group in part.triads.values()),
        "[time] of dates in turns": len({(part.time.are_stamps, part.time.rate > 0.0) for part in parts}) > 1,
        "arrays = true": profile.arrays,
    }
    if word := next((word for word, needs_file in for_files.items() if needs_file), ""):
        raise ParameterError(f"{profile.origin}: {word} is for files; leave it out for a line.")
    names = [(f"{name}.{axis}", UNITS[name]) for name in triads for axis in "xyz"]
    names += [("temp_c", "degC")] * any(part.temperature is not None for part in parts)
    names += [(name, "1") for name in _ATTITUDE] * any(part.reference is not None for part in parts)
    fields = [Field(name, 0, "f64", 8, unit=unit) for name, unit in names]
    rate = parts[0].time.rate or None
    if rate is None:
        fields.append(Field(CLOCK, 0, "s64", 8, unit="ns", role="clock"))
    name = str(profile.meta.get("device", profile.origin.partition(".")[0]))
    messages = (Message(name, 0, tuple(fields)),)
    title, framing = f"text lines of {profile.origin}", Framing(rate=rate)
    return LineFormat(name, title, framing, messages, profile=profile, midway=midway)


def described_imu(form: Format) -> dict[str, Any]:
    """What the profile of lines says of the sensors, by the keys of ``[imu]`` in a session."""
    profile = form.profile if isinstance(form, LineFormat) else None
    if profile is None:
        return {}
    said = {key: profile.meta.get(key) for key in ("device", "frame", "declination")}
    said |= {"axes": profile.turn, "place": profile.place, "date": profile.date}
    return {key: value for key, value in said.items() if value is not None}


def decoder_of(form: Format) -> "Decoder | LineDecoder":
    """Decoder of a format, of bytes or of lines."""
    return LineDecoder(form) if isinstance(form, LineFormat) else Decoder(form)


class _TextRow(NamedTuple):
    """A sample: its first byte in the stream, the host's and the device's time, ns, flags, sensor and values (K,)."""

    start: int
    host_ns: int
    t_ns: int
    flags: int
    sensor: int
    values: Floats


class _ProfileRows:
    """Rows of one profile."""

    def __init__(self, profile: Profile, message: Message) -> None:
        self.profile, self.layout = profile, profile.layout
        self._names: tuple[str, ...] = ()
        refs = () if self.layout.separator == JSON else (*profile.used, *self.layout.where[:1])
        self._wanted = {ref for ref in refs if isinstance(ref, str)}
        self._columns = {f.name: i for i, f in enumerate(f for f in message.fields if f.physical)}
        exact = profile.time.columns[0] if profile.time.unit else None
        self._reading = text_table.Reading(self.layout, 0, {}, exact, {ref: [] for ref in profile.texts})
        self._numbers: dict[Any, list[float]] = {}
        self._lines: list[tuple[int, int]] = []
        self._widths: Counter[int] = Counter()
        self._first: float | None = None
        self._rows = 0
        self._clock_times: list[int] = []
        self.recent: deque[str] = deque(maxlen=_REMEMBERED)

    def fits(self, row: str) -> bool:
        """Whether a row is of this profile."""
        where = self.layout.where
        return not (where and isinstance(where[0], str) and not self._names) and text_table.belongs(
            row, self._names, self.layout
        )

    def take(self, row: str, number: int, start: int, host_ns: int) -> bool:
        """Take a row of numbers, and tell whether it was one; a row of names is none."""
        cells = self._cells(row, number)
        if self._wanted and self._wanted <= (names := {cell.strip() for cell in cells}) and len(names) == len(cells):
            self._names, self._widths = tuple(cell.strip() for cell in cells), Counter()
            self._reading.places = {}
            return False
        if self._wanted and not self._names:
            raise DecodeError(f"line {number}: the row of names has not come; number the columns in the profile.")
        reading, width = self._reading, len(cells)
        usual, many = self._widths.most_common(1)[0] if self._widths else (width, 0)
        if width != usual and self._widths[width] + 1 < many:
            raise DecodeError(f"line {number} has {width} cells, but most rows of numbers have {usual}.")
        if width != reading.width or not reading.places:
            refs = dict.fromkeys(self.profile.used)
            places = {ref: text_table.column_index(ref, self._names, width, self.layout) for ref in refs}
            reading = replace(reading, width=width, places=places)
        numbers = {ref: self._numbers.setdefault(ref, []) for ref in reading.places if ref not in reading.texts}
        time = self.profile.time
        if time.are_stamps:
            stamp = stamps_ns([" ".join(cells[reading.places[ref]] for ref in time.columns)], time.zone)[0]
        reading.add(cells, number, numbers)
        self._clock_times += stamp if time.are_stamps else []
        self._widths[width] += 1
        self._reading = reading
        self._lines.append((start, host_ns))
        self.recent.append(row)
        return True

    def _cells(self, row: str, number: int) -> list[str]:
        layout = self.layout
        if layout.separator == JSON:
            cells = text_table.object_cells(row, number)
            if tuple(cells) != self._names:
                self._names, self._reading.places = tuple(cells), {}
            return list(cells.values())
        return text_table.row_cells(row, layout, number)

    def rows(self, sensor: int) -> Iterator[_TextRow]:
        """What was taken since the last call, as of the sensor of that number."""
        if not self._lines:
            return
        reading, profile, count = self._reading, self.profile, len(self._lines)
        columns = {ref: np.array(some) for ref, some in self._numbers.items()}
        table = text_table.TextTable(columns, reading.zero or Decimal(0), count, (), reading.texts, lambda row: row)
        values = np.full((count, len(self._columns)), np.nan)
        for name, group in profile.triads.items():
            at = self._columns[f"{name}.x"]
            values[:, at : at + 3] = to_vectors(group, table, None)
        if (warmth := profile.temperature) is not None:
            values[:, self._columns["temp_c"]] = inside(table.columns[warmth.columns[0]], warmth.unit)
        if profile.reference is not None:
            at = self._columns[_ATTITUDE[0]]
            values[:, at : at + 4] = reference_attitudes(profile.reference, table, profile.turn)
        words, stamps = row_flags(profile, table), self._stamps(table)
        flags = [0] * count if words is None else np.asarray(words).astype(np.uint32).tolist()
        lines, self._lines, self._numbers = self._lines, [], {}
        self._reading = replace(reading, texts={ref: [] for ref in reading.texts})
        for (start, host_ns), t_ns, row, word in zip(lines, stamps, values, flags, strict=True):
            yield _TextRow(start, host_ns, t_ns, word, sensor, row)

    def _stamps(self, table: text_table.TextTable) -> list[int]:
        """Times by the device, ns, of an origin that is one for all."""
        source = self.profile.time
        if source.rate:
            first, self._rows = self._rows, self._rows + table.rows
            return [round(row * 1e9 / source.rate) for row in range(first, self._rows)]
        if source.are_stamps:
            stamps, self._clock_times = self._clock_times, []
            return stamps
        ns = table.columns[source.columns[0]] * self.unit_ns
        larger = source.seconds if source.week is None else source.week
        if larger is not None:
            counts = table.columns[larger]
            self._first = float(counts[0]) if self._first is None else self._first
            ns = ns + (counts - self._first) * (1e9 * (1 if source.week is None else WEEK))
        origin = round(Fraction(table.zero) * Fraction(self.unit_ns).limit_denominator(10**9))
        return [origin + int(t_ns) for t_ns in np.rint(np.nan_to_num(ns)).tolist()]

    @property
    def unit_ns(self) -> float:
        """What a count of the clock is, ns."""
        source = self.profile.time
        return 1e9 * units.unit(source.unit).factor * source.unit_per_count if source.unit else 1.0


class _TextClock:
    """A time that goes on, of stamps that repeat, come round or begin again."""

    def __init__(self, rows: _ProfileRows, *, spread: bool) -> None:
        self._rows, self._spread = rows, spread
        self._last: int | None = None
        self._host_ns = self._ahead = self._at_once = self._odd = 0
        self._before, self._largest, self._typical, self._tick = 1, 0, 0.0, 0
        self._held: _TextRow | None = None
        self.again = self.off = self.turned = 0
        self.turned_at = ""

    def take(self, row: _TextRow) -> list[_TextRow]:
        """Rows whose time is known now."""
        if self._last is None:
            return [self._go(row)]
        out, held, self._held = list[_TextRow](), self._held, None
        if held is not None:
            if self._follows(self._last, row) and not self._follows(held.t_ns, row):
                self.off += 1
            else:
                out.append(self._go(held))
        step = row.t_ns - self._last
        if self._typical and not -self._room <= step <= self._room and not self._comes_round(step):
            self._held = row
            return out
        return [*out, self._go(row)]

    def finish(self) -> list[_TextRow]:
        """The row that waits, where one does."""
        held, self._held = self._held, None
        return [] if held is None else [self._go(held)]

    @property
    def _room(self) -> float:
        return GAP_FACTOR * self._typical

    def _follows(self, t_ns: int, row: _TextRow) -> bool:
        return bool(0 <= row.t_ns - t_ns <= self._room)

    def _comes_round(self, step: int) -> bool:
        """Whether a step back is that of a counter which begins again; then it goes on."""
        unit = self._rows.unit_ns
        lengths = turn_lengths(np.inf if self._largest % unit else self._largest / unit, unit)
        for name, length in lengths.items():
            turn = round(length * unit)
            if self._last is not None and 0 < step + turn <= self._room:
                self._ahead, self._last = self._ahead + turn, self._last - turn
                self.turned, self.turned_at = self.turned + 1, name
                return True
        return False

    def _go(self, row: _TextRow) -> _TextRow:
        step = 0 if self._last is None else row.t_ns - self._last
        if self._typical and step < -self._room:  # it has begun again
            self.again += 1
            passed = max(row.host_ns - self._host_ns, round(self._typical))
            self._ahead += passed - step
            self._largest = 0
        elif step > 0:
            self._learn(step)
        if step or self._last is None:
            self._before, self._at_once = self._at_once + 1, 0
        else:
            self._at_once += 1
        k, n = self._at_once, self._before
        within = (k / n if k < n else k / (k + 1)) if self._spread else 0.0
        if self._last is None or step >= 0 or step < -self._room:
            self._last, self._host_ns = row.t_ns, row.host_ns
        self._largest = max(self._largest, row.t_ns)
        return row._replace(t_ns=row.t_ns + self._ahead + int(within * self._tick))

    def _learn(self, step: int) -> None:
        self._tick = min(self._tick or step, step)
        if self._typical and step > self._room and self._odd < _ALL_ODD:
            self._odd += 1
            return
        is_new = not self._typical or self._odd == _ALL_ODD
        self._odd, self._typical = 0, float(step) if is_new else self._typical + (step - self._typical) / _MEMORY


class _Join:
    """Rows of the leading sensor, with what others said nearest to each; a row goes on when the next one comes."""

    def __init__(self, lead: int) -> None:
        self._lead = lead
        self._rows: list[_TextRow] = []
        self._loose: list[_TextRow] = []
        self._step = 0

    def take(self, row: _TextRow) -> list[_TextRow]:
        """Rows that are whole now."""
        if row.sensor != self._lead:
            if self._rows and row.t_ns <= self._rows[-1].t_ns:
                self._give(row)
            else:
                self._loose.append(row)
            return []
        self._rows.append(row)
        loose, self._loose = self._loose, []
        for other in loose:
            self._give(other)
        complete, self._rows = self._rows[:-1], self._rows[-1:]
        self._step = row.t_ns - complete[-1].t_ns if complete else self._step
        return complete

    def finish(self) -> list[_TextRow]:
        """What waits."""
        for other in self._loose:
            self._give(other)
        rows, self._rows, self._loose = self._rows, [], []
        return rows

    def _give(self, other: _TextRow) -> None:
        if not self._rows:
            return
        row = min(self._rows, key=lambda row: abs(row.t_ns - other.t_ns))
        if not self._step or abs(row.t_ns - other.t_ns) <= GAP_FACTOR * self._step:
            np.copyto(row.values, other.values, where=np.isfinite(other.values))


class LineDecoder:
    """Decodes lines in any cutting: what `Decoder` is for frames."""

    def __init__(self, form: LineFormat) -> None:
        assert form.profile is not None
        self.form, self._message = form, form.messages[0]
        self.counts = Counts(frames={self._message.name: 0})
        parts = [part for _, part in form.profile.streams] or [form.profile]
        self._sensors = [_ProfileRows(part, self._message) for part in parts]
        self._joining = next(filter(None, (text_table.joining(part.layout) for part in parts)), None)
        is_timed = self._message.of_role("clock") is not None
        self._clock = _TextClock(self._sensors[0], spread=len(parts) == 1) if is_timed else None
        lead = next((i for i, part in enumerate(parts) if "gyr" in part.triads), 0)
        self._join = _Join(lead) if len(parts) > 1 else None
        self._reads, self._pending, self._done = Reads(), b"", 0
        self._lines = self._left_out = 0
        self._error, self._midway = "", form.midway
        self._bad_lines: list[int] = []

    @property
    def notes(self) -> tuple[Finding, ...]:
        """What was left out, and what the clock did."""
        clock, error = self._clock, self._error or "a time stamp is far off those around it"
        count, findings = self._left_out + (clock.off if clock else 0), list[Finding]()
        if count:
            findings.append(text_table.lines_left_out(self._bad_lines, count, self._lines, error))
        if clock and clock.turned:
            findings.append(warning("reading.clock_turned", at=clock.turned_at, count=clock.turned))
        if clock and clock.again:
            findings.append(warning("reading.clock_again", count=clock.again))
        return tuple(findings)

    def feed(self, data: bytes, t_ns: int = 0) -> dict[str, Frames]:
        """Take bytes, and return the rows that they complete, as of `Decoder.feed`."""
        data = bytes(data)
        if data:
            self._reads.add(self._done + len(self._pending), t_ns)
        self.counts.received += len(data)
        self._pending += data
        end = max(self._pending.rfind(b"\n"), self._pending.rfind(b"\r")) + 1
        end = len(self._pending) if not end and len(self._pending) > _MOST_BYTES else end
        return self._frames(self._taken(self._closed(end)))

    def finish(self) -> dict[str, Frames]:
        """Say that the stream has ended, or was interrupted: the last line counts unless it is cut."""
        if self._pending:
            layout, rows = self._sensors[0].layout, [row for sensor in self._sensors for row in sensor.recent]
            text = "\n".join([*rows, self._pending.decode(layout.encoding, "replace")])
            if rows and not text_table.ended(text, layout)[1]:
                self._pending += b"\n"
            else:
                self.counts.junk += len(self._pending)
        samples = self._taken(len(self._pending))
        samples += self._joined(self._clock.finish() if self._clock else [])
        self._midway = self.form.midway
        return self._frames([*samples, *(self._join.finish() if self._join else [])])

    def _closed(self, end: int) -> int:
        """Where what is pending up to a byte ends without lines to which others may be joined."""
        if self._joining is None:
            return end
        lines = [*_LINE.finditer(self._pending[:end])][-_MOST_JOINED:]
        closed = (line for line in reversed(lines) if not self._joining.is_open(line[1].decode("latin-1")))
        return next((line.end() for line in closed), lines[0].start() if lines else end)

    def _taken(self, end: int) -> list[_TextRow]:
        """Samples of the lines up to a byte of what is pending."""
        part, self._pending = self._pending[:end], self._pending[end:]
        lines = [*_LINE.finditer(part)]
        text = b"\n".join(line[1] for line in lines)
        if self._joining:
            coding = self._sensors[0].layout.encoding, "surrogateescape"
            text = self._joining.join(text.decode(*coding)).encode(*coding)
        for line, row in zip(lines, text.split(b"\n"), strict=False):
            self._lines += 1
            if not self._line(row, self._done + line.start()) and row:
                self.counts.junk += len(line[0])
        rows = sorted(chain.from_iterable(sensor.rows(i) for i, sensor in enumerate(self._sensors)))
        self._done += len(part)
        self._reads.forget(self._done)
        self.counts.pending = len(self._pending)
        self.counts.framed = max(self.counts.received - self.counts.junk - self.counts.pending, 0)
        return self._joined(chain.from_iterable(map(self._clock.take, rows)) if self._clock else rows)

    def _joined(self, rows: Iterable[_TextRow]) -> list[_TextRow]:
        return [*(chain.from_iterable(map(self._join.take, rows)) if self._join else rows)]

    def _line(self, line: bytes, start: int) -> bool:
        """Take a line, and tell whether it was a row of numbers."""
        midway, self._midway = self._midway, False
        try:
            row = text_table.decode(line, self._sensors[0].layout.encoding)
            if midway or text_table.is_idle(row, self._sensors[0].layout.comment):
                return False
            sensor = next((sensor for sensor in self._sensors if sensor.fits(row)), None)
            host_ns = int(self._reads.times(np.array([start]))[0])
            return sensor is not None and sensor.take(row, self._lines, start, host_ns)
        except DecodeError as error:
            self._left_out += 1
            self.counts.bad_content += 1
            self._error = self._error or str(error)
            self._bad_lines += [self._lines] if len(self._bad_lines) < text_table.MOST_NAMED else []
            return False

    def _frames(self, rows: list[_TextRow]) -> dict[str, Frames]:
        if not rows:
            return {}
        self.counts.frames[self._message.name] += len(rows)
        words = [(row.start, row.host_ns, row.t_ns & _WORD, row.flags) for row in rows]
        start, host_ns, t_ns, flags = np.array(words, dtype=np.int64).T
        table = np.array([row.values for row in rows])
        return {self._message.name: _frames(self._message, start, host_ns, t_ns, table, flags)}


def blank_frames(message: Message) -> Frames:
    """A row of zeros, which shows what the rows of a message have."""
    none, fields = np.zeros(1, dtype=np.int64), sum(f.physical for f in message.fields)
    return _frames(message, none, none, none, np.zeros((1, fields)), none)


def _frames(message: Message, start: Ints, host_ns: Ints, t_ns: Ints, table: Floats, flags: Ints) -> Frames:
    columns: dict[str, NDArray[Any]] = {f.name: table[:, i] for i, f in enumerate(message.fields) if f.physical}
    columns |= {} if message.of_role("clock") is None else {CLOCK: t_ns}
    return Frames(message, start, host_ns, columns, {"": flags.astype(np.uint32)})
