"""Files: what may be opened, how an error names its file, and how a file appears whole or not at all.

Every file of this package is written by `replacing`. What is not a file on a disk (a pipe, a terminal, the standard
output by any of its names) is written as it comes. Recordings and logs that grow while a line is read are
made to be cut anywhere, and have their own writers.
"""

import os
import re
import secrets
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from types import FrameType
from typing import Any, Final, TypeVar

from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, one_line

_T = TypeVar("_T")

if sys.platform != "win32":
    import fcntl

MAX_TEXT: Final = 16 * 1024 * 1024  # bytes of what a person writes, or what is kept as text in memory

_FREE_BYTES: Final = 64 << 20
_MAX_RATIO: Final = 128
_MEMORY: Final = "PLUMBOB_MEMORY"


def require_room(unpacked: int, stored: int) -> None:
    """Refuse what a file of `stored` bytes unpacks to by its own word, before any of it is unpacked.

    The bound is 64 MiB, or 128 times the file: sensors that rest and hardly stir pack to a seventieth of their size
    (measured; to a fifth with their usual noise), and numbers that never change to a fifteen-hundredth. Where
    `PLUMBOB_MEMORY` says so, as in ``4GiB``, a file may unpack to more.
    """
    text = os.environ.get(_MEMORY, "0")
    match = re.fullmatch(r"(\d{1,9}) ?(|B|KiB|MiB|GiB)", text)
    if match is None:
        raise DecodeError(f"{_MEMORY} must be a size, for example 4GiB, but it is {text!r}.")
    given = int(match[1]) << {"": 0, "B": 0, "KiB": 10, "MiB": 20, "GiB": 30}[match[2]]
    allowed = max(_FREE_BYTES + _MAX_RATIO * stored, given)
    if unpacked > allowed:
        raise DecodeError(
            f"its {stored} bytes unpack to {unpacked}, but {allowed} are allowed: 64 MiB and {_MAX_RATIO} times the "
            f"file. If you trust the file, allow more, for example {_MEMORY}={1 + (unpacked >> 30)}GiB."
        )


def existing_file(path: str | os.PathLike[str], most: int | None = None) -> Path:
    """Path of a regular file, of `most` bytes at most; DecodeError where there is none."""
    if not isinstance(path, str | os.PathLike):
        from plumbob.core import check  # which imports NumPy

        check.path("path", path)
    file = Path(path)
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


