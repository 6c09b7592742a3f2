"""The noise card and Kalibr's file: what they hold, what they leave out or refuse, and that filters take the card."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from plumbob import Filter, Frame, NoiseCard
from plumbob.core.errors import ParameterError, ShapeError, UnitError
from plumbob.core.units import Quantity, to_si
from plumbob.filters import mekf
from plumbob.noise.card import kalibr_yaml, noise_card
from plumbob.noise.findings import Coefficient, Estimates, Mask
from plumbob.reporting.noise import card_report
from plumbob.simulation.errors import TriadErrors


def hide(analysis, letter, **fields):
    hidden = Coefficient(analysis.terms[letter].value, observable=False, **fields)
    return replace(analysis, likelihood=Estimates("likelihood", {**analysis.terms, letter: hidden}))


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


# YAML 1.1 takes a number with exponent for a number only if it has a point and a signed exponent (yaml.org/type/float)
FLOAT = re.compile(r"[-+]?[0-9]+\.[0-9]*([eE][-+][0-9]+)?")


def read(text):
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return dict(line.split(": ") for line in lines)


def with_walk(analysis, **fields):
    terms = {**analysis.terms, "K": Coefficient(**fields)}
    return replace(analysis, likelihood=Estimates("likelihood", terms))


def test_it_holds_the_numbers_that_kalibr_reads_in_si_with_comments_and_limits(analyses):
    values = read(kalibr_yaml(analyses, rostopic="/imu0"))
    assert list(values) == [
        "accelerometer_noise_density", "accelerometer_random_walk", "gyroscope_noise_density",
        "gyroscope_random_walk", "rostopic", "update_rate",
    ]  # fmt: skip
    assert values.pop("rostopic") == "/imu0"
    assert all(FLOAT.fullmatch(v) for v in values.values())
    # planted in x, and 1.1 and 0.9 of it in y and z, whose quadratic mean is √(3.02/3); seven digits are written
    expected = {
        "accelerometer_noise_density": 300e-6 * 9.80665,
        "accelerometer_random_walk": 2e-6 * 9.80665,
        "gyroscope_noise_density": math.radians(0.3) / 60.0,
        "gyroscope_random_walk": math.radians(20.0) / 3600.0 / 60.0,
    }
    assert float(values.pop("update_rate")) == 100.0
    for name, value in expected.items():
        assert math.isclose(float(values[name]), value * math.sqrt(3.02 / 3.0), rel_tol=5e-7)
    text = kalibr_yaml(analyses, rostopic="/imu0", source="static µ.parquet\nrostopic: /evil")
    assert "#   N x: 0.3000 +/- 0.0012 deg/rth" in text
    assert "#   K z: 1.80 +/- 0.63 ug/s/rtHz" in text
    assert "# static ?.parquet rostopic: /evil" in text
    assert text.isascii() and "quadratic mean" in text
    hidden = with_walk(analyses[2], value=1e-9, upper=4e-6, observable=False, hours=7.0)
    text = kalibr_yaml([*analyses[:2], hidden, *analyses[3:]], rostopic="/imu0")
    squares = [analyses[0].terms["K"].value ** 2, analyses[1].terms["K"].value ** 2, 4e-6**2]
    assert math.isclose(float(read(text)["gyroscope_random_walk"]), math.sqrt(sum(squares) / 3.0), rel_tol=5e-7)
    assert "#   K z: < 50 deg/h/rth, not observable: the limit of 95 % is taken" in text  # 4e-6 rad/s²/√Hz is 49.5


def test_the_card_holds_the_coefficients_in_inside_units_and_comes_back(analyses, bare, tmp_path):
    card = noise_card(analyses, device="unit 7", source="static.parquet")
    # planted: N 0.3 °/√h, K 20 °/h/√h, B 60 µg, times 1, 1.1 and 0.9 for x, y and z
    factors = np.array([1.0, 1.1, 0.9])
    np.testing.assert_allclose(card.gyr.n_rpsd, np.radians(0.3) / 60.0 * factors, rtol=1e-12)
    np.testing.assert_allclose(card.gyr.k_rpsd, np.radians(20.0) / 3600.0 / 60.0 * factors, rtol=1e-12)
    np.testing.assert_allclose(card.acc.b, 60e-6 * 9.80665 * factors, rtol=1e-12)
    assert card.mag is None
    record = "from 3.3 min at 100 Hz, 20000 samples"
    assert (card.device, card.source) == ("unit 7", f"static.parquet; gyr {record}; acc {record}")
    card.save(tmp_path / "noise.json")
    back = NoiseCard.load(tmp_path / "noise.json")
    assert (back.device, back.source) == (card.device, card.source)
    for triad, of in ((back.gyr, analyses[:3]), (back.acc, analyses[3:])):
        for letter, values, ends in zip(
            "NBK",
            (triad.n_rpsd, triad.b, triad.k_rpsd),
            (triad.n_interval, triad.b_interval, triad.k_interval),
            strict=True,
        ):
            assert values.tolist() == [a.terms[letter].value for a in of]
            assert ends.T.tolist() == [[a.terms[letter].lo, a.terms[letter].hi] for a in of]
    assert "68.3 %" in card_report(card).text()
    part = noise_card([*analyses[:5], bare], device="d", source="s")
    assert part.acc is None and part.source.endswith("left out, no triad of three axes: acc xy, column")


def test_the_simulator_and_the_kalman_filter_take_the_card(plain):
    card = noise_card(plain, device="unit 7", source="static.parquet")
    errors = TriadErrors(white_rpsd=card.gyr.n_rpsd, flicker=card.gyr.b, walk_rpsd=card.gyr.k_rpsd)
    assert np.array_equal(errors.noise_card(100.0).n_rpsd, card.gyr.n_rpsd)
    assert Filter("mekf", frame=Frame.ENU, noise=card).params.gyr_noise == card.gyr.n_rms
    # the quadratic mean of 1, 1.1 and 0.9
    assert math.isclose(mekf.from_noise(card)["gyr_walk"], plain[0].terms["K"].value * math.sqrt(3.02 / 3.0))
    still = noise_card([hide(a, "K", upper=1.0) for a in plain], device="unit 7", source="static.parquet")
    assert Filter("mekf", frame=Frame.ENU, noise=still).params.gyr_walk == mekf.Params().gyr_walk  # no axis shows one


def test_what_a_card_or_kalibr_cannot_take_is_refused(analyses):
    gyr, acc = analyses[:3], analyses[3:]
    smooth = replace(gyr[1], likelihood=Estimates("likelihood", {}), mask=Mask(9, 1.0, "it looks smoothed"))
    bare = [replace(a, quantity=Quantity.RATIO) for a in gyr]
    slow = [replace(a, curve=replace(a.curve, dt=0.02)) for a in acc]
    hidden = with_walk(gyr[0], value=0.0, observable=False, hours=7.0)
    for given, error, text in (
        ([gyr[0], smooth, gyr[2]], ShapeError, r"white noise of gyr y is not known \(it looks smoothed\)"),
        (acc[:2], ShapeError, r"needs x, y and z of gyr, acc or mag, but there are acc xy\."),
        (bare, UnitError, "gyr is in '1', but a card holds rad/s; scale the recording"),
    ):
        with pytest.raises(error, match=text):
            noise_card(given, device="d", source="s")
    for given, error, text in (
        ([hidden, *analyses[1:]], ParameterError, "K of gyr x has neither a value nor a limit"),
        ([with_walk(gyr[0], value=0.0), *analyses[1:]], ParameterError, "K of gyr x has neither a value nor a limit"),
        (gyr, ShapeError, "needs gyr and acc, but the record has only gyr"),
        ([*bare, *acc], UnitError, "gyr is in '1', but Kalibr takes rad/s"),
        ([*gyr, *slow], ParameterError, "rates 50 Hz and 100 Hz"),
    ):
        with pytest.raises(error, match=text):
            kalibr_yaml(given, rostopic="/imu0")
    for topic in ("", "/imu 0", "imu: 1", "/imu#", "9"):
        with pytest.raises(ParameterError, match="rostopic must be a ROS name"):
            kalibr_yaml(analyses, rostopic=topic)
