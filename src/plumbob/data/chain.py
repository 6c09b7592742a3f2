"""A body of segments that joints connect: an arm, a leg, a machine; what is known of it before anything is measured.

Chains as TOML files are read strictly, and written so that the same chain is read back.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob import rotations
from plumbob.core import check, schema
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, ShapeError, excerpt
from plumbob.core.files import reading, text_of
from plumbob.core.resources import guide
from plumbob.core.schema import toml_text
from plumbob.core.text import FactsText, counted
from plumbob.core.units import Quantity
from plumbob.data.array import Quat, UnitMount, Vec
from plumbob.data.array_toml import AXES, PLACE, QUATERNION

DEGREES_OF_FREEDOM: Final = {"fixed": 0, "hinge": 1, "universal": 2, "ball": 3}  # of each kind of joint

_BALL: Final[tuple[Vec, ...]] = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
"""Axes of a ball joint's angles where none are named: yaw, pitch, roll of the child in the parent."""


class Limits(NamedTuple):
    """What an angle of a joint may do; infinite where nothing is said."""

    # low, high: ends of its range, rad; velocity, acceleration, jerk: greatest magnitudes, rad/s, rad/s², rad/s³
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
    angle_names: tuple[str, ...] = ()  # of its angles; none: its own name, with 1, 2, 3 behind where it has several

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
        if self.angle_names and len(self.angle_names) != count:
            raise ParameterError(
                f"the joint '{self.name}' has {counted(count, 'angle')}, but names {self.angle_names}."
            )
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
        """Names of its angles."""
        count = DEGREES_OF_FREEDOM[self.kind]
        if self.angle_names:
            return self.angle_names
        return (self.name,) if count == 1 else tuple(f"{self.name}{k + 1}" for k in range(count))

    def rotation(self, angles: Floats) -> Floats:
        """Attitude of the child in the parent's axes (N, 4) at angles (N, degrees of freedom), rad."""
        q = np.broadcast_to(np.array(self.q_pc), (len(angles), 4))
        for k, axis in enumerate(self.axes):
            q = rotations.quat_multiply(q, rotations.quat_from_rotvec(angles[:, k, np.newaxis] * np.array(axis)))
        return q

    def angles_of(self, q_pc: Floats) -> Floats:
        """Angles (N, degrees of freedom), rad, that come nearest to attitudes of the child in the parent (N, 4)."""
        turn = rotations.quat_multiply(rotations.quat_conjugate(np.array(self.q_pc)), q_pc)
        count = len(self.axes)
        if count == 0:
            return np.zeros((len(q_pc), 0))
        if count == 1:
            twist = turn[:, 1:] @ np.array(self.axes[0])
            angle = 2.0 * np.arctan2(twist, turn[:, 0])
            return rotations.wrap(angle)[:, np.newaxis]
        axes = np.array(self.axes)
        if count == 2:
            axes = np.vstack((axes, np.cross(axes[0], axes[1])))
        angles = np.full((len(q_pc), 3), np.nan)
        finite = np.isfinite(turn).all(axis=1)
        if finite.any():
            angles[finite] = rotations.rotation_from_quat(turn[finite]).as_davenport(axes, "intrinsic")
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
        """Where every segment is at angles (N, all), rad, with its root at one or N attitudes and positions, m."""
        count = len(angles)
        root = Posture(
            np.broadcast_to(np.asarray(q_nb, dtype=np.float64), (count, 4)),
            np.broadcast_to(np.asarray(pos_n, dtype=np.float64), (count, 3)),
        )
        postures = {self.segments[0].name: root}
        for joint, turns in zip(self.joints, self.split(angles), strict=True):
            parent = postures[joint.parent]
            postures[joint.child] = Posture(
                rotations.quat_multiply(parent.q_nb, joint.rotation(turns)),
                parent.pos_n + rotations.quat_rotate(parent.q_nb, np.array(joint.place)),
            )
        return postures

    def angles_of(self, q_nb: Mapping[str, Floats]) -> Floats:
        """Angles (N, all), rad, that come nearest to attitudes (N, 4) of the segments, by name."""
        angles: Sequence[Floats] = [
            joint.angles_of(rotations.quat_multiply(rotations.quat_conjugate(q_nb[joint.parent]), q_nb[joint.child]))
            for joint in self.joints
        ]
        return np.concatenate(angles, axis=1) if angles else np.zeros((len(next(iter(q_nb.values()))), 0))

    def hand_at(self, postures: Mapping[str, Posture]) -> Floats:
        """Position of the hand (N, 3), m."""
        at = postures[self.hand or self.segments[-1].name]
        return at.pos_n + rotations.quat_rotate(at.q_nb, np.array(self.hand_b))


