"""Who may talk to the server: every request passes here first, whether HTTP or WebSocket, also from this machine.

A page of another site reaches a server of this machine through the browser of its user, under any name (DNS that
changes its mind), and a page of another port is of the same site. So a request names the server by its own address,
carries the token, and, where a browser says from which page it comes, comes from the server's own.

The lines to clients are uvicorn's protocols with deadlines, for who is slow to ask and for who is slow to listen.
"""

import asyncio
import hmac
import ipaddress
import re
from collections.abc import Awaitable, Callable, Collection, MutableMapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import parse_qs

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

HEADERS: Final = 16 << 10  # Bytes of a request's headers at most

_LOOPBACK: Final = ("localhost", "127.0.0.1", "[::1]")
_ALWAYS: Final = {
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
}
_HOST: Final = re.compile(r"[A-Za-z0-9.:\[\]-]+")
_POLICY: Final = (
    "default-src 'self'; img-src 'self' data: blob:; connect-src 'self' {ws}; worker-src 'self' blob:; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class Refusal(Exception):  # noqa: N818 - an answer, of which no one who calls the package hears
    """A request that is refused, with its HTTP status."""

    def __init__(self, status: int, text: str) -> None:
        self.status = status
        super().__init__(text)


@dataclass(frozen=True, slots=True)
class GuardRules:
    """What the guard goes by."""

    token: str  # what a request must carry
    port: int  # port that the server listens on
    # names and addresses that it is called by beside those of this machine: that of ``--host``
    hosts: Collection[str] = ()
    origins: Collection[str] = ()  # origins of other pages that may open a WebSocket, with the token in its address

    @property
    def cookie(self) -> str:
        """Name of the cookie, with the port: the cookies of all ports of a host are in one jar."""
        return f"plumbob-{self.port}"


class Guard:
    """ASGI application before another, which it lets nobody come to who may not."""

    def __init__(self, app: App, rules: GuardRules) -> None:
        self._app, self._rules = app, rules

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, or answer it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = _headers(scope)
        size = sum(len(key) + len(value) + 4 for key, value in scope["headers"]) + len(scope["query_string"])
        protecting = _protecting(send, headers.get("host", ""))
        try:
            if size > HEADERS:
                raise Refusal(431, f"The headers of a request have at most {HEADERS} bytes.")
            entered = self._judge(scope, headers)
        except Refusal as why:
            await _refuse(scope, receive, protecting, why)
            return
        if entered:
            await self._let_in(protecting)
        else:
            await self._app(scope, receive, protecting)

    def _judge(self, scope: Scope, headers: dict[str, str]) -> bool:
        """Refuse what may not be; True where somebody comes by the link that the server printed."""
        host = self._host(scope, headers)
        explicit = self._token(scope, headers)
        self._origin(scope, headers, host, explicit)
        if scope["type"] == "websocket" or scope["method"] in ("GET", "HEAD"):
            return scope["type"] == "http" and scope["path"] == "/" and "token" in _query(scope)
        if scope["method"] != "POST" or scope["path"] != "/api/command":
            raise Refusal(405, "Only GET is answered here.")
        return False

    def _host(self, scope: Scope, headers: dict[str, str]) -> str:
        """The host that the request names, which must be this server."""
        host = headers.get("host", "").lower()
        name, _, port = host.rpartition(":")
        if not port.isdecimal():
            name, port = host, "80"
        hosts = {*_LOOPBACK, *map(bracketed, self._rules.hosts), bracketed(str((scope.get("server") or ("",))[0]))}
        if name not in hosts or port != str(self._rules.port) or headers.get("host", "").count(",") or name == "":
            raise Refusal(421, "This is not the server of that name. Use the link that it printed.")
        return host

    def _token(self, scope: Scope, headers: dict[str, str]) -> bool:
        """Refuse what has not the token; True where it was given in a header or in the address, not by a cookie."""
        given = _query(scope).get("token") if scope["type"] == "websocket" or scope["path"] == "/" else None
        if given is None and "authorization" in headers:
            scheme, _, given = headers["authorization"].partition(" ")
            given = given if scheme.lower() == "bearer" else ""
        explicit = given is not None
        some = _cookies(headers.get("cookie", ""), self._rules.cookie) if given is None else [given]
        if not any([hmac.compare_digest(token.encode(errors="replace"), self._rules.token.encode()) for token in some]):
            raise Refusal(401, "A token is needed. Use the link that 'plumbob view' printed.")
        return explicit

    def _origin(self, scope: Scope, headers: dict[str, str], host: str, explicit: bool) -> None:
        """Refuse what a page of somewhere else asks for."""
        origin, changes = headers.get("origin"), scope["type"] == "websocket" or scope["method"] == "POST"
        if origin is None:
            if changes and not explicit:
                raise Refusal(
                    403, "Without an Origin, the token must be in a header, or in the address of a WebSocket."
                )
        elif origin in self._rules.origins and scope["type"] == "websocket" and explicit:
            return
        elif origin.lower() != f"http://{host}":
            raise Refusal(403, "Pages of another origin are not served. Name it with --allow-origin.")
        site = headers.get("sec-fetch-site", "none")
        if site in ("same-origin", "none"):
            return
        opened = headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest") == "document"
        if changes or not opened or scope["path"] != "/":
            raise Refusal(403, "Pages of another origin are not served.")

    async def _let_in(self, send: Send) -> None:
        """Give the cookie, and lead to the page under an address without the token."""
        cookie = f"{self._rules.cookie}={self._rules.token}; Path=/; HttpOnly; SameSite=Strict"
        headers = [(b"location", b"/"), (b"set-cookie", cookie.encode()), (b"content-length", b"0")]
        await send({"type": "http.response.start", "status": 303, "headers": headers})
        await send({"type": "http.response.body", "body": b""})


def bracketed(name: str) -> str:
    """Host as it stands in an address: IPv6 in brackets."""
    try:
        return f"[{ipaddress.IPv6Address(name)}]"
    except ValueError:
        return name.lower()


def _headers(scope: Scope) -> dict[str, str]:
    """Headers by name; one that came more than once has all its values, which is then no value that is looked for."""
    headers = dict[str, str]()
    for key, value in scope["headers"]:
        name, text = key.decode("latin-1").lower(), value.decode("latin-1")
        headers[name] = f"{headers[name]}, {text}" if name in headers else text
    return headers


def _query(scope: Scope) -> dict[str, str]:
    """Parts of the query; of one that came more than once, none is right."""
    try:
        query = parse_qs(scope["query_string"].decode("ascii"), max_num_fields=8, keep_blank_values=True)
    except ValueError:
        return {}
    return {name: values[0] if len(values) == 1 else "" for name, values in query.items()}


def _cookies(header: str, name: str) -> list[str]:
    """Values of a cookie; programs on other ports set cookies of any form for the same host."""
    pairs = (part.strip().partition("=") for part in header.split(";"))
    return [value for key, _, value in pairs if key == name]


def _protecting(send: Send, host: str) -> Send:
    """Send answers with the headers that every answer has."""
    policy = _POLICY.format(ws=f"ws://{host}" if _HOST.fullmatch(host) else "")

    async def sending(message: MutableMapping[str, Any]) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            present = {key.lower() for key, _ in message.get("headers", [])}
            more = [(k.encode(), v.encode("latin-1")) for k, v in _ALWAYS.items() if k.encode() not in present]
            more.append((b"content-security-policy", policy.encode("latin-1")))
            message = {**message, "headers": [*message.get("headers", []), *more]}
        await send(message)

    return sending


async def _refuse(scope: Scope, receive: Receive, send: Send, why: Refusal) -> None:
    kind = "http.response" if scope["type"] == "http" else "websocket.http.response"
    if kind.startswith("websocket"):
        await receive()
    body = f"{why}\n".encode()
    headers = [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"content-length", str(len(body)).encode()),
        (b"connection", b"close"),
    ]
    if why.status == 401:
        headers.append((b"www-authenticate", b"Bearer"))
    await send({"type": f"{kind}.start", "status": why.status, "headers": headers})
    await send({"type": f"{kind}.body", "body": body})


