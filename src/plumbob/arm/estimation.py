"""Joint angles, attitudes and the hand of a chain from its units, with what each is uncertain by."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob import rotations
from plumbob.arm.alignment import ArmCard, chain_samples, filter_params, opened_chain, parsed_chain, require_units
from plumbob.arm.anchor import UNKNOWN, Anchored, anchored, directions_at, drifting
from plumbob.arm.angles import JointTrack, write_table
from plumbob.arm.filter import Params, UnitSamples
from plumbob.arm.gait import Strides
from plumbob.arm.links import GROUND, JointLink, chain_links, unit_numbers
from plumbob.arm.smoother import FRAME_SD, LOST, Attitudes, ChainStart, UnitAttitudes
from plumbob.core import check, flags
from plumbob.core.check import Floats, number
from plumbob.core.errors import ParameterError
from plumbob.core.findings import Note, as_json, info, warning
from plumbob.core.params import build, describe, shown
from plumbob.core.series import Series
from plumbob.core.units import Quantity, deg, given, to_deg
from plumbob.data import AttitudeTrack
from plumbob.data.array import ImuArray
from plumbob.data.chain import Chain, Joint, Posture
from plumbob.filters.offline import navigation_frame
from plumbob.filters.smoother.preprocess import SampleWatch
from plumbob.rotations import Frame, quat_conjugate, quat_multiply

if TYPE_CHECKING:
    from plumbob.door.reading import Source

__all__ = ["ArmEstimate", "ArmStream", "parsed_chain", "run"]

DOUBT: Final = deg(10.0)  # a sample at which an angle is uncertain by more than this, rad, is said to be not converged
ODD: Final = 6.0  # a sample is inconsistent where an axis strays by more standard deviations than this;
STRAYS: Final = 3.0  # a recording where one does so on average
_SMALL: Final = 1e-4  # turn by which derivatives of angles are taken, rad
INSIDE: Final = {Frame.ENU: Frame.ENU, Frame.NWU: Frame.NWU, Frame.NED: Frame.NWU}
"""Frame that the filter works in, by the one that was asked for: same North, z up."""


@dataclass(frozen=True, eq=False, repr=False)
class ArmEstimate(Series):
    """What a chain did.

    Attributes
    ----------
    joints : JointTrack
        Angles of all joints, their standard deviations, the hand, and flags.
    tracks : mapping of str to AttitudeTrack
        Attitude of each segment, by name, with covariance.
    chain : Chain
        The chain.
    frame : Frame
        Navigation frame of the tracks, and of the hand where the root moves.
    rows : ndarray (K,)
        Samples that are keyframes, about 0.1 s apart.
    joint_cov : mapping of str to ndarray (K, 3, 3)
        By joint, at keyframes: covariance of the child's attitude against the parent's, parent axes, rad².
    notes : tuple of str
        What a reader should know.
    strides : mapping of str to Strides
        Of each leg that walks, by its side, "_r" or "_l"; only of `plumbob.joints`.
    card : ArmCard or None
        What `plumbob.joints` aligned, for another recording of the same units where they sit.
    """

    joints: JointTrack
    tracks: Mapping[str, AttitudeTrack]
    chain: Chain
    frame: Frame
    rows: NDArray[np.intp] = field(repr=False)
    joint_cov: Mapping[str, Floats] = field(repr=False)
    notes: tuple[Note, ...] = ()
    strides: Mapping[str, Strides] = field(default_factory=dict, repr=False)
    card: ArmCard | None = field(default=None, repr=False)

    def facts(self) -> Mapping[str, str]:
        """Chain, frame, and how sure it is."""
        sd = self.joints.sd
        assert sd is not None
        said = ", ".join(
            f"{name} {to_deg(float(np.nanmedian(sds))):.2f}°" for name, sds in zip(self.joints.names, sd.T, strict=True)
        )
        return {
            "chain": self.chain.name,
            "samples": f"{len(self.joints.t)} from {self.joints.t[0]:.6g} to {self.joints.t[-1]:.6g} s",
            "frame": f"{self.frame}, heading {next(iter(self.tracks.values())).north}",
            "standard deviations": f"{said} (medians)",
            **{
                f"{name} ({side[1]})": text
                for side, walk in self.strides.items()
                for name, text in walk.facts().items()
            },
            "method": self.joints.source,
        }

    def at_end(self) -> list[tuple[str, float, float]]:
        """Last value and standard deviation of each angle, rad, by name."""
        sd = self.joints.sd
        assert sd is not None
        return [
            (name, float(value), float(sigma))
            for name, value, sigma in zip(self.joints.names, self.joints.angles[-1], sd[-1], strict=True)
        ]

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them; angles in degrees."""
        joints = self.joints
        assert joints.sd is not None
        assert joints.flags is not None
        return {
            "chain": self.chain.name,
            "frame": str(self.frame),
            "north": str(next(iter(self.tracks.values())).north),
            "samples": len(joints),
            "duration_s": float(joints.t[-1] - joints.t[0]),
            "angles_deg": {
                name: {"last": float(to_deg(last)), "sd": float(to_deg(sd)), "median_sd": float(to_deg(median))}
                for (name, last, sd), median in zip(self.at_end(), np.nanmedian(joints.sd, axis=0), strict=True)
            },
            **({} if joints.hand is None else {"hand_m": joints.hand[-1].tolist()}),
            **({"strides": {side: walk.summary() for side, walk in self.strides.items()}} if self.strides else {}),
            "flags": flags.counts(joints.flags),
            "method": joints.source,
            "notes": as_json(self.notes),
        }

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Of the joint angles."""
        return self.joints.columns()

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the joint angles; as `JointTrack.save`."""
        return self.joints.save(path, overwrite=overwrite)

    def save_strides(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the mean stride of all legs, ``.csv`` or ``.parquet``.

        Raises
        ------
        ParameterError
            If nothing walks, the suffix is another, or a file lies there and `overwrite` is false.
        """
        if not self.strides:
            raise ParameterError(
                f"no walk was seen in the motion of {self.chain.name}: strides need a shank, foot or thigh that swings "
                "at least three times, and the body upright at some time."
            )
        columns = {name: column for walk in self.strides.values() for name, column in walk.columns().items()}
        return write_table(path, columns, source=f"mean stride of {self.chain.name}", overwrite=overwrite)

    def postures(self) -> dict[str, Posture]:
        """Where every segment is: in the axes of a root that stands still, else in ENU; the root's origin stays."""
        if self.chain.base_fixed:
            return self.chain.postures(self.joints.angles)
        root = rotations.change_frame(self.tracks[self.chain.segments[0].name].q_nb, to=Frame.ENU, from_=self.frame)
        return self.chain.postures(self.joints.angles, root)


def run(
    chain: Chain | ArmCard | str | Path,
    array: "ImuArray | Source | Sequence[Source] | Mapping[str, Source]",
    *,
    frame: Frame | str | None = None,
    causal: bool = False,
    pose: str | Sequence[float] | None = None,
    pose_sd: float | str = "1 deg",
    params: Mapping[str, Any] | None = None,
    note: Callable[[str], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ArmEstimate:
    """Estimate joint angles, attitudes of all segments, and where the hand is.

    Parameters
    ----------
    chain : ArmCard, Chain or path
        The card that `align` makes, or a chain whose units sit exactly as it says.
    array : ImuArray, or what `plumbob.door.reading.read_array` reads
        A unit for each segment; a root that stands still needs none.
    frame : Frame or str, optional
        Navigation frame of the result; by default that of the recording. The root of a fixed base has its z axis up,
        and its x axis along that of ENU or NWU, or along North in NED; all headings count from it.
    causal : bool
        Let each attitude know only what came before it. The first attitudes are given after the first seconds, from
        what those show of the headings. The common heading of a free chain then counts from the start, near North, and
        fields only keep it there; smoothed, it counts from North.
    pose : "zero" or sequence of float, optional
        The angles, rad, that were held at the first sample. A ball joint on a fixed base needs it, as nothing else
        says where the arm points.
    pose_sd : float or str
        How exactly they were held, rad, or text with a unit.
    params : mapping, optional
        Of the filter, `plumbob.arm.filter.Params`; what is not named follows from what is known of the units.
    note : callable, optional
        Called with each note.
    progress : callable, optional
        Called with samples done and samples in all.

    Returns
    -------
    ArmEstimate

    Raises
    ------
    ParameterError
        If the chain's geometry is not known, a segment has no unit, or units are missing.
    """
    from plumbob.door.reading import opened_array

    follower = ArmStream(
        chain, frame=frame, pose=pose, pose_sd=pose_sd, params=params, smooth=not causal, progress=progress
    )
    estimate = follower.take(opened_array(array), end=True)
    assert estimate is not None  # at the end there is something
    for remark in estimate.notes if note else ():
        note(str(remark))  # type: ignore[misc]
    return estimate


class ArmStream:
    """Estimate a chain as the samples of its units come; cut anywhere, a stream gives the same bits.

    It is what `run` does, whose arguments these are, causal unless `smooth`: then all comes at the end. Else angles
    come with the keyframe behind them, at most 0.1 s late; the first ones when headings have begun, after seconds.
    `units` are the names of those that will come, where they are known before.

    Examples
    --------
    >>> from plumbob.arm import ArmStream
    >>> follower = ArmStream("card.json", frame="ENU")  # doctest: +SKIP
    >>> for part in parts:  # doctest: +SKIP
    ...     if (found := follower.take(part)) is not None:
    ...         print(found.joints.angles[-1])
    """

    def __init__(
        self, chain: Chain | ArmCard | str | Path, *, frame: Frame | str | None = None,
        pose: str | Sequence[float] | None = None, pose_sd: float | str = "1 deg",
        params: Mapping[str, Any] | None = None, smooth: bool = False, units: Sequence[str] | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> None:  # fmt: skip
        chain = opened_chain(chain)
        self._card = chain if isinstance(chain, ArmCard) else None
        self.chain = model = check.kind("chain", chain, Chain) if self._card is None else self._card.chain
        self._links = chain_links(model) if self._card is None else self._card.links()
        build(Params, dict(params or {}), of="arm")  # refuses what it cannot take, before samples come
        if units is not None:
            require_units(model, units)
        self._wanted, self._given = None if frame is None else Frame.parse(frame), params
        self._pose = None if pose is None else _posture(model, pose)
        self._pose_sd = number("pose_sd", given("pose_sd", pose_sd, Quantity.ANGLE), "rad")
        self._watches = {segment.unit: SampleWatch() for segment in model.segments if segment.unit}
        self._on_base = pose is not None and model.base_fixed
        self._smooth, self._progress = smooth, progress
        self._motion: UnitAttitudes | None = None
        self._anchor: Anchored | None = None
        self._has_field, self._strays, self._count = False, np.zeros(len(model.joints)), 0

    def take(self, array: ImuArray, *, end: bool = False) -> ArmEstimate | None:
        """Take the next samples, of any number, and return what they complete; None where that is nothing.

        With `end`, nothing else comes, and all that waits is returned.
        """
        samples = chain_samples(self.chain, array, None if self._smooth else self._watches)
        if self._motion is None:
            self._begin(array)
        completed = self._motion.take(samples, end=end) if self._motion else None
        if self._motion is None or completed is None or self._motion.start is None:
            return None
        (motion, samples, n_before), start = completed, self._motion.start
        notes = () if n_before else self._see(samples, motion, start)
        strays = _strays(self._links, motion)
        self._strays += np.sum(strays[n_before:] ** 2, axis=0)
        self._count += len(strays) - n_before
        if end:
            notes += _contradicted(self._links, np.sqrt(self._strays / self._count))
        self._anchor = self._anchored(samples, motion, start.ready) if start.free else None
        steady = not self._smooth or self._on_base or self._anchor is None
        return _Reading(
            self.chain, self._card, motion, self._anchor, self._inside, self.frame, samples.flags, strays
        ).estimate(
            north=rotations.North.FREE if steady else rotations.North.MAGNETIC,
            source=_source(self._params, causal=not self._smooth), notes=notes, n_before=n_before,
        )  # fmt: skip

    def _begin(self, array: ImuArray) -> None:
        """Take over what the first samples say of units and frame."""
        self._params = filter_params(self.chain, array, self._given)
        self.frame = navigation_frame(next(iter(array.units.values())), self._wanted, where="the recording")
        self._inside = INSIDE[self.frame]
        self._north = float(np.arctan2(self._inside.north[1], self._inside.north[0]))
        self._motion = UnitAttitudes(
            self._links, self._params, north=self._north, pose=self._pose, pose_sd=self._pose_sd, smooth=self._smooth,
            progress=self._progress,
        )  # fmt: skip

    def _see(self, samples: UnitSamples, motion: Attitudes, start: ChainStart) -> tuple[Note, ...]:
        """Look for a field, of a stream in its first seconds, and say what a reader should know."""
        assert self._motion is not None
        looked = motion.t[motion.rows] <= (np.inf if self._smooth else self._motion.settled)
        self._has_field = bool(np.isfinite(directions_at(samples, motion)[looked]).any())
        return _notes(
            self.chain, self._card, start, has_anchor=self._has_field or self._on_base, posed=self._pose is not None,
            causal=not self._smooth,
        )  # fmt: skip

    def _anchored(self, samples: UnitSamples, motion: Attitudes, ready: float) -> Anchored | None:
        """Common heading from the fields, where the ground does not hold it."""
        on_base, smooth = self._on_base, self._smooth
        # as of a moment, a frame that moves to North would carry all with it: fields hold it where it began
        steady = not smooth or on_base
        sd = (self._pose_sd or FRAME_SD) if on_base else FRAME_SD
        if not self._has_field:
            return drifting(motion, sd, self._anchor) if on_base else None
        north = _first_direction(samples, motion, ready) if steady else self._north
        sds = {"turn_sd": sd, "north_sd": UNKNOWN} if steady else {"turn_sd": UNKNOWN, "north_sd": FRAME_SD}
        return anchored(samples, motion, self._params, north=north, smooth=smooth, before=self._anchor, **sds)


def _posture(chain: Chain, pose: str | Sequence[float]) -> Floats:
    """Attitudes of the units (U, 4) in the root's axes."""
    if isinstance(pose, str):
        if pose != "zero":
            raise ParameterError(f"pose must be 'zero' or the angles that were held, but it is {check.said(pose)}.")
        pose = [0.0] * len(chain.angles)
    angles = np.array(pose, dtype=np.float64)
    if angles.shape != (len(chain.angles),) or not np.isfinite(angles).all():
        raise ParameterError(
            f"pose needs {len(chain.angles)} finite angles ({', '.join(chain.angles)}), but it is {check.said(pose)}."
        )
    postures = chain.postures(angles[np.newaxis])
    return np.array(
        [quat_multiply(postures[body.name].q_nb[0], np.array(body.mount.q_bs)) for body in chain.segments if body.unit]
    )


def _first_direction(samples: UnitSamples, motion: Attitudes, ready: float) -> float:
    """Direction of all level fields together at the keyframes from which headings begin, rad."""
    assert samples.mag is not None
    rows = motion.rows[motion.t[motion.rows] <= ready]
    level = np.nan_to_num(rotations.quat_rotate(motion.q[:, rows], samples.mag[:, rows])).sum(axis=(0, 1))
    return math.atan2(level[1], level[0])


def _source(params: Params, *, causal: bool) -> str:
    usual, given = Params()._asdict(), params._asdict()
    changed = [f"{p.name}={shown(p, given[p.name])}" for p in describe(Params) if given[p.name] != usual[p.name]]
    return ", ".join(["chain filter", "causal" if causal else "smoothed", *changed])


def _notes(
    chain: Chain, card: ArmCard | None, start: ChainStart, *, has_anchor: bool, posed: bool, causal: bool
) -> tuple[Note, ...]:
    notes: list[Note] = []
    if card is None:
        notes.append(warning("arm.no_card"))
    else:
        notes += [f"{joint.name}: {joint.rating}" for joint in card.joints if not joint.rating.startswith("good")]
    if chain.base_fixed and start.free and not posed:
        notes.append(warning("arm.no_pose"))
    elif start.free and not has_anchor:
        notes.append(warning("arm.heading_drifts"))
    elif start.free and causal:
        notes.append(
            "the common heading counts from the start, near North; the fields of all units keep it from drifting"
        )
    if causal:
        notes.append(info("arm.headings_begin", ready=start.ready))
    return tuple(notes)


def _without_common_heading(cov: Floats) -> Floats:
    """Covariance (K, 3U, 3U) but for the mean of all headings, whose variance the anchor has."""
    size = cov.shape[1]
    keep = np.eye(size)
    keep[2::3, 2::3] -= 3.0 / size
    return np.asarray(keep @ cov @ keep.T)


def _strays(links: Sequence[JointLink], motion: Attitudes) -> Floats:
    """By how many standard deviations both sides of each joint disagree about its axis at keyframes (K, L)."""
    matrices = rotations.dcm_from_quat(motion.q[:, motion.rows])
    strays = np.zeros((len(motion.rows), len(links)))
    for k, link in enumerate(links):
        if link.axes.shape[1]:
            parent = np.broadcast_to(np.eye(3), matrices[0].shape) if link.parent == GROUND else matrices[link.parent]
            in_parent, in_child = parent @ link.axes[0, 0], matrices[link.child] @ link.axes[1, 0]
            cosine = np.clip(np.einsum("ki,ki->k", in_parent, in_child), -1.0, 1.0)
            right = 0.5 * math.pi if link.joint.kind == "universal" else 0.0
            strays[:, k] = np.abs(np.arccos(cosine) - right) / link.play
    return strays


def _contradicted(links: Sequence[JointLink], rms: Floats) -> tuple[str, ...]:
    """Joints whose axis strays by much more than it did when the chain was aligned, in words."""
    return tuple(
        f"{link.joint.name}: both sides disagree about its axis by {to_deg(stray * link.play):.0f}°, and "
        f"{to_deg(link.play):.1f}° were expected; a unit has slipped, was exchanged or fails, or the card is of another"
        for link, stray in zip(links, rms, strict=True)
        if stray > STRAYS
    )


class _Reading:
    """Reads angles, attitudes and the hand from attitudes of units."""

    def __init__(
        self, chain: Chain, card: ArmCard | None, motion: Attitudes, anchor: Anchored | None, inside: Frame,
        frame: Frame, words: NDArray[np.uint32] | None, strays: Floats,
    ) -> None:  # fmt: skip
        self._strays, self._inside, self._frame = strays, inside, frame
        self._chain, self._card, self._motion, self._words = chain, card, motion, words
        self._numbers = unit_numbers(chain)
        self._times, self._rows = motion.t[motion.rows], motion.rows
        self._turn = np.zeros(len(motion.rows)) if anchor is None else anchor.turn
        self._cov = motion.cov if anchor is None else _without_common_heading(motion.cov)
        self._turn_var = np.zeros(len(motion.rows)) if anchor is None else anchor.var
        if anchor is None and motion.begun.size:  # nothing says how the whole turned in a gap
            self._turn_var[motion.begun[0] :] = LOST**2
        self._mount_var = {segment.name: self._var_of_mount(segment.unit) for segment in chain.segments}
        self._sway_var = {} if card is None else {joint.name: joint.sway**2 for joint in card.joints}
        self._q = self._segments()

    def _var_of_mount(self, unit: str) -> Floats:
        """Variances (3,) of a mount's turn about the segment's axes, rad²."""
        if not unit or self._card is None or unit not in self._card.mount_sd:
            return np.zeros(3)
        return np.square(np.array(self._card.mount_sd[unit][:3], dtype=np.float64))

    def _segments(self) -> dict[str, Floats]:
        """Attitude of each segment at each sample, by name."""
        turn = np.zeros((len(self._motion.t), 3))
        turn[:, 2] = np.interp(self._motion.t, self._times, self._turn)
        common, attitudes = rotations.quat_from_rotvec(turn), {}
        for segment in self._chain.segments:
            number = self._numbers[segment.name]
            if number == GROUND:
                attitudes[segment.name] = np.tile([1.0, 0.0, 0.0, 0.0], (len(turn), 1))
            else:
                of_unit = quat_multiply(common, self._motion.q[number])
                attitudes[segment.name] = quat_multiply(of_unit, quat_conjugate(np.array(segment.mount.q_bs)))
        return attitudes

    def estimate(self, *, north: rotations.North, source: str, notes: tuple[Note, ...], n_before: int) -> ArmEstimate:
        """All of it behind so many samples, which are keyframes."""
        angles = self._chain.angles_of(self._q)
        covs = {joint.name: self._joint_cov(joint) for joint in self._chain.joints}
        sd = np.hstack([self._angle_sd(joint, covs[joint.name]) for joint in self._chain.joints])
        hand, hand_sd = self._hand(angles)
        spread = self._at_samples(sd)
        joints = JointTrack(
            self._motion.t, self._chain.angles, angles, spread, hand, self._at_samples(hand_sd),
            self._flags(spread, north), source,
        )  # fmt: skip
        tracks = {segment.name: self._track(segment.name, north, source, n_before) for segment in self._chain.segments}
        rows, covs = self._rows[n_before:] - n_before, {name: cov[n_before:] for name, cov in covs.items()}
        return ArmEstimate(joints[n_before:], tracks, self._chain, self._frame, rows, covs, notes)

    def _at_samples(self, values: Floats) -> Floats:
        """Values at keyframes (K, M) at every sample."""
        return np.stack([np.interp(self._motion.t, self._times, column) for column in values.T], axis=1)

    def _flags(self, sd: Floats, north: rotations.North) -> NDArray[np.uint32]:
        words = np.zeros(len(self._motion.t), dtype=np.uint32)
        if self._words is not None:
            words |= self._words
        words[(sd > DOUBT).any(axis=1)] |= np.uint32(flags.NOT_CONVERGED)
        odd = np.interp(self._motion.t, self._times, self._strays.max(axis=1, initial=0.0)) > ODD
        words[odd] |= np.uint32(flags.INCONSISTENT)
        if north is rotations.North.FREE:
            words |= np.uint32(flags.HEADING_FREE)
        return words

    def _block(self, segment: str, second: str) -> Floats:
        """Covariance of the errors of two segments' attitudes at keyframes (K, 3, 3), in the frame inside, rad²."""
        a, b = self._numbers[segment], self._numbers[second]
        cov = np.zeros((len(self._rows), 3, 3))
        if GROUND not in (a, b):
            cov += self._cov[:, 3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
            cov[:, 2, 2] += self._turn_var
            if a == b:
                turn = rotations.dcm_from_quat(self._q[segment][self._rows])
                cov += (turn * (self._mount_var[segment] + self._own_sway(segment))) @ np.swapaxes(turn, 1, 2)
        return cov

    def _own_sway(self, segment: str) -> float:
        """Variance that a unit sways by on its segment: half of what its joints show, rad²."""
        joints = [joint.name for joint in self._chain.joints if segment in (joint.parent, joint.child)]
        shown_by = [self._sway_var[name] for name in joints if name in self._sway_var]
        return 0.5 * max(shown_by, default=0.0)

    def _joint_cov(self, joint: Joint) -> Floats:
        """Covariance of the child's attitude against the parent's at keyframes (K, 3, 3), parent axes, rad²."""
        between = self._block(joint.parent, joint.child)
        cov = self._block(joint.parent, joint.parent) + self._block(joint.child, joint.child)
        turn = rotations.dcm_from_quat(quat_conjugate(self._q[joint.parent][self._rows]))
        return turn @ (cov - between - np.swapaxes(between, 1, 2)) @ np.swapaxes(turn, 1, 2)

    def _angle_sd(self, joint: Joint, cov: Floats) -> Floats:
        """Standard deviations of a joint's angles at keyframes (K, degrees of freedom), rad."""
        parent, child = self._q[joint.parent][self._rows], self._q[joint.child][self._rows]
        relative = quat_multiply(quat_conjugate(parent), child)
        columns = []
        for axis in np.eye(3):
            ahead, behind = (
                joint.angles_of(quat_multiply(rotations.quat_from_rotvec(sign * _SMALL * axis), relative))
                for sign in (1.0, -1.0)
            )
            columns.append(rotations.wrap(ahead - behind) / (2.0 * _SMALL))
        slope = np.stack(columns, axis=2)
        return np.asarray(np.sqrt(np.maximum(np.einsum("kdi,kij,kdj->kd", slope, cov, slope), 0.0)))

    def _hand(self, angles: Floats) -> tuple[Floats, Floats]:
        """Position of the hand (N, 3), m, as a `JointTrack` has it, and its standard deviations at keyframes (K, 3)."""
        root = self._q[self._chain.segments[0].name]
        postures = self._chain.postures(angles, root)
        hand = self._chain.hand_at(postures)
        rows, by_child = self._rows, {joint.child: joint for joint in self._chain.joints}
        at = self._chain.hand or self._chain.segments[-1].name
        reach = np.array(self._chain.hand_b)
        path = list[tuple[str, Floats]]()
        while True:
            path.append((at, rotations.quat_rotate(self._q[at][rows], reach)))
            if at not in by_child:
                break
            at, reach = by_child[at].parent, np.array(by_child[at].place)
        cov = np.zeros((len(rows), 3, 3))
        for segment, a in path:
            for other, b in path:
                # both signs turn: a point at a moves by θ × a, which is −[a]× θ
                cov += rotations.skew(a) @ self._block(segment, other) @ np.swapaxes(rotations.skew(b), 1, 2)
        if self._inside is not self._frame and not self._chain.base_fixed:  # the base's axes are those inside
            turn = rotations.dcm_from_quat(rotations.frame_rotation(self._frame, self._inside))
            hand, cov = hand @ turn.T, turn @ cov @ turn.T
        return hand, np.sqrt(np.maximum(np.einsum("kii->ki", cov), 0.0))

    def _track(self, name: str, north: rotations.North, source: str, n_before: int) -> AttitudeTrack:
        q = self._q[name]
        turn = rotations.dcm_from_quat(quat_conjugate(q[self._rows]))
        cov = turn @ self._block(name, name) @ np.swapaxes(turn, 1, 2)
        nearest = np.searchsorted(self._rows, np.arange(len(q)), side="right") - 1
        return AttitudeTrack(
            t=self._motion.t[n_before:],
            q_nb=rotations.change_frame(q[n_before:], to=self._frame, from_=self._inside),
            frame=self._frame,
            north=north,
            cov_b=cov[nearest[n_before:]],
            source=f"{source}, {name}",
        )
