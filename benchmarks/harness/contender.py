"""What takes part in the faults benchmark: our filters and their peers behind one face."""

import math
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.harness.fault_scene import FRAME, RATE, Row, Stream
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.params import Parameter, describe
from plumbob.core.time import Repeats
from plumbob.data import ImuData, ImuMeta
from plumbob.data.sample import ImuSample
from plumbob.filters import SMOOTHER, CommonParams, Filter, load
from plumbob.filters.offline import Stage
from plumbob.filters.smoother import FixedLag
from plumbob.live.timing.spec import Counter, TimeSpec
from plumbob.live.timing.timebase import TimeBase

STEP_NS = round(1e9 / RATE)

ALARMS: Final = (
    flags.NOT_CONVERGED | flags.INCONSISTENT | flags.HEADING_FREE | flags.GAP | flags.TIME_FAULT
    | flags.GYR_HELD | flags.GYR_CLIPPED | flags.GYR_INVALID | flags.GYR_STUCK | flags.ACC_STUCK | flags.MAG_STUCK
)  # fmt: skip
"""Flags that a user takes for a warning about the attitude.

Gates are none: a sensor that was not used says that the others were right. Neither is a value that is absent.
"""


class Answer(NamedTuple):
    """What a contender answers to a stream, sample by sample.

    Attributes
    ----------
    q_nb : ndarray (N, 4)
        Attitudes in ENU, of norm 1 or NaN.
    words : ndarray (N,)
        Flags, in the bits that the contender names.
    cov_b : ndarray (N, 3, 3) or None
        What it claims of the error in body axes, rad²; None where it claims nothing.
    errors : dict
        Each exception as text, and whether all of its kind were clear.
    """

    q_nb: Floats
    words: NDArray[np.int64]
    cov_b: Floats | None
    errors: dict[str, bool]


class Running(Protocol):
    """One that runs; errors come out as the library raises them."""

    def take(self, row: Row) -> int:
        """Take a sample and return its flags, in the bits that the contender names."""
        ...

    def give(self, gyr: Floats, acc: Any, mag: Floats | None) -> None:
        """Take the next regular sample, with any object as accelerometer, which no adapter touches."""
        ...

    def attitude(self) -> ArrayLike:
        """Attitude now, (4,), as the library has it."""
        ...


@dataclass(frozen=True, slots=True)
class Construction:
    """A way to build a contender that no careful user would choose.

    Attributes
    ----------
    name : str
        As in the tables.
    make : callable
        Builds it.
    sensible : bool
        Whether the argument lies in the domain that the contender declares, so that it must work if it is accepted.
    """

    name: str
    make: Callable[[], Running]
    sensible: bool = False


class Contender(Protocol):
    """What can be started again and again.

    Attributes
    ----------
    name : str
        As in the tables.
    settings : str
        What runs, in one line.
    timed : bool
        Whether it is given the time.
    words : Mapping
        Name of each flag bit.
    alarms : int
        Flag bits that warn of the attitude.
    none_is_absent : bool
        Whether None as accelerometer means that there is no value.
    can_kill : bool
        Whether its constructor can end the process, and must run in one of its own.
    """

    name: str
    settings: str
    timed: bool
    words: Mapping[int, str]
    alarms: int
    none_is_absent: bool
    can_kill: bool

    def start(self) -> Running:
        """Make a fresh one."""
        ...

    def fed(self, stream: Stream) -> Answer:
        """Answer to a stream that comes sample by sample."""
        ...

    def answer(self, stream: Stream) -> Answer:
        """Answer to a whole stream, with what is claimed."""
        ...

    def constructions(self) -> list[Construction]:
        """Odd ways to build one."""
        ...

    def enu(self, q: Floats) -> Floats:
        """Attitudes (N, 4) of the library as q_nb in ENU."""
        ...

    def quiet(self) -> AbstractContextManager[Any]:
        """Keep warnings of the library off the terminal."""
        ...


def is_clear(error: Exception) -> bool:
    """True for an error of the kind that says a value or a type is wrong, with a text."""
    return isinstance(error, ValueError | TypeError) and bool(str(error).strip())


