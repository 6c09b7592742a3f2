"""How a derivative is judged here: central differences must close in on it with the square of their step."""

import numpy as np
import pytest

from plumbob.rotations import quat_conjugate, quat_multiply, rotvec_from_quat


@pytest.fixture
def closes_in():
    """Fail unless central differences of `function` converge to `derivative` at second order, from below 1 % on."""

    def judge(function, derivative, t, step=2e-3):
        exact = derivative(t)
        size = np.max(np.abs(exact))
        wide, narrow = (
            np.max(np.abs((function(t + h) - function(t - h)) / (2.0 * h) - exact)) for h in (step, 0.5 * step)
        )
        if size == 0.0:
            assert wide == 0.0
            return
        assert wide < 0.01 * size
        # halving the step of a central difference divides its error by four (Taylor), up to terms of the next order;
        # a difference that has reached rounding, eps / step, is as good as it gets
        assert narrow < 1e-10 * size or 3.5 < wide / narrow < 4.5

    return judge


@pytest.fixture
def moves_as_derived(closes_in):
    """Fail unless rates are those of the attitude, each derivative that of what it is derived from, at times `t`."""

    def rate_by_differences(truth, t, h):
        return rotvec_from_quat(quat_multiply(quat_conjugate(truth(t - h).q_nb), truth(t + h).q_nb)) / (2.0 * h)

    def judge(truth, t):
        exact = truth(t).rate_b
        wide, narrow = (np.max(np.abs(rate_by_differences(truth, t, h) - exact)) for h in (2e-3, 1e-3))
        assert wide < 0.01 * np.max(np.abs(exact))
        assert 3.5 < wide / narrow < 4.5  # a central difference is of second order (Taylor)
        closes_in(lambda t: truth(t).rate_b, lambda t: truth(t).rate_dot_b, t)
        closes_in(lambda t: truth(t).pos_n, lambda t: truth(t).vel_n, t)
        closes_in(lambda t: truth(t).vel_n, lambda t: truth(t).acc_n, t)

    return judge
