"""Whole numbers out of bytes, in kernels."""

import numpy as np
from numpy.typing import NDArray

from plumbob._jit import njit


@njit
def word_at(data: NDArray[np.uint8], at: int, size: int, big: int) -> int:
    """Word of some bytes, unsigned but for the 64th bit."""
    value = 0
    for i in range(size):
        value = value << 8 | int(data[at + (i if big else size - 1 - i)])
    return value


@njit
def count_in(word: int, lowest: int, bits: int, signed: int) -> int:
    """Count of some bits of a word."""
    if bits == 64:  # in halves, for compiled whole numbers end there and Python's do not
        upper = word >> 32 & 0xFFFFFFFF
        return (upper - (1 << 32) if upper >> 31 else upper) * (1 << 32) + (word & 0xFFFFFFFF)
    value = word >> lowest & ((1 << bits) - 1)
    if signed and value >> (bits - 1):
        value -= 1 << bits
    return value
