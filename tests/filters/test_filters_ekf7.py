"""The rod paper's Kalman filter: derivatives, misprints that must show, its own idea of its errors, and its rod."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from plumbob import Filter, Frame, ImuData, ImuMeta, NoiseCard, flags, simulate
from plumbob import rotations as rot
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError
from plumbob.data.cards import TriadNoise
from plumbob.evaluation.metrics import attitude_errors
from plumbob.filters import ekf7, quaternion_bias
from plumbob.filters.layout import BIAS, Q
from plumbob.filters.quaternion_bias import ABOUT, P_BB, P_QB, P_QQ
from tests.helpers import slow_as_python
from tests.helpers.filter_state import coefficients_of, fresh_state, state_of
from tests.helpers.jacobians import by_differences
from tests.helpers.motion import consistent, seen_by, up_in_body

UPPER4, UPPER3 = np.triu_indices(4), np.triu_indices(3)
UPPER7 = np.triu_indices(7)


def full(x):
    """P (7, 7) from the 28 entries of a state."""
    p = np.empty((7, 7))
    p[:4, :4][UPPER4] = x[P_QQ:P_QB]
    p[:4, 4:] = x[P_QB:P_BB].reshape(4, 3)
    p[4:, 4:][UPPER3] = x[P_BB : P_BB + 6]
    p.T[UPPER7] = p[UPPER7]
    return p


def state(q, bias, p):
    x = fresh_state("ekf7")
    x[Q : Q + 4], x[ABOUT : ABOUT + 4], x[BIAS : BIAS + 3] = q, q, bias
    x[P_QQ:P_QB], x[P_QB:P_BB], x[P_BB : P_BB + 6] = p[:4, :4][UPPER4], p[:4, 4:].ravel(), p[4:, 4:][UPPER3]
    return x


def drawn(rng):
    """State of a random attitude, bias and covariance, of the size that they have."""
    root = rng.normal(size=(7, 7)) * [0.02, 0.02, 0.02, 0.02, 0.01, 0.01, 0.01]
    return state(rot.quat_normalize(rng.normal(size=4)), 0.1 * rng.normal(size=3), root.T @ root)


def turned(v, gyr, dt):
    """Process of the filter, [Li2012] (10) with its half angle, for any state (q, X) of 7."""
    return np.concatenate((rot.quat_multiply(v[:4], rot.quat_from_rotvec(dt * (gyr - v[4:]))), v[4:]))


def gravity(q, up):
    """[Li2012] (11) with the sign of specific force, quadratic in q."""
    a, b, c, d = q
    return up * G0 * np.array([2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d])


# --- equations ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [0.0, 0.3, 0.9999, 1.0001, 5.0, 30.0])
def test_the_prediction_by_differences(speed):
    """Φ P Φᵀ with Φ by differences of the process, at rest, on both sides of the series' end (0.01 rad), and fast."""
    rng = np.random.default_rng(0)
    for _ in range(10):
        x = drawn(rng)
        axis = rng.normal(size=3)
        gyr, dt = x[BIAS : BIAS + 3] + speed * axis / np.linalg.norm(axis), 0.01
        before = full(x)
        at = np.concatenate((x[Q : Q + 4], x[BIAS : BIAS + 3]))
        phi = by_differences(lambda v, g=gyr, dt=dt: turned(v, g, dt), at, step=1e-4)
        quaternion_bias.predict.py_func(x, dt, *gyr, 0.0, 0.0)
        assert np.abs(x[Q : Q + 4] - turned(at, gyr, dt)[:4]).max() < 1e-15
        assert np.abs(full(x) - phi @ before @ phi.T).max() < 1e-8 * np.abs(before).max()


