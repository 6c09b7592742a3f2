"""One door to recordings: a file of any format, or the bytes of a live stream, decoded again; one unit, or an array."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.core import check
from plumbob.core.errors import ClockError, DecodeError, ParameterError
from plumbob.core.findings import Finding, warnings
from plumbob.files.formats import is_own
from plumbob.files.formats import read as read_samples

if TYPE_CHECKING:
    from plumbob.data import ImuData
    from plumbob.data.array import ImuArray, UnitMount
    from plumbob.data.recording import Recording
    from plumbob.files import Profile


def read(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    profile: "Profile | str | Path | None" = None,
    whole: bool = True,
    unit: str | None = None,
    calibrated: bool = False,
    estimated: bool = False,
) -> "Recording":
    """Read a file of any format, a recorded stream too: its samples are decoded again from their bytes.

    A file of several units gives them as `Recording.array`, unless one is asked for; who takes one alone goes on with
    `Recording.of_unit`, which refuses several.

    Parameters
    ----------
    path : path or sequence of paths
        The file, whose suffix says the format; or files of one recording, with a sensor each.
    profile : Profile or path, optional
        What the columns of a text file mean; one that lies beside it is found.
    whole : bool
        Whether all is to be in memory; without it, the samples of a ``.parquet`` recording that has no attitude stay in
        their file: slices and `ImuData.chunks` read them part by part.
    unit : str, optional
        One of several units, by name or number from 1; or another source of a recorded stream, by its name.
    calibrated : bool
        Whether the cards that the session of a recorded stream names are applied.
    estimated : bool
        Whether the track of a recorded stream is what was estimated as it came, and not what the device said.

    Returns
    -------
    Recording
        Samples, attitude, or both, and notes of what a reader should know.

    Raises
    ------
    DecodeError
        If the file cannot be read, or is not what its suffix says.
    ParameterError
        If `path` is not a path, the format takes no profile, or there is no such unit.
    MissingExtraError
        If the format needs a package that is not installed.
    """
    if isinstance(path, Sequence) and not isinstance(path, str):
        return read_samples([check.path("path", item) for item in path], profile=profile)
    file = check.path("path", path)
    if is_own(file):
        from plumbob.live.recorded import read_recorded

        return read_recorded(file, unit=unit, calibrated=calibrated, estimated=estimated)
    return read_samples(file, profile=profile, whole=whole, unit=unit)


def with_load(imu: "ImuData", path: Path, names: Sequence[str], profile: "Profile | str | Path | None") -> "ImuData":
    """Samples with those columns of their text file that are a load, as throttle; errors as of `read`."""
    from plumbob.files.formats import kind_of, resolved_profile
    from plumbob.files.text import read_loads

    if (kind := kind_of(path, described=profile is not None).name) != "text":
        raise ParameterError(
            f"{path} is {kind}, of which no columns are taken for a load; in Python give ImuData its load."
        )
    return replace(imu, load=read_loads(path, names, resolved_profile(path, profile)))


Source = str | os.PathLike[str]


def opened_array(array: "ImuArray | Source | Sequence[Source] | Mapping[str, Source]") -> "ImuArray":
    """Recording of several units, read where it is named; errors as of `read_array`."""
    from plumbob.data.array import ImuArray

    return array if isinstance(array, ImuArray) else read_array(array)


def read_array(
    sources: Source | Sequence[Source] | Mapping[str, Source],
    *,
    mounts: "Source | Mapping[str, UnitMount] | None" = None,
    format: str | Path | None = None,
    rate: float | str | None = None,
    note: Callable[[str], object] | None = None,
) -> "ImuArray":
    """Read several units on one time line.

    Parameters
    ----------
    sources : path, sequence of path, or mapping of str to path
        A file of several units, ``.parquet`` or ``.mcap``; a recorded stream (``.mcap``), whose bytes hold several, of
        whatever unit its attitude is; raw bytes, with `format`; or files of one unit each, called by their stems or as
        the mapping calls them.
    mounts : path, mapping of str to UnitMount, or the name of a preset, optional
        How the units sit on their bodies, in place of what the file says; a TOML file (`plumbob.data.array_toml`) may
        name calibration cards, too. ``"arm"``: the six of the teaching arm.
    format : str or path, optional
        What raw bytes mean: a device, a rig or a ``.toml`` file.
    rate : float or str, optional
        Frames per second of raw bytes, Hz, where the format has neither clock nor rate.
    note : callable, optional
        Called with each line of what a reader should know.

    Returns
    -------
    ImuArray
        Calibrated where cards are named: by the session of a stream, or by `mounts`.

    Raises
    ------
    DecodeError
        If a file cannot be read, or holds no samples.
    ClockError
        If files of one unit each are not on one time line.
    ParameterError
        If there are not several units where they should be, or a mount belongs to none.
    CalibrationError
        If a card does not fit the unit, or is applied a second time.
    """
    if not isinstance(sources, str | os.PathLike):
        array, notes = _joined(read_units(sources)), list[Finding]()
    elif format is not None:
        array, notes = _of_bytes(check.path("sources", sources), format, rate)
    else:
        array, notes = _of_file(check.path("sources", sources))
    for finding in warnings(notes) if note is not None else ():
        note(str(finding))  # type: ignore[misc]
    return array if mounts is None else _mounted(array, mounts)


def _by_stem(sources: Sequence[Source]) -> dict[str, Source]:
    named = {check.path("sources", source).stem: source for source in sources}
    if len(named) < len(sources):
        raise ParameterError(
            "two of the files have the same stem, by which their units are called; rename one, or in Python name the "
            "units: {'left': path, 'right': path}."
        )
    return named


def _of_file(file: Path) -> "tuple[ImuArray, list[Finding]]":
    if is_own(file):
        from plumbob.live.recorded import read_recorded

        recording = read_recorded(file, unit="all", calibrated=True)
    else:
        recording = read(file)
    if recording.array is None:
        raise ParameterError(
            f"{file} holds one unit; give one such file for each unit, or raw bytes with their format."
        )
    return recording.array, list(recording.notes)


def _of_bytes(file: Path, format: str | Path, rate: float | str | None) -> "tuple[ImuArray, list[Finding]]":
    from plumbob.live.recorded import decoded_note
    from plumbob.live.runner import run_stream
    from plumbob.live.session_toml import ALL, capture_session
    from plumbob.live.sinks import Collected
    from plumbob.live.sources import open_source
    from plumbob.live.stream import Stream

    session = capture_session(capture=file, format=format, rate=rate, unit=ALL)
    stream, collected = Stream(session), Collected()
    run_stream(stream, open_source(session.source), sinks=[collected])
    array = collected.array(calibrated=True)
    assert array is not None
    return array, [decoded_note(stream)]


def read_units(sources: "Sequence[Source] | Mapping[str, Source | ImuData]") -> "dict[str, ImuData]":
    """Units of files of one each, by the files' stems or as the mapping calls them; errors as of `read_array`."""
    from plumbob.data.imu import ImuData
    from plumbob.live.recorded import read_recorded

    units: dict[str, ImuData] = {}
    for name, source in (sources if isinstance(sources, Mapping) else _by_stem(sources)).items():
        if isinstance(source, ImuData):
            units[name] = source
            continue
        file = check.path("sources", source)
        recording = read_recorded(file, calibrated=True) if is_own(file) else read(file)
        imu = recording.of_unit(None).imu
        if imu is None:
            raise DecodeError(f"{source} holds an attitude but no sensor data.")
        units[name] = imu
    return units


