"""What a calibration of one triad is: fit, grade, linear algebra, and the reasons to reject a capture."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError
from plumbob.core.findings import Note, as_json
from plumbob.core.result import plain
from plumbob.core.units import deg
from plumbob.data import TRIADS
from plumbob.data.cards import UNITS, CalibrationCard, Mount, TriadCalibration
from plumbob.rotations import euler_zyx_from_quat

_ROUNDING = 8.0 * np.finfo(float).eps  # of the inverse of a matrix near 1
_UNITS: Final = {**UNITS, "angles": "rad"}


@dataclass(frozen=True, eq=False)
class Fitted:
    """Fit of one triad."""

    calibration: TriadCalibration  # the result, with covariance and quality
    measured: Floats  # (N, 3), what was fitted: samples, or means of poses or plateaus, unit of the triad
    residuals: Floats  # (N,), residual of each, in the unit of the triad
    used: NDArray[np.bool_]  # (N,), false for outliers
    remarks: tuple[Note, ...] = ()  # what to know about it, each a sentence
    soak: Floats | None = None  # (N, 2), of a fit over temperature: time, s, and temperature of each, °C


@dataclass(frozen=True, eq=False)
class Mounted:
    """A mounting that was found, with remarks on it, each a sentence."""

    mount: Mount
    remarks: tuple[Note, ...] = ()


class GradeLimits(NamedTuple):
    """Largest standard deviation of each grade; beyond the last there is none."""

    good: float
    fair: float
    poor: float


HEADING: Final = GradeLimits(deg(0.5), deg(2.0), deg(5.0))  # rad: a survey compass, the buoy paper's bar and its claim
TILT: Final = GradeLimits(deg(0.1), deg(0.5), deg(2.0))  # of an inclination, rad
# Of a bias, rad/s: 0.3° a minute, 3° a minute, a data sheet's at turn-on.
RATE: Final = GradeLimits(deg(0.005), deg(0.05), deg(0.5))

# Of entries of a gyroscope's matrix; beyond, a data sheet's 3 % is as good.
SCALE: Final = GradeLimits(0.002, 0.01, 0.02)


def worst_grade(*grades: str | None) -> str:
    """Worst of grades; one beyond all counts as poor."""
    return max((grade or GradeLimits._fields[-1] for grade in grades), key=GradeLimits._fields.index)


def grade_of(sd: float, limits: GradeLimits) -> str | None:
    """Grade of a standard deviation; None where it is beyond all."""
    return next((name for name, limit in zip(GradeLimits._fields, limits, strict=True) if sd <= limit), None)


# Parts whose means tell how far the mean of all is off, noise that is correlated over less than a part included.
BLOCKS = 10


def mean_of_whole(values: Floats) -> Floats:
    """Mean (3,) of the rows of (N, 3) that have no NaN; NaN where there is none."""
    rows = values[np.isfinite(values).all(axis=1)]
    return np.asarray(rows.mean(axis=0)) if len(rows) else np.full(3, np.nan)


def mean_and_sd(values: Floats) -> tuple[Floats, Floats]:
    """Mean of (N, 3), and its standard deviation (3,) from the scatter of the means of `BLOCKS` parts in order."""
    parts = np.array([part.mean(axis=0) for part in np.array_split(values, BLOCKS)])
    return values.mean(axis=0), np.asarray(parts.std(axis=0, ddof=1) / np.sqrt(BLOCKS))


def invert(normal: Floats) -> tuple[Floats, float]:
    """Pseudoinverse (P, P) of a normal matrix and its condition number, parameters scaled so that all count alike."""
    spread = np.sqrt(np.diag(normal))
    sizes = np.outer(spread, spread)
    unit = normal / sizes
    return np.asarray(np.linalg.pinv(unit, hermitian=True) / sizes), float(np.linalg.cond(unit))


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
    "no-load": "the load whose field is to be found did not change often enough",
    "load-departs": "what a load adds to the field is not proportional to it, or not the same everywhere",
    "no-gain": "the calibration would rather harm than help: it changes little more than it may be wrong",
    "implausible": "the result is not a working sensor",
}
"""Every kind of reason, and what it means."""


@dataclass(frozen=True, slots=True)
class Reason:
    """One reason."""

    kind: str  # one of `KINDS`
    text: str  # what is wrong, with figures
    advice: str  # what to do


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

    def summary(self) -> dict[str, Any]:
        """Its reasons, ready for JSON, with the keys of `numbers`."""
        reasons = [asdict(reason) for reason in self.reasons]
        return {"refused": reasons, "units": _UNITS, "card": None, "figures": {}, "remarks": {}}


def refuse(*reasons: Reason | None) -> None:
    """Raise `CaptureRefusedError` where there is a reason."""
    if given := [reason for reason in reasons if reason is not None]:
        raise CaptureRefusedError(*given)


class SensingAxes(NamedTuple):
    """Axes of a triad as its inverse matrix has them: row i of ``inv(matrix)`` is what axis i answers to."""

    scale: Floats  # (3,), gain of each axis minus 1: 0.01 reads 1 % too much
    scale_sd: Floats | None  # (3,), standard deviations to first order, where the covariance is known
    misalignment: Floats  # (3,), angle between each sensing axis and the axis of the case that it is called after, rad
    skew: Floats  # (3,), angles between the sensing axes x and y, x and z, y and z, less a right angle, rad


def sensing_axes(calibration: TriadCalibration) -> SensingAxes:
    """Gains and directions of a triad's axes."""
    response = np.asarray(np.linalg.inv(calibration.matrix), dtype=np.float64)
    gain = np.linalg.norm(response, axis=1)
    unit = np.asarray(response / gain[:, np.newaxis], dtype=np.float64)
    across = np.sqrt(np.maximum(0.0, 1.0 - np.diag(unit) ** 2))
    exact = np.concatenate((gain - 1.0, -np.arcsin((unit @ unit.T)[[0, 0, 1], [1, 2, 2]])))
    cleaned = np.where(np.abs(exact) > _ROUNDING, exact, 0.0)
    sd = None
    if calibration.covariance is not None:  # dR = −R dM R: the gain of axis i changes by −R_ik dM_kl (R_l · u_i)
        slopes = np.einsum("ik,lj,ij->ikl", response, response, unit).reshape(3, 9)
        variance = np.einsum("ia,ab,ib->i", slopes, calibration.covariance[3:, 3:], slopes)
        sd = np.asarray(np.sqrt(np.maximum(0.0, variance)))
    return SensingAxes(
        scale=cleaned[:3],
        scale_sd=sd,
        misalignment=np.arctan2(np.where(across > np.sqrt(_ROUNDING), across, 0.0), np.diag(unit)),
        skew=cleaned[3:],
    )


