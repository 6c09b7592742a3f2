"""x-IMU3."""

from pathlib import Path

from plumbob.core.errors import DecodeError
from plumbob.files.notes import Recording


def accepts(path: Path) -> bool:
    """Whether a path is of this format, by its content."""
    return False


def read(path: Path) -> Recording:
    """Read it."""
    raise DecodeError(f"{path}: this format is not read yet.")
