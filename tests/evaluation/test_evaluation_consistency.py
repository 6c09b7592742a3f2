"""NEES: a claimed covariance that is true, one that is too small, one that is unusable."""

import numpy as np
import pytest
from scipy.stats import chi2

from plumbob.door.evaluate import evaluate
from plumbob.evaluation.metrics import BOUNDS, CONFIDENCE, DOF
from plumbob.rotations import North, quat_from_rotvec, quat_multiply

N = 20_000
COV = np.array([[4.0, 1.0, 0.0], [1.0, 2.0, -0.5], [0.0, -0.5, 1.0]]) * 1e-6


@pytest.fixture(scope="module")
def noisy(motion, track):
    t = np.arange(N) / 100.0
    errors = np.random.default_rng(11).multivariate_normal(np.zeros(3), COV, N)
    q = quat_multiply(motion(t), quat_from_rotvec(errors))
    return lambda scale, **fields: (
        track(t, q, cov_b=np.broadcast_to(COV * scale, (N, 3, 3)), **fields),
        track(t, motion(t)),
    )


def test_bounds_are_those_of_chi_square():
    tail = 0.5 * (1.0 - CONFIDENCE)
    np.testing.assert_allclose(BOUNDS, chi2.ppf((tail, 1.0 - tail), DOF), rtol=1e-12)


def test_a_true_covariance_is_found_consistent_too_much_trust_shows_and_no_claim_has_no_verdict(noisy):
    found = evaluate(*noisy(1.0)).consistency
    assert found.mean == pytest.approx(3.0, abs=5 * np.sqrt(6.0 / N))  # variance of chi-square with 3 degrees is 6
    assert found.share_inside == pytest.approx(0.95, abs=5 * np.sqrt(0.95 * 0.05 / N))
    assert (found.count, found.unusable) == (N, 0)
    found = evaluate(*noisy(0.25)).consistency
    assert found.mean == pytest.approx(12.0, rel=0.05)
    assert found.share_inside < 0.6
    _, reference = noisy(1.0)
    free = evaluate(*noisy(1.0, north=North.FREE))
    assert evaluate(reference, reference).consistency is free.consistency is None
    assert "covariance claimed, but not judged" in " ".join(free.text().split())


def test_unusable_covariances_are_counted(noisy, track):
    estimate, reference = noisy(1.0)
    cov = estimate.cov_b.copy()
    cov[:7] = np.nan
    cov[7:10] = -COV
    found = evaluate(track(estimate.t, estimate.q_nb, cov_b=cov), reference).consistency
    assert (found.count, found.unusable) == (N - 10, 10)
    cov[:] = 0.0
    assert evaluate(track(estimate.t, estimate.q_nb, cov_b=cov), reference).consistency is None
