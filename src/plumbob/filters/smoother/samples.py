"""From keyframes to samples: what the track says of each, and the stretches that a long recording is cut into."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg
from plumbob.data import ImuData, ImuMeta
from plumbob.data.cards.residuals import Half, full_covariance, uncalibrated
from plumbob.filters.settling import considered
from plumbob.filters.smoother.keyframes import BLOCK, Keyframes
from plumbob.filters.smoother.model import Params, timing_sd
from plumbob.filters.smoother.passes import Smoothed, at_samples, rates
from plumbob.rotations import Frame, dcm_from_quat, quat_conjugate, quat_from_rotvec, quat_multiply, quat_slerp
from plumbob.rotations.frames import turn_heading

GATED: Final = 0.1  # a field that counts with less than this was not used
DOUBTFUL: Final = deg(6.0)  # with a larger standard deviation of the tilt, rad, the attitude is not converged
ANYTHING: Final = math.pi**2 * np.eye(3)  # covariance of an attitude of which nothing is known, rad²
LONG: Final = 1200.0  # a longer recording, s, is smoothed in stretches
CORE: Final = 600.0
"""of this, s,"""
MARGIN: Final = 120.0
"""with so much before and behind each, s. On a stream this is how much of the past a look smooths."""


class SampleEstimates(NamedTuple):
    """Of each sample: attitude to ENU (N, 4), bias (N, 3), rad/s, covariance in body axes (N, 3, 3), flags (N,).

    `weight`, (N,), is how far the field was believed, NaN where there was none.
    """

    q: Floats
    bias: Floats
    cov: Floats
    flags: NDArray[np.uint32]
    weight: Floats

    def rows(self, which: slice | NDArray[np.intp]) -> Self:
        """Of some of the samples."""
        return type(self)(*(of[which] for of in self))  # type: ignore[arg-type]

    def followed_by(self, other: Self) -> Self:
        """Of these samples, and of others behind them."""
        return type(self)(*(np.concatenate(both) for both in zip(self, other, strict=True)))  # type: ignore[arg-type]

    def put(self, which: slice, other: Self) -> None:
        """Write what is known of some of the samples."""
        for column, values in zip(self, other, strict=True):
            column[which] = values  # type: ignore[index]


class Piece(NamedTuple):
    """Samples one after the other: their times, s, the first one with a heading, and whether there are rates."""

    t: Floats
    part: SampleEstimates
    headed: int
    rated: bool


@dataclass(frozen=True, slots=True)
class Stretch:
    """Part of a recording: the samples that are smoothed together, and those of them whose attitude is kept."""

    span: slice
    core: slice

    @property
    def inside(self) -> slice:
        """The core among the smoothed ones."""
        return slice(self.core.start - self.span.start, self.core.stop - self.span.start)


def stretches(t: Floats) -> Iterator[Stretch]:
    """Stretches of a recording, at times (N,), s, whose cores cover it, each sample once."""
    core, around, begin = (CORE, MARGIN, 0) if t[-1] - t[0] > LONG else (math.inf, 0.0, 0)
    while begin < t.size:
        end = max(int(np.searchsorted(t, t[begin] + core)), begin + 1)
        low, high = np.searchsorted(t, t[begin] - around), np.searchsorted(t, t[end - 1] + around, side="right")
        low = min(int(low), max(begin - 1, 0))  # a sample behind a gap is not alone
        yield Stretch(slice(low, max(int(high), end)), slice(begin, end))
        begin = end


def sample_part(data: ImuData, smoothed: Smoothed, p: Params, heading_var: float | None = None) -> SampleEstimates:
    """What is known of every sample of a recording, or of a stretch of one; `heading_var` is that of `FreeHeading`."""
    frames = smoothed.frames
    rate = rates(frames, smoothed.sweep)
    q = at_samples(frames, smoothed.sweep, smoothed.resting, rate)
    place = np.searchsorted(frames.first, np.arange(frames.t.size))
    step, cov, late = np.maximum(place - 1, 0), np.empty((len(q), 3, 3)), timing_sd(p, frames.t) * rate
    for i in range(0, len(q), BLOCK):  # temporaries are larger
        rows = slice(i, i + BLOCK)
        in_n = smoothed.sweep.cov[place[rows], :3, :3]
        cov[rows] = body_cov(q[rows], in_n, smoothed, late[rows], p, data.meta.left)
    if smoothed.reference is None:
        drift, behind = FreeHeading(data.meta, p, heading_var), frames.time[1:][frames.gap]
        gap = float(behind[0]) if behind.size else math.inf
        cov = widened(q, cov, drift.variance(frames.t, q, rate, smoothed.bias_sd, gap))
    lost = smoothed.weightless[step]
    cov[lost] += ANYTHING
    if p.latency:
        q = quat_multiply(q, quat_from_rotvec(p.latency * rate))
    tilt_var = smoothed.sweep.cov[place, 0, 0] + smoothed.sweep.cov[place, 1, 1] + 2.0 * smoothed.tilt_var
    word = np.asarray(data.flags)[frames.rows] | np.where(smoothed.resting[step], np.uint32(flags.AT_REST), 0)
    word[lost | (tilt_var > 2.0 * DOUBTFUL**2)] |= np.uint32(flags.NOT_CONVERGED)
    if smoothed.reference is None:
        word |= np.uint32(flags.HEADING_FREE)
        weight = np.full(len(q), np.nan)
    else:
        weight = smoothed.weight[step]
        word[weight < GATED] |= np.uint32(flags.MAG_GATED)
    return _everywhere(data, frames, SampleEstimates(q, smoothed.sweep.bias[place], cov, word, weight))


class FreeHeading:
    """What nothing shows of the gyroscope, in a heading without a field: it counts from the first sample on.

    Errors of scale and axes turn the heading by their shares of what the unit has turned about the vertical; a bias
    does so with time. A heading that was given with a variance, rad², may be any behind a gap.
    """

    def __init__(self, meta: ImuMeta, p: Params, given: float | None = None) -> None:
        if meta.gyr_left is not None:  # the prior of the filter
            self._scale = np.zeros((3, 3))
        elif meta.calibration is None:
            self._scale = np.diag(full_covariance(uncalibrated("gyr")))[3:].reshape(3, 3)
        else:
            self._scale = np.diag(np.full(3, max(p.gyr_scale**2 - p.gyr_misalignment**2, 0.0)))
        self._given = given
        self._begin, self._end, self._ways = math.nan, math.nan, np.zeros((3, 3))

    def variance(self, t: Floats, q: Floats, rate: Floats, bias_sd: Floats | float, gap: float) -> Floats:
        """Variance of the heading at the next samples, rad², (N,), at which the bias is known to `bias_sd`, rad/s.

        The first gap ended at `gap`, s; infinity without one.
        """
        if math.isnan(self._begin):
            self._begin = self._end = float(t[0])
        step, up = np.diff(t, prepend=self._end)[:, np.newaxis], vertical_in_body(q)
        variance: Floats = (bias_sd * (t - self._begin)) ** 2
        for axis in range(3):
            ways = np.concatenate((self._ways[axis : axis + 1], up[:, axis, np.newaxis] * rate * step))
            np.cumsum(ways, axis=0, out=ways)
            self._ways[axis] = ways[-1]
            for i in range(3):  # a product of matrices would round by how many rows there are
                variance += ways[1:, i] ** 2 * self._scale[axis, i]
        self._end = float(t[-1])
        return variance if self._given is None else variance + np.where(t < gap, self._given, math.pi**2)


def vertical_in_body(q: Floats) -> Floats:
    """The vertical in body axes, (N, 3)."""
    up: Floats = dcm_from_quat(q)[:, 2, :]
    return up


def heading_variance_at(part: SampleEstimates, row: int) -> float:
    """Variance of the heading at a sample, rad²."""
    up = vertical_in_body(part.q[row : row + 1])[0]
    return float(up @ part.cov[row] @ up)


def widened(q: Floats, cov: Floats, variance: Floats) -> Floats:
    """Covariance (N, 3, 3) in body axes with a variance (N,) of the heading in addition."""
    up = vertical_in_body(q)
    total: Floats = cov + variance[:, np.newaxis, np.newaxis] * (up[:, :, np.newaxis] * up[:, np.newaxis, :])
    return total


def unknown(data: ImuData, q: Floats, bias: Floats) -> SampleEstimates:
    """A stretch in which no rate was measured: the attitude (4,) before it stays, and may be any."""
    n = len(data)
    lost = np.asarray(data.flags) | np.uint32(flags.GYR_HELD | flags.NOT_CONVERGED | flags.HEADING_FREE)
    return SampleEstimates(
        np.tile(q, (n, 1)), np.tile(bias, (n, 1)), np.tile(ANYTHING, (n, 1, 1)), lost, np.full(n, np.nan)
    )


def continued(part: SampleEstimates, stretch: Stretch, before: Floats, last: Stretch) -> SampleEstimates:
    """A stretch whose heading is free, turned to the attitudes (N, 4) of the one before by what both have."""
    low, high = stretch.span.start, min(last.span.stop, stretch.core.start + 1)
    if high <= low:
        return part
    overlap, other = part.q[: high - low], before[low - last.span.start : high - last.span.start]
    turn = quat_multiply(other, quat_conjugate(overlap))
    angle = 2.0 * math.atan2(float((turn[:, 3] * turn[:, 0]).sum()), float((turn[:, 0] ** 2).sum()))
    return part._replace(q=turn_heading(part.q, -angle, Frame.ENU))


def body_cov(q: Floats, in_n: Floats, smoothed: Smoothed, late: Floats, p: Params, halves: tuple[Half, Half]) -> Floats:
    """Covariance of the attitude error in body axes, of one in navigation axes (N, 3, 3), and what is not estimated.

    `late` (N, 3) is by how much the body turns in the standard deviation of the time, rad.
    """
    c_nb, in_n = dcm_from_quat(q), in_n.copy()
    in_n[:, [0, 1], [0, 1]] += (p.acc_offset / G0) ** 2 + smoothed.tilt_var
    if smoothed.reference is not None:
        in_n[:, 2, 2] += smoothed.heading_var + p.mag_direction_sd**2
    cov = np.swapaxes(c_nb, 1, 2) @ in_n @ c_nb
    cov += late[:, :, np.newaxis] * late[:, np.newaxis, :]
    if any(halves[0]) or any(halves[1]):
        reference = smoothed.reference
        field = np.zeros(2) if reference is None else np.array([reference.level, reference.vertical])
        cov += considered(q, np.broadcast_to(field, (len(q), 2)), 1.0, (0.0, 1.0), *halves)
    found_cov: Floats = 0.5 * (cov + np.swapaxes(cov, 1, 2))
    return found_cov


def _everywhere(data: ImuData, frames: Keyframes, part: SampleEstimates) -> SampleEstimates:
    """The same at all samples, those in holes too: the shortest way between, as uncertain as it is long."""
    n, rows = len(data), frames.rows
    if rows.size == n:
        return part
    t, each = np.asarray(data.t), np.arange(n)
    after = np.clip(np.searchsorted(rows, each), 0, rows.size - 1)
    before = np.where(rows[after] == each, after, np.maximum(after - 1, 0))
    inside, held = before != after, rows[before] != each
    held &= rows[after] != each
    span = np.where(inside, frames.t[after] - frames.t[before], 1.0)
    share = np.clip(np.where(inside, (t - frames.t[before]) / span, 0.0), 0.0, 1.0)
    turn = quat_multiply(quat_conjugate(part.q[before]), part.q[after])
    angle = 2.0 * np.arccos(np.clip(np.abs(turn[:, 0]), 0.0, 1.0))
    wide = np.where(inside, 0.5 * angle, math.pi) ** 2 * held
    words = part.flags[before] | np.asarray(data.flags)
    lost = (words & ~np.uint32(flags.AT_REST)) | flags.GYR_HELD | flags.NOT_CONVERGED
    return SampleEstimates(
        quat_slerp(part.q[before], part.q[after], share),
        part.bias[before],
        part.cov[before] + wide[:, np.newaxis, np.newaxis] * np.eye(3),
        np.where(held, lost, words).astype(np.uint32),
        part.weight[before],
    )
