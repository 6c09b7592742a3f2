"""Axes that are swapped or of the wrong sign: which of the 48 ways to set up a triad a capture speaks for."""

from collections.abc import Callable
from typing import Final

import numpy as np

from plumbob.calib.refusal import Reason
from plumbob.check import Floats
from plumbob.rotations import axes_words, every_axes

CLEARLY: Final = 0.5
"""Misses over those of the declared axes below which other axes are the right ones."""


def swapped(miss: Callable[[Floats], float]) -> list[Reason]:
    """Reason to refuse a gyroscope that fits the accelerometer with other axes than the declared ones.

    Parameters
    ----------
    miss : callable
        Typical miss of a matrix (3, 3) from rates to those about the accelerometer's axes.
    """
    ways = every_axes()
    misses = np.array([miss(way) for way in ways])
    best = int(np.argmin(misses))
    if not misses[best] < CLEARLY * misses[0]:  # the first is the identity
        return []
    text = (
        f"Gyroscope and accelerometer have different axes: gravity follows the rates taken as {axes_words(ways[best])} "
        "instead of x, y, z."
    )
    return [Reason("implausible", text, "Check axes and signs of both triads in the profile.")]
