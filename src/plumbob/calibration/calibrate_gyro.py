"""From a capture to the calibration of a gyroscope: at rest, by hand, by stops, Ferraris, a rate table, temperature."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.acc import calibrate_accel
from plumbob.calibration.calibrate_mag import calibrate_mag
from plumbob.calibration.calibration import Capture, capture, card_of
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, mean_of_whole
from plumbob.calibration.gyr.ferraris import find_parts, fit_ferraris, fit_trackball
from plumbob.calibration.gyr.hand import find_motions, fit_hand
from plumbob.calibration.gyr.rest import UNCALIBRATED, Rates, fit_rest
from plumbob.calibration.gyr.stops import fit_stops
from plumbob.calibration.gyr.table import MOUNTING, fit_table
from plumbob.calibration.gyr.temperature import fit_drift, fit_temperature
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, ParameterError
from plumbob.core.findings import Note, warning
from plumbob.core.units import dps, to_dps
from plumbob.data import TITLES, ImuData
from plumbob.data.cards import TriadCalibration
from plumbob.quality.static_periods import BLOCK, stills

_FITS: Final[Mapping[str, Callable[..., Fitted]]] = {
    "rest": fit_rest, "hand": fit_hand, "stops": fit_stops, "trackball": fit_trackball, "temperature": fit_temperature,
}  # fmt: skip


def fit_gyro(capture: Capture, method: str, **options: Any) -> Fitted:
    """Fit at "rest", by "hand", "stops", with the "trackball" paper's coefficients, or over "temperature".

    "auto" is by hand where the capture has motions that tilt the unit between poses at rest, else at rest.
    """
    if method != "auto":
        return _FITS[method](_rates(capture), **options)
    imu, moved = capture.imu, False
    if imu.acc is not None:
        motions, spoilt = find_motions(imu.t, _gyr(capture), imu.acc, stills(imu.t, imu.acc, _gyr(capture)))
        moved = bool(motions) or any(spoilt.values())
    fit = _FITS["hand" if moved else "rest"](_rates(capture))
    why = (
        "The capture has motions between poses at rest, so scale and axes were found too (--method hand)."
        if moved
        else "The capture has no motion between poses at rest, so only the bias was found (--method rest)."
    )
    return replace(fit, remarks=(why, *fit.remarks))


def drift_over_temperature(capture: Capture, triad: str) -> Fitted:
    """Fit what temperature adds to the accelerometer ("acc") or magnetometer ("mag"), whose card there must be."""
    base = None if capture.base is None else getattr(capture.base, triad)
    if base is None:
        raise CalibrationError(
            f"one pose shows no bias of the {TITLES[triad]}, only its drift: calibrate it first, and give its card "
            "with --calibration."
        )
    imu, mark = capture.imu, {"acc": flags.ACC_CLIPPED, "mag": flags.MAG_CLIPPED}[triad]
    return fit_drift(
        triad, imu.t, imu.usable(triad), imu.temp_c, base, acc=imu.acc, gyr=imu.gyr, clipped=_clipped(capture, mark)
    )


def ferraris_session(capture: Capture, parts: Mapping[str, slice] | None, *, angle: float) -> dict[str, Fitted]:
    """Accelerometer and gyroscope from a Ferraris session; its parts are looked for where they are None."""
    imu = capture.imu
    if imu.acc is None:
        raise CalibrationError("a Ferraris session needs acc and gyr, and there is no acc.")
    located = find_parts(imu.t, imu.acc, _gyr(capture)) if parts is None else parts
    clipped = _clipped(capture, flags.GYR_CLIPPED | flags.ACC_CLIPPED)
    fits = fit_ferraris(imu.t, imu.acc, _gyr(capture), located, angle=angle, clipped=clipped)
    gyr = fits["gyr"]
    return {**fits, "gyr": replace(gyr, remarks=(*gyr.remarks, *_lost_terms(capture)))}


def _gyr(capture: Capture) -> Floats:
    if capture.imu.gyr is None:
        raise CalibrationError("the capture has no gyr.")
    return capture.imu.gyr


def _rates(capture: Capture) -> Rates:
    imu = capture.imu
    return Rates(
        imu.t,
        _gyr(capture),
        acc=imu.acc,
        mag=None if imu.mag is None else imu.usable("mag"),
        temp_c=imu.temp_c,
        clipped=_clipped(capture, flags.GYR_CLIPPED),
        known=_gyr_base(capture),
        acc_calibrated=capture.calibrated("acc"),
    )


def _gyr_base(capture: Capture) -> TriadCalibration:
    """Gyroscope of the card so far."""
    return UNCALIBRATED if capture.base is None or capture.base.gyr is None else capture.base.gyr


def _clipped(capture: Capture, mark: int) -> NDArray[np.bool_]:
    return np.asarray((capture.imu.flags & np.uint32(mark)) != 0)


def calibrate_by_hand(
    whole: Capture, *, gravity: float = G0, strength: float | None = None, dip: float | None = None, force: bool = False
) -> dict[str, Fitted]:
    """Fit accelerometer, then gyroscope, then magnetometer, each with those before it calibrated; by triad.

    The capture, uncalibrated, is one of poses at rest with quick turns between them. A triad that it lacks is left out;
    if one cannot be calibrated, none is, because the others may rest on what is wrong with it, and the refusal names
    it.
    """
    with _named("acc"):
        fits = {"acc": calibrate_accel(_on(whole, {}, "acc").imu, gravity=gravity)}
    if whole.imu.gyr is not None:
        with _named("gyr"):
            fits["gyr"] = fit_gyro(_on(whole, fits, "gyr"), "auto")
    if whole.imu.mag is not None:
        with _named("mag"):
            on = _on(whole, fits, "mag")
            fits["mag"] = calibrate_mag(
                on.imu,
                strength=strength,
                dip=dip,
                acc_calibrated=on.calibrated("acc"),
                gyr_calibrated=on.calibrated("gyr"),
                force=force,
            )
    return fits


_ALONE = {
    "acc": "The other triads are calibrated by the accelerometer, so it comes first.",
    "gyr": "'plumbob calibrate accel' alone would do with this capture.",
    "mag": "'plumbob calibrate accel', then 'gyro', would do with this capture.",
}


def _on(source: Capture, fits: dict[str, Fitted], triad: str) -> Capture:
    """Capture of one triad, on the card so far with what has been fitted."""
    return capture(source.imu, triads=(triad,), device=source.device, base=card_of(source, fits))


@contextmanager
def _named(triad: str) -> Iterator[None]:
    """Name the triad in a refusal, and what can be done without it."""
    try:
        yield
    except CaptureRefusedError as refused:
        reasons = [replace(reason, text=f"{TITLES[triad]}: {reason.text}") for reason in refused.reasons]
        last = replace(reasons[-1], advice=f"{reasons[-1].advice} {_ALONE[triad]}")
        raise CaptureRefusedError(*reasons[:-1], last) from refused


LEAST: Final = 2.0  # shortest plateau, s, its first and last block not counted
NEAR: Final = 0.1  # largest departure from a nominal rate, of that rate; at rest, of the lowest rate
_GAIN = 0.15  # of an axis that departs from several speeds alike, to `_ALIKE`: of ADXRS290 up to 0.12
_ALIKE = 0.01
_STEP = float(dps(0.05))  # from block to block beyond noise, rad/s: a ramp of 0.2 °/s² and more is none
_RIPPLE = 1e-3  # of the rate, which a table may waver by
_ASTRAY = 0.2  # rate about another axis, of that about the main one: 11° of tilt
_FEWEST = 4


class Matched(NamedTuple):
    """Rates (M, 3), rad/s, of plateaus, and which of the M have one at all; others are zero."""

    rate: Floats
    found: NDArray[np.bool_]


def plateaus(t: Floats, gyr: Floats) -> list[slice]:
    """Stretches of constant rate (N, 3), in order; a slow drift away from it ends one, and so does a NaN.

    Blocks of a quarter of a second are compared by their means. The first and the last block of a stretch are left out,
    for a ramp may reach into them.
    """
    step = float(np.median(np.diff(t))) if t.size > 1 else BLOCK
    size = max(_FEWEST, round(BLOCK / step))
    count = t.size // size
    blocks = gyr[: count * size].reshape(count, size, 3)
    mean, scatter = blocks.mean(axis=1), blocks.std(axis=1, ddof=1).max(axis=1)
    noise = scatter[np.isfinite(scatter)]
    if noise.size == 0:
        return []
    limit = _STEP + 6.0 * float(np.median(noise)) / np.sqrt(size) + _RIPPLE * np.abs(mean).max(axis=1)
    with np.errstate(invalid="ignore"):
        joined = np.abs(np.diff(mean, axis=0)).max(axis=1) <= np.fmin(limit[1:], limit[:-1])
    runs = np.split(np.arange(count), np.flatnonzero(~joined) + 1)
    need = max(1, round(LEAST / (size * step)))
    inner = (_constant(run, mean, limit)[1:-1] for run in runs if run.size >= need + 2)
    return [slice(int(run[0]) * size, int(run[-1] + 1) * size) for run in inner if run.size >= need]


def match_rates(means: Floats, nominal: Floats) -> Matched:
    """Which of the nominal rates (k,) each mean (M, 3) is, rad/s: about the axis that turns most, or at rest.

    What most plateaus read about an axis is taken for its bias, so that a session must spin about each axis in less
    than half of its plateaus, or both ways round alike.
    """
    rate, matched = np.zeros_like(means), np.zeros(len(means), dtype=np.bool_)
    speeds = np.unique(np.append(np.abs(nominal), 0.0))
    if len(means) == 0 or speeds.size < 2:
        return Matched(rate, matched)
    turned = means - np.median(means, axis=0)
    rows, axis = np.arange(len(means)), np.argmax(np.abs(turned), axis=1)
    signed = turned[rows, axis]
    nearest = speeds[np.argmin(np.abs(np.abs(signed)[:, np.newaxis] - speeds), axis=1)]
    room = np.where(nearest > 0.0, nearest, speeds[1])
    gain, gains, spun = np.abs(signed) / room, np.ones_like(signed), nearest > 0.0
    for k in range(3):
        near = np.flatnonzero(spun & (axis == k) & (np.abs(gain - 1.0) <= _GAIN))
        alike = near[np.abs(gain[near] - np.median(gain[near])) <= _ALIKE] if near.size else near
        if np.unique(nearest[alike]).size > 1:
            gains[alike] = np.median(gain[alike])
    signed = signed / gains if (np.abs(gains[spun] - 1.0) <= NEAR).any() else signed  # of all axes, the list is off
    astray = np.sort(np.abs(turned), axis=1)[:, 1]
    matched = (np.abs(np.abs(signed) - nearest) <= NEAR * room) & (astray <= _ASTRAY * room)
    rate[rows, axis] = np.where(matched, np.sign(signed) * nearest, 0.0)
    return Matched(rate, matched)


def _constant(run: NDArray[np.intp], mean: Floats, limit: Floats) -> NDArray[np.intp]:
    """Longest part of a run of blocks that stays at the run's median."""
    near = np.abs(mean[run] - np.median(mean[run], axis=0)).max(axis=1) <= limit[run]
    parts = np.split(run, np.flatnonzero(np.diff(near)) + 1)
    steady = [part for part in parts if near[part[0] - run[0]]]
    return max(steady, key=len, default=run[:0])


