"""Run a stream until it ends: read, keep, decode, estimate, hand on; what it shows meanwhile, and its report."""

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final, Protocol

from plumbob.core.event import Event
from plumbob.core.findings import Finding, as_json
from plumbob.core.text import FactsText, counted, visible
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, calibration_told
from plumbob.data.calibrated import temperature_beyond
from plumbob.data.recording import inferred
from plumbob.filters.offline import bias_beyond, declination_deg
from plumbob.live.sinks import Sink
from plumbob.live.sources import KERNEL
from plumbob.live.stream import ItemResult, Stream
from plumbob.live.transports.transport import Received, Source, Stopping
from plumbob.protocols.decode import Counts
from plumbob.protocols.overlap import passes_anything
from plumbob.protocols.page import UNCHECKED
from plumbob.rotations import euler_zyx_from_quat
from plumbob.rotations.frames import counted_from

_WAIT: Final = 0.02  # longest wait for the source, s; the recording's chunks close on time also where nothing comes


class Keeper(Protocol):
    """What keeps a run: a recording, or what starts and stops one; its methods are those of `RecordingSink`."""

    failures: list[Event]

    def start(self) -> Event | None:
        """Begin."""

    def on_item(self, item: Received | Event) -> None:
        """Keep what has come."""

    def on_part(self, part: ItemResult, now_ns: int) -> None:
        """Keep what the line made of it."""

    def tick(self, now_ns: int) -> list[Event]:
        """Send off what is due, and return what has happened."""

    def close(self) -> list[Event]:
        """End, and return what happened last."""


def run_stream(
    stream: Stream, source: Source, *, sinks: Sequence[Sink] = (), recording: Keeper | None = None,
    duration: float | None = None, until_lost: bool = False, stop: Stopping | None = None,
    each: Callable[[], None] | None = None, clock: Callable[[], int] = time.monotonic_ns,
) -> None:  # fmt: skip
    """Run until the source is finished, the time is over or `stop` is set; then end recording, sinks and source.

    Bytes are handed to the recording before anything else is done with them. A sink that the system refuses, as on a
    full disk, does not end a recording: it gets no more, and the recording and the other sinks are informed. Nor does a
    filter of another package that fails: there are no attitudes behind it.
    `until_lost` ends with the line, instead of waiting for it; `each` is called after each read, also where nothing
    came.
    """
    end = None if duration is None else clock() + round(duration * 1e9)
    if recording:
        sinks = [_TolerantSink(sink, recording, clock) for sink in sinks]
    try:
        behind = recording.start() if recording else None
        while not source.finished and not (stop and stop.is_set()) and (end is None or clock() < end):
            items = source.read(_WAIT)
            if behind and items:
                items, behind = [replace(behind, t_ns=items[0].t_ns), *items], None
            for item in items:
                if recording:
                    recording.on_item(item)
                hand_on(stream, item, item.t_ns, sinks, recording)
                if isinstance(item, Event):
                    _on_events([item], sinks)
            if each:
                each()
            if until_lost and any(isinstance(item, Event) and item.kind == "lost" for item in items):
                break
            if recording:
                _on_events(recording.tick(clock()), sinks)
        hand_on(stream, None, clock(), sinks, recording)
    finally:
        source.close()
        if recording:
            _on_events(recording.close(), sinks)
        for sink in sinks:
            sink.close()


class _TolerantSink(Sink):
    """A sink beside a recording, which goes on when the sink fails."""

    def __init__(self, sink: Sink, recording: Keeper, clock: Callable[[], int]) -> None:
        self._sink: Sink | None = sink
        self.source = sink.source
        self._recording, self._clock = recording, clock

    def on_part(self, part: ItemResult) -> None:
        self._do(lambda sink: sink.on_part(part))

    def on_event(self, event: Event) -> None:
        self._do(lambda sink: sink.on_event(event))

    def close(self) -> None:
        self._do(lambda sink: sink.close())

    def _do(self, action: Callable[[Sink], None]) -> None:
        if self._sink is None:
            return
        try:
            action(self._sink)
        except OSError as error:
            what = f"{self._sink} cannot be written any more: {error.strerror or error}."
            self._sink = None
            self._recording.failures.append(Event(self._clock(), "failed", what))


