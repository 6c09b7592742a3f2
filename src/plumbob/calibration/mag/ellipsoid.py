"""Magnetometer from its own samples: hard iron, soft iron and scale, by the field's length and halves that agree.

The field has one strength; turned through all attitudes, the measured vectors lie on an ellipsoid whose centre is the
hard iron. The shape is chosen by test, outliers are set aside, and what the capture cannot determine is refused: its
covariance decides, its geometry explains. The length of a vector fixes no rotation, so the matrix is symmetric, the one
that turns the measured vectors least; `with_acc` finds the rotation too.

Of a vehicle that only turns level, an ellipse in two axes gives headings while level.
"""

import math
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from plumbob.calibration.autocorrelation import LONG, alike
from plumbob.calibration.ellipsoid_fit import (
    SPARE,
    Ellipsoid,
    NormFit,
    Shape,
    choose,
    fit_norm,
    linearised,
    mean_radius,
    scaled,
)
from plumbob.calibration.fit import HEADING, CaptureRefusedError, Fitted, Reason, refuse
from plumbob.calibration.mag import checks
from plumbob.calibration.mag.checks import FieldEstimate
from plumbob.calibration.mag.field_gradient import Unevenness, one_axis, unevenness
from plumbob.calibration.predicted import NAMES, TILT_RANGE, filled, heading_apart, heading_sd
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.findings import Note, info, warning
from plumbob.core.units import deg, to_deg

FEWEST: Final = 30  # fewest samples in which a change is looked for
_SOME_OF_ALL: Final = 4000

_PLACES: Final = np.linspace(0.05, 0.95, 37)
_EXPLAINED: Final = 0.5  # of the squares that the fit leaves
_SIZE: Final = 0.01  # of the field
_CHANCE: Final = 1e-6  # at each place, that noise alone explains so much


