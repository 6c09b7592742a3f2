"""Random processes: each at its own Allan level and slope, within what their number of samples allows."""

import numpy as np
import pytest

from plumbob.simulation import TriadErrors, errors
from plumbob.simulation.errors import measure, stream

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
