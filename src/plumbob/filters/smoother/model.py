"""What the smoother estimates, and what it takes for granted.

=====  ==========  =========  =======================================================================
place  name        unit       meaning
=====  ==========  =========  =======================================================================
0      TH          rad        error of the attitude, a rotation in navigation axes, ``q_true = exp(θ) ⊗ q``
3      B           rad/s      bias of the gyroscope
6      V           m/s        level velocity, east and north
8      BEND        rad        how far the field's direction is off where its size and dip are right
9      A           m/s²       bias of the accelerometer
12     M           1          scale and misalignment of the gyroscope, row by row: rate = (I − M) gyr − bias
=====  ==========  =========  =======================================================================

The navigation frame inside is ENU with magnetic north; results are turned to the frame that was asked for.

When to choose it: for every recording that is computed afterwards, and without a lag for a stream.

Departures from [Bierman1973]: the measurements come from an error-state filter, whose attitude is corrected after each
keyframe, so that λ refers to the corrected attitude; the heading is a consider update. Not an iterated smoother: the
second pass starts from the smoothed attitude, with a wide covariance of its own.
"""

import math
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, deg, dps

if TYPE_CHECKING:
    from plumbob.data.cards import NoiseCard

SUMMARY: Final = "the whole recording at once, forward and backward; its scale, biases and field estimated"
REFERENCES: Final = ("Sola2017", "Bierman1973", "Schmidt1966")
NEEDS: Final = ("gyr", "acc")
BIAS_PRIOR: Final = "bias_start"
COVARIANCE: Final = slice(0, 9)  # of the attitude, as those of the filters say where theirs lies

SIZE: Final = 21
TH: Final = 0
B: Final = 3
V: Final = 6
BEND: Final = 8
A: Final = 9
M: Final = 12
KEPT: Final = 8  # the first states, whose covariance with all others is kept at every keyframe


class Params(NamedTuple):
    """Noise of the sensors, and how the body and its surroundings behave; all independent of the rate."""

    gyr_noise: Annotated[float, Spec(Quantity.RATE_NOISE, "white noise of the gyroscope", 1e-9, 1)] = dps(0.01)
    gyr_walk: Annotated[float, Spec(Quantity.RATE_WALK, "random walk of its bias", 0, 1)] = dps(0.006)
    gyr_nonlinearity: Annotated[
        float, Spec(Quantity.RATIO, "what scale and alignment leave, white, as a share of the rate, 1/√Hz", 0, 0.1)
    ] = 0.0005
    gyr_scale: Annotated[float, Spec(Quantity.RATIO, "standard deviation of its scale", 0, 0.5)] = 0.008
    gyr_misalignment: Annotated[
        float, Spec(Quantity.ANGLE, "standard deviation of the angles between its axes", 0, 0.5)
    ] = 0.002
    bias_start: Annotated[
        float, Spec(Quantity.RATE, "standard deviation of its bias before the recording", 1e-9, 1)
    ] = dps(5.0)
    acc_noise: Annotated[float, Spec(Quantity.ACCELERATION_NOISE, "white noise of the accelerometer", 1e-6, 10)] = 0.003
    acc_bias: Annotated[
        float, Spec(Quantity.ACCELERATION, "standard deviation of its bias that is estimated", 0, 10)
    ] = 0.015
    acc_offset: Annotated[
        float, Spec(Quantity.ACCELERATION, "and of an offset that is only counted in the covariance", 0, 10)
    ] = 0.03
    speed: Annotated[float, Spec(Quantity.SPEED, "least level speed that is expected; more is learned", 1e-3, 1e3)] = (
        0.05
    )
    mag_noise: Annotated[float, Spec(Quantity.FIELD, "white noise of the field in motion, µT/√Hz", 1e-4, 100)] = 2.0
    mag_spread: Annotated[
        float, Spec(Quantity.FIELD, "a field this far from its reference counts with a quarter, at least", 1e-2, 100)
    ] = 2.0
    mag_disturbance_sd: Annotated[
        float, Spec(Quantity.ANGLE, "largest standard deviation of the field's direction where its size is right", 0, 2)
    ] = deg(3.0)
    mag_disturbance_time: Annotated[float, Spec(Quantity.TIME, "for how long such a deflection lasts", 1e-3, 6000)] = (
        60.0
    )
    mag_direction_sd: Annotated[
        float,
        Spec(Quantity.ANGLE, "how far the field of the place itself is off north, counted in the covariance", 0, 2),
    ] = deg(1.5)
    rest_rate: Annotated[float, Spec(Quantity.RATE, "at rest the rate stays within this of its mean", 1e-6, 1)] = dps(
        2.0
    )
    rest_force: Annotated[
        float, Spec(Quantity.ACCELERATION, "and the specific force within this of its own", 1e-6, 100)
    ] = 0.5
    rest_band: Annotated[
        float, Spec(Quantity.RATE, "and the mean rate within this of the bias; a slow turn is not rest", 1e-6, 1)
    ] = dps(0.2)
    rest_time: Annotated[float, Spec(Quantity.TIME, "over this time around each moment", 0.1, 600)] = 1.5
    tremor: Annotated[float, Spec(Quantity.RATE_NOISE, "what still moves at rest", 0, 1)] = dps(0.05)
    latency: Annotated[
        float | None, Spec(Quantity.TIME, "the attitude is for this much later than its samples; off: not known", -1, 1)
    ] = None
    latency_sd: Annotated[float, Spec(Quantity.TIME, "uncertainty of that, counted in the covariance", 0, 1)] = 0.0025
    lag: Annotated[
        float | None,
        Spec(Quantity.TIME, "a sample knows nothing that comes later than this after it; off: all", 0, 1e6),
    ] = None
    keyframe: Annotated[float, Spec(Quantity.TIME, "time between two corrections", 1e-3, 1)] = 0.099


