"""The inner loops: sums along a record, and squares of its differences.

Tiles of the record outside, averaging factors inside: short factors then find all that they need in the cache. Four
factors at a time share one reading of the points, because these loops wait for reading.
"""

import numpy as np
from numpy.typing import NDArray

from plumbob.core._jit import njit, njit_reassociated
from plumbob.core.check import Floats

TILE = 4096
"""Differences that are taken for all factors before the next are. Their sum passes no more than so many roundings,
whatever order a processor adds in, and a tile of modified deviations has a running sum of its own."""


@njit
def accumulate(values: Floats, mean: float, start: float, sums: Floats) -> float:
    """Write the running sum of (values − mean) onto `start` to `sums` (N,), and return its last."""
    total = start
    for k in range(values.shape[0]):
        total += values[k] - mean
        sums[k] = total
    return total


@njit_reassociated
def moments(values: Floats, origin: float) -> tuple[float, float]:
    """Sum of (values − origin), and of their squares."""
    total = squares = 0.0
    for k in range(values.shape[0]):
        away = values[k] - origin
        total += away
        squares += away * away
    return total, squares


@njit
def _second(first: float, middle: float, last: float) -> float:
    """Second difference; each step is rounded to its own last digit, not to that of the points, and in this order."""
    return (last - middle) - (middle - first)


@njit
def _third(first: float, second: float, third: float, last: float) -> float:
    """Third difference, likewise."""
    return _second(second, third, last) - _second(first, second, third)


@njit_reassociated
def _second_square(points: Floats, n: int, start: int, stop: int) -> float:
    """Sum of (x[k + 2n] − 2 x[k + n] + x[k])² over start ≤ k < stop."""
    first, middle, last = points[start:stop], points[start + n : stop + n], points[start + 2 * n : stop + 2 * n]
    total = 0.0
    for k in range(first.shape[0]):
        difference = _second(first[k], middle[k], last[k])
        total += difference * difference
    return total


@njit_reassociated
def _third_square(points: Floats, n: int, start: int, stop: int) -> float:
    """Sum of (x[k + 3n] − 3 x[k + 2n] + 3 x[k + n] − x[k])² over start ≤ k < stop."""
    first, second = points[start:stop], points[start + n : stop + n]
    third, last = points[start + 2 * n : stop + 2 * n], points[start + 3 * n : stop + 3 * n]
    total = 0.0
    for k in range(first.shape[0]):
        difference = _third(first[k], second[k], third[k], last[k])
        total += difference * difference
    return total


@njit_reassociated
def _four_second_squares(
    points: Floats, n0: int, n1: int, n2: int, n3: int, start: int, stop: int
) -> tuple[float, float, float, float]:
    """`_second_square` at four spacings, which read their first points together."""
    first = points[start:stop]
    middle0, last0 = points[start + n0 : stop + n0], points[start + 2 * n0 : stop + 2 * n0]
    middle1, last1 = points[start + n1 : stop + n1], points[start + 2 * n1 : stop + 2 * n1]
    middle2, last2 = points[start + n2 : stop + n2], points[start + 2 * n2 : stop + 2 * n2]
    middle3, last3 = points[start + n3 : stop + n3], points[start + 2 * n3 : stop + 2 * n3]
    total0 = total1 = total2 = total3 = 0.0
    for k in range(first.shape[0]):
        difference0 = _second(first[k], middle0[k], last0[k])
        difference1 = _second(first[k], middle1[k], last1[k])
        difference2 = _second(first[k], middle2[k], last2[k])
        difference3 = _second(first[k], middle3[k], last3[k])
        total0 += difference0 * difference0
        total1 += difference1 * difference1
        total2 += difference2 * difference2
        total3 += difference3 * difference3
    return total0, total1, total2, total3


