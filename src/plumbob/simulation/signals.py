"""Functions of time that know their first and second derivative exactly, and the Earth's field as one vector.

A signal is scalar, value ``(N,)`` at N instants, or has components on a last axis, value ``(N, k)``. Signals add, scale
and multiply; whatever is built of them keeps exact derivatives, so that a simulated rate never comes from differences.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.rotations import Frame


def earth_field(frame: Frame, *, strength: float, dip: float, declination: float) -> Floats:
    """Magnetic flux density of the Earth in a navigation frame, (3,), µT.

    Parameters
    ----------
    frame : Frame
        Navigation frame.
    strength : float
        Total flux density, µT.
    dip : float
        Angle below the horizontal, rad: positive down, as in the northern hemisphere.
    declination : float
        Angle of magnetic North from true North, rad: positive to the east.

    Raises
    ------
    ParameterError
        If the strength is not positive, or an angle is impossible.
    """
    if not (0.0 < strength < math.inf and abs(dip) <= 0.5 * math.pi and abs(declination) <= math.pi):
        raise ParameterError(
            f"the Earth's field needs strength > 0 µT, |dip| ≤ π/2 and |declination| ≤ π, "
            f"but got {strength:g} µT, {dip:g} rad and {declination:g} rad."
        )
    magnetic_north = math.cos(declination) * frame.north + math.sin(declination) * frame.east
    return np.asarray(strength * (math.cos(dip) * magnetic_north - math.sin(dip) * frame.up))


_ROWS = 4096  # instants evaluated at once: sines of many frequencies then stay in the processor's cache


class Jet(NamedTuple):
    """A function's value and its first two time derivatives, each (N,) or (N, k)."""

    value: Floats
    rate: Floats
    acc: Floats


class Signal(ABC):
    """A function of time; `jet` evaluates it."""

    @abstractmethod
    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""

    def __add__(self, other: "Signal") -> "Signal":
        return Sum((self, other))

    def __mul__(self, factor: float) -> "Signal":
        return Linear(self, partial(np.multiply, factor))

    __rmul__ = __mul__


@dataclass(frozen=True, eq=False)
class Polynomial(Signal):
    """``c[0] + c[1] t + c[2] t² + …``."""

    coefficients: ArrayLike  # (n,) or (n, k), ascending, in units per s to their power

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        powers = np.polynomial.polynomial
        c = check.floats("coefficients", self.coefficients)
        jet = (powers.polyval(t, derivative) for derivative in (c, powers.polyder(c), powers.polyder(c, 2)))
        return Jet(*(np.asarray(part.T, dtype=np.float64) for part in jet))


def constant(value: ArrayLike) -> Polynomial:
    """Signal that stays at `value`, a number or (k,)."""
    return Polynomial(np.asarray(value, dtype=np.float64)[np.newaxis])


def random_phases(shape: int | tuple[int, ...], rng: np.random.Generator) -> NDArray[np.complex128]:
    """Phasors of size 1 at any phase."""
    return np.asarray(np.exp(2j * np.pi * rng.random(shape)), dtype=np.complex128)


@dataclass(frozen=True, eq=False)
class Sinusoids(Signal):
    """Sum of sinusoids, ``Σ cosine[i] cos(omega[i] t) + sine[i] sin(omega[i] t)``, of angular frequencies (m,), rad/s.

    The amplitudes `cosine` and `sine` are (m,) or (m, k).
    """

    omega: Floats
    cosine: Floats
    sine: Floats

    @classmethod
    def from_phasors(cls, omega: Floats, phasors: NDArray[np.complex128]) -> Self:
        """Real part of ``Σ phasors[i] exp(j omega[i] t)``."""
        return cls(omega, np.ascontiguousarray(phasors.real), np.ascontiguousarray(-phasors.imag))

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        weights = self._weights()
        out = np.empty((t.size, weights.shape[1]))
        for start in range(0, t.size, _ROWS):
            phase = np.outer(t[start : start + _ROWS], self.omega)
            out[start : start + _ROWS] = np.hstack((np.cos(phase), np.sin(phase))) @ weights
        shape = (t.size, *self.cosine.shape[1:])
        value, rate, acc = (np.ascontiguousarray(part).reshape(shape) for part in np.hsplit(out, 3))
        return Jet(value, rate, acc)

    def _weights(self) -> Floats:
        """Weights (2 m, 3 k) of cosines and sines in value, rate and acceleration."""
        a, b = (x.reshape(self.omega.size, -1) for x in (self.cosine, self.sine))
        w = self.omega[:, np.newaxis]
        return np.block([[a, w * b, -w * w * a], [b, -w * a, -w * w * b]])


