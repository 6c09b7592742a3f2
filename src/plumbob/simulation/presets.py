"""Sensors by name: what data sheets say of a part, and modules made after them.

Figures are data, in ``presets/<part>.toml``. Each carries its value, unit, source and how well it is known:

============  ======================================================
mark          meaning
============  ======================================================
V             read in the source named
V1            read in one secondary source only
C             computed from other figures
UNVERIFIED    from memory, or assumed; found in no source
============  ======================================================

Units are those of `plumbob.core.units`, with ``per`` for division: ``"deg/s per g"``, ``"deg/s per rtHz"`` (per root
hertz), ``"deg per rth"`` (per root hour), ``"1 per deg/s"`` (counts).

Parts join with ``+``: ``"mpu6000+hmc5983"``, ``"adxrs290+adxrs453"``, where each gives the triads and axes that it has.
A part with variants takes one after a colon, ``"adis16355:allan"``; the bare name means the first.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from typing import Any, Self

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.resources import packaged
from plumbob.core.units import unit
from plumbob.data import TRIADS
from plumbob.data.cards import NoiseCard
from plumbob.rotations import skew
from plumbob.simulation.errors import AttitudeErrors, TriadErrors, stream

MARKS = ("V", "V1", "C", "UNVERIFIED")

FIGURES: Mapping[str, str] = {
    "range": "full scale",
    "counts": "counts per unit",
    "lsb": "size of a count, where the sheet gives it that way round",
    "sample_rate": "own sampling rate",
    "latency": "delay of the filter",
    "noise_density": "root power spectral density of the white noise, N",
    "noise_sample": "scatter of one sample, where no density is given",
    "bias_instability": "bias instability, B",
    "null_offset": "largest offset at turn-on",
    "scale_tolerance": "largest relative error of the gain",
    "bias_tempco": "largest change of the offset per kelvin",
    "scale_tempco": "largest change of the gain per kelvin",
    "cross_axis": "largest pick-up from another axis, each pair on its own",
    "axis_misalignment": "largest turn of the whole triad in its case",
    "g_sensitivity": "largest bias per specific force",
    "hard_iron": "largest field of the body itself",
    "soft_iron": "largest relative change of the field along an axis",
    "nonlinearity": "deviation from a straight line; not simulated",
    "vibration_rectification": "bias per mean square of vibration; not simulated",
    "bandwidth": "corner of the low-pass; not simulated, density and rate give the noise",
    "total_rms": "noise over the whole bandwidth; not simulated, density and rate give the noise",
}
"""Figures that a preset may hold, and what they mean."""

ANGLES: Mapping[str, str] = {
    "heading": "root mean square error of the heading",
    "tilt": "root mean square error of roll and of pitch",
}
"""Figures of the attitude that a reference says itself, and what they mean."""

_UNSAID = {"range": math.inf}  # where a sheet says nothing; any other figure is then 0
_NOT_SIMULATED = {"nonlinearity", "vibration_rectification", "bandwidth", "total_rms"}
# An hour in seconds, as the ratio of two units that the unit table holds.
_ROOTS = {"rtHz": 1.0, "rth": math.sqrt(unit("deg/s").factor / unit("deg/h").factor)}


@dataclass(frozen=True, slots=True)
class DataSheetFigure:
    """One figure of a data sheet.

    Attributes
    ----------
    value : float or tuple of 3
        For all axes, or for each.
    unit : str
        As the source writes it.
    source, mark, note : str
        Where it comes from, how well it is known (`MARKS`), and what else to know.
    """

    value: float | tuple[float, float, float]
    unit: str
    source: str
    mark: str
    note: str = ""

    @property
    def si(self) -> Floats:
        """Value (3,) in the units used inside."""
        numerator, *denominators = self.unit.split(" per ")
        factor = unit(numerator).factor
        for name in denominators:
            factor /= _ROOTS[name] if name in _ROOTS else unit(name).factor
        return np.broadcast_to(np.asarray(self.value, dtype=np.float64) * factor, 3)


@dataclass(frozen=True, slots=True)
class TriadSheet:
    """What a sheet says of one triad: the axes that the part has, and their figures by name."""

    axes: str
    figures: Mapping[str, DataSheetFigure]


@dataclass(frozen=True, slots=True)
class Preset:
    """A part's data sheet.

    Attributes
    ----------
    name, title : str
        Short and full name.
    sources : mapping
        What the figures' source tags stand for.
    triads : mapping
        "gyr", "acc", "mag" to their `TriadSheet`.
    attitude : mapping
        Accuracy of the angles that a reference says itself, by name (`ANGLES`); empty for other parts.
    """

    name: str
    title: str
    sources: Mapping[str, str]
    triads: Mapping[str, TriadSheet]
    attitude: Mapping[str, DataSheetFigure] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Module:
    """One unit of one kind, with its own errors.

    Parameters
    ----------
    name : str
        Of the unit.
    source : str
        Where its figures come from, and which of them are not verified.
    gyr, acc, mag : TriadErrors or None
        Its triads; None where it has none.
    attitude : AttitudeErrors or None
        Of the angles that it says itself; None where it says none.
    """

    name: str
    source: str
    gyr: TriadErrors | None = None
    acc: TriadErrors | None = None
    mag: TriadErrors | None = None
    attitude: AttitudeErrors | None = None

    def calibrated(self) -> Self:
        """Return the unit after an ideal calibration: noise, quantisation and range stay, and its attitude's errors."""
        triads = {name: getattr(self, name) for name in TRIADS}
        return replace(self, **{n: e and e.calibrated() for n, e in triads.items()})

    def with_mag_rate(self, rate: float) -> Self:
        """Return the unit with another sampling rate of its magnetometer, Hz."""
        return replace(self, mag=self.mag and replace(self.mag, rate=rate))

    def with_range(self, gyr: float | None = None, acc: float | None = None) -> Self:
        """Return the unit with other full scales, rad/s and m/s²; its counts stay as many, and so grow or shrink."""
        ranges = {name: (getattr(self, name), end) for name, end in (("gyr", gyr), ("acc", acc)) if end is not None}
        return replace(self, **{name: errors and errors.with_range(end) for name, (errors, end) in ranges.items()})

    def with_high_pass(self, corner: float) -> Self:
        """Return the unit with a first-order high-pass of that corner, Hz, behind its gyroscope.

        Raises
        ------
        ParameterError
            If it has no gyroscope.
        """
        if self.gyr is None:
            raise ParameterError(f"{self.name} has no gyroscope for a high-pass; leave the high-pass out.")
        return replace(self, gyr=replace(self.gyr, high_pass=corner))

    def with_noise(self, card: NoiseCard) -> Self:
        """Return the unit with N, B and K of a card instead of its own, in each triad that the card has.

        Raises
        ------
        ParameterError
            If the card has a triad that the unit has not, or none at all.
        """
        noises = {name: noise for name in TRIADS if (noise := getattr(card, name)) is not None}
        names = [name for name in TRIADS if getattr(self, name) is not None]
        if not noises or not set(noises) <= set(names):
            raise ParameterError(
                f"the noise card of {card.device} has {', '.join(noises) or 'no triad'}, but {self.name} has "
                f"{', '.join(names)}; name sensors that have what the card has."
            )
        triads = {name: getattr(self, name).with_noise(noise) for name, noise in noises.items()}
        source = f"{self.source}; noise of {', '.join(noises)} from the card of {card.device} ({card.source})"
        return replace(self, source=source, **triads)


