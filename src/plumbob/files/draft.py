"""Draft the profile of an unknown text file: what its names and first numbers suggest, each guess as a question.

A guess begins with ``?``. A profile with questions is refused, so that nothing is guessed behind anyone's back. What
is certain: the layout, which every row confirms, and units that the header states in brackets and the numbers do not
contradict.
"""

import json
import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from fractions import Fraction
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import ARRAYS, existing_file, reading, write_text
from plumbob.core.text import FactsText
from plumbob.core.units import QUANTITY_BY_TRIAD, UNITS, Quantity, is_name, to_si
from plumbob.data import TITLES, TRIADS
from plumbob.files import evidence
from plumbob.files.arrow import text_bytes
from plumbob.files.column_names import TABLES, WEEK, ColumnName, canonical, measured_in, named_sensor, taken_apart
from plumbob.files.columns import FORM, has_zone
from plumbob.files.evidence import RELATIVE, TURNED, ColumnEvidence, Guess, field_unit, gravity_unit, single_line
from plumbob.files.known_logs import KNOWN, refuse_known
from plumbob.files.profile import AS_MOUNTED, EPOCHS, GUIDE, JSON, Profile, TextLayout, parse_profile
from plumbob.files.sniff import FEWEST, READ, Sample, read_sample, rises
from plumbob.files.stamps import CENTURY
from plumbob.files.text_table import LEFT_OUT_MOST, read_table
from plumbob.rotations import axes_letters, signed_axes

_HEAD: Final = 1 << 16  # bytes in which a log that is known has its names
_MOST_SENSORS: Final = 20
_USUAL: Final = TextLayout(separator=",")
_COUNTS: Final = "counts_per_unit"
_EVEN: Final = 0.2  # how far steps of a column without a name are off their median, in steps, where it is a clock


@dataclass(frozen=True, repr=False)
class Draft(FactsText):
    """Draft of a profile."""

    text: str  # the profile, TOML
    questions: tuple[tuple[str, str], ...]  # keys that a person must answer, each with what speaks for the guess
    # keys that were taken because the file says so, each with why; only where guesses are accepted
    evidence: tuple[tuple[str, str], ...] = ()

    def facts(self) -> Mapping[str, str]:
        """Keys that a person must answer."""
        return {"questions": ", ".join(key for key, _ in self.questions) or "none"}

    def summary(self) -> dict[str, Any]:
        """As JSON has it: open questions and what was taken, by their dotted keys."""
        return {"questions": dict(self.questions), "evidence": dict(self.evidence)}


def drafted(
    files: Sequence[Path],
    *,
    accept: bool = False,
    answers: Mapping[str, Any] | None = None,
    out: str | os.PathLike[str] | None = None,
    heard: float | None = None,
) -> Draft:
    """Draft of files that are there, as of `plumbob.profile`, or of a line that was `heard` for some seconds."""
    if out is not None and Path(out).exists():
        raise ParameterError(f"{out} exists already; answer its questions, or name another file with --out.")
    streams: list[ColumnEvidence] = []
    for file in files:
        refuse_known(file)
        with reading(file):
            if file.suffix.lower() in ARRAYS:
                from plumbob.files.foreign.tables import array_sample

                sample = array_sample(file)
            else:
                sample = read_sample(file)
                sample = sample if heard is None else _of_line(sample, heard, file.stat().st_size)
            streams += _column_evidence(file.name, sample, dict(answers or {}), is_alone=len(files) == 1)
    with reading(files[0]):
        draft = _joined(streams, accept)
        if accept and not draft.questions:
            parse_profile(draft.text)
    if out is not None and not (accept and draft.questions):
        write_text(out, draft.text)
    return draft


_ARRIVAL: Final = "rate of arrival"


def _of_line(sample: Sample, heard: float, size: int) -> Sample:
    """The same with the rate at which rows came, and without what stands before a table: who listens may come after it.

    It was heard for so many seconds and bytes.
    """
    if heard > 0.0 and (rate := len(sample.rows) * max(size / READ, 1.0) / heard):
        sample = replace(sample, facts={**sample.facts, _ARRIVAL: f"{rate:.3g} Hz"})
    if sample.layout.separator == JSON:
        return sample
    layout = replace(sample.layout, names=False, skip=0, after_names=0, marker="", occurrence=1, end="", mark="")
    others = tuple(_of_line(other, heard, size) for other in sample.others)
    return replace(sample, layout=layout, by_name=False, others=others)


