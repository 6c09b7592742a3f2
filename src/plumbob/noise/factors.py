"""Averaging factors: how many samples are averaged, and which numbers of them a record allows.

Deviations of rates over averaging time: Allan, modified Allan, Hadamard and total [Riley2008].

The running sum θ of N rates has N + 1 points. Every kind is a mean square of differences d of order 2 or 3, taken at
spacing n of points x that are θ or made of it::

    σ²(n) = Σ d² / (a n² terms)      d = x[k + 2n] − 2 x[k + n] + x[k]  or
                                     d = x[k + 3n] − 3 x[k + 2n] + 3 x[k + n] − x[k]

======  ===============================  ===================================  =====  =  ============
kind    name                             points x                             order  a  n at most
======  ===============================  ===================================  =====  =  ============
oadev   overlapping Allan                θ                                    2      2  N / 2
adev    Allan                            every n-th of θ                      2      2  N / 2
mdev    modified Allan, overlapping      running sum of θ, over n             3      2  (N + 1) / 3
ohdev   overlapping Hadamard             θ                                    3      6  N / 3
hdev    Hadamard                         every n-th of θ                      3      6  N / 3
totdev  total, without bias correction   θ and its reflections in both ends   2      2  N
======  ===============================  ===================================  =====  =  ============

So σ has the unit of the rates and needs no sampling time; its averaging time is τ = n Δt. The mean rate is removed
before the sum: it cancels in every difference, but would take its digits.

Rounding costs σ of 1e5 samples some 1e-14 for white noise, 1e-12 for a random walk and 1e-10 for a drift of a hundred
times the noise; mdev of a walk 1e-11 at n < 10.

The overlapping Allan deviation at every averaging factor at once, in O(N log² N) operations.

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
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise import kernels
from plumbob.noise.kernels import second_squares

Factors = NDArray[np.int64]
STREAMED: Final = 2**14  # a stream takes every difference where fewer samples are averaged


def whole_factors(n: ArrayLike, longest: int, why: str) -> Factors:
    """Averaging factors n (m,) of the user; ParameterError where one is not a whole number from 1 to `longest`."""
    factors = check.column("n", n)
    if not factors.size:
        raise ParameterError("n must hold at least one averaging factor, but it is empty.")
    fit = (factors >= 1.0) & (factors <= longest) & (factors == np.floor(factors))
    if not fit.all():
        i = int(np.argmin(fit))
        raise ParameterError(f"n[{i}] = {factors[i]:g}, but {why} whole numbers from 1 to {longest} can be averaged.")
    return factors.astype(np.int64)


def log_factors(count: int, *, per_decade: int = 16) -> Factors:
    """Averaging factors that lie evenly on a logarithmic axis, from 1 to half the record.

    They are 10^(i / per_decade) rounded to whole numbers, each once, whatever the length of the record: so curves of
    different records share their averaging times.

    Parameters
    ----------
    count : int
        Samples N of the record.
    per_decade : int
        How many, where whole numbers lie close enough.

    Returns
    -------
    ndarray (m,) of int64
        Increasing, at most N / 2.

    Raises
    ------
    ParameterError
        If the record has less than two samples, or no factor is asked for.
    """
    if count < 2 or per_decade < 1:
        raise ParameterError(
            f"count = {count}, per_decade = {per_decade}, but an Allan deviation needs two samples or more, and a "
            "grid one factor per decade or more."
        )
    steps = np.arange(np.floor(per_decade * np.log10(count)) + 1.0)
    factors = np.unique(np.round(10.0 ** (steps / per_decade))).astype(np.int64)
    return factors[factors <= count // 2]


def stream_steps(n: Factors) -> Factors:
    """Every how many samples a stream takes a difference: the power of two that leaves n/step from 2¹³ to 2¹⁴."""
    return np.asarray(2 ** np.maximum(0, np.frexp(n / STREAMED)[1]), dtype=np.int64)


def stream_factors(n: ArrayLike) -> Factors:
    """Averaging factors that a stream can take: each rounded to a multiple of its step, by 1/16384 of it at most.

    Parameters
    ----------
    n : array_like (m,)
        Whole numbers from 1, as of `log_factors`.

    Returns
    -------
    ndarray (m,) of int64
        Increasing, each once.

    Raises
    ------
    ParameterError
        If a factor is not a whole number.
    """
    factors = whole_factors(n, 2**48, "for a stream")
    steps = stream_steps(factors)
    return np.unique(np.round(factors / steps).astype(np.int64) * steps)


def _every_nth(points: Floats, n: int) -> tuple[Floats, int]:
    return np.ascontiguousarray(points[::n]), 1


def _centred(points: Floats, n: int) -> tuple[Floats, int]:
    """Those mirrored points whose differences have their middle on θ, its ends left out."""
    count = (points.size + 1) // 3
    return points[count - n : 2 * count - 1 + n], n


class DeviationKind(NamedTuple):
    """How a deviation is made of the cumulative sum."""

    order: int  # of the differences: 2 for Allan's, 3 for Hadamard's
    averaged: bool  # whether the sum is averaged over n points first, as the modified deviation does
    overlapping: bool  # whether every difference is used, or every n-th
    add_squares: Callable[[Floats, Factors, Floats], None]  # of its differences
    view: Callable[[Floats, int], tuple[Floats, int]] | None = None  # points and spacing at n; else all, n apart

    @property
    def levels(self) -> tuple[int, ...]:
        """Exponents α of the noises for which the deviation is finite, and which it separates, increasing.

        Without the average, flicker of the angle (1) is as steep as its quantization (2), which is what sensors have.
        """
        return (*range(2 - 2 * self.order, 1), *((1, 2) if self.averaged else (2,)))

    def terms(self, count: int, n: int) -> int:
        """How many differences `count` samples give at the factor n."""
        room = count + 1 - self.order * n - (n - 1 if self.averaged else 0)
        return room if self.overlapping else (room - 1) // n + 1


SHAPES: Final[dict[str, DeviationKind]] = {
    "oadev": DeviationKind(2, False, True, second_squares),  # [Riley2008] (11)
    "adev": DeviationKind(2, False, False, second_squares, _every_nth),  # [Riley2008] (7)
    "mdev": DeviationKind(2, True, True, kernels.modified_squares),  # [Riley2008] (14)
    "ohdev": DeviationKind(3, False, True, kernels.third_squares),  # [Riley2008] (20)
    "hdev": DeviationKind(3, False, False, kernels.third_squares, _every_nth),  # [Riley2008] (18)
    "totdev": DeviationKind(2, False, True, second_squares, _centred),  # [Riley2008] (25)
}
"""By name of the deviation. The total deviation extends the record, and is Allan's overlapping one inside it."""

