"""The two sweeps: each step against differences of what it linearises, and both against dense textbook forms."""

import math
from dataclasses import astuple
from types import SimpleNamespace

import numpy as np
import pytest

from plumbob import ImuData
from plumbob import rotations as rot
from plumbob.core.constants import G0
from plumbob.filters.smoother import Params, sweeps
from plumbob.filters.smoother.inertial import kinds
from plumbob.filters.smoother.keyframes import Keyframes
from plumbob.filters.smoother.model import BEND, KEPT, SIZE, TH, A, B, M, ModelVariances, V, start_covariance
from plumbob.filters.smoother.sweeps import (
    AGAIN,
    FADE,
    FORGOTTEN,
    HEADING,
    INVERSE,
    KIND,
    LASTING,
    LIFT,
    MOVING,
    RESTING,
    SEVERED,
    TIME,
)
from tests.helpers import in_the_other_mode
from tests.helpers.hand_motion import by_hand
from tests.helpers.jacobians import by_differences
from tests.helpers.smoother_pieces import digest

SEEDS = range(5)


def spd(rng, n=SIZE, ridge=1.0):
    """A covariance of no special form, well conditioned."""
    a = rng.normal(size=(n, n)) / math.sqrt(n)
    return a @ a.T + ridge * np.eye(n)


# --- a step against differences of the true model -----------------------------------------------------------


def transition(f):
    """F of a step, as its rows: λ ← Fᵀ λ of each unit vector."""
    rows = np.eye(SIZE)
    for row in rows:
        sweeps.back_over(row, np.zeros((SIZE, SIZE)), f)
    return rows


def samples_of_a_step(rng, still):
    """Eleven samples of 5 ms with rates to 3 rad/s, and forces; where `still`, such that nothing is accelerated."""
    t = np.concatenate(([0.0], np.cumsum(rng.uniform(0.003, 0.007, 10))))
    gyr, acc, mag = rng.uniform(-3.0, 3.0, (11, 3)), rng.normal(0.0, 4.0, (11, 3)), rng.normal(size=(11, 3))
    q, x = rot.quat_normalize(rng.normal(size=4)), np.zeros(SIZE)
    x[B : B + 3], x[A : A + 3], x[M:] = rng.normal(0, 0.05, 3), rng.normal(0, 0.05, 3), rng.normal(0, 0.01, 9)
    if still:
        acc[1:] = rot.quat_rotate(rot.quat_conjugate(attitudes(t, gyr, q, x)[1]), [0.0, 0.0, G0]) + x[A : A + 3]
    return t, gyr, acc, mag, q, x


def attitudes(t, gyr, q, x):
    """Attitude behind the last sample, and in the middle of each; the true model, by the package's rotations alone."""
    halves = 0.5 * np.diff(t)[:, np.newaxis] * (gyr[1:] @ (np.eye(3) - x[M:].reshape(3, 3)).T - x[B : B + 3])
    way = rot.quat_multiply(q, rot.quat_chained(np.repeat(halves, 2, axis=0)))
    return way[-1], way[1::2]


def stepped(samples):
    """What the kernel makes of a step: attitude, transition and means."""
    t, gyr, acc, mag, q, x = samples
    f, mean, after = np.empty(sweeps.STEP), np.empty(sweeps.MEANS), q.copy()
    rough = sweeps.integrate(0, t.size - 1, t, gyr, acc, mag, MOVING, after, x, f, mean)
    f[FADE] = f[LASTING] = 1.0
    return after, f, mean, rough


