"""Where to start with one field, seen from a body that turns: the best of many directions of the field."""

import math
from typing import Final

import numpy as np

from plumbob.check import Floats

_DIRECTIONS: Final = 400


def start_of(mag: Floats, turns: Floats) -> tuple[Floats, Floats, Floats]:
    """Field's direction, A and b: the best of many directions, for each of which A and b are linear."""
    seen = np.hstack((turns.reshape(-1, 9), np.ones((len(turns), 1))))
    power, cross = seen.T @ seen, seen.T @ mag
    best: tuple[Floats, Floats, Floats] = (np.zeros(3), np.eye(3), np.zeros(3))
    least = math.inf
    for h in _directions():
        pick = np.zeros((4, 10))
        pick[:3, :9] = np.kron(h, np.eye(3))
        pick[3, 9] = 1.0
        found, *_ = np.linalg.lstsq(pick @ power @ pick.T, pick @ cross, rcond=None)
        left = -float(np.sum((pick @ cross) * found))
        if left < least and np.linalg.det(found[:3]) > 0.0:
            best, least = (h, np.asarray(found[:3].T, dtype=np.float64), np.asarray(found[3], dtype=np.float64)), left
    return best


def _directions() -> Floats:
    """Directions that are spread evenly over a sphere along a spiral of golden angles."""
    k = np.arange(_DIRECTIONS) + 0.5
    up, angle = 1.0 - 2.0 * k / _DIRECTIONS, math.pi * (3.0 - math.sqrt(5.0)) * k
    level = np.sqrt(1.0 - up * up)
    return np.column_stack((level * np.cos(angle), level * np.sin(angle), up))


def across(h: Floats) -> Floats:
    """Two directions across h, as columns (3, 2)."""
    return np.linalg.svd(h[np.newaxis])[2][1:].T