KIND: Final = "plumbob chain"
VERSION: Final = 1
GUIDE: Final = guide("arm-teach.md")
_LIMITS: Final = {
    "low": Quantity.ANGLE,
    "high": Quantity.ANGLE,
    "velocity": Quantity.RATE,
    "acceleration": Quantity.ANGULAR_ACCELERATION,
    "jerk": Quantity.ANGULAR_JERK,
}
_LETTERS: Final = {
    sign + letter: tuple(float(sign + "1") * (letter == axis) for axis in "xyz")
    for sign in ("", "-")
    for letter in "xyz"
}


def load_chain(path: str | Path) -> Chain:
    """Read a chain.

    Parameters
    ----------
    path : path
        A TOML file.

    Raises
    ------
    DecodeError
        If it is not TOML, is not a chain, or a key is unknown, missing or of the wrong type.
    UnitError
        If a unit is missing or unknown.
    ParameterError
        If names, axes or limits do not make a chain, as of `Chain`, `Joint` and `UnitMount`.
    FrameError
        If the axes of a unit are not three letters of a right-handed set.
    """
    file = Path(path)
    text = text_of(file, KIND)
    with reading(file):
        return parse_chain(text, name=file.stem)


def parse_chain(text: str, *, name: str = "chain") -> Chain:
    """Chain from TOML text; errors as in `load_chain`. `name` is for one that has none itself."""
    table = schema.document(text, GUIDE, CHAIN)
    hand = table.get("hand", {})
    return Chain(
        table.get("name", name),
        table["segment"],
        table.get("joint", ()),
        hand=hand.get("segment", ""),
        hand_b=hand.get("at", (0.0, 0.0, 0.0)),
        base_fixed=table["base"] == "fixed",
    )


def chain_text(chain: Chain) -> str:
    """TOML text of a chain, in SI and radians; `parse_chain` gives the same chain. Noise of units is not in it."""
    return "\n".join(_lines(chain)) + "\n"


def _lines(chain: Chain) -> Iterator[str]:
    yield f"kind = {toml_text(KIND)}"
    yield f"version = {VERSION}"
    yield f"name = {toml_text(chain.name)}"
    yield f'base = "{"fixed" if chain.base_fixed else "free"}"'
    if chain.hand or any(chain.hand_b):
        place = [f"segment = {toml_text(chain.hand)}"] if chain.hand else []
        yield f"hand = {{ {', '.join([*place, f'at = {_lengths(chain.hand_b)}'])} }}"
    for segment in chain.segments:
        yield from ("", "[[segment]]", f"name = {toml_text(segment.name)}")
        yield from _mounted(segment)
    for joint in chain.joints:
        yield from ("", "[[joint]]")
        yield from (f"{key} = {toml_text(getattr(joint, key))}" for key in ("name", "parent", "child", "kind"))
        if joint.angle_names:
            yield f"angle_names = [{', '.join(map(toml_text, joint.angle_names))}]"
        if joint.origin is None:
            continue
        yield f"origin = {_lengths(joint.origin)}"
        if joint.q_pc != (1.0, 0.0, 0.0, 0.0):
            yield f"q_pc = {list(joint.q_pc)}"
        if joint.axes:
            yield f"axes = {[list(axis) for axis in joint.axes]}"
        if any(limits != Limits() for limits in joint.limits):
            listed = ", ".join(_limits_text(limits) for limits in joint.limits)
            yield f"limits = {listed if len(joint.limits) == 1 else f'[{listed}]'}"


def _mounted(segment: Segment) -> Iterator[str]:
    if segment.unit:
        yield f"unit = {toml_text(segment.unit)}"
    mount, aligned = segment.mount, UnitMount()
    if mount.q_bs != aligned.q_bs:
        yield f"q_bs = {list(mount.q_bs)}"
    if mount.lever_b != aligned.lever_b:
        yield f"lever = {_lengths(mount.lever_b)}"
    if mount.clock_offset:
        yield f"clock_offset = {_with_unit(mount.clock_offset, Quantity.TIME)}"


def _lengths(vector: Vec) -> str:
    texts = ", ".join(_with_unit(value, Quantity.LENGTH) for value in vector)
    return f"[{texts}]"


def _with_unit(value: float, quantity: Quantity) -> str:
    return f'"{float(value)!r} {quantity}"'


def _limits_text(limits: Limits) -> str:
    finite = [(key, getattr(limits, key)) for key in _LIMITS if np.isfinite(getattr(limits, key))]
    texts = ", ".join(f"{key} = {_with_unit(value, _LIMITS[key])}" for key, value in finite)
    return f"{{ {texts} }}"


