"""A Ferraris session [Ferraris1995]: its nine parts, and accelerometer and gyroscope from them.

::

    accelerometer   A = (U⁺ − U⁻) / 2g            columns: mean reading with axis x, y, z up (+) and down (−)
                    b = diag (U⁺ + U⁻) / 2
    gyroscope       b = mean of all positions     S = (G⁺ − G⁻) / 2g, G as U
                    A = ∫ (reading − b − S f) dt / angle, a column for each turn, f the calibrated specific force
    card            calibrated = A⁻¹ (reading − b [− S f])

A is what [Ferraris1995] writes as K R, scale times directions; the card holds its inverse, which leads from readings to
quantities. The axes are those of the faces that the unit was put on, for both triads.

Departures: which way a turn went is taken from the gyroscope's own sign, so only its size must be known; the standard
deviations are not part of the method. They are formed from what six positions tell about how exactly the unit was put
down: the readings across the vertical repeat the bias six times over.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import BLOCKS, SCALE, TILT, Fitted, Reason, grade_of, mean_and_sd, refuse
from plumbob.calibration.gyr import rest as resting
from plumbob.calibration.gyr.drift import chen2013
from plumbob.calibration.gyr.rest import Rates
from plumbob.calibration.predicted import TILT_RANGE, tilt_sd
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError
from plumbob.core.findings import info, warning
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.data.cards import UNITS, Quality, TriadCalibration
from plumbob.quality.static_periods import MOVED, TURNED, stills

# At rest, by the axis that measures +g (p, parallel) or −g (a).
FACES: Final = ("x_p", "x_a", "y_p", "y_a", "z_p", "z_a")

TURNS: Final = ("x_rot", "y_rot", "z_rot")  # turns about an axis
STEEP: Final = float(np.cos(deg(25.0)))  # share of gravity along an axis above which that axis stands on end
LEAST_TURN: Final = float(deg(90.0))  # smallest turn that is looked for, rad


def require_parts(parts: Mapping[str, slice]) -> None:
    """CalibrationError if parts are missing or unknown: their names are those of `FACES` and `TURNS`."""
    names = {*FACES, *TURNS}
    missing, unknown = sorted(names - set(parts)), sorted(set(parts) - names)
    if missing or unknown:
        raise CalibrationError(
            f"a Ferraris session has the parts {', '.join((*FACES, *TURNS))}; missing are "
            f"{', '.join(missing) or 'none'}, unknown {', '.join(unknown) or 'none'}."
        )


def parts_of_labels(labels: Sequence[str]) -> dict[str, slice]:
    """Parts of samples that each bear the name of their part, or none; CalibrationError if one lies in two places."""
    parts: dict[str, slice] = {}
    start = 0
    for name, run in groupby(labels):
        stop = start + len(list(run))
        if name in parts:
            raise CalibrationError(f"{name} lies in two places, from sample {parts[name].start} and from {start}.")
        if name:
            parts[name] = slice(start, stop)
        start = stop
    return parts


def parts_of_times(t: Floats, spans: Mapping[str, tuple[float, float]]) -> dict[str, slice]:
    """Parts of spans of time, s."""
    return {name: slice(*t.searchsorted(span).tolist()) for name, span in spans.items()}


def find_parts(t: Floats, acc: Floats, gyr: Floats) -> dict[str, slice]:
    """Find the parts in a session that was recorded in one go, uncalibrated.

    A face is the longest stretch at rest with an axis on end. A turn is what lies between two stretches at rest and
    turned the unit by more than a quarter about an axis that stood on end before and after, and least about others.
    """
    where = stills(t, acc, gyr)
    faces = [_face(acc[part].mean(axis=0)) for part in where]
    parts: dict[str, slice] = {}
    for face, part in zip(faces, where, strict=True):
        if face and (face not in parts or _length(part) > _length(parts[face])):
            parts[face] = part
    bias = np.median([gyr[part].mean(axis=0) for part in where], axis=0) if where else np.zeros(3)
    sizes: dict[str, float] = {}
    for k in range(len(where) - 1):
        span = slice(where[k].stop, where[k + 1].start)
        angle = integral(t[span], gyr[span] - bias)
        axis = int(np.abs(angle).argmax())
        same = bool(faces[k]) and faces[k] == faces[k + 1] == _face(np.sign(acc[where[k]].mean(axis=0)) * _AXES[axis])
        if same and abs(angle[axis]) > max(LEAST_TURN, sizes.get(TURNS[axis], 0.0)):
            parts[TURNS[axis]], sizes[TURNS[axis]] = span, float(abs(angle[axis]))
    missing = [name for name in FACES if name not in parts]
    unturned = [name for name in TURNS if name not in parts]
    lay = "Let each axis point up (p) and down (a) for 5 s, or say where the parts lie."
    turn = "Turn the unit once around about each axis while that stands on end, with a rest before and after."
    no_turn = f"There is no turn {', '.join(unturned)} between two rests on the same face."
    refuse(
        Reason("not-still", f"The unit never lay still on {', '.join(missing)}.", lay) if missing else None,
        Reason("no-motion", no_turn, turn) if unturned else None,
    )
    return parts


def integral(t: Floats, rate: Floats) -> Floats:
    """Integral (3,) of rates (N, 3) each of which stands for a whole step, as wide as those beside it."""
    return np.asarray(np.gradient(t) @ rate) if t.size > 1 else np.zeros(3)


_AXES: Final = np.eye(3)


def _face(force: Floats) -> str:
    """Name of the face whose axis stands on end; empty where none does."""
    axis = int(np.abs(force).argmax())
    if not abs(force[axis]) >= STEEP * float(np.linalg.norm(force)):
        return ""
    return f"{'xyz'[axis]}_{'p' if force[axis] > 0.0 else 'a'}"


def _length(part: slice) -> int:
    return int(part.stop - part.start)


def fit_trackball(rates: Rates) -> Fitted:
    """Bias at rest with the paper's coefficients of temperature and specific force, which must be there."""
    fit = resting.fit_rest(rates._replace(known=chen2013()))
    calibration, method = fit.calibration, "gyr by the trackball paper's preset, bias at rest"
    quality = Quality(grade="poor", samples=calibration.quality.samples if calibration.quality else 0)
    assumed = warning("calibration.assumed_drift", slope=to_dps(float(calibration.bias_per_k[0, 0])))
    return replace(
        fit, calibration=replace(calibration, method=method, quality=quality), remarks=(assumed, *fit.remarks)
    )