_ROOM_C = 25.0
_ADVICE = "Check the nominal rates and the recording's unit of rate, or say what was done with a plan."


@dataclass(frozen=True, eq=False, slots=True)
class Plateau:
    """Stretch of constant rate."""

    # start, stop: when it begins and ends, s
    start: float
    stop: float
    rate: Floats  # (3,), true rate in the axes of the unit, rad/s
    force: Floats | None = None  # (3,), specific force, m/s², where it is known otherwise than by the accelerometer


def found_plateaus(imu: ImuData, nominal: Sequence[float]) -> tuple[list[Plateau], list[str]]:
    """Plateaus of a recording that have one of the nominal rates, rad/s, and a remark for each other one."""
    rates = imu.usable("gyr")
    stretches = plateaus(imu.t, rates)
    means = np.array([rates[part].mean(axis=0) for part in stretches]).reshape(-1, 3)
    matched = match_rates(means, np.asarray(nominal, dtype=np.float64))
    spans = [(float(imu.t[part.start]), float(imu.t[part.stop - 1])) for part in stretches]
    if not (matched.rate[matched.found] != 0.0).any():
        listed = ", ".join(f"{to_dps(float(np.abs(mean).max())):.4g}" for mean in means[:6]) or "none"
        text = f"no stretch of constant rate has one of the nominal rates; rates found are, in °/s: {listed}."
        raise CaptureRefusedError(Reason("no-motion", text, _ADVICE))
    matching = [Plateau(*spans[i], rate=matched.rate[i]) for i in np.flatnonzero(matched.found)]
    remarks = []
    for i in np.flatnonzero(~matched.found):
        rate = ", ".join(f"{x:.4g}" for x in to_dps(means[i]))
        span = f"{spans[i][0]:.1f} to {spans[i][1]:.1f} s"
        remarks.append(f"{span} is left out: its rate of ({rate}) °/s is not a nominal one.")
    return matching, remarks


