"""Which of the 48 arrangements of axes turns a vector as it turns, at which scale and delay, with honest odds.

Gravity and the Earth's field stand still while the body turns, so in the axes of their sensor they change by
``du/dt = (u − h) × (K ω + β)``: u what the sensor measures, h its offset, ω the measured rates, K the gyroscope's axes
and scale in those of the sensor, β the bias of the rates there. Both sides are integrated over time and averaged over
windows, so nothing is differentiated, and turns may be as large as they like. All terms are products of sixteen
scalars: ``u_l ω_j`` (9), ``u`` (3), ``ω`` (3) and 1. With the change of u (3) they make nineteen, and their Gram matrix
over a block of time is all that the 48 arrangements, the scale, the biases and the offset need.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.rotations import every_axes

BIN: Final = 0.02  # Step of the even grid on which rates and vectors are averaged, s
SCALARS: Final = 19
FREE: Final = 10  # Parameters of one arrangement: the scale, three biases of the rates, three offsets, three constants

_LONGEST_STEP: Final = 0.1
_LARGEST_TURN: Final = 0.5
"""Turn of a vector between samples farther apart than a bin, rad, beyond which the straight line is 1 % too short."""
_LEVI_CIVITA = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _LEVI_CIVITA[_i, _j, _k], _LEVI_CIVITA[_k, _j, _i] = 1.0, -1.0

_TURNED: Final = np.array([c for c in every_axes() if np.linalg.det(c) > 0.0])
ARRANGEMENTS: Final = np.concatenate((_TURNED, -_TURNED))
"""Every arrangement (48, 3, 3) of the rates in the sensor's axes: the right-handed ones, then their negatives."""


class Samples:
    """Samples (N, C) as straight lines between their times, and the area below them: means of any stretch come from it.

    Rows with NaN do not count.
    """

    def __init__(self, t: Floats, values: Floats) -> None:
        finite = np.isfinite(values).all(axis=1)
        self.t, self.values = (t, values) if finite.all() else (t[finite], values[finite])
        step = np.diff(self.t)[:, np.newaxis]
        area = np.cumsum(0.5 * (self.values[1:] + self.values[:-1]) * step, axis=0)
        self.area = np.concatenate((np.zeros((1, values.shape[1])), area))
        self.slope = np.diff(self.values, axis=0) / step
        usual = float(np.median(step)) if step.size else 0.0
        self.pauses = np.asarray(step[:, 0] > max(_LONGEST_STEP, 3.0 * usual))
        if usual > BIN or self.pauses.any():
            size = np.sqrt(np.sum(self.values * self.values, axis=1))
            turned = np.sum(self.values[1:] * self.values[:-1], axis=1) < math.cos(_LARGEST_TURN) * size[1:] * size[:-1]
            self.pauses |= turned & (step[:, 0] > BIN)

    def means(self, edges: Floats) -> Floats:
        """Means (N, C) between edges (N + 1,); NaN in pauses and outside."""
        if self.t.size < 2:
            return np.full((edges.size - 1, self.values.shape[1]), np.nan)
        at = np.clip(np.searchsorted(self.t, edges, side="right") - 1, 0, self.t.size - 2)
        into = (edges - self.t.take(at))[:, np.newaxis]
        rise = self.values.take(at, axis=0) + 0.5 * into * self.slope.take(at, axis=0)
        mean = np.diff(self.area.take(at, axis=0) + into * rise, axis=0) / np.diff(edges)[:, np.newaxis]
        mean[(edges[:-1] < self.t[0]) | (edges[1:] > self.t[-1])] = np.nan
        if self.pauses.any():
            inside, before = self.pauses[at], np.append(0, np.cumsum(self.pauses))[at]
            mean[inside[:-1] | inside[1:] | (np.diff(before) > 0)] = np.nan
        return np.asarray(mean)


