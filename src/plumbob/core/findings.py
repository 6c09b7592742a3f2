"""Findings: what was seen in data, or done to them, as a code with values; its sentence stands in a table of words.

A code's first part is its family: ``samples`` can be seen in the samples at any time, so no file keeps it; any other
is shown by the reading alone, and goes from file to file. Sentences are templates with the values in braces::

    "samples.gaps" = "gaps: samples are missing before {count} of {samples}; the longest step is {longest:.6g} s"

``{count:count gap}`` counts (1 gap, 2 gaps), and a list of words is joined by commas. What stands in double brackets is
left out where one of its values is missing or empty: ``[[, the longest of {count}]]``, ``[[many?, and so on]]``.
``about`` names the sensors or units of a finding; it stands before the sentence where the template does not place it.
"""

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from string import Formatter
from typing import Any, Final, Literal, Self, get_args

from plumbob.core.errors import DecodeError, ShapeError
from plumbob.core.text import counted

Severity = Literal["info", "warning", "error"]
"""Where data come from and what was done to them; what a reader must know; what is wrong."""

Value = str | int | float | bool | tuple[str, ...] | None

TEXT: Final = "text"  # code of a sentence that somebody else wrote: a user, a file, a package
RECOMPUTED: Final = "samples"

_OPTIONAL = re.compile(r"\[\[(?:(\w+)\?)?(.*?)\]\]", re.S)


@dataclass(frozen=True, slots=True)
class Finding:
    """What was seen in data, or done to them."""

    code: str  # its kind: a family, a dot and a name, as ``samples.gaps``
    severity: Severity = "info"  # how much a reader must care
    # numbers in SI units, or the unit that the name says, and words; ``about`` names the sensors or units
    values: Mapping[str, Value] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.code, frozenset(self.values.items())))

    @property
    def family(self) -> str:
        """First part of the code."""
        return self.code.partition(".")[0]

    def sentence(self, lang: str = "en") -> str:
        """The finding in words; in English where the language has none, and in its own where the code is not known."""
        template = words(lang).get(self.code) or words("en").get(self.code) or "{text}"
        try:
            return render(template, self.values)
        except (KeyError, ValueError, TypeError):  # a file of somebody else's
            return f"{self.code}: {dict(self.values)}"

    __str__ = sentence

    def on(self, *about: str) -> Self:
        """The same of these sensors or units, beside those that it names already."""
        before = str(self.values.get("about") or "")
        return replace(self, values={**self.values, "about": ": ".join(filter(None, (", ".join(about), before)))})

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it: code, severity, values, null where they are not finite, and the sentence in English."""
        lacks = {name for name, value in self.values.items() if isinstance(value, float) and not math.isfinite(value)}
        values = {name: None if name in lacks else value for name, value in self.values.items()}
        return {"code": self.code, "severity": self.severity, "values": values, "text": str(self)}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Finding of `to_dict`; of a code that is not known, its sentence stays."""
        code, severity = content.get("code"), content.get("severity", "info")
        values = content.get("values", {})
        if not (isinstance(code, str) and severity in get_args(Severity) and isinstance(values, Mapping)):
            raise DecodeError(f"a finding needs code, severity and values, but got {content!r:.200}.")
        held = {str(key): _plain(item) for key, item in values.items()}
        text = {} if code in words("en") else {"text": " ".join(str(content.get("text", "")).split())}
        return cls(code, severity, held | text)


Note = Finding | str  # a finding, or a line of text that stands for one


def info(code: str, **values: object) -> Finding:
    """Finding that says where data come from, or what was done to them; values become what JSON has."""
    return Finding(code, "info", {name: _plain(value) for name, value in values.items()})


def warning(code: str, **values: object) -> Finding:
    """Finding that a reader must know; values become what JSON has."""
    return Finding(code, "warning", {name: _plain(value) for name, value in values.items()})


