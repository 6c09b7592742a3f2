"""Go through a recording again: the same line, the same items, the same bits."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from plumbob.errors import DecodeError
from plumbob.pipeline import rows
from plumbob.pipeline.line import Line
from plumbob.pipeline.runner import run_line
from plumbob.pipeline.session import Session
from plumbob.pipeline.session_toml import recorded_session
from plumbob.pipeline.sinks import Collected, Sink
from plumbob.pipeline.sources import ReplaySource
from plumbob.record import Log, open_log


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
        If it is no recording, or was not made by a line.
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
        Attitudes that are in both.
    different : int
        Those of them of which a bit differs, in time, attitude, bias or flags.
    only_live, only_replayed : int
        Attitudes that only one of the two has.
    """

    compared: int
    different: int
    only_live: int
    only_replayed: int

    @property
    def equal(self) -> bool:
        """Whether both are the same, to the bit."""
        return self.compared > 0 and not (self.different or self.only_live or self.only_replayed)


def compare(replayed: Replayed) -> Comparison:
    """Compare a replay with the attitudes that the recording holds, bit for bit.

    Raises
    ------
    DecodeError
        If the recording holds no attitudes.
    """
    log = replayed.log
    live = [rows.shifted(message.data, log.shift_ns) for message in log if message.topic == rows.ATTITUDE]
    if not live:
        raise DecodeError(
            "the recording holds no attitudes to compare with: no filter ran, or no frame could be decoded."
        )
    again = [
        row
        for part in replayed.found.parts
        if part.track is not None
        for row in rows.attitude_rows(part.t_ns.tolist(), part.track)
    ]
    by_time = {json.loads(row)["t_ns"]: row for row in live}
    mine = {json.loads(row)["t_ns"]: row for row in again}
    both = by_time.keys() & mine.keys()
    different = sum(by_time[t] != mine[t] for t in both)
    return Comparison(len(both), different, len(by_time) - len(both), len(mine) - len(both))


def utc_ns(replayed: Replayed) -> int:
    """UTC of the first sample, ns since 1970; 0 where there is none."""
    t_ns = replayed.found.t_ns
    return int(t_ns[0]) + replayed.epoch_offset_ns if t_ns.size else 0
