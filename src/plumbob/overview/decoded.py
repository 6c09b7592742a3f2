"""Samples of a recorded stream, decoded to a file part by part."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from plumbob.core.errors import DecodeError
from plumbob.core.findings import warning
from plumbob.data import ImuData
from plumbob.data.recording import Recording, inferred
from plumbob.files import read
from plumbob.files.mcap import Log
from plumbob.files.parquet import write_parquet
from plumbob.live.recorded import decoded_note
from plumbob.live.session import Session
from plumbob.live.sources import ReplaySource
from plumbob.live.stream import ItemResult, Stream

_WAIT = 0.02


def decoded_to(file: Path, log: Log, session: Session) -> Recording:
    """Decode a recording of a line to a native file, and open that; no more than a part of it is in memory.

    Parameters
    ----------
    file : Path
        The native file, which must stay as long as the result is used.
    log : Log
        The recording.
    session : Session
        What its bytes mean; of one unit.

    Raises
    ------
    DecodeError
        If no sample could be decoded.
    """
    stream = Stream(replace(session, stage=None))
    write_parquet(file, _samples(stream, log))
    damage = (warning("reading.damaged", damage=str(damage)) for damage in log.damage)
    recording = read(file, whole=False)
    notes = (decoded_note(stream), *damage, *inferred(stream.time_report()), *recording.notes)
    return replace(recording, notes=notes)


def _samples(stream: Stream, log: Log) -> Iterator[Recording]:
    info = log.first_info
    offset = 0 if info is None else info.epoch_offset_ns
    first = None
    for part in _parts(stream, log):
        if not len(part.sensed):
            continue
        if first is None:
            first = (0 if stream.t0_ns is None else stream.t0_ns) + offset
        yield Recording(imu=_stamped(part.sensed, first))
    if first is None:
        raise DecodeError(f"{log.paths[0]} holds no sample that could be decoded; 'plumbob verify' says what is in it.")


def _stamped(imu: ImuData, t0_ns: int) -> ImuData:
    return imu.corrected(meta=replace(imu.meta, t0_ns=t0_ns))


def _parts(stream: Stream, log: Log) -> Iterator[ItemResult]:
    source = ReplaySource(log, None)
    try:
        while not source.finished:
            for item in source.read(_WAIT):
                part = stream.feed(item)
                if part is not None:
                    yield part
        rest = stream.finish()
        if rest is not None:
            yield rest
    finally:
        source.close()
