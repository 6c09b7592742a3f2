"""Every output of uncalibrated values says so in words, and of calibrated ones names the card."""

import io
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from plumbob import files
from plumbob.cli import common
from plumbob.cli.main import main
from plumbob.core.units import dps
from plumbob.data import UNCALIBRATED
from plumbob.data.cards import CalibrationCard, NoiseCard, TriadNoise
from plumbob.files.mcap import open_log
from tests.helpers import beside
from tests.helpers.commandline import answer, table_of, typed

CARD = "unit 7 2026-11-21 (table)"


@pytest.fixture
def folder(samples, tmp_path):
    """An uncalibrated recording and its track, the card of its unit, and bytes of a line that is said to have it."""
    for name in ("rest.parquet", "card.json", "other.json", "sea.bin"):
        (tmp_path / name).symlink_to(samples / name)
    typed("run rest.parquet --filter mahony --out track.parquet", cwd=tmp_path)
    return tmp_path


def contents(file):
    """What a file holds, as text."""
    if file.suffix == ".mcap":
        return str(dict(open_log(file).metadata))
    return str(pq.read_metadata(file).metadata) if file.suffix == ".parquet" else file.read_text(encoding="utf-8")


RECORD = "record --from sea.bin --format buoy --device 'unit 7' --filter mahony --frame NED"
WRITTEN = table_of(beside(__file__, "written.txt"))


@pytest.mark.parametrize(("words", "names"), WRITTEN)
def test_files_of_uncalibrated_values_say_so(folder, words, names):
    for name in names.split():
        typed(words.replace("RECORD", RECORD).format(f"out-{name}"), cwd=folder)
        assert "uncalibrated" in contents(folder / f"out-{name}")


PRINTED = beside(__file__, "printed.txt").splitlines()


@pytest.mark.parametrize("words", PRINTED)
def test_reports_of_uncalibrated_values_say_so(folder, words):
    assert UNCALIBRATED in " ".join(typed(words.replace("RECORD", RECORD), cwd=folder).stdout.split())


def test_a_card_is_named_in_place_of_it_nothing_goes_stale_and_tables_have_the_note_elsewhere(folder):
    """On standard output, in JSON, in the track, in text and in the stream, and by all who read those."""
    run = "run rest.parquet --filter mahony"
    assert answer(run, cwd=folder)["calibration"] is None
    report = answer(run, "--calibration", "card.json", "--out", "good.csv", cwd=folder)
    assert (report["calibration"], report["filter"][:7]) == (CARD, "mahony(")
    done = typed(run, "--calibration", "card.json", cwd=folder)
    typed(RECORD, "--calibration", "card.json", "--text", "good.txt", "--out", "good.mcap", cwd=folder)
    assert answer("replay good.mcap", cwd=folder)["calibration"] == CARD
    compared = typed("eval good.csv rest.parquet", cwd=folder).stdout
    for text in (done.stdout, *(contents(folder / f"good.{suffix}") for suffix in ("csv", "txt", "mcap"))):
        assert (CARD in text, "uncalibrated" in text) == (True, False)
    assert "uncalibrated" not in done.stderr + compared
    # The note is made anew from the meta: a recording that is calibrated later does not keep the old one.
    first = files.read(files.write(folder / "a.csv", files.read(folder / "rest.parquet")))
    later = replace(first, imu=replace(first.imu, meta=replace(first.imu.meta, calibration="unit 7 table")))
    for name in ("b.csv", "b.parquet"):
        files.write(folder / name, later)
        assert b"uncalibrated" not in (folder / name).read_bytes()
        assert not [note for note in files.read(folder / name).notes if note.code == "samples.uncalibrated"]
    done = typed("decode sea.bin --format buoy", cwd=folder)
    assert (UNCALIBRATED in done.stderr, "uncalibrated" in done.stdout) == (True, False)
    done = typed(f"{RECORD} --calibration other.json --out x.mcap", cwd=folder, code=1)
    assert "the card is for device 'unit 8'" in done.stderr
    assert not (folder / "x.mcap").exists()


