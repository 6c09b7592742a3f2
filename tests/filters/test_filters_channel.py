"""Filters of one rate channel: their equations, closed forms, and one step however it is called."""

import math

import numpy as np
import pytest
from scipy import linalg, signal

from plumbob import filter_names, flags
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from plumbob.core.params import describe
from plumbob.core.units import deg, dps
from plumbob.filters.channel import RateFilter, load
from plumbob.filters.channel_average import same_noise
from plumbob.filters.channel_scalar import params_of, ramp_lag, steady_gain
from plumbob.filters.channel_two_state import ACC, P00, P01, P11
from plumbob.filters.known import RATE_FILTERS
from plumbob.filters.layout import CLOCK, OWN, RATE

EPS = np.finfo(float).eps
RATIOS = [1e-1, 1e-2, 1e-3, 1e-4, 1e-6]
HELD = flags.GYR_HELD | flags.GYR_ABSENT
STEPS_NS = np.random.default_rng(1).integers(1_000_000, 200_000_000, 300)
T = np.cumsum(STEPS_NS) / 1e9


def uneven(seed=0):
    """Three noisy channels with values missing, the first among them."""
    rng = np.random.default_rng(seed)
    rate = np.sin(T)[:, np.newaxis] * [0.5, -1.0, 2.0] + 0.01 * rng.standard_normal((T.size, 3))
    rate[rng.random((T.size, 3)) < 0.1] = np.nan
    rate[0, 1] = np.nan
    return rate


def even(count, dt=0.1):
    return dt * np.arange(count)


def settled(ratio, dt=0.1):
    """Scalar filter of that Q/R after 20 times its memory at a rate of 0."""
    f = RateFilter("scalar", params=params_of(ratio, noise=0.1, dt=dt)._asdict())
    count = math.ceil(20.0 / steady_gain(ratio))
    f.process(even(count, dt), np.zeros(count))
    return f, count


# --- the scalar Kalman filter -------------------------------------------------------------------------------


def by_the_paper(y, q, r):
    """[Chen2013] (8) to (12) with Φ = C = 1, K(0) = 1 and P0 = 1 (°/s)²."""
    x, p = y[0], math.radians(1.0) ** 2
    found = [x]
    for value in y[1:]:
        p = p + q
        k = p / (p + r)
        x = x + k * (value - x)
        p = (1.0 - k) * p
        found.append(x)
    return np.array(found)


@pytest.mark.parametrize("ratio", RATIOS)
def test_scalar_is_the_paper_step_by_step(ratio):
    y = 0.3 + 0.1 * np.random.default_rng(2).standard_normal(500)
    f = RateFilter("scalar", params=params_of(ratio, noise=dps(0.1), dt=0.1)._asdict())
    expected = by_the_paper(y, ratio * dps(0.1) ** 2, dps(0.1) ** 2)
    np.testing.assert_allclose(f.process(even(500), y).rate, expected, rtol=0, atol=500 * EPS)  # one rounding a step


@pytest.mark.parametrize(("ratio", "gain"), [(1e-1, 0.270), (1e-2, 0.095), (1e-3, 0.031), (1e-4, 0.010), (1e-6, 0.001)])
def test_gain_settles_where_the_closed_form_says(ratio, gain):
    """Beside the closed form, what SciPy finds for the same Riccati equation, and the gains by hand to three digits."""
    p = linalg.solve_discrete_are(np.eye(1), np.eye(1), ratio * np.eye(1), np.eye(1))[0, 0]
    assert steady_gain(ratio) == pytest.approx(p / (p + 1.0), rel=1e-9)
    assert steady_gain(ratio) == pytest.approx(gain, abs=5e-4)
    f, _ = settled(ratio)
    assert f.state[0, OWN + 1] == pytest.approx(steady_gain(ratio), rel=1e-6)  # 20 memories: exp(−40) of the start


