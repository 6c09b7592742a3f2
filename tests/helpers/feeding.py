"""A stand-in for the process that reads a line: it feeds the server over a socketpair with numbers that are known."""

import json
import os
import re
import secrets
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from websockets.sync.client import connect

from plumbob.rotations import euler_zyx_from_quat, quat_from_rotvec, quat_multiply
from plumbob.viewer.child import Serving
from plumbob.viewer.pipe import MessageUnpacker, PipeMessage, PipeWriter

TURN = 0.7  # rad/s, about an axis that is none of the body's
AXIS = np.array([0.36, 0.48, 0.8])
G = 9.80665
SENSORS = ("gyr", "acc", "mag")
CHARTS = {"gyr": ("rate", "°/s"), "acc": ("force", "m/s²"), "mag": ("field", "µT")}
DEG = 180.0 / np.pi


def column(key: str, chart: str, unit: str) -> dict[str, Any]:
    source, _, label = key.rpartition(".")
    return {"key": key, "chart": chart, "label": label, "unit": unit, "digits": 3, "source": source or key}


COLUMNS = [
    *(column(f"mekf.{name}", "attitude", "°") for name in ("roll", "pitch", "yaw")),
    *(column(f"{name}.{axis}", *CHARTS[name]) for name in SENSORS for axis in "xyz"),
    column("temp", "temperature", "°C"),
]


def hello(**changed: Any) -> dict[str, Any]:
    """What `messages.Hello` needs of the feed."""
    return {
        "type": "hello", "session": "bench", "device": "B-7", "format": "made-up", "calibration": "uncalibrated",
        "noise": "typical", "live": True, "frame": "ENU", "north": "free", "axes": "FLU", "rate": 100.0,
        "columns": COLUMNS, "raw": [], "filters": ["mahony", "vqf"],
        "estimators": [{"name": "mekf", "title": "MEKF", "primary": True, "claims": True}],
        "skeleton": None, "guides": ["mag", "accel", "gyro"], "regions": [], "regions_names": [], "control": False,
        "recording": True, "duration": None, "started_utc": 1.7e9, "gravity": G, "version": "0", "protocol": 1,
    } | changed  # fmt: skip


class Body:
    """A body that turns at a constant rate, and what its sensors say; row k is of time k / rate."""

    def __init__(self, rate: float = 100.0) -> None:
        self.rate = rate

    def attitude(self, k: np.ndarray) -> np.ndarray:
        start = quat_from_rotvec(np.array([0.2, -0.3, 0.5]))
        return quat_multiply(start, quat_from_rotvec(np.multiply.outer(TURN * k / self.rate, AXIS)))

    def rows(self, first: int, count: int) -> dict[str, np.ndarray]:
        """Arrays of a batch: rows of `COLUMNS`, and what the sensors said."""
        k = np.arange(first, first + count, dtype=np.float64)
        angles = DEG * euler_zyx_from_quat(self.attitude(k))[:, ::-1]
        sensed = self.sensed(k)
        values = np.column_stack((angles, DEG * sensed[:, :3], sensed[:, 3:]))
        return {"t": k / self.rate, "flags": np.zeros(count, dtype=np.uint32), "values": values, "sensed": sensed}

    def sensed(self, k: np.ndarray) -> np.ndarray:
        # A sine of its own in each column: every number tells which one it is, and that it is not another.
        phase = np.multiply.outer(k, 0.01 + 0.003 * np.arange(9))
        mean = np.concatenate((TURN * AXIS, (0.0, 0.0, G), (20.0, 5.0, -40.0)))
        return np.column_stack((mean + np.sin(phase), 25.0 + 1e-4 * k))

    def fields(self, last: int) -> dict[str, Any]:
        return {
            "attitudes": {"mekf": {"q_nb": self.attitude(np.array([float(last)]))[0].tolist(), "sd": [0.1, 0.1, 1.0]}},
            "gravity_b": [0.0, 0.0, G], "field_b": [20.0, 5.0, -40.0], "raw": [], "points": None, "recording": None,
            "text": None, "playback": None, "arrived_ns": time.monotonic_ns(),
            "link": {"rate": self.rate, "samples": last + 1, "lost": 0, "gaps": 0, "junk": 0, "rejected": 0,
                     "unusable": 0, "drift_ppm": None, "clock": "rate", "skipped": 0},
        }  # fmt: skip

    def batch(self, first: int, count: int, **fields: Any) -> PipeMessage:
        arrays = self.rows(first, count)
        return PipeMessage("batch", self.fields(first + count - 1) | fields, arrays)


