"""Time counted from frames alone, for a line whose read times mean nothing: a file, a pipe, one faster than time."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.clock.spec import Counter, TimeSpec
from plumbob.errors import ParameterError


class CountedTime:
    """Counts ticks of the frames' clock, else their counter and the rate, else one period for each frame.

    Valid where nothing can be lost, or where what is lost shows in a count: a step is taken for the shorter way round a
    turn, one that goes back for none, and how long the device was silent is not known. The result does not depend on
    how frames are handed over.

    Parameters
    ----------
    spec : TimeSpec
        What the frames bring to count.

    Raises
    ------
    ParameterError
        If that is neither a clock nor a rate.
    """

    def __init__(self, spec: TimeSpec) -> None:
        if spec.clock is None and spec.rate is None:
            raise ParameterError("without a clock in the frame, time can only be counted at a rate; give the rate.")
        self._spec = spec
        self._last: int | None = None
        self._total = 0

    def after_first(
        self, place: NDArray[np.int64], *, clock: ArrayLike | None = None, frames: ArrayLike | None = None
    ) -> NDArray[np.int64]:
        """Times (N,) of the next frames since the first of all, ns; parameters as of `TimeBase.stamp`."""
        spec = self._spec
        if spec.clock is not None and spec.clock.tick is not None:
            ticks = self._counted(_whole(clock), spec.clock)
            return np.asarray(ticks * spec.clock.tick.numerator // spec.clock.tick.denominator)
        passed = self._placed(place) if spec.frames is None else self._counted(_whole(frames), spec.frames)
        return np.asarray(np.rint(passed * (1e9 / float(spec.rate or 1.0))), dtype=np.int64)

    def _counted(self, counts: NDArray[np.int64], counter: Counter) -> NDArray[np.int64]:
        half, turn = counter.modulus // 2, counter.modulus
        steps = self._steps(counts) * (-1 if counter.down else 1)
        return self._sum(np.maximum((steps + half) % turn - half, 0))

    def _placed(self, place: NDArray[np.int64]) -> NDArray[np.int64]:
        """Frames that the bytes from one to the next have room for: a damaged one among them has its time."""
        steps, length = self._steps(place), self._spec.frame_bytes
        room = np.ones_like(steps) if length is None else np.maximum((2 * steps + length) // (2 * length), 1)
        return self._sum(np.where(steps > 0, room, 0))

    def _steps(self, counts: NDArray[np.int64]) -> NDArray[np.int64]:
        before = counts[:1] if self._last is None else np.array([self._last])
        self._last = int(counts[-1]) if counts.size else self._last
        return np.diff(counts, prepend=before)

    def _sum(self, steps: NDArray[np.int64]) -> NDArray[np.int64]:
        totals = self._total + np.cumsum(steps)
        self._total = int(totals[-1]) if totals.size else self._total
        return np.asarray(totals, dtype=np.int64)


def _whole(counts: ArrayLike | None) -> NDArray[np.int64]:
    """Counts as int64, of which a turn's lowest bits are what they were."""
    return np.asarray(counts).astype(np.int64)
