"""Before and after: as text, as a dictionary, as a page and as a picture."""

from collections.abc import Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.core import text
from plumbob.core.files import write_text
from plumbob.core.text import listed
from plumbob.core.units import from_si, written
from plumbob.noise.compare import Compared
from plumbob.noise.datasheet import figure, numbers
from plumbob.noise.datasheet.html import FOLDED
from plumbob.noise.datasheet.numbers import rows
from plumbob.noise.datasheet.table import curve_as_dict
from plumbob.noise.findings import Deviation
from plumbob.noise.terms import DEVIATION
from plumbob.report import LABELS, SERIES, SHADE, Key, document, html_table, svg
from plumbob.report import figure as framed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROWS = 40  # of a table
_WIDTHS = (10, 13, 13, 10, 10, 10)
_HEAD = ("tau [s]", "before", "after", "ratio", "from", "to")
_BEFORE, _AFTER = SERIES[0], SERIES[1]
_STYLE = LABELS + FOLDED
_DEFINITIONS = (
    "Overlapping Allan deviations of two records at equal averaging times. Bands are intervals of 68.3 %; that of the "
    "ratio is as if the records were independent. A filter of time constant T bends the curve up to some 10 T, where "
    "no slope and no coefficient may be read, and changes nothing far beyond."
)


def compared_text(found: Sequence[Compared]) -> str:
    """Deviations before and after at equal averaging times, their ratio with its interval, and what to make of it."""
    return "\n\n".join("\n".join(_channel(one)) for one in found)


def compared_as_dict(found: Sequence[Compared]) -> dict[str, Any]:
    """By name of the channel: both curves, ratio, time constant and notes, strictly valid for JSON."""
    return {one.name: _as_dict(one) for one in found}


def write_comparison(
    path: str | Path, found: Sequence[Compared], *, title: str, facts: Mapping[str, str], overwrite: bool = False
) -> Path:
    """Write a self-contained page, as `plumbob.noise.datasheet.write_html` does."""
    body = [_section(i, one) for i, one in enumerate(found)]
    page = document(title, facts, body, footer=_DEFINITIONS, style=_STYLE)
    return write_text(path, page, overwrite=overwrite)


def write_comparison_png(path: str | Path, found: Sequence[Compared], *, overwrite: bool = False) -> Path:
    """Write the plots alone as a picture, one panel for each channel."""
    return figure.write_panels(path, [partial(_draw_panel, one=one) for one in found], overwrite=overwrite)


def _draw_panel(ax: "Axes", one: Compared) -> None:
    _draw(ax, one)
    figure.explain(ax, one.name, _key(one))


def _draw(ax: "Axes", one: Compared) -> None:
    c = one.comparison
    both = [Deviation(one.name, one.quantity, curve) for curve in (c.before, c.after)]
    figure.frame(ax, both)
    if c.bent_below is not None:
        ax.axvspan(ax.get_xlim()[0], c.bent_below, color=SHADE, linewidth=0, zorder=0)
    for deviation, colour in zip(both, (_BEFORE, _AFTER), strict=True):
        figure.draw_curve(ax, deviation, colour, band=0.18)


def _key(one: Compared) -> Key:
    keys = [("before", _BEFORE, "solid"), ("after", _AFTER, "solid")]
    return keys + ([("bent by the filter", SHADE, "block")] if one.comparison.bent_below is not None else [])


def _section(i: int, one: Compared) -> str:
    picture = svg(lambda whole: _draw(whole.subplots(), one), height=figure.HEIGHT, salt=f"compared {i}")
    notes = "".join(f"<li>{escape(note)}</li>" for note in one.comparison.notes)
    table = html_table(f"{one.name} [{written(DEVIATION[one.quantity])}]", _HEAD, _cells(one))
    return "\n".join(
        (
            f"<section><h2>{escape(one.name)}</h2><ul class='note'>{notes}</ul>",
            framed("Allan deviation before and after", picture, _key(one)),
            f"<details><summary>Table</summary>{table}</details></section>",
        )
    )


def _channel(one: Compared) -> list[str]:
    c, unit = one.comparison, DEVIATION[one.quantity]
    lines = [f"{one.name}: {c.before.kind}{numbers.in_unit(unit)}, ratio with its interval of 68.3 %", _row(_HEAD)]
    lines += [_row(cells) for cells in _cells(one)]
    lines += listed(c.notes)
    return lines


def _cells(one: Compared) -> list[tuple[str, ...]]:
    c, unit = one.comparison, DEVIATION[one.quantity]
    found = []
    for i in rows(c.before, _ROWS).tolist():
        deviations = (text.number(from_si(float(curve.dev[i]), unit), 4) for curve in (c.before, c.after))
        ratios = (text.number(float(v[i])) for v in (c.ratio, c.lo, c.hi))
        found.append((text.number(float(c.tau[i])), *deviations, *ratios))
    return found


def _row(cells: Sequence[str]) -> str:
    return "".join(f"{cell:>{width}}" for cell, width in zip(cells, _WIDTHS, strict=True))


def _as_dict(one: Compared) -> dict[str, Any]:
    c, unit = one.comparison, DEVIATION[one.quantity]
    return {
        "quantity": one.quantity.name.lower(),
        "before": curve_as_dict(c.before, unit),
        "after": curve_as_dict(c.after, unit),
        "ratio": c.ratio.tolist(),
        "ratio_lo": c.lo.tolist(),
        "ratio_hi": c.hi.tolist(),
        "time_constant_s": c.time_constant,
        "corner_hz": c.corner,
        "bent_below_s": c.bent_below,
        "notes": list(c.notes),
    }