ASKING_S: Final = 5.0  # How long a request may take to come, s
LISTENING_S: Final = 5.0  # How long a client may take nothing of what it is sent, s
BODY: Final = 1 << 20  # Bytes of a request's body at most, also of one that nobody reads
MESSAGE: Final = 64 << 10  # Bytes of a client's message at most
SLOW: Final = 1013, "Too slow: nothing could be sent for 5 s. Connect again."

_NO_HANDSHAKE: Final = b"HTTP/1.1 431 Request Header Fields Too Large\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
_CLOSING_S: Final = 10.0  # in which who was slow can still read why
_ASKING_MOST: Final = 64
_LAST_S: Final = 0.5
_WAITING: Final = 64 << 10  # bytes that wait in this process for a client at most, and a message


class Server(uvicorn.Server):
    """A server whose signals are its process's matter."""

    def capture_signals(self) -> AbstractContextManager[None]:  # type: ignore[override]
        """Leave them."""
        return nullcontext()


class HttpLine(H11Protocol):
    """A connection that must ask in time: a request that drips in is cut, and so is the oldest of too many."""

    _asking: dict["HttpLine", None] = {}  # noqa: RUF012 - of the process; in order of their coming

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for a request."""
        super().connection_made(transport)
        self._deadline: asyncio.TimerHandle | None = None
        self._stalled: asyncio.TimerHandle | None = None
        self._body = 0
        transport.set_write_buffer_limits(high=_WAITING)
        self._expect()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop waiting."""
        self._stop_waiting()
        _cancel(self._stalled)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take a part of a request; once it is whole, nothing is waited for."""
        super().data_received(data)
        if self.transport.get_protocol() is not self:
            self._stop_waiting()  # it has become a WebSocket, which was asked for in time
        elif self.conn.their_state is h11.SEND_BODY or self.conn.trailing_data[0]:
            self._expect()
            self._body += len(data)
            if self._body > BODY:
                self.transport.abort()
        else:
            self._stop_waiting()

    def pause_writing(self) -> None:
        """Give who does not read a while."""
        super().pause_writing()
        self._stalled = self.loop.call_later(LISTENING_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Take it back."""
        super().resume_writing()
        _cancel(self._stalled)

    def shutdown(self) -> None:
        """Close, and wait for nobody who does not read."""
        super().shutdown()
        self.loop.call_later(_LAST_S, self.transport.abort)

    def _expect(self) -> None:
        if self._deadline is not None:
            return
        self._deadline = self.loop.call_later(ASKING_S, self.transport.abort)
        self._asking[self] = None
        if len(self._asking) > _ASKING_MOST:
            next(iter(self._asking)).transport.abort()

    def _stop_waiting(self) -> None:
        _cancel(self._deadline)
        self._deadline = None
        self._body = 0
        self._asking.pop(self, None)


