"""Noise of a channel from its samples: curve, sinusoids, mask, choice of a model, coefficients by three methods."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from operator import attrgetter
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, UnitError
from plumbob.core.findings import Note, warning
from plumbob.core.units import Quantity
from plumbob.noise import likelihood
from plumbob.noise.bands import least_squares, leave_out, lines, mask_first_order
from plumbob.noise.curve import Curve, curves, interval, make_curve, skew_edf
from plumbob.noise.findings import Analysis, Band, Candidate, Coefficient, Estimates, GaussMarkov, Mask
from plumbob.noise.spectrum import LETTERS, Spectrum, densities, edges, find_sinusoids, ramp_coefficients, spectrum
from plumbob.noise.terms import DATASHEET, variance

BETTER: Final = 10.0  # by which the criterion of Schwarz must be smaller for a Gauss–Markov process: strong evidence
_FIVE, _SEVEN = "Q N B K R", "Q N B K R + Gauss-Markov"
_TIMES = 7  # correlation times from which the search for a Gauss–Markov process starts
_INSIDE = 4.0  # times must a process's corner lie below the highest frequency; nearer, it is the device's filter


class Choice(NamedTuple):
    """A model of a record."""

    best: likelihood.LikelihoodFit  # the fit that was chosen
    markov: GaussMarkov | None  # its Gauss–Markov process
    candidates: tuple[Candidate, ...]  # what was weighed
    notes: tuple[str, ...]  # what a reader must know of it
    # Where nothing but that process is left at high frequencies: the time constant, s, of the filter that would make it
    # of white noise. A sensor without any white noise is yet to be built.
    smoothed: float | None = None


def choose(kept: Spectrum) -> Choice:
    """Fit with or without a Gauss–Markov process, by the criterion of Schwarz [Schwarz1978]."""
    plain = likelihood.fit(kept)
    low, high = _INSIDE / (2.0 * math.pi * float(kept.frequency[-1])), 0.1 * kept.count * kept.step
    starts = np.geomspace(low, high, _TIMES) if high > low else ()
    fits = (likelihood.fit(kept, markov_time=float(t)) for t in starts)
    richer = min((f for f in fits if math.exp(f.logs[-1]) > low), key=attrgetter("deviance"), default=None)
    if richer is None:
        return Choice(plain, None, (Candidate(_FIVE, 0.0, chosen=True),), ())
    worse = richer.deviance + 2.0 * math.log(float(kept.terms.sum())) - plain.deviance  # [Schwarz1978]
    taken = worse < -BETTER
    markov = GaussMarkov(*likelihood.markov_coefficients(kept, richer)) if taken else None
    least = min(worse, 0.0)
    candidates = Candidate(_FIVE, -least, not taken), Candidate(_SEVEN, worse - least, taken)
    notes: tuple[str, ...] = ()
    if abs(worse) <= BETTER:
        notes = (
            f"a Gauss-Markov process with a correlation time of about {math.exp(richer.logs[-1]):.2g} s would explain "
            "the record as well as bias instability does; it cannot show which",
        )
    if not taken:
        return Choice(plain, None, candidates, notes)
    others = float(richer.squares @ densities(kept)[:, -1])  # at the highest frequencies, beside the process
    smoothed = math.exp(richer.logs[-1]) if others < 0.5 * float(richer.density[-1]) else None
    return Choice(richer, markov, candidates, notes, smoothed)


SHOWN: Final = 3.0  # a record shows a term when the coefficient is so many of its standard deviations
LONGEST: Final = 10_000.0  # hours beyond which no length is named: more than a year
_RAMP = 64  # coefficients in which all is that is known about a ramp, but for 1e-4
_STEPS = np.arange(0.0, 40.0)  # of √2 in length


def hours_needed(letter: str, terms: Mapping[str, Coefficient], dt: float, duration: float) -> float | None:
    """Length of a record, h, that shows half of a term's limit; None where `duration`, s, is enough, or no year is."""
    coefficient = terms[letter]
    size = 0.5 * coefficient.upper
    if coefficient.observable or not size > 0.0:
        return None
    squares = np.array([terms[k].value ** 2 if terms[k].observable else 0.0 for k in LETTERS])
    if letter != "R":
        squares[LETTERS.index(letter)] = size**2
    if not squares.any():
        return None
    for length in duration * math.sqrt(2.0) ** _STEPS[1:]:
        if length > 3600.0 * LONGEST:
            return None
        if size >= SHOWN * _sd(letter, squares, dt, length):
            return float(length / 3600.0)
    return None


