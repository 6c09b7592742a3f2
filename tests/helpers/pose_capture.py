"""Captures in which a unit rests in some poses and is turned in between, with an accelerometer that is not ideal."""

import numpy as np

from plumbob import ImuData, ImuMeta
from plumbob.core.constants import G0
from plumbob.core.units import dps, g

RATE = 100.0
GAIN = np.array([[1.02, 0.005, -0.009], [-0.004, 0.985, 0.012], [0.007, -0.003, 1.011]])
BIAS = g(np.array([0.03, -0.025, 0.04]))
NOISE = 0.03
"""White noise of a sample, m/s²: 400 µg/√Hz in a bandwidth of 50 Hz."""


def symmetric(matrix):
    """Symmetric part of the polar decomposition: what lengths can tell of a matrix."""
    sizes, axes = np.linalg.eigh(matrix.T @ matrix)
    return (axes * np.sqrt(sizes)) @ axes.T


def pose_capture(directions, *, dwell=2.0, move=0.6, gyr=True, noise=NOISE, seed=0, meta=None, **triads):
    """Recording of poses at rest, each `dwell` s; up is given in the axes of the case; ways take `move` s."""
    rng = np.random.default_rng(seed)
    resting, moving = round(dwell * RATE), round(move * RATE)
    ups, rates = [], []
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    for here, there in zip(unit, [*unit[1:], None], strict=True):
        ups.append(np.tile(here, (resting, 1)))
        rates.append(np.zeros((resting, 3)))
        if there is not None:
            turned, rate = arc(here, there, moving)
            ups.append(turned)
            rates.append(rate)
    up, rate = np.concatenate(ups), np.concatenate(rates)
    acc = G0 * up @ GAIN.T + BIAS + noise * rng.standard_normal(up.shape)
    turning = rate + dps(np.array([3.0, -1.0, 2.0])) + dps(0.1) * rng.standard_normal(up.shape)
    t = np.arange(len(up)) / RATE
    return ImuData(t=t, acc=acc, gyr=turning if gyr else None, meta=meta or ImuMeta(device="bench-1"), **triads)


def arc(here, there, count):
    """Directions on the way, and the rates at which the case turns."""
    angle = np.arccos(np.clip(here @ there, -1.0, 1.0))
    across = np.cross(here, there if 1e-6 < angle < np.pi - 1e-6 else np.roll(here, 1) + [0.1, 0.0, 0.0])
    across = across / np.linalg.norm(across)
    part = angle * (np.arange(count) + 1.0) / (count + 1.0)
    turned = np.cos(part)[:, np.newaxis] * here + np.sin(part)[:, np.newaxis] * np.cross(across, here)
    return turned, np.tile(-across * angle * RATE / (count + 1.0), (count, 1))