def known_profile(file: Path) -> Profile | None:
    """Profile of a text log that is known by its names, where nothing stays to be asked, its frame neither; or None."""
    with reading(file):
        start = text_bytes(file, _HEAD).decode("utf-8", "replace").replace("\0", "")  # also of two bytes a letter
        if not any(log.is_named_in(start) for log in KNOWN):
            return None
        try:
            sample = read_sample(file)
        except DecodeError:
            return None
        log = next((log for log in KNOWN if not log.has_reader and log.fits(sample.names, sample.facts)), None)
        made = _joined(_column_evidence(file.name, sample, {}, is_alone=True), accept=True) if log else None
        parsed = parse_profile(made.text, origin=log.name) if log and made and not made.questions else None
        return parsed if parsed is not None and ("frame" in parsed.meta or not parsed.triads) else None


_DEVICE: Final = re.compile(
    r"\b(i|s?id|instance|device|addr(ess)?|mac|node|serial|sensor|imu|unit|tag|name|station)( (type|no|nr|number))?$"
)
_NINE: Final = {"acc": 0, "gyr": 3, "mag": 6}  # where the triads begin in lines of nine, as MotionCal has them


def read_triples(path: str | Path, sensor: str) -> Floats:
    """Triples (N, 3) of a sensor in a text, in the unit that they have there; DecodeError if it has no such columns."""
    file = existing_file(path)
    with reading(file):
        sample = read_sample(file)
        numbers = [i for i in range(sample.width) if np.isfinite(sample.numbers(i)).all()]
        named = {part.axis: i for i, part in enumerate(sample.parts) if part.sensor == sensor}
        columns = [named[axis] for axis in "xyz"] if set("xyz") <= set(named) else numbers
        if len(columns) == len(QUANTITY_BY_TRIAD) * len("xyz") and not any(part.sensor for part in sample.parts):
            columns = numbers[_NINE[sensor] :][: len("xyz")]
        if len(columns) != len("xyz"):
            raise DecodeError(
                f"it has {len(numbers)} columns of numbers, and no names say which three are the {TITLES[sensor]}'s; "
                "leave three."
            )
        refs = [i + 1 for i in columns]
        table = read_table(file, sample.layout, refs)
        return np.stack([table.columns[ref] for ref in refs], axis=1)


def answer(text: str) -> tuple[str, Any]:
    """Key and value of an answer as ``gyr.unit=deg/s``; lists and numbers as TOML has them, other text bare."""
    key, equals, value = text.partition("=")
    if not equals or not re.fullmatch(r"[a-z_0-9.]+|rows\..+", key.strip()):
        raise ParameterError(f"an answer must be KEY=VALUE, as frame=ENU or time.rate='100 Hz', but it is {text!r}.")
    for written in (value, f"[{value}]") if key.strip().endswith(("columns", "plus")) else (value,):
        with suppress(tomllib.TOMLDecodeError):
            return key.strip(), tomllib.loads(f"value = {written}")["value"]
    return key.strip(), value.strip()


def _joined(streams: Sequence[ColumnEvidence], accept: bool) -> Draft:
    """One draft of all streams; each answer is for every stream that has its key."""
    forces = [stream for stream in streams if "acc" in stream.triads]
    is_turned = any("gyr" in stream.triads for stream in streams)
    for stream in streams:
        if len(forces) == 1 and not is_turned:
            stream.take_rates(forces[0])
        stream.turn_as(forces[0] if len(forces) == 1 else stream)
    measuring = [stream for stream in streams if stream.triads] or streams[:1]
    idle = [stream for stream in streams if stream not in measuring]
    idle_names = [name for stream in idle for name, part in zip(stream.names, stream.parts, strict=True) if part.sensor]
    drafts = [_DraftWriter(stream, accept, idle_names * (stream is measuring[0])).draft() for stream in measuring]
    questions = dict.fromkeys(question for draft in drafts for question in draft.questions)
    facts = dict.fromkeys(fact for draft in drafts for fact in draft.evidence)
    return Draft("\n".join(draft.text for draft in drafts), tuple(questions), tuple(facts))