ANGLE_SD: Final = float(deg(1.0))  # how exactly a hand ends a turn at a stop, rad: assumed, the session cannot tell
TOLERANCE: Final = 0.2  # largest difference of A from the identity that a working sensor in the right unit has


def fit_ferraris(
    t: Floats,
    acc: Floats,
    gyr: Floats,
    parts: Mapping[str, slice],
    *,
    angle: float = 2.0 * np.pi,
    clipped: NDArray[np.bool_] | None = None,
) -> dict[str, Fitted]:
    """Accelerometer and gyroscope (``acc`` and ``gyr``) from a Ferraris session, uncalibrated.

    `parts` say where `FACES` and `TURNS` lie; `clipped` (N,) marks samples at the end of the range of either triad.
    """
    require_parts(parts)
    force, rate = check.rows("acc", acc, 3, t.size), check.rows("gyr", gyr, 3, t.size)
    refuse(*_unfit(force, rate, parts, clipped))
    session = _Session(t, force, rate, parts)
    accelerometer, placing = _accelerometer(session)
    return {"acc": accelerometer, "gyr": _gyroscope(session, accelerometer.calibration, placing, angle)}


@dataclass(frozen=True, eq=False, slots=True)
class _Session:
    t: Floats
    acc: Floats
    gyr: Floats
    parts: Mapping[str, slice]

    def faces(self, values: Floats) -> tuple[Floats, Floats, Floats]:
        """Mean readings, a column for each axis up and each axis down, and how well one is known (3,)."""
        means = [mean_and_sd(values[self.parts[face]]) for face in FACES]
        mean = np.array([m for m, _ in means])
        sd = np.sqrt(np.mean([s**2 for _, s in means], axis=0))
        return mean[::2].T, mean[1::2].T, np.asarray(sd)


