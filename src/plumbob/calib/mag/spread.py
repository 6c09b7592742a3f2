"""What a capture saw: whether its directions lie on one circle, and what that says of how the unit was turned."""

import math
from typing import Final

import numpy as np

from plumbob.calib.refusal import Reason
from plumbob.check import Floats
from plumbob.units import deg

FLAT: Final = 0.1
"""Thickness over width of the measured vectors below which they lie on a circle: ±1° of jitter makes 0.04."""

_LEVEL: Final = deg(8.0)
_CONSTANT: Final = deg(10.0)


def one_axis(vectors: Floats, acc: Floats | None) -> Reason | None:
    """Reason to refuse vectors (N, 3) that were seen while turning about one axis only; None where they were not.

    Parameters
    ----------
    vectors : ndarray (N, 3)
        Measured vectors, of any unit.
    acc : ndarray (N, 3), optional
        Specific force at the same instants; it tells a level unit from an inclined one.
    """
    centred = vectors - vectors.mean(axis=0)
    _, sizes, directions = np.linalg.svd(centred[:: max(1, len(centred) // 10_000)], full_matrices=False)
    if not sizes[2] < FLAT * sizes[1]:
        return None
    axis = directions[2]
    advice = "Turn the unit about all its axes: each face and each edge once up, as if it were a cube."
    what = f"the field's directions lie on one circle about {_told(axis)}, {100.0 * sizes[2] / sizes[1]:.1f} % thick"
    if _is_level(axis, acc):
        return Reason(
            "level-ring", f"{what}: the unit was turned about the vertical while level, and nothing else.", advice
        )
    return Reason("cone", f"{what}: the unit was turned about one inclined axis, and nothing else.", advice)


def _is_level(axis: Floats, acc: Floats | None) -> bool:
    """Whether the turning was about an upright axis of the case."""
    if acc is None:
        return _from_case_axis(axis) < _LEVEL
    up = acc / np.linalg.norm(acc, axis=1, keepdims=True)
    mean = up.mean(axis=0)
    size = float(np.linalg.norm(mean))
    spread = math.sqrt(max(0.0, 2.0 * (1.0 - size)))  # root mean square angle about the mean direction
    return spread < _CONSTANT and _from_case_axis(mean / size) < _LEVEL


def _from_case_axis(direction: Floats) -> float:
    return math.acos(min(1.0, float(np.abs(direction).max())))


def _told(axis: Floats) -> str:
    if _from_case_axis(axis) < _LEVEL:
        return f"the {'xyz'[int(np.argmax(np.abs(axis)))]} axis"
    return f"the axis ({', '.join(f'{v:.2f}' for v in axis)})"
