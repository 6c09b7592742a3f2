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

PROTOCOL: Final = 1  # Version of these messages; a page of another version says so instead of drawing
TICK: Final = 1
HISTORY: Final = 2  # Kinds of binary messages


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of the charts' rows."""

    key: str  # name: ``gyr.x``, ``acc.y``, ``mag.z``, ``temp``, or ``NAME.roll`` of an estimator or of ``reference``
    # chart that shows it: ``attitude``, ``error``, ``sd``, ``bias``, ``residual``, ``rate``, ``force``, ``field``,
    # ``temperature``
    chart: str
    label: str  # short, as x or roll
    unit: str  # as it is shown
    digits: int  # behind the decimal point
    source: str  # estimator, ``reference`` or sensor (``gyr``) that it is of


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimator:
    """What gives an attitude."""

    name: str  # unique; ``reference`` is the reference
    title: str  # filter with what differs from its defaults
    primary: bool  # whether it is the session's own, which the body shows
    claims: bool  # whether it claims a covariance


@dataclass(frozen=True, slots=True, kw_only=True)
class Skeleton:
    """A chain's stick figure: names of its points, and which of them are joined."""

    points: Sequence[str]
    lines: Sequence[Sequence[int]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello:
    """First message of a connection, and again when the stream, its estimators or its columns have changed."""

    type: Literal["hello"] = "hello"
    # session, device, format, calibration, noise: as reports name them; calibration says ``uncalibrated`` where there
    # is no card
    session: str
    device: str
    format: str
    calibration: str
    noise: str
    live: bool  # whether samples come as they are measured; without it a recording is played
    frame: str | None  # ``ENU``, ``NED`` or ``NWU``; None where nothing is estimated
    north: str | None  # what a heading counts from: ``true``, ``magnetic`` or ``free``
    axes: str  # axes of the body: ``FLU`` (forward, left, up) or ``FRD`` (forward, right, down)
    rate: float | None  # nominal samples per second
    columns: Sequence[Column]  # of the rows of the charts
    raw: Sequence[Column]  # fields of a frame as they were decoded, counts or words; `State.raw` has their values
    estimators: Sequence[Estimator]  # the primary one first
    filters: Sequence[str]  # names of estimators that can be added
    skeleton: Skeleton | None  # where the session is of a chain
    guides: Sequence[str]  # what can be calibrated with guidance here: ``mag``, ``accel``, ``gyro``
    regions: Sequence[Sequence[float]]  # the 18 directions of a guide, unit vectors
    regions_names: Sequence[str]  # their names
    control: bool  # whether commands are taken
    recording: bool  # whether there is something that can be recorded
    duration: float | None  # of a recording that is played, s
    started_utc: float | None  # UTC of time 0, s since 1970
    gravity: float  # magnitude that residuals are taken against, m/s²
    version: str  # of Plumbob
    protocol: int = PROTOCOL  # of these messages


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """Newest attitude of an estimator; angles in degrees."""

    q_nb: Sequence[float]  # body to navigation, wxyz
    # roll, pitch, yaw: after a tare, where one is set; yaw from 0 to 360 where it is a heading
    roll: float
    pitch: float
    yaw: float
    sd: Sequence[float] | None = None  # claimed standard deviations of roll, pitch, yaw
    error: float | None = None  # angle to the reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """How the stream does: rates in Hz, times in s."""

    rate: float | None  # samples per second over the last seconds
    latency: float | None  # from the arrival of the newest sample to the sending of this message
    age: float | None  # since the newest sample arrived
    # samples, lost, gaps, junk, rejected, unusable: counts since the start: samples; frames that are missing, and in
    # how many gaps; bytes of no frame; frames whose check failed; frames that were repeated or late
    samples: int
    lost: int
    gaps: int
    junk: int
    rejected: int
    unusable: int
    drift_ppm: float | None  # of the device's clock against this host's
    clock: str  # what gives the time: ``clock``, ``counter``, ``rate``..
    skipped: int  # batches that the server did not get, because it was too slow


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
    """What is the case now; it supersedes the state before it."""

    type: Literal["state"] = "state"
    epoch: int  # rises when time begins again, as after a seek: charts are cleared
    t: float | None  # time of the newest sample, s
    sent: float  # UTC of this message, s since 1970
    values: Sequence[float | None]  # newest value of each of `Hello.columns`
    raw: Sequence[float | None]  # newest of each of `Hello.raw`
    flags: Sequence[str]  # names of the newest sample's flags, and of the primary estimator's
    attitudes: dict[str, Attitude]  # newest by estimator, ``reference`` too
    # gravity_b, field_b: measured specific force, m/s², and field, µT, in body axes, calibrated
    gravity_b: Sequence[float] | None
    field_b: Sequence[float] | None
    points: Sequence[Sequence[float] | None] | None  # of the skeleton, m, navigation axes
    link: Link  # how the stream does
    recording: Recorded | None  # none where nothing is recorded
    text: str | None  # text file that is written, where one is
    playback: Playback | None  # of a recording that is played
    tared: bool  # whether angles count from a tare
    guide: str | None  # what is being calibrated


@dataclass(frozen=True, slots=True, kw_only=True)
class Happened:
    """An event, which queues: of the line, the recording, a mark, a flag that rose or fell, a command that was done."""

    type: Literal["event"] = "event"
    id: int  # rises by one; a page that was away sees what it missed
    t: float | None  # time of the stream, s
    kind: str  # ``gap``, ``lost``, ``reopened``, ``flag``, ``mark``, ``remark``, ``recording``, ``command``, ``view``..
    text: str  # a sentence


@dataclass(frozen=True, slots=True, kw_only=True)
class AllanCurve:
    """Overlapping Allan deviation of the stream so far; it supersedes the one before it."""

    type: Literal["allan"] = "allan"
    duration: float  # of the stream that it is of, s
    tau: Sequence[float]  # averaging times, s
    deviation: dict[str, Sequence[float | None]]  # by channel (``gyr.x``), in the unit of its column


@dataclass(frozen=True, slots=True, kw_only=True)
class Guidance:
    """How a guided calibration stands; it supersedes the one before it."""

    type: Literal["guide"] = "guide"
    kind: str  # ``mag``, ``accel`` or ``gyro``
    # elapsed, still_for: since the start, and at rest until now, s
    elapsed: float
    still_for: float
    filled: Sequence[bool] | None  # the 18 directions that were seen
    # direction, goal: the direction at present, and the one to go to next
    direction: int | None
    goal: int | None
    # axis, angle: the turn that is asked for: about axis 0, 1 or 2 of the unit, degrees
    axis: int | None
    angle: float | None
    next_step: str  # the same in words
    # predicted, grade: provisional figure of the calibration, and its grade
    predicted: str
    grade: str | None
    share: float  # done, from 0 to 1
    warnings: Sequence[str]  # what is wrong at present
    done: bool  # whether it is enough
    cloud: Sequence[Sequence[float]]  # newest directions of what is measured, unit vectors, for the sphere
    card: str | None = None  # the card that was written
    refused: Sequence[str] = ()  # why no card could be made


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
    """What a page asks for."""

    id: int  # of the page's choice; the answer has it
    # ``record`` (`name`, optional) and ``stop``; ``mark`` (`text`); ``tare``, ``untare``; ``text`` (`name`, optional)
    # and ``text-stop``; ``add`` and ``remove`` an estimator (`name`); ``play``, ``pause``, ``seek`` (`value`, s),
    # ``speed`` (`value`); ``calibrate`` (`name`: the kind), ``calibrate-end`` (makes the card), ``calibrate-cancel``;
    # ``allan-reset``
    verb: Verb
    # name, text: letters, digits, ``-``, ``_`` and ``.`` in a name, never a path; a text of at most 200 letters
    name: str = ""
    text: str = ""
    value: float | None = None  # a number


FromServer = Hello | State | Happened | AllanCurve | Guidance | Lines | Answer  # All that a page must understand


@dataclass(frozen=True, slots=True)
class Batch:
    """What the feed hands to the server: samples of some milliseconds, and the newest of everything else."""

    # ``t`` (N,) s, ``flags`` (N,) u32, ``values`` (N, M) f64 in the units of `Hello.columns`, ``sensed`` (N, 10) f64:
    # gyr, acc, mag uncalibrated, SI and µT, and temperature; what a guide and the Allan deviation are made of
    rows: dict[str, Any]
    # what `State` says beside them: ``raw``, ``attitudes`` (``q_nb``, ``sd``), ``gravity_b``, ``field_b``, ``points``,
    # ``link``, ``recording``, ``text``, ``playback``, and ``arrived_ns``, the host's monotonic clock when the newest
    # sample came
    fields: dict[str, Any] = field(default_factory=dict)


def as_json(content: Mapping[str, Any]) -> str:
    """Message as it is sent."""
    return json.dumps(content, allow_nan=False, separators=(",", ":"))


def numbers(values: "Floats") -> list[float | None]:
    """Numbers (N,) as JSON has them: None where one is not finite."""
    return [value if abs(value) < math.inf else None for value in values.tolist()]
