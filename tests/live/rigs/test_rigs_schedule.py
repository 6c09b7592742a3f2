"""The polled loop serves, delays and misses what arithmetic says."""

import numpy as np
import pytest

from plumbob.live.rigs.firmware import FirmwareTask, poll

MS = 1_000_000


def polled(*tasks, ms):
    return poll([FirmwareTask(name, every, (takes,)) for name, every, takes in tasks], ms * MS)


def test_a_task_that_fits_is_served_at_each_event():
    """Events at 3, 6, … 999 ms: 333 in a second [Yu2018]."""
    calls = polled(("sample", 3, MS), ms=1000)["sample"]
    assert len(calls) == 333
    assert np.array_equal(calls.begun_ns, np.arange(3, 1000, 3) * MS)
    assert calls.missed_ns.size == 0
    assert not calls.late_ns.any()


def test_a_task_of_4_ms_misses_one_of_four_events_of_3_ms():
    """It is served every 4 ms, and an event comes every 3 ms: of 1000 in 3 s, 750 are served."""
    calls = polled(("sample", 3, 4 * MS), ms=3000)["sample"]
    assert (len(calls), calls.missed_ns.size) == (pytest.approx(750, abs=1), pytest.approx(250, abs=1))
    assert calls.late_ns.max() <= 3 * MS  # a flag waits for the rest of a call of 4 ms that began at a tick


def test_calls_do_not_overlap_and_none_begins_before_its_event():
    calls = polled(("sample", 3, 184_000), ("fuse", 10, 1_800_000), ("send", 50, 3_400_000), ms=6000)
    begun = np.concatenate([one.begun_ns for one in calls.values()])
    done = np.concatenate([one.done_ns for one in calls.values()])[np.argsort(begun)]
    assert (np.sort(begun)[1:] >= done[:-1]).all()
    for one in calls.values():
        assert (one.late_ns >= 0).all()


def test_every_event_is_served_or_missed():
    calls = polled(("sample", 3, 2 * MS), ("fuse", 10, 7 * MS), ms=9001)
    for name, every in (("sample", 3), ("fuse", 10)):
        one = calls[name]
        assert 0 <= 9000 // every - len(one) - one.missed_ns.size <= 1  # one may wait at the end
        assert (one.due_ns % (every * MS) == 0).all()


def test_a_long_call_costs_the_others_all_events_but_the_one_that_waits():
    """From 50 ms on 46 ms are taken: events of 3 ms at 51, 54, … 93: the first waits, 14 more are missed."""
    calls = poll([FirmwareTask("sample", 3, (0,)), FirmwareTask("send", 50, (46 * MS, 0))], 99 * MS)
    assert calls["sample"].missed_ns.tolist() == [t * MS for t in range(54, 97, 3)]
    assert calls["sample"].late_ns.max() == 45 * MS


def test_durations_take_turns():
    calls = poll([FirmwareTask("send", 50, (MS, 2 * MS, 3 * MS))], 301 * MS)["send"]
    assert ((calls.done_ns - calls.begun_ns) // MS).tolist() == [1, 2, 3, 1, 2, 3]
