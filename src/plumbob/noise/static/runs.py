"""Runs of equal samples, as a sensor leaves them that is stuck for a while, and whether the values only rise."""

import math
from typing import Final

import numpy as np

from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.noise.static.stillness import Parts

LEAST: Final = 10
"""Shorter runs are not kept."""
MARGIN: Final = 3.0
"""With a share p of equal neighbours, N independent samples have N pᴸ runs of L more equal ones; so runs three times as
long as the longest usual one, ln N / -ln p, come once in N² records."""
FEWEST_CHANGES: Final = 8
"""So many changes without one back are no noise."""

_RUN, _RISES, _FALLS, _EQUAL, _FOUND = range(5)


@njit
def follow(x: Floats, state: Floats, ends: Floats, lengths: Floats) -> None:
    """Runs of equal neighbours that end within `x`.

    Parameters
    ----------
    x : ndarray (n,)
        Samples; the first is the last of the block before.
    state : ndarray (5,)
        Length of the run that goes on, numbers of rises, falls and equal neighbours so far, and of runs found here.
    ends, lengths : ndarray (m,)
        For each run longer than `LEAST`, the index after it in x, and its samples.
    """
    run, found, rises, equal = state[0], 0, 0, 0
    for i in range(1, x.shape[0]):
        rises += x[i] > x[i - 1]  # a sum, as of noise no branch is foreseen
        if x[i] == x[i - 1]:
            run += 1.0
            equal += 1
            continue
        if run > LEAST:
            ends[found], lengths[found] = i, run
            found += 1
        run = 1.0
    state[0] = run
    state[1] += rises
    state[2] += x.shape[0] - 1 - rises - equal
    state[3] += equal
    state[4] = found


class Runs:
    """Watches one channel, block by block."""

    def __init__(self) -> None:
        self.count = 0
        self._last = np.empty(0)
        self._state = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
        self._ends: list[Floats] = []
        self._lengths: list[Floats] = []

    def add(self, samples: Floats) -> None:
        """Take the next samples (n,), all finite."""
        if not samples.size:
            return
        x = np.append(self._last, samples)
        ends = np.empty(x.size // LEAST + 1)
        lengths = np.empty_like(ends)
        follow(x, self._state, ends, lengths)
        found = int(self._state[_FOUND])
        self._ends.append(self.count - self._last.size + ends[:found])
        self._lengths.append(lengths[:found].copy())
        self.count += samples.size
        self._last = x[-1:].copy()

    @property
    def one_way(self) -> str | None:
        """How the values change, if they only do so in one way: "rises" or "falls"."""
        rises, falls = self._state[_RISES], self._state[_FALLS]
        if min(rises, falls) > 0.0 or max(rises, falls) < FEWEST_CHANGES:
            return None
        return "rises" if rises else "falls"

    def stuck(self) -> Parts:
        """Runs longer than those of noise with as many equal neighbours, as (first, end)."""
        equal = float(self._state[_EQUAL]) / max(1, self.count - 1)
        most = LEAST + (MARGIN * math.log(self.count) / -math.log(equal) if 0.0 < equal < 1.0 else 0.0)
        ends = np.append(np.concatenate([np.empty(0), *self._ends]), self.count).astype(int)
        lengths = np.append(np.concatenate([np.empty(0), *self._lengths]), self._state[_RUN]).astype(int)
        return [(int(end - length), int(end)) for end, length in zip(ends, lengths, strict=True) if length > most]
