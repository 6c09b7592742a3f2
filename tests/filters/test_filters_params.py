"""Parameters: units in text, SI in Python, and no typo that passes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob import Filter, Frame, ImuData, ImuMeta, ImuSample, NoiseCard, flags
from plumbob.core.constants import G0
from plumbob.core.errors import FrameError, ParameterError, ShapeError
from plumbob.core.params import describe
from plumbob.filters import CommonParams, Start, filter_names, load
from plumbob.rotations import North, euler_zyx_from_quat
from tests.helpers import examples
from tests.helpers.filter_state import through_json


def mahony(**params):
    return Filter("mahony", frame=Frame.ENU, params=params)


@pytest.mark.parametrize(
    ("text", "si"),
    [("0.08g", 0.08 * G0), ("80 mg", 0.08 * G0), ("0.5m/s2", 0.5), ("0.5 m/s²", 0.5), ("1e-1 m/s2", 0.1)],
)
def test_text_is_converted_with_its_unit(text, si):
    assert mahony(gate=text).params.gate == pytest.approx(si, rel=1e-15)


def test_the_gate_can_be_off():
    assert [mahony(gate=word).params.gate for word in ("off", "OFF", "none")] == [None] * 3


@pytest.mark.parametrize(("settings", "error", "words"), [
    ({"params": {"gate": "0.08"}}, ParameterError, "gate.*needs a unit.*m/s2, g, mg"),
    ({"params": {"gate": "0.08 deg"}}, ParameterError, "not a unit of acceleration"),
    ({"params": {"gate": "much"}}, ParameterError, "not a number"),
    ({"params": {"kp": "-1"}}, ParameterError, r"kp must be 0 to 100 1/s, but it is -1"),
    ({"params": {"kp": float("nan")}}, ParameterError, "kp must be 0 to"),
    ({"params": {"kp": None}}, ParameterError, "kp must be a number"),
    ({"params": {"kp": True}}, ParameterError, "kp must be a number"),
    ({"params": {"freqency": 100.0}}, ParameterError, "no parameter 'freqency'; known: kp, ki, .*max_gap, mag"),
    ({"params": {"mag": "yes"}}, ParameterError, "mag"),
    ({"params": {"declination": "3"}}, ParameterError, "declination.*needs a unit.*rad, deg"),
    ({"name": "mahoney"}, ParameterError, r"there is no filter 'mahoney'; known: .*mahony"),
    ({"name": "chain"}, ParameterError, "there is no filter 'chain'; known: "),
    ({"frame": None}, FrameError, "None is not a navigation frame; known: ENU, NED, NWU"),
    ({"init": [[1, 0, 0, 0]]}, ShapeError, "init must be one finite quaternion"),
    ({"init": [1.0, 0.0, float("nan"), 0.0]}, ShapeError, "init must be one finite quaternion"),
    ({"init": "upright"}, ParameterError, "level, truth or ROLL,PITCH,HEADING"),
    ({"init": "1deg,2deg"}, ParameterError, "ROLL,PITCH"),
    ({"init": "truth"}, ParameterError, "needs the recording's"),
    ({"noise": NoiseCard("a", "b")}, ParameterError, "mahony has no parameter that a noise card could give"),
])  # fmt: skip
def test_what_is_not_clear_is_refused(settings, error, words):
    with pytest.raises(error, match=words):
        Filter(**{"name": "mahony", "frame": Frame.ENU, **settings})


@pytest.mark.parametrize("name", filter_names())
def test_every_parameter_says_what_it_is(name):
    for p in (*describe(load(name).Params), *describe(CommonParams)):
        assert p.spec.meaning
        assert p.default is None or p.switch or p.spec.low <= p.default <= p.spec.high


@given(st.text(max_size=12))
@examples(0.5)
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


@pytest.mark.parametrize(("params", "known", "north", "expected"), [
    # true where a declination is known, whoever knows it; the parameter has the last word
    ({}, None, North.MAGNETIC, 0.0),
    ({}, 0.1, North.TRUE, 0.1),
    ({"declination": 0.2}, None, North.TRUE, 0.2),
    ({"declination": 0.2}, 0.1, North.TRUE, 0.2),
    ({"declination": "off"}, 0.1, North.MAGNETIC, 0.0),
    ({"mag": False}, 0.1, North.FREE, 0.0),
])  # fmt: skip
def test_headings_are_true_where_a_declination_is_known(params, known, north, expected):
    data = facing_north(declination=known)
    whole = Filter("tilt_compass", frame=Frame.NED, params=params)
    assert whole.process(data).north is north
    stream = Filter("tilt_compass", frame=Frame.NED, params=params, meta=data.meta)
    for sample in data.samples():
        stream.update(sample)
    again = through_json(whole)
    track = again.process(facing_north(declination=known)[99:])
    assert [yaw(f) for f in (whole, stream, again)] == pytest.approx([expected] * 3, abs=1e-12)
    assert (track.north, again.describe()) == (north, whole.describe())


def test_a_filter_takes_the_declination_of_each_recording_but_never_changes_it_on_the_way():
    f = Filter("tilt_compass", frame=Frame.NED)
    f.process(facing_north(declination=0.1))
    with pytest.raises(FrameError, match=r"began with 5\.72958° of declination, but the recording has 11\.4592°"):
        f.process(facing_north(declination=0.2))
    for known, north in ((0.2, North.TRUE), (None, North.MAGNETIC)):
        f.reset()
        assert f.process(facing_north(declination=known)).north is north
    with pytest.raises(FrameError, match="began without a declination"):
        f.process(facing_north(declination=0.2))


@pytest.mark.parametrize(
    ("frame", "yaw"),
    [(Frame.NED, 70.0), (Frame.ENU, 20.0), (Frame.NWU, -70.0)],  # a heading goes clockwise from north
)
def test_a_start_in_words_is_roll_pitch_and_heading(frame, yaw):
    f = Filter("integrate", frame=frame, init="10deg, -5 deg, 70deg")
    assert np.degrees(euler_zyx_from_quat(f.q_nb)) == pytest.approx([yaw, -5.0, 10.0])
    again = through_json(f)
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


@pytest.mark.parametrize(("size", "shows"), [(1e-7, False), (1.0, True)])
def test_a_field_far_below_any_sensor_s_last_digit_shows_no_heading(size, shows):
    f = Filter("mahony", frame=Frame.NED)
    f.update(ImuSample(0, [0.0, 0.0, 0.0], [0.0, 0.0, -9.81], [0.0, -size, 0.0]))
    assert yaw(f) == pytest.approx(np.pi / 2 if shows else 0.0)


@pytest.mark.parametrize(("init", "known", "north"), [
    (None, None, North.FREE),
    ("level", 0.1, North.FREE),
    ("0deg,0deg,0deg", None, North.MAGNETIC),  # the rule of headings
    ("0deg,0deg,0deg", 0.1, North.TRUE),
    (Start(np.array([1.0, 0, 0, 0]), North.TRUE), None, North.TRUE),
])  # fmt: skip
def test_a_gyroscope_alone_keeps_the_north_of_its_start(init, known, north):
    data = ImuData(t=np.arange(5) / 100.0, gyr=np.ones((5, 3)), meta=ImuMeta(declination=known))
    f = Filter("integrate", frame=Frame.NED, init=init)
    again = through_json(f)
    assert (f.process(data).north, again.process(data).north) == (north, north)
