"""The sea: height, peak and energy of its spectrum, and water that moves along its surface's normal."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import welch

from plumbob.core.constants import G0
from plumbob.simulation.errors import stream
from plumbob.simulation.motion import draw_sea, jonswap, oscillator
from plumbob.simulation.signals import Sinusoids

SEA = {"height": 1.5, "period": 6.0, "peakedness": 1.0, "direction": 0.8, "spread": 0.3}


def sea(seed=0, **changes):
    return draw_sea(**{**SEA, **changes}, rng=stream(seed, "sea"))


def elevation(waves):
    """Height of the surface over its mean, m."""
    return Sinusoids.from_phasors(waves.omega, waves.phasor)


@pytest.mark.parametrize("seed", range(3))
def test_significant_height_is_four_standard_deviations(seed):
    waves = sea(seed)
    assert 4.0 * math.sqrt(0.5 * np.sum(np.abs(waves.phasor) ** 2)) == pytest.approx(1.5, rel=1e-12)  # mean power
    # over a time T two lines mix by at most a b / (½ Δω T), and each with itself and the mean by less: closed form of
    # the mean product of two cosines
    duration, size = 7200.0, np.abs(waves.phasor)
    apart = np.abs(waves.omega[:, np.newaxis] - waves.omega) + np.eye(size.size) * waves.omega
    mixing = np.sum(np.outer(size, size) / (apart * duration))
    variance = elevation(waves).at(np.arange(0.0, duration, 0.25)).value.var()
    assert mixing < 0.1 * variance
    assert variance == pytest.approx((1.5 / 4.0) ** 2, abs=mixing)


def test_the_spectrum_peaks_at_the_period_has_its_energy_and_is_narrower_on_the_low_side():
    t = np.arange(0.0, 7200.0, 0.5)
    f, power = welch(elevation(sea(peakedness=7.0)).at(t).value, fs=2.0, nperseg=240)
    spacing = 3.4 / 6.0 / 64.0  # between wave trains; the analyser's own bins are 1/120 Hz apart
    assert f[np.argmax(power)] == pytest.approx(1.0 / 6.0, abs=spacing + 1.0 / 120.0)
    energy, _ = quad(
        lambda f: float(jonswap(np.array(f), peak=0.2, peakedness=1.0)), 1e-3, 50.0, points=[0.2], limit=500
    )
    assert energy == pytest.approx(0.2 * 0.2, rel=1e-6)  # ∫ f⁻⁵ exp(−1.25 f⁻⁴) df = 1/5, times the peak frequency
    # closed form [Hasselmann1973]: γ to the power exp(−(f/fp − 1)²/2σ²), σ 0.07 below the peak and 0.09 above
    for f, sigma in ((0.9, 0.07), (1.1, 0.09)):
        raised, plain = (jonswap(np.array([f]), peak=1.0, peakedness=p)[0] for p in (3.3, 1.0))
        assert math.log(raised / plain) == pytest.approx(math.log(3.3) * math.exp(-0.01 / (2.0 * sigma**2)), rel=1e-12)


@pytest.mark.parametrize("peakedness", [1.0, 3.3])
def test_spectra_peak_where_they_should_and_by_as_much(peakedness):
    f = np.linspace(0.05, 0.6, 200_001)
    shape = jonswap(f, peak=0.15, peakedness=peakedness)
    assert f[np.argmax(shape)] == pytest.approx(0.15, abs=1e-5)
    at_peak = jonswap(np.array([0.15]), peak=0.15, peakedness=peakedness)[0]
    assert at_peak == pytest.approx(peakedness * math.exp(-1.25), rel=1e-12)  # γ times Pierson and Moskowitz's


def test_water_feels_gravity_along_its_normal_and_crests_travel_where_they_are_said_to():
    waves = sea()
    acceleration = -(waves.omega**2)[:, np.newaxis] * waves.displacement_ned  # twice derived phasors
    # linear deep-water waves: a free surface feels no force along itself, so that a = −g · slope horizontally
    np.testing.assert_allclose(acceleration[:, :2], -G0 * waves.slope_ne, atol=1e-12)
    waves = sea(spread=0.0, direction=0.5)
    rising = 1j * waves.omega * waves.phasor
    ahead = waves.slope_ne @ [math.cos(0.5), math.sin(0.5)]
    # η(x − ct): the surface rises where it slopes down ahead, ∂η/∂t = −c ∂η/∂x with c = g/ω
    np.testing.assert_allclose(rising, -(G0 / waves.omega) * ahead, atol=1e-12)
    turned = np.concatenate([sea(s).direction for s in range(20)]) - 0.8
    np.testing.assert_allclose(turned.std(), 0.3, rtol=4.0 / math.sqrt(2.0 * turned.size))


def test_a_damped_oscillator():
    omega = 2.0 * math.pi * np.array([0.0, 0.5, 1e6])
    h = oscillator(omega, period=2.0, damping=0.2)
    assert h[0] == 1.0
    assert h[1] == pytest.approx(-1j / 0.4)  # at resonance 1/(2jζ)
    assert abs(h[2]) < 1e-11
    np.testing.assert_array_equal(oscillator(omega, period=0.0, damping=0.2), 1.0)
