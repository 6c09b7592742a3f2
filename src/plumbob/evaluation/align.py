"""Constant rotations between an estimate and a reference: a heading, a mounting, or both.

Off by default, because a constant error is an error. Whatever is found is applied to the reference and reported; the
estimate is judged as it was delivered. The model is ``q_est ≈ h ⊗ q_ref ⊗ q_re``: h turns about the vertical, q_re is
the reference's body seen from the estimate's. Least squares of the chordal distance, as in `quat_mean`, so that signs
of quaternions do not matter. The values are fitted to the very samples that are scored, which flatters the score; over
a recording of thousands of samples by little, over a few samples by much.

Time offset between two attitude tracks, from how fast each says that the body turns.

The angular rate's magnitude does not depend on frames, headings or mountings, so the offset can be found before any of
them. Both tracks are read on a common grid; the normalised correlation over the samples that both know gives the offset
to a grid step, and a root search, with the reference interpolated again at each trial offset, the fraction.

Bring an estimate and a reference to common times: the reference is read at the estimate's times.

A time stamp that both have is taken as it is, to the last bit. Between two stamps the reference is interpolated at
constant rate (slerp), never across a gap, never next to a row that is not known, never beyond its ends. Every sample of
the estimate gets a `Fate`, so that what was left out can be counted and shown.
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import partial

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from plumbob.core.time import longest_bridged, to_ns
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.data import AttitudeTrack
from plumbob.data.reading import read_at
from plumbob.evaluation.metrics import error_quat
from plumbob.rotations import Frame, quat_angle, quat_conjugate, quat_mean, quat_multiply, quat_rotate
from plumbob.rotations.frames import turn_heading

Mask = NDArray[np.bool_]


class Fate(IntEnum):
    """What became of a sample of the estimate; the first that applies."""

    SCORED = 0
    ESTIMATE_UNKNOWN = 1
    NOT_CONVERGED = 2
    OUTSIDE = 3
    GAP = 4
    REFERENCE_UNKNOWN = 5
    SETTLING = 6
    MASKED = 7

    @property
    def meaning(self) -> str:
        """One line for a reader."""
        return _MEANING[self]


_MEANING = {
    Fate.SCORED: "scored",
    Fate.ESTIMATE_UNKNOWN: "the estimate holds no attitude",
    Fate.NOT_CONVERGED: "the estimate had not converged",
    Fate.OUTSIDE: "before the reference begins or after it ends",
    Fate.GAP: "the reference has no samples for longer than the largest gap",
    Fate.REFERENCE_UNKNOWN: "the reference lost the body",
    Fate.SETTLING: "in the settling time after the start of the estimate",
    Fate.MASKED: "the reference says that it does not count",
}


@dataclass(frozen=True, eq=False)
class Match:
    """A reference at the times of an estimate of N samples."""

    q_ref: Floats  # (N, 4), the reference there; NaN where it is not known
    fate: NDArray[np.uint8]  # (N,), a `Fate` for each sample
    exact: Mask  # (N,), the reference has this very time stamp; elsewhere it is interpolated
    max_gap: float  # largest step of the reference that was bridged, s

    @property
    def scored(self) -> Mask:
        """True where the sample counts, (N,)."""
        return np.asarray(self.fate == Fate.SCORED)

    def counts(self) -> dict[Fate, int]:
        """Samples of each fate that occurs."""
        return {fate: n for fate in Fate if (n := int(np.count_nonzero(self.fate == fate)))}


def associate(
    estimate: AttitudeTrack,
    reference: AttitudeTrack,
    *,
    max_gap: float | None = None,
    settle: float = 0.0,
    offset: float = 0.0,
) -> Match:
    """Read the reference at the times of the estimate; both count from the same start.

    The ``score`` of the reference masks samples: an interpolated one counts only where both neighbours do. A ``score``
    of the estimate is not heard; nobody marks his own work. What it holds before the filter has converged,
    `not_converged`, and `settle` s from its first sample do not count. Steps of the reference longer than `max_gap` s
    (`GAP_FACTOR` median steps) are not bridged; `offset` s is added to its stamps.
    """
    limit = longest_bridged(to_ns(reference.t)) if max_gap is None else max_gap
    if not 0.0 <= limit < np.inf:
        raise ParameterError(f"max_gap must be a finite time ≥ 0 s, but it is {max_gap}.")
    if not 0.0 <= settle < np.inf:
        raise ParameterError(f"settle must be a finite time ≥ 0 s, but it is {settle}.")
    reading = read_at(reference, to_ns(estimate.t), max_gap=limit, offset=offset)
    if reading.outside.all():
        raise ClockError(_no_overlap(estimate, reference, offset))
    fate = np.zeros(len(estimate), dtype=np.uint8)  # the first `Fate` that applies: later lines have the last word
    if reference.score is not None:
        fate[~(reference.score[reading.low] & reference.score[reading.high])] = Fate.MASKED
    fate[estimate.t < estimate.t[0] + settle] = Fate.SETTLING
    fate[~np.isfinite(reading.q_nb).all(axis=1)] = Fate.REFERENCE_UNKNOWN
    fate[reading.gap] = Fate.GAP
    fate[reading.outside] = Fate.OUTSIDE
    fate[not_converged(estimate)] = Fate.NOT_CONVERGED
    fate[~estimate.known] = Fate.ESTIMATE_UNKNOWN
    return Match(reading.q_nb, fate, reading.exact & (fate == Fate.SCORED), limit)


def not_converged(track: AttitudeTrack) -> Mask:
    """True where a filter had no attitude yet, or one of which nothing had shown that it is right, (N,)."""
    if track.flags is None:
        return np.zeros(len(track), dtype=np.bool_)
    return np.asarray(track.flags & np.uint32(flags.NOT_CONVERGED) != 0)


def _no_overlap(estimate: AttitudeTrack, reference: AttitudeTrack, offset: float) -> str:
    first, last = reference.t[0] + offset, reference.t[-1] + offset
    return (
        f"estimate and reference have no time in common: the estimate spans {estimate.t[0]:.3f} to "
        f"{estimate.t[-1]:.3f} s, the reference {first:.3f} to {last:.3f} s. Let both count from the same start."
    )


FINEST_STEP = 0.01  # s; a body's turning is sought below 50 Hz, where tracks of all rates can be compared

MIN_CORRELATION = 0.5
MIN_RATE_SD = dps(0.5)  # Variation of the angular rate, rad/s, below which there is nothing to compare

_ENOUGH = 20  # grid steps that both tracks must know at a lag
_TIE = 1e-6
_RESOLUTION = 1e-9  # s, that of a time stamp


@dataclass(frozen=True, slots=True)
class TimeOffset:
    """A time offset and how sure it is."""

    # Added to the reference's stamps, s. Positive: the estimate shows a motion later than the reference does.
    offset: float
    correlation: float  # of the two angular rates at that offset
    # correlation at the next best peak; one near `correlation` says that the motion repeats and the offset may be wrong
    # by a period
    rival: float | None = None
    rival_at: float | None = None  # offset of it, s


def find_time_offset(
    estimate: AttitudeTrack, reference: AttitudeTrack, *, max_offset: float = 1.0, max_gap: float | None = None
) -> TimeOffset:
    """Time up to ±`max_offset` s that, added to the reference's stamps, brings its turning to the estimate's.

    Frames, headings and mountings of the two may differ; steps longer than `max_gap` s (`GAP_FACTOR` median steps of
    each) are not bridged.
    """
    from scipy.optimize import brentq

    if not 0.0 < max_offset < np.inf:
        raise ParameterError(f"max_offset must be a positive time, but it is {max_offset} s.")
    gaps = [longest_bridged(to_ns(track.t)) if max_gap is None else max_gap for track in (estimate, reference)]
    grid = _grid(estimate, reference)
    rate_est = _rates(estimate, grid, gaps[0], 0.0)
    rate_ref = _rates(reference, grid, gaps[1], 0.0)
    _refuse_rest(estimate=rate_est, reference=rate_ref)
    step = float(grid[1] - grid[0])
    coarse = _coarse(rate_est, rate_ref, step, max_offset)
    mismatch = partial(_mismatch, rate_est=rate_est, reference=reference, grid=grid, max_gap=gaps[1])
    low, high = coarse.offset - step, coarse.offset + step
    if not mismatch(low) * mismatch(high) < 0.0:
        raise ClockError(
            f"the time offset does not settle near {coarse.offset:.4f} s: there the rotations match best, but not "
            "well enough. Align them by hand, or leave time out of align."
        )
    offset = float(brentq(mismatch, low, high, xtol=_RESOLUTION))
    return TimeOffset(offset, coarse.correlation, coarse.rival, coarse.rival_at)


def _grid(estimate: AttitudeTrack, reference: AttitudeTrack) -> Floats:
    """Equal steps over the estimate, as long as the coarser track's own, s."""
    if min(len(estimate), len(reference)) < 3:
        raise ClockError("a time offset needs at least three samples in both tracks.")
    step = max(FINEST_STEP, *(float(np.median(np.diff(track.t))) for track in (estimate, reference)))
    count = int((estimate.t[-1] - estimate.t[0]) / step) + 1
    if count < _ENOUGH:
        raise ClockError(f"a time offset needs {_ENOUGH} steps of {step:.3g} s, but the estimate holds {count}.")
    grid: Floats = estimate.t[0] + step * np.arange(count)
    return grid


