"""The multiplicative EKF: Jacobians by differences, covariance against Monte Carlo, gates, rest, sea and bad luck."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from plumbob import Filter, Frame, ImuData, ImuMeta, NoiseCard, flags, simulate
from plumbob import rotations as rot
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps
from plumbob.data.cards import TriadNoise
from plumbob.filters import mekf
from tests.helpers import slow_as_python
from tests.helpers.filter_state import coefficients_of, fresh_state, state_of
from tests.helpers.hand_motion import error_n
from tests.helpers.jacobians import by_differences
from tests.helpers.motion import FIELD_ENU, consistent, heading_sd, seen_by, tilt_between

N, B, V, COV = mekf.N, mekf.B, mekf.V, mekf.COV


def full(x):
    upper = np.triu(x[COV : COV + N * N].reshape(N, N))
    return upper + np.triu(upper, 1).T


def some_covariance(seed=0):
    a = np.random.default_rng(seed).normal(size=(N, N))
    return a @ a.T


def state_with(p):
    x = fresh_state("mekf")
    x[0] = 1.0
    x[COV : COV + N * N] = np.triu(p).ravel()
    return x


# --- Jacobians ----------------------------------------------------------------------------------------------


def test_the_step_of_attitude_and_bias_is_linearised_right():
    """θ and δb before a step of 10 ms at 1.9 rad/s make θ after it; the cubic term of J is below (0.02)³/24 of Δt."""
    dt, rate, bias = 0.01, np.array([1.2, -0.7, 1.3]), np.array([0.02, -0.01, 0.03])
    q = rot.quat_from_euler_zyx([0.5, -0.4, 2.0])
    after = rot.quat_multiply(q, rot.quat_from_rotvec((rate - bias) * dt))

    def error_after(e):
        true = rot.quat_multiply(
            rot.quat_multiply(rot.quat_from_rotvec(e[:3]), q), rot.quat_from_rotvec((rate - bias - e[3:]) * dt)
        )
        return rot.rotvec_from_quat(rot.quat_multiply(true, rot.quat_conjugate(after)))

    jacobian = by_differences(error_after, np.zeros(6), step=1e-4)
    r, u = rot.dcm_from_quat(after), (rate - bias) * dt
    effect = np.array([mekf.effect(dt, *u, *row) for row in r])
    assert np.abs(jacobian[:, :3] - np.eye(3)).max() < 1e-8 and np.abs(jacobian[:, 3:] + effect).max() < 1e-8

    f = np.eye(N)
    f[:3, 3:6] = -effect
    p = some_covariance()
    x = state_with(p)
    x[mekf.STEP_TURN : mekf.STEP_TURN + 9] = effect.ravel()
    mekf.carry(x)
    assert np.abs(full(x) - f @ p @ f.T).max() < 1e-12 * np.abs(p).max()


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_the_step_of_the_velocity_is_linearised_right(up):
    """The velocity's error grows by gravity seen through a wrong tilt."""
    dt, gravity = 0.01, np.array([0.0, 0.0, up * G0])

    def velocity_error(theta):
        return dt * (rot.quat_rotate(rot.quat_from_rotvec(theta), gravity) - gravity)[:2]

    jacobian = by_differences(velocity_error, np.zeros(3), step=1e-4)
    f = np.eye(N)
    f[V:, :3] = jacobian
    p = some_covariance(1)
    x = state_with(p)
    mekf.push(x, dt * up * G0)
    assert np.abs(full(x) - f @ p @ f.T).max() < 1e-8


