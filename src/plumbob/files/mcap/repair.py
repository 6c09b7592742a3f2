"""Write what is whole of a damaged recording to a new file that is complete."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from plumbob.core.errors import ParameterError
from plumbob.core.files import replacing, require_place
from plumbob.files.mcap import disk
from plumbob.files.mcap.chunk import OpenChunk
from plumbob.files.mcap.info import PartInfo
from plumbob.files.mcap.layout import Channel
from plumbob.files.mcap.log import Log, LogMessage, open_log
from plumbob.files.mcap.verdict import Verdict, whole_part


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
        If `out` exists and is not to be replaced, or the recording is another program's or is still being written.
    DecodeError
        If the recording cannot be opened or `out` cannot be written; then there is no new file.
    """
    target = Path(out)
    require_place(target, overwrite=overwrite)
    log = open_log(path)
    _refuse(log, target)
    verdict = Verdict(log.paths, log.recording)
    with replacing(target, overwrite=overwrite, seeks=True) as temporary:
        _rewrite(log, temporary, verdict)
    return verdict


def _refuse(log: Log, target: Path) -> None:
    if any(target.exists() and target.samefile(file) for file in log.paths):
        raise ParameterError(f"{target} is an input; writing there would destroy it. Name another file.")
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
    numbers = _Numbers()
    with whole_part(target, first) as (part, write):
        for rows in log.blocks():
            verdict.count(rows)
            write(_chunk(rows, numbers))
        verdict.conclude(log)
        part.finish(dict(numbers.records), log.ends, log.missing)


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
