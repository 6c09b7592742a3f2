"""A recording of a line as samples and attitudes, as other verbs take them; and both as a recording for viewers."""

import heapq
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import repeat
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob import files
from plumbob.core.errors import DecodeError
from plumbob.core.files import reading
from plumbob.core.schema import texts
from plumbob.core.time import to_ns
from plumbob.data import TRIADS, AttitudeTrack, ImuData
from plumbob.files import Recording
from plumbob.files.header import meta_from, plain_meta, track_meta_from
from plumbob.files.mcap import Log, open_log
from plumbob.files.mcap.verdict import write_rows
from plumbob.files.notes import read_notes, stored_notes
from plumbob.rotations import Frame, quat_from_euler_zyx
from plumbob.session import rows
from plumbob.session.replay import Replayed, replay, utc_ns
from plumbob.session.session import reference_names
from plumbob.session.session_toml import SESSION, recorded_session

_META: Final = "recording"


def read_recorded(path: str | Path, *, estimated: bool = False) -> Recording:
    """Samples of a recording, and a reference in the same frames, or the estimated attitude where that is asked for.

    Parameters
    ----------
    path : path
        The recording.
    estimated : bool
        Whether `track` is to be what was estimated; without it, it is the reference, or None, for an estimate is none.

    Raises
    ------
    DecodeError
        If it is not a recording of samples.
    """
    file = Path(path)
    log = open_log(file)
    if SESSION not in log.metadata:
        return _from_rows(log, file, estimated=estimated)
    replayed = replay(log, recorded_session(log.metadata, file.stem))
    imu = replayed.found.imu(calibrated=False)
    if imu is None:
        raise DecodeError(f"{file} holds no sample that could be decoded; 'plumbob verify' says what is in it.")
    meta = replace(imu.meta, t0_ns=utc_ns(replayed))
    counts = replayed.line.decoder.counts
    notes = [
        f"decoded from {counts.received} raw bytes as {replayed.line.session.form.name}, {counts.junk} of them junk"
    ]
    if log.starts > 1:
        notes += [f"recorded in {log.starts} starts; the recorder was away in between"]
    notes += [f"damaged: {damage}" for damage in log.damage]
    notes += files.inferred(replayed.line.time_report())
    notes += [f"units: {doubt}; check the units of the format" for doubt in imu.unit_doubts()]
    track = replayed.found.track() if estimated else _reference(replayed)
    whole = Recording(imu=replace(imu, meta=meta), track=track, name=file.stem, notes=tuple(notes))
    return replace(whole, notes=(*whole.notes, *files.findings(whole.imu))) if whole.imu else whole


def _reference(replayed: Replayed) -> AttitudeTrack | None:
    """Attitude of the reference that the session names; its angles are those of NED, as heading and roll are."""
    session = replayed.line.session
    if session.reference is None:
        return None
    names = reference_names(session.reference)
    parts = [np.stack([part.frames.columns[name] for name in names], axis=1) for part in replayed.found.parts]
    angles = np.concatenate(parts)
    return AttitudeTrack(
        t=np.concatenate([part.imu.t for part in replayed.found.parts]),
        q_nb=quat_from_euler_zyx(angles),
        frame=Frame.NED,
        north=session.reference.north,
        source=f"{', '.join(names)} of {session.form.name}",
    )


def write_mcap(path: Path, recording: Recording, overwrite: bool = False) -> None:
    """Write samples and attitude as a recording that viewers such as Foxglove and Lichtblick open.

    Raises
    ------
    ParameterError
        If the file exists and `overwrite` is false.
    DecodeError
        If the system refuses; then nothing is left there.
    """
    streams: dict[str, Iterable[tuple[int, str, bytes]]] = {}
    if (imu := recording.imu) is not None:
        stamps = to_ns(imu.t).tolist()
        streams[rows.IMU] = zip(stamps, repeat(rows.IMU), rows.imu_rows(stamps, imu))
    if (track := recording.track) is not None:
        stamps = to_ns(track.t).tolist()
        streams[rows.ATTITUDE] = zip(stamps, repeat(rows.ATTITUDE), rows.attitude_rows(stamps, track))
    write_rows(
        path,
        {topic: rows.kind_of(topic) for topic in streams},
        heapq.merge(*streams.values(), key=lambda row: row[0]),
        epoch_offset_ns=0 if imu is None else imu.meta.t0_ns,
        metadata={_META: json.dumps(_about(recording))},
        overwrite=overwrite,
    )


def _about(recording: Recording) -> dict[str, Any]:
    imu, track = recording.imu, recording.track
    meta = {} if imu is None else asdict(plain_meta(imu.meta))
    told = {} if track is None else {"frame": str(track.frame), "north": str(track.north), "source": track.source}
    return {"imu": meta, "track": told, "notes": list(stored_notes(recording))}


def _from_rows(log: Log, file: Path, *, estimated: bool) -> Recording:
    """Recording of decoded rows only, as `write_mcap` makes one."""
    found: dict[str, list[dict[str, Any]]] = {rows.IMU: [], rows.ATTITUDE: []}
    with reading(file):
        for message in log:
            if message.topic in found:
                found[message.topic].append(rows.parsed(message.topic, message.data))
        about = rows.parsed_object(f"the metadata '{_META}'", log.metadata.get(_META, "{}"))
        if not found[rows.IMU] and not found[rows.ATTITUDE]:
            raise DecodeError("it has neither a session nor decoded samples; it was not made by Plumbob.")
        imu = _imu(found[rows.IMU], about.get("imu", {})) if found[rows.IMU] else None
        wanted = found[rows.ATTITUDE] and (estimated or imu is None)
        track = _track(found[rows.ATTITUDE], about.get("track")) if wanted else None
        notes = read_notes(texts("notes", about.get("notes", [])), imu)
        return Recording(imu=imu, track=track, name=file.stem, notes=notes)


def _imu(found: Sequence[Mapping[str, Any]], meta: Any) -> ImuData:
    triads = {name: rows.table(name, found, 3) for name in TRIADS if found[0][name] is not None}
    temps = rows.table("temp_c", found)
    return ImuData(
        t=rows.whole("t_ns", found, np.int64) / 1e9,
        temp_c=None if np.isnan(temps).all() else temps,
        flags=rows.whole("flags", found, np.uint32),
        meta=meta_from(meta),
        **triads,
    )


def _track(found: Sequence[Mapping[str, Any]], told: Any) -> AttitudeTrack:
    frame, north, source = track_meta_from(told)
    return AttitudeTrack(
        t=rows.whole("t_ns", found, np.int64) / 1e9,
        q_nb=rows.table("q_nb", found, 4),
        frame=frame,
        north=north,
        bias_b=rows.table("bias_b", found, 3) if found[0]["bias_b"] is not None else None,
        flags=rows.whole("flags", found, np.uint32),
        source=source,
    )