@pytest.mark.parametrize("frame", [Frame.ENU, Frame.NED])
def test_the_heading_s_measurement_is_linearised_right(frame):
    """The angle from the level field to north, at an attitude whose tilt is wrong and whose field points north."""
    q = rot.quat_from_euler_zyx([0.3, 0.2, -0.5])
    field_b = seen_by(q[np.newaxis], frame)["mag"][0]
    north = frame.north

    def to_north(q_nb):
        h = rot.quat_rotate(q_nb, field_b)
        return math.atan2(h[0] * north[1] - h[1] * north[0], h[0] * north[0] + h[1] * north[1])

    wrong = rot.quat_multiply(rot.quat_from_rotvec([0.05, -0.03, 0.0]), q)
    wrong = rot.quat_multiply(rot.quat_from_rotvec([0.0, 0.0, to_north(wrong)]), wrong)
    heard, x = [], state_with(np.zeros((N, N)))
    x[COV + mekf.HEADING] = 0.01
    names = {**mekf.follow_field.py_func.__globals__, "point_north": lambda x, *numbers: heard.append(numbers) or 0.0}
    look = type(mekf.follow_field.py_func)(mekf.follow_field.py_func.__code__, names)
    look(coefficients_of(Filter("mekf", frame=frame)), x, 0.01, 0.0, *rot.quat_rotate(wrong, field_b))
    lean_x, lean_y, seen, _ = heard[0]
    jacobian = by_differences(
        lambda theta: [to_north(rot.quat_multiply(rot.quat_from_rotvec(-theta), wrong))], np.zeros(3), step=1e-5
    )[0]
    assert np.abs(jacobian - [lean_x, lean_y, 1.0]).max() < 1e-8
    assert seen == pytest.approx(0.0, abs=1e-12)


def test_an_update_is_the_textbook_s():
    """Gain P Hᵀ/s and P − P Hᵀ H P/s, [BarShalom2001] sec. 5.2.3; a heading leaves tilt and velocity as they are."""
    p, var = some_covariance(2), 3.0
    h = np.zeros(N)
    h[V] = 1.0
    x = state_with(p)
    x[mekf.ERROR : mekf.ERROR + N] = np.arange(N) / 50.0
    before = x[mekf.ERROR : mekf.ERROR + N].copy()
    s = h @ p @ h + var
    mekf.stand_still(x, 0, var)
    assert np.abs(full(x) - (p - np.outer(p @ h, h @ p) / s)).max() < 1e-12
    assert np.abs(x[mekf.ERROR : mekf.ERROR + N] - (before - p @ h * (h @ before) / s)).max() < 1e-12

    h = np.array([0.3, -0.2, 1.0, 0, 0, 0, 0, 0])
    x = state_with(p)
    s = h @ p @ h + var
    mekf.point_north(x, 0.3, -0.2, 0.1, var)
    gain = p @ h / s
    gain[[0, 1, V, V + 1]] = 0.0
    left = np.eye(N) - np.outer(gain, h)
    assert np.abs(full(x) - (left @ p @ left.T + var * np.outer(gain, gain))).max() < 1e-12  # Joseph's form
    assert (x[mekf.ERROR : mekf.ERROR + N][gain == 0.0] == 0.0).all()
    assert x[mekf.ERROR + 2] == pytest.approx((p @ h)[2] * 0.1 / s, rel=1e-12)


def test_the_zero_rate_update_counts_the_noise_that_it_shares_with_the_turn():
    """With θ ← θ − Δt R n and z = b + n the two share −R PSD(n); the textbook's form with correlated noise."""
    p, noise, dt = some_covariance(3), 0.4, 0.01
    r = rot.dcm_from_quat(rot.quat_from_euler_zyx([0.3, 0.2, -0.5]))
    x = state_with(p)
    mekf.zero_rate(x, 1, 0.2, noise, dt, *r[:, 1])
    h = np.eye(N)[B + 1]
    shared = np.concatenate((-r[:, 1] * noise, np.zeros(5)))
    column, s = p @ h + shared, p[B + 1, B + 1] + noise / dt
    assert np.abs(full(x) - (p - np.outer(column, column) / s)).max() < 1e-12
    assert np.abs(x[mekf.ERROR : mekf.ERROR + N] - column * 0.2 / s).max() < 1e-12


# --- covariance against Monte Carlo -------------------------------------------------------------------------

SEEDS, RATE, SECONDS = 120, 100.0, 60
MATCHED = {"mag_bend": deg(5.0), "mag_lasts": 0.5 / RATE}  # white, as the filter takes it


