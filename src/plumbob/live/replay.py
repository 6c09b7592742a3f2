"""Go through a recording again: the same stream, the same items, the same bits."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

from numpy.typing import NDArray

from plumbob.core.errors import DecodeError, FrameError, ParameterError
from plumbob.core.findings import info
from plumbob.core.series import Series
from plumbob.core.text import counted
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards import CalibrationCard, NoiseCard
from plumbob.data.earth_field import iso_day
from plumbob.data.recording import Recording, inferred
from plumbob.files.mcap import Log, open_log
from plumbob.filters import SMOOTHER
from plumbob.filters.offline import Stage, lagged
from plumbob.filters.start import TRUTH_WORD
from plumbob.live import rows
from plumbob.live.runner import Note, Ran, Watch, run_stream
from plumbob.live.session import Session
from plumbob.live.session_toml import load_session, of_unit, recorded_session
from plumbob.live.sinks import Collected, Sink, TrackKeeper, estimate_rows
from plumbob.live.sources import ReplaySource
from plumbob.live.stream import ItemResult, Stream
from plumbob.rotations import Frame

NO_SAMPLE: Final = "{} holds no sample that could be decoded; 'plumbob verify' says what is in it."


@dataclass(frozen=True, eq=False, repr=False)
class Replayed(Ran, Series):
    """What a recording gave when it went through the stream again.

    `log.damage` says what is wrong with the recording; `found` and `track` hold what was kept.
    """

    log: Log
    found: Collected
    track: AttitudeTrack | None
    comparison: "ReplayComparison | None" = None

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Of the track."""
        return self._estimate.columns()

    @property
    def _estimate(self) -> AttitudeTrack:
        if self.track is None:
            raise ParameterError("nothing was estimated, so there is no track to write; name a filter with --filter.")
        return self.track

    @property
    def imu(self) -> ImuData | None:
        """Samples, calibrated where the session has a card; None where there are none, or they were not kept."""
        return self.found.imu(calibrated=True)

    @property
    def t0_ns(self) -> int:
        """UTC of the first sample, ns since 1970; 0 where there is none, or it is not known."""
        first, info = self.stream.t0_ns, self.log.first_info
        return 0 if first is None else first + (0 if info is None else info.epoch_offset_ns)

    def as_recording(self) -> Recording:
        """The track, with where it comes from, for `plumbob.write` and `plumbob.convert`."""
        source = info("source.replayed", file=self.log.paths[0].name, by=self._estimate.source)
        return Recording(track=self._estimate, notes=(source, *inferred(self.stream.time_report())))

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        same = self.comparison
        return super().summary() | ({} if same is None else {"check": {**asdict(same), "equal": same.equal}})

    def text(self) -> str:
        """What a reader wants to know first, a line each."""
        same = self.comparison
        return super().text() + ("" if same is None else f"\ncheck        {same}")


def open_recording(path: str | Path) -> tuple[Log, Session]:
    """Open a recording of a line, and the session that it holds."""
    log = open_log(Path(path))
    return log, recorded_session(log.metadata, Path(path).stem)


