"""What the columns of a table are: which is time, which three are a sensor's, and what speaks for it."""

import json
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import product, takewhile
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ClockError, DecodeError
from plumbob.core.time import to_s
from plumbob.core.units import QUANTITY_BY_TRIAD, Quantity, to_si
from plumbob.data import TRIADS, ImuData, ImuMeta
from plumbob.data.plausibility import ENOUGH_EFFECTIVE, Turning, turning
from plumbob.files.column_names import (
    COMPONENTS,
    REVERSED,
    TABLES,
    TEMPERATURE,
    ColumnName,
    attitude_names,
    canonical,
    named_sensor,
    said_units,
    taken_apart,
)
from plumbob.files.columns import StampError, is_stamp, is_time_of_day, to_seconds
from plumbob.files.known_logs import KNOWN
from plumbob.files.profile import AS_MOUNTED, EPOCHS
from plumbob.files.sniff import FEWEST, Sample, rises
from plumbob.files.stamps import falls, time_line
from plumbob.files.text_table import LEFT_OUT_MOST
from plumbob.rotations import axes_letters, every_axes, in_body_axes

_TIMES: Final = ("s", "ms", "us", "ns")
_RATES: Final = (0.5, 50_000.0)  # sampling rates that are plausible, Hz
_DAYS: Final = {  # of 2000 and 2100; those since 1899-12-30 until 2041, as then they may be modified Julian
    "spreadsheet": (36_526.0, 51_544.0), "julian": (2_451_544.5, 2_488_069.5), "modified-julian": (51_544.0, 88_069.0),
}  # fmt: skip
_HUNDRED_NS: Final = ((1.2591e17, 1.5747e17), (6.3082e17, 6.6239e17))
"""Steps of 100 ns since 1601 (FILETIME) and since the year 1 (.NET), from 2000 to 2100."""
_USUAL_RATES: Final = (4.0, 9000.0)  # sampling rates of inertial sensors in use, Hz
_UNIT_NORM: Final = 0.02
TURNED: Final = 0.01  # spread of directions that turn by ± 8° about an axis: what turns gravity turns a field, too
_RARELY: Final = 0.02  # how often an axis of a sensor changes, in parts of the one that changes most, at least
_SERIES: Final = 60  # columns without names above which a row is a series of one quantity
RELATIVE: Final = (0.67, 2.5)  # |mag| of units in which the field at the place of calibration is 1, beyond gauss
ANGLES: Final = ("yaw", "pitch", "roll")
_REST: Final = {"m/s2": G0, "g": 1.0, "mg": 1000.0}  # |acc| at rest, by unit
_EARTH: Final = {"uT": (22, 67), "mgauss": (220, 670), "gauss": (0.22, 0.67), "nT": (22e3, 67e3), "T": (22e-6, 67e-6)}
_FASTEST: Final = 70.0  # beyond nearly every part, rad/s: 4000 deg/s
ABOUT: Final = 0.15  # fraction within which a size at rest is of a unit; an uncalibrated sensor errs by less
_BEST: Final = 0.8  # correlation above which other axes are proposed, where the declared ones have less than half of it


@dataclass(frozen=True, slots=True)
class Guess:
    """A unit, why, and how many counts are one: None where it is in its unit, empty where it is not known."""

    unit: str = ""
    why: str = ""
    counts: str | None = None


