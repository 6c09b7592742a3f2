"""The paper's first test: the unit at rest, before and after the scalar filter, and what four hours of it show.

Ratios are root mean squares over all seeds and channels, after the filter over before it. The paper takes the mean of
the record off first, which changes nothing here: the filter passes a constant as it is, and neither a variance nor an
Allan deviation sees it. Only the integrated angle does, and there the mean is what the application suffers from.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.harness.channel_records import RATIOS, STEP, at_rest, scalar_filter
from plumbob.core.check import Floats
from plumbob.core.units import dps, to_dps
from plumbob.filters.channel_scalar import steady_gain
from plumbob.noise import deviation, edf

SAMPLES = 1000
"""Of the paper's record, 100 s."""
TAUS = (0.1, 0.2, 0.4, 1.0, 2.0, 4.0, 10.0, 50.0)
"""Averaging times of the paper, s."""
LONG = 4 * 3600.0
"""Length of the long record, s."""
LONG_TAUS = (0.1, 1.0, 10.0, 100.0, 600.0)
"""Averaging times of the long record, s."""
WALK = dps(5e-4)
"""Random walk of the bias in the long record, rad/s/√s: assumed, it shows from some 100 s on."""
WHITE_LENGTH = 10_000.0
"""Length of the record of white noise alone, s: 50 times the memory of the slowest filter."""
MEMORIES = 5.0
"""After so many samples over its gain a filter has settled to 1 %."""

_SHORT, _LONG = slice(3, 3 + len(TAUS)), slice(3 + len(TAUS), None)  # places of the Allan variances in `_squares`


@dataclass(frozen=True, slots=True)
class AtRest:
    """What one scalar filter does at rest.

    Attributes
    ----------
    q_over_r, gain : float
        Q/R, and the gain that the filter settles at.
    theory : float
        K / (2 − K), ratio of the variances of white noise.
    white : float
        The same, measured on white noise alone once the filter had settled.
    variance : float
        Ratio of the variances of the paper's record, start included.
    adev : tuple of float
        Ratio of the Allan deviations at each of `TAUS`.
    angle : float
        Ratio of the integrated angles, mean included.
    adev_long : tuple of float
        Ratio of the Allan deviations of the long record at each of `LONG_TAUS`.
    """

    q_over_r: float
    gain: float
    theory: float
    white: float
    variance: float
    adev: tuple[float, ...]
    angle: float
    adev_long: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class StaticTest:
    """Result of the test at rest: the filters, and the Allan deviations, rad/s, of what they were given."""

    filters: tuple[AtRest, ...]
    adev_before: tuple[float, ...]
    adev_long_before: tuple[float, ...]

    def as_dict(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {
            "taus_s": list(TAUS),
            "degrees_of_freedom": [degrees_of_freedom(SAMPLES, tau) for tau in TAUS],
            "adev_before_dps": [to_dps(v) for v in self.adev_before],
            "long_taus_s": list(LONG_TAUS),
            "long_degrees_of_freedom": [degrees_of_freedom(round(LONG / STEP), tau) for tau in LONG_TAUS],
            "long_adev_before_dps": [to_dps(v) for v in self.adev_long_before],
            "filters": [asdict(one) for one in self.filters],
        }


def measure_static(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> StaticTest:
    """Run the test at rest with each seed.

    Parameters
    ----------
    seeds : sequence of int
        One run of three channels each.
    progress : callable, optional
        Called with 1 after each seed.
    """
    before, after = [], []
    for seed in seeds:
        raw, smoothed = _one_run(seed)
        before.append(raw)
        after.append(smoothed)
        if progress:
            progress(1)
    raw, smoothed = np.mean(before, axis=0), np.mean(after, axis=0)
    ratio = smoothed / raw
    rows = tuple(_row(q_over_r, row) for q_over_r, row in zip(RATIOS, ratio, strict=True))
    return StaticTest(rows, _roots(raw[_SHORT]), _roots(raw[_LONG]))


def degrees_of_freedom(count: int, tau: float) -> float:
    """Degrees of freedom of an Allan variance of white noise at `tau`, s, from a record of `count` samples."""
    return float(edf("oadev", 0.0, count, [round(tau / STEP)])[0])


def _one_run(seed: int) -> tuple[Floats, Floats]:
    """Mean squares (m,) of one run, and of each filter (len(RATIOS), m) after it, in the order of `_squares`."""
    short, long = at_rest(seed, SAMPLES * STEP), at_rest(seed, LONG, walk=WALK)
    white = at_rest(seed, WHITE_LENGTH, flicker=0.0)
    raw = _squares(white.measured, short.measured, long.measured)
    after = []
    for ratio in RATIOS:
        smooth = scalar_filter(ratio).smooth
        settled = math.ceil(MEMORIES / steady_gain(ratio))
        quiet = smooth(white.t, white.measured)[settled:]
        after.append(_squares(quiet, smooth(short.t, short.measured), smooth(long.t, long.measured)))
    return raw, np.array(after)


def _squares(white: Floats, short: Floats, long: Floats) -> Floats:
    """Mean squares of white noise alone, of the short record about its mean, of its angle; then Allan variances."""
    angle = STEP * np.cumsum(short, axis=0)
    level = [np.mean(white**2), np.mean((short - short.mean(axis=0)) ** 2), np.mean(angle**2)]
    return np.concatenate((level, _allan_variance(short, TAUS), _allan_variance(long, LONG_TAUS)))


def _allan_variance(rate: Floats, taus: Sequence[float]) -> Floats:
    return np.asarray(np.mean(deviation(rate, [round(tau / STEP) for tau in taus]) ** 2, axis=1))


def _row(q_over_r: float, ratio: Floats) -> AtRest:
    gain = steady_gain(q_over_r)
    return AtRest(
        q_over_r=q_over_r,
        gain=gain,
        theory=gain / (2.0 - gain),  # Σ K² (1 − K)²ⁱ
        white=float(ratio[0]),
        variance=float(ratio[1]),
        adev=_roots(ratio[_SHORT]),
        angle=math.sqrt(ratio[2]),
        adev_long=_roots(ratio[_LONG]),
    )


def _roots(squares: Floats) -> tuple[float, ...]:
    return tuple(float(v) for v in np.sqrt(squares))
