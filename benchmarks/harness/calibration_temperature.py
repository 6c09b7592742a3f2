"""Soaks of many simulated gyroscopes: what a polynomial of each unit leaves, and what the trackball paper's figure.

Every unit is drawn as an MPU-3050 leaves the line, and its bias bends: a slope, a square and a cube of random size and
sign, in place of the preset's. It lies still while the temperature goes from 25 to 45 °C and back, and the drift that
the fit tells for this span is held against the true one. The bars are for white noise alone. The second soak adds the
bias instability of the paper's part, 36 °/h: a bias that wanders by 0.007 °/s by itself shows no curve to 0.005 °/s,
however it is fitted.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from benchmarks.harness.bar import Bar
from benchmarks.harness.section import Section
from plumbob.calibration.gyr.drift import chen2013
from plumbob.calibration.gyr.rest import Rates
from plumbob.calibration.gyr.temperature import fit_drift, fit_temperature
from plumbob.core.check import Floats
from plumbob.core.units import dps, to_dps
from plumbob.data.calibrated import temperature_drift
from plumbob.data.cards import UNITS, TriadCalibration
from plumbob.rotations import Frame
from plumbob.simulation.presets import draw_module
from plumbob.simulation.signals import constant, sinusoid
from plumbob.simulation.simulation import simulate

SPAN: Final = (25.0, 45.0)
"""Lowest and highest temperature, °C."""

SIZES: Final = dps(np.array([[0.15], [1.5e-3], [4e-5]]))
"""Largest slope (uniform) and standard deviations of square and cube, rad/s per K, K² and K³: over 20 K they are worth
up to 3, 0.6 and 0.3 °/s."""

FLICKER: Final = float(dps(36.0 / 3600.0))
"""Bias instability of the trackball paper's part, rad/s [Chen2013]."""

_RATE = 4.0
SOAKS: Final[tuple[tuple[str, float, float, int], ...]] = (
    ("white noise, 1 h, once up and down", 0.0, 3600.0, 1),
    ("and 36 °/h, 2 h, four times", FLICKER, 7200.0, 4),
)
"""Name, bias instability, rad/s, duration, s, and how often the temperature goes up and down."""


OTHERS: Final = {"acc": 3.5e-3, "mag": 0.05}
"""Largest drift per kelvin of accelerometer (0.35 mg: MPU-6000, x and y) and magnetometer, m/s² and µT."""

_COLUMNS: Final = ("left, °/s", "95 %, °/s", "by the paper's 0.1 °/s/°C, °/s", "uncorrected, °/s")


def measure_temperature(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> Section:
    """Soak one unit for each seed, in each of `SOAKS`.

    Parameters
    ----------
    seeds : sequence of int
        Of the units.
    progress : callable, optional
        Called with 1 after each soak.
    """
    rows = {}
    for name, flicker, duration, cycles in SOAKS:
        left, paper, raw = to_dps(np.transpose([_one(seed, flicker, duration, cycles) for seed in seeds]))
        figures = (np.median(left), np.quantile(left, 0.95), np.median(paper), np.median(raw))
        rows[name] = tuple(float(figure) for figure in figures)
        if progress:
            progress(1)
    _, most, paper, _ = rows[SOAKS[0][0]]
    bars = (
        Bar("bias over 25 to 45 °C, 95 % of the units, °/s", most, 0.0, 0.005),
        Bar("the paper's 0.1 °/s/°C on the same units, median, °/s", paper, 1.0, math.inf),
    )
    title = f"Bias over 25 to 45 °C, {len(seeds)} units, the largest over axes and temperatures, medians"
    return Section(title, _COLUMNS, rows, bars)


def _one(seed: int, flicker: float, duration: float, cycles: int) -> tuple[float, float, float]:
    """Largest error of the drift, rad/s: fitted, by the paper's figure, and uncorrected."""
    rng = np.random.default_rng([seed, 2013])
    slopes = SIZES * np.stack((rng.uniform(-1.0, 1.0, 3), *rng.standard_normal((2, 3))))
    middle, half = np.mean(SPAN), 0.5 * (SPAN[1] - SPAN[0])
    drawn = draw_module("mpu3050", seed)
    assert drawn.gyr is not None
    unit = replace(drawn, gyr=replace(drawn.gyr, flicker=np.full(3, flicker), bias_per_k=np.zeros(3)))
    imu = simulate(
        "static",
        frame=Frame.ENU,
        sensors=unit,
        unit="random",
        seed=seed,
        rate=_RATE,
        duration=duration,
        temp_c=constant(middle) + sinusoid(float(half), cycles / duration, -0.5 * np.pi),
    ).imu
    assert imu.gyr is not None and imu.temp_c is not None
    fit = fit_temperature(Rates(imu.t, imu.gyr + _curve(imu.temp_c, slopes), temp_c=imu.temp_c)).calibration
    grid = np.linspace(*SPAN, 41)
    true = _curve(grid, slopes)
    told = temperature_drift(fit, grid) - temperature_drift(fit, np.array([SPAN[0]]))
    paper = np.outer(grid - SPAN[0], chen2013().bias_per_k)
    return float(np.abs(told - true).max()), float(np.abs(paper - true).max()), float(np.abs(true).max())


def _curve(temp_c: Floats, slopes: Floats) -> Floats:
    """Drift (N, 3) since 25 °C."""
    warmer = temp_c - SPAN[0]
    return np.asarray(np.stack((warmer, warmer**2, warmer**3), axis=1) @ slopes)


def measure_drift(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> Section:
    """Soak accelerometer and magnetometer of a unit for each seed, 10 to 50 °C in an hour; as `measure_temperature`."""
    rows = {}
    for triad in OTHERS:
        errors = np.abs([_planted_drift(seed, triad) for seed in seeds])
        rows[triad] = (float(errors.max()), 100.0 * float(np.mean(errors < 1.0)))
        if progress:
            progress(1)
    bars = tuple(Bar(f"drift of {triad}, largest error over its sd", row[0], 0.0, 3.5) for triad, row in rows.items())
    return Section(f"Drift per kelvin, {len(seeds)} units", ("largest error / sd", "within 1 sd, %"), rows, bars)


def _planted_drift(seed: int, triad: str) -> Floats:
    """Error of the coefficients (3,), over their standard deviations."""
    slopes = np.random.default_rng([seed, 44]).uniform(-1.0, 1.0, 3) * OTHERS[triad]
    drawn = draw_module("mpu6000+hmc5983", seed)
    errors = replace(getattr(drawn, triad), bias_per_k=slopes, scale_per_k=np.zeros(3))
    how: dict[str, Any] = {"sensors": replace(drawn, **{triad: errors}), "unit": "random", "seed": seed, "rate": _RATE}
    warm = constant(30.0) + sinusoid(20.0, 1.0 / 3600.0, -0.5 * np.pi)
    imu = simulate("static", frame=Frame.NED, duration=3600.0, temp_c=warm, **how).imu
    known = TriadCalibration(np.eye(3), np.zeros(3), UNITS[triad], UNITS[triad])
    fit = fit_drift(triad, imu.t, imu.usable(triad), imu.temp_c, known, acc=imu.acc, gyr=imu.gyr).calibration
    assert fit.bias_per_k_sd is not None
    return np.asarray((fit.bias_per_k[0] - slopes) / fit.bias_per_k_sd[0])
