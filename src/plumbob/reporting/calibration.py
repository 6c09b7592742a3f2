"""Certificate of a calibration: what is said, as a report and as numbers, and what is drawn; or why it was refused."""

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.calibration import Calibrated
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Sizes, sensing_axes, sizes
from plumbob.calibration.predicted import NAMES, REGIONS, filled, region_names
from plumbob.core.check import Floats
from plumbob.core.findings import info
from plumbob.core.text import WIDTH, counted, listed, measured, number
from plumbob.core.units import from_si, g, to_deg, written
from plumbob.data import TITLES
from plumbob.data.calibrated import temperature_drift
from plumbob.data.cards import CalibrationCard, Mount, Quality, TriadCalibration
from plumbob.reporting.content import INK, MUTED, SERIES, Figure, Table
from plumbob.reporting.drawing import PlotLine, PlotPanel, draw_panels
from plumbob.reporting.report import Report
from plumbob.rotations import euler_zyx_from_quat

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

AXES: Final = ("x", "y", "z")

# Units in which a triad is shown; the first one also where only one is.
SHOWN: Final = {"gyr": ("deg/s",), "acc": ("mg", "m/s2"), "mag": ("uT",)}

_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_PPM = 0.01
_NOTHING = 1e-12  # rounding of what is left, in units of SI and µT
_REFERENCE = {"gyr": "rate", "acc": "gravity", "mag": "field"}


def calibrated(
    result: Calibrated | CalibrationCard, fits: Mapping[str, Fitted] | None = None, *, recording: str = ""
) -> Report:
    """What a card holds, with units and standard deviations, and figures of the triads that `fits` just made."""
    card = result.card if isinstance(result, Calibrated) else result
    fits = result.fits if isinstance(result, Calibrated) else fits or {}
    named = {"device": card.device, "date": card.date, "made by": card.software, "recording": recording}
    lacking = [title for name, title in TITLES.items() if name not in card.parts]
    remarks = [f"NOT in this card, which leaves them uncalibrated: {', '.join(lacking)}"] if lacking else []
    parts = [_part(name, getattr(card, name), fits.get(name)) for name in TITLES if name in card.parts]
    return Report(
        "Certificate of calibration",
        facts=[*((name, value) for name, value in named.items() if value), ("model", _formula(card))],
        remarks=["± and predicted errors: one standard deviation", *remarks],
        parts=parts if card.mount is None else [*parts, _mount(card.mount)],
        definitions=[info("page.calibration")],
    )


def refusal_text(refused: CaptureRefusedError) -> str:
    """Tell why a capture was refused, and what to do."""
    lines = [f"REFUSED, {refused.reasons[0].kind}; no card is made"]
    for reason in refused.reasons:
        lines += listed([f"{reason.kind}: {reason.text}"])
        lines += textwrap.wrap(reason.advice, WIDTH, initial_indent="  ", subsequent_indent="  ")
    return "\n".join(lines)


def _part(name: str, c: TriadCalibration, fit: Fitted | None) -> Report:
    grade = "not graded" if c.quality is None else c.quality.grade
    lengths = None if fit is None else sizes(name, fit)
    coverage = None
    if fit is not None and lengths is not None:
        vectors = (fit.measured - fit.calibration.bias)[fit.used]
        coverage = Coverage(vectors / np.linalg.norm(vectors, axis=1, keepdims=True), filled(vectors) > 0)
    return Report(
        f"{TITLES[name].capitalize()}: {grade.upper()}",
        facts=_facts(name, c, lengths, coverage),
        tables=[Table("", ["", *AXES], list(_parameters(name, c)))],
        remarks=c.remarks,
        figures=() if fit is None else lambda: list(_drawn(name, fit, lengths, coverage)),
    )


def _mount(mount: Mount) -> Report:
    """How the unit's axes are turned from those of the body."""
    angles = zip(("yaw", "pitch", "roll"), to_deg(euler_zyx_from_quat(mount.q_bs)).tolist(), strict=True)
    facts = [("turned", ", ".join(f"{name} {angle:.3f}°" for name, angle in angles))]
    if mount.sd is not None:
        sd = zip(AXES, to_deg(mount.sd).tolist(), strict=True)
        facts.append(("±", f"{', '.join(f'{axis} {number(value, 2)}°' for axis, value in sd)}, about the body's axes"))
    facts += [(label, text) for label, text in (("method", mount.method), ("date", mount.date)) if text]
    return Report("Mounting of the unit on its body", facts=facts, remarks=mount.remarks)


