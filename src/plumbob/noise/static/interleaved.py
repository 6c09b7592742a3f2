"""Columns that hold several channels in turn, as a file that was written number after number and read as one column."""

from typing import Final

import numpy as np

from plumbob.check import Floats

LONGEST: Final = 12
"""Channels in turn that are looked for: three sensors of three axes, temperature, and two more."""
APART: Final = 1.0
"""Standard deviation of the means of the channels over that within them from which on they are not one channel. A
sinusoid at a whole fraction of the rate, such as mains folded down, would have to be that strong to look so."""

_AS_GOOD: Final = 0.8  # of the best: the smallest number of channels
_FEWEST: Final = 50  # values of each channel


def interleaved(values: Floats) -> int:
    """How many channels seem to take turns in a record (N,); 1 where it is one.

    Means of every k-th value differ from phase to phase by more than the values within a phase scatter. Of numbers that
    tell them apart as well, such as multiples of the true one, the smallest is told.
    """
    apart = {1: APART}
    for k in range(2, LONGEST + 1):
        whole = values.size // k
        if whole < _FEWEST:
            break
        phases = values[: whole * k].reshape(whole, k)
        within = float(np.sqrt(np.mean(np.var(np.diff(phases, axis=0), axis=0)) / 2.0))  # of neighbours: without drift
        apart[k] = float(np.std(phases.mean(axis=0))) / max(within, 1e-300)
    most = max(apart.values())
    return 1 if most <= APART else next(k for k, ratio in apart.items() if ratio >= _AS_GOOD * most)
