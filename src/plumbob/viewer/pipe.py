"""The pipe between the process that reads a line and the one that shows it: a socket with framed messages.

A message is a kind, a JSON object and arrays. Writing never waits: what does not fit into `LIMIT` is dropped whole and
counted, for the recorder goes before the view. Reading is the server's, which has nothing else to do.
"""

import json
import socket
import struct
from collections import deque
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import MissingExtraError

LIMIT: Final = 1 << 20  # Bytes that wait for a slow server at most
TOKEN: Final = "PLUMBOB_VIEW_TOKEN"  # of the environment, for options can be read by every process of the machine
PAGE: Final = "view/index.html"  # The built page, as `plumbob.core.resources.asset` has it
_HEAD: Final = struct.Struct("<II")
_MOST: Final = 64 << 20


def require_packages() -> None:
    """Refuse to begin without the packages of the server."""
    for name in ("starlette", "uvicorn", "websockets"):
        if find_spec(name) is None:
            raise MissingExtraError(f'the live view needs {name}: pip install "plumbob[view]".')


class PipeMessage(NamedTuple):
    """A message."""

    # From the feed: ``hello`` (`messages.Hello` as JSON), ``batch`` (`messages.Batch`), ``event`` (``t``, ``kind``,
    # ``text``), ``reset`` (a new epoch), ``answer`` (``client``, ``id``, ``ok``, ``text``), ``end``. From the server:
    # ``command`` (``client`` and `messages.Command`), ``ready`` (``port``).
    kind: str
    content: dict[str, Any]  # JSON object
    arrays: Mapping[str, NDArray[Any]] = {}  # numbers


def packed(message: PipeMessage) -> bytes:
    """Bytes of a message."""
    arrays = {name: np.ascontiguousarray(values) for name, values in message.arrays.items()}
    layout = {name: (values.dtype.str, values.shape) for name, values in arrays.items()}
    head = json.dumps([message.kind, message.content, layout], allow_nan=False).encode()
    body = b"".join(values.tobytes() for values in arrays.values())
    return _HEAD.pack(len(head), len(body)) + head + body


class MessageUnpacker:
    """Makes messages of the bytes of the pipe, however they were cut."""

    def __init__(self) -> None:
        self._pending = bytearray()

    def feed(self, data: bytes) -> Iterator[PipeMessage]:
        """Take bytes, and yield the messages that they complete."""
        self._pending += data
        while len(self._pending) >= _HEAD.size:
            head, body = _HEAD.unpack_from(self._pending)
            if head + body > _MOST:
                raise ValueError(f"a message of {head + body} bytes on the pipe: it is out of step.")
            length = _HEAD.size + head + body
            if len(self._pending) < length:
                return
            content = bytes(self._pending[_HEAD.size : length])
            del self._pending[:length]
            yield _message(content[:head], content[head:])


def _message(head: bytes, body: bytes) -> PipeMessage:
    kind, content, layout = json.loads(head)
    arrays, at = dict[str, NDArray[Any]](), 0
    for name, (dtype, shape) in layout.items():
        size = int(np.prod(shape))
        arrays[name] = np.frombuffer(body, dtype=dtype, count=size, offset=at).reshape(shape)
        at += size * np.dtype(dtype).itemsize
    return PipeMessage(kind, content, arrays)


class PipeWriter:
    """Writes into a pipe, whose end it makes non-blocking, without ever waiting."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end
        self._waiting: deque[bytes] = deque()
        self.waiting = 0  # bytes that wait for the reader
        self.skipped = 0  # messages that were dropped, for the reader was too slow
        self.broken = False  # whether the reader is gone

    def write(self, message: PipeMessage, *, must: bool = False) -> None:
        """Send a message, or keep it until there is room; dropped where too much waits, unless it `must` arrive."""
        if self.waiting > LIMIT and not must:
            self.skipped += 1
        else:
            data = packed(message)
            self._waiting.append(data)
            self.waiting += len(data)
        self.flush()

    def flush(self) -> None:
        """Send what fits."""
        while self._waiting and not self.broken:
            data = self._waiting.popleft()
            try:
                sent = self._end.send(data)
            except BlockingIOError:
                sent = 0
            except OSError:
                self.broken = True
                return
            self.waiting -= sent
            if sent < len(data):
                self._waiting.appendleft(data[sent:])
                return