def _facts(name: str, c: TriadCalibration, lengths: Sizes | None, coverage: "Coverage | None") -> list[tuple[str, str]]:
    """How it was found, how well, and where it holds."""
    missing = "" if coverage is None else region_names(np.flatnonzero(~coverage.covered).tolist())
    unit = SHOWN[name][-1]
    reference = "" if c.reference is None else f"{_REFERENCE[name]} of {from_si(c.reference, unit):.6g} {written(unit)}"
    data, predicted = ("", "") if c.quality is None else _quality(c.quality)
    at, curved = f"bias at {c.temp_ref_c:g} °C", c.bias_per_k.any()
    if c.temp_span_c is not None:
        low, high = c.temp_span_c
        span = f"from {low:.1f} to {high:.1f} °C" if high > low else f"at {low:.1f} °C"
        at += f", calibrated {span}{'; beyond, the bias is extrapolated along its tangent' if curved else ''}"
    facts = [("method", c.method), ("date", c.date), ("residual", _residual(name, c, lengths)), ("data", data)]
    facts += [
        ("not covered", missing),
        ("predicted", predicted),
        ("reference", reference),
        ("temperature", at if curved or c.temp_span_c is not None else ""),
    ]
    return [(label, text) for label, text in facts if text]


def _formula(card: CalibrationCard) -> str:
    """What the card does to a measurement, with the terms that it has."""
    triads = [part for part in card.parts.values() if isinstance(part, TriadCalibration)]
    terms = ["measured", "bias"]
    terms += ["temperature terms"] if any(c.bias_per_k.any() for c in triads) else []
    terms += ["g-sensitivity · specific force"] if any(c.g_sensitivity.any() for c in triads) else []
    terms += ["field per unit · load"] if any(c.per_load is not None for c in triads) else []
    turned = "" if card.mount is None else ", turned into the axes of the body"
    return f"calibrated = matrix · ({' − '.join(terms)}){turned}"


def _parameters(name: str, c: TriadCalibration) -> Iterator[list[str]]:
    """Rows of all parameters: name with unit, and a cell for each axis."""
    for unit in SHOWN[name]:
        yield from _rows([f"bias [{written(unit)}]"], c.bias, c.bias_sd, partial(from_si, name=unit))
    if not c.matrix_found:
        yield ["matrix, scale, axes", *3 * ["not found"]]
    else:
        axes = sensing_axes(c)
        per, unit = (1e6, "ppm") if (np.abs(axes.scale) < _PPM).all() else (1e2, "%")
        skew = zip(("xy", "xz", "yz"), to_deg(axes.skew).tolist(), strict=True)
        yield from _rows([f"matrix, row {axis}" for axis in AXES], c.matrix, c.matrix_sd)
        yield from _rows([f"scale error [{unit}]"], axes.scale, axes.scale_sd, partial(np.multiply, per))
        yield ["axis misalignment [°]", *(number(value) for value in to_deg(axes.misalignment).tolist())]
        yield ["non-orthogonality [°]", *(f"{pair} {number(value)}" for pair, value in skew)]
    if c.bias_per_k.any():
        unit = SHOWN[name][0]
        powers = ["", *(str(k).translate(_RAISED) for k in range(2, len(c.bias_per_k) + 1))]
        labels = [f"bias per K{power} [{written(unit)}/K{power}]" for power in powers]
        yield from _rows(labels, c.bias_per_k, c.bias_per_k_sd, partial(from_si, name=unit))
    if c.g_sensitivity.any():
        labels = [f"g-sensitivity, row {axis} [°/s/g]" for axis in AXES]
        yield from _rows(labels, c.g_sensitivity, c.g_sensitivity_sd, lambda values: to_deg(g(values)))
    if c.per_load is not None:
        yield from _rows([f"field per unit of {load} [µT]" for load in c.loads], c.per_load, c.per_load_sd)


def _rows(
    labels: Sequence[str], values: Floats, sd: Floats | None, convert: Callable[[Any], Any] = np.asarray
) -> Iterator[list[str]]:
    """Rows of values (n, 3) or (3,), each with its standard deviation where it is known, in the unit that is shown."""
    spread = np.zeros_like(values) if sd is None else sd
    converted = (np.atleast_2d(convert(numbers)).tolist() for numbers in (values, spread))
    for label, row, deviations in zip(labels, *converted, strict=True):
        pairs = zip(row, deviations, strict=True)
        yield [label, *(measured(v, v - d, v + d) if d > 0.0 else f"{v + 0.0:.6g}" for v, d in pairs)]


