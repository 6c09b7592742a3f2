"""A magnetometer that was turned in a real room, and its calibration by a reference attitude."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.mag.in_use import fit_in_use
from plumbob.calibration.predicted import TILT_RANGE, attitudes
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.time import to_ns
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards import UNITS, TriadCalibration
from plumbob.data.reading import read_at
from plumbob.rotations import dcm_from_quat, quat_conjugate, quat_multiply, quat_rotate, rotvec_from_quat

DELAYS: Final = np.arange(21) * 2e-3
"""Delays of the magnetometer against the reference that are tried, s."""

LEAST_SPREAD: Final = 0.1
"""Standard deviation of the field along the body axis in which it changes least, over the field, that determines it."""

_FEWEST: Final = 100
_LEAST_GAIN: Final = 1e-6  # of the measured field along any axis, by the field that turns; a dead axis has rounding's
_SOME: Final = 5000  # samples by which the delay is told
_ROUNDS: Final = 10


@dataclass(frozen=True, eq=False)
class Room:
    """Calibration in which the field, in the axes of a reference, turns as the unit does.

    A room has no one field: it may differ by a tenth from one end of a table to the other. Taken for one, it makes a
    truth that is wrong by up to 4° of heading, and what it leaves is three times as large as where it may walk.

    Attributes
    ----------
    matrix, bias : ndarray (3, 3), (3,)
        ``field = matrix @ (measured − bias)``, the matrix of determinant 1; µT.
    field : ndarray (3,)
        Mean of the field in the reference's axes, the third of which is upright, µT.
    unevenness : float
        Root mean square departure of a component from one vector, µT: of noise, of the reference, and of the room.
    delay : float
        Of the magnetometer against the reference, s.
    """

    matrix: Floats
    bias: Floats
    field: Floats
    unevenness: float
    delay: float

    @property
    def calibration(self) -> TriadCalibration:
        """As a calibration."""
        return TriadCalibration(matrix=self.matrix, bias=self.bias, unit_in=UNITS["mag"], unit_out=UNITS["mag"])

    def heading_off(self, calibration: TriadCalibration | None, tilt_range: float = TILT_RANGE) -> float:
        """Root mean square heading error, rad, of a calibration, None for none, over inclinations up to a limit."""
        return float(np.sqrt(np.mean(np.angle(self._off(calibration, tilt_range)) ** 2)))

    def apart(self, one: TriadCalibration, other: TriadCalibration, tilt_range: float = TILT_RANGE) -> float:
        """Root mean square heading difference, rad, of two calibrations over inclinations up to a limit."""
        difference = self._off(one, tilt_range) / self._off(other, tilt_range)
        return float(np.sqrt(np.mean(np.angle(difference) ** 2)))

    def _off(self, calibration: TriadCalibration | None, tilt_range: float) -> NDArray[np.complex128]:
        """Complex numbers (N,) whose angles are the heading errors, one per attitude."""
        matrix, bias = (np.eye(3), np.zeros(3)) if calibration is None else (calibration.matrix, calibration.bias)
        body_axes = attitudes(tilt_range)
        measured = body_axes @ self.field @ np.linalg.inv(self.matrix).T + self.bias
        seen = np.einsum("nij,ni->nj", body_axes, (measured - bias) @ matrix.T)
        return np.asarray((seen[:, 0] + 1j * seen[:, 1]) / (self.field[0] + 1j * self.field[1]), dtype=np.complex128)


def room_of(imu: ImuData, reference: AttitudeTrack) -> Room:
    """Calibrate the magnetometer of a recording by its reference attitude.

    Raises
    ------
    ShapeError
        If there is no magnetometer, it has too few samples with a reference, or it does not answer as the unit turns.
    """
    mag = imu.usable("mag")
    t_ns = to_ns(imu.t)
    present = np.flatnonzero(np.isfinite(mag).all(axis=1))
    some = present[:: max(1, len(present) // _SOME)]
    delay = min(DELAYS, key=lambda late: _fitted(mag[some], t_ns[some], reference, late).unevenness)
    room = _fitted(mag[present], t_ns[present], reference, float(delay))
    known, rates = rates_of(reference, imu.t)
    fit = fit_in_use(imu.t[known], mag[known], rates, gyr_gain_sd=0.0)
    if fit is None:  # of too few seconds
        return room
    matrix = np.asarray(np.linalg.inv(_of_determinant_one(fit.distortion)), dtype=np.float64)
    q_nb = read_at(reference, t_ns[present], offset=room.delay).q_nb
    return replace(room, matrix=matrix, bias=fit.bias, field=_mean_field(q_nb, (mag[present] - fit.bias) @ matrix.T))


def rates_of(reference: AttitudeTrack, t: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Samples, of those at times (N,), s, with a reference attitude, and its rates there, rad/s, in body axes."""
    q_nb = read_at(reference, to_ns(t)).q_nb
    known = np.flatnonzero(np.isfinite(q_nb).all(axis=1))
    q_nb = q_nb[known]
    turns = rotvec_from_quat(quat_multiply(quat_conjugate(q_nb[:-1]), q_nb[1:]))
    between = turns / np.diff(t[known])[:, np.newaxis]
    return known, np.concatenate((between[:1], 0.5 * (between[1:] + between[:-1]), between[-1:]))


