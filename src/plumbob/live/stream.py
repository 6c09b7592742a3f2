"""The line: bytes in, attitude out, the same object for a live stream, a replay and a simulation.

What comes out depends on nothing but the items that went in, in their order: a replay of recorded reads and events
gives the same bits as they gave live.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, Final, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, PlumbobError
from plumbob.core.event import Event
from plumbob.core.findings import Finding
from plumbob.core.result import plain
from plumbob.core.time import REMEMBERED, Repeats, to_ns, to_s
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.recording import TimeReport
from plumbob.filters.known import ARRAY_FILTERS, EXTENSIBLE
from plumbob.filters.offline import calibrated, make_follower, start_at
from plumbob.filters.smoother import FixedLag
from plumbob.filters.start import TRUTH_WORD
from plumbob.live.lines import decoder_of
from plumbob.live.session import Session, UnitSpec, needed_frame, reference_names
from plumbob.live.timing.counter import CountedTime
from plumbob.live.timing.spec import Counter, TimeSpec
from plumbob.live.timing.timebase import TimeBase
from plumbob.live.transports.transport import Received
from plumbob.protocols.decode import Frames, joined, triads_of, unit_prefix, unit_temperature
from plumbob.protocols.format import Format, Message
from plumbob.rotations import Frame, in_body_axes, quat_from_euler_zyx

BROKEN: Final = ("lost", "dropped")  # events after which what is pending belongs to nothing that will come
BACK: Final = "reopened"  # event after which time starts anew behind a gap
STARTED_AGAIN: Final = "restarted"
"""Event after which everything starts anew: the recorder itself was away, and nobody knows what came meanwhile."""
_MINUTE_NS: Final = 60_000_000_000
_KEYFRAME: Final = 0.1  # time of the samples that a chain takes at once, s
_NORM: Final = 1e-3  # by which the norm of a quaternion may differ from 1
_APART_NS: Final = 1_000_000  # least step between samples of two starts; less only where a line ran ahead of the host


class UnitPart(NamedTuple):
    """What one of several units gave: what its sensors said, the same calibrated, and how it is mounted."""

    sensed: ImuData
    imu: ImuData
    mount: UnitMount = UnitMount()


@dataclass(frozen=True, eq=False, slots=True)
class ItemResult:
    """What one item gave; every sample has its decoded frame in `frames`.

    Times are on the host's monotonic clock, ns: `t_ns` (N,) of samples, `track_ns` (M,) of attitudes. `sensed` is
    uncalibrated, in body axes, from the first sample of the line on; `imu` is calibrated where there is a card. With a
    lag, `track` is of earlier samples, and at the end may come without any. `units` has all where the session decodes
    several, `reference` the attitude that the device says at the samples.
    """

    t_ns: NDArray[np.int64]
    frames: Frames
    sensed: ImuData
    imu: ImuData
    track: AttitudeTrack | None
    track_ns: NDArray[np.int64]
    units: Mapping[str, UnitPart] = field(default_factory=dict)
    reference: AttitudeTrack | None = None
    source: str = ""  # which of several sources gave it; empty for the first
    motion: Any = None  # a `plumbob.arm.ArmEstimate` of samples up to here, where the session has a chain
    motion_ns: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # times of its samples

    @property
    def array(self) -> ImuArray | None:
        """Samples of all units, calibrated where they have cards; None where the session decodes one."""
        mounts = {name: unit.mount for name, unit in self.units.items()}
        return ImuArray({name: unit.imu for name, unit in self.units.items()}, mounts) if mounts else None


class _UnitReader:
    """Takes the samples of one unit out of the frames."""

    def __init__(self, spec: UnitSpec) -> None:
        self._spec = spec
        self._temp_c = math.nan

    def take(self, frames: Frames, t_ns: NDArray[np.int64], stamp_flags: NDArray[np.uint32]) -> UnitPart:
        """Its samples, which come at these times, with what the stamps have shown."""
        spec = self._spec
        triads = {name: self._in_body(values) for name, values in triads_of(frames, spec.unit).items()}
        temp_c, words = self._temperature(frames), frames.flags[spec.unit] | stamp_flags
        sensed = ImuData.live(t_ns, triads, temp_c=temp_c, flags=words, meta=spec.meta)
        return UnitPart(sensed, calibrated(sensed, spec.card, live=True), spec.mount)

    def _temperature(self, frames: Frames) -> Floats | None:
        """Temperature (N,), °C; where one is missing, the last that was known, for it changes slowly."""
        temp_c = unit_temperature(frames, self._spec.unit)
        if temp_c is None:
            return None
        if np.isnan(temp_c).any():
            temp_c = temp_c.copy()
            for i in np.flatnonzero(np.isnan(temp_c)).tolist():
                temp_c[i] = temp_c[i - 1] if i else self._temp_c
        self._temp_c = float(temp_c[-1]) if temp_c.size else self._temp_c
        return temp_c

    def _in_body(self, values: Floats) -> Floats:
        axes = self._spec.meta.axes
        return values if axes == "x y z" else in_body_axes(axes, values)


class Stream:
    """Decodes, stamps, calibrates and estimates a stream.

    Parameters
    ----------
    session : Session
        What the bytes mean and what to do with them. Its source and its recording are others' business.
    covariance : bool
        Whether tracks have the covariance that a filter claims, which costs time; the attitude is the same to the bit.
    source : str
        Which of several sources it is.

    Raises
    ------
    ParameterError
        If the message does not have the unit.
    """

    def __init__(self, session: Session, *, covariance: bool = False, source: str = "") -> None:
        self.source = source
        self.session = check.kind("session", session, Session, hint="load_session(path) gives one.")
        self.beside = {s.name: Stream(s, covariance=covariance, source=s.name) for s in session.beside}
        self._covariance = covariance
        self.decoder = decoder_of(session.form)
        message = session.form.message(session.message)
        unit_prefix(message, session.unit)
        self._spec = _time_spec(session, message)
        self._known_again = _known_again(time_spec(session.form, message))
        self.faults = 0
        self._repeated = 0
        self._t0: int | None = None
        self._earlier: list[TimeReport] = []
        self._again = False
        self._last_ns: int | None = None
        self._newest: ItemResult | None = None
        self._shift_ns = 0
        self.failure: PlumbobError | None = None  # why the filter failed, until that is noted
        self.rate_notes: list[Finding] = []
        self._rates = None if session.rates is None else session.rates.made(self.rate_notes.append)
        self._rest_ns = round(self._rates.rest_ends * 1e9) if self._rates else 0
        self._held: list[tuple[Frames, NDArray[np.int64], NDArray[np.uint32]]] = []
        self._monitor: Any = None
        self._begin()

    def _begin(self) -> None:
        """Know nothing yet."""
        self.time = TimeBase(self._spec)
        self._leads: list[tuple[int, float]] = []
        self._next_lead_ns: int | None = None
        self._counted = CountedTime(self._spec) if self.session.timed_by == "count" else None
        self._began_ns: int | None = None
        self._latest_ns = 0
        session, stage = self.session, self.session.stage
        main = UnitSpec(session.unit, session.meta, session.card)  # which goes before what their list says of it
        specs = [replace(main, mount=u.mount) if u.unit == main.unit else u for u in session.units] or [main]
        self._units = {spec.unit: _UnitReader(spec) for spec in specs}
        self._repeats = Repeats()
        frame = session.frame if stage is None else needed_frame("[estimate]", session.frame)
        self.filter = None if stage is None or frame is None else make_follower(stage, frame, session.meta)
        self.chain = self.session.made_chain
        self._unfollowed: list[ImuArray] = []  # samples that the chain has not had
        self._started = False

    def taking(self, item: Received | Event | None) -> "list[Stream]":
        """Which streams an item concerns: the one whose source gave it, or all, as an end (None) and a new start do."""
        if item is None or (isinstance(item, Event) and item.kind == STARTED_AGAIN):
            return [self, *self.beside.values()]
        return [self.beside[item.source] if item.source else self]

    def feed(self, item: Received | Event) -> ItemResult | None:
        """Take what has come, and return what it completes; None where that is nothing."""
        if isinstance(item, Received):
            return self.through(self.decoder.feed(item.data, item.t_ns))
        done = self.through(self.decoder.finish()) if item.kind in (*BROKEN, STARTED_AGAIN) else None
        if item.kind == STARTED_AGAIN:
            done = self._with_rest(done or self._released())
            if self.time.report().frames:
                self._earlier.append(self.time.report())
            self._begin()
            self._again = True
            return done
        if item.kind == BACK or (self._counted is not None and item.kind in BROKEN):
            self.time.reopened(item.t_ns if self._counted is None else self._latest_ns)
        return done

    def finish(self) -> ItemResult | None:
        """Say that the stream has ended, and return what was pending."""
        return self._with_rest(self.through(self.decoder.finish()) or self._released())

    def _with_rest(self, part: ItemResult | None) -> ItemResult | None:
        """What is pending where no sample of this start will come any more: attitudes that were waiting for some."""
        rest = self.filter.finish() if isinstance(self.filter, FixedLag) else None
        if self._newest is None or (rest is None and self.chain is None):
            return part
        if part is None:
            newest, no_time = self._newest, np.zeros(0, dtype=np.int64)
            frames = _only(newest.frames, np.zeros(newest.t_ns.size, dtype=bool))
            part = self._part(frames, no_time, no_time.astype(np.uint32))
        if self.chain is not None:
            part = self._follow(part, end=True)
        if rest is None:
            return part
        tracks = [track for track in (part.track, rest) if track is not None]
        track = AttitudeTrack.joined(tracks, sum(map(len, tracks)))
        return replace(part, track=track, track_ns=self._track_ns(track.t))

    def _track_ns(self, t: Floats) -> NDArray[np.int64]:
        assert self._t0 is not None
        track_ns: NDArray[np.int64] = to_ns(t) + self._t0
        return track_ns

    def _follow(self, part: ItemResult, *, end: bool = False) -> ItemResult:
        """The same with joint angles that its samples complete; the chain takes those of a keyframe at a time."""
        if self.chain is None or part.array is None:
            return part
        waiting = self._unfollowed = [*self._unfollowed, part.array]
        if not end and waiting[-1].t[-1] - waiting[0].t[0] < _KEYFRAME:
            return part
        self._unfollowed = []
        units = {name: ImuData.joined([array.units[name] for array in waiting]) for name in waiting[0].units}
        try:
            motion = self.chain.take(ImuArray(units, waiting[0].mounts), end=end)
        except PlumbobError as error:  # the pose is not the one that was held
            self.chain, self.failure = None, error
            return part
        return part if motion is None else replace(part, motion=motion, motion_ns=self._track_ns(motion.joints.t))

    def lead(self, t_ns: NDArray[np.int64]) -> Floats:
        """By how much stamps (N,), ns, are later than the host's own time, ns: of a device clock, which drifts.

        It is the line beneath the arrivals, as the first stamps and those of each minute have shown it, and the last.
        """
        report = self.time.report()
        if report.mode != "clock" or self.session.timed_by != "frames" or self._last_ns is None:
            return np.zeros(t_ns.size)
        at = np.array([*(stamp for stamp, _ in self._leads), self._last_ns]) - self._last_ns
        leads = [*(lead for _, lead in self._leads), 1e9 * report.offset]
        x = t_ns - self._last_ns
        return np.asarray(np.interp(x, at, leads) - np.minimum(x - at[0], 0) * report.drift_ppm * 1e-6)

    def in_clock(self, other: "Stream", t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Stamps (N,), ns, as the clock of another stream has them."""
        host_ns = t_ns - np.rint(self.lead(t_ns)).astype(np.int64)
        return host_ns + np.rint(other.lead(host_ns)).astype(np.int64)

    def against(self, other: "Stream") -> dict[str, float]:
        """By how much its clock runs faster than that of another stream, ppm, and is ahead of it at the end, ms."""
        at = np.array([self._last_ns or 0])
        slow = [float(stream.time.report().drift_ppm) if stream.lead(at).any() else 0.0 for stream in (other, self)]
        ahead = float((self.lead(at) - other.lead(at))[0]) / 1e6
        return {"clock_ppm": slow[0] - slow[1], "clock_ahead_ms": ahead}

    def report(self) -> dict[str, Any]:
        """What became of every byte and of time, for JSON."""
        timing = plain(self.time_report())
        if self.session.timed_by != "frames":  # the host's clock beside itself
            timing |= {"mode": self.session.timed_by, "drift_ppm": None, "offset": None, "delays": None}
        return {"bytes": self.decoder.counts.summary(), "time": timing, "not_usable": self.faults}

    def time_report(self) -> TimeReport:
        """What the stamps have shown, of all starts; each after the first is a gap."""
        report, again = TimeReport.joined([*self._earlier, self.time.report()]), self._repeated
        return replace(
            report,
            gap_count=report.gap_count + len(self._earlier),
            frames=report.frames + again,
            duplicates=report.duplicates + again,
        )

    def through(self, by_message: dict[str, Frames]) -> ItemResult | None:
        """Take decoded frames, and return what they complete."""
        frames = self._without_repeats(by_message.get(self.session.message))
        if frames is None:
            return None
        host, clock = self._clocks(frames)
        stamps = self.time.stamp(host, frames.start, clock=clock, frames=device_counts(frames)["frames"])
        usable = (stamps.flags & np.uint32(flags.TIME_FAULT)) == 0
        if not usable.all():
            self.faults += int(np.count_nonzero(~usable))
            if not usable.any():
                return None
            frames = _only(frames, usable)
        t_ns, stamp_flags = stamps.t_ns[usable], stamps.flags[usable]
        if self._again:
            self._again = False
            stamp_flags[0] |= flags.GAP
            if self._last_ns is not None:
                self._shift_ns = max(0, self._last_ns + _APART_NS - int(t_ns[0]))
        t_ns += self._shift_ns
        self._last_ns = int(t_ns[-1])
        if self._next_lead_ns is not None and self._last_ns >= self._next_lead_ns:
            self._leads.append((self._last_ns, 1e9 * self.time.report().offset))
        if self._next_lead_ns is None or self._last_ns >= self._next_lead_ns:
            self._next_lead_ns = self._last_ns + _MINUTE_NS
        if self._t0 is None:
            self._t0 = int(t_ns[0])
        self._held.append((frames, t_ns, stamp_flags))
        return self._released() if t_ns[-1] - self._t0 >= self._rest_ns else None

    def _released(self) -> ItemResult | None:
        """What the frames give that have come, once the rest has passed whose mean is taken off the rates."""
        if not self._held:
            return None
        held, self._held, self._rest_ns = self._held, [], 0
        frames = joined([part for part, _, _ in held])
        t_ns, stamp_flags = (np.concatenate([part[i] for part in held]) for i in (1, 2))
        part = self._part(frames, t_ns, stamp_flags)
        if not self._started:
            self._start(part)
        track, track_ns = self._estimate(part)
        self._newest = replace(part, track=track, track_ns=track_ns)
        return self._follow(self._newest)

    def _without_repeats(self, frames: Frames | None) -> Frames | None:
        """Frames that were not sent before; None where there are none."""
        if frames is None or not self._known_again:
            return frames
        fresh = self._repeats.fresh(np.column_stack(tuple(frames.columns.values())))
        if fresh.all():
            return frames
        count = int(np.count_nonzero(~fresh))
        self.faults += count
        self._repeated += count
        return _only(frames, fresh) if fresh.any() else None

    def _estimate(self, part: ItemResult) -> tuple[AttitudeTrack | None, NDArray[np.int64]]:
        """Attitudes that these samples complete, and their times; what the device says where nothing estimates."""
        t_ns, imu = part.t_ns, part.imu
        if self.filter is not None and self.session.scheme in ARRAY_FILTERS:
            return cast(Any, self.filter).take(part.array), t_ns
        if self.session.stage is None and part.reference is not None:
            return part.reference, t_ns
        if isinstance(self.filter, FixedLag):
            ready = self.filter.take(imu)
            return ready, t_ns[:0] if ready is None else self._track_ns(ready.t)
        if self.filter is None:
            return None, t_ns[:0]
        try:
            return self.filter.process(imu, covariance=self._covariance, look=False), t_ns
        except ParameterError as error:  # of another package's filter
            self.filter, self.failure = None, error
            return None, t_ns[:0]

    def _start(self, part: ItemResult) -> None:
        """Start the filter from the device's attitude in the first frame, where the session asks for it."""
        self._started = True
        session, said = self.session, part.reference
        if self.filter is None or session.stage is None or said is None:
            return
        if session.stage.init == TRUTH_WORD and said.known[0]:
            start = start_at(said.q_nb[0], said.frame, said.north, self.filter, "mag" in part.imu.triads)
            self.filter = make_follower(session.stage, self.filter.frame, session.meta, start=start)

    def _said(self, frames: Frames, t_ns: NDArray[np.int64]) -> AttitudeTrack | None:
        """Attitude that the device says; not known where its quaternion is none."""
        spec = self.session.reference
        if spec is None:
            return None
        names = reference_names(spec, frames.message)
        values: Floats = np.stack([frames.columns[name] for name in names], axis=1).astype(np.float64)
        q_nb = values if len(names) == 4 else quat_from_euler_zyx(values)
        with np.errstate(invalid="ignore"):
            q_nb[~(np.abs(np.linalg.norm(q_nb, axis=1) - 1.0) < _NORM)] = np.nan
        frame, source = spec.frame or Frame.NED, f"{', '.join(names)} of {self.session.form.name}"
        return AttitudeTrack(t=to_s(t_ns), q_nb=q_nb, frame=frame, north=spec.north, source=source)

    def _clocks(self, frames: Frames) -> tuple[NDArray[np.int64], ArrayLike | None]:
        """Host's times, and what the device's clock says; where one of them is the sample's own, it is both."""
        device = device_counts(frames)["clock"]
        match self.session.timed_by:
            case "count":
                return self._counted_ns(frames), device
            case "poll":
                return frames.t_ns, frames.t_ns
            case "kernel":
                stamps = np.asarray(device, dtype=np.int64)
                return stamps, stamps
        return frames.t_ns, device

    def _counted_ns(self, frames: Frames) -> NDArray[np.int64]:
        """Times that the frames count from the first read on, which take the place of the host's."""
        assert self._counted is not None
        if self._began_ns is None:
            self._began_ns = int(frames.t_ns[0])
        t_ns = self._began_ns + self._counted.after_first(frames.start, **device_counts(frames))
        self._latest_ns = int(t_ns[-1])
        return t_ns

    @property
    def t0_ns(self) -> int | None:
        """Host's monotonic time of the first sample, ns; None before it."""
        return self._t0

    def _part(self, frames: Frames, t_ns: NDArray[np.int64], stamp_flags: NDArray[np.uint32]) -> ItemResult:
        """Samples of all units; no attitude yet."""
        assert self._t0 is not None
        units = {name: unit.take(frames, t_ns - self._t0, stamp_flags) for name, unit in self._units.items()}
        main = units[self.session.unit]
        said = self._said(frames, t_ns - self._t0) if t_ns.size else None
        several = units if self.session.units else {}
        part = ItemResult(t_ns, frames, main.sensed, main.imu, None, t_ns[:0], several, said, self.source)
        try:
            if self._rates is not None and t_ns.size:
                return replace(part, imu=self._rates.take(part.imu))
            if self.session.scheme == "monitor" and t_ns.size:
                return replace(part, imu=self._monitored(part.array))
        except PlumbobError as error:  # no rate has come in the rest
            self._rates, self.filter, self.failure = None, None, error
        return part

    def _monitored(self, array: ImuArray | None) -> ImuData:
        """The one unit of all that agree."""
        assert array is not None
        if self._monitor is None:
            self._monitor = cast(Any, EXTENSIBLE.find("monitor")).Monitor.from_array(array[:1])
        return cast(ImuData, self._monitor.take(array).imu)


