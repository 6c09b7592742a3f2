"""The filter over a recording: how the headings begin, forward, and backward where what comes later may be used."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.arm.filter import GAP, WIDTH, ChainFilter, Keyframe, Params, UnitSamples
from plumbob.arm.links import GROUND, JointLink
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.kernels import kernel
from plumbob.core.units import deg, to_deg
from plumbob.rotations import (
    dcm_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_rotate,
    rotvec_from_quat,
)
from plumbob.rotations.kernels import quat_exp, quat_mul, quat_unit

TILT_TIME: Final = 1.5  # first tilts are those of the mean force over this, s
TILT_SD: Final = deg(3.0)
SETTLED: Final = deg(20.0)  # headings have begun when neighbours know theirs against each other to this, rad;
LONGEST_START: Final = 60.0  # or after this, s, whatever they know
POSE_LIMIT: Final = deg(20.0)  # further than this, rad, a unit is not tilted away from its place in a posture
LEVEL: Final = 0.2  # length of the level part of an axis that shows a heading
LOST: Final = deg(90.0)
FRAME_SD: Final = deg(0.01)
SPAN: Final = 300.0  # a recording is smoothed in stretches of this, s, with what
AHEAD: Final = 60.0  # comes so much later, s


@dataclass(frozen=True, eq=False)
class ChainStart:
    """How a chain begins.

    `q` (U, 4), `sd` (U, 3): first attitudes, and their standard deviations about the navigation axes, rad; `ready`:
    when it is known, s; `free`: whether the heading of the whole means nothing yet; with magnetometers it is near
    North.
    """

    q: Floats
    sd: Floats
    ready: float
    free: bool


@dataclass(frozen=True, eq=False)
class Attitudes:
    """Attitudes of all units.

    `t` (N,): times of the samples, s; `q` (U, N, 4): attitude of each unit at each sample, in the frame that the filter
    works in; `rows` (K,): samples that are keyframes; `cov` (K, 3U, 3U): covariance of the attitudes' errors there,
    navigation axes, rad²; `bias` (K, U, 3): biases of the gyroscopes there, rad/s; `ready`: when a live system would
    have known this, s; `begun` (S,): keyframes at which a gap ends, behind which the heading of the whole has begun
    again; `cov` leaves that out.
    """

    t: Floats
    q: Floats
    rows: NDArray[np.intp]
    cov: Floats
    bias: Floats
    ready: float
    begun: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))


def keyframe_rows(t: Floats, spacing: float) -> NDArray[np.intp]:
    """Samples, from the first to the last, at least `spacing` apart but for the last."""
    rows, last = [0], t[0]
    for row in range(1, t.size):
        if t[row] - last >= spacing * (1.0 - 1e-6):
            rows.append(row)
            last = t[row]
    if rows[-1] != t.size - 1:
        rows.append(t.size - 1)
    return np.array(rows)


def begin(
    samples: UnitSamples, links: Sequence[JointLink], params: Params, *, north: float, pose: Floats | None = None,
    pose_sd: float = deg(1.0),
) -> ChainStart:  # fmt: skip
    """First attitudes: tilts of the first forces, headings that make neighbours agree, North where fields show it.

    `links`: joints, from the root; `north`: angle of North from the frame's x axis, rad; `pose` (U, 4): attitudes of
    the units in the root's axes at the first sample, where somebody took up a known posture, in the frame itself where
    the root stands still; `pose_sd`: how exactly it was held, rad.
    """
    q = first_tilts(samples)
    units = len(q)
    sd = np.full((units, 3), TILT_SD)
    fields = _Fields(samples, units, params.field_sd)
    if pose is None:
        turns, sd[:, 2], ready, free = _headings(samples, links, params, q, fields, north)
    else:
        _require_pose(q, pose, links)
        turns, free = _heading_of_pose(q, pose, links), not _heading_fixed(links)
        sd[:, 2], ready = pose_sd, float(samples.t[0])
        fields.add(q, fields.first)
    if free:
        sd[0, 2] = FRAME_SD  # it is what the frame's heading means
        turns = turns if pose is not None and _grounded(links) else turns + fields.common_turn(turns, north)
    return ChainStart(_yawed(q, turns), sd, ready, free)


def _yawed(q: Floats, angles: Floats) -> Floats:
    up = np.zeros((len(q), 3))
    up[:, 2] = angles
    return quat_multiply(quat_from_rotvec(up), q)


def _grounded(links: Sequence[JointLink]) -> bool:
    return any(link.parent == GROUND for link in links)


def first_tilts(samples: UnitSamples) -> Floats:
    """Attitudes (U, 4) at the first sample whose mean force of the first 1.5 s points up; headings mean nothing."""
    count = max(2, int(np.searchsorted(samples.t, samples.t[0] + TILT_TIME)))
    gyr, acc = np.nan_to_num(samples.gyr[:, :count]), samples.acc[:, :count]
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(gyr), 1))
    total = np.nan_to_num(acc[:, 0])
    for k in range(1, min(count, len(samples))):
        q = quat_multiply(q, quat_from_rotvec(gyr[:, k] * (samples.t[k] - samples.t[k - 1])))
        total = total + np.nan_to_num(quat_rotate(q, np.nan_to_num(acc[:, k])))
    across = np.cross(total, [0.0, 0.0, 1.0])
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, total[:, 2]) / np.maximum(sine, 1e-12)
    level = quat_from_rotvec(across * angle[:, np.newaxis])
    upside_down = (sine < 1e-9 * np.linalg.norm(total, axis=1)) & (total[:, 2] < 0.0)
    level[upside_down] = [0.0, 1.0, 0.0, 0.0]
    return level


def _heading_fixed(links: Sequence[JointLink]) -> bool:
    """Whether a joint on the ground holds the heading: a fixed one, or a hinge that does not stand upright."""
    on_ground = [link for link in links if link.parent == GROUND and link.joint.kind in ("hinge", "fixed")]
    return any(float(np.hypot(*axis[:2])) > LEVEL for link in on_ground for axis in link.axes[0])


def _require_pose(q: Floats, pose: Floats, links: Sequence[JointLink]) -> None:
    """Refuse a posture whose tilts are not those that gravity shows."""
    pose = _posed(q, pose, links)
    up = np.array([0.0, 0.0, 1.0])
    ours, theirs = quat_rotate(quat_conjugate(q), up), quat_rotate(quat_conjugate(pose), up)
    off = np.arccos(np.clip(np.einsum("ui,ui->u", ours, theirs), -1.0, 1.0))
    if off.max() > POSE_LIMIT:
        raise ParameterError(
            f"the pose does not fit the first {TILT_TIME:g} s: gravity shows a unit tilted {to_deg(off.max()):.0f}° "
            "away from it. Give the angles that were held at the first sample, or leave the pose out."
        )


def _posed(q: Floats, pose: Floats, links: Sequence[JointLink]) -> Floats:
    """Attitudes of a posture in the frame; turned as the first unit is, where the root is free."""
    if _grounded(links):
        return pose
    return quat_multiply(quat_multiply(q[0], quat_conjugate(pose[0])), pose)


def _heading_of_pose(q: Floats, pose: Floats, links: Sequence[JointLink]) -> Floats:
    """Turns about the vertical (U,) that bring attitudes nearest to those of a posture."""
    off = quat_multiply(_posed(q, pose, links), quat_conjugate(q))
    return np.asarray(2.0 * np.arctan2(off[:, 3], off[:, 0]))


def _headings(
    samples: UnitSamples, links: Sequence[JointLink], params: Params, q: Floats, fields: "_Fields", north: float
) -> tuple[Floats, Floats, float, bool]:
    """Turns about the vertical (U,) that make neighbours agree, and how well they do (U,), rad.

    And since when, and whether the whole may still be turned.
    """
    sums, weights = np.zeros(len(links), dtype=complex), np.zeros(len(links))
    looking = ChainFilter(links, len(q), params, q, np.full((len(q), 3), TILT_SD))
    path = np.zeros((*samples.gyr.shape[:2], 4))
    rows = keyframe_rows(samples.t, params.keyframe)
    ready = float(samples.t[0])
    for first, last in pairwise(rows):
        looking.look(samples, int(first) + 1, int(last) + 1, path)
        _agree(looking, sums, weights, samples.t[last] - samples.t[first])
        fields.add(looking.q, int(last))
        ready = float(samples.t[last])
        lasted = ready - samples.t[0]
        if lasted >= params.start and _spread(weights, links, fields).max(initial=0.0) < SETTLED:
            break
        if lasted >= LONGEST_START:
            break
    spread = _spread(weights, links, fields)
    turns, sd, free = np.zeros(len(q)), np.full(len(q), SETTLED), True
    for k, link in enumerate(links):
        by_joint = 1.0 / math.sqrt(max(weights[k], 1e-12))
        if link.parent == GROUND:
            settled = by_joint < SETTLED
            turns[link.child] = np.angle(sums[k]) if settled else fields.turn(link.child, north)
            free &= not settled
        elif by_joint <= fields.sd(link.parent, link.child):
            turns[link.child] = turns[link.parent] + np.angle(sums[k])
        else:
            turns[link.child] = turns[link.parent] + fields.turn(link.child, north) - fields.turn(link.parent, north)
        sd[link.child] = max(min(float(spread[k]), LOST), SETTLED)
    return turns, sd, ready, free


def _agree(looking: ChainFilter, sums: NDArray[np.complex128], weights: Floats, span: float) -> None:
    """Add what a keyframe says of the turn of each child against its parent: a phasor, and its weight, 1/rad²."""
    matrices = dcm_from_quat(looking.q)
    for k, link in enumerate(looking.links):
        ground = link.parent == GROUND
        parent, child = np.eye(3) if ground else matrices[link.parent], matrices[link.child]
        pairs = []
        if link.joint.kind in ("hinge", "fixed"):
            var = link.play**2 * max(1.0, 2.0 * link.play_time / span)
            pairs += [(parent @ a, child @ b, var) for a, b in zip(*link.axes, strict=True)]
        forces = looking.forces[2 * k : 2 * k + 2]
        if not ground and np.isfinite(forces).all():
            pairs.append((forces[0], forces[1], 2.0 * link.force_sd**2 * max(1.0, 2.0 * link.force_time / span)))
        for in_parent, in_child, var in pairs:
            product = complex(in_parent[0], in_parent[1]) * complex(in_child[0], -in_child[1])
            sums[k] += product / var
            weights[k] += max(abs(product) - var, 0.0) / var


def _spread(weights: Floats, links: Sequence[JointLink], fields: "_Fields") -> Floats:
    """Standard deviation of each child's heading against its parent's, rad."""
    by_joint = 1.0 / np.sqrt(np.maximum(weights, 1e-12))
    by_field = [fields.sd(link.parent, link.child) for link in links]
    return np.minimum(by_joint, by_field)


class _Fields:
    """Horizontal fields of the units since the start, in their first frames."""

    def __init__(self, samples: UnitSamples, units: int, sd: float) -> None:
        self._mag, self._sum, self._sd = samples.mag, np.zeros(units, dtype=complex), sd

    def add(self, q: Floats, row: int) -> None:
        """Add those of a sample."""
        if self._mag is None:
            return
        level = quat_rotate(q, np.nan_to_num(self._mag[:, row]))
        self._sum += level[:, 0] + 1j * level[:, 1]

    @property
    def first(self) -> int:
        """First sample with a field of any unit."""
        return 0 if self._mag is None else int(np.isfinite(self._mag[:, :, 0]).any(axis=0).argmax())

    def common_turn(self, turns: Floats, north: float) -> float:
        """Turn of the whole, rad, that brings all fields together to North, behind a turn of each unit."""
        total = complex(np.sum(self._sum * np.exp(1j * turns)))
        return north - float(np.angle(total)) if abs(total) > 0.0 else 0.0

    def sd(self, parent: int, child: int) -> float:
        """How well two units' fields say their headings against each other, rad; infinite where one has none."""
        has_field = abs(self._sum[child]) > 0.0 and (parent == GROUND or abs(self._sum[parent]) > 0.0)
        return math.sqrt(2.0) * self._sd if has_field else math.inf

    def turn(self, unit: int, north: float) -> float:
        """Turn about the vertical that brings a unit's field to North, rad."""
        return north - float(np.angle(self._sum[unit])) if abs(self._sum[unit]) > 0.0 else 0.0


