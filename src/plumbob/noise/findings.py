"""What an analysis finds: coefficients with intervals and verdicts, further terms, the mask, and all of it together."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core.check import Floats
from plumbob.core.findings import Note
from plumbob.core.units import Quantity
from plumbob.noise.curve import Curve
from plumbob.noise.terms import allan_transfer, variance


@dataclass(frozen=True, slots=True)
class Coefficient:
    """One coefficient in inside units, with its interval of 68.3 %.

    Attributes
    ----------
    value : float
        The estimate, ≥ 0; 0 where nothing of the term was found.
    lo, hi : float
        Ends of the interval; NaN where the method gives none.
    upper : float
        Limit that the truth exceeds with a probability of 5 %; NaN where the method gives none.
    observable : bool
        Whether this record shows the term: its value stands clear of zero.
    hours : float or None
        Where it does not: how long a record would have to be to show a term half as large as `upper`. None where it
        does, and where no length up to a year would.
    """

    value: float
    lo: float = math.nan
    hi: float = math.nan
    upper: float = math.nan
    observable: bool = True
    hours: float | None = None


@dataclass(frozen=True, slots=True)
class Estimates:
    """Coefficients by one method.

    Attributes
    ----------
    method : {"lines", "least squares", "likelihood"}
        How they were found.
    terms : mapping of str to Coefficient
        By letter; a letter is missing where the method does not give it.
    """

    method: str
    terms: Mapping[str, Coefficient]


@dataclass(frozen=True, slots=True)
class Sinusoid:
    """A line in the spectrum: amplitude in the unit of the samples and frequency, Hz, each with its standard deviation.

    Sampled at Δt = `dt`, its Allan variance is ``amplitude² sin⁴(πfτ) / (n sin(πfΔt))²``, n = τ/Δt; far below the
    sampling rate that is the standard's ``… / (πfτ)²`` [IEEE952].
    """

    amplitude: float
    amplitude_sd: float
    frequency: float
    frequency_sd: float
    dt: float

    def variance(self, tau: ArrayLike) -> Floats:
        """Allan variance at the averaging times tau, s."""
        time = np.asarray(tau, dtype=np.float64)
        wave = math.pi * self.frequency
        return np.asarray(
            # departs from [IEEE952] Annex C: as it is sampled
            (self.amplitude * np.sin(wave * time) ** 2 * self.dt / (time * math.sin(wave * self.dt))) ** 2
        )


@dataclass(frozen=True, slots=True)
class Band:
    """A narrow band of motion or interference, which no fit used: limits, Hz, and power as a standard deviation.

    Attributes
    ----------
    low, high : float
        Where it ends, Hz.
    sd : float
        Root of the power that it has above the noise, in the unit of the samples.
    places : tuple of float
        Frequencies between which equal shares of its power lie, Hz.
    dt : float
        Sampling time, s.
    """

    low: float
    high: float
    sd: float
    places: tuple[float, ...]
    dt: float

    @property
    def middle(self) -> float:
        """Frequency below which half of its power lies, Hz."""
        return float(np.median(self.places))

    def skirt(self, frequency: Floats) -> Floats:
        """Two-sided density of a resonance of its power, middle and width at some frequencies, Hz: what may lie beyond.

        ``sd² · 2/(Qω₀) · ω₀⁴ / ((ω₀² − ω²)² + (ω₀ω/Q)²)``, whose quartiles are ω₀/Q apart.
        """
        low, high = np.quantile(self.places, [0.25, 0.75])
        turn, quality = 2.0 * math.pi * self.middle, self.middle / float(max(high - low, 1e-6 * self.middle))
        ratio = (2.0 * math.pi * frequency / turn) ** 2
        return np.asarray(2.0 * self.sd**2 / (quality * turn) / ((1.0 - ratio) ** 2 + ratio / quality**2))

    def variance(self, tau: ArrayLike) -> Floats:
        """Allan variance at the averaging times tau, s."""
        time = np.asarray(tau, dtype=np.float64)
        weights = allan_transfer(np.ravel(time) / self.dt, self.places, self.dt)
        return np.asarray(0.5 * self.sd**2 * np.mean(weights, axis=1).reshape(time.shape))


@dataclass(frozen=True, slots=True)
class GaussMarkov:
    """First-order Gauss–Markov process: standard deviation in the unit of the samples, correlation time in s.

    The coefficients carry their intervals as `Coefficient` does.
    """

    sd: Coefficient
    time: Coefficient

    def variance(self, tau: ArrayLike) -> Floats:
        """Allan variance at the averaging times tau, s: exact for sampled averages of the continuous process."""
        x = np.asarray(tau, dtype=np.float64) / self.time.value
        small = np.minimum(x, 1e-2)  # below, the closed form loses its digits to a difference; the series has them
        series = 2.0 * small / 3.0 - 0.5 * small**2 + 7.0 * small**3 / 30.0
        big = np.maximum(x, 1e-2)
        closed = (2.0 * big - 3.0 + 4.0 * np.exp(-big) - np.exp(-2.0 * big)) / big**2
        return np.asarray(self.sd.value**2 * np.where(x < 1e-2, series, closed))


@dataclass(frozen=True, slots=True)
class Mask:
    """Short averaging times that no fit used, because the device filters its output (or folds noise into it).

    Attributes
    ----------
    n : int
        Smallest averaging factor that is used; 1 where nothing is masked.
    frequency : float or None
        Above it the spectrum departs from what noise of the five terms can be, Hz; None where nothing is masked.
    reason : str
        In words.
    """

    n: int = 1
    frequency: float | None = None
    reason: str = "nothing masked"


@dataclass(frozen=True, slots=True)
class Candidate:
    """A model that was weighed: its terms, its criterion (the smallest wins), and whether it was chosen."""

    terms: str
    bic: float
    chosen: bool


class Deviation(NamedTuple):
    """Deviation of one channel, without any coefficients: its name, what its samples measure, and the curve."""

    name: str
    quantity: Quantity
    curve: Curve


@dataclass(frozen=True, eq=False)
class Analysis:
    """Noise of one channel.

    Attributes
    ----------
    name : str
        Of the channel, such as "gyr x".
    quantity : Quantity
        What its samples measure: RATE, ACCELERATION, FIELD, or RATIO for plain numbers.
    mean, sd : float
        Of the samples, in their inside unit.
    curve : Curve
        Overlapping Allan deviation.
    lines, least_squares, likelihood : Estimates
        The five coefficients by fixed-slope lines, by edf-weighted non-negative least squares, and by likelihood.
    mask : Mask
        What the fits left out.
    sinusoids : tuple of Sinusoid
        Lines of the spectrum, strongest first.
    bands : tuple of Band
        Narrow bands that were left out, strongest first.
    markov : GaussMarkov or None
        Where the model with it is the better one.
    candidates : tuple of Candidate
        Models that were weighed.
    most_likely : mapping of str to float
        Values of the five terms that together are the most likely, observable or not (a ramp only if it is): what the
        model is made of.
    step : float
        The values are multiples of this step, in the unit of the samples; 0 where no step was found.
    notes : tuple of str
        What a reader must know before he believes a number.
    """

    name: str
    quantity: Quantity
    mean: float
    sd: float
    curve: Curve
    lines: Estimates
    least_squares: Estimates
    likelihood: Estimates
    mask: Mask = field(default_factory=Mask)
    sinusoids: tuple[Sinusoid, ...] = ()
    bands: tuple[Band, ...] = ()
    markov: GaussMarkov | None = None
    candidates: tuple[Candidate, ...] = ()
    most_likely: Mapping[str, float] = field(default_factory=dict)
    step: float = 0.0
    notes: tuple[Note, ...] = ()

    @property
    def terms(self) -> Mapping[str, Coefficient]:
        """The coefficients to quote: those of the likelihood."""
        return self.likelihood.terms

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.curve.count * self.curve.dt

    def model(self, tau: ArrayLike) -> Floats:
        """Allan deviation of the most likely terms, sinusoids, bands and process together, at averaging times tau, s.

        Also of terms that are not observable: of two that cannot be separated, one is there.
        """
        terms = (variance(letter, value, tau) for letter, value in self.most_likely.items())
        total = sum(terms, np.zeros(np.shape(tau)))
        total = sum((sinusoid.variance(tau) for sinusoid in self.sinusoids), total)
        total = sum((band.variance(tau) for band in self.bands), total)
        if self.markov is not None:
            total = total + self.markov.variance(tau)
        return np.asarray(np.sqrt(total))
