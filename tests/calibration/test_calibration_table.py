"""Rate tables: plateaus are found and matched, planted parameters come back as the covariance says."""

import numpy as np
import pytest

from plumbob.calibration.calibrate_gyro import match_rates, plateaus
from plumbob.calibration.gyr.table import SCALE_GRADES, fit_table
from plumbob.core.constants import EARTH_RATE, G0
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import deg, dps
from tests.helpers.refusals import reasons

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
            drifted = bias + coupling @ (G0 * true)
            measured.append(drifted + RESPONSE @ ((spin + earth) * true) + rng.normal(0, noise, 3))
    return np.array(nominal), np.array(measured), np.array(force)


def fit(faces, *, model="auto", latitude=None, **how):
    nominal, measured, force = session(faces, **how)
    return fit_table(nominal, measured, force=force, model=model, latitude=latitude)


def test_planted_parameters_come_back_and_longer_plateaus_weigh_more():
    found = fit(SIX, noise=0.0).calibration
    # The regression is solved in columns of norm 1 with condition 1: 1e-9 of each parameter's scale is ample.
    np.testing.assert_allclose(found.bias, BIAS, rtol=0, atol=1e-9 * dps(200.0))
    np.testing.assert_allclose(found.matrix, np.linalg.inv(RESPONSE), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.g_sensitivity, COUPLING, rtol=0, atol=1e-9 * dps(200.0) / G0)
    nominal, measured, force = session(SIX, noise=0.0)
    seconds = np.full(len(nominal), 10.0)
    measured[3] += dps(1.0)
    seconds[3] = 1e-3
    spoilt = fit_table(nominal, measured, force=force, seconds=seconds, model="21").calibration
    # weight 1e-4 of the others, one of 12 and more that share the parameter: an error below 1e-4 · 1 °/s
    np.testing.assert_allclose(spoilt.bias, BIAS, rtol=0, atol=1e-4 * dps(1.0))


@pytest.mark.parametrize("drift", [0.0, 2.0 * NOISE])
def test_errors_are_as_large_as_the_covariance_says(drift):
    trials, pulls = 60, []
    truth = np.concatenate((BIAS, np.linalg.inv(RESPONSE).ravel(), COUPLING.ravel()))
    for seed in range(trials):
        c = fit(SIX, seed=seed, tilt=deg(0.1), drift=drift, model="21").calibration
        found = np.concatenate((c.bias, c.matrix.ravel(), c.g_sensitivity.ravel()))
        pulls.append((found - truth) / np.concatenate((c.bias_sd, c.matrix_sd.ravel(), c.g_sensitivity_sd.ravel())))
    spread = np.sqrt(np.mean(np.square(pulls), axis=0))
    # the root mean square of 60 draws of standard deviation 1 scatters by 1/√120; 4 of these. A drift is known from 6
    # degrees of freedom, so that what hangs on it has the spread of Student's distribution, √(6/4), at most.
    slack = 4.0 / np.sqrt(2.0 * trials)
    most = np.where(np.isin(np.arange(21), range(3, 12)) | (drift == 0.0), 1.0, np.sqrt(6.0 / 4.0))
    assert (spread > 1.0 - slack).all() and (spread < most * (1.0 + slack)).all()


def test_tilts_move_no_bias_and_are_told_where_they_are_large():
    tilted, straight = fit(SIX, tilt=deg(0.2), seed=3).calibration, fit(SIX, seed=3).calibration
    # 0.2° of tilt at 200 °/s is 0.7 °/s, 47 times the noise; of second order it is 0.001 °/s. The residuals' rms over
    # 108 degrees of freedom, 126 numbers, is below the noise but for 2 standard deviations of 7 %.
    assert tilted.residual_rms < 1.14 * NOISE and straight.residual_rms < 1.14 * NOISE
    np.testing.assert_allclose(tilted.bias, BIAS, rtol=0, atol=4.0 * NOISE / np.sqrt(42))
    poor = fit(SIX, tilt=deg(1.0), seed=1)
    assert any("opposite mountings differ" in str(remark) for remark in poor.remarks)
    off = ~np.eye(3, dtype=bool)
    error = (poor.calibration.matrix - np.linalg.inv(RESPONSE))[off]
    assert (np.abs(error) < 4.0 * poor.calibration.matrix_sd[off]).all()
    assert not any("opposite" in str(remark) for remark in fit(SIX, tilt=deg(0.1), seed=1).remarks)


def test_a_slow_table_tells_as_much_of_matrix_and_tilt_as_a_fast_one():
    """All rates of 1/50, with noise to match, up to 4 °/s: the regression is linear in the rates."""
    nominal, measured, force = session(SIX, tilt=deg(0.2), seed=3)
    fast = fit_table(nominal, measured, force=force).calibration
    slow = fit_table(nominal / 50.0, measured / 50.0, force=force).calibration
    np.testing.assert_allclose(slow.matrix, fast.matrix, rtol=0, atol=1e-9)
    np.testing.assert_allclose(slow.matrix_sd, fast.matrix_sd, rtol=1e-6)
    assert slow.residual_rms == pytest.approx(fast.residual_rms / 50.0, rel=1e-6)


