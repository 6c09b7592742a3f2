"""Scenarios: named motions with a few parameters, each a small frozen class.

Parameters are in SI and radians; each carries its unit, domain and meaning (`plumbob.core.params.describe` lists them).
Headings count from true North over East; pitch is nose up, roll is right side down, in every navigation frame.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.params import Spec, build
from plumbob.core.units import Quantity, deg, dps, g
from plumbob.rotations import Frame
from plumbob.simulation import signals
from plumbob.simulation.captures import Bands, Cone, Faces, LevelRing, Poses, Raise, Stops, Sway, Table36, Tumble
from plumbob.simulation.motion import ConingMotion, EulerMotion, Motion, Scenario, Sea, draw_sea, oscillator

_QUARTER = np.pi / 2.0
_FACES: Final = _QUARTER * np.array(
    [(0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]
)  # yaw, pitch, roll that bring the top, the bottom, the left, the right, the nose and the tail up


def spins(rates: Floats, hold: float, ramp: float) -> tuple[Floats, Floats]:
    """Instants (m,), s, and the rate at each of the spins of one face, from rest to rest.

    `rates` (k,), rising, rad/s, are held, then their opposites, falling; `hold` and `ramp`: time at each rate, at rest
    too, and between rates, s.
    """
    held = np.concatenate(([0.0], rates, -rates[::-1]))
    start = (hold + ramp) * np.arange(held.size)
    knots = np.append(np.stack((start, start + hold), axis=1).ravel(), start[-1] + hold + ramp)
    return knots, np.append(np.repeat(held, 2), 0.0)


def session(knots: Floats, rates: Floats, remount: float) -> tuple[Floats, Floats, signals.Moves]:
    """Instants and rates of all six faces, and the moves of yaw, pitch and roll from face to face in `remount`, s.

    `knots`, `rates` (m,) are those of one face, as `spins` gives them.
    """
    starts = (knots[-1] + remount) * np.arange(len(_FACES))
    moves = signals.Moves(starts[1:] - remount, np.full(len(_FACES) - 1, remount), np.diff(_FACES, axis=0))
    return (starts[:, np.newaxis] + knots).ravel(), np.tile(rates, len(_FACES)), moves


_REST = signals.constant(0.0)
_TURN = math.pi


@dataclass(frozen=True, kw_only=True)
class Static(Scenario):
    """At rest, level or tilted: noise, turn-on bias, initial attitude."""

    heading: Annotated[float, Spec(Quantity.ANGLE, "heading", -_TURN, _TURN)] = 0.0
    pitch: Annotated[float, Spec(Quantity.ANGLE, "nose up", -0.5 * _TURN, 0.5 * _TURN)] = 0.0
    roll: Annotated[float, Spec(Quantity.ANGLE, "right side down", -_TURN, _TURN)] = 0.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Motion that is none."""
        return EulerMotion(Frame.NED, signals.constant((self.heading, self.pitch, self.roll)))


