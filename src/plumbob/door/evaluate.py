"""How far an attitude is from a reference: `plumbob eval`, in Python and on the command line."""

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Protocol

from plumbob.core.check import number, said
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.files import is_same_file
from plumbob.core.units import Quantity, given
from plumbob.data import AttitudeTrack
from plumbob.data.recording import found_in
from plumbob.door.reading import read
from plumbob.evaluation.align import ALIGNMENTS
from plumbob.evaluation.evaluation import judge
from plumbob.evaluation.report import Evaluation, EvaluationSettings


class Tracked(Protocol):
    """What holds an attitude, such as a `plumbob.Recording` with its reference."""

    @property
    def track(self) -> AttitudeTrack | None:
        """The attitude."""


def evaluate(
    estimate: AttitudeTrack | Tracked | str | Path,
    reference: AttitudeTrack | Tracked | str | Path,
    *,
    align: Collection[str] = (),
    max_gap: float | str | None = None,
    max_offset: float | str = 1.0,
    declination: float | str | None = None,
    settle: float | str = 0.0,
    profile: str | Path | None = None,
    note: Callable[[str], object] | None = None,
) -> Evaluation:
    """Judge an estimate by a reference.

    Parameters
    ----------
    estimate : AttitudeTrack, Recording, Estimated or path
        Judged at its own times, in its own frame; not where it carries `flags.NOT_CONVERGED`, because nothing had
        shown there that it is right.
    reference : AttitudeTrack, Recording or path
        The truth; where it has a ``score``, only those samples count. Of a recording, its ``track``.
    align : collection of {"time", "mounting", "heading"}
        Constants to find and remove, in that order; none by default, because a constant error is an error. Aligning
        time also removes the delay of a filter.
    max_gap : float or str, optional
        Largest step of the reference that is bridged, s, or text with a unit; by default 5 of its median steps.
    max_offset : float or str
        Largest time offset sought, s.
    declination : float or str, optional
        Of the place, rad, east positive; needed where one heading is true and the other magnetic.
    settle : float or str
        Time after the estimate's first sample that is left out, s.
    profile : path, optional
        What the columns of a reference in a text file mean.
    note : callable, optional
        Called with what was found in files.

    Returns
    -------
    Evaluation

    Raises
    ------
    ParameterError
        If a setting is unknown or out of range, or mounting and heading cannot be separated.
    ClockError
        If the two have no time in common, or no time offset can be found.
    FrameError
        If one heading is true, the other magnetic, and neither declination nor alignment bridges them.
    ShapeError
        If no sample is left to score, or one of the two is not an attitude and holds none.
    """
    words = (align,) if isinstance(align, str) or not isinstance(align, Collection) else tuple(align)
    if unknown := [word for word in words if not isinstance(word, str) or word not in ALIGNMENTS]:
        raise ParameterError(f"align knows {', '.join(ALIGNMENTS)}, but not {', '.join(map(said, unknown))}.")
    settings = EvaluationSettings(
        tuple(word for word in ALIGNMENTS if word in words),
        given("max_gap", max_gap, Quantity.TIME),
        number("max_offset", given("max_offset", max_offset, Quantity.TIME), "s"),
        given("declination", declination, Quantity.ANGLE),
        number("settle", given("settle", settle, Quantity.TIME), "s"),
    )
    if (
        isinstance(estimate, str | Path)
        and isinstance(reference, str | Path)
        and is_same_file(Path(estimate), Path(reference))
    ):
        raise ParameterError(f"{estimate} is both estimate and reference; name the track of 'plumbob run' first.")
    tracks = _attitude("estimate", estimate, None, note), _attitude("reference", reference, profile, note)
    return judge(*tracks, settings)


def _attitude(
    name: str,
    what: AttitudeTrack | Tracked | str | Path,
    profile: str | Path | None,
    note: Callable[[str], object] | None,
) -> AttitudeTrack:
    if isinstance(what, AttitudeTrack):
        return what
    if isinstance(what, str | Path):
        path = Path(what)
        recording = read(path, profile=profile)
        say = note or (lambda line: None)
        for line in found_in(recording.notes):
            say(f"{path.name}: {line}")
        if recording.track is None:
            raise ShapeError(
                f"{path} holds sensor data but no attitude; run a filter on it first: plumbob run {path} ..."
            )
        if name == "estimate" and recording.imu is not None:
            say(f"{path} holds sensor data: it looks like a recording with its reference, not an estimate")
        return recording.track
    if isinstance(held := getattr(what, "track", None), AttitudeTrack):
        return held
    kind = "has no track" if hasattr(what, "track") else f"is {said(what)}"
    raise ShapeError(
        f"{name} must be an AttitudeTrack, or a Recording that has one, but it {kind}. A filter's process gives an "
        "estimate; a file is read with plumbob.read."
    )
