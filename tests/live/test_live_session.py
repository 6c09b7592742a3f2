"""Sessions: what a file may say, with cards, and the filter of it."""

import json
import os
import re
import socket
import sys
import threading
import time
import tty
from dataclasses import replace
from datetime import UTC, datetime
from itertools import product
from pathlib import Path

import numpy as np
import pyarrow.csv
import pytest

import plumbob
from plumbob import (
    AttitudeTrack,
    Filter,
    Frame,
    NoiseCard,
    North,
    Recording,
    earth_acceleration,
    files,
    flags,
    json_schema,
    replay,
    simulate,
)
from plumbob.arm.array.paper import teaching_arm
from plumbob.calibration.calibration import Capture, card_of
from plumbob.calibration.fit import Fitted, Mounted
from plumbob.cli.main import main
from plumbob.core.constants import G0
from plumbob.core.errors import (
    CalibrationError,
    ClockError,
    DecodeError,
    FrameError,
    ParameterError,
    PlumbobError,
    ShapeError,
    UnitError,
)
from plumbob.core.event import Event
from plumbob.core.units import dps
from plumbob.data import UNCALIBRATED, ImuData, ImuMeta
from plumbob.data.cards import UNITS, CalibrationCard, Mount, TriadCalibration, TriadNoise
from plumbob.door.reading import opened_array
from plumbob.files import read, write
from plumbob.filters import filter_names, load, takes_noise
from plumbob.filters.offline import CHUNK, Stage, bias_beyond, run_stage, with_noise
from plumbob.fleet.experiments.scenario import measure_scenario
from plumbob.live import sources
from plumbob.live.emulated import running_rig
from plumbob.live.replay import open_recording
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.live.runner import SETTLED, Watch
from plumbob.live.session_toml import load_session, parse_session, plain_session, recorded_session
from plumbob.live.sinks import Collected, TextSink
from plumbob.live.stream import STARTED_AGAIN, Stream
from plumbob.live.transports.transport import Received
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import parse_format
from plumbob.reporting.catalogue import start
from plumbob.rotations import quat_conjugate, quat_from_euler_zyx, quat_from_rotvec, quat_multiply, quat_rotate
from plumbob.simulation.presets import draw_module
from plumbob.viewer import playback
from plumbob.viewer.switch import Switch
from tests.helpers import Clock, beside, commandline
from tests.helpers.commandline import ok, refused
from tests.helpers.live_samples import FORMAT, SESSION, Handed, motion, reads, record, session, stream, through
from tests.helpers.motion import noisy
from tests.helpers.outlets import Kept

ALL = beside(__file__, "all_units.toml")
CARDED = SESSION + '[calibration]\ncard = "card.json"\n'
CardError = (ParameterError, CalibrationError)


def card(device="bench 7"):
    scaled = TriadCalibration(matrix=2.0 * np.eye(3), bias=np.zeros(3), unit_in="rad/s", unit_out="rad/s")
    return CalibrationCard(device=device, date="2026-01-01", method="made up", gyr=scaled)


def test_session_says_what_it_was_told_and_one_of_options_reads_back():
    made = session(
        SESSION
        + '[source]\nkind = "serial"\nport = "/dev/ttyUSB0"\nbaud = 115200\n[record]\npath = "a.mcap"\nrotate = "1 h"\n'
    )
    assert (made.source.kind, made.source.settings["port"]) == ("serial", "/dev/ttyUSB0")
    assert made.frame is Frame.NED
    assert made.meta.device == "bench 7"
    assert made.meta.gyr_range == pytest.approx(np.radians(32767 / 65.5), rel=1e-12)  # the largest count both ways
    assert (made.record.rotate, made.stage.params["gate"]) == (3600.0, "0.08 g")
    text = plain_session(
        form="mpu6000", source={"kind": "udp", "port": 5000}, format={"options": {"gyr_range": "500 deg/s"}},
        estimate={"filter": "mahony", "params": {"kp": "0.5"}}, imu={"frame": "ENU", "device": 'a "b"'},
    )  # fmt: skip
    made = parse_session(text, {}.__getitem__, name="x")
    assert (made.form.chosen["gyr_range"], made.meta.device) == ("500 deg/s", 'a "b"')
    assert made.stage.params == {"kp": "0.5"}


def test_session_keeps_every_text_that_it_needs_and_reads_back_from_them(tmp_path):
    made = session(CARDED, **{"card.json": card().text()})
    assert set(made.texts) == {"session.toml", "imu9.toml", "card.json"}
    again = recorded_session(made.texts, "bench")
    assert again.card.name == made.card.name
    assert again.form == made.form
    texts = session(SESSION).texts
    (tmp_path / "buoy.toml").write_text(SESSION)
    for make, error, words in (
        (lambda: recorded_session({"session.toml": SESSION}, "bench"), DecodeError, r"does not hold imu9\.toml"),
        (
            lambda: recorded_session(texts | {"session.toml": placed(), "earth_field.json": "[1"}, "bench"),
            DecodeError,
            "holds no declination",
        ),
        (lambda: load_session(tmp_path / "buoy.toml"), DecodeError, r"buoy\.toml: .*imu9\.toml does not exist"),
        (lambda: session(CARDED, **{"card.json": card("other").text()}), CardError, "device 'other'"),
    ):
        with pytest.raises(error, match=words):
            make()
    (tmp_path / "imu9.toml").write_text(FORMAT)
    assert load_session(tmp_path / "buoy.toml").name == "buoy"


def first_part(made):
    line = Stream(made)
    return next(part for part in map(line.feed, reads(stream(0.5))) if part is not None)


