"""Tilt and tilt-compensated compass: attitude from accelerometer and magnetometer alone, sample by sample.

No gyroscope and no memory, but for the heading, which stays while the magnetometer is absent. It is right at rest and
as wrong as the acceleration makes it in motion: the reference that shows what a filter gains.

When to choose it: static tests, first look at a calibration, start values.

Departures from [Yu2018]: arctan is atan2, so that all quadrants come out; heading is magnetic unless a declination is
given.
"""

import math
from typing import Final, NamedTuple

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.filters.input_checks import admit, refused, usable
from plumbob.filters.layout import COUNT, HEADED, LEVEL, OWN, STAGE, UP, Q
from plumbob.filters.start import heading_offset, level, turn_about_vertical
from plumbob.rotations.kernels import quat_unit

SUMMARY: Final = "tilt and tilt-compensated compass, no gyroscope (reference estimator)"
REFERENCES: Final = ("Yu2018",)
NEEDS: Final = ("acc",)
STATE: Final = 1

YAW: Final = OWN  # heading kept from the last magnetic sample, rad


class Params(NamedTuple):
    """None of its own."""


def coefficients(params: Params) -> tuple[float, ...]:
    """Own coefficients of the kernel."""
    return ()


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Take one sample."""
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    word &= ~flags.GYR_HELD
    if not usable(ax, ay, az):
        word |= refused(flags.ACC_GATED, ax, ay, az)
        return word | flags.NOT_CONVERGED | flags.HEADING_FREE if x[STAGE] < LEVEL else word
    if x[COUNT] == 1.0:  # a start attitude that was given sets the heading until a magnetic sample comes
        q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
        x[YAW] = math.atan2(2.0 * (q1 * q2 + q0 * q3), q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3)  # [Yu2018] (6)
    x[STAGE] = max(x[STAGE], LEVEL)
    q0, q1, q2, q3 = level(c[UP], ax, ay, az)  # [Yu2018]: the start, at every sample
    headed = False
    if usable(mx, my, mz):
        headed, angle = heading_offset(c, q0, q1, q2, q3, mx, my, mz)
        if headed:
            x[YAW], x[STAGE] = angle, HEADED
    q0, q1, q2, q3 = turn_about_vertical(x[YAW], q0, q1, q2, q3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(q0, q1, q2, q3)
    if not headed:
        word |= refused(flags.MAG_GATED, mx, my, mz)
    return word | flags.HEADING_FREE if x[STAGE] < HEADED else word
