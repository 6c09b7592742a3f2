"""How units sit on the segments of a chain: errors of mounting, and soft tissue between bone and unit."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg
from plumbob.data.array import Mount
from plumbob.data.chain import Chain
from plumbob.rotations import quat_from_rotvec, quat_multiply
from plumbob.simulation.errors import stream
from plumbob.simulation.signals import Driven, Mixed, Signal, Sine, Sum


def drawn_mounts(chain: Chain, *, angle: float, shift: float, seed: int) -> dict[str, Mount]:
    """True mounts of a chain's units, by name: the chain's own with a drawn error.

    Parameters
    ----------
    chain : Chain
        Whose segments say how the units should sit.
    angle : float
        Largest turn of a unit, rad: the rotation vector is drawn evenly from the ball of that radius, rms 0.77 of it.
    shift : float
        Largest displacement, m, drawn in the same way.
    seed : int
        Of each unit's own random streams.
    """
    if not (0.0 <= angle <= math.pi and 0.0 <= shift < math.inf):
        raise ParameterError(
            f"a mounting error is 0 to π rad and 0 m or more, but it is {angle:g} rad and {shift:g} m."
        )
    return {
        one.unit: Mount(
            tuple(
                quat_multiply(
                    np.array(one.mount.q_bs), quat_from_rotvec(angle * _in_ball(stream(seed, one.unit, "mount angle")))
                ).tolist()
            ),
            tuple((np.array(one.mount.lever_b) + shift * _in_ball(stream(seed, one.unit, "mount shift"))).tolist()),
        )
        for one in chain.segments
        if one.unit
    }


def mounts_of(chain: Chain, given: Mapping[str, Mount]) -> dict[str, Mount]:
    """Mounts of a chain's units, by name: those given, else the chain's own."""
    own = {one.unit: one.mount for one in chain.segments if one.unit}
    unknown = [name for name in given if name not in own]
    if unknown:
        raise ParameterError(f"{chain.name} has no unit '{unknown[0]}'; its units are {', '.join(own)}.")
    return own | dict(given)


def _in_ball(rng: np.random.Generator) -> Floats:
    way = rng.standard_normal(3)
    return np.asarray(way / np.linalg.norm(way) * math.cbrt(rng.random()))


@dataclass(frozen=True, slots=True)
class SoftTissue:
    """Skin and muscle between a segment and its unit.

    The unit hangs on a damped spring that the specific force drives: it sways by ``force / ω²`` about its mean place,
    and tilts with it. Beside that, the skin turns with the sine of the joint's angles.

    Parameters
    ----------
    frequency, damping : float
        Natural frequency, Hz, and damping ratio below 1. At 6 Hz, 1 g is 7 mm.
    tilt : float
        Turn for each metre of sway, rad/m.
    skin : float
        Turn at a joint's angle of a quarter turn, rad, about an axis that the seed draws.
    skin_shift : float
        Displacement that goes with it, m.

    Raises
    ------
    ParameterError
        If a number is outside its domain.
    """

    frequency: float = 6.0
    damping: float = 0.3
    tilt: float = deg(300.0)
    skin: float = deg(3.0)
    skin_shift: float = 0.005

    def __post_init__(self) -> None:
        """Validate."""
        numbers = (self.frequency, self.tilt, self.skin, self.skin_shift)
        if not (all(0.0 <= one < math.inf for one in numbers) and self.frequency > 0.0 and 0.0 <= self.damping < 1.0):
            raise ParameterError(
                f"soft tissue needs a frequency above 0, a damping from 0 to below 1, and the rest not below 0: {self}."
            )

    def sway(self, rng: np.random.Generator, *, start: float, step: float, force: Floats, angles: Signal | None,
             count: int) -> Signal:  # fmt: skip
        """Way and turn of a unit about its mean place and attitude, segment axes: 6 components, m and rad.

        Parameters
        ----------
        rng : Generator
            Draws the axes.
        start, step : float
            Of the instants of `force`, s.
        force : ndarray (m, 3)
            Specific force at the unit's place, segment axes, m/s².
        angles : Signal with `count` components, or None
            Of the segment's joint.
        count : int
            Number of these.
        """
        hung = Driven(start, step, -(force - force.mean(axis=0)), 2.0 * math.pi * self.frequency, self.damping)
        turn, directions = rng.standard_normal((3, 3)), rng.standard_normal((2, 3, max(count, 1)))
        turn *= self.tilt / np.linalg.norm(turn, 2)
        sway = Mixed(hung, np.vstack((np.eye(3), turn)))
        if angles is None or not count:
            return sway
        directions /= np.linalg.norm(directions, axis=1, keepdims=True) * math.sqrt(count)
        slide = np.vstack((self.skin_shift * directions[0], self.skin * directions[1]))
        return Sum((sway, Mixed(Sine(angles), slide)))
