"""The page of a calibration: directions seen, sizes before and after, residuals, and the table."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.certificate.rows import (
    AXES,
    LEGEND,
    Sizes,
    facts,
    formula,
    grade,
    mount_rows,
    sizes,
    table_rows,
)
from plumbob.calibration.certificate.rows import SHOWN as UNITS
from plumbob.calibration.fit import Fitted
from plumbob.calibration.predicted import NAMES, REGIONS, filled, names_of
from plumbob.core.check import Floats
from plumbob.core.files import write_text
from plumbob.core.units import from_si, written
from plumbob.data import TITLES
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.report import INK, LABELS, MUTED, SERIES, Key, definitions_list, document, envelope, html_table, svg
from plumbob.report import figure as framed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SEEN, MISSING, SAMPLE = SERIES[0], SERIES[4], INK
BEFORE, AFTER, OUTLIER = SERIES[1], SERIES[0], SERIES[1]

_HEIGHT = 2.4
_SPHERE_HEIGHT = 3.9
_GRID = 241  # points across a hemisphere
_DOTS = 400  # samples that a hemisphere shows at most
_COLUMNS = 600
_FEW = 200  # samples that are drawn as dots too
_ROOM = 1.5  # of the picture over the largest residual that was used; outliers beyond stand on its edge
_MARGIN = 1.14  # of the picture around a hemisphere, in radii


def coverage(fit: Fitted) -> tuple[Floats, NDArray[np.bool_]]:
    """Directions (N, 3) of what was measured and used, seen from the centre of the fit, and which regions they fill."""
    vectors = (fit.measured - fit.calibration.bias)[fit.used]
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True), filled(vectors) > 0


def coverage_figure(directions: Floats, seen: NDArray[np.bool_], salt: str) -> str:
    """Both hemispheres in Lambert's equal-area map with the 18 regions, as SVG."""

    def draw(figure: "Figure") -> None:
        for ax, side in zip(figure.subplots(1, 2), (1.0, -1.0), strict=True):
            _draw_hemisphere(ax, directions, seen, side)

    return svg(draw, height=_SPHERE_HEIGHT, salt=f"coverage {salt}")


def coverage_key() -> Key:
    """Key of `coverage_figure`."""
    return [("seen", SEEN, "block"), ("missing", MISSING, "block"), ("samples", SAMPLE, "dotted")]


def size_figure(name: str, sizes: Sizes, salt: str) -> str:
    """Sizes of the vectors over the samples, before and after, as SVG."""
    unit = UNITS[name][0]

    def draw(figure: "Figure") -> None:
        ax = figure.subplots()
        for values, colour in ((sizes.before, BEFORE), (sizes.after, AFTER)):
            _plot(ax, from_si(np.where(sizes.used, values, np.nan), unit), colour)
        ax.axhline(from_si(sizes.expected, unit), color=INK, linewidth=0.7, linestyle=(0, (4, 3)), zorder=1)
        _label(ax, sizes.before.size, f"magnitude [{written(unit)}]")

    return svg(draw, height=_HEIGHT, salt=f"size {salt}")


def size_key() -> Key:
    """Key of `size_figure`."""
    return [("before", BEFORE, "solid"), ("after", AFTER, "solid"), ("expected", INK, "dashed")]


def residual_figure(name: str, fit: Fitted, salt: str) -> str:
    """Residual of each sample, with outliers marked, on the edge where they are farther off, as SVG."""
    unit = UNITS[name][0]
    rows = from_si(fit.residuals.reshape(len(fit.used), -1), unit)

    reach = _ROOM * float(np.abs(rows[fit.used]).max(initial=np.finfo(float).tiny))

    def draw(figure: "Figure") -> None:
        ax = figure.subplots()
        for values, colour in zip(rows.T, _colours(rows), strict=True):
            _plot(ax, np.where(fit.used, values, np.nan), colour)
            beyond = np.where(fit.used, np.nan, np.clip(values, -reach, reach))
            ax.plot(
                *envelope(_numbers(values), beyond, _COLUMNS), "x", color=_outlier(rows), markersize=4.0, clip_on=False
            )
        ax.axhline(0.0, color=MUTED, linewidth=0.7)
        _label(ax, fit.used.size, f"residual [{written(unit)}]")
        ax.set_ylim(-reach, reach)

    return svg(draw, height=_HEIGHT, salt=f"residual {salt}")


def residual_key(fit: Fitted) -> Key:
    """Key of `residual_figure`."""
    rows = fit.residuals.reshape(len(fit.used), -1)
    names = AXES if rows.shape[1] == len(AXES) else ("residual",)
    found = [(name, colour, "solid") for name, colour in zip(names, _colours(rows), strict=True)]
    return found + ([] if fit.used.all() else [("outliers, set aside", _outlier(rows), "block")])


