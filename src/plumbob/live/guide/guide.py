"""Guided capture: what has been seen so far, what to do next, and when it is enough.

A guide takes a stream in parts and goes over it block by block, so that it does not matter how the stream was cut. It
judges with what the fits judge with, and promises nothing: the calibration is that of the fit of the whole capture.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration import ellipsoid_fit
from plumbob.calibration.autocorrelation import alike
from plumbob.calibration.fit import HEADING, SCALE, TILT, CaptureRefusedError, grade_of
from plumbob.calibration.gyr.hand import SMALLEST
from plumbob.calibration.gyr.rest import Rates
from plumbob.calibration.gyr.stops import StopTurn, fit_stops, turns_between
from plumbob.calibration.mag.checks import DIP
from plumbob.calibration.mag.field_gradient import one_axis, unevenness
from plumbob.calibration.predicted import NAMES, REGIONS, filled, heading_sd, region_index, region_names, tilt_sd
from plumbob.core.check import Floats, runs
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, to_deg
from plumbob.data import TRIAD_FLAGS, TRIADS, ImuData
from plumbob.live.sinks import Sink
from plumbob.live.stream import ItemResult
from plumbob.live.transports.transport import Stop
from plumbob.quality.static_periods import BLOCK, FEWEST, BlockMoments, at_rest

_COLUMNS: Final = 1 + 3 * len(TRIADS) + len(TRIADS)


class Block(NamedTuple):
    """Samples of a block."""

    t: Floats  # (N,), time, s
    triads: dict[str, Floats]  # (N, 3), every triad; NaN where a sample is absent or invalid
    clipped: dict[str, NDArray[np.bool_]]  # (N,), samples at the end of the triad's range


class BlockCutter:
    """Cuts parts of a recording in blocks: each ends with the first sample that is `BLOCK` later than its first."""

    def __init__(self) -> None:
        self._pending = np.empty((0, _COLUMNS))

    def feed(self, part: ImuData) -> Iterator[Block]:
        """Take a part, and yield the blocks that it completes; what is left waits for the next."""
        clipped = [(part.flags & np.uint32(TRIAD_FLAGS[name][1])) != 0 for name in TRIADS]
        part_rows = np.column_stack((part.t, *(part.usable(name) for name in TRIADS), *clipped))
        rows = np.concatenate((self._pending, part_rows))
        first = 0
        while first < len(rows):
            stop = max(int(np.searchsorted(rows[:, 0], rows[first, 0] + BLOCK)), first + FEWEST)
            if stop >= len(rows):
                break
            yield _block(rows[first:stop])
            first = stop
        self._pending = rows[first:]


class RestDetector:
    """Say for every block of a stream whether the unit was at rest in it, by the rule of `still`.

    A mean or scatter over a NaN is NaN, and such a block is not at rest.

    All blocks are judged again with each, since quiet is relative to the rest; an hour of them takes 1.6 MB.
    """

    def __init__(self) -> None:
        self._told = np.empty((64, 14))
        self._count = 0
        self._runs: list[tuple[int, int]] = []
        self._has = {"acc": False, "gyr": False}

    def add(self, block: Block) -> None:
        """Take the next block."""
        if self._count == len(self._told):
            self._told = np.concatenate((self._told, np.empty_like(self._told)))
        acc, gyr = block.triads["acc"], block.triads["gyr"]
        for name in self._has:
            self._has[name] |= bool(np.isfinite(block.triads[name]).any())
        moments = (acc.mean(axis=0), acc.std(axis=0, ddof=1), gyr.mean(axis=0), gyr.std(axis=0, ddof=1))
        stop = block.t[-1] + (block.t[-1] - block.t[0]) / (len(block.t) - 1)
        self._told[self._count] = np.concatenate((*moments, (block.t[0], stop)))
        self._count += 1
        self._size = len(block.t)
        self._judge()

    @property
    def stretches(self) -> list[tuple[int, int]]:
        """First and stop of each run of blocks at rest."""
        return self._runs

    @property
    def lasting(self) -> float:
        """How long the unit has been at rest until now, s; 0 where it is not."""
        if not self._runs or self._runs[-1][1] != self._count:
            return 0.0
        return self.duration(self._runs[-1])

    def duration(self, stretch: tuple[int, int]) -> float:
        """Length of a run of blocks, s."""
        first, stop = stretch
        return float(self._told[stop - 1, 13] - self._told[first, 12])

    def mean_force(self, stretch: tuple[int, int]) -> Floats:
        """Mean specific force (3,) of a run of blocks, m/s²."""
        return np.asarray(self._told[slice(*stretch), :3].mean(axis=0))

    def _judge(self) -> None:
        blocks = self._told[: self._count]
        acc, gyr = BlockMoments(blocks[:, :3], blocks[:, 3:6]), BlockMoments(blocks[:, 6:9], blocks[:, 9:12])
        if not any(self._has.values()):
            return
        if not self._has["acc"]:  # which says nothing against rest
            acc = BlockMoments(*np.zeros((2, self._count, 3)))
        self._runs = runs(at_rest(acc, gyr if self._has["gyr"] else None, self._size))


def _block(rows: Floats) -> Block:
    return Block(
        rows[:, 0],
        {name: rows[:, 1 + 3 * i : 4 + 3 * i] for i, name in enumerate(TRIADS)},
        {name: rows[:, 10 + i] > 0.0 for i, name in enumerate(TRIADS)},
    )


_QUARTER: Final = 0.5 * np.pi
_AXES: Final = "xyz"
_STEP: Final = deg(5.0)


class AxisTurn(NamedTuple):
    """Turn of the unit about one of its own axes."""

    axis: int  # 0, 1 or 2 for x, y or z
    angle: float  # right-handed about the positive axis, rad

    def __str__(self) -> str:
        """Say it in words."""
        others = [_AXES[(self.axis + k) % 3] for k in (1, 2)]
        moving, goal = others if self.angle > 0.0 else reversed(others)
        degrees = 5 * max(1, round(abs(self.angle) / _STEP))
        return f"turn it about its {_AXES[self.axis]} axis by about {degrees}°, {moving} towards {goal}"


def nearest(direction: Floats, regions: list[int]) -> int:
    """Region of some that a direction (3,) has the smallest angle to."""
    return regions[int(np.argmax(REGIONS[regions] @ direction))]


def turn_to(direction: Floats, goal: Floats) -> AxisTurn:
    """Turn of the unit that brings a vector closest to a goal, both as (3,) of length 1 in the unit's axes.

    Turning about an axis leaves the vector's component along it; the best axis is the one along which goal and vector
    differ least. Where a turn about no single axis ends at the goal, the next one comes closer.
    """
    rises = np.abs(np.arcsin(np.clip(direction, -1.0, 1.0)) - np.arcsin(np.clip(goal, -1.0, 1.0)))
    return min(
        (AxisTurn(axis, _angle(axis, direction, goal)) for axis in range(3)),
        key=lambda turn: (round(float(rises[turn.axis]), 2), abs(turn.angle)),
    )


def pose_words(region: int) -> str:
    """How the unit stands when the specific force, which points up at rest, lies in a region."""
    parts = [(_AXES[k], value > 0.0) for k, value in enumerate(REGIONS[region].tolist()) if abs(value) > 0.1]
    slope = "" if len(parts) == 1 else "45° "
    return " and ".join(f"its {axis} axis {slope}{'up' if up else 'down'}" for axis, up in parts)


def _angle(axis: int, direction: Floats, goal: Floats) -> float:
    """Angle of the unit, which is the opposite of that of the vector in its axes."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turned = math.atan2(goal[b], goal[a]) - math.atan2(direction[b], direction[a])
    return -math.remainder(turned, math.tau)


