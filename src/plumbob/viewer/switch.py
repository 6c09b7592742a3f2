"""A recording that starts and stops while the line runs, marks in it, and a text beside it."""

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from plumbob.core.errors import ParameterError
from plumbob.core.event import Event
from plumbob.files.mcap.layout import SUFFIX, dated, existing_parts
from plumbob.live.runner import hand_on
from plumbob.live.session import RecordSpec
from plumbob.live.sinks import RecordingSink, TextSink, epoch_offset_ns
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
        self,
        stream: Stream,
        folder: Path,
        sink: RecordingSink | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._stream, self._folder, self._clock = stream, folder, clock
        self._sink, self._second = sink, None if sink is None else stream
        self._since = time.time()
        self._behind: Event | None = None
        self._events: list[Event] = []
        self._text: TextSink | None = None
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
            self._sink.on_item(event)
        return f"marked: {text}"

    def write_text(self, name: str = "") -> str:
        """Start a text file, and say where."""
        if self.text is not None:
            raise ParameterError(f"{Path(self.text).name} is being written; stop it first.")
        session = self._stream.session
        if self._stream.filter is None and (session.stage is not None or not session.has_attitude):
            raise ParameterError("a text file gets attitudes, but nothing estimates them; give --filter.")
        path = self._free(name, ".txt")
        self._text, self.text = TextSink(path, session.output.every), str(path)
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
            hand_on(self._second, item, item.t_ns, (), self._sink)

    def on_part(self, part: ItemResult, now_ns: int) -> None:
        """Keep what the line made of it."""
        if self._sink is not None and self._second is self._stream:
            self._sink.on_part(part, now_ns)
        if self._text is not None and not part.source:
            try:
                self._text.on_part(part)
            except OSError as error:
                self._events.append(Event(now_ns, "failed", f"{self.text} cannot be written any more: {error}."))
                self._text = self.text = None

    def tick(self, now_ns: int) -> list[Event]:
        """Send off what is due, and return what has happened."""
        events, self._events = self._events, []
        if self._sink is None:
            failures, self.failures = self.failures, []
            return [*events, *failures]
        self._sink.failures += self.failures
        self.failures = []
        return [*events, *self._sink.tick(now_ns)]

    def close(self) -> list[Event]:
        """End everything."""
        if self._text is not None:
            self._text.close()
            self._text = self.text = None
        if self._sink is not None:
            self._end(self._clock())
        events, self._events = self._events, []
        return events

    def _end(self, now_ns: int) -> dict[str, Any]:
        sink, second = self._sink, self._second
        assert sink is not None
        if second is not None and second is not self._stream:
            hand_on(second, None, now_ns, (), sink)
        self._events += sink.close()
        self._sink = self._second = None
        facts = {**sink.facts, "failed": bool(sink.failures)}
        self.recordings.append(facts)
        return facts

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


def lossy(recordings: Sequence[dict[str, Any]]) -> bool:
    """Whether rows of any are lost, or an output beside it failed."""
    return any(recording["acknowledged"] < recording["rows"] or recording.get("failed") for recording in recordings)
