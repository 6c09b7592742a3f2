"""One door to recordings: a file of any format, or the bytes of a live stream, decoded again."""

from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.core.errors import DecodeError

if TYPE_CHECKING:
    from plumbob.files import Recording

SUFFIX = ".mcap"
"""Of recordings of a stream."""


def read_any(path: str | Path, *, profile: Path | None = None) -> "Recording":
    """Read a file of any format, a recorded stream too: its samples are decoded again from their bytes.

    Raises
    ------
    PlumbobError
        As `plumbob.files.read`, or as `plumbob.session.recorded.read_recorded`.
    """
    from plumbob import files

    file = Path(path)
    if file.suffix == SUFFIX:
        from plumbob.session.recorded import read_recorded

        return read_recorded(file)
    known = [suffix for kind in files.FORMATS for suffix in kind.suffixes]
    if file.suffix.lower() not in known:
        listed = f"known are {', '.join([SUFFIX, *known])}; raw bytes are for 'plumbob record --from'"
        raise DecodeError(f"{file}: the suffix '{file.suffix}' is unknown; {listed}.")
    return files.read(file, profile=profile)
