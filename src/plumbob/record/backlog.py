"""Chunks that wait for the disk, bounded by their bytes."""

import threading
from collections import deque

from plumbob.record.chunk import OpenChunk


class Backlog:
    """A queue between the recorder's caller, who never waits, and the thread that writes.

    Parameters
    ----------
    limit : int
        Bytes that may wait.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._chunks: deque[OpenChunk] = deque()
        self._bytes = 0
        self._changed = threading.Condition()
        self._closing = False

    @property
    def closing(self) -> bool:
        """Whether nothing more will come."""
        return self._closing

    def put(self, chunk: OpenChunk) -> bool:
        """Append a chunk; False, and nothing is done, where there is no room or it is closed."""
        with self._changed:
            if self._closing or self._bytes + chunk.size > self._limit:
                return False
            self._chunks.append(chunk)
            self._bytes += chunk.size
            self._changed.notify()
        return True

    def head(self, timeout: float) -> OpenChunk | None:
        """Oldest chunk, which stays; wait at most `timeout` s for one."""
        with self._changed:
            if not self._chunks and not self._closing:
                self._changed.wait(timeout)
            return self._chunks[0] if self._chunks else None

    def pause(self, timeout: float) -> None:
        """Wait `timeout` s, or until nothing more will come."""
        with self._changed:
            self._changed.wait_for(lambda: self._closing, timeout)

    def pop(self) -> None:
        """Remove the oldest chunk."""
        with self._changed:
            self._bytes -= self._chunks.popleft().size

    def put_back(self, chunks: list[OpenChunk]) -> None:
        """Put chunks before all others, whatever the limit: they have been taken once."""
        with self._changed:
            self._chunks.extendleft(reversed(chunks))
            self._bytes += sum(chunk.size for chunk in chunks)

    def clear(self) -> list[OpenChunk]:
        """Remove and return everything."""
        with self._changed:
            left = list(self._chunks)
            self._chunks.clear()
            self._bytes = 0
        return left

    def close(self) -> None:
        """Say that nothing more will come."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
