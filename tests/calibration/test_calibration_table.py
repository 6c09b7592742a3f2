"""Rate table: planted parameters come back, within what the covariance says, and poor sessions are refused."""

import numpy as np
import pytest

from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.gyr.table import SCALE_GRADES, fit_table
from plumbob.core.constants import EARTH_RATE, G0
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import deg, dps

SIX = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]
THREE = [(axis, 1.0) for axis in range(3)]
RATES = (50.0, 100.0, 200.0)
BIAS = dps(np.array([1.0, -2.0, 0.5]))
RESPONSE = np.eye(3) + np.array([[0.01, 0.004, -0.006], [-0.003, -0.02, 0.005], [0.002, 0.007, 0.015]])
COUPLING = dps(np.array([[0.05, -0.03, 0.02], [0.04, 0.06, -0.05], [-0.02, 0.03, 0.07]])) / G0
NOISE = dps(0.015)


def session(faces, *, seed=0, noise=NOISE, tilt=0.0, coupling=COUPLING, rates=RATES, rest=True, earth=0.0, drift=0.0):
    """Nominal rate, measured mean and true force; each face has a tilt, `tilt` rad per axis, and a drift."""
    rng = np.random.default_rng(seed)
    nominal, measured, force = [], [], []
    for axis, sign in faces:
        up = np.zeros(3)
        up[axis] = sign
        true = up + rng.normal(0.0, tilt, 3) * (up == 0.0)
        true /= np.linalg.norm(true)
        bias = BIAS + rng.normal(0.0, drift, 3)
        for rate in [0.0] * rest + [s * r for r in rates for s in (1.0, -1.0)]:
            spin = dps(rate)
            nominal.append(spin * up)
            force.append(G0 * true)
            measured.append(
                bias + RESPONSE @ ((spin + earth) * true) + coupling @ (G0 * true) + rng.normal(0, noise, 3)
            )
    return np.array(nominal), np.array(measured), np.array(force)


def fit(faces, *, model="auto", latitude=None, **how):
    nominal, measured, force = session(faces, **how)
    return fit_table(nominal, measured, force=force, model=model, latitude=latitude)


def reasons(call):
    with pytest.raises(CaptureRefusedError) as caught:
        call()
    return caught.value.reasons


def test_without_noise_the_planted_parameters_come_back():
    found = fit(SIX, noise=0.0).calibration
    # The regression is solved in columns of norm 1 with condition 1: 1e-9 of each parameter's scale is ample.
    np.testing.assert_allclose(found.bias, BIAS, rtol=0, atol=1e-9 * dps(200.0))
    np.testing.assert_allclose(found.matrix, np.linalg.inv(RESPONSE), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.g_sensitivity, COUPLING, rtol=0, atol=1e-9 * dps(200.0) / G0)


def test_the_card_makes_true_rates_of_the_measured():
    nominal, measured, force = session(SIX, noise=0.0)
    card = fit_table(nominal, measured, force=force).calibration
    rates = (measured - card.bias - force @ card.g_sensitivity.T) @ card.matrix.T
    np.testing.assert_allclose(rates, nominal, rtol=0, atol=1e-8 * dps(200.0))


@pytest.mark.parametrize("drift", [0.0, 2.0 * NOISE])
def test_errors_are_as_large_as_the_covariance_says(drift):
    trials, pulls = 100, []
    truth = np.concatenate((BIAS, np.linalg.inv(RESPONSE).ravel(), COUPLING.ravel()))
    for seed in range(trials):
        c = fit(SIX, seed=seed, tilt=deg(0.1), drift=drift, model="21").calibration
        found = np.concatenate((c.bias, c.matrix.ravel(), c.g_sensitivity.ravel()))
        pulls.append((found - truth) / np.concatenate((c.bias_sd, c.matrix_sd.ravel(), c.g_sensitivity_sd.ravel())))
    spread = np.sqrt(np.mean(np.square(pulls), axis=0))
    # the root mean square of 100 draws of standard deviation 1 scatters by 1/√200; 4 of these. A drift is known from 6
    # degrees of freedom, so that what hangs on it has the spread of Student's distribution, √(6/4), at most.
    slack = 4.0 / np.sqrt(2.0 * trials)
    most = np.where(np.isin(np.arange(21), range(3, 12)) | (drift == 0.0), 1.0, np.sqrt(6.0 / 4.0))
    assert (spread > 1.0 - slack).all() and (spread < most * (1.0 + slack)).all()


