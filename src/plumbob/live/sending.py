"""Send an attitude to other programs: of a file, `plumbob.send`; live, a sink beside the recording."""

import json
import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any, Final, Protocol

import numpy as np

from plumbob.core.errors import LineError
from plumbob.core.event import Event
from plumbob.core.flags import GAP, GYR_HELD, TIME_FAULT, names
from plumbob.core.text import counted
from plumbob.core.time import to_ns
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack
from plumbob.live.runner import Note
from plumbob.live.session import SendSpec, Session, parse_send, require_sent, sends_joints
from plumbob.live.sinks import Sink, epoch_offset_ns
from plumbob.live.stream import ItemResult
from plumbob.live.transports.outgoing import FileTarget, Sender, Target, TcpServer, parse_target, refused
from plumbob.protocols.attitude import AttitudeSample, BodyAxes, attitudes, default_body
from plumbob.rotations import North

_CARRIED: Final = GAP | TIME_FAULT | GYR_HELD  # flags of attitudes that are left out which the next one carries
_PATIENCE: Final = 10.0
_BURST: Final = 0.5
_OVERTURNED: Final = 0.5 * math.pi


class Encoder(Protocol):
    """Makes bytes of attitudes."""

    def encode(self, a: AttitudeSample) -> bytes | None:
        """Bytes of an attitude; None where nothing is to be sent of it."""

    def finish(self) -> bytes:
        """Bytes behind the last attitude."""


@dataclass(frozen=True, slots=True)
class _Each:
    """Encoder without a state."""

    of: Callable[[AttitudeSample], bytes | None]

    def encode(self, a: AttitudeSample) -> bytes | None:
        return self.of(a)

    def finish(self) -> bytes:
        return b""


def make_encoder(spec: SendSpec, north: North, declination: float | None) -> Encoder:
    """Encoder of what is asked for; heavy ones are imported here."""
    if spec.kind == "nmea":
        from plumbob.protocols.attitude.lines import SENTENCES, sentences_for

        makers = [SENTENCES[name] for name in sentences_for(spec.sentences, north, declination)]
        return _Each(lambda a: b"".join(make(a) for make in makers))
    if spec.kind == "tss1":
        from plumbob.protocols.attitude.lines import tss1

        return _Each(partial(tss1, heave=None))
    if spec.kind == "json":
        from plumbob.protocols.attitude.lines import json_line

        return _Each(json_line)
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
    """Writes messages to a target at once, and waits: nothing is dropped, and a target that broke is an error."""

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
            raise LineError(f"{self._name} cannot be written: the receiver has closed it.") from None
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