def from_noise(card: "NoiseCard") -> dict[str, float]:
    """Noise parameters from a card, where they are larger than the defaults: in motion a sensor is never better.

    What a unit shows at rest is the least of what it does in motion; a filter that believed it would follow the
    gyroscope too stiffly.
    """
    usual, params = Params(), {}
    for name, noise in (("gyr", card.gyr), ("acc", card.acc)):
        if noise is not None:
            params[f"{name}_noise"] = noise.n_rms
    if card.gyr is not None:
        params["gyr_walk"] = card.gyr.k_rms
    return {name: value for name, value in params.items() if value > getattr(usual, name)}


DELIVERED_SCALE, DELIVERED_AXES = 0.05, deg(1.0)
"""Standard deviations of scale and of angles between axes, rad, of a unit as delivered: data sheets allow as much."""


def as_delivered(p: Params) -> Params:
    """Parameters for a unit that nobody has calibrated."""
    scale, axes = max(p.gyr_scale, DELIVERED_SCALE), max(p.gyr_misalignment, DELIVERED_AXES)
    return p._replace(gyr_scale=scale, gyr_misalignment=axes)


def may_be_delivered(p: Params) -> bool:
    """Whether a unit of these parameters could be another one as delivered: neither that, nor one without an error."""
    return 0.0 < p.gyr_scale < DELIVERED_SCALE and 0.0 < p.gyr_misalignment < DELIVERED_AXES


def matrix_variances(p: Params) -> Floats:
    """Variances of scale and misalignment before a recording, (9,), row by row."""
    var = np.full(9, p.gyr_misalignment**2)
    var[::4] = p.gyr_scale**2
    return var


def hides_rest(p: Params, digit: Floats | float) -> NDArray[np.bool_]:
    """Whether a slow turn beyond the band of rest may hide in the last digit of the rates, rad/s."""
    return np.asarray((0.5 * np.asarray(digit) >= p.rest_band) & np.isfinite(digit))


CHIP_DELAY: Final = 0.004
"""What the own filter of a sensor delays a momentary value, s: 2 to 5 ms at 188 to 42 Hz [MPU-6000 register map]."""


def timing_sd(p: Params, t: Floats) -> float:
    """Standard deviation of the time at which attitudes are true, s, of samples at times (N,), s.

    A sample is taken for the mean of the step that its stamp ends. A momentary value is half a step younger, less the
    delay of the sensor's filter; nothing in the samples shows which it is, so that all between counts alike.
    """
    usual = float(np.median(np.diff(t))) if p.latency is None and t.size > 1 else 0.0
    return math.hypot(p.latency_sd, max(0.5 * usual - CHIP_DELAY, 0.0) / math.sqrt(3.0))


CARD_FLOOR: Final = 5e-4  # a scale or an angle that a card has may have changed by so much since
BIAS_REPEATS: Final = dps(0.5)  # and a bias by this, rad/s
START_SPEED: Final = 0.3  # standard deviation of the level velocity at a start, m/s


def start_covariance(
    p: Params, *, tilt: float, heading: float, bias: float, rigid: bool, matrix: float = 1.0, unit: Floats | None = None
) -> Floats:
    """Covariance before the first sample, (21, 21).

    `p`: priors of the sensors; `tilt`, `heading`: standard deviations, rad; `bias`: of the gyroscope's bias, rad/s;
    `rigid`: nothing shows the heading, so that the scale may move no more than the misalignment; `matrix`: share of the
    prior of scale and misalignment, as a standard deviation; `unit` (12, 12): what the unit's card leaves of bias and
    matrix, their covariance.
    """
    var = np.zeros(SIZE)
    var[TH : TH + 2], var[TH + 2] = tilt**2, heading**2
    var[B : B + 3] = bias**2
    var[V : V + 2] = START_SPEED**2
    var[A : A + 3] = p.acc_bias**2
    var[M : M + 9] = p.gyr_misalignment**2 if rigid else matrix_variances(p)
    cov = np.diag(var)
    if unit is not None:
        cov[M:, M:] = unit[3:, 3:] + CARD_FLOOR**2 * np.eye(9)
    cov[M:, M:] *= matrix**2
    return cov


class ModelVariances(NamedTuple):
    """What the kernels read: variances per second, or of a measurement, and times."""

    gyr: float
    nonlinearity: float
    walk: float
    acc: float
    rest: float
    bend: float
    bend_time: float

    @classmethod
    def from_params(cls, p: Params, bend: float) -> "ModelVariances":
        """Of the parameters, with the standard deviation of the field's direction, rad."""
        return cls(
            p.gyr_noise**2, p.gyr_nonlinearity**2, p.gyr_walk**2, p.acc_noise**2, p.gyr_noise**2 + p.tremor**2,
            bend**2, p.mag_disturbance_time,
        )  # fmt: skip


FREE_HEADING: Final = 1e-3
"""Standard deviation of a heading that counts from where the recording began, rad; no more than a number above zero."""
