"""Strict reading of tables: an unknown key, a missing unit or a wrong type is an error that says where and why.

A parser takes the place and the value there, and returns what is meant or raises; as JSON Schema, `json_schema` says
the same of it. Parsers are made of parsers: a form of those of its keys, a list of that of its items; and of classes,
whose fields are the keys of a table: their types say what may stand there, or a parser does that annotates them.
Everything that is written as TOML is read by them, and the headers of recordings.
"""

import json
import math
import re
import sys
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import MISSING, fields
from enum import StrEnum
from itertools import count
from types import NoneType, UnionType
from typing import Any, Union, cast, get_args, get_origin

from plumbob.core import units
from plumbob.core.errors import DecodeError, PlumbobError, UnitError, excerpt, one_line, unknown_name
from plumbob.core.units import Quantity

Parse = Callable[[str, Any], Any]
Make = Callable[[str, dict[str, Any]], Any]  # makes of a table's place and its values what is returned
Absent = Callable[[str, str], PlumbobError]  # makes the error for a missing key, of the table's place and the key

_MAX_DEPTH = 32
_HEADER = re.compile(r"""\s*(\[\[?)\s*([\w."' -]+?)\s*\]\]?\s*(#.*)?$""")
_KEY = re.compile(r"""\s*(["']?)([^"'=#\s]+)\1\s*=""")


def document(text: str, guide: str, parse: Parse) -> Any:
    """Content of a TOML file, by the parser of its outermost table, a form with a name; errors say the line."""
    content = toml(text, guide)
    try:
        return parse("", content)
    except PlumbobError as error:
        if line := _find_line(text, vars(error).get("place", "")):
            raise type(error)(f"line {line}: {error}") from error
        raise


def _find_line(text: str, place: str) -> int:
    """Line, from 1, of a key such as ``unit[2].lever[x]``, or of the nearest table around it; 0 where there is none."""
    numbers: dict[str, int] = {}
    table, best, length = "", 0, 0
    for line, words in enumerate(text.split("\n"), 1):
        if header := _HEADER.match(words):
            path = ""
            *outer, last = re.sub("""["' ]""", "", header[2]).split(".")
            for name in outer:
                path += name
                path += f"[{numbers[path]}]." if path in numbers else "."
            table = path + last
            if header[1] == "[[":
                numbers[table] = numbers.get(table, 0) + 1
                table += f"[{numbers[table]}]"
            path = table
        elif key := _KEY.match(words):
            path = f"{table}.{key[2]}" if table else key[2]
        else:
            continue
        if len(path) > length and f"{place}.".startswith((f"{path}.", f"{path}[")):
            best, length = line, len(path)
    return best


def toml(text: str, guide: str) -> dict[str, Any]:
    """Parse TOML text; `guide` names the page with examples."""
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


def described(parse: Parse, **json_: Any) -> Parse:
    """The same parser, which says in JSON Schema what it takes."""
    vars(parse)["json"] = json_
    return parse


def json_schema(parse: Parse) -> dict[str, Any]:
    """What a parser takes, as JSON Schema; empty for what it does not say."""
    return getattr(parse, "json", {})


def absent(where: str, key: str) -> PlumbobError:
    """Plain error for a missing key."""
    return DecodeError(f"{where} needs the key '{key}', because nothing is guessed.")


