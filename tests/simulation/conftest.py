"""How a derivative is judged here: central differences must close in on it with the square of their step."""

import numpy as np
import pytest


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
