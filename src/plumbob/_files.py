"""Files: what may be opened, how an error names its file, and how a file appears whole or not at all.

Every file of this package is written by `replacing`. What is not a file on a disk (a pipe, a terminal, the standard
output by any of its names) is written as it comes. Recordings and logs that grow while a line is read are
made to be cut anywhere, and have their own writers.
"""

import os
import secrets
import shutil
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Final

import numpy as np

from plumbob import check
from plumbob.errors import DecodeError, PlumbobError, one_line

MAX_TEXT: Final = 16 * 1024 * 1024
"""Bytes of a file that a person writes, or that is kept as text in memory: cards, sessions, formats, profiles."""


def existing_file(path: str | os.PathLike[str], most: int | None = None) -> Path:
    """Path of a regular file.

    Parameters
    ----------
    path : path
        The file.
    most : int, optional
        Bytes that it may have.

    Raises
    ------
    DecodeError
        If there is none, it is a folder, a pipe or a device, or it is larger.
    """
    file = check.path("path", path)
    if file.is_dir():
        raise DecodeError(f"{file} is a folder; name one file in it.")
    if not file.exists():
        missing = "" if file.parent.is_dir() else f"there is no folder {file.parent}; "
        raise DecodeError(f"{file} does not exist; {missing}check the path.")
    if not file.is_file():
        raise DecodeError(f"{file} is not a regular file; copy its content to one first.")
    if most is not None and (size := file.stat().st_size) > most:
        raise DecodeError(f"{file} has {size} bytes, but such a file has {most} at most; check the path.")
    return file


def text_of(path: str | os.PathLike[str], what: str | None = None) -> str:
    """Text of a file of at most `MAX_TEXT` bytes; `what` it should be is for messages.

    Raises
    ------
    DecodeError
        If it is not a regular file, is larger, cannot be read, or is not UTF-8.
    """
    file = existing_file(path, MAX_TEXT)
    try:
        return file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        rule = "is no UTF-8 text" if what is None else f"is not a {what}, which is UTF-8 text"
        raise DecodeError(f"{file} {rule}: byte {error.start + 1} is none; save it so.") from error
    except OSError as error:
        raise DecodeError(f"{file} cannot be read: {error.strerror}.") from error


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Put the file's name before every error of its content, and make one line of it."""
    try:
        # A damaged file may hold any number; the validators judge it, so NumPy need not warn of it as well.
        with np.errstate(over="ignore", invalid="ignore"):
            yield
    except PlumbobError as error:
        raise type(error)(f"{path}: {one_line(error)}") from error
    except OSError as error:
        raise DecodeError(f"{path} cannot be read: {error.strerror or one_line(error)}.") from error


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Write a whole file of UTF-8 text, or nothing; errors as in `replacing`."""
    with replacing(Path(path)) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return Path(path)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path in the same folder that takes the final name only once it is complete and on disk.

    What is not a regular file is given itself. After an error, Ctrl-C or SIGTERM nothing is left behind.

    Raises
    ------
    DecodeError
        If the system refuses; then whatever was at `path` before is still there, untouched.
    """
    with replacing_all(path) as (temporary,):
        yield temporary


@contextmanager
def replacing_all(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """As `replacing`, for files that belong together: all are on disk before the first takes its name."""
    targets = [_Target(path) for path in paths]
    with _removed_after(target.temporary for target in targets if not target.is_stream):
        try:
            yield tuple(target.temporary for target in targets)
            for target in targets:
                target.sync()
            for target in targets:
                target.rename()
        except (PlumbobError, BrokenPipeError):
            raise
        except OSError as error:
            raise DecodeError(_refusal(" and ".join(map(str, paths)), error)) from error


class _Target:
    """A file to write: where its bytes go until they are complete, and where it lies then."""

    def __init__(self, path: Path) -> None:
        if not path.parent.is_dir():
            raise DecodeError(f"{path} cannot be written: there is no folder {path.parent}; create it first.")
        if path.is_dir():
            raise DecodeError(f"{path} cannot be written: it is a folder; name a file.")
        self.is_stream = _is_stream(path)
        self._final = path if self.is_stream else Path(os.path.realpath(path))  # a link stays one
        name = f".{self._final.name[:40]}.{secrets.token_hex(4)}.tmp"  # cut: a name may be as long as names may be
        self.temporary = path if self.is_stream else self._final.with_name(name)
        if self._final.exists() and not os.access(self._final, os.W_OK):  # a rename would not ask
            raise DecodeError(f"{path} cannot be written: it is write-protected. Nothing was changed there.")

    def sync(self) -> None:
        """Wait until the disk has it, with the rights of what it replaces."""
        if self.is_stream:
            return
        if self._final.exists():
            shutil.copymode(self._final, self.temporary)
        with self.temporary.open("rb+") as file:
            os.fsync(file.fileno())

    def rename(self) -> None:
        """Give it its name."""
        if not self.is_stream:
            self.temporary.replace(self._final)


def _is_stream(path: Path) -> bool:
    """Whether bytes go to a pipe or a device, or to a file that is this process's own output already."""
    if not path.exists():
        return False
    found = path.stat()
    return not path.is_file() or any(os.path.samestat(found, own) for own in _own_outputs())


def _own_outputs() -> Iterator[os.stat_result]:
    for descriptor in (1, 2):
        with suppress(OSError):  # closed
            yield os.fstat(descriptor)


def _refusal(what: str, error: OSError) -> str:
    why = error.strerror or one_line(error)
    return f"{what} cannot be written: {why}. Nothing was changed there."


@contextmanager
def _removed_after(paths: Iterable[Path]) -> Iterator[None]:
    """Remove temporary files at the end, and where SIGTERM would end the process without a word."""
    files = list(paths)

    def end(number: int, _frame: FrameType | None) -> None:
        _remove(files)
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)

    with _on_sigterm(end):
        try:
            yield
        finally:
            _remove(files)


def _remove(files: Iterable[Path]) -> None:
    for file in files:
        file.unlink(missing_ok=True)


@contextmanager
def _on_sigterm(end: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Call `end` where the signal had its default meaning; signals belong to the main thread."""
    ours = threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    if not ours:
        yield
        return
    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
