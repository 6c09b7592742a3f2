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


def sampled(quantity, count, seed):
    """White noise, flicker and random walk (count, 3) and their coefficients inside."""
    rng = np.random.default_rng(seed)
    n, b, k = (to_si(value, unit) for unit, value in PLANTED[quantity])
    axes = np.array([1.0, 1.1, 0.9])
    samples = errors.white(errors.white_sd(n * axes, RATE), count, rng)
    samples += errors.flicker(b * axes, count, rng) + errors.random_walk(k * axes, count, RATE, rng)
    return samples, [{"N": n * f, "B": b * f, "K": k * f} for f in axes]


def coefficients(truth, q_upper, r_upper):
    """N to 0.4 %, B to +9 −7 %, K to ±35 %; no quantization and no ramp."""
    return {
        "Q": Coefficient(0.0, 0.0, 0.5 * q_upper, q_upper, observable=False),
        "N": Coefficient(truth["N"], 0.996 * truth["N"], 1.004 * truth["N"], 1.007 * truth["N"]),
        "B": Coefficient(truth["B"], 0.93 * truth["B"], 1.09 * truth["B"], 1.16 * truth["B"]),
        "K": Coefficient(truth["K"], 0.65 * truth["K"], 1.35 * truth["K"], 1.6 * truth["K"]),
        "R": Coefficient(0.1 * r_upper, 0.0, 0.5 * r_upper, r_upper, observable=False, hours=12.3),
    }


def analysis_of(name, quantity, samples, truth, **changes):
    terms = coefficients(truth, q_upper=truth["N"] / 400.0, r_upper=truth["K"] / 60.0)
    lines = {k: Coefficient(1.1 * truth[k]) for k in ("N", "B")}
    given = {
        "lines": Estimates("lines", lines),
        "least_squares": Estimates("least squares", {**terms, "K": Coefficient(1.2 * truth["K"])}),
        "likelihood": Estimates("likelihood", terms),
        **changes,
    }
    return Analysis(name, quantity, float(samples.mean()), float(samples.std()), curve(samples, 1.0 / RATE), **given)


def make(count, quantities=("gyr", "acc"), seed=5, **changes):
    found = []
    for triad in quantities:
        quantity = {"gyr": Quantity.RATE, "acc": Quantity.ACCELERATION}[triad]
        samples, truths = sampled(quantity, count, seed + len(found))
        for axis in range(3):
            of = (f"{triad} {'xyz'[axis]}", quantity, samples[:, axis], truths[axis])
            found.append(analysis_of(*of, **(changes if axis == 0 else {})))
    return found


def rich():
    """Everything else that an analysis can hold."""
    return {
        "mask": Mask(8, 6.25, "the device filters its output"),
        "sinusoids": (Sinusoid(to_si(9.0, "deg/h"), to_si(0.4, "deg/h"), 12.5, 0.0004, 0.01),),
        "markov": GaussMarkov(
            Coefficient(to_si(5.0, "deg/h"), to_si(4.0, "deg/h"), to_si(6.5, "deg/h")), Coefficient(90.0, 60.0, 140.0)
        ),
        "candidates": (Candidate("N B K", -1234.5, True), Candidate("N B", -1200.25, False)),
        "step": to_si(31.5, "deg/h"),
        "notes": ("the first minute drifts <b>by</b> 3 °C",),
    }


@pytest.fixture(scope="session")
def analyses():
    return make(20_000, **rich())


@pytest.fixture(scope="session")
def plain():
    return make(20_000, ("gyr",))


@pytest.fixture(scope="session")
def bare():
    """A column of bare numbers, three seconds long."""
    samples = np.random.default_rng(1).normal(size=300)
    return analysis_of("column", Quantity.RATIO, samples, {"N": 0.1, "B": 0.02, "K": 0.001})
