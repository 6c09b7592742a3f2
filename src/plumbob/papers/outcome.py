"""What a paper's run leaves behind: outcomes with their bars, the paper's items, and its page."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final, NamedTuple

from plumbob.core.errors import ParameterError
from plumbob.reporting.content import Both, Table
from plumbob.reporting.report import Report

Bar = tuple[float, float]  # least and greatest value that meet it

OPEN: Final[Bar] = (-math.inf, math.inf)  # no bar

_UNSAID: Final = Both("", "")
YES, NO, NOT_STATED = Both("yes", "是"), Both("no", "否"), Both("not stated", "未给出")
REPRODUCED, BY_ARITHMETIC = Both("reproduced", "已复现"), Both("arithmetic holds", "算术成立")
REFUTED, UNREACHED, CANNOT = Both("refuted", "不成立"), Both("not reached", "未达到"), Both("cannot be had", "无法得到")
WITHIN: Final = Both("within the scatter of one run", "在单次散布之内")
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
        kept = (KEPT if barred else NO_BAR) if self.met else MISSED
        return NOT_STATED if self.reached is None else YES if self.reached else NO, kept, self.by

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
