"""A random sea of long-crested wave trains in deep water, at one place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.simulation.signals import Sinusoids

Phasors = NDArray[np.complex128]

TRAINS = 64
"""Number of wave trains; one in each band of 0.05 peak frequencies, at random in it: their sum has no period."""

_BAND = (0.6, 4.0)  # peak frequencies: below lies 1e-4 of the energy, above waves shorter than a buoy's response


@dataclass(frozen=True, eq=False)
class Sea:
    """Wave trains ``η = Re Σ phasor[i] exp(j omega[i] t)``.

    Attributes
    ----------
    omega : ndarray (m,)
        Angular frequencies, rad/s.
    phasor : ndarray (m,) of complex
        Amplitude and phase of the surface's height, m.
    direction : ndarray (m,)
        Where each train travels to, rad from North over East.
    """

    omega: Floats
    phasor: Phasors
    direction: Floats

    @property
    def elevation(self) -> Sinusoids:
        """Height of the surface over its mean, m."""
        return Sinusoids.from_phasors(self.omega, self.phasor)

    @property
    def displacement_ned(self) -> Phasors:
        """Phasors (m, 3) of a water particle's way north, east and down, m: circles, forward on the crest."""
        forward = -1j * self.phasor
        return np.stack((forward * np.cos(self.direction), forward * np.sin(self.direction), -self.phasor), axis=-1)

    @property
    def slope_ne(self) -> Phasors:
        """Phasors (m, 2) of the surface's slope to the north and to the east, rad."""
        wavenumber = self.omega**2 / G0  # deep water
        steepness = -1j * wavenumber * self.phasor
        return np.stack((steepness * np.cos(self.direction), steepness * np.sin(self.direction)), axis=-1)


def jonswap(frequency: Floats, *, peak: float, peakedness: float) -> Floats:
    """Shape of the JONSWAP spectrum [Hasselmann1973], not scaled; peakedness 1 is Pierson and Moskowitz's.

    Parameters
    ----------
    frequency : ndarray (m,)
        Hz.
    peak : float
        Frequency of the peak, Hz.
    peakedness : float
        γ.
    """
    f = frequency / peak
    width = np.where(f < 1.0, 0.07, 0.09)
    # [Hasselmann1973]
    return np.asarray(f**-5 * np.exp(-1.25 * f**-4) * peakedness ** np.exp(-((f - 1.0) ** 2) / (2.0 * width**2)))


def draw_sea(
    *, height: float, period: float, peakedness: float, direction: float, spread: float, rng: np.random.Generator
) -> Sea:
    """Draw wave trains of a spectrum: one in each band, at a random frequency, phase and direction.

    Parameters
    ----------
    height : float
        Significant height Hs, four times the standard deviation of the elevation, m.
    period : float
        Of the spectrum's peak, s.
    peakedness : float
        γ of `jonswap`.
    direction : float
        Mean direction that the waves travel to, rad from North over East.
    spread : float
        Standard deviation of the trains' directions, rad.
    rng : Generator
        Source of chance.
    """
    edges = np.linspace(*_BAND, TRAINS + 1) / period
    chance, phase, turn = rng.random(TRAINS), 2.0 * np.pi * rng.random(TRAINS), rng.standard_normal(TRAINS)
    frequency = edges[:-1] + chance * np.diff(edges)
    amplitude = np.sqrt(jonswap(frequency, peak=1.0 / period, peakedness=peakedness))
    amplitude *= height / 4.0 / np.sqrt(0.5 * np.sum(amplitude**2))
    return Sea(2.0 * np.pi * frequency, amplitude * np.exp(-1j * phase), direction + spread * turn)


def oscillator(omega: Floats, *, period: float, damping: float) -> Phasors:
    """Response (m,) of a damped oscillator of that natural period, s, to a forcing; 1 where it follows, period 0."""
    ratio = omega * period / (2.0 * np.pi)
    return np.asarray(1.0 / (1.0 - ratio**2 + 2j * damping * ratio))
