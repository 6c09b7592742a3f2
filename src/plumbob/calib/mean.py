"""Means of triads, and how well one is known where the noise of neighbouring samples is not independent."""

import numpy as np

from plumbob.check import Floats

BLOCKS = 10
"""Parts whose means tell how far the mean of all is off: noise that is correlated over less than a part is covered."""


def mean_of_whole(values: Floats) -> Floats:
    """Mean (3,) of the rows of (N, 3) that have no NaN; NaN where there is none."""
    whole = values[np.isfinite(values).all(axis=1)]
    return np.asarray(whole.mean(axis=0)) if len(whole) else np.full(3, np.nan)


def mean_and_sd(values: Floats) -> tuple[Floats, Floats]:
    """Mean of (N, 3) and its standard deviation (3,), from the scatter of the means of `BLOCKS` parts.

    Parameters
    ----------
    values : ndarray (N, 3)
        Samples in their order, N of at least 2 `BLOCKS`.
    """
    parts = np.array([part.mean(axis=0) for part in np.array_split(values, BLOCKS)])
    return values.mean(axis=0), np.asarray(parts.std(axis=0, ddof=1) / np.sqrt(BLOCKS))
