"""A field that turns with the sensor: the unit's own hard iron, or a magnet on it for a part of the recording.

In a few seconds of turning the field of the place and one of the sensor come apart, ``m = Rᵀ h + c``, six unknowns and
no heading needed. What nearly all windows say together is the unit's own. Of the rest, what some windows say alike is a
candidate; the cheapest way through the windows with these, and with none, is taken, where a change costs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.filters.smoother.keyframes import BLOCK, Bools, Keyframes, sum_between
from plumbob.rotations import dcm_from_quat

WINDOW, STRIDE = 5.0, 2.5  # length of a window, s, and how far they are apart
INDEPENDENT: Final = 10.0  # errors of the field in a window are worth so many independent ones
LEAST_NOISE: Final = 0.3  # noise of the field, µT, at least
CLEAR: Final = 1.5  # a window says something if each axis of its field is known to this, µT; two alike are this near
LEAST: Final = 5.0
"""Smaller fields than this, µT, are left to the calibration: an uneven field of the place looks like one."""
ALIKE: Final = 2  # windows that must say the same
SHORTEST: Final = 1.0
"""A recording too short for that is one window, of at least this, s. It says something alone, if each axis is known"""
ALONE: Final = 2.5
"""to this, µT, the field is beyond so many standard deviations,"""
SURE: Final = 6.0
EXPLAINED: Final = 6.0
"""and without it so many times the power would be left."""
CANDIDATES: Final = 8
CHANGE: Final = 30.0  # cost of a change, as a sum of squared standard deviations;
DEAREST: Final = 60.0
"""of a window at most, and"""
ATTACHED: Final = 1.0
"""of having such a field."""
SIZE_SD: Final = 3.0  # where nothing turns, the size of the field of the place says which, to this, µT, and
DEAREST_SIZE: Final = 20.0
"""at most at this cost."""
DOUBT: Final = 4.0  # a difference that decides
AGREED: Final = 0.8  # the unit has a field of its own if the windows agree so well, as the mean of weights from 0 to 1:
OUTLIER: Final = 12.0
"""a window off by so many variances counts with a quarter."""
KNOWN: Final = 0.5  # each axis of it is then known to this, µT
MEDIAN_OF_THREE: Final = 2.366  # median of χ² with three degrees of freedom


@dataclass(frozen=True, slots=True)
class Attached:
    """Fields that turn with the sensor, µT, body axes."""

    field: Floats  # (K, 3), all of it, at each step
    doubtful: Bools  # (K,), steps where nobody can tell
    iron: Floats  # (3,), what belongs to the unit itself, and was taken off
    suspect: Floats  # (3,), what may belong to it and was not taken off: an uneven field of the place looks like it

    @property
    def present(self) -> bool:
        """Whether there is one."""
        return bool(self.field.any())

    @property
    def magnet(self) -> Floats:
        """What was on the unit for a part of the recording, (K, 3)."""
        return np.asarray(self.field - self.iron)


@dataclass(frozen=True, slots=True)
class _Windows:
    """What each window says: its own field (n, 3), its information, mean field as measured, and which say anything."""

    field: Floats
    info: Floats
    mean: Floats
    size: float
    strong: Bools
    weak: Bools

    @classmethod
    def from_attitudes(cls, frames: Keyframes, attitudes: Sequence[Floats]) -> Self | None:
        """Least squares in every window, with that of the attitudes that explains its field best.

        None where all together say nothing.
        """
        length = float(frames.t[-1] - frames.t[0])
        count = int((length - WINDOW) // STRIDE) + 1
        mask = np.isfinite(frames.mag[:, 0])
        if length < SHORTEST or not mask.any():
            return None
        long = count >= ALIKE
        begin = frames.t[0] + STRIDE * np.arange(count if long else 1)
        low = np.searchsorted(frames.t, begin)
        high = np.searchsorted(frames.t, begin + (WINDOW if long else length), side="left" if long else "right")
        fits = [_fit(frames, q, mask, low, high) for q in attitudes]
        best = np.argmin([fit.residual for fit in fits], axis=0), np.arange(low.size)
        fit = _WindowFits(*(np.stack(of)[best] for of in zip(*fits, strict=True)))
        independent = INDEPENDENT * min(1.0, length / WINDOW)
        good = fit.number > 10.0
        weight = np.where(good, independent / np.maximum(fit.residual, LEAST_NOISE**2), 0.0)
        info = weight[:, np.newaxis, np.newaxis] * fit.normal
        if not long and not _alone(fit, info):
            return None
        strong = good & (np.linalg.eigvalsh(info)[:, 0] > 1.0 / (CLEAR if long else ALONE) ** 2)
        if long and np.linalg.eigvalsh(info.sum(axis=0))[0] < 1.0 / CLEAR**2:
            return None
        size = float(np.median(fit.size[strong])) if strong.any() else 0.0
        return cls(fit.field, info, fit.mean, size, strong, good & ~strong)

    def without(self, field: Floats) -> Self:
        """The same without a field, (3,) or (n, 3), that turns with the sensor."""
        return replace(self, field=self.field - field, mean=self.mean - field)


def attached_field(frames: Keyframes, *attitudes: Floats) -> Attached:
    """Field that turns with the sensor, by attitudes (N, 4) halfway to each sample, of a heading that drifts slowly."""
    steps = frames.gap.size
    windows = _Windows.from_attitudes(frames, attitudes)
    if windows is None:
        return Attached(np.zeros((steps, 3)), np.zeros(steps, dtype=bool), np.zeros(3), np.zeros(3))
    alone = len(windows.field) < ALIKE
    iron, suspect = (np.zeros(3), np.zeros(3)) if alone else _of_unit(windows)
    windows = windows.without(iron)
    candidates = _candidates(windows)
    if len(candidates) == 1:
        return Attached(np.tile(iron, (steps, 1)), np.zeros(steps, dtype=bool), iron, suspect)
    off_size = ((np.linalg.norm(windows.mean[:, np.newaxis] - candidates, axis=2) - windows.size) / SIZE_SD) ** 2
    path = _cheapest(_costs(windows, candidates, off_size))
    if not (alone or iron.any() or suspect.any()):  # the magnet may have hidden it
        iron, suspect = _of_unit(windows.without(candidates[path]))
    place = np.round((frames.middle - frames.t[0] - 0.5 * WINDOW) / STRIDE).astype(int)
    step = np.clip(place, 0, len(path) - 1)
    return Attached(iron + candidates[path][step], _doubtful(windows, path, off_size)[step], iron, suspect)


def _of_unit(windows: _Windows) -> tuple[Floats, Floats]:
    """Field of the unit itself, (3,), by all windows together: what to take off and what to leave."""
    good = windows.strong | windows.weak
    fields, info = windows.field[good], windows.info[good]
    vector = np.einsum("nij,nj->ni", info, fields)
    start = fields[windows.strong[good]]
    iron = np.median(start, axis=0) if len(start) > ALIKE else np.linalg.solve(info.sum(axis=0), vector.sum(axis=0))
    for _ in range(20):
        off = fields - iron
        off2 = np.einsum("ni,nij,nj->n", off, info, off)
        scale = max(1.0, float(np.median(off2)) / MEDIAN_OF_THREE)
        weight = 1.0 / (1.0 + off2 / (OUTLIER * scale)) ** 2
        total = np.einsum("n,nij->ij", weight, info)
        iron = np.linalg.solve(total, weight @ vector)
    if np.linalg.eigvalsh(total)[0] < scale / KNOWN**2 or weight.mean() < AGREED:
        return np.zeros(3), np.zeros(3)
    if windows.weak.any() and windows.size:  # nearly all windows without turning must have the size of the place
        off = (np.linalg.norm(windows.mean[windows.weak] - iron, axis=1) - windows.size) / SIZE_SD
        if (off**2 < DOUBT).mean() <= AGREED:
            return np.zeros(3), np.zeros(3)
    return (iron, np.zeros(3)) if np.linalg.norm(iron) > LEAST else (np.zeros(3), iron)


class _WindowFits(NamedTuple):
    """Least squares of each window, with one attitude.

    Its own field (n, 3), that of the place eliminated from its normal equations (n, 3, 3), the mean field (n, 3), the
    size of the place's, the power of the field about its mean and what is left of it, each axis, and its samples, (n,).
    """

    field: Floats
    normal: Floats
    mean: Floats
    size: Floats
    power: Floats
    residual: Floats
    number: Floats


def _fit(frames: Keyframes, q: Floats, mask: Bools, low: NDArray[np.int64], high: NDArray[np.int64]) -> _WindowFits:
    """Fit fields of the place and of the sensor in windows, from a row to before another one."""
    mag = np.where(mask[:, np.newaxis], frames.mag, 0.0)

    def mean(values: Floats) -> Floats:
        shape = (-1, *(1,) * (values.ndim - 1))
        means: Floats = sum_between(values * mask.reshape(shape), low, high) / np.maximum(number, 1.0).reshape(shape)
        return means

    number = sum_between(mask.astype(float), low, high)
    c_nb = np.empty((len(q), 3, 3))
    for i in range(0, len(q), BLOCK):
        c_nb[i : i + BLOCK] = dcm_from_quat(q[i : i + BLOCK])
    h, m = mean((c_nb @ mag[:, :, np.newaxis])[:, :, 0]), mean(mag)
    power = mean((mag**2).sum(axis=1) + frames.scatter)
    turn = np.stack([mean(c_nb[:, i]) for i in range(3)], axis=1)  # row by row, which takes less room
    # The field of the place eliminated: (I − R̄ᵀR̄) c = m̄ − R̄ᵀ h̄
    normal = np.eye(3, dtype=np.float64) - np.swapaxes(turn, 1, 2) @ turn
    right = m - (np.swapaxes(turn, 1, 2) @ h[:, :, np.newaxis])[:, :, 0]
    solved = np.linalg.solve(normal + 1e-6 * np.eye(3), right[:, :, np.newaxis])
    field = np.asarray(solved[:, :, 0], dtype=np.float64)
    power = np.maximum(power - (h**2).sum(axis=1), 0.0)
    residual = np.maximum(power - (field * right).sum(axis=1), 0.0)
    size = np.linalg.norm(h - (turn @ field[:, :, np.newaxis])[:, :, 0], axis=1)
    return _WindowFits(field, normal, m, size, power / 3.0, residual / 3.0, number)


def _alone(fit: _WindowFits, info: Floats) -> bool:
    """Whether one short window says by itself that a field turns with the sensor."""
    field = fit.field[0]
    clear = np.linalg.eigvalsh(info[0])[0] > 1.0 / ALONE**2 and field @ info[0] @ field > SURE**2
    return bool(clear and fit.residual[0] * EXPLAINED < fit.power[0])


def _candidates(windows: _Windows) -> Floats:
    """No field, and those that several windows say alike, (m, 3)."""
    fields: list[Floats] = [np.zeros(3)]
    remaining, alike = windows.strong.copy(), min(ALIKE, len(windows.field))
    while remaining.any() and len(fields) < CANDIDATES:
        estimates = windows.field[remaining]
        near = np.linalg.norm(estimates[:, np.newaxis] - estimates, axis=2) < CLEAR
        group = near[np.argmax(near.sum(axis=1))]
        field = estimates[group].mean(axis=0)
        if group.sum() >= alike and np.linalg.norm(field) > LEAST:
            fields.append(field)
        remaining[np.flatnonzero(remaining)[group]] = False
    return np.array(fields)


def _costs(windows: _Windows, candidates: Floats, off_size: Floats) -> Floats:
    """What each candidate costs in each window, (n, m)."""
    off = windows.field[:, np.newaxis] - candidates
    cost: Floats = np.minimum(np.einsum("nci,nij,ncj->nc", off, windows.info, off), DEAREST)
    cost += np.where(windows.weak[:, np.newaxis], np.minimum(off_size, DEAREST_SIZE), 0.0)
    cost[:, 1:] += ATTACHED
    return cost


def _cheapest(cost: Floats) -> NDArray[np.int64]:
    """Cheapest way through the windows, (n,): Viterbi's."""
    count, kinds = cost.shape
    total, back = cost[0].copy(), np.zeros((count, kinds), dtype=np.int64)
    for k in range(1, count):
        best = int(np.argmin(total))
        back[k] = np.where(total <= total[best] + CHANGE, np.arange(kinds), best)
        total = np.minimum(total, total[best] + CHANGE) + cost[k]
    path = np.empty(count, dtype=np.int64)
    path[-1] = np.argmin(total)
    for k in range(count - 1, 0, -1):
        path[k - 1] = back[k, path[k]]
    return path


def _doubtful(windows: _Windows, path: NDArray[np.int64], off_size: Floats) -> Bools:
    """Windows without turning, beside one with such a field, whose size does not say whether they have it."""
    speaking, doubtful = np.flatnonzero(windows.strong), np.zeros(path.size, dtype=bool)
    for k in np.flatnonzero(windows.weak):
        place = int(np.searchsorted(speaking, k))
        beside = {int(path[i]) for i in (*speaking[max(place - 1, 0) : place], *speaking[place : place + 1])} - {0}
        doubtful[k] = any(abs(off_size[k, i] - off_size[k, 0]) < DOUBT for i in beside)
    return doubtful