def _rates(track: AttitudeTrack, grid: Floats, max_gap: float, offset: float) -> Floats:
    """Magnitude of the angular rate on the grid, rad/s, over two steps; NaN where not known."""
    q = read_at(track, to_ns(grid), max_gap=max_gap, offset=offset).q_nb
    rate = np.full(grid.size, np.nan)
    rate[1:-1] = quat_angle(q[:-2], q[2:]) / (grid[2:] - grid[:-2])
    return rate


def _refuse_rest(**rates: Floats) -> None:
    for name, rate in rates.items():
        sd = float(np.std(rate[np.isfinite(rate)])) if np.isfinite(rate).any() else 0.0
        if sd < MIN_RATE_SD:
            raise ClockError(
                f"no time offset can be found: the angular rate of the {name} varies by {to_dps(sd):.2g} °/s, but "
                f"{to_dps(MIN_RATE_SD):.2g} °/s are needed. Record a motion, or leave time out of align."
            )


def _coarse(rate_est: Floats, rate_ref: Floats, step: float, max_offset: float) -> TimeOffset:
    """Best offset in whole steps, the least of equally good ones, and the next best peak."""
    lags, r = masked_correlation(rate_est, rate_ref, int(np.ceil(max_offset / step)))
    top = float(np.nanmax(r)) if np.isfinite(r).any() else 0.0
    if not top > MIN_CORRELATION:
        raise ClockError(
            f"within ±{max_offset:g} s the turning of estimate and reference does not match: the best correlation is "
            f"{top:.2f}, but {MIN_CORRELATION} is needed. Search a wider range (max_offset=), or check "
            "that they are one recording."
        )
    best = int(np.argmin(np.where(r > top - _TIE, np.abs(lags), np.inf)))
    if best in {0, r.size - 1}:
        raise ParameterError(
            f"the best time offset lies at the end of the search, {lags[best] * step:.3f} s; search farther "
            "(max_offset=), or let both count from the same start."
        )
    peaks = [i for i in range(1, r.size - 1) if i != best and r[i] > r[i - 1] and r[i] >= r[i + 1]]
    rival = max(peaks, key=lambda i: float(r[i]), default=None)
    offset = float(lags[best]) * step
    if rival is None:
        return TimeOffset(offset, float(r[best]))
    return TimeOffset(offset, float(r[best]), float(r[rival]), float(lags[rival]) * step)