def _axes(where: str, value: Any) -> tuple[Vec, ...]:
    """Axes as letters, ``"y"`` or ``"z -y"``."""
    words = schema.text(where, value).split()
    unknown = next((word for word in words if word not in _LETTERS), None)
    if unknown is not None:
        raise DecodeError(f"{where} names {excerpt(unknown)}, but an axis is one of {', '.join(_LETTERS)}.")
    return tuple((_LETTERS[word][0], _LETTERS[word][1], _LETTERS[word][2]) for word in words)


def _one_of_two(where: str, table: Mapping[str, Any], key: str, other: str) -> Quat:
    if key in table and other in table:
        raise DecodeError(f"{where} has both {key} and {other}, which say the same; keep one of them.")
    q: Quat = table.get(key, table.get(other, (1.0, 0.0, 0.0, 0.0)))
    return q


def _segment(where: str, table: Mapping[str, Any]) -> Segment:
    lacking = [key for key in _MOUNT if key in table and "unit" not in table]
    if lacking:
        raise DecodeError(f"{where}.{lacking[0]} belongs to a unit, but {where} names none; add unit, or leave it out.")
    mount = UnitMount(
        q_bs=_normed(f"{where}.q_bs", _one_of_two(where, table, "q_bs", "axes")),
        lever_b=table.get("lever", (0.0, 0.0, 0.0)),
        clock_offset=table.get("clock_offset", 0.0),
    )
    return Segment(table["name"], table.get("unit", ""), mount)


def _joint(where: str, table: Mapping[str, Any]) -> Joint:
    if "origin" not in table and set(table) & {"axes", "q_pc", "euler"}:
        raise DecodeError(
            f"{where} has axes or a rotation, but no origin; leave out all of them where it is not known."
        )
    if "origin" in table and table["kind"] in ("hinge", "universal") and "axes" not in table:
        raise DecodeError(f"{where} is a {table['kind']} and needs 'axes', because nothing is guessed.")
    q_pc = _normed(f"{where}.q_pc", _one_of_two(where, table, "q_pc", "euler"))
    plain = {"origin": None} | {key: table[key] for key in table if key not in ("q_pc", "euler")}
    if len(table.get("limits", ())) == 1:  # one for all angles of the joint
        plain["limits"] = table["limits"] * DEGREES_OF_FREEDOM[table["kind"]]
    return Joint(q_pc=q_pc, **plain)


def _normed(where: str, q: Quat) -> Quat:
    """The quaternion, whose norm is judged with its place in the message."""
    if abs(float(np.linalg.norm(q)) - 1.0) > 1e-3:
        raise ShapeError(f"{where} has norm {np.linalg.norm(q):.6g}, but a rotation needs norm 1.")
    return q


def _is_name(value: str) -> bool:
    return bool(value.strip()) and value.isprintable() and not set("[]") & set(value)


_NAME: Final = schema.plain("a name without brackets", str, str, passes=_is_name, type="string")
_LIMIT: Final = schema.form(
    {key: schema.quantity(kind) if key in ("low", "high") else schema.size(kind) for key, kind in _LIMITS.items()},
    kind=Limits,
)
_MOUNT: Final = {"axes": AXES, "q_bs": QUATERNION, "lever": PLACE, "clock_offset": schema.quantity(Quantity.TIME)}
_SEGMENT: Final = schema.form({"name": _NAME, "unit": schema.text, **_MOUNT}, ("name",), _segment)
_VECTORS: Final = schema.listed(schema.listed(schema.number, 3, names="xyz"))
_EULER: Final = schema.listed(schema.quantity(Quantity.ANGLE), 3, names="xyz")
_ENDS: Final = {
    "name": _NAME,
    "parent": schema.text,
    "child": schema.text,
    "kind": schema.one_of(*DEGREES_OF_FREEDOM),
}
_JOINT: Final = schema.form(
    {
        **_ENDS,
        "angle_names": schema.converted(tuple, schema.listed(_NAME)),
        "origin": PLACE,
        "axes": schema.either(list, _VECTORS, schema.described(_axes, type="string")),
        "q_pc": QUATERNION,
        "euler": schema.converted(lambda angles: tuple(rotations.quat_from_euler_zyx(angles).tolist()), _EULER),
        "limits": schema.either(list, schema.listed(_LIMIT), schema.converted(lambda limits: (limits,), _LIMIT)),
    },
    _ENDS,
    _joint,
)
CHAIN: Final = schema.form(
    {
        "kind": schema.one_of(KIND),
        "version": schema.version(VERSION),
        "base": schema.one_of("fixed", "free"),
        "segment": schema.tables(_SEGMENT),
        "joint": schema.tables(_JOINT),
        "name": _NAME,
        "hand": schema.form({"segment": schema.text, "at": PLACE}),
    },
    ("kind", "version", "base", "segment"),
    name="chain",
)
