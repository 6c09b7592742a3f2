"""Spectra of the noise terms as sampled records have them, per bin of a `Spectrum`, for coefficients of 1.

Sampled at Δt, the terms' two-sided densities are with w = 2 sin(πfΔt): Q: w² / Δt, N: 1, B: Δt / w, K: (Δt / w)²; for
low frequencies these are the densities of `plumbob.noise.terms`, and the generators of flicker noise by fractional
integration [Kasdin1995] and of random walks have exactly these.
"""

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np

from plumbob import check
from plumbob.check import Floats
from plumbob.noise.spectrum import Spectrum

LETTERS = ("Q", "N", "B", "K")
"""The random terms, in the order of the rows that `densities` returns."""


def sampled_densities(frequency: Floats, dt: float) -> Floats:
    """Density (4, ...) of Q, N, B and K at the frequencies (...), Hz, in samples taken every dt, s."""
    w = 2.0 * np.abs(np.sin(np.pi * frequency * dt))
    return np.stack([w**2 / dt, np.ones_like(w), dt / w, (dt / w) ** 2])


@lru_cache(maxsize=4)
def densities(spectrum: Spectrum) -> Floats:
    """Density (4, m) of Q, N, B and K in each bin."""
    found = _averaged(partial(sampled_densities, dt=spectrum.dt), spectrum)
    found[0] += _ends_of_quantization(spectrum)
    found[2] *= _flicker_in_cosines(spectrum)
    return check.read_only(found)


class MarkovDensity:
    """Density (m,) of a first-order Gauss–Markov process of standard deviation 1 by its correlation time, s.

    Means of d samples of it have the covariances r₀, r₁, r₁ ρ, r₁ ρ², … with ρ = exp(−d Δt / time), whose transform is
    in closed form.
    """

    def __init__(self, spectrum: Spectrum) -> None:
        self._spectrum = spectrum
        self._length = spectrum.count * spectrum.step
        self._lags = np.arange(spectrum.averaged)
        self._cosine = np.cos(2.0 * np.pi * spectrum.frequency * spectrum.step)
        j = _middle(spectrum)
        self._angle = np.pi * j
        self._sign = np.cos(np.pi * np.rint(j))

    def __call__(self, time: float) -> Floats:
        """Density in each bin for one correlation time, s."""
        d, step, cosine = self._spectrum.averaged, self._spectrum.step, self._cosine
        decay = np.exp(-self._spectrum.dt / time)
        powers = decay**self._lags
        means = np.add.reduce(powers) / d
        r0 = (2.0 * np.add.reduce((d - self._lags) * powers) - d) / d**2
        r1, rho = decay * means**2, decay**d
        density = step * (r0 + 2.0 * r1 * (cosine - rho) / (1.0 - 2.0 * rho * cosine + rho**2))
        return np.asarray(density * self._in_cosines(time))

    def _in_cosines(self, time: float) -> Floats:
        """Variance of the cosine coefficient j over its density, as for flicker noise.

        With the covariance exp(−|t|/t₀), in units of the record's length: ε = t₀/T, z = 1/ε − i jπ.
        """
        e, a = time / self._length, self._angle
        z = 1.0 / e - 1j * a
        end = np.exp(-1.0 / e) * self._sign  # e^{-z} at whole j
        first = 1.0 / z - (1.0 - end) / z**2
        second = (1.0 - end) / z
        variance = 2.0 * first.real - 2.0 / a * second.imag
        return np.asarray(variance * (1.0 + (a * e) ** 2) / (2.0 * e))


def _averaged(sampled: Callable[[Floats], Floats], spectrum: Spectrum) -> Floats:
    """Density of means of samples: averaging damps high frequencies, and taking every d-th mean folds the rest down."""
    d, dt, frequency = spectrum.averaged, spectrum.dt, spectrum.frequency
    if d == 1:
        return np.asarray(sampled(frequency))
    folded = frequency[:, np.newaxis] + np.arange(d) / (d * dt)
    damping = np.sin(np.pi * folded * d * dt) / (d * np.sin(np.pi * folded * dt))
    return np.asarray(np.sum(sampled(folded) * damping**2, axis=-1))


def _middle(spectrum: Spectrum) -> Floats:
    """Middle number j of the coefficients of each bin (m,)."""
    return np.asarray(0.5 * (spectrum.start[1:] + spectrum.start[:-1] - 1.0))


def _ends_of_quantization(spectrum: Spectrum) -> Floats:
    """What the first and the last angle of a record, whose differences the samples are, add to cosine coefficients."""
    turn = 0.5 * np.pi * _middle(spectrum) / spectrum.count
    return np.asarray(4.0 * np.cos(turn) ** 2 / (spectrum.count * spectrum.step))


def _flicker_in_cosines(spectrum: Spectrum) -> Floats:
    """Variance of the cosine coefficient j of flicker noise over its density: (2/π) (Si(jπ) − (1 − (−1)^j) / (jπ)).

    From the covariance −ln|t| / π that belongs to 1 / (2πf), integrated twice against cos(jπt/T): 0.774 for j = 1, and
    as good as 1 from 20 on.
    """
    from scipy.special import sici

    j = _middle(spectrum)
    whole = j == np.rint(j)
    odd = np.where(whole, 1.0 - np.cos(np.pi * j), 1.0)  # bins of several coefficients hold as many odd ones as even
    return np.asarray(2.0 / np.pi * (sici(np.pi * j)[0] - odd / (np.pi * j)))