def preset_names() -> tuple[str, ...]:
    """Names of all parts, variants and aliases included."""
    return tuple(sorted(_index()))


@cache
def preset(name: str) -> Preset:
    """Look a part up by its name or variant.

    Raises
    ------
    ParameterError
        If there is none.
    """
    if name not in _index():
        raise unknown_name("sensor", name, preset_names(), hint=" Join parts with '+'.")
    full, file = _index()[name]
    raw = _load(file)
    variant = raw.get("variants", {}).get(full.partition(":")[2], {})
    triads = {triad: _sheet(full, raw, triad, variant.get(triad, {})) for triad in TRIADS if triad in raw}
    attitude = {key: _figure(f"{full} attitude.{key}", raw["attitude"][key], raw["sources"]) for key in ANGLES
                if "attitude" in raw}  # fmt: skip
    return Preset(full, raw["title"], raw["sources"], triads, attitude)


def draw_module(sensors: str, seed: int) -> Module:
    """Draw a unit of some parts: each error uniform within what the sheets allow, and noise as they say.

    Parameters
    ----------
    sensors : str
        Parts joined by ``+``.
    seed : int
        Same seed, same unit.

    Raises
    ------
    ParameterError
        If a part is unknown, two give the same axis, or a triad lacks one.
    """
    parts = [preset(name.strip()) for name in sensors.split("+")]
    triads = {triad: _join(parts, triad) for triad in TRIADS}
    errors = {triad: _draw(triad, figures, seed) for triad, figures in triads.items() if figures is not None}
    said = [part.attitude for part in parts if part.attitude]
    if len(said) > 1:
        raise ParameterError(f"{sensors} has two parts that give an attitude; leave one out.")
    attitude = AttitudeErrors(**{name: float(said[0][name].si[0]) for name in ANGLES}) if said else None
    return Module("+".join(part.name for part in parts), _provenance(parts), **errors, attitude=attitude)


