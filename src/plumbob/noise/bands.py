"""Narrow bands of motion or interference in a spectrum: found, left out of the likelihood, and reported.

A structure that swings, a machine next door or a supply's ripple puts its power into a band that is wider than a line
and narrower than an octave. No term has such a shape: a fit that must explain it takes the power for quantization or
bias instability, and cutting everything above it throws the white noise away. What is outside of the band is as good as
before, so only the band is left out.

Which high frequencies, and so which short averaging times, no fit may use: those that the device itself has shaped.

A low-pass filter in the device, or noise that sampling folds down, bends the spectrum as none of the terms does. One
bent octave spoils all coefficients: it holds more samples than all lower ones together.

Coefficients read off lines of fixed slope, as papers and data sheets do it: [Ou2017] steps 5 to 7.

Where the curve runs along a slope of −1, −1/2, 0, +1/2 or +1, a line of just that slope is laid through it and read
where its term has its coefficient. This is biased wherever two terms overlap, which is nearly everywhere: it is here to
be compared with. The ± is IEEE Std 952's 1/√(2(N/n − 1)) at the averaging time where the line is read; it is a
statement about one value of the curve, not about a coefficient.

Coefficients by non-negative least squares on the Allan variance, weighted by its degrees of freedom.

The Allan variance is linear in the squares of the coefficients, so no start is needed and none comes out imaginary.
Values at neighbouring averaging times are far from independent; the intervals know that: they come from the covariance
of the whole curve under the fitted spectrum. For K and R the likelihood says more (`plumbob.noise.likelihood`).
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats, runs
from plumbob.noise.artefacts import window_sums
from plumbob.noise.curve import Curve, edf
from plumbob.noise.findings import Band, Coefficient, Estimates, GaussMarkov, Mask, Sinusoid
from plumbob.noise.likelihood import CLEAR, LikelihoodFit, departures, fit
from plumbob.noise.spectrum import LETTERS, Spectrum, densities, sampled_densities
from plumbob.noise.terms import FAR, TERMS, allan_transfer, grid, variance

_WEIGHINGS = 6
_SAMPLED_TO = 64  # from so many samples on, sampled flicker noise has its flat line to 0.1 %


def least_squares(curve: Curve, *, first: int = 1, others: Sequence[Sinusoid | Band | GaussMarkov] = ()) -> Estimates:
    """Fit Q, N, B, K and R to a curve from the factor `first` on, beside `others` that are already known."""
    used = curve.n >= first
    n, tau = curve.n[used], curve.tau[used]
    if n.size <= len(TERMS):
        return Estimates("least squares", {})
    background = np.sum([other.variance(tau) for other in others] + [np.zeros(tau.size)], axis=0)
    columns = np.stack([variance(letter, 1.0, tau) for letter in TERMS], axis=1)  # [Chen2013] (14)
    few = n < _SAMPLED_TO
    if few.any():  # sampled flicker noise at few samples included
        frequency, width = grid(_SAMPLED_TO, curve.dt)
        flicker = sampled_densities(frequency, curve.dt)[LETTERS.index("B")]
        columns[few, list(TERMS).index("B")] = allan_transfer(n[few], frequency, curve.dt) @ (flicker * width)
    measured = curve.dev[used] ** 2
    squares, inverse = _solve(columns, measured, background, curve, used)
    model: Floats = columns @ squares + background
    covariance: Floats = inverse @ _covariance(curve, n, squares, model) @ inverse.T
    sd = np.sqrt(np.diag(covariance))
    terms = {}
    for letter, square, spread in zip(TERMS, squares, sd, strict=True):  # the ends are those of the square
        lo, hi, upper = (math.sqrt(max(square + k * spread, 0.0)) for k in (-1.0, 1.0, 1.645))
        shown = bool(square > 0.0 and square >= CLEAR * spread)
        terms[letter] = Coefficient(math.sqrt(square), lo, hi, upper, shown)
    return Estimates("least squares", terms)


def _freedom(curve: Curve, n: NDArray[np.int64], model: Floats) -> Floats:
    """Degrees of freedom of the model's noise at each factor, told from its own slope, which does not scatter."""
    slope = np.gradient(np.log(model), np.log(n)) if n.size > 1 else np.zeros(1)
    return edf(curve.kind, np.clip(-slope - 1.0, -2.0, 2.0), curve.count, n)


