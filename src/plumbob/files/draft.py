"""Draft the profile of an unknown text file: what its names and first numbers suggest, each guess as a question.

A guess begins with ``?``. A profile with questions is refused, so that nothing is guessed behind anyone's back. What
is certain: the layout, which every row confirms, and units that the header states in brackets and the numbers do not
contradict.
"""

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.docs import guide
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import ARRAYS, existing_file, reading, write_text
from plumbob.core.text import FactsText
from plumbob.core.units import UNITS, Quantity, canonical_name, is_name, to_si
from plumbob.data import TITLES, TRIADS, ImuData, ImuMeta
from plumbob.data.plausibility import Turning, turning
from plumbob.files.columns import FORM, has_zone, is_stamp, to_seconds
from plumbob.files.profile import AS_MOUNTED
from plumbob.files.profile_toml import GUIDE
from plumbob.files.sniff import Sample, read_sample
from plumbob.rotations import axes_letters, every_axes, in_body_axes, signed_axes

_KIND: Final = {"gyr": Quantity.RATE, "acc": Quantity.ACCELERATION, "mag": Quantity.FIELD}
_WORDS: Final = {
    "gyr": re.compile(r"g|w|gyr.*|gyro.*|omega|.*angular ?(rate|vel).*|rot.*rate|rate|.*角速度|.*陀螺.*"),
    "acc": re.compile(r"a|f|acc.*|.*accel.*|specific ?force|.*(?<!角)加速度"),
    "mag": re.compile(r"m|b|mag.*|.*compass.*|(magnetic )?field|.*磁.*"),
}
_NOT_GRAVITY: Final = re.compile(r"linear|lin[ _]|free|user|gravity")
_TIME: Final = re.compile(
    r"t|ts|time.*|.*timestamp.*|.*stamp|.*time|elapsed.*|seconds|date.*|clock.*|.*时间.*|zeit.*|temps|tiempo.*"
)
_COUNTER: Final = re.compile(r"n|i|#|no|nr|.*sample.*|.*count.*|.*index.*|.*packet.*|seq.*|row|.*序号.*")
_TEMPERATURE: Final = re.compile(r"t(emp)?_?c|.*temp.*|.*温度.*")
_SUFFIXES: Final = {"ms2": "m/s2", "mps2": "m/s2", "rads": "rad/s", "radps": "rad/s", "degs": "deg/s", "ut": "uT"}
_TIMES: Final = ("s", "ms", "us", "ns")
_RATES: Final = (0.5, 50_000.0)
"""Sampling rates that are plausible, Hz."""
_CENTURY: Final = (datetime(2000, 1, 1, tzinfo=UTC).timestamp(), datetime(2100, 1, 1, tzinfo=UTC).timestamp())
_REST: Final = {"m/s2": G0, "g": 1.0, "mg": 1000.0}
"""|acc| at rest, by unit."""
_EARTH: Final = {"uT": (22.0, 67.0), "mgauss": (220.0, 670.0), "gauss": (0.22, 0.67), "nT": (22e3, 67e3)}
"""The Earth's field, by unit: `plumbob.data.recording.EARTH_FIELD`."""
_FASTEST: Final = 70.0
"""Beyond nearly every part, rad/s: 4000 deg/s."""
_ABOUT: Final = 0.15
"""A size at rest counts as one of a unit within this fraction; a sensor that is not calibrated errs by less."""
_BEST: Final = 0.8
"""Correlation from which on other axes are proposed, where the declared ones have less than half of it."""


@dataclass(frozen=True, repr=False)
class Draft(FactsText):
    """Draft of a profile.

    Attributes
    ----------
    text : str
        The profile, TOML.
    questions : tuple of (str, str)
        Keys that a person must answer, each with what speaks for the guess.
    """

    text: str
    questions: tuple[tuple[str, str], ...]

    def facts(self) -> Mapping[str, str]:
        """Keys that a person must answer."""
        return {"questions": ", ".join(key for key, _ in self.questions) or "none"}


