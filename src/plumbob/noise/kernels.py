"""The inner loops: sums along a record, and squares of its differences.

Tiles of the record outside, averaging factors inside: short factors then find all that they need in the cache. Four
factors at a time share one reading of the points, because these loops wait for reading. Long sums are taken in two or
four lanes: one sum after the other is a chain of additions that no processor can speed up.
"""

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel, wide

# Differences that are taken for all factors before the next are; their sum passes no more roundings than that, and a
# tile of modified deviations has a running sum of its own.
TILE = 4096


@kernel
def accumulate(values: Floats, mean: float, start: float, sums: Floats) -> float:
    """Write the running sum of (values − mean) onto `start` to `sums` (N,), and return its last."""
    total = start
    for k in range(values.shape[0]):
        total += values[k] - mean
        sums[k] = total
    return total


@wide
@kernel
def moments(values: Floats, origin: float) -> tuple[float, float]:
    """Sum of (values − origin), and of their squares."""
    total = squares = others = more = 0.0
    twos = values.shape[0] - values.shape[0] % 2
    for k in range(0, twos, 2):
        away, other = values[k] - origin, values[k + 1] - origin
        total += away
        others += other
        squares += away * away
        more += other * other
    for k in range(twos, values.shape[0]):
        away = values[k] - origin
        total += away
        squares += away * away
    return total + others, squares + more


@kernel
def _second(first: float, middle: float, last: float) -> float:
    """Second difference; each step is rounded to its own last digit, not to that of the points, and in this order."""
    return (last - middle) - (middle - first)


@kernel
def _third(first: float, second: float, third: float, last: float) -> float:
    """Third difference, likewise."""
    return _second(second, third, last) - _second(first, second, third)


@wide
@kernel
def _second_square(points: Floats, n: int, start: int, stop: int) -> float:
    """Sum of (x[k + 2n] − 2 x[k + n] + x[k])² over start ≤ k < stop."""
    first, middle, last = points[start:stop], points[start + n : stop + n], points[start + 2 * n : stop + 2 * n]
    a = b = c = d = 0.0
    fours = first.shape[0] - first.shape[0] % 4
    for k in range(0, fours, 4):
        away = _second(first[k], middle[k], last[k])
        a += away * away
        away = _second(first[k + 1], middle[k + 1], last[k + 1])
        b += away * away
        away = _second(first[k + 2], middle[k + 2], last[k + 2])
        c += away * away
        away = _second(first[k + 3], middle[k + 3], last[k + 3])
        d += away * away
    for k in range(fours, first.shape[0]):
        away = _second(first[k], middle[k], last[k])
        a += away * away
    return (a + b) + (c + d)


@wide
@kernel
def _third_square(points: Floats, n: int, start: int, stop: int) -> float:
    """Sum of (x[k + 3n] − 3 x[k + 2n] + 3 x[k + n] − x[k])² over start ≤ k < stop."""
    first, second = points[start:stop], points[start + n : stop + n]
    third, last = points[start + 2 * n : stop + 2 * n], points[start + 3 * n : stop + 3 * n]
    a = b = c = d = 0.0
    fours = first.shape[0] - first.shape[0] % 4
    for k in range(0, fours, 4):
        away = _third(first[k], second[k], third[k], last[k])
        a += away * away
        away = _third(first[k + 1], second[k + 1], third[k + 1], last[k + 1])
        b += away * away
        away = _third(first[k + 2], second[k + 2], third[k + 2], last[k + 2])
        c += away * away
        away = _third(first[k + 3], second[k + 3], third[k + 3], last[k + 3])
        d += away * away
    for k in range(fours, first.shape[0]):
        away = _third(first[k], second[k], third[k], last[k])
        a += away * away
    return (a + b) + (c + d)


@kernel
def second_squares_of_tile(points: Floats, n: NDArray[np.int64], start: int, stop: int, sums: Floats) -> None:
    """Add the sum of squares of those second differences at n[j] that begin at start ≤ k < stop; n must increase."""
    for j in range(n.shape[0]):
        end = min(stop, points.shape[0] - 2 * n[j])
        if end > start:
            sums[j] += _second_square(points, n[j], start, end)


@kernel
def second_squares(points: Floats, n: NDArray[np.int64], sums: Floats) -> None:
    """Add the sum of squares of all second differences at spacing n[j] to sums[j]; n must increase."""
    for start in range(0, points.shape[0], TILE):
        second_squares_of_tile(points, n, start, start + TILE, sums)


@kernel
def third_squares(points: Floats, n: NDArray[np.int64], sums: Floats) -> None:
    """Add the sum of squares of all third differences at spacing n[j] to sums[j]."""
    for start in range(0, points.shape[0], TILE):
        for j in range(n.shape[0]):
            stop = min(start + TILE, points.shape[0] - 3 * n[j])
            if stop > start:
                sums[j] += _third_square(points, n[j], start, stop)


def modified_squares(angle: Floats, n: NDArray[np.int64], sums: Floats) -> None:
    """Add the sum of squares of all means of n neighbouring second differences of θ at spacing n to sums[j], n = n[j].

    They are third differences of the running sum of θ, over n. At small n its rounding would show, so these take a
    running sum of their own tile, about a line, which third differences do not see.
    """
    _modified_squares(angle, n, np.zeros(angle.shape[0] + 1), np.zeros(2 * TILE + 1), sums)


@kernel
def _modified_squares(angle: Floats, n: NDArray[np.int64], running: Floats, tile: Floats, sums: Floats) -> None:
    mean = 0.0
    for k in range(angle.shape[0]):
        mean += angle[k]
    mean = mean / angle.shape[0]
    accumulate(angle, mean, 0.0, running[1:])
    for start in range(0, angle.shape[0], TILE):
        _accumulate_about_line(angle[start : start + 2 * TILE], tile)
        for j in range(n.shape[0]):
            terms, square = min(TILE, running.shape[0] - 3 * n[j] - start), float(n[j]) ** 2
            if terms > 0 and 3 * n[j] <= TILE:
                sums[j] += _third_square(tile, n[j], 0, terms) / square
            elif terms > 0:
                sums[j] += _third_square(running, n[j], start, start + terms) / square


@kernel
def _accumulate_about_line(values: Floats, sums: Floats) -> None:
    """Write the running sum of the values (N,) about their end-to-end line to sums[1 : N + 1]."""
    slope = (values[-1] - values[0]) / max(1, values.shape[0] - 1)
    total = 0.0
    for k in range(values.shape[0]):
        total += values[k] - values[0] - slope * k
        sums[k + 1] = total


@kernel
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


@wide
@kernel
def _product(first: Floats, second: Floats) -> float:
    a = b = c = d = 0.0
    fours = first.shape[0] - first.shape[0] % 4
    for k in range(0, fours, 4):
        a += first[k] * second[k]
        b += first[k + 1] * second[k + 1]
        c += first[k + 2] * second[k + 2]
        d += first[k + 3] * second[k + 3]
    for k in range(fours, first.shape[0]):
        a += first[k] * second[k]
    return (a + b) + (c + d)


@kernel
def add_triangles(points: Floats, edge: int, sums: Floats) -> None:
    """Add Σ x[k] x[k + m] over those k < m that lie in the same block of `edge` as m does to sums[m]."""
    for m in range(sums.shape[0]):
        start = m - m % edge
        sums[m] += _product(points[start:m], points[start + m : 2 * m])