ENOUGH: Final = 15  # fewest directions of the 18 with which a good prediction ends the capture

_LASTS: Final = 2.0


class Moment(NamedTuple):
    """Something that happened in a capture: when, s from its start, and what."""

    t: float
    text: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Progress:
    """State of a guided capture."""

    elapsed: float  # time since the first sample, s
    # (18,), directions that were seen, by `plumbob.calibration.predicted`; None where directions do not count, or as
    # long as nothing shows them
    filled: NDArray[np.bool_] | None
    direction: int | None = None  # the direction at present, where it is known
    still_for: float  # how long the unit has been at rest until now, s; 0 while it moves
    next_step: str  # what to do now, in words
    turn: AxisTurn | None = None  # the turn that the words ask for
    goal: int | None = None  # the direction that it leads to
    predicted: str = ""  # provisional figure that the grade judges, in words; empty as long as there is none
    grade: str | None = None  # its grade so far
    share: float  # how much of the capture is done, from 0 to 1
    warnings: tuple[str, ...] = ()  # what is wrong at present
    done: bool  # whether it is enough

    @property
    def at_rest(self) -> bool:
        """Whether the unit is at rest now."""
        return self.still_for > 0.0

    @property
    def missing(self) -> list[int]:
        """Directions that were not seen; all of them until something shows them."""
        return list(range(len(NAMES))) if self.filled is None else np.flatnonzero(~self.filled).tolist()


