"""Write a recording as CSV with units in its header, and beside it the profile that reads it back to the bit.

Of MATLAB and NetCDF, whose arrays have names and units, `plumbob.files.arrays` writes the same profile into the file.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import replacing_all, sidecars
from plumbob.core.findings import TEXT, Finding, Value
from plumbob.core.schema import toml_text
from plumbob.core.text import visible
from plumbob.core.time import to_s
from plumbob.data import TRIADS, AttitudeTrack, ImuData, ImuMeta
from plumbob.data.cards import UNITS
from plumbob.data.recording import Recording, stored_notes
from plumbob.files.arrow import arrow_column
from plumbob.files.columns import COLUMNS, GROUPS, TIME, Columns, to_columns
from plumbob.files.header import plain_meta

_FORMULA: Final = ("=", "+", "-", "@")
ARRAY_NAMES: Final = {"q": "q_nb", "bias": "bias_b", "cov": "cov_b"}
"""What the table of a group of columns is called among named arrays, where not as the group is."""
_PLACES: Final = (
    dict(zip(COLUMNS, COLUMNS, strict=True))
    | {
        name: f"{ARRAY_NAMES.get(group, group)}[{k}]"
        for group, names in GROUPS.items()
        for k, name in enumerate(names, 1)
    }
    | {TIME: "time"}
)


def write_csv(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write ``NAME.csv`` and ``NAME.profile.toml``; errors as of `plumbob.write`, and beside another profile."""
    columns = columns_of_unit(path, recording)
    other, profile = sidecars(path)
    if other.exists():
        raise DecodeError(f"{path} would have two profiles, {other.name} and {profile.name}; choose another name.")
    # The profile takes its name first: alone it reads nothing, where a table alone would be read by guess.
    with replacing_all(profile, path, overwrite=overwrite) as (profile_file, csv_file):
        profile_file.write_bytes(_encoded(table_profile(recording, columns)))
        with csv_file.open("wb") as stream:
            stream.write(_encoded("".join(f"{line}\n" for line in _head(path, recording, columns))))
            _write_numbers(stream, columns)


def columns_of_unit(path: Path, recording: Recording) -> Columns:
    """Columns of a recording of one unit; ParameterError if there are several."""
    if recording.array is not None:
        raise ParameterError(
            f"{path}: such a file holds one unit, and there are {', '.join(recording.array.names)}. Write .parquet "
            "instead, or choose one with --unit."
        )
    return to_columns(recording)


def text_cell(text: str) -> str:
    """Cell that neither a spreadsheet nor a terminal takes for a command, on one line, quoted where it must be."""
    words = visible(" ".join(text.split()))
    cell = f"'{words}" if words.startswith(_FORMULA) else words
    return '"' + cell.replace('"', '""') + '"' if any(sign in cell for sign in ',;\t"') else cell


def _head(path: Path, recording: Recording, columns: Columns) -> Iterator[str]:
    yield f"# recording,{text_cell(recording.name or path.stem)}"
    if recording.imu is not None:
        yield f"# device,{text_cell(recording.imu.meta.device)}"
    for note in stored_notes(recording):
        yield f"# note,{text_cell(str(note))}"
    yield ",".join(_title(name) for name in columns)


def _title(name: str) -> str:
    if name == TIME:
        return "t [s]"
    unit = COLUMNS[name].unit
    return name if unit == "1" else f"{name} [{unit}]"


def _write_numbers(stream: Any, columns: Columns) -> None:
    import pyarrow as pa
    from pyarrow import csv

    numbers = {name: values.astype(np.uint8) if values.dtype == bool else values for name, values in columns.items()}
    numbers[TIME] = to_s(columns[TIME])
    table = pa.table({name: arrow_column(values) for name, values in numbers.items()})
    csv.write_csv(table, stream, csv.WriteOptions(include_header=False, quoting_style="none"))


