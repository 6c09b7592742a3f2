"""Scenarios of captures: how a unit is moved to be calibrated, the ways that calibrate nothing, and the static test.

Attitudes are those of forward-right-down axes in NED, as everywhere in scenarios; `Simulation` gives them in the frame
that was asked for.
"""

import itertools
import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, deg
from plumbob.rotations import (
    Frame,
    every_axes,
    quat_chained,
    quat_from_dcm,
    quat_from_euler_zyx,
    quat_from_rotvec,
    quat_multiply,
)
from plumbob.simulation.motion import GimbalMotion, Motion, PoseMotion, Scenario
from plumbob.simulation.signals import Moves, Polynomial, Signal, Sinusoids, constant, random_phases, sinusoid

_TURN = math.pi
_X, _Y, _Z = 0, 1, 2
_DOWN = np.array([0.0, 0.0, 1.0])

SECTORS = 6  # [Yu2018]: of the heading in `Bands`

BANDS = 3  # [Yu2018]: of the inclination in `Bands`


@dataclass(frozen=True, kw_only=True)
class PoseScenario(Scenario):
    """Poses at rest, one after the other."""

    dwell: Annotated[float, Spec(Quantity.TIME, "time at rest in each pose", 0.1, 1e4)] = 3.0
    move: Annotated[float, Spec(Quantity.TIME, "time of a move to the next pose", 0.05, 1e3)] = 1.0

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of poses."""

    @abstractmethod
    def attitudes(self, rng: np.random.Generator) -> Floats:
        """Poses (count, 4), in NED."""

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return self.count * (self.dwell + self.move) - self.move

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """From pose to pose by the shortest turn."""
        return PoseMotion(Frame.NED, self.attitudes(rng), self.dwell, self.move)


@dataclass(frozen=True, kw_only=True)
class Faces(PoseScenario):
    """Laid on each of the six faces of a box, and on its twelve edges where asked, each with a heading by chance."""

    edges: Annotated[bool, Spec(Quantity.RATIO, "the twelve edges too")] = False
    wobble: Annotated[float, Spec(Quantity.ANGLE, "error of the hand about each axis, rms", 0.0, deg(45.0))] = deg(2.0)

    @property
    def count(self) -> int:
        """Number of poses."""
        return 18 if self.edges else 6

    def attitudes(self, rng: np.random.Generator) -> Floats:
        """Poses (count, 4), in NED."""
        signs = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)))
        axes = np.abs(signs).sum(axis=1)
        upward = np.concatenate([signs[axes == n] for n in ((1, 2) if self.edges else (1,))])
        return trembling(facing(upward, rng.uniform(-_TURN, _TURN, len(upward))), self.wobble, rng)


@dataclass(frozen=True, kw_only=True)
class Stops(PoseScenario):
    """A box from face to face over its edges: turned about each axis of its case one way, then each the other way."""

    angle: Annotated[float, Spec(Quantity.ANGLE, "from stop to stop", deg(5.0), deg(175.0))] = deg(90.0)
    wobble: Annotated[float, Spec(Quantity.ANGLE, "error of a turn about each axis, rms", 0.0, deg(45.0))] = deg(0.5)
    move: Annotated[float, Spec(Quantity.TIME, "time of a turn", 0.05, 1e3)] = 2.5

    count = 7

    def attitudes(self, rng: np.random.Generator) -> Floats:
        """Poses (count, 4), in NED."""
        turns = self.angle * np.concatenate((np.eye(3), -np.eye(3)))
        poses = quat_chained(turns + self.wobble * rng.standard_normal(turns.shape))
        faces = [way for way in every_axes() if np.linalg.det(way) > 0.0]
        return quat_multiply(quat_from_dcm(faces[rng.integers(len(faces))]), poses)


@dataclass(frozen=True, kw_only=True)
class Raise(PoseScenario):
    """Level, then held with the nose raised about the lateral axis: what shows how a unit sits on its body."""

    angle: Annotated[float, Spec(Quantity.ANGLE, "of the nose above the horizon", -deg(80.0), deg(80.0))] = deg(30.0)
    dwell: Annotated[float, Spec(Quantity.TIME, "time at rest in each pose", 0.1, 1e4)] = 5.0
    move: Annotated[float, Spec(Quantity.TIME, "time of the move", 0.05, 1e3)] = 3.0

    count = 2

    def attitudes(self, rng: np.random.Generator) -> Floats:
        """Poses (count, 4), in NED, with any heading."""
        heading = rng.uniform(-_TURN, _TURN)
        return quat_from_euler_zyx(np.array([[heading, 0.0, 0.0], [heading, self.angle, 0.0]]))


@dataclass(frozen=True, kw_only=True)
class Bands(PoseScenario):
    """One pose in each of three bands of pitch by six sectors of heading, anywhere in it [Yu2018].

    The paper says nothing of the roll. It is left to chance here: with none, the accelerometer's y axis would see
    nothing.
    """

    along_roll: Annotated[bool, Spec(Quantity.RATIO, "three bands of roll instead, with pitch by chance")] = False

    count = BANDS * SECTORS

    def attitudes(self, rng: np.random.Generator) -> Floats:
        """Poses (count, 4), in NED."""
        band, sector = np.divmod(np.arange(self.count), SECTORS)
        chance = rng.random((3, self.count))
        yaw = _TURN * (2.0 * (sector + chance[0]) / SECTORS - 1.0)
        banded, free = (band + chance[1]) / BANDS - 0.5, chance[2] - 0.5
        pitch, roll = (free, banded) if self.along_roll else (banded, free)
        return quat_from_euler_zyx(np.stack((yaw, _TURN * pitch, 2.0 * _TURN * roll), axis=-1))


@dataclass(frozen=True, kw_only=True)
class Poses(PoseScenario):
    """Held in many poses by hand, all attitudes alike likely."""

    whole_number: ClassVar[str] = "number"

    number: Annotated[float, Spec(Quantity.RATIO, "number of poses, a whole number", 1, 1e4)] = 40

    @property
    def count(self) -> int:
        """Number of poses."""
        return round(self.number)

    def attitudes(self, rng: np.random.Generator) -> Floats:
        """Poses (count, 4), in NED."""
        q = rng.normal(size=(self.count, 4))
        return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


@dataclass(frozen=True, kw_only=True)
class Tumble(Scenario):
    """Turned by hand without a rest: tilted to the limit and back on a spiral of all directions, and about itself."""

    tilt_limit: Annotated[float, Spec(Quantity.ANGLE, "largest tilt: 180° is all attitudes", 0.0, _TURN)] = _TURN
    spirals: Annotated[float, Spec(Quantity.RATIO, "turns of the direction of the tilt", 0.0, 100.0)] = 9.0
    turns: Annotated[float, Spec(Quantity.RATIO, "turns of the heading", -100.0, 100.0)] = 4.0
    time: Annotated[float, Spec(Quantity.TIME, "time from level to level", 1.0, 1e4)] = 60.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Tilt about a level axis that turns, inside a heading that turns; both start anywhere."""
        start, first = rng.uniform(-_TURN, _TURN, 2)
        once = 2.0 * _TURN / self.time
        direction = Polynomial((first, self.spirals * once))
        half = 0.5 * self.tilt_limit * np.ones(1)
        tilt = constant(half[0]) + Sinusoids(once * np.ones(1), -half, np.zeros(1))
        heading = Polynomial((start, self.turns * once))
        return GimbalMotion(Frame.NED, ((_Z, heading + direction), (_X, tilt), (_Z, -1.0 * direction)))


