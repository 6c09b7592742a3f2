"""Which of the 48 arrangements of axes turns a vector as it turns, at which scale and delay, with honest odds.

Gravity and the Earth's field stand still while the body turns, so in the axes of their sensor they change by
``du/dt = (u − h) × (K ω + β)``: u what the sensor measures, h its offset, ω the measured rates, K the gyroscope's axes
and scale in those of the sensor, β the bias of the rates there. Both sides are integrated over time and averaged over
windows, so nothing is differentiated, and turns may be as large as they like. All terms are products of sixteen
scalars: ``u_l ω_j`` (9), ``u`` (3), ``ω`` (3) and 1. With the change of u (3) they make nineteen, and their Gram matrix
over a block of time is all that the 48 arrangements, the scale, the biases and the offset need.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.rotations import every_axes

BIN: Final = 0.02
"""Step of the even grid on which rates and vectors are averaged, s."""
SCALARS: Final = 19
FREE: Final = 10
"""Parameters of one arrangement: the scale, three biases of the rates, three offsets, three constants."""

_LONGEST_STEP: Final = 0.3
_LEVI_CIVITA = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _LEVI_CIVITA[_i, _j, _k], _LEVI_CIVITA[_k, _j, _i] = 1.0, -1.0

_TURNED: Final = np.array([c for c in every_axes() if np.linalg.det(c) > 0.0])
ARRANGEMENTS: Final = np.concatenate((_TURNED, -_TURNED))
"""Every arrangement (48, 3, 3) of the rates in the sensor's axes: the right-handed ones, then their negatives."""


@dataclass(frozen=True)
class Grid:
    """Means over even bins of time.

    Attributes
    ----------
    t : ndarray (N,)
        Middle of each bin, s.
    rate, vector : ndarray (N, 3)
        Rates and vector; NaN where the sensor has no samples.
    """

    t: Floats
    rate: Floats
    vector: Floats


def means(t: Floats, values: Floats, edges: Floats) -> Floats:
    """Mean of samples, taken as straight lines from one to the next, between edges (N + 1,); NaN in pauses."""
    finite = np.isfinite(values).all(axis=1)
    t, values = t[finite], values[finite]
    if t.size < 2:
        return np.full((edges.size - 1, values.shape[1]), np.nan)
    step = np.diff(t)
    area = np.concatenate(
        (np.zeros((1, values.shape[1])), np.cumsum(0.5 * (values[1:] + values[:-1]) * step[:, np.newaxis], axis=0))
    )
    at = np.clip(np.searchsorted(t, edges, side="right") - 1, 0, t.size - 2)
    into = (edges - t[at])[:, np.newaxis]
    slope = (values[at + 1] - values[at]) / step[at, np.newaxis]
    there = area[at] + values[at] * into + 0.5 * slope * into * into
    mean = np.diff(there, axis=0) / np.diff(edges)[:, np.newaxis]
    longest = max(_LONGEST_STEP, 3.0 * float(np.median(step)))
    broken = np.concatenate(([0], np.cumsum(step > longest)))
    bad = (step[at] > longest)[:-1] | (step[at] > longest)[1:] | (np.diff(broken[at]) > 0)
    bad |= (edges[:-1] < t[0]) | (edges[1:] > t[-1])
    mean[bad] = np.nan
    return np.asarray(mean)


def grid(t: Floats, gyr: Floats, vector: Floats, *, delay: float = 0.0, step: float = BIN) -> Grid:
    """Rates and a vector that is `delay` late, s, on one even grid of the rates' time.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    gyr, vector : ndarray (N, 3)
        Samples; rows with NaN do not count.
    delay : float
        By how much the vector's stamps are late, s.
    step : float
        Of the grid, s.
    """
    edges = np.arange(t[0], t[-1] + step, step)
    return Grid(0.5 * (edges[1:] + edges[:-1]), means(t, gyr, edges), means(t, vector, edges + delay))


