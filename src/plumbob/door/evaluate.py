"""How far an attitude is from a reference (`plumbob eval`), and how two recordings of one motion differ (`compare`)."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from plumbob.core.check import number, said
from plumbob.core.errors import ParameterError, PlumbobError, ShapeError
from plumbob.core.files import is_same_file
from plumbob.core.findings import warnings
from plumbob.core.units import Quantity, given
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.recording import Recording
from plumbob.door.reading import read
from plumbob.evaluation.align import ALIGNMENTS
from plumbob.evaluation.compare import LONGEST_OFFSET, Comparison, compare_attitudes, compare_recordings
from plumbob.evaluation.evaluation import Evaluation, EvaluationSettings, judge
from plumbob.files.formats import is_own, kind_of


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
        shown there that it is right. Of a recorded stream, what was estimated live.
    reference : AttitudeTrack, Recording or path
        The truth; where it has a ``score``, only those samples count. Of a recording, its ``track``.
        Where the estimate is a recorded stream: the name of another of its sources, or the same file for the attitude
        in the frames.
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
    paths = [Path(what) for what in (estimate, reference) if isinstance(what, str | Path)]
    if len(paths) == 2 and is_same_file(*paths) and not is_own(paths[0]):
        raise ParameterError(f"{estimate} is both estimate and reference; name the track of 'plumbob run' first.")
    if len(paths) == 2 and is_own(paths[0]) and not paths[1].exists():
        reference = read(paths[0], unit=str(reference))
        for line in reference.notes if note is not None else ():
            note(f"{paths[0].name}: {line}")  # type: ignore[misc]
    tracks = opened_attitude("estimate", estimate, None, note), opened_attitude("reference", reference, profile, note)
    return judge(*tracks, settings)


def brief_errors(track: AttitudeTrack, reference: AttitudeTrack) -> dict[str, Any]:
    """Errors against the reference that a recording carries, degrees; a word where they cannot be compared.

    Headings from two norths without a declination say nothing, but inclinations do.
    """
    try:
        summary = evaluate(track, reference).summary()
    except PlumbobError as error:
        if track.north is reference.north:
            return {"not_compared": str(error)}
        try:
            aligned = evaluate(track, reference, align=("heading",)).summary()
        except PlumbobError:
            return {"not_compared": str(error)}
        return {"not_compared": str(error), "inclination_rmse_deg": aligned["inclination_rmse_deg"]}
    keys = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg")
    return {key: summary[key] for key in keys} | {"not_scored": summary["not_scored"]}


def error_lines(errors: Mapping[str, Any]) -> list[str]:
    """What `brief_errors` gives, a line each."""
    lines = []
    for name, value in errors.items():
        if value is not None and name != "not_scored":
            shown = value if isinstance(value, str) else f"{value:.3f}°"
            lines.append(f"error        {name.removesuffix('_deg').replace('_', ' ')}: {shown}")
    return [*lines, *(f"not scored   {name}: {why}" for name, why in errors.get("not_scored", {}).items())]


def opened_attitude(
    name: str,
    what: AttitudeTrack | Tracked | str | Path,
    profile: str | Path | None,
    note: Callable[[str], object] | None,
) -> AttitudeTrack:
    """Attitude of what was given; errors as of `evaluate`."""
    if isinstance(what, AttitudeTrack):
        return what
    if isinstance(what, str | Path):
        path = Path(what)
        was_live = name == "estimate" and is_own(path)
        recording = read(path, estimated=True) if was_live else read(path, profile=profile)
        say = note or (lambda line: None)
        for line in warnings(recording.notes):
            say(f"{path.name}: {line}")
        if recording.track is None:
            raise ShapeError(
                f"{path} holds sensor data but no attitude; run a filter on it first: plumbob run {path} ..."
            )
        if name == "estimate" and recording.imu is not None and not was_live:
            say(f"{path} holds sensor data: it looks like a recording with its reference, not an estimate")
        return recording.track
    if isinstance(held := getattr(what, "track", None), AttitudeTrack):
        return held
    kind = "has no track" if hasattr(what, "track") else f"is {said(what)}"
    raise ShapeError(
        f"{name} must be an AttitudeTrack, or a Recording that has one, but it {kind}. A filter's process gives an "
        "estimate; a file is read with plumbob.read."
    )


def compare(
    a: Recording | ImuData | AttitudeTrack | str | Path,
    b: Recording | ImuData | AttitudeTrack | str | Path,
    *,
    align: Collection[str] | None = None,
    max_offset: float | str = LONGEST_OFFSET,
    tolerance: float | str | None = None,
    settle: float | str = 0.0,
    declination: float | str | None = None,
    unit: str | None = None,
    profile: str | Path | None = None,
    note: Callable[[str], object] | None = None,
) -> Comparison:
    """Compare two recordings of one motion, or two attitudes.

    Parameters
    ----------
    a, b : Recording, ImuData, AttitudeTrack or path
        Samples are compared where both have them, else attitudes; of these a is judged by b, as by `plumbob.evaluate`.
    align : collection of {"time", "mounting", "heading"}, optional
        What is removed before differences are measured. By default time and mounting of recordings, of which all is
        found and said anyway, and nothing of attitudes. Headings are those of attitudes.
    max_offset : float or str
        Largest time offset sought, s.
    tolerance : float or str, optional
        Of attitudes an angle, rad or text with a unit: the largest total difference. Of recordings a share: the root
        mean square of the difference of each triad over that of a. 0 asks for equality to the bit.
    settle : float or str
        Of attitudes: time after the start of a that is left out, s.
    declination : float or str, optional
        Of attitudes: where one heading is true and the other magnetic, rad.
    unit : str, optional
        One of several units, by name or number from 1.
    profile : path, optional
        What the columns of text files mean.
    note : callable, optional
        Called with what was found in files.

    Returns
    -------
    Comparison

    Raises
    ------
    ParameterError
        If a setting is unknown or out of range.
    ShapeError
        If one holds only samples and the other only an attitude, or attitudes have nothing in common.
    """
    first, ref = (_opened(what, unit, profile, note) for what in (a, b))
    if align is not None and (bad := [word for word in align if word not in ALIGNMENTS]):
        raise ParameterError(f"align knows {', '.join(ALIGNMENTS)}, but not {', '.join(map(str, bad))}.")
    if first.imu is not None and ref.imu is not None:
        most = number("max_offset", given("max_offset", max_offset, Quantity.TIME), "s")
        return compare_recordings(first, ref, ("time", "mounting") if align is None else align, most, _part(tolerance))
    if first.track is None or ref.track is None:
        raise ShapeError(
            f"{first.name or 'a'} and {ref.name or 'b'} have nothing to compare: one holds samples alone, the other an "
            "attitude alone. Run a filter on the samples first: plumbob run."
        )
    limit = given("tolerance", tolerance, Quantity.ANGLE)
    score = evaluate(first.track, ref.track, align=align or (), max_offset=max_offset, settle=settle,
                     declination=declination)  # fmt: skip
    return compare_attitudes(first, ref, score, limit)


def _opened(what: Any, unit: str | None, profile: str | Path | None, note: Callable[[str], object] | None) -> Recording:
    if isinstance(what, ImuData):
        return Recording(imu=what)
    if isinstance(what, AttitudeTrack):
        return Recording(track=what)
    if isinstance(what, Recording):
        return what.of_unit(unit)
    described = profile is not None and "profile" in kind_of(what, described=True).takes
    recording = read(what, profile=profile if described else None, unit=unit).of_unit(None)
    for line in warnings(recording.notes) if note is not None else ():
        note(f"{Path(what).name}: {line}")  # type: ignore[misc]
    return replace(recording, name=Path(what).name)


def _part(tolerance: float | str | None) -> float | None:
    if tolerance is None:
        return None
    text = str(tolerance).strip()
    try:
        share = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        share = float("nan")
    if not 0.0 <= share < np.inf:
        raise ParameterError(f"tolerance of recordings is a share, such as 0.01 or 1%, but got {tolerance}.")
    return share
