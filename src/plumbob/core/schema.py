"""Strict reading of TOML: an unknown key, a missing unit or a wrong type is an error that says so.

A form is a mapping from keys to parsers. A parser takes where it is and what stands there, and returns the value or
raises. Profiles, sensor formats and sessions are read by it.
"""

import json
import math
import tomllib
from collections.abc import Callable, Mapping
from typing import Any

from plumbob.core import units
from plumbob.core.errors import DecodeError, PlumbobError, UnitError, excerpt, one_line
from plumbob.core.text import closest
from plumbob.core.units import Quantity

Parse = Callable[[str, Any], Any]
Absent = Callable[[str, str], PlumbobError]
"""Makes the error for a missing key, of the table's place and the key."""

_MAX_DEPTH = 32


def toml(text: str, guide: str) -> dict[str, Any]:
    """Parse TOML text; `guide` names the page with examples.

    Raises
    ------
    DecodeError
        If it is not TOML, tables in it are too deep, or a whole number has more than the 64 bits of TOML.
    """
    try:
        content = tomllib.loads(text)
        _require_bounds(content)
    except (ValueError, RecursionError) as error:
        raise DecodeError(f"not valid TOML ({one_line(error).rstrip('.')}); {guide} has examples.") from error
    return content


def toml_text(text: str) -> str:
    """TOML text; JSON's escapes are TOML's, except that TOML wants DEL escaped and no surrogates."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _require_bounds(content: Mapping[str, Any]) -> None:
    """Refuse what the parser takes, but cannot be printed in a message: Python bounds the digits and the depth."""
    level: list[Any] = [content]
    for _ in range(_MAX_DEPTH):
        level = [item for held in level for item in (held.values() if isinstance(held, Mapping) else held)]
        if any(isinstance(item, int) and not -(2**63) <= item < 2**63 for item in level):
            raise ValueError("a whole number has more than 64 bits")
        level = [item for item in level if isinstance(item, Mapping | list)]
    if level:
        raise ValueError(f"tables and lists lie more than {_MAX_DEPTH} deep in each other")


def absent(where: str, key: str) -> PlumbobError:
    """Plain error for a missing key."""
    return DecodeError(f"{where} needs the key '{key}', because nothing is guessed.")


def section(
    where: str,
    raw: Any,
    known: Mapping[str, Parse],
    required: tuple[str, ...] = (),
    *,
    top: bool = False,
    missing: Absent = absent,
) -> dict[str, Any]:
    """Values of a table, each by its parser.

    Parameters
    ----------
    where : str
        Name of the table, for messages.
    raw : object
        What stands there.
    known : mapping of str to callable
        The form.
    required : tuple of str
        Keys that must be there.
    top : bool
        Whether it is the whole file, whose name is left out before its keys.
    missing : callable
        Makes the error for a missing key.

    Raises
    ------
    DecodeError
        If it is not a table, or a key is unknown or missing.
    """
    if not isinstance(raw, dict):
        raise DecodeError(f"{where} must be a table, as in [{where}], but it is {excerpt(str(raw))}.")
    for key in raw:
        if key not in known:
            near = closest(key, known)
            raise DecodeError(f"{where} has no key {excerpt(key)}; known are {', '.join(known)}.{near}")
    for key in required:
        if key not in raw:
            raise missing(where, key)
    return {key: known[key](key if top else f"{where}.{key}", value) for key, value in raw.items()}


def form(known: Mapping[str, Parse], required: tuple[str, ...] = ()) -> Parse:
    """Parser of a table with these keys."""
    return lambda where, value: section(where, value, known, required)


def tables(parse: Parse) -> Parse:
    """Parser of a list of tables, as ``[[field]]`` writes them."""

    def parse_all(where: str, value: Any) -> list[Any]:
        if not isinstance(value, list):
            raise DecodeError(f"{where} must be a list of tables, as in [[{where}]], but it is {excerpt(str(value))}.")
        return [parse(f"{where}[{number}]", item) for number, item in enumerate(value, 1)]

    return parse_all


def mapping(parse: Parse) -> Parse:
    """Parser of a table with free names, whose values are all of one kind."""

    def parse_all(where: str, value: Any) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise DecodeError(f"{where} must be a table, as in [{where}], but it is {excerpt(str(value))}.")
        return {name: parse(f"{where}.{name}", item) for name, item in value.items()}

    return parse_all


def text(where: str, value: Any) -> str:
    """Text in quotes."""
    if not isinstance(value, str):
        raise DecodeError(f"{where} must be a text in quotes, but it is {excerpt(str(value))}.")
    return value


def version(read: int) -> Parse:
    """Version of a file, which must be the one that this program reads."""

    def parse(where: str, value: Any) -> int:
        if value != read or isinstance(value, bool):
            raise DecodeError(f"{where} is {excerpt(str(value))}, but this program reads {read}; update Plumbob.")
        return read

    return parse


def texts(where: str, value: Any) -> tuple[str, ...]:
    """List of texts."""
    if not isinstance(value, list):
        raise DecodeError(f"{where} must be a list of texts, but it is {excerpt(str(value))}.")
    return tuple(text(where, item) for item in value)


def one_of(*words: str) -> Parse:
    """One of some words."""

    def parse(where: str, value: Any) -> str:
        if value not in words:
            raise DecodeError(f"{where} must be one of {', '.join(map(repr, words))}, but it is {excerpt(str(value))}.")
        return str(value)

    return parse


def truth(where: str, value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise DecodeError(f"{where} must be true or false, but it is {excerpt(str(value))}.")
    return value


def whole(least: int | None = None, most: int | None = None) -> Parse:
    """Whole number within limits."""

    def parse(where: str, value: Any) -> int:
        right = isinstance(value, int) and not isinstance(value, bool)
        if not right or (least is not None and value < least) or (most is not None and value > most):
            bounds = ("" if least is None else f" of at least {least}") + (
                "" if most is None else f" and at most {most}"
            )
            raise DecodeError(f"{where} must be a whole number{bounds}, but it is {excerpt(str(value))}.")
        return int(value)

    return parse


def number(where: str, value: Any) -> float:
    """Finite number."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        raise DecodeError(f"{where} must be a finite number, but it is {excerpt(str(value))}.")
    return float(value)


