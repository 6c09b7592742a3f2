"""Chains by name: an arm of a person, a machine that is taught, a free chain of five; and how units sit on them.

Units have errors of mounting, and soft tissue between bone and unit.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.units import deg
from plumbob.data.array import Quat, UnitMount, Vec
from plumbob.data.chain import Chain, Joint, Limits, Segment
from plumbob.rotations import quat_from_rotvec, quat_multiply
from plumbob.simulation.errors import stream
from plumbob.simulation.signals import Driven, Mixed, Signal, Sine, Sum

_X: Final[Vec] = (1.0, 0.0, 0.0)
_Y: Final[Vec] = (0.0, 1.0, 0.0)
_Z: Final[Vec] = (0.0, 0.0, 1.0)
_ON_TOP: Final[Quat] = (1.0, 0.0, 0.0, 0.0)
_ON_SIDE: Final[Quat] = (sqrt(0.5), sqrt(0.5), 0.0, 0.0)
"""A quarter turn about the segment's x axis: the unit's z axis points to the right."""


def _range(low: float, high: float, velocity: float, acceleration: float, jerk: float) -> Limits:
    """Limits in degrees, and in degrees per s, s² and s³."""
    return Limits(deg(low), deg(high), deg(velocity), deg(acceleration), deg(jerk))


def _person(low: float, high: float) -> Limits:
    """Limits of a person's joint: lively everyday movement, about 7 rad/s and 70 rad/s²."""
    return Limits(deg(low), deg(high), velocity=deg(400.0), acceleration=deg(4000.0))


def _arm(name: str, *, pronation: bool) -> Chain:
    """Arm of a person on a fixed base: x along each segment, stretched forward where all angles are zero, z up."""
    elbow = _person(-5.0, 135.0)
    return Chain(
        name,
        segments=(
            Segment("base"),
            Segment("upperarm", "upperarm", UnitMount(_ON_TOP, (0.18, 0.0, 0.045))),
            Segment("forearm", "forearm", UnitMount(_ON_SIDE, (0.19, -0.03, 0.0))),
            Segment("hand", "hand", UnitMount(_ON_TOP, (0.05, 0.0, 0.02))),
        ),
        joints=(
            Joint(
                "shoulder", "base", "upperarm", "ball", origin=(0.0, 0.0, 0.5), axes=(_Z, _Y, _X),
                limits=(_person(-60.0, 100.0), _person(-70.0, 80.0), _person(-70.0, 70.0)),
            ),
            Joint(
                "elbow", "upperarm", "forearm", "universal", origin=(0.30, 0.0, 0.0), axes=(_Z, _X),
                limits=(elbow, _person(-80.0, 80.0)),
            ) if pronation else Joint(
                "elbow", "upperarm", "forearm", "hinge", origin=(0.30, 0.0, 0.0), axes=(_Z,), limits=(elbow,)
            ),
            Joint(
                "wrist", "forearm", "hand", "universal", origin=(0.25, 0.0, 0.0), axes=(_Y, _Z),
                limits=(_person(-60.0, 60.0), _person(-25.0, 25.0)),
            ),
        ),
        hand_b=(0.10, 0.0, 0.0),
        base_fixed=True,
    )  # fmt: skip


def _teach() -> Chain:
    """Six-axis machine with axes z, y, y, x, y, x and a unit on each link; 0.82 m from the first joint to the hand."""
    links: Sequence[tuple[Vec, Vec, Limits, UnitMount]] = (
        (_Z, (0.0, 0.0, 0.10), _range(-170, 170, 180, 1200, 12000), UnitMount(_ON_TOP, (0.05, 0.0, 0.08))),
        (_Y, (0.0, 0.0, 0.12), _range(-90, 110, 150, 1200, 12000), UnitMount(_ON_TOP, (0.04, 0.0, 0.15))),
        (_Y, (0.0, 0.0, 0.30), _range(-110, 150, 180, 1200, 12000), UnitMount(_ON_SIDE, (0.05, -0.04, 0.02))),
        (_X, (0.10, 0.0, 0.0), _range(-180, 180, 240, 2000, 20000), UnitMount(_ON_TOP, (0.08, 0.0, 0.03))),
        (_Y, (0.16, 0.0, 0.0), _range(-115, 115, 240, 2000, 20000), UnitMount(_ON_SIDE, (0.03, -0.03, 0.0))),
        (_X, (0.06, 0.0, 0.0), _range(-350, 350, 360, 3000, 30000), UnitMount(_ON_TOP, (0.04, 0.0, 0.03))),
    )
    return Chain(
        "teach",
        segments=(Segment("base"), *(Segment(f"link{k}", f"u{k}", link[3]) for k, link in enumerate(links, 1))),
        joints=tuple(
            Joint(f"j{k}", f"link{k - 1}" if k > 1 else "base", f"link{k}", "hinge", origin=origin, axes=(axis,),
                  limits=(limits,))
            for k, (axis, origin, limits, _) in enumerate(links, 1)
        ),
        hand_b=(0.08, 0.0, 0.0),
        base_fixed=True,
    )  # fmt: skip


def _five() -> Chain:
    """Free chain of five bars, 0.3 m from joint to joint, moved by hand: ball, hinges about x, y and z."""
    levers: Sequence[Vec] = (
        (0.15, 0.03, 0.02), (0.12, 0.0, 0.05), (0.18, 0.03, 0.03), (0.11, -0.03, 0.04), (0.19, 0.0, 0.05),
    )  # fmt: skip
    free = Limits(deg(-80.0), deg(80.0))
    return Chain(
        "five",
        segments=tuple(Segment(f"s{k}", f"u{k}", UnitMount(_ON_TOP, lever)) for k, lever in enumerate(levers, 1)),
        joints=(
            Joint("j12", "s1", "s2", "ball", origin=(0.3, 0.0, 0.0), limits=(free, free, free)),
            *(
                Joint(f"j{k}{k + 1}", f"s{k}", f"s{k + 1}", "hinge", origin=(0.3, 0.0, 0.0), axes=(axis,),
                      limits=(free,))
                for k, axis in ((2, _X), (3, _Y), (4, _Z))
            ),
        ),
        hand_b=(0.3, 0.0, 0.0),
    )  # fmt: skip


CHAINS: Final[Mapping[str, Chain]] = {
    chain.name: chain for chain in (_arm("arm", pronation=False), _arm("arm7", pronation=True), _teach(), _five())
}
"""Chains by name: `arm` (ball, hinge, universal), `arm7` (with pronation), `teach` (six axes), `five` (free)."""


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
        sway = Mixed(hung, np.vstack((np.eye(3), turn)))
        if angles is None or not count:
            return sway
        directions /= np.linalg.norm(directions, axis=1, keepdims=True) * math.sqrt(count)
        slide = np.vstack((self.skin_shift * directions[0], self.skin * directions[1]))
        return Sum((sway, Mixed(Sine(angles), slide)))
