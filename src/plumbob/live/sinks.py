"""Sinks: what is done with the parts that a line gives: recorded, collected, written, handed on."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, TextIO

import numpy as np
from numpy.typing import NDArray

from plumbob.core import __version__
from plumbob.core.errors import ParameterError
from plumbob.core.event import Event
from plumbob.core.text import visible
from plumbob.core.time import to_ns
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.data.array import ImuArray, UnitMount
from plumbob.files.mcap import Recorder
from plumbob.files.mcap.layout import UTC_FIELD, dated, next_path
from plumbob.files.mcap.recorder import VERSION_KEY
from plumbob.live import rows
from plumbob.live.rows import line_of
from plumbob.live.session import RecordSpec, Session
from plumbob.live.stream import STARTED_AGAIN, ItemResult
from plumbob.live.transports.outgoing import require_writable
from plumbob.live.transports.polled import Schedule
from plumbob.live.transports.transport import Received
from plumbob.protocols.decode import prefix_by_unit
from plumbob.rotations import euler_zyx_from_quat
from plumbob.rotations.frames import heading_zero

_LOOSE: Final = 1024


class Sink:
    """Takes what a line gives, as it comes; by default only its parts, and holds nothing open."""

    source: str | None = ""  # which of several sources' parts it takes: by default the first one's; None: all

    def on_part(self, part: ItemResult) -> None:
        """Take samples and attitudes."""

    def on_event(self, event: Event) -> None:
        """Take something that happened to the line or to the recording."""

    def close(self) -> None:
        """End; more than once does no harm."""


class Collected(Sink):
    """Keeps everything, for a replay or a conversion."""

    source = None

    def __init__(self) -> None:
        self.parts: list[ItemResult] = []
        self.events: list[Event] = []
        self.beside: defaultdict[str, Collected] = defaultdict(Collected)  # what other sources gave, by their names

    def on_part(self, part: ItemResult) -> None:
        """Keep it."""
        (self.beside[part.source] if part.source else self).parts.append(part)

    def on_event(self, event: Event) -> None:
        """Keep it."""
        self.events.append(event)

    @property
    def t_ns(self) -> NDArray[np.int64]:
        """Times of all samples on the host's monotonic clock, ns."""
        return np.concatenate([part.t_ns for part in self.parts]) if self.parts else np.zeros(0, dtype=np.int64)

    def track(self) -> AttitudeTrack | None:
        """Attitude of the whole; None where nothing was estimated."""
        return joined_tracks(part.track for part in self.parts)

    def said(self) -> AttitudeTrack | None:
        """Attitude of the whole that the device said itself; None where it said none."""
        return joined_tracks(part.reference for part in self.parts)

    def imu(self, *, calibrated: bool) -> ImuData | None:
        """Samples of the whole, judged as a recording; None where there are none."""
        return _joined_imu([part.imu if calibrated else part.sensed for part in self.parts])

    def array(self, *, calibrated: bool) -> ImuArray | None:
        """The same of all units that have samples; None where there are none, or the session decodes one unit."""
        if not self.parts or not self.parts[0].units:
            return None
        units, mounts = dict[str, ImuData](), dict[str, UnitMount]()
        for name, unit in self.parts[0].units.items():
            parts = [part.units[name].imu if calibrated else part.units[name].sensed for part in self.parts]
            if (joined := _joined_imu(parts)) is not None:
                units[name], mounts[name] = joined, unit.mount
        return ImuArray(units, mounts)


def _joined_imu(parts: Sequence[ImuData]) -> ImuData | None:
    """Samples of all parts, without triads that have no number in any, as of a compass that is away."""
    candidates = parts[0].triads if parts else ()
    triads = [name for name in candidates if any(np.isfinite(getattr(part, name)).any() for part in parts)]
    if not triads:
        return None
    names = ("t", "flags", *triads, *(() if parts[0].temp_c is None else ("temp_c",)))
    return ImuData(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names}, meta=parts[0].meta)


class TrackKeeper(Sink):
    """Keeps attitudes alone, packed: a few parts of a few rows each take more memory than all their numbers."""

    def __init__(self) -> None:
        self._tracks: list[AttitudeTrack | None] = []
        self._loose = 0

    def on_part(self, part: ItemResult) -> None:
        """Keep its attitude."""
        if part.track is None:
            return
        self._tracks.append(part.track)
        self._loose += 1
        if self._loose == _LOOSE:
            self._tracks[-_LOOSE:] = [joined_tracks(self._tracks[-_LOOSE:])]
            self._loose = 0

    def track(self) -> AttitudeTrack | None:
        """Attitude of the whole; None where nothing was estimated."""
        return joined_tracks(self._tracks)


