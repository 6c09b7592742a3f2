"""What every card shares: the file, its version, and the checks of what stands in it."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError, DecodeError, ParameterError
from plumbob.core.files import text_of, write_text
from plumbob.core.findings import as_json
from plumbob.core.text import FactsText


class Card(FactsText):
    """A card as a file; each kind says its name, its version and what its parts are."""

    KIND: ClassVar[str]
    VERSION: ClassVar[int]
    PARTS: ClassVar[Mapping[str, type]]
    """By key: the type of what stands under it, where that is no number and no text."""

    def facts(self) -> Mapping[str, str]:
        """What it is, in words: its texts, and which parts it has."""
        texts = {name: value for name in ("device", "date", "method", "source") if (value := getattr(self, name, ""))}
        return texts | {"of": ", ".join(name for name in self.PARTS if getattr(self, name) is not None) or "nothing"}

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the card as JSON; what lies there is replaced only with `overwrite`, and only a card of its kind."""
        self.require_place(path)
        write_text(path, self.text(), overwrite=overwrite)

    @classmethod
    def require_place(cls, path: str | Path) -> None:
        """Refuse a place where a file of another kind lies: a card replaces only a card of its own kind."""
        kind = kind_of(path)
        if kind is not None and kind != cls.KIND:
            existing, wanted = kind.removeprefix("plumbob "), cls.KIND.removeprefix("plumbob ")
            raise ParameterError(
                f"{path} is a {existing}, not a {wanted}; writing there would destroy it. Name another file."
            )

    def text(self) -> str:
        """Text of the card's file."""
        content = {"kind": self.KIND, "format_version": self.VERSION, **asdict(self)}  # type: ignore[call-overload]
        for name in self.PARTS:
            if remarks := getattr(getattr(self, name), "remarks", ()):
                content[name]["remarks"] = as_json(remarks)
        return json.dumps(content, indent=2, default=lambda a: a.tolist(), allow_nan=False) + "\n"

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a card."""
        return cls.from_text(text_of(path, cls.KIND), str(path))

    @classmethod
    def of(cls, given: Self | str | Path) -> Self:
        """Return a card as it is, or the one of a file; errors as in `load`."""
        return cls.load(given) if isinstance(given, str | Path) else given

    @classmethod
    def from_text(cls, text: str, name: str) -> Self:
        """Read a card from its text; errors as in `load`, in which `name` stands for the file."""
        try:
            raw = strict_json(text)
        except (ValueError, RecursionError) as error:
            raise DecodeError(f"{name} is not a {cls.KIND}: {error}.") from error
        if not isinstance(raw, dict) or raw.pop("kind", None) != cls.KIND:
            raise DecodeError(f"{name} is not a {cls.KIND}: its 'kind' says otherwise.")
        version = raw.pop("format_version", None)
        if isinstance(version, bool) or version not in range(1, cls.VERSION + 1):
            raise DecodeError(f"{name} has format_version {version}, but this program reads up to {cls.VERSION}.")
        card: Self = built(name, cls, raw, cls.PARTS)
        return card


def kind_of(path: str | Path) -> str | None:
    """Kind that the JSON of a file states; None where there is no such file or statement."""
    try:
        content = json.loads(text_of(path))
    except (ValueError, RecursionError):  # no file, no text, no JSON: nothing that a card is
        return None
    kind = content.get("kind") if isinstance(content, dict) else None
    return kind if isinstance(kind, str) else None


def built(name: str, cls: type[Any], raw: Any, parts: Mapping[str, type] | None = None) -> Any:
    """Object of what stands in a file; `parts` are the types of its own parts, which are built first."""
    names = {f.name for f in fields(cls)}
    if not isinstance(raw, dict) or not set(raw) <= names:
        unknown = sorted(set(raw) - names) if isinstance(raw, dict) else raw
        raise DecodeError(f"{name}: {cls.__name__} has no {unknown}; known: {', '.join(sorted(names))}.")
    present = {key: part for key, part in (parts or {}).items() if raw.get(key) is not None}
    made = {key: built(name, part, raw[key], getattr(part, "PARTS", None)) for key, part in present.items()}
    try:
        return cls(**raw | made)
    except (TypeError, ValueError, OverflowError) as error:
        raise DecodeError(f"{name}: {cls.__name__} is incomplete or wrong: {error}") from error


def require_number(name: str, value: Any) -> None:
    """Refuse what is not a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise CalibrationError(f"{name} must be a finite number, but it is {value!r}.")


def require_no_negative(name: str, value: Any) -> None:
    """Refuse a size, or an array of sizes, that is below zero somewhere."""
    array = np.asarray(value)
    if (array < 0.0).any():
        raise CalibrationError(f"{name} must not be negative, but it is {array.tolist()}.")


def require_text(**words: Any) -> None:
    """Refuse what is not a text."""
    for name, value in words.items():
        if not isinstance(value, str):
            raise CalibrationError(f"{name} must be text, but it is {value!r}.")


def require_part(name: str, value: Any, cls: type) -> None:
    """Refuse what is neither of a type nor None."""
    if not isinstance(value, cls | None):
        raise CalibrationError(f"{name} must be a {cls.__name__} or None, but it is {value!r}.")


def finite(name: str, value: Any, shape: tuple[int, ...]) -> Floats:
    """Array of finite numbers, read-only; −1 in `shape` stands for any length."""
    array = check.floats(name, value)
    fits = array.ndim == len(shape) and all(n in (-1, m) for n, m in zip(shape, array.shape, strict=True))
    if not fits or not np.isfinite(array).all():
        dims = str(shape).replace("-1", "K")
        raise CalibrationError(f"{name} must be finite and of shape {dims}, but it is {array.tolist()}.")
    return check.read_only(array)


def strict_json(content: str | bytes) -> Any:
    """Parse JSON, refusing repeated keys, NaN and numbers that no float holds; ValueError or RecursionError if so."""
    return json.loads(content, parse_constant=_finite, parse_float=_finite, object_pairs_hook=_no_repetition)


def _finite(digits: str) -> float:
    if not math.isfinite(value := float(digits)):
        raise ValueError(f"{digits} is not a number in JSON, or is out of range")
    return value


def _no_repetition(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(dict(pairs)) != len(pairs):
        raise ValueError(f"a key occurs twice among {', '.join(key for key, _ in pairs)}")
    return dict(pairs)
