"""What wrong axes of one sensor mean for a magnetometer's calibration: a refusal or a remark, and the line to write."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from plumbob.calibration.mag.axes import FEWEST_DIRECTIONS, Suspect, arrangements, suspects
from plumbob.calibration.mag.outcome import dip_of
from plumbob.calibration.rejection import Reason, refuse
from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg
from plumbob.data import TITLES, ImuData
from plumbob.rotations import axes_letters, axes_words, signed_axes

LEVEL: Final = deg(10.0)
"""Dip up to which a field does not tell up from down, rad."""

TUMBLED: Final = 0.2
"""Standard deviation of the vertical along each axis from which on a field with hard iron tells its dip."""


class Judged(NamedTuple):
    """Remarks on axes, the triads whose axes are wrong, and whether the field keeps its dip with axes as declared."""

    told: tuple[str, ...]
    wrong: frozenset[str]
    dip_kept: bool


@dataclass(frozen=True, eq=False)
class _Fault:
    """Wrong axes of a triad.

    Attributes
    ----------
    suspect : Suspect
        The triad, and its arrangement but for the sign that a dip tells.
    dip : float or None
        Dip that the right-handed arrangement gives, rad, positive where it is as it must be; None where nothing tells.
    placed : bool
        Whether the place tells on which side of the horizon the field must be, and not the north of the equator.
    body_axes : str
        Body axes in those of the case.
    """

    suspect: Suspect
    dip: float | None
    placed: bool
    body_axes: str

    @property
    def way(self) -> Floats:
        """Arrangement, with the sign that the dip tells."""
        return -self.suspect.way if self.upward else self.suspect.way

    @property
    def upward(self) -> bool:
        """Whether the right-handed arrangement is excluded by its dip."""
        return self.dip is not None and self.dip < 0.0

    @property
    def open(self) -> bool:
        """Whether nothing tells the sign of the arrangement."""
        return self.dip is None and self.suspect.triad != "gyr"

    @property
    def mirrored(self) -> bool:
        """Whether the axes are left-handed, or may be."""
        return self.open or _mirrors(self.way)

    def line(self, way: Floats) -> str:
        """Line of a profile for axes that are arranged so in the body's axes."""
        c_bs = signed_axes(self.body_axes)
        axes = axes_letters(c_bs.T @ way.T @ c_bs)
        return f'[{self.suspect.triad}] axes = "{axes}"{" with mirrored = true" if _mirrors(way) else ""}'


def judged_axes(imu: ImuData, mag: Floats, *, helper: str, dip: float | None) -> Judged:
    """Judge the axes of all triads by each other, and a calibration by them.

    Parameters
    ----------
    imu : ImuData
        The capture.
    mag : ndarray (N, 3)
        Its calibrated field in the magnetometer's own axes, µT.
    helper : {"none", "acc", "gyr"}
        What the fit was helped by, to whose axes it turned the field.
    dip : float or None
        Of the field at the place, rad; without it, north of the magnetic equator is assumed.

    Raises
    ------
    CaptureRefusedError
        If the calibration is wrong for them: mirrored, turned-axes.
    """
    found = arrangements(imu.t, mag, acc=imu.usable("acc"), gyr=imu.usable("gyr"))
    wrong = [_fault(one, imu, mag, dip, dip_of) for one in suspects(found)]
    refuse([_reason(fault) for fault in wrong if _spoils(fault, helper)])
    told, triads = tuple(_remark(fault) for fault in wrong), frozenset(fault.suspect.triad for fault in wrong)
    return Judged(told, triads, found.keeps_dip)


def wrong_axes(imu: ImuData, mag: Floats, *, dip: float | None) -> tuple[Reason, ...]:
    """Reasons to refuse wrong axes of any triad, whatever a calibration needs.

    Parameters
    ----------
    imu : ImuData
        The capture.
    mag : ndarray (N, 3)
        Its field as measured, µT, NaN where it does not count.
    dip : float or None
        As in `judged_axes`.
    """
    found = suspects(arrangements(imu.t, mag, acc=imu.usable("acc"), gyr=imu.usable("gyr")))
    return tuple(_reason(_fault(one, imu, mag, dip, _rough_dip)) for one in found)


