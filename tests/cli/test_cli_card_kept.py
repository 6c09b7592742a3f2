"""plumbob calibrate --out: a card that has more than the new one would is not destroyed, in a recording or live."""

import json

import numpy as np
import pytest

from plumbob import ImuData, ImuMeta, files
from plumbob.cli.main import main
from plumbob.data.cards import UNITS, CalibrationCard, TriadCalibration
from tests.helpers.commandline import table_of

N = 4000


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A gyroscope at rest for 40 s."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(5)
    imu = ImuData(t=0.01 * np.arange(N), gyr=1e-3 * rng.normal(size=(N, 3)),
                  acc=[0.0, 0.0, 9.81] + 1e-2 * rng.normal(size=(N, 3)), meta=ImuMeta(device="SN7"))  # fmt: skip
    files.write(tmp_path / "rest.parquet", imu)
    return tmp_path


def saved(path, *names, device="SN7"):
    parts = {name: TriadCalibration(np.eye(3), np.zeros(3), UNITS[name], UNITS[name]) for name in names}
    CalibrationCard(device, "2026-11-21", "known", **parts).save(path)
    return path.read_bytes()


def calibrate(*words):
    return main(["calibrate", "gyro", "rest.parquet", "--out", "card.json", *words])


KEPT = """
gyr         | SN7 |                                 | card.json exists already and is not replaced
gyr acc mag | SN7 | --force                         | card.json has acc and mag, which this would lose; complete it with
gyr acc mag | SN7 | --force --calibration acc.json  | card.json has mag, which this would lose
gyr         | SN8 | --force                         | card.json is the card of 'SN8', not of 'SN7'; name another file
gyr         | SN7 | --calibration card.json         | has gyr already. Name another file, or replace it with --force
"""


@pytest.mark.parametrize(("parts", "device", "words", "says"), table_of(KEPT))
def test_a_card_that_has_more_or_is_of_another_unit_stays(folder, capsys, parts, device, words, says):
    before = saved(folder / "card.json", *parts.split(), device=device)
    saved(folder / "acc.json", "acc")
    assert calibrate(*words.split()) == 1
    assert says in " ".join(capsys.readouterr().err.split())
    assert (folder / "card.json").read_bytes() == before


def test_a_card_is_replaced_or_completed_where_that_is_asked_for(folder):
    saved(folder / "card.json", "gyr")
    assert calibrate("--force") == 0
    assert CalibrationCard.load(folder / "card.json").gyr.method.startswith("gyr at rest")
    (folder / "card.json").unlink()
    saved(folder / "card.json", "acc", "mag")
    assert calibrate("--calibration", "card.json") == 0
    assert list(CalibrationCard.load(folder / "card.json").parts) == ["gyr", "acc", "mag"]
    assert calibrate("--calibration", "card.json", "--force") == 0


@pytest.mark.parametrize("content", ["", "{}", "notes"])
def test_a_file_that_is_no_card_is_replaced_as_any_other(folder, content):
    (folder / "card.json").write_text(content)
    assert calibrate() == 1
    assert (folder / "card.json").read_text() == content
    assert calibrate("--force") == 0
    assert CalibrationCard.load(folder / "card.json").device == "SN7"


def test_live_it_is_refused_before_the_line_is_opened(folder, capsys):
    before = saved(folder / "card.json", "acc")
    words = "calibrate gyro --live --port /dev/none --format buoy --device SN7 --out card.json --force"
    assert main(words.split()) == 1
    assert "card.json has acc, which this would lose" in capsys.readouterr().err
    assert (folder / "card.json").read_bytes() == before


def test_remarks_of_a_part_are_told_wherever_the_card_is(folder, capsys):
    assert calibrate() == 0
    (first, *_) = CalibrationCard.load(folder / "card.json").gyr.remarks
    capsys.readouterr()
    assert main(["info", "card.json", "--json"]) == 0
    assert first.to_dict() in json.loads(capsys.readouterr().out)["remarks"]["gyr"]
