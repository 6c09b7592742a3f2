"""Scenarios: named motions with a few parameters, each a small frozen class.

Parameters are in SI and radians. Every one carries its unit, its domain and its meaning; `parameters_of` lists them.
Headings count from true North over East; pitch is nose up, roll is right side down, in every navigation frame.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, NamedTuple

import numpy as np

from plumbob.errors import ParameterError
from plumbob.rotations import Frame
from plumbob.sim.motion import ConingMotion, EulerMotion, Motion
from plumbob.sim.signals import (
    Moves,
    Piecewise,
    Polynomial,
    Signal,
    Sinusoids,
    Stack,
    Windowed,
    constant,
    cycloid,
    sinusoid,
)
from plumbob.sim.waves import draw_sea, oscillator
from plumbob.units import Quantity, deg, dps, g, parse

_REST = constant(0.0)
_TURN = math.pi


class Parameter(NamedTuple):
    """One parameter of a scenario: default and domain are in `unit`, limits included."""

    name: str
    default: float
    unit: Quantity
    low: float
    high: float
    meaning: str


def _given(default: float, unit: Quantity, low: float, high: float, meaning: str) -> Any:
    return field(default=default, metadata={"unit": unit, "low": low, "high": high, "meaning": meaning})


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A motion to simulate.

    Attributes
    ----------
    rate : float
        Sampling rate that suits it, Hz.

    Raises
    ------
    ParameterError
        If a parameter is outside its domain.
    """

    rate: ClassVar[float] = 100.0

    def __post_init__(self) -> None:
        """Check every parameter's domain."""
        for f in fields(self):
            value, low, high = getattr(self, f.name), f.metadata["low"], f.metadata["high"]
            if isinstance(value, bool) or not (isinstance(value, (int, float)) and low <= value <= high):
                unit = f.metadata["unit"]
                raise ParameterError(f"{f.name} must be {low:g} to {high:g} {unit}, but it is {value!r}.")

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return 60.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Motion over the first `duration` s, with what is left to chance drawn from `rng`."""
        raise NotImplementedError


def parameters_of(scenario: type[Scenario]) -> tuple[Parameter, ...]:
    """Parameters that a scenario takes."""
    defaults = scenario()
    return tuple(Parameter(f.name, getattr(defaults, f.name), **f.metadata) for f in fields(scenario))


@dataclass(frozen=True, kw_only=True)
class Static(Scenario):
    """At rest, level or tilted: noise, turn-on bias, initial attitude."""

    heading: float = _given(0.0, Quantity.ANGLE, -_TURN, _TURN, "heading")
    pitch: float = _given(0.0, Quantity.ANGLE, -0.5 * _TURN, 0.5 * _TURN, "nose up")
    roll: float = _given(0.0, Quantity.ANGLE, -_TURN, _TURN, "right side down")

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Motion that is none."""
        return EulerMotion(Frame.NED, constant((self.heading, self.pitch, self.roll)))


@dataclass(frozen=True, kw_only=True)
class Turntable(Scenario):
    """Rate table: spins up at a constant angular acceleration about the vertical, then holds its rate [Chen2013]."""

    rate: ClassVar[float] = 10.0

    peak_rate: float = _given(
        dps(60.0), Quantity.RATE, dps(0.01), dps(2000.0), "rate that is held, clockwise from above"
    )
    spin_up: float = _given(100.0, Quantity.TIME, 0.1, 1e4, "time from rest to the rate that is held")
    hold: float = _given(100.0, Quantity.TIME, 0.0, 1e5, "time that the rate is held")
    radius: float = _given(0.0, Quantity.LENGTH, 0.0, 10.0, "distance of the sensors behind the axis")

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return self.spin_up + self.hold

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Heading that is a parabola and then a line."""
        start = Polynomial((0.0, 0.0, 0.5 * self.peak_rate / self.spin_up))
        held = Polynomial((-0.5 * self.peak_rate * self.spin_up, self.peak_rate))
        heading = Piecewise((0.0, self.spin_up), (_REST, start, held))
        return EulerMotion(Frame.NED, Stack((heading, _REST, _REST)), lever_b=(-self.radius, 0.0, 0.0))


@dataclass(frozen=True, kw_only=True)
class Slide(Scenario):
    """Slid to and fro over a level table, obliquely to its axes: acceleration without any tilt [Yu2018]."""

    peak_speed: float = _given(2.0, Quantity.SPEED, 0.01, 20.0, "highest speed of a stroke")
    stroke: float = _given(0.4, Quantity.TIME, 0.05, 60.0, "duration of a stroke")
    pause: float = _given(0.4, Quantity.TIME, 0.0, 60.0, "rest between strokes")
    strokes: float = _given(20, Quantity.RATIO, 1, 1e4, "number of strokes, a whole number")
    direction: float = _given(
        deg(50.0), Quantity.ANGLE, -_TURN, _TURN, "of the first stroke, from forward to the right"
    )
    heading: float = _given(0.0, Quantity.ANGLE, -_TURN, _TURN, "heading")
    lead: float = _given(10.0, Quantity.TIME, 0.0, 1e4, "rest before the first stroke and after the last")

    def __post_init__(self) -> None:
        """Check every parameter's domain, and that strokes can be counted."""
        super().__post_init__()
        if self.strokes != round(self.strokes):
            raise ParameterError(f"strokes must be a whole number, but it is {self.strokes:g}.")

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
        way = Moves(
            start=self.lead + i * (self.stroke + self.pause),
            duration=np.full(i.size, self.stroke),
            change=np.outer(length * (-1.0) ** i, ahead),
            law=cycloid,
        )
        return EulerMotion(Frame.NED, constant((self.heading, 0.0, 0.0)), way)


