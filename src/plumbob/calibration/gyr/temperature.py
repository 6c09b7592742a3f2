"""Bias over temperature, of a gyroscope or another triad: a polynomial of one unit, from a soak at rest.

The record is averaged in equal blocks; the mean of each power of the temperature over a block is the regressor, so the
polynomial is that of the samples however much the temperature changes within a block. A bias also wanders by itself,
and a wander that takes as long as the soak would pass for a curve: each axis is taken for white noise with a random
walk, whose ratio the record gives by its restricted likelihood [Patterson1971]. The degree is the lowest that the
highest one does not improve on by the F test.

Departure from [Chen2013], whose coefficient of 0.1 °/s/°C is one for all parts: here each unit has its own, by axis,
with as many powers as it shows.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import RATE, Fitted, Reason, grade_of, refuse
from plumbob.calibration.gyr import rest as resting
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.findings import Note, info
from plumbob.core.units import from_si, to_dps, written
from plumbob.data import TITLES
from plumbob.data.cards import Quality, TriadCalibration
from plumbob.quality.static_periods import stills

LEAST_SPAN: Final = 5.0  # smallest span of temperature that shows a slope, K
LEAST_REST: Final = 0.9  # smallest share of the record that must be at rest
WINDOW: Final = 300.0  # time within which the field must not turn, s
HIGHEST: Final = 3  # highest degree
SIGNIFICANCE: Final = 0.001  # chance at which a power that is not there is taken for one
SURE: Final = 4.0  # standard deviations above which warming and cooling differ
BLOCKS: Final = 200  # blocks that a record is averaged in; of the length of `SHORTEST` at least
SHORTEST: Final = 5.0  # shortest block, s
FEWEST: Final = 20  # fewest blocks
_RATIOS = np.logspace(-5.0, 3.0, 41)  # from nothing that is seen in 200 blocks to nothing but a random walk
USUAL: Final = 25.0  # temperature at which data sheets state a bias, °C


def fit_temperature(rates: resting.Rates) -> Fitted:
    """Polynomial of a gyroscope's bias, of degree 1 to 3; matrix and g-sensitivity known so far are kept."""
    t, base, mag = rates.t, rates.known, rates.mag
    gyr = check.rows("gyr", rates.gyr, 3, t.size)
    temperature = _required_temperature(t, gyr, rates.temp_c, rates.clipped, "gyr")
    refuse(resting.dead_axes(gyr))
    reference = _reference(temperature)
    steady = replace(base, bias_per_k=np.zeros((1, 3)))
    corrected = resting.without_known(rates._replace(gyr=gyr, known=steady))
    rest = _rest(t, rates.acc, corrected, temperature)
    refuse(None if mag is None else _turning(t, mag))
    blocks = _blocks(t, np.where(rest[:, np.newaxis], corrected, np.nan), temperature, reference)
    fit = _choose(blocks)
    refuse(resting.beyond_bias(fit.bias))
    fitted = _fitted(fit, blocks, temperature, base, float(t[-1] - t[0]))
    return replace(
        fitted, remarks=(*resting.unseen_turn(rates._replace(acc=None), [slice(0, t.size)]), *fitted.remarks)
    )


def fit_drift(
    triad: str,
    t: Floats,
    values: Floats,
    temp_c: Floats | None,
    base: TriadCalibration,
    *,
    acc: Floats | None = None,
    gyr: Floats | None = None,
    clipped: NDArray[np.bool_] | None = None,
) -> Fitted:
    """Polynomial of what temperature adds to an accelerometer ("acc") or a magnetometer ("mag") at rest in one pose.

    `values` (N, 3) are as measured; `base` is the calibration so far, whose bias at its temperature and matrix are
    kept, for one pose does not show them: what the temperature does to the scale, too, looks like a bias there.
    `acc` and `gyr` (N, 3) show whether it rested.
    """
    temperature = _required_temperature(t, values, temp_c, clipped, triad)
    watched = acc is not None or gyr is not None
    rest = _rest(t, acc, gyr, temperature) if watched else np.ones(t.size, dtype=np.bool_)
    blocks = _blocks(t, np.where(rest[:, np.newaxis], values, np.nan), temperature, base.temp_ref_c)
    fit, span = _choose(blocks), (float(temperature.min()), float(temperature.max()))
    seconds, unit = float(t[-1] - t[0]), {"acc": "mg", "mag": "uT"}[triad]
    calibration = replace(
        base,
        bias_per_k=fit.slopes,
        bias_per_k_sd=np.sqrt(np.einsum("kkj->kj", fit.covariance)),
        temp_span_c=span,
        method=f"{base.method}; over temperature, degree {len(fit.slopes)}, {seconds:.0f} s in one pose",
    )
    powers = _powers(np.linspace(*span, 41), base.temp_ref_c)[:, 1 : len(fit.slopes) + 1]
    spread = float(np.sqrt(np.einsum("nk,klj,nl->nj", powers, fit.covariance, powers).max()))
    remarks: tuple[Note, ...] = (
        info(
            "calibration.drift_over_temperature",
            spread=f"{from_si(spread, unit):.2g} {written(unit)}", low_c=span[0], high_c=span[1],
            reference_c=base.temp_ref_c, degree=len(fit.slopes), what="gravity" if triad == "acc" else "the field",
        ),
        *_hysteresis(blocks, fit, unit),
    )  # fmt: skip
    return Fitted(calibration, blocks.rate, fit.residuals, np.ones(len(blocks.rate), dtype=bool), remarks, blocks.soak)


