"""Chains from and to URDF, the robot description of ROS.

URDF is read by pytransform3d, which also moves the model in a replay, by code that is not ours. What it passes over is
looked at here before: whether the XML is whole, limits of velocity and joints that mimic others. URDF knows one angle
for each joint, so a ball or universal joint is written as hinges with links of no size between them, and hinges that
share their centre are made one again where that is asked for.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, MissingExtraError, ParameterError, one_line
from plumbob.core.files import reading, text_of
from plumbob.data.array import Quat, UnitMount, Vec
from plumbob.data.chain import Chain, Joint, Limits, Segment
from plumbob.rotations import euler_zyx_from_quat, quat_from_dcm, quat_multiply, quat_rotate

if TYPE_CHECKING:
    from types import ModuleType

_TURNING: Final = ("revolute", "continuous")
_SAME: Final = 1e-9  # joints whose centres are this near to each other share one, m
_ZERO: Final = (0.0, 0.0, 0.0)
_LEVEL: Final = (1.0, 0.0, 0.0, 0.0)
_NO_EFFORT: Final = 0  # URDF asks for a greatest torque, which a chain does not know


def parser() -> "ModuleType":
    """Module that reads URDF; an error if it is not installed."""
    try:
        from pytransform3d import urdf
    except ImportError as error:
        raise MissingExtraError('URDF needs pytransform3d: pip install "plumbob[arm]".') from error
    return urdf


def read_urdf(path: str | Path) -> str:
    """Text of a URDF file; an error if it cannot be read, or is not whole XML with a robot in it."""
    file = Path(path)
    text = text_of(file, "URDF")
    with reading(file):
        _root(text)
    return text


def chain_from_urdf(
    path: str | Path, *, units: Mapping[str, str] | None = None, mounts: Mapping[str, UnitMount] | None = None,
    hand: str = "", hand_b: Vec = (0.0, 0.0, 0.0), merge: bool = False,
) -> Chain:  # fmt: skip
    """Chain of a URDF file, with its root fixed to the ground.

    Parameters
    ----------
    path : path
        The file.
    units : mapping of str to str, optional
        Name of the unit on each link that has one.
    mounts : mapping of str to UnitMount, optional
        How they sit on their links, in the axes of the links.
    hand : str
        Link that the hand belongs to; the last one where empty.
    hand_b : tuple of 3 floats
        The hand's place on it, m.
    merge : bool
        Whether two or three hinges that share their centre, with axes at right angles, become a universal or ball
        joint; the links between them are left out.

    Returns
    -------
    Chain
        Joints in order from the root.

    Raises
    ------
    DecodeError
        If the file is not a URDF, or has a joint that slides, floats or mimics another.
    ParameterError
        If a unit belongs to no link.
    MissingExtraError
        If pytransform3d is not installed.
    """
    urdf = parser()
    text = read_urdf(path)
    with reading(Path(path)):
        root = _root(text)
        speeds = _speeds(root)
        try:
            name, links, joints = urdf.parse_urdf(text)
        except (urdf.UrdfException, ValueError, KeyError, AttributeError) as error:
            raise DecodeError(f"it is not a URDF that can be read: {one_line(error)}") from error
        ordered = _ordered([_joint(parsed, speeds) for parsed in joints], [link.name for link in links])
        if merge:
            needed = set(units or {}) | {hand}
            ordered = _merged(ordered, needed)
        on, sits = units or {}, mounts or {}
        names = [ordered[0].parent if ordered else links[0].name, *(joint.child for joint in ordered)]
        for link in (*on, *sits):
            if link not in names:
                raise ParameterError(f"there is no link '{link}'; links are {', '.join(names)}.")
        segments = tuple(Segment(link, on.get(link, ""), sits.get(link, UnitMount())) for link in names)
        return Chain(name, segments, tuple(ordered), hand or names[-1], hand_b, base_fixed=True)


def _root(text: str) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(text.strip())
    except (ElementTree.ParseError, ValueError) as error:
        raise DecodeError(f"it is not complete XML: {one_line(error)}.") from error
    if root.tag.rpartition("}")[2] != "robot":
        raise DecodeError(f"its first tag is <{root.tag}>, but a URDF begins with <robot>.")
    return root


def _speeds(root: ElementTree.Element) -> dict[str, float]:
    """Greatest velocity of each joint that states one, rad/s; refuses what would be passed over."""
    speeds = {}
    for joint in root.iter("joint"):
        name, kind = joint.get("name", ""), joint.get("type")
        if kind is None:
            continue  # of a transmission, or refused by the parser
        if kind not in (*_TURNING, "fixed"):
            raise DecodeError(
                f"the joint '{name}' is {kind}, but a chain has joints that turn: revolute, continuous and fixed."
            )
        if joint.find("mimic") is not None:
            raise DecodeError(f"the joint '{name}' mimics another, which a chain cannot do; make it fixed, or free.")
        limit = joint.find("limit")
        if kind in _TURNING and limit is not None and (text := limit.get("velocity")) is not None:
            try:
                speed = float(text)
            except ValueError as error:
                raise DecodeError(f"the velocity of the joint '{name}' is '{text}', not a number.") from error
            if speed > 0.0:  # by custom, 0 says that it is not known
                speeds[name] = speed
    return speeds


def _joint(parsed: Any, speeds: Mapping[str, float]) -> Joint:
    turn = np.asarray(parsed.child2parent, dtype=np.float64)
    origin = tuple(turn[:3, 3].tolist())
    q_pc = tuple(quat_from_dcm(turn[:3, :3]).tolist())
    if parsed.joint_type == "fixed":
        return Joint(parsed.joint_name, parsed.parent, parsed.child, "fixed", origin, q_pc)
    low, high = parsed.limits if parsed.joint_type == "revolute" else (-np.inf, np.inf)
    limits = Limits(float(low), float(high), speeds.get(parsed.joint_name, np.inf))
    axis = tuple(np.asarray(parsed.joint_axis, dtype=np.float64).tolist())
    return Joint(parsed.joint_name, parsed.parent, parsed.child, "hinge", origin, q_pc, (axis,), (limits,))


def _ordered(joints: Sequence[Joint], links: Sequence[str]) -> list[Joint]:
    """Joints from the root, each behind the one that moves its parent."""
    children = {joint.child for joint in joints}
    roots = [link for link in links if link not in children]
    if len(roots) != 1:
        raise DecodeError(
            f"exactly one link must be the root, but there are {len(roots)}: {', '.join(roots) or 'a circle'}."
        )
    ordered: list[Joint] = []
    reached, pending = {roots[0]}, list(joints)
    while pending:
        ready = [joint for joint in pending if joint.parent in reached]
        if not ready:
            raise DecodeError(f"the joint '{pending[0].name}' is not connected to the root '{roots[0]}'.")
        ordered += ready
        reached |= {joint.child for joint in ready}
        pending = [joint for joint in pending if joint not in ready]
    return ordered


def _merged(joints: Sequence[Joint], needed: set[str]) -> list[Joint]:
    """Joints in which hinges with one centre are one; links in `needed` stay."""
    merged: list[Joint] = []
    for joint in joints:
        before = next((k for k, other in enumerate(merged) if other.child == joint.parent), None)
        others = [other for other in joints if other.parent == joint.parent and other is not joint]
        made = None
        if before is not None and not others and joint.parent not in needed:
            made = _combined(merged[before], joint)
        if made is None or before is None:
            merged.append(joint)
        else:
            merged[before] = made
    return merged


def _combined(first: Joint, second: Joint) -> Joint | None:
    """Two joints as one; None where they cannot be: another centre, too many axes, or axes that are not square."""
    kinds = {2: "universal", 3: "ball"}
    count = len(first.axes) + len(second.axes)
    if second.kind != "hinge" or first.kind == "fixed" or count not in kinds:
        return None
    if np.linalg.norm(second.place) > _SAME:
        return None
    # first.q ⊗ turn(a) ⊗ second.q ⊗ turn(b) = first.q ⊗ second.q ⊗ turn(second.q⁻¹ a) ⊗ turn(b)
    back = np.array(second.q_pc) * [1.0, -1.0, -1.0, -1.0]
    axes = [quat_rotate(back, np.array(axis)) for axis in first.axes] + [np.array(second.axes[0])]
    if abs(float(axes[-1] @ axes[-2])) > 1e-6:
        return None
    return replace(
        first,
        name=_common(first.name, second.name),
        child=second.child,
        kind=kinds[count],
        q_pc=tuple(quat_multiply(np.array(first.q_pc), np.array(second.q_pc)).tolist()),
        axes=tuple(tuple(axis.tolist()) for axis in axes),
        limits=first.limits + second.limits,
    )


def _common(first: str, second: str) -> str:
    """Name of joints that are one: what ``shoulder1`` and ``shoulder2`` have in common, or both."""
    stem = first.rstrip("0123456789")
    return stem if stem and second.rstrip("0123456789") == stem else f"{first}_{second}"


def urdf_text(chain: Chain) -> str:
    """URDF of a chain: a hinge for each angle, named like it, and links of no size between those of one joint.

    URDF has no place for limits of acceleration and jerk, for units, or for a chain that is not fixed; they are left
    out. The hand is a link ``NAME_hand`` on a fixed joint, where it is not at the origin of its segment.
    """
    return "\n".join(_lines(chain)) + "\n"


def hand_link(chain: Chain) -> str:
    """Link of the URDF whose origin is the hand."""
    at = chain.hand or chain.segments[-1].name
    return f"{at}_hand" if any(chain.hand_b) else at


def _lines(chain: Chain) -> Iterator[str]:
    yield '<?xml version="1.0"?>'
    yield f"<robot name={quoteattr(chain.name)}>"
    yield f"  <link name={quoteattr(chain.segments[0].name)}/>"
    for joint in chain.joints:
        if joint.kind == "fixed":
            yield from _placed(joint.name, joint.parent, joint.child, joint.place, joint.q_pc)
        parent, count = joint.parent, len(joint.axes)
        for k, (name, axis, limits) in enumerate(zip(joint.angles, joint.axes, joint.limits, strict=True)):
            child = joint.child if k == count - 1 else f"{joint.child}_{k + 1}"
            origin, turn = (_ZERO, _LEVEL) if k else (joint.place, joint.q_pc)
            yield from _placed(name, parent, child, origin, turn, axis, limits)
            parent = child
    if any(chain.hand_b):
        at = chain.hand or chain.segments[-1].name
        yield from _placed(f"{at}_to_hand", at, hand_link(chain), chain.hand_b, _LEVEL)
    yield "</robot>"


def _placed(
    name: str, parent: str, child: str, origin: Vec, q_pc: Quat, axis: Vec | None = None, limits: Limits | None = None
) -> Iterator[str]:
    """A link and the joint that carries it: fixed, or a hinge with its limits where it has an axis."""
    limits = limits or Limits()
    bounded = bool(np.isfinite(limits.low) and np.isfinite(limits.high))
    kind = "fixed" if axis is None else "revolute" if bounded else "continuous"
    yaw, pitch, roll = euler_zyx_from_quat(np.array(q_pc)).tolist()  # rpy of URDF: about fixed x, y, z, in this order
    yield f"  <link name={quoteattr(child)}/>"
    yield f"  <joint name={quoteattr(name)} type={quoteattr(kind)}>"
    yield f"    <parent link={quoteattr(parent)}/>"
    yield f"    <child link={quoteattr(child)}/>"
    yield f'    <origin xyz="{_numbers(origin)}" rpy="{_numbers((roll, pitch, yaw))}"/>'
    if axis is not None:
        yield f'    <axis xyz="{_numbers(axis)}"/>'
        if bounded or np.isfinite(limits.velocity):
            ends = f'lower="{float(limits.low)!r}" upper="{float(limits.high)!r}" ' if bounded else ""
            speed = float(limits.velocity) if np.isfinite(limits.velocity) else 0.0
            yield f'    <limit {ends}effort="{_NO_EFFORT}" velocity="{speed!r}"/>'
    yield "  </joint>"


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def moved(text: str, names: Sequence[str], angles: Floats, link: str) -> Floats:
    """Poses (N, 4, 4) of a link in the root while joints move by angles (N, K), rad, by pytransform3d's kinematics."""
    model = parser().UrdfTransformManager(check=False)
    model.load_urdf(text)
    root = _root(text)
    kinds = {node.get("name"): node.get("type") for node in root.iter("joint") if node.get("type") is not None}
    unknown = [name for name in names if kinds.get(name) not in _TURNING]
    if unknown:
        turning = [str(name) for name, kind in kinds.items() if kind in _TURNING]
        raise ParameterError(f"the URDF has no joint {', '.join(unknown)} that turns; it has {', '.join(turning)}.")
    links = [str(node.get("name")) for node in root.iter("link")]
    if link not in links:
        raise ParameterError(f"the URDF has no link '{link}'; links are {', '.join(links)}.")
    for name, values in zip(names, angles.T, strict=True):
        low, high = model.get_joint_limits(name)
        if values.min() < low or values.max() > high:
            raise ParameterError(
                f"{name} goes from {values.min():.6g} to {values.max():.6g} rad, but the URDF allows {low:.6g} to "
                f"{high:.6g} rad."
            )
    children = {
        child for node in root.iter("joint") if (at := node.find("child")) is not None and (child := at.get("link"))
    }
    base = next(name for name in links if name not in children)
    poses = np.empty((len(angles), 4, 4))
    for row, pose in enumerate(angles.tolist()):
        for name, value in zip(names, pose, strict=True):
            model.set_joint(name, value)
        poses[row] = model.get_transform(link, base)
    return poses