@dataclass(frozen=True, kw_only=True)
class Buoy(Scenario):
    """Small moored buoy in a random sea of a JONSWAP spectrum [Hasselmann1973].

    The buoy moves with the water and tilts with the surface, each through a damped oscillator: long waves it follows,
    short ones pass it. Tilt and way therefore do not cancel, and an accelerometer alone is wrong by degrees. Yaw
    wanders by itself; pitch and roll follow the slopes along and across the mean heading.
    """

    height: float = _given(1.5, Quantity.LENGTH, 0.0, 20.0, "significant wave height Hs")
    period: float = _given(6.0, Quantity.TIME, 1.0, 25.0, "period Tp of the spectrum's peak")
    peakedness: float = _given(1.0, Quantity.RATIO, 1.0, 10.0, "γ of the spectrum; 1 is Pierson and Moskowitz's")
    waves_to: float = _given(deg(45.0), Quantity.ANGLE, -_TURN, _TURN, "mean direction that the waves travel to")
    spread: float = _given(deg(20.0), Quantity.ANGLE, 0.0, _TURN, "standard deviation of the waves' directions")
    way_period: float = _given(2.2, Quantity.TIME, 0.0, 25.0, "natural period of heave and surge; 0 follows the water")
    way_damping: float = _given(1.0, Quantity.RATIO, 0.05, 10.0, "damping ratio of heave and surge")
    tilt_period: float = _given(3.0, Quantity.TIME, 0.0, 25.0, "natural period of pitch and roll; 0 follows the slope")
    tilt_damping: float = _given(0.4, Quantity.RATIO, 0.05, 10.0, "damping ratio of pitch and roll")
    heading: float = _given(0.0, Quantity.ANGLE, -_TURN, _TURN, "mean heading")
    yaw_wander: float = _given(deg(10.0), Quantity.ANGLE, 0.0, _TURN, "root mean square of the yaw about it")

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return 600.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Responses to one drawn sea."""
        sea = draw_sea(
            height=self.height,
            period=self.period,
            peakedness=self.peakedness,
            direction=self.waves_to,
            spread=self.spread,
            rng=rng,
        )
        follow = oscillator(sea.omega, period=self.way_period, damping=self.way_damping)
        tilt = oscillator(sea.omega, period=self.tilt_period, damping=self.tilt_damping)
        north, east = (sea.slope_ne * tilt[:, np.newaxis]).T
        rising_ahead = north * math.cos(self.heading) + east * math.sin(self.heading)
        rising_right = east * math.cos(self.heading) - north * math.sin(self.heading)
        tilts = Sinusoids.from_phasors(sea.omega, np.stack((0.0 * north, rising_ahead, -rising_right), axis=-1))
        way = Sinusoids.from_phasors(sea.omega, sea.displacement_ned * follow[:, np.newaxis])
        return EulerMotion(Frame.NED, tilts + self._yaw(rng), way)

    def _yaw(self, rng: np.random.Generator) -> Signal:
        """Yaw about the mean heading in five slow sinusoids of periods 40 to 200 s."""
        omega = 2.0 * np.pi / rng.uniform(40.0, 200.0, 5)
        phasors = self.yaw_wander * math.sqrt(2.0 / 5.0) * np.exp(2j * np.pi * rng.random(5))
        wander = Sinusoids.from_phasors(omega, phasors[:, np.newaxis] * np.array([1.0, 0.0, 0.0]))
        return constant((self.heading, 0.0, 0.0)) + wander


@dataclass(frozen=True, kw_only=True)
class Rod(Scenario):
    """Sensors at the top of a rigid rod that is moved by hand about its foot, vibrating later on [Li2012]."""

    roll_limit: float = _given(deg(20.0), Quantity.ANGLE, 0.0, deg(80.0), "largest roll")
    pitch_limit: float = _given(deg(15.0), Quantity.ANGLE, 0.0, deg(80.0), "largest pitch")
    fastest: float = _given(1.5, Quantity.TIME, 0.1, 100.0, "shortest duration of a move")
    slowest: float = _given(4.0, Quantity.TIME, 0.1, 100.0, "longest duration of a move")
    pause: float = _given(2.0, Quantity.TIME, 0.0, 100.0, "longest rest between moves")
    lever: float = _given(0.5, Quantity.LENGTH, 0.0, 10.0, "height of the sensors over the foot")
    vibration: float = _given(g(0.08), Quantity.ACCELERATION, 0.0, g(10.0), "root mean square along each axis")
    vibration_low: float = _given(3.0, Quantity.FREQUENCY, 0.1, 1e3, "lowest frequency of the vibration")
    vibration_high: float = _given(20.0, Quantity.FREQUENCY, 0.1, 1e3, "highest frequency of the vibration")
    vibration_start: float = _given(400.0, Quantity.TIME, 0.0, 1e6, "when the vibration begins; it grows over 2 s")
    lead: float = _given(5.0, Quantity.TIME, 0.0, 1e4, "rest before the first move")
    heading: float = _given(0.0, Quantity.ANGLE, -_TURN, _TURN, "heading")

    def __post_init__(self) -> None:
        """Check every parameter's domain, and that ranges are not empty."""
        super().__post_init__()
        for low, high in (("fastest", "slowest"), ("vibration_low", "vibration_high")):
            if not getattr(self, low) <= getattr(self, high):
                raise ParameterError(f"{low} must not exceed {high}.")

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return 600.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Moves between random tilts, at random paces, with random rests."""
        vibration = self._vibration(rng)
        chance = rng.random((math.ceil(duration / self.fastest) + 1, 4))
        time = self.fastest + (self.slowest - self.fastest) * chance[:, 0]
        cycle = time + self.pause * chance[:, 1]
        start = self.lead + np.cumsum(cycle) - cycle
        targets = (2.0 * chance[:, 2:] - 1.0) * (self.pitch_limit, self.roll_limit)
        tilts = np.column_stack((np.zeros(time.size), np.diff(targets, axis=0, prepend=np.zeros((1, 2)))))
        angles = Moves(start, time, tilts) + constant((self.heading, 0.0, 0.0))
        return EulerMotion(Frame.NED, angles, vibration, lever_b=(0.0, 0.0, -self.lever))

    def _vibration(self, rng: np.random.Generator) -> Signal:
        """Forty sinusoids along each axis, equally strong in acceleration."""
        edges = np.linspace(self.vibration_low, self.vibration_high, 41)
        omega = 2.0 * np.pi * rng.uniform(edges[:-1], edges[1:])
        way = self.vibration * math.sqrt(2.0 / omega.size) / omega**2
        phasors = way[:, np.newaxis] * np.exp(2j * np.pi * rng.random((omega.size, 3)))
        growth = Moves((self.vibration_start,), (2.0,), (1.0,))
        return Windowed(Sinusoids.from_phasors(omega, phasors), growth)


@dataclass(frozen=True, kw_only=True)
class Fin(Scenario):
    """Bionic fin: it swings about the vertical and twists about its own length, a quarter period apart [Ou2017].

    Both angles count from where they stand at the start, so the twist runs from 0 to twice its amplitude. Swing and
    twist do not commute: the integral of a rate is no angle.
    """

    rate: ClassVar[float] = 500.0

    swing: float = _given(deg(30.0), Quantity.ANGLE, 0.0, deg(170.0), "amplitude of the heading")
    twist: float = _given(deg(20.0), Quantity.ANGLE, 0.0, deg(170.0), "amplitude of the roll")
    frequency: float = _given(0.5, Quantity.FREQUENCY, 0.001, 50.0, "of both")
    lag: float = _given(deg(90.0), Quantity.ANGLE, -_TURN, _TURN, "of the twist behind the swing")

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return 220.0

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Two sinusoids."""
        swing = sinusoid(self.swing, self.frequency)
        twist = sinusoid(self.twist, self.frequency, -self.lag) + constant(self.twist * math.sin(self.lag))
        return EulerMotion(Frame.NED, Stack((swing, _REST, twist)))


