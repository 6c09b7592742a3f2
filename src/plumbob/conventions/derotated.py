"""Arrangement, scale and delay of an accelerometer: turned back by the rates, gravity stays where it is.

What pushes a unit to and fro averages out over a second or two only in axes that do not turn. So each arrangement is
tried as it stands: the rates are integrated to an attitude, the specific force is turned back by it, and its means over
neighbouring windows must agree. The means of the products ``R_ab u_c`` are all that the 24 arrangements of either
handedness need.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.conventions.arrangement import LONGEST_DELAY, Fit, chosen, inflation
from plumbob.conventions.moments import ARRANGEMENTS, BIN, means
from plumbob.core.check import Floats
from plumbob.rotations import dcm_from_quat, quat_chained

FLOOR: Final = 0.02
"""Change of gravity's direction from window to window that biases and scales of good sensors feign, rad."""
WINDOWS: Final = (25, 50, 75)
"""Bins of a window: what pushes has to average out, and the bias of the rates must not turn gravity much."""
_BLOCK: Final = 5.0  # s
_LONG: Final = 15_000  # bins: five minutes; the delay is refined anyhow
_HALF: Final = len(ARRANGEMENTS) // 2


def fit_force(t: Floats, gyr: Floats, acc: Floats, scales: Sequence[float]) -> Fit | None:
    """Score every arrangement of the accelerometer's axes against the gyroscope's.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    gyr : ndarray (N, 3)
        Rates; `scales` times their unit is rad/s.
    acc : ndarray (N, 3)
        Specific force, in whatever unit; rows with NaN do not count.
    scales : sequence of float
        What the rates may have to be multiplied by.
    """
    length = float(np.nanmedian(np.sqrt(np.sum(acc * acc, axis=1)))) if np.isfinite(acc).any() else 0.0
    if not length > 0.0:
        return None
    edges = np.arange(t[0], t[-1] + BIN, BIN)
    rate, force = means(t, gyr, edges), means(t, acc / length, edges)
    if not (np.isfinite(rate).any() and np.isfinite(force).any()):
        return None
    sizes = [size for size in WINDOWS if len(force) >= 8 * size]
    searches = [_Search(t, gyr, rate, force, edges, size, scales) for size in sizes]
    return chosen([one.fit(length) for one in searches])