def _sd(letter: str, squares: Floats, dt: float, duration: float) -> float:
    """Standard deviation of a coefficient that a record of this length will have."""
    count = max(round(duration / dt), 2)
    thought, rows = _imagined(count, dt)
    parts = squares[:, np.newaxis] * rows
    density = np.sum(parts, axis=0)
    if letter == "R":
        return float(1.0 / math.sqrt(np.sum(thought.ramp / density)))
    there = np.flatnonzero(squares)
    relative = 2.0 * parts[there] / density
    information = 0.5 * (relative * thought.terms) @ relative.T
    k = int(np.flatnonzero(there == LETTERS.index(letter))[0])
    inverse = np.linalg.pinv(information, hermitian=True)
    return float(math.sqrt(squares[there[k]] * max(inverse[k, k], 0.0)))


@lru_cache(maxsize=_STEPS.size)
def _imagined(count: int, dt: float) -> tuple[Spectrum, Floats]:
    """Bins of a record of which nothing is known but its length, and their densities; as of the last channel."""
    start = edges(count)
    nothing = np.zeros(start.size - 1)
    ramp = nothing.copy()
    single = start[:-1] < min(_RAMP, count)
    ramp[single] = ramp_coefficients(start[:-1][single], count, dt) ** 2
    thought = Spectrum(dt, count, 1, start[:-1], start[1:], nothing, nothing, ramp)
    return thought, densities(thought)


SURE: Final = 0.9973  # of the interval whose upper end no term may exceed: 3 sd, as it is asked at every averaging time
_KNOWN: Final = 0.1  # of the record: of longer averages, nobody knows an interval that holds in so many cases
_LONGEST: Final = 0.25  # of the record; of longer averages there are less than three differences
_LEAST: Final = 2.0  # ratio of the averaging times at which a slow term is judged
_JUDGED: Final = "QBKR"
_SLOW: Final = "KR"


def within_the_curve(
    kept: Spectrum, best: likelihood.LikelihoodFit, of: Curve, mask: Mask, bands: Sequence[Band] = ()
) -> tuple[dict[str, Coefficient], likelihood.LikelihoodFit, tuple[str, ...]]:
    """Coefficients around a fit of which the curve contradicts none, the fit they are quoted from, and what to tell.

    Quantization is held to the whole curve, masked or not, for no filter of a device takes it away and leaves the
    angle; the others to what is not masked. White noise is not judged: it is what short averages show.
    """
    sure = interval(of.dev, of.edf, skew_edf(of.kind, of.alpha, of.count, of.n), SURE)[1]
    limits = {letter: _limit(letter, of, sure, mask) for letter in _JUDGED}
    reasons: dict[str, str] = {}
    while True:
        terms, fitted = likelihood.coefficients(kept, best, barred=reasons, bands=bands)
        shown = [letter for letter in _JUDGED if terms[letter].observable]
        more = {w: why for w in shown if (why := _against(w, terms, limits[w], of, mask))}
        if not more:
            for letter in reasons:
                c, most = terms[letter], limits[letter][0]
                terms[letter] = replace(
                    c, value=min(c.value, most), lo=0.0, hi=min(c.hi, most), upper=min(c.upper, most)
                )
            return terms, fitted, tuple(reasons.values())
        reasons |= more


def _limit(letter: str, of: Curve, sure: Floats, mask: Mask) -> tuple[float, float]:
    """Largest coefficient that the curve allows a term that is there alone, and the averaging time that says so, s."""
    judged = _judged(letter, of, mask, _KNOWN)
    tau = of.tau[judged]
    allowed = sure[judged] / np.sqrt(variance(letter, 1.0, tau))
    if not allowed.size:
        return math.inf, math.nan
    return float(allowed.min()), float(tau[np.argmin(allowed)])


