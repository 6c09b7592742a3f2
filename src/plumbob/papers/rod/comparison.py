"""One run through bytes, compared as the paper compares, with an AHRS500GA, and as it could not, with the truth.

The reference sits beside the sensors with its y axis along their x axis, so its attitude is turned by that rotation
before anything is compared. What the paper calls the error is the difference of two devices: the estimate's own error
less the reference's own, and what the reference sits off its declared place is in it too.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack
from plumbob.door.calibrate import read_track
from plumbob.door.estimate import estimate
from plumbob.live.emulated import unit_file
from plumbob.live.rigs.plan import PLANS
from plumbob.papers.description import ROD
from plumbob.papers.rod.methods import SETTLE, tilt_errors
from plumbob.papers.workspace import Taken, Work
from plumbob.reporting.style import Both
from plumbob.rotations import (
    euler_zyx_from_quat,
    quat_conjugate,
    quat_from_dcm,
    quat_from_euler_zyx,
    quat_multiply,
    quat_rotate,
    rotvec_from_quat,
)

SESSION: Final = """
[imu]
device = "adis16355 #{seed}"
frame = "NED"

[reference]
north = "true"
unit = "ref"
"""
"""What the session of the rod says beside its format."""
RIG: Final[Mapping[str, Any]] = {"unit": "random", "warm_up": "15 K, 120 s", "mount_error": "0.2 deg"}
"""A unit as it left the line, warming up, beside a reference that sits 0.2° (1 sd) about each axis off its place."""
DOWN: Final = np.array([0.0, 0.0, 1.0])


class EstimateLine(NamedTuple):
    """An estimate: its name, the filter, and its parameters."""

    name: Both
    filter: str
    params: Mapping[str, Any]


LINES: Final[Mapping[str, EstimateLine]] = {
    "accel": EstimateLine(ROD.text("accelerometer_only"), "tilt_compass", {}),
    "gyro": EstimateLine(ROD.text("gyroscope_only"), "integrate", {}),
    "ekf7": EstimateLine(ROD.text("ekf7_faithful"), "ekf7", {}),
    "mekf": EstimateLine(ROD.text("mekf_causal"), "mekf", {}),
    "smoother": EstimateLine(ROD.text("smoother_best"), "smoother", {}),
}
"""What is estimated from the recording, as `plumbob run` does."""


@dataclass(frozen=True, eq=False)
class Compared:
    """The run.

    `taken`: its files; `t` (N,): times, s, from the first sample; `tracks` (N, 4): attitudes of `LINES`, body to
    NED; `truth`: true attitude, with the true bias; `ahrs`, `ahrs_true` (N, 4): attitude of the reference in its
    own axes, as its packets say it and as it is; `rest` (N,): where the detector of "ekf7" finds rest; `bias` (N,
    3): bias that "ekf7" estimates, rad/s.
    """

    taken: Taken
    t: Floats
    tracks: Mapping[str, Floats]
    truth: AttitudeTrack
    ahrs: Floats
    ahrs_true: Floats
    rest: NDArray[np.bool_]
    bias: Floats

    @property
    def reference(self) -> Floats:
        """Attitude of the body by the reference (N, 4), with the mounting that is declared."""
        return mapped(self.ahrs)

    @property
    def aligned(self) -> Floats:
        """The same with the mounting that gravity shows, found against the smoother."""
        return quat_multiply(self.reference, self.mounting)

    @property
    def mounting(self) -> Floats:
        """Rotation (4,) from the body's axes to those in which the reference says its attitude, found from gravity."""
        return mount_from_gravity(self.reference[self.scored], self.tracks["smoother"][self.scored])

    @property
    def true_mounting(self) -> Floats:
        """What `mounting` would be for sensors without an error (4,)."""
        return np.asarray(quat_multiply(quat_conjugate(mapped(self.ahrs_true[:1])), self.truth.q_nb[:1])[0])

    @property
    def scored(self) -> NDArray[np.bool_]:
        """Samples after the first second."""
        return np.asarray(self.t >= SETTLE)

    def errors(self, estimate: Floats, by: Floats) -> Floats:
        """Errors of roll and pitch (2, M), °, of the scored samples."""
        return tilt_errors(estimate[self.scored], by[self.scored])


