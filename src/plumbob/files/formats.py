"""Files: `read` and `write` choose the format by the suffix; `FORMATS` lists what there is."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.core import check
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, UnknownFormatError
from plumbob.core.extensions import ExtensibleTable, note
from plumbob.core.files import ARRAYS, TABLES, existing_file, reading, replacing, sidecars
from plumbob.core.findings import Finding, as_findings, lasting
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.array import ImuArray
from plumbob.data.recording import Recording, all_findings

if TYPE_CHECKING:
    from plumbob.files.profile import Profile


@dataclass(frozen=True, slots=True)
class FileFormat:
    """A file format."""

    name: str  # what it is called
    suffixes: tuple[str, ...]  # file names that end so are taken for it
    # its reader, or module and function of it, as ``"parquet.read_parquet"``; of a path, and a profile where it takes
    # one
    reader: str | Callable[..., Any]
    # what its reader takes behind the path: ``profile``, which describes such files; ``unit``, where it chooses one of
    # several itself, whose clocks may differ; ``in_memory``, as otherwise samples may stay in the file
    takes: tuple[str, ...] = ()
    # As `reader`: whether a path is of this format, by its content; asked where several formats share a suffix, or it
    # is a folder. None: the suffix says it all.
    accepts: str | Callable[..., Any] | None = None
    # suffixes that can be written, with their writers, as `reader`, which also take whether a file may be replaced
    writers: tuple[tuple[str, str | Callable[..., Any]], ...] = ()

    def claims(self, path: Path) -> bool:
        """Whether a path is of this format, by its content where that is asked."""
        return self.accepts is None or bool(_named(self.accepts)(path))


def _named(name: str | Callable[..., Any]) -> Callable[..., Any]:
    """A function, whose module is imported when a file needs it."""
    if callable(name):
        return name
    module, _, function = name.rpartition(".")
    loaded: Callable[..., Any] = getattr(import_module(f"plumbob.files.{module}"), function)
    return loaded


def read_table(path: Path, profile: "Profile | str | Path | None") -> Recording:
    """Read a text table; a log that is known by its names needs no profile."""
    from plumbob.files.text import read_text

    return read_text(path, resolved_profile(path, profile))


def resolved_profile(path: Path, profile: "Profile | str | Path | None") -> "Profile | str | Path | None":
    """Profile that is given; that of a log which is known by its names, where none lies beside it."""
    from plumbob.files.profile import profiles_beside

    if profile is not None or profiles_beside(path):
        return profile
    from plumbob.files.draft import known_profile
    from plumbob.files.known_logs import refuse_known

    refuse_known(path)
    return known_profile(path)


def refuse_stream(path: Path) -> Recording:
    """Refuse a recording of a line, which the session that it holds decodes."""
    raise DecodeError(f"{path} is a recording of a line: read it alone, in Python with plumbob.read.")


def _foreign(
    name: str, module: str, *suffixes: str, takes: tuple[str, ...] = (), most: int | None = None
) -> FileFormat:
    """A format of `plumbob.files.foreign`, whose files have `most` bytes; a suffix of "" is a folder."""

    def reader(path: Path, *unit: str | None) -> Recording:
        file = path if path.is_dir() else existing_file(path, most)
        with reading(file):
            recording: Recording = _named(f"foreign.{module}.read")(file, *unit)
            return recording

    return FileFormat(name, suffixes, reader, accepts=f"foreign.{module}.accepts", takes=takes)


_IN_MEMORY: Final = 2 << 30  # bytes of a log at most that is kept in memory while it is searched
FORMATS: Final = (
    FileFormat(
        "native", (".parquet",), "parquet.read_parquet", takes=("in_memory",),
        writers=((".parquet", "parquet.write_parquet"),),
    ),
    _foreign("ROS", "ros", ".bag", ".db3", ".mcap", "", takes=("unit",)),
    FileFormat("recording", (".mcap",), "formats.refuse_stream"),  # of a line, or samples for viewers
    _foreign("ULog", "ulog", ".ulg", ".ulog", takes=("unit",), most=_IN_MEMORY),
    _foreign("DataFlash", "ardupilot", ".bin", ".log", ".tlog", takes=("unit",), most=_IN_MEMORY),
    _foreign("EuRoC", "euroc", "", ".csv"),
    _foreign("KITTI", "kitti", ""),
    _foreign("phone", "phones", ".zip", ".csv", ".txt", ""),
    _foreign("Xsens", "xsens", ".txt", ".csv", ".mtb", takes=("unit",), most=_IN_MEMORY),
    _foreign("APDM", "apdm", ".h5", ".hdf5", takes=("unit",)),
    replace(
        _foreign("OpenSim", "opensim", ".sto", ".mot", takes=("unit",), most=_IN_MEMORY),
        writers=((".sto", "foreign.opensim.write_sto"),),
    ),
    _foreign("x-IMU3", "ximu3", ".ximu3", ".csv", "", most=_IN_MEMORY),
    FileFormat(
        "text", TABLES, "formats.read_table", takes=("profile",),
        writers=tuple((suffix, "text.write_csv") for suffix in (".csv", ".txt")),
    ),
    FileFormat("text", (".json",), "formats.read_table", takes=("profile",), accepts="sniff.is_array"),
    FileFormat(
        "arrays", ARRAYS, "foreign.tables.read", takes=("profile",),
        writers=((".mat", "foreign.tables.write_mat"), (".nc", "foreign.tables.write_netcdf")),
    ),
)  # fmt: skip


_BUILTIN: Final = {
    suffix: [kind for kind in FORMATS if suffix in kind.suffixes] for some in FORMATS for suffix in some.suffixes
}  # plumbob's formats by suffix, "" for a folder


def _of_package(name: str, what: Any) -> FileFormat:
    """Format of another package: its module has `read` of a path, and may have `accepts` of it, and `write` of both."""
    module, suffix = import_module(what) if isinstance(what, str) else what, f".{name}"
    if not hasattr(module, "read"):
        raise ParameterError("it must have read(path)")
    if not hasattr(module, "accepts") and suffix in _BUILTIN:
        raise ParameterError(f"other formats use {suffix} too, so it must have accepts(path)")

    def reader(path: Path) -> Recording:
        try:
            with reading(path):
                return check.kind("what read gives", module.read(path), Recording)
        except PlumbobError:
            raise
        except Exception as error:
            what = f"cannot read {path}"
            raise DecodeError(str(EXTENSIBLE.unusable(name, error, what))) from error

    def accepts(path: Path) -> bool:
        try:
            return bool(module.accepts(path))
        except Exception as error:  # a file that it cannot look at is not its own
            note(str(EXTENSIBLE.unusable(name, error, f"cannot tell {path}")))
            return False

    def writer(path: Path, recording: Recording, overwrite: bool) -> None:
        with replacing(path, overwrite=overwrite) as temporary:
            try:
                module.write(temporary, recording)
                if not temporary.exists() or not temporary.stat().st_size:
                    raise ValueError("write(path, recording) wrote nothing")
            except (OSError, PlumbobError):  # as a disk that is full
                raise
            except Exception as error:
                raise DecodeError(str(EXTENSIBLE.unusable(name, error, f"cannot write {path}"))) from error

    decides, writers = not hasattr(module, "accepts"), ((suffix, writer),) if hasattr(module, "write") else ()
    return FileFormat(name, (suffix,), reader, accepts=None if decides else accepts, writers=writers)


_ALONE: Final = {
    suffix[1:]: kind for kind in FORMATS if not kind.accepts and "profile" not in kind.takes for suffix in kind.suffixes
}  # suffixes that other packages cannot have, because what ends so is of that format, whatever is in it
EXTENSIBLE: Final = ExtensibleTable[FileFormat]("file", "file format", lambda: _ALONE, _of_package)


def _of_suffix(suffix: str) -> Iterator[FileFormat]:
    """Formats of a suffix, "" for a folder, as they are asked; other packages are looked at where Plumbob's refuse."""
    usual = _BUILTIN.get(suffix, [])
    yield from (kind for kind in usual if "profile" not in kind.takes)
    if suffix[1:] not in _ALONE:
        others = EXTENSIBLE.usable([suffix[1:]]) if usual else [("", EXTENSIBLE.find(suffix[1:]))]
        yield from (kind for _, kind in others if kind)
    yield from (kind for kind in usual if "profile" in kind.takes)


