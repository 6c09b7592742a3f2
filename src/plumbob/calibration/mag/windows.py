"""Windows of a record in use: attitudes by a gyroscope's rates, how they lean by its errors, and the field.

The mean of ``A Rᵀ h + b`` over a part is that of R put in, so samples are averaged with the turns they were taken at.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.units import deg, dps
from plumbob.rotations import dcm_from_quat, quat_chained, quat_from_rotvec, quat_multiply

# Of a turn of a gyroscope's axes together about each, rad, without a card: 0.4 % across.
TURN_SD: Final = float(deg(0.25))

_BIAS_SD: Final = float(dps(10.0))  # rad/s; no MEMS gyroscope is off by more, and most by less
_DELAY_SD: Final = 0.02  # s; periods of 10 ms, and filters of as much again
_EXACT: Final = 1e-6  # gain that counts as known


def by_error(turns: Floats, angles: Floats, dt: Floats) -> Floats:
    """How attitudes (N, 3, 3) lean by bias and gain of a gyroscope that measures angles (N, 3) in dt (N, 1)."""
    by_gain = np.einsum("nij,nk->nijk", turns, angles).reshape(-1, 3, 9)
    return np.concatenate((-turns * dt[:, np.newaxis], by_gain), axis=2)


def leaning(turns: Floats, angles: Floats, measured: Floats, dt: Floats) -> Floats:
    """How attitudes (N, 3, 3) lean since the first, (N, 3, 12), by bias and gain of a gyroscope, by Simpson's rule.

    `angles` (N - 1, 3) are the rotations between them, rad, `measured` as the gyroscope did, `dt` (N - 1, 1) in s.
    """
    middle = turns[:-1] @ dcm_from_quat(quat_from_rotvec(0.5 * angles))
    each = by_error((turns[:-1] + 4.0 * middle + turns[1:]) / 6.0, measured, dt)
    return np.concatenate((np.zeros((1, 3, 12)), np.cumsum(each, axis=0)))


def tightness(gain_sd: float) -> Floats:
    """Inverse covariance (13, 13) of what a gyroscope's bias, gain matrix and the delay can be.

    A turn of all its axes together is less than what a data sheet grants each, because they share a die or a package.
    """
    gain_sd = max(gain_sd, _EXACT)
    precision = np.diag(1.0 / np.repeat((_BIAS_SD, np.inf, _DELAY_SD), (3, 9, 1)) ** 2)
    other = np.eye(9)[np.arange(9).reshape(3, 3).T.ravel()]  # the entry on the other side of the diagonal
    turn_sd = min(gain_sd, math.sqrt(2.0) * TURN_SD)
    precision[3:12, 3:12] = 0.5 * ((np.eye(9) + other) / gain_sd**2 + (np.eye(9) - other) / turn_sd**2)
    return precision


def floored_inverse(normal: Floats) -> Floats:
    """Inverse of a normal matrix; what it does not determine gets a huge variance, not none."""
    spread = np.sqrt(np.diag(normal))
    sizes, axes = np.linalg.eigh(normal / np.outer(spread, spread))
    inverse = (axes / np.maximum(sizes, 1e-14 * sizes[-1])) @ axes.T
    return np.asarray(inverse / np.outer(spread, spread))


PART: Final = 0.25  # longest part of a window, s
TURN: Final = float(deg(10.0))  # turn within a part up to which the mean attitude tells how it leans, rad
GAP: Final = 0.5  # longest time without a rate across which an attitude is followed, s
SEGMENT: Final = 600.0  # s over which a gyroscope's bias is constant, but for records of more than `MOST_SEGMENTS`
MOST_SEGMENTS: Final = 36

FEWEST: Final = 10  # samples of the field in a window
_CHUNK: Final = 100_000  # samples


class Gyroscope(NamedTuple):
    """Errors of a gyroscope: bias (K, 3) of each segment, rad/s, gain (3, 3) beyond one, and the field's delay, s."""

    bias: Floats
    gain: Floats
    delay: float


class Windows(NamedTuple):
    """Means over the P parts of W windows; attitudes are against axes that stay until rates are missing for long."""

    start: Floats  # (W,), time at which each begins, s since the first sample
    linked: NDArray[np.bool_]  # (W,), whether the next one begins where it ends
    fields: Floats  # (W, P, 3), measured field; zero where `known` is not
    known: NDArray[np.bool_]  # (W, P), whether a part has samples of the field
    turns: Floats  # (W, P, 3, 3), transposed attitude: to the axes of the body
    leans: Floats  # (W, P, 3, 12), how the attitude leans, since the window's start, by the gyroscope's bias and gain
    leant: Floats  # (W, 3, 12), the same at the window's end
    rates: Floats  # (W, P, 3), rates, rad/s


