"""Where a unit was at rest: the stretches of a capture whose means are poses.

Every block of a quarter of a second is judged: it must be as quiet as the quiet blocks of the capture, its mean
specific force must be that of its neighbours, and its mean rate that of the other quiet blocks. A pose is a run
of such blocks. The idea of static intervals found by the variance is that of [Tedaldi2014]; here no threshold has to be
searched.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats, runs
from plumbob.core.units import dps

BLOCK: Final = 0.25  # Length of a block, s
LOUDER: Final = 3.0  # Scatter of a block over that of the quiet ones above which the unit was touched
MOVED: Final = 0.05
"""Change of the mean specific force from block to block that noise does not make, m/s²: 0.3° of tilt."""
TURNED: Final = float(dps(1.0))  # mean rate over that of the quiet blocks above which the unit turned, rad/s
_LOUDEST = (0.5, float(dps(5.0)))  # scatter at rest of the worst MEMS parts, m/s² and rad/s
_QUIET = 0.1
FEWEST: Final = 4  # samples of a block


class BlockMoments(NamedTuple):
    """Means and standard deviations (count, 3) of a triad in each block."""

    mean: Floats
    sd: Floats

    @classmethod
    def measured(cls, values: Floats, count: int, size: int) -> "BlockMoments":
        """Those of `count` blocks of `size` samples, of values (N, 3)."""
        blocks = np.ascontiguousarray(values[: count * size].T).reshape(3, count, size)  # each axis in one piece
        return cls(blocks.mean(axis=2).T, blocks.std(axis=2, ddof=1).T)


def stills(t: Floats, acc: Floats, gyr: Floats | None = None, *, least: float = 1.0) -> list[slice]:
    """Stretches in which the unit was at rest, in order.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    acc : ndarray (N, 3)
        Specific force, m/s²; a row with NaN is not at rest.
    gyr : ndarray (N, 3), optional
        Rates, rad/s, bias included.
    least : float
        Shortest stretch, s.
    """
    size = max(FEWEST, round(BLOCK / float(np.median(np.diff(t))))) if t.size > FEWEST else t.size
    count = t.size // max(1, size)
    if count < 3:
        return []
    turning = None if gyr is None else BlockMoments.measured(gyr, count, size)
    quiet = at_rest(BlockMoments.measured(acc, count, size), turning, size)
    need = max(1, round(least / (size * float(np.median(np.diff(t))))))
    return [slice(a * size, b * size) for a, b in runs(quiet) if b - a >= need]


def at_rest(acc: BlockMoments, gyr: BlockMoments | None, size: float) -> NDArray[np.bool_]:
    """Blocks in which the unit was at rest, (count,).

    Parameters
    ----------
    acc : BlockMoments
        Of the specific force of each block in their order, m/s².
    gyr : BlockMoments, optional
        Of the rates, rad/s, bias included.
    size : float
        Samples in a block.
    """
    quiet, scatter = np.ones(len(acc.sd), dtype=np.bool_), acc.sd.max(axis=1)
    with np.errstate(invalid="ignore"):
        for moments, loudest in zip((acc, gyr), _LOUDEST, strict=True):
            if moments is not None:  # blocks that scatter no more than the quiet ones do
                noise = np.sqrt((moments.sd * moments.sd).sum(axis=1))  # [Tedaldi2014]: told by the variance
                finite = noise[np.isfinite(noise)]
                # departs from [Tedaldi2014]: no threshold is chosen by trials
                floor = float(np.quantile(finite, _QUIET)) if finite.size else 0.0
                quiet &= noise <= min(LOUDER * floor, loudest)
        limit = MOVED + 6.0 * np.minimum(scatter[1:], scatter[:-1]) / np.sqrt(size)
        same = np.abs(np.diff(acc.mean, axis=0)).max(axis=1) <= limit
    quiet &= np.append(same, True) & np.append(True, same)  # whose mean is that of both neighbours
    if gyr is not None and quiet.any():
        bias = np.median(gyr.mean[quiet], axis=0)  # the mean rate that most of the quiet blocks have
        with np.errstate(invalid="ignore"):
            quiet &= np.abs(gyr.mean - bias).max(axis=1) <= TURNED
    return quiet
