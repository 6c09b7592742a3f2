"""Coefficients by likelihood: the ramp by regression, the random terms by Whittle's likelihood, both at once.

Each cosine coefficient of a record (`plumbob.noise.spectrum`) is taken for normal, independent, of mean R times that of
a unit ramp and of variance S(f), the sum of the terms' densities. R is eliminated in closed form, and what its
regression takes away is given back to the random terms (restricted likelihood [Patterson1971]); without that K comes
out low. The random terms are found by Fisher scoring in the logarithms of their coefficients, so that none becomes
negative.

A coefficient of which the record says little is not normally distributed. Its interval is then read off the profile of
the likelihood, with every value of the coefficient taken for equally probable beforehand, and its value is the median.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.noise.densities import LETTERS, MarkovDensity, densities
from plumbob.noise.findings import Coefficient
from plumbob.noise.spectrum import Spectrum

CLEAR: Final = 2.0
"""A term is observable when the likelihood with it is larger by as much as that of a value so many sd from 0."""

CLEARLY: Final = 9.0
"""By so much must the deviance fall for two terms to be there together though neither is by itself: chance of 1 %."""

_WALK = LETTERS.index("K")
_NOTHING = -300.0  # logarithm of a coefficient that is not there: its square is still a number
_ONE_SIDED = 0.02275  # of a normal distribution beyond 2 sd
_SHARP = 0.1  # relative standard deviation up to which a coefficient is taken for log-normal
_ROUNDS = 100
_SMALL_STEP = 1e-5
_ABSENT = 1e-10  # share of the density below which a term counts as absent
_QUANTILES = (0.158655, 0.5, 0.841345, 0.95)
_GRID = 33


@dataclass(frozen=True, eq=False)
class Fit:
    """A maximum of the restricted likelihood.

    Attributes
    ----------
    logs : ndarray (p,)
        Logarithms of Q, N, B, K and, with a Gauss–Markov process, of its standard deviation and correlation time.
    information : ndarray (p, p)
        Fisher information about them.
    deviance : float
        −2 ln likelihood, up to a constant of the record.
    ramp, ramp_sd : float
        R, which has a sign, and its standard deviation, unit/s.
    density : ndarray (m,)
        Of the model in each bin.
    """

    logs: Floats
    information: Floats
    deviance: float
    ramp: float
    ramp_sd: float
    density: Floats

    @property
    def squares(self) -> Floats:
        """Squares of Q, N, B and K, by which `densities` of any spectrum are multiplied."""
        return np.asarray(np.exp(2.0 * self.logs[: len(LETTERS)]))


def fit(spectrum: Spectrum, *, markov_time: float | None = None) -> Fit:
    """Find the most likely coefficients.

    Parameters
    ----------
    spectrum : Spectrum
        Of the record.
    markov_time : float, optional
        With a Gauss–Markov process, starting from this correlation time, s.
    """
    model = _Model(spectrum, markov_time is not None)
    return model.search(model.begin(markov_time))


def coefficients(spectrum: Spectrum, best: Fit) -> tuple[dict[str, Coefficient], Fit]:
    """Q, N, B, K and R with their intervals, around a fit of this spectrum; and the fit that they are quoted from.

    Where quantization is not observable it is taken out before the others are judged: what of it no record shows would
    be taken from white noise, always in the same direction.
    """
    model = _Model(spectrum, best.logs.size > len(LETTERS))
    quantization = model.interval(best, 0)
    if not quantization.observable:
        best = model.without(best, 0)
    found = {letter: model.interval(best, k) for k, letter in enumerate(LETTERS) if k}
    return {LETTERS[0]: quantization, **found, "R": model.ramp(best)}, best


def departures(
    spectrum: Spectrum, found: Fit, group: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.bool_], float, float]]:
    """Part by which the power of each group of bins departs from a fit.

    Parameters
    ----------
    spectrum : Spectrum
        The one that was fitted.
    found : Fit
        The fit.
    group : ndarray (m,)
        Group of each bin; of those below 0 nothing is asked.

    Yields
    ------
    inside : ndarray (m,) of bool
        Bins of the group.
    excess, sd : float
        Mean of power over density, less 1; and the standard deviation that chance gives it.
    """
    ratio = spectrum.without_ramp(found.ramp) / found.density
    for i in np.unique(group[group >= 0]):
        inside = group == i
        count = float(spectrum.terms[inside].sum())
        yield inside, float(np.sum(ratio[inside])) / count - 1.0, math.sqrt(2.0 / count)


def most_likely(best: Fit, ramp: Coefficient) -> dict[str, float]:
    """Values of all five terms that together are the most likely, observable or not.

    But a ramp only where it is observable: else its slope is that of the random walk, which has been counted.
    """
    random = {letter: math.exp(best.logs[k]) for k, letter in enumerate(LETTERS)}
    return {**random, "R": abs(best.ramp) if ramp.observable else 0.0}


def is_more_than(spectrum: Spectrum, best: Fit, shown: Sequence[str]) -> bool:
    """Whether the record holds more than the terms `shown`, though none of the others stands out by itself."""
    model = _Model(spectrum, best.logs.size > len(LETTERS))
    bare = best
    for k, letter in enumerate(LETTERS):
        if letter not in shown:
            bare = model.without(bare, k)
    return model.search(bare.logs, held=[k for k, w in enumerate(LETTERS) if w not in shown]).deviance > (
        best.deviance + CLEARLY
    )


def markov_coefficients(spectrum: Spectrum, best: Fit) -> tuple[Coefficient, Coefficient]:
    """Standard deviation and correlation time of the Gauss–Markov process of a fit, with intervals."""
    model = _Model(spectrum, True)
    sd, time = (model.interval(best, len(LETTERS) + k) for k in range(2))
    return sd, time


class _Model:
    """Density and likelihood of one spectrum as functions of the logarithms of the coefficients."""

    def __init__(self, spectrum: Spectrum, markov: bool) -> None:
        self.spectrum = spectrum
        self.rows = densities(spectrum)
        self.terms = spectrum.terms
        self.mean = spectrum.power / self.terms
        self.process = MarkovDensity(spectrum) if markov else None

    def begin(self, markov_time: float | None) -> Floats:
        """Terms that each touch the spectrum from below, as the tangents of a curve do."""
        smooth = _smoothed(self.spectrum, self.mean)
        rows = self.rows if markov_time is None else [*self.rows, MarkovDensity(self.spectrum)(markov_time)]
        logs = [0.5 * math.log(0.5 * np.min(smooth / row)) for row in rows]
        return np.array(logs if markov_time is None else [*logs, math.log(markov_time)])

    def density(self, logs: Floats) -> tuple[Floats, Floats]:
        """Density (m,) and its derivatives (p, m) by the logarithms."""
        parts = np.exp(2.0 * logs[: len(LETTERS), np.newaxis]) * self.rows
        if self.process is None:
            return np.add.reduce(parts), 2.0 * parts
        power, time = math.exp(2.0 * logs[4]), math.exp(logs[5])
        process = power * self.process(time)
        step = 1e-4
        ahead, behind = (power * self.process(time * math.exp(s)) for s in (step, -step))
        slope = (ahead - behind) / (2.0 * step)
        return np.add.reduce(parts) + process, np.vstack((2.0 * parts, 2.0 * process, slope))

    def evaluate(self, logs: Floats) -> tuple[float, Floats, Fit]:
        """Half the deviance, its gradient, and the fit that these values would be."""
        s, terms = self.spectrum, self.terms
        density, slopes = self.density(logs)
        square = float(np.add.reduce(s.ramp / density))
        ramp = float(np.add.reduce(s.cross / density)) / square
        share = s.without_ramp(ramp) / density
        half = 0.5 * float(np.add.reduce(terms * np.log(density) + share)) + 0.5 * math.log(square)
        gradient = 0.5 * slopes @ ((terms - share) / density - s.ramp / density**2 / square)
        relative = slopes / density
        information = 0.5 * (relative * terms) @ relative.T
        return half, gradient, Fit(logs, information, 2.0 * half, ramp, 1.0 / math.sqrt(square), density)

    def search(self, logs: Floats, held: Sequence[int] = ()) -> Fit:
        """Fisher scoring with damping, from `logs`, with some of them held."""
        half, gradient, now = self.evaluate(logs)
        damping = 1e-3
        for _ in range(_ROUNDS):
            free = [k for k in self._present(now) if k not in held]
            if not free:
                break
            now_at = half
            while damping < 1e8:
                step = _damped(now.information, gradient, free, damping)
                trial = self.evaluate(now.logs + step)
                if trial[0] <= half:
                    break
                damping *= 4.0
            else:
                break
            half, gradient, now = trial
            damping = max(damping / 10.0, 1e-9)
            if np.abs(step).max() < _SMALL_STEP or now_at - half < 1e-9:
                break
        return now

    def _present(self, now: Fit) -> list[int]:
        """Parameters that the density still feels; the logarithm of a term that is not there runs away for ever."""
        shares = np.maximum.reduce(now.squares[:, np.newaxis] * self.rows / now.density, axis=1).tolist()
        return [k for k in range(now.logs.size) if k >= len(LETTERS) or shares[k] > _ABSENT]

    def interval(self, best: Fit, k: int) -> Coefficient:
        """Coefficient k with its interval."""
        sd = _sd_of_log(best, k)
        value = math.exp(best.logs[k])
        if sd < _SHARP:
            return Coefficient(value, value * math.exp(-sd), value * math.exp(sd), value * math.exp(1.645 * sd))
        values, profile, _ = self._profile(best, k)
        lo, median, hi, upper = _quantiles(values, profile)
        clear = float(profile.max() - profile[0]) >= 0.5 * CLEAR**2
        return Coefficient(median, lo, hi, upper, clear)

    def ramp(self, best: Fit) -> Coefficient:
        """R with its interval: how well it is known depends on how large the random walk is, which is uncertain too."""
        from scipy.special import ndtr

        weights, fits = np.ones(1), [best]
        if _sd_of_log(best, _WALK) >= _SHARP:
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

    def without(self, best: Fit, k: int) -> Fit:
        """The fit without term k."""
        logs = best.logs.copy()
        logs[k] = _NOTHING
        return self.search(logs, held=(k,))

    def _profile(self, best: Fit, k: int) -> tuple[Floats, Floats, list[Fit]]:
        """Ln likelihood, all others at their best, over values of coefficient k from nothing to where it has fallen."""
        top = math.exp(best.logs[k]) * 1.5
        while self._at(best, k, top).deviance - best.deviance < 9.0:  # three standard deviations
            top *= 1.5
        values = np.linspace(0.0, top, _GRID)
        now, fits = best, []
        for value in values[::-1]:
            now = self._at(now, k, max(value, 1e-6 * top))
            fits.append(now)
        found = -0.5 * np.array([f.deviance for f in fits[::-1]])
        return values, found - found.max(), fits[::-1]

    def _at(self, start: Fit, k: int, value: float) -> Fit:
        logs = start.logs.copy()
        logs[k] = math.log(value)
        return self.search(logs, held=(k,))


def _damped(information: Floats, gradient: Floats, free: list[int], damping: float) -> Floats:
    step = np.zeros(gradient.size)
    matrix = information[free][:, free]
    diagonal = matrix.diagonal()
    added = damping * diagonal, 1e-12 * diagonal.max()
    matrix.flat[:: len(free) + 1] += added[0]
    matrix.flat[:: len(free) + 1] += added[1]
    step[free] = -np.linalg.solve(matrix, gradient[free])
    return np.minimum(np.maximum(step, -1.0), 1.0)


def _sd_of_log(best: Fit, k: int) -> float:
    diagonal = np.sqrt(np.maximum(np.diag(best.information), 1e-12))
    inverse = np.linalg.pinv(best.information / np.outer(diagonal, diagonal), hermitian=True)
    return float(math.sqrt(max(inverse[k, k], 0.0)) / diagonal[k])


def _quantiles(values: Floats, profile: Floats) -> list[float]:
    from scipy.interpolate import PchipInterpolator

    fine = np.linspace(values[0], values[-1], 4001)
    weight = np.exp(PchipInterpolator(values, profile)(fine))
    share = np.concatenate(([0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]))))
    return [float(v) for v in np.interp(_QUANTILES, share / share[-1], fine)]


def _smoothed(spectrum: Spectrum, mean: Floats) -> Floats:
    """Mean density with a χ² of at least 16 coefficients behind each value, so that a minimum means something."""
    total = np.cumsum(np.concatenate(([0.0], mean * spectrum.terms)))
    count = np.concatenate(([0.0], np.cumsum(spectrum.terms)))
    ahead = np.minimum(np.searchsorted(count, count[:-1] + 16.0), mean.size)
    behind = np.minimum(np.arange(mean.size), np.searchsorted(count, max(count[-1] - 16.0, 0.0), side="right"))
    return np.asarray((total[ahead] - total[behind]) / np.maximum(count[ahead] - count[behind], 1.0))
