"""Sizes of the vectors of a capture before and after: what a norm that should be constant scatters by."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calib.fitted import Fitted
from plumbob.check import Floats


class Sizes(NamedTuple):
    """Sizes of what was measured, and of what became of it.

    Attributes
    ----------
    before, after : ndarray (N,)
        Of each sample, unit of the triad.
    expected : float
        What they should be: the reference, or the mean of those after where none is known.
    used : ndarray (N,) of bool
        Those that were fitted.
    """

    before: Floats
    after: Floats
    expected: float
    used: NDArray[np.bool_]

    def rms(self) -> tuple[float, float]:
        """Root mean square by which used samples miss what they should be, before and after."""
        before, after = (
            float(np.sqrt(np.mean((v[self.used] - self.expected) ** 2))) for v in (self.before, self.after)
        )
        return before, after


def sizes(name: str, fit: Fitted) -> Sizes | None:
    """Sizes of what a fit was made of; None for a gyroscope, whose rates have no size that is known."""
    if name == "gyr" or not fit.used.any():
        return None
    model = fit.calibration
    after = np.linalg.norm((fit.measured - model.bias) @ model.matrix.T, axis=1)
    expected = float(after[fit.used].mean()) if model.reference is None else model.reference
    return Sizes(np.linalg.norm(fit.measured, axis=1), after, expected, fit.used)
