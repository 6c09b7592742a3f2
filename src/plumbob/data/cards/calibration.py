"""The calibration card: what turns the readings of one unit into the quantities that they stand for."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from typing import Any, ClassVar, Final, Self

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import IMPOSSIBLE_ACCELERATION, IMPOSSIBLE_FIELD, IMPOSSIBLE_RATE
from plumbob.core.errors import CalibrationError, ShapeError
from plumbob.core.findings import Finding, Note, as_findings
from plumbob.data.cards.file import Card, finite, require_no_negative, require_number, require_part, require_text
from plumbob.data.sample import UNITS

GRADES: Final = ("good", "fair", "poor")


@dataclass(frozen=True, eq=False, kw_only=True)
class Quality:
    """How good a calibration of one triad is, by what it was made of."""

    grade: str  # one of `GRADES`
    samples: int  # samples, poses or plateaus that the fit used
    outliers: int = 0  # those that it set aside
    regions: int | None = None  # how many of the 18 directions (6 faces, 12 edges) were seen, where they count
    condition: float | None = None  # of the fit's normal equations, parameters scaled to their sizes
    # tilt_sd, heading_sd: what errors of the parameters leave, root mean square over attitudes up to `tilt_range` from
    # level, rad
    tilt_sd: float | None = None
    heading_sd: float | None = None
    tilt_range: float | None = None
    scale_sd: float | None = None  # of the scale factors, relative, where that counts, as for a gyroscope

    def __post_init__(self) -> None:
        """Validate the numbers."""
        if self.grade not in GRADES:
            raise CalibrationError(f"grade must be one of {', '.join(GRADES)}, but it is {self.grade!r}.")
        for name in ("samples", "outliers", "regions"):
            value = getattr(self, name)
            if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < 0):
                raise CalibrationError(f"{name} must be a whole number ≥ 0, but it is {value!r}.")
        for name in ("condition", "tilt_sd", "heading_sd", "tilt_range", "scale_sd"):
            if getattr(self, name) is not None:
                require_number(name, getattr(self, name))
                require_no_negative(name, getattr(self, name))


@dataclass(frozen=True, eq=False)
class TriadCalibration:
    """Linear model of one triad, with what is known about its parameters.

    ::

        calibrated = matrix @ (measured − bias − Σ_k bias_per_k[k] (T − temp_ref_c)^(k+1) − g_sensitivity @ force
                               − load @ per_load)
    """

    matrix: Floats  # (3, 3), scale, misalignment and soft iron; right-handed
    bias: Floats  # (3,), in `unit_in`, at `temp_ref_c` and without specific force
    # unit_in, unit_out: of measurement and result; "rad/s", "m/s2" or "uT"
    unit_in: str
    unit_out: str
    bias_per_k: Floats = field(default_factory=partial(np.zeros, (1, 3)))  # (3,) or (K, 3), unit/K^(k+1)
    temp_ref_c: float = 25.0
    residual_rms: float | None = None  # in `unit_out`
    # (3, 3), of a gyroscope, rad/s per m/s²: entry ij is the bias of axis i per calibrated specific force along j
    g_sensitivity: Floats = field(default_factory=partial(np.zeros, (3, 3)))
    temp_span_c: tuple[float, float] | None = None  # of the calibration; beyond, the polynomial goes on as its tangent
    covariance: Floats | None = None  # (12, 12), of bias and matrix, row by row; zero for what was not fitted
    # bias_per_k_sd, g_sensitivity_sd: standard deviations, shaped as what they belong to
    bias_per_k_sd: Floats | None = None
    g_sensitivity_sd: Floats | None = None
    reference: float | None = None  # what the fit took as known: gravity, m/s², or the field's strength, µT
    method: str = ""
    date: str = ""  # ISO 8601
    delay_sd: float | None = None  # of a gyroscope, of the time at which an axis is read, s, standard deviation
    # per_load, per_load_sd: (K, 3), of a magnetometer, what a unit of each of the `loads` adds, and its deviation
    per_load: Floats | None = None
    per_load_sd: Floats | None = None
    loads: tuple[str, ...] = ()  # names of their columns
    quality: Quality | None = None
    remarks: tuple[Note, ...] = ()

    PARTS: ClassVar[Mapping[str, type]] = {"quality": Quality}

    def __post_init__(self) -> None:
        """Bring every array to its shape and validate it."""
        for name, shape in (("matrix", (3, 3)), ("bias", (3,)), ("g_sensitivity", (3, 3))):
            object.__setattr__(self, name, finite(name, getattr(self, name), shape))
        array = check.floats("bias_per_k", self.bias_per_k)
        per_k = finite("bias_per_k", array[np.newaxis] if array.shape == (3,) else array, (-1, 3))
        object.__setattr__(self, "bias_per_k", per_k if len(per_k) else np.zeros((1, 3)))
        self._check_uncertainties()
        object.__setattr__(self, "loads", tuple(self.loads))
        for name in ("per_load", "per_load_sd"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, finite(name, value, (len(self.loads), 3)))
        require_number("temp_ref_c", self.temp_ref_c)
        for name in ("residual_rms", "reference", "delay_sd"):
            if getattr(self, name) is not None:
                require_number(name, getattr(self, name))
                require_no_negative(name, getattr(self, name))
        if self.reference == 0.0:
            raise CalibrationError("reference must be above zero: it is the size of gravity or of the field.")
        if self.temp_span_c is not None:
            object.__setattr__(self, "temp_span_c", _span(self.temp_span_c))
        require_text(unit_in=self.unit_in, unit_out=self.unit_out, method=self.method)
        require_dates(date=self.date)
        require_part("quality", self.quality, Quality)
        require_sensor(self.matrix, self.bias, self.unit_in)
        object.__setattr__(self, "remarks", _remarks(self.remarks))

    def _check_uncertainties(self) -> None:
        shapes = (
            ("covariance", (12, 12)),
            ("bias_per_k_sd", self.bias_per_k.shape),
            ("g_sensitivity_sd", (3, 3)),
        )
        for name, shape in shapes:
            value = getattr(self, name)
            if value is None:
                continue
            array = finite(name, value, shape)
            require_no_negative(name, np.diag(array) if name == "covariance" else array)
            object.__setattr__(self, name, array)
        if self.covariance is None:
            return
        cov, sd = self.covariance, np.sqrt(np.diag(self.covariance))
        allowed = _ROUNDING * np.outer(sd, sd) + _RESIDUE * sd.max() ** 2
        with np.errstate(over="ignore"):
            beyond = np.abs(cov - cov.T) - allowed
        if (beyond > 0.0).any():
            i, j = np.unravel_index(int(beyond.argmax()), beyond.shape)
            raise CalibrationError(
                f"covariance must be symmetric, but entries ({i}, {j}) and ({j}, {i}) are {cov[i, j]:g} and "
                f"{cov[j, i]:g}."
            )

    @property
    def bias_sd(self) -> Floats | None:
        """Standard deviation of the bias (3,), where it is known."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance)[:3])

    @property
    def matrix_sd(self) -> Floats | None:
        """Standard deviation of the matrix (3, 3), where it is known."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance)[3:]).reshape(3, 3)

    @property
    def matrix_found(self) -> bool:
        """Whether the matrix was found: an identity without variance stands for one that was not."""
        sd = self.matrix_sd
        return (sd is not None and bool(sd.any())) or not np.array_equal(self.matrix, np.eye(3))


@dataclass(frozen=True, eq=False)
class Mount:
    """How the unit sits on its body."""

    q_bs: Floats  # (4,), from the axes of the sensor case s to those of the body b, wxyz
    sd: Floats | None = None  # (3,), standard deviation about the body's axes, rad
    method: str = ""
    date: str = ""  # ISO 8601
    remarks: tuple[Note, ...] = ()

    def __post_init__(self) -> None:
        """Validate the numbers."""
        q_bs = finite("q_bs", self.q_bs, (4,))
        check.unit_norm("q_bs", q_bs)
        object.__setattr__(self, "q_bs", q_bs)
        if self.sd is not None:
            object.__setattr__(self, "sd", finite("sd", self.sd, (3,)))
            require_no_negative("sd", self.sd)
        require_text(method=self.method)
        require_dates(date=self.date)
        object.__setattr__(self, "remarks", _remarks(self.remarks))


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationCard(Card):
    """Calibration of one unit.

    Parameters
    ----------
    device : str
        The unit that it belongs to; data of another unit are refused.
    date : str
        ISO 8601 date of the latest calibration.
    method : str
        How it was found.
    gyr, acc, mag : TriadCalibration or None
        One for each triad that was calibrated.
    mount : Mount or None
        How the unit sits on its body, where that was found.
    software : str
        Program and version that made the card.
    """

    KIND: ClassVar = "plumbob calibration card"
    VERSION: ClassVar = 2
    PARTS: ClassVar = {**dict.fromkeys(UNITS, TriadCalibration), "mount": Mount}

    device: str
    date: str
    method: str
    gyr: TriadCalibration | None = None
    acc: TriadCalibration | None = None
    mag: TriadCalibration | None = None
    mount: Mount | None = None
    software: str = ""

    def __post_init__(self) -> None:
        """Validate the names and the kind of each part."""
        require_text(device=self.device, method=self.method, software=self.software)
        require_dates(date=self.date)
        for name, cls in self.PARTS.items():
            require_part(name, getattr(self, name), cls)

    @property
    def name(self) -> str:
        """Short name for provenance."""
        return f"{self.device} {self.date} ({self.method})"

    @property
    def parts(self) -> dict[str, Any]:
        """Triads and mounting that the card has, by name."""
        return {name: getattr(self, name) for name in self.PARTS if getattr(self, name) is not None}

    def correct(self, what: Any, *, live: bool = False) -> Any:
        """A sample or a recording, calibrated: an `ImuSample`, or an `ImuData` as of `apply_card`, with its `live`.

        Raises
        ------
        CalibrationError
            As of `apply_card`; a single sample does not say of which unit it is.
        """
        from plumbob.data.calibrated import apply_card, correction
        from plumbob.data.sample import ImuSample

        return correction(self)(what) if isinstance(what, ImuSample) else apply_card(self, what, live=live)

    def without(self, *parts: str) -> Self:
        """Return this card without some of its parts."""
        empty: dict[str, Any] = dict.fromkeys(parts)
        return replace(self, **empty)

    def merged(self, newer: Self) -> Self:
        """Return this card with everything that a newer one of the same unit has.

        Raises
        ------
        CalibrationError
            If the other card belongs to another unit.
        """
        if newer.device != self.device:
            raise CalibrationError(f"the card is of device '{self.device}', but the new one is of '{newer.device}'.")
        parts = self.parts | newer.parts
        methods = dict.fromkeys(part.method for part in parts.values() if part.method)
        return replace(newer, **parts, method="; ".join(methods) or newer.method)


def _span(value: Any) -> tuple[float, float]:
    low, high = finite("temp_span_c", value, (2,)).tolist()
    if not low <= high:
        raise CalibrationError(f"temp_span_c must be lowest and highest temperature, but it is {[low, high]}.")
    return low, high


GAINS: Final = (0.1, 10.0)  # Smallest and largest gain of a matrix; a unit in another scale is a matter of its profile

_BIASES: Final = {"rad/s": IMPOSSIBLE_RATE, "m/s2": IMPOSSIBLE_ACCELERATION, "uT": IMPOSSIBLE_FIELD}
_ROUNDING: Final = 1e-6  # of a covariance, relative to the standard deviations; inverses leave less
_RESIDUE: Final = 1e-12  # of the largest variance: what products leave where a parameter has no variance of its own


def require_sensor(matrix: Floats, bias: Floats, unit: str) -> None:
    """Refuse a matrix (3, 3) that is singular, amplifies as no sensor does, or mirrors; or a bias (3,) as none has."""
    if not np.linalg.cond(matrix) < 1e3:
        raise CalibrationError(f"matrix is singular or nearly so: {matrix.tolist()}.")
    gains = np.linalg.svd(matrix, compute_uv=False)
    if gains[-1] < GAINS[0] or gains[0] > GAINS[1]:
        raise CalibrationError(
            f"matrix must have gains from {GAINS[0]:g} to {GAINS[1]:g}, not {gains[-1]:.3g} to {gains[0]:.3g}: "
            "the units of the recording are wrong; declare them in its profile and calibrate again."
        )
    if np.linalg.det(matrix) < 0.0:
        raise CalibrationError(
            "matrix is left-handed: its determinant is negative, as where an axis has the wrong sign or two are "
            "exchanged. Declare the axes in the profile (axes, mirrored) and calibrate again."
        )
    most = _BIASES.get(unit, np.inf)
    if (np.abs(bias) > most).any():
        raise CalibrationError(
            f"bias must be within ±{most:g} {unit}, beyond which no sensor measures, but it is {bias}."
        )


def require_dates(**dates: Any) -> None:
    """Refuse what is not a date, or date and time, of ISO 8601; an empty text says that it is not known."""
    require_text(**dates)
    for name, value in dates.items():
        try:
            datetime.fromisoformat(value or "2000-01-01")
        except ValueError as error:
            raise CalibrationError(f"{name} must be ISO 8601, as 2026-11-21, but it is {value!r}.") from error


def _remarks(given: Any) -> tuple[Finding, ...]:
    try:
        return as_findings("remarks", given)
    except ShapeError as error:
        raise CalibrationError(str(error)) from error