@pytest.mark.parametrize("ratio", RATIOS[:-1])
def test_white_noise_falls_and_a_ramp_comes_late_as_the_closed_forms_say(ratio):
    """The variance ratio of white noise is the sum of squares of the response to a pulse: no noise is needed."""
    (f, count), (g, _), k = settled(ratio), settled(ratio), steady_gain(ratio)
    pulse = np.zeros(count)
    pulse[0] = 1.0
    response = f.process(even(count) + 0.1 * count, pulse).rate
    assert np.sum(response**2) == pytest.approx(k / (2.0 - k), rel=1e-6)  # Σ K² (1 − K)²ⁱ
    assert response[0] == pytest.approx(k, rel=1e-6)
    late, ramp = ramp_lag(k, deg(0.6), 0.1), deg(0.06) * np.arange(1, count + 1)
    assert ramp[-1] - g.process(even(count) + 0.1 * count, ramp).rate[-1] == pytest.approx(late, rel=1e-6)
    assert late == pytest.approx(deg(0.6) * 0.1 * (1.0 - k) / k, rel=4 * EPS)


def test_a_missing_sample_leaves_the_variance_of_a_longer_step():
    """Q grows with time, so a sample that is missing is a step of twice the length."""
    y, gone = np.random.default_rng(3).standard_normal(100), np.arange(100) % 7 == 3
    held = RateFilter("scalar").process(even(100), np.where(gone, np.nan, y))
    fewer = RateFilter("scalar").process(even(100)[~gone], y[~gone])
    np.testing.assert_allclose(held.rate[~gone], fewer.rate, rtol=0, atol=100 * EPS)
    assert ((held.flags == HELD) == gone).all()
    assert (held.rate[3::7] == held.rate[2:-1:7]).all()  # held while it is missing


# --- the Kalman filter with two states ----------------------------------------------------------------------


def by_matrices(t, y, q, r, p_acc):
    x, p = np.array([y[0], 0.0]), np.diag([r, p_acc])
    found = [x]
    for dt, value in zip(np.diff(t), y[1:], strict=True):
        f = np.array([[1.0, dt], [0.0, 1.0]])
        x, p = f @ x, f @ p @ f.T + q * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        if not math.isnan(value):
            k = p[:, 0] / (p[0, 0] + r)
            x, p = x + k * (value - x[0]), (np.eye(2) - np.outer(k, [1.0, 0.0])) @ p
        found.append(x)
    return np.array(found)


def test_two_states_are_the_matrix_equations_settle_follow_a_ramp_and_go_on_over_missing_samples():
    y = uneven()[:, 0]
    assert not math.isnan(y[0])
    f = RateFilter("two_state", params={"jerk": 0.5, "noise": 0.01, "start": 3.0})
    expected = by_matrices(T, y, 0.25, 1e-4, 9.0)
    # 300 steps, each of which rounds a rate below 1 some four times
    np.testing.assert_allclose(f.process(T, y).rate, expected[:, 0], rtol=0, atol=300 * 4 * EPS)
    f = RateFilter("two_state", params={"jerk": 0.02, "noise": 0.05})
    f.process(even(3000), np.zeros(3000))
    q = 0.02**2 * np.array([[0.1**3 / 3.0, 0.1**2 / 2.0], [0.1**2 / 2.0, 0.1]])
    motion = np.array([[1.0, 0.1], [0.0, 1.0]])
    before = linalg.solve_discrete_are(motion.T, np.array([[1.0], [0.0]]), q, np.array([[0.05**2]]))
    k = before[:, 0] / (before[0, 0] + 0.05**2)
    after = (np.eye(2) - np.outer(k, [1.0, 0.0])) @ before
    x = f.state[0]
    np.testing.assert_allclose([x[P00], x[P01], x[P11]], [after[0, 0], after[0, 1], after[1, 1]], rtol=1e-9)
    # The scalar filter of as little noise is 0.57 °/s behind; what is left here is the start, forgotten with time.
    f = RateFilter("two_state")
    ramp = deg(0.6) * even(1000)
    late = ramp - f.process(even(1000), ramp).rate
    assert np.abs(late[500:]).max() < 1e-6 * ramp_lag(steady_gain(1e-2), deg(0.6), 0.1)
    assert f.state[0, ACC] == pytest.approx(deg(0.6), rel=1e-6)
    f = RateFilter("two_state")
    f.process(even(1000), deg(0.6) * even(1000))
    found = f.process([101.0, 103.5], [np.nan, np.nan])
    np.testing.assert_allclose(found.rate, [deg(60.6), deg(62.1)], rtol=1e-6)
    assert found.flags.tolist() == [HELD, HELD]


