"""Each misprint of the papers, computed as it is printed: what the tables of misprints on the pages say of it."""

import math

import numpy as np
import pytest

from plumbob import rotations as rot
from plumbob.calibration.gyr.drift import chen2013
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.data import ImuData
from plumbob.filters import Filter
from plumbob.noise import deviation
from plumbob.papers.description import PAPERS
from plumbob.papers.fin import percent_error
from plumbob.papers.studies import errors_deg
from plumbob.simulation import simulate

# --- rod [Li2012], figures of papers.md 004 -----------------------------------------------------------------


def rod_angles(q):
    """Roll, pitch and yaw as (1) to (3) are printed."""
    a, b, c, d = q
    roll = math.atan2(2.0 * (c * d - a * b), 1.0 - 2.0 * (b * b + c * c))  # [Li2012] (1)
    yaw = math.atan2(2.0 * (b * c - a * d), 1.0 - 2.0 * (c * c + d * d))  # [Li2012] (3)
    return roll, math.asin(-2.0 * (b * d - a * c)), yaw  # [Li2012] (2)


def test_angles_and_matrices_of_the_rod_as_printed():
    q = rot.quat_from_euler_zyx([0.9, -0.2, 0.3])
    assert rod_angles(q) == pytest.approx((-0.341, -0.2, -0.911), abs=5e-4)
    assert rod_angles(rot.quat_conjugate(q))[1] == pytest.approx(-0.114, abs=5e-4)
    assert np.array(rot.euler_zyx_from_quat(q)) == pytest.approx([0.9, -0.2, 0.3], abs=1e-12)
    # The first, of angles, goes from navigation to body axes; here its rows are written out [Li2012] §2.1.
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (0.3, -0.2, 0.9))
    euler = np.array([
        [cp * cy, cp * sy, -sp],
        [-cr * sy + sr * sp * cy, cr * cy + sr * sp * sy, sr * cp],
        [sr * sy + cr * sp * cy, -sr * cy + cr * sp * sy, cr * cp],
    ])  # fmt: skip
    assert np.abs(euler.T - rot.dcm_from_quat(rot.quat_from_euler_zyx([0.9, -0.2, 0.3]))).max() < 1e-12
    gravity = np.array([0.0, math.sin(deg(170.0)), math.cos(deg(170.0))])
    assert to_deg(math.atan(gravity[1] / gravity[2])) == pytest.approx(-10.0)  # [Li2012] (7)
    assert to_deg(math.atan2(gravity[1], gravity[2])) == pytest.approx(170.0)
    printed = np.array([math.cos(deg(54.0)), 0.0, math.sin(deg(54.0)), 0.0])  # [Li2012] (10)
    assert to_deg(rot.quat_angle(printed, np.array([1.0, 0.0, 0.0, 0.0]))) == pytest.approx(108.0)


@pytest.mark.parametrize(
    ("tilts", "errors"),
    [((5, 5), (0.02, 0.02)), ((10, 10), (0.15, 0.15)), ((20, 15), (0.71, 0.92)), ((30, 30), (4.3, 3.7))],
)
def test_euler_angles_of_two_devices_cannot_be_exchanged(tilts, errors):
    """The y axis of the reference lies along the body's x axis: its pitch is nearly the body's roll [Li2012] §3.2."""
    from plumbob.papers.rod import by_rotation

    q_nb = rot.quat_from_euler_zyx(deg(np.array([[0.4, tilts[1], tilts[0]]])))
    q_nr = rot.quat_multiply(q_nb, rot.quat_from_euler_zyx(deg(np.array([-90.0, 0.0, 0.0]))))
    yaw, pitch, roll = rot.euler_zyx_from_quat(q_nr).T
    exchanged = rot.quat_from_euler_zyx(np.stack((yaw + 0.5 * np.pi, -roll, pitch), axis=-1))
    assert np.abs(errors_deg(exchanged, q_nb)[0, [2, 1]]) == pytest.approx(errors, abs=0.06, rel=0.02)
    assert np.abs(errors_deg(by_rotation(q_nr), q_nb)).max() < 1e-9


# --- trackball [Chen2013], figures of papers.md 002 ---------------------------------------------------------


