"""A field that turns with the sensor: a magnet or iron fixed to it, for a part of the recording.

In a few seconds of turning the field of the place and one of the sensor come apart, ``m = Rᵀ h + c``, six unknowns and
no heading needed. What windows say alike is a candidate; the cheapest way through the windows with these, and with
none, is taken, where a change costs.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.filters.smoother.keyframes import BLOCK, Bools, Keyframes, sum_between
from plumbob.rotations import dcm_from_quat

WINDOW: Final = 5.0
STRIDE: Final = 2.5
"""Windows, s, and how far they are apart."""
INDEPENDENT: Final = 10.0
"""Errors of the field in a window are worth so many independent ones."""
LEAST_NOISE: Final = 0.3
"""Noise of the field, µT, at least."""
CLEAR: Final = 1.5
"""A window says something if each axis of its field is known to this, µT; two alike are this near."""
LEAST: Final = 5.0
"""Smaller fields than this, µT, are left to the calibration: a bent field of the place looks like one."""
ALIKE: Final = 2
"""Windows that must say the same."""
CANDIDATES: Final = 8
CHANGE: Final = 30.0
"""Cost of a change, as a sum of squared standard deviations;"""
DEAREST: Final = 60.0
"""of a window at most, and"""
ATTACHED: Final = 1.0
"""of having such a field."""
SIZE_SD: Final = 3.0
"""Where nothing turns, the size of the field of the place says which, to this, µT, and"""
DEAREST_SIZE: Final = 20.0
"""at most at this cost."""
DOUBT: Final = 4.0
"""A difference that decides."""


@dataclass(frozen=True, slots=True)
class Attached:
    """Field that turns with the sensor, µT, body axes (K, 3), zero where there is none; and where nobody can tell."""

    field: Floats
    doubtful: Bools

    @property
    def found(self) -> bool:
        """Whether there is one."""
        return bool(self.field.any())


@dataclass(frozen=True, slots=True)
class _Windows:
    """What each window says: its own field (n, 3), its information, mean field as measured, and which say anything."""

    own: Floats
    info: Floats
    mean: Floats
    size: float
    strong: Bools
    weak: Bools


def attached_field(frames: Keyframes, q: Floats) -> Attached:
    """Field that turns with the sensor, with attitudes (N, 4) of the samples, of any heading that drifts slowly."""
    none = Attached(np.zeros((frames.gap.size, 3)), np.zeros(frames.gap.size, dtype=bool))
    windows = _windows(frames, q)
    if windows is None:
        return none
    candidates = _candidates(windows)
    if len(candidates) == 1:
        return none
    off_size = ((np.linalg.norm(windows.mean[:, np.newaxis] - candidates, axis=2) - windows.size) / SIZE_SD) ** 2
    path = _cheapest(_costs(windows, candidates, off_size))
    place = np.round((frames.middle - frames.t[0] - 0.5 * WINDOW) / STRIDE).astype(int)
    step = np.clip(place, 0, len(path) - 1)
    return Attached(candidates[path][step], _doubtful(windows, path, off_size)[step])


def _windows(frames: Keyframes, q: Floats) -> _Windows | None:
    """Least squares in every window; None where none says anything."""
    count = int((frames.t[-1] - frames.t[0] - WINDOW) // STRIDE) + 1
    seen = np.isfinite(frames.mag[:, 0])
    if count < ALIKE or not seen.any():
        return None
    mag = np.where(seen[:, np.newaxis], frames.mag, 0.0)
    begin = frames.t[0] + STRIDE * np.arange(count)
    low, high = np.searchsorted(frames.t, begin), np.searchsorted(frames.t, begin + WINDOW)

    def mean(values: Floats) -> Floats:
        shape = (-1, *(1,) * (values.ndim - 1))
        found: Floats = sum_between(values * seen.reshape(shape), low, high) / np.maximum(number, 1.0).reshape(shape)
        return found

    number = sum_between(seen.astype(float), low, high)
    c_nb = np.empty((len(q), 3, 3))
    for i in range(0, len(q), BLOCK):
        c_nb[i : i + BLOCK] = dcm_from_quat(q[i : i + BLOCK])
    h, m, power = mean((c_nb @ mag[:, :, np.newaxis])[:, :, 0]), mean(mag), mean((mag**2).sum(axis=1))
    turn = np.stack([mean(c_nb[:, i]) for i in range(3)], axis=1)  # row by row, which takes less room
    # The field of the place eliminated: (I − R̄ᵀR̄) c = m̄ − R̄ᵀ h̄
    normal = np.eye(3, dtype=np.float64) - np.swapaxes(turn, 1, 2) @ turn
    right = m - (np.swapaxes(turn, 1, 2) @ h[:, :, np.newaxis])[:, :, 0]
    solved = np.linalg.solve(normal + 1e-6 * np.eye(3), right[:, :, np.newaxis])
    own = np.asarray(solved[:, :, 0], dtype=np.float64)
    left = np.maximum(power - (h**2).sum(axis=1) - (own * right).sum(axis=1), 0.0) / 3.0
    good = number > 10.0
    info = np.where(good, INDEPENDENT / np.maximum(left, LEAST_NOISE**2), 0.0)[:, np.newaxis, np.newaxis] * normal
    strong = good & (np.linalg.eigvalsh(info)[:, 0] > 1.0 / CLEAR**2)
    if not strong.any():
        return None
    of_place = h - (turn @ own[:, :, np.newaxis])[:, :, 0]
    return _Windows(own, info, m, float(np.median(np.linalg.norm(of_place[strong], axis=1))), strong, good & ~strong)


def _candidates(windows: _Windows) -> Floats:
    """No field, and those that several windows say alike, (m, 3)."""
    found: list[Floats] = [np.zeros(3)]
    left = windows.strong.copy()
    while left.any() and len(found) < CANDIDATES:
        own = windows.own[left]
        near = np.linalg.norm(own[:, np.newaxis] - own, axis=2) < CLEAR
        group = near[np.argmax(near.sum(axis=1))]
        field = own[group].mean(axis=0)
        if group.sum() >= ALIKE and np.linalg.norm(field) > LEAST:
            found.append(field)
        left[np.flatnonzero(left)[group]] = False
    return np.array(found)


def _costs(windows: _Windows, candidates: Floats, off_size: Floats) -> Floats:
    """What each candidate costs in each window, (n, m)."""
    off = windows.own[:, np.newaxis] - candidates
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
