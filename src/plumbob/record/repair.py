"""Write what is whole of a damaged recording to a new file that is complete."""

import secrets
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from plumbob.errors import DecodeError, ParameterError
from plumbob.record import disk
from plumbob.record.channels import Channel
from plumbob.record.chunk import OpenChunk, compressor, pack
from plumbob.record.info import PartInfo
from plumbob.record.log import Log, LogMessage, open_log
from plumbob.record.part import Part
from plumbob.record.verdict import Verdict


def repair(path: str | PathLike[str] | Sequence[str | PathLike[str]], out: str | PathLike[str]) -> Verdict:
    """Write every whole row of a recording to one new file with index and end; repairing that gives the same bytes.

    Rows that are missing stay missing: their sequence numbers are left out, and the file says how many there were.

    Parameters
    ----------
    path : path or sequence of path
        As in `open_log`.
    out : path
        The new file, which must not exist.

    Returns
    -------
    Verdict
        Of what was read.

    Raises
    ------
    ParameterError
        If `out` exists, or the recording is another program's or is still being written.
    DecodeError
        If the recording cannot be opened or `out` cannot be written; then there is no new file.
    """
    target = Path(out)
    if target.exists():
        raise ParameterError(f"{target} exists already, and a repair never overwrites; name another file.")
    log = open_log(path)
    _refuse(log)
    verdict = Verdict(log.paths, log.recording)
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    try:
        _rewrite(log, temporary, verdict)
        if target.exists():
            raise ParameterError(f"{target} has come into being meanwhile; name another file.")
        temporary.rename(target)
        disk.sync_folder(target.parent)
    except OSError as error:
        raise DecodeError(f"{target} cannot be written: {error.strerror}.") from error
    finally:
        temporary.unlink(missing_ok=True)
    return verdict


def _refuse(log: Log) -> None:
    if log.recording is None:
        raise ParameterError(
            f"{log.paths[0]} was written by another program, so nobody here knows what is missing; use 'mcap recover'."
        )
    for file in log.paths:
        if disk.is_locked(file):
            raise ParameterError(f"{file} is still being recorded; stop the recorder first.")


def _rewrite(log: Log, target: Path, verdict: Verdict) -> None:
    known = log.first_info
    recording = log.recording or "0" * 32
    first = PartInfo(
        recording,
        1 if known is None else known.part,
        0 if known is None else known.epoch_offset_ns,
        {} if known is None else known.starts,
        metadata=log.metadata,
        follows=None if known is None else known.follows,
        boot="" if known is None else known.boot,
    )
    part, numbers = Part(target, first), _Numbers()
    compression, compress = compressor("zstd")
    part.begin()
    try:
        for rows in log.blocks():
            verdict.count(rows)
            chunk = _chunk(rows, numbers)
            part.write(chunk, pack(chunk, compression, compress))
        verdict.conclude(log)
        part.finish(dict(numbers.records), log.ends, log.missing)
        part.sync()
    finally:
        part.close(keep=True)


class _Numbers:
    """Numbers of channels in the new file, by topic, in the order in which they come."""

    def __init__(self) -> None:
        self.records: dict[int, tuple[bytes, bytes]] = {}
        self._numbers: dict[str, int] = {}

    def of(self, channel: Channel) -> int:
        number = self._numbers.setdefault(channel.topic, len(self._numbers) + 1)
        if number not in self.records:
            self.records[number] = channel.records(number)
        return number


def _chunk(rows: list[LogMessage], numbers: _Numbers) -> OpenChunk:
    chunk = OpenChunk(rows[0].t_ns)
    for row in rows:
        number = numbers.of(row.channel)
        if number not in chunk.entries:
            chunk.introduce(number, row.sequence, numbers.records[number])
        chunk.add(number, row.sequence, row.t_ns + row.channel.epoch_offset_ns, row.data)
    return chunk
