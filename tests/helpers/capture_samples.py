"""Simulated captures as arrays: attitudes, and what a magnetometer and an accelerometer say in them."""

import numpy as np
import pytest

from plumbob.rotations import quat_conjugate, quat_from_rotvec, quat_multiply, quat_normalize, quat_rotate
from tests.helpers import jit_disabled

STRENGTH, DIP = 50.0, np.radians(60.0)
FIELD_N = STRENGTH * np.array([np.cos(DIP), 0.0, np.sin(DIP)])  # NED
FORCE_N = np.array([0.0, 0.0, -9.80665])
slow_without_jit = pytest.mark.skipif(jit_disabled(), reason="many captures take minutes as plain Python")


def turned(axis, angle):
    """Quaternions (N, 4) of angles (N,) about a fixed axis (3,)."""
    return quat_from_rotvec(np.outer(angle, axis))


def any_attitudes(rng, count):
    """Attitudes, evenly distributed over all rotations."""
    return quat_normalize(rng.normal(size=(count, 4)))


def tilted(rng, count, limit):
    """Attitudes of any heading, tilted by up to `limit` rad."""
    angle, course = limit * np.sqrt(rng.random(count)), 2.0 * np.pi * rng.random(count)
    tilt = quat_from_rotvec(np.stack((angle * np.cos(course), angle * np.sin(course), 0.0 * angle), axis=-1))
    return quat_multiply(turned([0, 0, 1.0], 2.0 * np.pi * rng.random(count)), tilt)


def shaken(rng, q_nb, sd):
    """Attitudes with a jitter of `sd` rad about each axis."""
    return quat_multiply(q_nb, quat_from_rotvec(sd * rng.normal(size=(len(q_nb), 3))))


def ring(count):
    """Headings all around."""
    return turned([0, 0, 1.0], 2.0 * np.pi * np.arange(count) / count)


def in_body(q_nb, v_n):
    return quat_rotate(quat_conjugate(q_nb), v_n)


def measured(rng, v_b, response, bias, noise, lsb=0.0):
    """What a triad says of true vectors (N, 3)."""
    values = v_b @ np.asarray(response).T + bias + noise * rng.normal(size=v_b.shape)
    return lsb * np.rint(values / lsb) if lsb else values


def soft_iron(rng, low=0.1, high=0.2):
    """Symmetric response with relative errors of `low` to `high` along random axes."""
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return axes @ np.diag(1.0 + rng.uniform(low, high, 3) * rng.choice([-1.0, 1.0], 3)) @ axes.T


def heading_errors(calibration, q_nb, response, bias):
    """Errors of the heading, rad, with a true horizon and without noise."""
    field_b = in_body(q_nb, FIELD_N) @ np.asarray(response).T + bias
    found_n = quat_rotate(q_nb, (field_b - calibration.bias) @ calibration.matrix.T)
    return np.arctan2(found_n[:, 1], found_n[:, 0])
