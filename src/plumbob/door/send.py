"""Send the attitude of a file to another program: `plumbob send`, in Python and on the command line."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Any, Final

from plumbob.core import check
from plumbob.core.errors import ShapeError
from plumbob.core.files import require_other
from plumbob.core.text import FactsText
from plumbob.core.time import to_ns
from plumbob.core.units import Quantity, given, given_pace
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.recording import Recording
from plumbob.door.reading import read
from plumbob.files.formats import is_own
from plumbob.files.mcap import open_log
from plumbob.live.replay import replay
from plumbob.live.runner import Note
from plumbob.live.sending import Direct, Due, asked_body, make_encoder, overturned, remarks
from plumbob.live.session import SendSpec, send_spec
from plumbob.live.session_toml import SESSION
from plumbob.live.transports.outgoing import Target, TcpServer, parse_target
from plumbob.live.transports.transport import Stopping
from plumbob.protocols.attitude import BodyAxes, attitudes

_BEHIND: Final = 0.5
_PAUSE: Final = 0.05


@dataclass(frozen=True, eq=False, repr=False)
class Sent(FactsText):
    """What was sent: `attitudes` that were due, `messages` that the target took, and how long it took, s.

    `withheld`: attitudes of which nothing was sent, because they are not reliable and the form cannot say so;
    `dropped`: messages that slow clients lost.
    """

    name: str
    spec: SendSpec
    attitudes: int
    messages: int
    withheld: int
    dropped: int
    seconds: float

    def facts(self) -> Mapping[str, str]:
        """All of it, in words."""
        return {
            "sent": f"{self.name} as {self.spec.kind} to {self.spec.to}",
            "attitudes": f"{self.attitudes}, {self.withheld} of them withheld as not reliable",
            "messages": f"{self.messages}, {self.dropped} lost by slow clients",
            "time": f"{self.seconds:.1f} s",
        }

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        names = ("attitudes", "messages", "withheld", "dropped", "seconds")
        facts = {"source": self.name, "as": self.spec.kind, "to": self.spec.to}
        return facts | {name: getattr(self, name) for name in names}

    def text(self) -> str:
        """A line for each fact."""
        return "\n".join(f"{name:<12} {value}" for name, value in self.facts().items())


def send(
    source: str | Path | Recording | AttitudeTrack,
    form: str,
    to: str,
    *,
    rate: float | str | None = None,
    speed: float | str = 1.0,
    sentences: str | Sequence[str] = (),
    body: BodyAxes | str | None = None,
    declination: float | str | None = None,
    overwrite: bool = False,
    stop: Stopping | None = None,
    note: Note | None = None,
    opened: Callable[[Target], object] | None = None,
) -> Sent:
    """Send the attitude of a file to another program, as fast as it was recorded.

    Parameters
    ----------
    source : path, Recording or AttitudeTrack
        A track, a recording with an attitude, or a recording of `plumbob record` (``.mcap``).
    form : {"nmea", "tss1", "mavlink", "json", "ros2"}
        Form of the messages.
    to : str
        ``udp:HOST:PORT``, ``udp-broadcast:HOST:PORT``, ``tcp:HOST:PORT``, ``tcp-listen:[HOST:]PORT``,
        ``serial:DEVICE@BAUD``, ``file:PATH``, or ``-`` for standard output.
    rate : float or str, optional
        Attitudes per second at most, Hz, by their own times; by default all.
    speed : float or str
        How many times as fast as it was; ``"max"``: as fast as it goes.
    sentences : str or sequence of str, optional
        NMEA sentences: HDT, HDG, HDM, PASHR, XDR, ROT; by default all that the heading allows.
    body : {"FRD", "FLU"}, optional
        Body axes of the attitude; by default FRD in NED, and FLU in ENU and NWU.
    declination : float or str, optional
        rad or text with a unit, east positive; by default the recording's own.
    overwrite : bool
        Whether to replace a file.
    stop : Stopping, optional
        Set from another thread to end.
    note : callable, optional
        Called with each remark.
    opened : callable, optional
        Called with the target once it is open.

    Returns
    -------
    Sent

    Raises
    ------
    ParameterError
        If form, target or sentences do not exist or do not go together, or a file exists.
    FrameError
        If a heading is asked for that the attitude does not have.
    ShapeError
        If the source has no attitude.
    LineError
        If the target cannot be opened, or breaks.
    """
    spec = send_spec(form, to, rate=rate, sentences=sentences, body=body)
    pace = given_pace(speed)
    name, track, imu, t0_ns = _opened(source)
    if to.startswith("file:") and isinstance(source, str | Path):
        require_other(Path(to.removeprefix("file:")), [Path(source)])
    angle = given("declination", declination, Quantity.ANGLE)
    angle = imu.meta.declination if angle is None and imu is not None else angle
    encoder = make_encoder(spec, track.north, angle)
    say = note or (lambda line: None)
    for line in filter(None, (*remarks(spec, track.north), overturned(track, asked_body(spec)))):
        say(line)
    words = [0] * len(track) if track.flags is None else track.flags.tolist()
    rows, more = Due(spec.rate).rows(to_ns(track.t).tolist(), words)
    target = parse_target(to, overwrite=overwrite)
    direct, began, withheld = Direct(target, to), time.monotonic(), 0
    try:
        if opened is not None:
            opened(target)
        _await_client(target, say, stop)
        clock = _Pacer(pace, stop, direct.tend)
        for a in attitudes(
            track, rows, t0_ns=t0_ns, utc=t0_ns > 0, body=asked_body(spec), declination=angle, imu=imu, more=more
        ):
            if not clock.wait(a.elapsed_ns):
                break
            data = encoder.encode(a)
            withheld += data is None or (spec.kind == "mavlink" and not a.reliable)
            if data is not None:
                direct.put(data)
        if rest := encoder.finish():
            direct.put(rest)
    finally:
        direct.close()
    return Sent(name, spec, len(rows), direct.sent, withheld, direct.dropped, time.monotonic() - began)


def _opened(source: str | Path | Recording | AttitudeTrack) -> tuple[str, AttitudeTrack, ImuData | None, int]:
    """What messages call it, its attitude, its samples, and the UTC of its zero; 0 where that is not known."""
    if isinstance(source, AttitudeTrack):
        return "the track", source, None, 0
    if isinstance(source, Recording):
        recording, name = source.of_unit(None), source.name or "the recording"
    else:
        file = check.path("source", source)
        if is_own(file) and (replayed := _replayed(file)) is not None:
            return replayed
        recording, name = read(file).of_unit(None), str(file)
    if recording.track is None:
        raise ShapeError(
            f"{name} holds samples but no attitude. Estimate it first: plumbob run {quote(name)} --filter mekf --out "
            "track.parquet."
        )
    return name, recording.track, recording.imu, 0 if recording.imu is None else recording.imu.meta.t0_ns


def _replayed(file: Path) -> tuple[str, AttitudeTrack, ImuData | None, int] | None:
    """Attitude of a recorded stream with the covariance that its filter claims; None where it holds only rows."""
    if SESSION not in open_log(file).metadata:
        return None
    replayed = replay(file, covariance=True)
    if replayed.track is None:
        return None
    return str(file), replayed.track, replayed.imu, replayed.t0_ns


def _await_client(target: Target, say: Note, stop: Stopping | None) -> None:
    if not isinstance(target, TcpServer):
        return
    say(f"waiting for the first client at {target.host}:{target.port}")
    while not target.clients and not (stop and stop.is_set()):
        target.tend()
        time.sleep(_PAUSE)


class _Pacer:
    """Waits for the time of each attitude; who comes late does not hurry after."""

    def __init__(self, speed: float, stop: Stopping | None, tend: Callable[[], None]) -> None:
        self._speed, self._stop, self._tend = speed, stop, tend
        self._zero: float | None = None

    def wait(self, t_ns: int) -> bool:
        """Wait for it; False where it is time to end."""
        if self._speed < math.inf:
            due = t_ns / 1e9 / self._speed
            now = time.monotonic()
            if self._zero is None or now - (self._zero + due) > _BEHIND:
                self._zero = now - due
            while (delay := self._zero + due - time.monotonic()) > 0.0 and not self._stopped:
                self._tend()
                time.sleep(min(delay, _PAUSE))
        return not self._stopped

    @property
    def _stopped(self) -> bool:
        return self._stop is not None and self._stop.is_set()
