"""Magnetometer of a unit at work: found although the field turns and passes steel, and honest about what is left."""

from functools import partial

import numpy as np
import pytest

from benchmarks.in_use import DIP as DIP_OF_SCENES
from benchmarks.in_use import capture
from plumbob.calibration.mag import fit_mag_in_use
from plumbob.calibration.mag.in_use import fit_in_use, larger
from plumbob.calibration.mag.windows import FEWEST, SEGMENT, window_edges
from plumbob.calibration.mag.with_gyr import GAIN_SD, SHEET_GAIN_SD
from plumbob.core.units import dps
from plumbob.rotations import quat_from_rotvec, quat_rotate
from tests.helpers import mag_scene as mags
from tests.helpers.real_data import room_at
from tests.helpers.refusals import reasons

TRIALS = 3
scene = partial(mags.scene, rate=10.0, duration=600.0, gain_sd=GAIN_SD)


def test_heading_is_found_with_an_honest_covariance_also_where_the_field_turns_with_the_place():
    """Ten minutes with inclinations up to 15°; a gyroscope's axes off by 0.2 % turn the whole by 0.1 to 0.3°."""
    units, captures, _ = zip(*(scene([7, k]) for k in range(TRIALS)), strict=True)
    made = [fit_mag_in_use(*measured, strength=mags.STRENGTH, dip=mags.DIP).calibration for measured in captures]
    mags.assert_honest(made, units, 0.25)

    # A vehicle that goes round a steel hull: the field turns by 3° a minute, which is too much for one field.
    def turning(t):
        about = quat_from_rotvec(np.radians(3.0) * t[:, None] / 60.0 * np.array([0.0, 0.0, 1.0]))
        return quat_rotate(about, mags.FIELD_N) - mags.FIELD_N

    unit, (t, mag, gyr), _ = scene(3, off=turning, gain_sd=0.0)
    found = fit_mag_in_use(t, mag, gyr, dip=mags.DIP, gyr_gain_sd=0.0).calibration
    assert np.degrees(mags.heading_rms(found, unit)) < 3.0 * np.degrees(found.quality.heading_sd) < 1.0


def test_steel_that_it_passes_is_set_aside():
    """Ten times 20 µT for some seconds: a tenth of the time."""
    places = np.random.default_rng(1).uniform(0.0, 600.0, 10)

    def steel(t):
        return 20.0 * np.exp(-(((t[:, None] - places) / 3.0) ** 2)).sum(axis=1)[:, None] * np.array([0.6, 0.0, -0.8])

    unit, measured, _ = scene(4, off=steel)
    fit = fit_mag_in_use(*measured, dip=mags.DIP)
    assert 0.02 < fit.calibration.quality.outliers / len(fit.used) < 0.2
    assert mags.heading_rms(fit.calibration, unit) < 3.0 * fit.calibration.quality.heading_sd < np.radians(1.5)


def test_a_walking_bias_and_a_later_magnetometer_are_followed():
    """0.1 °/s from one segment of ten minutes to the next, of which each has the mean."""
    _, (t, mag, gyr), _ = scene(5, duration=1800.0, gain_sd=0.0)
    walking = dps(0.1) / SEGMENT * t[:, None] * np.array([1.0, -1.0, 0.5])
    one, other = (fit_in_use(t, mag, rate, gyr_gain_sd=0.0).gyr_bias for rate in (gyr, gyr + walking))
    wanted = dps(0.1) * (np.arange(3) + 0.5)[:, None] * np.array([1.0, -1.0, 0.5])
    assert other - one == pytest.approx(wanted, abs=dps(2e-3))
    # 0.1 s; a field of 25 µT that turns by 0.3 rad/s with noise of 0.2 µT tells it to 0.4 ms in 6000
    _, (t, mag, gyr), _ = scene(6, gain_sd=0.0)
    found = [fit_in_use(t[2:], late, gyr[2:], gyr_gain_sd=0.0) for late in (mag[2:], mag[1:-1])]
    # that a sensor is rarely later than 20 ms is known before, and pulls by (0.4/20)² at most
    assert found[1].delay - found[0].delay == pytest.approx(0.1, abs=3e-3)


