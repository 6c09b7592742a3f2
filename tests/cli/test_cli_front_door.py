"""The front door: what a verb prints and writes is what the function of the same words gives, from any kind of data."""

import inspect
import json
import sys
import threading
from types import SimpleNamespace

import numpy as np
import pytest

import plumbob
from plumbob.cli.engine import named_function
from plumbob.cli.verbs import VERBS
from plumbob.door.calibrate import KINDS, kind_options
from tests.helpers.commandline import answer, typed

SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "random"}


@pytest.fixture(scope="module")
def sea(samples):
    return samples / "sea.parquet"


@pytest.fixture(scope="module")
def poses(tmp_path_factory):
    file = tmp_path_factory.mktemp("door") / "poses.parquet"
    plumbob.write(file, plumbob.simulate("poses", seed=1, **SIM).imu)
    return file


FIRST = {"record", "docs", "run", "view", "control", "export"}
"""Verbs one of whose arguments has a default: the session, the page, the filter, what is shown or said, limits."""


def test_every_public_name_is_there_and_every_verb_has_its_function_with_keyword_only_options():
    assert [name for name in plumbob.__all__ if getattr(plumbob, name, None) is None] == []
    tables = {verb: table for verb, table in VERBS.items() if not table.kinds}
    tables |= {**VERBS["arm"].kinds, **VERBS["array"].kinds}
    functions = {verb: named_function(table.function or verb) for verb, table in tables.items()}
    for verb, function in functions.items():
        kinds = [one.kind for one in inspect.signature(function).parameters.values() if one.default is not one.empty]
        optional = kinds[1:] if verb in FIRST else kinds
        assert set(optional) <= {inspect.Parameter.KEYWORD_ONLY}


def test_run_is_estimate_and_info_is_info(sea, tmp_path, recorded, samples):
    printed = answer(f"run {sea} --filter mahony --out a.parquet", cwd=tmp_path)
    notes, done = [], []
    result = plumbob.estimate(sea, "mahony", note=notes.append, progress=lambda *counts: done.append(counts))
    assert (notes, done[0], done[-1]) == (
        [f"{result.name}: {finding}" for finding in result.notes],
        (0, 1200),
        (1200, 1200),
    )
    assert result.summary() == {name: printed[name] for name in result.summary()}
    recording = plumbob.read(sea)
    tracks = [plumbob.estimate(given, "mahony").track for given in (str(sea), recording, recording.imu)]
    tracks.append(plumbob.read(tmp_path / "a.parquet").track)
    assert {track.q_nb.tobytes() for track in tracks} == {result.track.q_nb.tobytes()}
    assert plumbob.evaluate(result, sea).summary()["total_rmse_deg"] == printed["errors"]["total_rmse_deg"]
    for file in (sea, recorded.recording["path"]):
        result = plumbob.info(file)
        assert json.loads(json.dumps(result.summary())) == answer(f"info {file}")
        assert str(plumbob.info(plumbob.read(file)).facts()["samples"]) == result.facts()["samples"]
    for file in (sea, samples / "noise.json"):
        assert plumbob.info(file, note=lambda line: None).text() + "\n" == typed(f"info {file}").stdout


def test_calibrate_and_allan_are_calibrate_and_allan(poses, tmp_path):
    typed(f"calibrate accel {poses} --gravity '9.81 m/s2' --out card.json", cwd=tmp_path)
    theirs = plumbob.CalibrationCard.load(tmp_path / "card.json").acc
    for gravity in ("9.81 m/s2", 9.81):
        card = plumbob.calibrate(poses, "accel", gravity=gravity).card
        assert np.array_equal(card.acc.matrix, theirs.matrix) and np.array_equal(card.acc.bias, theirs.bias)
    again = plumbob.calibrate(plumbob.read(poses).imu, "mag", calibration=card)
    assert set(again.card.parts) == {"acc", "mag"}
    still = plumbob.simulate("static", duration=60.0, seed=2, **SIM).imu
    plumbob.write(tmp_path / "rest.parquet", still)
    printed = answer("allan rest.parquet --triads gyr", cwd=tmp_path)
    ours = plumbob.allan(tmp_path / "rest.parquet", triads=("gyr",)).summary()
    assert json.loads(json.dumps(ours)) | {"file": "rest.parquet"} == printed
    of_array = plumbob.allan(still.gyr, rate="100 Hz", scale="1 rad/s")
    of_samples = plumbob.allan(still, triads=("gyr",))
    assert [a.sd for a in of_array.analyses] == pytest.approx([a.sd for a in of_samples.analyses], rel=1e-12)