def mapped(q_nr: Floats) -> Floats:
    """Attitude of the body (N, 4) from that of the reference in its own axes: q_nb = q_nr ⊗ q_rb."""
    return quat_multiply(q_nr, quat_conjugate(np.array(PLANS["rod"].units[1].q_bs)))


def permuted(q_nr: Floats) -> Floats:
    """What exchanging its angles makes of it: the body's roll is the reference's pitch, its pitch less the roll."""
    yaw, pitch, roll = euler_zyx_from_quat(q_nr).T
    return quat_from_euler_zyx(np.stack((yaw + 0.5 * np.pi, -roll, pitch), axis=-1))


def permutation_error(roll: Floats, pitch: Floats, by: Callable[[Floats], Floats] = permuted) -> Floats:
    """Errors of roll and pitch (2, N), °, of exchanged angles, or by another way, at true angles (N,), rad."""
    q_nb = quat_from_euler_zyx(np.stack((np.zeros_like(roll), pitch, roll), axis=-1))
    q_nr = quat_multiply(q_nb, np.array(PLANS["rod"].units[1].q_bs))
    return tilt_errors(by(q_nr), q_nb)


def mount_from_gravity(q_ref: Floats, q_est: Floats) -> Floats:
    """Rotation (4,) that the reference's attitudes (N, 4) lack to show gravity where the estimate does.

    It needs no heading: it is the least-squares rotation of one set of vertical directions onto the other.
    """
    ours, theirs = (quat_rotate(quat_conjugate(q), DOWN) for q in (q_est, q_ref))
    u, _, vt = np.linalg.svd(theirs.T @ ours)
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return np.asarray(quat_from_dcm(turn))


def mount_angles(q: Floats) -> Floats:
    """Angles of a small rotation about the three axes (3,), °."""
    return np.asarray(to_deg(rotvec_from_quat(q)))


def compared(work: Work, duration: float = 600.0) -> Compared:
    """Emulate the rig into bytes, record them by a session, and estimate from the recording."""
    taken = work.recorded("rod", "rod", session=SESSION.format(seed=work.seed), duration=duration, **RIG)
    tracks, estimation = {}, None
    for key, line in LINES.items():
        estimation = estimate(taken.recording, line.filter, params=line.params)
        tracks[key] = estimation.track
    assert estimation is not None
    assert estimation.reference is not None
    truth, ahrs_true = (read_track(path) for path in (taken.truth, unit_file(taken.truth, "ref")))
    soft = tracks["ekf7"]
    assert soft.flags is not None
    assert soft.bias_b is not None
    return Compared(
        taken,
        soft.t - soft.t[0],
        {key: track.q_nb for key, track in tracks.items()},
        truth,
        estimation.reference.q_nb,
        ahrs_true.q_nb,
        (soft.flags & flags.AT_REST) != 0,
        soft.bias_b,
    )


class Budget(NamedTuple):
    """Parts of a difference between an estimate and the reference: largest and rms of roll and pitch, °."""

    name: Both
    largest: Floats
    rms: Floats


def budget(run: Compared, key: str) -> list[Budget]:
    """What the paper's difference consists of, for one estimate."""
    truth, q_nb = run.truth.q_nb, run.tracks[key]
    parts = (
        (ROD.text("estimate_ahrs_as_the"), run.errors(q_nb, run.reference)),
        (ROD.text("estimate_ahrs_axes_aligned"), run.errors(q_nb, run.aligned)),
        (ROD.text("estimate_truth"), run.errors(q_nb, truth)),
        (ROD.text("ahrs_truth"), run.errors(run.reference, truth)),
        (ROD.text("it_the_ahrs_itself"), tilt_errors(run.ahrs[run.scored], run.ahrs_true[run.scored])),
        (ROD.text("it_how_it_is"), run.errors(mapped(run.ahrs_true), truth)),
    )
    return [Budget(name, np.abs(e).max(axis=1), np.sqrt((e**2).mean(axis=1))) for name, e in parts]
