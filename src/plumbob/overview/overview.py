"""One's recordings on one page: `plumbob report`."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.core import check, units
from plumbob.core.errors import ParameterError
from plumbob.core.result import Reported
from plumbob.core.units import Quantity, to_deg
from plumbob.data import ImuData
from plumbob.data.recording import Recording
from plumbob.overview.report_entry import Progress, Subject, duration, read_subject, subject_from
from plumbob.overview.streaming_stats import WHOLE, Gatherer
from plumbob.quality.grade import grade
from plumbob.rotations import Frame

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard, NoiseCard
    from plumbob.door.estimate import Estimated

Source = str | PathLike[str] | Recording | ImuData


@dataclass(frozen=True, eq=False, repr=False)
class Overview(Reported):
    """Recordings, each with its statistics and traces.

    Attributes
    ----------
    subjects : tuple of Subject
        In the order in which they were given.
    """

    subjects: tuple[Subject, ...]

    def facts(self) -> Mapping[str, str]:
        """Recordings, and the first one's tilt."""
        g = self.subjects[0].gathered
        facts = {"recordings": ", ".join(subject.name for subject in self.subjects), "duration": duration(g.duration)}
        if g.tilt is not None:
            facts["roll"] = f"std {to_deg(g.tilt.roll.sd):.2f}°"
            facts["pitch"] = f"std {to_deg(g.tilt.pitch.sd):.2f}°"
        return facts

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        return {"recordings": [subject.summary() for subject in self.subjects]}


def report(
    files: Source | Sequence[Source],
    *,
    filter: str | None = None,
    causal: bool = False,
    lag: float | str | None = None,
    params: Mapping[str, Any] | None = None,
    frame: Frame | str | None = None,
    init: str | None = None,
    calibration: "CalibrationCard | str | Path | None" = None,
    noise: "NoiseCard | str | Path | None" = None,
    place: str | None = None,
    date: str | None = None,
    profile: str | Path | None = None,
    unit: str | None = None,
    burst: float | str = "20 min",
    tilt_limit: float | str = "15 deg",
    out: str | Path | None = None,
    pdf: str | Path | None = None,
    lang: str = "en",
    overwrite: bool = False,
    note: Callable[[str], object] | None = None,
    progress: Progress | None = None,
) -> Overview:
    """Say on one page what recordings hold: attitude with its statistics, sensors, spectra, gaps and quality.

    Parameters
    ----------
    files : path, Recording or ImuData, or a sequence of them
        Recordings of any format that `plumbob.read` takes. Several: a part for each, and a table beside each other.
    filter : str, optional
        As of `plumbob.estimate`, by default "smoother"; "track": the attitude that the file holds, of a recorded stream
        what was estimated live; "none": no attitude. A file that holds only an attitude is taken as it is.
    causal, lag, params, frame, init, calibration, noise, place, date, profile, unit : optional
        As of `plumbob.estimate`. Without `calibration`, a recorded stream takes the card of its session.
    burst : float or str
        Length of a burst, s, or text with a unit; statistics are given for each.
    tilt_limit : float or str
        Inclination that counts as large, rad, or text with a unit.
    out : path, optional
        Where to write the page, HTML.
    pdf : path, optional
        Where to write it as a PDF, which Chromium or Chrome prints.
    lang : {"en", "zh"}
        Language of the labels.
    overwrite : bool
        Whether files that lie there may be replaced.
    note : callable, optional
        Called with each remark as it is found.
    progress : callable, optional
        Called with the name of a recording, the number of its samples done, and of all.

    Returns
    -------
    Overview
        Its `text`, `summary`, `write_html`, `write_pdf` and `plot` give the same again.

    Raises
    ------
    ParameterError
        If an option is not known, two of them contradict each other, or the file lacks the attitude that was asked for.
    ShapeError, FrameError, CalibrationError, DecodeError
        As of `plumbob.estimate`.
    MissingExtraError
        If a page is asked for and those of Plumbob are not built, or a PDF and neither Chromium nor Chrome is there.
    """
    given = list(files) if isinstance(files, list | tuple) else [files]
    if not given:
        raise ParameterError("a report needs a recording, but none was given. Name one.")
    how = {
        "filter": filter, "causal": causal, "lag": lag, "params": params, "frame": frame, "init": init,
        "calibration": calibration, "noise": noise, "place": place, "date": date, "profile": profile, "unit": unit,
    }  # fmt: skip
    most = max(2, WHOLE // len(given))
    subjects = []
    for file in given:
        gatherer = make_gatherer(burst=burst, tilt_limit=tilt_limit, most=most)
        source = file if isinstance(file, Recording | ImuData) else check.path("files", file)
        subjects.append(read_subject(source, gatherer, how, note=note, progress=progress))  # type: ignore[arg-type]
    made = Overview(tuple(subjects))
    if out is not None:
        made.write_html(out, lang=lang, overwrite=overwrite)
    if pdf is not None:
        made.write_pdf(pdf, lang=lang, overwrite=overwrite)
    return made


def make_gatherer(
    *, burst: float | str = "20 min", tilt_limit: float | str = "15 deg", most: int = WHOLE, **more: Any
) -> Gatherer:
    """Gatherer with options that may be text with a unit.

    ParameterError if one of them is not positive, or the limit is not an inclination.
    """
    length = units.given("burst", burst, Quantity.TIME)
    limit = units.given("tilt_limit", tilt_limit, Quantity.ANGLE)
    assert length is not None and limit is not None
    for name, value in (("burst", length), ("tilt_limit", limit)):
        if not 0.0 < value < math.inf:
            raise ParameterError(f"{name} must be above 0, but it is {value:g}. Give a positive one.")
    if limit >= math.pi:
        raise ParameterError(f"tilt_limit must be below 180°, but it is {to_deg(limit):g}°. Give a smaller one.")
    return Gatherer(burst=length, limit=limit, most=most, **more)


def of_estimate(result: "Estimated", gatherer: Gatherer, file: str | Path) -> Overview:
    """Overview of an estimate that a gatherer has followed, and the file that it is of.

    The grade is that of the samples that the filter was given, calibrated where they were.
    """
    graded = grade(result.imu, result.inferred)
    return Overview((subject_from(result, gatherer, (Path(file),), graded=graded),))
