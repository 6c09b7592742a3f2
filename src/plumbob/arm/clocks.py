"""How the clocks of units differ that share a joint: what both feel at its centre has one size at one time."""

from typing import Final, NamedTuple

import numpy as np

from plumbob.arm.geometry import CLOCK_SD, REPEATS, below, lever_matrices
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ClockError
from plumbob.data.imu import ImuData

CUT_OFF: Final = 6.0  # sizes are compared below this, Hz: strides differ least in what is slow
SEARCH: Final = 1.0  # clocks that know the date differ by less than this, s
STEP: Final = 0.08  # s between offsets to begin from: half of the period of the fastest forces compared
EVEN: Final = 3.0  # standard deviations by which an offset must explain the forces better than any other
ROUNDS: Final = 12  # of the search that begins at an offset
MOST: Final = 500  # offsets that are tried, unless the strengths of both motions say where to look
FAR: Final = 5.0  # standard deviations beyond which a difference says no more
SHORTEST: Final = 5.0  # s of motion in common
_ARM_SD, _FORCE_SD = 0.3, 0.3  # m, m/s²: what arms and differences of the sizes are of


class UnitClock(NamedTuple):
    """Clock of a unit: what its stamp s shows was at ``s + offset + drift (s − middle)`` of the first unit's, all s."""

    offset: float = 0.0
    drift: float = 0.0
    middle: float = 0.0
    sd: float = 0.0  # standard deviation against its neighbour's clock

    def corrected(self, t: Floats) -> Floats:
        """Times (N,) of the first unit's clock, s."""
        return t + self.offset + self.drift * (t - self.middle)

    def changed(self, change: Floats, sd: float) -> "UnitClock":
        """The clock with another offset, s, and drift added."""
        return self._replace(offset=self.offset + float(change[0]), drift=self.drift + float(change[1]), sd=sd)


class _Sizes:
    """Size of the force at the end of an arm, below the cut-off, over the unit's own time."""

    def __init__(self, imu: ImuData) -> None:
        gyr, acc = imu.usable("gyr"), imu.usable("acc")
        rows = np.isfinite(gyr).all(axis=1) & np.isfinite(acc).all(axis=1)
        t = imu.t[rows]
        lever = lever_matrices(t, gyr[rows][np.newaxis])[0]
        terms, every = below(np.concatenate((acc[rows][:, :, np.newaxis], lever), axis=2), t, CUT_OFF)
        self.t, self._terms = t[::every], terms

    def with_arm(self, arm: Floats) -> tuple[Floats, Floats]:
        """Sizes (N,), m/s², and how they grow with the arm (N, 3)."""
        force = self._terms[:, :, 0] + self._terms[:, :, 1:] @ arm
        size = np.linalg.norm(force, axis=1)
        return size, np.einsum("ni,nij->nj", force / size[:, np.newaxis], self._terms[:, :, 1:])


def first_offset(first: ImuData, second: ImuData, *, name: str, expected: float | None) -> float:
    """By how much the stamps of a unit must grow to be those of its neighbour's clock, s, to some 20 ms.

    Parameters
    ----------
    first, second : ImuData
        The neighbour and the unit.
    name : str
        The unit's, for messages.
    expected : float or None
        What the dates of both say, s; None where one has none: they begin anywhere.

    Raises
    ------
    ClockError
        If they have no time in common, or, without dates, the motion does not show one offset.
    """
    near_side, far_side = _Sizes(first), _Sizes(second)
    near = np.arange(-SEARCH, SEARCH + 0.5 * STEP, STEP)
    begins = _correlated(near_side, far_side) if expected is None else expected + near
    fits = [fit for begin in begins if (fit := _fit(near_side, far_side, float(begin))) is not None]
    if not fits:
        raise ClockError(
            f"'{name}' and its neighbour have less than {SHORTEST:g} s in common; do they belong together?"
        )
    best = min(fits, key=lambda fit: fit.cost)
    for rival in fits:
        if abs(rival.offset - best.offset) > STEP and _evidence(best, rival, near_side.t) < EVEN**2:
            if expected is not None:
                return expected
            raise ClockError(
                f"the clock of '{name}' may be off by {best.offset:.2f} s or by {rival.offset:.2f} s: the motion "
                "repeats itself too exactly to tell. Begin with standing still and one stamp of the foot, or record "
                "all on one clock."
            )
    return best.offset


