"""A recorded stream as samples and attitudes; and both written for other programs: MCAP, TUM, plain text."""

import heapq
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import reduce
from importlib import import_module
from itertools import compress, repeat
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob import files
from plumbob.core import flags, schema
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, ShapeError, unknown_name
from plumbob.core.files import reading, replacing
from plumbob.core.findings import Finding, as_json, info, lasting, warning
from plumbob.core.findings import note as parsed_note
from plumbob.core.text import counted, visible
from plumbob.core.time import to_ns, to_s
from plumbob.data import TRIADS, AttitudeTrack, ImuData, ImuMeta
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.cards import CalibrationCard
from plumbob.data.recording import Recording, all_findings, inferred, recalibrated, stored_notes
from plumbob.files.formats import EXTENSIBLE, is_own
from plumbob.files.header import ARRAY, META, TRACK, array_told, parsed, plain_meta
from plumbob.files.mcap import Log, open_log
from plumbob.files.mcap.verdict import write_rows
from plumbob.live import rows
from plumbob.live.replay import NO_SAMPLE, replay
from plumbob.live.session_toml import ALL, SESSION, of_unit, recorded_session
from plumbob.live.sinks import track_lines
from plumbob.live.stream import Stream
from plumbob.rotations import Frame, North, frame_rotation

_META: Final = "recording"


def read_recorded(
    path: str | Path, *, estimated: bool = False, unit: str | None = None, calibrated: bool = False
) -> Recording:
    """Samples of a recording, with a reference in the same frames, or what was `estimated`, as their track.

    Without `unit` they are those of all that the session decodes; ``"all"``: all in the frames. `calibrated`: by the
    session's cards.
    """
    file = Path(path)
    log = open_log(file)
    if SESSION not in log.metadata:
        decoded = _from_rows(log, file, estimated=estimated)
        return decoded if unit is None or unit == ALL else decoded.of_unit(unit)
    session = recorded_session(log.metadata, file.stem)
    source = str(unit) if unit in [other.name for other in session.beside] else ""
    if unit is not None and not source:
        chosen = of_unit(session, unit)
        session = chosen if unit == ALL else replace(chosen, units=())
    session = replace(session, chain=None)  # `JointTrack.load` reads what was estimated of it
    replayed = replay(log, session=session if estimated else replace(session, stage=None, rates=None, scheme=""))
    first, stream, collected = replayed.stream, replayed.stream, replayed.found
    if source:
        stream, collected = first.beside[source], collected.beside[source]
    if not collected.parts or first.t0_ns is None:
        raise DecodeError(NO_SAMPLE.format(file))
    imu, array = collected.imu(calibrated=calibrated), collected.array(calibrated=calibrated)
    units = array.units if array is not None else {} if imu is None else {"": imu}
    units = {name: replace(sensed, meta=replace(sensed.meta, t0_ns=replayed.t0_ns)) for name, sensed in units.items()}
    track = collected.track() if estimated else collected.said()
    clock = list[Finding]()
    if source:  # on the clock of the first
        units = {name: replace(sensed, t=_on_clock(stream, first, sensed.t)) for name, sensed in units.items()}
        track = None if track is None else replace(track, t=_on_clock(stream, first, track.t))
        against = stream.against(first)
        ppm, ahead = against["clock_ppm"], against["clock_ahead_ms"]
        clock.append(info("reading.source_clock", source=source, ppm=ppm, ahead=ahead))
    dead = [] if array is None else [u.unit for u in stream.session.units if u.unit not in array.units]
    doubts = dict.fromkeys(doubt for sensed in units.values() for doubt in sensed.unit_doubts())
    notes = (
        *reading_notes(log, stream),
        *clock,
        *(warning("reading.dead_unit", unit=name) for name in dead),
        *(warning("reading.unit_doubt", doubt=str(doubt)) for doubt in doubts),
    )
    recording = Recording(
        imu=units.get("") if array is None else None,
        track=track,
        name=source or file.stem,
        array=None if array is None else ImuArray(units, array.mounts),
    )
    return replace(recording, notes=(*notes, *all_findings(recording)))


def _on_clock(stream: Stream, first: Stream, t: Floats) -> Floats:
    """Times (N,), s, of another source than the first on the clock and from the first sample of that."""
    assert stream.t0_ns is not None
    assert first.t0_ns is not None
    return to_s(stream.in_clock(first, to_ns(t) + stream.t0_ns) - first.t0_ns)