def stretches(samples: UnitSamples) -> list[tuple[int, int]]:
    """First samples, and those behind the last, of stretches between which all gyroscopes are silent for a `GAP`."""
    rows = np.flatnonzero(np.isfinite(samples.gyr[:, :, 0]).any(axis=0))
    firsts = [0, *rows[1:][np.diff(samples.t[rows]) > GAP].tolist()]
    return list(zip(firsts, [*firsts[1:], len(samples)], strict=True))


def estimate_motion(
    samples: UnitSamples, links: Sequence[JointLink], params: Params, *,
    north: float, pose: Floats | None = None, pose_sd: float = deg(1.0), smooth: bool,
    progress: Callable[[int], None] | None = None,
) -> tuple[ChainStart, Attitudes]:  # fmt: skip
    """How a recording begins, and attitudes over all of it; behind a gap, everything begins as at the start.

    Parameters are as of `begin` and `estimated`. A filter that turned on through a gap would be wrong by more than a
    linear filter can mend.
    """
    starts, parts, begun, count = list[ChainStart](), list[Attitudes](), list[int](), 0
    for first, last in stretches(samples):
        part = samples.rows(first, last)
        starts.append(begin(part, links, params, north=north, pose=None if starts else pose, pose_sd=pose_sd))
        parts.append(estimated(part, links, params, starts[-1], smooth=smooth, progress=progress))
        if first and starts[-1].free:
            begun.append(count)
        parts[-1] = replace(parts[-1], rows=parts[-1].rows + first)
        count += len(parts[-1].rows)
    if len(parts) == 1:
        return starts[0], parts[0]
    return starts[0], Attitudes(
        t=samples.t,
        q=np.concatenate([motion.q for motion in parts], axis=1),
        rows=np.concatenate([motion.rows for motion in parts]),
        cov=np.concatenate([motion.cov for motion in parts]),
        bias=np.concatenate([motion.bias for motion in parts]),
        ready=parts[0].ready,
        begun=np.array(begun, dtype=np.intp),
    )


