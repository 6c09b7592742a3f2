"""What calibrations are benchmarked in: a field, units with known errors, attitudes, and what is read in them."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, to_si
from plumbob.rotations import (
    Frame,
    dcm_from_quat,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_from_rotvec,
    quat_multiply,
    quat_rotate,
)
from plumbob.simulation import TriadErrors, earth_field, scenario
from plumbob.simulation.errors import measure

Attitudes = Callable[[np.random.Generator], Floats]
"""Draws attitudes (N, 4)."""
STRENGTH: Final = to_si(500.0, "mgauss")
"""Of the field, µT."""
STEP: Final = to_si(0.73, "mgauss")
"""Of an HMC5983's scale at ±0.88 Ga, µT."""
NOISE: Final = to_si(2.0, "mgauss")
"""Scatter of one of its readings, µT."""
AVERAGED: Final = to_si(0.2, "mgauss")
"""Scatter of a mean of many readings, whose steps are averaged too, µT."""

_RANGE: Final = deg(45.0)
_TESTED: Final = 400


def field_n(dip: float) -> Floats:
    """Field in NED, (3,), µT."""
    return earth_field(Frame.NED, strength=STRENGTH, dip=dip, declination=0.0)


def in_body(q_nb: Floats, vector_n: Floats) -> Floats:
    """Vector of the navigation frame (3,) seen at attitudes (N, 4), (N, 3)."""
    return quat_rotate(quat_conjugate(q_nb), vector_n)


def force_b(q_nb: Floats) -> Floats:
    """Specific force at rest at attitudes (N, 4), (N, 3), m/s²."""
    return in_body(q_nb, G0 * Frame.NED.up)


def reading(errors: TriadErrors, truth_b: Floats, *, triad: str, rng: np.random.Generator) -> Floats:
    """What a triad with these errors reads of true vectors (N, 3)."""
    warm, no_force = np.full(len(truth_b), errors.temp_ref_c), np.zeros((len(truth_b), 3))
    seed = int(rng.integers(2**32))
    return measure(errors, truth_b, triad=triad, seed=seed, rate=1.0, temp_c=warm, force_b=no_force).values


def posed(name: str, **parameters: float | str) -> Attitudes:
    """Attitudes of a scenario of poses."""
    plan: Any = scenario(name, **parameters)
    attitudes: Attitudes = plan.attitudes
    return attitudes


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
