"""The filter of a chain: its linear model against finite differences, and forces at joints against exact motion."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from plumbob.arm.filter import WIDTH, ChainFilter, Params, UnitSamples
from plumbob.arm.links import chain_links
from plumbob.arm.smoother import UnitAttitudes, backward, begin, first_tilts, keyframe_rows
from plumbob.core.constants import G0
from plumbob.core.units import deg
from plumbob.rotations import quat_conjugate, quat_multiply, quat_rotate, rotvec_from_quat
from plumbob.simulation import simulate_chain

STEP = 1e-5
INSTANT = Params(mean_rate=False)


@cache
def samples_of_ideal(name, seconds, rate=200.0, seed=3):
    made = simulate_chain(name, "fast", frame="ENU", unit="calibrated", seed=seed, rate=rate, duration=seconds)
    units = [made.array.units[one.unit] for one in made.chain.segments if one.unit]
    return made, UnitSamples(
        made.t, np.stack([one.gyr for one in units]), np.stack([one.acc for one in units]),
        np.stack([one.mag for one in units]),
    )  # fmt: skip


def true_units(made):
    """Attitudes of the units (U, N, 4), exact."""
    return np.stack([
        quat_multiply(made.tracks[one.name].q_nb, np.array(one.mount.q_bs)) for one in made.chain.segments if one.unit
    ])  # fmt: skip


def filter_at_truth(name, params=INSTANT, q_sd=0.05):
    made, samples = samples_of_ideal(name, 4.2, rate=500.0)
    first = len(samples) - 100
    part = samples.rows(first, len(samples))
    assert np.abs(part.gyr[:, :50]).max() > 0.5  # it moves
    q = true_units(made)[:, first]
    return made, part, ChainFilter(chain_links(made.chain), len(q), params, q, np.full((len(q), 3), q_sd))


def test_the_first_tilt_is_that_of_the_mean_force_of_a_second_and_a_half():
    """Three turns of a shaking of 3 m/s², whose mean is zero; its first samples lean by 17°."""
    t = np.arange(400) / 200.0
    force = np.stack((3.0 * np.cos(4.0 * np.pi * t), 0.0 * t, G0 + 0.0 * t), axis=1)[np.newaxis]
    assert first_tilts(UnitSamples(t, 0.0 * force, force))[0] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-9)
    made, samples = samples_of_ideal("arm7", 3.0, rate=100.0)
    start = begin(samples, chain_links(made.chain), INSTANT, north=np.pi / 2)
    up = np.array([0.0, 0.0, 1.0])
    off_up = np.einsum(
        "ui,ui->u", quat_rotate(quat_conjugate(start.q), up), quat_rotate(quat_conjugate(true_units(made)[:, 0]), up)
    )
    assert np.degrees(np.arccos(np.clip(off_up, -1.0, 1.0))).max() < 9.0  # three standard deviations of TILT_SD, 3°


@pytest.mark.parametrize("name", ["arm7", "teach", "five"])
def test_forces_at_a_joint_are_what_its_centre_feels(name):
    # exact: the child's origin is the joint's centre, whose specific force the simulator differentiates by hand. The
    # filter's attitudes are late by half a step at most, which turns a force f by ω dt / 2.
    made, samples, found = filter_at_truth(name)
    path = np.zeros((*samples.gyr.shape[:2], 4))
    last = 20
    found.look(samples, 1, last, path)
    first, turn = len(made.t) - 100, float(np.linalg.norm(samples.gyr, axis=2).max() * 0.002 / 2)
    for k, joint in enumerate(made.chain.joints):
        body = made.bodies[joint.child]
        force = quat_rotate(body.q_nb, body.specific_force_b)[first + 1 : first + last - 1].mean(axis=0)
        for side in (0, 1):
            if np.isfinite(found.forces[2 * k + side]).all() and not (side == 0 and joint.parent == "base"):
                np.testing.assert_allclose(
                    found.forces[2 * k + side], force, atol=1.1 * turn * float(np.linalg.norm(force)) + 0.003
                )


def test_the_ground_carries_no_more_than_gravity_and_what_is_not_seen_becomes_uncertain():
    _, samples, found = filter_at_truth("teach")
    path = np.zeros((*samples.gyr.shape[:2], 4))
    found.look(samples, 1, 20, path)
    np.testing.assert_allclose(found.forces[1], [0.0, 0.0, G0], atol=0.05)  # as above: 5 rad/s × 1 ms × 9.8 m/s²
    _, samples, found = filter_at_truth("five")
    gyr = samples.gyr.copy()
    gyr[2, 1:51] = np.nan
    hidden = UnitSamples(samples.t, gyr, samples.acc)
    path = np.zeros((*gyr.shape[:2], 4))
    var = np.diag(found.advance(hidden, 1, 51, path).cov_prior).reshape(-1, WIDTH)[:, 0]
    assert var[2] - var[1] == pytest.approx(1.0**2 * 0.1 * 1.0, rel=0.1)  # UNSEEN_RATE² × 0.1 s × UNSEEN_TIME


def shifted(found, error):
    """The same filter whose state is off by an error."""
    other = ChainFilter(found.links, found.units, found.params, found.q, np.full((found.units, 3), 0.05))
    other.inject(error)
    return other


def off(q, linear, q_before, linear_before):
    """Error (D,) that takes one state to the other."""
    return np.hstack((rotvec_from_quat(quat_multiply(q, quat_conjugate(q_before))), linear - linear_before)).ravel()


def test_the_transition_is_the_derivative_of_the_integration():
    _, samples, found = filter_at_truth("five")
    path = np.zeros((*samples.gyr.shape[:2], 4))
    size = WIDTH * found.units
    begun = shifted(found, np.zeros(size)).advance(samples, 1, 51, path)
    for place in range(size):
        ends = []
        for sign in (1.0, -1.0):
            other = shifted(found, sign * STEP * np.eye(size)[place])
            other.look(samples, 1, 51, path)
            ends.append(off(other.q, np.hstack((other.bias, other.v)), begun.q_prior, begun.linear_prior))
        # a bias lowers the rate: its own column is first-order in the step of 0.1 s, of which 3 % may be missing
        np.testing.assert_allclose((ends[0] - ends[1]) / (2.0 * STEP), begun.transition[:, place], atol=0.04)


@pytest.mark.parametrize("fields", [False, True])
@pytest.mark.parametrize("name", ["arm7", "teach", "five"])
def test_an_update_takes_off_an_error_what_its_covariances_claim(name, fields):
    # Kalman: of an error I − K H = P⁺ P⁻¹ is left, whatever the rows were. They linearise where the filter is, half a
    # step late: by 5 rad/s × 1 ms they may differ. A field that iron bends must not tilt anything, so that its rows say
    # less of tilts than the field would: there only errors of heading count.
    _, samples, found = filter_at_truth(name, INSTANT._replace(field_sd=deg(2.0), field_time=0.05))
    samples = samples if fields else UnitSamples(samples.t, samples.gyr, samples.acc)
    path = np.zeros((*samples.gyr.shape[:2], 4))
    size = WIDTH * found.units
    turns = np.flatnonzero(np.arange(size) % WIDTH < 3)

    def change(error):
        end = shifted(found, error).advance(samples, 1, 51, path)
        return end, off(end.q, end.linear, end.q_prior, end.linear_prior)

    end, _ = change(np.zeros(size))
    claimed = (end.cov @ np.linalg.inv(end.cov_prior) - np.eye(size)) @ end.transition
    assert 0.1 < np.abs(claimed[np.ix_(turns, turns)]).max() < 1.0
    for place in turns[2::3] if fields else turns:
        ahead, behind = (change(sign * STEP * np.eye(size)[place])[1] for sign in (1.0, -1.0))
        np.testing.assert_allclose((ahead - behind)[turns] / (2.0 * STEP), claimed[turns, place], atol=0.005)


def test_a_speed_is_drawn_to_zero_by_the_same_part_however_large_it_is():
    """That no arm runs away is no measurement, which could be an outlier."""
    _, samples, found = filter_at_truth("five")
    path, size = np.zeros((*samples.gyr.shape[:2], 4)), WIDTH * found.units
    at = shifted(found, np.zeros(size)).advance(samples, 1, 51, path)
    fast = shifted(found, 30.0 * np.eye(size)[6]).advance(samples, 1, 51, path)
    drawn = [end.linear[0, 3] - end.linear_prior[0, 3] for end in (at, fast)]
    claimed = at.cov @ np.linalg.inv(at.cov_prior) - np.eye(size)  # Kalman, as above
    assert (drawn[1] - drawn[0]) / 30.0 == pytest.approx(claimed[6, 6], rel=1e-9)


def test_what_is_learnt_at_a_keyframe_does_not_depend_on_what_was_known():
    # the information of independent rows adds up (Bayes); that of a velocity which is zero for a time, and that of a
    # heading which the fields of two units share, are closed forms
    params = INSTANT._replace(field_sd=deg(2.0), field_time=0.05)
    gained = []
    for q_sd, fields in ((0.05, True), (0.02, True), (0.05, False)):
        _, samples, found = filter_at_truth("five", params, q_sd)
        path = np.zeros((*samples.gyr.shape[:2], 4))
        samples = samples if fields else UnitSamples(samples.t, samples.gyr, samples.acc)
        end = found.advance(samples, 1, 51, path)
        gained.append(np.linalg.inv(end.cov) - np.linalg.inv(end.cov_prior))
    np.testing.assert_allclose(gained[0], gained[1], atol=1e-9 * np.abs(gained[0]).max())
    speed = np.diag(gained[0]).reshape(-1, WIDTH)[:, 6:]
    np.testing.assert_allclose(speed, 0.1 / (2.0 * params.speed_sd**2 * params.speed_time), rtol=1e-6)
    shared = np.diag(gained[0] - gained[2]).reshape(-1, WIDTH)
    neighbours = np.array([1.0, 2.0, 2.0, 2.0, 1.0])
    np.testing.assert_allclose(shared[:, 2], neighbours / (2.0 * params.field_sd**2), rtol=1e-6)
    np.testing.assert_allclose(np.delete(shared, 2, axis=1), 0.0, atol=1e-6)


def test_smoothing_of_one_keyframe_changes_nothing_and_of_many_never_adds_doubt():
    _, samples, found = filter_at_truth("five")
    path = np.zeros((*samples.gyr.shape[:2], 4))
    rows = keyframe_rows(samples.t, 0.1)
    frames = [found.now()]
    for first, last in pairwise(rows):
        frames.append(found.advance(samples, int(first) + 1, int(last) + 1, path))
    (one,) = backward(frames[-1:])
    assert one is frames[-1]
    for before, after in zip(frames, backward(frames), strict=True):
        # knowing more, the covariance cannot grow (Gauss–Markov)
        assert np.linalg.eigvalsh(before.cov - after.cov).min() > -1e-9


def stretches(samples):
    return [*UnitAttitudes([], Params()).stretches(samples)]


def test_a_gap_of_all_units_parts_a_recording_and_one_of_a_single_unit_does_not():
    t = np.arange(0.0, 10.0, 0.01)
    gyr = np.zeros((2, t.size, 3))
    gyr[0, 300:500] = np.nan
    assert stretches(UnitSamples(t, gyr, gyr)) == [(0, 1000)]
    gyr[1, 300:500] = np.nan
    assert stretches(UnitSamples(t, gyr, gyr)) == [(0, 500), (500, 1000)]
    cut = np.r_[0:300, 500:1000]
    assert stretches(UnitSamples(t[cut], gyr[:, cut], gyr[:, cut])) == [(0, 300), (300, 800)]
