"""Noise of a channel from its samples: curve, sinusoids, mask, choice of a model, coefficients by three methods."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob import check
from plumbob.check import Floats
from plumbob.errors import ParameterError, UnitError
from plumbob.noise.bands import LeftOut, leave_out
from plumbob.noise.bounds import within_the_curve
from plumbob.noise.choice import Choice, choose
from plumbob.noise.curve import Curve, curve, with_noise
from plumbob.noise.findings import Analysis, Coefficient, Estimates, Mask
from plumbob.noise.least_squares import least_squares
from plumbob.noise.likelihood import Fit, departures, is_more_than, most_likely, octaves
from plumbob.noise.lines import lines
from plumbob.noise.mask import mask_first_order
from plumbob.noise.observe import with_hours
from plumbob.noise.sinusoids import find_sinusoids
from plumbob.noise.spectrum import Spectrum, spectrum
from plumbob.noise.terms import DATASHEET
from plumbob.units import Quantity

FEWEST: Final = 100
"""Samples below which not even the white noise of a record is worth a number."""

_MISFIT = 0.2  # of the density over an octave, from which on a reader is told
_SURE = 4.0  # standard deviations of it


class Averages(NamedTuple):
    """What the spectrum is taken of: samples, or means of some of them where there are too many."""

    values: Floats
    averaged: int = 1


def analyse(
    samples: ArrayLike, dt: float, *, name: str = "", quantity: Quantity = Quantity.RATIO, of: Curve | None = None
) -> Analysis:
    """Analyse the noise of one channel at rest.

    Parameters
    ----------
    samples : array_like (N,)
        Evenly spaced, finite values in the inside unit of `quantity`, `FEWEST` or more.
    dt : float
        Sampling time, s.
    name : str
        Of the channel.
    quantity : Quantity
        What the samples measure.
    of : Curve, optional
        Overlapping Allan deviation to use; by default at log-spaced averaging times.

    Raises
    ------
    ShapeError
        If samples are not finite, all equal, or have another shape.
    ParameterError
        If there are too few, or dt is not above 0.
    """
    values = check.column("samples", samples)
    if values.size < FEWEST:
        raise ParameterError(f"an analysis needs {FEWEST} samples or more, but got {values.size}; record for longer.")
    return analyse_averages(
        Averages(values),
        curve(values, dt) if of is None else of,
        mean=float(np.mean(values)),
        sd=float(np.std(values)),
        name=name,
        quantity=quantity,
    )


def analyse_averages(
    averages: Averages, of: Curve, *, mean: float, sd: float, name: str = "", quantity: Quantity = Quantity.RATIO
) -> Analysis:
    """Analyse a channel of which only the curve and averages were kept, as of a file larger than memory.

    Quantization is then taken from the curve, for averages say little about it.

    Parameters
    ----------
    averages : Averages
        Of the samples.
    of : Curve
        Overlapping Allan deviation of all samples.
    mean, sd : float
        Of all samples.
    name, quantity
        As in `analyse`.
    """
    if quantity not in DATASHEET:
        known = ", ".join(q.name.lower() for q in DATASHEET)
        raise UnitError(
            f"quantity must be one of {known}, whose noise has a data sheet's units, but it is {quantity!r}."
        )
    step = of.dt * averages.averaged
    sinusoids, left = find_sinusoids(averages.values, step, averages.averaged)
    whole = spectrum(left, of.dt, averages.averaged)
    left_out, choice = _modelled(whole, of)
    kept, mask, bands = left_out.kept, left_out.mask, left_out.bands
    by_likelihood, best, doubted = within_the_curve(kept, choice.best, of, mask, bands)
    likely = most_likely(best, by_likelihood["R"])
    if choice.smoothed is not None:  # of what was smoothed away, nothing
        by_likelihood, likely = {}, {}
    process = () if choice.markov is None else (choice.markov,)
    by_squares = least_squares(of, first=mask.n, others=(*sinusoids, *bands, *process))
    if averages.averaged > 1 and "Q" in by_squares.terms:
        by_likelihood["Q"] = by_squares.terms["Q"]
        likely["Q"] = by_squares.terms["Q"].value
    quoted = with_hours(by_likelihood, of.dt, of.count * of.dt)
    found = Analysis(
        name=name,
        quantity=quantity,
        mean=mean,
        sd=sd,
        curve=of,
        lines=lines(of, first=mask.n),
        least_squares=by_squares,
        likelihood=Estimates("likelihood", quoted),
        mask=mask,
        sinusoids=sinusoids,
        bands=bands,
        markov=choice.markov,
        candidates=choice.candidates,
        most_likely=likely,
        notes=(*doubted, *_notes(kept, choice._replace(best=best), mask, quoted)),
    )
    return with_curve(found, of)


def with_curve(analysis: Analysis, of: Curve) -> Analysis:
    """Analysis with another curve of its record, whose intervals are those of the noise that the analysis has found.

    The slope of a model says more about the noise than that of a curve, above all at the longest averaging times. Where
    averaging times are masked there is none, and the curve keeps its own.
    """
    modelled = of.n >= analysis.mask.n
    if not any(analysis.most_likely.values()) or not modelled.any():
        return replace(analysis, curve=of)
    step = 1e-3
    ahead, behind = (analysis.model(of.tau * math.exp(sign * step)) for sign in (1.0, -1.0))
    slope = np.log(ahead / behind) / step  # of the variance: twice that of the deviation, over two steps
    return replace(analysis, curve=with_noise(of, np.where(modelled, -1.0 - slope, of.alpha)))


def _modelled(whole: Spectrum, of: Curve) -> tuple[LeftOut, Choice]:
    """What is left out, what is left, and the model of it."""
    left_out = leave_out(whole, of.n)
    choice = choose(left_out.kept)
    if choice.smoothed is None:
        return left_out, choice
    mask, below = mask_first_order(left_out.whole, choice.smoothed, of.n)
    left_out = left_out._replace(mask=mask)
    return (left_out, choice) if below is None else (left_out._replace(kept=below), choose(below))


def _notes(kept: Spectrum, choice: Choice, mask: Mask, quoted: Mapping[str, Coefficient]) -> Iterator[str]:
    if mask.n == 1 and mask.reason != Mask().reason:
        yield mask.reason
    yield from choice.notes
    unseen = [letter for letter in "BK" if letter in quoted and not quoted[letter].observable]
    shown = [letter for letter, c in quoted.items() if c.observable]
    if len(unseen) == 2 and is_more_than(kept, choice.best, shown):
        yield "bias instability and random walk cannot be told apart in this record, but one of them is there"
    yield from _misfits(kept, choice.best)


def _misfits(kept: Spectrum, best: Fit) -> Iterator[str]:
    """Octaves in which the spectrum is not the model's."""
    for inside, excess, sd in departures(kept, best, octaves(kept)):
        if abs(excess) > max(_MISFIT, _SURE * sd):
            low, high = kept.frequency[inside][[0, -1]]
            yield (
                f"from {low:.2g} to {high:.2g} Hz the record has {1.0 + excess:.2g} times the noise that the terms "
                "make: a warm-up, a disturbance, or another kind of noise"
            )
