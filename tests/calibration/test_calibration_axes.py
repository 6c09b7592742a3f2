"""Wrong axes of one sensor: told by the other two, or left open."""

import numpy as np
import pytest

from plumbob.calibration.mag.axes import arrangements, suspects
from plumbob.core.constants import G0
from plumbob.rotations import every_axes, quat_conjugate, quat_rotate, signed_axes
from tests.helpers.mag_scene import attitudes, field, force, rates, trajectory, tumbling, unit_of

NEGATED = -np.eye(3)
WAYS = ["x -y -z", "y x z", "x y -z", "-y x z", "y z x", "-z y x", "-x -y -z"]
"""A half turn, a swap, a sign, a quarter turn, a third of one, a mirrored one, and all signs."""


@pytest.fixture(scope="module")
def scene():
    """A minute by hand of a unit with hard and soft iron, and a gyroscope's bias of 3 °/s."""
    rng = np.random.default_rng(61)
    t, q_nb, true = tumbling(rng, duration=60.0)
    gyr = rates(rng, true) + np.radians([3.0, 0.0, -2.0])
    return {"t": t, "mag": field(rng, unit_of(rng), q_nb), "acc": force(rng, q_nb), "gyr": gyr}


def suspected(scene, **turned):
    """Suspects with some triads arranged otherwise."""
    return suspects(arrangements(**(scene | {triad: scene[triad] @ way.T for triad, way in turned.items()})))


def without(scene, *triads):
    return scene | {triad: np.full_like(scene[triad], np.nan) for triad in triads}


def test_right_axes_are_not_suspected(scene):
    assert suspected(scene) == ()
    for one in ("acc", "gyr"):
        assert suspected(without(scene, one)) == ()
    assert suspected(without(scene, "acc", "gyr")) == ()


@pytest.mark.parametrize("axes", WAYS)
def test_two_that_agree_convict_the_third(scene, axes):
    """But for the sign of field and vertical, which nothing but the dip tells."""
    way = signed_axes(axes)
    for triad in ("mag", "acc", "gyr"):
        found = suspected(scene, **{triad: way})
        if triad != "gyr" and np.array_equal(way, NEGATED):
            assert found == ()
            continue
        (only,) = found
        assert (only.triad, only.sure) == (triad, True)
        sign = 1.0 if triad == "gyr" else np.linalg.det(way)
        np.testing.assert_array_equal(only.way, sign * way)


@pytest.mark.parametrize("axes", WAYS[:4])
def test_of_two_that_differ_one_is_named_and_not_convicted(scene, axes):
    way = signed_axes(axes)
    (by_force,) = suspected(without(scene, "gyr"), mag=way)
    (by_rates,) = suspected(without(scene, "acc"), mag=way)
    for one, beside in ((by_force, "acc"), (by_rates, "gyr")):
        assert (one.triad, one.beside, one.sure) == ("mag", beside, False)
        np.testing.assert_array_equal(one.way, np.linalg.det(way) * way)
    (mirrored,) = suspected(without(scene, "acc"), gyr=signed_axes("x y -z"))
    assert (mirrored.triad, mirrored.sure) == ("gyr", False)  # det(P) P of no magnetometer is left-handed


def test_two_wrong_ones_are_held_against_the_accelerometer(scene):
    mag, gyr = signed_axes("x -y -z"), signed_axes("y -x z")
    first, second = suspected(scene, mag=mag, gyr=gyr)
    assert (first.triad, second.triad) == ("mag", "gyr")
    np.testing.assert_array_equal(first.way, mag)
    np.testing.assert_array_equal(second.way, gyr)


def test_what_does_not_turn_enough_tells_nothing(scene):
    """Turning about an upright axis alone, x and y may be reversed; a field at rest says nothing at all."""
    rng = np.random.default_rng(62)
    t, q_nb, true = trajectory(rng, duration=30.0, tilt=np.radians(0.5))
    level = {"t": t, "mag": field(rng, unit_of(rng), q_nb), "acc": force(rng, q_nb), "gyr": rates(rng, true)}
    assert suspected(level, mag=signed_axes("-x -y z")) == ()
    still = scene | {"mag": [20.0, 0.0, 40.0] + 0.2 * rng.normal(size=scene["mag"].shape)}
    assert suspected(still, mag=signed_axes("x y -z")) == ()


def test_an_accelerometer_that_is_shaken_convicts_nobody(scene):
    rng = np.random.default_rng(63)
    shaken = scene | {"acc": scene["acc"] + 3.0 * G0 * rng.normal(size=scene["acc"].shape)}
    assert all(one.triad != "acc" for one in suspected(shaken, mag=signed_axes("x y -z")))


def test_all_arrangements_are_told_by_the_rates():
    """X = det(P) P for a field in other axes, and Gᵀ for rates in other axes; of the 48, ten of all kinds."""
    rng = np.random.default_rng(64)
    t, q_nb, true = tumbling(rng, duration=20.0)
    seen, none = quat_rotate(quat_conjugate(q_nb), np.array([20.0, 0.0, 40.0])), np.full((len(t), 3), np.nan)
    for way in every_axes()[::5]:
        (told,) = arrangements(t, seen @ way.T, acc=none, gyr=true).field_turn
        np.testing.assert_array_equal(told, np.linalg.det(way) * way)
        (told,) = arrangements(t, seen, acc=none, gyr=true @ way.T).field_turn
        np.testing.assert_array_equal(told, way.T)


def test_a_few_poses_tell_the_dip(scene):
    rng = np.random.default_rng(65)
    q_nb = attitudes(rng, 30)
    mag, acc, nothing = field(rng, unit_of(rng), q_nb), force(rng, q_nb), np.full((30, 3), np.nan)
    (only,) = suspects(arrangements(np.arange(30.0), mag @ signed_axes("x y -z").T, acc=acc, gyr=nothing))
    np.testing.assert_array_equal(only.way, signed_axes("-x -y z"))
