"""Wrong axes of one sensor: told by the other two, or left open; and whether a field turns as a gyroscope says."""

import numpy as np
import pytest

from plumbob.calibration.mag.axes import LEAST_SLOPE, agreement, arrangements, suspects
from plumbob.core.constants import G0
from plumbob.rotations import dcm_from_quat, quat_from_rotvec, signed_axes
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
    for missing in ((), ("acc",), ("gyr",), ("acc", "gyr")):
        assert suspected(without(scene, *missing)) == ()


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


def test_what_does_not_turn_enough_or_is_shaken_convicts_nobody(scene):
    """Turning about an upright axis alone, x and y may be reversed; a field at rest says nothing at all."""
    rng = np.random.default_rng(62)
    t, q_nb, true = trajectory(rng, duration=30.0, tilt=np.radians(0.5))
    level = {"t": t, "mag": field(rng, unit_of(rng), q_nb), "acc": force(rng, q_nb), "gyr": rates(rng, true)}
    assert suspected(level, mag=signed_axes("-x -y z")) == ()
    still = scene | {"mag": [20.0, 0.0, 40.0] + 0.2 * rng.normal(size=scene["mag"].shape)}
    assert suspected(still, mag=signed_axes("x y -z")) == ()
    shaken = scene | {"acc": scene["acc"] + 3.0 * G0 * rng.normal(size=scene["acc"].shape)}
    assert "acc" not in {suspect.triad for suspect in suspected(shaken, mag=signed_axes("x y -z"))}


def test_a_few_poses_tell_the_dip(scene):
    rng = np.random.default_rng(65)
    q_nb = attitudes(rng, 30)
    mag, acc, nothing = field(rng, unit_of(rng), q_nb), force(rng, q_nb), np.full((30, 3), np.nan)
    (only,) = suspects(arrangements(np.arange(30.0), mag @ signed_axes("x y -z").T, acc=acc, gyr=nothing))
    np.testing.assert_array_equal(only.way, signed_axes("-x -y z"))


RATE_BIAS = np.radians([15.0, -5.0, 2.0])


@pytest.fixture(scope="module")
def turning():
    rng = np.random.default_rng(51)
    unit = unit_of(rng)
    t, q_nb, true = trajectory(rng, tilt=np.pi)
    return unit, t, field(rng, unit, q_nb), rates(rng, true) + RATE_BIAS


def test_a_field_that_is_not_calibrated_turns_with_a_gyroscope_that_is_not(turning):
    _, t, mag, gyr = turning
    found = agreement(t, mag, gyr)
    assert 0.8 < found.slope < 1.2  # soft iron of 10 to 20 %
    np.testing.assert_allclose(found.rate_bias, RATE_BIAS, atol=0.2 * np.radians(20.0))  # as much of the mean rate


@pytest.mark.parametrize("mirror", [np.diag([1.0, 1.0, -1.0]), np.eye(3)[[1, 0, 2]], np.eye(3)[[0, 2, 1]]])
def test_a_mirrored_one_does_not(turning, mirror):
    _, t, mag, gyr = turning
    assert agreement(t, mag @ mirror.T, gyr).slope < LEAST_SLOPE


def test_turns_of_fields_that_are_calibrated_not_calibrated_negated_or_still(turning):
    _, t, mag, gyr = turning
    slope = agreement(t, mag, gyr).slope
    assert agreement(t, -mag, gyr).slope == pytest.approx(slope, rel=1e-9)
    some = mag.copy()
    some[::3] = np.nan
    assert agreement(t, some, gyr).slope == pytest.approx(slope, abs=0.01)
    rng = np.random.default_rng(1)
    still = [20.0, 0.0, 40.0] + 0.2 * rng.normal(size=mag.shape)
    assert agreement(t, still, RATE_BIAS + 1e-3 * rng.normal(size=gyr.shape)) is None
    unit, t, mag, gyr = turning
    turned = dcm_from_quat(quat_from_rotvec(np.radians([10.0, -20.0, 30.0])))
    found = agreement(t, (mag - unit.bias) @ unit.matrix.T @ turned.T, gyr).turn
    np.testing.assert_allclose(found, turned, atol=0.005)  # 0.03 to 0.3° at this noise
