"""What the other sensors and the place say about a magnetometer's calibration, whichever fit gave it."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import Fitted
from plumbob.calibration.mag import turning
from plumbob.calibration.mag.axes import SPAN, wander
from plumbob.calibration.mag.outcome import DIP, dip_of
from plumbob.calibration.mag.with_acc import FEWEST, rotation_in, turn_of
from plumbob.calibration.mag_axes import judged_axes
from plumbob.calibration.predicted import heading_apart, heading_sd
from plumbob.calibration.rejection import Reason, refuse
from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg
from plumbob.data import ImuData

TURNED: Final = deg(45.0)
"""Turn against the accelerometer beyond which axes are named wrongly rather than mounted askew, rad."""

MOST_TURNED: Final = deg(10.0)
"""Turn against the gyroscope beyond which what the accelerometer told was not the vertical, rad."""

WRONG_DIP: Final = deg(15.0)
"""Difference of the dip from that of the place beyond which a capture is refused, rad."""

DOUBTFUL_DIP: Final = deg(3.0)
"""The same, to be told, rad: buildings bend the field by as much."""

DOUBTFUL_SLOPE: Final = 0.05
"""Departure from 1 of how much the field changes against the rates, to be told: gyroscopes have a scale of ±3 %."""

DOUBTFUL_ANGLE: Final = deg(5.0)
"""Angle that the field leaves its direction by over some seconds, to be told, rad: rooms make 0.5 to 1.5°."""

LEAST_GAIN: Final = math.sqrt(2.0)
"""Change of the heading by a calibration, over its predicted error, below which it would more likely harm than help.

