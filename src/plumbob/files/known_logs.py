"""Logs and arrays that are known by their names: what their makers say of them and the files do not, as profiles.

Kinds that no reader takes are known by their first bytes, and refused with what to do.

``known_logs.toml`` holds them, and `KnownLog` says what the keys of a log mean.
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from plumbob.core.errors import UnknownFormatError


@dataclass(frozen=True, slots=True)
class KnownLog:
    """A kind of log."""

    name: str  # what writes it
    names: tuple[str, ...]  # columns that it has, each a regular expression of a whole name
    answers: Mapping[str, Any]  # keys of a profile
    facts: tuple[str, ...] = ()  # what the lines before the table have, as keys
    in_file: Mapping[str, str] = field(default_factory=dict)  # keys of a profile, and of the facts that answer them
    # whether a reader of its own reads it; then the answers are for a draft, where that one refuses it
    has_reader: bool = False

    def is_named_in(self, text: str) -> bool:
        """Whether a text has all the words of one; a table is taken apart only then."""
        words = (*self.names, *map(re.escape, self.facts))
        return all(re.search(word, text, re.IGNORECASE) for word in words)

    def fits(self, names: Sequence[str], facts: Mapping[str, str]) -> bool:
        """Whether a table with these names, under lines that say these facts, is one."""
        is_named = all(any(re.fullmatch(pattern, name) for name in names) for pattern in self.names)
        return is_named and all(key in facts for key in self.facts)

    def said(self, facts: Mapping[str, str]) -> dict[str, Any]:
        """Its answers, with those that the lines before the table give."""
        in_file = {key: _value(key, facts[fact]) for key, fact in self.in_file.items() if fact in facts}
        return {**self.answers, **in_file}


def _value(key: str, fact: str) -> str | float:
    if key == "axes":  # of the body, whose lower case turns the sign [Gyroflow]
        return " ".join(f"{'-' if letter.islower() else ''}{letter.lower()}" for letter in fact)
    return float(fact) if re.fullmatch(r"[-+.\deE]+", fact) else fact.split(maxsplit=1)[0]


KNOWN_TABLES: Final[Mapping[str, Any]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
KNOWN: Final = tuple(KnownLog(**log) for log in KNOWN_TABLES["log"])
KNOWN_ARRAYS: Final[Mapping[str, Mapping[str, Any]]] = KNOWN_TABLES["arrays"]  # data sets, by what they are called
SENTENCES: Final[Mapping[str, list[str]]] = KNOWN_TABLES["sentences"]  # names of the fields of a sentence, by its own


def refuse_known(file: Path) -> None:
    """UnknownFormatError where a file is of a kind that is known and not read."""
    with file.open("rb") as stream:
        start = stream.read(128)
    for pattern, words in KNOWN_TABLES["refused"].items():
        if re.match(pattern.encode("latin-1"), start):
            raise UnknownFormatError(f"{file} is {words}")
