"""Which model a record asks for: the five terms alone, or a first-order Gauss–Markov process with them."""

import math
from typing import Final, NamedTuple

import numpy as np

from plumbob.noise.densities import densities
from plumbob.noise.findings import Candidate, GaussMarkov
from plumbob.noise.likelihood import Fit, fit, markov_coefficients
from plumbob.noise.spectrum import Spectrum

BETTER: Final = 10.0
"""By so much must the criterion of Schwarz be smaller for a Gauss–Markov process to be taken in: strong evidence."""

_FIVE, _SEVEN = "Q N B K R", "Q N B K R + Gauss-Markov"
_TIMES = 7  # correlation times from which the search for a Gauss–Markov process starts
_INSIDE = 4.0  # times must a process's corner lie below the highest frequency; nearer, it is the device's filter


class Choice(NamedTuple):
    """A model of a record.

    Attributes
    ----------
    best : Fit
        The fit that was chosen.
    markov : GaussMarkov or None
        Its Gauss–Markov process.
    candidates : tuple of Candidate
        What was weighed.
    notes : tuple of str
        What a reader must know of it.
    smoothed : float or None
        Where nothing but that process is left at high frequencies: the time constant, s, of the filter that would make
        it of white noise. A sensor without any white noise is yet to be built.
    """

    best: Fit
    markov: GaussMarkov | None
    candidates: tuple[Candidate, ...]
    notes: tuple[str, ...]
    smoothed: float | None = None


def choose(kept: Spectrum) -> Choice:
    """Fit with or without a Gauss–Markov process, by the criterion of Schwarz [Schwarz1978].

    Parameters
    ----------
    kept : Spectrum
        Of the frequencies that no filter has bent.
    """
    plain = fit(kept)
    low, high = _INSIDE / (2.0 * math.pi * float(kept.frequency[-1])), 0.1 * kept.count * kept.step
    starts = np.geomspace(low, high, _TIMES) if high > low else ()
    fits = (fit(kept, markov_time=float(t)) for t in starts)
    richer = min((f for f in fits if math.exp(f.logs[-1]) > low), key=lambda f: f.deviance, default=None)
    if richer is None:
        return Choice(plain, None, (Candidate(_FIVE, 0.0, chosen=True),), ())
    worse = richer.deviance + 2.0 * math.log(float(kept.terms.sum())) - plain.deviance  # by its criterion
    taken = worse < -BETTER
    markov = GaussMarkov(*markov_coefficients(kept, richer)) if taken else None
    least = min(worse, 0.0)
    candidates = Candidate(_FIVE, -least, not taken), Candidate(_SEVEN, worse - least, taken)
    notes = (_tie(richer),) if abs(worse) <= BETTER else ()
    if not taken:
        return Choice(plain, None, candidates, notes)
    smoothed = math.exp(richer.logs[-1]) if _alone_at_the_top(kept, richer) else None
    return Choice(richer, markov, candidates, notes, smoothed)


def _alone_at_the_top(kept: Spectrum, richer: Fit) -> bool:
    """Whether the process makes more of the highest frequencies than all other terms."""
    others = float(richer.squares @ densities(kept)[:, -1])
    return others < 0.5 * float(richer.density[-1])


def _tie(richer: Fit) -> str:
    time = math.exp(richer.logs[-1])
    return (
        f"a Gauss-Markov process with a correlation time of about {time:.2g} s would explain the record as well "
        "as bias instability does; it cannot tell which"
    )
