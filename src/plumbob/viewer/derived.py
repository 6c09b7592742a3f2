"""What the server makes of the samples beside showing them: the Allan deviation so far, guided calibrations, lines.

Fits take tens of milliseconds, so all of it but the lines is done in one thread beside the loop, with parts of a tenth
of a second.
"""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError, ParameterError, PlumbobError, ShapeError, one_line
from plumbob.core.time import to_ns
from plumbob.core.units import to_deg, to_dps
from plumbob.data import TRIADS, ImuData, ImuMeta
from plumbob.live.rows import line_of
from plumbob.live.transports.polled import Schedule
from plumbob.viewer.hub import Hub
from plumbob.viewer.messages import AllanCurve, Command, Guidance, numbers
from plumbob.viewer.pipe import PipeMessage

if TYPE_CHECKING:
    from plumbob.live.guide.guide import Guide

EVERY_S: Final = 0.1  # Length of the parts that the thread gets, s
ALLAN_S: Final = 2.0  # Time between two curves, s
LINES_NS: Final = 50_000_000  # Time between two lines, ns
MOST: Final = 1_000_000  # Samples of a guided capture at most, which take 90 MB
CLOUD: Final = 400  # Directions that are shown at most

_LONGEST: Final = 2**21
_PER_DECADE: Final = 8
_LATE: Final = 50  # parts that may wait for the thread


Doing = Callable[[Command], str | Awaitable[str]]


class FedSamples(NamedTuple):
    """Samples as the feed hands them over: time, s, flags, and what the sensors said (N, 10)."""

    t: Floats
    flags: NDArray[np.uint32]
    sensed: Floats

    def first(self, count: int) -> "FedSamples":
        """So many of them."""
        return FedSamples(self.t[:count], self.flags[:count], self.sensed[:count])

    @classmethod
    def joined(cls, parts: Sequence["FedSamples"]) -> "FedSamples":
        """Parts that follow one another."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))


class Allan:
    """Overlapping Allan deviation of gyroscope and accelerometer since the start, a gap, or a reset.

    A sample that is missing makes all differences over it wrong, so the stream begins again behind it.
    """

    def __init__(self) -> None:
        self._stream: Any = None
        self._first = self._last = 0.0
        self._columns: list[int] = []

    def reset(self) -> None:
        """Begin again."""
        self._stream = None

    def take(self, part: FedSamples) -> None:
        """Take the next samples."""
        is_gap = (part.flags & np.uint32(flags.GAP)) != 0
        for first, stop in pairwise([0, *np.flatnonzero(is_gap).tolist(), len(part.t)]):
            if stop > first:
                if is_gap[first]:
                    self.reset()
                self._take(part.t[first:stop], part.sensed[first:stop, :6])

    def curve(self) -> AllanCurve | None:
        """What it is so far; None where too few samples came."""
        if self._stream is None or self._stream.count < 10:
            return None
        allan = self._stream.result()
        step = (self._last - self._first) / (allan.count - 1)
        names = [f"{TRIADS[column // 3]}.{'xyz'[column % 3]}" for column in self._columns]
        deviation: dict[str, Sequence[float | None]] = {
            name: numbers(to_dps(dev) if name.startswith("gyr") else dev)
            for name, dev in zip(names, allan.dev.T, strict=True)
        }
        return AllanCurve(duration=self._last - self._first, tau=(allan.n * step).tolist(), deviation=deviation)

    def _take(self, t: Floats, sensed: Floats) -> None:
        usable = np.isfinite(sensed)
        if self._stream is not None and not usable[:, self._columns].all():
            last = int(np.flatnonzero(~usable[:, self._columns].all(axis=1))[-1])
            t, sensed, usable = t[last + 1 :], sensed[last + 1 :], usable[last + 1 :]
            self.reset()
        if not len(t):
            return
        if self._stream is None:
            self._columns = np.flatnonzero(usable.all(axis=0)).tolist()
            if not self._columns:
                return
            from plumbob.noise.factors import log_factors, stream_factors
            from plumbob.noise.stream import AllanStream

            factors = stream_factors(log_factors(_LONGEST, per_decade=_PER_DECADE))
            self._stream, self._first = AllanStream(factors, channels=len(self._columns)), float(t[0])
        try:
            self._stream.feed(sensed[:, self._columns])
        except ShapeError:  # too large to be added
            self.reset()
        self._last = float(t[-1])


class CardTarget(NamedTuple):
    """What a calibration is of: the unit's name, its card so far, and where cards are written."""

    name: str
    card: str | None
    folder: Path


