"""Sinusoids in a record: a pump, the mains, a supply's ripple, folded down or not; found, measured and taken out."""

import math
from dataclasses import replace

import numpy as np

from plumbob.core.check import Floats
from plumbob.noise.findings import Sinusoid

_AT_MOST = 8
_FALSE_ALARM = 1e-3  # that noise alone makes one, per record
_UNSURE_FLOOR = 1.4  # the local floor is known to some 12 %, of which 3 standard deviations are allowed for
_BLOCK = 64  # frequencies whose median is the local floor
_LOWEST = 16.0  # cycles in the record; below, a slow wander cannot be told from a sinusoid
_LEAST = 4 * _BLOCK


def find_sinusoids(samples: Floats, dt: float, averaged: int = 1) -> tuple[tuple[Sinusoid, ...], Floats]:
    """Sinusoids of a record, strongest first, and what is left without them.

    Peaks of a periodogram (Hann window) that stand above their neighbourhood by more than noise does once in a thousand
    records. A peak that a sinusoid cannot take away is none: vibration of a structure is a hump, and stays.

    Parameters
    ----------
    samples : ndarray (N,)
        Evenly spaced values.
    dt : float
        Time between the values, s.
    averaged : int
        How many samples each value is the mean of, which has made every sinusoid smaller; found ones are as in the
        samples.
    """
    left, found = samples, []
    if samples.size < _LEAST:
        return (), samples
    for _ in range(_AT_MOST):
        density, floor = _periodogram(left, dt)
        peak = _highest(density, floor)
        if peak is None:
            break
        bin_width = 1.0 / (samples.size * dt)
        sinusoid, without = _measure(left, dt, peak * bin_width, float(floor[peak]))
        around = slice(max(peak - 2, 1), peak + 3)
        if _periodogram(without, dt)[0][around].max() > _limit(density.size) * floor[peak]:
            break
        found.append(_before_averaging(sinusoid, averaged))
        left = without
    return tuple(sorted(found, key=lambda s: -s.amplitude)), left


def _before_averaging(found: Sinusoid, averaged: int) -> Sinusoid:
    dt = found.dt / averaged
    wave = math.pi * found.frequency
    gain = abs(averaged * math.sin(wave * dt) / math.sin(wave * found.dt)) if averaged > 1 else 1.0
    return replace(found, amplitude=gain * found.amplitude, amplitude_sd=gain * found.amplitude_sd, dt=dt)


def _periodogram(samples: Floats, dt: float) -> tuple[Floats, Floats]:
    """Two-sided density at the frequencies k / (N Δt), and its floor round about."""
    from scipy.fft import rfft

    t = np.arange(samples.size)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (t + 0.5) / samples.size)
    line = np.polynomial.polynomial.polyfit(t, samples, 1)
    spectrum = rfft((samples - line[0] - line[1] * t) * window)
    density = np.asarray(np.abs(spectrum) ** 2 * dt / np.sum(window**2))
    whole = density.size // _BLOCK * _BLOCK
    medians = np.median(density[:whole].reshape(-1, _BLOCK), axis=1) / math.log(2.0)  # of exponential values
    floor = np.interp(np.arange(density.size), np.arange(medians.size) * _BLOCK + 0.5 * (_BLOCK - 1), medians)
    return density, np.maximum(floor, 1e-300)


def _limit(frequencies: int) -> float:
    return _UNSURE_FLOOR * math.log(frequencies / _FALSE_ALARM)


def _highest(density: Floats, floor: Floats) -> int | None:
    ratio = density / floor
    ratio[: int(_LOWEST)] = 0.0
    ratio[-2:] = 0.0
    peak = int(np.argmax(ratio))
    return peak if ratio[peak] > _limit(density.size) else None


def _measure(samples: Floats, dt: float, frequency: float, floor: float) -> tuple[Sinusoid, Floats]:
    """Least squares for amplitude, phase and frequency, and the record without the sinusoid.

    The standard deviations are the bounds of Rife and Boorstyn for noise of the density `floor` [Rife1974].
    """
    t = (np.arange(samples.size) - 0.5 * (samples.size - 1)) * dt
    centred = samples - np.mean(samples)
    for _ in range(8):
        cosine, sine = np.cos(2.0 * np.pi * frequency * t), np.sin(2.0 * np.pi * frequency * t)
        a, b = 2.0 * np.mean(centred * cosine), 2.0 * np.mean(centred * sine)
        left = centred - a * cosine - b * sine
        slope = 2.0 * np.pi * t * (b * cosine - a * sine)
        step = float(np.dot(slope, left) / np.dot(slope, slope))
        frequency += float(np.clip(step, -0.5 / (samples.size * dt), 0.5 / (samples.size * dt)))
        if abs(step) < 1e-6 / (samples.size * dt):
            break
    amplitude, duration = math.hypot(a, b), samples.size * dt
    amplitude_sd = math.sqrt(2.0 * floor / duration)  # [Rife1974]
    frequency_sd = math.sqrt(6.0 * floor / duration**3) / (math.pi * amplitude)  # [Rife1974]
    return Sinusoid(amplitude, amplitude_sd, frequency, frequency_sd, dt), samples - a * cosine - b * sine
