"""Power of a record over frequency, in the form that a likelihood wants: cosine coefficients, gathered in bins.

The type-II cosine transform of N evenly spaced samples has the frequencies j / (2 N Δt). For noise its coefficients are
nearly independent, of variance S(f) in a suitable scale; and they do not suffer from the two ends of a drifting record
being different, as those of a Fourier transform do: for a random walk this is exact, as cosines are the Karhunen–Loève
functions of a Wiener process about its mean. A steady ramp is a known vector among them, so that it can be estimated
along with the noise.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats

_SINGLE = 64  # lowest coefficients kept one by one; the ramp, and most of what is known about K and B, is in them
_PER_DECADE = 60  # bins: within one of 4 % width no spectrum of the terms changes by more than 8 %


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Cosine coefficients of one channel, the zeroth left out, summed in m bins.

    Attributes
    ----------
    dt : float
        Sampling time of the record, s.
    count : int
        Samples that were transformed, N.
    averaged : int
        How many samples of the record each of them is the mean of.
    start, stop : ndarray (m,) of int64
        First coefficient of each bin, and the one after its last. Bins that have been left out leave a gap.
    power : ndarray (m,)
        Sum of the squared coefficients of each bin, unit² / Hz.
    cross : ndarray (m,)
        Sum of coefficient times that of a ramp of 1 unit/s.
    ramp : ndarray (m,)
        Sum of the squared coefficients of such a ramp.
    """

    dt: float
    count: int
    averaged: int
    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    power: Floats
    cross: Floats
    ramp: Floats

    @property
    def terms(self) -> Floats:
        """Coefficients in each bin (m,)."""
        return (self.stop - self.start).astype(np.float64)

    @property
    def step(self) -> float:
        """Time between the transformed samples, s."""
        return self.dt * self.averaged

    @property
    def frequency(self) -> Floats:
        """Middle frequency of each bin (m,), Hz."""
        return np.asarray(0.5 * (self.stop + self.start - 1.0) / (2.0 * self.count * self.step))

    @property
    def width(self) -> Floats:
        """Width of each bin (m,), Hz."""
        return np.asarray(self.terms / (2.0 * self.count * self.step))

    def without_ramp(self, ramp: float) -> Floats:
        """Power of each bin (m,) once a ramp of so many unit/s is taken off the record."""
        return np.asarray(self.power - 2.0 * ramp * self.cross + ramp**2 * self.ramp)

    def below(self, frequency: float) -> "Spectrum":
        """Only the bins whose frequencies are all below this one, Hz."""
        return self.only((self.stop - 1.0) / (2.0 * self.count * self.step) <= frequency)

    def only(self, kept: NDArray[np.bool_]) -> "Spectrum":
        """Only some of the bins."""
        power, cross, ramp = (row[kept] for row in (self.power, self.cross, self.ramp))
        return replace(self, start=self.start[kept], stop=self.stop[kept], power=power, cross=cross, ramp=ramp)


def spectrum(samples: Floats, dt: float, averaged: int = 1) -> Spectrum:
    """Transform a record.

    Parameters
    ----------
    samples : ndarray (N,)
        Evenly spaced values, or means of `averaged` of them.
    dt : float
        Sampling time before averaging, s.
    averaged : int
        How many samples each value is the mean of.
    """
    from scipy.fft import dct

    count = samples.size
    step = dt * averaged
    coefficients = dct(samples - np.mean(samples), type=2, norm="ortho") * np.sqrt(step)
    start = edges(count)
    ramp = ramp_coefficients(np.arange(count), count, step)
    products = (coefficients**2, coefficients * ramp, ramp**2)
    power, cross, square = (np.add.reduceat(p, start[:-1]) for p in products)
    return Spectrum(dt, count, averaged, start[:-1], start[1:], power, cross, square)


def edges(count: int) -> NDArray[np.int64]:
    """First coefficient of each bin of a record of `count` samples, and the one after the last."""
    single = np.arange(1, min(_SINGLE, count) + 1)
    decades = np.log10(max(count, 2) / single[-1])
    wide = np.round(single[-1] * 10.0 ** np.linspace(0.0, decades, int(_PER_DECADE * decades) + 2))
    return np.unique(np.concatenate((single, wide, [count])).astype(np.int64))


def ramp_coefficients(j: NDArray[np.int64], count: int, step: float) -> Floats:
    """Cosine coefficients j ≥ 0 of `count` samples of a ramp of 1 unit/s; closed form: those of even j are 0."""
    angle = 0.5 * np.pi * j / count
    sine = np.where(j % 2 == 1, np.sin(angle), np.inf)
    return np.asarray(-np.sqrt(0.5 / count) * step**1.5 * np.cos(angle) / sine**2)
