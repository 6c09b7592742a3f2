"""From recordings to the mounting of a unit: the poses at rest, the turn between them, or two attitudes over time."""

from typing import Final

import numpy as np

from plumbob.calibration.calibration import Capture
from plumbob.calibration.fit import CaptureRefusedError, Reason
from plumbob.calibration.mount import Mounted, mount_from_attitudes, mount_from_level, mount_from_poses
from plumbob.core.check import Floats
from plumbob.core.errors import FrameError, ParameterError
from plumbob.core.units import deg, to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.evaluation.align import associate
from plumbob.quality.static_periods import stills
from plumbob.rotations import Frame, change_frame, quat_from_rotvec, quat_multiply, rotvec_from_quat
from plumbob.rotations.headings import heading_policy

SAME_POSE: Final = float(deg(5.0))
"""Largest angle between two stretches at rest that are one pose, rad."""

Span = tuple[float, float]


def mount_by_poses(
    capture: Capture, *, frame: Frame, level: Span | None = None, raised: Span | None = None, level_only: bool = False
) -> Mounted:
    """Mounting from the poses of a capture, on body axes with z down in NED, up in ENU and NWU.

    `level` and `raised`, s, are when the body was level and when its nose was raised; without them, the first stretch
    at rest and the one that leans farthest from it. `level_only` takes the heading of the mounting as zero.

    CaptureRefusedError if the unit was not at rest, or as in `plumbob.calibration.mount`; ParameterError if the spans
    do not belong together, or the recording has no accelerometer.
    """
    imu = capture.imu
    if imu.acc is None:
        raise ParameterError("the recording has no acc, and only that shows where up is; record it too.")
    if level_only and raised is not None:
        raise ParameterError("with the level pose only, there is no raised one; leave out one of the two.")
    if not level_only and (level is None) != (raised is None):
        raise ParameterError("level and raised belong together; give both spans, or neither to have the poses found.")
    rests = _rests(imu) if level is None else []
    first = _rest_in(imu, level, "level") if level is not None else rests[0]
    if level_only:
        done = mount_from_level(imu.acc[first], frame=frame)
    else:
        second = _rest_in(imu, raised, "raised") if raised is not None else _farthest(imu.acc, rests)
        done = mount_from_poses(imu.acc[first], imu.acc[second], frame=frame, turn=_turn(imu, first, second))
    if capture.base is None or capture.base.acc is None:
        text = "the accelerometer is not calibrated: each 10 mg of its bias are 0.6° of roll and pitch"
        done = Mounted(done.mount, (*done.remarks, f"{text}; calibrate it first, and give the card."))
    return done


def mount_by_reference(estimate: AttitudeTrack, reference: AttitudeTrack) -> Mounted:
    """Mounting from the attitude that was estimated in the axes of the unit, and that of the body.

    FrameError if their headings do not count from the same north; else as `plumbob.evaluation.align.associate` and
    `plumbob.calibration.mount.mount_from_attitudes`.
    """
    policy = heading_policy(estimate.north, reference.north, aligned=False, declination=None)
    if not policy.comparable:
        raise FrameError(f"a mounting is found from full attitudes, but {policy.reason}.")
    match = associate(estimate, reference)
    q_nb = change_frame(match.q_ref[match.scored], to=estimate.frame, from_=reference.frame)
    return mount_from_attitudes(estimate.q_nb[match.scored], q_nb)


def _rests(imu: ImuData) -> list[slice]:
    assert imu.acc is not None
    rests = stills(imu.t, imu.acc, imu.gyr)
    if not rests:
        text = f"in {float(imu.t[-1] - imu.t[0]):.3g} s the unit was never at rest for a second."
        raise CaptureRefusedError(Reason("not-still", text, "Let the body rest for some seconds in each pose."))
    return rests


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
    q = quat_from_rotvec(turned)
    while len(q) > 1:  # pairs of neighbours, then pairs of pairs
        even = len(q) // 2 * 2
        q = np.concatenate((quat_multiply(q[:even:2], q[1:even:2]), q[even:]))
    return rotvec_from_quat(q[0])
