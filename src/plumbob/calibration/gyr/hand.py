"""Scale and misalignment of a gyroscope by hand, against the accelerometer at rest before and after [Tedaldi2014].

Where the unit came to rest, the accelerometer measures the direction of gravity. Turned back by what the gyroscope
integrated during the motion, it must be the direction before. All nine entries of the matrix follow, relative to the
axes of the accelerometer, so both triads share their axes afterwards. Heading plays no part: a turn about the vertical
says nothing, so the unit has to be turned over in every way.

Departures from [Tedaldi2014]: the integration is exact on SO(3) instead of Runge-Kutta of the fourth order; its
derivative is formed along with it, so that a few steps of Gauss and Newton suffice; the bias takes part with what the
rest says about it; the axes are all the accelerometer's, none is fixed to the gyroscope's own.

At rest the rate is the bias plus G times gravity, so poses of all directions tell the sensitivity G to specific force,
and it costs no table. Gravity is the only force there is at rest, and the vertical part of the Earth's rotation goes
with it: up to 0.0042 °/s per g on the diagonal.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import RATE, SCALE, Fitted, Reason, grade_of, invert, refuse, worst_grade
from plumbob.calibration.gyr.drift import accumulate, rotation_vectors
from plumbob.calibration.gyr.rest import Rates, beyond_bias, bias_at_rest, dead_axes, rest, without_known
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import counted, p_value
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.data.cards import Quality, TriadCalibration
from plumbob.rotations import axes_words, dcm_from_quat, every_axes, skew

SMALLEST: Final = float(deg(15.0))  # smallest change of the direction of gravity that makes a motion, rad


@dataclass(frozen=True, eq=False, slots=True)
class TurnBetweenPoses:
    """One motion between two poses."""

    rate: Floats  # (N, 3), measured rates from the last instant at rest to the next first one, rad/s
    dt: Floats  # (N−1,), steps, s
    # before, after: (3,), directions of the specific force at rest, unit vectors
    before: Floats
    after: Floats


def find_motions(
    t: Floats, gyr: Floats, acc: Floats, where: Sequence[slice], clipped: NDArray[np.bool_] | None = None
) -> tuple[list[TurnBetweenPoses], dict[str, int]]:
    """Motions between stretches at rest that tilted the unit, and how many were left out, by reason."""
    motions, spoilt = [], {"clipping": 0, "gap": 0}
    for first, second in pairwise(where):
        before, after = _direction(acc[first]), _direction(acc[second])
        if float(before @ after) > np.cos(SMALLEST):
            continue
        span = slice(first.stop - 1, second.start + 1)
        if why := spoiling(t, gyr, span, clipped):
            spoilt[why] += 1
        else:
            motions.append(TurnBetweenPoses(gyr[span], np.diff(t[span]), before, after))
    return motions, spoilt


def spoiling(t: Floats, gyr: Floats, span: slice, clipped: NDArray[np.bool_] | None) -> str:
    """Why rates of a span cannot be integrated: "clipping", "gap" or nothing."""
    if clipped is not None and clipped[span].any():
        return "clipping"
    gap = np.diff(t[span]).max() > 1.5 * float(np.median(np.diff(t)))
    return "gap" if gap or not np.isfinite(gyr[span]).all() else ""


def _direction(acc: Floats) -> Floats:
    mean = acc.mean(axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


FEWEST: Final = 9  # fewest motions: each gives two equations, and some must be left to show what they are worth
FAR: Final = 5.0  # robust standard deviations above which a motion is an outlier
_STEPS: Final = 8


@dataclass(frozen=True, eq=False, slots=True)
class MotionFit:
    """Fit of the motions."""

    # matrix, bias: (3, 3), of the gyroscope: ``rate = matrix @ (measured − bias)``, rad/s
    matrix: Floats
    bias: Floats
    covariance: Floats  # (12, 12), of bias and matrix, row by row
    residuals: Floats  # (m, 3), measured less predicted direction of gravity after each motion, of unit vectors
    used: NDArray[np.bool_]  # (m,), false for outliers
    condition: float  # of the normal matrix of the matrix' entries, scaled to a diagonal of one

    @property
    def bias_sd(self) -> Floats:
        """Standard deviations (3,) of the bias, rad/s."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:3]))

    @property
    def matrix_sd(self) -> Floats:
        """Standard deviations (3, 3) of the matrix."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[3:]).reshape(3, 3))


def fit_motions(motions: Sequence[TurnBetweenPoses], rest_bias: Floats, rest_sd: Floats) -> MotionFit:
    """Least squares over bias and matrix by `FEWEST` motions or more, with outliers set aside once.

    The bias at rest (3,) with its standard deviation, rad/s, is one more measurement.
    """
    used = np.ones(len(motions), dtype=bool)
    fit = _least_squares(motions, rest_bias, rest_sd, used)
    size = np.linalg.norm(fit.residuals, axis=1)
    far = FAR * 1.4826 * float(np.median(size))
    if (size > far).any() and np.count_nonzero(size <= far) >= FEWEST:
        fit = _least_squares(motions, rest_bias, rest_sd, size <= far)
    return fit


def _least_squares(
    motions: Sequence[TurnBetweenPoses], rest_bias: Floats, rest_sd: Floats, used: NDArray[np.bool_]
) -> MotionFit:
    """Gauss and Newton, in which the bias at rest is one more measurement of the bias."""
    parameters = np.concatenate((rest_bias, np.eye(3).ravel()))
    weight = np.zeros((12, 12))
    free = 2.0 * np.count_nonzero(used) - 9.0  # a unit vector has two components
    floor = np.finfo(np.float64).eps
    for step in range(_STEPS):
        residuals, slope = _misses(motions, parameters)
        noise = max(float(np.sum(residuals[used] ** 2)) / free, floor)
        held = noise / np.maximum(rest_sd, floor) ** 2
        # Before the first step the misses are those of an uncalibrated unit and say nothing of the noise.
        weight[:3, :3] = np.diag(held if step else np.full(3, 1.0 / floor))
        rows, misses = slope[used].reshape(-1, 12), residuals[used].ravel()
        normal = rows.T @ rows + weight  # departs from [Tedaldi2014]: the bias at rest is one more measurement
        away = np.concatenate((rest_bias - parameters[:3], np.zeros(9)))
        inverse, _ = invert(normal)  # bias and matrix, whose sizes differ by many powers of ten, count alike
        parameters = parameters + inverse @ (rows.T @ misses + weight @ away)
    residuals, _ = _misses(motions, parameters)
    matrix = rows[:, 3:].T @ rows[:, 3:]
    scale = np.sqrt(np.maximum(np.diag(matrix), floor))
    condition = float(np.linalg.cond(matrix / np.outer(scale, scale)))
    return MotionFit(parameters[3:].reshape(3, 3), parameters[:3], noise * inverse, residuals, used, condition)


def _misses(motions: Sequence[TurnBetweenPoses], parameters: Floats) -> tuple[Floats, Floats]:
    """Measured less predicted direction after each motion (m, 3), and the prediction's derivative (m, 3, 12)."""
    bias, matrix = parameters[:3], parameters[3:].reshape(3, 3)
    each = [_predicted(motion, bias, matrix) for motion in motions]
    # [Tedaldi2014]
    residuals = np.array([motion.after - after for motion, (after, _) in zip(motions, each, strict=True)])
    return residuals, np.array([slope for _, slope in each])


