"""What the name of a column says: of which sensor or quantity it is, its axis, and its unit.

A name decides by all of its words: ``Low/Angular Velocity/X`` is a rate, ``Linear Acceleration x`` lacks gravity, and a
unit of another quantity than the words say makes a column nothing that is used.
"""

import re
import tomllib
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Final

from plumbob.core.units import QUANTITY_BY_TRIAD, Quantity, canonical_name, is_name

TABLES: Final[Mapping[str, Mapping[str, Any]]] = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
)


def _any(alternatives: Sequence[str], *, inside: bool = False) -> re.Pattern[str]:
    """Any of the alternatives, between ends of words where they stand `inside` a name."""
    return re.compile(rf"\b({'|'.join(alternatives)})\b" if inside else "|".join(alternatives))


_WORDS, _PHRASES, _DIRECTIONS = (
    {name: _any(words) for name, words in TABLES[key].items()} for key in ("words", "phrases", "axes")
)
_ROLLS: Final = {axis: _any([*TABLES["axes"][axis], *words]) for axis, words in TABLES["rolls"].items()}
_OTHER, _WITHOUT_GRAVITY = (_any(TABLES["other"][key], inside=True) for key in ("other", "without_gravity"))
_TIME, _COUNTER, WEEK, TEMPERATURE, _QUATERNION, _ANGLES = (_any(words) for words in TABLES["kinds"].values())
_SUFFIXES: Final[Mapping[str, str]] = TABLES["units"]
_FOREIGN: Final[Mapping[str, str]] = TABLES["foreign"]
_SPELLINGS: Final[list[list[str]]] = TABLES["spellings"]["list"]
_FRAMES: Final = {*"bnies", "ib", "nb", "body", "sensor", "imu"}  # behind a letter, as in f_ib_b
_SCALAR: Final = {"w", "s", "scalar", "real"}
COMPONENTS: Final = {**{name: name for name in "wxyz"}, "i": "x", "j": "y", "k": "z", **dict.fromkeys(_SCALAR, "w")}
REVERSED: Final = re.compile(r"(?i)(?<![a-z])(back|aft|right|starboard|down)(?![a-z])")  # against forward, left and up
_ALL: Final = (*QUANTITY_BY_TRIAD.values(), Quantity.TIME, Quantity.TEMPERATURE, Quantity.ANGLE)


@dataclass(frozen=True, slots=True)
class ColumnName:
    """A name taken apart."""

    base: str  # its words, lower case, without axis and unit
    axis: str  # ``x``, ``y``, ``z``, a number of one, or ``w`` of a quaternion; empty where there is none
    unit: str  # as it stands there
    stated: bool  # whether brackets or a row of units say the unit, instead of a word of the name
    scale: float = 1.0  # how many of the unit one count is, as in ``t [10us]``

    def unit_as(self, kind: Quantity) -> str:
        """Its unit by our name, where that is one of a quantity."""
        return canonical(self.unit, kind)

    @property
    def sensor(self) -> str:
        """``gyr``, ``acc``, ``mag``, ``linear`` for acceleration without gravity, ``other``, or empty if unknown."""
        of = [kind for kind in _ALL if self.unit_as(kind)]
        by_word = _by_word(re.sub(r"\btotal\b ?", "", self.base) if self.axis else self.base)  # with gravity
        if by_word in QUANTITY_BY_TRIAD:
            fits = not of or QUANTITY_BY_TRIAD[by_word] in of
            return by_word if fits and (of or not self.stated or _may_be_counts(self.unit)) else "other"
        if by_word or not self.axis or not self.is_bare:
            return by_word
        return next((name for name, kind in QUANTITY_BY_TRIAD.items() if kind in of), "")

    @property
    def is_bare(self) -> bool:
        """Whether its words say no sensor, so that its unit alone does."""
        return self.base in _BARE

    @property
    def by_unit(self) -> str:
        """Sensor whose unit is said, where there is an axis and the words are not known."""
        triads = {name for name, kind in QUANTITY_BY_TRIAD.items() if self.unit_as(kind)}
        return triads.pop() if self.axis and not self.sensor and len(triads) == 1 else ""

    @property
    def is_time(self) -> bool:
        """Whether it may be time by its words, or by a unit of time."""
        if self.stated and self.unit and not self.unit_as(Quantity.TIME) and not re.search(r"\d", self.unit):
            return False
        return bool(_TIME.fullmatch(self.base)) or (bool(self.unit_as(Quantity.TIME)) and not self.is_counter)

    @property
    def is_counter(self) -> bool:
        """Whether it numbers rows."""
        return (
            bool(_COUNTER.fullmatch(self.base)) and not _TIME.fullmatch(self.base) and not self.unit_as(Quantity.TIME)
        )

    @property
    def quaternion(self) -> str:
        """Which component of a quaternion it is: ``w``, ``x``, ``y``, ``z``, or a number; empty for none."""
        return self.axis if self.axis and _QUATERNION.fullmatch(self.base) else ""


