"""Draft the profile of an unknown text file: what its names and first numbers suggest, each guess as a question.

A guess begins with ``?``. A profile with questions is refused, so that nothing is guessed behind anyone's back. What
is certain: the layout, which every row confirms, and units that the header states in brackets and the numbers do not
contradict.
"""

import json
import os
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from fractions import Fraction
from functools import partial
from itertools import pairwise, product, takewhile
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ClockError, DecodeError, ParameterError
from plumbob.core.files import ARRAYS, existing_file, reading, write_text
from plumbob.core.text import FactsText
from plumbob.core.time import to_s
from plumbob.core.units import QUANTITY_BY_TRIAD, UNITS, Quantity, is_name, to_si
from plumbob.data import TITLES, TRIADS, ImuData, ImuMeta
from plumbob.data.plausibility import ENOUGH_EFFECTIVE, Turning, turning
from plumbob.files.arrow import text_bytes
from plumbob.files.column_names import REVERSED, TEMPERATURE, WEEK, ColumnName, canonical, named_sensor, taken_apart
from plumbob.files.columns import FORM, StampError, has_zone, is_stamp, is_time_of_day, to_seconds
from plumbob.files.known_logs import KNOWN, refuse_known
from plumbob.files.profile import AS_MOUNTED, EPOCHS, GUIDE, JSON, Profile, TextLayout, parse_profile
from plumbob.files.sniff import FEWEST, Sample, read_sample, rises
from plumbob.files.stamps import CENTURY, falls, time_line
from plumbob.files.text_table import LEFT_OUT_MOST, read_table
from plumbob.rotations import axes_letters, every_axes, in_body_axes, signed_axes

_HEAD: Final = 1 << 16  # bytes in which a log that is known has its names
_TIMES: Final = ("s", "ms", "us", "ns")
_RATES: Final = (0.5, 50_000.0)  # sampling rates that are plausible, Hz
_DAYS: Final = {  # of 2000 and 2100; those since 1899-12-30 until 2041, as then they may be modified Julian
    "spreadsheet": (36_526.0, 51_544.0), "julian": (2_451_544.5, 2_488_069.5), "modified-julian": (51_544.0, 88_069.0),
}  # fmt: skip
_HUNDRED_NS: Final = ((1.2591e17, 1.5747e17), (6.3082e17, 6.6239e17))
"""Steps of 100 ns since 1601 (FILETIME) and since the year 1 (.NET), from 2000 to 2100."""
_SAID_RATES: Final = (
    (r"(?:rate|freq\w*|odr|sampling|\bfs\b)[^:=]*[:=\s]+(\d+(?:\.\d+)?)\s*(?:hz|sps)?(?![\w.%])", "Hz"),
    (r"(?:\bat|sampling|@)\W*(\d+(?:\.\d+)?)\s*(?:hz|sps)\b", "Hz"),
    (r"(?:rate|interval|period|sampling)[^:=]*[:=\s]+(\d+(?:\.\d+)?)\s*ms\b", "ms"),
    (r"(?:interval|period)[^:=]*[ _(\[]ms[)\]]?\s*[:=\s]+(\d+(?:\.\d+)?)$", "ms"),
)  # how lines before a table say its sampling rate, and the unit of the number
_USUAL: Final = TextLayout(separator=",")
_COUNTS: Final = "counts_per_unit"
_COUNT: Final = r"(?:lsbs?|counts?|digits?)"
_SCALES: Final = {
    _COUNTS: rf"(\d+(?:\.\d+)?)\s*{_COUNT}\s*(?:/|per)\s*([^\s,:;()]+|\([^()]*\))",
    "unit_per_count": rf"(\d+(?:\.\d+)?(?:e-?\d+)?)\s*([^\s,;\d]+?)\s*(?:/|per)\s*{_COUNT}\b",
}  # how lines before a table say what a count is, by the key of a profile
_USUAL_RATES: Final = (4.0, 9000.0)  # sampling rates of inertial sensors in use, Hz
_UNIT_NORM: Final = 0.02
_EVEN: Final = 0.2  # how far steps of a column without a name are off their median, in steps, where it is a clock
_MOST_SENSORS: Final = 20
_ANGLES: Final = ("yaw", "pitch", "roll")
_REST: Final = {"m/s2": G0, "g": 1.0, "mg": 1000.0}  # |acc| at rest, by unit
_EARTH: Final = {"uT": (22, 67), "mgauss": (220, 670), "gauss": (0.22, 0.67), "nT": (22e3, 67e3), "T": (22e-6, 67e-6)}
_FASTEST: Final = 70.0  # beyond nearly every part, rad/s: 4000 deg/s
_ABOUT: Final = 0.15  # fraction within which a size at rest is of a unit; an uncalibrated sensor errs by less
_BEST: Final = 0.8  # correlation above which other axes are proposed, where the declared ones have less than half of it


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
    numbered: bool = False,
) -> Draft:
    """Draft of files that are there, as of `plumbob.profile`; `numbered` names no column and looks for no head."""
    if out is not None and Path(out).exists():
        raise ParameterError(f"{out} exists already; answer its questions, or name another file with --out.")
    streams: list[_DraftWriter] = []
    for file in files:
        refuse_known(file)
        with reading(file):
            if file.suffix.lower() in ARRAYS:
                from plumbob.files.foreign.tables import array_sample

                sample = array_sample(file)
            else:
                sample = read_sample(file)
                sample = _headless(sample) if numbered and sample.layout.separator != JSON else sample
            streams += _writers(file.name, sample, dict(answers or {}), is_alone=len(files) == 1)
    with reading(files[0]):
        draft = _joined(streams, accept)
        if accept and not draft.questions:
            parse_profile(draft.text)
    if out is not None and not (accept and draft.questions):
        write_text(out, draft.text)
    return draft


def _headless(sample: Sample) -> Sample:
    """The same without what stands before a table: who listens to a line may come after it."""
    layout = replace(sample.layout, names=False, skip=0, after_names=0, marker="", occurrence=1, end="", mark="")
    return replace(sample, layout=layout, by_name=False, others=tuple(map(_headless, sample.others)))


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
        made = _joined(_writers(file.name, sample, {}, is_alone=True), accept=True) if log else None
        parsed = parse_profile(made.text, origin=log.name) if log and made and not made.questions else None
        return parsed if parsed is not None and ("frame" in parsed.meta or not parsed.triads) else None


_DEVICE: Final = re.compile(r"\b(i|id|instance|device|addr(ess)?|mac|node|serial|sensor|imu|unit|tag|name|station)\b")
_NINE: Final = {"acc": 0, "gyr": 3, "mag": 6}  # where the triads begin in lines of nine, as MotionCal has them


def read_triples(path: str | Path, sensor: str) -> Floats:
    """Triples (N, 3) of a sensor in a text, in the unit that they have there; DecodeError if it has no such columns."""
    file = existing_file(path)
    with reading(file):
        sample = read_sample(file)
        numbers = [i for i in range(sample.width) if np.isfinite(sample.numbers(i)).all()]
        parts = [taken_apart(name) for name in sample.for_cells(sample.names)]
        named = {part.axis: i for i, part in enumerate(parts) if part.sensor == sensor}
        if set("xyz") <= set(named):
            columns = [named[axis] for axis in "xyz"]
        elif len(numbers) == len("xyz"):
            columns = numbers
        elif len(numbers) == len(QUANTITY_BY_TRIAD) * len("xyz") and not any(part.sensor for part in parts):
            columns = numbers[_NINE[sensor] :][: len("xyz")]
        else:
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
    for written in (value, f"[{value}]") if key.strip().endswith("columns") else (value,):
        with suppress(tomllib.TOMLDecodeError):
            return key.strip(), tomllib.loads(f"value = {written}")["value"]
    return key.strip(), value.strip()


