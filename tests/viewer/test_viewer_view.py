"""The view as a whole: a server of its own process, whose loss or sloth costs the recorder nothing."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from importlib.util import find_spec

import numpy as np
import pytest

import plumbob
from plumbob.core.errors import LineError, ParameterError
from plumbob.core.resources import WEB
from plumbob.live.runner import run_stream
from plumbob.live.session_toml import capture_session
from plumbob.live.stream import Stream
from plumbob.live.transports.transport import Stop
from plumbob.viewer import child
from plumbob.viewer.child import ServerOutlet, Serving
from plumbob.viewer.commands import ClientCommand
from plumbob.viewer.feed import Feed
from plumbob.viewer.messages import Command
from plumbob.viewer.pipe import LIMIT, PipeMessage, PipeWriter, packed
from plumbob.viewer.switch import Switch
from plumbob.viewer.view import Shows, opened_up, view
from tests.helpers import PATIENCE, Clock, live_samples, until
from tests.helpers.commandline import PLUMBOB
from tests.helpers.outlets import Kept, StandIn, emulated

BUILT = (WEB / "view" / "index.html").is_file()
SERVES = find_spec("plumbob.viewer.serve") is not None
needs_server = pytest.mark.skipif(not (SERVES and BUILT), reason="the page is not built ('make page')")


class Acting:
    """Server whose commands a test gives, in the loop of the stream."""

    def __init__(self, server, commands=()):
        self._server, self._commands, self.answers = server, list(commands), []

    def __getattr__(self, name):
        return getattr(self._server, name)

    def take_commands(self):
        self._server.take_commands()
        found, self._commands = self._commands, []
        return [ClientCommand(None, Command(id=1, **one)) for one in found]

    def answer(self, asked, ok, text):
        self.answers.append((asked.command.verb, ok, text))


def followed(session, outlet, folder, *, during):
    """Run a session into an outlet while `during` goes on beside; what was viewed, and notes."""
    stop, notes, found = Stop(), [], []

    def aside():
        try:
            during()
        finally:
            stop.set()

    def opened():
        threading.Thread(target=aside).start()

    found = Shows(session).run(
        outlet, folder=folder, control=True, duration=None, stop=stop, note=notes.append, echo=notes.append,
        opened=opened,
    )  # fmt: skip
    return found, notes


def of_port(port):
    return capture_session(port=port, format="buoy", frame="NED", filter="mekf")


def test_killing_the_server_touches_neither_the_stream_nor_the_recording(tmp_path):
    log, notes = tmp_path / "log", []
    with emulated("buoy", duration="60s") as port:
        server = ServerOutlet(StandIn(kind="reader", log=str(log)), notes.append)
        server.start()
        outlet = Acting(server, [{"verb": "record", "name": "kept"}])

        def during():
            until(lambda: log.exists() and log.read_text().count("batch") > 20, "no batch came")
            before = log.read_text().count('"hello"')
            os.kill(server.pid, signal.SIGKILL)
            until(lambda: server.starts == 2, "it was not started again")
            until(lambda: log.read_text().count('"hello"') > before, "the new one got no hello")
            batches = log.read_text().count("batch")
            until(lambda: log.read_text().count("batch") > batches, "the new one got no batch")

        try:
            found, _ = followed(of_port(port), outlet, tmp_path, during=during)
        finally:
            server.close()
    assert any("exit code -9" in note and "go on" in note for note in notes)
    (told,) = found.recordings
    assert told["acknowledged"] == told["rows"]
    assert not told["dropped"]
    assert found.ran.stream.time_report().lost == 0
    assert plumbob.verify(told["path"]).whole and plumbob.replay(told["path"], check=True).comparison.equal
    assert found.ran.samples >= 50


def test_a_server_that_never_reads_costs_its_own_batches_alone(tmp_path):
    server = ServerOutlet(StandIn(kind="deaf"), lambda line: None)
    server.start()
    outlet, clock = Acting(server), Clock()
    stream = Stream(live_samples.session(live_samples.SESSION), covariance=True)
    switch, feed = Switch(stream, tmp_path), Feed(stream, outlet, clock=clock)
    switch.record("all")

    def each():
        outlet.take_commands()
        clock.on(1.0)  # something is due each time, far more often than it would
        feed.tick()

    try:
        source = live_samples.Handed(live_samples.reads(live_samples.stream(25.0)))
        run_stream(stream, source, sinks=[feed], recording=switch, each=each)
        skipped = server.skipped
    finally:
        server.close()
    assert skipped > 0
    (told,) = switch.recordings
    assert told["acknowledged"] == told["rows"]
    assert plumbob.verify(told["path"]).whole
    assert not feed.failed


def test_what_waits_for_a_reader_is_bounded():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        writer, message = PipeWriter(ours), PipeMessage("batch", {}, {"values": np.zeros((100, 20))})
        while not writer.skipped:
            writer.write(message)
        assert LIMIT < writer.waiting <= LIMIT + len(packed(message))
        writer.write(message, must=True)
        assert (writer.waiting > LIMIT + len(packed(message)), writer.skipped, writer.broken) == (True, 1, False)


class Saying(StandIn):
    """A server that writes something into its pipe or says why it cannot, and ends."""

    def words(self, number, port):
        if self.kind == "refuses":
            return [sys.executable, "-c", "import sys; sys.exit('plumbob: the port is taken.')"]
        ready = packed(PipeMessage("ready", {"port": 1}))
        return [sys.executable, "-c", f"import os; os.write({number}, {ready!r})"]


def test_a_server_that_does_not_start_is_an_error_with_its_words_and_one_that_ends_left_alone_in_the_end(monkeypatch):
    with pytest.raises(LineError, match="the port is taken"):
        ServerOutlet(Saying(kind="refuses"), print).start()
    monkeypatch.setattr(child, "STARTS", 1)
    notes = []
    server = ServerOutlet(Saying(), notes.append)
    server.start()
    until(lambda: server.take_commands() is not None and any("left alone" in n for n in notes), "it never gave up")
    assert server.starts == 2
    server.close()


def test_the_token_is_on_no_command_line_and_long_enough():
    server = ServerOutlet(Serving(), lambda line: None)
    token = server.url.partition("token=")[2]
    assert len(token) >= 43  # 32 bytes, 6 bits to a letter: 256 bits
    assert token not in " ".join(Serving(control=True, allow_origin=("http://a",)).words(3, 8770))
    assert server.url.startswith("http://127.0.0.1:8770/?token=")
    server.close()
    other = ServerOutlet(Serving(host="::1"), print)
    assert other.url.startswith("http://[::1]:8770/")
    other.close()
    origins = ["https://app.foxglove.dev", "http://[::1]:8080"]  # as a browser sends them
    assert json.loads(Serving(allow_origin=origins).words(3, 0)[-1])["allow_origin"] == origins


SHOWN = {"emulate": None, "chain": None, "also": (), "note": print, "line": {}}
OPENED = [
    ("a.mcap", {"line": {"port": "/dev/ttyUSB0"}}, "port belongs to a line"),
    ("s.toml", {"line": {"causal": True}}, "--causal is for a recording"),
    ("/dev/ttyUSB0", {"line": {"port": "/dev/ttyUSB1", "format": "buoy"}}, "both name the line"),
    ("/dev/ttyUSB0", {}, "does not exist"),
    (None, {}, "give either a session file"),
    (None, {"emulate": "nothing"}, "there is no rig"),
]
SERVED = [
    ({"port": 99999}, "http_port must be 0 to 65535"), ({"port": -1}, "http_port must be 0 to 65535"),
    ({"port": "8770"}, "http_port must be an int"), ({"clients": 1.5}, "clients must be an int"),
    ({"clients": 0}, "1 or more"), ({"allow_origin": ["app.foxglove.dev"]}, "an origin must be like https"),
    ({"allow_origin": ["https://app.foxglove.dev/"]}, "an origin must be like https"),
]  # fmt: skip
MADE = [
    (view, {"emulate": "buoy", "duration": "-2s"}, "duration must be above 0, but it is -2s"),
    (plumbob.record, {"port": "/dev/null", "format": "buoy", "duration": 0}, "duration must be above 0, but it is 0"),
    (view, {"what": __file__, "format": "buoy"}, r"nor a port, but a file.*record --from"),
]


@needs_server
@pytest.mark.parametrize(("call", "how", "says"), [
    *((opened_up, {"what": what, **SHOWN, **more}, says) for what, more, says in OPENED),
    *((Serving, how, says) for how, says in SERVED),
    *MADE,
])  # fmt: skip
def test_what_does_not_go_together_or_cannot_be_served_is_refused(tmp_path, monkeypatch, call, how, says):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ParameterError, match=says), call(**how):
        pass
    assert not any(tmp_path.iterdir())


def test_a_session_file_is_shown_and_its_own_recording_made(tmp_path):
    with emulated("buoy", duration="60s") as port:
        (tmp_path / "s.toml").write_text(f"""
