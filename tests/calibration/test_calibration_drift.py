"""The drift model of the trackball paper: its corrected equations, and that its misprints would be noticed."""

import numpy as np
import pytest

from plumbob.calibration.gyr.drift import GyroDrift, accumulate, chen2013, rotation_vectors
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, ShapeError
from plumbob.core.units import dps, to_dps
from plumbob.rotations import quat_angle, quat_from_rotvec, quat_multiply

EPS = np.finfo(float).eps
COUPLING = np.array([[1e-4, -2e-4, 3e-4], [4e-4, 5e-4, -6e-4], [-7e-4, 8e-4, 9e-4]])
RNG = np.random.default_rng(0)
N = 50
RATE, FORCE, TEMP = RNG.normal(size=(N, 3)), RNG.normal(size=(N, 3)) * 10.0, RNG.uniform(-10.0, 60.0, N)


def whole(**changes):
    planted = {
        "bias": [0.01, -0.02, 0.03], "bias_per_k": [1e-3, -2e-3, 3e-3], "scale": [0.01, -0.02, 0.03],
        "g_sensitivity": COUPLING,
    }  # fmt: skip
    return GyroDrift(**{**planted, **changes})


def test_the_equation_row_by_row():
    """[Chen2013] (1) to (5): N = A0 + k_T (T − 25) + B_s ω + k_a a, which the compensation takes off again."""
    d = whole()
    drift = [
        d.bias + d.bias_per_k * (t - 25.0) + d.scale * w + COUPLING @ a
        for w, t, a in zip(RATE, TEMP, FORCE, strict=True)
    ]
    measured = RATE + drift
    found = d.compensate(measured, TEMP, FORCE)
    assert np.abs(found - RATE).max() < 16 * EPS * np.abs(measured).max()  # a dozen roundings of numbers that large
    assert np.abs(d.compensate(measured[7], TEMP[7], FORCE[7]) - RATE[7]).max() < 16 * EPS * np.abs(measured).max()


def test_paper_figures_in_the_paper_units():
    """[Chen2013] (3), (5): 0.1 °/s at 26 °C, and 0.1 °/s more at 1 g; a in m/s² would give 0.98 °/s.

    As its docstring says, on a part of −0.05 °/s/K (−0.05 − 0.1) · 20 K are left.
    """
    d = chen2013()
    for temp, force, drift in (
        (26.0, [0.0, 0.0, 0.0], [0.1, 0.1, 0.1]),
        (25.0, [0.0, 0.0, G0], [0.0, 0.0, 0.1]),
        (25.0, [G0, -2.0 * G0, 0.0], [0.1, -0.2, 0.0]),
    ):
        assert to_dps(d.offset(temp, force)) == pytest.approx(drift, rel=4 * EPS)
    assert not d.bias.any() and not d.scale.any()
    assert to_dps(d.compensate(dps(np.full(3, -1.0)), 45.0, np.zeros(3))) == pytest.approx([-3.0] * 3)


def test_one_number_is_the_diagonal_and_nan_stays():
    """The paper's form: each axis answers to its own acceleration only."""
    d = GyroDrift(bias=0.1, bias_per_k=0.2, scale=0.3, g_sensitivity=0.4)
    assert [d.bias.tolist(), d.bias_per_k.tolist(), d.scale.tolist()] == [[0.1] * 3, [0.2] * 3, [0.3] * 3]
    assert d.g_sensitivity.tolist() == (0.4 * np.eye(3)).tolist()
    rate = np.ones((3, 3))
    assert GyroDrift(bias=5.0).at_rest(rate).bias.tolist() == [1.0, 1.0, 1.0]  # the old bias does not matter
    rate[1, 2] = np.nan
    d = GyroDrift().at_rest(rate)
    assert d.bias.tolist() == [1.0, 1.0, 1.0]
    assert np.isnan(d.compensate(rate)).tolist() == np.isnan(rate).tolist()


def test_the_bias_at_rest_holds_neither_temperature_nor_gravity():
    """[Chen2013] (6): A0 and not A: with the warm bias in it, `compensate` would take the temperature off twice."""
    level = np.tile([0.0, 0.0, G0], (4, 1))
    warm = np.full(4, 35.0)
    measured = np.tile(whole(scale=0.0).offset(35.0, level[0]), (4, 1)) + [[0.1], [-0.1], [0.2], [-0.2]]
    found = whole(bias=0.0, scale=0.0).at_rest(measured, warm, level)
    np.testing.assert_allclose(found.bias, [0.01, -0.02, 0.03], atol=4 * EPS)
    assert np.abs(found.compensate(measured, warm, level).mean(axis=0)).max() < 4 * EPS
    assert (found.g_sensitivity == COUPLING).all()


@pytest.mark.parametrize(("call", "error", "text"), [
    (lambda: GyroDrift(bias=[1.0, 2.0]), CalibrationError, r"bias must be a number or of shape \(3,\)"),
    (lambda: GyroDrift(bias=np.nan), CalibrationError, "bias must be"),
    (lambda: GyroDrift(g_sensitivity=[1.0, 2.0, 3.0]), CalibrationError, r"of shape \(3, 3\)"),
    (lambda: GyroDrift(scale=-1.0), CalibrationError, "scale must be above −1"),
    (lambda: GyroDrift(temp_ref_c=[25.0]), CalibrationError, "temp_ref_c"),
    (lambda: GyroDrift().at_rest(np.full((1, 3), np.nan)), CalibrationError, "no row of gyr"),
    (lambda: chen2013().compensate(RATE, acc=FORCE), CalibrationError, "depends on temp_c, but none is given"),
    (lambda: chen2013().compensate(RATE, TEMP), CalibrationError, "depends on acc, but none is given"),
    (lambda: GyroDrift().compensate(RATE.T), ShapeError, "gyr must have shape"),
])  # fmt: skip
def test_what_makes_no_sense_is_refused(call, error, text):
    with pytest.raises(error, match=text):
        call()


A, B, T = 3.0, 2.0, 1.5  # turning with a about the fixed z and with b about the body's x


def precessed(n):
    t = np.linspace(0.0, T, n + 1)
    rate = np.stack((np.full_like(t, B), A * np.sin(B * t), A * np.cos(B * t)), axis=1)
    q = np.empty((n + 1, 4))
    accumulate(rotation_vectors(rate, np.diff(t)), q)
    return q[-1]


def test_a_precession_and_a_constant_rate_end_where_their_closed_forms_do():
    true = quat_multiply(quat_from_rotvec([0.0, 0.0, A * T]), quat_from_rotvec([B * T, 0.0, 0.0]))
    for n in (50, 200):
        error = float(quat_angle(true, precessed(n)))
        bound = (T / n) ** 2 / 12.0 * T * A * B**2  # of the trapezoidal rule, |ω''| = a b²
        assert 1e-3 * bound < error <= bound
    rate = np.tile([0.3, -2.0, 1.0], (40, 1))
    q = np.empty((40, 4))
    accumulate(rotation_vectors(rate, np.full(39, 0.1)), q)
    true = quat_from_rotvec(3.9 * rate[0])
    assert abs(abs(float(q[-1] @ true)) - 1.0) <= 39 * 8 * np.finfo(float).eps
