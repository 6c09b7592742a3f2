"""Constant rotations between an estimate and a reference: a heading, a mounting, or both.

Off by default, because a constant error is an error. Whatever is found is applied to the reference and reported; the
estimate is judged as it was delivered. The model is ``q_est ≈ h ⊗ q_ref ⊗ q_re``: h turns about the vertical, q_re is
the reference's body seen from the estimate's. Least squares of the chordal distance, as in `quat_mean`, so that signs
of quaternions do not matter. The values are fitted to the very samples that are scored, which flatters the score; over
a recording of thousands of samples by little, over a few samples by much.
"""

from dataclasses import dataclass

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import deg, to_deg
from plumbob.evaluation.metrics import error_quat
from plumbob.evaluation.timeshift import TimeOffset
from plumbob.rotations import Frame, quat_conjugate, quat_mean, quat_multiply, quat_rotate
from plumbob.rotations.headings import turn_heading

ALIGNMENTS = ("time", "mounting", "heading")

MIN_TILT_SPREAD = deg(3.0)
"""Least spread of the tilt, rad, from which mounting and heading are told apart. One over it, here 19, magnifies the
disagreement of the two tracks into the heading."""

_GRID = 720
_MIN_CONCENTRATION = 0.01


@dataclass(frozen=True, eq=False, slots=True)
class Alignment:
    """What was found and applied to the reference; None where not asked for.

    Attributes
    ----------
    time : TimeOffset or None
        Added to the reference's stamps.
    heading : float or None
        How much more the estimate's heading reads than the reference's, clockwise seen from above, rad.
    mounting : ndarray (4,) or None
        Rotation q_re from the estimate's body axes to the reference's.
    tilt_spread : float or None
        Where mounting and heading were sought together: rms angle of the vertical, seen from the body, about its mean,
        rad. The heading is known 1 / tilt_spread times worse than a single attitude.
    """

    time: TimeOffset | None = None
    heading: float | None = None
    mounting: Floats | None = None
    tilt_spread: float | None = None

    def apply(self, q_ref: Floats, frame: Frame) -> Floats:
        """Reference attitudes (N, 4) as the estimate should show them."""
        q = q_ref if self.mounting is None else quat_multiply(q_ref, self.mounting)
        return q if self.heading is None else turn_heading(q, self.heading, frame)


def find_heading(q_est: Floats, q_ref: Floats, frame: Frame) -> float:
    """How much more the estimate's heading reads than the reference's, clockwise seen from above, rad in [−π, π].

    Parameters
    ----------
    q_est, q_ref : ndarray (N, 4)
        Attitudes known in every row.
    frame : Frame
        Navigation frame of both.

    Raises
    ------
    ShapeError
        If the headings differ by every angle alike, so that no constant is better than another.
    """
    w, _, _, z = np.moveaxis(error_quat(q_est, q_ref), -1, 0)
    sine, cosine, weight = 2.0 * float(w @ z), float(w @ w - z @ z), float(w @ w + z @ z)
    if not np.hypot(sine, cosine) > _MIN_CONCENTRATION * weight:
        raise ShapeError("the headings of estimate and reference differ by every angle alike; no constant aligns them.")
    return float(-frame.up[2] * np.arctan2(sine, cosine))


def find_mounting(q_est: Floats, q_ref: Floats) -> Floats:
    """Rotation q_re (4,) from the estimate's body axes to the reference's; attitudes (N, 4) with a common heading."""
    return quat_mean(quat_multiply(quat_conjugate(q_ref), q_est))


def find_mounting_and_heading(q_est: Floats, q_ref: Floats, frame: Frame) -> Alignment:
    """Both constants at once.

    Raises
    ------
    ParameterError
        If the body hardly tilts: a body that only turns about the vertical does not separate mounting and heading.
    """
    spread = tilt_spread(q_ref, frame)
    if spread < MIN_TILT_SPREAD:
        raise ParameterError(
            f"mounting and heading cannot be separated: the reference's tilt varies by {to_deg(spread):.2g}° rms, "
            f"but {to_deg(MIN_TILT_SPREAD):.2g}° are needed. Align one of them, or record a motion that tilts."
        )
    heading = _best_heading(q_est, q_ref, frame)
    mounting = find_mounting(q_est, turn_heading(q_ref, heading, frame))
    return Alignment(heading=heading, mounting=mounting, tilt_spread=spread)


def tilt_spread(q_ref: Floats, frame: Frame) -> float:
    """Rms angle, rad, of the vertical about its mean, seen from the body: 0 for a turn about the vertical alone."""
    up_b = quat_rotate(quat_conjugate(q_ref), frame.up)
    return float(np.sqrt(np.mean(np.sum((up_b - np.mean(up_b, axis=0)) ** 2, axis=1))))


def _best_heading(q_est: Floats, q_ref: Floats, frame: Frame) -> float:
    """Heading for which the best mounting fits best.

    For a turn γ about the vertical, the best mounting is the first eigenvector of M(γ), [Markley2007] (12), and its
    eigenvalue λ(γ) the fit. M is M0 + cos γ Mc + sin γ Ms, so that λ' = vᵀ M' v, whose root is found to the last bits.
    """
    from scipy.optimize import brentq

    back = quat_conjugate(q_ref)
    a = quat_multiply(back, q_est)
    b = quat_multiply(quat_multiply(back, np.concatenate(([0.0], frame.up))), q_est)
    aa, bb, ab = (m / a.shape[0] for m in (a.T @ a, b.T @ b, a.T @ b + b.T @ a))
    m0, mc, ms = 0.5 * (aa + bb), 0.5 * (aa - bb), -0.5 * ab

    def slope(gamma: float) -> float:
        v = np.linalg.eigh(m0 + np.cos(gamma) * mc + np.sin(gamma) * ms)[1][:, -1]  # [Markley2007] (12)
        return float(v @ (np.cos(gamma) * ms - np.sin(gamma) * mc) @ v)

    grid = np.linspace(-np.pi, np.pi, _GRID, endpoint=False)
    matrices = m0 + np.cos(grid)[:, None, None] * mc + np.sin(grid)[:, None, None] * ms
    best = float(grid[np.argmax(np.linalg.eigvalsh(matrices)[:, -1])])
    cell = 2.0 * np.pi / _GRID
    return -float(brentq(slope, best - cell, best + cell, xtol=1e-15))
