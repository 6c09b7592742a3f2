"""Errors of an attitude against a reference, sample by sample, their statistics, and whether a claimed sd holds.

Total, heading and inclination are those of the BROAD benchmark [Laidig2021]: with e = q_est ⊗ q_ref⁻¹ in a navigation
frame whose z axis is vertical, e = (w, x, y, z) is a turn about the vertical after a tilt, and

=============  ==========================  ========================================================
total          2 acos |w|                  angle of e
heading        2 atan |z / w|              angle of the turn about the vertical
inclination    2 acos √(w² + z²)           angle between the vertical and where the estimate puts it
=============  ==========================  ========================================================

all in [0, π], independent of the sign of a quaternion and the same in ENU, NED and NWU. They are computed by atan2:
acos loses half of the digits of a small angle.

Yaw, pitch and roll errors are signed, estimate minus reference, in (−π, π]. They are differences of Euler angles, not
angles of a rotation: near pitch ±90° a small rotation is a large difference, so yaw and roll are left out there.

Does the error fit the covariance that the filter claims? Normalised estimation error squared, [BarShalom2001] sec. 5.4.

With d the attitude error as a rotation vector in body axes and P its claimed covariance, dᵀ P⁻¹ d follows a chi-square
law of 3 degrees of freedom where the filter is consistent: 3 on average, and within its 95 % bounds in 95 % of the
samples. Far above, the filter trusts itself too much; far below, too little. Errors of one recording are correlated in
time, so the bounds of the average over independent runs do not apply to the average over one recording.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.units import deg
from plumbob.rotations import dcm_from_quat, euler_zyx_from_quat, quat_conjugate, quat_multiply, rotvec_from_quat, wrap

QUANTITIES = ("total", "heading", "inclination", "yaw", "pitch", "roll")
NEEDS_HEADING = ("total", "heading", "yaw")  # mean nothing unless both headings count from the same zero

GIMBAL_GUARD = deg(5.0)  # of a pitch from ±90°, rad: inside, yaw and roll magnify an error by 11.5 and are not scored


def attitude_errors(q_est: Floats, q_ref: Floats) -> dict[str, Floats]:
    """Errors of an estimate, one array (N,) in rad for each of `QUANTITIES`, in one frame whose z axis is vertical.

    NaN where one of the two is not known; yaw and roll also where one is within `GIMBAL_GUARD` of pitch ±90°.
    """
    w, x, y, z = np.abs(np.moveaxis(error_quat(q_est, q_ref), -1, 0))
    est, ref = euler_zyx_from_quat(q_est), euler_zyx_from_quat(q_ref)
    yaw, pitch, roll = np.moveaxis(wrap(est - ref), -1, 0)
    steep = np.maximum(np.abs(est[:, 1]), np.abs(ref[:, 1])) > 0.5 * np.pi - GIMBAL_GUARD
    return {
        "total": 2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), w),  # [Laidig2021]
        "heading": 2.0 * np.arctan2(z, w),  # [Laidig2021]
        "inclination": 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z)),  # [Laidig2021]
        "yaw": np.where(steep, np.nan, yaw),
        "pitch": pitch,
        "roll": np.where(steep, np.nan, roll),
    }


def error_quat(q_est: Floats, q_ref: Floats) -> Floats:
    """Error e = q_est ⊗ q_ref⁻¹ in the navigation frame, (N, 4)."""
    return quat_multiply(q_est, quat_conjugate(q_ref))


def total_rmse(q_est: Floats, q_ref: Floats) -> float:
    """Root mean square of the total error, rad, of attitudes that are all known."""
    return float(np.sqrt(np.mean(attitude_errors(q_est, q_ref)["total"] ** 2)))


def euler_errors(q_est: Floats, q_ref: Floats) -> Floats:
    """Differences of yaw, pitch and roll (N, 3), rad, each the shorter way round; near pitch ±90° they mean nothing."""
    return wrap(euler_zyx_from_quat(q_est) - euler_zyx_from_quat(q_ref))


DOF: Final = 3
CONFIDENCE: Final = 0.95
BOUNDS: Final = (0.21579528262389797, 9.348403604496148)
"""Quantiles at (1 ∓ CONFIDENCE) / 2 of a chi-square variable of DOF degrees of freedom, as SciPy's `gammaincinv` gives
them, whose import would take longer than the whole judgement."""


@dataclass(frozen=True, slots=True)
class Consistency:
    """Agreement of errors with their claimed covariance."""

    mean: float  # mean of dᵀ P⁻¹ d; `DOF` is expected
    # lower, upper: bounds that hold a consistent sample with probability `CONFIDENCE`
    lower: float
    upper: float
    share_inside: float  # share of samples between them
    count: int  # samples used
    unusable: int  # samples left out because their covariance is not positive definite


def nees(q_est: Floats, q_ref: Floats, cov_b: Floats) -> Floats:
    """Squared errors dᵀ P⁻¹ d, (N,), by the covariance (N, 3, 3) of the error as a rotation vector in body axes, rad².

    NaN where the covariance is not positive definite.
    """
    d = rotvec_from_quat(quat_multiply(quat_conjugate(q_est), q_ref))
    # Sylvester's criterion: all leading minors of a positive definite matrix are positive (NaN is not)
    first, second = cov_b[:, 0, 0], cov_b[:, 0, 0] * cov_b[:, 1, 1] - cov_b[:, 0, 1] * cov_b[:, 1, 0]
    third = np.sum(cov_b[:, 0] * np.cross(cov_b[:, 1], cov_b[:, 2]), axis=1)
    usable = (first > 0.0) & (second > 0.0) & (third > 0.0)
    squared = np.full(d.shape[0], np.nan)
    weighted = np.linalg.solve(cov_b[usable], d[usable, :, np.newaxis])[..., 0]
    squared[usable] = np.sum(d[usable] * weighted, axis=1)  # [BarShalom2001] sec. 5.4
    return squared


def consistency(q_est: Floats, q_ref: Floats, cov_b: Floats) -> Consistency | None:
    """Judge claimed covariances (N, 3, 3) of attitudes (N, 4); None where none is usable."""
    squared = nees(q_est, q_ref, cov_b)
    usable = squared[np.isfinite(squared)]
    if not usable.size:
        return None
    lower, upper = BOUNDS
    inside = (usable >= lower) & (usable <= upper)
    return Consistency(
        mean=float(np.mean(usable)),
        lower=lower,
        upper=upper,
        share_inside=float(np.mean(inside)),
        count=int(usable.size),
        unusable=int(squared.size - usable.size),
    )


INSIDE: Final = 1.959963984540054  # standard deviations within which a normal variable is with probability CONFIDENCE


def inside_claim(
    q_est: Floats, q_ref: Floats, cov_b: Floats, *, free: bool = False
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether errors lie within `INSIDE` claimed standard deviations: of the heading (N,), of two level axes (N, 2).

    Attitudes are known in every row. With `free` headings count from a free zero, that of the first sample: what is
    claimed is how they change from there.
    """
    error = error_quat(q_est, q_ref)
    error *= np.where(error[:, :1] < 0.0, -1.0, 1.0)
    heading = 2.0 * np.arctan2(error[:, 3], error[:, 0])
    heading = wrap(heading - heading[:1]) if free else heading
    c_nb = dcm_from_quat(q_est)
    variance = np.einsum("nij,njk,nik->ni", c_nb, cov_b, c_nb)
    sd = np.sqrt(np.maximum(variance, 0.0))
    return np.abs(heading) <= INSIDE * sd[:, 2], np.abs(2.0 * error[:, 1:3]) <= INSIDE * sd[:, :2]