def window_edges(t: Floats, present: NDArray[np.bool_], length: float) -> NDArray[np.intp]:
    """First sample and end (W, 2) of windows in which no rate is missing for long, and some of the field are there."""
    bounds = np.searchsorted(t, np.arange(t[0], t[-1] + 1e-9, length))
    edges = np.column_stack((bounds[:-1], bounds[1:]))
    counts = np.concatenate(([0], np.cumsum(present)))
    edges = edges[edges[:, 1] - edges[:, 0] >= 2]
    gaps = _gaps(t)
    gapless = gaps[edges[:, 1] - 1] == gaps[edges[:, 0]]
    spans = t[edges[:, 1] - 1] - t[edges[:, 0]] > 0.5 * length
    enough = counts[edges[:, 1]] - counts[edges[:, 0]] >= FEWEST
    return np.asarray(edges[gapless & spans & enough])


def part_count(t: Floats, gyr: Floats, length: float) -> int:
    """How many parts a window has, so that the unit turns little within each."""
    rate = math.sqrt(float(np.mean(np.sum(gyr * gyr, axis=1))))
    longest = min(PART, TURN / rate) if rate > 0.0 else PART
    return max(1, math.ceil(length / max(float(np.median(np.diff(t))), longest)))


def mean_windows(
    t: Floats, mag: Floats, gyr: Floats, edges: NDArray[np.intp], part: float, parts: int, errors: Gyroscope
) -> Windows:
    """Means over the `parts` of `part` s of windows (W, 2), first sample and end, some windows at a time.

    Of times t (N,), s, field (N, 3), NaN where there is none, and rates (N, 3), rad/s, which `errors` corrects.
    """
    chunks, k, q = [], 0, np.array([1.0, 0.0, 0.0, 0.0])
    while k < len(edges):
        stop = max(k + 1, int(np.searchsorted(edges[:, 1], edges[k, 0] + _CHUNK, side="right")))
        windows, q = _chunk(t, mag, gyr, edges[k:stop], part, parts, errors, q)
        chunks.append(windows)
        k = stop
    joined = Windows(*(np.concatenate(each) for each in zip(*chunks, strict=True)))
    gaps = _gaps(t)
    linked = (edges[:-1, 1] == edges[1:, 0]) & (gaps[edges[1:, 0]] == gaps[edges[:-1, 0]])
    return joined._replace(linked=np.append(linked, False))


def segments_in(lasting: float) -> int:
    """How many segments a record of so many seconds has."""
    return min(MOST_SEGMENTS, max(1, round(lasting / SEGMENT)))


def segment_index(since: Floats, lasting: float, count: int) -> NDArray[np.intp]:
    """Segment of times (N,), s since the first sample, in a record of so many seconds that has `count` of them."""
    return np.minimum((since * (count / lasting)).astype(np.intp), count - 1)


def _gaps(t: Floats) -> NDArray[np.intp]:
    """How many gaps there are before each sample."""
    return np.concatenate(([0], np.cumsum(np.diff(t) > GAP)))


def _chunk(
    t: Floats, mag: Floats, gyr: Floats, edges: NDArray[np.intp], part: float, parts: int, errors: Gyroscope, q: Floats
) -> tuple[Windows, Floats]:
    """Some windows that follow each other, and the attitude at their end, from that at their start."""
    first, stop = int(edges[0, 0]), min(int(edges[-1, 1]) + 1, len(t))
    since = t[first:stop] - t[0]
    bias = errors.bias[segment_index(since, float(t[-1] - t[0]), len(errors.bias))]
    rates = gyr[first:stop] + gyr[first:stop] @ errors.gain.T - bias
    angles = 0.5 * (rates[1:] + rates[:-1]) * np.diff(since)[:, np.newaxis]
    attitude = quat_multiply(q, quat_chained(angles))
    turns = dcm_from_quat(attitude)
    leans = leaning(turns, angles, angles, np.diff(since)[:, np.newaxis])
    late = np.asarray(turns @ dcm_from_quat(quat_from_rotvec(-errors.delay * rates)))
    rows = np.concatenate([np.arange(a, b) for a, b in (edges - first).tolist()])
    window = np.repeat(np.arange(len(edges)), np.diff(edges, axis=1)[:, 0])
    started = since[edges[:, 0] - first]
    place = window * parts + np.minimum(((since[rows] - started[window]) / part).astype(np.intp), parts - 1)
    present = np.isfinite(mag[first:stop][rows]).all(axis=1)
    rows, place = rows[present], place[present]
    count = np.bincount(place, minlength=len(edges) * parts)

    def means(values: Floats) -> Floats:
        flat = values[rows].reshape(len(rows), -1)
        sums = np.stack([np.bincount(place, weights=column, minlength=len(count)) for column in flat.T], axis=1)
        return np.asarray(sums / np.maximum(count, 1)[:, np.newaxis]).reshape(len(edges), parts, *values.shape[1:])

    begin, end = (edges - first).T
    leant = leans[np.minimum(end, len(leans) - 1)] - leans[begin]
    filled = (count > 0).reshape(len(edges), parts)
    since_start = (means(leans) - leans[begin][:, np.newaxis]) * filled[:, :, np.newaxis, np.newaxis]
    turned = means(np.swapaxes(late, 1, 2))
    linked = np.zeros(len(edges), dtype=np.bool_)
    windows = Windows(started, linked, means(mag[first:stop]), filled, turned, since_start, leant, means(rates))
    return windows, np.asarray(attitude[-1])
