"""The noise card and what other programs take: what they hold or refuse, and that filters take the card."""

import math
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from plumbob import Filter, Frame, NoiseCard
from plumbob.core.errors import ParameterError, ShapeError, UnitError
from plumbob.core.units import Quantity, to_si
from plumbob.filters import mekf
from plumbob.noise.card import lines, noise_card
from plumbob.noise.findings import Coefficient, Estimates, GaussMarkov, Mask, lowest
from plumbob.reporting.noise import card_report
from plumbob.simulation.errors import TriadErrors


def hide(analysis, letter, **fields):
    hidden = Coefficient(**{"value": analysis.terms[letter].value, "observable": False, **fields})
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
    return dict(line.split(": ") for line in lines if ": " in line)


# planted in x, and 1.1 and 0.9 of it in y and z, whose quadratic mean is √(3.02/3): N and K, SI
MEAN = math.sqrt(3.02 / 3.0)
GYR_N, ACC_N = MEAN * math.radians(0.3) / 60.0, MEAN * 300e-6 * 9.80665
GYR_K, ACC_K = MEAN * math.radians(20.0) / 3600.0 / 60.0, MEAN * 2e-6 * 9.80665
FORMS = {  # by the sources of each program, which forms.toml names; the rate is 100 Hz
    "kalibr": {
        "accelerometer_noise_density": ACC_N, "accelerometer_random_walk": ACC_K, "gyroscope_noise_density": GYR_N,
        "gyroscope_random_walk": GYR_K, "rostopic": "/imu0", "update_rate": 100.0,
    },
    "vins": {  # a step of Δt adds ½ Δt² gyr_n² to the angle's variance, which is N² Δt; and Δt² gyr_w² = K² Δt
        "acc_n": ACC_N / math.sqrt(0.5 * 0.01), "gyr_n": GYR_N / math.sqrt(0.5 * 0.01), "acc_w": ACC_K / 0.1,
        "gyr_w": GYR_K / 0.1,
    },
    "orbslam": {
        "IMU.NoiseGyro": GYR_N, "IMU.NoiseAcc": ACC_N, "IMU.GyroWalk": GYR_K, "IMU.AccWalk": ACC_K,
        "IMU.Frequency": 100.0,
    },
    "liosam": {"imuAccNoise": ACC_N, "imuGyrNoise": GYR_N, "imuAccBiasN": ACC_K, "imuGyrBiasN": GYR_K},
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_other_programs_get_their_own_units(analyses, form):
    values = read(lines(analyses, form))
    assert list(values) == list(FORMS[form])
    for name, expected in FORMS[form].items():
        if isinstance(expected, str):
            assert values[name] == expected
        else:
            assert FLOAT.fullmatch(values[name])
            assert math.isclose(float(values[name]), expected, rel_tol=5e-7)  # seven digits are written


def listed(text):
    return [float(value) for value in re.search(r"\[(.*)\]", text)[1].split(",")]


def test_kf_gins_and_ros_get_a_number_for_each_axis(analyses):
    """In °/√h, m/s/√h, °/h and mGal; 1.0760 B makes a Gauss–Markov process whose Allan deviation is at most .664 B."""
    values = read(lines(analyses, "kfgins"))
    factors = np.array([1.0, 1.1, 0.9])
    assert listed(values["  arw"]) == pytest.approx(0.3 * factors, rel=1e-6)
    assert listed(values["  vrw"]) == pytest.approx(60.0 * 300e-6 * 9.80665 * factors, rel=1e-6)
    assert listed(values["  gbstd"]) == pytest.approx(1.0760 * 12.0 * factors, rel=1e-4)
    assert listed(values["  abstd"]) == pytest.approx(1.0760 * 60e-6 * 980665.0 * factors, rel=1e-4)
    process = GaussMarkov(Coefficient(1.0760), Coefficient(100.0))
    tau = np.geomspace(10.0, 1000.0, 2001)
    peak = process.variance(tau)
    assert math.sqrt(peak.max()) == pytest.approx(math.sqrt(2.0 * math.log(2.0) / math.pi), rel=1e-4)
    assert tau[np.argmax(peak)] == pytest.approx(189.26, rel=2e-3)
    floors = [lowest(a).tau for a in analyses]
    hours = float(values["  corrtime"].split()[0])
    assert hours == pytest.approx(np.exp(np.mean(np.log(floors))) / 1.8926 / 3600.0, rel=1e-4)
    values = read(lines(analyses, "ros"))
    variances = np.diag((math.radians(0.3) / 60.0 * factors) ** 2 * 100.0).ravel()
    assert listed(values["angular_velocity_covariance"]) == pytest.approx(variances, rel=1e-6)
    assert listed(values["linear_acceleration_covariance"])[8] == pytest.approx((0.9 * 300e-6 * 9.80665) ** 2 * 100.0)


def test_comments_say_what_each_number_was_made_of(analyses):
    text = lines(analyses, "kalibr", source="static µ.parquet\nrostopic: /evil")
    assert "#   gyr x N: 0.3000 +/- 0.0012 deg/rth" in text
    assert "#   acc z K: 1.80 +/- 0.63 ug/s/rtHz" in text
    assert "# static ?.parquet rostopic: /evil" in text
    assert text.isascii() and "quadratic mean" in text
    hidden = hide(analyses[2], "K", value=1e-9, upper=4e-6, hours=7.0)
    text = lines([*analyses[:2], hidden, *analyses[3:]], "kalibr")
    squares = [analyses[0].terms["K"].value ** 2, analyses[1].terms["K"].value ** 2, 4e-6**2]
    assert math.isclose(float(read(text)["gyroscope_random_walk"]), math.sqrt(sum(squares) / 3.0), rel_tol=5e-7)
    assert "#   gyr z K: < 50 deg/h/rth, not observable: the limit of 95 % is taken" in text  # 4e-6 rad/s²/√Hz is 49.5


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


def test_what_a_card_or_another_program_cannot_take_is_refused(analyses):
    gyr, acc = analyses[:3], analyses[3:]
    smooth = replace(gyr[1], likelihood=Estimates("likelihood", {}), mask=Mask(9, 1.0, "it looks smoothed"))
    bare = [replace(a, quantity=Quantity.RATIO) for a in gyr]
    slow = [replace(a, curve=replace(a.curve, dt=0.02)) for a in acc]
    hidden = hide(gyr[0], "K", value=0.0, hours=7.0)
    card, vins = partial(noise_card, device="d", source="s"), partial(lines, form="vins")
    for call, given, error, text in (
        (card, [gyr[0], smooth, gyr[2]], ShapeError, r"white noise of gyr y is not known \(it looks smoothed\)"),
        (card, acc[:2], ShapeError, r"needs x, y and z of gyr, acc or mag, but there are acc xy\."),
        (card, bare, UnitError, "gyr is in '1', but a card holds rad/s; scale the recording"),
        (vins, [hidden, *analyses[1:]], ParameterError, "K of gyr x has neither a value nor a limit"),
        (
            vins,
            [hide(gyr[0], "K", value=0.0, observable=True), *analyses[1:]],
            ParameterError,
            "K of gyr x has neither a value nor a limit",
        ),
        (vins, gyr, ShapeError, "needs gyr and acc, but the record has only gyr"),
        (vins, [*bare, *acc], UnitError, "gyr is in '1', but vins takes rad/s"),
        (vins, [*gyr, *slow], ParameterError, "rates 100 Hz and 50 Hz"),
    ):
        with pytest.raises(error, match=text):
            call(given)
