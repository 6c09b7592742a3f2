"""Units that sit turned on their body: the body's motion, told in the unit's own axes."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from plumbob.check import Floats
from plumbob.rotations import Frame, quat_conjugate, quat_multiply, quat_rotate
from plumbob.sim import Motion, Scenario, Truth
from plumbob.sim.noise import stream

Quat = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class MountedMotion:
    """Motion of a unit that is fixed to a body.

    Parameters
    ----------
    motion : Motion
        Of the body.
    frame : Frame
        Navigation frame; the body's axes are those that go with it.
    q_bs : tuple of 4 float
        From the unit's axes to the body's.
    """

    motion: Motion
    frame: Frame
    q_bs: Quat

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s, in the unit's axes."""
        body, q_sb = self.motion.truth(t).in_frame(self.frame), quat_conjugate(np.array(self.q_bs))
        return replace(
            body,
            q_nb=quat_multiply(body.q_nb, np.array(self.q_bs)),
            rate_b=quat_rotate(q_sb, body.rate_b),
            rate_dot_b=quat_rotate(q_sb, body.rate_dot_b),
        )


@dataclass(frozen=True, kw_only=True)
class Mounted(Scenario):
    """A body's scenario as one of its units feels it; units of the same seed ride on the same motion."""

    plan: Scenario
    frame: Frame
    q_bs: Quat
    seed: int

    rate: ClassVar[float] = 100.0

    @property
    def told(self) -> str:
        """The body's scenario, and how the unit sits on it."""
        turned = "" if self.q_bs == (1.0, 0.0, 0.0, 0.0) else f", of a unit at q_bs = {self.q_bs}"
        return self.plan.told + turned

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return self.plan.duration

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Body's motion, drawn with the rig's seed instead of the unit's."""
        body = self.plan.motion(stream(self.seed, "scenario"), duration)
        return MountedMotion(body, self.frame, self.q_bs)
