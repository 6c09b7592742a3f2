"""Narrow bands of motion or interference in a spectrum: found, left out of the likelihood, and told.

A structure that swings, a machine next door or a supply's ripple puts its power into a band that is wider than a line
and narrower than an octave. No term has such a shape: a fit that must explain it takes the power for quantization or
bias instability, and cutting everything above it throws the white noise away. What is outside of the band is as good as
before, so only the band is left out.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.noise.densities import densities
from plumbob.noise.findings import Band, Mask
from plumbob.noise.likelihood import Fit, fit
from plumbob.noise.mask import find_mask
from plumbob.noise.spectrum import Spectrum
from plumbob.runs import runs

Inside = NDArray[np.bool_]

_REACH = 0.75  # octaves to either side whose median is the floor round about
_LOWEST = 64  # coefficients: 32 cycles in the record; below, a slow wander cannot be told from a band
_RUNS = (1, 2, 4, 8)  # bins together in which a band is looked for
_SURE = 5.0  # standard deviations above the floor
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
    whole: Spectrum
    """With the frequencies above the mask, but without the bands."""


def leave_out(spectrum: Spectrum, n: NDArray[np.int64]) -> LeftOut:
    """Find the bands and the mask of a record.

    Parameters
    ----------
    spectrum : Spectrum
        Of the record.
    n : ndarray (m,)
        Averaging factors that there are, increasing.
    """
    inside = _cores(spectrum)
    if not inside.any():
        return LeftOut((), *find_mask(spectrum, n), spectrum)
    mask, kept = find_mask(spectrum.only(~inside), n)
    usable = np.arange(spectrum.start.size) < np.searchsorted(spectrum.start, kept.stop[-1])
    found = fit(kept)
    for _ in range(_ROUNDS):
        grown = _grown(spectrum, found, inside, usable)
        if (grown == inside).all():
            break
        inside = grown
        kept = spectrum.only(usable & ~inside)
        found = fit(kept)
    bands = tuple(_band(spectrum, found, one) for one in _runs(inside) if usable[one].all())
    return LeftOut(tuple(sorted(bands, key=lambda b: -b.sd)), mask, kept, spectrum.only(~inside))


def _cores(spectrum: Spectrum) -> Inside:
    """Bins that stand above those round about by more than noise does, and by more than a sensor is uneven."""
    inside = np.zeros(spectrum.start.size, dtype=bool)
    first = int(np.searchsorted(spectrum.start, _LOWEST))
    terms = spectrum.terms[first:]
    if terms.size < 4 * max(_RUNS):
        return inside
    floor = terms * _floor(spectrum.power[first:] / terms, spectrum.frequency[first:])
    for run in _RUNS:
        power, below, count = (_sums(row, run) for row in (spectrum.power[first:], floor, terms))
        ratio, spread = power / below, 2.0 / (9.0 * count)
        sure = (np.cbrt(ratio) - (1.0 - spread)) / np.sqrt(spread)  # [Wilson1931]: of a χ², as if it were normal
        for k in np.flatnonzero((sure > _SURE) & (ratio > _TALL)).tolist():
            inside[first + k : first + k + run] = True
    for one in _runs(inside):
        low, high = spectrum.frequency[one][[0, -1]]
        if math.log2(high / low) > _NARROW:
            inside[one] = False
    return inside


def _floor(mean: Floats, frequency: Floats) -> Floats:
    """Median of the bins as far below as above, `_REACH` at most: of a slope, its own middle."""
    octave = np.log2(frequency)
    behind = np.arange(mean.size) - np.searchsorted(octave, octave - _REACH)
    ahead = np.searchsorted(octave, octave + _REACH, side="right") - np.arange(mean.size) - 1
    reach = np.minimum(behind, ahead)
    return np.array([np.median(mean[i - r : i + r + 1]) for i, r in enumerate(reach.tolist())])


def _sums(row: Floats, run: int) -> Floats:
    total = np.concatenate(([0.0], np.cumsum(row)))
    return np.asarray(total[run:] - total[:-run])


def _grown(spectrum: Spectrum, found: Fit, inside: Inside, usable: Inside) -> Inside:
    """Bands with their skirts: as far as the power is above the fit by more than chance, and by more than little."""
    model = spectrum.terms * (found.squares @ densities(spectrum))
    excess = spectrum.without_ramp(found.ramp) - model
    grown = inside.copy()
    for one in _runs(inside):
        peak = spectrum.frequency[one][np.argmax((excess / spectrum.terms)[one])]
        near = usable & (np.abs(np.log2(spectrum.frequency / peak)) <= _WIDEST) & (spectrum.start >= _LOWEST)
        for outward in (range(one.start - 1, -1, -1), range(one.stop, near.size)):
            for at in range(0, len(outward) - _STEP + 1, _STEP):
                step = np.array(outward[at : at + _STEP])
                chance = 2.0 * math.sqrt(2.0 / float(spectrum.terms[step].sum()))
                if not near[step].all() or excess[step].sum() < max(_SKIRT, chance) * model[step].sum():
                    break
                grown[step] = True
    return grown


def _band(spectrum: Spectrum, found: Fit, one: slice) -> Band:
    """Limits and power of a band, as it is in the samples."""
    frequency = spectrum.frequency[one]
    model = (found.squares @ densities(spectrum))[one]
    power = (spectrum.without_ramp(found.ramp)[one] / spectrum.terms[one] - model) * spectrum.width[one]
    d, turn = spectrum.averaged, np.pi * frequency * spectrum.dt
    power = np.maximum(power, 0.0) * (d * np.sin(turn) / np.sin(d * turn)) ** 2
    share = np.cumsum(power) / np.sum(power)
    places = np.interp((np.arange(_PLACES) + 0.5) / _PLACES, share, frequency)
    half = 0.5 * spectrum.width[one]
    low, high = float(frequency[0] - half[0]), float(frequency[-1] + half[-1])
    return Band(low, high, math.sqrt(2.0 * float(np.sum(power))), tuple(places.tolist()), spectrum.dt)


def _runs(inside: Inside) -> list[slice]:
    return [slice(*run) for run in runs(inside)]