def as_list(path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> Sequence[str | os.PathLike[str]]:
    """Paths that are given, one or several."""
    return path if isinstance(path, Sequence) and not isinstance(path, str) else [path]


def file_sha256(path: Path) -> tuple[str, int]:
    """SHA-256 of a file, as hexadecimal digits, and of how many bytes it is: the file may be growing."""
    import hashlib

    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest(), stream.tell()


def text_of(path: str | os.PathLike[str], what: str | None = None) -> str:
    """Text of a file of at most `MAX_TEXT` bytes; `what` it should be is for messages."""
    file = existing_file(path, MAX_TEXT)
    try:
        return file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        rule = "is not UTF-8 text" if what is None else f"is not a {what}, which is UTF-8 text"
        raise DecodeError(f"{file} {rule}: byte {error.start + 1} cannot be decoded. Save it as UTF-8.") from error
    except OSError as error:
        raise DecodeError(f"{file} cannot be read: {error.strerror}.") from error


def profile_beside(path: Path) -> Path:
    """Name of the profile that is written beside a table, and found there again."""
    return path.parent / f"{path.stem}.profile.toml"  # of a folder such as "." too, where with_name fails


TABLES: Final = (
    ".csv", ".txt", ".tsv", ".lvm", ".dat", ".log", ".gcsv", ".jsonl", ".ndjson", ".gz", ".bz2", ".xz", ".zst", ".zip",
    ".xlsx", ".parquet", ".feather", ".arrow", ".orc",
)  # fmt: skip
"""Suffixes of tables, which a profile describes: of text, packed, or columns of other programs."""
ARRAYS: Final = (".mat", ".h5", ".hdf5", ".nc", ".npz", ".npy")
"""Suffixes of files of named arrays, which a profile describes."""


def sidecars(path: Path) -> tuple[Path, Path]:
    """Names that a profile beside a text file may have."""
    return path.parent / f"{path.stem}.toml", profile_beside(path)


def profile_paths(path: Path) -> tuple[Path, ...]:
    """Names that a profile of a file may have beside it; none where a profile cannot describe such a file."""
    return sidecars(path) if path.suffix.lower() in (*TABLES, *ARRAYS) else ()


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Put the file's name before every error of its content, and make one line of it."""
    numpy = sys.modules.get("numpy")  # what reads no arrays does not import it
    try:
        # A damaged file may hold any number; the validators judge it, so NumPy need not warn of it as well.
        with nullcontext() if numpy is None else numpy.errstate(over="ignore", invalid="ignore"):
            yield
    except PlumbobError as error:
        raise type(error)(f"{path}: {one_line(error)}") from error
    except OSError as error:
        raise DecodeError(f"{path} cannot be read: {error.strerror or one_line(error)}.") from error


def read_in_parts(path: Path, parts: Iterator[_T]) -> Iterator[_T]:
    """Parts of a file as they come; `reading` is around what reads them, not around what is done with them."""
    while True:
        with reading(path):
            try:
                part = next(parts)
            except StopIteration:
                return
        yield part


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> Path:
    """Write a whole file of UTF-8 text, or nothing; errors as in `replacing`."""
    with replacing(Path(path), overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return Path(path)


def require_place(path: Path, *, overwrite: bool = False) -> None:
    """Refuse a place where no file can be written, or where one lies that is not to be replaced.

    What is not a regular file, as a pipe, is always a place: bytes go through it.
    """
    if not path.parent.is_dir():
        raise DecodeError(f"{path} cannot be written: there is no folder {path.parent}; create it first.")
    if path.is_dir():
        raise DecodeError(f"{path} cannot be written: it is a folder; name a file.")
    if Path(os.path.realpath(path)).is_symlink():
        raise DecodeError(f"{path} cannot be written: it is a link that points to itself; remove it.")
    if not path.exists() or _is_stream(path):
        return
    if not overwrite:
        raise _exists(path)
    if not os.access(path, os.W_OK):  # a rename would not ask
        raise DecodeError(f"{path} cannot be written: it is write-protected. Nothing was changed there.")


def is_same_file(first: Path, second: Path) -> bool:
    """Whether two paths lead to one file, by whatever links; one that does not exist yet is compared by its path."""
    if first.exists() and second.exists():
        return first.samefile(second)
    return os.path.realpath(first) == os.path.realpath(second)  # where a link leads to itself, Path.resolve raises


def require_other(path: Path, inputs: Iterable[Path]) -> None:
    """Refuse, with a ParameterError, to write where one of the inputs lies, whatever links lead there."""
    if any(is_same_file(given, path) for given in inputs):
        raise ParameterError(f"{path} is an input; writing there would destroy it. Name another file.")


def _exists(path: Path) -> ParameterError:
    return ParameterError(
        f"{path} exists already and is not replaced. Name another file, or add --force (in Python, overwrite=True)."
    )


@contextmanager
def replacing(path: Path, *, overwrite: bool = False, seeks: bool = False) -> Iterator[Path]:
    """Give an empty temporary file in the same folder that takes the final name only once it is complete and on disk.

    What is not a regular file is given itself, or refused where the writer `seeks` in it: such writers remove what they
    fail to write, and that may be a device. After an error or Ctrl-C nothing is left behind, and what lay at `path` is
    untouched; a temporary of a process that was killed is removed when a file of that name is written again.
    """
    if seeks and _is_stream(path):
        raise DecodeError(
            f"{path} cannot be written: it is a pipe or a device, and this format needs a file on a disk."
        )
    with replacing_all(path, overwrite=overwrite) as (temporary,):
        yield temporary


@contextmanager
def replacing_all(*paths: Path, overwrite: bool = False) -> Iterator[tuple[Path, ...]]:
    """As `replacing`, for files that belong together: all are on disk before the first takes its name."""
    targets = [_Written(path, overwrite) for path in paths]
    try:
        for target in targets:
            target.create()
        yield tuple(target.temporary for target in targets)
        for target in targets:
            target.sync()
        with _uninterrupted():
            for path in paths:  # none is renamed where one cannot be
                require_place(path, overwrite=overwrite)
            for target in targets:
                target.rename()
    except (PlumbobError, BrokenPipeError):
        raise
    except OSError as error:
        raise DecodeError(_refusal(" and ".join(map(str, paths)), error)) from error
    finally:
        try:
            _remove(targets)
        finally:
            _remove(targets)  # again: a signal may have struck just before the first time could hold it back


@contextmanager
def replacing_folder(path: Path, *, overwrite: bool, may_replace: Callable[[Path], bool]) -> Iterator[Path]:
    """As `replacing`, for a folder: give a path that does not exist yet, for a folder that is to take the final name.

    A folder that is not of the kind that is written (`may_replace`) is never replaced.
    """
    require_folder_place(path, overwrite=overwrite, may_replace=may_replace)
    final = Path(os.path.realpath(path))
    start, held = f".{final.name[:40]}.plumbob-", -1
    beside = final.with_name(f"{start}{secrets.token_hex(4)}.tmp")
    try:
        _remove_abandoned(final.parent, start)
        beside.mkdir()
        held = _locked(beside)
        made = beside / final.name
        yield made
        for folder, _, names in os.walk(made):
            for name in names:
                with (Path(folder) / name).open("rb+") as file:
                    os.fsync(file.fileno())
        with _uninterrupted():
            require_folder_place(path, overwrite=overwrite, may_replace=may_replace)
            if final.exists():
                final.rename(beside / "before")
            made.rename(final)
        with suppress(OSError):
            sync_folder(final.parent)
    except (PlumbobError, BrokenPipeError):
        raise
    except OSError as error:
        if not final.exists() and (beside / "before").exists():
            (beside / "before").rename(final)
        raise DecodeError(_refusal(str(path), error)) from error
    finally:
        with _uninterrupted():
            shutil.rmtree(beside, ignore_errors=True)
            if held >= 0:
                os.close(held)


def _locked(folder: Path) -> int:
    """Open and lock a folder, as long as its writer lives; -1 where folders cannot be."""
    if sys.platform == "win32":
        return -1
    descriptor = os.open(folder, os.O_RDONLY)
    with suppress(OSError):  # a disk without locks
        lock(descriptor)
    return descriptor


def _remove_abandoned(parent: Path, start: str) -> None:
    """Remove temporary files and folders whose writer was killed: then nobody has them locked."""
    for other in parent.iterdir():
        if re.fullmatch(rf"{re.escape(start)}[0-9a-f]{{8}}\.tmp", other.name):
            with suppress(OSError):  # locked, gone, or another user's
                descriptor = os.open(other, os.O_RDONLY if other.is_dir() else os.O_RDWR)
                try:
                    lock(descriptor)
                    shutil.rmtree(other) if other.is_dir() else other.unlink()
                finally:
                    os.close(descriptor)


def require_folder_place(path: Path, *, overwrite: bool, may_replace: Callable[[Path], bool]) -> None:
    """Refuse a place where no folder can be written; errors as in `require_place`."""
    if not path.parent.is_dir():
        raise DecodeError(f"{path} cannot be written: there is no folder {path.parent}; create it first.")
    if not path.exists() and not path.is_symlink():
        return
    if not path.is_dir() or path.is_mount():
        raise DecodeError(f"{path} cannot be written: something other than a folder is there; name another one.")
    if not overwrite:
        raise _exists(path)
    if any(path.iterdir()) and not may_replace(path):
        raise ParameterError(f"{path} is a folder of something else, and is never replaced; name another one.")


def _remove(targets: Sequence["_Written"]) -> None:
    """Remove the temporaries that have not taken their names."""
    with _uninterrupted():
        for target in targets:
            if target.held >= 0:
                target.temporary.unlink(missing_ok=True)
                os.close(target.held)
                target.held = -1


class _Written:
    """A file to write: where its bytes go until they are complete, and where it lies then.

    The temporary is locked as long as its writer lives, so that nobody takes it for one that was left behind.
    """

    def __init__(self, path: Path, overwrite: bool) -> None:
        require_place(path, overwrite=overwrite)
        self._path, self._overwrite = path, overwrite
        self._is_stream = _is_stream(path)
        self._final = path if self._is_stream else Path(os.path.realpath(path))  # a link stays one
        self._start = f".{self._final.name[:40]}.plumbob-"  # cut: a name may be as long as names may be
        name = f"{self._start}{secrets.token_hex(4)}.tmp"
        self.temporary = path if self._is_stream else self._final.with_name(name)
        self.held = -1  # descriptor of the temporary, as long as there is one

    def create(self) -> None:
        """Create the temporary, and remove what a killed process left of such a file."""
        if self._is_stream:
            return
        with suppress(OSError):  # a folder that may be written to but not be read
            _remove_abandoned(self._final.parent, self._start)
        with _uninterrupted():
            self.held = os.open(self.temporary, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666)
        with suppress(OSError):  # a disk without locks
            lock(self.held)

    def sync(self) -> None:
        """Wait until the disk has it, with the rights of what it replaces."""
        if self._is_stream:
            return
        if self._final.exists():
            shutil.copymode(self._final, self.temporary)
        with self.temporary.open("rb+") as file:
            os.fsync(file.fileno())

    def rename(self) -> None:
        """Give it its name."""
        if self._is_stream:
            return
        if self._overwrite:
            self.temporary.replace(self._final)
        else:
            self._rename_to_new()
        with suppress(OSError):  # the file is whole and has its name; some disks refuse to sync folders
            sync_folder(self._final.parent)

    def _rename_to_new(self) -> None:
        """Give it its name unless a file has taken that meanwhile: a link is refused then, where a rename is not."""
        try:
            os.link(self.temporary, self._final)
        except FileExistsError:
            raise _exists(self._path) from None
        except OSError:  # a disk without links
            if self._final.exists():
                raise _exists(self._path) from None
            self.temporary.rename(self._final)


def lock(descriptor: int) -> None:
    """Lock a file for as long as it is open, or raise OSError where somebody else has; Windows does so by itself."""
    if sys.platform != "win32":
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def sync_folder(folder: Path) -> None:
    """Wait until the disk knows the names in a folder; where folders cannot be synced, do nothing."""
    if sys.platform == "win32":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _is_stream(path: Path) -> bool:
    """Whether bytes go to a pipe or a device, or to a file that is this process's own output already."""
    if not path.exists():
        return False
    if not path.is_file():
        return True
    for output in (1, 2):
        with suppress(OSError):  # closed
            if os.path.samestat(path.stat(), os.fstat(output)):
                return True
    return False


def _refusal(what: str, error: OSError) -> str:
    why = error.strerror or one_line(error)
    return f"{what} cannot be written: {why}. Nothing was changed there."


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Hold back Ctrl-C, and every other signal that this program handles, until all names are changed, or none.

    Signals are handled in the main thread; in another one there is nothing to hold back.
    """
    came: list[tuple[int, FrameType | None]] = []
    before: dict[int, Callable[[int, FrameType | None], Any]] = {}
    if threading.current_thread() is threading.main_thread():
        for number in signal.valid_signals():
            if callable(handler := signal.getsignal(number)):
                before[number] = handler
                signal.signal(number, lambda *what: came.append(what))
    try:
        yield
    finally:
        for which, handler in before.items():
            signal.signal(which, handler)
        for which, frame in came:
            before[which](which, frame)
