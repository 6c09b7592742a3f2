"""Averages of rotations."""

import numpy as np
from numpy.typing import ArrayLike

from plumbob import check
from plumbob.check import Floats
from plumbob.errors import ShapeError


def quat_mean(q: ArrayLike, weights: ArrayLike | None = None) -> Floats:
    """Rotation with the least weighted sum of squared chordal distances to the given ones, [Markley2007] (12).

    Parameters
    ----------
    q : array_like (N, 4)
        Unit quaternions, wxyz; signs do not matter. Rows that are NaN are left out.
    weights : array_like (N,), optional
        Weights ≥ 0.

    Returns
    -------
    ndarray (4,)
        Unit quaternion with scalar part ≥ 0.

    Raises
    ------
    ShapeError
        If nothing is left to average, or the average is not unique (rotations spread evenly).
    """
    array = check.rows("q", q, 4)
    w = np.ones(array.shape[0]) if weights is None else check.column("weights", weights, array.shape[0])
    if not ((w >= 0.0) & (w < np.inf)).all():
        raise ShapeError(f"weights must be finite and ≥ 0, but they hold {w[~((w >= 0.0) & (w < np.inf))][0]:g}.")
    keep = np.isfinite(array).all(axis=1) & (w > 0.0)
    if not keep.any():
        raise ShapeError("q holds no finite quaternion with a positive weight, so there is nothing to average.")
    values, vectors = np.linalg.eigh((array[keep] * w[keep, np.newaxis]).T @ array[keep])
    if values[-1] - values[-2] < 1e-9 * values[-1]:
        raise ShapeError("the rotations are spread so evenly that their average is not unique.")
    mean: Floats = vectors[:, -1]
    return -mean if mean[0] < 0.0 else mean
