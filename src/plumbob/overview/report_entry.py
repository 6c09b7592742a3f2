"""One recording of a page: where it comes from, what was estimated of it, and what was gathered meanwhile."""

import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core import __version__
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import file_sha256
from plumbob.core.findings import Finding, as_json, warnings
from plumbob.core.result import plain
from plumbob.core.text import counted
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData, ImuMeta, calibration_told
from plumbob.data.imu import BLOCK, TITLES
from plumbob.data.reading import read_at
from plumbob.data.recording import Recording
from plumbob.door.estimate import Estimated, estimate
from plumbob.door.reading import read
from plumbob.files.formats import is_own
from plumbob.overview import streaming_stats as stats
from plumbob.overview.streaming_stats import SHOWN_SCALE, Burst, Gathered, Gatherer
from plumbob.quality import quality
from plumbob.quality.grade import Grade, grade, grade_of
from plumbob.quality.tilt import Headings, Inclination, TiltMotion, TiltStatistics
from plumbob.rotations import North
from plumbob.rotations.frames import counted_from

if TYPE_CHECKING:
    from plumbob.files.mcap import Log
    from plumbob.live.session import Session
    from plumbob.live.stream import ItemResult, Stream

_WAIT: Final = 0.02  # s
OWN: Final = "track"  # in place of a filter: the attitude that the file holds
NONE: Final = "none"  # in place of a filter: no attitude
LARGE: Final = 1 << 26  # bytes of a recorded stream above which it is decoded to a file, and never in memory as a whole

Note = Callable[[str], None]
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Subject:
    """One recording of a page."""

    name: str  # of the recording
    files: tuple[Path, ...]  # its files; none where it came from memory
    gathered: Gathered  # statistics and traces
    facts: tuple[tuple[str, str], ...]  # provenance, a name and a value each
    remarks: tuple[Finding, ...]  # what a reader must know
    calibrated: bool  # whether a card was applied to the sensor values, or there are none
    north: North | None  # what headings count from; None without an attitude
    numbers: Mapping[str, Any]  # of the estimate, as JSON can hold them
    grade: Grade | None  # of the samples that the filter was given, calibrated where they were; None where nobody asked
    t0_ns: int = 0  # UTC of t = 0, ns since 1970; 0 where not known

    def utc(self, t: float) -> str | None:
        """UTC of a time, ISO 8601 to the second; None where it is not known."""
        return _utc(self.t0_ns, t) if self.t0_ns else None

    def summary(self) -> dict[str, Any]:
        """All numbers of a recording, as JSON can hold them; degrees, seconds, units in every name."""
        g = self.gathered
        numbers: dict[str, Any] = {
            "recording": self.name,
            "provenance": [list(fact) for fact in self.facts],
            "remarks": as_json(self.remarks),
            "calibrated": self.calibrated,
            "estimate": dict(self.numbers),
            "time": {
                "begin_s": g.begin, "end_s": g.end, "begin_utc": self.utc(g.begin), "samples": g.samples,
                "duration_s": g.duration, "rate_hz": 1.0 / g.step, "gaps": len(g.gaps), "missing_samples": g.missing,
                "lost_s": g.lost, "lost_share": g.lost / max(g.duration, g.step),
                "gap_list_s": [list(gap) for gap in g.gaps[:1000]],
            },
            "tilt": None if g.tilt is None else _tilt(g.tilt),
            "heading": None if g.headings is None else _heading(g.headings),
            "spectra": _spectra(g),
            "sensors": _sensor_numbers(g),
            "flags": {
                name: {"samples": runs.samples, "share": runs.samples / g.samples, "stretches": len(runs.stretches)}
                for name, runs in g.flags.items()
            },
            "grade": None if self.grade is None else self.grade.summary(),
            "bursts": [_burst(self, burst) for burst in g.bursts],
            "quality_thresholds": [list(row) for row in quality.THRESHOLDS],
            "plot": {"samples_per_pair": g.traces.each, "rows": int(g.traces.t.size)},
        }  # fmt: skip
        return dict(plain(numbers))