def read(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    profile: "Profile | str | Path | None" = None,
    whole: bool = True,
    unit: str | None = None,
) -> Recording:
    """Read a recording, as `plumbob.read`, or files of one with a sensor each; notes say what was found in it.

    Unless `whole`, samples of a native recording that has no attitude stay in their file, and are read part by part.
    """
    if isinstance(path, Sequence) and not isinstance(path, str):
        return _together(path, profile)
    kind = kind_of(path, described=profile is not None)
    file = Path(path)
    if profile is not None and "profile" not in kind.takes:
        raise ParameterError(f"{file} describes itself ({kind.name}), so it takes no profile; leave --profile out.")
    options = {"profile": profile, "unit": unit, "in_memory": whole}
    recording: Recording = _named(kind.reader)(file, *(options[name] for name in kind.takes))
    if unit is not None and "unit" not in kind.takes:
        return recording.of_unit(unit)
    return replace(recording, notes=(*recording.notes, *all_findings(recording)))


def _together(paths: "Sequence[str | os.PathLike[str]]", profile: "Profile | str | Path | None") -> Recording:
    """Recording of files that hold a sensor each: by a profile of all, or by what each says of itself."""
    from plumbob.files.foreign.logged import joined_recordings
    from plumbob.files.text import read_text

    if len(paths) == 1:
        return read(paths[0], profile=profile)
    if profile is not None:
        joined = read_text([Path(path) for path in paths], profile)
    else:
        joined = joined_recordings([read(path) for path in paths], Path(paths[0]).stem)
    return replace(joined, notes=(*lasting(joined.notes), *all_findings(joined)))


