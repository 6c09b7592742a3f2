"""The front door: what a verb prints and writes is what the function of the same words gives, from any kind of data."""

import inspect
import json
import sys
import threading
from operator import attrgetter

import numpy as np
import pytest

import plumbob
from plumbob.calibration.calibrate import KINDS, options_of
from plumbob.cli.main import VERBS
from plumbob.core.errors import ParameterError
from tests.helpers.commandline import ok

SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "random"}


@pytest.fixture(scope="module")
def sea(tmp_path_factory):
    file = tmp_path_factory.mktemp("door") / "sea.parquet"
    made = plumbob.simulate("buoy", duration=12.0, seed=1, **(SIM | {"unit": "calibrated"}))
    plumbob.write(file, plumbob.Recording(imu=made.imu, track=made.truth))
    return file


@pytest.fixture(scope="module")
def poses(tmp_path_factory):
    file = tmp_path_factory.mktemp("door") / "poses.parquet"
    plumbob.write(file, plumbob.simulate("poses", seed=1, **SIM).imu)
    return file


def test_every_public_name_is_there():
    assert [name for name in plumbob.__all__ if getattr(plumbob, name, None) is None] == []


RENAMED = {"run": "estimate", "eval": "evaluate", "sim": "simulate"}
OF_THE_PROGRAM = {"demo", "devices", "filters", "benchmark", "warmup"}
"""Verbs that list what is there or exercise it: in Python these are objects (`plumbob.filter_names`, `find_format`)."""
PACKAGES = {"arm": ("align", "run", "export", "replay"), "array": ("info", "combine", "monitor")}
"""Verbs whose kinds are functions of the package of the same name."""


FIRST = {"record", "docs", "run", "view", "watch"}
"""Verbs whose first argument has a default: the session, the page, the filter, what is shown."""


def test_every_verb_has_its_function_with_keyword_only_options():
    functions = {verb: RENAMED.get(verb, verb) for verb in set(VERBS) - OF_THE_PROGRAM - set(PACKAGES)}
    functions |= {f"{verb}.{kind}": f"{verb}.{kind}" for verb, kinds in PACKAGES.items() for kind in kinds}
    for verb, name in functions.items():
        function = attrgetter(name)(plumbob)
        assert callable(function)
        kinds = [one.kind for one in inspect.signature(function).parameters.values() if one.default is not one.empty]
        optional = kinds[1:] if verb in FIRST else kinds
        assert set(optional) <= {inspect.Parameter.KEYWORD_ONLY}


def test_run_is_estimate(sea, tmp_path):
    printed = json.loads(ok("run", sea, "--filter", "mahony", "--out", tmp_path / "a.parquet", "--json").stdout)
    result = plumbob.estimate(sea, "mahony")
    assert result.summary() == {name: printed[name] for name in result.summary()}
    assert plumbob.read(tmp_path / "a.parquet").track.q_nb.tobytes() == result.track.q_nb.tobytes()
    assert plumbob.evaluate(result, sea).summary()["total_rmse_deg"] == printed["errors"]["total_rmse_deg"]


def test_estimate_takes_files_recordings_and_samples_alike(sea):
    recording = plumbob.read(sea)
    tracks = [plumbob.estimate(given, "mahony").track for given in (sea, str(sea), recording, recording.imu)]
    assert len({track.q_nb.tobytes() for track in tracks}) == 1


def test_notes_come_as_they_are_found_and_stand_in_the_result(sea):
    said, done = [], []
    result = plumbob.estimate(sea, "mekf", note=said.append, progress=lambda *counts: done.append(counts))
    assert tuple(said) == result.notes
    assert isinstance(said, list)
    assert done[0] == (0, 1200) and done[-1] == (1200, 1200)


def test_calibrate_is_calibrate(poses, tmp_path):
    ok("calibrate", "accel", poses, "--out", tmp_path / "card.json")
    found = plumbob.calibrate(poses, "accel")
    ours, theirs = found.card.acc, plumbob.CalibrationCard.load(tmp_path / "card.json").acc
    assert np.array_equal(ours.matrix, theirs.matrix) and np.array_equal(ours.bias, theirs.bias)
    again = plumbob.calibrate(plumbob.read(poses).imu, "mag", calibration=found.card)
    assert set(again.card.parts) == {"acc", "mag"}


def test_units_are_text_or_si(poses):
    by_text, by_number = (plumbob.calibrate(poses, "accel", gravity=given) for given in ("9.81 m/s2", 9.81))
    assert np.array_equal(by_text.card.acc.matrix, by_number.card.acc.matrix)


@pytest.mark.parametrize("kind", KINDS)
def test_an_option_that_a_kind_does_not_have_is_refused_with_those_that_it_has(poses, kind):
    with pytest.raises(ParameterError, match="has no option 'shap'") as refused:
        plumbob.calibrate(poses, kind, shap="auto")
    assert all(name in str(refused.value) for name in options_of(kind))


def test_allan_is_allan(tmp_path):
    still = plumbob.simulate("static", duration=60.0, seed=2, **SIM).imu
    plumbob.write(tmp_path / "rest.parquet", still)
    printed = json.loads(ok("allan", tmp_path / "rest.parquet", "--triads", "gyr", "--json").stdout)
    told = plumbob.allan(tmp_path / "rest.parquet", triads=("gyr",)).summary()
    assert json.loads(json.dumps(told)) == printed
    of_array = plumbob.allan(still.gyr, rate="100 Hz", scale="1 rad/s")
    of_samples = plumbob.allan(still, triads=("gyr",))
    assert [a.sd for a in of_array.analyses] == pytest.approx([a.sd for a in of_samples.analyses], rel=1e-12)