class Guide(ABC):
    """Guide of a capture: of `triad`, with what has happened so far in `timeline`, warnings and the end too."""

    triad: str

    def __init__(self) -> None:
        self.timeline: list[Moment] = []
        self._blocks, self._rest = BlockCutter(), RestDetector()
        self._start: float | None = None
        self._now = 0.0
        self._known = 0.0
        self._warned: dict[str, float] = {}
        self._done = False

    def feed(self, part: ImuData) -> Progress:
        """Take a part of the stream, uncalibrated in what is calibrated; parts come in the order of time."""
        for block in self._blocks.feed(part):
            self._take(block)
        return self.progress()

    @property
    def centre(self) -> Floats:
        """What is measured (3,) where there is nothing to measure, as far as is known: directions count from there."""
        return np.zeros(3)

    @abstractmethod
    def progress(self) -> Progress:
        """State after the last whole block."""

    @abstractmethod
    def _look(self, block: Block) -> None:
        """Take up a block."""

    def _progress(self, words: str, *, done: bool, **more: Any) -> Progress:
        """State with what to do now."""
        lasting, step = self._rest.lasting, "done" if done else words
        return Progress(
            elapsed=self._now, still_for=lasting, next_step=step, warnings=self._warnings, done=done, **more
        )  # fmt: skip

    def _take(self, block: Block) -> None:
        if self._start is None:
            self._start = float(block.t[0])
        self._now = float(block.t[-1]) - self._start
        self._rest.add(block)
        self._judge_triad(block)
        self._look(block)
        if not self._done and self.progress().done:
            self._done = True
            self._say("enough: the capture is good")

    def _judge_triad(self, block: Block) -> None:
        clipped = block.clipped[self.triad]
        if clipped.any():
            self._warn(f"{self.triad} is at the end of its range: move slower, or keep away from magnets")
        if np.isfinite(block.triads[self.triad]).all(axis=1).any():
            self._known = self._now
        elif self._now - self._known > _LASTS:
            self._warn(f"no {self.triad} comes: is it there, and switched on?")

    def _say(self, text: str) -> None:
        self.timeline.append(Moment(self._now, text))

    def _warn(self, text: str) -> None:
        """Warn now and for a while; the timeline gets it once as long as it lasts."""
        if text not in self._warnings:
            self._say(f"warning: {text}")
        self._warned[text] = self._now

    @property
    def _warnings(self) -> tuple[str, ...]:
        return tuple(text for text, when in self._warned.items() if self._now - when <= _LASTS)


class Seen:
    """Directions that a capture has seen, and the timeline's words about them."""

    def __init__(self) -> None:
        self.filled = np.zeros(len(NAMES), dtype=np.bool_)

    def update(self, filled: NDArray[np.bool_]) -> str | None:
        """Take what is filled now; words where that is new."""
        new = np.flatnonzero(filled & ~self.filled)
        self.filled = filled
        if not new.size:
            return None
        return f"{region_names(new.tolist())} seen, {int(filled.sum())} of {len(NAMES)}"

    def shown(self, *, enough: bool, done: bool) -> dict[str, Any]:
        """What a `Progress` says of them, and whether it is done: for good, or by `enough` of them."""
        count = int(self.filled.sum())
        done = done or (enough and count >= ENOUGH)
        return {"filled": self.filled.copy(), "share": count / len(NAMES), "done": done}


def _region(direction: Floats | None) -> int | None:
    return None if direction is None else int(region_index(direction[np.newaxis])[0])


LONG_ENOUGH: Final = 20.0  # rest in one piece that is asked for, s

