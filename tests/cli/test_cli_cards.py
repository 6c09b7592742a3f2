"""Cards: one that has more is kept, a card gives calibrated data out, every output says what is calibrated, claims."""

import io
import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

import plumbob
from plumbob import ImuData, ImuMeta, files
from plumbob.cli import common
from plumbob.cli.main import main
from plumbob.core.units import dps
from plumbob.data import UNCALIBRATED
from plumbob.data.cards import UNITS, CalibrationCard, NoiseCard, TriadCalibration, TriadNoise
from plumbob.files.mcap import open_log
from plumbob.live.recorded import read_recorded
from tests.helpers import beside
from tests.helpers.commandline import answer, table_of, typed

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
    words = "allan rest.parquet rest.parquet --calibration none card.json --label raw,corrected"
    both = answer(f"{words} {gyr}", cwd=made)
    alone = answer(f"allan rest.parquet {gyr} --deviation oadev", cwd=made)
    after = answer(f"allan rest.parquet {gyr} --deviation oadev --calibration card.json", cwd=made)
    for axis in ("gyr x", "gyr y", "gyr z"):
        assert both["raw"][axis]["curve"]["dev"] == alone[axis]["dev"]
        assert both["corrected"][axis]["curve"]["dev"] == after[axis]["dev"]
        assert both["corrected"]["changes"][axis]["ratio"] == pytest.approx([GAIN], rel=1e-12)
    assert [both[label]["calibration"] for label in ("raw", "corrected")] == [None, "card.json"]
    assert (alone["calibration"], after["calibration"]) == (None, "card.json")
    card = tmp_path / "noise.json"
    typed(f"allan rest.parquet --triads gyr --calibration card.json --card {card}", cwd=made)
    assert "rest.parquet, calibrated with card.json" in plumbob.NoiseCard.load(card).source


CARD = "unit 7 2026-11-21 (table)"


@pytest.fixture
def session_folder(samples, tmp_path):
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
def test_files_of_uncalibrated_values_say_so(session_folder, words, names):
    for name in names.split():
        typed(words.replace("RECORD", RECORD).format(f"out-{name}"), cwd=session_folder)
        assert "uncalibrated" in contents(session_folder / f"out-{name}")


PRINTED = beside(__file__, "printed.txt").splitlines()


@pytest.mark.parametrize("words", PRINTED)
def test_reports_of_uncalibrated_values_say_so(session_folder, words):
    assert UNCALIBRATED in " ".join(typed(words.replace("RECORD", RECORD), cwd=session_folder).stdout.split())


def test_a_card_is_named_in_place_of_it_nothing_goes_stale_and_tables_have_the_note_elsewhere(session_folder):
    """On standard output, in JSON, in the track, in text and in the stream, and by all who read those."""
    run = "run rest.parquet --filter mahony"
    assert answer(run, cwd=session_folder)["calibration"] is None
    report = answer(run, "--calibration", "card.json", "--out", "good.csv", cwd=session_folder)
    assert (report["calibration"], report["filter"][:7]) == (CARD, "mahony(")
    done = typed(run, "--calibration", "card.json", cwd=session_folder)
    typed(RECORD, "--calibration", "card.json", "--text", "good.txt", "--out", "good.mcap", cwd=session_folder)
    assert answer("replay good.mcap", cwd=session_folder)["calibration"] == CARD
    compared = typed("eval good.csv rest.parquet", cwd=session_folder).stdout
    for text in (done.stdout, *(contents(session_folder / f"good.{suffix}") for suffix in ("csv", "txt", "mcap"))):
        assert (CARD in text, "uncalibrated" in text) == (True, False)
    assert "uncalibrated" not in done.stderr + compared
    # The note is made anew from the meta: a recording that is calibrated later does not keep the old one.
    first = files.read(files.write(session_folder / "a.csv", files.read(session_folder / "rest.parquet")))
    later = replace(first, imu=replace(first.imu, meta=replace(first.imu.meta, calibration="unit 7 table")))
    for name in ("b.csv", "b.parquet"):
        files.write(session_folder / name, later)
        assert b"uncalibrated" not in (session_folder / name).read_bytes()
        assert not [note for note in files.read(session_folder / name).notes if note.code == "samples.uncalibrated"]
    done = typed("decode sea.bin --format buoy", cwd=session_folder)
    assert (UNCALIBRATED in done.stderr, "uncalibrated" in done.stdout) == (True, False)
    done = typed(f"{RECORD} --calibration other.json --out x.mcap", cwd=session_folder, code=1)
    assert "the card is for device 'unit 8'" in done.stderr
    assert not (session_folder / "x.mcap").exists()


