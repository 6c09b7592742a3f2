"""Every output of uncalibrated values says so in words, and of calibrated ones names the card."""

import io as io_module
import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from plumbob import files
from plumbob.cli.main import main
from plumbob.core.units import dps
from plumbob.data import UNCALIBRATED, calibration_told
from plumbob.data.cards import CalibrationCard, NoiseCard, TriadNoise
from plumbob.files.mcap import open_log
from plumbob.rotations import Frame
from plumbob.simulation import simulate

FORMAT = """
kind = "plumbob format"
version = 1
name = "six"
title = "made-up unit with six axes and a thermometer"
byte_order = "little"

[frame]
sync = "A5 5A"
length = 18
rate = "100 Hz"
checksum = { kind = "crc16-ccitt-false", at = -2, from = 2 }

[[field]]
name = "gyr"
axes = "xyz"
type = "s16"
counts = 65.5
unit = "deg/s"

[[field]]
name = "acc"
axes = "xyz"
type = "s16"
counts = 8192
unit = "g"

[[field]]
name = "temp_c"
type = "s16"
counts = 100
unit = "degC"
"""


@pytest.fixture
def told(capsys):
    """Run a command, and give what it said."""

    def run(*words, code=0):
        capsys.readouterr()
        assert main([str(word) for word in words]) == code
        return capsys.readouterr()

    return run


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """An uncalibrated recording with its reference, the card of its unit, a capture of bytes, and their format."""
    from plumbob.protocols.decode import columns_of
    from plumbob.protocols.encode import encode
    from plumbob.protocols.format_toml import load_format

    folder = tmp_path_factory.mktemp("bare")
    unit = {"sensors": "mpu6000+hmc5983", "unit": "random", "seed": 4}
    found = simulate("static", frame=Frame.NED, duration=4.0, rate=100.0, **unit)
    imu = replace(found.imu, meta=replace(found.imu.meta, device="unit 7"))
    files.write(folder / "raw.parquet", files.Recording(imu=imu, track=found.truth, name="raw"))
    card = replace(found.calibration, device="unit 7", date="2026-11-21", method="table")
    card.save(folder / "card.json")
    replace(card, device="unit 8").save(folder / "other.json")
    (folder / "six.toml").write_text(FORMAT, encoding="utf-8")
    form = load_format(folder / "six.toml")
    (folder / "a.bin").write_bytes(encode(form, columns_of(imu, form.message())).tobytes())
    return folder


def test_the_words():
    assert calibration_told(None) == UNCALIBRATED == "NONE: these sensor values are uncalibrated"
    assert calibration_told("unit 7 2026-11-21 (table)") == "unit 7 2026-11-21 (table)"


class TestRun:
    def test_uncalibrated(self, made, told, tmp_path):
        out = tmp_path / "track.parquet"
        said = told("run", made / "raw.parquet", "--filter", "mahony", "--out", out)
        assert f"calibration  {UNCALIBRATED}" in said.out
        assert "uncalibrated" in said.err
        assert UNCALIBRATED in files.read(out).track.source
        assert any(UNCALIBRATED in note for note in files.read(out).notes)

    def test_calibrated(self, made, told, tmp_path):
        out = tmp_path / "track.csv"
        words = ("--filter", "mahony", "--calibration", made / "card.json", "--out", out)
        said = told("run", made / "raw.parquet", *words)
        assert "calibration  unit 7 2026-11-21 (table)" in said.out
        kept = out.read_text(encoding="utf-8")
        assert "; calibration unit 7 2026-11-21 (table)" in kept
        assert "uncalibrated" not in said.out + said.err + kept

    def test_json(self, made, told):
        words = ("run", made / "raw.parquet", "--filter", "mahony", "--json")
        assert json.loads(told(*words).out)["calibration"] is None
        told_with = json.loads(told(*words, "--calibration", made / "card.json").out)
        assert told_with["calibration"] == "unit 7 2026-11-21 (table)"
        assert told_with["filter"].startswith("mahony(")

    def test_a_card_of_another_unit_is_refused(self, made, told):
        words = ("--filter", "mahony", "--calibration", made / "other.json")
        said = told("run", made / "raw.parquet", *words, code=1)
        assert "the card is for device 'unit 8', but the recording is of 'unit 7'" in said.err


class TestEval:
    @pytest.fixture
    def tracks(self, made, told, tmp_path):
        bare, good = tmp_path / "bare.parquet", tmp_path / "good.parquet"
        told("run", made / "raw.parquet", "--filter", "mahony", "--out", bare)
        told("run", made / "raw.parquet", "--filter", "mahony", "--calibration", made / "card.json", "--out", good)
        return bare, good

    REMARK = "the estimate was made from uncalibrated sensor values, whose errors are in these figures"

    def test_text_json_and_page(self, made, told, tracks, tmp_path):
        bare, good = tracks
        page = tmp_path / "page.html"
        said = told("eval", bare, made / "raw.parquet", "--html", page)
        assert self.REMARK in " ".join(said.out.split())
        assert self.REMARK in page.read_text(encoding="utf-8")
        assert self.REMARK in json.loads(told("eval", bare, made / "raw.parquet", "--json").out)["notes"]
        assert "uncalibrated" not in told("eval", good, made / "raw.parquet").out