@pytest.mark.parametrize("words", [(), ("--calibration", "card.json")])
def test_the_status_on_a_terminal(folder, words, monkeypatch):
    screen = io.StringIO()
    screen.isatty = lambda: True
    monkeypatch.chdir(folder)
    monkeypatch.setattr(common.sys, "stderr", screen)
    options = ("--format", "buoy", "--device", "unit 7", *words)
    assert main(["record", "--from", "sea.bin", *options]) == 0
    assert "samples" in screen.getvalue()
    assert ("samples UNCALIBRATED" in screen.getvalue()) is (not words)


def test_samples_beyond_the_temperatures_of_the_card_are_noted_once(folder):
    """The card holds from 30 to 40 °C; the recordings are at 25 °C."""
    card = CalibrationCard.load(folder / "card.json")
    gyr = replace(card.gyr, bias_per_k=dps(np.full((1, 3), 0.02)), temp_span_c=(30.0, 40.0))
    replace(card, gyr=gyr).save(folder / "warm.json")
    beyond = "100 % of the samples are at 25.0 to 25.0 °C, beyond the 30.0 to 40.0 °C of the calibration of gyr"
    run = "run rest.parquet --filter mahony --calibration"
    assert beyond in typed(run, "warm.json", cwd=folder).stderr
    assert sum(beyond in note["text"] for note in answer(run, "warm.json", cwd=folder)["notes"]) == 1
    codes = [note["code"] for note in answer(run, "card.json", cwd=folder)["notes"]]
    assert "card.temperature_beyond" not in codes
    assert typed(RECORD, "--calibration", "warm.json", "--out", "a.mcap", cwd=folder).stderr.count(beyond) == 1
    assert sum(beyond in note["text"] for note in answer("replay a.mcap", cwd=folder)["notes"]) == 1


def test_benchmarks_say_it_of_each_trial(folder, tmp_path_factory):
    trials, first = tmp_path_factory.mktemp("trials"), files.read(folder / "rest.parquet")
    meta = replace(first.imu.meta, calibration="unit 7 table")
    files.write(trials / "a.parquet", first)
    files.write(trials / "b.parquet", replace(first, imu=replace(first.imu, meta=meta)))
    words = "benchmark accuracy . --filters mahony --frame NED"
    assert answer(words, cwd=trials)["calibration"] == {"a": UNCALIBRATED, "b": "unit 7 table"}


def test_info_shows_the_values_of_a_card(folder):
    """0.3 °/√h = 0.3/60 °/s/√Hz; 12 °/h."""
    assert answer("info card.json", cwd=folder)["card"]["device"] == "unit 7"
    noise = TriadNoise(dps(np.full(3, 0.3 / 60.0)), dps(np.full(3, 12.0 / 3600.0)), np.zeros(3))
    NoiseCard("unit 7", "static.parquet", gyr=noise).save(folder / "noise.json")
    rows = {line[:26].strip(): line[26:].split() for line in typed("info noise.json", cwd=folder).stdout.splitlines()}
    for name, value in ("N white noise [°/√h]", 0.3), ("B bias instability [°/h]", 12.0), ("K random walk [°/h/√h]", 0):
        assert [*map(float, rows[name])] == [value] * 3
    assert answer("info noise.json", cwd=folder)["card"]["source"] == "static.parquet"
    for content in ("{", "3", '{"values": [1, 2, 3]}', '{"kind": "x"}'):
        (folder / "a.json").write_text(content)
        assert "is not a card" in typed("info a.json", cwd=folder, code=1).stderr
    (folder / "a.json").write_text('[{"t": 0, "ax": 1}]')
    assert "needs --profile" in typed("info a.json", cwd=folder, code=1).stderr  # a log is an array
