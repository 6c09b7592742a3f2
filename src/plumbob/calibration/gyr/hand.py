"""Scale and misalignment of a gyroscope by hand, against the accelerometer at rest before and after [Tedaldi2014].

Where the unit came to rest, the accelerometer measures the direction of gravity. Turned back by what the gyroscope
integrated during the motion, it must be the direction before. All nine entries of the matrix follow, relative to the
axes of the accelerometer, so both triads share their axes afterwards. Heading plays no part: a turn about the vertical
says nothing, so the unit has to be turned over in every way.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import RATE, SCALE, Fitted, Reason, grade_of, refuse, worst_grade
from plumbob.calibration.gyr.motion_fit import (
    FEWEST,
    SMALLEST,
    Coupling,
    MotionFit,
    TurnBetweenPoses,
    coupling_at_rest,
    find_motions,
    fit_motions,
    typical_miss,
)
from plumbob.calibration.gyr.plausible import Rates, beyond_bias, dead_axes, without_known
from plumbob.calibration.gyr.rest import bias_at_rest, rest
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError
from plumbob.core.text import counted, p_value
from plumbob.core.units import dps, to_deg, to_dps
from plumbob.data.cards import Quality, TriadCalibration
from plumbob.rotations import axes_words, every_axes

FAST: Final = float(dps(50.0))
"""Rate from which on a flat top is a range, rad/s: slower, coarse steps repeat themselves, and no part ends there."""

FLAT: Final = 4
"""Equal values in a row that make a flat top; of a sensor slower than the recording, that many of its own."""


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


CLEARLY: Final = 0.5
"""Misses over those of the declared axes below which other axes are the right ones."""


def swapped(miss: Callable[[Floats], float]) -> list[Reason]:
    """Reason to refuse a gyroscope that fits the accelerometer with other axes than the declared ones.

    Parameters
    ----------
    miss : callable
        Typical miss of a matrix (3, 3) from rates to those about the accelerometer's axes.
    """
    ways = every_axes()
    misses = np.array([miss(way) for way in ways])
    best = int(np.argmin(misses))
    if not misses[best] < CLEARLY * misses[0]:  # the first is the identity
        return []
    text = (
        f"Gyroscope and accelerometer have different axes: gravity follows the rates taken as {axes_words(ways[best])} "
        "instead of x, y, z."
    )
    return [Reason("implausible", text, "Check axes and signs of both triads in the profile.")]


UNTOLD: Final = 1e4
"""Condition number of the normal equations, scaled, from which on entries of the matrix are not told apart; 20 motions
about random axes have 3 to 10."""

SHORTEST: Final = 20
"""Samples from which on rates between stretches at rest show a dead axis: coarse steps repeat in a few."""

STRANGE: Final = 0.3
"""Difference of the matrix from the identity beyond that of any gyroscope that works."""

_EVERY = 0.99  # of the samples must have a specific force, for a card of g-sensitivity takes the rate of others away
_WRONG_GRAVITY = 0.05
_ADVICE = (
    "Let the unit lie for 30 s, then turn it by a quarter or half a turn, about another axis each time, and put it "
    "down for 2 s each time: 20 poses or more, all six faces among them."
)


def fit_hand(rates: Rates) -> Fitted:
    """Bias and matrix of a gyroscope from hand motion.

    Errors of scale and axes of the specific force become the gyroscope's. A motion with a clipped sample is left out,
    and so is one whose rates have a flat top that no range declares. Of the calibration so far the polynomial is kept,
    and the g-sensitivity where it has one; else the poses tell it, where the accelerometer is calibrated.

    Raises
    ------
    CaptureRefusedError
        not-still, no-motion, too-few, clipping, wrong-gravity, ill-conditioned, implausible.
    CalibrationError
        If there is no specific force.
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
    refuse(_unfit(motions, spoilt, force, where))
    fit = fit_motions(motions, bias, spread)
    refuse(_unsound(fit, motions, bias))
    used = int(fit.used.sum())
    calibration = replace(
        base,
        matrix=fit.matrix,
        bias=fit.bias,
        covariance=fit.covariance,
        residual_rms=float(np.sqrt(np.mean(fit.residuals[fit.used] ** 2))),
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
    remarks = (*_remarks(fit, spoilt, acc_calibrated), *_coupled(coupling), *_flat(flat, clipped), *notes)
    return Fitted(calibration, turned, fit.residuals, fit.used, remarks)


def _coupling(rates: Floats, force: Floats, where: Sequence[slice], base: TriadCalibration) -> Coupling | None:
    """Sensitivity to specific force, unless the card has one, or the accelerometer is too slow to correct it."""
    if base.g_sensitivity.any() or np.isfinite(force).all(axis=1).mean() < _EVERY:
        return None
    return coupling_at_rest(*(np.array([v[part].mean(axis=0) for part in where]) for v in (rates, force)))


def _coupled(coupling: Coupling | None) -> tuple[str, ...]:
    if coupling is None:
        return ()
    most = to_dps(float(np.abs(coupling.matrix).max())) * G0
    return (
        f"Its bias depends on specific force, by up to {most:.3f} °/s per g (F-test, {p_value(coupling.chance)}); "
        "the card corrects that, and needs the accelerometer in every sample.",
    )


def _unfit(
    motions: Sequence[TurnBetweenPoses], spoilt: dict[str, int], acc: Floats, where: Sequence[slice]
) -> list[Reason]:
    """Reasons why there is nothing to fit."""
    reasons = []
    size = float(np.median([np.linalg.norm(acc[part].mean(axis=0)) for part in where]))
    if abs(size / G0 - 1.0) > _WRONG_GRAVITY:
        text = f"The specific force at rest is {size:.3f} m/s², but gravity is {G0:.3f} m/s²."
        reasons.append(Reason("wrong-gravity", text, "Calibrate the accelerometer first, and check its unit."))
    if len(motions) < FEWEST:
        lost = " and ".join(f"{count} ({what})" for what, count in spoilt.items() if count)
        text = (
            f"The capture has {counted(len(motions), 'motion')} between poses at rest that tilt the unit by "
            f"{to_deg(SMALLEST):.0f}° or more, but {FEWEST} are needed{f'; left out were {lost}' if lost else ''}."
        )
        kind = "clipping" if spoilt["clipping"] else "too-few" if motions else "no-motion"
        advice = f"Turn it more slowly, within its range. {_ADVICE}" if spoilt["clipping"] else _ADVICE
        reasons.append(Reason(kind, text, advice))
    return reasons


def _unsound(fit: MotionFit, motions: Sequence[TurnBetweenPoses], bias: Floats) -> list[Reason]:
    """Reasons why the result is none."""
    sd = fit.matrix_sd
    wrong = not (sd.max() <= SCALE.poor and np.abs(fit.matrix - np.eye(3)).max() <= STRANGE)
    reasons = swapped(lambda way: typical_miss(motions, bias, way)) if wrong else []
    if reasons:
        return reasons
    miss = typical_miss(motions, bias, np.eye(3)) if wrong else 0.0
    if miss > SMALLEST:
        text = f"Turned by the rates as they are, gravity comes out {to_deg(miss):.0f}° off after a motion (median)."
        advice = (
            "Check that each axis of the gyroscope answers to a turn about it, and its unit and axes in the profile."
        )
        reasons.append(Reason("implausible", text, advice))
    elif not fit.condition < UNTOLD or not sd.max() <= SCALE.poor:
        axis = "xyz"[int(sd.max(axis=0).argmax())]
        text = (
            f"The motions do not separate the entries of the matrix: condition number {fit.condition:.2g}, and those "
            f"for rates about {axis} are known to {100.0 * float(sd.max()):.2g} % only."
        )
        reasons.append(Reason("ill-conditioned", text, _ADVICE))
    elif np.abs(fit.matrix - np.eye(3)).max() > STRANGE:
        text = f"The matrix {np.round(fit.matrix, 3).tolist()} is far from that of a gyroscope in rad/s."
        reasons.append(Reason("implausible", text, "Check unit and axes of the gyroscope in the profile."))
    return reasons


def _flat(flat: NDArray[np.bool_], clipped: NDArray[np.bool_] | None) -> tuple[str, ...]:
    undeclared = np.count_nonzero(flat if clipped is None else flat & ~clipped)
    if not undeclared:
        return ()
    return (
        f"{undeclared} samples repeat the largest rate of their motion: the gyroscope was at the end of a range that "
        "the recording does not declare; give gyr_range, or the range in the profile.",
    )


def _remarks(fit: MotionFit, spoilt: dict[str, int], acc_calibrated: bool) -> tuple[str, ...]:
    size = to_deg(float(np.sqrt(np.mean(np.sum(fit.residuals[fit.used] ** 2, axis=1)))))
    remarks = [f"Gravity comes out {size:.2g}° (rms) off after a motion; axes are those of the accelerometer."]
    if not acc_calibrated:
        remarks.append(
            "The accelerometer is UNCALIBRATED: its errors are in this matrix, and the standard deviations do not know "
            "it. Calibrate it first and give its card with --calibration."
        )
    remarks += [f"Left out: {counted(count, 'motion')} ({what})." for what, count in spoilt.items() if count]
    if not fit.used.all():
        remarks.append(
            f"Set aside because they do not fit the others: {counted(int(np.count_nonzero(~fit.used)), 'motion')}."
        )
    return tuple(remarks)