def joined_tracks(parts: Iterable[AttitudeTrack | None]) -> AttitudeTrack | None:
    """Tracks that follow each other as one, as far as there are some; None where there is none."""
    tracks = [track for track in parts if track is not None]
    return AttitudeTrack.joined(tracks, sum(map(len, tracks))) if tracks else None


def track_lines(track: AttitudeTrack, rows: list[int] | slice = slice(None), *, head: bool) -> Iterator[str]:
    """Lines of a track's rows as text; with what its angles mean before them, where `head` is asked for."""
    if head:
        yield f"# roll about x, pitch about y, yaw about z, turned yaw first; body axes to {track.frame}, "
        yield f"heading from {heading_zero(track.north)}; by {visible(' '.join(track.source.split()))}\n"
        yield "t [s]\troll [deg]\tpitch [deg]\tyaw [deg]\tflags\n"
    angles = to_deg(euler_zyx_from_quat(track.q_nb[rows]))
    words = (np.zeros(len(track), dtype=np.uint32) if track.flags is None else track.flags)[rows]
    for t, (yaw, pitch, roll), word in zip(track.t[rows].tolist(), angles.tolist(), words.tolist(), strict=True):
        yield line_of(t, (roll, pitch, yaw), word) + "\n"


class TextSink(Sink):
    """Writes a new text file with a line for an attitude every so many s, as the hosts of the papers kept theirs.

    With `joints`, the line has the joint angles of a chain.
    """

    def __init__(self, path: str | Path, every: float, *, joints: bool = False) -> None:
        self._path = Path(path)
        if self._path.exists():
            raise ParameterError(
                f"{path} exists already, and a text recording never replaces a file. Name another file."
            )
        require_writable(self._path)
        self._file: TextIO | None = None
        self._schedule, self._joints = Schedule(round(every * 1e9)), joints

    def __str__(self) -> str:
        return str(self._path)

    def on_part(self, part: ItemResult) -> None:
        """Write what is due, and hand it to the system at once."""
        track = part.track if not self._joints else None if part.motion is None else part.motion.joints
        if track is None:
            return
        due = [i for i, t_ns in enumerate(to_ns(track.t).tolist()) if self._schedule.due(t_ns)]
        if not due:
            return
        first = self._file is None
        if self._file is None:
            self._file = self._path.open("x", encoding="utf-8")
        self._file.writelines((rows.joint_lines if self._joints else track_lines)(track, due, head=first))
        self._file.flush()

    def close(self) -> None:
        """End the file."""
        if self._file is not None:
            self._file.close()


def text_sinks(session: Session) -> list[TextSink]:
    """The text that a session asks for, as a list."""
    return [text_sink(session, session.output.text)] if session.output.text else []


def text_sink(session: Session, path: str | Path) -> TextSink:
    """A text of what a session estimates; ParameterError where it estimates nothing."""
    if not (session.has_attitude or session.chain):
        raise ParameterError("a text file gets attitudes, but nothing estimates them; give --filter, or [estimate].")
    return TextSink(path, session.output.every, joints=session.chain is not None)


ESTIMATES: Final = (rows.ATTITUDE, rows.JOINTS)  # kinds of rows that a line estimates


def estimate_rows(kind: str, part: ItemResult) -> Iterator[bytes]:
    """Rows of a kind that a part gives; none where it gives none."""
    if kind == rows.JOINTS:
        return iter(()) if part.motion is None else rows.joint_rows(part.motion_ns.tolist(), part.motion.joints)
    return iter(()) if part.track is None else rows.attitude_rows(part.track_ns.tolist(), part.track)


_EVERY: Final = 0.09  # time after which a chunk is closed, s: with the write itself, a crash costs at most 100 ms

_LOOK_NS: Final = 1_000_000_000
_STEP_NS: Final = 1_000_000_000
"""How often the wall clock is looked at, and a step that is told, ns; smaller ones are how a network mends it."""


def epoch_offset_ns() -> int:
    """UTC minus the monotonic clock, ns, as the wall clock has it now."""
    return time.time_ns() - time.monotonic_ns()


def named_at(session: Session, utc_ns: int) -> Session:
    """Session whose outputs have the names that they get at a start: ``{utc}`` becomes the time, ns since 1970.

    A name with it goes on with the next part where it exists, as one whose session asks for that, since two starts may
    fall into one second. The text goes on as the recording does.
    """
    record, text = session.record, session.output.text
    next_part = record is not None and record.next_part
    if record is not None:
        path = dated(record.path, utc_ns)
        record = replace(record, path=path, next_part=next_part or path != record.path)
    if text is not None:
        next_part, text = next_part or UTC_FIELD in text, dated(text, utc_ns)
        text = str(next_path(Path(text))) if next_part else text
    return replace(session, record=record, output=replace(session.output, text=text))