def _predicted(motion: TurnBetweenPoses, bias: Floats, matrix: Floats) -> tuple[Floats, Floats]:
    """Direction after a motion (3,), and its derivative by bias and matrix (3, 12).

    With R from the axes now to those before, after = Rᵀ before, which a turn of R by δθ in the axes before changes by
    Rᵀ (before × δθ).
    """
    turn, slope = turn_by_rates(motion.rate, motion.dt, bias, matrix)
    return turn.T @ motion.before, turn.T @ skew(motion.before) @ slope


def turn_by_rates(rate: Floats, dt: Floats, bias: Floats, matrix: Floats) -> tuple[Floats, Floats]:
    """Turn of rates (N, 3) in steps (N−1,): from the axes after to those before, (3, 3), and how it leans (3, 12).

    A change δω of the rates turns R by δθ = ∫ R δω dt in the axes before; `slope` is δθ by bias and matrix.
    """
    open_rate = rate - bias
    quat = np.empty((len(open_rate), 4))
    accumulate(rotation_vectors(open_rate @ matrix.T, dt), quat)  # departs from [Tedaldi2014]: exact on SO(3)
    turned = dcm_from_quat(quat)
    share = np.append(0.5 * dt, 0.0) + np.append(0.0, 0.5 * dt)  # the trapezoidal rule
    by_matrix = np.einsum("kai,kj,k->aij", turned, open_rate, share, optimize=True).reshape(3, 9)
    by_bias = -np.einsum("kai,k->ai", turned, share) @ matrix
    return turned[-1], np.hstack((by_bias, by_matrix))


