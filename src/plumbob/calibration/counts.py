"""Calibration in counts: bare triples, without time, unit or rate, as people log them first.

They are brought to the size of a usual field, or of gravity, and fitted as any capture; the result goes back to counts.
What other programs take of it stands as text in ``paste.toml``.
"""

import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.calibration.acc import WRONG, fit_accel, wrong_gravity
from plumbob.calibration.ellipsoid_fit import SPARE, Ellipsoid, Shape, first_ellipsoid, mean_radius
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, refuse
from plumbob.calibration.mag.checks import clipped, finite_rows, require_figures, stuck, wrong_field
from plumbob.calibration.mag.ellipsoid import fit_mag
from plumbob.core import __version__, check
from plumbob.core.check import Floats
from plumbob.core.constants import G0, NOMINAL_FIELD
from plumbob.core.errors import ParameterError
from plumbob.core.findings import Finding, Note, as_json
from plumbob.core.text import FactsText
from plumbob.core.units import to_deg
from plumbob.data import TITLES
from plumbob.data.cards import UNITS, Quality

# Scatter of the lengths, of themselves, above which the unit was not turned: noise alone makes 0.42.
NOISE_ALONE: Final = 0.2

_FACES: Final = 6
_BY_CHANCE: Final = 2  # readings that are the largest, and end a range of 8 to 16 bits
_OF_SIZES: Final = {"calibration.own_scale", "calibration.standard_gravity"}  # remarks that rest on a unit
_RAILS: Final = np.array([rail for bits in range(8, 17) for rail in (-(1 << bits - 1), (1 << bits - 1) - 1)])


@dataclass(frozen=True, eq=False, repr=False)
class CountsCalibration(FactsText):
    """What corrects readings: ``true = matrix @ (raw − bias)``.

    Attributes
    ----------
    sensor : str
        ``"mag"`` or ``"acc"``.
    bias, bias_sd : ndarray (3,)
        Counts.
    matrix, matrix_sd : ndarray (3, 3)
        Symmetric, `unit` for a count.
    unit : str
        Of what is corrected: g, µT where the strength of the field was given, else counts of the sensor's own scale.
    radius : float
        What the field or gravity measures, counts.
    residual_sd : float
        What is left, counts.
    quality : Quality
        Grade, readings that were used, and the predicted error of a heading or an inclination, rad.
    scale : float or None
        What one count is, µT or m/s².
    """

    sensor: str
    bias: Floats
    matrix: Floats
    unit: str
    bias_sd: Floats
    matrix_sd: Floats
    radius: float
    residual_sd: float
    quality: Quality
    scale: float | None = None
    remarks: tuple[Note, ...] = ()

    @property
    def counts_per_g(self) -> Floats | None:
        """Counts of 1 g on each axis (3,); None of a magnetometer."""
        return None if self.sensor == "mag" else 1.0 / np.diag(self.matrix)

    def facts(self) -> Mapping[str, str]:
        """Bias, matrix, and what is left, as one would write them into a sketch."""
        rows = {f"matrix {axis}": _three(row) for axis, row in zip("xyz", self.matrix, strict=True)}
        scale = {} if self.counts_per_g is None else {"counts per g": _three(self.counts_per_g)}
        return {"sensor": self.sensor, "bias": f"{_three(self.bias)} counts", "bias ±": _three(self.bias_sd, 2), **rows,
                "matrix ±": f"{self.matrix_sd.max():.2g} at most", "corrected": f"matrix (raw - bias), in {self.unit}",
                **scale, "length": f"{self.radius:.6g} counts", "residuals": self._residuals(),
                "predicted": self._predicted()}  # fmt: skip

    def text(self) -> str:
        """The same for a reader, a line each."""
        return "\n".join((*(f"{name:13} {value}" for name, value in self.facts().items()), *map(str, self.remarks)))

    def summary(self) -> dict[str, Any]:
        """All figures, as JSON can hold them."""
        scale, quality = self.counts_per_g, self.quality
        counts = {"bias": self.bias.tolist(), "matrix": self.matrix.tolist(), "bias_sd": self.bias_sd.tolist(),
                  "matrix_sd": self.matrix_sd.tolist(), "unit": self.unit, "radius": self.radius,
                  "residual_sd": self.residual_sd, "samples": quality.samples,
                  "counts_per_g": None if scale is None else scale.tolist()}  # fmt: skip
        error = {"grade": quality.grade, "heading_sd": quality.heading_sd, "tilt_sd": quality.tilt_sd}
        return {"sensor": self.sensor, "counts": counts, "quality": error, "remarks": as_json(self.remarks)}

    def lines(self, form: str) -> str:
        """What to paste into another program, with its convention as a comment.

        ParameterError if the program needs what one count is, and it was not given; ShapeError if the form is not one
        of "c", "arduino", "magneto", "motioncal" (of a magnetometer), "ardupilot", "px4", "betaflight" and "json".
        """
        if form == "json":
            return json.dumps(self.summary(), ensure_ascii=False, indent=2)
        every = tomllib.loads(Path(__file__).with_name("paste.toml").read_text(encoding="utf-8"))
        forms = {name: each for name, each in (every | every[self.sensor]).items() if "text" in each}
        chosen, bias, matrix = forms[check.one_of("form", form, (*forms, "json"))], self.bias, self.matrix
        if (offset := chosen.get("offset")) is not None:
            if self.scale is None:
                example = "'0.15 uT'" if self.sensor == "mag" else "'0.061 mg'"
                raise ParameterError(f"{form} takes offsets in a unit. Say what one count is with scale, as {example}.")
            bias = bias * self.scale * offset
            matrix = matrix * ({"counts": self.scale, "g": G0}.get(self.unit, 1.0) / self.scale)
        about = f"plumbob {__version__}: residuals {self._residuals()}; {self._predicted()}"
        return str(chosen["text"]).format(
            about=about, b=bias.tolist(), m=matrix.tolist(), unit=self.unit, scale=self.scale or 1.0, name=self.sensor,
            NAME=self.sensor.upper(),
        ).strip()  # fmt: skip

    def _residuals(self) -> str:
        return f"{self.residual_sd:.3g} counts of {self.quality.samples} readings"

    def _predicted(self) -> str:
        heading, tilt = self.quality.heading_sd, self.quality.tilt_sd
        what, sd = ("inclination", tilt) if heading is None else ("heading", heading)
        return f"{what} error {to_deg(sd or math.inf):.2g}° (1 sd), {self.quality.grade}"