class TestFiles:
    def test_info_of_samples_and_of_a_track(self, made, told, tmp_path):
        assert f"calibration  {UNCALIBRATED}" in told("info", made / "raw.parquet").out
        out = tmp_path / "track.parquet"
        told("run", made / "raw.parquet", "--filter", "mahony", "--out", out)
        assert UNCALIBRATED in told("info", out).out

    @pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mcap"])
    def test_converted_samples(self, made, told, tmp_path, suffix):
        out = tmp_path / f"out{suffix}"
        told("convert", made / "raw.parquet", out, "--what", "samples")
        if suffix == ".mcap":
            held = open_log(out).metadata["recording"]
        elif suffix == ".parquet":
            held = str(pq.read_metadata(out).metadata)
        else:
            held = out.read_text(encoding="utf-8")
        assert f"calibration: {UNCALIBRATED}" in held

    def test_what_a_file_says_does_not_go_stale(self, made, told, tmp_path):
        """The note is made anew from the meta: a recording that is calibrated later does not keep the old one."""
        first = files.read(files.write(tmp_path / "a.csv", files.read(made / "raw.parquet")))
        later = replace(first, imu=replace(first.imu, meta=replace(first.imu.meta, calibration="unit 7 table")))
        for name in ("b.csv", "b.parquet"):
            files.write(tmp_path / name, later)
            assert b"uncalibrated" not in (tmp_path / name).read_bytes()
            assert not [note for note in files.read(tmp_path / name).notes if note.startswith("calibration")]

    @pytest.mark.parametrize("suffix", [".tum", ".txt"])
    def test_converted_attitude(self, made, told, tmp_path, suffix):
        track, out = tmp_path / "track.parquet", tmp_path / f"out{suffix}"
        told("run", made / "raw.parquet", "--filter", "mahony", "--out", track)
        told("convert", track, out)
        assert UNCALIBRATED in out.read_text(encoding="utf-8").splitlines()[0]


class TestDecode:
    def test_text(self, made, told):
        said = told("decode", made / "a.bin", "--format", made / "six.toml")
        assert f"note: calibration {UNCALIBRATED}" in said.err
        assert "uncalibrated" not in said.out  # which is a table that other programs read

    @pytest.mark.parametrize("suffix", [".json", ".parquet"])
    def test_files(self, made, told, tmp_path, suffix):
        out = tmp_path / f"a{suffix}"
        told("decode", made / "a.bin", "--format", made / "six.toml", "--out", out)
        if suffix == ".json":
            assert json.loads(out.read_text())["calibration"] == UNCALIBRATED
        else:
            assert pq.read_metadata(out).metadata[b"calibration"] == UNCALIBRATED.encode()


class TestLine:
    def record(self, made, told, tmp_path, *words, code=0):
        options = ("--format", made / "six.toml", "--device", "unit 7", "--filter", "mahony", "--frame", "NED")
        return told("record", "--from", made / "a.bin", *options, "--out", tmp_path / "a.mcap", *words, code=code)

    def test_record_and_replay(self, made, told, tmp_path):
        text = tmp_path / "a.txt"
        said = self.record(made, told, tmp_path, "--text", text)
        assert f"calibration  {UNCALIBRATED}" in said.out
        assert UNCALIBRATED in text.read_text(encoding="utf-8").splitlines()[0]
        assert open_log(tmp_path / "a.mcap").metadata["calibration"] == UNCALIBRATED
        assert f"calibration  {UNCALIBRATED}" in told("replay", tmp_path / "a.mcap").out
        out = tmp_path / "b.parquet"
        told("replay", tmp_path / "a.mcap", "--out", out)
        assert UNCALIBRATED in files.read(out).track.source

    def test_the_status_on_a_terminal(self, made, told, tmp_path, monkeypatch, capsys):
        from plumbob.cli import common

        class Terminal(io_module.StringIO):
            def isatty(self):
                return True

        for words, bare in (((), True), (("--calibration", made / "card.json"), False)):
            screen = Terminal()
            monkeypatch.setattr(common.sys, "stderr", screen)
            self.record(made, told, tmp_path, *words)
            assert "samples" in screen.getvalue()
            assert ("samples UNCALIBRATED" in screen.getvalue()) is bare
            (tmp_path / "a.mcap").unlink()

    def test_with_a_card(self, made, told, tmp_path):
        text = tmp_path / "a.txt"
        said = self.record(made, told, tmp_path, "--text", text, "--calibration", made / "card.json")
        assert "calibration  unit 7 2026-11-21 (table)" in said.out
        assert "; calibration unit 7 2026-11-21 (table)" in text.read_text(encoding="utf-8").splitlines()[0]
        assert open_log(tmp_path / "a.mcap").metadata["calibration"] == "unit 7 2026-11-21 (table)"
        assert (
            json.loads(told("replay", tmp_path / "a.mcap", "--json").out)["calibration"] == "unit 7 2026-11-21 (table)"
        )

    def test_a_card_of_another_unit_is_refused(self, made, told, tmp_path):
        said = self.record(made, told, tmp_path, "--calibration", made / "other.json", code=1)
        assert "the card is for device 'unit 8', but imu.device is 'unit 7'" in said.err
        assert not (tmp_path / "a.mcap").exists()
        self.record(made, told, tmp_path)
        said = told("replay", tmp_path / "a.mcap", "--calibration", made / "other.json", code=1)
        assert "the card is for 'unit 8', but the recording is of 'unit 7'" in said.err


