"""Calibration in counts: bare triples, without time, unit or rate, as people log them first.

The unit is the count throughout: the bias in counts, and a symmetric matrix that makes a sphere of what is left, whose
size is that of the measurement on average, or of an accelerometer 1 g.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from plumbob.calibration.ellipsoid_fit import SPARE, Shape, choose, fit_axes, mean_radius
from plumbob.calibration.fit import CaptureRefusedError, Reason
from plumbob.calibration.mag.checks import finite_rows
from plumbob.calibration.mag.ellipsoid import fit_mag
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import NOMINAL_FIELD
from plumbob.core.findings import Note, as_json
from plumbob.core.text import FactsText

_FACES = 6


@dataclass(frozen=True, eq=False, repr=False)
class CountsCalibration(FactsText):
    """What corrects readings: ``true = matrix @ (raw − bias)``.

    Attributes
    ----------
    sensor : str
        ``"mag"`` or ``"acc"``.
    bias : ndarray (3,)
        Counts.
    matrix : ndarray (3, 3)
        Symmetric. Of a magnetometer without unit, near the identity; of an accelerometer g for a count.
    residual_sd : float
        What is left, counts.
    samples : int
        Readings that were used.
    """

    sensor: str
    bias: Floats
    matrix: Floats
    residual_sd: float
    samples: int
    remarks: tuple[Note, ...] = ()

    @property
    def counts_per_g(self) -> Floats | None:
        """Counts of 1 g on each axis (3,); None of a magnetometer."""
        return None if self.sensor == "mag" else 1.0 / np.diag(self.matrix)

    def facts(self) -> Mapping[str, str]:
        """Bias, matrix, and what is left, as one would write them into a sketch."""
        rows = {f"matrix {axis}": _three(row) for axis, row in zip("xyz", self.matrix, strict=True)}
        scale = {} if self.counts_per_g is None else {"counts per g": _three(self.counts_per_g)}
        residuals = f"{self.residual_sd:.3g} counts of {self.samples} readings"
        return {"sensor": self.sensor, "bias": f"{_three(self.bias)} counts", **rows, **scale, "residuals": residuals}

    def text(self) -> str:
        """The same for a reader, a line each."""
        return "\n".join((*(f"{name:13} {value}" for name, value in self.facts().items()), *map(str, self.remarks)))

    def summary(self) -> dict[str, Any]:
        """All figures, as JSON can hold them."""
        scale = self.counts_per_g
        counts = {"bias": self.bias.tolist(), "matrix": self.matrix.tolist(), "residual_sd": self.residual_sd,
                  "samples": self.samples, "counts_per_g": None if scale is None else scale.tolist()}  # fmt: skip
        return {"sensor": self.sensor, "counts": counts, "remarks": as_json(self.remarks)}


def fit_counts(readings: Floats, sensor: str = "mag") -> CountsCalibration:
    """Fit readings (N, 3), counts in many attitudes; of an accelerometer one averaged row for each pose will do.

    A magnetometer ("mag") was away from iron that moves, an accelerometer at rest. CaptureRefusedError if the attitudes
    do not determine it; ShapeError if the sensor is missing, or readings are not finite triples.
    """
    check.one_of("sensor", sensor, ("mag", "acc"))
    vectors = finite_rows("readings", readings)
    return _magnetometer(vectors) if sensor == "mag" else _accelerometer(vectors)


def _magnetometer(vectors: Floats) -> CountsCalibration:
    """By the fit of a field, whose checks are in µT."""
    size = float(np.median(np.linalg.norm(vectors - vectors.mean(axis=0), axis=1)))
    if not size > 0.0:
        raise CaptureRefusedError(Reason("no-motion", "all readings are the same.", "turn the unit all ways."))
    factor = NOMINAL_FIELD / size
    fitted = fit_mag(vectors * factor)
    card, used = fitted.calibration, fitted.used
    residual_sd = float(np.std(fitted.residuals[used])) / factor
    return CountsCalibration("mag", card.bias / factor, card.matrix, residual_sd, int(used.sum()), fitted.remarks)


def _accelerometer(vectors: Floats) -> CountsCalibration:
    """By poses: bias and scale of few, the matrix of as many as determine it."""
    if len(vectors) < _FACES:
        raise CaptureRefusedError(Reason("too-few", f"there are {len(vectors)} poses.", "give six faces at least."))
    choice = choose(vectors) if len(vectors) >= Shape.ELLIPSOID.value + SPARE else None
    if choice is not None:
        fit = choice.fit
        return CountsCalibration("acc", *fit.ellipsoid, fit.sd, int(fit.used.sum()))
    ellipsoid = fit_axes(vectors)
    if ellipsoid is None:
        advice = "hold every face of the case up once."
        raise CaptureRefusedError(Reason("too-few-regions", "the poses make no ellipsoid.", advice))
    residuals = np.linalg.norm((vectors - ellipsoid.centre) @ ellipsoid.shape, axis=1) - 1.0
    residual_sd = float(np.std(residuals)) * mean_radius(ellipsoid.shape)
    remark = "Bias and scale only: misalignment needs twelve poses or more."
    return CountsCalibration("acc", *ellipsoid, residual_sd, len(vectors), (remark,))


def _three(values: Floats) -> str:
    return ", ".join(f"{value:.6g}" for value in values)
