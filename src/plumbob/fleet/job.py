"""One recording of a batch: read, calibrated, estimated, judged and written, and the record of it.

A record is written last. So a dataset of a run that was killed holds whole files only, and those without a record are
made again.
"""

import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from plumbob.core import __version__, errors
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, one_line
from plumbob.core.files import existing_file, file_sha256, write_text
from plumbob.core.result import plain
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.door.estimate import Estimated, estimate
from plumbob.door.evaluate import evaluate
from plumbob.fleet.items import JOBS, Item, input_digest
from plumbob.overview.report_entry import Subject, opened, subject_from
from plumbob.overview.streaming_stats import BURST
from plumbob.quality import quality
from plumbob.quality.tilt import LIMIT
from plumbob.quality.waves import WaveSettings
from plumbob.reporting.overview import Overview, make_gatherer
from plumbob.rotations import Frame

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard, NoiseCard

# Refused: it can be read, but not be used as it is; damaged: it cannot be read as what it claims to be; failed: not by
# its own fault, but by memory, a network, a missing package or a defect, so that the next run tries it again.
DONE, REFUSED, DAMAGED, FAILED = VERDICTS = "done", "refused", "damaged", "failed"
COLUMNS: Final[Mapping[str, type]] = {  # of the table of verdicts, with what they hold; None where it is not known
    "recording": str, "verdict": str, "reason": str, "source": str, "device": str,
    "begin_utc": str, "end_utc": str, "samples": int,
    "duration_s": float, "rate_hz": float, "gaps": int, "gap_share": float, "missing_samples": int,
    "flags": str, "grade": str, "grades": str,
    "roll_mean_deg": float, "roll_std_deg": float, "roll_significant_deg": float, "roll_tz_s": float,
    "pitch_mean_deg": float, "pitch_std_deg": float, "pitch_significant_deg": float, "pitch_tz_s": float,
    "inclination_mean_deg": float, "inclination_greatest_deg": float, "inclination_beyond_share": float,
    "heading_mean_deg": float, "heading_spread_deg": float,
    "hm0_m": float, "tp_s": float, "tm02_s": float, "wave_direction_deg": float, "wave_spread_deg": float,
    "wave_flag": int,
    "total_rmse_deg": float, "heading_rmse_deg": float, "inclination_rmse_deg": float, "not_scored": str,
    "frame": str, "north": str, "filter": str, "calibration": str, "remarks": str,
    "seconds": float, "input_sha256": str, "settings_sha256": str, "part_sha256": str, "software": str,
}  # fmt: skip
_ERRORS: Final = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg")
_LEFT_OUT: Final = ("provenance", "spectra", "quality_thresholds", "plot")  # of a record: long, or the same in all
_WORST: Final = (1, 2, 9, 3, 4)  # flags of quality from the best to the worst
_TRIAL_NS: Final = 1_767_225_600_000_000_000  # 2026-01-01 UTC, within the years of the World Magnetic Model 2025


@dataclass(frozen=True)
class BatchSettings:
    """What every job of a batch does alike; what is not explained here is as of `plumbob.batch`, in SI."""

    how: Mapping[str, Any]  # arguments of `plumbob.estimate` besides cards that are given; JSON can hold them
    cards: "Mapping[str | None, CalibrationCard]"  # each for the recordings of its device; of None for all
    noise: "NoiseCard | None" = None
    burst: float = BURST
    tilt_limit: float = LIMIT
    align: tuple[str, ...] = ()
    settle: float = 0.0
    pages: bool = False
    waves: bool | WaveSettings = False
    max_bytes: int = 4 << 30
    software: str = __version__  # version of the program that must do it

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all that a result depends on besides the recording."""
        settings = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "max_bytes"}
        if (profile := self.how.get("profile")) is not None:
            settings["how"] = {**self.how, "profile": existing_file(profile).read_bytes().hex()}
        text = json.dumps(
            settings, sort_keys=True, default=lambda card: card.text() if hasattr(card, "text") else str(card)
        )
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of `plumbob.estimate` for a recording that is open already."""
        how = {name: value for name, value in self.how.items() if name not in ("unit", "profile")}
        return {**how, "noise": self.noise}

    def card_for(self, device: str) -> "CalibrationCard | None":
        """Card for the recordings of a device; None where there is no card at all."""
        card = self.cards.get(None, self.cards.get(device))
        if card is not None or not self.cards:
            return card
        raise errors.CalibrationError(
            f"none of the {len(self.cards)} calibration cards is of the device '{device}'. Add its card, or run it "
            "separately without one."
        )

    def try_out(self) -> None:
        """Hash all, and estimate five simulated seconds at rest: wrong options show before a recording is read."""
        from plumbob.simulation import simulate

        _ = self.digest  # kept, so that it goes with the settings to the jobs
        frame = Frame.parse(self.how.get("frame") or "ENU")
        rest = simulate("static", frame=frame, duration=5.0, sensors="mpu6000+hmc5983", unit="calibrated", seed=1)
        imu = rest.imu.corrected(meta=ImuMeta(device="trial", frame=frame, t0_ns=_TRIAL_NS))
        gatherer = make_gatherer(burst=self.burst, tilt_limit=self.tilt_limit)
        result = estimate(Recording(imu=imu, name="trial"), **self.arguments, follow=gatherer)
        if self.pages:
            Overview((subject_from(result, gatherer),)).page()