class ColumnEvidence:
    """What the names and the first numbers of a table say of its columns."""

    def __init__(self, name: str, sample: Sample, *, stream: str, answers: Mapping[str, Any]) -> None:
        self.names = sample.for_cells(sample.names if any(sample.names) else _spelled(sample))
        if len(self.names) > _SERIES and not any(self.names) and not rises(sample.numbers(0)):
            raise DecodeError(
                f"its rows have {len(self.names)} numbers and no names, so a row is a series of one quantity. Write a "
                "row for each sample and a column for each axis, below names."
            )
        units = sample.for_cells(sample.units)
        levels = zip(*(name.split("/")[:-1] for name in self.names), strict=False)  # groups that hold all arrays
        groups = (level[0] for level in takewhile(lambda level: len({*level}) == 1, levels))
        above = "".join(f"{group}/" for group in takewhile(lambda group: not taken_apart(group).sensor, groups))
        names = [name.removeprefix(above) for name in self.names]
        self.parts = [taken_apart(*both) for both in zip(names, units, strict=True)]
        stated = said_units(sample.preamble)
        self.parts = [p if p.unit else replace(p, unit=stated.get(p.sensor, "")) for p in self.parts]
        clocks = [_clock(sample, i) for i, part in enumerate(self.parts) if part.is_time]
        if clocks := [clock for clock in clocks if clock.size]:
            sample = replace(sample, rows=sample.rows[::-1]) if all(map(falls, clocks)) else sample
        self.name, self.sample, self.stream, self.answers = name, sample, stream, answers
        self.parts = _with_axes(_turn_rates(self.parts, self.names))
        self.sensor = sample.sensor or (
            "" if any(p.axis and p.sensor and not p.is_bare for p in self.parts) else named_sensor(Path(name).stem)
        )
        if base := {"linear": "linear acc"}.get(self.sensor, self.sensor):
            named = [replace(p, base=base) if p.axis and (p.is_bare or not p.sensor) else p for p in self.parts]
            self.parts = [p if q.sensor == "other" else q for p, q in zip(self.parts, named, strict=True)]
        self.numbers = [sample.numbers(i) for i in range(sample.width)]
        for i, (part, numbers) in enumerate(zip(self.parts, self.numbers, strict=True)):
            if not part.stated and any(low <= np.nanmin(numbers, initial=np.inf) < high for low, high in _HUNDRED_NS):
                self.parts[i] = replace(part, unit="us", scale=0.1)
            self.numbers[i] = numbers if self.parts[i].scale == 1.0 else numbers * self.parts[i].scale
            if part.is_time or not (i or any(self.names)):
                self.numbers[i] = _between_stamps(self.numbers[i])
        log = next((log for log in KNOWN if log.fits(sample.names, sample.facts)), None)
        self.log_answers, self.log_name = (log.said(sample.facts), log.name) if log else ({}, "")
        self.triads: dict[str, tuple[int, ...]] = {}
        self._clocks = self._first_of_four()
        self.time = self._time_columns()
        self.quaternion = self._quaternion_columns()
        bases = [re.sub("elevation", "pitch", re.sub("heading|azimuth", "yaw", part.base)) for part in self.parts]
        angles: dict[str, int] = {
            name: i
            for i, (base, part) in enumerate(zip(bases, self.parts, strict=True))
            for name in ([] if self.quaternion or part.sensor == "other" else ANGLES)
            if (name in base.split() if part.unit_as(Quantity.ANGLE) else base == name and not part.unit)
        }
        refs = answers.get("reference.columns", ())
        angles |= {name: self._place("reference.columns", ref) for name, ref in zip(ANGLES, refs, strict=False)}
        self.angles = () if self.quaternion or len(angles) < len(ANGLES) else tuple(angles[name] for name in ANGLES)
        self.is_reassigned = False  # whether answers contradict what columns without names were taken for
        self.plus: tuple[int, ...] = ()  # columns that are added to the accelerometer's
        # angles and unit quaternions whose order nothing says
        self._unordered = {i for i, name in enumerate(self.names) if not sample.names and name.startswith("angle")}
        self.triads = self._named_triads() or (self._sized_triads() if self._is_nameless() else {})
        self.triads = {name: of for name, of in self._answered_triads().items() if of}
        self._add_answered()
        heat = [i for i in self.free() if TEMPERATURE.fullmatch(self.parts[i].base)]
        said = [i for i in heat if "temperature.unit" in answers or self.parts[i].unit_as(Quantity.TEMPERATURE)]
        self.temperature = next((i for i in heat if i in said or self.usual_degc(i).unit), None)

    def refs(self, columns: Sequence[int]) -> tuple[int | str, ...]:
        """What a profile calls columns."""
        return tuple(map(self.sample.ref, columns))

    def free(self) -> list[int]:
        """Columns of numbers that have no meaning yet."""
        taken = {*self.time, *self._clocks, *self.quaternion, *self.angles, *self._unordered}
        taken |= {i for columns in self.triads.values() for i in columns} | {*self.plus}
        return [i for i in range(self.sample.width) if i not in taken and np.isfinite(self.numbers[i]).any()]

    def _varying(self) -> list[int]:
        """Those of them that are not the same in all rows."""
        return [i for i in self._unsteady() if np.nanmin(self.numbers[i]) < np.nanmax(self.numbers[i])]

    def _unsteady(self) -> list[int]:
        """Those of them that do not rise from row to row, as counters do, and no sensor with its noise."""
        return [i for i in self.free() if np.mean(np.diff(self.numbers[i]) > 0.0) <= 1.0 - LEFT_OUT_MOST]

    def _place(self, key: str, ref: Any) -> int:
        """Place of a column that an answer names."""
        places = [self.names.index(ref)] if ref in self.names else [ref - 1] if type(ref) is int else []
        if not places or not 0 <= places[0] < self.sample.width:
            names = ", ".join(filter(None, self.names)) or f"the numbers 1 to {self.sample.width}"
            raise DecodeError(f"the answer {key} names the column {ref!r}, which is not there; known: {names}.")
        return places[0]

    def _answered_triads(self) -> dict[str, tuple[int, ...]]:
        """Triads whose columns are answered; an empty list leaves one out.

        The other columns without names are then assigned again, each as a question.
        """
        keys = {name: f"{name}.columns" for name in TRIADS}
        answered = {
            name: tuple(self._place(key, ref) for ref in self.answers[key])
            for name, key in keys.items()
            if key in self.answers and (name in self.triads or not self.stream)
        }
        is_other = any(of and of != self.triads.get(name) for name, of in answered.items())
        if not (is_other and self._is_nameless()):
            return self.triads | answered
        self.triads, self.is_reassigned = answered, True
        self._add_answered()
        return self._sized_triads() | answered

    def _time_columns(self) -> tuple[int, ...]:
        """Columns of time: stamps, or numbers that rise from row to row; those with a unit and a name come first."""
        if "time.column" in self.answers:
            keys = [key for key in ("time.column", "time.seconds") if key in self.answers]
            return tuple(self._place(key, self.answers[key]) for key in keys)
        named = [i for i, part in enumerate(self.parts) if part.is_time]
        if clocks := list(filter(self._is_time_of_day, named)):
            return (clocks[0],)
        if rising := [i for i in named if rises(self.numbers[i])]:
            return self._in_two_parts() or (min(rising, key=self._time_rank),)
        others = [i for i in range(self.sample.width) if i not in named]
        for i in (*named, *others):
            cells, beside = self.stamps(i), self.stamps(min(i + 1, self.sample.width - 1))
            if all(map(is_stamp, cells)):
                # parts of a second stand in the cell behind a comma
                parts = (
                    len({*beside}) > 1
                    and len(cells) == len(beside)
                    and all(re.fullmatch(r"\d{3}|\d{6}", cell) for cell in beside)
                )
                return (i, i + 1) if parts and (np.diff(to_seconds([cells, beside], None)[0]) > 0.0).all() else (i,)
            dates = all(re.fullmatch(r"\d{4}([-/])\d{1,2}\1\d{1,2}", cell) for cell in cells)
            if dates and all(map(is_stamp, beside)):
                return (i, i + 1)
        return self._clocks[:1] or (() if named else self._rising_column())

    def stamps(self, column: int) -> list[str]:
        """Cells of a column; of one of time those that are not blank, where bursts have a stamp each."""
        cells = self.sample.cells(column)
        stamps = [*filter(None, cells)] if self.parts[column].is_time else cells
        return stamps if len(stamps) >= FEWEST else cells

    def _is_time_of_day(self, column: int) -> bool:
        """Whether numbers are clock times as hhmmss, by their name or because they jump by 40 at each minute."""
        cells, steps = self.sample.cells(column), np.diff(self.numbers[column])
        if not all(map(is_time_of_day, cells)):
            return False
        jumps = bool(((steps > 40.0) & (steps < 41.0 + np.median(steps))).any())
        is_utc = "utc" in self.parts[column].base and all(re.match(r"\d{6}", cell) for cell in cells)
        return jumps or is_utc or re.search(r"hhmmss|hms", self.parts[column].base) is not None

    def _rising_column(self) -> tuple[int, ...]:
        """First column of numbers that rise as a clock does: of those without a name, or the very first one."""
        nameless = self._is_nameless()
        for i, part in enumerate(self.parts):
            steps = np.diff(self.numbers[i])
            counts = bool((steps == 1.0).all()) and not nameless
            alone = not part.axis or all(other.axis != "y" or other.base != part.base for other in self.parts)
            bare = not part.is_counter and not part.sensor and (nameless or alone)
            rises = steps.size and (np.mean(steps > 0.0) > 1.0 - LEFT_OUT_MOST if i == 0 else (steps > 0.0).all())
            if bare and not counts and rises and (nameless or not i or not self.names[i]):
                return (i,)
        return self._in_two_parts() if nameless else ()

    def _in_two_parts(self) -> tuple[int, ...]:
        """Columns of whole seconds, which repeat, and of the parts of them, which begin again as they go on."""
        for i, k in product(range(self.sample.width), repeat=2):
            seconds, unit = self.numbers[i], self.part_of_second(k)
            if unit and (seconds == np.rint(seconds)).all() and (np.diff(seconds) == 0.0).any():
                seconds = np.unwrap(seconds, period=60.0) if seconds.max() < 60.0 else seconds  # of a minute
                t = seconds - seconds[0] + to_si(self.numbers[k], unit)
                is_short = not np.ptp(seconds) and self.parts[i].is_time and self.parts[k].is_time  # as of one second
                if (np.diff(t) > 0.0).all() and (is_short or (np.diff(self.numbers[k]) < 0.0).any()):
                    return (k, i)
        return ()

    def part_of_second(self, column: int) -> str:
        """Unit in which all numbers of a column are parts of a second; empty for none."""
        low, high = self.numbers[column].min(), self.numbers[column].max()
        return next((unit for unit in _TIMES[1:] if low >= 0.0 and 0.1 < to_si(high, unit) < 1.0), "")

    def _first_of_four(self) -> tuple[int, ...]:
        """Columns of time that stand before the three of their triad, in arrays of four."""
        firsts = []
        for i, part in enumerate(self.parts[:-3]):
            four = [other.axis for other in self.parts[i : i + 4] if other.base == part.base]
            more = any(other.base == part.base and other.axis == "5" for other in self.parts)
            is_time = four == list("1234") and not more and rises(self.numbers[i])
            if is_time and not any(rises(self.numbers[k]) for k in range(i + 1, i + 4)):
                firsts.append(i)
        return tuple(firsts)

    def _time_rank(self, column: int) -> tuple[bool, bool, bool, bool]:
        """Which of several clocks is taken: one that does not begin again, of single samples, in a unit that it has."""
        steps = np.diff(self.numbers[column])
        repeats = bool(np.sum(steps > 0.0) < 0.5 * steps.size)
        part = self.parts[column]
        has_unit = bool(canonical(part.unit or part.base, Quantity.TIME))
        return bool((steps < 0.0).any()), "tick" in part.base, repeats, not has_unit

    @property
    def stamped(self) -> bool:
        """Whether time is dates and clock times."""
        return any(is_stamp(self.stamps(i)[0]) or self._is_time_of_day(i) for i in self.time)

    def _quaternion_columns(self) -> tuple[int, ...]:
        """Columns w, x, y, z of unit quaternions: as answered, by words of their names, or by these letters alone."""
        if refs := self.answers.get("reference.columns", ()):
            return tuple(self._place("reference.columns", ref) for ref in refs) if len(refs) == len("wxyz") else ()
        sets: dict[str, dict[str, int]] = {}
        for i, part in enumerate(self.parts):
            if part.quaternion:
                sets.setdefault(part.base, {}).setdefault(part.axis, i)
            elif letter := COMPONENTS.get(self.names[i].strip().lower()):
                sets.setdefault("", {}).setdefault(letter, i)
        for axes in sets.values():
            for order in ("wxyz", "0123"):
                columns = tuple(axes[letter] for letter in order if letter in axes)
                if len(columns) == 4 and abs(self.size(columns) - 1.0) < _UNIT_NORM:
                    return columns
        return ()

    def _is_nameless(self) -> bool:
        """Whether columns have no names, but those of axes, or the one of the array that they all stand in."""
        numbered = [re.fullmatch(r"(.*)\[\d+\]", name) for name in self.sample.names]
        axes = [bool(part.axis and part.is_bare and not part.unit) for part in self.parts]  # of sensors without names
        are_axes = all(axis or part.is_time or part.is_counter for axis, part in zip(axes, self.parts, strict=True))
        one_array = all(numbered) and len({match[1] for match in numbered if match}) <= 1
        return one_array or (are_axes and sum(axes) > len("xyz"))

    def _named_triads(self) -> dict[str, tuple[int, ...]]:
        triads: dict[str, tuple[int, ...]] = {}
        sets = {name: self.threes(partial(may_be, name)) for name in TRIADS}
        # that hold more than zeros, and gravity where their words do not say that they are an acceleration
        sets = {name: [s for s in threes if np.any(self.vectors(s))] for name, threes in sets.items()}
        sets["acc"] = [s for s in sets["acc"] if self.parts[s[0]].sensor == "acc" or self._has_gravity(s)]
        of_units = [(min(three), self._unit_of(three), name) for name, threes in sets.items() for three in threes]
        sensors = Counter(unit for unit, _ in dict.fromkeys((unit, name) for _, unit, name in sorted(of_units)))
        unit = sensors.most_common(1)[0][0] if sensors else ""  # the first one of those that have most of them
        for name, complete in sets.items():
            ranked = sorted(map(self._right_handed, complete), key=lambda columns: self._rank(name, columns, unit))
            triads |= {name: ranked[0]} if ranked else {}
        linear = [triads["acc"]] if "acc" in triads else self.threes(lambda part: part.sensor == "linear")
        gravity = self.threes(lambda part: re.search(r"\bgrav(ity)?\b", part.base) is not None)
        for without, down in zip(linear[:1], gravity[:1], strict=False):
            same_unit = self.parts[down[0]].unit == self.parts[without[0]].unit
            along = np.sum(self.vectors(without) * self.vectors(down), axis=1)  # much where gravity is in it already
            if same_unit and self._has_gravity(down) and abs(np.nanmedian(along)) < 0.5 * self.size(down) ** 2:
                triads["acc"] = without
                self._add(without, down)
        if "gyr" not in triads and "acc" in triads and (turning := self._turning_three(triads["acc"])):
            triads["gyr"] = turning
        gyr = triads.get("gyr", ())
        if gyr and "acc" not in triads and self.parts[gyr[0]].base == "g" and self._has_gravity(gyr):  # ``G(x)``
            triads["acc"] = triads.pop("gyr")
        if "acc" not in triads and (triads or not self._is_nameless()):  # a steady vector of the size of gravity: asked
            for i in self.free()[:-2]:
                three = [p for p in self.parts[i : i + 3] if not (p.sensor or p.unit) and (triads or p.is_bare)]
                if [part.axis for part in three] == list("xyz") and self._has_gravity((i, i + 1, i + 2)):
                    return triads | {"acc": (i, i + 1, i + 2)}
        return triads

    def _add_answered(self) -> None:
        """Add the columns that an answer names."""
        if "acc.plus" in self.answers and self.triads.get("acc") and not self.plus:
            self._add(self.triads["acc"], tuple(self._place("acc.plus", ref) for ref in self.answers["acc.plus"]))

    def _add(self, acc: Sequence[int], plus: tuple[int, ...]) -> None:
        """Add columns to those of the accelerometer."""
        self.plus = plus
        for i, k in zip(acc, plus, strict=True):
            self.numbers[i] = self.numbers[i] + self.numbers[k]

    def _turning_three(self, acc: Sequence[int]) -> tuple[int, ...]:
        """Columns whose names say no rate, as ``Rotation.roll``, that turn as the accelerometer sees gravity turn."""
        rolls: dict[str, dict[str, int]] = {}
        for i, (axis, word) in product(self.free(), zip("xyz", ("roll", "pitch", "yaw"), strict=True)):
            if word in (base := self.parts[i].base):
                rolls.setdefault(base.replace(word, ""), {})[axis] = i
        threes = [tuple(axes[letter] for letter in "xyz") for axes in rolls.values() if len(axes) == len("xyz")]
        return next(iter(self._turning([*threes, *self.threes(lambda part: not part.sensor)], self.vectors(acc))), ())

    def _turning(self, threes: Sequence[tuple[int, ...]], force: Floats) -> list[tuple[int, ...]]:
        """Those that turn as the accelerometer sees gravity turn."""
        t, rows = self._seconds(), min(len(force), len(self.sample.rows))
        fits = [_turning_fit(t[:rows], self.vectors(three)[:rows], force[:rows]) for three in threes if t is not None]
        turn = [fit is not None and fit.effective >= ENOUGH_EFFECTIVE and fit.correlation > _BEST for fit in fits]
        return [three for three, turns in zip(threes, turn, strict=False) if turns]

    def threes(self, belongs: Callable[[ColumnName], bool]) -> list[tuple[int, ...]]:
        """Columns x, y, z of the same words and unit, of those that belong."""
        sets: dict[str, dict[str, int]] = {}
        for i in self.free():
            part = self.parts[i]
            if part.axis and belongs(part):
                sets.setdefault(f"{part.base} {part.unit}", {}).setdefault(part.axis, i)
        return [
            tuple(axes[letter] for letter in letters)
            for axes in sets.values()
            for letters in ("xyz", "012", "123", "234")
            if set(letters) == set(axes) or (letters == "xyz" and set(letters) <= set(axes))
        ]

    def _has_gravity(self, columns: Sequence[int]) -> bool:
        return self._steady(columns) and bool(gravity_unit(self.size(columns)).unit)

    def _right_handed(self, columns: tuple[int, ...]) -> tuple[int, ...]:
        """Columns x, y, z in their order; forward, right and up are right-handed as right, forward and up."""
        bares = {i: REVERSED.sub("", self.names[i]) for i in columns}
        against = sum(bare != self.names[i] and not taken_apart(bare).axis for i, bare in bares.items())
        return (columns[1], columns[0], columns[2]) if against % 2 else columns

    def _unit_of(self, columns: Sequence[int]) -> str:
        """Words of a name that say no sensor, as of the unit that it is of."""
        return " ".join(word for word in self.parts[columns[0]].base.split() if not taken_apart(f"{word} x").sensor)

    def _rank(self, name: str, columns: Sequence[int], unit: str) -> tuple[bool, ...]:
        """Which of several sets is the sensor's: with gravity, of the unit of the others, in its unit, not derived."""
        part = self.parts[columns[0]]
        lacks_gravity = name == "acc" and not self._has_gravity(columns)
        has_no_unit = not part.unit_as(QUANTITY_BY_TRIAD[name])
        derived = re.search(r"\b(rate|filt\w*|smooth\w*|lp|lpf|mean|avg|average)\b", part.base) is not None
        return lacks_gravity, part.sensor == "linear", self._unit_of(columns) != unit, has_no_unit, derived

    def _sized_triads(self) -> dict[str, tuple[int, ...]]:
        """Threes of neighbouring columns without names, by their size: gravity is steady, the field is nearly so.

        Constants and quaternions are left out; of several others, rates are what turns as gravity does.
        """
        free = self._unsteady()
        if self.sensor in TRIADS and len(free) == len("xyz"):
            return {self.sensor: tuple(free)}
        for four in [range(i, i + 4) for i in self._varying()]:
            if {*four} <= {*self._varying()} and _are_unit(self.vectors(four)):
                self._unordered |= {*four}
        varying = self._varying()
        more = len(free) > len("xyz") * len(TRIADS) and not len(varying) % len("xyz")
        free = varying if len(free) % len("xyz") or more else free
        if not any(f"{name}.columns" in self.answers for name in TRIADS):
            self._require_one_unit(varying)
        threes = [tuple(free[i : i + 3]) for i in range(0, len(free) - 2, 3)]
        threes = [three for three in threes if self._change_alike(three)]
        triads: dict[str, tuple[int, ...]] = {}
        for three in filter(self._steady, threes):
            size = self.size(three)
            at_rest = size > 2000.0 or any(abs(size / rest - 1.0) < ABOUT for rest in _REST.values())
            is_field = field_unit(size).unit and np.ptp(self.vectors(three), axis=0).all()
            triads = ({"acc": three} if at_rest else {"mag": three} if is_field else {}) | triads
        others = [three for three in threes if three not in triads.values()]
        acc = self.triads.get("acc") or triads.get("acc")
        turning = self._turning(others, self.vectors(acc)) if acc and len(others) > 1 else []
        names = [name for name in ("gyr", "acc", "mag") if name not in triads | self.triads]
        names = [name for name in names if name != "mag"] if self.is_reassigned else names  # a field has its size
        return triads | dict(zip(names, sorted(others, key=lambda three: three not in turning), strict=False))

    def _require_one_unit(self, columns: Sequence[int]) -> None:
        """Refuse columns without names of which several threes have gravity: they are of several units or ranges."""
        threes: list[tuple[int, ...]] = []
        for three in zip(columns, columns[1:], columns[2:], strict=False):
            if three[2] - three[0] == 2 and self._has_gravity(three) and not {*three} & {*(threes or [()])[-1]}:
                threes.append(three)
        if len(threes) > 1:
            listed = [",".join(map(json.dumps, self.refs(three))) for three in threes]
            raise DecodeError(
                f"its columns have no names, and {len(threes)} threes of them could be the accelerometer: "
                f"{'; '.join(listed)}. Name those of the sensors by the description of the file, as with --set "
                f"acc.columns={listed[0]} --set gyr.columns=…"
            )

    def _steady(self, columns: Sequence[int]) -> bool:
        """Whether a vector keeps its length, as gravity and a field do, and rates do not."""
        low, middle, high = np.quantile(self._norms(columns), (0.25, 0.5, 0.75))
        return bool(high - low < 0.25 * middle)

    def spread(self, columns: Sequence[int]) -> float:
        """How far directions are spread, from 0 to 1."""
        vectors = self.vectors(columns)
        sizes = np.linalg.norm(vectors, axis=1, keepdims=True)
        return 1.0 - float(np.linalg.norm(np.nanmean(vectors / np.where(sizes > 0.0, sizes, np.nan), axis=0)))

    def _change_alike(self, columns: Sequence[int]) -> bool:
        """Whether some axes change, about as often as each other, as those of one sensor; light and a button do not."""
        changes = np.mean(np.diff(self.vectors(columns), axis=0) != 0.0, axis=0)
        return bool(changes.any()) and not 0.0 < float(changes.min()) < _RARELY * float(changes.max())

    def _norms(self, columns: Sequence[int], zero: float = 0.0) -> Floats:
        """Sizes of a vector where it is measured: neither missing nor exactly zero; NaN for none."""
        norms = np.linalg.norm(self.vectors(columns) - zero, axis=1)
        return norms[norms > 0.0] if (norms > 0.0).any() else np.array([np.nan])

    def vectors(self, columns: Sequence[int]) -> Floats:
        """Numbers (N, k) of columns."""
        return np.stack([self.numbers[i] for i in columns], axis=1)

    def are_whole(self, columns: Sequence[int]) -> bool:
        """Whether all are whole numbers."""
        return not (np.nan_to_num(self.vectors(columns)) % 1.0).any()

    def size(self, columns: Sequence[int], zero: float = 0.0) -> float:
        """Median length of a vector."""
        return float(np.median(self._norms(columns, zero)))

    def usual_degc(self, column: int) -> Guess:
        """Unit of a temperature by its size."""
        typical = float(np.nanmedian(self.numbers[column]))
        return Guess("degC", f"{typical:.4g} is usual in degC") if -40.0 < typical < 85.0 else Guess()

    def is_sure_by_size(self) -> bool:
        """Whether triads without names are surely these: gravity, perhaps the Earth's field, one that is neither."""
        acc, mag, gyr = (self.triads.get(name) for name in ("acc", "mag", "gyr"))
        if acc is None or self.is_reassigned or len(self._varying()) >= len("xyz"):
            return False
        is_normal = bool(np.ptp(self._norms(acc)) < 1e-3 * self.size(acc))  # directions, which no sensor measures
        steady = self._has_gravity(acc) and not (self._steady(gyr) if gyr else is_normal)
        return steady and (mag is None or (self._steady(mag) and bool(field_unit(self.size(mag)).unit)))

    def middle(self, columns: Sequence[int]) -> float:
        """Middle of unsigned counts; 0 where they are none."""
        values = self.vectors(columns)
        counts = values[np.isfinite(values).all(axis=1)]
        if not counts.size or counts.min() < 0.0 or (counts != np.rint(counts)).any():
            return 0.0
        typical = float(np.median(counts))
        return next((half for half in (32768.0, 8192.0, 2048.0, 512.0) if abs(typical - half) < 0.1 * half), 0.0)

    def rate_unit(self, columns: Sequence[int], zero: float) -> Guess:
        """Unit of rates by how gravity turns, or by their size."""
        fit = self.turns[1]
        if fit is not None and fit.tells:
            for unit in ("rad/s", "deg/s", "mdeg/s"):
                if abs(np.log2(abs(fit.factor) / to_si(1.0, unit))) < 1.0:
                    return Guess(unit, "so it turns as fast as the accelerometer sees gravity turn")
            return Guess("deg/s", f"1 deg/s may be {to_si(1.0, 'deg/s') / abs(fit.factor):.4g} counts", "")
        rates = self.vectors(columns) - zero
        largest = float(np.nanmax(np.abs(rates)))
        if largest > _FASTEST and self.parts[columns[0]].unit_as(Quantity.RATE) in {"", "rad/s"}:
            return Guess("deg/s", f"the largest is {largest:.4g}: not rad/s", "" if self.are_whole(columns) else None)
        return Guess()

    def _seconds(self) -> Floats | None:
        """Time, s on the file's clock, which goes on where it repeats or begins again; None where it is not known."""
        if not self.time:
            rate = re.match(r"[\d.]+(?= *Hz)", str(self.answers.get("time.rate", self.sampling_rate())))
            return np.arange(len(self.sample.rows)) / float(rate[0]) if rate else None
        scale, numbers = 1e9, self.numbers[self.time[0]]
        if self.stamped:
            stamps = [*zip(*(self.sample.cells(i) for i in self.time), strict=True)]
            rows = [row for row, cells in enumerate(stamps) if all(cells)]
            since, t0_ns = to_seconds([*zip(*(stamps[row] for row in rows), strict=True)], None)
            numbers = np.full(len(stamps), np.nan)
            numbers[rows] = since + t0_ns / 1e9
        elif len(self.time) == 2:
            numbers = to_si(numbers, self.part_of_second(self.time[0])) + self.numbers[self.time[1]]
        elif unit := time_unit(numbers, self.parts[self.time[0]])[0]:
            scale = to_si(1e9, unit)
        else:
            return None
        far = first if abs((first := np.nanmin(numbers)) * scale) > 2.0**62 else 0.0  # of days, or of ns since 1601
        with suppress(ClockError):
            return to_s(time_line(numbers - far, scale).t_ns) + far * scale / 1e9
        return None

    def sampling_rate(self) -> str:
        """Sampling rate that the lines before the table say, with its unit; empty where none does."""
        said = [f"{key}: {value}" for key, value in self.sample.facts.items() if "baud" not in key]
        for pattern, unit in TABLES["said"]["rates"]:
            for line in said:
                if (number := re.search(pattern, line, re.IGNORECASE)) and float(number[1]) > 0.0:
                    return f"{number[1] if unit == 'Hz' else f'{1.0 / to_si(float(number[1]), unit):g}'} Hz"
        return ""

    def take_rates(self, other: "ColumnEvidence") -> None:
        """Take columns as rates that no name says, where they turn as the accelerometer in rows of its own does."""
        if not self.triads and abs(len(self.sample.rows) - len(other.sample.rows)) < len("xy"):
            threes = self._turning(self.threes(lambda part: not part.sensor), other.vectors(other.triads["acc"]))
            self.triads = {"gyr": threes[0]} if threes else {}

    def turn_as(self, other: "ColumnEvidence") -> None:
        """Find by which axes the gyroscope turns as an accelerometer does: its own, unless others fit far better."""
        self.turns: tuple[str, Turning | None] = (AS_MOUNTED, None)
        t, when, gyr, acc = self._seconds(), other._seconds(), self.triads.get("gyr"), other.triads.get("acc")
        if t is None or when is None or gyr is None or acc is None:
            return
        rates, force = self.vectors(gyr) - self.middle(gyr), other.vectors(acc) - other.middle(acc)
        if other is not self:
            force = np.stack([np.interp(t, when, axis, np.nan, np.nan) for axis in force.T], axis=1)
        mounted = axes, best = AS_MOUNTED, _turning_fit(t, rates, force)
        if best is not None and best.windows and best.correlation <= 0.5 * _BEST:
            fits = {axes: _turning_fit(t, in_body_axes(axes, rates), force) for axes in map(axes_letters, every_axes())}
            axes, best = max(fits.items(), key=lambda fit: fit[1].correlation if fit[1] else 0.0)
        self.turns = (axes, best) if best is not None and best.tells and best.correlation > _BEST else mounted


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
        if (first.sensor or first.by_unit or first.axis == "x") and bare and follow:
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


