"""Which ellipsoid a capture asks for: the smallest whose misfit noise explains, by an F-test.

Where the axes of the soft iron are those of the sensor, six parameters are better known than nine; where they are not,
six are wrong by degrees. A capture that cannot determine the nine cannot tell either, so the choice is only trusted as
far as the full shape is.
"""

from typing import Final, NamedTuple

import numpy as np

from plumbob.calibration.ellipsoid.ellipsoid_fit import Ellipsoid, NormFit, Shape, fit_axes, fit_norm, fit_quadric
from plumbob.core.check import Floats
from plumbob.core.text import p_value

SIGNIFICANCE: Final = 0.01
"""Probability of taking a larger shape where the smaller one is true."""

SPARE: Final = 3
"""Samples more than parameters, for residuals to say anything."""

_SOME: Final = 20_000


class Choice(NamedTuple):
    """What was chosen, and the full shape that it was held against; the same where nothing smaller did."""

    fit: NormFit
    full: NormFit
    why: str


def start_of(vectors: Floats) -> Ellipsoid:
    """Ellipsoid to start from (N, 3): the best closed form that gives one."""
    some = vectors[:: max(1, len(vectors) // _SOME)]
    return fit_quadric(some) or fit_axes(some) or _ball(some)


def fit_shape(vectors: Floats, shape: Shape) -> NormFit | None:
    """Fit of one shape, as asked for."""
    return fit_norm(vectors, shape, start_of(vectors))


def choose(vectors: Floats) -> Choice | None:
    """Fit of the smallest shape that the vectors (N, 3) do not contradict; None where the full one cannot be fitted."""
    some = vectors[:: max(1, len(vectors) // _SOME)]
    full = fit_shape(some, Shape.ELLIPSOID) if len(some) >= Shape.ELLIPSOID.value + SPARE else None
    if full is None:
        return None
    kept, tests, used = full, [], some[full.used]
    for shape in (Shape.AXES, Shape.SPHERE):
        smaller = fit_norm(used, shape, full.ellipsoid, robust=False)
        chance = 0.0 if smaller is None else _chance(smaller, kept, len(used))
        tests.append(f"{shape.name.lower()} against {kept.shape.name.lower()}: {p_value(chance)}")
        if smaller is None or chance < SIGNIFICANCE:
            break
        kept = smaller
    return _whole(vectors, kept, full, "; ".join(tests))


def _whole(vectors: Floats, kept: NormFit, full: NormFit, why: str) -> Choice | None:
    """Choice of a part, fitted to all vectors, with the outliers of the full shape."""
    whole = full if len(full.used) == len(vectors) else fit_norm(vectors, Shape.ELLIPSOID, full.ellipsoid)
    if whole is None or kept.shape is Shape.ELLIPSOID:
        return whole and Choice(whole, whole, why)
    smaller = fit_norm(vectors[whole.used], kept.shape, kept.ellipsoid, robust=False)
    return smaller and Choice(_spread(smaller, whole), whole, why)


def _chance(smaller: NormFit, larger: NormFit, count: int) -> float:
    """Probability of a misfit as large as the smaller shape's, if it were true."""
    from scipy.stats import f

    more, free = larger.shape.value - smaller.shape.value, count - larger.shape.value
    if not larger.cost > 0.0:
        return 1.0 if not smaller.cost > 0.0 else 0.0
    return float(f.sf(max(0.0, smaller.cost - larger.cost) / more / (larger.cost / free), more, free))


def _spread(smaller: NormFit, full: NormFit) -> NormFit:
    """Fit of the used samples, told for all of them."""
    residuals = full.residuals.copy()
    residuals[full.used] = smaller.residuals
    return smaller._replace(residuals=residuals, used=full.used)


def _ball(vectors: Floats) -> Ellipsoid:
    """Sphere about the mean."""
    middle = vectors.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((vectors - middle) ** 2, axis=1))))
    return Ellipsoid(middle, np.eye(3) / max(size, 1e-12))
