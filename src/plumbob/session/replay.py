"""Go through a recording again: the same line, the same items, the same bits."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from plumbob.acquisition.transport import Event
from plumbob.core.errors import DecodeError
from plumbob.files.mcap import Log, open_log
from plumbob.session import rows
from plumbob.session.runner import run_line
from plumbob.session.session import Session
from plumbob.session.session_toml import recorded_session
from plumbob.session.sinks import Collected, Sink
from plumbob.session.sources import ReplaySource
from plumbob.session.stream import Line, Part


@dataclass(frozen=True, eq=False, slots=True)
class Replayed:
    """What a recording gave when it went through the line again.

    Attributes
    ----------
    line : Line
        The line, with its counts.
    found : Collected
        All parts and events.
    log : Log
        The recording, read to its end: `log.damage` says what is wrong with it.
    epoch_offset_ns : int
        UTC minus the monotonic clock at the start of the recording, ns.
    """

    line: Line
    found: Collected
    log: Log
    epoch_offset_ns: int


def open_recording(path: str | Path) -> tuple[Log, Session]:
    """Open a recording of a line, and the session that it holds.

    Raises
    ------
    DecodeError
        If it is not a recording, or was not made by a line.
    """
    log = open_log(Path(path))
    return log, recorded_session(log.metadata, Path(path).stem)


def replay(log: Log, session: Session, *, sinks: Sequence[Sink] = (), speed: float | None = None) -> Replayed:
    """Send a recording's reads and events through a line.

    Parameters
    ----------
    log : Log
        The recording.
    session : Session
        Its own session, or another for the same bytes: another filter, another card.
    sinks : sequence of Sink
        Who else takes the parts.
    speed : float, optional
        How many times faster than it was; as fast as it goes where None.
    """
    line, found = Line(session), Collected()
    run_line(line, ReplaySource(log, speed), sinks=[found, *sinks])
    info = log.first_info
    return Replayed(line, found, log, 0 if info is None else info.epoch_offset_ns)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Replay against what was recorded live.

    Attributes
    ----------
    compared : int
        Attitudes that both have at the same place in time.
    different : int
        Those of them of which a bit differs, in attitude, bias or flags.
    only_live, only_replayed : int
        Attitudes that only one of the two has at that place.
    """

    compared: int
    different: int
    only_live: int
    only_replayed: int

    @property
    def equal(self) -> bool:
        """Whether both are the same, to the bit."""
        return self.compared > 0 and not (self.different or self.only_live or self.only_replayed)


class Check:
    """Sink that compares attitudes, as they come, with those that a recording holds: row by row, bit for bit.

    Both are read in their order, and of each no more than a chunk is held. Where two rows differ in time, the earlier
    one is left over.

    Parameters
    ----------
    log : Log
        The recording.

    Raises
    ------
    DecodeError
        If it holds no attitudes.
    """

    def __init__(self, log: Log) -> None:
        again = log.again()
        self._live = (rows.shifted(one.data, again.shift_ns) for one in again if one.topic == rows.ATTITUDE)
        self._next = next(self._live, None)
        self._compared = self._different = self._only_live = self._only_replayed = 0
        if self._next is None:
            raise DecodeError(
                "the recording holds no attitudes to compare with: no filter ran, or no frame could be decoded."
            )

    def on_part(self, part: Part) -> None:
        """Compare its attitudes with the next ones of the recording."""
        if part.track is not None:
            for row in rows.attitude_rows(part.t_ns.tolist(), part.track):
                self._take(row)

    def on_event(self, event: Event) -> None:
        """No attitude comes with it."""

    def close(self) -> None:
        """Count what the recording holds beyond the last attitude."""
        if self._next is not None:
            self._only_live += 1 + sum(1 for _ in self._live)
            self._next = None

    @property
    def comparison(self) -> Comparison:
        """What was found so far."""
        return Comparison(self._compared, self._different, self._only_live, self._only_replayed)

    def _take(self, row: bytes) -> None:
        while (ahead := self._ahead(row)) < 0:
            self._only_live += 1
            self._next = next(self._live, None)
        if ahead > 0:
            self._only_replayed += 1
            return
        self._compared += 1
        self._different += self._next != row
        self._next = next(self._live, None)

    def _ahead(self, row: bytes) -> int:
        """By how much the recording's next row is later than another; it is after its end, too."""
        if self._next is None:
            return 1
        return 0 if self._next == row else rows.time_of(self._next) - rows.time_of(row)


def compare(replayed: Replayed) -> Comparison:
    """Compare a replay with the attitudes that the recording holds, in their order, bit for bit.

    Raises
    ------
    DecodeError
        If the recording holds no attitudes.
    """
    check = Check(replayed.log)
    for part in replayed.found.parts:
        check.on_part(part)
    check.close()
    return check.comparison


def utc_ns(replayed: Replayed) -> int:
    """UTC of the first sample, ns since 1970; 0 where there is none."""
    t_ns = replayed.found.t_ns
    return int(t_ns[0]) + replayed.epoch_offset_ns if t_ns.size else 0
