"""Arrangement, scale and delay of an accelerometer: turned back by the rates, gravity stays where it is.

What pushes a unit to and fro averages out over a second or more only in axes that do not turn. So each arrangement is
tried as it stands: the rates are integrated to an attitude, the specific force is turned back by it, and its means over
neighbouring windows must agree. The means of the products ``R_ab u_c`` are all that the 24 arrangements of either
handedness need.

Windows from half a second to eight seconds are used together, each twice as long as the one before, as the levels of a
Haar transform are: strides and blows spoil the short ones, the bias of the rates and waves the long ones. Each level
has its own variance, and none convinces alone: it may be misled, so its odds count for `_MISLED` at most.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from operator import attrgetter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.quality.arrangement import ARRANGEMENTS, BIN, LONGEST_DELAY, Samples, VectorFit, inflation, widening
from plumbob.rotations.kernels import quat_exp, quat_mul, rows

FLOOR: Final = 0.02  # change of gravity's direction between windows that biases and scales of good sensors feign, rad
SIZES: Final = (25, 50, 100, 200, 400)  # Bins of a window, each twice the one before
_FEWEST: Final = 8  # Windows of a level at least
_MISLED: Final = 10.0  # Logarithm of the odds that one level can give at most
_BLOCK: Final = 10  # Windows of a block, which has a variance of its own
_STRIDE: Final = 2  # Bins between two delays that are tried; the best is refined
_NEVER: Final = 1e30  # Mean square change of a handedness that is out of the question
_HALF: Final = len(ARRANGEMENTS) // 2
_TAKEN: Final = np.swapaxes(ARRANGEMENTS[:_HALF], 1, 2).reshape(_HALF, 9)  # of the products ``R_ab u_c``
_SQUARED: Final = (_TAKEN[:, :, np.newaxis] * _TAKEN[:, np.newaxis]).reshape(_HALF, 81)


def fit_force(
    t: Floats, trials: Sequence[Floats], acc: Floats, scales: Sequence[float], signs: Sequence[float] = (1.0, -1.0)
) -> VectorFit | None:
    """Score every arrangement of the accelerometer's axes against the gyroscope's.

    Each of `trials` (N, 3) is the rates less one bias or another; one of `scales` times their unit is rad/s, and
    `signs` has -1 where axes may be mirrored. The force is in whatever unit; rows with NaN do not count.
    """
    length = float(np.nanmedian(np.sqrt(np.sum(acc * acc, axis=1)))) if np.isfinite(acc).any() else 0.0
    if not length > 0.0:
        return None
    edges = np.arange(t[0], t[-1] + BIN, BIN)
    force = Samples(t, acc / length).means(edges)
    if not np.isfinite(force).any() or len(force) < _FEWEST * SIZES[0]:
        return None
    best: _DerotatedSearch | None = None
    for gyr in trials:  # one by one: each holds what all arrangements leave, at every delay
        search = _DerotatedSearch(t, gyr, force, edges, scales, signs)
        if search.levels and (best is None or search.plausible > best.plausible):
            best = search
    return None if best is None else best.fit()


@dataclass(frozen=True)
class _EqualWindows:
    """Windows of one length."""

    size: int  # bins of a window
    each: Floats  # (scales, shifts, 48, blocks), log-likelihood of one change of gravity
    counts: Floats  # (blocks,), windows that count

    def likely(self, first: bool | None = None) -> Floats:
        """Log-likelihood (scales, shifts, 48), by all blocks, or by those of either half.

        Neighbouring changes share a window, so two of them count as one; of three components two tell, and each is
        worth half a logarithm.
        """
        early = np.cumsum(self.counts) <= 0.5 * self.counts.sum()
        early[0], early[-1] = True, False
        counts = self.counts if first is None else np.where(early == first, self.counts, 0.0)
        return np.asarray(self.each @ counts)


class _DerotatedSearch:
    """Search of arrangement, scale and delay, with one trial of the rates."""

    def __init__(
        self, t: Floats, gyr: Floats, force: Floats, edges: Floats, scales: Sequence[float], signs: Sequence[float]
    ) -> None:
        self.gyr, self.force, self.edges = Samples(t, gyr), force, edges
        self.scales, self.signs = tuple(scales), tuple(signs)
        self.rate = self.gyr.means(edges)
        reach = min(round(LONGEST_DELAY / BIN), len(force) // 8) // _STRIDE * _STRIDE
        self.shifts = np.arange(-reach, reach + 1, _STRIDE)
        # mean square changes by windows of every length, which all come from the means of the shortest
        overlap = len(force) - reach  # what overlaps at each shift
        counts = {size: count for size in SIZES if (count := overlap // size) >= _FEWEST}
        blocks = {size: min(_BLOCK, (count - 1) // 2) for size, count in counts.items()}
        shape = (len(self.scales), len(self.shifts), 2, _HALF)
        residual = {size: np.full((*shape, (count - 1) // blocks[size]), _NEVER) for size, count in counts.items()}
        many = {size: np.full(power.shape[-1], np.inf) for size, power in residual.items()}
        known = np.isfinite(self.rate).any()
        for i, sign in product(range(len(self.scales)), self.signs if known else ()):
            dcm = rotations(self.rate, sign * self.scales[i])
            for j, shift in enumerate(self.shifts):
                mean, valid = _products(dcm, force, SIZES[0], int(shift))
                for size, count in counts.items():
                    change, paired = _changed(mean[:count], valid[:count])
                    block, number = blocks[size], len(many[size])
                    change = change[: number * block].reshape(number, block * 3, 9)
                    gram = np.swapaxes(change, 1, 2) @ change
                    some = paired[: number * block].reshape(number, block).sum(axis=1).astype(np.float64)
                    power = np.maximum(_SQUARED @ gram.reshape(number, 81).T, 0.0) / np.maximum(some, 1.0)
                    still = mean[:count].reshape(-1, 9)
                    still = _SQUARED @ (still.T @ still).ravel() / max(np.count_nonzero(valid[:count]), 1)
                    residual[size][i, j, 0 if sign > 0.0 else 1] = power / np.maximum(still, _NEVER**-1)[:, np.newaxis]
                    many[size] = np.minimum(many[size], some)
                    even = len(valid) // 2 * 2
                    mean, valid = 0.5 * (mean[:even:2] + mean[1:even:2]), valid[:even:2] & valid[1:even:2]
        self.levels = [
            _EqualWindows(size, -0.5 * np.log(power.reshape(*shape[:2], 2 * _HALF, -1) + FLOOR**2), many[size])
            for size, power in residual.items() if known
        ]  # fmt: skip
        self.logs = [level.likely() for level in self.levels]
        self.together = np.sum(self.logs, axis=0)
        self.plausible = float(self.together.max()) if self.levels else -np.inf

    def fit(self) -> VectorFit:
        """Odds of each arrangement at its own best scale and delay, and the delay and scale of the best."""
        scale, shift, top = (int(i) for i in np.unravel_index(int(self.together.argmax()), self.together.shape))
        dcm = rotations(self.rate, (1.0 if top < _HALF else -1.0) * self.scales[scale])
        shares = []  # independent changes for each of a level: what is left of neighbours is alike
        for level in self.levels:
            change, valid = _changed(*_products(dcm, self.force, level.size, int(self.shifts[shift])))
            residual = change[valid] @ ARRANGEMENTS[top % _HALF].T.ravel()
            usual = float(np.median(np.abs(residual))) if residual.size else 0.0
            residual = np.clip(residual, -5.0 * usual, 5.0 * usual)
            shares.append(1.0 / inflation(residual) if usual > 0.0 else 1.0)
        log = _agreed([share * logs for share, logs in zip(shares, self.logs, strict=True)])
        best = log.max(axis=(0, 1))
        top = int(best.argmax())
        scale, shift = (int(i) for i in np.unravel_index(int(log[:, :, top].argmax()), log.shape[:2]))
        halves = []  # odds (48,) by the first half of each level's blocks, and by the others
        for first in (True, False):
            logs = [share * level.likely(first) for share, level in zip(shares, self.levels, strict=True)]
            half = _agreed(logs).max(axis=(0, 1))
            halves.append(half - half.max())
        each_log = [share * logs.max(axis=(0, 1)) for share, logs in zip(shares, self.logs, strict=True)]
        margins = [log[top] - np.delete(log, top).max() for log in each_log]  # over the next of each level
        start = self.scales[scale], float(self.shifts[shift]) * BIN
        each = [_Refined(self, level.size, top, *start) for level in self.levels]
        refined = each[int(np.argmax(margins))]  # where an answer about the delay is clearest
        blocks = np.ones(len(refined.change) // refined.block + 1, dtype=np.bool_)
        early = np.arange(len(blocks)) < len(blocks) // 2
        parts = [refined.estimate(rows) for rows in (blocks, early, ~early)]
        # pushes in step with the turning feign a scale, too, the less the more of them a window averages out
        calm = max([it for it in each if math.isfinite(it.wider)] or [refined], key=attrgetter("explained"))
        of_scale = calm.estimate(np.ones(len(calm.change), dtype=np.bool_))[2:]
        return VectorFit(
            log_odds=best - best.max(),
            halves=(halves[0], halves[1]),
            delay=parts[0][0],
            delay_sd=parts[0][1] * refined.wider,
            in_step=refined.in_step,
            delay_halves=(parts[1][0], parts[2][0]),
            scale=of_scale[0],
            scale_sd=of_scale[1] * calm.wider,
            bias=refined.bias,
            explained=refined.explained,
        )


def _agreed(logs: Sequence[Floats]) -> Floats:
    """What levels say together, when each is wrong now and then: the odds of none count for more than `_MISLED`."""
    return np.asarray(sum(np.logaddexp(log - log.max(), -_MISLED) for log in logs))


def rotations(rate: Floats, scale: float) -> Floats:
    """Rotation matrices (N, 3, 3) from the axes of the rates to those at the start, at the middle of each bin.

    NaN where rates are missing: windows that contain a pause do not count.
    """
    finite = np.isfinite(rate[:, :1])
    turns, dcm = np.where(finite, rate, 0.0) * (0.5 * scale * BIN), np.empty((len(rate), 9))
    turns[1:] += turns[:-1].copy()  # from middle to middle
    _chain(turns, dcm)
    dcm[~finite[:, 0]] = np.nan
    return dcm.reshape(-1, 3, 3)


@kernel
def _chain(turns: Floats, dcm: Floats) -> None:
    """Write the matrices (N, 9) to which rotation vectors (N, 3), rad, lead one after the other."""
    q = (1.0, 0.0, 0.0, 0.0)
    for k in range(turns.shape[0]):
        r = quat_exp(turns[k, 0], turns[k, 1], turns[k, 2])
        q = quat_mul(q[0], q[1], q[2], q[3], r[0], r[1], r[2], r[3])
        c = rows(q[0], q[1], q[2], q[3])
        dcm[k, 0], dcm[k, 1], dcm[k, 2], dcm[k, 3], dcm[k, 4] = c[0], c[1], c[2], c[3], c[4]
        dcm[k, 5], dcm[k, 6], dcm[k, 7], dcm[k, 8] = c[5], c[6], c[7], c[8]


def _products(dcm: Floats, force: Floats, size: int, shift: int) -> tuple[Floats, NDArray[np.bool_]]:
    """Means of ``R_ab u_c`` over windows (n, 3, 9), and which of them are whole (n,)."""
    if shift > 0:
        dcm, force = dcm[:-shift], force[shift:]
    elif shift < 0:
        dcm, force = dcm[-shift:], force[:shift]
    count = len(force) // size
    u, dcm = force[: count * size].reshape(count, size, 3), dcm[: count * size].reshape(count, size, 9)
    mean = (np.swapaxes(dcm, 1, 2) @ u / size).reshape(count, 3, 9)
    valid = np.isfinite(mean[:, 0, 0])
    if not valid.all():
        mean[~valid] = 0.0
    return mean, valid


def _changed(mean: Floats, valid: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.bool_]]:
    """Change of the means from window to window, (n, 3, 9), and whether each counts (n,)."""
    counts = valid[1:] & valid[:-1]
    change = np.diff(mean, axis=0)
    change[~counts] = 0.0
    return change, counts


class _Refined:
    """Delay, scale and bias of one arrangement by Gauss-Newton steps, with a variance of its own in each block."""

    _SD: Final = np.array([0.3, 1.0, 0.05, 0.05, 0.05])  # delay, s; logarithm of the scale; bias, rad/s

    def __init__(self, search: _DerotatedSearch, size: int, best: int, scale: float, delay: float) -> None:
        self.search, self.size, self.start, self.scale = search, size, delay, scale
        self.block = max(1, min(_BLOCK, (len(search.force) // size - 1) // 2))
        self.axes = ARRANGEMENTS[best % _HALF]
        self.sign = 1.0 if best < _HALF else -1.0
        p = np.zeros(5)
        for _ in range(3):
            change, slopes, weight = self._linear(p)
            p = p + self._step(change, slopes, weight, p)[0]
        self.p = p
        self.change, self.slopes, self.weight = self._linear(p)
        stands_for = inflation(self.change * np.sqrt(self.weight)[:, np.newaxis])
        self.wider = math.sqrt(stands_for) * widening(float(np.count_nonzero(self.weight)) / stands_for, len(p))
        self.bias = p[2:]
        rate = self.search.gyr.means(self.search.edges - self.start)
        still = self._changed(self.search.force @ self.axes + 0.0 * rate)
        power = float(np.sum(self.weight[:, np.newaxis] * still**2))
        residual = float(np.sum(self.weight[:, np.newaxis] * self.change**2))
        self.explained = 1.0 - residual / power if power > 0.0 else 0.0
        # delay that the pushes feign if they come in step with the turning, s: what they leave over its slope
        slope = float(np.sum(self.weight[:, np.newaxis] * self.slopes[:, :, 0] ** 2))
        self.in_step = math.sqrt(residual / slope) if slope > 0.0 else math.inf

    def estimate(self, blocks: NDArray[np.bool_]) -> tuple[float, float, float, float]:
        """Delay, its standard deviation, scale and its standard deviation, by some of the blocks."""
        weight = np.where(np.repeat(blocks, self.block)[: len(self.weight)], self.weight, 0.0)
        step, normal = self._step(self.change, self.slopes, weight, self.p)
        p, sd = self.p + step, np.sqrt(np.diag(np.linalg.inv(normal)))
        scale = self.scale * float(np.exp(p[1]))
        return self.start + float(p[0]), float(sd[0]), scale, scale * float(sd[1])

    def _step(self, change: Floats, slopes: Floats, weight: Floats, p: Floats) -> tuple[Floats, Floats]:
        """Step (5,) of the parameters, and the matrix of its normal equations."""
        right = np.einsum("w,wci,wc->i", weight, slopes, change) + p / self._SD**2
        normal = np.einsum("w,wci,wcj->ij", weight, slopes, slopes) + np.diag(1.0 / self._SD**2)
        return np.clip(-np.linalg.solve(normal, right), -0.5 * self._SD, 0.5 * self._SD), normal

    def _linear(self, p: Floats) -> tuple[Floats, Floats, Floats]:
        """Change of gravity (n, 3), its slopes (n, 3, 5), and inverse variances (n,) of blocks of windows.

        Turned by what the rates add up to, gravity moves across.
        """
        said = self.sign * self.scale * np.exp(p[1]) * self.search.gyr.means(self.search.edges - self.start - p[0])
        dcm = rotations(said - p[2:], 1.0)
        gravity = (dcm @ (self.search.force @ self.axes)[:, :, np.newaxis])[:, :, 0]
        dcm, said = (np.where(np.isfinite(values), values, 0.0) for values in (dcm, said))
        parts = np.stack((said, np.cross(p[2:], said), *-np.eye(3)[:, np.newaxis] * np.ones_like(said)), axis=2)
        parts = dcm @ parts  # in the axes of the start, (N, 3, 5)
        way = BIN * (np.cumsum(parts, axis=0) - 0.5 * parts)
        delay = way[:, :, 1:2] - parts[:, :, :1] + parts[:1, :, :1]
        way = np.concatenate((delay, way[:, :, :1], way[:, :, 2:]), axis=2)
        slopes = [self._changed(np.cross(way[:, :, i], gravity)) for i in range(5)]
        change = self._changed(gravity)
        power = np.sum(change * change, axis=1)
        starts = np.arange(0, len(power), self.block)
        total = np.add.reduceat(power, starts)
        many = np.maximum(np.add.reduceat((power > 0.0).astype(np.float64), starts), 1.0)
        variance = np.repeat(0.5 * total / many + FLOOR**2, self.block)[: len(power)]
        return change, np.stack(slopes, axis=2), np.where(power > 0.0, 1.0 / variance, 0.0)

    def _changed(self, gravity: Floats) -> Floats:
        """Change (n, 3) of the means over windows of a vector (N, 3); 0 where one is not whole."""
        count = len(gravity) // self.size
        change = np.diff(gravity[: count * self.size].reshape(count, self.size, 3).mean(axis=1), axis=0)
        return np.where(np.isfinite(change), change, 0.0)