def test_a_tilt_of_the_mounting_moves_neither_bias_nor_noise():
    tilted, straight = fit(SIX, tilt=deg(0.2), seed=3).calibration, fit(SIX, seed=3).calibration
    # 0.2° of tilt at 200 °/s is 0.7 °/s, 47 times the noise; of second order it is 0.001 °/s. The residuals' rms over
    # 108 degrees of freedom, 126 numbers, is below the noise but for 2 standard deviations of 7 %.
    assert tilted.residual_rms < 1.14 * NOISE and straight.residual_rms < 1.14 * NOISE
    np.testing.assert_allclose(tilted.bias, BIAS, rtol=0, atol=4.0 * NOISE / np.sqrt(42))


def test_a_slow_table_tells_as_much_of_matrix_and_tilt_as_a_fast_one():
    """All rates of 1/50, with noise to match, up to 4 °/s: the regression is linear in the rates."""
    nominal, measured, force = session(SIX, tilt=deg(0.2), seed=3)
    fast = fit_table(nominal, measured, force=force).calibration
    slow = fit_table(nominal / 50.0, measured / 50.0, force=force).calibration
    np.testing.assert_allclose(slow.matrix, fast.matrix, rtol=0, atol=1e-9)
    np.testing.assert_allclose(slow.matrix_sd, fast.matrix_sd, rtol=1e-6)
    assert slow.residual_rms == pytest.approx(fast.residual_rms / 50.0, rel=1e-6)


def test_a_tilt_that_is_larger_than_assumed_is_told_and_taken_into_the_covariance():
    poor = fit(SIX, tilt=deg(1.0), seed=1)
    assert any("opposite mountings differ" in remark for remark in poor.remarks)
    off = ~np.eye(3, dtype=bool)
    error = (poor.calibration.matrix - np.linalg.inv(RESPONSE))[off]
    assert (np.abs(error) < 4.0 * poor.calibration.matrix_sd[off]).all()
    assert not any("opposite" in remark for remark in fit(SIX, tilt=deg(0.1), seed=1).remarks)


@pytest.mark.parametrize(("coupling", "parameters"), [(COUPLING, 21), (np.zeros((3, 3)), 12)])
def test_auto_takes_the_model_that_the_session_shows(coupling, parameters):
    found = fit(SIX, coupling=coupling, tilt=deg(0.1))
    assert found.calibration.method.endswith(f"{parameters} parameters")
    assert found.calibration.g_sensitivity.any() == (parameters == 21)


def test_auto_seldom_sees_a_coupling_that_is_none():
    # The F-test is at 1 %: more than 6 of 150 have the chance 0.0008 (binomial), with drift as without.
    for drift in (0.0, 2.0 * NOISE):
        how = {"coupling": np.zeros((3, 3)), "rates": (100.0,), "drift": drift}
        assert sum(fit(SIX, seed=s, **how).calibration.g_sensitivity.any() for s in range(150)) <= 6


def test_as_many_faces_as_parameters_leave_nothing_to_tell_coupling_from_drift():
    found = fit(SIX[:5])
    assert "21 parameters" in found.calibration.method
    four = [SIX[0], SIX[1], SIX[2], SIX[4]]
    assert any("4 faces are too few" in remark for remark in fit(four).remarks)
    assert not fit(four).calibration.g_sensitivity.any()


def test_one_face_per_axis_leaves_the_coupling_in_the_bias_and_says_so():
    found = fit(THREE, rest=False)
    assert "12 parameters" in found.calibration.method
    assert any("g-sensitivity cannot be separated from the bias" in remark for remark in found.remarks)
    (why,) = reasons(lambda: fit(THREE, rest=False, model="21"))
    assert why.kind == "ill-conditioned"
    assert "the bias, the specific force along x, the specific force along y and the specific force along z" in why.text


def test_twelve_parameters_on_request_tell_what_they_leave_out():
    assert any("g-sensitivity shows" in remark for remark in fit(SIX, model="12").remarks)