def _fault(
    wrong: Suspect, imu: ImuData, mag: Floats, place: float | None, dip: Callable[[Floats, Floats], float | None]
) -> _Fault:
    force = imu.usable("acc")
    field, force = (mag @ wrong.way, force) if wrong.triad == "mag" else (mag, force @ wrong.way)
    known = np.isfinite(field).all(axis=1) & np.isfinite(force).all(axis=1)
    told = (
        None if wrong.triad == "gyr" or np.count_nonzero(known) < FEWEST_DIRECTIONS else dip(field[known], force[known])
    )
    if told is not None and min(abs(told), abs(told if place is None else place)) > LEVEL:
        told *= math.copysign(1.0, 1.0 if place is None else place)
    else:
        told = None
    return _Fault(wrong, told, place is not None, imu.meta.axes)


def _rough_dip(field: Floats, force: Floats) -> float | None:
    """Dip of fields (N, 3) with hard iron, rad, which is along the turning vertical; None where it hardly turns."""
    size = np.linalg.norm(force, axis=1, keepdims=True)
    up = force / np.maximum(size, np.finfo(np.float64).tiny)
    if np.linalg.eigvalsh(np.cov(up.T))[0] < TUMBLED**2:
        return None
    along = np.linalg.lstsq(np.column_stack((np.ones(len(up)), up)), np.sum(up * field, axis=1), rcond=None)[0][0]
    strength = math.sqrt(float(np.sum(np.var(field, axis=0))))
    return math.asin(min(1.0, max(-1.0, -float(along) / strength)))


def _mirrors(way: Floats) -> bool:
    return bool(np.linalg.det(way) < 0.0)


def _spoils(fault: _Fault, helper: str) -> bool:
    """Whether a calibration with a helper is wrong for wrong axes."""
    if fault.suspect.triad != "mag":
        return fault.suspect.triad == helper
    return helper == "none" or (fault.mirrored and not fault.open)


def _reason(fault: _Fault) -> Reason:
    advice = _advice(fault)
    if fault.suspect.triad == "mag" and not fault.mirrored:
        advice += " Or let --with acc or gyr take the turn into the card."
    return Reason("mirrored" if fault.mirrored else "turned-axes", f"{_told(fault)}.", advice)


def _remark(fault: _Fault) -> str:
    told = f"{_told(fault)}. {_advice(fault)}"
    if fault.suspect.triad != "mag":
        return f"AXES: {told} The magnetometer's card does not rest on them."
    return f"TURNED BY {_angle(fault.suspect.way)}°: {told} The card takes a turn up, and no mirror."


def _told(fault: _Fault) -> str:
    """What is wrong, and what speaks for it."""
    words = f"{_words(fault.way)}, or {_words(-fault.way)}" if fault.open else _words(fault.way)
    told = f"the axes of the {TITLES[fault.suspect.triad]} are wrong ({words}); with these put right it agrees with "
    told += _others(fault.suspect)
    if fault.dip is None or not fault.upward:
        return told
    side = "be on the other side of the horizon than at the place" if fault.placed else "point up"
    turned = f"it would be turned by {_angle(fault.suspect.way)}°"
    return f"{told}; or {turned}, and the field would {side}, with a dip of {to_deg(fault.dip):.0f}°"


def _others(wrong: Suspect) -> str:
    if not wrong.sure:
        return f"the {TITLES[wrong.beside]}, unless the axes of that are wrong"
    return " and ".join(title for triad, title in TITLES.items() if triad != wrong.triad)


def _advice(fault: _Fault) -> str:
    """Lines of a profile that put wrong axes right."""
    told = f"Check its data sheet; in the profile of a text file, write {fault.line(fault.way)}"
    if fault.open:
        told += f", or {fault.line(-fault.way)}"
    told += ", on top of axes that stand there."
    if fault.dip is None or fault.placed:
        return told
    south = f"South of the magnetic equator it is {fault.line(-fault.way)}"
    return f"{told} {south}: say where the capture was with --place."


def _angle(turn: Floats) -> int:
    """Angle of a right-handed arrangement, degrees."""
    return round(to_deg(math.acos(0.5 * (float(np.trace(turn)) - 1.0))))


def _words(way: Floats) -> str:
    """An arrangement in words: y and z reversed; mirrored: x and y swapped; its x, y, z are y, −x, z of the others."""
    diagonal = np.diag(way)
    if diagonal.all():
        wrong = ["xyz"[i] for i in np.flatnonzero(diagonal < 0.0)]
        words = f"{' and '.join(wrong) if len(wrong) < len(way) else 'all axes'} reversed"
    elif diagonal.any() and (way >= 0.0).all():
        words = f"{' and '.join('xyz'[i] for i in np.flatnonzero(diagonal == 0.0))} swapped"
    else:
        words = f"its x, y, z are {axes_words(way)} of the others"
    return f"mirrored: {words}" if _mirrors(way) else words
