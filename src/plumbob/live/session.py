"""A session: everything about a live line that its bytes do not say, as plain data. `session_toml` reads it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final

from plumbob.calibration.gyr.drift import CompensatedRates
from plumbob.core import schema
from plumbob.core.errors import FrameError, ParameterError, unknown_name
from plumbob.core.files import reading
from plumbob.core.findings import Finding
from plumbob.core.units import Quantity, given
from plumbob.data import ImuMeta
from plumbob.data.array import UnitMount
from plumbob.data.cards import CalibrationCard
from plumbob.filters.channel import RateFilter
from plumbob.filters.known import EXTENSIBLE
from plumbob.filters.offline import Stage
from plumbob.live.transports.outgoing import FileTarget, parse_target
from plumbob.protocols.attitude import BodyAxes
from plumbob.protocols.format import Format, Message
from plumbob.rotations import Frame, North


@dataclass(frozen=True, slots=True)
class SourceSpec:
    """Where the bytes come from."""

    kind: str  # ``"serial"``, ``"stdin"``, ``"file"``, ``"udp"`` and so on: the keys of `session_toml`'s parsers
    # what that kind needs: ``port`` and ``baud``, or ``host`` and ``port``, and so on; of a device of the kernel also
    # the ``layout`` of its bytes
    settings: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class RecordSpec:
    """Where the recording goes, and when it is cut."""

    path: str  # name of the recording, ``.mcap``; ``{utc}`` in it stands for the time of the start
    rotate: Annotated[float | None, schema.size(Quantity.TIME)] = None  # time after which a new part begins, s
    rotate_bytes: Annotated[int | None, schema.whole(1)] = None  # size after which a new part begins
    # bytes of the disk that stay free; by default the smaller of 1 GiB and 5 % of it
    reserve: Annotated[int | None, schema.whole(0)] = None
    samples: bool = True  # whether decoded samples and attitudes stand beside the raw bytes, for viewers
    # whether a start goes on with the next part where the name exists, as after a crash, instead of refusing
    next_part: bool = False


@dataclass(frozen=True, slots=True)
class ReferenceSpec:
    """An attitude that the device says in the same frames: a reference, or all that there is."""

    north: North  # what its heading counts from
    unit: str = ""  # prefix of its fields
    # navigation frame of a quaternion, or of a yaw; of a heading it is NED, from which that counts clockwise
    frame: Frame | None = None


_HEADED: Final = ("heading", "pitch", "roll")
_OTHERS: Final = (("qw", "qx", "qy", "qz"), ("yaw", "pitch", "roll"))


def reference_names(spec: ReferenceSpec, message: Message) -> tuple[str, ...]:
    """Names of the fields with its attitude: a quaternion, or angles from yaw to roll; ParameterError without any."""
    has = {f.name for f in message.fields}
    forms = [_HEADED] if spec.frame is None else [*_OTHERS, *[_HEADED] * (spec.frame is Frame.NED)]
    names = [tuple(f"{spec.unit}.{name}" if spec.unit else name for name in form) for form in forms]
    if chosen := next((form for form in names if has.issuperset(form)), None):
        return chosen
    prefix = f"{spec.unit}." * bool(spec.unit)
    for form in _OTHERS:
        if spec.frame is None and has.issuperset(f"{prefix}{name}" for name in form):
            raise FrameError(f"[reference] has {', '.join(form)}, so it needs frame: {', '.join(Frame)}.")
    lacking = next(name for name in names[0] if name not in has)
    raise ParameterError(f"[reference] needs {', '.join(names[0])} in message {message.name}, which has no {lacking}.")


@dataclass(frozen=True, slots=True)
class OutputSpec:
    """What is handed on while the line runs."""

    every: Annotated[float, schema.size(Quantity.TIME)] = 0.05  # least time between two outputs, s
    # text file that gets a line for each, as the hosts of the papers wrote it; ``{utc}`` as in the recording
    text: str | None = None


SENT_AS: Final = ("nmea", "tss1", "mavlink", "json", "ros2")  # forms in which an attitude is sent


@dataclass(frozen=True, slots=True)
class SendSpec:
    """An attitude that is sent to another program."""

    kind: str  # form of the messages, of `SENT_AS`
    to: str  # target, as ``udp:127.0.0.1:10110``
    rate: float | None = None  # attitudes per second at most, Hz
    sentences: tuple[str, ...] = ()  # NMEA sentences; empty for all that the heading allows
    body: str | None = None  # body axes, ``"FRD"`` or ``"FLU"``; None for those that go with the frame
    of: str = ""  # which of several sources' attitude; empty for the first


def parameter(_: str, value: Any) -> Any:
    """Numbers follow the rule for text: where two units are usual, one must stand there."""
    return repr(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


@dataclass(frozen=True, slots=True)
class RateSpec:
    """How rates are compensated and filtered before an attitude is estimated, as of `plumbob.filter_rates`."""

    filter: str
    params: Annotated[Mapping[str, Any], schema.mapping(parameter)] = field(default_factory=dict)
    drift: str | None = None
    # how long the unit lies still at the start, s: the mean of that is taken off, and nothing is given before its end
    rest: Annotated[float | None, schema.size(Quantity.TIME)] = None

    def made(self, say: Callable[[Finding], None] = lambda finding: None) -> CompensatedRates:
        """What takes the samples of a stream; ParameterError where something is not known."""
        rest = None if self.rest is None else (0.0, self.rest)
        return CompensatedRates(
            RateFilter(self.filter, channels=3, params=self.params), drift=self.drift, rest=rest, say=say
        )


def needed_frame(what: str, frame: Frame | None) -> Frame:
    """The navigation frame of what estimates; FrameError where none is named."""
    if frame is None:
        raise FrameError(f"{what} needs imu.frame, because there is no default; known: {', '.join(Frame)}.")
    return frame


@dataclass(frozen=True, slots=True)
class ChainSpec:
    """A chain whose segments carry the units; joint angles are estimated as they come, as of `plumbob.arm.run`."""

    file: str
    text: str  # of that file: a chain, or the card that 'plumbob arm align' makes of it
    pose: str | tuple[float, ...] | None = None  # angles at the first sample, rad, or ``"zero"``
    pose_sd: float | None = None  # how exactly they were held, rad
    params: Mapping[str, Any] = field(default_factory=dict)
    button: str = ""  # field of the frames that starts a recording from a page, and stops it, where it leaves 0

    def made(self, frame: Frame | None, units: Sequence[str]) -> Any:
        """A `plumbob.arm.ArmStream`; ParameterError where the chain does not fit the units."""
        if not units:
            raise ParameterError('[chain] needs several units that are all decoded; give units = "all" in [format].')
        arm: Any = EXTENSIBLE.find("chain")
        how: dict[str, Any] = {
            "frame": needed_frame("[chain]", frame),
            "pose": self.pose,
            "params": self.params,
            "units": units,
        }
        how |= {"pose_sd": self.pose_sd} if self.pose_sd else {}
        with reading(Path(self.file)):
            return arm.ArmStream(arm.parsed_chain(self.text, Path(self.file).stem), **how)


@dataclass(frozen=True, slots=True)
class UnitSpec:
    """One of several units of the same frames."""

    unit: str  # prefix of its fields
    meta: ImuMeta  # device, ranges, axes and so on of its samples
    card: CalibrationCard | None = None  # its calibration; None says uncalibrated
    mount: UnitMount = field(default_factory=UnitMount)  # how it sits on its body


@dataclass(frozen=True, slots=True)
class Session:
    """A live line.

    Attributes
    ----------
    name : str
        Short name, for files and messages.
    source : SourceSpec or None
        Where the bytes come from; None where they are handed in, as from a recording.
    form : Format
        What they mean, bound.
    message, unit : str
        Which message has the samples, and which unit's fields of it an attitude is estimated from.
    meta : ImuMeta
        Device, ranges, axes and so on of the samples.
    frame : Frame or None
        Navigation frame; None where nothing is estimated.
    card : CalibrationCard or None
        Calibration; None says uncalibrated.
    rates : RateSpec or None
        What is done with rates before; None where that is nothing.
    stage : Stage or None
        Filter; None where nothing is estimated.
    reference : ReferenceSpec or None
        Attitude that the device itself says in the same frames; None where it says none.
    record : RecordSpec or None
        Recording; None where none is made.
    output : OutputSpec
        What is handed on.
    timed_by : str
        What gives the time of a sample: ``"frames"``, as far as they carry it; ``"count"``, frames
        alone, whenever they were read; ``"poll"``, the host, which asks for each; ``"kernel"``, time stamps of the
        host's own monotonic clock in the frames.
    texts : mapping of str to str
        The session file and every file that it names, so that a recording can hold them and be replayed anywhere.
    units : tuple of UnitSpec
        All units that are decoded, calibrated and recorded, where these are several; `unit` is one of them.
    scheme : str
        How these are one array, of `plumbob.filters.known.ARRAY_SCHEMES`; empty where they are not.
    chain : ChainSpec or None
        The chain that carries them; None where they are on none.
    send : tuple of SendSpec
        To whom the attitude is sent while the line runs; a replay sends only where that is asked for.
    beside : tuple of Session
        Further sources of the same recording, by their names, on one clock; what they record and send is said here.
    """

    name: str
    source: SourceSpec | None
    form: Format
    message: str
    unit: str
    meta: ImuMeta
    frame: Frame | None = None
    card: CalibrationCard | None = None
    rates: RateSpec | None = None
    stage: Stage | None = None
    reference: ReferenceSpec | None = None
    record: RecordSpec | None = None
    output: OutputSpec = OutputSpec()
    timed_by: str = "frames"
    texts: Mapping[str, str] = field(default_factory=dict)
    units: tuple[UnitSpec, ...] = ()
    scheme: str = ""
    chain: ChainSpec | None = None
    send: tuple[SendSpec, ...] = ()
    beside: "tuple[Session, ...]" = ()

    @property
    def sources(self) -> "dict[str, Session]":
        """Itself under an empty name, and those beside it by theirs."""
        return {"": self, **{other.name: other for other in self.beside}}

    @property
    def has_attitude(self) -> bool:
        """Whether it gives attitudes: of a filter, else those that the device says."""
        return self.stage is not None or self.reference is not None

    @property
    def made_chain(self) -> Any:
        """The `plumbob.arm.ArmStream` of its chain; None where it has none."""
        return None if self.chain is None else self.chain.made(self.frame, [unit.unit for unit in self.units])


def send_spec(
    kind: str, to: str, *, rate: float | str | None = None, sentences: str | Sequence[str] = (),
    body: BodyAxes | str | None = None, of: str = "",
) -> SendSpec:  # fmt: skip
    """What to send, checked."""
    if kind not in SENT_AS:
        raise unknown_name("form of an attitude", kind, SENT_AS)
    names = tuple(sentences.split(",") if isinstance(sentences, str) else sentences)
    if kind == "nmea":
        from plumbob.protocols.attitude.lines import sentences_for

        names = sentences_for(names, North.TRUE, 0.0) if names else ()
    elif names:
        raise ParameterError(f"sentences belong to nmea, not to {kind}; leave --sentences out.")
    target = parse_target(to, overwrite=True)
    if kind == "ros2" and not isinstance(target, FileTarget):
        raise ParameterError("ros2 is written as an MCAP file; name file:PATH.mcap as its target.")
    axes = None if body is None else str(BodyAxes.parse(body))
    return SendSpec(kind, to, given("rate", rate, Quantity.FREQUENCY, positive=True), names, axes, of)


def sends_joints(session: Session, spec: SendSpec) -> bool:
    """Whether it sends the joint angles of the session's chain instead of an attitude."""
    return session.chain is not None and spec.kind == "json" and not spec.of