def test_auto_seldom_sees_a_coupling_that_is_none():
    # The F-test is at 1 %: more than 4 of 75 have the chance 0.0009 (binomial), with drift as without.
    for drift in (0.0, 2.0 * NOISE):
        how = {"coupling": np.zeros((3, 3)), "rates": (100.0,), "drift": drift}
        assert sum(fit(SIX, seed=s, **how).calibration.g_sensitivity.any() for s in range(75)) <= 4


@pytest.mark.parametrize(("faces", "options", "parameters", "remark"), [
    (SIX, {"tilt": deg(0.1)}, 21, ""),
    (SIX, {"tilt": deg(0.1), "coupling": np.zeros((3, 3))}, 12, ""),
    (SIX[:5], {}, 21, ""),  # as many faces as parameters leave nothing to tell coupling from drift
    ([SIX[0], SIX[1], SIX[2], SIX[4]], {}, 12, "4 faces are too few"),
    (THREE, {"rest": False}, 12, "g-sensitivity cannot be separated from the bias"),
    (SIX, {"model": "12"}, 12, "g-sensitivity shows"),
])  # fmt: skip
def test_what_few_faces_leave_out_is_said(faces, options, parameters, remark):
    made = fit(faces, **options)
    assert made.calibration.method.endswith(f"{parameters} parameters")
    assert made.calibration.g_sensitivity.any() == (parameters == 21)
    assert remark in " ".join(map(str, made.remarks))


def test_the_latitude_takes_the_earths_rate_out_of_the_coupling():
    vertical = EARTH_RATE * np.sin(deg(48.0))
    known = fit(SIX, noise=0.0, earth=vertical, latitude=deg(48.0)).calibration
    unknown = fit(SIX, noise=0.0, earth=vertical)
    np.testing.assert_allclose(known.g_sensitivity, COUPLING, rtol=0, atol=1e-9 * dps(200.0) / G0)
    # without it, S times the Earth's rate along up is read as a coupling to up
    read = unknown.calibration.g_sensitivity - COUPLING
    np.testing.assert_allclose(read, RESPONSE * vertical / G0, rtol=0, atol=1e-9 * dps(200.0) / G0)
    assert any("Earth's rate" in str(remark) for remark in unknown.remarks)


def test_grade_and_scale_sd():
    good, fair = fit(SIX).calibration.quality, fit(SIX, noise=10.0 * NOISE).calibration.quality
    assert good.grade == "good" and good.scale_sd < SCALE_GRADES["good"]
    assert fair.grade == "fair" and SCALE_GRADES["good"] < fair.scale_sd < SCALE_GRADES["fair"]
    assert good.samples == 42 and good.condition == pytest.approx(1.0, abs=0.01)


NOMINAL, MEASURED, FORCE = session(SIX)
FIVE = dps(np.array([[100.0, 0, 0], [0, 100.0, 0], [0, 0, 100.0], [0, 0, 0], [-100.0, 0, 0]]))
ALIKE = dps(100.0) * (np.array([[1.0, 1, -1], [1, 1.001, -1], [1, 1, -1.001], [1.001, 1, -1], [1, 1, -1]]))
GONE = MEASURED.copy()
GONE[2, 1] = np.nan
CLIPPED = np.zeros(len(NOMINAL))
CLIPPED[5] = 0.34
ALONG = "the bias, the specific force along x, the specific force along y and the specific force along z"


def table(nominal, measured, **options):
    return lambda: fit_table(nominal, measured, **{"force": FORCE} | options)


@pytest.mark.parametrize(("call", "kind", "texts"), [
    (lambda: fit(THREE, rest=False, model="21"), "ill-conditioned", [ALONG]),
    (lambda: fit(SIX[:4]), "too-few", ["about z"]),
    (table(FIVE[:4], FIVE[:4] + BIAS, force=None), "too-few", ["4 plateaus"]),
    (table(ALIKE, ALIKE, force=None), "ill-conditioned", []),
    (table(NOMINAL, MEASURED, clipped=CLIPPED), "clipping", ["34 %", "(200, 0, 0)"]),
    (table(NOMINAL, np.degrees(MEASURED)), "implausible", []),
    (table(NOMINAL, MEASURED[:, [1, 0, 2]]), "implausible", []),
    (table(NOMINAL, -MEASURED), "implausible", []),
    (table(NOMINAL, GONE), "too-few", []),
])  # fmt: skip
def test_sessions_that_tell_no_gyroscope_are_refused(call, kind, texts):
    (why, *others) = reasons(call)
    assert why.kind == kind and all(text in why.text for text in texts)
    assert others == [] or kind == "too-few"


