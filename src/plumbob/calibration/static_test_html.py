"""One page about a static test: the errors over the heading, before and after, and the table."""

import math
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from plumbob.calibration.static_test import ANGLES, StaticTest
from plumbob.core.files import write_text
from plumbob.core.units import to_deg
from plumbob.report import SERIES, SOFT, document, figure, html_table, svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BEFORE, _AFTER = SERIES[1], SERIES[0]
_STYLE = ".scroll { margin-top: 1.75rem; }\n"
_DEFINITIONS = (
    "At each rest the means of specific force and field give roll and pitch, then the heading of the field's level "
    "part; errors are differences of ZYX Euler angles to the mean attitude of the reference over the same rest."
)


def write_static_test(
    path: str | Path, test: StaticTest, *, title: str, facts: Mapping[str, str], overwrite: bool = False
) -> None:
    """Write a self-contained page.

    Parameters
    ----------
    path : path_like
        File to write.
    test : StaticTest
        The result.
    title : str
        Of the page.
    facts : mapping of str to str
        Provenance as name and value; any text is safe.
    overwrite : bool
        Whether a file that lies there may be replaced.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """
    keys = [("before", _BEFORE, "dashed"), ("after", _AFTER, "solid")]
    drawn = figure("Errors at rest against the heading of the reference", _drawing(test), keys)
    body = ["<section>", _summary(test), _remarks(test), drawn, _table(test), "</section>"]
    write_text(path, document(title, facts, body, footer=_DEFINITIONS, style=_STYLE), overwrite=overwrite)


def _drawing(test: StaticTest) -> str:
    heading = np.mod(to_deg(test.reference[:, 0]), 360.0)
    order = np.argsort(heading)

    def draw(drawn: "Figure") -> None:
        axes = drawn.subplots(3, 1, sharex=True)
        for i, (ax, name) in enumerate(zip(axes, ANGLES, strict=True)):
            ax.axhline(0.0, color=SOFT, linewidth=0.5)
            for which, colour, style in (("before", _BEFORE, "--"), ("after", _AFTER, "-")):
                error = to_deg(test.errors(which)[:, i])
                ax.plot(heading[order], error[order], style, color=colour, marker="o", markersize=2.0, linewidth=0.8)
            ax.set_ylabel(f"{name} error [°]")
        axes[-1].set_xlim(0.0, 360.0)
        axes[-1].set_xticks(range(0, 361, 45))
        axes[-1].set_xlabel("heading of the reference [°]")

    return svg(draw, height=4.2, salt="static test")


def _summary(test: StaticTest) -> str:
    head = ("", "max |error| before", "max |error| after", "rms before", "rms after")
    rows = [(name, *map(_cell, figures.values())) for name, figures in test.as_dict()["summary"].items()]
    return html_table(f"Errors at rest [°], {len(test.spans)} rests", head, rows)


def _remarks(test: StaticTest) -> str:
    return "".join(f"<p class='note'>{escape(remark)}</p>" for remark in test.remarks)


def _table(test: StaticTest) -> str:
    head = ("rest", "at, s", *ANGLES, *(f"{name} {when}" for when in ("before", "after") for name in ANGLES))
    numbers = to_deg(np.hstack((test.reference, test.errors("before"), test.errors("after")))).tolist()
    rows = [
        (str(i), f"{span.mean():.1f}", *map(_cell, row))
        for i, (span, row) in enumerate(zip(test.spans, numbers, strict=True), start=1)
    ]
    return html_table("Reference attitude and errors of each rest, before and after calibration [°]", head, rows)


def _cell(degrees: float | None) -> str:
    return "-" if degrees is None or not math.isfinite(degrees) else f"{degrees:z.2f}"
