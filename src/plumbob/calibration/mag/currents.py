"""Field of currents: what throttle, a measured current or the speed of a wheel adds to the magnetometer, per unit.

A wire or a motor beside the sensor adds ``S u`` to what it measures: u its load, S (3, K) fixed to the body. The field
of the Earth turns with the body, so within some seconds, whatever the attitude, ::

    R (m − S u − b) = h      R by the gyroscope since the start of a window, h the same for all of its samples

Without their mean over the window these are linear equations in S, in what is left of the hard iron b and in the bias
of the gyroscope, which turns R. They hold at rest too, where R is constant. Large misfits count less
[Holland1977]; the covariance is that of how windows differ [Liang1986]. What is fitted is then doubted: it must not be
chance, be the same in other attitudes and at other times, and grow in proportion to the load.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.ellipsoid_fit import CAUCHY, MAD
from plumbob.calibration.fit import Fitted, Reason, refuse
from plumbob.calibration.mag.windows import GAP, floored_inverse
from plumbob.core.check import Floats
from plumbob.core.findings import Note, info, warning
from plumbob.data.cards import TriadCalibration
from plumbob.rotations import dcm_from_quat, quat_chained, skew

WINDOW: Final = 5.0  # s; meanwhile a gyroscope without a card drifts by a few degrees at most
FEWEST: Final = 6.0  # windows in which the load changes, as many as they count
_CHANCE: Final = 1e-3  # that noise alone looks so
_ROUNDS, _TURNS = 20, 3


class _LoadEquations(NamedTuple):
    """Rows (N, 3) of all windows, less the mean of each."""

    by_load: Floats  # (N, 3, 3 K), derivatives by S, load by load
    by_others: Floats  # (N, 3, P), by hard iron and the gyroscope's bias, without what does not count
    field: Floats  # (N, 3), µT
    bowed: Floats  # (N, 3, 3 K), derivatives by what half a load adds beyond half of what it adds
    window: NDArray[np.intp]  # (N,), number of the window
    heading: Floats  # (W, 3), mean field of each window in body axes, which tells attitudes apart


class _LoadSolution(NamedTuple):
    """Entries of S (n,), their covariance (n, n), and residuals (N, 3), µT."""

    value: Floats
    covariance: Floats
    residuals: Floats
    others: Floats  # (P,), hard iron, and the gyroscope's bias with its sign changed


def fit_currents(
    t: Floats, mag: Floats, load: Floats, gyr: Floats | None, base: TriadCalibration, names: tuple[str, ...]
) -> Fitted:
    """Complete the magnetometer's part of a card by what each unit of a load adds, µT in each axis.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    mag : ndarray (N, 3)
        As measured, µT; NaN where there is none.
    load : ndarray (N, K)
        Throttle, current or speed at each sample, in any unit.
    gyr : ndarray (N, 3) or None
        Rates, rad/s; without, the unit must have lain still.
    base : TriadCalibration
        What is known of the magnetometer.
    names : tuple of str
        What the loads are called.

    Raises
    ------
    CaptureRefusedError
        If the load does not change, or what it does to the field is chance or cannot be removed.
    """
    measured, rates = (mag - base.bias) @ base.matrix.T, np.zeros_like(mag) if gyr is None else gyr
    use = np.isfinite(np.column_stack((measured, load, rates))).all(axis=1)
    t, measured, load, rates = t[use], measured[use], load[use], rates[use]
    span, named = np.ptp(load, axis=0) if len(load) else np.zeros(len(names)), ", ".join(names)
    again = "Record while it rises and falls several times, at rest or while moving."
    refuse(Reason("no-load", f"{named} did not change.", again) if (span == 0.0).any() else None)
    scaled = (load - load.min(axis=0)) / span
    rows = _equations(t, measured, scaled, rates)
    each = np.bincount(rows.window, np.sum(rows.by_load**2, axis=(1, 2)))
    count = float(each.sum() ** 2 / max(float(each @ each), 1e-300))
    few = f"{named} changed in {count:.1f} windows of {WINDOW:.0f} s, but {FEWEST:.0f} are needed."
    refuse(Reason("no-load", few, again) if count < FEWEST else None)
    fit = _solved(rows, rows.by_load)
    for _ in range(_TURNS if fit.others.size else 0):  # with a better attitude
        rates = rates + fit.others[3:]
        rows = _equations(t, measured, scaled, rates)
        fit = _solved(rows, rows.by_load)
    size = _largest(fit.value)
    typical = MAD * float(np.median(np.abs(fit.residuals)))
    noise = MAD * float(np.median(np.abs(np.diff(fit.residuals, axis=0)))) / math.sqrt(2.0)
    turned = gyr is None and typical > 3.0 * noise  # nine parts in ten are slower than the noise of a still sensor
    loose = f"the field scattered by {typical:.2g} µT, its noise is {noise:.2g} µT, and no rates tell turns."
    refuse(Reason("not-still", loose, "Record the gyroscope too, or let the unit lie still.") if turned else None)
    chance = _chance(fit.value, fit.covariance, count)
    quiet = f"{named} adds {size:.2g} µT, as noise alone may (p = {chance:.2g})."
    refuse(Reason("no-gain", quiet, "There is nothing to remove; or record for longer.") if chance > _CHANCE else None)
    covariance, remarks = fit.covariance, list[Note]()
    for what, off, spread in _departures(rows, fit):
        if _chance(off, spread, count) < _CHANCE:
            text = f"what {named} adds {what}: {_largest(off):.2g} of {size:.2g} µT cannot be removed."
            wires = "Take the current itself as the column, twist each pair of wires, or move the magnetometer away."
            refuse(Reason("load-departs", text, wires) if _largest(off) > 0.5 * size else None)
            covariance = covariance + np.outer(off, off)
            remarks.append(warning("calibration.load_departs", load=named, what=what, off=_largest(off), size=size))
    back = np.kron(np.diag(1.0 / span), np.linalg.inv(base.matrix))  # to what is measured, per unit
    remaining = math.sqrt(float(np.trace(covariance)))
    per_load = (back @ fit.value).reshape(-1, 3)
    calibration = replace(
        base, per_load=per_load, loads=names,
        per_load_sd=np.sqrt(np.diag(back @ covariance @ back.T)).reshape(-1, 3),
        method=f"{base.method}; field of {named}".removeprefix("; "),
    )  # fmt: skip
    note = info("calibration.load", load=named, size=size, left=remaining)
    off_line = np.linalg.norm(fit.residuals, axis=1)
    without = mag[use] - load @ per_load
    return Fitted(calibration, without, off_line, np.ones(len(t), dtype=np.bool_), (note, *remarks))


def _equations(t: Floats, measured: Floats, load: Floats, rates: Floats) -> _LoadEquations:
    """Rows of a record whose loads go from 0 to 1."""
    dt = np.diff(t)[:, np.newaxis]
    turns = dcm_from_quat(quat_chained(0.5 * dt * (rates[1:] + rates[:-1])))
    gaps = np.concatenate(([0], np.cumsum(dt > GAP)))
    _, first, window = np.unique(
        np.column_stack((gaps, (t - t[0]) // WINDOW)), axis=0, return_index=True, return_inverse=True
    )
    window = np.asarray(window).reshape(-1)
    leans = np.concatenate((np.zeros((1, 3, 3)), np.cumsum(turns[:-1] * dt[:, np.newaxis], axis=0)))
    leans -= leans[first][window]
    field = np.einsum("nij,nj->ni", turns, measured)
    curved = 4.0 * load * (1.0 - load)
    by_load, bowed = (np.einsum("nij,nk->nikj", turns, u).reshape(len(t), 3, -1) for u in (load, curved))
    by_others = np.concatenate((turns, skew(field) @ leans), axis=2)
    by_load, by_others, field, bowed = (_centred(values, window) for values in (by_load, by_others, field, bowed))
    counts = by_others.any(axis=(0, 1)) if rates.any() else np.zeros(6, dtype=np.bool_)
    sums = np.stack([np.bincount(window, column) for column in measured.T], axis=1)
    return _LoadEquations(
        by_load, by_others[:, :, counts], field, bowed, window, sums / np.bincount(window)[:, np.newaxis]
    )


def _centred(values: Floats, window: NDArray[np.intp]) -> Floats:
    """Values (N, …) less their mean over each window (N,)."""
    flat = values.reshape(len(values), -1)
    means = np.stack([np.bincount(window, column) for column in flat.T], axis=1) / np.bincount(window)[:, np.newaxis]
    return np.asarray((flat - means[window]).reshape(values.shape))


def _solved(rows: _LoadEquations, columns: Floats) -> _LoadSolution:
    """Coefficients of some columns (N, 3, n) beside those of the others, by Cauchy's weights."""
    n, every = columns.shape[2], np.concatenate((columns, rows.by_others), axis=2)
    weight, value = np.ones(len(every)), np.zeros(every.shape[2])
    for _ in range(_ROUNDS):
        weighted = every * weight[:, np.newaxis, np.newaxis]
        inverse = floored_inverse(np.einsum("nip,niq->pq", weighted, every))
        before, value = value, inverse @ np.einsum("nip,ni->p", weighted, rows.field)
        residuals = rows.field - every @ value
        scale = max(MAD * float(np.median(np.abs(residuals))), 1e-9)
        weight = 1.0 / (1.0 + np.sum(residuals**2, axis=1) / (math.sqrt(3.0) * CAUCHY * scale) ** 2)  # [Holland1977]
        if np.abs(value - before)[:n].max() < 1e-6 * scale:
            break
    scores = np.einsum("nip,ni->np", weighted, residuals)
    sums = np.stack([np.bincount(rows.window, column) for column in scores.T], axis=1)
    count = len(sums)
    spread = inverse @ sums.T * math.sqrt(count / max(1.0, count - min(n, 0.5 * count)))  # [Liang1986]
    return _LoadSolution(value[:n], np.asarray(spread @ spread.T)[:n, :n], residuals, value[n:])