def one_by_one(contender: Contender, stream: Stream) -> Answer:
    """Feed a stream sample by sample; after an exception the last attitude stays, and the next sample is fed."""
    running = contender.start()
    q = np.tile([1.0, 0.0, 0.0, 0.0], (stream.t.size, 1))
    words = np.zeros(stream.t.size, dtype=np.int64)
    errors: dict[str, bool] = {}
    with contender.quiet():
        for i, row in enumerate(stream.rows()):
            try:
                words[i] = running.take(row)
                q[i] = running.attitude()
            except Exception as error:
                q[i] = q[i - 1]
                errors[f"{type(error).__name__}: {error}"] = is_clear(error)
        return Answer(contender.enu(unit(q)), words, None, errors)


class RunningFilter:
    """One of our filters, fed sample by sample."""

    def __init__(self, filter_: Filter) -> None:
        self._filter = filter_
        self._t_ns = -STEP_NS

    def take(self, row: Row) -> int:
        """Take a sample and return its flags."""
        t_ns, gyr, acc, mag, known = row
        found = self._filter.update(ImuSample(t_ns, gyr, acc, mag, flags=known))
        self._t_ns = t_ns
        return found

    def give(self, gyr: Floats, acc: Any, mag: Floats | None) -> None:
        """Take the next regular sample, with any object as accelerometer."""
        self.take((self._t_ns + STEP_NS, gyr, acc, mag, 0))

    def attitude(self) -> Floats:
        """Attitude now, (4,)."""
        return self._filter.q_nb


class OurFilter:
    """A filter of this package with its parameters."""

    timed = True
    alarms = ALARMS
    none_is_absent = True
    can_kill = False

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.name = stage.name
        self.settings = self._filter(stage.params).describe()
        self.words: Mapping[int, str] = {bit: name for bit, (name, _) in flags.MEANING.items()}

    def start(self) -> Running:
        """Make a fresh one."""
        return self._with(self.stage.params)

    def _filter(self, params: Mapping[str, Any], **arguments: Any) -> Any:
        return Filter(self.stage.filter, **{"frame": FRAME, "params": params, **arguments})

    def _with(self, params: Mapping[str, Any], **arguments: Any) -> Running:
        return RunningFilter(self._filter(params, **arguments))

    def fed(self, stream: Stream) -> Answer:
        """Answer to a stream that comes sample by sample."""
        return one_by_one(self, stream)

    def answer(self, stream: Stream) -> Answer:
        """Answer to a whole stream, with what is claimed; the same bits."""
        rows, t_ns = np.arange(stream.t.size), np.round(stream.t * 1e9).astype(np.int64)
        track = self._filter(self.stage.params).process(part_of(stream, rows, t_ns), covariance=True, look=False)
        assert track.flags is not None
        return Answer(track.q_nb, track.flags.astype(np.int64), track.cov_b, {})

    def constructions(self) -> list[Construction]:
        """Every parameter with NaN, infinity, −1 and text, a wrong name, no frame, starts that are not attitudes."""
        own = load(self.stage.filter).Params
        known = [p for p in (*describe(own), *describe(CommonParams)) if not p.switch]
        found = [self._odd(p, value) for p in known for value in (math.nan, math.inf, -1.0, "much")]
        found.append(Construction("unknown parameter", partial(self._with, {**self.stage.params, "no_such_name": 1.0})))
        found.append(Construction("frame missing", lambda: RunningFilter(Filter(self.stage.filter))))  # type: ignore[call-arg]
        found.append(Construction("frame unknown", partial(self._with, self.stage.params, frame="up")))
        starts = {"of shape (3,)": np.ones(3), "of shape (1, 4)": np.ones((1, 4)), "zero": np.zeros(4),
                  "NaN": np.full(4, math.nan), "infinite": np.full(4, math.inf)}  # fmt: skip
        return found + [
            Construction(f"init {name}", partial(self._with, self.stage.params, init=init))
            for name, init in starts.items()
        ]

    def _odd(self, p: Parameter, value: Any) -> Construction:
        params = {**self.stage.params, p.name: value}
        inside = not isinstance(value, str) and p.spec.low <= value <= p.spec.high
        return Construction(f"{p.name}={value}", partial(self._with, params), inside)

    def enu(self, q: Floats) -> Floats:
        """Return attitudes as they are."""
        return q

    def quiet(self) -> AbstractContextManager[Any]:
        """Hide nothing."""
        return nullcontext()


