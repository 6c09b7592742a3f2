"""Every unit against its definition, and every way to name it wrongly."""

import math
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob.core import constants, units
from plumbob.core.errors import PlumbobError, UnitError
from plumbob.core.units import UNITS, Quantity, from_si, to_si, unit

EPS = np.finfo(float).eps
TURN = 2 * math.pi
# The SI brochure (9th ed., 2019): prefixes table 7; degree = π/180 rad, minute, hour table 8. Standard gravity: 3rd
# CGPM (1901), 9.80665 m/s². Gauss: 10⁻⁴ T (ISO 80000-6, CGS units). 0 °C = 273.15 K (SI brochure 2.3.1).
DEFINITIONS = {
    "rad/s": 1.0,
    "deg/s": TURN / 360,
    "mrad/s": 1e-3,
    "mdeg/s": TURN / 360 / 1000,
    "deg/h": TURN / 360 / 3600,
    "rpm": TURN / 60,
    "rad/s2": 1.0,
    "deg/s2": TURN / 360,
    "deg/h/s": TURN / 360 / 3600,
    "rad/s3": 1.0,
    "deg/s3": TURN / 360,
    "m/s2": 1.0,
    "cm/s2": 1e-2,
    "g": 9.80665,
    "mg": 9.80665e-3,
    "ug": 9.80665e-6,
    "uT": 1.0,
    "nT": 1e-3,
    "mT": 1e3,
    "T": 1e6,
    "gauss": 1e-4 * 1e6,
    "mgauss": 1e-4 * 1e6 * 1e-3,
    "relative": 50.0,  # what stands for the field of the place, docs/file-formats.md
    "degC": 1.0,
    "mdegC": 1e-3,
    "K": 1.0,
    "rad": 1.0,
    "deg": TURN / 360,
    "arcsec": TURN / 360 / 3600,
    "s": 1.0,
    "ms": 1e-3,
    "min": 60.0,
    "h": 3600.0,
    "us": 1e-6,
    "ns": 1e-9,
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "m/s": 1.0,
    "mm/s": 1e-3,
    "Hz": 1.0,
    "1/s": 1.0,
    "1/s2": 1.0,
    "1": 1.0,
    "%": 1e-2,
    "V": 1.0,
    "mV": 1e-3,
    # root power spectral densities: 1 Hz = 1/s, so 1 rad/s/√Hz = 1 rad/√s and 1 °/√h = 1°/√(3600 s) = (1/60) °/s/√Hz
    "rad/s/rtHz": 1.0,
    "deg/s/rtHz": TURN / 360,
    "deg/rth": TURN / 360 / 60,
    "rad/s2/rtHz": 1.0,
    "deg/s2/rtHz": TURN / 360,
    "deg/h/rth": TURN / 360 / 3600 / 60,
    "m/s2/rtHz": 1.0,
    "mg/rtHz": 9.80665e-3,
    "ug/rtHz": 9.80665e-6,
    "m/s3/rtHz": 1.0,
    "ug/s/rtHz": 9.80665e-6,
    "m/s3": 1.0,
    "ug/s": 9.80665e-6,
    "uT/rtHz": 1.0,
    "nT/rtHz": 1e-3,
    "uT/s/rtHz": 1.0,
    "nT/s/rtHz": 1e-3,
    "uT/s": 1.0,
    "nT/s": 1e-3,
    "uT s": 1.0,
    "nT s": 1e-3,
    "1/rtHz": 1.0,
    "1/s/rtHz": 1.0,
}
ALIASES = {
    "dps": "deg/s", "°/s": "deg/s", "°/h": "deg/h", "r/min": "rpm", "m/s^2": "m/s2", "m/s²": "m/s2", "Gs": "gauss",
    "Ga": "gauss", "mGs": "mgauss", "mGa": "mgauss", "°": "deg", "°C": "degC", "1/s²": "1/s2", "1/s^2": "1/s2",
    "°/sec": "deg/s", "deg/sec": "deg/s", "degrees/s": "deg/s", "degree/s": "deg/s", "mdps": "mdeg/s",
    "m°/s": "mdeg/s", "rad/sec": "rad/s", "rad s^-1": "rad/s", "°/hr": "deg/h", "deg/hr": "deg/h", "m/s/s": "m/s2",
    "m s^-2": "m/s2", "Gauss": "gauss", "mGauss": "mgauss", "milligauss": "mgauss", "uTesla": "uT",
    "microtesla": "uT", "degrees": "deg", "℃": "degC", "deg C": "degC", "Celsius": "degC", "celsius": "degC",
    "sec": "s", "seconds": "s", "msec": "ms", "milliseconds": "ms", "usec": "us", "microseconds": "us",
}  # fmt: skip


def test_the_table_here_is_complete():
    assert set(DEFINITIONS) == set(UNITS)
    assert set(ALIASES) == set(units._ALIASES)


@pytest.mark.parametrize("name", DEFINITIONS)
def test_factor_is_the_definition(name):
    assert abs(unit(name).factor - DEFINITIONS[name]) <= 2 * EPS * DEFINITIONS[name]


@pytest.mark.parametrize("quantity", Quantity)
def test_every_quantity_has_its_own_unit_with_factor_one(quantity):
    assert unit(quantity.value, quantity) == units.Unit(quantity, 1.0, 0.0)


def test_only_kelvin_has_an_offset():
    assert {name for name, u in UNITS.items() if u.offset} == {"K"}
    assert to_si(273.15, "K") == 0.0
    assert from_si(20.0, "K") == 293.15