def masked_correlation(a: Floats, b: Floats, most: int) -> tuple[Floats, Floats]:
    """Lags −most to most and the Pearson correlation of a[i] and b[i − lag], over the samples where neither is NaN.

    NaN where fewer than half as many samples meet as at the best lag.
    """
    from scipy.signal import correlate, correlation_lags

    known_a, known_b = np.isfinite(a), np.isfinite(b)
    a = np.where(known_a, a - np.mean(a[known_a]), 0.0)
    b = np.where(known_b, b - np.mean(b[known_b]), 0.0)
    lags = correlation_lags(a.size, b.size)
    near = np.abs(lags) <= most

    def total(x: Floats, y: Floats) -> Floats:
        return np.asarray(correlate(x, y, method="fft")[near])

    one_a, one_b = known_a.astype(np.float64), known_b.astype(np.float64)
    n = np.rint(total(one_a, one_b))
    enough = n >= max(_ENOUGH, 0.5 * float(n.max()))
    n = np.where(enough, n, np.nan)
    sum_a, sum_b = total(a, one_b), total(one_a, b)
    var_a, var_b = total(a * a, one_b) - sum_a * sum_a / n, total(one_a, b * b) - sum_b * sum_b / n
    scale = np.sqrt(np.maximum(var_a, 0.0) * np.maximum(var_b, 0.0))
    r = (total(a, b) - sum_a * sum_b / n) / np.where(scale > 0.0, scale, np.nan)
    return lags[near].astype(np.float64), r


def _mismatch(offset: float, *, rate_est: Floats, reference: AttitudeTrack, grid: Floats, max_gap: float) -> float:
    """Covariance of the two rates' difference with the slope of the reference's: zero at the best offset.

    Noise of one track is foreign to the other and leaves the covariance at zero. The correlation would prefer offsets
    at which interpolation happens to smooth the noise.
    """
    rate_ref = _rates(reference, grid, max_gap, offset)
    slope = np.gradient(rate_ref, grid[1] - grid[0])
    both = np.isfinite(rate_est) & np.isfinite(slope) & np.isfinite(rate_ref)
    est, ref = (rate[both] - np.mean(rate[both]) for rate in (rate_est, rate_ref))
    rest = est - ref * float(est @ ref / (ref @ ref))
    return float(rest @ slope[both])


ALIGNMENTS = ("time", "mounting", "heading")

MIN_TILT_SPREAD = deg(3.0)
"""Least spread of the tilt, rad, from which mounting and heading are told apart. One over it, here 19, magnifies the
disagreement of the two tracks into the heading."""

