"""Whose file is this: a part of which recording, another program's MCAP, or none."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from plumbob.core.errors import DecodeError
from plumbob.files.mcap import layout
from plumbob.files.mcap.info import PartInfo
from plumbob.files.mcap.resync import Source, next_landmark
from plumbob.files.mcap.scan import Scan

_OWN: Final = b"plumbob "


@dataclass(frozen=True, slots=True)
class Identity:
    """Whose file it is.

    Attributes
    ----------
    recording : str or None
        Name of the recording; empty where a file of ours is too damaged to tell; None in files of other programs.
    info : PartInfo or None
        What the part says about itself, at its end or at its beginning.
    """

    path: Path
    recording: str | None
    info: PartInfo | None = None


def identify(path: Path) -> Identity:
    """Whose file this is.

    Raises
    ------
    DecodeError
        If it cannot be read, or holds no MCAP.
    """
    with Source(path) as source:
        magic = source.at(0, len(layout.MAGIC))
        if len(magic) < len(layout.MAGIC) and layout.MAGIC.startswith(magic):
            return Identity(path, "")
        info = _info_at_start(source)
        if info is not None:
            return Identity(path, info.recording, info)
        if magic == layout.MAGIC and _is_foreign(source):
            return Identity(path, None)
        recording = _recording_of_chunks(source)
        if recording is None and magic != layout.MAGIC:
            raise DecodeError(
                f"{path} is not an MCAP file: it begins with {magic!r}, not with {layout.MAGIC!r}, and holds no whole "
                "chunk of a recording."
            )
        if recording == "":  # chunks of another program, whose header is damaged
            return Identity(path, None)
        return Identity(path, recording or "", _info_anywhere(source, recording or ""))


def _header(source: Source) -> tuple[bytes, int]:
    """First bytes of the library's name, and the offset behind the header record."""
    at = len(layout.MAGIC)
    head = source.at(at, layout.RECORD_HEAD.size + 8)
    if len(head) < layout.RECORD_HEAD.size + 8:
        return b"", source.size
    opcode, length = layout.RECORD_HEAD.unpack_from(head)
    body = source.at(at + layout.RECORD_HEAD.size, min(length, 1 << 16))
    profile = int.from_bytes(body[:4], "little")
    known = opcode == layout.HEADER and length == len(body)
    return body[profile + 8 : profile + 8 + len(_OWN)] if known else b"", at + layout.RECORD_HEAD.size + length


def _is_foreign(source: Source) -> bool:
    """Whether the header names another program; ours with a damaged letter or two is still ours."""
    library, _ = _header(source)
    alike = sum(a == b for a, b in zip(library, _OWN, strict=False))
    whole = len(library) == len(_OWN) or source.size > len(layout.MAGIC) + 64
    return bool(library) and whole and alike < len(_OWN) - 2


def _info_at_start(source: Source) -> PartInfo | None:
    _, at = _header(source)
    head = source.at(at, layout.RECORD_HEAD.size)
    if len(head) < layout.RECORD_HEAD.size:
        return None
    opcode, length = layout.RECORD_HEAD.unpack(head)
    if opcode != layout.METADATA or at + layout.RECORD_HEAD.size + length > source.size:
        return None
    return PartInfo.parse(source.at(at + layout.RECORD_HEAD.size, length))


def _recording_of_chunks(source: Source) -> str | None:
    """Name of the recording in the first whole chunk."""
    scan = Scan(source, "")
    at, summary = next_landmark(source, 0, scan.is_chunk, checked=True)
    return None if at == source.size or summary is not None else scan.recording_at(at)


def _info_anywhere(source: Source, recording: str) -> PartInfo | None:
    """What the part says at its end, where its beginning is damaged."""
    scan = Scan(source, recording)
    for _ in scan.items():
        continue
    return scan.info
