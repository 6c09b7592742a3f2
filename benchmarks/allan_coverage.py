"""How often the intervals of an Allan deviation hold the truth, at every averaging time, on simulated noise.

Records of white, flicker and random-walk noise as `plumbob.simulation` makes them; flicker after a past of four times
the record, a walk's differences need none. The truth is the deviation of the noise as it was generated, in closed form:
1/√n for white noise, √((2n² + 1)/(6n)) for the sum of white steps, and for flicker that of the fractional integrator of
order 1/2, √((3 s(0) − 4 s(n) + s(2n)) / n²) with s(k) = (k² − 1/4)(ψ(k + 3/2) + ψ(k − 1/2)) / 4π.

Side by side, at 68.3 %: ours, with the noise identified from each record's own curve; ours with the true exponent
given; χ² with the edf alone and the true exponent; IEEE's relative error 1/√(2(N/n − 1)); and allantools' default, the
deviation over the root of the number of its differences.

    python -m benchmarks.allan_coverage [--records 400] [--samples 100000] [--every 4] [--json]
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy.special import psi

from plumbob.core.check import Floats
from plumbob.noise import Curve, curves, edf, interval
from plumbob.noise.curve import skew_edf
from plumbob.simulation.errors import flicker, random_walk, stream, white

BAR = (0.60, 0.78)
PAST = 4
AXES = 3  # of one call of a generator
COLUMNS = ("ours", "alpha given", "chi-square", "IEEE", "allantools")


class Noise(NamedTuple):
    """A process of unit strength: the exponent of its spectrum, a record (count, 3), and its Allan deviation."""

    alpha: float
    make: Callable[[int, np.random.Generator], Floats]
    deviation: Callable[[Floats], Floats]


def flicker_deviation(n: Floats) -> Floats:
    def s(k: Floats) -> Floats:
        return np.asarray((k**2 - 0.25) * (psi(k + 1.5) + psi(k - 0.5)) / (4.0 * np.pi))

    return np.asarray(np.sqrt((3.0 * s(np.zeros(1)) - 4.0 * s(n) + s(2.0 * n)) / n**2))


UNIT = np.ones(AXES)
NOISES = {
    "white": Noise(0.0, lambda count, rng: white(UNIT, count, rng), lambda n: 1.0 / np.sqrt(n)),
    "flicker": Noise(
        -1.0, lambda count, rng: flicker(UNIT, (PAST + 1) * count, rng)[PAST * count :], flicker_deviation
    ),
    "random walk": Noise(
        -2.0,
        lambda count, rng: random_walk(UNIT, count, 1.0, rng),
        lambda n: np.sqrt((2.0 * n**2 + 1.0) / (6.0 * n)),
    ),
}


def simulated(name: str, records: int, samples: int) -> list[Curve]:
    """Curves of that many records, each identified by itself."""
    found: list[Curve] = []
    for seed in range(-(-records // AXES)):
        found += curves(NOISES[name].make(samples, stream(seed, "allan coverage", name)), 1.0)
    return found[:records]


def coverage(name: str, found: list[Curve]) -> dict[str, Floats]:
    """Share of the records whose interval holds the truth, at every factor, by column."""
    noise, first = NOISES[name], found[0]
    dev = np.array([one.dev for one in found])
    truth = noise.deviation(first.n.astype(float))
    given = edf(first.kind, noise.alpha, first.count, first.n)
    skew = skew_edf(first.kind, noise.alpha, first.count, first.n)
    ends = (
        (np.array([one.lo for one in found]), np.array([one.hi for one in found])),
        interval(dev, given, skew),
        interval(dev, given, given),
        around(dev, first.ieee),
        around(dev, 1.0 / np.sqrt(first.count - 2 * first.n + 1.0)),
    )
    return {
        column: np.mean((lo <= truth) & (truth <= hi), axis=0) for column, (lo, hi) in zip(COLUMNS, ends, strict=True)
    }


def around(dev: Floats, share: Floats) -> tuple[Floats, Floats]:
    return dev * (1.0 - share), dev * (1.0 + share)


def measure(records: int, samples: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Of each noise: the factors, what was identified there, the edf, and the columns."""
    for name in NOISES:
        found = simulated(name, records, samples)
        alpha = np.array([one.alpha for one in found])
        yield (
            name,
            {
                "n": found[0].n.tolist(),
                "alpha_mean": alpha.mean(axis=0).tolist(),
                "alpha_sd": alpha.std(axis=0).tolist(),
                "edf": np.mean([one.edf for one in found], axis=0).tolist(),
                **{column: share.tolist() for column, share in coverage(name, found).items()},
            },
        )


def show(name: str, one: dict[str, Any], every: int) -> None:
    print(f"\n{name}\n{'n':>8}{'alpha':>8}{'sd':>6}{'edf':>10}" + "".join(f"{column:>13}" for column in COLUMNS))
    places = [*range(0, len(one["n"]) - 1, every), len(one["n"]) - 1]
    for i in places:
        head = f"{one['n'][i]:8d}{one['alpha_mean'][i]:8.2f}{one['alpha_sd'][i]:6.2f}{one['edf'][i]:10.1f}"
        print(head + "".join(f"{100.0 * one[column][i]:11.1f} %" for column in COLUMNS))
    for column in COLUMNS:
        low, high = min(one[column]), max(one[column])
        met = "met" if BAR[0] <= low and high <= BAR[1] else "not met"
        print(f"  {column:12} {100.0 * low:5.1f} to {100.0 * high:5.1f} % over all {len(one['n'])} factors: {met}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=400)
    parser.add_argument("--samples", type=int, default=100_000)
    parser.add_argument("--every", type=int, default=4, help="show every so many factors; all are judged")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    if args.json:
        print(json.dumps(dict(measure(args.records, args.samples)), indent=2))
        return 0
    scatter = 100.0 * np.sqrt(0.683 * 0.317 / args.records)
    print(f"{args.records} records of {args.samples} samples; a true 68.3 % shows as ± {scatter:.1f} %; ", end="")
    print(f"bar: {100 * BAR[0]:.0f} to {100 * BAR[1]:.0f} % at every factor")
    for name, one in measure(args.records, args.samples):
        show(name, one, args.every)
    return 0


if __name__ == "__main__":
    sys.exit(main())