def windows(at: Grid, size: int, block: int, shift: int = 0) -> Floats:
    """Gram matrices (blocks, 19, 19) of the scalars, with the rates moved by whole bins.

    Parameters
    ----------
    at : Grid
        Rates and vector.
    size : int
        Bins of a window; the change is that from one window to the next.
    block : int
        Windows of a block.
    shift : int
        Bins by which the vector is later than the rates.
    """
    rows = scalars(at, size, shift)
    rows = (
        rows[: rows.shape[0] // block * block]
        if rows.shape[0] >= block
        else np.concatenate((rows, np.zeros((block - rows.shape[0], SCALARS))))
    )
    cut = rows.reshape(-1, block, SCALARS)
    return np.asarray(np.swapaxes(cut, 1, 2) @ cut)


def scalars(at: Grid, size: int, shift: int = 0) -> Floats:
    """Scalars of each pair of neighbouring windows (n, 19), weighted; rows that a pause or an outlier spoils are 0."""
    rate, u = at.rate, at.vector
    if shift > 0:
        rate, u = rate[:-shift], u[shift:]
    elif shift < 0:
        rate, u = rate[-shift:], u[:shift]
    count = u.shape[0] // size
    if count < 2:
        return np.zeros((0, SCALARS))
    rate, u = rate[: count * size], u[: count * size]
    finite = np.asarray(np.isfinite(rate).all(axis=1) & np.isfinite(u).all(axis=1))
    rate, u = np.where(finite[:, np.newaxis], rate, 0.0), np.where(finite[:, np.newaxis], u, 0.0)
    products = (u[:, :, np.newaxis] * rate[:, np.newaxis, :]).reshape(-1, 9)
    terms = np.concatenate((products, u, rate, np.ones((u.shape[0], 1))), axis=1).reshape(count, size, 16)
    # The integral from the mean instant of one window to that of the next weighs the terms by a triangle.
    rise = (np.arange(size) + 0.5) / size * BIN
    up, down = np.einsum("s,nsk->nk", rise, terms[:-1]), np.einsum("s,nsk->nk", rise[::-1], terms[1:])
    mean = u.reshape(count, size, 3).mean(axis=1)
    complete = np.asarray(finite.reshape(count, size).all(axis=1))
    row = np.concatenate((up + down, np.diff(mean, axis=0)), axis=1)
    row[~(complete[1:] & complete[:-1])] = 0.0
    return np.asarray(row)


def designs() -> Floats:
    """What the parameters of each arrangement and the change weigh of the scalars, (48, 3, 11, 19).

    Axes: arrangement; component of the change; scale, three biases, three offsets times the scale, three constants, and
    the change itself; scalars.
    """
    made = np.zeros((len(ARRANGEMENTS), 3, FREE + 1, SCALARS))
    products = np.arange(9).reshape(3, 3)
    for n, w in enumerate(ARRANGEMENTS):
        for c in range(3):
            for a in range(3):
                for b in range(3):
                    e = _LEVI_CIVITA[c, a, b]
                    if e:
                        made[n, c, 0, products[a]] += e * w[b]  # u × W ω
                        made[n, c, 1 + b, 9 + a] += e  # u × β
                        made[n, c, 4 + a, 12:15] -= e * w[b]  # −h × W ω
            made[n, c, 7 + c, 15] = 1.0
            made[n, c, 10, 16 + c] = 1.0
    return made


def solved(a: Floats, b: Floats) -> Floats:
    """Solutions of normal equations (…, n, n) x = (…, n, k), whose unknowns may differ by many orders of size.

    Each unknown is scaled by its own diagonal first, and held by a part in 10¹² of it: one that nothing shows stays 0
    where the plain solution would end in a singular matrix.
    """
    size = np.sqrt(np.maximum(np.diagonal(a, axis1=-2, axis2=-1), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    scaled = a / (size[..., :, np.newaxis] * size[..., np.newaxis, :]) + 1e-12 * np.eye(a.shape[-1])
    return np.asarray(np.linalg.solve(scaled, b / size[..., np.newaxis]) / size[..., np.newaxis])


LONGEST_DELAY: Final = 0.5
"""Delays that are looked for, s, either way."""
FLOOR: Final = 0.05
"""Part of the change that no arrangement of real axes explains: scales, axes that are not square, soft iron."""
WINDOWS: Final = (5, 20)
"""Bins of a window: short ones follow quick motion, long ones average pushes out."""
_BLOCK: Final = 5.0  # s
_ROUNDS: Final = 3
_CONTRADICTS: Final = 4.6  # 100 to 1


@dataclass(frozen=True)
class VectorFit:
    """One vector sensor against the gyroscope.

    Attributes
    ----------
    log_odds : ndarray (48,)
        Logarithm of each arrangement's likelihood less that of the best.
    halves : tuple of ndarray (48,)
        The same of each half of the recording's turning alone.
    delay : float
        By how much the sensor's stamps are late, s.
    delay_sd : float
        Its standard deviation, s.
    delay_halves : tuple of float
        The delay by each half.
    scale, scale_sd : float
        What the rates have to be multiplied by.
    bias : ndarray (3,)
        Bias of the rates in the axes of the sensor, in the rates' unit times the scale.
    offset : ndarray (3,)
        Offset of the sensor, in its unit.
    explained : float
        Part of the change that the best arrangement explains, 0 to 1.
    effective : float
        Independent samples in the residuals.
    contradicted : bool
        Whether windows of another length say something else.
    in_step : float
        Delay that pushes feign where they come in step with the turning, s.
    """

    log_odds: Floats
    halves: tuple[Floats, Floats]
    delay: float
    delay_sd: float
    delay_halves: tuple[float, float]
    scale: float
    scale_sd: float
    bias: Floats
    offset: Floats
    explained: float
    effective: float
    contradicted: bool = False
    in_step: float = 0.0

    @property
    def best(self) -> int:
        """Number of the best arrangement."""
        return int(np.argmax(self.log_odds))

    @property
    def agrees(self) -> bool:
        """Whether both halves of the recording say the same."""
        return all(int(np.argmax(half)) == self.best for half in self.halves)

    @property
    def torn(self) -> bool:
        """Whether a half of the recording clearly says something else."""
        return any(float(half.max() - half[self.best]) > _CONTRADICTS for half in self.halves)

    @property
    def margin(self) -> float:
        """Logarithm of the odds of the best arrangement against the next."""
        return float(-np.sort(self.log_odds)[-2])


def _ridge(offset: float, scale: float) -> Floats:
    """Inverse variances of the parameters of an arrangement (10,), for a vector of length 1."""
    # A consumer part's bias is a few °/s; the constants are an offset times a bias.
    sd = np.array([1e3 * scale] + [0.1] * 3 + [offset * scale] * 3 + [0.1 * offset] * 3)
    return np.asarray(1.0 / sd**2)


def fit(t: Floats, gyr: Floats, vector: Floats, *, offset: float) -> VectorFit | None:
    """Score every arrangement of one sensor's axes against the gyroscope's; None where nothing overlaps or turns.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    gyr : ndarray (N, 3)
        Rates, in whatever unit.
    vector : ndarray (N, 3)
        Specific force or field, in whatever unit; rows with NaN do not count.
    offset : float
        How large an offset of the sensor may be, as a part of the vector's length.
    """
    length = float(np.nanmedian(np.sqrt(np.sum(vector * vector, axis=1)))) if np.isfinite(vector).any() else 0.0
    if not length > 0.0 or not np.nanmax(np.abs(gyr), initial=0.0) > 0.0:
        return None
    at = grid(t, gyr, vector / length)
    fits = [
        candidate
        for size in WINDOWS
        if (candidate := _ArrangementSearch(at, size, offset).fit(t, gyr, length)) is not None
    ]
    return chosen(fits)


def chosen(fits: Sequence[VectorFit]) -> VectorFit | None:
    """Fit with the clearest answer, and whether another one contradicts it."""
    best = max(fits, key=lambda candidate: candidate.margin, default=None)
    if best is None:
        return None
    against = any(rival.best != best.best and rival.margin > _CONTRADICTS and rival.agrees for rival in fits)
    return replace(best, contradicted=against)


class _ArrangementSearch:
    """Search of arrangement and delay with windows of one size."""

    def __init__(self, at: Grid, size: int, offset: float) -> None:
        self.at, self.size = at, size
        length = min(_BLOCK, at.t.size * BIN / 10.0)
        self.block = max(4, round(length / (size * BIN)))
        self.design = designs()
        grams = windows(at, size, self.block)
        turned = float(np.einsum("bii->", grams[:, 12:15, 12:15]))
        changed = np.einsum("bii->b", grams[:, 16:, 16:])
        self.scale = float(np.sqrt(changed.sum() / turned)) if turned > 0.0 else 0.0
        self.ridge = _ridge(offset, self.scale) if self.scale > 0.0 else np.ones(FREE)
        usual = float(np.median(changed[changed > 0.0])) if (changed > 0.0).any() else 0.0
        self.weight = np.where(changed > 0.0, 1.0 / (changed + 0.1 * usual + 1e-300), 0.0)

    def fit(self, t: Floats, gyr: Floats, length: float) -> VectorFit | None:
        """Best delay of each arrangement on the grid, their odds by blocks, and the delay of the best to a fraction."""
        if not self.scale > 0.0:
            return None
        reach = min(round(LONGEST_DELAY / BIN), self.at.t.size // 4)
        shifts = np.arange(-reach, reach + 1)
        residual = np.array([self._residual(int(shift)) for shift in shifts])  # (shifts, 48)
        at = residual.argmin(axis=0)
        cut = {int(i): windows(self.at, self.size, self.block, int(shifts[i])) for i in np.unique(at)}
        count = min(len(blocks) for blocks in cut.values())
        cut = {i: blocks[:count] for i, blocks in cut.items()}
        moments = [self._moments(cut[int(i)], n) for n, i in enumerate(at)]
        first = int(residual.min(axis=0).argmin())
        all_blocks = np.ones(count, dtype=np.bool_)
        counts = self._counts(cut[int(at[first])])
        share = self._independent(first, _Scored(moments[first], counts, self.ridge), int(shifts[at[first]]))
        counts = share * counts
        scored = [_Scored(m, counts, self.ridge) for m in moments]
        log = np.array([score.log_likelihood for score in scored])
        top = int(log.argmax())
        best = scored[top]
        halves = best.halves()
        by_half = [
            np.array([_Scored(m[half], counts[half], self.ridge).log_likelihood for m in moments]) for half in halves
        ]
        start = BIN * float(shifts[at[top]])
        delays = [self._delay(t, gyr, top, start, np.where(rows, best.weight, 0.0)) for rows in (all_blocks, *halves)]
        return VectorFit(
            log_odds=log - log.max(),
            halves=(by_half[0] - by_half[0].max(), by_half[1] - by_half[1].max()),
            delay=delays[0][0],
            delay_sd=delays[0][1],
            delay_halves=(delays[1][0], delays[2][0]),
            scale=float(best.p[0]),
            scale_sd=float(np.sqrt(best.cov[0, 0])),
            bias=best.p[1:4],
            offset=length * best.p[4:7] / max(float(best.p[0]), 1e-3 * self.scale),
            explained=best.explained,
            effective=float(counts.sum()),
        )

    def _residual(self, shift: int) -> Floats:
        """Part of the change that each arrangement leaves, (48,)."""
        grams = windows(self.at, self.size, self.block, shift)
        gram = np.einsum("b,bij->ij", self.weight[: len(grams)], grams[: len(self.weight)])
        m = np.einsum("ncai,ij,ncbj->nab", self.design, gram, self.design, optimize=True)
        change = m[:, -1, -1]
        weak = np.diag(self.ridge) * (change[0] / (3.0 * self.block * len(self.weight)) + 1e-12)
        p = solved(m[:, :-1, :-1] + weak, m[:, :-1, -1:])[:, :, 0]
        return np.where(p[:, 0] > 0.0, _rss(m, p), change) / max(float(change[0]), 1e-300)

    def _counts(self, blocks: Floats) -> Floats:
        """Windows that count in each block."""
        return np.asarray(blocks[:, 15, 15] / (self.size * BIN) ** 2)

    def _moments(self, blocks: Floats, n: int) -> Floats:
        return np.asarray(sum(component @ blocks @ component.T for component in self.design[n]))

    def _independent(self, n: int, scored: "_Scored", shift: int) -> float:
        """Independent samples for each window: residuals of neighbours are alike."""
        rows = scalars(self.at, self.size, shift)[: len(scored.p_block) * self.block]
        residuals = np.einsum("ni,cai,a->nc", rows, self.design[n], np.append(-scored.p, 1.0))
        sd = np.repeat(np.sqrt(scored.variance), self.block)[: len(residuals), np.newaxis]
        return 1.0 / inflation(residuals / sd)

    def _delay(self, t: Floats, gyr: Floats, n: int, start: float, weight: Floats) -> tuple[float, float]:
        """Delay of an arrangement and its standard deviation, s: the vertex of a parabola, drawn three times."""
        edges = np.append(self.at.t - 0.5 * BIN, self.at.t[-1] + 0.5 * BIN)
        shift, at, curvature = round(start / BIN), 0.0, 0.0
        for reach in (BIN, 0.3 * BIN, 0.3 * BIN):
            away = reach * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
            cost = []
            for d in at + away:
                moved = Grid(self.at.t, means(t, gyr, edges - d), self.at.vector)
                m = self._moments(windows(moved, self.size, self.block, shift), n)
                count = min(len(m), len(weight))
                cost.append(0.5 * _cost(np.einsum("k,kab->ab", weight[:count], m[:count]), self.ridge))
            a, b, _ = np.polyfit(away, cost, 2)
            if a <= 0.0:
                return start + at, float("inf")
            at, curvature = at + float(np.clip(-0.5 * b / a, -2.0 * reach, 2.0 * reach)), 2.0 * float(a)
        return start + at, 1.0 / float(np.sqrt(curvature))


def _cost(m: Floats, ridge: Floats) -> float:
    """Least squares of moments that are weighted by inverse variances."""
    p = solved(m[:-1, :-1] + np.diag(ridge), m[:-1, -1:])[:, 0]
    return float(m[-1, -1] - p @ m[:-1, -1])


def _rss(m: Floats, p: Floats) -> Floats:
    """Sum of squares (n,) that parameters (n, 10) leave of moments (n, 11, 11)."""
    full = np.concatenate((-p, np.ones((len(p), 1))), axis=1)
    return np.asarray(np.maximum(np.einsum("na,nab,nb->n", full, m, full), 0.0))


def inflation(left: Floats) -> float:
    """Samples (n, 3) that one independent one stands for, by the positive start of their autocorrelation."""
    size = len(left)
    power = float(np.sum(left * left))
    total = 1.0
    for lag in range(1, max(2, size // 4)):
        rho = float(np.sum(left[lag:] * left[:-lag])) / power if power > 0.0 else 0.0
        if lag > 1 and rho < 0.02:
            break
        total += 2.0 * max(rho, 0.0)
    return total


class _Scored:
    """One arrangement, with a variance of its own in each block: what pushes the unit now and then counts less.

    Two of three components tell: the vector does not change along itself.
    """

    def __init__(self, moments: Floats, counts: Floats, ridge: Floats) -> None:
        self.counts = counts
        change = moments[:, -1, -1]
        some = change > 0.0
        usual = float(np.median(change[some])) if some.any() else 1.0
        floor = FLOOR**2 * (change + 0.01 * usual) + 1e-12
        many = np.maximum(counts, 1e-3)
        variance = (change + floor) / (2.0 * many)
        live = counts > 0.5
        for _ in range(_ROUNDS):
            self.weight = np.where(live, 1.0 / variance, 0.0)
            total = np.einsum("k,kab->ab", self.weight, moments)
            normal = total[:-1, :-1] + np.diag(ridge)
            self.p = solved(normal, total[:-1, -1:])[:, 0]
            if self.p[0] <= 0.0:
                self.p = np.append(0.0, solved(normal[1:, 1:], total[1:-1, -1:])[:, 0])
            residual = _rss(moments, np.broadcast_to(self.p, (len(moments), FREE)))
            variance = (residual + floor) / (2.0 * many)
        self.variance, self.p_block = np.maximum(variance, 1e-300), residual
        self.cov = solved(normal, np.eye(FREE))
        self.gain = np.where(live, counts * np.log((change + floor) / (residual + floor)), 0.0)
        self.log_likelihood = -float(np.sum(counts[live] * np.log(residual[live] + floor[live]))) - 0.5 * float(
            self.p @ (ridge * self.p)
        )
        self.explained = 1.0 - float(np.sum(self.weight * residual) / max(float(np.sum(self.weight * change)), 1e-300))

    def halves(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Blocks of either half of what tells."""
        tells = np.cumsum(np.maximum(self.gain, 0.0))
        first = tells <= 0.5 * tells[-1]
        first[0], first[-1] = True, False
        return first, ~first