def _rest(t: Floats, acc: Floats | None, gyr: Floats | None, temp_c: Floats) -> NDArray[np.bool_]:
    """Samples (N,) at rest; a refusal where they are too few."""
    rest, still = np.zeros(t.size, dtype=np.bool_), None
    if gyr is not None:  # a rough polynomial is enough to tell rest from motion
        reference = _reference(temp_c)
        blocks = _blocks(t, gyr, temp_c, reference)
        still = gyr - _powers(temp_c, reference) @ np.linalg.lstsq(blocks.powers, blocks.rate, rcond=None)[0]
    for part in stills(t, np.zeros((t.size, 3)) if acc is None else acc, still):
        rest[part] = True
    share = float(rest.mean())
    text = f"The unit was at rest for {100.0 * share:.0f} % of the record; {100.0 * LEAST_REST:.0f} % are needed."
    quiet = "Put it where nobody touches it, or cut the record with --from and --to."
    refuse(None if share >= LEAST_REST else Reason("not-still", text, quiet))
    return rest


@dataclass(frozen=True, eq=False, slots=True)
class _Blocks:
    powers: Floats  # (n, 4): means of 1, T − ref, its square and cube
    rate: Floats  # (n, 3)
    soak: Floats  # (n, 2): time since the start, s, and temperature, °C


@dataclass(frozen=True, eq=False, slots=True)
class _Polynomial:
    bias: Floats  # (3,)
    slopes: Floats  # (degree, 3)
    covariance: Floats  # (degree, degree, 3), of the slopes
    residuals: Floats  # (n, 3), of the blocks
    squares: Floats  # (3,), sum of the whitened residuals' squares
    free: int
    wander: Floats  # (3,), variance of a step of the random walk over that of the white noise


def _required_temperature(
    t: Floats, values: Floats, given: Floats | None, clipped: NDArray[np.bool_] | None, triad: str
) -> Floats:
    """Temperature (N,), °C, of a record that a polynomial can be fitted to; a refusal of others."""
    temp_c = np.full(t.size, np.nan) if given is None else check.column("temp_c", given, t.size)
    advice = "Let the unit warm up from cold, or cool down in a box, over 10 K or more, and record its temperature."
    missing = int(np.count_nonzero(~np.isfinite(temp_c)))
    if missing:
        refuse(Reason("no-temperature", f"The temperature is missing in {missing} of {t.size} samples.", advice))
    span, lasting, needed = float(np.ptp(temp_c)), float(t[-1] - t[0]), FEWEST * SHORTEST
    narrow = f"The temperature changes by {span:.1f} K only; {LEAST_SPAN:g} K are needed to show a slope."
    short = f"The record has {lasting:.0f} s; {needed:.0f} s are needed."
    count = 0 if clipped is None else int(clipped.sum())
    at_end = f"{count} samples are at the end of the {TITLES[triad]}'s range."
    far = "A unit at rest is far from its range: check the range, or let it lie."
    empty, columns = not np.isfinite(values).any(axis=0).all(), "Check the profile's columns."
    refuse(
        Reason("no-temperature", narrow, advice) if span < LEAST_SPAN else None,
        Reason("too-few", short, "Record for half an hour or longer.") if lasting < needed else None,
        Reason("clipping", at_end, far) if count > 0 else None,
        Reason("too-few", f"An axis of the {TITLES[triad]} has no number.", columns) if empty else None,
    )
    return temp_c