class TestTemperature:
    """The card holds from 30 to 40 °C; the recordings are at 25 °C."""

    @pytest.fixture
    def card(self, made, tmp_path):
        card = CalibrationCard.load(made / "card.json")
        gyr = replace(card.gyr, bias_per_k=dps(np.full((1, 3), 0.02)), temp_span_c=(30.0, 40.0))
        replace(card, gyr=gyr).save(tmp_path / "warm.json")
        return tmp_path / "warm.json"

    TOLD = "100 % of the samples are at 25.0 to 25.0 °C, beyond the 30.0 to 40.0 °C of the calibration of gyr"

    def test_run(self, made, told, card):
        words = ("run", made / "raw.parquet", "--filter", "mahony", "--calibration", card)
        assert self.TOLD in told(*words).err
        assert self.TOLD in json.loads(told(*words, "--json").out)["temperature_beyond"]
        inside = json.loads(told(*words[:-1], made / "card.json", "--json").out)
        assert inside["temperature_beyond"] is None

    def test_record_and_replay_say_it_once(self, made, told, card, tmp_path):
        options = ("--format", made / "six.toml", "--device", "unit 7", "--calibration", card)
        said = told("record", "--from", made / "a.bin", *options, "--out", tmp_path / "a.mcap")
        assert said.err.count(self.TOLD) == 1
        replayed = told("replay", tmp_path / "a.mcap", "--json")
        assert self.TOLD in json.loads(replayed.out)["temperature_beyond"]


class TestBenchmark:
    def test_accuracy_says_it_of_each_trial(self, made, told, tmp_path):
        first = files.read(made / "raw.parquet")
        files.write(tmp_path / "a.parquet", first)
        words = ("benchmark", "accuracy", tmp_path, "--filters", "mahony", "--frame", "NED")
        assert told(*words).out.splitlines()[1] == f"calibration {UNCALIBRATED}: all"
        meta = replace(first.imu.meta, calibration="unit 7 table")
        files.write(tmp_path / "b.parquet", replace(first, imu=replace(first.imu, meta=meta)))
        assert told(*words).out.splitlines()[1:3] == [f"calibration {UNCALIBRATED}: a", "calibration unit 7 table: b"]
        told_in_json = json.loads(told(*words, "--json").out)["calibration"]
        assert told_in_json == {"a": UNCALIBRATED, "b": "unit 7 table"}

    def test_scenario_says_it_of_each_filter(self, told):
        words = ("static", "--sensors", "mpu6000+hmc5983", "--unit", "random", "--frame", "NED", "--seeds", 1)
        said = told("benchmark", "scenario", *words, "--duration", "2s", "--filters", "mahony")
        assert f"; calibration {UNCALIBRATED}" in " ".join(said.out.split())


class TestInfoOfCards:
    def test_a_calibration_card(self, made, told):
        said = told("info", made / "card.json").out
        assert said.startswith("Certificate of calibration\ndevice      unit 7\ndate        2026-11-21\n")
        assert "bias [°/s]" in said
        assert json.loads(told("info", made / "card.json", "--json").out)["card"]["device"] == "unit 7"

    def test_a_noise_card(self, told, tmp_path):
        """0.3 °/√h = 0.3/60 °/s/√Hz; 12 °/h."""
        noise = TriadNoise(dps(np.full(3, 0.3 / 60.0)), dps(np.full(3, 12.0 / 3600.0)), np.zeros(3))
        NoiseCard("unit 7", "static.parquet", gyr=noise).save(tmp_path / "noise.json")
        said = told("info", tmp_path / "noise.json").out
        assert said.startswith("Noise card\ndevice      unit 7\n- static.parquet\n\nGyroscope\n")
        rows = {line[:26].strip(): line[26:].split() for line in said.splitlines()}
        assert rows["N white noise [°/√h]"] == ["0.300"] * 3
        assert rows["B bias instability [°/h]"] == ["12.0"] * 3
        assert rows["K random walk [°/h/√h]"] == ["0"] * 3
        assert json.loads(told("info", tmp_path / "noise.json", "--json").out)["card"]["source"] == "static.parquet"

    @pytest.mark.parametrize(("content", "says"), [("{", "is not a card"), ("[]", "is not a card: its 'kind' must be"),
                                                   ('{"kind": "x"}', "is not a card: its 'kind' must be")])  # fmt: skip
    def test_no_card(self, told, tmp_path, content, says):
        (tmp_path / "a.json").write_text(content)
        assert says in told("info", tmp_path / "a.json", code=1).err

    def test_no_file(self, told, tmp_path):
        assert "a.json" in told("info", tmp_path / "a.json", code=1).err
