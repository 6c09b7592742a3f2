"""Joint angles of a body from a unit on each segment: `plumbob.joints`, with the joints of people by name.

A joint's angles are those of the joint coordinate system [GroodSuntay1983] as the ISB names them [Wu2002] [Wu2005]: the
axes of a segment point ahead (x), up (y) and to the right (z) when the body stands upright with hanging arms, where all
angles are zero; flexion turns about the z axis of the parent, rotation about the y axis of the child, and abduction
about the axis between them. Names are those of OpenSim's models, with ``_r`` or ``_l`` behind.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from plumbob import rotations
from plumbob.arm.alignment import ArmCard, Pose, align_units, on_one_clock, opened_chain, require_units
from plumbob.arm.angles import JointTrack
from plumbob.arm.clocks import UnitClock, first_offset
from plumbob.arm.estimation import ArmEstimate, run
from plumbob.arm.gait import SWING, walked
from plumbob.arm.links import unit_numbers
from plumbob.arm.smoother import LOST, Attitudes
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.findings import Note, info, warning
from plumbob.core.units import Quantity, deg, given, to_deg
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.chain import Chain, Joint, Segment
from plumbob.data.imu import ImuData
from plumbob.rotations import Frame, dcm_from_quat, quat_conjugate, quat_from_dcm, quat_multiply, quat_rotate

if TYPE_CHECKING:
    from plumbob.door.reading import Source

SWAY: Final = deg(0.3)
"""A body that stands still turns by so much, rad: gyroscopes show their bias to this over the time."""
LEAN: Final = deg(6.0)
"""Who leans by more must step, rad: the middle of a body, .95 m high, is then .1 m from that of a foot of .25 m."""
CALM: Final = 1.0  # s in which a body that stands shows it
RANGE_SD: Final = 0.15  # people differ by so much of a range of motion
PLANE_SD: Final = deg(12.0)  # by so much even the plane of a bend or a squat is off that of the angle, rad
SWINGS: Final = 4.0  # a leg that swings one way faster by a factor does so ahead: power of the factor in the odds
AHEAD_SD: Final = deg(15.0)  # an axis of a unit that is said to point ahead does so to this, rad
AZIMUTHS: Final = deg(np.arange(360.0))  # directions that are weighed, rad
LEG: Final = ("thigh", "shank", "foot")
TOGETHER: Final = 0.5
"""Correlation that turns about two axes of a limb may have in a walk: by so much of one the axis of the other errs."""
AXES: Final = ("x", "-x", "y", "-y", "z", "-z")
SIDES: Final = ("right", "left")
STAMPS: Final = ("unknown", "mean", "instant")


class BodyJoint(NamedTuple):
    """A joint of a body: segments, kind, letters of the axes of its angles on the right side, their names, and ranges.

    `ranges`: how far each angle goes from upright to its negative and to its positive side, degrees [Greene1994], of an
    ankle under the weight of the body [Bennell1998].
    """

    parent: str
    child: str
    kind: str
    axes: str
    angles: tuple[str, ...]
    ranges: tuple[tuple[float, float], ...]


JOINTS: Final[Mapping[str, BodyJoint]] = {
    "hip": BodyJoint("pelvis", "thigh", "ball", "z x y", ("hip_flexion", "hip_adduction", "hip_rotation"),
                     ((30, 120), (45, 30), (45, 45))),
    "knee": BodyJoint("thigh", "shank", "hinge", "-z", ("knee_angle",), ((10, 135),)),
    "ankle": BodyJoint("shank", "foot", "ball", "z x y", ("ankle_angle", "subtalar_angle", "ankle_rotation"),
                       ((50, 35), (15, 35), (35, 35))),
    "lumbar": BodyJoint("pelvis", "thorax", "ball", "z x y",
                        ("lumbar_extension", "lumbar_bending", "lumbar_rotation"), ((80, 25), (35, 35), (45, 45))),
    "shoulder": BodyJoint("thorax", "upperarm", "ball", "z x y", ("arm_flex", "arm_add", "arm_rot"),
                          ((60, 180), (180, 50), (90, 70))),
    "elbow": BodyJoint("upperarm", "forearm", "hinge", "z", ("elbow_flex",), ((10, 150),)),
    "wrist": BodyJoint("forearm", "hand", "ball", "x z y", ("wrist_flex", "wrist_dev", "wrist_rot"),
                       ((70, 80), (30, 20), (80, 80))),
}  # fmt: skip
"""Joints by name; positive are flexion, adduction, internal rotation, dorsiflexion and inversion, and of the back
extension, bending to the right and turning to the left."""
CHAINS: Final[Mapping[str, tuple[str, ...]]] = {
    **{name: (name,) for name in JOINTS},
    "leg": ("hip", "knee", "ankle"), "legs": ("hip", "knee", "ankle"), "arm": ("shoulder", "elbow", "wrist"),
    "back": ("lumbar",),
}  # fmt: skip


def joints(
    array: "ImuArray | Source | Sequence[Source] | Mapping[str, Source]",
    *,
    hinge: str | None = None,
    chain: Chain | ArmCard | str | Path | None = None,
    side: str = "right",
    upright: tuple[float, float] | None = None,
    upright_sd: float | str = "1 deg",
    ahead: str | None = None,
    stamps: str = "unknown",
    frame: Frame | str | None = None,
    params: Mapping[str, Any] | None = None,
) -> ArmEstimate:
    """Joint angles of a body from a unit on each segment, aligned by the motion itself.

    Where every segment has a file of its own, the clocks may differ: offset and drift are found from the motion.

    Parameters
    ----------
    array : ImuArray, or what `plumbob.read_array` reads
        The units, from the root of the chain on: thigh and shank for a knee. Names that contain those of the segments
        may stand in any order.
    hinge : str, optional
        One hinge between two units: "knee", "elbow", or any word for the hinge of a machine.
    chain : str, Chain, ArmCard or path, optional
        In place of a hinge: "knee", "elbow", "ankle", "hip", "leg" (pelvis, thigh, shank, foot), "legs" (pelvis, and
        both), "arm" (thorax, upper arm, forearm, hand), "back" (pelvis, thorax); or a chain file or card.
    side : {"right", "left"}
        Of the body, which says what adduction, inversion and internal rotation are.
    upright : (float, float), optional
        From when to when, s, the body stood upright with hanging arms, where all angles are zero. Joints other than
        hinges need it; the angle of a hinge counts from the first sample without it.
    upright_sd : float or str
        How exactly it did, of each segment, rad, or text with a unit.
    ahead : {"x", "-x", "y", "-y", "z", "-z"}, optional
        Axis of the first unit that points ahead when the body stands upright, to some 15°. Without it the motion says
        where ahead is: by hinges, ranges of motion and the swing of a leg; the claims hold what that leaves open.
    stamps : {"unknown", "mean", "instant"}
        Whether a sample is the mean since the one before, or the value at its time. Where it is unknown, angles lie
        between, and their claim covers both.
    frame : Frame or str, optional
        Navigation frame of the segments' attitudes; by default that of the recording, else ENU.
    params : mapping, optional
        Of the filter, `plumbob.arm.filter.Params`.

    Returns
    -------
    ArmEstimate
        With `strides` where the motion is a walk.

    Raises
    ------
    ParameterError
        If neither or both of `hinge` and `chain` are given, units do not fit, or a pose is needed.
    ClockError
        If units have no time in common, or the motion does not show how their clocks differ.
    """
    for name, value, words in (("stamps", stamps, STAMPS), ("side", side, SIDES), ("ahead", ahead or "x", AXES)):
        check.one_of(name, value, words)
    held = given("upright_sd", upright_sd, Quantity.ANGLE, positive=True) or 0.0
    units, separate = _opened_units(array)
    body, named = _chain_of(hinge, chain, tuple(units), side)
    geometry = body if isinstance(body, Chain) else body.chain
    _require_upright(geometry, named, upright)
    settings = {"mean_rate": stamps != "instant", **dict(params or {})}
    require_units(geometry, tuple(units))
    root = next(segment.unit for segment in geometry.segments if segment.unit)
    units, t, poses = {root: units[root], **units}, units[root].t, list[Pose]()  # the first one has the clock of all
    if upright is not None:  # from 0 s on means from the first sample
        poses = [(max(upright[0], float(t[0])), min(upright[1], float(t[-1])), [0.0] * len(geometry.angles))]
    clocks, notes = _first_clocks(units, geometry) if separate else {}, list[Note]()
    if upright is not None:
        units, swayed = _less_bias(units, clocks, upright)
        more = max(swayed.values(), default=0.0)
        held, settings = math.hypot(held, more), {"bias_sd": max(SWAY, more) / (upright[1] - upright[0]), **settings}
        notes = _upright_notes(root if separate else "", upright, swayed)
    if isinstance(body, Chain) or separate:
        aligned, clocks, motion = align_units(geometry, units, clocks if separate else None, poses, settings)
    recording = on_one_clock(units, clocks)
    notes += [
        info("joints.clock", unit=unit, offset_ms=1e3 * clock.offset, sd_ms=1e3 * clock.sd, ppm=1e6 * clock.drift)
        for unit, clock in clocks.items()
    ]
    card, pose = body if isinstance(body, ArmCard) else aligned, None
    if isinstance(body, Chain) and not geometry.known:
        if named and upright is not None:
            card = _in_body_axes(card, recording, motion, named, upright, held, ahead)
        pose = _first_angles(card.chain, motion)
    frame = frame or recording.units[root].meta.frame or Frame.ENU
    estimate = run(card, recording, frame=frame, pose=pose, pose_sd=LOST, params=settings)
    estimate = _with_timing(estimate, card, recording, clocks, 0.25 if stamps == "unknown" else 0.0)
    estimate = _with_facing(estimate, card, held)
    track = estimate.joints
    if upright is None and not geometry.known:
        track, remarks = _from_first_sample(track, geometry, named)
        notes += remarks
    if not (geometry.hand or any(geometry.hand_b)):
        track = replace(track, hand=None, hand_sd=None)
    in_body_axes = any(segment.mount.q_bs != UnitMount().q_bs for segment in card.chain.segments)
    strides = walked(track, card.chain, recording) if in_body_axes else {}
    return replace(estimate, joints=track, notes=(*notes, *estimate.notes), strides=strides, card=card)


def _first_angles(chain: Chain, motion: Attitudes) -> list[float]:
    """Angles at the first sample, rad, by the attitudes of the units."""
    numbers, angles = unit_numbers(chain), list[float]()
    bodies = {
        body.name: quat_multiply(motion.q[numbers[body.name], :1], quat_conjugate(np.array(body.mount.q_bs)))
        for body in chain.segments
    }  # fmt: skip
    for joint in chain.joints:
        angles += joint.angles_of(quat_multiply(quat_conjugate(bodies[joint.parent]), bodies[joint.child]))[0].tolist()
    return angles


def _from_first_sample(track: JointTrack, chain: Chain, named: Mapping[str, str]) -> tuple[JointTrack, list[Note]]:
    """Angles that are 0 at the first sample by name alone: it counts in the claim of all, and the sign is a guess."""
    assert track.sd is not None
    track = replace(track, sd=np.hypot(track.sd, track.sd[0]))
    if not named:
        return track, []
    track = replace(track, angles=track.angles * (np.sign(np.nanmean(track.angles)) or 1.0))
    return track, [warning("joints.first_sample", joint=chain.joints[0].name)]


def _opened_units(array: Any) -> tuple[dict[str, ImuData], bool]:
    """Units by name, and whether each has a clock of its own."""
    from plumbob.door.reading import opened_array, read_units

    if isinstance(array, ImuArray | str | Path):
        return dict(opened_array(array).units), False
    units = read_units(array)
    return units, len(units) > 1


def _require_upright(geometry: Chain, named: Mapping[str, str], upright: tuple[float, float] | None) -> None:
    """Refuse joints of people other than hinges where nothing says when the body stood upright."""
    if named and upright is None and any(JOINTS[joint].kind != "hinge" for joint in named.values()):
        raise ParameterError(
            f"the angles of {geometry.name} count from the body upright with hanging arms, so joints needs to "
            "know when it stood so: --upright 0s..2s. A hinge alone does without."
        )


def _chain_of(
    hinge: str | None, chain: Chain | ArmCard | str | Path | None, units: tuple[str, ...], side: str
) -> tuple[Chain | ArmCard, dict[str, str]]:
    """The chain, and which joint of people each of its joints is, by name; none of a machine or a file."""
    if (hinge is None) == (chain is None):
        raise ParameterError("joints takes either a hinge, as knee, or a chain, as leg or a file; give one of them.")
    wanted = chain or hinge or ""
    if isinstance(wanted, Chain | ArmCard) or (chain is not None and str(wanted) not in CHAINS):
        if isinstance(wanted, str) and not Path(wanted).suffix:
            raise unknown_name("chain", wanted, CHAINS, hint="A file ends in .toml, .urdf or .json.")
        return opened_chain(wanted), {}
    name = str(wanted)
    if hinge is not None and (name not in CHAINS or JOINTS[name].kind != "hinge"):
        if name in CHAINS:
            raise ParameterError(f"the {name} is not a hinge; use --chain {name}.")
        _require_count(units, ("the part before it", "the part behind it"), name)
        parts = tuple(Segment(unit, unit) for unit in units)
        return Chain(name, parts, (Joint(name, units[0], units[1], "hinge", origin=None),)), {}
    other = "left" if side == "right" else "right"
    if name != "legs" and any(other in unit.casefold() for unit in units):
        raise ParameterError(
            f"the names of the units, {', '.join(units)}, say {other}, but the side is {side}; give it."
        )
    ends = ("_r", "_l") if name == "legs" else ("_" + side[0],)
    joints, named = list[Joint](), dict[str, str]()
    segments = [_name_with_side(JOINTS[CHAINS[name][0]].parent, ends[0])]
    for end in ends:
        for joint in CHAINS[name]:
            kind = JOINTS[joint]
            title = _name_with_side(joint, end)
            angles = kind.angles if title == joint else tuple(angle + end for angle in kind.angles)
            parent, child = _name_with_side(kind.parent, end), _name_with_side(kind.child, end)
            joints.append(Joint(title, parent, child, kind.kind, origin=None, angle_names=angles))
            named[title] = joint
            segments.append(joints[-1].child)
    carried = _units_by_segment(segments, units, name)
    return Chain(name, tuple(Segment(part, carried[part]) for part in segments), tuple(joints)), named


def _name_with_side(name: str, end: str) -> str:
    """Name with the side, of what the body has twice."""
    return name if name in ("pelvis", "thorax", "lumbar") else name + end


def _require_count(units: Sequence[str], segments: Sequence[str], name: str) -> None:
    """Refuse more or fewer units than segments."""
    if len(units) != len(segments):
        raise ParameterError(
            f"{name} has {len(segments)} segments ({', '.join(segments)}), each with a unit, but the recording has "
            f"{len(units)}: {', '.join(units)}."
        )


def _units_by_segment(segments: Sequence[str], units: Sequence[str], name: str) -> dict[str, str]:
    """Unit on each segment: the one whose name contains the segment's, for all; else in the order given."""
    _require_count(units, segments, name)
    words = {unit: "".join(filter(str.isalnum, unit.casefold())) for unit in units}
    sides = {"_r": ("right", "r"), "_l": ("left", "l")}
    fits = {}
    for segment in segments:
        part, end = (segment[:-2], segment[-2:]) if segment[-2:] in sides else (segment, "")
        same = [unit for unit in units if part in words[unit]]
        if len(same) > 1 and end:
            same = [unit for unit in same if words[unit].replace(part, "").startswith(sides[end])]
        fits[segment] = same
    if all(len(same) == 1 for same in fits.values()) and len({same[0] for same in fits.values()}) == len(units):
        return {segment: same[0] for segment, same in fits.items()}
    return dict(zip(segments, units, strict=True))


