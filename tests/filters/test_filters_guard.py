"""What is let in: a spike that waits, one that is confirmed, and the angle that may have been missed."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob import Filter, Frame, flags
from plumbob.core.constants import G0, IMPOSSIBLE_RATE
from plumbob.filters import input_checks
from plumbob.filters.input_checks import (
    GUARD_SIZE,
    HOLD,
    JUMP,
    LONG_STEP,
    UNKNOWN_CHANGE,
    UNKNOWN_RATE,
    admit_rate,
    trusted,
)
from plumbob.filters.layout import OWN, RATE, SAME, STAGE
from tests.helpers.filter_state import coefficients_of

DT = 0.01
AT = OWN
NAN = (math.nan,) * 3
LIMIT = JUMP * DT
"""Largest change of a rate in one step that is no spike, rad/s."""


class Gate:
    def __init__(self):
        self.c = coefficients_of(Filter("integrate", frame=Frame.ENU))  # for its largest gap, 1 s
        self.x = np.zeros(OWN + GUARD_SIZE)
        self.x[STAGE] = 2.0

    def take(self, rate, dt=DT, seen=0):
        """Feed one rate; returns flags, step, rate to turn with and missed angle."""
        found, dt, *turning, missed = admit_rate.py_func(self.c, self.x, AT, dt, seen, *rate)
        return found, dt, np.array(turning), missed

    def turned(self, rates):
        """Angle about each axis after these rates, rad."""
        return sum(dt * w for _, dt, w, _ in map(self.take, rates))


def steady(rate, n=5):
    gate = Gate()
    for _ in range(n):
        gate.take(rate)
    return gate


class TestSpike:
    @pytest.mark.parametrize("axis", [0, 1, 2])
    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_it_is_held_for_one_sample_and_forgotten(self, axis, sign):
        """And a change that a body can make is not held."""
        gate, base = steady([0.1, 0.2, 0.3]), np.array([0.1, 0.2, 0.3])
        found, dt, rate, missed = gate.take(base + sign * 1.01 * LIMIT * np.eye(3)[axis])
        assert (found, dt, missed) == (flags.GYR_HELD, DT, 0.0)
        assert rate.tolist() == base.tolist()
        for change in (0.0, 0.0, 0.0, 0.99):
            now = base + change * sign * LIMIT * np.eye(3)[axis]
            found, _, rate, missed = gate.take(now)
            assert (found, missed) == (0, 0.0)
            assert rate.tolist() == now.tolist()

    @given(st.lists(st.floats(-30.0, 30.0), min_size=6, max_size=6))
    def test_confirmed_it_is_made_up_for_and_the_angle_is_exact(self, six):
        """A body that is hit: the rate jumps and stays; one sample late, but not an angle lost."""
        before, after = np.array(six[:3]), np.array(six[3:])
        if np.abs(after - before).max() <= 1.001 * LIMIT:
            after[0] = before[0] + 2.0 * LIMIT
        gate = steady(before)
        found, _, held, _ = gate.take(after)
        assert found == flags.GYR_HELD
        assert held.tolist() == before.tolist()
        found, _, twice, _ = gate.take(after)
        assert found == 0
        total = DT * (held + twice)
        for _ in range(3):
            found, _, rate, _ = gate.take(after)
            assert found == 0
            assert rate.tolist() == after.tolist()
            total += DT * rate
        assert np.abs(total - 5.0 * DT * after).max() < 20 * np.finfo(float).eps * 5.0 * DT * 150.0  # rates up to 150

    def test_spikes_with_a_good_sample_between_are_each_held_and_two_in_turn_confirm_each_other(self):
        """Both say that the rate was not what it had been; what counts is the angle of both."""
        gate, angle = steady([0.0, 0.0, 1.0]), np.zeros(3)
        for _ in range(10):
            angle += gate.turned([[50.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
        assert angle == pytest.approx([0.0, 0.0, 0.2], rel=1e-12)
        angle = steady([0.0, 0.0, 0.0]).turned([[15.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 0.0, 0.0]])
        assert angle[0] == pytest.approx(0.55, rel=1e-12)

    def test_a_rate_that_turns_more_than_half_a_revolution_is_never_let_in_and_a_stuck_one_is_none(self):
        """Confirmed or not: 400 rad/s turns 4 rad in 10 ms, of which the axis is not known."""
        gate = steady([0.0, 0.0, 1.0])
        for _ in range(5):
            found, _, rate, _ = gate.take([400.0, 0.0, 1.0])
            assert found & flags.GYR_HELD
            assert rate[0] == 0.0
        found, _, rate, missed = steady([0.1, 0.2, 0.3]).take([5.0, 5.0, 5.0], seen=flags.GYR_STUCK)
        assert (found, rate.tolist()) == (flags.GYR_HELD, [0.1, 0.2, 0.3])
        assert missed > 0.0

    def test_the_first_sample_and_one_after_a_missing_rate_have_nothing_to_compare_with(self):
        gate, lost = Gate(), steady([0.0, 0.0, 0.0])
        assert gate.take([20.0, 0.0, 0.0], dt=0.0)[0] == 0
        assert lost.take(NAN)[0] == flags.GYR_HELD
        for known in (gate, lost):
            found, _, rate, _ = known.take([20.0, 0.0, 0.0])
            assert (found, rate[0]) == (0, 20.0)


class TestMissedAngle:
    def test_without_a_rate_the_doubt_grows_and_then_all_is_unknown(self):
        """While the last rate is held its change is unknown, Σ α·t·Δt → α HOLD²/2; then the rate itself."""
        gate, total = steady([1.0, 0.0, 0.0]), 0.0
        for k in range(1, 51):
            found, _, rate, missed = gate.take(NAN)
            assert found == flags.GYR_HELD
            held = k * DT <= HOLD + 1e-9
            assert rate[0] == (1.0 if held else 0.0)
            assert missed == pytest.approx(UNKNOWN_CHANGE * k * DT * DT if held else UNKNOWN_RATE * DT, rel=1e-12)
            total += missed
        assert total == pytest.approx(UNKNOWN_CHANGE * 55 * DT * DT + 40 * UNKNOWN_RATE * DT, rel=1e-12)
        assert gate.take([1.0, 0.0, 0.0])[3] == 0.0
        missed = steady([3.0, 4.0, 0.0]).take([3.0, 4.0, 0.0], seen=flags.GYR_CLIPPED)[3]
        assert missed == pytest.approx(0.5 * 5.0 * DT, rel=1e-12)

    @pytest.mark.parametrize(("dt", "counts"), [(0.999 * LONG_STEP, False), (1.001 * LONG_STEP, True), (0.9, True)])
    def test_a_long_step_counts_the_change_and_a_share_of_the_rate(self, dt, counts):
        missed = steady([1.0, 0.0, 0.0]).take([1.0, -0.5, 0.0], dt=dt)[3]
        expected = (0.5 * 0.5 + 0.2 * math.hypot(1.0, 0.5)) * dt if counts else 0.0
        assert missed == pytest.approx(expected, rel=1e-12)

    def test_a_gap_is_no_missed_angle_but_a_new_start(self):
        gate = steady([1.0, 0.0, 0.0])
        found, dt, _, missed = gate.take([1.0, 0.0, 0.0], dt=5.0)
        assert (found, dt, missed) == (flags.GAP, 0.0, 0.0)
        assert gate.x[STAGE] == 0.0

    @given(
        st.lists(
            st.tuples(
                st.one_of(st.tuples(*[st.floats(-IMPOSSIBLE_RATE, IMPOSSIBLE_RATE)] * 3), st.just(NAN)),
                st.floats(0.0, 1e6),
                st.sampled_from([0, flags.GYR_STUCK, flags.GYR_CLIPPED]),
            ),
            max_size=30,
        )
    )
    def test_whatever_comes_what_is_let_in_is_finite(self, stream):
        """A rate is there or not, and no sensor says more than the largest: the loops see to it."""
        gate = Gate()
        for rate, dt, seen in stream:
            _, step, turning, missed = gate.take(rate, dt, seen)
            assert 0.0 <= step <= 1.0
            assert np.isfinite(turning).all()
            assert 0.0 <= missed < math.inf
            assert np.isfinite(gate.x[RATE : RATE + 3]).all()


@pytest.mark.parametrize(("seen", "passes"), [(0, True), (1, True), (2, False), (6, False), (4, False)])
def test_trusted_passes_what_no_bad_flag_names(seen, passes):
    found = trusted.py_func(np.zeros(OWN), 1, seen, 6, 1.0, 2.0, 3.0)
    assert found == (1.0, 2.0, 3.0) if passes else all(map(math.isnan, found))


@pytest.mark.parametrize(("turned", "passes"), [(0.99, True), (1.01, False)])
def test_a_vector_that_stays_while_the_body_turns_is_an_old_one(turned, passes):
    """The rate times the time that the triad has said the same, against the limit."""
    x = np.zeros(OWN)
    x[SAME + 2], x[RATE + 1] = 0.1, -turned * input_checks.STALE / 0.1
    found = input_checks.trusted.py_func(x, 2, 0, 0, 1.0, 2.0, 3.0)
    assert (found == (1.0, 2.0, 3.0)) is passes


def test_gravity_alone_has_its_size_and_no_other():
    """Scaled by 1 %, it is gravity still once the scale is learned; an acceleration of 0.2 g makes it longer by 2 %.

    5 m/s² makes the specific force longer by 12 %: 3 s ln(12/(12 − 6)) = 2.0 s until its mean is 6 % longer.
    """
    x = np.zeros(input_checks.GRAVITY_SIZE)
    for count, push, expected in ((20_000, 0.0, True), (200, 0.2 * G0, False)):
        for _ in range(count):
            alone = input_checks.only_gravity.py_func(x, 0, 0.01, push, 0.0, 1.01 * G0)
        assert alone == expected
    for share, steady in ((0.99, True), (1.01, False)):  # of the 3 % of g by which its size may vary
        x[:3] = G0, G0, (share * 0.03 * G0) ** 2
        assert input_checks.only_gravity.py_func(x, 0, 0.0, 0.0, 0.0, G0) == steady
    x[:] = 0.0
    x[0] = G0
    found = [input_checks.keeps_accelerating.py_func(x, 0, 0.01, 5.0, 0.0, G0) for _ in range(400)]
    assert 150 < found.index(True) < 250
