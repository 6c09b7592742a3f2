"""The attitude that a filter starts from: given, or the best that its first samples agree on.

Attitude from one look at gravity and the magnetic field: how filters start, and what tilt and compass say.

Tilt comes from the accelerometer alone and the heading from the field in the level plane, so that a magnetic
disturbance never tips the horizon.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.kernels import kernel
from plumbob.core.units import Quantity, parse
from plumbob.filters.input_checks import usable
from plumbob.filters.layout import HEADED, LEVEL, NORTH_X, NORTH_Y, STAGE, UP, Q
from plumbob.rotations import Frame, North, quat_from_euler_zyx, quat_normalize
from plumbob.rotations.kernels import Quat, Vec, quat_mul, quat_unit, rotate, third_row


@kernel
def up_in_body(up: float, q0: float, q1: float, q2: float, q3: float) -> Vec:
    """Unit vector away from the Earth in body axes, where an accelerometer at rest points."""
    zx, zy, zz = third_row(q0, q1, q2, q3)
    return up * zx, up * zy, up * zz


@kernel
def level(up: float, ax: float, ay: float, az: float) -> Quat:
    """Attitude of yaw zero whose up direction is that of the specific force a."""
    zx, zy, zz = up * ax, up * ay, up * az
    half_pitch = 0.5 * math.atan2(-zx, math.sqrt(zy * zy + zz * zz))  # [Li2012] (8)
    half_roll = 0.5 * math.atan2(zy, zz)  # [Li2012] (7)
    cp, sp, cr, sr = math.cos(half_pitch), math.sin(half_pitch), math.cos(half_roll), math.sin(half_roll)
    return cp * cr, cp * sr, sp * cr, -sp * sr


@kernel
def has_heading(hx: float, hy: float, hz: float) -> bool:
    """False for a field that stands (nearly) vertical, within 0.1 % of its size."""
    level2 = hx * hx + hy * hy
    return level2 > 1e-6 * (level2 + hz * hz)


@kernel
def angle_to(hx: float, hy: float, nx: float, ny: float) -> float:
    """Angle about z, rad, that brings the level vector h to the direction n."""
    return math.atan2(hx * ny - hy * nx, hx * nx + hy * ny)


@kernel
def upright(up: float, ex: float, ey: float, ez: float) -> Quat:
    """Shortest turn that brings the unit vector e up, which is +z or −z as `up` says."""
    if up * ez >= 0.0:
        w = math.sqrt(0.5 * (up * ez + 1.0))
        half = 0.5 * up / w
        return w, half * ey, -half * ex, 0.0
    across = math.hypot(ex, ey)
    if across == 0.0:  # upside down: every half turn is the shortest, and this one is about x
        return 0.0, 1.0, 0.0, 0.0
    v = math.sqrt(0.5 * (1.0 - up * ez))
    s = up * v / across
    return 0.5 * across / v, s * ey, -s * ex, 0.0


@kernel
def heading_offset(
    c: Floats, q0: float, q1: float, q2: float, q3: float, mx: float, my: float, mz: float
) -> tuple[bool, float]:
    """Angle about the navigation z axis, rad, that brings the level part of the field m to north.

    Returns false and 0 where the field has no heading.
    """
    hx, hy, hz = rotate(q0, q1, q2, q3, mx, my, mz)
    if not has_heading(hx, hy, hz):
        return False, 0.0
    return True, angle_to(hx, hy, c[NORTH_X], c[NORTH_Y])


@kernel
def turn_about_vertical(angle: float, q0: float, q1: float, q2: float, q3: float) -> Quat:
    """Attitude q turned by an angle, rad, about the navigation z axis."""
    return quat_mul(math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle), q0, q1, q2, q3)


@kernel
def initialise(c: Floats, x: Floats, ax: float, ay: float, az: float, mx: float, my: float, mz: float) -> int:
    """Take up tilt, then heading, as soon as a sample shows them; returns what is still missing as flags."""
    if x[STAGE] < LEVEL:
        if not usable(ax, ay, az):
            return flags.NOT_CONVERGED | flags.HEADING_FREE
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = level(c[UP], ax, ay, az)
        x[STAGE] = LEVEL
    if not usable(mx, my, mz):
        return flags.HEADING_FREE
    headed, angle = heading_offset(c, x[Q], x[Q + 1], x[Q + 2], x[Q + 3], mx, my, mz)
    if not headed:
        return flags.HEADING_FREE
    q0, q1, q2, q3 = turn_about_vertical(angle, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = quat_unit(q0, q1, q2, q3)
    x[STAGE] = HEADED
    return 0


LEVEL_WORD: Final = "level"  # roll and pitch zero; the heading is free until a magnetometer sets it
TRUTH_WORD: Final = "truth"
"""The first attitude of the recording's reference, which `plumbob.filters.offline.start_from` looks up."""


class Start(NamedTuple):
    """An attitude to start from."""

    q_nb: Floats  # (4,), body to navigation, wxyz
    # what its heading counts from; FREE: it says the tilt alone; None: what the filter's headings count from
    north: North | None = None


def as_start(init: "Start | ArrayLike | str", frame: Frame) -> Start:
    """Start of a quaternion q_nb (4,), of ``"level"``, or of ``"ROLL,PITCH,HEADING"`` with units.

    Raises ParameterError, UnitError, ShapeError if it is none of these.
    """
    if isinstance(init, Start):
        return init._replace(q_nb=_attitude(init.q_nb))
    if not isinstance(init, str):
        return Start(_attitude(init))
    if init == LEVEL_WORD:
        return Start(quat_from_euler_zyx([0.0, 0.0, 0.0]), North.FREE)
    if init == TRUTH_WORD:
        raise ParameterError(
            "init='truth' needs the recording's reference; plumbob.filters.offline.start_from(reference, imu, ...) "
            "gives it."
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
