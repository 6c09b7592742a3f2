"""A calibration card gives calibrated data out, and the noise before and after it."""

from dataclasses import replace

import numpy as np
import pytest

import plumbob
from plumbob import files
from plumbob.live.recorded import read_recorded
from tests.helpers.commandline import answer, typed

GAIN = 2.0
"""Of the gyroscope's card: calibrated values, and their noise, are twice the measured ones."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A unit at rest for two minutes, and its card."""
    folder = tmp_path_factory.mktemp("card")
    found = plumbob.simulate(
        "static", frame="NED", sensors="mpu6000", unit="calibrated", seed=5, rate=20.0, duration=120.0
    )
    imu = replace(found.imu, meta=replace(found.imu.meta, device="unit 7", calibration=None))
    plumbob.write(folder / "rest.parquet", plumbob.Recording(imu=imu, track=found.truth))
    model = plumbob.data.cards.TriadCalibration(
        matrix=GAIN * np.eye(3), bias=np.zeros(3), unit_in="rad/s", unit_out="rad/s"
    )
    card = plumbob.CalibrationCard("unit 7", "2026-11-21", "test", gyr=model)
    card.save(folder / "card.json")
    return folder


def test_convert_writes_calibrated_samples_as_python_gives_them(made, tmp_path):
    raw = files.read(made / "rest.parquet").imu
    ours = plumbob.apply_card(plumbob.CalibrationCard.load(made / "card.json"), raw)
    assert ours.meta.calibration == "unit 7 2026-11-21 (test); NOT calibrated: acc"
    for name in ("out.parquet", "out.csv", "out.mcap"):
        out = tmp_path / name
        typed(f"convert rest.parquet --calibration card.json {out} --what samples", cwd=made)
        recording = read_recorded(out) if name.endswith("mcap") else files.read(out)
        np.testing.assert_allclose(recording.imu.gyr, GAIN * raw.gyr, rtol=1e-15)
        np.testing.assert_array_equal(recording.imu.gyr, ours.gyr)
        np.testing.assert_array_equal(recording.imu.acc, raw.acc)
        assert recording.imu.meta.calibration == ours.meta.calibration
        assert not any("uncalibrated" in str(note) for note in recording.notes)


def test_allan_before_and_after(made, tmp_path):
    """White noise scales with the gain, and so does its deviation at every averaging time, exactly."""
    gyr = "--triads gyr --taus 1s"
    both = answer(f"allan rest.parquet --after rest.parquet --calibration card.json {gyr}", cwd=made)
    alone = answer(f"allan rest.parquet {gyr} --deviation oadev", cwd=made)
    after = answer(f"allan rest.parquet {gyr} --deviation oadev --calibration card.json", cwd=made)
    for axis in ("gyr x", "gyr y", "gyr z"):
        assert both[axis]["before"]["dev"] == alone[axis]["dev"]
        assert both[axis]["after"]["dev"] == after[axis]["dev"]
        assert both[axis]["ratio"] == pytest.approx([GAIN], rel=1e-12)
    assert (alone["calibration"], after["calibration"], both["calibration"]) == (None, "card.json", "card.json")
    card = tmp_path / "noise.json"
    typed(f"allan rest.parquet --triads gyr --calibration card.json --card {card}", cwd=made)
    assert "rest.parquet, calibrated with card.json" in plumbob.NoiseCard.load(card).source
