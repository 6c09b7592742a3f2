"""Stretches at rest: planted ones are found, and what is no rest is not."""

import numpy as np
import pytest

from plumbob import Frame, simulate
from plumbob.core.units import dps
from plumbob.quality.static_periods import BLOCK, stills

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


@pytest.mark.parametrize(("gyro", "within"), [(True, 2 * BLOCK), (False, 4 * BLOCK)])
def test_each_rest_is_found_once_and_in_its_place(rod, gyro, within):
    """Moves begin gently, by 10 u³ of the way at the share u of their time, and a block that they touch may pass.

    A way of 15° in 3 s turns faster than 1 °/s after 0.25 s. Without a gyroscope the specific force must turn by
    0.05 + 6 × 0.04/√25 = 0.1 m/s² from block to block, 0.6° or 4 % of the way: u = 0.17, 0.5 to 0.7 s.
    """
    resting = spans(rod.imu.t, stills(rod.imu.t, rod.imu.acc, rod.imu.gyr if gyro else None))
    long = [(a, b) for a, b in rests(rod.kinematics) if b - a >= 1.0 + 3 * BLOCK]
    assert len(long) >= 8
    for a, b in long:
        ((c, d),) = [(c, d) for c, d in resting if c < b and d > a]
        assert abs(c - a) <= within and abs(d - b) <= within


def test_the_unit_does_not_turn_within_a_stretch_and_a_bias_is_no_motion(rod):
    """Neighbouring blocks differ by 0.05 m/s² and noise at most: 0.3° of tilt, at either end."""
    force, plain = rod.kinematics.specific_force_b, stills(rod.imu.t, rod.imu.acc, rod.imu.gyr)
    for s in plain:
        assert np.degrees(np.linalg.norm(force[s] - force[s].mean(axis=0), axis=1).max() / G) < 0.6
    assert stills(rod.imu.t, rod.imu.acc, rod.imu.gyr + dps(np.array([30.0, -20.0, 10.0]))) == plain


def turning(t, acc, gyr):
    """2 °/s about the vertical: the specific force says nothing, the gyroscope does."""
    gyr[2000:4000, 2] += dps(2.0)
    assert len(stills(t, acc)) == 1
    return acc, gyr


def tilting(t, acc, gyr):
    """3 °/s turns gravity by 0.13 m/s² from block to block; 0.05 + 6 × 0.02/√25 = 0.074 m/s² are told."""
    angle = dps(3.0) * np.clip(t - 20.0, 0.0, 20.0)
    return acc + G * np.stack([np.sin(angle), np.zeros_like(t), np.cos(angle) - 1.0], axis=1), None


def shaken(t, acc, gyr):
    acc[2000:4000] += 0.3 * np.sin(2 * np.pi * 17.0 * t[2000:4000, np.newaxis])
    return acc, gyr


def coarse(t, acc, gyr):
    """A quiet part behind coarse steps repeats one number: it rests, and the touches between are none."""
    acc = np.tile([0.0, 0.0, G], (t.size, 1))
    acc[2000:4000] += 0.4 * np.sin(2 * np.pi * 3.0 * t[2000:4000, np.newaxis])
    return acc, None


@pytest.mark.parametrize("motion", [turning, tilting, shaken, coarse])
def test_a_motion_between_two_rests_is_none(motion):
    t, acc, gyr = at_rest(6000)
    first, second = spans(t, stills(t, *motion(t, acc, gyr)))
    assert (first[0], second[1]) == (0.0, 59.99)
    assert (first[1], second[0]) == pytest.approx((20.0, 40.0), abs=2 * BLOCK)


def test_all_or_nothing_rests():
    t, acc, gyr = at_rest(3000)
    assert stills(t, acc, gyr) == [slice(0, 3000)]
    assert stills(*at_rest(3000, noise=1.0)) == []
    assert stills(t, np.full_like(acc, np.nan), gyr) == stills(t, acc, np.full_like(gyr, np.nan)) == []
    for count in (0, 1, 3, 10, 60):
        assert stills(*at_rest(count)) == []
    acc[1000], gyr[2000, 1] = np.nan, np.nan
    parts = stills(t, acc, gyr)
    assert not any(s.start <= row < s.stop for s in parts for row in (1000, 2000))
    assert sum(s.stop - s.start for s in parts) >= 3000 - 2 * 3 * round(BLOCK * RATE)  # the block and its neighbours


@pytest.mark.parametrize(("least", "count"), [(1.0, 2), (4.5, 1), (11.0, 0)])
def test_short_stretches_are_left_out(least, count):
    t, acc, gyr = at_rest(1500)
    acc[400:500] += 3.0 * np.sin(2 * np.pi * 2.0 * t[400:500, np.newaxis])
    assert len(stills(t, acc, gyr, least=least)) == count


def test_the_rate_does_not_matter():
    for rate in (10.0, 1000.0):
        t, acc, gyr = at_rest(round(20 * rate))
        (found,) = stills(t * RATE / rate, acc, gyr)
        assert found.stop - found.start >= t.size - round(rate * BLOCK)