def true_errors(samples):
    """Errors behind a step as a function of those before it: attitude and level velocity, (5,)."""
    t, gyr, acc, _, q, x = samples

    def run(e):
        change = np.zeros(SIZE)
        change[B : B + 3], change[A:] = e[B : B + 3], e[A:]
        end, middles = attitudes(t, gyr, rot.quat_multiply(rot.quat_from_rotvec(e[:3]), q), x + change)
        force = acc[1:] - (x + change)[A : A + 3]
        return end, e[V : V + 2] + np.diff(t) @ rot.quat_rotate(middles, force)[:, :2]

    end, velocity = run(np.zeros(SIZE))

    def errors(e):
        other, moved = run(e)
        return np.concatenate(
            (rot.rotvec_from_quat(rot.quat_multiply(other, rot.quat_conjugate(end))), moved - velocity)
        )

    return errors


@pytest.mark.parametrize("seed", SEEDS)
def test_the_attitude_of_a_step_is_linearised_right(seed):
    """θ behind a step by θ, δb and δM before it.

    The right Jacobian of a turn φ about its middle is 1 − φ²/24 across it (its series to second order), and a
    sample turns by at most √27 rad/s × 7 ms = 0.037 rad: the error is below 6e-5 of the column's size.
    """
    samples = samples_of_a_step(np.random.default_rng(seed), still=False)
    after, f, _, _ = stepped(samples)
    assert np.abs(after - attitudes(*samples[:2], *samples[4:])[0]).max() < 1e-14
    found, expected = transition(f)[:3], by_differences(true_errors(samples), np.zeros(SIZE), step=1e-4)[:3]
    scale = np.concatenate((np.ones(3), np.full(9, f[TIME]), np.full(9, 3.0 * f[TIME])))
    assert np.abs((found - expected) / scale).max() < 6e-5
    assert np.abs(expected[:, M:]).max() > 0.1 * f[TIME]  # or it could not fail


@pytest.mark.parametrize("seed", SEEDS)
def test_the_velocity_of_a_step_is_linearised_right(seed):
    """δv by θ, δv and δa, where nothing accelerates; with δb and δM it changes by g T²/2, which is left to θ."""
    samples = samples_of_a_step(np.random.default_rng(seed), still=True)
    _, f, mean, rough = stepped(samples)
    found, expected = transition(f)[V : V + 2], by_differences(true_errors(samples), np.zeros(SIZE), step=1e-4)[3:]
    exact = [*range(TH, TH + 3), V, V + 1, *range(A, A + 3)]
    assert np.abs(found[:, exact] - expected[:, exact]).max() < 1e-8
    assert f[LIFT] == pytest.approx(G0 * f[TIME], rel=1e-12)
    assert np.abs(mean[sweeps.FORCE : sweeps.FORCE + 2]).max() < 1e-12
    assert rough < 1e-20
    left_out = np.abs(found - expected)
    assert left_out[:, B : B + 3].max() < 0.51 * G0 * f[TIME] ** 2
    assert left_out[:, M:].max() < 3.0 * 0.51 * G0 * f[TIME] ** 2


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", [MOVING, RESTING, AGAIN])
def test_covariances_go_through_the_same_transition(seed, kind):
    """P ← F P Fᵀ forward, Λ ← Fᵀ Λ F backward, with the F of the row above, to rounding."""
    rng = np.random.default_rng(seed)
    _, f, _, _ = stepped(samples_of_a_step(rng, still=False))
    f[KIND], f[FADE], f[LASTING] = kind, 0.7, 0.8
    full = transition(f)
    back, information = np.zeros(SIZE), spd(rng)
    expected = full.T @ information @ full
    sweeps.back_over(back, information, f)
    assert np.abs(information - expected).max() < 1e-13
    f[FADE] = 1.0
    full = transition(f)
    if kind == AGAIN:  # nothing of attitude and velocity passes, and all else does
        kept = np.setdiff1d(np.arange(SIZE), [TH, TH + 1, TH + 2, V, V + 1])
        assert (full[np.ix_(kept, kept)] == np.eye(kept.size)).all()
        assert np.count_nonzero(full) == kept.size
        return
    p = spd(rng)
    before = p.copy()
    sweeps.propagate_velocity(p, f)
    if kind == MOVING:
        sweeps.propagate_attitude(p, f)
    assert np.abs(p - full @ before @ full.T).max() < 1e-13


