"""OpenSim: tables of orientations and of IMUs (``.sto``), as OpenSense reads and writes them.

A head of ``key=value`` ends with ``endheader``; then a row of names, ``time`` and one of each sensor, and rows with
tabs between cells [OpenSim, `STOFileAdapter`]. ``DataType=Quaternion`` has ``w,x,y,z`` in a cell, from axes of the
sensor to those of its world. The file does not say which that is: z is taken for up, as `sensor_to_opensim_rotations`
of −90° about x takes it, unless Plumbob wrote its own keys. ``DataType=Vec3`` has ``x,y,z``; its name says the
quantity, as `IMUDataReader` calls its tables, in SI.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, DecodeError, ParameterError, ShapeError, excerpt
from plumbob.core.files import replacing
from plumbob.core.findings import Note
from plumbob.core.text import first_words, visible
from plumbob.data import AttitudeTrack, ImuMeta
from plumbob.data.array import named_unit
from plumbob.data.recording import Recording
from plumbob.files.foreign.logged import RELATIVE_NOTE, SensorLog, first_bytes, seconds_to_ns, vectors
from plumbob.files.profile import TextLayout
from plumbob.files.stamps import time_line
from plumbob.files.text_table import read_table
from plumbob.rotations import Frame, North, change_frame

_HEAD: Final = 1 << 16
_QUANTITIES: Final = {
    "angular_velocity|gyro": ("gyr", "rad/s"), "acceleration": ("acc", "m/s2"), "magnetic": ("mag", "relative"),
}  # fmt: skip


def accepts(path: Path) -> bool:
    """Whether a file has the head of a table of OpenSim."""
    return re.search(rb"(?im)^endheader[ \t\r]*$", first_bytes(path, _HEAD)) is not None


def read(path: Path, unit: str | None = None) -> Recording:
    """Read the orientation of one sensor, or what it measured; errors as of `plumbob.read`."""
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        head, _, rest = re.split(r"(?im)^(endheader)[ \t]*$", stream.read(_HEAD), maxsplit=1)
    facts = {key.strip().lower(): value.strip() for key, _, value in (line.partition("=") for line in head.split("\n"))}
    kind = facts.get("datatype", "double")
    if (width := {"quaternion": 4, "vec3": 3}.get(kind.lower(), 0)) == 0:
        raise DecodeError(
            f"its DataType is {excerpt(kind)}: coordinates or forces, and neither orientations nor an IMU. Name the "
            "table of DataType Quaternion."
        )
    line = rest.lstrip().split("\n", 1)[0]
    names = line.split()
    sensors = names[1:]
    if not sensors or names[0].lower() != "time":
        raise DecodeError(f"its row of names must be time and sensors, but it is {excerpt(' '.join(names))}.")
    if unit is None and len(sensors) > 1:
        raise ParameterError(f"it holds {len(sensors)} sensors: {first_words(sensors, 20)}. Name one with --unit.")
    taken = sensors[0] if unit is None else named_unit(sensors, unit)
    cells = ("", *[f"[{width}]"] * len(sensors))
    layout = TextLayout("\t" if "\t" in line else " ", marker="endheader", cells=cells)
    first = 2 + width * sensors.index(taken)
    table = read_table(path, layout, [1, *range(first, first + width)])
    time, values = table.columns[1], vectors(table.columns, *range(first, first + width))
    if width == len("xyz"):
        return _measured(path, taken, time, values, table.notes)
    clock, frame, north = time_line(seconds_to_ns("time", time)), facts.get("frame", ""), facts.get("north", "")
    said = frame in [*Frame] and north in [*North]
    track = AttitudeTrack(
        t=clock.t_ns / 1e9,
        q_nb=values,
        frame=Frame(frame) if said else Frame.ENU,
        north=North(north) if said else North.FREE,
        source=facts.get("source", "a table of OpenSim"),
    )
    notes: list[Note] = ["OpenSim: w, x, y, z, from axes of the sensor to those of its world"]
    notes += [*table.notes, *clock.notes]
    notes += [] if said else ["the world's z axis is taken for up, and its heading counts from anywhere"]
    return Recording(track=track, name=taken, notes=tuple(notes))


def _measured(path: Path, sensor: str, time: Floats, values: Floats, left_out: Sequence[Note]) -> Recording:
    """Samples of a table of vectors, whose name says the quantity."""
    what = next((what for words, what in _QUANTITIES.items() if re.search(words, path.stem.lower())), None)
    if what is None:
        raise DecodeError(
            "its vectors may be of any kind; let its name end in _angular_velocity, _linear_accelerations or "
            "_magnetic_heading, as OpenSim calls them."
        )
    notes: list[Note] = [f"OpenSim: {what[0]} by its name, in SI", *[RELATIVE_NOTE] * (what[0] == "mag"), *left_out]
    log = SensorLog(notes, ImuMeta(device=sensor, unit_check=False))
    log.add(what[0], seconds_to_ns("time", time), values, what[1])
    return log.recording(sensor)


def write_sto(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write an attitude, in a column that is called as the file; errors as of `write_orientations`."""
    if recording.track is None:
        raise ShapeError(f"{path}: .sto holds an attitude, and there is none; estimate one first.")
    write_orientations(path, {path.stem: recording.track}, overwrite=overwrite)