def replay(
    recording: "str | Path | Log", *, session: Session | str | Path | None = None, filter: str | None = None,
    lag: float | str | None = None, params: Mapping[str, Any] | None = None, frame: Frame | str | None = None,
    calibration: CalibrationCard | str | Path | None = None, noise: NoiseCard | str | Path | None = None,
    init: str | None = None, unit: str | None = None, speed: float | None = None, check: bool = False,
    covariance: bool = False, keep: Literal["all", "track", "nothing"] = "all", send: Sequence[str] = (),
    sinks: Sequence[Sink] = (), note: Note | None = None, opened: Callable[[Session], object] | None = None,
) -> Replayed:  # fmt: skip
    """Send the bytes of a recording through the same stream again, or through another.

    Parameters
    ----------
    recording : path or Log
        Made by `plumbob record` (``.mcap``).
    session : Session or path, optional
        Instead of the recording's own.
    filter, lag, params, frame, calibration, noise, init : optional
        What to estimate with instead of the session's, as in `plumbob.estimate`.
    unit : str, optional
        Another unit of the same frames.
    speed : float, optional
        How many times as fast as it was; as fast as it goes where None.
    check : bool
        Whether to compare with the attitude that was estimated live, bit for bit.
    covariance : bool
        Whether the track is to have the covariance that a filter claims.
    keep : {"all", "track", "nothing"}
        What the result holds in memory besides its counts.
    send : sequence of str
        To whom the attitude is sent, as of `plumbob.record`; what the session sent while it was recorded is not sent
        again.
    sinks : sequence of Sink
        What else takes the samples and attitudes as they come.
    note : callable, optional
        Called with each remark as it is made.
    opened : callable, optional
        Called with the session before it runs.

    Returns
    -------
    Replayed

    Raises
    ------
    DecodeError
        If it is not a recording of a stream, or holds no attitude to compare with.
    ParameterError, FrameError
        If what is asked for does not go together.
    """
    if speed is not None and not speed > 0.0:
        raise ParameterError(f"--speed must be above 0, but it is {speed:g}.")
    log, stored = (recording, None) if isinstance(recording, Log) else open_recording(recording)
    chosen = _session(log, stored, session)
    chosen = _changed(chosen, unit, calibration)
    chosen = _estimated(chosen, *lagged(filter, lag, params), frame, noise, init)
    if opened is not None:
        opened(chosen)
    stream, collected, tracks = Stream(chosen, covariance=covariance), Collected(), TrackKeeper()
    watch, checks = Watch(stream, note, events=False), _checks(log, chosen) if check else []
    collectors: dict[str, Sink] = {"all": collected, "track": tracks}
    wanted = [watch, *([collectors[keep]] if keep in collectors else []), *checks, *sinks]
    wanted += _sending(chosen, log, send, note)
    run_stream(stream, ReplaySource(log, speed), sinks=wanted)
    if note is not None:
        missing = (f"{counted(count, 'row')} of {topic} missing" for topic, count in log.missing.items())
        for line in (*missing, *map(str, log.damage)):
            note(f"{log.paths[0].name}: {line}")
    track = collected.track() if keep == "all" else tracks.track()
    return Replayed(watch, log, collected, track, ReplayComparison.joined(checks) if checks else None)


def _sending(session: Session, log: Log, send: Sequence[str], note: Note | None) -> list[Sink]:
    """Sinks of what is sent; they may wait, because nothing is lost while a file does."""
    if not send:
        return []
    from plumbob.live.sending import send_sinks, with_sent

    offset_ns = 0 if log.first_info is None else log.first_info.epoch_offset_ns
    return [*send_sinks(with_sent(replace(session, send=()), send), note=note, replayed_ns=offset_ns)]


def _checks(log: Log, session: Session) -> "list[Check]":
    """Checks of all sources that give attitudes; DecodeError where the recording holds none."""
    checks = [Check(log, name) for name, each in session.sources.items() if each.has_attitude]
    checks += [Check(log, "", rows.JOINTS)] * (session.chain is not None)
    if all(check.is_over for check in checks):
        raise DecodeError(
            "the recording holds no attitudes to compare with: no filter ran, or no frame could be decoded."
        )
    return checks


def _session(log: Log, stored: Session | None, chosen: Session | str | Path | None) -> Session:
    if isinstance(chosen, Session):
        return chosen
    if chosen is not None:
        info, first = log.first_info, next(iter(log), None)
        day = None if info is None or first is None else iso_day(info.epoch_offset_ns + first.t_ns)
        return load_session(chosen, date=day)
    return stored or recorded_session(log.metadata, log.paths[0].stem)


def _changed(session: Session, unit: str | None, calibration: CalibrationCard | str | Path | None) -> Session:
    """Session of another unit, or with another card."""
    if unit is not None:
        session = of_unit(session, unit)
    if calibration is None:
        return session
    card = CalibrationCard.of(calibration)
    if card.device != session.meta.device:
        raise ParameterError(f"the card is for '{card.device}', but the recording is of '{session.meta.device}'.")
    return replace(session, card=card)


