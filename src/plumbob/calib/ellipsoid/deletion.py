"""Outliers among few samples: the smallest group without which the rest fits beyond chance [Cook1982].

One by one is not enough: two outliers hide each other, for the misfit that is left without the one is that of the
other. So pairs and threes are tried as well, all of them, in closed form: deleting a set S of samples from a linear
fit with the hat matrix H lowers the sum of squares by e_Sᵀ (I − H_SS)⁻¹ e_S.
"""

from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats

LARGEST: Final = 3
"""Most samples that are deleted at once."""

_ALONE: Final = 1e-6  # determinant of I − H_SS below which nothing else knows some parameter


def outlying(rows: Floats, left: Floats, *, false_alarm: float, rounding: float) -> NDArray[np.int64]:
    """Indices of the smallest group of outliers; empty where no group is beyond chance.

    Parameters
    ----------
    rows : ndarray (N, p)
        Derivatives of the residuals by the parameters.
    left : ndarray (N,)
        Residuals of the fit.
    false_alarm : float
        Probability that normal errors lose a sample.
    rounding : float
        Standard deviation of residuals that are rounding errors only.
    """
    from scipy.stats import f

    q, _ = np.linalg.qr(rows)
    spare = np.eye(len(left)) - q @ q.T
    left = spare @ left  # what the curvature of the model makes of the rest would pass for misfit
    cost = float(left @ left)
    for count in range(1, LARGEST + 1):
        free = len(left) - rows.shape[1] - count
        if free < 2:
            break
        groups = np.array(list(combinations(range(len(left)), count)))
        gains = _gains(spare, left, groups)
        best = int(np.argmax(gains))
        rest = max((cost - float(gains[best])) / free, rounding**2)
        if f.sf(gains[best] / count / rest, count, free) * len(groups) * LARGEST < false_alarm:
            return np.asarray(groups[best])
    return np.zeros(0, dtype=np.int64)


def _gains(spare: Floats, left: Floats, groups: NDArray[np.int64]) -> Floats:
    """What the deletion of each group (M, k) takes off the sum of squares, (M,)."""
    inner = spare[groups[:, :, np.newaxis], groups[:, np.newaxis, :]]
    alone = np.linalg.det(inner) < _ALONE
    inner[alone] = np.eye(groups.shape[1])
    gains = np.einsum("mi,mi->m", left[groups], np.linalg.solve(inner, left[groups][:, :, np.newaxis])[:, :, 0])
    return np.where(alone, 0.0, gains)