@pytest.mark.parametrize("speed", [0.0, 0.3, 0.9999, 1.0001, 5.0, 30.0])
def test_the_bias_columns_by_differences_and_as_the_paper_prints_them(speed):
    rng = np.random.default_rng(1)
    for _ in range(10):
        q, axis = rot.quat_normalize(rng.normal(size=4)), rng.normal(size=3)
        gyr, dt = speed * axis / np.linalg.norm(axis), 0.01
        columns = by_differences(
            lambda b, q=q, g=gyr, dt=dt: turned(np.concatenate((q, b)), g, dt)[:4], np.zeros(3), 1e-4
        )
        turn = dt * gyr
        w = math.cos(0.5 * dt * speed)
        s = 0.5 * np.sinc(0.5 * dt * speed / math.pi)  # NumPy's sinc has the π in it
        found = np.array(quaternion_bias.bias_derivative.py_func(*q, dt, *turn, w, s)).T
        assert np.abs(found - columns).max() < 1e-8
        a, b, c, d = q
        psi = np.array([[b, -a, -d, c], [c, d, -a, -b], [d, -c, b, -a]]).T  # [Li2012] step (1)
        # the paper's is the first order: derivatives of exp(W) differ from ½ by at most |W|/4 of it, squares left out
        assert np.abs(found - 0.5 * dt * psi).max() <= 0.5 * dt * (0.5 * dt * speed + (dt * speed) ** 2) + 1e-15


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_the_gravity_rows_by_differences(up):
    """Columns of H: what the kernel sees of each component of q; and as papers print it, 2 g in four rows of ±q."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        q = rot.quat_normalize(rng.normal(size=4))
        h = np.array([quaternion_bias.seen.py_func(*e, *(2.0 * up * G0 * q)) for e in np.eye(4)]).T
        assert np.abs(h - by_differences(lambda p: gravity(p, up), q)).max() < 1e-8
        a, b, c, d = q
        literal = 2.0 * up * G0 * np.array([[-c, d, -a, b], [b, a, d, c], [a, -b, -c, d]])  # [Li2012] step (3)
        assert np.abs(h - literal).max() < 1e-14


def test_the_straight_line_is_the_matrix_update():
    """Gain and Joseph's form with 7 × 7 matrices, all three axes about the same prediction; rounding only."""
    rng = np.random.default_rng(3)
    for up in (1.0, -1.0):
        x = drawn(rng)
        before, q = full(x), x[Q : Q + 4].copy()
        at = x[[*range(Q, Q + 4), *range(BIAS, BIAS + 3)]].copy()
        acc, var = gravity(q, up) + rng.normal(size=3), 0.3
        h = np.hstack((by_differences(lambda v, up=up: gravity(v, up), q), np.zeros((3, 3))))
        k = before @ h.T @ np.linalg.inv(h @ before @ h.T + var * np.eye(3))
        left = np.eye(7) - k @ h
        quaternion_bias.correct_gravity.py_func(x, up, *acc, var)
        after = x[[*range(Q, Q + 4), *range(BIAS, BIAS + 3)]]
        assert np.abs(after - (at + k @ (acc - gravity(q, up)))).max() < 1e-10
        assert np.abs(full(x) - (left @ before @ left.T + var * k @ k.T)).max() < 1e-10 * np.abs(before).max()


def test_noise_is_that_of_the_rate():
    """Γ N²/Δt Γᵀ with Γ = Δt/2 Ξ(q), and K² Δt for the bias."""
    rng = np.random.default_rng(4)
    x = drawn(rng)
    q, before = x[Q : Q + 4], full(x)
    xi = np.array([rot.quat_multiply(q, [0.0, *e]) for e in np.eye(3)]).T
    quaternion_bias.add_noise.py_func(x, 0.04 * 0.01, 0.07 * 0.01)
    expected = before.copy()
    expected[:4, :4] += (0.5 * 0.01) ** 2 * 0.04 / 0.01 * xi @ xi.T
    expected[4:, 4:] += 0.07 * 0.01 * np.eye(3)
    assert np.abs(full(x) - expected).max() < 1e-17


def test_covariance_of_angles_from_covariance_of_components():
    """A small turn δ in body axes moves q by ½ q ⊗ (0, δ), so any P_δ must come back from ¼ Ξ P_δ Ξᵀ."""
    rng = np.random.default_rng(5)
    q = rot.quat_normalize(rng.normal(size=(5, 4)))
    root = rng.normal(size=(5, 3, 3))
    wanted = root @ root.transpose(0, 2, 1)
    entries = []
    for one, p in zip(q, wanted, strict=True):
        xi = np.array([rot.quat_multiply(one, [0.0, *e]) for e in np.eye(3)]).T
        entries.append((0.25 * xi @ p @ xi.T)[UPPER4])
    assert np.abs(ekf7.covariance(q, np.array(entries)) - wanted).max() < 1e-14
    x = state(q[0], np.zeros(3), np.zeros((7, 7)))
    quaternion_bias.set_covariance.py_func(x, 0.01, 0.04)
    assert np.abs(ekf7.covariance(q[:1], x[np.newaxis, P_QQ:P_QB])[0] - 0.01 * np.eye(3)).max() < 1e-16


