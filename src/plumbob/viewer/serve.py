"""The process that serves the live view: it reads the feed's messages from a pipe, and talks to whoever looks.

``python -m plumbob.viewer.serve --fd N --host H --port P``; the token comes in the environment as
``PLUMBOB_VIEW_TOKEN``. It ends when the pipe ends, or by a signal.
"""

import argparse
import asyncio
import contextlib
import os
import signal
import socket
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.core.errors import LineError, ParameterError, PlumbobError, one_line
from plumbob.viewer.app import Places, application
from plumbob.viewer.control_server import Control
from plumbob.viewer.derived import Derived
from plumbob.viewer.guard import Rules
from plumbob.viewer.hub import Hub
from plumbob.viewer.pipe import LIMIT, TOKEN, Message, Unpacker, packed, require_packages

if TYPE_CHECKING:
    import uvicorn

SHORTEST: Final = 22
"""Letters of a token at least: 128 bits, 6 to a letter."""
LOOPBACK: Final = ("127.0.0.1", "::1")

_SENT: Final = 128 << 10  # bytes that the system keeps for a client that does not read


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until the pipe ends."""
    token = os.environ.pop(TOKEN, "")
    options = _options(arguments)
    try:
        _require(token)
        asyncio.run(_run(options, token))
    except PlumbobError as error:
        sys.stderr.write(f"plumbob: {one_line(error)}\n")
        return 1
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="plumbob.viewer.serve", description="Serve the live view.")
    parser.add_argument("--fd", type=int, required=True, help="the pipe: a socket that was inherited")
    parser.add_argument("--host", default=LOOPBACK[0])
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--control", action="store_true", help="take commands")
    parser.add_argument("--clients", type=int, help="clients at most; without it 32, and 8 of one address")
    parser.add_argument("--allow-origin", action="append", default=[], metavar="ORIGIN")
    parser.add_argument("--folder", type=Path, default=Path(), help="where calibration cards are written")
    return parser.parse_args(arguments)


def _require(token: str) -> None:
    if len(token) < SHORTEST or not token.isascii() or not token.replace("-", "").replace("_", "").isalnum():
        raise ParameterError(
            f"{TOKEN} must hold a token of {SHORTEST} letters or more, as secrets.token_urlsafe makes."
        )
    require_packages()


async def _run(options: argparse.Namespace, token: str) -> None:
    from plumbob.viewer.lines import server_of

    # Each send gives the interpreter away; a thread that computes would keep it for 5 ms each time.
    sys.setswitchinterval(0.0005)
    sockets = listening(options.host, options.port)
    port = sockets[0].getsockname()[1]
    hosts = [socket.gethostname() if options.host in ("0.0.0.0", "::") else options.host]
    rules = Rules(token, port, hosts, tuple(options.allow_origin))
    places = Places(options.clients or 32, options.clients or 8)
    hub = Hub(control=options.control)
    pipe = Pipe(hub)
    control = Control(hub, pipe.write)
    derived = Derived(hub, options.folder)
    control.here.update(derived.commands)
    server = server_of(application(hub, control, rules, places))
    await pipe.open(socket.socket(fileno=options.fd), server)
    with _stopped_by_signals(server):
        serving = asyncio.create_task(server.serve(sockets))
        while not server.started and not serving.done():
            await asyncio.sleep(0.001)
        pipe.write(Message("ready", {"port": port}))
        await serving
    derived.close()


def listening(host: str, port: int) -> list[socket.socket]:
    """Sockets that listen: at the address, or where that is this machine's own, at both of its own.

    Raises
    ------
    LineError
        If the address is not one of this machine, or the port is taken.
    """
    is_own = host in (LOOPBACK[0], "localhost")
    try:
        place = LOOPBACK[0] if is_own else host
        kind, *_, address = socket.getaddrinfo(place, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        first = _bound(kind, address)
    except OSError as error:
        raise LineError(
            f"the view cannot listen at {host}, port {port}: {error.strerror}. Name another with --host or --http-port."
        ) from error
    if not is_own:
        return [first]
    with contextlib.suppress(OSError):  # a machine without IPv6, or another program there
        return [first, _bound(socket.AF_INET6, (LOOPBACK[1], first.getsockname()[1]))]
    return [first]


def _bound(kind: int, address: Any) -> socket.socket:
    found = socket.socket(kind, socket.SOCK_STREAM)
    try:
        if os.name == "posix":
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if kind == socket.AF_INET6:
            found.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SENT)
        found.bind(address)
        found.setblocking(False)
    except OSError:
        found.close()
        raise
    return found


@contextlib.contextmanager
def _stopped_by_signals(server: "uvicorn.Server") -> Iterator[None]:
    def stop(*_: object) -> None:
        server.should_exit = True

    before = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Pipe(asyncio.Protocol):
    """The server's end of the pipe; the server ends with it."""

    def __init__(self, hub: Hub) -> None:
        self._hub, self._unpacker = hub, Unpacker()
        self._transport: asyncio.Transport | None = None
        self._server: uvicorn.Server | None = None

    async def open(self, end: socket.socket, server: "uvicorn.Server") -> None:
        """Begin to read."""
        end.setblocking(False)
        self._server = server
        await asyncio.get_running_loop().create_connection(lambda: self, sock=end)

    def write(self, message: Message) -> bool:
        """Write a message; False where the feed is gone, or has not read for long."""
        transport = self._transport
        if transport is None or transport.is_closing() or transport.get_write_buffer_size() > LIMIT:
            return False
        transport.write(packed(message))
        return True

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the transport."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        """Hand messages on."""
        for message in self._unpacker.feed(data):
            if message.kind == "end":
                self._stop()
            else:
                self._hub.take(message)

    def eof_received(self) -> bool:
        """End with the pipe."""
        self._stop()
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        """End with the pipe."""
        self._stop()

    def _stop(self) -> None:
        if self._server is not None:
            self._server.should_exit = True


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # a fit that runs, or a compiler, is not waited for
