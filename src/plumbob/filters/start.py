"""The attitude that a filter is started from, where its first samples are not to give it."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob import check
from plumbob.check import Floats
from plumbob.errors import ParameterError, ShapeError
from plumbob.rotations import Frame, North, quat_from_euler_zyx, quat_normalize
from plumbob.units import Quantity, parse

LEVEL_WORD: Final = "level"
"""Roll and pitch zero; the heading is free until a magnetometer sets it."""
TRUTH_WORD: Final = "truth"
"""The first attitude of the recording's reference, which `plumbob.pipeline.start_from` looks up."""


class Start(NamedTuple):
    """An attitude to start from.

    Attributes
    ----------
    q_nb : ndarray (4,)
        Body to navigation, wxyz.
    north : North or None
        What its heading counts from; FREE: it says the tilt alone; None: what the filter's headings count from.
    """

    q_nb: Floats
    north: North | None = None


def start_of(init: "Start | ArrayLike | str", frame: Frame) -> Start:
    """Start of a quaternion q_nb (4,), of ``"level"``, or of ``"ROLL,PITCH,HEADING"`` with units.

    Raises
    ------
    ParameterError, UnitError, ShapeError
        If it is none of these.
    """
    if isinstance(init, Start):
        return init._replace(q_nb=_attitude(init.q_nb))
    if not isinstance(init, str):
        return Start(_attitude(init))
    if init == LEVEL_WORD:
        return Start(quat_from_euler_zyx([0.0, 0.0, 0.0]), North.FREE)
    if init == TRUTH_WORD:
        raise ParameterError(
            "init='truth' needs the recording's reference: plumbob.pipeline.start_from(reference, imu, ...) gives it."
        )
    return Start(_of_angles(init, frame))


def _of_angles(text: str, frame: Frame) -> Floats:
    """Attitude of roll and pitch about the body's axes and the heading of its x axis, clockwise from north."""
    parts = text.split(",")
    if len(parts) != 3:
        raise ParameterError(
            f"init must be level, truth or ROLL,PITCH,HEADING with units, as 10deg,0deg,90deg, but got '{text}'."
        )
    roll, pitch, heading = (parse(part, Quantity.ANGLE) for part in parts)
    forward = np.cos(heading) * frame.north + np.sin(heading) * frame.east
    return quat_from_euler_zyx([np.arctan2(forward[1], forward[0]), pitch, roll])


def _attitude(init: ArrayLike) -> Floats:
    q = check.last_axis("init", init, 4)
    if q.shape != (4,) or not np.isfinite(q).all():
        raise ShapeError(f"init must be one finite quaternion of shape (4,), but its shape is {q.shape}.")
    return quat_normalize(q)
