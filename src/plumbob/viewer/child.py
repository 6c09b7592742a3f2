"""The server as a process of its own: started, fed through a pipe, started again where it dies, ended with the view."""

import json
import os
import re
import secrets
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final

from plumbob.core import check
from plumbob.core.errors import LineError, ParameterError, one_line
from plumbob.core.resources import asset
from plumbob.core.signals import end_process, held_signals
from plumbob.viewer.commands import ClientCommand
from plumbob.viewer.messages import Batch, Command, Hello
from plumbob.viewer.pipe import LIMIT, PAGE, TOKEN, MessageUnpacker, PipeMessage, PipeWriter, require_packages

STARTS: Final = 20  # How often a server that has died is started again
_APART: Final = 2.0  # Least time between two starts, s
_READY: Final = 30.0  # Longest wait for the first start, s; a cold disk is slow
_END: Final = 0.3, 0.8, 0.3
"""Longest waits at the end, s: for the last messages, for the server to end, and to end on being asked to."""
_COMMAND: Final = {field.name for field in fields(Command)}
_LAST_PORT: Final = 0xFFFF
_ORIGIN: Final = re.compile(r"[a-z][a-z0-9+.-]*://[a-z0-9.:\[\]_-]+")  # as a browser sends it


@dataclass(frozen=True, slots=True, kw_only=True)
class Serving:
    """How the view is served."""

    host: str = "127.0.0.1"  # address that is listened at
    port: int = 8770  # port; 0 takes a free one
    control: bool = False  # whether commands are taken
    clients: int | None = None  # clients at most; None: as the server has it
    allow_origin: Sequence[str] = ()  # further origins of pages that may connect
    folder: Path = Path()  # where files are written

    def __post_init__(self) -> None:
        check.kind("http_port", self.port, int, error=ParameterError)
        if not 0 <= self.port <= _LAST_PORT:
            raise ParameterError(f"http_port must be 0 to {_LAST_PORT}, but it is {self.port}; 0 takes a free one.")
        if self.clients is not None and check.kind("clients", self.clients, int, error=ParameterError) < 1:
            raise ParameterError(f"clients, the most viewers at a time, must be 1 or more, but it is {self.clients}.")
        for origin in self.allow_origin:
            if not _ORIGIN.fullmatch(origin):
                raise ParameterError(
                    f"an origin must be like https://app.foxglove.dev, without a path, but got {origin!r}. Leave the "
                    "rest out."
                )

    def words(self, number: int, port: int) -> list[str]:
        """Command that starts the server with its end of the pipe."""
        how = json.dumps(asdict(self) | {"port": port}, default=str)
        return [sys.executable, "-m", "plumbob.viewer.serve", str(number), how]


def require_view() -> None:
    """Refuse to begin without what the server needs."""
    require_packages()
    asset(PAGE)


