"""What happens on a rate table: how one face is spun, and how the six follow each other."""

from typing import Final

import numpy as np

from plumbob.check import Floats
from plumbob.sim.signals import Moves

_QUARTER = np.pi / 2.0
_FACES: Final = _QUARTER * np.array(
    [(0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]
)  # yaw, pitch, roll that bring the top, the bottom, the left, the right, the nose and the tail up


def spins(rates: Floats, hold: float, ramp: float) -> tuple[Floats, Floats]:
    """Instants (m,), s, and the rate at each of the spins of one face, from rest to rest.

    Parameters
    ----------
    rates : ndarray (k,)
        Rates that are held, rising, rad/s; then their opposites, falling.
    hold, ramp : float
        Time at each rate, at rest too, and between rates, s.
    """
    held = np.concatenate(([0.0], rates, -rates[::-1]))
    start = (hold + ramp) * np.arange(held.size)
    knots = np.append(np.stack((start, start + hold), axis=1).ravel(), start[-1] + hold + ramp)
    return knots, np.append(np.repeat(held, 2), 0.0)


def session(knots: Floats, rates: Floats, remount: float) -> tuple[Floats, Floats, Moves]:
    """Instants and rates of all six faces, and the moves of yaw, pitch and roll from face to face.

    Parameters
    ----------
    knots, rates : ndarray (m,)
        Of one face, as `spins` gives them.
    remount : float
        Time from face to face, s.
    """
    starts = (knots[-1] + remount) * np.arange(len(_FACES))
    moves = Moves(starts[1:] - remount, np.full(len(_FACES) - 1, remount), np.diff(_FACES, axis=0))
    return (starts[:, np.newaxis] + knots).ravel(), np.tile(rates, len(_FACES)), moves