def test_what_is_missing_is_left_out():
    """Rates away for a minute, and a field at a third of the rate, with nothing at the start."""
    unit, (t, mag, gyr), acc = scene(8)
    mag[np.arange(len(t)) % 3 != 0] = np.nan
    mag[:500] = np.nan
    kept = (t < 200.0) | (t > 260.0)
    fit = fit_mag_in_use(t[kept], mag[kept], gyr[kept], acc=acc[kept])
    assert "windows of 4 s in 10 min" in str(fit.remarks[0])
    assert fit.remarks[0].values["windows"] == 150 - 13 - 15  # before the field, and where rates are missing
    assert mags.heading_rms(fit.calibration, unit) < 3.0 * fit.calibration.quality.heading_sd < np.radians(1.0)


@pytest.mark.parametrize(("change", "kind"), [
    (lambda t, mag, gyr: (t[:300], mag[:300], gyr[:300]), "too-few"),
    (lambda t, mag, gyr: (t[:50], np.full((50, 3), np.nan), gyr[:50]), "too-few"),
    (lambda t, mag, gyr: (t, mag[:1] + 0.0 * mag, 0.0 * gyr), "ill-conditioned"),
    (lambda t, mag, gyr: (t, mag * [1.0, 1.0, -1.0], gyr), "ill-conditioned"),
    (lambda t, mag, gyr: (t, mag, np.degrees(gyr)), "ill-conditioned"),
    (lambda t, mag, gyr: (t, mag * [1.0, 1.0, 0.0], gyr), "implausible"),
    (lambda t, mag, gyr: (t, 1e9 * mag, gyr), "wrong-field"),
], ids=["30 s", "no field", "at rest", "mirrored", "degrees", "dead axis", "no µT"])  # fmt: skip
def test_what_cannot_calibrate_is_refused(change, kind):
    _, measured, _ = scene(9, duration=120.0)
    (reason, *_) = reasons(fit_mag_in_use, *change(*measured))
    assert reason.kind == kind
    assert "--in-use" in reason.advice or kind in {"implausible", "wrong-field"}


@pytest.mark.parametrize(
    "trial",
    [*mags.TURNED[:1], *(pytest.param(t, marks=pytest.mark.long(reason="other rooms")) for t in mags.TURNED[1:])],
)
def test_real_recordings_agree_with_rates_of_the_reference(broad_folder, trial):
    """Optical attitudes have no errors of a gyroscope; the field is the same, which walks by degrees in a room."""
    imu, room = room_at(broad_folder / trial)
    found = fit_mag_in_use(imu.t, imu.mag, imu.gyr, acc=imu.acc, gyr_gain_sd=SHEET_GAIN_SD).calibration
    assert room.heading_off(found) < 2.0 * found.quality.heading_sd


def test_a_window_has_enough_of_the_field_itself_and_of_two_covariances_each_direction_has_the_larger():
    present = np.arange(200) < 100 + FEWEST - 1  # one too few in the second window of a second
    assert window_edges(0.01 * np.arange(201), np.append(present, False), 1.0).tolist() == [[0, 100]]
    a = np.array([[2.0, 0.5], [0.5, 1.0]])
    assert [larger(a, 4.0 * a), larger(4.0 * a, a)] == pytest.approx(np.array([4.0 * a, 4.0 * a]))
    assert larger(np.diag([1.0, 9.0]), np.diag([4.0, 1.0])) == pytest.approx(np.diag([4.0, 9.0]))


@pytest.mark.long(reason="two hours of a boat at 50 Hz")
@pytest.mark.parametrize("seed", [0, 1])
def test_an_hour_on_a_boat_ends_where_the_steps_have_settled(seed):
    """Steps shrink slowly where little turns: ended after four rounds, the heading was off by 1.5° and claimed 0.4°."""
    case = capture(seed, "boat", "even", 60.0)
    found = fit_mag_in_use(case.t, case.mag, case.gyr, dip=DIP_OF_SCENES, gyr_gain_sd=SHEET_GAIN_SD).calibration
    assert case.room.heading_off(found, case.tilt_range) < 2.0 * found.quality.heading_sd


def test_attitudes_need_not_start_level():
    """The axes of the place do not matter: only how the unit turns. Steps end within a twentieth of the sd."""
    _, (t, mag, gyr), _ = scene(10)
    turned = quat_from_rotvec(np.array([0.3, -0.4, 0.2]))
    about = [quat_rotate(turned, rows) for rows in (mag, gyr)]
    level, other = (fit_mag_in_use(t, *rows, gyr_gain_sd=0.0).calibration for rows in ((mag, gyr), about))
    slack = 0.1 * np.sqrt(np.trace(level.covariance[:3, :3]))
    assert quat_rotate(turned, level.bias) == pytest.approx(other.bias, abs=slack)
