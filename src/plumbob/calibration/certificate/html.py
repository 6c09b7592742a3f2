"""One page about a calibration: the figures first, then what they were found from."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np

from plumbob.calibration.certificate import figure
from plumbob.calibration.certificate.rows import AXES, LEGEND, facts, formula, grade, mount_rows, sizes, table_rows
from plumbob.calibration.fit import Fitted
from plumbob.calibration.predicted import names_of
from plumbob.core.files import write_text
from plumbob.data import TITLES
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.report import LABELS, definitions_list, document, html_table
from plumbob.report import figure as framed

_STYLE = f"""\
{LABELS}\
section dl {{ margin-top: 1.25rem; }}
.note {{ margin-top: 1.25rem; }}
"""
_DEFINITIONS = (
    "Scale, direction and angles are those of the sensing axes: the rows of the inverse matrix. The maps are Lambert's "
    "equal-area projections of the directions of what was measured, seen from the centre of the fit: +z on the left, "
    "−z on the right, x to the right and y up in both. Each direction belongs to the nearest of 6 faces and 12 edges "
    "of a cube. Predicted errors follow from the covariance of the parameters; those of inclination and heading are "
    "root mean squares over attitudes."
)


def write_html(
    path: str | Path,
    card: CalibrationCard,
    fits: Mapping[str, Fitted],
    *,
    title: str,
    facts: Mapping[str, str],
    overwrite: bool = False,
) -> Path:
    """Write a self-contained page with tables and figures.

    Parameters
    ----------
    path : path_like
        File to write.
    card : CalibrationCard
        The card.
    fits : mapping of str to Fitted
        By triad, the fits that it was just made of; their triads get figures.
    title : str
        Of the page.
    facts : mapping of str to str
        Provenance as name and value. Any text is safe.
    overwrite : bool
        Whether a file that lies there may be replaced.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    MissingExtraError
        If there are figures to draw and matplotlib is not installed.
    """
    return write_text(path, page(card, fits, title=title, facts=facts), overwrite=overwrite)


def page(
    card: CalibrationCard,
    fits: Mapping[str, Fitted],
    *,
    title: str,
    facts: Mapping[str, str],
) -> str:
    """Text of the page that `write_html` writes."""
    named = {"device": card.device, "date": card.date, "method": card.method, "software": card.software}
    sections = [_section(name, card, fits) for name in TITLES if name in card.parts]
    body = [_missing(card), *sections, _mount(card)]
    told = {k: v for k, v in named.items() if v} | dict(facts)
    return document(
        title, told, [part for part in body if part], footer=f"{LEGEND}. {formula(card)}. {_DEFINITIONS}", style=_STYLE
    )


def _missing(card: CalibrationCard) -> str:
    lacking = [title for name, title in TITLES.items() if name not in card.parts]
    return (
        f"<p class='note'>Not in this card, which leaves them uncalibrated: {', '.join(lacking)}.</p>"
        if lacking
        else ""
    )


def _section(name: str, card: CalibrationCard, fits: Mapping[str, Fitted]) -> str:
    model: TriadCalibration = getattr(card, name)
    fit = fits.get(name)
    parts = [
        f"<section><h2>{TITLES[name].capitalize()}: {grade(model)}</h2>",
        html_table("Parameters", ["", *AXES], table_rows(name, model)),
        definitions_list(facts(name, model, fit)),
        *_remarks(model.remarks),
    ]
    return "\n".join([*parts, *([] if fit is None else _evidence(name, fit)), "</section>"])


def _evidence(name: str, fit: Fitted) -> list[str]:
    """Figures of a fit."""
    parts = []
    found = sizes(name, fit)
    if found is not None:
        parts.append(_coverage(name, fit))
        caption = "Magnitude before and after calibration"
        parts.append(framed(caption, figure.size_figure(name, found, name), figure.size_key()))
    drawn = figure.residual_figure(name, fit, name)
    return [*parts, framed("Residuals", drawn, figure.residual_key(fit))]


def _coverage(name: str, fit: Fitted) -> str:
    directions, seen = figure.coverage(fit)
    caption = f"Directions covered: {np.count_nonzero(seen)} of {seen.size}"
    told = "" if seen.all() else f"<p>Missing: {escape(names_of(np.flatnonzero(~seen).tolist()))}.</p>"
    return framed(caption, figure.coverage_figure(directions, seen, name), figure.coverage_key()) + told


def _mount(card: CalibrationCard) -> str:
    if card.mount is None:
        return ""
    rows = definitions_list(mount_rows(card.mount)) + "".join(_remarks(card.mount.remarks))
    return f"<section><h2>Mounting of the unit on its body</h2>{rows}</section>"


def _remarks(remarks: Sequence[str]) -> list[str]:
    """List of the remarks, or nothing where there are none."""
    items = "".join(f"<li>{escape(remark)}</li>" for remark in remarks)
    return [f"<ul class='note'>{items}</ul>"] if items else []
