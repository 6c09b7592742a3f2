"""The scene of the faults benchmark: a tumbling unit, what its sensors say, and the stream that reaches a filter.

ENU, 100 Hz: 5 s at rest, then smooth turns of ±100 to ±150 °/s about three axes at a fixed point, or another motion.
The gyroscope says its mean rate since the sample before, as one that integrates between its samples does. The noise is
the same in every stream, with a fault and without.
"""

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, g
from plumbob.rotations import (
    Frame,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
    quat_rotate,
)
from plumbob.rotations.kernels import quat_mul
from plumbob.simulation.signals import earth_field

Three = tuple[float, float, float]
OfTime = Callable[[Floats], Floats]

RATE: Final = 100.0
"""Samples per second."""
LENGTH: Final = 9000
"""Samples of a run, 90 s; a case that loses a minute takes that much more."""
LONGEST: Final = 15000
FRAME: Final = Frame.ENU

RANGES: Final = {"gyr": dps(2000.0), "acc": g(16.0), "mag": 4900.0}
"""Full scale of each triad, rad/s, m/s², µT."""
DIP_DEG: Final = 66.0
FIELD_N: Final[Floats] = earth_field(FRAME, strength=49.0, dip=deg(DIP_DEG), declination=0.0)
GRAVITY_N: Final[Floats] = G0 * FRAME.up

_SD = {"gyr": dps(0.1), "acc": 0.03, "mag": 0.3}  # white, per sample and axis
_BIAS = dps(0.1)  # on every axis of the gyroscope
_FINE = 16  # steps of the truth in one of the samples, a power of two
AMPLITUDE: Final[Three] = (dps(100.0), dps(125.0), dps(150.0))
FREQUENCY: Final[Three] = (0.2 * math.sqrt(2.0), 0.2 * math.sqrt(3.0), 0.2 * math.sqrt(5.0))
"""Of the usual turns, rad/s and Hz; no two have a common period."""
_RISE = 1.0  # s from rest to full amplitude
_CLIPPED = {"gyr": flags.GYR_CLIPPED, "acc": flags.ACC_CLIPPED, "mag": flags.MAG_CLIPPED}

Row = tuple[Any, Floats, Floats, Floats | None, int]
"""Time, ns, or NaN; gyr, acc, mag or None; flags."""


def smooth_step(t: Floats, begin: float, end: float) -> Floats:
    """Rise from 0 to 1 along half a cosine."""
    fraction = np.clip((t - begin) / (end - begin), 0.0, 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * fraction))


def swings(t: Floats, amplitude: Three, frequency: Three) -> Floats:
    """Sines of three frequencies, Hz, at times (N,), s, that begin smoothly at 5 s: (N, 3)."""
    since = t - 5.0
    waves = np.sin(2.0 * np.pi * np.array(frequency) * since[:, np.newaxis])
    return np.asarray(np.array(amplitude) * smooth_step(since, 0.0, _RISE)[:, np.newaxis] * waves)


@dataclass(frozen=True, slots=True)
class Motion:
    """How the unit turns and moves.

    Attributes
    ----------
    start : tuple of float
        Yaw, pitch and roll at t = 0, rad.
    extra : callable or None
        Rate in body axes, rad/s, (N, 3), at times (N,), s, on top of the usual one.
    amplitude, frequency : tuple of float
        Of the usual turns about the body's axes, rad/s and Hz.
    push : callable or None
        Acceleration in the navigation frame, m/s², (N, 3), at times (N,), s; None: a fixed point.
    """

    start: Three = (0.0, 0.0, 0.0)
    extra: OfTime | None = None
    amplitude: Three = AMPLITUDE
    frequency: Three = FREQUENCY
    push: OfTime | None = None

    def rates(self, t: Floats) -> Floats:
        """Rate in body axes at times (N,), s: (N, 3), rad/s."""
        usual = swings(t, self.amplitude, self.frequency)
        return usual if self.extra is None else usual + self.extra(t)


USUAL: Final = Motion()
"""From rest, level, heading zero."""


