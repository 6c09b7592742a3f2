"""Records whose deviations are known, or worth knowing."""

import math

import numpy as np
from scipy.signal import lfilter

from plumbob.noise.spectrum import Spectrum, edges, ramp_coefficients

NBS14 = [892, 809, 823, 798, 671, 644, 883, 903, 677]
"""[Riley2008] Table 29."""


def riley_1000():
    """[Riley2008] sec. 12.4: n0 = 1234567890, n → 16807 n mod 2147483647, over 2147483647."""
    n, found = 1234567890, []
    for _ in range(1000):
        found.append(n / 2147483647)
        n = 16807 * n % 2147483647
    return np.array(found)


def white(count, seed=1):
    return np.random.default_rng(seed).standard_normal(count)


def walk(count, seed=2):
    return np.cumsum(white(count, seed))


def flicker(count, seed=3):
    """White noise shaped to a spectrum of 1/f."""
    frequency = np.fft.rfftfreq(2 * count)
    shape = np.zeros_like(frequency)
    shape[1:] = frequency[1:] ** -0.5
    return np.fft.irfft(shape * np.fft.rfft(white(2 * count, seed)))[:count]


def drifting(count, seed=4):
    """White noise on a ramp that rises by a hundred times its deviation."""
    return white(count, seed) + np.linspace(0.0, 100.0, count)


def whole_numbers(angle):
    """θ in units of which its largest is less than 2⁵²: whole numbers, as far as float64 goes."""
    return np.round(np.ldexp(angle, 52 - math.frexp(float(np.max(np.abs(angle))))[1]))


def exact_squares(angle, n):
    """Sum of squared second differences of whole numbers at spacing n, without any rounding: in digits of 18 bits."""
    points = angle.astype(np.int64)
    difference = points[2 * n :] - 2 * points[n:-n] + points[: -2 * n]
    digits = (difference & (2**18 - 1), difference >> 18 & (2**18 - 1), difference >> 36)
    return sum(int(np.dot(a, b)) << 18 * (i + j) for i, a in enumerate(digits) for j, b in enumerate(digits))


def exactly(rate, n, kind="oadev"):
    """A deviation as the definitions write it, with exact sums: differences of averages, or of sums of θ."""
    theta = np.concatenate(([0.0], np.cumsum(np.asarray(rate) - np.mean(rate))))
    if kind == "totdev":
        inner = theta[1:-1][::-1]
        theta = np.concatenate((2.0 * theta[0] - inner, theta, 2.0 * theta[-1] - inner))
        theta = theta[len(rate) - n : 2 * len(rate) - 1 + n]
    weights = [-1.0, 3.0, -3.0, 1.0] if kind in {"ohdev", "hdev"} else [1.0, -2.0, 1.0]
    reach = n * (len(weights) - 1)
    found = np.array([sum(w * theta[k + n * i] for i, w in enumerate(weights)) for k in range(len(theta) - reach)])
    if kind == "mdev":
        found = np.array([found[k : k + n].mean() for k in range(len(found) - n + 1)])
    if kind in {"adev", "hdev"}:
        found = found[::n]
    return math.sqrt(math.fsum(found**2) / len(found) / (6.0 if kind in {"ohdev", "hdev"} else 2.0)) / n


def first_order(white, time, dt=1.0):
    """Exact first-order process of variance 1 from white noise along the last axis, in its stationary state."""
    decay = math.exp(-dt / time)
    drive = white * math.sqrt(1.0 - decay**2)
    drive[..., 0] = white[..., 0]
    return lfilter([1.0], [1.0, -decay], drive, axis=-1)


def expected_spectrum(density, count, dt):
    """What the spectra of many records are on average: cosine coefficient j has the density at j / (2 N Δt)."""
    start, j = edges(count), np.arange(count)
    ramp = np.add.reduceat(ramp_coefficients(j, count, dt) ** 2, start[:-1])
    power = np.add.reduceat(density(np.maximum(j, 0.5) / (2.0 * count * dt)), start[:-1])
    return Spectrum(dt, count, 1, start[:-1], start[1:], power, 0.0 * power, ramp)
