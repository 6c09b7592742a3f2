"""How a unit sits on its body: from two poses at rest, from one, or from a reference of the body's attitude.

With the body level, the specific force is its vertical; with its nose raised about its lateral axis, the force leans
forward. Both, seen from the unit, give the body's axes: z by the first pose, x by what the second adds, which is the
method of two vectors (TRIAD) with the first one exact. Forces alone do not say that it was the lateral axis about which
the body was raised: a gyroscope shows whether that axis was horizontal, and nothing shows whether it was lateral.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from plumbob import rotations
from plumbob.calibration.calibration import Capture
from plumbob.calibration.fit import CaptureRefusedError, Mounted, Reason, refuse
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import FrameError, ParameterError
from plumbob.core.units import deg, to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards import Mount
from plumbob.evaluation.align import associate
from plumbob.quality.static_periods import stills
from plumbob.rotations.frames import heading_policy

# Smallest angle between the two poses, rad: 1 mg of force is then 0.3° of heading.
LEAST_RAISE: Final = float(deg(10.0))

ASKEW: Final = float(deg(10.0))  # largest elevation of the axis about which the body was raised, rad
SCATTER: Final = float(deg(10.0))  # median angle above which two attitudes do not differ by a constant rotation, rad
_GRAVITY = 0.05  # departure from standard gravity, relative, that no place on Earth and no usual bias has
_UNKNOWN = float(np.pi / np.sqrt(3.0))  # standard deviation of an angle of which nothing is known, rad
_PARTS = 10
_ROUNDS = 10  # of reweighting


def mount_from_level(level: ArrayLike, *, frame: rotations.Frame) -> Mounted:
    """Roll and pitch of the mounting from the specific force (N, 3) of the level body at rest.

    Its heading is assumed: the case's x axis points ahead. Standard deviations are those of white noise; that about the
    vertical is of an angle of which nothing is known.
    """
    up, sd = _up("level", level)
    ahead = np.array([1.0, 0.0, 0.0])
    if np.linalg.norm(np.cross(up, ahead)) < np.sin(LEAST_RAISE):
        text = f"the case's x axis is {to_deg(_angle(up, ahead)):.0f}° from the vertical, and so points not ahead."
        raise CaptureRefusedError(Reason("ill-conditioned", text, "Record a second pose with the nose raised."))
    mount = Mount(_axes(up, ahead, frame), np.array([sd, sd, _UNKNOWN]), f"level pose, body axes of {frame}")
    return Mounted(mount, ("the mounting's heading was not measured: the case's x axis is taken to point ahead.",))


def mount_from_poses(
    level: ArrayLike, raised: ArrayLike, *, frame: rotations.Frame, turn: ArrayLike | None = None
) -> Mounted:
    """Mounting from calibrated forces (N, 3) at rest of the level body and of it with a raised nose.

    1 mg of bias is 0.06° of roll and pitch. `turn` is the rotation vector (3,) from one pose to the other, axes of the
    case, as the gyroscope has it. Standard deviations are those of white noise.
    """
    (low, low_sd), (high, high_sd) = _up("level", level), _up("raised", raised)
    angle = _angle(low, high)
    refuse(_why_no_raise(low, angle, turn))
    # [Shuster1981]: the second pose tells the lateral direction; errors across grow by 1 / sin of the angle.
    sd_heading = float(np.hypot(high_sd, np.cos(angle) * low_sd) / np.sin(angle))
    mount = Mount(
        _axes(low, high, frame),
        np.array([low_sd, low_sd, sd_heading]),
        f"level pose and nose raised by {to_deg(angle):.1f}°, body axes of {frame}",
    )
    return Mounted(mount, () if turn is not None else ("no gyroscope checked that the body was raised, not turned.",))


def mount_from_attitudes(q_ns: ArrayLike, q_nb: ArrayLike) -> Mounted:
    """Mounting from attitudes (N, 4) of unit and body at the same times, from the same north: a robust average.

    Standard deviations are those of the mean of ten parts of the recording; what is wrong from first to last, as the
    bias of an accelerometer, is not in them.
    """
    ours = check.rows("q_ns", q_ns, 4)
    theirs = check.rows("q_nb", q_nb, 4, len(ours))
    if len(ours) < 10 * _PARTS:
        text = f"{len(ours)} attitudes are known at the same time; {10 * _PARTS} or more are needed."
        raise CaptureRefusedError(Reason("too-few", text, "Give recordings that overlap for longer."))
    q_bs = rotations.quat_multiply(rotations.quat_conjugate(theirs), ours)
    weights = np.ones(len(q_bs))
    for _ in range(_ROUNDS):  # under Cauchy's weights, whose scale is the median angle
        mean = rotations.quat_mean(q_bs, weights)
        angle = rotations.quat_angle(q_bs, mean)
        weights = 1.0 / (1.0 + (angle / max(float(np.median(angle)), 1e-9)) ** 2)
    off = float(np.median(rotations.quat_angle(q_bs, mean)))
    if off > SCATTER:
        text = f"the attitudes differ by no constant rotation: half of them are more than {to_deg(off):.0f}° off it."
        advice = "Check their frames, their north and their clocks, and that the unit is fixed to the body."
        raise CaptureRefusedError(Reason("implausible", text, advice))
    errors = rotations.rotvec_from_quat(rotations.quat_multiply(q_bs, rotations.quat_conjugate(mean)))
    parts = zip(np.array_split(errors, _PARTS), np.array_split(weights, _PARTS), strict=True)
    means = np.array([np.average(error, axis=0, weights=weight) for error, weight in parts])
    sd = means.std(axis=0, ddof=1) / np.sqrt(_PARTS)
    return Mounted(Mount(mean, sd, f"against a reference attitude, {len(ours)} samples"))


def _up(pose: str, force: ArrayLike) -> tuple[Floats, float]:
    """Vertical seen from the unit, a unit vector (3,), and its standard deviation, rad."""
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
    return mean / size, float(scatter / np.sqrt(len(finite)) / size)


def _axes(up: Floats, ahead: Floats, frame: rotations.Frame) -> Floats:
    """Rotation q_bs (4,) of a body with the vertical `up` and the nose on the side of `ahead`, axes of the case."""
    x = ahead - (ahead @ up) * up
    x /= np.linalg.norm(x)
    z = frame.up[2] * up
    return rotations.quat_from_dcm(np.stack((x, np.cross(z, x), z)))  # [Shuster1981]: TRIAD, the first vector exact


def _why_no_raise(up: Floats, angle: float, turn: ArrayLike | None) -> Reason | None:
    """Say why two poses are not that of a body and of the same with its nose raised."""
    if np.sin(angle) < np.sin(LEAST_RAISE):
        text = f"the poses differ by {to_deg(angle):.1f}°, which hardly shows where ahead is; 15° to 60° are needed."
        return Reason("ill-conditioned", text, "Raise the nose further.")
    if turn is None:
        return None
    vector = check.last_axis("turn", turn, 3)
    size = float(np.linalg.norm(vector))
    rise = float(np.arcsin(min(1.0, abs(float(vector @ up)) / size))) if size > 0.0 else 0.0
    text = (
        f"from pose to pose the body turned {to_deg(size):.0f}° about an axis {to_deg(rise):.0f}° off the horizontal."
    )
    advice = "Raise the nose about the lateral axis, without turning or rolling the body."
    return None if rise <= ASKEW else Reason("no-motion", text, advice)


def _angle(a: Floats, b: Floats) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


SAME_POSE: Final = float(deg(5.0))  # largest angle between two stretches at rest that are one pose, rad
Span = tuple[float, float]


def mount_by_poses(
    capture: Capture,
    *,
    frame: rotations.Frame,
    level: Span | None = None,
    raised: Span | None = None,
    level_only: bool = False,
) -> Mounted:
    """Mounting from the poses of a capture, on body axes with z down in NED, up in ENU and NWU.

    `level` and `raised`, s, are when the body was level and when its nose was raised; without them, the first stretch
    at rest and the one that leans farthest from it. `level_only` takes the heading of the mounting as zero.
    """
    imu = capture.imu
    if imu.acc is None:
        raise ParameterError("the recording has no acc, and only that shows where up is; record it too.")
    if level_only and raised is not None:
        raise ParameterError("with the level pose only, there is no raised one; leave out one of the two.")
    if not level_only and (level is None) != (raised is None):
        raise ParameterError("level and raised belong together; give both spans, or neither to have the poses found.")
    rests = stills(imu.t, imu.acc, imu.gyr) if level is None else []
    if level is None and not rests:
        text = f"in {float(imu.t[-1] - imu.t[0]):.3g} s the unit was never at rest for a second."
        raise CaptureRefusedError(Reason("not-still", text, "Let the body rest for some seconds in each pose."))
    first = _rest_in(imu, level, "level") if level is not None else rests[0]
    if level_only:
        done = mount_from_level(imu.acc[first], frame=frame)
    else:
        second = _rest_in(imu, raised, "raised") if raised is not None else _farthest(imu.acc, rests)
        done = mount_from_poses(imu.acc[first], imu.acc[second], frame=frame, turn=_turn(imu, first, second))
    if not capture.calibrated("acc"):
        text = "the accelerometer is not calibrated: each 10 mg of its bias are 0.6° of roll and pitch"
        done = Mounted(done.mount, (*done.remarks, f"{text}; calibrate it first, and give the card."))
    return done


def mount_by_reference(estimate: AttitudeTrack, reference: AttitudeTrack) -> Mounted:
    """Mounting from the attitude that was estimated in the axes of the unit, and that of the body."""
    policy = heading_policy(estimate.north, reference.north, aligned=False, declination=None)
    if not policy.comparable:
        raise FrameError(f"a mounting is found from full attitudes, but {policy.reason}.")
    match = associate(estimate, reference)
    q_nb = rotations.change_frame(match.q_ref[match.scored], to=estimate.frame, from_=reference.frame)
    return mount_from_attitudes(estimate.q_nb[match.scored], q_nb)


def _rest_in(imu: ImuData, span: Span, pose: str) -> slice:
    """Longest stretch at rest in a span."""
    first, stop = imu.t.searchsorted(span).tolist()
    part = imu[first:stop] if stop - first > 1 else None
    rests = [] if part is None or part.acc is None else stills(part.t, part.acc, part.gyr)
    if not rests:
        text = f"from {span[0]:g} to {span[1]:g} s, where it should be {pose}, the body was not at rest for a second."
        raise CaptureRefusedError(Reason("not-still", text, f"Name a span in which it is {pose} and at rest."))
    longest = max(rests, key=lambda rest: rest.stop - rest.start)
    return slice(first + longest.start, first + longest.stop)


def _farthest(acc: Floats, rests: list[slice]) -> slice:
    """Stretch that leans farthest from the first; the others must be one of the two poses."""
    if len(rests) == 1:
        text = "the unit was at rest only once."
        advice = "Raise the nose and let it rest again; for roll and pitch alone, ask for the level pose only."
        raise CaptureRefusedError(Reason("no-motion", text, advice))
    up = np.array([acc[rest].mean(axis=0) for rest in rests])
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    lean = np.arccos(np.clip(up @ up[0], -1.0, 1.0))
    last = int(np.argmax(lean))
    other = np.minimum(lean, np.arccos(np.clip(up @ up[last], -1.0, 1.0))) > SAME_POSE
    if other.any():
        angles = ", ".join(f"{to_deg(angle):.0f}°" for angle in lean[1:])
        text = f"after the first, stretches at rest lean by {angles}, which is more than two poses."
        raise CaptureRefusedError(Reason("no-motion", text, "Say which pose is level and which is raised."))
    return rests[last]


def _turn(imu: ImuData, pose: slice, other: slice) -> Floats | None:
    """Rotation vector (3,) between two stretches at rest, axes of the case; None where that is not known."""
    first, last = sorted((pose, other), key=lambda part: part.start)
    if imu.gyr is None or last.start < first.stop:
        return None
    between = slice(first.stop - 1, last.start + 1)
    turned = (imu.gyr[between] - imu.gyr[first].mean(axis=0))[1:] * np.diff(imu.t[between])[:, np.newaxis]
    if not np.isfinite(turned).all():
        return None
    return rotations.rotvec_from_quat(rotations.quat_chained(turned)[-1])
