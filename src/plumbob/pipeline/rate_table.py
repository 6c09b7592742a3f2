"""A session on a rate table: its plateaus, found or read from a plan, and their means."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path

import numpy as np

from plumbob import flags
from plumbob._files import text_of
from plumbob.calib.fitted import Fitted
from plumbob.calib.gyr.plateaus import match_rates, plateaus
from plumbob.calib.gyr.table import MOUNTING, fit_table
from plumbob.calib.mean import mean_of_whole
from plumbob.calib.refusal import CaptureRefusedError, Reason
from plumbob.cards import TriadCalibration
from plumbob.check import Floats
from plumbob.data import ImuData
from plumbob.errors import DecodeError, ParameterError, one_line
from plumbob.pipeline.calibration import Capture
from plumbob.units import dps, g, to_dps

_TIMES = ("from_s", "to_s")
_RATES = ("rate_x_dps", "rate_y_dps", "rate_z_dps")
_FORCES = ("acc_x_g", "acc_y_g", "acc_z_g")
_ROOM_C = 25.0
_ADVICE = "Check the nominal rates and the recording's unit of rate, or say what was done with a plan."


@dataclass(frozen=True, eq=False, slots=True)
class Plateau:
    """Stretch of constant rate.

    Attributes
    ----------
    start, stop : float
        When it begins and ends, s.
    rate : ndarray (3,)
        True rate in the axes of the unit, rad/s.
    force : ndarray (3,) or None
        Specific force, m/s², where it is known otherwise than by the accelerometer.
    """

    start: float
    stop: float
    rate: Floats
    force: Floats | None = None


def found_plateaus(imu: ImuData, nominal: Sequence[float]) -> tuple[list[Plateau], list[str]]:
    """Plateaus of a recording that have one of the nominal rates, rad/s, and a remark for each other one.

    Raises
    ------
    CaptureRefusedError
        If there is none.
    """
    rates = imu.usable("gyr")
    stretches = plateaus(imu.t, rates)
    means = np.array([rates[one].mean(axis=0) for one in stretches]).reshape(-1, 3)
    matched = match_rates(means, np.asarray(nominal, dtype=np.float64))
    spans = [(float(imu.t[one.start]), float(imu.t[one.stop - 1])) for one in stretches]
    if not (matched.rate[matched.found] != 0.0).any():
        seen = ", ".join(f"{to_dps(float(np.abs(mean).max())):.4g}" for mean in means[:6]) or "none"
        told = f"no stretch of constant rate has one of the nominal rates; rates found are, in °/s: {seen}."
        raise CaptureRefusedError(Reason("no-motion", told, _ADVICE))
    kept = [Plateau(*spans[i], rate=matched.rate[i]) for i in np.flatnonzero(matched.found)]
    return kept, [_set_aside(spans[i], means[i]) for i in np.flatnonzero(~matched.found)]


def read_plan(path: Path) -> list[Plateau]:
    """Plateaus of a plan: a CSV file with from_s, to_s, rate_x_dps, rate_y_dps, rate_z_dps, and perhaps acc_x_g, ….

    Raises
    ------
    DecodeError
        If a column is missing or unknown, or a line is no plateau; the line is named.
    """
    lines = StringIO(text_of(path), newline="")
    try:
        table = csv.DictReader(lines, skipinitialspace=True, strict=True)
        columns = [name.strip() for name in table.fieldnames or ()]
        table.fieldnames = columns
        _require_columns(path, columns)
        return [_planned(row, f"{path}, line {table.line_num}") for row in table]
    except csv.Error as error:
        raise DecodeError(f"{path} is no CSV file: {one_line(error)}.") from error


def calibrate_table(
    capture: Capture,
    planned: Sequence[Plateau],
    *,
    model: str = "auto",
    mounting: float = MOUNTING,
    latitude: float | None = None,
) -> Fitted:
    """Fit the gyroscope to the means over the plateaus; arguments and errors as in `plumbob.calib.table.fit_table`.

    Raises
    ------
    ParameterError
        If a plateau holds no sample.
    """
    imu = capture.imu
    rows = [_rows(imu, one) for one in planned]
    forces = None if imu.acc is None and any(one.force is None for one in planned) else _forces(imu, planned, rows)
    clipped = (imu.flags & np.uint32(flags.GYR_CLIPPED)) != 0
    rates = imu.usable("gyr")
    fitted = fit_table(
        np.array([one.rate for one in planned]).reshape(-1, 3),
        np.array([mean_of_whole(rates[part]) for part in rows]).reshape(-1, 3),
        force=forces,
        seconds=np.array([one.stop - one.start for one in planned]),
        clipped=np.array([clipped[part].mean() for part in rows]),
        model=model,
        mounting=mounting,
        latitude=latitude,
    )
    found = replace(fitted.calibration, temp_ref_c=_temperature(imu, rows))
    return replace(
        fitted, calibration=found, remarks=(*fitted.remarks, *_of_force(capture, found), *_lost_terms(capture))
    )


def _of_force(capture: Capture, found: TriadCalibration) -> tuple[str, ...]:
    """Say that the g-sensitivity is one to a specific force that is not calibrated."""
    if not found.g_sensitivity.any() or (capture.base is not None and capture.base.acc is not None):
        return ()
    return ("the accelerometer is not calibrated: g-sensitivity is wrong by as many per cent as its scale.",)


def _lost_terms(capture: Capture) -> tuple[str, ...]:
    """Say that the card so far had a polynomial of temperature, which belonged to another fit."""
    if capture.base is None or capture.base.gyr is None or not capture.base.gyr.bias_per_k.any():
        return ()
    return ("The card's polynomial of temperature is gone; 'plumbob calibrate temperature' finds it again.",)


def _temperature(imu: ImuData, rows: Sequence[slice]) -> float:
    """Temperature that the bias belongs to, °C; 25 °C where it is not known."""
    known = np.concatenate([imu.temp_c[part] for part in rows]) if imu.temp_c is not None else np.empty(0)
    return float(np.nanmean(known)) if np.isfinite(known).any() else _ROOM_C


def _rows(imu: ImuData, one: Plateau) -> slice:
    first, stop = imu.t.searchsorted((one.start, one.stop)).tolist()
    if stop <= first:
        raise ParameterError(
            f"the plateau from {one.start:g} to {one.stop:g} s holds no sample; the recording goes from "
            f"{float(imu.t[0]):g} to {float(imu.t[-1]):g} s."
        )
    return slice(first, stop)


def _forces(imu: ImuData, planned: Sequence[Plateau], rows: Sequence[slice]) -> Floats:
    acc = np.empty((0, 3)) if imu.acc is None else imu.usable("acc")
    means = [
        mean_of_whole(acc[part]) if one.force is None else one.force for one, part in zip(planned, rows, strict=True)
    ]
    return np.array(means).reshape(-1, 3)


def _set_aside(span: tuple[float, float], mean: Floats) -> str:
    rates = ", ".join(f"{x:.4g}" for x in to_dps(mean))
    return f"{span[0]:.1f} to {span[1]:.1f} s is left out: its rate of ({rates}) °/s is none of the nominal ones."


def _require_columns(path: Path, columns: Sequence[str]) -> None:
    needed = {*_TIMES, *_RATES}
    allowed = needed | set(_FORCES)
    if not needed <= set(columns) or not set(columns) <= allowed or 0 < len(set(columns) & set(_FORCES)) < 3:
        raise DecodeError(
            f"{path}, line 1: a plan has the columns {', '.join((*_TIMES, *_RATES))}, and all or none of "
            f"{', '.join(_FORCES)}, but this one has {', '.join(columns) or 'none'}."
        )


def _planned(row: Mapping[str | None, str | None], where: str) -> Plateau:
    values = {}
    for name, cell in row.items():
        try:
            values[name] = float(cell or "")
        except (TypeError, ValueError) as error:
            raise DecodeError(
                f"{where}: {name or 'a column too many'} must be a number, but it is {cell!r}."
            ) from error
    if not np.isfinite(list(values.values())).all() or not 0.0 <= values["from_s"] < values["to_s"]:
        raise DecodeError(
            f"{where}: numbers must be finite, and from_s before to_s, but they are {list(values.values())}."
        )
    force = g(np.array([values[name] for name in _FORCES])) if _FORCES[0] in values else None
    return Plateau(values["from_s"], values["to_s"], dps(np.array([values[name] for name in _RATES])), force)
