"""Pictures of a calibration: which directions were seen, the sizes before and after, and the residuals."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.certificate.rows import AXES, UNITS, Sizes
from plumbob.calibration.fit import Fitted
from plumbob.calibration.predicted import NAMES, REGIONS, filled
from plumbob.core.check import Floats
from plumbob.core.units import from_si, written
from plumbob.report import INK, MUTED, SERIES, Key, envelope, svg

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
