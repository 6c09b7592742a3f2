"""Sea states against closed forms: single waves, noise alone, and Gaussian seas of a known spectrum."""

import math

import numpy as np
import pytest
from scipy.fft import irfft

from plumbob.quality.waves import WaveSettings, bridged, displacement, sea_state
from plumbob.simulation.motion import jonswap

STEP, COUNT = 0.1, 12_000
T = STEP * np.arange(COUNT)
SEGMENT = 256.0


def single(amplitude, period, come_from, t=T):
    """Acceleration east, north and up of a particle in a wave of deep water: a circle, forward on the crest."""
    w, to = 2.0 * np.pi / period, np.radians(come_from + 180.0)
    forward, up = amplitude * w**2 * np.sin(-w * t), -amplitude * w**2 * np.cos(w * t)
    return np.stack((forward * np.sin(to), forward * np.cos(to), up), axis=1)


@pytest.mark.parametrize("come_from", [10.0, 135.0, 225.0, 350.0])
def test_a_single_wave_has_its_height_period_and_direction(come_from):
    acc = single(0.5, 8.0, come_from)
    sea = sea_state(T, acc, step=STEP, segment=SEGMENT, heading_sd=0.0)
    assert sea.hm0 == pytest.approx(4.0 * 0.5 / math.sqrt(2.0), rel=0.01)  # m0 = A²/2
    assert sea.tp == pytest.approx(8.0, rel=0.01) and sea.tm01 == pytest.approx(8.0, rel=0.01)
    assert math.degrees(sea.direction) == pytest.approx(come_from, abs=0.1)
    assert math.degrees(sea.spread) < 2.0  # all from one direction
    at = int(np.nanargmax(sea.density))
    assert sea.check[at] == pytest.approx(1.0, abs=1e-3)  # a circle
    assert (sea.a2[at], sea.b2[at]) == pytest.approx(
        (math.cos(2.0 * math.radians(come_from)), math.sin(2.0 * math.radians(come_from))), abs=1e-3
    )
    assert sea.flag == 1
    # a hull that rises half as high as the wave
    half = WaveSettings(response=((0.0, 1.0), (0.5, 0.5)))
    assert sea_state(T, acc, step=STEP, segment=SEGMENT, settings=half).hm0 == pytest.approx(2.0 * sea.hm0)
    cut = sea_state(T, acc, step=STEP, segment=SEGMENT, settings=WaveSettings(low=0.2))
    assert cut.hidden == pytest.approx(sea.hm0, rel=0.01)  # what is left out is not said to be noise
    assert math.isnan(sea_state(T, acc, step=STEP, segment=SEGMENT).direction)  # of a heading that is not known


def test_of_noise_alone_nothing_is_claimed_but_how_high_waves_might_be():
    rng = np.random.default_rng(1)
    claimed, levels = [], []
    for _ in range(40):
        sea = sea_state(T, rng.normal(0.0, 0.01, (COUNT, 3)), step=STEP, segment=SEGMENT, heading_sd=0.0)
        claimed.append(math.isfinite(sea.hm0))
        levels.append(sea.noise)
        assert claimed[-1] or (sea.flag == 3 and 0.0 < sea.hidden < 1.0)
    assert np.mean(levels) == pytest.approx(2.0 * STEP * 0.01**2, rel=0.1)  # one-sided density of white noise
    assert sum(claimed) <= 12  # two neighbours of some 250 correlated densities, each above with a chance of 1 %


