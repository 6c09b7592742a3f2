"""Who may talk to the server: every request passes here first, whether HTTP or WebSocket, also from this machine.

A page of another site reaches a server of this machine through the browser of its user, under any name (DNS that
changes its mind), and a page of another port is of the same site. So a request names the server by its own address,
carries the token, and, where a browser says from which page it comes, comes from the server's own.
"""

import hmac
import ipaddress
import re
from collections.abc import Awaitable, Callable, Collection, MutableMapping
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

HEADERS: Final = 16 << 10
"""Bytes of a request's headers at most."""

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
    """What the guard goes by.

    Attributes
    ----------
    token : str
        What a request must carry.
    port : int
        Port that the server listens on.
    hosts : collection of str
        Names and addresses that it is called by beside those of this machine: that of ``--host``.
    origins : collection of str
        Origins of other pages that may open a WebSocket, with the token in its address.
    """

    token: str
    port: int
    hosts: Collection[str] = ()
    origins: Collection[str] = ()

    @property
    def cookie(self) -> str:
        """Name of the cookie, with the port: the cookies of all ports of a host are in one jar."""
        return f"plumbob-{self.port}"


class Guard:
    """ASGI application before another, which it lets nobody come to who may not.

    Parameters
    ----------
    app : callable
        The application.
    rules : GuardRules
        What it goes by.
    """

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
