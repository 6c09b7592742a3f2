"""The 18 directions of the buoy paper's capture: 6 faces and 12 edges of a cube, told by the measured vector [Yu2018].

What counts is the direction of what was measured, seen from the centre of the fit, not the attitude that somebody meant
to hold: turning about the vertical changes eighteen attitudes, and not one angle between field and axis of turning.
"""

from collections.abc import Iterable
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats

_X, _Y, _Z = np.eye(3)
_FACES = [sign * axis for axis in (_X, _Y, _Z) for sign in (1, -1)]
_EDGES = [a * one + b * other for one, other in ((_X, _Y), (_X, _Z), (_Y, _Z)) for a, b in product((1, -1), repeat=2)]
REGIONS: Final = np.array(_FACES + [edge / np.sqrt(2.0) for edge in _EDGES])
"""Directions of the faces and then of the edges, (18, 3), of length 1."""
REGIONS.flags.writeable = False

NAMES: Final = tuple(
    "".join(f"{'+' if c > 0 else '−'}{axis}" for axis, c in zip("xyz", row, strict=True) if abs(c) > 0.1)
    for row in REGIONS.tolist()
)
"""Name of each: "+x" is a face, "+x−z" an edge."""

_SOME: Final = 20_000


def region_of(vectors: Floats) -> NDArray[np.int64]:
    """Region that each vector (N, 3) points into, (N,): the nearest by angle."""
    return np.asarray(np.argmax(vectors @ REGIONS.T, axis=1))


def filled(vectors: Floats) -> NDArray[np.int64]:
    """How many of the vectors (N, 3) point into each region, (18,); of very many, evenly taken ones are counted."""
    return np.bincount(region_of(vectors[:: max(1, len(vectors) // _SOME)]), minlength=len(REGIONS))


def names_of(regions: Iterable[int]) -> str:
    """Names of some regions in a row."""
    return ", ".join(NAMES[i] for i in regions)
