"""Motions by hand between two poses at rest, in which a gyroscope can be held against gravity."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.units import deg

SMALLEST: Final = float(deg(15.0))
"""Smallest change of the direction of gravity that makes a motion, rad."""


@dataclass(frozen=True, eq=False, slots=True)
class Motion:
    """One motion between two poses.

    Attributes
    ----------
    rate : ndarray (N, 3)
        Measured rates from the last instant at rest to the next first one, rad/s.
    dt : ndarray (N−1,)
        Steps, s.
    before, after : ndarray (3,)
        Directions of the specific force at rest, unit vectors.
    """

    rate: Floats
    dt: Floats
    before: Floats
    after: Floats


def find_motions(
    t: Floats, gyr: Floats, acc: Floats, where: Sequence[slice], clipped: NDArray[np.bool_] | None = None
) -> tuple[list[Motion], dict[str, int]]:
    """Motions between stretches at rest that tilted the unit, and how many were left out, by reason."""
    found, spoilt = [], {"clipping": 0, "gap": 0}
    step = 1.5 * float(np.median(np.diff(t)))
    for first, second in pairwise(where):
        span = slice(first.stop - 1, second.start + 1)
        before, after = _direction(acc[first]), _direction(acc[second])
        if float(before @ after) > np.cos(SMALLEST):
            continue
        dt = np.diff(t[span])
        if clipped is not None and clipped[span].any():
            spoilt["clipping"] += 1
        elif dt.max() > step or not np.isfinite(gyr[span]).all():
            spoilt["gap"] += 1
        else:
            found.append(Motion(gyr[span], dt, before, after))
    return found, spoilt


def _direction(acc: Floats) -> Floats:
    mean = acc.mean(axis=0)
    return np.asarray(mean / np.linalg.norm(mean))
