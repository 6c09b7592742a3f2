"""Sessions: what they say, and what they refuse before anything is opened."""

import json
import sys
from datetime import UTC, datetime

import numpy as np
import pytest

from plumbob import Frame
from plumbob.core.errors import CalibrationError, DecodeError, FrameError, ParameterError, PlumbobError, UnitError
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.session.session_toml import load_session, parse_session, plain_session, recorded_session
from plumbob.session.stream import Stream
from tests.helpers.live_samples import FORMAT, SESSION, motion, reads, session, stream


def card(device="bench 7"):
    scaled = TriadCalibration(matrix=2.0 * np.eye(3), bias=np.zeros(3), unit_in="rad/s", unit_out="rad/s")
    return CalibrationCard(device=device, date="2026-01-01", method="made up", gyr=scaled)


def card_text(tmp_path, device="bench 7"):
    card(device).save(tmp_path / "card.json")
    return (tmp_path / "card.json").read_text()


def test_session_says_what_it_was_told():
    made = session(
        SESSION
        + '[source]\nkind = "serial"\nport = "/dev/ttyUSB0"\nbaud = 115200\n[record]\npath = "a.mcap"\nrotate = "1 h"\n'
    )
    assert (made.source.kind, made.source.settings["port"]) == ("serial", "/dev/ttyUSB0")
    assert made.frame is Frame.NED
    assert made.meta.device == "bench 7"
    assert made.meta.gyr_range == pytest.approx(np.radians(32767 / 65.5), rel=1e-12)  # the largest count both ways
    assert made.record.rotate == 3600.0
    assert made.stage.params["gate"] == "0.08 g"


def test_session_keeps_every_text_that_it_needs_and_reads_back_from_them(tmp_path):
    text = SESSION + '[calibration]\ncard = "card.json"\n'
    made = session(text, **{"card.json": card_text(tmp_path)})
    assert set(made.texts) == {"session.toml", "imu9.toml", "card.json"}
    again = recorded_session(made.texts, "bench")
    assert again.card.name == made.card.name
    assert again.form == made.form
    with pytest.raises(DecodeError, match=r"does not hold imu9\.toml"):
        recorded_session({"session.toml": text}, "bench")


def test_card_is_applied_and_the_uncalibrated_values_stay(tmp_path):
    made = session(SESSION + '[calibration]\ncard = "card.json"\n', **{"card.json": card_text(tmp_path)})
    line = Stream(made)
    part = next(p for p in map(line.feed, reads(stream(0.5))) if p is not None)
    np.testing.assert_array_equal(part.imu.gyr, 2.0 * part.sensed.gyr)
    assert part.imu.meta.calibration == f"{card().name}; NOT calibrated: acc, mag"
    assert part.sensed.meta.calibration is None


def test_axes_turn_the_case_into_the_body():
    line = Stream(session(SESSION.replace('frame = "NED"', 'frame = "NED"\naxes = "x -y -z"')))
    part = next(p for p in map(line.feed, reads(stream(0.5))) if p is not None)
    acc = motion(0.5).imu.acc[0]
    np.testing.assert_allclose(part.sensed.acc[0], acc * [1, -1, -1], rtol=0, atol=0.5 / 8192 * 9.81)


