"""What a calibration of one triad is: fit, grade, linear algebra, and the reasons to reject a capture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError
from plumbob.core.findings import Note
from plumbob.core.units import deg
from plumbob.data.cards import TriadCalibration


@dataclass(frozen=True, eq=False)
class Fitted:
    """Fit of one triad.

    Attributes
    ----------
    calibration : TriadCalibration
        The result, with covariance and quality.
    measured : ndarray (N, 3)
        What was fitted: samples, or means of poses or plateaus, unit of the triad.
    residuals : ndarray (N,) or (N, 3)
        Residual of each, in the unit of the triad.
    used : ndarray (N,) of bool
        False for outliers.
    remarks : tuple of str
        What to know about it, each a sentence.
    """

    calibration: TriadCalibration
    measured: Floats
    residuals: Floats
    used: NDArray[np.bool_]
    remarks: tuple[Note, ...] = ()


class GradeLimits(NamedTuple):
    """Largest standard deviation of each grade; beyond the last there is none."""

    good: float
    fair: float
    poor: float


HEADING: Final = GradeLimits(deg(0.5), deg(2.0), deg(5.0))
"""Of a heading, rad: a survey compass, the buoy paper's bar, the buoy paper's claim."""

TILT: Final = GradeLimits(deg(0.1), deg(0.5), deg(2.0))
"""Of an inclination, rad."""

RATE: Final = GradeLimits(deg(0.005), deg(0.05), deg(0.5))
"""Of a gyroscope's bias, rad/s: 0.3° a minute, 3° a minute, a data sheet's offset at turn-on."""

SCALE: Final = GradeLimits(0.002, 0.01, 0.02)
"""Of entries of a gyroscope's matrix; beyond, a data sheet's tolerance of 3 % is not improved on."""


def worst_grade(*grades: str | None) -> str:
    """Worst of grades; one beyond all counts as poor."""
    return max((grade or GradeLimits._fields[-1] for grade in grades), key=GradeLimits._fields.index)


def grade_of(sd: float, limits: GradeLimits) -> str | None:
    """Grade of a standard deviation; None where it is beyond all."""
    return next((name for name, limit in zip(GradeLimits._fields, limits, strict=True) if sd <= limit), None)


BLOCKS = 10
"""Parts whose means tell how far the mean of all is off: noise that is correlated over less than a part is covered."""


def mean_of_whole(values: Floats) -> Floats:
    """Mean (3,) of the rows of (N, 3) that have no NaN; NaN where there is none."""
    rows = values[np.isfinite(values).all(axis=1)]
    return np.asarray(rows.mean(axis=0)) if len(rows) else np.full(3, np.nan)


def mean_and_sd(values: Floats) -> tuple[Floats, Floats]:
    """Mean of (N, 3) and its standard deviation (3,), from the scatter of the means of `BLOCKS` parts.

    Parameters
    ----------
    values : ndarray (N, 3)
        Samples in their order, N of at least 2 `BLOCKS`.
    """
    parts = np.array([part.mean(axis=0) for part in np.array_split(values, BLOCKS)])
    return values.mean(axis=0), np.asarray(parts.std(axis=0, ddof=1) / np.sqrt(BLOCKS))


class Inverse(NamedTuple):
    """Pseudoinverse (P, P) of a normal matrix, and its condition number, the parameters scaled to a diagonal of one."""

    matrix: Floats
    condition: float


def invert(normal: Floats) -> Inverse:
    """Invert a normal matrix (P, P) with its parameters scaled, so that all count alike."""
    spread = np.sqrt(np.diag(normal))
    sizes = np.outer(spread, spread)
    unit = normal / sizes
    return Inverse(np.asarray(np.linalg.pinv(unit, hermitian=True) / sizes), float(np.linalg.cond(unit)))


KINDS: Final = {
    "too-few": "fewer samples, poses or plateaus than the model has parameters",
    "level-ring": "the unit was only turned about the vertical while level",
    "cone": "the unit was only turned about one axis",
    "too-few-regions": "the directions that were seen do not determine the model",
    "outliers": "too many samples do not fit the others",
    "uneven-field": "the field differed from place to place by more than a calibration can bear",
    "magnet-moved": "the field changed during the capture: iron or a magnet moved",
    "mirrored": "axes of a sensor are swapped or have the wrong sign: the field turns or dips against the others",
    "turned-axes": "axes of a sensor are turned against those of the others",
    "clipping": "samples are at the end of the sensor's range",
    "wrong-gravity": "the specific force at rest is not that of gravity in the unit that is claimed",
    "wrong-field": "the field's strength is not that of the Earth in the unit that is claimed",
    "not-level": "the unit was inclined where it had to be level",
    "not-still": "the unit was not at rest where it had to be",
    "no-motion": "the unit was not moved as it had to be",
    "no-temperature": "the temperature is missing or did not change",
    "ill-conditioned": "the capture does not separate the parameters",
    "no-gain": "the calibration would rather harm than help: it changes little more than it may be wrong",
    "implausible": "the result is not a working sensor",
}
"""Every kind of reason, and what it means."""


@dataclass(frozen=True, slots=True)
class Reason:
    """One reason.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    text : str
        What is wrong, with figures.
    advice : str
        What to do.
    """

    kind: str
    text: str
    advice: str


class CaptureRefusedError(CalibrationError):
    """A capture cannot calibrate anything.

    Attributes
    ----------
    reasons : tuple of Reason
        At least one; the first is the one that matters most.
    """

    def __init__(self, *reasons: Reason) -> None:
        self.reasons = reasons
        super().__init__(" ".join(f"{r.kind}: {r.text} {r.advice}" for r in reasons))


def refuse(reasons: Sequence[Reason]) -> None:
    """Raise `CaptureRefusedError` where there is a reason."""
    if reasons:
        raise CaptureRefusedError(*reasons)
