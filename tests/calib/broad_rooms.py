"""A magnetometer that was turned by hand in a room, and its calibration by an optical reference [Laidig2021]."""

from typing import NamedTuple

import numpy as np

from plumbob.io import read
from plumbob.rotations import dcm_from_quat
from tests.calib.mag_scene import TILTS, attitudes

TURNED = (
    "01_undisturbed_slow_rotation_A.mat",
    "03_undisturbed_slow_rotation_C.hdf5",
    "05_undisturbed_slow_rotation_with_breaks_B.hdf5",
    "07_undisturbed_fast_rotation_B.hdf5",
    "09_undisturbed_fast_rotation_with_breaks_B.hdf5",
    "21_undisturbed_fast_combined.mat",
)
"""The undisturbed trials at hand in which the unit turned."""

_LATE = 4  # samples of 3.5 ms, by which the field fits the reference best


class Room(NamedTuple):
    """Calibration of determinant 1, in which the field, µT in east, north and up, is most nearly one vector."""

    matrix: np.ndarray
    bias: np.ndarray
    field: np.ndarray

    def heading_off(self, calibration):
        """Root mean square difference, rad, of the headings by another calibration, over inclinations up to 45°."""
        turns = dcm_from_quat(attitudes(np.random.default_rng(99), 2000, TILTS))
        measured = np.einsum("nji,j->ni", turns, self.field) @ np.linalg.inv(self.matrix).T + self.bias
        seen = np.einsum("nij,nj->ni", turns, (measured - calibration.bias) @ calibration.matrix.T)
        off = (seen[:, 0] + 1j * seen[:, 1]) / (self.field[0] + 1j * self.field[1])
        return float(np.sqrt(np.mean(np.angle(off) ** 2)))


def in_a_room(path):
    """Measurements of a trial, and its room by the reference attitude."""
    recording = read(path)
    turns, mag = dcm_from_quat(recording.track.q_nb)[:-_LATE], recording.imu.mag[_LATE:]
    known = np.isfinite(turns[:, 0, 0]) & np.isfinite(mag[:, 0])
    return recording.imu, _fitted(turns[known], mag[known])


def _fitted(turns, mag):
    """Alternate between the field, and matrix and bias, which are linear; the strength is free."""
    distortion, bias = np.eye(3), np.zeros(3)
    for _ in range(10):
        field = np.einsum("nij,nj->ni", turns, (mag - bias) @ np.linalg.inv(distortion).T).mean(axis=0)
        seen = np.einsum("nji,j->ni", turns, field)
        found = np.linalg.lstsq(np.column_stack((seen, np.ones(len(seen)))), mag, rcond=None)[0]
        distortion, bias = found[:3].T / np.cbrt(np.linalg.det(found[:3])), found[3]
    return Room(np.linalg.inv(distortion), bias, field)
