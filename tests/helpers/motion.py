"""Test motion that does not depend on the simulator: sums of sinusoids as rates, integrated finely for the truth."""

import functools

import numpy as np

from plumbob import Frame, ImuData
from plumbob import rotations as rot
from plumbob.core.constants import G0

FIELD_ENU = np.array([0.0, 20.0, -43.0])  # µT; dip 65°, as in central Europe


@functools.cache
def consistent(n=2000, rate=100.0, amplitude=1.0):
    """Noise-free samples of a turning body without acceleration, and its attitude q_nb in ENU."""
    rng = np.random.default_rng(0)
    t = np.arange(n) / rate
    fine = 16
    tf = np.arange(n * fine) / (rate * fine)
    f, phase = rng.uniform(0.05, 0.8, (2, 3)), rng.uniform(0.0, 6.28, (2, 3))

    def rates(s):
        phases = 2 * np.pi * f[:, np.newaxis, :] * s[:, np.newaxis] + phase[:, np.newaxis, :]
        return amplitude * np.sin(phases[0]) * np.cos(phases[1])

    turns = rates(tf + 0.5 / (rate * fine)) / (rate * fine)  # midpoint rule on a 16 times finer grid
    q = rot.quat_multiply(rot.quat_from_rotvec(rng.normal(size=3)), rot.quat_chained(turns)[:-1:fine])
    return ImuData(t=t, gyr=rates(t), **seen_by(q, Frame.ENU)), q


def swinging(rate, seconds=10.0):
    """Samples of a body whose yaw, pitch and roll are sines, with rates from the closed form, and its q_nb in ENU."""
    t = np.arange(round(seconds * rate)) / rate
    w, size = 2.0 * np.pi * np.array([0.13, 0.21, 0.34]), np.array([0.9, 0.5, 0.7])
    angles = size * np.sin(w * t[:, np.newaxis] + [0.0, 0.4, 0.8])
    yaw_rate, pitch_rate, roll_rate = (size * w * np.cos(w * t[:, np.newaxis] + [0.0, 0.4, 0.8])).T
    _, pitch, roll = angles.T
    gyr = np.column_stack(
        [
            roll_rate - yaw_rate * np.sin(pitch),
            pitch_rate * np.cos(roll) + yaw_rate * np.cos(pitch) * np.sin(roll),
            yaw_rate * np.cos(pitch) * np.cos(roll) - pitch_rate * np.sin(roll),
        ]
    )
    q = rot.quat_from_euler_zyx(angles)
    return ImuData(t=t, gyr=gyr, **seen_by(q, Frame.ENU)), q


def seen_by(q_nb, frame):
    """Specific force and field of a body that does not accelerate."""
    field_n = FIELD_ENU[0] * frame.east + FIELD_ENU[1] * frame.north + FIELD_ENU[2] * frame.up
    inverse = rot.quat_conjugate(q_nb)
    return {"acc": rot.quat_rotate(inverse, G0 * frame.up), "mag": rot.quat_rotate(inverse, field_n)}


def noisy(n=600, seed=1):
    """Samples without any physical sense: bits must agree on them all the same, absent ones included."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.005, 0.02, n))
    acc = rng.normal(size=(n, 3)) + [0.0, 0.0, 9.8]
    mag = rng.normal(size=(n, 3)) * 10.0 + [0.0, 20.0, -40.0]
    gyr = rng.normal(size=(n, 3))
    mag[rng.random(n) < 0.6] = np.nan
    acc[rng.random(n) < 0.1] = np.nan
    gyr[rng.random(n) < 0.05] = np.nan
    return ImuData(t=t, gyr=gyr, acc=acc, mag=mag)


def noisy_and_whole(n, rate):
    """Those of `noisy` that have all values, at an even rate, Hz."""
    data = noisy(n)
    whole = np.isfinite(np.hstack((data.gyr, data.acc, data.mag))).all(axis=1)
    t = np.arange(int(whole.sum())) / rate
    assert t.size > n // 5
    return ImuData(t=t, gyr=data.gyr[whole], acc=data.acc[whole], mag=data.mag[whole])


def up_in_body(q_nb, up=1.0):
    """The vertical in body axes, of a frame whose z axis points up or down: all that is tilt."""
    return rot.quat_rotate(rot.quat_conjugate(q_nb), [0.0, 0.0, up])


def tilt_between(q_nb, truth):
    """Angle between the verticals of two attitudes, rad."""
    cosine = np.sum(up_in_body(q_nb) * up_in_body(truth), axis=-1)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def heading_sd(q_nb, cov_b):
    """Standard deviation of the heading that covariances in body axes claim, rad, (N,)."""
    up_b = up_in_body(q_nb)
    return np.sqrt(np.einsum("ni,nij,nj->n", up_b, cov_b, up_b))
