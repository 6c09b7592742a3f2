"""What makes a recording look as if its times, rates or signs were declared wrongly: questions to whoever made it."""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from plumbob.check import Floats
from plumbob.data import ENOUGH, ImuData
from plumbob.rotations import Frame
from plumbob.turning import turning
from plumbob.units import deg, to_deg

LONGEST_STEP: Final = 0.5
"""A gyroscope whose usual step is longer tells no attitude, s; the slowest in use give some 10 samples a second."""
SHORTEST_STEP: Final = 1e-5
"""No MEMS part gives samples at shorter steps, s: the fastest give 32 kHz (ICM-42688-P, DS-000347)."""
USUAL_RATE: Final = 10.0
"""A body that turns faster half of the time is rare, rad/s: 573 °/s. Walking, hands and vehicles stay far below."""
QUIET: Final = 0.2
"""Specific forces count that are as long as usual within this fraction: mostly gravity."""
PAUSE: Final = 1.5
"""Steps longer than so many mean ones are pauses between bursts."""
BURST: Final = 0.5
"""Where the usual step is so much shorter than the mean one, rows come in bursts."""
FEW_PAUSES: Final = 0.005
STEADY: Final = 0.03
"""Typical departure of the rows in a time of twenty bursts from their usual number."""
FEWEST_WINDOWS: Final = 5
THROUGHOUT: Final = 0.99
STEEP: Final = math.cos(float(deg(135.0)))


def doubts(imu: ImuData) -> tuple[str, ...]:
    """Lines about times and rates that are hardly in their units, and gyroscopes that turn against the accelerometer.

    Parameters
    ----------
    imu : ImuData
        The recording; too few samples or no gyroscope leave no doubt.
    """
    if imu.gyr is None or len(imu) < ENOUGH:
        return ()
    return tuple(_steps(imu)) or _turning(imu) or _rates(imu)


def upside_down(imu: ImuData, frame: Frame) -> tuple[str, ...]:
    """A line where a unit is upside down throughout, as one is whose signs or axes are declared wrongly.

    Parameters
    ----------
    imu : ImuData
        The recording.
    frame : Frame
        Navigation frame of its attitudes, with whose axes those of the body agree at zero angles.
    """
    if imu.acc is None or len(imu) < ENOUGH:
        return ()
    acc = imu.usable("acc")
    norm = np.sqrt(np.sum(acc * acc, axis=1))
    if not np.isfinite(norm).any():
        return ()
    usual = float(np.median(norm[np.isfinite(norm)]))
    counts = np.abs(norm - usual) < QUIET * usual
    upward = acc[counts, 2] * frame.up[2] / norm[counts]
    if upward.size < ENOUGH or np.mean(upward < 0.0) < THROUGHOUT or np.median(upward) > STEEP:
        return ()
    level = "+g" if frame.up[2] > 0.0 else "−g"
    return (
        f"accelerometer: the unit is upside down throughout: in {frame} a level body reads {level} about z, and this "
        "one the opposite. Is `sign` right (acc is specific force and points up at rest), and are `axes`?",
    )


def _steps(imu: ImuData) -> Iterator[str]:
    if imu.t.size < 2:
        return
    usual, mean = float(np.median(np.diff(imu.t))), float(imu.t[-1] - imu.t[0]) / (imu.t.size - 1)
    if usual >= LONGEST_STEP:
        yield (
            f"time: the usual step is {usual:.4g} s, too long to follow a gyroscope; if the times are ms or µs, "
            "convert them: t / 1000, or unit = 'ms' in the profile"
        )
    elif mean <= SHORTEST_STEP:
        yield f"time: the mean step is {mean:.4g} s, shorter than any MEMS part's; check the unit of the times"
    elif (told := bursts(imu.t)) is not None:
        yield f"time: {told}"


def bursts(t: Floats) -> str | None:
    """Say in words that the times (N,), s, are those at which bursts of even samples came; None where they are not.

    Rows come at a steady rate over a second, but not from one to the next.
    """
    step = np.diff(t)
    if step.size < ENOUGH:
        return None
    usual, span = float(np.median(step)), float(t[-1] - t[0])
    mean = span / step.size
    pauses = float(np.mean(step > PAUSE * mean))
    if not (usual < BURST * mean and pauses > FEW_PAUSES):
        return None
    window = max(1.0, 20.0 / (pauses / mean))  # of twenty bursts
    counts = np.diff(np.searchsorted(t, np.arange(t[0], t[-1], window)))
    if counts.size < FEWEST_WINDOWS or np.median(np.abs(counts - np.median(counts))) > STEADY * np.median(counts):
        return None
    rate = f'rate = "{1.0 / mean:.6g} Hz"'
    return (
        f"the stamps come in bursts: the usual step is {usual:.4g} s, but {t.size} rows in {span:.6g} s are one every "
        f"{mean:.4g} s; if the device samples evenly, declare it: [time] of the profile with {rate} alone"
    )


def _turning(imu: ImuData) -> tuple[str, ...]:
    found = turning(imu)
    if not found.tells:
        return ()
    times = to_deg(1.0)
    if found.factor < 0.0:
        return ("gyroscope: it turns against the accelerometer: a sign or an axis is wrong",)
    if _is_about(found.factor * times):
        return (
            f"gyroscope: the acceleration turns {times:.0f} times slower than the rates say; they look like °/s "
            "declared as rad/s",
        )
    if _is_about(found.factor / times):
        return (
            f"gyroscope: the acceleration turns {times:.0f} times faster than the rates say; they look like rad/s "
            "declared as °/s",
        )
    return ()


def _rates(imu: ImuData) -> tuple[str, ...]:
    gyr = imu.usable("gyr")
    rates = np.sqrt(np.sum(gyr * gyr, axis=1))
    rates = rates[np.isfinite(rates)]
    usual = float(np.median(rates)) if rates.size >= ENOUGH else 0.0
    if usual <= USUAL_RATE:
        return ()
    return (
        f"gyroscope: |gyr| is {usual:.3g} rad/s ({to_deg(usual):.0f} °/s) in the middle of {rates.size} samples; if "
        "the source holds °/s, convert it: units.dps(gyr), or unit = 'dps' in the profile",
    )


def _is_about(factor: float) -> bool:
    """Within a factor of two: a buoy in waves shows only 0.6 of its turning, since the waves push it, too."""
    return abs(math.log2(factor)) < 1.0