def fit_counts(
    readings: Floats, sensor: str = "mag", *, strength: float | None = None, scale: float | None = None
) -> CountsCalibration:
    """Fit readings (N, 3), counts in many attitudes; of an accelerometer one averaged row for each pose will do.

    A magnetometer ("mag") was away from iron that moves, an accelerometer at rest or turned slowly. `strength`, µT, is
    that of the field, and `scale` what one count is, µT or m/s². CaptureRefusedError if the attitudes do not determine
    it; ShapeError if the sensor is missing, or readings are not finite triples.
    """
    check.one_of("sensor", sensor, ("mag", "acc"))
    require_figures(strength=strength)
    raw = finite_rows("readings", readings)
    if len(raw) < _FACES:
        raise CaptureRefusedError(Reason("too-few", f"there are {len(raw)} poses.", "Give six faces at least."))
    if not np.ptp(raw, axis=0).any():
        raise CaptureRefusedError(Reason("no-motion", "all readings are the same.", "Turn the unit all ways."))
    ends = ((raw == raw.min(axis=0)) | (raw == raw.max(axis=0))) & np.isin(raw, _RAILS)
    at_end = (ends & (np.count_nonzero(ends, axis=0) > _BY_CHANCE)).any(axis=1)
    refuse(stuck(raw, TITLES[sensor], "counts"), clipped(at_end))
    raw = raw[~at_end]
    rough = _rough(raw)
    scatter = float(np.std(np.linalg.norm(rough.to_sphere(raw), axis=1)))
    if not scatter <= NOISE_ALONE:
        text = f"the lengths scatter by {100.0 * scatter:.0f} % about any ellipsoid, as the noise of one pose does."
        advice = "Turn the unit all ways, or hold every face up once; if you did, an axis does not answer."
        raise CaptureRefusedError(Reason("no-motion", text, advice))
    nominal = NOMINAL_FIELD if sensor == "mag" else G0
    factor = nominal / float(np.median(np.linalg.norm(raw - rough.centre, axis=1)))
    fitted = _fitted((raw - rough.centre) * factor, sensor, UNITS[sensor], factor, strength is None)
    card, used = fitted.calibration, fitted.used
    assert card.bias_sd is not None and card.matrix_sd is not None and card.quality is not None
    unscaled = sensor == "mag" and strength is None
    size = 1.0 if unscaled else factor * (strength if sensor == "mag" and strength else 1.0) / nominal
    bias, matrix = rough.centre + card.bias / factor, card.matrix * size
    radius = float(np.median(np.linalg.norm((raw[used] - bias) @ matrix.T, axis=1))) * mean_radius(matrix)
    if scale is not None:  # by it, the field, µT, or gravity, m/s², has a size
        size_by_scale = radius * scale
        refuse(wrong_field(size_by_scale, strength) if sensor == "mag" else wrong_gravity(size_by_scale, G0, WRONG))
    return CountsCalibration(
        sensor,
        bias,
        matrix,
        "counts" if unscaled else "µT" if sensor == "mag" else "g",
        card.bias_sd / factor,
        card.matrix_sd * size,
        radius,
        float(np.std(fitted.residuals[used])) / factor,
        card.quality,
        scale,
        tuple(note for note in fitted.remarks if not isinstance(note, Finding) or note.code not in _OF_SIZES),
    )


def _rough(raw: Floats) -> Ellipsoid:
    """Where the readings (N, 3) lie, about; of few poses, the middle between opposite faces."""
    if len(raw) >= Shape.ELLIPSOID.value + SPARE:
        return first_ellipsoid(raw)
    return Ellipsoid(0.5 * (raw.min(axis=0) + raw.max(axis=0)), np.diag(2.0 / np.ptp(raw, axis=0)))


def _fitted(vectors: Floats, sensor: str, unit: str, factor: float, unscaled: bool) -> Fitted:
    """Fit of readings in units of a usual size; a refusal says what they are in counts."""
    try:
        if sensor == "mag":
            return fit_mag(vectors, strength=None if unscaled else NOMINAL_FIELD)
        # six poses leave no residual: that they are rounded is all that is known of them
        return fit_accel(vectors, noise=factor / math.sqrt(12.0) if len(vectors) == _FACES else 0.0)
    except CaptureRefusedError as refused:
        stands = f"(1 {unit} stands for {1.0 / factor:.4g} counts.)"
        reasons = (replace(r, text=f"{r.text} {stands}" if unit in r.text else r.text) for r in refused.reasons)
        raise CaptureRefusedError(*reasons) from None


def _three(values: Floats, digits: int = 6) -> str:
    return ", ".join(f"{value:.{digits}g}" for value in values)
