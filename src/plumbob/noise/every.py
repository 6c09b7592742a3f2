"""The overlapping Allan deviation at every averaging factor at once, in O(N log² N) operations.

Written out, the sum of squared differences of the P = N + 1 points x holds squares and three products::

    S(m) = Σ (x[k + 2m] − 2 x[k + m] + x[k])²,  k = 0 … P − 2m − 1
         = A(m) + 2 r(2m) − 8 r(m) + 4 (H(m) + T(m))

    A(m)  sums of squares over the head, the middle (four times) and the tail of x
    r(m)  Σ x[k] x[k + m] over all k: one Fourier transform gives all of them
    H(m)  Σ x[k] x[k + m] over k < m: what r(m) holds too much for the second product
    T(m)  the same of x read backwards: what r(m) holds too much for the first

H runs over a triangle of pairs (m, k). Halved again and again, it falls into squares, in each of which H is a piece of
a correlation of its own, and into small triangles along its edge. The square of node i at length L are
iL ≤ k < iL + L/2 and iL + L/2 ≤ m < (i + 1) L.

These terms are of the size of r(0), their sum may be smaller by many digits. Therefore x is θ without its end-to-end
line and without the parabola that a ramp of the rates makes of it, whose part is added in closed form; and where the
rounding of r(0) could still be seen, S(m) is summed directly.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.noise.factors import Factors, running_sums
from plumbob.noise.kernels import add_triangles, second_squares, sum_accurately

ACCURACY: Final = 1e-12
"""Bound of the relative error of σ against direct sums of the same θ."""
_SHARE: Final = 1.5 * ACCURACY
"""What the products may err by, of the 2e-12 in σ²; a quarter is for the 4096 + N / 2048 roundings of a direct sum."""
_EPS: Final = float(np.finfo(np.float64).eps)
_ROUNDING: Final = 64.0 * _EPS
"""Of S(m) over r(0). If all roundings conspired, r could err by 6 eps at each of the log2 P levels of its transform
[Percival2003], and S by ten times that. They do not, whatever order a processor adds in and whether or not it fuses:
over 4000 records of 20 to 1e5 points, with the code of five kinds of processor, the rms error of S over a record's m
stayed below 14 eps, and the largest was 35."""
_TRIANGLE: Final = 256  # at most so long are the edges of the triangles that are summed directly


def every_adev(rate: ArrayLike) -> Floats:
    """Overlapping Allan deviation at n = 1, 2, 3 … N / 2.

    The time is that of some Fourier transforms where averages of many samples differ not much less than the record
    wanders, as in white noise, flicker and ramps. Each n of which this is not so costs as much as in `deviation`: in a
    random walk those up to about N / 40.

    Parameters
    ----------
    rate : array_like (N,) or (N, k)
        Evenly spaced samples, two or more without any missing; each column is a channel of its own.

    Returns
    -------
    ndarray (N // 2,) or (N // 2, k)
        In the unit of the rates; entry i is that of n = i + 1, within 1e-12 of `deviation`.

    Raises
    ------
    ShapeError
        If a sample is not finite.
    ParameterError
        If there are less than two samples.
    """
    samples = check.floats("rate", rate)
    angles = running_sums(samples)
    count = samples.shape[0]
    if count < 2:
        raise ParameterError(f"rate holds {count} sample, but an Allan deviation needs two or more.")
    deviations = np.array([_every(angle) for angle in angles]).T
    return np.ascontiguousarray(deviations.reshape(count // 2, *samples.shape[1:]))


def _every(angle: Floats) -> Floats:
    count = angle.size - 1
    n = np.arange(1, count // 2 + 1)
    sums, error = _sums_of_squares(angle, n)
    doubtful = ~(error <= _SHARE * sums)
    direct = np.zeros(np.count_nonzero(doubtful))
    second_squares(angle, n[doubtful], direct)
    sums[doubtful] = direct
    return np.asarray(np.sqrt(sums / (2.0 * (count + 1 - 2 * n))) / n)


def _sums_of_squares(angle: Floats, n: Factors) -> tuple[Floats, Floats]:
    """S at each n from 1 to the last, and a bound of its error."""
    x, bend = _without_parabola(angle)
    products = _autocorrelation(x)
    size = products[0]
    ends = _head_products(np.stack((x, x[::-1])), n.size + 1).sum(axis=0)
    straight = _weighted(x * x, 4.0, n)[0] + 2.0 * products[2 * n] - 8.0 * products[n] + 4.0 * ends[n]
    area, largest = _weighted(x, -2.0, n)
    ramp = bend * n.astype(np.float64) ** 2
    sums = straight + ramp * (2.0 * area + ramp * (angle.size - 2 * n))
    return sums, _ROUNDING * (size + 2.0 * np.abs(ramp) * largest) + 8.0 * _EPS * np.abs(sums)


def _without_parabola(angle: Floats) -> tuple[Floats, float]:
    """θ less its best multiple of a parabola whose second difference at spacing n is n²; and that multiple.

    θ may be larger than what is left by many digits, so nothing may be rounded to its last one: the multiple is made of
    two of so few bits that their products with the parabola are exact, and each difference rounds no more than itself.
    """
    k = np.arange(angle.size, dtype=np.float64)
    parabola = 0.5 * k * (k - k[-1])
    bits = max(1, 55 - 2 * angle.size.bit_length())
    x, bend = angle, 0.0
    for _ in range(2):
        part = _rounded(float(np.dot(parabola, x) / np.dot(parabola, parabola)), bits)
        x, bend = x - part * parabola, bend + part
    return x, bend


def _rounded(value: float, bits: int) -> float:
    """About the same with so many significant bits: the upper part of [Dekker1971]."""
    upper = value * (2.0 ** (53 - bits) + 1.0)  # [Dekker1971]
    return upper - (upper - value)


def _weighted(values: Floats, middle: float, n: Factors) -> tuple[Floats, float]:
    """Sum of head, `middle` times the middle, and tail, P − 2n values each; and the largest running sum."""
    running = np.empty(values.size + 1)
    sum_accurately(values, running)
    head, tail = running[values.size - 2 * n], running[-1] - running[2 * n]
    return head + middle * (running[values.size - n] - running[n]) + tail, float(np.max(np.abs(running)))


def _autocorrelation(x: Floats) -> Floats:
    """Σ x[k] x[k + m] over all k, for m = 0 … x.size − 1."""
    from scipy import fft

    length = fft.next_fast_len(2 * x.size, real=True)
    spectrum = fft.rfft(x, length)
    return np.asarray(fft.irfft(spectrum.real**2 + spectrum.imag**2, length)[: x.size])


def _head_products(x: Floats, count: int) -> Floats:
    """Σ x[k] x[k + m] over k < m, for m < count and each row of x (2, P)."""
    from scipy import fft

    levels = max(0, math.ceil(math.log2(count / _TRIANGLE)))
    edge = fft.next_fast_len(-(-count >> levels), real=True)
    size = edge << levels
    padded = np.zeros((2, 5 * size // 2 + 1))
    padded[:, : x.shape[1]] = x
    sums = np.zeros((2, size))
    for row, points in zip(sums, padded, strict=True):
        add_triangles(points, edge, row)
    for level in range(1, levels + 1):
        length, half = edge << level, edge << level - 1
        early = fft.rfft(padded[:, :size].reshape(2, -1, length)[:, :, :half], length)
        late = fft.rfft(padded[:, half : half + 2 * size].reshape(2, -1, 2 * length)[:, :, :length])
        sums.reshape(2, -1, length)[:, :, half:] += fft.irfft(early.conj() * late, length)[:, :, :half]
    return sums
