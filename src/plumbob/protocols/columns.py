"""One field of many frames at once: its counts out of the bytes and back, and counts to values and back."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.protocols.checksum import algorithm, of_rows
from plumbob.protocols.field import Checksum, Field

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]


_ORDER: Final = {"big": ">", "little": "<"}


def counts_of(one: Field, rows: Bytes) -> Ints | Floats:
    """Counts (N,) of a field in frames (N, L): whole numbers, or floats where the wire carries floats."""
    word = rows[:, one.at : one.at + one.size]
    if one.type == "parity":
        return np.asarray(np.bitwise_count(word).sum(axis=1) & 1, dtype=np.int64)
    if one.check:
        return _holds(one.check, word)
    if one.type == "bcd":
        return _from_digits(word)
    if one.size == 3:
        parts = word.astype(np.int64)
        places = (16, 8, 0) if one.order == "big" else (0, 8, 16)
        value = sum(parts[:, i] << places[i] for i in range(3))
        return _signed(np.asarray(value), 24) if one.signed and one.bits is None else _cut(one, np.asarray(value))
    kind = one.type[0] if one.bits is None else "u"
    code = {"u": "u", "s": "i", "f": "f"}[kind]
    found = np.ascontiguousarray(word).view(f"{_ORDER[one.order]}{code}{one.size}")[:, 0]
    if code == "f":
        return found.astype(np.float64)
    return _cut(one, found.astype(np.int64))


def matches(one: Field, counts: Ints | Floats) -> Ints:
    """1 where counts (N,) of a match are as they should be, else 0."""
    mask = (1 << one.width) - 1
    return np.asarray(counts.astype(np.int64) & mask == one.value & mask, dtype=np.int64)


def _holds(check: Checksum, word: Bytes) -> Ints:
    """1 where the check of an inner frame fits; where it may be of two kinds, where one of them does."""
    kinds = ("sum16", "sum16-words-65535") if check.kind == "sum16-either" else (check.kind,)
    stop = check.stop + (word.shape[1] if check.stop <= 0 else 0)
    at = check.at + (word.shape[1] if check.at < 0 else 0)
    digits = word[:, at : at + algorithm(check.kind).size].astype(np.int64)
    powers = 256 ** np.arange(digits.shape[1])
    there = digits @ (powers[::-1] if check.order == "big" else powers)
    fits = [of_rows(kind, word[:, check.start : stop]) == there for kind in kinds]
    return np.asarray(np.any(fits, axis=0), dtype=np.int64)


def _cut(one: Field, word: Ints) -> Ints:
    if one.bits is None:
        return word
    value = np.asarray(word >> one.bits[1] & ((1 << one.width) - 1), dtype=np.int64)
    return _signed(value, one.width) if one.signed else value


def _signed(value: Ints, width: int) -> Ints:
    half = 1 << (width - 1)
    return np.asarray((value ^ half) - half)


def _from_digits(word: Bytes) -> Ints:
    """Sign nibble and five digits; minus zero is zero."""
    digits = np.stack([word >> 4, word & 15], axis=2).reshape(-1, 6).astype(np.int64)
    size = digits[:, 1:] @ np.array([10000, 1000, 100, 10, 1])
    return np.asarray(np.where(digits[:, 0] == 1, -size, size), dtype=np.int64)


def values_of(one: Field, counts: Ints | Floats) -> Floats:
    """Values (N,) in the unit used inside."""
    shifted = counts + one.raw_offset if one.raw_offset else counts
    scaled = shifted * one.scale
    return np.asarray(scaled + one.zero if one.zero else scaled, dtype=np.float64)


def counts_for(one: Field, values: Floats) -> tuple[Ints | Floats, NDArray[np.bool_]]:
    """Counts nearest to values in the unit used inside, and which had to be cut to the range.

    Values that are not there (NaN) become the count for "beyond the range" where the format has one, else 0.
    """
    exact = (values - one.zero) / one.scale - one.raw_offset
    if one.type[0] == "f":
        return exact, np.zeros(exact.shape, dtype=bool)
    low, high = one.range or one.clip or one.limits
    missing = np.isnan(exact)
    if one.wrap:
        nearest = np.rint(np.where(np.isfinite(exact), exact, 0)).astype(np.int64)
        return (nearest - low) % (high - low + 1) + low, np.zeros(exact.shape, dtype=bool)
    nearest = np.rint(np.where(missing, one.overflow[0] if one.overflow else 0, np.clip(exact, low, high)))
    return nearest.astype(np.int64), (exact < low) | (exact > high)


def put(one: Field, rows: Bytes, counts: Ints | Floats) -> None:
    """Write counts (N,) into their place in frames (N, L); other bits of the word stay."""
    word = rows[:, one.at : one.at + one.size]
    if one.type == "bcd":
        word[:] = _to_digits(np.asarray(counts, dtype=np.int64))
    elif one.type[0] == "f":
        packed = np.asarray(counts, dtype=f"{_ORDER[one.order]}f{one.size}")
        word[:] = packed.view(np.uint8).reshape(-1, one.size)
    else:
        low = 0 if one.bits is None else one.bits[1]
        whole = np.asarray(counts, dtype=np.int64).astype(np.uint64)
        mask = np.uint64((1 << one.width) - 1)
        _merge(one, word, (whole & mask) << np.uint64(low), mask << np.uint64(low))


def _merge(one: Field, word: Bytes, value: NDArray[np.uint64], mask: np.uint64) -> None:
    for i in range(one.size):
        shift = np.uint64(8 * (one.size - 1 - i if one.order == "big" else i))
        keep = np.uint8(~(mask >> shift) & np.uint64(0xFF))
        word[:, i] = word[:, i] & keep | (value >> shift & np.uint64(0xFF)).astype(np.uint8)


def _to_digits(counts: Ints) -> Bytes:
    size = np.abs(counts)
    digits = np.stack([np.where(counts < 0, 1, 0), *(size // 10**k % 10 for k in (4, 3, 2, 1, 0))], axis=1)
    return np.asarray(digits[:, 0::2] << 4 | digits[:, 1::2], dtype=np.uint8)
