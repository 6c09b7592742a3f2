"""Sensitivity of a gyroscope to specific force, from its bias in poses at rest: it costs no table.

At rest the rate is the bias plus G times gravity, so poses of all directions tell G. Gravity is the only force there is
at rest, and the vertical part of the Earth's rotation goes with it: up to 0.0042 °/s per g on the diagonal.
"""

from typing import Final, NamedTuple

import numpy as np

from plumbob.check import Floats

FEWEST: Final = 12
"""Fewest poses: each axis has four parameters, and what they leave must tell noise."""

SIGNIFICANCE: Final = 0.01
"""Probability of finding a sensitivity where there is none."""

_NARROW: Final = 30.0  # condition number of constant and directions; poses of all kinds have 2 to 4


class Coupling(NamedTuple):
    """G (3, 3), rad/s per m/s², its standard deviations (3, 3), and the chance that noise made it."""

    matrix: Floats
    sd: Floats
    chance: float


def coupling_at_rest(rates: Floats, forces: Floats) -> Coupling | None:
    """G of the mean rates and forces of poses at rest; None where they cannot tell, or show none.

    Parameters
    ----------
    rates : ndarray (K, 3)
        Mean measured rate of each pose, rad/s.
    forces : ndarray (K, 3)
        Mean calibrated specific force of each pose, m/s².
    """
    from scipy.special import fdtrc

    if len(rates) < FEWEST:
        return None
    size = float(np.linalg.norm(forces, axis=1).mean())
    rows = np.column_stack((np.ones(len(forces)), forces / size))
    if np.linalg.cond(rows) > _NARROW:
        return None
    found, *_ = np.linalg.lstsq(rows, rates, rcond=None)
    freedom = len(rates) - 4
    left = np.sum((rates - rows @ found) ** 2)
    gained = np.sum((rates - rates.mean(axis=0)) ** 2) - left
    chance = float(fdtrc(9.0, 3.0 * freedom, gained / 9.0 / max(left / (3.0 * freedom), 1e-300)))
    if chance >= SIGNIFICANCE:
        return None
    noise = np.sum((rates - rows @ found) ** 2, axis=0) / freedom
    spread = np.sqrt(np.outer(noise, np.diag(np.linalg.inv(rows.T @ rows))[1:]))
    return Coupling(np.asarray(found[1:].T / size, dtype=np.float64), np.asarray(spread / size), chance)
