"""How a unit sits on its body: from two poses at rest, from one, or from a reference of the body's attitude.

With the body level, the specific force is its vertical; with its nose raised about its lateral axis, the force leans
forward. Both, seen from the unit, give the body's axes: z by the first pose, x by what the second adds, which is the
method of two vectors (TRIAD) with the first one exact. Forces alone do not say that it was the lateral axis about which
the body was raised: a gyroscope shows whether that axis was horizontal, and nothing shows whether it was lateral.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from plumbob.calibration.fit import CaptureRefusedError, Reason, refuse
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.findings import Note
from plumbob.core.units import deg, to_deg
from plumbob.data.cards import Mount
from plumbob.rotations import (
    Frame,
    quat_angle,
    quat_conjugate,
    quat_from_dcm,
    quat_mean,
    quat_multiply,
    rotvec_from_quat,
)

LEAST_RAISE: Final = float(deg(10.0))
"""Smallest angle between the two poses, rad: 1 mg of force is then 0.3° of heading."""

ASKEW: Final = float(deg(10.0))
"""Largest elevation of the axis about which the body was raised, rad."""

SCATTER: Final = float(deg(10.0))
"""Median angle above which two attitudes do not differ by a constant rotation, rad."""

_GRAVITY = 0.05  # departure from standard gravity, relative, that no place on Earth and no usual bias has
_UNKNOWN = float(np.pi / np.sqrt(3.0))  # standard deviation of an angle of which nothing is known, rad
_PARTS = 10
_ROUNDS = 10  # of reweighting


@dataclass(frozen=True, eq=False)
class Mounted:
    """A mounting that was found, with remarks on it, each a sentence."""

    mount: Mount
    remarks: tuple[Note, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class _Up:
    """Vertical seen from the unit, a unit vector (3,), and its standard deviation, rad."""

    axis: Floats
    sd: float


def mount_from_level(level: ArrayLike, *, frame: Frame) -> Mounted:
    """Roll and pitch of the mounting from the specific force (N, 3), m/s², of the level body at rest.

    Its heading is assumed: the case's x axis points ahead. Standard deviations are those of white noise; that about the
    vertical is of an angle of which nothing is known. CaptureRefusedError if the force is not that of gravity, or the
    case's x axis is too near the vertical to point ahead.
    """
    up = _up("level", level)
    ahead = np.array([1.0, 0.0, 0.0])
    if np.linalg.norm(np.cross(up.axis, ahead)) < np.sin(LEAST_RAISE):
        text = f"the case's x axis is {to_deg(_angle(up.axis, ahead)):.0f}° from the vertical, and so points not ahead."
        raise CaptureRefusedError(Reason("ill-conditioned", text, "Record a second pose with the nose raised."))
    mount = Mount(_axes(up.axis, ahead, frame), np.array([up.sd, up.sd, _UNKNOWN]), f"level pose, body axes of {frame}")
    return Mounted(mount, ("the mounting's heading was not measured: the case's x axis is taken to point ahead.",))


def mount_from_poses(level: ArrayLike, raised: ArrayLike, *, frame: Frame, turn: ArrayLike | None = None) -> Mounted:
    """Mounting from the level body and the body with its nose raised about its lateral axis.

    Parameters
    ----------
    level, raised : array_like (N, 3)
        Specific force at rest in each pose, m/s², calibrated: 1 mg of bias is 0.06° of roll and pitch.
    frame : Frame
        Its body axes: z down in NED, up in ENU and NWU.
    turn : array_like (3,), optional
        Rotation vector from one pose to the other, axes of the case, as the gyroscope has it.

    Returns
    -------
    Mounted
        Standard deviations are those of white noise.

    Raises
    ------
    CaptureRefusedError
        If a force is not that of gravity, the poses differ too little, or `turn` is not about a horizontal axis.
    """
    low, high = _up("level", level), _up("raised", raised)
    angle = _angle(low.axis, high.axis)
    refuse(_why_no_raise(low.axis, angle, turn))
    # [Shuster1981]: the second pose tells the lateral direction; errors across grow by 1 / sin of the angle.
    sd_heading = float(np.hypot(high.sd, np.cos(angle) * low.sd) / np.sin(angle))
    mount = Mount(
        _axes(low.axis, high.axis, frame),
        np.array([low.sd, low.sd, sd_heading]),
        f"level pose and nose raised by {to_deg(angle):.1f}°, body axes of {frame}",
    )
    return Mounted(mount, () if turn is not None else ("no gyroscope checked that the body was raised, not turned.",))


def mount_from_attitudes(q_ns: ArrayLike, q_nb: ArrayLike) -> Mounted:
    """Mounting from attitudes (N, 4) of unit and body at the same times, from the same north: a robust average.

    Standard deviations are those of the mean of ten parts of the recording; what is wrong from first to last, as the
    bias of an accelerometer, is not in them. CaptureRefusedError if there are few, or they differ by no constant
    rotation.
    """
    ours = check.rows("q_ns", q_ns, 4)
    theirs = check.rows("q_nb", q_nb, 4, len(ours))
    if len(ours) < 10 * _PARTS:
        text = f"{len(ours)} attitudes are known at the same time; {10 * _PARTS} or more are needed."
        raise CaptureRefusedError(Reason("too-few", text, "Give recordings that overlap for longer."))
    q_bs = quat_multiply(quat_conjugate(theirs), ours)
    mean, weights = _robust_mean(q_bs)
    off = float(np.median(quat_angle(q_bs, mean)))
    if off > SCATTER:
        text = f"the attitudes differ by no constant rotation: half of them are more than {to_deg(off):.0f}° off it."
        advice = "Check their frames, their north and their clocks, and that the unit is fixed to the body."
        raise CaptureRefusedError(Reason("implausible", text, advice))
    errors = rotvec_from_quat(quat_multiply(q_bs, quat_conjugate(mean)))
    parts = zip(np.array_split(errors, _PARTS), np.array_split(weights, _PARTS), strict=True)
    means = np.array([np.average(error, axis=0, weights=weight) for error, weight in parts])
    sd = means.std(axis=0, ddof=1) / np.sqrt(_PARTS)
    return Mounted(Mount(mean, sd, f"against a reference attitude, {len(ours)} samples"))


def _robust_mean(q: Floats) -> tuple[Floats, Floats]:
    """Average (4,) under Cauchy's weights (N,), whose scale is the median angle."""
    weights = np.ones(len(q))
    for _ in range(_ROUNDS):
        mean = quat_mean(q, weights)
        angle = quat_angle(q, mean)
        weights = 1.0 / (1.0 + (angle / max(float(np.median(angle)), 1e-9)) ** 2)
    return mean, weights


