"""Find frames in a stream: a format as plain arrays, and the kernels that check candidates against them.

The search goes on inside a rejected frame, for a false sync must not swallow a true one. What it finds does not depend
on how the bytes were cut.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.kernels import kernel
from plumbob.protocols.checksum import (
    FLETCHER16,
    SUM8,
    SUM8_ZERO,
    SUM16,
    SUM16_EITHER,
    SUM16_REST,
    SUM16_WORDS,
    XOR8,
    algorithm,
    cyclic,
    exclusive_or,
    fletcher,
    plain_sum,
    table,
    word_sum,
)
from plumbob.protocols.field import Field
from plumbob.protocols.format import Format, Framing
from plumbob.protocols.unpack import count_in, word_at

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


class ScanPlan(NamedTuple):
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


def format_plan(form: Format) -> ScanPlan:
    """Arrays of a format that is bound."""
    framing = form.framing
    constants: list[tuple[int, int, int]] = []
    ranges: list[tuple[int, ...]] = []
    bounds = []
    for number, message in enumerate(form.messages):
        first, start = len(constants), len(ranges)
        constants += [byte for field in message.fields for byte in constant_bytes(field)]
        ranges += [_range_row(field, *field.range) for field in message.fields if field.range]
        bounds.append((message.length, first, len(constants), number, start, len(ranges)))
    bounds.sort(key=lambda bound: -sum(mask.bit_count() for _, mask, _ in constants[bound[1] : bound[2]]))
    return ScanPlan(
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
    constants = []
    for i in range(one.size):
        shift = 8 * (one.size - 1 - i if one.order == "big" else i)
        if mask >> shift & 0xFF:
            constants.append((one.at + i, mask >> shift & 0xFF, value >> shift & 0xFF))
    return constants


def _range_row(field: Field, least: int, most: int) -> tuple[int, ...]:
    kind = DECIMAL if field.type == "bcd" else SIGNED if field.signed else UNSIGNED
    low = 0 if field.bits is None else field.bits[1]
    return field.at, field.size, int(field.order == "big"), low, field.width, kind, least, most


# Places in the state, which lives as long as the stream.
JUNK, BAD_LENGTH, BAD_CONTENT, BAD_CHECKSUM, UNKNOWN, HUNTING, BYTE_VOTES, WORD_VOTES, STATE = range(9)
UNSIGNED, SIGNED, DECIMAL = range(3)
VOTES: Final = 8  # frames after which a checksum of two possible kinds is settled, where one fits every time


@kernel
def _is_sync(data: Bytes, at: int, sync: Bytes) -> bool:
    for a in range(sync.shape[0]):
        same = True
        for i in range(sync.shape[1]):
            if data[at + i] != sync[a, i]:
                same = False
                break
        if same:
            return True
    return False


@kernel
def _length_at(data: Bytes, at: int, length: Ints) -> int:
    """Length of the frame that begins here; 0 where it is not believed."""
    if length[0] > 0:
        return int(length[0])
    value = word_at(data, at + length[1], length[2], length[3]) + length[4]
    return value if length[5] <= value <= length[6] else 0


@kernel
def _has_end(data: Bytes, end: int, length: Ints) -> bool:
    """Whether the frame that ends here has what every frame ends with."""
    same = True
    for place in range(9, length.size):
        same = same and data[end - length.size + place] == length[place]
    return same


@kernel
def _has_constants(data: Bytes, at: int, constants: Ints, first: int, end: int) -> bool:
    for k in range(first, end):
        byte = int(data[at + constants[k, 0]])
        if constants[k, 1] == 0:
            if byte & 15 > 9 or byte >> 4 > (1 if constants[k, 2] else 9):
                return False
        elif byte & constants[k, 1] != constants[k, 2]:
            return False
    return True


@kernel
def _has_parity(data: Bytes, at: int, parity: Ints) -> bool:
    for p in range(parity.shape[0]):
        folded = 0
        for i in range(parity[p, 0], parity[p, 1]):
            folded ^= int(data[at + i])
        folded ^= folded >> 4
        folded ^= folded >> 2
        folded ^= folded >> 1
        if folded & 1 == 0:
            return False
    return True


@kernel
def _message_at(data: Bytes, at: int, size: int, messages: Ints, constants: Ints) -> int:
    """Row of the message whose constants are here, the one that asks most; −1 for none."""
    for m in range(messages.shape[0]):
        if messages[m, 0] == size and _has_constants(data, at, constants, messages[m, 1], messages[m, 2]):
            return m
    return -1


@kernel
def _is_plausible(data: Bytes, at: int, message: int, strong: bool, messages: Ints, parity: Ints, ranges: Ints) -> bool:
    """Whether parity and ranges allow it; a frame of no known message needs a strong check to be believed."""
    if message < 0:
        return strong and _has_parity(data, at, parity)
    if not _has_parity(data, at, parity):
        return False
    return _in_range(data, at, ranges, messages[message, 4], messages[message, 5])


@kernel
def _digits(word: int) -> int:
    """Sign nibble and five digits."""
    value = 0
    for shift in (16, 12, 8, 4, 0):
        value = 10 * value + (word >> shift & 15)
    return -value if word >> 20 == 1 else value


@kernel
def _in_range(data: Bytes, at: int, ranges: Ints, first: int, end: int) -> bool:
    for k in range(first, end):
        word = word_at(data, at + ranges[k, 0], ranges[k, 1], ranges[k, 2])
        value = count_in(word, ranges[k, 3], ranges[k, 4], ranges[k, 5] == SIGNED)
        if ranges[k, 5] == DECIMAL:
            value = _digits(value)
        if value < ranges[k, 6] or value > ranges[k, 7]:
            return False
    return True


@kernel
def _computed(data: Bytes, start: int, stop: int, check: Ints, remainders: Ints) -> int:
    if check[0] == SUM8 or check[0] == SUM16:
        return plain_sum(data, start, stop) & ((1 << int(check[5])) - 1)
    if check[0] == SUM8_ZERO:
        return -plain_sum(data, start, stop) & 0xFF
    if check[0] == XOR8:
        return exclusive_or(data, start, stop)
    if check[0] == SUM16_WORDS or check[0] == SUM16_REST:
        return word_sum(data, start, stop) % (65535 if check[0] == SUM16_REST else 65536)
    if check[0] == FLETCHER16:
        return fletcher(data, start, stop)
    return cyclic(data, start, stop, remainders, check[5], check[6], check[7], check[8])


@kernel
def _fits(data: Bytes, at: int, size: int, check: Ints, remainders: Ints, state: Ints) -> bool:
    if check[0] == 0:
        return True
    place = at + check[1] + (size if check[1] < 0 else 0)
    start = at + check[2]
    stop = at + check[3] + (size if check[3] <= 0 else 0)
    there = word_at(data, place, check[5] // 8, check[4])
    if check[0] != SUM16_EITHER:
        return there == _computed(data, start, stop, check, remainders)
    by_bytes = there == plain_sum(data, start, stop) & 0xFFFF and state[WORD_VOTES] < VOTES
    by_words = there == word_sum(data, start, stop) % 65535 and state[BYTE_VOTES] < VOTES
    if by_bytes and not by_words:
        state[BYTE_VOTES] += 1
        state[WORD_VOTES] = 0
    if by_words and not by_bytes:
        state[WORD_VOTES] += 1
        state[BYTE_VOTES] = 0
    return by_bytes or by_words


@kernel
def _why_not(size: int, content: bool) -> int:
    """Place of the counter for a rejected frame."""
    if size == 0:
        return BAD_LENGTH
    return BAD_CHECKSUM if content else BAD_CONTENT


@kernel
def scan(data: Bytes, end: int, final: bool, plan: ScanPlan, state: Ints, out: Ints) -> tuple[int, int]:
    """Search frames in `end` bytes; gives how many, and the bytes done with: the rest comes again, with more behind it.

    `final`: no more will come, so that an unfinished frame is junk; `state` (STATE,): counters, and what the search
    remembers; `out` (N, 3): start, length and message of each frame; the search stops where it is full.
    """
    sync, length, check, remainders, messages, constants, parity, ranges = plan
    ahead = sync.shape[1]
    header = ahead if length[0] else max(ahead, length[1] + length[2])
    transfers = length[7] == 1
    strong = length[0] == 0 and check[5] >= 16
    at, count = 0, 0
    while at < end and count < out.shape[0]:
        if not transfers and end - at >= ahead and not _is_sync(data, at, sync):
            state[JUNK] += 1
            state[HUNTING] = 1
            at += 1
            continue
        if end - at < header and not final:
            break
        size = _length_at(data, at, length) if end - at >= header else 0
        if size > end - at and not final:
            break
        complete = 0 < size <= end - at
        content, good, message = False, False, -1
        if complete:
            message = _message_at(data, at, size, messages, constants)
            content = _has_end(data, at + size, length) and _is_plausible(
                data, at, message, strong, messages, parity, ranges
            )
            behind = end - at - size >= ahead
            unsure = length[8] == 1 and state[HUNTING] == 1
            if content and unsure and not (behind or final):
                break
            good = content and _fits(data, at, size, check, remainders, state)
            good = good and not (unsure and behind and not _is_sync(data, at + size, sync))
        if good:
            if message >= 0:
                out[count, 0], out[count, 1], out[count, 2] = at, size, messages[message, 3]
                count += 1
            else:
                state[UNKNOWN] += 1
            state[HUNTING] = 0
            at += size
            continue
        if complete or (size == 0 and end - at >= header):
            state[_why_not(size, content)] += 1
        step = min(size, end - at) if transfers and size > 0 else 1
        state[JUNK] += step
        state[HUNTING] = 1
        at += step
    return count, at