def test_the_heading_is_held_and_the_tilt_left_alone():
    """Halving the error of the heading keeps the variance of both tilts and of the bias."""
    rng = np.random.default_rng(6)
    x = drawn(rng)
    v = rot.quat_multiply([0.0, 0.0, 0.0, 1.0], x[Q : Q + 4])  # 2 ∂q/∂heading
    p = full(x)
    p[:4, :4] += 0.3 * np.outer(v, v)
    x = state(x[Q : Q + 4], x[BIAS : BIAS + 3], p)
    quaternion_bias.hold_heading.py_func(x)
    s = np.eye(7)
    s[:4, :4] -= 0.5 * np.outer(v, v)
    assert np.abs(full(x) - s @ p @ s.T).max() < 1e-15
    held = full(x).copy()
    quaternion_bias.hold_heading.py_func(x)  # now it is below the limit
    assert (full(x) == held).all()


def test_54_degrees_turn_by_54_degrees():
    """[Li2012] (10) as printed, cos‖W‖ I + sin‖W‖/‖W‖ Ω(W), turns by 108°."""
    x = state([1.0, 0.0, 0.0, 0.0], np.zeros(3), np.zeros((7, 7)))
    quaternion_bias.predict.py_func(x, 1.0, *np.radians([0.0, 54.0, 0.0]), 0.0, 0.0)
    assert math.degrees(rot.quat_angle(x[Q : Q + 4], [1.0, 0.0, 0.0, 0.0])) == pytest.approx(54.0, abs=1e-12)


def tilt_errors(q_nb, truth, after=1.0):
    """Roll and pitch errors, degrees, from a second on, in which the unit rests and one noisy look is averaged away."""
    errors = attitude_errors(q_nb, truth.q_nb)
    late = truth.t - truth.t[0] >= after
    return np.degrees(np.stack((errors["roll"][late], errors["pitch"][late])))


# --- what it claims -----------------------------------------------------------------------------------------

N, K, ACC = math.radians(0.05), math.radians(0.003), 0.003 * G0
START_BIAS = math.radians(0.2)
ALWAYS_REST = {"rest_rate": 100.0, "rest_force": 1e3, "rest_time": 1e-3}