@pytest.mark.parametrize("words", [(), ("--calibration", "card.json")])
def test_the_status_on_a_terminal(session_folder, words, monkeypatch):
    screen = io.StringIO()
    screen.isatty = lambda: True
    monkeypatch.chdir(session_folder)
    monkeypatch.setattr(common.sys, "stderr", screen)
    options = ("--format", "buoy", "--device", "unit 7", *words)
    assert main(["record", "--from", "sea.bin", *options]) == 0
    assert "samples" in screen.getvalue()
    assert ("samples UNCALIBRATED" in screen.getvalue()) is (not words)


def test_samples_beyond_the_temperatures_of_the_card_are_noted_once(session_folder):
    """The card holds from 30 to 40 °C; the recordings are at 25 °C."""
    card = CalibrationCard.load(session_folder / "card.json")
    gyr = replace(card.gyr, bias_per_k=dps(np.full((1, 3), 0.02)), temp_span_c=(30.0, 40.0))
    replace(card, gyr=gyr).save(session_folder / "warm.json")
    beyond = "100 % of the samples are at 25.0 to 25.0 °C, beyond the 30.0 to 40.0 °C of the calibration of gyr"
    run = "run rest.parquet --filter mahony --calibration"
    assert beyond in typed(run, "warm.json", cwd=session_folder).stderr
    assert sum(beyond in note["text"] for note in answer(run, "warm.json", cwd=session_folder)["notes"]) == 1
    codes = [note["code"] for note in answer(run, "card.json", cwd=session_folder)["notes"]]
    assert "card.temperature_beyond" not in codes
    assert typed(RECORD, "--calibration", "warm.json", "--out", "a.mcap", cwd=session_folder).stderr.count(beyond) == 1
    assert sum(beyond in note["text"] for note in answer("replay a.mcap", cwd=session_folder)["notes"]) == 1


def test_benchmarks_say_it_of_each_trial(session_folder, tmp_path_factory):
    trials, first = tmp_path_factory.mktemp("trials"), files.read(session_folder / "rest.parquet")
    meta = replace(first.imu.meta, calibration="unit 7 table")
    files.write(trials / "a.parquet", first)
    files.write(trials / "b.parquet", replace(first, imu=replace(first.imu, meta=meta)))
    words = "benchmark accuracy . --filters mahony --frame NED"
    assert answer(words, cwd=trials)["calibration"] == {"a": UNCALIBRATED, "b": "unit 7 table"}


def test_info_shows_the_values_of_a_card(session_folder):
    """0.3 °/√h = 0.3/60 °/s/√Hz; 12 °/h."""
    assert answer("info card.json", cwd=session_folder)["card"]["device"] == "unit 7"
    noise = TriadNoise(dps(np.full(3, 0.3 / 60.0)), dps(np.full(3, 12.0 / 3600.0)), np.zeros(3))
    NoiseCard("unit 7", "static.parquet", gyr=noise).save(session_folder / "noise.json")
    rows = {
        line[:26].strip(): line[26:].split()
        for line in typed("info noise.json", cwd=session_folder).stdout.splitlines()
    }
    for name, value in ("N white noise [°/√h]", 0.3), ("B bias instability [°/h]", 12.0), ("K random walk [°/h/√h]", 0):
        assert [*map(float, rows[name])] == [value] * 3
    assert answer("info noise.json", cwd=session_folder)["card"]["source"] == "static.parquet"
    for content in ("{", "3", '{"values": [1, 2, 3]}', '{"kind": "x"}'):
        (session_folder / "a.json").write_text(content)
        assert "is not a card" in typed("info a.json", cwd=session_folder, code=1).stderr
    (session_folder / "a.json").write_text('[{"t": 0, "ax": 1}]')
    assert "needs --profile" in typed("info a.json", cwd=session_folder, code=1).stderr  # a log is an array


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
