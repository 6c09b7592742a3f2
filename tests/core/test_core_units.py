"""Every unit against its definition, and every way to name it wrongly."""

import math
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob.core import constants, units
from plumbob.core.errors import UnitError
from plumbob.core.units import UNITS, Quantity, from_si, to_si, unit

EPS = np.finfo(float).eps
TURN = 2 * math.pi
DEG, G = TURN / 360, 9.80665
# The SI brochure (9th ed., 2019): prefixes table 7; degree = π/180 rad, minute, hour table 8. Standard gravity: 3rd
# CGPM (1901), 9.80665 m/s². Gauss: 10⁻⁴ T (ISO 80000-6, CGS units). 0 °C = 273.15 K (SI brochure 2.3.1). Root power
# spectral densities: 1 Hz = 1/s, so 1 rad/s/√Hz = 1 rad/√s and 1 °/√h = 1°/√(3600 s) = (1/60) °/s/√Hz.
FACTORS = [
    (1.0, "rad/s, rad/s2, rad/s3, m/s2, uT, degC, K, rad, s, m, m/s, Hz, 1/s, 1/s2, 1, V, m/s3, uT/s, uT s"),
    (1.0, "rad/s/rtHz, rad/s2/rtHz, m/s2/rtHz, m/s3/rtHz, uT/rtHz, uT/s/rtHz, 1/rtHz, 1/s/rtHz, kgamma"),
    (1e-3, "mrad/s, mm/s2, nT, gamma, mdegC, ms, mm, mm/s, mV, nT/rtHz, nT/s/rtHz, nT/s, nT s"),
    (1e-2, "cm/s2, Gal, cm, %"),
    (1e-5, "mGal"),
    (1e-6, "us, urad/s"),
    (1e-9, "ns"),
    (1e3, "mT"),
    (1e6, "T"),
    # 1 γ = 10⁻⁹ T, 1 Gal = 0.01 m/s², 1 Oe = 1000/(4π) A/m (NIST SP 811, B.8); in air µ₀ = 4π·10⁻⁷ T/(A/m) to 10⁻⁶
    (1e-4 * 1e6, "gauss, Oe"),
    (1e-4 * 1e6 * 1e-3, "mgauss, mOe"),
    (4 * math.pi * 1e-7 * 1e6, "A/m"),
    (50.0, "relative"),  # what stands for the field of the place, docs/file-formats.md
    (0.3048, "ft/s2"),  # international foot and inch (NIST SP 811, B.8)
    (0.0254, "in/s2"),
    (60.0, "min"),
    (24 * 3600.0, "day"),
    (3600.0, "h"),
    (DEG, "deg/s, deg/s2, deg/s3, deg, deg/s/rtHz, deg/s2/rtHz"),
    (DEG / 1000, "mdeg/s"),
    (DEG / 60, "deg/rth, deg/min"),
    (DEG / 3600, "deg/h, deg/h/s, arcsec, arcsec/s"),
    (DEG / 3600 / 60, "deg/h/rth"),
    (TURN, "rev/s"),
    (TURN / 60, "rpm"),
    (G, "g"),
    (G * 1e-3, "mg, mg/rtHz"),
    (G * 1e-6, "ug, ug/rtHz, ug/s/rtHz, ug/s"),
]
DEFINITIONS = {name: factor for factor, names in FACTORS for name in names.split(", ")}
NAMES = {
    "deg/s": "dps, °/s, °/sec, deg/sec, degrees/s, degree/s", "deg/h": "°/h, °/hr, deg/hr", "rpm": "r/min, rev/min",
    "m/s2": "m/s^2, m/s², m/s/s, m s^-2", "gauss": "Gs, Ga, Gauss", "Oe": "Oersted", "T": "tesla",
    "mgauss": "mGs, mGa, mGauss, milligauss", "deg": "°, degrees", "degC": "°C, ℃, deg C, Celsius, celsius",
    "1/s2": "1/s², 1/s^2", "mdeg/s": "mdps, m°/s", "rad/s": "rad/sec, rad s^-1", "uT": "uTesla, microtesla",
    "s": "sec, seconds", "ms": "msec, milliseconds", "us": "usec, microseconds",
}  # fmt: skip
ALIASES = {alias: unit for unit, names in NAMES.items() for alias in names.split(", ")}


def test_the_table_here_is_complete():
    assert set(DEFINITIONS) == set(UNITS)
    assert {name for name, u in UNITS.items() if u.offset} == {"K"}
    assert to_si(273.15, "K") == 0.0
    assert from_si(20.0, "K") == 293.15
    for quantity in Quantity:
        assert unit(quantity.value, quantity) == units.Unit(quantity, 1.0, 0.0)


@pytest.mark.parametrize("name", DEFINITIONS)
def test_factor_is_the_definition_there_and_back(name):
    assert abs(unit(name).factor - DEFINITIONS[name]) <= 2 * EPS * DEFINITIONS[name]
    values = np.array([-1e6, -1.0, 0.0, 1e-9, 1.0, 1e6])
    back = from_si(to_si(values, name), name)
    slack = 2 * EPS * np.abs(values) + (2 * EPS * 273.15 if name == "K" else 0)
    assert (np.abs(back - values) <= slack).all()


