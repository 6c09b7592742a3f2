"""Normal equations whose unknowns differ by many orders of size."""

import numpy as np

from plumbob.quality.arrangement import solved


def test_unknowns_of_any_size_are_solved_and_one_that_nothing_tells_stays_zero():
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(200, 4)) * [1e-9, 1.0, 1e6, 1.0]
    x = np.array([3e9, -2.0, 5e-6, 0.0])
    rows[:, 3] = 0.0
    a = np.stack([rows.T @ rows] * 2)
    found = solved(a, (a[0] @ x)[np.newaxis, :, np.newaxis] * [[[1.0]], [[2.0]]])[:, :, 0]
    np.testing.assert_allclose(found, [x, 2.0 * x], rtol=1e-8)  # the plain solution is singular: a row of zeros
    a = np.array([[4.0, 4.0], [4.0, 4.0]])
    np.testing.assert_allclose(solved(a, np.array([[8.0], [8.0]]))[:, 0], [1.0, 1.0], rtol=1e-3)
