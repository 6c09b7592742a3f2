"""Whether a filter's estimate of the gyroscope's bias is one that it was told to expect."""

from typing import Final

import numpy as np

from plumbob.data import AttitudeTrack
from plumbob.filters import Filter
from plumbob.units import to_dps

BEYOND: Final = 3.0
"""Standard deviations of the prior from which on an estimate contradicts it."""


def bias_beyond(filter_: Filter, track: AttitudeTrack) -> str | None:
    """Say in words that the last estimated bias contradicts the filter's prior, and what to do; None where not.

    Parameters
    ----------
    filter_ : Filter
        What made the track; a filter without a prior of the bias says nothing.
    track : AttitudeTrack
        Its estimate, or a part of it.
    """
    prior = filter_.bias_prior
    if prior is None or track.bias_b is None:
        return None
    name, sd = prior
    last = track.bias_b[-1]  # the first ones are those of a start in motion
    largest = float(np.max(np.abs(last), initial=0.0, where=np.isfinite(last)))
    if largest <= BEYOND * sd:
        return None
    return (
        f"the estimated gyroscope bias, {to_dps(largest):.3g} °/s, is far outside of the prior of {to_dps(sd):.3g} °/s "
        f"(1 sd) that {filter_.name} assumes: calibrate the gyroscope (plumbob calibrate gyro), or set {name}."
    )
