"""Bias of a gyroscope from stretches at rest; whatever else its calibration has is kept."""

from dataclasses import replace
from typing import Final

import numpy as np

from plumbob.calibration.fit import RATE, Fitted, Reason, grade_of, mean_and_sd, refuse
from plumbob.calibration.gyr.plausible import (
    Rates,
    beyond_bias,
    dead_axes,
    field_turns,
    new_bias_covariance,
    turn_reason,
    unseen_turn,
    without_known,
)
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import EARTH_RATE
from plumbob.core.text import counted
from plumbob.core.units import to_deg, to_dps
from plumbob.data.cards import Quality, TriadCalibration
from plumbob.quality.static_periods import stills

LEAST: Final = 2.0
"""Shortest time at rest that gives a bias, s."""

LONG: Final = 20.0
"""Shortest time at rest whose bias can be good, s: a shorter one sees the noise and not how the bias wanders."""


def fit_rest(rates: Rates) -> Fitted:
    """Bias at rest; matrix, polynomial and g-sensitivity of the calibration so far are kept.

    Its standard deviation is the larger of two: what the noise within all stretches leaves of their mean, and, from
    three stretches on, what the scatter of their means does, in which slow drift and g-sensitivity show.

    Raises
    ------
    CaptureRefusedError
        not-still, clipping, implausible.
    CalibrationError
        If the calibration so far needs a temperature or a specific force that is missing.
    """
    t, base = rates.t, rates.known
    rates = rates._replace(gyr=check.rows("gyr", rates.gyr, 3, t.size))
    where, notes = rest(rates)
    corrected = without_known(rates)
    bias, spread, means = bias_at_rest([corrected[part] for part in where])
    refuse(beyond_bias(bias))
    seconds = sum(float(t[part.stop - 1] - t[part.start]) for part in where)
    calibration = replace(
        base,
        bias=bias,
        covariance=new_bias_covariance(base, np.diag(spread**2)),
        residual_rms=float(np.sqrt(np.mean((means - bias) ** 2))),
        temp_ref_c=_temperature(base, rates.temp_c, where),
        method=f"gyr at rest, {seconds:.0f} s in {counted(len(where), 'stretch', 'stretches')}",
        quality=Quality(grade=_grade(spread, seconds), samples=sum(part.stop - part.start for part in where)),
    )
    remarks = (*_remarks(calibration, spread, seconds), *notes, *unseen_turn(rates, where))
    return Fitted(calibration, means, means - bias, np.ones(len(where), dtype=bool), remarks)


def rest(rates: Rates) -> tuple[list[slice], tuple[str, ...]]:
    """Stretches at rest, and what to say of them, or a refusal."""
    t, gyr, clipped = rates.t, rates.gyr, rates.clipped
    refuse(dead_axes(gyr))
    force = np.zeros_like(gyr) if rates.acc is None else rates.acc  # an accelerometer that says nothing against rest
    where, notes = _unturned(t, rates.mag, stills(t, force, gyr))
    seconds = sum(float(t[part.stop - 1] - t[part.start]) for part in where)
    reasons = []
    if clipped is not None and any(clipped[part].any() for part in where):
        advice = "A sensor that reads its full scale at rest is broken or its unit is wrong; check the profile's range."
        reasons.append(Reason("clipping", "The gyroscope is at the end of its range while at rest.", advice))
    if seconds < LEAST:
        text = f"The unit was at rest for {seconds:.1f} s of {float(t[-1] - t[0]):.0f} s; {LEAST:.0f} s are needed."
        reasons.append(Reason("not-still", text, "Lay the unit on something solid and let go of it for 30 s."))
    refuse(reasons)
    return where, notes


def _unturned(t: Floats, mag: Floats | None, where: list[slice]) -> tuple[list[slice], tuple[str, ...]]:
    """Stretches in which the field stood still, and how many others there were; a refusal where it did in none."""
    turns = np.zeros(len(where)) if mag is None else field_turns(t, mag, where)
    if not turns.any():
        return where, ()
    if turns.all():
        refuse([turn_reason(turns)])
    notes = (
        f"Left out: {np.count_nonzero(turns)} of {len(where)} stretches, in which the field turned by up to "
        f"{to_deg(float(turns.max())):.0f}°.",
    )
    return [part for part, turn in zip(where, turns.tolist(), strict=True) if not turn], notes


def _grade(spread: Floats, seconds: float) -> str:
    grade = grade_of(float(spread.max()), RATE) or "poor"
    return "fair" if grade == "good" and round(seconds) < LONG else grade


def bias_at_rest(stretches: list[Floats]) -> tuple[Floats, Floats, Floats]:
    """Bias (3,), its standard deviation (3,) and the mean of each stretch (k, 3), from rates at rest."""
    bias, spread = mean_and_sd(np.concatenate(stretches))
    means = np.array([stretch.mean(axis=0) for stretch in stretches])
    if len(means) >= 3:
        spread = np.maximum(spread, means.std(axis=0, ddof=1) / np.sqrt(len(means)))
    return bias, spread, means


def _temperature(base: TriadCalibration, temp_c: Floats | None, where: list[slice]) -> float:
    """Temperature that the bias belongs to, °C: that of the polynomial, else that of the rest, where it is known."""
    if base.bias_per_k.any() or temp_c is None:
        return base.temp_ref_c
    temps = np.concatenate([temp_c[part] for part in where])
    return float(np.nanmean(temps)) if np.isfinite(temps).any() else base.temp_ref_c


def _remarks(calibration: TriadCalibration, spread: Floats, seconds: float) -> tuple[str, ...]:
    remarks = [
        f"The bias is known to {to_dps(float(spread.max())):.2g} °/s where the unit lay; it includes up to "
        f"{to_dps(EARTH_RATE):.4f} °/s of the Earth's rotation."
    ]
    if round(seconds) < LONG:
        remarks.append(f"{seconds:.0f} s at rest do not show how the bias wanders; lay it down for 30 s or longer.")
    if not calibration.bias_per_k.any():
        remarks.append("It holds at the temperature of the capture: 'plumbob calibrate temperature' finds its drift.")
    return tuple(remarks)
