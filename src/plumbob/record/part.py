"""One file of a recording while it is written."""

import os
import zlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from plumbob.record import disk, layout
from plumbob.record.chunk import OpenChunk, PackedChunk
from plumbob.record.info import PartInfo
from plumbob.record.summary import Contents, closing

LIBRARY = "plumbob recording 1"


class Part:
    """A file that holds whole chunks only, and says so at its end if it gets there.

    Parameters
    ----------
    path : Path
        Where; there must be nothing yet.
    info : PartInfo
        What the part says of itself at its beginning.
    create : callable
        Makes the file, and returns its descriptor.
    """

    def __init__(self, path: Path, info: PartInfo, create: Callable[[Path], int] = disk.create) -> None:
        self.path = path
        self.info = info
        self._create = create
        self.contents = Contents()
        self.size = 0
        self._fd = -1
        self._crc = 0
        self._synced = (0, 0)  # size, rows

    def begin(self) -> None:
        """Create the file and write its beginning; leave none behind where that fails.

        Raises
        ------
        OSError
            If the system refuses.
        """
        from mcap.records import Header

        self._fd = self._create(self.path)
        header = layout.MAGIC + layout.encode(Header(profile="", library=LIBRARY))
        try:
            self._append(header)
            self._append_info(self.info)
            self.sync()
        except OSError:
            self.close(keep=False)
            raise

    def write(self, chunk: OpenChunk, packed: PackedChunk) -> None:
        """Append a chunk and its message indexes; on OSError the file ends as before."""
        offset = self.size
        self._append(packed.record + b"".join(packed.indexes.values()))
        self.contents.note(chunk, packed, offset)

    def finish(
        self, channels: Mapping[int, tuple[bytes, bytes]], ends: dict[str, int], dropped: dict[str, int]
    ) -> None:
        """Write the end: what was said at the beginning once more, the index, the footer.

        Raises
        ------
        OSError
            If it does not go to disk; then the file ends with its last whole chunk.
        """
        size, crc = self.size, self._crc
        try:
            self._append_info(replace(self.info, ends=ends, dropped=dropped))
            self._append(closing(self.contents, channels, self.size, self._crc))
        except OSError:
            self.size, self._crc = size, crc
            self._cut()
            raise

    def sync(self) -> None:
        """Wait until the disk has everything; raises OSError if it does not take it."""
        disk.sync(self._fd)
        self._synced = (self.size, self.contents.rows)

    def cut_to_synced(self) -> None:
        """Leave in the file only what the disk has confirmed."""
        self.size, self.contents.rows = self._synced
        self._cut()

    def close(self, keep: bool) -> None:
        """Close the file, and remove it unless it is to be kept."""
        os.close(self._fd)
        self._fd = -1
        if not keep:
            self.path.unlink(missing_ok=True)

    def _append_info(self, info: PartInfo) -> None:
        record = info.record()
        offset = self.size
        self._append(record)
        self.contents.infos.append((offset, len(record)))

    def _append(self, data: bytes) -> None:
        try:
            disk.write_all(self._fd, data, self.size)
        except OSError:
            self._cut()
            raise
        self.size += len(data)
        self._crc = zlib.crc32(data, self._crc)

    def _cut(self) -> None:
        try:
            os.ftruncate(self._fd, self.size)
        except OSError:  # a disk that refuses this too keeps a torn end, which the reader knows how to leave out
            return
