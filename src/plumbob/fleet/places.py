"""Where a dataset lies: a folder on this machine, or one behind a URL, by fsspec. Files appear whole or not at all.

Names in a place are relative, with ``/`` between folders.
"""

import json
import os
import re
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from tempfile import TemporaryDirectory, TemporaryFile
from typing import TYPE_CHECKING, Final

from plumbob.core.errors import DecodeError, LineError, MissingExtraError, ParameterError, PlumbobError, one_line
from plumbob.core.files import lock, profile_paths, require_place

if TYPE_CHECKING:
    from fsspec import AbstractFileSystem

Fill = Callable[[Path], object]  # writes a file at a path, where one may lie already

LOCK: Final = "_jobs/.lock"
_STALE: Final = 900.0  # age of the lock of a run on another machine, s, above which that run counts as ended
_BEAT: Final = 60.0
_COPY: Final = 1 << 20


def is_url(text: str) -> bool:
    """Whether a name is a URL, as ``s3://bucket/folder``."""
    return re.match(r"[a-zA-Z][a-zA-Z0-9+.-]+://", text) is not None


def in_memory(name: str) -> bool:
    """Whether a URL is of files in the memory of this process, which no other one sees."""
    return name.lower().startswith("memory://")


def filesystem(url: str) -> "tuple[AbstractFileSystem, str]":
    """File system of a URL, and the path in it."""
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise MissingExtraError(f'{url} needs fsspec; install it with: pip install "plumbob[remote]".') from error
    try:
        system, path = url_to_fs(url)
    except ImportError as error:
        raise MissingExtraError(f"{url} needs a package that is not installed: {one_line(error)}.") from error
    except ValueError as error:
        raise ParameterError(f"{url} cannot be opened: {one_line(error)}. Check the URL.") from error
    return system, str(path)


@contextmanager
def reaching(url: str) -> Iterator[None]:
    """Make one error of what a file system raises: each has types of its own for networks, keys and buckets."""
    try:
        yield
    except PlumbobError:
        raise
    except Exception as error:
        why = one_line(error) or type(error).__name__
        raise LineError(f"{url} cannot be reached: {why}. Check the URL, the network and the credentials.") from error


@contextmanager
def fetched(url: str, most: int) -> Iterator[Path]:
    """Local copy of a file behind a URL, of the same name, and of the profile beside it; it is removed afterwards."""
    system, path = filesystem(url)
    home, _, name = path.rstrip("/").rpartition("/")
    with TemporaryDirectory(prefix="plumbob-") as folder:
        copy = Path(folder) / (name or "recording")
        with reaching(url):
            try:
                complete = _copied(system, path, copy, most)
            except (FileNotFoundError, PermissionError) as error:
                raise DecodeError(f"{url} cannot be read: {one_line(error) or type(error).__name__}.") from error
            for profile in profile_paths(copy):
                if system.isfile(f"{home}/{profile.name}"):
                    complete &= _copied(system, f"{home}/{profile.name}", profile, most)
        if not complete:
            raise DecodeError(f"{url} has more than {most} bytes, which is the limit; allow more with max_bytes.")
        yield copy


def _copied(system: "AbstractFileSystem", path: str, copy: Path, most: int) -> bool:
    """Copy a file behind a URL; False where it has more bytes than it may."""
    size = 0
    with system.open(path, "rb") as source, copy.open("wb") as target:
        while part := source.read(_COPY):
            size += len(part)
            if size > most:
                return False
            target.write(part)
    return True


