"""One recording: what the sensors said, an attitude over time, or both."""

from collections.abc import Iterable
from dataclasses import dataclass

from plumbob.core import check
from plumbob.core.errors import ShapeError
from plumbob.data import AttitudeTrack, ImuData


@dataclass(frozen=True, eq=False)
class Recording:
    """What one file holds.

    Parameters
    ----------
    imu : ImuData or None
        The samples.
    track : AttitudeTrack or None
        With `imu`: the reference that belongs to it. Alone: an estimate or a reference.
    name : str
        Short name, usually the stem of the file.
    notes : tuple of str
        Provenance, one line each: where the data come from and what was done to them.

    Raises
    ------
    ShapeError
        If there is neither, or the notes are not lines of text.
    """

    imu: ImuData | None = None
    track: AttitudeTrack | None = None
    name: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a recording of nothing."""
        if self.imu is None and self.track is None:
            raise ShapeError("a recording needs imu, track or both, but neither was given.")
        for name, expected in (("imu", ImuData), ("track", AttitudeTrack)):
            if getattr(self, name) is not None:
                check.kind(name, getattr(self, name), expected)
        object.__setattr__(self, "notes", lines("notes", self.notes))


def lines(name: str, given: Iterable[str]) -> tuple[str, ...]:
    """Lines of text, each without breaks; one text is refused, for its lines would be its letters."""
    found = None if isinstance(given, str) or not isinstance(given, Iterable) else tuple(given)
    if found is None or not all(isinstance(line, str) for line in found):
        raise ShapeError(f"{name} must be a sequence of lines of text, but got {given!r}.")
    return tuple(" ".join(line.split()) for line in found)
