"""Before and after: what a filter or a compensation did to the noise, at equal averaging times.

A filter bends the curve at short averaging times. A slope that is read off the bent part belongs to no noise: lines on
a filtered record give coefficients that are wrong by any factor. What can be compared are the deviations themselves,
each at the same τ and with its interval, and the filter's time constant: far beyond it a filter changes nothing.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.findings import Finding, Note, as_json, info, warning
from plumbob.core.result import plain
from plumbob.noise.curve import Curve, curve
from plumbob.noise.findings import Analysis
from plumbob.noise.spectrum import Spectrum, spectrum
from plumbob.noise.terms import FAR, TERMS

_SAME = 0.05  # of the power: what is no filter
_LOWEST = 64  # coefficients whose power no filter that can be recognised has changed
_CHANCE = 0.05  # probability that a difference is named where there is none
_LIMIT = 1.645  # standard deviations of a normal distribution below its limit of 95 %
_FITS = 0.1  # rms of ln(power) up to which a ratio of spectra is that of a filter of first order


@dataclass(frozen=True, eq=False)
class DeviationComparison:
    """Deviations of two records at equal averaging times.

    Attributes
    ----------
    before, after : Curve
        Overlapping Allan deviations.
    ratio, lo, hi : ndarray (m,)
        After over before, and its interval of 68.3 % as if the records were independent (F distribution); two
        versions of one record scatter less.
    time_constant : float or None
        Of the filter of first order that makes the one of the other, s; None where there is none such.
    corner : float or None
        Frequency at which the power of the ratio of spectra has fallen to half, Hz; None where it does not.
    bent_below : float or None
        Averaging time up to which that filter bends the curve, s: `FAR` time constants.
    notes : tuple of Finding
        What the comparison says, and what must not be read from it.
    """

    before: Curve
    after: Curve
    ratio: Floats
    lo: Floats
    hi: Floats
    time_constant: float | None
    corner: float | None
    bent_below: float | None
    notes: tuple[Note, ...]

    @property
    def tau(self) -> Floats:
        """Averaging times, s."""
        return self.before.tau

    @property
    def is_filter(self) -> bool:
        """Whether a filter alone makes the one of the other; two sensors can have spectra that only look so."""
        return self.bent_below is not None and not any(
            isinstance(note, Finding) and note.code == "noise.changed_beyond" for note in self.notes
        )

    def summary(self) -> dict[str, Any]:
        """Averaging times, ratio, time constant and notes, strictly valid for JSON."""
        return dict(plain({
            "tau_s": self.tau, "ratio": self.ratio, "ratio_lo": self.lo, "ratio_hi": self.hi,
            "time_constant_s": self.time_constant, "corner_hz": self.corner, "bent_below_s": self.bent_below,
            "notes": as_json(self.notes),
        }))  # fmt: skip


def compare(
    before: ArrayLike, after: ArrayLike, dt: float, *, n: NDArray[np.int64] | None = None
) -> DeviationComparison:
    """Compare two records of one channel, the same unit and rate.

    Parameters
    ----------
    before, after : array_like (N,)
        Samples; lengths may differ.
    dt : float
        Sampling time, s.
    n : ndarray (m,), optional
        Averaging factors; by default log-spaced ones that fit both.

    Raises
    ------
    ShapeError
        If a sample is not finite, or a record has another shape.
    ParameterError
        If either has no noise at all, or dt is not above 0.
    """
    from scipy.stats import f

    records = [check.column(name, x) for name, x in (("before", before), ("after", after))]
    for name, record in zip(("before", "after"), records, strict=True):
        if record.size < 2 or np.ptp(record) == 0.0:
            raise ParameterError(f"the record {name} is constant; there is no noise to compare.")
    shorter = min(records, key=lambda r: r.size)
    factors = curve(shorter, dt).n if n is None else n
    first, second = (curve(record, dt, factors) for record in records)
    ratio = second.dev / first.dev
    tail = 0.5 * (1.0 - first.confidence)
    lo, hi = (ratio / np.sqrt(f.ppf(p, second.edf, first.edf)) for p in (1.0 - tail, tail))
    constant, corner = _filter_between(*(spectrum(record[: shorter.size], dt) for record in records))
    bent = None if corner is None else FAR / (2.0 * math.pi * corner)
    if constant is not None:
        bent = FAR * constant
    notes = tuple(_notes(first.tau, ratio, lo, hi, constant, corner, bent))
    return DeviationComparison(first, second, ratio, lo, hi, constant, corner, bent, notes)


class Difference(NamedTuple):
    """A coefficient over that of another record, and its interval of 68.3 %; NaN where one is not observable."""

    letter: str
    ratio: float
    lo: float
    hi: float


def differences(first: Analysis, second: Analysis, *, among: int = 1) -> list[Difference]:
    """Coefficients in which a channel of another record differs from the first's by more than chance.

    Chance would make one such difference `among` all that are looked at in 5 % of all cases (Bonferroni). What is not
    observable is taken as 0 with the deviation that its limit of 95 % says.
    """
    from scipy.stats import norm

    surely, unlike = float(norm.ppf(1.0 - _CHANCE / (2.0 * among))), []
    for letter in TERMS:
        pair = [each.terms.get(letter) for each in (first, second)]
        if not all(c is not None and (c.observable or math.isfinite(c.upper)) for c in pair):
            continue
        (a, below, above), (b, under, over) = (  # values, and deviations; of one that is not observable of its limit
            (c.value, c.value - c.lo, c.hi - c.value) if c.observable else (0.0, 0.0, c.upper / _LIMIT)
            for c in pair
            if c is not None
        )
        if abs(b - a) > surely * (math.hypot(below, over) if b < a else math.hypot(above, under)):
            if a and b:
                lower, upper = math.hypot(above / a, under / b), math.hypot(below / a, over / b)
                unlike.append(Difference(letter, b / a, b / a * (1.0 - lower), b / a * (1.0 + upper)))
            else:
                unlike.append(Difference(letter, math.inf if b else 0.0, math.nan, math.nan))
    return unlike


def _filter_between(before: Spectrum, after: Spectrum) -> tuple[float | None, float | None]:
    """Time constant, s, and half-power frequency, Hz, of what lies between two spectra."""
    from scipy.optimize import minimize_scalar

    wide = before.terms >= 16.0  # narrower bins say little
    if np.count_nonzero(wide) < 8:
        return None, None
    frequency, weight = before.frequency[wide], np.sqrt(before.terms[wide])
    gain = np.log(np.maximum(after.power[wide], 1e-300) / np.maximum(before.power[wide], 1e-300))
    lowest = before.start <= _LOWEST
    level = math.log(float(after.power[lowest].sum() / before.power[lowest].sum()))
    scatter = 2.0 / math.sqrt(_LOWEST)  # of two independent records
    if float(np.mean(gain[-8:])) - level > -max(_SAME, 4.0 * scatter):
        return None, None
    below = np.flatnonzero(gain - level < -math.log(2.0))
    corner = float(frequency[below[0]]) if below.size else None
    start = level if abs(level) > _SAME else 0.0

    def misfit(log_time: float) -> float:
        residual = gain - start - _first_order(frequency, before.step, math.exp(log_time))
        return float(np.average(residual**2, weights=weight))

    ends = math.log(0.05 * before.step), math.log(0.1 * before.count * before.step)
    best = minimize_scalar(misfit, bounds=ends, method="bounded", options={"xatol": 1e-4})
    return (math.exp(best.x) if math.sqrt(best.fun) < _FITS else None), corner


def _first_order(frequency: Floats, dt: float, time: float) -> Floats:
    """Logarithm of the power that ``y += K (x − y)`` passes, with 1 − K = exp(−Δt / time)."""
    decay = math.exp(-dt / time)
    turn = np.sin(np.pi * frequency * dt)
    return np.asarray(-np.log1p(4.0 * decay * turn**2 / (1.0 - decay) ** 2))


def _notes(
    tau: Floats, ratio: Floats, lo: Floats, hi: Floats, constant: float | None, corner: float | None, bent: float | None
) -> Iterator[Note]:
    if bent is None:
        yield info("noise.no_low_pass")
        if np.median(np.abs(np.log(ratio)) / np.log(hi / lo)) > 1.0:  # twice the distance to an end of the interval
            yield info("noise.changed", factor=np.median(ratio))
        return
    if constant is not None:
        yield info("noise.first_order", constant=constant)
    else:
        yield info("noise.low_pass", corner=corner)
    yield (warning("noise.bent", bent=bent))
    far = tau >= bent
    if not far.any():
        yield warning("noise.too_short")
    elif ((lo[far] <= 1.0) & (hi[far] >= 1.0)).mean() >= 0.5:
        yield info("noise.same_beyond", ratio=np.median(ratio[far]))
    else:
        change = float(np.median(ratio[far]))
        yield warning("noise.changed_beyond", change=change)