def hand_on(
    stream: Stream, item: Received | Event | None, now_ns: int, sinks: Sequence[Sink], recording: Keeper | None
) -> None:
    """Feed an item to a stream and those beside it, as far as it concerns them, and hand on what they make of it.

    None ends them. That a filter failed is noted in the recording once, and ends a run without one.
    """
    for each in stream.taking(item):
        _hand_on(each, each.finish() if item is None else each.feed(item), now_ns, sinks, recording)


def _hand_on(
    stream: Stream, part: ItemResult | None, now_ns: int, sinks: Sequence[Sink], recording: Keeper | None
) -> None:
    if (failure := stream.failure) is not None:
        if recording is None:
            raise failure
        recording.failures.append(Event(now_ns, "failed", str(failure)))
        stream.failure = None
    if part is None:
        return
    for sink in sinks:
        if sink.source in (None, part.source):
            sink.on_part(part)
    if recording:
        recording.on_part(part, now_ns)


def _on_events(events: Sequence[Event], sinks: Sequence[Sink]) -> None:
    for event in events:
        for sink in sinks:
            sink.on_event(event)


Note = Callable[[str], None]

LONG: Final = 60.0  # duration above which the drift of a device clock is told, s

SETTLED: Final = 30.0  # time after which the estimated bias of a start in motion says something, s

_DOUBT_BYTES: Final = 256  # within which one frame must have been found
_DOUBT_FRAMES: Final = 8  # the same, in frames of the greatest length


class Watch(Sink):
    """Sink that counts what a stream gives, and says what somebody should look at while there is time.

    `events` are remarks, too; those of a replay are old. `last` is the newest part that has samples, `track` the newest
    attitudes, `beyond` by how much samples leave the card's temperatures, and the bias its prior; `beside` is the same
    of other sources.
    """

    source = None

    def __init__(
        self, stream: Stream, note: Note | None = None, *, events: bool = True,
        progress: "Callable[[Watch], None] | None" = None,
    ) -> None:  # fmt: skip
        self.stream = stream
        self.beside = {name: Watch(other, note, events=False) for name, other in stream.beside.items()}
        self._note, self._events, self._progress = note or _nowhere, events, progress or _nowhere
        self.samples = 0
        self.last: ItemResult | None = None
        self.track: AttitudeTrack | None = None
        self.motion: Any = None  # newest of a chain, a `plumbob.arm.ArmEstimate`
        self.beyond: tuple[Finding, ...] = ()
        self._doubted = False

    def on_part(self, part: ItemResult) -> None:
        """Count, and say once each that the temperature leaves the span of the card, and the bias its prior."""
        if part.source != self.stream.source:
            self.beside[part.source].on_part(part)
            return
        card, filter_, track = self.stream.session.card, self.stream.filter, part.track
        if part.t_ns.size:
            self.samples += part.t_ns.size
            self.last = part
            if card is not None:
                self._say_once(float(part.imu.t[0]), temperature_beyond(card, part.imu))
        self.motion = part.motion or self.motion
        for remark in () if part.motion is None else part.motion.notes:
            self._note(str(remark))
        if track is not None:
            self.track = track
            if filter_ is not None and float(track.t[-1]) >= SETTLED:
                self._say_once(float(track.t[0]), bias_beyond(filter_, track))
        self._progress(self)

    def _say_once(self, t: float, findings: tuple[Finding, ...]) -> None:
        for finding in findings:
            if finding.code not in {said.code for said in self.beyond}:
                self.beyond += (finding,)
                self._note(f"at {t:.1f} s: {finding}")

    def look(self) -> None:
        """Say once that bytes come and none of them is a frame, while there is time to do something about it."""
        counts, form = self.stream.decoder.counts, self.stream.decoder.form
        if self._doubted or counts.framed or counts.received < max(_DOUBT_BYTES, _DOUBT_FRAMES * form.framing.most):
            return
        self._doubted = True
        why = "".join(f"; {note}" for note in self.stream.decoder.notes) or counts.why_rejected()
        none = f"none of the first {counts.received} bytes is a frame of {form.name}{why}"
        self._note(f"{none}: is it the right format, and baud?")

    def on_event(self, event: Event) -> None:
        """Say it."""
        if self._events:
            self._note(f"{event.kind}: {event.text}")