_FIRST: Final = 2.0


class RestGuide(Guide):
    """Asks for the unit to be left alone."""

    triad = "gyr"

    def __init__(self) -> None:
        super().__init__()
        self._was_lying = False

    def progress(self) -> Progress:
        """State after the last whole block."""
        lasting = min(self._rest.lasting, LONG_ENOUGH)
        done = self._done or lasting >= LONG_ENOUGH
        words = f"leave the unit untouched: {lasting:.1f} of {LONG_ENOUGH:.0f} s"
        return self._progress(words, filled=None, share=1.0 if done else lasting / LONG_ENOUGH, done=done)

    def _look(self, block: Block) -> None:
        lying = self._rest.lasting >= _FIRST
        if lying != self._was_lying:
            self._say("at rest" if lying else "touched: the rest starts again")
        self._was_lying = lying


BETWEEN: Final = 2.5  # s of rest that counts between turns: 3 s, of which any cut in blocks leaves as much


class StopsGuide(Guide):
    """Asks for turns from stop to stop: those that are given, else one each way about each axis.

    Its options are those of `plumbob.calibration.gyr.stops.fit_stops`, by which it judges after every rest.
    """

    triad = "gyr"

    def __init__(
        self, *, angle: float = _QUARTER, turns: Sequence[tuple[int, float]] | None = None, **fit: Any
    ) -> None:
        super().__init__()
        self._of: dict[str, Any] = fit | ({"angle": angle} if turns is None else {})
        self._given = turns
        self._asked = turns or [(axis, way * angle) for axis in range(3) for way in (1.0, -1.0)]
        self._left = list(self._asked)
        self._smallest = min(SMALLEST, *(0.5 * abs(size) for _, size in self._asked))
        self._rows: list[Floats] = []
        self._rests = 0
        self._scale_sd: float | None = None

    def progress(self) -> Progress:
        """State after the last whole block."""
        done = self._done or (not self._left and self._scale_sd is not None)
        lasting, sd = self._rest.lasting, self._scale_sd
        turn = AxisTurn(*self._left[0]) if self._left else None
        exact = "go on turning" if turn is None else f"{turn} ({_AXES[turn.axis]} {to_deg(turn.angle):+.4g}°)"
        words = f"{exact}, from stop to stop, and let it lie for 3 s"
        if lasting < BETWEEN and (lasting or not self._rests):
            words, turn = f"leave the unit untouched: {lasting:.1f} of {BETWEEN:.1f} s", None
        return self._progress(
            words, filled=None, turn=turn, share=1.0 if done else 1.0 - len(self._left) / len(self._asked), done=done,
            predicted="" if sd is None else f"gain ±{100.0 * sd:.2g} % (1 sd)",
            grade=None if sd is None else grade_of(sd, SCALE),
        )  # fmt: skip

    def _look(self, block: Block) -> None:
        rows: Floats = np.column_stack((block.t, block.triads["gyr"], block.clipped["gyr"])).astype(np.float64)
        self._rows.append(rows[np.isfinite(rows).all(axis=1)])
        rests = sum(self._rest.duration(stretch) >= BETWEEN for stretch in self._rest.stretches)
        if rests > self._rests:
            self._judge_turns()
        self._rests = rests

    def _judge_turns(self) -> None:
        rows = np.concatenate(self._rows)
        rates = Rates(rows[:, 0], rows[:, 1:4], clipped=rows[:, 4] > 0.0)
        try:
            made = [turn for turn in turns_between(rates)[0] if float(np.abs(turn.angle).max()) > self._smallest]
            self._left = self._missing(made)
            if made:
                self._say(f"turned about {made[-1]}, {len(made)} so far")
                turns = None if self._given is None else self._given[: len(made)]
                quality = fit_stops(rates, turns=turns, **self._of).calibration.quality
                self._scale_sd = None if quality is None else quality.scale_sd
        except CaptureRefusedError as refused:
            self._scale_sd = None
            self._warn(str(refused.reasons[0].text))

    def _missing(self, made: list[StopTurn]) -> list[tuple[int, float]]:
        """Turns that are asked for and not made, in order where they were given."""
        if self._given is not None:
            return list(self._given[len(made) :])
        ways = {(turn.axis, bool(turn.angle[turn.axis] > 0.0)) for turn in made}
        return [(axis, angle) for axis, angle in self._asked if (axis, angle > 0.0) not in ways]


