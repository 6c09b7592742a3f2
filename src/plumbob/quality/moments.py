"""Moments of how a vector turns and of how the rates say it turns, from which every arrangement is scored.

Gravity and the Earth's field stand still while the body turns, so in the axes of their sensor they change by
``du/dt = (u − h) × (K ω + β)``: u what the sensor measures, h its offset, ω the measured rates, K the gyroscope's axes
and scale in those of the sensor, β the bias of the rates there. Both sides are integrated over time and averaged over
windows, so nothing is differentiated, and turns may be as large as they like. All terms are products of sixteen
scalars: ``u_l ω_j`` (9), ``u`` (3), ``ω`` (3) and 1. With the change of u (3) they make nineteen, and their Gram matrix
over a block of time is all that the 48 arrangements, the scale, the biases and the offset need.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.rotations import every_axes

BIN: Final = 0.02
"""Step of the even grid on which rates and vectors are averaged, s."""
SCALARS: Final = 19
FREE: Final = 10
"""Parameters of one arrangement: the scale, three biases of the rates, three offsets, three constants."""

_LONGEST_STEP: Final = 0.3
_LEVI_CIVITA = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _LEVI_CIVITA[_i, _j, _k], _LEVI_CIVITA[_k, _j, _i] = 1.0, -1.0

_TURNED: Final = np.array([c for c in every_axes() if np.linalg.det(c) > 0.0])
ARRANGEMENTS: Final = np.concatenate((_TURNED, -_TURNED))
"""Every arrangement (48, 3, 3) of the rates in the sensor's axes: the right-handed ones, then their negatives."""


@dataclass(frozen=True)
class Grid:
    """Means over even bins of time.

    Attributes
    ----------
    t : ndarray (N,)
        Middle of each bin, s.
    rate, vector : ndarray (N, 3)
        Rates and vector; NaN where the sensor has no samples.
    """

    t: Floats
    rate: Floats
    vector: Floats


def means(t: Floats, values: Floats, edges: Floats) -> Floats:
    """Mean of samples, taken as straight lines from one to the next, between edges (N + 1,); NaN in pauses."""
    finite = np.isfinite(values).all(axis=1)
    t, values = t[finite], values[finite]
    if t.size < 2:
        return np.full((edges.size - 1, values.shape[1]), np.nan)
    step = np.diff(t)
    area = np.concatenate(
        (np.zeros((1, values.shape[1])), np.cumsum(0.5 * (values[1:] + values[:-1]) * step[:, np.newaxis], axis=0))
    )
    at = np.clip(np.searchsorted(t, edges, side="right") - 1, 0, t.size - 2)
    into = (edges - t[at])[:, np.newaxis]
    slope = (values[at + 1] - values[at]) / step[at, np.newaxis]
    there = area[at] + values[at] * into + 0.5 * slope * into * into
    mean = np.diff(there, axis=0) / np.diff(edges)[:, np.newaxis]
    longest = max(_LONGEST_STEP, 3.0 * float(np.median(step)))
    broken = np.concatenate(([0], np.cumsum(step > longest)))
    bad = (step[at] > longest)[:-1] | (step[at] > longest)[1:] | (np.diff(broken[at]) > 0)
    bad |= (edges[:-1] < t[0]) | (edges[1:] > t[-1])
    mean[bad] = np.nan
    return np.asarray(mean)


def grid(t: Floats, gyr: Floats, vector: Floats, *, delay: float = 0.0, step: float = BIN) -> Grid:
    """Rates and a vector that is `delay` late, s, on one even grid of the rates' time.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    gyr, vector : ndarray (N, 3)
        Samples; rows with NaN do not count.
    delay : float
        By how much the vector's stamps are late, s.
    step : float
        Of the grid, s.
    """
    edges = np.arange(t[0], t[-1] + step, step)
    return Grid(0.5 * (edges[1:] + edges[:-1]), means(t, gyr, edges), means(t, vector, edges + delay))


