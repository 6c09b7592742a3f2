"""Bias of a gyroscope from stretches at rest, and whether they are of one; the rest of its calibration is kept.

Constant turning about the vertical looks like rest to gyroscope and accelerometer alike, and its rate like a bias. A
magnetometer sees it, calibrated or not, for the field turns against the unit. Dead axes are known, and biases beyond
any data sheet.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import RATE, Fitted, Reason, grade_of, mean_and_sd, refuse
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import EARTH_RATE
from plumbob.core.errors import CalibrationError
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import counted
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.data.calibrated import temperature_drift, times
from plumbob.data.cards import UNITS, Quality, TriadCalibration
from plumbob.quality.static_periods import stills

UNCALIBRATED: Final = TriadCalibration(np.eye(3), np.zeros(3), UNITS["gyr"], UNITS["gyr"])


class Rates(NamedTuple):
    """Measured rates, and what was measured beside them."""

    t: Floats  # (N,), time, s
    gyr: Floats  # (N, 3), measured rates, rad/s
    # (N, 3), specific force, m/s², which helps to detect rest; calibrated, as a card's g-sensitivity acts on
    acc: Floats | None = None
    mag: Floats | None = None  # (N, 3), flux density, calibrated or not, which distinguishes constant turning from rest
    temp_c: Floats | None = None  # (N,), temperature, °C
    clipped: NDArray[np.bool_] | None = None  # (N,), samples at the end of the gyroscope's range
    known: TriadCalibration = UNCALIBRATED  # calibration so far
    acc_calibrated: bool = False  # whether the specific force is calibrated


def without_known(rates: Rates) -> Floats:
    """Rates less what temperature and specific force are known to add, (N, 3); the bias stays."""
    corrected, base = rates.gyr, rates.known
    if base.bias_per_k.any():
        if rates.temp_c is None:
            raise CalibrationError("the gyroscope is to be corrected for temperature; record temp_c too.")
        corrected = corrected - temperature_drift(base, rates.temp_c)
    if base.g_sensitivity.any():
        if rates.acc is None:
            raise CalibrationError("the gyroscope is to be corrected for specific force; record acc too.")
        corrected = corrected - times(base.g_sensitivity, rates.acc)
    return corrected


def new_bias_covariance(known: TriadCalibration, bias: Floats) -> Floats:
    """Covariance (12, 12) after the bias was found again, with covariance (3, 3), and the matrix was kept."""
    covariance = np.zeros((12, 12))
    if known.covariance is not None:
        covariance[3:, 3:] = known.covariance[3:, 3:]
    covariance[:3, :3] = bias
    return covariance


def inverse_covariance(matrix: Floats, inverse: Floats) -> Floats:
    """Covariance (9, 9) of an inverse (3, 3), row by row, from that of the matrix: d(A⁻¹) = −A⁻¹ dA A⁻¹."""
    change = np.kron(inverse, inverse.T)
    return np.asarray(change @ matrix @ change.T)


LARGEST: Final = float(dps(40.0))  # bias of a MEMS gyroscope that works, rad/s: data sheets have up to ±40 °/s
FIELD_TURNED: Final = float(deg(3.0))  # turn of the field beyond its noise above which a stretch is not at rest, rad
UPRIGHT: Final = float(deg(15.0))  # tilt between rests that shows a turn about the vertical as a changing bias, rad
PART: Final = 0.5  # s over which the field is averaged: no bias within `LARGEST` turns it by more than 20° meanwhile
UNSEEN: Final = "A slow turn about the vertical would be in this bias: neither magnetometer nor tilt could show it."

_NEARLY = 0.8  # of the stretches: an axis may die on the way
_NOISE = 5.0  # standard deviations
_MOST = 90.0  # percentile of the parts' turns, so that a passing disturbance does not count


def dead_axes(*stretches: Floats) -> Reason | None:
    """Reason to refuse rates, stretches of (N, 3), rad/s, of which an axis does not change within nearly all."""
    finite = [rate[np.isfinite(rate).all(axis=1)] for rate in stretches]
    constant = [(rate == rate[0]).all(axis=0) for rate in finite if len(rate) > 1]
    dead = np.flatnonzero(np.mean(constant, axis=0) > _NEARLY).tolist() if constant else []
    if not dead:
        return None
    last = next(rate[-1] for rate in reversed(finite) if len(rate))
    axes = " and ".join(f"{'xyz'[i]} ({to_dps(float(last[i])):.4g} °/s)" for i in dead)
    text = f"The rate about {axes} never changes: no working gyroscope is without noise."
    return Reason("implausible", text, "That axis is dead or stuck, or the profile names another column for it.")


def beyond_bias(bias: Floats) -> Reason | None:
    """Reason to refuse a bias (3,), rad/s, that no gyroscope which works has."""
    worst = int(np.argmax(np.abs(bias)))
    text = (
        f"The bias about {'xyz'[worst]} would be {to_dps(float(bias[worst])):.3g} °/s, and data sheets have up to "
        f"{to_dps(LARGEST):.0f} °/s."
    )
    advice = "The unit turned steadily instead of lying at rest, or the unit of the rates in the profile is wrong."
    return None if abs(bias[worst]) <= LARGEST else Reason("implausible", text, advice)


def field_turns(t: Floats, mag: Floats, where: Sequence[slice]) -> Floats:
    """How far the field (N, 3), of any unit, turned in each stretch (K,), rad; zero where that is noise, or unknown."""
    return np.array([_turn(t[part], mag[part]) for part in where])


def turn_reason(turns: Floats) -> Reason:
    """Reason to refuse a capture in which the field turned by so much in each stretch (K,), rad."""
    text = (
        f"It turned about the vertical: the field turned by {to_deg(float(turns.max())):.0f}° while it seemed at rest."
    )
    return Reason("not-still", text, "Lay the unit on something that does not turn, away from moving iron.")


def unseen_turn(rates: Rates, where: Sequence[slice]) -> tuple[str, ...]:
    """Remark where neither the field nor the tilts of the stretches could tell a turn about the vertical."""
    acc, mag = rates.acc, rates.mag
    if mag is not None and any(np.isfinite(mag[part]).all(axis=1).any() for part in where):
        return ()
    if acc is not None:
        up = np.array([acc[part].mean(axis=0) for part in where])
        up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        if float((up @ up[0]).min()) < np.cos(UPRIGHT):
            return ()
    return (UNSEEN,)


def _turn(t: Floats, mag: Floats) -> float:
    """Angle between the field at first and what it turned to, rad; zero within the noise."""
    valid = np.isfinite(mag).all(axis=1)
    t, mag = t[valid], mag[valid]
    count = int((t[-1] - t[0]) / PART) if t.size else 0
    if count < 2 or t.size < 2 * count:
        return 0.0
    parts = np.array([part.mean(axis=0) for part in np.array_split(mag, count)])
    size = float(np.median(np.linalg.norm(mag, axis=1)))
    if not size > 0.0:
        return 0.0
    noise = float(np.diff(mag, axis=0).std(axis=0).max()) / np.sqrt(mag.shape[0] / count) / size  # of a difference
    cross = np.linalg.norm(np.cross(parts[0], parts[1:]), axis=1)
    angle = float(np.percentile(np.arctan2(cross, parts[1:] @ parts[0]), _MOST))
    return angle if angle > FIELD_TURNED + _NOISE * noise else 0.0


LEAST: Final = 2.0  # shortest time at rest that gives a bias, s
LONG: Final = 20.0  # shortest time at rest whose bias can be good, s: a shorter one does not see the bias wander


def fit_rest(rates: Rates) -> Fitted:
    """Bias at rest; matrix, polynomial and g-sensitivity of the calibration so far are kept.

    Its standard deviation is the larger of two: what the noise within all stretches leaves of their mean, and, from
    three stretches on, what the scatter of their means does, in which slow drift and g-sensitivity show.
    """
    t, base = rates.t, rates.known
    rates = rates._replace(gyr=check.rows("gyr", rates.gyr, 3, t.size))
    where, notes = rest(rates)
    corrected = without_known(rates)
    bias, spread, means = bias_at_rest([corrected[part] for part in where])
    refuse(beyond_bias(bias))
    seconds = sum(float(t[part.stop - 1] - t[part.start]) for part in where)
    grade = grade_of(float(spread.max()), RATE) or "poor"
    reference = base.temp_ref_c  # of the polynomial; else that of the rest, where it is known
    if not base.bias_per_k.any() and rates.temp_c is not None:
        temps = np.concatenate([rates.temp_c[part] for part in where])
        reference = float(np.nanmean(temps)) if np.isfinite(temps).any() else reference
    calibration = replace(
        base,
        bias=bias,
        covariance=new_bias_covariance(base, np.diag(spread**2)),
        residual_rms=float(np.sqrt(np.mean((means - bias) ** 2))),
        temp_ref_c=reference,
        method=f"gyr at rest, {seconds:.0f} s in {counted(len(where), 'stretch', 'stretches')}",
        quality=Quality(
            grade="fair" if grade == "good" and round(seconds) < LONG else grade,
            samples=sum(part.stop - part.start for part in where),
        ),
    )
    remarks = (*_remarks(calibration, spread, seconds), *notes, *unseen_turn(rates, where))
    return Fitted(calibration, means, means - bias, np.ones(len(where), dtype=bool), remarks)


def rest(rates: Rates) -> tuple[list[slice], tuple[Note, ...]]:
    """Stretches at rest, and what to say of them, or a refusal."""
    t, gyr, clipped = rates.t, rates.gyr, rates.clipped
    refuse(dead_axes(gyr))
    force = np.zeros_like(gyr) if rates.acc is None else rates.acc  # an accelerometer that says nothing against rest
    where, notes = _unturned(t, rates.mag, stills(t, force, gyr))
    seconds = sum(float(t[part.stop - 1] - t[part.start]) for part in where)
    at_end = clipped is not None and any(clipped[part].any() for part in where)
    broken = "A sensor that reads its full scale at rest is broken or its unit is wrong; check the profile's range."
    text = f"The unit was at rest for {seconds:.1f} s of {float(t[-1] - t[0]):.0f} s; {LEAST:.0f} s are needed."
    lay = "Lay the unit on something solid and let go of it for 30 s."
    refuse(
        Reason("clipping", "The gyroscope is at the end of its range while at rest.", broken) if at_end else None,
        Reason("not-still", text, lay) if seconds < LEAST else None,
    )
    return where, notes


def _unturned(t: Floats, mag: Floats | None, where: list[slice]) -> tuple[list[slice], tuple[Note, ...]]:
    """Stretches in which the field stood still, and how many others there were; a refusal where it did in none."""
    turns = np.zeros(len(where)) if mag is None else field_turns(t, mag, where)
    if not turns.any():
        return where, ()
    if turns.all():
        refuse(turn_reason(turns))
    notes = (
        warning(
            "calibration.stretches_turned",
            turned=np.count_nonzero(turns),
            count=len(where),
            turn_deg=to_deg(float(turns.max())),
        ),
    )
    return [part for part, turn in zip(where, turns.tolist(), strict=True) if not turn], notes


def bias_at_rest(stretches: list[Floats]) -> tuple[Floats, Floats, Floats]:
    """Bias (3,), its standard deviation (3,) and the mean of each stretch (k, 3), from rates at rest."""
    bias, spread = mean_and_sd(np.concatenate(stretches))
    means = np.array([stretch.mean(axis=0) for stretch in stretches])
    if len(means) >= 3:
        spread = np.maximum(spread, means.std(axis=0, ddof=1) / np.sqrt(len(means)))
    return bias, spread, means


def _remarks(calibration: TriadCalibration, spread: Floats, seconds: float) -> tuple[Note, ...]:
    remarks: list[Note] = [
        info("calibration.bias_known", sd_dps=to_dps(float(spread.max())), earth_rate_dps=to_dps(EARTH_RATE))
    ]
    if round(seconds) < LONG:
        remarks.append(warning("calibration.short_rest", seconds=seconds))
    if not calibration.bias_per_k.any():
        remarks.append(info("calibration.at_temperature"))
    return tuple(remarks)
