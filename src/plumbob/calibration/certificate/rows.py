"""A calibration as rows of a table, as text and as JSON; or the reason for its refusal."""

import json
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import CaptureRefusedError, Fitted
from plumbob.core.check import Floats
from plumbob.core.text import WIDTH, aligned, counted, listed, measured, number, pair
from plumbob.core.units import from_si, g, to_deg, written
from plumbob.data import TITLES, TRIADS
from plumbob.data.cards import UNITS, CalibrationCard, Mount, TriadCalibration
from plumbob.rotations import euler_zyx_from_quat

_ROUNDING = 8.0 * np.finfo(float).eps  # of the inverse of a matrix near 1


class SensingAxes(NamedTuple):
    """Axes of a triad as its inverse matrix has them: row i of ``inv(matrix)`` is what axis i answers to.

    Attributes
    ----------
    scale : ndarray (3,)
        Gain of each axis minus 1: 0.01 reads 1 % too much.
    scale_sd : ndarray (3,) or None
        Standard deviations to first order, where the covariance is known.
    misalignment : ndarray (3,)
        Angle between each sensing axis and the axis of the case that it is called after, rad.
    skew : ndarray (3,)
        Angles between the sensing axes x and y, x and z, y and z, less a right angle, rad.
    """

    scale: Floats
    scale_sd: Floats | None
    misalignment: Floats
    skew: Floats


def sensing_axes(calibration: TriadCalibration) -> SensingAxes:
    """Gains and directions of a triad's axes."""
    response = np.asarray(np.linalg.inv(calibration.matrix), dtype=np.float64)
    gain = np.linalg.norm(response, axis=1)
    unit = np.asarray(response / gain[:, np.newaxis], dtype=np.float64)
    across = np.sqrt(np.maximum(0.0, 1.0 - np.diag(unit) ** 2))
    between = unit @ unit.T
    return SensingAxes(
        scale=_cleaned(gain - 1.0),
        scale_sd=_gain_sd(calibration, response, unit),
        misalignment=np.arctan2(np.where(across > np.sqrt(_ROUNDING), across, 0.0), np.diag(unit)),
        skew=_cleaned(-np.arcsin(between[[0, 0, 1], [1, 2, 2]])),
    )


def _gain_sd(calibration: TriadCalibration, response: Floats, unit: Floats) -> Floats | None:
    """From dR = −R dM R: the gain of axis i changes by −R_ik dM_kl (R_l · u_i)."""
    if calibration.covariance is None:
        return None
    slopes = np.einsum("ik,lj,ij->ikl", response, response, unit).reshape(3, 9)
    variance = np.einsum("ia,ab,ib->i", slopes, calibration.covariance[3:, 3:], slopes)
    return np.asarray(np.sqrt(np.maximum(0.0, variance)))


def _cleaned(values: Floats) -> Floats:
    return np.asarray(np.where(np.abs(values) > _ROUNDING, values, 0.0))


class Sizes(NamedTuple):
    """Sizes of what was measured, and of what became of it.

    Attributes
    ----------
    before, after : ndarray (N,)
        Of each sample, unit of the triad.
    expected : float
        What they should be: the reference, or the mean of those after where none is known.
    used : ndarray (N,) of bool
        Those that were fitted.
    """

    before: Floats
    after: Floats
    expected: float
    used: NDArray[np.bool_]

    def rms(self) -> tuple[float, float]:
        """Root mean square by which used samples miss what they should be, before and after."""
        before, after = (
            float(np.sqrt(np.mean((v[self.used] - self.expected) ** 2))) for v in (self.before, self.after)
        )
        return before, after


def sizes(name: str, fit: Fitted) -> Sizes | None:
    """Sizes of what a fit was made of; None for a gyroscope, whose rates have no size that is known."""
    if name == "gyr" or not fit.used.any():
        return None
    model = fit.calibration
    after = np.linalg.norm((fit.measured - model.bias) @ model.matrix.T, axis=1)
    expected = float(after[fit.used].mean()) if model.reference is None else model.reference
    return Sizes(np.linalg.norm(fit.measured, axis=1), after, expected, fit.used)


