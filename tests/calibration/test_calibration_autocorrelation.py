"""How many samples count as one: memory, visits, and an honest covariance in an uneven field."""

from functools import lru_cache

import numpy as np
import pytest

from plumbob.calibration.autocorrelation import SLOW, alike, memory, memory_of_each, visits
from plumbob.calibration.ellipsoid_fit import Shape
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.mag import fit_mag, fit_mag_acc, fit_mag_gyr
from plumbob.rotations import quat_conjugate, quat_rotate
from tests.helpers import mag_scene as mags
from tests.helpers import noise_records, slow_as_python

CAPTURES = 8
ONE_VISIT = np.zeros(1, dtype=np.intp)


def first_order(rng, count, rho):
    """One of which each step is driven by white noise of variance 1."""
    return noise_records.first_order(rng.normal(size=count), -1.0 / np.log(rho)) / np.sqrt(1.0 - rho * rho)


def steel(rng, place_n):
    """Field of a dipole that is 1.0 to 1.5 m off and makes 1.5 µT at 1.2 m."""
    at, moment = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    arm = place_n - rng.uniform(1.0, 1.5) * at
    far = np.linalg.norm(arm, axis=1, keepdims=True)
    along = arm / far
    return 1.5 * 1.2**3 * (3.0 * along * np.sum(along * moment, axis=1, keepdims=True) - moment) / far**3


def in_a_room(seed, lever):
    """Unit, and what it and a gyroscope measure while a hand turns and wanders near steel; the lever is in metres."""
    rng = np.random.default_rng([21, seed])
    unit = mags.unit_of(rng, turned=False)
    t, q_nb, turning = mags.tumbling(rng)
    arm = rng.normal(size=3)
    wander = np.sin(2.0 * np.pi * (rng.uniform(0.005, 0.03, 3) * t[:, None] + rng.uniform(size=3)))
    place_n = quat_rotate(q_nb, lever * arm / np.linalg.norm(arm)) + 0.1 * wander
    field_b = quat_rotate(quat_conjugate(q_nb), mags.FIELD_N + steel(rng, place_n))
    mag = field_b @ unit.distortion.T + unit.bias + 0.2 * rng.normal(size=(len(t), 3))
    return unit, t, mag, mags.rates(rng, turning)


@lru_cache
def fit_in_a_room(seed, lever):
    """Of lengths alone; None where it is refused."""
    unit, _, mag, _ = in_a_room(seed, lever)
    try:
        return unit, fit_mag(mag, shape=Shape.ELLIPSOID, strength=mags.STRENGTH)
    except CaptureRefusedError as refused:
        assert refused.reasons[0].kind == "uneven-field"
        return unit, None


def is_uneven(fit):
    return any(str(remark).startswith("UNEVEN") for remark in fit.remarks)


def off(fit, unit):
    """Error of the heading over the predicted one."""
    return mags.heading_rms(fit.calibration, unit) / fit.calibration.quality.heading_sd


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def test_memory_of_samples_and_visits():
    """(1 + ρ)/(1 − ρ) of a first-order process: 19 for ρ = 0.9; 1 for white noise and for few samples."""
    rng = np.random.default_rng(16)
    slow, white = first_order(rng, 20_000, 0.9), rng.normal(size=20_000)
    assert memory(slow, ONE_VISIT) == pytest.approx(19.0, rel=0.15)
    assert memory(white, ONE_VISIT) == pytest.approx(1.0, abs=0.05)
    assert memory_of_each(np.column_stack((white, slow))) == memory(slow, ONE_VISIT)
    assert memory(slow[:50], ONE_VISIT) == 1.0
    # A tenth of the power has ρ = 0.999: (1 + ρ)/(1 − ρ) = 1999 of it, 200 of all; neighbours alone say 1.2
    rng = np.random.default_rng(17)
    slow = first_order(rng, 200_000, 0.999)
    residuals = slow / slow.std() + 3.0 * rng.normal(size=slow.size)
    assert memory(residuals, ONE_VISIT) < 1.5
    assert memory(residuals, np.arange(0, slow.size, 100)) == pytest.approx(200.0, rel=0.4)  # 100 times is 200 of 1999
    course = np.radians(np.arange(0.0, 360.0, 0.999))
    level = np.stack((np.cos(course), np.sin(course)), axis=1)
    assert np.diff(visits(level)) == pytest.approx(16)  # 15.98° is the first beyond
    assert visits(7.0 * np.column_stack((level, np.zeros(len(course))))).tolist() == visits(level).tolist()


