"""One recording of a batch: read, calibrated, estimated, judged and written, and the record of it.

A record is written last. So a dataset of a run that was killed holds whole files only, and those without a record are
made again.
"""

import json
import math
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from plumbob.core.errors import DecodeError, LineError, MissingExtraError, PlumbobError, ShapeError, one_line
from plumbob.core.files import write_text
from plumbob.core.version import __version__
from plumbob.data import AttitudeTrack
from plumbob.data.recording import Recording
from plumbob.door.estimate import Estimated, estimate
from plumbob.door.evaluate import evaluate
from plumbob.files.formats import UnknownFormatError
from plumbob.fleet.items import JOBS, Item, input_digest
from plumbob.fleet.places import Place, as_place
from plumbob.fleet.settings import BatchSettings
from plumbob.overview.overview import Overview, make_gatherer
from plumbob.overview.report_entry import Subject, opened, subject_from
from plumbob.overview.tables import heading_numbers, inclination_numbers, motion_numbers, summary
from plumbob.quality import quality
from plumbob.reporting.report import plain

DONE, REFUSED, DAMAGED, FAILED = "done", "refused", "damaged", "failed"
VERDICTS: Final = {
    DONE: "its attitude is in the dataset",
    REFUSED: "it can be read, but not be used as it is",
    DAMAGED: "it cannot be read as what it claims to be",
    FAILED: "not by its own fault: memory, a network, a missing package, a defect; the next run tries it again",
}

COLUMNS: Final[Mapping[str, type]] = {
    "recording": str, "verdict": str, "reason": str, "source": str, "device": str, "samples": int,
    "duration_s": float, "rate_hz": float, "gaps": int, "gap_share": float, "missing_samples": int,
    "flags": str, "grade": str, "grades": str,
    "roll_mean_deg": float, "roll_std_deg": float, "roll_significant_deg": float, "roll_tz_s": float,
    "pitch_mean_deg": float, "pitch_std_deg": float, "pitch_significant_deg": float, "pitch_tz_s": float,
    "inclination_mean_deg": float, "inclination_greatest_deg": float, "inclination_beyond_share": float,
    "heading_mean_deg": float, "heading_spread_deg": float,
    "total_rmse_deg": float, "heading_rmse_deg": float, "inclination_rmse_deg": float, "not_scored": str,
    "frame": str, "north": str, "filter": str, "calibration": str, "remarks": str,
    "seconds": float, "input_sha256": str, "settings_sha256": str, "software": str,
}  # fmt: skip
"""Columns of the table of verdicts, with what they hold; None where it is not known."""


class StoppedError(Exception):
    """The batch is ending, and this job with it."""


@dataclass(frozen=True, slots=True)
class JobOutcome:
    """What a job says when it is over.

    Attributes
    ----------
    name : str
        Of the recording.
    verdict : str
        One of `VERDICTS`.
    reason : str
        Why it is not done.
    skipped : bool
        Whether it was so already.
    seconds : float
        Time that it took.
    """

    name: str
    verdict: str
    reason: str
    skipped: bool
    seconds: float


def part_path(key: str) -> str:
    """Where the attitudes of a recording are in a dataset."""
    return f"attitude/recording={key}/part.parquet"


def page_path(key: str) -> str:
    """Where the page about a recording is."""
    return f"pages/{key}.html"


def record_path(key: str) -> str:
    """Where the record of a job is."""
    return f"{JOBS}/{key}.json"