def form(
    keys: Mapping[str, Parse],
    required: Collection[str] = (),
    make: Make | None = None,
    *,
    kind: Callable[..., Any] = dict,
    name: str = "",
    missing: Absent = absent,
) -> Parse:
    """Parser of a table of these keys, each with its parser, of which some are `required`.

    It returns what `make` makes of the table's place and its values, or a `kind` of them. `name` is what messages call
    a whole file, whose keys stand without a name before them; `missing` makes the error for a missing key.
    """

    def parse(where: str, raw: Any) -> Any:
        place, start = name or where, "" if name else f"{where}."
        try:
            if not isinstance(raw, dict):
                raise DecodeError(f"{place} must be a table, as in [{place}], but it is {excerpt(str(raw))}.")
            if name and "kind" in keys and "kind" in raw:
                place = "kind"  # what is of another kind has other keys too
                keys[place](place, raw[place])
                place = name
            for key in raw:
                if key not in keys:
                    place = start + key
                    raise unknown_name("key", key, keys, of=name or where, error=DecodeError)
            for key in required:
                if key not in raw:
                    raise missing(place, key)
            values = {}
            for key, value in raw.items():
                place = start + key
                values[key] = keys[key](place, value)
            place = name or where
            return kind(**values) if make is None else make(place, values)
        except PlumbobError as error:
            vars(error).setdefault("place", place)  # the innermost table says it
            raise

    properties = {key: json_schema(parser) for key, parser in keys.items()}
    return described(parse, type="object", properties=properties, required=list(required), additionalProperties=False)


def listed(parse: Parse, *counts: int, of: str = "values", names: Sequence[str] = "") -> Parse:
    """Parser of a list, as a tuple; any number of items where `counts` names none.

    They are called `of`, with ``{}`` for the place, and each by `names`, such as ``"xyz"``, or its number from 1.
    """
    many = " or ".join(map(str, counts)) + " " if counts else ""

    def parse_all(where: str, value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list) or (counts and len(value) not in counts):
            raise DecodeError(f"{where} must be a list of {many}{of.format(where)}, but it is {excerpt(str(value))}.")
        return tuple(parse(f"{where}[{key}]", item) for key, item in zip(names or count(1), value, strict=False))

    sizes = {"minItems": min(counts), "maxItems": max(counts)} if counts else {}
    return described(parse_all, type="array", items=json_schema(parse), **sizes)


def tables(parse: Parse) -> Parse:
    """Parser of a list of tables, as ``[[field]]`` writes them."""
    return listed(parse, of="tables, as in [[{}]]")


def either(kind: type, parse_kind: Parse, parse: Parse) -> Parse:
    """Parser of what has one parser where it is of a type, such as a list, and another where it is not."""
    return described(
        lambda where, value: (parse_kind if isinstance(value, kind) else parse)(where, value),
        anyOf=[json_schema(parse_kind), json_schema(parse)],
    )


def mapping(parse: Parse) -> Parse:
    """Parser of a table with free names, whose values are all of one kind."""

    def parse_all(where: str, value: Any) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise DecodeError(f"{where} must be a table, as in [{where}], but it is {excerpt(str(value))}.")
        return {name: parse(f"{where}.{name}", item) for name, item in value.items()}

    return described(parse_all, type="object", additionalProperties=json_schema(parse))


def optional(parse: Parse) -> Parse:
    """Parser of what JSON may have null for."""
    return described(either(NoneType, anything, parse), anyOf=[json_schema(parse), {"type": "null"}])


def plain(
    rule: str,
    kind: Any,
    convert: Callable[[Any], Any] | None = None,
    *limits: float,
    passes: Callable[[Any], bool] | None = None,
    **json_: Any,
) -> Parse:
    """Parser of what is of a kind and passes a test; `rule` says what it must be, `json_` the same in JSON Schema.

    A number lies within `limits`, both included; true and false are none.
    """

    def parse(where: str, value: Any) -> Any:
        is_kind = isinstance(value, kind) and not (limits and isinstance(value, bool))
        is_inside = is_kind and (not limits or limits[0] <= value <= limits[1])
        if not is_inside or (passes is not None and not passes(value)):
            raise DecodeError(f"{where} must be {rule}, but it is {excerpt(str(value))}.")
        return convert(value) if convert else value

    return described(parse, **json_)


_MOST = sys.float_info.max

anything = plain("anything", object)  # what another place judges

text = plain("text in quotes", str, str, type="string")  # text in quotes

texts = listed(text, of="texts")  # list of texts

truth = plain("true or false", bool, type="boolean")  # true or false

number = plain("a finite number", int | float, float, -_MOST, _MOST, type="number")  # finite number