def _column_evidence(name: str, sample: Sample, answers: Mapping[str, Any], *, is_alone: bool) -> list[ColumnEvidence]:
    """Evidence of the columns of a file: for each sensor, where the rows of a file that is alone name them."""
    tables = _by_clock(sample)
    sample = tables[0] if tables else sample
    stream, parts = ("", tables if len(tables) > 1 else _by_sensor(sample, answers)) if is_alone else (name, [])
    if not parts and (device := _device(sample)):
        column, words = device
        ref, where = sample.ref(column), tuple(answers.get("header.where", ()))
        if where not in {(ref, word) for word in words}:
            raise DecodeError(
                f"its rows are of {len(words)} devices or sensors, which column {ref!r} names: {', '.join(words)}. "
                f"Choose one, as with --set 'header.where={json.dumps([ref, words[0]])}', or name the sensor of each, "
                f"as with --set 'rows.{words[0]}=acc' --set 'rows.{words[1]}=gyr'."
            )
        sample = _matching_rows(sample, column, where[1])
    stream = stream or ("*" if parts else "")
    return [ColumnEvidence(name, part, stream=stream, answers=answers) for part in parts or [sample]]


def _by_clock(sample: Sample) -> list[Sample]:
    """Tables with sensors that stand side by side, each behind a clock of a rate of its own; or nothing."""
    names, units, parts = sample.for_cells(sample.names), sample.for_cells(sample.units), sample.parts
    steps: dict[int, float] = {}  # of clocks, which go on to their last row
    for i, part in enumerate(parts):
        clock = sample.numbers(i) if part.is_time and part.unit else np.empty(0)
        clock, rest = np.split(clock, [np.isfinite(clock).sum()])
        if np.isnan(rest).all() and rises(clock):
            steps[i] = float((clock[-1] - clock[0]) / (clock.size - 1))
    tables: dict[str, set[int]] = {}
    for start, end in pairwise((*steps, sample.width)):
        tables.setdefault(f"{steps[start]:.2g}", set()).update(range(start, end))
    if len(tables) < 2 or len({parts[i].unit for i in steps}) > 1:
        return []
    return [
        replace(
            sample,
            names=tuple(name if i in table else "" for i, name in enumerate(names)),
            units=tuple(unit if i in table else "" for i, unit in enumerate(units)),
            by_name=False,
            rows=[row for row in sample.rows if row[min(table)].strip()],
        )
        for table in tables.values()
        if any(parts[i].sensor in TRIADS for i in table)
    ]


def _by_sensor(sample: Sample, answers: Mapping[str, Any]) -> list[Sample]:
    """Rows of each sensor, where rows name it or answers say which rows are whose; or nothing."""
    if sample.others:
        return [sample, *sample.others]
    values = [i for i, part in enumerate(sample.parts) if part.axis and not (part.sensor or part.by_unit)]
    numeric = [i for i in range(sample.width) if np.isfinite(sample.numbers(i)).any()]
    values = values if any(sample.names) else numeric[-3:]
    for i in range(sample.width) if len(values) == len("xyz") else ():
        words = dict.fromkeys(sample.cells(i))
        if len(words) > _MOST_SENSORS:
            continue
        units = _android_units(sample, i, values) if i not in values else {}
        units = units or {word: (sensor, word) for word in words if (sensor := measured_in(word))}
        axes = [word for word in words if taken_apart(word).axis in {*"xyz"} and taken_apart(word).sensor]
        if len(axes) >= len("xyz"):
            raise DecodeError(f"a row holds several samples of an axis: {', '.join(axes)}. Write a row for each.")
        sensors = {word: units[word][0] if word in units else named_sensor(word) for word in words}
        sensors |= {word: answers[key] for word in words if (key := f"rows.{word}") in answers}
        sensors = {word: sensor for word, sensor in sensors.items() if sensor in TRIADS}
        if sensors and len(set(sensors.values())) == len(sensors):
            said = {word: tuple(unit * (k in values) for k in range(sample.width)) for word, (_, unit) in units.items()}
            return [
                replace(_matching_rows(sample, i, word), units=said.get(word, sample.units), sensor=sensor)
                for word, sensor in sensors.items()
            ]
    return []