def _nowhere(_: object) -> None:
    pass


@dataclass(frozen=True, eq=False, repr=False)
class Ran(FactsText):
    """What a stream gave, live or replayed."""

    watch: Watch  # what was counted, and said on the way

    @property
    def stream(self) -> Stream:
        """The stream, with its counts."""
        return self.watch.stream

    @property
    def samples(self) -> int:
        """Samples that were decoded."""
        return self.watch.samples

    def facts(self) -> Mapping[str, str]:
        """Session, device, samples, and the attitude at the end."""
        report = self.summary()
        facts = {"session": report["session"], "device": report["device"], "samples": str(self.samples)}
        facts |= {"filter": report["filter"].partition("(")[0]} if report["filter"] else {}
        return facts | ({"at the end": last} if (last := live_attitude(self.watch.track)) else {})

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        return run_report(self.watch)

    def text(self) -> str:
        """What a reader wants to know first, a line each."""
        return "\n".join(report_lines(self.summary(), live_attitude(self.watch.track)))


class StatusLine:
    """One line on a terminal, once a second, and every remark as a note out of its way.

    A receiver that has closed it does not matter: a recording outlives its terminal.
    """

    def __init__(self, *, quiet: bool = False) -> None:
        self._next, self._shown = 0.0, sys.stderr.isatty() and not quiet

    def show(self, watch: Watch) -> None:
        """Show now and then what a stream gives."""
        if not self._shown or watch.last is None or (t := float(watch.last.imu.t[-1])) < self._next:
            return
        self._next = t + 1.0
        bare = "" if watch.stream.session.card else " UNCALIBRATED"
        junk, attitude = watch.stream.decoder.counts.junk, live_attitude(watch.track)
        self._write(f"\r{t:9.1f} s  {watch.samples} samples{bare}  {junk} junk bytes  {attitude}\033[K")

    def note(self, text: str) -> None:
        """Tell the user."""
        self._write(f"{self._cleared()}note: {visible(text)}\n")

    def close(self) -> None:
        """End the line on the terminal."""
        self._write(self._cleared())
        self._shown = False

    def _cleared(self) -> str:
        return "\r\033[K" if self._shown else ""

    def _write(self, text: str) -> None:
        with suppress(OSError):
            sys.stderr.write(text)
            sys.stderr.flush()


def silence_words(stream: Stream) -> str:
    """Why a stream gave no sample, and where to look."""
    counts, session = stream.decoder.counts, stream.session
    if not counts.received:
        return "no byte has arrived: is the device on, is it the right port, does it send by itself?"
    if counts.frames[session.message]:
        return (
            f"none of {counts.frames[session.message]} frames could be used: their times repeat or contradict others."
        )
    if others := ", ".join(f"{count} of {name}" for name, count in counts.frames.items() if count):
        return f"no frame of message {session.message} has come, but {others}; name that in [format] message."
    if notes := stream.decoder.notes:
        return f"none of {counts.received} bytes is a line of {session.form.title}: {notes[0]}."
    none = f"none of {counts.received} bytes is a frame of {session.form.name}{counts.why_rejected()}"
    return f"{none}. {_look_at(counts)}"


def _look_at(counts: Counts) -> str:
    """What to look at first, by what most candidates failed."""
    advice = (
        (counts.bad_checksum, "Frames begin as they should, but their checksum fails. Check [frame] length, and kind, "
         "at, from and to of its checksum."),
        (counts.bad_content, "Frames begin as they should, but constants, digits or parity differ. Check those."),
        (counts.bad_length, "Check [frame] length_field, or the speed of the line."),
        (counts.unknown, "Frames pass their check, but match no message. Check the constants of each."),
    )  # fmt: skip
    most, hint = max(advice, key=lambda pair: pair[0])
    hint = hint if most else "Nothing begins as a frame should. Check the speed of the line and [frame] sync."
    return f"{hint} 'plumbob decode' tries other formats on a file of raw bytes."


def live_attitude(track: AttitudeTrack | None) -> str:
    """Last attitude of a track in words; empty where there is none."""
    if track is None:
        return ""
    yaw, pitch, roll = to_deg(euler_zyx_from_quat(track.q_nb[-1]))
    return f"roll {roll:.2f}°, pitch {pitch:.2f}°, yaw {yaw:.2f}°"