def scalars(rate: Floats, vector: Floats, size: int, shift: int = 0) -> Floats:
    """Scalars of each pair of neighbouring windows (19, n), weighted; those of a pair that a pause spoils are 0.

    Rates and vector (N, 3) are means over the same even bins of time, NaN where a sensor has no samples. A window has
    `size` bins; the vector is `shift` bins later than the rates.
    """
    length = (len(rate) - abs(shift)) // size * size
    if length < 2 * size:
        return np.zeros((SCALARS, 0))
    pair = rate[max(-shift, 0) :][:length], vector[max(shift, 0) :][:length]
    finite = np.asarray(np.isfinite(pair[0][:, 0]) & np.isfinite(pair[1][:, 0]))
    w, u = (np.where(finite, values.T, 0.0) for values in pair)
    terms = np.empty((15, length))
    np.multiply(u[:, np.newaxis], w, out=terms[:9].reshape(3, 3, length))
    terms[9:12], terms[12:] = u, w
    # The integral from the mean instant of one window to that of the next weighs the terms by a triangle.
    weights = np.stack((np.ones(size), (np.arange(size) + 0.5) / size * BIN), axis=1)
    area, ramp = (terms.reshape(-1, size) @ weights).T.reshape(2, 15, -1)
    row = np.empty((SCALARS, length // size - 1))
    row[:15] = ramp[:, :-1] + BIN * area[:, 1:] - ramp[:, 1:]
    row[15] = size * BIN
    row[16:] = np.diff(area[9:12], axis=1) / size
    complete = np.asarray(finite.reshape(-1, size).all(axis=1))
    row[:, ~(complete[1:] & complete[:-1])] = 0.0
    return row


@cache
def designs() -> Floats:
    """What the parameters of each arrangement and the change weigh of the scalars, (48, 3, 11, 19).

    Axes: arrangement; component of the change; scale, three biases, three offsets times the scale, three constants, and
    the change itself; scalars.
    """
    made = np.zeros((len(ARRANGEMENTS), 3, FREE + 1, SCALARS))
    turned = np.einsum("cab,nbj->ncaj", _LEVI_CIVITA, ARRANGEMENTS)
    made[:, :, 0, :9] = turned.reshape(-1, 3, 9)  # u × W ω
    made[:, :, 1:4, 9:12] = np.swapaxes(_LEVI_CIVITA, 1, 2)  # u × β
    made[:, :, 4:7, 12:15] = -turned  # −h × W ω
    made[:, range(3), range(7, 10), 15] = made[:, range(3), 10, range(16, 19)] = 1.0
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


LONGEST_DELAY: Final = 0.5  # Delays that are looked for, s, either way
FLOOR: Final = 0.05  # part of the change that no arrangement explains: scales, axes that are not square, soft iron
WINDOWS: Final = (5, 20)  # Bins of a window: short ones follow quick motion, long ones average pushes out
_BLOCK: Final = 5.0  # s
_ROUNDS: Final = 3
_CONTRADICTS: Final = 4.6  # 100 to 1
CERTAIN: Final = math.log(1000.0)  # Logarithm of the odds above which an answer may be sure


@dataclass(eq=False, kw_only=True)
class VectorFit:
    """One vector sensor against the gyroscope."""

    log_odds: Floats  # (48,), logarithm of each arrangement's likelihood less that of the best
    halves: tuple[Floats, Floats]  # (48,), the same of each half of the recording's turning alone
    delay: float  # by how much the sensor's stamps are late, s
    delay_sd: float = math.inf  # its standard deviation, s
    delay_halves: tuple[float, float] = (math.nan, math.nan)  # the delay by each half
    # scale, scale_sd: what the rates have to be multiplied by
    scale: float = math.nan
    scale_sd: float = math.inf
    bias: Floats = field(default_factory=partial(np.zeros, 3))  # of the rates in the sensor's axes, their unit × scale
    offset: Floats = field(default_factory=partial(np.zeros, 3))  # of the sensor, in its unit
    explained: float  # part of the change that the best arrangement explains, 0 to 1
    contradicted: bool = False  # whether windows of another length say something else
    in_step: float = 0.0  # delay that pushes feign where they come in step with the turning, s
    best: int = field(init=False)  # number of the best arrangement
    margin: float = field(init=False)  # logarithm of the odds of the best arrangement against the next
    agrees: bool = field(init=False)  # whether both halves of the recording say the same
    torn: bool = field(init=False)  # whether a half of the recording clearly says something else

    def __post_init__(self) -> None:
        self.best, self.margin = int(np.argmax(self.log_odds)), float(-np.sort(self.log_odds)[-2])
        self.agrees = all(int(np.argmax(half)) == self.best for half in self.halves)
        self.torn = any(float(half.max() - half[self.best]) > _CONTRADICTS for half in self.halves)


def fit(t: Floats, gyr: Floats, vector: Floats, *, offset: float) -> VectorFit | None:
    """Score every arrangement of one sensor's axes against the gyroscope's; None where nothing overlaps or turns.

    Rates and vector are in whatever unit; rows with NaN do not count. The sensor's offset is at most the part `offset`
    of the length of the vector.
    """
    length = float(np.nanmedian(np.sqrt(np.sum(vector * vector, axis=1)))) if np.isfinite(vector).any() else 0.0
    if not length > 0.0 or not np.nanmax(np.abs(gyr), initial=0.0) > 0.0:
        return None
    edges, rates = np.arange(t[0], t[-1] + BIN, BIN), Samples(t, gyr)
    means = rates.means(edges), Samples(t, vector / length).means(edges)
    searches = [_ArrangementSearch(*means, size, offset) for size in WINDOWS]
    searches = [search for search in searches if search.scale > 0.0]
    if not searches:
        return None
    fits = [search.fit() for search in searches]
    clearest = int(np.argmax([rival.margin for rival in fits]))
    best, search = fits[clearest], searches[clearest]
    against = any(rival.best != best.best and rival.margin > _CONTRADICTS and rival.agrees for rival in fits)
    return replace(search.refined(rates, edges, best, length), contradicted=against)


class _ArrangementSearch:
    """Search of arrangement and delay with windows of one size."""

    def __init__(self, rate: Floats, vector: Floats, size: int, offset: float) -> None:
        self.rate, self.vector, self.size = rate, vector, size
        self.block = max(4, round(min(_BLOCK, len(rate) * BIN / 10.0) / (size * BIN)))
        grams = self._blocks(scalars(rate, vector, size, 0))
        turned = float(np.einsum("bii->", grams[:, 12:15, 12:15]))
        changed = np.einsum("bii->b", grams[:, 16:, 16:])
        self.scale = float(np.sqrt(changed.sum() / turned)) if turned > 0.0 else 0.0
        # deviations for a vector of length 1: a consumer part's bias is a few °/s; constants are an offset times a bias
        sd = np.array([1e3 * self.scale] + [0.1] * 3 + [offset * self.scale] * 3 + [0.1 * offset] * 3)
        self.ridge = 1.0 / sd**2 if self.scale > 0.0 else np.ones(FREE)
        usual = float(np.median(changed[changed > 0.0])) if (changed > 0.0).any() else 0.0
        self.weight = np.where(changed > 0.0, 1.0 / (changed + 0.1 * usual + 1e-300), 0.0)

    def fit(self) -> VectorFit:
        """Best delay of each arrangement on the grid, and their odds by blocks; what depends on the delay is open."""
        reach = min(round(LONGEST_DELAY / BIN), len(self.rate) // 4)
        shifts = np.arange(-reach, reach + 1)
        rows = (scalars(self.rate, self.vector, self.size, int(shift)) for shift in shifts)
        grams = np.concatenate([self._gram(row, self.weight[np.newaxis]) for row in rows])
        m = _moments(grams, np.arange(len(_TURNED)))  # (24, shifts, 11, 11)
        change = m[0, :, -1, -1]
        weak = np.diag(self.ridge) * (change / (3.0 * self.block * len(self.weight)) + 1e-12)[:, np.newaxis, np.newaxis]
        p = solved(m[..., :-1, :-1] + weak, m[..., :-1, -1:])[..., 0]
        rss = _rss(m, p)  # the negative of an arrangement has the same solution with the scale negated, but that is > 0
        both = np.concatenate([np.where(sign * p[..., 0] > 0.0, rss, change) for sign in (1.0, -1.0)])
        residual = (both / np.maximum(change, 1e-300)).T  # part of the change that is left, (shifts, 48)
        at = residual.argmin(axis=0)
        cut = {int(i): self._blocks(scalars(self.rate, self.vector, self.size, int(shifts[i]))) for i in np.unique(at)}
        count = min(map(len, cut.values()))
        moments = np.empty((len(at), count, FREE + 1, FREE + 1))
        for i, blocks in cut.items():
            moments[at == i] = _moments(blocks[:count], np.flatnonzero(at == i))
        first = int(residual.min(axis=0).argmin())
        counts = cut[int(at[first])][:count, 15, 15] / (self.size * BIN) ** 2  # windows that count in each block
        best = _Scored(moments[first : first + 1], counts, self.ridge)
        # independent samples for each window: residuals of neighbours are alike
        row = scalars(self.rate, self.vector, self.size, int(shifts[at[first]]))[:, : len(best.counts) * self.block]
        residuals = np.einsum("in,cai,a->nc", row, designs()[first], np.append(-best.p[0], 1.0), optimize=True)
        sd = np.repeat(np.sqrt(best.variance[0]), self.block)[: len(residuals), np.newaxis]
        counts = 1.0 / inflation(residuals / sd) * counts
        scored = _Scored(moments, counts, self.ridge)
        log = scored.log_likelihood
        top = int(log.argmax())
        # blocks of either half of what tells of the best
        before, after = scored.change[top] + scored.floor[top], scored.residual[top] + scored.floor[top]
        tells = np.cumsum(np.maximum(np.where(scored.live, counts * np.log(before / after), 0.0), 0.0))
        early = tells <= 0.5 * tells[-1]
        early[0], early[-1] = True, False
        halves = early, ~early
        by_half = [_Scored(moments[:, half], counts[half], self.ridge).log_likelihood for half in halves]
        self.weights = np.where((np.ones(count, dtype=np.bool_), *halves), scored.weight[top], 0.0)
        self.wider = widening(2.0 * float(counts.sum()), FREE)
        return VectorFit(
            log_odds=log - log.max(),
            halves=(by_half[0] - by_half[0].max(), by_half[1] - by_half[1].max()),
            delay=BIN * float(shifts[at[top]]),
            explained=float(scored.explained[top]),
        )

    def refined(self, rates: Samples, edges: Floats, on_grid: VectorFit, length: float) -> VectorFit:
        """Delay of the best arrangement between the steps of the grid, and its scale, bias and offset at that delay."""
        delays, sds = self.delays(rates, edges, on_grid.best, on_grid.delay)
        between = rates.means(edges - (delays[0] - on_grid.delay))
        gram = self._gram(scalars(between, self.vector, self.size, round(on_grid.delay / BIN)), self.weights[:1])
        m = _moments(gram, np.array([on_grid.best]))[0, 0]
        normal = m[:-1, :-1] + np.diag(self.ridge)
        p = solved(normal, m[:-1, -1:])[:, 0]
        # factors of time, of a unit or a range are the same about all axes: where a scale for each surely explains more
        # than chance does, one for all is by so much less certain (Birge's ratio)
        each = designs()[on_grid.best][:, [0, 0, *range(FREE + 1)]]
        each[:, :3, :9] *= np.tile(np.eye(3), 3)
        m = np.sum(each @ gram[0] @ each.swapaxes(1, 2), axis=0)
        scales = solved(m[:-1, :-1] + np.diag(np.append(self.ridge[[0, 0]], self.ridge)), m[:-1, -1:])[:, 0]
        apart = 0.5 * float(_rss(m, np.append(p[[0, 0]], p)) - _rss(m, scales))
        variance = float(solved(normal, np.eye(FREE))[0, 0]) * (apart if apart > CERTAIN else 1.0)
        return replace(
            on_grid, delay=delays[0], delay_sd=sds[0], delay_halves=(delays[1], delays[2]), scale=float(p[0]),
            scale_sd=math.sqrt(variance) * self.wider, bias=p[1:4],
            offset=length * p[4:7] / max(float(p[0]), 1e-3 * self.scale),
        )  # fmt: skip

    def _blocks(self, row: Floats) -> Floats:
        """Gram matrices (blocks, 19, 19) of the scalars of windows."""
        count = max(1, row.shape[1] // self.block) * self.block
        row = np.pad(row, ((0, 0), (0, max(0, count - row.shape[1]))))[:, :count]
        cut = row.reshape(SCALARS, -1, self.block).swapaxes(0, 1)
        return np.asarray(cut @ cut.swapaxes(1, 2))

    def _gram(self, row: Floats, weights: Floats) -> Floats:
        """Gram matrices (n, 19, 19) of all windows, by the weights of blocks."""
        grams = self._blocks(row)[: len(weights[0])]
        return np.asarray(np.tensordot(weights[:, : len(grams)], grams, 1))

    def delays(self, rates: Samples, edges: Floats, n: int, start: float) -> tuple[list[float], list[float]]:
        """Delay of an arrangement and its standard deviation, s, by all blocks and by either half of them.

        The vertex of a parabola, drawn thrice: about the start, about the vertex of all, and about that of each.
        """
        shift, at = round(start / BIN), np.zeros(3)
        sd, costs = np.full(3, np.inf), dict[float, Floats]()
        open_ = np.ones(3, dtype=np.bool_)
        for step, reach in enumerate((BIN, 0.3 * BIN, 0.3 * BIN)):
            away = reach * np.array([-1.0, 0.0, 1.0])
            for i in np.flatnonzero(open_):
                centre = at[i] if step == 2 else at[0]
                for d in centre + away:
                    if d not in costs:
                        row = scalars(rates.means(edges - d), self.vector, self.size, shift)
                        grams = self._gram(row, self.weights)
                        m = _moments(grams, np.array([n]))[0]  # weighted by inverse variances
                        p = solved(m[:, :-1, :-1] + np.diag(self.ridge), m[:, :-1, -1:])[..., 0]
                        costs[d] = 0.5 * (m[:, -1, -1] - np.sum(p * m[:, :-1, -1], axis=1))
                before, middle, after = (costs[d][i] for d in centre + away)
                slope, bend = 0.5 * (after - before) / reach, (after - 2.0 * middle + before) / reach**2
                if not bend > 0.0:
                    sd[i], open_[i] = np.inf, False
                    continue
                at[i], sd[i] = centre + np.clip(-slope / bend, -2.0 * reach, 2.0 * reach), 1.0 / np.sqrt(bend)
        return [start + float(d) for d in at], sd.tolist()


def widening(samples: float, free: int) -> float:
    """By how much a deviation grows of which so few samples say the variance, by Student's distribution."""
    return math.sqrt(samples / rest) if (rest := samples - free - 2.0) > 0.0 else math.inf


def _moments(grams: Floats, n: NDArray[np.int64]) -> Floats:
    """Moments (n, K, 11, 11) of the parameters of arrangements and the change, of Gram matrices (K, 19, 19)."""
    design = designs()[n]
    right = (grams @ design.reshape(-1, SCALARS).T).reshape(len(grams), SCALARS, len(n), 3, FREE + 1)
    right = right.transpose(2, 0, 3, 1, 4).reshape(len(n), len(grams), 3 * SCALARS, FREE + 1)
    return np.asarray(design.swapaxes(1, 2).reshape(len(n), 1, FREE + 1, 3 * SCALARS) @ right)


def _rss(m: Floats, p: Floats) -> Floats:
    """Sums of squares (…) that parameters (…, 10) leave of moments (…, 11, 11)."""
    full = np.concatenate((-p, np.ones((*p.shape[:-1], 1))), axis=-1)
    return np.asarray(np.maximum(np.sum((m @ full[..., np.newaxis])[..., 0] * full, axis=-1), 0.0))


def inflation(left: Floats) -> float:
    """Samples (n, 3) that one independent one stands for, by the positive start of their autocorrelation."""
    size = len(left)
    power = float(np.sum(left * left))
    total = 1.0
    for lag in range(1, max(2, size // 4)):
        rho = float(np.vdot(left[lag:], left[:-lag])) / power if power > 0.0 else 0.0
        if lag > 1 and rho < 0.02:
            break
        total += 2.0 * max(rho, 0.0)
    return total


class _Scored:
    """Arrangements, each with a variance of its own in each block: what pushes the unit now and then counts less.

    Two of three components tell: the vector does not change along itself.
    """

    def __init__(self, moments: Floats, counts: Floats, ridge: Floats) -> None:
        self.counts = counts
        self.change = change = moments[..., -1, -1]  # (A, blocks)
        ordered, some = np.sort(np.where(change > 0.0, change, np.inf), axis=1), np.sum(change > 0.0, axis=1)
        ordered = np.pad(ordered, ((0, 0), (0, 1)), constant_values=1.0)  # there may be none
        middle = np.stack(((some - 1).clip(0) // 2, some // 2), axis=1)
        usual = np.where(some > 0, np.take_along_axis(ordered, middle, axis=1).mean(axis=1), 1.0)
        self.floor = floor = FLOOR**2 * (change + 0.01 * usual[:, np.newaxis]) + 1e-12
        many = np.maximum(counts, 1e-3)
        variance = (change + floor) / (2.0 * many)
        self.live = live = counts > 0.5
        flat = moments.reshape(*change.shape, (FREE + 1) ** 2)  # no block may be left
        for _ in range(_ROUNDS):
            self.weight = np.where(live, 1.0 / variance, 0.0)
            total = (self.weight[:, np.newaxis] @ flat).reshape(-1, FREE + 1, FREE + 1)
            self.normal = total[:, :-1, :-1] + np.diag(ridge)
            self.p = solved(self.normal, total[:, :-1, -1:])[..., 0]
            if (back := self.p[:, 0] <= 0.0).any():
                self.p[back, 0] = 0.0
                self.p[back, 1:] = solved(self.normal[back, 1:, 1:], total[back, 1:-1, -1:])[..., 0]
            self.residual = _rss(moments, np.broadcast_to(self.p[:, np.newaxis], (*change.shape, FREE)))
            variance = (self.residual + floor) / (2.0 * many)
        self.variance = np.maximum(variance, 1e-300)
        self.log_likelihood = -np.log(self.residual + floor)[:, live] @ counts[live] - 0.5 * self.p**2 @ ridge
        before = np.maximum(np.sum(self.weight * change, axis=1), 1e-300)
        self.explained = 1.0 - np.sum(self.weight * self.residual, axis=1) / before
