"""The buoy paper's equations as they are printed, beside their corrected form, by a switch [Yu2018].

Each misprint is computed here and nowhere else: the filters and calibrations of Plumbob have the corrected forms.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, to_deg
from plumbob.data import ImuData
from plumbob.filters import Filter
from plumbob.papers.buoy.modules import DIP, by_paper, field_n, force_b, largest, table_poses
from plumbob.papers.outcome import PrintedForm
from plumbob.rotations import (
    Frame,
    quat_angle,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
    quat_rotate,
)

TS: Final = 0.01
"""Time of a step, s."""
KP: Final = 0.5
KI: Final = 0.03
_DOWN: Final = np.array([0.0, 0.0, 1.0])


def rows(rate: Floats, *, literal: bool) -> Floats:
    """Matrix (4, 4) that q is multiplied with in equation (3), of a rate (3,), rad/s."""
    x, y, z = rate.tolist()
    first = [0.0, -x, -y, -z]
    if literal:  # [Yu2018] (3)
        return np.array([first, [0.0, x, -y, z], [0.0, x, y, -z], [0.0, -x, y, z]])
    # departs from [Yu2018] (3): q1, q2, q3 stand in rows 2 to 4 where the product of quaternions has others
    return np.array([first, [x, 0.0, z, -y], [y, -z, 0.0, x], [z, y, -x, 0.0]])


def propagate(rate: Floats, steps: int, *, literal: bool = False) -> Floats:
    """Quaternion (4,) after so many first-order steps from the identity at a constant rate, not normalised."""
    return np.asarray(np.linalg.matrix_power(np.eye(4) + 0.5 * TS * rows(rate, literal=literal), steps)[:, 0])


def lag_dps(rate: float) -> float:
    """How much slower the normalised first-order step turns than a constant rate, deg/s; both about one axis."""
    seconds = 1.0
    q = quat_normalize(propagate(np.array([0.0, 0.0, dps(rate)]), round(seconds / TS)))
    true = quat_from_rotvec(np.array([0.0, 0.0, dps(rate) * seconds]))
    return float(to_deg(quat_angle(true, q))) / seconds


def angles(q: Floats, *, literal: bool) -> tuple[float, float, float]:
    """Roll, pitch and yaw of equations (4) to (6), rad; literal: by arctan, which loses the quadrant."""
    q0, q1, q2, q3 = q.tolist()
    roll = (2.0 * (q2 * q3 + q0 * q1), q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3)
    yaw = (2.0 * (q1 * q2 + q0 * q3), q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3)
    pitch = -math.asin(2.0 * (q1 * q3 - q0 * q2))  # [Yu2018] (5)
    if literal:
        return math.atan(roll[0] / roll[1]), pitch, math.atan(yaw[0] / yaw[1])  # [Yu2018] (4), (6)
    return math.atan2(*roll), pitch, math.atan2(*yaw)  # departs from [Yu2018] (4), (6): all quadrants


def zxy(roll: float, pitch: float, yaw: float) -> Floats:
    """Attitude (4,) of the order that the paper's text names: yaw, then pitch about x, then roll about y."""
    about = np.eye(3)
    q = quat_multiply(quat_from_rotvec(yaw * about[2]), quat_from_rotvec(pitch * about[0]))
    return quat_multiply(q, quat_from_rotvec(roll * about[1]))


def passes(gate: float) -> tuple[float, float]:
    """Largest level acceleration that a gate, m/s², lets pass, g; and the inclination that it looks like, rad."""
    across = math.sqrt((1.0 + gate / G0) ** 2 - 1.0)
    return across, math.atan(across)


def normalised_yaw(*, literal: bool) -> float:
    """Largest error of yaw on the tilted table by equation (14), deg; literal: its first row is not divided by R.

    The readings are ideal but for the hard iron that the paper's Fig 5 removes, so all that is left is the equation.
    """
    captured = quat_from_euler_zyx(np.random.default_rng(0).uniform(-math.pi, math.pi, (18, 3)))
    iron = np.array([5.0, -3.0, 4.0])
    truth = table_poses()
    field = [quat_rotate(quat_conjugate(q), field_n(DIP)) for q in (captured, truth)]
    cards = by_paper(force_b(captured), field[0] + iron)
    assert cards is not None
    matrix = cards[1].matrix / np.linalg.norm(field_n(DIP))
    if literal:
        matrix = matrix.copy()
        matrix[0] /= matrix[0, 0]  # [Yu2018] (14): x − x0, in the unit of the reading
    return float(to_deg(largest(force_b(truth), (field[1] + iron - cards[1].bias) @ matrix.T, truth)[0]))