AXES = ("x", "y", "z")

SHOWN = {"gyr": ("deg/s",), "acc": ("mg", "m/s2"), "mag": ("uT",)}
"""Units in which a triad is shown; the first one also where only one is."""

LEGEND = "± and predicted errors: one standard deviation"
_RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹"
_PPM = 0.01
_NOTHING = 1e-12  # rounding of what is left, in units of SI and µT
_REFERENCE = {"gyr": "rate", "acc": "gravity", "mag": "field"}


def formula(card: CalibrationCard) -> str:
    """What the card does to a measurement, with the terms that it has."""
    triads = [part for part in card.parts.values() if isinstance(part, TriadCalibration)]
    terms = ["measured", "bias"]
    terms += ["temperature terms"] if any(c.bias_per_k.any() for c in triads) else []
    terms += ["g-sensitivity · specific force"] if any(c.g_sensitivity.any() for c in triads) else []
    turned = "" if card.mount is None else ", turned into the axes of the body"
    return f"calibrated = matrix · ({' − '.join(terms)}){turned}"


def table_rows(name: str, c: TriadCalibration) -> list[list[str]]:
    """Rows of a table with columns x, y and z, the first cell being the label."""
    rows = [
        [f"bias [{written(unit)}]", *_cells(from_si(c.bias, unit), _converted(c.bias_sd, unit))] for unit in SHOWN[name]
    ]
    return [*rows, *_matrix_rows(c), *_axis_rows(c), *_temperature_rows(name, c), *_coupling_rows(c)]


def facts(name: str, c: TriadCalibration, fit: Fitted | None) -> list[tuple[str, str]]:
    """Names and values: how it was found, how well, and where it holds."""
    found = [("method", c.method), ("date", c.date), ("residual", _residual(name, c, fit))]
    found += [("data", _made_of(c)), ("predicted", _predicted(c)), ("reference", _reference(name, c))]
    found += [("temperature", _temperature(c))]
    return [(label, text) for label, text in found if text]


def grade(c: TriadCalibration) -> str:
    """Grade in words."""
    return "not graded" if c.quality is None else c.quality.grade


def mount_rows(mount: Mount) -> list[tuple[str, str]]:
    """Names and values of a mounting: how the unit's axes are turned from those of the body."""
    angles = to_deg(euler_zyx_from_quat(mount.q_bs))
    told = zip(("yaw", "pitch", "roll"), angles.tolist(), strict=True)
    rows = [("turned", ", ".join(f"{name} {angle:.3f}°" for name, angle in told))]
    if mount.sd is not None:
        sd = ", ".join(
            f"{axis} {number(to_deg(value), 2)}°" for axis, value in zip(AXES, mount.sd.tolist(), strict=True)
        )
        rows.append(("±", f"{sd}, about the body's axes"))
    return rows + [(label, text) for label, text in (("method", mount.method), ("date", mount.date)) if text]


def _matrix_rows(c: TriadCalibration) -> Iterator[list[str]]:
    if not c.matrix_found:
        yield ["matrix, scale, axes", *3 * ["not found"]]
        return
    for axis, row, sd in zip(AXES, c.matrix, _rows_of(c.matrix_sd), strict=True):
        yield [f"matrix, row {axis}", *_cells(row, sd)]


def _axis_rows(c: TriadCalibration) -> Iterator[list[str]]:
    if not c.matrix_found:
        return
    axes = sensing_axes(c)
    fine = bool((np.abs(axes.scale) < _PPM).all())
    unit = 1e6 if fine else 1e2
    sd = None if axes.scale_sd is None else unit * axes.scale_sd
    yield [f"scale error [{'ppm' if fine else '%'}]", *_cells(unit * axes.scale, sd)]
    yield ["axis misalignment [°]", *(number(value) for value in to_deg(axes.misalignment).tolist())]
    skew = to_deg(axes.skew).tolist()
    yield ["non-orthogonality [°]", *(f"{pair} {number(v)}" for pair, v in zip(("xy", "xz", "yz"), skew, strict=True))]


