"""Parameters: units in text, SI in Python, and no typo that passes."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob import Filter, Frame, ImuData, ImuMeta
from plumbob.core import flags
from plumbob.core.constants import G0
from plumbob.core.errors import FrameError, ParameterError, ShapeError
from plumbob.core.params import describe
from plumbob.filters import CommonParams, Start, filter_names, load
from plumbob.rotations import North, euler_zyx_from_quat


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


def facing_north(seconds=1.0, **meta):
    """A body that stands level and faces magnetic north, in NED."""
    n = round(100 * seconds)
    still = {"gyr": np.zeros((n, 3)), "acc": np.tile([0.0, 0.0, -9.81], (n, 1)), "mag": np.tile([20.0, 0, 40], (n, 1))}
    return ImuData(t=np.arange(n) / 100.0, **still, meta=ImuMeta(**meta))


def yaw(f):
    return float(euler_zyx_from_quat(f.q_nb)[0])


@pytest.mark.parametrize(
    ("params", "known", "north", "expected"),
    [  # true where a declination is known, whoever knows it; the parameter has the last word
        ({}, None, North.MAGNETIC, 0.0),
        ({}, 0.1, North.TRUE, 0.1),
        ({"declination": 0.2}, None, North.TRUE, 0.2),
        ({"declination": 0.2}, 0.1, North.TRUE, 0.2),
        ({"declination": "off"}, 0.1, North.MAGNETIC, 0.0),
        ({"mag": False}, 0.1, North.FREE, 0.0),
    ],
)
def test_headings_are_true_where_a_declination_is_known(params, known, north, expected):
    data = facing_north(declination=known)
    whole = Filter("tilt_compass", frame=Frame.NED, params=params)
    assert whole.process(data).north is north
    stream = Filter("tilt_compass", frame=Frame.NED, params=params, meta=data.meta)
    for sample in data.samples():
        stream.update(sample)
    again = Filter.restore(json.loads(json.dumps(whole.save())))
    track = again.process(facing_north(declination=known)[99:])
    assert [yaw(f) for f in (whole, stream, again)] == pytest.approx([expected] * 3, abs=1e-12)
    assert (track.north, again.describe()) == (north, whole.describe())


def test_a_filter_takes_the_declination_of_each_recording_but_never_changes_it_on_the_way():
    f = Filter("tilt_compass", frame=Frame.NED)
    f.process(facing_north(declination=0.1))
    with pytest.raises(FrameError, match=r"began with 5\.72958° of declination, but the recording has 11\.4592°"):
        f.process(facing_north(declination=0.2))
    f.reset()
    assert f.process(facing_north(declination=0.2)).north is North.TRUE
    f.reset()
    assert f.process(facing_north()).north is North.MAGNETIC
    with pytest.raises(FrameError, match="began without a declination"):
        f.process(facing_north(declination=0.2))


@pytest.mark.parametrize(
    ("frame", "yaw"),
    [(Frame.NED, 70.0), (Frame.ENU, 20.0), (Frame.NWU, -70.0)],  # a heading goes clockwise from north
)
def test_a_start_in_words_is_roll_pitch_and_heading(frame, yaw):
    f = Filter("integrate", frame=frame, init="10deg, -5 deg, 70deg")
    assert np.degrees(euler_zyx_from_quat(f.q_nb)) == pytest.approx([yaw, -5.0, 10.0])
    again = Filter.restore(json.loads(json.dumps(f.save())))
    again.reset()
    assert again.q_nb.tobytes() == f.q_nb.tobytes()


@pytest.mark.parametrize("name", filter_names())
def test_a_level_start_leaves_the_heading_to_the_field(name):
    """90° east of north. Madgwick's gradient never rests: two of its steps of 2βΔt are 0.094°."""
    data = facing_north(0.2)  # longer, and the same bits again and again would be those of stuck sensors
    turned = ImuData(t=data.t, gyr=data.gyr, acc=data.acc, mag=np.tile([0.0, -20.0, 40.0], (20, 1)))
    f = Filter(name, frame=Frame.NED, init="level")
    track = f.process(turned)
    assert np.degrees(yaw(f)) == pytest.approx(90.0, abs=0.1 if name == "madgwick" else 1e-3)
    assert not (track.flags & flags.NOT_CONVERGED).any()


@pytest.mark.parametrize(
    ("init", "known", "north"),
    [
        (None, None, North.FREE),
        ("level", 0.1, North.FREE),
        ("0deg,0deg,0deg", None, North.MAGNETIC),  # the rule of headings
        ("0deg,0deg,0deg", 0.1, North.TRUE),
        (Start(np.array([1.0, 0, 0, 0]), North.TRUE), None, North.TRUE),
    ],
)
def test_a_gyroscope_alone_keeps_the_north_of_its_start(init, known, north):
    data = ImuData(t=np.arange(5) / 100.0, gyr=np.ones((5, 3)), meta=ImuMeta(declination=known))
    f = Filter("integrate", frame=Frame.NED, init=init)
    again = Filter.restore(json.loads(json.dumps(f.save())))
    assert (f.process(data).north, again.process(data).north) == (north, north)


@pytest.mark.parametrize(
    ("init", "told"),
    [
        ("upright", "level, truth or ROLL,PITCH,HEADING"),
        ("1deg,2deg", "ROLL,PITCH"),
        ("truth", "needs the recording's"),
    ],
)
def test_a_start_that_says_nothing_is_refused(init, told):
    with pytest.raises(ParameterError, match=told):
        Filter("integrate", frame=Frame.NED, init=init)
