"""Normal gravity against other formulas: the ellipsoid's constants, the series of GRS 80, Bruns' gradient."""

import math

import pytest

from plumbob.calibration.acc.poses import normal_gravity
from plumbob.core.constants import EARTH_RATE, WGS84_A, WGS84_F
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg

E2 = WGS84_F * (2.0 - WGS84_F)


def test_equator_and_poles_have_the_ellipsoids_constants():
    assert normal_gravity(0.0) == 9.7803253359
    assert normal_gravity(math.pi / 2.0) == pytest.approx(9.8321849379, rel=1e-15)
    assert normal_gravity(-math.pi / 2.0) == normal_gravity(math.pi / 2.0)


@pytest.mark.parametrize("latitude", [15.0, 45.0, 60.0])
def test_at_latitudes_in_between(latitude):
    """The 1980 formula of GRS 80 as a series, 9.780327 (1 + 0.0053024 sin²φ − 0.0000058 sin²2φ): good to 1e-6 m/s²,
    and GRS 80 and WGS 84 differ by 1.5e-6 m/s²."""
    sin2, sin22 = math.sin(deg(latitude)) ** 2, math.sin(2.0 * deg(latitude)) ** 2
    series = 9.780327 * (1.0 + 0.0053024 * sin2 - 0.0000058 * sin22)
    assert normal_gravity(deg(latitude)) == pytest.approx(series, abs=3e-6)


@pytest.mark.parametrize("latitude", [0.0, 30.0, 52.0, 90.0])
def test_the_gradient_with_height_is_that_of_bruns(latitude):
    """dγ/dh = −γ (1/M + 1/N) − 2 ω², with the ellipsoid's radii of curvature; the series leaves out terms in f²."""
    w = math.sqrt(1.0 - E2 * math.sin(deg(latitude)) ** 2)
    curvature = w**3 / (WGS84_A * (1.0 - E2)) + w / WGS84_A
    ground = normal_gravity(deg(latitude))
    slope = (normal_gravity(deg(latitude), 1.0) - normal_gravity(deg(latitude), -1.0)) / 2.0
    assert slope == pytest.approx(-ground * curvature - 2.0 * EARTH_RATE**2, rel=10.0 * WGS84_F**2)


@pytest.mark.parametrize(("latitude", "height"), [(91.0, 0.0), (float("nan"), 0.0), (0.0, 1e5), (0.0, float("nan"))])
def test_what_is_no_place_is_refused(latitude, height):
    with pytest.raises(ParameterError):
        normal_gravity(deg(latitude), height)