# --- backward against Rauch, Tung and Striebel --------------------------------------------------------------

H = np.zeros((sweeps.MEASURED, SIZE))
"""What each scalar at a keyframe measures, in the order in which it is used: tilt, velocity, rates, heading."""
H[sweeps.TILT, TH] = H[sweeps.TILT + 1, TH + 1] = 1.0
H[sweeps.EAST, V] = H[sweeps.EAST + 1, V + 1] = 1.0
H[HEADING, TH + 2] = H[HEADING, BEND] = 1.0
for i in range(3):
    H[sweeps.RATE + i, B + i] = 1.0
ORDER = (
    sweeps.TILT,
    sweeps.TILT + 1,
    sweeps.EAST,
    sweeps.EAST + 1,
    sweeps.RATE,
    sweeps.RATE + 1,
    sweeps.RATE + 2,
    HEADING,
)


def textbook(rng, n=40):
    """A linear system of the smoother's form with numbers of order 1, filtered and smoothed by dense algebra.

    Moving, resting, new starts, forgotten velocities and steps behind which all is another by turns; every third
    heading is missing, and every second tilt. What `backward` takes, and what it must give: smoothed error (n + 1, 21)
    with its covariance, [Rauch1965].
    """
    step, gain, term = (
        np.zeros((n, sweeps.STEP)),
        np.zeros((n, sweeps.MEASURED, SIZE)),
        np.zeros((n, sweeps.MEASURED, sweeps.TERMS)),
    )
    kind = rng.choice([MOVING, MOVING, MOVING, RESTING, AGAIN], n)
    kind[n - 5], forgets = SEVERED, rng.random(n) < 0.2
    step[:, sweeps.TURN : LIFT] = rng.normal(0.0, 0.2, (n, LIFT))
    step[:, LIFT], step[:, FADE], step[:, KIND] = rng.normal(0.0, 0.5, n), rng.uniform(0.7, 0.99, n), kind
    step[:, LASTING], step[:, FORGOTTEN] = rng.uniform(0.7, 1.0, n), forgets
    start, p = spd(rng), spd(rng)
    start[:, 3:6] = start[3:6] = start[:, 8:] = start[8:] = 0.0  # only attitude and velocity start again
    before, after, moved, shifts = [], [p], [], []
    for k in range(n):
        f = np.zeros((SIZE, SIZE)) if kind[k] == SEVERED else transition(step[k])
        noise = np.diag(np.r_[rng.uniform(0.01, 0.1, 9), np.zeros(12)])
        p = f @ p @ f.T + noise + (start if kind[k] == AGAIN else spd(rng) if kind[k] == SEVERED else 0.0)
        p[V : V + 2, V : V + 2] += 4.0 * np.eye(2) * forgets[k]
        before.append(p)
        shift = np.zeros(SIZE)
        for m in ORDER:
            if (
                kind[k] == SEVERED
                or (m == HEADING and k % 3 == 0)
                or (m >= sweeps.TILT and k % 2 == 0)
                or (sweeps.RATE <= m < sweeps.TILT and kind[k] != RESTING)
                or (m < 2 and (kind[k] == AGAIN or forgets[k]))
            ):
                continue
            s = H[m] @ p @ H[m] + rng.uniform(0.5, 2.0)
            residual, gain[k, m] = 0.05 * rng.normal(), p @ H[m] / s
            shift, p = shift + gain[k, m] * residual, p - s * np.outer(gain[k, m], gain[k, m])
            term[k, m, sweeps.RESIDUAL], term[k, m, INVERSE] = residual, 1.0 / s
        after.append(p)
        moved.append(f)
        shifts.append(shift)
    smoothed, spread = [np.zeros(SIZE)], [p]
    for k in range(n - 1, -1, -1):
        c = after[k] @ moved[k].T @ np.linalg.inv(before[k])
        smoothed.append(c @ (shifts[k] + smoothed[-1]))
        spread.append(after[k] + c @ (spread[-1] - before[k]) @ c.T)
    return (np.array(after), gain, term, step), np.array(smoothed[::-1]), np.array(spread[::-1])


