"""What the smoother claims: errors over many units whose noise is that of the model, against its covariance."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from plumbob import ImuData, ImuMeta, NoiseCard, flags
from plumbob import rotations as rot
from plumbob.core.constants import G0
from plumbob.core.units import deg
from plumbob.data.cards import TriadNoise
from plumbob.data.cards.residuals import uncalibrated
from plumbob.filters.smoother import Params, Smoother
from plumbob.filters.smoother.field import LEAST_BEND, LEAST_NOISE, Reference, direction_scatter
from plumbob.filters.smoother.keyframes import Keyframes
from plumbob.filters.smoother.model import BIAS_REPEATS
from tests.helpers.hand_motion import CALIBRATED, by_hand, error_n, rms_deg
from tests.helpers.motion import heading_sd
from tests.helpers.smoother_pieces import in_stretches

UNITS, RATE, SECONDS = 30, 100.0, 30.0
ESTIMATED = {"acc_offset": 0.0, "latency": 0.0, "latency_sd": 0.0, "mag_direction_sd": 0.0}
"""What is only counted, and not in these recordings."""


def markov(rng, sd, lasts, columns):
    """First-order Gauss-Markov noise down the rows."""
    phi, n = math.exp(-1.0 / (RATE * lasts)), round(RATE * SECONDS)
    steps = sd * math.sqrt(1.0 - phi * phi) * rng.normal(size=(n, columns))
    steps[0] = sd * rng.normal(size=columns)
    return lfilter([1.0], [1.0, -phi], steps, axis=0)


def unit(seed, p, *, speed, rest):
    """Recording of a unit drawn from the model's own priors and noise, with its truth and its bias."""
    rng, white = np.random.default_rng(1000 + seed), math.sqrt(RATE)
    still = speed == 0.0
    h = by_hand(SECONDS, RATE, rest=rest, turn=0.0 if still else 1.0, speed=0.0, seed=seed, noise=None)
    n = h.t.size
    bias = deg(1.0) * rng.normal(size=3) + np.cumsum(p.gyr_walk / white * rng.normal(size=(n, 3)), axis=0)
    matrix = p.gyr_misalignment * rng.normal(size=(3, 3))
    matrix[range(3), range(3)] = p.gyr_scale * rng.normal(size=3)
    size2 = (h.gyr**2).sum(axis=1, keepdims=True)
    noise = white * np.sqrt(p.gyr_noise**2 + p.gyr_nonlinearity**2 * size2) * rng.normal(size=(n, 3))
    gyr = (h.gyr + bias + noise) @ np.linalg.inv(np.eye(3) - matrix).T  # rate = (I − M) gyr − bias
    push = np.zeros((n, 3))
    push[1:, :2] = np.diff(markov(rng, speed, 0.3, 2), axis=0) * RATE
    acc = h.acc + h.in_body(push) + p.acc_bias * rng.normal(size=3) + p.acc_noise * white * rng.normal(size=(n, 3))
    bend = markov(rng, LEAST_BEND, p.mag_disturbance_time, 1)[:, 0]
    field_n = np.stack((20.0 * np.sin(bend), 20.0 * np.cos(bend), np.full(n, -43.0)), axis=1)
    mag = h.in_body(field_n) + LEAST_NOISE * p.mag_noise * white * rng.normal(size=(n, 3))
    return h, ImuData(t=h.t, gyr=gyr, acc=acc, mag=mag, meta=CALIBRATED), bias


