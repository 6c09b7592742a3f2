"""A calibration card gives calibrated data out, and the noise before and after it."""

import json
from dataclasses import replace

import numpy as np
import pytest

import plumbob
from plumbob import files
from plumbob.core.errors import CalibrationError, ShapeError
from plumbob.session.recorded import read_recorded
from tests.helpers.commandline import ok
from tests.helpers.commandline import plumbob as call

GAIN = 2.0
"""Of the gyroscope's card: calibrated values, and their noise, are twice the measured ones."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A unit at rest for ten minutes, its card, and a card of another unit."""
    folder = tmp_path_factory.mktemp("card")
    found = plumbob.simulate(
        "static", frame="NED", sensors="mpu6000", unit="calibrated", seed=5, rate=20.0, duration=600.0
    )
    imu = replace(found.imu, meta=replace(found.imu.meta, device="unit 7", calibration=None))
    plumbob.write(folder / "rest.parquet", plumbob.Recording(imu=imu, track=found.truth))
    model = plumbob.data.cards.TriadCalibration(
        matrix=GAIN * np.eye(3), bias=np.zeros(3), unit_in="rad/s", unit_out="rad/s"
    )
    card = plumbob.CalibrationCard("unit 7", "2026-11-21", "test", gyr=model)
    card.save(folder / "card.json")
    replace(card, device="unit 8").save(folder / "other.json")
    return folder


@pytest.mark.parametrize("name", ["out.parquet", "out.csv", "out.mcap"])
def test_convert_writes_calibrated_samples(made, tmp_path, name):
    out = tmp_path / name
    ok("convert", made / "rest.parquet", "--calibration", made / "card.json", "--out", out, "--what", "samples")
    raw = files.read(made / "rest.parquet").imu
    found = (read_recorded(out) if name.endswith("mcap") else files.read(out)).imu
    np.testing.assert_allclose(found.gyr, GAIN * raw.gyr, rtol=1e-15)
    assert found.meta.calibration == "unit 7 2026-11-21 (test); NOT calibrated: acc"
    np.testing.assert_array_equal(found.acc, raw.acc)


def test_convert_is_what_python_gives(made, tmp_path):
    raw = files.read(made / "rest.parquet").imu
    calibrated = plumbob.apply_card(plumbob.CalibrationCard.load(made / "card.json"), raw)
    ok("convert", made / "rest.parquet", "--calibration", made / "card.json", "--out", tmp_path / "a.parquet")
    found = files.read(tmp_path / "a.parquet")
    np.testing.assert_array_equal(found.imu.gyr, calibrated.gyr)
    assert found.imu.meta == calibrated.meta
    assert not any("uncalibrated" in note for note in found.notes)


def test_refusals(made, tmp_path):
    out = tmp_path / "out.parquet"
    other = call("convert", made / "rest.parquet", "--calibration", made / "other.json", "--out", out)
    assert (other.returncode, out.exists()) == (1, False)
    assert "the card is for device 'unit 8', but the recording is of 'unit 7'" in other.stderr
    words = ("--calibration", made / "card.json", "--out", out, "--what", "attitude")
    assert "holds an attitude but no samples" in call("convert", made / "rest.parquet", *words).stderr
    (tmp_path / "numbers.txt").write_text("1\n2\n3\n")
    bare = ("--rate", "1Hz", "--scale", "1 deg/s", "--calibration", made / "card.json")
    assert "--calibration is for recordings" in call("allan", tmp_path / "numbers.txt", *bare).stderr
    with pytest.raises(CalibrationError, match="unit 8"):
        plumbob.apply_card(plumbob.CalibrationCard.load(made / "other.json"), files.read(made / "rest.parquet").imu)
    with pytest.raises(ShapeError, match=r"card must be a CalibrationCard, but it is .*CalibrationCard\.load"):
        plumbob.apply_card(made / "card.json", files.read(made / "rest.parquet").imu)


def test_allan_before_and_after(made, tmp_path):
    """White noise scales with the gain, and so does its deviation at every averaging time, exactly."""
    page = tmp_path / "page.html"
    rest, gyr = made / "rest.parquet", ("--triads", "gyr", "--taus", "1s")
    words = (rest, "--after", rest, "--calibration", made / "card.json", *gyr)
    found = json.loads(ok("allan", *words, "--json").stdout)
    ok("allan", *words, "--html", page)
    assert "rest.parquet, calibrated with card.json" in page.read_text(encoding="utf-8")
    alone = json.loads(ok("allan", rest, *gyr, "--deviation", "oadev", "--json").stdout)
    after = json.loads(
        ok("allan", rest, *gyr, "--deviation", "oadev", "--json", "--calibration", made / "card.json").stdout
    )
    for axis in ("gyr x", "gyr y", "gyr z"):
        assert found[axis]["before"]["dev"] == alone[axis]["dev"]
        assert found[axis]["after"]["dev"] == after[axis]["dev"]
        assert found[axis]["ratio"] == pytest.approx([GAIN], rel=1e-12)
    assert (alone["calibration"], after["calibration"], found["calibration"]) == (None, "card.json", "card.json")


def test_a_noise_card_says_that_the_record_was_calibrated(made, tmp_path):
    words = ("--triads", "gyr", "--calibration", made / "card.json", "--card", tmp_path / "noise.json")
    ok("allan", made / "rest.parquet", *words)
    assert "rest.parquet, calibrated with card.json" in plumbob.NoiseCard.load(tmp_path / "noise.json").source