def _temperature_rows(name: str, c: TriadCalibration) -> Iterator[list[str]]:
    if not c.bias_per_k.any():
        return
    unit = SHOWN[name][0]
    for k, (row, sd) in enumerate(
        zip(c.bias_per_k, _rows_of(c.bias_per_k_sd, len(c.bias_per_k)), strict=True), start=1
    ):
        power = "" if k == 1 else "".join(_RAISED[int(digit)] for digit in str(k))
        cells = _cells(from_si(row, unit), _converted(sd, unit))
        yield [f"bias per K{power} [{written(unit)}/K{power}]", *cells]


def _coupling_rows(c: TriadCalibration) -> Iterator[list[str]]:
    if not c.g_sensitivity.any():
        return
    for axis, row, sd in zip(AXES, g(c.g_sensitivity), _rows_of(c.g_sensitivity_sd), strict=True):
        spread = None if sd is None else to_deg(g(sd))
        yield [f"g-sensitivity, row {axis} [°/s/g]", *_cells(to_deg(row), spread)]


def _residual(name: str, c: TriadCalibration, fit: Fitted | None) -> str:
    unit = SHOWN[name][0]
    left = c.residual_rms or 0.0
    told = [f"{_with(left, unit)} rms"] if left > _NOTHING else []  # one mean leaves nothing, however good it is
    found = None if fit is None else sizes(name, fit)
    if found is not None:
        before, after = found.rms()
        told.append(f"magnitude error {_with(before, unit)} rms before calibration, {_with(after, unit)} after")
    return "; ".join(told)


def _made_of(c: TriadCalibration) -> str:
    q = c.quality
    if q is None:
        return ""
    told = [counted(q.samples, "data point"), f"{counted(q.outliers, 'outlier')} set aside"]
    told += [] if q.regions is None else [f"{q.regions} of 18 directions"]
    return ", ".join(told + ([] if q.condition is None else [f"condition number {number(q.condition, 2)}"]))


def _predicted(c: TriadCalibration) -> str:
    """Errors of attitude and scale by the covariance of the parameters, as standard deviations."""
    q = c.quality
    if q is None:
        return ""
    angles = {"inclination": q.tilt_sd, "heading": q.heading_sd}
    within = "" if q.tilt_range is None else f" (tilt ≤ {to_deg(q.tilt_range):.0f}°)"
    errors = [f"{name} error{within}: {number(to_deg(sd), 2)}°" for name, sd in angles.items() if sd is not None]
    errors += [] if q.scale_sd is None else [f"scale error: {number(1e6 * q.scale_sd, 2)} ppm"]
    return "; ".join(errors)


def _reference(name: str, c: TriadCalibration) -> str:
    if c.reference is None:
        return ""
    return f"{_REFERENCE[name]} of {from_si(c.reference, SHOWN[name][-1]):.6g} {written(SHOWN[name][-1])}"


def _temperature(c: TriadCalibration) -> str:
    at = f"bias at {c.temp_ref_c:g} °C"
    if c.temp_span_c is None:
        return at if c.bias_per_k.any() else ""
    low, high = c.temp_span_c
    beyond = "; beyond, the bias is extrapolated along its tangent" if c.bias_per_k.any() else ""
    span = f"from {low:.1f} to {high:.1f} °C" if high > low else f"at {low:.1f} °C"
    return f"{at}, calibrated {span}{beyond}"


def _cells(values: Floats, sd: Floats | None) -> Sequence[str]:
    spread = np.zeros(3) if sd is None else sd
    return [_cell(v, s) for v, s in zip(values.tolist(), spread.tolist(), strict=True)]


def _cell(value: float, sd: float) -> str:
    return measured(value, value - sd, value + sd) if sd > 0.0 else f"{value + 0.0:.6g}"


def _rows_of(sd: Floats | None, count: int = 3) -> Sequence[Floats | None]:
    return [None] * count if sd is None else list(sd)


def _converted(values: Floats | None, unit: str) -> Floats | None:
    return None if values is None else from_si(values, unit)


