"""The low-pass with exact steps: its closed form, SciPy's transition, and its corner."""

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


@given(steps, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_any_step_from_any_state_is_scipys_transition(t, y, w, v):
    """scipy.signal.cont2discrete with a held input, which takes the matrix exponential."""
    a, b, *_ = signal.cont2discrete(SYSTEM, t, method="zoh")
    expected = a @ [y, w] + b[:, 0] * v
    # what expm loses: its squarings, about t of them in log2, each of a few ε of norms up to 3
    assert np.abs(np.subtract(smooth.py_func(*weights.py_func(t, 1.0), y, w, v), expected)).max() < 1e-12 * (
        abs(y) + abs(w) + abs(v) + 1e-300
    )


class TestKeptWeights:
    AT = 3

    def made(self):
        x = np.full(self.AT + 6, 7.0) * np.array([1.0] * 3 + [0.0] * 5 + [1.0])
        return x, kept_weights.py_func(x, self.AT, 0.01, 0.5)

    def test_the_first_step_makes_them_and_touches_nothing_else(self):
        x, first = self.made()
        assert first == tuple(x[self.AT : self.AT + 4]) == weights.py_func(0.01, 0.5)
        assert (x[self.AT + 4], *x[:3], x[-1]) == (0.01, 7.0, 7.0, 7.0, 7.0)
        assert kept_weights.py_func(x, self.AT, 0.0, 0.5) == (1.0, 0.0, 0.0, 1.0)  # a repeated time changes nothing

    @pytest.mark.parametrize("change", [0.999e-3, -0.999e-3, 1.001e-3, -1.001e-3])
    def test_they_are_kept_within_a_thousandth(self, change):
        x, first = self.made()
        dt = 0.01 * (1.0 + change)
        assert kept_weights.py_func(x, self.AT, dt, 0.5) == (first if abs(change) < 1e-3 else weights.py_func(dt, 0.5))

    def test_a_step_that_creeps_is_followed(self):
        """The comparison is with the step that they are for, not with the last one."""
        x, _ = self.made()
        for dt in 0.01 * 1.0002 ** np.arange(4000):
            apart = np.subtract(kept_weights.py_func(x, self.AT, dt, 0.5), weights.py_func(dt, 0.5))
            # the weights' derivatives by t = dt/τ are at most 2
            assert np.abs(apart).max() < 2.0 * 1.1e-3 * dt / 0.5
