"""Second-order Butterworth low-pass that keeps its time constant whatever the step.

A channel is its output y and its slope w, in units of the time constant τ. While the input stands at v, both follow
``y″ + 2y′ + 2(y − v) = 0`` in the time t/τ exactly, so steps of any length, regular or not, are the same filter. The
corner lies at √2/τ rad/s.
"""

import math

from plumbob._jit import njit
from plumbob.check import Floats

Weights = tuple[float, float, float, float]


@njit
def weights(dt: float, tau: float) -> Weights:
    """Transition of (y − v, w) over a step dt, s, at a time constant tau, s, row by row."""
    t = dt / tau
    decay = math.exp(-t)
    c, s = decay * math.cos(t), decay * math.sin(t)
    return c + s, s, -2.0 * s, c - s


@njit
def kept_weights(x: Floats, at: int, dt: float, tau: float) -> Weights:
    """Weights from five places of the state, renewed only where the step has changed by more than a thousandth."""
    if not abs(dt - x[at + 4]) <= 1e-3 * x[at + 4]:
        x[at], x[at + 1], x[at + 2], x[at + 3] = weights(dt, tau)
        x[at + 4] = dt
    return x[at], x[at + 1], x[at + 2], x[at + 3]


@njit
def smooth(p: float, q: float, r: float, s: float, y: float, w: float, v: float) -> tuple[float, float]:
    """One step of a channel with the `weights` p, q, r, s towards the input v."""
    u = y - v
    return v + p * u + q * w, r * u + s * w
