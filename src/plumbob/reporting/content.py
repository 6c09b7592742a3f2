"""What stands in a report: tables, figures, scenes to be turned by hand; with colours, languages and Chinese labels."""

import re
import textwrap
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.findings import Finding, Note
from plumbob.core.text import WIDTH

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

LANGUAGES: Final = ("en", "zh")  # of the labels of pages and pictures

# After Okabe and Ito, distinguished by colour-blind readers; the names are CSS variables of the page.
PALETTE: Final = {
    "#0072b2": "blue",
    "#d55e00": "red",
    "#009e73": "green",
    "#cc79a7": "pink",
    "#e69f00": "amber",
    "#56b4e9": "sky",
    "#8a6d00": "olive",
}
INK, MUTED, GRID, SHADE, SOFT = "#1b1f24", "#5b6570", "#d8dde2", "#e9edf1", "#aab4be"
SERIES: Final = tuple(PALETTE)
# Names of all colours.
VARIABLES: Final = {**PALETTE, INK: "ink", MUTED: "muted", GRID: "grid", SHADE: "shade", SOFT: "soft"}
COLOURS: Final = {name: colour for colour, name in VARIABLES.items()}

_APART = re.compile(r"(: |, | \[[^\]]*\])")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Both(str):
    """English text that carries its Chinese, for sentences that no dictionary of labels could hold."""

    zh: str

    def __new__(cls, en: str, zh: str) -> Self:
        """Make it of both."""
        made = super().__new__(cls, en)
        made.zh = zh
        return made

    def __str__(self) -> str:
        """Itself: what asks for a string, as a plot's label does, keeps the Chinese."""
        return self

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        """What makes it again."""
        return type(self), (self[:], self.zh)


def said(label: Note, lang: str) -> str:
    """A label in a language; what is not a label stays as it is.

    Parts of a label that stand apart by a colon, a comma or a unit in brackets are looked up one by one, where the
    first of them is known; a number in it stands as # in the dictionary.
    """
    if isinstance(label, Finding):
        return label.sentence(lang)
    if isinstance(label, Both):
        return label[:] if lang == "en" else label.zh
    if lang == "en":
        return label
    first, *others = [label] if _chinese(label) else _APART.split(label)
    return "".join([_chinese(first), *(_chinese(part) or part for part in others)]) if _chinese(first) else label


def _chinese(part: str) -> str:
    numbers = iter(_NUMBER.findall(part))
    return re.sub("#", lambda _: next(numbers), chinese_labels().get(_NUMBER.sub("#", part), ""))


@cache
def chinese_labels() -> dict[str, str]:
    """All labels that have a Chinese word, with # for each number in them."""
    labels: dict[str, str] = tomllib.loads((Path(__file__).parent / "zh.toml").read_text(encoding="utf-8"))
    return labels


_LONG = 20  # rows of a titled table that a page has folded away


@dataclass(frozen=True)
class Table:
    """Rows under a head; the first cell of each row is its name."""

    title: str  # a noun, with a unit where all columns have the same one; may be empty
    head: Sequence[str]  # names of the columns, with their units
    rows: Sequence[Sequence[str]]  # cells as they are shown
    words: Collection[int] = ()  # Columns of words, from 0; the others are numbers. The first one always is.
    strong: Collection[tuple[int, int]] = ()  # row and column of the cells that a page sets in bold
    detail: str = ""  # What to ask for to have it in the text; a page has it folded away. Empty: always shown.

    @property
    def long(self) -> bool:
        """Whether a page has it folded away."""
        return bool(self.detail or (self.title and len(self.rows) > _LONG))

    def text(self) -> Iterator[str]:
        """Title, and lines with columns as wide as their longest cell; last words that are too long stand below."""
        yield from textwrap.wrap(self.title, WIDTH)
        lines = [list(row) for row in ([self.head] if any(self.head) else []) + list(self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        last = len(widths) - 1
        below = last in self.words and sum(widths) + last > WIDTH
        shown = widths[:-1] if below else widths
        narrow = sum(shown) + len(shown) - 1 <= WIDTH < sum(shown) + 2 * len(shown) - 2
        gap = " " if narrow else "  "
        for line in lines:
            remark = line.pop() if below else ""
            cells = [
                f"{cell:<{width}}" if i == 0 or i in self.words else f"{cell:>{width}}"
                for i, (cell, width) in enumerate(zip(line, widths, strict=False))
            ]
            yield gap.join(cells).rstrip()
            if remark and line[1:] != list(self.head[1:-1]):
                yield f"     {remark}"


@dataclass(frozen=True)
class Figure:
    """A drawing."""

    caption: str  # a noun
    draw: "Callable[[FigureBase], object]"  # draws on the matplotlib figure that it gets, in colours of this module
    # names of lines, their colours, and "solid", "dashed", "dotted" or "block"
    key: Sequence[tuple[str, str, str]] = ()
    height: float = 2.4  # inches
    command: str = ""  # that makes what is drawn, on a page only


_FRAMES: Final = 1500
_RATE: Final = 30.0  # frames per second, which look smooth
_DIGITS: Final = 4  # of lengths in m: a tenth of a millimetre


@dataclass(frozen=True, eq=False)
class Scene:
    """A body of points and lines over time."""

    caption: str  # a noun
    t: Floats  # (N,), times, s
    # (N, 3), Places by name, m; z is up. A name that begins with a dot is a helper's: no mark, no label, thin lines.
    points: Mapping[str, Floats]
    lines: Sequence[tuple[str, str]]  # points that are joined
    trail: str = ""  # point whose way is drawn; none where empty
    values: Mapping[str, Floats] = field(default_factory=dict)  # (N,), numbers that are shown beside the time, by name
    unit: str = "°"  # of these numbers
    # (N, 3), a second body with the same lines, drawn pale: what the first one is compared with; may have fewer points
    shadow: Mapping[str, Floats] = field(default_factory=dict)


def scene_data(scene: Scene, lang: str) -> dict[str, Any]:
    """What the script of the page is given of a scene."""
    rows = _rows(scene.t)
    names = list(scene.points)
    shaded = names if scene.shadow else []
    return {
        "t": _rounded(scene.t[rows], 3),
        "names": [said(name, lang) for name in names],
        "points": [_rounded(scene.points[name][rows], _DIGITS) for name in names],
        "shadow": [_rounded(scene.shadow[name][rows], _DIGITS) if name in scene.shadow else [] for name in shaded],
        "lines": [[names.index(start), names.index(end)] for start, end in scene.lines],
        "trail": names.index(scene.trail) if scene.trail else -1,
        "values": [[said(name, lang), _rounded(values[rows], 1)] for name, values in scene.values.items()],
        "unit": scene.unit,
        "grid": said("grid", lang),
    }


def _rows(t: Floats) -> Any:
    """Rows of the frames: at most so many a second, and so many in all."""
    wanted = int(min(t.size, _FRAMES, 1 + np.ceil((t[-1] - t[0]) * _RATE)))
    return np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], max(wanted, 2))).clip(0, t.size - 1))


def _rounded(values: Floats, digits: int) -> Any:
    """Lists of numbers; None where one is not known."""
    flat = [round(value, digits) if np.isfinite(value) else None for value in values.ravel().tolist()]
    if values.ndim == 1:
        return flat
    width = values.shape[1]
    return [flat[k : k + width] for k in range(0, len(flat), width)]