def read_subject(
    file: str | Path | Recording | ImuData,
    gatherer: Gatherer,
    how: Mapping[str, Any],
    *,
    graded: bool = True,
    note: Note | None = None,
    progress: Progress | None = None,
) -> Subject:
    """Read a recording, estimate its attitude, and gather with a new gatherer.

    `how` are arguments of `plumbob.estimate`, where `filter` may also be `OWN` or `NONE`; a grade takes some passes
    over the samples. `note` is called with remarks, `progress` with the name, the samples done and all.
    """
    with opened(file, how) as (recording, paths, session):
        given = {name: value for name, value in how.items() if name not in ("profile", "unit")}
        if session is not None and given.get("calibration") is None and session.card is not None:
            given["calibration"] = session.card
        which = given.get("filter")
        if which in (OWN, NONE) or recording.imu is None:
            made = _as_recorded(recording, paths, session, gatherer, which != NONE)
            return replace(made, grade=grade_of(recording)) if graded else made
        name, notes = recording.name, warnings(note for note in recording.notes if note.family == "reading")
        for line in notes if note is not None else ():
            note(f"{name}: {line}")  # type: ignore[misc]
        result = estimate(
            recording,
            **given,
            follow=gatherer,
            keep=False,
            note=note,
            progress=None if progress is None else partial(progress, name),
        )
        of_samples = grade(result.imu, recording.notes) if graded else None
        return subject_from(result, gatherer, paths, session, notes, of_samples)


def subject_from(
    result: Estimated,
    gatherer: Gatherer,
    paths: Sequence[Path] = (),
    session: "Session | None" = None,
    of_file: Sequence[Finding] = (),
    graded: Grade | None = None,
) -> Subject:
    """Of an estimate that a gatherer has followed; `of_file` are remarks about the file, `graded` its grade."""
    last, numbers = result.outline.last, result.summary()
    facts = [
        ("noise card", result.noise_card or "none; the filter's own figures"),
        ("estimate", result.filter_words.partition("; --causal")[0]),
        ("frame", f"{last.frame}, heading from {counted_from(last.north, numbers['declination_deg'])}"),
    ]
    remarks = tuple(dict.fromkeys((*of_file, *result.notes)))
    about = {"remarks": remarks, "north": last.north, "numbers": numbers, "grade": graded}
    return _subject(result.name, paths, session, result.imu.meta, gatherer.done(), facts, about)


def _subject(
    name: str,
    paths: Sequence[Path],
    session: "Session | None",
    meta: ImuMeta | None,
    gathered: Gathered,
    estimate: Sequence[tuple[str, str]],
    about: Mapping[str, Any],
) -> Subject:
    """A recording with its provenance; `estimate` are facts of it, `about` further fields."""
    import scipy

    facts = [("recording", name)]
    for path in paths[:8]:
        digest, size = file_sha256(path)
        facts.append(("SHA-256", f"{digest} ({path.name}, {size} bytes)"))
    if len(paths) > 8:
        facts.append(("SHA-256", f"and of {counted(len(paths) - 8, 'further part')}, not shown"))
    if meta is not None:
        facts.append(("device", meta.device))
    if session is not None:
        facts.append(("session", f"{session.form.name}, recorded as a stream of bytes and decoded again"))
    t0_ns = 0 if meta is None else meta.t0_ns
    span = f"{_utc(t0_ns, gathered.begin)} to {_utc(t0_ns, gathered.end)}" if t0_ns else ""
    nominal = f" (nominal {meta.rate_nominal:g} Hz)" if meta is not None and meta.rate_nominal else ""
    facts += [
        ("time (UTC)", span or "not known; times count from the start of the recording"),
        ("duration", f"{duration(gathered.duration)} ({gathered.duration:.3f} s), {gathered.samples} samples"),
        ("rate", f"{1.0 / gathered.step:.6g} Hz{nominal}"),
    ]
    if meta is not None:
        titles = ", ".join(TITLES[name] for name in gathered.triads)
        facts.append(("sensors", f"{titles}; body axes '{meta.axes}' of the case"))
        facts.append(("calibration", calibration_told(meta.calibration)))
    versions = f"NumPy {np.__version__}, SciPy {scipy.__version__}, Python {platform.python_version()}"
    made = f"plumbob {__version__}, {versions}, {datetime.now(UTC).strftime('%Y-%m-%d %H:%M UTC')}"
    return Subject(
        name=name, files=tuple(paths), gathered=gathered, facts=(*facts, *estimate, ("made by", made)),
        calibrated=meta is None or meta.calibration is not None, t0_ns=t0_ns, **about,
    )  # fmt: skip


def _as_recorded(
    recording: Recording, paths: Sequence[Path], session: "Session | None", gatherer: Gatherer, attitude: bool
) -> Subject:
    """Of a recording as it is, with its own attitude or none."""
    imu, track = recording.imu, recording.track if attitude else None
    if attitude and track is None:
        raise ParameterError(
            f"{recording.name} holds no attitude, which filter '{OWN}' takes. Leave the filter out to estimate one, or "
            f"give '{NONE}'."
        )
    _follow(imu, track, gatherer)
    meta = None if imu is None else imu.meta
    facts, numbers = [("estimate", "none")], {"calibration": None if meta is None else meta.calibration}
    if track is not None:
        facts = [
            ("estimate", f"as the file holds it: {track.source or 'source not named'}"),
            ("frame", f"{track.frame}, heading from {counted_from(track.north, None)}"),
        ]
        numbers = {"frame": str(track.frame), "north": str(track.north), "filter": track.source, **numbers}
    about = {
        "remarks": warnings(recording.notes), "north": None if track is None else track.north, "numbers": numbers,
        "grade": None,
    }  # fmt: skip
    return _subject(recording.name, paths, session, meta, gatherer.done(), facts, about)