@dataclass(frozen=True, kw_only=True)
class Turntable(Scenario):
    """Rate table: spins up at a constant angular acceleration about the vertical, then holds its rate [Chen2013]."""

    rate: ClassVar[float] = 10.0

    lead: Annotated[float, Spec(Quantity.TIME, "rest before it starts", 0.0, 1e5)] = 0.0

    peak_rate: Annotated[
        float, Spec(Quantity.RATE, "rate that is held, clockwise from above", dps(0.01), dps(2000.0))
    ] = dps(60.0)
    spin_up: Annotated[float, Spec(Quantity.TIME, "time from rest to the rate that is held", 0.1, 1e4)] = 100.0
    hold: Annotated[float, Spec(Quantity.TIME, "time that the rate is held", 0.0, 1e5)] = 100.0
    radius: Annotated[float, Spec(Quantity.LENGTH, "distance of the sensors behind the axis", 0.0, 10.0)] = 0.0

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return self.lead + self.spin_up + self.hold

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Heading that is a parabola and then a line."""
        heading = signals.Ramps((self.lead, self.lead + self.spin_up), (0.0, self.peak_rate))
        return EulerMotion(Frame.NED, signals.Stack((heading, _REST, _REST)), lever_b=(-self.radius, 0.0, 0.0))


@dataclass(frozen=True, kw_only=True)
class Ball(Scenario):
    """Ball that is lapped between plates: it rolls about its x axis, which leans to and fro [Chen2013].

    So the point that touches the lower plate goes round the ball, from circle to circle.
    """

    rate: ClassVar[float] = 10.0

    lead: Annotated[float, Spec(Quantity.TIME, "rest before it starts", 0.0, 1e5)] = 0.0
    spin_up: Annotated[float, Spec(Quantity.TIME, "time from rest to its full rates", 0.1, 1e4)] = 5.0
    rolling: Annotated[float, Spec(Quantity.RATE, "rate at which it rolls", dps(0.01), dps(2000.0))] = dps(60.0)
    lean: Annotated[float, Spec(Quantity.ANGLE, "largest lean of its x axis", 0.0, deg(85.0))] = deg(60.0)
    period: Annotated[float, Spec(Quantity.TIME, "in which its x axis leans to and fro", 1.0, 1e4)] = 50.0
    turning: Annotated[float, Spec(Quantity.TIME, "time that it is lapped", 1.0, 1e5)] = 100.0

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return self.lead + self.turning

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Roll that is a parabola and then a line, and a pitch that is a sine of such a phase."""
        knots = (self.lead, self.lead + self.spin_up)
        lean = self.lean * signals.Sine(signals.Ramps(knots, (0.0, 2.0 * math.pi / self.period)))
        return EulerMotion(Frame.NED, signals.Stack((_REST, lean, signals.Ramps(knots, (0.0, self.rolling)))))


@dataclass(frozen=True, kw_only=True)
class RateTable(Scenario):
    """Session on a rate table: each of the six faces up in turn, at rest and spun both ways at three rates."""

    peak_rate: Annotated[
        float, Spec(Quantity.RATE, "highest rate; the others are a half and a quarter of it", dps(0.1), dps(2000.0))
    ] = dps(200.0)
    hold: Annotated[float, Spec(Quantity.TIME, "time that each rate is held", 0.1, 1e4)] = 10.0
    ramp: Annotated[float, Spec(Quantity.TIME, "time from rate to rate", 0.01, 1e3)] = 2.0
    remount: Annotated[float, Spec(Quantity.TIME, "time from face to face", 0.1, 1e4)] = 5.0

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return float(session(*self._spins, self.remount)[0][-1])

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Spins of each face about the vertical, and moves from face to face between them."""
        knots, rates, faces = session(*self._spins, self.remount)
        return EulerMotion(Frame.NED, signals.Stack((signals.Ramps(knots, rates), _REST, _REST)) + faces)

    @property
    def _spins(self) -> tuple[Floats, Floats]:
        return spins(self.peak_rate * np.array([0.25, 0.5, 1.0]), self.hold, self.ramp)


@dataclass(frozen=True, kw_only=True)
class Slide(Scenario):
    """Slid to and fro over a level table, obliquely to its axes: acceleration without any tilt [Yu2018]."""

    whole_number: ClassVar[str] = "strokes"

    peak_speed: Annotated[float, Spec(Quantity.SPEED, "highest speed of a stroke", 0.01, 20.0)] = 2.0
    stroke: Annotated[float, Spec(Quantity.TIME, "duration of a stroke", 0.05, 60.0)] = 0.4
    pause: Annotated[float, Spec(Quantity.TIME, "rest between strokes", 0.0, 60.0)] = 0.4
    strokes: Annotated[float, Spec(Quantity.RATIO, "number of strokes, a whole number", 1, 1e4)] = 20
    direction: Annotated[
        float, Spec(Quantity.ANGLE, "of the first stroke, from forward to the right", -_TURN, _TURN)
    ] = deg(50.0)
    heading: Annotated[float, Spec(Quantity.ANGLE, "heading", -_TURN, _TURN)] = 0.0
    lead: Annotated[float, Spec(Quantity.TIME, "rest before the first stroke and after the last", 0.0, 1e4)] = 10.0

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return 2.0 * self.lead + round(self.strokes) * (self.stroke + self.pause)

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Strokes of sinusoidal acceleration, every other one backward."""
        i = np.arange(round(self.strokes))
        length = 0.5 * self.peak_speed * self.stroke
        course = self.heading + self.direction
        ahead = np.array([math.cos(course), math.sin(course), 0.0])
        start, change = self.lead + i * (self.stroke + self.pause), np.outer(length * (-1.0) ** i, ahead)
        way = signals.Moves(start, np.full(i.size, self.stroke), change, law=signals.cycloid)
        return EulerMotion(Frame.NED, signals.constant((self.heading, 0.0, 0.0)), way)


