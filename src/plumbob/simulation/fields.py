"""Magnetic fields that depend on place: magnets and iron in the room, or on a segment of a chain."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.data.array import Vec
from plumbob.data.chain import Chain
from plumbob.rotations import Frame, quat_rotate
from plumbob.simulation.motion import Truth

_NEAREST = 0.01  # m; nearer to a dipole, its field does not grow any more: a magnet is not a point


class Disturbance(Protocol):
    """What bends the Earth's field."""

    @property
    def on(self) -> str:
        """Segment that it is fixed to; empty where it stands in the room."""

    def added_field(self, place_n: Floats, segment: Truth | None) -> Floats:
        """Field (N, 3) that it adds at places (N, 3), m; navigation frame, µT. `segment` is the one that it is on."""


@dataclass(frozen=True, slots=True)
class Dipole:
    """A small magnet, or iron that the Earth's field has magnetised.

    Parameters
    ----------
    place : tuple of 3 floats
        Where, m: in the navigation frame, or from the segment's origin in its axes.
    moment : tuple of 3 floats
        Magnetic moment in the same axes, A m²: 0.1 A m² make 20 µT at 0.1 m to the side, and 40 µT above a pole.
    on : str
        Segment that it is fixed to; empty where it stands in the room.
    """

    place: Vec
    moment: Vec
    on: str = ""

    def __post_init__(self) -> None:
        """Validate."""
        _finite("a dipole", self.place, self.moment)

    def added_field(self, place_n: Floats, segment: Truth | None) -> Floats:
        """Field (N, 3) at places (N, 3), m; navigation frame, µT."""
        moment = np.asarray(self.moment) if segment is None else quat_rotate(segment.q_nb, self.moment)
        way = place_n - _centre(self.place, segment)
        distance = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), _NEAREST)
        along = np.sum(moment * way, axis=1, keepdims=True) / distance
        # μ0 / 4π is 1e-7 T m/A, hence 0.1 µT m/A
        return np.asarray(0.1 * (3.0 * along * way / distance - moment) / distance**3)


@dataclass(frozen=True, slots=True)
class BentRegion:
    """A region in which the field is another one; the change fades with the distance as a bell curve.

    It is a model of a room, not of a magnet: its curl is not zero where it fades.

    Parameters
    ----------
    place : tuple of 3 floats
        Its centre, m: in the navigation frame, or from the segment's origin in its axes.
    change_n : tuple of 3 floats
        What it adds to the field at its centre, navigation frame, µT, also where it moves with a segment.
    radius : float
        Standard deviation of the bell curve, m; at twice as far 14 % are left. Infinite: everywhere.
    on : str
        Segment that its centre moves with; empty where it stands in the room.
    """

    place: Vec
    change_n: Vec
    radius: float = 0.15
    on: str = ""

    def __post_init__(self) -> None:
        """Validate."""
        _finite("a bent region", self.place, self.change_n)
        if not self.radius > 0.0:
            raise ParameterError(f"a bent region needs a radius above 0 m, but it is {self.radius:g} m.")

    def added_field(self, place_n: Floats, segment: Truth | None) -> Floats:
        """Field (N, 3) at places (N, 3), m; navigation frame, µT."""
        way = (place_n - _centre(self.place, segment)) / self.radius
        return np.asarray(np.exp(-0.5 * np.sum(way**2, axis=1, keepdims=True)) * np.asarray(self.change_n))


def bent_at(chain: Chain, segment: str, strength: float, frame: Frame) -> BentRegion:
    """Region around the unit of a segment in which the field is bent to the east, by `strength` in µT at the unit."""
    on = next((link for link in chain.segments if link.name == segment), None)
    if on is None or not on.unit:
        riders = ", ".join(link.name for link in chain.segments if link.unit)
        raise ParameterError(f"the field of {chain.name} can be bent at {riders}, but not at '{segment}'.")
    x, y, z = (strength * frame.east).tolist()
    return BentRegion(on.mount.lever_b, (x, y, z), on=segment)


def _centre(place: Vec, segment: Truth | None) -> Floats:
    return np.asarray(place) if segment is None else segment.pos_n + quat_rotate(segment.q_nb, place)


def _finite(what: str, *vectors: Vec) -> None:
    for vector in vectors:
        if not np.isfinite(check.last_axis("place and field", vector, 3)).all():
            raise ParameterError(f"place and field of {what} must be finite, but one is {vector}.")
