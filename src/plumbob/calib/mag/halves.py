"""Whether the parts of a capture agree: halves and thirds are calibrated each, and compared with what they predict."""

import math
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from plumbob.calib.ellipsoid.alike import LONG
from plumbob.calib.ellipsoid.norm_fit import NormFit, Shape, fit_norm
from plumbob.calib.ellipsoid.scale import scaled
from plumbob.calib.grades import HEADING
from plumbob.calib.mag.field_gradient import Unevenness, unevenness_in
from plumbob.calib.predicted import heading_apart, heading_sd
from plumbob.check import Floats

PARTS: Final = (2, 3)

MOST_APART: Final = 2.0
"""Difference of parts over what they predict, root mean square, that chance makes as a rule."""

_SOME: Final = 20_000


class Place(NamedTuple):
    """Strength, in the unit of the calibrated vector, and dip of a field, rad, and the inclination that counts, rad."""

    size: float
    dip: float
    tilt_range: float


def widening(vectors: Floats, fit: NormFit, field: Unevenness, memory: float, place: Place) -> float:
    """Factor, at least 1, of a covariance by what the parts of a capture differ beyond their own predictions.

    Parameters
    ----------
    vectors : ndarray (N, 3)
        Measured field, µT, in order of time.
    fit : NormFit
        Of the full shape to all of them.
    field : Unevenness
        Of the whole capture.
    memory : float
        How many neighbouring samples count as one.
    place : Place
        Where headings are told.
    """
    some = vectors[fit.used][:: max(1, len(vectors) // _SOME)]
    whole = scaled(fit, place.size, alike=1.0)[0], fit.ellipsoid.centre
    ratios = []
    for count in PARTS:
        if len(some) < count * LONG:
            break
        parts = [_part(piece, fit, field, memory, place) for piece in np.array_split(some, count)]
        for one, other in pairwise(parts):
            if one is not None and other is not None:
                off = heading_apart(one[0], other[0], whole, size=place.size, dip=place.dip)
                ratios.append(off / math.hypot(one[1], other[1]))
    worst = max(ratios, default=0.0)
    return max(1.0, (worst / MOST_APART) ** 2)


def _part(
    vectors: Floats, whole: NormFit, field: Unevenness, memory: float, place: Place
) -> tuple[tuple[Floats, Floats], float] | None:
    """Calibration of a part, and the heading error that it predicts beside the other parts; None where it is lost.

    What no length shows is the same in all parts, and does not count between them.
    """
    fit = fit_norm(vectors, Shape.ELLIPSOID, whole.ellipsoid, robust=False)
    if fit is None:
        return None
    patches = unevenness_in(fit, vectors).patches
    wandering = field._replace(patches=patches).spread(fit.residuals)
    matrix, covariance = scaled(fit, place.size, alike=memory + wandering)
    sd = heading_sd(matrix, covariance, size=place.size, dip=place.dip, tilt_range=place.tilt_range)
    return ((matrix, fit.ellipsoid.centre), sd) if sd <= HEADING.poor else None
