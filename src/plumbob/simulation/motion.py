"""Truth: attitude, rate, position and acceleration of a body as functions of time, exact to rounding.

The body's axes follow the navigation frame: x forward and z up (forward-left-up) in ENU and NWU, x forward and z down
(forward-right-down) in NED. `Truth.in_frame` gives the same physical motion in another frame, body axes included.

Not modelled: the rotation of the Earth and the curvature of its surface. Gravity is the standard G0 everywhere.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob import rotations
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.params import checked, describe, shown
from plumbob.rotations import Frame
from plumbob.simulation.signals import Jet, Signal, constant, quintic

_UPSIDE_DOWN = np.array([0.0, 1.0, 0.0, 0.0])  # half a turn about x: forward-left-up to forward-right-down and back


@dataclass(frozen=True, eq=False)
class Truth:
    """State of a moving body at N instants.

    Attributes
    ----------
    t : ndarray (N,)
        Time, s.
    frame : Frame
        Navigation frame n.
    q_nb : ndarray (N, 4)
        Attitude.
    rate_b, rate_dot_b : ndarray (N, 3)
        Angular rate in body axes, rad/s, and its derivative, rad/s².
    pos_n, vel_n, acc_n : ndarray (N, 3)
        Position, m, velocity, m/s, and acceleration, m/s², of the body's reference point.
    """

    t: Floats
    frame: Frame
    q_nb: Floats
    rate_b: Floats
    rate_dot_b: Floats
    pos_n: Floats
    vel_n: Floats
    acc_n: Floats

    def rows(self, which: NDArray[np.bool_]) -> Self:
        """State at the instants that are marked, of (N,)."""
        arrays = (self.q_nb, self.rate_b, self.rate_dot_b, self.pos_n, self.vel_n, self.acc_n)
        return type(self)(self.t[which], self.frame, *(a[which] for a in arrays))

    def in_body(self, v_n: ArrayLike) -> Floats:
        """Vectors (3,) or (N, 3) of the navigation frame, in body axes (N, 3)."""
        return rotations.quat_rotate(rotations.quat_conjugate(self.q_nb), v_n)

    @property
    def specific_force_b(self) -> Floats:
        """What an ideal accelerometer at the reference point measures, (N, 3), m/s²: up, +g, at rest."""
        gravity_n = -G0 * self.frame.up
        return self.in_body(self.acc_n - gravity_n)

    def at_lever(self, lever_b: ArrayLike) -> Self:
        """State of another point of the body, at lever_b (3,) from the reference point in body axes, m."""
        r = np.broadcast_to(np.asarray(lever_b, dtype=np.float64), self.rate_b.shape)
        swing = np.cross(self.rate_b, r)
        pull = np.cross(self.rate_dot_b, r) + np.cross(self.rate_b, swing)
        return type(self)(
            self.t,
            self.frame,
            self.q_nb,
            self.rate_b,
            self.rate_dot_b,
            self.pos_n + rotations.quat_rotate(self.q_nb, r),
            self.vel_n + rotations.quat_rotate(self.q_nb, swing),
            self.acc_n + rotations.quat_rotate(self.q_nb, pull),
        )

    def at_moving(self, r: Jet) -> Self:
        """State of a point that moves on the body, at r (N, 3) with its derivatives, body axes, m; axes stay."""
        swing = np.cross(self.rate_b, r.value)
        pull = np.cross(self.rate_dot_b, r.value) + np.cross(self.rate_b, swing + 2.0 * r.rate) + r.acc
        return replace(
            self,
            pos_n=self.pos_n + rotations.quat_rotate(self.q_nb, r.value),
            vel_n=self.vel_n + rotations.quat_rotate(self.q_nb, swing + r.rate),
            acc_n=self.acc_n + rotations.quat_rotate(self.q_nb, pull),
        )

    def rotated(self, q_bs: ArrayLike) -> Self:
        """State in axes s that are fixed to the body, q_bs (4,)."""
        q, q_sb = np.asarray(q_bs, dtype=np.float64), rotations.quat_conjugate(q_bs)
        return replace(
            self,
            q_nb=rotations.quat_multiply(self.q_nb, q),
            rate_b=rotations.quat_rotate(q_sb, self.rate_b),
            rate_dot_b=rotations.quat_rotate(q_sb, self.rate_dot_b),
        )

    def hinged(self, axis: ArrayLike, angle: Jet) -> Self:
        """State of a part that turns about `axis` (3,), a unit vector of the body, by angle (N,), rad."""
        at, speed, acceleration = (part[:, np.newaxis] * np.asarray(axis, dtype=np.float64) for part in angle)
        turn = rotations.quat_from_rotvec(at)
        back = rotations.quat_conjugate(turn)
        carried = rotations.quat_rotate(back, self.rate_b)
        return replace(
            self,
            q_nb=rotations.quat_multiply(self.q_nb, turn),
            rate_b=carried + speed,
            rate_dot_b=rotations.quat_rotate(back, self.rate_dot_b) - np.cross(speed, carried) + acceleration,
        )

    def seen_from(self, frame: Frame) -> Self:
        """Describe the same motion of the same body axes in another navigation frame."""
        turn = rotations.frame_rotation(frame, self.frame)
        path = {name: rotations.quat_rotate(turn, getattr(self, name)) for name in ("pos_n", "vel_n", "acc_n")}
        return replace(self, frame=frame, q_nb=rotations.change_frame(self.q_nb, to=frame, from_=self.frame), **path)

    def in_frame(self, frame: Frame) -> Self:
        """Describe the same motion in another navigation frame, with the body axes that go with it."""
        if frame is self.frame:
            return self
        q_nb, turn = (
            rotations.change_frame(self.q_nb, to=frame, from_=self.frame),
            rotations.frame_rotation(frame, self.frame),
        )
        rate_b, rate_dot_b = self.rate_b, self.rate_dot_b
        if frame.up[2] != self.frame.up[2]:
            q_nb = rotations.quat_multiply(q_nb, _UPSIDE_DOWN)
            rate_b, rate_dot_b = (
                rotations.quat_rotate(_UPSIDE_DOWN, rate_b),
                rotations.quat_rotate(_UPSIDE_DOWN, rate_dot_b),
            )
        path = (rotations.quat_rotate(turn, v) for v in (self.pos_n, self.vel_n, self.acc_n))
        return type(self)(self.t, frame, q_nb, rate_b, rate_dot_b, *path)


def at_rest(t: Floats, frame: Frame, q_nb: ArrayLike = rotations.IDENTITY) -> Truth:
    """State of a body that stands still at the origin, at an attitude (4,)."""
    zero = np.zeros((t.size, 3))
    return Truth(t, frame, np.tile(np.asarray(q_nb, dtype=np.float64), (t.size, 1)), zero, zero, zero, zero, zero)


class Motion(Protocol):
    """Anything that can say its state at any instants t (N,), s."""

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s."""