def calibrate_table(
    capture: Capture,
    planned: Sequence[Plateau],
    *,
    model: str = "auto",
    mounting: float = MOUNTING,
    latitude: float | None = None,
) -> Fitted:
    """Fit the gyroscope to the means over the plateaus; arguments as of `fit_table`."""
    imu = capture.imu
    rows = [_rows(imu, plateau) for plateau in planned]
    forces = None
    if imu.acc is not None or all(plateau.force is not None for plateau in planned):
        acc = imu.usable("acc")
        each = zip(planned, rows, strict=True)
        means = [mean_of_whole(acc[part]) if p.force is None else p.force for p, part in each]
        forces = np.array(means).reshape(-1, 3)
    clipped = (imu.flags & np.uint32(flags.GYR_CLIPPED)) != 0
    rates = imu.usable("gyr")
    fitted = fit_table(
        np.array([plateau.rate for plateau in planned]).reshape(-1, 3),
        np.array([mean_of_whole(rates[part]) for part in rows]).reshape(-1, 3),
        force=forces,
        seconds=np.array([plateau.stop - plateau.start for plateau in planned]),
        clipped=np.array([clipped[part].mean() for part in rows]),
        model=model,
        mounting=mounting,
        latitude=latitude,
    )
    temps = np.empty(0) if imu.temp_c is None else np.concatenate([imu.temp_c[part] for part in rows])
    warm = float(np.nanmean(temps)) if np.isfinite(temps).any() else _ROOM_C  # what the bias belongs to
    triad = replace(fitted.calibration, temp_ref_c=warm)
    remarks = [*fitted.remarks]
    if triad.g_sensitivity.any() and not capture.calibrated("acc"):
        remarks.append("the accelerometer is not calibrated: g-sensitivity is wrong by as many per cent as its scale.")
    return replace(fitted, calibration=triad, remarks=(*remarks, *_lost_terms(capture)))


def _lost_terms(capture: Capture) -> tuple[Note, ...]:
    """Say that the card so far had a polynomial of temperature, which belonged to another fit."""
    return (warning("calibration.temperature_lost"),) if _gyr_base(capture).bias_per_k.any() else ()


def _rows(imu: ImuData, plateau: Plateau) -> slice:
    first, stop = imu.t.searchsorted((plateau.start, plateau.stop)).tolist()
    if stop <= first:
        raise ParameterError(
            f"the plateau from {plateau.start:g} to {plateau.stop:g} s holds no sample; the recording goes from "
            f"{float(imu.t[0]):g} to {float(imu.t[-1]):g} s."
        )
    return slice(first, stop)