def estimated(
    samples: UnitSamples, links: Sequence[JointLink], params: Params, start: ChainStart, *,
    smooth: bool, progress: Callable[[int], None] | None = None,
) -> Attitudes:  # fmt: skip
    """Attitudes of all units over a recording that begins as `begin` found.

    `smooth`: whether each attitude may know what comes later; `progress`: called with the number of samples done since
    the last call.
    """
    filter_ = ChainFilter(links, len(start.q), params, start.q, start.sd)
    rows = keyframe_rows(samples.t, params.keyframe)
    path = np.empty((len(start.q), len(samples), 4))
    path[:, 0] = start.q
    history = _History(samples, params, len(start.q))
    history.add([filter_.now()], 1)
    frames = list[Keyframe]()
    for first, last in pairwise(rows):
        frame = filter_.advance(samples, int(first) + 1, int(last) + 1, path)
        if params.mean_rate:
            path[:, last] = frame.q
        if smooth:
            frames.append(frame)
            if samples.t[last] - samples.t[frames[0].row] > SPAN + AHEAD:
                done = sum(1 for keyframe in frames if samples.t[keyframe.row] - samples.t[frames[0].row] <= SPAN)
                history.add(backward(frames), done, path)
                frames = frames[done:]
        else:
            history.add([frame], 1)
        if progress:
            progress(int(last - first))
    if frames:
        history.add(backward(frames), len(frames), path)
    return history.motion(path, start.ready if not smooth else float(samples.t[0]))


