"""A format as plain arrays, for the kernels that find frames and read numbers."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.protocols.checksum import algorithm, table
from plumbob.protocols.field import Field
from plumbob.protocols.format import Format, Framing
from plumbob.protocols.scan import DECIMAL, SIGNED, UNSIGNED

Ints = NDArray[np.int64]


class Reads:
    """Remembers reads as long as bytes of them may still begin a frame."""

    def __init__(self) -> None:
        self._known: list[tuple[int, int]] = []

    def __len__(self) -> int:
        return len(self._known)

    def add(self, place: int, t_ns: int) -> None:
        """Take a read that begins at that byte of the stream and was made at that host's time, ns."""
        self._known.append((place, t_ns))

    def times(self, start: Ints) -> Ints:
        """Host's times (N,), ns, of the reads that brought the bytes at `start` (N,)."""
        begins, times = np.array(self._known, dtype=np.int64).T
        return np.asarray(times[np.searchsorted(begins, start, side="right") - 1])

    def forget(self, done: int) -> None:
        """Drop the reads that ended before that byte."""
        keep = max((i for i, (begin, _) in enumerate(self._known) if begin <= done), default=0)
        del self._known[:keep]


Bytes = NDArray[np.uint8]


class Plan(NamedTuple):
    """A format as arrays, for the kernel."""

    sync: Bytes
    """Alternatives (A, S)."""
    length: Ints
    """Fixed length, or 0; then at, size, big, add, least, most of the length field; transfers; confirm; end."""
    check: Ints
    """Code, at, start, stop, big, width, first remainder, final, reflected."""
    remainders: Ints
    """Table (256,)."""
    messages: Ints
    """Rows (M, 6): length, where its constants begin and end, number, where its ranges do; most constant bits first."""
    constants: Ints
    """Rows (C, 3): byte, mask, value; mask 0 asks for decimal digits, with a sign nibble where value is 1."""
    parity: Ints
    """Rows (P, 3): first byte and end of what must hold an odd number of ones, and the bit that sees to it."""
    ranges: Ints
    """Rows (R, 8): byte, size, big, lowest bit, bits, kind, least and greatest count of a field."""


def plan_of(form: Format) -> Plan:
    """Arrays of a format that is bound."""
    framing = form.framing
    constants: list[tuple[int, int, int]] = []
    ranges: list[tuple[int, ...]] = []
    bounds = []
    for number, message in enumerate(form.messages):
        first, start = len(constants), len(ranges)
        constants += [byte for one in message.fields for byte in constant_bytes(one)]
        ranges += [_range_row(one, *one.range) for one in message.fields if one.range]
        bounds.append((message.length, first, len(constants), number, start, len(ranges)))
    bounds.sort(key=lambda bound: -sum(mask.bit_count() for _, mask, _ in constants[bound[1] : bound[2]]))
    return Plan(
        sync=np.array([list(word) for word in framing.sync], dtype=np.uint8).reshape(
            len(framing.sync), len(framing.sync[0]) if framing.sync else 0
        ),
        length=np.array(_length_plan(framing), dtype=np.int64),
        check=np.array(_check_plan(framing), dtype=np.int64),
        remainders=table(framing.checksum.kind) if framing.checksum else np.zeros(256, dtype=np.int64),
        messages=np.array(bounds, dtype=np.int64),
        constants=np.array(constants, dtype=np.int64).reshape(-1, 3),
        parity=np.array(framing.parity, dtype=np.int64).reshape(-1, 3),
        ranges=np.array(ranges, dtype=np.int64).reshape(-1, 8),
    )


def _length_plan(framing: Framing) -> list[int]:
    rule = framing.length_field
    place = [rule.at, rule.size, int(rule.order == "big"), rule.add, rule.least, rule.most] if rule else [0] * 6
    return [framing.length, *place, int(framing.transfers), int(framing.confirm), *framing.end]


def _check_plan(framing: Framing) -> list[int]:
    check = framing.checksum
    if check is None:
        return [0] * 9
    how = algorithm(check.kind)
    big = int(check.order == "big")
    return [how.code, check.at, check.start, check.stop, big, how.width, how.start, how.final, int(how.reflected)]


def constant_bytes(one: Field) -> list[tuple[int, int, int]]:
    """What a message asks of single bytes: the bits of a constant, or decimal digits."""
    if one.type == "bcd":
        return [(one.at, 0, 1), (one.at + 1, 0, 0), (one.at + 2, 0, 0)]
    if one.role != "constant":
        return []
    low = 0 if one.bits is None else one.bits[1]
    mask = ((1 << one.width) - 1) << low
    value = (one.value << low) & mask
    found = []
    for i in range(one.size):
        shift = 8 * (one.size - 1 - i if one.order == "big" else i)
        if mask >> shift & 0xFF:
            found.append((one.at + i, mask >> shift & 0xFF, value >> shift & 0xFF))
    return found


def _range_row(one: Field, least: int, most: int) -> tuple[int, ...]:
    kind = DECIMAL if one.type == "bcd" else SIGNED if one.signed else UNSIGNED
    low = 0 if one.bits is None else one.bits[1]
    return one.at, one.size, int(one.order == "big"), low, one.width, kind, least, most
