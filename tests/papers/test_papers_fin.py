"""The fin paper [Ou2017]: its printed forms fail as stated, closed forms hold, records go through bytes and text."""

import math

import numpy as np
import pytest

from plumbob.papers import fin
from plumbob.papers.fin import algorithm, attitude, estimation, experiment, records
from plumbob.papers.workspace import Work
from plumbob.simulation import simulate
from tests.helpers.papers import FIN_SYMBOLS, by_key, english_alone, unmet


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    return Work(tmp_path_factory.mktemp("fin"), 1)


def test_printed_sums_make_white_noise_look_like_quantization():
    """papers 000, misprints of eq 1 and 2: slopes −1.00 and −1.01 instead of −0.503, σ(1 s) 0.045 and 0.041, not 0.966.

    In closed form both are σ = 1/(n √(t0)), 0.0447 at n = 500; 0.041 is one record's.
    """
    white = algorithm.white_by_readings(np.random.default_rng(1), records=4)
    assert white.slope("right") == pytest.approx(-0.5, abs=0.02)
    assert white.at_second("right") == pytest.approx(1.0, abs=3 * 0.04778)  # (7) at 1 s
    for reading in ("moving", "disjoint"):
        assert white.slope(reading) == pytest.approx(-1.0, abs=0.02)
        assert white.at_second(reading) == pytest.approx(math.sqrt(500.0) / 500.0, rel=0.1)


def test_every_sum_is_that_of_the_definition_but_the_printed_one_at_half_of_the_record():
    """Bar of papers 000: 1e-12."""
    rates = np.random.default_rng(1).standard_normal(100)
    assert math.isnan(algorithm.allan_sum(rates, 50, "moving"))
    halves = rates.reshape(2, 50).mean(axis=1)
    assert algorithm.allan_sum(rates, 50) == pytest.approx(abs(halves[1] - halves[0]) / math.sqrt(2.0), rel=1e-12)
    rates = np.random.default_rng(2).standard_normal(5000) + 3.0
    assert algorithm.every_sum(rates, np.arange(1, 2501, 50)) <= 1e-12


def test_the_integrals_of_the_spectra_and_the_slopes_of_rounding():
    """∫ sin⁴u/u² = π/4, ∫ sin⁴u/u³ = ln 2, and sin⁴u/u grows as (3/8) ln u; 0.77 up to Nyquist (papers 000, eq 3)."""
    assert algorithm.white_integral(1e3, 2) == pytest.approx(math.pi / 4.0, rel=1e-3)
    growth = algorithm.white_integral(1e4, 1) - algorithm.white_integral(1e3, 1)
    assert growth == pytest.approx(0.375 * math.log(10.0), rel=1e-3)
    assert algorithm.white_integral(1e3, 3) == pytest.approx(math.log(2.0), rel=1e-4)
    assert algorithm.quantisation_integral(0.002, math.sqrt(3.0), 250.0) == pytest.approx(0.77, abs=0.005)
    # papers 000, traps: slope −1/2 of a rounded rate (−0.500, −0.498), −1 of a rounded angle
    found = algorithm.slopes(np.random.default_rng(3))
    assert (found.rate, found.rate_at_second) == (pytest.approx(-0.5, abs=0.02), pytest.approx(1.0, abs=0.1))
    assert found.angle == pytest.approx(-1.0, abs=0.02)


def test_all_bars_of_the_algorithm(work):
    """Percentages of Table 1 and their T, units, integrals, sums: as papers 000 states them."""
    report, outcomes = algorithm.part(work, lambda _: None, 12)
    assert unmet(outcomes) == set()
    by = by_key(outcomes)
    assert by["eq7"].faithful == pytest.approx(6.2989, abs=1e-4)
    assert by["interval.B.453z"].faithful == pytest.approx(1.7321, abs=5e-5)
    assert english_alone(report, FIN_SYMBOLS) == set()


