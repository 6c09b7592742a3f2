"""A recording in several files: the members of a zip archive or of a folder, and the tables of numbers in them.

Nothing is unpacked to the disk, so that a member may have any path. What an archive claims is judged before a byte of
it is unpacked; links in a folder are not followed.
"""

import csv
import os
import struct
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from plumbob.core.errors import DecodeError, PlumbobError, excerpt
from plumbob.core.files import existing_file, require_room
from plumbob.files.arrow import intact
from plumbob.files.foreign.logged import HEAD_BYTES, first_bytes
from plumbob.files.profile import ColumnRef, TextLayout
from plumbob.files.text_table import TextTable, decode, find_head, is_idle, read_table, split_row

MAX_MEMBERS: Final = 1000  # files of an archive or a folder; an app writes a few dozen
MAX_DIRECTORY: Final = 4 << 20  # bytes of the list of members of an archive
MISSING: Final = ("", "NaN", "nan", "null", "N/A")  # in tables of phone apps and vendors' programs
_END: Final = b"PK\x05\x06"
_END_BYTES: Final = 22
_LOCATOR_64: Final = b"PK\x06\x07"
_KNOWN_METHODS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_SEPARATORS: Final = (",", ";", "\t")


class Parts:
    """Files of a recording, a zip archive, a folder (with ``meta``) or one file, by their path inside it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._zipped = not path.is_dir() and zipfile_like(path)
        if self._zipped:
            self._members = _archive_members(path)
            self.names: tuple[str, ...] = tuple(self._members)
        else:
            self.names = tuple(_folder_members(path)) if path.is_dir() else (path.name,)

    def start(self, name: str) -> bytes:
        """First `HEAD_BYTES` of a member."""
        return self._bytes(name, HEAD_BYTES)

    def read(self, name: str) -> bytes:
        """Whole member; one of an archive, whose checksum holds, ends its last line."""
        if not self._zipped:
            return existing_file(self._file(name)).read_bytes()
        info = self._members[name]
        require_room(info.file_size, self.path.stat().st_size)
        raw = self._bytes(name, info.file_size + 1)
        return raw if raw.endswith((b"\n", b"\r")) else raw + b"\n"

    def size(self, name: str) -> int:
        """Bytes that a member has, by its own word."""
        return self._members[name].file_size if self._zipped else self._file(name).stat().st_size

    def text(self, name: str) -> str:
        """Text of a small member, as one of metadata is; other bytes than UTF-8 become question marks."""
        return self._bytes(name, 1 << 20).decode("utf-8-sig", "replace")

    def _file(self, name: str) -> Path:
        return self.path / name if self.path.is_dir() else self.path

    def _bytes(self, name: str, most: int) -> bytes:
        if not self._zipped:
            return first_bytes(self._file(name), most)
        with intact("the archive"), zipfile.ZipFile(self.path) as archive, archive.open(self._members[name]) as member:
            return member.read(most)


def zipfile_like(path: Path) -> bool:
    """Whether a file begins as a zip archive does."""
    return first_bytes(path, 4) in (b"PK\x03\x04", _END)


def _archive_members(path: Path) -> dict[str, zipfile.ZipInfo]:
    """Members of an archive that are files, after its list was judged by its size."""
    _require_short_list(path)
    with intact("the archive"), zipfile.ZipFile(path) as archive:
        infos = [info for info in archive.infolist() if not info.is_dir()]
    infos = [  # without what macOS adds
        info
        for info in infos
        if not info.filename.startswith("__MACOSX/") and not PurePosixPath(info.filename).name.startswith(".")
    ]
    if len(infos) > MAX_MEMBERS:
        raise DecodeError(f"the archive has {len(infos)} members, but a recording has {MAX_MEMBERS} at most.")
    members: dict[str, zipfile.ZipInfo] = {}
    for info in infos:
        if info.filename in members:
            raise DecodeError(f"the archive has two members {excerpt(info.filename)}; export it again.")
        if info.flag_bits & 1:
            raise DecodeError(f"{excerpt(info.filename)} is encrypted; unpack the archive with its password first.")
        if info.compress_type not in _KNOWN_METHODS:
            raise DecodeError(f"{excerpt(info.filename)} is packed by an unknown method; pack it again with Deflate.")
        members[info.filename] = info
    return members


def _require_short_list(path: Path) -> None:
    """Refuse a list of members that would fill the memory; its size stands at the archive's end [APPNOTE 4.3.16]."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        stream.seek(max(0, size - _END_BYTES - 0xFFFF))
        tail = stream.read()
    at = tail.rfind(_END)
    if at < 0 or len(tail) < at + _END_BYTES:
        raise DecodeError("the archive has no end: it is cut, or not a zip archive; export it again.")
    listed = struct.unpack_from("<I", tail, at + 12)[0]
    if listed > MAX_DIRECTORY or tail[max(0, at - 20) : at].startswith(_LOCATOR_64):
        raise DecodeError(
            f"the archive's list of members is longer than {MAX_DIRECTORY} bytes, so it is not a phone's."
        )