_BARE: Final = {"", "axis", "value", "val", "data", "sensor", "imu", "raw", "cal"}


def _may_be_counts(unit: str) -> bool:
    """Whether a unit that is not known leaves open what a sensor counts in."""
    other = any(canonical(unit, kind) for kind in Quantity)
    return not other and not re.fullmatch(r"(?i)[mkh]?pa|m?bar|m?v|lux|lx|d?b|n", unit.strip())


def _by_word(base: str) -> str:
    if _WITHOUT_GRAVITY.search(base) and re.search(r"\b(a|acc\w*)\b", base) and not base.startswith("field "):
        return "linear"
    for name, phrase in _PHRASES.items():
        if phrase.search(base) and not _OTHER.search(base):
            return name
    if _OTHER.search(base):
        return "other"
    words = base.split()
    words = words[:1] if len(words) > 1 == len(words[0]) and {*words[1:]} <= _FRAMES else words
    telling = [*(word for word in words[:-1] if len(word) > 1), *words[-1:]]  # of one letter behind a unit's name alone
    return next((name for name, word in _WORDS.items() if any(map(word.fullmatch, telling))), "")


_LETTERS: Final = {"G": "g", "mG": "mg"}  # Gauss for a field, and for an acceleration what it is at rest


@cache
def canonical(name: str, kind: Quantity) -> str:
    """Our name of a unit of a quantity; empty where it is none."""
    plain = name.strip()
    if not is_name(plain, kind):
        plain = plain if plain.isascii() else re.sub("|".join(_FOREIGN), lambda word: _FOREIGN[word[0]], plain)
        for spelling, ours in _SPELLINGS:
            plain = re.sub(spelling, ours, plain)
        plain = _LETTERS.get(plain, plain) if kind is Quantity.ACCELERATION else plain
    return canonical_name(plain, kind) if is_name(plain, kind) else ""


_BRACKETS: Final = re.compile(r"[\[(]((?:[^\[\]()]|\([^()]*\))*)[\])]")
_INDEX: Final = r"([\dxyzwXYZ])(?:[ -]?axis)?"
# a channel of a recorder, before what it measures
_NUMBERED: Final = re.compile(r"(?i)^\W*(?:ch(?:an(?:nel)?)?|ai)[ _]?\d+[\W_]+(?=[^\W\d])")


