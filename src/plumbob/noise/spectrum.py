"""Power of a record over frequency in cosine coefficients, gathered in bins; sinusoids found and taken out.

The type-II cosine transform of N evenly spaced samples has the frequencies j / (2 N Δt). For noise its coefficients are
nearly independent, of variance S(f) in a suitable scale; and they do not suffer from the two ends of a drifting record
being different, as those of a Fourier transform do: for a random walk this is exact, as cosines are the Karhunen–Loève
functions of a Wiener process about its mean. A steady ramp is a known vector among them, so that it can be estimated
along with the noise.

Spectra of the noise terms as sampled records have them, per bin of a `Spectrum`, for coefficients of 1.

Sampled at Δt, the terms' two-sided densities are with w = 2 sin(πfΔt): Q: w² / Δt, N: 1, B: Δt / w, K: (Δt / w)²; for
low frequencies these are the densities of `plumbob.noise.terms`, and the generators of flicker noise by fractional
integration [Kasdin1995] and of random walks have exactly these.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.noise.findings import Sinusoid

_SINGLE = 64  # lowest coefficients kept one by one; the ramp, and most of what is known about K and B, is in them
_PER_DECADE = 60  # bins: within one of 4 % width no spectrum of the terms changes by more than 8 %
_AT_ONCE = 1 << 18  # coefficients whose products are held
_TRANSFORMING = Lock()  # one thread at a time: a transform works in buffers as large as three records


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Cosine coefficients of one channel, the zeroth left out, summed in m bins."""

    dt: float  # sampling time of the record, s
    count: int  # samples that were transformed, N
    averaged: int  # how many samples of the record each of them is the mean of
    # start, stop: (m,), First coefficient of each bin, and the one after its last. Bins that have been left out leave a
    # gap.
    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    power: Floats  # (m,), sum of the squared coefficients of each bin, unit² / Hz
    cross: Floats  # (m,), sum of coefficient times that of a ramp of 1 unit/s
    ramp: Floats  # (m,), sum of the squared coefficients of such a ramp

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
        return np.asarray(self.middle / (2.0 * self.count * self.step))

    @property
    def middle(self) -> Floats:
        """Middle number j of the coefficients of each bin (m,)."""
        return np.asarray(0.5 * (self.stop + self.start - 1.0))

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
    """Transform evenly spaced values (N,), or means of `averaged` of them; dt, s, is before averaging."""
    from scipy.fft import dct

    count = samples.size
    step = dt * averaged
    with _TRANSFORMING:
        coefficients = dct(samples - np.mean(samples), type=2, norm="ortho", overwrite_x=True)
    coefficients *= np.sqrt(step)
    start = edges(count)
    sums = []  # of whole bins at a time: products of all would be several records more
    for bins in np.split(np.arange(start.size - 1), np.flatnonzero(np.diff(start[:-1] // _AT_ONCE)) + 1):
        rows = slice(start[bins[0]], start[bins[-1] + 1])
        part, ramp = coefficients[rows], ramp_coefficients(np.arange(rows.start, rows.stop), count, step)
        places = start[bins] - rows.start
        sums.append([np.add.reduceat(product, places) for product in (part**2, part * ramp, ramp**2)])
    power, cross, square = map(np.concatenate, zip(*sums, strict=True))
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


LETTERS = ("Q", "N", "B", "K")  # the random terms, in the order of the rows that `densities` returns


def sampled_densities(frequency: Floats, dt: float) -> Floats:
    """Density (4, ...) of Q, N, B and K at the frequencies (...), Hz, in samples taken every dt, s."""
    w = 2.0 * np.abs(np.sin(np.pi * frequency * dt))
    return np.stack([w**2 / dt, np.ones_like(w), dt / w, (dt / w) ** 2])  # [Kasdin1995]


@lru_cache(maxsize=4)
def densities(spectrum: Spectrum) -> Floats:
    """Density (4, m) of Q, N, B and K in each bin."""
    d, dt, frequency = spectrum.averaged, spectrum.dt, spectrum.frequency
    density = sampled_densities(frequency, dt)
    if d > 1:  # averaging damps high frequencies, and taking every d-th mean folds the rest down
        folded = frequency[:, np.newaxis] + np.arange(d) / (d * dt)
        damping = np.sin(np.pi * folded * d * dt) / (d * np.sin(np.pi * folded * dt))
        density = np.sum(sampled_densities(folded, dt) * damping**2, axis=-1)
    turn = 0.5 * np.pi * spectrum.middle / spectrum.count
    # what the first and the last angle of a record, whose differences the samples are, add to cosine coefficients
    density[0] += 4.0 * np.cos(turn) ** 2 / (spectrum.count * spectrum.step)
    density[2] *= _flicker_in_cosines(spectrum)
    return check.read_only(density)


class MarkovBins(NamedTuple):
    """What the density of a first-order Gauss–Markov process needs of a spectrum of m bins."""

    cosine: Floats  # (m,), of the middle frequencies, as angles from one transformed sample to the next
    angle: Floats  # (m,), π times the middle number j of the coefficients of each bin
    sign: Floats  # (m,), (−1)^j
    lags: Floats  # (d,), 0, 1 … of the d samples that each transformed one is the mean of
    # dt, step, length: sampling time, time between the transformed samples, and length of the record, s
    dt: float
    step: float
    length: float


def markov_bins(spectrum: Spectrum) -> MarkovBins:
    """Bins of a spectrum, for `markov_density`."""
    j, step = spectrum.middle, spectrum.step
    cosine = np.cos(2.0 * np.pi * spectrum.frequency * step)
    lags = np.arange(spectrum.averaged, dtype=np.float64)
    sign = np.cos(np.pi * np.rint(j))
    return MarkovBins(cosine, np.pi * j, sign, lags, float(spectrum.dt), float(step), float(spectrum.count * step))


def markov_density(bins: MarkovBins, time: float) -> Floats:
    """Density (m,) of a first-order Gauss–Markov process of standard deviation 1 by its correlation time, s.

    Means of d samples of it have the covariances r₀, r₁, r₁ ρ, r₁ ρ², … with ρ = exp(−d Δt / time), whose transform is
    in closed form. The variance of the cosine coefficient j is that density times 1 − 2 ε (1 − (−1)^j e^(−1/ε)) / (1 +
    (jπε)²), with ε = t₀/T: the covariance exp(−|t|/t₀), integrated twice against cos(jπt/T).
    """
    density = np.empty(bins.cosine.size)
    markov_bin_densities(bins, time, density)
    return density


@kernel
def markov_bin_densities(bins: MarkovBins, time: float, filled: Floats) -> None:
    """Fill in `markov_density`."""
    d = float(bins.lags.shape[0])
    decay = math.exp(-bins.dt / time)
    means = r0 = 0.0
    for k in range(bins.lags.shape[0]):
        power = decay ** bins.lags[k]
        means += power
        r0 += (d - bins.lags[k]) * power
    means, r0 = means / d, (2.0 * r0 - d) / (d * d)
    r1, rho = decay * means * means, decay**d
    e = time / bins.length
    remnant = math.exp(-1.0 / e)
    for i in range(filled.shape[0]):
        angle = e * bins.angle[i]
        in_cosines = 1.0 - 2.0 * e * (1.0 - remnant * bins.sign[i]) / (1.0 + angle * angle)
        density = r0 + 2.0 * r1 * (bins.cosine[i] - rho) / (1.0 - 2.0 * rho * bins.cosine[i] + rho * rho)
        filled[i] = bins.step * density * in_cosines


def _flicker_in_cosines(spectrum: Spectrum) -> Floats:
    """Variance of the cosine coefficient j of flicker noise over its density: (2/π) (Si(jπ) − (1 − (−1)^j) / (jπ)).

    From the covariance −ln|t| / π that belongs to 1 / (2πf), integrated twice against cos(jπt/T): 0.774 for j = 1, and
    as good as 1 from 20 on.
    """
    from scipy.special import sici

    j = spectrum.middle
    single = j == np.rint(j)
    odd = np.where(single, 1.0 - np.cos(np.pi * j), 1.0)  # bins of several coefficients hold as many odd ones as even
    return np.asarray(2.0 / np.pi * (sici(np.pi * j)[0] - odd / (np.pi * j)))


_AT_MOST = 8
_FALSE_ALARM = 1e-3  # that noise alone makes one, per record
_UNSURE_FLOOR = 1.4  # the local floor is known to some 12 %, of which 3 standard deviations are allowed for
_BLOCK = 64  # frequencies whose median is the local floor
_LOWEST = 16.0  # cycles in the record; below, a slow wander cannot be told from a sinusoid
_LEAST = 4 * _BLOCK


def find_sinusoids(samples: Floats, dt: float, averaged: int = 1) -> tuple[tuple[Sinusoid, ...], Floats]:
    """Sinusoids of samples (N,), every `dt` s, strongest first, and what is left without them.

    Peaks of a periodogram (Hann window) that stand above their neighbourhood by more than noise does once in a thousand
    records. A peak that a sinusoid cannot take away is none: vibration of a structure is a hump, and stays. Where each
    value is the mean of `averaged` samples, which has made every sinusoid smaller, they are given as in the samples.
    """
    residual, sinusoids = samples, []
    if samples.size < _LEAST:
        return (), samples
    for _ in range(_AT_MOST):
        density, floor = _periodogram(residual, dt)
        limit = _UNSURE_FLOOR * math.log(density.size / _FALSE_ALARM)
        ratio = density / floor
        ratio[: int(_LOWEST)] = 0.0
        ratio[-2:] = 0.0
        peak = int(np.argmax(ratio))
        if not ratio[peak] > limit:
            break
        bin_width = 1.0 / (samples.size * dt)
        sinusoid, without = _measure(residual, dt, peak * bin_width, float(floor[peak]), averaged)
        around = slice(max(peak - 2, 1), peak + 3)
        if _periodogram(without, dt)[0][around].max() > limit * floor[peak]:
            break
        sinusoids.append(sinusoid)
        residual = without
    return tuple(sorted(sinusoids, key=lambda s: -s.amplitude)), residual


def _periodogram(samples: Floats, dt: float) -> tuple[Floats, Floats]:
    """Two-sided density at the frequencies k / (N Δt), and its floor round about."""
    from scipy.fft import rfft

    t = np.arange(samples.size) - 0.5 * (samples.size - 1)
    detrended = samples - np.mean(samples)
    detrended -= (t @ detrended) / (t @ t) * t
    t *= np.pi / samples.size
    np.cos(t, out=t)
    detrended *= np.square(t, out=t)  # (1 + cos 2x) / 2
    del t  # as large as the record, as each here is
    with _TRANSFORMING:
        transform = rfft(detrended)
    del detrended
    density = np.square(np.abs(transform)) * (dt / (0.375 * samples.size))  # of a Hann window's squares
    del transform
    stop = density.size // _BLOCK * _BLOCK
    medians = np.median(density[:stop].reshape(-1, _BLOCK), axis=1) / math.log(2.0)  # of exponential values
    floor = np.interp(np.arange(density.size), np.arange(medians.size) * _BLOCK + 0.5 * (_BLOCK - 1), medians)
    return density, np.maximum(floor, 1e-300)


def _measure(samples: Floats, dt: float, frequency: float, floor: float, averaged: int) -> tuple[Sinusoid, Floats]:
    """Least squares for amplitude, phase and frequency before averaging, and the record without the sinusoid.

    The standard deviations are the bounds of Rife and Boorstyn for noise of the density `floor` [Rife1974].
    """
    t = (np.arange(samples.size) - 0.5 * (samples.size - 1)) * dt
    centred = samples - np.mean(samples)
    for _ in range(8):
        cosine, sine = np.cos(2.0 * np.pi * frequency * t), np.sin(2.0 * np.pi * frequency * t)
        a, b = 2.0 * np.mean(centred * cosine), 2.0 * np.mean(centred * sine)
        residual = centred - a * cosine - b * sine
        slope = 2.0 * np.pi * t * (b * cosine - a * sine)
        step = float(np.dot(slope, residual) / np.dot(slope, slope))
        frequency += float(np.clip(step, -0.5 / (samples.size * dt), 0.5 / (samples.size * dt)))
        if abs(step) < 1e-6 / (samples.size * dt):
            break
    amplitude, duration = math.hypot(a, b), samples.size * dt
    amplitude_sd = math.sqrt(2.0 * floor / duration)  # [Rife1974]
    frequency_sd = math.sqrt(6.0 * floor / duration**3) / (math.pi * amplitude)  # [Rife1974]
    turn = math.pi * frequency * dt
    gain = abs(averaged * math.sin(turn / averaged) / math.sin(turn)) if averaged > 1 else 1.0
    sinusoid = Sinusoid(gain * amplitude, gain * amplitude_sd, frequency, frequency_sd, dt / averaged)
    return sinusoid, samples - a * cosine - b * sine