def require_sent(session: Session, spec: SendSpec) -> None:
    """Refuse to send what nothing estimates."""
    if not (session.sources[spec.of].has_attitude or sends_joints(session, spec)):
        text = f"{spec.kind} sends an attitude, but nothing estimates one. Name a filter with --filter, or [estimate]"
        raise ParameterError(f"{text}; json sends joint angles." if session.chain else f"{text}.")


def parse_send(text: str) -> SendSpec:
    """What to send of one text, as ``"nmea udp:127.0.0.1:10110 10Hz HDT,PASHR"``; the first two words must be."""
    words = text.split()
    if len(words) < 2:
        raise ParameterError(f"'{text}' needs a form and a target, as 'nmea udp:127.0.0.1:10110 10Hz'.")
    kind, to, *rest = words
    rates = [word for word in rest if word[0].isdigit()]
    axes = [word for word in rest if word.upper() in list(BodyAxes)]
    names = [word for word in rest if word not in rates and word not in axes]
    if max(len(rates), len(axes), len(names)) > 1:
        raise ParameterError(f"'{text}' has more words than a form, a target, a rate, sentences and body axes.")
    return send_spec(
        kind, to, rate=rates[0] if rates else None, sentences=names[0] if names else (), body=axes[0] if axes else None
    )


SEND_TABLE: Final = schema.form(
    {
        "as": schema.one_of(*SENT_AS),
        "to": schema.text,
        "rate": schema.size(Quantity.FREQUENCY),
        "sentences": schema.texts,
        "body": schema.one_of(*BodyAxes),
        "of": schema.text,
    },
    ("as", "to"),
    lambda _, table: send_spec(table.pop("as"), table.pop("to"), **table),
)
"""Parser of a table ``[[send]]``."""
