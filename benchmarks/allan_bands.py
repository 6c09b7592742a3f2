"""How well coefficients are found beside a narrow band of motion, and how often a random walk is seen where none is.

Accelerometers with N 440 µg/√Hz, B 300 µg and K 40 µg/s/√Hz at 100 Hz, with a resonance at 0.55 Hz that white noise
drives: 100, 300 and 600 µg, of quality 25 and 170, 10⁶ samples. And records of two hours without a band, with the walk
and without. Printed: bias and root mean square of the relative error, the share of the intervals of 68.3 % that hold
the truth, and how often Q and K are called observable. A share of r runs scatters by 0.47/√r: 8.5 % of 30.

    python -m benchmarks.allan_bands [--runs 30] [--walks 100] [--samples 1000000] [--json]
"""

import argparse
import json
import math
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from scipy.signal import lfilter

from plumbob.noise import Analysis, analyse
from plumbob.simulation import errors

RATE = 100.0
TRUTH = {"N": 440.0, "B": 300.0, "K": 40.0}
AT = 0.55
BANDS = [(sd, quality) for sd in (100.0, 300.0, 600.0) for quality in (25.0, 170.0)]
RMS = {"N": 2.0, "B": 15.0}
SHARES = 60.0, 78.0
SEEN = {"Q": 5.0, "K": 7.0}
"""Most per cent of records in which a term that is not there may be called observable."""
SETTLING = 200_000


def sensor(rng: np.random.Generator, count: int, walk: float) -> np.ndarray:
    """Noise (N,) without a band, µg."""
    one = np.ones(1)
    found = errors.white(errors.white_sd(TRUTH["N"] * one, RATE), count, rng)
    found = found + errors.flicker(TRUTH["B"] * one, 2 * count, rng)[count:]  # the second half has a past
    return (found + errors.random_walk(walk * one, count, RATE, rng))[:, 0]


def band(rng: np.random.Generator, count: int, sd: float, quality: float) -> np.ndarray:
    """White noise behind a resonance, (N,), µg."""
    damping = math.exp(-math.pi * AT / quality / RATE)
    turn = 2.0 * math.pi * AT * math.sqrt(1.0 - 0.25 / quality**2) / RATE
    drive = rng.standard_normal(count + SETTLING)
    swing = lfilter([1.0], [1.0, -2.0 * damping * math.cos(turn), damping**2], drive)[SETTLING:]
    return swing * sd / np.std(swing)


def analyses(case: int, runs: int, make: Callable[[np.random.Generator], np.ndarray]) -> list[Analysis]:
    """Analyses of so many records, which no other case shares."""
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(lambda seed: analyse(make(np.random.default_rng([case, seed])), 1.0 / RATE), range(runs)))


def row(name: str, found: list[Analysis], walk: float) -> dict[str, Any]:
    """Figures of one case."""
    told: dict[str, Any] = {"case": name, "runs": len(found), "met": True}
    for letter, truth in (TRUTH | {"K": walk}).items():
        terms = [a.terms[letter] for a in found]
        if truth:
            off = 100.0 * (np.array([c.value for c in terms]) / truth - 1.0)
            holds = 100.0 * float(np.mean([c.lo <= truth <= c.hi for c in terms]))
            told[letter] = {"bias": float(off.mean()), "rms": float(np.sqrt(np.mean(off**2))), "holds": holds}
            told["met"] &= told[letter]["rms"] <= RMS.get(letter, math.inf) and SHARES[0] <= holds <= SHARES[1]
    for letter in ("Q",) if walk else ("Q", "K"):
        told[f"{letter} seen"] = 100.0 * float(np.mean([a.terms[letter].observable for a in found]))
        told["met"] &= told[f"{letter} seen"] <= SEEN[letter]
    return told


def text(rows: list[dict[str, Any]]) -> str:
    columns = " ".join(f"{letter + ' bias':>7} {'rms':>5} {'holds':>5}" for letter in TRUTH)
    head = f"{'case':22} {columns} {'Q seen':>6} {'K seen':>6}"
    lines = [f"relative errors in %; bars: N {RMS['N']:g}, B {RMS['B']:g} rms, holds 60-78, Q seen 5, K seen 7", head]
    for r in rows:
        cells = (r.get(letter) for letter in TRUTH)
        numbers = " ".join(f"{c['bias']:+7.2f} {c['rms']:5.2f} {c['holds']:5.0f}" if c else f"{'-':>19}" for c in cells)
        seen = " ".join(f"{r[k]:6.1f}" if k in r else f"{'-':>6}" for k in ("Q seen", "K seen"))
        lines.append(f"{r['case']:22} {numbers} {seen}   {'met' if r['met'] else 'NOT MET'}")
    return "\n".join(lines)


def main() -> int:
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--runs", type=int, default=30)
    p.add_argument("--walks", type=int, default=100)
    p.add_argument("--samples", type=int, default=1_000_000)
    p.add_argument("--json", action="store_true")
    args = p.parse_args()
    rows, together = [], []
    for case, (sd, quality) in enumerate(BANDS):

        def disturbed(rng: np.random.Generator, sd: float = sd, quality: float = quality) -> np.ndarray:
            return sensor(rng, args.samples, TRUTH["K"]) + band(rng, args.samples, sd, quality)

        found = analyses(case, args.runs, disturbed)
        rows.append(row(f"{sd:g} ug, quality {quality:g}", found, TRUTH["K"]))
        together += found
    rows.append(row("all of them", together, TRUTH["K"]))
    count = round(0.72 * args.samples)
    for case, walk in enumerate((0.0, TRUTH["K"]), start=len(BANDS)):
        found = analyses(case, args.walks, lambda rng, walk=walk: sensor(rng, count, walk))
        rows.append(row(f"no band, K = {walk:g}", found, walk))
    print(json.dumps(rows, indent=2) if args.json else text(rows))
    return 0 if all(r["met"] for r in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
