"""Chains by name, each a chain file: an arm of a person, a machine that is taught, a free chain of five, a leg.

Units have errors of mounting, and soft tissue between bone and unit.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.resources import packaged
from plumbob.core.units import deg
from plumbob.data.array import UnitMount
from plumbob.data.chain import Chain, parse_chain
from plumbob.rotations import quat_from_rotvec, quat_multiply
from plumbob.simulation.errors import stream
from plumbob.simulation.signals import Driven, Linear, Signal, Sine, Sum

CHAINS: Final[Mapping[str, Chain]] = {
    name: parse_chain(packaged(f"simulation/chains/{name}.toml")) for name in ("arm", "arm7", "teach", "five", "leg")
}
"""Chains by name: `arm` (ball, hinge, universal), `arm7` (with pronation), `teach` (six axes), `five`, `leg` (free)."""


def named_chain(name: str) -> Chain:
    """Chain of that name.

    Raises
    ------
    ParameterError
        If there is none.
    """
    if name not in CHAINS:
        raise unknown_name("chain", name, CHAINS)
    return CHAINS[name]


def drawn_mounts(chain: Chain, *, angle: float, shift: float, clock: float = 0.0, seed: int) -> dict[str, UnitMount]:
    """True mounts of a chain's units, by name: the chain's own with a drawn error.

    `angle`: largest turn of a unit, rad: the rotation vector is drawn evenly from the ball of that radius, rms 0.77 of
    it; `shift`: largest displacement, m, drawn in the same way; `clock`: largest offset of a clock, s, drawn evenly to
    both sides.
    """
    if not (0.0 <= angle <= math.pi and 0.0 <= shift < math.inf and 0.0 <= clock < math.inf):
        raise ParameterError(
            f"a mounting error must be 0 to π rad, 0 m or more and 0 s or more, but it is {angle:g} rad, {shift:g} m "
            f"and {clock:g} s."
        )
    return {link.unit: _off(link.mount, angle, shift, clock, link.unit, seed) for link in chain.segments if link.unit}


def _off(mount: UnitMount, angle: float, shift: float, clock: float, unit: str, seed: int) -> UnitMount:
    turn = quat_from_rotvec(angle * _in_ball(stream(seed, unit, "mount angle")))
    way = shift * _in_ball(stream(seed, unit, "mount shift"))
    return replace(
        mount,
        q_bs=tuple(quat_multiply(np.array(mount.q_bs), turn).tolist()),
        lever_b=tuple((np.array(mount.lever_b) + way).tolist()),
        clock_offset=mount.clock_offset + clock * float(stream(seed, unit, "mount clock").uniform(-1.0, 1.0)),
    )


def chain_mounts(chain: Chain, given: Mapping[str, UnitMount]) -> dict[str, UnitMount]:
    """Mounts of a chain's units, by name: those given, else the chain's own."""
    nominal = {segment.unit: segment.mount for segment in chain.segments if segment.unit}
    unknown = [name for name in given if name not in nominal]
    if unknown:
        raise unknown_name("unit", unknown[0], nominal, of=chain.name)
    return nominal | dict(given)


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
        if not (all(0.0 <= size < math.inf for size in numbers) and self.frequency > 0.0 and 0.0 <= self.damping < 1.0):
            raise ParameterError(
                f"soft tissue needs a frequency above 0, a damping from 0 to below 1, and nothing else below 0: {self}."
            )

    def sway(self, rng: np.random.Generator, *, start: float, step: float, force: Floats, angles: Signal | None,
             count: int) -> Signal:  # fmt: skip
        """Way and turn of a unit about its mean place and attitude, segment axes: 6 components, m and rad.

        `force` (m, 3): specific force at the unit's place, segment axes, m/s², from `start` on each `step`, s;
        `angles`: of the segment's joint, with `count` components.
        """
        hung = Driven(start, step, -(force - force.mean(axis=0)), 2.0 * math.pi * self.frequency, self.damping)
        turn, directions = rng.standard_normal((3, 3)), rng.standard_normal((2, 3, max(count, 1)))
        turn *= self.tilt / np.linalg.norm(turn, 2)
        sway = Linear(hung, np.vstack((np.eye(3), turn)).T.__rmatmul__)
        if angles is None or not count:
            return sway
        directions /= np.linalg.norm(directions, axis=1, keepdims=True) * math.sqrt(count)
        slide = np.vstack((self.skin_shift * directions[0], self.skin * directions[1]))
        return Sum((sway, Linear(Sine(angles), slide.T.__rmatmul__)))