@pytest.mark.parametrize("seed", SEEDS)
def test_backward_is_rauch_tung_and_striebel_s(seed):
    """[Rauch1965] on the same system in dense algebra, whose inverses leave 1e-12; to 1e-10 of it."""
    rng = np.random.default_rng(seed)
    (p, gain, term, step), smoothed, spread = textbook(rng)
    n = len(step)
    q, x = np.tile([1.0, 0.0, 0.0, 0.0], (n + 1, 1)), rng.normal(size=(n + 1, SIZE))
    q_s, x_s, cov_s = np.empty((n + 1, 4)), np.empty((n + 1, KEPT)), np.empty((n + 1, 6, 6))
    later = np.zeros(SIZE), np.zeros((SIZE, SIZE))
    sweeps.backward(q, x, np.ascontiguousarray(p[:, :KEPT]), gain, term, step, *later, q_s, x_s, cov_s)
    scale = np.abs(smoothed).max()
    assert scale > 0.05
    assert np.abs(rot.rotvec_from_quat(q_s) - smoothed[:, :3]).max() < 1e-10 * max(scale, 1.0)
    assert np.abs(x_s[:, 3:] - (x + smoothed)[:, 3:KEPT]).max() < 1e-10 and (x_s[:, :3] == 0.0).all()
    assert np.abs(cov_s - spread[:, :6, :6]).max() < 1e-10
    assert np.abs(spread[0, :6, :6] - p[0, :6, :6]).max() > 0.1  # smoothing did something


@pytest.mark.parametrize("seed", SEEDS)
def test_what_goes_back_stays_symmetric_and_positive(seed):
    """Λ is a covariance: symmetric, no eigenvalue below zero, but for rounding; and λ moves within it."""
    (_, gain, term, step), _, _ = textbook(np.random.default_rng(seed))
    lam, big, y = np.zeros(SIZE), np.zeros((SIZE, SIZE)), np.zeros(SIZE)
    for k in range(len(step) - 1, -1, -1):
        sweeps.back_to_the_last(lam, big, y, gain[k], term[k], step[k])
        size = np.abs(big).max()
        assert np.abs(big - big.T).max() <= 1e-14 * size and np.linalg.eigvalsh(big).min() >= -1e-13 * size
    assert size > 0.1
    assert np.abs(lam).max() > 0.0


# --- forward against a dense filter -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def recorded():
    """Six seconds: moving, at rest from 2 to 4 s, a gap of a minute at 5 s, no field in every third sample."""
    h = by_hand(6.0, rest=((2.0, 4.0),), seed=3)
    t = np.where(h.t < 5.0, h.t, h.t + 60.0)
    mag = np.where(np.arange(t.size)[:, np.newaxis] % 3 == 0, np.nan, h.mag)
    frames, params = Keyframes.from_imu(ImuData(t=t, gyr=h.gyr, acc=h.acc, mag=mag), 0.049), Params()
    at_rest = np.interp(frames.middle, [2.4, 2.5, 3.5, 3.6], [0, 1, 1, 0]) == 1.0
    n = frames.gap.size
    given = {
        "frames": frames, "kind": kinds(frames, at_rest), "velocity": np.full(n, 0.01),
        "lasting": np.linspace(0.9, 1.0, n),
        "heading": np.where(np.arange(n) % 5 == 0, 2.0 * sweeps.UNUSED, 0.01),
        "start": np.tile([1.0, 0.0, 0.0, 0.0], (n + 1, 1)),
    }  # fmt: skip
    p0 = start_covariance(params, tilt=0.2, heading=0.5, bias=0.05, rigid=False)
    return SimpleNamespace(**given, n=n, p0=p0, noise=ModelVariances.from_params(params, 0.05))


