"""Motion from pose to pose: at rest in each, and between two of them turned about one axis."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from plumbob import check
from plumbob.check import Floats
from plumbob.errors import ParameterError, ShapeError
from plumbob.rotations import Frame, quat_conjugate, quat_from_rotvec, quat_multiply, rotvec_from_quat
from plumbob.sim.motion import Truth
from plumbob.sim.signals import quintic


@dataclass(frozen=True, eq=False)
class PoseMotion:
    """Poses one after the other, at one place; each move is the shortest turn, with the angle of least jerk.

    The axis of a move stands still in the body and in the navigation frame, so that rate and angular acceleration are
    the axis times the derivatives of the angle.

    Parameters
    ----------
    frame : Frame
        Navigation frame.
    poses : array_like (M, 4)
        Attitudes, M ≥ 1.
    dwell, move : float
        Time at rest in each pose, and of each move, s. The last pose is kept for ever.

    Raises
    ------
    ShapeError
        If there is no pose.
    ParameterError
        If a time is not positive.
    """

    frame: Frame
    poses: ArrayLike
    dwell: float
    move: float

    def __post_init__(self) -> None:
        """Validate poses and times."""
        if not len(check.rows("poses", self.poses, 4)):
            raise ShapeError("a motion from pose to pose needs at least one pose, but poses is empty.")
        if not (self.dwell > 0.0 and self.move > 0.0):
            raise ParameterError(f"dwell and move must be positive, but they are {self.dwell:g} and {self.move:g} s.")

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s."""
        poses = check.rows("poses", self.poses, 4)
        turns = rotvec_from_quat(quat_multiply(quat_conjugate(poses), np.concatenate((poses[1:], poses[-1:]))))
        cycle = self.dwell + self.move
        i = np.clip(np.floor(t / cycle), 0, len(poses) - 1).astype(np.intp)
        way, rate, acc = quintic(np.clip((t - i * cycle - self.dwell) / self.move, 0.0, 1.0))
        q_nb = quat_multiply(poses[i], quat_from_rotvec(way[:, np.newaxis] * turns[i]))
        rate_b = (rate / self.move)[:, np.newaxis] * turns[i]
        rate_dot_b = (acc / self.move**2)[:, np.newaxis] * turns[i]
        at_rest = np.zeros((t.size, 3))
        return Truth(t, self.frame, q_nb, rate_b, rate_dot_b, at_rest, at_rest, at_rest)