def _reference(temp_c: Floats) -> float:
    """Temperature of the bias, °C: that of data sheets, or the middle of a span that does not hold it."""
    low, high = float(temp_c.min()), float(temp_c.max())
    return USUAL if low <= USUAL <= high else 0.5 * (low + high)


def _powers(temp_c: Floats, reference: float) -> Floats:
    return np.vander(temp_c - reference, HIGHEST + 1, increasing=True)


def _blocks(t: Floats, rate: Floats, temp_c: Floats, reference: float) -> _Blocks:
    """Block means over samples that have a rate; blocks without one are left out."""
    count = int(np.clip((t[-1] - t[0]) / SHORTEST, FEWEST, BLOCKS))
    place = np.minimum(((t - t[0]) / (t[-1] - t[0]) * count).astype(np.intp), count - 1)
    finite = np.isfinite(rate).all(axis=1)
    place, values = place[finite], np.column_stack((t - t[0], temp_c, _powers(temp_c, reference), rate))[finite]
    size = np.bincount(place, minlength=count)
    sums = np.array([np.bincount(place, column, minlength=count) for column in values.T])
    mean = (sums[:, size > 0] / size[size > 0]).T
    return _Blocks(mean[:, 2 : HIGHEST + 3], mean[:, HIGHEST + 3 :], mean[:, :2])


def _turning(t: Floats, mag: Floats) -> Reason | None:
    """Reason why the field turned in more than few windows: over a whole soak a magnetometer may drift by as much."""
    edges = np.searchsorted(t, np.arange(t[0], t[-1], WINDOW)).tolist()
    turns = resting.field_turns(t, mag, [slice(a, b) for a, b in pairwise([*edges, t.size])])
    return resting.turn_reason(turns) if np.count_nonzero(turns) > (1.0 - LEAST_REST) * turns.size else None


def _choose(blocks: _Blocks) -> _Polynomial:
    """Lowest degree that the highest one does not improve on significantly, on any axis."""
    from scipy.special import fdtrc

    diffs = _Differences.from_blocks(blocks)
    wander = np.array([_wander(diffs, axis) for axis in range(3)])
    fits = []
    for degree in range(1, HIGHEST + 1):  # the bias is the mean of what the powers leave
        slopes, covariance, squares = _weighted(diffs.regressors[:, :degree], diffs, wander)
        residual = blocks.rate - blocks.powers[:, 1 : degree + 1] @ slopes
        bias, free = residual.mean(axis=0), len(diffs.rate) - degree
        fits.append(_Polynomial(bias, slopes, covariance, residual - bias, squares, free, wander))
    full = fits[-1]
    for fit in fits[:-1]:
        more = fit.free - full.free
        ratio = (fit.squares - full.squares) / more / np.maximum(full.squares / full.free, np.finfo(np.float64).tiny)
        if (3.0 * fdtrc(more, full.free, ratio) > SIGNIFICANCE).all():  # three axes are three chances
            return fit
    return full


@dataclass(frozen=True, eq=False, slots=True)
class _Differences:
    """Sine transform of the differences of neighbouring blocks, whose rows are independent.

    Differences of white noise have the covariance 2, and −1 beside the diagonal, those of a walk the unit matrix;
    the sine transform diagonalises both.
    """

    regressors: Floats  # (m, 4): T − ref, its square and cube, and half of whether it rises (1) or falls (−1)
    rate: Floats  # (m, 3)
    white: Floats  # (m,), variance of a row for white noise of variance 1; for a random walk it is that of a step

    @classmethod
    def from_blocks(cls, blocks: _Blocks) -> "_Differences":
        from scipy.fft import dst

        way = 0.5 * np.sign(np.gradient(blocks.powers[:, 1]))
        regressors, rate = (
            np.asarray(dst(np.diff(values, axis=0), type=1, axis=0, norm="ortho"))
            for values in (np.column_stack((blocks.powers[:, 1:], way)), blocks.rate)
        )
        m = len(rate)
        return cls(regressors, rate, 2.0 - 2.0 * np.cos(np.pi * np.arange(1, m + 1) / (m + 1)))


