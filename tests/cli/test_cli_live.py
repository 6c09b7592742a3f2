"""record, replay, verify and convert from the command line: on emulated rigs and devices, and without a sample."""

import json
import os
import shutil
import signal
import socket
import struct
import subprocess
import threading
from importlib import resources

import numpy as np
import pytest

from plumbob import files
from plumbob.core.signals import stopped_by_signals
from plumbob.files.mcap import Recorder, open_log, verify
from plumbob.live.transports.transport import Stop
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format, parse_format
from plumbob.protocols.overlap import unassigned
from tests.helpers import beside, until
from tests.helpers.commandline import PLUMBOB, answer, call, emulated, typed
from tests.helpers.iio_tree import GYRO, Tree

TIMEOUT = 120
SESSION = beside(__file__, "live_session.toml")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A recording of 20 s of sea in one second, made as a user makes one."""
    folder = tmp_path_factory.mktemp("live")
    with emulated(folder, "--speed 20 --duration 20s --truth truth.parquet") as link:
        device = json.loads((folder / "truth.card.json").read_text())["device"]
        (folder / "s.toml").write_text(SESSION.replace("LINK", str(link)).replace("DEVICE", device))
        told = typed("record s.toml --out a.mcap --duration 4s --json", cwd=folder)
    return folder, json.loads(told.stdout), told.stderr


def test_a_live_line_loses_nothing_and_replays_to_the_bit_but_with_another_filter(recorded):
    folder, told, notes = recorded
    assert told["samples"] == 2000
    assert told["time"]["lost"] == told["bytes"]["junk"] == 0
    assert told["recording"]["acknowledged"] == told["recording"]["rows"]
    assert "lost" in notes  # the rig went away at its end
    check = answer("replay a.mcap --check", cwd=folder)["check"]
    assert check == {"compared": 2000, "different": 0, "only_live": 0, "only_replayed": 0, "equal": True}
    check = answer("replay a.mcap --filter mahony --params kp=0.6 --check", cwd=folder, code=3)["check"]
    assert (check["compared"], check["equal"]) == (2000, False)
    typed("convert a.mcap a.parquet --what samples", cwd=folder)
    read, truth = files.read(folder / "a.parquet").imu, files.read(folder / "truth.parquet").imu
    np.testing.assert_allclose(read.gyr, truth.gyr, rtol=0, atol=1e-9)  # the rig's counts are the simulator's steps
    np.testing.assert_allclose(read.t, truth.t, rtol=0, atol=1e-6)


@pytest.mark.usefixtures("hang_up_ends")
def test_interrupted_recordings_end_whole(tmp_path):
    with emulated(tmp_path, "") as link:
        for how in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            words = ["record", "--port", str(link), "--format", "buoy", "--out", f"{how}.mcap"]
            with subprocess.Popen([*PLUMBOB, *words], cwd=tmp_path, stdout=subprocess.PIPE, text=True) as child:
                try:
                    until(
                        lambda file=tmp_path / f"{how}.mcap": file.exists() and file.stat().st_size > 2000, "no bytes"
                    )
                    child.send_signal(how)
                    out, _ = child.communicate(timeout=TIMEOUT)
                finally:
                    child.kill()
            assert (child.returncode, "NONE: these sensor values are uncalibrated" in out) == (0, True)
            assert answer(f"verify {how}.mcap", cwd=tmp_path)["whole"]


def test_a_recording_outlives_those_who_read_its_notes(tmp_path):
    """As when a pager or a remote shell is gone: the note cannot be written, the recording goes on."""
    with emulated(tmp_path, "") as link:
        words = ["record", "--port", str(link), "--format", "buoy", "--out", "a.mcap", "--duration", "2s"]
        read, write = os.pipe()
        os.close(read)
        done = subprocess.run([*PLUMBOB, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=write, text=True,
                              check=False, timeout=TIMEOUT, env={**os.environ, "PYTHONUNBUFFERED": ""})  # fmt: skip
        os.close(write)
    assert done.returncode == 0
    assert "samples" in done.stdout
    log = open_log(tmp_path / "a.mcap")
    assert sum(row.topic == "raw" for row in log) > 20  # of some 280, one each 7 ms: it ended at its first note before
    assert log.clean


def test_a_line_of_another_format_is_noticed_and_no_folder_of_its_maker_is_named(tmp_path):
    with emulated(tmp_path, "--speed 20") as link:
        done = typed(f"record --port {link} --format trackball --duration 1s", cwd=tmp_path, code=1)
    assert ": is it the right format, and baud?" in done.stderr
    # nothing is known of a clock that was never read
    assert ("recorded     NOTHING" in done.stdout, "ppm" in done.stdout) == (True, False)
    (tmp_path / "b.toml").write_text((resources.files("plumbob.protocols") / "rigs" / "buoy.toml").read_text())
    typed("emulate buoy --duration 2s --write b.bin", cwd=tmp_path)
    typed("record --from b.bin --format b.toml --out b.mcap", cwd=tmp_path)
    assert str(tmp_path) not in str(dict(open_log(tmp_path / "b.mcap").metadata))


def test_a_recording_that_lacks_rows_exits_3(tmp_path):
    with emulated(tmp_path, "") as link:
        (tmp_path / "s.toml").write_text(f"""
