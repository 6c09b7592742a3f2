"""What happened to a line or to a recording."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a line or to a recording; a gap is data."""

    t_ns: int  # host's monotonic clock, ns
    kind: str  # one word, such as ``"opened"``, ``"lost"``, ``"dropped"``, ``"stalled"``, ``"wall-clock"``
    text: str  # what happened, in a sentence
    count: int = 0  # how many bytes, datagrams or rows it cost; 0 where that does not apply or is not known
    source: str = ""  # which of several sources it happened to; empty for the first, or all