def _joined(streams: "Sequence[_DraftWriter]", accept: bool) -> Draft:
    """One draft of all streams; each answer is for every stream that has its key."""
    forces = [stream for stream in streams if "acc" in stream.triads]
    for stream in streams:
        stream.turn_as(forces[0] if len(forces) == 1 else stream)
    drafts = [stream.draft(accept) for stream in [of for of in streams if of.triads] or streams[:1]]
    questions = dict.fromkeys(question for draft in drafts for question in draft.questions)
    evidence = dict.fromkeys(fact for draft in drafts for fact in draft.evidence)
    return Draft("\n".join(draft.text for draft in drafts), tuple(questions), tuple(evidence))


def _writers(name: str, sample: Sample, answers: Mapping[str, Any], *, is_alone: bool) -> "list[_DraftWriter]":
    """What drafts the profile of a file: one for each sensor, where the rows of a file that is alone name them."""
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
    return [_DraftWriter(name, part, stream=stream, answers=answers) for part in parts or [sample]]


def _by_clock(sample: Sample) -> list[Sample]:
    """Tables with sensors that stand side by side, each behind a clock of a rate of its own; or nothing."""
    names, units = sample.for_cells(sample.names), sample.for_cells(sample.units)
    parts = [taken_apart(*both) for both in zip(names, units, strict=True)]
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
    parts = [taken_apart(name) for name in sample.for_cells(sample.names)]
    values = [i for i, part in enumerate(parts) if part.axis and not (part.sensor or part.by_unit)]
    values = values if any(sample.names) else list(range(sample.width))[-3:]
    for i in range(sample.width) if len(values) == len("xyz") else ():
        words = dict.fromkeys(sample.cells(i))
        if len(words) > _MOST_SENSORS:
            continue
        units = _android_units(sample, i, values) if i not in values else {}
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
    fits = {"1", "4"} <= set(medians) and all(map(str.isdigit, kinds)) and _gravity_unit(medians["1"]).unit == "m/s2"
    field = medians.get("2")
    return _ANDROID if is_type and fits and (field is None or _field_unit(field).unit == "uT") else {}


@dataclass(frozen=True, slots=True)
class _Guess:
    """A unit, why, and how many counts are one: None where they are no counts, empty where it is not known."""

    unit: str = ""
    why: str = ""
    counts: str | None = None