class _History:
    """What is kept of keyframes that are done."""

    def __init__(self, samples: UnitSamples, params: Params, units: int) -> None:
        self._samples, self._params = samples, params
        places = np.arange(units)[:, np.newaxis] * WIDTH + np.arange(3)
        self._places = places.ravel()
        self._rows, self._cov, self._bias = list[int](), list[Floats](), list[Floats]()

    def add(self, frames: Sequence[Keyframe], count: int, path: Floats | None = None) -> None:
        """Keep the first `count`; where they are smoothed, fill in the attitudes from each to the next."""
        for k, frame in enumerate(frames[:count]):
            self._rows.append(frame.row)
            self._cov.append(frame.cov[np.ix_(self._places, self._places)])
            self._bias.append(frame.linear[:, :3].copy())
            if path is not None:
                end = frames[k + 1].row if k + 1 < len(frames) else frame.row
                fill(self._samples.t, self._samples.gyr, frame.row, end, self._params.mean_rate, frame.q, frame.linear,
                     path)  # fmt: skip
                if k + 1 < len(frames):
                    self._bridge(frame, frames[k + 1], path)

    def _bridge(self, before: Keyframe, after: Keyframe, path: Floats) -> None:
        """Turn evenly from keyframe to keyframe where a unit has no rate."""
        inside = np.arange(before.row + 1, after.row)
        for u in np.flatnonzero(np.isnan(self._samples.gyr[:, before.row + 1 : after.row + 1, 0]).any(axis=1)):
            turn = rotvec_from_quat(quat_multiply(after.q[u], quat_conjugate(before.q[u])))
            share = (self._samples.t[inside] - self._samples.t[before.row]) / (
                self._samples.t[after.row] - self._samples.t[before.row]
            )
            path[u, inside] = quat_multiply(quat_from_rotvec(share[:, np.newaxis] * turn), before.q[u])

    def motion(self, path: Floats, ready: float) -> Attitudes:
        """All of it."""
        return Attitudes(self._samples.t, path, np.array(self._rows), np.array(self._cov), np.array(self._bias), ready)


