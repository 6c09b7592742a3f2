"""Recordings as named arrays of MATLAB (v5 and v7.3), HDF5, NetCDF-4 and NumPy (.npz, .npy): by a profile in TOML.

The container says names, shapes and types, and nothing of units, frames or clocks; the profile says these. In a table
of several columns, its longer side is that of time.

A recording is written as MATLAB v5 or NetCDF-4: `time` in s, tables with a row for each sample, their units, and in
`PROFILE` the profile that reads them back. NetCDF follows the CF conventions 1.11; these know no name for what an IMU
measures, so only the time, the angles of a platform and flags have a standard_name. Discrete sampling geometries
(featureType) need a place in latitude and longitude, which a recording does not have.
"""

import io
import math
import re
from collections import Counter
from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.errors import DecodeError, UnknownFormatError, excerpt
from plumbob.core.files import existing_file, reading, replacing
from plumbob.core.resources import guide
from plumbob.core.series import needed
from plumbob.core.text import counted
from plumbob.core.time import to_s
from plumbob.core.units import to_deg
from plumbob.data.recording import Recording, stored_notes
from plumbob.files.arrays import PROFILE, Arrays, open_arrays
from plumbob.files.columns import COLUMNS, GROUPS, TIME
from plumbob.files.known_logs import KNOWN_ARRAYS, KNOWN_TABLES
from plumbob.files.profile import ColumnRef, Profile, TextLayout, parse_profile, profiles_beside
from plumbob.files.sniff import FEWEST, ROWS, Sample
from plumbob.files.text import ARRAY_NAMES, columns_of_unit, table_profile, table_recording, text_profile
from plumbob.files.text_table import TextTable
from plumbob.rotations import Frame

_COLUMN: Final = re.compile(r"(?P<name>.+?)\[(?P<number>[1-9]\d{0,3})(?: of (?P<count>\d+))?\]")
_INSIDE: Final = "in the file itself"  # origin of a profile that a file of Plumbob holds


def read(path: Path, profile: Profile | str | Path | None = None) -> Recording:
    """Read named arrays as their profile, or that of arrays known by their names, describes them."""
    file = existing_file(path)
    with reading(file):
        container = open_arrays(file)
        if profile is None and (container.profile or not profiles_beside(file)):
            profile = _profile_by_names(container)
    declared, note = text_profile(file, profile)
    with reading(file):
        if not declared.arrays:
            raise DecodeError(f"{declared.origin} describes a text file; for arrays, write arrays = true instead.")
        if declared.texts:
            raise DecodeError(f"{declared.origin} names columns of text, but arrays hold numbers; use time.unit.")
        return table_recording(declared, _table(declared, container), file.stem, note)


def _profile_by_names(container: Arrays) -> Profile:
    """Profile that the file holds, or that of a data set whose arrays are known by their names; refused without one."""
    if container.profile:
        return parse_profile(container.profile, origin=_INSIDE)
    for origin, data_set in KNOWN_ARRAYS.items():
        if not {*data_set["names"]} <= container.shapes.keys():
            continue
        text = data_set["profile"]
        for key in re.findall(r"\{(\w+)\}", text):
            single = math.prod(container.shapes.get(key, (0,))) == 1
            number = float(container.load([key])[key].ravel()[0]) if single else math.nan
            if not 0.0 < number < math.inf:
                raise DecodeError(f"{key} must be one number above 0; the file holds {container.summary()}.")
            text = text.replace(f"{{{key}}}", repr(number))
        return parse_profile(text, origin=origin)
    raise UnknownFormatError(
        f"arrays do not say their units, so they need --profile FILE.toml with arrays = true; "
        f"{guide('vendor-files.md')} shows one. The file holds {container.summary()}. Plain numbers of a unit "
        "at rest are for 'plumbob allan', with --rate and --scale."
    )


def array_sample(path: Path) -> Sample:
    """First rows of a file's arrays of one time line, by columns such as ``gyr[1]``, and what single numbers it has."""
    container = open_arrays(path)
    shapes = container.shapes
    sizes = Counter(max(shape) for shape in shapes.values() if shape and max(shape) >= FEWEST)
    if not sizes:
        raise DecodeError(f"it holds no array of samples; it holds {container.summary()}.")
    rows = sizes.most_common(1)[0][0]
    chosen = sorted(name for name, shape in shapes.items() if len(shape) <= 2 and max(shape, default=0) == rows)
    single = sorted(name for name, shape in shapes.items() if np.prod(shape, dtype=np.int64) == 1)
    single = [name for name in single if (of := name.rpartition("/")[0]) in chosen or of not in shapes]
    content = container.load([*chosen, *single])
    columns: dict[str, list[str]] = {}
    for name in chosen:
        table = _upright(name, content[name])[0][:ROWS]
        for k in range(table.shape[1]):
            columns[name if table.shape[1] == 1 else f"{name}[{k + 1}]"] = [repr(float(v)) for v in table[:, k]]
    facts = {name.rpartition("/")[2].lower(): repr(float(content[name].ravel()[0])) for name in single}
    lines = [list(row) for row in zip(*columns.values(), strict=True)]
    units = [container.units.get(re.sub(r"\[\d+\]$", "", name), "") for name in columns]
    return Sample(TextLayout(separator=""), tuple(columns), tuple(units), True, lines, facts)