def test_card_and_axes_are_applied_and_a_temperature_that_is_missing_is_the_last_known():
    part = first_part(session(CARDED, **{"card.json": card().text()}))
    np.testing.assert_array_equal(part.imu.gyr, 2.0 * part.sensed.gyr)
    assert part.imu.meta.calibration == f"{card().name}; NOT calibrated: acc, mag"
    assert part.sensed.meta.calibration is None
    part = first_part(session(SESSION.replace('frame = "NED"', 'frame = "NED"\naxes = "x -y -z"')))
    acc = motion(0.5).imu.acc[0]
    np.testing.assert_allclose(part.sensed.acc[0], acc * [1, -1, -1], rtol=0, atol=0.5 / 8192 * 9.81)
    text = FORMAT + "overflow = [-1024]\n"
    values = {"counter": np.arange(4), "clock": 5000 * np.arange(4), "temp_c": np.array([21.0, 22.0, -10.24, 23.0])}
    data, line = encode(parse_format(text), values).tobytes(), Stream(session(**{"imu9.toml": text}))
    parts = [line.feed(Received(10_000_000 * k, data[60 * k : 60 * k + 60])) for k in range(2)]
    assert [part.sensed.temp_c.tolist() for part in parts] == [[21.0, 22.0], [22.0, 23.0]]


def placed(day='date = "2028-07-04"', source=""):
    return SESSION.replace('frame = "NED"', f'frame = "NED"\nplace = "42.283,-71.35,1000"\n{day}') + source