class SendSink(Sink):
    """Sends attitudes of a stream as they come; it never waits, and a target that is away costs the recording nothing.

    `offset_ns` is UTC minus the clock of the stream; `keep` gets each event; `direct` writes at once and waits, as a
    replay may.
    """

    def __init__(
        self, spec: SendSpec, *, declination: float | None, offset_ns: int, note: Note | None = None,
        keep: Callable[[Event], object] | None = None, direct: bool = False, joints: bool = False,
    ) -> None:  # fmt: skip
        self._spec, self._declination, self._offset_ns = spec, declination, offset_ns
        self._joints = joints
        self.source = spec.of
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

    def summary(self) -> dict[str, Any]:
        """What became of the messages, for JSON."""
        return {"as": self._spec.kind, "to": self._spec.to, "sent": self._sender.sent, "dropped": self._sender.dropped}

    @property
    def _most(self) -> float:
        """Messages that may go at once, after a wait."""
        return max(1.0, _BURST * (self._spec.rate or 0.0))

    def on_part(self, part: ItemResult) -> None:
        """Send what is due."""
        self._tell()
        if self._joints:
            self._send_joints(part)
            return
        track = part.track
        if track is None or not len(track):
            return
        if self._encoder is None:
            self._encoder = make_encoder(self._spec, track.north, self._declination)
            for line in remarks(self._spec, track.north):
                self._note(line)
        joined = AttitudeTrack.joined([*self._before, track], len(track) + len(self._before))
        first = len(joined) - len(track)
        words = np.zeros(len(track), dtype=np.uint32) if track.flags is None else track.flags
        rows, more = self._due.rows(part.track_ns.tolist(), words.tolist())
        granted = self._granted(rows)
        t0_ns = int(part.track_ns[0]) - int(to_ns(track.t[:1])[0]) + self._offset_ns
        for a in attitudes(
            joined, [row + first for row in granted], t0_ns=t0_ns, utc=True, body=asked_body(self._spec),
            declination=self._declination, imu=part.imu, more=more[len(rows) - len(granted) :],
        ):  # fmt: skip
            if (data := self._encoder.encode(a)) is not None:
                self._sender.put(data)
        self._before.append(track.end)

    def _send_joints(self, part: ItemResult) -> None:
        """Send joint angles that are due, each with its standard deviation."""
        if part.motion is None:
            return
        joints = part.motion.joints
        for row in self._granted(self._due.rows(part.motion_ns.tolist(), joints.flags.tolist())[0]):
            values = {
                "t_s": float(joints.t[row]),
                "utc": datetime.fromtimestamp((int(part.motion_ns[row]) + self._offset_ns) / 1e9, UTC).isoformat(),
                "joints_deg": dict(zip(joints.names, to_deg(joints.angles[row]).tolist(), strict=True)),
                "sigma_deg": dict(zip(joints.names, to_deg(joints.sd[row]).tolist(), strict=True)),
                "hand_m": joints.hand[row].tolist(),
                "flags": list(names(int(joints.flags[row]))),
            }
            self._sender.put((json.dumps(values, separators=(",", ":")) + "\n").encode())

    def _granted(self, rows: list[int]) -> list[int]:
        """Which of these may go now: a stream that comes in a burst after a stall is not sent in one."""
        if not self._paced or self._spec.rate is None:
            return rows
        now = time.monotonic()
        self._allowance = min(self._most, self._allowance + (now - self._looked) * self._spec.rate)
        self._looked = now
        granted = min(len(rows), int(self._allowance))
        self._allowance -= granted
        self.withheld += len(rows) - granted
        return rows[len(rows) - granted :]

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
    """Session that sends there, too."""
    chosen = replace(session, send=(*session.send, *map(parse_send, send)))
    declination = session.meta.declination
    best = North.MAGNETIC if declination is None else North.TRUE  # what a heading may count from, at best
    for spec in chosen.send:
        parse_target(spec.to, overwrite=True).require()
        require_sent(chosen, spec)
        if spec.kind == "nmea":
            from plumbob.protocols.attitude.lines import sentences_for

            sentences_for(spec.sentences, session.meta.north or best, declination)
    return chosen


def send_sinks(
    session: Session, *, note: Note | None = None, keep: Callable[[Event], object] | None = None,
    replayed_ns: int | None = None,
) -> list[SendSink]:  # fmt: skip
    """Sinks of what a session sends: while its line runs, or again, with UTC less the clock of its recording, ns."""
    offset_ns = epoch_offset_ns() if replayed_ns is None else replayed_ns
    how: dict[str, Any] = {"declination": session.meta.declination, "offset_ns": offset_ns, "note": note, "keep": keep}
    how |= {"direct": replayed_ns is not None}
    return [SendSink(spec, **how, joints=sends_joints(session, spec)) for spec in session.send]


def asked_body(spec: SendSpec) -> BodyAxes | None:
    """Body axes that a specification asks for; None where it does not."""
    return None if spec.body is None else BodyAxes.parse(spec.body)


def remarks(spec: SendSpec, north: North) -> Iterator[str]:
    """What a reader of the messages should know."""
    if spec.kind == "tss1":
        yield "TSS1: the heave is not estimated; its digits are 0, and the status is u, not settled"
    if north is North.FREE:
        yield "the heading counts from an arbitrary zero: no sentence carries it, and yaw of MAVLink and ROS drifts"


def overturned(track: AttitudeTrack, body: BodyAxes | None) -> str | None:
    """Warning where most attitudes would be sent upside down, as with the wrong body axes."""
    mask = track.known
    if not mask.any():
        return None
    axes = default_body(track.frame) if body is None else body
    rows = np.flatnonzero(mask)[:: max(1, int(mask.sum()) // 1000)].tolist()
    rolls = [abs(math.remainder(a.angles[0], 2 * math.pi)) for a in
             attitudes(track, rows, t0_ns=0, utc=False, body=axes) if a.angles]  # fmt: skip
    if not rolls or float(np.median(rolls)) <= _OVERTURNED:
        return None
    other = BodyAxes.FLU if axes is BodyAxes.FRD else BodyAxes.FRD
    return (
        f"most attitudes are upside down with body axes {axes}; where the body's axes are {other}, say body='{other}' "
        f"(--body {other})."
    )
