"""Ellipsoids: closed forms, maximum likelihood, covariance; and outliers, which are left out in groups."""

from itertools import combinations

import numpy as np
import pytest

from plumbob.calibration import ellipsoid_fit as ellipsoids
from tests.helpers import slow_as_python
from tests.helpers.mag_scene import STRENGTH, Unit, attitudes, field, soft_iron

START = ellipsoids.Ellipsoid(np.zeros(3), np.eye(3) / STRENGTH)


def capture(rng, count, response, bias, noise=0.2, step=0.073, tilt=None):
    return field(rng, Unit(response, bias), attitudes(rng, count, tilt), sd=noise, step=step)


@pytest.mark.parametrize(("fit", "count", "response"), [
    (ellipsoids.fit_quadric, 40, soft_iron(np.random.default_rng(1))),
    (
        lambda m: ellipsoids.fit_norm(m, ellipsoids.Shape.ELLIPSOID, START).ellipsoid,
        40,
        soft_iron(np.random.default_rng(1)),
    ),
    (ellipsoids.fit_axes, 18, np.diag([1.1, 0.9, 1.02])),
])  # fmt: skip
def test_without_noise_the_ellipsoid_comes_back(fit, count, response):
    """|T (m − b)| = 1 with T = response⁻¹ / length, for a symmetric response; along the axes six parameters are enough,
    [Yu2018] (13), (14), corrected."""
    bias = np.array([6.0, -7.0, 3.0])
    ellipsoid = fit(capture(np.random.default_rng(2), count, response, bias, 0.0, 0.0))
    np.testing.assert_allclose(ellipsoid.centre, bias, atol=1e-9)
    np.testing.assert_allclose(ellipsoid.shape, np.linalg.inv(response) / STRENGTH, rtol=1e-9, atol=1e-12)


def test_where_no_closed_form_gives_one_a_sphere_is_the_start_and_a_hyperboloid_is_no_ellipsoid():
    """Four corners of a cube about a centre, each half a space diagonal away, are too few for six parameters."""
    corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    found = ellipsoids.first_ellipsoid(100.0 + 50.0 * corners)
    np.testing.assert_allclose(found.centre, 100.0, rtol=1e-12)
    np.testing.assert_allclose(found.shape, np.eye(3) / (50.0 * np.sqrt(3.0)), rtol=1e-12)
    # x² + y² − z² = 1: the closed forms say so instead of giving a root of a negative number.
    rng = np.random.default_rng(3)
    z, angle = rng.uniform(-2, 2, 50), rng.uniform(0, 2 * np.pi, 50)
    radius = np.sqrt(1.0 + z * z)
    points = np.stack((radius * np.cos(angle), radius * np.sin(angle), z), axis=-1)
    assert ellipsoids.fit_axes(points) is None and ellipsoids.fit_quadric(points) is None
    assert ellipsoids.fit_quadric(np.ones((20, 3))) is None


@pytest.mark.parametrize("i", range(9))
def test_derivatives_are_those_of_the_residual(i):
    """Central differences of step h leave h² and rounding ε/h: 1e-9 at h = 1e-6 of numbers of order one."""
    rng = np.random.default_rng(4)
    p = np.r_[0.1 * rng.normal(size=3), 1.1, 0.9, 1.05, 0.1, -0.05, 0.03]
    point, used = 1.2 * rng.normal(size=(1, 3)), np.ones(1, dtype=bool)

    def residual(change):
        left, normal = np.empty(1), np.empty((9, 10))
        ellipsoids.accumulate(point, p + change * np.eye(9)[i], np.inf, used, left, normal)
        return left[0], normal[i, 9] / left[0]

    numeric = (residual(1e-6)[0] - residual(-1e-6)[0]) / 2e-6
    assert residual(0.0)[1] == pytest.approx(numeric, abs=1e-8)


def test_linearised_agrees_with_the_kernel_on_the_ellipsoid():
    """Where the residual is zero, its own part in the derivative vanishes and both are the same."""
    rng = np.random.default_rng(5)
    response, bias = soft_iron(rng), np.array([6.0, -7.0, 3.0])
    exact = capture(rng, 30, response, bias, 0.0, 0.0)
    ellipsoid = ellipsoids.Ellipsoid(bias, np.linalg.inv(response) / STRENGTH)
    rows, left = ellipsoids.linearised(exact, ellipsoid)
    assert np.abs(left).max() < 1e-9
    t = ellipsoid.shape
    p, found, normal = np.r_[bias, np.diag(t), t[0, 1], t[0, 2], t[1, 2]], np.empty(30), np.empty((9, 10))
    ellipsoids.accumulate(exact, p, np.inf, np.ones(30, dtype=bool), found, normal)
    np.testing.assert_allclose(
        np.tril(normal[:, :9]), np.tril(rows.T @ rows), rtol=1e-9, atol=1e-9 * np.abs(normal).max()
    )


