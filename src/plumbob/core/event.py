"""What happened to a line or to a recording."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a line or to a recording; a gap is data.

    Attributes
    ----------
    t_ns : int
        Host's monotonic clock, ns.
    kind : str
        One word, such as ``"opened"``, ``"lost"``, ``"dropped"``, ``"stalled"``, ``"wall-clock"``.
    text : str
        What happened, in a sentence.
    count : int
        How many bytes, datagrams or rows it cost; 0 where that does not apply or is not known.
    """

    t_ns: int
    kind: str
    text: str
    count: int = 0