def _between_stamps(numbers: Floats) -> Floats:
    """Numbers of time with those between that are missing where bursts have a stamp each; as they are otherwise."""
    rows = np.flatnonzero(np.isfinite(numbers))
    if FEWEST <= rows.size < (1.0 - LEFT_OUT_MOST) * numbers.size and rises(stamps := numbers[rows]):
        unit_ns = 1e6 / float(np.mean(np.abs(np.diff(stamps))))
        with suppress(ClockError):
            numbers = stamps[0] + time_line(numbers - stamps[0], unit_ns).t_ns / unit_ns
    return numbers


def _are_unit(vectors: Floats) -> bool:
    """Whether vectors (N, k) are of norm 1, as rounding to two decimals leaves them."""
    return bool((abs(np.linalg.norm(vectors, axis=1) - 1.0) < _UNIT_NORM).all())


def _spelled(sample: Sample) -> tuple[str, ...]:
    """Names of numbers behind a word that says an attitude, as ``ypr`` or ``quat``; none behind another."""
    columns = [sample.numbers(i) for i in range(sample.width)]
    words = {word for i, column in enumerate(columns) if np.isnan(column).all() for word in sample.cells(i)}
    numbers = [i for i, column in enumerate(columns) if not np.isnan(column).all()]
    if len(words) != 1:
        return ()
    are_unit = len(numbers) > len("xyz") and _are_unit(np.stack([columns[i] for i in numbers[-4:]], axis=1))
    names = attitude_names(words.pop(), are_unit=are_unit)
    places = numbers[-len(names) :] if 0 < len(names) <= len(numbers) else []
    return tuple(names[places.index(i)] if i in places else "" for i in range(sample.width)) if places else ()


