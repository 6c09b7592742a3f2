"""A live stream from its device to a recording: `plumbob record`, and `plumbob.record`."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from plumbob.core import check
from plumbob.core.errors import ParameterError
from plumbob.core.text import counted
from plumbob.core.units import Quantity, given
from plumbob.live.runner import Note, Ran, Watch, run_stream, silence_words
from plumbob.live.sending import send_sinks, with_sent
from plumbob.live.session import RecordSpec, Session
from plumbob.live.session_toml import capture_session
from plumbob.live.sinks import RecordingSink, Sink, named_at, text_sinks
from plumbob.live.sources import open_sources
from plumbob.live.stream import Stream
from plumbob.live.transports.transport import Stopping
from plumbob.protocols.format_toml import unassigned_told


@dataclass(frozen=True, eq=False, repr=False)
class RecordedStream(Ran):
    """A live stream that has ended.

    `recording` has its ``path``, the ``rows`` that were to be written, those ``acknowledged`` by the disk and
    ``dropped``, or is None; `failed`: an output beside the recording did on the way; `sent`: by destination, how many
    messages it got, and how many were dropped because it was away or too slow: of a server, of all its clients.
    """

    recording: Mapping[str, Any] | None
    failed: bool
    sent: Sequence[Mapping[str, Any]] = ()

    @property
    def lossy(self) -> bool:
        """Whether rows of the recording are lost, or an output failed."""
        recording = self.recording
        return self.failed or (recording is not None and recording["acknowledged"] < recording["rows"])

    @property
    def nothing(self) -> str | None:
        """Why there is no sample, and where to look; None where there are some."""
        return None if self.samples else silence_words(self.stream)

    def facts(self) -> Mapping[str, str]:
        """As of every run, and where it was recorded."""
        return {**super().facts(), "recorded": "nothing" if self.recording is None else self.recording["path"]}

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        sent = {"sent": [dict(each) for each in self.sent]} if self.sent else {}
        return super().summary() | sent | ({} if self.recording is None else {"recording": dict(self.recording)})

    def text(self) -> str:
        """What a reader wants to know first, a line each."""
        recording = self.recording
        where = (
            "NOTHING: neither --out nor [record] names a file"
            if recording is None
            else f"{recording['path']}: {recording['acknowledged']} of {recording['rows']} rows on disk"
        )
        sent = (f"\nsent         {each['as']} to {each['to']}: {counted(each['sent'], 'message')}, "
                f"{each['dropped']} dropped" for each in self.sent)  # fmt: skip
        return f"{super().text()}{''.join(sent)}\nrecorded     {where}"


def record(
    session: "Session | str | Path | None" = None, *, out: str | Path | None = None, next_part: bool = False,
    text: str | Path | None = None, duration: float | str | None = None, send: Sequence[str] = (),
    sinks: Sequence[Sink] = (), stop: Stopping | None = None, opened: Callable[[], object] | None = None,
    note: Note | None = None, progress: Callable[[Watch], None] | None = None, **line: Any,
) -> RecordedStream:  # fmt: skip
    """Read a live stream, estimate its attitude as it comes, and record both.

    Parameters
    ----------
    session : Session or path, optional
        What the stream is, a file (``.toml``); without one, the options of the line say it.
    out : path, optional
        Recording to write, ``.mcap``; ``{utc}`` in its name is the time of the start.
    next_part : bool
        Whether to go on with the next part where the recording exists, instead of refusing.
    text : path, optional
        Text file that gets a line of attitude now and then.
    duration : float or str, optional
        When to stop: s, or text with a unit; by default when the source ends, or somebody says `stop`.
    send : sequence of str
        To whom the attitude is sent as it comes, as ``"nmea udp:127.0.0.1:10110 10Hz HDT,PASHR"``, beside the
        ``[[send]]`` of the session.
    sinks : sequence of Sink
        What else takes the samples and attitudes as they come.
    stop : Stopping, optional
        Set from another thread to end, such as a `threading.Event`.
    opened : callable, optional
        Called once everything is ready and the source is open.
    note : callable, optional
        Called with each remark as it is made.
    progress : callable, optional
        Called with the `Watch` after each part.
    **line
        As of `plumbob.live.session_toml.capture_session`: ``port``, ``capture`` or ``iio``, ``format``, ``filter``...

    Returns
    -------
    RecordedStream

    Raises
    ------
    ParameterError
        If not exactly one stream is named, its options do not fit, or an output exists already.
    LineError
        If it cannot be opened.
    PlumbobError
        As in `plumbob.load_session`.
    """
    if isinstance(session, Session) and line:
        raise ParameterError("a Session says everything about its stream; leave the other options out.")
    if not isinstance(session, Session):
        session = capture_session(None if session is None else check.path("session", session), **line)
    chosen = _with_outputs(session, out, next_part=next_part, text=text)
    chosen = with_sent(chosen, send)
    chosen = named_at(chosen, time.time_ns())
    seconds = given("duration", duration, Quantity.TIME, positive=True)
    stream, say = Stream(chosen), note or (lambda line: None)
    announce(chosen, say)
    others = text_sinks(chosen)
    recording_sink = None if chosen.record is None else RecordingSink(chosen, chosen.record)
    watch = Watch(stream, note, progress=progress)
    source = open_sources(chosen)
    sending = send_sinks(chosen, note=say, keep=None if recording_sink is None else recording_sink.on_item)
    if opened is not None:
        opened()
    if seconds is None and not source.finished and stop is not None:
        say(f"waiting for {source.name}; Ctrl-C or SIGTERM ends it, with a recording that is whole")
    run_stream(
        stream,
        source,
        sinks=[watch, *others, *sending, *sinks],
        recording=recording_sink,
        duration=seconds,
        stop=stop,
        each=watch.look,
    )
    sent = [sink.summary() for sink in sending]
    if recording_sink is None:
        return RecordedStream(watch, None, False, sent)
    return RecordedStream(watch, recording_sink.facts, bool(recording_sink.failures), sent)


def _with_outputs(session: Session, out: str | Path | None, *, next_part: bool, text: str | Path | None) -> Session:
    """Session whose outputs are those that were asked for; what is not stays as the session says."""
    if out:
        session = replace(session, record=replace(session.record or RecordSpec(""), path=str(out)))
    if next_part:
        if session.record is None:
            raise ParameterError("--next-part belongs to a recording; name one with --out.")
        session = replace(session, record=replace(session.record, next_part=True))
    return replace(session, output=replace(session.output, text=str(text))) if text else session


def announce(session: Session, say: Note) -> None:
    """What is known before the first byte: spare bytes of the format."""
    if remark := unassigned_told(session.form, session.form.message(session.message)):
        say(remark)