def _residual(name: str, c: TriadCalibration, lengths: Sizes | None) -> str:
    unit = SHOWN[name][0]
    rms = c.residual_rms or 0.0
    values = [rms] if lengths is None else [rms, *lengths.rms]
    shown = [f"{number(value)} {written(unit)}" for value in from_si(np.array(values), unit).tolist()]
    texts = [f"{shown[0]} rms"] if rms > _NOTHING else []  # one mean leaves nothing, however good it is
    if lengths is not None:
        texts.append(f"magnitude error {shown[1]} rms before calibration, {shown[2]} after")
    return "; ".join(texts)


def _quality(q: Quality) -> tuple[str, str]:
    """What it was made of, and the errors of attitude and scale that its covariance predicts, standard deviations."""
    texts = [counted(q.samples, "data point"), f"{counted(q.outliers, 'outlier')} set aside"]
    texts += [] if q.regions is None else [f"{q.regions} of 18 directions"]
    texts += [] if q.condition is None else [f"condition number {number(q.condition, 2)}"]
    angles = {"inclination": q.tilt_sd, "heading": q.heading_sd}
    within = "" if q.tilt_range is None else f" (tilt ≤ {to_deg(q.tilt_range):.0f}°)"
    errors = [f"{name} error{within}: {number(to_deg(sd), 2)}°" for name, sd in angles.items() if sd is not None]
    errors += [] if q.scale_sd is None else [f"scale error: {number(1e6 * q.scale_sd, 2)} ppm"]
    return ", ".join(texts), "; ".join(errors)


SEEN, MISSING = SERIES[0], SERIES[4]
BEFORE, AFTER, OUTLIER = SERIES[1], SERIES[0], SERIES[1]

_GRID = 241  # points across a hemisphere
_DOTS = 400  # samples that a hemisphere shows at most
_COLUMNS = 600
_FEW = 200  # samples that are drawn as dots too
_ROOM = 1.5  # of the picture over the largest residual that was used; outliers beyond stand on its edge
_MARGIN = 1.14  # of the picture around a hemisphere, in radii


def _drawn(name: str, fit: Fitted, lengths: Sizes | None, coverage: "Coverage | None") -> Iterator[Figure]:
    """Figures of a fit."""
    if lengths is not None and coverage is not None:
        yield coverage_figure(coverage)
        yield size_figure(name, lengths)
    if fit.soak is not None:
        yield from temperature_figures(name, fit, fit.soak)
    else:
        yield residual_figure(name, fit)


class Coverage(NamedTuple):
    """Directions (N, 3) of what was measured and used, seen from the centre of the fit, and which regions they fill."""

    directions: Floats
    covered: NDArray[np.bool_]


def coverage_figure(coverage: Coverage) -> Figure:
    """Both hemispheres in Lambert's equal-area map with the 18 regions."""
    directions, covered = coverage

    def draw(canvas: "FigureBase") -> None:
        for ax, side in zip(canvas.subplots(1, 2), (1.0, -1.0), strict=True):
            _draw_hemisphere(ax, directions, covered, side)

    key = [("seen", SEEN, "block"), ("missing", MISSING, "block"), ("samples", INK, "dotted")]
    return Figure(f"Directions covered: {np.count_nonzero(covered)} / {covered.size}", draw, key, height=3.9)


def size_figure(name: str, sizes: Sizes) -> Figure:
    """Sizes of the vectors over the samples, before and after."""
    unit, x = SHOWN[name][0], (0.5, sizes.before.size + 0.5)
    pairs = ((sizes.before, BEFORE), (sizes.after, AFTER))
    lines = [_over_samples(from_si(np.where(sizes.used, values, np.nan), unit), colour) for values, colour in pairs]
    lines.append(PlotLine(np.linspace(*x, 3), np.full(3, from_si(sizes.expected, unit)), INK, "dashed", width=0.7))
    panel = PlotPanel(f"magnitude [{written(unit)}]", lines, "sample", x=x, room=0.12, columns=_COLUMNS)
    key = [("before", BEFORE, "solid"), ("after", AFTER, "solid"), ("expected", INK, "dashed")]
    return Figure("Magnitude before and after calibration", partial(draw_panels, lambda: [panel]), key)


