"""What a covariance claims for yaw, pitch and roll."""

import numpy as np
import pytest

from plumbob.rotations import euler_zyx_from_quat, quat_from_euler_zyx, quat_from_rotvec, quat_multiply
from plumbob.rotations.headings import claimed_sd, euler_sd

COV = np.array([[4.0, 1.0, -0.5], [1.0, 2.0, 0.3], [-0.5, 0.3, 3.0]]) * 1e-6


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (2.0, 0.3, -0.4), (-1.0, -1.2, 2.5), (0.5, 1.4, -3.0)])
def test_they_are_the_spread_of_the_angles_of_attitudes_that_stray_so(angles):
    """20 000 drawn errors in body axes; the spread of so many is known to 0.5 % (1 sd), and 5 sd are allowed."""
    rng = np.random.default_rng(1)
    q = quat_from_euler_zyx(np.array([angles]))
    errors = rng.multivariate_normal(np.zeros(3), COV, size=20_000)
    spread = np.std(euler_zyx_from_quat(quat_multiply(q, quat_from_rotvec(errors))), axis=0)
    np.testing.assert_allclose(euler_sd(q, COV[np.newaxis])[0], spread, rtol=0.025)


def test_of_a_level_body_that_of_the_yaw_is_that_of_the_heading_and_of_no_variance_there_is_none():
    q = quat_from_euler_zyx([[1.0, 0.0, 0.0]])
    assert euler_sd(q, COV[np.newaxis])[0, 0] == pytest.approx(claimed_sd(q, COV[np.newaxis])[1][0])
    assert np.isnan(euler_sd(quat_from_euler_zyx([[1.0, 0.2, 0.0]]), np.zeros((1, 3, 3)))).all()
