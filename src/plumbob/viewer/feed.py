"""The feed: a sink that makes of a stream's parts what a page shows, some sixty times a second, and never waits."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, one_line
from plumbob.core.event import Event
from plumbob.data import AttitudeTrack, ImuData
from plumbob.filters import Start
from plumbob.live.lines import LineFormat, blank_frames
from plumbob.live.runner import LONG
from plumbob.live.session import Session, reference_names
from plumbob.live.sinks import Sink, epoch_offset_ns
from plumbob.live.stream import ItemResult, Stream
from plumbob.live.transports.transport import Received
from plumbob.protocols.encode import encode
from plumbob.rotations import Frame, North
from plumbob.viewer import overlays as drawn
from plumbob.viewer import rows
from plumbob.viewer.charts import Rows
from plumbob.viewer.commands import Outlet
from plumbob.viewer.messages import Batch, Hello, Link, numbers

EVERY_NS: Final = 16_000_000  # Least time between two batches, ns
_STILL_NS: Final = 500_000_000  # After this time a batch without samples says how the line does
_REPORT_NS: Final = 1_000_000_000
_RATE_NS: Final = 3_000_000_000  # Over which the rate is counted, ns
_SLOWEST: Final = 1.0  # Least time without a field that counts as its absence, s: no magnetometer is slower than 1 Hz
_FALLEN: Final = 2.0  # A flag has fallen that no sample had for so long, s
_TOLD: Final = sum(flags.MEANING) & ~(
    flags.GYR_ABSENT | flags.ACC_ABSENT | flags.MAG_ABSENT | flags.ACC_GATED | flags.MAG_GATED | flags.AT_REST
    | flags.GAP
)  # fmt: skip
"""Flags whose rise and fall are events; the others come and go all the time, or have events of their own."""
GUIDES: Final = {"mag": "mag", "accel": "acc", "gyro": "gyr"}
"""What can be calibrated with guidance, and the triad that it takes."""


@dataclass(frozen=True, eq=False, slots=True)
class Aligned:
    """Parts whose samples have their attitudes."""

    parts: Sequence[ItemResult]
    t_ns: NDArray[np.int64]
    imu: ImuData
    sensed: ImuData
    attitudes: rows.Attitudes | None


class Aligner:
    """Holds parts until the attitudes of their samples are there, which with a lag come later."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self._parts: deque[ItemResult] = deque()
        self._tracks: list[tuple[NDArray[np.int64], AttitudeTrack]] = []

    def add(self, part: ItemResult) -> None:
        """Take a part."""
        if part.t_ns.size:
            self._parts.append(part)
        if part.track is not None:
            self._tracks.append((part.track_ns, part.track))

    def take(self, *, all_: bool = False) -> Aligned | None:
        """What is complete, or `all_` that there is; None where that is nothing."""
        known_ns = self._tracks[-1][0][-1] if self._tracks else None
        if self._stream.filter is None or all_:
            known_ns = np.iinfo(np.int64).max
        parts = []
        while self._parts and known_ns is not None and self._parts[0].t_ns[-1] <= known_ns:
            parts.append(self._parts.popleft())
        if not parts:
            return None
        t_ns = np.concatenate([part.t_ns for part in parts])
        imu, sensed = ImuData.joined([part.imu for part in parts]), ImuData.joined([part.sensed for part in parts])
        return Aligned(parts, t_ns, imu, sensed, self._attitudes(t_ns))

    def _attitudes(self, t_ns: NDArray[np.int64]) -> rows.Attitudes | None:
        filter_ = self._stream.filter
        if filter_ is None:
            return None
        if not self._tracks:
            return rows.Attitudes.unknown(t_ns.size, filter_.frame, filter_.north(False))
        track_ns = np.concatenate([stamps for stamps, _ in self._tracks])
        track = AttitudeTrack.joined([segment for _, segment in self._tracks], track_ns.size)
        self._tracks = [(stamps, segment) for stamps, segment in self._tracks if stamps[-1] > t_ns[-1]]
        places = None if np.array_equal(track_ns, t_ns) else rows.rows_at(t_ns, track_ns)
        return rows.Attitudes.from_track(track, places, filter_.common.declination)