class SocketLine(WebSocketsSansIOProtocol):
    """A WebSocket that is closed, with the reason, where its client takes nothing for a while."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep little for it in this process."""
        super().connection_made(transport)
        self._slow: asyncio.TimerHandle | None = None
        self._opening = self.loop.call_later(ASKING_S, self._require_open)
        self.transport.set_write_buffer_limits(high=_WAITING, low=_WAITING // 4 * 3)  # so that 5 s mean a standstill

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop waiting."""
        _cancel(self._slow)
        _cancel(self._opening)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take what comes; a handshake comes whole, so what is none then is none."""
        super().data_received(data)
        if not self.handshake_initiated:
            self.transport.write(_NO_HANDSHAKE)
            self.transport.close()

    def pause_writing(self) -> None:
        """Give who does not read a while."""
        super().pause_writing()
        self._slow = self.loop.call_later(LISTENING_S, self._drop)

    def resume_writing(self) -> None:
        """Take it back."""
        super().resume_writing()
        _cancel(self._slow)

    def handle_parser_exception(self) -> None:
        """Say what was wrong, and read on for a moment: who still sends would be cut off before it has read that."""
        if self.close_sent:
            return
        assert self.conn.close_sent is not None
        code, reason = self.conn.close_sent.code, self.conn.close_sent.reason
        self.queue.put_nowait({"type": "websocket.disconnect", "code": code, "reason": reason})
        self.transport.write(b"".join(self.conn.data_to_send()))
        self.close_sent = True
        if self.read_paused:
            self.read_paused = False
            self.transport.resume_reading()
        self.close_timer = self.loop.call_later(_LAST_S, self.transport.close)

    def shutdown(self) -> None:
        """Close, and wait for nobody who does not read."""
        super().shutdown()
        self.loop.call_later(_LAST_S, self.transport.abort)

    def _require_open(self) -> None:
        if not self.handshake_complete:
            self.transport.abort()

    def _drop(self) -> None:
        """Let the client find why, should it read again, and let the application go on without it."""
        code, reason = SLOW
        if not self.close_sent and self.handshake_complete:
            self.conn.send_close(code, reason)
            self.transport.write(b"".join(self.conn.data_to_send()))
            self.close_sent = True
        self.queue.put_nowait({"type": "websocket.disconnect", "code": code, "reason": reason})
        self.disconnected = True
        self.writable.set()
        self.transport.close()
        self._slow = self.loop.call_later(_CLOSING_S, self.transport.abort)


def _cancel(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()


def http_server(app: App) -> Server:
    """Server of an application, with the limits of what a client may send."""
    options: dict[str, Any] = {
        "http": HttpLine,
        "ws": SocketLine,
        "ws_max_size": MESSAGE,
        "ws_per_message_deflate": False,
        "ws_ping_interval": 20.0,
        "ws_ping_timeout": 20.0,
        "h11_max_incomplete_event_size": HEADERS,
        "timeout_keep_alive": 5,
        "timeout_graceful_shutdown": 1,
        "lifespan": "off",
        "log_config": None,
        "log_level": "critical",
        "access_log": False,
        "proxy_headers": False,
        "server_header": False,
        "loop": "asyncio",
    }
    return Server(uvicorn.Config(app, **options))
