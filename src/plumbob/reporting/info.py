"""What a file holds, and its grade."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.core import check, flags
from plumbob.core.errors import ParameterError, UnknownFormatError
from plumbob.core.findings import Finding, as_json, warnings
from plumbob.core.text import FactsText, counted, visible
from plumbob.core.time import Timing, timing
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.data.array import ImuArray
from plumbob.data.cards import UNITS
from plumbob.data.plausibility import statistics
from plumbob.data.recording import Recording
from plumbob.rotations.frames import heading_zero

if TYPE_CHECKING:
    from plumbob.quality.grade import Grade


@dataclass(frozen=True, eq=False, repr=False)
class Info(FactsText):
    """What a file holds."""

    numbers: Mapping[str, Any]  # all that is known, as JSON can hold it
    lines: Sequence[str]  # the same for a reader
    grade: "Grade | None" = None  # what the recording is worth, with the reasons
    points: float | None = None  # of the recording, or of a card, which has a grade of its own

    def reaches(self, wanted: float | str) -> bool:
        """Whether the grade is at least a number from 0 to 100, or a word: GOOD, FAIR or POOR."""
        from plumbob.quality.grade import WORDS

        if self.points is None:
            raise ParameterError(
                f"{self.numbers['file']} has no grade; grades are of recordings and calibration cards."
            )
        least = dict(WORDS)
        if isinstance(wanted, str):
            if wanted not in least:
                raise ParameterError(f"a grade must be GOOD, FAIR or POOR, or a number, but got {check.said(wanted)}.")
            return self.points >= least[wanted]
        return self.points >= check.number("grade", wanted, "points")

    def facts(self) -> Mapping[str, str]:
        """The file, and what is in it."""
        kinds = ("sensors", "array", "attitude", "card")
        held = {kind: self.numbers[kind] for kind in kinds if kind in self.numbers}
        facts = {"file": self.numbers["file"], "holds": ", ".join(held)}
        timed = held.get("sensors", held.get("array", held.get("attitude", {})))
        return facts | ({"samples": str(timed["time"]["samples"])} if "time" in timed else {})

    def summary(self) -> dict[str, Any]:
        """All that is known, as JSON can hold it."""
        return dict(self.numbers)

    def text(self, *details: str) -> str:
        """The same for a reader, a line each; with ``"grade"`` every criterion, also those that lose nothing."""
        lines = () if self.grade is None else _grade_lines(self.grade, full="grade" in details)
        return "\n".join((*self.lines, *lines))


READ_WHOLE: Final = 1 << 26  # bytes of a file that is read whole: parts that are read again take longer than they spare


def info(
    what: "Recording | str | Path | Sequence[str | Path]",
    *,
    profile: str | Path | None = None,
    unit: str | None = None,
    note: Callable[[str], object] | None = None,
) -> Info:
    """Say what a recording, a track or a card holds, and grade it.

    Parameters
    ----------
    what : Recording, path or sequence of paths
        The recording, or a file: a recording, of a line with its session's card, a track, a calibration card or a noise
        card; or files of one recording, with a sensor each.
    profile : path, optional
        What the columns of a text file mean.
    unit : str, optional
        One of several units, by name or number from 1.
    note : callable, optional
        Called with what was found in the data of a file, which the lines then do not repeat.

    Raises
    ------
    DecodeError
        If the file cannot be read.
    ParameterError
        If there is no such unit.
    """
    from plumbob.door.reading import read
    from plumbob.quality.grade import grade_of

    if isinstance(what, Recording):
        name, recording = what.name, what if unit is None else what.of_unit(unit)
    elif isinstance(what, Sequence) and not isinstance(what, str):
        name, recording = str(what[0]), read(what, profile=profile)
    elif (file := check.path("what", what)).suffix.lower() == ".json" and profile is None and not _is_log(file):
        return _card(file)
    else:
        small = not file.is_file() or file.stat().st_size < READ_WHOLE
        name, recording = str(file), read(file, profile=profile, unit=unit, whole=small, calibrated=True)
    said = () if note is None else warnings(recording.notes)
    for line in said:
        note(f"{Path(name).absolute().name}: {line}")  # type: ignore[misc]
    report: dict[str, Any] = {"file": name, "notes": as_json(dict.fromkeys(recording.notes))}
    if recording.imu is not None:
        report["sensors"] = _sensors(recording.imu)
    if recording.array is not None:
        report["array"] = _array(recording.array)
    if recording.track is not None:
        report["attitude"] = _attitude(recording.track)
    made = grade_of(recording)
    report["grade"] = made.summary()
    lines = [name, *(f"{topic:12} {visible(text)}" for topic, text in _facts(report, recording.notes, said))]
    return Info(report, lines, made, made.points)


def _grade_lines(grade: "Grade", *, full: bool) -> Iterator[str]:
    """The grade, and under it what costs points, the dearest first; or every criterion with its rule."""
    units = ", ".join(f"{visible(name)} {unit.points:g}" for name, unit in (grade.units or {}).items())
    of = f"; {units}; reasons of the worst" if units else ""
    yield f"{'grade':12} {grade.points:g} of 100, {grade.word}{of}"
    for criterion in sorted(grade.criteria, key=attrgetter("lost"), reverse=True):
        if not (criterion.lost or full):
            continue
        yield f"{'':12} {criterion.name}: −{criterion.lost:.3g} of {criterion.points:g}: {visible(criterion.measured)}"
        if full:
            yield f"{'':14} rule: {criterion.rule}"
        if criterion.advice:
            yield f"{'':14} {criterion.advice}"


def _is_log(file: Path) -> bool:
    """Whether JSON holds samples: an array, or what a profile beside it describes."""
    from plumbob.files.formats import kind_of

    with suppress(UnknownFormatError):
        return bool(kind_of(file))
    return False


def _card(file: Path) -> Info:
    """What a card holds."""
    from plumbob.data.cards import CalibrationCard, open_card

    card, points = open_card(file), None
    if isinstance(card, CalibrationCard):
        from plumbob.calibration.fit import numbers
        from plumbob.quality.grade import WORDS
        from plumbob.reporting.calibration import calibrated

        content, report = numbers(card, {}), calibrated(card)
        least = {word.lower(): points for word, points in WORDS}
        triads = (triad for triad in (card.gyr, card.acc, card.mag) if triad is not None)
        graded = [triad.quality.grade for triad in triads if triad.quality is not None]
        points = min((least[word] for word in graded), default=None)
    else:
        from plumbob.reporting.noise import card_report

        content, report = {"card": json.loads(card.text())}, card_report(card)
    return Info({"file": str(file)} | content, [report.text()], points=points)


def _sensors(imu: ImuData) -> dict[str, Any]:
    from plumbob.quality.grade import sample_times

    meta = imu.meta
    return {
        "device": meta.device,
        "calibration": meta.calibration,
        "frame": str(meta.frame) if meta.frame else None,
        "axes": meta.axes,
        "declination_deg": None if meta.declination is None else to_deg(meta.declination),
        "time": _timing(sample_times(imu)) | {"start_utc": _utc(meta.t0_ns)},
        "triads": {name: _triad(imu, name) for name in imu.triads},
        "flags": flags.counts(imu.flags),
    }


def _utc(t0_ns: int) -> str | None:
    """Time as ISO 8601 has it, to the microsecond; None where it is not known."""
    from datetime import UTC, datetime, timedelta

    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=t0_ns // 1000)
    return moment.isoformat().replace("+00:00", "Z") if t0_ns else None


def _array(array: ImuArray) -> dict[str, Any]:
    """Time line of all, and what each unit has, with how it is mounted."""
    units = {}
    for name, imu in array.units.items():
        mount = array.mounts[name]
        noise = None if mount.noise is None else mount.noise.device
        sensors = _sensors(imu)
        del sensors["time"]
        units[name] = sensors | {
            "mount": {
                "q_bs": list(mount.q_bs), "lever_b_m": list(mount.lever_b), "clock_offset_s": mount.clock_offset,
                "noise_card": noise,
            }
        }  # fmt: skip
    return {"time": _timing(timing(array.t)), "units": units}


def _triad(imu: ImuData, name: str) -> dict[str, Any]:
    stats = statistics(imu, name)
    numbers = {"mean": stats.mean.tolist(), "std": stats.std.tolist(), "norm_median": stats.norm}
    return {
        "unit": UNITS[name],
        "samples": stats.samples,
        "range": getattr(imu.meta, f"{name}_range"),
        **(numbers if stats.samples else dict.fromkeys(numbers)),
    }


def _attitude(track: AttitudeTrack) -> dict[str, Any]:
    return {
        "source": track.source,
        "frame": str(track.frame),
        "north": str(track.north),
        "time": _timing(timing(track.t)),
        "known_samples": int(track.known.sum()),
        "scored_samples": int(track.score.sum()) if track.score is not None else None,
    }


def _timing(time: Timing) -> dict[str, Any]:
    return {
        "samples": time.samples,
        "duration_s": time.duration,
        "rate_hz": time.rate if math.isfinite(time.rate) else None,
        "jitter_us": time.jitter * 1e6,
        "gaps": time.gaps,
        "longest_step_s": time.longest,
    }


def _facts(report: Mapping[str, Any], notes: Sequence[Finding], said: Sequence[Finding]) -> Iterator[tuple[str, str]]:
    """Topics, and what there is to say of each; a topic that goes on is empty."""
    yield from (("note", str(note)) for note in dict.fromkeys(notes) if note not in said)
    if sensors := report.get("sensors"):
        yield "device", f"{sensors['device']}, body axes '{sensors['axes']}' of the case"
        yield "calibration", calibration_told(sensors["calibration"])
        yield "frame", sensors["frame"] or "not named; filters need --frame"
        if sensors["declination_deg"] is not None:
            yield "declination", f"{sensors['declination_deg']:+.4g}°, east positive"
        yield _time_fact(sensors["time"])
        for name, triad in sensors["triads"].items():
            yield from _triad_facts(name, triad)
        for name, count in sensors["flags"].items():
            yield "flag", f"{name}: {counted(count, 'sample')}"
    if array := report.get("array"):
        yield "units", f"{', '.join(array['units'])}; more of one with --unit"
        yield _time_fact(array["time"])
        for calibration in dict.fromkeys(unit["calibration"] for unit in array["units"].values()):
            names = [name for name, unit in array["units"].items() if unit["calibration"] == calibration]
            yield "calibration", f"{', '.join(names)}: {calibration_told(calibration)}"
        for name, unit in array["units"].items():
            yield from _unit_facts(name, unit)
    if attitude := report.get("attitude"):
        yield "attitude", attitude["source"] or "source not named"
        yield "frame", f"{attitude['frame']}, heading from {heading_zero(attitude['north'])}"
        yield _time_fact(attitude["time"])
        samples = counted(attitude["known_samples"], "sample")
        yield "known", f"{samples}, scored {attitude['scored_samples'] or 'all'}"


def _unit_facts(name: str, unit: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What one of several units has, in short."""
    mount = unit["mount"]
    triads = ", ".join(f"{triad} {counted(stats['samples'], 'sample')}" for triad, stats in unit["triads"].items())
    flagged = ", ".join(f"{count} {flag}" for flag, count in unit["flags"].items())
    yield visible(name), f"{unit['device']}: {triads}; flags: {flagged or 'none'}"
    lever, offset = [1e3 * metres for metres in mount["lever_b_m"]], 1e3 * mount["clock_offset_s"]
    noise = "" if mount["noise_card"] is None else f", noise of {mount['noise_card']}"
    yield "", f"mounted q_bs {_three(mount['q_bs'])}, lever {_three(lever)} mm, clock {offset:+.4g} ms{noise}"


def _triad_facts(name: str, triad: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    scale = triad["range"]
    axes = scale if isinstance(scale, tuple) else (scale,)
    reach = "" if scale is None else f", range {', '.join(f'±{axis:.5g}' for axis in axes)}"
    if not triad["samples"]:
        yield name, f"no usable sample in {triad['unit']}{reach}"
        return
    samples = counted(triad["samples"], "sample")
    yield name, f"{samples} in {triad['unit']}{reach}, |{name}| median {triad['norm_median']:.5g}"
    yield "", f"mean {_three(triad['mean'])}, std {_three(triad['std'])}"


def _time_fact(time: Mapping[str, Any]) -> tuple[str, str]:
    rate, longest = "one sample", ""
    if time["rate_hz"] is not None:
        rate = f"{time['rate_hz']:.6g} Hz, jitter {time['jitter_us']:.3g} µs"
        longest = f", longest step {time['longest_step_s']:.6g} s"
    samples, gaps = counted(time["samples"], "sample"), counted(time["gaps"], "gap")
    return "time", f"{samples}, {time['duration_s']:.3f} s, {rate}, {gaps}{longest}"


def _three(values: Sequence[float]) -> str:
    return "[" + ", ".join(f"{v:.4g}" for v in values) + "]"
