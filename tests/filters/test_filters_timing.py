"""Steps from integer nanoseconds, and a clock that was set back."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from plumbob import Filter, Frame, ImuData, ImuSample, flags
from plumbob.core.time import to_ns, to_s
from plumbob.filters.layout import COUNT, LATE, OWN, tick
from plumbob.rotations import quat_angle
from tests.helpers.motion import consistent

TODAY_NS = 1_790_000_000_123_456_789


def ticks(times_ns):
    x = np.zeros(OWN)
    steps = []
    for i, t_ns in enumerate(times_ns):
        steps.append(tick.py_func(x, t_ns, float(i)))  # each says something else
        x[COUNT] += steps[-1] >= 0.0
    return steps


@given(st.lists(st.integers(1, 10**12), min_size=1, max_size=40), st.integers(-(10**18), TODAY_NS))
def test_steps_are_exact_differences_at_any_time_of_day(steps_ns, start_ns):
    times_ns = [start_ns + sum(steps_ns[: i + 1]) for i in range(len(steps_ns))]
    assert ticks(times_ns) == [0.0, *(ns / 1e9 for ns in steps_ns[1:])]


def test_steps_are_exact_whenever_the_anchor_moves():
    """Of float64's whole numbers: after 2**53 ns, 104 days."""
    late_ns = TODAY_NS // 10**9 * 10**9 + 2**53 - 10
    assert ticks([TODAY_NS, late_ns, late_ns + 10**9])[2] == 1.0


def test_differences_of_seconds_would_not_do():
    """Why steps are made from integers: t[i+1] − t[i] carries the rounding of t."""
    t = to_s(10_000_000 * np.arange(1000))
    assert len(set(np.diff(t))) > 1
    assert set(ticks(to_ns(t).tolist())[1:]) == {0.01}


def test_late_samples_do_not_turn_the_clock_back_and_three_in_order_are_a_clock_that_was_set_back():
    assert ticks([0, 10, 30, 20, 40, 40, 40, 40, 40, 50]) == [0, 1e-8, 2e-8, LATE, 1e-8, LATE, LATE, LATE, LATE, 1e-8]
    # 30 → 5, 10, 15: the third is taken; it stands for three intervals of 5 ns. Then the clock goes on from there.
    assert ticks([10, 20, 30, 5, 10, 15, 20]) == [0, 1e-8, 1e-8, LATE, LATE, 15e-9, 5e-9]
    assert ticks([10, 20, 30, 5, 10, 9, 11, 31]) == [0, 1e-8, 1e-8, LATE, LATE, LATE, LATE, 1e-9]


def test_a_clock_set_back_by_an_hour_costs_no_turn():
    data, q = consistent(600, amplitude=0.5)
    back_ns = np.where(np.arange(600) >= 300, 3_600_000_000_000, 0)
    f = Filter("integrate", frame=Frame.ENU, init=q[0])
    found = [
        f.update(ImuSample(int(t_ns), gyr=g)) for t_ns, g in zip(data.t_ns - back_ns + TODAY_NS, data.gyr, strict=True)
    ]
    assert [i for i, word in enumerate(found) if word & flags.TIME_FAULT] == [300, 301]
    assert quat_angle(f.q_nb, q[-1]) < np.radians(0.3)  # three steps of 10 ms at 0.5 rad/s, each off by ω̇Δt²


def test_a_recording_that_begins_before_the_last_one_ended_is_taken_like_single_samples():
    data, _ = consistent(300)
    again = ImuData(t=data.t[100:], gyr=data.gyr[100:], acc=data.acc[100:], mag=data.mag[100:])
    whole, single = Filter("mahony", frame=Frame.ENU), Filter("mahony", frame=Frame.ENU)
    for part in (data, again):
        track = whole.process(part)
        found = [single.update(sample) for sample in part.samples()]
    assert track.flags.tolist() == found
    assert (single.q_nb == whole.q_nb).all()