def reading_notes(log: Log, stream: Stream) -> tuple[Finding, ...]:
    """What the reading of a recorded line shows: its bytes, starts and damage, and gaps that were inferred."""
    return (
        decoded_note(stream),
        *([warning("reading.starts", starts=log.starts)] if log.starts > 1 else []),
        *(warning("reading.damaged", damage=str(damage)) for damage in log.damage),
        *inferred(stream.time_report()),
        *stream.decoder.notes,
    )


def decoded_note(stream: Stream) -> Finding:
    """How many bytes were decoded as which format, and how many belong to no frame."""
    counts = stream.decoder.counts
    return info("source.decoded", bytes=counts.received, format=stream.session.form.name, junk=counts.junk)


def write_mcap(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write samples and attitude as a recording that viewers such as Foxglove and Lichtblick open."""
    streams: dict[str, Iterable[tuple[int, str, bytes]]] = {}
    units = _units(recording)
    for name, imu in units.items():
        stamps, topic = to_ns(imu.t).tolist(), rows.named_topic(rows.IMU, name)
        streams[topic] = zip(stamps, repeat(topic), rows.imu_rows(stamps, imu))
    t0_ns = next((imu.meta.t0_ns for imu in units.values()), 0)
    if (track := recording.track) is not None:
        stamps = to_ns(track.t).tolist()
        streams[rows.ATTITUDE] = zip(stamps, repeat(rows.ATTITUDE), rows.attitude_rows(stamps, track))
        streams[rows.TRANSFORMS] = _transforms(stamps, track, t0_ns)
    write_rows(
        path,
        {topic: rows.row_schema(topic) for topic in streams},
        heapq.merge(*streams.values(), key=lambda row: row[0]),
        epoch_offset_ns=t0_ns,
        metadata={_META: json.dumps(_about(recording))},
        overwrite=overwrite,
    )


def _transforms(stamps: list[int], track: AttitudeTrack, t0_ns: int) -> Iterator[tuple[int, str, bytes]]:
    """The attitude once more in the schema of Foxglove, whose viewers draw it; they draw z upwards."""
    parent = f"navigation ({track.frame})"
    if track.frame is Frame.NED:
        turn = frame_rotation(Frame.ENU, Frame.NED).tolist()
        yield stamps[0], rows.TRANSFORMS, rows.transform_row(stamps[0] + t0_ns, "world (ENU)", parent, turn)
    for t_ns, q in zip(stamps, track.q_nb.tolist(), strict=True):
        if q[0] == q[0]:
            yield t_ns, rows.TRANSFORMS, rows.transform_row(t_ns + t0_ns, parent, "body", q)


def _units(recording: Recording) -> Mapping[str, ImuData]:
    """Samples by unit; those of the only one under an empty name."""
    if recording.array is not None:
        return recording.array.units
    return {} if recording.imu is None else {"": recording.imu}


def _about(recording: Recording) -> dict[str, Any]:
    imu, track, array = recording.imu, recording.track, recording.array
    several = {} if array is None else {"array": array_told(array)}
    meta = {} if imu is None else asdict(plain_meta(imu.meta))
    track_meta = {} if track is None else {"frame": str(track.frame), "north": str(track.north), "source": track.source}
    return {"imu": meta, "track": track_meta, "notes": as_json(stored_notes(recording))} | several


def _from_rows(log: Log, file: Path, *, estimated: bool) -> Recording:
    """Recording of decoded rows only, as `write_mcap` makes one."""
    by_topic: dict[str, list[dict[str, Any]]] = {rows.IMU: [], rows.ATTITUDE: []}
    with reading(file):
        for message in log:
            if message.topic == rows.ATTITUDE or rows.unit_of_topic(message.topic) is not None:
                by_topic.setdefault(message.topic, []).append(rows.parsed(message.topic, message.data))
        about = rows.parsed_object(f"the metadata '{_META}'", log.metadata.get(_META, "{}"))
        if not any(by_topic.values()):
            raise DecodeError(
                "it has neither a session nor decoded samples: it was not made by Plumbob, or it is cut off near its "
                "beginning. Use an intact copy."
            )
        imu = _samples(by_topic[rows.IMU], parsed(META, "imu", about.get("imu", {}))) if by_topic[rows.IMU] else None
        array = _array(by_topic, parsed(ARRAY, "array", about["array"])) if "array" in about else None
        wanted = by_topic[rows.ATTITUDE] and (estimated or (imu is None and array is None))
        track = _track(by_topic[rows.ATTITUDE], about.get("track")) if wanted else None
        notes = lasting(schema.listed(parsed_note, of="findings")("notes", about.get("notes", [])))
        return Recording(imu=imu, track=track, name=file.stem, notes=notes, array=array)


def _array(
    by_topic: Mapping[str, Sequence[Mapping[str, Any]]], metas: Mapping[str, tuple[ImuMeta, UnitMount]]
) -> ImuArray:
    if lacking := [name for name in metas if not by_topic.get(rows.named_topic(rows.IMU, name))]:
        raise DecodeError(f"it has no samples of the unit {lacking[0]}, which its metadata name; use an intact copy.")
    of = {name: by_topic[rows.named_topic(rows.IMU, name)] for name in metas}
    stamps = {name: rows.integers("t_ns", of[name], np.int64) for name in metas}
    common = reduce(np.intersect1d, stamps.values())  # damage may have cost some units rows that others have
    if not common.size:
        raise DecodeError("its units have no time in common; use an intact copy.")
    units = {}
    for name, (meta, _) in metas.items():
        mask = np.isin(stamps[name], common)
        units[name] = _samples(list(compress(of[name], mask)), meta)
    return ImuArray(units, {name: mount for name, (_, mount) in metas.items()})


def _samples(records: Sequence[Mapping[str, Any]], meta: ImuMeta) -> ImuData:
    triads = {name: rows.table(name, records, 3) for name in TRIADS if records[0][name] is not None}
    temps = rows.table("temp_c", records)
    return ImuData(
        t=rows.integers("t_ns", records, np.int64) / 1e9,
        temp_c=None if np.isnan(temps).all() else temps,
        flags=rows.integers("flags", records, np.uint32),
        meta=meta,
        **triads,
    )


def _track(records: Sequence[Mapping[str, Any]], meta: Any) -> AttitudeTrack:
    return AttitudeTrack(
        t=rows.integers("t_ns", records, np.int64) / 1e9,
        q_nb=rows.table("q_nb", records, 4),
        bias_b=rows.table("bias_b", records, 3) if records[0]["bias_b"] is not None else None,
        flags=rows.integers("flags", records, np.uint32),
        **parsed(TRACK, "track", meta),
    )


def convert(
    recording: Recording | str | Path, path: str | Path, *, layout: str | None = None, what: str = "all",
    unit: str | None = None, profile: str | Path | None = None, calibration: CalibrationCard | str | Path | None = None,
    overwrite: bool = False, note: Callable[[str], object] | None = None,
) -> Recording:  # fmt: skip
    """Write a recording, or a file of any format, in the format that the new file's suffix or `layout` names.

    ``.tum`` holds the attitude as ``t x y z qx qy qz qw`` with positions of zero, for evo; ``.sto`` for OpenSim, in a
    column that is called as the file; ``.txt`` roll, pitch and yaw in degrees, as the papers' hosts kept them;
    ``.mcap`` samples and attitude for viewers; ``.bag`` is a bag of ROS 1; others, as ``.mat`` and ``.nc``, are as
    `plumbob.files.write` has them.

    Parameters
    ----------
    recording : Recording or path
        What to write; of a recorded stream, with the attitude that was estimated.
    path : path
        The new file, or folder.
    layout : {"ros2", "rosbag2", "euroc", "tum"}, optional
        An MCAP with the messages of ROS 2 (sensor_msgs), the folder of a ROS 2 bag, one of EuRoC, or lines of TUM, in a
        ``.txt`` too.
    what : {"all", "samples", "attitude"}
        Leaves the rest out.
    unit : str, optional
        One of several units, by name or number from 1, whose samples alone are written.
    profile : path, optional
        What the columns of a text file mean.
    calibration : CalibrationCard or path, optional
        Card to apply to the samples.
    overwrite : bool
        Whether a file that lies there may be replaced, or a folder of the same layout.
    note : callable, optional
        Called with what a reader should know of the samples, and with what the new format cannot hold.

    Returns
    -------
    Recording
        What was written.

    Raises
    ------
    ShapeError
        If the format holds attitudes and there is none.
    MissingExtraError
        If the format is written by a package that is not installed.
    ParameterError, DecodeError
        If the suffix is unknown, or the file exists and is not to be replaced, or cannot be written.
    """
    file = Path(path)
    require_writer(file, layout)
    if not isinstance(recording, Recording):
        given = Path(recording)
        if given.exists() and file.resolve() in (given.resolve(), *given.resolve().parents):
            raise ParameterError(f"{file} is or holds the input; writing there would destroy it. Name another file.")
        native = is_own(given)
        recording = (
            read_recorded(given, estimated=True, unit=unit) if native else files.read(given, profile=profile, unit=unit)
        )
        unit = None
    recording = only(recording if unit is None else recording.of_unit(unit), what)
    if calibration is not None:
        recording = recalibrated(recording, CalibrationCard.of(calibration))
        for finding in recording.notes:
            if note is not None and finding.code == "card.temperature_beyond":
                note(str(finding))
    writer = LAYOUTS[layout].write if layout is not None else _OWN.get(file.suffix)
    apart = (track := recording.track) and any(not np.array_equal(imu.t, track.t) for imu in _units(recording).values())
    if apart and (layout or file.suffix[1:]) not in (*_TRACKS, "mcap", "euroc"):
        raise ShapeError(f"{file}: samples and attitude have different times; convert one of them with --what.")
    for line in _lost(file, recording, layout):
        if note is not None:
            note(line)
    if writer is not None:
        writer(file, recording, overwrite)
    else:
        files.write(file, recording, overwrite=overwrite)
    return recording


def require_writer(file: Path, layout: str | None) -> None:
    """Refuse a name or a layout that is not written, and say what is."""
    if layout is not None:
        if layout not in LAYOUTS:
            raise unknown_name("layout", layout, LAYOUTS)
        suffixes = LAYOUTS[layout].suffixes
        if file.suffix not in suffixes and (suffixes or file.suffix in SUFFIXES):
            form = f"a file whose name ends in {' or '.join(suffixes)}" if suffixes else "a folder"
            raise ParameterError(f"{file}: the layout {layout} is {form}; give the new one such a name.")
    elif file.suffix not in SUFFIXES and not ((other := EXTENSIBLE.find(file.suffix.lower()[1:])) and other.writers):
        folders = " or ".join(f"--as {name}" for name, spec in LAYOUTS.items() if not spec.suffixes)
        raise ParameterError(
            f"{file}: convert writes {', '.join(SUFFIXES)}, not '{file.suffix}'; and folders with {folders}."
        )


def _extras(recording: Recording) -> Iterator[str]:
    """Names of what a recording says besides stamps, gyr, acc and attitudes."""
    for imu in _units(recording).values():
        meta = imu.meta
        scales = (meta.gyr_range, meta.acc_range, meta.mag_range)
        said = {
            "mag": imu.mag is not None,
            "temp_c": imu.temp_c is not None,
            "flags": (imu.flags & ~_ABSENT).any(),
            "full scales": any(scale is not None for scale in scales),
            "calibration": meta.calibration is not None,
            "nominal rate": meta.rate_nominal is not None,
            _NORTH: meta.north not in (None, North.FREE),
            "declination": meta.declination is not None,
            _AXES: meta.axes != _BARE.axes,
            "device": meta.device != _BARE.device,
            _START: not meta.t0_ns and imu.t[0] != 0.0,
        }
        yield from compress(said, said.values())
    if (track := recording.track) is not None:
        said = {
            "bias": track.bias_b is not None,
            "covariance": track.cov_b is not None,
            "flags": track.flags is not None,
            "scores": track.score is not None or track.mag_weight is not None,
            _NORTH: track.north is not North.FREE,
            "source": bool(track.source),
            _START: not _units(recording) and track.t[0] != 0.0,
        }
        yield from compress(said, said.values())
    if lasting(recording.notes):
        yield "notes"


def _lost(file: Path, recording: Recording, layout: str | None) -> Iterable[str]:
    """What the new format cannot hold of a recording, a line each."""
    form = layout or file.suffix.removeprefix(".")
    dropped: list[str] = []
    if form in _TRACKS and (track := recording.track) is not None:
        units = _units(recording).values()
        dropped += ["samples"] if units else []
        dropped += ["UTC"] if form == "txt" and any(imu.meta.t0_ns for imu in units) else []
        recording = replace(recording, imu=None, array=None)
        if form == "txt":
            yield "angles are rounded to 0.0001° and times to 1 µs"
        elif count := int((~track.known).sum()):
            yield f"{counted(count, 'row')} without an attitude left out"
    dropped += [name for name in dict.fromkeys(_extras(recording)) if name in _LACKS.get(form, ())]
    if dropped:
        yield f"{_NAMED.get(form, form.upper())} has no place for {', '.join(dropped)}: left out"
    if layout == "euroc":
        from plumbob.files.foreign.euroc import lost

        yield from lost(recording)
    elif form in _OF_ROS:
        from plumbob.files.foreign.ros_write import turned

        yield from turned(recording)[1]
        if recording.array is not None and recording.track is not None:
            yield "the attitude is that of the body of several units, and is left out; --what attitude writes it alone"


def only(recording: Recording, what: str) -> Recording:
    """Return the recording's samples, its attitude, or both."""
    if what == "all":
        return recording
    chosen = replace(recording, track=None) if what == "samples" and _units(recording) else None
    if what == "attitude" and recording.track is not None:
        chosen = replace(recording, imu=None, array=None)
    if chosen is None:
        kinds = compress(("samples", "attitude"), (_units(recording), recording.track))
        raise ShapeError(f"{recording.name} has no {what}; it has {' and '.join(kinds)}.")
    return chosen


def _attitude(file: Path, recording: Recording) -> AttitudeTrack:
    if recording.track is None:
        raise ShapeError(f"{file}: {file.suffix} holds an attitude, and there is none; estimate one first.")
    return recording.track


def _write_tum(file: Path, recording: Recording, overwrite: bool) -> None:
    track = _attitude(file, recording)
    mask = track.known
    table = np.column_stack([track.t, np.zeros((len(track), 3)), track.q_nb[:, [1, 2, 3, 0]]])[mask]
    source = visible(" ".join(track.source.split()))
    t0_ns = next((imu.meta.t0_ns for imu in _units(recording).values()), 0)
    utc = f"; 0 s is {t0_ns} ns of UTC" if t0_ns else ""
    head = f"timestamp tx ty tz qx qy qz qw; body to {track.frame}, heading from {track.north} north{utc}; by {source}"
    with replacing(file, overwrite=overwrite) as temporary:
        np.savetxt(temporary, table, fmt=["%.9f", *["%d"] * 3, *["%.17g"] * 4], header=head, encoding="utf-8")


def _write_text(file: Path, recording: Recording, overwrite: bool) -> None:
    track = _attitude(file, recording)
    with replacing(file, overwrite=overwrite) as temporary, temporary.open("w", encoding="utf-8") as stream:
        stream.writelines(track_lines(track, head=True))


def _foreign(module: str, name: str) -> Callable[[Path, Recording, bool], None]:
    """A writer of the files of another program, which is imported when it is needed."""

    def write(file: Path, recording: Recording, overwrite: bool) -> None:
        getattr(import_module(f".foreign.{module}", files.__name__), name)(file, recording, overwrite)

    return write


_BARE: Final = ImuMeta()
_ABSENT: Final = np.uint32(flags.GYR_ABSENT | flags.ACC_ABSENT | flags.MAG_ABSENT)  # what the values themselves say
_NORTH, _AXES, _START = "what headings count from", "mounting of the axes", "start of the time"
_TRACK: Final = frozenset({"bias", "covariance", "flags", "scores", "notes"})
_SENSE: Final = _TRACK | {"full scales", "calibration", _NORTH, "declination", _AXES, "source", _START}
_LACKS: Final[dict[str, frozenset[str]]] = {
    "mcap": frozenset({"covariance", "scores"}),
    **dict.fromkeys(("tum", "sto"), _TRACK),
    "txt": _TRACK - {"flags"},
    "euroc": _SENSE - {"bias"} | {"mag", "temp_c", "device"},
    **dict.fromkeys(("bag", "ros2", "rosbag2"), _SENSE - {"covariance"} | {"nominal rate"}),
}
"""What each format has no place for, of `_extras`; CSV, Parquet, MATLAB and NetCDF hold everything."""
_TRACKS: Final = ("tum", "txt", "sto")
_OF_ROS: Final = ("bag", "ros2", "rosbag2")
_NAMED: Final = {"euroc": "EuRoC", "sto": "OpenSim", "txt": "text", **dict.fromkeys(_OF_ROS, "ROS")}


class RecordingLayout(NamedTuple):
    """What a suffix does not say: the suffixes of such files, none of folders, and their writer."""

    suffixes: tuple[str, ...]
    write: Callable[[Path, Recording, bool], None]


_OWN: Final[dict[str, Callable[[Path, Recording, bool], None]]] = {
    ".tum": _write_tum,
    ".txt": _write_text,
    ".mcap": write_mcap,
    ".bag": _foreign("ros_write", "write_bag"),
}
SUFFIXES: Final = (*_OWN, ".csv", ".parquet", ".mat", ".nc", ".sto")
LAYOUTS: Final = {
    "ros2": RecordingLayout((".mcap",), _foreign("ros_write", "write_mcap")),
    "rosbag2": RecordingLayout((), _foreign("ros_write", "write_rosbag2")),
    "euroc": RecordingLayout((), _foreign("euroc", "write_euroc")),
    "tum": RecordingLayout((".tum", ".txt"), _write_tum),
}
