"""How well coefficients are found on records of which the truth is known, and whether their intervals hold it.

Records of all five terms at once, drawn by the simulator's generators: Q 0.001°, N 0.02 °/s/√Hz, B 0.005 °/s,
K 3.3e-4 °/s/√s and R 1e-5 °/s², 100 Hz, two hours. Printed for each method: bias and root mean square of the relative
error, and the share of the intervals of 68.3 % that hold the truth. A share of r runs scatters by 0.47/√r.

    python -m benchmarks.allan_quality [--runs 120] [--hours 2] [--json]
"""

import argparse
import json
import math
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from plumbob.noise import analyse
from plumbob.simulation import errors

RATE = 100.0
TRUTH = {"Q": 1e-3, "N": 0.02, "B": 0.005, "K": 3.3e-4, "R": 1e-5}
BARS = {"Q": 0.5, "N": 0.5, "B": 8.5, "K": 40.0, "R": 47.0}
SHARES = 60.0, 78.0
METHODS = ("lines", "least_squares", "likelihood")


class Row(NamedTuple):
    """One coefficient by one method: in how many runs it was found, and how."""

    method: str
    letter: str
    found: int
    bias: float
    rms: float
    share: float | None
    met: bool | None


def records(seed: int, count: int) -> np.ndarray:
    """Three independent records, (N, 3), °/s."""
    rng = np.random.default_rng(seed)
    one = np.ones(3)
    angle = TRUTH["Q"] * rng.standard_normal((count + 1, 3))
    return (
        np.diff(angle, axis=0) * RATE
        + errors.white(errors.white_sd(TRUTH["N"] * one, RATE), count, rng)
        + errors.flicker(TRUTH["B"] * one, 2 * count, rng)[count:]  # it starts from nothing; the second half has a past
        + errors.random_walk(TRUTH["K"] * one, count, RATE, rng)
        + np.outer(np.arange(count) / RATE, TRUTH["R"] * one)
    )


def analyses(seed: int, count: int) -> list:
    return [analyse(channel, 1.0 / RATE) for channel in np.ascontiguousarray(records(seed, count).T)]


def row(method: str, letter: str, found: list) -> Row:
    terms = [a[letter] for a in (getattr(f, method).terms for f in found) if letter in a]
    truth = TRUTH[letter]
    if not terms:
        return Row(method, letter, 0, math.nan, math.nan, None, None)
    relative = np.array([c.value for c in terms]) / truth - 1.0
    known = [c.lo <= truth <= c.hi for c in terms if math.isfinite(c.lo)]
    rms = 100.0 * math.sqrt(float(np.mean(relative**2)))
    share = 100.0 * float(np.mean(known)) if known else None
    met = None
    if method == "likelihood":
        met = rms <= BARS[letter] and share is not None and SHARES[0] <= share <= SHARES[1]
    return Row(method, letter, len(terms), 100.0 * float(np.mean(relative)), rms, share, met)


def text(rows: list[Row], runs: int, hours: float, seconds: float) -> str:
    lines = [
        f"{runs} records of {hours:g} h at {RATE:g} Hz; relative errors in %, {seconds:.0f} s",
        f"{'method':14} {'':2} {'found':>6} {'bias':>8} {'rms':>7} {'holds':>6}   bar",
    ]
    for r in rows:
        share = "-" if r.share is None else f"{r.share:.0f}"
        bar = "" if r.met is None else f"rms <= {BARS[r.letter]:g}, holds 60-78: {'met' if r.met else 'NOT MET'}"
        numbers = f"{r.bias:+8.2f} {r.rms:7.2f}" if r.found else f"{'-':>8} {'-':>7}"
        lines.append(f"{r.method:14} {r.letter:2} {r.found:6} {numbers} {share:>6}   {bar}")
    return "\n".join(lines)


def main() -> int:
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--runs", type=int, default=120)
    p.add_argument("--hours", type=float, default=2.0)
    p.add_argument("--json", action="store_true")
    args = p.parse_args()
    count, sets = round(3600.0 * args.hours * RATE), -(-args.runs // 3)
    begun = time.perf_counter()
    with ThreadPoolExecutor(2) as pool:
        found = [a for three in pool.map(lambda seed: analyses(seed, count), range(sets)) for a in three]
    rows = [row(method, letter, found) for method in METHODS for letter in TRUTH]
    seconds = time.perf_counter() - begun
    if args.json:
        print(json.dumps([r._asdict() for r in rows], indent=2))
    else:
        print(text(rows, len(found), args.hours, seconds))
    return 0 if all(r.met is not False for r in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
