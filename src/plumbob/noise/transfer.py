"""What each frequency of a record adds to an Allan variance, and how far a filter reaches in it."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from plumbob.check import Floats

FAR: Final = 10.0
"""So many time constants on, a filter takes less than 1.5/10 of the Allan variance of white noise, and soon nothing."""


def allan_transfer(n: ArrayLike, frequency: ArrayLike, dt: float) -> Floats:
    """Weight of the two-sided density at each frequency in the Allan variance of averages over n samples.

    ``σ²(n) = ∫ weight · S df`` over positive frequencies up to half the sampling rate, weight =
    4 sin⁴(πfnΔt) / (n sin(πfΔt))²: the squared response of a difference of neighbouring averages, both signs of f.

    Parameters
    ----------
    n : array_like (m,)
        Averaging factors.
    frequency : array_like (k,)
        Frequencies, Hz, above 0.
    dt : float
        Sampling time, s.

    Returns
    -------
    ndarray (m, k)
    """
    factor = np.asarray(n, dtype=np.float64)[:, np.newaxis]
    turn = np.pi * np.asarray(frequency, dtype=np.float64) * dt
    square = np.sin(factor * turn) ** 2
    return np.asarray(4.0 * square**2 / (factor * np.sin(turn)) ** 2)  # a fourth power would be ten times as slow


def grid(count: int, dt: float, size: int = 1 << 14) -> tuple[Floats, Floats]:
    """Frequencies (size,) and their widths for integrals over a spectrum: evenly spaced by logarithm, and shaken.

    Shaken, because the transfer swings faster than the grid is fine; its mean is then met all the same.
    """
    ends = np.geomspace(0.125 / (count * dt), 0.5 / dt, size + 1)
    width = np.diff(ends)
    return ends[:-1] + width * np.random.default_rng(0).uniform(size=size), width
