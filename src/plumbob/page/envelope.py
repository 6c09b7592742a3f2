"""Thin a long series for a plot so that no spike is lost: the least and the greatest value of each pixel column."""

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats


def envelope(t: Floats, y: Floats, columns: int, *, gap: float = np.inf, jump: float = np.inf) -> tuple[Floats, Floats]:
    """Points (M,) to draw instead of all N, with NaN where the line must break.

    Parameters
    ----------
    t : ndarray (N,)
        Increasing times.
    y : ndarray (N,)
        Values; NaN where not known.
    columns : int
        Pixel columns of the plot; a series of at most twice as many values is kept whole.
    gap : float
        A longer step in time breaks the line.
    jump : float
        A larger step in value breaks the line: the wrap of an angle is no motion.
    """
    rows = np.flatnonzero(np.isfinite(y))
    if not rows.size:
        return np.empty(0), np.empty(0)
    t, y = t[rows], y[rows]
    begins = np.zeros(rows.size, dtype=bool)
    begins[1:] = (np.diff(rows) > 1) | (np.diff(t) > gap) | (np.abs(np.diff(y)) > jump)
    if rows.size <= 2 * columns:
        return _with_breaks(t, y, begins)
    width = (t[-1] - t[0]) / columns
    if np.count_nonzero(begins) > columns:  # more holes than pixels: only those that can be seen break the line
        begins[1:] &= np.diff(t) > width
    keep, first = _extremes(np.minimum(np.floor((t - t[0]) / width), columns - 1.0), y, begins)
    return _with_breaks(t[keep], y[keep], first)


def _extremes(column: Floats, y: Floats, begins: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Rows of the least and greatest value of each run in one column, in order of time, and which begin a line."""
    opens = begins.copy()
    opens[1:] |= np.diff(column) > 0.0
    opens[0] = True
    group = np.cumsum(opens) - 1
    by_value = np.lexsort((y, group))
    starts = np.flatnonzero(opens)
    ends = np.append(starts[1:], y.size) - 1
    pairs = np.sort(np.stack((by_value[starts], by_value[ends]), axis=1), axis=1)
    fresh = np.zeros_like(pairs, dtype=bool)
    fresh[:, 0] = begins[starts]
    single = pairs[:, 0] == pairs[:, 1]
    use = np.stack((np.ones_like(single), ~single), axis=1)
    return pairs[use], fresh[use]


def _with_breaks(t: Floats, y: Floats, begins: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    places = np.flatnonzero(begins)
    return np.insert(t, places, t[places]), np.insert(y, places, np.nan)


def runs(t: Floats, mask: NDArray[np.bool_], columns: int) -> list[tuple[float, float]]:
    """Stretches (start, length) of time over which the mask (N,) holds; those narrower than a column are left out.

    A stretch ends where the next sample begins, so that neighbours meet.
    """
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    start, stop = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    until = np.append(t[1:], t[-1])[stop - 1]
    length = until - t[start]
    wide = length >= (t[-1] - t[0]) / columns
    return [(float(a), float(n)) for a, n in zip(t[start[wide]], length[wide], strict=True)]