HOLD: Final = 1.4  # s of rest after which a pose counts: six blocks of `still`, of which any cut leaves a second quiet

_UNTIL: Final = "keep it still until it counts, about 2 s"


class AccelGuide(Guide):
    """Asks for the 18 poses in which each face and each edge of the unit is up."""

    triad = "acc"

    def __init__(self) -> None:
        super().__init__()
        self._seen = Seen()
        self._poses = np.empty((0, 3))
        self._centre = np.zeros(3)
        self._force: Floats | None = None
        self._sd: float | None = None

    @property
    def centre(self) -> Floats:
        """Of the ellipsoid that the poses lie on."""
        return self._centre

    def progress(self) -> Progress:
        """State after the last whole block."""
        grade = None if self._sd is None else grade_of(self._sd, TILT)
        direction = None if self._force is None else _unit(self._force - self._centre)
        here, missing = _region(direction), np.flatnonzero(~self._seen.filled).tolist()
        goal = nearest(direction, missing) if missing and direction is not None else None
        turn = None if goal is None or goal == here or direction is None else turn_to(direction, REGIONS[goal])
        predicted = "" if self._sd is None else f"tilt ±{to_deg(self._sd):.2g}° (1 sd)"
        return self._progress(
            self._words(here, goal), direction=here, turn=turn, goal=goal, predicted=predicted, grade=grade,
            **self._seen.shown(enough=grade == "good", done=self._done),
        )  # fmt: skip

    def _look(self, block: Block) -> None:
        mean = block.triads["acc"].mean(axis=0)
        self._force = mean if np.isfinite(mean).all() and np.any(mean != self._centre) else None
        stretches = [stretch for stretch in self._rest.stretches if self._rest.duration(stretch) >= HOLD]
        poses = np.array([self._rest.mean_force(stretch) for stretch in stretches]).reshape(-1, 3)
        if len(poses) != len(self._poses):
            self._fit(poses)
        self._poses = poses
        if (news := self._seen.update(filled(poses - self._centre) > 0)) is not None:
            self._say(news)

    def _fit(self, poses: Floats) -> None:
        shape = ellipsoid_fit.Shape.ELLIPSOID
        enough = len(poses) >= shape.value + ellipsoid_fit.SPARE
        fit = ellipsoid_fit.fit_norm(poses, shape, ellipsoid_fit.first_ellipsoid(poses)) if enough else None
        self._centre, self._sd = (np.zeros(3), None) if fit is None else (fit.ellipsoid.centre, _predicted(fit, poses))

    def _words(self, here: int | None, goal: int | None) -> str:
        if here is None or goal is None:
            return "hold the unit still in another pose" if goal is None else "wait for the accelerometer"
        if here == goal:
            return _UNTIL if self._rest.lasting else "let go of it, or hold it still"
        return f"hold it with {pose_words(goal)}, and {_UNTIL}"


def _predicted(fit: ellipsoid_fit.NormFit, poses: Floats) -> float:
    shared = alike(fit.residuals, fit.ellipsoid.to_sphere(poses), fit.used)
    return tilt_sd(*ellipsoid_fit.scaled(fit, G0, alike=shared.factor), size=G0)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))


TOO_FAST: Final = float(dps(180.0))  # rad/s: beyond, compasses that average for 10 ms or so smear by degrees

MOST: Final = 200  # samples that are kept of each direction, evenly in time: where there are more, every other one goes

_OF_BLOCK: Final = 10
_EVERY: Final = 4  # blocks
_IDLE: Final = 1.5
_FEWEST: Final = 12
_CERTAIN: Final = 0.15  # standard deviation of the centre over the radius above which directions are told
_HOLLOW: Final = 0.25  # residuals over the radius; soft iron leaves 0.15 of a sphere, noise without a field 0.42
_OFF: Final = 0.1  # of the field