def _estimated(
    session: Session, filter: str | None, params: Mapping[str, Any] | None, named_frame: Frame | str | None,
    noise: NoiseCard | str | Path | None, init: str | None,
) -> Session:  # fmt: skip
    """Session with another filter, where one is named."""
    if filter is None:
        if not (params or noise or init):
            return session
        if session.stage is not None:
            raise ParameterError(
                f"--params, --noise and --init belong to a filter, and the session has {session.stage.filter}. Name "
                "the one that is meant with --filter."
            )
        filter = SMOOTHER
    frame = session.frame if named_frame is None else Frame.parse(named_frame)
    if frame is None:
        raise FrameError("the recording's session names no frame. Give --frame ENU, NED or NWU.")
    if init == TRUTH_WORD and session.reference is None:
        raise ParameterError("--init truth takes the reference of the recording's session, which names none.")
    stage = Stage(filter, dict(params or {}), noise=None if noise is None else NoiseCard.of(noise), init=init)
    return replace(session, stage=stage, frame=frame, meta=replace(session.meta, frame=frame))


@dataclass(frozen=True, slots=True)
class ReplayComparison:
    """Replay against what was recorded live."""

    compared: int  # attitudes that both have at the same place in time
    different: int  # those of them of which a bit differs, in attitude, bias or flags
    # only_live, only_replayed: attitudes that only one of the two has at that place
    only_live: int
    only_replayed: int

    @classmethod
    def joined(cls, checks: "Sequence[Check]") -> "ReplayComparison":
        """What the checks of all sources have found so far."""
        return cls(*map(sum, zip(*(check.counts for check in checks), strict=True)))

    @property
    def equal(self) -> bool:
        """Whether both are the same, to the bit."""
        return self.compared > 0 and not (self.different or self.only_live or self.only_replayed)

    def __str__(self) -> str:
        verdict = "EQUAL to the bit" if self.equal else "NOT equal"
        return (
            f"{verdict}: {counted(self.compared, 'attitude')} compared, {self.different} different, "
            f"{self.only_live} only live, {self.only_replayed} only replayed"
        )


class Check(Sink):
    """Sink that compares estimates of a kind of a source, as they come, with those that a recording holds, bit for bit.

    Both are read in their order, and of each no more than a chunk is held. Where two rows differ in time, the earlier
    one is left over.
    """

    def __init__(self, log: Log, source: str = "", kind: str = rows.ATTITUDE) -> None:
        self.source, self._kind, again, topic = source, kind, log.again(), rows.named_topic(kind, source)
        self._live = (rows.shifted(message.data, again.shift_ns) for message in again if message.topic == topic)
        self._next = next(self._live, None)
        self._compared = self._different = self._only_live = self._only_replayed = 0

    @property
    def is_over(self) -> bool:
        """Whether the recording holds no further attitude."""
        return self._next is None

    def on_part(self, part: ItemResult) -> None:
        """Compare its attitudes with the next ones of the recording."""
        for row in estimate_rows(self._kind, part):
            self._take(row)

    def close(self) -> None:
        """Count what the recording holds beyond the last attitude."""
        if self._next is not None:
            self._only_live += 1 + sum(1 for _ in self._live)
            self._next = None

    @property
    def counts(self) -> tuple[int, int, int, int]:
        """What was found so far, as `ReplayComparison` has it."""
        return self._compared, self._different, self._only_live, self._only_replayed

    def _take(self, row: bytes) -> None:
        while (ahead := self._ahead(row)) < 0:
            self._only_live += 1
            self._next = next(self._live, None)
        if ahead > 0:
            self._only_replayed += 1
            return
        self._compared += 1
        self._different += self._next != row
        self._next = next(self._live, None)

    def _ahead(self, row: bytes) -> int:
        """By how much the recording's next row is later than another; it is after its end, too."""
        if self._next is None:
            return 1
        return 0 if self._next == row else rows.row_ns(self._kind, self._next) - rows.row_ns(self._kind, row)
