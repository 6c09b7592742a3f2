"""Units: the only place in the project that holds conversion factors.

Inside, everything is SI and radians, with two declared exceptions: magnetic flux density in microtesla and temperature
in degrees Celsius. Any other unit exists only at the border, where its name is part of the variable's name. Factors are
those of NIST SP 811, appendix B.8; of the oersted and A/m, that of the flux in air.
"""

import math
import re
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import TYPE_CHECKING, Final, TypeVar

from plumbob.core.constants import ABSOLUTE_ZERO_C, G0, NOMINAL_FIELD
from plumbob.core.errors import ParameterError, UnitError

if TYPE_CHECKING:  # the command line asks for units before it needs arrays
    import numpy as np
    from numpy.typing import NDArray

Number = TypeVar("Number", "float", "NDArray[np.float64]")


class Quantity(StrEnum):
    """What a number measures; the value is the unit that Plumbob uses inside."""

    RATE = "rad/s"
    ANGULAR_ACCELERATION = "rad/s2"
    ANGULAR_JERK = "rad/s3"
    ACCELERATION = "m/s2"
    FIELD = "uT"
    TEMPERATURE = "degC"
    ANGLE = "rad"
    TIME = "s"
    LENGTH = "m"
    SPEED = "m/s"
    FREQUENCY = "Hz"
    GAIN = "1/s"
    GAIN_RATE = "1/s2"
    RATIO = "1"
    VOLTAGE = "V"
    RATE_NOISE = "rad/s/rtHz"
    RATE_WALK = "rad/s2/rtHz"
    ACCELERATION_NOISE = "m/s2/rtHz"
    ACCELERATION_WALK = "m/s3/rtHz"
    JERK = "m/s3"
    FIELD_NOISE = "uT/rtHz"
    FIELD_WALK = "uT/s/rtHz"
    FIELD_RATE = "uT/s"
    FIELD_TIME = "uT s"
    RATIO_NOISE = "1/rtHz"
    RATIO_WALK = "1/s/rtHz"

    @property
    def ambiguous(self) -> bool:
        """True where the field writes the quantity in two units, so that a plain number would be a guess."""
        return self.startswith(("rad", "uT", "m/s2", "m/s3"))


QUANTITY_BY_TRIAD: Final = {"gyr": Quantity.RATE, "acc": Quantity.ACCELERATION, "mag": Quantity.FIELD}


@dataclass(frozen=True, slots=True)
class Unit:
    """A named unit: ``inside = factor * value + offset``."""

    quantity: Quantity
    factor: float
    offset: float = 0.0


_DEG = math.pi / 180.0
_MICRO = "\u00b5\u03bc"  # the micro sign and the Greek letter, which look alike

