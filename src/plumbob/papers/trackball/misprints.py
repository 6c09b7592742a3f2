"""What the trackball paper prints otherwise than it must be: each literal form, computed beside the corrected one."""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from plumbob.calibration.gyr.drift import GyroDrift, chen2013
from plumbob.core.check import Floats
from plumbob.core.units import dps, g, to_dps
from plumbob.data import ImuData
from plumbob.data.calibrated import apply_card
from plumbob.door.calibrate import calibrate
from plumbob.papers.trackball.seeds import BIAS, PEAK, SAMPLES, STEP, WHITE, at_rest, scalar_filter
from plumbob.rotations import Frame
from plumbob.simulation import Module, TriadErrors, scenario, simulate
from plumbob.simulation.signals import Polynomial

PARTS: Final = (0.03, -0.05)
"""True coefficients of temperature of two parts, °/s per °C; the paper takes 0.1 for every one."""
WARM: Final = (25.0, 45.0)
"""Temperatures from which and to which the parts warm in 100 s, °C."""
LAST: Final = 30
"""Samples at the end, 3 s, over which what is left is averaged."""
RUNS: Final = 10
"""Runs over which it is averaged."""


class Warmed(NamedTuple):
    """Mean rate at 45 °C of a part at rest, rad/s: as measured, and after each compensation."""

    raw: float
    printed: float
    own: float
    coefficient: float


def warmed(coefficient: float, seed: int) -> Warmed:
    """What each compensation of temperature leaves of a part with that coefficient, °/s per °C.

    "printed" takes the paper's 0.1 °/s per °C; "own" the card that `plumbob calibrate temperature` makes of a soak of
    an hour, whose fitted drift is compared with the true one, so that the noise of 3 s does not count.
    """
    soak = _warming(coefficient, seed, 3600.0)
    card = calibrate(soak, "temperature").card
    model = replace(chen2013(), g_sensitivity=np.zeros((3, 3)))
    tests = [_warming(coefficient, seed + 1 + k, SAMPLES * STEP) for k in range(RUNS)]
    raw = [test.usable("gyr")[-LAST:] for test in tests]
    printed = [model.compensate(test.usable("gyr"), test.temp_c)[-LAST:] for test in tests]
    still = ImuData(
        t=np.array([0.0, STEP]), gyr=_true(coefficient, np.full(2, WARM[1])), temp_c=np.full(2, WARM[1]), meta=soak.meta
    )
    drift = apply_card(card, still).usable("gyr")
    assert card.gyr is not None
    return Warmed(float(np.mean(raw)), float(np.mean(printed)), float(np.mean(drift)), float(card.gyr.bias_per_k[0, 0]))


def _true(coefficient: float, temp_c: Floats) -> Floats:
    return np.outer(dps(coefficient) * (temp_c - WARM[0]), np.ones(3))


def _warming(coefficient: float, seed: int, duration: float) -> ImuData:
    errors = TriadErrors(white_sd=np.full(3, WHITE), bias_per_k=np.full(3, dps(coefficient)))
    unit = Module("mpu3050", "a part with its own coefficient of temperature", gyr=errors)
    warmth = Polynomial((WARM[0], (WARM[1] - WARM[0]) / duration))
    made = simulate(
        scenario("static"), frame=Frame.NED, sensors=unit, unit="random", seed=seed, rate=1.0 / STEP,
        duration=duration, temp_c=warmth,
    )  # fmt: skip
    return replace(made.imu, meta=replace(made.imu.meta, device="mpu3050"))


def counted_twice() -> float:
    """What is left at 45 °C of a part with exactly 0.1 °/s per °C where (5) takes A_x, which holds the temperature."""
    warmer = WARM[1] - WARM[0]
    drift = chen2013().bias_per_k[0] * warmer
    contained = drift  # [Chen2013] (2): A_x0 + i + ΔA_t
    return float(drift - (contained + drift))  # [Chen2013] (5): as printed


def in_metres() -> float:
    """What (4) takes off at 1 g where a is in m/s² instead of g, beyond what is right, rad/s."""
    return float(dps(0.1) * (g(1.0) - 1.0))


def one_number_for_a_matrix(seed: int) -> tuple[float, float]:
    """What is left of a drawn unit's g-sensitivity on its six faces, rms, rad/s, by 0.1 a and by its own matrix."""
    from plumbob.simulation import draw_module

    unit = draw_module("mpu3050", seed).gyr
    assert unit is not None
    faces = g(1.0) * np.concatenate((np.eye(3), -np.eye(3)))
    drift = faces @ unit.g_sensitivity.T
    number = chen2013().compensate(drift, np.full(6, WARM[0]), faces)
    matrix = GyroDrift(g_sensitivity=unit.g_sensitivity).compensate(drift, None, faces)
    return float(np.sqrt(np.mean(number**2))), float(np.sqrt(np.mean(matrix**2)))


def gain_error(share: float = 0.01) -> tuple[float, float]:
    """What an error of the gain, which (5) takes for zero, costs at 60 °/s, rad/s: before and after the filter."""
    held = np.full((2 * SAMPLES, 1), (1.0 + share) * PEAK)
    t = np.asarray(STEP * np.arange(held.size), dtype=np.float64)
    return share * PEAK, float(scalar_filter(1e-2).smooth(t, held)[-1, 0] - PEAK)


def allan_as_printed(rate: Floats, n: int) -> float:
    """Deviation of samples (N,), n averaged, by (13) to the letter: the mean of η̄² itself, not of its differences."""
    m = rate.size // n
    means = rate[: m * n].reshape(m, n).mean(axis=1)
    return float(np.sqrt(np.sum(means[:-1] ** 2) / (2.0 * (m - 1))))  # [Chen2013] (13): as printed


class PrintedAllan(NamedTuple):
    """Deviations at one sample, rad/s: of white noise by (13) as printed and corrected, and printed with the mean."""

    printed: float
    corrected: float
    with_mean: float


def allan_of_white(seed: int) -> PrintedAllan:
    """Both forms of (13) on white noise of 0.1 °/s, and the printed one where a mean of 1.5 °/s was left in."""
    from plumbob.noise import deviation

    white = at_rest(seed, 10_000.0, flicker=0.0).measured[:, 0]
    return PrintedAllan(
        allan_as_printed(white, 1), float(deviation(white, [1], "adev")[0]), allan_as_printed(white + BIAS, 1)
    )


def axis_in_the_plane(seed: int) -> tuple[float, float]:
    """Mean rate at 60 °/s, °/s, of an axis in the plane of the table, and of one parallel to its axis of rotation."""
    made = simulate(
        scenario("turntable"), frame=Frame.NED, sensors="ideal", unit="calibrated", seed=seed, rate=1.0 / STEP
    )
    assert made.imu.gyr is not None
    held = to_dps(made.imu.gyr[SAMPLES:].mean(axis=0))
    return float(held[0]), float(held[2])
