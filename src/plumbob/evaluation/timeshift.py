"""Time offset between two attitude tracks, from how fast each says that the body turns.

The angular rate's magnitude does not depend on frames, headings or mountings, so the offset can be found before any of
them. Both tracks are read on a common grid; the normalised correlation over the samples that both know gives the offset
to a grid step, and a root search, with the reference interpolated again at each trial offset, the fraction.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ParameterError
from plumbob.core.time import to_ns
from plumbob.core.units import dps, to_dps
from plumbob.data import AttitudeTrack
from plumbob.data.reading import default_max_gap, read_at
from plumbob.rotations import quat_angle

FINEST_STEP = 0.01
"""Least grid step, s: a body's turning is sought below 50 Hz, where tracks of all rates can be compared."""

MIN_CORRELATION = 0.5
MIN_RATE_SD = dps(0.5)
"""Variation of the angular rate, rad/s, below which there is nothing to compare."""

_ENOUGH = 20  # grid steps that both tracks must know at a lag
_TIE = 1e-6
_RESOLUTION = 1e-9  # s, that of a time stamp


@dataclass(frozen=True, slots=True)
class TimeOffset:
    """A time offset and how sure it is.

    Attributes
    ----------
    offset : float
        Added to the reference's stamps, s. Positive: the estimate shows a motion later than the reference does.
    correlation : float
        Of the two angular rates at that offset.
    rival : float or None
        Correlation at the next best peak; one near `correlation` says that the motion repeats and the offset may be
        wrong by a period.
    rival_at : float or None
        Offset of it, s.
    """

    offset: float
    correlation: float
    rival: float | None = None
    rival_at: float | None = None


def find_time_offset(
    estimate: AttitudeTrack, reference: AttitudeTrack, *, max_offset: float = 1.0, max_gap: float | None = None
) -> TimeOffset:
    """Time that, added to the reference's stamps, brings its turning to the estimate's.

    Parameters
    ----------
    estimate, reference : AttitudeTrack
        Tracks of one body; frames, headings and mountings may differ.
    max_offset : float
        Largest offset sought in either direction, s.
    max_gap : float, optional
        Largest step that is bridged, s; by default each track's own, `plumbob.evaluation.associate.default_max_gap`.

    Raises
    ------
    ParameterError
        If `max_offset` is not positive, or the best match lies at its end.
    ClockError
        If the tracks share too little time or turning, or their turning does not match.
    """
    from scipy.optimize import brentq

    if not 0.0 < max_offset < np.inf:
        raise ParameterError(f"max_offset must be a positive time, but it is {max_offset} s.")
    gaps = [default_max_gap(track) if max_gap is None else max_gap for track in (estimate, reference)]
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
            f"the time offset does not settle near {coarse.offset:.4f} s: there both tracks turn most alike, but not "
            "alike enough. Align them by hand, or leave time out of align."
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
            f"{top:.2f}, but {MIN_CORRELATION} is needed. Search farther (max_offset=), or check "
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
    """Pearson correlation of a[i] and b[i − lag] for lags −most to most, over the samples where neither is NaN.

    Returns
    -------
    lags, r : ndarray (2 most + 1,)
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
