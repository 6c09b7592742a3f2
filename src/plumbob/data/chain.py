"""A body of segments that joints connect: an arm, a leg, a machine; what is known of it before anything is measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.text import FactsText, counted
from plumbob.data.array import Quat, UnitMount, Vec
from plumbob.rotations import (
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_rotate,
    rotation_from_quat,
    wrap,
)

DEGREES_OF_FREEDOM: Final = {"fixed": 0, "hinge": 1, "universal": 2, "ball": 3}
"""Kinds of joints, and how many angles each has."""

_BALL: Final[tuple[Vec, ...]] = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
"""Axes of a ball joint's angles where none are named: yaw, pitch, roll of the child in the parent."""


class Limits(NamedTuple):
    """What an angle of a joint may do; infinite where nothing is said.

    Attributes
    ----------
    low, high : float
        Ends of its range, rad.
    velocity, acceleration, jerk : float
        Greatest magnitudes, rad/s, rad/s², rad/s³.
    """

    low: float = -np.inf
    high: float = np.inf
    velocity: float = np.inf
    acceleration: float = np.inf
    jerk: float = np.inf


@dataclass(frozen=True, slots=True)
class Segment:
    """One rigid part."""

    name: str
    unit: str = ""  # name of the unit on it; empty where it has none
    # how that unit sits on it, as far as is known: axes and lever from the segment's origin, in segment axes
    mount: UnitMount = field(default_factory=UnitMount)


@dataclass(frozen=True, slots=True)
class Joint:
    """Connection of two segments. The child's origin is the joint's centre.

    The child's attitude in the parent's axes is ``q_pc ⊗ turn(axes[0], angle[0]) ⊗ turn(axes[1], angle[1]) ⊗ …``.
    """

    name: str
    # parent, child: names of the segments
    parent: str
    child: str
    kind: str = "hinge"  # "hinge", "universal", "ball" or "fixed"
    # its centre from the parent's origin, parent axes, m; None where neither it nor the axes are known
    origin: Vec | None = (0.0, 0.0, 0.0)
    q_pc: Quat = (1.0, 0.0, 0.0, 0.0)  # from the child's axes to the parent's where all angles are zero, wxyz
    # Axis of each angle, in the child's axes where the angles behind it are zero; unit vectors. Neighbours are at right
    # angles. A ball joint without any has yaw, pitch and roll of the child in the parent.
    axes: tuple[Vec, ...] = ()
    limits: tuple[Limits, ...] = ()  # of each angle; none: without limits

    def __post_init__(self) -> None:
        """Validate, and normalise axes and rotation."""
        count = DEGREES_OF_FREEDOM[check.one_of(f"kind of joint '{self.name}'", self.kind, tuple(DEGREES_OF_FREEDOM))]
        axes = _BALL if self.kind == "ball" and not self.axes else self.axes
        if self.known and len(axes) != count:
            raise ParameterError(
                f"the joint '{self.name}' is a {self.kind} and needs {counted(count, 'axis', 'axes')}, "
                f"but it has {len(axes)}."
            )
        lengths = [float(np.linalg.norm(axis)) for axis in axes]
        if any(not 1e-6 < length < np.inf for length in lengths):
            raise ParameterError(f"an axis of the joint '{self.name}' has no direction: {axes}.")
        unit = tuple(
            tuple((np.asarray(axis, dtype=np.float64) / length).tolist())
            for axis, length in zip(axes, lengths, strict=True)
        )
        for first, second in pairwise(unit):
            if abs(np.dot(first, second)) > 1e-6:
                raise ParameterError(
                    f"two axes of the joint '{self.name}' that follow each other must be at right angles, but "
                    f"{first} and {second} are not."
                )
        q = check.last_axis("q_pc", self.q_pc, 4)
        check.unit_norm("q_pc", q, 1e-3)
        limits = self.limits or (Limits(),) * count
        if len(limits) != count:
            raise ParameterError(f"the joint '{self.name}' has {counted(count, 'angle')}, but {len(limits)} limits.")
        for limit in limits:
            _require_limits(self.name, limit)
        object.__setattr__(self, "axes", unit)
        object.__setattr__(self, "limits", limits)
        object.__setattr__(self, "q_pc", tuple((q / np.linalg.norm(q)).tolist()))

    @property
    def known(self) -> bool:
        """Whether its place and axes are known; `plumbob.arm.align` finds those that are not."""
        return self.origin is not None

    @property
    def place(self) -> Vec:
        """Its origin; a ParameterError where that is not known."""
        if self.origin is None:
            raise ParameterError(
                f"the chain does not say where {self.name} lies. Find it with plumbob arm align, and use the card that "
                "it writes."
            )
        return self.origin

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of its angles: its own, with 1, 2, 3 behind where it has several."""
        count = DEGREES_OF_FREEDOM[self.kind]
        return (self.name,) if count == 1 else tuple(f"{self.name}{k + 1}" for k in range(count))

    def turned(self, angles: Floats) -> Floats:
        """Attitude of the child in the parent's axes (N, 4) at angles (N, degrees of freedom), rad."""
        q = np.broadcast_to(np.array(self.q_pc), (len(angles), 4))
        for k, axis in enumerate(self.axes):
            q = quat_multiply(q, quat_from_rotvec(angles[:, k, np.newaxis] * np.array(axis)))
        return q

    def angles_of(self, q_pc: Floats) -> Floats:
        """Angles (N, degrees of freedom), rad, that come nearest to attitudes of the child in the parent (N, 4)."""
        turn = quat_multiply(quat_conjugate(np.array(self.q_pc)), q_pc)
        count = len(self.axes)
        if count == 0:
            return np.zeros((len(q_pc), 0))
        if count == 1:
            twist = turn[:, 1:] @ np.array(self.axes[0])
            angle = 2.0 * np.arctan2(twist, turn[:, 0])
            return wrap(angle)[:, np.newaxis]
        axes = np.array(self.axes)
        if count == 2:
            axes = np.vstack((axes, np.cross(axes[0], axes[1])))
        angles = np.full((len(q_pc), 3), np.nan)
        finite = np.isfinite(turn).all(axis=1)
        if finite.any():
            angles[finite] = rotation_from_quat(turn[finite]).as_davenport(axes, "intrinsic")
        return angles[:, :count]