class JobOutcome(NamedTuple):
    """What a job says when it is over."""

    name: str  # of the recording
    verdict: str  # one of `VERDICTS`
    reason: str  # why it is not done
    skipped: bool  # whether it was so already


_JobResult = tuple[Estimated, Mapping[str, Any], str | None]  # with its statistics and page


def part_path(key: str) -> str:
    """Where the attitudes of a recording are in a dataset."""
    return f"attitude/recording={key}/part.parquet"


def run_job(settings: BatchSettings, item: Item, dataset: Path) -> JobOutcome:
    """Do all that belongs to one recording, unless the dataset has it: the same input by the same settings."""
    if settings.software != __version__:
        raise ParameterError(
            f"the batch was started by plumbob {settings.software}, but this worker runs {__version__}. Install one "
            "version everywhere."
        )
    began = time.perf_counter()
    row, made, copy = _new_row(settings, item), None, ""
    try:
        with item.local(settings.max_bytes) as given:
            copy = "" if isinstance(given, Recording) else f"{given}: "
            row["input_sha256"] = input_digest(given)
            if (before := _before(dataset, item.key, row)) is not None:
                return JobOutcome(item.name, before["verdict"], before["reason"] or "", True)
            judged, made = _worked(settings, item, given)
        row |= judged | {"verdict": DONE}
    except Exception as error:
        verdict, reason = _judged(error)
        row |= {"verdict": verdict, "reason": reason.replace(copy, "")}
    return _written(dataset, item, row, made, began)


def failed(settings: BatchSettings, item: Item, dataset: Path, reason: str) -> JobOutcome:
    """Record of a job whose worker did not come back."""
    row = _new_row(settings, item) | {"verdict": FAILED, "reason": reason}
    return _written(dataset, item, row, None, time.perf_counter())


def _new_row(settings: BatchSettings, item: Item) -> dict[str, Any]:
    row = dict.fromkeys(COLUMNS) | {"recording": item.name, "source": item.where}
    return row | {"settings_sha256": settings.digest, "software": __version__}


def _judged(error: Exception) -> tuple[str, str]:
    """Verdict and reason."""
    if isinstance(error, PlumbobError):
        damaged = isinstance(error, DecodeError) and not isinstance(error, errors.UnknownFormatError)
        absent = isinstance(error, errors.MissingExtraError | errors.LineError)
        return DAMAGED if damaged else FAILED if absent else REFUSED, one_line(error)
    if isinstance(error, OSError):
        gone = isinstance(error, FileNotFoundError | PermissionError)
        return DAMAGED if gone else FAILED, f"it cannot be read: {error.strerror or one_line(error)}."
    return FAILED, f"{type(error).__name__}: {one_line(error)}"