def _up(pose: str, force: ArrayLike) -> _Up:
    forces = check.rows(pose, force, 3)
    finite = forces[np.isfinite(forces).all(axis=1)]
    if len(finite) < 2:
        text = f"the {pose} pose has {len(finite)} samples of the specific force."
        raise CaptureRefusedError(Reason("too-few", text, "Let each pose rest for a second or more."))
    mean = finite.mean(axis=0)
    size = float(np.linalg.norm(mean))
    if abs(size / G0 - 1.0) > _GRAVITY:
        text = f"in the {pose} pose the specific force is {size:.3g} m/s², not {G0:.3g}."
        raise CaptureRefusedError(
            Reason("wrong-gravity", text, "Check its unit, or calibrate the accelerometer first.")
        )
    scatter = float(np.sqrt(finite.var(axis=0, ddof=1).mean()))
    return _Up(mean / size, scatter / np.sqrt(len(finite)) / size)


def _axes(up: Floats, ahead: Floats, frame: Frame) -> Floats:
    """Rotation q_bs (4,) of a body with the vertical `up` and the nose on the side of `ahead`, axes of the case."""
    x = ahead - (ahead @ up) * up
    x /= np.linalg.norm(x)
    z = frame.up[2] * up
    return quat_from_dcm(np.stack((x, np.cross(z, x), z)))  # [Shuster1981]: TRIAD, the first vector exact


def _why_no_raise(up: Floats, angle: float, turn: ArrayLike | None) -> list[Reason]:
    """Say why two poses are not that of a body and of the same with its nose raised."""
    if np.sin(angle) < np.sin(LEAST_RAISE):
        text = f"the poses differ by {to_deg(angle):.1f}°, which hardly shows where ahead is; 15° to 60° are needed."
        return [Reason("ill-conditioned", text, "Raise the nose further.")]
    if turn is None:
        return []
    vector = check.last_axis("turn", turn, 3)
    size = float(np.linalg.norm(vector))
    rise = float(np.arcsin(min(1.0, abs(float(vector @ up)) / size))) if size > 0.0 else 0.0
    if rise <= ASKEW:
        return []
    text = (
        f"from pose to pose the body turned {to_deg(size):.0f}° about an axis {to_deg(rise):.0f}° off the horizontal."
    )
    return [Reason("no-motion", text, "Raise the nose about the lateral axis, without turning or rolling the body.")]


def _angle(a: Floats, b: Floats) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
