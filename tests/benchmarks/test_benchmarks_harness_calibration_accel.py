"""Benchmark of accelerometer calibrations: a few units of it keep its bars, and its figures follow the noise."""

import numpy as np
import pytest

from benchmarks.harness.calibration_accel import CARES, MISALIGNMENT, ROWS, measure_accel
from plumbob.core.units import to_deg

UNITS = 20


@pytest.fixture(scope="module")
def section():
    return measure_accel(range(UNITS))


def figures(section, case, care=CARES[0]):
    return dict(zip(section.columns, section.rows[f"{case}; {care.name}"], strict=True))


def test_the_bars_are_kept(section):
    """A median of 20 scatters by 12 %, and the figures are a fifth below their bars."""
    assert len(section.rows) == len(CARES) * len(ROWS)
    assert [bar.name for bar in section.bars if not bar.met] == []
    told = {bar.name.rpartition(": ")[2] for bar in section.bars}
    assert told == {"bias, mg", "length, mg", "direction, °", "within 1 sd, %"}


def test_errors_grow_with_noise_and_shrink_with_poses(section):
    """Twelve times the noise; medians of 20 each, of the same draws."""
    for case in ("18 positions, 9 parameters", "26 positions, 9 parameters"):
        few, many = (figures(section, case, care) for care in CARES)
        for column in ("bias, mg", "predicted, °"):
            assert many[column] / few[column] == pytest.approx(12.0, rel=0.3)
    nine, most = (figures(section, f"{count} positions, 9 parameters")["length, mg"] for count in (9, 26))
    assert nine > 1.5 * most


def test_without_misalignment_directions_are_wrong_by_its_symmetric_part(section):
    """Symmetric entries of the sd s turn directions by √(6/5) s (root mean square over the sphere), s = 0.5°/√3/√2.

    Over units that is nearly distributed as χ of 3 degrees of freedom, whose median is √(2.366/3): 0.2°. 20 scatter by
    11 %.
    """
    found = figures(section, "6 positions, 6 parameters")
    expected = to_deg(MISALIGNMENT) / np.sqrt(6.0) * np.sqrt(1.2) * np.sqrt(2.366 / 3.0)
    assert found["direction, °"] == pytest.approx(expected, rel=0.33)
    assert found["predicted, °"] > found["direction, °"]
