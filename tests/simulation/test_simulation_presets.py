"""Presets: every figure has its unit, source and mark, the numbers are the survey's, and modules stay within them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plumbob.core.constants import G0
from plumbob.core.units import UNITS, unit
from plumbob.simulation import TriadErrors, draw_module, preset, preset_names
from plumbob.simulation.errors import measure
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


COUNT, RATE = 4000, 100.0
RNG = np.random.default_rng(11)
TRUTH = np.cumsum(RNG.normal(size=(COUNT, 3)), axis=0) * 0.01
FORCE = RNG.normal(size=(COUNT, 3))
WARM = 25.0 + 20.0 * np.linspace(0.0, 1.0, COUNT)
EVERYTHING = {
    "white_rpsd": 0.01, "white_sd": (0.02, 0.0, 0.03), "flicker": 0.05, "walk_rpsd": 0.02, "ramp": 1e-3,
    "bias": (0.3, -0.2, 0.1), "bias_per_k": (0.01, 0.0, -0.02), "g_sensitivity": RNG.normal(size=(3, 3)) * 0.01,
}  # fmt: skip


def readings(errors, truth=TRUTH, triad="gyr", seed=4):
    return measure(errors, truth, triad=triad, seed=seed, rate=RATE, temp_c=WARM, force_b=FORCE)


@pytest.mark.parametrize("name", [name for name in EVERYTHING if not name.startswith("white")])
def test_switching_one_error_off_leaves_the_others_as_they_are(name):
    with_it = readings(TriadErrors(**EVERYTHING)).values
    without = readings(TriadErrors(**{k: v for k, v in EVERYTHING.items() if k != name})).values
    alone = readings(TriadErrors(**{name: EVERYTHING[name]})).values - TRUTH
    # additive errors of independent streams: the difference is the error on its own, to rounding
    np.testing.assert_allclose(with_it - without, alone, atol=1e-13)
    assert np.abs(alone).max() > 1e-3


def test_white_noise_is_the_same_draw_whatever_else_is_on_and_another_for_triads_and_seeds():
    quiet = {k: v for k, v in EVERYTHING.items() if not k.startswith("white")}
    loud = {**quiet, "white_rpsd": 0.01}
    difference = readings(TriadErrors(**loud)).values - readings(TriadErrors(**quiet)).values
    np.testing.assert_allclose(difference, readings(TriadErrors(white_rpsd=0.01)).values - TRUTH, atol=1e-13)
    e = TriadErrors(white_rpsd=1.0)
    draws = [readings(e, 0.0 * TRUTH, t, s).values[:, 0] for t, s in (("gyr", 1), ("acc", 1), ("mag", 1), ("gyr", 2))]
    correlation = np.corrcoef(draws) - np.eye(4)
    assert np.abs(correlation).max() < 4.5 / np.sqrt(COUNT)  # sd 1/√N each; the largest of six pairs


def test_one_sample_scatters_by_density_times_root_rate_and_by_a_step_over_root_twelve():
    white = readings(TriadErrors(white_rpsd=0.01), 0.0 * TRUTH).values
    # N √rate; a standard deviation of n normal numbers scatters by 1/√(2n)
    np.testing.assert_allclose(white.std(axis=0), 0.01 * np.sqrt(RATE), rtol=4.0 / np.sqrt(2.0 * COUNT))
    both = readings(TriadErrors(white_rpsd=0.03, white_sd=0.4), 0.0 * TRUTH).values
    np.testing.assert_allclose(both.std(axis=0), 0.5, rtol=4.0 / np.sqrt(2.0 * COUNT))  # 3-4-5: √(0.3² + 0.4²)
    assert not readings(TriadErrors(walk_rpsd=1.0), 0.0 * TRUTH).values[0].any()  # from which a walk begins
    step = np.array([0.1, 0.02, 0.0])
    error = readings(TriadErrors(lsb=step), TRUTH * 37.0).values - TRUTH * 37.0
    # a uniform error of one step: variance step²/12, and the standard deviation found scatters by ½ √(0.8/n)
    np.testing.assert_allclose(error.std(axis=0), step / np.sqrt(12.0), rtol=4.0 * 0.5 * np.sqrt(0.8 / COUNT))
    assert (np.abs(error).max(axis=0) <= 0.5 * step + 1e-12).all()


def test_range_clips_each_axis_at_its_own_end():
    full = np.array([0.1, 0.2, np.inf])
    found = readings(TriadErrors(full_scale=full))
    np.testing.assert_array_equal(found.values, np.clip(TRUTH, -full, full))
    np.testing.assert_array_equal(found.clipped, np.abs(TRUTH) >= full)
    assert found.clipped[:, :2].any(axis=0).all()
    at_the_end = readings(TriadErrors(full_scale=1.0), np.tile([1.0, -1.0, 0.99], (COUNT, 1)))
    np.testing.assert_array_equal(at_the_end.clipped[0], [True, True, False])
    assert np.abs(readings(TriadErrors(full_scale=0.1, white_rpsd=1.0, lsb=0.03)).values).max() == 0.1


def test_scale_misalignment_and_iron_follow_their_equation():
    m, w = np.array([[0, 0.01, -0.02], [0.03, 0, 0.01], [0, 0.02, 0]]), np.eye(3) + 0.1 * RNG.normal(size=(3, 3))
    gain, h, b = np.array([0.02, -0.01, 0.03]), np.array([8.0, -5.0, 3.0]), np.array([0.4, 0.5, 0.6])
    found = readings(TriadErrors(scale=gain, misalignment=m, soft_iron=w, hard_iron=h, bias=b))
    for i in (0, 17, COUNT - 1):  # one row at a time: G (I + M) (W x + h) + b
        np.testing.assert_allclose(
            found.values[i], np.diag(1.0 + gain) @ ((np.eye(3) + m) @ (w @ TRUTH[i] + h)) + b, atol=1e-12
        )


def test_temperature_and_force_change_the_bias_that_is_told_which_is_all_but_white_noise():
    e = TriadErrors(bias=1.0, bias_per_k=0.1, scale=0.05, scale_per_k=1e-3, temp_ref_c=30.0)
    found = readings(e)
    dt = (WARM - 30.0)[:, np.newaxis]
    np.testing.assert_allclose(found.values, (1.05 + 1e-3 * dt) * TRUTH + 1.0 + 0.1 * dt, atol=1e-12)
    np.testing.assert_allclose(found.bias, np.tile(1.0 + 0.1 * dt, (1, 3)), atol=1e-12)
    s = RNG.normal(size=(3, 3))
    found = readings(TriadErrors(g_sensitivity=s))
    np.testing.assert_allclose(found.values - TRUTH, FORCE @ s.T, atol=1e-12)
    np.testing.assert_allclose(found.bias, FORCE @ s.T, atol=1e-12)
    e = TriadErrors(**EVERYTHING)
    found = readings(e)
    white = readings(TriadErrors(white_rpsd=0.01, white_sd=(0.02, 0.0, 0.03))).values - TRUTH
    np.testing.assert_allclose(found.values - TRUTH - white, found.bias, atol=1e-13)


def test_a_calibrated_triad_keeps_noise_range_and_rate_only():
    e = TriadErrors(**EVERYTHING, scale=0.1, soft_iron=2.0 * np.eye(3), hard_iron=5.0, lsb=0.01, full_scale=9.0,
                    latency=0.01, rate=20.0, high_pass=CORNER)  # fmt: skip
    c = e.calibrated()
    np.testing.assert_array_equal(c.response, np.eye(3))
    for gone in ("bias", "bias_per_k", "scale", "hard_iron", "g_sensitivity", "latency", "iron"):
        assert not getattr(c, gone).any(), gone
    for kept in ("white_rpsd", "white_sd", "flicker", "walk_rpsd", "ramp", "lsb", "full_scale", "rate", "high_pass"):
        np.testing.assert_array_equal(getattr(c, kept), getattr(e, kept))


def test_noise_card_gives_the_density_at_the_rate_of_the_triad_and_errors_cannot_be_changed():
    card = TriadErrors(white_rpsd=0.03, white_sd=0.4, flicker=0.2, walk_rpsd=0.1).noise_card(100.0)
    np.testing.assert_allclose(card.n_rpsd, 0.05)  # √(0.03² + (0.4/√100)²)
    np.testing.assert_allclose(card.b, 0.2)
    np.testing.assert_allclose(card.k_rpsd, 0.1)
    slower = TriadErrors(white_sd=0.4, rate=25.0).noise_card(100.0)
    np.testing.assert_allclose(slower.n_rpsd, 0.4 / 5.0)  # its own 25 Hz count
    e = TriadErrors(bias=0.1)
    with pytest.raises(ValueError, match="read-only"):
        e.bias[0] = 1.0
    np.testing.assert_array_equal(replace(e, scale=0.1).bias, [0.1, 0.1, 0.1])


CORNER = 0.5


def high_passed(truth, **more):
    return readings(TriadErrors(high_pass=CORNER, **more), truth)


def test_a_step_behind_a_high_pass_decays_with_its_corner_and_what_is_steady_is_gone():
    """A first-order high-pass answers a step by exp(-2π f t)."""
    step = np.zeros_like(TRUTH)
    step[1000:] = (1.0, -2.0, 3.0)
    t = np.arange(COUNT - 1000) / RATE
    found = high_passed(step).values
    assert not found[:1000].any()
    np.testing.assert_allclose(found[1000:], np.exp(-2.0 * np.pi * CORNER * t)[:, np.newaxis] * step[-1], atol=1e-12)
    still = np.full_like(TRUTH, 0.7)
    found = measure(
        TriadErrors(high_pass=CORNER, bias=0.3, bias_per_k=0.01), still, triad="gyr", seed=1, rate=RATE,
        temp_c=np.full(COUNT, 40.0), force_b=FORCE,
    )  # fmt: skip
    assert np.abs(found.values).max() < 1e-12 and np.abs(found.bias).max() < 1e-12
    card = TriadErrors(high_pass=CORNER, bias=0.3, bias_per_k=0.01, scale=0.1).card("rad/s")
    assert not card.bias.any() and not card.bias_per_k.any()
    np.testing.assert_allclose(np.diag(card.matrix), 1.0 / 1.1)


def test_white_noise_behind_a_high_pass_falls_with_one_over_tau():
    """Its integral is a first-order process of variance N²/(2 ω): far beyond 1/ω, σ(τ) = N √(3/(2 ω)) / τ."""
    count, n = 200_000, 0.01
    found = measure(
        TriadErrors(high_pass=CORNER, white_rpsd=n), np.zeros((count, 3)), triad="gyr", seed=1, rate=RATE,
        temp_c=np.full(count, 25.0), force_b=np.zeros((count, 3)),
    ).values  # fmt: skip
    theta = np.vstack((np.zeros(3), np.cumsum(found, axis=0))) / RATE
    m = int(20.0 * RATE)
    second = theta[2 * m :] - 2.0 * theta[m:-m] + theta[: -2 * m]
    sigma = np.sqrt(0.5 * (second**2).mean()) / 20.0
    assert sigma == pytest.approx(n * np.sqrt(3.0 / (4.0 * np.pi * CORNER)) / 20.0, rel=0.05)
