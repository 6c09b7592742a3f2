"""Stretches at rest: planted ones are found, and what is no rest is not."""

import numpy as np
import pytest

from plumbob.calibration.static_periods import BLOCK, stills
from plumbob.core.units import dps
from plumbob.rotations import Frame
from plumbob.simulation import simulate

RATE = 100.0
G = 9.80665


def spans(t, found):
    return [(t[s.start], t[s.stop - 1]) for s in found]


def at_rest(count, *, seed=1, force=(0.0, 0.0, G), noise=0.02):
    """A unit at rest: time, specific force and rates with a bias, scatter as of a consumer part."""
    rng = np.random.default_rng(seed)
    acc = np.asarray(force) + noise * rng.normal(size=(count, 3))
    return np.arange(count) / RATE, acc, dps(2.0) + dps(0.1) * rng.normal(size=(count, 3))


def rests(body):
    """True stretches without any motion, s."""
    still = ~body.rate_b.any(axis=1) & ~body.acc_n.any(axis=1)
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    return [(body.t[a], body.t[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@pytest.fixture(scope="module")
def rod():
    """Moved by hand from one random tilt to the next, resting up to 6 s, without vibration."""
    return simulate("rod", frame=Frame.ENU, sensors="mpu6000", unit="random", seed=3, duration=100.0, pause=6.0,
                    vibration=0.0)  # fmt: skip


class TestPlanted:
    @pytest.mark.parametrize(("gyro", "within"), [(True, 2 * BLOCK), (False, 4 * BLOCK)])
    def test_each_rest_is_found_once_and_in_its_place(self, rod, gyro, within):
        """Moves begin gently, by 10 u³ of the way at the share u of their time, and a block that they touch may pass.

        A way of 15° in 3 s turns faster than 1 °/s after 0.25 s. Without a gyroscope the specific force must turn by
        0.05 + 6 × 0.04/√25 = 0.1 m/s² from block to block, 0.6° or 4 % of the way: u = 0.17, 0.5 to 0.7 s.
        """
        found = spans(rod.imu.t, stills(rod.imu.t, rod.imu.acc, rod.imu.gyr if gyro else None))
        long = [(a, b) for a, b in rests(rod.kinematics) if b - a >= 1.0 + 3 * BLOCK]
        assert len(long) >= 8
        for a, b in long:
            ((c, d),) = [(c, d) for c, d in found if c < b and d > a]
            assert abs(c - a) <= within
            assert abs(d - b) <= within

    def test_the_unit_does_not_turn_within_a_stretch(self, rod):
        """Neighbouring blocks differ by 0.05 m/s² and noise at most: 0.3° of tilt, at either end."""
        force = rod.kinematics.specific_force_b
        for s in stills(rod.imu.t, rod.imu.acc, rod.imu.gyr):
            mean = force[s].mean(axis=0)
            assert np.degrees(np.linalg.norm(force[s] - mean, axis=1).max() / G) < 0.6

    def test_a_bias_is_no_motion(self, rod):
        plain = stills(rod.imu.t, rod.imu.acc, rod.imu.gyr)
        assert stills(rod.imu.t, rod.imu.acc, rod.imu.gyr + dps(np.array([30.0, -20.0, 10.0]))) == plain


def test_a_unit_that_never_moves_rests_all_the_time():
    t, acc, gyr = at_rest(3000)
    (found,) = stills(t, acc, gyr)
    assert (found.start, found.stop) == (0, 3000)


def test_a_slow_rotation_is_no_rest():
    """2 °/s about the vertical: the specific force says nothing, the gyroscope does."""
    t, acc, gyr = at_rest(6000)
    gyr[4000:5000, 2] += dps(2.0)
    assert len(stills(t, acc)) == 1
    first, second = spans(t, stills(t, acc, gyr))
    assert first[1] == pytest.approx(40.0, abs=BLOCK)
    assert second[0] == pytest.approx(50.0, abs=BLOCK)


def test_a_slow_tilt_is_no_rest():
    """3 °/s turns gravity by 0.13 m/s² from block to block; 0.05 + 6 × 0.001/√25 = 0.051 m/s² are told."""
    t, acc, _ = at_rest(6000, noise=0.001)
    angle = dps(3.0) * np.clip(t - 20.0, 0.0, 10.0)
    acc += G * np.stack([np.sin(angle), np.zeros_like(t), np.cos(angle) - 1.0], axis=1)
    first, second = spans(t, stills(t, acc))
    assert first[1] == pytest.approx(20.0, abs=2 * BLOCK)
    assert second[0] == pytest.approx(30.0, abs=2 * BLOCK)


def test_vibration_is_no_rest():
    t, acc, gyr = at_rest(6000)
    acc[2000:4000] += 0.3 * np.sin(2 * np.pi * 17.0 * t[2000:4000, np.newaxis])
    first, second = spans(t, stills(t, acc, gyr))
    assert first[1] == pytest.approx(20.0, abs=2 * BLOCK)
    assert second[0] == pytest.approx(40.0, abs=2 * BLOCK)


def test_what_shakes_all_the_time_never_rests():
    t, acc, gyr = at_rest(3000, noise=1.0)
    assert stills(t, acc, gyr) == []


def test_rows_without_a_number_are_no_rest():
    t, acc, gyr = at_rest(3000)
    acc[1000], gyr[2000, 1] = np.nan, np.nan
    found = stills(t, acc, gyr)
    assert not any(s.start <= row < s.stop for s in found for row in (1000, 2000))
    assert sum(s.stop - s.start for s in found) >= 3000 - 2 * 3 * round(BLOCK * RATE)  # the block and its neighbours


def test_nothing_but_missing_rows_rests_nowhere():
    t, acc, gyr = at_rest(1000)
    assert stills(t, np.full_like(acc, np.nan), gyr) == []
    assert stills(t, acc, np.full_like(gyr, np.nan)) == []


def test_coarse_steps_may_show_no_noise_at_all():
    """A quiet part behind coarse steps repeats one number: it rests, and the touches between are none."""
    t = np.arange(3000) / RATE
    acc = np.tile([0.0, 0.0, G], (3000, 1))
    acc[1000:1200] += 0.4 * np.sin(2 * np.pi * 3.0 * t[1000:1200, np.newaxis])
    first, second = spans(t, stills(t, acc))
    assert first == (0.0, pytest.approx(10.0, abs=2 * BLOCK))
    assert second == (pytest.approx(12.0, abs=2 * BLOCK), 29.99)


@pytest.mark.parametrize(("least", "count"), [(1.0, 2), (4.5, 1), (11.0, 0)])
def test_short_stretches_are_left_out(least, count):
    t, acc, gyr = at_rest(1500)
    acc[400:500] += 3.0 * np.sin(2 * np.pi * 2.0 * t[400:500, np.newaxis])
    assert len(stills(t, acc, gyr, least=least)) == count


@pytest.mark.parametrize("count", [0, 1, 3, 10, 60])
def test_a_capture_of_a_moment_has_no_stretch(count):
    t, acc, gyr = at_rest(count)
    assert stills(t, acc, gyr) == []


def test_the_rate_does_not_matter():
    for rate in (10.0, 1000.0):
        t, acc, gyr = at_rest(round(20 * rate))
        (found,) = stills(t * RATE / rate, acc, gyr)
        assert found.stop - found.start >= t.size - round(rate * BLOCK)