class _Search:
    """Search of arrangement, scale and delay with windows of one size."""

    def __init__(
        self, t: Floats, gyr: Floats, rate: Floats, force: Floats, edges: Floats, size: int, scales: Sequence[float]
    ) -> None:
        self.t, self.gyr, self.rate, self.force, self.edges = t, gyr, rate, force, edges
        self.size, self.scales = size, tuple(scales)
        count = len(force) // size - 1
        self.block = max(1, min(round(_BLOCK / (size * BIN)), count // 8))
        reach = min(round(LONGEST_DELAY / BIN), len(force) // 8)
        self.shifts = np.arange(-reach, reach + 1, 2 if len(force) > _LONG else 1)

    def fit(self, length: float) -> Fit:
        """Likelihood of each arrangement at its own best scale and delay, by blocks."""
        left, counts = self._all()
        whole = np.ones(len(counts), dtype=np.bool_)
        where, log = _likely(left, counts)
        top = int(log.argmax())
        scale, shift = (int(i) for i in np.unravel_index(where[top], left.shape[:2]))
        refined = _Refined(self, top, self.scales[scale], float(self.shifts[shift]) * BIN)
        share = 1.0 / refined.inflation
        counts = counts * share
        log = _likely(left, counts)[1]
        gain = counts * np.log((left.max(axis=(0, 1, 2)) + FLOOR**2) / (left[scale, shift, top] + FLOOR**2))
        first = np.cumsum(gain) <= 0.5 * gain.sum()
        first[0], first[-1] = True, False
        by_half = [_likely(left[..., rows], counts[rows])[1] for rows in (first, ~first)]
        parts = [refined.of(rows) for rows in (whole, first, ~first)]
        return Fit(
            log_odds=log - log.max(),
            halves=(by_half[0] - by_half[0].max(), by_half[1] - by_half[1].max()),
            delay=parts[0][0],
            delay_sd=parts[0][1] / float(np.sqrt(share)),
            delay_halves=(parts[1][0], parts[2][0]),
            scale=parts[0][2],
            scale_sd=parts[0][3] / float(np.sqrt(share)),
            bias=refined.bias,
            offset=np.zeros(3),
            explained=refined.explained,
            effective=float(counts.sum()),
        )

    def _all(self) -> tuple[Floats, Floats]:
        """Mean square change of gravity (scales, shifts, 48, blocks), and windows that count in each block."""
        made, counts = [], np.zeros(0)
        for scale in self.scales:
            turns = [_turned(self.rate, sign * scale) for sign in (1.0, -1.0)]
            rows = []
            for shift in self.shifts:
                both = [self._left(turn, int(shift)) for turn in turns]
                rows.append(np.concatenate((both[0][0], both[1][0])))
                counts = both[0][1] if counts.size == 0 else np.minimum(counts, both[0][1][: len(counts)])
            made.append(rows)
        fewest = min(one.shape[1] for rows in made for one in rows)
        return np.array([[one[:, :fewest] for one in rows] for rows in made]), counts[:fewest]

    def _left(self, dcm: Floats, shift: int) -> tuple[Floats, Floats]:
        """Mean square change (24, blocks) by each arrangement of one handedness, and windows that count (blocks,)."""
        change, known = changes(dcm, self.force, self.size, shift)
        count = len(change) // self.block
        change = change[: count * self.block].reshape(count, self.block * 3, 9)
        gram = np.swapaxes(change, 1, 2) @ change
        many = known[: count * self.block].reshape(count, self.block).sum(axis=1).astype(np.float64)
        m = np.swapaxes(ARRANGEMENTS[:_HALF], 1, 2).reshape(_HALF, 9)
        left = np.einsum("ni,bij,nj->nb", m, gram, m, optimize=True)
        return np.maximum(left, 0.0) / np.maximum(many, 1.0), many


def _turned(rate: Floats, scale: float) -> Floats:
    """Rotation matrices (N, 3, 3) from the axes of the rates to those at the start, at the middle of each bin."""
    known = np.where(np.isfinite(rate), rate, 0.0) * (scale * BIN)
    half = 0.5 * (known + np.concatenate((np.zeros((1, 3)), known[:-1])))  # from middle to middle
    return np.asarray(dcm_from_quat(quat_chained(half)[-len(rate) :]))


def changes(dcm: Floats, force: Floats, size: int, shift: int) -> tuple[Floats, NDArray[np.bool_]]:
    """Change of the means of ``R_ab u_c`` from window to window, (n, 3, 9), and whether each counts (n,)."""
    if shift > 0:
        dcm, force = dcm[:-shift], force[shift:]
    elif shift < 0:
        dcm, force = dcm[-shift:], force[:shift]
    count = len(force) // size
    dcm, force = dcm[: count * size], force[: count * size]
    known = np.asarray(np.isfinite(force).all(axis=1))
    u = np.where(known[:, np.newaxis], force, 0.0)
    mean = (np.swapaxes(dcm.reshape(count, size, 9), 1, 2) @ u.reshape(count, size, 3) / size).reshape(count, 3, 9)
    whole = np.asarray(known.reshape(count, size).all(axis=1))
    counts = whole[1:] & whole[:-1]
    change = np.diff(mean, axis=0)
    change[~counts] = 0.0
    return change, counts


def _likely(left: Floats, counts: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Flat number of scale and shift at which each arrangement is likeliest, and its log-likelihood there, (48,)."""
    log = -np.einsum("ksnb,b->nks", np.log(left + FLOOR**2), counts).reshape(left.shape[2], -1)
    return log.argmax(axis=1), log.max(axis=1)


class _Refined:
    """Delay, scale and bias of one arrangement by Gauss-Newton steps, with a variance of its own in each block."""

    _SD: Final = np.array([0.3, 1.0, 0.05, 0.05, 0.05])  # delay, s; logarithm of the scale; bias, rad/s
    _STEP: Final = np.array([0.002, 0.01, 0.002, 0.002, 0.002])

    def __init__(self, search: _Search, best: int, scale: float, delay: float) -> None:
        self.search, self.start, self.scale = search, delay, scale
        self.axes = ARRANGEMENTS[best % _HALF]
        self.sign = 1.0 if best < _HALF else -1.0
        p = np.zeros(5)
        for _ in range(3):
            change, slopes = self._linear(p)
            weight = self._weight(change)
            p = p + self._step(change, slopes, weight, p)
        self.p = p
        self.change, self.slopes = self._linear(p)
        self.weight = self._weight(self.change)
        self.inflation = inflation(self.change * np.sqrt(self.weight)[:, np.newaxis])
        self.bias = p[2:]
        still = self._change(np.zeros(5), turning=False)
        power = float(np.sum(self.weight[:, np.newaxis] * still**2))
        left = float(np.sum(self.weight[:, np.newaxis] * self.change**2))
        self.explained = 1.0 - left / power if power > 0.0 else 0.0

    def of(self, blocks: NDArray[np.bool_]) -> tuple[float, float, float, float]:
        """Delay, its standard deviation, scale and its standard deviation, by some of the blocks."""
        rows = np.zeros(len(self.change), dtype=np.bool_)
        marked = np.repeat(blocks, self.search.block)[: len(rows)]
        rows[: len(marked)] = marked
        weight = np.where(rows, self.weight, 0.0)
        p = self.p + self._step(self.change, self.slopes, weight, self.p)
        sd = np.sqrt(np.diag(np.linalg.inv(self._normal(self.slopes, weight))))
        scale = self.scale * float(np.exp(p[1]))
        return self.start + float(p[0]), float(sd[0]), scale, scale * float(sd[1])

    def _step(self, change: Floats, slopes: Floats, weight: Floats, p: Floats) -> Floats:
        right = np.einsum("w,wci,wc->i", weight, slopes, change) + p / self._SD**2
        step = -np.linalg.solve(self._normal(slopes, weight), right)
        return np.asarray(np.clip(step, -0.5 * self._SD, 0.5 * self._SD))

    def _normal(self, slopes: Floats, weight: Floats) -> Floats:
        return np.asarray(np.einsum("w,wci,wcj->ij", weight, slopes, slopes) + np.diag(1.0 / self._SD**2))

    def _linear(self, p: Floats) -> tuple[Floats, Floats]:
        change = self._change(p)
        slopes = [(self._change(p + step) - change) / step.max() for step in np.diag(self._STEP)]
        return change, np.stack(slopes, axis=2)

    def _change(self, p: Floats, *, turning: bool = True) -> Floats:
        search = self.search
        rate = means(search.t, search.gyr, search.edges - self.start - p[0])
        rate = self.sign * self.scale * np.exp(p[1]) * rate - p[2:]
        force = np.where(np.asarray(np.isfinite(rate).all(axis=1))[:, np.newaxis], search.force, np.nan)
        dcm = _turned(rate, 1.0) if turning else np.broadcast_to(np.eye(3), (len(rate), 3, 3))
        return np.asarray(changes(dcm, force, search.size, 0)[0] @ self.axes.T.ravel())

    def _weight(self, change: Floats) -> Floats:
        """Inverse variance of each window, from its block."""
        size = self.search.block
        power = np.sum(change * change, axis=1)
        starts = np.arange(0, len(power), size)
        total = np.add.reduceat(power, starts)
        many = np.maximum(np.add.reduceat((power > 0.0).astype(np.float64), starts), 1.0)
        variance = np.repeat(0.5 * total / many + FLOOR**2, size)[: len(power)]
        return np.where(power > 0.0, 1.0 / variance, 0.0)
