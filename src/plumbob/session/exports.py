"""Write samples and attitudes for other programs: the formats of `plumbob.files`, viewers' MCAP, TUM and plain text."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from plumbob import files
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.files import replacing
from plumbob.core.text import visible
from plumbob.data import AttitudeTrack
from plumbob.files import Recording
from plumbob.session.recorded import write_mcap
from plumbob.session.sinks import text_of


def export(path: str | Path, recording: Recording, *, overwrite: bool = False) -> Path:
    """Write a recording in the format that the file's suffix names.

    ``.tum`` holds the attitude as ``t x y z qx qy qz qw`` with positions of zero, for evo; ``.txt`` roll, pitch and yaw
    in degrees, as the papers' hosts kept them; ``.mcap`` samples and attitude for viewers; others are those of
    `plumbob.files.write`. A file that lies there is replaced only where `overwrite` says so.

    Raises
    ------
    ShapeError
        If the format holds attitudes and there is none.
    ParameterError, DecodeError
        If the suffix is unknown, or the file exists and is not to be replaced, or cannot be written.
    """
    file = Path(path)
    if file.suffix not in SUFFIXES:
        raise ParameterError(f"{file}: an export writes {', '.join(SUFFIXES)}, not '{file.suffix}'.")
    if file.suffix in _OWN:
        _OWN[file.suffix](file, recording, overwrite)
        return file
    if recording.imu is not None and recording.track is not None and not _on_one_clock(recording):
        raise ShapeError(f"{file}: samples and attitude have different times; export one of them with --what.")
    return files.write(file, recording, overwrite=overwrite)


def only(recording: Recording, what: str) -> Recording:
    """Return the recording's samples, its attitude, or both.

    Raises
    ------
    ShapeError
        If what is asked for is not there.
    """
    if what == "all":
        return recording
    kept = replace(recording, track=None) if what == "samples" and recording.imu is not None else None
    if what == "attitude" and recording.track is not None:
        kept = replace(recording, imu=None)
    if kept is None:
        raise ShapeError(f"{recording.name} has no {what}; it has {_content(recording)}.")
    return kept


def _content(recording: Recording) -> str:
    return " and ".join(
        w for w, part in (("samples", recording.imu), ("attitude", recording.track)) if part is not None
    )


def _on_one_clock(recording: Recording) -> bool:
    return (
        recording.imu is not None and recording.track is not None and np.array_equal(recording.imu.t, recording.track.t)
    )


def _attitude(file: Path, recording: Recording) -> AttitudeTrack:
    if recording.track is None:
        raise ShapeError(f"{file}: {file.suffix} holds an attitude, and there is none; estimate one first.")
    return recording.track


def _write_tum(file: Path, recording: Recording, overwrite: bool) -> None:
    track = _attitude(file, recording)
    known = track.known
    table = np.column_stack([track.t, np.zeros((len(track), 3)), track.q_nb[:, [1, 2, 3, 0]]])[known]
    source = visible(" ".join(track.source.split()))
    head = f"timestamp tx ty tz qx qy qz qw; body to {track.frame}, heading from {track.north} north; by {source}"
    with replacing(file, overwrite=overwrite) as temporary:
        np.savetxt(temporary, table, fmt=["%.9f", *["%d"] * 3, *["%.17g"] * 4], header=head, encoding="utf-8")


def _write_text(file: Path, recording: Recording, overwrite: bool) -> None:
    track = _attitude(file, recording)
    with replacing(file, overwrite=overwrite) as temporary, temporary.open("w", encoding="utf-8") as stream:
        stream.writelines(text_of(track, head=True))


_OWN: Final[dict[str, Callable[[Path, Recording, bool], None]]] = {
    ".tum": _write_tum,
    ".txt": _write_text,
    ".mcap": write_mcap,
}
SUFFIXES: Final = (*_OWN, ".csv", ".parquet")