@dataclass(frozen=True, kw_only=True)
class Sway(Scenario):
    """Turned about the vertical while pitch and roll swing within a limit: what a vehicle that cannot tumble allows."""

    limit: Annotated[float, Spec(Quantity.ANGLE, "largest pitch, and largest roll", 0.0, deg(80.0))] = deg(15.0)
    pitch_period: Annotated[float, Spec(Quantity.TIME, "of the pitch", 0.1, 1e3)] = 7.0
    roll_period: Annotated[float, Spec(Quantity.TIME, "of the roll", 0.1, 1e3)] = 11.0
    turns: Annotated[float, Spec(Quantity.RATIO, "turns of the heading", -100.0, 100.0)] = 4.0
    time: Annotated[float, Spec(Quantity.TIME, "time that the turns take", 1.0, 1e4)] = 60.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Heading that is a line, pitch and roll that are sinusoids; all start anywhere."""
        phase = rng.uniform(-_TURN, _TURN, 2).tolist()
        pitch, roll = (
            sinusoid(self.limit, 1.0 / period, start)
            for period, start in zip((self.pitch_period, self.roll_period), phase, strict=True)
        )
        return GimbalMotion(Frame.NED, ((_Z, _turning(self.turns, self.time, rng)), (_Y, pitch), (_X, roll)))


@dataclass(frozen=True, kw_only=True)
class LevelRing(Scenario):
    """Only turned about the vertical, level but for a trembling hand: calibrates nothing but in the level plane."""

    turns: Annotated[float, Spec(Quantity.RATIO, "turns about the vertical", -100.0, 100.0)] = 2.0
    wobble: Annotated[float, Spec(Quantity.ANGLE, "largest pitch and roll of the hand", 0.0, deg(45.0))] = deg(1.0)
    time: Annotated[float, Spec(Quantity.TIME, "time that the turns take", 1.0, 1e4)] = 60.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Heading that is a line, pitch and roll that tremble."""
        pitch, roll = (_tremble(self.wobble, rng) for _ in range(2))
        return GimbalMotion(Frame.NED, ((_Z, _turning(self.turns, self.time, rng)), (_Y, pitch), (_X, roll)))


