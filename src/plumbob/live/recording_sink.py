"""What a recording of a line holds: raw bytes and events first, decoded samples and attitudes beside them."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

from plumbob.core.event import Event
from plumbob.core.version import __version__
from plumbob.data import calibration_told
from plumbob.files.mcap import Recorder
from plumbob.files.mcap.layout import UTC_FIELD, dated, next_path
from plumbob.files.mcap.recorder import VERSION_KEY
from plumbob.live import rows
from plumbob.live.session import RecordSpec, Session
from plumbob.live.stream import STARTED_AGAIN, ItemResult
from plumbob.live.transports.transport import Received

_EVERY: Final = 0.09
"""Time after which a chunk is closed, s: with the write itself, a crash costs at most 100 ms."""

_LOOK_NS: Final = 1_000_000_000
_STEP_NS: Final = 1_000_000_000
"""How often the wall clock is looked at, and a step that is told, ns; smaller ones are how a network mends it."""


def epoch_offset_ns() -> int:
    """UTC minus the monotonic clock, ns, as the wall clock has it now."""
    return time.time_ns() - time.monotonic_ns()


def named_at(session: Session, utc_ns: int) -> Session:
    """Session whose outputs have the names that they get at a start.

    ``{utc}`` becomes the time; a name with it goes on with the next part where it exists, as one whose session asks for
    that, since two starts may fall into one second. The text goes on as the recording does.

    Parameters
    ----------
    session : Session
        The line.
    utc_ns : int
        UTC of the start, ns since 1970.
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
    """Writes a line into a recording.

    Parameters
    ----------
    session : Session
        The line; its texts go into the recording, so that it can be replayed anywhere.
    spec : RecordSpec
        Where to.
    offset : callable
        Gives the difference between UTC and the monotonic clock, ns.

    Attributes
    ----------
    failures : list of Event
        Outputs beside the recording that have failed, by whoever writes them; the recording keeps that too.
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
        self._raw = self.recorder.channel(rows.RAW, "application/octet-stream")
        self._own = rows.declare(self.recorder, rows.RECORDER)
        self._events = rows.declare(self.recorder, rows.EVENTS)
        units = [unit.unit for unit in session.units] or [""]
        self._imu = {name: rows.declare(self.recorder, rows.unit_topic(name)) for name in units if spec.samples}
        with_attitude = spec.samples and session.stage is not None
        self._attitude = rows.declare(self.recorder, rows.ATTITUDE) if with_attitude else 0

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
        if isinstance(item, Received):
            self.recorder.write(self._raw, item.t_ns, item.data)
            return
        self.recorder.write(self._events, item.t_ns, rows.event_row(item))

    def on_part(self, part: ItemResult, now_ns: int) -> None:
        """Keep what the line made of it. A row's time in the file is the read's; the sample's own stands in the row."""
        if not self._imu:
            return
        stamps = part.t_ns.tolist()
        for unit, channel in self._imu.items():
            for row in rows.imu_rows(stamps, part.units[unit].sensed if unit else part.sensed):
                self.recorder.write(channel, now_ns, row)
        if self._attitude and part.track is not None:
            for row in rows.attitude_rows(part.track_ns.tolist(), part.track):
                self.recorder.write(self._attitude, now_ns, row)

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