# --- the moving average -------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 5, 20, 600])
def test_average_is_the_mean_of_the_last_samples(n):
    y = np.random.default_rng(4).standard_normal(500)
    found = RateFilter("moving_average", params={"samples": n}).process(even(500), y).rate
    full = signal.lfilter(np.ones(n), 1.0, y) / np.minimum(np.arange(1, 501), n)
    # sums of n numbers below 4, twice
    np.testing.assert_allclose(found, full, rtol=0, atol=2 * min(n, 500) * 4.0 * EPS)


def test_average_forgets_a_large_value_and_all_rounding_and_holds_while_samples_are_missing():
    """The running sum is renewed once per window, so nothing is left of 90 rad/s after two of them."""
    y = np.full(100_000, 1e-3)
    y[50] = 90.0
    found = RateFilter("moving_average", params={"samples": 7}).process(even(y.size, 1e-3), y).rate
    assert np.abs(found[70:] - 1e-3).max() <= 8 * EPS * 1e-3
    found = RateFilter("moving_average", params={"samples": 2}).process(even(4), [1.0, np.nan, 3.0, 5.0])
    assert found.rate.tolist() == [1.0, 1.0, 2.0, 4.0]
    assert found.flags.tolist() == [0, HELD, 0, 0]


@pytest.mark.parametrize("n", [1, 3, 20, 63, 2000])
def test_equal_noise_is_equal_lag(n):
    """1/n = K/(2 − K) makes (n − 1)/2 = (1 − K)/K: at equal noise the scalar filter is not one sample faster."""
    gain = 2.0 / (n + 1.0)
    assert same_noise(gain) == n
    assert ramp_lag(gain, 1.0, 1.0) == pytest.approx(0.5 * (n - 1.0), rel=8 * EPS)


# --- one step, however it is called -------------------------------------------------------------------------


@pytest.mark.parametrize("name", RATE_FILTERS)
class TestEveryChannelFilter:
    def test_however_it_is_called_the_bits_are_the_same(self, name):
        """In chunks, sample by sample, made with the state on the way, each channel alone, and again after a reset."""
        rate, t_ns = uneven(), np.cumsum(STEPS_NS)
        before = rate.tobytes()
        f = RateFilter(name, channels=3)
        whole = f.process(T, rate)
        assert rate.tobytes() == before
        for size in (1, 7, 64, 299):
            f.reset()
            parts = [f.process(T[i : i + size], rate[i : i + size]) for i in range(0, T.size, size)]
            assert b"".join(p.rate.tobytes() for p in parts) == whole.rate.tobytes()
            assert b"".join(p.flags.tobytes() for p in parts) == whole.flags.tobytes()
        f.reset()
        for i, row in enumerate(rate):
            if i in {1, 2, 150}:
                other = RateFilter(name, channels=3, state=f.state)
                assert other.process(T[i:], rate[i:]).rate.tobytes() == whole.rate[i:].tobytes()
            assert f.update(int(t_ns[i]), *row) == whole.flags[i], i
            assert f.rate.tobytes() == whole.rate[i].tobytes(), i
        for k in range(3):
            alone = RateFilter(name).process(T, rate[:, k])
            assert alone.rate.tobytes() == whole.rate[:, k].tobytes()
            assert (whole.flags & alone.flags == alone.flags).all()

    def test_a_constant_passes_as_it_is(self, name):
        """A bias is nothing that a filter of a channel could take away."""
        found = RateFilter(name).process(T, np.full(T.size, 0.7)).rate
        assert np.abs(found - 0.7).max() <= 64 * EPS

    def test_what_is_missing_is_held_flagged_and_soon_forgotten_and_first_there_is_no_rate(self, name):
        rate = 0.3 + 0.01 * np.sin(T)
        bad = rate.copy()
        bad[100:103] = np.nan, np.inf, -1e30
        found, clean = RateFilter(name).process(T, bad), RateFilter(name).process(T, rate)
        assert np.isfinite(found.rate).all()
        invalid = flags.GYR_HELD | flags.GYR_INVALID
        assert found.flags[99:104].tolist() == [0, HELD, invalid, invalid, 0]
        assert np.abs(found.rate - clean.rate).max() < 0.02  # the peak to peak of what was there
        found = RateFilter(name).process(even(4), [np.nan, np.inf, 0.5, 0.5])
        assert np.isnan(found.rate[:2]).all()
        assert found.rate[2:].tolist() == [0.5, 0.5]
        assert (found.flags[:2] & flags.GYR_HELD == flags.GYR_HELD).all()

    def test_a_late_sample_is_flagged_and_changes_nothing(self, name):
        f = RateFilter(name)
        f.process(T[:50], uneven()[:50, 0])
        before = f.state
        assert f.update(int(STEPS_NS[:20].sum()), 55.0) == flags.TIME_FAULT
        kept = np.r_[0:CLOCK, OWN : before.shape[1]]
        assert f.state[0, kept].tobytes() == before[0, kept].tobytes()
        assert f.rate[0] == before[0, RATE]

    def test_every_parameter_says_what_it_is(self, name):
        for p in describe(load(name).Params):
            assert p.spec.meaning
            assert p.spec.low <= p.default <= p.spec.high
        assert RateFilter(name).describe().startswith(f"{name}(")


