"""Send an attitude to other programs: of a file, `plumbob.send`; live, a sink beside the recording."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from shlex import quote
from typing import Any, Final, Protocol

import numpy as np

from plumbob.acquisition.outgoing import FileTarget, Sender, Target, TcpServer, parse_target, refused
from plumbob.acquisition.transport import Event, Stopping
from plumbob.core import check
from plumbob.core.errors import LineError, ParameterError, ShapeError
from plumbob.core.files import require_other
from plumbob.core.flags import GAP, GYR_HELD, TIME_FAULT
from plumbob.core.text import Shown, counted
from plumbob.core.time import to_ns
from plumbob.core.units import Quantity, given
from plumbob.data import AttitudeTrack, ImuData
from plumbob.files import Recording
from plumbob.protocols.attitude import Attitude, Body, attitudes, body_of
from plumbob.rotations import North
from plumbob.session.recording_sink import epoch_offset_ns
from plumbob.session.send_spec import parse_send, send_spec
from plumbob.session.session import SendSpec, Session
from plumbob.session.stream import Part
from plumbob.session.watch import Note

_CARRIED: Final = GAP | TIME_FAULT | GYR_HELD
"""Flags of attitudes that are left out which the next one carries."""
_PATIENCE: Final = 10.0
_BURST: Final = 0.5
_BEHIND: Final = 0.5
_PAUSE: Final = 0.05
_OVERTURNED: Final = 0.5 * math.pi


class Encoder(Protocol):
    """Makes bytes of attitudes."""

    def encode(self, a: Attitude) -> bytes | None:
        """Bytes of an attitude; None where nothing is to be sent of it."""
        ...

    def finish(self) -> bytes:
        """Bytes behind the last attitude."""
        ...


@dataclass(frozen=True, slots=True)
class _Each:
    """Encoder without a state."""

    of: Callable[[Attitude], bytes | None]

    def encode(self, a: Attitude) -> bytes | None:
        return self.of(a)

    def finish(self) -> bytes:
        return b""


def encoder_of(spec: SendSpec, north: North, declination: float | None) -> Encoder:
    """Encoder of what is asked for; heavy ones are imported here.

    Raises
    ------
    FrameError
        If a heading is asked for that the attitude does not have.
    MissingExtraError
        If it needs a package that is not installed.
    """
    if spec.kind == "nmea":
        from plumbob.protocols.attitude.nmea import SENTENCES, sentences_for

        makers = [SENTENCES[name] for name in sentences_for(spec.sentences, north, declination)]
        return _Each(lambda a: b"".join(make(a) for make in makers))
    if spec.kind == "tss1":
        from plumbob.protocols.attitude import tss1

        return _Each(partial(tss1.line, heave=None))
    if spec.kind == "json":
        from plumbob.protocols.attitude import json_lines

        return _Each(json_lines.line)
    if spec.kind == "mavlink":
        from plumbob.protocols.attitude.mavlink import Mavlink

        return Mavlink()
    from plumbob.protocols.attitude.ros2 import Imus

    return Imus()


class Due:
    """Chooses attitudes at most as fast as asked, by their own times; flags of those left out go with the next."""

    def __init__(self, rate: float | None) -> None:
        self._period_ns = 0 if rate is None else round(1e9 / rate)
        self._next_ns: int | None = None
        self._before_ns: int | None = None
        self._carried = 0

    def rows(self, t_ns: Sequence[int], words: Sequence[int]) -> tuple[list[int], list[int]]:
        """Rows that are due, and the flags that each carries from those before it."""
        rows, more = [], []
        for i, (t, word) in enumerate(zip(t_ns, words, strict=True)):
            step = 0 if self._before_ns is None else t - self._before_ns
            self._before_ns = t
            early = min(step // 2, self._period_ns // 4)  # the nearest sample, also where their times jitter
            if self._next_ns is not None and t < self._next_ns - early:
                self._carried |= word & _CARRIED
                continue
            behind = self._next_ns is None or t - self._next_ns > self._period_ns
            self._next_ns = (t if behind or self._next_ns is None else self._next_ns) + self._period_ns
            rows.append(i)
            more.append(self._carried)
            self._carried = 0
        return rows, more


class Direct:
    """Writes messages to a target at once, and waits for it: nothing is dropped, and a target that broke is an error.

    Raises
    ------
    LineError
        If it cannot be opened, or written.
    """

    def __init__(self, target: Target, name: str) -> None:
        self._target, self._name = target, name
        self.sent = self.dropped = 0
        try:
            target.open()
        except OSError as error:
            raise refused(name, error) from error

    def put(self, data: bytes) -> None:
        """Write a message."""
        try:
            dropped = self._target.write(data, _PATIENCE)
        except BrokenPipeError:
            if self._name == "-":
                raise  # the reader of standard output went away; that is its right
            raise LineError(f"{self._name} cannot be written: nobody reads it any more.") from None
        except OSError as error:
            if isinstance(self._target, FileTarget):
                self._target.discard()
            raise refused(self._name, error) from error
        if dropped and not isinstance(self._target, TcpServer):
            raise LineError(f"{self._name} has taken nothing for {_PATIENCE:.0f} s.")
        self.dropped += dropped
        self.sent += 1

    def tend(self) -> None:
        """Let clients in, and write what waits for them."""
        self._target.tend()

    def take_events(self) -> list[Event]:
        """Nothing happens behind the back of who writes directly."""
        return []

    def close(self) -> None:
        """Let go of the target."""
        self._target.close()


class SendSink:
    """Sends attitudes of a stream as they come; it never waits, and a target that is away costs the recording nothing.

    Parameters
    ----------
    spec : SendSpec
        What and where to.
    declination : float or None
        rad, east positive.
    offset_ns : int
        UTC minus the clock of the stream, ns.
    note : callable, optional
        Called with each remark.
    keep : callable, optional
        Called with each event, such as the recording.
    direct : bool
        Whether to write at once and wait, as a replay may.
    """

    def __init__(
        self,
        spec: SendSpec,
        *,
        declination: float | None,
        offset_ns: int,
        note: Note | None = None,
        keep: Callable[[Event], object] | None = None,
        direct: bool = False,
    ) -> None:
        self._spec, self._declination, self._offset_ns = spec, declination, offset_ns
        self._note, self._keep = note or (lambda line: None), keep
        target = parse_target(spec.to)
        self._paced = not direct
        self._sender: Sender | Direct = Direct(target, spec.to) if direct else Sender(target, spec.to)
        self._encoder: Encoder | None = None
        self._due, self._before = Due(spec.rate), deque[AttitudeTrack](maxlen=1)
        self._allowance, self._looked = self._most, time.monotonic()
        self.withheld = 0

    def __str__(self) -> str:
        return f"sending to {self._spec.to}"

    @property
    def sent(self) -> int:
        """Messages that the target took."""
        return self._sender.sent

    @property
    def dropped(self) -> int:
        """Messages that it did not."""
        return self._sender.dropped

    @property
    def _most(self) -> float:
        """Messages that may go at once, after a wait."""
        return max(1.0, _BURST * (self._spec.rate or 0.0))

    def on_part(self, part: Part) -> None:
        """Send what is due."""
        self._tell()
        track = part.track
        if track is None or not len(track):
            return
        if self._encoder is None:
            self._encoder = encoder_of(self._spec, track.north, self._declination)
            for line in remarks(self._spec, track.north):
                self._note(line)
        joined = AttitudeTrack.joined([*self._before, track], len(track) + len(self._before))
        first = len(joined) - len(track)
        words = np.zeros(len(track), dtype=np.uint32) if track.flags is None else track.flags
        rows, more = self._due.rows(part.track_ns.tolist(), words.tolist())
        kept = rows[len(rows) - self._granted(len(rows)) :] if rows else []
        self.withheld += len(rows) - len(kept)
        t0_ns = int(part.track_ns[0]) - int(to_ns(track.t[:1])[0]) + self._offset_ns
        for a in attitudes(
            joined, [row + first for row in kept], t0_ns=t0_ns, utc=True, body=_body(self._spec),
            declination=self._declination, imu=part.imu, more=more[len(rows) - len(kept) :],
        ):  # fmt: skip
            if (data := self._encoder.encode(a)) is not None:
                self._sender.put(data)
        self._before.append(track.end)

    def _granted(self, wanted: int) -> int:
        """How many of these may go now: a stream that comes in a burst after a stall is not sent in one."""
        if not self._paced or self._spec.rate is None:
            return wanted
        now = time.monotonic()
        self._allowance = min(self._most, self._allowance + (now - self._looked) * self._spec.rate)
        self._looked = now
        granted = min(wanted, int(self._allowance))
        self._allowance -= granted
        return granted

    def on_event(self, event: Event) -> None:
        """Nothing is sent of it."""
        self._tell()

    def _tell(self) -> None:
        for event in self._sender.take_events():
            self._note(event.text)
            if self._keep is not None:
                self._keep(event)

    def close(self) -> None:
        """Send what waits, and end."""
        if self._encoder is not None and (rest := self._encoder.finish()):
            self._sender.put(rest)
        self._encoder = None
        self._sender.close()
        self._keep = None  # the recording has ended before its sinks, and takes no more rows
        self._tell()
        if self.withheld:
            self._note(
                f"{self._spec.to}: {counted(self.withheld, 'attitude')} not sent, which came faster than live, as"
                " after a stall or from a file; plumbob send sends all of a recording"
            )


def with_sent(session: Session, send: Sequence[str]) -> Session:
    """Session that sends there, too.

    Raises
    ------
    ParameterError
        If nothing estimates an attitude, or a text is not as `parse_send` takes it.
    """
    if not send:
        return session
    if session.stage is None:
        raise ParameterError("--send sends an attitude, and nothing estimates one. Name a filter with --filter.")
    return replace(session, send=(*session.send, *map(parse_send, send)))


def sending_of(
    session: Session,
    *,
    note: Note | None = None,
    keep: Callable[[Event], object] | None = None,
    replayed_ns: int | None = None,
) -> list[SendSink]:
    """Sinks of what a session sends: while its line runs, or again, with UTC less the clock of its recording, ns."""
    offset_ns = epoch_offset_ns() if replayed_ns is None else replayed_ns
    how: dict[str, Any] = {"declination": session.meta.declination, "offset_ns": offset_ns, "note": note, "keep": keep}
    return [SendSink(spec, **how, direct=replayed_ns is not None) for spec in session.send]


def _body(spec: SendSpec) -> Body | None:
    return None if spec.body is None else Body.parse(spec.body)


def remarks(spec: SendSpec, north: North) -> Iterator[str]:
    """What a reader of the messages should know."""
    if spec.kind == "tss1":
        yield "TSS1: the heave is not estimated; its digits are 0, and the status is u, not settled"
    if north is North.FREE:
        yield "the heading counts from an arbitrary zero: no sentence carries it, and yaw of MAVLink and ROS drifts"


def overturned(track: AttitudeTrack, body: Body | None) -> str | None:
    """Warning where most attitudes would be sent upside down, as with the wrong body axes."""
    known = track.known
    if not known.any():
        return None
    axes = body_of(track.frame) if body is None else body
    rows = np.flatnonzero(known)[:: max(1, int(known.sum()) // 1000)].tolist()
    rolls = [abs(math.remainder(a.angles[0], 2 * math.pi)) for a in
             attitudes(track, rows, t0_ns=0, utc=False, body=axes) if a.angles]  # fmt: skip
    if not rolls or float(np.median(rolls)) <= _OVERTURNED:
        return None
    other = Body.FLU if axes is Body.FRD else Body.FRD
    return (
        f"most attitudes are upside down with body axes {axes}; where the body's axes are {other}, say body='{other}' "
        f"(--body {other})."
    )


@dataclass(frozen=True, eq=False, repr=False)
class Sent(Shown):
    """What was sent.

    Attributes
    ----------
    name : str
        Of what.
    spec : SendSpec
        In which form, and where to.
    attitudes, messages, withheld, dropped : int
        Attitudes that were due; writes that the target took; attitudes of which nothing was sent, because they are not
        reliable and the form cannot say so; messages that slow clients lost.
    seconds : float
        How long it took.
    """

    name: str
    spec: SendSpec
    attitudes: int
    messages: int
    withheld: int
    dropped: int
    seconds: float

    def facts(self) -> Mapping[str, str]:
        """All of it, in words."""
        return {
            "sent": f"{self.name} as {self.spec.kind} to {self.spec.to}",
            "attitudes": f"{self.attitudes}, {self.withheld} of them withheld as not reliable",
            "messages": f"{self.messages}, {self.dropped} lost by slow clients",
            "time": f"{self.seconds:.1f} s",
        }

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        names = ("attitudes", "messages", "withheld", "dropped", "seconds")
        told = {"source": self.name, "as": self.spec.kind, "to": self.spec.to}
        return told | {name: getattr(self, name) for name in names}

    def text(self) -> str:
        """A line for each fact."""
        return "\n".join(f"{name:<12} {value}" for name, value in self.facts().items())


def send(
    source: "str | Path | Recording | AttitudeTrack",
    form: str,
    to: str,
    *,
    rate: float | str | None = None,
    speed: float | str = 1.0,
    sentences: str | Sequence[str] = (),
    body: Body | str | None = None,
    declination: float | str | None = None,
    overwrite: bool = False,
    stop: Stopping | None = None,
    note: Note | None = None,
    opened: Callable[[Target], object] | None = None,
) -> Sent:
    """Send the attitude of a file to another program, as fast as it was recorded.

    Parameters
    ----------
    source : path, Recording or AttitudeTrack
        A track, a recording with an attitude, or a recording of `plumbob record` (``.mcap``).
    form : {"nmea", "tss1", "mavlink", "json", "ros2"}
        Form of the messages.
    to : str
        ``udp:HOST:PORT``, ``udp-broadcast:HOST:PORT``, ``tcp:HOST:PORT``, ``tcp-listen:[HOST:]PORT``,
        ``serial:DEVICE@BAUD``, ``file:PATH``, or ``-`` for standard output.
    rate : float or str, optional
        Attitudes per second at most, Hz, by their own times; by default all.
    speed : float or str
        How many times as fast as it was; ``"max"``: as fast as it goes.
    sentences : str or sequence of str, optional
        NMEA sentences: HDT, HDG, HDM, PASHR, XDR, ROT; by default all that the heading allows.
    body : {"FRD", "FLU"}, optional
        Body axes of the attitude; by default FRD in NED, and FLU in ENU and NWU.
    declination : float or str, optional
        rad or text with a unit, east positive; by default the recording's own.
    overwrite : bool
        Whether to replace a file.
    stop : Stopping, optional
        Set from another thread to end.
    note : callable, optional
        Called with each remark.
    opened : callable, optional
        Called with the target once it is open.

    Returns
    -------
    Sent

    Raises
    ------
    ParameterError
        If form, target or sentences do not exist or do not go together, or a file exists.
    FrameError
        If a heading is asked for that the attitude does not have.
    ShapeError
        If the source has no attitude.
    LineError
        If the target cannot be opened, or breaks.
    """
    spec = send_spec(form, to, rate=rate, sentences=sentences, body=body)
    pace = _pace(speed)
    name, track, imu, t0_ns = _held(source)
    if to.startswith("file:") and isinstance(source, str | Path):
        require_other(Path(to.removeprefix("file:")), [Path(source)])
    angle = given("declination", declination, Quantity.ANGLE)
    angle = imu.meta.declination if angle is None and imu is not None else angle
    encoder = encoder_of(spec, track.north, angle)
    say = note or (lambda line: None)
    for line in filter(None, (*remarks(spec, track.north), overturned(track, _body(spec)))):
        say(line)
    words = [0] * len(track) if track.flags is None else track.flags.tolist()
    rows, more = Due(spec.rate).rows(to_ns(track.t).tolist(), words)
    target = parse_target(to, overwrite=overwrite)
    direct, began, withheld = Direct(target, to), time.monotonic(), 0
    try:
        if opened is not None:
            opened(target)
        _await_client(target, say, stop)
        clock = _Pace(pace, stop, direct.tend)
        for a in attitudes(
            track, rows, t0_ns=t0_ns, utc=t0_ns > 0, body=_body(spec), declination=angle, imu=imu, more=more
        ):
            if not clock.wait(a.elapsed_ns):
                break
            data = encoder.encode(a)
            withheld += data is None or (spec.kind == "mavlink" and not a.reliable)
            if data is not None:
                direct.put(data)
        if rest := encoder.finish():
            direct.put(rest)
    finally:
        direct.close()
    return Sent(name, spec, len(rows), direct.sent, withheld, direct.dropped, time.monotonic() - began)


def _pace(speed: float | str) -> float:
    if speed == "max":
        return math.inf
    try:
        found = float(speed)
    except (TypeError, ValueError):
        found = math.nan
    if not found > 0.0:
        raise ParameterError(f"speed must be a number above 0, or 'max', but it is {speed!r}.")
    return found


def _held(source: "str | Path | Recording | AttitudeTrack") -> tuple[str, AttitudeTrack, ImuData | None, int]:
    """What messages call it, its attitude, its samples, and the UTC of its zero; 0 where that is not known."""
    from plumbob.session.reading import is_own, read_one

    if isinstance(source, AttitudeTrack):
        return "the track", source, None, 0
    if isinstance(source, Recording):
        found, name = source.of_unit(None), source.name or "the recording"
    else:
        file = check.path("source", source)
        if is_own(file) and (replayed := _replayed(file)) is not None:
            return replayed
        found, name = read_one(file), str(file)
    if found.track is None:
        raise ShapeError(
            f"{name} holds samples but no attitude. Estimate it first: plumbob run {quote(name)} --filter mekf --out "
            "track.parquet."
        )
    return name, found.track, found.imu, 0 if found.imu is None else found.imu.meta.t0_ns


def _replayed(file: Path) -> tuple[str, AttitudeTrack, ImuData | None, int] | None:
    """Attitude of a recorded stream with the covariance that its filter claims; None where it holds only rows."""
    from plumbob.files.mcap import open_log
    from plumbob.session.replay import replay
    from plumbob.session.session_toml import SESSION

    if SESSION not in open_log(file).metadata:
        return None
    found = replay(file, covariance=True)
    if found.track is None:
        return None
    return str(file), found.track, found.imu, found.t0_ns


def _await_client(target: Target, say: Note, stop: Stopping | None) -> None:
    if not isinstance(target, TcpServer):
        return
    say(f"waiting for the first client at {target.host}:{target.port}")
    while not target.clients and not (stop and stop.is_set()):
        target.tend()
        time.sleep(_PAUSE)


class _Pace:
    """Waits for the time of each attitude; who comes late does not hurry after."""

    def __init__(self, speed: float, stop: Stopping | None, tend: Callable[[], None]) -> None:
        self._speed, self._stop, self._tend = speed, stop, tend
        self._zero: float | None = None

    def wait(self, t_ns: int) -> bool:
        """Wait for it; False where it is time to end."""
        if self._speed < math.inf:
            due = t_ns / 1e9 / self._speed
            now = time.monotonic()
            if self._zero is None or now - (self._zero + due) > _BEHIND:
                self._zero = now - due
            while (left := self._zero + due - time.monotonic()) > 0.0 and not self._stopped:
                self._tend()
                time.sleep(min(left, _PAUSE))
        return not self._stopped

    @property
    def _stopped(self) -> bool:
        return self._stop is not None and self._stop.is_set()
