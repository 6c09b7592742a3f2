"""What a paper prints and how its figures are named, in both languages: the file ``<name>.toml`` beside this one.

Outcomes, items and the page are what a run makes of it. The file holds everything of a paper's page that is not
computed. A text is a pair of English and Chinese; ``{name}`` in it, with a format after a colon if need be, stands for
a value that the code gives. Tables:

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

import math
import re
import string
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from plumbob.core.errors import ParameterError
from plumbob.core.resources import packaged
from plumbob.reporting.content import COLOURS, Both, Figure, Table
from plumbob.reporting.report import Report

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

Bar = tuple[float, float]  # least and greatest value that meet it

OPEN: Final[Bar] = (-math.inf, math.inf)  # no bar

_UNSAID: Final = Both("", "")
YES, NO, NOT_STATED = Both("yes", "是"), Both("no", "否"), Both("not stated", "未给出")
REPRODUCED, BY_ARITHMETIC = Both("reproduced", "已复现"), Both("arithmetic holds", "算术成立")
REFUTED, UNREACHED, CANNOT = Both("refuted", "不成立"), Both("not reached", "未达到"), Both("cannot be had", "无法得到")
WITHIN: Final = Both("within the scatter of one run", "在单次散布之内")
CLAIMS: Final = (REPRODUCED, BY_ARITHMETIC, WITHIN, REFUTED, UNREACHED, CANNOT)
KEPT, MISSED, NO_BAR = Both("kept", "满足"), Both("missed", "未达标"), Both("none", "无")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One figure of a paper.

    `key`: short name, unique within the paper, as ``slide.gated.roll``; `where`: place in the paper, as ``Fig 8``,
    ``Table 1``, ``(7)``, ``§4.3``, empty for what goes beyond it; `what`: a noun; `unit`: of all values; `paper`: as
    printed, None where the paper prints nothing; `faithful`: by the paper's method, corrected, with the noise that is
    stated or assumed on the page; `best`: by the method that Plumbob recommends; `faithful_bar`, `best_bar`: least and
    greatest value that are to be met, `OPEN` where there is none; `reach`: when `faithful` reaches a printed number:
    "<=" or ">=" it, or a largest distance from it; `by`: with which units and runs; `reason`: why the paper's figure is
    not reached, or why a bar is missed, one sentence without a full stop; `error`: standard error of a mean over seeds,
    twice which is allowed; `one_run`: standard deviation of one run, where the paper prints one run; `digits`:
    significant digits that are shown.
    """

    key: str
    where: str
    what: Both
    unit: str = ""
    paper: float | str | None = None
    faithful: float | None = None
    best: float | None = None
    faithful_bar: Bar = OPEN
    best_bar: Bar = OPEN
    reach: float | str = "<="
    by: Both = _UNSAID
    reason: Both | None = None
    error: float = 0.0
    one_run: float = 0.0
    reproducible: bool = True
    digits: int = 3

    def __post_init__(self) -> None:
        """Refuse what says nothing: no value, a bar without a value, or a verdict without its reason."""
        if self.faithful is None and self.best is None:
            raise ParameterError(f"outcome {self.key} has no value.")
        for value, bar in ((self.faithful, self.faithful_bar), (self.best, self.best_bar)):
            if value is None and bar != OPEN:
                raise ParameterError(f"outcome {self.key} has a bar, but no value for it.")
        if not self.reproducible and self.reason is None:
            raise ParameterError(f"outcome {self.key} is marked as not reproducible, but no reason is given.")

    @property
    def met(self) -> bool:
        """Whether every bar is met; NaN meets none."""
        pairs = ((self.faithful, self.faithful_bar), (self.best, self.best_bar))
        more = 2.0 * self.error
        return all(value is None or bar == OPEN or bar[0] - more <= value <= bar[1] + more for value, bar in pairs)

    @property
    def reached(self) -> bool | None:
        """Whether the paper's own method reaches what the paper prints; None where it prints no number for it."""
        if not self.reproducible:
            return False
        if not isinstance(self.paper, int | float) or self.faithful is None:
            return None
        if isinstance(self.reach, str):
            above = self.faithful - self.paper
            return above <= 2.0 * self.error if self.reach == "<=" else above >= -2.0 * self.error
        return abs(self.faithful - self.paper) <= self.reach

    @property
    def claim(self) -> Both | None:
        """What became of a number that the paper prints; refuted where a reason says why; None where there is none.

        Where the paper prints one run, a number within twice the scatter of one is not refuted.
        """
        if self.reached is None:
            return None
        if self.reached:
            return BY_ARITHMETIC if self.by.startswith("arithmetic") else REPRODUCED
        if self.reproducible and self.one_run and abs(self.faithful - self.paper) <= 2.0 * self.one_run:  # type: ignore
            return WITHIN
        return CANNOT if not self.reproducible else REFUTED if self.reason else UNREACHED

    @property
    def verdict(self) -> tuple[Both, Both, Both]:
        """Whether the paper's figure is reached, whether our bars are kept, and with what."""
        barred = (self.faithful_bar, self.best_bar) != (OPEN, OPEN)
        bars = (KEPT if barred else NO_BAR) if self.met else MISSED
        return NOT_STATED if self.reached is None else YES if self.reached else NO, bars, self.by

    def summary(self) -> dict[str, Any]:
        """What JSON has of it; an open end of a bar is null, and so is a value that is not finite."""
        bars = {"faithful_bar": self.faithful_bar, "best_bar": self.best_bar}
        values = {"faithful": self.faithful, "best": self.best}
        return {
            "key": self.key,
            "where": self.where,
            "what": str(self.what),
            "unit": self.unit,
            "paper": self.paper,
            **{name: value if value is not None and math.isfinite(value) else None for name, value in values.items()},
            "digits": self.digits,
            "error": self.error,
            "one_run": self.one_run,
            **{name: [end if math.isfinite(end) else None for end in bar] for name, bar in bars.items()},
            "reached": self.reached,
            "met": self.met,
            "claim": self.claim and str(self.claim),
            "with": str(self.by),
            "verdict": [str(word) for word in self.verdict[:2]],
            "reason": None if self.reason is None else str(self.reason),
        }

    def row(self) -> list[str]:
        """Cells under `HEAD`."""
        pairs = ((self.faithful, self.faithful_bar), (self.best, self.best_bar))
        values = [cell(value, bar, self.digits, self.error) for value, bar in pairs]
        return [self.what, self.where or "-", self.unit or "-", shown(self.paper, self.digits), *values, *self.verdict]