def test_what_a_function_does_not_take_is_refused(poses, wire, recorded):
    reads = (plumbob.read, lambda what: plumbob.calibrate(what, "accel"), plumbob.allan)
    cases = [(use, (given,), {}, "must be the path of a file") for use in reads for given in (3, None)]
    cases += [(plumbob.calibrate, (poses, kind), {"shap": "auto"}, "has no option 'shap'") for kind in KINDS]
    cases += [
        (plumbob.estimate, (3, "mahony"), {}, "must be the path of a file"),
        (plumbob.record, (recorded.stream.session,), {"format": "buoy"}, "leave the other options out"),
        (plumbob.record, (), {"capture": wire, "port": "/dev/ttyUSB0", "format": "buoy"}, "give either a session file"),
        (plumbob.docs, (3,), {}, "there is no page 3"),
    ]
    for use, given, options, why in cases:
        with pytest.raises(plumbob.PlumbobError, match=why) as refusal:
            use(*given, **options)
        assert "shap" not in options or all(name in str(refusal.value) for name in kind_options(given[1]))
    with pytest.raises(TypeError, match="sped"):
        plumbob.record(capture=wire, format="buoy", sped=2)


@pytest.fixture(scope="module")
def wire(tmp_path_factory):
    file = tmp_path_factory.mktemp("door") / "buoy.bin"
    served = plumbob.emulate("buoy", seed=3, duration="5 s", write=file)
    assert repr(served) == "<Served: sent 500>"
    return file


@pytest.fixture(scope="module")
def recorded(wire):
    out = wire.with_suffix(".mcap")
    return plumbob.record(capture=wire, format="buoy", device="b7", frame="NED", filter="mahony",
                          params={"kp": 0.5, "gate": 0.8}, out=out)  # fmt: skip


def test_emulate_is_emulate_names_its_port_and_stops_when_it_is_told_to(wire, tmp_path):
    typed("emulate buoy --seed 3 --duration 5s --write b.bin", cwd=tmp_path)
    assert (tmp_path / "b.bin").read_bytes() == wire.read_bytes()
    stop, names = threading.Event(), []
    served = plumbob.emulate("buoy", tcp=":0", stop=stop, opened=lambda name: (names.append(name), stop.set()))
    assert (served.sent, names[0].rpartition(":")[0]) == (0, "tcp://127.0.0.1")


def test_decode_is_decode(wire, tmp_path):
    typed(f"decode {wire} --format buoy --out b.json", cwd=tmp_path)
    printed = json.loads((tmp_path / "b.json").read_text())
    raw, rows = wire.read_bytes(), []
    pieces = (raw[at : at + 777] for at in range(0, len(raw), 777))
    for given in (wire, str(wire), raw, pieces):
        decoded = plumbob.decode(given, "buoy")
        assert decoded.frames["buoy"].start.tolist() == printed["columns"]["byte"]
        assert decoded.counts.summary() == printed["counts"]
    decoded = plumbob.decode(wire, plumbob.find_format("buoy"), each=lambda frames, _: rows.extend(frames.values()))
    assert (decoded.frames, sum(map(len, rows)), decoded.counts.frames["buoy"]) == ({}, 500, 500)


