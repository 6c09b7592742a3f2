"""Named arrays."""

from pathlib import Path
from typing import Any

from plumbob.core.errors import DecodeError
from plumbob.files.notes import Recording


def read(path: Path, profile: Any = None) -> Recording:
    """Read it."""
    raise DecodeError(f"{path}: this format is not read yet.")
