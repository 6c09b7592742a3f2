"""Gain and axes of a gyroscope alone, by turns through known angles from stop to stop.

A quarter turn over the edge of a box, a whole turn back to a line, an angle on a protractor: between two rests the unit
was turned by φ about an axis u of its case, as exactly as the stops are. What the rates add up to, R(M), must be that:

::

    e = log(exp(φ [u]×) R(M)ᵀ),  e ~ N(0, stop² I + (∫R dt) Σ_b (∫R dt)ᵀ)

e has three components, so that a quarter turn shows a column of M, scale and both misalignments; a whole turn shows the
scale alone, as a tilted axis comes round again. What no turn shows keeps what data sheets allow.

Without an accelerometer nobody knows what gravity adds to the rates. A turn is freed of the mean of both rests beside
it; the bias of the card is that of all rests, and as uncertain as they differ from pose to pose.

Nor does a turn about one axis show whether the axes are read at the same time, of which a swing makes a drift: a row
holds the last reading of each part, which may be a step old, so each axis is late by 0 to one step, uniformly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from plumbob.calibration.fit import RATE, SCALE, Fitted, Reason, grade_of, invert, refuse, worst_grade
from plumbob.calibration.gyr.hand import SHORTEST, SMALLEST, STRANGE, flat_tops, spoiling, turn_by_rates
from plumbob.calibration.gyr.rest import Rates, beyond_bias, dead_axes, rest, without_known
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import counted
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.data.cards import Quality
from plumbob.rotations import dcm_from_quat, quat_chained, quat_from_dcm, quat_from_rotvec, rotvec_from_quat

STOP: Final = float(deg(0.5))  # how exactly a turn ends at a stop, rad: 1 mm on an edge of 10 cm
ROUGH_GAIN: Final = STRANGE / np.sqrt(3.0)  # of a scale that no turn shows: uniform within what no gyroscope exceeds
CROSS: Final = 0.05 / np.sqrt(3.0)  # of cross-axis entries: uniform within ±5 %, the widest of the sheets at hand
# Of the bias that 1 g makes, rad/s, where a single pose shows nothing: uniform within 0.1 °/s (ADXRS290, MPU-3050)
BY_GRAVITY: Final = float(dps(0.1)) / np.sqrt(3.0)
CHANCE: Final = 0.01  # at which turns that end as exactly as they should would miss their angles by so much
_AXES: Final = "xyz"
_STEPS: Final = 12
_PRIOR: Final = np.where(np.eye(3, dtype=np.bool_), ROUGH_GAIN, CROSS).ravel()
_ADVICE: Final = (
    "Let the unit lie for 10 s, turn it against the stop, let it lie for 3 s, and so on: two turns about each axis at "
    "least, one each way. Say how far by --angle, or each by --turns 'x 90deg, x -90deg, ...'; and check "
    "the unit of the rates in the profile."
)


@dataclass(frozen=True, eq=False, slots=True)
class StopTurn:
    """Turn between two rests."""

    start: float  # s
    rate: Floats  # (N, 3), from the last instant at rest to the next first one, less the mean of both rests, rad/s
    dt: Floats  # (N−1,), steps, s
    spoilt: str  # why its rates cannot be integrated: "clipping", "gap" or nothing

    @property
    def angle(self) -> Floats:
        """What the rates add up to about each axis (3,), rad."""
        return np.asarray(0.5 * self.dt @ (self.rate[1:] + self.rate[:-1]))

    @property
    def axis(self) -> int:
        """About which it turned most, 0 to 2."""
        return int(np.argmax(np.abs(self.angle)))

    def __str__(self) -> str:
        """Axis and angle by the rates, and when."""
        return f"{_AXES[self.axis]} {to_deg(float(self.angle[self.axis])):+.0f}° at {self.start:.1f} s"


def fit_stops(
    rates: Rates,
    *,
    angle: float = 0.5 * np.pi,
    turns: Sequence[tuple[int, float]] | None = None,
    angle_sd: float = STOP,
) -> Fitted:
    """Bias, gain and axes of a gyroscope that was turned from stop to stop, with a rest before and after each turn.

    Each turn was one by `angle`, rad, either way, about the axis that turned most; or `turns` says axis, 0 to 2, and
    signed angle of each, in order. `angle_sd`, rad, is how exactly they ended. Polynomial and g-sensitivity known so
    far are kept.
    """
    t, base = rates.t, rates.known
    rates = rates._replace(gyr=check.rows("gyr", rates.gyr, 3, t.size))
    between, rests, notes = turns_between(rates)
    refuse(dead_axes(*(turn.rate[1:-1] for turn in between if len(turn.rate) >= SHORTEST + 2)))
    means = np.array([part.mean(axis=0) for part in rests])
    noise = np.mean([part.std(axis=0) / np.sqrt(len(part)) for part in rests], axis=0)
    refuse(beyond_bias(means.mean(axis=0)))
    vectors = _true_turns(between, angle, turns)
    if base.g_sensitivity.any():
        by_pose, bias_sd = np.zeros(3), np.hypot(noise, means.std(axis=0, ddof=1)) / np.sqrt(len(means))
    else:
        by_pose, by_mean = _by_gravity(means, noise, vectors)
        bias_sd = np.hypot(noise / np.sqrt(len(means)), by_mean)
        base = replace(base, g_sensitivity_sd=np.repeat(by_pose[:, np.newaxis] / G0, 3, axis=1))
        notes = (*notes, info("calibration.gravity_unknown", spread_dps=to_dps(float(bias_sd.max()))))
    made = np.array([vector.any() and not turn.spoilt for turn, vector in zip(between, vectors, strict=True)])
    if not made.any():
        refuse(Reason("clipping", "Every turn has samples at the end of the range or missing.", _ADVICE))
    spoilt, vectors = int(np.count_nonzero(vectors.any(axis=1) & ~made)), vectors[made]
    moves = [turn for turn, counts in zip(between, made.tolist(), strict=True) if counts]
    fit = _fit(moves, vectors, np.hypot(noise, 0.5 * by_pose), angle_sd)
    unturned = [k for k in range(3) if not vectors[:, k].any()]
    turned_sd = float(np.delete(np.diag(fit.sd), unturned).max())
    grades = [grade_of(turned_sd, SCALE), grade_of(float(bias_sd.max()), RATE), *([None] if unturned else [])]
    covariance = np.zeros((12, 12))
    covariance[:3, :3], covariance[3:, 3:] = np.diag(bias_sd**2), fit.covariance
    misses = fit.residuals / np.array([[turn.dt.sum()] for turn in moves])  # as of a mean rate over each turn, rad/s
    calibration = replace(
        base,
        matrix=fit.matrix,
        bias=means.mean(axis=0),
        covariance=covariance,
        residual_rms=float(np.sqrt(np.mean(misses**2))),
        delay_sd=float(np.median(np.diff(t))) / np.sqrt(12.0),
        method=f"gyr alone, {counted(len(moves), 'turn')} from stop to stop",
        quality=Quality(
            grade=worst_grade(*grades),
            samples=len(moves),
            condition=fit.condition,
            scale_sd=float(np.diag(fit.sd).max()),
        ),
    )
    measured, remarks = np.array([turn.rate.mean(axis=0) for turn in moves]), _remarks(fit, unturned, angle_sd, spoilt)
    signs = () if turns is not None else (info("calibration.turn_signs"),)
    return Fitted(calibration, measured, misses, np.ones(len(moves), dtype=np.bool_), (*remarks, *signs, *notes))


def _remarks(fit: "_MatrixFit", unturned: list[int], angle_sd: float, spoilt: int) -> list[Note]:
    rms = to_deg(float(np.sqrt(np.mean(fit.residuals**2))))
    remarks: list[Note] = [info("calibration.stops", angle_sd_deg=to_deg(angle_sd), rms_deg=rms)]
    if unturned:
        axes = ", ".join(_AXES[k] for k in unturned)
        remarks.append(warning("calibration.unturned", axes=axes, percent=100.0 * ROUGH_GAIN))
    if fit.ratio > 1.0:
        remarks.append(warning("calibration.stops_inexact", ratio=float(np.sqrt(fit.ratio))))
    if spoilt:
        remarks.append(warning("calibration.turns_spoilt", count=spoilt))
    return remarks


def turns_between(rates: Rates) -> tuple[list[StopTurn], list[Floats], tuple[Note, ...]]:
    """What lies between neighbouring rests, the rates in each of these, rad/s, and remarks on them."""
    where, notes = rest(rates)
    flat, corrected = flat_tops(rates.gyr, where), without_known(rates)
    clipped = flat if rates.clipped is None else flat | rates.clipped
    turns, rests = [], [corrected[part] for part in where]
    for k, (first, second) in enumerate(pairwise(where)):
        span = slice(first.stop - 1, second.start + 1)
        bias = np.mean([part.mean(axis=0) for part in rests[k : k + 2]], axis=0)
        why = spoiling(rates.t, rates.gyr, span, clipped)
        turns.append(StopTurn(float(rates.t[span][0]), corrected[span] - bias, np.diff(rates.t[span]), why))
    return turns, rests, notes


def _by_gravity(means: Floats, noise: Floats, steps: Floats) -> tuple[Floats, Floats]:
    """What 1 g adds to each axis (3,), and how far the mean of rests (K, 3) is off in any pose (3,), both sd, rad/s.

    `noise` (3,) is that of one rest, `steps` (K−1, 3) are the turns between them. Seen from K attitudes R, along nobody
    knows which of their axes, the mean of gravity has the square a = |mean R|²/3, 1 for a single pose, and the rests
    scatter by 1 − a.
    """
    from scipy.stats import norm, t

    attitudes = dcm_from_quat(quat_chained(steps))
    along = float(np.sum(attitudes.mean(axis=0) ** 2)) / 3.0
    apart = np.linalg.norm(attitudes[:, np.newaxis] - attitudes, axis=(2, 3)) > 2.0 * np.sqrt(2.0) * np.sin(SMALLEST)
    poses = 1 + sum(bool(row[:k].all()) for k, row in enumerate(apart) if k)
    if poses == 1:
        by_g = np.full(3, BY_GRAVITY)
    else:  # of the poses that differ, one in three differs by a turn about gravity, which changes nothing
        freedom = 2.0 / 3.0 * (poses - 1)
        scatter = np.maximum(means.var(axis=0) - noise**2, noise**2 / len(means))
        by_g = np.sqrt(scatter / (1.0 - along)) * float(t.ppf(norm.cdf(1.0), freedom))
    return by_g, by_g * np.sqrt(1.0 + along)


def _true_turns(between: list[StopTurn], angle: float, turns: Sequence[tuple[int, float]] | None) -> Floats:
    """True turn between each two rests (N, 3), rad, zero where it hardly moved; a refusal where rates contradict it."""
    smallest = min(SMALLEST, 0.5 * (angle if turns is None else min((abs(size) for _, size in turns), default=0.0)))
    sizes = np.array([np.abs(turn.angle).max() for turn in between])
    where = np.flatnonzero(sizes > smallest).tolist()
    moves, vectors = [between[k] for k in where], np.zeros((len(between), 3))
    most = f"the largest of {counted(len(between), 'move')} is {to_deg(float(sizes.max(initial=0.0))):.2g}°."
    refuse(None if moves else Reason("no-motion", f"No turn lies between two rests: {most}", _ADVICE))
    listed = "; ".join(map(str, moves))
    many = f"The rates show {counted(len(moves), 'turn')} between rests ({listed}), but there should be "
    if turns is not None and len(turns) != len(moves):
        refuse(Reason("no-motion", f"{many}{len(turns)}.", "Rest for 3 s or more after each, and name all of them."))
    for k, (place, turn) in enumerate(zip(where, moves, strict=True)):
        axis, true = (turn.axis, angle) if turns is None else turns[k]
        by_rates = float(turn.angle[axis])
        vectors[place, axis] = true = float(np.copysign(true, by_rates)) if turns is None else true
        if turn.spoilt:
            continue
        what = f"The turn about {_AXES[axis]} at {turn.start:.1f} s should be {to_deg(true):+.0f}°, and the rates add "
        text = f"{what}up to {to_deg(by_rates):+.1f}° (all: {listed})."
        opposite = abs(by_rates / true + 1.0) <= STRANGE
        advice = "Give its angle the other sign, or that axis in the profile. Counterclockwise is positive, seen from "
        check = (
            "Check the angle, the order of the turns, and unit and axes of the rates in the profile: degrees per "
            f"second that are taken for rad/s make the angles {to_deg(1.0):.0f} times as large."
        )
        refuse(
            Reason("mirrored", text, f"{advice}the tip of the axis.") if opposite else None,
            None if opposite or abs(by_rates / true - 1.0) <= STRANGE else Reason("implausible", text, check),
        )
    return vectors


class _MatrixFit(NamedTuple):
    """Matrix from rates to true ones, and how well it is known."""

    matrix: Floats  # (3, 3)
    covariance: Floats  # (9, 9), row by row
    residuals: Floats  # (N, 3), by which turns miss their ends, rad
    condition: float
    ratio: float  # of the squares of the residuals over those expected, where that is not chance; else 1

    @property
    def sd(self) -> Floats:
        """Standard deviations (3, 3)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)).reshape(3, 3))