class _DraftWriter:
    """Makes the text, key by key, and collects the questions."""

    def __init__(self, name: str, sample: Sample, *, stream: str, answers: Mapping[str, Any]) -> None:
        self._names = sample.for_cells(sample.names)
        units = sample.for_cells(sample.units)
        levels = zip(*(name.split("/")[:-1] for name in self._names), strict=False)  # groups that hold all arrays
        groups = (level[0] for level in takewhile(lambda level: len({*level}) == 1, levels))
        above = "".join(f"{group}/" for group in takewhile(lambda group: not taken_apart(group).sensor, groups))
        names = [name.removeprefix(above) for name in self._names]
        self._parts = [taken_apart(*both) for both in zip(names, units, strict=True)]
        clocks = [_clock(sample, i) for i, part in enumerate(self._parts) if part.is_time]
        if clocks := [clock for clock in clocks if clock.size]:
            sample = replace(sample, rows=sample.rows[::-1]) if all(map(falls, clocks)) else sample
        self._name, self._sample, self._stream, self._answers = name, sample, stream, answers
        self._parts = _with_axes(_turn_rates(self._parts, self._names))
        self._sensor = sample.sensor or (
            "" if any(p.axis and p.sensor and not p.is_bare for p in self._parts) else named_sensor(Path(name).stem)
        )
        if base := {"linear": "linear acc"}.get(self._sensor, self._sensor):
            named = [replace(p, base=base) if p.axis and (p.is_bare or not p.sensor) else p for p in self._parts]
            self._parts = [p if q.sensor == "other" else q for p, q in zip(self._parts, named, strict=True)]
        self._numbers = [sample.numbers(i) for i in range(sample.width)]
        for i, (part, numbers) in enumerate(zip(self._parts, self._numbers, strict=True)):
            if not part.stated and any(low <= np.nanmin(numbers, initial=np.inf) < high for low, high in _HUNDRED_NS):
                self._parts[i] = replace(part, unit="us", scale=0.1)
            self._numbers[i] = numbers if self._parts[i].scale == 1.0 else numbers * self._parts[i].scale
        log = next((log for log in KNOWN if log.fits(sample.names, sample.facts)), None)
        self._known, self._log = (log.said(sample.facts), log.name) if log else ({}, "")  # keys, and of what they are
        self._clocks = self._first_of_four()
        self._time = self._time_columns()
        self._quaternion = self._quaternion_columns()
        bases = [re.sub("elevation", "pitch", re.sub("heading|azimuth", "yaw", part.base)) for part in self._parts]
        angles = {name: i for i, name in enumerate(bases) if name in _ANGLES and not self._quaternion}
        self._angles = tuple(angles[name] for name in _ANGLES) if len(angles) == len(_ANGLES) else ()
        self._plus: tuple[int, ...] = ()
        self._fours: tuple[int, ...] = ()  # unit quaternions without names, whose order nothing says
        self.triads = self._named_triads() or (self._sized_triads() if self._is_nameless() else {})
        self.triads |= self._answered_triads()
        self.triads = {name: columns for name, columns in self.triads.items() if columns}
        if "acc.plus" in self._answers and "acc" in self.triads and not self._plus:
            self._add(self.triads["acc"], tuple(self._place("acc.plus", ref) for ref in self._answers["acc.plus"]))
        heat = [i for i in self._free() if TEMPERATURE.fullmatch(self._parts[i].base)]
        said = [i for i in heat if "temperature.unit" in answers or self._parts[i].unit_as(Quantity.TEMPERATURE)]
        self._temperature = next((i for i in heat if i in said or self._usual_degc(i).unit), None)
        self._lines: list[str] = []
        self._questions: list[tuple[str, str]] = []
        self._evidence: list[tuple[str, str]] = []
        self._table = ""
        self._accept = False

    def draft(self, accept: bool) -> Draft:
        """Write all tables."""
        self._accept = accept
        if not self.triads and not self._quaternion and not self._angles:
            linear = any(part.sensor == "linear" for part in self._parts)
            raise DecodeError(
                "the acceleration in it is without gravity, and there is no gyroscope: nothing in it can give an "
                "attitude. Record the raw accelerometer, which measures gravity too."
                if linear
                else f"where its sensors stand, the first {len(self._sample.rows)} rows hold zeros alone: begin the "
                "file where they measure."
                if any(self._threes(partial(_may_be, name)) for name in TRIADS)
                else "it holds angles and velocities gained in each sample: divide them by its step, in radians and "
                "seconds, which gives rates and specific force."
                if any(re.search(r"\bd(elta)? [av]", part.base) for part in self._parts)
                else "no three columns look like a gyroscope, an accelerometer or a magnetometer; name them, as with "
                f"--set gyr.columns=1,2,3, or write a profile by hand ({GUIDE})."
            )
        if self._stream:
            self._lines += ["[[stream]]", f"file = {json.dumps(self._stream)}"]
        self._top()
        self._write_time()
        for name in (name for name in TRIADS if name in self.triads):
            self._write_triad(name, self.triads[name])
        if self._temperature is not None and self.triads:
            self._open("temperature")
            self._set("column", self._sample.ref(self._temperature), "the name of the column", ask=True, sure=True)
            self._write_unit(Quantity.TEMPERATURE, [self._temperature], self._usual_degc(self._temperature))
        if self._quaternion or (self._angles and not self.triads):  # beside samples, no two makers turn alike
            self._write_reference()
        return Draft("\n".join(self._lines) + "\n", tuple(self._questions), tuple(self._evidence))

    # Columns ----------------------------------------------------------------------------------------------------------

    def _refs(self, columns: Sequence[int]) -> tuple[int | str, ...]:
        return tuple(map(self._sample.ref, columns))

    def _free(self) -> list[int]:
        """Columns of numbers that have no meaning yet."""
        taken = {*self._time, *self._clocks, *self._quaternion, *self._fours}
        taken |= {i for columns in getattr(self, "triads", {}).values() for i in columns} | {*self._plus}
        return [i for i in range(self._sample.width) if i not in taken and np.isfinite(self._numbers[i]).any()]

    def _varying(self) -> list[int]:
        """Those of them that are not the same in all rows."""
        return [i for i in self._free() if np.nanmin(self._numbers[i]) < np.nanmax(self._numbers[i])]

    def _place(self, key: str, ref: Any) -> int:
        """Place of a column that an answer names."""
        places = [self._names.index(ref)] if ref in self._names else [ref - 1] if type(ref) is int else []
        if not places or not 0 <= places[0] < self._sample.width:
            names = ", ".join(filter(None, self._names)) or f"the numbers 1 to {self._sample.width}"
            raise DecodeError(f"the answer {key} names the column {ref!r}, which is not there; known: {names}.")
        return places[0]

    def _answered_triads(self) -> dict[str, tuple[int, ...]]:
        """Triads whose columns are answered; an empty list leaves one out, and of nameless columns no other is left."""
        keys = {name: f"{name}.columns" for name in TRIADS}
        answered = {
            name: tuple(self._place(key, ref) for ref in self._answers[key])
            for name, key in keys.items()
            if key in self._answers and (name in self.triads or not self._stream)
        }
        others = set(self.triads) - set(answered) if any(answered.values()) and self._is_nameless() else set()
        return dict.fromkeys(others, ()) | answered

    def _time_columns(self) -> tuple[int, ...]:
        """Columns of time: stamps, or numbers that rise from row to row; those with a unit and a name come first."""
        if "time.column" in self._answers:
            keys = [key for key in ("time.column", "time.seconds") if key in self._answers]
            return tuple(self._place(key, self._answers[key]) for key in keys)
        named = [i for i, part in enumerate(self._parts) if part.is_time]
        if clocks := list(filter(self._is_time_of_day, named)):
            return (clocks[0],)
        if rising := [i for i in named if rises(self._numbers[i])]:
            return self._in_two_parts(named) or (min(rising, key=self._time_rank),)
        others = [i for i in range(self._sample.width) if i not in named]
        for i in (*named, *others):
            cells = self._sample.cells(i)
            if all(map(is_stamp, cells)):
                return (i,)
            dates = i + 1 < self._sample.width and all(re.fullmatch(r"\d{4}([-/])\d{1,2}\1\d{1,2}", c) for c in cells)
            if dates and all(map(is_stamp, self._sample.cells(i + 1))):
                return (i, i + 1)
        return self._clocks[:1] or (() if named else self._rising_column())

    def _is_time_of_day(self, column: int) -> bool:
        """Whether numbers are clock times as hhmmss, by their name or because they jump by 40 at each minute."""
        cells, steps = self._sample.cells(column), np.diff(self._numbers[column])
        if not all(map(is_time_of_day, cells)):
            return False
        jumps = bool(((steps > 40.0) & (steps < 41.0 + np.median(steps))).any())
        is_utc = "utc" in self._parts[column].base and all(re.match(r"\d{6}", cell) for cell in cells)
        return jumps or is_utc or re.search(r"hhmmss|hms", self._parts[column].base) is not None

    def _rising_column(self) -> tuple[int, ...]:
        """First column of numbers that rise as a clock does: of those without a name, or the very first one."""
        nameless = self._is_nameless()
        for i, part in enumerate(self._parts):
            steps = np.diff(self._numbers[i])
            counts = bool((steps == 1.0).all()) and not nameless
            alone = not part.axis or all(other.axis != "y" or other.base != part.base for other in self._parts)
            bare = not part.is_counter and not part.sensor and (nameless or alone)
            rises = steps.size and (np.mean(steps > 0.0) > 1.0 - LEFT_OUT_MOST if i == 0 else (steps > 0.0).all())
            if bare and not counts and rises and (nameless or not i or not self._names[i]):
                return (i,)
        return self._in_two_parts(range(self._sample.width)) if nameless else ()

    def _in_two_parts(self, named: Sequence[int]) -> tuple[int, ...]:
        """Columns of whole seconds, which repeat, and of the parts of them, which begin again as they go on."""
        for i, k in product(named, range(self._sample.width)):
            seconds, unit = self._numbers[i], self._part_of_second(k)
            if unit and (seconds == np.rint(seconds)).all() and (np.diff(seconds) == 0.0).any():
                t = seconds - seconds[0] + to_si(self._numbers[k], unit)
                if (np.diff(t) > 0.0).all() and (np.diff(self._numbers[k]) < 0.0).any():
                    return (k, i)
        return ()

    def _part_of_second(self, column: int) -> str:
        """Unit in which all numbers of a column are parts of a second; empty for none."""
        low, high = self._numbers[column].min(), self._numbers[column].max()
        return next((unit for unit in _TIMES[1:] if low >= 0.0 and 0.1 < to_si(high, unit) < 1.0), "")

    def _first_of_four(self) -> tuple[int, ...]:
        """Columns of time that stand before the three of their triad, in arrays of four."""
        firsts = []
        for i, part in enumerate(self._parts[:-3]):
            four = [other.axis for other in self._parts[i : i + 4] if other.base == part.base]
            more = any(other.base == part.base and other.axis == "5" for other in self._parts)
            is_time = four == list("1234") and not more and rises(self._numbers[i])
            if is_time and not any(rises(self._numbers[k]) for k in range(i + 1, i + 4)):
                firsts.append(i)
        return tuple(firsts)

    def _time_rank(self, column: int) -> tuple[bool, bool, bool, bool]:
        """Which of several clocks is taken: one that does not begin again, of single samples, in a unit that it has."""
        steps = np.diff(self._numbers[column])
        repeats = bool(np.sum(steps > 0.0) < 0.5 * steps.size)
        part = self._parts[column]
        return bool((steps < 0.0).any()), "tick" in part.base, repeats, not part.unit_as(Quantity.TIME)

    @property
    def _stamped(self) -> bool:
        """Whether time is dates and clock times."""
        last = self._time[-1:]
        return any(is_stamp(self._sample.cells(i)[0]) or self._is_time_of_day(i) for i in last)

    def _quaternion_columns(self) -> tuple[int, ...]:
        """Columns w, x, y, z of unit quaternions."""
        sets: dict[str, dict[str, int]] = {}
        for i, part in enumerate(self._parts):
            if part.quaternion:
                sets.setdefault(part.base, {}).setdefault(part.axis, i)
        for axes in sets.values():
            for order in ("wxyz", "0123"):
                columns = tuple(axes[letter] for letter in order if letter in axes)
                if len(columns) == 4 and abs(self._size(columns) - 1.0) < _UNIT_NORM:
                    return columns
        return ()

    def _is_nameless(self) -> bool:
        """Whether columns have no names, but those of axes, or the one of the array that they all stand in."""
        numbered = [re.fullmatch(r"(.*)\[\d+\]", name) for name in self._sample.names]
        axes = [bool(part.axis and part.is_bare and not part.unit) for part in self._parts]  # of sensors without names
        are_axes = all(axis or part.is_time or part.is_counter for axis, part in zip(axes, self._parts, strict=True))
        one_array = all(numbered) and len({match[1] for match in numbered if match}) <= 1
        return one_array or (are_axes and sum(axes) > len("xyz"))

    def _named_triads(self) -> dict[str, tuple[int, ...]]:
        triads: dict[str, tuple[int, ...]] = {}
        sets = {name: self._threes(partial(_may_be, name)) for name in TRIADS}
        # that hold more than zeros, and gravity where their words do not say that they are an acceleration
        sets = {name: [s for s in threes if np.any(self._vectors(s))] for name, threes in sets.items()}
        sets["acc"] = [s for s in sets["acc"] if self._parts[s[0]].sensor == "acc" or self._has_gravity(s)]
        of_units = [(min(three), self._unit_of(three), name) for name, threes in sets.items() for three in threes]
        sensors = Counter(unit for unit, _ in dict.fromkeys((unit, name) for _, unit, name in sorted(of_units)))
        unit = sensors.most_common(1)[0][0] if sensors else ""  # the first one of those that have most of them
        for name, complete in sets.items():
            ranked = sorted(map(self._right_handed, complete), key=lambda columns: self._rank(name, columns, unit))
            triads |= {name: ranked[0]} if ranked else {}
        linear = [triads["acc"]] if "acc" in triads else self._threes(lambda part: part.sensor == "linear")
        gravity = self._threes(lambda part: re.search(r"\bgrav(ity)?\b", part.base) is not None)
        for without, down in zip(linear[:1], gravity[:1], strict=False):
            same_unit = self._parts[down[0]].unit == self._parts[without[0]].unit
            along = np.sum(self._vectors(without) * self._vectors(down), axis=1)  # much where gravity is in it already
            if same_unit and self._has_gravity(down) and abs(np.nanmedian(along)) < 0.5 * self._size(down) ** 2:
                triads["acc"] = without
                self._add(without, down)
        if "gyr" not in triads and "acc" in triads and (turning := self._turning_three(triads["acc"])):
            triads["gyr"] = turning
        gyr = triads.get("gyr", ())
        if gyr and "acc" not in triads and self._parts[gyr[0]].base == "g" and self._has_gravity(gyr):  # ``G(x)``
            triads["acc"] = triads.pop("gyr")
        if "acc" not in triads and (triads or not self._is_nameless()):  # a steady vector of the size of gravity: asked
            for i in self._free()[:-2]:
                three = [p for p in self._parts[i : i + 3] if not (p.sensor or p.unit) and (triads or p.is_bare)]
                if [part.axis for part in three] == list("xyz") and self._has_gravity((i, i + 1, i + 2)):
                    return triads | {"acc": (i, i + 1, i + 2)}
        return triads

    def _add(self, acc: Sequence[int], plus: tuple[int, ...]) -> None:
        """Add columns to those of the accelerometer."""
        self._plus = plus
        for i, k in zip(acc, plus, strict=True):
            self._numbers[i] = self._numbers[i] + self._numbers[k]

    def _turning_three(self, acc: Sequence[int]) -> tuple[int, ...]:
        """Columns whose names say no rate, as ``Rotation.roll``, that turn as the accelerometer sees gravity turn."""
        rolls: dict[str, dict[str, int]] = {}
        for i, (axis, word) in product(self._free(), zip("xyz", ("roll", "pitch", "yaw"), strict=True)):
            if word in (base := self._parts[i].base):
                rolls.setdefault(base.replace(word, ""), {})[axis] = i
        threes = [tuple(axes[letter] for letter in "xyz") for axes in rolls.values() if len(axes) == len("xyz")]
        return next(iter(self._turning([*threes, *self._threes(lambda part: not part.sensor)], acc)), ())

    def _turning(self, threes: Sequence[tuple[int, ...]], acc: Sequence[int]) -> list[tuple[int, ...]]:
        """Those that turn as the accelerometer sees gravity turn."""
        t, force = self._seconds(), self._vectors(acc)
        fits = [_turning_fit(t, self._vectors(three), force) for three in threes if t is not None]
        turn = [fit is not None and fit.effective >= ENOUGH_EFFECTIVE and fit.correlation > _BEST for fit in fits]
        return [three for three, turns in zip(threes, turn, strict=False) if turns]

    def _threes(self, belongs: Callable[[ColumnName], bool]) -> list[tuple[int, ...]]:
        """Columns x, y, z of the same words and unit, of those that belong."""
        sets: dict[str, dict[str, int]] = {}
        for i in self._free():
            part = self._parts[i]
            if part.axis and belongs(part):
                sets.setdefault(f"{part.base} {part.unit}", {}).setdefault(part.axis, i)
        return [
            tuple(axes[letter] for letter in letters)
            for axes in sets.values()
            for letters in ("xyz", "012", "123", "234")
            if set(letters) == set(axes) or (letters == "xyz" and set(letters) <= set(axes))
        ]

    def _has_gravity(self, columns: Sequence[int]) -> bool:
        return self._steady(columns) and bool(_gravity_unit(self._size(columns)).unit)

    def _right_handed(self, columns: tuple[int, ...]) -> tuple[int, ...]:
        """Columns x, y, z in their order; forward, right and up are right-handed as right, forward and up."""
        bares = {i: REVERSED.sub("", self._names[i]) for i in columns}
        against = sum(bare != self._names[i] and not taken_apart(bare).axis for i, bare in bares.items())
        return (columns[1], columns[0], columns[2]) if against % 2 else columns

    def _unit_of(self, columns: Sequence[int]) -> str:
        """Words of a name that say no sensor, as of the unit that it is of."""
        return " ".join(word for word in self._parts[columns[0]].base.split() if not taken_apart(f"{word} x").sensor)

    def _rank(self, name: str, columns: Sequence[int], unit: str) -> tuple[bool, ...]:
        """Which of several sets is the sensor's: with gravity, of the unit of the others, in its unit, not derived."""
        part = self._parts[columns[0]]
        lacks_gravity = name == "acc" and not self._has_gravity(columns)
        has_no_unit = not part.unit_as(QUANTITY_BY_TRIAD[name])
        derived = re.search(r"\b(rate|filt\w*|smooth\w*|lp|lpf|mean|avg|average)\b", part.base) is not None
        return lacks_gravity, part.sensor == "linear", self._unit_of(columns) != unit, has_no_unit, derived

    def _sized_triads(self) -> dict[str, tuple[int, ...]]:
        """Threes of neighbouring columns without names, by their size: gravity is steady, the field is nearly so.

        Constants and quaternions are left out; of several others, rates are what turns as gravity does.
        """
        free = self._free()
        if self._sensor in TRIADS and len(free) == len("xyz"):
            return {self._sensor: tuple(free)}
        for four in [range(i, i + 4) for i in self._varying()]:
            if {*four} <= {*self._varying()} and abs(self._size(four) - 1.0) < _UNIT_NORM > np.ptp(self._norms(four)):
                self._fours += (*four,)
        varying = self._varying()
        more = len(free) > len("xyz") * len(TRIADS) and not len(varying) % len("xyz")
        free = varying if len(free) % len("xyz") or more else free
        if not any(f"{name}.columns" in self._answers for name in TRIADS):
            self._require_one_unit(varying)
        threes = [tuple(free[i : i + 3]) for i in range(0, len(free) - 2, 3)]
        triads: dict[str, tuple[int, ...]] = {}
        for three in filter(self._steady, threes):
            size = self._size(three)
            at_rest = size > 2000.0 or any(abs(size / rest - 1.0) < _ABOUT for rest in _REST.values())
            is_field = _field_unit(size).unit and np.ptp(self._vectors(three), axis=0).all()
            triads = ({"acc": three} if at_rest else {"mag": three} if is_field else {}) | triads
        others = [three for three in threes if three not in triads.values()]
        turning = self._turning(others, triads["acc"]) if "acc" in triads and len(others) > 1 else []
        names = [name for name in ("gyr", "acc", "mag") if name not in triads]
        return triads | dict(zip(names, sorted(others, key=lambda three: three not in turning), strict=False))

    def _require_one_unit(self, columns: Sequence[int]) -> None:
        """Refuse columns without names of which several threes have gravity: they are of several units or ranges."""
        threes: list[tuple[int, ...]] = []
        for three in zip(columns, columns[1:], columns[2:], strict=False):
            if three[2] - three[0] == 2 and self._has_gravity(three) and not {*three} & {*(threes or [()])[-1]}:
                threes.append(three)
        if len(threes) > 1:
            listed = [",".join(map(json.dumps, self._refs(three))) for three in threes]
            raise DecodeError(
                f"its columns have no names, and {len(threes)} threes of them could be the accelerometer: "
                f"{'; '.join(listed)}. Name those of the sensors by the description of the file, as with --set "
                f"acc.columns={listed[0]} --set gyr.columns=…"
            )

    def _steady(self, columns: Sequence[int]) -> bool:
        """Whether a vector keeps its length, as gravity and a field do, and rates do not."""
        low, middle, high = np.quantile(self._norms(columns), (0.25, 0.5, 0.75))
        return bool(high - low < 0.25 * middle)

    def _norms(self, columns: Sequence[int], zero: float = 0.0) -> Floats:
        """Sizes of a vector where it is measured: neither missing nor exactly zero; NaN for none."""
        norms = np.linalg.norm(self._vectors(columns) - zero, axis=1)
        return norms[norms > 0.0] if (norms > 0.0).any() else np.array([np.nan])

    def _vectors(self, columns: Sequence[int]) -> Floats:
        return np.stack([self._numbers[i] for i in columns], axis=1)

    def _are_whole(self, columns: Sequence[int]) -> bool:
        return not (np.nan_to_num(self._vectors(columns)) % 1.0).any()

    def _size(self, columns: Sequence[int], zero: float = 0.0) -> float:
        return float(np.median(self._norms(columns, zero)))

    # Lines ------------------------------------------------------------------------------------------------------------

    def _open(self, table: str) -> None:
        self._table = table
        self._lines += ["", f"[{'stream.' if self._stream else ''}{table}]"]

    def _set(self, key: str, value: object, why: str = "", *, ask: bool = False, sure: bool = False) -> None:
        """Write a key; a guess with the mark of a question, unless it is answered, or evidence for it is accepted."""
        dotted = f"{self._table}.{key}".lstrip(".")
        if dotted in self._answers:
            value, why, ask = self._answers[dotted], "as answered", False
        elif dotted in self._known:
            value, why, ask = self._known[dotted], f"as of {self._log}", ask and not self._accept
        elif ask and sure and self._accept:
            ask = False
            self._evidence.append((dotted, why))
        if ask:
            guess = ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
            value = ["?", *value] if isinstance(value, tuple) else f"? {value}".rstrip()
            self._questions.append((dotted, f"{guess}? {why}".rstrip() if guess else why))
        text = json.dumps(list(value) if isinstance(value, tuple) else value, ensure_ascii=False)
        line = f"{key} = {text.replace(chr(127), '')}"
        self._lines.append(f"{line:<38}  # {_one_line(why)}" if why else line)

    def _has(self, key: str) -> bool:
        """Whether a key of the open table is answered, or the known log says it."""
        dotted = f"{self._table}.{key}".lstrip(".")
        return dotted in self._answers or dotted in self._known

    def _set_known(self, *keys: str) -> None:
        """Write those of the keys that are answered, or that the known log says."""
        for key in filter(self._has, keys):
            self._set(key, "")

    def _top(self) -> None:
        layout = self._sample.layout
        if not self._stream:
            self._lines += [
                f"# Drafted by 'plumbob profile' from the first {len(self._sample.rows)} rows of "
                f"{_one_line(self._name)}.",
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
        if "unix start" in self._sample.facts:
            start = round(Fraction(self._sample.facts["unix start"]) * 10**9)
            self._set("t0_ns", start, "the first line, since 1970 (UTC)")
        if not self._has("device") and not self._stream:
            name = "name of this unit: a calibration card belongs to one"
            self._lines.append(f'# device = "unit 1"                     # {name}')
        unused = [i for i in self._free() if i != self._temperature]
        sensors = [i for i in unused if self._accept and self._parts[i].sensor not in {"", "other"}]
        names, measured = (
            _one_line(", ".join(self._names[i] or f"column {i + 1}" for i in some)) for some in (unused, sensors)
        )
        if unused:
            self._lines.append(f"# Not used: {names}")
        if sensors:
            self._set("notes", (f"columns that are not used: {measured}",))
        if layout.separator:
            self._write_header(layout)

    def _set_unusual(self, layout: TextLayout, **why: str) -> None:
        """Write those of the keys in which a layout is not the usual one."""
        for key, reason in why.items():
            if (value := getattr(layout, key)) != getattr(_USUAL, key):
                self._set(key, value, reason)

    def _write_layout(self, layout: TextLayout) -> None:
        self._set("separator", {"\t": "tab"}.get(layout.separator, layout.separator), f"{self._sample.width} columns")
        self._set("decimal", layout.decimal)
        self._set_unusual(layout, thousands="between groups of three digits")
        if layout.encoding != _USUAL.encoding:
            self._set("encoding", layout.encoding, "it is not UTF-8", ask=layout.encoding != "utf-16", sure=True)
        self._set_unusual(layout, comment="lines that begin so are left out")
        self._set_unusual(layout, cells="vectors, and units behind the numbers", missing="cells without a value")

    def _write_header(self, layout: TextLayout) -> None:
        self._open("header")
        self._set("names", layout.names, "" if layout.names else "no row of names: columns are numbered from 1")
        if layout.marker:
            self._set("marker", layout.marker, "the table begins behind this line")
            self._set("occurrence", layout.occurrence)
        skipped = "lines there" if layout.marker else "lines at the top"
        self._set_unusual(layout, end="and ends before this one", skip=skipped, after_names="the row of units")
        self._set_unusual(layout, mark="before the names", words="numbers stand among words", checksum="of each row")
        self._set_unusual(layout, channels="of each row: time, what names its channel, the number")
        self._set_unusual(layout, where="rows of this kind alone")

    def _write_time(self) -> None:
        self._open("time")
        rate = self._sampling_rate()
        counts = rate and bool(self._time) and (np.diff(self._numbers[self._time[0]]) == 1.0).all()
        if "time.rate" in self._answers or not self._time or (counts and not self._parts[self._time[0]].unit):
            why = "the header says it" if rate else "no column increases like time: the sampling rate, as in '100 Hz'"
            self._set("rate", rate, why, ask=True, sure=bool(rate))
            return
        refs = self._refs(self._time)
        if self._stamped:
            self._set("column" if len(refs) == 1 else "columns", refs[0] if len(refs) == 1 else refs)
            first = " ".join(self._sample.cells(i)[0] for i in self._time)
            self._set("format", FORM, f"the first is {first}")
            self._set_known("zone")
            if not self._has("zone") and not has_zone(first):
                self._lines.append('# zone = "+08:00"                      # what the clock is ahead of UTC, if known')
            return
        part, numbers = self._parts[self._time[0]], self._numbers[self._time[0]]
        steps = np.diff(numbers[np.isfinite(numbers)])
        usual = float(np.median(steps)) if steps.size else 0.0
        even = bool(np.mean(np.abs(steps - usual) < _EVEN * usual) > 1.0 - LEFT_OUT_MOST and usual != 1.0)
        self._set("column", refs[0], "it increases like time", ask=True, sure=part.is_time or even or len(refs) == 2)
        unit, why, sure = _time_unit(numbers, part, float(rate.partition(" ")[0] or 0.0))
        if len(refs) == 2:
            unit, why, sure = self._part_of_second(self._time[0]), "it begins again at each second", True
        self._set("unit", unit, why, ask=not (part.stated and part.unit == unit), sure=sure)
        if len(refs) == 2:
            self._set("seconds", refs[1], "whole seconds, to which it is added", ask=True, sure=True)
        self._write_scale(part)
        weeks = [i for i, other in enumerate(self._parts) if WEEK.fullmatch(other.base) and "tow" in part.base]
        if weeks:
            self._set("week", self._sample.ref(weeks[0]), "the GPS week that the time is of", ask=True, sure=True)
        seconds = self._numbers[self._time[1]][0] if len(refs) == 2 else 0.0
        epoch = days if (days := _days_since(numbers, part)) in EPOCHS else "unix"
        since = seconds + to_si(float(numbers[0]) - EPOCHS[epoch], unit) if unit and not weeks else 0.0
        if CENTURY[0] < since < CENTURY[1]:
            start = datetime.fromtimestamp(since, UTC)
            why = f"since {'1970' if epoch == 'unix' else 'day 0'} (UTC): the first is {start:%Y-%m-%d %H:%M:%S}"
            self._set("epoch", epoch, why, ask=True, sure=True)

    def _sampling_rate(self) -> str:
        """Sampling rate that the lines before the table say, with its unit; empty where none does."""
        said = [f"{key}: {value}" for key, value in self._sample.facts.items() if "baud" not in key]
        for pattern, unit in _SAID_RATES:
            for line in said:
                if (number := re.search(pattern, line, re.IGNORECASE)) and float(number[1]) > 0.0:
                    return f"{number[1] if unit == 'Hz' else f'{1.0 / to_si(float(number[1]), unit):g}'} Hz"
        return ""

    def _write_reference(self) -> None:
        """Write the attitude that stands beside, or alone."""
        frame = self._answers.get("reference.frame") or self._answers.get("frame")
        if self.triads and self._accept and frame is None and "reference.frame" not in self._known:
            return  # an attitude in no known frame is nothing that could be compared with
        self._open("reference")
        columns = self._refs(self._quaternion or self._angles)
        what = "unit quaternions" if self._quaternion else "angles about z, y and x"
        self._set("columns", columns, f"{what}, by their names", ask=True, sure=True)
        self._set("order", "wxyz" if self._quaternion else " ".join(_ANGLES))
        if not self._quaternion:
            unit = self._parts[self._angles[0]].unit_as(Quantity.ANGLE)
            largest = float(np.nanmax(np.abs(self._vectors(self._angles))))
            beyond = largest > 2.0 * np.pi
            why = f"the header says {unit}" if unit else f"the largest is {largest:.4g}"
            self._set("unit", unit or ("deg" if beyond else ""), why, ask=not unit, sure=beyond)
        self._set("frame", frame or "", "ENU, NED or NWU: what the quaternion turns to", ask=True, sure=bool(frame))
        self._set("north", "free", "what its heading counts from; free claims nothing", ask=True, sure=True)
        self._set("of", "case", "of the sensor case, or of the body", ask=False)
        self._set_known("source")

    def _write_triad(self, name: str, columns: tuple[int, ...]) -> None:
        self._open(name)
        part = self._parts[columns[0]]
        is_file_of_it = self._sensor == name and len(self.triads) == 1
        named = is_file_of_it or (bool(part.axis) and bool(part.sensor or part.by_unit))
        by = "by their names" if named else "by their size or turning; [] if they are none"
        turns = name == "gyr" and self._turns[1] is not None and self._turns[1].tells
        sure = named or turns or self._is_sure_by_size()
        self._set("columns", self._refs(columns), f"x, y, z of the {TITLES[name]}, {by}", ask=True, sure=sure)
        if name == "acc" and self._plus:
            self._set("plus", self._refs(self._plus), "gravity, which these lack", ask=True, sure=True)
        zero = self._middle(columns)
        by_size = {"acc": _gravity_unit, "mag": _field_unit}.get(name)
        guess = by_size(self._size(columns, zero)) if by_size else self._rate_unit(columns, zero)
        if scale := self._stated_scale(name):
            unit, key, number = scale
            sure = self._scales_fit()
            for key_, value in (("unit", unit), (key, number)):
                self._set(key_, value, "the lines above say it", ask=True, sure=sure)
        stated = not scale and self._write_unit(QUANTITY_BY_TRIAD[name], columns, guess)
        are_counts = not scale and guess.counts is not None and not stated and not self._fits(name, columns, zero)
        if not scale and not self._has("unit_per_count") and (self._has(_COUNTS) or zero or are_counts):
            self._set(_COUNTS, guess.counts or "", "counts that are one unit, by the data sheet", ask=True)
        self._write_scale(part)
        self._set_known("range", "delay", *(("axes", "mirrored") if name != "gyr" else ()))
        if zero:
            self._set("zero", f"{zero:g}", "whole numbers around it: counts that mean 0", ask=True)
        if name == "acc":
            if self._plus and "user" in part.base and guess.unit == "g":  # [Apple, CMDeviceMotion]: gravity points down
                self._set("sign", "gravity", "user acceleration and gravity, as iOS has them", ask=True, sure=True)
            else:
                mean = np.nan_to_num(self._vectors(columns) - zero).mean(axis=0)
                axis = int(np.argmax(np.abs(mean)))
                up = f"right if {'xyz'[axis]} points {'up' if mean[axis] > 0.0 else 'down'} here"
                why = f"{up}, where it reads {mean[axis]:.3g}; otherwise 'gravity'"
                self._set("sign", "specific-force", why, ask=True)
        if name == "gyr" and self._turns[0] != AS_MOUNTED and not self._accept:
            # where the accelerometer's axes are M times the case's, gravity turns in them as by the rates det(M) M ω
            c = signed_axes(self._turns[0])
            self._set("axes", axes_letters(c), "so it turns as the accelerometer sees gravity turn", ask=True)
            if np.linalg.det(c) < 0.0:
                self._set("mirrored", "true", "these axes are left-handed", ask=True)
            else:
                self._lines += [
                    f'# Or these are right, and those of [acc] are not: axes = "{axes_letters(c.T)}" if it is turned,',
                    f'# axes = "{axes_letters(-c.T)}" and mirrored = true if it is left-handed. See the data sheets.',
                ]

    def _fits(self, name: str, columns: Sequence[int], zero: float) -> bool:
        """Whether a unit is answered, and gravity does not say that these whole numbers are counts of another size."""
        unit = str(self._answers.get(f"{name}.unit", self._known.get(f"{name}.unit", "")))
        if name != "acc" or not self._are_whole(columns) or not is_name(unit, Quantity.ACCELERATION):
            return bool(unit)
        return 0.5 < to_si(self._size(columns, zero), unit) / G0 < 2.0

    def _write_scale(self, part: ColumnName) -> None:
        """Write what one count is, where an answer, a known log or the header says it."""
        self._set_known("unit_per_count")
        if part.scale != 1.0 and not self._has("unit_per_count"):
            self._set("unit_per_count", part.scale, "of the unit, as the header or the size of the numbers says")

    def _stated_scale(self, name: str) -> tuple[str, str, float] | None:
        """Unit, key and number of the scale of whole numbers that the lines above say, as ``131 LSB/(deg/s)``."""
        if not self._are_whole(self.triads[name]):
            return None
        text = "\n".join(f"{key}: {value}" for key, value in self._sample.facts.items())
        scales = {
            (canonical(unit, QUANTITY_BY_TRIAD[name]), key, float(number))
            for key, pattern in _SCALES.items()
            for number, unit in re.findall(pattern, text, re.IGNORECASE)
        }
        scales = {scale for scale in scales if scale[0]}
        return scales.pop() if len(scales) == 1 else None

    def _scales_fit(self) -> bool:
        """Whether the scales that the lines above say do not contradict gravity."""
        if "acc" not in self.triads or (scale := self._stated_scale("acc")) is None:
            return True
        columns, (unit, key, number) = self.triads["acc"], scale
        size = self._size(columns, self._middle(columns)) * (1.0 / number if key == _COUNTS else number)
        return abs(to_si(size, unit) / G0 - 1.0) < _ABOUT

    def _write_unit(self, kind: Quantity, columns: Sequence[int], guess: _Guess) -> bool:
        """Write the unit; True where the header states it, and the numbers do not contradict."""
        part = self._parts[columns[0]]
        named = part.unit_as(kind)
        if named and part.stated and (guess.unit in {"", named} or self._accept) and not guess.counts:
            self._set("unit", named, f"the header says [{_one_line(part.unit)}]")
            return True
        fitting = ", ".join(name for name, unit in UNITS.items() if unit.quantity is kind)
        said = f"the header says {_one_line(part.unit)}; " if part.unit else ""
        sure = bool(named and guess.unit in {"", named}) or bool(guess.unit and not named and not part.stated)
        sure = sure and not (guess.counts is not None)
        self._set("unit", guess.unit or named, f"{said}{guess.why or f'one of {fitting}'}", ask=True, sure=sure)
        return False

    def _usual_degc(self, column: int) -> _Guess:
        typical = float(np.nanmedian(self._numbers[column]))
        return _Guess("degC", f"{typical:.4g} is usual in degC") if -40.0 < typical < 85.0 else _Guess()

    def _is_sure_by_size(self) -> bool:
        """Whether triads without names are surely these: gravity, perhaps the Earth's field, one that is neither."""
        acc, mag, gyr = (self.triads.get(name) for name in ("acc", "mag", "gyr"))
        if acc is None or len(self._varying()) >= len("xyz"):
            return False
        is_normal = bool(np.ptp(self._norms(acc)) < 1e-3 * self._size(acc))  # directions, which no sensor measures
        steady = self._has_gravity(acc) and not (self._steady(gyr) if gyr else is_normal)
        return steady and (mag is None or (self._steady(mag) and bool(_field_unit(self._size(mag)).unit)))

    # Guesses ----------------------------------------------------------------------------------------------------------

    def _middle(self, columns: Sequence[int]) -> float:
        """Middle of unsigned counts; 0 where they are none."""
        values = self._vectors(columns)
        counts = values[np.isfinite(values).all(axis=1)]
        if not counts.size or counts.min() < 0.0 or (counts != np.rint(counts)).any():
            return 0.0
        typical = float(np.median(counts))
        return next((half for half in (32768.0, 8192.0, 2048.0, 512.0) if abs(typical - half) < 0.1 * half), 0.0)

    def _rate_unit(self, columns: Sequence[int], zero: float) -> _Guess:
        fit = self._turns[1]
        if fit is not None and fit.tells:
            for unit in ("rad/s", "deg/s", "mdeg/s"):
                if abs(np.log2(abs(fit.factor) / to_si(1.0, unit))) < 1.0:
                    return _Guess(unit, "so it turns as fast as the accelerometer sees gravity turn")
            return _Guess("deg/s", f"1 deg/s may be {to_si(1.0, 'deg/s') / abs(fit.factor):.4g} counts", "")
        rates = self._vectors(columns) - zero
        largest = float(np.nanmax(np.abs(rates)))
        if largest > _FASTEST and self._parts[columns[0]].unit_as(Quantity.RATE) in {"", "rad/s"}:
            return _Guess("deg/s", f"the largest is {largest:.4g}: not rad/s", "" if self._are_whole(columns) else None)
        return _Guess()

    def _seconds(self) -> Floats | None:
        """Time, s on the file's clock, which goes on where it repeats or begins again; None where it is not known."""
        if not self._time:
            return None
        scale, numbers = 1e9, self._numbers[self._time[0]]
        if self._stamped:
            since, t0_ns = to_seconds([self._sample.cells(i) for i in self._time], None)
            numbers = since + t0_ns / 1e9
        elif len(self._time) == 2:
            numbers = to_si(numbers, self._part_of_second(self._time[0])) + self._numbers[self._time[1]]
        elif unit := _time_unit(numbers, self._parts[self._time[0]])[0]:
            scale = to_si(1e9, unit)
        else:
            return None
        far = numbers[0] if abs(numbers[0] * scale) > 2.0**62 else 0.0  # of days, or of ns since 1601
        with suppress(ClockError):
            return to_s(time_line(numbers - far, scale).t_ns) + far * scale / 1e9
        return None

    def turn_as(self, other: "_DraftWriter") -> None:
        """Find by which axes the gyroscope turns as an accelerometer does: its own, unless others fit far better."""
        self._turns: tuple[str, Turning | None] = (AS_MOUNTED, None)
        t, when, gyr, acc = self._seconds(), other._seconds(), self.triads.get("gyr"), other.triads.get("acc")
        if t is None or when is None or gyr is None or acc is None:
            return
        rates, force = self._vectors(gyr) - self._middle(gyr), other._vectors(acc) - other._middle(acc)
        if other is not self:
            force = np.stack([np.interp(t, when, axis, np.nan, np.nan) for axis in force.T], axis=1)
        mounted = axes, best = AS_MOUNTED, _turning_fit(t, rates, force)
        if best is not None and best.windows and best.correlation <= 0.5 * _BEST:
            fits = {axes: _turning_fit(t, in_body_axes(axes, rates), force) for axes in map(axes_letters, every_axes())}
            axes, best = max(fits.items(), key=lambda fit: fit[1].correlation if fit[1] else 0.0)
        self._turns = (axes, best) if best is not None and best.tells and best.correlation > _BEST else mounted


def _turning_fit(t: Floats, rates: Floats, force: Floats) -> Turning | None:
    """How the force follows the rates, whatever their units; None where one is zero or not known throughout."""
    fastest, largest = (float(np.nanmax(np.abs(values), initial=0.0)) for values in (rates, force))
    if not (0.0 < fastest < np.inf and 0.0 < largest < np.inf):
        return None
    triads = {"gyr": rates / fastest, "acc": force / largest}  # within the range of every sensor
    t_ns, none = np.rint((t - t[0]) * 1e9).astype(np.int64), np.zeros(t.size, dtype=np.uint32)
    fit = turning(ImuData.live(t_ns, triads, flags=none, meta=ImuMeta(unit_check=False)))
    return replace(fit, factor=fit.factor / fastest)


def _turn_rates(parts: list[ColumnName], names: Sequence[str]) -> list[ColumnName]:
    """Names of which p, q, r, side by side and with the same behind them, are the rates about x, y and z."""
    heads = [(name.strip()[:1].lower(), re.sub(r"^.(?![^\W_])", "", name.strip())) for name in names]
    for i in range(len(heads) - 2):
        if "".join(head for head, _ in heads[i : i + 3]) == "pqr" and len({rest for _, rest in heads[i : i + 3]}) == 1:
            units = [taken_apart(f"gyr {axis}{heads[i][1]}") for axis in "xyz"]
            rates = [part if part.unit else unit for part, unit in zip(parts[i:], units, strict=False)]
            parts[i : i + 3] = [replace(part, base="gyr", axis=axis) for part, axis in zip(rates, "xyz", strict=True)]
    return parts


def _with_axes(parts: list[ColumnName]) -> list[ColumnName]:
    """Names of which one says the sensor, and the two behind it y and z, or their numbers, alone; or as nx, ny, nz."""
    for i in range(len(parts) - 2):
        three = parts[i : i + 3]
        stem = three[0].base[:-1]
        if stem and [part.base for part in three] == [f"{stem}{axis}" for axis in "xyz"]:
            parts[i : i + 3] = [replace(part, base=stem, axis=axis) for part, axis in zip(three, "xyz", strict=True)]
        first, others = parts[i], parts[i + 1 : i + 3]
        letters = "".join(part.axis or part.base for part in others).lower()
        bare = all(p.base in {"", first.base, p.base * (not p.axis)} and p.unit in {"", first.unit} for p in others)
        has_all_axes = {first.axis or "x", *letters} == set("xyz")
        follow = has_all_axes or (letters in {"12", "23"} and first.axis in {"", "x"})
        if (first.sensor or first.by_unit) and bare and follow:
            axes = (first.axis or "x", *letters) if has_all_axes else "xyz"
            parts[i : i + 3] = [replace(first, axis=axis) for axis in axes]
    return parts


def _clock(sample: Sample, column: int) -> Floats:
    """Numbers of a column, or seconds of its clock times; empty where it holds others."""
    numbers = sample.numbers(column)
    if np.isfinite(numbers).all():
        return numbers
    try:
        return to_seconds([sample.cells(column)], None)[0]
    except StampError:
        return numbers[:0]


def _may_be(sensor: str, part: ColumnName) -> bool:
    """Whether a column may be one of a sensor's, or has acceleration without gravity."""
    return sensor in {part.sensor, part.by_unit} or (sensor, part.sensor) == ("acc", "linear")


def _device(sample: Sample) -> tuple[int, tuple[str, ...]] | None:
    """Column that says of which of several devices a row is, and their words, where their rows stand in turns."""
    for i, name in enumerate(sample.for_cells(sample.names)):
        cells = sample.cells(i)
        words = tuple(dict.fromkeys(cells))
        named = _DEVICE.search(" ".join(re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)).lower())
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