def _matching_rows(sample: Sample, column: int, word: str) -> Sample:
    """The rows that have a word in a column."""
    layout = replace(sample.layout, where=(sample.ref(column), word))
    return replace(sample, layout=layout, rows=[row for row in sample.rows if row[column].strip() == word])


_ANDROID: Final = {"1": ("acc", "m/s2"), "2": ("mag", "uT"), "4": ("gyr", "rad/s")}  # [Android, SensorEvent]


def _android_units(sample: Sample, column: int, values: Sequence[int]) -> Mapping[str, tuple[str, str]]:
    """Sensors and units by word where a column has Android's types of sensors, and sizes are those of its units."""
    kinds = sample.cells(column)
    vectors = np.stack([sample.numbers(i) for i in values], axis=1)
    sizes = {word: np.linalg.norm(vectors[[kind == word for kind in kinds]], axis=1) for word in _ANDROID}
    medians = {word: float(np.median(size)) for word, size in sizes.items() if size.size}
    is_type = not sample.names or re.search(r"(?i)type|sensor", sample.for_cells(sample.names)[column])
    fits = {"1", "4"} <= set(medians) and all(map(str.isdigit, kinds)) and gravity_unit(medians["1"]).unit == "m/s2"
    field = medians.get("2")
    return _ANDROID if is_type and fits and (field is None or field_unit(field).unit == "uT") else {}


def _device(sample: Sample) -> tuple[int, tuple[str, ...]] | None:
    """Column that says of which of several devices a row is, and their words, where their rows stand in turns."""
    for i, name in enumerate(sample.for_cells(sample.names)):
        cells = sample.cells(i)
        words = tuple(dict.fromkeys(cells))
        named = _DEVICE.search(" ".join(re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)).lower()) and all(words)
        in_order = all(cell == words[k % len(words)] for k, cell in enumerate(cells))
        are_words = bool(np.isnan(sample.numbers(i)).all()) and cells[: 2 * len(words)] == [*words, *words]
        are_labels = not name and (are_words or (in_order and all(map(str.isdigit, words))))
        if not (named or are_labels) or not 1 < len(words) <= _MOST_SENSORS:
            continue
        places = [[k for k, cell in enumerate(cells) if cell == word] for word in words]
        in_turns = max(p[0] for p in places) < min(p[-1] for p in places)
        if in_turns and all(len(p) >= FEWEST for p in places):
            return i, words
    return None


