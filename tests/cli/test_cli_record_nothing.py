"""A recording without a sample: exit code 1, which check failed, and what to look at."""

import json
import socket
import threading

import pytest

from plumbob.files.mcap import verify
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format, parse_format
from plumbob.protocols.overlap import unassigned
from tests.helpers import beside
from tests.helpers.commandline import call

FORMAT = beside(__file__, "unit.toml")
SESSION = """
kind = "plumbob session"
version = 1
source = {{ kind = "tcp", host = "127.0.0.1", port = {port} }}
format = {{ file = "unit.toml" }}
record = {{ path = "a.mcap", reserve = 0 }}
"""
COUNT = 60


def frames():
    columns = {f"gyr.{axis}": [0.0] * COUNT for axis in "xyz"}
    return encode(parse_format(FORMAT), columns).tobytes()


def record(folder, form, data, *words):
    """Record what a server sends within two seconds; half a one was too short on a loaded machine."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(10.0)  # where the recorder refuses to start

        def serve():
            client, _ = server.accept()
            with client:
                client.sendall(data)
                ended.wait(10.0)

        ended, thread = threading.Event(), threading.Thread(target=serve)
        thread.start()
        (folder / "unit.toml").write_text(form)
        (folder / "s.toml").write_text(SESSION.format(port=server.getsockname()[1]))
        try:
            return call("record", "s.toml", "--duration", "2s", *words, cwd=folder)
        finally:
            ended.set()
            thread.join()


@pytest.mark.parametrize(
    ("right", "wrong", "why", "advice"),
    [
        ('"crc16-ccitt-false"', '"crc16-xmodem"', f"rejected: {COUNT} for their checksum", "kind, at, from and to"),
        ("value = 1", "value = 2", "rejected: ", "Check"),
        ("A5 5A", "A5 5B", "is a frame of unit. ", "the speed of the line and [frame] sync"),
    ],
)
def test_frames_that_all_fail_are_an_error_that_names_the_check(tmp_path, right, wrong, why, advice):
    """The bytes are kept, for a format that is right."""
    done = record(tmp_path, FORMAT.replace(right, wrong), frames(), "--json")
    message = done.stderr.splitlines()[-1]
    assert message.startswith(f"plumbob record: none of {16 * COUNT} bytes is a frame of unit")
    assert (why in message, advice in message) == (True, True), message
    assert (done.returncode, json.loads(done.stdout)["bytes"]["received"]) == (1, 16 * COUNT)
    assert verify(tmp_path / "a.mcap").whole


def test_a_line_on_which_nothing_comes_is_an_error_too(tmp_path):
    done = record(tmp_path, FORMAT, b"", "--json")
    assert (done.returncode, json.loads(done.stdout)["samples"]) == (1, 0)
    assert "no byte has arrived: is the device on" in done.stderr


def test_bytes_that_no_field_takes_are_told(tmp_path):
    done = record(tmp_path, FORMAT, frames())
    assert done.returncode == 0, done.stderr
    assert "no field of message unit uses its bytes 3, 10 to 13 of 16; they are ignored" in done.stderr
    (tmp_path / "b.bin").write_bytes(frames())
    assert "bytes 3, 10 to 13 of 16" in call("decode", "b.bin", "--format", "unit.toml", cwd=tmp_path).stderr
    form = find_format("buoy")
    assert unassigned(form, form.message()) == []
