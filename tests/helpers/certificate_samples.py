"""Calibrations to show: planted errors, and fits that found them to within a planted uncertainty."""

import numpy as np

from plumbob.calibration.fit import Fitted
from plumbob.calibration.predicted import REGIONS
from plumbob.core.units import deg, dps, g, to_si
from plumbob.data.cards import Quality, TriadCalibration


def covariance(bias_sd, matrix_sd):
    return np.diag(np.r_[np.full(3, bias_sd), np.full(9, matrix_sd)] ** 2)


def mag_calibration(**changes):
    """Hard iron of 12.34, −5.6, 30 µT; the x axis reads 2 % too much, y points 1° towards x."""
    response = np.array([[1.02, 0.0, 0.0], [np.sin(deg(1.0)), np.cos(deg(1.0)), 0.0], [0.0, 0.0, 1.0]])
    given = {
        "matrix": np.linalg.inv(response), "bias": [12.34, -5.6, 30.0], "unit_in": "uT", "unit_out": "uT",
        "covariance": covariance(0.12, 0.002), "residual_rms": 0.25, "reference": 48.2, "method": "ellipsoid",
        "date": "2026-11-20",
        "quality": Quality(grade="fair", samples=300, outliers=3, regions=17, condition=45.6, heading_sd=deg(0.31),
                           tilt_range=deg(45.0)),
    }  # fmt: skip
    return TriadCalibration(**given | changes)


def gyr_calibration(**changes):
    given = {
        "matrix": np.diag([1.0004, 1.0, 0.9996]), "bias": dps(np.array([1.5, -0.25, 0.01])), "unit_in": "rad/s",
        "unit_out": "rad/s", "covariance": covariance(dps(0.003), 4e-5), "bias_per_k": dps(np.array([[0.03, 0, -0.02],
        [1e-3, 0, 0]])), "bias_per_k_sd": dps(np.full((2, 3), 5e-4)), "temp_span_c": (10.0, 45.0),
        "g_sensitivity": dps(0.1) / g(1.0) * np.eye(3), "g_sensitivity_sd": dps(0.006) / g(1.0) * np.ones((3, 3)),
        "residual_rms": dps(0.02), "method": "rate table",
        "quality": Quality(grade="good", samples=42, scale_sd=4e-5),
    }  # fmt: skip
    return TriadCalibration(**given | changes)


def acc_calibration(**changes):
    given = {"matrix": np.eye(3), "bias": to_si(np.array([30.0, 0, -12]), "mg"), "unit_in": "m/s2", "unit_out": "m/s2"}
    return TriadCalibration(**given | changes)


def mag_fit(model, *, count=300, missing="+x−z", remarks=()):
    """Samples of a field of 48.2 µT in every region but one, with noise of 0.25 µT and three planted outliers."""
    from plumbob.calibration.predicted import NAMES, region_of

    rng = np.random.default_rng(7)
    directions = rng.normal(size=(2 * count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    truth = 48.2 * directions
    measured = truth @ np.linalg.inv(model.matrix).T + model.bias + 0.25 * rng.normal(size=truth.shape)
    keep = region_of(measured - model.bias) != NAMES.index(missing)
    measured = measured[keep][:count]
    used = np.ones(len(measured), dtype=bool)
    used[[10, 100, 200]] = False
    measured[~used] += 20.0
    residuals = np.linalg.norm((measured - model.bias) @ model.matrix.T, axis=1) - 48.2
    return Fitted(model, measured, residuals, used, remarks)


def gyr_fit(model, *, remarks=()):
    rates = dps(50.0) * np.repeat(REGIONS, 2, axis=0)
    residuals = dps(0.02) * np.random.default_rng(3).normal(size=rates.shape)
    return Fitted(model, rates, residuals, np.ones(len(rates), dtype=bool), remarks)
