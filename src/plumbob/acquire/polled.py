"""Asking a device at a rate, on deadlines that do not drift."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from types import TracebackType
from typing import Self

from plumbob.acquire.replug import BackOff, NoLine
from plumbob.acquire.schedule import Schedule, Task
from plumbob.errors import LineError, ParameterError
from plumbob.link import Event, Received


class Polled(ABC):
    """A `Source` that asks: one answer each period, stamped right after it was there.

    Deadlines are the start plus whole periods. A missed one is told as ``late`` and not made up for, so answers are
    never bunched. A device that fails is told as ``lost``, opened again with patience, and told as ``reopened``.

    Parameters
    ----------
    name : str
        For messages and recordings.
    rate : float
        Questions per second, Hz.
    back_off : BackOff
        Patience with a device that is not there.
    clock : callable
        Monotonic time, ns.
    sleep : callable
        Waits so many s.
    """

    def __init__(
        self,
        name: str,
        rate: float,
        *,
        back_off: BackOff | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if not 0.0 < rate <= 1e5:
            raise ParameterError(f"A device is polled at a rate above 0 and up to 100000 Hz, but got {rate}.")
        self._name, self._period_ns = name, round(1e9 / rate)
        self._back_off = back_off or BackOff()
        self._clock, self._sleep = clock, sleep
        self._schedule: Schedule | None = None
        self._up = self._closed = False
        self._told: list[Received | Event] = []
        self._failures, self._next_try_ns, self._lost_ns = 0, 0, 0

    @abstractmethod
    def _connect(self) -> str:
        """Open the device and say in words what it is; NoLine or OSError where that is not possible."""

    @abstractmethod
    def _ask(self) -> bytes:
        """One answer; OSError where the device fails."""

    @abstractmethod
    def _disconnect(self) -> None:
        """Close the device, open or not."""

    @property
    def name(self) -> str:
        """Short name for messages and recordings."""
        return self._name

    @property
    def finished(self) -> bool:
        """Whether it was closed; a device is never finished by itself."""
        return self._closed

    def open(self) -> Self:
        """Open the device now; `read` does where this was not called.

        Raises
        ------
        LineError
            If that is not possible. Afterwards nothing raises any more.
        """
        if self._schedule is None:
            try:
                where = self._try()
            except NoLine as no:
                raise LineError(no.text) from no.__cause__
            now = self._clock()
            self._up = True
            self._schedule = Schedule((Task("poll", self._period_ns),), start_ns=now)
            self._told.append(Event(now, "opened", f"{where} is open, asked every {self._period_ns / 1e6:g} ms."))
        return self

    def read(self, timeout: float) -> list[Received | Event]:
        """Wait at most `timeout` s for the next answer; see `plumbob.link.Source`."""
        if self._closed:
            return []
        until_ns = self._clock() + round(timeout * 1e9)
        self.open()
        assert self._schedule is not None
        if self._told:
            told, self._told = self._told, []
            return told
        if not self._up:
            return self._wait(self._next_try_ns, until_ns, self._reopen)
        return self._wait(self._schedule.next_ns, until_ns, self._answer)

    def close(self) -> None:
        """Let go of the device; more than once does no harm."""
        self._closed = True
        self._disconnect()

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def _wait(self, at_ns: int, until_ns: int, act: Callable[[], list[Received | Event]]) -> list[Received | Event]:
        left_ns = min(at_ns, until_ns) - self._clock()
        if left_ns > 0:
            self._sleep(left_ns / 1e9)
        return act() if self._clock() >= at_ns else []

    def _answer(self) -> list[Received | Event]:
        assert self._schedule is not None
        before = self._schedule.missed["poll"]
        self._schedule.due(self._clock())
        late = self._schedule.missed["poll"] - before
        try:
            data = self._ask()
        except OSError as error:
            return [*self._late(late), self._lose(error)]
        return [*self._late(late), Received(self._clock(), data)]

    def _late(self, count: int) -> list[Received | Event]:
        text = f"{self._name}: {count} deadlines of {self._period_ns / 1e6:g} ms have passed without a question."
        return [Event(self._clock(), "late", text, count)] if count else []

    def _lose(self, error: OSError) -> Event:
        self._lost_ns, self._up, self._failures = self._clock(), False, 1
        self._next_try_ns = self._lost_ns + self._back_off.wait_ns(1)
        self._disconnect()
        return Event(self._lost_ns, "lost", f"{self._name} is lost: {error}.")

    def _try(self) -> str:
        try:
            return self._connect()
        except OSError as error:
            self._disconnect()  # it may be half open
            raise NoLine("absent", f"{self._name} cannot be opened: {error}.") from error

    def _reopen(self) -> list[Received | Event]:
        try:
            where = self._try()
        except NoLine:
            self._failures += 1
            self._next_try_ns = self._clock() + self._back_off.wait_ns(self._failures)
            return []
        now = self._clock()
        self._up = True
        self._schedule = Schedule((Task("poll", self._period_ns),), start_ns=now)
        return [Event(now, "reopened", f"{where} is open again after {(now - self._lost_ns) / 1e9:.3f} s without it.")]
