"""The dictionary: strict JSON, complete, and both units of every number."""

import json
import math

import numpy as np

from plumbob.noise.report import numbers


def test_it_is_strict_json(analyses, bare):
    found = numbers([*analyses, bare])
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert list(found) == [a.name for a in [*analyses, bare]]


def test_numbers_stand_under_their_units(analyses):
    n = numbers(analyses)["gyr x"]["coefficients"]["N"]
    assert n["name"] == "white noise"
    # 0.3 °/√h is 0.3/60 °/s/√Hz, that is 8.7266e-5 rad/s/√Hz
    assert math.isclose(n["value"]["rad/s/rtHz"], math.radians(0.3 / 60.0), rel_tol=1e-12)
    assert math.isclose(n["value"]["deg/rth"], 0.3, rel_tol=1e-12)
    assert math.isclose(n["hi"]["deg/rth"], 0.3 * 1.004, rel_tol=1e-12)
    q = numbers(analyses)["acc z"]["coefficients"]["Q"]
    assert set(q["upper"]) == {"m/s", "mm/s"}
    assert math.isclose(q["upper"]["m/s"], 1e-3 * q["upper"]["mm/s"], rel_tol=1e-12)
    assert (q["observable"], q["hours"]) == (False, None)


def test_everything_is_there(analyses):
    a, found = analyses[0], numbers(analyses)["gyr x"]
    assert (found["samples"], found["duration_s"], found["dt_s"]) == (20_000, 200.0, 0.01)
    assert list(found["methods"]) == ["lines", "least squares", "likelihood"]
    assert found["methods"]["lines"]["N"]["lo"] == {"rad/s/rtHz": None, "deg/rth": None}  # the method gives none
    assert math.isclose(found["sinusoids"][0]["amplitude"]["deg/h"], 9.0)
    assert found["sinusoids"][0]["frequency_hz"] == 12.5
    assert math.isclose(found["gauss_markov"]["time"]["value"]["s"], 90.0)
    assert found["mask"] == {"n": 8, "frequency_hz": 6.25, "reason": "the device filters its output"}
    assert found["candidates"][0] == {"terms": "N B K", "bic": -1234.5, "chosen": True}
    assert found["notes"] == list(a.notes)
    curve = found["curve"]
    assert np.array_equal(curve["dev"]["rad/s"], a.curve.dev)
    assert np.allclose(curve["hi"]["deg/h"], np.degrees(a.curve.hi) * 3600.0, rtol=1e-12, atol=0.0)
    assert np.array_equal(curve["tau_s"], a.curve.tau)
    assert curve["alpha"] == a.curve.alpha.tolist()
    assert np.array_equal(curve["ieee952_relative_error"], a.curve.ieee)
    assert found["minimum"]["dev"]["rad/s"] in a.curve.dev


def test_bare_numbers_have_one_unit_where_both_are_the_same(bare):
    assert numbers([bare])["column"]["mean"] == {"1": bare.mean}