def test_the_latitude_takes_the_earths_rate_out_of_the_coupling():
    vertical = EARTH_RATE * np.sin(deg(48.0))
    known = fit(SIX, noise=0.0, earth=vertical, latitude=deg(48.0)).calibration
    unknown = fit(SIX, noise=0.0, earth=vertical)
    np.testing.assert_allclose(known.g_sensitivity, COUPLING, rtol=0, atol=1e-9 * dps(200.0) / G0)
    # without it, S times the Earth's rate along up is read as a coupling to up
    np.testing.assert_allclose(
        unknown.calibration.g_sensitivity - COUPLING, RESPONSE * vertical / G0, rtol=0, atol=1e-9 * dps(200.0) / G0
    )
    assert any("Earth's rate" in remark for remark in unknown.remarks)


def test_a_latitude_without_specific_force_is_refused():
    nominal, measured, _ = session(SIX)
    with pytest.raises(ParameterError, match="specific force"):
        fit_table(nominal, measured, latitude=0.5)


def test_longer_plateaus_weigh_more():
    nominal, measured, force = session(SIX, noise=0.0)
    seconds = np.full(len(nominal), 10.0)
    measured[3] += dps(1.0)
    seconds[3] = 1e-3
    spoilt = fit_table(nominal, measured, force=force, seconds=seconds, model="21").calibration
    # weight 1e-4 of the others, one of 12 and more that share the parameter: an error below 1e-4 · 1 °/s
    np.testing.assert_allclose(spoilt.bias, BIAS, rtol=0, atol=1e-4 * dps(1.0))


def test_grade_and_scale_sd():
    good, fair = fit(SIX).calibration.quality, fit(SIX, noise=10.0 * NOISE).calibration.quality
    assert good.grade == "good" and good.scale_sd < SCALE_GRADES["good"]
    assert fair.grade == "fair" and SCALE_GRADES["good"] < fair.scale_sd < SCALE_GRADES["fair"]
    assert good.samples == 42 and good.condition == pytest.approx(1.0, abs=0.01)


def test_an_axis_that_was_never_spun_is_named():
    (why,) = reasons(lambda: fit(SIX[:4]))
    assert why.kind == "too-few" and "about z" in why.text


def test_five_plateaus_do_and_four_do_not():
    nominal = dps(np.array([[100.0, 0, 0], [0, 100.0, 0], [0, 0, 100.0], [0, 0, 0], [-100.0, 0, 0]]))
    assert "12 parameters" in fit_table(nominal, nominal + BIAS).calibration.method
    (why,) = reasons(lambda: fit_table(nominal[:4], nominal[:4] + BIAS))
    assert why.kind == "too-few" and "4 plateaus" in why.text


def test_one_rate_of_one_sign_does_not_tell_bias_from_scale():
    nominal = dps(100.0) * (np.array([[1.0, 1, -1], [1, 1.001, -1], [1, 1, -1.001], [1.001, 1, -1], [1, 1, -1]]))
    (why,) = reasons(lambda: fit_table(nominal, nominal))
    assert why.kind == "ill-conditioned"


def test_clipped_plateaus_are_refused():
    nominal, measured, force = session(SIX)
    clipped = np.zeros(len(nominal))
    clipped[5] = 0.34
    (why,) = reasons(lambda: fit_table(nominal, measured, force=force, clipped=clipped))
    assert why.kind == "clipping" and "34 %" in why.text and "(200, 0, 0)" in why.text


@pytest.mark.parametrize("wrong", [np.degrees, lambda m: m[:, [1, 0, 2]], lambda m: -m])
def test_a_response_that_no_gyroscope_has_is_refused(wrong):
    nominal, measured, force = session(SIX)
    (why,) = reasons(lambda: fit_table(nominal, wrong(measured), force=force))
    assert why.kind == "implausible"


def test_nan_and_wrong_shapes_are_refused():
    nominal, measured, force = session(SIX)
    measured[2, 1] = np.nan
    assert reasons(lambda: fit_table(nominal, measured, force=force))[0].kind == "too-few"
    with pytest.raises(ShapeError):
        fit_table(nominal, measured[:5])
    with pytest.raises(ShapeError, match="model"):
        fit_table(nominal, measured, model="18")