def _unfit(
    acc: Floats, gyr: Floats, parts: Mapping[str, slice], clipped: NDArray[np.bool_] | None
) -> tuple[Reason | None, ...]:
    """Reasons why the parts are not what they should be."""
    for name, part in parts.items():
        if not (np.isfinite(acc[part]).all() and np.isfinite(gyr[part]).all()):
            raise CalibrationError(f"{name} has samples without a number; cut it so that none is missing.")
    short = [name for name, part in parts.items() if part.stop - part.start < 2 * BLOCKS]
    if short:
        text = f"{', '.join(short)} have fewer than {2 * BLOCKS} samples."
        return (Reason("too-few", text, "Hold each position for 5 s."),)
    cut = [name for name, part in parts.items() if clipped is not None and clipped[part].any()]
    at_end = f"Samples of {', '.join(cut)} are at the end of the range."
    rest = np.median([gyr[parts[face]].mean(axis=0) for face in FACES], axis=0)
    moved = [face for face in FACES if _moved(acc[parts[face]], gyr[parts[face]] - rest)]
    text, advice = f"The unit was moved during {', '.join(moved)}.", "Let go of the unit, or cut the parts shorter."
    return (
        Reason("clipping", at_end, "Turn more slowly, or set a larger range.") if cut else None,
        Reason("not-still", text, advice) if moved else None,
    )


def _moved(acc: Floats, gyr: Floats) -> bool:
    """Tell whether a tenth of a face differs from the whole by more than noise does."""
    for values, limit in ((acc, MOVED), (gyr, TURNED)):
        means = np.array([part.mean(axis=0) for part in np.array_split(values, BLOCKS)])
        noise = values.std(axis=0, ddof=1) / np.sqrt(len(values) / BLOCKS)
        if (np.abs(means - (values.mean(axis=0) if values is acc else 0.0)) > limit + 6.0 * noise).any():
            return True
    return False


def _accelerometer(session: _Session) -> tuple[Fitted, float]:
    """Fit of the accelerometer, and the standard deviation of a face's direction, rad."""
    up, down, noise = session.faces(session.acc)
    forward = (up - down) / (2.0 * G0)  # [Ferraris1995]: K R
    both = (up + down) / 2.0
    bias = np.diag(both).copy()  # [Ferraris1995]
    refuse(_implausible(forward))
    matrix = np.asarray(np.linalg.inv(forward), dtype=np.float64)
    across = (both - bias[:, np.newaxis])[~np.eye(3, dtype=bool)]
    placing = float(np.sqrt(2.0 * np.mean(across**2))) / G0  # either position is off by so much
    variance = np.full((3, 3), 0.5 * placing**2) + noise[:, np.newaxis] ** 2 / (2.0 * G0**2)
    np.fill_diagonal(variance, noise**2 / (2.0 * G0**2) + 0.5 * placing**4)  # 1 − cos of the placing
    covariance = np.zeros((12, 12))
    covariance[:3, :3] = np.diag(0.5 * noise**2 + 0.5 * (G0 * placing**2) ** 2)
    covariance[3:, 3:] = resting.inverse_covariance(np.diag(variance.ravel()), matrix)
    measured = np.stack((up.T, down.T), axis=1).reshape(6, 3)
    residuals = np.linalg.norm((measured - bias) @ matrix.T, axis=1) - G0
    tilt = tilt_sd(matrix, covariance, size=G0)
    calibration = TriadCalibration(
        matrix,
        bias,
        UNITS["acc"],
        UNITS["acc"],
        covariance=covariance,
        residual_rms=float(np.sqrt(np.mean(residuals**2))),
        reference=G0,
        method="acc by a Ferraris session, 6 positions",
        quality=Quality(grade=grade_of(tilt, TILT) or "poor", samples=6, tilt_sd=tilt, tilt_range=TILT_RANGE),
    )
    remark = (
        f"The faces were put down to {to_deg(placing):.2g}° (standard deviation); the axes are known to "
        f"{to_deg(placing / np.sqrt(2.0)):.2g}°."
    )
    return Fitted(calibration, measured, residuals, np.ones(6, dtype=bool), (remark,)), placing


