"""The low-pass with exact steps: its closed form, SciPy's transition, and its corner."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from plumbob.filters.layout import kept_weights, smooth, weights

EPS = np.finfo(float).eps
SYSTEM = (np.array([[0.0, 1.0], [-2.0, -2.0]]), np.array([[0.0], [2.0]]), np.eye(2), np.zeros((2, 1)))
"""y″ + 2y′ + 2(y − v) = 0 in the time t/τ, with the state (y, y′)."""

steps = st.floats(1e-6, 30.0)


def run(times, inputs, tau, start=(0.0, 0.0)):
    """Outputs after each step; the input of a step stands throughout it."""
    (y, w), out = start, []
    for dt, v in zip(np.diff(times, prepend=0.0), inputs, strict=True):
        y, w = smooth.py_func(*weights.py_func(dt, tau), y, w, v)
        out.append((y, w))
    return np.array(out)


@given(st.lists(steps, min_size=1, max_size=30), st.floats(1e-2, 1e3))
def test_the_step_response_is_the_closed_form_however_it_is_cut(parts, tau):
    """y = 1 − e^−s (cos s + sin s), w = 2 e^−s sin s, with s = t/τ: Laplace transform of the step response.

    Each step rounds by a few ε of what is left of the step, which is at most 1.05 of it.
    """
    s = np.cumsum(parts)
    y, w = run(tau * s, np.ones(s.size), tau).T
    within = 20 * EPS * (s.size + s)  # the rounding of s itself turns cos and sin
    assert (np.abs(y - (1.0 - np.exp(-s) * (np.cos(s) + np.sin(s)))) < within).all()
    assert (np.abs(w - 2.0 * np.exp(-s) * np.sin(s)) < within).all()


@given(steps)
def test_a_step_is_two_halves(t):
    p, q, r, s = weights.py_func(0.5 * t, 1.0)
    half = np.array([[p, q], [r, s]])
    # entries of the half are at most 2, sums of two products of them
    assert np.abs(half @ half - np.reshape(weights.py_func(t, 1.0), (2, 2))).max() < 20 * EPS * (1.0 + t)


@given(steps, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_any_step_from_any_state_is_scipys_transition(t, y, w, v):
    """scipy.signal.cont2discrete with a held input, which takes the matrix exponential."""
    a, b, *_ = signal.cont2discrete(SYSTEM, t, method="zoh")
    expected = a @ [y, w] + b[:, 0] * v
    # what expm loses: its squarings, about t of them in log2, each of a few ε of norms up to 3
    assert np.abs(np.subtract(smooth.py_func(*weights.py_func(t, 1.0), y, w, v), expected)).max() < 1e-12 * (
        abs(y) + abs(w) + abs(v) + 1e-300
    )


def test_it_is_scipys_butterworth():
    """Numerator and denominator of scipy.signal.butter of order 2 with its corner at √2, to rounding."""
    numerator, denominator = signal.butter(2, math.sqrt(2.0), analog=True)
    ours = signal.ss2tf(*SYSTEM)
    assert ours[0][0] == pytest.approx([0.0, 0.0, *numerator], abs=20 * EPS)
    assert ours[1] == pytest.approx(denominator, abs=20 * EPS)


@pytest.mark.parametrize("tau", [0.05, 0.5, 20.0])
def test_the_corner_lies_at_root_two_over_tau(tau):
    """−3 dB, exactly 1/√2 of a sine; a thousand steps per τ hold it with a gain of 1 − (√2/1000)²/24 = 1 − 8e-8."""
    p, q, r, s = weights.py_func(1e-3 * tau, tau)
    z = np.exp(1j * math.sqrt(2.0) * 1e-3)  # of one step at √2/τ rad/s
    gain = np.linalg.solve(z * np.eye(2) - [[p, q], [r, s]], [1.0 - p, -r])[0]
    assert abs(gain) == pytest.approx(math.sqrt(0.5), rel=1e-7)


def test_irregular_steps_are_the_same_filter():
    """A sine through steps of 1 to 20 ms and through 1 ms: they differ by how long each holds its input, no more."""
    rng = np.random.default_rng(2)
    fine = np.arange(1, 8001)
    coarse = fine[np.cumsum(rng.integers(1, 21, 700))]
    wave = np.sin(2.0 * np.pi * 0.5 * fine * 1e-3)
    whole = run(fine * 1e-3, wave, 0.5)[coarse - 1, 0]
    held = run(coarse * 1e-3, wave[coarse - 1], 0.5)[:, 0]
    # the input is early by at most 19 ms of a slope of π/s; the low-pass, whose response has the integral of its
    # modulus 1.09 (1 + 2e^−π/(1 − e^−π)), can make no more of it
    assert np.abs(whole - held).max() < 1.09 * 0.019 * math.pi
    assert np.abs(whole - held).max() > 1e-3  # and the two did differ


class TestKeptWeights:
    AT = 3

    def state(self):
        return np.full(self.AT + 6, 7.0) * np.array([1.0] * 3 + [0.0] * 5 + [1.0])

    def test_the_first_step_makes_them_and_touches_nothing_else(self):
        x = self.state()
        assert kept_weights.py_func(x, self.AT, 0.01, 0.5) == weights.py_func(0.01, 0.5)
        assert tuple(x[self.AT : self.AT + 4]) == weights.py_func(0.01, 0.5)
        assert (x[self.AT + 4], *x[:3], x[-1]) == (0.01, 7.0, 7.0, 7.0, 7.0)

    @pytest.mark.parametrize("change", [0.999e-3, -0.999e-3, 1.001e-3, -1.001e-3])
    def test_they_are_kept_within_a_thousandth(self, change):
        x = self.state()
        kept_weights.py_func(x, self.AT, 0.01, 0.5)
        dt = 0.01 * (1.0 + change)
        assert kept_weights.py_func(x, self.AT, dt, 0.5) == weights.py_func(0.01 if abs(change) < 1e-3 else dt, 0.5)

    def test_a_step_that_creeps_is_followed(self):
        """The comparison is with the step that they are for, not with the last one."""
        x = self.state()
        for dt in 0.01 * 1.0002 ** np.arange(4000):
            p, q, r, s = kept_weights.py_func(x, self.AT, dt, 0.5)
            # the weights' derivatives by t = dt/τ are at most 2
            assert np.abs(np.subtract((p, q, r, s), weights.py_func(dt, 0.5))).max() < 2.0 * 1.1e-3 * dt / 0.5

    def test_a_repeated_time_changes_nothing(self):
        x = self.state()
        kept_weights.py_func(x, self.AT, 0.01, 0.5)
        assert kept_weights.py_func(x, self.AT, 0.0, 0.5) == (1.0, 0.0, 0.0, 1.0)


def test_compiled_as_plain():
    for t in (1e-9, 1e-3, 0.7, 40.0, 800.0):
        assert weights(t, 1.0) == weights.py_func(t, 1.0)
