"""The inverse of normal equations whose parameters differ in size by many powers of ten."""

from typing import NamedTuple

import numpy as np

from plumbob.check import Floats


class Inverse(NamedTuple):
    """Pseudoinverse (P, P) of a normal matrix, and its condition number, the parameters scaled to a diagonal of one."""

    matrix: Floats
    condition: float


def inverse_of(normal: Floats) -> Inverse:
    """Invert a normal matrix (P, P) with its parameters scaled, so that all count alike."""
    spread = np.sqrt(np.diag(normal))
    sizes = np.outer(spread, spread)
    unit = normal / sizes
    return Inverse(np.asarray(np.linalg.pinv(unit, hermitian=True) / sizes), float(np.linalg.cond(unit)))
