"""Recordings that are written at once, of rows that are there already: one file, whole or not at all."""

import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Final

from plumbob._files import replacing
from plumbob.errors import ParameterError
from plumbob.record import disk
from plumbob.record.channels import Channel, Schema
from plumbob.record.chunk import CHUNK_BYTES, OpenChunk, compressor, pack
from plumbob.record.info import PartInfo
from plumbob.record.part import Part

CHUNK_NS: Final = 10**9
"""Longest time of a chunk, ns: what a damaged place costs at most."""
_TIMES: Final = 1 << 64


@contextmanager
def whole_part(file: Path, info: PartInfo) -> Iterator[tuple[Part, Callable[[OpenChunk], None]]]:
    """Give the only part of a recording, to be finished, and what writes a chunk to it.

    Parameters
    ----------
    file : Path
        An empty file, as `plumbob._files.replacing` gives it.
    info : PartInfo
        What the part says of itself.
    """
    part = Part(file, info, disk.open_empty)
    compression, compress = compressor("zstd")
    part.begin()
    try:
        yield part, lambda chunk: part.write(chunk, pack(chunk, compression, compress))
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
    """Write a complete recording of rows, in one file.

    Parameters
    ----------
    path : path
        The file.
    topics : mapping
        Encoding and schema of the rows of each topic.
    rows : iterable of (int, str, bytes)
        Time, ns, topic and content, in the order of time.
    epoch_offset_ns : int
        What is added to the times to get UTC, ns.
    metadata : mapping of str to str
        What is said of the whole recording.
    overwrite : bool
        Whether a file that lies there may be replaced.

    Raises
    ------
    ParameterError, DecodeError
        As `plumbob._files.replacing` does; also if a time cannot be stored.
    """
    info = PartInfo(secrets.token_hex(16), 1, epoch_offset_ns, metadata=metadata)
    names = {topic: number for number, topic in enumerate(topics, 1)}
    records = {
        names[topic]: Channel(topic, encoding, schema, {}, info.recording, epoch_offset_ns).records(names[topic])
        for topic, (encoding, schema) in topics.items()
    }
    whole = replacing(Path(path), overwrite=overwrite, seeks=True)
    with whole as temporary, whole_part(temporary, info) as (part, write):
        ends = dict.fromkeys(names, 0)
        for chunk in _chunks(rows, names, records, ends, epoch_offset_ns):
            write(chunk)
        part.finish(records, ends, {})


def _chunks(
    rows: Iterable[tuple[int, str, bytes]],
    names: Mapping[str, int],
    records: Mapping[int, tuple[bytes, bytes]],
    ends: dict[str, int],
    epoch_offset_ns: int,
) -> Iterator[OpenChunk]:
    """Rows in chunks; `ends` counts those of each topic."""
    chunk: OpenChunk | None = None
    for t_ns, topic, data in rows:
        if not 0 <= t_ns + epoch_offset_ns < _TIMES:
            raise ParameterError(f"a time of {t_ns / 1e9:g} s cannot be stored in MCAP, which counts from 1970.")
        if chunk is not None and (t_ns - chunk.t_ns >= CHUNK_NS or chunk.size >= CHUNK_BYTES):
            yield chunk
            chunk = None
        chunk = chunk or OpenChunk(t_ns)
        number = names[topic]
        if number not in chunk.entries:
            chunk.introduce(number, ends[topic], records[number])
        chunk.add(number, ends[topic], t_ns + epoch_offset_ns, data)
        ends[topic] += 1
    if chunk is not None:
        yield chunk
