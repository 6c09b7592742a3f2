"""Signals: derivatives against differences, and each shape against its closed form."""

import numpy as np
import pytest

from plumbob.simulation import signals

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
    "mixed": signals.Mixed(WAVES3, RNG.normal(size=(2, 3))), "sine": signals.Sine(WAVES),
    "warm-up": signals.WarmUp(15.0, 3.0),
}  # fmt: skip


def away_from_joints(t):
    joints = np.arange(1.0, 9.5, 0.5)
    return t[np.min(np.abs(t[:, np.newaxis] - joints), axis=1) > 5e-3]


@pytest.mark.parametrize("name", SIGNALS)
def test_derivatives_are_those_of_the_value(name, closes_in):
    signal, t = SIGNALS[name], away_from_joints(T)
    (shape,) = {(part.shape, part.dtype.name) for part in signal.at(T)}
    assert (shape[0][0], shape[1]) == (T.size, "float64")
    closes_in(lambda s: signal.at(s).value, lambda s: signal.at(s).rate, t)
    closes_in(lambda s: signal.at(s).rate, lambda s: signal.at(s).acc, t)


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
        before, after = (MOVES.at(np.array([joint + side])) for side in (-h, h))
        # twice continuously differentiable: over 2e-9 s nothing changes by more than that times the next derivative,
        # whose largest value is 60 change / duration³ < 20 (third derivative of 10u³ − 15u⁴ + 6u⁵ at u = 0)
        for part_before, part_after in zip(before, after, strict=True):
            assert abs(part_after[0] - part_before[0]) < 20.0 * 2.0 * h
    t = np.array([0.0, 3.5, 5.75, 20.0])
    np.testing.assert_allclose(MOVES.at(t).value, [0.0, 0.7, -0.4, 0.0], atol=1e-15)  # running sums of the changes
    assert not MOVES.at(t).rate.any()


def test_a_stroke_has_the_velocity_of_a_table_slide():
    v, duration = 2.0, 0.4
    t = np.linspace(0.0, duration, 401)
    slide = signals.Moves((1.0,), (duration,), (0.5 * v * duration,), signals.cycloid).at(t + 1.0)
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
    np.testing.assert_allclose(WAVES.at(t).value, direct, atol=1e-12)  # definition
    omega, z = np.array([1.3, 4.0]), np.array([1.0 - 2.0j, 0.3 + 0.1j])
    direct = (z * np.exp(1j * np.outer(T, omega))).sum(axis=1).real
    np.testing.assert_allclose(signals.Sinusoids.from_phasors(omega, z).at(T).value, direct, atol=1e-13)  # definition
    signal = signals.Ramps((1.0, 3.0, 5.0), (0.0, 4.0, 4.0))
    value, rate, acc = signal.at(np.array([0.0, 2.0, 3.0, 4.0, 6.0]))
    # a triangle of 2 s and 4/s, then a rectangle that goes on after the last knot
    np.testing.assert_array_equal(value, [0.0, 1.0, 4.0, 8.0, 16.0])
    np.testing.assert_array_equal(rate, [0.0, 2.0, 4.0, 4.0, 4.0])
    np.testing.assert_array_equal(acc, [0.0, 2.0, 0.0, 0.0, 0.0])


def test_oscillator_answers_a_wave_with_its_transfer_function_and_rests_where_a_steady_force_holds_it():
    omega, damping, drive, step = 2.0 * np.pi * 6.0, 0.3, 2.0 * np.pi * 1.3, 1e-3
    knots = step * np.arange(10001)
    found = signals.Driven(0.0, step, 4.0 * np.cos(drive * knots)[:, np.newaxis], omega, damping).at(T[T > 4.0])
    # 1 / (ω² − w² + 2jζωw); what was left of the start has died out by exp(−0.3 ω 4) = 2e-20
    answer = 4.0 / (omega**2 - drive**2 + 2j * damping * omega * drive) * np.exp(1j * drive * T[T > 4.0])
    # straight lines between knots are wrong by (w h)² / 8 of the drive at most; a spring of ζ = 0.3 makes at most
    # (1 + e) / (1 − e) = 2.2 of it, e = exp(−πζ / √(1 − ζ²)), in units of 1 / ω², and its derivatives not much more
    wrong = 4.0 * 4.0 * (drive * step) ** 2 / 8.0
    wanted = (answer, 1j * drive * answer, -(drive**2) * answer)
    for got, want, unit in zip(found, wanted, (omega**2, omega, 1.0), strict=True):
        np.testing.assert_allclose(got[:, 0], want.real, rtol=0.0, atol=wrong / unit)
    found = signals.Driven(1.0, 0.1, np.full((5, 1), 3.0), 10.0, 0.2).at(np.array([1.0, 1.23, 1.4]))
    np.testing.assert_allclose(found.value, 0.03, rtol=1e-12)  # drive / ω²
    np.testing.assert_allclose(found.rate, 0.0, atol=1e-12)
