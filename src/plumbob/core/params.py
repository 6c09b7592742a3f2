"""Parameters of filters and scenarios: a class whose fields are annotated with unit, domain and meaning, SI inside.

In Python a number is in the stated SI unit. In text (command line, TOML) a number may carry a unit, and must where the
field writes the quantity in two: ``gate=0.08`` is refused, for it has meant 0.08 g and 0.08 m/s².
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import NoneType
from typing import Any, NamedTuple, TypeVar, get_args, get_type_hints

from plumbob.core.errors import ParameterError, UnitError
from plumbob.core.units import Quantity, from_si, parse

Built = TypeVar("Built")

_SHOWN_IN = {
    Quantity.ANGLE: "deg",
    Quantity.RATE: "deg/s",
    Quantity.ANGULAR_ACCELERATION: "deg/s2",
    Quantity.RATE_NOISE: "deg/s/rtHz",
    Quantity.RATE_WALK: "deg/s2/rtHz",
    Quantity.ACCELERATION_NOISE: "mg/rtHz",
}
_OFF, _ON = ("off", "none", "false"), ("on", "true")


@dataclass(frozen=True, slots=True)
class Spec:
    """What a parameter is.

    Attributes
    ----------
    quantity : Quantity
        What it measures; its value is the unit inside.
    meaning : str
        One line, with when to change it.
    low : float
        Smallest allowed value, in the unit inside.
    high : float
        Largest allowed value, in the unit inside.
    """

    quantity: Quantity
    meaning: str
    low: float = -math.inf
    high: float = math.inf


class Parameter(NamedTuple):
    """A parameter as it is listed: name, spec, default, and whether it may be off or is a switch."""

    name: str
    spec: Spec
    default: Any
    optional: bool
    switch: bool


def describe(cls: type[Any]) -> tuple[Parameter, ...]:
    """Parameters of a NamedTuple or dataclass whose fields are ``Annotated[type, Spec(...)] = default``, in order."""
    found = []
    for name, hint in get_type_hints(cls, include_extras=True).items():
        spec = next((extra for extra in get_args(hint)[1:] if isinstance(extra, Spec)), None)
        if spec is not None:
            kind = get_args(hint)[0]
            found.append(Parameter(name, spec, _default(cls, name), NoneType in get_args(kind), kind is bool))
    return tuple(found)


def _default(cls: type[Any], name: str) -> Any:
    return getattr(cls, "_field_defaults", {}).get(name, getattr(cls, name))


def shown(p: Parameter, value: Any) -> str:
    """Value of a parameter as text with its unit, angles in degrees; `build` reads it back."""
    if value is None or isinstance(value, bool):
        return "on" if value else "off"
    name = _SHOWN_IN.get(p.spec.quantity, p.spec.quantity.value)
    return f"{from_si(float(value), name):.6g}{'' if p.spec.quantity is Quantity.RATIO else f' {name}'}"


def build(cls: type[Built], values: Mapping[str, Any], *, of: str) -> Built:
    """Instance with the given values; text is parsed with its unit, numbers are in the unit inside.

    Parameters
    ----------
    cls : type
        A class that `describe` understands.
    values : Mapping
        By name; what is not named keeps its default.
    of : str
        Name of the filter or scenario, for messages.

    Raises
    ------
    ParameterError
        If a name is unknown, a value is outside its domain, or a unit is missing or wrong.
    """
    known = {p.name: p for p in describe(cls)}
    for name in values:
        if name not in known:
            raise ParameterError(f"{of} has no parameter '{name}'; known are {', '.join(known)}.")
    return cls(**{name: checked(of, known[name], value) for name, value in values.items()})


def checked(of: str, p: Parameter, value: Any) -> Any:
    """Value of a parameter in the unit inside, if it is one.

    Raises
    ------
    ParameterError
        If it is outside the domain, of another kind, or text without a unit where one is needed.
    """
    if hasattr(value, "item"):  # a NumPy scalar
        value = value.item()
    if isinstance(value, str):
        value = _parse(of, p, value.strip())
    if value is None and p.optional:
        return None
    if p.switch:
        if not isinstance(value, bool):
            raise ParameterError(f"{of}: {p.name} is on or off, but got {value!r}.")
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(f"{of}: {p.name} must be a number in {p.spec.quantity}, but got {value!r}.")
    if not p.spec.low <= value <= p.spec.high:
        raise ParameterError(
            f"{of}: {p.name} must be {p.spec.low:g} to {p.spec.high:g} {p.spec.quantity}, but it is {value:g}."
        )
    return float(value)


def _parse(of: str, p: Parameter, text: str) -> Any:
    word = text.lower()
    if word in _OFF and (p.optional or p.switch):
        return False if p.switch else None
    if word in _ON and p.switch:
        return True
    try:
        return parse(text, p.spec.quantity)
    except UnitError as error:
        raise ParameterError(f"{of}: {p.name}: {error}") from error
