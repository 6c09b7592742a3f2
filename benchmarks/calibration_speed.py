"""Magnetometer fits beside magcal, in one run: seconds of a whole fit, and the heading error that each leaves.

Both get the same samples: a field of 50 µT seen in every direction, hard iron of some 10 µT, soft iron of 10 to 20 %
along random axes, noise of 0.2 µT. magcal's ellipsoid is a least squares fit about the mean, and our closed form does
the same work with a free centre; our whole fit then chooses the shape by test, looks for outliers and a moved magnet,
and gives the covariance. Contenders run in turn within every round; the figure to quote is the median over rounds of
the ratio within a round. magcal comes with the extra `bench`.

    python -m benchmarks.calibration_speed [--samples 1000000] [--rounds 5] [--json]
"""

import argparse
import contextlib
import io
import json
import statistics
import time
from collections.abc import Callable

import numpy as np

from plumbob.calibration.ellipsoid_fit import fit_quadric
from plumbob.calibration.mag.ellipsoid import fit_mag

SECONDS = 1.0


def capture(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples (N, 3), and the response and the hard iron that they were made with."""
    rng = np.random.default_rng(0)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    response = axes @ np.diag(1.0 + rng.uniform(0.1, 0.2, 3) * rng.choice([-1.0, 1.0], 3)) @ axes.T
    field = rng.normal(size=(count, 3))
    field *= 50.0 / np.linalg.norm(field, axis=1, keepdims=True)
    bias = np.array([6.0, -7.0, 4.0])
    return field @ response.T + bias + 0.2 * rng.normal(size=(count, 3)), response, bias


def direction_error(matrix: np.ndarray, bias: np.ndarray, response: np.ndarray, iron: np.ndarray) -> float:
    """Root mean square angle in degrees between true and calibrated directions."""
    rng = np.random.default_rng(1)
    field = rng.normal(size=(2000, 3))
    field *= 50.0 / np.linalg.norm(field, axis=1, keepdims=True)
    found = (field @ response.T + iron - bias) @ matrix.T
    cosine = np.sum(found * field, axis=1) / np.linalg.norm(found, axis=1) / 50.0
    return float(np.degrees(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1.0, 1.0)) ** 2))))


def magcal_fit(samples: np.ndarray) -> Callable[[], tuple[np.ndarray, np.ndarray]]:
    from magcal.core import MagnetometerCalibrator

    def fit() -> tuple[np.ndarray, np.ndarray]:
        with contextlib.redirect_stdout(io.StringIO()):
            found = MagnetometerCalibrator().ellipsoid_fit(samples)
        return found["transform_matrix"], found["center"]

    return fit


def our_fit(samples: np.ndarray) -> Callable[[], tuple[np.ndarray, np.ndarray]]:
    def fit() -> tuple[np.ndarray, np.ndarray]:
        made = fit_mag(samples).calibration
        return made.matrix, made.bias

    return fit


def closed_form(samples: np.ndarray) -> Callable[[], tuple[np.ndarray, np.ndarray]]:
    def fit() -> tuple[np.ndarray, np.ndarray]:
        found = fit_quadric(samples)
        return found.shape, found.centre

    return fit


def measure(count: int, rounds: int) -> dict[str, object]:
    samples, response, iron = capture(count)
    calls = {"whole": our_fit(samples), "closed": closed_form(samples)}
    with contextlib.suppress(ImportError):
        calls["magcal"] = magcal_fit(samples)
    errors = {name: direction_error(*call(), response, iron) for name, call in calls.items()}
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - start)
    ratios = {
        name: statistics.median(b / a for a, b in zip(times[name], times["magcal"], strict=True))
        for name in ("whole", "closed")
        if "magcal" in times
    }
    seconds = {name: statistics.median(values) for name, values in times.items()}
    return {
        "samples": count,
        "seconds": seconds,
        "error_deg": errors,
        "ratio": ratios,
        "bar": f"about {SECONDS:g} s",
        "met": seconds["whole"] <= SECONDS,
    }


def text(result: dict[str, object]) -> str:
    lines = [f"magnetometer fit of {result['samples']} samples"]
    for name, seconds in result["seconds"].items():
        lines.append(f"  {name:8} {seconds:8.3f} s   direction error {result['error_deg'][name]:.2g} deg rms")
    for name, ratio in result["ratio"].items():
        lines.append(f"  magcal takes {ratio:.2f} times as long as our {name} fit")
    if not result["ratio"]:
        lines.append("  magcal is not installed: it comes with the extra bench")
    return "\n".join([*lines, f"  bar: {result['bar']}, {'met' if result['met'] else 'NOT met'}"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    result = measure(args.samples, args.rounds)
    print(json.dumps(result, indent=2) if args.json else text(result))


if __name__ == "__main__":
    main()
