"""A recording that is played: read and estimated once, then shown at any place and speed."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.arm import ArmCard, ArmEstimate, ArmStream
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.event import Event
from plumbob.core.time import to_ns, to_s
from plumbob.data import AttitudeTrack, ImuData, ImuMeta, calibration_told
from plumbob.data.array import ImuArray
from plumbob.data.chain import Chain
from plumbob.data.recording import Recording
from plumbob.door.estimate import estimate
from plumbob.door.reading import read
from plumbob.files.formats import is_own
from plumbob.files.mcap import open_log
from plumbob.live.recorded import read_recorded
from plumbob.live.replay import NO_SAMPLE, Replayed, replay
from plumbob.live.runner import Note
from plumbob.live.session_toml import SESSION, of_unit, recorded_session
from plumbob.protocols.format import Message
from plumbob.rotations import Frame
from plumbob.viewer import rows
from plumbob.viewer.commands import Outlet
from plumbob.viewer.messages import Batch, Hello, Link, Playback, numbers
from plumbob.viewer.overlays import JointFigure, described, frame_faults, greeting, joint_values, require_addable

BEFORE: Final = 60.0  # Time before a place that is shown with it, s
SPEEDS: Final = 0.1, 100.0
RECORDED: Final = "recorded"  # Name of an estimate that the recording carries
_ROWS: Final = 2000  # Rows that are handed over at a time
_STILL_NS: Final = 250_000_000


@dataclass(frozen=True, eq=False, slots=True)
class Estimate:
    """An estimate of the whole recording."""

    shown: rows.ShownEstimator
    track: AttitudeTrack
    declination: float | None


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Loaded:
    """A recording, read and estimated."""

    # name, device, format, calibration, noise: as `messages.Hello` has them
    name: str
    device: str
    format: str
    calibration: str
    noise: str
    t: Floats  # (N,), times of the samples, s
    # imu, sensed: samples, calibrated and not; None where it has an attitude alone
    imu: ImuData | None
    sensed: ImuData | None
    estimates: list[Estimate]  # the primary one first
    reference: AttitudeTrack | None = None
    array: ImuArray | None = None  # all units, where it has several
    follower: ArmStream | None = None  # of its chain, where it is on one
    motion: ArmEstimate | None = None  # what that gave
    raw: Mapping[str, NDArray[Any]] = field(default_factory=dict)  # (N,), fields of the frames, in counts
    message: Message | None = None  # what they are
    events: Sequence[tuple[float, Event]] = ()  # events at their time, s
    # of the whole: ``lost``, ``gaps``, ``junk``, ``rejected``, ``unusable`` as `messages.Link` has them
    counts: Mapping[str, int] = field(
        default_factory=lambda: dict.fromkeys(("lost", "gaps", "junk", "rejected", "unusable"), 0)
    )

    @property
    def frame(self) -> Frame | None:
        """Navigation frame."""
        if self.estimates:
            return self.estimates[0].track.frame
        return None if self.reference is None else self.reference.frame


def load(
    path: Path, filter: str | None = None, *, also: Sequence[str] = (),
    chain: Chain | ArmCard | str | Path | None = None, unit: str | None = None, profile: str | Path | None = None,
    calibration: Any = None, frame: Frame | str | None = None, note: Note | None = None, **options: Any,
) -> Loaded:  # fmt: skip
    """Read and estimate a recording that `plumbob.read` reads.

    With a `filter` or any of `options` (those of `plumbob.estimate`) the estimate that the recording carries does not
    count; `also` names further estimators. A `chain` reads all units, `unit` one of several.
    """
    options = {name: value for name, value in options.items() if value is not None}
    wanted = filter is not None or bool(options)
    loaded = _loaded(path, unit, profile, all_=chain is not None, calibration=calibration, frame=frame)
    if loaded.imu is None and (wanted or also):
        raise ShapeError(f"{path} holds an attitude but no sensor data, so there is nothing to estimate from.")
    estimates = [] if wanted else list(loaded.estimates)

    def estimated(name: str | None, *, primary: bool, **settings: Any) -> Estimate:
        recording = Recording(imu=loaded.imu, track=loaded.reference, name=path.name)
        nav_frame = frame or (estimates[0].track.frame if estimates else None)
        return _estimated(recording, name, nav_frame, primary=primary, note=note if primary else None, **settings)

    if loaded.imu is not None and (wanted or not estimates):
        estimates.append(estimated(filter, primary=True, **options))
    for name in also:
        estimates.append(estimated(name, primary=False))
    _require_unlike([est.shown.name for est in estimates])
    loaded = replace(loaded, estimates=estimates)
    follower = loaded.follower if chain is None else ArmStream(chain, frame=frame or loaded.frame)
    if follower is None or loaded.array is None:
        return loaded
    return replace(loaded, follower=follower, motion=follower.take(loaded.array, end=True))


def _estimated(
    recording: Recording, name: str | None, frame: Frame | str | None, *, primary: bool, **settings: Any
) -> Estimate:
    result = estimate(recording, name, frame=frame, **settings)
    kind = result.filter.name
    shown = rows.shown_estimator(kind, kind, described(result.filter), primary=primary)
    return Estimate(shown, result.track, result.filter.common.declination)


def _require_unlike(names: Sequence[str]) -> None:
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ParameterError(f"{twice[0]} is asked for twice; name each estimator once.")


def _loaded(
    path: Path, unit: str | None, profile: str | Path | None, *, all_: bool, calibration: Any, frame: Any
) -> Loaded:
    if is_own(path) and SESSION in open_log(path).metadata:
        return _of_line(path, unit, all_=all_, calibration=calibration, frame=frame)
    recording = read_recorded(path, estimated=True) if is_own(path) else read(path, profile=profile)
    array = recording.array
    if all_ and array is None:
        raise ParameterError(f"{path} holds one unit, but a chain has one on each segment. Leave --chain out.")
    single = recording.of_unit(unit or (array.names[0] if all_ and array is not None else None))
    imu, sensed, track = single.imu, single.imu, single.track
    if imu is not None and calibration is not None:
        from plumbob.data.cards import CalibrationCard
        from plumbob.filters.offline import calibrated

        imu = calibrated(imu, CalibrationCard.of(calibration))
    carries = track is not None and (imu is None or is_own(path))
    estimates = []
    if carries and track is not None:
        title = track.source.partition(";")[0] or RECORDED
        shown = rows.shown_of_track(RECORDED, track, title, primary=True)
        estimates = [Estimate(shown, track, None if imu is None else imu.meta.declination)]
    timeline = imu if imu is not None else track
    if timeline is None:
        raise ShapeError(f"{path} holds neither samples nor an attitude.")
    meta = ImuMeta() if imu is None else imu.meta
    return Loaded(
        name=path.name,
        device=meta.device,
        format=path.suffix.removeprefix("."),
        calibration="uncalibrated" if meta.calibration is None else calibration_told(meta.calibration),
        noise="none",
        t=timeline.t,
        imu=imu,
        sensed=sensed,
        estimates=estimates,
        reference=None if carries else track,
        array=array if all_ else None,
    )


def _of_line(path: Path, unit: str | None, *, all_: bool, calibration: Any, frame: Any) -> Loaded:
    """Recording of a line, through its session again."""
    log = open_log(path)
    session = recorded_session(log.metadata, path.stem)
    if all_ or unit is not None:
        session = of_unit(session, unit or "all")
    if frame is not None:
        nav_frame = Frame.parse(frame)
        session = replace(session, frame=nav_frame, meta=replace(session.meta, frame=nav_frame))
    replayed = replay(log, session=replace(session, chain=None), calibration=calibration, covariance=True)
    imu, sensed = replayed.imu, replayed.found.imu(calibrated=False)
    collected, t0_ns = replayed.found, replayed.stream.t0_ns or 0
    if not collected.parts:
        raise ShapeError(NO_SAMPLE.format(path))
    stage, report = replayed.stream.session.stage, replayed.stream.time_report()
    estimates = []
    if stage is not None and replayed.track is not None and replayed.stream.filter is not None:
        filter_ = replayed.stream.filter
        shown = rows.shown_estimator(stage.name, stage.filter, described(filter_), primary=True)
        estimates = [Estimate(shown, replayed.track, filter_.common.declination)]
    message = session.form.message(session.message)
    card = replayed.stream.session.card
    return Loaded(
        name=path.name,
        device=session.meta.device,
        format=session.form.name,
        calibration="uncalibrated" if card is None else card.name,
        noise="none" if stage is None or stage.noise is None else f"{stage.noise.device} ({stage.noise.source})",
        t=to_s(collected.t_ns - t0_ns),
        imu=None if imu is None else imu.corrected(meta=replace(imu.meta, t0_ns=replayed.t0_ns)),
        sensed=sensed,
        estimates=estimates,
        reference=collected.said(),
        array=collected.array(calibrated=True),
        follower=session.made_chain,
        raw=_recorded_raw(replayed, message),
        message=message,
        events=[((event.t_ns - t0_ns) / 1e9, event) for event in collected.events],
        counts={"lost": report.lost, "gaps": report.gap_count, **frame_faults(replayed.stream)},
    )


def _recorded_raw(replayed: Replayed, message: Message) -> dict[str, NDArray[Any]]:
    columns = {}
    for entry in message.fields:
        parts = [part.frames.columns.get(entry.name) for part in replayed.found.parts]
        present = [part for part in parts if part is not None]
        if present:
            columns[entry.name] = np.concatenate(present).astype(np.float64)
    return rows.raw_fields(message, columns)


class Player:
    """Plays a recording into an outlet; `clock` is monotonic, ns."""

    def __init__(
        self, loaded: Loaded, outlet: Outlet, *, control: bool = False, clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:  # fmt: skip
        self._loaded, self._outlet, self._clock, self._control = loaded, outlet, clock, control
        self.playing, self.speed = True, 1.0
        self._t = loaded.t
        self._first, self.duration = float(loaded.t[0]), float(loaded.t[-1])  # of the first and the last sample, s
        self.position = self._first  # where it is, s of the recording's time
        self._next = 0  # row that is to be handed over next
        self._event = 0
        self._told_ns = clock()
        self._still_ns = 0
        self._figure = None if loaded.follower is None else JointFigure(loaded.follower, loaded.frame)
        self._stick = None if loaded.motion is None or self._figure is None else self._figure.stick(loaded.motion)
        self._lay_out()
        self._outlet.hello(self.hello())

    def play(self) -> str:
        """Go on; from the beginning where it has ended."""
        if self.position >= self.duration:
            self.seek(self._first)
        self.playing, self._told_ns = True, self._clock()
        return "it plays"

    def pause(self) -> str:
        """Stand still."""
        self.playing = False
        return f"it stands at {self.position:.3f} s"

    def set_speed(self, speed: float) -> str:
        """Play faster or slower."""
        low, high = SPEEDS
        if not low <= speed <= high:
            raise ParameterError(f"the speed must be from {low:g} to {high:g}, but it is {speed:g}.")
        self.speed = speed
        return f"it plays {speed:g} times as fast"

    def seek(self, position: float) -> str:
        """Go to a time, s: what is shown is the sample at or before it, and the minute before."""
        if not np.isfinite(position):
            raise ParameterError("a position must be a number of seconds.")
        self.position = min(max(position, self._first), self.duration)
        self._told_ns = self._clock()
        self._outlet.reset()
        self._next = int(np.searchsorted(self._t, self.position - BEFORE))
        self._event = sum(t < self.position for t, _ in self._loaded.events)
        self._still_ns = 0
        self._hand_on()
        return f"it is at {self.position:.3f} s"

    def add(self, name: str) -> str:
        """Estimate the recording by a further estimator."""
        loaded = self._loaded
        if loaded.imu is None:
            raise ParameterError("the recording has no samples to estimate from.")
        _require_unlike([*(est.shown.name for est in loaded.estimates), name])
        require_addable(name, loaded.imu.triads, beside=len(loaded.estimates) - 1)
        recording = Recording(imu=loaded.imu, name=loaded.name)
        loaded.estimates.append(_estimated(recording, name, loaded.frame, primary=not loaded.estimates))
        return self._changed(f"{name} runs beside")

    def remove(self, name: str) -> str:
        """Remove an estimator that is not the first."""
        others = [est for est in self._loaded.estimates[1:] if est.shown.name == name]
        if not others:
            raise ParameterError(f"'{name}' was not added.")
        self._loaded.estimates.remove(others[0])
        return self._changed(f"{name} is removed")

    def _changed(self, text: str) -> str:
        self._lay_out()
        self._outlet.hello(self.hello())
        self.seek(self.position)
        return text

    def tick(self) -> None:
        """Hand on what is due."""
        now_ns = self._clock()
        if self.playing:
            self.position += (now_ns - self._told_ns) / 1e9 * self.speed
            if self.position >= self.duration:
                self.position, self.playing = self.duration, False
        self._told_ns = now_ns
        self._tell_events()
        self._hand_on()

    def _tell_events(self) -> None:
        events = self._loaded.events
        while self._event < len(events) and events[self._event][0] <= self.position:
            t, event = events[self._event]
            self._outlet.event(t, event.kind, event.text)
            self._event += 1

    def _hand_on(self) -> None:
        """Hand over the rows up to the position, as far as there is room, and the state where nothing is new."""
        end, now_ns = max(1, int(np.searchsorted(self._t, self.position, side="right"))), self._clock()
        while self._next < end and self._outlet.ready:
            stop = min(end, self._next + _ROWS)
            self._outlet.batch(self.batch(self._next, stop))
            self._next, self._still_ns = stop, now_ns + _STILL_NS
        if now_ns >= self._still_ns and self._outlet.ready:
            self._still_ns = now_ns + _STILL_NS
            self._outlet.batch(self.batch(end, end))

    def batch(self, start: int, stop: int) -> Batch:
        """Batch of some rows of the recording; without any, what is known at the place before."""
        loaded, span = self._loaded, slice(start, stop)
        at = slice(max(stop - 1, 0), max(stop, 1))
        attitudes = {est.shown.name: held.rows(span) for est, held in zip(loaded.estimates, self._held, strict=True)}
        reference = None if self._reference is None else self._reference.rows(span)
        imu = None if loaded.imu is None or stop <= start else loaded.imu[span]
        count = stop - start
        sensed = np.full((count, 10), np.nan)
        if count and loaded.sensed is not None:
            sensed = rows.sensed_rows(loaded.sensed[span])
        joints = None if loaded.motion is None else joint_values([loaded.motion.joints], self._t[span])
        values = np.zeros((0, len(self._layout.columns)))
        if count:
            values = self._layout.values(imu, count, attitudes, reference, joints)
        arrays = {"t": self._t[span], "flags": self._words[span], "values": values, "sensed": sensed}
        return Batch(arrays, self._fields(at))

    def _fields(self, at: slice) -> dict[str, Any]:
        loaded = self._loaded
        attitudes = {est.shown.name: held.rows(at) for est, held in zip(loaded.estimates, self._held, strict=True)}
        reference = None if self._reference is None else self._reference.rows(at)
        imu = None if loaded.imu is None else loaded.imu[at]
        link = Link(
            rate=self._rate, latency=None, age=None, samples=at.stop, drift_ppm=None, clock=RECORDED,
            skipped=0, **loaded.counts,
        )  # fmt: skip
        return {
            "raw": numbers(np.array([column[at.start] for column in loaded.raw.values()], dtype=np.float64)),
            "attitudes": rows.attitudes_now(self._layout, attitudes, reference),
            "gravity_b": None if imu is None else rows.newest(imu.usable("acc")),
            "field_b": None if imu is None else rows.newest(imu.usable("mag")),
            "points": None if self._stick is None else self._stick[at.start].tolist(),
            "link": asdict(link),
            "recording": None,
            "text": None,
            "playback": asdict(Playback(position=self.position, speed=self.speed, playing=self.playing)),
            "arrived_ns": None,
        }

    def _lay_out(self) -> None:
        """Columns, and every estimate at the samples."""
        loaded = self._loaded
        self._held = [_at_samples(est, loaded.t) for est in loaded.estimates]
        reference = loaded.reference
        self._reference = None if reference is None else rows.Attitudes.read(reference, loaded.t, None)
        attitudes = {est.shown.name: held for est, held in zip(loaded.estimates, self._held, strict=True)}
        shown = rows.headed_estimators(
            [est.shown for est in loaded.estimates], attitudes, None if reference is None else reference.north
        )
        triads = () if loaded.imu is None else loaded.imu.triads
        warm = loaded.imu is not None and loaded.imu.temp_c is not None
        title = None if reference is None else reference.source or "reference"
        joints = () if loaded.motion is None else loaded.motion.joints.names
        self._layout = rows.RowLayout(triads, warm, tuple(shown), title, joints)
        self._words = np.zeros(loaded.t.size, dtype=np.uint32) if loaded.imu is None else loaded.imu.flags
        if self._held and self._held[0].flags is not None:
            self._words = self._words | self._held[0].flags
        steps = np.diff(loaded.t)
        self._rate = 1.0 / float(np.median(steps)) if steps.size else None

    def hello(self) -> Hello:
        """What the columns are, and what is played."""
        loaded = self._loaded
        t0_ns = 0 if loaded.imu is None else loaded.imu.meta.t0_ns
        return Hello(
            session=loaded.name,
            device=loaded.device,
            format=loaded.format,
            calibration=loaded.calibration,
            noise=loaded.noise,
            live=False,
            north=str(self._held[0].north) if self._held else None,
            rate=self._rate,
            raw=[] if loaded.message is None else rows.raw_columns(loaded.message, loaded.raw),
            skeleton=None if self._figure is None else self._figure.skeleton,
            guides=(),
            control=self._control,
            recording=False,
            duration=self.duration,
            started_utc=t0_ns / 1e9 if t0_ns else None,
            **greeting(self._layout, loaded.frame),
        )


def _at_samples(est: Estimate, t: Floats) -> rows.Attitudes:
    """An estimate at the samples; its covariance, bias and flags where it has these very times."""
    if len(est.track) == len(t) and np.array_equal(est.track.t, t):
        return rows.Attitudes.from_track(est.track, None, est.declination)
    return rows.Attitudes.from_track(est.track, rows.rows_at(to_ns(t), to_ns(est.track.t)), est.declination)