_OTHERS: Final[dict[Quantity, dict[str, float]]] = {
    Quantity.RATE: {
        "deg/s": _DEG, "mrad/s": 1e-3, "mdeg/s": 1e-3 * _DEG, "urad/s": 1e-6, "arcsec/s": _DEG / 3600.0,
        "deg/min": _DEG / 60.0, "deg/h": _DEG / 3600.0, "rev/s": 2.0 * math.pi, "rpm": 2.0 * math.pi / 60.0,
    },
    Quantity.ANGULAR_ACCELERATION: {"deg/s2": _DEG, "deg/h/s": _DEG / 3600.0},
    Quantity.ANGULAR_JERK: {"deg/s3": _DEG},
    Quantity.ACCELERATION: {
        "g": G0, "mg": 1e-3 * G0, "ug": 1e-6 * G0, "cm/s2": 1e-2, "mm/s2": 1e-3, "Gal": 1e-2, "mGal": 1e-5,
        "ft/s2": 0.3048, "in/s2": 0.0254,
    },
    Quantity.FIELD: {  # Oe is in air, and so A/m; relative to the field of the place, whose size nobody said
        "nT": 1e-3, "mT": 1e3, "T": 1e6, "gauss": 1e2, "mgauss": 1e-1, "gamma": 1e-3, "kgamma": 1.0, "Oe": 1e2,
        "mOe": 1e-1, "A/m": 0.4 * math.pi, "relative": NOMINAL_FIELD,
    },
    Quantity.TEMPERATURE: {"mdegC": 1e-3, "K": 1.0},
    Quantity.ANGLE: {"deg": _DEG, "arcsec": _DEG / 3600.0},
    Quantity.TIME: {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "day": 86_400.0},
    Quantity.LENGTH: {"cm": 1e-2, "mm": 1e-3},
    Quantity.SPEED: {"mm/s": 1e-3},
    Quantity.RATIO: {"%": 1e-2},
    Quantity.VOLTAGE: {"mV": 1e-3},
    Quantity.RATE_NOISE: {"deg/s/rtHz": _DEG, "deg/rth": _DEG / 60.0},
    Quantity.RATE_WALK: {"deg/s2/rtHz": _DEG, "deg/h/rth": _DEG / 3600.0 / 60.0},
    Quantity.ACCELERATION_NOISE: {"mg/rtHz": 1e-3 * G0, "ug/rtHz": 1e-6 * G0},
    Quantity.ACCELERATION_WALK: {"ug/s/rtHz": 1e-6 * G0},
    Quantity.JERK: {"ug/s": 1e-6 * G0},
    Quantity.FIELD_NOISE: {"nT/rtHz": 1e-3},
    Quantity.FIELD_WALK: {"nT/s/rtHz": 1e-3},
    Quantity.FIELD_RATE: {"nT/s": 1e-3},
    Quantity.FIELD_TIME: {"nT s": 1e-3},
}  # fmt: skip
"""Factors of the units beside the one that is used inside, by quantity."""
UNITS: dict[str, Unit] = {
    name: Unit(quantity, factor, ABSOLUTE_ZERO_C if name == "K" else 0.0)
    for quantity in Quantity
    for name, factor in {quantity.value: 1.0, **_OTHERS.get(quantity, {})}.items()
}
_ALIASES = {
    alias: name
    for name, aliases in {
        "deg/s": ("dps", "°/s", "°/sec", "deg/sec", "degrees/s", "degree/s"), "mdeg/s": ("mdps", "m°/s"),
        "rad/s": ("rad/sec", "rad s^-1"), "deg/h": ("°/h", "°/hr", "deg/hr"), "rpm": ("r/min", "rev/min"),
        "m/s2": ("m/s^2", "m/s²", "m/s/s", "m s^-2"), "gauss": ("Gs", "Ga", "Gauss"),
        "mgauss": ("mGs", "mGa", "mGauss", "milligauss"), "Oe": ("Oersted",), "T": ("tesla",),
        "uT": ("uTesla", "microtesla"), "deg": ("°", "degrees"),
        "degC": ("°C", "℃", "deg C", "Celsius", "celsius"), "s": ("sec", "seconds"), "ms": ("msec", "milliseconds"),
        "us": ("usec", "microseconds"), "1/s2": ("1/s²", "1/s^2"),
    }.items()
    for alias in aliases
}  # fmt: skip
_SYMBOLS = {
    ("G", Quantity.FIELD): "gauss",
    ("mG", Quantity.FIELD): "mgauss",
    ("C", Quantity.TEMPERATURE): "degC",
}
"""Letters that name a unit only where it is known what is measured."""
_TWO_MEANINGS = {"G": "'gauss' for a magnetic field, 'g' for an acceleration"}
_TWO_MEANINGS |= {"mG": "'mgauss' for a magnetic field, 'mg' for an acceleration"}


@cache
def unit(name: str, quantity: Quantity | None = None) -> Unit:
    """Look a unit up by name, such as ``"dps"`` or ``"uT"``; case matters (``mT`` is not ``MT``)."""
    return UNITS[canonical_name(name, quantity)]


@cache
def canonical_name(name: str, quantity: Quantity | None = None) -> str:
    """Name of a unit as `UNITS` has it; parameters and errors as for `unit`."""
    canonical = name.strip()
    for sign in _MICRO:
        canonical = canonical.replace(sign, "u")
    canonical = _ALIASES.get(canonical, canonical)
    if quantity is not None:
        canonical = _SYMBOLS.get((canonical, quantity), canonical)
    fitting = [k for k, u in UNITS.items() if quantity is None or u.quantity is quantity]
    if canonical not in fitting:
        what = "a unit" if quantity is None else f"a unit of {quantity.name.lower()}"
        raise UnitError(f"{name!r} is not {what}; {_meant(canonical)}known: {', '.join(fitting)}.")
    return canonical


def is_name(name: str, quantity: Quantity | None = None) -> bool:
    """Tell whether a text names a unit; arguments as for `unit`."""
    try:
        return bool(canonical_name(name, quantity))
    except UnitError:
        return False


def _meant(name: str) -> str:
    """What was perhaps meant by an unknown unit; a person decides."""
    if name in _TWO_MEANINGS:
        return f"write {_TWO_MEANINGS[name]}; "
    if name.lower() in {"counts", "count", "lsb", "raw"}:
        return "for counts, name the unit that counts_per_unit counts; "
    other = next((symbol for symbol in (*UNITS, *_ALIASES) if symbol.lower() == name.lower() and symbol != name), "")
    return f"if {other!r} was meant, write it so, since case matters; " if other else ""


