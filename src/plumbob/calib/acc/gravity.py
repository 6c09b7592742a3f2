"""Gravity at a place: the normal gravity of the Earth's reference ellipsoid, by latitude and height."""

import math

from plumbob.constants import EARTH_RATE, WGS84_A, WGS84_F, WGS84_GM, WGS84_GRAVITY_EQUATOR, WGS84_GRAVITY_POLE
from plumbob.errors import ParameterError
from plumbob.units import to_deg

HIGHEST = 20_000.0
"""Height up to which the series holds to a hundredth of the anomalies, m; and as far down."""


def normal_gravity(latitude: float, height: float = 0.0) -> float:
    """Gravity of the WGS 84 ellipsoid, m/s²: the closed form of Somigliana, and a series for the height [WGS84].

    What mountains and dense rock add is left out: some 0.0003 m/s² (0.03 mg) as a rule, 0.003 m/s² at most.

    Parameters
    ----------
    latitude : float
        Geodetic latitude, rad.
    height : float
        Height above the ellipsoid, m; above the sea does, for the geoid's 100 m are 0.0003 m/s².

    Raises
    ------
    ParameterError
        If there is no such latitude, or the height is beyond 20 km.
    """
    if not abs(latitude) <= math.pi / 2.0:
        raise ParameterError(f"a latitude is from −90° to 90°, but it is {to_deg(latitude):g}°.")
    if not abs(height) <= HIGHEST:
        raise ParameterError(f"the height must be within ±{HIGHEST:g} m of the ellipsoid, but it is {height:g} m.")
    polar = WGS84_A * (1.0 - WGS84_F)
    sin2 = math.sin(latitude) ** 2
    k = polar * WGS84_GRAVITY_POLE / (WGS84_A * WGS84_GRAVITY_EQUATOR) - 1.0
    eccentricity2 = WGS84_F * (2.0 - WGS84_F)
    ground = WGS84_GRAVITY_EQUATOR * (1.0 + k * sin2) / math.sqrt(1.0 - eccentricity2 * sin2)  # [WGS84] (4-1)
    m = EARTH_RATE**2 * WGS84_A**2 * polar / WGS84_GM
    slope = 1.0 + WGS84_F + m - 2.0 * WGS84_F * sin2
    return ground * (1.0 - 2.0 * slope * height / WGS84_A + 3.0 * (height / WGS84_A) ** 2)  # [WGS84] (4-3)
