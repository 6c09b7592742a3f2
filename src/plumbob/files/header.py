"""What a native recording says about itself besides its numbers: one strict JSON object."""

import json
import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from plumbob.core.errors import DecodeError, ParameterError, excerpt
from plumbob.data import ImuMeta, Range
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.cards import NoiseCard
from plumbob.data.recording import Recording, stored_notes
from plumbob.files.columns import column
from plumbob.rotations import Frame, North

KIND: Final = "plumbob recording"
FORMAT_VERSION: Final = 1
ARRAY_VERSION: Final = 2
"""Of recordings of several units; others stay as they were, so that older programs read them."""
_KEYS = ("kind", "format_version", "units", "imu", "track", "notes")
_MOUNT = ("q_bs", "lever_b", "clock_offset", "noise")


def file_header(recording: Recording, columns: list[str]) -> dict[str, Any]:
    """Header of a recording with these columns."""
    imu, track, array = recording.imu, recording.track, recording.array
    several = {} if array is None else {"format_version": ARRAY_VERSION, "array": array_told(array)}
    return {
        "kind": KIND,
        "format_version": FORMAT_VERSION,
        "units": {name: spec.unit for name in columns if (spec := column(name))},
        "imu": None if imu is None else asdict(plain_meta(imu.meta)),
        "track": None if track is None else {key: _storable(f"track.{key}", track, key, _TRACK[key]) for key in _TRACK},
        "notes": list(stored_notes(recording)),
    } | several


def array_told(array: ImuArray) -> list[dict[str, Any]]:
    """What a file says of each unit of an array besides its numbers."""
    return [
        {"name": name, "imu": asdict(plain_meta(imu.meta)), "mount": _mount_told(array.mounts[name])}
        for name, imu in array.units.items()
    ]


def _mount_told(mount: UnitMount) -> dict[str, Any]:
    noise = None if mount.noise is None else json.loads(mount.noise.text())
    return {
        "q_bs": list(mount.q_bs), "lever_b": list(mount.lever_b), "clock_offset": mount.clock_offset, "noise": noise,
    }  # fmt: skip


def array_from(content: Any) -> dict[str, tuple[ImuMeta, UnitMount]]:
    """Meta and mount of each unit, by name.

    Raises
    ------
    DecodeError
        If it is not what `array_told` gives.
    """
    units: dict[str, tuple[ImuMeta, UnitMount]] = {}
    for entry in content if isinstance(content, list) else [content]:
        unit = require_keys("'array' in its header", entry, ("name", "imu", "mount"))
        name = _typed("array.name", unit["name"], _text)
        if name in units:
            raise DecodeError(f"'array' in its header names the unit {excerpt(name)} twice; write the file again.")
        units[name] = meta_from(unit["imu"]), _mount_from(unit["mount"])
    return units


def _mount_from(content: Any) -> UnitMount:
    mount = require_keys("'mount' in its header", content, _MOUNT)
    noise = mount["noise"]
    return UnitMount(
        q_bs=_typed("mount.q_bs", mount["q_bs"], _numbers),
        lever_b=_typed("mount.lever_b", mount["lever_b"], _numbers),
        clock_offset=_typed("mount.clock_offset", mount["clock_offset"], _number),
        noise=None if noise is None else NoiseCard.from_text(json.dumps(noise), "the noise of a unit in its header"),
    )


def plain_meta(meta: ImuMeta) -> ImuMeta:
    """Meta with Python's own types instead of NumPy's.

    Raises
    ------
    ParameterError
        If a field has a type that no file can keep.
    """
    return ImuMeta(**{key: _storable(f"meta.{key}", meta, key, convert) for key, convert in _META.items()})


def dump(content: dict[str, Any]) -> bytes:
    """Canonical JSON: equal content gives equal bytes."""
    return json.dumps(content, sort_keys=True, allow_nan=False, separators=(",", ":")).encode()


def load(raw: bytes) -> dict[str, Any]:
    """Parse a header, refusing repeated keys, NaN and anything that is not an object.

    Raises
    ------
    DecodeError
        If it is damaged, not a native recording, or of a newer version.
    """
    try:
        content = json.loads(raw, parse_constant=_no_constant, parse_float=_finite, object_pairs_hook=_no_repetition)
    except (ValueError, RecursionError) as error:
        raise DecodeError(f"its header is damaged ({error}); take a copy that is whole.") from error
    if not isinstance(content, dict) or content.get("kind") != KIND:
        raise DecodeError(f"its header does not say '{KIND}'; write the data again as a native recording.")
    version = content.get("format_version")
    if not _is_int(version):
        raise DecodeError("its header has no format_version; take a copy that is whole.")
    if version not in (FORMAT_VERSION, ARRAY_VERSION):
        raise DecodeError(
            f"it has format_version {version}, but this program reads up to {ARRAY_VERSION}; update Plumbob to read it."
        )
    return content


