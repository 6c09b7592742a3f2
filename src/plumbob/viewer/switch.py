"""A recording that starts and stops while the line runs, marks in it, and a text beside it."""

import re
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.arm import JointTrack, export, taught
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, PlumbobError
from plumbob.core.event import Event
from plumbob.core.text import counted
from plumbob.files.mcap.layout import SUFFIX, dated, existing_parts
from plumbob.live.runner import hand_on
from plumbob.live.session import RecordSpec
from plumbob.live.session_toml import posed
from plumbob.live.sinks import RecordingSink, Sink, TextSink, epoch_offset_ns, text_sink
from plumbob.live.stream import ItemResult, Stream
from plumbob.live.transports.outgoing import require_writable
from plumbob.live.transports.transport import Received
from plumbob.viewer.commands import LONGEST_NAME, checked_name, checked_text

MARK: Final = "mark"  # Kind of the event that a mark is
_FREE: Final = 1000


class Switch:
    """Takes the place of a recording in a run, and records when it is asked to.

    A recording that starts while the line runs has a stream of its own, which begins with it: its samples and attitudes
    are those that `plumbob record` would have written, and a replay gives them again to the bit. The session's own
    recording, `sink`, is made from the start.
    """

    def __init__(
        self, stream: Stream, folder: Path, sink: RecordingSink | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:  # fmt: skip
        self._stream, self._folder, self._clock = stream, folder, clock
        self._sink, self._second = sink, None if sink is None else stream
        self._since = time.time()
        self._events = deque[Event]()  # threads add to it, too
        self._text: TextSink | None = None
        self._joints, self._pressed = TaughtJoints(), False
        self._teaching: list[threading.Thread] = []
        self._pose: tuple[Floats, float] | None = None  # newest joint angles, and how exactly they are known, rad
        self.recordings: list[dict[str, Any]] = []  # facts of each that has ended
        self.failures: list[Event] = []  # of sinks beside it
        self.text: str | None = None  # text file that is written

    @property
    def recording(self) -> dict[str, Any] | None:
        """What `messages.Recorded` says of the recording that is made; None where none is."""
        if self._sink is None:
            return None
        return {**self._sink.facts, "since": self._since}

    def record(self, name: str = "") -> str:
        """Start a recording, and say where."""
        if self._sink is not None:
            raise ParameterError(f"{self._sink.recorder.path.name} is being recorded; stop it first.")
        session = replace(self._stream.session, record=None)
        path = self._free(name, SUFFIX)
        if self._pose is not None:
            session = posed(session, *self._pose)
        sink = RecordingSink(session, RecordSpec(str(path)))
        sink.start()
        self._sink, self._second, self._since = sink, Stream(session), time.time()
        self._say("recording", f"{path.name} is being recorded")
        return str(path)

    def stop(self) -> str:
        """End the recording, and say what it holds."""
        if self._sink is None:
            raise ParameterError("nothing is being recorded.")
        facts = self._end(self._clock())
        text = f"{Path(facts['path']).name} has ended: {facts['acknowledged']} of {facts['rows']} rows on disk"
        self._say("recording", text)
        return text

    def mark(self, text: str) -> str:
        """Put an event into the recording and the view."""
        text = checked_text(text.strip())
        if not text:
            raise ParameterError("a mark needs text.")
        event = Event(self._clock(), MARK, text)
        self._events.append(event)
        if self._sink is not None:
            self._joints.marks.append(event)
            self._sink.on_item(event)
        return f"marked: {text}"

    def write_text(self, name: str = "") -> str:
        """Start a text file, and say where."""
        if self.text is not None:
            raise ParameterError(f"{Path(self.text).name} is being written; stop it first.")
        session, path = self._stream.session, self._free(name, ".txt")
        if self._stream.filter is None:
            session = replace(session, stage=None)  # it has failed
        self._text, self.text = text_sink(session, path), str(path)
        self._say("text", f"{path.name} is being written")
        return str(path)

    def stop_text(self) -> str:
        """End the text file."""
        if self._text is None or self.text is None:
            raise ParameterError("no text is being written.")
        self._text.close()
        name = Path(self.text).name
        self._text = self.text = None
        self._say("text", f"{name} has ended")
        return f"{name} has ended"

    def start(self) -> Event | None:
        """Start the session's own recording, where there is one; as `RecordingSink.start`."""
        return self._sink.start() if self._sink is not None and self._second is self._stream else None

    def on_item(self, item: Received | Event) -> None:
        """Keep what has come."""
        if self._sink is None:
            return
        self._sink.on_item(item)
        if self._second is not None and self._second is not self._stream:
            hand_on(self._second, item, item.t_ns, [self._joints], self._sink)

    def on_part(self, part: ItemResult, now_ns: int) -> None:
        """Keep what the line made of it."""
        if self._sink is not None and self._second is self._stream:
            self._sink.on_part(part, now_ns)
            self._joints.on_part(part)
        if part.motion is not None and not part.source:
            joints = part.motion.joints
            self._pose = joints.angles[-1], float(np.max(joints.sd[-1]))
        chain = self._stream.session.chain
        if chain is not None and chain.button and not part.source:
            self._press(part.frames.columns[chain.button].astype(bool).tolist())
        if self._text is not None and not part.source:
            try:
                self._text.on_part(part)
            except OSError as error:
                self._events.append(Event(now_ns, "failed", f"{self.text} cannot be written any more: {error}."))
                self._text = self.text = None

    def _press(self, down: Sequence[bool]) -> None:
        """Start or stop a recording each time that a button of the device is pressed."""
        for before, now in pairwise([self._pressed, *down]):
            if now and not before:
                try:
                    _ = self.record() if self._sink is None else self.stop()
                except PlumbobError as error:
                    self._say("failed", str(error))
        self._pressed = down[-1] if down else self._pressed

    def tick(self, now_ns: int) -> list[Event]:
        """Send off what is due, and return what has happened."""
        if self._sink is None:
            failures, self.failures = self.failures, []
            return [*self._happened(), *failures]
        self._sink.failures += self.failures
        self.failures = []
        return [*self._happened(), *self._sink.tick(now_ns)]

    def close(self) -> list[Event]:
        """End everything."""
        if self._text is not None:
            self._text.close()
            self._text = self.text = None
        if self._sink is not None:
            self._end(self._clock())
        for thread in self._teaching:
            thread.join()
        return self._happened()

    def _happened(self) -> list[Event]:
        """Events since the last call."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def _end(self, now_ns: int) -> dict[str, Any]:
        sink, second = self._sink, self._second
        assert sink is not None
        if second is not None and second is not self._stream:
            hand_on(second, None, now_ns, [self._joints], sink)
        self._events += sink.close()
        self._sink = self._second = None
        facts = {**sink.facts, "failed": bool(sink.failures)}
        self.recordings.append(facts)
        joints, self._joints = self._joints, TaughtJoints()
        if joints.tracks and second is not None:
            program = Path(facts["path"]).with_suffix(".csv")
            self._teaching.append(threading.Thread(target=self._teach, args=(joints, second, program)))
            self._teaching[-1].start()  # a long recording takes seconds, which the line must not wait for
        return facts

    def _teach(self, joints: "TaughtJoints", stream: Stream, path: Path) -> None:
        """Write the program of a recording of a chain beside it."""
        try:
            program = taught(joints.track(), stream.chain and stream.chain.chain)
            export(program, path)
        except (PlumbobError, OSError) as error:
            self._say("failed", f"{path.name}: {error}")
            return
        at = [(event.t_ns - (stream.t0_ns or 0)) / 1e9 for event in joints.marks]
        marks = [f"{event.text} at {t:.2f} s" for event, t in zip(
            joints.marks, np.interp(at, np.asarray(program.recorded), program.t), strict=True)]  # fmt: skip
        stops = counted(len(program.stops), "stop")
        self._say("program", "; ".join([f"{path.name}: {program.t[-1]:.2f} s, {stops}", *marks]))

    def _free(self, name: str, suffix: str) -> Path:
        """Path of a new file: the name and the time, and a number where that exists."""
        tame = re.sub(r"[^A-Za-z0-9_-]+", "-", self._stream.session.name).strip("-")[:LONGEST_NAME] or "recording"
        stem = checked_name(name) if name else tame
        require_writable(self._folder / stem, overwrite=True)
        stem = dated(f"{stem}-{{utc}}", self._clock() + epoch_offset_ns())
        for number in range(1, _FREE):
            path = self._folder / f"{stem}{'' if number == 1 else f'-{number}'}{suffix}"
            if not path.exists() and not (suffix == SUFFIX and existing_parts(path)):
                return path
        raise ParameterError(f"{stem}{suffix} exists {_FREE} times; give another name.")

    def _say(self, kind: str, text: str) -> None:
        self._events.append(Event(self._clock(), kind, text))


class TaughtJoints(Sink):
    """Keeps joint angles of a recording, and its marks."""

    def __init__(self) -> None:
        self.tracks: list[JointTrack] = []
        self.marks: list[Event] = []

    def on_part(self, part: ItemResult) -> None:
        """Keep its joint angles."""
        if part.motion is not None:
            self.tracks.append(part.motion.joints)

    def track(self) -> JointTrack:
        """Angles of the whole."""
        t, angles = (np.concatenate([getattr(track, name) for track in self.tracks]) for name in ("t", "angles"))
        return JointTrack(t, self.tracks[0].names, angles)
