"""Channels side by side: which analyses are the axes of one triad."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from plumbob.data import TITLES
from plumbob.errors import ShapeError
from plumbob.noise.findings import Analysis
from plumbob.units import Quantity

AXES = ("x", "y", "z")


class Triad(NamedTuple):
    """Channels of one sensor.

    Attributes
    ----------
    name : str
        What their names share, such as "gyr"; the whole name of a channel that stands alone.
    channels : mapping of str to Analysis
        By axis; the axis is empty for a channel that stands alone.
    """

    name: str
    channels: Mapping[str, Analysis]

    @property
    def title(self) -> str:
        """Name for a heading."""
        return TITLES.get(self.name, self.name)

    @property
    def quantity(self) -> Quantity:
        """What its samples measure."""
        return self.first.quantity

    @property
    def first(self) -> Analysis:
        """The first of its channels."""
        return next(iter(self.channels.values()))


def triads(analyses: Sequence[Analysis]) -> list[Triad]:
    """Sort channels into triads by their names: "gyr x", "gyr y" and "gyr z" are axes of "gyr".

    Raises
    ------
    ShapeError
        If there is no analysis, two share a name, or the axes of a triad measure different quantities.
    """
    if not analyses:
        raise ShapeError("a report needs at least one analysis, but analyses is empty.")
    found: dict[str, dict[str, Analysis]] = {}
    for analysis in analyses:
        head, _, last = analysis.name.rpartition(" ")
        name, axis = (head, last) if head and last in AXES else (analysis.name, "")
        channels = found.setdefault(name, {})
        if axis in channels:
            raise ShapeError(f"two analyses are named '{analysis.name}'; give each channel a name of its own.")
        channels[axis] = analysis
    for name, channels in found.items():
        measured = {analysis.quantity for analysis in channels.values()}
        if len(measured) > 1:
            raise ShapeError(
                f"the axes of '{name}' measure {', '.join(sorted(measured))}; a triad measures one quantity."
            )
    return [Triad(name, channels) for name, channels in found.items()]