def require_keys(where: str, found: Any, known: tuple[str, ...]) -> dict[str, Any]:
    """Refuse an object that does not have exactly these keys."""
    if not isinstance(found, dict) or set(found) != set(known):
        got = ", ".join(sorted(found)) if isinstance(found, dict) else excerpt(str(found))
        raise DecodeError(f"{where} must have the keys {', '.join(known)}, but it has {got}; write the file again.")
    return found


def check_header(content: dict[str, Any]) -> None:
    """Refuse a header with other keys than this version has."""
    several = ("array",) if content["format_version"] == ARRAY_VERSION else ()
    require_keys("its header", content, (*_KEYS, *several))
    if several and content["imu"] is not None:
        raise DecodeError("its header has both one unit and several; write the file again.")
    notes = content["notes"]
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise DecodeError("'notes' in its header must be a list of texts; write the file again.")


def meta_from(content: Any) -> ImuMeta:
    """Meta of the samples."""
    complete = dict.fromkeys(_LATER) | content if isinstance(content, dict) else content
    meta = require_keys("'imu' in its header", complete, tuple(_META))
    return ImuMeta(**{key: _typed(f"imu.{key}", meta[key], convert) for key, convert in _META.items()})


def track_meta_from(content: Any) -> tuple[Frame, North, str]:
    """Frame, heading reference and source of the track."""
    track = require_keys("'track' in its header", content, tuple(_TRACK))
    values = {key: _typed(f"track.{key}", track[key], convert) for key, convert in _TRACK.items()}
    return values["frame"], values["north"], values["source"]


def _typed(where: str, value: Any, convert: Callable[[Any], Any]) -> Any:
    try:
        return convert(value)
    except TypeError as error:
        raise DecodeError(f"{where} = {excerpt(str(value))} in its header {error}; write the file again.") from error


def _storable(where: str, holder: Any, key: str, convert: Callable[[Any], Any]) -> Any:
    value = getattr(holder, key)
    try:
        return convert(value)
    except TypeError as error:
        raise ParameterError(f"{where} = {value!r} {error}; a file cannot keep it otherwise.") from error


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError("must be a text")
    return value


def _number(value: Any) -> float:
    if not isinstance(value, int | float | np.integer | np.floating) or isinstance(value, bool):
        raise TypeError("must be a number")
    try:
        return float(value)
    except OverflowError:
        raise TypeError("is beyond every number that a recording needs") from None


def _numbers(value: Any) -> tuple[float, ...]:
    if not isinstance(value, list | tuple):
        raise TypeError("must be a list of numbers")
    return tuple(_number(number) for number in value)


def _range(value: Any) -> Range:
    if not isinstance(value, list | tuple):
        return _number(value)
    if len(value) != 3:
        raise TypeError("must be a number, or three of them")
    x, y, z = map(_number, value)
    return x, y, z


def _integer(value: Any) -> int:
    if not isinstance(value, np.integer) and not _is_int(value):
        raise TypeError("must be a whole number")
    return int(value)


def _truth(value: Any) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise TypeError("must be true or false")
    return bool(value)


def _optional(convert: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda value: None if value is None else convert(value)


def _is_int(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _frame(value: Any) -> Frame:
    return Frame.parse(_text(value))


def _north(value: Any) -> North:
    return North.parse(_text(value))


_META: Final[dict[str, Callable[[Any], Any]]] = {
    "device": _text,
    "gyr_range": _optional(_range),
    "acc_range": _optional(_range),
    "mag_range": _optional(_range),
    "rate_nominal": _optional(_number),
    "t0_ns": _integer,
    "axes": _text,
    "frame": _optional(_frame),
    "north": _optional(_north),
    "declination": _optional(_number),
    "calibration": _optional(_text),
    "gyr_left": _optional(_numbers),
    "acc_left": _optional(_numbers),
    "mag_left": _optional(_numbers),
    "unit_check": _truth,
}
_LATER: Final = ("gyr_left", "acc_left", "mag_left")
"""Keys that older recordings do not have."""
_TRACK: Final[dict[str, Callable[[Any], Any]]] = {"frame": _frame, "north": _north, "source": _text}


def _no_constant(word: str) -> float:
    raise ValueError(f"{word} is not a number in JSON")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is beyond every number that a recording needs")
    return value


def _no_repetition(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) != len(pairs):
        raise ValueError("a key is repeated")
    return content