def test_temperature_is_taken_off_twice_five_powers_are_ill_conditioned_and_a_table_has_no_level_axis():
    """(5) has A_x, which holds the 2 °/s of 20 K already, for A_x0; (4) with a in m/s² takes 0.1 · 8.81 off at 1 g."""
    drift = chen2013().bias_per_k[0] * 20.0
    assert to_dps(drift - (drift + drift)) == pytest.approx(-2.0)  # [Chen2013] (5)
    right = -(chen2013().g_sensitivity @ [G0, 0.0, 0.0])[0]
    assert to_dps(-dps(0.1) * G0 - right) == pytest.approx(-0.1 * (G0 - 1.0), abs=1e-9)  # [Chen2013] (4)
    taus = np.array([0.1, 0.2, 0.4, 1.0, 2.0, 4.0, 10.0, 50.0])
    assert np.linalg.cond(np.power.outer(taus, np.arange(-2.0, 3.0))) == pytest.approx(3141.0, abs=1.0)  # (14)
    turned = simulate("turntable", frame="NED", sensors="ideal", unit="calibrated", seed=1, rate=10.0).imu.gyr
    assert to_dps(turned[1000:].mean(axis=0)) == pytest.approx([0.0, 0.0, 60.0], abs=1e-9)


def test_the_printed_deviation_is_that_of_the_mean_and_not_of_its_changes():
    """√½ of white noise; with a mean of 1.5 °/s it is 1.5 / √2, and √½ of the noise beside."""

    def printed(rate, n):  # [Chen2013] (13)
        means = rate[: rate.size // n * n].reshape(-1, n).mean(axis=1)
        return math.sqrt(np.sum(means[:-1] ** 2) / (2.0 * (means.size - 1)))

    white = 0.1 * np.random.default_rng(1).standard_normal(100_000)
    assert printed(white, 1) / deviation(white, [1], "adev")[0] == pytest.approx(math.sqrt(0.5), rel=0.01)
    assert printed(white + 1.5, 1) == pytest.approx(1.063, abs=0.002)


# --- fin [Ou2017], figures of papers.md 000 -----------------------------------------------------------------


def printed_sum(rates, n, *, groups):
    """σ by the sum of (2) as it is printed, of moving means or of the groups of (1), divided by 2 (N − 2n)."""
    theta = np.concatenate(([0.0], np.cumsum(rates - rates.mean())))
    means, terms = (theta[n:] - theta[:-n]) / n, rates.size - 2 * n
    steps = np.diff(means[::n] if groups else means[1 : terms + 2])  # [Ou2017] (1), (2)
    return math.sqrt(steps @ steps / (2.0 * terms))


def slope(n, dev):
    return np.polyfit(np.log(n), np.log(dev), 1)[0]


@pytest.mark.parametrize("groups", [False, True])
def test_the_printed_sum_makes_white_noise_fall_as_quantisation_does(groups):
    """Slope −1 instead of −½; σ(1 s) is 1/√500 in closed form, of noise whose σ(1 s) is 1."""
    rng, n = np.random.default_rng(1), np.unique(np.geomspace(1, 1000, 25).astype(int))
    runs = [math.sqrt(500.0) * rng.standard_normal(110_000) for _ in range(4)]
    printed = np.sqrt(np.mean([[printed_sum(rates, k, groups=groups) ** 2 for k in n] for rates in runs], axis=0))
    right = np.sqrt(np.mean([deviation(rates, n) ** 2 for rates in runs], axis=0))
    assert (slope(n, printed), slope(n, right)) == (pytest.approx(-1.0, abs=0.02), pytest.approx(-0.5, abs=0.02))
    assert np.interp(500, n, printed) == pytest.approx(1.0 / math.sqrt(500.0), rel=0.1)
    assert np.interp(500, n, right) == pytest.approx(1.0, abs=3 * 0.04778)  # (7) at 1 s


def test_the_integral_of_4_needs_its_square_and_units_of_table_1_are_others():
    """∫ sin⁴u/u² = π/4, ∫ sin⁴u/u grows as (3/8) ln u, and √(2/π ∫ sin⁴u/u³) = √(2 ln 2/π) [closed forms]."""

    def integral(end, power):
        u = (np.arange(2_000_000) + 0.5) * end / 2_000_000
        return np.sum(np.sin(u) ** 4 / u**power) * end / 2_000_000

    assert integral(1e3, 2) == pytest.approx(math.pi / 4.0, rel=1e-3)
    assert integral(1e4, 1) - integral(1e3, 1) == pytest.approx(0.375 * math.log(10.0), rel=1e-3)  # [Ou2017] (4)
    assert math.sqrt(2.0 / math.pi * integral(1e3, 3)) == pytest.approx(0.6643, abs=1e-4)  # [Ou2017] (6)
    # Q of 0.107° is 92.7 °/s at 2 ms; R in °/√h meets 0.664 · 57.056 °/h at 569 s, the 290x's at 143 000 s.
    assert math.sqrt(3.0) * 0.107 * 500.0 == pytest.approx(92.7, abs=0.05)
    times = [(60.0 * r / (0.664 * b)) ** 2 for r, b in ((15.066, 57.056), (4.766, 1.138))]
    assert times == pytest.approx([569.0, 143_000.0], rel=0.01)
    signed, unsigned = (np.frombuffer(b"\xff\xff", kind)[0] / 80.0 for kind in (">i2", ">u2"))
    assert (signed, unsigned) == (pytest.approx(-0.0125), pytest.approx(819.1875))


def test_the_errors_of_table_1_are_those_of_the_averaging_times_that_the_page_says():
    """(7) for 110 000 samples at 500 Hz, turned round: T = 220 s / (1 + 1 / (2 share²)); its example is 6.299 %."""
    assert 100.0 * percent_error(math.sqrt(3.0)) == pytest.approx(6.299, abs=5e-4)  # [Ou2017] step 8
    for _, _, printed, share, times, _ in PAPERS["fin"].content["table"]["table_1_as"]["rows"]:
        value, error = map(float, printed.split(" ± "))
        assert 100.0 * error / value == pytest.approx(float(share.removesuffix(" %")), abs=5.001e-4)
        assert 220.0 / (1.0 + 0.5 * (value / error) ** 2) == pytest.approx(float(times.split()[0]), rel=6e-4)
    right = [value * percent_error(t) for value, t in ((0.125, 3**0.5), (0.132, 3**0.5), (4.766, 1.0), (1.138, 3.0))]
    assert right == pytest.approx([0.0079, 0.0083, 0.2277, 0.0946], abs=5e-5)


def test_quantisation_noise_is_that_of_an_angle_and_its_density_has_the_interval_in_it():
    """σ of a rounded angle has slope −1; of a rounded rate with noise, as of white noise, −½. (3) with √3 s is off."""
    rng, n = np.random.default_rng(3), np.unique(np.geomspace(1, 1000, 25).astype(int))
    angle = np.cumsum(40.0 * rng.standard_normal(110_001))
    rate = 0.33 * rng.standard_normal(110_000)
    of_angle, of_rate = np.diff(15.2 * np.rint(angle / 15.2) - angle), np.rint(80.0 * rate) / 80.0 - rate
    slopes = slope(n, deviation(of_angle, n)), slope(n, deviation(of_rate, n))
    assert slopes == (pytest.approx(-1.0, abs=0.02), pytest.approx(-0.5, abs=0.03))
    f = np.linspace(5.0, 15.0, 1001)
    by_interval, by_group = (np.mean(4.0 / t * np.sin(np.pi * f * t) ** 2) for t in (0.002, math.sqrt(3.0)))
    assert by_interval / by_group > 5.0  # [Ou2017] (3)


# --- buoy [Yu2018], figures of papers.md 001 ----------------------------------------------------------------

TS = 0.01


def buoy_rows(x, y, z, *, printed):
    """Matrix (4, 4) that q is multiplied with in (3), of a rate in rad/s; as printed, or the product of quaternions."""
    first = [0.0, -x, -y, -z]
    if printed:  # [Yu2018] (3)
        return np.array([first, [0.0, x, -y, z], [0.0, x, y, -z], [0.0, -x, y, z]])
    return np.array([first, [x, 0.0, z, -y], [y, -z, 0.0, x], [z, y, -x, 0.0]])


def buoy_steps(rate, steps, *, printed=False):
    step = np.eye(4) + 0.5 * TS * buoy_rows(*rate, printed=printed)
    return np.linalg.matrix_power(step, steps) @ [1.0, 0.0, 0.0, 0.0]


def test_the_printed_rows_of_the_buoy_never_leave_the_identity_and_a_first_order_step_stretches_and_lags():
    assert list(buoy_steps((0.3, -0.2, 0.5), 1000, printed=True)) == [1.0, 0.0, 0.0, 0.0]
    assert np.linalg.norm(buoy_steps((0.62, 0.0, 0.0), 60_000)) == pytest.approx(1.334, abs=5e-4)
    # |q| grows by √(1 + ω²Ts²/4) a step, exactly
    assert np.linalg.norm(buoy_steps((0.62, 0.0, 0.0), 60_000)) == pytest.approx((1 + 0.25 * 0.0062**2) ** 30_000)
    for rate, lag in ((172.0, 0.013), (573.0, 0.48), (2000.0, 20.0)):
        q = buoy_steps((0.0, 0.0, deg(rate)), 100)
        turned = rot.quat_angle(q / np.linalg.norm(q), rot.quat_from_euler_zyx([deg(rate), 0.0, 0.0]))
        assert to_deg(turned) == pytest.approx(lag, rel=0.05)


def test_arctan_loses_half_of_the_circle_and_the_text_of_the_buoy_has_another_order_than_its_equations():
    a, b, c, d = rot.quat_from_euler_zyx([2.0, -0.3, 0.4])
    assert math.atan(2 * (b * c + a * d) / (a * a + b * b - c * c - d * d)) == pytest.approx(2.0 - math.pi)  # (6)
    turns = [np.zeros(4) for _ in range(3)]
    for turn, angle, axis in zip(turns, (1.1, -0.3, 0.4), (3, 1, 2), strict=True):  # Z-X-Y
        turn[0], turn[axis] = math.cos(0.5 * angle), math.sin(0.5 * angle)
    q = rot.quat_multiply(rot.quat_multiply(turns[0], turns[1]), turns[2])
    assert rot.euler_zyx_from_quat(q)[::-1] == pytest.approx([-0.324, 0.381, 0.976], abs=5e-4)


def test_the_gate_of_the_buoy_passes_what_pythagoras_says():
    for gate, across, tilt in ((0.08, 0.408, 22.2), (0.08 / G0, 0.128, 7.3)):
        passed = math.sqrt((1.0 + gate) ** 2 - 1.0)
        assert (passed, to_deg(math.atan(passed))) == (pytest.approx(across, abs=1e-3), pytest.approx(tilt, abs=0.05))
    at_rest = np.abs(0.02 + 0.004 * np.random.default_rng(0).standard_normal(10_000)) * G0  # 20 mg of bias
    assert np.mean(at_rest < 0.08) < 0.005 and (at_rest < 0.08 * G0).all()


def test_the_poles_of_the_buoy_s_loop_and_what_a_zero_rate_output_does_through_them():
    fast, slow = (float(pole) for pole in np.roots([1.0, 0.5, 0.03]))  # [Yu2018] (7): s² + Kp s + Ki
    assert (fast, slow) == (pytest.approx(-0.430, abs=5e-4), pytest.approx(-0.0697, abs=5e-5))
    at = math.log(fast / slow) / (slow - fast)
    peak = (math.exp(slow * at) - math.exp(fast * at)) / (slow - fast)
    assert peak == pytest.approx(1.6, abs=0.05)  # s, to its two digits: 5 °/s give 8°
    still = np.zeros((6000, 3))
    imu = ImuData(t=TS * np.arange(6000.0), gyr=still + [dps(1.0), 0.0, 0.0], acc=still - [0.0, 0.0, G0])
    q = Filter("mahony", frame=rot.Frame.NED, params={"mag": False}).process(imu).q_nb
    assert to_deg(np.arccos(rot.dcm_from_quat(q)[:, 2, 2]).max()) == pytest.approx(peak, rel=0.01)


def test_moduli_of_the_products_have_no_direction():
    """Corrected by the sum of the moduli on every axis, 10° of roll at rest grow; by the vectors they vanish."""
    up, field = np.array([0.0, 0.0, -1.0]), np.array([math.cos(deg(50.0)), 0.0, math.sin(deg(50.0))])
    left = {}
    for printed in (True, False):
        q, integral = rot.quat_from_euler_zyx([0.0, 0.0, deg(10.0)]), np.zeros(3)
        for _ in range(3000):
            e = [np.cross(v, rot.dcm_from_quat(q).T @ v) for v in (up, field)]
            e = np.full(3, sum(np.linalg.norm(part) for part in e)) if printed else e[0] + e[1]
            integral += 0.03 * TS * e  # [Yu2018] (7)
            q = (np.eye(4) + 0.5 * TS * buoy_rows(*(0.5 * e + integral), printed=False)) @ q
            q /= np.linalg.norm(q)
        left[printed] = to_deg(math.acos(rot.dcm_from_quat(q)[2, 2]))
    assert left[False] < 0.5 and left[True] > 10.0


def test_the_paper_s_ellipsoid_is_exact_without_noise_and_needs_its_first_row_divided():
    from plumbob.papers.buoy import ellipsoid

    rng = np.random.default_rng(1)
    ball = rng.normal(size=(18, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    scale, middle = np.array([480.0, 520.0, 450.0]), np.array([60.0, -40.0, 20.0])
    matrix, centre = ellipsoid(ball * scale + middle)
    assert (centre, matrix) == (pytest.approx(middle), pytest.approx(np.diag(1.0 / scale)))
    level = np.array([[math.cos(turn), math.sin(turn), 0.0] for turn in np.linspace(0.0, 6.0, 36)])
    printed = level * scale @ (matrix * [480.0, 1.0, 1.0])  # [Yu2018] (14): x − x0, in the unit of the reading
    headings = np.arctan2(printed[:, 1], printed[:, 0]) - np.arctan2(level[:, 1], level[:, 0])
    assert to_deg(np.abs((headings + np.pi) % (2.0 * np.pi) - np.pi)).max() > 20.0
    z, around = rng.normal(size=18), rng.uniform(-math.pi, math.pi, 18)
    across = np.sqrt(1.0 + z * z)
    assert ellipsoid(np.stack((across * np.cos(around), across * np.sin(around), z), axis=1)) is None  # F² is −1
