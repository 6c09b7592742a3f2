"""An array of many units as a stream, its memory and its time: ``python -m benchmarks.arrays``.

The teaching-arm paper's array, its tables, recovery and faults are on the page of ``plumbob demo arm``.
"""

import argparse
import resource
import sys
import time
from collections.abc import Iterator

import numpy as np

from benchmarks.harness.bar import Bar, bar_lines
from plumbob import Filter, Frame, ImuData
from plumbob.arm.array import Monitor
from plumbob.data.array import ImuArray
from plumbob.papers.arm import moved


def large(units: int, rate: float, duration: float) -> Iterator[str]:
    """Many units as a stream: memory, and time beside that of one unit's filter."""
    rng, chunk = np.random.default_rng(1), 1000
    whole, _ = moved(3, 10.0, moving=False, rate=rate, units=units)
    parts = [part for part in whole.chunks(chunk) if len(part) == chunk]
    watch, spent, single, rows = Monitor(whole.mounts, step=1.0 / rate), 0.0, 0.0, 0
    one = Filter("mekf", frame=Frame.NED)
    watch.take(parts[0])
    one.process(next(iter(parts[0].units.values())), look=False, covariance=True)
    watch.reset()
    one.reset()
    _later(parts[0], 0.0, rng)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    for k in range(round(duration * rate / chunk)):
        part = _later(parts[k % len(parts)], k * chunk / rate, rng)
        began = time.perf_counter()
        watch.take(part)
        spent += time.perf_counter() - began
        imu = next(iter(part.units.values()))
        began = time.perf_counter()
        one.process(imu, look=False, covariance=True)
        single += time.perf_counter() - began
        rows += chunk
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    a, b = 1e9 * spent / rows / units, 1e9 * single / rows
    yield f"{units} units at {rate:g} Hz for {duration:g} s in parts of {chunk}: {rows} rows, {spent:.1f} s"
    yield f"peak memory {after:.0f} MiB, {after - before:.0f} MiB more than after the first part"
    yield f"monitor and combination {a:.0f} ns for a unit's sample; one unit's mekf {b:.0f} ns for a sample"
    yield ""
    yield from bar_lines(
        [
            Bar("time of a unit's sample over one unit's filter", a / b, 0.0, 1.5),
            Bar("growth, MiB", after - before, 0, 50),
        ]
    )


def _later(part: ImuArray, start: float, rng: np.random.Generator) -> ImuArray:
    """A part as if it came at another time, with values that have not been there."""
    t = start + (part.t - part.t[0])
    units = {}
    for name, one in part.units.items():
        shift = 1e-6 * rng.normal()
        units[name] = ImuData(t, one.gyr + shift, one.acc + shift, one.mag + shift)
    return ImuArray(units, part.mounts)


def main(argv: list[str] | None = None) -> int:
    """Run it."""
    p = argparse.ArgumentParser(prog="python -m benchmarks.arrays", description=__doc__)
    p.add_argument("--duration", type=float, default=600.0, metavar="S", help="of the stream (default: 600)")
    args = p.parse_args(argv)
    for line in large(64, 1000.0, args.duration):
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