def _mean_field(q_nb: Floats, field_b: Floats) -> Floats:
    """Mean of fields (N, 3) in body axes, in those of a reference (N, 4), where that is known."""
    known = np.isfinite(q_nb).all(axis=1)
    return np.asarray(quat_rotate(q_nb[known], field_b[known]).mean(axis=0))


def _fitted(mag: Floats, t_ns: NDArray[np.int64], reference: AttitudeTrack, delay: float) -> Room:
    """Alternate between the field, and matrix and bias, in which the measured field is linear."""
    q_nb = read_at(reference, t_ns, offset=delay).q_nb
    known = np.isfinite(q_nb).all(axis=1)
    if np.count_nonzero(known) < _FEWEST:
        raise ShapeError(f"{np.count_nonzero(known)} samples of the field have a reference; {_FEWEST} are needed")
    turns, mag = dcm_from_quat(q_nb[known]), mag[known]
    distortion, bias, field = np.eye(3), np.zeros(3), np.zeros(3)
    for _ in range(_ROUNDS):
        field = np.einsum("nij,nj->ni", turns, (mag - bias) @ np.linalg.inv(distortion).T).mean(axis=0)
        seen = np.einsum("nji,j->ni", turns, field)
        if np.linalg.eigvalsh(np.cov(seen.T))[0] < (LEAST_SPREAD * np.linalg.norm(field)) ** 2:
            raise ShapeError("the unit was not turned enough for its reference to calibrate the magnetometer")
        found = np.linalg.lstsq(np.column_stack((seen, np.ones(len(seen)))), mag, rcond=None)[0]
        distortion, bias = _of_determinant_one(found[:3].T), found[3]
    left = mag - seen @ distortion.T - bias
    matrix = np.asarray(np.linalg.inv(distortion), dtype=np.float64)
    return Room(matrix, bias, field, float(np.sqrt(np.mean(left**2))), delay)


def _of_determinant_one(gain: Floats) -> Floats:
    """Gain (3, 3) of a magnetometer, scaled to a determinant of one; one that is dead along an axis is refused."""
    sizes = np.linalg.svd(gain, compute_uv=False)
    if not sizes[2] > _LEAST_GAIN * max(1.0, sizes[0]):
        raise ShapeError(
            "the magnetometer must change along all its axes as the unit turns, but along one or more it always reads "
            "the same; look at the recording with 'plumbob info'"
        )
    return np.asarray(gain / np.cbrt(np.linalg.det(gain)), dtype=np.float64)