@dataclass(frozen=True, kw_only=True)
class Cone(LevelRing):
    """Only turned about one axis: the vertical, with a constant tilt, or that of a table that stands aslant."""

    tilt: Annotated[float, Spec(Quantity.ANGLE, "of the unit, or of the table's axis", -_TURN, _TURN)] = deg(15.0)
    table: Annotated[bool, Spec(Quantity.RATIO, "the axis is inclined, not the unit on it")] = False

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Tilt outside or inside the turn, pitch and roll that tremble."""
        pitch, roll = (_tremble(self.wobble, rng) for _ in range(2))
        turn, tilt = (_Z, _turning(self.turns, self.time, rng)), (_Y, constant(self.tilt))
        held = (tilt, turn) if self.table else (turn, tilt)
        return GimbalMotion(Frame.NED, (*held, (_Y, pitch), (_X, roll)))


@dataclass(frozen=True, kw_only=True)
class Table36(Scenario):
    """Turned step by step on a table that stands aslant: the static test of the buoy paper [Yu2018]."""

    whole_number: ClassVar[str] = "steps"

    tilt: Annotated[float, Spec(Quantity.ANGLE, "of the table", -0.5 * _TURN, 0.5 * _TURN)] = deg(20.0)
    step: Annotated[float, Spec(Quantity.ANGLE, "turn about the table's axis", -_TURN, _TURN)] = deg(10.0)
    steps: Annotated[float, Spec(Quantity.RATIO, "number of rests, a whole number", 2, 1e4)] = 36
    dwell: Annotated[float, Spec(Quantity.TIME, "time of each rest", 0.1, 1e4)] = 3.0
    move: Annotated[float, Spec(Quantity.TIME, "time of each turn", 0.05, 1e3)] = 1.0

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return round(self.steps) * (self.dwell + self.move) - self.move

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Steps about an axis that is tilted to the right."""
        i = np.arange(round(self.steps) - 1)
        start = self.dwell + i * (self.dwell + self.move)
        turn = Moves(start, np.full(i.size, self.move), np.full(i.size, self.step))
        return GimbalMotion(Frame.NED, ((_X, constant(self.tilt)), (_Z, turn)))


def facing(upward: Floats, heading: Floats) -> Floats:
    """Attitudes (N, 4) that bring directions of the body (N, 3) up by the shortest turn, then turned by a heading."""
    up = upward / np.linalg.norm(upward, axis=1, keepdims=True)
    axis = np.cross(up, -_DOWN)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    level = np.where(sine > 0.0, axis / np.where(sine > 0.0, sine, 1.0), (1.0, 0.0, 0.0))
    tilt = quat_from_rotvec(np.arctan2(sine, -up @ _DOWN[:, np.newaxis]) * level)
    return quat_multiply(quat_from_rotvec(np.outer(heading, _DOWN)), tilt)


def trembling(q_nb: Floats, wobble: float, rng: np.random.Generator) -> Floats:
    """Attitudes (N, 4) with an error of the hand."""
    return quat_multiply(q_nb, quat_from_rotvec(wobble * rng.normal(size=(len(q_nb), 3))))


def _turning(turns: float, time: float, rng: np.random.Generator) -> Signal:
    """Heading that starts anywhere and turns steadily."""
    return Polynomial((rng.uniform(-_TURN, _TURN), 2.0 * _TURN * turns / time))


def _tremble(limit: float, rng: np.random.Generator) -> Signal:
    """Three sinusoids of periods 2 to 8 s, whose sum stays within the limit."""
    phasors = limit / 3.0 * random_phases(3, rng)
    return Sinusoids.from_phasors(2.0 * np.pi / rng.uniform(2.0, 8.0, 3), phasors)
