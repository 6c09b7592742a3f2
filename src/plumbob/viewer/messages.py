"""What the server and a page say to each other, as dataclasses; the page's types in TypeScript are made of them.

Everything is JSON but the samples. A binary message is a tick: ``State`` as JSON, and the rows of the charts since the
last one. Its layout, little-endian: ``u32`` kind (1 tick, 2 history), ``u32`` bytes of the JSON (a multiple of 8, with
spaces at its end; 0 in a history), ``u32`` rows n, ``u32`` columns m, ``u32`` epoch, ``u32`` nothing; then the JSON,
``f64`` times [n], ``u32`` flags [n] and, column after column as `Hello.columns` names them, ``f32`` values [m][n].

A state supersedes the one before it: whoever is slow gets the newest. Events queue. All numbers are in the units that
`Hello` names, as they are shown: degrees, °/s, m/s², µT, °C; quaternions are scalar first, body to navigation.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal

if TYPE_CHECKING:
    from plumbob.core.check import Floats

PROTOCOL: Final = 1
"""Version of these messages; a page of another version says so instead of drawing."""
TICK: Final = 1
HISTORY: Final = 2
"""Kinds of binary messages."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of the charts' rows.

    Attributes
    ----------
    key : str
        Name: ``gyr.x``, ``acc.y``, ``mag.z``, ``temp``, or ``NAME.roll`` of an estimator or of ``reference``.
    chart : str
        Chart that shows it: ``attitude``, ``error``, ``sd``, ``bias``, ``residual``, ``rate``, ``force``, ``field``,
        ``temperature``.
    label : str
        Short, as x or roll.
    unit : str
        As it is shown.
    digits : int
        Behind the decimal point.
    source : str
        Estimator, ``reference`` or sensor (``gyr``) that it is of.
    """

    key: str
    chart: str
    label: str
    unit: str
    digits: int
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimator:
    """What gives an attitude.

    Attributes
    ----------
    name : str
        Unique; ``reference`` is the reference.
    title : str
        Filter with what differs from its defaults.
    primary : bool
        Whether it is the session's own, which the body shows.
    claims : bool
        Whether it claims a covariance.
    """

    name: str
    title: str
    primary: bool
    claims: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Skeleton:
    """A chain's stick figure: names of its points, and which of them are joined."""

    points: Sequence[str]
    lines: Sequence[Sequence[int]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello:
    """First message of a connection, and again when the stream, its estimators or its columns have changed.

    Attributes
    ----------
    session, device, format, calibration, noise : str
        As reports name them; calibration says ``uncalibrated`` where there is no card.
    live : bool
        Whether samples come as they are measured; without it a recording is played.
    frame : str or None
        ``ENU``, ``NED`` or ``NWU``; None where nothing is estimated.
    north : str or None
        What a heading counts from: ``true``, ``magnetic`` or ``free``.
    axes : str
        Axes of the body: ``FLU`` (forward, left, up) or ``FRD`` (forward, right, down).
    rate : float or None
        Nominal samples per second.
    columns : sequence of Column
        Of the rows of the charts.
    raw : sequence of Column
        Fields of a frame as they were decoded, counts or words; `State.raw` has their values.
    estimators : sequence of Estimator
        The primary one first.
    filters : sequence of str
        Names of estimators that can be added.
    skeleton : Skeleton or None
        Where the session is of a chain.
    guides : sequence of str
        What can be calibrated with guidance here: ``mag``, ``accel``, ``gyro``.
    regions : sequence of sequence of float
        The 18 directions of a guide, unit vectors.
    regions_names : sequence of str
        Their names.
    control : bool
        Whether commands are taken.
    recording : bool
        Whether there is something that can be recorded.
    duration : float or None
        Of a recording that is played, s.
    started_utc : float or None
        UTC of time 0, s since 1970.
    gravity : float
        Magnitude that residuals are taken against, m/s².
    version : str
        Of Plumbob.
    protocol : int
        Of these messages.
    """

    type: Literal["hello"] = "hello"
    session: str
    device: str
    format: str
    calibration: str
    noise: str
    live: bool
    frame: str | None
    north: str | None
    axes: str
    rate: float | None
    columns: Sequence[Column]
    raw: Sequence[Column]
    estimators: Sequence[Estimator]
    filters: Sequence[str]
    skeleton: Skeleton | None
    guides: Sequence[str]
    regions: Sequence[Sequence[float]]
    regions_names: Sequence[str]
    control: bool
    recording: bool
    duration: float | None
    started_utc: float | None
    gravity: float
    version: str
    protocol: int = PROTOCOL


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """Newest attitude of an estimator; angles in degrees.

    Attributes
    ----------
    q_nb : sequence of float
        Body to navigation, wxyz.
    roll, pitch, yaw : float
        After a tare, where one is set; yaw from 0 to 360 where it is a heading.
    sd : sequence of float or None
        Claimed standard deviations of roll, pitch, yaw.
    error : float or None
        Angle to the reference.
    """

    q_nb: Sequence[float]
    roll: float
    pitch: float
    yaw: float
    sd: Sequence[float] | None = None
    error: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """How the stream does: rates in Hz, times in s.

    Attributes
    ----------
    rate : float or None
        Samples per second over the last seconds.
    latency : float or None
        From the arrival of the newest sample to the sending of this message.
    age : float or None
        Since the newest sample arrived.
    samples, lost, gaps, junk, rejected, unusable : int
        Counts since the start: samples; frames that are missing, and in how many gaps; bytes of no frame; frames whose
        check failed; frames that were repeated or late.
    drift_ppm : float or None
        Of the device's clock against this host's.
    clock : str
        What gives the time: ``clock``, ``counter``, ``rate``...
    skipped : int
        Batches that the server did not get, because it was too slow.
    """

    rate: float | None
    latency: float | None
    age: float | None
    samples: int
    lost: int
    gaps: int
    junk: int
    rejected: int
    unusable: int
    drift_ppm: float | None
    clock: str
    skipped: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """The recording that is made: rows written, acknowledged by the disk, dropped.

    Its start, `since`, is UTC, s since 1970.
    """

    path: str
    rows: int
    acknowledged: int
    dropped: int
    since: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Playback:
    """Where a recording is, s; how fast; whether it plays."""

    position: float
    speed: float
    playing: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What is the case now; it supersedes the state before it.

    Attributes
    ----------
    epoch : int
        Rises when time begins again, as after a seek: charts are cleared.
    t : float or None
        Time of the newest sample, s.
    sent : float
        UTC of this message, s since 1970.
    values : sequence of float or None
        Newest value of each of `Hello.columns`.
    raw : sequence of float or None
        Newest of each of `Hello.raw`.
    flags : sequence of str
        Names of the newest sample's flags, and of the primary estimator's.
    attitudes : mapping of str to Attitude
        Newest by estimator, ``reference`` too.
    gravity_b, field_b : sequence of float or None
        Measured specific force, m/s², and field, µT, in body axes, calibrated.
    points : sequence of sequence of float or None
        Of the skeleton, m, navigation axes.
    link : Link
        How the stream does.
    recording : Recorded or None
        None where nothing is recorded.
    text : str or None
        Text file that is written, where one is.
    playback : Playback or None
        Of a recording that is played.
    tared : bool
        Whether angles count from a tare.
    guide : str or None
        What is being calibrated.
    """

    type: Literal["state"] = "state"
    epoch: int
    t: float | None
    sent: float
    values: Sequence[float | None]
    raw: Sequence[float | None]
    flags: Sequence[str]
    attitudes: dict[str, Attitude]
    gravity_b: Sequence[float] | None
    field_b: Sequence[float] | None
    points: Sequence[Sequence[float] | None] | None
    link: Link
    recording: Recorded | None
    text: str | None
    playback: Playback | None
    tared: bool
    guide: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Happened:
    """An event, which queues: of the line, of the recording, a mark, a flag that rose or fell, a command that was done.

    Attributes
    ----------
    id : int
        Rises by one; a page that was away sees what it missed.
    t : float or None
        Time of the stream, s.
    kind : str
        ``gap``, ``lost``, ``reopened``, ``flag``, ``mark``, ``remark``, ``recording``, ``command``, ``view``...
    text : str
        A sentence.
    """

    type: Literal["event"] = "event"
    id: int
    t: float | None
    kind: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class AllanCurve:
    """Overlapping Allan deviation of the stream so far; it supersedes the one before it.

    Attributes
    ----------
    duration : float
        Of the stream that it is of, s.
    tau : sequence of float
        Averaging times, s.
    deviation : mapping of str to sequence of float or None
        By channel (``gyr.x``), in the unit of its column.
    """

    type: Literal["allan"] = "allan"
    duration: float
    tau: Sequence[float]
    deviation: dict[str, Sequence[float | None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Guidance:
    """How a guided calibration stands; it supersedes the one before it.

    Attributes
    ----------
    kind : str
        ``mag``, ``accel`` or ``gyro``.
    elapsed, still_for : float
        Since the start, and at rest until now, s.
    filled : sequence of bool or None
        The 18 directions that were seen.
    direction, goal : int or None
        The direction at present, and the one to go to next.
    axis, angle : int, float or None
        The turn that is asked for: about axis 0, 1 or 2 of the unit, degrees.
    next_step : str
        The same in words.
    predicted, grade : str or None
        Provisional figure of the calibration, and its grade.
    share : float
        Done, from 0 to 1.
    warnings : sequence of str
        What is wrong at present.
    done : bool
        Whether it is enough.
    cloud : sequence of sequence of float
        Newest directions of what is measured, unit vectors, for the sphere.
    card : str or None
        The card that was written.
    refused : sequence of str
        Why no card could be made.
    """

    type: Literal["guide"] = "guide"
    kind: str
    elapsed: float
    still_for: float
    filled: Sequence[bool] | None
    direction: int | None
    goal: int | None
    axis: int | None
    angle: float | None
    next_step: str
    predicted: str
    grade: str | None
    share: float
    warnings: Sequence[str]
    done: bool
    cloud: Sequence[Sequence[float]]
    card: str | None = None
    refused: Sequence[str] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    """New lines of the device's output, at 20 Hz of the stream's time: as `plumbob record --text` writes them."""

    type: Literal["lines"] = "lines"
    lines: Sequence[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Answer to a command: to the page that gave it alone."""

    type: Literal["answer"] = "answer"
    id: int
    ok: bool
    text: str


Verb = Literal[
    "record", "stop", "mark", "tare", "untare", "text", "text-stop", "add", "remove",
    "play", "pause", "seek", "speed", "calibrate", "calibrate-end", "calibrate-cancel", "allan-reset",
]  # fmt: skip
"""What a page, or `plumbob control`, can ask for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """What a page asks for.

    Attributes
    ----------
    id : int
        Of the page's choice; the answer has it.
    verb : Verb
        ``record`` (`name`, optional) and ``stop``; ``mark`` (`text`); ``tare``, ``untare``; ``text`` (`name`, optional)
        and ``text-stop``; ``add`` and ``remove`` an estimator (`name`); ``play``, ``pause``, ``seek`` (`value`, s),
        ``speed`` (`value`); ``calibrate`` (`name`: the kind), ``calibrate-end`` (makes the card),
        ``calibrate-cancel``; ``allan-reset``.
    name, text : str
        Letters, digits, ``-``, ``_`` and ``.`` in a name, never a path; a text of at most 200 letters.
    value : float or None
        A number.
    """

    id: int
    verb: Verb
    name: str = ""
    text: str = ""
    value: float | None = None


FromServer = Hello | State | Happened | AllanCurve | Guidance | Lines | Answer
"""All that a page must understand."""


@dataclass(frozen=True, slots=True)
class Batch:
    """What the feed hands to the server: samples of some milliseconds, and the newest of everything else.

    Attributes
    ----------
    rows : mapping of str to ndarray
        ``t`` (N,) s, ``flags`` (N,) u32, ``values`` (N, M) f64 in the units of `Hello.columns`, ``sensed`` (N, 10) f64:
        gyr, acc, mag uncalibrated, SI and µT, and temperature; what a guide and the Allan deviation are made of.
    fields : mapping of str to Any
        What `State` says beside them: ``raw``, ``attitudes`` (``q_nb``, ``sd``), ``gravity_b``, ``field_b``,
        ``points``, ``link``, ``recording``, ``text``, ``playback``, and ``arrived_ns``, the host's monotonic clock when
        the newest sample came.
    """

    rows: dict[str, Any]
    fields: dict[str, Any] = field(default_factory=dict)


def as_json(content: Mapping[str, Any]) -> str:
    """Message as it is sent."""
    return json.dumps(content, allow_nan=False, separators=(",", ":"))


def numbers(values: "Floats") -> list[float | None]:
    """Numbers (N,) as JSON has them: None where one is not finite."""
    return [value if abs(value) < math.inf else None for value in values.tolist()]