def _wander(diffs: _Differences, axis: int) -> float:
    """Variance of a step of the random walk over that of the white noise of a block: the largest likely one.

    A short soak says little about it, and one that is taken too small makes a wander a curve. So it is not the maximum
    of the restricted likelihood but the end of its interval of one standard deviation.
    """
    powers = diffs.regressors[:, :HIGHEST]
    size = np.sqrt(np.mean(powers**2, axis=0))

    def cost(ratio: float) -> float:
        weight = 1.0 / np.sqrt(diffs.white + ratio)
        x, y = powers / size * weight[:, np.newaxis], diffs.rate[:, axis] * weight
        residual = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
        power = max(float(residual @ residual), np.finfo(np.float64).tiny)
        seen_by = float(np.linalg.slogdet(x.T @ x)[1])  # [Patterson1971]: restricted, by the slopes
        return seen_by - 2.0 * float(np.log(weight).sum()) + (len(y) - HIGHEST) * float(np.log(power))

    costs = np.array([cost(ratio) for ratio in _RATIOS])
    return float(_RATIOS[np.flatnonzero(costs <= costs.min() + 1.0)[-1]])


def _weighted(columns: Floats, diffs: _Differences, wander: Floats) -> tuple[Floats, Floats, Floats]:
    """Coefficients of k columns (k, 3), their covariance (k, k, 3) and the weighted squares that are left (3,)."""
    k = columns.shape[1]
    slopes, covariance, squares = np.zeros((k, 3)), np.zeros((k, k, 3)), np.zeros(3)
    size = np.sqrt(np.mean(columns**2, axis=0))  # they differ by powers of the span
    for axis in range(3):
        weight = 1.0 / np.sqrt(diffs.white + wander[axis])
        x, y = columns / size * weight[:, np.newaxis], diffs.rate[:, axis] * weight
        scaled = np.linalg.lstsq(x, y, rcond=None)[0]
        slopes[:, axis], squares[axis] = scaled / size, float(np.sum((y - x @ scaled) ** 2))
        inverse = np.linalg.inv(x.T @ x) / np.outer(size, size)
        covariance[:, :, axis] = inverse * squares[axis] / (len(y) - k)
    return slopes, covariance, squares


def _fitted(fit: _Polynomial, blocks: _Blocks, temp_c: Floats, base: TriadCalibration, seconds: float) -> Fitted:
    span, degree = (float(temp_c.min()), float(temp_c.max())), len(fit.slopes)
    wandered = fit.residuals.var(axis=0)  # the bias is known no better than it wandered during the soak
    centred = (_powers(np.linspace(*span, 41), _reference(temp_c)) - blocks.powers.mean(axis=0))[:, 1 : degree + 1]
    spread = float(np.sqrt((np.einsum("nk,klj,nl->nj", centred, fit.covariance, centred) + wandered).max()))
    mean = blocks.powers.mean(axis=0)[1 : degree + 1]
    bias_variance = wandered + np.einsum("k,klj,l->j", mean, fit.covariance, mean)
    calibration = replace(
        base,
        bias=fit.bias,
        bias_per_k=fit.slopes,
        bias_per_k_sd=np.sqrt(np.einsum("kkj->kj", fit.covariance)),
        temp_ref_c=_reference(temp_c),
        temp_span_c=span,
        covariance=resting.new_bias_covariance(base, np.diag(bias_variance)),
        residual_rms=float(np.sqrt(np.mean(fit.residuals**2))),
        method=f"gyr over temperature, degree {degree}, {span[0]:.1f} to {span[1]:.1f} °C in {seconds:.0f} s",
        quality=Quality(grade=grade_of(spread, RATE) or "poor", samples=len(blocks.rate)),
    )
    remarks: tuple[Note, ...] = (
        info(
            "calibration.bias_over_temperature", spread_dps=to_dps(spread), low_c=span[0], high_c=span[1], degree=degree
        ),
        *_hysteresis(blocks, fit, "deg/s"),
    )
    return Fitted(calibration, blocks.rate, fit.residuals, np.ones(len(blocks.rate), dtype=bool), remarks, blocks.soak)


def _hysteresis(blocks: _Blocks, fit: _Polynomial, unit: str) -> tuple[str, ...]:
    """Say where warming and cooling give another bias at the same temperature."""
    rising = np.gradient(blocks.powers[:, 1]) > 0.0
    if min(rising.sum(), (~rising).sum()) < FEWEST // 2:
        return ()
    diffs = _Differences.from_blocks(blocks)
    slopes, covariance, _ = _weighted(diffs.regressors[:, [*range(len(fit.slopes)), HIGHEST]], diffs, fit.wander)
    apart = np.abs(slopes[-1])
    if not (apart > SURE * np.sqrt(covariance[-1, -1])).any():
        return ()
    return (
        f"Warming and cooling differ by {from_si(float(apart.max()), unit):.2g} {written(unit)} at the same "
        "temperature (hysteresis, or a thermometer that lags); a polynomial cannot follow that.",
    )
