"""The teaching-arm paper's scheme whole [HuangJiang]: six units in ± sets, two regulators, and a Kalman filter behind.

Units 1 to 3 sit on +x, +y, +z and 4 to 6 on −x, −y, −z. The paper takes one axis of each unit as it points outwards, so
that the signals of a pair are y⁺ = s + b⁺ + n⁺ and y⁻ = −s + b⁻ + n⁻; then s = (y⁺ − y⁻)/2 is the body's value and
p = (y⁺ + y⁻)/2 the parity, in which the signal cancels. Set 1 is made of units 1 to 3 and set 2 of units 4 to 6.

What is chosen here: each unit of this project is a whole nine-axis one, and no turn reverses all three axes of a unit.
So x is read from units 1 and 4, y from 2 and 5, z from 3 and 6, each along its own axis: that is the paper's wiring,
and it takes the three axes of a set from three units. In the rig `arm` the opposite units are reversed by half turns,
about z, x and y, which reverse just those axes: y⁻ is what the unit's own axis says, and needs no sign of ours.

Each sample: both rates predict the attitude; the errors of set 1 and set 2 are formed there; fuzzy rules correct the
rate of set 1, the PI law that of set 2; the mean of both rates, set 2 with its sign changed, turns the attitude. The
Kalman filter behind takes that rate, and the directions of set 1. Departures are those of `plumbob.filters.fuzzy_pi`
and `plumbob.filters.ekf_quaternion`: the error belongs to the predicted attitude, the specific force points up in any
level frame, and q is normalised. Without the Kalman filter the regulators hold the attitude alone; with it they see the
attitude that it predicts. Where a unit lacks a value, its opposite one stands for both; where both do, the rate stays
as it was, and the direction is left out.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from plumbob.arm.array.channels import axis_values
from plumbob.arm.array.monitoring import common_flags
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.kernels import kernel
from plumbob.core.units import deg, dps, to_deg
from plumbob.data import TRIAD_FLAGS, TRIADS, AttitudeTrack
from plumbob.data.array import ImuArray
from plumbob.filters.base import CommonParams
from plumbob.filters.ekf_quaternion import P, correct_direction, predict
from plumbob.filters.fuzzy_pi import Params as Rules
from plumbob.filters.fuzzy_pi import coefficients, regulate, wind
from plumbob.filters.input_checks import usable
from plumbob.filters.layout import OWN, Q
from plumbob.filters.start import angle_to, level, turn_about_vertical
from plumbob.protocols.encode import hold_last
from plumbob.rotations import Frame, North
from plumbob.rotations.kernels import Quat, Vec, cross, quat_exp, quat_mul, quat_unit, rotate

NONE, PI, FUZZY = 0, 1, 2
LAWS: Final = {"none": NONE, "pi": PI, "fuzzy": FUZZY}
_DEG: Final = float(to_deg(1.0))
RULE_UNITS: Final = {"deg": (_DEG, 1.0 / _DEG), "deg as rad/s": (_DEG, 1.0), "rad as deg/s": (1.0, 1.0 / _DEG)}
"""What the rules get for a radian, and what 1 that they give is in rad/s."""


class Scheme(NamedTuple):
    """Switches of the paper's scheme, with its own settings.

    `set1`, `set2`: law of each set, "none", "pi" or "fuzzy"; `sets`: 1 takes set 1 alone, 2 the mean of both; `ekf`:
    the Kalman filter behind; `kp`, `ki`: gains of the PI law, 1/s and 1/s²; `slope`, `far`: of the rules, as in
    `plumbob.filters.fuzzy_pi`, rad/s; `sum_table`: the table that adds up the numbers of its sets, instead of these;
    `dip`: of the field, rad below the horizontal: the paper takes it as known; `rule_units`: what the rules get and
    give: "deg", degrees and °/s, is right; "deg as rad/s", where degrees are given and what comes out is taken for
    rad/s, and "rad as deg/s", where rules of degrees are given radians, are mistakes that the paper leaves open.

    Mistakes too: `late`: the error is that of the attitude of the sample before; `raw_mean`: the rate is the mean of
    both sets as they are read, as the paper's words have it, although one is reversed; `force_down`: the specific force
    is taken for gravity, as the paper's frame has it.
    """

    set1: str = "fuzzy"
    set2: str = "pi"
    sets: int = 2
    ekf: bool = True
    kp: float = 0.8
    ki: float = 0.02
    slope: float = 0.3
    far: float = dps(3.0)
    sum_table: bool = False
    dip: float = deg(50.0)
    rule_units: str = "deg"
    late: bool = False
    raw_mean: bool = False
    force_down: bool = False


class Sets(NamedTuple):
    """Signals of both sets in body axes, y⁺ and −y⁻, and the parity of pairs, (y⁺ + y⁻) / 2, (N, 3) by triad."""

    plus: dict[str, Floats]
    minus: dict[str, Floats]
    parity: dict[str, Floats]


def sets_of(array: ImuArray) -> Sets:
    """Signals of the ± sets of six units, in the order +x, +y, +z, −x, −y, −z, each axis pointing as its place says."""
    names = array.names
    if len(names) != 6:
        raise ShapeError(f"the paper's array has six units, but this one has {len(names)}.")
    plus, minus, parity = {}, {}, {}
    for k, name in enumerate(names):
        axis, place = k % 3, f"{'+-'[k > 2]}{'xyz'[k % 3]}"
        if not (1.0 - 2.0 * (k > 2)) * array.mounts[name].dcm[axis, axis] > 0.999:
            raise ShapeError(f"axis {place[1]} of unit '{name}' must point along {place} of the body; turn its mount.")
    for triad in TRIADS:
        rows = [axis_values(array.units[name], triad)[:, k % 3] for k, name in enumerate(names)]
        high, low = np.stack(rows[:3], axis=1), np.stack(rows[3:], axis=1)
        plus[triad], minus[triad], parity[triad] = high, -low, 0.5 * (high + low)
    return Sets(plus, minus, parity)


@kernel
def turn_to(
    q0: float, q1: float, q2: float, q3: float, dx: float, dy: float, dz: float, vx: float, vy: float, vz: float
) -> Vec:
    """Turn, rad, that would bring the predicted direction d onto a vector as measured; none where that is missing."""
    if not usable(vx, vy, vz):
        return 0.0, 0.0, 0.0
    s = 1.0 / math.sqrt(vx * vx + vy * vy + vz * vz)
    ux, uy, uz = rotate(q0, -q1, -q2, -q3, dx, dy, dz)
    return cross(s * vx, s * vy, s * vz, ux, uy, uz)


@kernel
def error_of(
    up: float, q0: float, q1: float, q2: float, q3: float, field: Floats, acc: Floats, mag: Floats, i: int
) -> Vec:
    """Error of a prediction by the force and the field of sample i, rad: â × Rᵀâₙ + m̂ × Rᵀm̂ₙ."""
    e0, e1, e2 = turn_to(q0, q1, q2, q3, 0.0, 0.0, up, acc[i, 0], acc[i, 1], acc[i, 2])  # [HuangJiang]
    d0, d1, d2 = turn_to(q0, q1, q2, q3, field[0], field[1], field[2], mag[i, 0], mag[i, 1], mag[i, 2])
    return e0 + d0, e1 + d1, e2 + d2


@kernel
def begin(
    x: Floats, up: float, north_x: float, north_y: float,
    ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> Quat:  # fmt: skip
    """First attitude: the one that `x` was given, else that of a force and a field; NaN where one is missing."""
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    if q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3 > 0.5:
        return q0, q1, q2, q3
    if not (usable(ax, ay, az) and usable(mx, my, mz)):
        return math.nan, math.nan, math.nan, math.nan
    s = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    q0, q1, q2, q3 = level(up, s * ax, s * ay, s * az)
    m0, m1, _ = rotate(q0, q1, q2, q3, mx, my, mz)
    return turn_about_vertical(angle_to(m0, m1, north_x, north_y), q0, q1, q2, q3)


@kernel
def look_at(
    x: Floats, q0: float, q1: float, q2: float, q3: float, dx: float, dy: float, dz: float,
    vx: float, vy: float, vz: float, var: float,
) -> None:  # fmt: skip
    """Take up a vector, which is known to point along d, unless it is missing."""
    if usable(vx, vy, vz):
        s = 1.0 / math.sqrt(vx * vx + vy * vy + vz * vz)
        correct_direction(x, q0, q1, q2, q3, dx, dy, dz, s * vx, s * vy, s * vz, var)


@kernel
def law(kind: int, e: float, dt: float, rules: Floats, integral: Floats, k: int) -> float:
    """Correction of a rate, rad/s, from the error e, rad."""
    if kind == 1:
        integral[k] += dt * e
        u: float = rules[2] * e + rules[3] * integral[k]
        return u
    if kind == 2:
        error = rules[7] * e
        integral[k] = wind(integral[k], error, dt)
        v: float = rules[8] * regulate(error, integral[k], rules[4], rules[5], rules[6])
        return v
    return 0.0


@kernel
def i_term(kind: int, rules: Floats, integral: Floats, k: int) -> float:
    """What of the correction stays without an error, rad/s."""
    if kind == 1:
        u: float = rules[3] * integral[k]
        return u
    if kind == 2:
        v: float = rules[8] * rules[6] * integral[k]
        return v
    return 0.0


@kernel
def blended(
    first: int, second: int, weight: float, a: float, c: float, dt: float, rules: Floats, sums: Floats, k: int
) -> float:
    """Correction about an axis by both sets."""
    by_first = law(first, a, dt, rules, sums[0], k)
    by_second = law(second, c, dt, rules, sums[1], k)
    return (1.0 - weight) * by_first + weight * by_second


@kernel
def run(
    t: Floats, gyr1: Floats, acc1: Floats, mag1: Floats, gyr2: Floats, acc2: Floats, mag2: Floats,
    kinds: Floats, rules: Floats, up: float, field: Floats, ekf: bool, noise: Floats, x: Floats, sums: Floats,
    q_nb: Floats, n_before: int,
) -> None:  # fmt: skip
    """Attitude (N, 4) of both sets, behind as many as are there already (`n_before`); `x` holds q and P.

    A second set with a weight kinds[2] of zero is left out, also of the start; with kinds[3] the error is late. No
    rate is NaN; attitudes are, until forces and fields of all axes have come together.
    """
    size = math.sqrt(field[0] * field[0] + field[1] * field[1])
    first, second, weight, both = int(kinds[0]), int(kinds[1]), kinds[2], 1.0 if kinds[2] > 0.0 else 0.0
    for i in range(n_before, t.shape[0]):
        dt = t[i] - t[i - 1] if i > 0 else 0.0
        w0, w1, w2 = 0.0, 0.0, 0.0
        if i > 0:
            for k in range(3):
                steady = (1.0 - weight) * i_term(first, rules, sums[0], k) + weight * i_term(second, rules, sums[1], k)
                before = (1.0 - weight) * gyr1[i - 1, k] + weight * gyr2[i - 1, k]
                now = (1.0 - weight) * gyr1[i, k] + weight * gyr2[i, k]
                sums[2, k] = steady
                sums[3, k] = dt * (0.5 * (before + now) + steady)  # the rate of a step is the mean of its ends
            w0, w1, w2 = sums[3, 0], sums[3, 1], sums[3, 2]
        if i == 0 or math.isnan(q_nb[i - 1, 0]):
            q0, q1, q2, q3 = begin(
                x, up, field[0] / size, field[1] / size,
                acc1[i, 0] + both * acc2[i, 0], acc1[i, 1] + both * acc2[i, 1], acc1[i, 2] + both * acc2[i, 2],
                mag1[i, 0] + both * mag2[i, 0], mag1[i, 1] + both * mag2[i, 1], mag1[i, 2] + both * mag2[i, 2],
            )  # fmt: skip
        else:
            e0, e1, e2, e3 = quat_exp(w0, w1, w2)
            q0, q1, q2, q3 = quat_mul(q_nb[i - 1, 0], q_nb[i - 1, 1], q_nb[i - 1, 2], q_nb[i - 1, 3], e0, e1, e2, e3)
            p0, p1, p2, p3 = q0, q1, q2, q3
            if kinds[3] > 0.0:
                p0, p1, p2, p3 = q_nb[i - 1, 0], q_nb[i - 1, 1], q_nb[i - 1, 2], q_nb[i - 1, 3]
            a0, a1, a2 = error_of(up, p0, p1, p2, p3, field, acc1, mag1, i)
            c0, c1, c2 = error_of(up, p0, p1, p2, p3, field, acc2, mag2, i)
            d0 = blended(first, second, weight, a0, c0, dt, rules, sums, 0)
            d1 = blended(first, second, weight, a1, c1, dt, rules, sums, 1)
            d2 = blended(first, second, weight, a2, c2, dt, rules, sums, 2)
            u0, u1, u2 = d0 - sums[2, 0], d1 - sums[2, 1], d2 - sums[2, 2]  # the prediction has the rest
            if ekf:
                x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = q_nb[i - 1, 0], q_nb[i - 1, 1], q_nb[i - 1, 2], q_nb[i - 1, 3]
                predict(x, dt, w0 / dt + u0, w1 / dt + u1, w2 / dt + u2, 0.25 * dt * dt * noise[0])
                q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
                look_at(x, q0, q1, q2, q3, field[0], field[1], field[2], mag1[i, 0], mag1[i, 1], mag1[i, 2], noise[1])
                look_at(x, q0, q1, q2, q3, 0.0, 0.0, up, acc1[i, 0], acc1[i, 1], acc1[i, 2], noise[1])
                q0, q1, q2, q3 = quat_unit(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
            else:
                e0, e1, e2, e3 = quat_exp(dt * u0, dt * u1, dt * u2)
                q0, q1, q2, q3 = quat_mul(q0, q1, q2, q3, e0, e1, e2, e3)
                q0, q1, q2, q3 = quat_unit(q0, q1, q2, q3)
        q_nb[i, 0], q_nb[i, 1], q_nb[i, 2], q_nb[i, 3] = q0, q1, q2, q3


class ArrayFilter:
    """The scheme as what estimates a stream of its array: cut anywhere, a stream gives the same bits.

    Arguments are those of `paper`.
    """

    name = "teaching_arm"
    bias_prior = None

    def __init__(self, frame: Frame | str, scheme: Scheme | None = None, start: Floats | None = None) -> None:
        scheme, self.frame = scheme or Scheme(), Frame.parse(frame)
        for name in (scheme.set1, scheme.set2):
            if name not in LAWS:
                raise ParameterError(f"the law of a set must be one of {', '.join(LAWS)}, but it is '{name}'.")
        if scheme.sets not in (1, 2):
            raise ParameterError(f"sets must be 1 or 2, but it is {scheme.sets}.")
        if scheme.rule_units not in RULE_UNITS:
            raise ParameterError(f"rule_units must be one of {', '.join(RULE_UNITS)}, but it is '{scheme.rule_units}'.")
        laws = Rules(kp=scheme.kp, ki=scheme.ki, slope=scheme.slope, far=scheme.far, sum_table=scheme.sum_table)
        self._rules = np.array([*coefficients(laws), *RULE_UNITS[scheme.rule_units]])
        up = float(self.frame.up[2])
        self._field = math.cos(scheme.dip) * self.frame.north - math.sin(scheme.dip) * self.frame.up
        self._x, self._sums = np.zeros(OWN + 12), np.zeros((4, 3))
        self._up = -up if scheme.force_down else up
        for k in (0, 4, 7, 9):
            self._x[P + k] = 1e-3  # [HuangJiang]: P0
        if start is not None:
            self._x[Q : Q + 4] = start
        self._kinds = np.array(
            [LAWS[scheme.set1], LAWS[scheme.set2], 0.5 * (scheme.sets - 1), scheme.late], dtype=np.float64
        )
        self._scheme, self.common = scheme, CommonParams()
        self._last = np.empty((0, 23))  # signals of the sample before, and its attitude

    def north(self, has_mag: bool) -> North:
        """What headings count from."""
        return North.MAGNETIC

    def facts(self) -> dict[str, str]:
        """What differs from the paper."""
        changed = [f"{key}={value}" for key, value in self._scheme._asdict().items() if value != getattr(Scheme(), key)]
        return {"name": self.name, "frame": str(self.frame), "params": ", ".join(changed) or "defaults"}

    def describe(self) -> str:
        """Name and what differs from the paper, for provenance."""
        return f"{self.name}({self.facts()['params']})"

    def take(self, array: ImuArray) -> AttitudeTrack:
        """Attitude at the next samples."""
        of, n_before, words = sets_of(array), len(self._last), common_flags(array)
        for triad in TRIADS:
            plus, minus = of.plus[triad], of.minus[triad]
            alone = np.isnan(of.parity[triad])
            words[alone.any(axis=1)] |= np.uint32(flags.UNIT_EXCLUDED)
            words[(np.isnan(plus) & np.isnan(minus)).any(axis=1)] |= np.uint32(TRIAD_FLAGS[triad][0])
            plus[:], minus[:] = np.where(np.isnan(plus), minus, plus), np.where(np.isnan(minus), plus, minus)
        words[(words & np.uint32(flags.GYR_ABSENT)) != 0] |= np.uint32(flags.GYR_HELD)
        signals = [array.t[:, np.newaxis], *of.plus.values(), *of.minus.values(), np.empty((len(array), 4))]
        rows = np.concatenate((self._last, np.hstack(signals)))
        for k in (1, 2, 3, 10, 11, 12):  # rates of both sets
            rows[:, k] = hold_last(rows[:, k])
        a, b, c, d, e, f, q_nb = (np.ascontiguousarray(part) for part in np.split(rows[:, 1:], range(3, 19, 3), axis=1))
        run(
            np.ascontiguousarray(rows[:, 0]), a, b, c, -d if self._scheme.raw_mean else d, e, f, self._kinds,
            self._rules, self._up, self._field, self._scheme.ekf, np.array([1e-4, 1e-3]), self._x, self._sums, q_nb,
            n_before,
        )  # fmt: skip
        self._last = np.hstack((rows[-1:, :19], q_nb[-1:]))
        words[np.isnan(q_nb[n_before:, 0])] |= np.uint32(flags.NOT_CONVERGED)
        return AttitudeTrack(
            array.t, q_nb[n_before:], self.frame, North.MAGNETIC, flags=words, source="teaching-arm paper"
        )


def teaching_arm(
    array: ImuArray, *, frame: Frame | str, scheme: Scheme | None = None, start: Floats | None = None
) -> AttitudeTrack:
    """Attitude of the teaching-arm paper's array of six units, by its own scheme or one with other switches.

    It starts from `start` (4,), or from the first samples of the sets that are used, together.
    """
    return ArrayFilter(frame, scheme, start).take(array)