def moved(vectors: Floats, fit: NormFit) -> Reason | None:
    """Reason to refuse vectors (N, 3), in their order, whose centre jumps somewhere; None where it does not.

    At each of some places, the fit is allowed another centre from there on. That explains half of what one centre
    leaves, beyond chance and by more than 1 % of the field, only where there was a jump. The samples of the other field
    are outliers as a rule, and count all the same; but where there are few of them at the start, what they measured has
    passed, and with them set aside the rest is judged.
    """
    if len(vectors) < FEWEST:
        return None
    some = slice(None, None, max(1, len(vectors) // _SOME_OF_ALL))
    rows, residuals = linearised(vectors[some], fit.ellipsoid)
    radius = 3.0 / float(np.trace(fit.ellipsoid.shape))
    jump = _largest(rows, residuals, radius)
    if jump is not None and jump.place <= checks.MOST_OUTLIERS:
        rows, residuals = rows[fit.used[some]], residuals[fit.used[some]]
        jump = _largest(rows, residuals, radius)
    if jump is None:
        return None
    size = float(np.linalg.norm(jump.size))
    return Reason(
        "magnet-moved",
        f"after {100.0 * jump.place:.0f} % of the samples the centre of the field jumped by {size:.2g} µT, "
        f"{100.0 * size / radius:.0f} % of the field; that explains {100.0 * jump.explained:.0f} % of the misfit.",
        "Keep phones, tools, live cables and steel away from the unit, fix what moves on it, and capture again.",
    )


class _Jump(NamedTuple):
    """A jump of the centre: share of the misfit that it explains, where it is, and the jump (3,)."""

    explained: float
    place: float
    size: Floats


def _largest(rows: Floats, residuals: Floats, radius: float) -> _Jump | None:
    """Jump that explains the most of what is left (N,), None where it is chance, or too small."""
    from scipy.stats import f

    best = _Jump(0.0, 0.0, np.zeros(3))
    for place in _PLACES:
        jump = np.where(np.arange(len(residuals))[:, np.newaxis] >= place * len(residuals), rows[:, :3], 0.0)
        both = np.hstack((rows, jump))  # what a linear step with a jump leaves, against one without
        scale = np.maximum(np.linalg.norm(both, axis=0), 1e-12)
        normal, right = (both / scale).T @ (both / scale), (both / scale).T @ residuals
        count = rows.shape[1]
        without, step = (np.linalg.lstsq(normal[:n, :n], right[:n], rcond=1e-12)[0] for n in (count, len(right)))
        total = float(residuals @ residuals) - float(right[:count] @ without)
        gained = float(right @ step) - float(right[:count] @ without)
        if total > 0.0 and gained / total > best.explained:
            best = _Jump(gained / total, float(place), -(step / scale)[-3:])
    if best.explained < _EXPLAINED or np.linalg.norm(best.size) < _SIZE * radius:
        return None
    free = rows.shape[0] - rows.shape[1] - 3
    chance = float(f.sf(best.explained / 3.0 / ((1.0 - best.explained) / free), 3, free))
    return best if chance <= _CHANCE else None


PARTS: Final = (2, 3)

MOST_APART: Final = 2.0  # difference of parts over what they predict, root mean square, that chance makes as a rule
_SOME_OF_HALVES: Final = 20_000


class ReferenceField(NamedTuple):
    """Strength, in the unit of the calibrated vector, and dip of a field, rad, and the inclination that counts, rad."""

    size: float
    dip: float
    tilt_range: float


def widening(vectors: Floats, fit: NormFit, field: Unevenness, memory: float, place: ReferenceField) -> float:
    """Factor, at least 1, of a covariance by what the parts of a capture differ beyond their own predictions.

    `vectors` (N, 3), µT, are in order of time, `fit` that of the full shape to all; `memory` neighbouring samples count
    as one; headings are used at the `place`.
    """
    some = vectors[fit.used][:: max(1, len(vectors) // _SOME_OF_HALVES)]
    overall = scaled(fit, place.size, alike=1.0)[0], fit.ellipsoid.centre
    ratios = []
    for count in PARTS:
        if len(some) < count * LONG:
            break
        parts = [_part(piece, fit, field, memory, place) for piece in np.array_split(some, count)]
        for first, second in pairwise(parts):
            if first is not None and second is not None:
                off = heading_apart(first[0], second[0], overall, size=place.size, dip=place.dip)
                ratios.append(off / math.hypot(first[1], second[1]))
    worst = max(ratios, default=0.0)
    return max(1.0, (worst / MOST_APART) ** 2)


def _part(
    vectors: Floats, full: NormFit, field: Unevenness, memory: float, place: ReferenceField
) -> tuple[tuple[Floats, Floats], float] | None:
    """Calibration of a part, and the heading error that it predicts beside the other parts; None where it is lost.

    What no length shows is the same in all parts, and does not count between them.
    """
    fit = fit_norm(vectors, Shape.ELLIPSOID, full.ellipsoid, robust=False)
    if fit is None:
        return None
    patches = unevenness(fit.residuals, fit.ellipsoid.to_sphere(vectors), fit.used).patches
    wandering = field._replace(patches=patches).spread(fit.residuals)
    matrix, covariance = scaled(fit, place.size, alike=memory + wandering)
    sd = heading_sd(matrix, covariance, size=place.size, dip=place.dip, tilt_range=place.tilt_range)
    return ((matrix, fit.ellipsoid.centre), sd) if sd <= HEADING.poor else None


# Rms change of the field below which the unit was not turned, µT: a level field of 10 µT makes 7.
LEAST_CHANGE: Final = 5.0

_HARDLY: Final = 0.5  # root mean square change of the field over its mean; turned through all attitudes, it is large
_ADVICE: Final = "Turn the unit slowly through all attitudes: each face and each edge once up, as if it were a cube."
_MOVED: Final = "Look for switched currents, moving iron and steel nearby, or capture where the field is even."
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
    """Fit an ellipsoid to what a magnetometer measured in many attitudes, µT (N, 3), in order of time.

    Without a `shape`, the smallest that the capture does not contradict; without the `strength` of the field, the
    sensor's own scale is kept on average. The specific force (N, 3) at the same instants, NaN where there is none,
    shows the dip, and how the unit was turned; dip and `tilt_range`, rad, are those that the predicted heading error
    holds for. Samples are finite.
    """
    if shape is not None and not isinstance(shape, Shape):
        shapes = ", ".join(str(each) for each in Shape)
        raise ParameterError(f"shape must be one of {shapes}, or None to have it chosen, but it is {shape!r}.")
    checks.require_figures(strength=strength, dip=dip, tilt_range=tilt_range)
    mag = checks.finite_rows("mag", mag)
    acc = np.full_like(mag, np.nan) if acc is None else check.rows("acc", acc, 3, len(mag))
    least = (shape or Shape.ELLIPSOID).value + SPARE
    if len(mag) < least:
        refuse(Reason("too-few", f"{len(mag)} samples, but this shape needs {least} at least.", _ADVICE))
    refuse(unturned(mag, _ADVICE) or one_axis(mag, acc))
    if (choice := choose(mag, shape)) is None:
        raise CaptureRefusedError(_shapeless(mag))
    fit, full, why = choice
    radius = mean_radius(fit.ellipsoid.shape)
    size = strength or radius
    if dip is None and (dip := checks.dip_angle(fit.ellipsoid.to_sphere(mag)[fit.used], acc[fit.used])) is None:
        dip = checks.DIP
    directions, place = full.ellipsoid.to_sphere(mag), ReferenceField(size, dip, tilt_range)
    shared = alike(full.residuals, directions, full.used)
    field = unevenness(full.residuals, directions, full.used)
    matrix, _ = scaled(fit, strength, alike=1.0)
    _, independent = scaled(full, strength, alike=1.0)  # what is too small to show may be there all the same
    residuals = full.residuals[full.used]
    covariance = field.counted(independent, memory=shared.memory, residuals=residuals, matrix=matrix, radius=radius)
    covariance = covariance * widening(mag, full, field, shared.memory, place)
    larger = fit.shape is not Shape.ELLIPSOID and why != "asked for"
    estimate = FieldEstimate(
        matrix, fit.ellipsoid.centre, covariance, independent * shared.memory, fit.residuals, fit.used, radius,
        fit.condition, strength, dip, tilt_range, field, shared,
    )  # fmt: skip
    return estimate.finished(
        mag,
        method=f"magnetometer alone: {_WORDS[fit.shape]}",
        advice=_ADVICE,
        reasons=(moved(mag, fit), checks.outliers(fit.used, _MOVED)),
        remarks=(
            info("calibration.shape", shape=_WORDS[fit.shape], why=why),
            *((info("calibration.general_ellipsoid"),) if larger else ()),
            info("calibration.field_length"),
        ),
        alone=True,
    )


def unturned(mag: Floats, advice: str) -> Reason | None:
    """Reason to refuse a capture whose field (N, 3), µT, hardly changed, with what to do; None where it did.

    A weak field, of whatever scale, by as large a share of it.
    """
    change = math.sqrt(float(np.sum(np.var(mag, axis=0))))
    share = min(1.0, math.sqrt(float(np.mean(np.sum(mag * mag, axis=1)))) / checks.WEAKEST)
    what = f"the measured field only changed by {change:.2g} µT."
    return None if change > LEAST_CHANGE * share else Reason("no-motion", what, advice)


def _shapeless(mag: Floats) -> Reason:
    """Reason to refuse a capture that no ellipsoid fits."""
    directions = mag - mag.mean(axis=0)
    if filled(directions).all():
        change, mean = (float(np.linalg.norm(of)) for of in (mag.std(axis=0), mag.mean(axis=0)))
        if change < _HARDLY * mean:
            what = f"no ellipsoid fits; the field changed by {change:.2g} µT about a mean of {mean:.2g} µT"
            return Reason("too-few-regions", f"{what}, as if the unit was hardly turned.", _ADVICE)
        what = f"no ellipsoid fits, although all {len(NAMES)} directions were seen: the field itself changed."
        return Reason("uneven-field", what, f"{checks.STEEL} {checks.EVEN}")
    return Reason("too-few-regions", f"no ellipsoid fits; {checks.regions_seen(directions)}.", _ADVICE)


WIDEST_GAP: Final = deg(90.0)  # largest gap between the headings that were seen, rad
LEANING: Final = deg(10.0)  # inclination above which a unit is not level, rad
_FEWEST: Final = 4 * Shape.ELLIPSE.value
_THICKEST: Final = 0.1  # scatter over radius
_LEVEL_GROUND: Final = "Stay on level ground, or use a fit of all three axes."
_DRIVE: Final = "Drive a full circle or more on level ground, away from iron."


def fit_ellipse(points: Floats) -> NormFit | None:
    """Fit an ellipse to more than five finite points (N, 2); None where none comes out."""
    middle, size = points.mean(axis=0), math.sqrt(float(np.sum(np.var(points, axis=0))))
    if not size > 0.0:
        return None
    start = Ellipsoid(np.append(middle, 0.0), np.eye(3) / size)
    fit = fit_norm(np.insert(points, 2, 0.0, axis=1), Shape.ELLIPSE, start)
    if fit is not None:
        fit.ellipsoid.shape[2, 2] = 1.0  # the upright axis stays as measured
    return fit


def fit_mag_level(
    mag: Floats, *, acc: Floats | None = None, strength: float | None = None, dip: float | None = None
) -> Fitted:
    """Fit an ellipse to the two level axes; the third stays as measured.

    The specific force shows which axis is upright, else the one along which the field changed least, and whether the
    unit was level. `strength`, µT, and `dip`, rad, together give the level field; without them, the sensor's own scale
    is kept.
    """
    checks.require_figures(strength=strength, dip=dip)
    mag = checks.finite_rows("mag", mag)
    acc = np.full_like(mag, np.nan) if acc is None else check.rows("acc", acc, 3, len(mag))
    if len(mag) < _FEWEST:
        refuse(Reason("too-few", f"{len(mag)} samples, but {_FEWEST} are needed.", _DRIVE))
    axis = _upright(mag, acc)
    order = [*(i for i in range(3) if i != axis), axis]
    points = mag[:, order[:2]]
    fit = fit_ellipse(points)
    if fit is None:
        raise CaptureRefusedError(Reason("too-few-regions", "no ellipse fits the field of the level axes.", _DRIVE))
    shape, wanted = fit.ellipsoid.shape, None if strength is None or dip is None else strength * math.cos(dip)
    radius = mean_radius(shape, axes=2)
    shared = alike(fit.residuals, (points - fit.ellipsoid.centre[:2]) @ shape[:2, :2], fit.used)
    matrix, independent = scaled(fit, wanted, alike=1.0)
    back = np.argsort(order)
    rows = np.concatenate((back, 3 + (3 * back[:, np.newaxis] + back).ravel()))
    covariance = independent[np.ix_(rows, rows)]
    estimate = FieldEstimate(
        matrix[np.ix_(back, back)], fit.ellipsoid.centre[back], shared.factor * covariance, shared.memory * covariance,
        fit.residuals, fit.used, radius, fit.condition, wanted, 0.0, 0.0, Unevenness(), shared,
        tuple(order[:2]),
    )  # fmt: skip
    axes = " and ".join("xyz"[i] for i in order[:2])
    return estimate.finished(
        mag,
        method=f"magnetometer level only: ellipse of {axes}, {fit.shape.value} parameters",
        advice=_DRIVE,
        reasons=_reasons(fit, points, radius),
        remarks=_level_remarks(axis, radius, wanted),
    )


def _upright(mag: Floats, acc: Floats) -> int:
    """Axis that stood upright, by the rows of a specific force (N, 3) that are finite, else by the field (N, 3)."""
    acc = acc[np.isfinite(acc).all(axis=1) & acc.any(axis=1)]
    if not len(acc):
        return int(np.argmin(mag.std(axis=0)))
    mean = acc.mean(axis=0)
    axis = int(np.argmax(np.abs(mean)))
    lean = math.acos(min(1.0, abs(float(mean[axis])) / float(np.linalg.norm(mean))))
    along = np.median(np.abs(acc[:, axis]) / np.linalg.norm(acc, axis=1))
    worst = max(lean, math.acos(min(1.0, float(along))))
    if worst > LEANING:
        what = f"the unit leaned by {to_deg(worst):.0f}° from its {'xyz'[axis]} axis upright; 10° may be."
        refuse(Reason("not-level", what, _LEVEL_GROUND))
    return axis


def _reasons(fit: NormFit, points: Floats, radius: float) -> tuple[Reason | None, ...]:
    x, y = ((points[fit.used] - fit.ellipsoid.centre[:2]) @ fit.ellipsoid.shape[:2, :2]).T
    course = np.sort(np.arctan2(y, x))
    gap = float(np.diff(course, append=course[0] + 2.0 * np.pi).max())
    open_ = f"headings cover {360.0 - to_deg(gap):.0f}°; 270° are needed."
    scatter = float(np.sqrt(np.mean(fit.residuals[fit.used] ** 2))) / radius
    thick = f"the field of the level axes scatters by {100.0 * scatter:.0f} % of its size about the ellipse."
    return (
        None if gap <= WIDEST_GAP else Reason("too-few-regions", open_, _DRIVE),
        None if scatter <= _THICKEST else Reason("not-level", thick, _LEVEL_GROUND),
        checks.outliers(fit.used, checks.STEEL),
    )


def _level_remarks(axis: int, radius: float, wanted: float | None) -> tuple[Note, ...]:
    scale = () if wanted is not None else (info("calibration.level_field", radius=radius),)
    only = warning("calibration.only_level", axis="xyz"[axis], per_degree=to_deg(10.0 * deg(1.0) / radius))
    return (only, info("calibration.upright_turn"), *scale)