def _less_bias(
    units: Mapping[str, ImuData], clocks: Mapping[str, UnitClock], upright: tuple[float, float]
) -> tuple[dict[str, ImuData], dict[str, float]]:
    """Units less what their gyroscopes say on average while the body stands upright, and by how much some sway, rad."""
    times = {name: clocks[name].corrected(imu.t) if name in clocks else imu.t for name, imu in units.items()}
    rests = {name: _rest(imu, times[name], *upright) for name, imu in units.items()}
    for name, rest in rests.items():
        if rest.turn > LEAN:
            root, shared = next(iter(times.items()))
            spans = {float(t): [_rest(imu, times[unit], t, t + CALM).turn for unit, imu in units.items()]
                     for t in np.arange(shared[0], shared[-1] - CALM, CALM)}  # fmt: skip
            calm = ", ".join([f"{t:.0f}" for t, turns in spans.items() if max(turns) <= SWAY][:5])
            what = f"turns by {to_deg(rest.turn):.0f}°" if math.isfinite(rest.turn) else "has no sample"
            clock = f"the clock of '{root}'" if clocks else "the recording"
            raise ParameterError(
                f"'{name}' {what} from {upright[0]:g} to {upright[1]:g} s of {clock}, when the body is said to stand "
                f"upright; all stand still for a second at {calm or 'no'} s."
            )
    less = {name: imu.corrected(meta=imu.meta, gyr=imu.usable("gyr") - rests[name].rate) for name, imu in units.items()}
    return less, {name: rest.turn for name, rest in rests.items() if rest.turn > SWAY}


