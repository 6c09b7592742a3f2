"""Whether axes and signs agree with the other sensors, and what else speaks against a magnetometer's calibration."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import Fitted, Reason, refuse
from plumbob.calibration.mag import axes as turning
from plumbob.calibration.mag.checks import DIP, dip_angle
from plumbob.calibration.mag.with_acc import FEWEST, rotation_in, turn_angle
from plumbob.calibration.predicted import heading_apart, heading_sd
from plumbob.core.check import Floats
from plumbob.core.findings import Note, warning
from plumbob.core.units import deg, to_deg
from plumbob.data import TITLES, ImuData
from plumbob.rotations import axes_letters, axes_words, signed_axes

LEVEL: Final = deg(10.0)  # dip up to which a field does not tell up from down, rad
TUMBLED: Final = 0.2  # scatter of the vertical along each axis above which a field with hard iron tells its dip


@dataclass(frozen=True, eq=False)
class _Fault:
    """Wrong axes of a triad."""

    suspect: turning.Suspect  # the triad, and its arrangement but for the sign that a dip tells
    # dip that the right-handed arrangement gives, rad, positive where it is as it must be; None where nothing tells
    dip: float | None
    # whether the place tells on which side of the horizon the field must be, and not the north of the equator
    placed: bool
    body_axes: str  # body axes in those of the case

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


def wrong_axes(imu: ImuData, mag: Floats, *, dip: float | None) -> tuple[Reason, ...]:
    """Reasons to refuse wrong axes of any triad; the field (N, 3) is NaN where it does not count.

    Without the `dip` of the place, rad, north of the magnetic equator is assumed.
    """
    wrong = turning.suspects(turning.arrangements(imu.t, mag, acc=imu.usable("acc"), gyr=imu.usable("gyr")))
    return tuple(_reason(_fault(suspect, imu, mag, dip, _rough_dip)) for suspect in wrong)


def _fault(
    wrong: turning.Suspect,
    imu: ImuData,
    mag: Floats,
    place: float | None,
    dip: Callable[[Floats, Floats], float | None],
) -> _Fault:
    force = imu.usable("acc")
    field, force = (mag @ wrong.way, force) if wrong.triad == "mag" else (mag, force @ wrong.way)
    valid = np.isfinite(field).all(axis=1) & np.isfinite(force).all(axis=1)
    angle = (
        None
        if wrong.triad == "gyr" or np.count_nonzero(valid) < turning.FEWEST_DIRECTIONS
        else dip(field[valid], force[valid])
    )
    if angle is not None and min(abs(angle), abs(angle if place is None else place)) > LEVEL:
        angle *= math.copysign(1.0, 1.0 if place is None else place)
    else:
        angle = None
    return _Fault(wrong, angle, place is not None, imu.meta.axes)


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
    return Reason("mirrored" if fault.mirrored else "turned-axes", f"{_diagnosis(fault)}.", advice)


def _remark(fault: _Fault) -> Note:
    text = f"{_diagnosis(fault)}. {_advice(fault)}"
    if fault.suspect.triad != "mag":
        return warning("calibration.mag_axes", what=text)
    return warning("calibration.mag_turned", angle=_angle(fault.suspect.way), what=text)


def _diagnosis(fault: _Fault) -> str:
    """What is wrong, and what speaks for it."""
    words = f"{_words(fault.way)}, or {_words(-fault.way)}" if fault.open else _words(fault.way)
    text = f"the axes of the {TITLES[fault.suspect.triad]} are wrong ({words}); with these put right it agrees with "
    wrong = fault.suspect
    if wrong.sure:
        text += " and ".join(title for triad, title in TITLES.items() if triad != wrong.triad)
    else:
        text += f"the {TITLES[wrong.beside]}, unless the axes of that are wrong"
    if fault.dip is None or not fault.upward:
        return text
    side = "be on the other side of the horizon than at the place" if fault.placed else "point up"
    turned = f"it would be turned by {_angle(fault.suspect.way)}°"
    return f"{text}; or {turned}, and the field would {side}, with a dip of {to_deg(fault.dip):.0f}°"


def _advice(fault: _Fault) -> str:
    """Lines of a profile that put wrong axes right."""
    text = f"Check its data sheet; in the profile of a text file, write {fault.line(fault.way)}"
    if fault.open:
        text += f", or {fault.line(-fault.way)}"
    text += ", on top of axes that stand there."
    if fault.dip is None or fault.placed:
        return text
    south = f"South of the magnetic equator it is {fault.line(-fault.way)}"
    return f"{text} {south}: say where the capture was with --place."


def _angle(rotation: Floats) -> int:
    """Angle of a right-handed arrangement, degrees."""
    return round(to_deg(math.acos(0.5 * (float(np.trace(rotation)) - 1.0))))


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


TURNED: Final = deg(45.0)  # turn against the accelerometer beyond which axes are named wrongly rather than askew, rad
MOST_TURNED: Final = deg(10.0)  # turn against the gyroscope beyond which the accelerometer told no vertical, rad
WRONG_DIP: Final = deg(15.0)  # difference of the dip from that of the place beyond which a capture is refused, rad
DOUBTFUL_DIP: Final = deg(3.0)  # the same, to be told, rad: buildings bend the field by as much
# Departure from 1 of the field's change against the rates, to be told: gyroscopes have ±3 %.
DOUBTFUL_SLOPE: Final = 0.05

# By which the field leaves its direction over some seconds, to be told, rad: rooms make 0.5 to 1.5°.
DOUBTFUL_ANGLE: Final = deg(5.0)

# Change of the heading by a calibration, over its predicted error, below which it would rather harm: the change is the
# sensor's own error less that of the calibration, so squared it exceeds the sensor's by that, on average.
LEAST_GAIN: Final = math.sqrt(2.0)

_AS_IT_IS: Final = (
    "Do not use it: the magnetometer as it is may well be better. Turn the unit longer, away from iron, through all "
    "attitudes; --force, in Python force=True, writes the card anyway."
)
_AXES: Final = (
    "Correct the magnetometer's axes by its data sheet: of a text file in its profile, as [mag] axes = 'x y -z' with "
    "mirrored = true"
)

_NEGATED: Final = (
    "All axes of the magnetometer have the wrong sign, [mag] axes = '-x -y -z' with mirrored = true in a text file's "
    "profile, or the accelerometer measures gravity instead of specific force, [acc] sign = 'gravity'"
)


def told_by_others(
    imu: ImuData, fit: Fitted, steady: NDArray[np.bool_], *, helper: str, dip: float | None
) -> tuple[Note, ...]:
    """Remarks of gyroscope, accelerometer and place about a fit; CaptureRefusedError if they contradict it.

    `steady` (N,) marks samples whose specific force may be gravity; `helper`, "none", "acc" or "gyr", has helped the
    fit, which turned the field to its axes; without the `dip`, rad, north of the magnetic equator is assumed.
    """
    matrix, force = fit.calibration.matrix, imu.usable("acc")
    field = (imu.usable("mag") - fit.calibration.bias) @ matrix.T
    unrotated = field @ rotation_in(matrix)  # in the magnetometer's own axes
    ways = turning.arrangements(imu.t, unrotated, acc=force, gyr=imu.usable("gyr"))
    faults = [_fault(suspect, imu, unrotated, dip, dip_angle) for suspect in turning.suspects(ways)]
    refuse(*(_reason(fault) for fault in faults if _spoils(fault, helper)))
    remarks, wrong = tuple(_remark(fault) for fault in faults), {fault.suspect.triad for fault in faults}
    if imu.gyr is not None and "gyr" not in wrong:
        remarks = (*remarks, *_by_gyroscope(imu, field, helper))
    if "acc" in wrong:
        return remarks
    angle = dip_angle(field[steady], force[steady], FEWEST)
    angle = dip_angle(field, force, FEWEST) if angle is None else angle
    turned = 0.0 if helper == "none" or "mag" in wrong else turn_angle(matrix)
    by = "accelerometer" if helper == "acc" else "gyroscope"
    # with the axes as they are, but for the sign
    one_dip = ways.dip is not None and np.array_equal(ways.dip, np.eye(3))
    remarks = (*remarks, *_of_turn(angle, turned, dip, by, one_dip=one_dip))
    if angle is None or dip is None or abs(angle - dip) <= DOUBTFUL_DIP:
        return remarks
    what = f"the field dips by {to_deg(angle):.1f}° in the capture, but by {to_deg(dip):.1f}° at the place."
    if abs(angle - dip) > WRONG_DIP:
        negated = one_dip and abs(angle + dip) < abs(angle - dip)
        advice = f"{_NEGATED if negated else _AXES}; check --place, and that no iron was near."
        refuse(Reason("wrong-field", what, advice))
    return (f"DIP OFF: {what} Iron nearby bends the field, and so does a building.", *remarks)


def without_gain(imu: ImuData, fit: Fitted, steady: NDArray[np.bool_], dip: float | None) -> Reason | None:
    """Reason not to use a fit that changes the heading by little more than it may be wrong; None where it helps."""
    c, quality = fit.calibration, fit.calibration.quality
    if c.covariance is None or quality is None or quality.tilt_range is None:
        return None
    field = (imu.usable("mag") - c.bias) @ c.matrix.T
    angle = dip_angle(field[steady], imu.usable("acc")[steady], FEWEST) if dip is None else dip
    place = {
        "size": float(np.nanmedian(np.linalg.norm(field, axis=1))),
        "dip": DIP if angle is None else angle,
        "tilt_range": quality.tilt_range,
    }
    model = c.matrix, c.bias
    change = heading_apart(model, (np.eye(3), np.zeros(3)), model, **place)
    sd = heading_sd(c.matrix, c.covariance, **place)
    if change > LEAST_GAIN * sd:
        return None
    change, sd = to_deg(change), to_deg(sd)
    what = f"the calibration changes headings by {change:.2g}° and may itself be wrong by {sd:.2g}° (1 sd)."
    return Reason("no-gain", what, _AS_IT_IS)


def require_field_turns(imu: ImuData, mag: Floats) -> turning.Agreement | None:
    """How a field (N, 3), calibrated or not, agrees with the rates; one that turns against them is refused."""
    fit = turning.agreement(imu.t, mag, imu.usable("gyr"))
    if fit is not None and fit.slope < turning.LEAST_SLOPE:
        what = (
            "the field turns against the gyroscope: an axis of the magnetometer is swapped or has the wrong sign; "
            f"it changes by {fit.slope:.2f} of what the rates say, and 1 is right."
        )
        refuse(Reason("mirrored", what, f"{_AXES}; or the gyroscope's, if its signs are in doubt."))
    return fit


def _by_gyroscope(imu: ImuData, field: Floats, helper: str) -> tuple[str, ...]:
    """How a calibrated field follows the rates, in figures; one that does not is refused."""
    fit = require_field_turns(imu, field)
    apart = None if fit is None or fit.turn is None else turn_angle(fit.turn)
    if helper == "acc" and apart is not None and apart > MOST_TURNED:
        what = (
            f"the field is turned by {to_deg(apart):.0f}° against the gyroscope, so the specific force was not "
            "that of gravity, or the accelerometer's axes are not the gyroscope's."
        )
        refuse(Reason("not-still", what, "Hold the unit still in each attitude, or turn it slowly, and capture again."))
    angle = turning.wander(imu.t, field, imu.usable("gyr"))
    if fit is None or angle is None:
        return ()
    turned = "" if apart is None else f", turned by {to_deg(apart):.1f}° against them,"
    text = (
        f"the calibrated field turns at {fit.slope:.2f} of the rates{turned} and keeps its direction in space within "
        f"{to_deg(angle):.1f}° (rms) over {turning.SPAN:.0f} s."
    )
    if abs(fit.slope - 1.0) <= DOUBTFUL_SLOPE and angle <= DOUBTFUL_ANGLE:
        return (f"Against the gyroscope, {text}",)
    doubt = "Its scale, bias or unit is wrong, or the card: calibrate it, and keep iron away."
    return (f"GYROSCOPE DISAGREES: {text} {doubt}",)


def _of_turn(angle: float | None, turned: float, dip: float | None, by: str, *, one_dip: bool) -> tuple[str, ...]:
    """What a large turn or a dip of the south says, where no place tells the dip."""
    upward = angle is not None and angle < 0.0 and dip is None
    dips = "" if angle is None else f"a dip of {to_deg(angle):.0f}°"
    if turned > TURNED and upward:
        what = (
            f"the magnetometer would be turned by {to_deg(turned):.0f}° against the {by}, and the field would "
            f"point up, with {dips}: so does a mirrored one north of the magnetic equator."
        )
        refuse(Reason("mirrored", what, f"{_AXES}; south of the equator, say where the capture was with --place."))
    if turned > TURNED:
        return (
            f"TURNED BY {to_deg(turned):.0f}°: the magnetometer's axes are not those of the {by}. "
            "If the device does not mount it so, correct 'axes' of [mag] in the profile.",
        )
    if upward:
        signs = "all axes of the magnetometer have the wrong sign" if one_dip else "signs of the magnetometer are wrong"
        return (
            f"FIELD POINTS UP: {dips} is one south of the magnetic equator; north of it, {signs}, or the accelerometer "
            "measures gravity instead of specific force (sign of [acc] in a profile). Give --place to decide which.",
        )
    return ()
