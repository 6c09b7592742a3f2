"""The view in a terminal: what stands where, in two sizes and two languages, on a real pseudo-terminal, and keys."""

import functools
import os
import re
import select
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import plumbob
from plumbob.core.errors import ParameterError
from plumbob.live.runner import run_stream
from plumbob.live.stream import Stream
from plumbob.live.transports.transport import Stop
from plumbob.reporting.content import chinese_labels
from plumbob.rotations import Frame, quat_from_euler_zyx
from plumbob.rotations.frames import heading_of
from plumbob.viewer.feed import Feed
from plumbob.viewer.messages import Batch
from plumbob.viewer.playback import Player, load
from plumbob.viewer.terminal import Terminal, keys_at_once, tape
from tests.helpers import Clock, live_samples
from tests.helpers.commandline import PLUMBOB, refused
from tests.helpers.outlets import Kept

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
MEKF = live_samples.SESSION.partition("[estimate]")[0] + '[estimate]\nfilter = "mekf"\n'
PATIENCE = 90.0


@functools.cache
def run(also, truth):
    """A stream that has run, and what a feed gave of it."""
    stream, outlet = Stream(live_samples.session(MEKF), covariance=True), Kept()
    feed = Feed(stream, outlet, also=also, truth=live_samples.motion().truth if truth else None)
    run_stream(stream, live_samples.Handed(live_samples.reads(live_samples.stream(10.0))), sinks=[feed],
               each=feed.tick)  # fmt: skip
    assert not feed.failed
    return stream, outlet


def shown(lang="en", also=("mahony",), truth=True, stop=None):
    stream, outlet = run(also, truth)
    terminal = Terminal(stop or Stop(), lang)
    for hello, batch in outlet.batches:
        terminal.hello(hello)
        terminal.batch(batch)
    for event in outlet.events:
        terminal.event(*event)
    return terminal, stream


def text(terminal, width=80, height=24, now_ns=None):
    now_ns = terminal.now.fields["arrived_ns"] if now_ns is None else now_ns
    return [line.plain for line in terminal.lines(width, height, now_ns)]


def test_the_numbers_are_those_of_the_stream_and_what_comes_no_more_is_shown_as_such():
    terminal, stream = shown()
    page = "\n".join(text(terminal))
    yaw, pitch, roll = np.degrees(plumbob.rotations.euler_zyx_from_quat(stream.filter.q_nb))
    for angle in (roll, pitch, yaw):
        assert f"{angle:.2f}" in page
    assert re.search("2000 samples, latency 0 ms, clock clock", page)
    assert "lost 0, gaps 0, junk 0, rejected 0" in page
    assert f"{terminal.now.values['temp']:.2f} °C" in page
    # Grey and stale where nothing comes, waiting before; nothing that a device says steers the terminal.
    terminal, _ = shown()
    later = terminal.now.fields["arrived_ns"] + 5_000_000_000
    lines = terminal.lines(80, 24, later)
    assert "stale" in lines[0].plain
    assert all(any("bright_black" in str(span.style) for span in line.spans) for line in lines if line.plain.strip())
    assert "live" in text(terminal)[0]
    assert Terminal(Stop(), "zh").lines(80, 24, 0)[0].plain == chinese_labels()["terminal.waiting"]
    terminal.event(1.0, "mark", "\x1b[2J\x07 evil")
    assert not any("\x1b" in line or "\x07" in line for line in text(terminal))
    hello = terminal.now.hello
    terminal.hello(replace(hello, columns=[column for column in hello.columns if column.key != "temp"]))
    assert len(terminal.now.values) == len(hello.columns) - 1  # values are gone with their column
    terminal.batch(Batch({"t": np.zeros(0)}, terminal.now.fields))
    assert "°C" not in "\n".join(text(terminal))


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_it_fits_the_screen(lang):
    from rich.cells import cell_len

    terminal, _ = shown(lang)
    for k in range(30):
        terminal.event(1.0 * k, "mark", "x" * 300)
    for width, height in ((80, 24), (60, 24), (60, 16), (120, 40)):
        lines = terminal.lines(width, height, terminal.now.fields["arrived_ns"])
        assert len(lines) == height
        assert max(cell_len(line.plain) for line in lines) <= width
        if height >= 24:  # the error is the last of a row, and has its digits also where the screen is narrow
            row = next(line.plain for line in lines if line.plain.startswith("mekf"))
            assert re.search(r"\d\.\d\d\s*$", row)


def keys(terminal, monkeypatch, pressed):
    reading, writing = os.pipe()
    try:
        os.write(writing, pressed.encode())
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(fileno=lambda: reading, isatty=lambda: True))
        return [one.command for one in terminal.take_commands()]
    finally:
        os.close(reading)
        os.close(writing)


def test_keys_ask_for_what_they_say(monkeypatch):
    terminal, _ = shown(stop=(stop := Stop()))
    assert [(one.verb, one.text) for one in keys(terminal, monkeypatch, "rm?m")] == [
        ("record", ""), ("mark", "mark 1"), ("mark", "mark 2"),
    ]  # fmt: skip
    terminal.now.fields = {**terminal.now.fields, "recording": {"path": "a.mcap", "rows": 2, "acknowledged": 1,
                                                                "dropped": 0, "since": 0.0}}  # fmt: skip
    assert "● a.mcap: 1/2 rows" in "\n".join(text(terminal))
    assert [one.verb for one in keys(terminal, monkeypatch, "r ")] == ["stop"]
    assert not stop.is_set()
    keys(terminal, monkeypatch, "q")
    assert stop.is_set()