def profile(path: str | os.PathLike[str], *, out: str | os.PathLike[str] | None = None) -> Draft:
    """Draft the profile of a text file from its header and first rows; every guess is a question.

    Parameters
    ----------
    path : path
        The text file.
    out : path, optional
        Where to write the draft; ``NAME.profile.toml`` beside ``NAME.csv`` is found again by `plumbob.read`.

    Returns
    -------
    Draft
        The profile. `plumbob.read` refuses it until no value begins with ``?``.

    Raises
    ------
    DecodeError
        If the file holds no table of numbers, or the system refuses to write.
    ParameterError
        If `out` exists: somebody may have answered it.
    """
    file = existing_file(path)
    if out is not None and Path(out).exists():
        raise ParameterError(f"{out} exists already; answer its questions, or name another file with --out.")
    with reading(file):
        if file.suffix.lower() in ARRAYS:
            from plumbob.files.foreign.tables import listed

            raise DecodeError(
                f"profiles of arrays are not drafted; {guide('vendor-files.md')} shows one to fill in. The file holds "
                f"{listed(file)}."
            )
        draft = _DraftWriter(file.name, read_sample(file)).draft()
    if out is not None:
        write_text(out, draft.text)
    return draft


@dataclass(frozen=True, slots=True)
class _Named:
    """A column's name taken apart: what it is of, its axis, its unit, and whether brackets state that."""

    base: str
    axis: str
    unit: str
    stated: bool


@dataclass(frozen=True, slots=True)
class _Guess:
    """A unit, why, and how many counts are one: None where they are no counts, empty where it is not known."""

    unit: str = ""
    why: str = ""
    counts: str | None = None