def _follow(imu: ImuData | None, track: AttitudeTrack | None, gatherer: Gatherer) -> None:
    """Gather what is there; an attitude of other times is read at those of the samples."""
    if imu is None:
        assert track is not None
        gatherer.begin(track)
        for at in range(0, len(track), BLOCK):
            gatherer.take(None, _rows(track, slice(at, at + BLOCK)))
        return
    if track is not None and not np.array_equal(track.t, imu.t):
        q_nb = read_at(track, imu.t_ns).q_nb
        track = AttitudeTrack(t=imu.t, q_nb=q_nb, frame=track.frame, north=track.north, source=track.source)
    gatherer.begin(imu)
    at = 0
    for part in imu.chunks(BLOCK):
        gatherer.take(part, None if track is None else _rows(track, slice(at, at + len(part))))
        at += len(part)


def _rows(track: AttitudeTrack, rows: slice) -> AttitudeTrack:
    names = ("t", "q_nb", "bias_b", "cov_b", "flags")
    held = {name: getattr(track, name) for name in names}
    columns = {name: value[rows] for name, value in held.items() if value is not None}
    return AttitudeTrack.trusted(**columns, frame=track.frame, north=track.north, source=track.source)


@contextmanager
def opened(
    file: str | Path | Recording | ImuData, how: Mapping[str, Any], *, in_memory: bool = False
) -> "Iterator[tuple[Recording, tuple[Path, ...], Session | None]]":
    """The recording, its files, and its session where it is of a line; `how` names its profile and unit.

    With `in_memory`, its samples are read into memory once.
    """
    if isinstance(file, ImuData):
        from plumbob.data.recording import unsaved

        file = unsaved(file, "the samples")
    if isinstance(file, Recording):
        yield file.of_unit(how.get("unit")), (), None
        return
    path = Path(file)
    if is_own(path) and path.is_file():
        with _recorded(path, how) as recorded:
            yield recorded
        return
    profile = how.get("profile")
    profile = None if profile is None else Path(profile)
    recording = read(path, profile=profile, whole=in_memory, unit=how.get("unit")).of_unit(None)
    parts = sorted(part for part in path.rglob("*") if part.is_file()) if path.is_dir() else [path]
    yield replace(recording, name=path.name), tuple(parts), None


@contextmanager
def _recorded(path: Path, how: Mapping[str, Any]) -> "Iterator[tuple[Recording, tuple[Path, ...], Session | None]]":
    """A recorded stream; a large one is decoded to a file first."""
    from plumbob.files.mcap import open_log
    from plumbob.live.recorded import read_recorded
    from plumbob.live.session_toml import SESSION, of_unit, recorded_session

    log, unit, is_done = open_log(path), how.get("unit"), how.get("filter") == OWN
    session = recorded_session(log.metadata, path.stem) if SESSION in log.metadata else None
    if session is not None and unit is not None:
        session = replace(of_unit(session, unit), units=())
    if session is None or sum(file.stat().st_size for file in log.paths) <= LARGE or session.units or is_done:
        recording = read_recorded(path, estimated=is_done, calibrated=is_done, unit=unit).of_unit(None)
        yield replace(recording, name=path.name), log.paths, session
        return
    with TemporaryDirectory(prefix="plumbob-") as folder:
        yield replace(decoded_to(Path(folder) / "samples.parquet", log, session), name=path.name), log.paths, session


def decoded_to(file: Path, log: "Log", session: "Session") -> Recording:
    """Decode a recording of one unit's line to a native file, and open that; no more than a part of it is in memory.

    The file must stay as long as the result is used. DecodeError if no sample could be decoded.
    """
    from plumbob.files import read
    from plumbob.files.parquet import write_parquet
    from plumbob.live.recorded import reading_notes
    from plumbob.live.stream import Stream

    stream = Stream(replace(session, stage=None))
    write_parquet(file, _samples(stream, log))
    recording = read(file, whole=False)
    return replace(recording, notes=(*reading_notes(log, stream), *recording.notes))