def test_a_tare_lets_angles_count_from_now_and_what_is_not_a_terminal_is_refused(monkeypatch):
    assert re.search("standard output is not one.*plumbob record", refused("view", "--terminal", "--emulate", "buoy"))
    with keys_at_once(), pytest.raises(ParameterError, match="fills a terminal"):
        plumbob.view(emulate="buoy", terminal=True)
    terminal, _ = shown(truth=False, also=())
    keys(terminal, monkeypatch, "t")
    row = next(line for line in text(terminal) if line.startswith("mekf"))
    assert re.findall(r"-?\d+\.\d\d(?= ±)", row) == ["0.00", "0.00", "0.00"]
    assert "tared" in text(terminal)[0]
    keys(terminal, monkeypatch, "t")
    assert "tared" not in text(terminal)[0]


@pytest.mark.parametrize(("yaw", "frame", "heading"), [
    (10.0, Frame.NED, 10.0), (-10.0, Frame.NED, 350.0),  # clockwise from North
    (90.0, Frame.ENU, 0.0), (0.0, Frame.ENU, 90.0),  # counted from East, the other way round
    (90.0, Frame.NWU, 270.0),
])  # fmt: skip
def test_headings_count_clockwise_from_north(yaw, frame, heading):
    found = np.degrees(heading_of(quat_from_euler_zyx(np.radians([yaw, 0.0, 0.0])), frame))
    assert (found - heading + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("heading", [0.0, 7.3, 90.0, 179.9, 180.0, 271.0, 359.99])
@pytest.mark.parametrize("width", [59, 80, 120])
def test_the_tape_has_the_heading_in_its_middle(heading, width):
    line = tape(heading, width)
    assert len(line) == width
    for found in re.finditer(r"N|E|S|W|\d{3}", line):
        named = {"N": 0.0, "E": 90.0, "S": 180.0, "W": 270.0}
        told = named.get(found[0], float(found[0]) if found[0].isdigit() else 0.0)
        at = found.start() + len(found[0]) // 2
        away = (told - heading + 180.0) % 360.0 - 180.0
        assert min(abs(at - width // 2 - 0.2 * (away + turn)) for turn in (-360.0, 0.0, 360.0)) <= 1.0


class Screen:
    """Program on a pseudo-terminal of some size, and what it shows."""

    def __init__(self, words, cwd):
        import fcntl
        import pty
        import struct
        import termios

        import pyte

        self.screen = pyte.Screen(80, 24)
        self._stream, self.tail = pyte.ByteStream(self.screen), b""
        self.pid, self._fd = pty.fork()
        if self.pid == 0:
            os.chdir(cwd)
            unset = ("COLUMNS", "LINES")  # which go before the size of the terminal, and which readline sets
            known = {name: value for name, value in os.environ.items() if name not in unset}
            os.execve(words[0], words, {**known, "TERM": "xterm-256color"})
        fcntl.ioctl(self._fd, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))

    def until(self, pattern):
        end = time.monotonic() + PATIENCE
        while not re.search(pattern, "\n".join(self.screen.display)):
            assert time.monotonic() < end, (pattern, self.screen.display)
            self._read(0.1)

    def press(self, key):
        os.write(self._fd, key.encode())

    def end(self):
        """Exit code, once it has ended."""
        end = time.monotonic() + PATIENCE
        while self._read(0.1):
            assert time.monotonic() < end
        os.close(self._fd)
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    def _read(self, timeout):
        if select.select([self._fd], [], [], timeout)[0]:
            try:
                data = os.read(self._fd, 65536)
            except OSError:
                return False
            self.tail = (self.tail + data)[-4000:]
            self._stream.feed(data)
            return bool(data)
        return True


def test_a_rig_fills_a_terminal_is_recorded_by_a_key_and_ends_by_another(tmp_path):
    screen = Screen([*PLUMBOB, "view", "--terminal", "--emulate", "buoy"], tmp_path)
    screen.until(r"mekf .*±")
    screen.until(r"recording: nothing")
    screen.press("r")
    screen.until(r"● buoy-.*\.mcap: [1-9]")
    screen.press("m")
    screen.until(r"mark: mark 1")
    assert all(len(line) <= 80 for line in screen.screen.display)
    assert screen.screen.display[-1].startswith(" q quit")
    screen.press("r")
    screen.until("recording: nothing")
    screen.press("q")
    assert screen.end() == 0
    (path,) = tmp_path.glob("buoy-*.mcap")
    assert plumbob.verify(path).whole
    assert b"recorded     " in screen.tail  # the report stands on the screen that was there before


def test_a_recording_is_paused_by_the_space_bar(tmp_path, monkeypatch):
    live_samples.record(tmp_path / "a.mcap", live_samples.reads(live_samples.stream(10.0)))
    terminal = Terminal(Stop(), "zh")
    player = Player(load(tmp_path / "a.mcap"), terminal, clock=(clock := Clock()))
    for pressed, verb, label in ((" ", "pause", "暂停"), (" ", "play", "播放")):
        player.tick()
        assert [command.verb for command in keys(terminal, monkeypatch, pressed)] == [verb]
        getattr(player, verb)()
        clock.on(0.3)
        player.tick()
        assert label in text(terminal, 60, now_ns=0)[0]
