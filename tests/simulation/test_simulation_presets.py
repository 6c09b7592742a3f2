"""Presets: every figure has its unit, source and mark, the numbers are the survey's, and modules stay within them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plumbob.core.constants import G0
from plumbob.core.units import UNITS, unit
from plumbob.simulation import draw_module, preset, preset_names
from plumbob.simulation.presets import ANGLES, FIGURES, MARKS, DataSheetFigure

DEG = math.pi / 180.0


def si(name, triad, figure):
    return preset(name).triads[triad].figures[figure].si


@pytest.fixture(scope="module")
def drawn():
    return [draw_module("mpu6000+hmc5983", seed) for seed in range(300)]


@pytest.mark.parametrize("name", preset_names())
def test_every_figure_has_value_unit_source_and_mark(name):
    for figure, entry in (item for sheet in preset(name).triads.values() for item in sheet.figures.items()):
        assert figure in FIGURES
        assert entry.mark in MARKS
        assert preset(name).sources[entry.source].strip()
        assert (entry.si > 0.0).all() and np.isfinite(entry.si).all()
        numerator, *denominators = entry.unit.split(" per ")
        assert unit(numerator) in UNITS.values()
        assert all(d in {"rtHz", "rth"} or unit(d) in UNITS.values() for d in denominators)
        # a figure that nobody has read somewhere says so
        assert (entry.mark == "UNVERIFIED") == (entry.source in {"MEMORY", "BUOY", "ASSUMED", "DS-5883"})


@pytest.mark.parametrize(("name", "triad", "figure", "expected", "mark"), [
    # public projects that quote the data sheets, each in their own unit
    ("bmi088", "acc", "noise_density", (160e-6 * G0, 160e-6 * G0, 190e-6 * G0), "V1"),
    ("lis3mdl", "mag", "noise_sample", (0.32, 0.32, 0.41), "V1"),
    ("adis16470", "gyr", "bias_instability", 8 * DEG / 3600, "V1"),
    # survey of sensor noise, section 12, each in the survey's own unit
    ("adxrs290", "gyr", "scale_tolerance", 0.12, "UNVERIFIED"),
    ("adxrs453", "gyr", "g_sensitivity", 0.01 * DEG / G0, "V"),
    ("adxrs453", "gyr", "vibration_rectification", 0.0002 * DEG / G0**2, "V"),
    ("mpu6000", "gyr", "counts", 131.0 / DEG, "V"),
    ("mpu6000", "acc", "null_offset", np.array([0.05, 0.05, 0.08]) * G0, "V"),
    ("mpu6000", "acc", "scale_tempco", 2e-4, "V"),
    ("adis16355", "gyr", "bias_tempco", 0.01 * DEG, "V"),
    ("adis16355", "acc", "lsb", 2.522e-3 * G0, "V"),
    ("adis16355:allan", "gyr", "noise_density", 0.07 * DEG, "V"),  # 4.2 °/√h, "= 0.07" in the survey
    ("hmc5983", "mag", "noise_sample", 0.2, "V"),  # 2 mGa, 1 Ga = 100 µT
    ("hmc5983", "mag", "hard_iron", 8.0, "UNVERIFIED"),
    # page of the teaching-arm paper, noise that reproduces its tables: ±0.13 °/s at rest, ±0.25 °/s in the turn
    ("arm:rest", "gyr", "null_offset", 0.13 * DEG, "UNVERIFIED"),
    ("arm:turn", "gyr", "null_offset", 0.25 * DEG, "UNVERIFIED"),
])  # fmt: skip
def test_figures_are_those_of_the_survey(name, triad, figure, expected, mark):
    np.testing.assert_allclose(si(name, triad, figure), np.broadcast_to(expected, 3), rtol=1e-12)
    assert preset(name).triads[triad].figures[figure].mark == mark


def test_two_gyroscopes_make_one_triad_however_they_are_spelt_and_allan_is_a_variant():
    # survey: 2.0 m/s/√h = 3.4 mg/√Hz, two digits
    assert si("adis16355:allan", "acc", "noise_density")[0] / (1e-3 * G0) == pytest.approx(3.4, abs=0.05)
    assert [preset(name).name for name in ("mpu6050", "adis16355")] == ["mpu6000", "adis16355:density"]
    module = draw_module("adxrs290 + adxrs453", 3)
    assert module.name == "adxrs290+adxrs453"
    np.testing.assert_allclose(module.gyr.full_scale / DEG, [100.0, 100.0, 300.0])
    np.testing.assert_allclose(module.gyr.white_rpsd / DEG, [0.004, 0.004, 0.015])
    np.testing.assert_allclose(module.gyr.flicker / DEG * 3600.0, [0.0, 0.0, 16.0])
    assert module.acc is None and module.mag is None


@pytest.mark.parametrize(("sensors", "triad", "axis", "expected"), [
    # survey, row "quantisation sigma", LSB/√12, three digits: °/s for gyroscopes, µT for the magnetometer
    ("adxrs290+adxrs453", "gyr", 0, 0.00144 * DEG),
    ("adxrs290+adxrs453", "gyr", 2, 0.00361 * DEG),
    ("mpu6000", "gyr", 0, 0.00220 * DEG),
    ("mpu3050", "gyr", 1, 0.00220 * DEG),
    ("adis16355", "gyr", 2, 0.0211 * DEG),
    ("hmc5983", "mag", 0, 0.0265),
])  # fmt: skip
def test_quantisation_is_that_of_the_survey(sensors, triad, axis, expected):
    lsb = getattr(draw_module(sensors, 1), triad).lsb
    assert lsb[axis] / math.sqrt(12.0) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize(("name", "heading", "tilt", "mark"), [
    ("dcm260b", 0.8, 0.2, "V1"),  # [Yu2018] section 4: heading 0.8°, roll and pitch 0.2°, at rest
    ("ahrs500ga", 0.2, 0.03, "UNVERIFIED"),  # [Li2012] section 3.1 claims 0.2° and 0.03° RMS
])  # fmt: skip
def test_references_have_the_accuracy_that_the_papers_state(name, heading, tilt, mark):
    assert {figure.mark for figure in preset(name).attitude.values()} == {mark}
    assert set(preset(name).attitude) == set(ANGLES)
    module = draw_module(name, 1)
    assert (module.attitude.heading, module.attitude.tilt) == pytest.approx((heading * DEG, tilt * DEG), rel=1e-12)
    assert module.calibrated().attitude == module.attitude
    assert ("attitude.heading" in module.source) == (mark == "UNVERIFIED")
    assert draw_module("mpu6000", 1).attitude is None


def test_ideal_has_no_errors_delays_are_those_of_the_filters_and_turned_triads_stay_orthogonal():
    module = draw_module("ideal", 1)
    for triad in (module.gyr, module.acc, module.mag):
        np.testing.assert_array_equal(triad.response, np.eye(3))
        assert not any(getattr(triad, name).any() for name in ("white_rpsd", "white_sd", "flicker", "bias", "lsb"))
        assert np.isinf(triad.full_scale).all()
    # survey: MPU-6000 with DLPF 2, gyroscope 2.8 ms, accelerometer 3.0 ms; ADXRS453 4 ms, ADXRS290 not given
    module = draw_module("mpu6000", 1)
    np.testing.assert_allclose(module.gyr.latency, 2.8e-3)
    np.testing.assert_allclose(module.acc.latency, 3.0e-3)
    np.testing.assert_allclose(draw_module("adxrs290+adxrs453", 1).gyr.latency, [0.0, 0.0, 4e-3])
    for seed in range(50):
        m = draw_module("adis16355", seed).gyr.misalignment
        symmetric = 0.5 * (m + m.T)
        # survey: misalignment 0.5°, non-orthogonality 0.05°; the antisymmetric part is a turn, the symmetric one a skew
        assert np.abs(m - symmetric).max() <= (0.5 + 0.05) * DEG
        assert np.abs(symmetric).max() <= 0.05 * DEG


def test_drawn_errors_and_pick_up_between_axes_fill_the_sheet_s_limits_evenly(drawn):
    limits = {
        ("acc", "bias"): np.array([0.05, 0.05, 0.08]) * G0, ("gyr", "bias"): 20.0 * DEG, ("gyr", "scale"): 0.03,
        ("mag", "hard_iron"): 8.0,
    }  # fmt: skip
    for (triad, name), limit in limits.items():
        values = np.array([getattr(getattr(m, triad), name) for m in drawn]) / limit
        assert np.abs(values).max() <= 1.0
        # uniform on ±1: standard deviation 1/√3, which scatters by ½ √(0.8/n); mean 0 ± 1/√(3n)
        np.testing.assert_allclose(values.std(axis=0), 1.0 / math.sqrt(3.0), rtol=4.0 * 0.5 * math.sqrt(0.8 / 300))
        np.testing.assert_allclose(values.mean(axis=0), 0.0, atol=4.0 / math.sqrt(3.0 * 300))
    m = np.array([module.gyr.misalignment for module in drawn])[:, ~np.eye(3, dtype=bool)]
    assert np.abs(m).max() <= 0.02  # survey: ±2 %
    np.testing.assert_allclose(m.std(), 0.02 / math.sqrt(3.0), rtol=4.0 * 0.5 * math.sqrt(0.8 / m.size))  # uniform


def test_a_unit_is_its_seed_its_magnetometer_can_sample_faster_and_figures_divide_units():
    alone, joined, other = draw_module("mpu6000", 5), draw_module("hmc5983+mpu6000", 5), draw_module("mpu6000", 6)
    np.testing.assert_array_equal(alone.gyr.bias, joined.gyr.bias)
    np.testing.assert_array_equal(alone.acc.misalignment, joined.acc.misalignment)
    assert (alone.gyr.bias != other.gyr.bias).all()
    module = draw_module("hmc5983", 1)
    assert module.mag.rate == 75.0  # of the rates in the survey
    assert module.with_mag_rate(220.0).mag.rate == 220.0
    assert draw_module("mpu6000", 1).with_mag_rate(10.0).mag is None
    rate = DataSheetFigure(3.0, "deg/s per g per g", "x", "V")
    np.testing.assert_allclose(rate.si, 3.0 * DEG / G0**2)
    np.testing.assert_allclose(replace(rate, unit="deg per rth").si, 3.0 * DEG / 60.0)  # √3600 s = 60 √s
    np.testing.assert_allclose(replace(rate, unit="1 per gauss").si, 0.03)
