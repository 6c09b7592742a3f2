"""The inner loop of `plumbob.noise.likelihood`: Fisher scoring, compiled, for one record asks for thousands of steps.

Bins are taken as whole arrays and parameters one by one, so that it is fast enough as plain Python too.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core._jit import njit, njit_reassociated
from plumbob.core.check import Floats
from plumbob.noise.spectrum import MarkovBins, markov_density

_ROUNDS: Final = 100
_SMALL_STEP: Final = 1e-5
_ABSENT: Final = 1e-10  # share of the density below which a term counts as absent
_AHEAD: Final = 1e-4  # in the logarithm of a correlation time, for a slope by differences


class Bins(NamedTuple):
    """What a likelihood needs of a spectrum of m bins.

    Attributes
    ----------
    rows : ndarray (r, m)
        Densities of the random terms for coefficients of 1.
    terms, power, cross, ramp : ndarray (m,)
        As in `plumbob.noise.spectrum.Spectrum`.
    process : MarkovBins
        For the density of a Gauss–Markov process.
    """

    rows: Floats
    terms: Floats
    power: Floats
    cross: Floats
    ramp: Floats
    process: MarkovBins


class Point(NamedTuple):
    """Logarithms of coefficients (p,), and what the likelihood is there; `evaluate` fills it in.

    Attributes
    ----------
    logs, gradient : ndarray (p,)
        The logarithms, and the gradient of half the deviance.
    information : ndarray (p, p)
        Fisher information.
    density : ndarray (m,)
        Of the model.
    relative : ndarray (p, m)
        Derivatives of its logarithm.
    sums : ndarray (3,)
        Half the deviance; the ramp R; 1 / variance of R.
    """

    logs: Floats
    gradient: Floats
    information: Floats
    density: Floats
    relative: Floats
    sums: Floats


def point(logs: Floats, bins: int) -> Point:
    """Room for a point at `logs` (p,) in so many bins."""
    p = logs.size
    shapes = (p, (p, p), bins, (p, bins), 3)
    return Point(np.array(logs, dtype=np.float64), *(np.zeros(shape) for shape in shapes))


@njit_reassociated
def evaluate(bins: Bins, at: Point) -> float:
    """Fill in everything at `at.logs` but the information, and return half the deviance."""
    _densities(bins, at)
    density = at.density
    square = np.sum(bins.ramp / density)
    ramp = np.sum(bins.cross / density) / square
    share = (bins.power - 2.0 * ramp * bins.cross + ramp**2 * bins.ramp) / density  # [Whittle1953]
    half = 0.5 * np.sum(bins.terms * np.log(density) + share) + 0.5 * math.log(square)  # [Patterson1971]
    slope = 0.5 * (bins.terms - share - bins.ramp / density / square)
    for k in range(at.logs.shape[0]):
        at.gradient[k] = np.sum(at.relative[k] * slope)
    at.sums[0], at.sums[1], at.sums[2] = half, ramp, square
    return float(half)


@njit_reassociated
def _densities(bins: Bins, at: Point) -> None:
    """Density and its relative derivatives by the logarithms."""
    rows, density, relative = bins.rows, at.density, at.relative
    r = rows.shape[0]
    density[:] = 0.0
    for k in range(r):
        relative[k] = math.exp(2.0 * at.logs[k]) * rows[k]
        density[:] = density + relative[k]
        relative[k] = 2.0 * relative[k]
    if at.logs.shape[0] > r:
        power, time = math.exp(2.0 * at.logs[r]), math.exp(at.logs[r + 1])
        relative[r + 1] = 0.0
        for side in (1.0, -1.0, 0.0):
            relative[r] = power * markov_density(bins.process, time * math.exp(side * _AHEAD))
            relative[r + 1] = relative[r + 1] + side / (2.0 * _AHEAD) * relative[r]
        density[:] = density + relative[r]
        relative[r] = 2.0 * relative[r]
    for k in range(relative.shape[0]):
        relative[k] = relative[k] / density


@njit_reassociated
def inform(bins: Bins, at: Point) -> None:
    """Fill in the information of a point that is otherwise complete."""
    for i in range(at.logs.shape[0]):
        weighted = 0.5 * at.relative[i] * bins.terms
        for j in range(i + 1):
            at.information[i, j] = at.information[j, i] = np.sum(weighted * at.relative[j])


@njit
def search(bins: Bins, held: NDArray[np.bool_], start: Point, room: Point) -> Point:
    """Point of the largest likelihood by Fisher scoring with damping from `start`, the `held` (p,) where they are.

    Both points are written to, and one of them is returned.
    """
    now, trial = room, start
    free, step = np.zeros(held.shape[0], np.bool_), np.zeros(held.shape[0])
    half, moved = math.inf, 0.0
    damping, rounds = 1e-2, 0
    while damping < 1e8 and rounds <= _ROUNDS:
        if evaluate(bins, trial) <= half:  # at first where it stands
            now, trial = trial, now
            inform(bins, now)
            rounds += 1
            damping = max(damping / 10.0, 1e-9)
            gain, half = half - now.sums[0], now.sums[0]
            if not _present(bins, now, held, free) or gain < 1e-9 or 0.0 < moved < _SMALL_STEP:
                break
        else:
            damping *= 4.0
        moved = _solve(now, free, damping, step)
        for k in range(step.shape[0]):
            trial.logs[k] = now.logs[k] + step[k]
    return now


@njit
def _present(bins: Bins, now: Point, held: NDArray[np.bool_], free: NDArray[np.bool_]) -> bool:
    """Say which of those that are not held the density feels, and whether any does.

    The logarithm of a term that is not there runs away.
    """
    some = False
    for k in range(held.shape[0]):
        free[k] = not held[k] and (k >= bins.rows.shape[0] or 0.5 * np.max(now.relative[k]) > _ABSENT)
        some = some or free[k]
    return some


@njit
def _solve(now: Point, free: NDArray[np.bool_], damping: float, step: Floats) -> float:
    """Step of the free parameters, by elimination in the damped information, and its largest part; none is above 1."""
    p = free.shape[0]
    matrix = now.information.copy()
    largest = 0.0
    for k in range(p):
        step[k] = -now.gradient[k] if free[k] else 0.0
        largest = max(largest, matrix[k, k] if free[k] else 0.0)
    for k in range(p):
        matrix[k, k] += damping * matrix[k, k] + 1e-12 * largest
    for k in range(p):
        for i in range(k + 1, p):
            if free[k] and free[i]:
                factor = matrix[i, k] / matrix[k, k]
                step[i] -= factor * step[k]
                for j in range(k + 1, i + 1):
                    matrix[i, j] -= factor * matrix[j, k]
    for k in range(p - 1, -1, -1):
        if free[k]:
            for i in range(k + 1, p):
                if free[i]:
                    step[k] -= matrix[i, k] * step[i]
            step[k] = step[k] / matrix[k, k]
    longest = 0.0
    for k in range(p):
        step[k] = min(max(step[k], -1.0), 1.0)
        longest = max(longest, abs(step[k]))
    return longest