class _DraftWriter:
    """Makes the text, key by key, and collects the questions."""

    def __init__(self, data: ColumnEvidence, accept: bool, idle_names: Sequence[str]) -> None:
        self._data, self._accept, self._idle_names = data, accept, idle_names
        self._lines: list[str] = []
        self._questions: list[tuple[str, str]] = []
        self._evidence: list[tuple[str, str]] = []
        self._table = ""

    def draft(self) -> Draft:
        """Write all tables."""
        data = self._data
        if not data.triads and not data.quaternion and not data.angles:
            linear = any(part.sensor == "linear" for part in data.parts)
            raise DecodeError(
                "the acceleration in it is without gravity, and there is no gyroscope: nothing in it can give an "
                "attitude. Record the raw accelerometer, which measures gravity too."
                if linear
                else f"where its sensors stand, the first {len(data.sample.rows)} rows hold zeros alone: begin the "
                "file where they measure."
                if any(data.threes(partial(evidence.may_be, name)) for name in TRIADS)
                else "it holds angles and velocities gained in each sample: divide them by its step, in radians and "
                "seconds, which gives rates and specific force."
                if any(re.search(r"\bd(elta)? ?(a|v|ang\w*|vel\w*|theta)\b", part.base) for part in data.parts)
                else "no three columns look like a gyroscope, an accelerometer or a magnetometer; name them, as with "
                "--set gyr.columns=1,2,3, angles about z, y and x, as with --set reference.columns=3,2,1, or write a "
                f"profile by hand ({GUIDE})."
            )
        if data.stream:
            self._lines += ["[[stream]]", f"file = {json.dumps(data.stream)}"]
        self._top()
        self._write_time()
        for name in (name for name in TRIADS if name in data.triads):
            self._write_triad(name, data.triads[name])
        if data.temperature is not None and data.triads:
            self._open("temperature")
            self._set("column", data.sample.ref(data.temperature), "the name of the column", ask=True, sure=True)
            self._write_unit(Quantity.TEMPERATURE, [data.temperature], data.usual_degc(data.temperature))
        if data.quaternion or (data.angles and not data.triads):  # beside samples, no two makers turn alike
            self._write_reference()
        return Draft("\n".join(self._lines) + "\n", tuple(self._questions), tuple(self._evidence))

    def _open(self, table: str) -> None:
        self._table = table
        self._lines += ["", f"[{'stream.' if self._data.stream else ''}{table}]"]

    def _set(self, key: str, value: object, why: str = "", *, ask: bool = False, sure: bool = False) -> None:
        """Write a key; a guess with the mark of a question, unless it is answered, or evidence for it is accepted."""
        data = self._data
        dotted = f"{self._table}.{key}".lstrip(".")
        if dotted in data.answers:
            value, why, ask = data.answers[dotted], "as answered", False
        elif dotted in data.log_answers:
            value, why, ask = data.log_answers[dotted], f"as of {data.log_name}", ask and not self._accept
        elif ask and sure and self._accept:
            ask = False
            self._evidence.append((dotted, why))
        if ask:
            guess = ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
            value = ["?", *value] if isinstance(value, tuple) else f"? {value}".rstrip()
            self._questions.append((dotted, f"{guess}? {why}".rstrip() if guess else why))
        text = json.dumps(list(value) if isinstance(value, tuple) else value, ensure_ascii=False)
        line = f"{key} = {text.replace(chr(127), '')}"
        self._lines.append(f"{line:<38}  # {single_line(why)}" if why else line)

    def _has(self, key: str) -> bool:
        """Whether a key of the open table is answered, or the known log says it."""
        dotted = f"{self._table}.{key}".lstrip(".")
        return dotted in self._data.answers or dotted in self._data.log_answers

    def _set_known(self, *keys: str) -> None:
        """Write those of the keys that are answered, or that the known log says."""
        for key in filter(self._has, keys):
            self._set(key, "")

    def _top(self) -> None:
        data = self._data
        layout = data.sample.layout
        if not data.stream:
            self._lines += [
                f"# Drafted by 'plumbob profile' from the first {len(data.sample.rows)} rows of "
                f"{single_line(data.name)}.",
                "# A '?' asks you: correct what stands behind it and delete the '?'; a number or true loses its",
                "# quotes. The file is read once no '?' is left. Every key: docs/file-formats.md.",
            ]
        if not layout.separator:
            self._set("arrays", True, "columns are those of named arrays")
        else:
            self._write_layout(layout)
        if self._has("frame") or not self._accept:
            self._set("frame", "", "ENU, NED or NWU: the frame of the attitude", ask=True)
        axes = "body x, y, z in the axes of the sensor case; left-handed ones: own-csv.md"
        self._set("axes", AS_MOUNTED, axes, ask=True, sure=True)
        self._set_known("north", "declination", "place", "date", "device", "unit_check", "rate_nominal")
        if "unix start" in data.sample.facts:
            start = round(Fraction(data.sample.facts["unix start"]) * 10**9)
            self._set("t0_ns", start, "the first line, since 1970 (UTC)")
        if not self._has("device") and not data.stream:
            name = "name of this unit: a calibration card belongs to one"
            self._lines.append(f'# device = "unit 1"                     # {name}')
        unused = [i for i in data.free() if i != data.temperature]
        sensors = [i for i in unused if self._accept and data.parts[i].sensor not in {"", "other"}]
        names, measured = ([data.names[i] or f"column {i + 1}" for i in some] for some in (unused, sensors))
        measured += self._idle_names
        if unused:
            self._lines.append(f"# Not used: {single_line(', '.join(names))}")
        if measured:
            self._set("notes", (f"columns that are not used: {single_line(', '.join(measured))}",))
        if layout.separator:
            self._write_header(layout)

    def _set_unusual(self, layout: TextLayout, **why: str) -> None:
        """Write those of the keys in which a layout is not the usual one."""
        for key, reason in why.items():
            if (value := getattr(layout, key)) != getattr(_USUAL, key):
                self._set(key, value, reason)

    def _write_layout(self, layout: TextLayout) -> None:
        separator = {"\t": "tab"}.get(layout.separator, layout.separator)
        self._set("separator", separator, f"{self._data.sample.width} columns")
        self._set("decimal", layout.decimal)
        self._set_unusual(layout, thousands="between groups of three digits")
        if layout.encoding != _USUAL.encoding:
            self._set("encoding", layout.encoding, "it is not UTF-8", ask=layout.encoding != "utf-16", sure=True)
        self._set_unusual(
            layout, comment="lines that begin so are left out", cells="vectors, and units behind the numbers",
            missing="cells without a value",
        )  # fmt: skip

    def _write_header(self, layout: TextLayout) -> None:
        self._open("header")
        self._set("names", layout.names, "" if layout.names else "no row of names: columns are numbered from 1")
        if layout.marker:
            self._set("marker", layout.marker, "the table begins behind this line")
            self._set("occurrence", layout.occurrence)
        self._set_unusual(
            layout, end="and ends before this one", skip=f"lines {'there' if layout.marker else 'at the top'}",
            after_names="the row of units", mark="before the names", words="numbers stand among words",
            checksum="of each row", channels="of each row: time, what names its channel, the number",
            where="rows of this kind alone",
        )  # fmt: skip

    def _write_time(self) -> None:
        data = self._data
        self._open("time")
        rate = data.sampling_rate()
        counts = rate and bool(data.time) and (np.diff(data.numbers[data.time[0]]) == 1.0).all()
        if "time.rate" in data.answers or not data.time or (counts and not data.parts[data.time[0]].unit):
            why = "the header says it" if rate else "no column increases like time: the sampling rate, as in '100 Hz'"
            why = "so many rows came" if rate and rate == data.sample.facts.get(_ARRIVAL) else why
            self._set("rate", rate, why, ask=True, sure=bool(rate))
            return
        refs = data.refs(data.time)
        if data.stamped:
            self._set("column" if len(refs) == 1 else "columns", refs[0] if len(refs) == 1 else refs)
            first = " ".join(data.stamps(i)[0] for i in data.time)
            self._set("format", FORM, f"the first is {first}")
            self._set_known("zone")
            if not self._has("zone") and not has_zone(first):
                self._lines.append('# zone = "+08:00"                      # what the clock is ahead of UTC, if known')
            return
        part, numbers = data.parts[data.time[0]], data.numbers[data.time[0]]
        steps = np.diff(numbers[np.isfinite(numbers)])
        usual = float(np.median(steps)) if steps.size else 0.0
        even = bool(np.mean(np.abs(steps - usual) < _EVEN * usual) > 1.0 - LEFT_OUT_MOST and usual != 1.0)
        self._set("column", refs[0], "it increases like time", ask=True, sure=part.is_time or even or len(refs) == 2)
        unit, why, sure = evidence.time_unit(numbers, part, float(rate.partition(" ")[0] or 0.0))
        if len(refs) == 2:
            unit, why, sure = data.part_of_second(data.time[0]), "it begins again at each second", True
        self._set("unit", unit, why, ask=not (part.stated and part.unit == unit), sure=sure)
        if len(refs) == 2:
            self._set("seconds", refs[1], "whole seconds, to which it is added", ask=True, sure=True)
        self._write_scale(part)
        weeks = [i for i, other in enumerate(data.parts) if WEEK.fullmatch(other.base) and "tow" in part.base]
        if weeks:
            self._set("week", data.sample.ref(weeks[0]), "the GPS week that the time is of", ask=True, sure=True)
        seconds = data.numbers[data.time[1]][0] if len(refs) == 2 else 0.0
        epoch = days if (days := evidence.days_since(numbers, part)) in EPOCHS else "unix"
        since = seconds + to_si(float(numbers[0]) - EPOCHS[epoch], unit) if unit and not weeks else 0.0
        if CENTURY[0] < since < CENTURY[1]:
            start = datetime.fromtimestamp(since, UTC)
            why = f"since {'1970' if epoch == 'unix' else 'day 0'} (UTC): the first is {start:%Y-%m-%d %H:%M:%S}"
            self._set("epoch", epoch, why, ask=True, sure=True)

    def _write_reference(self) -> None:
        """Write the attitude that stands beside, or alone."""
        data = self._data
        frame = data.answers.get("reference.frame") or data.answers.get("frame")
        if data.triads and self._accept and frame is None and "reference.frame" not in data.log_answers:
            return  # an attitude in no known frame is nothing that could be compared with
        self._open("reference")
        columns = data.refs(data.quaternion or data.angles)
        what = "unit quaternions" if data.quaternion else "angles about z, y and x"
        self._set("columns", columns, f"{what}, by their names", ask=True, sure=True)
        self._set("order", "wxyz" if data.quaternion else " ".join(evidence.ANGLES))
        if not data.quaternion:
            unit = data.parts[data.angles[0]].unit_as(Quantity.ANGLE)
            largest = float(np.nanmax(np.abs(data.vectors(data.angles))))
            beyond = largest > 2.0 * np.pi
            why = f"the header says {unit}" if unit else f"the largest is {largest:.4g}"
            self._set("unit", unit or ("deg" if beyond else ""), why, ask=not unit, sure=beyond)
        self._set("frame", frame or "", "ENU, NED or NWU: what the quaternion turns to", ask=True, sure=bool(frame))
        self._set("north", "free", "what its heading counts from; free claims nothing", ask=True, sure=True)
        self._set("of", "case", "of the sensor case, or of the body", ask=False)
        self._set_known("source")

    def _write_triad(self, name: str, columns: tuple[int, ...]) -> None:
        data = self._data
        self._open(name)
        part = data.parts[columns[0]]
        is_file_of_it = data.sensor == name and len(data.triads) == 1
        named = is_file_of_it or (bool(part.axis) and bool(part.sensor or part.by_unit))
        by = "by their names" if named else "by their size or turning; [] if they are none"
        turns = name == "gyr" and data.turns[1] is not None and data.turns[1].tells
        sure = named or (turns and not data.is_reassigned) or data.is_sure_by_size()
        sure = sure and (named or name != "mag" or min(map(data.spread, data.triads.values())) > TURNED)
        self._set("columns", data.refs(columns), f"x, y, z of the {TITLES[name]}, {by}", ask=True, sure=sure)
        if name == "acc" and data.plus:
            self._set("plus", data.refs(data.plus), "gravity, which these lack", ask=True, sure=True)
        zero = data.middle(columns)
        guess = self._sized_unit(name, columns, zero)
        if scale := self._stated_scale(name):
            unit, key, number = scale
            sure = self._scales_fit()
            for key_, value in (("unit", unit), (key, number)):
                self._set(key_, value, "the lines above say it", ask=True, sure=sure)
        stated = not scale and self._write_unit(QUANTITY_BY_TRIAD[name], columns, guess)
        said = str(data.answers.get(f"{name}.unit", data.log_answers.get(f"{name}.unit", "")))
        are_counts = not scale and guess.counts is not None and not (stated or self._fits(name, columns, zero, said))
        if not scale and not self._has("unit_per_count") and (self._has(_COUNTS) or zero or are_counts):
            self._set(_COUNTS, guess.counts or "", "counts that are one unit, by the data sheet", ask=True)
        self._write_scale(part)
        self._set_known("range", "delay", *(("axes", "mirrored") if name != "gyr" else ()))
        if zero:
            self._set("zero", f"{zero:g}", "whole numbers around it: counts that mean 0", ask=True)
        if name == "acc":
            if data.plus and "user" in part.base and guess.unit == "g":  # [Apple, CMDeviceMotion]: gravity points down
                self._set("sign", "gravity", "user acceleration and gravity, as iOS has them", ask=True, sure=True)
            else:
                mean = np.nan_to_num(data.vectors(columns) - zero).mean(axis=0)
                axis = int(np.argmax(np.abs(mean)))
                up = f"right if {'xyz'[axis]} points {'up' if mean[axis] > 0.0 else 'down'} here"
                why = f"{up}, where it reads {mean[axis]:.3g}; otherwise 'gravity'"
                self._set("sign", "specific-force", why, ask=True)
        if name == "gyr" and data.turns[0] != AS_MOUNTED and not self._accept:
            # where the accelerometer's axes are M times the case's, gravity turns in them as by the rates det(M) M ω
            c = signed_axes(data.turns[0])
            self._set("axes", axes_letters(c), "so it turns as the accelerometer sees gravity turn", ask=True)
            if np.linalg.det(c) < 0.0:
                self._set("mirrored", "true", "these axes are left-handed", ask=True)
            else:
                self._lines += [
                    f'# Or these are right, and those of [acc] are not: axes = "{axes_letters(c.T)}" if it is turned,',
                    f'# axes = "{axes_letters(-c.T)}" and mirrored = true if it is left-handed. See the data sheets.',
                ]

    def _sized_unit(self, name: str, columns: Sequence[int], zero: float) -> Guess:
        """Unit of a triad by its size, or by how it turns; whole numbers of a field may be counts in any case."""
        data, size, by_size = self._data, self._data.size(columns, zero), {"acc": gravity_unit, "mag": field_unit}
        guess = by_size[name](size) if name in by_size else data.rate_unit(columns, zero)
        if name in by_size and guess.counts == "" and not data.are_whole(columns):
            is_relative = name == "mag" and RELATIVE[0] < size < RELATIVE[1]
            return Guess("relative" if is_relative else "", guess.why.removesuffix(": counts?"))
        if name != "mag" or not data.are_whole(columns):
            return guess
        fits = self._fits(name, columns, zero, data.parts[columns[0]].unit_as(Quantity.FIELD))
        why = guess.why.removesuffix(": counts?")
        return Guess(guess.unit, why if fits else f"{why}: whole numbers, which may be counts", None if fits else "")

    def _fits(self, name: str, columns: Sequence[int], zero: float, unit: str) -> bool:
        """Whether a unit is said, of which gravity or the Earth's field does not say that whole numbers are counts."""
        data, usual = self._data, {"acc": (0.5 * G0, 2.0 * G0), "mag": (11.0, 134.0)}.get(name)
        if usual is None or not data.are_whole(columns) or not is_name(unit, QUANTITY_BY_TRIAD[name]):
            return bool(unit)
        return usual[0] < to_si(data.size(columns, zero), unit) < usual[1]

    def _write_scale(self, part: ColumnName) -> None:
        """Write what one count is, where an answer, a known log or the header says it."""
        self._set_known("unit_per_count")
        if part.scale != 1.0 and not self._has("unit_per_count"):
            self._set("unit_per_count", part.scale, "of the unit, as the header or the size of the numbers says")

    def _stated_scale(self, name: str) -> tuple[str, str, float] | None:
        """Unit, key and number of the scale of whole numbers that the lines above say, as ``131 LSB/(deg/s)``."""
        data = self._data
        if not data.are_whole(data.triads[name]):
            return None
        scales = {
            (canonical(unit, QUANTITY_BY_TRIAD[name]), key, float(number))
            for key, pattern in TABLES["said"]["scales"].items()
            for number, unit in re.findall(pattern, data.sample.preamble, re.IGNORECASE)
        }
        scales = {scale for scale in scales if scale[0]}
        return scales.pop() if len(scales) == 1 else None

    def _scales_fit(self) -> bool:
        """Whether the scales that the lines above say do not contradict gravity."""
        data = self._data
        if "acc" not in data.triads or (scale := self._stated_scale("acc")) is None:
            return True
        columns, (unit, key, number) = data.triads["acc"], scale
        size = data.size(columns, data.middle(columns)) * (1.0 / number if key == _COUNTS else number)
        return abs(to_si(size, unit) / G0 - 1.0) < evidence.ABOUT

    def _write_unit(self, kind: Quantity, columns: Sequence[int], guess: Guess) -> bool:
        """Write the unit; True where the header states it, and the numbers do not contradict."""
        part = self._data.parts[columns[0]]
        named = part.unit_as(kind)
        if (
            named
            and part.stated
            and (guess.unit in {"", named} or self._accept)
            and (not guess.counts if kind is not Quantity.FIELD else guess.counts is None)
        ):
            self._set("unit", named, f"the header says [{single_line(part.unit)}]")
            return True
        fitting = ", ".join(name for name, unit in UNITS.items() if unit.quantity is kind)
        said = f"the header says {single_line(part.unit)}; " if part.unit else ""
        sure = bool(named and guess.unit in {"", named}) or bool(guess.unit and not named and not part.stated)
        sure = sure and not (guess.counts is not None)
        self._set("unit", guess.unit or named, f"{said}{guess.why or f'one of {fitting}'}", ask=True, sure=sure)
        return False
