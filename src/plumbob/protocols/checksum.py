"""Checks of frames: sums, exclusive or, Fletcher, cyclic redundancy; for one frame in a kernel and for many at once."""

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import DecodeError, unknown_name
from plumbob.core.kernels import kernel

Bytes = NDArray[np.uint8]

SUM8: Final = 1
SUM8_ZERO: Final = 2
XOR8: Final = 3
SUM16: Final = 4
SUM16_WORDS: Final = 5
SUM16_EITHER: Final = 6
FLETCHER16: Final = 7
CRC: Final = 8
SUM16_REST: Final = 9


class Algorithm(NamedTuple):
    """One way to check."""

    code: int  # family
    width: int  # bits of the check
    # polynomial, start, final: of a cyclic redundancy check: generator, first remainder, and what the last is combined
    # with
    polynomial: int = 0
    start: int = 0
    final: int = 0
    reflected: bool = False  # whether bits go lowest first
    meaning: str = ""  # in words

    @property
    def size(self) -> int:
        """Bytes of the check."""
        return self.width // 8


KINDS: Final = {
    "sum8": Algorithm(SUM8, 8, meaning="low byte of the sum of the bytes"),
    "sum8-zero": Algorithm(SUM8_ZERO, 8, meaning="byte that makes the sum of all zero, modulo 256"),
    "xor8": Algorithm(XOR8, 8, meaning="exclusive or of the bytes"),
    "sum16": Algorithm(SUM16, 16, meaning="sum of the bytes, modulo 65536"),
    "sum16-words": Algorithm(SUM16_WORDS, 16, meaning="sum of big-endian 16-bit words, modulo 65536"),
    "sum16-words-65535": Algorithm(SUM16_REST, 16, meaning="sum of big-endian 16-bit words, modulo 65535"),
    "sum16-either": Algorithm(SUM16_EITHER, 16, meaning="sum of bytes or of words, whichever the first frames show"),
    "fletcher16": Algorithm(FLETCHER16, 16, meaning="two running sums modulo 256, the first byte first"),
    "crc8": Algorithm(CRC, 8, 0x07, meaning="CRC-8, polynomial 07"),
    "crc16-ccitt-false": Algorithm(CRC, 16, 0x1021, 0xFFFF, meaning="CRC-16, polynomial 1021, start FFFF"),
    "crc16-xmodem": Algorithm(CRC, 16, 0x1021, 0x0000, meaning="CRC-16, polynomial 1021, start 0"),
    "crc16-aug-ccitt": Algorithm(CRC, 16, 0x1021, 0x1D0F, meaning="CRC-16, polynomial 1021, start 1D0F"),
    "crc16-kermit": Algorithm(CRC, 16, 0x1021, 0, 0, True, "CRC-16, polynomial 1021 reflected, start 0"),
    "crc16-mcrf4xx": Algorithm(CRC, 16, 0x1021, 0xFFFF, 0, True, "CRC-16, polynomial 1021 reflected, start FFFF"),
    "crc16-modbus": Algorithm(CRC, 16, 0x8005, 0xFFFF, 0, True, "CRC-16, polynomial 8005 reflected, start FFFF"),
    # [IEEE8023]
    "crc32": Algorithm(CRC, 32, 0x04C11DB7, 0xFFFFFFFF, 0xFFFFFFFF, True, "CRC-32 as in Ethernet and zlib"),
}


def algorithm(kind: str) -> Algorithm:
    """Look a check up by its name."""
    if kind not in KINDS:
        raise unknown_name("checksum.kind", kind, KINDS, error=DecodeError)
    return KINDS[kind]


@cache
def table(kind: str) -> NDArray[np.int64]:
    """Remainders (256,) of every byte, for a cyclic redundancy check; zeros for others."""
    how = algorithm(kind)
    remainders = np.zeros(256, dtype=np.int64)
    if how.code == CRC:
        remainders[:] = [_remainder(byte, how) for byte in range(256)]
    remainders.flags.writeable = False
    return remainders


