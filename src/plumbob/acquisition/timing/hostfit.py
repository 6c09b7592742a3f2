"""How a device's clock and the host's belong together, from points that are only ever late."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbob.acquisition.timing.delay import Ints, begin_line, line_at, observe
from plumbob.acquisition.timing.report import Delays, delays
from plumbob.acquisition.timing.spec import DRIFT, LINE_X, NOW, REALS, WORST
from plumbob.core._jit import njit
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ShapeError
from plumbob.core.time import BINS, bin_of


@dataclass(frozen=True, slots=True)
class HostReport:
    """Relation of two clocks.

    Attributes
    ----------
    points : int
        Points that were observed.
    offset_ns : int
        Host time less device time at the latest point, with the least delay in it, ns.
    drift_ppm : float
        Host seconds per device second, less one.
    delays : Delays
        How much later than the least delay points came.
    resets : int
        How often the device's clock went back, and the relation was begun again.
    """

    points: int
    offset_ns: int
    drift_ppm: float
    delays: Delays
    resets: int


class HostFit:
    """Follows ``host = offset + (1 + drift) · device`` beneath all points, through the last three minutes of them.

    For clocks that count whole nanoseconds. A device time that goes back begins a new relation, which keeps the
    drift; a delay of any length does no harm.
    """

    def __init__(self) -> None:
        self._real = np.zeros(REALS)
        self._histogram = np.zeros(BINS, dtype=np.int64)
        self._whole = np.zeros(4, dtype=np.int64)  # points, resets, origins of device and host

    def observe(self, device_ns: NDArray[np.int64], host_ns: NDArray[np.int64]) -> None:
        """Take points in order of their arrival.

        Parameters
        ----------
        device_ns, host_ns : int64 (N,)
            When it was by the device's clock, and when the host heard of it, ns.
        """
        device, host = np.asarray(device_ns), np.asarray(host_ns)
        if device.dtype != np.int64 or host.dtype != np.int64 or device.ndim != 1 or device.shape != host.shape:
            raise ShapeError(
                f"device_ns and host_ns must be int64 of one shape (N,), but they are {device.dtype} {device.shape} "
                f"and {host.dtype} {host.shape}."
            )
        observe_all(self._whole, self._real, self._histogram, device, host)

    def to_host(self, device_ns: int) -> int:
        """Host time at which news of that device time arrives at the earliest, ns."""
        self._need_points()
        x = float(device_ns - int(self._whole[2]))
        return int(self._whole[3]) + round(line_at(self._real, x))

    def to_device(self, host_ns: int) -> int:
        """Device time whose news arrives at that host time at the earliest, ns."""
        self._need_points()
        r = self._real
        late = float(host_ns - int(self._whole[3])) - line_at(r, float(r[LINE_X]))
        return int(self._whole[2]) + round(float(r[LINE_X]) + late / (1.0 + float(r[DRIFT])))

    def report(self) -> HostReport:
        """What the points so far have shown."""
        self._need_points()
        latest = int(self._whole[2]) + round(float(self._real[NOW]))
        return HostReport(
            points=int(self._whole[0]),
            offset_ns=self.to_host(latest) - latest,
            drift_ppm=1e6 * float(self._real[DRIFT]),
            delays=delays(self._histogram, float(self._real[WORST])),
            resets=int(self._whole[1]),
        )

    def _need_points(self) -> None:
        if not self._whole[0]:
            raise ClockError("two clocks need at least one common point; call observe first.")


@njit
def observe_all(n: Ints, r: Floats, histogram: Ints, device_ns: Ints, host_ns: Ints) -> None:
    """Take points into a relation: n holds their number, resets, and the origins of device and host."""
    for k in range(device_ns.size):
        if n[0] == 0:
            n[2], n[3] = device_ns[k], host_ns[k]
        x, y = float(device_ns[k] - n[2]), float(host_ns[k] - n[3])
        if n[0] == 0 or x < r[NOW]:
            n[1] += 1 if n[0] > 0 else 0
            begin_line(r, x, y)
        delay = observe(r, x, y)
        r[NOW] = x
        r[WORST] = max(r[WORST], delay)
        histogram[bin_of(delay)] += 1
        n[0] += 1