def _fit(moves: Sequence[StopTurn], vectors: Floats, bias_sd: Floats, angle_sd: float) -> _MatrixFit:
    """Steps of Gauss and Newton, from the scales that the sums of the rates give."""
    from scipy.stats import chi2

    ends = dcm_from_quat(quat_from_rotvec(vectors))
    sums = np.array([turn.angle for turn in moves])
    scale = np.array(
        [np.sum(v * v) / np.sum(v * s) if v.any() else 1.0 for v, s in zip(vectors.T, sums.T, strict=True)]
    )
    matrix, prior = np.diag(scale), np.diag(_PRIOR**-2.0)
    for _ in range(_STEPS):
        normal, pull, residuals, squares = prior.copy(), prior @ (np.eye(3) - matrix).ravel(), [], 0.0
        for turn, end in zip(moves, ends, strict=True):
            by_rates, slope = turn_by_rates(turn.rate, turn.dt, np.zeros(3), matrix)
            residual = rotvec_from_quat(quat_from_dcm(end @ by_rates.T))
            lean = slope[:, :3] * bias_sd
            weight = np.linalg.inv(angle_sd**2 * np.eye(3) + lean @ lean.T)
            normal += slope[:, 3:].T @ weight @ slope[:, 3:]
            pull += slope[:, 3:].T @ weight @ residual
            squares += float(residual @ weight @ residual)
            residuals.append(residual)
        inverse, condition = invert(normal)
        matrix = matrix + (inverse @ pull).reshape(3, 3)
    shown = 9.0 - float(np.trace(inverse @ prior))  # parameters that the turns show
    free = max(1.0, 3.0 * len(moves) - shown)
    ratio = max(1.0, squares / free) if chi2.sf(squares, free) < CHANCE else 1.0
    return _MatrixFit(matrix, inverse * ratio, np.array(residuals), condition, ratio)
