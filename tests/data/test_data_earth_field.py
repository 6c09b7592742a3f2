"""The Earth's field: the World Magnetic Model's published values, and its limits."""

import sys

import numpy as np
import pytest

from plumbob.core.errors import MissingExtraError, ParameterError
from plumbob.data import ImuData
from plumbob.data.earth_field import EarthField, earth_field_at, parse_place, unlike

# Test values of WMM2025, NOAA, WMM2025_TEST_VALUES.txt: day, height km, latitude, longitude, F nT, I °, D °.
# 2027.5 is the middle of 2 July, of which the day's start is half a day off: below 0.01 % of the yearly change.
PUBLISHED = [
    ("2025-01-01", 0, 80, 0, 55178.5, 83.21, 1.28),
    ("2025-01-01", 0, 0, 120, 41064.3, -14.93, -0.16),
    ("2025-01-01", 0, -80, -120, 54698.2, -72.00, 68.78),
    ("2025-01-01", 100, 80, 0, 52964.9, 83.26, 0.85),
    ("2025-01-01", 100, 0, 120, 39032.1, -15.08, -0.15),
    ("2025-01-01", 100, -80, -120, 52035.0, -72.19, 68.21),
    ("2027-07-02", 0, 80, 0, 55253.9, 83.24, 2.59),
    ("2027-07-02", 0, 0, 120, 41036.9, -14.65, -0.24),
    ("2027-07-02", 100, -80, -120, 51825.7, -72.10, 67.93),
    # MATLAB's example of wrldmagm: 1000 m over Natick
    ("2028-07-04", 1, 42.283, -71.35, 50940.0, 65.9899, -13.6891),
]


@pytest.fixture
def _model():
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")


@pytest.mark.usefixtures("_model")
@pytest.mark.parametrize(("day", "height", "latitude", "longitude", "strength", "dip", "declination"), PUBLISHED)
def test_the_published_values(day, height, latitude, longitude, strength, dip, declination):
    found = earth_field_at(np.radians(latitude), np.radians(longitude), 1e3 * height, day)
    assert found.strength == pytest.approx(strength / 1e3, abs=0.6e-3)  # half the last digit of nT in MATLAB's example
    assert np.degrees([found.dip, found.declination]) == pytest.approx([dip, declination], abs=0.0055)
    assert "2025" in found.model


@pytest.mark.usefixtures("_model")
def test_the_model_is_that_of_the_day():
    assert "2020" in earth_field_at(0.8, 0.2, 0.0, "2023-05-01").model
    for day, says in (
        ("2009-12-31", "no World Magnetic Model is installed for 2009"),
        ("2030-01-01", "for 2030"),
        ("yesterday", "YYYY-MM-DD"),
    ):
        with pytest.raises(ParameterError, match=says):
            earth_field_at(0.8, 0.2, 0.0, day)


def test_a_place_is_read_in_degrees_and_metres_and_without_the_library_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygeomag", None)
    with pytest.raises(MissingExtraError):
        earth_field_at(0.8, 0.2, 0.0, "2026-01-01")
    assert parse_place("48.1, 11.6") == pytest.approx((np.radians(48.1), np.radians(11.6), 0.0))
    assert parse_place("-33,151,60") == pytest.approx((np.radians(-33.0), np.radians(151.0), 60.0))


@pytest.mark.parametrize("text", ["48.1", "48.1 11.6", "north,east", "91,0", "0,181", "0,0,1e9", "1,2,3,4", "nan,0"])
def test_what_is_no_place_is_refused(text):
    with pytest.raises(ParameterError):
        parse_place(text)


@pytest.mark.parametrize(("acc", "mag", "doubted"), [(1, 1.4, False), (1, -1, True), (-1, 1, True), (1, 2, True)])
def test_a_field_of_another_place_or_sign_is_doubted_and_iron_is_not(acc, mag, doubted):
    imu = ImuData(t=[0.0], acc=[[0.0, 0.0, 9.81 * acc]], mag=[[0.0, 20.0 * mag, -44.0 * mag]])
    assert bool(unlike(imu, EarthField(48.3, np.arctan2(44.0, 20.0), 0.0, ""))) == doubted
