"""Numbers with units to bytes: the emulator's half of a format."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.errors import ShapeError, unknown_name
from plumbob.protocols.checksum import algorithm, of_rows
from plumbob.protocols.field import Checksum, Field
from plumbob.protocols.format import Format, Message
from plumbob.protocols.unpack import counts_for, put

Bytes = NDArray[np.uint8]


def encode(form: Format, columns: Mapping[str, ArrayLike], *, message: str = "") -> Bytes:
    """Frames (N, L) of one message.

    Values beyond the range are cut to its end, as a sensor does. A value that is not there (NaN) repeats the one
    before, as a register does; where the format has a count for "beyond the range", it is that. A message without
    values, such as a request, may be given no column: that is one frame. `columns` (N,) by field are in SI, counts for
    statuses, counters and clocks, which wrap; a field that is not given keeps its own value, a counter counts from 0,
    and a parity or a check is computed.
    """
    bound = form.bind()
    kind = bound.message(message)
    given = {
        name: np.asarray(value, dtype=np.float64 if _is_value(kind, name) else None) for name, value in columns.items()
    }
    bare = not given and not any(field.physical for field in kind.fields)
    count = 1 if bare else _common_length(form.name, given)
    rows = np.zeros((count, kind.length), dtype=np.uint8)
    _frame(bound, kind, rows)
    for field in kind.fields:
        if not field.derived:
            put(field, rows, _counts(field, given.get(field.name), count))
    _set_parities(bound, kind, rows)
    for field in kind.fields:
        if field.check:
            _set_check(field.check, rows[:, field.at : field.at + field.size])
    if bound.framing.checksum:
        _set_check(bound.framing.checksum, rows)
    return rows


def _is_value(kind: Message, name: str) -> bool:
    matching = [f for f in kind.fields if f.name == name and not (f.fixed or f.derived)]
    if not matching:
        names = (f.name for f in kind.fields if not (f.fixed or f.derived))
        raise unknown_name("field to encode", name, names, of=f"message {kind.name}")
    return matching[0].physical


def _common_length(name: str, given: Mapping[str, NDArray[np.generic]]) -> int:
    lengths = {value.shape for value in given.values()}
    if len(lengths) != 1 or len(next(iter(lengths))) != 1:
        shapes = ", ".join(f"{key} {value.shape}" for key, value in given.items()) or "none"
        raise ShapeError(f"columns of {name} must be of shape (N,), all alike, but they are {shapes}.")
    return int(next(iter(lengths))[0])


def _frame(form: Format, kind: Message, rows: Bytes) -> None:
    framing = form.framing
    if framing.sync:
        rows[:, : len(framing.sync[0])] = list(framing.sync[0])
    if framing.end:
        rows[:, -len(framing.end) :] = list(framing.end)
    if rule := framing.length_field:
        digits = (kind.length - rule.add).to_bytes(rule.size, "big" if rule.order == "big" else "little")
        rows[:, rule.at : rule.at + rule.size] = list(digits)


def _counts(field: Field, value: NDArray[np.generic] | None, count: int) -> NDArray[np.int64] | NDArray[np.float64]:
    if value is None:
        return np.arange(count) if field.role == "counter" else np.full(count, field.value, dtype=np.int64)
    if not field.physical:
        return np.asarray(value, dtype=np.int64)
    numbers = np.asarray(value, dtype=np.float64)
    return counts_for(field, numbers if field.overflow else hold_last(numbers))[0]


def hold_last(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each missing value as the last one before it, or 0 before the first."""
    last = check.last_marked(~np.isnan(values))
    return np.where(last >= 0, values[last], 0.0)


def parities(form: Format, message: Message) -> list[tuple[int, int, int]]:
    """First byte, end and bit of what must hold an odd number of ones; inner ranges first."""
    inner = [(f.at, f.at + f.size, f.bits[0]) for f in message.fields if f.type == "parity" and f.bits]
    return sorted([*form.framing.parity, *inner], key=lambda where: where[1] - where[0])


def _set_parities(form: Format, kind: Message, rows: Bytes) -> None:
    """Set the bit of each range that makes the number of ones odd."""
    for start, stop, bit in parities(form, kind):
        at, mask = stop - 1 - bit // 8, np.uint8(1 << bit % 8)
        rows[:, at] &= ~mask
        even = np.bitwise_count(rows[:, start:stop]).sum(axis=1) % 2 == 0
        rows[even, at] |= mask


def _set_check(check: Checksum, rows: Bytes) -> None:
    length = rows.shape[1]
    start, stop = check.start, check.stop + (length if check.stop <= 0 else 0)
    size = algorithm(check.kind).size
    at = check.at + (length if check.at < 0 else 0)
    value = of_rows(check.kind, rows[:, start:stop])
    for i in range(size):
        shift = 8 * (size - 1 - i if check.order == "big" else i)
        rows[:, at + i] = value >> shift & 0xFF
