"""Magnetometer with gyroscope: the study's bar for restricted motion, honest covariance, refusals."""

import numpy as np
import pytest

from plumbob.calibration.mag.with_gyr import GAIN_SD, SHEET_GAIN_SD, fit_mag_gyr, fit_turned_field
from plumbob.core.errors import CalibrationError
from plumbob.core.units import dps
from plumbob.rotations import dcm_from_quat, quat_chained, quat_conjugate, quat_multiply
from tests.helpers import mag_scene as mags
from tests.helpers.real_data import room_at
from tests.helpers.refusals import reasons

TRIALS = 3


def scene(seed, *, gain_sd=0.0, **motion):
    rng = np.random.default_rng(seed)
    unit = mags.unit_of(rng)
    t, q_nb, true = mags.trajectory(rng, **motion)
    return unit, (t, mags.field(rng, unit, q_nb), mags.rates(rng, true, gain_sd=gain_sd)), mags.force(rng, q_nb)


def turned(t, gyr):
    """Attitudes (N, 3, 3) from the axes of a body that starts at one to those of the start."""
    return dcm_from_quat(quat_chained(0.5 * (gyr[1:] + gyr[:-1]) * np.diff(t)[:, np.newaxis]))


@pytest.mark.parametrize("gain_sd", [GAIN_SD, pytest.param(0.0, marks=pytest.mark.long(reason="an exact gyroscope"))])
def test_heading_meets_the_bar_and_the_covariance_is_honest(gain_sd):
    """0.25° on a minute with inclinations up to 15°, with an exact gyroscope and with a calibrated one."""
    made, units = [], []
    for k in range(TRIALS):
        unit, measured, acc = scene([5, k], gain_sd=gain_sd)
        made.append(fit_mag_gyr(*measured, acc=acc, strength=mags.STRENGTH, gyr_gain_sd=gain_sd).calibration)
        units.append(unit)
    mags.assert_honest(made, units, 0.25)


def test_the_turns_are_those_of_the_body():
    t, q_nb, true = mags.trajectory(np.random.default_rng(1))
    found, wanted = turned(t, true), dcm_from_quat(quat_multiply(quat_conjugate(q_nb[0]), q_nb))
    # trapezoids of 20 ms: h³/12 of the rate's curvature, 0.06 rad/s³ here, add up to 2e-6 rad over 60 s
    assert np.abs(found - wanted).max() < 1e-4


def test_bias_walk_and_field_of_the_gyroscope_are_found():
    _, (t, mag, gyr), acc = scene(3)
    planted = dps(np.array([2.0, -1.0, 1.5]))
    fit = fit_turned_field(t, mag, gyr + planted, np.arange(len(t)), gyr_gain_sd=0.0)
    same = fit_turned_field(t, mag, gyr, np.arange(len(t)), gyr_gain_sd=0.0)
    assert fit.gyr_bias - same.gyr_bias == pytest.approx(planted, abs=dps(1e-3))
    assert fit.walk == pytest.approx(dps(0.005), rel=0.5)  # 60 steps, a third of which the field does not show
    assert fit.distortion == pytest.approx(same.distortion, abs=1e-2)
    assert f"{np.degrees(mags.DIP):.1f}°" in str(fit_mag_gyr(t, mag, gyr, acc=acc, strength=mags.STRENGTH).remarks[2])


def test_a_later_magnetometer_is_put_right():
    """40 ms, twice what is expected beforehand; 0.2 µT on 25 µT that turn at 0.24 rad/s ± leave 0.6 ms of 3000."""
    unit, (t, mag, gyr), _ = scene(8)
    delays = [
        fit_turned_field(t[2:], late, gyr[2:], np.arange(len(t) - 2), gyr_gain_sd=0.0).delay
        for late in (mag[2:], mag[:-2])
    ]
    assert delays == pytest.approx([0.0, 0.04], abs=3 * 0.6e-3)
    fit = fit_mag_gyr(t[2:], mag[:-2], gyr[2:], strength=mags.STRENGTH, gyr_gain_sd=0.0)
    assert f"by {1e3 * delays[1]:.1f} ms" in str(fit.remarks[1])
    assert np.degrees(mags.heading_rms(fit.calibration, unit)) < 0.25


@pytest.mark.parametrize(
    "trial",
    [*mags.TURNED[:1], *(pytest.param(t, marks=pytest.mark.long(reason="other rooms")) for t in mags.TURNED[1:])],
)
def test_real_recordings_agree_with_the_reference_attitude(broad_folder, trial):
    """As predicted: 1 for a reference that is the truth, √2 for one whose own fit suffers from the room as much."""
    imu, room = room_at(broad_folder / trial)
    found = fit_mag_gyr(imu.t, imu.mag, imu.gyr, acc=imu.acc, gyr_gain_sd=SHEET_GAIN_SD).calibration
    off = np.concatenate((found.bias - room.bias, (found.matrix - room.matrix).ravel()))
    assert np.sqrt(np.mean(off**2 / np.diag(found.covariance))) < 2.0


def test_slower_or_outlying_or_too_many_samples_do_no_harm():
    unit, (t, mag, gyr), _ = scene(9)
    fine = np.linspace(0.0, t[-1], 2 * (len(t) - 1) + 1)
    twice = [np.column_stack([np.interp(fine, t, column) for column in triad.T]) for triad in (mag, gyr)]
    slow = mag.copy()
    slow[np.arange(len(t)) % 3 != 0] = np.nan
    slow[300:330:3] += 20.0
    thinned = fit_mag_gyr(fine, *twice, strength=mags.STRENGTH, gyr_gain_sd=0.0)
    slower = fit_mag_gyr(t, slow, gyr, strength=mags.STRENGTH, gyr_gain_sd=0.0)
    assert [len(fit.measured) for fit in (thinned, slower)] == [3001, 1001]
    assert "One of every 2 samples was fitted." in map(str, thinned.remarks)
    assert not slower.used[100:110].any() and np.count_nonzero(~slower.used) <= 12
    for fit in (thinned, slower):
        assert np.degrees(mags.heading_rms(fit.calibration, unit)) < 0.25


def test_what_cannot_calibrate_is_refused():
    _, (t, mag, gyr), _ = scene(6, duration=24.0)
    rng, level = np.random.default_rng(7), np.zeros_like(gyr) + [0.0, 0.0, 0.3]
    noise = 0.2 * rng.normal(size=mag.shape)
    circling = np.einsum("nji,j->ni", turned(t, level), [25.0, 0.0, 43.0]) + noise
    other = mags.field(rng, mags.unit_of(rng), mags.attitudes(rng, len(t)))  # of another motion
    outlying = mag + 20.0 * (rng.random((len(t), 1)) < 0.2)
    for capture, kind, options, advice in (
        ((t[:40], mag[:40], gyr[:40]), "too-few", {}, ""),
        ((t, mag[0] + noise, gyr), "no-motion", {}, ""),
        ((t, circling, level), "ill-conditioned", {}, ""),
        ((t, other, gyr), "ill-conditioned", {}, ""),
        ((t, outlying, gyr), "outliers", {"gyr_gain_sd": GAIN_SD}, "Look for"),
        ((t, outlying, gyr), "outliers", {"gyr_gain_sd": SHEET_GAIN_SD}, "Calibrate the gyroscope first"),
    ):
        (reason, *_) = reasons(fit_mag_gyr, *capture, **options)
        assert reason.kind == kind and reason.advice.startswith(advice)
    with pytest.raises(CalibrationError, match="rates are missing for 1"):
        fit_mag_gyr(t + (t > 12.0), mag, gyr)