@pytest.mark.parametrize("given", [3, None])
def test_what_is_no_data_is_refused(given):
    for use in (plumbob.read, lambda what: plumbob.calibrate(what, "accel"), plumbob.allan,
                lambda what: plumbob.estimate(what, "mahony")):  # fmt: skip
        with pytest.raises(ParameterError, match="must be the path of a file"):
            use(given)


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


def test_emulate_is_emulate(wire, tmp_path):
    ok("emulate", "buoy", "--seed", 3, "--duration", "5s", "--write", tmp_path / "b.bin")
    assert (tmp_path / "b.bin").read_bytes() == wire.read_bytes()


def test_emulate_names_its_port_and_stops_when_it_is_told_to():
    stop, names = threading.Event(), []
    served = plumbob.emulate("buoy", tcp=":0", stop=stop, opened=lambda name: (names.append(name), stop.set()))
    assert served.sent == 0
    assert names[0].startswith("tcp://127.0.0.1:")


def test_decode_is_decode(wire, tmp_path):
    ok("decode", wire, "--format", "buoy", "--out", tmp_path / "b.json")
    printed = json.loads((tmp_path / "b.json").read_text())
    whole = wire.read_bytes()
    pieces = (whole[at : at + 777] for at in range(0, len(whole), 777))
    for given in (wire, str(wire), whole, pieces):
        found = plumbob.decode(given, "buoy")
        assert found.frames["buoy"].start.tolist() == printed["columns"]["byte"]
        assert found.counts.summary() == printed["counts"]
    assert repr(found) == "<Decoded: buoy 500; junk 0 of 15500 bytes>"
    assert "<td>500</td>" in found._repr_html_()


def test_decode_hands_frames_on_as_they_come(wire):
    rows = []
    found = plumbob.decode(wire, plumbob.find_format("buoy"), each=lambda frames, _: rows.extend(frames.values()))
    assert found.frames == {}
    assert sum(map(len, rows)) == found.counts.frames["buoy"] == 500


def test_record_is_record(wire, recorded, tmp_path):
    words = ("--from", wire, "--format", "buoy", "--device", "b7", "--frame", "NED", "--filter", "mahony")
    gate = "kp=0.5,gate=0.8m/s2"
    printed = json.loads(ok("record", *words, "--params", gate, "--out", tmp_path / "a.mcap", "--json").stdout)
    ours = recorded.summary()
    for report in (printed, ours):
        report["recording"].pop("path")
        report.pop("session")
    assert json.loads(json.dumps(ours)) == printed
    assert not recorded.lossy
    assert recorded.nothing is None


def test_record_refuses_words_beside_a_session_and_more_than_one_line(wire, recorded):
    with pytest.raises(ParameterError, match="leave the other options out"):
        plumbob.record(recorded.stream.session, format="buoy")
    with pytest.raises(ParameterError, match="give either a session file"):
        plumbob.record(capture=wire, port="/dev/ttyUSB0", format="buoy")
    with pytest.raises(TypeError, match="sped"):
        plumbob.record(capture=wire, format="buoy", sped=2)


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


def test_replay_is_replay(recorded, tmp_path):
    path = recorded.recording["path"]
    printed = json.loads(ok("replay", path, "--filter", "vqf", "--out", tmp_path / "v.parquet", "--json").stdout)
    again = plumbob.replay(path, filter="vqf")
    assert json.loads(json.dumps(again.summary())) == printed
    assert plumbob.read(tmp_path / "v.parquet").track.q_nb.tobytes() == again.track.q_nb.tobytes()
    same = plumbob.replay(path, check=True, keep="nothing")
    assert same.comparison.equal and same.track is None and same.imu is None
    assert again.imu.t.tobytes() == plumbob.read(path).imu.t.tobytes()


def test_info_is_info(sea, recorded, tmp_path):
    for file in (sea, recorded.recording["path"]):
        done = ok("info", file, "--json")
        found = plumbob.info(file)
        assert json.loads(json.dumps(found.summary())) == json.loads(done.stdout)
        assert str(plumbob.info(plumbob.read(file)).facts()["samples"]) == found.facts()["samples"]
    assert plumbob.info(sea, note=lambda line: None).text() + "\n" == ok("info", sea).stdout
    plumbob.simulate("static", seed=1, duration="2 s", **SIM).noise.save(tmp_path / "noise.json")
    assert plumbob.info(tmp_path / "noise.json").text() + "\n" == ok("info", tmp_path / "noise.json").stdout


def test_eval_and_convert_take_files_and_text_with_units(sea, tmp_path):
    track = tmp_path / "t.parquet"
    plumbob.estimate(sea, "mahony").save(track)
    printed = json.loads(ok("eval", track, sea, "--settle", "2s", "--json").stdout)
    assert json.loads(json.dumps(plumbob.evaluate(track, sea, settle="2 s").summary())) == printed
    ok("convert", sea, tmp_path / "a.csv", "--what", "samples")
    plumbob.convert(plumbob.read(sea), tmp_path / "b.csv", what="samples")
    rows = [(tmp_path / name).read_text().splitlines()[-1200:] for name in ("a.csv", "b.csv")]
    assert rows[0] == rows[1]


def test_simulate_takes_text_with_units():
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

    class Pandas:
        DataFrame = dict

    imu = plumbob.read(sea).imu
    plumbob.write(tmp_path / "a.csv", imu)
    header = next(line for line in (tmp_path / "a.csv").read_text().splitlines() if line.startswith("t [s]"))
    monkeypatch.setitem(sys.modules, "pandas", Pandas)
    assert ",".join(imu.to_frame()) == header
    assert plumbob.decode(bytes(0), "buoy").frames == {}
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(plumbob.PlumbobError, match="tables need pandas"):
        imu.to_frame()
