"""The process that serves the live view: it reads the feed's messages from a pipe, and talks to whoever looks.

``python -m plumbob.viewer.serve N JSON``: the number of the pipe, a socket that was inherited, and a `Serving` of
`plumbob.viewer.child`; the token comes in the environment as ``PLUMBOB_VIEW_TOKEN``. It ends when the pipe ends, or by
a signal.

What it answers is a fixed table of routes, made at its start; nothing that a client sends becomes a path. Of commands,
what is a matter of the view is done here, what is one of the session goes over the pipe.
"""

import asyncio
import contextlib
import json
import mimetypes
import os
import socket
import sys
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import asdict
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.core.errors import LineError, MissingExtraError, ParameterError, PlumbobError, one_line
from plumbob.core.resources import asset
from plumbob.core.signals import on_signals
from plumbob.viewer.child import Serving
from plumbob.viewer.commands import RefusedError, parse_command
from plumbob.viewer.derived import Derived
from plumbob.viewer.foxglove import Foxglove
from plumbob.viewer.guard import App, Guard, GuardRules
from plumbob.viewer.hub import Client, Hub, delivered
from plumbob.viewer.messages import Answer, Command, as_json
from plumbob.viewer.pipe import LIMIT, PAGE, TOKEN, MessageUnpacker, PipeMessage, packed, require_packages

if TYPE_CHECKING:
    import uvicorn
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.routing import BaseRoute
    from starlette.websockets import WebSocket

BODY: Final = 64 << 10  # Bytes of a request's body at most: a command has a few hundred
OUTSTANDING: Final = 8  # Commands of a client that wait for their answer at most
FULL: Final = 1013  # Close code of a client that finds no room, or was too slow: try again later
_READ_ONLY: Final = "This view takes no commands. Start it with --control."


class Places:
    """Room for clients: how many there may be, in all and from one address."""

    def __init__(self, most: int, of_address: int) -> None:
        self._most, self._of_address = most, of_address
        self._by_address: Counter[str] = Counter()

    def take(self, address: str) -> str:
        """Take a place, and return an empty text; else why there is none."""
        total = self._by_address.total()
        if total >= self._most:
            return f"{total} clients are connected, as many as may be. Close one, or raise it with --clients."
        if self._by_address[address] >= self._of_address:
            return f"{self._of_address} clients of your address are connected; raise it with --clients."
        self._by_address[address] += 1
        return ""

    def leave(self, address: str) -> None:
        """Give a place back."""
        self._by_address[address] -= 1
        self._by_address += Counter()  # without those that have none


def files() -> dict[str, tuple[bytes, str]]:
    """Files of the built page by the path under which they are served, with their types; none where it is not built."""
    try:
        index = asset(PAGE)
    except MissingExtraError:
        return {}
    paths = {"/": index}
    paths |= {
        f"/{path.relative_to(index.parent).as_posix()}": path
        for path in index.parent.rglob("*")
        if path.is_file() and not path.is_symlink()
    }
    return {name: (path.read_bytes(), _media_type(path)) for name, path in paths.items() if name != f"/{index.name}"}


def _media_type(path: Path) -> str:
    media = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".svg": "image/svg+xml"}
    kind = media.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return f"{kind}; charset=utf-8" if kind.startswith("text/") else kind


def application(hub: Hub, control: "Control", rules: GuardRules, places: Places) -> App:
    """ASGI application of the server, behind its guard."""
    from starlette.applications import Starlette
    from starlette.routing import Route, WebSocketRoute

    pages = files()
    api = Api(hub, control)
    routes: list[BaseRoute] = [Route(name, _file(*page), methods=["GET"]) for name, page in pages.items()]
    if not pages:
        routes.append(Route("/", _not_built, methods=["GET"]))
    routes += [
        Route("/api/hello", api.hello, methods=["GET"]),
        Route("/api/state", api.state, methods=["GET"]),
        Route("/api/command", api.command, methods=["POST"]),
        WebSocketRoute("/ws", _placed(places, PageSocket(hub, control).serve)),
        WebSocketRoute("/foxglove", _placed(places, Foxglove(hub).serve)),
    ]
    starlette = Starlette(routes=routes)
    starlette.router.redirect_slashes = False
    return Guard(starlette, rules)


def _file(content: bytes, kind: str) -> Callable[["Request"], Awaitable["Response"]]:
    from starlette.responses import Response

    async def respond(_request: "Request") -> Response:  # Starlette runs plain functions in threads
        return Response(content, headers={"content-type": kind})

    return respond


async def _not_built(_request: "Request") -> "Response":
    from starlette.responses import PlainTextResponse

    try:
        asset(PAGE)
    except MissingExtraError as error:
        return PlainTextResponse(f"{error}\n", 503)
    return PlainTextResponse("The page was built after this view had started. Start it again.\n", 503)


