"""An oscillation so strong that nearly nothing else changes: a unit that is shaken, not one at rest."""

import math
from typing import Final, NamedTuple

import numpy as np

from plumbob.check import Floats

SHARE: Final = 0.9
"""Part of the energy of all changes that a single line must hold. Of 200 equal lines, the largest five hold a tenth."""
LINES: Final = 200
"""Spectra of fewer lines are not judged."""

_LOBE: Final = 3
_SLOWEST: Final = 10


class Oscillation(NamedTuple):
    """Frequency, Hz, and amplitude, in the unit of the samples."""

    frequency: float
    amplitude: float


def shaking(values: Floats, dt: float) -> Oscillation | None:
    """Oscillation that makes up nearly all the change between averages of some length, or None.

    Differences of averages whiten a random walk and take out a ramp, so no noise of a sensor has a line there.

    Parameters
    ----------
    values : ndarray (N,)
        Samples.
    dt : float
        Sampling time, s.
    """
    averages, n = values, 1
    while averages.size >= 2 * LINES:
        x, power = _line(np.diff(averages))
        if power > 0.0:
            averaging = math.sin(math.pi * x) / (n * math.sin(math.pi * x / n))
            difference = 2.0 * math.sin(math.pi * x)
            return Oscillation(x / (n * dt), math.sqrt(2.0 * power) / abs(averaging * difference))
        averages, n = averages[: averages.size // 2 * 2].reshape(-1, 2).mean(axis=1), 2 * n
    return None


def _line(changes: Floats) -> tuple[float, float]:
    """Frequency, in samples⁻¹, and mean square of the line that holds nearly everything, else 0."""
    centred = changes - changes.mean()
    spectrum = np.abs(np.fft.rfft(centred * np.hanning(changes.size))) ** 2
    peak = int(np.argmax(spectrum))
    inside = float(spectrum[max(0, peak - _LOBE) : peak + _LOBE + 1].sum())
    holds = peak >= _SLOWEST and inside > SHARE * spectrum.sum()
    return peak / changes.size, float(np.mean(centred * centred)) if holds else 0.0
