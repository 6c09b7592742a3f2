"""How long a record must be to show a term: the same information that gives intervals, for records not yet taken."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np

from plumbob.check import Floats
from plumbob.noise.densities import LETTERS, densities
from plumbob.noise.findings import Coefficient
from plumbob.noise.spectrum import Spectrum, edges, ramp_coefficients

SHOWN: Final = 3.0
"""A record shows a term when the coefficient is so many of its standard deviations."""
LONGEST: Final = 10_000.0
"""Hours beyond which no length is named: more than a year."""

_RAMP = 64  # coefficients in which all is that is known about a ramp, but for 1e-4
_STEPS = np.arange(0.0, 40.0)  # of √2 in length


def with_hours(terms: Mapping[str, Coefficient], dt: float, duration: float) -> dict[str, Coefficient]:
    """Say for each term that the record does not show how long one would have to be that shows half of its limit.

    Parameters
    ----------
    terms : mapping of str to Coefficient
        By letter.
    dt : float
        Sampling time, s.
    duration : float
        Of the record, s.
    """
    return {letter: replace(c, hours=_hours(letter, terms, dt, duration)) for letter, c in terms.items()}


def _hours(letter: str, terms: Mapping[str, Coefficient], dt: float, duration: float) -> float | None:
    asked = terms[letter]
    size = 0.5 * asked.upper
    if asked.observable or not size > 0.0:
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