def may_be(sensor: str, part: ColumnName) -> bool:
    """Whether a column may be one of a sensor's, or has acceleration without gravity."""
    return sensor in {part.sensor, part.by_unit} or (sensor, part.sensor) == ("acc", "linear")


def time_unit(numbers: Floats, part: ColumnName, said: float = 0.0) -> tuple[str, str, bool]:
    """Unit in which steps make a plausible rate: the stated one, or nearest to 100 Hz or what is `said`; if sure."""
    steps = np.diff(numbers[np.isfinite(numbers)])
    step = float(np.mean(steps[steps >= 0.0])) if (steps > 0.0).any() else 0.0
    rates = {unit: 1.0 / to_si(step, unit) for unit in _TIMES if step > 0.0}
    said_unit = part.unit or part.base  # as of a column that is called ``min``
    if (named := canonical(said_unit, Quantity.TIME)) and step > 0.0:
        return named, f"the header says {single_line(said_unit)}: {1.0 / to_si(step, named):.4g} Hz", True
    if "tick" in part.base:
        return "", "ticks of a length that nothing says; give unit_per_count, or declare rate = '100 Hz'", False
    if "tow" in part.base:
        return "s", "GPS time", True
    if (days := days_since(numbers, part)) and 0.0 < (dt := to_si(step, "day")) < 2.0:
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