class MagGuide(Guide):
    """Asks for turns until each of the 18 directions of the field has been seen."""

    triad = "mag"

    def __init__(self) -> None:
        super().__init__()
        self._seen = Seen()
        self._sample = _EvenVectors()
        self._count = 0
        self._fit: ellipsoid_fit.NormFit | None = None
        self._sd: tuple[float, float] | None = None
        self._field: Floats | None = None

    @property
    def centre(self) -> Floats:
        """Of the ellipsoid, or until there is one, the middle of what has come."""
        vectors = self._sample.vectors
        if self._fit is not None:
            return self._fit.ellipsoid.centre
        return np.asarray(vectors.mean(axis=0)) if len(vectors) else np.zeros(3)

    def progress(self) -> Progress:
        """State after the last whole block."""
        grade, shown = (None, None) if self._sd is None else (grade_of(sd, HEADING) for sd in self._sd)
        direction = self._direction()
        goal, turn = self._next(direction)
        predicted = "" if self._sd is None else f"heading ±{to_deg(self._sd[0]):.2g}° (1 sd)"
        directions = self._seen.shown(enough=shown == "good", done=self._done)
        return self._progress(
            self._words(goal, turn), direction=_region(direction), turn=turn, goal=goal, predicted=predicted,
            grade=grade, **directions | ({"filled": None} if self._fit is None else {}),
        )  # fmt: skip

    def _look(self, block: Block) -> None:
        mag = block.triads["mag"]
        usable = mag[np.isfinite(mag).all(axis=1) & ~block.clipped["mag"]]
        if len(usable):
            some = usable[:: -(-len(usable) // _OF_BLOCK)]
            self._judge_field(some)
            self._field = some[-1]
            self._sample.take(some, None if self._fit is None else self._fit.ellipsoid.centre)
        rate = np.linalg.norm(block.triads["gyr"], axis=1)
        if np.isfinite(rate).any() and float(np.nanmean(rate)) > TOO_FAST:
            self._warn(f"too fast: turn it slower than {to_deg(TOO_FAST):.0f}° in a second")
        self._count += 1
        idle = self._rest.lasting > _IDLE  # nothing new can be seen
        if self._count % _EVERY == 0 and len(self._sample.vectors) >= _FEWEST and not idle:
            self._refit()

    def _refit(self) -> None:
        vectors = self._sample.vectors
        fit = _determined(vectors) if one_axis(vectors, None) is None else None
        self._fit = fit
        full = fit is not None and fit.shape is ellipsoid_fit.Shape.ELLIPSOID
        self._sd = _predicted_heading(fit, vectors) if fit is not None and full else None
        if fit is None:
            return
        if (news := self._seen.update(filled(vectors - fit.ellipsoid.centre) > 0)) is not None:
            self._say(news)

    def _judge_field(self, samples: Floats) -> None:
        """Warn of a field whose length does not fit what was seen before in the same direction."""
        fit = self._fit
        if fit is None:
            return
        arm = samples - fit.ellipsoid.centre
        sizes = np.linalg.norm(arm @ fit.ellipsoid.shape, axis=1)
        covered = self._seen.filled[region_index(arm)]
        if covered.all() and abs(float(np.median(sizes)) - 1.0) > _OFF:
            self._warn(
                "the field is not that of before: take iron, magnets and cables away, and what moves on the unit"
            )

    def _direction(self) -> Floats | None:
        if self._fit is None or self._field is None:
            return None
        return _unit(self._field - self._fit.ellipsoid.centre)

    def _next(self, direction: Floats | None) -> tuple[int | None, AxisTurn | None]:
        """Direction to go to, and the turn towards it; a turn about another axis as long as no direction is known."""
        if direction is None:
            vectors = self._sample.vectors
            if len(vectors) < _FEWEST:
                return None, None
            _, _, directions = np.linalg.svd(vectors - vectors.mean(axis=0), full_matrices=False)
            return None, AxisTurn(int(np.argmin(np.abs(directions[2]))), _QUARTER)  # across that of the largest turn
        missing = np.flatnonzero(~self._seen.filled).tolist()
        if not missing:
            return None, None
        goal = nearest(direction, missing)
        return goal, turn_to(direction, REGIONS[goal])

    def _words(self, goal: int | None, turn: AxisTurn | None) -> str:
        if turn is None:
            return "turn it slowly about all its axes" if goal is None else "turn it slowly"
        if goal is None:
            return f"tilt it: {turn}, then slowly through all attitudes"
        return f"{turn}, to {NAMES[goal]}"


class _EvenVectors:
    """Samples (N, 3) of a stream that every direction has its share in, and every moment within a direction."""

    def __init__(self) -> None:
        self.vectors = np.empty((0, 3))
        self._arrived = np.zeros(len(NAMES), dtype=np.int64)
        self._stride = np.ones(len(NAMES), dtype=np.int64)

    def take(self, samples: Floats, centre: Floats | None) -> None:
        """Take what comes, in directions as seen from the centre, else from the middle of what has come."""
        every = np.concatenate((self.vectors, samples))
        where = region_index(every - (every.mean(axis=0) if centre is None else centre))
        keep = np.ones(len(every), dtype=np.bool_)
        for i, region in enumerate(where[len(self.vectors) :].tolist(), start=len(self.vectors)):
            keep[i] = self._arrived[region] % self._stride[region] == 0
            self._arrived[region] += 1
        for region in np.flatnonzero(np.bincount(where[keep], minlength=len(NAMES)) > MOST).tolist():
            keep[np.flatnonzero(keep & (where == region))[1::2]] = False
            self._stride[region] *= 2
        self.vectors = every[keep]


def _determined(vectors: Floats) -> ellipsoid_fit.NormFit | None:
    """Fit of the full shape, else of a sphere, whose centre is known well enough to tell directions."""
    start = ellipsoid_fit.first_ellipsoid(vectors)
    for shape in (ellipsoid_fit.Shape.ELLIPSOID, ellipsoid_fit.Shape.SPHERE):
        if len(vectors) < shape.value + ellipsoid_fit.SPARE:
            continue
        fit = ellipsoid_fit.fit_norm(vectors, shape, start, robust=False)
        if fit is not None and _is_certain(fit):
            return fit
        start = ellipsoid_fit.Ellipsoid(start.centre, np.eye(3) * np.trace(start.shape) / 3.0)
    return None


def _is_certain(fit: ellipsoid_fit.NormFit) -> bool:
    radius = 3.0 / float(np.trace(fit.ellipsoid.shape))
    centre_sd = float(np.sqrt(np.linalg.eigvalsh(fit.covariance[:3, :3])[-1]))
    return centre_sd < _CERTAIN * radius and fit.sd < _HOLLOW * radius


def _predicted_heading(fit: ellipsoid_fit.NormFit, vectors: Floats) -> tuple[float, float]:
    """Predicted heading error, rad, and what of it more turning can make smaller: a length never shows the rest."""
    matrix, independent = ellipsoid_fit.scaled(fit, None, alike=1.0)
    samples = fit.residuals, fit.ellipsoid.to_sphere(vectors), fit.used
    memory, radius = alike(*samples).memory, ellipsoid_fit.mean_radius(fit.ellipsoid.shape)
    fields = (unevenness(*samples, lengths=lengths) for lengths in (True, False))
    of: dict[str, Any] = {"memory": memory, "residuals": fit.residuals[fit.used], "matrix": matrix, "radius": radius}
    counted = (field.counted(independent, **of) for field in fields)
    total, shown = (heading_sd(matrix, covariance, size=radius, dip=DIP) for covariance in counted)
    return total, shown


GUIDES: Final[dict[str, type[Guide]]] = {
    "mag": MagGuide, "accel": AccelGuide, "gyro": RestGuide, "stops": StopsGuide
}  # fmt: skip
"""Guide of each kind of `plumbob calibrate` that has one, and of method stops of a gyroscope."""

_CHUNK: Final = 4096


class GuideSink(Sink):
    """Hands the samples of a line to a guide, shows its progress, and stops the line when it is enough.

    A line that comes back goes on with the same unit in the same capture.
    """

    def __init__(self, guide: Guide, stop: Stop, show: Callable[[Progress], None]) -> None:
        self._guide, self._stop, self._show = guide, stop, show

    def on_part(self, part: ItemResult) -> None:
        """Go on, and stop when it is enough."""
        progress = self._guide.feed(part.sensed)
        self._show(progress)
        if progress.done:
            self._stop.set()


def guided(guide: Guide, imu: ImuData) -> Progress:
    """Progress at the end of a recording, uncalibrated in what is calibrated; the guide's timeline shows the way."""
    for part in imu.chunks(_CHUNK):
        progress = guide.feed(part)
    return progress
