"""Spectra of the noise terms as sampled records have them, per bin of a `Spectrum`, for coefficients of 1.

Sampled at Δt, the terms' two-sided densities are with w = 2 sin(πfΔt): Q: w² / Δt, N: 1, B: Δt / w, K: (Δt / w)²; for
low frequencies these are the densities of `plumbob.noise.terms`, and the generators of flicker noise by fractional
integration [Kasdin1995] and of random walks have exactly these.
"""

import math
from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from plumbob import check
from plumbob._jit import njit_reassociated
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


class MarkovBins(NamedTuple):
    """What the density of a first-order Gauss–Markov process needs of a spectrum of m bins.

    Attributes
    ----------
    cosine : ndarray (m,)
        Of the middle frequencies, as angles from one transformed sample to the next.
    angle : ndarray (m,)
        π times the middle number j of the coefficients of each bin.
    sign : ndarray (m,)
        (−1)^j.
    lags : ndarray (d,)
        0, 1 … of the d samples that each transformed one is the mean of.
    dt, step, length : float
        Sampling time, time between the transformed samples, and length of the record, s.
    """

    cosine: Floats
    angle: Floats
    sign: Floats
    lags: Floats
    dt: float
    step: float
    length: float


def markov_bins(spectrum: Spectrum) -> MarkovBins:
    """Bins of a spectrum, for `markov_density`."""
    j, step = _middle(spectrum), spectrum.step
    cosine = np.cos(2.0 * np.pi * spectrum.frequency * step)
    lags = np.arange(spectrum.averaged, dtype=np.float64)
    sign = np.cos(np.pi * np.rint(j))
    return MarkovBins(cosine, np.pi * j, sign, lags, float(spectrum.dt), float(step), float(spectrum.count * step))


@njit_reassociated
def markov_density(bins: MarkovBins, time: float) -> Floats:
    """Density (m,) of a first-order Gauss–Markov process of standard deviation 1 by its correlation time, s.

    Means of d samples of it have the covariances r₀, r₁, r₁ ρ, r₁ ρ², … with ρ = exp(−d Δt / time), whose transform is
    in closed form.

    The variance of the cosine coefficient j is that density times 1 − 2 ε (1 − (−1)^j e^(−1/ε)) / (1 + (jπε)²), with
    ε = t₀/T: the covariance exp(−|t|/t₀), integrated twice against cos(jπt/T).
    """
    d = bins.lags.shape[0]
    decay = math.exp(-bins.dt / time)
    powers = decay**bins.lags
    means = np.sum(powers) / d
    r0 = (2.0 * np.sum((d - bins.lags) * powers) - d) / d**2
    r1, rho = decay * means**2, decay**d
    e = time / bins.length
    in_cosines = 1.0 - 2.0 * e * (1.0 - math.exp(-1.0 / e) * bins.sign) / (1.0 + (e * bins.angle) ** 2)
    density = r0 + 2.0 * r1 * (bins.cosine - rho) / (1.0 - 2.0 * rho * bins.cosine + rho**2)
    return np.asarray(bins.step * density * in_cosines)


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
    return np.asarray(0.5 * (spectrum.stop + spectrum.start - 1.0))


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