@functools.cache
def truth_of(motion: Motion) -> tuple[Floats, Floats]:
    """Attitude q_nb at each sample, (N, 4), and mean rate since the one before, rad/s, (N, 3), of the longest run.

    By the midpoint rule on a 16 times finer grid.
    """
    h = 1.0 / (RATE * _FINE)
    middle: Floats = (np.arange(LONGEST * _FINE, dtype=np.float64) + 0.5) * h
    rates = motion.rates(middle)
    turns = quat_from_rotvec(h * rates).reshape(LONGEST, _FINE, 4)
    while turns.shape[1] > 1:
        turns = quat_multiply(turns[:, 0::2], turns[:, 1::2])
    q = np.empty((LONGEST, 4))
    now = tuple(quat_from_euler_zyx(motion.start).tolist())
    for i, turn in enumerate(turns[:, 0].tolist()):
        q[i] = now
        now = quat_mul.py_func(*now, *turn)
    means = rates.reshape(LONGEST, _FINE, 3).mean(axis=1)
    means = np.concatenate((motion.rates(np.zeros(1)), means[:-1]))
    return check.read_only(quat_normalize(q)), check.read_only(means)


@dataclass(slots=True)
class Stream:
    """Samples on their way to a filter; cases edit them in place.

    Attributes
    ----------
    t : ndarray (N,)
        Time stamps, s; NaN where a stamp is lost.
    gyr, acc, mag : ndarray (N, 3)
        What the triads say.
    has_mag : ndarray (N,) of bool
        False where the sample comes without a magnetometer.
    origin : ndarray (N,) of int
        Which sample of the clean stream this was.
    truth : ndarray (M, 4)
        True attitude at each sample of the clean stream.
    """

    t: Floats
    gyr: Floats
    acc: Floats
    mag: Floats
    has_mag: NDArray[np.bool_]
    origin: NDArray[np.int64]
    truth: Floats

    def take(self, index: NDArray[np.int64]) -> None:
        """Keep these samples only, in this order."""
        for name in ("t", "gyr", "acc", "mag", "has_mag", "origin"):
            setattr(self, name, getattr(self, name)[index])

    def seen(self, rows: slice, v_n: Floats) -> Floats:
        """Vector of the navigation frame as the body sees it at some samples, (N, 3)."""
        return quat_rotate(quat_conjugate(self.truth[self.origin[rows]]), v_n)

    @property
    def newest(self) -> NDArray[np.int64]:
        """Latest clean sample that has arrived at each sample: what an attitude is compared with."""
        return np.maximum.accumulate(self.origin)

    def rows(self) -> Iterator[Row]:
        """Samples one by one, with the flags of a decoder that knows its ranges."""
        stamps = [math.nan if math.isnan(t) else round(t * 1e9) for t in self.t.tolist()]
        mags = [mag if there else None for mag, there in zip(self.mag, self.has_mag.tolist(), strict=True)]
        yield from zip(stamps, self.gyr, self.acc, mags, self._flags().tolist(), strict=True)

    def _flags(self) -> NDArray[np.int64]:
        found = np.zeros(self.t.size, dtype=np.int64)
        for name, full_scale in RANGES.items():
            size = np.abs(getattr(self, name))  # beyond 1.05 of full scale is no code that a decoder can get
            at_end = ((size >= 0.999 * full_scale) & (size <= 1.05 * full_scale)).any(axis=1)
            found[at_end & (self.has_mag | (name != "mag"))] |= _CLIPPED[name]
        return found


def clip(name: str, values: Floats) -> Floats:
    """Values of a triad, cut off at its range."""
    return np.clip(values, -RANGES[name], RANGES[name])


def record(motion: Motion, length: int = LENGTH) -> Stream:
    """Clean samples of a motion, ready to be edited."""
    truth, rates = truth_of(motion)
    t = np.arange(length) / RATE
    inverse = quat_conjugate(truth[:length])
    exact = {
        "gyr": rates[:length] + _BIAS,
        "acc": quat_rotate(inverse, GRAVITY_N if motion.push is None else GRAVITY_N + motion.push(t)),
        "mag": quat_rotate(inverse, FIELD_N),
    }
    said = {name: clip(name, values + _noise(name)[:length]) for name, values in exact.items()}
    return Stream(t, **said, has_mag=np.ones(length, dtype=bool), origin=np.arange(length), truth=truth)


@functools.cache
def _noise(name: str) -> Floats:
    seed = tuple(_SD).index(name)
    return check.read_only(_SD[name] * np.random.default_rng(seed).normal(size=(LONGEST, 3)))
