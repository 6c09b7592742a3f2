"""Scalar Kalman filter of one rate channel: the trackball paper's drift compensation [Chen2013].

The rate is taken for a random walk, and every sample for that rate with white noise. Once its gain has settled this is
a low-pass of the first order, no more: noise falls by K / (2 − K) in variance, every ramp comes late by (1 − K) / K
samples, and what is slower than the filter passes unchanged, the bias instability and the integrated angle before all.

When to choose it: to reproduce the paper, or to show a quiet number on a display. Not in front of an attitude filter,
which integrates and so does the smoothing itself, without the lag.

=========  ========  =======  ======================================================
symbol     name      unit     meaning
=========  ========  =======  ======================================================
x̂          x[RATE]   rad/s    rate
P          x[P]      rad²/s²  its variance
Q          walk      rad/s    √Q of one second: how far the rate wanders in it
R          noise     rad/s    √R: noise of one sample
P0         start     rad/s    √P0: how wrong the first sample is taken to be
kg         x[GAIN]   1        gain of the last sample
=========  ========  =======  ======================================================

Departures from [Chen2013]: it gives neither Q nor R, and adds Q once a sample; here Q grows with the time step, so that
a missing or late sample counts, and ``walk`` does not depend on the sampling rate. At even steps both are the same, see
`params_of`. K(0) = 1 means that the first sample is taken as it stands, and P0 = 1 is read as (1 °/s)², in the paper's
unit.
"""

import math
from typing import Annotated, Final, NamedTuple

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, dps
from plumbob.filters.layout import BLIND, LEVEL, OWN, RATE, STAGE

SUMMARY: Final = "scalar Kalman filter of each rate, a low-pass of first order with its lag"
REFERENCES: Final = ("Chen2013",)
NEEDS: Final = ("gyr",)

Q: Final = 0
R: Final = 1
P0: Final = 2

P: Final = OWN
GAIN: Final = OWN + 1


class Params(NamedTuple):
    """What the filter takes the channel for; only the ratio of walk and noise matters once it has settled."""

    walk: Annotated[
        float, Spec(Quantity.RATE, "how far the rate wanders in one second, 1 σ; raise it to follow faster", 0, 1e3)
    ] = dps(0.0316)
    noise: Annotated[float, Spec(Quantity.RATE, "noise of one sample, 1 σ; raise it to smooth more", 1e-9, 1e3)] = dps(
        0.1
    )
    start: Annotated[float, Spec(Quantity.RATE, "how wrong the first sample may be, 1 σ", 0, 1e3)] = dps(1.0)


def coefficients(params: Params) -> tuple[float, ...]:
    """Coefficients of the kernel."""
    return params.walk**2, params.noise**2, params.start**2


def own_state(params: Params) -> int:
    """How many own numbers evolve."""
    return 2


@kernel
def step(c: Floats, x: Floats, dt: float, y: float) -> None:
    """Take one sample; one that is missing only lets the variance grow."""
    if x[STAGE] == BLIND:
        if not math.isnan(y):
            x[RATE], x[P], x[GAIN], x[STAGE] = y, c[P0], 1.0, LEVEL
        return
    x[P] += c[Q] * dt  # [Chen2013] (10)
    if math.isnan(y):
        return
    x[GAIN] = x[P] / (x[P] + c[R])  # [Chen2013] (11)
    x[RATE] += x[GAIN] * (y - x[RATE])  # [Chen2013] (9)
    x[P] *= 1.0 - x[GAIN]  # [Chen2013] (12)


def params_of(ratio: float, *, noise: float, dt: float) -> Params:
    """Parameters whose Q/R is `ratio` at even steps.

    `ratio`: Q/R, both of one sample; `noise`: √R, rad/s; `dt`: step, s.
    """
    _require_positive(ratio=ratio, noise=noise, dt=dt)
    return Params(walk=noise * math.sqrt(ratio / dt), noise=noise)


def steady_gain(ratio: float) -> float:
    """Gain K that the filter settles at, from Q/R: K = p / (1 + p), p² = Q/R (p + 1), p = P⁻/R."""
    _require_positive(ratio=ratio)
    p = 0.5 * (ratio + math.sqrt(ratio * (ratio + 4.0)))
    return p / (1.0 + p)


def ramp_lag(gain: float, slope: float, dt: float) -> float:
    """How far the settled filter stays behind a rate that grows by `slope` per second: slope Δt (1 − K) / K.

    `gain`: K; `slope`: angular acceleration, rad/s²; `dt`: step, s.
    """
    require_gain(gain)
    return slope * dt * (1.0 - gain) / gain


def _require_positive(**values: float) -> None:
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise ParameterError(f"{name} must be positive and finite, but it is {value:g}.")


def require_gain(gain: float) -> None:
    """Raise ParameterError unless a gain is above 0 and at most 1."""
    if not 0.0 < gain <= 1.0:
        raise ParameterError(f"a gain must be above 0 and at most 1, but it is {gain:g}.")
