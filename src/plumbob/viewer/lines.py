"""The lines to clients: uvicorn's protocols, with deadlines for who is slow to ask, and for who is slow to listen."""

import asyncio
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Final

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from plumbob.viewer.guard import HEADERS, App

ASKING_S: Final = 5.0
"""How long a request may take to come, s."""
LISTENING_S: Final = 5.0
"""How long a client may take nothing of what it is sent, s."""
BODY: Final = 1 << 20
"""Bytes of a request's body at most, also of one that nobody reads."""
MESSAGE: Final = 64 << 10
"""Bytes of a client's message at most."""
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
