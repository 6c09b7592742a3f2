"""Time counted from frames alone: exact, however they are handed over, whenever they were read."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.live.timing.counter import CountedTime
from plumbob.live.timing.spec import Counter, TimeSpec

PLACE = 26 * np.arange(1000)
INDEX = np.arange(1000)


def test_time_counted_from_frames_is_exact():
    told = CountedTime(TimeSpec(rate=300.0)).after_first(PLACE)
    np.testing.assert_array_equal(told, [round(Fraction(k * 10**9, 300)) for k in range(1000)])
    # three frames of 26 bytes are lost; of a fourth one byte is, and noise of 5 bytes came between two others
    place = np.delete(PLACE, [100, 101, 102, 200])
    place[place > PLACE[200]] -= 1
    place[place > PLACE[300]] += 5
    told = CountedTime(TimeSpec(rate=100.0, frame_bytes=26)).after_first(place)
    np.testing.assert_array_equal(told, 10**7 * np.delete(INDEX, [100, 101, 102, 200]))
    ticks = 327 * INDEX + 65_000
    spec = TimeSpec(clock=Counter(16, Fraction(10**9, 32768)), frames=Counter(8), rate=100.0)
    told = CountedTime(spec).after_first(PLACE, clock=ticks % 65536, frames=0 * INDEX)
    np.testing.assert_array_equal(told, [327 * k * 10**9 // 32768 for k in range(1000)])
    clock = INDEX.astype(np.uint64) - np.uint64(500)  # from 500 below its turn on
    told = CountedTime(TimeSpec(clock=Counter(64, 1))).after_first(PLACE, clock=clock)
    np.testing.assert_array_equal(told, INDEX)
    counts = np.concatenate([np.arange(500), np.arange(500)])
    told = CountedTime(TimeSpec(frames=Counter(16), rate=100.0)).after_first(PLACE, frames=counts)
    np.testing.assert_array_equal(told, 10**7 * np.concatenate([np.arange(500), 499 + np.arange(500)]))


@pytest.mark.parametrize("down", [False, True])
def test_a_counter_through_its_turns(down):
    kept = np.delete(INDEX, slice(500, 600))  # less than half a turn of 256
    counts = (-kept if down else kept) % 256
    told = CountedTime(TimeSpec(frames=Counter(8, down=down), rate=100.0)).after_first(PLACE[kept], frames=counts)
    np.testing.assert_array_equal(told, 10**7 * kept)


@given(cuts=st.lists(st.integers(0, 1000), max_size=8))
def test_it_does_not_matter_how_frames_are_handed_over(cuts):
    edges = [0, *sorted(cuts), 1000]
    for spec in (TimeSpec(rate=300.0, frame_bytes=26), TimeSpec(clock=Counter(16, Fraction(10**9, 32768)))):
        clock = 327 * INDEX % 65536
        base, whole = CountedTime(spec), CountedTime(spec).after_first(PLACE, clock=clock)
        parts = [base.after_first(PLACE[a:b], clock=clock[a:b]) for a, b in pairwise(edges)]
        np.testing.assert_array_equal(np.concatenate(parts), whole)