def write(
    path: str | os.PathLike[str],
    what: Recording | ImuData | ImuArray | AttitudeTrack,
    *,
    notes: Iterable[Finding | str] = (),
    overwrite: bool = False,
) -> Path:
    """Write a recording, samples of a unit or of an array, or an attitude; the file appears whole or not at all.

    Parameters
    ----------
    path : path
        The file; its suffix says the format.
    what : Recording, ImuData, ImuArray or AttitudeTrack
        The content; of an array, ``.parquet`` holds all units.
    notes : iterable of Finding or str
        Provenance to add.
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
        If the notes are neither findings nor lines of text.
    """
    added, file = as_findings("notes", notes), check.path("path", path)
    suffix = file.suffix.lower() or "."
    kinds = chain(FORMATS, _of_suffix(suffix))
    writer = next((writer for kind in kinds for written, writer in kind.writers if written == suffix), None)
    if writer is None:
        if not any(_of_suffix(suffix)):
            raise _unknown(file)
        listed = ", ".join(written for kind in FORMATS for written, _ in kind.writers)
        raise DecodeError(f"{file}: {file.suffix} is not among {listed}; plumbob.convert writes more.")
    parts: dict[str, type[Any]] = {"array": ImuArray, "imu": ImuData, "track": AttitudeTrack}
    part = {key: what for key, kind in parts.items() if isinstance(what, kind)}
    if part:
        recording = Recording(name=file.stem, **part)
    else:
        recording = check.kind("what", what, Recording, hint="An ImuData or an AttitudeTrack will do, too.")
    _named(writer)(file, replace(recording, notes=(*recording.notes, *added)), overwrite)
    return file