class _Rest(NamedTuple):
    """Mean rate (3,), rad/s, and by how much a unit turns meanwhile, rad."""

    rate: Floats
    turn: float


def _rest(imu: ImuData, t: Floats, begin: float, end: float) -> _Rest:
    """Of a unit in a span, s; its turn is infinite without a sample.

    What comes and goes shows in the turn by the rates less their mean, what goes one way in the mean force of the
    second half against the first: twice, as the halves' middles are half of the span apart.
    """
    span = slice(int(np.searchsorted(t, begin)), int(np.searchsorted(t, end, side="right")))
    t, gyr, acc = t[span], imu.usable("gyr")[span], imu.usable("acc")[span]
    finite = np.isfinite(gyr).all(axis=1) & np.isfinite(acc).all(axis=1)
    if np.count_nonzero(finite) < 2:
        return _Rest(np.zeros(3), math.inf)
    t, gyr, acc = t[finite], gyr[finite], acc[finite]
    bias = gyr.mean(axis=0)
    turns = np.cumsum((gyr - bias) * np.gradient(t)[:, np.newaxis], axis=0)
    first, second = (_unit(half.mean(axis=0)) for half in np.array_split(acc, 2))
    there = np.sqrt(np.mean(np.sum((turns - turns.mean(axis=0)) ** 2, axis=1)))
    return _Rest(bias, max(float(there), 2.0 * math.asin(min(1.0, float(np.linalg.norm(np.cross(first, second)))))))