def test_record_and_replay_are_record_and_replay(wire, recorded, tmp_path):
    words = "--format buoy --device b7 --frame NED --filter mahony --params kp=0.5,gate=0.8m/s2"
    printed, ours = answer(f"record --from {wire} {words} --out a.mcap", cwd=tmp_path), recorded.summary()
    for report in (printed, ours):
        report["recording"].pop("path")
        report.pop("session")
    assert json.loads(json.dumps(ours)) == printed
    assert (recorded.lossy, recorded.nothing) == (False, None)
    path = recorded.recording["path"]
    printed = answer(f"replay {path} --filter vqf --out v.parquet", cwd=tmp_path)
    again = plumbob.replay(path, filter="vqf")
    assert json.loads(json.dumps(again.summary())) == printed
    assert plumbob.read(tmp_path / "v.parquet").track.q_nb.tobytes() == again.track.q_nb.tobytes()
    same = plumbob.replay(path, check=True, keep="nothing")
    assert same.comparison.equal and same.track is None and same.imu is None
    assert again.imu.t.tobytes() == plumbob.read(path).imu.t.tobytes()


def test_a_card_goes_into_a_recording_from_a_file_or_as_an_object(tmp_path):
    plumbob.emulate("buoy", seed=3, duration=2.0, write=tmp_path / "b.bin", truth=tmp_path / "t.parquet")
    card = plumbob.CalibrationCard.load(tmp_path / "t.card.json")
    tracks = []
    for number, given in enumerate((card, tmp_path / "t.card.json")):
        out = tmp_path / f"{number}.mcap"
        plumbob.record(capture=tmp_path / "b.bin", format="buoy", device=card.device, frame="NED", filter="mahony",
                       calibration=given, out=out)  # fmt: skip
        tracks.append(plumbob.replay(out).track.q_nb.tobytes())
    assert tracks[0] == tracks[1]


def test_eval_convert_and_simulate_take_files_and_text_with_units(sea, tmp_path):
    plumbob.estimate(sea, "mahony").save(tmp_path / "t.parquet")
    printed = answer(f"eval t.parquet {sea} --settle 2s", cwd=tmp_path)
    assert json.loads(json.dumps(plumbob.evaluate(tmp_path / "t.parquet", sea, settle="2 s").summary())) == printed
    typed(f"convert {sea} a.csv --what samples", cwd=tmp_path)
    plumbob.convert(plumbob.read(sea), tmp_path / "b.csv", what="samples")
    rows = [(tmp_path / name).read_text().splitlines()[-1200:] for name in ("a.csv", "b.csv")]
    assert rows[0] == rows[1]
    by_text = plumbob.simulate("buoy", seed=1, duration="2 s", strength="0.5 gauss", dip="50 deg", **SIM)
    by_number = plumbob.simulate("buoy", seed=1, duration=2.0, strength=50.0, dip=np.radians(50.0), **SIM)
    assert by_text.imu.mag.tobytes() == by_number.imu.mag.tobytes()


def test_results_are_one_line_a_small_table_and_a_picture(sea, recorded, tmp_path):
    pytest.importorskip("matplotlib")
    result = plumbob.estimate(sea, "mahony")
    shown = (result, plumbob.evaluate(result, sea), plumbob.read(sea), plumbob.info(sea), recorded,
             plumbob.replay(recorded.recording["path"]), plumbob.simulate("buoy", seed=1, duration=2.0, **SIM),
             plumbob.verify(recorded.recording["path"]))  # fmt: skip
    for one in shown:
        assert len(repr(one).splitlines()) == 1
        assert repr(one).startswith(f"<{type(one).__name__}: ")
        assert one._repr_html_().startswith("<table>")
    figure = result.plot(tmp_path / "t.png")
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    assert [axes.get_ylabel() for axes in figure.axes] == ["q", "[deg]", "bias [rad/s]"]
    assert [line.get_label() for line in figure.axes[1].lines] == ["yaw", "pitch", "roll"]


def test_frames_have_the_columns_of_the_csv(sea, tmp_path, monkeypatch):
    """pandas is no dependency: what it would be handed is looked at, and its absence is told."""
    imu = plumbob.read(sea).imu
    plumbob.write(tmp_path / "a.csv", imu)
    header = next(line for line in (tmp_path / "a.csv").read_text().splitlines() if line.startswith("t [s]"))
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))
    assert ",".join(imu.to_frame()) == header
    assert plumbob.decode(bytes(0), "buoy").frames == {}
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(plumbob.PlumbobError, match="tables need pandas"):
        imu.to_frame()
