"""Frames of a simulated device with a known clock, as a host receives them: late, in bunches, with some missing.

Device and host seconds differ by a known drift. Every arrival is later than the frame's making by a constant least
delay, by waiting for the next read, and by what the host's scheduler adds.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.live.timing.spec import Counter

LEAST_NS = 400_000  # constant part of every delay: transmission, driver
START_NS = 5_000_000_000_000  # a host that has been up for 83 minutes


class Frames(NamedTuple):
    """Frames as a decoder hands them on, and the truth about them."""

    t_ns: NDArray[np.int64]  # host time of the read
    place: NDArray[np.int64]
    index: NDArray[np.int64]  # which frame of the device it is
    made_ns: NDArray[np.float64]  # host time at which it was made, since the first


def frames(
    count: int, rate: float = 100.0, drift_ppm: float | NDArray[np.float64] = 0.0, bunch_ms: float = 0.0,
    mean_us: float = 100.0, stalls: float = 0.0, seed: int = 1, frame_bytes: int = 26,
) -> Frames:  # fmt: skip
    """`stalls` is how many stalls of 100 ms happen per second; reads of a bunched line come every `bunch_ms`."""
    rng = np.random.default_rng(seed)
    steps_ns = np.broadcast_to(1e9 / rate * (1.0 + 1e-6 * np.asarray(drift_ppm)), (count,))
    made = np.concatenate(([0.0], np.cumsum(steps_ns[1:])))
    ready = made + LEAST_NS
    if bunch_ms:
        # the host controller's clock is neither the device's nor the system's: 37 ppm off, and of any phase
        period = bunch_ms * 1e6 * (1.0 + 37e-6)
        read = np.ceil((ready - 0.37 * period) / period)
        ready = 0.37 * period + read * period
        late = rng.exponential(mean_us * 1e3, int(read[-1]) + 2)[read.astype(np.int64)]
    else:
        late = rng.exponential(mean_us * 1e3, count)
    arrival = ready + late
    if stalls:
        for start in np.cumsum(rng.exponential(1e9 / stalls, int(made[-1] / 1e9 * stalls * 2) + 10)):
            arrival = hold(arrival, start, 100e6)
    arrival = np.maximum.accumulate(arrival)
    return Frames(
        START_NS + np.rint(arrival).astype(np.int64), frame_bytes * np.arange(count, dtype=np.int64),
        np.arange(count, dtype=np.int64), made,
    )  # fmt: skip


def hold(arrival: NDArray[np.float64], start: float, length: float) -> NDArray[np.float64]:
    """What would have arrived during a stall arrives at its end."""
    return np.where((arrival >= start) & (arrival < start + length), start + length, arrival)


def without(frames: Frames, lost: slice | NDArray[np.bool_]) -> Frames:
    """Leave frames out, with their bytes."""
    kept = np.ones(frames.t_ns.size, dtype=bool)
    kept[lost] = False
    place = frames.place[: int(kept.sum())]
    return Frames(frames.t_ns[kept], place, frames.index[kept], frames.made_ns[kept])


def ticks(frames: Frames, counter: Counter, drift_ppm: float) -> NDArray[np.int64]:
    """What the device's own clock says when a frame is made."""
    own = frames.made_ns / (1.0 + 1e-6 * drift_ppm)
    total = np.floor(own / float(counter.tick) + 1e-6).astype(np.int64) + 12_345
    return (-total if counter.down else total) % counter.modulus
