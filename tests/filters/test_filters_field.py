"""Which field is trusted: the first, the same again, a disturbed one, a new one."""

import math

import numpy as np
import pytest

from plumbob.core.units import deg
from plumbob.filters import field
from plumbob.filters.field import DIP_BAND, FIRST_AFTER, NEW_AFTER, SETTLED, SIZE_BAND, TAU_NOW, TAU_REFERENCE, TURNING

AT = 3
DT = 0.02
EARTH = (50.0, deg(65.0))  # µT and dip: central Europe
MAGNET = (70.0, deg(50.0))
near = field.near.py_func


class Compass:
    """The block with its state; says what it thinks of a field that lasts."""

    def __init__(self, dt=DT):
        self.x = np.zeros(AT + field.FIELD_SIZE + 1)
        self.x[:AT] = self.x[-1] = -5.0
        self.dt = dt

    def see(self, seconds, size_and_dip, turning=2.0 * TURNING):
        size, dip = size_and_dip
        h, v = size * math.cos(dip), -size * math.sin(dip)  # upwards, as in ENU
        answers = [field.disturbed.py_func(self.x, AT, self.dt, turning, h, v) for _ in range(round(seconds / self.dt))]
        assert (self.x[:AT] == -5.0).all()
        assert self.x[-1] == -5.0
        return np.array(answers)

    def knows(self):
        return field.has_ref.py_func(self.x, AT)


def learned(dt=DT):
    compass = Compass(dt)
    compass.see(FIRST_AFTER + 1.0, EARTH)
    return compass


def first_after(answers, dt, value):
    return (int(np.argmax(answers == value)) + 1) * dt


class TestNear:
    @pytest.mark.parametrize("factor", [1.0 - SIZE_BAND, 1.0 + SIZE_BAND])
    def test_size(self, factor):
        for share, same in ((0.999, True), (1.001, False)):
            assert near(50.0 * (1.0 + share * (factor - 1.0)), 0.9, 50.0, 0.9) == same

    @pytest.mark.parametrize("dip", np.radians([-90.0, -65.0, 0.0, 30.0, 79.0]))
    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_dip_is_compared_as_an_angle(self, dip, sign):
        """Its sine is what is kept; near 90° dip the sine hardly changes, and rounds at 1."""
        for share, same in ((0.0, True), (0.999, True), (1.001, False)):
            other = dip + sign * share * DIP_BAND
            if abs(other) <= math.pi / 2:
                assert near(50.0, math.sin(other), 50.0, math.sin(dip)) is same

    def test_nothing_is_near_to_no_reference_nor_what_is_no_number(self):
        for bad in (
            (0.0, 0.0, 0.0, 0.0),
            (50.0, 0.9, 0.0, 0.0),
            (math.nan, 0.9, 50.0, 0.9),
            (math.inf, 0.9, 50.0, 0.9),
        ):
            assert not near(*bad)
        assert not near(50.0, math.nan, 50.0, 0.9)


class TestFirstReference:
    @pytest.mark.parametrize("dt", [0.005, 0.02, 0.1])
    def test_it_is_taken_after_its_time_of_turning(self, dt):
        compass = Compass(dt)
        answers = compass.see(2.0 * FIRST_AFTER, EARTH)
        when = first_after(answers, dt, False)
        assert abs(when - FIRST_AFTER) <= 2.01 * dt  # the first sample only proposes it
        assert answers[: round(when / dt) - 1].all() and not answers[round(when / dt) :].any()
        size, dip = compass.x[AT + 4], compass.x[AT + 5]
        assert size == pytest.approx(EARTH[0], rel=1e-12)
        assert dip == pytest.approx(-math.sin(EARTH[1]), rel=1e-12)

    def test_not_without_turning_whose_pauses_do_not_count_nor_does_a_field_that_does_not_last(self):
        compass = Compass()
        assert compass.see(60.0, EARTH, turning=0.99 * TURNING).all() and not compass.knows()
        assert compass.see(0.8 * FIRST_AFTER, EARTH).all() and compass.see(60.0, EARTH, turning=0.0).all()
        assert not compass.knows() and not compass.see(0.3 * FIRST_AFTER, EARTH)[-1] and compass.knows()
        # What turns with the unit changes size and dip all the time, seen in the level frame.
        compass = Compass()
        for k in range(20):
            assert compass.see(0.8 * FIRST_AFTER, EARTH if k % 2 else MAGNET).all()
        assert not compass.knows()


