"""What calibrations are benchmarked in: a field, units with known errors, attitudes, and what is read in them."""

from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, to_si
from plumbob.papers.buoy.modules import Attitudes, field_n, in_body, posed
from plumbob.rotations import dcm_from_quat, quat_from_euler_zyx, quat_from_rotvec, quat_multiply, quat_rotate
from plumbob.simulation import TriadErrors

AVERAGED: Final = to_si(0.2, "mgauss")
"""Scatter of a mean of many readings, whose steps are averaged too, µT."""

_RANGE: Final = deg(45.0)
_TESTED: Final = 400


def faced_by_the_field(dip: float) -> Attitudes:
    """Eighteen attitudes in which the field, not gravity, is along each face and edge, within some degrees."""
    turn = quat_from_rotvec(np.array([0.0, -0.5 * np.pi - dip, 0.0]))  # from up to the field

    def draw(rng: np.random.Generator) -> Floats:
        return quat_multiply(turn, posed("faces", edges="on", wobble=deg(5.0))(rng))

    return draw


def leaning(limit: float, count: int) -> Attitudes:
    """Attitudes of every heading with pitch and roll each within a limit, rad."""

    def draw(rng: np.random.Generator) -> Floats:
        tilts = rng.uniform(-limit, limit, (count, 2))
        return quat_from_euler_zyx(np.column_stack((rng.uniform(-np.pi, np.pi, count), tilts)))

    return draw


def random_axes(rng: np.random.Generator) -> Floats:
    """Rotation (3, 3), all alike likely."""
    q = rng.normal(size=4)
    return dcm_from_quat(q / np.linalg.norm(q))


def small_turn(angle: float, rng: np.random.Generator) -> Floats:
    """Rotation (3, 3) by an angle, rad, about an axis by chance."""
    axis = rng.normal(size=3)
    return dcm_from_quat(quat_from_rotvec(angle * axis / np.linalg.norm(axis)))


def heading_error(matrix: Floats, bias: Floats, errors: TriadErrors, dip: float) -> float:
    """Root mean square error of the heading with a true horizon, rad, over pitch and roll within ±45°.

    Parameters
    ----------
    matrix, bias : ndarray (3, 3), (3,)
        The calibration.
    errors : TriadErrors
        Of the unit; its noise is left out.
    dip : float
        Of the field, rad.
    """
    q_nb = leaning(_RANGE, _TESTED)(np.random.default_rng(0))
    measured = in_body(q_nb, field_n(dip)) @ errors.response.T + errors.iron + errors.bias
    north, east, _ = quat_rotate(q_nb, (measured - bias) @ matrix.T).T
    return float(np.sqrt(np.mean(np.arctan2(east, north) ** 2)))