def _plain(value: object) -> Value:
    if value is None or type(value) in (str, int, float, bool):
        return value  # type: ignore[return-value]
    if isinstance(value, tuple | list):
        return tuple(map(str, value))
    number = value.item() if hasattr(value, "item") else value
    return number if isinstance(number, int | float | bool) else str(value)


def as_findings(name: str, given: Iterable[Finding | str | Mapping[str, Any]]) -> tuple[Finding, ...]:
    """Findings, of which some may be given as lines of text, or as JSON has them."""
    items = None if isinstance(given, str | Mapping) or not isinstance(given, Iterable) else tuple(given)
    if items is None or not all(isinstance(item, str | Finding | Mapping) for item in items):
        raise ShapeError(f"{name} must be a sequence of findings or lines of text, but got {given!r}.")
    texts = [
        Finding(TEXT, "info", {"text": " ".join(item.split())}) if isinstance(item, str) else item for item in items
    ]
    return tuple([Finding.from_dict(item) if isinstance(item, Mapping) else item for item in texts])


def warnings(of: Iterable[Finding]) -> tuple[Finding, ...]:
    """Those that a reader must know, each once."""
    return tuple(dict.fromkeys([finding for finding in of if finding.severity != "info"]))


def lasting(of: Iterable[Finding]) -> tuple[Finding, ...]:
    """Those that a file keeps, each once: what the samples show would go stale."""
    return tuple(dict.fromkeys([finding for finding in of if not finding.code.startswith(f"{RECOMPUTED}.")]))


@cache
def words(lang: str) -> Mapping[str, str]:
    """Templates of sentences by code, in a language."""
    table = Path(__file__).parent / "words" / f"{lang}.toml"
    return tomllib.loads(table.read_text(encoding="utf-8")) if table.is_file() else {}


def render(template: str, values: Mapping[str, Value]) -> str:
    """Fill a template in."""
    text = ""
    for needed, part in _parts(template):
        if all([values.get(name) not in (None, "", ()) for name in needed]):
            text += _FORMATTER.vformat(part, (), values)
    about = values.get("about")
    return text if not about or "about" in fields(template) else f"{about}: {text}"


@cache
def fields(template: str) -> frozenset[str]:
    """Names of the values in a template."""
    return frozenset(name for _, name, _, _ in _FORMATTER.parse(template) if name)


@cache
def _parts(template: str) -> tuple[tuple[frozenset[str], str], ...]:
    """Parts of a template, each with the values without which it is left out."""
    parts, at = list[tuple[frozenset[str], str]](), 0
    for match in _OPTIONAL.finditer(template):
        needed = frozenset([match[1]]) if match[1] else fields(match[2])
        parts += [(frozenset(), template[at : match.start()]), (needed, match[2])]
        at = match.end()
    return (*parts, (frozenset(), template[at:]))


class _Words(Formatter):
    """Formats a list of words, and counts with their noun, beside what Python formats."""

    def format_field(self, value: Any, format_spec: str) -> str:
        """One value; see the module."""
        noun = format_spec.removeprefix("count ")
        if noun != format_spec:
            return counted(value, *noun.split("/"))
        if isinstance(value, tuple):
            return ", ".join(map(str, value))
        return str(super().format_field(value, format_spec))


_FORMATTER: Final = _Words()


def note(place: str, value: Any) -> Finding:
    """Finding as a file has it: text, or what `Finding.to_dict` gives; a parser of `plumbob.core.schema`."""
    if not isinstance(value, str | Mapping):
        raise DecodeError(f"{place} must be text or a table with code, severity and values, but is {value!r:.100}.")
    return as_findings(place, [value])[0]


note.json = {"type": ["string", "object"]}  # type: ignore[attr-defined]


def as_json(of: Iterable[Note]) -> list[dict[str, Any]]:
    """Findings, and lines of text, as JSON has them."""
    return [finding.to_dict() for finding in as_findings("notes", tuple(of))]