def time_spec(form: Format, message: Message) -> TimeSpec:
    """What the frames of a message bring to tell the time by."""
    device, count = message.of_role("clock"), message.of_role("counter")
    alone = len(form.messages) == 1 and not form.framing.length_field
    tick = device and abs(Fraction(device.scale * 1e9).limit_denominator(1 << 30))  # exact: decimals and fractions
    return TimeSpec(
        clock=Counter(device.width, tick, down=device.scale < 0.0) if device and tick else None,
        frames=Counter(count.width) if count else None,
        rate=form.framing.rate,
        frame_bytes=(message.length or None) if alone else None,
    )


def _known_again(spec: TimeSpec) -> bool:
    """Whether a frame brings a clock or a counter that does not come round among the last ones that are known."""
    counters = (spec.frames, 2 * REMEMBERED), (spec.clock, 2**16)  # a clock counts many ticks from frame to frame
    return any(counter is not None and counter.modulus >= least for counter, least in counters)


def device_counts(frames: Frames) -> dict[str, NDArray[Any] | None]:
    """What the frames' own clock and counter say, by the names that a time base has for them."""
    roles = {"clock": frames.message.of_role("clock"), "frames": frames.message.of_role("counter")}
    return {name: None if field is None else frames.columns[field.name] for name, field in roles.items()}


def _time_spec(session: Session, message: Message) -> TimeSpec:
    """The same for a session: whose samples are timed by the host has the host's clock for the device's."""
    if session.timed_by in {"frames", "count"}:
        speed = 1.0 if session.source is None else float(session.source.settings.get("speed", 1.0))
        return replace(time_spec(session.form, message), rate=session.meta.rate_nominal, speed=speed)
    return TimeSpec(clock=Counter(64, 1), rate=session.meta.rate_nominal if session.timed_by == "poll" else None)


def _only(frames: Frames, rows: NDArray[np.bool_]) -> Frames:
    return Frames(
        frames.message,
        frames.start[rows],
        frames.t_ns[rows],
        {name: column[rows] for name, column in frames.columns.items()},
        {unit: words[rows] for unit, words in frames.flags.items()},
    )
