"""Runs of marked places in a row."""

import numpy as np
from numpy.typing import NDArray


def runs(marks: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First place and the one after the last of each run of marked places (N,), in order."""
    edges = np.flatnonzero(np.diff(marks.astype(np.int8), prepend=0, append=0))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