def gaussian(rng, *, height=2.0, period=9.0, peakedness=3.3, spread=25.0, come_from=200.0):
    """Acceleration and true Hm0, Tm02 of a sea drawn by its spectrum, each frequency from a direction of its own.

    Only many waves in each band that a burst resolves make a Gaussian sea. With four of them, as of `4 * COUNT`, the
    directional spread scatters by 15 % more than with 64 (250 seas each): four directions are themselves a sample.
    """
    n = 32 * COUNT
    f = np.arange(n // 2 + 1) / (n * STEP)
    density = np.zeros(f.size)
    wet = (f > 0.5 / period) & (f < 0.8)
    density[wet] = jonswap(f[wet], peak=1.0 / period, peakedness=peakedness)
    density *= (height / 4.0) ** 2 / (np.sum(density) * f[1])
    phasor = np.sqrt(density * f[1]) * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
    to = np.radians(come_from + 180.0 + spread * rng.standard_normal(f.size))
    forward = -1j * phasor
    way = np.stack((forward * np.sin(to), forward * np.cos(to), phasor), axis=1)
    acc = irfft(-((2.0 * np.pi * f[:, np.newaxis]) ** 2) * way, n, axis=0)[:COUNT] * (n / 2.0)
    m0, m2 = (np.sum(density * f**k) * f[1] for k in (0, 2))
    return acc, 4.0 * math.sqrt(m0), math.sqrt(m0 / m2)


def test_bands_hold_the_sea_of_which_a_burst_is_a_sample():
    rng = np.random.default_rng(7)
    inside, periods, turned, ratio, spread = [], [], [], [], []
    wrapped = math.sqrt(2.0 * (1.0 - math.exp(-0.5 * math.radians(25.0) ** 2)))  # spread of a wrapped normal
    for _ in range(200):
        acc, hm0, tm02 = gaussian(rng)
        sea = sea_state(T, acc + rng.normal(0.0, 0.01, acc.shape), step=STEP, segment=SEGMENT, heading_sd=0.0)
        inside.append(sea.hm0_low <= hm0 <= sea.hm0_high)
        periods.append(sea.tm02 / tm02 - 1.0)
        turned.append(math.remainder(sea.direction - math.radians(200.0), 2.0 * math.pi) / sea.direction_sd)
        ratio.append(sea.hm0 / hm0)
        spread.append((sea.spread - wrapped) / sea.spread_sd)
    assert 0.90 <= np.mean(inside) <= 0.98
    assert abs(np.mean(periods)) < 0.01 and abs(np.mean(ratio) - 1.0) < 0.01
    assert 0.85 < np.std(turned) < 1.15  # 5 % in 200 seas, ± 3 σ
    assert 0.85 < np.std(spread) < 1.15 and abs(np.mean(spread)) < 0.25
    assert 0.90 <= np.mean(np.abs(spread) < 2.0) <= 0.98  # 95 % of 200 seas, ± 3 σ


def test_a_narrow_band_is_claimed_no_better_than_it_is_known():
    acc, *_ = gaussian(np.random.default_rng(3), peakedness=7.0)
    sure = sea_state(T, acc, step=STEP, segment=SEGMENT)
    wide = sea_state(T, acc, step=STEP, segment=SEGMENT, scale_sd=0.05)
    assert wide.hm0_high / wide.hm0_low > sure.hm0_high / sure.hm0_low
    low, high = sure.band
    assert sure.freedom == pytest.approx(36.0 * 8**2 / (19.0 * 8 - 1.0), rel=0.05)  # [Welch1967]
    # quantiles of chi-square of 15 degrees of freedom: Abramowitz and Stegun, table 26.8
    assert (low, high) == pytest.approx((15.0 / 27.488, 15.0 / 6.262), rel=0.03)


def test_holes_up_to_a_second_are_bridged_and_longer_ones_end_a_stretch():
    keep = np.ones(COUNT, dtype=bool)
    keep[1000:1005] = keep[5000:5100] = False
    acc = single(0.5, 8.0, 225.0)
    line = np.stack((T, 2.0 * T, 3.0 - T), axis=1)
    at, rows = bridged(T[keep], line[keep], STEP)
    assert at.size == COUNT - 100 and np.allclose(rows, np.stack((at, 2.0 * at, 3.0 - at), axis=1))
    sea = sea_state(T[keep], acc[keep], step=STEP, segment=120.0, heading_sd=0.0)
    assert sea.hm0 == pytest.approx(4.0 * 0.5 / math.sqrt(2.0), rel=0.01)
    lost = acc.copy()
    lost[~keep] = math.nan  # what is not known is as if it were not there
    assert sea_state(T, lost, step=STEP, segment=120.0, heading_sd=0.0).hm0 == sea.hm0
    none = sea_state(T[:100], acc[:100], step=STEP, segment=120.0)
    assert none.tests == {"gap": 4} and math.isnan(none.hm0)


def test_of_a_burst_too_short_for_its_waves_nothing_is_claimed():
    acc = single(0.5, 8.0, 225.0)
    short = sea_state(T[:600], acc[:600], step=STEP, segment=15.0, heading_sd=0.0)
    assert short.tests == {"short": 4} and math.isnan(short.hm0) and math.isnan(short.hidden)
    tank = single(0.05, 1.5, 90.0)  # whose longest waves are known
    sea = sea_state(T[:600], tank[:600], step=STEP, segment=15.0, settings=WaveSettings(low=0.3), heading_sd=0.0)
    assert sea.hm0 == pytest.approx(4.0 * 0.05 / math.sqrt(2.0), rel=0.02)
    assert math.degrees(sea.direction) == pytest.approx(90.0, abs=1.0)


def test_heave_is_the_way_itself():
    acc = single(0.5, 8.0, 225.0)
    heave = displacement(T, acc[:, 2:], step=STEP, low=0.05, high=1.0)[:, 0]
    known = np.isfinite(heave)
    assert T[known][0] == pytest.approx(10.0, abs=STEP) and T[known][-1] == pytest.approx(T[-1] - 10.0, abs=STEP)
    inner = np.abs(T - T.mean()) < 500.0
    assert np.sqrt(np.mean((heave - 0.5 * np.cos(2.0 * np.pi * T / 8.0))[inner] ** 2)) < 0.005


def test_a_sea_that_would_have_broken_is_flagged():
    sea = sea_state(T, single(2.0, 3.0, 0.0), step=STEP, segment=SEGMENT)  # 4 m high, 14 m long
    assert sea.tests["steepness"] == 4
