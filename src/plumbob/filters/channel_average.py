"""Moving average of one rate channel: the control that every cleverer filter of a channel has to beat.

It is the mean of the last n good samples, of fewer while there are not yet so many. White noise falls to 1/n in
variance, and a ramp comes late by (n − 1) / 2 samples. It counts samples and not seconds: a missing one holds the
result, and nothing else.

When to choose it: as a control. `same_noise` gives the n that smooths as much as a Kalman filter of gain K.

=========  ============  =======  =========================================================
symbol     name          unit     meaning
=========  ============  =======  =========================================================
n          samples       1        length of the window
–          x[RATE]       rad/s    mean over the window
–          x[FILLED]     1        samples in the window
–          x[NEXT]       1        place of the next sample in it
–          x[SUM]        rad/s    sum over the window
–          x[FRESH]      rad/s    sum over the places from 0 to NEXT
–          x[RING] …     rad/s    the window
=========  ============  =======  =========================================================
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity
from plumbob.filters.channel_scalar import require_gain
from plumbob.filters.layout import OWN, RATE

SUMMARY: Final = "moving average of each rate, the control of the same bandwidth"
REFERENCES: Final = ("Chen2013",)
NEEDS: Final = ("gyr",)

LENGTH: Final = 0

FILLED: Final = OWN
NEXT: Final = OWN + 1
SUM: Final = OWN + 2
FRESH: Final = OWN + 3
RING: Final = OWN + 4


class Params(NamedTuple):
    """Length of the window."""

    samples: Annotated[float, Spec(Quantity.RATIO, "samples in the window, a whole number", 1, 1e6)] = 20.0


def coefficients(params: Params) -> tuple[float, ...]:
    """Coefficients of the kernel."""
    return (params.samples,)


def own_state(params: Params) -> int:
    """How many own numbers evolve.

    Raises ParameterError if the window is not a whole number of samples.
    """
    if params.samples != math.floor(params.samples):
        raise ParameterError(f"moving_average: samples must be a whole number, but it is {params.samples:g}.")
    return RING - OWN + int(params.samples)


@kernel
def step(c: Floats, x: Floats, dt: float, y: float) -> None:
    """Take one sample; a missing one holds the mean."""
    if math.isnan(y):
        return
    place = int(x[NEXT])
    x[SUM] += y - x[RING + place]
    x[FRESH] += y
    x[RING + place] = y
    x[FILLED] = min(x[FILLED] + 1.0, c[LENGTH])
    x[NEXT] += 1.0
    if x[NEXT] == c[LENGTH]:  # the window has just been summed anew: forget what rounding left in the running sum
        x[SUM], x[FRESH], x[NEXT] = x[FRESH], 0.0, 0.0
    x[RATE] = x[SUM] / x[FILLED]


def same_noise(gain: float) -> int:
    """Window that leaves as much white noise as a scalar Kalman filter of that gain: 1/n = K / (2 − K), rounded."""
    require_gain(gain)
    return round((2.0 - gain) / gain)