@dataclass(frozen=True, eq=False)
class EulerMotion:
    """Motion given by ZYX Euler angles and a position.

    Parameters
    ----------
    frame : Frame
        Frame of both.
    angles : Signal with 3 components
        Yaw, pitch, roll, rad.
    position : Signal with 3 components
        Of the pivot, m.
    lever_b : (3,)
        From the pivot to the point whose motion is asked for, body axes, m.
    """

    frame: Frame
    angles: Signal
    position: Signal = field(default_factory=lambda: constant((0.0, 0.0, 0.0)))
    lever_b: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s."""
        angle, speed, acceleration = self.angles.jet(t)
        rate_b = rotations.body_rate_from_euler_zyx(angle, speed)
        rate_dot_b = rotations.body_rate_from_euler_zyx(angle, acceleration) + _turning_axes(angle, speed, rate_b)
        pivot = Truth(t, self.frame, rotations.quat_from_euler_zyx(angle), rate_b, rate_dot_b, *self.position.jet(t))
        return pivot.at_lever(self.lever_b) if any(self.lever_b) else pivot


@dataclass(frozen=True, eq=False)
class ConingMotion:
    """Classical coning: the rotation vector ``half_angle (cos Ωt, sin Ωt, 0)`` goes round once in 2π/Ω, at one place.

    Parameters
    ----------
    frame : Frame
        Navigation frame.
    half_angle : float
        Between the body's z axis and the cone's, rad.
    omega : float
        Ω, rad/s.
    """

    frame: Frame
    half_angle: float
    omega: float

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s."""
        a, w = self.half_angle, self.omega
        c, s, none = np.cos(w * t), np.sin(w * t), np.zeros_like(t)
        half = np.full_like(t, np.cos(0.5 * a))
        q_nb = np.stack((half, np.sin(0.5 * a) * c, np.sin(0.5 * a) * s, none), axis=-1)
        rate_b = np.stack((-w * np.sin(a) * s, w * np.sin(a) * c, none - w * (1.0 - np.cos(a))), axis=-1)
        rate_dot_b = -w * w * np.sin(a) * np.stack((c, s, none), axis=-1)
        zero = np.zeros((t.size, 3))
        return Truth(t, self.frame, q_nb, rate_b, rate_dot_b, zero, zero, zero)


