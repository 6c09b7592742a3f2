"""Section of a benchmark: one table of figures, and the bars that it has to keep."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from benchmarks.harness.bar import Bar

Figure = float | str


@dataclass(frozen=True, slots=True)
class Section:
    """One table.

    Attributes
    ----------
    title : str
        What was measured, and under which conditions.
    columns : tuple of str
        Names with units.
    rows : mapping of str to tuple
        Figures by row, one for each column; infinite where a fit was refused.
    bars : tuple of Bar
        What has to be kept.
    """

    title: str
    columns: tuple[str, ...]
    rows: Mapping[str, tuple[Figure, ...]]
    bars: tuple[Bar, ...]

    def summary(self) -> dict[str, Any]:
        """Ready for JSON; None where a figure is infinite."""
        return {
            "title": self.title,
            "rows": [
                {"name": name, **dict(zip(self.columns, map(_finite, row), strict=True))}
                for name, row in self.rows.items()
            ],
            "bars": [bar.summary() for bar in self.bars],
        }

    def lines(self) -> Iterator[str]:
        """Lines of the table."""
        wide = max(map(len, self.rows), default=0) + 2
        widths = [max(len(column), 8) + 2 for column in self.columns]
        yield self.title
        yield " " * wide + "".join(f"{c:>{w}}" for c, w in zip(self.columns, widths, strict=True))
        for name, row in self.rows.items():
            yield f"{name:{wide}}" + "".join(f"{_cell(v):>{w}}" for v, w in zip(row, widths, strict=True))


def _finite(figure: Figure) -> Figure | None:
    return figure if isinstance(figure, str) or math.isfinite(figure) else None


def _cell(figure: Figure) -> str:
    return figure if isinstance(figure, str) else f"{figure:.3g}" if math.isfinite(figure) else "refused"