PERCENTILES = (50, 95, 99)


@dataclass(frozen=True, slots=True)
class Stats:
    """What is reported about an error; angles in rad."""

    count: int  # samples
    rmse: float  # root mean square: the constant part is in it
    # mean, std: The constant part, and what remains without it: rmse² = mean² + std². A std alone hides a constant
    # error.
    mean: float
    std: float
    max_abs: float  # largest magnitude
    max_at: float  # time of it, s
    # p50, p95, p99: percentiles of the magnitude, interpolated linearly
    p50: float
    p95: float
    p99: float

    @classmethod
    def from_errors(cls, error: Floats, t: Floats) -> Self | None:
        """Statistics of the values (N,) that are not NaN, at times (N,); None where there is none."""
        keep = np.isfinite(error)
        if not keep.any():
            return None
        values, times = error[keep], t[keep]
        size = np.abs(values)
        worst = int(np.argmax(size))
        p50, p95, p99 = (float(p) for p in np.percentile(size, PERCENTILES))
        return cls(
            count=int(values.size),
            rmse=float(np.sqrt(np.mean(values * values))),
            mean=float(np.mean(values)),
            std=float(np.std(values)),
            max_abs=float(size[worst]),
            max_at=float(times[worst]),
            p50=p50,
            p95=p95,
            p99=p99,
        )