def part_of(
    stream: Stream, rows: NDArray[np.int64], t_ns: NDArray[np.int64], told: NDArray[np.uint32] | int = 0
) -> ImuData:
    """Rows of a stream at given times, with flags that their times have; the unit is a calibrated one."""
    mag = np.where(stream.has_mag[:, np.newaxis], stream.mag, np.nan)[rows]
    triads = {"gyr": stream.gyr[rows], "acc": stream.acc[rows], "mag": mag}
    known = np.array([row[4] for row in stream.rows()], dtype=np.uint32)[rows]
    return ImuData.live(t_ns, triads, flags=known | np.uint32(told), meta=ImuMeta(calibration="the scene's"))


class RunningSmoother:
    """The smoother on a stream without a lag, fed sample by sample with times that increase."""

    def __init__(self, smoother: FixedLag) -> None:
        self._smoother, self._t_ns = smoother, -STEP_NS

    def take(self, row: Row) -> int:
        """Take a sample and return its flags; its attitude is there at once."""
        t_ns, gyr, acc, mag, known = row
        self._t_ns = t_ns
        return self._smoother.update(ImuSample(t_ns, gyr, acc, mag, flags=known))

    def give(self, gyr: Floats, acc: Any, mag: Floats | None) -> None:
        """Take the next regular sample, with any object as accelerometer."""
        self.take((self._t_ns + STEP_NS, gyr, acc, mag, 0))

    def attitude(self) -> Floats:
        """Attitude now, (4,)."""
        return self._smoother.q_nb


class OurSmoother(OurFilter):
    """The smoother on a stream without a lag."""

    def _filter(self, params: Mapping[str, Any], **arguments: Any) -> FixedLag:
        return FixedLag(**{"frame": FRAME, "params": params, **arguments})

    def _with(self, params: Mapping[str, Any], **arguments: Any) -> Running:
        return RunningSmoother(self._filter(params, **arguments))

    def fed(self, stream: Stream) -> Answer:
        """Answer to a stream, which does not depend on how it is cut."""
        return self.answer(stream)

    def answer(self, stream: Stream) -> Answer:
        """Answer to a stream whose stamps a session has judged, which knows when each sample arrived.

        One whose time cannot be used, or that was sent twice, is dropped, and the attitude stays.
        """
        used = np.isfinite(stream.t) & Repeats().fresh(np.column_stack((stream.t, stream.gyr, stream.acc, stream.mag)))
        stamps = np.round(stream.t[used] * 1e9).astype(np.int64)
        arrived = np.round(stream.newest[used] / RATE * 1e9).astype(np.int64)
        base = TimeBase(TimeSpec(clock=Counter(64, 1), rate=RATE))
        found = base.stamp(arrived, np.arange(stamps.size), clock=stamps)
        good = (found.flags & np.uint32(flags.TIME_FAULT)) == 0
        used[used] = good
        smoother = self._filter(self.stage.params)
        part = part_of(stream, np.flatnonzero(used), found.t_ns[good] - found.t_ns[0], found.flags[good])
        track = smoother.take(part)
        smoother.finish()
        assert track is not None
        assert track.flags is not None
        place = np.maximum(np.cumsum(used) - 1, 0)
        words = np.where(used, track.flags[place], track.flags[place] | flags.TIME_FAULT).astype(np.int64)
        return Answer(track.q_nb[place], words, None if track.cov_b is None else track.cov_b[place], {})


def contender_of(stage: Stage) -> OurFilter:
    """Contender of a stage: a filter, or the smoother without a lag."""
    return OurSmoother(stage) if stage.filter == SMOOTHER else OurFilter(stage)


def unit(q: Floats) -> Floats:
    """Quaternions (N, 4) of norm 1; NaN where one is not finite or zero."""
    with np.errstate(all="ignore"):
        norm = np.sqrt(np.sum(q * q, axis=1, keepdims=True))
        usable = (norm > 0.0) & (norm < math.inf)
        return np.where(usable, q / np.where(usable, norm, 1.0), np.nan)