class FlagWatch:
    """Says which flags rise and fall."""

    def __init__(self) -> None:
        self._seen: dict[int, float] = {}
        self._field_at = -np.inf

    def shown(self, t: Floats, words: NDArray[np.uint32]) -> NDArray[np.uint32]:
        """Flags of the next samples; a field is not absent where its sensor is slower than the others."""
        field_at = np.maximum.accumulate(np.where(words & flags.MAG_ABSENT, self._field_at, t))
        self._field_at = float(field_at[-1])
        return np.where(t - field_at < _SLOWEST, words & ~np.uint32(flags.MAG_ABSENT), words)

    def changes(self, t: Floats, words: NDArray[np.uint32]) -> Iterator[tuple[float, str]]:
        """What has changed with the next samples: time, and a sentence."""
        raised = int(np.bitwise_or.reduce(words)) & _TOLD
        end = float(t[-1])
        for bit, (name, meaning) in flags.MEANING.items():
            if raised & bit:
                if bit not in self._seen:
                    yield float(t[np.argmax((words & np.uint32(bit)) != 0)]), f"{name}: {meaning}"
                self._seen[bit] = end
            elif bit in self._seen and end - self._seen[bit] > _FALLEN:
                yield self._seen.pop(bit), f"{name} has ended"


class Feed(Sink):
    """Sink that shows a stream, which keeps covariances. A fault in it ends the view, not the stream.

    `truth` is on the time line of the stream; `beside` gives further fields of a batch: ``recording``, ``text``; `note`
    is called with why the view has ended; `clock` is monotonic, ns.
    """

    source = None

    def __init__(
        self, stream: Stream, outlet: Outlet, *, also: Sequence[str] = (), truth: AttitudeTrack | None = None,
        control: bool = False, recording: bool = False, beside: Callable[[], Mapping[str, Any]] | None = None,
        note: Callable[[str], object] | None = None, clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:  # fmt: skip
        self.failed = ""  # why the view has ended; empty while it goes on
        self._stream, self._outlet, self._note, self._clock = stream, outlet, note, clock
        self._control, self._recording = control, recording
        self._beside = beside or dict
        self._held = Aligner(stream)
        self._truth = truth
        session = stream.session
        probe = probed(session)
        self._triads = () if probe is None else probe.imu.triads
        self._temperature = probe is not None and probe.imu.temp_c is not None
        self._message = session.form.message(session.message)
        self._raw_columns = [] if probe is None else rows.raw_columns(self._message, probe.frames.columns)
        self._frame = session.frame or (None if truth is None else truth.frame)
        self._overlays: dict[str, drawn.Overlay | drawn.SourceOverlay] = {
            name: drawn.SourceOverlay(name, stream)
            for name, other in stream.beside.items()
            if other.session.has_attitude
        }
        self._preparing: dict[str, threading.Thread] = {}
        self._started = False
        self._figure = None if stream.chain is None else drawn.JointFigure(stream.chain, stream.session.frame)
        stage, filter_ = session.stage, stream.filter
        self._own = None if stage is None or filter_ is None else rows.shown_estimator(
            stage.name, stage.filter, drawn.described(filter_), primary=True
        )  # fmt: skip
        self._layout = self._laid_out({})
        self._samples = 0
        self._greeted = False
        self._north: North | None = None
        self._counted: deque[tuple[int, int]] = deque()
        self._told: tuple[int, dict[str, Any]] = (0, {})
        self._flags = FlagWatch()
        self._known: dict[str, Any] = {"raw": [None] * len(self._raw_columns), "attitudes": {}, "gravity_b": None,
                                       "field_b": None, "points": None, "arrived_ns": None}  # fmt: skip
        self._current: rows.Attitudes | None = None
        self._due_ns = self._still_ns = 0
        for name in also:
            self.add(name)
        self._started = True
        self.hello()

    @property
    def overlays(self) -> Sequence[str]:
        """Names of the further estimators."""
        return tuple(self._overlays)

    def hello(self) -> None:
        """Say what the columns are, again for who did not hear it."""
        self._safely(lambda: self._outlet.hello(self._hello()))

    def add(self, name: str) -> str:
        """Add an estimator: from the current attitude, where there is one, else from its first samples."""
        frame = self._frame
        if name in (*self._overlays, *self._preparing) or (self._own is not None and name == self._own.name):
            raise ParameterError(f"{name} is already running.")
        drawn.require_addable(name, self._triads, beside=len(self._overlays) + len(self._preparing))
        if frame is None:
            raise ParameterError("the session names no frame, so that nothing can be estimated; give --frame.")
        if not self._started:
            self._attach(name, frame)
            return f"{name} runs beside"
        ready = threading.Thread(target=lambda: drawn.Overlay(name, frame, self._stream.session.meta), daemon=True)
        self._preparing[name] = ready  # the first use of a filter may be compiled, which the line must not wait for
        ready.start()
        return f"{name} will run beside"

    def _attach(self, name: str, frame: Frame) -> None:
        at = self._current
        start = None if at is None or not np.isfinite(at.q_nb).all() else Start(at.q_nb[-1], at.north)
        self._overlays[name] = drawn.Overlay(name, frame, self._stream.session.meta, start)
        self._lay_out()

    def _attach_prepared(self) -> None:
        """Attach what is ready by now."""
        for name, thread in list(self._preparing.items()):
            if not thread.is_alive() and self._frame is not None:
                del self._preparing[name]
                self._attach(name, self._frame)

    def remove(self, name: str) -> str:
        """Remove an estimator."""
        if name not in self._overlays:
            raise ParameterError(f"'{name}' was not added; these were: {', '.join(self._overlays) or 'none'}.")
        self._overlays.pop(name).close()
        self._lay_out()
        return f"{name} is removed"

    def on_part(self, part: ItemResult) -> None:
        """Take samples and attitudes; they are shown with the next batch."""
        if not part.source:
            self._safely(lambda: self._take(part))
        elif isinstance(overlay := self._overlays.get(part.source), drawn.SourceOverlay):
            overlay.on_part(part)

    def on_event(self, event: Event) -> None:
        """Show what happened."""
        t0_ns = self._stream.t0_ns
        self.say(None if t0_ns is None else (event.t_ns - t0_ns) / 1e9, event.kind, event.text)

    def say(self, t: float | None, kind: str, text: str) -> None:
        """Show an event at a time of the stream, s."""
        self._safely(lambda: self._outlet.event(t, kind, text))

    @property
    def now(self) -> float | None:
        """Time of the stream now, s; None before its first sample."""
        t0_ns = self._stream.t0_ns
        return None if t0_ns is None else (self._clock() - t0_ns) / 1e9

    def tick(self) -> None:
        """Send what is due; to be called often, also where nothing comes."""
        self._safely(self._send_due)

    def close(self) -> None:
        """Show what is left."""
        self._safely(lambda: self._send(self._clock(), all_=True))
        for overlay in self._overlays.values():
            overlay.close()
        self._overlays = {}

    def _safely(self, action: Callable[[], object]) -> None:
        if self.failed:
            return
        try:
            action()
        except Exception as error:  # whatever it is, the recorder goes on
            self.failed = f"the view has ended by a fault: {type(error).__name__}: {one_line(error)}"
            try:
                self._outlet.event(None, "view", self.failed)
            finally:
                if self._note is not None:
                    self._note(self.failed)

    def _take(self, part: ItemResult) -> None:
        self._held.add(part)
        if self._figure is not None and part.motion is not None:
            self._figure.take(part.motion)
        self._samples += part.t_ns.size
        if part.t_ns.size and self._stretched:
            self._known["arrived_ns"] = self._clock()
        self._send_due()

    @property
    def _stretched(self) -> bool:
        """Whether the times of reads are not those of this host."""
        source = self._stream.session.source
        return self._stream.session.timed_by != "frames" or (source is not None and "speed" in source.settings)

    def _send_due(self) -> None:
        now_ns = self._clock()
        if now_ns >= self._due_ns:
            self._send(now_ns)

    def _send(self, now_ns: int, *, all_: bool = False) -> None:
        ready = self._held.take(all_=all_)
        if ready is None and not all_ and now_ns < self._still_ns:
            return
        self._due_ns, self._still_ns = now_ns + EVERY_NS, now_ns + _STILL_NS
        self._attach_prepared()
        nothing: Any = Rows.none(len(self._layout.columns))._asdict() | {"sensed": np.zeros((0, 10))}
        part = nothing if ready is None else self._rows(ready)
        fields = {**self._known, "link": self._link(now_ns), "playback": None, "recording": None, "text": None}
        self._outlet.batch(Batch(part, fields | dict(self._beside())))

    def _rows(self, ready: Aligned) -> dict[str, NDArray[Any]]:
        """Rows of samples; what is known now changes with them."""
        attitudes = {} if ready.attitudes is None or self._own is None else {self._own.name: ready.attitudes}
        attitudes |= {name: overlay.take(ready.imu) for name, overlay in self._overlays.items()}
        reference = self._reference(ready)
        layout = self._laid_out(attitudes, None if reference is None else reference.north)
        self._current = next((at.rows(slice(-1, None)) for at in attitudes.values()), None)
        north = None if self._current is None else self._current.north
        if not self._greeted or layout != self._layout or north is not self._north:
            self._greeted, self._layout, self._north = True, layout, north
            self._outlet.hello(self._hello())
        imu = ready.imu
        words = imu.flags if ready.attitudes is None or ready.attitudes.flags is None else (
            imu.flags | ready.attitudes.flags
        )  # fmt: skip
        words = self._flags.shown(imu.t, words)
        for t, text in self._flags.changes(imu.t, words):
            self._outlet.event(t, "flag", text)
        self._remember(ready, attitudes, reference)
        joints = None if self._figure is None else self._figure.values(imu.t)
        values = layout.values(imu, len(imu), attitudes, reference, joints)
        return {"t": imu.t, "flags": words, "values": values, "sensed": rows.sensed_rows(ready.sensed)}

    def _remember(
        self, ready: Aligned, attitudes: Mapping[str, rows.Attitudes], reference: rows.Attitudes | None
    ) -> None:
        """The newest of what has no rows."""
        last, now = ready.parts[-1], self._known
        if self._figure is not None:
            now["points"] = self._figure.points
        fields = {name: values[-1:] for name, values in last.frames.columns.items()}
        now["raw"] = [numbers(column)[0] for column in rows.raw_fields(self._message, fields).values()]
        now["attitudes"] |= rows.attitudes_now(self._layout, attitudes, reference)
        now["gravity_b"] = rows.newest(ready.imu.usable("acc")) or now["gravity_b"]
        now["field_b"] = rows.newest(ready.imu.usable("mag")) or now["field_b"]
        if not self._stretched:
            now["arrived_ns"] = int(last.frames.t_ns[-1])

    def _reference(self, ready: Aligned) -> rows.Attitudes | None:
        """Reference at the samples, in its own frame."""
        if self._truth is not None:
            return rows.Attitudes.read(self._truth, ready.imu.t, None)
        said = [part.reference for part in ready.parts if part.reference is not None]
        if not said:
            return None
        return rows.Attitudes(np.concatenate([track.q_nb for track in said]), said[0].frame, said[0].north)

    def _link(self, now_ns: int) -> dict[str, Any]:
        """How the stream does."""
        if now_ns >= self._told[0]:
            self._told = now_ns + _REPORT_NS, self._timed()
        self._counted.append((now_ns, self._samples))
        while self._counted[0][0] < now_ns - _RATE_NS and len(self._counted) > 2:
            self._counted.popleft()
        (begin_ns, before), (end_ns, after) = self._counted[0], self._counted[-1]
        rate = (after - before) / (end_ns - begin_ns) * 1e9 if end_ns - begin_ns > _STILL_NS else None
        link = Link(
            rate=rate, latency=None, age=None, samples=self._samples, skipped=0,
            **drawn.frame_faults(self._stream), **self._told[1],
        )  # fmt: skip
        return asdict(link)

    def _timed(self) -> dict[str, Any]:
        report = self._stream.time_report()
        drift = report.drift_ppm if report.mode == "clock" and self._stream.session.timed_by == "frames" else np.nan
        t0_ns, long_enough = self._stream.t0_ns, False
        if t0_ns is not None:
            long_enough = self._clock() - t0_ns >= LONG * 1e9  # before, jitter of the host passes for drift
        mode = report.mode if self._stream.session.timed_by == "frames" else self._stream.session.timed_by
        return {"lost": report.lost, "gaps": report.gap_count, "clock": mode,
                "drift_ppm": float(drift) if long_enough and np.isfinite(drift) else None}  # fmt: skip

    def _lay_out(self) -> None:
        """Take over other estimators."""
        self._layout = self._laid_out({})
        self._known["attitudes"] = {}
        self._greeted = False

    def _laid_out(self, attitudes: Mapping[str, rows.Attitudes], north: North | None = None) -> rows.RowLayout:
        shown = [overlay.shown for overlay in self._overlays.values()]
        if self._own is not None:
            shown = [self._own, *shown]
        elif shown:
            shown[0] = shown[0]._replace(estimator=replace(shown[0].estimator, primary=True))
        if attitudes:
            shown = rows.headed_estimators(shown, attitudes, north)
        joints = () if self._figure is None else self._figure.names
        return rows.RowLayout(self._triads, self._temperature, tuple(shown), self._reference_told(), joints)

    def _reference_told(self) -> str | None:
        if self._truth is not None:
            return self._truth.source or "truth"
        reference = self._stream.session.reference
        return None if reference is None else f"{', '.join(reference_names(reference, self._message))} in the frames"

    def _hello(self) -> Hello:
        session, t0_ns = self._stream.session, self._stream.t0_ns
        noise = None if session.stage is None else session.stage.noise
        return Hello(
            session=session.name,
            device=session.meta.device,
            format=session.form.name,
            calibration="uncalibrated" if session.card is None else session.card.name,
            noise="none" if noise is None else f"{noise.device} ({noise.source})",
            live=True,
            north=None if self._north is None else str(self._north),
            rate=session.meta.rate_nominal,
            raw=self._raw_columns,
            skeleton=None if self._figure is None else self._figure.skeleton,
            guides=[name for name, triad in GUIDES.items() if triad in self._triads],
            control=self._control,
            recording=self._recording,
            duration=None,
            started_utc=None if t0_ns is None else (t0_ns + epoch_offset_ns()) / 1e9,
            **drawn.greeting(self._layout, self._frame),
        )


def probed(session: Session) -> ItemResult | None:
    """Part of made-up frames of a session, which shows what its samples have; None where none can be made."""
    message = session.form.message(session.message)
    other = Stream(replace(session, stage=None, rates=None, scheme="", chain=None))
    if isinstance(session.form, LineFormat):
        return other.through({message.name: blank_frames(message)})
    physical = [field.name for field in message.fields if field.physical][:1]
    silence = encode(session.form, dict.fromkeys(physical, np.zeros(3)), message=message.name)
    part = other.feed(Received(0, silence.tobytes()))
    return part or other.finish()
