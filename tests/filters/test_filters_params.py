"""Parameters: units in text, SI in Python, and no typo that passes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob import Filter, Frame
from plumbob.constants import G0
from plumbob.errors import FrameError, ParameterError, ShapeError
from plumbob.filters import CommonParams, filter_names, load
from plumbob.params import describe


def mahony(**params):
    return Filter("mahony", frame=Frame.ENU, params=params)


@pytest.mark.parametrize(
    ("text", "si"),
    [
        ("0.08g", 0.08 * G0),
        ("0.08 g", 0.08 * G0),
        ("80 mg", 0.08 * G0),
        ("0.5m/s2", 0.5),
        ("0.5 m/s²", 0.5),
        ("1e-1 m/s2", 0.1),
    ],
)
def test_text_is_converted_with_its_unit(text, si):
    assert mahony(gate=text).params.gate == pytest.approx(si, rel=1e-15)


@pytest.mark.parametrize("word", ["off", "OFF", "none"])
def test_the_gate_can_be_off(word):
    assert mahony(gate=word).params.gate is None


@pytest.mark.parametrize(
    ("params", "words"),
    [
        ({"gate": "0.08"}, "gate.*needs a unit.*m/s2, g, mg"),
        ({"gate": "0.08 deg"}, "not a unit of acceleration"),
        ({"gate": "much"}, "not a number"),
        ({"kp": "-1"}, r"kp must be 0 to 100 1/s, but it is -1"),
        ({"kp": "nan"}, "kp"),
        ({"kp": float("nan")}, "kp must be 0 to"),
        ({"kp": None}, "kp must be a number"),
        ({"kp": True}, "kp must be a number"),
        (
            {"freqency": 100.0},
            "no parameter 'freqency'; known are kp, ki, gate, quick_start, declination, max_gap, mag",
        ),
        ({"mag": "yes"}, "mag"),
        ({"declination": "3"}, "declination.*needs a unit.*rad, deg"),
    ],
)
def test_what_is_not_clear_is_refused(params, words):
    with pytest.raises(ParameterError, match=words):
        mahony(**params)


def test_unknown_filter_and_missing_frame():
    with pytest.raises(ParameterError, match=r"there is no filter 'mahoney'; known are .*mahony"):
        Filter("mahoney", frame=Frame.ENU)
    with pytest.raises(FrameError, match="None is not a navigation frame; known are ENU, NED, NWU"):
        Filter("mahony", frame=None)
    with pytest.raises(ShapeError, match="init must be one finite quaternion"):
        Filter("mahony", frame=Frame.ENU, init=[[1, 0, 0, 0]])
    with pytest.raises(ShapeError, match="init must be one finite quaternion"):
        Filter("mahony", frame=Frame.ENU, init=[1.0, 0.0, float("nan"), 0.0])


@pytest.mark.parametrize("name", filter_names())
def test_every_parameter_says_what_it_is(name):
    for p in (*describe(load(name).Params), *describe(CommonParams)):
        assert p.spec.meaning
        assert p.default is None or p.switch or p.spec.low <= p.default <= p.spec.high


@given(st.text(max_size=12))
def test_no_text_ends_in_anything_but_a_number_or_a_clear_error(text):
    try:
        value = mahony(gate=text).params.gate
    except ParameterError as error:
        assert "\n" not in str(error).replace(text, "")
    else:
        assert value is None or 0.0 <= value <= 1e3