The change is the sensor's own error less that of the calibration, which know nothing of each other: squared, it exceeds
the sensor's by the calibration's, on average."""

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
) -> tuple[str, ...]:
    """Remarks of gyroscope, accelerometer and place about a fit.

    Parameters
    ----------
    imu : ImuData
        The capture, the magnetometer as measured.
    fit : Fitted
        Its calibration.
    steady : ndarray (N,) of bool
        Samples whose specific force may be gravity.
    helper : {"none", "acc", "gyr"}
        What the fit was helped by.
    dip : float or None
        Of the field at the place, rad.

    Raises
    ------
    CaptureRefusedError
        If they contradict it.
    """
    matrix = fit.calibration.matrix
    field = (imu.usable("mag") - fit.calibration.bias) @ matrix.T
    axes = judged_axes(imu, field @ rotation_in(matrix), helper=helper, dip=dip)
    told = axes.told
    if imu.gyr is not None and "gyr" not in axes.wrong:
        told = (*told, *_by_gyroscope(imu, field, helper))
    if "acc" in axes.wrong:
        return told
    force = imu.usable("acc")
    found = _dip(field[steady], force[steady])
    found = _dip(field, force) if found is None else found
    turned = 0.0 if helper == "none" or "mag" in axes.wrong else turn_of(matrix)
    by = "accelerometer" if helper == "acc" else "gyroscope"
    told = (*told, *_of_turn(found, turned, dip, by, kept=axes.dip_kept))
    return told if found is None else (*_of_place(found, dip, kept=axes.dip_kept), *told)


def without_gain(imu: ImuData, fit: Fitted, steady: NDArray[np.bool_], dip: float | None) -> Reason | None:
    """Reason not to use a fit that changes the heading by little more than it may be wrong; None where it helps.

    Parameters
    ----------
    imu, fit, steady, dip
        As in `told_by_others`.
    """
    c, quality = fit.calibration, fit.calibration.quality
    if c.covariance is None or quality is None or quality.tilt_range is None:
        return None
    field = (imu.usable("mag") - c.bias) @ c.matrix.T
    found = _dip(field[steady], imu.usable("acc")[steady]) if dip is None else dip
    place = {
        "size": float(np.nanmedian(np.linalg.norm(field, axis=1))),
        "dip": DIP if found is None else found,
        "tilt_range": quality.tilt_range,
    }
    own = c.matrix, c.bias
    change = heading_apart(own, (np.eye(3), np.zeros(3)), own, **place)
    sd = heading_sd(c.matrix, c.covariance, **place)
    if change > LEAST_GAIN * sd:
        return None
    change, sd = to_deg(change), to_deg(sd)
    what = f"the calibration changes headings by {change:.2g}° and may itself be wrong by {sd:.2g}° (1 sd)."
    return Reason("no-gain", what, _AS_IT_IS)


def require_field_turns(imu: ImuData, mag: Floats) -> None:
    """Refuse a field (N, 3), calibrated or not, that turns against the gyroscope."""
    _require_sense(turning.agreement(imu.t, mag, imu.usable("gyr")))


def _require_sense(found: turning.Agreement | None) -> None:
    if found is not None and found.slope < turning.LEAST_SLOPE:
        what = (
            "the field turns against the gyroscope: an axis of the magnetometer is swapped or has the wrong sign; "
            f"it changes by {found.slope:.2f} of what the rates say, and 1 is right."
        )
        refuse([Reason("mirrored", what, f"{_AXES}; or the gyroscope's, if its signs are in doubt.")])


def _require_alignment(turned: float) -> None:
    """Refuse a field beside an accelerometer that is turned by so much, rad, against the gyroscope."""
    if turned <= MOST_TURNED:
        return
    what = (
        f"the field is turned by {to_deg(turned):.0f}° against the gyroscope, so the specific force was not "
        "that of gravity, or the accelerometer's axes are not the gyroscope's."
    )
    refuse([Reason("not-still", what, "Hold the unit still in each attitude, or turn it slowly, and capture again.")])


def _by_gyroscope(imu: ImuData, field: Floats, helper: str) -> tuple[str, ...]:
    """How a calibrated field follows the rates, in figures; one that does not is refused."""
    gyr = imu.usable("gyr")
    found = turning.agreement(imu.t, field, gyr)
    _require_sense(found)
    rotation = turning.turn(imu.t, field, gyr)
    turn = None if rotation is None else turn_of(rotation)
    if helper == "acc" and turn is not None:
        _require_alignment(turn)
    angle = wander(imu.t, field, gyr)
    if found is None or angle is None:
        return ()
    turned = "" if turn is None else f", turned by {to_deg(turn):.1f}° against them,"
    told = (
        f"the calibrated field turns at {found.slope:.2f} of the rates{turned} and keeps its direction in space within "
        f"{to_deg(angle):.1f}° (rms) over {SPAN:.0f} s."
    )
    if abs(found.slope - 1.0) <= DOUBTFUL_SLOPE and angle <= DOUBTFUL_ANGLE:
        return (f"Against the gyroscope, {told}",)
    doubt = "Its scale, bias or unit is wrong, or the card: calibrate it, and keep iron away."
    return (f"GYROSCOPE DISAGREES: {told} {doubt}",)


def _dip(field: Floats, force: Floats) -> float | None:
    """Angle of the field below the horizon, rad, by the specific force at the same instants."""
    known = np.isfinite(field).all(axis=1) & np.isfinite(force).all(axis=1)
    if int(np.count_nonzero(known)) < FEWEST:
        return None
    return dip_of(field[known], force[known])


def _of_place(found: float, dip: float | None, *, kept: bool) -> tuple[str, ...]:
    if dip is None or abs(found - dip) <= DOUBTFUL_DIP:
        return ()
    what = f"the field dips by {to_deg(found):.1f}° in the capture, but by {to_deg(dip):.1f}° at the place."
    if abs(found - dip) > WRONG_DIP:
        negated = kept and abs(found + dip) < abs(found - dip)
        axes = _NEGATED if negated else _AXES
        advice = f"{axes}; check --place, and that no iron was near."
        refuse([Reason("wrong-field", what, advice)])
    return (f"DIP OFF: {what} Iron nearby bends the field, and so does a building.",)


def _of_turn(found: float | None, turned: float, dip: float | None, by: str, *, kept: bool) -> tuple[str, ...]:
    """What a large turn or a dip of the south says, where no place tells the dip."""
    upward = found is not None and found < 0.0 and dip is None
    dips = "" if found is None else f"a dip of {to_deg(found):.0f}°"
    if turned > TURNED and upward:
        what = (
            f"the magnetometer would be turned by {to_deg(turned):.0f}° against the {by}, and the field would "
            f"point up, with {dips}: so does a mirrored one north of the magnetic equator."
        )
        refuse([Reason("mirrored", what, f"{_AXES}; south of the equator, say where the capture was with --place.")])
    if turned > TURNED:
        return (
            f"TURNED BY {to_deg(turned):.0f}°: the magnetometer's axes are not those of the {by}. "
            "If the device does not mount it so, correct 'axes' of [mag] in the profile.",
        )
    if upward:
        signs = "all axes of the magnetometer have the wrong sign" if kept else "signs of the magnetometer are wrong"
        return (
            f"FIELD POINTS UP: {dips} is one south of the magnetic equator; north of it, {signs}, or the accelerometer "
            "measures gravity instead of specific force (sign of [acc] in a profile). Give --place to decide which.",
        )
    return ()
