"""plumbob calibrate statictest as a user meets it, from captures to table, JSON and page; benchmark calibration."""

import json
import math

import pytest

from benchmarks.harness.__main__ import main as measure
from plumbob.cli.main import main
from plumbob.data.cards import CalibrationCard


@pytest.fixture
def table(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = "sim table36 --frame NED --sensors mpu6000+hmc5983 --unit random --seed 3 --rate 20Hz --out a.parquet"
    assert main([*words.split(), "--card", "card.json"]) == 0
    capsys.readouterr()
    return tmp_path


def run(capsys, words):
    code = main(["calibrate", "statictest", *words.split()])
    return code, *capsys.readouterr()


def test_table_and_page(table, capsys):
    code, out, _ = run(capsys, "a.parquet --calibration card.json --html page.html")
    assert code == 0
    assert "36 rests" in out
    assert (table / "page.html").read_text().count("<svg") == 1


def test_triads_that_the_card_leaves_uncalibrated_are_named(table, capsys):
    CalibrationCard.load("card.json").without("gyr", "mag").save("acc.json")
    code, out, _ = run(capsys, "a.parquet --calibration acc.json --html page.html")
    assert code == 0
    assert "NOT calibrated: gyr, mag" in " ".join(out.split())
    assert "NOT calibrated: gyr, mag" in (table / "page.html").read_text()
    assert main(["run", "a.parquet", "--filter", "tilt_compass", "--calibration", "acc.json"]) == 0
    assert "NOT calibrated: gyr, mag" in capsys.readouterr().out
    assert "NOT calibrated" not in run(capsys, "a.parquet --calibration card.json")[1]


def test_json_with_the_reference_in_another_file(table, capsys):
    assert main(["sim", "table36", "--frame", "NED", "--rate", "20Hz", "--out", "truth.parquet"]) == 0
    capsys.readouterr()
    code, out, _ = run(capsys, "a.parquet --reference truth.parquet --calibration card.json --json")
    summary = json.loads(out)["summary"]
    assert code == 0
    for figures in summary.values():
        assert figures["max_after_deg"] < 0.25  # a perfect card leaves the noise
        assert figures["max_before_deg"] > 1.0


def test_a_file_without_sensors_or_a_reference_is_refused(table, capsys):
    assert main(["run", "a.parquet", "--filter", "tilt_compass", "--out", "track.parquet"]) == 0
    capsys.readouterr()
    code, out, err = run(capsys, "track.parquet --calibration card.json")
    assert (code, out) == (1, "")
    assert "no sensor data" in err


def test_a_page_does_not_replace_an_input(table, capsys):
    code, _, err = run(capsys, "a.parquet --calibration card.json --html card.json")
    assert code == 1
    assert "is an input" in err


def test_from_captures_by_hand_to_the_static_test(table, capsys):
    unit = "--frame NED --sensors mpu6000+hmc5983 --unit random --seed 3 --rate 20Hz"
    assert main(["sim", "faces", *unit.split(), "--set", "edges=on,wobble=3deg", "--out", "faces.parquet"]) == 0
    assert main(["calibrate", "accel", "faces.parquet", "--out", "acc.json"]) == 0
    words = ["faces.parquet", "--calibration", "acc.json", "--out", "found.json"]
    assert main(["calibrate", "mag", *words]) == 0
    capsys.readouterr()
    code, out, _ = run(capsys, "a.parquet --calibration found.json --align mounting --json")
    summary = json.loads(out)["summary"]
    assert code == 0
    # poses show the accelerometer no turn of its own, which --align mounting takes off; what is left are the predicted
    # errors of both triads and the noise of a rest: 0.2 µT over the level 32 µT, of 45 samples, 0.05°
    card = CalibrationCard.load("found.json")
    sd = math.degrees(math.hypot(card.mag.quality.heading_sd, card.acc.quality.tilt_sd, 0.2 / 32.0 / math.sqrt(45)))
    assert max(figures["max_after_deg"] for figures in summary.values()) < 4.0 * sd
    assert summary["yaw"]["max_before_deg"] > 10.0 * sd


@pytest.mark.parametrize(
    ("words", "kind"), [("levelring", "level-ring"), ("cone", "cone"), ("cone --set table=on", "cone")]
)
def test_simulated_captures_that_calibrate_nothing_are_refused(words, kind, tmp_path, capsys):
    capture, card = str(tmp_path / "a.parquet"), tmp_path / "card.json"
    unit = "--frame NED --sensors mpu6000+hmc5983 --unit random --seed 3 --rate 20Hz"
    assert main(["sim", *words.split(), *unit.split(), "--out", capture]) == 0
    capsys.readouterr()
    assert main(["calibrate", "mag", capture, "--out", str(card), "--json"]) == 1
    assert json.loads(capsys.readouterr()[0])["refused"][0]["kind"] == kind
    assert not card.exists()


def test_benchmark_of_calibrations(capsys):
    assert measure(["calibration", "--sections", "table", "--seeds", "2", "--json"]) == 0
    told = json.loads(capsys.readouterr()[0])
    assert told["seeds"] == 2
    assert told["table"]["bars"]  # two seeds are few to meet them
    assert measure(["calibration", "--sections", "gyroscope"]) == 1
    assert "section must be one of" in capsys.readouterr()[1]
