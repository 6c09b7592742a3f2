"""Sessions: what they say, and what they refuse before anything is opened."""

import re
import sys
from datetime import UTC, datetime

import numpy as np
import pytest

import plumbob
from plumbob import Frame, Stream, json_schema
from plumbob.arm.array.paper import paper
from plumbob.core.errors import CalibrationError, DecodeError, FrameError, ParameterError, ShapeError, UnitError
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.live.emulated import running_rig
from plumbob.live.session_toml import load_session, parse_session, plain_session, recorded_session
from plumbob.live.transports.transport import Received
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import parse_format
from tests.helpers import beside
from tests.helpers.commandline import ok, refused
from tests.helpers.live_samples import FORMAT, SESSION, motion, reads, session, stream, through

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
    "arm": lambda file: paper(plumbob.read_array(file), frame="NED"),
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
    sources = schemas["session"]["properties"]["source"]["anyOf"]
    assert sources[1]["properties"]["port"] == {"type": "integer", "minimum": 1, "maximum": 65535}
    assert [made["properties"]["kind"]["enum"] for made in sources[:2]] == [["serial"], ["udp"]]
    with pytest.raises(ShapeError, match="kind must be one of array, chain"):
        json_schema("card")
