"""Statistics of one error over the scored samples."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from plumbob.check import Floats

PERCENTILES = (50, 95, 99)


@dataclass(frozen=True, slots=True)
class Stats:
    """What is told about an error; angles in rad.

    Attributes
    ----------
    count : int
        Samples.
    rmse : float
        Root mean square: the constant part is in it.
    mean, std : float
        The constant part, and what remains without it: rmse² = mean² + std². A std alone hides a constant error.
    max_abs : float
        Largest magnitude.
    max_at : float
        Time of it, s.
    p50, p95, p99 : float
        Percentiles of the magnitude, interpolated linearly.
    """

    count: int
    rmse: float
    mean: float
    std: float
    max_abs: float
    max_at: float
    p50: float
    p95: float
    p99: float

    @classmethod
    def of(cls, error: Floats, t: Floats) -> Self | None:
        """Statistics of the values (N,) that are not NaN, at times (N,); None where there is none."""
        keep = np.isfinite(error)
        if not keep.any():
            return None
        values, times = error[keep], t[keep]
        size = np.abs(values)
        worst = int(np.argmax(size))
        p50, p95, p99 = (float(p) for p in np.percentile(size, PERCENTILES))
        return cls(
            count=int(values.size),
            rmse=float(np.sqrt(np.mean(values * values))),
            mean=float(np.mean(values)),
            std=float(np.std(values)),
            max_abs=float(size[worst]),
            max_at=float(times[worst]),
            p50=p50,
            p95=p95,
            p99=p99,
        )