def temperature_figures(name: str, fit: Fitted, soak: Floats) -> Iterator[Figure]:
    """How readings at rest change with the temperature, by axis, and what the polynomial leaves, over time too."""
    c, unit, (t, temp) = fit.calibration, SHOWN[name][0], soak.T
    grid = np.linspace(temp.min(), temp.max(), 200)
    drift, at_blocks = (from_si(temperature_drift(c, at), unit).T for at in (grid, temp))
    rows, residual = from_si(fit.residuals, unit).T, f"residual [{written(unit)}]"
    axes = list(zip(drift, at_blocks + rows, rows, SERIES, strict=False))
    points = [PlotLine(temp, each[1], each[3], mark=".", width=0.0) for each in axes]
    change = PlotPanel(
        f"change [{written(unit)}]",
        [*points, *(PlotLine(grid, each[0], each[3], width=1.2) for each in axes)],
        "temperature [°C]",
        room=0.12,
    )
    over_temp = [PlotLine(temp, each[2], each[3], mark=".", width=0.0) for each in axes]
    over_time = [PlotLine(t / 60.0, each[2], each[3]) for each in axes]
    panels = [change, PlotPanel(residual, over_temp, "temperature [°C]", room=0.12)]
    key = [(axis, colour, "solid") for axis, colour in zip(AXES, SERIES, strict=False)]
    yield Figure(
        f"Drift from {c.temp_ref_c:.4g} °C, and residuals", partial(draw_panels, lambda: panels), key, height=5.0
    )
    later = PlotPanel(residual, over_time, "time [min]", room=0.12)
    yield Figure("Residuals over time", partial(draw_panels, lambda: [later]), key)


def residual_figure(name: str, fit: Fitted) -> Figure:
    """Residual of each sample, with outliers marked, on the edge where they are farther off."""
    unit = SHOWN[name][0]
    rows = from_si(fit.residuals.reshape(len(fit.used), -1), unit)
    reach = _ROOM * float(np.abs(rows[fit.used]).max(initial=np.finfo(float).tiny))
    outlier = OUTLIER if rows.shape[1] == 1 else INK
    names = AXES if rows.shape[1] == len(AXES) else ("residual",)

    x, lines = (0.5, fit.used.size + 0.5), []
    for values, colour in zip(rows.T, SERIES, strict=False):
        lines.append(_over_samples(np.where(fit.used, values, np.nan), colour))
        if not fit.used.all():
            beyond = _over_samples(np.where(fit.used, np.nan, np.clip(values, -reach, reach)), outlier)
            lines.append(replace(beyond, mark="x", width=0.0))
    lines.append(PlotLine(np.linspace(*x, 3), np.zeros(3), MUTED, width=0.7))
    panel = PlotPanel(f"residual [{written(unit)}]", lines, "sample", x=x, y=(-reach, reach), columns=_COLUMNS)
    key = [(name, colour, "solid") for name, colour in zip(names, SERIES, strict=False)]
    key += [] if fit.used.all() else [("outliers, set aside", outlier, "block")]
    return Figure("Residuals", partial(draw_panels, lambda: [panel]), key)


def _over_samples(values: Floats, colour: str) -> PlotLine:
    mark = "." if values.size <= _FEW else ""
    return PlotLine(np.arange(1.0, values.size + 1.0), values, colour, width=0.9, mark=mark, size=4.0)


def _draw_hemisphere(ax: "Axes", directions: Floats, covered: NDArray[np.bool_], side: float) -> None:
    from matplotlib.patches import Circle

    ax.set_aspect("equal")
    ax.set_xlim(-_MARGIN, _MARGIN)
    ax.set_ylim(-_MARGIN, _MARGIN)
    ax.axis("off")
    rim = Circle((0.0, 0.0), 1.0, facecolor="none", edgecolor=INK, linewidth=0.8)
    ax.add_patch(rim)
    _draw_regions(ax, covered, side, rim)
    here = directions[side * directions[:, 2] >= 0.0]
    dots = _mapped(here[:: -(-len(here) // _DOTS) or 1], side)
    ax.plot(*dots.T, ".", color=INK, markersize=2.0, alpha=0.45)
    _name_regions(ax, side)


def _draw_regions(ax: "Axes", covered: NDArray[np.bool_], side: float, rim: Any) -> None:
    line = np.linspace(-1.0, 1.0, _GRID)
    x, y = np.meshgrid(line, line)
    cosines = _unmapped(x, y, side) @ REGIONS.T
    for region in np.unique(cosines.argmax(axis=2)[x**2 + y**2 <= 1.0]).tolist():
        ahead = cosines[..., region] - np.delete(cosines, region, axis=2).max(axis=2)
        colour = SEEN if covered[region] else MISSING
        area = ax.contourf(x, y, ahead, levels=[0.0, 3.0], colors=[colour], alpha=0.3 if covered[region] else 0.12)
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