def passed(r):
    n, frames = r.n, r.frames
    q, x, cov = np.empty((n + 1, 4)), np.empty((n + 1, SIZE)), np.empty((n + 1, KEPT, SIZE))
    gain, term = np.zeros((n, sweeps.MEASURED, SIZE)), np.zeros((n, sweeps.MEASURED, sweeps.TERMS))
    step, mean = np.empty((n, sweeps.STEP)), np.empty((n, sweeps.MEANS))
    sweeps.forward(
        frames.t, frames.gyr, frames.acc, frames.mag, frames.first, r.kind, frames.missed, frames.pushed, r.velocity,
        r.lasting, r.heading, r.start, r.p0, r.noise, r.start[0].copy(), np.zeros(SIZE), r.p0.copy(), q, x, cov, gain,
        term, step, mean,
    )  # fmt: skip
    return q, x, cov, gain, term, step, mean


def test_forward_is_the_textbook_s_filter(recorded):
    """P after every keyframe, by dense algebra from the same steps and means, [BarShalom2001] sec. 5.2.3."""
    frames, noise, p0, kind = recorded.frames, recorded.noise, recorded.p0, recorded.kind
    density, heading = recorded.velocity, recorded.heading
    q, x, cov, gain, term, step, mean = passed(recorded)
    assert {MOVING, RESTING, AGAIN} == set(kind.tolist())
    p, used = p0, 0
    for k in range(frames.gap.size):
        f, dt, u = transition(step[k]), step[k, TIME], mean[k]
        before = p[TH + 2, TH + 2]
        p = f @ p @ f.T
        grown = np.zeros(SIZE)
        grown[B : B + 3], grown[BEND] = noise.walk * dt, noise.bend * (1.0 - step[k, FADE] ** 2)
        if kind[k] == AGAIN:
            for i in (0, 1, 2, V, V + 1):
                p[i, i] = p0[i, i]
            assert before + frames.missed[k] > p0[TH + 2, TH + 2]  # no better known by the bridge
        else:
            turned = noise.gyr * dt + noise.nonlinearity * u[sweeps.ROUGH] + frames.missed[k]
            grown[:3] = turned if kind[k] == MOVING else sweeps.REST_JITTER * dt
            rough = sweeps.integrate(
                frames.first[k], frames.first[k + 1], frames.t, frames.gyr, frames.acc, frames.mag, kind[k],
                q[k].copy(), x[k], np.empty(sweeps.STEP), np.empty(sweeps.MEANS),
            )  # fmt: skip
            grown[V] = grown[V + 1] = noise.acc * (dt + 0.5 * rough) + frames.pushed[k]
        p = p + np.diag(grown)
        for m in ORDER:
            if term[k, m, INVERSE] == 0.0:
                continue
            used += 1
            var = {0: density[k] / dt, 1: density[k] / dt, HEADING: heading[k]}.get(m, noise.rest / dt)
            if m == HEADING:  # the tilt counts as noise, [Schmidt1966]
                east, north, up = u[sweeps.FIELD : sweeps.FIELD + 3]
                var += up**2 / (east**2 + north**2) * p[TH + 1, TH + 1]
            s = max(H[m] @ p @ H[m] + var, term[k, m, sweeps.RESIDUAL] ** 2 / 9.0)
            assert term[k, m, INVERSE] == pytest.approx(1.0 / s, rel=1e-9)
            assert np.abs(gain[k, m] - p @ H[m] / s).max() < 1e-9 * np.abs(gain[k, m]).max()
            p = p - np.outer(p @ H[m], H[m] @ p) / s
        sd = np.sqrt(np.diag(p))
        assert np.abs((cov[k + 1] - p[:KEPT]) / np.outer(sd[:KEPT], sd)).max() < 1e-9
        assert (term[k, HEADING, INVERSE] > 0.0) == (u[sweeps.COUNT] > 0.0 and k % 5 != 0)
    assert used > 2 * np.count_nonzero(kind != AGAIN)


