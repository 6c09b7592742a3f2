"""Rates of a recording, compensated and filtered: the steps one by one, and the command line to the bit."""

import json

import numpy as np
import pytest

import plumbob
from plumbob import CalibrationCard, ImuData, ImuMeta, flags
from plumbob.calibration.gyr.drift import chen2013
from plumbob.calibration.gyr.rest import Rates, without_known
from plumbob.cli.main import main
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import dps, g
from plumbob.data.cards import TriadCalibration
from plumbob.filters.channel import RateFilter

T = 0.1 * np.arange(400)
BIAS = dps(np.array([1.5, -0.7, 0.2]))
CARD = CalibrationCard("ball", "2026-01-01", "test", gyr=TriadCalibration(np.eye(3), BIAS, "rad/s", "rad/s"))
PARAMS = {"walk": "0.0316 deg/s", "noise": "0.1 deg/s"}


def warming(**changes):
    """A unit that warms from 25 to 35 °C, at rest for 20 s, then turning; with the paper's coefficients and a bias."""
    rng = np.random.default_rng(4)
    acc = np.tile([0.0, 0.0, -g(1.0)], (T.size, 1))
    temp_c = 25.0 + T / 4.0
    rate = np.outer(np.where(T < 20.0, 0.0, 0.01 * (T - 20.0)), [0.0, 0.0, 1.0])
    model = chen2013()
    drift = np.outer(temp_c - 25.0, model.bias_per_k[0]) + acc @ model.g_sensitivity.T + BIAS
    values = {"gyr": rate + drift + dps(0.1) * rng.normal(size=(T.size, 3)), "acc": acc, "temp_c": temp_c}
    return ImuData(t=T, **{**values, **changes}, meta=ImuMeta(device="ball")), rate


def test_it_takes_off_the_drift_then_the_constant_and_then_filters():
    imu, _ = warming()
    found = plumbob.filter_rates(imu, "scalar", params=PARAMS, drift="chen2013", rest=("0 s", "20 s"))
    rate = without_known(Rates(T, imu.gyr, acc=imu.acc, temp_c=imu.temp_c, known=chen2013()))
    by_hand = RateFilter("scalar", channels=3, params=PARAMS).process(T, rate - rate[:200].mean(axis=0))
    assert np.array_equal(found.imu.gyr, by_hand.rate)
    np.testing.assert_allclose(found.drift.bias, BIAS, atol=dps(0.03))  # 0.1 °/s over √200
    assert found.imu.acc.tobytes() == imu.acc.tobytes()
    assert np.array_equal(found.imu.flags, imu.flags)
    assert any(str(line).startswith("rates: filter: scalar(walk=0.0316 deg/s") for line in found.recording.notes)


@pytest.mark.parametrize(("lacking", "told"), [("temp_c", "no temperature"), ("acc", "no specific force")])
def test_a_part_of_the_drift_whose_sensor_is_missing_stays_and_is_named(lacking, told):
    imu, _ = warming(**{lacking: None})
    said = []
    found = plumbob.filter_rates(imu, "two_state", drift="chen2013", rest=(0.0, 5.0), note=said.append)
    assert told in said[0]
    assert said == list(map(str, found.notes))
    kept = found.drift.g_sensitivity if lacking == "temp_c" else found.drift.bias_per_k
    assert kept.any()
    assert not (found.drift.bias_per_k if lacking == "temp_c" else found.drift.g_sensitivity).any()


def test_a_card_stands_in_place_of_a_drift_model():
    imu, _ = warming()
    found = plumbob.filter_rates(imu, "moving_average", params={"samples": 1}, calibration=CARD)
    np.testing.assert_allclose(found.imu.gyr, imu.gyr - BIAS, atol=1e-15)
    assert found.imu.meta.calibration is not None


def test_what_is_missing_is_held_and_flagged_and_a_file_keeps_it(tmp_path):
    gyr = np.full((T.size, 3), 0.1)
    gyr[[5, 6]], gyr[9, 1] = np.nan, np.inf
    found = plumbob.filter_rates(warming(gyr=gyr)[0], "scalar", out=tmp_path / "a.parquet")
    assert np.isfinite(found.imu.gyr).all()
    held = (found.imu.flags & flags.GYR_HELD) != 0
    assert np.flatnonzero(held).tolist() == [5, 6, 9]
    assert not (found.imu.flags & flags.GYR_ABSENT).any()
    again = plumbob.read(tmp_path / "a.parquet")
    assert np.array_equal(again.imu.flags, found.imu.flags)
    assert again.imu.gyr.tobytes() == found.imu.gyr.tobytes()


def test_the_command_line_gives_the_same_to_the_bit_and_an_attitude_follows(tmp_path, capsys):
    imu, _ = warming()
    file, out = plumbob.write(tmp_path / "a.parquet", imu), tmp_path / "b.parquet"
    words = ["--params", "walk=0.0316deg/s,noise=0.1deg/s", "--drift", "chen2013", "--rest", "0s..20s"]
    assert main(["run", str(file), "--filter", "scalar", *words, "--out", str(out), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    ours = plumbob.filter_rates(file, "scalar", params=PARAMS, drift="chen2013", rest=(0.0, 20.0))
    assert plumbob.read(out).imu.gyr.tobytes() == ours.imu.gyr.tobytes()
    assert {name: summary[name] for name in ours.summary()} == json.loads(json.dumps(ours.summary()))
    assert plumbob.estimate(out, "integrate", frame="NED").outline.samples == T.size
    assert main(["list", "filters", "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)["rate_filters"]) == ["scalar", "two_state", "moving_average"]
    for words, message in (
        ("--filter scalar --frame NED --init level", "--frame, --init: scalar gives no attitude"),
        ("--filter mahony --rest 0s..5s", "--drift and --rest are for a filter of rates"),
        ("--filter scalar --rest 5s", "--rest needs a span as 0s..5s"),
    ):
        assert main(["run", str(file), *words.split()]) == 1
        assert message in capsys.readouterr().err


def test_what_does_not_go_together_is_refused():
    imu, _ = warming()
    filtered, scalar = plumbob.filter_rates, "scalar"
    for call, error, text in (
        (lambda: plumbob.estimate(imu, scalar, frame="NED"), ParameterError, r"plumbob\.filter_rates"),
        (lambda: filtered(imu, "mahony"), ParameterError, "no channel filter 'mahony'"),
        (lambda: filtered(warming(gyr=None)[0], scalar), ShapeError, "has no gyroscope"),
        (lambda: filtered(imu, scalar, calibration=CARD, drift="chen2013"), ParameterError, "Give one of them"),
        (lambda: filtered(imu, scalar, drift="mine"), ParameterError, "'mine' is not a drift model; known: chen2013"),
        (lambda: filtered(imu, scalar, rest=(50.0, 60.0)), ParameterError, "goes from 0 to 39.9 s"),
        (lambda: filtered(imu, scalar, params={"q": 1}), ParameterError, "scalar has no parameter 'q'"),
    ):
        with pytest.raises(error, match=text):
            call()
