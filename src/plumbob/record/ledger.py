"""Sequence numbers that have come, and those that are missing."""

from bisect import bisect_right
from operator import itemgetter

from plumbob.record import layout


class Ledger:
    """Sequence numbers of one channel.

    Parameters
    ----------
    base : int or None
        First number that can come; None where nobody knows.

    Attributes
    ----------
    next : int or None
        One more than the largest number that has come.
    missing : int
        How many numbers are missing.
    """

    def __init__(self, base: int | None) -> None:
        self.next = base
        self.missing = 0
        self._holes: list[tuple[int, int]] = []  # in order

    def place(self, on_disk: int) -> int:
        """Number that 32 bits on disk mean: the one that is nearest to the number expected."""
        if self.next is None:
            return on_disk
        half = layout.SEQUENCES // 2
        return self.next + (on_disk - self.next + half) % layout.SEQUENCES - half

    def is_new(self, low: int, count: int) -> bool:
        """Whether none of the `count` numbers from `low` on has come before."""
        if self.next is None or low >= self.next:
            return True
        i = self._hole_before(low)
        return i >= 0 and low + count <= self._holes[i][1]

    def take(self, low: int, count: int) -> None:
        """Take in numbers that are new."""
        if self.next is None or low >= self.next:
            self.reach(low)
            self.next = low + count
            return
        i = self._hole_before(low)
        a, b = self._holes[i]
        self.missing -= count
        self._holes[i : i + 1] = [hole for hole in ((a, low), (low + count, b)) if hole[0] < hole[1]]

    def reach(self, end: int) -> None:
        """All numbers before `end` should have come."""
        if self.next is not None and end > self.next:
            self._holes.append((self.next, end))
            self.missing += end - self.next
        if self.next is None or end > self.next:
            self.next = end

    def _hole_before(self, low: int) -> int:
        """Place of the last hole that begins at `low` or before."""
        return bisect_right(self._holes, low, key=itemgetter(0)) - 1