class Sizes(NamedTuple):
    """Sizes of what was measured, and of what became of it."""

    # before, after: (N,), of each sample, unit of the triad
    before: Floats
    after: Floats
    expected: float  # what they should be: the reference, or the mean of those after where none is known
    used: NDArray[np.bool_]  # (N,), those that were fitted
    rms: tuple[float, ...]  # by which used samples miss what they should be, root mean square, before and after


def sizes(name: str, fit: Fitted) -> Sizes | None:
    """Sizes of what a fit was made of; None for a gyroscope, whose rates have no size that is known, or one pose."""
    if name == "gyr" or fit.soak is not None or not fit.used.any():
        return None
    model = fit.calibration
    after = np.linalg.norm((fit.measured - model.bias) @ model.matrix.T, axis=1)
    expected = float(after[fit.used].mean()) if model.reference is None else model.reference
    before = np.linalg.norm(fit.measured, axis=1)
    rms = tuple(float(np.sqrt(np.mean((v[fit.used] - expected) ** 2))) for v in (before, after))
    return Sizes(before, after, expected, fit.used, rms)


def numbers(card: CalibrationCard, fits: Mapping[str, Fitted]) -> dict[str, Any]:
    """Card, figures made of it and remarks by part of the card, ready for JSON.

    Numbers of a triad are in the unit that `units` gives it; matrices and scales are relative.
    """
    figures: dict[str, Any] = {}
    for name in (triad for triad in TRIADS if triad in card.parts):
        model, fit = getattr(card, name), fits.get(name)
        axes = sensing_axes(model) if model.matrix_found else None
        lengths = None if fit is None else sizes(name, fit)
        before, after = (None, None) if lengths is None else lengths.rms
        figures[name] = {
            "bias_sd": model.bias_sd,
            "matrix_sd": model.matrix_sd if model.matrix_found else None,
            "scale": getattr(axes, "scale", None),
            "scale_sd": getattr(axes, "scale_sd", None),
            "misalignment": getattr(axes, "misalignment", None),
            "skew_xy_xz_yz": getattr(axes, "skew", None),
            "size_expected": None if lengths is None else lengths.expected,
            "size_rms_before": before,
            "size_rms_after": after,
        }
    if card.mount is not None:
        figures["mount"] = {"yaw_pitch_roll": euler_zyx_from_quat(card.mount.q_bs)}
    remarks = {name: as_json(part.remarks) for name, part in card.parts.items()}
    content = {"units": _UNITS, "card": json.loads(card.text()), "figures": plain(figures), "remarks": remarks}
    return {"refused": [], **content}