def windows(at: Grid, size: int, block: int, shift: int = 0) -> Floats:
    """Gram matrices (blocks, 19, 19) of the scalars, with the rates moved by whole bins.

    Parameters
    ----------
    at : Grid
        Rates and vector.
    size : int
        Bins of a window; the change is that from one window to the next.
    block : int
        Windows of a block.
    shift : int
        Bins by which the vector is later than the rates.
    """
    rows = scalars(at, size, shift)
    rows = (
        rows[: rows.shape[0] // block * block]
        if rows.shape[0] >= block
        else np.concatenate((rows, np.zeros((block - rows.shape[0], SCALARS))))
    )
    cut = rows.reshape(-1, block, SCALARS)
    return np.asarray(np.swapaxes(cut, 1, 2) @ cut)


def scalars(at: Grid, size: int, shift: int = 0) -> Floats:
    """Scalars of each pair of neighbouring windows (n, 19), weighted; rows that a pause or an outlier spoils are 0."""
    rate, u = at.rate, at.vector
    if shift > 0:
        rate, u = rate[:-shift], u[shift:]
    elif shift < 0:
        rate, u = rate[-shift:], u[:shift]
    count = u.shape[0] // size
    if count < 2:
        return np.zeros((0, SCALARS))
    rate, u = rate[: count * size], u[: count * size]
    finite = np.asarray(np.isfinite(rate).all(axis=1) & np.isfinite(u).all(axis=1))
    rate, u = np.where(finite[:, np.newaxis], rate, 0.0), np.where(finite[:, np.newaxis], u, 0.0)
    products = (u[:, :, np.newaxis] * rate[:, np.newaxis, :]).reshape(-1, 9)
    terms = np.concatenate((products, u, rate, np.ones((u.shape[0], 1))), axis=1).reshape(count, size, 16)
    # The integral from the mean instant of one window to that of the next weighs the terms by a triangle.
    rise = (np.arange(size) + 0.5) / size * BIN
    up, down = np.einsum("s,nsk->nk", rise, terms[:-1]), np.einsum("s,nsk->nk", rise[::-1], terms[1:])
    mean = u.reshape(count, size, 3).mean(axis=1)
    complete = np.asarray(finite.reshape(count, size).all(axis=1))
    row = np.concatenate((up + down, np.diff(mean, axis=0)), axis=1)
    row[~(complete[1:] & complete[:-1])] = 0.0
    return np.asarray(row)


def designs() -> Floats:
    """What the parameters of each arrangement and the change weigh of the scalars, (48, 3, 11, 19).

    Axes: arrangement; component of the change; scale, three biases, three offsets times the scale, three constants, and
    the change itself; scalars.
    """
    made = np.zeros((len(ARRANGEMENTS), 3, FREE + 1, SCALARS))
    products = np.arange(9).reshape(3, 3)
    for n, w in enumerate(ARRANGEMENTS):
        for c in range(3):
            for a in range(3):
                for b in range(3):
                    e = _LEVI_CIVITA[c, a, b]
                    if e:
                        made[n, c, 0, products[a]] += e * w[b]  # u × W ω
                        made[n, c, 1 + b, 9 + a] += e  # u × β
                        made[n, c, 4 + a, 12:15] -= e * w[b]  # −h × W ω
            made[n, c, 7 + c, 15] = 1.0
            made[n, c, 10, 16 + c] = 1.0
    return made


def solved(a: Floats, b: Floats) -> Floats:
    """Solutions of normal equations (…, n, n) x = (…, n, k), whose unknowns may differ by many orders of size.

    Each unknown is scaled by its own diagonal first, and held by a part in 10¹² of it: one that nothing shows stays 0
    where the plain solution would end in a singular matrix.
    """
    size = np.sqrt(np.maximum(np.diagonal(a, axis1=-2, axis2=-1), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    scaled = a / (size[..., :, np.newaxis] * size[..., np.newaxis, :]) + 1e-12 * np.eye(a.shape[-1])
    return np.asarray(np.linalg.solve(scaled, b / size[..., np.newaxis]) / size[..., np.newaxis])
