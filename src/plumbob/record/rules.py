"""How a recording is written."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

State = Literal["new", "recording", "stopped", "closed"]


@dataclass(frozen=True, slots=True)
class Rules:
    """How a recording is written; see `Recorder`, whose units these are."""

    path: Path
    rotate: float | None
    rotate_bytes: int | None
    reserve: int
    fsync: float | None
    compression: str
    first: int = 1
    """Number of the first part."""