_GRID = 720
_MIN_CONCENTRATION = 0.01


@dataclass(frozen=True, eq=False, slots=True)
class Alignment:
    """What was found and applied to the reference; None where not asked for."""

    time: TimeOffset | None = None  # added to the reference's stamps
    # how much more the estimate's heading reads than the reference's, clockwise seen from above, rad
    heading: float | None = None
    mounting: Floats | None = None  # (4,), rotation q_re from the estimate's body axes to the reference's
    # Where mounting and heading were sought together: rms angle of the vertical, seen from the body, about its mean,
    # rad. The heading is known 1 / tilt_spread times worse than a single attitude.
    tilt_spread: float | None = None

    def apply(self, q_ref: Floats, frame: Frame) -> Floats:
        """Reference attitudes (N, 4) as the estimate should show them."""
        q = q_ref if self.mounting is None else quat_multiply(q_ref, self.mounting)
        return q if self.heading is None else turn_heading(q, self.heading, frame)


def find_heading(q_est: Floats, q_ref: Floats, frame: Frame) -> float:
    """How much more the estimate's heading reads than the reference's, clockwise seen from above, rad in [−π, π].

    Attitudes are known in every row. Headings that differ by every angle alike are refused: no constant is better.
    """
    w, _, _, z = np.moveaxis(error_quat(q_est, q_ref), -1, 0)
    sine, cosine, weight = 2.0 * float(w @ z), float(w @ w - z @ z), float(w @ w + z @ z)
    if not np.hypot(sine, cosine) > _MIN_CONCENTRATION * weight:
        raise ShapeError("no constant heading offset fits: the heading differences are spread over the full circle.")
    return float(-frame.up[2] * np.arctan2(sine, cosine))


def find_mounting(q_est: Floats, q_ref: Floats) -> Floats:
    """Rotation q_re (4,) from the estimate's body axes to the reference's; attitudes (N, 4) with a common heading."""
    return quat_mean(quat_multiply(quat_conjugate(q_ref), q_est))


def find_mounting_and_heading(q_est: Floats, q_ref: Floats, frame: Frame) -> Alignment:
    """Both constants at once; a body that only turns about the vertical does not separate them, and is refused."""
    spread = tilt_spread(q_ref, frame)
    if spread < MIN_TILT_SPREAD:
        raise ParameterError(
            f"mounting and heading cannot be separated: the reference's tilt varies by {to_deg(spread):.2g}° rms, "
            f"but {to_deg(MIN_TILT_SPREAD):.2g}° are needed. Align one of them, or record a motion that tilts."
        )
    heading = _best_heading(q_est, q_ref, frame)
    mounting = find_mounting(q_est, turn_heading(q_ref, heading, frame))
    return Alignment(heading=heading, mounting=mounting, tilt_spread=spread)


def tilt_spread(q_ref: Floats, frame: Frame) -> float:
    """Rms angle, rad, of the vertical about its mean, seen from the body: 0 for a turn about the vertical alone."""
    up_b = quat_rotate(quat_conjugate(q_ref), frame.up)
    return float(np.sqrt(np.mean(np.sum((up_b - np.mean(up_b, axis=0)) ** 2, axis=1))))


def _best_heading(q_est: Floats, q_ref: Floats, frame: Frame) -> float:
    """Heading for which the best mounting fits best.

    For a turn γ about the vertical, the best mounting is the first eigenvector of M(γ), [Markley2007] (12), and its
    eigenvalue λ(γ) the fit. M is M0 + cos γ Mc + sin γ Ms, so that λ' = vᵀ M' v, whose root is found to the last bits.
    """
    from scipy.optimize import brentq

    back = quat_conjugate(q_ref)
    a = quat_multiply(back, q_est)
    b = quat_multiply(quat_multiply(back, np.concatenate(([0.0], frame.up))), q_est)
    aa, bb, ab = (m / a.shape[0] for m in (a.T @ a, b.T @ b, a.T @ b + b.T @ a))
    m0, mc, ms = 0.5 * (aa + bb), 0.5 * (aa - bb), -0.5 * ab

    def slope(gamma: float) -> float:
        v = np.linalg.eigh(m0 + np.cos(gamma) * mc + np.sin(gamma) * ms)[1][:, -1]  # [Markley2007] (12)
        return float(v @ (np.cos(gamma) * ms - np.sin(gamma) * mc) @ v)

    grid = np.linspace(-np.pi, np.pi, _GRID, endpoint=False)
    matrices = m0 + np.cos(grid)[:, None, None] * mc + np.sin(grid)[:, None, None] * ms
    best = float(grid[np.argmax(np.linalg.eigvalsh(matrices)[:, -1])])
    cell = 2.0 * np.pi / _GRID
    return -float(brentq(slope, best - cell, best + cell, xtol=1e-15))
