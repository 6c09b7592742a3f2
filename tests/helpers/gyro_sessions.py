"""Captures of a gyroscope with known errors, in closed form: every motion is a turn about a fixed axis."""

from typing import NamedTuple

import numpy as np

from plumbob.core.constants import G0
from plumbob.core.units import dps
from plumbob.rotations import quat_conjugate, quat_from_rotvec, quat_multiply, quat_rotate

WHITE = float(dps(0.01))  # N, rad/s/√Hz


class Session(NamedTuple):
    t: np.ndarray
    acc: np.ndarray
    gyr: np.ndarray
    matrix: np.ndarray  # measured to calibrated
    bias: np.ndarray
    parts: dict  # of a Ferraris session


class Body:
    """A body that is turned and laid down again; rates and specific force are exact at every instant."""

    def __init__(self, rate):
        self.rate, self.q = rate, np.array([1.0, 0.0, 0.0, 0.0])
        self.rates, self.forces, self.count = [], [], 0

    def rest(self, seconds):
        n = round(seconds * self.rate)
        return self._add(np.zeros((n, 3)), np.tile(self.q, (n, 1)))

    def turn(self, axis, angle, seconds):
        n = round(seconds * self.rate)
        s, axis = np.arange(n) / n, np.asarray(axis) / np.linalg.norm(axis)
        speed = angle * (1.0 - np.cos(2.0 * np.pi * s)) * self.rate / n
        done = angle * (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))
        part = self._add(speed[:, None] * axis, quat_multiply(self.q, quat_from_rotvec(done[:, None] * axis)))
        self.q = quat_multiply(self.q, quat_from_rotvec(angle * axis))
        return part

    def _add(self, rate, q):
        self.rates.append(rate)
        self.forces.append(quat_rotate(quat_conjugate(q), np.array([0.0, 0.0, G0])))
        self.count += len(rate)
        return slice(self.count - len(rate), self.count)

    def measured(self, rng, white, acc_sd, parts=None, scale=0.02, misalignment=0.01):
        """Session of a gyroscope with drawn errors and an ideal accelerometer with noise; `white` is N, rad/s/√Hz."""
        rate, force = np.concatenate(self.rates), np.concatenate(self.forces)
        matrix = np.eye(3) + np.diag(rng.normal(0.0, scale, 3))
        matrix += misalignment * rng.standard_normal((3, 3)) * (1.0 - np.eye(3))
        bias = dps(rng.normal(0.0, 1.0, 3))
        gyr = rate @ np.linalg.inv(matrix).T + bias + white * np.sqrt(self.rate) * rng.standard_normal(rate.shape)
        acc = force + acc_sd * rng.standard_normal(rate.shape)
        return Session(np.arange(len(rate)) / self.rate, acc, gyr, matrix, bias, parts or {})


def hand(seed, *, motions=25, rate=50.0, white=WHITE, acc_sd=0.02, axis=None):
    """Rest, then motions about random axes (or one) with 2 s of rest after each."""
    rng = np.random.default_rng(seed)
    body = Body(rate)
    body.rest(20.0)
    for _ in range(motions):
        body.turn(rng.standard_normal(3) if axis is None else axis, rng.uniform(1.0, 3.0), rng.uniform(0.8, 2.0))
        body.rest(2.0)
    return body.measured(rng, white, acc_sd)


def ferraris(seed, *, rate=100.0, white=WHITE, acc_sd=0.02, turn=2.0 * np.pi):
    """Six faces and three turns, exactly about the axes, recorded in one go; the parts are those that were made."""
    rng = np.random.default_rng(seed)
    body = Body(rate)
    parts = {"z_p": body.rest(5.0), "z_rot": body.turn([0, 0, 1], turn, 6.0)}
    body.rest(2.0)
    body.turn([1, 0, 0], np.pi, 2.0)
    parts["z_a"] = body.rest(5.0)
    body.turn([1, 0, 0], -np.pi / 2, 2.0)
    parts |= {"y_p": body.rest(5.0), "y_rot": body.turn([0, 1, 0], turn, 6.0)}
    body.rest(2.0)
    body.turn([1, 0, 0], np.pi, 2.0)
    parts["y_a"] = body.rest(5.0)
    body.turn([0, 0, 1], np.pi / 2, 2.0)
    first = body.rest(5.0)
    parts["x_a"] = first
    body.turn([0, 0, 1], np.pi, 2.0)
    parts |= {"x_p": body.rest(5.0), "x_rot": body.turn([1, 0, 0], -turn, 6.0)}
    body.rest(2.0)
    return body.measured(rng, white, acc_sd, parts)
