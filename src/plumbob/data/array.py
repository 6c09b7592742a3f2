"""Several units on one time line: an array on one body, or one unit on each segment of a chain."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from plumbob.core.series import Series
from plumbob.core.text import counted
from plumbob.data.imu import ImuData
from plumbob.rotations import dcm_from_quat

if TYPE_CHECKING:
    from plumbob.data.cards import NoiseCard

Vec = tuple[float, float, float]
Quat = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class UnitMount:
    """How a unit sits on its body."""

    q_bs: Quat = (1.0, 0.0, 0.0, 0.0)  # from the unit's axes s to those of the body b, wxyz
    lever_b: Vec = (0.0, 0.0, 0.0)  # from the body's reference point to the unit's accelerometer, body axes, m
    clock_offset: float = 0.0  # by how much later than the time line says its values were taken, s
    noise: "NoiseCard | None" = field(default=None, repr=False)  # its noise, where known

    def __post_init__(self) -> None:
        """Validate, and normalise the rotation."""
        q = check.last_axis("q_bs", self.q_bs, 4)
        check.unit_norm("q_bs", q, 1e-3)
        lever = check.last_axis("lever_b", self.lever_b, 3)
        if not (np.isfinite(lever).all() and np.isfinite(check.number("clock_offset", self.clock_offset, "s"))):
            raise ParameterError("a mount's lever_b and clock_offset must be finite.")
        norm = float(np.linalg.norm(q))
        if abs(norm - 1.0) > 1e-15:  # one that has been normalised keeps its bits, from file to file
            q = q / norm
        object.__setattr__(self, "q_bs", tuple(q.tolist()))
        object.__setattr__(self, "lever_b", tuple(lever.tolist()))

    @property
    def dcm(self) -> Floats:
        """Matrix C_bs (3, 3)."""
        return dcm_from_quat(np.array(self.q_bs))


def named_unit(names: Sequence[str], wanted: str) -> str:
    """One of the names, by itself, by its letters and digits alone, or by its number from 1; ParameterError else."""
    letters = {name: "".join(filter(str.isalnum, name.casefold())) for name in (*names, wanted)}
    alike = [name for name in names if letters[name] == letters[wanted]]
    if wanted in names or alike:
        return wanted if wanted in names else alike[0]
    if wanted.isdecimal() and 1 <= int(wanted) <= len(names):
        return names[int(wanted) - 1]
    units = ", ".join(f"{name} ({number})" for number, name in enumerate(names[:20], 1))
    raise ParameterError(f"there is no unit '{wanted}'; there are {units}.")


@dataclass(frozen=True, eq=False, repr=False)
class ImuArray(Series):
    """Recordings of several units on one time line.

    A unit without a value at an instant is NaN there, as in any recording.

    Parameters
    ----------
    units : mapping of str to ImuData
        By name; each in its own axes, all with the same times.
    mounts : mapping of str to UnitMount, optional
        How each sits on its body; a unit that is not in it sits at the reference point, aligned.

    Raises
    ------
    ShapeError
        If there is no unit, or one has no name.
    ClockError
        If times differ.
    ParameterError
        If a mount belongs to no unit.
    """

    units: Mapping[str, ImuData]
    mounts: Mapping[str, UnitMount] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Validate, and name a mount for each unit."""
        if not self.units:
            raise ShapeError("an array needs at least one unit, but none was given.")
        first, line = next(iter(self.units.items()))
        for name, imu in self.units.items():
            if not isinstance(name, str) or not name.isprintable() or not name.strip():
                raise ShapeError(f"a unit needs a name of printable letters, as 'u1', but got {check.said(name)}.")
            check.kind(f"unit '{name}'", imu, ImuData)
            if imu.t is not line.t and not np.array_equal(imu.t, line.t):
                raise ClockError(
                    f"the units of an array share one time line, but '{name}' has {counted(len(imu), 'sample')} to "
                    f"{imu.t[-1]:.9g} s and '{first}' has {len(line)} to {line.t[-1]:.9g} s. Put them on one time line "
                    "first; plumbob.array.joined does that."
                )
        for name in self.mounts:
            if name not in self.units:
                raise ParameterError(f"the mount '{name}' belongs to no unit; units are {', '.join(self.units)}.")
        mounts = {
            name: check.kind(f"mount '{name}'", self.mounts.get(name, UnitMount()), UnitMount) for name in self.units
        }
        object.__setattr__(self, "units", dict(self.units))
        object.__setattr__(self, "mounts", mounts)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the units."""
        return tuple(self.units)

    @property
    def t(self) -> Floats:
        """Time line of all (N,), s."""
        return next(iter(self.units.values())).t

    def __len__(self) -> int:
        return int(self.t.size)

    def __getitem__(self, rows: slice) -> Self:
        """Samples of a slice with step 1 of all units; no copy is made."""
        return type(self)({name: unit[rows] for name, unit in self.units.items()}, self.mounts)

    def chunks(self, size: int) -> Iterator[Self]:
        """Consecutive parts of `size` samples; the last may be shorter."""
        for start in range(0, len(self), size):
            yield self[start : start + size]

    def stacked(self, triad: str) -> Floats:
        """Values of a triad of all units in body axes (N, units, 3); NaN where absent, invalid, or a unit has none."""
        turned = [unit.usable(triad) @ self.mounts[name].dcm.T for name, unit in self.units.items()]
        return np.stack(turned, axis=1)

    def facts(self) -> Mapping[str, str]:
        """Units, their sensors and samples."""
        unit = next(iter(self.units.values()))
        return {"units": ", ".join(self.units), **unit.facts()}

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Time, and the triads of each unit."""
        columns: dict[str, NDArray[Any]] = {"t [s]": self.t}
        for name, unit in self.units.items():
            columns |= {f"{name}.{key}": values for key, values in unit.columns().items() if key != "t [s]"}
        return columns


# No turn reverses all three axes of a unit, so each opposite unit reverses its own axis and the next: x is measured
# against by u4 (and u6), y by u5 (and u4), z by u6 (and u5).
_ABOUT_X: Final = UnitMount((0.0, 1.0, 0.0, 0.0))
_ABOUT_Y: Final = UnitMount((0.0, 0.0, 1.0, 0.0))
_ABOUT_Z: Final = UnitMount((0.0, 0.0, 0.0, 1.0))

PRESETS: Final[Mapping[str, Mapping[str, UnitMount]]] = {
    "arm": {"u1": UnitMount(), "u2": UnitMount(), "u3": UnitMount(), "u4": _ABOUT_Z, "u5": _ABOUT_X, "u6": _ABOUT_Y},
}
"""Mounts that have a name: of the six units of the teaching arm, three of which have opposite axes."""