@dataclass(frozen=True, kw_only=True)
class Buoy(Scenario):
    """Small moored buoy in a random sea of a JONSWAP spectrum [Hasselmann1973].

    The buoy moves with the water and tilts with the surface, each through a damped oscillator: long waves it follows,
    short ones pass it. Tilt and way therefore do not cancel, and an accelerometer alone is wrong by degrees. Yaw
    wanders by itself; pitch and roll follow the slopes along and across the mean heading.
    """

    lasts: ClassVar[float] = 600.0

    height: Annotated[float, Spec(Quantity.LENGTH, "significant wave height Hs", 0.0, 20.0)] = 1.5
    period: Annotated[float, Spec(Quantity.TIME, "period Tp of the spectrum's peak", 1.0, 25.0)] = 6.0
    peakedness: Annotated[float, Spec(Quantity.RATIO, "γ of the spectrum; 1 is Pierson and Moskowitz's", 1.0, 10.0)] = (
        1.0
    )
    waves_to: Annotated[float, Spec(Quantity.ANGLE, "mean direction that the waves travel to", -_TURN, _TURN)] = deg(
        45.0
    )
    spread: Annotated[float, Spec(Quantity.ANGLE, "standard deviation of the waves' directions", 0.0, _TURN)] = deg(
        20.0
    )
    way_period: Annotated[
        float, Spec(Quantity.TIME, "natural period of heave and surge; 0 follows the water", 0.0, 25.0)
    ] = 2.2
    way_damping: Annotated[float, Spec(Quantity.RATIO, "damping ratio of heave and surge", 0.05, 10.0)] = 1.0
    tilt_period: Annotated[
        float, Spec(Quantity.TIME, "natural period of pitch and roll; 0 follows the slope", 0.0, 25.0)
    ] = 3.0
    tilt_damping: Annotated[float, Spec(Quantity.RATIO, "damping ratio of pitch and roll", 0.05, 10.0)] = 0.4
    heading: Annotated[float, Spec(Quantity.ANGLE, "mean heading", -_TURN, _TURN)] = 0.0
    yaw_wander: Annotated[float, Spec(Quantity.ANGLE, "root mean square of the yaw about it", 0.0, _TURN)] = deg(10.0)

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Responses to one drawn sea."""
        sea = self.sea(rng)
        follow = oscillator(sea.omega, period=self.way_period, damping=self.way_damping)
        tilt = oscillator(sea.omega, period=self.tilt_period, damping=self.tilt_damping)
        north, east = (sea.slope_ne * tilt[:, np.newaxis]).T
        rising_ahead = north * math.cos(self.heading) + east * math.sin(self.heading)
        rising_right = east * math.cos(self.heading) - north * math.sin(self.heading)
        tilts = signals.Sinusoids.from_phasors(sea.omega, np.stack((0.0 * north, rising_ahead, -rising_right), axis=-1))
        way = signals.Sinusoids.from_phasors(sea.omega, sea.displacement_ned * follow[:, np.newaxis])
        return EulerMotion(Frame.NED, tilts + self._yaw(rng), way)

    def sea(self, rng: np.random.Generator) -> Sea:
        """One drawn sea."""
        return draw_sea(
            height=self.height, period=self.period, peakedness=self.peakedness, direction=self.waves_to,
            spread=self.spread, rng=rng,
        )  # fmt: skip

    def _yaw(self, rng: np.random.Generator) -> signals.Signal:
        """Yaw about the mean heading in five slow sinusoids of periods 40 to 200 s."""
        omega = 2.0 * np.pi / rng.uniform(40.0, 200.0, 5)
        phasors = self.yaw_wander * math.sqrt(2.0 / 5.0) * signals.random_phases(5, rng)
        wander = signals.Sinusoids.from_phasors(omega, phasors[:, np.newaxis] * np.array([1.0, 0.0, 0.0]))
        return signals.constant((self.heading, 0.0, 0.0)) + wander


@dataclass(frozen=True, kw_only=True)
class Rod(Scenario):
    """Sensors at the top of a rigid rod that is moved by hand about its foot, vibrating later on [Li2012]."""

    lasts: ClassVar[float] = 600.0

    roll_limit: Annotated[float, Spec(Quantity.ANGLE, "largest roll", 0.0, deg(80.0))] = deg(20.0)
    pitch_limit: Annotated[float, Spec(Quantity.ANGLE, "largest pitch", 0.0, deg(80.0))] = deg(15.0)
    fastest: Annotated[float, Spec(Quantity.TIME, "shortest duration of a move", 0.1, 100.0)] = 1.5
    slowest: Annotated[float, Spec(Quantity.TIME, "longest duration of a move", 0.1, 100.0)] = 4.0
    pause: Annotated[float, Spec(Quantity.TIME, "longest rest between moves", 0.0, 100.0)] = 2.0
    lever: Annotated[float, Spec(Quantity.LENGTH, "height of the sensors over the foot", 0.0, 10.0)] = 0.5
    vibration: Annotated[float, Spec(Quantity.ACCELERATION, "root mean square along each axis", 0.0, g(10.0))] = g(0.08)
    vibration_low: Annotated[float, Spec(Quantity.FREQUENCY, "lowest frequency of the vibration", 0.1, 1e3)] = 3.0
    vibration_high: Annotated[float, Spec(Quantity.FREQUENCY, "highest frequency of the vibration", 0.1, 1e3)] = 20.0
    vibration_start: Annotated[float, Spec(Quantity.TIME, "when the vibration begins; it grows over 2 s", 0.0, 1e6)] = (
        400.0
    )
    lead: Annotated[float, Spec(Quantity.TIME, "rest before the first move", 0.0, 1e4)] = 5.0
    heading: Annotated[float, Spec(Quantity.ANGLE, "heading", -_TURN, _TURN)] = 0.0

    def __post_init__(self) -> None:
        """Check every parameter's domain, and that ranges are not empty."""
        super().__post_init__()
        for low, high in (("fastest", "slowest"), ("vibration_low", "vibration_high")):
            if not getattr(self, low) <= getattr(self, high):
                raise ParameterError(f"{low} must not exceed {high}.")

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Moves between random tilts, at random paces, with random rests."""
        vibration = self._vibration(rng)
        chance = rng.random((math.ceil(duration / self.fastest) + 1, 4))
        time = self.fastest + (self.slowest - self.fastest) * chance[:, 0]
        cycle = time + self.pause * chance[:, 1]
        start = self.lead + np.cumsum(cycle) - cycle
        targets = (2.0 * chance[:, 2:] - 1.0) * (self.pitch_limit, self.roll_limit)
        tilts = np.column_stack((np.zeros(time.size), np.diff(targets, axis=0, prepend=np.zeros((1, 2)))))
        angles = signals.Moves(start, time, tilts) + signals.constant((self.heading, 0.0, 0.0))
        return EulerMotion(Frame.NED, angles, vibration, lever_b=(0.0, 0.0, -self.lever))

    def _vibration(self, rng: np.random.Generator) -> signals.Signal:
        """Forty sinusoids along each axis, equally strong in acceleration."""
        edges = np.linspace(self.vibration_low, self.vibration_high, 41)
        omega = 2.0 * np.pi * rng.uniform(edges[:-1], edges[1:])
        way = self.vibration * math.sqrt(2.0 / omega.size) / omega**2
        phasors = way[:, np.newaxis] * signals.random_phases((omega.size, 3), rng)
        growth = signals.Moves((self.vibration_start,), (2.0,), (1.0,))
        return signals.Windowed(signals.Sinusoids.from_phasors(omega, phasors), growth)


@dataclass(frozen=True, kw_only=True)
class Fin(Scenario):
    """Bionic fin: it swings about the vertical and twists about its own length, a quarter period apart [Ou2017].

    Both angles count from where they stand at the start, so the twist runs from 0 to twice its amplitude. Swing and
    twist do not commute: the integral of a rate is not an angle.
    """

    rate: ClassVar[float] = 500.0
    lasts: ClassVar[float] = 220.0

    swing: Annotated[float, Spec(Quantity.ANGLE, "amplitude of the heading", 0.0, deg(170.0))] = deg(30.0)
    twist: Annotated[float, Spec(Quantity.ANGLE, "amplitude of the roll", 0.0, deg(170.0))] = deg(20.0)
    frequency: Annotated[float, Spec(Quantity.FREQUENCY, "of both", 0.001, 50.0)] = 0.5
    lag: Annotated[float, Spec(Quantity.ANGLE, "of the twist behind the swing", -_TURN, _TURN)] = deg(90.0)

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Two sinusoids."""
        swing = signals.sinusoid(self.swing, self.frequency)
        twist = signals.sinusoid(self.twist, self.frequency, -self.lag) + signals.constant(
            self.twist * math.sin(self.lag)
        )
        return EulerMotion(Frame.NED, signals.Stack((swing, _REST, twist)))