def _table(profile: Profile, container: Arrays) -> TextTable:
    upright = profile.origin == _INSIDE
    places = {ref: _place(ref, container, upright=upright) for ref in profile.used}
    content = container.load(sorted({name for name, _ in places.values()}))
    tables = {name: _upright(name, array, upright=upright) for name, array in content.items()}
    rows = {name: len(table) for name, (table, _) in tables.items()}
    if len(set(rows.values())) > 1:
        sizes = ", ".join(f"{name} {count}" for name, count in rows.items())
        raise DecodeError(f"its arrays have different lengths: {sizes}; a profile describes arrays of one time line.")
    columns: dict[ColumnRef, Any] = {}
    zero = Decimal(0)
    for ref, (name, number) in places.items():
        column = tables[name][0][:, number - 1]
        if ref == profile.time.exact and column.size:
            zero = Decimal(column[0].item())
            column = column - column[0]
        columns[ref] = np.asarray(column, dtype=np.float64)
    turned = tuple(f"{name} has its samples side by side, and was turned" for name, (_, was) in tables.items() if was)
    return TextTable(columns, zero, next(iter(rows.values()), 0), turned, {}, lambda row: row + 1)


def _place(ref: ColumnRef, container: Arrays, *, upright: bool) -> tuple[str, int]:
    """Array and number of its column, from 1; a name alone has one column, ``[1 of 3]`` is of just three."""
    if not isinstance(ref, str):
        raise DecodeError(f"{ref} is the number of a column; an array has a name, as in 'gyr[{ref}]'.")
    match = _COLUMN.fullmatch(ref) if ref not in container.shapes else None
    name, number, stated = (match["name"], int(match["number"]), match["count"]) if match else (ref, 1, "1")
    if name not in container.shapes:
        kind = container.others.get(name)
        why = f"is not an array of numbers but a {kind}" if kind else "is not in the file"
        raise DecodeError(f"{excerpt(name)} {why}; the file holds {container.summary()}.")
    shape = container.shapes[name]
    count = (shape[1] if upright else min(shape)) if len(shape) == 2 else 1
    if number > count or stated not in (None, str(count)):
        raise DecodeError(
            f"{name} has {counted(count, 'column')}, but needs {stated or number}; say which are meant, as in "
            f'columns = ["{name}[1]", ...].'
        )
    return name, number


def _upright(name: str, array: NDArray[Any], *, upright: bool = False) -> tuple[NDArray[Any], bool]:
    """Table of a row for each sample, and whether it lay on its side."""
    if array.ndim > 2 or array.ndim == 0 or array.size == 0:
        raise DecodeError(f"{name} has shape {array.shape}, but it must be samples, or samples and columns.")
    if array.ndim == 1:
        return array[:, np.newaxis], False
    aside = array.shape[0] < array.shape[1] and not upright
    return (array.T if aside else array), aside and array.shape[0] > 1


def _tables(path: Path, recording: Recording) -> tuple[dict[str, tuple[NDArray[Any], str]], str]:
    """Arrays of a recording with units, (N,) or (N, …) of a group of columns; and the profile that reads them."""
    columns = columns_of_unit(path, recording)
    tables = {"time": (to_s(columns[TIME]), "s")}
    single = dict.fromkeys(name for name in columns if name != TIME)
    for group, names in GROUPS.items():
        if names[0] in columns:
            table = np.stack([columns[name] for name in names], axis=1)
            tables[ARRAY_NAMES.get(group, group)] = table, COLUMNS[names[0]].unit
            single = {name: None for name in single if name not in names}
    tables |= {name: (columns[name], COLUMNS[name].unit) for name in single}
    tables = {name: (v.astype(np.uint8) if v.dtype == bool else v, unit) for name, (v, unit) in tables.items()}
    return tables, table_profile(recording, columns, arrays=True)