def _upright_notes(clock: str, upright: tuple[float, float], swayed: Mapping[str, float]) -> list[Note]:
    """What sways in the upright pose, and on which clock it counts where there are several."""
    notes: list[Note] = [info("joints.upright", unit=clock, begin_s=upright[0], end_s=upright[1])] if clock else []
    return notes + [warning("joints.sways", unit=unit, turn_deg=to_deg(turn)) for unit, turn in swayed.items()]


def _first_clocks(units: Mapping[str, ImuData], chain: Chain) -> dict[str, UnitClock]:
    """Clocks of all units but the root's, roughly, against the root's."""
    on = {segment.name: segment.unit for segment in chain.segments}
    root, clocks = next(iter(units.values())), dict[str, UnitClock]()
    dated = all(imu.meta.t0_ns for imu in units.values())
    for joint in chain.joints:
        if not on[joint.parent]:  # the ground has no clock
            continue
        unit, parent = units[on[joint.child]], units[on[joint.parent]]
        expected = 1e-9 * (unit.meta.t0_ns - parent.meta.t0_ns) if dated else None
        offset = first_offset(parent, unit, name=on[joint.child], expected=expected)
        offset += clocks[on[joint.parent]].offset if on[joint.parent] in clocks else 0.0
        middle = 0.5 * float(root.t[0] + root.t[-1]) - offset
        clocks[on[joint.child]] = UnitClock(offset, 0.0, middle)
    return clocks


