"""Motion of what hangs in gimbals: turns about fixed axes, each inside the one before."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from plumbob.check import Floats
from plumbob.rotations import IDENTITY, Frame, quat_conjugate, quat_from_rotvec, quat_multiply, quat_rotate
from plumbob.sim.motion import Truth
from plumbob.sim.signals import Signal

_AXES = np.eye(3)


@dataclass(frozen=True, eq=False)
class GimbalMotion:
    """Attitude ``q(axis₁, angle₁) ⊗ q(axis₂, angle₂) ⊗ …`` at one place: a table that stands aslant, or a hand.

    Parameters
    ----------
    frame : Frame
        Navigation frame, in which the first axis stands.
    gimbals : sequence of (int, Signal)
        From the outermost: which axis of the gimbal before it turns about, 0, 1 or 2 for x, y or z, and the angle, rad.
    """

    frame: Frame
    gimbals: Sequence[tuple[int, Signal]]

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s."""
        q_nb = np.tile(IDENTITY, (t.size, 1))
        rate_b, rate_dot_b = np.zeros((t.size, 3)), np.zeros((t.size, 3))
        for axis, signal in self.gimbals:
            angle, speed, acceleration = (part[:, np.newaxis] * _AXES[axis] for part in signal.at(t))
            turn = quat_from_rotvec(angle)
            carried = quat_rotate(quat_conjugate(turn), rate_b)
            q_nb = quat_multiply(q_nb, turn)
            rate_dot_b = quat_rotate(quat_conjugate(turn), rate_dot_b) - np.cross(speed, carried) + acceleration
            rate_b = carried + speed
        at_rest = np.zeros((t.size, 3))
        return Truth(t, self.frame, q_nb, rate_b, rate_dot_b, at_rest, at_rest, at_rest)
