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

UNITS: dict[str, Unit] = {
    "rad/s": Unit(Quantity.RATE, 1.0),
    "deg/s": Unit(Quantity.RATE, _DEG),
    "mrad/s": Unit(Quantity.RATE, 1e-3),
    "mdeg/s": Unit(Quantity.RATE, 1e-3 * _DEG),
    "urad/s": Unit(Quantity.RATE, 1e-6),
    "arcsec/s": Unit(Quantity.RATE, _DEG / 3600.0),
    "deg/min": Unit(Quantity.RATE, _DEG / 60.0),
    "deg/h": Unit(Quantity.RATE, _DEG / 3600.0),
    "rev/s": Unit(Quantity.RATE, 2.0 * math.pi),
    "rpm": Unit(Quantity.RATE, 2.0 * math.pi / 60.0),
    "rad/s2": Unit(Quantity.ANGULAR_ACCELERATION, 1.0),
    "deg/s2": Unit(Quantity.ANGULAR_ACCELERATION, _DEG),
    "deg/h/s": Unit(Quantity.ANGULAR_ACCELERATION, _DEG / 3600.0),
    "rad/s3": Unit(Quantity.ANGULAR_JERK, 1.0),
    "deg/s3": Unit(Quantity.ANGULAR_JERK, _DEG),
    "m/s2": Unit(Quantity.ACCELERATION, 1.0),
    "g": Unit(Quantity.ACCELERATION, G0),
    "mg": Unit(Quantity.ACCELERATION, 1e-3 * G0),
    "ug": Unit(Quantity.ACCELERATION, 1e-6 * G0),
    "cm/s2": Unit(Quantity.ACCELERATION, 1e-2),
    "mm/s2": Unit(Quantity.ACCELERATION, 1e-3),
    "Gal": Unit(Quantity.ACCELERATION, 1e-2),
    "mGal": Unit(Quantity.ACCELERATION, 1e-5),
    "ft/s2": Unit(Quantity.ACCELERATION, 0.3048),
    "in/s2": Unit(Quantity.ACCELERATION, 0.0254),
    "uT": Unit(Quantity.FIELD, 1.0),
    "nT": Unit(Quantity.FIELD, 1e-3),
    "mT": Unit(Quantity.FIELD, 1e3),
    "T": Unit(Quantity.FIELD, 1e6),
    "gauss": Unit(Quantity.FIELD, 1e2),
    "mgauss": Unit(Quantity.FIELD, 1e-1),
    "gamma": Unit(Quantity.FIELD, 1e-3),
    "kgamma": Unit(Quantity.FIELD, 1.0),
    "Oe": Unit(Quantity.FIELD, 1e2),  # in air, and so A/m
    "mOe": Unit(Quantity.FIELD, 1e-1),
    "A/m": Unit(Quantity.FIELD, 0.4 * math.pi),
    "relative": Unit(Quantity.FIELD, NOMINAL_FIELD),  # of the field of the place, whose size nobody said
    "degC": Unit(Quantity.TEMPERATURE, 1.0),
    "mdegC": Unit(Quantity.TEMPERATURE, 1e-3),
    "K": Unit(Quantity.TEMPERATURE, 1.0, ABSOLUTE_ZERO_C),
    "rad": Unit(Quantity.ANGLE, 1.0),
    "deg": Unit(Quantity.ANGLE, _DEG),
    "arcsec": Unit(Quantity.ANGLE, _DEG / 3600.0),
    "s": Unit(Quantity.TIME, 1.0),
    "ms": Unit(Quantity.TIME, 1e-3),
    "us": Unit(Quantity.TIME, 1e-6),
    "ns": Unit(Quantity.TIME, 1e-9),
    "min": Unit(Quantity.TIME, 60.0),
    "h": Unit(Quantity.TIME, 3600.0),
    "day": Unit(Quantity.TIME, 86_400.0),
    "m": Unit(Quantity.LENGTH, 1.0),
    "cm": Unit(Quantity.LENGTH, 1e-2),
    "mm": Unit(Quantity.LENGTH, 1e-3),
    "m/s": Unit(Quantity.SPEED, 1.0),
    "mm/s": Unit(Quantity.SPEED, 1e-3),
    "Hz": Unit(Quantity.FREQUENCY, 1.0),
    "1/s": Unit(Quantity.GAIN, 1.0),
    "1/s2": Unit(Quantity.GAIN_RATE, 1.0),
    "1": Unit(Quantity.RATIO, 1.0),
    "%": Unit(Quantity.RATIO, 1e-2),
    "V": Unit(Quantity.VOLTAGE, 1.0),
    "mV": Unit(Quantity.VOLTAGE, 1e-3),
    "rad/s/rtHz": Unit(Quantity.RATE_NOISE, 1.0),
    "deg/s/rtHz": Unit(Quantity.RATE_NOISE, _DEG),
    "deg/rth": Unit(Quantity.RATE_NOISE, _DEG / 60.0),
    "rad/s2/rtHz": Unit(Quantity.RATE_WALK, 1.0),
    "deg/s2/rtHz": Unit(Quantity.RATE_WALK, _DEG),
    "deg/h/rth": Unit(Quantity.RATE_WALK, _DEG / 3600.0 / 60.0),
    "m/s2/rtHz": Unit(Quantity.ACCELERATION_NOISE, 1.0),
    "mg/rtHz": Unit(Quantity.ACCELERATION_NOISE, 1e-3 * G0),
    "ug/rtHz": Unit(Quantity.ACCELERATION_NOISE, 1e-6 * G0),
    "m/s3/rtHz": Unit(Quantity.ACCELERATION_WALK, 1.0),
    "ug/s/rtHz": Unit(Quantity.ACCELERATION_WALK, 1e-6 * G0),
    "m/s3": Unit(Quantity.JERK, 1.0),
    "ug/s": Unit(Quantity.JERK, 1e-6 * G0),
    "uT/rtHz": Unit(Quantity.FIELD_NOISE, 1.0),
    "nT/rtHz": Unit(Quantity.FIELD_NOISE, 1e-3),
    "uT/s/rtHz": Unit(Quantity.FIELD_WALK, 1.0),
    "nT/s/rtHz": Unit(Quantity.FIELD_WALK, 1e-3),
    "uT/s": Unit(Quantity.FIELD_RATE, 1.0),
    "nT/s": Unit(Quantity.FIELD_RATE, 1e-3),
    "uT s": Unit(Quantity.FIELD_TIME, 1.0),
    "nT s": Unit(Quantity.FIELD_TIME, 1e-3),
    "1/rtHz": Unit(Quantity.RATIO_NOISE, 1.0),
    "1/s/rtHz": Unit(Quantity.RATIO_WALK, 1.0),
}
_ALIASES = {
    "dps": "deg/s",
    "°/s": "deg/s",
    "°/sec": "deg/s",
    "deg/sec": "deg/s",
    "degrees/s": "deg/s",
    "degree/s": "deg/s",
    "mdps": "mdeg/s",
    "m°/s": "mdeg/s",
    "rad/sec": "rad/s",
    "rad s^-1": "rad/s",
    "°/h": "deg/h",
    "°/hr": "deg/h",
    "deg/hr": "deg/h",
    "r/min": "rpm",
    "rev/min": "rpm",
    "m/s^2": "m/s2",
    "m/s²": "m/s2",
    "m/s/s": "m/s2",
    "m s^-2": "m/s2",
    "Gs": "gauss",
    "Ga": "gauss",
    "Gauss": "gauss",
    "mGs": "mgauss",
    "mGa": "mgauss",
    "mGauss": "mgauss",
    "milligauss": "mgauss",
    "Oersted": "Oe",
    "tesla": "T",
    "uTesla": "uT",
    "microtesla": "uT",
    "°": "deg",
    "degrees": "deg",
    "°C": "degC",
    "℃": "degC",
    "deg C": "degC",
    "Celsius": "degC",
    "celsius": "degC",
    "sec": "s",
    "seconds": "s",
    "msec": "ms",
    "milliseconds": "ms",
    "usec": "us",
    "microseconds": "us",
    "1/s²": "1/s2",
    "1/s^2": "1/s2",
}
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
