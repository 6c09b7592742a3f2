"""What a certificate says of a triad: rows of its table and facts about it, as text with units."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import Fitted
from plumbob.core.check import Floats
from plumbob.core.text import counted, measured, number
from plumbob.core.units import from_si, g, to_deg, written
from plumbob.data.cards import CalibrationCard, Mount, TriadCalibration
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
UNITS = {"gyr": ("deg/s",), "acc": ("mg", "m/s2"), "mag": ("uT",)}
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
        [f"bias [{written(unit)}]", *_cells(from_si(c.bias, unit), _converted(c.bias_sd, unit))] for unit in UNITS[name]
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
    unit = UNITS[name][0]
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
    unit = UNITS[name][0]
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
    return f"{_REFERENCE[name]} of {from_si(c.reference, UNITS[name][-1]):.6g} {written(UNITS[name][-1])}"


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