KINDS: Final = tuple(SHAPES)
"""Overlapping Allan, Allan, modified Allan (overlapping), overlapping Hadamard, Hadamard, total."""


def longest_factor(kind: str, count: int) -> int:
    """Longest averaging factor that `count` samples allow, refusing unknown kinds by a `ShapeError`."""
    shape = SHAPES[check.one_of("kind", kind, KINDS)]
    return (count + shape.averaged) // (shape.order + shape.averaged)


def checked_factors(kind: str, count: int, n: ArrayLike) -> Factors:
    """Averaging factors n as integers, for a kind and `count` samples."""
    return whole_factors(n, longest_factor(kind, count), f"for {kind} of {count} samples")


KEPT: Final = 1 << 19  # so many averages are kept; at twice as many, neighbours are averaged


class Averager:
    """Keeps means of 1, 2, 4, … consecutive samples, as many as it takes for all of them to fit.

    Parameters
    ----------
    channels : int
        Columns of the blocks.
    kept : int
        How many means are kept at most; an even number.
    """

    def __init__(self, channels: int, kept: int = KEPT) -> None:
        self.averaged = 1
        self._means = np.empty((kept, channels))
        self._filled = 0
        self._rest = np.empty((0, channels))

    def feed(self, block: Floats) -> None:
        """Add the next samples (rows, channels)."""
        block = np.concatenate((self._rest, block))
        while True:
            room = self._means.shape[0] - self._filled
            count = min(block.shape[0] // self.averaged, room)
            used = count * self.averaged
            means = block[:used].reshape(count, self.averaged, block.shape[1]).mean(axis=1)
            self._means[self._filled : self._filled + count] = means
            self._filled += count
            block = block[used:]
            if block.shape[0] < self.averaged:
                break
            pairs = self._means.reshape(-1, 2, self._means.shape[1]).mean(axis=1)
            self._filled = pairs.shape[0]
            self._means[: self._filled] = pairs
            self.averaged *= 2
        self._rest = block.copy()

    def values(self) -> Floats:
        """Means so far (m, channels); samples at the end that fill no mean are left out."""
        return self._means[: self._filled]


def deviation(rate: ArrayLike, n: ArrayLike, kind: str = "oadev") -> Floats:
    """Deviation at some averaging factors.

    Parameters
    ----------
    rate : array_like (N,) or (N, k)
        Evenly spaced samples, without any missing; each column is a channel of its own.
    n : array_like (m,)
        How many samples are averaged: whole numbers from 1 to what the kind allows (see the module), in any order.
    kind : str
        One of `plumbob.noise.KINDS`.

    Returns
    -------
    ndarray (m,) or (m, k)
        In the unit of the rates.

    Raises
    ------
    ShapeError
        If a sample is not finite, or the kind is unknown.
    ParameterError
        If a factor is not a whole number, or the record is too short for it.
    """
    samples = check.floats("rate", rate)
    angles = [*running_sums(samples)]
    factors = checked_factors(kind, len(samples), n)
    increasing, places = np.unique(factors, return_inverse=True)
    deviations = np.array([np.sqrt(_variance(angle, increasing, kind)) for angle in angles]).T
    return np.ascontiguousarray(deviations[places].reshape(factors.size, *samples.shape[1:]))


def running_sums(rate: Floats) -> Iterator[Floats]:
    """For each channel of the rates (N,) or (N, k), its θ (N + 1,): the running sum about the mean, from 0.

    ShapeError if a sample is not finite.
    """
    if rate.ndim not in {1, 2} or rate.size == 0:
        raise ShapeError(f"rate must have shape (N,) or (N, k) and hold samples, but its shape is {rate.shape}.")
    for column in map(np.ascontiguousarray, rate.reshape(rate.shape[0], -1).T):
        with np.errstate(all="ignore"):
            mean = float(np.mean(column))
        if not math.isfinite(mean):  # as one sample is enough for; a test of every sample would be one more pass
            raise unusable(rate)
        angle = np.zeros(column.size + 1)
        kernels.accumulate(column, mean, 0.0, angle[1:])
        yield angle


def unusable(rate: Floats, before: int = 0) -> ShapeError:
    """Error for rates (N,) or (N, k) whose sum is not finite; so many samples came `before` them."""
    bad = np.argwhere(~np.isfinite(rate))
    if not bad.size:
        return ShapeError(f"rate holds numbers too large to be added, up to {np.max(np.abs(rate)):g}.")
    place = ", ".join(str(i) for i in (before + bad[0][0], *bad[0][1:]))
    return ShapeError(
        f"rate[{place}] is not finite ({len(bad)} such values), but a deviation needs every sample: take a stretch "
        "without gaps."
    )


def _variance(angle: Floats, factors: Factors, kind: str) -> Floats:
    shape = SHAPES[kind]
    points, inner = angle, angle[-2:0:-1]
    if kind == "totdev":  # θ, continued beyond each end by its reflection in the end point: 3N − 1 points
        points = np.concatenate((2.0 * angle[0] - inner, angle, 2.0 * angle[-1] - inner))  # [Riley2008] (25)
    sums, terms = np.zeros(factors.size), np.empty(factors.size)
    if shape.view is None:
        shape.add_squares(points, factors, sums)  # together, which is several times as fast
    for j, n in enumerate(factors.tolist()):
        strided, spacing = (points, n) if shape.view is None else shape.view(points, n)
        # the last point of a difference lies so far behind its first
        terms[j] = strided.size - ((shape.order + shape.averaged) * spacing - shape.averaged)
        if shape.view is not None:
            shape.add_squares(strided, np.array([spacing]), sums[j : j + 1])
    scale = math.comb(2 * shape.order - 2, shape.order - 1)  # squares of white noise in a difference of averages
    return np.asarray(sums / (scale * factors.astype(np.float64) ** 2 * terms))


ACCURACY: Final = 1e-12  # bound of the relative error of σ against direct sums of the same θ
# What the products may err by, of the 2e-12 in σ²; a quarter is for the roundings of a direct sum.
_SHARE: Final = 1.5 * ACCURACY
_EPS: Final = float(np.finfo(np.float64).eps)
# Of S(m) over r(0): if all roundings conspired, r could err by 6 eps at each of the log2 P levels of its transform, and
# S by ten times that. They do not: over 4000 records of 20 to 1e5 points, with the code of five kinds of processor, the
# rms error of S over a record's m stayed below 14 eps, and the largest was 35.
# [Percival2003]: the 6 eps of a level
_ROUNDING: Final = 64.0 * _EPS
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
    angles, count = [*running_sums(samples)], len(samples)
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
        share = float(np.dot(parabola, x) / np.dot(parabola, parabola))
        upper = share * (2.0 ** (53 - bits) + 1.0)  # [Dekker1971]: of so many significant bits
        part = upper - (upper - share)
        x, bend = x - part * parabola, bend + part
    return x, bend


def _weighted(values: Floats, middle: float, n: Factors) -> tuple[Floats, float]:
    """Sum of head, `middle` times the middle, and tail, P − 2n values each; and the largest running sum."""
    running = np.empty(values.size + 1)
    kernels.sum_accurately(values, running)
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
        kernels.add_triangles(points, edge, row)
    for level in range(1, levels + 1):
        length, half = edge << level, edge << level - 1
        early = fft.rfft(padded[:, :size].reshape(2, -1, length)[:, :, :half], length)
        late = fft.rfft(padded[:, half : half + 2 * size].reshape(2, -1, 2 * length)[:, :, :length])
        sums.reshape(2, -1, length)[:, :, half:] += fft.irfft(early.conj() * late, length)[:, :, :half]
    return sums
