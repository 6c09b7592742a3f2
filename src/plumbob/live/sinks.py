"""Sinks: what is done with the parts that a line gives, besides recording them."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, Protocol, TextIO

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import ParameterError
from plumbob.core.event import Event
from plumbob.core.files import require_place
from plumbob.core.flags import names
from plumbob.core.text import visible
from plumbob.core.time import to_ns
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.array import ImuArray, UnitMount
from plumbob.live.stream import ItemResult
from plumbob.live.transports.polled import Schedule, Task
from plumbob.rotations import North, euler_zyx_from_quat

_LOOSE: Final = 1024


class Sink(Protocol):
    """Takes what a line gives, as it comes."""

    def on_part(self, part: ItemResult) -> None:
        """Take samples and attitudes."""
        ...

    def on_event(self, event: Event) -> None:
        """Take something that happened to the line or to the recording."""
        ...

    def close(self) -> None:
        """End; more than once does no harm."""
        ...


class Collected:
    """Keeps everything, for a replay or a conversion.

    Attributes
    ----------
    parts : list of ItemResult
        All parts.
    events : list of Event
        All events.
    """

    def __init__(self) -> None:
        self.parts: list[ItemResult] = []
        self.events: list[Event] = []

    def on_part(self, part: ItemResult) -> None:
        """Keep it."""
        self.parts.append(part)

    def on_event(self, event: Event) -> None:
        """Keep it."""
        self.events.append(event)

    def close(self) -> None:
        """Nothing is held open."""

    @property
    def t_ns(self) -> NDArray[np.int64]:
        """Times of all samples on the host's monotonic clock, ns."""
        return np.concatenate([part.t_ns for part in self.parts]) if self.parts else np.zeros(0, dtype=np.int64)

    def track(self) -> AttitudeTrack | None:
        """Attitude of the whole; None where nothing was estimated."""
        tracks = [part.track for part in self.parts if part.track is not None]
        return _joined(tracks) if tracks else None

    def imu(self, *, calibrated: bool) -> ImuData | None:
        """Samples of the whole, judged as a recording; None where there are none."""
        parts = [part.imu if calibrated else part.sensed for part in self.parts]
        return _joined_imu(parts, parts[0].triads) if parts else None

    def array(self, *, calibrated: bool) -> ImuArray | None:
        """The same of all units; None where there are no samples, or the session decodes one unit.

        A triad, or a unit, that has no number in any sample is left out.
        """
        if not self.parts or not self.parts[0].units:
            return None
        units, mounts = dict[str, ImuData](), dict[str, UnitMount]()
        for name, unit in self.parts[0].units.items():
            parts = [part.units[name].imu if calibrated else part.units[name].sensed for part in self.parts]
            alive = [triad for triad in unit.sensed.triads if any(np.isfinite(getattr(p, triad)).any() for p in parts)]
            if alive:
                units[name], mounts[name] = _joined_imu(parts, alive), unit.mount
        return ImuArray(units, mounts)


def _joined_imu(parts: Sequence[ImuData], triads: Sequence[str]) -> ImuData:
    names = ("t", "flags", *triads, *(() if parts[0].temp_c is None else ("temp_c",)))
    return ImuData(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names}, meta=parts[0].meta)


class Tracks:
    """Keeps attitudes alone, packed: a few parts of a few rows each take more memory than all their numbers."""

    def __init__(self) -> None:
        self._tracks: list[AttitudeTrack] = []
        self._loose = 0

    def on_part(self, part: ItemResult) -> None:
        """Keep its attitude."""
        if part.track is None:
            return
        self._tracks.append(part.track)
        self._loose += 1
        if self._loose == _LOOSE:
            self._tracks[-_LOOSE:] = [_joined(self._tracks[-_LOOSE:])]
            self._loose = 0

    def on_event(self, event: Event) -> None:
        """No attitude comes with it."""

    def close(self) -> None:
        """Nothing is held open."""

    def track(self) -> AttitudeTrack | None:
        """Attitude of the whole; None where nothing was estimated."""
        return _joined(self._tracks) if self._tracks else None


def _joined(parts: list[AttitudeTrack]) -> AttitudeTrack:
    return AttitudeTrack.joined(parts, sum(map(len, parts)))


def track_lines(track: AttitudeTrack, rows: list[int] | slice = slice(None), *, head: bool) -> Iterator[str]:
    """Lines of a track's rows as text; with what its angles mean before them, where `head` is asked for."""
    if head:
        zero = "an arbitrary zero" if track.north is North.FREE else f"{track.north} north"
        yield f"# roll about x, pitch about y, yaw about z, turned yaw first; body axes to {track.frame}, "
        yield f"heading from {zero}; by {visible(' '.join(track.source.split()))}\n"
        yield "t [s]\troll [deg]\tpitch [deg]\tyaw [deg]\tflags\n"
    angles = to_deg(euler_zyx_from_quat(track.q_nb[rows]))
    words = (np.zeros(len(track), dtype=np.uint32) if track.flags is None else track.flags)[rows]
    for t, (yaw, pitch, roll), word in zip(track.t[rows].tolist(), angles.tolist(), words.tolist(), strict=True):
        yield line_of(t, roll, pitch, yaw, word) + "\n"


def line_of(t: float, roll: float, pitch: float, yaw: float, word: int) -> str:
    """Line of the text for an attitude: s, degrees, and the names of its flags."""
    return f"{t:.6f}\t{roll:.4f}\t{pitch:.4f}\t{yaw:.4f}\t{'+'.join(names(word))}"


class TextSink:
    """Writes a line of text for an attitude now and then, as the hosts of the papers kept their TXT files.

    Parameters
    ----------
    path : path
        Text file; it must not exist yet, and is made with its first line.
    every : float
        Least time between two lines, s.

    Raises
    ------
    ParameterError
        If the file exists.
    DecodeError
        If its folder does not.
    """

    def __init__(self, path: str | Path, every: float) -> None:
        self._path = Path(path)
        if self._path.exists():
            raise ParameterError(
                f"{path} exists already, and a text recording never replaces a file. Name another file."
            )
        require_place(self._path)
        self._file: TextIO | None = None
        self._schedule = Schedule([Task("output", round(every * 1e9))])

    def __str__(self) -> str:
        return str(self._path)

    def on_part(self, part: ItemResult) -> None:
        """Write what is due, and hand it to the system at once."""
        track = part.track
        if track is None:
            return
        due = [i for i, t_ns in enumerate(to_ns(track.t).tolist()) if self._schedule.due(t_ns)]
        if not due:
            return
        first = self._file is None
        if self._file is None:
            self._file = self._path.open("x", encoding="utf-8")
        self._file.writelines(track_lines(track, due, head=first))
        self._file.flush()

    def on_event(self, event: Event) -> None:
        """Leave it to the recording."""

    def close(self) -> None:
        """End the file."""
        if self._file is not None:
            self._file.close()