def write_orientations(path: str | Path, tracks: Mapping[str, AttitudeTrack], *, overwrite: bool = False) -> None:
    """Write attitudes of sensors on segments as OpenSense takes them; rows in which one is not known are left out.

    They come by their frame in the model, as ``"pelvis_imu"``, on the same times; NED is turned to ENU, whose z is up.
    """
    first, *others = tracks.values()
    if any(not np.array_equal(track.t, first.t) or track.frame != first.frame for track in others):
        raise ClockError(f"{path}: the attitudes must have the same times and frames; estimate them on one time line.")
    if wrong := [name for name in tracks if not name or name.split() != [name]]:
        raise ParameterError(f"a column of .sto is a word, as pelvis_imu, but one is {wrong[0]!r}; rename it.")
    frame = Frame.ENU if first.frame is Frame.NED else first.frame
    valid = np.logical_and.reduce([track.known for track in tracks.values()])
    turned = [change_frame(track.q_nb, to=frame, from_=track.frame)[valid] for track in tracks.values()]
    t = first.t[valid].tolist()
    rate = (len(t) - 1) / (t[-1] - t[0]) if len(t) > 1 else 0.0
    facts = {"DataRate": f"{rate:.6f}", "DataType": "Quaternion", "version": "3", "OpenSimVersion": "4.5"}
    facts |= {"frame": str(frame), "north": str(first.north), "source": visible(" ".join(first.source.split()))}
    columns = {name: [",".join(map(repr, q)) for q in q_nb.tolist()] for name, q_nb in zip(tracks, turned, strict=True)}
    _write(Path(path), facts, {"time": map(repr, t), **columns}, overwrite)


def write_motion(path: Path, columns: Mapping[str, Floats], *, overwrite: bool = False) -> None:
    """Write a motion, ``.mot``: times, s, and coordinates, degrees, by name."""
    facts = {"version": "1", "nRows": str(len(columns["time"])), "nColumns": str(len(columns)), "inDegrees": "yes"}
    cells = {name: map(repr, values.tolist()) for name, values in columns.items()}
    _write(path, facts, cells, overwrite, title=f"{path.stem}\n")


def _write(
    path: Path, facts: Mapping[str, str], columns: Mapping[str, Iterable[str]], overwrite: bool, title: str = ""
) -> None:
    head = title + "".join(f"{key}={value}\n" for key, value in facts.items())
    with replacing(path, overwrite=overwrite) as temporary, temporary.open("w", encoding="utf-8") as stream:
        stream.write(f"{head}endheader\n" + "\t".join(columns) + "\n")
        for cells in zip(*columns.values(), strict=True):
            stream.write("\t".join(cells) + "\n")
