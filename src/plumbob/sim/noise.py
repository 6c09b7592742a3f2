"""Random processes of IEEE Std 952, each at its own Allan level, and the random streams that drive them.

==============  ======  ====================  ============================
process         letter  two-sided PSD of rate  Allan deviation
==============  ======  ====================  ============================
white           N       N²                    N / √τ
flicker         B       B² / (2πf)            B √(2 ln 2 / π) = 0.6643 B
random walk     K       (K / 2πf)²            K √(τ/3)
ramp            R       –                     R τ / √2
==============  ======  ====================  ============================
"""

import math

import numpy as np

from plumbob.check import Floats
from plumbob.errors import ParameterError


def stream(seed: int, *names: str) -> np.random.Generator:
    """Random generator of one error of one triad, independent of all others of the same seed.

    Raises
    ------
    ParameterError
        If the seed is no whole number of at least 0.
    """
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise ParameterError(f"seed must be a whole number of at least 0, but it is {seed!r}.")
    key = tuple(int.from_bytes(name.encode()) for name in names)
    return np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=key))


def white(sd: Floats, count: int, rng: np.random.Generator) -> Floats:
    """White noise (count, 3) of standard deviation sd (3,)."""
    return sd * rng.standard_normal((count, 3))


def white_sd(n_rpsd: Floats, rate: float) -> Floats:
    """Standard deviation of one sample, N √rate, of white noise whose Allan deviation is N / √τ."""
    return n_rpsd * math.sqrt(rate)


def flicker(b: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Flicker noise (count, 3) of bias instability b (3,), starting from nothing.

    White noise through the fractional integrator of order ½, whose pulse response falls as 1/√k [Kasdin1995]. White
    noise of standard deviation B gives the two-sided density B²/(2πf), at any sampling rate. The Allan deviation is
    flat at 0.6643 B from about ten samples on; at one sample it is B √(2/π) = 0.80 B, as sampling folds the spectrum.
    """
    k = np.arange(1, count)
    pulse = np.concatenate(([1.0], np.cumprod((k - 0.5) / k)))
    size = 1 << (2 * count - 1).bit_length()  # room for the whole convolution, so that the end does not wrap round
    response = np.fft.rfft(pulse, size)[:, np.newaxis]
    return np.fft.irfft(response * np.fft.rfft(white(b, count, rng), size, axis=0), size, axis=0)[:count]


def random_walk(k_rpsd: Floats, count: int, rate: float, rng: np.random.Generator) -> Floats:
    """Random walk (count, 3) of rate K (3,), unit/s/√Hz; the first value is 0."""
    steps = white(k_rpsd / math.sqrt(rate), count, rng)
    return np.asarray(np.cumsum(steps, axis=0) - steps[0])