class Api:
    """What programs ask for without a WebSocket."""

    def __init__(self, hub: Hub, control: "Control") -> None:
        self._hub, self._control = hub, control

    async def hello(self, _request: "Request") -> "Response":
        """Newest hello."""
        return _json(self._hub.hello_text or "null")

    async def state(self, _request: "Request") -> "Response":
        """What is the case now."""
        return _json(as_json(self._hub.state()))

    async def command(self, request: "Request") -> "Response":
        """Do what is asked for, and say how it went."""
        if not self._hub.control:
            return _answer(Answer(id=0, ok=False, text=_READ_ONLY), 403)
        if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
            return _answer(Answer(id=0, ok=False, text="A command is sent as application/json."), 415)
        body = await _body(request)
        if body is None:
            return _answer(Answer(id=0, ok=False, text=f"A command has at most {BODY} bytes."), 413)
        try:
            command = parse_command(body)
        except RefusedError as why:
            return _answer(Answer(id=why.id, ok=False, text=str(why)), 400)
        answer = await self._control.do(command)
        return _answer(answer, 200 if answer.ok else 409)


async def _body(request: "Request") -> bytes | None:
    """Body of a request; None where it is too long."""
    body = bytearray()
    async for part in request.stream():
        body += part
        if len(body) > BODY:
            return None
    return bytes(body)


def _json(text: str, status: int = 200) -> "Response":
    from starlette.responses import Response

    return Response(text, status, media_type="application/json")


def _answer(answer: Answer, status: int) -> "Response":
    return _json(as_json(asdict(answer)), status)


SocketServing = Callable[["WebSocket"], Awaitable[None]]


def _placed(places: Places, serve: SocketServing) -> SocketServing:
    """Serve a WebSocket where there is room for it."""

    async def serving(socket: "WebSocket") -> None:
        address = socket.client.host if socket.client else ""
        if why := places.take(address):
            await socket.accept()
            await socket.close(FULL, why)
            return
        try:
            await serve(socket)
        finally:
            places.leave(address)

    return serving


class PageSocket:
    """What a page gets over its WebSocket, and what it may ask for."""

    def __init__(self, hub: Hub, control: "Control") -> None:
        self._hub, self._control = hub, control

    async def serve(self, socket: "WebSocket") -> None:
        """Serve a page until one of the two goes."""
        since = socket.query_params.get("since", "")
        client = Client(self._hub, int(since) if since.isascii() and since.isdigit() and len(since) < 16 else None)
        await socket.accept()
        commands: set[asyncio.Task[None]] = set()
        try:
            async with delivered(client, socket, self._hub.clients):
                while True:
                    self._ask(client, await socket.receive_text(), commands)
        except KeyError:
            await socket.close(1003, "A command is text, not bytes.")

    def _ask(self, client: Client, text: str, commands: set["asyncio.Task[None]"]) -> None:
        """Do a command in a task of its own, or say why not."""
        try:
            command = parse_command(text)
        except RefusedError as why:
            client.answer(Answer(id=why.id, ok=False, text=str(why)))
            return
        if not self._hub.control:
            client.answer(Answer(id=command.id, ok=False, text=_READ_ONLY))
        elif len(commands) >= OUTSTANDING:
            client.answer(Answer(id=command.id, ok=False, text="Too many commands wait for their answers."))
        else:
            task = asyncio.create_task(self._do(client, command))
            commands.add(task)
            task.add_done_callback(commands.discard)

    async def _do(self, client: Client, command: Command) -> None:
        client.answer(await self._control.do(command))


SHORTEST: Final = 22  # Letters of a token at least: 128 bits, 6 to a letter
LOOPBACK: Final = ("127.0.0.1", "::1")