class Guided:
    """A guided calibration of `kind`: ``mag``, ``accel`` or ``gyro``."""

    def __init__(self, kind: str, unit: CardTarget) -> None:
        self.kind, self._unit = kind, unit
        self._meta = ImuMeta(device=unit.name, unit_check=False)  # the format said the units
        self._parts: list[FedSamples] = []
        self._count = 0
        self._cloud = _Cloud()

    @cached_property
    def _guide(self) -> "Guide":
        from plumbob.live.guide.guide import GUIDES

        return GUIDES[self.kind]()

    def take(self, part: FedSamples) -> Guidance:
        """Go on with the next samples, of which what is beyond `MOST` is left out."""
        part = part.first(MOST - self._count)
        if len(part.t):
            self._parts.append(part)
            self._count += len(part.t)
            at = 3 * TRIADS.index(self._guide.triad)
            self._cloud.take(part.sensed[:, at : at + 3])
            triads = {name: part.sensed[:, 3 * i : 3 * i + 3] for i, name in enumerate(TRIADS)}
            temp_c, t_ns = part.sensed[:, 9], to_ns(part.t)
            self._guide.feed(ImuData.live(t_ns, triads, temp_c=temp_c, flags=part.flags, meta=self._meta))
        return self.guidance()

    def guidance(self, *, card: str | None = None, refused: Sequence[str] = ()) -> Guidance:
        """How it stands."""
        warnings = ["the capture is full: end it"] if self._count >= MOST else []
        progress = self._guide.progress()
        cloud = [] if self.kind == "gyro" else self._cloud.directions(self._guide.centre)
        return Guidance(
            kind=self.kind,
            elapsed=progress.elapsed,
            still_for=progress.still_for,
            filled=None if progress.filled is None else progress.filled.tolist(),
            direction=progress.direction,
            goal=progress.goal,
            axis=None if progress.turn is None else progress.turn.axis,
            angle=None if progress.turn is None else float(to_deg(progress.turn.angle)),
            next_step=progress.next_step,
            predicted=progress.predicted,
            grade=progress.grade,
            share=progress.share,
            warnings=[*progress.warnings, *warnings],
            done=progress.done,
            cloud=cloud,
            card=card,
            refused=refused,
        )

    def end(self) -> Guidance:
        """Make the card, and write it."""
        from plumbob.calibration.fit import CaptureRefusedError

        try:
            return self.guidance(card=str(self._written()))
        except CaptureRefusedError as why:
            return self.guidance(refused=[f"{reason.kind}: {reason.text} {reason.advice}" for reason in why.reasons])
        except PlumbobError as why:
            return self.guidance(refused=[one_line(why)])

    def _written(self) -> Path:
        from plumbob.calibration.calibration import capture
        from plumbob.data.cards import CalibrationCard
        from plumbob.door.calibrate import KINDS, calibrate

        imu = self._joined_imu()
        base = None if self._unit.card is None else CalibrationCard.load(self._unit.card)
        calibration = calibrate(capture(imu, triads=KINDS[self.kind].triads, base=base), self.kind)
        letters = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "_" for c in calibration.card.device)
        path = self._unit.folder / f"{letters}-{self.kind}-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.card.json"
        calibration.save(path)
        return path

    def _joined_imu(self) -> ImuData:
        """All samples, judged as a recording."""
        if not self._parts:
            raise CalibrationError("no sample has arrived since the start, so there is nothing to calibrate.")
        t, words, sensed = FedSamples.joined(self._parts)
        columns: dict[str, Any] = {name: sensed[:, 3 * i : 3 * i + 3] for i, name in enumerate(TRIADS)}
        columns["temp_c"] = sensed[:, 9]
        measured = {name: values for name, values in columns.items() if np.isfinite(values).any()}
        if "temp_c" in measured and not np.isfinite(measured["temp_c"]).all():
            del measured["temp_c"]
        return ImuData(t=t, flags=words, meta=self._meta, **measured)