class ServerOutlet:
    """Outlet into a server process; `note` is called with what happened to it."""

    def __init__(self, serving: Serving, note: Callable[[str], object]) -> None:
        self._serving, self._note = serving, note
        self._token = secrets.token_urlsafe(32)
        self._log = tempfile.TemporaryFile()  # noqa: SIM115  as long as the view
        self._process: subprocess.Popen[bytes] | None = None
        self._end: socket.socket | None = None
        self._writer: PipeWriter | None = None
        self._unpacker = MessageUnpacker()
        self._hello: Hello | None = None
        self._commands: list[ClientCommand] = []
        self._started_at = 0.0
        self._skipped = 0
        self.card: Path | None = None  # with which a guided calibration begins; set before the first hello
        self.starts = 0  # how often it was started
        self.port = serving.port
        self._is_ready = False

    @property
    def url(self) -> str:
        """Address of the page, with the token."""
        host = self._serving.host
        host = socket.gethostname() if host in ("0.0.0.0", "::") else host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/?token={self._token}"

    @property
    def pid(self) -> int:
        """Number of the process; 0 where there is none."""
        return 0 if self._process is None else self._process.pid

    @property
    def skipped(self) -> int:
        """Messages that the server did not get."""
        return self._skipped + (0 if self._writer is None else self._writer.skipped)

    def start(self) -> None:
        """Start it, and wait until it serves."""
        self._spawn()
        until = time.monotonic() + _READY
        while not self._is_ready:
            ended = self._has_ended()
            self._read()  # what it said before
            if not self._is_ready and (ended or time.monotonic() > until):
                message = self._said() or "the server of the view does not answer; try another --http-port."
                self.close()
                raise LineError(message)
            time.sleep(0.005)

    def hello(self, hello: Hello) -> None:
        """Begin."""
        self._hello = hello
        card = None if self.card is None else str(self.card)
        self._write(PipeMessage("hello", {**asdict(hello), "card": card}), must=True)

    def batch(self, batch: Batch) -> None:
        """Hand on samples; dropped where the server is too slow."""
        content = dict(batch.fields)
        if content.get("link") is not None:
            content["link"] = {**content["link"], "skipped": self.skipped}
        self._write(PipeMessage("batch", content, batch.rows))

    def event(self, t: float | None, kind: str, text: str) -> None:
        """Hand on an event."""
        self._write(PipeMessage("event", {"t": t, "kind": kind, "text": text}), must=self._has_room)

    def reset(self) -> None:
        """Let time begin again."""
        self._write(PipeMessage("reset", {}), must=True)

    def answer(self, request: ClientCommand, ok: bool, text: str) -> None:
        """Answer a command."""
        content = {"client": request.client, "id": request.command.id, "ok": ok, "text": text}
        self._write(PipeMessage("answer", content), must=self._has_room)

    def take_commands(self) -> Sequence[ClientCommand]:
        """Commands since the last call; looks after the process, too."""
        if self._writer is not None:
            self._writer.flush()
        self._read()
        if self._has_ended():
            self._again()
        commands, self._commands = self._commands, []
        return commands

    @property
    def ready(self) -> bool:
        """Whether it can take more without dropping any."""
        return self._writer is None or self._writer.broken or self._writer.waiting < LIMIT // 2

    def close(self) -> None:
        """End it."""
        process, self._process = self._process, None
        last, ending, asking = _END
        if self._writer is not None and self._end is not None and not self._writer.broken:
            self._writer.write(PipeMessage("end", {}), must=True)
            until = time.monotonic() + last
            while self._writer.waiting and not self._writer.broken and time.monotonic() < until:
                time.sleep(0.005)
                self._writer.flush()
        self._let_go()
        if process is not None:
            end_process(process, ending, asking)
        self._log.close()

    @property
    def _has_room(self) -> bool:
        """Whether even what must arrive may wait still; of a server that never reads, no message may."""
        return self._writer is not None and self._writer.waiting < 8 * LIMIT

    def _write(self, message: PipeMessage, *, must: bool = False) -> None:
        if self._writer is not None:
            self._writer.write(message, must=must and self._has_room)

    def _spawn(self) -> None:
        ours, theirs = socket.socketpair()
        self._end, self._writer, self._unpacker = ours, PipeWriter(ours), MessageUnpacker()
        with theirs, held_signals():
            self._process = subprocess.Popen(
                self._serving.words(theirs.fileno(), self.port),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._log,
                pass_fds=(theirs.fileno(),),
                env={**os.environ, TOKEN: self._token},
                start_new_session=True,  # Ctrl-C is for the recorder, which ends the server in order
            )
        self._is_ready, self._started_at = False, time.monotonic()
        self.starts += 1

    def _has_ended(self) -> bool:
        return self._process is not None and self._process.poll() is not None

    def _again(self) -> None:
        """Start it again, if it is time and there is hope."""
        assert self._process is not None
        if self._end is not None:
            ending = f"the server of the view has ended with exit code {self._process.returncode}"
            self._let_go()
            hope = "; it is started again" if self.starts <= STARTS else f" {self.starts} times, and is left alone"
            self._note(f"{ending}{hope}. The stream and the recording go on.")
        if self.starts <= STARTS and time.monotonic() - self._started_at >= _APART:
            self._spawn()
            if self._hello is not None:
                self.hello(self._hello)

    def _let_go(self) -> None:
        if self._writer is not None:
            self._skipped += self._writer.skipped
        if self._end is not None:
            self._end.close()
        self._end = self._writer = None

    def _read(self) -> None:
        """Take what the server says."""
        while self._end is not None:
            try:
                data = self._end.recv(1 << 16)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if not data:
                return
            for message in self._unpacker.feed(data):
                self._take(message.kind, message.content)

    def _take(self, kind: str, content: dict[str, Any]) -> None:
        if kind == "ready":
            self._is_ready, self.port = True, int(content["port"])
        elif kind == "command":
            arguments = {name: value for name, value in content.items() if name in _COMMAND}
            self._commands.append(ClientCommand(content.get("client"), Command(**arguments)))

    def _said(self) -> str:
        """Last line that the server wrote before it ended."""
        self._log.seek(0)
        lines = self._log.read()[-4096:].decode(errors="replace").strip().splitlines()
        return one_line(Exception(lines[-1])).removeprefix("plumbob: ") if lines else ""