def kind_of(path: str | os.PathLike[str], *, described: bool = False) -> FileFormat:
    """Format of a file or a folder, by its suffix, and by its content where several share that.

    A text table whose profile lies beside it or is given (`described`) is one, whatever its columns look like.
    UnknownFormatError if no format of its suffix knows its content; DecodeError if there is none, or it is empty.
    """
    file = check.path("path", path)
    suffix = "" if file.is_dir() else file.suffix.lower() or "."
    if suffix not in ("", ".parquet") and not described and any(map(Path.is_file, sidecars(file))):
        from plumbob.files.profile import profiles_beside

        described = suffix != "." or bool(profiles_beside(file))
    kinds: Iterable[FileFormat] = _of_suffix(suffix)
    if suffix:
        usual = _BUILTIN.get(suffix, [])
        is_known = described or bool(usual or EXTENSIBLE.find(suffix[1:]))
        if is_known or suffix == ".":
            existing_file(file)
        if not is_known:
            raise _unknown(file)
        if described:
            from plumbob.files.arrow import holds_recording

            usual = [] if suffix == ".parquet" and holds_recording(file) else usual
            kinds = [kind for kind in usual if "profile" in kind.takes] or [*kinds]
            kinds = kinds or [kind for kind in FORMATS if kind.name == "text"]
    tried = []
    with reading(file):
        for kind in kinds:
            by_profile = "profile" in kind.takes
            if not (by_profile and file.stat().st_size == 0) and ((described and by_profile) or kind.claims(file)):
                return kind
            tried.append(kind.name)
    names = ", ".join(tried)
    if file.is_dir():
        raise UnknownFormatError(
            f"{file} is a folder, and not one of {names}; name one file in it, or those of its sensors."
        )
    if file.stat().st_size == 0:
        raise DecodeError(f"{file} is empty: it has 0 bytes; use an intact copy.")
    hint = f"file that is known, which are {names}; 'plumbob profile' drafts what a table of another program needs."
    raise _unknown(file, f"its content is not that of a '{file.suffix}' {hint}")


def is_recording(path: Path) -> bool:
    """Whether a path may be that of a recording: by its suffix, or by its content where others use that, too."""
    suffix, is_there = "" if path.is_dir() else path.suffix.lower() or ".", path.is_dir() or path.is_file()
    if any(kind.accepts is None for kind in _BUILTIN.get(suffix, [])):
        return True
    return any(not is_there or kind.claims(path) for kind in _of_suffix(suffix))


def is_known_log(file: Path) -> bool:
    """Whether a text file is of a form that is known by its content and needs no profile."""
    from plumbob.files.draft import known_profile

    looking = (kind for kind in _of_suffix(file.suffix.lower()) if kind.accepts)
    return any(kind.claims(file) for kind in looking) or known_profile(file) is not None


def _unknown(path: Path, why: str = "") -> UnknownFormatError:
    """Error of a kind that nobody reads, by its first bytes, because of its content, or by its suffix."""
    from plumbob.files.known_logs import refuse_known
    from plumbob.files.numbers import SUFFIXES

    if path.is_file():
        refuse_known(path)
    if why:
        return UnknownFormatError(f"{path}: {why}")
    hint = " Plain numbers are not a recording; 'plumbob allan' takes them." if path.suffix.lower() in SUFFIXES else ""
    hint += " Save a spreadsheet's table as .xlsx or .csv." if path.suffix.lower() in (".xls", ".ods") else ""
    return UnknownFormatError(
        f"{path}: the suffix '{path.suffix}' is unknown; known: {', '.join(suffixes())}; tables "
        f"called otherwise take --profile (plumbob profile drafts one), raw bytes 'plumbob record --from'.{hint}"
    )


def suffixes() -> Sequence[str]:
    """Suffixes of all formats; those of other packages come last."""
    listed = dict.fromkeys(suffix for kind in FORMATS for suffix in kind.suffixes if suffix)
    return list(listed | dict.fromkeys(f".{name}" for name in EXTENSIBLE.added()))


def is_own(path: Path) -> bool:
    """Whether a path is that of a recording by Plumbob, whole or damaged, and not of another program's MCAP."""
    ros = _BUILTIN[".mcap"][0]
    return path.suffix.lower() == ".mcap" and not (path.is_file() and ros.claims(path))
