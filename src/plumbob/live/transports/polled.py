"""Sources that ask a device at a rate, on deadlines that do not drift."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Self, Unpack

from plumbob.core.errors import LineError, ParameterError
from plumbob.core.event import Event
from plumbob.live.transports.transport import NoLine, Opened, Pace, Received


class Schedule:
    """When something is due that is done again and again.

    Deadlines are ``start_ns + k * period_ns`` for whole k from 0, so nothing drifts, however late it is asked. What is
    asked too late for several deadlines is due once: the rest are counted as `missed` and never made up for.
    """

    def __init__(self, period_ns: int, *, start_ns: int = 0) -> None:
        if period_ns <= 0:
            raise ParameterError(f"The period of a schedule must be above 0 ns, but is {period_ns}.")
        self._period_ns, self._start_ns = period_ns, start_ns
        self._done = -1  # number of the last deadline that was met or missed
        self.missed = 0

    def due(self, t_ns: int) -> bool:
        """Whether there is a deadline at or before `t_ns` at which it was not yet due."""
        late = (t_ns - self._start_ns) // self._period_ns - self._done - 1
        self._done += max(late + 1, 0)
        self.missed += max(late, 0)
        return late >= 0

    @property
    def next_ns(self) -> int:
        """Next deadline, ns."""
        return self._start_ns + (self._done + 1) * self._period_ns


class Polled(Opened):
    """A `Source` that asks: one answer each period, stamped right after it was there.

    Deadlines are the start plus whole periods. A missed one is reported as ``late`` and not made up for, so answers are
    never bunched. A device that fails is reported as ``lost``, opened again, then reported as ``reopened``.
    """

    def __init__(self, name: str, rate: float, **pace: Unpack[Pace]) -> None:
        if not 0.0 < rate <= 1e5:
            raise ParameterError(f"A device is polled at a rate above 0 and up to 100000 Hz, but got {rate}.")
        super().__init__(name, **pace)
        self._period_ns = round(1e9 / rate)
        self._schedule: Schedule | None = None
        self._up = False
        self._lost_ns = 0

    @abstractmethod
    def _connect(self) -> str:
        """Open the device and say in words what it is; NoLine or OSError where that is not possible."""

    @abstractmethod
    def _ask(self) -> bytes:
        """One answer; OSError where the device fails."""

    def open(self) -> Self:
        """Open the device now; `read` does where this was not called."""
        if self._schedule is None:
            try:
                where = self._try()
            except NoLine as no:
                raise LineError(no.text) from no.__cause__
            now = self._clock()
            self._up = True
            self._schedule = Schedule(self._period_ns, start_ns=now)
            self._told.append(Event(now, "opened", f"{where} is open, asked every {self._period_ns / 1e6:g} ms."))
        return self

    def _more(self, until_ns: int) -> list[Received | Event]:
        assert self._schedule is not None
        if not self._up:
            return self._wait(self._next_try_ns, until_ns, self._reopen)
        return self._wait(self._schedule.next_ns, until_ns, self._answer)

    def _wait(self, at_ns: int, until_ns: int, act: Callable[[], list[Received | Event]]) -> list[Received | Event]:
        left_ns = min(at_ns, until_ns) - self._clock()
        if left_ns > 0:
            self._sleep(left_ns / 1e9)
        return act() if self._clock() >= at_ns else []

    def _answer(self) -> list[Received | Event]:
        assert self._schedule is not None
        before = self._schedule.missed
        self._schedule.due(self._clock())
        late = self._schedule.missed - before
        try:
            data = self._ask()
        except OSError as error:
            return [*self._late(late), self._lose(error)]
        return [*self._late(late), Received(self._clock(), data)]

    def _late(self, count: int) -> list[Received | Event]:
        text = f"{self._name}: {count} deadlines of {self._period_ns / 1e6:g} ms have passed without a poll."
        return [Event(self._clock(), "late", text, count)] if count else []

    def _lose(self, error: OSError) -> Event:
        self._lost_ns, self._up, self._failures = self._clock(), False, 0
        self._try_later(self._lost_ns)
        self._let_go()
        return Event(self._lost_ns, "lost", f"{self._name} is lost: {error}.")

    def _try(self) -> str:
        try:
            return self._connect()
        except OSError as error:
            self._let_go()  # it may be half open
            raise NoLine("absent", f"{self._name} cannot be opened: {error}.") from error

    def _reopen(self) -> list[Received | Event]:
        try:
            where = self._try()
        except NoLine:
            self._try_later(self._clock())
            return []
        now = self._clock()
        self._up = True
        self._schedule = Schedule(self._period_ns, start_ns=now)
        return [Event(now, "reopened", f"{where} is open again after {(now - self._lost_ns) / 1e9:.3f} s without it.")]