def positive(where: str, value: Any) -> float:
    """Finite number above 0."""
    right = isinstance(value, int | float) and not isinstance(value, bool)
    if not right or not (math.isfinite(value) and value > 0.0):
        raise DecodeError(f"{where} must be a finite number above 0, but it is {excerpt(str(value))}.")
    return float(value)


def unit_of(kind: Quantity) -> Parse:
    """Name of a unit of a quantity, as `plumbob.core.units.UNITS` has it."""

    def parse(where: str, value: Any) -> str:
        try:
            return units.canonical_name(text(where, value), kind)
        except UnitError as error:
            raise UnitError(f"{where}: {error}") from error

    return parse


def quantity(kind: Quantity) -> Parse:
    """Text of a number with its unit, as SI; a sign ``±`` before it is allowed."""

    def parse(where: str, value: Any) -> float:
        if not isinstance(value, str):
            such = f"a number and its unit in quotes, as in '100 {kind}'"
            raise UnitError(f"{where} must be {such}, but it is {excerpt(str(value))}.")
        given = value.strip().removeprefix("±")
        try:
            if not units.split(given)[1]:
                raise UnitError(f"{excerpt(value)} has no unit; write a number and a unit, as in '100 {kind}'.")
            return units.parse(given, kind)
        except UnitError as error:
            raise UnitError(f"{where}: {error}") from error

    return parse


def size(kind: Quantity) -> Parse:
    """Text of a number above 0 with its unit, as SI."""
    return lambda where, value: positive(where, quantity(kind)(where, value))