def _require_limits(name: str, limits: Limits) -> None:
    """Refuse a range without room, and rates that allow no motion."""
    if not limits.low < limits.high:
        raise ParameterError(
            f"the range of the joint '{name}' must increase, but it is {limits.low:.6g} to {limits.high:.6g} rad."
        )
    for what in ("velocity", "acceleration", "jerk"):
        if not getattr(limits, what) > 0.0:
            raise ParameterError(f"the {what} that '{name}' may have must be above 0; it is {getattr(limits, what)}.")


class Posture(NamedTuple):
    """Where a segment is: ``q_nb`` (N, 4) and the position of its origin ``pos_n`` (N, 3), m."""

    q_nb: Floats
    pos_n: Floats


@dataclass(frozen=True, eq=False)
class Chain(FactsText):
    """Segments, joints, and the hand.

    Attributes
    ----------
    name : str
        Name.
    segments : tuple of Segment
        The first is the root.
    joints : tuple of Joint
        Each segment but the root is the child of one; parents come before their children.
    hand : str
        Segment that the hand belongs to; the last one where empty.
    hand_b : tuple of 3 floats
        The hand's place from that segment's origin, in its axes, m.
    base_fixed : bool
        Whether the root stands still on the ground.

    Raises
    ------
    ParameterError
        If names are unknown or occur twice, or a segment has no joint or two.
    """

    name: str
    segments: tuple[Segment, ...]
    joints: tuple[Joint, ...] = ()
    hand: str = ""
    hand_b: Vec = (0.0, 0.0, 0.0)
    base_fixed: bool = False

    def __post_init__(self) -> None:
        """Validate."""
        for what, names in (
            ("segment", [segment.name for segment in self.segments]),
            ("joint", [joint.name for joint in self.joints]),
            ("unit", [segment.unit for segment in self.segments if segment.unit]),
        ):
            twice = next((name for name in names if names.count(name) > 1), None)
            if twice is not None:
                raise ParameterError(f"the {what} '{twice}' of {self.name} occurs twice; each needs a name of its own.")
        if not self.segments:
            raise ParameterError(f"{self.name} needs at least one segment.")
        reached = {self.segments[0].name}
        for joint in self.joints:
            if joint.parent not in reached:
                raise ParameterError(
                    f"the joint '{joint.name}' hangs on '{joint.parent}', which is neither the first segment nor the "
                    "child of a joint before it; put the joints in order from the root."
                )
            if joint.child not in self.places or joint.child in reached:
                raise ParameterError(
                    f"the joint '{joint.name}' moves '{joint.child}', which is not a segment, or already has a joint."
                )
            reached.add(joint.child)
        alone = [name for name in self.places if name not in reached]
        if alone:
            raise ParameterError(f"no joint moves {', '.join(alone)}; every segment but the first needs one.")
        if self.hand and self.hand not in self.places:
            raise ParameterError(f"the hand is on '{self.hand}', but segments are {', '.join(self.places)}.")

    @property
    def known(self) -> bool:
        """Whether place and axes of every joint are known."""
        return all(joint.known for joint in self.joints)

    @property
    def places(self) -> Mapping[str, int]:
        """Number of each segment, by name."""
        return {segment.name: k for k, segment in enumerate(self.segments)}

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of all angles, in the order of the joints."""
        return tuple(name for joint in self.joints for name in joint.angles)

    @property
    def limits(self) -> tuple[Limits, ...]:
        """Limits of all angles, in the order of the joints."""
        return tuple(limit for joint in self.joints for limit in joint.limits)

    @property
    def length(self) -> float:
        """Arm's length: from the first joint along the chain to the hand, m."""
        at, total = self.hand or self.segments[-1].name, float(np.linalg.norm(self.hand_b))
        by_child = {joint.child: joint for joint in self.joints}
        while at in by_child and by_child[at].parent in by_child:
            total += float(np.linalg.norm(np.array(by_child[at].place)))
            at = by_child[at].parent
        return total

    def facts(self) -> Mapping[str, str]:
        """Segments, joints and length."""
        return {
            "name": self.name,
            "segments": ", ".join(self.places),
            "joints": ", ".join(f"{joint.name} ({joint.kind})" for joint in self.joints),
            "length": f"{self.length:.3g} m" if self.known else "not known",
        }

    def split(self, angles: Floats) -> list[Floats]:
        """Angles (N, all) by joint."""
        cuts = np.cumsum([len(joint.axes) for joint in self.joints])[:-1]
        return np.split(angles, cuts, axis=1)

    def postures(
        self, angles: Floats, q_nb: Floats | Quat = (1.0, 0, 0, 0), pos_n: Floats | Vec = (0.0, 0, 0)
    ) -> dict[str, Posture]:
        """Where every segment is.

        Parameters
        ----------
        angles : ndarray (N, all angles)
            rad, in the order of `angles`.
        q_nb : array_like (4,) or (N, 4)
            Attitude of the root.
        pos_n : array_like (3,) or (N, 3)
            Position of the root's origin, m.
        """
        count = len(angles)
        root = Posture(
            np.broadcast_to(np.asarray(q_nb, dtype=np.float64), (count, 4)),
            np.broadcast_to(np.asarray(pos_n, dtype=np.float64), (count, 3)),
        )
        postures = {self.segments[0].name: root}
        for joint, turns in zip(self.joints, self.split(angles), strict=True):
            parent = postures[joint.parent]
            postures[joint.child] = Posture(
                quat_multiply(parent.q_nb, joint.turned(turns)),
                parent.pos_n + quat_rotate(parent.q_nb, np.array(joint.place)),
            )
        return postures

    def angles_of(self, q_nb: Mapping[str, Floats]) -> Floats:
        """Angles (N, all), rad, that come nearest to attitudes (N, 4) of the segments, by name."""
        angles: Sequence[Floats] = [
            joint.angles_of(quat_multiply(quat_conjugate(q_nb[joint.parent]), q_nb[joint.child]))
            for joint in self.joints
        ]
        return np.concatenate(angles, axis=1) if angles else np.zeros((len(next(iter(q_nb.values()))), 0))

    def hand_at(self, postures: Mapping[str, Posture]) -> Floats:
        """Position of the hand (N, 3), m."""
        at = postures[self.hand or self.segments[-1].name]
        return at.pos_n + quat_rotate(at.q_nb, np.array(self.hand_b))