def typical_miss(motions: Sequence[TurnBetweenPoses], bias: Floats, matrix: Floats) -> float:
    """Median angle, rad, by which gravity comes out wrong after a motion."""
    residuals, _ = _misses(motions, np.concatenate((bias, matrix.ravel())))
    return float(np.median(np.linalg.norm(residuals, axis=1)))


FEWEST_RATES: Final = 12  # fewest poses: each axis has four parameters, and what they leave must tell noise
SIGNIFICANCE: Final = 0.01  # probability of finding a sensitivity where there is none
_NARROW: Final = 30.0  # condition number of constant and directions; poses of all kinds have 2 to 4


class Coupling(NamedTuple):
    """G (3, 3), rad/s per m/s², its standard deviations (3, 3), and the chance that noise made it."""

    matrix: Floats
    sd: Floats
    chance: float


def coupling_at_rest(rates: Floats, forces: Floats) -> Coupling | None:
    """G of mean rates (K, 3), rad/s, and calibrated forces (K, 3), m/s², of poses; None where they do not show it."""
    from scipy.special import fdtrc

    if len(rates) < FEWEST_RATES:
        return None
    size = float(np.linalg.norm(forces, axis=1).mean())
    rows = np.column_stack((np.ones(len(forces)), forces / size))
    if np.linalg.cond(rows) > _NARROW:
        return None
    solution, *_ = np.linalg.lstsq(rows, rates, rcond=None)
    freedom = len(rates) - 4
    squares = np.sum((rates - rows @ solution) ** 2)
    gained = np.sum((rates - rates.mean(axis=0)) ** 2) - squares
    chance = float(fdtrc(9.0, 3.0 * freedom, gained / 9.0 / max(squares / (3.0 * freedom), 1e-300)))
    if chance >= SIGNIFICANCE:
        return None
    noise = np.sum((rates - rows @ solution) ** 2, axis=0) / freedom
    spread = np.sqrt(np.outer(noise, np.diag(np.linalg.inv(rows.T @ rows))[1:]))
    return Coupling(np.asarray(solution[1:].T / size, dtype=np.float64), np.asarray(spread / size), chance)


FAST: Final = float(dps(50.0))  # rate above which a flat top is a range, rad/s: slower, coarse steps repeat themselves

# Equal values in a row that make a flat top; of a sensor slower than the recording, that many of its own.
FLAT: Final = 4


def flat_tops(gyr: Floats, where: Sequence[slice]) -> NDArray[np.bool_]:
    """Samples of measured rates (N, 3), rad/s, in a flat top of a motion between stretches at rest, (N,)."""
    marks = np.zeros(len(gyr), dtype=np.bool_)
    for first, second in pairwise(where):
        for column in gyr[first.stop : second.start].T:
            marks[first.stop : second.start] |= _flat_top(column)
    return marks


def _flat_top(rate: Floats) -> NDArray[np.bool_]:
    """Where the rate about one axis (n,) repeats its extreme."""
    starts = np.flatnonzero(np.concatenate(([True], rate[1:] != rate[:-1])))[: rate.size]
    lasting = np.diff(np.append(starts, rate.size))
    if not rate.size or not np.isfinite(rate).any():
        return np.zeros(rate.size, dtype=np.bool_)
    value = rate[starts]
    extreme = (value == np.nanmax(rate)) | (value == np.nanmin(rate))
    flat = extreme & (np.abs(value) > FAST) & (lasting >= FLAT * np.median(lasting))
    return np.repeat(flat, lasting)


CLEARLY: Final = 0.5  # misses over those of the declared axes below which other axes are the right ones


