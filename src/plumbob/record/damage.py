"""What is wrong with a recording, and where."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Damage:
    """A place where a file does not hold what was written.

    Attributes
    ----------
    path : Path
        The file.
    offset, size : int
        Where, bytes.
    what : str
        What is wrong.
    lost : mapping of str to int
        Rows per topic that are missing there, as later sequence numbers tell.
    certain : bool
        False where rows may be missing of which nothing later tells, as at the torn end of a file.
    """

    path: Path
    offset: int
    size: int
    what: str
    lost: Mapping[str, int] = field(default_factory=dict)
    certain: bool = True

    def __str__(self) -> str:
        rows = ", ".join(f"{count} of {topic}" for topic, count in self.lost.items())
        cost = f"; rows lost: {rows}" if rows else ("" if self.certain else "; rows lost: not known")
        return f"{self.path.name}: {self.size} bytes at {self.offset}: {self.what}{cost}"