class _DraftWriter:
    """Makes the text, key by key, and collects the questions."""

    def __init__(self, name: str, sample: Sample) -> None:
        self._name, self._sample = name, sample
        names = (*sample.names, *[""] * sample.width)[: sample.width]
        units = (*sample.units, *[""] * sample.width)[: sample.width]
        self._names, self._parts = names, [_taken_apart(*both) for both in zip(names, units, strict=True)]
        self._numbers = [sample.numbers(i) for i in range(sample.width)]
        self._time = self._time_columns()
        self._triads = self._named_triads() or self._sized_triads()
        self._turns = self._best_turning()
        self._temperature = next((i for i in self._free() if _TEMPERATURE.fullmatch(self._parts[i].base)), None)
        self._lines: list[str] = []
        self._questions: list[tuple[str, str]] = []
        self._table = ""

    def draft(self) -> Draft:
        """Write all tables."""
        if not self._triads:
            raise DecodeError(
                f"no three columns look like a gyroscope, an accelerometer or a magnetometer; {GUIDE} says how to "
                "write a profile by hand."
            )
        self._top()
        self._write_time()
        for name in (name for name in TRIADS if name in self._triads):
            self._write_triad(name, self._triads[name])
        if self._temperature is not None:
            self._open("temperature")
            self._set("column", self._ref(self._temperature), "the name of the column", ask=True)
            typical = float(np.nanmedian(self._numbers[self._temperature]))
            usual = _Guess("degC", f"{typical:.4g} is usual in degC") if -40.0 < typical < 85.0 else _Guess()
            self._write_unit(Quantity.TEMPERATURE, [self._temperature], usual)
        return Draft("\n".join(self._lines) + "\n", tuple(self._questions))

    # Columns ----------------------------------------------------------------------------------------------------------

    def _ref(self, column: int) -> int | str:
        name = self._names[column]
        return name if self._sample.by_name and name and self._names.count(name) == 1 else column + 1

    def _free(self) -> list[int]:
        """Columns of numbers that have no meaning yet."""
        taken = {*self._time, *(i for columns in getattr(self, "_triads", {}).values() for i in columns)}
        return [i for i in range(self._sample.width) if i not in taken and np.isfinite(self._numbers[i]).any()]

    def _time_columns(self) -> tuple[int, ...]:
        """Columns of time: stamps, or numbers that increase from row to row; those with a name for it come first."""
        named = [i for i, part in enumerate(self._parts) if _TIME.fullmatch(part.base)]
        others = [i for i in range(self._sample.width) if i not in named]
        for i in (*named, *others):
            cells = self._sample.cells(i)
            if all(map(is_stamp, cells)):
                return (i,)
            if i + 1 < self._sample.width and _dates(cells) and all(map(is_stamp, self._sample.cells(i + 1))):
                return (i, i + 1)
        stated = [i for i in others if self._parts[i].stated and _canonical(self._parts[i].unit, Quantity.TIME)]
        first = [] if named or stated or _COUNTER.fullmatch(self._parts[0].base) else others[:1]
        steps = {i: np.diff(self._numbers[i]) for i in (*named, *stated, *first)}
        return next(((i,) for i, step in steps.items() if step.size and (step > 0.0).all()), ())

    @property
    def _stamped(self) -> bool:
        """Whether time is dates and clock times."""
        return bool(self._time) and is_stamp(self._sample.cells(self._time[-1])[0])

    def _named_triads(self) -> dict[str, tuple[int, ...]]:
        triads: dict[str, tuple[int, ...]] = {}
        for name, words in _WORDS.items():
            sets: dict[str, dict[str, int]] = {}
            for i in self._free():
                part = self._parts[i]
                if part.axis and words.fullmatch(part.base) and not _NOT_GRAVITY.search(self._names[i].lower()):
                    sets.setdefault(part.base, {}).setdefault(part.axis, i)
            complete = [tuple(axes[letter] for letter in "xyz") for axes in sets.values() if len(axes) == 3]
            triads |= {name: complete[0]} if complete else {}
        return triads

    def _sized_triads(self) -> dict[str, tuple[int, ...]]:
        """Threes of neighbouring columns without names, by their size: gravity is steady, the field is nearly so."""
        free = self._free()
        threes = [tuple(free[i : i + 3]) for i in range(0, len(free) - 2, 3)]
        triads: dict[str, tuple[int, ...]] = {}
        for three in threes:
            size, steady = self._size(three), self._steady(three)
            name = "acc" if steady and _at_rest(size) else "mag" if steady and _of_earth(size) else "gyr"
            free_names = [other for other in (name, "acc", "gyr", "mag") if other not in triads]
            triads |= {free_names[0]: three} if free_names else {}
        return triads

    def _steady(self, columns: Sequence[int]) -> bool:
        """Whether a vector keeps its length, as gravity and a field do, and rates do not."""
        low, middle, high = np.nanquantile(np.linalg.norm(self._vectors(columns), axis=1), (0.25, 0.5, 0.75))
        return bool(high - low < 0.25 * middle)

    def _vectors(self, columns: Sequence[int]) -> Floats:
        return np.stack([self._numbers[i] for i in columns], axis=1)

    def _size(self, columns: Sequence[int], zero: float = 0.0) -> float:
        norm = np.linalg.norm(self._vectors(columns) - zero, axis=1)
        return float(np.nanmedian(norm)) if np.isfinite(norm).any() else float("nan")

    # Lines ------------------------------------------------------------------------------------------------------------

    def _open(self, table: str) -> None:
        self._table = table
        self._lines += ["", f"[{table}]"]

    def _set(self, key: str, value: object, why: str = "", *, ask: bool = False) -> None:
        """Write a key; a guess with the mark of a question."""
        if ask:
            value = ["?", *value] if isinstance(value, tuple) else f"? {value}".rstrip()
            self._questions.append((f"{self._table}.{key}".lstrip("."), why))
        text = json.dumps(list(value) if isinstance(value, tuple) else value, ensure_ascii=False)
        line = f"{key} = {text.replace(chr(127), '')}"
        self._lines.append(f"{line:<38}  # {_one_line(why)}" if why else line)

    def _top(self) -> None:
        layout = self._sample.layout
        self._lines += [
            f"# Drafted by 'plumbob profile' from the first {len(self._sample.rows)} rows of {_one_line(self._name)}.",
            "# A '?' asks you: correct what stands behind it and delete the '?'; a number or true loses its quotes.",
            "# The file is read once no '?' is left. Every key: docs/file-formats.md.",
        ]
        self._set("separator", {"\t": "tab"}.get(layout.separator, layout.separator), f"{self._sample.width} columns")
        self._set("decimal", layout.decimal)
        if layout.encoding != "utf-8":
            self._set("encoding", layout.encoding, "it is not UTF-8", ask=layout.encoding != "utf-16")
        if layout.comment:
            self._set("comment", layout.comment, "lines that begin so are left out")
        if layout.missing != type(layout)(separator=",").missing:
            self._set("missing", layout.missing, "cells without a value")
        self._set("frame", "", "ENU, NED or NWU: the frame of the attitude", ask=True)
        self._set(
            "axes", AS_MOUNTED, "body x, y, z in the axes of the sensor case; left-handed ones: own-csv.md", ask=True
        )
        self._lines.append(
            '# device = "unit 1"                     # name of this unit: a calibration card belongs to one'
        )
        if unused := [self._names[i] or f"column {i + 1}" for i in self._free() if i != self._temperature]:
            self._lines.append(f"# Not used: {_one_line(', '.join(unused))}")
        self._open("header")
        self._set("names", layout.names, "" if layout.names else "no row of names: columns are numbered from 1")
        if layout.skip:
            self._set("skip", layout.skip, "lines at the top")
        if layout.after_names:
            self._set("after_names", layout.after_names, "the row of units")

    def _write_time(self) -> None:
        self._open("time")
        if not self._time:
            self._set("rate", "", "no column increases like time: the sampling rate, as in '100 Hz'", ask=True)
            return
        refs = tuple(map(self._ref, self._time))
        if self._stamped:
            self._set("column" if len(refs) == 1 else "columns", refs[0] if len(refs) == 1 else refs)
            first = " ".join(self._sample.cells(i)[0] for i in self._time)
            self._set("format", FORM, f"the first is {first}")
            if not has_zone(first):
                self._lines.append(
                    '# zone = "+08:00"                      # what the clock is ahead of UTC, if you know'
                )
            return
        part, numbers = self._parts[self._time[0]], self._numbers[self._time[0]]
        self._set("column", refs[0], "it increases in every row", ask=True)
        unit, why = _time_unit(numbers, part)
        self._set("unit", unit, why, ask=not (part.stated and part.unit == unit))
        if unit and _CENTURY[0] < to_si(float(numbers[0]), unit) < _CENTURY[1]:
            start = datetime.fromtimestamp(to_si(float(numbers[0]), unit), UTC)
            self._set("epoch", "unix", f"since 1970 (UTC): the first is {start:%Y-%m-%d %H:%M:%S}", ask=True)

    def _write_triad(self, name: str, columns: tuple[int, ...]) -> None:
        self._open(name)
        by = "by their names" if self._parts[columns[0]].axis else "by their size"
        self._set("columns", tuple(map(self._ref, columns)), f"x, y, z of the {TITLES[name]}, {by}", ask=True)
        zero = self._middle(columns)
        guess = self._triad_unit(name, columns, zero)
        stated = self._write_unit(_KIND[name], columns, guess)
        if zero or (guess.counts is not None and not stated):
            self._set("counts_per_unit", guess.counts or "", "counts that are one unit, by the data sheet", ask=True)
        if zero:
            self._set("zero", f"{zero:g}", "whole numbers around it: counts that mean 0", ask=True)
        if name == "acc":
            self._set("sign", "specific-force", self._sign_told(columns, zero), ask=True)
        if name == "gyr" and self._turns[0] != AS_MOUNTED:
            self._write_axes(signed_axes(self._turns[0]))

    def _write_axes(self, c: Floats) -> None:
        """Write axes that fit the accelerometer, and what of that one would explain the same.

        Where the accelerometer's axes are M times those of the case, gravity turns in them as by the rates det(M) M ω.
        """
        self._set("axes", axes_letters(c), "so it turns as the accelerometer sees gravity turn", ask=True)
        if np.linalg.det(c) < 0.0:
            self._set("mirrored", "true", "these axes are left-handed", ask=True)
            return
        self._lines += [
            f'# Or these are right, and those of [acc] are not: axes = "{axes_letters(c.T)}" if it sits turned,',
            f'# axes = "{axes_letters(-c.T)}" and mirrored = true if it is left-handed. See the data sheets.',
        ]

    def _write_unit(self, kind: Quantity, columns: Sequence[int], guess: _Guess) -> bool:
        """Write the unit; True where the header states it, and the numbers do not contradict."""
        part = self._parts[columns[0]]
        named = _canonical(part.unit, kind)
        if named and part.stated and guess.unit in {"", named} and not guess.counts:
            self._set("unit", named, f"the header says [{_one_line(part.unit)}]")
            return True
        fitting = ", ".join(name for name, unit in UNITS.items() if unit.quantity is kind)
        said = f"the header says {_one_line(part.unit)}; " if part.unit else ""
        self._set("unit", guess.unit or named, f"{said}{guess.why or f'one of {fitting}'}", ask=True)
        return False

    # Guesses ----------------------------------------------------------------------------------------------------------

    def _middle(self, columns: Sequence[int]) -> float:
        """Middle of unsigned counts; 0 where they are none."""
        values = self._vectors(columns)
        counts = values[np.isfinite(values).all(axis=1)]
        if not counts.size or counts.min() < 0.0 or (counts != np.rint(counts)).any():
            return 0.0
        typical = float(np.median(counts))
        return next((half for half in (32768.0, 8192.0, 2048.0, 512.0) if abs(typical - half) < 0.1 * half), 0.0)

    def _triad_unit(self, name: str, columns: Sequence[int], zero: float) -> _Guess:
        """Unit and reason, as far as the numbers tell."""
        size = self._size(columns, zero)
        if name == "acc":
            return _gravity_unit(size)
        return _field_unit(size) if name == "mag" else self._rate_unit(columns, zero)

    def _rate_unit(self, columns: Sequence[int], zero: float) -> _Guess:
        fit = self._turns[1]
        if fit is not None and fit.tells:
            for unit in ("rad/s", "deg/s", "mdeg/s"):
                if abs(np.log2(abs(fit.factor) / to_si(1.0, unit))) < 1.0:
                    return _Guess(unit, "so it turns as fast as the accelerometer sees gravity turn")
            return _Guess("deg/s", f"1 deg/s may be {to_si(1.0, 'deg/s') / abs(fit.factor):.4g} counts", "")
        rates = self._vectors(columns) - zero
        largest = float(np.nanmax(np.abs(rates)))
        if largest > _FASTEST and _canonical(self._parts[columns[0]].unit, Quantity.RATE) in {"", "rad/s"}:
            integers = bool((rates[np.isfinite(rates)] % 1.0 == 0.0).all())
            return _Guess("deg/s", f"the largest is {largest:.4g}: not rad/s", "" if integers else None)
        return _Guess()

    def _seconds(self) -> Floats | None:
        """Time, s from the first row; None where it is not known or does not increase."""
        if not self._time:
            return None
        if self._stamped:
            t = to_seconds([self._sample.cells(i) for i in self._time], None)[0]
        else:
            numbers = self._numbers[self._time[0]]
            unit = _time_unit(numbers, self._parts[self._time[0]])[0]
            t = to_si(numbers - numbers[0], unit) if unit else numbers[:0]
        return t if t.size and (np.diff(t) > 0.0).all() else None

    def _best_turning(self) -> tuple[str, Turning | None]:
        """Axes by which the gyroscope turns as the accelerometer does: its own, unless others fit far better."""
        t, gyr, acc = self._seconds(), self._triads.get("gyr"), self._triads.get("acc")
        if t is None or gyr is None or acc is None:
            return AS_MOUNTED, None
        rates, force = (self._vectors(columns) - self._middle(columns) for columns in (gyr, acc))
        mounted = _turning_fit(t, rates, force)
        if mounted is None or not mounted.windows or mounted.correlation > 0.5 * _BEST:
            return AS_MOUNTED, mounted
        fits = {axes: _turning_fit(t, in_body_axes(axes, rates), force) for axes in map(axes_letters, every_axes())}
        axes, best = max(fits.items(), key=lambda fit: fit[1].correlation if fit[1] else 0.0)
        return (axes, best) if best is not None and best.tells and best.correlation > _BEST else (AS_MOUNTED, mounted)

    def _sign_told(self, columns: Sequence[int], zero: float) -> str:
        mean = np.nanmean(self._vectors(columns) - zero, axis=0)
        axis = int(np.argmax(np.abs(mean)))
        up = "up" if mean[axis] > 0.0 else "down"
        return f"right if {'xyz'[axis]} points {up} here, where it reads {mean[axis]:.3g}; otherwise 'gravity'"