def days_since(numbers: Floats, part: ColumnName) -> str:
    """From when days of this century are counted, by their size; modified Julian ones only by their name, too."""
    is_modified = re.search(r"\b(mjd|julian)\b", part.base) is not None
    fitting = (epoch for epoch, (low, high) in _DAYS.items() if low <= numbers.min() and numbers.max() < high)
    return next((epoch for epoch in fitting if is_modified or epoch != "modified-julian"), "")


def field_unit(size: float) -> Guess:
    """Unit of a magnetic field by its size."""
    for unit, (low, high) in _EARTH.items():
        if low <= size <= high:
            return Guess(unit, f"|mag| is {size:.4g}, and the Earth's field is {low:g} to {high:g} {unit}")
    return Guess("", f"|mag| is {size:.4g}, which is the Earth's field in no usual unit: counts?", "")


def gravity_unit(size: float) -> Guess:
    """Unit of an acceleration at rest by its size."""
    for unit, rest in _REST.items():
        if abs(size / rest - 1.0) < ABOUT:
            return Guess(unit, f"|acc| is {size:.4g}, and gravity is {rest:.4g} {unit}")
    power = 2 ** round(np.log2(size)) if size > 0.0 else 0
    if 128 <= power <= 32768 and abs(size / power - 1.0) < ABOUT:
        return Guess("g", f"|acc| is {size:.4g}: counts, of which {power} may be 1 g", str(power))
    return Guess("", f"|acc| is {size:.4g}, which is gravity in no usual unit: counts?", "")


def single_line(text: str) -> str:
    """Text for a comment: no line break can end it."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
