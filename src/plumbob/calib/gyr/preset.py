"""The trackball paper's drift as a calibration: a bias at rest, and coefficients that nobody measured [Chen2013]."""

import numpy as np
from numpy.typing import NDArray

from plumbob.calib.fitted import Fitted
from plumbob.calib.gyr.drift import chen2013
from plumbob.calib.gyr.known import UNCALIBRATED, new_bias_covariance
from plumbob.calib.gyr.plausible import beyond_bias, unseen_turn
from plumbob.calib.gyr.rest import bias_of, rest
from plumbob.calib.refusal import refuse
from plumbob.cards import UNITS, Quality, TriadCalibration
from plumbob.check import Floats
from plumbob.units import to_dps


def fit_trackball(
    t: Floats,
    gyr: Floats,
    *,
    acc: Floats | None,
    temp_c: Floats | None,
    mag: Floats | None = None,
    clipped: NDArray[np.bool_] | None = None,
) -> Fitted:
    """Bias at rest with the paper's coefficients of temperature and specific force.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    gyr : ndarray (N, 3)
        Measured rates, rad/s.
    acc : ndarray (N, 3) or None
        Specific force, m/s²; needed. A card's g-sensitivity acts on the calibrated one.
    temp_c : ndarray (N,) or None
        Temperature, °C; needed.
    mag : ndarray (N, 3), optional
        Flux density, calibrated or not, which tells constant turning from rest.
    clipped : ndarray (N,) of bool, optional
        Samples at the end of the gyroscope's range.

    Raises
    ------
    CaptureRefusedError
        not-still, clipping, implausible.
    CalibrationError
        If acc or temp_c is missing.
    """
    where, turned = rest(t, gyr, acc, clipped, mag)
    still = np.concatenate([np.arange(one.start, one.stop) for one in where])
    drift = chen2013().at_rest(
        gyr[still], None if temp_c is None else temp_c[still], None if acc is None else acc[still]
    )
    refuse(beyond_bias(drift.bias))
    _, spread, means = bias_of([drift.compensate(gyr[one], temp_c[one], acc[one]) for one in where])  # type: ignore[index]
    calibration = TriadCalibration(
        np.diag(1.0 / (1.0 + drift.scale)),
        drift.bias,
        UNITS["gyr"],
        UNITS["gyr"],
        bias_per_k=drift.bias_per_k,
        temp_ref_c=drift.temp_ref_c,
        g_sensitivity=drift.g_sensitivity,
        covariance=new_bias_covariance(UNCALIBRATED, np.diag(spread**2)),
        residual_rms=float(np.sqrt(np.mean(means**2))),
        method="gyr by the trackball paper's preset, bias at rest",
        quality=Quality(grade="poor", samples=still.size),
    )
    slope = to_dps(float(drift.bias_per_k[0]))
    told = (
        f"ASSUMED, NOT MEASURED: {slope:g} °/s per °C and 0.1 °/s per g are the paper's figures for every part. This "
        "unit's may have another size or sign, and then the card makes it worse than none away from "
        "the temperature of the capture. 'plumbob calibrate temperature' measures them. Its grade is poor for that.",
        *turned,
        *unseen_turn(acc, mag, where),
    )
    return Fitted(calibration, means, means, np.ones(len(where), dtype=bool), told)
