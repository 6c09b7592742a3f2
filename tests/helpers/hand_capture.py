"""A hand that holds a simulated unit: it turns it, or keeps it still, and gives the samples of that time."""

import numpy as np

from plumbob.core.constants import G0
from plumbob.data import ImuData
from plumbob.rotations import quat_conjugate, quat_from_rotvec, quat_multiply, quat_rotate

FIELD_N = np.array([25.0, 0.0, 43.3])  # NED, 50 µT at a dip of 60°
UP_N = np.array([0.0, 0.0, -G0])


class Hand:
    """A unit at an attitude, with errors of its magnetometer in µT; each sample is off by `trembling` rad rms."""

    def __init__(self, seed=0, *, hard_iron=(10.0, -8.0, 6.0), soft_iron=None, level=False, trembling=0.0, rate=50.0):
        self.rng = np.random.default_rng(seed)
        start = np.array([1.0, 0.0, 0.0, 0.0]) if level else self.rng.normal(size=4)
        self.q_nb, self.t = start / np.linalg.norm(start), 0.0
        self.hard_iron = np.array(hard_iron)
        self.soft_iron = np.eye(3) if soft_iron is None else np.array(soft_iron)
        self.trembling, self.rate = trembling, rate

    def hold(self, duration):
        return self._samples(np.zeros(3), duration)

    def turn(self, turn, speed=1.0):
        """Samples of a turn about an axis of the body."""
        axis = np.eye(3)[turn.axis] * np.sign(turn.angle)
        return self._samples(axis * speed, max(abs(turn.angle), 0.02) / speed)

    def _samples(self, rate_b, duration):
        count = max(1, round(duration * self.rate))
        t = self.t + np.arange(count) / self.rate
        way = np.outer((np.arange(count) + 1.0) / self.rate, rate_b) + self.trembling * self.rng.normal(size=(count, 3))
        q_nb = quat_multiply(self.q_nb, quat_from_rotvec(way))
        self.q_nb = quat_multiply(self.q_nb, quat_from_rotvec(count / self.rate * np.asarray(rate_b)))
        self.t += count / self.rate
        q_bn = quat_conjugate(q_nb)
        noise = self.rng.normal(size=(3, count, 3))
        return ImuData(
            t=t, gyr=rate_b + 0.002 * noise[0], acc=quat_rotate(q_bn, UP_N) * 1.01 + 0.1 + 0.02 * noise[1],
            mag=quat_rotate(q_bn, FIELD_N) @ self.soft_iron.T + self.hard_iron + 0.2 * noise[2],
        )  # fmt: skip


def joined(*parts):
    return ImuData(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in ("t", "gyr", "acc", "mag")}
    )