def _colours(rows: Floats) -> tuple[str, ...]:
    return SERIES[: rows.shape[1]]


def _outlier(rows: Floats) -> str:
    return OUTLIER if rows.shape[1] == 1 else INK


def _plot(ax: "Axes", values: Floats, colour: str) -> None:
    x, y = envelope(_numbers(values), values, _COLUMNS)
    ax.plot(x, y, color=colour, linewidth=0.9, marker="." if values.size <= _FEW else "", markersize=4.0)


def _numbers(values: Floats) -> Floats:
    return np.arange(1.0, values.size + 1.0)


def _label(ax: "Axes", count: int, label: str) -> None:
    ax.set_xlim(0.5, count + 0.5)
    ax.margins(y=0.12)
    ax.set_xlabel("sample")
    ax.set_ylabel(label)


def _draw_hemisphere(ax: "Axes", directions: Floats, seen: NDArray[np.bool_], side: float) -> None:
    from matplotlib.patches import Circle

    ax.set_aspect("equal")
    ax.set_xlim(-_MARGIN, _MARGIN)
    ax.set_ylim(-_MARGIN, _MARGIN)
    ax.axis("off")
    rim = Circle((0.0, 0.0), 1.0, facecolor="none", edgecolor=INK, linewidth=0.8)
    ax.add_patch(rim)
    _draw_regions(ax, seen, side, rim)
    here = directions[side * directions[:, 2] >= 0.0]
    dots = _mapped(here[:: -(-len(here) // _DOTS) or 1], side)
    ax.plot(*dots.T, ".", color=SAMPLE, markersize=2.0, alpha=0.45)
    _name_regions(ax, side)


def _draw_regions(ax: "Axes", seen: NDArray[np.bool_], side: float, rim: Any) -> None:
    line = np.linspace(-1.0, 1.0, _GRID)
    x, y = np.meshgrid(line, line)
    cosines = _unmapped(x, y, side) @ REGIONS.T
    for region in np.unique(cosines.argmax(axis=2)[x**2 + y**2 <= 1.0]).tolist():
        ahead = cosines[..., region] - np.delete(cosines, region, axis=2).max(axis=2)
        colour = SEEN if seen[region] else MISSING
        area = ax.contourf(x, y, ahead, levels=[0.0, 3.0], colors=[colour], alpha=0.3 if seen[region] else 0.12)
        edge = ax.contour(x, y, ahead, levels=[0.0], colors=[MUTED], linewidths=0.6)
        for drawn in (area, edge):
            drawn.set_clip_path(rim)


def _name_regions(ax: "Axes", side: float) -> None:
    """Names of faces and edges, those on the rim outside of it."""
    for name, direction in zip(NAMES, REGIONS, strict=True):
        if side * direction[2] < -1e-9:
            continue
        out = 1.07 if abs(direction[2]) < 1e-9 else 1.0
        at = out * _mapped(direction[np.newaxis], side)[0]
        ax.annotate(name, tuple(at.tolist()), ha="center", va="center", color=INK, fontsize=6.5)


def _mapped(directions: Floats, side: float) -> Floats:
    """Places (N, 2) of directions (N, 3) of one hemisphere, whose rim has radius 1, areas kept."""
    return np.asarray(directions[:, :2] / np.sqrt(1.0 + side * directions[:, 2:]))


def _unmapped(x: Floats, y: Floats, side: float) -> Floats:
    """Directions (..., 3) of places; those far outside of the rim are taken to the other pole."""
    square = np.minimum(x**2 + y**2, 2.0)
    level = np.sqrt(2.0 - square)
    return np.stack([x * level, y * level, side * (1.0 - square)], axis=-1)


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
        parts.append(framed(caption, size_figure(name, found, name), size_key()))
    drawn = residual_figure(name, fit, name)
    return [*parts, framed("Residuals", drawn, residual_key(fit))]


def _coverage(name: str, fit: Fitted) -> str:
    directions, seen = coverage(fit)
    caption = f"Directions covered: {np.count_nonzero(seen)} of {seen.size}"
    told = "" if seen.all() else f"<p>Missing: {escape(names_of(np.flatnonzero(~seen).tolist()))}.</p>"
    return framed(caption, coverage_figure(directions, seen, name), coverage_key()) + told


def _mount(card: CalibrationCard) -> str:
    if card.mount is None:
        return ""
    rows = definitions_list(mount_rows(card.mount)) + "".join(_remarks(card.mount.remarks))
    return f"<section><h2>Mounting of the unit on its body</h2>{rows}</section>"


def _remarks(remarks: Sequence[str]) -> list[str]:
    """List of the remarks, or nothing where there are none."""
    items = "".join(f"<li>{escape(remark)}</li>" for remark in remarks)
    return [f"<ul class='note'>{items}</ul>"] if items else []
