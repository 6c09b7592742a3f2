"""Files: `read` and `write` choose the format by the suffix; `FORMATS` lists what there is."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.core import check
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import TABLES, existing_file
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.array import ImuArray
from plumbob.files.notes import Recording, findings_of, lines

if TYPE_CHECKING:
    from plumbob.files.profile import Profile


@dataclass(frozen=True, slots=True)
class Format:
    """A file format.

    Attributes
    ----------
    name : str
        What it is called.
    suffixes : tuple of str
        File names that end so are taken for it.
    what : str
        One line for help and documentation.
    read : callable
        Reader of a path, and of a profile where it takes one.
    opened : callable or None
        As `read`, but samples may stay in the file.
    takes_profile : bool
        Whether a profile describes such files.
    writers : tuple of (str, callable)
        Suffixes that can be written, with their writers, which also take whether a file may be replaced.
    """

    name: str
    suffixes: tuple[str, ...]
    what: str
    read: Callable[..., Recording]
    opened: Callable[[Path], Recording] | None = None
    takes_profile: bool = False
    writers: tuple[tuple[str, Callable[[Path, Recording, bool], None]], ...] = ()


def _late(module: str, name: str) -> Callable[..., Any]:
    """A reader or writer whose module is imported when a file needs it."""

    def call(*args: Any) -> Any:
        return getattr(import_module(f"plumbob.files.{module}"), name)(*args)

    return call


FORMATS: Final = (
    Format(
        name="native",
        suffixes=(".parquet",),
        what="native recording: every bit, units and a checksum inside",
        read=_late("parquet", "read_parquet"),
        opened=_late("parquet", "open_parquet"),
        writers=((".parquet", _late("parquet", "write_parquet")),),
    ),
    Format(
        name="text",
        suffixes=TABLES,
        what="text tables, described by a profile in TOML; written as .csv or .txt with its profile beside it",
        read=_late("text", "read_text"),
        takes_profile=True,
        writers=tuple((suffix, _late("text_write", "write_csv")) for suffix in (".csv", ".txt")),
    ),
    Format(
        name="BROAD",
        suffixes=(".hdf5", ".h5", ".mat"),
        what="trials of the BROAD data set, HDF5 or MATLAB v5; read only",
        read=_late("broad", "read_broad"),
    ),
)


def read(
    path: str | os.PathLike[str], *, profile: "Profile | str | Path | None" = None, whole: bool = True
) -> Recording:
    """Read a recording; its notes also say what was found in the data (`plumbob.files.notes`).

    Parameters
    ----------
    path : path
        The file; its suffix says the format.
    profile : Profile or path, optional
        For text files: what they do not say about themselves.
    whole : bool
        Whether all is to be in memory; without it, the samples of a native recording that has no attitude stay in their
        file, and are read part by part.

    Raises
    ------
    DecodeError
        If there is no such file, its suffix is unknown, or it is not what it claims to be.
    ParameterError
        If a profile is given for a file that describes itself.
    UnitError, ClockError, ShapeError, FrameError
        If its numbers cannot be what they are declared to be.
    """
    kind = _format(check.path("path", path))
    file = existing_file(path)
    if profile is not None and not kind.takes_profile:
        raise ParameterError(f"{file} describes itself ({kind.name}), so it takes no profile; leave --profile out.")
    if kind.takes_profile:
        recording = kind.read(file, profile)
    else:
        recording = kind.read(file) if whole or kind.opened is None else kind.opened(file)
    return replace(recording, notes=(*recording.notes, *findings_of(recording)))


def write(
    path: str | os.PathLike[str],
    what: Recording | ImuData | ImuArray | AttitudeTrack,
    *,
    notes: Iterable[str] = (),
    overwrite: bool = False,
) -> Path:
    """Write a recording, samples of a unit or of an array, or an attitude; the file appears whole or not at all.

    Parameters
    ----------
    path : path
        The file; its suffix says the format.
    what : Recording, ImuData, ImuArray or AttitudeTrack
        The content; of an array, ``.parquet`` holds all units.
    notes : iterable of str
        Lines of provenance to add.
    overwrite : bool
        Whether a file that lies there may be replaced.

    Returns
    -------
    Path
        Where it is.

    Raises
    ------
    ParameterError
        If a file lies there and `overwrite` is false.
    DecodeError
        If the suffix is unknown or cannot be written, or the system refuses.
    ClockError
        If samples and attitude have different time stamps.
    ShapeError
        If the notes are not lines of text.
    """
    added, file = lines("notes", notes), check.path("path", path)
    writers = dict(_format(file).writers)
    if file.suffix.lower() not in writers:
        raise DecodeError(f"{file}: {file.suffix} is read only; write {', '.join(_writable())} instead.")
    recording = _recording(what, file.stem)
    writers[file.suffix.lower()](file, replace(recording, notes=(*recording.notes, *added)), overwrite)
    return file


def _recording(what: Recording | ImuData | ImuArray | AttitudeTrack, name: str) -> Recording:
    if isinstance(what, ImuArray):
        return Recording(array=what, name=name)
    if isinstance(what, ImuData):
        return Recording(imu=what, name=name)
    if isinstance(what, AttitudeTrack):
        return Recording(track=what, name=name)
    return check.kind("what", what, Recording, hint="An ImuData or an AttitudeTrack will do, too.")


def _format(path: Path) -> Format:
    for kind in FORMATS:
        if path.suffix.lower() in kind.suffixes:
            return kind
    from plumbob.files.numbers import SUFFIXES

    known = ", ".join(suffix for kind in FORMATS for suffix in kind.suffixes)
    hint = " Plain numbers are not a recording; 'plumbob allan' takes them." if path.suffix.lower() in SUFFIXES else ""
    raise DecodeError(f"{path}: the suffix '{path.suffix}' is unknown; known are {known}.{hint}")


def _writable() -> list[str]:
    return [suffix for kind in FORMATS for suffix, _ in kind.writers]
