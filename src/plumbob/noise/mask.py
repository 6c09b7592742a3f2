"""Which high frequencies, and so which short averaging times, no fit may use: those that the device itself has shaped.

A low-pass filter in the device, or noise that sampling folds down, bends the spectrum as none of the terms does. One
bent octave spoils all coefficients: it holds more samples than all lower ones together.
"""

import math

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.noise.densities import densities
from plumbob.noise.findings import Mask
from plumbob.noise.likelihood import Fit, departures, fit
from plumbob.noise.spectrum import Spectrum
from plumbob.noise.transfer import FAR, allan_transfer

_BENT = 0.2  # of the density: from here on something has shaped it
_MARGIN = 2.0**1.5  # a low-pass of first order that takes 6 % at a frequency takes 0.8 % so much further down
_TOLERATED = 0.03  # of the density: what unevenness is nobody's filter
_SURE = 4.0  # standard deviations
_JUDGED = 2.0  # octaves below the cut whose fit is judged
_PER_OCTAVE = 4
_LEAST = 100.0  # coefficients without which nothing can be judged
_SHARE = 0.02  # of an Allan variance that may come from masked frequencies


def find_mask(spectrum: Spectrum, n: NDArray[np.int64]) -> tuple[Mask, Spectrum]:
    """Mask of a record, and the spectrum below it.

    A spectrum that is bent somewhere in its highest octaves is cut, in half octaves from half the sampling rate down,
    until the terms fit the octaves next to the cut; and once more by `_MARGIN`, for a bend that is not seen yet has
    already begun. Mere unevenness is no bend: real sensors have some per cent of it.

    Parameters
    ----------
    spectrum : Spectrum
        Of the record.
    n : ndarray (m,)
        Averaging factors that there are, increasing.
    """
    cut, kept = 0.5 / spectrum.step, spectrum
    found = fit(kept)
    if _fits(kept, found, cut, _BENT):
        return Mask(), spectrum
    while not _fits(kept, found, cut, _TOLERATED):
        cut /= math.sqrt(2.0)
        kept = spectrum.below(cut)
        if kept.terms.sum() < _LEAST:  # bent everywhere: no filter of the device, but no noise of these terms either
            return Mask(reason="no frequency could be found below which the terms fit; nothing masked"), spectrum
        found = fit(kept)
    safe = spectrum.below(cut / _MARGIN)
    if safe.terms.sum() >= _LEAST:
        cut, kept, found = cut / _MARGIN, safe, fit(safe)
    factor, excess = _first_factor(spectrum, found, cut, n)
    reason = f"the spectrum {'falls' if excess < 0.0 else 'rises'} there as none of the terms does"
    return Mask(factor, cut, reason), kept


def mask_first_order(spectrum: Spectrum, time: float, n: NDArray[np.int64]) -> tuple[Mask, Spectrum | None]:
    """Mask of a record that a filter of first order has smoothed, and the spectrum below it, if that is enough to fit.

    Such a filter makes a Gauss–Markov process of white noise, whose spectrum falls like that of a random walk: nothing
    that the highest octaves alone would tell.

    Parameters
    ----------
    spectrum : Spectrum
        Of the record.
    time : float
        Time constant of the filter, s.
    n : ndarray (m,)
        Averaging factors that there are, increasing.
    """
    cut = float(np.sqrt(_TOLERATED)) / (2.0 * np.pi * time)
    reason = f"the record looks smoothed, as by a filter of first order with a time constant of {time:.2g} s"
    kept = spectrum.below(cut)
    if kept.terms.sum() >= _LEAST:
        factor, _ = _first_factor(spectrum, fit(kept), cut, n)
        return Mask(factor, cut, reason), kept
    beyond = int(n[min(int(np.searchsorted(n * spectrum.dt, FAR * time)), n.size - 1)])
    return Mask(beyond, cut, f"{reason}; it is too short to tell more than that"), None


def _fits(spectrum: Spectrum, found: Fit, cut: float, tolerated: float) -> bool:
    """Whether no part of the octaves below the cut departs from a fit by more than what is tolerated, or by chance."""
    group = np.floor(np.log2(cut / spectrum.frequency) * _PER_OCTAVE).astype(np.int64)
    judged = np.where(group < _JUDGED * _PER_OCTAVE, group, -1)
    return not any(abs(excess) > max(tolerated, _SURE * sd) for _, excess, sd in departures(spectrum, found, judged))


def _first_factor(spectrum: Spectrum, found: Fit, cut: float, n: NDArray[np.int64]) -> tuple[int, float]:
    """Smallest factor from which on masked frequencies hardly count, and what they add to the spectrum on the whole."""
    model = found.squares @ densities(spectrum)
    width = spectrum.width
    weights = _mean_transfer(n, spectrum)
    beyond = spectrum.frequency > cut
    excess = (spectrum.power / spectrum.terms - model) * width * beyond
    share = np.abs(weights @ excess) / (weights @ (model * width))
    large = np.flatnonzero(share > _SHARE)
    first = int(n[min(large[-1] + 1, n.size - 1)]) if large.size else int(n[0])
    return first, float(excess.sum())


def _mean_transfer(n: NDArray[np.int64], spectrum: Spectrum) -> Floats:
    """Transfer averaged over each bin at a few places of it."""
    places = np.random.default_rng(0).uniform(-0.5, 0.5, size=(8, spectrum.width.size)) * spectrum.width
    return np.asarray(np.mean([allan_transfer(n, spectrum.frequency + p, spectrum.dt) for p in places], axis=0))
