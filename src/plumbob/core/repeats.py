"""Rows that were sent twice: a transport that repeats a block gives the same times and the same values again."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel

REMEMBERED: Final = 128
"""Rows that are known again: more than a second at 100 Hz."""
_PRIME: Final = np.uint64(0x100000001B3)  # of the 64-bit FNV hash: draft-eastlake-fnv-21, section 5
_HALF: Final = np.uint64(32)


class Repeats:
    """Knows the last rows of a stream, however it is cut.

    The rows must hold a time or a count: what merely stays the same was not sent twice.
    """

    def __init__(self) -> None:
        self._known = np.zeros(REMEMBERED, dtype=np.uint64)
        self._count = np.zeros(1, dtype=np.int64)

    def fresh(self, rows: Floats) -> NDArray[np.bool_]:
        """Mark the next rows (N, …) that are not among the last ones, bit by bit: NaN is equal to NaN."""
        fresh, bits = np.empty(len(rows), dtype=bool), np.ascontiguousarray(rows, dtype=np.float64).view(np.uint64)
        key = np.zeros(len(rows), dtype=np.uint64)
        for column in bits.T:  # the digits of a short number are in its upper half, and a product carries upwards only
            key = (key ^ column ^ (column >> _HALF)) * _PRIME
        _mark(self._known, self._count, key, fresh)
        return fresh


@kernel
def _mark(
    ring: NDArray[np.uint64], count: NDArray[np.int64], keys: NDArray[np.uint64], fresh: NDArray[np.bool_]
) -> None:  # fmt: skip
    for i in range(keys.size):
        fresh[i] = True
        for k in range(min(count[0], ring.size)):
            if ring[k] == keys[i]:
                fresh[i] = False
        if fresh[i]:
            ring[count[0] % ring.size] = keys[i]
            count[0] += 1