DATED = SESSION.replace('frame = "NED"', 'frame = "NED"\ndate = "2028-07-04"')
DEEP, LONG = f"{'[' * 33}{']' * 33}", f"0x{'f' * 5000}"
SERIAL = '[source]\nkind = "serial"\nport = "x"\n'
WRONG = {
    "no frame": (SESSION.replace('frame = "NED"', ""), FrameError, r"\[estimate\] needs imu.frame"),
    "unknown filter": (SESSION.replace("mahony", "mahoney"), ParameterError, "mahoney"),
    "gain without unit": (SESSION.replace('"0.08 g"', "0.08"), ParameterError, "needs a unit"),
    "rate without unit": (SESSION + '[record]\npath = "a.mcap"\nrotate = "60"\n', UnitError, "has no unit"),
    "unknown source": (SESSION + '[source]\nkind = "carrier pigeon"\n', DecodeError, "serial"),
    "source without baud": (SESSION + SERIAL, DecodeError, "baud"),
    "both formats": (SESSION.replace("[imu]", 'name = "mpu6000"\n[imu]'), DecodeError, "either the name"),
    "unknown device": (SESSION.replace('file = "imu9.toml"', 'name = "imu10"'), ParameterError, "not a known device"),
    "unknown option": (SESSION.replace("[imu]", 'options = { x = "1" }\n[imu]'), ParameterError, "no option 'x'"),
    "no TOML": ("=", DecodeError, "not valid TOML"),
    "number that cannot be printed": (SESSION.replace("version = 1", f"version = {LONG}"), DecodeError, "64 bits"),
    "lists without end": (SESSION.replace("kp = 0.5", f"kp = {DEEP}"), DecodeError, "more than 32 deep"),
    "other kind": (FORMAT, DecodeError, "line 2: kind must be one of 'plumbob session', but it is 'plumbob format'"),
    "place and declination": (placed('declination = "1 deg"'), DecodeError, "imu.place or imu.declination"),
    "rates of none": (SESSION + '[rates]\nfilter = "mekf"\n', ParameterError, "no channel filter 'mekf'"),
    "array of one": (SESSION + '[array]\nscheme = "monitor"\n', ParameterError, "needs several units"),
    "two attitudes": (ALL + '[array]\nscheme = "teaching_arm"\n', ParameterError, r"\[estimate\] does not go with"),
    "a date alone": (DATED, DecodeError, "imu.place, which is missing"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_session_is_refused_with_a_word(case):
    text, error, word = WRONG[case]
    with pytest.raises(error, match=word):
        session(text)


def rates(filter, **how):
    """Attitude of rates that a file has, compensated and filtered."""

    def estimated(file):
        made = plumbob.filter_rates(file, filter, rest=("0 s", "1 s"), **how)
        return plumbob.estimate(made.recording, "integrate", init="level", frame="NED").track

    return estimated


SYSTEMS = {  # what the page of next steps says of the file of each
    "fin": rates("moving_average", params={"samples": 1}),
    "buoy": lambda file: plumbob.estimate(file, "mahony", params={"kp": 0.5, "ki": 0.03, "gate": "0.08 g"}).track,
    "trackball": rates("scalar", params={"walk": "0.01 deg/s", "noise": "0.1 deg/s"}, drift="chen2013"),
    "arm": lambda file: teaching_arm(opened_array(file), frame="NED"),
    "rod": lambda file: plumbob.estimate(file, "ekf7", params={"hard_switch": True}).track,
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_started_system_runs_on_a_line_by_its_papers_method_as_on_its_file(name, tmp_path):
    file = tmp_path / f"{name}.toml"
    with running_rig(name, "--seed", "3") as port:
        ok("start", name, tmp_path, "--port", port)
        file.write_text(re.sub('rest = "[0-9]+ s"', 'rest = "1 s"', file.read_text()))
        ok("record", file, "--duration", "2.5s", cwd=tmp_path)
    (recording,), (text,) = tmp_path.glob("*.mcap"), tmp_path.glob("*.txt")
    again = plumbob.replay(recording, check=True)
    assert again.comparison.equal and len(again.track) > 10
    np.testing.assert_array_equal(again.track.q_nb, SYSTEMS[name](recording).q_nb)
    assert len(text.read_text().splitlines()) > 10
    assert f"plumbob record {name}.toml" in (tmp_path / "next.md").read_text()


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_value_that_is_missing_costs_one_sample_of_any_papers_method_on_a_line_as_of_its_file(name, tmp_path):
    start(name, tmp_path, port="none")
    text, plan, rng = tmp_path / f"{name}.toml", PLANS[name], np.random.default_rng(7)
    text.write_text(re.sub('rest = "[0-9]+ s"', 'rest = "1 s"', text.read_text()))
    made = load_session(text)
    data = make_rig(plan, made.form, seed=3, duration=4.0).frames.tobytes()
    message, pieces = made.form.message(made.message), range(0, len(data), 7 * made.form.message(made.message).length)
    for row, triad in product((0, *rng.integers(1, 30, 3)), {f.triad for f in message.fields} - {None, ""}):
        names = [f.name for f in message.fields if f.triad == triad][: 3 if made.units else rng.integers(1, 4)]
        line, found = Stream(made), Collected()
        for at in pieces:
            (frames,) = line.decoder.feed(data[at : at + pieces.step], 5_000_000_000 + at).values()
            for key in names:
                frames.columns[key][frames.start == row * message.length] = np.nan
            if part := line.through({made.message: frames}):
                found.on_part(part)
        track, said = found.track(), flags.GYR_ABSENT | flags.ACC_ABSENT | flags.MAG_ABSENT | flags.UNIT_EXCLUDED
        assert np.isfinite(track.q_nb[row + 1 :]).all() and np.ptp(track.q_nb[-5:], axis=0).any(), (row, names)
        assert track.flags[row] & said
        source = found.array(calibrated=False) if made.units else found.imu(calibrated=False)
        np.testing.assert_array_equal(SYSTEMS[name](source).q_nb, track.q_nb, err_msg=f"{row} {names}")


def test_started_board_that_prints_text_has_its_profile_and_nothing_is_written_over(tmp_path):
    ok("start", "text", tmp_path / "board", "--port", "/dev/ttyACM0")
    made = load_session(tmp_path / "board" / "text.toml")
    assert (made.source.settings["port"], made.meta.frame) == ("/dev/ttyACM0", Frame.ENU)
    assert "text.toml exists already" in refused("start", "text", tmp_path / "board")


def test_rest_that_does_not_end_gives_what_has_come_at_the_end_of_the_line():
    text = SESSION + '[rates]\nfilter = "two_state"\nrest = "60 s"\n'
    line, found = through(list(reads(stream(2.0))), session(text))
    plain = through(list(reads(stream(2.0))), session())[1].imu(calibrated=True)
    file = plumbob.filter_rates(plain, "two_state", rest=(0.0, 60.0)).imu
    assert len(found.parts) == 1
    np.testing.assert_array_equal(found.imu(calibrated=True).gyr, file.gyr)
    assert [note.code for note in line.rate_notes] == ["rates.constant", "rates.filter"]


def test_a_line_has_the_place_and_day_of_its_run(monkeypatch):
    """MATLAB's example of wrldmagm has −13.6891° there on that day."""
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    made = session(placed())
    assert np.degrees(made.meta.declination) == pytest.approx(-13.6891, abs=0.0055)
    monkeypatch.setitem(sys.modules, "pygeomag", None)  # a replay elsewhere, later, without the model
    assert recorded_session(made.texts, "bench").meta == made.meta
    monkeypatch.undo()
    live = '[source]\nkind = "serial"\nport = "/dev/ttyUSB0"\nbaud = 9600\n'
    assert datetime.now(UTC).date().isoformat() in session(placed("", live)).texts["earth_field.json"]
    with pytest.raises(ParameterError, match=r"imu\.place needs a day"):
        session(placed("", '[source]\nkind = "file"\npath = "a.bin"\n'))


def test_editors_get_the_schema_of_each_kind_of_file():
    schemas = {kind: json_schema(kind) for kind in ("array", "chain", "format", "profile", "session")}
    assert {(kind, made["type"], made["additionalProperties"]) for kind, made in schemas.items()} == {
        (kind, "object", False) for kind in schemas
    }
    unit = schemas["session"]["properties"]["unit"]
    assert unit == schemas["array"]["properties"]["unit"] and unit["items"]["required"] == ["name"]
    length = {"type": "string", "description": "number and unit, as in '100 m'"}
    assert unit["items"]["properties"]["lever"] == {"type": "array", "items": length, "minItems": 3, "maxItems": 3}
    source = schemas["session"]["properties"]["source"]
    several, sources = (made.get("items", made)["anyOf"] for made in source["anyOf"])
    assert [made["required"] for made in several] == [made["required"] for made in sources]
    assert {"name", "format", "imu", "estimate", "reference"} <= several[1]["properties"].keys()
    assert sources[1]["properties"]["port"] == {"type": "integer", "minimum": 1, "maximum": 65535}
    assert [made["properties"]["kind"]["enum"] for made in sources[:2]] == [["serial"], ["udp"]]
    with pytest.raises(ShapeError, match="kind must be one of array, chain"):
        json_schema("card")


STALE = (
    "It was found with the axes that the accelerometer had before its calibration of 2026-11-21: calibrate it again."
)


def fitted(name, *, gain=1.01, remarks=()):
    model = TriadCalibration(gain * np.eye(3), np.zeros(3), UNITS[name], UNITS[name], method=f"{name} known")
    return Fitted(model, np.zeros((1, 3)), np.zeros(1), np.ones(1, dtype=bool), remarks)


def captured(base=None):
    imu = ImuData(t=[0.0, 1.0], acc=np.full((2, 3), 5.0), meta=ImuMeta(device="unit 7"))
    return Capture(imu, "unit 7", base, "2026-11-21")


DIP = ("the dip is 62°.",)
MOUNTED = Mounted(Mount([1.0, 0.0, 0.0, 0.0]), ("nothing shows the heading.",))


def said(part):
    return tuple(map(str, part.remarks))


def test_remarks_of_fits_and_of_a_mounting_are_on_the_card_and_stay_when_it_grows():
    card = card_of(captured(), {"mag": fitted("mag", remarks=("the dip is 62°.",))}, mounted=MOUNTED)
    read = CalibrationCard.from_text(card.text(), "card.json")
    assert [said(part) for part in (card.mag, card.mount, read.mag)] == [DIP, MOUNTED.remarks, DIP]
    grown = card_of(captured(card), {"acc": fitted("acc", remarks=("pose 3 was moved.",))}, mounted=MOUNTED)
    assert (said(grown.acc), said(grown.mount)) == (("pose 3 was moved.",), MOUNTED.remarks)
    assert len(card_of(captured(card), {"mag": fitted("mag")}).mag.remarks) == 0
    assert (
        card_of(captured(card_of(captured(), {"gyr": fitted("gyr", remarks=DIP)})), {}).gyr.remarks[0].values["text"]
        == DIP[0]
    )


@pytest.mark.parametrize("had_acc", [False, True])
def test_a_new_accelerometer_makes_what_hangs_on_it_old(had_acc):
    older = {"gyr": fitted("gyr", remarks=("it was cold.",)), "mag": fitted("mag")}
    first = card_of(captured(), older | ({"acc": fitted("acc")} if had_acc else {}), mounted=MOUNTED)
    grown = card_of(captured(first), {"acc": fitted("acc")})
    later = card_of(replace(captured(grown), date="2027-01-01"), {"acc": fitted("acc"), "mag": fitted("mag")})
    assert {name: said(getattr(grown, name)) for name in ("acc", "gyr", "mag", "mount")} == {
        "acc": (), "gyr": ("it was cold.", STALE), "mag": (STALE,), "mount": (*MOUNTED.remarks, STALE),
    }  # fmt: skip
    assert said(later.gyr) == ("it was cold.", STALE.replace("2026-11-21", "2027-01-01"))
    at_rest = card_of(captured(), {"gyr": fitted("gyr", gain=1.0)})  # a bias at rest does not hang on it
    assert len(later.mag.remarks) == len(card_of(captured(at_rest), {"acc": fitted("acc")}).gyr.remarks) == 0


CARD = NoiseCard("unit 7", "a test", gyr=TriadNoise([1e-4] * 3, [0.0] * 3, [2e-5] * 3))


def test_what_filters_offer_is_what_their_files_hold_and_cards_go_to_those_that_take_one():
    assert [name for name in filter_names() if hasattr(load(name), "COVARIANCE")] == ["ekf7", "mekf"]
    assert [name for name in filter_names() if takes_noise(name)] == ["ekf7", "mekf"]
    assert all(hasattr(load(name), "COVARIANCE") is hasattr(load(name), "covariance") for name in filter_names())
    stages = [Stage("mekf", {"mag": False}, "a"), Stage("mahony", {}, "b"), Stage("mekf", {}, "c")]
    given = with_noise(stages, CARD)
    assert [stage.noise for stage in given] == [CARD, None, CARD]
    assert [(stage.name, stage.params) for stage in given] == [(stage.name, stage.params) for stage in stages]
    assert run_stage(noisy(CHUNK + 100), given[1], frame=Frame.ENU).cov_b is None
    with pytest.raises(ParameterError, match="mahony has no parameter that a noise card could give"):
        run_stage(noisy(), with_noise([Stage("mahony", {})], CARD)[0], frame=Frame.ENU)


@pytest.mark.parametrize("name", ["ekf7", "mekf"])
def test_a_covariance_goes_on_over_chunks_and_a_card_sets_the_noise_but_parameters_have_the_last_word(name):
    data = noisy(CHUNK + 100)
    track = run_stage(data, Stage(name, {}), frame=Frame.ENU)
    whole = Filter(name, frame=Frame.ENU).process(data, covariance=True)
    assert track.cov_b.shape == (len(data), 3, 3)
    assert track.q_nb.tobytes() == whole.q_nb.tobytes()
    assert track.cov_b.tobytes() == whole.cov_b.tobytes()
    data, field = noisy(), {"ekf7": "gyro_noise", "mekf": "gyr_noise"}[name]
    given = {field: 3e-4}
    for params in ({}, given):
        track = run_stage(data, Stage(name, params, noise=CARD), frame=Frame.ENU)
        made = Filter(name, frame=Frame.ENU, params=params, noise=CARD)
        assert track.source == f"{made.describe()}; calibration {UNCALIBRATED}"
        assert getattr(made.params, field) == pytest.approx(params.get(field, 1e-4), rel=1e-15)


T = np.arange(400) / 100.0


def moved(frame, q_nb=None):
    """A body that turns and swings by sin along all axes; samples of ideal sensors, attitudes, and the acceleration."""
    frame = Frame.parse(frame)
    acc_n = np.outer(np.sin(2.0 * np.pi * T), [1.0, -2.0, 0.5])
    q_nb = quat_from_rotvec(np.outer(T, [0.3, -0.2, 0.5])) if q_nb is None else q_nb
    force_b = quat_rotate(quat_conjugate(q_nb), acc_n + G0 * np.asarray(frame.up))
    rate = np.tile([0.3, -0.2, 0.5], (T.size, 1))  # about a fixed axis, so it is the same in body axes
    imu = ImuData(t=T, gyr=rate, acc=force_b, meta=ImuMeta(frame=frame, calibration="ideal", rate_nominal=100.0))
    return imu, AttitudeTrack(t=T, q_nb=q_nb, frame=frame, north="true", cov_b=np.zeros((T.size, 3, 3))), acc_n


@pytest.mark.parametrize("frame", ["ENU", "NED", "NWU"])
def test_what_was_put_in_comes_out_along_the_axes_of_the_frame(frame):
    imu, track, acc_n = moved(frame)
    found = earth_acceleration(imu, track)
    assert found.acc_n == pytest.approx(acc_n, abs=1e-13)
    assert found.sd_n == pytest.approx(0.0, abs=1e-13)  # an ideal unit and attitude
    word = {"ENU": "east", "NED": "north", "NWU": "north"}[frame]
    assert list(found.columns())[:2] == ["t [s]", f"acc_{word} [m/s2]"]


def test_the_deviation_is_the_spread_of_attitudes_and_samples_of_that_covariance():
    imu, track, acc_n = moved("ENU")
    rng, at, count = np.random.default_rng(5), 130, 40_000
    root = np.array([[0.02, 0.0, 0.0], [0.005, 0.01, 0.0], [0.0, -0.01, 0.03]])  # rad
    card = NoiseCard("u", "made", acc=TriadNoise([0.01, 0.02, 0.03], np.zeros(3), np.zeros(3)))
    cov = np.broadcast_to(root @ root.T, (T.size, 3, 3))
    claimed = earth_acceleration(imu, AttitudeTrack(T, track.q_nb, "ENU", "true", cov_b=cov), noise=card).sd_n[at]
    turned = quat_multiply(track.q_nb[at], quat_from_rotvec(rng.normal(size=(count, 3)) @ root.T))
    noise = rng.normal(size=(count, 3)) * [0.1, 0.2, 0.3]  # N √rate, rate 100 Hz
    spread = (quat_rotate(turned, imu.acc[at] + noise) - [0.0, 0.0, G0] - acc_n[at]).std(axis=0)
    assert claimed == pytest.approx(spread, rel=0.02)  # 1/√(2 · 40 000) is 0.35 %; the rest is of second order


def test_run_writes_it_and_what_does_not_fit_is_refused(tmp_path):
    imu, track, _ = moved("ENU")
    write(tmp_path / "a.parquet", imu)
    words = ["run", str(tmp_path / "a.parquet"), "--filter", "mekf", "--out", str(tmp_path / "track.parquet")]
    assert main([*words, "--acceleration", str(tmp_path / "acc.csv")]) == 0
    table = pyarrow.csv.read_csv(tmp_path / "acc.csv")
    columns = earth_acceleration(imu, read(tmp_path / "track.parquet").track).columns()
    assert table.column_names == list(columns)
    assert table.column_names[3:5] == ["acc_up [m/s2]", "acc_east_sd [m/s2]"]
    assert all(np.array_equal(table[name].to_numpy(), values) for name, values in columns.items())
    with pytest.raises(ClockError, match="different times"):
        earth_acceleration(imu[1:], track)
    with pytest.raises(ShapeError, match="no accelerometer"):
        earth_acceleration(ImuData(t=T, gyr=imu.gyr), track)


LAG = {"lag": "0.6 s"}


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Little of the past is smoothed with each part, so that its border moves through these few seconds."""
    for where in ("live", "samples"):  # live first: what is imported later would keep it
        monkeypatch.setattr(f"plumbob.filters.smoother.{where}.MARGIN", 2.0)


def lagged(**params):
    return replace(session(), stage=Stage("smoother", LAG | params))


@pytest.mark.parametrize("lag", [0.0, 0.6])
def test_attitudes_are_those_of_the_recording_and_of_its_replay_to_the_bit_and_none_is_lost(tmp_path, lag):
    """They come by the lag later, and no more than a part beyond: reads bring up to some tens of samples."""
    chosen = lagged(lag=f"{lag} s")
    line, live = through(reads(stream(4.0)), chosen, TextSink(tmp_path / "a.txt", 0.1), recording=tmp_path / "a.mcap")
    track, batch = live.track(), run_stage(live.imu(calibrated=True), line.session.stage, frame=line.session.frame)
    for name in ("t", "q_nb", "bias_b", "cov_b", "flags"):
        np.testing.assert_array_equal(getattr(track, name), getattr(batch, name))
    again = replay(tmp_path / "a.mcap", session=chosen, check=True)
    assert again.comparison.equal and again.comparison.compared == len(track)
    np.testing.assert_array_equal(np.concatenate([part.track_ns for part in live.parts]), live.t_ns)
    late = [part.imu.t[-1] - part.track.t[0] for part in live.parts if part.t_ns.size and part.track is not None]
    if lag:
        assert live.parts[-1].t_ns.size == 0  # the last ones come with the end of the stream
        assert len(late) > 3 and min(late) > lag and max(late) < lag + 0.2
    else:
        assert all(np.array_equal(part.track_ns, part.t_ns) for part in live.parts)
        _, other = through(reads(stream(4.0), seed=3), chosen)
        np.testing.assert_array_equal(track.q_nb, other.track().q_nb)  # however it was read
    lines = [line.split("\t") for line in (tmp_path / "a.txt").read_text().splitlines() if line[0].isdigit()]
    for line in lines[:: len(lines) // 5]:
        place = int(np.searchsorted(track.t, float(line[0]) - 1e-6))
        roll = np.degrees(plumbob.rotations.euler_zyx_from_quat(track.q_nb[place]))[0]
        assert float(line[0]) == pytest.approx(track.t[place], abs=1e-6)
        assert float(line[3]) == pytest.approx(roll, abs=1e-4)


def test_what_waits_is_given_before_a_recorder_starts_again_and_where_a_stream_ends_at_once():
    items = reads(stream(4.0))
    half = len(items) // 2
    event = Event(items[half].t_ns, STARTED_AGAIN, "the recorder was away")
    later = [Received(item.t_ns + 10**9, item.data) for item in items[half:]]
    _, found = through([*items[:half], event, *later], lagged())
    track = found.track()
    np.testing.assert_array_equal(np.concatenate([part.track_ns for part in found.parts]), found.t_ns)
    first = int(np.argmax(np.diff(track.t))) + 1
    assert track.flags[first] & flags.GAP
    alone = run_stage(found.imu(calibrated=True)[:first], lagged().stage, frame=Frame.NED)
    np.testing.assert_array_equal(track.q_nb[:first], alone.q_nb)
    _, found = through(reads(stream(4.0))[:1], lagged())
    assert len(found.track()) == len(found.t_ns) > 0
    assert through([], lagged())[1].track() is None
    with pytest.raises(ParameterError, match="cannot wait for the end, but lag is off"):
        Stream(lagged(lag=None))


def track(bias_dps):
    bias_b = None if bias_dps is None else dps(np.atleast_2d(np.asarray(bias_dps, dtype=float)))
    n = 3 if bias_b is None else len(bias_b)
    return AttitudeTrack(np.arange(n) * 0.01, np.tile([1.0, 0, 0, 0], (n, 1)), Frame.NED, North.FREE, bias_b=bias_b)


def test_filters_with_a_prior_are_those_with_such_a_parameter():
    made = {name: Filter(name, frame=Frame.NED).bias_prior for name in filter_names()}
    assert {name: prior for name, prior in made.items() if prior} == {
        "ekf7": ("start_bias", dps(1.0)), "mekf": ("bias_start", dps(0.5)), "vqf": ("bias_start", dps(0.5)),
    }  # fmt: skip


@pytest.mark.parametrize(("filter", "params", "bias", "beyond"), [
    ("mekf", {}, [1.49, 0.0, -1.49], False),  # 3 × 0.5 °/s
    ("mekf", {}, [0.0, 0.0, -1.51], True),
    ("mekf", {}, [[2.0, 0.0, 0.0], [0.0, 0.0, 0.0]], False),  # the last counts, not the start
    ("mekf", {"bias_start": "5 deg/s"}, [12.3, 0.0, 0.0], False),
    ("mekf", {}, [np.nan, 0.0, 0.0], False),
    ("mekf", {}, None, False),
    ("mahony", {}, [100.0, 0.0, 0.0], False),  # it has no prior
])  # fmt: skip
def test_three_standard_deviations(filter, params, bias, beyond):
    assert (bias_beyond(Filter(filter, frame=Frame.NED, params=params), track(bias)) != ()) is beyond
    (beyond,) = bias_beyond(Filter("mekf", frame=Frame.NED), track([0.1, -12.3, 0.0]))
    assert "the estimated gyroscope bias, 12.3 °/s, is far outside of the prior of 0.5 °/s (1 sd)" in str(beyond)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A gyroscope that is off by 4 °/s and perfect otherwise, at rest."""
    perfect = draw_module("mpu6000+hmc5983", 1).calibrated()
    unit = replace(perfect, gyr=replace(perfect.gyr, bias=dps(np.array([0.0, 4.0, 0.0]))))
    found = simulate("static", frame=Frame.NED, sensors=unit, unit="random", seed=1, duration=20.0, rate=100.0)
    path = tmp_path_factory.mktemp("bias") / "a.parquet"
    return files.write(path, Recording(imu=found.imu, name="a"))


def test_run_says_it_and_json_has_it(file):
    done = ok("run", file, "--filter", "mekf", "--json")
    (beyond,) = [n["text"] for n in json.loads(done.stdout)["notes"] if n["code"] == "estimate.bias_beyond"]
    assert "is far outside of the prior of 0.5 °/s" in beyond
    assert f"note: {beyond}" in done.stderr
    fits = ok("run", file, "--filter", "mekf", "--params", "bias_start=4 deg/s", "--json")
    assert "estimate.bias_beyond" not in [note["code"] for note in json.loads(fits.stdout)["notes"]]


def test_a_benchmark_says_in_how_many_seeds():
    found = measure_scenario(
        "static", [Stage("mekf", {}), Stage("mahony", {})], frame=Frame.NED, sensors="mpu6000+hmc5983",
        unit="random", seeds=range(3), settings={"duration": 20.0, "rate": 100.0},
    )  # fmt: skip
    many = len(found.warnings["mekf"])
    text = " ".join(found.text().split())
    assert many > 0  # the sheet allows ±20 °/s; within ±1.5 °/s on all three axes of all three units are (0.075)⁹
    assert f"in {many} of 3 seeds, as in the first of them: the estimated gyroscope bias" in text
    assert found.warnings["mahony"] == []
    assert found.summary()["warnings"]["mekf"] == found.warnings["mekf"]
    assert text.count("plumbob calibrate gyro") == 1


def test_a_line_says_it_in_the_part_in_which_a_start_in_motion_is_over():
    doubts_all = 'filter = "mekf"\nparams = { bias_start = "0.00001 deg/s", gyr_walk = "0.1 deg/s2/rtHz" }\n'
    line = Stream(session(SESSION.split("filter")[0] + doubts_all))
    notes, begins, size = [], [], 30 * 140
    status, data = Watch(line, notes.append), stream(duration=32.0)
    for at in range(0, len(data), size):  # reads of 0.7 s: one begins before the time and ends after it
        part = line.feed(Received(round((at + size) / 30 * 5e6), data[at : at + size]))
        if part is not None:
            status.on_part(part)
            begins += [part.imu.t[0]] if part.imu.t[-1] >= SETTLED else []
    assert begins[0] < SETTLED - 0.1
    assert notes == [f"at {begins[0]:.1f} s: {status.beyond[0]}"]


MS = 1_000_000


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(sources, "time", made)
    return made


@pytest.fixture
def slow(tmp_path):
    """Four reads and an event, at 0, 100, 250, 400 and 1000 ms of the host's time."""
    items = [Received(5_000 * MS + t * MS, bytes([i])) for i, t in enumerate((0, 100, 250, 1000))]
    items.insert(3, Event(5_400 * MS, "damaged", "a character had a wrong stop bit", 1))
    record(tmp_path / "slow.mcap", items)
    return open_recording(tmp_path / "slow.mcap")[0], items


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_a_recording_is_read_at_its_pace_times_the_speed(slow, clock, speed):
    """An item that came t after the first comes t / K after it; four times as fast is a quarter of the time."""
    log, items = slow
    source, start, came = sources.ReplaySource(log, speed), clock.ns, []
    while not source.finished:
        for item in source.read(0.1):
            came.append((item.t_ns, clock.ns - start))
    assert [t_ns for t_ns, _ in came] == [item.t_ns for item in items]  # the times themselves stay
    assert [waited for _, waited in came] == [round(t * MS / speed) for t in (0, 100, 250, 400, 1000)]


def test_an_event_of_another_clock_holds_nothing_up(tmp_path, clock):
    """A file's bytes count their own time; that a target was opened has the host's."""
    items = [Received(t * MS, bytes([i])) for i, t in enumerate((0, 100, 200))]
    host = [
        Event(42_302_000 * MS, "opened", "file:a.jsonl is open."),
        Event(42_302_001 * MS, "wall-clock", "it was set."),
    ]
    record(tmp_path / "file.mcap", [items[0], host[0], *items[1:], host[1]])
    source, start = sources.ReplaySource(open_recording(tmp_path / "file.mcap")[0], 1.0), clock.ns
    came = []
    while not source.finished:
        came += [(item, clock.ns - start) for item in source.read(0.1)]
    assert [item for item, _ in came] == [items[0], host[0], *items[1:], host[1]]
    assert [waited for _, waited in came] == [0, 100 * MS, 100 * MS, 200 * MS, 200 * MS]


def test_times_are_those_of_the_speed_and_a_late_reader_does_not_fall_further_behind(slow, clock):
    source, start = sources.ReplaySource(slow[0], 2.0), clock.ns
    source.read(0.1)
    clock.ns += 180 * MS  # the items of 50, 125 and 200 ms were due, or are soon
    came = [clock.ns - start for _ in range(4) if source.read(0.1)]
    assert came == [180 * MS, 180 * MS, 200 * MS, 500 * MS]
    source, start = sources.ReplaySource(slow[0]), clock.ns
    assert [item.t_ns for item in source.read(0.1)] == [item.t_ns for item in slow[1]]
    assert source.finished
    assert clock.ns == start
    # at 20 times the speed, 3 ms after the start stand for 60 ms
    start = clock.ns
    items = [Received(start, b"a"), Received(start + 3 * MS, b"b"), Event(start + 10 * MS, "damaged", "x", 1)]
    source = sources.Stretched(Handed(items), 20.0)
    assert [item.t_ns - start for item in source.read(0.0)] == [0, 60 * MS, 200 * MS]
    assert (source.name, source.finished) == ("handed", True)


@pytest.mark.parametrize(("speed", "stretched"), [("", False), ("speed = 20\n", True)])
def test_a_session_s_speed_stretches_its_source(monkeypatch, speed, stretched):
    chosen = session(
        'kind = "plumbob session"\nversion = 1\n[format]\nfile = "imu9.toml"\n'
        f'[source]\nkind = "udp"\nport = 5000\n{speed}'
    )

    class Opened:
        def open(self):
            return Handed([])

    monkeypatch.setattr(sources, "make_source", lambda spec: Opened())
    assert isinstance(sources.open_source(chosen.source), sources.Stretched) is stretched


class Printer:
    """A device on a pseudo-terminal, which sends each piece when it is due, s, or up to `late` s afterwards."""

    def __init__(self, pieces, *, late=0.0):
        self._pieces, self._late = pieces, late
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._thread = threading.Thread(target=self._print, daemon=True)

    def begin(self, start=None):
        self._start = time.monotonic() if start is None else start
        self._thread.start()

    def _print(self):
        rng = np.random.default_rng(4)
        for due, piece in self._pieces:
            time.sleep(max(0.0, self._start + due + rng.uniform(0.0, self._late) - time.monotonic()))
            os.write(self._master, piece)

    def close(self):
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)


def angles_at(t):
    return np.array([0.9 * np.sin(1.5 * t), 0.4 * np.sin(2.0 * t), 0.5 * np.sin(t + 1.0)])


ANGLES = beside(__file__, "angles.profile.toml")


def printed_angles(rate, duration, ppm=0.0):
    for k in range(round(rate * duration)):
        t = k / rate
        cells = ",".join(f"{angle:.4f}" for angle in np.degrees(angles_at(t)))
        yield t, f"{round((70.0 + t * (1.0 + 1e-6 * ppm)) * 1e6)},{cells}\n".encode()


def printed_samples(rate, duration, ppm=0.0):
    for k in range(round(rate * duration)):
        t = k / rate
        q_nb, before = (quat_from_euler_zyx(angles_at(at)) for at in (t, t - 1.0 / rate))
        turn = quat_multiply(quat_conjugate(before), q_nb)
        gyr = 2.0 * rate * turn[1:] * np.sign(turn[0])
        triads = (gyr, *(quat_rotate(quat_conjugate(q_nb), np.array(v)) for v in ((0, 0, -9.80665), (22.0, 0, 42.0))))
        cells = ",".join(f"{value:.5f}" for value in np.concatenate(triads))
        yield t, f"{round((5.0 + t * (1.0 + 1e-6 * ppm)) * 1e6)},{cells}\n".encode()


def test_text_of_angles_alone_is_recorded_sent_replayed_and_evaluated_as_the_file_of_it(tmp_path):
    (tmp_path / "angles.toml").write_text(ANGLES)
    device = Printer(printed_angles(50.0, 2.0))
    ran = plumbob.record(
        port=device.port, profile=tmp_path / "angles.toml", out=tmp_path / "a.mcap", duration=2.5, opened=device.begin,
        text=tmp_path / "a.txt", send=[f"nmea file:{tmp_path / 'sent.txt'} 10Hz HDG,PASHR"],
    )  # fmt: skip
    device.close()
    assert ran.samples > 90
    assert "uncalibrated" not in ran.text()
    assert plumbob.replay(tmp_path / "a.mcap", check=True).comparison.equal
    text = b"".join(line for _, line in printed_angles(50.0, 2.0))
    (tmp_path / "a.csv").write_bytes(text)
    recording, file = (plumbob.read(tmp_path / name, profile=profile) for name, profile in (
        ("a.mcap", None), ("a.csv", tmp_path / "angles.toml")))  # fmt: skip
    assert recording.imu is None
    np.testing.assert_array_equal(recording.track.q_nb, file.track.q_nb[-ran.samples :])
    assert (tmp_path / "sent.txt").read_text().count("$PASHR") == ran.summary()["sent"][0]["sent"] > 10
    assert len((tmp_path / "a.txt").read_text().splitlines()) > 10
    loaded = playback.load(tmp_path / "a.mcap")
    assert playback.Player(loaded, Kept()).batch(0, ran.samples).rows["values"].shape[0] == ran.samples
    np.testing.assert_array_equal(loaded.reference.q_nb, recording.track.q_nb)
    switch = Switch(Stream(open_recording(tmp_path / "a.mcap")[1]), tmp_path, None)
    assert Path(switch.write_text("angles")).stem in switch.stop_text()
    assert plumbob.evaluate(tmp_path / "a.mcap", tmp_path / "a.mcap").summary()["total_rmse_deg"] < 1e-12


@pytest.mark.parametrize(
    ("name", "frame"),
    [("rion", None), ("ahrs500ga", None), ("buoy_attitude", None), ("vectornav_ypr", "NED"), ("vectornav_ahrs", "NED")],
)
def test_attitude_of_a_device_is_kept_from_a_port_as_from_its_bytes(name, frame, tmp_path):
    raw = tmp_path / "raw.bin"
    rig = {} if name == "buoy_attitude" else {"scenario": "buoy", "rate": 20.0}
    plumbob.emulate(name, seed=1, duration=1.0, write=raw, **rig)
    data = raw.read_bytes()
    size = len(data) // 20 + 1
    device = Printer([(k / 20, data[k * size : (k + 1) * size]) for k in range(20)])
    how = {"format": name, "north": "magnetic", "frame": frame, "rate": rig.get("rate")}
    plumbob.record(port=device.port, out=tmp_path / "port.mcap", duration=1.3, opened=device.begin, **how)
    device.close()
    plumbob.record(capture=raw, out=tmp_path / "file.mcap", **how)
    port, file = (plumbob.read(tmp_path / f"{source}.mcap").track for source in ("port", "file"))
    assert len(port) == len(file) >= 19
    np.testing.assert_array_equal(port.q_nb, file.q_nb)
    topics = {message.topic for message in open_recording(tmp_path / "port.mcap")[0]}
    assert "attitude" in topics
    assert ("imu" in topics) == (name not in ("rion", "vectornav_ypr"))


def test_two_sources_are_on_one_clock_and_judged_by_one_command(tmp_path):
    """The clock of the angles gains 3 ms a second: without its drift their times would be 12 ms off at the end."""
    samples, angles = (
        Printer(printed_samples(100.0, 4.0, -500.0), late=0.002),
        Printer(printed_angles(40.0, 4.0, 2500.0)),
    )
    (tmp_path / "angles.toml").write_text(ANGLES)
    triads = "".join(
        f'[{name}]\ncolumns = [{k}, {k + 1}, {k + 2}]\nunit = "{unit}"\n'
        for name, k, unit in (("gyr", 2, "rad/s"), ("mag", 8, "uT"), ("acc", 5, "m/s2"))
    )
    profile = ANGLES.partition("[reference]")[0] + triads + 'sign = "specific-force"\n'
    (tmp_path / "imu.toml").write_text('frame = "NED"\nnorth = "magnetic"\n' + profile)
    serial = 'kind = "serial"\nbaud = 115200\n'
    text = (
        'kind = "plumbob session"\nversion = 1\n'
        f'[[source]]\n{serial}port = "{samples.port}"\nlines = "imu.toml"\n'
        f'[[source]]\nname = "ahrs"\n{serial}port = "{angles.port}"\nlines = "angles.toml"\n'
        f'[estimate]\nfilter = "mekf"\n[[send]]\nas = "json"\nto = "file:{tmp_path}/sent.json"\nof = "ahrs"\n'
    )
    (tmp_path / "two.toml").write_text(text)

    def begin():
        start = time.monotonic() + 0.1
        samples.begin(start)
        angles.begin(start)

    ran = plumbob.record(tmp_path / "two.toml", out=tmp_path / "two.mcap", duration=4.5, opened=begin)
    samples.close()
    angles.close()
    told = ran.summary()["sources"]["ahrs"]
    assert told["clock_ppm"] == pytest.approx(3000.0, abs=200.0)
    again = plumbob.replay(tmp_path / "two.mcap", check=True)
    main, other = plumbob.read(tmp_path / "two.mcap"), plumbob.read(tmp_path / "two.mcap", unit="ahrs")
    assert other.imu is None
    due = {rate: (np.arange(round(4 * rate)) / rate)[-count:] for rate, count in
           ((100, len(main.imu)), (40, len(other.track)))}  # fmt: skip
    inside = due[40] >= due[100][0]
    error = (other.track.t - np.interp(due[40], due[100], main.imu.t))[inside]
    assert np.abs(error).max() < 1e-3
    judged = json.loads(commandline.ok("eval", tmp_path / "two.mcap", "ahrs", "--align", "time", "--json").stdout)
    assert abs(judged["alignment"]["time"]["offset_s"]) < 1e-3
    assert judged["total_rmse_deg"] < 1.0
    live = [message.data for message in open_recording(tmp_path / "two.mcap")[0] if message.topic == "attitude/ahrs"]
    assert len(live) == len(other.track) > 150
    assert again.comparison.equal and again.comparison.compared == len(again.track) + len(live)
    sent = [json.loads(line) for line in (tmp_path / "sent.json").read_text().splitlines()]
    assert np.isclose(sent[0]["heading_deg"] % 360.0, np.degrees(other.track.yaw % (2 * np.pi)), atol=0.01).any()
    for change, words in ((('name = "ahrs"\n', ""), "needs a name of its own"), (('of = "ahrs"', 'of = "b"'), "ahrs")):
        (tmp_path / "bad.toml").write_text(text.replace(*change))
        with pytest.raises(PlumbobError, match=words):
            plumbob.load_session(tmp_path / "bad.toml")


@pytest.mark.parametrize(
    ("outputs", "words"),
    [
        ({"out": "/proc/a.mcap"}, "/proc/a.mcap cannot be written"),
        ({"out": "none/a.mcap"}, "there is no folder none"),
        ({"text": "/proc/a.txt"}, "/proc/a.txt cannot be written"),
        ({"send": ["nmea file:/proc/a.txt"]}, "/proc/a.txt cannot be written"),
        ({"send": ["nmea tcp-listen:{busy}"]}, "cannot be written: Address already in use"),
        ({"send": ["nmea udp:127.0.0.1:9 10Hz HDT"]}, "declination"),
        ({"duration": "5 parsec"}, "not a unit of time"),
    ],
)
def test_outputs_and_units_are_checked_before_the_port_opens(outputs, words, tmp_path):
    (tmp_path / "angles.toml").write_text(ANGLES)
    with socket.create_server(("127.0.0.1", 0)) as busy, pytest.raises(PlumbobError, match=words):
        named = {key: [part.format(busy=busy.getsockname()[1]) for part in value] if key == "send" else value
                 for key, value in outputs.items()}  # fmt: skip
        plumbob.record(port="/dev/no-such-port", profile=tmp_path / "angles.toml", **named)
    assert len(list(tmp_path.iterdir())) == 1
