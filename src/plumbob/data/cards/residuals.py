"""What a calibration leaves of a triad's errors: the parameters that an estimate should count, and does not estimate.

After calibration a vector u still is wrong by ``δ = d + E u``, with an offset d and a matrix E that nobody knows, but
whose covariance the card has; of a part without a card, the data sheet says how large they may be. Such an error does
not average out, so it is not noise: it is *considered* (`plumbob.filters.mekf`).

A covariance of (d, E row by row) is kept as its upper half, 78 numbers row by row, so that it is plain data. Of a
gyroscope whose axes may be read at different times it is that of (d, E, τ), 120 numbers: how late each axis is, s.
"""

from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import dps
from plumbob.rotations import dcm_from_quat

if TYPE_CHECKING:
    from plumbob.data.cards.calibration import Mount, TriadCalibration

Half = tuple[float, ...]  # Upper half of a covariance (12, 12), or (15, 15)
SIZE: Final = 78

_LIMITS: Final = {
    # InvenSense MPU-6000 data sheet: zero-g ±50, ±50 and ±80 mg, of which the root mean square, for no axis is known to
    # be its z; zero-rate ±20 °/s; scale ±3 %, cross-axis ±2 % of both
    "gyr": (dps(20.0), 0.03, 0.02),
    "acc": (0.062 * G0, 0.03, 0.02),
    # Honeywell HMC5983 on the buoy paper's board: hard iron ±8 µT, soft iron ±12 % with a scale of ±5 %, cross ±0.2 %
    "mag": (8.0, 0.13, 0.002),
}
"""By triad: largest offset, u, and largest relative errors on and off the diagonal of a common part without a card."""


@lru_cache
def uncalibrated(triad: str) -> Half:
    """Covariance for a triad without a card: errors uniform within the limits of a common part."""
    offset, scale, cross = _LIMITS[triad]
    matrix = np.full((3, 3), cross)
    np.fill_diagonal(matrix, scale)
    return upper_half(np.diag(np.square([offset, offset, offset, *matrix.ravel()])) / 3.0)


@lru_cache
def left_by(triad: str, model: "TriadCalibration | None", mount: "Mount | None") -> Half:
    """Covariance of what a triad of a card leaves, in body axes; a matrix that was not fitted counts as unknown."""
    if model is None:
        return uncalibrated(triad)
    change = np.zeros((12, 12))  # from errors of bias and matrix to (d, E): d = −M δb, E = δM M⁻¹
    change[:3, :3] = -model.matrix
    change[3:, 3:] = np.kron(np.eye(3), np.linalg.inv(model.matrix).T)
    covariance = np.zeros((12, 12)) if model.covariance is None else model.covariance
    residual = change @ covariance @ change.T
    if not model.matrix_found:
        residual[3:, 3:] += full_covariance(uncalibrated(triad))[3:, 3:]
    if mount is not None:
        dcm_bs = dcm_from_quat(mount.q_bs)
        turn = np.zeros((12, 12))
        turn[:3, :3], turn[3:, 3:] = dcm_bs, np.kron(dcm_bs, dcm_bs)
        residual = turn @ residual @ turn.T
    if model.delay_sd is not None:
        residual = np.pad(residual, (0, 3)) + np.diag(np.repeat((0.0, model.delay_sd**2), (12, 3)))
    return upper_half(residual)


NOTHING: Final[Half] = (0.0,) * SIZE
"""Covariance of a triad that is perfect, or of which nothing is known but that it has been calibrated."""


def upper_half(covariance: Floats) -> Half:
    """Upper half of a covariance."""
    return tuple(covariance[np.triu_indices(len(covariance))].tolist())


@lru_cache
def full_covariance(half: Half) -> Floats:
    """Covariance of its upper half."""
    size = int((2 * len(half)) ** 0.5)
    rows, columns = np.triu_indices(size)
    covariance = np.empty((size, size))
    covariance[rows, columns] = covariance[columns, rows] = half
    covariance.flags.writeable = False
    return covariance
