"""What a native recording says about itself besides its numbers: one strict JSON object."""

import json
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from plumbob.core import schema
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError
from plumbob.core.findings import as_json, note
from plumbob.core.schema import Parse
from plumbob.data import ImuMeta
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.cards import NoiseCard
from plumbob.data.cards.file import strict_json
from plumbob.data.recording import Recording, stored_notes
from plumbob.files.columns import column
from plumbob.rotations import Frame, North

KIND: Final = "plumbob recording"
FORMAT_VERSION: Final = 1
ARRAY_VERSION: Final = 2  # of recordings of several units; others stay as they were, so that older programs read them


def file_header(recording: Recording, columns: list[str]) -> dict[str, Any]:
    """Header of a recording with these columns."""
    imu, track, array = recording.imu, recording.track, recording.array
    several = {} if array is None else {"format_version": ARRAY_VERSION, "array": array_told(array)}
    return {
        "kind": KIND,
        "format_version": FORMAT_VERSION,
        "units": {name: column(name).unit for name in columns},
        "imu": None if imu is None else asdict(plain_meta(imu.meta)),
        "track": None if track is None else _storable(TRACK, "track", {key: getattr(track, key) for key in _TRACK}),
        "notes": as_json(stored_notes(recording)),
    } | several


def array_told(array: ImuArray) -> list[dict[str, Any]]:
    """What a file says of each unit of an array besides its numbers."""
    units = []
    for name, imu in array.units.items():
        mount = array.mounts[name]
        said = {key: getattr(mount, key) for key in ("q_bs", "lever_b", "clock_offset")}
        said["noise"] = None if mount.noise is None else json.loads(mount.noise.text())
        units.append({"name": name, "imu": asdict(plain_meta(imu.meta)), "mount": said})
    return units


def plain_meta(meta: ImuMeta) -> ImuMeta:
    """Meta with Python's own types instead of NumPy's; ParameterError where no file can keep one."""
    plain: ImuMeta = _storable(META, "meta", asdict(meta))
    return plain


def _storable(parse: Parse, where: str, values: dict[str, Any]) -> Any:
    try:
        return parse(where, {key: _plain(value) for key, value in values.items()})
    except PlumbobError as error:
        raise ParameterError(f"{str(error).rstrip('.')}; a file cannot keep it otherwise.") from error


def _plain(value: Any) -> Any:
    """The same with lists and Python's own types."""
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def dump(content: dict[str, Any]) -> bytes:
    """Canonical JSON: equal content gives equal bytes."""
    return json.dumps(content, sort_keys=True, allow_nan=False, separators=(",", ":")).encode()


def load(raw: bytes) -> dict[str, Any]:
    """Parse a header; DecodeError if it is damaged, not a native recording, or of a newer version."""
    try:
        content = strict_json(raw)
    except (ValueError, RecursionError) as error:
        raise DecodeError(f"its header is damaged ({error}); use an intact copy.") from error
    if not isinstance(content, dict) or content.get("kind") != KIND:
        raise DecodeError(f"its header does not say '{KIND}'; write the data again as a native recording.")
    version = content.get("format_version")
    if type(version) is not int:
        raise DecodeError("its header has no format_version; use an intact copy.")
    if version not in (FORMAT_VERSION, ARRAY_VERSION):
        raise DecodeError(
            f"it has format_version {version}, but this program reads up to {ARRAY_VERSION}; update Plumbob to read it."
        )
    return content


def parsed(parse: Parse, where: str, content: Any) -> Any:
    """What a parser such as `META` makes of a part of a header; errors say that it is one."""
    try:
        return parse(where, content)
    except PlumbobError as error:
        raise type(error)(f"its header: {str(error).rstrip('.')}; write the file again.") from error


def parse_header(content: dict[str, Any]) -> dict[str, Any]:
    """Values of a header that `load` has read, with objects for the meta; errors as of `parsed`."""
    values: dict[str, Any] = parsed(_HEADERS[content["format_version"]], "", content)
    for key, parse in (("imu", META), ("track", TRACK), ("array", ARRAY)):
        if values.get(key) is not None:
            values[key] = parsed(parse, key, values[key])
    if "array" in values and values["imu"] is not None:
        raise DecodeError("its header has both one unit and several; write the file again.")
    return values


def _array(units: tuple[dict[str, Any], ...]) -> dict[str, tuple[ImuMeta, UnitMount]]:
    by_name = {unit["name"]: (unit["imu"], unit["mount"]) for unit in units}
    if len(by_name) < len(units):
        raise DecodeError("a unit is named twice.")
    return by_name


META: Final = schema.table(ImuMeta, required=[key for key in schema.keys(ImuMeta) if not key.endswith("_left")])
_TRACK: Final = {"frame": schema.converted(Frame.parse), "north": schema.converted(North.parse), "source": schema.text}
TRACK: Final = schema.form(_TRACK, _TRACK)  # parser of frame, heading reference and source of a track
_NOISE: Final = schema.optional(lambda where, value: NoiseCard.from_text(json.dumps(value), where))
_MOUNT: Final = schema.table(UnitMount, required=("q_bs", "lever_b", "clock_offset", "noise"), noise=_NOISE)
_UNIT: Final = {"name": schema.text, "imu": META, "mount": _MOUNT}
ARRAY: Final = schema.converted(_array, schema.tables(schema.form(_UNIT, _UNIT)))
_HEADER: Final = {
    "kind": schema.text,
    "format_version": schema.whole(),
    **dict.fromkeys(("units", "imu", "track"), schema.anything),
    "notes": schema.listed(note, of="findings"),
}
_HEADERS: Final = {
    version: schema.form(_HEADER | more, (*_HEADER, *more), name="it")
    for version, more in ((FORMAT_VERSION, {}), (ARRAY_VERSION, {"array": schema.anything}))
}
