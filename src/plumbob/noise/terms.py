"""The five terms of sensor noise [IEEE952]: names, Allan variances, spectra, and the units of a data sheet.

With σ the Allan deviation, τ the averaging time and Δt the sampling time:

======  =======================================  ==================  ===================  =====  ==========
letter  name                                     Allan variance      two-sided PSD        slope  read at
======  =======================================  ==================  ===================  =====  ==========
Q       quantization (of the angle)              3 Q² / τ²           (2πf)² Q² Δt         −1     τ = √3 s
N       white noise (angle random walk)          N² / τ              N²                   −1/2   τ = 1 s
B       bias instability (flicker)               (2 ln 2 / π) B²     B² / (2πf)           0      B = σ/0.664
K       random walk (of the rate)                K² τ / 3            K² / (2πf)²          +1/2   τ = 3 s
R       ramp (steady drift)                      R² τ² / 2           none, deterministic  +1     τ = √2 s
======  =======================================  ==================  ===================  =====  ==========

N is often called random walk too; it is the random walk of the *integral*. K is that of the signal itself.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core.check import Floats
from plumbob.core.units import Quantity

# So many time constants on, a filter takes less than 1.5/10 of the Allan variance of white noise, and soon nothing.
FAR: Final = 10.0


def allan_transfer(n: ArrayLike, frequency: ArrayLike, dt: float) -> Floats:
    """Weight (m, k) of the two-sided density at each frequency, Hz, in the Allan variance of averages over n samples.

    ``σ²(n) = ∫ weight · S df`` over positive frequencies up to half the sampling rate, weight = 4 sin⁴(πfnΔt) / (n
    sin(πfΔt))²: the squared response of a difference of neighbouring averages, both signs of f.
    """
    factor = np.asarray(n, dtype=np.float64)[:, np.newaxis]
    turn = np.pi * np.asarray(frequency, dtype=np.float64) * dt
    square = np.sin(factor * turn) ** 2
    # [IEEE952] Annex C
    return np.asarray(4.0 * square**2 / (factor * np.sin(turn)) ** 2)  # a fourth power would be ten times as slow


def grid(count: int, dt: float, size: int = 1 << 14) -> tuple[Floats, Floats]:
    """Frequencies (size,) and their widths for integrals over a spectrum: evenly spaced by logarithm, and shaken.

    Shaken, because the transfer swings faster than the grid is fine; its mean is then met all the same.
    """
    ends = np.geomspace(0.125 / (count * dt), 0.5 / dt, size + 1)
    width = np.diff(ends)
    return ends[:-1] + width * np.random.default_rng(0).uniform(size=size), width


class Term(NamedTuple):
    """A term whose Allan variance is ``coefficient² · share · τ^power``."""

    # letter, name: Q, N, B, K or R, and in words
    letter: str
    name: str
    # share, power: of the Allan variance
    share: float
    power: int
    # averaging time at which the coefficient is read off its line, s; None where the line is flat
    read_at: float | None


TERMS: Final[dict[str, Term]] = {
    "Q": Term("Q", "quantization", 3.0, -2, math.sqrt(3.0)),  # [IEEE952] Annex C
    "N": Term("N", "white noise", 1.0, -1, 1.0),  # [IEEE952] Annex C
    "B": Term("B", "bias instability", 2.0 * math.log(2.0) / math.pi, 0, None),  # [IEEE952] Annex C
    "K": Term("K", "random walk", 1.0 / 3.0, 1, 3.0),  # [IEEE952] Annex C
    "R": Term("R", "ramp", 0.5, 2, math.sqrt(2.0)),  # [IEEE952] Annex C
}
"""The five terms by letter, from short averaging times to long ones."""

DATASHEET: Final[dict[Quantity, dict[str, str]]] = {
    Quantity.RATE: {"Q": "arcsec", "N": "deg/rth", "B": "deg/h", "K": "deg/h/rth", "R": "deg/h/s"},
    Quantity.ACCELERATION: {"Q": "mm/s", "N": "ug/rtHz", "B": "ug", "K": "ug/s/rtHz", "R": "ug/s"},
    Quantity.FIELD: {"Q": "nT s", "N": "nT/rtHz", "B": "nT", "K": "nT/s/rtHz", "R": "nT/s"},
    Quantity.RATIO: {"Q": "s", "N": "1/rtHz", "B": "1", "K": "1/s/rtHz", "R": "1/s"},
}
"""Unit of each coefficient as data sheets print it, by what the sensor measures; RATIO is for bare numbers."""

DEVIATION: Final[dict[Quantity, str]] = {
    Quantity.RATE: "deg/h",
    Quantity.ACCELERATION: "ug",
    Quantity.FIELD: "nT",
    Quantity.RATIO: "1",
}
"""Unit of an Allan deviation as it is printed."""


SHEETS: Final[dict[Quantity, tuple[tuple[str, float], ...]]] = {
    Quantity.RATE: (("ADIS16505", 0.13), ("VN-100", 0.21), ("LSM6DSO", 0.23), ("MPU-6000", 0.3), ("BMI270", 0.42),
                    ("BMI160", 0.48), ("MPU-9250", 0.6), ("BMI088", 0.84), ("ICM-20948", 0.9)),
    Quantity.ACCELERATION: (("ADIS16505", 20.0), ("LSM6DSO", 70.0), ("LSM9DS1", 100.0), ("VN-100", 140.0),
                            ("BMI160", 150.0), ("ICM-20948", 230.0), ("MPU-9250", 300.0), ("MPU-6000", 400.0)),
}  # fmt: skip
"""N of MEMS parts by their data sheets (those of the simulator's presets), in the units of `DATASHEET`."""


def variance(letter: str, coefficient: float, tau: ArrayLike) -> Floats:
    """Allan variance of one term at the averaging times tau, s, by its coefficient in inside units."""
    term = TERMS[letter]
    return np.asarray(coefficient**2 * term.share * np.asarray(tau, dtype=np.float64) ** term.power)
