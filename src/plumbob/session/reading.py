"""One door to recordings: a file of any format, or the bytes of a live stream, decoded again."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.core import check
from plumbob.core.errors import DecodeError

if TYPE_CHECKING:
    from plumbob.files import Profile, Recording

SUFFIX = ".mcap"
"""Of recordings of a stream."""


def read(
    path: str | os.PathLike[str], *, profile: "Profile | str | Path | None" = None, whole: bool = True
) -> "Recording":
    """Read a file of any format, a recorded stream too: its samples are decoded again from their bytes.

    Parameters
    ----------
    path : path
        The file; its suffix says the format.
    profile : Profile or path, optional
        What the columns of a text file mean; one that lies beside it is found.
    whole : bool
        Whether all is to be in memory; without it, the samples of a ``.parquet`` recording that has no attitude stay in
        their file: slices and `ImuData.chunks` read them part by part.

    Returns
    -------
    Recording
        Samples, attitude, or both, and notes of what a reader should know.

    Raises
    ------
    DecodeError
        If the file cannot be read, or is not what its suffix says.
    ParameterError
        If `path` is not a path, or the format takes no profile.
    MissingExtraError
        If the format needs a package that is not installed.
    """
    from plumbob.files import FORMATS
    from plumbob.files import read as read_samples

    file = check.path("path", path)
    if file.suffix == SUFFIX:
        from plumbob.session.recorded import read_recorded

        return read_recorded(file)
    known = [suffix for kind in FORMATS for suffix in kind.suffixes]
    if file.suffix.lower() not in known:
        listed = f"known are {', '.join([SUFFIX, *known])}; raw bytes are for 'plumbob record --from'"
        raise DecodeError(f"{file}: the suffix '{file.suffix}' is unknown; {listed}.")
    return read_samples(file, profile=profile, whole=whole)