def to_si(value: Number, name: str, quantity: Quantity | None = None) -> Number:
    """Convert from the named unit to the one used inside (SI, radians, µT, °C)."""
    u = unit(name, quantity)
    return value * u.factor + u.offset


def from_si(value: Number, name: str, quantity: Quantity | None = None) -> Number:
    """Convert from the unit used inside to the named one."""
    u = unit(name, quantity)
    return (value - u.offset) / u.factor


def written(name: str) -> str:
    """Name of a unit as people write it: ``deg/rth`` is °/√h."""
    for code, sign in (("degC", "°C"), ("deg", "°"), ("rth", "√h"), ("rtHz", "√Hz"), ("uT", "µT"), ("ug", "µg")):
        name = name.replace(code, sign)
    return re.sub(r"(?<=s)([23])", lambda power: "²³"[int(power[1]) - 2], name)


def split(text: str) -> tuple[str, str]:
    """Cut ``"0.08 g"`` into ``("0.08", "g")``; the unit is empty where there is none."""
    match = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)?\s*", text)
    if match is None:
        raise UnitError(f"{text!r} is not a number with a unit, as 0.08g or 3.2 deg are.")
    return match[1], match[2] or ""


def parse(text: str, quantity: Quantity) -> float:
    """Read a number with its unit, as in ``"3.2 deg"``."""
    number, name = split(text)
    fitting = ", ".join(k for k, u in UNITS.items() if u.quantity is quantity)
    if not name and quantity.ambiguous and float(number) != 0.0:
        raise UnitError(f"{text!r} needs a unit of {quantity.name.lower()} ({fitting}); it could mean any of them.")
    return to_si(float(number), name or quantity, quantity)


def given(name: str, value: float | str | None, quantity: Quantity, *, positive: bool = False) -> float | None:
    """What a caller gives for a quantity: a number in SI, or text with its unit, as ``"0.08 g"``; None stays."""
    if value is None:
        return None
    if isinstance(value, str):
        try:
            number = parse(value, quantity)
        except UnitError as error:
            raise UnitError(f"{name}: {error}") from None
    else:
        from plumbob.core import check  # imports numpy, which the help of the command line does without

        number = check.number(name, value, quantity.value)
    if positive and not number > 0.0:
        raise ParameterError(f"{name} must be above 0, but it is {value}.")
    return number


def span(option: str, text: str) -> tuple[float, float]:
    """Begin and end of a stretch of time, s, of ``0s..5s``."""
    first, dots, last = text.partition("..")
    if not dots or ".." in last:
        raise ParameterError(f"{option} needs a span as 0s..5s, but got '{text.strip()}'.")
    return given(option, first, Quantity.TIME) or 0.0, given(option, last, Quantity.TIME) or 0.0


def numbers(option: str, text: str, quantity: Quantity) -> list[float]:
    """Numbers of a list in SI, where the unit of the last stands for those that have none, as in ``1,2,5 min``."""
    words = [word.strip() for word in text.split(",") if word.strip()]
    if not words:
        raise ParameterError(f"{option} needs numbers, separated by commas, but got '{text}'.")
    unit = split(words[-1])[1]
    texts = [word if split(word)[1] else f"{word} {unit}".strip() for word in words]
    return [given(option, text, quantity) or 0.0 for text in texts]


def dps(value: Number) -> Number:
    """Degrees per second to rad/s."""
    return to_si(value, "deg/s")


def g(value: Number) -> Number:
    """Standard gravities to m/s²."""
    return to_si(value, "g")


def gauss(value: Number) -> Number:
    """Gauss to µT."""
    return to_si(value, "gauss")


def deg(value: Number) -> Number:
    """Degrees to radians."""
    return to_si(value, "deg")


def to_deg(value: Number) -> Number:
    """Radians to degrees."""
    return from_si(value, "deg")


def to_dps(value: Number) -> Number:
    """Convert rad/s to degrees per second."""
    return from_si(value, "deg/s")


def given_pace(speed: float | str) -> float:
    """How many times as fast as real time; infinite for "max"."""
    if speed == "max":
        return math.inf
    try:
        factor = float(speed)
    except (TypeError, ValueError):
        factor = math.nan
    if not factor > 0.0:
        raise ParameterError(f"speed must be a number above 0, or 'max', but it is {speed!r}.")
    return factor
