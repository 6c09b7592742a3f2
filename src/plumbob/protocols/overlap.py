"""Refuse what cannot lie in a frame: overlapping fields, checks outside, formats that random bytes would pass."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from plumbob.core.errors import DecodeError
from plumbob.core.text import counted
from plumbob.protocols import checksum
from plumbob.protocols.field import Checksum, Field
from plumbob.protocols.format import Format, Framing, Message
from plumbob.protocols.scan import constant_bytes


def passes_anything(form: Format) -> bool:
    """Whether any bytes of the right number are a frame: no sync, check, parity, constant or range says that one is."""
    framing = form.framing
    checked = framing.sync or framing.checksum or framing.parity or framing.end
    return not checked and all(content_odds(message) == 1.0 for message in form.messages)


def content_odds(message: Message, start: int = 0) -> float:
    """Chance that random bytes have the constants, digits and ranges of a message; constants from a byte on."""
    odds = 1.0
    for field in message.fields:
        for at, mask, _ in [] if field.type == "bcd" else constant_bytes(field):
            odds *= 0.5 ** mask.bit_count() if at >= start else 1.0
        odds *= _share(field)
    return odds


def _share(field: Field) -> float:
    """Share of all words of a field that it can have."""
    if field.range is None and field.type != "bcd":
        return 1.0
    least, most = field.range or field.limits
    minus_zero = field.type == "bcd" and least <= 0 <= most
    return (most - least + 1 + minus_zero) * 0.5**field.width


class _Place(NamedTuple):
    at: int
    end: int
    name: str
    word: tuple[int, int] | None = None  # where bits of one word may lie side by side, which word


def require_places(form: Format, message: Message) -> None:
    """Refuse a message whose check, fields or bits cannot lie where the format puts them."""
    for field in message.fields:
        _require_bits(field)
    _require_own_bits(message)
    kinds = _check_kinds(form)
    if form.framing.checksum:
        _require_check(form.framing.checksum, kinds, message)
    # A field may say which of several beginnings the frame has.
    places = sorted((*_frame(form.framing, kinds, message), *_fields(message, skip_sync=len(form.framing.sync) > 1)))
    for one_place, other in pairwise(places):
        same_word = one_place.word is not None and one_place.word == other.word
        if other.at < one_place.end and not same_word:
            raise DecodeError(
                f"message {message.name}: {one_place.name} and {other.name} share byte {other.at}; "
                "bits of one word have the same at and a type of its size."
            )


def unassigned(form: Format, message: Message) -> list[tuple[int, int]]:
    """First byte and end of each stretch of a message that neither frame, check nor field takes."""
    taken = [*_frame(form.framing, _check_kinds(form), message), *_fields(message, skip_sync=False)]
    gaps, at = [], len(form.framing.sync[0]) if form.framing.sync else 0
    for place in sorted([*taken, _Place(message.length, message.length, "end")]):
        if place.at > at:
            gaps.append((at, place.at))
        at = max(at, place.end)
    return gaps


def _require_bits(f: Field) -> None:
    if f.bits is None or f.derived:
        return
    high, low = f.bits
    if f.type[0] not in "us" or not 0 <= low <= high < 8 * f.size:
        raise DecodeError(
            f"field {f.name}: bits must be [highest, lowest] of the bits {8 * f.size - 1} to 0 of a whole number, "
            f"but they are [{high}, {low}] of {f.type}."
        )


def _require_own_bits(message: Message) -> None:
    """Refuse two fields of a word that claim the same bit."""
    parts = [(field, field.bits) for field in message.fields if field.bits is not None and not field.derived]
    for i, (field, bits) in enumerate(parts):
        for other, others in parts[:i]:
            same_word = (field.at, field.size) == (other.at, other.size)
            if same_word and max(bits[1], others[1]) <= min(bits[0], others[0]):
                shared = max(bits[1], others[1])
                raise DecodeError(f"message {message.name}: fields {other.name} and {field.name} share bit {shared}.")


def _require_check(check: Checksum, kinds: tuple[str, ...], message: Message) -> None:
    at, stop = _from_begin(check.at, message.length), check.stop + (message.length if check.stop <= 0 else 0)
    size = _check_size(kinds)
    if not 0 <= at <= message.length - size:
        raise DecodeError(
            f"checksum.at = {check.at} puts {check.kind} of {counted(size, 'byte')} outside message {message.name}, "
            f"which has bytes 0 to {message.length - 1}; a negative place counts from the end."
        )
    if not 0 <= check.start < stop <= message.length:
        raise DecodeError(
            f"checksum covers bytes {check.start} to {stop}, exclusive, but must begin before it ends, within the "
            f"{message.length} of message {message.name}; see its from and to."
        )


def _check_kinds(form: Format) -> tuple[str, ...]:
    """What the check may be; several where an option says which."""
    kind = form.framing.checksum.kind if form.framing.checksum else ""
    return tuple(map(str, form.options[kind].choices.values())) if kind in form.options else (kind,)


def _check_size(kinds: tuple[str, ...]) -> int:
    return max(checksum.algorithm(kind).size for kind in kinds)


def _from_begin(at: int, length: int) -> int:
    return at + length if at < 0 else at


def _frame(framing: Framing, kinds: tuple[str, ...], message: Message) -> Iterator[_Place]:
    """What is in the frame besides fields."""
    if len(framing.sync) == 1:
        yield _Place(0, len(framing.sync[0]), "frame.sync")
    if rule := framing.length_field:
        yield _Place(rule.at, rule.at + rule.size, "frame.length_field")
    if framing.checksum:
        at = _from_begin(framing.checksum.at, message.length)
        yield _Place(at, at + _check_size(kinds), "frame.checksum")
    if framing.end:
        yield _Place(message.length - len(framing.end), message.length, "frame.end")


def _fields(message: Message, *, skip_sync: bool) -> Iterator[_Place]:
    for f in message.fields:
        if not f.derived and not (skip_sync and f.at == 0 and not f.physical):
            yield _Place(f.at, f.at + f.size, f"field {f.name}", (f.at, f.size) if f.bits else None)