def swapped(miss: Callable[[Floats], float]) -> Reason | None:
    """Reason to refuse a gyroscope that fits the accelerometer with other axes than the declared ones.

    `miss` gives the typical miss of a matrix (3, 3) from rates to those about the accelerometer's axes.
    """
    ways = every_axes()
    misses = np.array([miss(way) for way in ways])
    best = int(np.argmin(misses))
    text = (
        f"Gyroscope and accelerometer have different axes: gravity follows the rates taken as {axes_words(ways[best])} "
        "instead of x, y, z."
    )
    clear = bool(misses[best] < CLEARLY * misses[0])  # the first is the identity
    return Reason("implausible", text, "Check axes and signs of both triads in the profile.") if clear else None


# Condition, scaled, above which entries are not told apart; 20 motions about random axes have 3 to 10.
UNTOLD: Final = 1e4

SHORTEST: Final = 20  # fewest samples between rests that show a dead axis: coarse steps repeat in a few
STRANGE: Final = 0.3  # difference of the matrix from the identity beyond that of any gyroscope that works
_EVERY = 0.99  # of the samples must have a specific force, for a card of g-sensitivity takes the rate of others away
_WRONG_GRAVITY = 0.05
_ADVICE = (
    "Let the unit lie for 30 s, then turn it by a quarter or half a turn, about another axis each time, and put it "
    "down for 2 s each time: 20 poses or more, all six faces among them."
)


def fit_hand(rates: Rates) -> Fitted:
    """Bias and matrix of a gyroscope from hand motion; errors of the specific force's scale and axes become its own.

    A motion with a clipped sample is left out, and so is one whose rates have a flat top that no range declares. Of the
    calibration so far the polynomial is kept, and the g-sensitivity where it has one; else the poses tell it, where the
    accelerometer is calibrated.
    """
    if rates.acc is None:
        raise CalibrationError("hand motion calibrates a gyroscope against the accelerometer, and there is no acc.")
    t, clipped, base, acc_calibrated = rates.t, rates.clipped, rates.known, rates.acc_calibrated
    gyr, force = check.rows("gyr", rates.gyr, 3, t.size), check.rows("acc", rates.acc, 3, t.size)
    rates = rates._replace(gyr=gyr, acc=force)
    where, notes = rest(rates)
    corrected = without_known(rates)
    coupling = _coupling(corrected, force, where, base) if acc_calibrated else None
    if coupling is not None:
        corrected = corrected - force @ coupling.matrix.T
        base = replace(base, g_sensitivity=coupling.matrix, g_sensitivity_sd=coupling.sd)
    bias, spread, _ = bias_at_rest([corrected[part] for part in where])
    refuse(beyond_bias(bias))
    between = [gyr[first.stop : second.start] for first, second in pairwise(where)]
    refuse(dead_axes(*(rate for rate in between if len(rate) >= SHORTEST)))
    flat = flat_tops(gyr, where)
    motions, spoilt = find_motions(t, corrected, force, where, flat if clipped is None else flat | clipped)
    refuse(*_unfit(motions, spoilt, force, where))
    fit = fit_motions(motions, bias, spread)
    refuse(_unsound(fit, motions, bias))
    used = int(fit.used.sum())
    misses = fit.residuals / np.array([[motion.dt.sum()] for motion in motions])  # as of a mean rate over each, rad/s
    calibration = replace(
        base,
        matrix=fit.matrix,
        bias=fit.bias,
        covariance=fit.covariance,
        residual_rms=float(np.sqrt(np.mean(misses[fit.used] ** 2))),
        method=f"gyr by hand, {used} motions against the accelerometer",
        quality=Quality(
            grade=worst_grade(grade_of(float(fit.matrix_sd.max()), SCALE), grade_of(float(fit.bias_sd.max()), RATE)),
            samples=used,
            outliers=len(motions) - used,
            condition=fit.condition,
            scale_sd=float(np.diag(fit.matrix_sd).max()),
        ),
    )
    turned = np.array([motion.rate.mean(axis=0) for motion in motions])
    remarks = _remarks(fit, spoilt, acc_calibrated)
    if coupling is not None:
        most = to_dps(float(np.abs(coupling.matrix).max())) * G0
        remarks.append(
            f"Its bias depends on specific force, by up to {most:.3f} °/s per g (F-test, {p_value(coupling.chance)}); "
            "the card corrects that, and needs the accelerometer in every sample."
        )
    if undeclared := np.count_nonzero(flat if clipped is None else flat & ~clipped):
        remarks.append(
            f"{undeclared} samples repeat the largest rate of their motion: the gyroscope was at the end of a range "
            "that the recording does not declare; give gyr_range, or the range in the profile."
        )
    return Fitted(calibration, turned, misses, fit.used, (*remarks, *notes))