class _Cloud:
    """Some of the vectors of a capture, evenly in time: where they are too many, every other one goes."""

    def __init__(self) -> None:
        self._vectors = np.empty((0, 3))
        self._stride, self._offset = 1, 0

    def take(self, vectors: Floats) -> None:
        picked = vectors[self._offset :: self._stride]
        self._offset = (self._offset - len(vectors)) % self._stride
        self._vectors = np.concatenate((self._vectors, picked[np.isfinite(picked).all(axis=1)]))
        while len(self._vectors) > CLOUD:
            self._vectors, self._stride = self._vectors[::2], 2 * self._stride

    def directions(self, centre: Floats) -> list[list[float]]:
        """Unit vectors, as seen from a centre; three digits are enough to draw."""
        away = self._vectors - centre
        sizes = np.linalg.norm(away, axis=1)
        vectors: list[list[float]] = np.round(away[sizes > 0.0] / sizes[sizes > 0.0, np.newaxis], 3).tolist()
        return vectors


class Derived:
    """Hands samples to what is made of them, and its results to the clients."""

    def __init__(self, hub: Hub, folder: Path) -> None:
        self._hub, self._folder = hub, folder
        self._allan = Allan()
        self._guided: Guided | None = None
        self._thread = ThreadPoolExecutor(1, "derived")
        self._waiting: list[FedSamples] = []
        self._since = self._curve_at = 0.0
        self._late = 0
        self._failed = False
        self._lines = Schedule(LINES_NS)
        hub.listeners.add(self._listen)

    @property
    def commands(self) -> Mapping[str, Doing]:
        """What it does when it is asked to."""
        return {
            "calibrate": self._begin,
            "calibrate-end": self._end,
            "calibrate-cancel": self._cancel,
            "allan-reset": self._reset,
        }

    def close(self) -> None:
        """End the thread after what it is at."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _listen(self, message: PipeMessage) -> None:
        if self._failed:
            return
        if message.kind == "reset":
            self._flush()
            self._do(self._allan.reset)
            if self._guided is not None:
                self._hub.tell("view", self._cancel(None))
            self._lines = Schedule(LINES_NS)
        elif message.kind == "batch" and self._hub.has_rows(message):
            arrays = message.arrays
            self._write_lines(arrays["t"], arrays["flags"], arrays["values"])
            self._waiting.append(FedSamples(arrays["t"], arrays["flags"], arrays["sensed"]))
            now = asyncio.get_running_loop().time()
            if now - self._since >= EVERY_S:
                self._since = now
                self._flush()
                self._draw(now)

    def _flush(self) -> None:
        """Hand what waits to the thread; where that is too slow, something is lost, and the curve begins again."""
        parts, self._waiting = self._waiting, []
        if not parts:
            return
        if self._late > _LATE:
            self._do(self._allan.reset)
            return
        part, guided = FedSamples.joined(parts), self._guided
        self._late += 1
        self._do(lambda: self._take(part, guided), lambda guidance: self._taken(guided, guidance))

    def _take(self, part: FedSamples, guided: Guided | None) -> Guidance | None:
        self._allan.take(part)
        return None if guided is None else guided.take(part)

    def _taken(self, guided: Guided | None, guidance: Guidance | None) -> None:
        self._late -= 1
        if guidance is not None and self._guided is guided:
            self._hub.supersede("guide", asdict(guidance))

    def _draw(self, now: float) -> None:
        if now - self._curve_at < ALLAN_S or not self._hub.clients:
            return
        self._curve_at = now
        self._do(self._allan.curve, lambda curve: self._hub.supersede("allan", curve and asdict(curve)))

    def _do(self, action: Callable[[], Any], then: Callable[[Any], None] | None = None) -> None:
        """Do something in the thread, in order, and something with its result in the loop."""
        future = asyncio.get_running_loop().run_in_executor(self._thread, action)
        future.add_done_callback(lambda done: None if done.cancelled() else self._done(done, then))

    def _done(self, done: "asyncio.Future[Any]", then: Callable[[Any], None] | None) -> None:
        error = done.exception()
        if error is not None:
            self._failed = True  # the view goes on without it
            self._forget()
            self._hub.tell("view", f"Allan deviation and guidance have ended by a fault: {one_line(error)}.")
        elif then is not None:
            then(done.result())

    def _begin(self, command: Command) -> str:
        kinds = (self._hub.hello or {}).get("guides", ())
        if command.name not in kinds:
            raise ParameterError(f"'{command.name}' cannot be calibrated here; known: {', '.join(kinds) or 'none'}.")
        if self._guided is not None:
            raise ParameterError(f"{self._guided.kind} is being calibrated. End that first.")
        self._flush()
        self._guided = guided = Guided(command.name, self._unit(command.text))
        self._hub.guide = command.name
        self._late += 1
        self._do(guided.guidance, lambda guidance: self._taken(guided, guidance))
        return f"Calibration of {command.name} has begun."

    def _unit(self, named: str) -> CardTarget:
        """The unit: a device that is called like its format was not named."""
        hello = self._hub.hello or {}
        device = hello.get("device", "")
        default = ImuMeta().device if device == hello.get("format") else device
        return CardTarget(named or default, hello.get("card"), self._folder)

    async def _end(self, _command: Command) -> str:
        guided = self._required()
        self._flush()
        self._forget()
        guidance = await asyncio.get_running_loop().run_in_executor(self._thread, guided.end)
        self._hub.supersede("guide", asdict(guidance))
        if guidance.card is None:
            raise CalibrationError(" ".join(guidance.refused))
        return f"The card is {guidance.card}."

    def _cancel(self, _command: Command | None) -> str:
        kind = self._required().kind
        self._forget()
        self._hub.supersede("guide", None)
        return f"Calibration of {kind} is given up."

    def _required(self) -> Guided:
        if self._guided is None:
            raise ParameterError("Nothing is being calibrated.")
        return self._guided

    def _forget(self) -> None:
        self._guided = self._hub.guide = None

    def _reset(self, _command: Command) -> str:
        self._flush()
        self._do(self._allan.reset)
        self._hub.supersede("allan", None)
        return "The Allan deviation begins again."

    def _write_lines(self, t: Floats, words: NDArray[np.uint32], values: Floats) -> None:
        """Lines of the primary estimator's angles where they are due."""
        due = [i for i, t_ns in enumerate(to_ns(t).tolist()) if self._lines.due(t_ns)]
        columns = self._hub.places(self._hub.primary, ("roll", "pitch", "yaw"))
        if not due or columns is None:
            return
        angles = values[np.ix_(due, columns)].tolist()
        lines = [
            line_of(at, (roll, pitch, math.remainder(yaw, 360.0)), word)
            for at, (roll, pitch, yaw), word in zip(t[due].tolist(), angles, words[due].tolist(), strict=True)
            if math.isfinite(roll)
        ]
        for line in lines:
            self._hub.lines.add(line)  # the tick that follows wakes the clients
