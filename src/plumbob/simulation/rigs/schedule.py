"""A main loop that polls flags which a timer sets: what is served when, what is late, and what is missed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

TICK_NS: Final = 1_000_000
"""Period of the timer, ns [Yu2018]."""


@dataclass(frozen=True, slots=True)
class Task:
    """What the loop does when it finds a flag.

    Attributes
    ----------
    name : str
        For the counts.
    every : int
        Ticks from one event to the next; the first comes after as many.
    takes_ns : tuple of int
        How long it takes, ns: for the first call, the second and so on, and then from the beginning again.
    """

    name: str
    every: int
    takes_ns: tuple[int, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Calls:
    """Calls of one task.

    Attributes
    ----------
    due_ns : ndarray (N,) of int64
        When the flag of each was set, ns from the start.
    begun_ns, done_ns : ndarray (N,) of int64
        When it began and ended.
    missed_ns : ndarray (M,) of int64
        When the timer found the flag still set: an event that is served no more.
    """

    due_ns: Ints
    begun_ns: Ints
    done_ns: Ints
    missed_ns: Ints

    def __len__(self) -> int:
        return int(self.due_ns.size)

    @property
    def late_ns(self) -> Ints:
        """How much later than its event each call began, ns (N,)."""
        return self.begun_ns - self.due_ns


def poll(tasks: Sequence[Task], end_ns: int) -> dict[str, Calls]:
    """Let the loop run: it looks at the flags in the order of the tasks, serves the first that is set, and looks again.

    Nothing interrupts a task but the timer, which only sets flags and takes no time. A flag is cleared when its task
    begins.

    Parameters
    ----------
    tasks : sequence of Task
        In the order in which flags are looked at.
    end_ns : int
        No task begins at or after that time, ns.

    Returns
    -------
    dict of str to Calls
        By the task's name.
    """
    periods = [one.every * TICK_NS for one in tasks]
    following = periods.copy()
    due: list[int | None] = [None] * len(tasks)
    calls: list[list[tuple[int, int, int]]] = [[] for _ in tasks]
    missed: list[list[int]] = [[] for _ in tasks]
    now = 0
    while now < end_ns:
        for i, period in enumerate(periods):
            while following[i] <= now:
                if due[i] is None:
                    due[i] = following[i]
                else:
                    missed[i].append(following[i])
                following[i] += period
        which = next((i for i, flag in enumerate(due) if flag is not None), None)
        if which is None:
            now = min(following)
            continue
        flag, due[which] = due[which], None
        assert flag is not None
        done = now + tasks[which].takes_ns[len(calls[which]) % len(tasks[which].takes_ns)]
        calls[which].append((flag, now, done))
        now = done
    made = (np.array(one, dtype=np.int64).reshape(-1, 3) for one in calls)
    return {
        one.name: Calls(table[:, 0], table[:, 1], table[:, 2], np.array(late, dtype=np.int64))
        for one, table, late in zip(tasks, made, missed, strict=True)
    }
