"""What a paper prints and how its figures are named, in both languages: the file ``<name>.toml`` beside this one.

It holds everything of a paper's page that is not computed. A text is a pair of English and Chinese; ``{name}`` in it,
with a format after a colon if need be, stands for a value that the code gives. Tables:

``paper``
    Its title, what it is about, and the keys of its main figures.
``text``, ``texts``
    Texts by key, and those that stand for the values of a name.
``outcome``, ``group``, ``each``
    Figures by key: place, noun, unit, printed value, bars, reason; what all have whose keys begin alike: the longest
    beginning counts; and words by whose name in braces a key stands for several, whose numbers are lists then.
``part``, ``table``, ``figure``
    Parts of the page: title, facts and remarks; title, head and fixed rows; caption, names of the lines, height, and
    labels and limits of the axes. What a table or figure does not say is that of the one that it is ``like``.
``items``
    What the paper describes, and what became of it: rows of place, noun, where it is done, and why not.
"""

import re
import string
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

from plumbob.core.resources import packaged
from plumbob.papers.outcome import Outcome, PaperItem
from plumbob.reporting.content import COLOURS, Both, Figure, Table
from plumbob.reporting.report import Report

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

_VALUE_ALONE: Final = re.compile(r"\{(\w+)\}")


class _Typographic(string.Formatter):
    """Formats as `str.format` does, and a number after ``:−`` with a minus as it is printed."""

    def format_field(self, value: Any, format_spec: str) -> str:
        text: str = super().format_field(value, format_spec.removeprefix("−"))
        return text.replace("-", "−") if format_spec.startswith("−") else text


_format: Final = _Typographic().vformat


def filled(template: Any, values: Mapping[str, Any]) -> Any:
    """A text with its values, in both languages where it is a pair."""
    if isinstance(template, str):
        alone = _VALUE_ALONE.fullmatch(template)
        value = values[alone[1]] if alone else _format(template, (), values)
        return value if isinstance(value, str) else f"{value}"
    en, zh = template
    chinese = {name: getattr(value, "zh", value) for name, value in values.items()}
    return Both(_format(en, (), values), _format(zh, (), chinese))


def _each(rows: Mapping[str, Any], place: str, names: Mapping[str, Sequence[str]]) -> Iterator[tuple[str, Any]]:
    """Rows, those with a place in their key once for each name; of a list of numbers or bars each has its own."""

    def value_for(field: str, value: Any, k: int, words: Sequence[str]) -> Any:
        if not isinstance(value, list) or (field.endswith("_bar") and not isinstance(value[0], list)):
            return value
        if isinstance(value[0], str):
            return [text.replace(place, word) for text, word in zip(value, words, strict=True)]
        return value[k]

    for key, row in rows.items():
        if place not in key:
            yield key, row
        else:
            for k, (name, words) in enumerate(names.items()):
                yield (
                    key.replace(place, name),
                    {field: value_for(field, value, k, words) for field, value in row.items()},
                )


class Description:
    """A paper's description; its name is that of the paper, and of its file."""

    def __init__(self, name: str) -> None:
        self.name = name

    @cached_property
    def content(self) -> dict[str, Any]:
        """The file, with what stands for several written out."""
        content = tomllib.loads(packaged(f"papers/{self.name}.toml"))
        for words, names in content.get("each", {}).items():
            content["outcome"] = dict(_each(content["outcome"], f"{{{words}}}", names))
        for kind in ("table", "figure"):
            for entry in content[kind].values():
                base = content[kind][entry.pop("like")] if "like" in entry else {}
                entry.update({name: value for name, value in base.items() if name not in entry})
        return content

    @property
    def title(self) -> Both:
        """Of the paper."""
        return Both(*self.content["paper"]["title"])

    @property
    def about(self) -> Both:
        """The paper in two sentences."""
        return Both(*self.content["paper"]["about"])

    @property
    def items(self) -> Sequence[PaperItem]:
        """What the paper describes, in its order."""
        names = ("where", "what", "by", "reason")
        return [PaperItem(**dict(zip(names, row, strict=False))) for row in self.content["items"]["rows"]]

    def text(self, key: str, **values: Any) -> Both:
        """A text of the table ``text``."""
        text: Both = filled(self.content["text"][key], values)
        return text

    def texts(self, key: str) -> dict[str, Both]:
        """Texts of a table of its own, by their keys."""
        return {name: Both(*pair) for name, pair in self.content["texts"][key].items()}

    def printed(self, key: str) -> Any:
        """What the paper prints for a figure."""
        return self.content["outcome"][key]["paper"]

    def row(self, key: str, /, **given: Any) -> Outcome:
        """A figure of the table ``outcome``: fields of `Outcome` that are computed, and values of its texts."""
        groups = self.content.get("group", {})
        group = max((prefix for prefix in groups if key.startswith(prefix)), key=len, default=None)
        row = {**groups.get(group, {}), **self.content["outcome"][key]}
        fields = {name: given.pop(name) for name in tuple(given) if name in Outcome.__dataclass_fields__}
        for name, value in row.items():
            texts = isinstance(value, str | list) and not name.endswith("_bar")
            fields.setdefault(name, filled(value, given) if texts else value)
        bars = {name: tuple(value) for name, value in fields.items() if name.endswith("_bar")}
        return Outcome(**{"where": "", **fields, **bars, "key": key})

    def part(self, key: str, /, **given: Any) -> Report:
        """A part of the page: fields of `Report` that are computed, and values of its texts."""
        part = self.content["part"][key]
        fields = {name: given.pop(name) for name in tuple(given) if name in Report.__dataclass_fields__}
        for name, texts in part.items():
            if name == "facts":
                texts_of: Any = [tuple(filled(cell, given) for cell in fact) for fact in texts]
            else:
                texts_of = filled(texts, given) if name == "title" else [filled(text, given) for text in texts]
            fields.setdefault(name, texts_of)
        return Report(**fields)

    def table(self, key: str, rows: Sequence[Sequence[str]] | None = None, **given: Any) -> Table:
        """A table of the page, with its fixed rows where none are given, and values of its texts."""
        table = self.content["table"][key]
        fields = {name: given.pop(name) for name in tuple(given) if name in Table.__dataclass_fields__}
        if rows is None:
            rows = [[filled(cell, given) for cell in row] for row in table["rows"]]
        fields.setdefault("title", filled(table.get("title", ""), given))
        fields.setdefault("head", [filled(cell, given) for cell in table.get("head", ())])
        return Table(rows=rows, **{"words": table.get("words", ()), **fields})

    def figure(self, key: str, draw: "Callable[[FigureBase], None]", **values: Any) -> Figure:
        """A figure of the page, with its lines."""
        figure = self.content["figure"][key]
        lines = [(filled(text, values), COLOURS[name], dash) for text, name, dash in figure.get("key", ())]

        def drawn(canvas: Any) -> None:  # the stubs have no axes of a part of a figure
            draw(canvas)
            for axes, settings in zip(canvas.axes, figure.get("axes", ()), strict=False):
                plain = {name: v for name, v in settings.items() if name not in ("h", "v", "xscale", "yscale")}
                axes.set(**{n: filled(v, {}) if n.endswith("label") or n == "title" else v for n, v in plain.items()})

        return Figure(filled(figure["caption"], values), drawn, lines, figure.get("height", Figure.height))


PAPERS: Final = {name: Description(name) for name in ("fin", "buoy", "trackball", "arm", "rod")}