def matched(seed, n=400, dt=0.01):
    """Samples of a turning body whose errors are what the filter believes, and the attitude at the last."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * dt
    rate = np.sin(2 * math.pi * t[:, np.newaxis] * [0.3, 0.5, 0.2] + [0.1, 1.3, 2.2])
    q = rot.quat_multiply(rot.quat_normalize(rng.normal(size=4)), rot.quat_chained(rate[1:] * dt))
    bias = START_BIAS * rng.normal(size=3) + K * math.sqrt(dt) * rng.normal(size=(n, 3)).cumsum(axis=0)
    gyr = rate + bias + N / math.sqrt(dt) * rng.normal(size=(n, 3))
    acc = seen_by(q, Frame.ENU)["acc"] + ACC / math.sqrt(dt) * rng.normal(size=(n, 3))
    return ImuData(t=t, gyr=gyr, acc=acc, meta=ImuMeta(calibration="perfect")), q[-1], bias[-1]


def test_errors_of_tilt_and_bias_are_what_the_filter_claims():
    """NEES over 200 seeds, one look each after 4 s, against the χ² of all of them together, 95 %.

    Tilt is the two directions about which gravity turns; bias its part across gravity. The start's uncertainty is that
    of the one look which gives the attitude.
    """
    tilt, bias, seeds = 0.0, 0.0, 200
    params = {"start_angle": ACC / math.sqrt(0.01) / G0, "start_bias": START_BIAS, **ALWAYS_REST}
    for seed in range(seeds):
        data, q, b = matched(seed)
        f = Filter("ekf7", frame=Frame.ENU, params=params)
        f.process(data)
        up, true_up = up_in_body(f.q_nb), up_in_body(q)
        across = np.linalg.svd(up[np.newaxis])[2][1:]
        error = across @ np.cross(up, true_up)
        tilt += error @ np.linalg.solve(across @ f.cov_b @ across.T, error)
        error = f.bias_b - b
        bias += error @ np.linalg.solve(full(state_of(f))[4:, 4:], error)
    for total, degrees in ((tilt, 2 * seeds), (bias, 3 * seeds)):
        low, high = chi2.ppf([0.025, 0.975], degrees) / seeds
        assert low < total / seeds < high


# --- rest and motion ----------------------------------------------------------------------------------------


def test_rest_is_found_after_its_time_and_left_at_once():
    """Sample k has been quiet for k/100 s: rest from sample 100 on, one later where the sum of steps falls short."""
    gyr = np.zeros((700, 3))
    gyr[300] = math.radians(3.01)
    acc = np.tile([0.0, 0.0, G0], (700, 1))
    acc[500] *= 1.1001
    data = ImuData(t=np.arange(700) / 100.0, gyr=gyr, acc=acc)
    rest = (Filter("ekf7", frame=Frame.ENU).process(data).flags & flags.AT_REST) != 0
    starts, ends = (np.flatnonzero(np.diff(rest.astype(int)) == sign) + 1 for sign in (1, -1))
    assert ends.tolist() == [300, 500]
    assert np.abs(starts - [100, 400, 600]).max() <= 1


def test_a_missing_rate_is_no_rest_and_makes_the_attitude_uncertain():
    gyr = np.zeros((400, 3))
    gyr[200] = np.nan
    data = ImuData(t=np.arange(400) / 100.0, gyr=gyr, acc=np.tile([0.0, 0.0, G0], (400, 1)))
    track = Filter("ekf7", frame=Frame.ENU).process(data, covariance=True)
    assert (track.flags[150:202] & flags.AT_REST != 0).tolist() == [True] * 50 + [False] * 2
    grown = track.cov_b[200, 0, 0] - track.cov_b[199, 0, 0]
    assert grown == pytest.approx((ekf7.LOST_RATE * 0.01) ** 2, rel=0.5)  # one correction is in between
    # One sample of 1900 g: without the norm's say, 0.1 g of noise would take it for a tilt of some radians.
    data, _ = consistent(1000)
    acc = data.acc.copy()
    acc[500] = [1.9e4, 0.0, 0.0]
    track = Filter("ekf7", frame=Frame.ENU).process(ImuData(t=data.t, gyr=data.gyr, acc=acc))
    clean = Filter("ekf7", frame=Frame.ENU).process(ImuData(t=data.t, gyr=data.gyr, acc=data.acc))
    assert rot.quat_angle(track.q_nb, clean.q_nb).max() < math.radians(0.01)


def test_the_hard_switch_takes_the_means_of_a_second():
    """After a second of rest, tilt and bias are those of the mean sample; the heading stays where it was."""
    rng = np.random.default_rng(7)
    n = 102
    q = rot.quat_from_euler_zyx([0.7, 0.2, -0.1])
    acc = seen_by(np.tile(q, (n, 1)), Frame.ENU)["acc"] + 0.1 * rng.normal(size=(n, 3))
    gyr = np.radians([0.5, -0.2, 0.3]) + np.radians(0.3) * rng.normal(size=(n, 3))
    data = ImuData(t=np.arange(n) / 100.0, gyr=gyr, acc=acc)
    f = Filter("ekf7", frame=Frame.ENU, init=q, params={"hard_switch": True})
    track = f.process(data)
    first = int(np.argmax(track.flags & flags.AT_REST != 0))
    assert 100 <= first <= 101
    mean = acc[1 : first + 1].mean(axis=0)  # the first sample has no step
    assert np.abs(up_in_body(track.q_nb[first]) - mean / np.linalg.norm(mean)).max() < 1e-12
    assert np.abs(track.bias_b[first] - gyr[1 : first + 1].mean(axis=0)).max() < 1e-14
    # a second of the bias, 0.6°/s, that is not yet known, and of noise, turns the heading by less than 1°
    assert abs(rot.euler_zyx_from_quat(track.q_nb[first])[0] - 0.7) < math.radians(1.0)


@pytest.mark.parametrize("reset", [False, True])
def test_the_hard_switch_leaves_the_covariance_or_sets_it(reset):
    still = {"gyr": np.zeros((300, 3)), "acc": np.tile([0.0, 0.0, G0], (300, 1))}
    data = ImuData(t=np.arange(300) / 100.0, **still, meta=ImuMeta(calibration="perfect"))
    f = Filter("ekf7", frame=Frame.ENU, params={"hard_switch": True, "reset": reset})
    f.process(data[:200])
    before = state_of(f)[P_QQ : P_BB + 6]
    f.process(data[200:])
    assert (state_of(f)[P_QQ : P_BB + 6] == before).all()
    resting = (ACC / G0) ** 2  # of a mean of one second
    assert bool(f.cov_b[0, 0] == pytest.approx(resting, rel=1e-12)) is reset


def test_noise_comes_from_a_card():
    """Quadratic mean of the axes: √((3² + 4² + 5²)/3) = √(50/3); a random walk of zero is not known."""
    card = NoiseCard("unit", "test", gyr=TriadNoise([3e-4, 4e-4, 5e-4], [0.0] * 3, [0.0] * 3))
    params = Filter("ekf7", frame=Frame.NED, noise=card).params
    assert params.gyro_noise == pytest.approx(1e-4 * math.sqrt(50 / 3), rel=1e-12)
    assert params.bias_walk == ekf7.Params().bias_walk
    with pytest.raises(ParameterError, match="noise card"):
        Filter("ekf7", frame=Frame.NED, noise=NoiseCard("unit", "test", acc=card.gyr))


# --- the paper's rod ----------------------------------------------------------------------------------------


@slow_as_python
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_rod_keeps_the_paper_s_bars(seed):
    """±1° where the accelerometer alone is beyond 5° and the gyroscope drifts ten times as far [Li2012].

    The largest change of the tilt error from one sample to the next, about each switch of rest, is 0.3°. Over ten
    minutes the covariance stays positive definite, scaled to ones on its diagonal, for its entries span ten powers;
    and the variance of the heading below its limit.
    """
    run = simulate("rod", frame=Frame.NED, sensors="adis16355", unit="calibrated", seed=seed, duration=600.0)
    f = Filter("ekf7", frame=Frame.NED)
    parts = []
    for chunk in run.imu.chunks(500):
        parts.append(f.process(chunk))
        p = full(state_of(f))
        size = np.sqrt(np.diag(p))
        assert np.linalg.eigvalsh(p / np.outer(size, size)).min() > 1e-9
        up = up_in_body(f.q_nb, -1.0)
        assert up @ f.cov_b @ up < 1.01 * quaternion_bias.HEADING_LIMIT
    q_nb, words = (np.concatenate([getattr(part, of) for part in parts]) for of in ("q_nb", "flags"))
    errors = tilt_errors(q_nb, run.truth)
    assert np.abs(errors).max() <= 1.0 and np.sqrt((errors**2).mean(axis=1)).max() <= 0.25
    compass = Filter("tilt_compass", frame=Frame.NED).process(run.imu)
    assert np.abs(tilt_errors(compass.q_nb, run.truth)).max() > 5.0
    error_n = rot.quat_multiply(q_nb, rot.quat_conjugate(run.truth.q_nb))
    turn = np.linalg.norm(np.diff(rot.quat_rotate(error_n, [0.0, 0.0, -1.0]), axis=0), axis=1)
    switches = np.flatnonzero(np.diff((words & flags.AT_REST).astype(np.int64)))
    assert switches.size > 10
    assert np.degrees(turn[(switches[:, np.newaxis] + [-1, 0, 1]).ravel()]).max() <= 0.3


@pytest.mark.parametrize("quiet", [0.0, 0.25, 1.0])
@pytest.mark.parametrize("excess", [0.01, -2.0])
def test_the_noise_in_motion_falls_with_the_square_of_what_lacks_to_rest(quiet, excess):
    """From that of motion to that of rest, per second; and never below the square of what the force is off g."""
    f = Filter("ekf7", frame=Frame.ENU, params={"acc_rest": 0.03, "acc_motion": 0.1, "rest_time": 2.0})
    x = fresh_state("ekf7")
    x[ekf7.QUIET] = 2.0 * quiet
    expected = (0.03**2 + (0.1**2 - 0.03**2) * (1.0 - quiet) ** 2) / 0.01
    assert ekf7.motion_var(coefficients_of(f), x, 0.01, excess) == pytest.approx(max(expected, excess**2), rel=1e-12)


@pytest.mark.parametrize(("size", "rests"), [(1.04, True), (1.06, False), (0.96, True), (0.94, False)])
def test_rest_is_a_force_within_its_limit_of_g(size, rests):
    """(|a|² − g²) / 2g is |a| − g but for half of its square over g: 2.5 % of it at 5 %."""
    seen = seen_by(np.tile([1.0, 0.0, 0.0, 0.0], (100, 1)), Frame.ENU)
    data = ImuData(t=np.arange(100) / 50.0, gyr=np.zeros((100, 3)), acc=size * seen["acc"], mag=seen["mag"])
    track = Filter("ekf7", frame=Frame.ENU, params={"rest_force": "0.05 g"}).process(data)
    assert bool(track.flags[-1] & flags.AT_REST) is rests