def test_words_of_the_chips(work):
    """papers 000, chain traps: 0xFFFF is −0.0125 °/s, and 819.2 °/s where its sign is not looked at."""
    assert fin.word(work.folder, "s16") == pytest.approx(-0.0125)
    assert fin.word(work.folder, "u16") == pytest.approx(819.1875)
    report, outcomes = fin.system(work, records.COUNT)
    assert unmet(outcomes) == set()
    assert english_alone(report, FIN_SYMBOLS) == set()


def test_angles_of_swimming_diverge_per_axis_behind_a_high_pass_and_where_rates_are_clipped(work):
    """papers 000, attitude traps: 3351° of pitch and 1219° of yaw; coning at most 1e-3°."""
    free = attitude.without_noise()
    assert attitude.largest(free.axis)["pitch"] == pytest.approx(3351.0, abs=0.5)
    assert attitude.largest(free.axis)["yaw"] == pytest.approx(1219.0, abs=0.5)
    assert max(attitude.largest(free.quaternion).values()) < 5e-4 and attitude.coning() <= 1e-3
    # papers 000: peaks of 126 and 121 °/s at 1 Hz; a turn of 90° and a hold read 0.00° behind 0.011 Hz
    cut = by_key(attitude.clipping(work)[1])
    assert [cut[f"clip.peak.{axis}"].faithful for axis in "xy"] == pytest.approx([126.0, 121.0], abs=0.5)
    assert cut["clip.missed"].best == 0
    assert cut["clip.share"].best > 30.0
    assert attitude.turned_without_noise(0.011) == pytest.approx(0.0, abs=0.005)


def test_records_keep_their_values_through_bytes_and_text(work):
    """What the frame rounds to 1/200 and 1/80 °/s, and nothing else."""
    rates = records.drawn(records.THREE, np.random.default_rng(4), 10_000)
    again = records.drawn(records.THREE, np.random.default_rng(4), 10_000)
    assert np.array_equal(rates, again)  # the same seed draws the same bits
    found = records.analysed(records.sent(work, "short", rates).recording)
    assert found.lost == 0.0
    assert [a.curve.n.size for a in found.noise.analyses] == [5000] * 3
    report, outcomes = experiment.part(dict.fromkeys(("table", "parts", "three"), found))
    assert unmet(outcomes) == {"allan.n"}  # of a shorter record
    assert english_alone(report, FIN_SYMBOLS) == set()


def test_estimators_on_a_few_records(work):
    """Least squares and likelihood find Q and N to a percent; the paper's lines do not."""
    report, outcomes = estimation.part(work, lambda _: None, 6, long=False)
    by = by_key(outcomes)
    assert max(by["three.Q.bias"].best, by["three.N.bias"].best) < 1.0
    assert min(by["three.Q.bias"].faithful, by["three.N.bias"].faithful) > 5.0
    assert english_alone(report, FIN_SYMBOLS) == set()


def test_angles_error_by_term_and_temperature_warms_one_unit_up():
    """N √t and 0.664 B t of 15.066 °/h at 1 s and 57.056 °/h over 220 s: 15.066/3600 √220 and 57.056/3600 · 220."""
    found = experiment.angle_errors(records.TABLE_1, 2)
    assert found["N"] == pytest.approx(15.066 / 3600.0 * math.sqrt(220.0))
    assert found["B"] == pytest.approx(57.056 / 3600.0 * 220.0)
    # A unit with an assumed bias per kelvin reads it: 15 K (1 − e^(−220/120)) at the end
    unit = attitude.fin_unit(1)
    assert unit.gyr is not None
    made = simulate(
        "static", frame="NED", sensors=unit, unit="random", seed=1, duration=220.0, warm_up=attitude.WARM_UP
    )
    assert made.imu.temp_c[-1] - 25.0 == pytest.approx(15.0 * (1.0 - math.exp(-220.0 / 120.0)), abs=0.01)
