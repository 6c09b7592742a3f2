"""Magnetometers that are known: the settings of the project's study of magnetometer calibrations."""

from typing import NamedTuple

import numpy as np

from plumbob import rotations as rot
from plumbob.core.constants import G0
from plumbob.core.units import dps

STRENGTH, DIP = 50.0, np.radians(60.0)
FIELD_N = STRENGTH * np.array([np.cos(DIP), 0.0, np.sin(DIP)])
"""Field in north, east, down, µT."""
LEAN, TILTS = np.radians(0.3), np.radians(45.0)
"""Scatter of an accelerometer's vertical, and the inclinations over which a heading is judged."""

TURNED = (
    "01_undisturbed_slow_rotation_A.mat", "03_undisturbed_slow_rotation_C.hdf5",
    "05_undisturbed_slow_rotation_with_breaks_B.hdf5", "07_undisturbed_fast_rotation_B.hdf5",
    "09_undisturbed_fast_rotation_with_breaks_B.hdf5", "21_undisturbed_fast_combined.mat",
)  # fmt: skip
"""The undisturbed trials of BROAD at hand in which a hand turned the unit in a room [Laidig2021]."""


class Unit(NamedTuple):
    """A magnetometer that measures ``distortion @ field + bias``, both in µT."""

    distortion: np.ndarray
    bias: np.ndarray

    @property
    def matrix(self):
        return np.linalg.inv(self.distortion)


