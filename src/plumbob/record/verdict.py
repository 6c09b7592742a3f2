"""Judge a recording: is every row there that was written, and if not, what is missing."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from plumbob.record import disk
from plumbob.record.damage import Damage
from plumbob.record.log import Log, LogMessage, open_log


@dataclass(slots=True)
class Verdict:
    """What a recording holds and what it lacks.

    Attributes
    ----------
    paths : tuple of Path
        Its files.
    recording : str or None
        Name of the recording; None in a file of another program.
    rows : dict of str to int
        Whole rows per topic.
    lost, dropped : dict of str to int
        Rows per topic that are missing: through damage, and because the recorder had to give them up.
    damage : list of Damage
        What is wrong with the files.
    clean : bool
        Whether every part has its end, which a crash does not leave.
    unchecked : int
        Chunks and messages without a CRC, which nobody can check.
    open : bool
        Whether a recorder still writes it.
    first_ns, last_ns : int or None
        Earliest and latest time of a row, ns.
    """

    paths: tuple[Path, ...]
    recording: str | None
    rows: dict[str, int] = field(default_factory=dict)
    lost: dict[str, int] = field(default_factory=dict)
    dropped: dict[str, int] = field(default_factory=dict)
    damage: list[Damage] = field(default_factory=list)
    clean: bool = True
    unchecked: int = 0
    open: bool = False
    first_ns: int | None = None
    last_ns: int | None = None

    @property
    def whole(self) -> bool:
        """Whether the files are complete and undamaged."""
        return self.clean and not self.damage and not self.lost

    @property
    def lossy(self) -> bool:
        """Whether rows that had been written are missing, or may be."""
        return bool(self.lost) or any(not damage.certain for damage in self.damage)

    @property
    def duration(self) -> float:
        """From the earliest to the latest row, s."""
        return 0.0 if self.first_ns is None or self.last_ns is None else (self.last_ns - self.first_ns) / 1e9

    def count(self, rows: list[LogMessage]) -> None:
        """Take in rows that are whole."""
        for row in rows:
            topic = row.channel.topic
            self.rows[topic] = self.rows.get(topic, 0) + 1
        times = [row.t_ns for row in rows]
        self.first_ns = min(times if self.first_ns is None else [self.first_ns, *times])
        self.last_ns = max(times if self.last_ns is None else [self.last_ns, *times])

    def conclude(self, log: Log) -> None:
        """Take over what a log knows once all of it has been read."""
        self.lost, self.dropped, self.damage = log.lost, dict(log.dropped), list(log.damage)
        self.clean, self.unchecked = log.clean, log.unchecked

    def as_dict(self) -> dict[str, Any]:
        """The verdict as JSON has it."""
        return {
            "files": [str(path) for path in self.paths],
            "recording": self.recording,
            "whole": self.whole,
            "clean": self.clean,
            "still_recording": self.open,
            "rows": self.rows,
            "duration_s": self.duration,
            "lost": self.lost,
            "dropped": self.dropped,
            "unchecked": self.unchecked,
            "damage": [
                {
                    "file": damage.path.name,
                    "offset": damage.offset,
                    "bytes": damage.size,
                    "what": damage.what,
                    "lost": dict(damage.lost),
                    "certain": damage.certain,
                }
                for damage in self.damage
            ],
        }


def verify(path: str | PathLike[str] | Sequence[str | PathLike[str]]) -> Verdict:
    """Read a recording from the first byte to the last and judge it; parameters and errors are those of `open_log`."""
    log = open_log(path)
    verdict = Verdict(log.paths, log.recording, open=any(disk.is_locked(file) for file in log.paths))
    for rows in log.blocks():
        verdict.count(rows)
    verdict.conclude(log)
    return verdict
