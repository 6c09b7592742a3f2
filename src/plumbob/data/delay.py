"""By how much a gyroscope lags its accelerometer: gravity, as the accelerometer sees it, turns as the rates say.

A fixed direction f seen from a body that turns with ω changes by ``df/dt = −ω × f``. Both sides are averaged to get rid
of noise and shocks, rid of what is slow, as a bias is, and correlated over a grid of delays. What the body accelerates
by disturbs the left side; parts of the recording, each left out once, show by how much.

On waves the body's way goes with its tilt, which looks like a delay but for two things: a delay is the same for slow
and for quick turns, and slow ones are known better, because a hand accelerates by the less the slower it turns.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.data.imu import ImuData
from plumbob.data.plausibility import QUIET

STEP: Final = 0.02  # Of the grid, s, of times and of delays
REACH: Final = 8  # Steps by which the gyroscope is shifted both ways at most
SMOOTH: Final = 5  # Steps that are averaged, twice;
SLOW: Final = 101  # and whose mean is taken off
BLOCKS: Final = 20  # Parts that are left out once each, for the standard deviation
FEWEST: Final = 500  # Steps with little but gravity in them, without which nothing is said
MOST: Final = 30_000  # Steps that are looked at: the first ten minutes
ENOUGH: Final = 0.6  # with less it may come from what the body accelerates by: below 0.4 it did in 3 of 73 recordings
CERTAIN: Final = 5.0  # A delay of fewer standard deviations may be none,
LEAST: Final = 0.01  # and a smaller one, s, does not matter
SPLITS: Final = range(11, SLOW + 1, 10)  # steps over which slow turns are means; the one that halves the power is taken
SAME: Final = 3.0  # standard deviations by which the delays of slow and quick turns may differ


@dataclass(frozen=True, slots=True)
class Delay:
    """By how much the gyroscope lags the accelerometer."""

    # delay, sd: delay and its standard deviation, s; negative where the accelerometer lags
    delay: float
    sd: float
    correlation: float  # of what both say at that delay, 0 to 1
    is_inside: bool = True  # whether the correlation falls on both sides of it
    # slow, quick: of slow and of quick turns alone, where the other numbers do not deny it
    slow: "Delay | None" = None
    quick: "Delay | None" = None

    @property
    def found(self) -> bool:
        """Whether there is a delay beyond doubt."""
        if not self.is_inside or self.correlation < ENOUGH or abs(self.delay) <= max(LEAST, CERTAIN * self.sd):
            return False
        if self.slow is None or self.quick is None:
            return True
        apart = SAME * math.hypot(self.slow.sd, self.quick.sd)
        return self.slow.correlation >= self.quick.correlation and abs(self.slow.delay - self.quick.delay) <= apart


def gyr_delay(imu: ImuData) -> Delay | None:
    """Delay of the gyroscope against the accelerometer in its first ten minutes; None where too few have both."""
    if not {"gyr", "acc"} <= set(imu.triads):
        return None
    imu = imu[: int(np.searchsorted(imu.t, imu.t[0] + MOST * STEP))]
    t, gyr, acc = imu.t, imu.usable("gyr"), imu.usable("acc")
    finite = np.isfinite(gyr).all(axis=1) & np.isfinite(acc).all(axis=1)
    t, gyr, acc = t[finite], gyr[finite], acc[finite]
    edge = REACH + SLOW + SMOOTH
    if not t.size or t[-1] - t[0] < (FEWEST + 2 * edge) * STEP:
        return None
    rate, force = (_even(t, values) for values in (gyr, acc))
    jerk, force = np.diff(force, axis=0) / STEP, 0.5 * (force[1:] + force[:-1])
    rate = 0.5 * (rate[1:] + rate[:-1])
    size = np.sqrt(np.sum(_mean(force, SMOOTH) ** 2, axis=1))
    quiet = np.abs(size / np.median(size) - 1.0) < QUIET
    quiet[:edge] = quiet[-edge:] = False
    rows = np.flatnonzero(quiet)
    if rows.size < FEWEST:
        return None
    jerk, said = _band(jerk), [_band(-np.cross(np.roll(rate, REACH - i, axis=0), force)) for i in range(2 * REACH + 1)]
    every = _delay(jerk, said, rows)
    if not every.found:
        return every  # nothing is claimed, whatever slow and quick turns say
    power = np.sum(said[REACH][rows] ** 2)
    slow = {count: _mean(said[REACH], count) for count in SPLITS}
    count = min(SPLITS, key=lambda count: abs(np.sum(slow[count][rows] ** 2) - 0.5 * power))
    means, mean = [_mean(part, count) for part in said], _mean(jerk, count)
    quick = [part - part_mean for part, part_mean in zip(said, means, strict=True)]
    return replace(every, slow=_delay(mean, means, rows), quick=_delay(jerk - mean, quick, rows))


def _delay(jerk: Floats, said: list[Floats], rows: NDArray[np.intp]) -> Delay:
    """Delay between what turns and what the rates say at each shift, by the rows that count."""
    jerk, parts = jerk[rows], np.linspace(0, rows.size, BLOCKS, endpoint=False).astype(np.intp)
    product, power = np.empty((len(said), BLOCKS)), np.empty((len(said), BLOCKS))
    for i, shifted in enumerate(said):
        product[i] = np.add.reduceat(np.sum(jerk * shifted[rows], axis=1), parts)
        power[i] = np.add.reduceat(np.sum(shifted[rows] ** 2, axis=1), parts)
    size = np.add.reduceat(np.sum(jerk * jerk, axis=1), parts)
    delay, correlation = _peak(product.sum(axis=1), power.sum(axis=1), float(size.sum()))
    without = [  # of each part in turn
        _peak(product[:, others].sum(axis=1), power[:, others].sum(axis=1), float(size[others].sum()))[0]
        for others in ~np.eye(BLOCKS, dtype=bool)
    ]
    is_inside = abs(delay) < (REACH - 1) * STEP
    return Delay(delay, float(np.sqrt((BLOCKS - 1) * np.var(without))), correlation, is_inside)


def _peak(product: Floats, power: Floats, size: float) -> tuple[float, float]:
    """Delay, s, of the largest correlation, by a parabola through its neighbours, and that correlation."""
    c = product / np.sqrt(np.maximum(power * size, np.finfo(float).tiny))
    i = int(np.argmax(c[1:-1])) + 1
    bend = c[i - 1] - 2.0 * c[i] + c[i + 1]
    between = 0.5 * (c[i - 1] - c[i + 1]) / bend if bend < 0.0 else 0.0
    return float(np.clip(i - REACH + between, -REACH, REACH)) * STEP, float(c[i])


def _even(t: Floats, values: Floats) -> Floats:
    """Means over the steps of a grid, of straight lines between values (N, 3)."""
    area = np.zeros_like(values)
    np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t)[:, np.newaxis], axis=0, out=area[1:])
    ends = t[0] + STEP * np.arange(int((t[-1] - t[0]) / STEP))
    return np.stack([np.diff(np.interp(ends, t, column)) for column in area.T], axis=1) / STEP


def _band(values: Floats) -> Floats:
    smooth = _mean(_mean(values, SMOOTH), SMOOTH)
    return smooth - _mean(smooth, SLOW)


def _mean(values: Floats, count: int) -> Floats:
    """Running means over an odd number of rows; zero at both ends."""
    total = np.concatenate((np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)))
    means, half = np.zeros_like(values), count // 2
    means[half : len(values) - half] = (total[count:] - total[:-count]) / count
    return means