WRONG = {
    "unknown key": (SESSION + "[imu2]\n", DecodeError, "no key 'imu2'"),
    "no frame": (SESSION.replace('frame = "NED"', ""), FrameError, r"\[estimate\] needs imu.frame"),
    "unknown filter": (SESSION.replace("mahony", "mahoney"), ParameterError, "mahoney"),
    "gain without unit": (SESSION.replace('"0.08 g"', "0.08"), ParameterError, "needs a unit"),
    "rate without unit": (SESSION + '[record]\npath = "a.mcap"\nrotate = "60"\n', UnitError, "has no unit"),
    "unknown source": (SESSION + '[source]\nkind = "carrier pigeon"\n', DecodeError, "serial"),
    "source without baud": (SESSION + '[source]\nkind = "serial"\nport = "x"\n', DecodeError, "baud"),
    "both formats": (SESSION.replace("[imu]", 'name = "mpu6000"\n[imu]'), DecodeError, "either the name"),
    "unknown device": (SESSION.replace('file = "imu9.toml"', 'name = "imu10"'), ParameterError, "not a known device"),
    "unknown option": (SESSION.replace("[imu]", 'options = { x = "1" }\n[imu]'), ParameterError, "no option 'x'"),
    "no TOML": ("=", DecodeError, "not valid TOML"),
    "number that cannot be printed": (
        SESSION.replace("version = 1", f"version = 0x{'f' * 5000}"),
        DecodeError,
        "64 bits",
    ),
    "lists without end": (SESSION.replace("kp = 0.5", f"kp = {'[' * 33}{']' * 33}"), DecodeError, "more than 32 deep"),
    "other kind": (FORMAT, DecodeError, "no key"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_session_is_refused_with_a_word(case):
    text, error, word = WRONG[case]
    with pytest.raises(error, match=word):
        session(text)


def test_card_of_another_unit_is_refused(tmp_path):
    with pytest.raises(PlumbobError, match="device 'other'") as caught:
        session(SESSION + '[calibration]\ncard = "c.json"\n', **{"c.json": card_text(tmp_path, "other")})
    assert isinstance(caught.value, ParameterError | CalibrationError)


def test_files_lie_beside_the_session(tmp_path):
    (tmp_path / "imu9.toml").write_text(FORMAT)
    (tmp_path / "buoy.toml").write_text(SESSION)
    assert load_session(tmp_path / "buoy.toml").name == "buoy"
    (tmp_path / "imu9.toml").unlink()
    with pytest.raises(DecodeError, match=r"buoy\.toml: .*imu9\.toml does not exist"):
        load_session(tmp_path / "buoy.toml")


def test_session_from_options_reads_back():
    text = plain_session(
        form="mpu6000",
        source={"kind": "udp", "port": 5000},
        format={"options": {"gyr_range": "500 deg/s"}},
        estimate={"filter": "mahony", "params": {"kp": "0.5"}},
        imu={"frame": "ENU", "device": 'a "b"'},
    )
    made = parse_session(text, {}.__getitem__, name="x")
    assert made.form.chosen["gyr_range"] == "500 deg/s"
    assert made.meta.device == 'a "b"'
    assert json.dumps(made.stage.params["kp"]) == '"0.5"'


def placed(day='date = "2028-07-04"', source=""):
    return SESSION.replace('frame = "NED"', f'frame = "NED"\nplace = "42.283,-71.35,1000"\n{day}') + source


def test_the_place_of_a_line_is_looked_up_once_and_kept_with_its_recording(monkeypatch):
    """MATLAB's example of wrldmagm has −13.6891° there on that day."""
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    made = session(placed())
    assert np.degrees(made.meta.declination) == pytest.approx(-13.6891, abs=0.0055)
    monkeypatch.setitem(sys.modules, "pygeomag", None)  # a replay elsewhere, later, without the model
    assert recorded_session(made.texts, "bench").meta == made.meta


def test_only_a_line_that_is_yet_to_run_is_of_today():
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    live = '[source]\nkind = "serial"\nport = "/dev/ttyUSB0"\nbaud = 9600\n'
    assert datetime.now(UTC).date().isoformat() in session(placed("", live)).texts["earth_field.json"]
    with pytest.raises(ParameterError, match=r"imu\.place needs a day"):
        session(placed("", '[source]\nkind = "file"\npath = "a.bin"\n'))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (placed('declination = "1 deg"'), "says the declination too"),
        (SESSION.replace('frame = "NED"', 'frame = "NED"\ndate = "2028-07-04"'), "imu.place, which is missing"),
    ],
)
def test_a_place_stands_alone(text, told):
    with pytest.raises(DecodeError, match=told):
        session(text)


def test_a_damaged_field_of_a_recording_is_refused():
    made = {**session(SESSION).texts, "session.toml": placed(), "earth_field.json": "[1"}
    with pytest.raises(DecodeError, match="holds no declination"):
        recorded_session(made, "bench")