@dataclass(frozen=True, kw_only=True)
class Coning(Scenario):
    """Classical coning motion, where the wrong order of turning shows most."""

    half_angle: float = _given(deg(10.0), Quantity.ANGLE, 0.0, deg(170.0), "between the body's z axis and the cone's")
    frequency: float = _given(1.0, Quantity.FREQUENCY, 0.001, 100.0, "turns round the cone per second")

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Closed form."""
        return ConingMotion(Frame.NED, self.half_angle, 2.0 * math.pi * self.frequency)


SCENARIOS: Mapping[str, type[Scenario]] = {
    "static": Static,
    "turntable": Turntable,
    "slide": Slide,
    "buoy": Buoy,
    "rod": Rod,
    "fin": Fin,
    "coning": Coning,
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
        If the name or a parameter is unknown, or a value is outside its domain.
    UnitError
        If a text has no unit where it needs one, or a wrong one.
    """
    if name not in SCENARIOS:
        raise ParameterError(f"'{name}' is no scenario; known are {', '.join(SCENARIOS)}.")
    units = {p.name: p.unit for p in parameters_of(SCENARIOS[name])}
    if unknown := [p for p in parameters if p not in units]:
        raise ParameterError(f"scenario '{name}' has no parameter '{unknown[0]}'; known are {', '.join(units)}.")
    values = {p: parse(value, units[p]) if isinstance(value, str) else value for p, value in parameters.items()}
    return SCENARIOS[name](**values)
