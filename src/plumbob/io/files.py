"""Files: what may be opened, how an error names its file, and how a file appears whole or not at all."""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from plumbob.errors import DecodeError, PlumbobError, one_line


def existing_file(path: str | os.PathLike[str]) -> Path:
    """Path of a regular file.

    Raises
    ------
    DecodeError
        If there is none, or it is a folder, a pipe or a device.
    """
    file = Path(path)
    if file.is_dir():
        raise DecodeError(f"{file} is a folder; name one file in it.")
    if not file.exists():
        raise DecodeError(f"{file} does not exist; check the path.")
    if not file.is_file():
        raise DecodeError(f"{file} is not a regular file; copy its content to one first.")
    return file


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


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path in the same folder that takes the final name only once it is complete and on disk.

    Raises
    ------
    DecodeError
        If the system refuses; then whatever was at `path` before is still there, untouched.
    """
    if not path.parent.is_dir():
        raise DecodeError(f"{path} cannot be written: there is no folder {path.parent}; create it first.")
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        why = error.strerror or one_line(error)
        raise DecodeError(f"{path} cannot be written: {why}. Nothing was changed there.") from error
    finally:
        temporary.unlink(missing_ok=True)