@dataclass(frozen=True, kw_only=True)
class Arm(Scenario):
    """Teaching arm: level, it turns about the vertical at a constant rate from first to last [HuangJiang]."""

    rate: ClassVar[float] = 10.0

    turn: Annotated[float, Spec(Quantity.ANGLE, "of the heading, clockwise from above", -100 * _TURN, 100 * _TURN)] = (
        deg(-90.0)
    )
    time: Annotated[float, Spec(Quantity.TIME, "time that the turn takes", 0.1, 1e4)] = 30.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Heading that is a line."""
        return EulerMotion(Frame.NED, signals.Stack((signals.Polynomial((0.0, self.turn / self.time)), _REST, _REST)))


@dataclass(frozen=True, kw_only=True)
class Coning(Scenario):
    """Classical coning motion, where the wrong order of turning shows most."""

    half_angle: Annotated[float, Spec(Quantity.ANGLE, "between the body's z axis and the cone's", 0.0, deg(170.0))] = (
        deg(10.0)
    )
    frequency: Annotated[float, Spec(Quantity.FREQUENCY, "turns round the cone per second", 0.001, 100.0)] = 1.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Closed form."""
        return ConingMotion(Frame.NED, self.half_angle, 2.0 * math.pi * self.frequency)


SCENARIOS: Mapping[str, type[Scenario]] = {
    "static": Static,
    "turntable": Turntable,
    "ball": Ball,
    "ratetable": RateTable,
    "slide": Slide,
    "buoy": Buoy,
    "rod": Rod,
    "fin": Fin,
    "arm": Arm,
    "coning": Coning,
    "faces": Faces,
    "raise": Raise,
    "bands": Bands,
    "poses": Poses,
    "tumble": Tumble,
    "sway": Sway,
    "levelring": LevelRing,
    "stops": Stops,
    "cone": Cone,
    "table36": Table36,
}
"""Every scenario by name."""


def scenario(name: str, **parameters: float | str) -> Scenario:
    """Scenario of that name, with some of its parameters set.

    Parameters
    ----------
    name : str
        One of `SCENARIOS`.
    **parameters : float or str
        By name: a number in the parameter's unit, or text with a unit, such as ``"60 deg/s"``.

    Raises
    ------
    ParameterError
        If the name or a parameter is unknown, a value is outside its domain, or a text has not the unit that it needs.
    """
    if name not in SCENARIOS:
        from plumbob.simulation.programs import PROGRAMS

        hint = f" It is what a chain does: --chain arm, or plumbob.simulate_chain('arm', '{name}')."
        raise unknown_name("scenario", name, SCENARIOS, hint=hint if name in PROGRAMS else "")
    return build(SCENARIOS[name], parameters, of=name)