def corrected_to(start: float, *, literal: bool, seconds: float = 30.0) -> float:
    """Inclination error that the PI law leaves at rest of one of `start`, deg, without a gyroscope's error.

    Literal: the moduli of the two vector products are added, and the sum corrects every axis, for a modulus has no
    direction.
    """
    q, integral = quat_from_euler_zyx(np.array([0.0, 0.0, deg(start)])), np.zeros(3)
    up, field = -_DOWN, field_n(DIP) / np.linalg.norm(field_n(DIP))
    north = np.array([math.hypot(field[0], field[1]), 0.0, field[2]])
    for _ in range(round(seconds / TS)):
        back = quat_conjugate(q)
        force, iron = np.cross(up, quat_rotate(back, up)), np.cross(field, quat_rotate(back, north))
        e = np.full(3, np.linalg.norm(force) + np.linalg.norm(iron)) if literal else force + iron
        integral += KI * TS * e  # [Yu2018] (7)
        q = quat_normalize((np.eye(4) + 0.5 * TS * rows(KP * e + integral, literal=False)) @ q)
    return float(to_deg(math.acos(np.clip(quat_rotate(q, up) @ up, -1.0, 1.0))))


class Loop(NamedTuple):
    """The PI law as a loop of second order: poles, rad/s, and largest attitude error by the gyroscope's bias, s."""

    poles: tuple[float, float]
    damping: float
    peak: float


def loop(kp: float = KP, ki: float = KI) -> Loop:
    """Poles of s² + Kp s + Ki, and the peak of b (exp(p1 t) − exp(p2 t))/(p1 − p2)."""
    root = math.sqrt(kp * kp - 4.0 * ki)
    slow, fast = -0.5 * (kp - root), -0.5 * (kp + root)
    at = math.log(fast / slow) / (slow - fast)
    peak = (math.exp(slow * at) - math.exp(fast * at)) / (slow - fast)
    return Loop((fast, slow), 0.5 * kp / math.sqrt(ki), peak)


def zero_rate_error(bias: float, *, mag: bool = False) -> float:
    """Largest inclination error at rest, deg, by the filter itself with a gyroscope's bias about x, deg/s."""
    t = TS * np.arange(6000.0)
    still = np.zeros((t.size, 3))
    imu = ImuData(t=t, gyr=still + [dps(bias), 0.0, 0.0], acc=still - G0 * _DOWN, mag=still + field_n(DIP))
    q = Filter("mahony", frame=Frame.NED, params={"mag": mag}).process(imu).q_nb
    return float(to_deg(np.arccos(np.clip(quat_rotate(q, _DOWN)[:, 2], -1.0, 1.0)).max()))


def static_share(gate: float, bias: float = 0.02) -> float:
    """Share of samples at rest that a gate, m/s², lets pass, with a bias along the vertical, g, and noise of 4 mg."""
    noise = 0.004 * np.random.default_rng(0).standard_normal(10_000)
    return float(np.mean(np.abs(bias + noise) * G0 < gate))


RATES: Final = (172.0, 573.0, 2000.0)
"""At which the step's lag is measured, deg/s."""
GATES: Final = (0.08 * G0, 0.08)
"""The two readings of ε, m/s²."""


def misprints(wide_yaw: float, yaw: float) -> dict[str, tuple[float, ...]]:
    """What each printed form gives, and then the corrected one, by the figure's key: °, rad, g and %, as its row says.

    ``order`` has roll, pitch and yaw by the text's order and by Z-Y-X, ``gate.*`` the level acceleration that passes
    and its inclination; `wide_yaw`, `yaw`: median of the largest yaw error with the magnetometer's wide and its narrow
    step, deg.
    """
    still, about_z = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, dps(30.0)])
    turns = (quat_angle(still, quat_normalize(propagate(about_z, 500, literal=way))) for way in (True, False))
    west, euler = quat_from_euler_zyx([2.0, 0.0, 0.0]), (0.4, -0.3, 1.1)
    poles, passed = loop().poles, {unit: passes(gate) for unit, gate in zip(("g", "si"), GATES, strict=True)}
    return {
        "rows": PrintedForm(*(float(to_deg(turn)) for turn in turns)),
        "norm": PrintedForm(float(np.linalg.norm(propagate(np.array([0.62, 0.0, 0.0]), 60_000))), 1.0),
        **{f"lag.{rate:g}": PrintedForm(lag_dps(rate), 0.0) for rate in RATES},
        "arctan": PrintedForm(*(angles(west, literal=way)[2] for way in (True, False))),
        "order": angles(zxy(*euler), literal=False) + angles(quat_from_euler_zyx(euler[::-1]), literal=False),
        "normalised": PrintedForm(*(normalised_yaw(literal=way) for way in (True, False))),
        "modulus": PrintedForm(*(corrected_to(10.0, literal=way) for way in (True, False))),
        **{f"gate.{unit}": (across, float(to_deg(tilt))) for unit, (across, tilt) in passed.items()},
        "gate.rest": PrintedForm(*(100.0 * static_share(gate) for gate in GATES[::-1])),
        "step": (wide_yaw - yaw, wide_yaw, yaw),
        "pole.fast": poles[:1],
        "pole.slow": poles[1:],
        "zero_rate": (zero_rate_error(5.0),),
    }
