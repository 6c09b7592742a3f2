"""The few system calls of a recording: whole writes, fsync, free space, locks."""

import errno
import os
import sys
from pathlib import Path
from typing import Final

from plumbob.core.files import lock, sync_folder

if sys.platform != "win32":
    import fcntl

RESERVE: Final = 1 << 30
RESERVE_SHARE: Final = 0.05


def create(path: Path) -> int:
    """Create a file that is not there yet, locked against other recorders; return its descriptor."""
    fd = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR | getattr(os, "O_CLOEXEC", 0), 0o644)
    try:
        lock(fd)
        sync_folder(path.parent)
    except OSError:
        os.close(fd)
        path.unlink(missing_ok=True)
        raise
    return fd


def open_empty(path: Path) -> int:
    """Open a file that is there and empty, as `plumbob.core.files.replacing` gives it; return its descriptor."""
    return os.open(path, os.O_RDWR | getattr(os, "O_CLOEXEC", 0))


def write_all(fd: int, data: bytes, offset: int) -> None:
    """Write all of `data` at `offset`, in as many calls as the system needs."""
    os.lseek(fd, offset, os.SEEK_SET)
    view = memoryview(data)
    while view:
        view = view[os.write(fd, view) :]


def sync(fd: int) -> None:
    """Wait until the disk has what was written."""
    os.fsync(fd)


def is_locked(path: Path) -> bool:
    """Whether a recorder holds the file at this moment."""
    if sys.platform == "win32":
        return False
    with path.open("rb") as file:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


def is_full(error: OSError) -> bool:
    """Whether an error says that there is no room, which may come back."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def free(folder: Path) -> int:
    """Bytes that may still be written to the disk of a folder."""
    stat = os.statvfs(folder)
    return stat.f_bavail * stat.f_frsize


def boot() -> str:
    """Which start of this machine it is, a random word that the kernel made; empty where it makes none."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return ""


def default_reserve(folder: Path) -> int:
    """The smaller of 1 GiB and 5 % of the disk, bytes."""
    stat = os.statvfs(folder)
    return min(RESERVE, int(RESERVE_SHARE * stat.f_blocks * stat.f_frsize))