@njit
def second_squares_of_tile(points: Floats, n: NDArray[np.int64], start: int, stop: int, sums: Floats) -> None:
    """Add the sum of squares of those second differences at n[j] that begin at start ≤ k < stop; n must increase."""
    fours = n.shape[0] - n.shape[0] % 4
    for j in range(0, fours, 4):
        shared = max(start, min(stop, points.shape[0] - 2 * n[j + 3]))
        if shared > start:
            a, b, c, d = _four_second_squares(points, n[j], n[j + 1], n[j + 2], n[j + 3], start, shared)
            sums[j] += a
            sums[j + 1] += b
            sums[j + 2] += c
            sums[j + 3] += d
        for i in range(j, j + 3):
            own = min(stop, points.shape[0] - 2 * n[i])
            if own > shared:
                sums[i] += _second_square(points, n[i], shared, own)
    for j in range(fours, n.shape[0]):
        own = min(stop, points.shape[0] - 2 * n[j])
        if own > start:
            sums[j] += _second_square(points, n[j], start, own)


@njit
def second_squares(points: Floats, n: NDArray[np.int64], sums: Floats) -> None:
    """Add the sum of squares of all second differences at spacing n[j] to sums[j]; n must increase."""
    for start in range(0, points.shape[0], TILE):
        second_squares_of_tile(points, n, start, start + TILE, sums)


@njit
def third_squares(points: Floats, n: NDArray[np.int64], sums: Floats) -> None:
    """Add the sum of squares of all third differences at spacing n[j] to sums[j]."""
    for start in range(0, points.shape[0], TILE):
        for j in range(n.shape[0]):
            stop = min(start + TILE, points.shape[0] - 3 * n[j])
            if stop > start:
                sums[j] += _third_square(points, n[j], start, stop)


@njit
def modified_squares(angle: Floats, n: NDArray[np.int64], sums: Floats) -> None:
    """Add the sum of squares of all means of n neighbouring second differences of θ at spacing n to sums[j], n = n[j].

    They are third differences of the running sum of θ, over n. That of a long record is large enough for its rounding
    to show at small n, so these take a running sum of their own tile, about a line, which third differences do not
    see.
    """
    whole, tile = np.zeros(angle.shape[0] + 1), np.zeros(2 * TILE + 1)
    accumulate(angle, float(np.mean(angle)), 0.0, whole[1:])
    for start in range(0, angle.shape[0], TILE):
        _accumulate_about_line(angle[start : start + 2 * TILE], tile)
        for j in range(n.shape[0]):
            terms, square = min(TILE, whole.shape[0] - 3 * n[j] - start), float(n[j]) ** 2
            if terms > 0 and 3 * n[j] <= TILE:
                sums[j] += _third_square(tile, n[j], 0, terms) / square
            elif terms > 0:
                sums[j] += _third_square(whole, n[j], start, start + terms) / square


@njit
def _accumulate_about_line(values: Floats, sums: Floats) -> None:
    """Write the running sum of the values (N,) about their end-to-end line to sums[1 : N + 1]."""
    slope = (values[-1] - values[0]) / max(1, values.shape[0] - 1)
    total = 0.0
    for k in range(values.shape[0]):
        total += values[k] - values[0] - slope * k
        sums[k + 1] = total


@njit
def sum_accurately(values: Floats, sums: Floats) -> None:
    """Write the running sum of the values (N,) to `sums` (N + 1,), from 0, each rounded only once."""
    total = rest = 0.0
    sums[0] = 0.0
    for k in range(values.shape[0]):
        value = values[k]
        grown = total + value
        part = grown - total
        rest += (total - (grown - part)) + (value - part)  # what the addition rounded off
        total = grown
        sums[k + 1] = total + rest


@njit_reassociated
def _product(first: Floats, second: Floats) -> float:
    total = 0.0
    for k in range(first.shape[0]):
        total += first[k] * second[k]
    return total


@njit
def add_triangles(points: Floats, edge: int, sums: Floats) -> None:
    """Add Σ x[k] x[k + m] over those k < m that lie in the same block of `edge` as m does to sums[m]."""
    for m in range(sums.shape[0]):
        start = m - m % edge
        sums[m] += _product(points[start:m], points[start + m : 2 * m])
