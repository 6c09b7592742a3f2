"""Sequence numbers that have come, and those that are missing."""

from plumbob.record import layout


class Ledger:
    """Sequence numbers of one channel.

    Parameters
    ----------
    base : int or None
        First number that can come; None where nobody knows.
    """

    def __init__(self, base: int | None) -> None:
        self.next = base
        self._holes: list[tuple[int, int]] = []

    @property
    def missing(self) -> int:
        """How many numbers are missing."""
        return sum(high - low for low, high in self._holes)

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
        return any(a <= low and low + count <= b for a, b in self._holes)

    def take(self, low: int, count: int) -> None:
        """Take in numbers that are new."""
        if self.next is None or low >= self.next:
            self.reach(low)
            self.next = low + count
            return
        i = next(i for i, (a, b) in enumerate(self._holes) if a <= low and low + count <= b)
        a, b = self._holes[i]
        self._holes[i : i + 1] = [hole for hole in ((a, low), (low + count, b)) if hole[0] < hole[1]]

    def reach(self, end: int) -> None:
        """All numbers before `end` should have come."""
        if self.next is not None and end > self.next:
            self._holes.append((self.next, end))
        if self.next is None or end > self.next:
            self.next = end