def _join(parts: list[Preset], triad: str) -> dict[str, Floats] | None:
    """Figures (3,) of a triad in SI, from the parts that have its axes."""
    figures: dict[str, Floats] = {}
    owner: dict[str, str] = {}
    for part in (p for p in parts if triad in p.triads):
        sheet = part.triads[triad]
        columns = ["xyz".index(axis) for axis in sheet.axes]
        if twice := set(sheet.axes) & set(owner):
            axis = min(twice)
            raise ParameterError(f"{part.name} and {owner[axis]} both have {triad} axis {axis}; leave one out.")
        owner |= dict.fromkeys(sheet.axes, part.name)
        for name, figure in sheet.figures.items():
            figures.setdefault(name, np.full(3, _UNSAID.get(name, 0.0)))[columns] = figure.si[columns]
    if 0 < len(owner) < 3:
        has, lacks = "".join(sorted(owner)), "".join(sorted(set("xyz") - set(owner)))
        raise ParameterError(f"{'+'.join(set(owner.values()))} has {triad} axes {has} only; add a part with {lacks}.")
    return figures if owner else None


def _draw(triad: str, figures: dict[str, Floats], seed: int) -> TriadErrors:
    def figure(name: str) -> Floats:
        return figures.get(name, np.full(3, _UNSAID.get(name, 0.0)))

    def within(name: str, *shape: int) -> Floats:
        limit = figure(name).reshape((3,) + (1,) * (len(shape) - 1))
        return np.asarray(limit * stream(seed, "module", triad, name).uniform(-1.0, 1.0, shape))

    counts = figure("counts")
    turn, picked_up = skew(within("axis_misalignment", 3)), within("cross_axis", 3, 3)
    return TriadErrors(
        white_rpsd=figure("noise_density"),
        white_sd=figure("noise_sample"),
        flicker=figure("bias_instability"),
        bias=within("null_offset", 3),
        bias_per_k=within("bias_tempco", 3),
        scale=within("scale_tolerance", 3),
        scale_per_k=within("scale_tempco", 3),
        misalignment=turn + picked_up * (1.0 - np.eye(3)),
        soft_iron=np.eye(3) + np.diag(within("soft_iron", 3)),
        hard_iron=within("hard_iron", 3),
        g_sensitivity=within("g_sensitivity", 3, 3),
        lsb=np.where(counts > 0.0, 1.0 / np.where(counts > 0.0, counts, 1.0), figure("lsb")),
        full_scale=figure("range"),
        latency=figure("latency"),
        rate=float(figures["sample_rate"][0]) if "sample_rate" in figures else None,
    )


def _provenance(parts: list[Preset]) -> str:
    doubtful = [
        f"{part.name} {triad}.{name}"
        for part in parts
        for triad, figures in (
            *((name, sheet.figures) for name, sheet in part.triads.items()),
            ("attitude", part.attitude),
        )
        for name, figure in figures.items()
        if figure.mark == "UNVERIFIED" and name not in _NOT_SIMULATED
    ]
    label = "presets " + "+".join(part.name for part in parts)
    return f"{label}; unverified: {', '.join(doubtful)}" if doubtful else label


@cache
def _index() -> dict[str, tuple[str, str]]:
    """Every name that is understood, to the full name and the file that it stands for."""
    index: dict[str, tuple[str, str]] = {}
    for file in sorted(f.name for f in (resources.files("plumbob.simulation") / "presets").iterdir()):
        if file.endswith(".toml"):
            raw = _load(file)
            full = [f"{raw['name']}:{variant}" for variant in raw.get("variants", {})] or [raw["name"]]
            names = dict.fromkeys([raw["name"], *raw.get("aliases", [])], full[0])
            index |= {name: (meant, file) for name, meant in {**names, **dict(zip(full, full, strict=True))}.items()}
    return index


@cache
def _load(file: str) -> dict[str, Any]:
    return tomllib.loads(packaged(f"simulation/presets/{file}"))


def _sheet(part: str, raw: dict[str, Any], triad: str, variant: dict[str, Any]) -> TriadSheet:
    tables = {**raw[triad], **variant}
    axes = tables.pop("axes")
    figures = {name: _figure(f"{part} {triad}.{name}", table, raw["sources"]) for name, table in tables.items()}
    if unknown := set(figures) - set(FIGURES):
        raise ParameterError(f"{part} {triad} has unknown figures {sorted(unknown)}; known: {', '.join(FIGURES)}.")
    return TriadSheet(axes, figures)


def _figure(where: str, table: dict[str, Any], sources: dict[str, str]) -> DataSheetFigure:
    value = table["value"]
    figure = DataSheetFigure(**{**table, "value": tuple(value) if isinstance(value, list) else float(value)})
    if figure.mark not in MARKS or figure.source not in sources:
        raise ParameterError(f"{where} has mark '{figure.mark}' and source '{figure.source}'; one is not listed.")
    return figure
