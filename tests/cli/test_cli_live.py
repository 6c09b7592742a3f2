"""record, replay, verify and convert from the command line, on an emulated rig behind a real pseudo-terminal."""

import json
import os
import signal
import subprocess
from importlib import resources

import numpy as np
import pytest

from plumbob import files
from plumbob.core.signals import stopped_by_signals
from plumbob.files.mcap import open_log
from plumbob.live.transports.transport import Stop
from tests.helpers import beside, until
from tests.helpers.commandline import PLUMBOB, answer, emulated, typed

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


def test_signals_say_stop_and_are_given_back():
    before = signal.getsignal(signal.SIGTERM)
    stop = Stop()
    with stopped_by_signals(stop):
        assert not stop.is_set()
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)  # the second of two in a hurry, too
        assert stop.is_set()
    assert signal.getsignal(signal.SIGTERM) is before


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