def _in_body_axes(
    card: ArmCard, recording: ImuArray, motion: Attitudes, named: Mapping[str, str], upright: tuple[float, float],
    held: float, ahead: str | None,
) -> ArmCard:  # fmt: skip
    """The card with segments in the axes of the ISB: y up in the upright pose, z along the hinges to the right."""
    chain, rows = card.chain, (recording.t >= upright[0]) & (recording.t <= upright[1])
    on = {segment.name: recording.units[segment.unit] for segment in chain.segments}
    posed = {chain.segments[0].name: np.array([1.0, 0.0, 0.0, 0.0])}  # of each unit in the root's, when upright
    for joint in chain.joints:
        posed[joint.child] = quat_multiply(posed[joint.parent], np.array(joint.q_pc))
    forces = [quat_rotate(posed[name], np.nanmean(imu.usable("acc")[rows], axis=0)) for name, imu in on.items()]
    up = _unit(np.sum(forces, axis=0))
    right, facing = _facing(card, motion, posed, named, up, _rates(on[chain.segments[-1].name]), held, ahead)
    base = np.stack([np.cross(up, right), up, right])  # rows: ahead, up, right in the root's unit
    turns = {name: base @ dcm_from_quat(q) for name, q in posed.items()}
    turn_sds = {name: np.full(3, held / math.sqrt(2.0)) for name in on}
    for link, joint_card in zip(card.links(), card.joints, strict=True):
        if link.joint.kind == "hinge":  # its axis is known better than how the body stood
            # what strays comes again with each stride, so that all strides say the same of the axis
            repeated = math.sqrt(max(float(recording.t[-1] - recording.t[0]) / (2.0 * link.play_time), 1.0))
            for name, axis in zip((link.joint.parent, link.joint.child), link.axes[:, 0], strict=True):
                z = axis * np.sign(axis @ turns[name][2])
                y = _unit(turns[name][1] - z * (z @ turns[name][1]))
                turns[name] = np.stack([np.cross(y, z), y, z])
                turn_sds[name][:2] = repeated * max(joint_card.axis_sd)
    quats = {name: quat_from_dcm(turn) for name, turn in turns.items()}
    segments = tuple(
        replace(
            body,
            mount=UnitMount(
                tuple(quats[body.name].tolist()), tuple((turns[body.name] @ np.array(body.mount.lever_b)).tolist())
            ),
        )
        for body in chain.segments
    )
    joints = tuple(_named_joint(joint, quats, turns, named[joint.name]) for joint in chain.joints)
    sds = {body.unit: [*turn_sds[body.name].tolist(), *card.mount_sd[body.unit][3:]] for body in chain.segments}
    return replace(card, chain=replace(chain, segments=segments, joints=joints), mount_sd=sds, facing=facing)


