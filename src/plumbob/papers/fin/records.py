"""Static records of the fin paper: three visible regimes, its Table 1 as a unit, and what rates go through on the way.

Quantisation noise Q is that of an *angle* which is read with a white error of standard deviation Q and differenced: the
rate then has the density (2πf)²Q²t0 [Ou2017] (3). A frame's own rounding of the rate is something else, and does not
make it. So these records are drawn here, and sent in the rig's frames.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import to_si
from plumbob.data import ImuData
from plumbob.door.allan import allan
from plumbob.files import write
from plumbob.noise.allan import Noise
from plumbob.papers.fin.datasheet import TABLE
from plumbob.papers.workspace import Taken, Work, recorded_samples
from plumbob.simulation import errors, simulate

RATE: Final = 500.0
"""Samples per second [Ou2017] (step 8), Hz."""
COUNT: Final = 110_000
"""Samples of its record."""
LENGTH: Final = COUNT / RATE
"""s."""
AXES: Final = ("ADXRS290 x", "ADXRS290 y", "ADXRS453 z")
SIGMA: Final = 0.664
"""What the printed flat is divided by for B: √(2 ln 2/π) to three digits."""


class TrueCoefficients(NamedTuple):
    """Coefficients of three axes: Q, rad; N, rad/√s; B, rad/s."""

    Q: Floats
    N: Floats
    B: Floats


def truth(q_arcsec: Floats | float, n_deg_rth: Floats | float, b_deg_h: Floats | float) -> TrueCoefficients:
    """Coefficients in the units of a data sheet; one number stands for all axes."""
    given = ((q_arcsec, "arcsec"), (n_deg_rth, "deg/rth"), (b_deg_h, "deg/h"))
    return TrueCoefficients(*(to_si(1.0, name) * np.broadcast_to(np.asarray(value, float), 3) for value, name in given))


THREE: Final = truth(4.4, 0.9, 51.5)
"""Three regimes that 220 s show on every axis."""


def printed(letter: str) -> Floats:
    """Values (3,) of Table 1 as printed, for x, y and z."""
    return np.array([float(entry.value) for entry in TABLE if entry.letter == letter])


TABLE_1: Final = truth(printed("Q"), printed("N") / 60.0, printed("B") / SIGMA)
"""A unit with the coefficients of Table 1, in the units that fit: seconds of arc, °/h at 1 s, a flat in °/h."""


def drawn(
    of: TrueCoefficients, rng: np.random.Generator, count: int = COUNT, rate: float = RATE, past: int = 3
) -> Floats:
    """Rates (count, 3) of a unit at rest, rad/s: differenced angle noise, white noise, and flicker.

    Flicker starts from nothing, so it has run for `past` records before.
    """
    angle = of.Q * rng.standard_normal((count + 1, 3))
    flicker = errors.flicker(of.B, (past + 1) * count, rng)[past * count :]
    white = errors.white(errors.white_sd(of.N, rate), count, rng)
    return np.asarray(rate * np.diff(angle, axis=0) + white + flicker)


def sent(work: Work, name: str, rates: Floats) -> Taken:
    """Send rates (N, 3), rad/s, of a unit at rest in the fin's frames, and record the bytes."""
    how: dict[str, Any] = {"sensors": "ideal", "unit": "calibrated", "rate": RATE, "duration": len(rates) / RATE}
    still = simulate("static", frame="NED", seed=work.seed, **how)
    return work.sent("fin", name, replace(still, imu=still.imu.corrected(meta=still.imu.meta, gyr=rates)))


@dataclass(frozen=True, eq=False, slots=True)
class Analysed:
    """A static record that went through bytes and text.

    `noise`: its analysis, with every averaging factor; `lost`: largest difference of a rate that was read back from
    the text, rad/s; `text`: the text.
    """

    noise: Noise
    lost: float
    text: Path


def analysed(recording: Path) -> Analysed:
    """Rates of a recording's bytes, stored as TXT, read back, and analysed at every n [Ou2017] (steps 1 to 8)."""
    imu = recorded_samples(recording)
    text = recording.with_suffix(".txt")
    write(text, imu, overwrite=True)
    back = recorded_samples(text)
    return Analysed(allan(text, taus="all"), float(np.max(np.abs(gyr_rates(back) - gyr_rates(imu)))), text)


def gyr_rates(imu: ImuData) -> Floats:
    """Rates (N, 3), rad/s."""
    assert imu.gyr is not None
    return np.asarray(imu.gyr)
