"""Rows of the charts: fewer where there are too many to draw, the last minute of them, and how they are sent."""

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.viewer.messages import HISTORY, TICK, as_json

PER_SECOND: Final = 120
"""Rows of a second at most, two for each group of samples."""
SECONDS: Final = 60
"""How far the history goes back."""
CHUNK: Final = 128 << 10
"""Bytes of a part of the history, about: a client that does not read has no more of it in memory."""

_HEAD: Final = struct.Struct("<6I")
_ALIGNED: Final = 8


class Rows(NamedTuple):
    """Rows of the charts."""

    t: Floats  # (N,), time, s
    flags: NDArray[np.uint32]  # (N,), flags
    values: Floats  # (N, M), values of the columns

    @classmethod
    def none(cls, width: int) -> "Rows":
        """No rows of so many columns."""
        return cls(np.zeros(0), np.zeros(0, dtype=np.uint32), np.zeros((0, width)))

    def joined(self, later: "Rows") -> "Rows":
        """These rows and later ones."""
        if not len(self.t):
            return later
        return Rows(
            np.concatenate((self.t, later.t)),
            np.concatenate((self.flags, later.flags)),
            np.concatenate((self.values, later.values)),
        )

    def some(self, first: int, stop: int | None = None) -> "Rows":
        """Rows from one place to another."""
        return Rows(self.t[first:stop], self.flags[first:stop], self.values[first:stop])


def envelope(rows: Rows) -> Rows:
    """Two rows that hold each column's smallest and largest value, in the order in which these came.

    Their times are the group's first and last; both have the flags of all samples. A column of one value has it twice.
    Up to two rows stay as they are.
    """
    if len(rows.t) <= 2:
        return rows
    values = rows.values
    absent = np.isnan(values)
    low, high = np.where(absent, np.inf, values).argmin(axis=0), np.where(absent, -np.inf, values).argmax(axis=0)
    places = np.stack((np.minimum(low, high), np.maximum(low, high)))
    flags = np.full(2, np.bitwise_or.reduce(rows.flags), dtype=np.uint32)
    return Rows(rows.t[[0, -1]], flags, np.take_along_axis(values, places, axis=0))


class Thinner:
    """Makes at most `PER_SECOND` rows a second of samples, as they come.

    Samples are grouped by their time, so that it does not matter how the stream was cut. A group waits until it is
    whole; where samples come so seldom that none must go, nothing waits.
    """

    def __init__(self, width: int) -> None:
        self._waiting = Rows.none(width)

    def take(self, rows: Rows, *, rate: float, speed: float = 1.0) -> Rows:
        """Take samples, and return the rows that are complete.

        Parameters
        ----------
        rows : Rows
            The next samples.
        rate : float
            Samples per second of the stream's time.
        speed : float
            How fast a recording is played.
        """
        if rate * speed <= PER_SECOND:
            return self.rest().joined(rows)
        pending = self._waiting.joined(rows)
        groups = np.floor(pending.t * (PER_SECOND / 2 / speed))
        starts = np.flatnonzero(np.diff(groups)) + 1
        done = Rows.none(pending.values.shape[1])
        first = 0
        for stop in starts.tolist():
            done, first = done.joined(envelope(pending.some(first, stop))), stop
        self._waiting = pending.some(first)
        return done

    def rest(self) -> Rows:
        """Rows of the group that is not whole yet, of which nothing more is expected."""
        rows, self._waiting = envelope(self._waiting), Rows.none(self._waiting.values.shape[1])
        return rows


class History:
    """The last minute of rows, by the number of a row since the start.

    Attributes
    ----------
    end : int
        Number of the row that comes next.
    keys : tuple of str
        Columns.
    """

    def __init__(self, keys: Sequence[str]) -> None:
        self.keys = tuple(keys)
        self._room = PER_SECOND * SECONDS
        self._t = np.zeros(self._room)
        self._flags = np.zeros(self._room, dtype=np.uint32)
        self._values = np.zeros((len(keys), self._room), dtype=np.float32)
        self.end = self._floor = 0

    def add(self, rows: Rows) -> None:
        """Take the next rows."""
        rows = rows.some(max(0, len(rows.t) - self._room))
        places = np.arange(self.end, self.end + len(rows.t)) % self._room
        self._t[places], self._flags[places] = rows.t, rows.flags
        with np.errstate(over="ignore"):
            self._values[:, places] = rows.values.T
        self.end += len(rows.t)

    def forget(self) -> None:
        """Have no rows any more."""
        self._floor = self.end

    @property
    def first(self) -> int:
        """Number of the oldest row that is of the last minute."""
        oldest = max(self._floor, self.end - self._room)
        if oldest == self.end:
            return oldest
        t = self._t[np.arange(oldest, self.end) % self._room]
        return oldest + int(np.searchsorted(t, t[-1] - SECONDS))

    def chunk(self, start: int, epoch: int) -> tuple[bytes, int]:
        """Message of some rows from one on, which may be none, and the number of the row behind them."""
        stop = min(self.end, start + max(1, CHUNK // (12 + 4 * len(self.keys))))
        places = np.arange(start, stop) % self._room
        return binary(HISTORY, None, self._t[places], self._flags[places], self._values[:, places], epoch), stop

    def with_columns(self, keys: Sequence[str]) -> "History":
        """The same rows with other columns: NaN where one is new."""
        other = History(keys)
        other._t, other._flags, other.end, other._floor = self._t, self._flags, self.end, self._floor
        other._values.fill(np.nan)
        columns = {key: i for i, key in enumerate(self.keys)}
        for i, key in enumerate(keys):
            if key in columns:
                other._values[i] = self._values[columns[key]]
        return other


def tick(state: Mapping[str, Any], rows: Rows, epoch: int) -> bytes:
    """Message of a state and the rows since the last one."""
    with np.errstate(over="ignore"):
        values = rows.values.T.astype(np.float32)
    return binary(TICK, state, rows.t, rows.flags, values, epoch)


def binary(
    kind: int,
    state: Mapping[str, Any] | None,
    t: Floats,
    flags: NDArray[np.uint32],
    values: NDArray[np.float32],
    epoch: int,
) -> bytes:
    """Binary message as `plumbob.viewer.messages` lays it out; values are (M, N)."""
    text = b"" if state is None else as_json(state).encode()
    text += b" " * (-len(text) % _ALIGNED)
    head = _HEAD.pack(kind, len(text), len(t), len(values), epoch, 0)
    parts = (t.astype("<f8", copy=False), flags.astype("<u4", copy=False), values.astype("<f4", copy=False))
    return b"".join((head, text, *(part.tobytes() for part in parts)))
