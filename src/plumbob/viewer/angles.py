"""Angles as they are shown: roll, pitch, yaw in degrees, a heading where it is one, from a tare where one is set."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import to_deg
from plumbob.rotations import euler_zyx_from_quat, quat_conjugate, quat_multiply


def euler_deg(q_nb: Floats) -> Floats:
    """Roll, pitch and yaw (N, 3), degrees, of attitudes (N, 4), as every report of Plumbob prints them."""
    return to_deg(euler_zyx_from_quat(q_nb))[..., ::-1]


class Tare:
    """The attitude that shows as zero roll, pitch and yaw.

    Angles then turn the body's axes at the tare into its axes now: a turn about the body's x axis is roll, in whichever
    attitude it was tared. All estimators count from the primary one's attitude, so what they differ by stays in sight.
    The attitudes themselves, the errors, the charts and what is recorded are not changed.
    """

    def __init__(self) -> None:
        self._inverse: Floats | None = None

    @property
    def is_set(self) -> bool:
        """Whether angles count from a tare."""
        return self._inverse is not None

    def set(self, q_nb: Any) -> None:
        """Count from an attitude (4,)."""
        self._inverse = quat_conjugate(np.asarray(q_nb, dtype=np.float64))

    def clear(self) -> None:
        """Count from the navigation frame again."""
        self._inverse = None

    def applied(self, q_nb: Floats) -> Floats:
        """Attitudes (N, 4) or (4,) as they are shown."""
        return q_nb if self._inverse is None else quat_multiply(self._inverse, q_nb)


def is_heading(hello: Mapping[str, Any]) -> bool:
    """Whether yaw is a heading: clockwise from a north, as in NED."""
    return hello.get("frame") == "NED" and hello.get("north") in ("true", "magnetic")


def shown_attitudes(estimates: Mapping[str, Any], tare: Tare, hello: Mapping[str, Any]) -> dict[str, Any]:
    """Attitudes of a batch as `messages.Attitude`, by estimator."""
    if not estimates:
        return {}
    q_nb = np.array([estimate["q_nb"] for estimate in estimates.values()], dtype=np.float64)
    angles = euler_deg(tare.applied(q_nb))
    if is_heading(hello) and not tare.is_set:
        angles[:, 2] %= 360.0
    return {
        name: {"roll": roll, "pitch": pitch, "yaw": yaw, "sd": None, "error": None} | estimate
        for (name, estimate), (roll, pitch, yaw) in zip(estimates.items(), angles.tolist(), strict=True)
    }
