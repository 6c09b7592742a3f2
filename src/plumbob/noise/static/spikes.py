"""Single samples far off both neighbours, as errors of transmission leave them."""

import math
from typing import Final

import numpy as np

from plumbob._jit import njit
from plumbob.check import Floats

FAR: Final = 9.0
"""Distance from the median of three samples beyond which a sample is a spike, in standard deviations of white noise
with the same second differences."""

_CELL: Final = 256


@njit
def distances(x: Floats, typical: Floats, largest: Floats, place: Floats) -> None:
    """Distances of samples from the median of themselves and their neighbours, for each cell.

    Parameters
    ----------
    x : ndarray (n,)
        Samples; the first and the last are neighbours only.
    typical, largest, place : ndarray (cells,)
        Standard deviation of white noise with the same second differences; largest distance, and where that is in x.
    """
    for i in range(typical.shape[0]):
        cell = x[i * _CELL : i * _CELL + _CELL + 2]
        total, most, where = 0.0, -1.0, 0
        for k in range(_CELL):
            a, b, c = cell[k], cell[k + 1], cell[k + 2]
            off = abs(b - max(min(a, b), min(max(a, b), c)))
            total += (a - 2.0 * b + c) ** 2
            if off > most:
                most, where = off, k + 1
        typical[i] = math.sqrt(total / (6.0 * _CELL))
        largest[i] = most
        place[i] = i * _CELL + where


class Spikes:
    """Watches one channel, block by block; of a cell of 256 samples it keeps the typical distance and the largest."""

    def __init__(self) -> None:
        self._rest = np.empty(0)
        self._typical: list[Floats] = []
        self._largest: list[Floats] = []
        self._place: list[Floats] = []
        self._cells = 0

    def add(self, samples: Floats) -> None:
        """Take the next samples (n,), all finite."""
        x = np.append(self._rest, samples)
        cells = max(0, x.size - 2) // _CELL
        typical, largest, place = np.empty(cells), np.empty(cells), np.empty(cells)
        distances(x, typical, largest, place)
        self._typical.append(typical)
        self._largest.append(largest)
        self._place.append(self._cells * _CELL + place)
        self._cells += cells
        self._rest = x[cells * _CELL :].copy()

    def found(self, least: float) -> list[int]:
        """Indices of spikes farther off than `least`, at most one of a cell."""
        if not self._cells:
            return []
        largest = np.concatenate(self._largest)
        typical = float(np.median(np.concatenate(self._typical)))
        return [int(i) for i in np.concatenate(self._place)[largest > max(FAR * typical, least)]]
