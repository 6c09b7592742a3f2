"""How probably random bytes pass for a frame: what sync, length, end, constants, ranges, parity, check leave over."""

from plumbob.sensors.checksum import SUM16_EITHER, algorithm
from plumbob.sensors.field import Field
from plumbob.sensors.format import Format, Framing, Message
from plumbob.sensors.plan import constant_bytes


def false_accepts(form: Format) -> float:
    """Expected number of wrong frames of a known message per random byte; on a bus, per random transfer.

    Random bytes stand for a line without a device or at another speed. It is an upper bound where sync, constants and
    ranges share bytes, and where a check of two possible kinds is settled.
    """
    bound = form.bind()
    framing = bound.framing
    fixed = _sync(framing) * _check(framing) * 0.5 ** len(framing.parity) * 256.0 ** -len(framing.end)
    if framing.confirm:
        fixed *= _sync(framing)
    if framing.length_field:
        fixed *= 256.0**-framing.length_field.size
    return fixed * sum(_content(message) for message in bound.messages)


def passes_anything(form: Format) -> bool:
    """Whether any bytes of the right number are a frame: no sync, check, parity, constant or range says that one is."""
    framing = form.framing
    checked = framing.sync or framing.checksum or framing.parity or framing.end
    return not checked and all(_content(message) == 1.0 for message in form.messages)


def _sync(framing: Framing) -> float:
    return len(framing.sync) * 256.0 ** -len(framing.sync[0]) if framing.sync else 1.0


def _check(framing: Framing) -> float:
    if framing.checksum is None:
        return 1.0
    how = algorithm(framing.checksum.kind)
    return (2.0 if how.code == SUM16_EITHER else 1.0) * 0.5**how.width


def _content(message: Message) -> float:
    found = 1.0
    for one in message.fields:
        for _, mask, _ in [] if one.type == "bcd" else constant_bytes(one):
            found *= 0.5 ** mask.bit_count()
        found *= _share(one)
    return found


def _share(one: Field) -> float:
    """Share of all words of a field that it can have."""
    if one.range is None and one.type != "bcd":
        return 1.0
    least, most = one.range or one.limits
    minus_zero = one.type == "bcd" and least <= 0 <= most
    return (most - least + 1 + minus_zero) * 0.5**one.width
