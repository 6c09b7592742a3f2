"""Signals: noise has the spectra of its card, waves those of their sea."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import welch

from plumbob.core.constants import G0
from plumbob.simulation import TriadErrors, errors, signals
from plumbob.simulation.errors import measure, stream
from plumbob.simulation.motion import draw_sea, jonswap, oscillator
from plumbob.simulation.signals import Sinusoids

RNG = np.random.default_rng(5)
T = np.sort(RNG.uniform(0.3, 9.7, 200))
WAVES = signals.Sinusoids(RNG.uniform(0.5, 9.0, 6), RNG.normal(size=6), RNG.normal(size=6))
WAVES3 = signals.Sinusoids(RNG.uniform(0.5, 9.0, 6), RNG.normal(size=(6, 3)), RNG.normal(size=(6, 3)))
MOVES = signals.Moves((1.0, 4.0, 6.0), (2.0, 1.5, 3.0), (0.7, -1.1, 0.4))
SIGNALS = {
    "polynomial": signals.Polynomial((1.0, -2.0, 0.5, 0.3)), "sinusoids": WAVES, "sinusoids of 3": WAVES3,
    "quintic moves": MOVES,
    "cycloid moves of 3": signals.Moves((1.0, 4.0), (2.0, 3.0), RNG.normal(size=(2, 3)), signals.cycloid),
    "sum": WAVES + MOVES, "scaled": 3.0 * WAVES, "windowed": signals.Windowed(WAVES, MOVES),
    "windowed 3": signals.Windowed(WAVES3, MOVES), "ramps": signals.Ramps((1.0, 3.0, 5.0, 9.0), (0.5, -1.0, -1.0, 2.0)),
    "stack": signals.Stack((WAVES, MOVES, signals.constant(2.0))),
    "driven": signals.Driven(0.0, 0.5, RNG.normal(size=(20, 2)), 6.0, 0.3),
    "mixed": signals.Linear(WAVES3, RNG.normal(size=(2, 3)).T.__rmatmul__), "sine": signals.Sine(WAVES),
    "warm-up": signals.WarmUp(15.0, 3.0),
}  # fmt: skip


def away_from_joints(t):
    joints = np.arange(1.0, 9.5, 0.5)
    return t[np.min(np.abs(t[:, np.newaxis] - joints), axis=1) > 5e-3]


@pytest.mark.parametrize("name", SIGNALS)
def test_derivatives_are_those_of_the_value(name, closes_in):
    signal, t = SIGNALS[name], away_from_joints(T)
    (shape,) = {(part.shape, part.dtype.name) for part in signal.jet(T)}
    assert (shape[0][0], shape[1]) == (T.size, "float64")
    closes_in(lambda s: signal.jet(s).value, lambda s: signal.jet(s).rate, t)
    closes_in(lambda s: signal.jet(s).rate, lambda s: signal.jet(s).acc, t)


@pytest.mark.parametrize("law", [signals.quintic, signals.cycloid])
def test_a_law_goes_from_rest_at_0_to_rest_at_1(law):
    way = law(np.array([0.0, 1.0]))
    # definition of a rest-to-rest law; 2π rounded makes sin(2π) of the order 1e-16
    np.testing.assert_allclose(way.value, [0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(way.rate, 0.0, atol=1e-15)
    np.testing.assert_allclose(way.acc, 0.0, atol=1e-14)


def test_moves_join_without_a_step_and_stay_where_they_arrive():
    h = 1e-9
    for joint in (1.0, 3.0, 4.0, 5.5, 6.0, 9.0):
        before, after = (MOVES.jet(np.array([joint + side])) for side in (-h, h))
        # twice continuously differentiable: over 2e-9 s nothing changes by more than that times the next derivative,
        # whose largest value is 60 change / duration³ < 20 (third derivative of 10u³ − 15u⁴ + 6u⁵ at u = 0)
        for part_before, part_after in zip(before, after, strict=True):
            assert abs(part_after[0] - part_before[0]) < 20.0 * 2.0 * h
    t = np.array([0.0, 3.5, 5.75, 20.0])
    np.testing.assert_allclose(MOVES.jet(t).value, [0.0, 0.7, -0.4, 0.0], atol=1e-15)  # running sums of the changes
    assert not MOVES.jet(t).rate.any()


def test_a_stroke_has_the_velocity_of_a_table_slide():
    v, duration = 2.0, 0.4
    t = np.linspace(0.0, duration, 401)
    slide = signals.Moves((1.0,), (duration,), (0.5 * v * duration,), signals.cycloid).jet(t + 1.0)
    # closed form: velocity v/2 (1 − cos(2πt/T)), its integral and its derivative
    turn = 2.0 * np.pi / duration
    np.testing.assert_allclose(slide.rate, 0.5 * v * (1.0 - np.cos(turn * t)), atol=1e-12)
    np.testing.assert_allclose(slide.value, 0.5 * v * (t - np.sin(turn * t) / turn), atol=1e-13)
    np.testing.assert_allclose(slide.acc, 0.5 * v * turn * np.sin(turn * t), atol=1e-10)
    assert slide.rate.max() == pytest.approx(v, rel=1e-12)  # at T/2, which is on the grid


def test_sinusoids_are_their_sum_phasors_rotating_pointers_and_ramps_areas_under_lines():
    t = np.linspace(0.0, 50.0, 10_000)
    direct = sum(
        a * np.cos(w * t) + b * np.sin(w * t) for w, a, b in zip(WAVES.omega, WAVES.cosine, WAVES.sine, strict=True)
    )
    np.testing.assert_allclose(WAVES.jet(t).value, direct, atol=1e-12)  # definition
    omega, z = np.array([1.3, 4.0]), np.array([1.0 - 2.0j, 0.3 + 0.1j])
    direct = (z * np.exp(1j * np.outer(T, omega))).sum(axis=1).real
    np.testing.assert_allclose(signals.Sinusoids.from_phasors(omega, z).jet(T).value, direct, atol=1e-13)  # definition
    signal = signals.Ramps((1.0, 3.0, 5.0), (0.0, 4.0, 4.0))
    value, rate, acc = signal.jet(np.array([0.0, 2.0, 3.0, 4.0, 6.0]))
    # a triangle of 2 s and 4/s, then a rectangle that goes on after the last knot
    np.testing.assert_array_equal(value, [0.0, 1.0, 4.0, 8.0, 16.0])
    np.testing.assert_array_equal(rate, [0.0, 2.0, 4.0, 4.0, 4.0])
    np.testing.assert_array_equal(acc, [0.0, 2.0, 0.0, 0.0, 0.0])


def test_oscillator_answers_a_wave_with_its_transfer_function_and_rests_where_a_steady_force_holds_it():
    omega, damping, drive, step = 2.0 * np.pi * 6.0, 0.3, 2.0 * np.pi * 1.3, 1e-3
    knots = step * np.arange(10001)
    found = signals.Driven(0.0, step, 4.0 * np.cos(drive * knots)[:, np.newaxis], omega, damping).jet(T[T > 4.0])
    # 1 / (ω² − w² + 2jζωw); what was left of the start has died out by exp(−0.3 ω 4) = 2e-20
    answer = 4.0 / (omega**2 - drive**2 + 2j * damping * omega * drive) * np.exp(1j * drive * T[T > 4.0])
    # straight lines between knots are wrong by (w h)² / 8 of the drive at most; a spring of ζ = 0.3 makes at most
    # (1 + e) / (1 − e) = 2.2 of it, e = exp(−πζ / √(1 − ζ²)), in units of 1 / ω², and its derivatives not much more
    wrong = 4.0 * 4.0 * (drive * step) ** 2 / 8.0
    wanted = (answer, 1j * drive * answer, -(drive**2) * answer)
    for got, want, unit in zip(found, wanted, (omega**2, omega, 1.0), strict=True):
        np.testing.assert_allclose(got[:, 0], want.real, rtol=0.0, atol=wrong / unit)
    found = signals.Driven(1.0, 0.1, np.full((5, 1), 3.0), 10.0, 0.2).jet(np.array([1.0, 1.23, 1.4]))
    np.testing.assert_allclose(found.value, 0.03, rtol=1e-12)  # drive / ω²
    np.testing.assert_allclose(found.rate, 0.0, atol=1e-12)


COUNT, RATE = 200_000, 50.0
LEVEL = np.array([0.02, 0.05, 0.1])
FLOOR = np.sqrt(2.0 * np.log(2.0) / np.pi)  # 0.6643, IEEE Std 952, from the two-sided density B²/(2πf)


def allan(y, n):
    """Overlapping Allan deviation, NIST SP 1065 (11), at n samples, of each column."""
    x = np.concatenate((np.zeros((1, y.shape[1])), np.cumsum(y, axis=0)))
    d = x[2 * n :] - 2.0 * x[n:-n] + x[: -2 * n]
    return np.sqrt(np.mean(d * d, axis=0) / 2.0) / n


def edf(n, kind):
    """Degrees of freedom of the overlapping estimate, NIST SP 1065 table 5 (white, flicker, random walk of rate)."""
    m = COUNT
    return {
        "white": (3.0 * (m - 1) / (2.0 * n) - 2.0 * (m - 2) / m) * 4.0 * n**2 / (4.0 * n**2 + 5.0),
        "flicker": 5.0 * m**2 / (4.0 * n * (m + 3.0 * n)),
        "walk": (m - 2.0) / n * ((m - 1.0) ** 2 - 3.0 * n * (m - 1.0) + 4.0 * n**2) / (m - 3.0) ** 2,
    }[kind]


def assert_near(found, expected, n, kind):
    """Within four standard deviations of an Allan deviation: a fraction 1/√(2 edf) each."""
    np.testing.assert_allclose(found, expected, rtol=4.0 / np.sqrt(2.0 * edf(n, kind)))


@pytest.mark.parametrize("n", [1, 10, 100, 1000])
def test_white_noise_lies_at_n_over_root_tau(n):
    y = errors.white(errors.white_sd(LEVEL, RATE), COUNT, stream(1, "test"))
    assert_near(allan(y, n), LEVEL / np.sqrt(n / RATE), n, "white")  # IEEE Std 952


@pytest.mark.parametrize("n", [16, 64, 256, 1024, 4096])
def test_flicker_noise_is_flat_at_two_thirds_of_b(n):
    y = errors.flicker(LEVEL, COUNT, stream(2, "test"))
    # folding raises the sampled deviation by 0.2 % at 16 samples (variance ratio 1.015 at 8, 1.000 at 64, from the
    # integral of the folded density), far below the tolerance there
    assert_near(allan(y, n), FLOOR * LEVEL, n, "flicker")


def test_flicker_at_one_sample_shows_the_folded_spectrum_and_a_ramp_rises_with_tau():
    y = errors.flicker(LEVEL, COUNT, stream(2, "test"))
    # half the mean square of the first difference: ∫ B²/|2 sin πf| · 2 sin²(πf) df over ±½ = B² 2/π (closed form)
    assert_near(allan(y, 1), LEVEL * np.sqrt(2.0 / np.pi), 1, "white")
    drifting = TriadErrors(ramp=LEVEL)
    still = np.zeros((5000, 3))
    y = measure(drifting, still, triad="gyr", seed=0, rate=RATE, temp_c=np.full(5000, 25.0), force_b=still).values
    for n in (1, 30, 1000):
        np.testing.assert_allclose(allan(y, n), LEVEL * n / RATE / np.sqrt(2.0), rtol=1e-8)  # IEEE Std 952: R τ/√2


@pytest.mark.parametrize("n", [1, 10, 100, 1000])
def test_random_walk_rises_with_root_tau(n):
    y = errors.random_walk(LEVEL, COUNT, RATE, stream(3, "test"))
    # K √(τ/3), IEEE Std 952; a walk that is sampled, not averaged, has 1 + 1/(2n²) of that variance (closed form)
    expected = LEVEL * np.sqrt(n / RATE / 3.0 * (1.0 + 0.5 / n**2))
    assert_near(allan(y, n), expected, n, "walk")


def test_streams_are_repeatable_and_do_not_share_numbers():
    again, other, another = (stream(*key).standard_normal(1000) for key in
                             ((1, "gyr", "white"), (1, "acc", "white"), (1, "gyr", "flicker")))  # fmt: skip
    np.testing.assert_array_equal(stream(1, "gyr", "white").standard_normal(1000), again)
    for x in (other, another, stream(2, "gyr", "white").standard_normal(1000)):
        assert abs(np.corrcoef(again, x)[0, 1]) < 4.0 / np.sqrt(1000)  # sd of a correlation of independent numbers


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
    variance = elevation(waves).jet(np.arange(0.0, duration, 0.25)).value.var()
    assert mixing < 0.1 * variance
    assert variance == pytest.approx((1.5 / 4.0) ** 2, abs=mixing)


def test_the_spectrum_peaks_at_the_period_has_its_energy_and_is_narrower_on_the_low_side():
    t = np.arange(0.0, 7200.0, 0.5)
    f, power = welch(elevation(sea(peakedness=7.0)).jet(t).value, fs=2.0, nperseg=240)
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