@pytest.mark.parametrize("still", [1, 10, 100])
def test_noise_alone_is_taken_as_it_is(still):
    """Two looks of a chance of 0.135 % each make 0.54 alarms in 200 captures; more than 3 in one of 500 such tests."""
    alarms = 0
    for k in range(200):
        rng = np.random.default_rng([18, still, k])
        directions = np.repeat(rng.normal(size=(3000 // still, 3)), still, axis=0)
        found = alike(rng.normal(size=3000), directions, np.ones(3000, dtype=bool))
        alarms += found.factor > 1.0
    assert alarms <= 3


def test_what_stays_counts_as_four_and_a_half_samples():
    """Errors of power 1 that stay in each of 400 visits, of which a fit takes up 9, beside noise of power 1."""
    rng = np.random.default_rng(19)
    slow = np.repeat(first_order(rng, 400, 0.9), 25)
    slow /= slow.std()
    directions = np.repeat(rng.normal(size=(400, 3)), 25, axis=0)
    found = alike(slow + rng.normal(size=10_000), directions, np.ones(10_000, dtype=bool))
    assert found.unevenness == pytest.approx(0.5 * 400 / 391 * 10_000 / SLOW, rel=0.1)


@slow_as_python
@pytest.mark.parametrize(
    "rho", [0.9, *(pytest.param(rho, marks=pytest.mark.long(reason="other memories")) for rho in (0.5, 0.97))]
)
def test_filtered_noise_is_no_uneven_field(rho, monkeypatch):
    """Low passes of 5, 0.8 and 0.24 Hz at 50 Hz: their memory is counted, and the field is not blamed."""
    monkeypatch.setattr("plumbob.calibration.mag.field_gradient.ALONG", 0.0)  # which has a test of its own
    ratios, told = [], 0
    for seed in range(CAPTURES):
        rng = np.random.default_rng([22, seed])
        unit = mags.unit_of(rng, turned=False)
        _, q_nb, _ = mags.tumbling(rng)
        noise = np.column_stack([first_order(rng, len(q_nb), rho) for _ in range(3)])
        mag = mags.field(rng, unit, q_nb, sd=0.0, step=0.0) + 0.2 * np.sqrt(1.0 - rho * rho) * noise
        fit = fit_mag(mag, shape=Shape.ELLIPSOID, strength=mags.STRENGTH)
        ratios.append(off(fit, unit))
        told += is_uneven(fit)
    assert told <= 1
    assert 0.5 < rms(ratios) < 1.5


@slow_as_python
@pytest.mark.parametrize("lever", [0.35, pytest.param(0.1, marks=pytest.mark.long(reason="another lever"))])
def test_the_covariance_is_honest_near_steel(lever):
    """Not too small; too large, by less than 5, where the hand's wandering makes the errors, and not the lever."""
    made = [fit_in_a_room(seed, lever) for seed in range(CAPTURES)]
    made = [(unit, fit) for unit, fit in made if fit is not None]
    ratios = [off(fit, unit) for unit, fit in made]
    assert sum(is_uneven(fit) for _, fit in made) > 0.9 * len(ratios) > 0.45 * CAPTURES
    assert 0.2 < rms(ratios) < 1.5
    assert max(ratios) < 3.0


@slow_as_python
def test_poses_at_rest_show_an_uneven_field_too():
    """40 poses of 100 samples, a gradient of 3 µT/m and 0.3 m of arm: errors that each pose keeps, and no other has."""
    ratios = []
    for seed in range(3):
        rng = np.random.default_rng([23, seed])
        unit, q_nb = mags.unit_of(rng), np.repeat(mags.attitudes(rng, 40), 100, axis=0)
        gradient = rng.normal(size=(3, 3))
        gradient += gradient.T
        gradient -= np.eye(3) * np.trace(gradient) / 3.0
        place_n = quat_rotate(q_nb, np.array([0.3, 0.0, 0.0]))
        off_b = quat_rotate(quat_conjugate(q_nb), place_n @ gradient * 3.0 / np.linalg.norm(gradient))
        mag = mags.field(rng, unit, q_nb) + off_b @ unit.distortion.T
        fit = fit_mag_acc(mag, mags.force(rng, q_nb), strength=mags.STRENGTH)
        assert is_uneven(fit)
        ratios.append(off(fit, unit))
        even = fit_mag_acc(mags.field(rng, unit, q_nb), mags.force(rng, q_nb), strength=mags.STRENGTH)
        assert not is_uneven(even)
    assert 0.25 < rms(ratios) < 1.5


@slow_as_python
def test_a_gyroscope_sees_through_an_uneven_field():
    """One field in space, not one length: half the heading error at least, and an honest covariance."""
    alone, helped, ratios = [], [], []
    for seed in range(4):
        unit, t, mag, gyr = in_a_room(seed, 0.35)
        fit = fit_mag_gyr(t, mag, gyr, strength=mags.STRENGTH, gyr_gain_sd=0.0)
        helped.append(mags.heading_rms(fit.calibration, unit))
        ratios.append(off(fit, unit))
        by_lengths = fit_in_a_room(seed, 0.35)[1]
        alone.append(np.inf if by_lengths is None else mags.heading_rms(by_lengths.calibration, unit))
    assert np.median(helped) < 0.5 * np.median(alone)
    assert 0.5 < rms(ratios) < 1.5