def _before(dataset: Path, key: str, row: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Row of the record of a job that need not be done again: of this input and these settings, its part as it was."""
    try:
        before: Mapping[str, Any] = json.loads((dataset / JOBS / f"{key}.json").read_bytes())["row"]
        same = all(before[name] == row[name] for name in ("input_sha256", "settings_sha256"))
        if not same or before["verdict"] == FAILED:
            return None
        part = dataset / part_path(key)
        digest = file_sha256(part)[0] if before["verdict"] == DONE and part.is_file() else None
        return before if before["part_sha256"] == digest else None
    except (FileNotFoundError, ValueError, KeyError, TypeError):  # not a record: it is written again
        return None


def _worked(settings: BatchSettings, item: Item, given: Path | Recording) -> tuple[dict[str, Any], _JobResult]:
    """Estimate and judge: numbers of the row, and what is written."""
    gatherer = make_gatherer(burst=settings.burst, tilt_limit=settings.tilt_limit, waves=settings.waves)
    with opened(given, settings.how, in_memory=True) as (recording, paths, session):
        if recording.imu is None:
            raise errors.ShapeError("it holds an attitude but no sensor data, so there is nothing to estimate from.")
        card = settings.card_for(recording.imu.meta.device)
        if card is None and session is not None:
            card = session.card
        named = replace(recording, name=item.name)
        result = estimate(named, **settings.arguments, calibration=card, follow=gatherer)
        subject = subject_from(result, gatherer, paths if settings.pages else (), session)
        page = Overview((subject,)).page() if settings.pages else None
    numbers = replace(subject, gathered=replace(subject.gathered, spectra=None)).summary()
    statistics = {name: value for name, value in numbers.items() if name not in _LEFT_OUT}
    row = _row(statistics, subject, result.imu.meta.device) | _errors(settings, result)
    return row, (result, statistics, page)


def _errors(settings: BatchSettings, result: Estimated) -> dict[str, Any]:
    """Errors against the reference, if there is one; words where they cannot be compared."""
    if result.reference is None:
        return {}
    try:
        scores = evaluate(result.track, result.reference, align=settings.align, settle=settings.settle).summary()
    except PlumbobError as error:
        return {"not_scored": one_line(error)}
    missing = "; ".join(f"{name}: {why}" for name, why in scores["not_scored"].items())
    return {key: scores[key] for key in _ERRORS} | {"not_scored": missing or None}


def _row(statistics: Mapping[str, Any], subject: Subject, device: str) -> dict[str, Any]:
    """Numbers of the table of verdicts: those of the report, under the names of its columns."""
    times, parts = statistics["time"], {**statistics["tilt"], "heading": statistics["heading"]}
    named = {f"{stem}_{name}": value for stem, numbers in parts.items() for name, value in numbers.items()}
    named |= _highest_waves(statistics)
    worst: dict[str, int] = {}
    for burst in statistics["bursts"]:
        for channel, judged in burst["quality"].items():
            worst[channel] = max(judged["flag"], worst.get(channel, 1), key=_WORST.index)
    return {name: value for name, value in (statistics["estimate"] | named | times).items() if name in COLUMNS} | {
        "device": device, "end_utc": subject.utc(times["end_s"]), "gap_share": times["lost_share"],
        "flags": ", ".join(f"{name} {flag['samples']}" for name, flag in statistics["flags"].items()),
        "remarks": " | ".join(map(str, subject.remarks)),
        "grade": quality.MEANING[max(worst.values(), key=_WORST.index, default=quality.MISSING)],
        "grades": ", ".join(f"{name} {quality.MEANING[flag]}" for name, flag in worst.items()),
    }  # fmt: skip


def _highest_waves(statistics: Mapping[str, Any]) -> dict[str, Any]:
    """Waves of the burst that had the highest."""
    seas = [burst["waves"] for burst in statistics["bursts"] if "waves" in burst]
    sea = max(seas, key=lambda sea: sea["hm0_m"] or 0.0, default=None)
    if sea is None:
        return {}
    return {"hm0_m": sea["hm0_m"], "tp_s": sea["tp_s"], "tm02_s": sea["tm02_s"], "wave_flag": sea["flag"],
            "wave_direction_deg": sea["direction_deg"], "wave_spread_deg": sea["spread_deg"]}  # fmt: skip


def _written(dataset: Path, item: Item, row: dict[str, Any], made: _JobResult | None, began: float) -> JobOutcome:
    """Write the attitudes and the page, or remove old ones; then the record."""
    part, page = dataset / part_path(item.key), dataset / f"pages/{item.key}.html"
    result, statistics, text = made or (None, None, None)
    if result is None:
        part.unlink(missing_ok=True)
    else:
        part.parent.mkdir(parents=True, exist_ok=True)
        result.save(part, overwrite=True)
        row["part_sha256"] = file_sha256(part)[0]
    if text is None:  # behind the part: where a batch ends in between, the record of before no longer fits it
        page.unlink(missing_ok=True)
    else:
        write_text(page, text, overwrite=True)
    row["seconds"] = round(time.perf_counter() - began, 6)
    content = json.dumps(plain({"row": row, "statistics": statistics}), allow_nan=False)
    write_text(dataset / JOBS / f"{item.key}.json", content, overwrite=True)
    return JobOutcome(item.name, row["verdict"], row["reason"] or "", False)
