"""Parameters: a NamedTuple per filter, SI inside, each field annotated with its unit, domain and meaning.

In Python a number is in the stated SI unit. In text (command line, TOML) a number may carry a unit, and must where the
field writes the quantity in two: ``gate=0.08`` is refused, for it has meant 0.08 g and 0.08 m/s².
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import NoneType
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from plumbob.errors import ParameterError, UnitError
from plumbob.units import Quantity, parse

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


class CommonParams(NamedTuple):
    """What every filter takes besides its own parameters."""

    declination: Annotated[
        float | None, Spec(Quantity.ANGLE, "magnetic declination, east positive; off: headings are magnetic", -4, 4)
    ] = None
    max_gap: Annotated[float, Spec(Quantity.TIME, "a longer step is not integrated: the filter starts again", 0)] = 1.0
    mag: Annotated[bool, Spec(Quantity.RATIO, "use the magnetometer; off: headings count from a free zero")] = True


def describe(params: type[tuple[Any, ...]]) -> tuple[Parameter, ...]:
    """Parameters of a filter's Params class, in order."""
    defaults: Mapping[str, Any] = getattr(params, "_field_defaults")  # noqa: B009
    found = []
    for name, hint in get_type_hints(params, include_extras=True).items():
        kind, spec = get_args(hint) if get_origin(hint) is Annotated else (hint, None)
        if not isinstance(spec, Spec):
            raise TypeError(f"{params.__module__}.Params.{name} needs Annotated[..., Spec(...)]")
        found.append(Parameter(name, spec, defaults[name], NoneType in get_args(kind), kind is bool))
    return tuple(found)


def build(params: type[Any], values: Mapping[str, Any], *, of: str) -> Any:
    """Params with the given values; text is parsed with its unit, numbers are in the unit inside.

    Parameters
    ----------
    params : type
        A Params class.
    values : Mapping
        By name; what is not named keeps its default.
    of : str
        Name of the filter, for messages.

    Raises
    ------
    ParameterError
        If a name is unknown, a value is outside its domain, or a unit is missing or wrong.
    """
    known = {p.name: p for p in describe(params)}
    for name in values:
        if name not in known:
            raise ParameterError(f"{of} has no parameter '{name}'; known are {', '.join(known)}.")
    return params(**{name: _value(of, known[name], value) for name, value in values.items()})


def _value(of: str, p: Parameter, value: Any) -> Any:
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
            f"{of}: {p.name} must lie in [{p.spec.low:g}, {p.spec.high:g}] {p.spec.quantity}, but is {value:g}."
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
