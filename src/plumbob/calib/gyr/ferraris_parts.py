"""Where the nine parts of a Ferraris session lie: six faces at rest and three turns."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Final

import numpy as np

from plumbob.calib.refusal import Reason, refuse
from plumbob.calib.still import stills
from plumbob.check import Floats
from plumbob.errors import CalibrationError
from plumbob.units import deg

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
