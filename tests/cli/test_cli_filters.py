"""plumbob filters as a user meets it."""

import json
import math

import pytest

from plumbob.cli.main import main
from plumbob.filters import estimator_names, load


def run(capsys, *words):
    """Exit code, standard output and standard error."""
    code = main(["filters", *words])
    return code, *capsys.readouterr()


def parameter(listed, owner, name):
    rows = listed["every_filter"] if owner is None else listed["filters"][owner]["parameters"]
    return next(row for row in rows if row["name"] == name)


@pytest.fixture
def listed(capsys):
    return json.loads(run(capsys, "--json")[1])


def test_every_filter_says_what_it_claims_and_takes(listed):
    assert tuple(listed["filters"]) == estimator_names()
    for name, entry in listed["filters"].items():
        assert set(entry) == {"summary", "needs", "references", "covariance", "noise_card", "parameters"}
        assert entry["covariance"] == hasattr(load(name), "COVARIANCE")
        assert entry["noise_card"] == hasattr(load(name), "from_noise")
        assert entry["summary"]
        assert entry["references"]
    assert listed["filters"]["ekf7"]["covariance"]
    assert not listed["filters"]["mahony"]["covariance"]


def test_a_parameter_has_unit_default_range_and_meaning(listed):
    """Ranges are those of the declarations: kp 0 to 100 1/s, declination ±180°, max_gap from 0 s on."""
    keys = {"name", "unit", "default", "default_text", "low", "high", "range_text", "meaning"}
    rows = [row for entry in listed["filters"].values() for row in entry["parameters"]] + listed["every_filter"]
    for row in rows:
        assert set(row) == keys
        assert row["meaning"]
    assert parameter(listed, "mahony", "kp")["range_text"] == "0 to 100 1/s"
    assert (parameter(listed, "mahony", "kp")["low"], parameter(listed, "mahony", "kp")["high"]) == (0.0, 100.0)
    assert parameter(listed, "mahony", "gate")["range_text"] == "0 to 1000 m/s2, or off"
    assert parameter(listed, "mahony", "quick_start")["range_text"] == "on or off"
    declination = parameter(listed, None, "declination")
    assert declination["range_text"] == "-180 to 180 deg, or off"
    gap = parameter(listed, None, "max_gap")
    assert (gap["range_text"], gap["low"], gap["high"]) == ("0 s or more", 0.0, None)


def test_every_default_lies_in_its_range(listed):
    for entry in listed["filters"].values():
        for row in entry["parameters"]:
            if isinstance(row["default"], float):
                assert (row["low"] or -math.inf) <= row["default"] <= (row["high"] or math.inf), row["name"]


def test_text_has_the_parameters_of_a_filter_and_of_no_other(capsys):
    code, out, _ = run(capsys, "mekf")
    assert code == 0
    assert all(f"    {name} " in out for name in load("mekf").Params._fields)
    assert [name for name in estimator_names() if f"{name}: " in out] == ["mekf"]
    described = json.loads(run(capsys, "mekf", "--json")[1])
    assert (list(described["filters"]), len(described["filters"]["mekf"]["description"]) > 500) == (["mekf"], True)
    assert {row["name"] for row in described["every_filter"]} == {"declination", "max_gap", "mag"}
    assert run(capsys)[1].count("claims a covariance") == sum(hasattr(load(n), "COVARIANCE") for n in estimator_names())