def run_job(settings: BatchSettings, item: Item, out: str, stop: threading.Event | None = None) -> JobOutcome:
    """Do all that belongs to one recording, unless it has been done: the same input by the same settings.

    Parameters
    ----------
    settings : BatchSettings
        Of the batch.
    item : Item
        The recording.
    out : str
        Path or URL of the dataset.
    stop : Event, optional
        Set where the batch is ending.

    Raises
    ------
    ParameterError
        If the settings are wrong.
    DecodeError, LineError
        If the dataset cannot be written.
    StoppedError
        If `stop` is set.
    """
    settings.prepare()
    began = time.perf_counter()
    place = as_place(out)
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row |= {"recording": item.name, "source": item.where, "settings_sha256": settings.digest, "software": __version__}
    output: _JobResult | None = None
    copy = ""
    try:
        with item.local(settings.max_bytes) as given:
            copy = "" if isinstance(given, Recording) else f"{given}: "
            row["input_sha256"] = input_digest(given)
            if (before := _before(place, item.key, row)) is not None:
                spent = time.perf_counter() - began
                return JobOutcome(item.name, before["verdict"], before["reason"] or "", True, spent)
            output = _worked(settings, item, given, stop)
        row |= output.row | {"verdict": DONE}
    except Exception as error:
        if isinstance(error, StoppedError):
            raise
        row |= {"verdict": _verdict(error), "reason": _reason(error).replace(copy, "")}
    if stop is not None and stop.is_set():  # the batch may be gone already, and another one have begun
        raise StoppedError
    _written(place, item.key, row, output, began)
    return JobOutcome(item.name, row["verdict"], row["reason"] or "", False, row["seconds"])


def failed(settings: BatchSettings, item: Item, out: str, reason: str) -> JobOutcome:
    """Record of a job whose worker did not come back."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row |= {"recording": item.name, "source": item.where, "settings_sha256": settings.digest, "software": __version__}
    row |= {"verdict": FAILED, "reason": reason}
    _written(as_place(out), item.key, row, None, time.perf_counter())
    return JobOutcome(item.name, FAILED, reason, False, 0.0)


def _verdict(error: Exception) -> str:
    if isinstance(error, DecodeError) and not isinstance(error, UnknownFormatError):
        return DAMAGED
    if isinstance(error, PlumbobError) and not isinstance(error, MissingExtraError | LineError):
        return REFUSED
    return DAMAGED if isinstance(error, FileNotFoundError | PermissionError) else FAILED


def _reason(error: Exception) -> str:
    if isinstance(error, PlumbobError):
        return one_line(error)
    if isinstance(error, OSError):
        return f"it cannot be read: {error.strerror or one_line(error)}."
    return f"{type(error).__name__}: {one_line(error)}"


def _before(place: Place, key: str, row: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Row of the record of a job that need not be done again."""
    try:
        old = json.loads(place.read(record_path(key)) or b"null")
        same = old is not None and all(old["row"][name] == row[name] for name in ("input_sha256", "settings_sha256"))
        if not same or old["row"]["verdict"] == FAILED:
            return None
        recorded: Mapping[str, Any] = old["row"]
        return recorded if recorded["verdict"] != DONE or place.has(part_path(key)) else None
    except (ValueError, KeyError, TypeError):  # not a record: it is written again
        return None


@dataclass(frozen=True, slots=True)
class _JobResult:
    """What a recording gave."""

    result: Estimated
    row: dict[str, Any]
    statistics: Mapping[str, Any]
    page: str | None


def _worked(settings: BatchSettings, item: Item, given: Path | Recording, stop: threading.Event | None) -> _JobResult:
    """Estimate and judge."""
    gatherer = make_gatherer(burst=settings.burst, tilt_limit=settings.tilt_limit)
    how = {name: value for name, value in settings.how.items() if name not in ("unit", "profile")}

    def going_on(_done: int, _all: int) -> None:
        if stop is not None and stop.is_set():
            raise StoppedError

    with opened(given, settings.how, whole=True) as (recording, paths, session):
        if recording.imu is None:
            raise ShapeError("it holds an attitude but no sensor data, so there is nothing to estimate from.")
        card = settings.card_for(recording.imu.meta.device)
        if card is None and session is not None:
            card = session.card
        going_on(0, 0)
        named = replace(recording, name=item.name)
        result = estimate(named, **how, calibration=card, noise=settings.noise, follow=gatherer, progress=going_on)
        subject = subject_from(result, gatherer, paths if settings.pages else (), session)
        errors = {} if result.reference is None else _errors(settings, result.track, result.reference)
        page = Overview((subject,)).page() if settings.pages else None
    statistics = _statistics(subject)
    return _JobResult(result, _row(subject) | errors, statistics, page)