def _departures(rows: _LoadEquations, fit: _LoadSolution) -> Iterator[tuple[str, Floats, Floats]]:
    """What a straight line in body axes leaves at most: in words, the field of each load, and its covariance."""
    n = len(fit.value)
    heading = rows.heading - rows.heading.mean(axis=0)
    apart = heading @ np.linalg.svd(heading, full_matrices=False)[2][0]
    late = np.arange(len(apart)) - 0.5 * (len(apart) - 1)
    halves = (np.where(each > np.median(each), 1.0, -1.0)[rows.window] for each in (apart, late))
    other, later = (half[:, np.newaxis, np.newaxis] * rows.by_load for half in halves)
    doubts = {"is not proportional to it": rows.bowed, "differs in other attitudes": other, "differs later": later}
    for what, columns in doubts.items():
        both = _solved(rows, np.concatenate((rows.by_load, columns), axis=2))
        yield what, both.value[n:], both.covariance[n:, n:]


def _largest(entries: Floats) -> float:
    """Largest field of one load, µT."""
    return float(np.linalg.norm(entries.reshape(-1, 3), axis=1).max())


def _chance(value: Floats, covariance: Floats, count: float) -> float:
    """Probability that noise makes as much, whose covariance so many windows tell."""
    from scipy.special import fdtrc

    squares = float(value @ np.linalg.pinv(covariance, hermitian=True) @ value)
    return float(fdtrc(value.size, max(1.0, count - value.size), squares / value.size))
