"""What joints mean to the units beside them: arms and axes in the units' own axes."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg
from plumbob.data.array import UnitMount
from plumbob.data.chain import Chain, Joint

GROUND: Final = -1  # number of the parent where that is a root that stands still and has no unit

PLAY: Final = deg(1.5)
"""A joint's axis strays from that of a perfect hinge by so much, rad, where nothing better is known."""
FORCE_SD: Final = 0.3
"""Forces at a joint, as both sides have it, differ by so much, m/s², where nothing better is known."""
PLAY_TIME, FORCE_TIME = 1.0, 0.15  # for how long each lasts, s


@dataclass(frozen=True, eq=False)
class JointLink:
    """A joint as the units of its two segments see it.

    `parent`, `child`: numbers of both units, `GROUND` for a root that stands still; `arms` (2, 3): from each unit to
    the joint's centre, in its axes, m, from the root's origin on the ground; `axes` (2, K, 3) as parent and child have
    them: one of a hinge, of a universal joint the parent's first and the child's second, three of a fixed joint, none
    of a ball; `play`: standard deviation of what both sides say of an axis, of each component, rad; `force_sd`: of the
    force at the centre as one side has it, m/s²; `play_time`, `force_time`: how long either lasts, s.
    """

    joint: Joint
    parent: int
    child: int
    arms: Floats
    axes: Floats
    play: float = PLAY
    force_sd: float = FORCE_SD
    play_time: float = PLAY_TIME
    force_time: float = FORCE_TIME


def unit_numbers(chain: Chain) -> dict[str, int]:
    """Number of the unit on each segment, by the segment's name; `GROUND` for a root that stands still without one.

    ParameterError if another segment has no unit.
    """
    numbers: dict[str, int] = {}
    for place, segment in enumerate(chain.segments):
        if segment.unit:
            numbers[segment.name] = sum(number != GROUND for number in numbers.values())
        elif place == 0 and chain.base_fixed:
            numbers[segment.name] = GROUND
        else:
            raise ParameterError(
                f"the segment '{segment.name}' of {chain.name} has no unit, so nothing says how it turns. Put a unit "
                "on it, or make one joint of those on both sides of it."
            )
    return numbers


def chain_links(chain: Chain) -> list[JointLink]:
    """Links of a chain whose geometry is known, with the mounts of its units."""
    numbers = unit_numbers(chain)
    mounts = {segment.name: segment.mount for segment in chain.segments}
    links = []
    for joint in chain.joints:
        parent, child = numbers[joint.parent], numbers[joint.child]
        before, after = UnitMount() if parent == GROUND else mounts[joint.parent], mounts[joint.child]
        place_b = before.dcm.T @ (np.array(joint.place) - np.array(before.lever_b))
        arms = np.stack([place_b, after.dcm.T @ -np.array(after.lever_b)])
        links.append(JointLink(joint, parent, child, arms, joint_axes(joint, before, after)))
    return links


def joint_axes(joint: Joint, before: UnitMount, after: UnitMount) -> Floats:
    """Axes of a joint in the axes of the units before and behind it, (2, K, 3)."""
    in_parent, in_child = before.dcm.T @ UnitMount(joint.q_pc).dcm, after.dcm.T
    if joint.kind == "fixed":
        return np.stack([in_parent.T, in_child.T])
    if joint.kind == "ball":
        return np.zeros((2, 0, 3))
    first, last = np.array(joint.axes[0]), np.array(joint.axes[-1])
    return np.stack([(in_parent @ first)[np.newaxis], (in_child @ last)[np.newaxis]])