def coloured(rng, sd, lasts, shape):
    """Gauss-Markov noise along the last axis."""
    phi = math.exp(-1.0 / (RATE * lasts))
    steps = sd * math.sqrt(1.0 - phi * phi) * rng.normal(size=shape)
    steps[..., 0] = sd * rng.normal(size=shape[:-1])
    return lfilter([1.0], [1.0, -phi], steps, axis=-1)


def matched(turning):
    """Recordings whose noise is what the filter's parameters say, one a seed, with attitude and bias at their end."""
    rng = np.random.default_rng(11)
    p = Filter("mekf", frame=Frame.ENU, params=MATCHED).params
    n = int(RATE * SECONDS)
    t = np.arange(n) / RATE
    phase, f = rng.uniform(0.0, 2 * np.pi, (SEEDS, 3, 1)), rng.uniform(0.05, 0.5, (SEEDS, 3, 1))
    rate = turning * np.sin(2 * np.pi * f * t + phase).transpose(2, 0, 1)
    q = np.empty((n, SEEDS, 4))
    q[0] = rot.quat_normalize(rng.normal(size=(SEEDS, 4)))
    turns = rot.quat_from_rotvec(rate / RATE)
    for i in range(1, n):
        q[i] = rot.quat_multiply(q[i - 1], turns[i])
    bias = p.bias_start * rng.normal(size=(SEEDS, 3)) + np.cumsum(
        p.gyr_walk / math.sqrt(RATE) * rng.normal(size=(n, SEEDS, 3)), axis=0
    )
    density2 = p.gyr_noise**2 + p.gyr_scale**2 * np.sum(rate * rate, axis=-1, keepdims=True)
    gyr = rate + bias + np.sqrt(density2 * RATE) * rng.normal(size=(n, SEEDS, 3))
    level = np.gradient(coloured(rng, p.speed, p.speed_lasts, (SEEDS, 2, n)), axis=-1) * RATE
    force = np.concatenate((level, np.full((SEEDS, 1, n), G0)), axis=1).transpose(2, 0, 1)
    acc = rot.quat_rotate(rot.quat_conjugate(q), force) + p.acc_noise * math.sqrt(RATE) * rng.normal(size=(n, SEEDS, 3))
    bend = p.mag_bend * rng.normal(size=(n, SEEDS))
    field = np.stack((FIELD_ENU[1] * np.sin(bend), FIELD_ENU[1] * np.cos(bend), np.full_like(bend, -43.0)), axis=-1)
    mag = rot.quat_rotate(rot.quat_conjugate(q), field) + p.mag_noise * math.sqrt(RATE) * rng.normal(size=(n, SEEDS, 3))
    for k in range(SEEDS):
        yield ImuData(t=t, gyr=gyr[:, k], acc=acc[:, k], mag=mag[:, k]), q[-1, k], bias[-1, k]


@slow_as_python
def test_errors_fit_the_covariance_that_is_claimed():
    """NEES of tilt, heading and bias over the seeds, one look each: inside the 95 % bounds of their chi-square laws."""
    sums, nis = np.zeros(3), []
    for data, q, bias in matched(1.0):
        f = Filter("mekf", frame=Frame.ENU, params=MATCHED)
        f.process(data)
        x = state_of(f)
        p = full(x)
        theta = error_n(f.q_nb, q)
        error = bias - f.bias_b
        sums += (
            theta[:2] @ np.linalg.solve(p[:2, :2], theta[:2]),
            theta[2] ** 2 / p[2, 2],
            error @ np.linalg.solve(p[B:V, B:V], error),
        )
        nis.append(x[mekf.NIS : mekf.NIS + 2])
    for total, degrees in zip(sums, (2, 1, 3), strict=True):
        low, high = chi2.ppf([0.025, 0.975], degrees * SEEDS) / SEEDS
        assert low < total / SEEDS < high
    # Innovations: the last ones. A single velocity holds less than the density of its whole process says.
    velocity, heading = np.mean(nis, axis=0)
    assert velocity < chi2.ppf(0.975, 2 * SEEDS) / SEEDS
    low, high = chi2.ppf([0.025, 0.975], SEEDS) / SEEDS
    assert low < heading < high