def _against(
    letter: str, terms: Mapping[str, Coefficient], limit: tuple[float, float], of: Curve, mask: Mask
) -> str | None:
    """Say in words why the curve contradicts a coefficient; None where it does not.

    By its lower end; of a slow one, where the model lies above the curve's interval wherever the term is most of it.
    """
    if letter not in _SLOW:
        more = "what the spectrum gives it would alone exceed the measured curve at"
        return f"{letter} is not quoted: {more} {limit[1]:.3g} s" if terms[letter].lo > limit[0] else None
    judged = _judged(letter, of, mask, _LONGEST)
    parts = {w: variance(w, c.value, of.tau) for w, c in terms.items() if c.observable}
    model = np.sum(list(parts.values()), axis=0)
    judged &= parts[letter] > 0.5 * model
    tau = of.tau[judged]
    if not tau.size or tau[-1] < _LEAST * tau[0] or (np.sqrt(model) <= of.hi)[judged].any():
        return None
    return (
        f"{letter} is not quoted: with it the model lies above the interval of the measured curve from {tau[0]:.3g} to "
        f"{tau[-1]:.3g} s"
    )


def _judged(letter: str, of: Curve, mask: Mask, longest: float) -> NDArray[np.bool_]:
    return (of.dev > 0.0) & (of.n <= longest * of.count) & ((letter == "Q") | (of.n >= mask.n))


FEWEST: Final = 100  # samples below which not even the white noise of a record is worth a number
_MISFIT = 0.2  # of the density over an octave, above which a reader is told
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
        curves(values[:, np.newaxis], dt)[0] if of is None else of,
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
        quantities = ", ".join(q.name.lower() for q in DATASHEET)
        raise UnitError(
            f"quantity must be one of {quantities}, whose noise has a data sheet's units, but it is {quantity!r}."
        )
    step = of.dt * averages.averaged
    sinusoids, residual = find_sinusoids(averages.values, step, averages.averaged)
    full_spectrum = spectrum(residual, of.dt, averages.averaged)
    left_out = leave_out(full_spectrum, of.n)
    unmasked, mask, bands = left_out.kept, left_out.mask, left_out.bands
    choice = choose(unmasked)
    if choice.smoothed is not None:
        mask, below = mask_first_order(left_out.whole, choice.smoothed, of.n)
        if below is not None:
            unmasked, choice = below, choose(below)
    by_likelihood, best, doubted = within_the_curve(unmasked, choice.best, of, mask, bands)
    likely = likelihood.most_likely(best, by_likelihood["R"])
    if choice.smoothed is not None:  # of what was smoothed away, nothing
        by_likelihood, likely = {}, {}
    process = () if choice.markov is None else (choice.markov,)
    by_squares = least_squares(of, first=mask.n, others=(*sinusoids, *bands, *process))
    if averages.averaged > 1 and "Q" in by_squares.terms:
        by_likelihood["Q"] = by_squares.terms["Q"]
        likely["Q"] = by_squares.terms["Q"].value
    hours = {letter: hours_needed(letter, by_likelihood, of.dt, of.count * of.dt) for letter in by_likelihood}
    quoted = {letter: replace(c, hours=hours[letter]) for letter, c in by_likelihood.items()}
    analysis = Analysis(
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
        notes=(*doubted, *_notes(unmasked, choice._replace(best=best), mask, quoted)),
    )
    return with_curve(analysis, of)


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
    alpha = np.where(modelled, -1.0 - slope, of.alpha)
    shaped = make_curve(of.dev, of.n, of.count, of.dt, kind=of.kind, confidence=of.confidence, alpha=alpha)
    return replace(analysis, curve=shaped)


def _notes(unmasked: Spectrum, choice: Choice, mask: Mask, quoted: Mapping[str, Coefficient]) -> Iterator[Note]:
    if mask.n == 1 and mask.reason != Mask().reason:
        yield mask.reason
    yield from choice.notes
    unseen = [letter for letter in "BK" if letter in quoted and not quoted[letter].observable]
    shown = [letter for letter, c in quoted.items() if c.observable]
    if len(unseen) == 2 and likelihood.is_more_than(unmasked, choice.best, shown):
        yield warning("noise.b_or_k")
    for inside, excess, sd in likelihood.departures(
        unmasked, choice.best, likelihood.octaves(unmasked)
    ):  # from the model
        if abs(excess) > max(_MISFIT, _SURE * sd):
            low, high = unmasked.frequency[inside][[0, -1]]
            yield (warning("noise.excess", low=low, high=high, factor=1.0 + excess))
