"""How many wrong frames a format lets pass, by its checks: what the decoders' benchmark measures is held against it."""

from plumbob.protocols.checksum import SUM16_EITHER, algorithm
from plumbob.protocols.format import Format, Framing, Message
from plumbob.protocols.overlap import content_odds
from plumbob.protocols.scan import constant_bytes


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
    ahead = len(framing.sync[0]) if framing.sync else 0
    rule = framing.length_field
    if rule and rule.at >= ahead:
        fixed *= 256.0**-rule.size
    return fixed * sum(_beginnings(framing, one, ahead) * content_odds(one, ahead) for one in bound.messages)


def _beginnings(framing: Framing, message: Message, ahead: int) -> float:
    """Share of the beginnings that fit the constants of a message that lie in them."""
    inside = [found for one in message.fields for found in constant_bytes(one) if found[0] < ahead and found[1]]
    fit = [all(word[at] & mask == value for at, mask, value in inside) for word in framing.sync]
    return sum(fit) / len(fit) if fit else 1.0


def _sync(framing: Framing) -> float:
    return len(framing.sync) * 256.0 ** -len(framing.sync[0]) if framing.sync else 1.0


def _check(framing: Framing) -> float:
    if framing.checksum is None:
        return 1.0
    how = algorithm(framing.checksum.kind)
    return (2.0 if how.code == SUM16_EITHER else 1.0) * 0.5**how.width