def _with(value: float, unit: str) -> str:
    return f"{number(from_si(value, unit))} {written(unit)}"


_UNITS: Final = {**UNITS, "angles": "rad"}


def as_dict(card: CalibrationCard, fits: Mapping[str, Fitted]) -> dict[str, Any]:
    """Card, figures made of it and remarks, ready for JSON.

    Keys are `refused` (empty), `units`, `card`, `figures` and `remarks`, the last two by part of the card. Numbers of a
    triad are in the unit that `units` gives it, angles in that of `angles`; matrices and scales are relative. A figure
    that was not found is null.
    """
    told: dict[str, Any] = {"refused": [], "units": _UNITS, "card": json.loads(card.text())}
    figures = {name: _figures(name, getattr(card, name), fits.get(name)) for name in TRIADS if name in card.parts}
    if card.mount is not None:
        figures["mount"] = {"yaw_pitch_roll": euler_zyx_from_quat(card.mount.q_bs).tolist()}
    remarks = {name: list(part.remarks) for name, part in card.parts.items()}
    return told | {"figures": figures, "remarks": remarks}


def refusal_as_dict(refused: CaptureRefusedError) -> dict[str, Any]:
    """Reasons of a refusal, ready for JSON."""
    reasons = [asdict(reason) for reason in refused.reasons]
    return {"refused": reasons, "units": _UNITS, "card": None, "figures": {}, "remarks": {}}


def _figures(name: str, model: TriadCalibration, fit: Fitted | None) -> dict[str, Any]:
    axes = sensing_axes(model) if model.matrix_found else None
    found = None if fit is None else sizes(name, fit)
    before, after = (None, None) if found is None else found.rms()
    return {
        "bias_sd": _listed(model.bias_sd),
        "matrix_sd": _listed(model.matrix_sd if axes else None),
        "scale": _listed(axes and axes.scale),
        "scale_sd": _listed(axes and axes.scale_sd),
        "misalignment": _listed(axes and axes.misalignment),
        "skew_xy_xz_yz": _listed(axes and axes.skew),
        "size_expected": None if found is None else found.expected,
        "size_rms_before": before,
        "size_rms_after": after,
    }


def _listed(values: Floats | None) -> Any:
    return None if values is None else values.tolist()


def text(card: CalibrationCard, fits: Mapping[str, Fitted]) -> str:
    """Tell what a card holds, with units and standard deviations.

    Parameters
    ----------
    card : CalibrationCard
        The card.
    fits : mapping of str to Fitted
        By triad, the fits that it was just made of; may be empty.
    """
    made = f", by {card.software}" if card.software else ""
    lines = [f"{card.device}: calibration of {card.date}{made}", LEGEND, formula(card)]
    for name, title in TITLES.items():
        model: TriadCalibration | None = getattr(card, name)
        if model is not None:
            lines += ["", f"{title}: {grade(model).upper()}", *_triad(name, model, fits.get(name))]
    if card.mount is not None:
        lines += ["", "mounting of the unit on its body", *(pair(*row) for row in mount_rows(card.mount))]
        lines += listed(card.mount.remarks)
    return "\n".join(lines + _missing(card))


def refusal_text(refused: CaptureRefusedError) -> str:
    """Tell why a capture was refused, and what to do."""
    lines = [f"REFUSED, {refused.reasons[0].kind}; no card is made"]
    for reason in refused.reasons:
        lines += listed([f"{reason.kind}: {reason.text}"])
        lines += textwrap.wrap(reason.advice, WIDTH, initial_indent="  ", subsequent_indent="  ")
    return "\n".join(lines)


def _triad(name: str, model: TriadCalibration, fit: Fitted | None) -> list[str]:
    lines = aligned(["", *AXES], *table_rows(name, model))
    lines += [pair(*fact) for fact in facts(name, model, fit)]
    return lines + listed(model.remarks)


def _missing(card: CalibrationCard) -> list[str]:
    lacking = [title for name, title in TITLES.items() if name not in card.parts]
    return ["", f"NOT in this card, which leaves them uncalibrated: {', '.join(lacking)}"] if lacking else []