def write_mat(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write named arrays as MATLAB v5: `time` (s), `gyr`, `acc`, `q_nb` and so on, and the struct `units`."""
    from scipy.io import savemat

    tables, profile = _tables(path, recording)
    content: dict[str, Any] = {name: table for name, (table, _) in tables.items()}
    content |= {"units": {name: unit for name, (_, unit) in tables.items()}, PROFILE: profile}
    stream: Any = io.BytesIO()
    savemat(stream, content, do_compression=True, oned_as="column")
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(stream.getvalue())


_LONG_NAMES: Final[Mapping[str, str]] = KNOWN_TABLES["long_names"]
_LABELS: Final = {3: ("axis", "xyz"), 4: ("component", "wxyz"), 9: ("pair", [a + b for a in "xyz" for b in "xyz"])}


def write_netcdf(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write named arrays as NetCDF-4 by the CF conventions 1.11; MissingExtraError without h5netcdf."""
    tables, profile = _tables(path, recording)
    imu, track = recording.imu, recording.track
    t0_ns = 0 if imu is None else imu.meta.t0_ns
    about: dict[str, dict[str, Any]] = {name: {"long_name": words} for name, words in _LONG_NAMES.items()}
    about |= {"time": utc_since(t0_ns)} if t0_ns else {}
    for name in {"flags", "track_flags"} & tables.keys():
        masks, meanings = np.array([*flags.MEANING], np.uint32), " ".join(name for name, _ in flags.MEANING.values())
        about[name] = {"standard_name": "quality_flag", "flag_masks": masks, "flag_meanings": meanings}
    if track is not None:
        about["q_nb"] = {"long_name": f"rotation from body axes to {track.frame}, heading from {track.north} north"}
        senses = {"yaw": "starboard", "pitch": "up"} if track.frame is Frame.NED else {"yaw": "port", "pitch": "down"}
        for name, angle in zip(("yaw", "pitch", "roll"), to_deg(track.euler_zyx).T, strict=True):
            tables[name] = angle, "degree"
            sense = f"fore_{senses[name]}" if name in senses else "starboard_down"  # that of its frame's axes
            about[name] = {"standard_name": f"platform_{name}_{sense}"}
    variables: dict[str, CfVariable] = {
        name: CfVariable((name,), np.array([*labels], object), {}) for name, labels in _LABELS.values()
    }
    for name, (table, unit) in tables.items():
        dimensions = ("time", *(_LABELS[width][0] for width in table.shape[1:]))
        variables[name] = CfVariable(dimensions, table, {"units": unit} | about.get(name, {}))
    made = {"device": imu.meta.device} if imu is not None else {}
    made |= {"source": track.source} if track is not None else {}
    made |= {"history": notes} if (notes := "\n".join(map(str, stored_notes(recording)))) else {}
    write_cf(path, variables, {"title": recording.name or path.stem, PROFILE: profile} | made, overwrite=overwrite)


class CfVariable(NamedTuple):
    """Values of a NetCDF file along its dimensions, with what is said of them."""

    dimensions: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, Any]


def utc_since(t0_ns: int) -> dict[str, str]:
    """What is said of times that count in seconds from this UTC, ns since 1970."""
    since = f"seconds since {str(np.datetime64(t0_ns, 'ns')).replace('T', ' ')}"
    clock = {"units": since, "standard_name": "time", "axis": "T", "calendar": "standard"}
    return clock | {"units_metadata": "leap_seconds: none"}


def write_cf(
    path: Path, variables: Mapping[str, CfVariable], about: Mapping[str, Any], *, overwrite: bool = False
) -> None:
    """Write NetCDF-4 by the CF conventions 1.11; numbers with a unit, but coordinates, are NaN where not known.

    MissingExtraError without h5netcdf.
    """
    h5netcdf, h5py = (needed(name, "NetCDF files", "plumbob[netcdf]") for name in ("h5netcdf", "h5py"))
    stream = io.BytesIO()
    with h5netcdf.File(stream, "w") as file:
        file.dimensions = {
            name: size for each in variables.values() for name, size in zip(each[0], each.values.shape, strict=True)
        }
        for name, (dimensions, values, attributes) in variables.items():
            is_text, is_table = values.dtype == object, bool(dimensions) and "units" in attributes
            fill = math.nan if values.dtype == np.float64 and is_table and name not in dimensions else None
            variable = file.create_variable(
                name, dimensions, h5py.string_dtype() if is_text else None, data=values, fillvalue=fill,
                compression="gzip" if is_table else None,
            )  # fmt: skip
            variable.attrs.update(attributes)
        file.attrs.update({"Conventions": "CF-1.11", **about})
    with replacing(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(stream.getvalue())
