"""Names of the parts: ``name.mcap``, then ``name.0002.mcap``, ``name.0003.mcap`` and so on."""

import re
from pathlib import Path
from typing import Final

SUFFIX: Final = ".mcap"


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