def _folder_members(folder: Path) -> Iterator[str]:
    """Regular files of a folder and of its ``meta``; links are left out."""
    count = 0
    for prefix in ("", "meta/"):
        place = folder / prefix
        if prefix and (place.is_symlink() or not place.is_dir()):
            continue
        with os.scandir(place) as entries:
            for entry in entries:
                count += 1
                if count > MAX_MEMBERS:
                    return
                if entry.is_file(follow_symlinks=False) and not entry.name.startswith("."):
                    yield f"{prefix}{entry.name}"


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table of numbers with a row of names; `title` is its file, for messages."""

    title: str
    raw: bytes
    layout: TextLayout
    names: tuple[str, ...]

    def table(
        self, refs: Sequence[ColumnRef], exact: ColumnRef | None = None, texts: Sequence[ColumnRef] = ()
    ) -> TextTable | None:
        """Columns by name, as `text_table.read_table` reads them; None where there is no row; errors name the file."""
        try:
            text = decode(self.raw, self.layout.encoding)
            if not text[find_head(f"{text}\n ", self.layout).start :].strip():
                return None
            return read_table(self.raw, self.layout, refs, exact, texts)
        except PlumbobError as error:
            raise type(error)(f"{self.title}: {error}") from error


def sheet(title: str, raw: bytes, *, comment: str = "") -> Sheet:
    """Row of names of a table, after lines of comment, its separator and decimal sign; DecodeError without one."""
    try:
        text = raw[: 1 << 16].decode("utf-8-sig", "ignore" if len(raw) >= HEAD_BYTES else "strict")
    except UnicodeDecodeError as error:
        raise DecodeError(f"{title} is not UTF-8 text: byte {error.start + 1} cannot be decoded.") from error
    head, first, *_ = [*(row for row in text.splitlines()[:200] if not is_idle(row, comment)), "", ""]
    if not head or "\0" in head:
        raise DecodeError(f"{title} has no row of names.")
    separator = max(_SEPARATORS, key=head.count)
    decimal = "," if separator != "," and "," in first and "." not in first else "."
    names = tuple(cell.strip() for cell in split_row(head, separator, 1))
    layout = TextLayout(separator, decimal, "utf-8", comment, MISSING)
    return Sheet(title, raw, layout, names)


def names_in(start: bytes, *, comment: str = "") -> tuple[str, ...]:
    """Names of the columns of a table by its first bytes; none where it is not one."""
    try:
        return sheet("", start, comment=comment).names
    except DecodeError:
        return ()


def small_table(text: str) -> list[list[str]]:
    """Cells of the rows of a small table; none where it is not one."""
    separator = max(_SEPARATORS, key=text.partition("\n")[0].count)
    try:
        return [[*map(str.strip, row)] for row in csv.reader(text.splitlines(), delimiter=separator) if row]
    except csv.Error:
        return []


def records(rows: list[list[str]]) -> list[dict[str, str]]:
    """Rows by the names in the first."""
    return [dict(zip(rows[0], row, strict=False)) for row in rows[1:]]
