"""Which read brought which byte of a stream, and when."""

import numpy as np
from numpy.typing import NDArray

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
