"""What a recording of a line holds: raw bytes and events first, decoded samples and attitudes beside them."""

import time
from collections.abc import Callable
from typing import Final

from plumbob import __version__
from plumbob.data import calibration_told
from plumbob.link import Event, Received
from plumbob.pipeline import rows
from plumbob.pipeline.line import Part
from plumbob.pipeline.session import RecordSpec, Session
from plumbob.record import Recorder

_EVERY: Final = 0.09
"""Time after which a chunk is closed, s: with the write itself, a crash costs at most 100 ms."""


def epoch_offset_ns() -> int:
    """UTC minus the monotonic clock, ns, as the wall clock has it now."""
    return time.time_ns() - time.monotonic_ns()


class Keeper:
    """Writes a line into a recording.

    Parameters
    ----------
    session : Session
        The line; its texts go into the recording, so that it can be replayed anywhere.
    spec : RecordSpec
        Where to.
    offset : callable
        Gives the difference between UTC and the monotonic clock, ns.
    """

    def __init__(self, session: Session, spec: RecordSpec, offset: Callable[[], int] = epoch_offset_ns) -> None:
        self.recorder = Recorder(
            spec.path,
            epoch_offset_ns=offset(),
            every=_EVERY,
            rotate=spec.rotate,
            rotate_bytes=spec.rotate_bytes,
            reserve=spec.reserve,
        )
        self.recorder.metadata.update(session.texts)
        self.recorder.metadata["plumbob"] = __version__
        self.recorder.metadata["calibration"] = calibration_told(session.card.name if session.card else None)
        self._raw = self.recorder.channel(rows.RAW, "application/octet-stream")
        self._own = rows.declare(self.recorder, rows.RECORDER)
        self._events = rows.declare(self.recorder, rows.EVENTS)
        self._imu = rows.declare(self.recorder, rows.IMU) if spec.samples else 0
        with_attitude = spec.samples and session.stage is not None
        self._attitude = rows.declare(self.recorder, rows.ATTITUDE) if with_attitude else 0

    def on_item(self, item: Received | Event) -> None:
        """Keep what has come, before anything else is done with it."""
        if isinstance(item, Received):
            self.recorder.write(self._raw, item.t_ns, item.data)
            return
        self.recorder.write(self._events, item.t_ns, rows.event_row(item))

    def on_part(self, part: Part, now_ns: int) -> None:
        """Keep what the line made of it. A row's time in the file is the read's; the sample's own stands in the row."""
        if not self._imu:
            return
        stamps = part.t_ns.tolist()
        for row in rows.imu_rows(stamps, part.sensed):
            self.recorder.write(self._imu, now_ns, row)
        if self._attitude and part.track is not None:
            for row in rows.attitude_rows(stamps, part.track):
                self.recorder.write(self._attitude, now_ns, row)

    def tick(self, now_ns: int) -> list[Event]:
        """Send off what is due, and return what happened to the recording; the recording keeps that too."""
        self.recorder.tick(now_ns)
        events = self.recorder.take_events()
        for event in events:
            self.recorder.write(self._own, now_ns, rows.event_row(event))
        return events

    def close(self) -> list[Event]:
        """End the recording, and return what happened last."""
        self.recorder.close()
        return self.recorder.take_events()
