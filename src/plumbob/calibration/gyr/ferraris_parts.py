"""The parts of a Ferraris session, six faces and three turns, and of the trackball paper's preset."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.fit import Fitted
from plumbob.calibration.gyr.drift import chen2013
from plumbob.calibration.gyr.plausible import UNCALIBRATED, beyond_bias, new_bias_covariance, unseen_turn
from plumbob.calibration.gyr.rest import bias_of, rest
from plumbob.calibration.rejection import Reason, refuse
from plumbob.calibration.static_periods import stills
from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError
from plumbob.core.units import deg, to_dps
from plumbob.data.cards import UNITS, Quality, TriadCalibration

FACES: Final = ("x_p", "x_a", "y_p", "y_a", "z_p", "z_a")
"""Positions at rest, by the axis that measures +g (p, parallel) or −g (a, antiparallel)."""

TURNS: Final = ("x_rot", "y_rot", "z_rot")
"""Turns about an axis."""

STEEP: Final = float(np.cos(deg(25.0)))
"""Share of gravity along an axis from which on that axis stands on end."""

LEAST_TURN: Final = float(deg(90.0))
"""Smallest turn that is looked for, rad."""


def require_parts(parts: Mapping[str, slice]) -> None:
    """Refuse parts of which some are missing or unknown.

    Raises
    ------
    CalibrationError
        If the names are not those of `FACES` and `TURNS`.
    """
    known = {*FACES, *TURNS}
    missing, unknown = sorted(known - set(parts)), sorted(set(parts) - known)
    if missing or unknown:
        raise CalibrationError(
            f"a Ferraris session has the parts {', '.join((*FACES, *TURNS))}; missing are "
            f"{', '.join(missing) or 'none'}, unknown {', '.join(unknown) or 'none'}."
        )


def parts_of_labels(labels: Sequence[str]) -> dict[str, slice]:
    """Parts of samples that each bear the name of their part, or none.

    Raises
    ------
    CalibrationError
        If a part lies in two places.
    """
    found: dict[str, slice] = {}
    start = 0
    for name, run in groupby(labels):
        stop = start + len(list(run))
        if name in found:
            raise CalibrationError(f"{name} lies in two places, from sample {found[name].start} and from {start}.")
        if name:
            found[name] = slice(start, stop)
        start = stop
    return found


def parts_of_times(t: Floats, spans: Mapping[str, tuple[float, float]]) -> dict[str, slice]:
    """Parts of spans of time, s."""
    return {name: slice(*t.searchsorted(span).tolist()) for name, span in spans.items()}


def find_parts(t: Floats, acc: Floats, gyr: Floats) -> dict[str, slice]:
    """Find the parts in a session that was recorded in one go.

    A face is the longest stretch at rest with an axis on end. A turn is what lies between two stretches at rest and
    turned the unit by more than a quarter about an axis that stood on end before and after, and least about others.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    acc, gyr : ndarray (N, 3)
        Specific force, m/s², and rates, rad/s, uncalibrated.

    Raises
    ------
    CaptureRefusedError
        not-still where faces, no-motion where turns are missing.
    """
    where = stills(t, acc, gyr)
    faces = [_face(acc[one].mean(axis=0)) for one in where]
    found: dict[str, slice] = {}
    for face, one in zip(faces, where, strict=True):
        if face and (face not in found or _length(one) > _length(found[face])):
            found[face] = one
    bias = np.median([gyr[one].mean(axis=0) for one in where], axis=0) if where else np.zeros(3)
    sizes: dict[str, float] = {}
    for k in range(len(where) - 1):
        span = slice(where[k].stop, where[k + 1].start)
        angle = integral(t[span], gyr[span] - bias)
        axis = int(np.abs(angle).argmax())
        same = bool(faces[k]) and faces[k] == faces[k + 1] == _face(np.sign(acc[where[k]].mean(axis=0)) * _AXES[axis])
        if same and abs(angle[axis]) > max(LEAST_TURN, sizes.get(TURNS[axis], 0.0)):
            found[TURNS[axis]], sizes[TURNS[axis]] = span, float(abs(angle[axis]))
    refuse(_missing(found))
    return found


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


def _length(one: slice) -> int:
    return int(one.stop - one.start)


def _missing(found: Mapping[str, slice]) -> list[Reason]:
    faces = [name for name in FACES if name not in found]
    turns = [name for name in TURNS if name not in found]
    reasons = []
    if faces:
        text = f"The unit never lay still on {', '.join(faces)}."
        advice = "Let each axis point up (p) and down (a) for 5 s, or say where the parts lie."
        reasons.append(Reason("not-still", text, advice))
    if turns:
        text = f"There is no turn {', '.join(turns)} between two rests on the same face."
        advice = "Turn the unit once around about each axis while that stands on end, with a rest before and after."
        reasons.append(Reason("no-motion", text, advice))
    return reasons


def fit_trackball(
    t: Floats,
    gyr: Floats,
    *,
    acc: Floats | None,
    temp_c: Floats | None,
    mag: Floats | None = None,
    clipped: NDArray[np.bool_] | None = None,
) -> Fitted:
    """Bias at rest with the paper's coefficients of temperature and specific force.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s.
    gyr : ndarray (N, 3)
        Measured rates, rad/s.
    acc : ndarray (N, 3) or None
        Specific force, m/s²; needed. A card's g-sensitivity acts on the calibrated one.
    temp_c : ndarray (N,) or None
        Temperature, °C; needed.
    mag : ndarray (N, 3), optional
        Flux density, calibrated or not, which distinguishes constant turning from rest.
    clipped : ndarray (N,) of bool, optional
        Samples at the end of the gyroscope's range.

    Raises
    ------
    CaptureRefusedError
        not-still, clipping, implausible.
    CalibrationError
        If acc or temp_c is missing.
    """
    where, turned = rest(t, gyr, acc, clipped, mag)
    still = np.concatenate([np.arange(one.start, one.stop) for one in where])
    drift = chen2013().at_rest(
        gyr[still], None if temp_c is None else temp_c[still], None if acc is None else acc[still]
    )
    refuse(beyond_bias(drift.bias))
    _, spread, means = bias_of([drift.compensate(gyr[one], temp_c[one], acc[one]) for one in where])  # type: ignore[index]
    calibration = TriadCalibration(
        np.diag(1.0 / (1.0 + drift.scale)),
        drift.bias,
        UNITS["gyr"],
        UNITS["gyr"],
        bias_per_k=drift.bias_per_k,
        temp_ref_c=drift.temp_ref_c,
        g_sensitivity=drift.g_sensitivity,
        covariance=new_bias_covariance(UNCALIBRATED, np.diag(spread**2)),
        residual_rms=float(np.sqrt(np.mean(means**2))),
        method="gyr by the trackball paper's preset, bias at rest",
        quality=Quality(grade="poor", samples=still.size),
    )
    slope = to_dps(float(drift.bias_per_k[0]))
    told = (
        f"ASSUMED, NOT MEASURED: {slope:g} °/s per °C and 0.1 °/s per g are the paper's figures for every part. This "
        "unit's may have another size or sign, and then the card makes it worse than none away from "
        "the temperature of the capture. 'plumbob calibrate temperature' measures them. Its grade is poor for that.",
        *turned,
        *unseen_turn(acc, mag, where),
    )
    return Fitted(calibration, means, means, np.ones(len(where), dtype=bool), told)