def test_the_covariance_is_that_of_the_body_axes():
    """A heading that nothing has seen is uncertain about the vertical, wherever the body's axes point."""
    data, _ = consistent(500)
    track = Filter("mekf", frame=Frame.ENU).process(ImuData(t=data.t, gyr=data.gyr, acc=data.acc), covariance=True)
    heading = heading_sd(track.q_nb, track.cov_b) ** 2
    total = np.trace(track.cov_b, axis1=1, axis2=2)
    assert np.abs(heading / mekf.FREE - 1.0).max() < 1e-6  # tilts are known a little, and have it in common
    assert (total - heading < 2.0 * mekf.DOUBTFUL).all()


# --- at sea, in hand, at rest -------------------------------------------------------------------------------


def test_a_buoy_in_waves_keeps_its_horizon_and_knows_how_well():
    """Bar of the buoy paper's page: 0.2° rms roll and pitch; and 95 % of the tilts within the 99.9 % bound claimed."""
    run = simulate("buoy", frame=Frame.ENU, sensors="mpu6000+hmc5983", unit="calibrated", seed=3, duration=200.0)
    track = Filter("mekf", frame=Frame.ENU).process(run.imu, covariance=True)
    rows = run.imu.t > 60.0
    error = error_n(track.q_nb, run.truth.q_nb)[rows]
    assert np.sqrt(np.mean(error[:, :2] ** 2, axis=0)).max() < math.radians(0.2)
    c_nb = rot.dcm_from_quat(track.q_nb[rows])
    p_n = (c_nb @ track.cov_b[rows] @ np.swapaxes(c_nb, 1, 2))[:, :2, :2]
    nees = np.einsum("ni,ni->n", error[:, :2], np.linalg.solve(p_n, error[:, :2, np.newaxis])[..., 0])
    assert np.mean(nees < chi2.ppf(0.999, 2)) > 0.95


@pytest.mark.parametrize(("speed", "time"), [(2.0, 0.4), (3.0, 0.8), (2.0, 0.8), (1.0, 0.6)])
def test_strokes_on_a_desk_stay_below_the_bar_of_the_page(speed, time):
    """Roll and pitch at most 1.2° in all four sets of strokes; the paper itself reached 3.3° with its gate."""
    run = simulate(
        "slide", frame=Frame.NED, sensors="mpu6000+hmc5983", unit="calibrated", seed=1, peak_speed=speed, stroke=time
    )
    q = Filter("mekf", frame=Frame.NED).process(run.imu).q_nb
    assert np.abs(error_n(q, run.truth.q_nb)[run.imu.t > 2.0, :2]).max() < math.radians(1.2)


def test_rest_finds_the_bias_and_a_slow_turn_is_no_rest():
    rng = np.random.default_rng(2)
    n = 3000
    t = np.arange(n) / 100.0
    bias = dps(np.array([0.7, -0.4, 0.2]))
    noise = dps(0.05) * rng.normal(size=(n, 3))
    level = {"acc": [0.0, 0.0, G0] + 0.02 * rng.normal(size=(n, 3)), "mag": FIELD_ENU + 0.3 * rng.normal(size=(n, 3))}
    f = Filter("mekf", frame=Frame.ENU)
    track = f.process(ImuData(t=t, gyr=bias + noise, **level))
    assert (track.flags[200:] & flags.AT_REST != 0).all()
    # mean of N/100 s samples of 0.05°/s, from 1.5 s on: √(0.05² / 2850) = 0.001°/s; four of them
    assert np.abs(f.bias_b - bias).max() < dps(0.004)

    turning = ImuData(t=t + 30.0, gyr=bias + noise + [0.0, 0.0, dps(1.0)], acc=level["acc"])
    after = f.process(turning)
    assert not (after.flags[100:] & flags.AT_REST != 0).any()
    assert np.abs(f.bias_b - bias).max() < dps(0.05)


