"""What the smoother claims: errors over many units whose noise is that of the model, against its covariance."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from plumbob import ImuData, NoiseCard
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg
from plumbob.data.cards import TriadNoise
from plumbob.data.cards.left import uncalibrated
from plumbob.data.imu import ImuMeta
from plumbob.filters.smoother import Params, Smoother
from plumbob.filters.smoother.field import LEAST_BEND, LEAST_NOISE
from plumbob.rotations import dcm_from_quat
from tests.battery.hand import CALIBRATED, by_hand, error_n

UNITS, RATE, SECONDS = 40, 100.0, 40.0
ESTIMATED = {"acc_offset": 0.0, "latency_sd": 0.0, "mag_direction_sd": 0.0}
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

    Their mean times their number is χ² of two degrees for each unit of tilt, one of heading, three of bias. The tilt
    lies within the bounds that nine such means keep together in 95 % of all runs (Bonferroni). Heading and bias have
    margins: a field's direction is taken to be off by a degree at least *and* its noise widens that, and the bias has
    the prior of any unit; their upper bound is the law's, their lower one allows for standard deviations that are
    twice as wide as the errors.
    """
    smoother = Smoother(frame="ENU", params=ESTIMATED)
    nees = np.zeros((UNITS, 3, 3))
    for k in range(UNITS):
        h, imu, bias = unit(k, smoother.params, speed=speed, rest=rest)
        track, found = smoother.process(imu), smoother.smooth(imu)
        for column, i in enumerate((0, h.t.size // 2, h.t.size - 1)):
            e, c_nb = error_n(track.q_nb[i], h.q[i]), dcm_from_quat(track.q_nb[i])
            p_n = c_nb @ track.cov_b[i] @ c_nb.T
            p_bias = found.sweep.cov[np.searchsorted(found.frames.first, i), 3:, 3:]
            off = track.bias_b[i] - bias[i]
            nees[k, column] = (
                e[:2] @ np.linalg.solve(p_n[:2, :2], e[:2]), e[2] ** 2 / p_n[2, 2], off @ np.linalg.solve(p_bias, off)
            )  # fmt: skip
    mean = nees.mean(axis=0)
    for which, degrees in enumerate((2, 1, 3)):
        low, high = chi2.ppf([0.025 / 9, 1.0 - 0.025 / 9], degrees * UNITS) / UNITS
        least = low if which == 0 else 0.25 * low
        assert (mean[:, which] < high).all(), (which, mean)
        assert (mean[:, which] > least).all(), (which, mean)


def test_what_is_not_estimated_is_counted():
    """Offsets of the accelerometer tilt by themselves over g; a latency turns by itself times the rate."""
    h = by_hand(20.0, seed=1)
    base = Smoother(frame="ENU", params=ESTIMATED).process(h.imu())
    c_nb = dcm_from_quat(base.q_nb)
    tilted = Smoother(frame="ENU", params={**ESTIMATED, "acc_offset": 0.1}).process(h.imu())
    added = c_nb @ (tilted.cov_b - base.cov_b) @ np.swapaxes(c_nb, 1, 2)
    assert np.abs(added - np.diag([(0.1 / G0) ** 2] * 2 + [0.0])).max() < 1e-12
    late = Smoother(frame="ENU", params={**ESTIMATED, "latency_sd": 0.01}).process(h.imu())
    rate = h.gyr - base.bias_b
    expected = 1e-4 * rate[:, :, np.newaxis] * rate[:, np.newaxis, :]
    assert np.abs(late.cov_b - base.cov_b - expected).max() < 0.03 * np.abs(expected).max()  # scale of a hundredth


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
    c_nb = dcm_from_quat(track.q_nb)
    sd = np.sqrt((c_nb @ track.cov_b @ np.swapaxes(c_nb, 1, 2))[:, 2, 2])
    e = error_n(track.q_nb, h.q)[:, 2]
    assert sd[0] == pytest.approx(1e-3, rel=0.05)
    assert sd[-1] > 3.0 * sd[0]
    assert (np.abs(e - e[0]) < 3.0 * np.hypot(sd, sd[0])).all()


# --- parameters ---------------------------------------------------------------------------------------------


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


def test_parameters_are_taken_by_name_with_their_unit_and_others_are_refused():
    smoother = Smoother(frame="NED", params={"latency": "2.6 ms", "mag": False, "declination": "3 deg"})
    assert smoother.params.latency == pytest.approx(0.0026)
    assert (smoother.common.mag, smoother.common.declination) == (False, pytest.approx(math.radians(3.0)))
    assert "latency=0.0026 s" in smoother.facts()["params"]
    assert "latency=0.0026 s" in smoother.describe()
    for name in ("kp", "max_gap"):  # a gap is that of the samples
        with pytest.raises(ParameterError, match=f"smoother has no parameter '{name}'; known are acc_bias"):
            Smoother(frame="NED", params={name: 1.0})
    with pytest.raises(ParameterError, match="speed"):
        Smoother(frame="NED", params={"speed": -1.0})
    assert smoother.bias_prior == ("bias_start", Params().bias_start)
