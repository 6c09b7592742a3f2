"""Magnetometer from its own samples: hard iron, soft iron and scale, by the length of the field.

The field has one strength; turned through all attitudes, the measured vectors lie on an ellipsoid whose centre is the
hard iron. The shape is chosen by test, outliers are set aside, and what the capture cannot determine is refused: its
covariance decides, its geometry explains. The length of a vector tells no rotation, so the matrix is symmetric, the one
that turns the measured vectors least; `mag_acc` finds the rotation too.
"""

import math
from typing import Final

import numpy as np

from plumbob.calib.ellipsoid.norm_fit import NormFit, Shape
from plumbob.calib.ellipsoid.shape_choice import SPARE, choose, fit_shape
from plumbob.calib.fitted import Fitted
from plumbob.calib.grades import HEADING, grade_of
from plumbob.calib.mag.moved import moved
from plumbob.calib.mag.plausible import unequal, wrong_field
from plumbob.calib.mag.spread import one_axis
from plumbob.calib.predicted import TILT_RANGE, heading_sd
from plumbob.calib.refusal import CaptureRefusedError, Reason, refuse
from plumbob.calib.regions import NAMES, filled, names_of
from plumbob.cards import UNITS, Quality, TriadCalibration
from plumbob.check import Floats
from plumbob.units import deg, to_deg

DIP: Final = deg(60.0)
"""Dip that is assumed for the predicted heading error where nothing tells it, rad: that of Central Europe."""

MOST_OUTLIERS: Final = 0.1
"""Share of outliers above which a capture is refused."""

LEAST_CHANGE: Final = 5.0
"""Root mean square change of the field below which the unit was not turned, µT: a level field of 10 µT makes 7."""

_ADVICE: Final = "Turn the unit slowly through all attitudes: each face and each edge once up, as if it were a cube."
_LONG: Final = 100
_WORDS: Final = {
    Shape.SPHERE: "sphere, 4 parameters",
    Shape.AXES: "axis-aligned ellipsoid, 6 parameters",
    Shape.ELLIPSOID: "general ellipsoid, 9 parameters",
}


def fit_mag(
    mag: Floats,
    *,
    shape: Shape | None = None,
    strength: float | None = None,
    acc: Floats | None = None,
    dip: float | None = None,
    tilt_range: float = TILT_RANGE,
) -> Fitted:
    """Fit an ellipsoid to what a magnetometer measured in many attitudes.

    Parameters
    ----------
    mag : ndarray (N, 3)
        Measured field, µT, in order of time; finite.
    shape : Shape, optional
        What to fit; without it, the smallest shape that the capture does not contradict.
    strength : float, optional
        Strength of the field at the place, µT; without it, the sensor's own scale is kept on average.
    acc : ndarray (N, 3), optional
        Specific force at the same instants, m/s²: it tells the dip, and how the unit was turned.
    dip : float, optional
        Dip of the field, rad, for the predicted heading error.
    tilt_range : float
        Inclination up to which the predicted heading error holds, rad.

    Raises
    ------
    CaptureRefusedError
        If the capture cannot determine the calibration, with the reasons.
    """
    least = (shape or Shape.ELLIPSOID).value + SPARE
    if len(mag) < least:
        refuse([_too_few(len(mag), least)])
    if (ring := one_axis(mag, acc)) is not None:
        refuse([ring])
    fit, full, why = _fitted(mag, shape)
    size = strength or _radius(fit)
    dip = _dip(mag, fit, acc) if dip is None else dip
    sd, full_sd = (
        heading_sd(*scaled(each, strength), size=size, dip=dip, tilt_range=tilt_range) for each in (fit, full)
    )
    _check(mag, fit, full_sd, strength)
    matrix, covariance = scaled(fit, strength)
    calibration = TriadCalibration(
        matrix=matrix,
        bias=fit.ellipsoid.centre,
        unit_in=UNITS["mag"],
        unit_out=UNITS["mag"],
        residual_rms=float(np.sqrt(np.mean(fit.residuals[fit.used] ** 2))) * size / _radius(fit),
        covariance=covariance,
        reference=strength,
        method=f"magnetometer alone: {_WORDS[fit.shape]}",
        quality=Quality(
            grade=grade_of(max(sd, full_sd), HEADING) or "poor",
            samples=int(np.count_nonzero(fit.used)),
            outliers=int(np.count_nonzero(~fit.used)),
            regions=int(np.count_nonzero(filled((mag - fit.ellipsoid.centre)[fit.used]))),
            condition=fit.condition,
            heading_sd=sd,
            tilt_range=tilt_range,
        ),
    )
    return Fitted(calibration, mag, fit.residuals, fit.used, _remarks(fit, why, strength, size, full_sd))


def scaled(fit: NormFit, strength: float | None) -> tuple[Floats, Floats]:
    """Matrix (3, 3) of a calibration and covariance (12, 12) of bias and matrix, row by row, from a fit to length 1.

    Parameters
    ----------
    fit : NormFit
        The fit. Its covariance is widened by the memory of its residuals, for neighbouring samples err alike.
    strength : float or None
        Length of the calibrated vector; where None, the matrix gets the determinant 1, and so keeps the sensor's scale.
    """
    shape = fit.ellipsoid.shape
    size = strength or _radius(fit)
    by_shape = np.zeros((9, 6))  # derivatives of the matrix, row by row, by xx, yy, zz, xy, xz, yz
    for column, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
        change = np.zeros((3, 3))
        change[i, j] = change[j, i] = 1.0
        kept = 0.0 if strength else np.trace(np.linalg.solve(shape, change)) / 3.0
        by_shape[:, column] = (size * (change - kept * shape)).ravel()
    whole = np.zeros((12, 9))
    whole[:3, :3], whole[3:, 3:] = np.eye(3), by_shape
    return size * shape, whole @ (fit.covariance * memory(fit.residuals[fit.used])) @ whole.T


