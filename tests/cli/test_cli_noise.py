"""Noise cards and claimed covariances on the command line."""

import json

import pytest

from plumbob import NoiseCard, files
from tests.helpers.commandline import answer, typed

SIM = "--frame NED --sensors mpu6000+hmc5983 --unit calibrated --duration 20s"


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    """A recording of a simulated unit, and the noise card of that unit."""
    folder = tmp_path_factory.mktemp("noise")
    recording, card = folder / "buoy.parquet", folder / "noise.json"
    typed(f"sim buoy {SIM} --seed 0 --out {recording} --noise-card {card}")
    return recording, card


@pytest.mark.parametrize("suffix", ["parquet", "csv"])
def test_run_takes_the_card_and_its_covariance_goes_through_a_file_to_the_evaluation(unit, tmp_path, suffix):
    recording, card = unit
    report = answer(f"run {recording} --filter mekf --noise {card} --out track.{suffix}", cwd=tmp_path)
    assert "gyr_noise=0.005 deg/s/rtHz," in report["filter"]  # 0.005 °/s/√Hz, sheet of the MPU-6000
    assert report["noise_card"].startswith("mpu6000+hmc5983 #0 (simulated")
    assert all(0.0 < sd < 30.0 for sd in report["claimed_sd_deg"].values())
    assert files.read(tmp_path / f"track.{suffix}").track.cov_b.shape == (2000, 3, 3)
    judged = answer(f"eval track.{suffix} {recording}", cwd=tmp_path)
    left_out = judged["samples"]["left_out"]["not_converged"]
    assert judged["consistency"]["count"] + judged["consistency"]["unusable"] == 2000 - left_out > 1600
    assert judged["consistency"]["mean"] > 0.0
    nothing = answer(f"run {recording} --filter mahony")
    assert (nothing["claimed_sd_deg"], nothing["noise_card"]) == (None, None)


def test_benchmarks_and_the_simulator_take_the_card_and_say_so(unit, tmp_path):
    recording, card = unit
    (tmp_path / "a.parquet").write_bytes(recording.read_bytes())
    done = typed(f"benchmark accuracy . --filters mekf,mahony,ekf7 --noise {card} --json", cwd=tmp_path)
    assert "note: the noise card is for mekf, ekf7; mahony can take nothing from it" in done.stderr
    settings = json.loads(done.stdout)["settings"]
    noisy = [name for name, text in settings.items() if "noise=0.005 deg/s/rtHz" in text]
    assert noisy == ["mekf", "ekf7"]
    words = f"sim static --frame NED --duration 2s --noise {unit[1]} --out x.parquet --noise-card own.json"
    assert "from the card of mpu6000+hmc5983 #0" in typed(words, cwd=tmp_path).stdout
    own, given = (NoiseCard.load(path) for path in (tmp_path / "own.json", unit[1]))
    assert own.gyr.n_rpsd.tolist() == given.gyr.n_rpsd.tolist()
    notes = files.read(tmp_path / "x.parquet").notes
    assert any("noise of gyr, acc, mag from the card of" in str(note) for note in notes)


def test_a_unit_s_own_card_is_the_one_that_sim_writes(unit):
    """The card of seed 0 as a file, and the unit's own, run the same filter on the same samples."""
    _, card = unit
    assert NoiseCard.load(card).device == "mpu6000+hmc5983 #0"
    words = f"benchmark scenario buoy {SIM} --seeds 1 --filters mekf,mahony"
    own, file, without = (answer(f"{words} {more}") for more in ("--noise own", f"--noise {card}", ""))
    assert own["seeds"] == file["seeds"]
    assert own["settings"] == file["settings"]
    assert own["settings"]["mekf"] != without["settings"]["mekf"]
    assert own["seeds"]["mahony"] == without["seeds"]["mahony"]
    assert own["scenario"] == f"{file['scenario']}; noise cards of the units"
