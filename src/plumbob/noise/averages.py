"""Averages of a stream, few enough to keep: the low frequencies of a record that does not fit in memory."""

from typing import Final

import numpy as np

from plumbob.check import Floats

KEPT: Final = 1 << 19
"""So many averages are kept; at twice as many, neighbours are averaged."""


class Averager:
    """Keeps means of 1, 2, 4, … consecutive samples, as many as it takes for all of them to fit.

    Parameters
    ----------
    channels : int
        Columns of the blocks.
    kept : int
        How many means are kept at most; an even number.
    """

    def __init__(self, channels: int, kept: int = KEPT) -> None:
        self.averaged = 1
        self._means = np.empty((kept, channels))
        self._filled = 0
        self._rest = np.empty((0, channels))

    def feed(self, block: Floats) -> None:
        """Add the next samples (rows, channels)."""
        block = np.concatenate((self._rest, block))
        while True:
            room = self._means.shape[0] - self._filled
            whole = min(block.shape[0] // self.averaged, room)
            used = whole * self.averaged
            means = block[:used].reshape(whole, self.averaged, block.shape[1]).mean(axis=1)
            self._means[self._filled : self._filled + whole] = means
            self._filled += whole
            block = block[used:]
            if block.shape[0] < self.averaged:
                break
            self._halve()
        self._rest = block.copy()

    def _halve(self) -> None:
        pairs = self._means.reshape(-1, 2, self._means.shape[1]).mean(axis=1)
        self._filled = pairs.shape[0]
        self._means[: self._filled] = pairs
        self.averaged *= 2

    def values(self) -> Floats:
        """Means so far (m, channels); samples at the end that fill no mean are left out."""
        return self._means[: self._filled]
