"""What the uncertainty of a calibration does to an attitude: standard deviations of inclination and heading.

An error of the parameters changes the calibrated vector u by ``δu = −M δb + δM M⁻¹ u``; its level part moves the
horizon by that over gravity, and the heading by that across the field over the field's level part. Both are averaged
(root mean square) over attitudes of every heading with the inclination spread evenly up to a limit.

The 18 directions of the buoy paper's capture: 6 faces and 12 edges of a cube, by the measured vector [Yu2018].

What counts is the direction of what was measured, seen from the centre of the fit, not the attitude that somebody meant
to hold: turning about the vertical changes eighteen attitudes, and not one angle between field and axis of turning.
"""

import math
from collections.abc import Iterable
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.units import deg
from plumbob.rotations import dcm_from_quat, quat_from_rotvec, quat_multiply

_X, _Y, _Z = np.eye(3)
_FACES = [sign * axis for axis in (_X, _Y, _Z) for sign in (1, -1)]
_EDGES = [a * u + b * v for u, v in ((_X, _Y), (_X, _Z), (_Y, _Z)) for a, b in product((1, -1), repeat=2)]
REGIONS: Final = np.array(_FACES + [edge / np.sqrt(2.0) for edge in _EDGES])  # (18, 3), of length 1: faces, then edges
REGIONS.flags.writeable = False

NAMES: Final = tuple(
    "".join(f"{'+' if c > 0 else '−'}{axis}" for axis, c in zip("xyz", row, strict=True) if abs(c) > 0.1)
    for row in REGIONS.tolist()
)
"""Name of each: "+x" is a face, "+x−z" an edge."""

_SOME: Final = 20_000


def region_index(vectors: Floats) -> NDArray[np.int64]:
    """Region that each vector (N, 3) points into, (N,): the nearest by angle."""
    return np.asarray(np.argmax(vectors @ REGIONS.T, axis=1))


def filled(vectors: Floats) -> NDArray[np.int64]:
    """How many of the vectors (N, 3) point into each region, (18,); of very many, evenly taken ones are counted."""
    return np.bincount(region_index(vectors[:: max(1, len(vectors) // _SOME)]), minlength=len(REGIONS))


def region_names(regions: Iterable[int]) -> str:
    """Names of some regions in a row."""
    return ", ".join(NAMES[i] for i in regions)


TILT_RANGE: Final = deg(45.0)  # inclination up to which errors are told, unless one is asked for, rad
Model = tuple[Floats, Floats]  # matrix (3, 3) and bias (3,) of a calibration
_TILTS: Final = 8
_COURSES: Final = 12


def tilt_sd(matrix: Floats, covariance: Floats, *, size: float, tilt_range: float = TILT_RANGE) -> float:
    """Standard deviation of the inclination that an accelerometer gives, rad: that of the error's length.

    By the covariance (12, 12) of bias and matrix, gravity being `size`, up to the `tilt_range`, rad.
    """
    down_b = attitudes(tilt_range)[:, :, 2]
    errors = _errors(matrix, size * down_b)
    level = errors - down_b[:, :, np.newaxis] * np.einsum("ni,nij->nj", down_b, errors)[:, np.newaxis]
    variance = np.einsum("nij,jk,nik->n", level, covariance, level)
    return float(np.sqrt(np.mean(variance))) / size


def heading_sd(matrix: Floats, covariance: Floats, *, size: float, dip: float, tilt_range: float = TILT_RANGE) -> float:
    """Standard deviation of the heading that a magnetometer gives with a true horizon, rad; arguments as in `tilt_sd`.

    `size` is the field's strength in the unit of the calibrated vector, `dip` its angle below the horizon, rad.
    """
    axes = attitudes(tilt_range)
    north_b, east_b, down_b = np.moveaxis(axes, 2, 0)
    field_b = size * (math.cos(dip) * north_b + math.sin(dip) * down_b)
    across = np.einsum("ni,nij->nj", east_b, _errors(matrix, field_b))
    variance = float(np.mean(np.einsum("nj,jk,nk->n", across, covariance, across)))
    if not variance >= 0.0:  # by rounding, where the fit does not determine the covariance
        return math.inf
    return math.sqrt(variance) / (size * math.cos(dip))


def heading_apart(
    one: Model, other: Model, truth: Model, *, size: float, dip: float, tilt_range: float = TILT_RANGE
) -> float:
    """Root mean square difference, rad, of the headings that two calibrations give with a true horizon.

    Each, and the true one of the magnetometer that is looked at, is (matrix, bias); the rest as in `heading_sd`.
    """
    axes = attitudes(tilt_range)
    field_b = size * (math.cos(dip) * axes[:, :, 0] + math.sin(dip) * axes[:, :, 2])
    measured = np.linalg.solve(truth[0], field_b.T).T + truth[1]
    fields = (np.einsum("nij,ni->nj", axes, (measured - bias) @ matrix.T) for matrix, bias in (one, other))
    first, second = (level[:, 0] + 1j * level[:, 1] for level in fields)
    return float(np.sqrt(np.mean(np.angle(first * np.conj(second)) ** 2)))


def attitudes(tilt_range: float) -> Floats:
    """Attitudes as matrices (N, 3, 3) whose columns are north, east and down in body axes."""
    tilt = np.linspace(0.0, tilt_range, _TILTS)
    course = 2.0 * np.pi * np.arange(_COURSES) / _COURSES
    heading, toward, angle = (grid.ravel() for grid in np.meshgrid(course, course + 0.1, tilt, indexing="ij"))
    nothing = np.zeros_like(heading)
    turned = quat_from_rotvec(np.stack((nothing, nothing, heading), axis=-1))
    tilted = quat_from_rotvec(angle[:, np.newaxis] * np.stack((np.cos(toward), np.sin(toward), nothing), axis=-1))
    return dcm_from_quat(quat_multiply(tilted, turned))


def _errors(matrix: Floats, vectors: Floats) -> Floats:
    """Derivatives (N, 3, 12) of calibrated vectors (N, 3) by bias and matrix, row by row."""
    measured = np.linalg.solve(matrix, vectors.T).T
    rows = np.zeros((len(vectors), 3, 12))
    rows[:, :, :3] = -matrix
    for i in range(3):
        rows[:, i, 3 + 3 * i : 6 + 3 * i] = measured
    return rows