def _time_unit(numbers: Floats, part: ColumnName, said: float = 0.0) -> tuple[str, str, bool]:
    """Unit in which steps make a plausible rate: the stated one, or nearest to 100 Hz or what is `said`; if sure."""
    steps = np.diff(numbers[np.isfinite(numbers)])
    step = float(np.mean(steps[steps >= 0.0])) if (steps > 0.0).any() else 0.0
    rates = {unit: 1.0 / to_si(step, unit) for unit in _TIMES if step > 0.0}
    said_unit = part.unit or part.base  # as of a column that is called ``min``
    if (named := canonical(said_unit, Quantity.TIME)) and step > 0.0:
        return named, f"the header says {_one_line(said_unit)}: {1.0 / to_si(step, named):.4g} Hz", True
    if "tick" in part.base:
        return "", "ticks of a length that nothing says; give unit_per_count, or declare rate = '100 Hz'", False
    if "tow" in part.base:
        return "s", "GPS time", True
    if (days := _days_since(numbers, part)) and 0.0 < (dt := to_si(step, "day")) < 2.0:
        how = f"{days} days" if days in EPOCHS else "days since 1899-12-30, as spreadsheets count them"
        return "day", f"{how}: {1.0 / dt:.4g} Hz", part.is_time or days in EPOCHS
    plausible = {unit: rate for unit, rate in rates.items() if _RATES[0] <= rate <= _RATES[1]}
    if not plausible:
        return "", f"steps of {step:.4g} make no usual rate; or delete both keys and declare rate = '100 Hz'", False
    unit = min(plausible, key=lambda name: abs(np.log(plausible[name] / (said or 100.0))))
    sure = sum(_USUAL_RATES[0] <= rate <= _USUAL_RATES[1] for rate in rates.values()) == 1 and not (steps == 1.0).all()
    why = f"steps of {step:.6g} {unit} make {plausible[unit]:.4g} Hz"
    if said and abs(np.log2(plausible[unit] / said)) > 1.0:  # twice or half: a log that leaves rows out
        why += f", but the lines above say {said:g} Hz: give unit and unit_per_count, or rate alone"
        unit, sure = "", False
    return unit, why, sure