def memory(residuals: Floats) -> float:
    """How many neighbouring residuals (N,) count as one: (1 + ρ)/(1 − ρ) of a first-order process, at least 1."""
    if len(residuals) < _LONG:
        return 1.0
    left = residuals - residuals.mean()
    power = float(left @ left)
    rho = float(left[1:] @ left[:-1]) / power if power > 0.0 else 0.0
    return (1.0 + rho) / max(1.0 - rho, 1e-3) if rho > 3.0 / math.sqrt(len(left)) else 1.0


def unturned(mag: Floats, advice: str) -> Reason | None:
    """Reason to refuse a capture whose field (N, 3), µT, hardly changed, with what to do; None where it did."""
    change = math.sqrt(float(np.sum(np.var(mag, axis=0))))
    if change >= LEAST_CHANGE:
        return None
    return Reason("no-motion", f"the measured field only changed by {change:.2g} µT.", advice)


def _fitted(mag: Floats, shape: Shape | None) -> tuple[NormFit, NormFit, str]:
    """Fit, the full shape that it was held against, and why it was chosen."""
    chosen = choose(mag) if shape is None else None
    if chosen is not None:
        return chosen
    fit = None if shape is None else fit_shape(mag, shape)
    if fit is None:
        reason = f"no ellipsoid fits; {_regions_told(mag - mag.mean(axis=0))}"
        raise CaptureRefusedError(unturned(mag, _ADVICE) or Reason("too-few-regions", f"{reason}.", _ADVICE))
    return fit, fit, "asked for"


def _check(mag: Floats, fit: NormFit, full_sd: float, strength: float | None) -> None:
    """Refuse a fit that says nothing, or something that cannot be."""
    shape = fit.ellipsoid.shape
    found = (
        moved(mag, fit),
        _outliers(fit),
        _coverage(mag, fit, full_sd),
        unequal(shape),
        wrong_field(_radius(fit), strength),
    )
    refuse([reason for reason in found if reason is not None])


def _too_few(count: int, least: int) -> Reason:
    return Reason("too-few", f"{count} samples, but this shape needs {least} at least.", _ADVICE)


def _outliers(fit: NormFit) -> Reason | None:
    share = float(np.mean(~fit.used))
    if share <= MOST_OUTLIERS:
        return None
    return Reason(
        "outliers",
        f"{100.0 * share:.0f} % of the samples do not fit the others; {100.0 * MOST_OUTLIERS:.0f} % may.",
        "Look for switched currents, moving iron and steel nearby, or capture where the field is even.",
    )


def _coverage(mag: Floats, fit: NormFit, full_sd: float) -> Reason | None:
    if full_sd <= HEADING.poor:
        return None
    told = _regions_told((mag - fit.ellipsoid.centre)[fit.used])
    return Reason(
        "too-few-regions",
        f"the capture leaves a heading error of {to_deg(full_sd):.2g}° (1 sd); {told}.",
        _ADVICE,
    )


def _regions_told(directions: Floats) -> str:
    seen = filled(directions)
    empty = [i for i, count in enumerate(seen.tolist()) if count == 0]
    told = f"{len(NAMES) - len(empty)} of {len(NAMES)} directions were seen"
    return f"{told}, missing {names_of(empty)}" if empty else told


def _radius(fit: NormFit) -> float:
    """Strength of the field in the sensor's own scale, µT."""
    return float(1.0 / np.cbrt(np.linalg.det(fit.ellipsoid.shape)))


def _dip(mag: Floats, fit: NormFit, acc: Floats | None) -> float:
    """Dip of the field, rad, by the specific force, which points up; an assumed one without it."""
    if acc is None:
        return DIP
    field = (mag - fit.ellipsoid.centre) @ fit.ellipsoid.shape
    down = -np.sum(field * acc, axis=1) / np.linalg.norm(field, axis=1) / np.linalg.norm(acc, axis=1)
    return float(np.arcsin(np.clip(np.median(down[fit.used]), -1.0, 1.0)))


def _remarks(fit: NormFit, why: str, strength: float | None, size: float, full_sd: float) -> tuple[str, ...]:
    told = [f"Shape: {_WORDS[fit.shape]} ({why})."]
    if fit.shape is not Shape.ELLIPSOID and why != "asked for":
        told.append(f"Soft iron across the axes too small to show would leave {to_deg(full_sd):.2g}° of heading.")
    if strength is None:
        told.append(f"Field strength: {size:.4g} µT, the sensor's own scale; only the directions are calibrated.")
    told.append("A turn of the magnetometer in its case is not seen by its length alone; that needs the accelerometer.")
    if (count := int(np.count_nonzero(~fit.used))) > 0:
        told.append(f"{count} of {len(fit.used)} samples were set aside as outliers.")
    return tuple(told)