_SENT: Final = 128 << 10  # bytes that the system keeps for a client that does not read


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until the pipe ends."""
    token = os.environ.pop(TOKEN, "")
    number, how = arguments or sys.argv[1:]
    try:
        _require(token)
        asyncio.run(_run(int(number), Serving(**json.loads(how)), token))
    except PlumbobError as error:
        sys.stderr.write(f"plumbob: {one_line(error)}\n")
        return 1
    return 0


def _require(token: str) -> None:
    if len(token) < SHORTEST or not token.isascii() or not token.replace("-", "").replace("_", "").isalnum():
        raise ParameterError(
            f"{TOKEN} must hold a token of {SHORTEST} letters or more, as secrets.token_urlsafe makes."
        )
    require_packages()


async def _run(number: int, how: Serving, token: str) -> None:
    from plumbob.viewer.guard import http_server

    # Each send gives the interpreter away; a thread that computes would keep it for 5 ms each time.
    sys.setswitchinterval(0.0005)
    sockets = listening(how.host, how.port)
    port = sockets[0].getsockname()[1]
    hosts = [socket.gethostname() if how.host in ("0.0.0.0", "::") else how.host]
    rules = GuardRules(token, port, hosts, how.allow_origin)
    places = Places(how.clients or 32, how.clients or 8)
    hub = Hub(control=how.control)
    pipe = Pipe(hub)
    control = Control(hub, pipe.write)
    derived = Derived(hub, Path(how.folder))
    control.here.update(derived.commands)
    server = http_server(application(hub, control, rules, places))
    await pipe.open(socket.socket(fileno=number), server)
    with on_signals(lambda *_: setattr(server, "should_exit", True), "SIGTERM", "SIGINT"):
        serving = asyncio.create_task(server.serve(sockets))
        while not server.started and not serving.done():
            await asyncio.sleep(0.001)
        pipe.write(PipeMessage("ready", {"port": port}))
        await serving
    derived.close()


def listening(host: str, port: int) -> list[socket.socket]:
    """Sockets that listen: at the address, or where that is this machine's own, at both of its own."""
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
    listener = socket.socket(kind, socket.SOCK_STREAM)
    try:
        if os.name == "posix":
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if kind == socket.AF_INET6:
            listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SENT)
        listener.bind(address)
        listener.setblocking(False)
    except OSError:
        listener.close()
        raise
    return listener


class Pipe(asyncio.Protocol):
    """The server's end of the pipe; the server ends with it."""

    def __init__(self, hub: Hub) -> None:
        self._hub, self._unpacker = hub, MessageUnpacker()
        self._transport: asyncio.Transport | None = None
        self._server: uvicorn.Server | None = None

    async def open(self, end: socket.socket, server: "uvicorn.Server") -> None:
        """Begin to read."""
        end.setblocking(False)
        self._server = server
        await asyncio.get_running_loop().create_connection(lambda: self, sock=end)

    def write(self, message: PipeMessage) -> bool:
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


PATIENCE: Final = 10.0  # How long an answer of the session is waited for, s


class Control:
    """Does commands; `write` writes a message into the pipe, and says whether it was taken."""

    def __init__(self, hub: Hub, write: Callable[[PipeMessage], bool]) -> None:
        self._hub, self._write = hub, write
        self._numbers = count(1)
        self._asked: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self.here: dict[str, Callable[[Command], str | Awaitable[str]]] = {"tare": self._tare, "untare": self._untare}
        hub.listeners.add(self._listen)

    async def do(self, command: Command) -> Answer:
        """Do a command, and say how it went."""
        answer = await (self._do_here(command) if command.verb in self.here else self._ask(command))
        if answer.ok:
            self._hub.tell("command", f"{_accepted(command)}: {answer.text}" if answer.text else _accepted(command))
        return answer

    async def _do_here(self, command: Command) -> Answer:
        try:
            reply = self.here[command.verb](command)
            return Answer(id=command.id, ok=True, text=reply if isinstance(reply, str) else await reply)
        except PlumbobError as why:
            return Answer(id=command.id, ok=False, text=one_line(why))

    async def _ask(self, command: Command) -> Answer:
        """Ask the session, which knows the command by a number of ours: two clients may use the same."""
        number = next(self._numbers)
        if not self._write(PipeMessage("command", {"client": number, **asdict(command)})):
            return Answer(id=command.id, ok=False, text="The session takes no command at present. Try again.")
        future = self._asked[number] = asyncio.get_running_loop().create_future()
        try:
            answer = await asyncio.wait_for(future, PATIENCE)
        except TimeoutError:
            return Answer(id=command.id, ok=False, text=f"The session has not answered within {PATIENCE:.0f} s.")
        finally:
            del self._asked[number]
        return Answer(id=command.id, ok=bool(answer["ok"]), text=str(answer["text"]))

    def _listen(self, message: PipeMessage) -> None:
        if message.kind != "answer":
            return
        future = self._asked.get(message.content["client"])
        if future is not None and not future.done():
            future.set_result(message.content)

    def _tare(self, _command: Command) -> str:
        attitude = self._hub.fields.get("attitudes", {}).get(self._hub.primary)
        if attitude is None:
            raise PlumbobError("There is no attitude to count from yet. Wait for one.")
        self._hub.tare.set(attitude["q_nb"])
        return "Roll, pitch and yaw count from this attitude; charts, errors and recordings do not."

    def _untare(self, _command: Command) -> str:
        self._hub.tare.clear()
        return "Roll, pitch and yaw count from the navigation frame."


def _accepted(command: Command) -> str:
    """What an event says of a command that was done."""
    arguments = " ".join(str(part) for part in (command.name, command.text, command.value) if part not in ("", None))
    return f"{command.verb} {arguments}".strip()


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # a fit that runs, or a compiler, is not waited for
