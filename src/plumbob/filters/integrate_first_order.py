"""Gyroscope integration of first order: the buoy paper's quaternion update, without any correction.

This is not a filter to use but one to compare with. After normalising, each step turns by ``2 atan(ωΔt/2)`` instead of
``ωΔt``, so a constant rate comes out slow by about ``ω³Δt²/12``: at 100 Hz 0.013 °/s at 172 °/s and 20 °/s at 2000 °/s.

Departures from [Yu2018]: the indices of its equation (3) are corrected, and q is normalised after every step.
"""

from typing import Final, NamedTuple

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.filters.input_checks import admit
from plumbob.filters.layout import HEADED, STAGE
from plumbob.filters.mahony import integrate
from plumbob.filters.start import initialise

SUMMARY: Final = "gyroscope integration, first order and normalised (drifting-buoy paper)"
REFERENCES: Final = ("Yu2018",)
NEEDS: Final = ("gyr",)
STATE: Final = 0


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
    """Take one sample; accelerometer and magnetometer only give the start."""
    word, dt, gx, gy, gz = admit(c, x, dt, gx, gy, gz)
    integrate(x, dt, gx, gy, gz)  # [Yu2018] (3)
    if x[STAGE] < HEADED:
        word |= initialise(c, x, ax, ay, az, mx, my, mz)
    return word
