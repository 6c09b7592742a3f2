"""Deadlines on one time base."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core.errors import ParameterError
from plumbob.live.transports.polled import Schedule, Task

MS = 1_000_000
BUOY = (Task("tick", MS), Task("sample", 3 * MS), Task("fuse", 10 * MS), Task("store", 50 * MS))
"""Scheduler of the drifting buoy, [Yu2018]."""


def test_the_buoys_periods():
    """Asked each ms for a second: 1, 3, 10 and 50 ms give so many deadlines, those at both ends included."""
    schedule = Schedule(BUOY)
    names = [name for t in range(0, 1000 * MS + 1, MS) for name in schedule.due(t)]
    assert {name: names.count(name) for name in names} == {"tick": 1001, "sample": 334, "fuse": 101, "store": 21}
    assert set(schedule.missed.values()) == {0}


def test_tasks_are_due_in_their_order_and_not_before():
    schedule = Schedule(BUOY)
    assert (schedule.due(0), schedule.due(0)) == (("tick", "sample", "fuse", "store"), ())
    assert (schedule.due(MS), schedule.due(3 * MS)) == (("tick",), ("tick", "sample"))
    assert schedule.missed == {"tick": 1, "sample": 0, "fuse": 0, "store": 0}
    schedule = Schedule([Task("a", 10)], start_ns=100)
    assert (schedule.due(99), schedule.next_ns, schedule.due(135)) == ((), 100, ("a",))
    assert schedule.due(105) == ()
    assert (schedule.missed["a"], schedule.next_ns) == (3, 140)


@given(
    period=st.integers(1, 50),
    start=st.integers(-100, 100),
    steps=st.lists(st.integers(0, 200), min_size=1, max_size=60),
)
def test_every_deadline_is_met_once_or_counted(period, start, steps):
    schedule, t, met = Schedule([Task("a", period)], start_ns=start), start, 0
    for step in steps:
        t += step
        met += len(schedule.due(t))
        assert t < schedule.next_ns <= t + period
    assert met + schedule.missed["a"] == (t - start) // period + 1


@pytest.mark.parametrize("tasks", [[], [Task("a", 1), Task("a", 2)], [Task("a", 0)], [Task("a", -1)]])
def test_what_can_be_no_schedule(tasks):
    with pytest.raises(ParameterError):
        Schedule(tasks)
