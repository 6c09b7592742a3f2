"""Coefficients by likelihood: the ramp by regression, the random terms by Whittle's likelihood, both at once.

Each cosine coefficient of a record (`plumbob.noise.spectrum`) is taken for normal, independent, of mean R times that of
a unit ramp and of variance S(f), the sum of the terms' densities. R is eliminated in closed form, and what its
regression takes away is given back to the random terms (restricted likelihood [Patterson1971]); without that K comes
out low. The random terms are found by Fisher scoring in the logarithms of their coefficients, so that none becomes
negative.

A coefficient of which the record says little is not normally distributed. Its interval is then read off the profile of
the likelihood, with every value of the coefficient taken for equally probable beforehand, and its value is the median.

The inner loop of `plumbob.noise.likelihood`: Fisher scoring, compiled, for one record asks for thousands of steps.

Bins are taken as whole arrays and parameters one by one, so that it is fast enough as plain Python too.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.noise import spectrum as spectra
from plumbob.noise.findings import Band, Coefficient
from plumbob.noise.spectrum import markov_bin_densities

_ROUNDS: Final = 100
_SMALL_STEP: Final = 1e-5
_ABSENT: Final = 1e-10  # share of the density below which a term counts as absent
_AHEAD: Final = 1e-4  # in the logarithm of a correlation time, for a slope by differences


class Bins(NamedTuple):
    """What a likelihood needs of a spectrum of m bins."""

    rows: Floats  # (r, m), densities of the random terms for coefficients of 1
    # terms, power, cross, ramp: (m,), as in `plumbob.noise.spectrum.Spectrum`
    terms: Floats
    power: Floats
    cross: Floats
    ramp: Floats
    process: spectra.MarkovBins  # for the density of a Gauss–Markov process


class Iterate(NamedTuple):
    """Logarithms of coefficients (p,), and what the likelihood is there; `evaluate` fills it in."""

    # logs, gradient: (p,), the logarithms, and the gradient of half the deviance
    logs: Floats
    gradient: Floats
    information: Floats  # (p, p), fisher information
    density: Floats  # (m,), of the model
    relative: Floats  # (p, m), derivatives of its logarithm
    sums: Floats  # (3,), half the deviance; the ramp R; 1 / variance of R


def point(logs: Floats, bins: int) -> Iterate:
    """Room for a point at `logs` (p,) in so many bins."""
    p = logs.size
    shapes = (p, (p, p), bins, (p, bins), 3)
    return Iterate(np.array(logs, dtype=np.float64), *(np.zeros(shape) for shape in shapes))


@kernel
def evaluate(bins: Bins, at: Iterate) -> float:
    """Fill in everything at `at.logs` but the information, and return half the deviance."""
    _densities(bins, at)
    density, count = at.density, at.density.shape[0]
    square = ramp = half = 0.0
    for i in range(count):
        square += bins.ramp[i] / density[i]
        ramp += bins.cross[i] / density[i]
    ramp = ramp / square
    for k in range(at.logs.shape[0]):
        at.gradient[k] = 0.0
    for i in range(count):
        share = (bins.power[i] - 2.0 * ramp * bins.cross[i] + ramp * ramp * bins.ramp[i]) / density[i]  # [Whittle1953]
        half += bins.terms[i] * math.log(density[i]) + share
        slope = 0.5 * (bins.terms[i] - share - bins.ramp[i] / density[i] / square)
        for k in range(at.logs.shape[0]):
            at.gradient[k] += at.relative[k, i] * slope
    half = 0.5 * half + 0.5 * math.log(square)  # [Patterson1971]
    at.sums[0], at.sums[1], at.sums[2] = half, ramp, square
    return half


@kernel
def _densities(bins: Bins, at: Iterate) -> None:
    """Density and its relative derivatives by the logarithms."""
    relative, terms = at.relative, bins.rows.shape[0]
    at.density[:] = 0.0
    for k in range(terms):
        _add(at.density, bins.rows[k], math.exp(2.0 * at.logs[k]), relative[k])
    if at.logs.shape[0] > terms:
        power, time = math.exp(2.0 * at.logs[terms]), math.exp(at.logs[terms + 1])
        process, slope = relative[terms], relative[terms + 1]
        slope[:] = 0.0
        for side in (1.0, -1.0, 0.0):
            markov_bin_densities(bins.process, time * math.exp(side * _AHEAD), process)
            for i in range(slope.shape[0]):
                slope[i] += side / (2.0 * _AHEAD) * (power * process[i])
        _add(at.density, process, power, process)
    for k in range(relative.shape[0]):
        for i in range(at.density.shape[0]):
            relative[k, i] = relative[k, i] / at.density[i]


@kernel
def _add(density: Floats, row: Floats, power: float, slope: Floats) -> None:
    """Add a term of that power, and note its derivative by the logarithm of its coefficient."""
    for i in range(density.shape[0]):
        part = power * row[i]
        density[i] += part
        slope[i] = 2.0 * part


@kernel
def inform(bins: Bins, at: Iterate) -> None:
    """Fill in the information of a point that is otherwise complete."""
    for i in range(at.logs.shape[0]):
        for j in range(i + 1):
            total = 0.0
            for m in range(bins.terms.shape[0]):
                total += 0.5 * at.relative[i, m] * bins.terms[m] * at.relative[j, m]
            at.information[i, j] = at.information[j, i] = total


@kernel
def _search(
    bins: Bins,
    held: NDArray[np.bool_],
    start: Iterate,
    room: Iterate,
    free: NDArray[np.bool_],
    step: Floats,
    work: Floats,
) -> bool:
    """Search from `start` for the largest likelihood by Fisher scoring with damping, the `held` (p,) where they are.

    Both points are written to; whether it is `start` that holds the end. The last three are room to work in.
    """
    now, trial, is_start = room, start, False
    half, moved = math.inf, 0.0
    damping, rounds = 1e-2, 0
    while damping < 1e8 and rounds <= _ROUNDS:
        tried = evaluate(bins, trial)
        if tried <= half:  # at first where it stands
            now, trial, is_start = trial, now, not is_start
            inform(bins, now)
            rounds += 1
            damping = max(damping / 10.0, 1e-9)
            gain, half = half - now.sums[0], now.sums[0]
            some = _present(bins, now, held, free)
            if not some or gain < 1e-9 or 0.0 < moved < _SMALL_STEP:
                break
        else:
            damping *= 4.0
        moved = _solve(now, free, damping, step, work)
        for k in range(step.shape[0]):
            trial.logs[k] = now.logs[k] + step[k]
    return is_start


@kernel
def _present(bins: Bins, now: Iterate, held: NDArray[np.bool_], free: NDArray[np.bool_]) -> bool:
    """Say which of those that are not held the density feels, and whether any does.

    The logarithm of a term that is not there runs away.
    """
    some = False
    for k in range(held.shape[0]):
        most = 0.0
        for i in range(now.density.shape[0]):
            most = max(most, now.relative[k, i])
        free[k] = not held[k] and (k >= bins.rows.shape[0] or 0.5 * most > _ABSENT)
        some = some or free[k]
    return some


@kernel
def _solve(now: Iterate, free: NDArray[np.bool_], damping: float, step: Floats, matrix: Floats) -> float:
    """Step of the free parameters, by elimination in the damped information, and its largest part; none is above 1."""
    p = free.shape[0]
    largest = 0.0
    for k in range(p):
        for i in range(p):
            matrix[k, i] = now.information[k, i]
        step[k] = -now.gradient[k] if free[k] else 0.0
        largest = max(largest, matrix[k, k] if free[k] else 0.0)
    for k in range(p):
        matrix[k, k] += damping * matrix[k, k] + 1e-12 * largest
    for k in range(p):
        for i in range(k + 1, p):
            if free[k] and free[i]:
                factor = matrix[i, k] / matrix[k, k]
                step[i] -= factor * step[k]
                for j in range(k + 1, i + 1):
                    matrix[i, j] -= factor * matrix[j, k]
    for k in range(p - 1, -1, -1):
        if free[k]:
            for i in range(k + 1, p):
                if free[i]:
                    step[k] -= matrix[i, k] * step[i]
            step[k] = step[k] / matrix[k, k]
    longest = 0.0
    for k in range(p):
        step[k] = min(max(step[k], -1.0), 1.0)
        longest = max(longest, abs(step[k]))
    return longest


CLEAR: Final = 2.0  # sd from 0 of a value whose likelihood is as much less as that without an observable term
CLEARLY: Final = 9.0  # fall of the deviance for two terms together though neither shows by itself: chance of 1 %
_WALK = spectra.LETTERS.index("K")
_NOTHING = -300.0  # logarithm of a coefficient that is not there: its square is still a number
_ONE_SIDED = 0.02275  # of a normal distribution beyond 2 sd
_SHARP = 0.1  # relative standard deviation up to which a coefficient is taken for log-normal
_QUANTILES = (0.158655, 0.5, 0.841345, 0.95)
_GRID = 33
_DEPARTS = 2.326  # standard deviations of what chance makes of a misfit: once in a hundred records


@dataclass(frozen=True, eq=False)
class LikelihoodFit:
    """A maximum of the restricted likelihood."""

    # (p,), logarithms of Q, N, B, K and, with a Gauss–Markov process, of its standard deviation and correlation time
    logs: Floats
    information: Floats  # (p, p), fisher information about them
    deviance: float  # −2 ln likelihood, up to a constant of the record
    # ramp, ramp_sd: R, which has a sign, and its standard deviation, unit/s
    ramp: float
    ramp_sd: float
    density: Floats  # (m,), of the model in each bin
    relative: Floats  # (p, m), derivatives of its logarithm by `logs`

    @property
    def squares(self) -> Floats:
        """Squares of Q, N, B and K, by which `densities` of any spectrum are multiplied."""
        return np.asarray(np.exp(2.0 * self.logs[: len(spectra.LETTERS)]))


def fit(spectrum: spectra.Spectrum, *, markov_time: float | None = None) -> LikelihoodFit:
    """Find the most likely coefficients; with a Gauss–Markov process, starting from its correlation time, s."""
    model = _Model(spectrum)
    return model.search(model.begin(markov_time))


def coefficients(
    spectrum: spectra.Spectrum, best: LikelihoodFit, *, barred: Collection[str] = (), bands: Sequence[Band] = ()
) -> tuple[dict[str, Coefficient], LikelihoodFit]:
    """Q, N, B, K and R with their intervals, around a fit of this spectrum; and the fit that they are quoted from.

    Where quantization is not observable it is taken out before the others are judged: what of it no record shows would
    be taken from white noise, always in the same direction. So are the letters that are `barred`, which are not
    observable whatever the spectrum says. Where the spectrum departs from the model by more than chance, all intervals
    are wider by what such departures do to the coefficients, and by what may be left of `bands` beyond their limits.
    """
    model = _Model(spectrum)
    terms = {
        w: replace(model.interval(best, k), observable=False) for k, w in enumerate(spectra.LETTERS) if w in barred
    }
    for k in (spectra.LETTERS.index(letter) for letter in terms):
        best = model.with_log(best, k)
    if "Q" not in terms:
        terms["Q"] = model.interval(best, 0)
        if not terms["Q"].observable:
            best = model.with_log(best, 0)
    wider = _wider(spectrum, best, bands)
    terms = {w: terms[w] if w in terms else model.interval(best, k, wider[k]) for k, w in enumerate(spectra.LETTERS)}
    ramp = model.ramp(best)
    return {**terms, "R": replace(ramp, observable=False) if "R" in barred else ramp}, best


def departures(
    spectrum: spectra.Spectrum, found: LikelihoodFit, group: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.bool_], float, float]]:
    """Bins (m,) of each `group` (m,) from 0 on, the part by which their power departs from a fit, and its chance sd."""
    ratio = spectrum.without_ramp(found.ramp) / found.density
    for i in np.unique(group[group >= 0]):
        inside = group == i
        count = float(spectrum.terms[inside].sum())
        yield inside, float(np.sum(ratio[inside])) / count - 1.0, math.sqrt(2.0 / count)


def most_likely(best: LikelihoodFit, ramp: Coefficient) -> dict[str, float]:
    """Values of all five terms that together are the most likely, observable or not.

    But a ramp only where it is observable: else its slope is that of the random walk, which has been counted.
    """
    random = {letter: math.exp(best.logs[k]) for k, letter in enumerate(spectra.LETTERS)}
    return {**random, "R": abs(best.ramp) if ramp.observable else 0.0}


def is_more_than(spectrum: spectra.Spectrum, best: LikelihoodFit, shown: Sequence[str]) -> bool:
    """Whether the record holds more than the terms `shown`, though none of the others stands out by itself."""
    model = _Model(spectrum)
    bare = best
    for k, letter in enumerate(spectra.LETTERS):
        if letter not in shown:
            bare = model.with_log(bare, k)
    return model.search(bare.logs, held=[k for k, w in enumerate(spectra.LETTERS) if w not in shown]).deviance > (
        best.deviance + CLEARLY
    )


def markov_coefficients(spectrum: spectra.Spectrum, best: LikelihoodFit) -> tuple[Coefficient, Coefficient]:
    """Standard deviation and correlation time of the Gauss–Markov process of a fit, with intervals."""
    model = _Model(spectrum)
    sd, time = (model.interval(best, len(spectra.LETTERS) + k) for k in range(2))
    return sd, time


def spectrum_bins(s: spectra.Spectrum) -> Bins:
    """Bins of a spectrum, for `plumbob.noise.likelihood`."""
    return Bins(spectra.densities(s), s.terms, s.power, s.cross, s.ramp, spectra.markov_bins(s))


class _Model:
    """Likelihood of one spectrum as a function of the logarithms of the coefficients."""

    def __init__(self, spectrum: spectra.Spectrum) -> None:
        self.spectrum = spectrum
        self.bins = spectrum_bins(spectrum)

    def begin(self, markov_time: float | None) -> Floats:
        """Terms that each touch the spectrum from below, as the tangents of a curve do."""
        # mean density with a χ² of at least 16 coefficients behind each value, so that a minimum means something
        terms = self.spectrum.terms
        total = np.cumsum(np.concatenate(([0.0], self.bins.power / self.bins.terms * terms)))
        count = np.concatenate(([0.0], np.cumsum(terms)))
        ahead = np.minimum(np.searchsorted(count, count[:-1] + 16.0), terms.size)
        behind = np.minimum(np.arange(terms.size), np.searchsorted(count, max(count[-1] - 16.0, 0.0), side="right"))
        smooth = (total[ahead] - total[behind]) / np.maximum(count[ahead] - count[behind], 1.0)
        process = [] if markov_time is None else [spectra.markov_density(self.bins.process, markov_time)]
        logs = [0.5 * math.log(0.5 * np.min(smooth / row)) for row in [*self.bins.rows, *process]]
        return np.array(logs if markov_time is None else [*logs, math.log(markov_time)])

    def search(self, logs: Floats, held: Sequence[int] = ()) -> LikelihoodFit:
        """Fisher scoring with damping, from `logs`, with some of them held."""
        p, stays = logs.size, np.zeros(logs.size, dtype=bool)
        stays[list(held)] = True
        start, room = (point(logs, self.bins.terms.size) for _ in range(2))
        is_start = _search(self.bins, stays, start, room, np.zeros(p, dtype=bool), np.zeros(p), np.zeros((p, p)))
        best = start if is_start else room
        half, ramp, square = best.sums.tolist()
        return LikelihoodFit(
            best.logs, best.information, 2.0 * half, ramp, 1.0 / math.sqrt(square), best.density, best.relative
        )

    def interval(self, best: LikelihoodFit, k: int, wider: float = 1.0) -> Coefficient:
        """Coefficient k with its interval, so many times wider in the logarithm."""
        sd = wider * math.sqrt(max(_covariance(best)[k, k], 0.0))
        value = math.exp(best.logs[k])
        if sd < _SHARP:
            return Coefficient(value, value * math.exp(-sd), value * math.exp(sd), value * math.exp(1.645 * sd))
        values, profile, _ = self._profile(best, k, wider)
        profile = profile / wider**2
        fine = np.linspace(values[0], values[-1], 4001)
        weight = np.exp(_between(values, profile, fine))
        share = np.concatenate(([0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]))))
        lo, median, hi, upper = np.interp(_QUANTILES, share / share[-1], fine).tolist()
        clear = float(profile.max() - profile[0]) >= 0.5 * CLEAR**2
        return Coefficient(median, lo, hi, upper, clear)

    def ramp(self, best: LikelihoodFit) -> Coefficient:
        """R with its interval: how well it is known depends on how large the random walk is, which is uncertain too."""
        from scipy.special import ndtr

        weights, fits = np.ones(1), [best]
        if math.sqrt(max(_covariance(best)[_WALK, _WALK], 0.0)) >= _SHARP:
            _, profile, fits = self._profile(best, _WALK)
            weights = np.exp(profile)
        centres, sds = (np.array([getattr(f, name) for f in fits]) for name in ("ramp", "ramp_sd"))
        reach = np.max(np.abs(centres) + 6.0 * sds)
        values = np.linspace(-reach, reach, 8001)
        share = weights / weights.sum() @ ndtr((values - centres[:, np.newaxis]) / sds[:, np.newaxis])
        if np.interp(0.0, values, share) > 0.5:  # the ramp falls
            share = 1.0 - share[::-1]
        lo, median, hi, upper = np.interp(_QUANTILES, share, values).tolist()
        clear = float(np.interp(0.0, values, share)) < _ONE_SIDED
        return Coefficient(median, max(lo, 0.0), hi, upper, clear)

    def with_log(self, start: LikelihoodFit, k: int, log: float = _NOTHING) -> LikelihoodFit:
        """Fit from another one with the logarithm of coefficient k held; by default without that term."""
        logs = start.logs.copy()
        logs[k] = log
        return self.search(logs, held=(k,))

    def _profile(self, best: LikelihoodFit, k: int, wider: float = 1.0) -> tuple[Floats, Floats, list[LikelihoodFit]]:
        """Ln likelihood, all others at their best, over values of coefficient k from nothing to where it has fallen."""
        top = math.exp(best.logs[k]) * 1.5
        while (
            self.with_log(best, k, math.log(top)).deviance - best.deviance < (3.0 * wider) ** 2
        ):  # three standard deviations
            top *= 1.5
        values = np.linspace(0.0, top, _GRID)
        fits, middle = [best] * _GRID, int(np.searchsorted(values, math.exp(best.logs[k])))
        for side in (range(middle - 1, -1, -1), range(middle, _GRID)):  # outward, so that what is absent stays near
            now = best
            for i in side:
                fits[i] = now = self.with_log(now, k, math.log(max(values[i], 1e-6 * top)))
        profile = -0.5 * np.array([f.deviance for f in fits])
        return values, profile - profile.max(), fits


def _covariance(best: LikelihoodFit) -> Floats:
    """Covariance (p, p) of the logarithms, by the information."""
    diagonal = np.sqrt(np.maximum(np.diag(best.information), 1e-12))
    norm = np.outer(diagonal, diagonal)
    return np.asarray(np.linalg.pinv(best.information / norm, hermitian=True) / norm)


def _wider(spectrum: spectra.Spectrum, best: LikelihoodFit, bands: Sequence[Band]) -> Floats:
    """How many times wider the intervals of the coefficients (p,) are, in the logarithm, than by chance alone.

    Real noise is not exactly that of any terms. Taken for independent from octave to octave, its departures have the
    variance that a random-effects analysis finds in them [DerSimonian1986], and move the coefficients as the gradient
    of the likelihood says. So do the skirts of the bands, which nobody knows: a resonance's are as likely as none.
    """
    group = octaves(spectrum)
    excesses = [(inside, excess, sd**-2) for inside, excess, sd in departures(spectrum, best, group)]
    excess, weight = (np.array(column) for column in list(zip(*excesses, strict=True))[1:])
    freedom = max(weight.size - best.logs.size, 1)
    scatter = float(np.sum(weight * (excess - np.average(excess, weights=weight)) ** 2))
    spread = 2.0 / (9.0 * freedom)
    variance = 0.0
    if scatter > freedom * (1.0 - spread + _DEPARTS * math.sqrt(spread)) ** 3:  # [Wilson1931]
        variance = (scatter - freedom) / float(np.sum(weight) - np.sum(weight**2) / np.sum(weight))  # [DerSimonian1986]
    covariance = _covariance(best)
    pushes = np.stack([0.5 * best.relative[:, inside] @ spectrum.terms[inside] for inside, _, _ in excesses], axis=1)
    skirts = sum((band.skirt(spectrum.frequency) for band in bands), np.zeros(spectrum.terms.size))
    beyond = 0.5 * best.relative @ (spectrum.terms * skirts / best.density)
    moved = variance * np.sum((covariance @ pushes) ** 2, axis=1) + (covariance @ beyond) ** 2
    return np.asarray(np.sqrt(1.0 + moved / np.maximum(np.diag(covariance), 1e-300)))


def octaves(spectrum: spectra.Spectrum) -> NDArray[np.int64]:
    """Octave of each bin (m,), from the lowest on."""
    return np.asarray(np.floor(np.log2(spectrum.frequency / spectrum.frequency[0])), dtype=np.int64)


def _between(x: Floats, y: Floats, at: Floats) -> Floats:
    """Cubic interpolation between evenly spaced places, with the slopes of parabolas through three of them."""
    step = x[1] - x[0]
    rise, slope = np.diff(y) / step, np.gradient(y, step, edge_order=2)
    i = np.minimum(((at - x[0]) / step).astype(np.int64), rise.size - 1)
    u = at - x[i]
    bend = (slope[i] + slope[i + 1] - 2.0 * rise[i]) / step
    return np.asarray(y[i] + u * (slope[i] + u * ((rise[i] - slope[i]) / step - bend + u * bend / step)))
