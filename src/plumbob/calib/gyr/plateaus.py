"""Stretches of constant rate in a session on a rate table, and which nominal rate each of them is."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calib.still import BLOCK
from plumbob.check import Floats
from plumbob.units import dps

LEAST: Final = 2.0
"""Shortest plateau, s, its first and last block not counted."""

NEAR: Final = 0.1
"""Largest departure from a nominal rate, of that rate; at rest, of the lowest rate."""

_STEP = float(dps(0.05))  # from block to block beyond noise, rad/s: a ramp of 0.2 °/s² and more is none
_RIPPLE = 1e-3  # of the rate, which a table may waver by
_ASTRAY = 0.2  # rate about another axis, of that about the main one: 11° of tilt
_FEWEST = 4


class Matched(NamedTuple):
    """Rates (M, 3), rad/s, of plateaus, and which of the M have one at all; others are zero."""

    rate: Floats
    found: NDArray[np.bool_]


def plateaus(t: Floats, gyr: Floats, *, least: float = LEAST) -> list[slice]:
    """Stretches of constant rate, in order; a slow drift away from it ends one.

    Blocks of a quarter of a second are compared by their means. The first and the last block of a stretch are left out,
    for a ramp may reach into them.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    gyr : ndarray (N, 3)
        Rates, rad/s; a row with NaN is in no stretch.
    least : float
        Shortest stretch, s.
    """
    step = float(np.median(np.diff(t))) if t.size > 1 else BLOCK
    size = max(_FEWEST, round(BLOCK / step))
    count = t.size // size
    blocks = gyr[: count * size].reshape(count, size, 3)
    mean, scatter = blocks.mean(axis=1), blocks.std(axis=1, ddof=1).max(axis=1)
    known = scatter[np.isfinite(scatter)]
    if known.size == 0:
        return []
    limit = _STEP + 6.0 * float(np.median(known)) / np.sqrt(size) + _RIPPLE * np.abs(mean).max(axis=1)
    with np.errstate(invalid="ignore"):
        joined = np.abs(np.diff(mean, axis=0)).max(axis=1) <= np.fmin(limit[1:], limit[:-1])
    runs = np.split(np.arange(count), np.flatnonzero(~joined) + 1)
    need = max(1, round(least / (size * step)))
    inner = (_constant(run, mean, limit)[1:-1] for run in runs if run.size >= need + 2)
    return [slice(int(run[0]) * size, int(run[-1] + 1) * size) for run in inner if run.size >= need]


def match_rates(means: Floats, nominal: Floats) -> Matched:
    """Tell which of the nominal rates each plateau is: about the axis that turns most, either way round, or at rest.

    What most plateaus read about an axis is taken for its bias, so that a session must spin about each axis in less
    than half of its plateaus, or both ways round alike.

    Parameters
    ----------
    means : ndarray (M, 3)
        Mean rates, rad/s, bias included.
    nominal : ndarray (k,)
        Rates of the table regardless of the sign, rad/s; rest is always one.
    """
    rate, found = np.zeros_like(means), np.zeros(len(means), dtype=np.bool_)
    known = np.unique(np.append(np.abs(nominal), 0.0))
    if len(means) == 0 or known.size < 2:
        return Matched(rate, found)
    turned = means - np.median(means, axis=0)
    rows, axis = np.arange(len(means)), np.argmax(np.abs(turned), axis=1)
    signed = turned[rows, axis]
    nearest = known[np.argmin(np.abs(np.abs(signed)[:, np.newaxis] - known), axis=1)]
    room = np.where(nearest > 0.0, nearest, known[1])
    astray = np.sort(np.abs(turned), axis=1)[:, 1]
    found = (np.abs(np.abs(signed) - nearest) <= NEAR * room) & (astray <= _ASTRAY * room)
    rate[rows, axis] = np.where(found, np.sign(signed) * nearest, 0.0)
    return Matched(rate, found)


def _constant(run: NDArray[np.intp], mean: Floats, limit: Floats) -> NDArray[np.intp]:
    """Longest part of a run of blocks that stays at the run's median."""
    near = np.abs(mean[run] - np.median(mean[run], axis=0)).max(axis=1) <= limit[run]
    parts = np.split(run, np.flatnonzero(np.diff(near)) + 1)
    kept = [part for part in parts if near[part[0] - run[0]]]
    return max(kept, key=len, default=run[:0])
