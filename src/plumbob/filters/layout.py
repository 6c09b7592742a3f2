"""Places in the flat float64 arrays that every kernel shares: coefficients `c` and state `x`.

Flat arrays, not tuples, because a streamed call then passes two pointers; a filter's own entries come after these.

Time steps of samples that arrive in order, mostly.

Steps are differences of integer nanoseconds, so that cutting a recording in chunks keeps every bit. The state is all
float64, which cannot hold a time of today to the nanosecond: it holds an anchor in whole seconds, and nanoseconds from
there, which are exact for 104 days; then the anchor moves. A sample that is not later than the
last one taken is late and not used. Only when `RISING` samples in a row are late, but in order among themselves, has
the source's clock been set back, and the filter follows it. A sample with the time and the values of one of the last
`REMEMBERED` was sent twice, and says nothing about the clock.

Second-order Butterworth low-pass that keeps its time constant whatever the step.

A channel is its output y and its slope w, in units of the time constant τ. While the input stands at v, both follow
``y″ + 2y′ + 2(y − v) = 0`` in the time t/τ exactly, so steps of any length, regular or not, are the same filter. The
corner lies at √2/τ rad/s.
"""

import math
from typing import Final

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.time import REMEMBERED

# Coefficients
SIZE: Final = 0  # how many coefficients there are; in a streamed call the state follows them in one array
UP: Final = 1  # +1 where the navigation z axis points up, −1 where it points down
NORTH_X: Final = 2  # horizontal unit vector that the magnetometer calls north, in the navigation frame
NORTH_Y: Final = 3
MAX_GAP: Final = 4  # s; a longer step is not integrated
USE_MAG: Final = 5  # 0 where the magnetometer is not wanted
TRIAL_TIME: Final = 6  # s; see settling.py
OWN_C: Final = 7

# State
Q: Final = 0  # q_nb, 4
BIAS: Final = 4  # gyroscope bias in body axes, rad/s, 3
RATE: Final = 7  # last good rate in body axes, rad/s, 3
STAGE: Final = 10  # what has been initialised
HELD: Final = 11  # for how long the rate has been missing, s
COUNT: Final = 12  # samples taken
LAST: Final = 13  # what each triad said last, as one number, 3
SAME: Final = 16  # for how long it has said the same, s, 3
CLOCK: Final = 19  # see `tick`, 5
SEEN: Final = 24  # mean level and vertical part of the field, µT, and of how many; of filters with a covariance, 3
TRIAL: Final = 27  # see settling.py, 15
DIGITS: Final = 42  # smallest change of each triad so far, 3; zero before its first value
AXES: Final = 45  # see input_checks.py, 13 for each of 9
TAKEN: Final = AXES + 117  # how many samples were remembered; then their times, ns from the anchor, and what they said
OWN: Final = TAKEN + 1 + 2 * REMEMBERED

# Stages
BLIND: Final = 0.0
LEVEL: Final = 1.0
HEADED: Final = 2.0


RISING: Final = 3.0
LATE: Final = -1.0  # step of a sample that must not be used

_ANCHOR: Final = CLOCK  # s
_LAST: Final = CLOCK + 1  # times of the last sample, and of the first and the last late one, ns from the anchor
_FIRST_LATE: Final = CLOCK + 2
_LAST_LATE: Final = CLOCK + 3
_COUNT: Final = CLOCK + 4  # of late ones in a row
_TIMES: Final = TAKEN + 1
_SAID: Final = _TIMES + REMEMBERED
_SECOND: Final = 1_000_000_000
_EXACT: Final = 2**53


@kernel
def _from_anchor(x: Floats, t_ns: int) -> float:
    """Time since the anchor, ns, which moves where it is too far away."""
    since = t_ns - int(x[_ANCHOR]) * _SECOND
    if -_EXACT < since < _EXACT:
        return float(since)
    anchor = t_ns // _SECOND
    moved = float((anchor - int(x[_ANCHOR])) * _SECOND)  # a late time may now be inexact; it is very late
    x[_ANCHOR] = float(anchor)
    x[_LAST] -= moved
    x[_FIRST_LATE] -= moved
    x[_LAST_LATE] -= moved
    x[TAKEN] = 0.0
    return float(t_ns - anchor * _SECOND)


@kernel
def _remember(x: Floats, now: float, said: float) -> None:
    place = int(x[TAKEN]) % REMEMBERED
    x[_TIMES + place], x[_SAID + place] = now, said
    x[TAKEN] += 1.0


@kernel
def _sent_twice(x: Floats, now: float, said: float) -> bool:
    repeated = False
    for i in range(min(int(x[TAKEN]), REMEMBERED)):
        repeated |= x[_TIMES + i] == now and x[_SAID + i] == said
    return repeated


@kernel
def tick(x: Floats, t_ns: int, said: float) -> float:
    """Step to a sample at t_ns, s; 0 for the first, and `LATE` for one that must not be used.

    One number stands for all that the sample says; NaN is not known again.
    """
    now = _from_anchor(x, t_ns)
    dt = (now - x[_LAST]) / 1e9
    if dt > 0.0 or x[COUNT] == 0.0:
        x[_LAST], x[_COUNT] = now, 0.0
        _remember(x, now, said)
        return dt if x[COUNT] > 0.0 else 0.0
    if _sent_twice(x, now, said):
        return LATE
    behind = now - x[_LAST_LATE]
    if x[_COUNT] == 0.0 or not behind > 0.0:
        x[_FIRST_LATE], x[_COUNT] = now, 0.0
    x[_LAST_LATE] = now
    x[_COUNT] += 1.0
    if x[_COUNT] < RISING:
        return LATE
    x[_LAST], x[_COUNT] = now, 0.0
    _remember(x, now, said)
    return float(now - x[_FIRST_LATE] + behind) / 1e9  # what the late ones did not turn is made up for


Weights = tuple[float, float, float, float]


@kernel
def weights(dt: float, tau: float) -> Weights:
    """Transition of (y − v, w) over a step dt, s, at a time constant tau, s, row by row."""
    t = dt / tau
    decay = math.exp(-t)
    c, s = decay * math.cos(t), decay * math.sin(t)  # departs from [Laidig2023]: exact for any step, not bilinear
    return c + s, s, -2.0 * s, c - s


@kernel
def kept_weights(x: Floats, at: int, dt: float, tau: float) -> Weights:
    """Weights from five places of the state, renewed only where the step has changed by more than a thousandth."""
    if not abs(dt - x[at + 4]) <= 1e-3 * x[at + 4]:
        x[at], x[at + 1], x[at + 2], x[at + 3] = weights(dt, tau)
        x[at + 4] = dt
    return x[at], x[at + 1], x[at + 2], x[at + 3]


@kernel
def smooth(p: float, q: float, r: float, s: float, y: float, w: float, v: float) -> tuple[float, float]:
    """One step of a channel with the `weights` p, q, r, s towards the input v."""
    u = y - v
    return v + p * u + q * w, r * u + s * w