def _turning_axes(angle: Floats, speed: Floats, rate_b: Floats) -> Floats:
    """Part of the angular acceleration that comes from the axes of yaw and pitch turning with the body, (N, 3)."""
    (_, pitch, roll), (dyaw, dpitch, droll) = np.moveaxis(angle, -1, 0), np.moveaxis(speed, -1, 0)
    nose = np.stack((np.cos(pitch), np.sin(roll) * np.sin(pitch), np.cos(roll) * np.sin(pitch)), axis=-1)
    roll_turns = np.stack((np.zeros_like(droll), droll * rate_b[:, 2], -droll * rate_b[:, 1]), axis=-1)
    return np.asarray(roll_turns - (dyaw * dpitch)[:, np.newaxis] * nose)


_AXES = np.eye(3)


@dataclass(frozen=True, eq=False)
class GimbalMotion:
    """Attitude ``q(axis₁, angle₁) ⊗ q(axis₂, angle₂) ⊗ …`` at one place: a table that stands aslant, or a hand.

    Parameters
    ----------
    frame : Frame
        Navigation frame, in which the first axis stands.
    gimbals : sequence of (int, Signal)
        From the outermost: which axis of the gimbal before it turns about, 0, 1 or 2 for x, y or z, and the angle, rad.
    """

    frame: Frame
    gimbals: Sequence[tuple[int, Signal]]

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s."""
        state = at_rest(t, self.frame)
        for axis, signal in self.gimbals:
            state = state.hinged(_AXES[axis], signal.jet(t))
        return state


@dataclass(frozen=True, eq=False)
class PoseMotion:
    """Poses one after the other, at one place; each move is the shortest turn, with the angle of least jerk.

    The axis of a move stands still in the body and in the navigation frame, so that rate and angular acceleration are
    the axis times the derivatives of the angle.

    Parameters
    ----------
    frame : Frame
        Navigation frame.
    poses : array_like (M, 4)
        Attitudes, M ≥ 1.
    dwell, move : float
        Time at rest in each pose, and of each move, s. The last pose is kept for ever.

    Raises
    ------
    ShapeError
        If there is no pose.
    ParameterError
        If a time is not positive.
    """

    frame: Frame
    poses: ArrayLike
    dwell: float
    move: float

    def __post_init__(self) -> None:
        """Validate poses and times."""
        if not len(check.rows("poses", self.poses, 4)):
            raise ShapeError("a motion from pose to pose needs at least one pose, but poses is empty.")
        if not (self.dwell > 0.0 and self.move > 0.0):
            raise ParameterError(f"dwell and move must be positive, but they are {self.dwell:g} and {self.move:g} s.")

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s."""
        poses = check.rows("poses", self.poses, 4)
        turns = rotations.rotvec_from_quat(
            rotations.quat_multiply(rotations.quat_conjugate(poses), np.concatenate((poses[1:], poses[-1:])))
        )
        cycle = self.dwell + self.move
        i = np.clip(np.floor(t / cycle), 0, len(poses) - 1).astype(np.intp)
        way, rate, acc = quintic(np.clip((t - i * cycle - self.dwell) / self.move, 0.0, 1.0))
        q_nb = rotations.quat_multiply(poses[i], rotations.quat_from_rotvec(way[:, np.newaxis] * turns[i]))
        rate_b = (rate / self.move)[:, np.newaxis] * turns[i]
        rate_dot_b = (acc / self.move**2)[:, np.newaxis] * turns[i]
        zero = np.zeros((t.size, 3))
        return Truth(t, self.frame, q_nb, rate_b, rate_dot_b, zero, zero, zero)


