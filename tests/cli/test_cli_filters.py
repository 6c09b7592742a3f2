"""plumbob list filters as a user meets it."""

import math

import pytest

from plumbob.filters import estimator_names, load
from tests.helpers.commandline import answer, typed


@pytest.fixture(scope="module")
def listed():
    return answer("list filters")


def test_every_filter_says_what_it_claims_and_takes_and_its_parameters(listed):
    assert tuple(listed["filters"]) == estimator_names()
    for name, entry in listed["filters"].items():
        assert entry["covariance"] == hasattr(load(name), "COVARIANCE")
        assert entry["noise_card"] == hasattr(load(name), "from_noise")
        assert entry["summary"] and entry["references"]
    assert [listed["filters"][name]["covariance"] for name in ("ekf7", "mahony")] == [True, False]
    claims = sum(entry["covariance"] for entry in listed["filters"].values())
    assert typed("list filters").stdout.count("claims a covariance") == claims
    out = typed("list filters mekf").stdout
    assert all(f"    {name} " in out for name in load("mekf").Params._fields)
    assert [name for name in estimator_names() if f"{name}: " in out] == ["mekf"]
    described = answer("list filters mekf")
    assert (list(described["filters"]), len(described["filters"]["mekf"]["description"]) > 500) == (["mekf"], True)
    assert {row["name"] for row in described["every_filter"]} == {"declination", "max_gap", "mag"}


def test_a_parameter_has_unit_default_range_and_meaning(listed):
    """Ranges are those of the declarations: kp 0 to 100 1/s, declination ±180°, max_gap from 0 s on."""
    rows = [row for entry in listed["filters"].values() for row in entry["parameters"]] + listed["every_filter"]
    for row in rows:
        assert row["meaning"]
        if isinstance(row["default"], float):
            assert (row["low"] or -math.inf) <= row["default"] <= (row["high"] or math.inf), row["name"]
    shared = {row["name"]: row for row in listed["every_filter"]}
    mahony = {row["name"]: row for row in listed["filters"]["mahony"]["parameters"]} | shared
    for name, text, low, high in (
        ("kp", "0 to 100 1/s", 0.0, 100.0),
        ("gate", "0 to 1000 m/s2, or off", 0.0, 1000.0),
        ("quick_start", "on or off", None, None),
        ("declination", "-180 to 180 deg, or off", mahony["declination"]["low"], mahony["declination"]["high"]),
        ("max_gap", "0 s or more", 0.0, None),
    ):
        assert [mahony[name][key] for key in ("range_text", "low", "high")] == [text, low, high]
    assert [mahony["kp"][key] for key in ("unit", "default")] == ["1/s", 0.5]
