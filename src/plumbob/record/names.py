"""Names of the parts: ``name.mcap``, then ``name.0002.mcap``, ``name.0003.mcap`` and so on."""

import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from plumbob.errors import ParameterError

SUFFIX: Final = ".mcap"
UTC_FIELD: Final = "{utc}"
"""What a name may hold for the time of the start."""


def dated(path: str, utc_ns: int) -> str:
    """Name with the time of the start, as 20260314T150926Z: it sorts by time, and every file system takes it.

    Parameters
    ----------
    path : str
        Name that may hold ``{utc}``.
    utc_ns : int
        UTC, ns since 1970.

    Raises
    ------
    ParameterError
        If another word stands in braces.
    """
    for field in re.findall(r"\{[^{}]*\}", path):
        if field != UTC_FIELD:
            raise ParameterError(f"{path}: a name can hold {UTC_FIELD} for the time of the start, but not {field}.")
    return path.replace(UTC_FIELD, f"{datetime.fromtimestamp(utc_ns // 10**9, UTC):%Y%m%dT%H%M%SZ}")


def next_path(path: Path) -> Path:
    """The name itself where nothing has it, else the name of the next part."""
    parts = existing_parts(path)
    return part_path(path, number_of(path, parts[-1]) + 1) if parts else path


def number_of(path: Path, part: Path) -> int:
    """Number of a part that `existing_parts` found."""
    return 1 if part.name == path.name else int(part.stem.rpartition(".")[2])


def part_path(path: Path, part: int) -> Path:
    """Path of a part; the first has the name of the recording."""
    return path if part == 1 else path.with_name(f"{path.stem}.{part:04d}{path.suffix}")


def existing_parts(path: Path) -> list[Path]:
    """Parts of a recording that are there, in order of their numbers."""
    if not path.parent.is_dir():
        return []
    pattern = re.compile(rf"{re.escape(path.stem)}\.(\d{{4,}}){re.escape(path.suffix)}")
    found = {1: path} if path.exists() else {}
    for other in path.parent.iterdir():
        if (match := pattern.fullmatch(other.name)) and int(match[1]) > 1:
            found[int(match[1])] = other
    return [found[part] for part in sorted(found)]