def sinusoid(amplitude: float, frequency: float, phase: float = 0.0) -> Sinusoids:
    """``amplitude · sin(2π frequency t + phase)``; frequency in Hz, phase in rad."""
    unit = np.ones(1)
    return Sinusoids(2.0 * np.pi * frequency * unit, amplitude * np.sin(phase) * unit, amplitude * np.cos(phase) * unit)


Law = Callable[[Floats], Jet]  # way from 0 to 1 over u in [0, 1] that starts and ends with rate and acceleration 0


def quintic(u: Floats) -> Jet:
    """Law of least jerk, ``10u³ − 15u⁴ + 6u⁵`` [Flash1985]."""
    v = 1.0 - u
    return Jet(u**3 * (10.0 - 15.0 * u + 6.0 * u * u), 30.0 * u * u * v * v, 60.0 * u * v * (v - u))  # [Flash1985]


def cycloid(u: Floats) -> Jet:
    """Law of a slide pushed with a sinusoidal acceleration: its rate is ``1 − cos(2πu)``."""
    turn = 2.0 * np.pi
    return Jet(u - np.sin(turn * u) / turn, 1.0 - np.cos(turn * u), turn * np.sin(turn * u))


@dataclass(frozen=True, eq=False)
class Moves(Signal):
    """Moves from rest to rest, one after the other, at rest in between; twice continuously differentiable."""

    start: ArrayLike  # when each move begins (m,), s; moves do not overlap
    duration: ArrayLike  # (m,), s
    change: ArrayLike  # what each adds to the value (m,) or (m, k), which is 0 before the first
    law: Law = quintic  # or `cycloid`

    def __post_init__(self) -> None:
        """Validate the sequence."""
        start, duration = check.column("start", self.start), check.column("duration", self.duration)
        if not (duration > 0.0).all() or (start[1:] < start[:-1] + duration[:-1] - 1e-9).any():
            raise ParameterError("moves need a positive duration each and must not overlap.")

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        start, duration = check.floats("start", self.start), check.floats("duration", self.duration)
        change = check.floats("change", self.change)
        before = np.cumsum(change, axis=0) - change
        i = np.maximum(np.searchsorted(start, t, side="right") - 1, 0)
        way = self.law(np.clip((t - start[i]) / duration[i], 0.0, 1.0))
        step = Jet(before[i], np.zeros_like(before[i]), np.zeros_like(before[i]))
        powers = (np.ones(t.size), 1.0 / duration[i], 1.0 / duration[i] ** 2)
        return Jet(*(s + change[i] * _shaped(w * p, change[i]) for s, w, p in zip(step, way, powers, strict=True)))


@dataclass(frozen=True, eq=False)
class Ramps(Signal):
    """Integral of a rate in straight lines from knot to knot; it stays before the first and after the last."""

    knots: ArrayLike  # increasing (m,), s
    rates: ArrayLike  # rate at each (m,); the value is 0 at the first

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        knots, rates = check.column("knots", self.knots), check.column("rates", self.rates)
        slope = np.diff(rates) / np.diff(knots)
        passed = np.concatenate(([0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(knots))))
        piece = np.searchsorted(knots, t, side="right")  # 0 before the first, m after the last
        i = np.maximum(piece - 1, 0)
        acc = np.concatenate(([0.0], slope, [0.0]))[piece]
        since = t - knots[i]
        return Jet(passed[i] + since * (rates[i] + 0.5 * acc * since), rates[i] + acc * since, acc)


@dataclass(frozen=True)
class Sum(Signal):
    """Sum of signals of one shape."""

    terms: tuple[Signal, ...]

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        jets = [term.jet(t) for term in self.terms]
        return Jet(*(np.sum(parts, axis=0) for parts in zip(*jets, strict=True)))


