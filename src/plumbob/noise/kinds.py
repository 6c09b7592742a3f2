"""Kinds of deviation: how each is made of the cumulative sum, and what a record allows."""

from typing import Final, NamedTuple

from numpy.typing import ArrayLike

from plumbob import check
from plumbob.noise.factors import Factors, whole_factors


class Kind(NamedTuple):
    """How a deviation is made of the cumulative sum.

    Attributes
    ----------
    order : int
        Of the differences: 2 for Allan's, 3 for Hadamard's.
    averaged : bool
        Whether the sum is averaged over n points first, as the modified deviation does.
    overlapping : bool
        Whether every difference is used, or every n-th.
    """

    order: int
    averaged: bool
    overlapping: bool

    @property
    def levels(self) -> tuple[int, ...]:
        """Exponents α of the noises that the deviation is finite for and tells apart, increasing.

        Without the average, flicker of the angle (1) is as steep as its quantization (2), which is what sensors have.
        """
        return (*range(2 - 2 * self.order, 1), *((1, 2) if self.averaged else (2,)))

    def longest(self, count: int) -> int:
        """Longest averaging factor that `count` samples allow."""
        return (count + self.averaged) // (self.order + self.averaged)

    def terms(self, count: int, n: int) -> int:
        """How many differences `count` samples give at the factor n."""
        room = count + 1 - self.order * n - (n - 1 if self.averaged else 0)
        return room if self.overlapping else (room - 1) // n + 1


SHAPES: Final[dict[str, Kind]] = {
    "oadev": Kind(2, averaged=False, overlapping=True),
    "adev": Kind(2, averaged=False, overlapping=False),
    "mdev": Kind(2, averaged=True, overlapping=True),
    "ohdev": Kind(3, averaged=False, overlapping=True),
    "hdev": Kind(3, averaged=False, overlapping=False),
    "totdev": Kind(2, averaged=False, overlapping=True),
}
"""By name of the deviation. The total deviation extends the record, and is Allan's overlapping one inside it."""

KINDS: Final = tuple(SHAPES)
"""Overlapping Allan, Allan, modified Allan (overlapping), overlapping Hadamard, Hadamard, total."""


def kind_of(name: str) -> Kind:
    """Kind of that name, refusing unknown ones by a `ShapeError`."""
    return SHAPES[check.one_of("kind", name, KINDS)]


def factors_of(kind: str, count: int, n: ArrayLike) -> Factors:
    """Averaging factors n as integers, refusing those that `count` samples do not allow.

    Raises
    ------
    ShapeError
        If the kind is unknown.
    ParameterError
        If a factor is no whole number, or too long for the record.
    """
    return whole_factors(n, kind_of(kind).longest(count), f"for {kind} of {count} samples")
