"""Each misprint of the papers, computed as it is printed: what the tables of misprints on the pages say of it."""

import math

import numpy as np
import pytest

from plumbob.calibration.gyr.drift import chen2013
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.noise import deviation
from plumbob.papers.studies import errors_deg
from plumbob.rotations import (
    dcm_from_quat,
    euler_zyx_from_quat,
    quat_angle,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_multiply,
)
from plumbob.simulation import simulate

# --- rod [Li2012], figures of papers.md 004 -----------------------------------------------------------------


def rod_angles(q):
    """Roll, pitch and yaw as (1) to (3) are printed."""
    a, b, c, d = q
    roll = math.atan2(2.0 * (c * d - a * b), 1.0 - 2.0 * (b * b + c * c))  # [Li2012] (1)
    yaw = math.atan2(2.0 * (b * c - a * d), 1.0 - 2.0 * (c * c + d * d))  # [Li2012] (3)
    return roll, math.asin(-2.0 * (b * d - a * c)), yaw  # [Li2012] (2)


def test_no_convention_saves_all_three_angles_of_the_rod():
    q = quat_from_euler_zyx([0.9, -0.2, 0.3])
    assert rod_angles(q) == pytest.approx((-0.341, -0.2, -0.911), abs=5e-4)
    assert rod_angles(quat_conjugate(q))[1] == pytest.approx(-0.114, abs=5e-4)
    assert np.array(euler_zyx_from_quat(q)) == pytest.approx([0.9, -0.2, 0.3], abs=1e-12)


def test_both_matrices_of_the_rod_are_transposes():
    """The first, of angles, goes from navigation to body axes; here its rows are written out [Li2012] §2.1."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (0.3, -0.2, 0.9))
    euler = np.array([
        [cp * cy, cp * sy, -sp],
        [-cr * sy + sr * sp * cy, cr * cy + sr * sp * sy, sr * cp],
        [sr * sy + cr * sp * cy, -sr * cy + cr * sp * sy, cr * cp],
    ])  # fmt: skip
    assert np.abs(euler.T - dcm_from_quat(quat_from_euler_zyx([0.9, -0.2, 0.3]))).max() < 1e-12


def test_atan_folds_a_roll_of_170_degrees_back_and_a_whole_angle_turns_twice():
    gravity = np.array([0.0, math.sin(deg(170.0)), math.cos(deg(170.0))])
    assert to_deg(math.atan(gravity[1] / gravity[2])) == pytest.approx(-10.0)  # [Li2012] (7)
    assert to_deg(math.atan2(gravity[1], gravity[2])) == pytest.approx(170.0)
    printed = np.array([math.cos(deg(54.0)), 0.0, math.sin(deg(54.0)), 0.0])  # [Li2012] (10)
    assert to_deg(quat_angle(printed, np.array([1.0, 0.0, 0.0, 0.0]))) == pytest.approx(108.0)


@pytest.mark.parametrize(
    ("tilts", "errors"),
    [((5, 5), (0.02, 0.02)), ((10, 10), (0.15, 0.15)), ((20, 15), (0.71, 0.92)), ((30, 30), (4.3, 3.7))],
)
def test_euler_angles_of_two_devices_cannot_be_exchanged(tilts, errors):
    """The y axis of the reference lies along the body's x axis: its pitch is nearly the body's roll [Li2012] §3.2."""
    from plumbob.papers.rod import by_rotation

    q_nb = quat_from_euler_zyx(deg(np.array([[0.4, tilts[1], tilts[0]]])))
    q_nr = quat_multiply(q_nb, quat_from_euler_zyx(deg(np.array([-90.0, 0.0, 0.0]))))
    yaw, pitch, roll = euler_zyx_from_quat(q_nr).T
    exchanged = quat_from_euler_zyx(np.stack((yaw + 0.5 * np.pi, -roll, pitch), axis=-1))
    assert np.abs(errors_deg(exchanged, q_nb)[0, [2, 1]]) == pytest.approx(errors, abs=0.06, rel=0.02)
    assert np.abs(errors_deg(by_rotation(q_nr), q_nb)).max() < 1e-9


# --- trackball [Chen2013], figures of papers.md 002 ---------------------------------------------------------


def test_temperature_is_taken_off_twice_and_a_force_in_metres_too_much():
    """(5) has A_x, which holds the 2 °/s of 20 K already, for A_x0; (4) with a in m/s² takes 0.1 · 8.81 off at 1 g."""
    drift = chen2013().bias_per_k[0] * 20.0
    assert to_dps(drift - (drift + drift)) == pytest.approx(-2.0)  # [Chen2013] (5)
    right = chen2013().compensate(np.zeros((1, 3)), np.array([25.0]), np.array([[G0, 0.0, 0.0]]))[0, 0]
    assert to_dps(-dps(0.1) * G0 - right) == pytest.approx(-0.1 * (G0 - 1.0), abs=1e-9)  # [Chen2013] (4)


def test_the_printed_deviation_is_that_of_the_mean_and_not_of_its_changes():
    """√½ of white noise; with a mean of 1.5 °/s it is 1.5 / √2, and √½ of the noise beside."""

    def printed(rate, n):  # [Chen2013] (13)
        means = rate[: rate.size // n * n].reshape(-1, n).mean(axis=1)
        return math.sqrt(np.sum(means[:-1] ** 2) / (2.0 * (means.size - 1)))

    white = 0.1 * np.random.default_rng(1).standard_normal(100_000)
    assert printed(white, 1) / deviation(white, [1], "adev")[0] == pytest.approx(math.sqrt(0.5), rel=0.01)
    assert printed(white + 1.5, 1) == pytest.approx(1.063, abs=0.002)


def test_five_powers_on_eight_times_are_ill_conditioned_and_an_axis_in_the_plane_of_a_table_measures_nothing():
    taus = np.array([0.1, 0.2, 0.4, 1.0, 2.0, 4.0, 10.0, 50.0])
    assert np.linalg.cond(np.power.outer(taus, np.arange(-2.0, 3.0))) == pytest.approx(3141.0, abs=1.0)  # (14)
    turned = simulate("turntable", frame="NED", sensors="ideal", unit="calibrated", seed=1, rate=10.0).imu.gyr
    assert to_dps(turned[1000:].mean(axis=0)) == pytest.approx([0.0, 0.0, 60.0], abs=1e-9)
