"""What takes part in the faults benchmark: our filters and their peers behind one face."""

import math
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.harness.fault_scene import FRAME, RATE, Row
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.params import Parameter, describe
from plumbob.data.sample import ImuSample
from plumbob.filters import CommonParams, Filter, load
from plumbob.filters.offline import Stage

STEP_NS = round(1e9 / RATE)


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
    none_is_absent : bool
        Whether None as accelerometer means that there is no value.
    can_kill : bool
        Whether its constructor can end the process, and must run in one of its own.
    """

    name: str
    settings: str
    timed: bool
    words: Mapping[int, str]
    none_is_absent: bool
    can_kill: bool

    def start(self) -> Running:
        """Make a fresh one."""
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
    none_is_absent = True
    can_kill = False

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.name = stage.name
        self.settings = Filter(stage.filter, frame=FRAME, params=stage.params).describe()
        self.words: Mapping[int, str] = {bit: name for bit, (name, _) in flags.MEANING.items()}

    def start(self) -> RunningFilter:
        """Make a fresh one."""
        return self._with(self.stage.params)

    def _with(self, params: Mapping[str, Any], **arguments: Any) -> RunningFilter:
        return RunningFilter(Filter(self.stage.filter, **{"frame": FRAME, "params": params, **arguments}))

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


def unit(q: Floats) -> Floats:
    """Quaternions (N, 4) of norm 1; NaN where one is not finite or zero."""
    with np.errstate(all="ignore"):
        norm = np.sqrt(np.sum(q * q, axis=1, keepdims=True))
        usable = (norm > 0.0) & (norm < math.inf)
        return np.where(usable, q / np.where(usable, norm, 1.0), np.nan)
