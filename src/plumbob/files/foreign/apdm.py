"""APDM Opal: recordings of one or several monitors in HDF5, by Motion Studio (to version 4) and Mobility Lab (5).

By APDM's documents and what its users' programs read:

- ``Time`` in µs since 1970 (UTC); specific force in m/s², rates in rad/s, field in µT, temperature in °C;
- ``Orientation``: APDM's own estimate from the same sensors, scalar first; it turns axes of the monitor into those of a
  world whose x axis points to magnetic north, y to the west and z up;
- to version 4 a monitor is a group as ``SI-001007``, with ``Calibrated/Accelerometers`` and so on, and the attributes
  or data sets ``CaseIdList`` and ``MonitorLabelList`` say its label; from 5 on ``Sensors/1262/Accelerometer``,
  ``Processed/1262/Orientation`` and the attribute ``Label 0`` of ``Sensors/1262/Configuration``.

Monitors are called by their labels, where these differ. Raw counts, barometer and annotations are left out.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.findings import info
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.arrays import HDF5_SIGNATURE, Hdf5Arrays, opened_hdf5
from plumbob.files.foreign.logged import LoggedAttitude, SensorLog, array_recording, choose, first_bytes, micro
from plumbob.rotations import Frame, North

_PLACE: Final = re.compile(
    r"(?:(?:Sensors|Processed)/(?P<new>[^/]+)/|(?P<old>[^/]+)/(?=Time$|Calibrated/)(?:Calibrated/)?)"
    r"(?P<what>Accelerometer|Gyroscope|Magnetometer|Temperature|Orientation|Time)s?"
)
_SENSORS: Final = {"Gyroscope": "gyr", "Accelerometer": "acc", "Magnetometer": "mag", "Temperature": "temp_c"}
_SOURCE: Final = "APDM's own estimate from the same sensors, which is not a reference"


def accepts(path: Path) -> bool:
    """Whether a file has the groups of a monitor."""
    is_hdf5 = first_bytes(path).startswith(HDF5_SIGNATURE)
    return is_hdf5 and bool(_monitors(Hdf5Arrays(path, transposed=False)))


def _monitors(arrays: Hdf5Arrays) -> dict[str, dict[str, str]]:
    """Data sets by what they hold, of each monitor that has stamps and a sensor of motion."""
    monitors: dict[str, dict[str, str]] = {}
    for name in arrays.shapes:
        if place := _PLACE.fullmatch(name):
            monitors.setdefault(place["new"] or place["old"], {})[place["what"]] = name
    return {key: of for key, of in monitors.items() if "Time" in of and {"Accelerometer", "Gyroscope"} & of.keys()}


def read(path: Path, unit: str | None = None) -> Recording:
    """Read all monitors, or one, by its label, its number in the file or its identity, with APDM's attitude."""
    arrays = Hdf5Arrays(path, transposed=False)
    monitors = _monitors(arrays)
    labels = _labels(path, monitors)
    notes: list[Any] = ["APDM Opal: m/s², rad/s, µT, µs of UTC; axes of the case"]
    by_label = {labels[key]: of for key, of in monitors.items()}
    if unit in monitors:
        unit = labels[unit]
    if unit is None and len(monitors) > 1:
        logs = {label: _log(arrays.load([*of.values()]), of, label, []) for label, of in by_label.items()}
        notes += ["left out: APDM's attitudes, each of one monitor; --unit with its name keeps it"]
        return array_recording({label: log.joined() for label, log in logs.items()}, path.stem, notes)
    counts = {label: arrays.shapes[of["Time"]][0] for label, of in by_label.items()}
    taken = choose(notes, counts, unit)
    of = by_label[taken]
    return _log(arrays.load([*of.values()]), of, taken, notes).recording(path.stem)


def _log(content: Mapping[str, Any], of: Mapping[str, str], label: str, notes: list[Any]) -> SensorLog:
    """Streams of one monitor; a sensor that was switched off has zeros or nothing, and is left out."""
    stamps = micro(content[of["Time"]].ravel())
    meta = ImuMeta(device=f"Opal {label}", frame=Frame.NWU, north=North.MAGNETIC)
    log = SensorLog(notes, meta, epoch_ns=0)
    for what, sensor in _SENSORS.items():
        values: Floats = np.asarray(content[of[what]], dtype=np.float64) if what in of else np.empty(0)
        if len(values) == stamps.size and np.nan_to_num(values).any():
            log.add(sensor, stamps, values.ravel() if sensor == "temp_c" else values)
        elif what in of:
            notes.append(info("source.columns_empty", kind=sensor, columns=of[what]))
    if "Orientation" in of and len(q_nb := content[of["Orientation"]]) == stamps.size:
        attitude = np.asarray(q_nb, dtype=np.float64)
        log.attitudes.append(LoggedAttitude(stamps, attitude, _SOURCE, Frame.NWU, North.MAGNETIC))
    return log


def _labels(path: Path, monitors: Mapping[str, Any]) -> dict[str, str]:
    """Label of each monitor; its identity where it has none, or another has the same."""
    labels: dict[str, str] = {}
    with opened_hdf5(path) as (h5py, hdf5):

        def words(key: str) -> list[str]:
            is_inside = key in hdf5 and isinstance(hdf5.get(key, getlink=True), h5py.HardLink)
            return [_text(word) for word in np.ravel(hdf5[key][()] if is_inside else hdf5.attrs.get(key, ()))]

        labels |= zip(words("CaseIdList"), words("MonitorLabelList"), strict=False)
        for key in monitors:
            group = hdf5.get(f"Sensors/{key}")
            if group is not None and isinstance(group.get("Configuration", getlink=True), h5py.HardLink):
                labels[key] = _text(group["Configuration"].attrs.get("Label 0", b""))
    names = [labels.get(key, "") for key in monitors]
    return {key: name if name and names.count(name) == 1 else key for key, name in zip(monitors, names, strict=True)}


def _text(word: Any) -> str:
    text = word.decode("utf-8", "replace") if isinstance(word, bytes) else str(word)
    return "".join(letter for letter in text if letter.isprintable()).strip()