def taken_apart(name: str, unit: str = "") -> ColumnName:
    """Take a name apart, which pandas may write as ``('acc', 'x')``; `unit` is what a row of units has below it."""
    name = " ".join(re.findall("'(.*?)'", name)) if name.startswith("('") else name
    if beside := re.match(r'"?([^"|]+)"?\|"?([^"|]*)"?\|', name):  # and its unit, range and rate
        name, unit = beside[1], unit or beside[2]
    name = _NUMBERED.sub("", re.sub(r"([\[(])([xyzXYZ]), *(?=\S)", r"\2 \1", name))  # as ``acc (x, g)``
    index = re.findall(rf"[\[(]{_INDEX}[\])]", name)
    brackets = [text for text in _BRACKETS.findall(name) if not re.fullmatch(_INDEX, text)]
    inner = re.fullmatch(r"\s*[\[(](.*)[\])]\s*", unit)
    plain = re.sub(r"[\[(].*?[\])]", " ", name).strip()
    tail = re.search(r"(?:\bin |, ?)(\S+)$", plain)
    texts = [*reversed(brackets), *([tail[1]] if tail else [])]
    said = next(filter(is_unit, texts), texts[0] if texts else "")
    stated = (inner[1] if inner else unit.strip() or said).strip()
    stated = re.sub(r"(?i)^(gps|utc) (?=\w)|:(double|float|u?int)\d*$", "", stated)  # of a type, no word
    stated = "" if re.fullmatch(r"x[0-9A-Fa-f]{4}", stated) else re.sub(r"^c(enti)?(?=deg)", "0.01 ", stated)
    stated, scale = _scaled(stated)
    plain = plain[: tail.start()] if tail else plain
    plain = re.sub("[µμ]", "u", plain.replace("²", "2").replace("°", "deg"))
    plain = _MARKED.sub(
        lambda letter: _BARE_LETTERS.get(letter[0]) or unicodedata.normalize("NFD", letter[0])[0], plain
    )
    words = [word.lower() for word in _WORD.findall(plain)]
    suffix = ""
    if len(words) > 1 and words[-1] in {"lsb", "raw", "counts", "adc"}:
        words.pop()  # counts, as no unit says
    if not stated and len(words) > 1:
        for count in (3, 2, 1):
            text = " ".join(words[-count:])
            is_letter = text == "g" and {*words[:-1]} <= _BARE  # of the gyroscope, as in ``data.g[1]``
            if len(words) > count and not is_letter and (suffix := _unit_word(text, plain, count)):
                words = words[:-count]
                break
    if not stated and not suffix and words and canonical(time := _SUFFIXES.get(words[-1], ""), Quantity.TIME):
        suffix = time
    in_words = not index or not {*"xyz"}.isdisjoint(words)
    base, axis = _split_axis(words) if in_words else (" ".join(words), index[-1].lower())
    return ColumnName(base, axis, stated or suffix, bool(stated), scale)


_MARKED: Final = re.compile("[À-ÖØ-öø-ɏẠ-ỹ]")  # Latin letters with marks
_BARE_LETTERS: Final = {"ı": "i", "ł": "l", "Ł": "L", "ø": "o", "Ø": "O", "đ": "d"}  # of those that do not come apart


def is_unit(text: str) -> bool:
    """Whether a text is a unit of some quantity."""
    return any(canonical(text, kind) for kind in Quantity)


def measured_in(word: str) -> str:
    """Sensor that a unit is of; empty for another word."""
    return next((name for name, kind in QUANTITY_BY_TRIAD.items() if canonical(word, kind)), "")


def _scaled(unit: str) -> tuple[str, float]:
    """Unit without a number before it, and that: of any time, of others a decimal part alone, as more is a range."""
    number = re.match(r"(\d+(?:\.\d+)?(?:e-?\d+)?)\s*[*x×]?\s*(?=[^\W\d]|°)(?!lsb)", unit, re.IGNORECASE)
    rest = unit[number.end() :] if number else ""
    if number and (canonical(rest, Quantity.TIME) or (is_unit(rest) and re.fullmatch(r"0\.0*1|1e-\d+", number[1]))):
        return rest, float(number[1])
    return unit, 1.0


def attitude_names(word: str, *, are_unit: bool) -> tuple[str, ...]:
    """Names of the numbers behind a word that says an attitude: angles by their letters, or four of norm 1; else none.

    Angles in an order that nothing says have names of no sensor.
    """
    plain = " ".join(_WORD.findall(word)).lower()
    spelled = [_ANGLE_OF.get(letter, "") for letter in plain]
    if len({*spelled} - {""}) == len(spelled) == len("xyz"):
        return tuple(spelled)
    if are_unit and _QUATERNION.fullmatch(plain):
        return "q0", "q1", "q2", "q3"
    return ("angle 1", "angle 2", "angle 3") if _ANGLES.fullmatch(plain) else ()


