"""The noise card: densities of one unit's noise."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError
from plumbob.data.cards.file import Card, finite, require_part, require_text
from plumbob.data.sample import UNITS


@dataclass(frozen=True, eq=False)
class TriadNoise:
    """Noise of one triad, per axis, as root power spectral densities in inside units (IEEE Std 952 letters)."""

    # n_rpsd, b, k_rpsd: (3,), white noise N, rad/s/√Hz, m/s²/√Hz or µT/√Hz; bias instability B, in the unit of the
    # triad; random walk of the bias K, unit/s/√Hz
    n_rpsd: Floats
    b: Floats
    k_rpsd: Floats
    # (2, 3), ends of their intervals of 68.3 %, where a record was long enough to tell; None in a data sheet
    n_interval: Floats | None = None
    b_interval: Floats | None = None
    k_interval: Floats | None = None

    def __post_init__(self) -> None:
        """Validate the numbers."""
        for name in ("n_rpsd", "b", "k_rpsd"):
            value = check.floats(name, getattr(self, name))
            if value.shape != (3,) or not (np.isfinite(value) & (value >= 0.0)).all():
                raise CalibrationError(f"{name} must be three finite numbers ≥ 0, but it is {value.tolist()}.")
            object.__setattr__(self, name, check.read_only(value))
        for name in ("n_interval", "b_interval", "k_interval"):
            if getattr(self, name) is not None:
                ends = finite(name, getattr(self, name), (2, 3))
                if not (ends[0] >= 0.0).all() or not (ends[0] <= ends[1]).all():
                    raise CalibrationError(f"{name} must be lower and upper limits ≥ 0, but it is {ends.tolist()}.")
                object.__setattr__(self, name, ends)

    @property
    def n_rms(self) -> float:
        """White noise N as one number: the quadratic mean of the axes."""
        return math.sqrt(float(np.mean(self.n_rpsd**2)))

    @property
    def k_rms(self) -> float:
        """Random walk K as one number: the quadratic mean of the axes."""
        return math.sqrt(float(np.mean(self.k_rpsd**2)))


@dataclass(frozen=True, eq=False, repr=False)
class NoiseCard(Card):
    """Noise of one unit: feeds the simulator and the Kalman filters.

    Parameters
    ----------
    device : str
        The unit or type that it describes.
    source : str
        Data sheet, or recording and method.
    gyr, acc, mag : TriadNoise or None
        One for each triad that is known.
    """

    KIND: ClassVar = "plumbob noise card"
    VERSION: ClassVar = 1
    PARTS: ClassVar = dict.fromkeys(UNITS, TriadNoise)

    device: str
    source: str
    gyr: TriadNoise | None = None
    acc: TriadNoise | None = None
    mag: TriadNoise | None = None

    def __post_init__(self) -> None:
        """Validate the names and the kind of each triad."""
        require_text(device=self.device, source=self.source)
        for name in UNITS:
            require_part(name, getattr(self, name), TriadNoise)
