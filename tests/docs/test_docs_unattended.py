"""The recorder that nobody attends: the unit of systemd on its page is one, and its words record, twice."""

import configparser
import os
import re
import shlex
import threading
import time
import tty
from pathlib import Path

import pytest

from plumbob.files.mcap import verify
from plumbob.live.recorded import read_recorded
from tests.helpers.commandline import call

PAGE = (Path(__file__).parents[2] / "docs" / "sessions.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def unit():
    found = configparser.ConfigParser(interpolation=None)
    found.optionxform = str  # keys of systemd tell capitals
    found.read_string(re.search(r"^```ini\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)[1])
    return found


@pytest.fixture
def port(tmp_path):
    """A line on which the buoy sends at ten times its speed, for as long as the test runs."""
    call("emulate", "buoy", "--seed", "1", "--duration", "60s", "--write", "b.bin", cwd=tmp_path)
    data, ended = (tmp_path / "b.bin").read_bytes(), threading.Event()
    master, slave = os.openpty()
    tty.setraw(slave)

    def send():
        for at in range(0, len(data), 310):
            if ended.wait(0.01):
                return
            os.write(master, data[at : at + 310])

    thread = threading.Thread(target=send)
    thread.start()
    yield os.ttyname(slave)
    ended.set()
    thread.join()
    os.close(master)
    os.close(slave)


def test_the_unit_starts_again_for_ever(unit):
    service = unit["Service"]
    assert (service["Restart"], unit["Unit"]["StartLimitIntervalSec"]) == ("always", "0")
    assert float(service["RestartSec"]) > 0
    assert float(service["TimeoutStopSec"]) > 10  # s that the recorder waits for a disk at its end
    assert service["WorkingDirectory"].startswith("/")
    assert unit["Install"]["WantedBy"] == "multi-user.target"


def test_its_words_record_and_go_on_after_a_restart(unit, port, tmp_path):
    words = shlex.split(unit["Service"]["ExecStart"])
    assert Path(words[0]).is_absolute()
    session = re.search(r"^```toml\n# buoy.toml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)[1]
    assert words[1:] == ["record", "buoy.toml"]
    (tmp_path / "buoy.toml").write_text(re.sub(r'^port = ".*"', f'port = "{port}"', session, flags=re.MULTILINE))
    for name in ("buoy.mcap", "buoy.0002.mcap"):
        done = call(*words[1:], "--duration", "0.4s", cwd=tmp_path)
        assert (done.returncode, f"recorded     {name}" in done.stdout) == (0, True), done.stderr
        time.sleep(0.1)
    assert verify(tmp_path / "buoy.mcap").whole
    recording = read_recorded(tmp_path / "buoy.mcap")
    assert "recorded in 2 sessions; the recorder was off between them" in map(str, recording.notes)
