"""Does the error fit the covariance that the filter claims? Normalised estimation error squared, [BarShalom2001] 5.4.

With d the attitude error as a rotation vector in body axes and P its claimed covariance, dᵀ P⁻¹ d follows a chi-square
law of 3 degrees of freedom where the filter is consistent: 3 on average, and within its 95 % bounds in 95 % of the
samples. Far above, the filter trusts itself too much; far below, too little. Errors of one recording are correlated in
time, so the bounds of the average over independent runs do not apply to the average over one recording.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.rotations import dcm_from_quat, quat_conjugate, quat_multiply, rotvec_from_quat

DOF: Final = 3
CONFIDENCE: Final = 0.95
BOUNDS: Final = (0.21579528262389797, 9.348403604496148)
"""Quantiles at (1 ∓ CONFIDENCE) / 2 of a chi-square variable of DOF degrees of freedom, as SciPy's `gammaincinv` gives
them, whose import would take longer than the whole judgement."""


@dataclass(frozen=True, slots=True)
class Consistency:
    """Agreement of errors with their claimed covariance.

    Attributes
    ----------
    mean : float
        Mean of dᵀ P⁻¹ d; `DOF` is expected.
    lower, upper : float
        Bounds that hold a consistent sample with probability `CONFIDENCE`.
    share_inside : float
        Share of samples between them.
    count : int
        Samples used.
    unusable : int
        Samples left out because their covariance is not positive definite.
    """

    mean: float
    lower: float
    upper: float
    share_inside: float
    count: int
    unusable: int


def nees(q_est: Floats, q_ref: Floats, cov_b: Floats) -> Floats:
    """Squared errors dᵀ P⁻¹ d, (N,); NaN where the covariance is not positive definite.

    Parameters
    ----------
    q_est, q_ref : ndarray (N, 4)
        Attitudes, known in every row.
    cov_b : ndarray (N, 3, 3)
        Claimed covariance of the error as a rotation vector in body axes, rad².
    """
    d = rotvec_from_quat(quat_multiply(quat_conjugate(q_est), q_ref))
    usable = _positive_definite(cov_b)
    squared = np.full(d.shape[0], np.nan)
    weighted = np.linalg.solve(cov_b[usable], d[usable, :, np.newaxis])[..., 0]
    squared[usable] = np.sum(d[usable] * weighted, axis=1)
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


def claimed_sd(q_nb: Floats, cov_b: Floats) -> tuple[Floats, Floats]:
    """Standard deviations (N,), rad, that a covariance claims for inclination and heading, to first order.

    The error's two level parts in the navigation frame make the inclination, its vertical part the heading; so a
    consistent filter's errors have these rms values. NaN where nothing is claimed yet: a variance that is not positive.
    """
    c_nb = dcm_from_quat(q_nb)
    xx, yy, zz = np.moveaxis(np.einsum("nij,njk,nik->ni", c_nb, cov_b, c_nb), -1, 0)
    return _sd(xx + yy), _sd(zz)


def _sd(variance: Floats) -> Floats:
    return np.sqrt(np.where(variance > 0.0, variance, np.nan))


def _positive_definite(p: Floats) -> NDArray[np.bool_]:
    """Sylvester's criterion: all leading minors are positive (NaN is not)."""
    second = p[:, 0, 0] * p[:, 1, 1] - p[:, 0, 1] * p[:, 1, 0]
    third = np.sum(p[:, 0] * np.cross(p[:, 1], p[:, 2]), axis=1)
    return np.asarray((p[:, 0, 0] > 0.0) & (second > 0.0) & (third > 0.0))
