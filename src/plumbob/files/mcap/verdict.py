"""Judge a recording: whether every row is there; and write what is whole of a damaged one to a new file."""

import os
import secrets
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, Final

from plumbob.core.errors import ParameterError
from plumbob.core.files import replacing, require_other, require_place
from plumbob.core.text import FactsText, counted, visible
from plumbob.files.mcap.layout import TIMES, Channel, ChannelRecords, OpenChunk, PartInfo, Schema
from plumbob.files.mcap.log import Log, LogMessage, open_log
from plumbob.files.mcap.scan import Damage
from plumbob.files.mcap.writer import RecordingPart, is_locked

CHUNK_NS: Final = 10**9  # longest time of a chunk, ns: what a damaged place costs at most


@contextmanager
def whole_part(file: Path, info: PartInfo) -> Iterator[RecordingPart]:
    """Give the only part of a recording, to be finished, in an empty file as `replacing` gives it."""
    part = RecordingPart(file, info, create=lambda there: os.open(there, os.O_RDWR))
    part.begin()
    try:
        yield part
    finally:
        part.close(keep=True)


def write_rows(
    path: str | PathLike[str],
    topics: Mapping[str, tuple[str, Schema | None]],
    rows: Iterable[tuple[int, str, bytes]],
    *,
    epoch_offset_ns: int,
    metadata: Mapping[str, str],
    overwrite: bool = False,
) -> None:
    """Write a complete recording in one file: rows of time, ns, topic and content, in the order of time."""
    info = PartInfo(secrets.token_hex(16), 1, epoch_offset_ns, metadata=metadata)
    channels = {
        topic: Channel(topic, encoding, schema, {}, info.recording, epoch_offset_ns).declared(number)
        for number, (topic, (encoding, schema)) in enumerate(topics.items(), 1)
    }
    target = replacing(Path(path), overwrite=overwrite, seeks=True)
    with target as temporary, whole_part(temporary, info) as part:
        ends, chunk = dict.fromkeys(topics, 0), None  # rows of each topic
        for t_ns, topic, data in rows:
            if not 0 <= t_ns + epoch_offset_ns < TIMES:
                raise ParameterError(f"a time of {t_ns / 1e9:g} s cannot be stored in MCAP, which counts from 1970.")
            if chunk is not None and chunk.is_due(t_ns, CHUNK_NS):
                part.write(chunk)
                chunk = None
            chunk = chunk or OpenChunk(t_ns)
            chunk.add(channels[topic], ends[topic], t_ns + epoch_offset_ns, data)
            ends[topic] += 1
        if chunk is not None:
            part.write(chunk)
        part.finish(ends, {})


