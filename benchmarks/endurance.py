"""Very many steps through each filter's loop: does the quaternion keep its norm, does the bias stay finite?

Random motion of a unit that turns through all attitudes, with noise, biases and a magnetometer that is slower than the
rest. A few blocks of it are made and taken again and again while time goes on, so that the filter never starts anew;
where two blocks meet, the attitude jumps, which is part of the test. Every sample's norm is looked at.

    python -m benchmarks.endurance [--samples 100000000] [--filters mahony,mekf] [--json]
"""

import argparse
import json
import math
import sys
import time
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.speed import loop
from plumbob import Filter, Frame, ImuData
from plumbob.core.constants import G0
from plumbob.core.units import to_dps
from plumbob.filters import filter_names, load
from plumbob.rotations import quat_conjugate, quat_from_rotvec, quat_rotate

STEP_NS = 10_000_000
BLOCKS = 3
BLOCK = 1_000_000
FIELD_ENU = (0.0, 20.0, -43.0)  # µT; dip 65°, as in central Europe
LIMIT = 1e-12
"""Largest error of the norm that is allowed."""


@dataclass
class Endured:
    """What a filter has come through; errors of the norm at the ends of blocks and over all samples."""

    name: str
    samples: int
    ns: float
    at_block_ends: float
    largest: float
    bias_dps: float
    finite: bool

    @property
    def met(self) -> bool:
        return self.finite and self.largest < LIMIT


def block(seed: int, count: int) -> ImuData:
    """A block of samples: rates that change within some 0.5 s, and what they and gravity and field make of the rest."""
    rng = np.random.default_rng(seed)
    window = np.hanning(101)
    noise = rng.normal(size=(count + 100, 3)) / math.sqrt(np.sum(window**2))
    rate = np.stack([np.convolve(axis, window, mode="valid") for axis in noise.T], axis=1)
    start = quat_from_rotvec(rng.normal(size=3))
    true = ImuData(t=np.arange(count) * STEP_NS / 1e9, gyr=rate)
    q_bn = quat_conjugate(Filter("integrate", frame=Frame.ENU, init=start).process(true).q_nb)
    mag = quat_rotate(q_bn, np.array(FIELD_ENU)) + 0.5 * rng.normal(size=(count, 3))
    mag[np.arange(count) % 2 == 1] = np.nan
    return ImuData(
        t=true.t,
        gyr=rate + 0.01 * rng.normal(size=3) + 0.003 * rng.normal(size=(count, 3)),
        acc=quat_rotate(q_bn, np.array([0.0, 0.0, G0])) + 0.3 * rng.normal(size=(count, 3)),
        mag=mag,
    )


def endure(name: str, blocks: list[ImuData], samples: int) -> Endured:
    """Take blocks in turn until there are that many samples."""
    f = Filter(name, frame=Frame.ENU)
    done, spent, ends, largest, bias, finite = 0, 0, 0.0, 0.0, 0.0, True
    while done < samples:
        data = blocks[done // len(blocks[0]) % len(blocks)]
        t_ns = np.arange(done, done + len(data), dtype=np.int64) * STEP_NS
        before = time.thread_time_ns()
        q_nb, bias_b = loop(f, t_ns, data)
        spent += time.thread_time_ns() - before
        error = np.abs(np.linalg.norm(q_nb, axis=1) - 1.0)
        ends, largest = max(ends, error[-1]), max(largest, error.max())
        bias = max(bias, np.abs(bias_b).max())
        finite &= bool(np.isfinite(q_nb).all() and np.isfinite(f._x).all() and np.isfinite(bias_b).all())
        done += len(data)
    return Endured(name, done, spent / done, float(ends), float(largest), float(to_dps(bias)), finite)


def row(result: Endured) -> str:
    verdict = "met" if result.met else "MISSED"
    return (
        f"{result.name:24}{result.samples:>12}{result.ns:>10.1f}{result.at_block_ends:>12.1e}{result.largest:>12.1e}"
        f"{result.bias_dps:>12.3g}{'yes' if result.finite else 'NO':>8}  {verdict}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=float, default=1e8, help="rounded up to whole blocks (default 1e8)")
    parser.add_argument("--block", type=int, default=BLOCK, help=f"samples in a block (default {BLOCK})")
    parser.add_argument("--filters", metavar="A,B", help="all by default")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    names = filter_names() if args.filters is None else [name.strip() for name in args.filters.split(",")]
    for name in names:
        load(name)
    blocks = [block(seed, args.block) for seed in range(BLOCKS)]
    if not args.json:
        print(f"{'':46}{'largest | |q| − 1 |':^24}{'largest':>12}{'all':>8}  error")
        print(f"{'':24}{'samples':>12}{'ns each':>10}{'block ends':>12}{'anywhere':>12}", end="")
        print(f"{'bias °/s':>12}{'finite':>8}  < {LIMIT:g}")
    results = []
    for name in names:
        results.append(endure(name, blocks, round(args.samples)))
        if not args.json:
            print(row(results[-1]), flush=True)
    if args.json:
        print(json.dumps([asdict(r) | {"met": r.met} for r in results], indent=2))
    return 0 if all(r.met for r in results) else 1


if __name__ == "__main__":
    sys.exit(main())