def test_arguments_that_do_not_fit_are_refused():
    assert "12 parameters" in fit_table(FIVE, FIVE + BIAS).calibration.method  # five plateaus do
    for call, error, text in (
        (table(NOMINAL, MEASURED, force=None, latitude=0.5), ParameterError, "specific force"),
        (table(NOMINAL, MEASURED[:5]), ShapeError, "measured"),
        (table(NOMINAL, MEASURED, model="18"), ShapeError, "model"),
    ):
        with pytest.raises(error, match=text):
            call()


RATE = 100.0
SCATTER = float(dps(0.05))  # 0.005 °/s/√Hz at 100 Hz


def recording(levels, *, hold=6.0, ramp=2.0, noise=SCATTER, bias=(0.0, 0.0, 0.0), rate=RATE):
    """Rates about z, °/s, held and ramped; the true start and end of each plateau, s."""
    start = (hold + ramp) * np.arange(len(levels))
    knots = np.stack((start, start + hold), axis=1)
    t = np.arange(round((knots[-1, 1]) * rate)) / rate
    gyr = np.zeros((t.size, 3))
    gyr[:, 2] = dps(np.interp(t, knots.ravel(), np.repeat(levels, 2)))
    return t, gyr + np.asarray(bias) + np.random.default_rng(1).normal(0.0, noise, gyr.shape), knots


@pytest.mark.parametrize("rate", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("noise", [0.0, SCATTER, 10.0 * SCATTER])
def test_each_plateau_is_found_and_no_ramp(rate, noise):
    t, gyr, knots = recording([0.0, 50.0, 100.0, -200.0, 0.0], noise=noise, rate=rate)
    found = plateaus(t, gyr)
    assert len(found) == len(knots)
    block = max(0.25, 4.0 / rate)
    for one, (start, stop) in zip(found, knots, strict=True):
        assert start <= t[one.start] and t[one.stop - 1] <= stop
        # a block that a ramp shares at either end, and one more that is left out
        assert t[one.stop - 1] - t[one.start] > stop - start - 4.5 * block


def test_drifting_rates_are_no_plateaus():
    t = np.arange(3000) / RATE
    gyr = np.zeros((t.size, 3))
    gyr[:, 0] = dps(2.0) * t  # 2 °/s²: half a degree per second from block to block
    assert plateaus(t, gyr) == []
    t = np.arange(4000) / RATE
    gyr = np.zeros((t.size, 3))
    gyr[:, 0] = dps(100.0 + 0.3 * np.maximum(t - 20.0, 0.0))  # 0.075 °/s per block: below the step that ends a run
    (found,) = plateaus(t, gyr)
    # of the 0.15 °/s that 100 °/s may waver by, 0.3 °/s² takes half a second
    assert t[found.stop - 1] < 21.0
    assert np.abs(gyr[found, 0] - dps(100.0)).max() < dps(0.3)


def test_short_stretches_nan_and_short_recordings_are_none():
    t, gyr, _ = recording([0.0, 50.0], hold=1.5)
    assert plateaus(t, gyr) == []
    t, gyr, _ = recording([0.0, 50.0])
    gyr[:, 1] = np.nan
    assert (plateaus(t, gyr), plateaus(t[:3], gyr[:3])) == ([], [])
    gyr[:, 1] = 0.0
    gyr[1100, 1] = np.nan  # in the second plateau, from 8 to 14 s
    assert len(plateaus(t, gyr)) == 3 and all(np.isfinite(gyr[one]).all() for one in plateaus(t, gyr))


def turns(bias=(0.0, 0.0, 0.0)):
    signs = [s * r for r in (50.0, 100.0) for s in (1.0, -1.0)]
    true = np.vstack([np.zeros((3, 3)), *(rate * np.eye(3)[[axis]] for axis in range(3) for rate in signs)])
    return dps(true), dps(true) * 1.03 + np.asarray(bias)


def test_rates_are_matched_or_set_aside():
    true, means = turns(dps(np.array([20.0, -15.0, 8.0])))  # ±20 °/s is what sheets of consumer parts allow
    matched = match_rates(means, dps(np.array([100.0, 0.0, 50.0])))
    assert matched.found.all()
    np.testing.assert_allclose(matched.rate, true, rtol=0, atol=1e-15)
    _, means = turns()
    wrong = dps(np.array([[70.0, 0.0, 0.0], [100.0, 30.0, 0.0], [0.0, 0.0, 6.0], [0.0, 111.0, 0.0]]))
    matched = match_rates(np.vstack((means, wrong)), dps(np.array([50.0, 100.0])))
    assert matched.found.tolist() == [True] * len(means) + [False] * len(wrong)
    assert not matched.rate[~matched.found].any()
    assert not match_rates(means, np.zeros(1)).found.any()
    assert match_rates(means[:0], np.ones(1)).rate.shape == (0, 3)