@dataclass(repr=False)
class Verdict(FactsText):
    """What a recording holds and what it lacks."""

    paths: tuple[Path, ...]  # its files
    recording: str  # name of the recording
    rows: dict[str, int] = field(default_factory=dict)  # whole rows per topic
    lost: dict[str, int] = field(default_factory=dict)  # rows per topic that are missing through damage
    dropped: dict[str, int] = field(default_factory=dict)  # and because the recorder had to give them up
    damage: list[Damage] = field(default_factory=list)  # what is wrong with the files
    clean: bool = True  # whether every part has its end, which a crash does not leave
    open: bool = False  # whether a recorder still writes it
    first_ns: int | None = None  # earliest time of a row
    last_ns: int | None = None  # and latest

    def facts(self) -> Mapping[str, str]:
        """Files, rows, and whether it is whole."""
        rows = str(sum(self.rows.values()))
        return {"files": ", ".join(path.name for path in self.paths), "rows": rows, "verdict": self.in_words}

    def text(self) -> str:
        """What the recording holds and lacks, line by line."""
        lines = [f"{self.facts()['files']}: {counted(sum(self.rows.values()), 'row')} in {self.duration:.3f} s"]
        lines += [f"rows         {visible(topic)}: {count}" for topic, count in self.rows.items()]
        lines += [f"damage       {visible(str(damage))}" for damage in self.damage]
        end = "properly" if self.clean else "NOT properly: a part has no end, or a damaged one, as after a crash"
        lines.append(f"ended        {'not yet: it is being recorded' if self.open else end}")
        given_up = ("dropped", self.dropped, "given up while recording, or lost before a repair")
        for title, rows_of, how in (given_up, ("lost", self.lost, "missing")):
            lines += [f"{title:12} {visible(topic)}: {counted(count, 'row')} {how}" for topic, count in rows_of.items()]
        return "\n".join([*lines, f"verdict      {self.in_words}"])

    @property
    def in_words(self) -> str:
        """What it comes to."""
        if self.whole:
            return "whole"
        if self.lossy:
            return "damaged: rows are missing, or may be"
        if not sum(self.rows.values()):
            return "not complete, and no row is in it"
        return "not complete, but no row that had been written is missing"

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
        self.rows = dict(Counter(self.rows) + Counter(row.topic for row in rows))
        times = [row.t_ns for row in rows]
        self.first_ns = min(times if self.first_ns is None else [self.first_ns, *times])
        self.last_ns = max(times if self.last_ns is None else [self.last_ns, *times])

    def conclude(self, log: Log) -> None:
        """Take over what a log knows once all of it has been read."""
        self.lost, self.dropped, self.damage = log.lost, dict(log.dropped), list(log.damage)
        self.clean = log.clean

    def summary(self) -> dict[str, Any]:
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
            "damage": [
                {"file": d.path.name, "offset": d.offset, "bytes": d.size, "what": d.what, "lost": dict(d.lost),
                 "certain": d.certain} for d in self.damage
            ],
        }  # fmt: skip


def verify(path: str | PathLike[str] | Sequence[str | PathLike[str]]) -> Verdict:
    """Read a recording from the first byte to the last and judge it; errors are those of `open_log`.

    Parameters
    ----------
    path : path or sequence of path
        The recording, or some of its parts.
    """
    log = open_log(path)
    verdict = Verdict(log.paths, log.recording, open=any(is_locked(file) for file in log.paths))
    for rows in log.blocks():
        verdict.count(rows)
    verdict.conclude(log)
    return verdict


def repair(
    path: str | PathLike[str] | Sequence[str | PathLike[str]], out: str | PathLike[str], *, overwrite: bool = False
) -> Verdict:
    """Write every whole row of a recording to one new file with index and end; repairing that gives the same bytes.

    Rows that are missing stay missing: their sequence numbers are left out, and the file says how many there were.

    Parameters
    ----------
    path : path or sequence of path
        As in `open_log`.
    out : path
        The new file, which appears whole or not at all.
    overwrite : bool
        Whether a file that lies there, and is not of the recording, may be replaced.

    Returns
    -------
    Verdict
        Of what was read.

    Raises
    ------
    ParameterError
        If `out` exists and is not to be replaced, or the recording is still being written.
    DecodeError
        If the recording cannot be opened or `out` cannot be written; then there is no new file.
    """
    target = Path(out)
    require_place(target, overwrite=overwrite)
    log = open_log(path)
    require_other(target, log.paths)
    for file in filter(is_locked, log.paths):
        raise ParameterError(f"{file} is still being recorded; stop the recorder first.")
    verdict = Verdict(log.paths, log.recording)
    with replacing(target, overwrite=overwrite, seeks=True) as temporary:
        _rewrite(log, temporary, verdict)
    return verdict


def _rewrite(log: Log, target: Path, verdict: Verdict) -> None:
    info, recording = log.first_info, log.recording or "0" * 32
    first = PartInfo(recording, 1, 0, metadata=log.metadata)
    if info is not None:
        first = replace(info, recording=recording, ends=None, dropped={}, metadata=log.metadata)
    channels: dict[str, ChannelRecords] = {}
    with whole_part(target, first) as part:
        for rows in log.blocks():
            verdict.count(rows)
            chunk = OpenChunk(rows[0].t_ns)
            for row in rows:
                if row.topic not in channels:
                    channels[row.topic] = row.channel.declared(len(channels) + 1)
                chunk.add(channels[row.topic], row.sequence, row.t_ns + row.channel.epoch_offset_ns, row.data)
            part.write(chunk)
        verdict.conclude(log)
        part.finish(log.ends, log.missing)
