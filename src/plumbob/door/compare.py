"""How two recordings of one motion, or two attitudes, differ: `plumbob compare`, in Python and on the command line."""

from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from plumbob.core.check import number
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import Quantity, given
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.recording import Recording, found_in
from plumbob.door.evaluate import evaluate
from plumbob.door.reading import read
from plumbob.evaluation.align import ALIGNMENTS
from plumbob.evaluation.compare import LONGEST_OFFSET, Comparison, compare_attitudes, compare_recordings
from plumbob.files.formats import kind_of


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
    described = profile is not None and kind_of(what, described=True).takes_profile
    recording = read(what, profile=profile if described else None, unit=unit).of_unit(None)
    for line in found_in(recording.notes) if note is not None else ():
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
