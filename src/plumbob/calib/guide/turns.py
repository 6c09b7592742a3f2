"""How to turn a unit so that a vector, which stands still in the world, points elsewhere in the unit's own axes."""

import math
from typing import Final, NamedTuple

import numpy as np

from plumbob.calib.regions import REGIONS
from plumbob.check import Floats
from plumbob.units import deg

_AXES: Final = "xyz"
_STEP: Final = deg(5.0)


class Turn(NamedTuple):
    """Turn of the unit about one of its own axes.

    Attributes
    ----------
    axis : int
        0, 1 or 2 for x, y or z.
    angle : float
        Right-handed about the positive axis, rad.
    """

    axis: int
    angle: float

    def __str__(self) -> str:
        """Say it in words."""
        others = [_AXES[(self.axis + k) % 3] for k in (1, 2)]
        moving, goal = others if self.angle > 0.0 else reversed(others)
        degrees = 5 * max(1, round(abs(self.angle) / _STEP))
        return f"turn it about its {_AXES[self.axis]} axis by about {degrees}°, {moving} towards {goal}"


def nearest(direction: Floats, regions: list[int]) -> int:
    """Region of some that a direction (3,) has the smallest angle to."""
    return regions[int(np.argmax(REGIONS[regions] @ direction))]


def turn_to(direction: Floats, goal: Floats) -> Turn:
    """Turn of the unit that brings a vector closest to a goal, both as (3,) of length 1 in the unit's axes.

    Turning about an axis leaves the vector's component along it; the best axis is the one along which goal and vector
    differ least. Where a turn about no single axis ends at the goal, the next one comes closer.
    """
    rises = np.abs(np.arcsin(np.clip(direction, -1.0, 1.0)) - np.arcsin(np.clip(goal, -1.0, 1.0)))
    return min((Turn(axis, _angle(axis, direction, goal)) for axis in range(3)), key=lambda turn: _cost(turn, rises))


def pose_words(region: int) -> str:
    """How the unit stands when the specific force, which points up at rest, lies in a region."""
    parts = [(_AXES[k], value > 0.0) for k, value in enumerate(REGIONS[region].tolist()) if abs(value) > 0.1]
    slope = "" if len(parts) == 1 else "45° "
    return " and ".join(f"its {axis} axis {slope}{'up' if up else 'down'}" for axis, up in parts)


def _angle(axis: int, direction: Floats, goal: Floats) -> float:
    """Angle of the unit, which is the opposite of that of the vector in its axes."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turned = math.atan2(goal[b], goal[a]) - math.atan2(direction[b], direction[a])
    return -math.remainder(turned, math.tau)


def _cost(turn: Turn, rises: Floats) -> tuple[float, float]:
    return round(float(rises[turn.axis]), 2), abs(turn.angle)