@dataclass(frozen=True, kw_only=True)
class Scenario(ABC):
    """A motion to simulate.

    Attributes
    ----------
    rate, lasts : float
        Sampling rate that suits it, Hz, and time that it takes where no parameter `time` says it, s.

    Raises
    ------
    ParameterError
        If a parameter is outside its domain.
    """

    rate: ClassVar[float] = 100.0
    lasts: ClassVar[float] = 60.0
    whole_number: ClassVar[str] = ""  # parameter that is a whole number

    def __post_init__(self) -> None:
        """Check every parameter's domain."""
        for p in describe(type(self)):
            value = checked(type(self).__name__.lower(), p, getattr(self, p.name))
            if p.name == self.whole_number and value != round(value):
                raise ParameterError(f"{p.name} must be a whole number, but it is {value:g}.")

    @property
    def description(self) -> str:
        """Name with its parameters, each in its unit."""
        values = (f"{p.name}={shown(p, getattr(self, p.name))}" for p in describe(type(self)))
        return f"{type(self).__name__.lower()} ({', '.join(values)})"

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        time: float = getattr(self, "time", self.lasts)
        return time

    @abstractmethod
    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Motion over the first `duration` s, with what is left to chance drawn from `rng`."""

    def field_n(self, body: Truth, earth_n: Floats) -> Floats:
        """Magnetic field at the body, (3,) or (N, 3), µT: the Earth's, where a scenario does not say otherwise."""
        return earth_n


Phasors = NDArray[np.complex128]

TRAINS = 64
"""Number of wave trains; one in each band of 0.05 peak frequencies, at random in it: their sum has no period."""

_BAND = (0.6, 4.0)  # peak frequencies: below lies 1e-4 of the energy, above waves shorter than a buoy's response


@dataclass(frozen=True, eq=False)
class Sea:
    """Wave trains ``η = Re Σ phasor[i] exp(j omega[i] t)``: of the surface's height, m, and angular frequencies, rad/s.

    `direction` (m,): where each train travels to, rad from North over East.
    """

    omega: Floats
    phasor: Phasors
    direction: Floats

    @property
    def displacement_ned(self) -> Phasors:
        """Phasors (m, 3) of a water particle's way north, east and down, m: circles, forward on the crest."""
        forward = -1j * self.phasor
        return np.stack((forward * np.cos(self.direction), forward * np.sin(self.direction), -self.phasor), axis=-1)

    @property
    def slope_ne(self) -> Phasors:
        """Phasors (m, 2) of the surface's slope to the north and to the east, rad."""
        wavenumber = self.omega**2 / G0  # deep water
        steepness = -1j * wavenumber * self.phasor
        return np.stack((steepness * np.cos(self.direction), steepness * np.sin(self.direction)), axis=-1)


def jonswap(frequency: Floats, *, peak: float, peakedness: float) -> Floats:
    """Shape of the JONSWAP spectrum [Hasselmann1973] at frequencies (m,), Hz, not scaled, with its peak at one of them.

    Peakedness γ 1 is Pierson and Moskowitz's.
    """
    f = frequency / peak
    width = np.where(f < 1.0, 0.07, 0.09)
    # [Hasselmann1973]
    return np.asarray(f**-5 * np.exp(-1.25 * f**-4) * peakedness ** np.exp(-((f - 1.0) ** 2) / (2.0 * width**2)))


def draw_sea(
    *, height: float, period: float, peakedness: float, direction: float, spread: float, rng: np.random.Generator
) -> Sea:
    """Draw wave trains of a spectrum: one in each band, at a random frequency, phase and direction.

    `height`: significant, Hs, four times the standard deviation of the elevation, m; `period`: of the spectrum's peak,
    s; `peakedness`: γ of `jonswap`; `direction`, `spread`: mean direction that the waves travel to, rad from North over
    East, and standard deviation of the trains' directions, rad.
    """
    edges = np.linspace(*_BAND, TRAINS + 1) / period
    chance, phase, turn = rng.random(TRAINS), 2.0 * np.pi * rng.random(TRAINS), rng.standard_normal(TRAINS)
    frequency = edges[:-1] + chance * np.diff(edges)
    amplitude = np.sqrt(jonswap(frequency, peak=1.0 / period, peakedness=peakedness))
    amplitude *= height / 4.0 / np.sqrt(0.5 * np.sum(amplitude**2))
    return Sea(2.0 * np.pi * frequency, amplitude * np.exp(-1j * phase), direction + spread * turn)


def oscillator(omega: Floats, *, period: float, damping: float) -> Phasors:
    """Response (m,) of a damped oscillator of that natural period, s, to a forcing; 1 where it follows, period 0."""
    ratio = omega * period / (2.0 * np.pi)
    return np.asarray(1.0 / (1.0 - ratio**2 + 2j * damping * ratio))
