"""Whether the field of the body changed during a capture: iron or a magnet moved, or the unit was taken elsewhere."""

from typing import Final, NamedTuple

import numpy as np

from plumbob.calib.ellipsoid.norm_fit import NormFit, linearised
from plumbob.calib.mag.outcome import MOST_OUTLIERS
from plumbob.calib.refusal import Reason
from plumbob.check import Floats

FEWEST: Final = 30
"""Samples from which on a change is looked for."""

_SOME: Final = 4000
_PLACES: Final = np.linspace(0.05, 0.95, 37)
_EXPLAINED: Final = 0.5  # of the squares that the fit leaves
_SIZE: Final = 0.01  # of the field
_CHANCE: Final = 1e-6  # at each place, that noise alone explains so much


def moved(vectors: Floats, fit: NormFit) -> Reason | None:
    """Reason to refuse vectors (N, 3), in their order, whose centre jumps somewhere; None where it does not.

    At each of some places, the fit is allowed another centre from there on. That explains half of what one centre
    leaves, beyond chance and by more than 1 % of the field, only where there was a jump. The samples of the other field
    are outliers as a rule, and count all the same; but where there are few of them at the start, what they measured has
    passed, and with them set aside the rest is judged.
    """
    if len(vectors) < FEWEST:
        return None
    some = slice(None, None, max(1, len(vectors) // _SOME))
    rows, left = linearised(vectors[some], fit.ellipsoid)
    radius = 3.0 / float(np.trace(fit.ellipsoid.shape))
    jump = _largest(rows, left, radius)
    if jump is not None and jump.place <= MOST_OUTLIERS:
        rows, left = rows[fit.used[some]], left[fit.used[some]]
        jump = _largest(rows, left, radius)
    if jump is None:
        return None
    size = float(np.linalg.norm(jump.size))
    return Reason(
        "magnet-moved",
        f"after {100.0 * jump.place:.0f} % of the samples the centre of the field jumped by {size:.2g} µT, "
        f"{100.0 * size / radius:.0f} % of the field; that explains {100.0 * jump.explained:.0f} % of the misfit.",
        "Keep phones, tools, cables with current and steel away from the unit, fix what moves on it, and capture anew.",
    )


class _Jump(NamedTuple):
    """A jump of the centre: share of the misfit that it explains, where it is, and the jump (3,)."""

    explained: float
    place: float
    size: Floats


def _largest(rows: Floats, left: Floats, radius: float) -> _Jump | None:
    """Jump that explains the most of what is left (N,), None where it is chance, or too small."""
    best = _Jump(0.0, 0.0, np.zeros(3))
    for place in _PLACES:
        jump = np.where(np.arange(len(left))[:, np.newaxis] >= place * len(left), rows[:, :3], 0.0)
        best = max(best, _jump(place, rows, jump, left), key=lambda found: found.explained)
    if best.explained < _EXPLAINED or np.linalg.norm(best.size) < _SIZE * radius:
        return None
    return best if _chance(best, *rows.shape) <= _CHANCE else None


def _chance(jump: _Jump, count: int, parameters: int) -> float:
    from scipy.stats import f

    free = count - parameters - 3
    return float(f.sf(jump.explained / 3.0 / ((1.0 - jump.explained) / free), 3, free))


def _jump(place: float, rows: Floats, jump: Floats, left: Floats) -> _Jump:
    """What a linear step with a jump leaves, against one without."""
    both = np.hstack((rows, jump))
    scale = np.maximum(np.linalg.norm(both, axis=0), 1e-12)
    normal, right = (both / scale).T @ (both / scale), (both / scale).T @ left
    without, step = (np.linalg.lstsq(normal[:n, :n], right[:n], rcond=1e-12)[0] for n in (rows.shape[1], len(right)))
    total = float(left @ left) - float(right[: rows.shape[1]] @ without)
    gained = float(right @ step) - float(right[: rows.shape[1]] @ without)
    return _Jump(gained / total if total > 0.0 else 0.0, float(place), -(step / scale)[-3:])
