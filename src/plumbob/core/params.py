"""Parameters of filters and scenarios: a class whose fields are annotated with unit, domain and meaning, SI inside.

In Python a number is in the stated SI unit. In text (command line, TOML) a number may carry a unit, and must where the
field writes the quantity in two: ``gate=0.08`` is refused, because it has meant 0.08 g and 0.08 m/s².
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import NoneType
from typing import Any, NamedTuple, TypeVar, get_args, get_type_hints

from plumbob.core.errors import ParameterError, UnitError, unknown_name
from plumbob.core.units import Quantity, from_si, parse

Built = TypeVar("Built")

_SHOWN_IN = {quantity: quantity.value for quantity in Quantity} | {
    Quantity.ANGLE: "deg",
    Quantity.RATE: "deg/s",
    Quantity.ANGULAR_ACCELERATION: "deg/s2",
    Quantity.ANGULAR_JERK: "deg/s3",
    Quantity.RATE_NOISE: "deg/s/rtHz",
    Quantity.RATE_WALK: "deg/s2/rtHz",
    Quantity.ACCELERATION_NOISE: "mg/rtHz",
}
_OFF, _ON = ("off", "none", "false"), ("on", "true")


@dataclass(frozen=True, slots=True)
class Spec:
    """What a parameter is."""

    quantity: Quantity  # what it measures; its value is the unit inside
    meaning: str  # one line, with when to change it
    low: float = -math.inf  # smallest allowed value, in the unit inside
    high: float = math.inf  # largest allowed value, in the unit inside


class Parameter(NamedTuple):
    """A parameter as it is listed: name, spec, default, and whether it may be off or is a switch."""

    name: str
    spec: Spec
    default: Any
    optional: bool
    switch: bool


def describe(cls: type[Any]) -> tuple[Parameter, ...]:
    """Parameters of a NamedTuple or dataclass whose fields are ``Annotated[type, Spec(...)] = default``, in order."""
    parameters = []
    for name, hint in get_type_hints(cls, include_extras=True).items():
        spec = next((extra for extra in get_args(hint)[1:] if isinstance(extra, Spec)), None)
        if spec is not None:
            kind = get_args(hint)[0]
            default = getattr(cls, "_field_defaults", {}).get(name, getattr(cls, name))
            parameters.append(Parameter(name, spec, default, NoneType in get_args(kind), kind is bool))
    return tuple(parameters)


def shown(p: Parameter, value: Any) -> str:
    """Value of a parameter as text with its unit, angles in degrees; `build` reads it back."""
    if value is None or isinstance(value, bool):
        return "on" if value else "off"
    return f"{from_si(float(value), _SHOWN_IN[p.spec.quantity]):.6g}{_unit(p)}"


def allowed(p: Parameter) -> str:
    """Values that a parameter may have, in the unit in which they are shown: ``-180 to 180 deg, or off``."""
    if p.switch:
        return "on or off"
    low, high = (None if math.isinf(end) else end for end in (p.spec.low, p.spec.high))
    if low is not None and high is not None:
        text = f"{_end(p, low, math.ceil)} to {_end(p, high, math.floor)}{_unit(p)}"
    elif low is not None:
        text = f"{_end(p, low, math.ceil)}{_unit(p)} or more"
    else:
        text = "any number" if high is None else f"at most {_end(p, high, math.floor)}{_unit(p)}"
    return f"{text}, or off" if p.optional else text


def _end(p: Parameter, value: float, inward: Callable[[float], int]) -> str:
    """End of a range as it was declared, or with two digits that are inside: 57 deg for 1 rad, not 57.2958."""
    size = from_si(value, _SHOWN_IN[p.spec.quantity])
    text = f"{size:.4g}"
    if math.isclose(float(text), size, rel_tol=1e-9):
        return text
    step = 10.0 ** (math.floor(math.log10(abs(size))) - 1)
    return f"{inward(size / step) * step:.4g}"


def _unit(p: Parameter) -> str:
    return "" if p.spec.quantity is Quantity.RATIO else f" {_SHOWN_IN[p.spec.quantity]}"


def build(cls: type[Built], values: Mapping[str, Any], *, of: str) -> Built:
    """Instance of a class that `describe` takes, of values by name; text is parsed with its unit."""
    parameters = {p.name: p for p in describe(cls)}
    for name in values:
        if name not in parameters:
            raise unknown_name("parameter", name, parameters, of=of)
    return cls(**{name: checked(of, parameters[name], value) for name, value in values.items()})


def checked(of: str, p: Parameter, value: Any) -> Any:
    """Value of a parameter in the unit inside, if it is one."""
    if hasattr(value, "item"):  # a NumPy scalar
        value = value.item()
    if isinstance(value, str):
        value = _parse(of, p, value.strip())
    if value is None and p.optional:
        return None
    if p.switch:
        if not isinstance(value, bool):
            raise ParameterError(f"{of}: {p.name} must be {allowed(p)}, but got {value!r}.")
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(f"{of}: {p.name} must be a number in {p.spec.quantity}, but got {value!r}.")
    if not p.spec.low <= value <= p.spec.high:
        raise ParameterError(f"{of}: {p.name} must be {allowed(p)}, but it is {shown(p, value)}.")
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