@slow_as_python
@pytest.mark.parametrize(("count", "noise"), [(18, 0.2), (18, 0.02), (300, 0.2)])
def test_the_covariance_holds_what_it_says(count, noise):
    """Errors over their standard deviations have a second moment of about 1: χ² of some 9 · 40 numbers has 7 % of sd.

    Of 18 samples with 9 parameters, the standard deviation itself is known to a third; t of 9 degrees has 9/7.
    """
    rng, squares = np.random.default_rng(6), []
    for _ in range(40):
        response, bias = soft_iron(rng), 6.0 * rng.normal(size=3)
        m = capture(rng, count, response, bias, noise, 0.0)
        fit = ellipsoids.fit_norm(m, ellipsoids.Shape.ELLIPSOID, ellipsoids.fit_quadric(m))
        true = np.linalg.inv(response) / STRENGTH
        found = np.r_[fit.ellipsoid.centre - bias, np.diag(fit.ellipsoid.shape - true)]
        squares.append(found**2 / np.diag(fit.covariance)[:6])
    assert 0.7 < np.mean(squares) / (9.0 / 7.0 if count == 18 else 1.0) < 1.35


@pytest.mark.parametrize(("count", "wrong"), [(18, 1), (1000, 50)])
def test_outliers_are_set_aside_and_nothing_else(count, wrong):
    """5 % of 100 mG, noise.md 5.2: they are some 40 sd; of normal errors one in a thousand captures loses one."""
    rng = np.random.default_rng(7)
    response, bias = soft_iron(rng), np.array([6.0, -7.0, 3.0])
    m = capture(rng, count, response, bias)
    radial = (m[:wrong] - bias) / np.linalg.norm(m[:wrong] - bias, axis=1, keepdims=True)
    m[:wrong] += 10.0 * radial
    fit = ellipsoids.fit_norm(m, ellipsoids.Shape.ELLIPSOID, ellipsoids.fit_quadric(m))
    assert not fit.used[:wrong].any() and fit.used[wrong:].all()
    assert np.abs(fit.ellipsoid.centre - bias).max() < 4.0 * np.sqrt(np.diag(fit.covariance)[:3].max())


def test_false_alarms_are_as_rare_as_said():
    """1e-3 per capture: of 150 captures, 2 with a false outlier have a probability of 1 %."""
    rng, alarms = np.random.default_rng(8), 0
    for _ in range(150):
        m = capture(rng, 18, np.eye(3), np.zeros(3), step=0.0)
        alarms += not ellipsoids.fit_norm(m, ellipsoids.Shape.ELLIPSOID, ellipsoids.fit_quadric(m)).used.all()
    assert alarms < 2


@slow_as_python
def test_small_tilt_does_not_run_to_infinity():
    """noise.md 5.2: with tilt up to 25° the plain norm fails in 82 % of captures, orthogonal distance in none."""
    rng = np.random.default_rng(9)
    for _ in range(10):
        response, bias = soft_iron(rng), 6.0 * rng.normal(size=3)
        m = capture(rng, 1000, response, bias, tilt=np.radians(25.0))
        fit = ellipsoids.fit_norm(m, ellipsoids.Shape.ELLIPSOID, ellipsoids.fit_quadric(m))
        assert np.abs(fit.ellipsoid.centre - bias).max() < 5.0 * np.sqrt(np.diag(fit.covariance)[:3].max())


def line(seed, count=20, noise=1e-3):
    rng = np.random.default_rng(seed)
    rows = np.column_stack((np.ones(count), np.linspace(-1.0, 1.0, count)))
    return rows, rows @ [0.3, 2.0] + noise * rng.standard_normal(count)


def left_of(rows, values):
    return values - rows @ np.linalg.lstsq(rows, values, rcond=None)[0]


@pytest.mark.parametrize("planted", [(4,), (0, 1), (0, 19), (7, 8), (17, 18, 19), (0, 10, 19)])
def test_the_group_is_the_one_without_which_the_rest_fits_best(planted):
    """[Cook1982]: the same sign at one end: together they turn the line, and none stands out by itself."""
    rows, values = line(1)
    values[list(planted)] += 0.05
    found = ellipsoids.outlying(rows, left_of(rows, values), false_alarm=1e-3, rounding=1e-13)
    assert found.tolist() == list(planted)

    def cost(group):
        return np.sum(left_of(np.delete(rows, group, axis=0), np.delete(values, group)) ** 2)

    assert min(combinations(range(20), len(planted)), key=cost) == planted


def test_normal_errors_lose_samples_as_rarely_as_promised():
    """At most 3 %: 200 draws give 6 ± 2.4, and no more than that plus three of these."""
    alarms = 0
    for seed in range(200):
        rows, values = line(seed, count=12)
        alarms += ellipsoids.outlying(rows, left_of(rows, values), false_alarm=0.03, rounding=1e-13).size > 0
    assert alarms <= 13


def test_rounding_and_what_is_too_few_or_alone_knows_a_parameter_stay():
    rows, values = line(0, noise=0.0)
    assert ellipsoids.outlying(rows, left_of(rows, values), false_alarm=1e-3, rounding=1e-13).size == 0
    rows, values = line(0, count=4)
    assert (
        ellipsoids.outlying(rows, left_of(rows, values + [0.0, 1.0, 0.0, 0.0]), false_alarm=1.0, rounding=1e-13).size
        == 0
    )
    rows, values = line(0)
    alone = np.column_stack((rows, np.eye(20)[3]))
    values[3] += 1.0
    assert ellipsoids.outlying(alone, left_of(alone, values), false_alarm=1e-3, rounding=1e-13).size == 0
