"""What the server answers: a fixed table of routes, made at its start; nothing that a client sends becomes a path."""

import asyncio
import mimetypes
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Final

from plumbob.core.errors import MissingExtraError
from plumbob.core.web import asset
from plumbob.viewer.commands import RefusedError, command_of
from plumbob.viewer.foxglove import Foxglove
from plumbob.viewer.guard import App, Guard, Rules
from plumbob.viewer.hub import Client, Hub, deliver
from plumbob.viewer.messages import Answer, Command, as_json
from plumbob.viewer.pipe import PAGE

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.routing import BaseRoute
    from starlette.websockets import WebSocket

    from plumbob.viewer.control_server import Control

BODY: Final = 64 << 10
"""Bytes of a request's body at most: a command has a few hundred."""
OUTSTANDING: Final = 8
"""Commands of a client that wait for their answer at most."""
FULL: Final = 1013
"""Close code of a client that finds no room, or was too slow: try again later."""
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
    found = {"/": index}
    found |= {f"/{path.relative_to(index.parent).as_posix()}": path for path in _regular(index.parent)}
    return {name: (path.read_bytes(), _type_of(path)) for name, path in found.items() if name != f"/{index.name}"}


def _regular(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]


def _type_of(path: Path) -> str:
    known = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".svg": "image/svg+xml"}
    kind = known.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return f"{kind}; charset=utf-8" if kind.startswith("text/") else kind


def application(hub: Hub, control: "Control", rules: Rules, places: Places) -> App:
    """ASGI application of the server, behind its guard."""
    from starlette.applications import Starlette
    from starlette.routing import Route, WebSocketRoute

    pages = files()
    api = Api(hub, control)
    routes: list[BaseRoute] = [Route(name, _file(*found), methods=["GET"]) for name, found in pages.items()]
    if not pages:
        routes.append(Route("/", _not_built, methods=["GET"]))
    routes += [
        Route("/api/hello", api.hello, methods=["GET"]),
        Route("/api/state", api.state, methods=["GET"]),
        Route("/api/command", api.command, methods=["POST"]),
        WebSocketRoute("/ws", _placed(places, Page(hub, control).serve)),
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
            command = command_of(body)
        except RefusedError as why:
            return _answer(Answer(id=why.id, ok=False, text=str(why)), 400)
        answer = await self._control.do(command)
        return _answer(answer, 200 if answer.ok else 409)


async def _body(request: "Request") -> bytes | None:
    """Body of a request; None where it is too long."""
    found = bytearray()
    async for part in request.stream():
        found += part
        if len(found) > BODY:
            return None
    return bytes(found)


def _json(text: str, status: int = 200) -> "Response":
    from starlette.responses import Response

    return Response(text, status, media_type="application/json")


def _answer(answer: Answer, status: int) -> "Response":
    return _json(as_json(asdict(answer)), status)


Serving = Callable[["WebSocket"], Awaitable[None]]


def _placed(places: Places, serve: Serving) -> Serving:
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


class Page:
    """What a page gets over its WebSocket, and what it may ask for."""

    def __init__(self, hub: Hub, control: "Control") -> None:
        self._hub, self._control = hub, control

    async def serve(self, socket: "WebSocket") -> None:
        """Serve a page until one of the two goes."""
        from starlette.websockets import WebSocketDisconnect

        since = socket.query_params.get("since", "")
        client = Client(self._hub, int(since) if since.isascii() and since.isdigit() and len(since) < 16 else None)
        await socket.accept()
        self._hub.clients.add(client)
        sending = asyncio.create_task(deliver(client, socket))
        commands: set[asyncio.Task[None]] = set()
        try:
            while True:
                text = await socket.receive_text()
                self._ask(client, text, commands)
        except WebSocketDisconnect:
            pass
        except KeyError:
            sending.cancel()
            await socket.close(1003, "A command is text, not bytes.")
        finally:
            self._hub.clients.discard(client)
            sending.cancel()

    def _ask(self, client: Client, text: str, commands: set["asyncio.Task[None]"]) -> None:
        """Do a command in a task of its own, or say why not."""
        try:
            command = command_of(text)
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
