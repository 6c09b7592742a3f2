"""Analyses to show: simulated noise with its real curve, and coefficients put in by hand as planted."""

import numpy as np
import pytest

from plumbob.core.units import Quantity, to_si
from plumbob.noise import curve
from plumbob.noise.findings import Analysis, Candidate, Coefficient, Estimates, GaussMarkov, Mask, Sinusoid
from plumbob.simulation import errors

RATE = 100.0
PLANTED = {  # of an MPU-6000-like unit: N, B, K in the unit of data sheets
    Quantity.RATE: (("deg/rth", 0.3), ("deg/h", 12.0), ("deg/h/rth", 20.0)),
    Quantity.ACCELERATION: (("ug/rtHz", 300.0), ("ug", 60.0), ("ug/s/rtHz", 2.0)),
}


def analysis_of(name, quantity, samples, truth, **changes):
    """N to 0.4 %, B to +9 −7 %, K to ±35 %; no quantization and no ramp."""
    n, b, k = (truth[letter] for letter in "NBK")
    terms = {
        "Q": Coefficient(0.0, 0.0, n / 800.0, n / 400.0, observable=False),
        "N": Coefficient(n, 0.996 * n, 1.004 * n, 1.007 * n),
        "B": Coefficient(b, 0.93 * b, 1.09 * b, 1.16 * b),
        "K": Coefficient(k, 0.65 * k, 1.35 * k, 1.6 * k),
        "R": Coefficient(k / 600.0, 0.0, k / 120.0, k / 60.0, observable=False, hours=12.3),
    }
    given = {
        "lines": Estimates("lines", {"N": Coefficient(1.1 * n), "B": Coefficient(1.1 * b)}),
        "least_squares": Estimates("least squares", {**terms, "K": Coefficient(1.2 * k)}),
        "likelihood": Estimates("likelihood", terms),
        **changes,
    }
    return Analysis(name, quantity, float(samples.mean()), float(samples.std()), curve(samples, 1.0 / RATE), **given)


def triad(name, quantity, seed, count=20_000, **changes):
    """White noise, flicker and random walk with the planted coefficients, 1.1 and 0.9 of them; changes are of x."""
    rng, axes = np.random.default_rng(seed), np.array([1.0, 1.1, 0.9])
    n, b, k = (to_si(value, unit) for unit, value in PLANTED[quantity])
    samples = errors.white(errors.white_sd(n * axes, RATE), count, rng)
    samples += errors.flicker(b * axes, count, rng) + errors.random_walk(k * axes, count, RATE, rng)
    return [
        analysis_of(
            f"{name} {axis}", quantity, column, {"N": n * f, "B": b * f, "K": k * f}, **(changes if axis == "x" else {})
        )
        for axis, column, f in zip("xyz", samples.T, axes, strict=True)
    ]


@pytest.fixture(scope="session")
def analyses():
    """Everything else that an analysis can hold, too."""
    hour = to_si(1.0, "deg/h")
    rich = {
        "mask": Mask(8, 6.25, "the device filters its output"),
        "sinusoids": (Sinusoid(9.0 * hour, 0.4 * hour, 12.5, 0.0004, 0.01),),
        "markov": GaussMarkov(Coefficient(5.0 * hour, 4.0 * hour, 6.5 * hour), Coefficient(90.0, 60.0, 140.0)),
        "candidates": (Candidate("N B K", -1234.5, True), Candidate("N B", -1200.25, False)),
        "step": 31.5 * hour,
        "notes": ("the first minute drifts <b>by</b> 3 °C",),
    }
    return triad("gyr", Quantity.RATE, 5, **rich) + triad("acc", Quantity.ACCELERATION, 8, **rich)


@pytest.fixture(scope="session")
def plain():
    return triad("gyr", Quantity.RATE, 5)


@pytest.fixture(scope="session")
def bare():
    """A column of bare numbers, three seconds long."""
    samples = np.random.default_rng(1).normal(size=300)
    return analysis_of("column", Quantity.RATIO, samples, {"N": 0.1, "B": 0.02, "K": 0.001})
