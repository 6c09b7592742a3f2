"""Noise cards and claimed covariances on the command line: real processes, real files."""

import json

import pytest

from plumbob import NoiseCard, files
from tests.helpers.commandline import ok

SIM = ("--frame", "NED", "--sensors", "mpu6000+hmc5983", "--unit", "calibrated", "--duration", "20s")


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    """A recording of a simulated unit, and the noise card of that unit."""
    folder = tmp_path_factory.mktemp("noise")
    recording, card = folder / "buoy.parquet", folder / "noise.json"
    ok("sim", "buoy", *SIM, "--seed", 0, "--out", recording, "--noise-card", card)
    return recording, card


def test_run_takes_the_card_and_tells_what_the_filter_claims(unit, tmp_path):
    recording, card = unit
    track = tmp_path / "track.parquet"
    words = ("run", recording, "--filter", "mekf", "--noise", card, "--out", track)
    report = json.loads(ok(*words, "--json").stdout)
    assert "gyr_noise=0.005 deg/s/rtHz," in report["filter"]  # 0.005 °/s/√Hz, sheet of the MPU-6000
    assert report["noise_card"].startswith("mpu6000+hmc5983 #0 (simulated")
    assert set(report["claimed_sd_deg"]) == {"inclination", "heading"}
    assert all(0.0 < sd < 30.0 for sd in report["claimed_sd_deg"].values())
    text = ok(*words, "--force").stdout
    assert "noise card   mpu6000+hmc5983 #0" in text
    sd = report["claimed_sd_deg"]
    assert f"inclination {sd['inclination']:.3f}°, heading {sd['heading']:.3f}° (standard dev" in text
    assert files.read(track).track.cov_b.shape == (2000, 3, 3)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_a_covariance_goes_through_a_file_to_the_evaluation(unit, tmp_path, suffix):
    recording, _ = unit
    track = tmp_path / f"track{suffix}"
    ok("run", recording, "--filter", "mekf", "--out", track)
    told = json.loads(ok("eval", track, recording, "--json").stdout)
    found = told["consistency"]
    assert found["count"] + found["unusable"] == 2000 - told["samples"]["left_out"]["not_converged"]
    assert told["samples"]["left_out"]["not_converged"] < 400
    assert found["mean"] > 0.0


def test_what_claims_nothing_says_nothing_and_a_free_heading_has_no_claim(unit):
    recording, _ = unit
    report = json.loads(ok("run", recording, "--filter", "mahony", "--json").stdout)
    assert (report["claimed_sd_deg"], report["noise_card"]) == (None, None)
    free = ok("run", recording, "--filter", "mekf", "--params", "mag=off").stdout
    assert "heading unknown (standard deviations at the end)" in free


def test_benchmarks_give_the_card_to_those_that_take_one_and_say_so(unit, tmp_path):
    recording, card = unit
    (tmp_path / "a.parquet").write_bytes(recording.read_bytes())
    told = "note: the noise card is for mekf, ekf7; mahony can take nothing from it"
    done = ok("benchmark", "accuracy", tmp_path, "--filters", "mekf,mahony,ekf7", "--noise", card, "--json")
    assert told in done.stderr
    settings = json.loads(done.stdout)["settings"]
    assert "gyr_noise=0.005 deg/s/rtHz," in settings["mekf"]
    assert "gyro_noise=0.005 deg/s/rtHz" in settings["ekf7"]


def test_a_unit_s_own_card_is_the_one_that_sim_writes(unit):
    """The card of seed 0 as a file, and the unit's own, run the same filter on the same samples."""
    _, card = unit
    assert NoiseCard.load(card).device == "mpu6000+hmc5983 #0"
    words = ("benchmark", "scenario", "buoy", *SIM, "--seeds", 1, "--filters", "mekf,mahony", "--json")
    own, file, without = (ok(*words, *more) for more in (("--noise", "own"), ("--noise", card), ()))
    assert "the noise card is for mekf; mahony can" in own.stderr
    own, file, without = (json.loads(done.stdout) for done in (own, file, without))
    assert own["seeds"] == file["seeds"]
    assert own["settings"] == file["settings"]
    assert own["settings"]["mekf"] != without["settings"]["mekf"]
    assert own["seeds"]["mahony"] == without["seeds"]["mahony"]
    assert own["scenario"] == f"{file['scenario']}; noise cards of the units"


def test_the_simulator_takes_a_noise_card(unit, tmp_path):
    _, card = unit
    out, own = tmp_path / "x.parquet", tmp_path / "own.json"
    words = ("sim", "static", "--frame", "NED", "--duration", "2s", "--noise", card)
    assert "from the card of mpu6000+hmc5983 #0" in ok(*words, "--out", out, "--noise-card", own).stdout
    assert NoiseCard.load(own).gyr.n_rpsd.tolist() == NoiseCard.load(card).gyr.n_rpsd.tolist()
    assert any("noise of gyr, acc, mag from the card of" in note for note in files.read(out).notes)