@dataclass(frozen=True)
class Linear(Signal):
    """What a linear map, which does not change in time, makes of a signal: some times it, or some of its components."""

    signal: Signal
    map: Callable[[Floats], Floats]  # of values (N,) or (N, k)

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        return Jet(*map(self.map, self.signal.jet(t)))


@dataclass(frozen=True, eq=False)
class WarmUp(Signal):
    """``rise (1 - exp(-t / time))``: what a device warms up by after it was switched on at time 0; time constant, s."""

    rise: float
    time: float

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        decay = self.rise * np.exp(-t / self.time)
        return Jet(self.rise - decay, decay / self.time, -decay / self.time**2)


@dataclass(frozen=True)
class Sine(Signal):
    """Sine of a signal, by the chain rule."""

    signal: Signal

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        x, dx, ddx = self.signal.jet(t)
        c, s = np.cos(x), np.sin(x)
        return Jet(s, c * dx, c * ddx - s * dx * dx)


@dataclass(frozen=True, eq=False)
class Driven(Signal):
    """Damped oscillators ``x'' + 2ζω x' + ω² x = drive``, in balance with the first drive at the start.

    The drive goes in straight lines from knot to knot; for such a drive the answer is exact at any instant.
    """

    start: float  # first knot, s
    step: float  # from knot to knot, s
    drive: Floats  # acceleration at each knot (m, k)
    omega: float  # natural angular frequency ω, rad/s
    damping: float  # ζ, below 1

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        pole, ringing = self._pole, self._knots
        k = np.clip(((t - self.start) / self.step).astype(np.intp), 0, len(self.drive) - 2)
        since = (t - self.start - k * self.step)[:, np.newaxis]
        slope = (self.drive[k + 1] - self.drive[k]) / self.step
        drive = self.drive[k] + slope * since
        growth = np.exp(pole * since)
        level, ramp = (growth - 1.0) / pole, (growth - 1.0 - pole * since) / pole**2
        z = growth * ringing[k] + level * self.drive[k] + ramp * slope
        ring = self.omega * math.sqrt(1.0 - self.damping**2)
        return Jet(z.imag / ring, (pole * z).imag / ring, (pole**2 * z).imag / ring + drive)

    @property
    def _pole(self) -> complex:
        return self.omega * complex(-self.damping, math.sqrt(1.0 - self.damping**2))

    @cached_property
    def _knots(self) -> NDArray[np.complex128]:
        """State z (m, k) at the knots, ``z' = pole z + drive``, whose imaginary part over the ring is x."""
        from scipy.signal import lfilter

        pole, h = self._pole, self.step
        growth = np.exp(pole * h)
        level, ramp = (growth - 1.0) / pole, (growth - 1.0 - pole * h) / (pole**2 * h)
        first = -self.drive[0] / pole
        fed = (level - ramp) * self.drive[:-1] + ramp * self.drive[1:]
        rest = lfilter([1.0], [1.0, -growth], fed, axis=0, zi=(growth * first)[np.newaxis])[0]
        return np.asarray(np.concatenate((first[np.newaxis], rest)), dtype=np.complex128)


@dataclass(frozen=True)
class Windowed(Signal):
    """A signal times a scalar window of time, by the product rule."""

    signal: Signal
    window: Signal

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        x, dx, ddx = self.signal.jet(t)
        w, dw, ddw = (_shaped(part, x) for part in self.window.jet(t))
        return Jet(w * x, dw * x + w * dx, ddw * x + 2.0 * dw * dx + w * ddx)


@dataclass(frozen=True)
class Stack(Signal):
    """Scalar signals side by side as components of one."""

    components: tuple[Signal, ...]

    def jet(self, t: Floats) -> Jet:
        """Value and derivatives at the instants t (N,), s."""
        jets = [component.jet(t) for component in self.components]
        return Jet(*(np.stack(parts, axis=-1) for parts in zip(*jets, strict=True)))


def _shaped(scalar: Floats, like: Floats) -> Floats:
    """Shape (N,) so that it multiplies `like` of (N,) or (N, k)."""
    return scalar.reshape(scalar.shape + (1,) * (like.ndim - 1))
