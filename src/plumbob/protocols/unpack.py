"""Numbers out of frames: all plain fields in one pass over the bytes, the others one by one, and back.

Plain is a whole number of whole bytes or of some of their bits. Decimal digits, floats, parities, inner checks, matches
and counts that stand for "beyond the range" are odd.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.protocols.checksum import algorithm, of_rows
from plumbob.protocols.field import Checksum, Field, unit_and_triad
from plumbob.protocols.format import Message

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]


_ORDER: Final = {"big": ">", "little": "<"}


def read_counts(field: Field, rows: Bytes) -> Ints | Floats:
    """Counts (N,) of a field in frames (N, L): whole numbers, or floats where the wire carries floats."""
    word = rows[:, field.at : field.at + field.size]
    if field.type == "parity":
        return np.asarray(np.bitwise_count(word).sum(axis=1) & 1, dtype=np.int64)
    if field.check:
        return _holds(field.check, word)
    if field.type == "bcd":
        return _from_digits(word)
    if field.size == 3:
        parts = word.astype(np.int64)
        places = (16, 8, 0) if field.order == "big" else (0, 8, 16)
        value = sum(parts[:, i] << places[i] for i in range(3))
        return _signed(np.asarray(value), 24) if field.signed and field.bits is None else _cut(field, np.asarray(value))
    kind = field.type[0] if field.bits is None else "u"
    code = {"u": "u", "s": "i", "f": "f"}[kind]
    words = np.ascontiguousarray(word).view(f"{_ORDER[field.order]}{code}{field.size}")[:, 0]
    if code == "f":
        return words.astype(np.float64)
    return _cut(field, words.astype(np.int64))


def matches(field: Field, counts: Ints | Floats) -> Ints:
    """1 where counts (N,) of a match are as they should be, else 0."""
    mask = (1 << field.width) - 1
    return np.asarray(counts.astype(np.int64) & mask == field.value & mask, dtype=np.int64)


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


def _cut(field: Field, word: Ints) -> Ints:
    if field.bits is None:
        return word
    value = np.asarray(word >> field.bits[1] & ((1 << field.width) - 1), dtype=np.int64)
    return _signed(value, field.width) if field.signed else value


def _signed(value: Ints, width: int) -> Ints:
    half = 1 << (width - 1)
    return np.asarray((value ^ half) - half)


def _from_digits(word: Bytes) -> Ints:
    """Sign nibble and five digits; minus zero is zero."""
    digits = np.stack([word >> 4, word & 15], axis=2).reshape(-1, 6).astype(np.int64)
    size = digits[:, 1:] @ np.array([10000, 1000, 100, 10, 1])
    return np.asarray(np.where(digits[:, 0] == 1, -size, size), dtype=np.int64)


def field_values(one: Field, counts: Ints | Floats) -> Floats:
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


def put(field: Field, rows: Bytes, counts: Ints | Floats) -> None:
    """Write counts (N,) into their place in frames (N, L); other bits of the word stay."""
    word = rows[:, field.at : field.at + field.size]
    if field.type == "bcd":
        word[:] = _to_digits(np.asarray(counts, dtype=np.int64))
    elif field.type[0] == "f":
        packed = np.asarray(counts, dtype=f"{_ORDER[field.order]}f{field.size}")
        word[:] = packed.view(np.uint8).reshape(-1, field.size)
    else:
        low = 0 if field.bits is None else field.bits[1]
        bits = np.asarray(counts, dtype=np.int64).astype(np.uint64)
        mask = np.uint64((1 << field.width) - 1)
        _merge(field, word, (bits & mask) << np.uint64(low), mask << np.uint64(low))


def _merge(field: Field, word: Bytes, value: NDArray[np.uint64], mask: np.uint64) -> None:
    for i in range(field.size):
        shift = np.uint64(8 * (field.size - 1 - i if field.order == "big" else i))
        keep = np.uint8(~(mask >> shift) & np.uint64(0xFF))
        word[:, i] = word[:, i] & keep | (value >> shift & np.uint64(0xFF)).astype(np.uint8)


def _to_digits(counts: Ints) -> Bytes:
    size = np.abs(counts)
    digits = np.stack([np.where(counts < 0, 1, 0), *(size // 10**k % 10 for k in (4, 3, 2, 1, 0))], axis=1)
    return np.asarray(digits[:, 0::2] << 4 | digits[:, 1::2], dtype=np.uint8)


@kernel
def word_at(data: NDArray[np.uint8], at: int, size: int, big: int) -> int:
    """Word of some bytes, unsigned but for the 64th bit."""
    value = 0
    for i in range(size):
        value = value << 8 | int(data[at + (i if big else size - 1 - i)])
    return value


@kernel
def count_in(word: int, lowest: int, bits: int, signed: int) -> int:
    """Count of some bits of a word."""
    if bits == 64:  # in halves, for compiled whole numbers end there and Python's do not
        upper = word >> 32 & 0xFFFFFFFF
        return (upper - (1 << 32) if upper >> 31 else upper) * (1 << 32) + (word & 0xFFFFFFFF)
    value = word >> lowest & ((1 << bits) - 1)
    if signed and value >> (bits - 1):
        value -= 1 << bits
    return value


Column = Floats | Ints
Flags = NDArray[np.uint32]
Gone = list[tuple[str, NDArray[np.bool_]]]

_BITS: Final = {
    ("gyr", "clipped"): flags.GYR_CLIPPED,
    ("acc", "clipped"): flags.ACC_CLIPPED,
    ("mag", "clipped"): flags.MAG_CLIPPED,
    ("gyr", "invalid"): flags.GYR_INVALID,
    ("acc", "invalid"): flags.ACC_INVALID,
    ("mag", "invalid"): flags.MAG_INVALID,
    ("gyr", "absent"): flags.GYR_ABSENT,
    ("acc", "absent"): flags.ACC_ABSENT,
    ("mag", "absent"): flags.MAG_ABSENT,
}


class Unpacked(NamedTuple):
    """Columns by field, and flags by unit."""

    columns: dict[str, Column]
    flags: dict[str, Flags]


class Unpacker:
    """Takes frames of one message apart, whose options are settled."""

    def __init__(self, message: Message) -> None:
        wanted = [field for field in message.fields if field.role != "constant"]
        plain = [field for field in wanted if _is_plain(field)]
        self._units = unit_prefixes(message)
        self._order = [field.name for field in wanted]
        self._values = [field for field in plain if field.physical]
        self._counts = [field for field in plain if not field.physical]
        self._odd = [field for field in wanted if not _is_plain(field)]
        self._listening = [field for field in self._counts if field.says]
        self._length = message.length
        self._plan = np.array([_row(field, self._units) for field in (*self._values, *self._counts)], dtype=np.int64)
        self._plan = self._plan.reshape(-1, len(_PLAN))
        self._scales = np.array([(field.raw_offset, field.scale, field.zero) for field in self._values]).reshape(-1, 3)

    def take(self, data: Bytes, start: Ints) -> Unpacked:
        """Columns (N,) of the frames that begin at `start` (N,) in `data`."""
        size = start.size
        values, counts = np.empty((len(self._values), size)), np.empty((len(self._counts), size), dtype=np.int64)
        words = np.zeros((len(self._units), size), dtype=np.uint32)
        unpack(data, start, self._plan, self._scales, values, counts, words)
        unit_flags = dict(zip(self._units, words, strict=True))
        columns: dict[str, Column] = {field.name: values[i] for i, field in enumerate(self._values)}
        columns |= {field.name: counts[i] for i, field in enumerate(self._counts)}
        absent: Gone = []
        for field in self._listening:
            absent += _listen(field, columns[field.name], unit_flags)
        if self._odd:
            rows = _rows(data, start, self._length)
            for field in self._odd:
                columns[field.name], gone = _odd(field, rows, unit_flags)
                absent += gone
            columns = {name: columns[name] for name in self._order}
        _blank(columns, absent)
        return Unpacked(columns, unit_flags)


def unit_prefixes(message: Message) -> list[str]:
    """Prefixes of the units whose triads the message carries; an empty one where they have none."""
    names = [f.triad for f in message.fields if f.triad] + [name for f in message.fields for name in f.of]
    return list(dict.fromkeys(unit_and_triad(name)[0] for name in names)) or [""]


def _is_plain(field: Field) -> bool:
    return field.type[0] in "us" and field.role != "match" and not field.check and not field.overflow


_PLAN: Final = ("at", "size", "big", "lowest bit", "bits", "signed", "low", "high", "unit", "flag")


def _row(f: Field, units: list[str]) -> tuple[int, ...]:
    unit, triad = unit_and_triad(f.triad) if f.physical and f.triad else ("", "")
    low, high = (f.clip or f.limits) if triad else (0, 0)
    place = units.index(unit) if triad else 0
    flag = _BITS[triad, "clipped"] if triad else 0
    lowest = 0 if f.bits is None else f.bits[1]
    return (f.at, f.size, int(f.order == "big"), lowest, f.width, int(f.signed), low, high, place, flag)


@kernel
def unpack(data: Bytes, start: Ints, plan: Ints, scales: Floats, values: Floats, counts: Ints, words: Flags) -> None:
    """Fill values (V, N), counts (C, N) and flags (U, N) from the plain fields; those with a scale come first."""
    for f in range(plan.shape[0]):
        physical = f < scales.shape[0]
        for i in range(start.shape[0]):
            count = count_in(
                word_at(data, start[i] + plan[f, 0], plan[f, 1], plan[f, 2]), plan[f, 3], plan[f, 4], plan[f, 5]
            )
            if physical:
                values[f, i] = (count + scales[f, 0]) * scales[f, 1] + scales[f, 2]
                if plan[f, 9] and (count <= plan[f, 6] or count >= plan[f, 7]):
                    words[plan[f, 8], i] |= plan[f, 9]
            else:
                counts[f - scales.shape[0], i] = count


def _rows(data: Bytes, start: Ints, length: int) -> Bytes:
    """Bytes (N, L) of frames; no copy where they follow each other without a break."""
    if int(start[-1]) - int(start[0]) == (start.size - 1) * length:
        return data[start[0] : start[-1] + length].reshape(-1, length)
    return np.lib.stride_tricks.sliding_window_view(data, length)[start]


def _odd(field: Field, rows: Bytes, unit_flags: Mapping[str, Flags]) -> tuple[Column, Gone]:
    counts = read_counts(field, rows)
    if field.role == "match":
        counts = matches(field, counts)
    if not field.physical:
        return counts, _listen(field, counts, unit_flags)
    return field_values(field, counts), _at_its_end(field, counts, unit_flags)


def _listen(field: Field, counts: Column, unit_flags: Mapping[str, Flags]) -> Gone:
    """Flag what a status says of its triads, or of the triads of its fields; return what it says is absent."""
    gone: Gone = []
    for code, word in field.says.items():
        here = counts == code
        if not here.any():
            continue
        for name in field.of:
            unit, triad = unit_and_triad(name)
            if triad:
                unit_flags[unit][here] |= np.uint32(_BITS[triad, word])
            if word == "absent":
                gone.append((name, here))
    return gone


def _at_its_end(field: Field, counts: Column, unit_flags: Mapping[str, Flags]) -> Gone:
    """Flag a triad whose count is at the end of its range, or is no number; return its own column where it is none."""
    unit, _, triad = field.triad.rpartition(".")
    if field.type[0] == "f":
        wild = ~np.isfinite(counts)
        if triad and wild.any():
            unit_flags[unit][wild] |= np.uint32(_BITS[triad, "invalid"])
        return [(field.name, wild)] if wild.any() else []
    beyond = np.isin(counts, field.overflow)
    if triad:
        low, high = field.clip or field.limits
        unit_flags[unit][(counts <= low) | (counts >= high) | beyond] |= np.uint32(_BITS[triad, "clipped"])
    return [(field.name, beyond)] if beyond.any() else []


def _blank(columns: dict[str, Column], absent: Gone) -> None:
    """Put NaN where a triad or a field is absent."""
    for name, gone in absent:
        for column in (c for c in columns if c == name or c.rpartition(".")[0] == name):
            columns[column] = np.where(gone, np.nan, columns[column])