def live_joints(motion: Any) -> dict[str, dict[str, float]]:
    """Last joint angles of a chain, and how exactly they are known, by name."""
    return {name: {"deg": to_deg(angle), "sd_deg": to_deg(sd)} for name, angle, sd in motion.at_end()}


def run_report(watch: Watch) -> dict[str, Any]:
    """What a run gave, for JSON."""
    stream, last = watch.stream, watch.last
    session = stream.session
    by_kernel = session.source is not None and session.source.kind in KERNEL
    track = watch.track
    sources = {name: run_report(other) | other.stream.against(stream) for name, other in watch.beside.items()}
    return {
        "session": session.name,
        "format": session.form.name,
        "unchecked_bytes": session.form.framing.length if passes_anything(session.form) and not by_kernel else None,
        "device": session.meta.device,
        "calibration": last.imu.meta.calibration if last else session.card and session.card.name,
        "notes": as_json((*watch.beyond, *inferred(stream.time_report()), *stream.decoder.notes, *stream.rate_notes)),
        "filter": None if stream.filter is None else stream.filter.describe(),
        "sensors": list(last.imu.triads) if last else None,
        "frame": str(track.frame) if track is not None else session.frame and str(session.frame),
        "north": None if track is None else str(track.north),
        "declination_deg": None if track is None or stream.filter is None else declination_deg(stream.filter, track),
        "samples": watch.samples,
        "last": live_attitude(track),
        **({} if watch.motion is None else {"joints": live_joints(watch.motion)}),
        "duration_s": 0.0 if last is None else float(last.imu.t[-1]),
        **stream.report(),
        **({"units": [spec.unit for spec in session.units]} if session.units else {}),
        **({"sources": sources} if sources else {}),
    }


def report_lines(report: Mapping[str, Any], last: str) -> list[str]:
    """What a run gave, as text."""
    timing, counts = report["time"], report["bytes"]
    rate = "unknown" if timing["rate"] is None else f"{timing['rate']:.6g} Hz"
    lines = [
        f"samples      {report['samples']} in {report['duration_s']:.3f} s, rate {rate} by {timing['mode']}",
        f"bytes        {counts['received']}, of frames {counts['framed']}, junk {counts['junk']}",
    ]
    if report.get("units"):
        lines.append(f"units        {', '.join(report['units'])}: samples of each")
    if report["unchecked_bytes"]:
        lines.append(f"checks       {UNCHECKED.format(report['unchecked_bytes'])}")
    rejected = {k: counts[k] for k in ("bad_checksum", "bad_content", "bad_length", "unknown") if counts[k]}
    if rejected:
        words = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in rejected.items())
        lines.append(f"rejected     {words}")
    if timing["lost"] or timing["gap_count"] or report["not_usable"]:
        lost, gaps = counted(timing["lost"], "frame"), counted(timing["gap_count"], "gap")
        lines.append(f"lost         {lost} in {gaps}; {report['not_usable']} repeated or late")
    lines += [f"note         {note['text']}" for note in report["notes"]]
    long_enough = report["duration_s"] >= LONG  # before, jitter of the host passes for drift
    if long_enough and timing["drift_ppm"] is not None and timing["mode"] == "clock":
        lines.append(f"device clock {timing['drift_ppm']:+.1f} ppm against this host")
    if report.get("sensors") != []:
        lines.append(f"calibration  {calibration_told(report['calibration'])}")
    if report["filter"]:
        lines.append(f"filter       {report['filter']}")
    if report["north"]:
        zero = counted_from(report["north"], report["declination_deg"])
        lines += [f"frame        {report['frame']}, heading from {zero}", f"at the end   {last}"]
    if joints := report.get("joints"):
        said = (f"{name} {of['deg']:.2f}° ± {of['sd_deg']:.2f}°" for name, of in joints.items())
        lines.append(f"joints       {', '.join(said)}")
    for name, other in report.get("sources", {}).items():
        clock = f"its clock {other['clock_ppm']:+.1f} ppm, {other['clock_ahead_ms']:+.2f} ms at the end"
        lines += [f"source       {name}, {clock}", *(f"  {line}" for line in report_lines(other, other["last"]))]
    return lines
