"""What is sent where: checked, from options, from a line of text, or from ``[[send]]`` of a session."""

from collections.abc import Sequence
from typing import Final

from plumbob.core import check, schema
from plumbob.core.errors import ParameterError
from plumbob.core.units import Quantity, given
from plumbob.live.session import SENT_AS, SendSpec
from plumbob.live.transports.outgoing import FileTarget, parse_target
from plumbob.protocols.attitude import BodyAxes
from plumbob.rotations import North


def send_spec(
    kind: str,
    to: str,
    *,
    rate: float | str | None = None,
    sentences: str | Sequence[str] = (),
    body: BodyAxes | str | None = None,
) -> SendSpec:
    """What to send, checked.

    Raises
    ------
    ParameterError
        If there is no such form or target, or they do not go together.
    """
    if kind not in SENT_AS:
        raise ParameterError(f"{check.said(kind)} is not a form of an attitude; known are {', '.join(SENT_AS)}.")
    names = tuple(sentences.split(",") if isinstance(sentences, str) else sentences)
    if kind == "nmea":
        from plumbob.protocols.attitude.nmea import sentences_for

        names = sentences_for(names, North.TRUE, 0.0) if names else ()
    elif names:
        raise ParameterError(f"sentences belong to nmea, not to {kind}; leave --sentences out.")
    target = parse_target(to, overwrite=True)
    if kind == "ros2" and not isinstance(target, FileTarget):
        raise ParameterError("ros2 is written as an MCAP file; name file:PATH.mcap as its target.")
    axes = None if body is None else str(BodyAxes.parse(body))
    return SendSpec(kind, to, given("rate", rate, Quantity.FREQUENCY, positive=True), names, axes)


def parse_send(text: str) -> SendSpec:
    """What to send of one text: form, target, and optionally rate, sentences and body axes, with spaces between.

    As in ``"nmea udp:127.0.0.1:10110 10Hz HDT,PASHR"``.

    Raises
    ------
    ParameterError
        If it is not that.
    """
    words = text.split()
    if len(words) < 2:
        raise ParameterError(f"'{text}' needs a form and a target, as 'nmea udp:127.0.0.1:10110 10Hz'.")
    kind, to, *rest = words
    rates = [word for word in rest if word[0].isdigit()]
    axes = [word for word in rest if word.upper() in list(BodyAxes)]
    names = [word for word in rest if word not in rates and word not in axes]
    if max(len(rates), len(axes), len(names)) > 1:
        raise ParameterError(f"'{text}' has more words than a form, a target, a rate, sentences and body axes.")
    return send_spec(
        kind, to, rate=rates[0] if rates else None, sentences=names[0] if names else (), body=axes[0] if axes else None
    )


SEND_TABLE: Final = schema.form(
    {
        "as": schema.one_of(*SENT_AS),
        "to": schema.text,
        "rate": schema.size(Quantity.FREQUENCY),
        "sentences": schema.texts,
        "body": schema.one_of(*BodyAxes),
    },
    ("as", "to"),
    lambda _, table: send_spec(table.pop("as"), table.pop("to"), **table),
)
"""Parser of a table ``[[send]]``."""