class RecordingSink:
    """Writes a line into a recording, with the session's texts, so that it can be replayed anywhere.

    `offset` gives UTC minus the monotonic clock, ns. `failures`: outputs beside it that failed, which it keeps too.
    """

    def __init__(self, session: Session, spec: RecordSpec, offset: Callable[[], int] = epoch_offset_ns) -> None:
        self._offset, self._offset_ns, self._look_ns = offset, offset(), 0
        self.recorder = Recorder(
            spec.path,
            epoch_offset_ns=self._offset_ns,
            every=_EVERY,
            rotate=spec.rotate,
            rotate_bytes=spec.rotate_bytes,
            reserve=spec.reserve,
            next_part=spec.next_part,
        )
        self.failures: list[Event] = []
        self._failures_told = 0
        self.recorder.metadata.update(session.texts)
        self.recorder.metadata[VERSION_KEY] = __version__
        self.recorder.metadata["calibration"] = calibration_told(session.card.name if session.card else None)
        self.recorder.require()  # before a line is opened
        require_writable(Path(spec.path), overwrite=True)
        self._own = rows.declare(self.recorder, rows.RECORDER)
        self._channels: dict[str, int] = {}
        for source, each in session.sources.items():
            raw = rows.named_topic(rows.RAW, source)
            self._channels[raw] = self.recorder.channel(raw, "application/octet-stream")
            sensed = prefix_by_unit(each.form.message(each.message))
            units = [unit.unit for unit in each.units] or [source] * bool(sensed)
            topics = [rows.named_topic(rows.IMU, unit) for unit in units]
            topics += [rows.named_topic(rows.ATTITUDE, source)] * each.has_attitude
            topics += [rows.named_topic(rows.JOINTS, source)] * (each.chain is not None)
            for topic in [rows.named_topic(rows.EVENTS, source), *(topics if spec.samples else [])]:
                self._channels[topic] = rows.declare(self.recorder, topic)

    def start(self) -> Event | None:
        """Start the recording; gives the event that is to come first where it goes on behind parts of earlier starts.

        Its time is that of the first item, whose clock may be that of a file.
        """
        self.recorder.start()
        path, before = self.recorder.path, self.recorder.follows
        if before is None:
            return None
        text = f"the recording goes on in {path.name}, behind {before.name}"
        if self.recorder.alone:
            text += f", but its session is another: parts from {path.name} on are to be read apart"
        return Event(0, STARTED_AGAIN, f"{text}.")

    def on_item(self, item: Received | Event) -> None:
        """Keep what has come, before anything else is done with it."""
        is_raw = isinstance(item, Received)
        channel = self._channels[rows.named_topic(rows.RAW if is_raw else rows.EVENTS, item.source)]
        self.recorder.write(channel, item.t_ns, item.data if isinstance(item, Received) else rows.event_row(item))

    def on_part(self, part: ItemResult, now_ns: int) -> None:
        """Keep what the line made of it. A row's time in the file is the read's; the sample's own stands in the row."""
        sensed = {unit: reader.sensed for unit, reader in part.units.items()} or {part.source: part.sensed}
        for unit, imu in sensed.items():
            if (channel := self._channels.get(rows.named_topic(rows.IMU, unit))) is not None:
                for row in rows.imu_rows(part.t_ns.tolist(), imu):
                    self.recorder.write(channel, now_ns, row)
        for kind in ESTIMATES:
            if (channel := self._channels.get(rows.named_topic(kind, part.source))) is not None:
                for row in estimate_rows(kind, part):
                    self.recorder.write(channel, now_ns, row)

    @property
    def facts(self) -> dict[str, Any]:
        """Its path, the rows that were to be written, those on the disk, and those that were dropped."""
        recorder = self.recorder
        return {"path": str(recorder.path), "rows": recorder.written, "acknowledged": recorder.acknowledged,
                "dropped": recorder.dropped}  # fmt: skip

    def tick(self, now_ns: int) -> list[Event]:
        """Send off what is due, and return what happened to the recording; the recording keeps that too."""
        self.recorder.tick(now_ns)
        events = [*self.recorder.take_events(), *self._clock_set(now_ns), *self.failures[self._failures_told :]]
        self._failures_told = len(self.failures)
        for event in events:
            self.recorder.write(self._own, now_ns, rows.event_row(event))
        return events

    def _clock_set(self, now_ns: int) -> list[Event]:
        """Say that the wall clock was set, looked at once a second: a machine without one learns the time late."""
        if now_ns < self._look_ns:
            return []
        self._look_ns = now_ns + _LOOK_NS
        step = self._offset() - self._offset_ns
        if abs(step) < _STEP_NS:
            return []
        self._offset_ns += step
        text = f"the wall clock was set by {step / 1e9:+.3f} s; this recording goes on by the one that it began with."
        return [Event(now_ns, "wall-clock", text)]

    def close(self) -> list[Event]:
        """End the recording, and return what happened last."""
        self.recorder.close()
        return self.recorder.take_events()
