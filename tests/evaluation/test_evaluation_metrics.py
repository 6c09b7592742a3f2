"""The metric against closed forms, its invariances, and statistics against NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob import rotations as rot
from plumbob.evaluation.metrics import GIMBAL_GUARD, QUANTITIES, Stats, attitude_errors, wrap
from tests.helpers import examples

ABSOLUTE = ("total", "heading", "inclination")
quats = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: sum(c * c for c in q) > 0.01).map(rot.quat_normalize)
angles = st.floats(-np.pi + 1e-6, np.pi - 1e-6)


def errors(q_est, q_ref):
    return attitude_errors(np.atleast_2d(q_est), np.atleast_2d(q_ref))


def turned(q_ref, rotvec):
    return rot.quat_multiply(rot.quat_from_rotvec(np.asarray(rotvec)), q_ref)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-3, 0.5, 3.0])
def test_planted_heading_and_tilt(motion, t, angle):
    q_ref = motion(t)
    heading = errors(turned(q_ref, [0.0, 0.0, angle]), q_ref)
    tilt = errors(turned(q_ref, angle * np.array([0.6, -0.8, 0.0])), q_ref)
    for found, expected in (
        (heading, {"total": angle, "heading": angle, "inclination": 0.0}),
        (tilt, {"total": angle, "heading": 0.0, "inclination": angle}),
    ):
        for name, value in expected.items():
            np.testing.assert_allclose(found[name], value, rtol=1e-12, atol=1e-14)


@given(quats, quats)
def test_agrees_with_the_published_formulas(a, b):
    # [Laidig2021]: total 2 acos |w|, heading 2 atan |z / w|, inclination 2 acos √(w² + z²)
    w, _, _, z = rot.quat_multiply(a, rot.quat_conjugate(b))
    found = errors(a, b)
    np.testing.assert_allclose(found["total"][0], 2 * np.arccos(min(1.0, abs(w))), atol=1e-7)
    np.testing.assert_allclose(found["inclination"][0], 2 * np.arccos(min(1.0, np.hypot(w, z))), atol=1e-7)
    if abs(w) > 1e-9:
        np.testing.assert_allclose(found["heading"][0], 2 * np.arctan(abs(z / w)), atol=1e-7)
    # inclination is the angle between the verticals, and with heading it makes the total
    up = [rot.quat_rotate(rot.quat_conjugate(q), [0.0, 0.0, 1.0]) for q in (a, b)]
    found = {name: values[0] for name, values in found.items()}
    assert found["inclination"] == pytest.approx(np.arctan2(np.linalg.norm(np.cross(*up)), np.dot(*up)), abs=1e-12)
    made = np.cos(found["heading"] / 2) * np.cos(found["inclination"] / 2)
    assert np.cos(found["total"] / 2) == pytest.approx(made, abs=1e-12)


@given(quats, quats, angles)
@examples(0.5)
def test_nothing_changes_with_signs_nor_with_a_turn_of_the_world(a, b, yaw):
    world = rot.quat_from_rotvec([0.0, 0.0, yaw])
    plain = errors(a, b)
    for other in (errors(-a, b), errors(a, -b), errors(rot.quat_multiply(world, a), rot.quat_multiply(world, b))):
        for name in ABSOLUTE:
            np.testing.assert_allclose(other[name], plain[name], atol=1e-7 if name == "heading" else 1e-12)


@pytest.mark.parametrize("frame", [rot.Frame.NED, rot.Frame.NWU])
def test_frames_agree(motion, t, frame):
    q_ref = motion(t)
    q_est = turned(q_ref, [0.02, -0.03, 0.05])
    here = errors(q_est, q_ref)
    there = errors(*(rot.change_frame(q, to=frame, from_=rot.Frame.ENU) for q in (q_est, q_ref)))
    for name in QUANTITIES:
        np.testing.assert_allclose(np.abs(there[name]), np.abs(here[name]), atol=1e-13)


def test_euler_errors_are_signed_and_wrapped():
    est = np.radians([[-179.0, 10.0, 5.0], [179.0, -10.0, -178.0]])
    ref = np.radians([[178.0, 12.0, 4.0], [-178.0, -11.0, 179.0]])
    found = errors(rot.quat_from_euler_zyx(est), rot.quat_from_euler_zyx(ref))
    table = np.degrees(np.stack([found[k] for k in ("yaw", "pitch", "roll")], axis=1))
    np.testing.assert_allclose(table, [[3.0, -2.0, 1.0], [-3.0, 1.0, 3.0]], atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_of_two_near_the_gimbal_is_enough(sign):
    """Pitches of estimate and reference by turns inside and outside of the guard, with a yaw of 3° between them."""
    guard = 90.0 - np.degrees(GIMBAL_GUARD)
    inside, outside = sign * (guard + 0.1), sign * (guard - 0.1)
    pitch_est, pitch_ref = np.array([outside, outside, inside, inside]), np.array([outside, inside, outside, inside])
    zero = np.zeros(4)
    q_est = rot.quat_from_euler_zyx(np.radians(np.stack((zero + 3.0, pitch_est, zero), axis=1)))
    q_ref = rot.quat_from_euler_zyx(np.radians(np.stack((zero, pitch_ref, zero), axis=1)))
    found = errors(q_est, q_ref)
    for name, value in (("yaw", 3.0), ("roll", 0.0)):
        assert np.isnan(found[name]).tolist() == [False, True, True, True]
        assert np.degrees(found[name][0]) == pytest.approx(value, abs=1e-9)
    assert np.degrees(found["pitch"]) == pytest.approx(pitch_est - pitch_ref, abs=1e-9)
    assert np.isfinite(found["total"]).all()
    unknown = errors([np.nan] * 4, [1.0, 0.0, 0.0, 0.0])
    assert all(np.isnan(unknown[name]).all() for name in QUANTITIES)


@given(st.floats(-50.0, 50.0))
def test_wrap_keeps_the_angle(angle):
    wrapped = wrap(np.array([angle]))[0]
    assert -np.pi < wrapped <= np.pi
    assert np.sin(wrapped) == pytest.approx(np.sin(angle), abs=1e-12)
    assert np.cos(wrapped) == pytest.approx(np.cos(angle), abs=1e-12)


def test_statistics_against_numpy():
    rng = np.random.default_rng(3)
    e, t = rng.normal(0.3, 1.0, 501), np.arange(501) / 7.0
    e[17] = np.nan
    found, kept = Stats.from_errors(e, t), np.delete(e, 17)
    assert (found.p50, found.p95, found.p99) == tuple(np.percentile(np.abs(kept), (50, 95, 99)))
    assert found.mean == kept.mean()
    assert found.rmse**2 == pytest.approx(found.mean**2 + found.std**2, rel=1e-12)
    assert found.max_abs == np.abs(kept).max()
    assert np.abs(e[round(found.max_at * 7.0)]) == found.max_abs
    assert found.count == 500
    assert Stats.from_errors(np.full(3, np.nan), np.arange(3.0)) is None
    assert Stats.from_errors(np.full(10, 0.2), np.arange(10.0)).std == pytest.approx(0.0, abs=1e-15)