def _named_joint(joint: Joint, quats: Mapping[str, Floats], turns: Mapping[str, Floats], name: str) -> Joint:
    """A joint in the axes of its segments, with the axes of its angles in their order and sign."""
    body = JOINTS[name]
    nominal = np.array([_sign_of(axis) * np.eye(3)["xyz".index(axis[-1])] for axis in body.axes.split()])
    if joint.name.endswith("_l"):  # what turns about x and y goes the other way
        nominal = nominal * np.array([-1.0, -1.0, 1.0])
    q = quat_multiply(quat_multiply(quats[joint.parent], np.array(joint.q_pc)), quat_conjugate(quats[joint.child]))
    axes = nominal
    if body.kind == "hinge":
        axes = np.array(joint.axes) @ turns[joint.child].T
        axes = axes * np.sign(axes @ nominal[0])
    return replace(
        joint, origin=tuple((turns[joint.parent] @ np.array(joint.place)).tolist()), q_pc=tuple(q.tolist()),
        axes=tuple(tuple(axis) for axis in axes.tolist()),
    )  # fmt: skip


def _sign_of(axis: str) -> float:
    return -1.0 if axis.startswith("-") else 1.0


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))


def _facing(
    card: ArmCard, motion: Attitudes, posed: Mapping[str, Floats], named: Mapping[str, str], up: Floats,
    rates: Floats, held: float, ahead: str | None,
) -> tuple[Floats, list[list[float]]]:  # fmt: skip
    """Level axis to the right in the root's unit when upright, and turns about the vertical, rad, with probabilities.

    Every direction to the right is weighed: by each joint's ranges of motion, as a direction in which the joint would
    go farther than it can is wrong, and one in which it would use little of a large range is likelier; by the plane
    of its motion, which is that of an angle, or by its hinge; by a leg's swing; and by what is said to point ahead.
    """
    first = _unit(np.cross(up, np.eye(3)[np.argmin(np.abs(up))]))
    around = np.outer(np.cos(AZIMUTHS), first) + np.outer(np.sin(AZIMUTHS), np.cross(up, first))
    weight, last = np.zeros(AZIMUTHS.size), card.chain.segments[-1].name  # logarithm of the probability
    for link, joint_card in zip(card.links(), card.joints, strict=True):
        before, after = posed[link.joint.parent], posed[link.joint.child]
        relative = quat_multiply(quat_conjugate(motion.q[link.parent]), motion.q[link.child])
        turned = quat_multiply(quat_multiply(before, relative), quat_conjugate(after))
        if link.joint.kind == "hinge":
            axis = quat_rotate(after, link.axes[1, 0])
            sway = np.outer(rotations.rotvec_from_quat(turned) @ axis, axis)
            plane_sd, turns = max(joint_card.axis_sd), [0, 180]
        else:
            tip = quat_rotate(turned, up)
            across = np.cross(up, tip)
            size = np.linalg.norm(across, axis=1, keepdims=True)
            sway = across / np.maximum(size, 1e-12) * np.arctan2(size, (tip @ up)[:, np.newaxis])
            sizes, axes = np.linalg.eigh(sway.T @ sway / len(sway) + held**2 * np.eye(3))
            axis, turns = axes[:, -1], [0, 90, 180, 270]
            plane_sd = math.hypot(PLANE_SD, TOGETHER * math.sqrt(sizes[1] / sizes[2]))
        evidence = _evidence(sway[:: max(1, len(sway) // 1000)] @ around.T, JOINTS[named[link.joint.name]],
                             -1.0 if link.joint.name.endswith("_l") else 1.0, held)  # fmt: skip
        if link.joint.child == last and last.startswith(LEG):
            rate = quat_rotate(after, rates[:: max(1, len(rates) // 1000)])
            swing = np.maximum(np.percentile(rate @ around.T, 98.0, axis=0), SWING)
            evidence = evidence + SWINGS * np.log(swing / np.roll(swing, 180))
        main = math.atan2(axis @ np.cross(up, first), axis @ first)
        near = [main + deg(k) for k in turns]
        weight += np.logaddexp.reduce([
            evidence[round(to_deg(way)) % 360] + (np.cos(AZIMUTHS - way) - 1.0) / max(plane_sd, deg(1.0)) ** 2
            for way in near
        ], axis=0)  # fmt: skip
    if ahead is not None:
        axis = _sign_of(ahead) * np.eye(3)["xyz".index(ahead[-1])]
        level = axis - up * (up @ axis)
        if np.linalg.norm(level) < math.sqrt(0.5):
            raise ParameterError(
                f"ahead names the axis {ahead} of '{card.chain.segments[0].unit}', but that points more up or down "
                "than ahead when the body stands upright; name another."
            )
        weight += (np.roll(around, -90, axis=0) @ _unit(level) - 1.0) / AHEAD_SD**2
    share = np.exp(weight - weight.max())
    share /= share.sum()
    return _summed_up(around, share, up)


def _evidence(sway: Floats, body: BodyJoint, side: float, held: float) -> Floats:
    """Logarithm of how likely each of the directions to the right makes a joint's sway about all of them (N, 360)."""
    square, most = np.mean(np.maximum(sway, 0.0) ** 2, axis=0) + held**2, sway.max(axis=0)
    used, evidence = np.zeros(AZIMUTHS.size), np.zeros(AZIMUTHS.size)
    for letter, (low, high) in zip(body.axes.split(), body.ranges, strict=True):
        if letter[-1] == "y":
            continue
        ahead, sign = (90, side) if letter[-1] == "x" else (0, 1.0)
        for way, reach in ((1.0, high), (-1.0, low)):
            turn = -ahead - (0 if way * sign * _sign_of(letter) > 0.0 else 180)
            used += np.roll(square, turn) / deg(reach) ** 2
            beyond = np.maximum(np.roll(most, turn) - deg(reach), 0.0) / np.hypot(held, RANGE_SD * deg(reach))
            evidence -= 0.5 * beyond**2
    return np.asarray(evidence - np.log(used))


def _summed_up(around: Floats, share: Floats, up: Floats) -> tuple[Floats, list[list[float]]]:
    """The likeliest direction to the right, and turns of it about the vertical with their probabilities."""
    near = np.cos(AZIMUTHS - AZIMUTHS[int(np.argmax(share))]) > 0.0
    right = _unit((share * near) @ around)
    turns = np.arctan2(np.cross(right, around) @ up, around @ right)
    sector, points = np.rint(turns / deg(30.0)) % 12, list[list[float]]()
    for k in range(12):
        part = share * (sector == k)
        if (total := float(part.sum())) > 1e-6:
            center = deg(30.0) * k
            off = rotations.wrap(turns - center)
            mean = float(part @ off) / total
            sd = math.sqrt(max(float(part @ (off - mean) ** 2) / total, 0.0))
            points += [[center + mean + sd, 0.5 * total], [center + mean - sd, 0.5 * total]]
    return right, points


def _rates(imu: ImuData) -> Floats:
    """Rates (N, 3), rad/s, 0 where there are none."""
    return np.asarray(np.nan_to_num(imu.usable("gyr")))


def _with_timing(
    estimate: ArmEstimate, card: ArmCard, recording: ImuArray, clocks: Mapping[str, UnitClock], share: float
) -> ArmEstimate:
    """Estimate whose claims count what clocks and stamps leave open; `share` of a step as far as stamps are unknown."""
    track, covs, variances = estimate.joints, dict(estimate.joint_cov), list[Floats]()
    step = share * float(np.median(np.diff(track.t)))
    on = {segment.name: segment for segment in card.chain.segments}
    rates = {name: _rates(recording.units[body.unit]) @ body.mount.dcm.T for name, body in on.items() if body.unit}
    for joint in card.chain.joints:
        parent, child = (estimate.tracks[name].q_nb for name in (joint.parent, joint.child))
        relative = quat_multiply(quat_conjugate(parent), child)
        turning = quat_rotate(relative, rates[joint.child])  # in the parent's axes
        late = clocks.get(on[joint.child].unit, UnitClock()).sd
        for turn in (late * turning, step * (turning - rates.get(joint.parent, np.zeros(3)))):
            halves = (quat_multiply(rotations.quat_from_rotvec(part * turn), relative) for part in (0.5, -0.5))
            variances.append(rotations.wrap(np.subtract(*map(joint.angles_of, halves))) ** 2)
            covs[joint.name] = covs[joint.name] + turn[estimate.rows, :, np.newaxis] * turn[estimate.rows, np.newaxis]
    assert track.sd is not None
    sd = np.sqrt(track.sd**2 + np.hstack(variances[::2]) + np.hstack(variances[1::2]))
    angles = track.angles - step * np.gradient(track.angles, track.t, axis=0)
    return replace(estimate, joints=replace(track, angles=angles, sd=sd), joint_cov=covs)


def _with_facing(estimate: ArmEstimate, card: ArmCard, held: float) -> ArmEstimate:
    """Estimate whose claims count that the body may face another way than its card says: a turn of all segments."""
    track, covs, variances = estimate.joints, dict(estimate.joint_cov), list[Floats]()
    assert track.sd is not None
    for joint in card.chain.joints:
        parent, child = (estimate.tracks[name].q_nb for name in (joint.parent, joint.child))
        relative = quat_multiply(quat_conjugate(parent), child)
        angles, variance = joint.angles_of(relative), np.zeros((len(relative), len(joint.axes)))
        for turn, share in card.facing:
            # the axis of a hinge is that of its motion, but may point to the left
            about_y = math.pi * float(math.cos(turn) < 0.0) if joint.kind == "hinge" else turn
            q = rotations.quat_from_rotvec(np.array([0.0, about_y, 0.0]))
            other = quat_multiply(quat_multiply(quat_conjugate(q), relative), q)
            variance += share * rotations.wrap(joint.angles_of(other) - angles) ** 2
            off = rotations.rotvec_from_quat(quat_multiply(other, quat_conjugate(relative)))[estimate.rows]
            covs[joint.name] = covs[joint.name] + share * off[:, :, np.newaxis] * off[:, np.newaxis]
        variances.append(variance)
    sd, notes = np.sqrt(track.sd**2 + np.hstack(variances)), list(estimate.notes)
    spread = math.sqrt(sum(share * min(abs(turn), 2.0 * math.pi - abs(turn)) ** 2 for turn, share in card.facing))
    if spread > held:
        other = sum(share for turn, share in card.facing if math.cos(turn) < 0.0)
        notes.append(warning("joints.facing", sd_deg=to_deg(spread), percent=100.0 * other))
    return replace(estimate, joints=replace(track, sd=sd), joint_cov=covs, notes=tuple(notes))
