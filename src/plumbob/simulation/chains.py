"""Chains by name: an arm of a person, a machine that is taught, and a free chain of five."""

from collections.abc import Mapping, Sequence
from math import sqrt
from typing import Final

from plumbob.core.errors import ParameterError
from plumbob.core.units import deg
from plumbob.data.array import Quat, UnitMount, Vec
from plumbob.data.chain import Chain, Joint, Limits, Segment

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
        raise ParameterError(f"'{name}' is not a chain; known are {', '.join(CHAINS)}.")
    return CHAINS[name]