HEAD: Final = (
    Both("figure", "指标"), Both("where", "出处"), Both("unit", "单位"), Both("paper", "论文"),
    Both("its method", "按论文"), Both("ours", "本系统"), Both("reached", "达到论文值"), Both("bar", "限值"),
    Both("with", "条件"),
)  # fmt: skip


def table(outcomes: Sequence[Outcome], title: str = "") -> Table:
    """Table of outcomes."""
    return Table(title, HEAD, [outcome.row() for outcome in outcomes], words=(1, 2, 6, 7, 8))


def shown(value: float | str | None, digits: int) -> str:
    """Value as it is read, with so many significant digits."""
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    if abs(value) < 1e-4:
        return f"{value:.1e}"
    return f"{value:.{max(digits - 1 - math.floor(math.log10(abs(value))), 0)}f}"


def cell(value: float | None, bar: Bar, digits: int, error: float = 0.0) -> str:
    """Value as it is read, with its bar in brackets, ± twice its error; an equals sign where the bar is one number."""
    (low, high), more = bar, f" ± {2.0 * error:.2g}" if error else ""
    if value is None or bar == OPEN:
        return shown(value, digits)
    if f"{low:g}" == f"{high:g}":  # exact
        return f"{f'{low:g}' if low <= value <= high else shown(value, digits)} (= {low:g})"
    if low == -math.inf:
        return f"{shown(value, digits)} (≤ {high:g}{more})"
    ends = f"≥ {low:g}{more}" if high == math.inf else f"{low:g} … {high:g}"
    return f"{shown(value, digits)} ({ends})"


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperItem:
    """Something that a paper describes, states or shows, and what became of it.

    `where`: place in the paper; `what`: a noun, in English; `by`: where it is done: keys of outcomes as
    ``[slide.gated.roll]``, verbs and files in backticks; `reason`: why it is not done, a sentence; empty where it is.
    """

    where: str
    what: str
    by: str = ""
    reason: str = ""

    @property
    def state(self) -> str:
        """Whether it is done, done in part, or not."""
        return "not" if not self.by else "partly" if self.reason else "done"

    def summary(self) -> dict[str, str]:
        """What JSON has of it."""
        return {**asdict(self), "state": self.state}


class Paper(NamedTuple):
    """What a paper's run gives: its page, before which its table of outcomes is put, and every figure."""

    report: Report
    outcomes: Sequence[Outcome]


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