class Place:
    """A folder that holds a dataset; here it is one of this machine."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._folder = Path(name)

    def names(self, folder: str = "") -> list[str]:
        """Names of what lies in a folder, in order; none where it does not exist."""
        with suppress(FileNotFoundError, NotADirectoryError):
            return sorted(path.name for path in (self._folder / folder).iterdir())
        return []

    def read(self, name: str) -> bytes | None:
        """Content of a file; None where there is none."""
        with suppress(FileNotFoundError):
            return (self._folder / name).read_bytes()
        return None

    def write(self, name: str, fill: Fill) -> None:
        """Write a file, whole or not at all."""
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        fill(path)

    def remove(self, name: str) -> None:
        """Remove a file, if it is there."""
        (self._folder / name).unlink(missing_ok=True)

    @contextmanager
    def locked(self, files: Iterable[str] = (), folders: Iterable[str] = ()) -> Iterator[None]:
        """Context in which no other run writes here, by a lock that goes with its process, however that ends.

        DecodeError where nothing can be written here, to one of these folders, or to a file of one of these names.
        """
        try:
            for folder in (self._folder / LOCK).parent, *map(self._folder.joinpath, folders):
                folder.mkdir(parents=True, exist_ok=True)
                with TemporaryFile(dir=folder):  # what a system says of rights need not be so
                    pass
            descriptor = os.open(self._folder / LOCK, os.O_CREAT | os.O_RDWR, 0o666)
        except OSError as error:
            why = f"{error.filename}: {error.strerror}" if error.filename else one_line(error)
            raise DecodeError(f"{self.name} cannot be written ({why}). Name another folder.") from error
        try:
            try:
                lock(descriptor)
            except OSError:
                raise _taken(self.name, os.read(descriptor, 200).decode("utf-8", "replace")) from None
            os.truncate(descriptor, 0)
            os.write(descriptor, _holder().encode())
            for name in files:
                require_place(self._folder / name, overwrite=True)
            yield
        finally:
            os.close(descriptor)


class _Remote(Place):
    """Behind a URL."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._system, root = filesystem(name)
        self._root = root.rstrip("/")

    def names(self, folder: str = "") -> list[str]:
        with reaching(self.name), suppress(FileNotFoundError):
            self._system.invalidate_cache()
            paths = self._system.ls(self._path(folder), detail=False)
            return sorted(name.rstrip("/").rpartition("/")[2] for name in paths)
        return []

    def read(self, name: str) -> bytes | None:
        with reaching(self.name), suppress(FileNotFoundError):
            return bytes(self._system.cat_file(self._path(name)))
        return None

    def write(self, name: str, fill: Fill) -> None:
        """Write it here, send it under another name, and rename it there."""
        with TemporaryDirectory(prefix="plumbob-") as folder:
            copy = Path(folder) / name.rpartition("/")[2]
            fill(copy)
            sent = self._path(f"_temporary/{token_hex(8)}")
            with reaching(f"{self.name}/{name}"):
                self._system.makedirs(self._path("_temporary"), exist_ok=True)
                self._system.put_file(str(copy), sent)
                self._system.makedirs(self._path(name).rpartition("/")[0], exist_ok=True)
                self._system.mv(sent, self._path(name))

    def remove(self, name: str) -> None:
        with reaching(self.name), suppress(FileNotFoundError):
            self._system.rm_file(self._path(name))

    @contextmanager
    def locked(self, _files: Iterable[str] = (), _folders: Iterable[str] = ()) -> Iterator[None]:
        """Hold a file that says since when; it is written again while the run lasts, and an old one is passed over."""
        held = json.loads(self.read(LOCK) or b"null")
        if held is not None and time.time() - held["time"] < _STALE and not _ended(held["holder"]):
            raise _taken(self.name, held["holder"])
        over = threading.Event()

        def beat() -> None:
            text = json.dumps({"holder": _holder(), "time": time.time()})
            self.write(LOCK, lambda path: path.write_text(text))

        def beats() -> None:
            while not over.wait(_BEAT):
                with suppress(Exception):  # the network may come back
                    beat()

        beat()
        beating = threading.Thread(target=beats, daemon=True)
        beating.start()
        try:
            yield
        finally:
            over.set()
            beating.join()
            self.remove(LOCK)

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}".rstrip("/")


def as_place(name: str) -> Place:
    """Place of a path or a URL."""
    return _Remote(name) if is_url(name) else Place(name)


def _holder() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}"


def _ended(holder: str) -> bool:
    """Whether it is a process of this machine that does not live any more."""
    match = re.fullmatch(r"process (\d{1,9}) on (.*)", holder)
    if match is None or match[2] != socket.gethostname() or os.name == "nt":
        return False
    try:
        os.kill(int(match[1]), 0)
    except OSError as error:
        return isinstance(error, ProcessLookupError)
    return False


def _taken(where: str, holder: str) -> ParameterError:
    return ParameterError(f"{where} is written by another run ({holder or 'not named'}); wait for its end.")