kind = "plumbob session"
version = 1
source = {{ kind = "serial", port = "{link}", baud = 115200 }}
format = {{ name = "buoy" }}
record = {{ path = "a.mcap", reserve = 1_000_000_000_000_000_000 }}
""")
        report = answer("record s.toml --duration 1s", cwd=tmp_path, code=3)["recording"]
    assert report["acknowledged"] == 0 < report["rows"]


@pytest.mark.usefixtures("hang_up_ends")
def test_a_lost_terminal_says_stop_unless_it_is_to_be_survived():
    stop = Stop()
    with stopped_by_signals(stop):
        signal.raise_signal(signal.SIGHUP)
        assert stop.is_set()
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    stop = Stop()
    with stopped_by_signals(stop):
        signal.raise_signal(signal.SIGHUP)
        assert not stop.is_set()
    signal.signal(signal.SIGHUP, before)


@pytest.fixture
def folder(tmp_path):
    """Gyroscope of three axes, and time; its pipe holds 200 scans."""
    tree = Tree(tmp_path)
    kinds = {f"anglvel_{axis}": "le:s16/16>>0" for axis in "xyz"} | {"timestamp": "le:s64/64>>0"}
    tree.add_buffered("bench-gyro", kinds, {"in_anglvel_scale": repr(GYRO)})
    (tmp_path / "s.toml").write_text(tree.session(device="bench-gyro"))
    end = tree.hold()
    os.write(end, b"".join(struct.pack("<3h2xq", i, -i, 7, 10**10 + 10_000_000 * i) for i in range(200)))
    yield tmp_path
    os.close(end)


def test_record_then_convert_without_the_device(folder):
    report = answer("record s.toml --out a.mcap --duration 1s", cwd=folder)
    assert (report["samples"], report["format"], report["bytes"]["junk"]) == (200, "bench-gyro", 0)
    assert report["time"]["mode"] == "kernel"
    shutil.rmtree(folder / "sys")
    typed("convert a.mcap a.csv --what samples", cwd=folder)
    last = (folder / "a.csv").read_text().splitlines()[-1].split(",")
    assert [float(cell) for cell in last[1:4]] == pytest.approx([199 * GYRO, -199 * GYRO, 7 * GYRO], rel=1e-12)
    report = answer("replay a.mcap", cwd=folder)
    assert (report["samples"], report["time"]["mode"], report["duration_s"]) == (200, "kernel", pytest.approx(1.99))


@pytest.fixture
def whole(tmp_path):
    path = tmp_path / "a.mcap"
    r = Recorder(path, epoch_offset_ns=0, reserve=0)
    number = r.channel("raw/imu", "application/octet-stream")
    with r:
        for i in range(50):
            r.write(number, i * 10_000_000, bytes([i]) * 20)
    return path


def damaged(whole):
    """One byte in the second chunk is wrong: ten rows are gone."""
    raw = bytearray(whole.read_bytes())
    second = raw.index(b"zstd", raw.index(b"zstd") + 4)
    raw[second + 30] ^= 1
    return bytes(raw)


def unfinished(whole):
    """As a crash leaves it: whole chunks and no end."""
    raw = whole.read_bytes()
    return raw[: raw.index(b"\x07\x00\x00\x00plumbob", 200) - 9]


def repaired(name, out, code, cwd):
    """Bytes of a repaired file, which is whole, and repairs to itself."""
    typed(f"verify {name} --repair {out}", cwd=cwd, code=code)
    assert answer(f"verify {out}", cwd=cwd)["whole"]
    typed(f"verify {out} --repair again.mcap --force", cwd=cwd)
    assert (cwd / "again.mcap").read_bytes() == (cwd / out).read_bytes()
    return (cwd / out).read_bytes()


def test_whole_and_unfinished(whole, tmp_path):
    done = typed("verify a.mcap", cwd=tmp_path)
    assert (done.stderr, done.stdout.splitlines()[0]) == ("", "a.mcap: 50 rows in 0.490 s")
    assert repaired("a.mcap", "b.mcap", 0, tmp_path) == whole.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(unfinished(whole))
    done = typed("verify cut.mcap", cwd=tmp_path, code=3)
    assert "no row that had been written is missing" in done.stdout
    repaired("cut.mcap", "c.mcap", 0, tmp_path)


def test_damaged(whole, tmp_path):
    (tmp_path / "bad.mcap").write_bytes(damaged(whole))
    found = answer("verify bad.mcap", cwd=tmp_path, code=3)
    assert [found[key] for key in ("whole", "clean", "lost", "rows")] == [False, True, {"raw/imu": 10}, {"raw/imu": 40}]
    assert found["damage"][0]["lost"] == {"raw/imu": 10}
    assert "lost         raw/imu: 10 rows missing" in typed("verify bad.mcap", cwd=tmp_path, code=3).stdout
    repaired("bad.mcap", "b.mcap", 3, tmp_path)
    assert "dropped      raw/imu: 10 rows" in typed("verify b.mcap", cwd=tmp_path).stdout
    found = answer("verify bad.mcap --repair c.mcap", cwd=tmp_path, code=3)
    assert (found["lossy"], found["out"]) == (True, "c.mcap")


def test_an_empty_file_claims_nothing(tmp_path):
    (tmp_path / "a.mcap").touch()
    assert not answer("verify a.mcap", cwd=tmp_path, code=3)["whole"]
    done = typed("verify a.mcap", cwd=tmp_path, code=3)
    assert done.stdout.splitlines()[-1] == "verdict      not complete, and no row is in it"


FORMAT = beside(__file__, "unit.toml")
SILENT_SESSION = """
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
        (folder / "s.toml").write_text(SILENT_SESSION.format(port=server.getsockname()[1]))
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