def _turning_fit(t: Floats, rates: Floats, force: Floats) -> Turning | None:
    """How the force follows the rates, whatever their units; None where one is zero or not known throughout."""
    fastest, largest = (float(np.nanmax(np.abs(values), initial=0.0)) for values in (rates, force))
    if not (0.0 < fastest < np.inf and 0.0 < largest < np.inf):
        return None
    triads = {"gyr": rates / fastest, "acc": force / largest}  # within the range of every sensor
    t_ns, none = np.rint(t * 1e9).astype(np.int64), np.zeros(t.size, dtype=np.uint32)
    fit = turning(ImuData.live(t_ns, triads, flags=none, meta=ImuMeta(unit_check=False)))
    return replace(fit, factor=fit.factor / fastest)


def _taken_apart(name: str, unit: str) -> _Named:
    bracket = re.search(r"[\[(]([^\])]*)[\])]", unit) or re.search(r"[\[(]([^\])]*)[\])]", name)
    stated = bracket[1].strip() if bracket else unit.strip()
    plain = re.sub(r"[\[(][^\])]*[\])]", " ", name)
    words = re.sub(r"[_.\-:]+", " ", plain).split()
    suffix = words.pop() if not stated and len(words) > 1 and _unit_word(words[-1]) else ""
    base, axis = _split_axis(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", " ".join(words)).split())
    return _Named(base, axis, stated or _unit_word(suffix), bool(stated))


def _split_axis(words: list[str]) -> tuple[str, str]:
    """What is left of a name without its axis, and the axis: a word of its own, or the last letter."""
    for i, word in enumerate(words):
        if word.lower() in {"x", "y", "z"}:
            return " ".join(words[:i] + words[i + 1 :]).lower(), word.lower()
    name = " ".join(words).lower()
    return (name[:-1].strip(), name[-1]) if name[-1:] in {"x", "y", "z"} else (name, "")


def _unit_word(word: str) -> str:
    """Unit that the last word of a name may be, as in ``acc_x_mg``."""
    unit = _SUFFIXES.get(word.lower(), word)
    kinds = (*_KIND.values(), Quantity.TIME, Quantity.TEMPERATURE)
    return next((name for kind in kinds if (name := _canonical(unit, kind))), "") if unit else ""


def _canonical(name: str, kind: Quantity) -> str:
    return canonical_name(name, kind) if is_name(name, kind) else ""


def _dates(cells: Sequence[str]) -> bool:
    return all(re.fullmatch(r"\d{4}([-/])\d{1,2}\1\d{1,2}", cell) for cell in cells)


def _time_unit(numbers: Floats, part: _Named) -> tuple[str, str]:
    """Unit in which steps make a plausible rate: the stated one, or that nearest to 100 Hz."""
    step = float(np.median(np.diff(numbers)))
    rates = {unit: 1.0 / to_si(step, unit) for unit in _TIMES if step > 0.0}
    named = _canonical(part.unit, Quantity.TIME)
    if named in rates:
        return named, f"the header says {_one_line(part.unit)}: {rates[named]:.4g} Hz"
    plausible = {unit: rate for unit, rate in rates.items() if _RATES[0] <= rate <= _RATES[1]}
    if not plausible:
        return "", f"steps of {step:.4g} make no usual rate; or delete both keys and declare rate = '100 Hz'"
    unit = min(plausible, key=lambda name: abs(np.log(plausible[name] / 100.0)))
    return unit, f"steps of {step:.6g} {unit} make {plausible[unit]:.4g} Hz"


def _at_rest(size: float) -> bool:
    return any(abs(size / rest - 1.0) < _ABOUT for rest in _REST.values()) or size > 2000.0


def _of_earth(size: float) -> bool:
    return any(low <= size <= high for low, high in _EARTH.values())


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