positive = plain("a finite number above 0", int | float, float, math.ulp(0.0), _MOST, type="number", exclusiveMinimum=0)
"""Finite number above 0."""

nonzero = plain("a finite number other than 0", int | float, float, -_MOST, _MOST, passes=bool, type="number")
"""Finite number that is not 0."""


def one_of(*words: str) -> Parse:
    """One of some words."""
    return plain(f"one of {', '.join(map(repr, words))}", object, str, passes=words.__contains__, enum=list(words))


def whole(least: int | None = None, most: int | None = None) -> Parse:
    """Whole number within limits."""
    limits = -math.inf if least is None else least, math.inf if most is None else most
    bounds = ("" if least is None else f" of at least {least}") + ("" if most is None else f" and at most {most}")
    ends = {"minimum": least, "maximum": most}
    json_: Any = {key: end for key, end in ends.items() if end is not None}
    return plain(f"a whole number{bounds}", int, int, *limits, type="integer", **json_)


def version(read: int) -> Parse:
    """Version of a file, which must be the one that this program reads."""

    def parse(where: str, value: Any) -> int:
        if value != read or isinstance(value, bool):
            raise DecodeError(f"{where} is {excerpt(str(value))}, but this program reads {read}; update Plumbob.")
        return read

    return described(parse, const=read)


def converted(convert: Callable[[Any], Any], parse: Parse = text) -> Parse:
    """Parser of what a function makes of a value, or refuses with an error that does not know the place."""

    def parse_both(where: str, value: Any) -> Any:
        given = parse(where, value)
        try:
            return convert(given)
        except PlumbobError as error:
            raise type(error)(f"{where}: {error}") from error

    return described(parse_both, **json_schema(parse))


def unit_of(kind: Quantity) -> Parse:
    """Name of a unit of a quantity, as `plumbob.core.units.UNITS` has it."""
    return converted(lambda name: units.canonical_name(name, kind))


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

    return described(parse, type="string", description=f"number and unit, as in '100 {kind}'")


def size(kind: Quantity) -> Parse:
    """Text of a number above 0 with its unit, as SI."""
    parse = quantity(kind)
    return described(lambda where, value: positive(where, parse(where, value)), **json_schema(parse))


def table(
    kind: type[Any],
    make: Make | None = None,
    *,
    required: Collection[str] | None = None,
    missing: Absent = absent,
    **changed: Parse,
) -> Parse:
    """Parser of a table whose keys are the fields of a dataclass; those without a default are `required`.

    A parser annotates a field, or its type says what may stand there; `changed` are those of other keys, or where
    neither does.
    """
    if required is None:
        required = [f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING]
    return form(keys(kind, *changed) | changed, required, make, kind=kind, missing=missing)


def keys(kind: type[Any], *without: str) -> dict[str, Parse]:
    """Parsers of the fields of a class, by their names, but for some."""
    return {f.name: _of_type(f.type) for f in fields(kind) if f.name not in without}


def _of_type(hint: Any) -> Parse:
    """Parser of what a type says, or that annotates it."""
    inner: tuple[Any, ...] = get_args(hint)
    if parse := getattr(hint, "__metadata__", None):
        return cast(Parse, parse[0])
    if isinstance(hint, UnionType) or get_origin(hint) is Union:
        parsers = [_of_type(kind) for kind in inner if kind is not NoneType]
        parse = parsers[0] if len(parsers) == 1 else either(list, parsers[1], parsers[0])
        return optional(parse) if NoneType in inner else parse
    if hint == tuple[str, ...]:
        return texts
    if get_origin(hint) is tuple:
        sizes = () if inner[-1] is ... else (len(inner),)
        return listed(_of_type(inner[0]), *sizes, names={3: "xyz", 4: "wxyz"}.get(sum(sizes), ""))
    if issubclass(hint, StrEnum):
        return converted(hint.parse)
    return {str: text, bool: truth, int: whole(), float: number}[hint]