def _joined(units: "dict[str, ImuData]") -> "ImuArray":
    """Units of files on one time line."""
    from plumbob.data.array import ImuArray

    starts = {imu.meta.t0_ns for imu in units.values()} - {0}
    if len(starts) > 1:
        raise ClockError(
            f"the files begin at different times, up to {(max(starts) - min(starts)) / 1e9:.9g} s apart, and an array "
            "has one time line. Put them on one first; plumbob.array.joined does that."
        )
    return ImuArray(units)


def _mounted(array: "ImuArray", mounts: "Source | Mapping[str, UnitMount]") -> "ImuArray":
    """The array with these mounts, and calibrated by the cards that stand beside them."""
    from plumbob.data.array import PRESETS, ImuArray
    from plumbob.data.array_toml import MountedUnit, load_units
    from plumbob.data.calibrated import apply_card

    if isinstance(mounts, Mapping):
        mounted = {name: MountedUnit(name, mount) for name, mount in mounts.items()}
    else:
        mounted = load_units(Path(mounts))
    units = dict(array.units)
    if str(mounts) in PRESETS:
        if not mounted.keys() & units.keys():
            raise ParameterError(
                f"the units of '{mounts}' are {', '.join(mounted)}, but those of the array are {', '.join(units)}; "
                "rename the mounts or the files, or write a mount for each in a TOML file."
            )
        mounted = {name: unit for name, unit in mounted.items() if name in units}  # one that died has been left out
    for name in mounted.keys() & units.keys():
        card, device = mounted[name].card, mounted[name].device
        if device:
            units[name] = units[name].corrected(meta=replace(units[name].meta, device=device))
        units[name] = units[name] if card is None else apply_card(card, units[name])
    return ImuArray(units, {**array.mounts, **{name: unit.mount for name, unit in mounted.items()}})