@pytest.mark.parametrize(
    ("speed", "rest"), [(0.0, ()), (0.1, ()), (0.1, ((10.0, 20.0),))], ids=["at rest", "moving", "both"]
)
def test_errors_fit_the_covariance_that_is_claimed(speed, rest):
    """NEES over the units at the first sample, in the middle and at the end, [BarShalom2001] sec. 5.4.

    Their mean times their number is χ² of two degrees for each unit of tilt, one of heading, three of bias, within the
    bounds that nine such means keep together in 95 % of all runs (Bonferroni). All have margins: the speed of a body
    is what it was in the last four seconds too, so that behind a motion the tilt is claimed somewhat wide, by up to a
    sixth; a field's direction is taken to be off by a degree at least *and* its noise widens that, and the bias has the
    prior of any unit. The upper bound is the law's, the lower one of heading and bias allows for standard deviations
    that are twice as wide as the errors. The bias, for which a recording is smoothed twice, is that of every second
    unit.
    """
    smoother = Smoother(frame="ENU", params=ESTIMATED)
    nees = np.full((UNITS, 3, 3), np.nan)
    for k in range(UNITS):
        h, imu, bias = unit(k, smoother.params, speed=speed, rest=rest)
        track = smoother.process(imu)
        found = smoother.smooth(imu) if k % 2 == 0 else None
        for column, i in enumerate((0, h.t.size // 2, h.t.size - 1)):
            e, c_nb = error_n(track.q_nb[i], h.q[i]), rot.dcm_from_quat(track.q_nb[i])
            p_n = c_nb @ track.cov_b[i] @ c_nb.T
            nees[k, column, :2] = e[:2] @ np.linalg.solve(p_n[:2, :2], e[:2]), e[2] ** 2 / p_n[2, 2]
            if found is not None:
                p_bias = found.sweep.cov[np.searchsorted(found.frames.first, i), 3:, 3:]
                nees[k, column, 2] = (track.bias_b[i] - bias[i]) @ np.linalg.solve(p_bias, track.bias_b[i] - bias[i])
    mean = np.nanmean(nees, axis=0)
    for which, (degrees, units, share) in enumerate(((2, UNITS, 0.75), (1, UNITS, 0.25), (3, UNITS // 2, 0.25))):
        low, high = chi2.ppf([0.025 / 9, 1.0 - 0.025 / 9], degrees * units) / units
        assert (mean[:, which] < high).all(), (which, mean)
        assert (mean[:, which] > share * low).all(), (which, mean)


def test_what_is_not_estimated_is_counted():
    """Offsets of the accelerometer tilt by themselves over g; a latency turns by itself times the rate."""
    h = by_hand(20.0, seed=1)
    base = Smoother(frame="ENU", params=ESTIMATED).process(h.imu())
    c_nb = rot.dcm_from_quat(base.q_nb)
    tilted = Smoother(frame="ENU", params={**ESTIMATED, "acc_offset": 0.1}).process(h.imu())
    added = c_nb @ (tilted.cov_b - base.cov_b) @ np.swapaxes(c_nb, 1, 2)
    assert np.abs(added - np.diag([(0.1 / G0) ** 2] * 2 + [0.0])).max() < 1e-12
    late = Smoother(frame="ENU", params={**ESTIMATED, "latency_sd": 0.01}).process(h.imu())
    rate = h.gyr - base.bias_b
    expected = 1e-4 * rate[:, :, np.newaxis] * rate[:, np.newaxis, :]
    assert np.abs(late.cov_b - base.cov_b - expected).max() < 0.03 * np.abs(expected).max()  # scale of a hundredth


@pytest.mark.parametrize(("rate", "lag"), [(20.0, None), (20.0, 0.0), (150.0, None)])
def test_slow_samples_may_be_means_or_momentary(rate, lag):
    """A momentary value is half a step less 4 ms younger than a mean; all between is alike likely: that squared, /3."""
    h = by_hand(20.0, rate, seed=1)
    known, unknown = (
        Smoother(frame="ENU", params={**ESTIMATED, "lag": lag, "latency": n}).process(h.imu()) for n in (0, None)
    )
    expected = max(0.5 / rate - 0.004, 0.0) ** 2 / 3.0 * h.gyr[:, :, np.newaxis] * h.gyr[:, np.newaxis, :]
    assert np.array_equal(known.q_nb, unknown.q_nb)
    added = (unknown.cov_b - known.cov_b - expected)[h.t > 1.0]  # behind the first looks
    assert np.abs(added).max() <= 0.06 * np.abs(expected).max()  # bias and scale of hundredths


def test_an_uncalibrated_unit_is_less_certain_than_a_calibrated_one():
    """Hard iron of 8 µT at most on 20 µT of level field: rms 8/√3/20 = 13° of heading, beside the rest."""
    h = by_hand(20.0, seed=2)
    raw = ImuMeta(acc_left=uncalibrated("acc"), mag_left=uncalibrated("mag"))
    known, unknown = (
        np.sqrt(np.trace(Smoother(frame="ENU").process(imu).cov_b, axis1=1, axis2=2))
        for imu in (h.imu(), ImuData(t=h.t, gyr=h.gyr, acc=h.acc, mag=h.mag, meta=raw))
    )
    assert (unknown > math.sqrt(known.max() ** 2 + deg(13.0) ** 2) - deg(2.0)).all()
    assert known.max() < deg(3.0)


def test_a_free_heading_claims_its_drift_and_nothing_of_its_zero():
    """Heading that counts from the first sample: certain there to 0.06°, and later as the gyroscope drifts."""
    h = by_hand(60.0, seed=3)
    track = Smoother(frame="ENU", params=ESTIMATED).process(h.imu(mag=None))
    sd = heading_sd(track.q_nb, track.cov_b)
    e = error_n(track.q_nb, h.q)[:, 2]
    assert sd[0] == pytest.approx(1e-3, rel=0.05)
    assert sd[-1] > 3.0 * sd[0]
    assert (np.abs(e - e[0]) < 3.0 * np.hypot(sd, sd[0])).all()


# --- parameters ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("rest", "calibrated", "axis", "rate"), [
    ((), True, 0, BIAS_REPEATS),
    (((0.0, 5.0),), True, 0, 0.0),
    (((0.0, 5.0),), True, 1, 0.0),
    (((0.0, 5.0),), False, 1, 0.0),
], ids=["bias", "rested", "turned", "turned, uncalibrated"])  # fmt: skip
def test_a_free_heading_claims_a_bias_that_no_rest_showed_and_the_scale_by_what_was_turned(
    rest, calibrated, axis, rate
):
    """σ² = (σ_b t)² + Σ σ_E² (∫ up ω dt)²; a unit that swings about level axes turns nothing about the vertical."""
    t = np.arange(6000) / 100.0
    moving = t > 5.0 if rest else t >= 0.0
    turn = np.where(moving, 0.4, 0.0) if axis else np.zeros_like(t)
    angles = np.stack((np.cumsum(turn) / 100.0, 0.3 * np.sin(2.0 * t) * moving, 0.3 * np.cos(1.7 * t) * moving), axis=1)
    q = rot.quat_from_euler_zyx(angles)
    gyr = np.zeros((t.size, 3))
    gyr[1:] = 100.0 * rot.rotvec_from_quat(rot.quat_multiply(rot.quat_conjugate(q[:-1]), q[1:]))
    rng = np.random.default_rng(1)
    acc = rot.quat_rotate(rot.quat_conjugate(q), [0.0, 0.0, G0]) + 0.03 * rng.normal(size=(t.size, 3))
    meta = CALIBRATED if calibrated else ImuMeta()
    imu = ImuData(t=t, gyr=gyr + deg(0.1) * rng.normal(size=(t.size, 3)), acc=acc, meta=meta)
    track = Smoother(frame="ENU").process(imu)
    up = rot.dcm_from_quat(q)[:, 2, :]
    ways = np.cumsum(up[:, :, np.newaxis] * gyr[:, np.newaxis, :] / 100.0, axis=0)[-1]
    scale, cross = (0.03, 0.02) if not calibrated else (math.sqrt(3.0) * math.sqrt(0.008**2 - 0.002**2), 0.0)
    shares = (np.full((3, 3), cross) + np.diag(np.full(3, scale - cross))) ** 2 / 3.0  # uniform: limit² / 3
    expected = math.sqrt((rate * t[-1]) ** 2 + float((shares * ways**2).sum()))
    claimed = heading_sd(track.q_nb, track.cov_b)
    assert claimed[0] < deg(0.1)
    of_the_sweep = Smoother(frame="ENU").smooth(imu).sweep.cov[-1, 2, 2]
    assert claimed[-1] == pytest.approx(math.sqrt(expected**2 + of_the_sweep), rel=0.05)


def test_a_free_heading_stays_uncertain_from_stretch_to_stretch(monkeypatch):
    in_stretches(monkeypatch, long=20.0, core=10.0, margin=5.0)
    h = by_hand(60.0, 50.0, seed=3)
    track = Smoother(frame="ENU").process(h.imu(mag=None))
    sd = heading_sd(track.q_nb, track.cov_b)
    assert (np.diff(sd[::500]) > 0.0).all()
    assert sd[-1] > BIAS_REPEATS * 60.0 / math.sqrt(6.0)  # six stretches, as if each had a bias of its own


def test_a_direction_that_scatters_beyond_what_is_allowed_counts():
    """Of means over ten seconds: √(mean square of their azimuths − what the deflection allows)."""
    h = by_hand(80.0, 50.0, seed=4)
    frames, p = Keyframes.from_imu(h.imu(), 0.049), Params()
    reference = Reference(20.0, -43.0, 1.1)
    azimuth = deg(np.array([12.0, -8.0, 3.0, 0.0, -15.0, 9.0, 5.0, -6.0]))[(frames.middle // 10.0).astype(int)]
    swing = deg(30.0) * np.sin(2.0 * np.pi * frames.middle)  # faster: it does not count
    field = np.stack((20.0 * np.sin(azimuth + swing), 20.0 * np.cos(azimuth + swing), -43.0 + 0.0 * azimuth), axis=1)
    weight = np.where(frames.middle < 70.0, 1.0, 0.0)  # nor does a field that is not used
    found = direction_scatter(frames, p, reference, field, weight)
    seen = np.mean(azimuth[weight > 0.0] ** 2)
    assert found == pytest.approx(math.sqrt(seen - reference.bend(p) ** 2), rel=0.02)
    assert direction_scatter(frames, p, reference, np.tile([0.0, 20.0, -43.0], (len(field), 1)), weight) == 0.0
    assert direction_scatter(frames, p, reference, field, 0.0 * weight) == 0.0


def test_where_no_gravity_shows_any_attitude_is_possible_and_named():
    """Free fall for 20 s; behind it gravity shows the attitude again."""
    h = by_hand(60.0, 50.0, seed=6)
    gone = (h.t >= 20.0) & (h.t < 40.0)
    noise = np.random.default_rng(1).normal(0.0, 0.01, h.acc.shape)
    imu = h.imu(acc=np.where(gone[:, np.newaxis], noise, h.acc))
    smoother = Smoother(frame="ENU")
    track = smoother.process(imu)
    ending = "specific force (20–40 s): the attitude there may be anything"
    assert any(str(remark).endswith(ending) for remark in smoother.remarks)
    lost = (track.flags & np.uint32(flags.NOT_CONVERGED)) != 0
    assert lost[(h.t > 20.2) & (h.t < 39.8)].all() and not lost[(h.t < 19.8) | (h.t > 40.2)].any()
    assert np.sqrt(np.trace(track.cov_b[1500])) > 3.0
    assert rms_deg(error_n(track.q_nb, h.q)[h.t > 41.0]).max() < 1.0


@pytest.mark.parametrize("force", [0.0, 3.0], ids=["free fall", "a centrifuge of 3 g"])
def test_a_recording_without_gravity_claims_nothing(force):
    h = by_hand(40.0, 50.0, seed=7)
    acc = h.in_body(np.tile([force * G0, 0.0, 0.0], (h.t.size, 1))) + 0.01
    imu = ImuData(t=h.t, gyr=h.gyr, acc=acc, mag=h.mag, meta=replace(CALIBRATED, unit_check=False))
    smoother = Smoother(frame="ENU")
    track = smoother.process(imu)
    if force:  # a level force that lasts is taken for gravity: only its size tells
        assert np.degrees(np.abs(error_n(track.q_nb, h.q)[:, :2])).max() > 60.0
    (said,) = [said for said in map(str, smoother.remarks) if "no gravity shows in the specific force (0–40 s)" in said]
    assert "gyroscope or accelerometer has a wrong factor, rate, unit, axis or sign, or a calibration card" in said
    assert ((track.flags & np.uint32(flags.NOT_CONVERGED)) != 0).all()


def test_a_noise_card_makes_the_noise_larger_and_never_smaller():
    """Root mean square of the axes: √((3² + 4² + 5²)/3) = √(50/3); what is less than the defaults is not taken."""
    card = NoiseCard("unit", "test", gyr=TriadNoise([3e-3, 4e-3, 5e-3], [0.0] * 3, [1e-9] * 3))
    p = Smoother(frame="ENU", noise=card).params
    assert p.gyr_noise == pytest.approx(1e-3 * math.sqrt(50 / 3), rel=1e-12)
    assert p.gyr_walk == Params().gyr_walk
    assert Smoother(frame="ENU", noise=card, params={"gyr_noise": 0.001}).params.gyr_noise == 0.001
    none = [0.0] * 3
    fine = NoiseCard("unit", "test", gyr=TriadNoise([1e-6] * 3, none, none), acc=TriadNoise([1e-5] * 3, none, none))
    assert Smoother(frame="ENU", noise=fine).params == Params()
    smoother = Smoother(frame="NED", params={"latency": "2.6 ms", "mag": False, "declination": "3 deg"})
    assert smoother.params.latency == pytest.approx(0.0026)
    assert (smoother.common.mag, smoother.common.declination) == (False, pytest.approx(math.radians(3.0)))
    assert "latency=0.0026 s" in smoother.facts()["params"] and "latency=0.0026 s" in smoother.describe()
    assert smoother.bias_prior == ("bias_start", Params().bias_start)