def unit_of(rng, *, turned=True):
    """Hard iron of 10 µT, soft iron of 10 to 20 % on random axes; 1° of non-orthogonality and 2° of mounting."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    soft = axes @ np.diag(1.0 + rng.uniform(0.1, 0.2, 3) * rng.choice([-1.0, 1.0], 3)) @ axes.T
    if turned:
        skewed = np.eye(3) + np.radians(1.0) * np.triu(rng.choice([-1.0, 1.0], (3, 3)), 1)
        soft = rot.dcm_from_quat(rot.quat_from_rotvec(np.radians(2.0) * _direction(rng))) @ skewed @ soft
    return Unit(soft, 10.0 * _direction(rng))


def soft_iron(rng):
    """Symmetric response with relative errors of 10 to 20 % along random axes."""
    return unit_of(rng, turned=False).distortion


def attitudes(rng, count, tilt=None):
    """Attitudes q_nb (N, 4) at random, or of every heading with the inclination up to a limit, rad."""
    if tilt is None:
        q = rng.normal(size=(count, 4))
        return q / np.linalg.norm(q, axis=1, keepdims=True)
    nothing, heading, toward = np.zeros(count), *rng.uniform(0.0, 2.0 * np.pi, (2, count))
    lean = np.stack((np.cos(toward), np.sin(toward), nothing), axis=1) * rng.uniform(0.0, tilt, (count, 1))
    return rot.quat_multiply(
        rot.quat_from_rotvec(np.stack((nothing, nothing, heading), axis=1)), rot.quat_from_rotvec(lean)
    )


def in_body(q_nb, v_n=FIELD_N):
    return rot.quat_rotate(rot.quat_conjugate(q_nb), v_n)


def field(rng, unit, q_nb, *, sd=0.2, step=0.073):
    """What the unit measures, µT: 2 mG of noise and steps of 0.73 mG unless told otherwise."""
    measured = in_body(q_nb) @ unit.distortion.T + unit.bias + sd * rng.normal(size=(len(q_nb), 3))
    return step * np.rint(measured / step) if step else measured


def trajectory(rng, *, duration=60.0, rate=50.0, tilt=None):
    """Time, attitude q_nb and rate of turning with inclinations up to a limit, 15° where none is told."""
    fine = 10  # attitudes per sample, of which the rate at a sample is the mean over two
    t = np.arange(round(duration * rate) * fine + 1) / (rate * fine)
    frequency, phase = rng.uniform(0.05, 0.3, (2, 2, 1)), rng.uniform(0.0, 2.0 * np.pi, (2, 2, 1))
    waves = np.sin(2.0 * np.pi * frequency * t + phase)
    lean = (np.radians(15.0) if tilt is None else tilt) / np.sqrt(2.0) * (0.6 * waves[:, 0] + 0.4 * waves[:, 1])
    yaw = 2.0 * np.pi * t / 20.0 + 0.5 * np.sin(2.0 * np.pi * t / 13.0)
    q_nb = rot.quat_from_euler_zyx(np.stack((yaw, *lean), axis=1))
    within = rot.rotvec_from_quat(rot.quat_multiply(rot.quat_conjugate(q_nb[:-1]), q_nb[1:])) * rate * fine
    at = np.vstack((within[:1], 0.5 * (within[:-1] + within[1:]), within[-1:]))
    return t[::fine], q_nb[::fine], at[::fine]


def tumbling(rng, *, duration=120.0, rate=50.0):
    """Time, attitude and rate of a unit that is turned by hand about all its axes, at some 60°/s."""
    t = np.arange(round(duration * rate)) / rate
    waves = [np.sin(2.0 * np.pi * (f * t[:, None] + rng.uniform(size=3))) for f in (0.03, 0.07, 0.13)]
    turning = sum(rng.normal(size=3) * wave for wave in waves)
    q_nb = [np.array([1.0, 0.0, 0.0, 0.0])]
    for step in rot.quat_from_rotvec(turning[:-1] / rate):
        q_nb.append(rot.quat_multiply(q_nb[-1], step))
    return t, np.array(q_nb), turning


def rates(rng, true, *, rate=50.0, gain_sd=0.0):
    """What a gyroscope of 0.005 °/s/√Hz measures, rad/s, with a bias of 0.02 °/s and a gain matrix that is off."""
    gain = np.eye(3) + gain_sd * rng.normal(size=(3, 3))
    noise = dps(0.005) * np.sqrt(rate) * rng.normal(size=true.shape)
    return true @ np.linalg.inv(gain).T + noise + dps(0.02) * rng.normal(size=3)


def force(rng, q_nb, *, sd=LEAN):
    """Specific force at rest, m/s², the vertical of which is off by `sd`."""
    return G0 * (in_body(q_nb, np.array([0.0, 0.0, -1.0])) + sd * rng.normal(size=(len(q_nb), 3)))


def scene(seed, *, rate=50.0, gain_sd=0.0, off=None, **motion):
    """Unit, what it and its gyroscope measure, and its vertical; `off` (N, 3) is added to the field of the place."""
    rng = np.random.default_rng(seed)
    unit = unit_of(rng)
    t, q_nb, true = trajectory(rng, rate=rate, **motion)
    mag = field(rng, unit, q_nb)
    if off is not None:
        mag += in_body(q_nb, off(t)) @ unit.distortion.T
    return unit, (t, mag, rates(rng, true, rate=rate, gain_sd=gain_sd)), force(rng, q_nb)


def heading_rms(calibration, unit, *, tilt=TILTS):
    """Root mean square error, rad, of the heading with a true horizon over inclinations up to a limit."""
    q_nb = attitudes(np.random.default_rng(99), 2000, tilt)
    measured = field(np.random.default_rng(0), unit, q_nb, sd=0.0, step=0.0)
    north, east, _ = rot.quat_rotate(q_nb, (measured - calibration.bias) @ calibration.matrix.T).T
    return float(np.sqrt(np.mean(np.arctan2(east, north) ** 2)))


def in_sds(calibration, unit):
    """Errors of bias and matrix in their standard deviations."""
    off = np.concatenate((calibration.bias - unit.bias, (calibration.matrix - unit.matrix).ravel()))
    return off / np.sqrt(np.diag(calibration.covariance))


def assert_honest(calibrations, units, bar):
    """The median error of heading is below a bar, °; errors are as large as the covariance and the prediction say.

    Of the 12 parameters of a calibration 3 count as independent; a heading error's square is as of chi-square with 3.
    """
    errors = np.array([heading_rms(made, unit) for made, unit in zip(calibrations, units, strict=True)])
    assert np.degrees(np.median(errors)) <= bar
    share = np.mean([np.abs(in_sds(made, unit)) < 1.0 for made, unit in zip(calibrations, units, strict=True)])
    assert abs(share - 0.683) < 3.0 * np.sqrt(0.683 * 0.317 / (3 * len(errors)))
    ratios = errors / [made.quality.heading_sd for made in calibrations]
    assert abs(np.sqrt(np.mean(np.square(ratios))) - 1.0) < 3.0 / np.sqrt(2 * 3 * len(errors))


def _direction(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)