def _samples(stream: "Stream", log: "Log") -> Iterator[Recording]:
    from plumbob.live.sources import ReplaySource

    def parts() -> "Iterator[ItemResult | None]":
        source = ReplaySource(log, None)  # which holds nothing open
        while not source.finished:
            yield from map(stream.feed, source.read(_WAIT))
        yield stream.finish()

    t0_ns = None
    for part in parts():
        if part is None or not len(part.sensed):
            continue
        if t0_ns is None:
            t0_ns = (stream.t0_ns or 0) + (0 if log.first_info is None else log.first_info.epoch_offset_ns)
        yield Recording(imu=part.sensed.corrected(meta=replace(part.sensed.meta, t0_ns=t0_ns)))
    if t0_ns is None:
        raise DecodeError(f"{log.paths[0]} holds no sample that could be decoded; 'plumbob verify' says what is in it.")


def _utc(t0_ns: int, t: float) -> str:
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=t0_ns // 1000 + round(t * 1e6))
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ")


def duration(seconds: float) -> str:
    """Time in words: ``1 h 0 min 0 s``."""
    total = round(seconds)
    hours, minutes, rest = total // 3600, total // 60 % 60, total % 60
    if hours:
        return f"{hours} h {minutes} min {rest} s"
    return f"{minutes} min {rest} s" if minutes else f"{seconds:.3g} s"


def _in_degrees(source: TiltMotion | Inclination, names: Mapping[str, str]) -> dict[str, Any]:
    return {f"{name}_deg": to_deg(getattr(source, attribute)) for name, attribute in names.items()}


def _tilt(tilt: TiltStatistics) -> dict[str, Any]:
    """Of roll, pitch and the angle from the vertical."""
    numbers: dict[str, Any] = {
        name: _in_degrees(m, stats.MOTION_NAMES)
        | {"tz_s": m.tz, "tp_s": m.tp, "waves": m.waves, "samples": m.samples, "wrapped": m.wrapped}
        for name, m in (("roll", tilt.roll), ("pitch", tilt.pitch))
    }
    inclined = tilt.inclination
    return numbers | {"inclination": {
        **_in_degrees(inclined, stats.TILT_NAMES), "greatest_at_s": inclined.greatest_at,
        "limit_deg": to_deg(inclined.limit), "beyond": inclined.beyond, "beyond_share": inclined.share_beyond,
        "samples": inclined.samples,
    }}  # fmt: skip


def _heading(hdg: Headings) -> dict[str, Any]:
    return {
        "mean_deg": to_deg(hdg.mean), "spread_deg": to_deg(hdg.spread), "resultant": hdg.resultant,
        "samples": hdg.samples, "share_by_10_deg": hdg.sectors(36), "share_by_22_5_deg": hdg.sectors(16),
    }  # fmt: skip


def _spectra(g: Gathered) -> dict[str, Any] | None:
    if g.spectra is None:
        return None
    frequency, density = g.spectra.gathered()
    return {
        "method": "Welch, Hann window, half overlapping, one-sided",
        "rate_hz": 1.0 / g.spectra.step, "segment_s": g.spectra.length * g.spectra.step,
        "resolution_hz": g.spectra.frequency[0], "interpolated_segments": g.spectra.interpolated,
        "segments": dict(zip(stats.SPECTRAL, g.spectra.segments.tolist(), strict=True)),
        "frequency_hz": frequency,
        "density": {
            f"{name} [{stats.SPECTRAL_UNITS[name]}]": density[:, i] * SHOWN_SCALE[name] ** 2
            for i, name in enumerate(stats.SPECTRAL)
        },
    }  # fmt: skip


def _sensor_numbers(g: Gathered) -> dict[str, Any]:
    m, numbers, keys = g.moments, {}, ("mean", "std", "least", "greatest")
    for i, name in enumerate(stats.TRACED):
        stem = name.partition("_")[0]
        if stem in stats.UNITS and m.count[i] > 0:
            values = (SHOWN_SCALE[name] * column[i] for column in (m.mean, m.sd, m.least, m.greatest))
            numbers[f"{name} [{stats.UNITS[stem]}]"] = {
                **dict(zip(keys, values, strict=True)),
                "samples": int(m.count[i]),
            }
    return numbers


def _burst(subject: Subject, burst: Burst) -> dict[str, Any]:
    return {
        "begin_s": burst.begin, "end_s": burst.end, "begin_utc": subject.utc(burst.begin), "samples": burst.samples,
        **_tilt(burst.tilt), "heading": _heading(burst.headings),
        "quality": {
            name: {"flag": verdict.flag, "tests": dict(verdict.tests), "good_share": verdict.good}
            for name, verdict in burst.verdicts.items()
        },
        **({} if burst.waves is None else {"waves": burst.waves.summary()}),
    }  # fmt: skip