def table_profile(recording: Recording, columns: Columns, *, arrays: bool = False) -> str:
    """Profile that reads columns back: from a CSV file, or from the named arrays that they are in."""
    lines = [f"# Reads the {'arrays' if arrays else 'CSV file'} of the same name. SI and radians, uT, degC."]
    lines += ["format_version = 1"]
    lines += ["arrays = true"] if arrays else ['separator = ","', 'comment = "#"', f"rows = {columns[TIME].size}"]
    if recording.imu is not None:
        lines += _meta(plain_meta(recording.imu.meta))
    lines += [f"notes = [{', '.join(map(inline_toml, stored_notes(recording)))}]"]
    lines += [] if arrays else ["", "[header]", "names = true"]
    names = _PLACES if arrays else {name: _title(name) for name in COLUMNS}
    lines += ["", "[time]", f"column = {toml_text(names[TIME])}", 'unit = "s"']
    if recording.imu is not None:
        lines += _samples(recording.imu, names)
    if recording.track is not None:
        lines += _reference(recording.track, names)
    return "\n".join([*lines, ""])


def _meta(meta: ImuMeta) -> Iterator[str]:
    yield f"device = {toml_text(meta.device)}"
    yield f"axes = {toml_text(meta.axes)}"
    yield "axes_applied = true"
    yield f"t0_ns = {meta.t0_ns}"
    yield f"unit_check = {str(meta.unit_check).lower()}"
    for key in ("frame", "north", "calibration", *(f"{name}_left" for name in TRIADS)):
        if (value := getattr(meta, key)) is not None:
            yield f"{key} = {toml_text(value) if isinstance(value, str) else list(value)}"
    if meta.declination is not None:
        yield f'declination = "{meta.declination!r} rad"'
    if meta.rate_nominal is not None:
        yield f'rate_nominal = "{meta.rate_nominal!r} Hz"'


def _samples(imu: ImuData, names: Mapping[str, str]) -> Iterator[str]:
    meta = plain_meta(imu.meta)
    for name in imu.triads:
        yield from ("", f"[{name}]", _listed(name, names), f'unit = "{UNITS[name]}"')
        full_scale = getattr(meta, f"{name}_range")
        if full_scale is not None:
            yield f"range = {_range(full_scale, UNITS[name])}"
        if name == "acc":
            yield 'sign = "specific-force"'
    if imu.temp_c is not None:
        yield from ("", "[temperature]", f"column = {toml_text(names['temp_c'])}", 'unit = "degC"')
    yield from ("", "[flags]", 'column = "flags"')


def _range(full_scale: float | tuple[float, ...], unit: str) -> str:
    if isinstance(full_scale, tuple):
        return f"[{', '.join(_range(axis, unit) for axis in full_scale)}]"
    return f'"{full_scale!r} {unit}"'


def _reference(track: AttitudeTrack, names: Mapping[str, str]) -> Iterator[str]:
    yield from ("", "[reference]", _listed("q", names), 'order = "wxyz"')
    yield from (f'frame = "{track.frame}"', f'north = "{track.north}"', f"source = {toml_text(track.source)}")
    if track.flags is not None:
        yield 'flags = "track_flags"'
    if track.score is not None:
        yield 'score = "score"'
    if track.mag_weight is not None:
        yield 'mag_weight = "mag_weight"'
    if track.bias_b is not None:
        yield from ("", "[reference.bias]", _listed("bias", names), f'unit = "{UNITS["gyr"]}"')
    if track.cov_b is not None:
        yield from ("", "[reference.covariance]", _listed("cov", names), 'angle_unit = "rad"')


def _listed(group: str, names: Mapping[str, str]) -> str:
    return f"columns = [{', '.join(toml_text(names[name]) for name in GROUPS[group])}]"


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "replace")


def inline_toml(finding: Finding) -> str:
    """A finding as a value in TOML: a text that somebody wrote is a string, any other a table."""
    if finding.code == TEXT:
        return toml_text(str(finding))
    parts = ", ".join(f"{name} = {_toml(value)}" for name, value in finding.values.items() if value is not None)
    head = f"code = {toml_text(finding.code)}, severity = {toml_text(finding.severity)}"
    return f"{{ {head}, values = {{ {parts} }}, text = {toml_text(str(finding))} }}"


def _toml(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return toml_text(value)
    return f"[{', '.join(map(toml_text, value))}]" if isinstance(value, tuple) else repr(value)
