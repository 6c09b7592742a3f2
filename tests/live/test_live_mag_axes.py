"""Wrong axes of a sensor in a capture for the magnetometer: refused or told, with the line that puts them right."""

import re
from dataclasses import replace

import numpy as np
import pytest

from plumbob.calibration.calibrate_mag import calibrate_mag
from plumbob.data import ImuData, ImuMeta
from plumbob.rotations import in_body_axes, signed_axes
from tests.helpers.mag_scene import DIP, field, force, rates, trajectory, unit_of
from tests.helpers.refusals import reason_kinds, reasons


@pytest.fixture(scope="module")
def capture():
    """Three minutes of slow turning through all attitudes, in most of which the vertical is told."""
    rng = np.random.default_rng(25)
    t, q_nb, true = trajectory(rng, duration=60.0, rate=10.0, tilt=np.pi)
    triads = {"gyr": rates(rng, true, rate=10.0) / 3.0, "acc": force(rng, q_nb), "mag": field(rng, unit_of(rng), q_nb)}
    return ImuData(t=3.0 * t, meta=ImuMeta(device="SN1"), **triads)


def turned(imu, sensor, axes):
    """The capture of a sensor that measures the case's x, y, z as its own `axes`."""
    return imu.corrected(meta=imu.meta, **{sensor: imu.usable(sensor) @ signed_axes(axes).T})


def refusal(imu, **options):
    return reasons(calibrate_mag, imu, **options)[0]


def line(advice):
    """The first line of a profile in an advice: its table, its axes, and whether they are mirrored."""
    table, axes, mirrored = re.search(r'\[(\w+)\] axes = "([^"]+)"( with mirrored = true)?', advice).groups()
    return table, axes, mirrored is not None


MIRRORS = {  # what a sensor measures of x, y, z, and what is told of it
    "x y -z": "mirrored: z reversed",
    "y x z": "mirrored: x and y swapped",
    "y z -x": "mirrored: its x, y, z are y, z, −x of the others",
}
TURNS = {"x -y -z": "y and z reversed", "y -x z": "its x, y, z are y, −x, z of the others"}


@pytest.mark.parametrize("helper", ["auto", "none", "acc", "gyr"])
def test_axes_that_are_right_are_not_spoken_of(capture, helper):
    assert sum("axes of" in str(remark) for remark in calibrate_mag(capture, with_=helper).remarks) == 0


@pytest.mark.parametrize(
    ("axes", "words", "helper"),
    [(axes, words, helper) for axes, words in MIRRORS.items() for helper in ("none", "acc")]
    + [("y z -x", MIRRORS["y z -x"], "auto"), ("y z -x", MIRRORS["y z -x"], "gyr")],
)
def test_a_mirrored_magnetometer_is_refused_whatever_helps(capture, axes, words, helper):
    reason = refusal(turned(capture, "mag", axes), with_=helper)
    assert reason.kind == "mirrored" and f"the magnetometer are wrong ({words})" in reason.text
    table, told, mirrored = line(reason.advice)
    np.testing.assert_array_equal(signed_axes(told) @ signed_axes(axes), np.eye(3))
    assert (table, mirrored) == ("mag", True)


@pytest.mark.parametrize(("axes", "words"), TURNS.items())
def test_a_turned_magnetometer_is_refused_alone_and_taken_with_a_remark_else(capture, axes, words):
    """By itself a card has no turn; and no half turn passes for axes that are all reversed."""
    wrong = turned(capture, "mag", axes)
    reason = refusal(wrong, with_="none")
    assert reason.kind == "turned-axes" and f"wrong ({words})" in reason.text and "--with acc or gyr" in reason.advice
    for helper in ("acc", "gyr"):
        (told,) = [one for one in map(str, calibrate_mag(wrong, with_=helper).remarks) if "axes of the" in one]
        assert told.startswith("TURNED BY") and f"({words})" in told and "all axes" not in told
        assert line(told)[2] is False


@pytest.mark.parametrize(("sensor", "helper", "free"), [("acc", "acc", "none"), ("gyr", "gyr", "acc")])
def test_wrong_axes_of_another_sensor_are_refused_where_the_card_rests_on_them(capture, sensor, helper, free):
    wrong = turned(capture, sensor, "x y -z")
    reason = refusal(wrong, with_=helper)
    assert reason.kind == "mirrored" and line(reason.advice) == (sensor, "x y -z", True)
    (told,) = [one for one in map(str, calibrate_mag(wrong, with_=free).remarks) if "axes of the" in one]
    assert told.startswith("AXES: ") and line(told) == (sensor, "x y -z", True)


DOUBTS = [  # what is not there, how it is asked for, what is said of z reversed, and whether the south is named
    ({"gyr": None}, {}, "the accelerometer, unless the axes of that are wrong", True),
    ({"acc": None}, {"with_": "none"}, '"-x -y z", or [mag] axes = "x y -z" with mirrored = true', False),
    ({}, {"with_": "acc"}, "South of the magnetic equator it is", True),
    ({}, {"with_": "acc", "dip": DIP}, "mirrored = true", False),
]


@pytest.mark.parametrize(("missing", "options", "words", "south"), DOUBTS)
def test_what_else_it_may_be_is_said(capture, missing, options, words, south):
    """Without a dip a mirror and a turn are one; north of the magnetic equator is assumed, or the place says so."""
    reason = refusal(replace(turned(capture, "mag", "x y -z"), **missing), **options)
    assert words in f"{reason.text} {reason.advice}"
    assert ("South" in reason.advice) == south


def test_the_place_and_the_axes_of_a_recording_count(capture):
    remarks = calibrate_mag(turned(capture, "mag", "x y -z"), with_="acc", dip=-DIP).remarks
    assert [remark[:14] for remark in map(str, remarks) if "(x and y reversed)" in remark] == ["TURNED BY 180°"]
    # A sensor that sits a quarter turn about its x, in a case that sits a quarter turn about its z
    own, case = signed_axes("x z -y"), signed_axes("y -x z")
    meta = replace(capture.meta, axes="y -x z")
    wrong = capture.corrected(meta=meta, mag=capture.mag @ (case @ own @ case.T).T)  # case of true, sensor, body
    axes = line(refusal(wrong, with_="none").advice)[1]
    np.testing.assert_array_equal(in_body_axes(axes, own @ np.array([1.0, 2.0, 3.0])), [1.0, 2.0, 3.0])


def test_a_capture_that_is_refused_anyway_names_wrong_axes_too(capture):
    """First where they mirror; a turn, which a card may take up, after what the capture lacks."""
    fast = replace(capture, t=capture.t / 9.0, gyr=9.0 * capture.gyr, flags=None)
    for axes, kinds in (
        ("x y z", ["not-still"]),
        ("x y -z", ["mirrored", "not-still"]),
        ("x -y -z", ["not-still", "turned-axes"]),
    ):
        assert reason_kinds(calibrate_mag, turned(fast, "mag", axes), with_="acc") == kinds