def _days_since(numbers: Floats, part: ColumnName) -> str:
    """From when days of this century are counted, by their size; modified Julian ones only by their name, too."""
    is_modified = re.search(r"\b(mjd|julian)\b", part.base) is not None
    fitting = (epoch for epoch, (low, high) in _DAYS.items() if low <= numbers.min() and numbers.max() < high)
    return next((epoch for epoch in fitting if is_modified or epoch != "modified-julian"), "")


def _field_unit(size: float) -> _Guess:
    for unit, (low, high) in _EARTH.items():
        if low <= size <= high:
            return _Guess(unit, f"|mag| is {size:.4g}, and the Earth's field is {low:g} to {high:g} {unit}")
    return _Guess("", f"|mag| is {size:.4g}, which is the Earth's field in no usual unit: counts?", "")


def _gravity_unit(size: float) -> _Guess:
    for unit, rest in _REST.items():
        if abs(size / rest - 1.0) < _ABOUT:
            return _Guess(unit, f"|acc| is {size:.4g}, and gravity is {rest:.4g} {unit}")
    power = 2 ** round(np.log2(size)) if size > 0.0 else 0
    if 128 <= power <= 32768 and abs(size / power - 1.0) < _ABOUT:
        return _Guess("g", f"|acc| is {size:.4g}: counts, of which {power} may be 1 g", str(power))
    return _Guess("", f"|acc| is {size:.4g}, which is gravity in no usual unit: counts?", "")


def _one_line(text: str) -> str:
    """Text for a comment: no line break can end it."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
