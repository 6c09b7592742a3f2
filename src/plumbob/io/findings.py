"""What a user must know about a recording before trusting it, found in the data at each reading and never stored."""

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np

from plumbob import clock, flags
from plumbob.check import Floats
from plumbob.data import ImuData

EARTH_FIELD: Final = (22.0, 67.0)
"""Smallest and largest flux density at the surface of the Earth, µT (IGRF-13, doi:10.1186/s40623-020-01288-x)."""

TOPICS: Final = ("calibration: ", "magnetic field: ", "clipped: ", "invalid: ", "gaps: ")
"""How the lines of `findings` begin."""

_CLIPPED = {"gyr": flags.GYR_CLIPPED, "acc": flags.ACC_CLIPPED, "mag": flags.MAG_CLIPPED}
_INVALID = {"gyr": flags.GYR_INVALID, "acc": flags.ACC_INVALID, "mag": flags.MAG_INVALID}


def findings(imu: ImuData) -> tuple[str, ...]:
    """Lines about calibration, size of the magnetic field, clipped and invalid samples, and gaps."""
    return (*_calibration(imu), *_field(imu), *_flagged(imu), *_gaps(imu))


def provenance(notes: Iterable[str]) -> tuple[str, ...]:
    """Notes without findings, which would go stale in a file, and without repetitions."""
    return tuple(dict.fromkeys(note for note in notes if not note.startswith(TOPICS)))


def _calibration(imu: ImuData) -> Iterator[str]:
    if imu.meta.calibration is None:
        yield "calibration: no card has been applied; the values are as the device gave them"


def _field(imu: ImuData) -> Iterator[str]:
    if imu.mag is None:
        return
    norm = _norms(imu.mag)
    low, high = EARTH_FIELD
    typical = float(np.median(norm)) if norm.size else float("inf")
    if not low <= typical <= high:
        yield (
            f"magnetic field: the median of |mag| is {typical:.4g} µT, but the Earth's field lies in {low:g} to "
            f"{high:g} µT; the magnetometer is disturbed, uncalibrated, or in another unit"
        )


def _norms(triad: Floats) -> Floats:
    # An absurd value gives an infinite norm, which the median leaves out; a signalling NaN is a NaN like any other.
    with np.errstate(over="ignore", invalid="ignore"):
        norm: Floats = np.sqrt(np.sum(triad * triad, axis=1))
    return norm[np.isfinite(norm)]


def _flagged(imu: ImuData) -> Iterator[str]:
    meanings = {"clipped": (_CLIPPED, "at the end of the range"), "invalid": (_INVALID, "infinite or impossible")}
    for topic, (bits, what) in meanings.items():
        for name in imu.triads:
            count = int(np.count_nonzero(imu.flags & np.uint32(bits[name])))
            if count:
                yield f"{topic}: {name} is {what} in {count} of {len(imu)} samples"


def _gaps(imu: ImuData) -> Iterator[str]:
    count = int(np.count_nonzero(imu.flags & np.uint32(flags.GAP)))
    if count:
        yield f"gaps: samples are missing before {count} of {len(imu)}; the longest step is {_longest(imu):.6g} s"


def _longest(imu: ImuData) -> float:
    return clock.timing(imu.t).longest
