"""Sending beside a live recording, and at a replay, of an emulated rig behind a pseudo-terminal."""

import json
import re
import socket
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from pynmeagps import NMEAReader

import plumbob
from plumbob.core.errors import FrameError, ParameterError, PlumbobError
from plumbob.session.session_toml import load_session
from tests.helpers.live_samples import rig


def session(folder: Path, line: Path, more: str = "") -> Path:
    path = folder / "s.toml"
    path.write_text(f"""
kind = "plumbob session"
version = 1
[source]
kind = "serial"
port = "{line}"
baud = 115200
[format]
name = "buoy"
[imu]
device = "buoy"
frame = "NED"
[estimate]
filter = "mekf"
[record]
path = "{folder}/sea.mcap"
{more}
""")
    return path


def received(sock: socket.socket) -> list[bytes]:
    sock.settimeout(0.3)
    found = []
    try:
        while True:
            found.append(sock.recv(65536))
    except TimeoutError:
        return found


def test_live_and_replayed(tmp_path: Path) -> None:
    """A target that refuses all the time costs the recording nothing; the other gets 10 a second."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock, rig(tmp_path, "--duration", "30s") as line:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
        more = f'[[send]]\nas = "json"\nto = "udp:127.0.0.1:{port}"\nrate = "10 Hz"\n'
        notes: list[str] = []
        path = session(tmp_path, line, more)
        assert load_session(path).send[0].rate == 10.0
        result = plumbob.record(path, duration=3.0, send=["nmea tcp:127.0.0.1:1 10Hz"], note=notes.append)
        told = [json.loads(data) for data in received(sock)]
    assert not result.failed and not result.lossy
    assert result.recording is not None and result.recording["acknowledged"] == result.recording["rows"]
    assert any("tcp:127.0.0.1:1 cannot be opened now" in line for line in notes)
    assert 20 <= len(told) <= 31 and told[0]["utc"].startswith("20") and told[-1]["sigma_deg"].keys() == {
        "roll", "pitch", "heading",
    }  # fmt: skip
    assert told[-1]["rate_dps"] is not None and abs(told[-1]["acc_m_s2"][2] + 9.8) < 5.0  # forward-right-down

    file = tmp_path / "out.nmea"
    replayed = plumbob.replay(tmp_path / "sea.mcap", send=[f"nmea file:{file} 10Hz XDR,PASHR"])
    lines = file.read_bytes().splitlines(keepends=True)
    assert {line[:6] for line in lines} == {b"$IIXDR", b"$PASHR"}
    assert len(lines) == pytest.approx(2 * 10 * replayed.track.t[-1], abs=4)
    assert all(NMEAReader.parse(line) is not None for line in lines)

    again = tmp_path / "again.jsonl"
    sent = plumbob.send(tmp_path / "sea.mcap", "json", f"file:{again}", speed="max", rate="10Hz")
    first = json.loads(again.read_text().splitlines()[0])
    apart = np.datetime64(first["utc"][:-1]) - np.datetime64(told[0]["utc"][:-1])
    assert abs(apart) < np.timedelta64(1, "ms")  # the clocks are compared once for the recording, once for the target
    assert sent.attitudes == len(again.read_text().splitlines())
    assert json.loads(again.read_text().splitlines()[-1])["sigma_deg"]["roll"] is not None


def test_true_pace_over_tcp(tmp_path: Path) -> None:
    """Live over a server, whose client reads as fast as it comes."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    found = bytearray()

    def read() -> None:
        for _ in range(200):
            try:
                with socket.create_connection(("127.0.0.1", port), timeout=5.0) as sock:
                    while data := sock.recv(65536):
                        found.extend(data)
                    return
            except OSError:
                time.sleep(0.05)

    thread = threading.Thread(target=read)
    thread.start()
    with rig(tmp_path, "--duration", "30s") as line:
        plumbob.record(
            port=str(line),
            format="buoy",
            frame="NED",
            filter="mekf",
            duration=2.0,
            send=[f"nmea tcp-listen:{port} 5Hz"],
        )
    thread.join()
    rows = found.split(b"\r\n")
    assert 15 <= len(rows) <= 60 and all(row.startswith(b"$") for row in rows[:-1])


def test_what_does_not_go_together(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="nothing estimates"):
        plumbob.record(port=str(tmp_path), format="buoy", send=["json udp:127.0.0.1:9"])
    with pytest.raises(PlumbobError, match="needs a form and a target"):
        plumbob.record(port=str(tmp_path), format="buoy", frame="NED", filter="mekf", send=["json"])
    path = session(tmp_path, tmp_path, '[[send]]\nas = "jsn"\nto = "udp:127.0.0.1:9"\n')
    with pytest.raises(PlumbobError, match="send"):
        load_session(path)
    assert issubclass(FrameError, PlumbobError)


def test_a_file_read_faster_than_live_says_how_much_is_not_sent(tmp_path: Path) -> None:
    raw, sent = tmp_path / "buoy.bin", tmp_path / "sent.jsonl"
    plumbob.emulate("buoy", write=raw, duration="5 s", seed=1, unit="calibrated")
    text = f'kind = "plumbob session"\nversion = 1\n[source]\nkind = "file"\npath = "{raw}"\n[format]\nname = "buoy"\n'
    text += '[imu]\nframe = "NED"\n[estimate]\nfilter = "mekf"\n'
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    notes: list[str] = []
    plumbob.record(tmp_path / "s.toml", send=[f"json file:{sent} 10Hz"], note=notes.append)
    left = [int(found[1]) for line in notes if (found := re.search(r"(\d+) attitudes? not sent", line))]
    assert len(left) == 1 and left[0] + len(sent.read_text().splitlines()) == 50
