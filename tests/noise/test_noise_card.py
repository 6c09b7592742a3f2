"""The noise card: what it holds, what it leaves out, and that simulator and filters take it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plumbob import Filter, Frame, NoiseCard
from plumbob.core.errors import ShapeError, UnitError
from plumbob.core.units import Quantity, to_si
from plumbob.filters import mekf
from plumbob.noise.card import card_report, noise_card
from plumbob.noise.findings import Coefficient, Estimates, Mask
from plumbob.simulation.errors import TriadErrors


def hide(analysis, letter, **fields):
    hidden = Coefficient(analysis.terms[letter].value, observable=False, **fields)
    return replace(analysis, likelihood=Estimates("likelihood", {**analysis.terms, letter: hidden}))


def test_it_holds_the_coefficients_in_inside_units(analyses):
    card = noise_card(analyses, device="unit 7", source="static.parquet")
    assert card.device == "unit 7"
    # planted: N 0.3 °/√h, K 20 °/h/√h, B 60 µg, times 1, 1.1 and 0.9 for x, y and z
    factors = np.array([1.0, 1.1, 0.9])
    np.testing.assert_allclose(card.gyr.n_rpsd, np.radians(0.3) / 60.0 * factors, rtol=1e-12)
    np.testing.assert_allclose(card.gyr.k_rpsd, np.radians(20.0) / 3600.0 / 60.0 * factors, rtol=1e-12)
    np.testing.assert_allclose(card.acc.b, 60e-6 * 9.80665 * factors, rtol=1e-12)
    assert card.mag is None
    assert card.source == (
        "static.parquet; gyr from 3.3 min at 100 Hz, 20000 samples; acc from 3.3 min at 100 Hz, 20000 samples"
    )


def test_it_comes_with_its_intervals(plain, tmp_path):
    card = noise_card(plain, device="unit 7", source="static")
    card.save(tmp_path / "noise.json")
    again = NoiseCard.load(tmp_path / "noise.json").gyr
    for letter, ends in zip("NBK", (again.n_interval, again.b_interval, again.k_interval), strict=True):
        assert ends.T.tolist() == [[a.terms[letter].lo, a.terms[letter].hi] for a in plain]
    assert "68.3 %" in card_report(card).text()


def test_what_is_not_observable_is_as_likely_and_its_limit_is_told(plain):
    hidden = hide(plain[1], "K", upper=to_si(31.0, "deg/h/rth"))
    hidden = hide(hidden, "N")
    likely = replace(hidden, most_likely={"K": 1.5e-6})
    assert noise_card([plain[0], likely, plain[2]], device="d", source="s").gyr.k_rpsd[1] == 1.5e-6
    card = noise_card([plain[0], hidden, plain[2]], device="d", source="s")
    assert card.gyr.k_rpsd[1] == 0.0
    assert card.gyr.k_rpsd[0] == plain[0].terms["K"].value
    assert card.gyr.n_rpsd[1] == plain[1].terms["N"].value  # N is taken as estimated
    assert "gyr K not observable, the most likely is taken: y < 31 °/h/√h (95 %)" in card.source


def test_a_card_needs_the_white_noise_of_every_axis(plain):
    smooth = replace(plain[1], likelihood=Estimates("likelihood", {}), mask=Mask(9, 1.0, "it looks smoothed"))
    with pytest.raises(ShapeError, match=r"white noise of gyr y is not known \(it looks smoothed\)"):
        noise_card([plain[0], smooth, plain[2]], device="d", source="s")


def test_what_is_no_triad_is_left_out_with_a_word(analyses, bare):
    card = noise_card([*analyses[:5], bare], device="d", source="s")
    assert card.acc is None
    assert card.source.endswith("left out, no triad of three axes: acc xy, column")
    with pytest.raises(ShapeError, match=r"needs x, y and z of gyr, acc or mag, but there are acc xy\."):
        noise_card(analyses[3:5], device="d", source="s")


def test_bare_numbers_are_refused(plain):
    unscaled = [replace(a, quantity=Quantity.RATIO) for a in plain]
    with pytest.raises(UnitError, match="gyr is in '1', but a card holds rad/s; scale the recording"):
        noise_card(unscaled, device="d", source="s")


def test_the_file_comes_back(tmp_path, analyses):
    card = noise_card(analyses, device="unit 7", source="static.parquet")
    card.save(tmp_path / "noise.json")
    back = NoiseCard.load(tmp_path / "noise.json")
    assert (back.device, back.source) == (card.device, card.source)
    for triad in ("gyr", "acc"):
        for name in ("n_rpsd", "b", "k_rpsd"):
            assert np.array_equal(getattr(getattr(back, triad), name), getattr(getattr(card, triad), name))


def test_the_simulator_and_the_kalman_filter_take_it(plain):
    card = noise_card(plain, device="unit 7", source="static.parquet")
    errors = TriadErrors(white_rpsd=card.gyr.n_rpsd, flicker=card.gyr.b, walk_rpsd=card.gyr.k_rpsd)
    assert np.array_equal(errors.noise_card(100.0).n_rpsd, card.gyr.n_rpsd)
    assert Filter("mekf", frame=Frame.ENU, noise=card).params.gyr_noise == card.gyr.n_rms
    # the quadratic mean of 1, 1.1 and 0.9
    assert math.isclose(mekf.from_noise(card)["gyr_walk"], plain[0].terms["K"].value * math.sqrt(3.02 / 3.0))


def test_a_walk_that_no_axis_shows_leaves_the_filter_its_default(plain):
    card = noise_card([hide(a, "K", upper=1.0) for a in plain], device="unit 7", source="static.parquet")
    assert Filter("mekf", frame=Frame.ENU, noise=card).params.gyr_walk == mekf.Params().gyr_walk
