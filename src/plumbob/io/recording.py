"""One recording: what the sensors said, an attitude over time, or both."""

from dataclasses import dataclass

from plumbob.data import AttitudeTrack, ImuData
from plumbob.errors import ShapeError


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
        if isinstance(self.notes, str) or not all(isinstance(note, str) for note in self.notes):
            raise ShapeError(f"notes must be a sequence of lines of text, but got {self.notes!r}.")
        object.__setattr__(self, "notes", tuple(" ".join(note.split()) for note in self.notes))