def _solve(
    columns: Floats, measured: Floats, background: Floats, curve: Curve, used: NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """Squares of the coefficients (5,), and the matrix (5, m) that makes them of the measured variances.

    The weights are those of the model, not of the measured values: a value that came out low would otherwise count
    more.
    """
    model, freedom = measured, curve.edf[used]
    for _ in range(_WEIGHINGS):
        weight = np.sqrt(0.5 * freedom) / model
        weighted = weight[:, np.newaxis] * columns
        scale = np.sqrt(np.sum(weighted**2, axis=0))
        squares = _not_negative(weighted / scale, weight * (measured - background)) / scale
        model = np.maximum(columns @ squares + background, 1e-3 * measured)
        freedom = _freedom(curve, curve.n[used], model)
    inverse = np.linalg.pinv(weighted / scale) / scale[:, np.newaxis] * weight
    return squares, np.asarray(inverse)


def _not_negative(columns: Floats, wanted: Floats) -> Floats:
    """Least squares without negative coefficients: the best of those sets of columns whose own solution has none.

    Among the 31 sets of five columns is the one that an active-set search would end at, and SciPy's would import its
    optimisation.
    """
    rotation, columns = np.linalg.qr(columns)
    wanted = rotation.T @ wanted  # what lies outside the columns is left over by all sets
    best, least = np.zeros(wanted.size), float(wanted @ wanted)
    for size in range(wanted.size, 0, -1):
        for chosen in map(list, combinations(range(wanted.size), size)):
            solution = np.linalg.lstsq(columns[:, chosen], wanted, rcond=None)[0]
            residual = wanted - columns[:, chosen] @ solution
            if (solution > 0.0).all() and residual @ residual < least:
                best, least = np.zeros(best.size), float(residual @ residual)
                best[chosen] = solution
    return best


def _covariance(curve: Curve, n: NDArray[np.int64], squares: Floats, model: Floats) -> Floats:
    """Covariance (m, m) of the Allan variances: variances by degrees of freedom, correlations by common frequencies."""
    density = squares[: len(LETTERS)] @ sampled_densities(grid(curve.count, curve.dt)[0], curve.dt)
    shares = _transfer(tuple(n.tolist()), curve.count, curve.dt) * density
    product = shares @ shares.T
    norm = np.sqrt(np.maximum(np.diag(product), np.finfo(float).tiny))
    sd = model * np.sqrt(2.0 / _freedom(curve, n, model))
    return np.asarray(product / np.outer(norm, norm) * np.outer(sd, sd))


@lru_cache(maxsize=2)
def _transfer(n: tuple[int, ...], count: int, dt: float) -> Floats:
    """What each frequency adds to each Allan variance, times the root of its width; the same for all channels."""
    frequency, width = grid(count, dt)
    return allan_transfer(np.array(n), frequency, dt) * np.sqrt(width)


_BENT = 0.2  # of the density: from here on something has shaped it
_MARGIN = 2.0**1.5  # a low-pass of first order that takes 6 % at a frequency takes 0.8 % so much further down
_TOLERATED = 0.03  # of the density: what unevenness is nobody's filter
_SURE_OF_A_MASK = 4.0  # standard deviations
_JUDGED = 2.0  # octaves below the cut whose fit is judged
_PER_OCTAVE = 4
_LEAST = 100.0  # coefficients without which nothing can be judged
_SHARE = 0.02  # of an Allan variance that may come from masked frequencies


def find_mask(spectrum: Spectrum, n: NDArray[np.int64]) -> tuple[Mask, Spectrum]:
    """Mask of a record with the averaging factors n (m,), and the spectrum below it.

    A spectrum that is bent somewhere in its highest octaves is cut, in half octaves from half the sampling rate down,
    until the terms fit the octaves next to the cut; and once more by `_MARGIN`, for a bend that is not seen yet has
    already begun. Mere unevenness is not a bend: real sensors have some per cent of it.
    """
    cut, below = 0.5 / spectrum.step, spectrum
    fitted = fit(below)
    if _fits(below, fitted, cut, _BENT):
        return Mask(), spectrum
    while not _fits(below, fitted, cut, _TOLERATED):
        cut /= math.sqrt(2.0)
        below = spectrum.below(cut)
        if below.terms.sum() < _LEAST:  # bent everywhere: no filter of the device, but no noise of these terms either
            return Mask(reason="no frequency could be found below which the terms fit; nothing masked"), spectrum
        fitted = fit(below)
    safe = spectrum.below(cut / _MARGIN)
    if safe.terms.sum() >= _LEAST:
        cut, below, fitted = cut / _MARGIN, safe, fit(safe)
    factor, excess = _first_factor(spectrum, fitted, cut, n)
    reason = f"the spectrum {'falls' if excess < 0.0 else 'rises'} there as none of the terms does"
    return Mask(factor, cut, reason), below


def mask_first_order(spectrum: Spectrum, time: float, n: NDArray[np.int64]) -> tuple[Mask, Spectrum | None]:
    """Mask of a record that a filter of first order with a time constant, s, has smoothed; `n` (m,) as there.

    With it the spectrum below it, if that is enough to fit. Such a filter makes a Gauss–Markov process of white noise,
    whose spectrum falls like that of a random walk: nothing that the highest octaves alone would tell.
    """
    cut = float(np.sqrt(_TOLERATED)) / (2.0 * np.pi * time)
    reason = f"the record looks smoothed, as by a filter of first order with a time constant of {time:.2g} s"
    below = spectrum.below(cut)
    if below.terms.sum() >= _LEAST:
        factor, _ = _first_factor(spectrum, fit(below), cut, n)
        return Mask(factor, cut, reason), below
    beyond = int(n[min(int(np.searchsorted(n * spectrum.dt, FAR * time)), n.size - 1)])
    return Mask(beyond, cut, f"{reason}; it is too short to show more than that"), None


def _fits(spectrum: Spectrum, fitted: LikelihoodFit, cut: float, tolerated: float) -> bool:
    """Whether no part of the octaves below the cut departs from a fit by more than what is tolerated, or by chance."""
    group = np.floor(np.log2(cut / spectrum.frequency) * _PER_OCTAVE).astype(np.int64)
    judged = np.where(group < _JUDGED * _PER_OCTAVE, group, -1)
    return not any(
        abs(excess) > max(tolerated, _SURE_OF_A_MASK * sd) for _, excess, sd in departures(spectrum, fitted, judged)
    )


def _first_factor(spectrum: Spectrum, fitted: LikelihoodFit, cut: float, n: NDArray[np.int64]) -> tuple[int, float]:
    """Smallest factor above which masked frequencies hardly count, and what they add to the spectrum on the whole."""
    model = fitted.squares @ densities(spectrum)
    width = spectrum.width
    # averaged over a few places of each bin
    places = np.random.default_rng(0).uniform(-0.5, 0.5, size=(8, width.size)) * width
    weights = np.mean([allan_transfer(n, spectrum.frequency + p, spectrum.dt) for p in places], axis=0)
    beyond = spectrum.frequency > cut
    excess = (spectrum.power / spectrum.terms - model) * width * beyond
    share = np.abs(weights @ excess) / (weights @ (model * width))
    large = np.flatnonzero(share > _SHARE)
    first = int(n[min(large[-1] + 1, n.size - 1)]) if large.size else int(n[0])
    return first, float(excess.sum())


_WITHIN = 0.15  # of the slope
_DECADES = 0.3  # that a line needs
_LEAST_EDF = 4.0  # less is not a slope but chance
_REACH_DECADES = 0.15  # decades to either side over which the local slope is taken


def lines(curve: Curve, *, first: int = 1) -> Estimates:
    """Read off every term whose slope the curve shows from the factor `first` on."""
    used = (curve.n >= first) & (curve.edf >= _LEAST_EDF) & (curve.dev > 0.0)
    if np.count_nonzero(used) < 3:
        return Estimates("lines", {})
    x, y = np.log10(curve.tau[used]), np.log10(curve.dev[used])
    slope = np.empty(x.size)
    for i in range(x.size):  # of a straight line through the points near each
        near = np.abs(x - x[i]) <= _REACH_DECADES
        near[max(i - 1, 0) : i + 2] = True
        dx = x[near] - np.mean(x[near])
        slope[i] = np.dot(dx, y[near]) / np.dot(dx, dx)
    terms = {}
    for letter, term in TERMS.items():
        spans = runs(np.abs(slope - 0.5 * term.power) <= _WITHIN)
        run = slice(*max(spans, key=np.ptp)) if spans else None  # the longest
        if run is not None and x[run.stop - 1] - x[run.start] >= _DECADES:
            height = float(np.mean(y[run] - 0.5 * term.power * x[run]))
            value = 10.0**height / math.sqrt(term.share)
            # [Ou2017]: √3 s for the flat line too
            samples = (math.sqrt(3.0) if term.read_at is None else term.read_at) / curve.dt
            terms[letter] = Coefficient(value)
            if 1.0 <= samples <= 0.5 * curve.count:
                error = 1.0 / math.sqrt(2.0 * (curve.count / samples - 1.0))  # [Ou2017] (7)
                terms[letter] = Coefficient(value, value * (1.0 - error), value * (1.0 + error))
    return Estimates("lines", terms)


Inside = NDArray[np.bool_]

_REACH_OCTAVES = 0.75  # octaves to either side whose median is the floor round about
_LOWEST = 64  # coefficients: 32 cycles in the record; below, a slow wander cannot be told from a band
_RUNS = (1, 2, 4, 8)  # bins together in which a band is looked for
_SURE_OF_A_BAND = 5.0  # standard deviations above the floor
_TALL: Final = 1.2  # times the floor: less is the unevenness of real sensors
_SKIRT = 0.03  # of the density: where a band ends
_STEP = 4  # bins by which it is widened
_WIDEST = 2.0  # octaves from its peak to where a band may reach
_NARROW = 1.5  # octaves of its core; a wider one is another kind of noise
_ROUNDS = 6
_PLACES = 16


class LeftOut(NamedTuple):
    """What no fit may use, and what is left."""

    bands: tuple[Band, ...]
    mask: Mask
    kept: Spectrum
    whole: Spectrum  # with the frequencies above the mask, but without the bands


def leave_out(spectrum: Spectrum, n: NDArray[np.int64]) -> LeftOut:
    """Find the bands and the mask of a record with the averaging factors n (m,), which increase."""
    inside = _cores(spectrum)
    if not inside.any():
        return LeftOut((), *find_mask(spectrum, n), spectrum)
    mask, clean = find_mask(spectrum.only(~inside), n)
    usable = np.arange(spectrum.start.size) < np.searchsorted(spectrum.start, clean.stop[-1])
    fitted = fit(clean)
    for _ in range(_ROUNDS):
        grown = _grown(spectrum, fitted, inside, usable)
        if (grown == inside).all():
            break
        inside = grown
        clean = spectrum.only(usable & ~inside)
        fitted = fit(clean)
    bands = [_band(spectrum, fitted, bins) for bins in (slice(*run) for run in runs(inside)) if usable[bins].all()]
    bands = [band for band in bands if band.sd > 0.0]  # the last fit may explain what an earlier one did not
    return LeftOut(tuple(sorted(bands, key=lambda b: -b.sd)), mask, clean, spectrum.only(~inside))


def _cores(spectrum: Spectrum) -> Inside:
    """Bins that stand above those round about by more than noise does, and by more than a sensor is uneven."""
    inside = np.zeros(spectrum.start.size, dtype=bool)
    first = int(np.searchsorted(spectrum.start, _LOWEST))
    terms = spectrum.terms[first:]
    if terms.size < 4 * max(_RUNS):
        return inside
    # median of the bins as far below as above: of a slope, its own middle
    mean, octave = spectrum.power[first:] / terms, np.log2(spectrum.frequency[first:])
    behind = np.arange(mean.size) - np.searchsorted(octave, octave - _REACH_OCTAVES)
    ahead = np.searchsorted(octave, octave + _REACH_OCTAVES, side="right") - np.arange(mean.size) - 1
    reach = np.minimum(behind, ahead).tolist()
    floor = terms * np.array([np.median(mean[i - r : i + r + 1]) for i, r in enumerate(reach)])
    for run in _RUNS:
        power, below, count = (window_sums(row, run) for row in (spectrum.power[first:], floor, terms))
        ratio, spread = power / below, 2.0 / (9.0 * count)
        sure = (np.cbrt(ratio) - (1.0 - spread)) / np.sqrt(spread)  # [Wilson1931]: of a χ², as if it were normal
        for k in np.flatnonzero((sure > _SURE_OF_A_BAND) & (ratio > _TALL)).tolist():
            inside[first + k : first + k + run] = True
    for bins in (slice(*run) for run in runs(inside)):
        low, high = spectrum.frequency[bins][[0, -1]]
        if math.log2(high / low) > _NARROW:
            inside[bins] = False
    return inside


def _grown(spectrum: Spectrum, fitted: LikelihoodFit, inside: Inside, usable: Inside) -> Inside:
    """Bands with their skirts: as far as the power is above the fit by more than chance, and by more than little."""
    model = spectrum.terms * (fitted.squares @ densities(spectrum))
    excess = spectrum.without_ramp(fitted.ramp) - model
    grown = inside.copy()
    for bins in (slice(*run) for run in runs(inside)):
        peak = spectrum.frequency[bins][np.argmax((excess / spectrum.terms)[bins])]
        near = usable & (np.abs(np.log2(spectrum.frequency / peak)) <= _WIDEST) & (spectrum.start >= _LOWEST)
        for outward in (range(bins.start - 1, -1, -1), range(bins.stop, near.size)):
            for at in range(0, len(outward) - _STEP + 1, _STEP):
                step = np.array(outward[at : at + _STEP])
                chance = 2.0 * math.sqrt(2.0 / float(spectrum.terms[step].sum()))
                if not near[step].all() or excess[step].sum() < max(_SKIRT, chance) * model[step].sum():
                    break
                grown[step] = True
    return grown


def _band(spectrum: Spectrum, fitted: LikelihoodFit, bins: slice) -> Band:
    """Limits and power of a band, as it is in the samples."""
    frequency = spectrum.frequency[bins]
    model = (fitted.squares @ densities(spectrum))[bins]
    power = (spectrum.without_ramp(fitted.ramp)[bins] / spectrum.terms[bins] - model) * spectrum.width[bins]
    d, turn = spectrum.averaged, np.pi * frequency * spectrum.dt
    power = np.maximum(power, 0.0) * (d * np.sin(turn) / np.sin(d * turn)) ** 2
    total = np.cumsum(power)
    places = np.interp((np.arange(_PLACES) + 0.5) / _PLACES * total[-1], total, frequency)
    half = 0.5 * spectrum.width[bins]
    low, high = float(frequency[0] - half[0]), float(frequency[-1] + half[-1])
    return Band(low, high, math.sqrt(2.0 * float(total[-1])), tuple(places.tolist()), spectrum.dt)
