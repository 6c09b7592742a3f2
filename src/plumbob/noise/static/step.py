"""The step of a converter, found in the values that it gave."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from plumbob import check
from plumbob.check import Floats

REPEATS: Final = 4
"""Values come from a converter if each occurs so often on average; what is not quantised hardly repeats."""

_ROUNDING: Final = 2e-7
"""Values that differ by less than this part of the largest are equal: float32 rounds to 1.2e-7."""
_RESIDUAL: Final = 0.2
"""How far a value may lie from its multiple, in steps: a text of few digits rounds."""


def find_step(values: ArrayLike) -> float:
    """Step of which all values are whole multiples, up to an offset and rounding; 0 where there is none.

    The closest neighbours among the levels give a first guess, which a straight line through all of them makes exact:
    0.06, 0.12, 0.18, 0.24, 0.31 are multiples of 0.061 in a text of two decimals.

    Parameters
    ----------
    values : array_like (N,)
        Samples; a hundred or more, as fewer show nothing.
    """
    samples = check.column("values", values)
    levels = _levels(np.unique(samples[np.isfinite(samples)]))
    if levels.size < 2 or samples.size < REPEATS * levels.size:
        return 0.0
    rise = np.diff(levels)
    step = float(np.median(rise[rise < 1.5 * rise.min()]))
    for _ in range(2):  # the first line may have counted a wide gap wrongly
        number = np.concatenate(([0.0], np.cumsum(np.round(rise / step))))
        step = float(np.polyfit(number, levels - levels[0], 1)[0])
    residual = levels - levels[0] - step * number
    return step if np.ptp(residual) < 2.0 * _RESIDUAL * step else 0.0


def _levels(values: Floats) -> Floats:
    """Sorted values without those that differ from their neighbour by rounding only."""
    if values.size < 2:
        return values
    apart = np.diff(values) > _ROUNDING * np.max(np.abs(values))
    return values[np.concatenate(([True], apart))]
