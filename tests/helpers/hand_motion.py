"""A unit moved by hand, as arrays: turned and pushed at chosen times, at rest at others, and errors put on it."""

from typing import NamedTuple

import numpy as np

from plumbob import Frame, ImuData, ImuMeta
from plumbob import rotations as rot
from plumbob.core.constants import G0
from tests.helpers.motion import FIELD_ENU

CALIBRATED = ImuMeta(frame=Frame.ENU, calibration="by hand")
NOISE = {"gyr": 1e-3, "acc": 0.02, "mag": 0.3}
"""Standard deviations of each sample, rad/s, m/s², µT: those of usual parts at 100 Hz."""


class Hand(NamedTuple):
    """Arrays of a recording (ENU), its true attitude, and the attitude in the middle of each sample."""

    t: np.ndarray
    gyr: np.ndarray
    acc: np.ndarray
    mag: np.ndarray
    q: np.ndarray
    middle: np.ndarray

    def imu(self, **changed):
        """Recording, with some arrays changed."""
        triads = {name: getattr(self, name) for name in ("t", "gyr", "acc", "mag")} | changed
        return ImuData(**triads, meta=CALIBRATED)

    def in_body(self, vectors_n):
        """Vectors as the sensors see them."""
        return rot.quat_rotate(rot.quat_conjugate(self.middle), vectors_n)

    def rows(self, which):
        return Hand(*(values[which] for values in self))


def by_hand(seconds=40.0, rate=100.0, *, rest=(), turn=1.0, speed=0.15, seed=0, noise=NOISE, t=None):
    """A body that swings to ±0.9 rad and shifts by some centimetres, but for spells (from, to) of rest, s.

    Each sample is the mean over the step before it.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate if t is None else t
    fine = np.linspace(t[0], t[-1], 20 * t.size)
    moving = np.ones_like(fine)
    for begin, end in rest:  # half a second to come to rest
        moving *= 1.0 - np.clip(np.minimum(fine - begin, end - fine) / 0.5, 0.0, 1.0)
    own = np.interp(t, fine, np.concatenate(([0.0], np.cumsum(moving[1:] * np.diff(fine)))))
    f, phase = rng.uniform(0.1, 0.5, (2, 3)), rng.uniform(0.0, 2.0 * np.pi, (2, 3))
    angles = turn * 0.45 * np.sin(2.0 * np.pi * f * own[:, np.newaxis, np.newaxis] + phase).sum(axis=1)
    q = rot.quat_from_euler_zyx(angles + rng.uniform(-0.5, 0.5, 3))
    step = np.diff(t, prepend=2 * t[0] - t[1])[:, np.newaxis]
    gyr = np.zeros((t.size, 3))
    gyr[1:] = rot.rotvec_from_quat(rot.quat_multiply(rot.quat_conjugate(q[:-1]), q[1:])) / step[1:]
    gyr[0] = gyr[1]
    middle = np.concatenate((q[:1], rot.quat_slerp(q[:-1], q[1:], 0.5)))
    velocity = speed * np.sin(2.0 * np.pi * rng.uniform(0.3, 0.9, 3) * own[:, np.newaxis] + rng.uniform(0.0, 6.0, 3))
    velocity *= np.interp(t, fine, moving)[:, np.newaxis]
    force = np.diff(velocity, axis=0, prepend=velocity[:1]) / step + [0.0, 0.0, G0]
    back = rot.quat_conjugate(middle)
    seen = {"gyr": gyr, "acc": rot.quat_rotate(back, force), "mag": rot.quat_rotate(back, FIELD_ENU)}
    wiggle = 0.1 / np.sqrt(rate) if noise is None else np.sqrt(rate) * 0.1  # the same density at any rate
    seen = {k: v + (0.0 if noise is None else noise[k] * wiggle) * rng.normal(size=v.shape) for k, v in seen.items()}
    return Hand(t, **seen, q=q, middle=middle)


def error_n(q_nb, truth):
    """Error of an attitude, a rotation vector in navigation axes, rad, (N, 3)."""
    return rot.rotvec_from_quat(rot.quat_multiply(truth, rot.quat_conjugate(q_nb)))


def rms_deg(error):
    """Root mean square of tilt and of heading, degrees."""
    tilt = np.sqrt(np.mean((error[:, :2] ** 2).sum(axis=1)))
    return np.degrees([tilt, np.sqrt(np.mean(error[:, 2] ** 2))])