class TestDisturbance:
    @pytest.mark.parametrize(
        "wrong", [(1.2 * EARTH[0], EARTH[1]), (0.8 * EARTH[0], EARTH[1]), (EARTH[0], deg(50.0)), (EARTH[0], deg(80.0))]
    )
    def test_it_is_noticed_within_the_smoothing_time(self, wrong):
        """The sine of the dip leaves the band after at most 0.76 of its step, from 65° over 75° to 80°.

        The closed form of the low-pass, 1 − e^−s (cos s + sin s), reaches that at s = 1.5.
        """
        compass = learned(0.001)
        answers = compass.see(0.5, wrong)
        assert first_after(answers, 0.001, True) < 1.6 * TAU_NOW
        assert answers[round(1.6 * TAU_NOW / 0.001) :].all()

    @pytest.mark.parametrize(("share", "dip_deg"), [(1.08, 65.0), (1.0, 57.0), (0.92, 72.0)])
    def test_what_stays_in_the_band_is_not(self, share, dip_deg):
        assert not learned().see(5.0, (share * EARTH[0], deg(dip_deg))).any()

    def test_the_same_field_must_settle_before_it_is_trusted_again(self):
        compass = learned()
        assert compass.see(5.0, MAGNET)[-1]
        when = first_after(compass.see(2.0, EARTH), DT, False)
        # from 70 to 55 µT the low-pass takes 1.5 τ (a quarter of its step is left), the dip less; then it must stay
        assert SETTLED - DT < when < SETTLED + 2.0 * TAU_NOW + 2.0 * DT

    def test_the_reference_follows_slowly_and_no_disturbed_field(self):
        """First order with a gain of dt/(dt + τ): after τ, 1/e of a step is left, but for dt/2τ."""
        compass, other = learned(), learned()
        before = other.x[AT + 4 : AT + 6].copy()
        compass.see(TAU_REFERENCE, (1.05 * EARTH[0], EARTH[1]))
        left = (1.05 * EARTH[0] - compass.x[AT + 4]) / (0.05 * EARTH[0])
        # the smoothing of the field itself delays by its mean, τ_now
        assert left == pytest.approx(math.exp(-1.0), abs=(TAU_NOW + DT) / TAU_REFERENCE)
        other.see(100.0, MAGNET, turning=0.0)
        # while it crosses the band (2 τ_now) it is followed by dt/τ each
        assert np.abs(other.x[AT + 4 : AT + 6] - before).max() < 0.1 * EARTH[0] * 2.0 * TAU_NOW / TAU_REFERENCE


class TestNewField:
    def test_it_is_accepted_after_its_time_of_turning_which_an_interruption_begins_again(self):
        compass = learned()
        when = first_after(compass.see(2.0 * NEW_AFTER, MAGNET)[10:], DT, False) + 10 * DT
        # the candidate begins anew while the smoothed field moves on, which is over after 5 τ_now
        assert NEW_AFTER - DT < when < NEW_AFTER + 5.0 * TAU_NOW + 2.0 * DT
        assert compass.x[AT + 4] == pytest.approx(MAGNET[0], rel=0.01)
        assert compass.see(5.0, EARTH)[-1]  # and the old one is now the disturbed one
        # What turns with the unit would be taken for the Earth's field.
        compass = learned()
        assert compass.see(10.0 * NEW_AFTER, MAGNET, turning=0.99 * TURNING)[10:].all()
        assert not compass.see(2.0, EARTH)[-1]
        # Nor does turning before it count.
        compass = learned()
        compass.see(3.0 * NEW_AFTER, EARTH)
        assert compass.see(0.9 * NEW_AFTER, MAGNET)[10:].all()
        compass.see(1.0, EARTH)
        assert compass.see(0.7 * NEW_AFTER, MAGNET)[10:].all()