def backward(frames: Sequence[Keyframe]) -> list[Keyframe]:
    """Rauch–Tung–Striebel: each keyframe as those behind it have it [Rauch1965]."""
    smoothed = [frames[-1]]
    for frame, after in zip(frames[-2::-1], frames[:0:-1], strict=True):
        later = smoothed[-1]
        gain = np.linalg.solve(after.cov_prior, after.transition @ frame.cov).T
        turn = rotvec_from_quat(quat_multiply(later.q, quat_conjugate(after.q_prior)))
        correction = (gain @ np.hstack((turn, later.linear - after.linear_prior)).ravel()).reshape(-1, WIDTH)
        cov = frame.cov + gain @ (later.cov - after.cov_prior) @ gain.T
        q = quat_multiply(quat_from_rotvec(correction[:, :3]), frame.q)
        smoothed.append(frame._replace(q=q, linear=frame.linear + correction[:, 3:], cov=0.5 * (cov + cov.T)))
    return smoothed[::-1]


@kernel
def fill(t: Floats, gyr: Floats, first: int, last: int, mean_rate: bool, q: Floats, bias: Floats, path: Floats) -> None:
    """Attitudes from a smoothed keyframe at a sample on, to the one before the next; `bias` may hold more behind it."""
    for u in range(q.shape[0]):
        q0, q1, q2, q3 = q[u, 0], q[u, 1], q[u, 2], q[u, 3]
        wx, wy, wz = bias[u, 0], bias[u, 1], bias[u, 2]
        if not math.isnan(gyr[u, first, 0]):
            wx, wy, wz = gyr[u, first, 0], gyr[u, first, 1], gyr[u, first, 2]
        for r in range(first, max(last, first + 1)):
            half = 0.5 * (t[r] - t[r - 1]) if r else 0.0
            if r > first:
                if not math.isnan(gyr[u, r, 0]):
                    wx, wy, wz = gyr[u, r, 0], gyr[u, r, 1], gyr[u, r, 2]
                h0, h1, h2, h3 = quat_exp(
                    2.0 * half * (wx - bias[u, 0]), 2.0 * half * (wy - bias[u, 1]), 2.0 * half * (wz - bias[u, 2])
                )
                q0, q1, q2, q3 = quat_mul(q0, q1, q2, q3, h0, h1, h2, h3)
                q0, q1, q2, q3 = quat_unit(q0, q1, q2, q3)
            p0, p1, p2, p3 = q0, q1, q2, q3
            if not mean_rate:  # half a step back: the rate is that at the sample
                h0, h1, h2, h3 = quat_exp(
                    -half * (wx - bias[u, 0]), -half * (wy - bias[u, 1]), -half * (wz - bias[u, 2])
                )
                p0, p1, p2, p3 = quat_mul(q0, q1, q2, q3, h0, h1, h2, h3)
            path[u, r, 0], path[u, r, 1], path[u, r, 2], path[u, r, 3] = p0, p1, p2, p3
