"""Cards: what a calibration and a noise analysis leave behind, and what simulator and filters take up.

A card is a small JSON file with a version, a device, units and a date. It refuses what it was not made for.
"""

import json
import math
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from plumbob import check
from plumbob.check import Floats
from plumbob.errors import CalibrationError, DecodeError

FORMAT_VERSION = 1
UNITS = {"gyr": "rad/s", "acc": "m/s2", "mag": "uT"}


class _Card:
    """What both cards share: the file."""

    _KIND: ClassVar[str]
    _TRIAD: ClassVar[type]

    def save(self, path: str | Path) -> None:
        """Write the card as JSON."""
        _write(path, self._KIND, self)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a card.

        Raises
        ------
        DecodeError
            If the file is no card of this kind, or of a newer version.
        """
        try:
            text = Path(path).read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise DecodeError(f"{path} is not a {cls._KIND}: {error}.") from error
        return cls.from_text(text, str(path))

    @classmethod
    def from_text(cls, text: str, name: str) -> Self:
        """Read a card from its text; errors as in `load`, in which `name` stands for the file."""
        raw = _parse(name, cls._KIND, text)
        for triad in UNITS:
            if raw.get(triad) is not None:
                raw[triad] = _build(name, cls._TRIAD, raw[triad])
        card: Self = _build(name, cls, raw)
        return card


@dataclass(frozen=True, eq=False)
class TriadCalibration:
    """Linear model of one triad: ``calibrated = matrix @ (measured − bias − bias_per_k (T − temp_ref_c))``.

    Parameters
    ----------
    matrix : array_like (3, 3)
        Scale, misalignment and soft iron; invertible.
    bias : array_like (3,)
        Offset in the unit of the measurement.
    bias_per_k : array_like (3,)
        Change of the offset per kelvin.
    temp_ref_c : float
        Temperature of `bias`, °C.
    unit_in, unit_out : str
        Units of measurement and result; "rad/s", "m/s2" or "uT".
    residual_rms : float or None
        Root mean square of what the fit left, in `unit_out`.
    """

    matrix: Floats
    bias: Floats
    unit_in: str
    unit_out: str
    bias_per_k: Floats = field(default_factory=lambda: np.zeros(3))
    temp_ref_c: float = 25.0
    residual_rms: float | None = None

    def __post_init__(self) -> None:
        """Validate the numbers."""
        for name, shape in (("matrix", (3, 3)), ("bias", (3,)), ("bias_per_k", (3,))):
            value = check.floats(name, getattr(self, name))
            if value.shape != shape or not np.isfinite(value).all():
                raise CalibrationError(f"{name} must be finite and of shape {shape}, but it is {value.tolist()}.")
            object.__setattr__(self, name, check.read_only(value))
        _require_number("temp_ref_c", self.temp_ref_c)
        if self.residual_rms is not None:
            _require_number("residual_rms", self.residual_rms)
        _require_text(unit_in=self.unit_in, unit_out=self.unit_out)
        if not np.linalg.cond(self.matrix) < 1e3:
            raise CalibrationError(f"matrix is singular or nearly so: {self.matrix.tolist()}.")


@dataclass(frozen=True, eq=False)
class CalibrationCard(_Card):
    """Calibration of one unit.

    Parameters
    ----------
    device : str
        The unit that it belongs to; data of another unit are refused.
    date : str
        ISO 8601 date of the calibration.
    method : str
        How it was found.
    gyr, acc, mag : TriadCalibration or None
        One for each triad that was calibrated.
    """

    _KIND: ClassVar = "plumbob calibration card"
    _TRIAD: ClassVar = TriadCalibration

    device: str
    date: str
    method: str
    gyr: TriadCalibration | None = None
    acc: TriadCalibration | None = None
    mag: TriadCalibration | None = None

    def __post_init__(self) -> None:
        """Validate the names and the kind of each triad."""
        _require_text(device=self.device, date=self.date, method=self.method)
        _require_triads(self, TriadCalibration)

    @property
    def name(self) -> str:
        """Short name for provenance."""
        return f"{self.device} {self.date} ({self.method})"


@dataclass(frozen=True, eq=False)
class TriadNoise:
    """Noise of one triad, per axis, as root power spectral densities in inside units (IEEE Std 952 letters).

    Parameters
    ----------
    n_rpsd : array_like (3,)
        White noise N: rad/s/√Hz, m/s²/√Hz or µT/√Hz.
    b : array_like (3,)
        Bias instability B, in the unit of the triad.
    k_rpsd : array_like (3,)
        Random walk of the bias K, unit/s/√Hz.
    """

    n_rpsd: Floats
    b: Floats
    k_rpsd: Floats

    def __post_init__(self) -> None:
        """Validate the numbers."""
        for name in ("n_rpsd", "b", "k_rpsd"):
            value = check.floats(name, getattr(self, name))
            if value.shape != (3,) or not (np.isfinite(value) & (value >= 0.0)).all():
                raise CalibrationError(f"{name} must be three finite numbers ≥ 0, but it is {value.tolist()}.")
            object.__setattr__(self, name, check.read_only(value))

    @property
    def n_rms(self) -> float:
        """White noise N as one number: the quadratic mean of the axes."""
        return math.sqrt(float(np.mean(self.n_rpsd**2)))

    @property
    def k_rms(self) -> float:
        """Random walk K as one number: the quadratic mean of the axes."""
        return math.sqrt(float(np.mean(self.k_rpsd**2)))


@dataclass(frozen=True, eq=False)
class NoiseCard(_Card):
    """Noise of one unit: feeds the simulator and the Kalman filters.

    Parameters
    ----------
    device : str
        The unit or type that it describes.
    source : str
        Data sheet, or recording and method.
    gyr, acc, mag : TriadNoise or None
        One for each triad that is known.
    """

    _KIND: ClassVar = "plumbob noise card"
    _TRIAD: ClassVar = TriadNoise

    device: str
    source: str
    gyr: TriadNoise | None = None
    acc: TriadNoise | None = None
    mag: TriadNoise | None = None

    def __post_init__(self) -> None:
        """Validate the names and the kind of each triad."""
        _require_text(device=self.device, source=self.source)
        _require_triads(self, TriadNoise)


def _write(path: str | Path, kind: str, card: Any) -> None:
    content = {"kind": kind, "format_version": FORMAT_VERSION, **asdict(card)}
    text = json.dumps(content, indent=2, default=lambda a: a.tolist(), allow_nan=False)
    Path(path).write_text(text + "\n", encoding="utf-8")


def _parse(path: str, kind: str, text: str) -> dict[str, Any]:
    try:
        raw = json.loads(text, parse_constant=_no_constant, object_pairs_hook=_no_repetition)
    except (ValueError, RecursionError) as error:
        raise DecodeError(f"{path} is not a {kind}: {error}.") from error
    if not isinstance(raw, dict) or raw.pop("kind", None) != kind:
        raise DecodeError(f"{path} is not a {kind}: its 'kind' says otherwise.")
    version = raw.pop("format_version", None)
    if version != FORMAT_VERSION:
        raise DecodeError(f"{path} has format_version {version}, but this program reads {FORMAT_VERSION}.")
    return raw


def _build(path: str, cls: type[Any], raw: Any) -> Any:
    known = {f.name for f in fields(cls)}
    if not isinstance(raw, dict) or not set(raw) <= known:
        unknown = sorted(set(raw) - known) if isinstance(raw, dict) else raw
        raise DecodeError(f"{path}: {cls.__name__} has no {unknown}; known are {', '.join(sorted(known))}.")
    try:
        return cls(**raw)
    except (TypeError, ValueError, OverflowError) as error:
        raise DecodeError(f"{path}: {cls.__name__} is incomplete or wrong: {error}") from error


def _require_number(name: str, value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise CalibrationError(f"{name} must be a finite number, but it is {value!r}.")


def _require_text(**words: Any) -> None:
    for name, value in words.items():
        if not isinstance(value, str):
            raise CalibrationError(f"{name} must be a text, but it is {value!r}.")


def _require_triads(card: Any, cls: type) -> None:
    for name in UNITS:
        value = getattr(card, name)
        if not isinstance(value, cls | None):
            raise CalibrationError(f"{name} must be a {cls.__name__} or None, but it is {value!r}.")


def _no_repetition(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(dict(pairs)) != len(pairs):
        raise ValueError(f"a key stands twice among {', '.join(key for key, _ in pairs)}")
    return dict(pairs)


def _no_constant(word: str) -> float:
    raise ValueError(f"{word} is not a number in JSON")