@pytest.mark.parametrize("name", DEFINITIONS)
def test_there_and_back(name):
    values = np.array([-1e6, -1.0, 0.0, 1e-9, 1.0, 1e6])
    back = from_si(to_si(values, name), name)
    slack = 2 * EPS * np.abs(values) + (2 * EPS * 273.15 if name == "K" else 0)
    assert (np.abs(back - values) <= slack).all()


@pytest.mark.parametrize(("alias", "name"), ALIASES.items())
def test_aliases(alias, name):
    assert unit(alias) is unit(name) is UNITS[name]


@pytest.mark.parametrize("name", ["uT", "\u00b5T", "\u03bcT", " uT "])
def test_micro_in_all_its_signs(name):
    assert unit(name) is UNITS["uT"]


def test_micro_is_not_milli_or_mega():
    assert unit("µs") is UNITS["us"]
    for name in ("MT", "mt", "UT", "Mg", "G", "RAD", "Dps"):
        with pytest.raises(UnitError, match=r"is not a unit; .*known are"):
            unit(name)


def test_letters_with_two_meanings_need_to_know_what_is_measured():
    assert unit("G", Quantity.FIELD) is UNITS["gauss"]
    assert unit("mG", Quantity.FIELD) is UNITS["mgauss"]
    assert unit("C", Quantity.TEMPERATURE) is UNITS["degC"]
    for name, field, acceleration in (("G", "gauss", "g"), ("mG", "mgauss", "mg")):
        for quantity in (None, Quantity.ACCELERATION, Quantity.RATE):
            with pytest.raises(UnitError, match=f"'{field}' for a magnetic field, '{acceleration}' for an acceler"):
                unit(name, quantity)
    with pytest.raises(UnitError, match="'C' is not a unit;"):
        unit("C")


@pytest.mark.parametrize(("name", "advice"), [("DPS", "if 'dps' was meant"), ("LSB", "counts_per_unit counts")])
def test_an_unknown_unit_says_what_may_be_meant(name, advice):
    with pytest.raises(UnitError, match=advice):
        unit(name, Quantity.RATE)


@pytest.mark.parametrize("name", ["", "parsec", "deg / s", "m//s", "None", "µgal"])
def test_unknown_names_are_refused_with_the_known_ones(name):
    with pytest.raises(UnitError) as error:
        unit(name)
    assert f"'{name}' is not a unit" in str(error.value)
    assert all(known in str(error.value) for known in UNITS)


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("g", Quantity.RATE),
        ("dps", Quantity.ACCELERATION),
        ("deg", Quantity.RATE),
        ("1/s", Quantity.FREQUENCY),
    ],
)
def test_a_unit_of_something_else_is_refused(name, quantity):
    with pytest.raises(UnitError) as error:
        unit(name, quantity)
    assert f"'{name}' is not a unit of {quantity.name.lower()}" in str(error.value)
    assert quantity.value in str(error.value)
    assert isinstance(error.value, PlumbobError | ValueError)


def test_shorthands():
    assert units.dps(180.0) == math.pi
    assert units.deg(90.0) == math.pi / 2
    assert units.g(1.0) == 9.80665
    assert units.gauss(0.5) == 50.0  # the Earth's field is about half a gauss, 50 µT
    assert units.to_deg(math.pi) == units.to_dps(math.pi) == 180.0
    assert units.from_si(9.80665, "g") == 1.0


def test_arrays_are_converted_and_left_alone():
    rate_dps = np.array([[1, 2, 3]])
    rate = units.dps(rate_dps)
    assert rate.dtype == np.float64
    assert np.array_equal(rate_dps, [[1, 2, 3]])
    assert units.dps(np.float64(180)) == math.pi


def test_ambiguous_quantities_are_those_with_two_habits():
    habits = {
        "RATE",
        "ANGULAR_ACCELERATION",
        "ANGULAR_JERK",
        "ACCELERATION",
        "FIELD",
        "ANGLE",
        "RATE_NOISE",
        "RATE_WALK",
        "ACCELERATION_NOISE",
        "ACCELERATION_WALK",
        "JERK",
        "FIELD_NOISE",
        "FIELD_WALK",
        "FIELD_RATE",
        "FIELD_TIME",
    }
    assert {q.name for q in Quantity if q.ambiguous} == habits


@pytest.mark.parametrize("quantity", Quantity)
def test_a_bare_number_needs_a_unit_where_it_could_mean_two_things(quantity):
    """Nought is nought in all of them, and where one unit is usual a number is in that."""
    for text in ("0", "-0.0", " 0e3 "):
        assert units.parse(text, quantity) == 0.0
    if quantity.ambiguous:
        for text in ("1", "-0.5", "1e-30"):
            with pytest.raises(UnitError, match=rf"needs a unit of {quantity.name.lower()} \("):
                units.parse(text, quantity)
    else:
        assert units.parse("-0.5", quantity) == -0.5
    assert units.parse(f"2.5 {quantity.value}", quantity) == 2.5


@pytest.mark.parametrize(
    ("name", "sign"),
    [
        ("deg/h/rth", "°/h/√h"),
        ("ug/s/rtHz", "µg/s/√Hz"),
        ("rad/s2/rtHz", "rad/s²/√Hz"),
        ("nT s", "nT s"),
        ("degC", "°C"),
    ],
)
def test_units_as_people_write_them(name, sign):
    assert units.written(name) == sign


def test_constants():
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