def test_a_magnet_is_rejected():
    """Field turned by 40° and 30 % stronger for 15 s: heading within 1°; after 20 s of turning it would be a place."""
    data, q = consistent(4500)
    turned = 1.3 * rot.quat_rotate(rot.quat_from_euler_zyx([0.7, 0.0, 0.0]), FIELD_ENU)
    mag = np.concatenate((data.mag[:3000], rot.quat_rotate(rot.quat_conjugate(q[3000:]), turned)))
    alive = 1e-9 * np.random.default_rng(0).normal(size=data.gyr.shape)
    track = Filter("mekf", frame=Frame.ENU).process(ImuData(t=data.t, gyr=data.gyr + alive, acc=data.acc, mag=mag))
    assert rot.quat_angle(track.q_nb, q)[3000:].max() < math.radians(1.0)
    gated = track.flags & flags.MAG_GATED != 0
    assert gated[3100:].mean() > 0.3  # the field is looked at in every third sample, at this rate


def test_a_gyroscope_s_bias_that_jumps_is_noticed_and_learned():
    """Reliability figure F6: 5°/s on every axis; flagged, and within 1° after 30 s, the tilt after 10 s."""
    rng = np.random.default_rng(4)
    data, q = consistent(8000)
    sd = {"gyr": dps(0.1), "acc": 0.03, "mag": 0.3}
    triads = {name: getattr(data, name) + of * rng.normal(size=data.gyr.shape) for name, of in sd.items()}
    triads["gyr"][3000:] += dps(5.0)
    track = Filter("mekf", frame=Frame.ENU).process(ImuData(t=data.t, **triads))
    assert (track.flags[3000:3500] & flags.INCONSISTENT != 0).any()
    assert tilt_between(track.q_nb[4000:], q[4000:]).max() < math.radians(1.0)
    assert rot.quat_angle(track.q_nb[6000:], q[6000:]).max() < math.radians(1.0)


def test_a_clipped_gyroscope_makes_the_attitude_uncertain_and_it_begins_again():
    data, q = consistent(2000, amplitude=1.0)
    late = data.t >= 10.0
    # so that nothing else shows the end of the range
    noise = np.random.default_rng(0).normal(0.0, 1e-6, data.gyr.shape)
    gyr = np.where(late[:, np.newaxis], np.clip(data.gyr, -0.5, 0.5) + noise, data.gyr)  # that the motion leaves
    words = np.where((np.abs(gyr) >= 0.49999).any(axis=1) & late, flags.GYR_CLIPPED, 0)
    same = {"t": data.t, "gyr": gyr, "acc": data.acc, "mag": data.mag, "meta": ImuMeta(gyr_range=3.0)}
    unsaid, said = (Filter("mekf", frame=Frame.ENU).process(ImuData(**same, **more)) for more in ({}, {"flags": words}))
    assert rot.quat_angle(said.q_nb, q).max() < 0.5 * rot.quat_angle(unsaid.q_nb, q).max()


# --- parameters ---------------------------------------------------------------------------------------------


def test_noise_comes_from_a_card_and_parameters_have_the_last_word():
    """Quadratic mean of the axes: √((3² + 4² + 5²)/3) = √(50/3)."""
    none = [0.0] * 3
    gyr, mag = TriadNoise([3e-4, 4e-4, 5e-4], none, [1e-5] * 3), TriadNoise([0.2] * 3, none, none)
    card = NoiseCard("unit", "test", gyr=gyr, mag=mag)
    p = Filter("mekf", frame=Frame.NED, noise=card, params={"mag_noise": 0.5}).params
    assert p.gyr_noise == pytest.approx(1e-4 * math.sqrt(50 / 3), rel=1e-12)
    assert (p.gyr_walk, p.mag_noise) == (pytest.approx(1e-5), 0.5)
    assert p.acc_noise == mekf.Params().acc_noise
