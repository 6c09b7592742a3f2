"""Sending beside a live recording, and at a replay, of an emulated rig behind a pseudo-terminal."""

import json
import re
import socket
from contextlib import suppress

import numpy as np
import pytest
from pynmeagps import NMEAReader

import plumbob
from plumbob.core.errors import ParameterError, PlumbobError
from plumbob.live.session_toml import load_session
from tests.helpers.commandline import emulated

BUOY = """
kind = "plumbob session"
version = 1
format = { name = "buoy" }
imu = { frame = "NED" }
estimate = { filter = "mekf" }
"""


def session(folder, more):
    (folder / "s.toml").write_text(BUOY + more, encoding="utf-8")
    return folder / "s.toml"


def received(sock):
    sock.settimeout(0.3)
    messages = []
    with suppress(TimeoutError):
        while True:
            messages.append(json.loads(sock.recv(65536)))
    return messages


def test_live_and_replayed(tmp_path):
    """A target that refuses all the time costs the recording nothing; the other gets 10 a second."""
    sea, notes = tmp_path / "sea.mcap", []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock, emulated(tmp_path, "--duration 30s") as line:
        sock.bind(("127.0.0.1", 0))
        more = f'[source]\nkind = "serial"\nport = "{line}"\nbaud = 115200\n[record]\npath = "{sea}"\n'
        more += f'[[send]]\nas = "json"\nto = "udp:127.0.0.1:{sock.getsockname()[1]}"\nrate = "10 Hz"\n'
        path = session(tmp_path, more)
        assert load_session(path).send[0].rate == 10.0
        result = plumbob.record(path, duration=3.0, send=["nmea tcp:127.0.0.1:1 10Hz"], note=notes.append)
        messages = received(sock)
    assert not result.failed and not result.lossy
    assert result.recording is not None and result.recording["acknowledged"] == result.recording["rows"]
    assert any("tcp:127.0.0.1:1 cannot be opened now" in line for line in notes)
    assert 20 <= len(messages) <= 31 and messages[0]["utc"].startswith("20")
    assert messages[-1]["sigma_deg"].keys() == {"roll", "pitch", "heading"}
    assert messages[-1]["rate_dps"] is not None and abs(messages[-1]["acc_m_s2"][2] + 9.8) < 5.0  # forward-right-down

    file = tmp_path / "out.nmea"
    replayed = plumbob.replay(sea, send=[f"nmea file:{file} 10Hz XDR,PASHR"])
    lines = file.read_bytes().splitlines(keepends=True)
    assert {line[:6] for line in lines} == {b"$IIXDR", b"$PASHR"}
    assert len(lines) == pytest.approx(2 * 10 * replayed.track.t[-1], abs=4)
    assert all(NMEAReader.parse(line) is not None for line in lines)

    sent = plumbob.send(sea, "json", f"file:{tmp_path / 'again.jsonl'}", speed="max", rate="10Hz")
    again = [json.loads(line) for line in (tmp_path / "again.jsonl").read_text().splitlines()]
    apart = np.datetime64(again[0]["utc"][:-1]) - np.datetime64(messages[0]["utc"][:-1])
    assert abs(apart) < np.timedelta64(1, "ms")  # the clocks are compared once for the recording, once for the target
    assert sent.attitudes == len(again)
    assert again[-1]["sigma_deg"]["roll"] is not None


def test_what_does_not_go_together(tmp_path):
    port = {"port": str(tmp_path), "format": "buoy"}
    with pytest.raises(ParameterError, match="nothing estimates"):
        plumbob.record(**port, send=["json udp:127.0.0.1:9"])
    with pytest.raises(PlumbobError, match="needs a form and a target"):
        plumbob.record(**port, frame="NED", filter="mekf", send=["json"])
    with pytest.raises(PlumbobError, match="send"):
        load_session(session(tmp_path, '[[send]]\nas = "jsn"\nto = "udp:127.0.0.1:9"\n'))


def test_a_file_read_faster_than_live_says_how_much_is_not_sent(tmp_path):
    raw, sent, notes = tmp_path / "buoy.bin", tmp_path / "sent.jsonl", []
    plumbob.emulate("buoy", write=raw, duration="5 s", seed=1, unit="calibrated")
    path = session(tmp_path, f'[source]\nkind = "file"\npath = "{raw}"\n')
    plumbob.record(path, send=[f"json file:{sent} 10Hz"], note=notes.append)
    (missing,) = [int(found[1]) for line in notes if (found := re.search(r"(\d+) attitudes? not sent", line))]
    assert missing + len(sent.read_text().splitlines()) == 50
