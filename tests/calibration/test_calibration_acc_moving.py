"""Accelerometer from slow tumbling: hand motion that is made here, with a known sensor."""

import math

import numpy as np
import pytest

from plumbob.calibration.acc import calibrate_accel, fit_accel_moving
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.gyr.drift import accumulate, rotation_vectors
from plumbob.calibration.predicted import attitudes
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg, dps
from plumbob.data import ImuData
from plumbob.rotations import quat_conjugate, quat_rotate

DT = 0.01


def waves(rng, count, size, low, high, number=6):
    """Sums of sinusoids (N, 3) and their first two derivatives, of root mean square `size` along each axis."""
    t = np.arange(count)[:, np.newaxis, np.newaxis] * DT
    omega = 2.0 * np.pi * rng.uniform(low, high, (1, 3, number))
    phase, height = rng.uniform(0.0, 2.0 * np.pi, (1, 3, number)), size * math.sqrt(2.0 / number)
    angle = omega * t + phase
    return tuple((height * omega**k * np.sin(angle + 0.5 * np.pi * k)).sum(axis=2) for k in range(3))


def tumbling(seed, *, lasting=120.0, speed=25.0, swing=0.03, arm=0.1, lean=0.01):
    """Time, measured specific force, rates, true matrix and bias of a unit in a hand.

    Turned with `speed` °/s along each axis about a point `arm` m away, carried by `swing` m at 0.1 to 0.6 Hz.
    """
    rng = np.random.default_rng(seed)
    count = round(lasting / DT)
    rate, turn, _ = waves(rng, count, dps(speed), 0.02, 0.1)
    q = np.empty((count, 4))
    accumulate(rotation_vectors(rate, np.full(count - 1, DT)), q)
    _, _, push = waves(rng, count, swing, 0.1, 0.6)
    away = arm * np.array([0.6, -0.64, 0.48])
    own = np.cross(rate, np.cross(rate, away)) + np.cross(turn, away)
    force = quat_rotate(quat_conjugate(q), push + [0.0, 0.0, G0]) + own
    matrix = np.eye(3) + lean * rng.standard_normal((3, 3))
    matrix = 0.5 * (matrix + matrix.T)
    bias = 0.3 * rng.standard_normal(3)
    acc = np.linalg.solve(matrix, force.T).T + bias + 0.02 * rng.standard_normal((count, 3))
    gyr = rate * (1.0 + 0.01 * rng.standard_normal(3)) + dps(1.0) * rng.standard_normal(3)
    return np.arange(count) * DT, acc, gyr + 0.002 * rng.standard_normal((count, 3)), matrix, bias


def tilt_off(calibration, matrix, bias):
    """Root mean square inclination error up to 45°, rad."""
    down = attitudes(deg(45.0))[:, :, 2]
    seen = (np.linalg.solve(matrix, G0 * down.T).T + bias - calibration.bias) @ calibration.matrix.T
    return math.sqrt(float(np.mean(np.sum(np.cross(seen, down) ** 2, axis=1)))) / G0


def ratios(seeds, **motion):
    found = []
    for seed in seeds:
        t, acc, gyr, matrix, bias = tumbling(seed, **motion)
        calibration = fit_accel_moving(t, acc, gyr).calibration
        found.append((tilt_off(calibration, matrix, bias), calibration.quality.tilt_sd))
    return np.array(found)


def test_it_is_far_better_than_none():
    """A bias of 0.3 m/s² (1 sd) along each axis inclines by √2 · 0.3/g, and two fit in the plane: 2.5° as a rule."""
    off, predicted = np.degrees(ratios(range(1))).T
    assert (off < 0.8).all() and (off < 2.5 * predicted).all()
    assert (predicted < 0.8).all()


@pytest.mark.long("many captures")
@pytest.mark.parametrize("motion", [{}, {"arm": 0.3}, {"speed": 16.0}, {"swing": 0.1}, {"lasting": 60.0}], ids=str)
def test_the_error_is_what_is_predicted(motion):
    """Root mean square over predicted: of twelve captures it scatters by 15 %, and the arm is off by a half at most."""
    found = ratios(range(12), **motion)
    ratio = math.sqrt(float(np.mean((found[:, 0] / found[:, 1]) ** 2)))
    assert 0.4 < ratio < 1.6


@pytest.mark.parametrize(("motion", "text"), [
    ({"speed": 400.0}, r"at [0-9]{3}°/s \(rms\) have fewer than 12 windows"),
    ({"speed": 100.0, "swing": 0.5, "lasting": 60.0}, None),
])  # fmt: skip
def test_what_is_never_slow_or_pushed_about_is_refused(motion, text):
    t, acc, gyr, _, _ = tumbling(1, **motion)
    with pytest.raises(CaptureRefusedError, match=text):
        fit_accel_moving(t, acc, gyr)


def test_gaps_and_recordings_that_never_rest():
    t, acc, gyr, matrix, bias = tumbling(2)
    late = t + 5.0 * (t > 40.0)
    found = fit_accel_moving(late, acc, gyr).calibration
    assert tilt_off(found, matrix, bias) < 3.0 * found.quality.tilt_sd
    t, acc, gyr, matrix, bias = tumbling(3)
    imu = ImuData(t=t, acc=acc, gyr=gyr)
    with pytest.raises(CaptureRefusedError, match="ask for that with --moving"):
        calibrate_accel(imu)
    with pytest.raises(ParameterError, match="needs a gyroscope beside the accelerometer"):
        calibrate_accel(ImuData(t=t, acc=acc), moving=True)
    fit = calibrate_accel(imu, moving=True)
    assert tilt_off(fit.calibration, matrix, bias) < 3.0 * fit.calibration.quality.tilt_sd
    assert "windows of slow tumbling" in fit.calibration.method
