"""What the measured curve says against a coefficient that the spectrum gives: none makes more than was measured."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.noise.curve import Curve
from plumbob.noise.findings import Band, Coefficient, Mask
from plumbob.noise.interval import interval, skew_edf
from plumbob.noise.likelihood import Fit, coefficients
from plumbob.noise.spectrum import Spectrum
from plumbob.noise.terms import variance

SURE: Final = 0.9973
"""Confidence of the curve's interval whose upper end no term may exceed: three standard deviations, for it is asked at
every averaging time."""

_KNOWN: Final = 0.1  # of the record: of longer averages, nobody knows an interval that holds in so many cases
_LONGEST: Final = 0.25  # of the record; of longer averages there are less than three differences
_LEAST: Final = 2.0  # ratio of the averaging times at which a slow term is judged
_JUDGED: Final = "QBKR"
_SLOW: Final = "KR"


def within_the_curve(
    kept: Spectrum, best: Fit, of: Curve, mask: Mask, bands: Sequence[Band] = ()
) -> tuple[dict[str, Coefficient], Fit, tuple[str, ...]]:
    """Coefficients around a fit of which the curve contradicts none, the fit they are quoted from, and what to tell.

    Quantization is held to the whole curve, masked or not, for no filter of a device takes it away and leaves the
    angle; the others to what is not masked. White noise is not judged: it is what short averages show.
    """
    sure = interval(of.dev, of.edf, skew_edf(of.kind, of.alpha, of.count, of.n), SURE)[1]
    limits = {letter: _limit(letter, of, sure, mask) for letter in _JUDGED}
    told: dict[str, str] = {}
    while True:
        found, fitted = coefficients(kept, best, barred=told, bands=bands)
        shown = [letter for letter in _JUDGED if found[letter].observable]
        more = {w: why for w in shown if (why := _against(w, found, limits[w], of, mask))}
        if not more:
            return (
                {w: _limited(c, limits[w].most) if w in told else c for w, c in found.items()},
                fitted,
                (*told.values(),),
            )
        told |= more


class _Limit(NamedTuple):
    """Largest coefficient that the curve allows a term that is there alone, and the averaging time that says so, s."""

    most: float
    tau: float


def _limit(letter: str, of: Curve, sure: Floats, mask: Mask) -> _Limit:
    judged = _judged(letter, of, mask, _KNOWN)
    tau = of.tau[judged]
    allowed = sure[judged] / np.sqrt(variance(letter, 1.0, tau))
    if not allowed.size:
        return _Limit(math.inf, math.nan)
    return _Limit(float(allowed.min()), float(tau[np.argmin(allowed)]))


def _against(letter: str, found: Mapping[str, Coefficient], limit: _Limit, of: Curve, mask: Mask) -> str | None:
    """Say in words why the curve contradicts a coefficient, by its lower end; None where it does not."""
    if letter in _SLOW:
        return _leaves(letter, found, of, mask)
    if found[letter].lo <= limit.most:
        return None
    return (
        f"{letter} is not quoted: what the spectrum gives it would alone exceed the measured curve at {limit.tau:.3g} s"
    )


def _leaves(letter: str, found: Mapping[str, Coefficient], of: Curve, mask: Mask) -> str | None:
    """Say in words that the model lies above the curve's interval wherever a slow term is most of it."""
    judged = _judged(letter, of, mask, _LONGEST)
    parts = {w: variance(w, c.value, of.tau) for w, c in found.items() if c.observable}
    model = np.sum(list(parts.values()), axis=0)
    judged &= parts[letter] > 0.5 * model
    tau = of.tau[judged]
    if not tau.size or tau[-1] < _LEAST * tau[0] or (np.sqrt(model) <= of.hi)[judged].any():
        return None
    return (
        f"{letter} is not quoted: with it the model lies above the interval of the measured curve from {tau[0]:.3g} to "
        f"{tau[-1]:.3g} s"
    )


def _limited(one: Coefficient, most: float) -> Coefficient:
    """A coefficient with the limit that the curve sets it."""
    return replace(one, value=min(one.value, most), lo=0.0, hi=min(one.hi, most), upper=min(one.upper, most))


def _judged(letter: str, of: Curve, mask: Mask, longest: float) -> NDArray[np.bool_]:
    return (of.dev > 0.0) & (of.n <= longest * of.count) & ((letter == "Q") | (of.n >= mask.n))