def _errors(settings: BatchSettings, track: AttitudeTrack, reference: AttitudeTrack) -> dict[str, Any]:
    """Errors against the reference; words where they cannot be compared."""
    try:
        summary = evaluate(track, reference, align=settings.align, settle=settings.settle).summary()
    except PlumbobError as error:
        return {"not_scored": one_line(error)}
    missing = "; ".join(f"{name}: {why}" for name, why in summary["not_scored"].items())
    keys = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg")
    return {key: summary[key] for key in keys} | {"not_scored": missing or None}


def _row(subject: Subject) -> dict[str, Any]:
    """Numbers of the table of verdicts."""
    g = subject.gathered
    assert g.tilt is not None and g.headings is not None
    row: dict[str, Any] = {
        "device": dict(subject.facts).get("device"), "samples": g.samples, "duration_s": g.duration,
        "rate_hz": 1.0 / g.step, "gaps": len(g.gaps), "gap_share": g.lost / max(g.duration, g.step),
        "missing_samples": g.missing,
        "flags": ", ".join(f"{name} {flag.samples}" for name, flag in g.flags.items()),
        "remarks": " | ".join(subject.remarks), "filter": subject.numbers["filter"],
        **{name: subject.numbers[name] for name in ("frame", "north", "calibration")},
    }  # fmt: skip
    motions = {"roll": motion_numbers(g.tilt.roll), "pitch": motion_numbers(g.tilt.pitch)}
    for stem, numbers in (
        *motions.items(), ("inclination", inclination_numbers(g.tilt.inclination)),
        ("heading", heading_numbers(g.headings)),
    ):  # fmt: skip
        row |= {f"{stem}_{name}": value for name, value in numbers.items() if f"{stem}_{name}" in COLUMNS}
    grades = _grades(subject)
    worst = max(grades.values(), key=_WORST.index, default=quality.MISSING)
    row["grade"] = quality.MEANING[worst]
    row["grades"] = ", ".join(f"{name} {quality.MEANING[flag]}" for name, flag in grades.items())
    return {name: _finite(value) for name, value in row.items()}


_WORST: Final = (1, 2, 9, 3, 4)
"""Flags of quality from the best to the worst."""


def _grades(subject: Subject) -> dict[str, int]:
    """Worst flag of each channel."""
    worst: dict[str, int] = {}
    for burst in subject.gathered.bursts:
        for name, verdict in burst.verdicts.items():
            worst[name] = max(verdict.flag, worst.get(name, 1), key=_WORST.index)
    return worst


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


_LEFT_OUT: Final = ("provenance", "spectra", "quality_thresholds", "plot")
"""What a record does without: it is long, or the same in all."""


def _statistics(subject: Subject) -> dict[str, Any]:
    """Numbers of the report, without spectra."""
    spectra_apart = replace(subject, gathered=replace(subject.gathered, spectra=None))
    return {name: value for name, value in summary(spectra_apart).items() if name not in _LEFT_OUT}


def _written(place: Place, key: str, row: dict[str, Any], output: _JobResult | None, began: float) -> None:
    """Write the attitudes and the page, or remove old ones; then the record."""
    if output is None or output.page is None:
        place.remove(page_path(key))
    if output is None:
        place.remove(part_path(key))
    else:
        place.write(part_path(key), lambda path: output.result.save(path, overwrite=True))
        if (page := output.page) is not None:
            place.write(page_path(key), lambda path: write_text(path, page, overwrite=True))
    row["seconds"] = round(time.perf_counter() - began, 6)
    record = {"row": row, "statistics": None if output is None else output.statistics}
    text = json.dumps(plain(record), allow_nan=False)
    place.write(record_path(key), lambda path: write_text(path, text, overwrite=True))
