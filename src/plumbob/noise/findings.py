"""What an analysis finds: coefficients with intervals, further terms, the mask; and all of it as numbers for JSON."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.findings import Note, as_json
from plumbob.core.result import plain
from plumbob.core.text import measured, number, places, rounded
from plumbob.core.units import Quantity, from_si, unit
from plumbob.noise.curve import Curve
from plumbob.noise.terms import DATASHEET, DEVIATION, TERMS, allan_transfer, variance

AXES: Final = ("x", "y", "z")

TRUSTED = 2.0  # degrees of freedom below which a deviation scatters by more than half of itself: pictures fade it


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
    """Coefficients by one method."""

    method: str  # "lines", "least squares" or "likelihood"
    terms: Mapping[str, Coefficient]  # by letter; one is missing where the method does not give it


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
    """A narrow band of motion or interference, which no fit used: limits, Hz, and power as a standard deviation."""

    # low, high: where it ends, Hz
    low: float
    high: float
    sd: float  # root of the power that it has above the noise, in the unit of the samples
    places: tuple[float, ...]  # frequencies between which equal shares of its power lie, Hz
    dt: float  # sampling time, s

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
    """First-order Gauss–Markov process: standard deviation in the unit of the samples, correlation time in s."""

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
    """Short averaging times that no fit used, because the device filters its output (or folds noise into it)."""

    n: int = 1  # smallest averaging factor that is used; 1 where nothing is masked
    # above it the spectrum departs from what noise of the five terms can be, Hz; None where nothing is masked
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

    def summary(self) -> dict[str, Any]:
        """The curve, as `numbers` has it."""
        return {"quantity": self.quantity.name.lower(), **numbers_of_curve(self.curve, DEVIATION[self.quantity])}


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


class Lowest(NamedTuple):
    """Least deviation with its interval, at the averaging time tau, s; `risen` shows whether a later one is higher."""

    tau: float
    dev: float
    lo: float
    hi: float
    risen: bool


class Point(NamedTuple):
    """Where a coefficient is read off: averaging time, s, and deviation there."""

    letter: str
    tau: float
    dev: float


def trusted(curve: Curve) -> NDArray[np.bool_]:
    """Points (m,) with enough degrees of freedom to be believed."""
    return np.asarray(curve.edf >= TRUSTED)


def lowest(analysis: Analysis) -> Lowest | None:
    """Deviation whose interval ends lowest, so that scatter at the end of a record is not taken for a minimum.

    Of the whole curve, masked or not: it is what was measured. None where no point has a finite interval.
    """
    curve = analysis.curve
    use = np.flatnonzero(np.isfinite(curve.hi))
    if not use.size:
        return None
    i = int(use[np.argmin(curve.hi[use])])
    tau, dev, lo, hi = (float(a[i]) for a in (curve.tau, curve.dev, curve.lo, curve.hi))
    return Lowest(tau, dev, lo, hi, risen=bool(np.any(curve.lo[i:] > hi)))


def points(analysis: Analysis) -> list[Point]:
    """Where the observable coefficients are read off their lines; B at the least deviation, where there is one."""
    least = lowest(analysis)
    readings = []
    for letter, c in shown(analysis).items():
        tau = TERMS[letter].read_at or (least and least.tau)
        if tau is not None:
            readings.append(Point(letter, tau, math.sqrt(float(variance(letter, c.value, tau)))))
    return readings


def shown(analysis: Analysis) -> dict[str, Coefficient]:
    """Coefficients that this record shows, by letter."""
    return {letter: c for letter, c in analysis.terms.items() if c.observable and c.value > 0.0}


class Triad(NamedTuple):
    """Channels of one sensor."""

    name: str  # what their names share, such as "gyr"; the whole name of a channel that stands alone
    channels: Mapping[str, Analysis]  # by axis; the axis is empty for a channel that stands alone

    @property
    def first(self) -> Analysis:
        """The first of its channels."""
        return next(iter(self.channels.values()))


def triads(analyses: Sequence[Analysis]) -> list[Triad]:
    """Sort channels into triads by their names: "gyr x", "gyr y" and "gyr z" are axes of "gyr"."""
    if not analyses:
        raise ShapeError("a report needs at least one analysis, but analyses is empty.")
    by_name: dict[str, dict[str, Analysis]] = {}
    for analysis in analyses:
        head, _, last = analysis.name.rpartition(" ")
        name, axis = (head, last) if head and last in AXES else (analysis.name, "")
        channels = by_name.setdefault(name, {})
        if axis in channels:
            raise ShapeError(f"two analyses are named '{analysis.name}'; give each channel a name of its own.")
        channels[axis] = analysis
    for name, channels in by_name.items():
        measured = {analysis.quantity for analysis in channels.values()}
        if len(measured) > 1:
            raise ShapeError(
                f"the axes of '{name}' measure {', '.join(sorted(measured))}; a triad measures one quantity."
            )
    return [Triad(name, channels) for name, channels in by_name.items()]


def coefficient(c: Coefficient | None, unit: str) -> str:
    """Cell of a table: the value with its uncertainty, or the limit below which it lies; a dash where there is none."""
    if c is None:
        return "-"
    value, lo, hi, upper = (from_si(v, unit) for v in (c.value, c.lo, c.hi, c.upper))
    if c.observable:
        return measured(value, lo, hi)
    return f"< {number(upper, 2)}" if math.isfinite(upper) else "not observable"


def length(seconds: float) -> str:
    """Length of time with two digits."""
    unit, size = next(pair for pair in (("h", 3600.0), ("min", 60.0), ("s", 0.0)) if seconds >= 2.0 * pair[1])
    value = seconds / (size or 1.0)
    return f"{rounded(value, places(value))} {unit}" if value > 0.0 else "0 s"


def numbers(analyses: Sequence[Analysis]) -> dict[str, Any]:
    """Everything that was found, strictly valid for JSON, by name of the channel.

    A number with a unit is a dictionary of unit and value: the unit inside first, then that of a data sheet, as in
    ``{"rad/s/rtHz": 8.7e-5, "deg/rth": 0.3}``. What is not known is None.
    """
    return dict(plain({a.name: _channel_numbers(a) for triad in triads(analyses) for a in triad.channels.values()}))


def _channel_numbers(a: Analysis) -> dict[str, Any]:
    sample, least = DEVIATION[a.quantity], lowest(a)
    return {
        "quantity": a.quantity.name.lower(),
        "duration_s": a.duration,
        "samples": a.curve.count,
        "dt_s": a.curve.dt,
        **_with_units(a, sample, "mean", "sd", "step"),
        "coefficients": _estimates(a.likelihood, a.quantity),
        "methods": {e.method: _estimates(e, a.quantity) for e in (a.lines, a.least_squares, a.likelihood)},
        "minimum": least
        and {"tau_s": least.tau, **_with_units(least, sample, "dev", "lo", "hi"), "risen": least.risen},
        "sinusoids": [
            {
                **_with_units(s, sample, "amplitude", "amplitude_sd"),
                "frequency_hz": s.frequency,
                "frequency_sd_hz": s.frequency_sd,
            }
            for s in a.sinusoids
        ],
        "bands": [
            {**_with_units(b, sample, "sd"), "low_hz": b.low, "high_hz": b.high, "middle_hz": b.middle} for b in a.bands
        ],
        "gauss_markov": a.markov
        and {"sd": _coefficient(a.markov.sd, sample), "time": _coefficient(a.markov.time, "s")},
        "mask": {"n": a.mask.n, "frequency_hz": a.mask.frequency, "reason": a.mask.reason},
        "candidates": [{"terms": c.terms, "bic": c.bic, "chosen": c.chosen} for c in a.candidates],
        "notes": as_json(a.notes),
        "curve": numbers_of_curve(a.curve, sample),
    }


def _estimates(estimates: Estimates, quantity: Quantity) -> dict[str, Any]:
    return {
        letter: {"name": TERMS[letter].name, **_coefficient(c, DATASHEET[quantity][letter])}
        for letter, c in estimates.terms.items()
    }


def _coefficient(c: Coefficient, name: str) -> dict[str, Any]:
    return {**_with_units(c, name, "value", "lo", "hi", "upper"), "observable": c.observable, "hours": c.hours}


def numbers_of_curve(curve: Curve, sample: str) -> dict[str, Any]:
    """A curve, its deviations in the unit inside and in `sample`."""
    return dict(plain({
        "kind": curve.kind, "confidence": curve.confidence, "n": curve.n, "tau_s": curve.tau,
        **_with_units(curve, sample, "dev", "lo", "hi"),
        "alpha": curve.alpha, "edf": curve.edf, "ieee952_relative_error": curve.ieee,
    }))  # fmt: skip


def _with_units(source: Any, name: str, *keys: str) -> dict[str, dict[str, Any]]:
    """Numbers in the unit inside and in that of a data sheet."""
    return {key: {u: from_si(getattr(source, key), u) for u in (unit(name).quantity.value, name)} for key in keys}


def length_and_rate(triad: Triad) -> str:
    """Length and rate of the record."""
    first = triad.first
    return f"{length(first.duration)} at {1.0 / first.curve.dt:.6g} Hz, {first.curve.count} samples"