def test_aliases_and_letters_with_two_meanings():
    for alias, name in ALIASES.items():
        assert unit(alias) is unit(name) is UNITS[name]
    for name in ("uT", "\u00b5T", "\u03bcT", " uT "):
        assert unit(name) is UNITS["uT"]
    assert unit("µs") is UNITS["us"]
    assert unit("G", Quantity.FIELD) is UNITS["gauss"] and unit("mG", Quantity.FIELD) is UNITS["mgauss"]
    assert unit("C", Quantity.TEMPERATURE) is UNITS["degC"]


TWO = "'{}' for a magnetic field, '{}' for an acceler"
REFUSED = [
    *((name, None, r"is not a unit; .*known:") for name in ("MT", "mt", "UT", "Mg", "G ", "RAD", "Dps", "C")),
    *((name, None, f"'{name}' is not a unit") for name in ("", "parsec", "deg / s", "m//s", "None", "µgal")),
    ("DPS", Quantity.RATE, "if 'dps' was meant"),
    ("LSB", Quantity.RATE, "counts_per_unit counts"),
    *(("G", quantity, TWO.format("gauss", "g")) for quantity in (None, Quantity.ACCELERATION, Quantity.RATE)),
    *(("mG", quantity, TWO.format("mgauss", "mg")) for quantity in (None, Quantity.ACCELERATION, Quantity.RATE)),
    ("g", Quantity.RATE, r"'g' is not a unit of rate.*rad/s"),
    ("dps", Quantity.ACCELERATION, r"'dps' is not a unit of acceleration.*m/s2"),
    ("1/s", Quantity.FREQUENCY, "'1/s' is not a unit of frequency.*Hz"),
]


@pytest.mark.parametrize(("name", "quantity", "says"), REFUSED)
def test_what_is_no_unit_is_refused_with_what_may_be_meant(name, quantity, says):
    with pytest.raises(UnitError, match=says):
        unit(name, quantity)
    if quantity is None and "G" not in name:
        with pytest.raises(UnitError) as error:
            unit(name)
        assert all(known in str(error.value) for known in UNITS)


def test_shorthands():
    assert units.dps(180.0) == units.dps(np.float64(180)) == math.pi
    assert units.deg(90.0) == math.pi / 2
    assert units.g(1.0) == 9.80665
    assert units.gauss(0.5) == 50.0  # the Earth's field is about half a gauss, 50 µT
    assert units.to_deg(math.pi) == units.to_dps(math.pi) == 180.0
    assert from_si(9.80665, "g") == 1.0
    rate_dps = np.array([[1, 2, 3]])
    assert units.dps(rate_dps).dtype == np.float64
    assert np.array_equal(rate_dps, [[1, 2, 3]])


HABITS = (
    "RATE ANGULAR_ACCELERATION ANGULAR_JERK ACCELERATION FIELD ANGLE RATE_NOISE RATE_WALK ACCELERATION_NOISE "
    "ACCELERATION_WALK JERK FIELD_NOISE FIELD_WALK FIELD_RATE FIELD_TIME"
)


@pytest.mark.parametrize("quantity", Quantity)
def test_a_bare_number_needs_a_unit_where_it_could_mean_two_things(quantity):
    """Nought is nought in all of them, and where one unit is usual a number is in that."""
    assert quantity.ambiguous is (quantity.name in HABITS.split())
    for text in ("0", "-0.0", " 0e3 "):
        assert units.parse(text, quantity) == 0.0
    if quantity.ambiguous:
        for text in ("1", "-0.5", "1e-30"):
            with pytest.raises(UnitError, match=rf"needs a unit of {quantity.name.lower()} \("):
                units.parse(text, quantity)
    else:
        assert units.parse("-0.5", quantity) == -0.5
    assert units.parse(f"2.5 {quantity.value}", quantity) == 2.5


def test_constants_and_units_as_people_write_them():
    signs = {"deg/h/rth": "°/h/√h", "ug/s/rtHz": "µg/s/√Hz", "rad/s2/rtHz": "rad/s²/√Hz", "nT s": "nT s", "degC": "°C"}
    assert {name: units.written(name) for name in signs} == signs
    assert constants.G0 == 9.80665  # 3rd CGPM 1901, resolution 2
    assert constants.EARTH_RATE == 7.292115e-5  # NGA.STND.0036_1.0.0_WGS84 (2014), table 3.1
    assert constants.WGS84_A == 6378137.0  # the same
    assert Fraction("298.257223563") * Fraction(constants.WGS84_F) == pytest.approx(1, rel=2 * EPS)  # the same
    # One turn in a stellar day, 86164.0989 s (IERS, Useful Constants): the same number from elsewhere.
    assert pytest.approx(TURN / 86164.0989, rel=1e-7) == constants.EARTH_RATE


def test_no_other_file_holds_a_conversion_factor():
    """`units` is the only place for factors: no π/180, no 9.8 and no 57.3 elsewhere."""
    suspicious = re.compile(
        r"pi\s*/\s*180|180(\.0)?\s*/\s*(np\.|math\.)?pi|9\.8\d|57\.29|deg2rad|rad2deg|\b(np|math)\.(radians|degrees)"
    )
    root = Path(plumbob.__file__).parent
    for path in sorted(root.rglob("*.py")):
        if path.name in {"units.py", "constants.py"}:
            continue
        code = re.sub(r'""".*?"""|#.*', "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert not suspicious.search(code), f"{path}: {suspicious.search(code)}"
