"""What is drawn: rows of the charts, fewer where there are too many, the last minute of them; angles, after a tare."""

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.units import to_deg
from plumbob.rotations import euler_zyx_from_quat, quat_conjugate, quat_multiply
from plumbob.viewer.messages import HISTORY, TICK, as_json

PER_SECOND: Final = 120  # Rows of a second at most, two for each group of samples
SECONDS: Final = 60  # How far the history goes back
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
        pairs: Any = zip(self, later, strict=True)
        return Rows(*map(np.concatenate, pairs))

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
        """Rows that samples complete, at `rate` per second of their time, which is played `speed` times as fast."""
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


class RowHistory:
    """The last minute of rows, by the number of a row since the start."""

    def __init__(self, keys: Sequence[str]) -> None:
        self.keys = tuple(keys)
        self._room = PER_SECOND * SECONDS
        self._t = np.zeros(self._room)
        self._flags = np.zeros(self._room, dtype=np.uint32)
        self._values = np.zeros((len(keys), self._room), dtype=np.float32)
        self.end = self._floor = 0  # number of the row that comes next

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

    def with_columns(self, keys: Sequence[str]) -> "RowHistory":
        """The same rows with other columns: NaN where one is new."""
        other = RowHistory(keys)
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
    kind: int, state: Mapping[str, Any] | None, t: Floats, flags: NDArray[np.uint32], values: NDArray[np.float32],
    epoch: int,
) -> bytes:  # fmt: skip
    """Binary message as `plumbob.viewer.messages` lays it out; values are (M, N)."""
    text = b"" if state is None else as_json(state).encode()
    text += b" " * (-len(text) % _ALIGNED)
    head = _HEAD.pack(kind, len(text), len(t), len(values), epoch, 0)
    parts = (t.astype("<f8", copy=False), flags.astype("<u4", copy=False), values.astype("<f4", copy=False))
    return b"".join((head, text, *(part.tobytes() for part in parts)))


def euler_deg(q_nb: Floats) -> Floats:
    """Roll, pitch and yaw (N, 3), degrees, of attitudes (N, 4), as every report of Plumbob prints them."""
    return to_deg(euler_zyx_from_quat(q_nb))[..., ::-1]


class Tare:
    """The attitude that shows as zero roll, pitch and yaw.

    Angles then turn the body's axes at the tare into its axes now: a turn about the body's x axis is roll, in whichever
    attitude it was tared. All estimators count from the primary one's attitude, so what they differ by stays in sight.
    The attitudes themselves, the errors, the charts and what is recorded are not changed.
    """

    def __init__(self) -> None:
        self._inverse: Floats | None = None

    @property
    def is_set(self) -> bool:
        """Whether angles count from a tare."""
        return self._inverse is not None

    def set(self, q_nb: Any) -> None:
        """Count from an attitude (4,)."""
        self._inverse = quat_conjugate(np.asarray(q_nb, dtype=np.float64))

    def clear(self) -> None:
        """Count from the navigation frame again."""
        self._inverse = None

    def applied(self, q_nb: Floats) -> Floats:
        """Attitudes (N, 4) or (4,) as they are shown."""
        return q_nb if self._inverse is None else quat_multiply(self._inverse, q_nb)


def shown_attitudes(estimates: Mapping[str, Any], tare: Tare, hello: Mapping[str, Any]) -> dict[str, Any]:
    """Attitudes of a batch as `messages.Attitude`, by estimator."""
    if not estimates:
        return {}
    q_nb = np.array([estimate["q_nb"] for estimate in estimates.values()], dtype=np.float64)
    angles = euler_deg(tare.applied(q_nb))
    is_heading = hello.get("frame") == "NED" and hello.get("north") in ("true", "magnetic")  # clockwise from a north
    if is_heading and not tare.is_set:
        angles[:, 2] %= 360.0
    return {
        name: {"roll": roll, "pitch": pitch, "yaw": yaw, "sd": None, "error": None} | estimate
        for (name, estimate), (roll, pitch, yaw) in zip(estimates.items(), angles.tolist(), strict=True)
    }