def test_parameters_in_text_carry_their_unit():
    f = RateFilter("two_state", params={"jerk": "0.05 deg/s2", "noise": "0.1 deg/s"})
    assert f.params.jerk == deg(0.05)
    assert f.describe() == "two_state(jerk=0.05 deg/s2, noise=0.1 deg/s, start=10 deg/s2)"
    assert not set(RATE_FILTERS) & set(filter_names())


@pytest.mark.parametrize(("call", "error", "words"), [
    *(
        (lambda bad=bad, closed=closed: closed(bad), ParameterError, r"must be positive|a gain must be")
        for bad in (0.0, -1.0, math.nan, math.inf)
        for closed in (
            steady_gain,
            same_noise,
            lambda bad: params_of(0.1, noise=bad, dt=0.1),
            lambda bad: params_of(0.1, noise=0.1, dt=bad),
            lambda bad: ramp_lag(bad, 0.6, 0.1),
        )
    ),
    (lambda: RateFilter("kalman"), ParameterError, "no channel filter 'kalman'; known: scalar, two_state"),
    (lambda: RateFilter("scalar", params={"q": 1.0}), ParameterError, "scalar has no parameter 'q'"),
    (
        lambda: RateFilter("two_state", params={"jerk": "0.05"}),
        ParameterError,
        "jerk.*needs a unit.*rad/s2, deg/s2",
    ),
    (
        lambda: RateFilter("moving_average", params={"samples": 2.5}),
        ParameterError,
        r"whole number, but it is 2\.5",
    ),
    (lambda: RateFilter("scalar", channels=0), ParameterError, "channels must be at least 1"),
    (lambda: RateFilter("scalar", state=np.zeros(3)), ShapeError, r"state of scalar.* has shape \(1, \d+\)"),
    (lambda: RateFilter("scalar").process([0.0], [[1.0]]), ShapeError, r"rate must have shape \(N,\)"),
    (lambda: RateFilter("scalar", channels=3).process([0.0], [1.0]), ShapeError, r"rate must have shape \(N, 3\)"),
    (lambda: RateFilter("scalar").process([0.0, 1.0], [1.0]), ShapeError, "one entry per time stamp"),
    (lambda: RateFilter("scalar").process([1.0, 1.0], [1.0, 1.0]), ClockError, "strictly increase"),
    (lambda: RateFilter("scalar", channels=2).update(0, 1.0), ShapeError, "update needs 2 rates"),
])  # fmt: skip
def test_what_is_not_clear_is_refused(call, error, words):
    with pytest.raises(error, match=words):
        call()