class Feed:
    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self.writer = PipeWriter(end)
        self._unpacker = MessageUnpacker()
        self.got: list[PipeMessage] = []
        self._lock = threading.Lock()

    def say(self, kind: str, content: dict[str, Any] | None = None, **arrays: np.ndarray) -> None:
        self.write(PipeMessage(kind, content or {}, arrays))

    def write(self, message: PipeMessage) -> None:
        """Write a message, and wait until the pipe has taken it."""
        deadline = time.monotonic() + 20.0
        with self._lock:
            self.writer.write(message, must=True)
            while self.writer.waiting and not self.writer.broken and time.monotonic() < deadline:
                time.sleep(0.001)
                self.writer.flush()

    def hang_up(self) -> None:
        """Close the pipe without a word."""
        self._end.close()

    def wait(self, kind: str, seconds: float = 30.0) -> PipeMessage:
        """Next message of a kind; others before it are dropped."""
        return self.until(lambda message: message.kind == kind, seconds)

    def until(self, fits: Callable[[PipeMessage], bool], seconds: float = 30.0) -> PipeMessage:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            while self.got:
                if fits(message := self.got.pop(0)):
                    return message
            with self._lock:
                self.writer.flush()
            try:
                data = self._end.recv(1 << 16)
            except BlockingIOError:
                time.sleep(0.002)
                continue
            if not data:
                break
            self.got += self._unpacker.feed(data)
        raise AssertionError("the server has not said it")


class Served(NamedTuple):
    """A server that runs, and the feed's end of its pipe."""

    process: subprocess.Popen[bytes]
    feed: Feed
    port: int
    token: str
    folder: Path

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    def socket_url(self, path: str = "/ws", **query: Any) -> str:
        told = "&".join(f"{name}={value}" for name, value in {"token": self.token, **query}.items())
        return f"ws://{self.host}{path}?{told}"

    def play(self, body: Body, first: int, stop: int, *, size: int = 10, wall: float = 0.0) -> None:
        """Feed rows from one to another in batches, so many seconds of the clock apart."""
        for k in range(first, stop, size):
            self.feed.write(body.batch(k, min(size, stop - k)))
            if wall:
                time.sleep(wall)


IMPATIENT = """from plumbob.viewer import guard, serve
guard.ASKING_S = guard.LISTENING_S = serve.PATIENCE = {0}
serve.sys.exit(serve.main())"""


@contextmanager
def serving(*, folder: Path, token: str | None = None, patience: float | None = None, **how: Any) -> Iterator[Served]:
    """Run a server, `how` it serves, as a process of its own, and end it; `patience`: its longest waits, s."""
    token = token or secrets.token_urlsafe(24)
    ours, theirs = socket.socketpair()
    begin = ["-m", "plumbob.viewer.serve"] if patience is None else ["-c", IMPATIENT.format(patience)]
    words = Serving(port=0, folder=folder, **how).words(theirs.fileno(), 0)
    command = [sys.executable, *begin, *words[-2:]]
    with (folder / "server.log").open("wb") as log:
        process = subprocess.Popen(
            command, pass_fds=[theirs.fileno()], env=os.environ | {"PLUMBOB_VIEW_TOKEN": token}, stdout=log, stderr=log
        )
    theirs.close()
    feed = Feed(ours)
    try:
        port = feed.wait("ready").content["port"]
        yield Served(process, feed, port, token, folder)
    finally:
        ours.close()
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    said = (folder / "server.log").read_text()
    assert "Traceback" not in said, said
    assert token not in said


class Tick(NamedTuple):
    """A binary message, taken apart by what its layout says and nothing of the server's."""

    kind: int
    state: dict[str, Any]
    epoch: int
    t: np.ndarray
    flags: np.ndarray
    values: np.ndarray


def parsed(message: bytes) -> Tick:
    kind, size, n, m, epoch, nothing = struct.unpack_from("<6I", message)
    assert size % 8 == 0 and nothing == 0
    assert len(message) == 24 + size + 12 * n + 4 * m * n
    state = json.loads(message[24 : 24 + size]) if size else {}
    at = 24 + size
    t = np.frombuffer(message, "<f8", n, at)
    words = np.frombuffer(message, "<u4", n, at + 8 * n)
    values = np.frombuffer(message, "<f4", n * m, at + 12 * n).reshape(m, n)
    return Tick(kind, state, epoch, t, words, values)


