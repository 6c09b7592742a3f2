"""The common heading of a chain, from the fields of all its units together.

Iron bends the field at one unit by tens of degrees, at all together by less, and otherwise a moment later. A Kalman
filter of three numbers weighs that against what the chain's own heading may have drifted by: how far the chain's frame
is turned, by how much the mean field is bent now, and where the field points, which is known but on a fixed base.
"""

import cmath
import math
from typing import Final, NamedTuple

import numpy as np

from plumbob.arm.filter import LEAST_FIELD, Params, UnitSamples
from plumbob.arm.smoother import Attitudes
from plumbob.core.check import Floats
from plumbob.core.units import deg
from plumbob.rotations import quat_rotate, wrap

LOOK_SD: Final = deg(3.0)  # what a direction scatters by at once, rad
LEAST_DRIFT: Final = deg(0.02)  # a heading that gyroscopes hold drifts by at least this, rad/√s
UNKNOWN: Final = math.pi


class Anchored(NamedTuple):
    """By how much the chain's frame is turned from North at each keyframe (K,), rad, and the variance of that, rad².

    `state` is the filter's at the last one, from which a stream goes on; None where no field holds the frame.
    """

    turn: Floats
    var: Floats
    state: tuple[Floats, Floats] | None = None


def anchored(
    samples: UnitSamples, motion: Attitudes, params: Params, *, north: float, turn_sd: float, north_sd: float,
    smooth: bool, before: Anchored | None = None,
) -> Anchored:  # fmt: skip
    """Turn of the frame at each keyframe; `before` has it at the first one, where that is known.

    `motion`: attitudes in the chain's own frame; `north`: where the field points from the frame's x axis, rad;
    `turn_sd`, `north_sd`: how far the frame may be turned at the beginning, and how far North is known, rad; `smooth`:
    whether what comes later counts.
    """
    directions, going_on = directions_at(samples, motion), before is not None and before.state is not None
    t, drift = motion.t[motion.rows], _drift(motion)
    x, p = np.array([0.0, 0.0, north]), np.diag([turn_sd**2, params.anchor_sd**2, north_sd**2])
    if before is not None and before.state is not None:
        x, p = before.state
    h = np.array([-1.0, 1.0, 1.0])
    states, covs = np.empty((len(t), 3)), np.empty((len(t), 3, 3))
    priors, fades = covs.copy(), np.ones(len(t))
    for k in range(len(t)):
        if k:
            span = t[k] - t[k - 1]
            fades[k] = math.exp(-span / params.field_time)
            f = np.array([1.0, fades[k], 1.0])
            x, p = f * x, f[:, np.newaxis] * p * f
            p[0, 0] += drift[k] + LEAST_DRIFT**2 * span
            p[1, 1] += params.anchor_sd**2 * (1.0 - fades[k] ** 2)
        priors[k] = p
        if math.isfinite(directions[k]) and (k or not going_on):
            off = wrap(directions[k] - h @ x)
            gain = p @ h / (h @ p @ h + LOOK_SD**2)
            x, p = x + gain * off, p - np.outer(gain, h @ p)
        states[k], covs[k] = x, 0.5 * (p + p.T)
    if smooth:
        _backward(states, covs, priors, fades)
    return Anchored(states[:, 0], np.maximum(covs[:, 0, 0], 0.0), (x, p))


def drifting(motion: Attitudes, turn_sd: float, before: Anchored | None = None) -> Anchored:
    """The frame where nothing holds it: not turned, and known ever worse; `before` as of `anchored`."""
    t = motion.t[motion.rows]
    growth = _drift(motion) + LEAST_DRIFT**2 * np.diff(t, prepend=t[0])
    growth[0] = turn_sd**2 if before is None else before.var[-1]
    return Anchored(np.zeros(len(t)), np.cumsum(growth))


def directions_at(samples: UnitSamples, motion: Attitudes) -> Floats:
    """Direction of the sum of all level fields at each keyframe (K,), rad; NaN where there is none."""
    rows = motion.rows
    if samples.mag is None:
        return np.full(len(rows), np.nan)
    level = quat_rotate(motion.q[:, rows], samples.mag[:, rows])[..., :2]
    size = np.linalg.norm(level, axis=2)
    used = np.isfinite(size) & (size > LEAST_FIELD)
    total = np.where(used[..., np.newaxis], level, 0.0).sum(axis=0)
    angles = np.array([cmath.phase(complex(*vector)) for vector in total])
    angles[~used.any(axis=0)] = np.nan
    return angles


def _drift(motion: Attitudes) -> Floats:
    """By how much the variance of the mean heading grows up to each keyframe (K,), rad²."""
    headings = motion.cov[:, 2::3, 2::3].mean(axis=(1, 2))
    growth = np.asarray(np.maximum(np.diff(headings, prepend=headings[0]), 0.0))
    growth[motion.begun] = UNKNOWN**2
    return growth


def _backward(states: Floats, covs: Floats, priors: Floats, fades: Floats) -> None:
    """Rauch–Tung–Striebel, in place."""
    for k in range(len(states) - 2, -1, -1):
        f = np.array([1.0, fades[k + 1], 1.0])
        gain = np.linalg.solve(priors[k + 1] + 1e-15 * np.eye(3), f[:, np.newaxis] * covs[k]).T
        states[k] += gain @ (states[k + 1] - f * states[k])
        covs[k] += gain @ (covs[k + 1] - priors[k + 1]) @ gain.T
