"""The filter over samples as they come: how headings begin, forward, and backward where what comes later may be used.

Cut anywhere, a stream gives the same bits. What lies between two keyframes is known when the second has come, up to
0.1 s later; the first attitudes when headings have begun, and then all since the first sample.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, Final

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
MOST: Final = 10  # keyframes of a stream at a time: what a late start has gathered is caught up with in so large parts


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

    def filter(self, links: Sequence[JointLink], params: Params) -> ChainFilter:
        """The filter that begins so."""
        return ChainFilter(links, len(self.q), params, self.q, self.sd)


@dataclass(frozen=True, eq=False)
class Attitudes:
    """Attitudes of all units.

    `t` (N,): times of the samples, s; `q` (U, N, 4): attitude of each unit at each sample, in the frame that the filter
    works in; `rows` (K,): samples that are keyframes; `cov` (K, 3U, 3U): covariance of the attitudes' errors there,
    navigation axes, rad²; `bias` (K, U, 3): biases of the gyroscopes there, rad/s; `begun` (S,): keyframes at which a
    gap ends, behind which the heading of the whole has begun again; `cov` leaves that out.
    """

    t: Floats
    q: Floats
    rows: NDArray[np.intp]
    cov: Floats
    bias: Floats
    begun: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def since(self, first: int) -> "Attitudes":
        """Those from a sample on that is a keyframe; what has begun again before has so at the first of them."""
        k = int(np.searchsorted(self.rows, first))
        rows, begun = self.rows[k:] - first, np.unique(np.maximum(self.begun - k, 0))
        return Attitudes(self.t[first:], self.q[:, first:], rows, self.cov[k:], self.bias[k:], begun)


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
    pose_sd: float = deg(1.0), search: "HeadingSearch | None" = None,
) -> ChainStart:  # fmt: skip
    """First attitudes: tilts of the first forces, headings that make neighbours agree, North where fields show it.

    `links`: joints, from the root; `north`: angle of North from the frame's x axis, rad; `pose` (U, 4): attitudes of
    the units in the root's axes at the first sample, where somebody took up a known posture, in the frame itself where
    the root stands still; `pose_sd`: how exactly it was held, rad; `search`: one that has looked at the first samples.
    """
    search = search or HeadingSearch(samples, links, params)
    q, fields = search.q, search.fields
    sd = np.full((len(q), 3), TILT_SD)
    if pose is None:
        search.look(samples)
        turns, sd[:, 2], free = search.turns(north)
        ready = search.ready
    else:
        _require_pose(q, pose, links)
        turns, free = _heading_of_pose(q, pose, links), not _heading_fixed(links)
        sd[:, 2], ready = pose_sd, float(samples.t[0])
        fields.add(q, samples, fields.first(samples))
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


class HeadingSearch:
    """Looks for turns about the vertical that make neighbours agree, from keyframe to keyframe as samples come.

    `q` (U, 4): tilts of the first forces; `ready`: how far it has looked, s, and no further once headings are known.
    """

    def __init__(self, samples: UnitSamples, links: Sequence[JointLink], params: Params) -> None:
        self.q = first_tilts(samples)
        self.fields = _Fields(len(self.q), params.field_sd)
        self.ready = float(samples.t[0])
        self._links, self._row, self._settled = links, 0, False
        self._sums, self._weights = np.zeros(len(links), dtype=complex), np.zeros(len(links))
        self._filter = ChainFilter(links, len(self.q), params, self.q, np.full((len(self.q), 3), TILT_SD))

    def look(self, samples: UnitSamples) -> None:
        """Look at all samples since the first one, of which it has seen some before."""
        params, path = self._filter.params, np.zeros((*samples.gyr.shape[:2], 4))
        rows = keyframe_rows(samples.t, params.keyframe)
        for first, last in pairwise(rows[rows >= self._row].tolist()):
            if self._settled:
                return
            self._filter.look(samples, first + 1, last + 1, path)
            _agree(self._filter, self._sums, self._weights, samples.t[last] - samples.t[first])
            self.fields.add(self._filter.q, samples, last)
            self._row, self.ready = last, float(samples.t[last])
            lasted = self.ready - samples.t[0]
            is_known = lasted >= params.start and self._spread().max(initial=0.0) < SETTLED
            self._settled = bool(is_known or lasted >= LONGEST_START)

    def _spread(self) -> Floats:
        """Standard deviation of each child's heading against its parent's, rad."""
        by_joint = 1.0 / np.sqrt(np.maximum(self._weights, 1e-12))
        by_field = [self.fields.sd(link.parent, link.child) for link in self._links]
        return np.minimum(by_joint, by_field)

    def turns(self, north: float) -> tuple[Floats, Floats, bool]:
        """Turns (U,) that make neighbours agree, how well they do (U,), rad, and whether the whole may be turned."""
        spread, fields = self._spread(), self.fields
        turns, sd, free = np.zeros(len(self.q)), np.full(len(self.q), SETTLED), True
        for k, link in enumerate(self._links):
            by_joint = 1.0 / math.sqrt(max(self._weights[k], 1e-12))
            if link.parent == GROUND:
                settled = by_joint < SETTLED
                turns[link.child] = np.angle(self._sums[k]) if settled else fields.turn(link.child, north)
                free &= not settled
            elif by_joint <= fields.sd(link.parent, link.child):
                turns[link.child] = turns[link.parent] + np.angle(self._sums[k])
            else:
                turns[link.child] = (
                    turns[link.parent] + fields.turn(link.child, north) - fields.turn(link.parent, north)
                )
            sd[link.child] = max(min(float(spread[k]), LOST), SETTLED)
        return turns, sd, free


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


class _Fields:
    """Horizontal fields of the units since the start, in their first frames."""

    def __init__(self, units: int, sd: float) -> None:
        self._sum, self._sd = np.zeros(units, dtype=complex), sd

    def add(self, q: Floats, samples: UnitSamples, row: int) -> None:
        """Add those of a sample."""
        if samples.mag is None:
            return
        level = quat_rotate(q, np.nan_to_num(samples.mag[:, row]))
        self._sum += level[:, 0] + 1j * level[:, 1]

    @staticmethod
    def first(samples: UnitSamples) -> int:
        """First sample with a field of any unit."""
        return 0 if samples.mag is None else int(np.isfinite(samples.mag[:, :, 0]).any(axis=0).argmax())

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


def joined(parts: Sequence[Attitudes]) -> Attitudes:
    """Attitudes of parts that follow each other."""
    if len(parts) == 1:
        return parts[0]
    samples, keyframes = (np.cumsum([0, *map(len, each)]) for each in zip(*((m.t, m.rows) for m in parts), strict=True))
    return Attitudes(
        t=np.concatenate([motion.t for motion in parts]),
        q=np.concatenate([motion.q for motion in parts], axis=1),
        rows=np.concatenate([motion.rows + at for motion, at in zip(parts, samples, strict=False)]),
        cov=np.concatenate([motion.cov for motion in parts]),
        bias=np.concatenate([motion.bias for motion in parts]),
        begun=np.concatenate([motion.begun + at for motion, at in zip(parts, keyframes, strict=False)]),
    )


def estimated(
    samples: UnitSamples, filter_: ChainFilter, rows: NDArray[np.intp], frame: Keyframe, q: Floats, *, smooth: bool,
    progress: Callable[[int], None],
) -> tuple[Attitudes, Keyframe]:  # fmt: skip
    """Attitudes of all units from a keyframe at the first sample on, where they are q (U, 4), and the last keyframe.

    `rows`: samples that are keyframes, up to the last one wanted; `smooth`: whether each attitude may know what comes
    later; `progress`: called with the number of samples done since the last call.
    """
    params, path = filter_.params, np.empty((len(q), int(rows[-1]) + 1, 4))
    path[:, 0] = q
    history, frames = _History(samples, params, len(q)), [frame._replace(row=0)]
    if not smooth:
        history.add(frames, 1)
    for first, last in pairwise(rows.tolist()):
        frame = filter_.advance(samples, first + 1, last + 1, path)
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
        progress(last - first)
    if smooth:
        history.add(backward(frames), len(frames), path)
    return history.motion(path), frame


class _History:
    """What is kept of keyframes that are done."""

    def __init__(self, samples: UnitSamples, params: Params, units: int) -> None:
        self._samples, self._params = samples, params
        self._places = (np.arange(units)[:, np.newaxis] * WIDTH + np.arange(3)).ravel()
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

    def motion(self, path: Floats) -> Attitudes:
        """All of it."""
        t, rows = self._samples.t[: path.shape[1]], np.array(self._rows)
        return Attitudes(t, path, rows, np.array(self._cov), np.array(self._bias))


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


def samples_joined(parts: Sequence[UnitSamples]) -> UnitSamples:
    """Samples that follow each other."""
    if len(parts) == 1:
        return parts[0]
    columns = {"t": 0, "gyr": 1, "acc": 1, "mag": 1, "flags": 0}  # and the axis of the samples
    return UnitSamples(**{
        name: np.concatenate([getattr(part, name) for part in parts], axis=axis)
        for name, axis in columns.items()
        if getattr(parts[0], name) is not None
    })  # fmt: skip


class UnitAttitudes:
    """Attitudes of all units as their samples come; behind a gap, everything begins as at the start.

    A filter that turned on through a gap would be wrong by more than a linear filter can mend. Parameters are as of
    `plumbob.arm.smoother.begin` and `estimated`; smoothed, all come at the end. `start` is how the chain begins, once
    that is known.
    """

    def __init__(
        self, links: Sequence[JointLink], params: Params, *, north: float = 0.0, pose: Floats | None = None,
        pose_sd: float = 0.0, smooth: bool = False, progress: Callable[[int, int], None] | None = None,
    ) -> None:  # fmt: skip
        self._links, self._params, self._north = links, params, north
        self._smooth, self._progress, self._done, self._total = smooth, progress, 0, 0
        self._pose, self._pose_sd = pose, pose_sd
        self.start: ChainStart | None = None
        self._rate_at: float | None = None  # when a gyroscope has said something last, s
        self._last: tuple[Attitudes, UnitSamples] | None = None  # the last keyframe of all that was given
        self._pending: list[tuple[Attitudes, UnitSamples]] = []
        self.settled = -np.inf  # what is known of headings and fields at the start, all come to know at once then, s
        self._renew()

    def _renew(self) -> None:
        self._samples: UnitSamples | None = None  # from the last keyframe on
        self._filter: ChainFilter | None = None
        self._search: HeadingSearch | None = None

    def take(self, samples: UnitSamples, *, end: bool) -> tuple[Attitudes, UnitSamples, int] | None:
        """Attitudes that these samples complete, with their samples; None where that is nothing.

        The first ones may be the last of the call before, so many as the number says. With `end`, nothing else comes.
        """
        self._total, parts, self._pending = self._total + len(samples), self._pending, []
        for k, (first, last) in enumerate(self.stretches(samples)):
            if k:
                parts += self._go(end=True)
                self._renew()
            new = samples.rows(first, last)
            if len(new):
                self._samples = new if self._samples is None else samples_joined([self._samples, new])
                parts += self._go(end=False)
        parts += self._go(end=True) if end else []
        if not parts or (not end and parts[-1][0].t[-1] < self.settled):
            self._pending = parts
            return None
        before = [] if self._last is None else [self._last]
        motion, taken = joined([m for m, _ in before + parts]), samples_joined([s for _, s in before + parts])
        last = len(taken) - 1
        self._last = motion.since(last), taken.rows(last, last + 1)
        return motion, taken, len(before)

    def stretches(self, samples: UnitSamples) -> Iterator[tuple[int, int]]:
        """Samples of the stretch so far, and of each that begins where all gyroscopes were silent for a `GAP`."""
        rows = np.flatnonzero(np.isfinite(samples.gyr[:, :, 0]).any(axis=0))
        times = samples.t[rows]
        before = times[:1] if self._rate_at is None else np.array([self._rate_at])
        firsts = rows[np.diff(np.concatenate((before, times))) > GAP].tolist() if len(rows) else []
        self._rate_at = float(times[-1]) if len(rows) else self._rate_at
        yield from pairwise([0, *firsts, len(samples)])

    def _go(self, *, end: bool) -> list[tuple[Attitudes, UnitSamples]]:
        """Attitudes up to the last keyframe, or the last sample, behind those that were given, with their samples."""
        samples = self._samples
        if samples is None or (self._smooth and not end):
            return []
        rows = keyframe_rows(samples.t, self._params.keyframe)
        if not end and len(rows) > 1:
            last, before = samples.t[rows[-1]], samples.t[rows[-2]]
            rows = rows[:-1] if last - before < self._params.keyframe * (1.0 - 1e-6) else rows
        is_new, begun = self._filter is None, np.zeros(0, dtype=np.intp)
        if self._filter is None:
            start = self._begin(samples, rows, end=end)
            if start is None:
                return []
            begun = np.zeros(int(self.start is not None and start.free), dtype=np.intp)
            if self.start is None:
                self.start, self.settled = start, max(start.ready, float(samples.t[0]) + TILT_TIME)
            self._filter = start.filter(self._links, self._params)
            self._frame, self._q = self._filter.now(), start.q
        elif len(rows) < 2:
            return []
        rows = rows if end else rows[: MOST + 1]
        motion, self._frame = estimated(
            samples, self._filter, rows, self._frame, self._q, smooth=self._smooth, progress=self._count
        )
        self._q, stop = motion.q[:, -1].copy(), len(motion.t)
        self._samples, first = samples.rows(stop - 1, len(samples)), int(not is_new)
        return [(replace(motion.since(first), begun=begun), samples.rows(first, stop))]

    def _count(self, more: int) -> None:
        self._done += more
        if self._progress:
            self._progress(self._done, self._total)

    def _begin(self, samples: UnitSamples, rows: NDArray[np.intp], *, end: bool) -> ChainStart | None:
        """How the chain begins, where that is known: it was before the last keyframe that was looked at."""
        pose = self._pose if self.start is None else None
        how: dict[str, Any] = {"north": self._north, "pose": pose, "pose_sd": self._pose_sd}
        least = samples.t[0] + max(TILT_TIME, self._params.start if pose is None else 0.0)
        later = rows[1:][samples.t[rows[1:]] > least]
        if later.size and not self._smooth:
            part = samples.rows(0, int(later[-1]) + 1)
            self._search = self._search or HeadingSearch(part, self._links, self._params)
            start = begin(part, self._links, self._params, search=self._search, **how)
            if start.ready < samples.t[later[-1]]:
                return start
        return begin(samples, self._links, self._params, search=self._search, **how) if end else None
