"""One's recordings on one page: `plumbob report`, and single figures of them: `plumbob report --figure`."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.core import check, units
from plumbob.core.errors import ParameterError
from plumbob.core.result import Reported
from plumbob.core.units import Quantity, to_deg
from plumbob.data import ImuData
from plumbob.data.recording import Recording
from plumbob.overview.figures import WHATS, figure, figures
from plumbob.overview.report_entry import Progress, Subject, duration, read_subject, subject_from
from plumbob.overview.streaming_stats import WHOLE, Gatherer
from plumbob.overview.tables import comparison_table, definitions, remarks, summary, tables
from plumbob.quality.grade import grade
from plumbob.reporting.report import Report
from plumbob.rotations import Frame

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard, NoiseCard
    from plumbob.door.estimate import Estimated

Source = str | PathLike[str] | Recording | ImuData

TITLE: Final = "Attitude report"
_WIDTHS: Final = 0.03, 1.0  # least and greatest width of a picture, m


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

    def report(self) -> Report:
        """What is to be said, with figures for a paper."""
        if len(self.subjects) == 1:
            return _report(self.subjects[0], TITLE, definitions=definitions(self.subjects))
        return Report(
            TITLE,
            tables=[comparison_table(self.subjects)],
            parts=[_report(subject, subject.name) for subject in self.subjects],
            definitions=definitions(self.subjects),
        )

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        return {"recordings": [summary(subject) for subject in self.subjects]}

    def page(self, *, lang: str = "en") -> str:
        """HTML of the page, self-contained, its labels in a language of `plumbob.reporting.content.LANGUAGES`.

        Raises
        ------
        MissingExtraError
            If the pages of Plumbob are not built here.
        """
        from plumbob.overview.page import page

        return page(self.subjects, TITLE, definitions(self.subjects), lang=lang)

    def write_pdf(self, path: str | Path, *, lang: str = "en", overwrite: bool = False) -> Path:
        """Write the page as a PDF, which Chromium or Chrome prints.

        Raises
        ------
        MissingExtraError
            If neither is installed, or the pages of Plumbob are not built here.
        """
        from plumbob.overview.page import print_pdf

        return print_pdf(self.page(lang=lang), Path(path), overwrite=overwrite)


def _report(subject: Subject, title: str, *, definitions: Sequence[str] = ()) -> Report:
    return Report(
        title,
        facts=subject.facts,
        tables=tables(subject),
        remarks=remarks(subject),
        figures=list(figures(subject).values()),
        definitions=definitions,
    )


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

    Raises
    ------
    ParameterError
        If one of them is not positive, or the limit is not an inclination.
    """
    length = units.given("burst", burst, Quantity.TIME)
    limit = units.given("tilt_limit", tilt_limit, Quantity.ANGLE)
    assert length is not None and limit is not None
    for name, value in (("burst", length), ("tilt_limit", limit)):
        if not 0.0 < value < math.inf:
            raise ParameterError(f"{name} must be above 0, but it is {value:g}. Give a positive one.")
    if limit >= math.pi:
        raise ParameterError(f"an inclination is below 180°, but tilt_limit is {to_deg(limit):g}°. Give a smaller one.")
    return Gatherer(burst=length, limit=limit, most=most, **more)


def of_estimate(result: "Estimated", gatherer: Gatherer, file: str | Path) -> Overview:
    """Overview of an estimate that a gatherer has followed, and the file that it is of.

    The grade is that of the samples that the filter was given, calibrated where they were.
    """
    graded = grade(result.imu, result.inferred)
    return Overview((subject_from(result, gatherer, (Path(file),), graded=graded),))


def plot(
    file: Source,
    out: str | Path,
    *,
    what: str = "angles",
    begin: float | str | None = None,
    end: float | str | None = None,
    width: float | str | None = None,
    lang: str = "en",
    overwrite: bool = False,
    burst: float | str = "20 min",
    tilt_limit: float | str = "15 deg",
    note: Callable[[str], object] | None = None,
    progress: Progress | None = None,
    **how: Any,
) -> Path:
    """Draw one figure of a recording for a paper.

    Parameters
    ----------
    file : path, Recording or ImuData
        The recording.
    out : path
        The picture; its ending says whether it is SVG, PNG or PDF.
    what : str
        One of "angles", "tilt", "rates", "forces", "field", "temperature", "bias", "sd", "spectrum", "rose", "bursts"
        and "flags".
    begin, end : float or str, optional
        Times between which samples count, s, or text with a unit; the attitude is estimated of the whole recording.
    width : float or str, optional
        Of the picture, m, or text with a unit, as "85 mm" for a column.
    lang : {"en", "zh"}
        Language of the labels.
    overwrite : bool
        Whether a picture that lies there may be replaced.
    burst, tilt_limit, note, progress : optional
        As of `report`.
    **how
        As of `report`: `filter`, `calibration` and the others of `plumbob.estimate`.

    Returns
    -------
    Path
        Where it is.

    Raises
    ------
    ParameterError
        If the figure is not known, nothing of the recording can be drawn in it, or the file's name has another ending.
    MissingExtraError
        If matplotlib is not installed.
    """
    from plumbob.reporting.drawing import picture, picture_kind

    target = check.path("out", out)
    picture_kind(target)
    if what not in WHATS:
        raise ParameterError(f"there is not a figure '{what}'. Give one of {', '.join(WHATS)}.")
    window = (units.given("begin", begin, Quantity.TIME), units.given("end", end, Quantity.TIME))
    low, high = (-math.inf if window[0] is None else window[0], math.inf if window[1] is None else window[1])
    inches = _inches(units.given("width", width, Quantity.LENGTH))
    gatherer = make_gatherer(burst=burst, tilt_limit=tilt_limit, window=(low, high))
    source = file if isinstance(file, Recording | ImuData) else check.path("file", file)
    subject = read_subject(source, gatherer, how, graded=False, note=note, progress=progress)  # type: ignore[arg-type]
    return picture(target, [figure(subject, what)], lang=lang, overwrite=overwrite, width=inches)


def _inches(width: float | None) -> float | None:
    """Width of a picture, m, in inches."""
    if width is None:
        return None
    if not _WIDTHS[0] <= width <= _WIDTHS[1]:
        raise ParameterError(
            f"the width of a picture is {1e3 * _WIDTHS[0]:g} to {1e3 * _WIDTHS[1]:g} mm, but it is {1e3 * width:g} mm. "
            "Give one in between, as 85mm."
        )
    return width / 0.0254