def swept(r, bias=0.0):
    return sweeps.sweep(
        r.frames, r.kind, r.velocity, r.lasting, r.heading, r.start, np.full(3, bias), np.zeros(9), r.p0, r.noise
    )


def test_the_smoothed_covariance_is_one_and_no_larger_than_the_filtered(recorded):
    """Symmetric, no eigenvalue below zero; later measurements take uncertainty away at every keyframe."""
    filtered, smoothed = passed(recorded)[2][:, :6, :6], swept(recorded).cov
    scale = 1.0 / np.sqrt(np.diagonal(filtered, axis1=1, axis2=2))
    scaled, larger = (c * scale[:, :, np.newaxis] * scale[:, np.newaxis] for c in (smoothed, filtered))
    assert (smoothed == np.swapaxes(smoothed, 1, 2)).all()
    assert np.linalg.eigvalsh(scaled).min() > 0.0
    assert np.linalg.eigvalsh(larger - scaled).min() > -1e-9
    assert np.linalg.eigvalsh(scaled[0]).max() < 0.1  # the first attitude is known tenfold better from all


@pytest.mark.parametrize("block", [1, 7, 64])
def test_a_sweep_in_blocks_is_that_in_one(recorded, block, monkeypatch):
    """To the bit: the way forward is gone again from what it was at the start of each block."""
    assert recorded.n < sweeps.BLOCK
    *whole, last, way = astuple(swept(recorded, 0.01))
    monkeypatch.setattr(sweeps, "BLOCK", block)
    *parts, end, none = astuple(swept(recorded, 0.01))
    assert (len(way), none) == (6, None)
    assert all(np.array_equal(*pair, equal_nan=True) for pair in zip((*whole, *last), (*parts, *end), strict=True))


def test_compiled_and_plain_python_give_the_same_bits():
    code = "from tests.helpers.smoother_pieces import digest; given = digest()"
    assert in_the_other_mode(code) == digest()


@pytest.mark.parametrize("wider", [True, False], ids=["wider", "as wide"])
@pytest.mark.parametrize("mean", [0.0, 0.03])
def test_another_prior_of_scale_and_axes_gives_what_the_measurements_would_have_given_with_it(mean, wider):
    """Twelve linear measurements of all states, by the closed form of a Gaussian posterior, with either prior."""
    rng = np.random.default_rng(3)
    before, mean = np.full(9, 0.008**2), np.full(9, mean)
    after = rng.uniform(0.01, 0.05, 9) ** 2 if wider else before
    seen, noise = rng.normal(size=(12, SIZE)), rng.uniform(0.01, 0.1, 12) ** 2
    values = seen @ rng.normal(0.0, 0.05, SIZE)

    def posterior(mean, matrix):
        prior = np.concatenate((np.full(M, 0.1**2), matrix))
        cov = np.linalg.inv(np.diag(1.0 / prior) + seen.T @ (seen / noise[:, np.newaxis]))
        return cov @ (seen.T @ (values / noise) + np.concatenate((np.zeros(M), mean / matrix))), cov

    (x, cov), (x_wide, cov_wide) = posterior(mean, before), posterior(0.0 * mean, after)
    last, shift = sweeps.Last(np.array([1.0, 0.0, 0.0, 0.0]), x, cov).with_prior(mean, before, after)
    assert np.abs(last.cov - cov_wide).max() < 1e-9 * np.abs(cov_wide).max()
    assert np.abs(x + shift - x_wide).max() < 1e-10
    assert np.abs(rot.rotvec_from_quat(last.attitude) - x_wide[:3]).max() < 1e-10 and (last.state[:3] == 0.0).all()