_ANGLE_OF: Final = {"y": "yaw", "h": "heading", "p": "pitch", "r": "roll"}


def named_sensor(words: str) -> str:
    """Which sensor the name of a file or a kind of row is of; a single letter says nothing."""
    longer = re.findall(r"[^\W\d_]{2,}", words)
    return taken_apart(" ".join([*longer, "x"])).sensor


_PHRASE: Final = re.compile(r"([-+±\d][-+±\d.,]*\s*)?([^\s,;:=\[\](){}|\"'\d±][^\s,;:=\[\](){}|\"']*)")
_OF_ANOTHER: Final = re.compile(
    r"bias|drift|offset|noise|density|range|resolution|walk|lsb|filter|error", re.IGNORECASE
)


def said_units(text: str) -> dict[str, str]:
    """Unit of each sensor of which a text says just one, as ``Units: acc [g], gyro [deg/s]``; no ranges or errors."""
    said: dict[str, set[str]] = {}
    for line in text.split("\n"):
        sensor, before = "", ""
        for number, word in _PHRASE.findall(line):
            if (kind := measured_in(word)) and kind == sensor and not number:
                said.setdefault(sensor, set()).add(canonical(word, QUANTITY_BY_TRIAD[sensor]))
            sensor = (
                "" if _OF_ANOTHER.search(word) else named_sensor(f"{before} {word}") or named_sensor(word) or sensor
            )
            before = word
    return {sensor: units.pop() for sensor, units in said.items() if len(units) == 1}


_WORD: Final = re.compile(r"[A-Z]{2,}(?![a-z])|[A-Z]?[a-z]+|[A-Z]|\d+|[^\W\d_A-Za-z]+")


def _unit_word(text: str, plain: str, count: int) -> str:
    """Unit that the last words of a name may be, as in ``acc_x_mg``; in its own letters where they are one word."""
    last = re.split(r"[\W_]+", plain.strip())[-1]
    unit = _SUFFIXES.get(text.replace(" ", ""), last if len(_WORD.findall(last)) == count else text)
    if (len(unit) == 1 and unit not in {"g", "s"}) or unit == "gamma":  # which is an angle, too
        return ""
    return unit if any(canonical(unit, kind) for kind in _ALL[:-1]) else ""


def _split_axis(words: list[str]) -> tuple[str, str]:
    """What is left of a name without its axis, and the axis: a word of its own, or the last letter or digit."""
    for letters in ({"x", "y", "z"}, {*COMPONENTS}):
        for i in (i for i, word in enumerate(words) if word in letters):
            rest = " ".join(words[:i] + words[i + 1 :])
            if words[i] in "xyz" or _QUATERNION.fullmatch(rest):
                return rest, COMPONENTS[words[i]]
    if words and len(words[-1]) == 1 and words[-1].isdigit() and len(words) > 1:
        return " ".join(words[:-1]), words[-1]
    directions = _ROLLS if re.search(r"\b(rate|rates|gyr\w*|speed|velocity)\b", " ".join(words)) else _DIRECTIONS
    for axis, i in product("xyz", range(len(words))):
        if directions[axis].fullmatch(words[i]):
            return " ".join(words[:i] + words[i + 1 :]), axis
    last = words[-1] if words else ""
    for stem, letter in ((last[:-1], last[-1:]), (last[1:], last[:1])):
        named = stem in {"q", "quat"} or any(word.fullmatch(stem) for word in _WORDS.values())
        if stem and letter in {"x", "y", "z"} and named:
            return " ".join([*words[:-1], stem]), letter
    stem, letter = last[:-1], last[-1:]
    if letter == "w" and stem in {"q", "quat", "quaternion"}:
        return " ".join([*words[:-1], stem]), letter
    return " ".join(words), ""