def request(
    served: Served, method: str = "GET", path: str = "/", *, headers: dict[str, str] | None = None, body: bytes = b"",
    token: str | None = "", host: str | None = None,
) -> tuple[int, dict[str, str], bytes]:  # fmt: skip
    """Answer to a request: status, headers, body; with the right token in a header unless another is given."""
    lines = {"Host": host or served.host, "Connection": "close"}
    if token is not None:
        lines["Authorization"] = f"Bearer {token or served.token}"
    if body or method == "POST":
        lines["Content-Length"] = str(len(body))
    head = "".join(f"{name}: {value}\r\n" for name, value in (lines | (headers or {})).items())
    return raw_request(served, f"{method} {path} HTTP/1.1\r\n{head}\r\n".encode() + body)


def raw_request(served: Served, data: bytes) -> tuple[int, dict[str, str], bytes]:
    """Answer to bytes; status 0 where the server closed without one."""
    with socket.create_connection(("127.0.0.1", served.port), timeout=20.0) as line:
        line.sendall(data)
        found = b""
        try:
            while part := line.recv(1 << 16):
                found += part
        except ConnectionResetError:
            pass
    head, _, body = found.partition(b"\r\n\r\n")
    if not head:
        return 0, {}, b""
    first, *rest = head.decode("latin-1").split("\r\n")
    status = int(re.fullmatch(r"HTTP/1\.1 (\d{3}) .*", first)[1])  # type: ignore[index]
    pairs = (line.partition(": ") for line in rest)
    return status, {name.lower(): value for name, _, value in pairs}, body


class Asking:
    """A client that gives commands, and keeps all that came."""

    def __init__(self, line: Any) -> None:
        self.line = line
        self.came: list[dict[str, Any] | Tick] = []
        self._id = 0

    def next(self, seconds: float = 30.0) -> Any:
        """A text as the dictionary that it holds, or a tick."""
        message = self.line.recv(timeout=seconds)
        self.came.append(json.loads(message) if isinstance(message, str) else parsed(message))
        return self.came[-1]

    def until(self, fits: Callable[[Any], bool], seconds: float = 30.0) -> Any:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            if fits(message := self.next(seconds)):
                return message
        raise AssertionError("it has not come")

    def text(self, fits: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        return self.until(lambda one: isinstance(one, dict) and fits(one))

    def tick(self, fits: Callable[[Tick], bool] = lambda one: True) -> Tick:
        return self.until(lambda one: not isinstance(one, dict) and fits(one))

    def state(self, fits: Callable[[dict[str, Any]], bool] = lambda one: True) -> dict[str, Any]:
        return self.tick(lambda one: one.kind == 1 and fits(one.state)).state

    def send(self, verb: str, **more: Any) -> int:
        self._id += 1
        self.line.send(json.dumps({"id": self._id, "verb": verb, **more}))
        return self._id

    def answer(self, number: int) -> dict[str, Any]:
        return self.text(lambda one: one["type"] == "answer" and one["id"] == number)

    def ask(self, verb: str, **more: Any) -> dict[str, Any]:
        return self.answer(self.send(verb, **more))

    def texts(self, kind: str) -> list[dict[str, Any]]:
        return [one for one in self.came if isinstance(one, dict) and one["type"] == kind]

    def ticks(self) -> list[Tick]:
        return [one for one in self.came if not isinstance(one, dict)]

    def rows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, flags and values of all rows that came."""
        t, words, values = zip(*((one.t, one.flags, one.values) for one in self.ticks()), strict=True)
        return np.concatenate(t), np.concatenate(words), np.concatenate(values, axis=1)


@contextmanager
def asked(
    *, folder: Path, commands: bool = False, patience: float | None = None, **changed: Any
) -> Iterator[tuple[Served, Asking]]:
    """A server that has got its hello, and may take commands, and a client of it."""
    with (
        serving(control=commands, folder=folder, patience=patience) as served,
        connect(served.socket_url(), max_size=None) as line,
    ):
        served.feed.say("hello", hello(**changed))
        yield served, Asking(line)