kind = "plumbob session"
version = 1
source = {{ kind = "serial", port = "{port}", baud = 115200 }}
format = {{ name = "buoy" }}
imu = {{ frame = "NED" }}
estimate = {{ filter = "mekf" }}
record = {{ path = "{tmp_path}/own.mcap" }}
""")
        outlet = Kept()
        with opened_up(tmp_path / "s.toml", **SHOWN | {"also": ["mahony"]}) as shows:
            stop, notes = Stop(), []
            threading.Thread(target=lambda: (until(lambda: len(outlet.batches) > 60, "no batches"), stop.set())).start()
            found = shows.run(outlet, folder=tmp_path, control=False, duration=PATIENCE, stop=stop, note=notes.append,
                              echo=notes.append, opened=lambda: None)  # fmt: skip
    assert plumbob.replay(tmp_path / "own.mcap", check=True).comparison.equal
    assert found.recordings[0]["path"] == str(tmp_path / "own.mcap")
    assert outlet.batches[30][1].fields["recording"]["path"] == str(tmp_path / "own.mcap")
    assert (outlet.fields["link"]["rate"], outlet.fields["link"]["lost"]) == (pytest.approx(100.0, rel=0.2), 0)
    assert not outlet.hellos[-1].control
    assert outlet.hellos[-1].started_utc == pytest.approx(time.time(), abs=60.0)


def test_an_emulated_rig_is_shown_with_its_truth_and_the_server_gets_its_card_which_is_not_on_the_page(tmp_path):
    outlet, log = Kept(), tmp_path / "log"
    with opened_up(None, **SHOWN | {"emulate": "buoy"}) as shows:
        path, stop = shows.card_in(tmp_path), Stop()
        threading.Thread(target=lambda: (until(lambda: len(outlet.batches) > 50, "no batches"), stop.set())).start()
        shows.run(outlet, folder=tmp_path, control=False, duration=PATIENCE, stop=stop, note=print,
                  echo=lambda line: None, opened=lambda: None)  # fmt: skip
    assert [one.name for one in outlet.hellos[-1].estimators] == ["mekf", "reference"]
    assert outlet.hellos[-1].calibration != "uncalibrated"
    # the truth is on the stream's time line: the estimate of a calibrated unit is near it
    assert outlet.fields["attitudes"]["mekf"]["error"] < 15.0
    assert plumbob.CalibrationCard.load(path).device == "mpu6000+hmc5983 #0"
    server = ServerOutlet(StandIn(kind="reader", log=str(log)), print)
    server.card = path
    server.start()
    server.hello(outlet.hellos[0])
    server.close()
    assert json.loads(log.read_text().splitlines()[0]) == ["hello", {}, str(path)]


def recorded(url):
    """What the view says of the recording that is made."""
    address, _, token = url.partition("?token=")
    request = urllib.request.Request(f"{address}api/state", headers={"Authorization": f"Bearer {token}"})
    with urllib.request.urlopen(request, timeout=10) as answer:
        return json.load(answer)["recording"]


@needs_server
def test_the_verb_takes_commands_over_http_and_a_signal_ends_it_in_time_and_the_recording_whole(tmp_path):
    with emulated("buoy", duration="60s") as port:
        words = ["view", port, "--format", "buoy", "--frame", "NED", "--filter", "mekf", "--http-port", "0",
                 "--control", "--no-open", "--json"]  # fmt: skip
        with subprocess.Popen([*PLUMBOB, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              text=True) as process:  # fmt: skip
            url = next(line.strip() for line in process.stderr if line.startswith("http"))
            drained = threading.Thread(target=process.stderr.read)
            drained.start()
            path = plumbob.control(url, "record", "signal")
            plumbob.control(url, "mark", "now")
            for command in (("record",), ("seek", 3.0)):
                with pytest.raises(ParameterError, match="the view refused"):
                    plumbob.control(url, *command)
            with pytest.raises(LineError, match="does not accept the token"):
                plumbob.control(url[:-1] + ("a" if url[-1] != "a" else "b"), "stop")
            until(lambda: (recorded(url) or {}).get("rows", 0) > 0, "no row was recorded")
            began = time.monotonic()
            process.send_signal(signal.SIGTERM)
            told = json.loads(process.stdout.read())
            assert process.wait(10) == 0
            assert time.monotonic() - began < 2.0 + 1.0  # 1 s for a host that is busy
            drained.join(10)
    assert told["recordings"][0]["path"] == path and plumbob.verify(tmp_path / path).whole
