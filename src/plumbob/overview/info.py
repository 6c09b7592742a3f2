"""What a file holds, and its grade."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.core.text import FactsText, counted, visible

if TYPE_CHECKING:
    from plumbob.data.recording import Recording
    from plumbob.quality.grade import Grade


class Info(FactsText):
    """What a file holds.

    Parameters
    ----------
    report : mapping
        All that is known, as JSON can hold it.
    lines : sequence of str
        The same for a reader.
    grade : Grade, optional
        What the recording is worth, with the reasons.
    points : float, optional
        Of a card, which has a grade of its own.
    """

    def __init__(
        self,
        report: Mapping[str, Any],
        lines: Sequence[str],
        grade: "Grade | None" = None,
        points: float | None = None,
    ) -> None:
        self._report, self._lines = report, lines
        self.grade, self._points = grade, points if grade is None else grade.points

    def reaches(self, asked: float | str) -> bool:
        """Whether the grade is at least a number from 0 to 100, or a word: GOOD, FAIR or POOR.

        Raises
        ------
        ParameterError
            If nothing here has a grade, as a noise card, or the word is not one of the three.
        """
        from plumbob.core import check
        from plumbob.core.errors import ParameterError
        from plumbob.quality.grade import WORDS

        if self._points is None:
            raise ParameterError(
                f"{self._report['file']} has no grade; grades are of recordings and calibration cards."
            )
        least = dict(WORDS)
        if isinstance(asked, str):
            if asked not in least:
                raise ParameterError(f"a grade is GOOD, FAIR or POOR, or a number, but got {check.said(asked)}.")
            return self._points >= least[asked]
        return self._points >= check.number("grade", asked, "points")

    def facts(self) -> Mapping[str, str]:
        """The file, and what is in it."""
        kinds = ("sensors", "array", "attitude", "card")
        held = {kind: self._report[kind] for kind in kinds if kind in self._report}
        facts = {"file": self._report["file"], "holds": ", ".join(held)}
        timed = held.get("sensors", held.get("array", held.get("attitude", {})))
        return facts | ({"samples": str(timed["time"]["samples"])} if "time" in timed else {})

    def summary(self) -> dict[str, Any]:
        """All that is known, as JSON can hold it."""
        return dict(self._report)

    def text(self, *details: str) -> str:
        """The same for a reader, a line each; with ``"grade"`` every criterion, also those that lose nothing."""
        lines = () if self.grade is None else _grade_lines(self.grade, full="grade" in details)
        return "\n".join((*self._lines, *lines))


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
        The recording, or a file: a recording, a track, a calibration card or a noise card; or files of one recording,
        with a sensor each.
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
    from plumbob.core import check
    from plumbob.data.recording import Recording, found_in
    from plumbob.door.reading import read
    from plumbob.quality.grade import grade_of

    if isinstance(what, Recording):
        name, recording = what.name, what if unit is None else what.of_unit(unit)
    elif not isinstance(what, str | PathLike):
        name, recording = str(what[0]), read(what, profile=profile)
    elif (file := check.path("what", what)).suffix.lower() == ".json":
        return _card(file)
    else:
        name, recording = str(file), read(file, profile=profile, unit=unit, whole=False)
    said = () if note is None else found_in(recording.notes)
    for line in said:
        note(f"{Path(name).name}: {line}")  # type: ignore[misc]
    report: dict[str, Any] = {"file": name, "notes": list(recording.notes)}
    if recording.imu is not None:
        report["sensors"] = _sensors(recording.imu)
    if recording.array is not None:
        report["array"] = _array(recording.array)
    if recording.track is not None:
        report["attitude"] = _attitude(recording.track)
    made = grade_of(recording, judged=not isinstance(what, Recording))
    report["grade"] = made.summary()
    return Info(report, list(_lines(report, said)), made)


def _grade_lines(grade: "Grade", *, full: bool) -> Iterator[str]:
    """The grade, and under it what costs points, the dearest first; or every criterion with its rule."""
    of = ""
    if grade.units:
        of = (
            "; "
            + ", ".join(f"{visible(name)} {unit.points:g}" for name, unit in grade.units.items())
            + "; reasons of the worst"
        )
    yield f"{'grade':12} {grade.points:g} of 100, {grade.word}{of}"
    for criterion in sorted(grade.criteria, key=lambda criterion: -criterion.lost):
        if not (criterion.lost or full):
            continue
        yield f"{'':12} {criterion.name}: −{criterion.lost:.3g} of {criterion.points:g}: {visible(criterion.measured)}"
        if full:
            yield f"{'':14} rule: {criterion.rule}; {criterion.source}"
        if criterion.advice:
            yield f"{'':14} {criterion.advice}"


def _card(file: Path) -> Info:
    """What a card holds."""
    import json

    from plumbob.data.cards import CalibrationCard, open_card

    card, points = open_card(file), None
    if isinstance(card, CalibrationCard):
        from plumbob.calibration.report import certificate, numbers
        from plumbob.quality.grade import WORDS

        content, report = numbers(card, {}), certificate(card, {})
        least = {word.lower(): points for word, points in WORDS}
        triads = (triad for triad in (card.gyr, card.acc, card.mag) if triad is not None)
        graded = [triad.quality.grade for triad in triads if triad.quality is not None]
        points = min((least[word] for word in graded), default=None)
    else:
        from plumbob.noise.card import card_report

        content, report = {"card": json.loads(card.text())}, card_report(card)
    return Info({"file": str(file)} | content, [report.text()], points=points)


def _sensors(imu: Any) -> dict[str, Any]:
    import numpy as np

    from plumbob.core import flags
    from plumbob.core.units import to_deg

    meta = imu.meta
    return {
        "device": meta.device,
        "calibration": meta.calibration,
        "frame": str(meta.frame) if meta.frame else None,
        "axes": meta.axes,
        "declination_deg": None if meta.declination is None else to_deg(meta.declination),
        "time": _timing(np.diff(imu.t_ns)) | {"start_utc": _utc(meta.t0_ns)},
        "triads": {name: _triad(imu, name) for name in imu.triads},
        "flags": flags.counts(imu.flags),
    }


def _utc(t0_ns: int) -> str | None:
    """Time as ISO 8601 has it, to the microsecond; None where it is not known."""
    from datetime import UTC, datetime, timedelta

    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=t0_ns // 1000)
    return moment.isoformat().replace("+00:00", "Z") if t0_ns else None


def _array(array: Any) -> dict[str, Any]:
    """Time line of all, and what each unit has, with how it is mounted."""
    import numpy as np

    from plumbob.core.time import to_ns

    units = {}
    for name, imu in array.units.items():
        mount = array.mounts[name]
        mounted = {"q_bs": list(mount.q_bs), "lever_b_m": list(mount.lever_b), "clock_offset_s": mount.clock_offset}
        noise = None if mount.noise is None else mount.noise.device
        sensors = _sensors(imu)
        del sensors["time"]
        units[name] = sensors | {"mount": mounted | {"noise_card": noise}}
    return {"time": _timing(np.diff(to_ns(array.t))), "units": units}


def _triad(imu: Any, name: str) -> dict[str, Any]:
    from plumbob.data.cards import UNITS
    from plumbob.data.plausibility import statistics

    stats = statistics(imu, name)
    return {
        "unit": UNITS[name],
        "samples": stats.samples,
        "range": getattr(imu.meta, f"{name}_range"),
        "mean": stats.mean.tolist() if stats.samples else None,
        "std": stats.std.tolist() if stats.samples else None,
        "norm_median": stats.norm if stats.samples else None,
    }


def _attitude(track: Any) -> dict[str, Any]:
    import numpy as np

    from plumbob.core.time import to_ns

    return {
        "source": track.source,
        "frame": str(track.frame),
        "north": str(track.north),
        "time": _timing(np.diff(to_ns(track.t))),
        "known_samples": int(track.known.sum()),
        "scored_samples": int(track.score.sum()) if track.score is not None else None,
    }


def _timing(dt_ns: Any) -> dict[str, Any]:
    import math

    from plumbob.core import time

    timing = time.timing_of_steps(dt_ns)
    return {
        "samples": timing.samples,
        "duration_s": timing.duration,
        "rate_hz": timing.rate if math.isfinite(timing.rate) else None,
        "jitter_us": timing.jitter * 1e6,
        "gaps": timing.gaps,
        "longest_step_s": timing.longest,
    }


def _lines(report: dict[str, Any], said: Sequence[str]) -> Iterator[str]:
    from plumbob.data import calibration_told
    from plumbob.rotations.headings import heading_zero

    yield report["file"]
    for line in dict.fromkeys(note for note in report["notes"] if note not in said):
        yield f"{'note':12} {visible(line)}"
    if sensors := report.get("sensors"):
        yield f"device       {visible(sensors['device'])}, body axes '{sensors['axes']}' of the case"
        yield f"calibration  {visible(calibration_told(sensors['calibration']))}"
        yield f"frame        {sensors['frame'] or 'not named; filters need --frame'}"
        if sensors["declination_deg"] is not None:
            yield f"declination  {sensors['declination_deg']:+.4g}°, east positive"
        yield _timing_line(sensors["time"])
        for name, triad in sensors["triads"].items():
            yield from _triad_lines(name, triad)
        for name, count in sensors["flags"].items():
            yield f"flag         {name}: {counted(count, 'sample')}"
    if array := report.get("array"):
        yield f"units        {', '.join(map(visible, array['units']))}; more of one with --unit"
        yield _timing_line(array["time"])
        for calibration in dict.fromkeys(unit["calibration"] for unit in array["units"].values()):
            of = [visible(name) for name, unit in array["units"].items() if unit["calibration"] == calibration]
            yield f"calibration  {', '.join(of)}: {visible(calibration_told(calibration))}"
        for name, unit in array["units"].items():
            yield from _unit_lines(name, unit)
    if attitude := report.get("attitude"):
        yield f"attitude     {visible(attitude['source']) or 'source not named'}"
        yield f"frame        {attitude['frame']}, heading from {heading_zero(attitude['north'])}"
        yield _timing_line(attitude["time"])
        samples = counted(attitude["known_samples"], "sample")
        yield f"known        {samples}, scored {attitude['scored_samples'] or 'all'}"


def _unit_lines(name: str, unit: dict[str, Any]) -> Iterator[str]:
    """What one of several units has, in short."""
    mount = unit["mount"]
    triads = ", ".join(f"{triad} {counted(stats['samples'], 'sample')}" for triad, stats in unit["triads"].items())
    flagged = ", ".join(f"{count} {flag}" for flag, count in unit["flags"].items())
    yield f"{visible(name):12} {visible(unit['device'])}: {triads}; flags: {flagged or 'none'}"
    lever, offset = [1e3 * metres for metres in mount["lever_b_m"]], 1e3 * mount["clock_offset_s"]
    noise = "" if mount["noise_card"] is None else f", noise of {visible(mount['noise_card'])}"
    yield f"{'':12} mounted q_bs {_three(mount['q_bs'])}, lever {_three(lever)} mm, clock {offset:+.4g} ms{noise}"


def _triad_lines(name: str, triad: dict[str, Any]) -> Iterator[str]:
    reach = "" if triad["range"] is None else f", range {_range(triad['range'])}"
    if not triad["samples"]:
        yield f"{name:12} no usable sample in {triad['unit']}{reach}"
        return
    samples = counted(triad["samples"], "sample")
    yield f"{name:12} {samples} in {triad['unit']}{reach}, |{name}| median {triad['norm_median']:.5g}"
    yield f"{'':12} mean {_three(triad['mean'])}, std {_three(triad['std'])}"


def _range(full_scale: float | tuple[float, ...]) -> str:
    axes = full_scale if isinstance(full_scale, tuple) else (full_scale,)
    return ", ".join(f"±{axis:.5g}" for axis in axes)


def _timing_line(time: dict[str, Any]) -> str:
    rate = "one sample" if time["rate_hz"] is None else f"{time['rate_hz']:.6g} Hz, jitter {time['jitter_us']:.3g} µs"
    longest = "" if time["rate_hz"] is None else f", longest step {time['longest_step_s']:.6g} s"
    samples, gaps = counted(time["samples"], "sample"), counted(time["gaps"], "gap")
    return f"time         {samples}, {time['duration_s']:.3f} s, {rate}, {gaps}{longest}"


def _three(values: list[float]) -> str:
    return "[" + ", ".join(f"{v:.4g}" for v in values) + "]"