class _Fit(NamedTuple):
    """Offset, s, mean cost, and what the sizes differ by at the first one's times (N,), NaN where one is missing."""

    offset: float
    cost: float
    off: Floats


def _evidence(best: _Fit, rival: _Fit, t: Floats) -> float:
    """By how much χ² is smaller in the stretch that tells both apart best, less where the rival is better.

    A stretch lasts as long as limbs take to repeat their motion: the next one says the same again.
    """
    spread = max(1.4826 * float(np.nanmedian(np.abs(best.off))), 1e-3)
    change = np.minimum(np.abs(rival.off) / spread, FAR) ** 2 - np.minimum(np.abs(best.off) / spread, FAR) ** 2
    compared = np.isfinite(change)
    if not compared.any():
        return 2.0 * CUT_OFF * REPEATS * (rival.cost**2 - best.cost**2) * (_FORCE_SD / spread) ** 2
    stretch = (t[compared] // REPEATS).astype(int)
    sums, counts = np.bincount(stretch - stretch.min(), change[compared]), np.bincount(stretch - stretch.min())
    means = sums[counts > 0.5 * counts.max()] / counts[counts > 0.5 * counts.max()]
    return 2.0 * CUT_OFF * REPEATS * float(means.max() - max(-means.min(), 0.0))


def _correlated(near_side: _Sizes, far_side: _Sizes) -> Floats:
    """Offsets to begin from, s: around that at which the strength of both motions looks most alike."""
    from scipy.signal import correlate

    step = 0.5 / (2.0 * CUT_OFF)
    parts = []
    for sizes in (near_side, far_side):
        t = np.arange(sizes.t[0], sizes.t[-1], step)
        moved = np.interp(t, sizes.t, np.abs(sizes.with_arm(np.zeros(3))[0] - G0))
        parts.append((t, moved - moved.mean()))
    alike = correlate(parts[0][1], parts[1][1], mode="full")
    lags = step * np.arange(1 - len(parts[1][1]), len(parts[0][1])) + parts[0][0][0] - parts[1][0][0]
    middle = lags[int(np.argmax(alike))]
    low, high = near_side.t[0] - far_side.t[-1] + SHORTEST, near_side.t[-1] - far_side.t[0] - SHORTEST
    if high - low < MOST * STEP:
        return np.arange(low, high, STEP)
    return np.asarray(middle + np.arange(-2.0 * SEARCH, 2.0 * SEARCH + 0.5 * STEP, STEP))


def _fit(near_side: _Sizes, far_side: _Sizes, begin: float) -> _Fit | None:
    """Fit of arms and offset that begins at an offset; None where too little is in common."""
    low, high = max(near_side.t[0], far_side.t[0] + begin) + STEP, min(near_side.t[-1], far_side.t[-1] + begin) - STEP
    rows = (near_side.t >= low) & (near_side.t <= high)
    if high - low < SHORTEST or np.count_nonzero(rows) < 30:
        return None
    t, x, prior = near_side.t[rows], np.zeros(8), np.array([*(_ARM_SD,) * 6, STEP, CLOCK_SD[1]])
    for _ in range(ROUNDS):
        stamps = t - begin - x[6] - x[7] * (t - 0.5 * (low + high))
        (size, slope), (others, their_slope) = near_side.with_arm(x[:3]), far_side.with_arm(x[3:6])
        change = np.interp(stamps, far_side.t, np.gradient(others, far_side.t))
        theirs = [np.interp(stamps, far_side.t, column) for column in their_slope.T]
        off = np.interp(stamps, far_side.t, others) - size[rows]
        h = np.column_stack((-slope[rows], *theirs, -change, -change * (t - 0.5 * (low + high))))
        w = 1.0 / np.sqrt(1.0 + (off / _FORCE_SD) ** 2) / _FORCE_SD**2  # of soft_l1
        normal = (h * w[:, np.newaxis]).T @ h + np.diag(prior**-2.0)
        x = x - np.linalg.solve(normal, h.T @ (w * off) + x / prior**2)
    everywhere = np.full(len(near_side.t), np.nan)
    everywhere[rows] = off
    return _Fit(begin + float(x[6]), float(np.mean(np.sqrt(1.0 + (off / _FORCE_SD) ** 2))), everywhere)
