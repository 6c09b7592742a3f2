"""Grades: what the predicted errors of a calibration are called, and from where on it is refused."""

from typing import Final, NamedTuple

from plumbob.units import deg


class Limits(NamedTuple):
    """Largest standard deviation of each grade; beyond the last there is none."""

    good: float
    fair: float
    poor: float


HEADING: Final = Limits(deg(0.5), deg(2.0), deg(5.0))
"""Of a heading, rad: a survey compass, the buoy paper's bar, the buoy paper's claim."""

TILT: Final = Limits(deg(0.1), deg(0.5), deg(2.0))
"""Of an inclination, rad."""

RATE: Final = Limits(deg(0.005), deg(0.05), deg(0.5))
"""Of a gyroscope's bias, rad/s: 0.3° a minute, 3° a minute, a data sheet's offset at turn-on."""

SCALE: Final = Limits(0.002, 0.01, 0.02)
"""Of entries of a gyroscope's matrix; beyond, a data sheet's tolerance of 3 % is not improved on."""


def worst_of(*grades: str | None) -> str:
    """Worst of grades; one beyond all counts as poor."""
    return max((grade or Limits._fields[-1] for grade in grades), key=Limits._fields.index)


def grade_of(sd: float, limits: Limits) -> str | None:
    """Grade of a standard deviation; None where it is beyond all."""
    return next((name for name, limit in zip(Limits._fields, limits, strict=True) if sd <= limit), None)