def _gyroscope(session: _Session, accelerometer: TriadCalibration, placing: float, angle: float) -> Fitted:
    up, down, noise = session.faces(session.gyr)
    bias = np.concatenate([session.gyr[session.parts[face]] for face in FACES]).mean(axis=0)
    coupling = (up - down) / (2.0 * G0)
    turns = []
    for part in (session.parts[name] for name in TURNS):  # what the gyroscope says of each, rad
        force = (session.acc[part] - accelerometer.bias) @ accelerometer.matrix.T
        turns.append(integral(session.t[part], session.gyr[part] - bias - force @ coupling.T))
    turned = np.stack(turns, axis=1)
    signs = np.sign(np.diag(turned))
    forward = turned * signs / angle  # [Ferraris1995]: K R
    refuse(*_unturned(forward, angle))
    matrix = np.asarray(np.linalg.inv(forward), dtype=np.float64)
    measured = np.stack((up.T, down.T), axis=1).reshape(6, 3)
    tilts = np.repeat(np.eye(3), 2, axis=0) * np.tile([G0, -G0], 3)[:, np.newaxis]
    residuals = measured - bias - tilts @ coupling.T
    face_sd = np.maximum(noise, np.sqrt(np.sum(residuals**2, axis=0) / 2.0))  # 6 faces less 4 parameters for each axis
    bias_sd, coupling_sd = face_sd / np.sqrt(6.0), face_sd / (np.sqrt(2.0) * G0)
    seconds = np.array([_seconds(session, name) for name in TURNS])
    held = float(np.mean([_seconds(session, face) for face in FACES]))
    drift = noise[:, np.newaxis] ** 2 * held * seconds + np.outer(bias_sd**2, seconds**2)  # of an integral
    variance = drift / angle**2 + placing**2
    np.fill_diagonal(variance, np.diag(drift) / angle**2 + (ANGLE_SD / angle) ** 2)
    covariance = np.zeros((12, 12))
    covariance[:3, :3] = np.diag(bias_sd**2)
    covariance[3:, 3:] = resting.inverse_covariance(np.diag(variance.ravel()), matrix)
    scale_sd = float(np.sqrt(np.diag(covariance)[[3, 7, 11]]).max())
    calibration = TriadCalibration(
        matrix,
        bias,
        UNITS["gyr"],
        UNITS["gyr"],
        covariance=covariance,
        g_sensitivity=coupling,
        g_sensitivity_sd=np.repeat(coupling_sd[:, np.newaxis], 3, axis=1),
        residual_rms=float(np.sqrt(np.mean(residuals**2))),
        method=f"gyr by a Ferraris session, 3 turns of {to_deg(angle):g}°",
        quality=Quality(grade=grade_of(scale_sd, SCALE) or "poor", samples=9, scale_sd=scale_sd),
    )
    remarks = (
        info(
            "calibration.turn_assumed",
            angle_deg=to_deg(angle),
            angle_sd_deg=to_deg(ANGLE_SD),
            percent=100.0 * ANGLE_SD / angle,
        ),
        info("calibration.bias_repeats", spread_dps=to_dps(float(face_sd.max()))),
    )
    return Fitted(calibration, measured, residuals, np.ones(6, dtype=bool), remarks)


def _seconds(session: _Session, name: str) -> float:
    t = session.t[session.parts[name]]
    return float(t[-1] - t[0])


def _implausible(forward: Floats) -> Reason | None:
    """Reason why A of the accelerometer is none."""
    scale = np.diag(forward)
    if np.abs(forward - np.eye(3)).max() <= TOLERANCE:
        return None
    if np.abs(scale / scale.mean() - 1.0).max() < TOLERANCE and scale.mean() > 0.0:
        text = f"Gravity measures {scale.mean():.3g} times what it is."
        return Reason("wrong-gravity", text, "Check the accelerometer's unit in the profile.")
    text = f"The faces give the matrix {np.round(forward, 2).tolist()}, far from that of an accelerometer."
    return Reason("implausible", text, "Check that each part bears the name of the axis that pointed up or down.")


def _unturned(forward: Floats, angle: float) -> list[Reason]:
    """Reasons why A of the gyroscope is none."""
    reasons = []
    for k, name in enumerate(TURNS):
        if abs(forward[k, k] - 1.0) > TOLERANCE:
            text = f"{name} turned by {to_deg(angle * float(forward[k, k])):.0f}° instead of {to_deg(angle):.0f}°."
            reasons.append(Reason("no-motion", text, "Say how far it was turned, and check the gyroscope's unit."))
    if not reasons and np.abs(forward - np.diag(np.diag(forward))).max() > TOLERANCE:
        text = f"The turns give the matrix {np.round(forward, 2).tolist()}: they were not about the axes."
        reasons.append(Reason("implausible", text, "Turn about each axis while it stands on end."))
    return reasons
