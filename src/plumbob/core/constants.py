"""Physical constants: value, unit and source each. Tuning constants live with the parameters that use them."""

from typing import Final

G0: Final = 9.80665  # standard acceleration of free fall, m/s² (3rd CGPM 1901; ISO 80000-3)

ABSOLUTE_ZERO_C: Final = -273.15  # nothing is colder, °C (9th SI Brochure, 2.3.1)

NOMINAL_FIELD: Final = 50.0  # µT, for the Earth's field where it is unknown: 22 to 67 (World Magnetic Model 2025)

EARTH_RATE: Final = 7.292115e-5  # rotation rate of the Earth, rad/s (WGS 84, NGA.STND.0036)

IMPOSSIBLE_RATE: Final = 100.0
"""No MEMS gyroscope measures beyond this, rad/s (5730 °/s; the widest on sale end at 4000 to 5000 °/s)."""

IMPOSSIBLE_ACCELERATION: Final = 2e4  # m/s² (about 2000 g): beyond, there are shock sensors alone

IMPOSSIBLE_FIELD: Final = 1e5  # no magnetometer of a compass measures beyond this, µT (0.1 T)

WGS84_A: Final = 6378137.0  # semi-major axis of the reference ellipsoid, m (WGS 84, NGA.STND.0036)

WGS84_F: Final = 1.0 / 298.257223563  # flattening of the reference ellipsoid (WGS 84, NGA.STND.0036)

WGS84_GM: Final = 3.986004418e14  # gravitational constant times mass of the Earth, m³/s² (WGS 84, NGA.STND.0036)

WGS84_GRAVITY_EQUATOR: Final = 9.7803253359  # normal gravity at the equator, m/s² (WGS 84, NGA.STND.0036)

WGS84_GRAVITY_POLE: Final = 9.8321849379  # normal gravity at the poles, m/s² (WGS 84, NGA.STND.0036)
