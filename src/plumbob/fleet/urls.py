"""Recordings behind a URL, by fsspec: what is there, and a copy on this machine for as long as its job lasts."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Final

from plumbob.core.errors import DecodeError, LineError, MissingExtraError, ParameterError, PlumbobError, one_line
from plumbob.core.files import profile_paths

if TYPE_CHECKING:
    from fsspec import AbstractFileSystem

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