def _remainder(byte: int, how: Algorithm) -> int:
    mask = (1 << how.width) - 1
    if how.reflected:
        generator = int(f"{how.polynomial:0{how.width}b}"[::-1], 2)
        value = byte
        for _ in range(8):
            value = (value >> 1) ^ (generator if value & 1 else 0)
        return value
    value = byte << (how.width - 8)
    for _ in range(8):
        value = (value << 1) ^ (how.polynomial if value >> (how.width - 1) & 1 else 0)
    return value & mask


def of_rows(kind: str, rows: Bytes) -> NDArray[np.int64]:
    """Check (N,) of the covered bytes (N, L) of many frames."""
    how = algorithm(kind)
    wide = rows.astype(np.int64)
    if how.code in (SUM8, SUM16, SUM16_EITHER):
        return np.asarray(wide.sum(axis=1) & ((1 << how.width) - 1))
    if how.code == SUM8_ZERO:
        return np.asarray(-wide.sum(axis=1) & 0xFF)
    if how.code == XOR8:
        return np.asarray(np.bitwise_xor.reduce(wide, axis=1))
    if how.code in (SUM16_WORDS, SUM16_REST):
        words = 256 * wide[:, 0::2].sum(axis=1) + wide[:, 1::2].sum(axis=1)
        return np.asarray(words % (65535 if how.code == SUM16_REST else 65536))
    if how.code == FLETCHER16:
        running = np.cumsum(wide, axis=1) & 0xFF  # [Fletcher1982]
        return np.asarray(running[:, -1] << 8 | running.sum(axis=1) & 0xFF)
    return _crc_of_rows(how, table(kind), wide)


def _crc_of_rows(how: Algorithm, remainders: NDArray[np.int64], wide: NDArray[np.int64]) -> NDArray[np.int64]:
    value = np.full(wide.shape[0], how.start, dtype=np.int64)
    for column in wide.T:
        if how.reflected:
            value = (value >> 8) ^ remainders[(value ^ column) & 0xFF]
        else:
            value = (value << 8 & ((1 << how.width) - 1)) ^ remainders[(value >> (how.width - 8) ^ column) & 0xFF]
    return np.asarray(value ^ how.final)


@kernel
def plain_sum(data: Bytes, start: int, stop: int) -> int:
    """Sum of bytes."""
    total = 0
    for i in range(start, stop):
        total += int(data[i])
    return total


@kernel
def word_sum(data: Bytes, start: int, stop: int) -> int:
    """Sum of big-endian 16-bit words."""
    total = 0
    high = True
    for i in range(start, stop):
        total += int(data[i]) * 256 if high else int(data[i])
        high = not high
    return total


@kernel
def exclusive_or(data: Bytes, start: int, stop: int) -> int:
    """Exclusive or of bytes."""
    value = 0
    for i in range(start, stop):
        value ^= int(data[i])
    return value


@kernel
def fletcher(data: Bytes, start: int, stop: int) -> int:
    """Two running sums modulo 256."""
    first, second = 0, 0
    for i in range(start, stop):
        first = (first + int(data[i])) & 0xFF
        second = (second + first) & 0xFF  # [Fletcher1982]
    return first << 8 | second


@kernel
def cyclic(
    data: Bytes,
    start: int,
    stop: int,
    remainders: NDArray[np.int64],
    width: int,
    value: int,
    final: int,
    reflected: int,
) -> int:
    """Cyclic redundancy check, `value` being the first remainder."""
    if reflected:
        for i in range(start, stop):
            value = (value >> 8) ^ remainders[(value ^ int(data[i])) & 0xFF]
    else:
        mask = (1 << width) - 1
        for i in range(start, stop):
            value = (value << 8 & mask) ^ remainders[(value >> (width - 8) ^ int(data[i])) & 0xFF]
    return value ^ final
