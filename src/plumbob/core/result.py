"""What a result is to the rooms above: data, of which a report can be made, and numbers ready for JSON."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from plumbob.core.files import write_text
from plumbob.core.text import FactsText


class Described(FactsText):
    """Mixin of a result that is described by the file of `plumbob.reporting` that bears the name of its room."""

    __slots__ = ()

    def report(self, *_: Any, **about: Any) -> Any:
        """Describe it, as a `Report`; `about` says more of where it comes from, as the description takes it."""
        room, name = type(self).__module__.split(".")[1], type(self).__name__.lower()
        return getattr(import_module(f"plumbob.reporting.{room}"), name)(self, **about)

    def text(self, *details: str) -> str:
        """Text for a terminal, with the tables that are always shown and those of the given details."""
        return str(self.report().text(*details))


class Reported(Described):
    """Mixin of a described result that has a page, too."""

    __slots__ = ()

    def page(self, *, lang: str = "en") -> str:
        """HTML of a page, self-contained, its labels in "en" or "zh"; needs matplotlib for figures."""
        return str(self.report().page(lang=lang))

    def write_html(self, path: str | Path, *, lang: str = "en", overwrite: bool = False) -> Path:
        """Write the page, a single file that opens offline; errors as of `page` and of an output that exists."""
        return write_text(path, self.page(lang=lang), overwrite=overwrite)

    def write_pdf(self, path: str | Path, *, lang: str = "en", overwrite: bool = False) -> Path:
        """Write the page as a PDF, which Chromium or Chrome prints; MissingExtraError where neither is installed."""
        return Path(self.report().write_pdf(path, lang=lang, overwrite=overwrite))

    def plot(self, path: str | Path, *, lang: str = "en", overwrite: bool = False) -> Path:
        """Write its own figures, or those of its parts where it has none, as SVG, PNG or PDF by the name's ending."""
        return Path(self.report().plot(path, lang=lang, overwrite=overwrite))


def plain(value: Any) -> Any:
    """Numbers as JSON can hold them: None where one is not finite, lists for arrays, dictionaries for dataclasses."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    return [plain(entry) for entry in value]