def _coupling(rates: Floats, force: Floats, where: Sequence[slice], base: TriadCalibration) -> Coupling | None:
    """Sensitivity to specific force, unless the card has one, or the accelerometer is too slow to correct it."""
    if base.g_sensitivity.any() or np.isfinite(force).all(axis=1).mean() < _EVERY:
        return None
    return coupling_at_rest(*(np.array([v[part].mean(axis=0) for part in where]) for v in (rates, force)))


def _unfit(
    motions: Sequence[TurnBetweenPoses], spoilt: dict[str, int], acc: Floats, where: Sequence[slice]
) -> tuple[Reason | None, ...]:
    """Reasons why there is nothing to fit."""
    size = float(np.median([np.linalg.norm(acc[part].mean(axis=0)) for part in where]))
    wrong = f"The specific force at rest is {size:.3f} m/s², but gravity is {G0:.3f} m/s²."
    calibrate = "Calibrate the accelerometer first, and check its unit."
    lost = " and ".join(f"{count} ({what})" for what, count in spoilt.items() if count)
    few = (
        f"The capture has {counted(len(motions), 'motion')} between poses at rest that tilt the unit by "
        f"{to_deg(SMALLEST):.0f}° or more, but {FEWEST} are needed{f'; left out were {lost}' if lost else ''}."
    )
    kind = "clipping" if spoilt["clipping"] else "too-few" if motions else "no-motion"
    advice = f"Turn it more slowly, within its range. {_ADVICE}" if spoilt["clipping"] else _ADVICE
    return (
        Reason("wrong-gravity", wrong, calibrate) if abs(size / G0 - 1.0) > _WRONG_GRAVITY else None,
        Reason(kind, few, advice) if len(motions) < FEWEST else None,
    )


def _unsound(fit: MotionFit, motions: Sequence[TurnBetweenPoses], bias: Floats) -> Reason | None:
    """Reason why the result is none."""
    sd, off = fit.matrix_sd, float(np.abs(fit.matrix - np.eye(3)).max())
    wrong = not (sd.max() <= SCALE.poor and off <= STRANGE)
    if wrong and (reason := swapped(lambda way: typical_miss(motions, bias, way))):
        return reason
    miss = typical_miss(motions, bias, np.eye(3)) if wrong else 0.0
    if miss > SMALLEST:
        text = f"Turned by the rates as they are, gravity comes out {to_deg(miss):.0f}° off after a motion (median)."
        advice = (
            "Check that each axis of the gyroscope answers to a turn about it, and its unit and axes in the profile."
        )
        return Reason("implausible", text, advice)
    if not fit.condition < UNTOLD or not sd.max() <= SCALE.poor:
        axis = "xyz"[int(sd.max(axis=0).argmax())]
        text = (
            f"The motions do not separate the entries of the matrix: condition number {fit.condition:.2g}, and those "
            f"for rates about {axis} are known to {100.0 * float(sd.max()):.2g} % only."
        )
        return Reason("ill-conditioned", text, _ADVICE)
    text = f"The matrix {np.round(fit.matrix, 3).tolist()} is far from that of a gyroscope in rad/s."
    advice = "Check unit and axes of the gyroscope in the profile."
    return Reason("implausible", text, advice) if off > STRANGE else None


def _remarks(fit: MotionFit, spoilt: dict[str, int], acc_calibrated: bool) -> list[Note]:
    size = to_deg(float(np.sqrt(np.mean(np.sum(fit.residuals[fit.used] ** 2, axis=1)))))
    remarks: list[Note] = [info("calibration.gravity_after_motion", size=size)]
    if not acc_calibrated:
        remarks.append(warning("calibration.acc_uncalibrated"))
    remarks += [info("calibration.motions_left_out", count=count, what=what) for what, count in spoilt.items() if count]
    if not fit.used.all():
        remarks.append(warning("calibration.motions_set_aside", count=int(np.count_nonzero(~fit.used))))
    return remarks
