"""A scheduler as configuration: named tasks with periods on one time base, and a count of the deadlines missed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from plumbob.errors import ParameterError


@dataclass(frozen=True, slots=True)
class Task:
    """Something to do again and again.

    Attributes
    ----------
    name : str
        What `Schedule.due` calls it.
    period_ns : int
        From one deadline to the next, ns.
    """

    name: str
    period_ns: int


BUOY: Final = (
    Task("tick", 1_000_000),
    Task("sample", 3_000_000),
    Task("fuse", 10_000_000),
    Task("store", 50_000_000),
)
"""Scheduler of the drifting buoy, [Yu2018]: 1 ms tick, 3 ms sampling, 10 ms fusion, 50 ms storage and output."""


class Schedule:
    """Which tasks are due at a time.

    Deadlines are ``start_ns + k * period_ns`` for whole k from 0, so nothing drifts, however late it is asked. A task
    that is asked too late for several deadlines is due once: the rest are counted as missed and never made up for.

    Parameters
    ----------
    tasks : sequence of Task
        In the order in which they are due where deadlines coincide.
    start_ns : int
        First deadline of all tasks, ns, on whatever clock `due` is told.

    Attributes
    ----------
    missed : dict of str to int
        Deadlines missed so far, by task.

    Raises
    ------
    ParameterError
        If there is no task, two share a name, or a period is not positive.
    """

    def __init__(self, tasks: Sequence[Task], *, start_ns: int = 0) -> None:
        if not tasks or len({task.name for task in tasks}) < len(tasks):
            raise ParameterError(f"A schedule needs tasks with different names, but got {[t.name for t in tasks]}.")
        for task in tasks:
            if task.period_ns <= 0:
                raise ParameterError(f"The period of task '{task.name}' must be above 0 ns, but is {task.period_ns}.")
        self._tasks = tuple(tasks)
        self._start_ns = start_ns
        self._done = {task.name: -1 for task in tasks}  # number of the last deadline that was met or missed
        self.missed = {task.name: 0 for task in tasks}

    def due(self, t_ns: int) -> tuple[str, ...]:
        """Names of the tasks with a deadline at or before `t_ns` for which they were not yet due."""
        names = []
        for task in self._tasks:
            k = (t_ns - self._start_ns) // task.period_ns
            late = k - self._done[task.name] - 1
            if late >= 0:
                self.missed[task.name] += late
                self._done[task.name] = k
                names.append(task.name)
        return tuple(names)

    @property
    def next_ns(self) -> int:
        """Next deadline of any task, ns."""
        return min(self._start_ns + (self._done[task.name] + 1) * task.period_ns for task in self._tasks)
