"""One filter for all units of a chain: attitudes and biases of all, tied by what their joints let through.

Each unit is integrated by itself from keyframe to keyframe. There, three things are known:

* the force at a joint's centre is one force, whichever side computes it: ``R₁(f₁ + K₁r₁) = R₂(f₂ + K₂r₂)`` with
  ``K = [ω̇]× + [ω]×²`` and r the arm from unit to centre [Kok2014];
* both sides of a hinge see one axis, ``R₁j₁ = R₂j₂``; those of a universal joint see two at right angles; a fixed
  joint lets nothing through;
* no unit gathers a velocity for long.

The chain has one heading, which drifts as one; `anchor` holds it by all magnetometers together. Between two units
their fields count for little here, as iron bends them by tens of degrees: only where a joint says nothing for long.

========  =======  ============================================================
places    unit     state, of each unit
========  =======  ============================================================
0–2       rad      error of the attitude, navigation axes: q_true = exp(θ) ⊗ q
3–5       rad/s    bias of the gyroscope, a random walk
6–8       m/s      velocity, which is zero but for what the body moves
========  =======  ============================================================

It is neither `qmt.headingCorrection`, which takes tilts as given and one hinge at a time, nor strapdown navigation with
places tied at the joints: errors of scale of real accelerometers, twice integrated, tear such a chain by degrees.
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.arm.links import GROUND, JointLink
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.params import Spec
from plumbob.core.units import Quantity, deg, dps
from plumbob.rotations import dcm_from_quat, quat_from_rotvec, quat_multiply, quat_rotate, skew
from plumbob.rotations.kernels import Vec, cross, quat_exp, quat_mul, quat_unit, rotate

GAP: Final = 0.5  # a step that takes longer, s, is a gap: nothing is known of what happened in it
UNSEEN_RATE: Final = 1.0  # a body may turn so fast, rad/s, where no gyroscope looks,
UNSEEN_TIME: Final = 1.0  # into one direction for so long, s,
UNSEEN_FORCE: Final = 3.0  # and be accelerated by so much, m/s², where no accelerometer does
BEND: Final = 0.2
"""Share of a scale error's angle that counts as white noise of the rate, s: turns of an arm reverse that often."""
GATE: Final = 3.0  # standard deviations beyond which what joints say counts less (Huber)


LEAST_FIELD: Final = 5.0  # a weaker level field, µT, shows no direction
WIDTH: Final = 9  # states of a unit
TURNED: Final = 12  # places of what `integrate` finds
BLIND: Final = 13
PUSHED: Final = 14
COUNT: Final = 15


class Params(NamedTuple):
    """What the filter assumes; SI, independent of the rate."""

    keyframe: Annotated[float, Spec(Quantity.TIME, "spacing of the keyframes", 0.01, 1.0)] = 0.1
    start: Annotated[
        float,
        Spec(Quantity.TIME, "headings begin with what the joints say in this time; raise it for slow motion", 0.5),
    ] = 3.0
    mean_rate: Annotated[
        bool, Spec(Quantity.RATIO, "a sample is the mean rate since the one before, not the rate at its time")
    ] = True
    bias_sd: Annotated[
        float, Spec(Quantity.RATE, "bias of a gyroscope before the recording; lower it for calibrated units", 1e-6)
    ] = dps(1.0)
    bias_walk: Annotated[float, Spec(Quantity.RATE_WALK, "random walk of the bias", 0.0)] = dps(0.01)
    gyro_noise: Annotated[float, Spec(Quantity.RATE_NOISE, "white noise of the rate", 1e-9)] = dps(0.05)
    gyr_scale_sd: Annotated[float, Spec(Quantity.RATIO, "errors of a gyroscope's scale and axes", 0.0, 0.1)] = 0.003
    acc_noise: Annotated[float, Spec(Quantity.ACCELERATION_NOISE, "white noise of the force", 1e-9)] = 0.1
    speed_sd: Annotated[
        float, Spec(Quantity.SPEED, "how fast a unit moves; raise it for a chain that is carried about", 1e-3)
    ] = 0.5
    speed_time: Annotated[float, Spec(Quantity.TIME, "how long it moves into one direction", 1e-2)] = 1.0
    field_sd: Annotated[float, Spec(Quantity.ANGLE, "how far iron bends the field from one unit to the next", 1e-3)] = (
        deg(40.0)
    )
    anchor_sd: Annotated[
        float, Spec(Quantity.ANGLE, "how far it bends the mean field of all units away from North", 1e-3)
    ] = deg(15.0)
    field_time: Annotated[float, Spec(Quantity.TIME, "how long it does before the units have moved on", 0.1)] = 10.0


@dataclass(frozen=True, eq=False)
class UnitSamples:
    """Samples of units in their own axes: ``t`` (N,); ``gyr``, ``acc`` and, where there is one, ``mag`` (U, N, 3).

    ``flags`` (N,) are those of any unit.
    """

    t: Floats
    gyr: Floats
    acc: Floats
    mag: Floats | None = None
    flags: NDArray[np.uint32] | None = None

    def __post_init__(self) -> None:
        for name in ("gyr", "acc"):  # kernels take numbers that stand one behind the other
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name)))

    def __len__(self) -> int:
        return int(self.t.size)

    def rows(self, first: int, last: int) -> "UnitSamples":
        """Samples of a slice."""
        mag = None if self.mag is None else self.mag[:, first:last]
        flags = None if self.flags is None else self.flags[first:last]
        return UnitSamples(self.t[first:last], self.gyr[:, first:last], self.acc[:, first:last], mag, flags)


@kernel
def at_joint(
    m0: float, m1: float, m2: float, m3: float, fx: float, fy: float, fz: float, wx: float, wy: float, wz: float,
    ax: float, ay: float, az: float, rx: float, ry: float, rz: float,
) -> Vec:  # fmt: skip
    """Specific force at the end of an arm r, navigation axes, of a unit at attitude m that feels f and turns with ω."""
    sx, sy, sz = cross(wx, wy, wz, rx, ry, rz)
    tx, ty, tz = cross(wx, wy, wz, sx, sy, sz)
    ex, ey, ez = cross(ax, ay, az, rx, ry, rz)
    return rotate(m0, m1, m2, m3, fx + ex + tx, fy + ey + ty, fz + ez + tz)  # [Kok2014]


@kernel
def add_forces(
    t: Floats, gyr: Floats, acc: Floats, u: int, r: int, bias: Floats, m0: float, m1: float, m2: float, m3: float,
    ends: Floats, at: Floats, sums: Floats, forces: Floats,
) -> None:  # fmt: skip
    """Add up forces at joints at a sample r, between two others, at whose time unit u is at attitude m."""
    if math.isnan(gyr[u, r - 1, 0] + gyr[u, r, 0] + gyr[u, r + 1, 0] + acc[u, r, 0]):
        return
    k = 1.0 / (t[r + 1] - t[r - 1])
    ax, ay = k * (gyr[u, r + 1, 0] - gyr[u, r - 1, 0]), k * (gyr[u, r + 1, 1] - gyr[u, r - 1, 1])
    az = k * (gyr[u, r + 1, 2] - gyr[u, r - 1, 2])
    wx, wy, wz = gyr[u, r, 0] - bias[u, 0], gyr[u, r, 1] - bias[u, 1], gyr[u, r, 2] - bias[u, 2]
    for e in range(at.shape[0]):
        if at[e] == u:
            fx, fy, fz = at_joint(
                m0, m1, m2, m3, acc[u, r, 0], acc[u, r, 1], acc[u, r, 2], wx, wy, wz, ax, ay, az,
                ends[e, 0], ends[e, 1], ends[e, 2],
            )  # fmt: skip
            forces[e, 0] += fx
            forces[e, 1] += fy
            forces[e, 2] += fz
    sums[u, COUNT] += 1.0


@kernel
def add_turn(sums: Floats, u: int, dt: float, q0: float, q1: float, q2: float, q3: float) -> None:
    """Add a step at attitude q to the integral of the rotation matrix."""
    ix, iy, iz = rotate(q0, q1, q2, q3, 1.0, 0.0, 0.0)
    jx, jy, jz = rotate(q0, q1, q2, q3, 0.0, 1.0, 0.0)
    kx, ky, kz = cross(ix, iy, iz, jx, jy, jz)
    row = sums[u]
    row[0] += dt * ix
    row[1] += dt * jx
    row[2] += dt * kx
    row[3] += dt * iy
    row[4] += dt * jy
    row[5] += dt * ky
    row[6] += dt * iz
    row[7] += dt * jz
    row[8] += dt * kz


@kernel
def integrate(
    t: Floats, gyr: Floats, acc: Floats, first: int, last: int, mean_rate: bool,
    q: Floats, v: Floats, bias: Floats, ends: Floats, at: Floats, path: Floats, sums: Floats, forces: Floats,
) -> None:  # fmt: skip
    """Integrate every unit over the samples first to last, exclusive, from the one before first.

    `q` (U, 4), `v` (U, 3) and `bias` (U, 3) are those of the units, `ends` (E, 3) arms to joint centres and `at` (E,)
    whose they are. Attitudes go to `path` (U, N, 4). `sums` (U, 16) gets the integral of R (9), of the acceleration
    (3), of the squared rate, times without a rate and without a force, and the number of forces; `forces` (E, 3) the
    mean force at each arm's end, NaN where one is missing, as at the ground. A force is used when the sample behind it
    has come, because angular acceleration needs both neighbours.
    """
    sums[:] = 0.0
    forces[:] = 0.0
    for u in range(q.shape[0]):
        q0, q1, q2, q3 = q[u, 0], q[u, 1], q[u, 2], q[u, 3]
        wx, wy, wz = bias[u, 0], bias[u, 1], bias[u, 2]
        m0, m1, m2, m3 = q0, q1, q2, q3
        for r in range(first, last):
            dt = t[r] - t[r - 1]
            if r > first:
                add_forces(t, gyr, acc, u, r - 1, bias, m0, m1, m2, m3, ends, at, sums, forces)
            if math.isnan(gyr[u, r, 0]):
                sums[u, BLIND] += dt
            else:
                wx, wy, wz = gyr[u, r, 0], gyr[u, r, 1], gyr[u, r, 2]
            ox, oy, oz = wx - bias[u, 0], wy - bias[u, 1], wz - bias[u, 2]
            h0, h1, h2, h3 = quat_exp(0.5 * dt * ox, 0.5 * dt * oy, 0.5 * dt * oz)
            m0, m1, m2, m3 = quat_mul(q0, q1, q2, q3, h0, h1, h2, h3)
            q0, q1, q2, q3 = quat_mul(m0, m1, m2, m3, h0, h1, h2, h3)
            q0, q1, q2, q3 = quat_unit(q0, q1, q2, q3)
            add_turn(sums, u, dt, m0, m1, m2, m3)
            sums[u, TURNED] += dt * (ox * ox + oy * oy + oz * oz)
            if math.isnan(acc[u, r, 0]):
                sums[u, PUSHED] += dt
            else:
                fx, fy, fz = rotate(m0, m1, m2, m3, acc[u, r, 0], acc[u, r, 1], acc[u, r, 2])
                sums[u, 9] += dt * fx
                sums[u, 10] += dt * fy
                sums[u, 11] += dt * (fz - G0)
            p0, p1, p2, p3 = (q0, q1, q2, q3) if mean_rate else (m0, m1, m2, m3)
            path[u, r, 0], path[u, r, 1], path[u, r, 2], path[u, r, 3] = p0, p1, p2, p3
        q[u, 0], q[u, 1], q[u, 2], q[u, 3] = q0, q1, q2, q3
        for i in range(3):
            v[u, i] += sums[u, 9 + i]
    for e in range(at.shape[0]):
        count = sums[int(at[e]), COUNT] if at[e] >= 0.0 else 0.0  # the ground has no unit
        for k in range(3):
            forces[e, k] = forces[e, k] / count if count > 0.0 else math.nan


class ResidualRow(NamedTuple):
    """Numbers that should be zero: how the state moves them, what they are, their noise, and whether it is robust."""

    h: Floats
    z: Floats
    var: float
    robust: bool


class Keyframe(NamedTuple):
    """Filter at a keyframe: what it expected, what it then knew, and how the error got there from the one before.

    `row`: its sample; `q` (U, 4), `linear` (U, 6): attitudes; biases and velocities; `cov` (D, D): covariance of the
    error; `q_prior`, `linear_prior`, `cov_prior`: the same before what is known at the keyframe was used; `transition`
    (D, D): from the error at the keyframe before to that expected here.
    """

    row: int
    q: Floats
    linear: Floats
    cov: Floats
    q_prior: Floats
    linear_prior: Floats
    cov_prior: Floats
    transition: Floats


class ChainFilter:
    """The filter of so many units; `advance` takes it to the next keyframe.

    `q` (U, 4), `q_sd` (U, 3): first attitudes, in a frame whose z axis points up, and their standard deviations about
    the navigation axes, rad.
    """

    def __init__(self, links: Sequence[JointLink], units: int, params: Params, q: Floats, q_sd: Floats) -> None:
        self.params, self.links, self.units = params, list(links), units
        self.q, self.v, self.bias = q.copy(), np.zeros((units, 3)), np.zeros((units, 3))
        others = np.tile(np.repeat([params.bias_sd, params.speed_sd], 3), (units, 1))
        self.cov = np.diag(np.hstack((q_sd, others)).ravel() ** 2)
        self._ends = np.concatenate([np.zeros((0, 3))] + [link.arms for link in self.links])
        self._at = np.array([float(u) for link in self.links for u in (link.parent, link.child)])
        self._sums, self._forces = np.zeros((units, 16)), np.zeros(self._ends.shape)

    @property
    def forces(self) -> Floats:
        """Mean forces of the last step at the ends of the arms (2 links, 3): each link's parent, then its child."""
        return self._forces

    def look(self, samples: UnitSamples, first: int, last: int, path: Floats) -> None:
        """Integrate over samples first to last, exclusive, and nothing else."""
        integrate(
            samples.t, samples.gyr, samples.acc, first, last, self.params.mean_rate, self.q, self.v, self.bias,
            self._ends, self._at, path, self._sums, self._forces,
        )  # fmt: skip

    def now(self) -> Keyframe:
        """The filter before it has gone anywhere, as a keyframe of the first sample."""
        state = self.q.copy(), np.hstack((self.bias, self.v)), self.cov
        return Keyframe(0, *state, *state, np.eye(len(self.cov)))

    def advance(self, samples: UnitSamples, first: int, last: int, path: Floats) -> Keyframe:
        """Go on over samples first to last, exclusive, and use what is known at the last; `path` gets the attitudes."""
        self.look(samples, first, last, path)
        span, steps = float(samples.t[last - 1] - samples.t[first - 1]), np.diff(samples.t[first - 1 : last])
        gap = float(steps[steps > GAP].sum())
        transition = self._predict(span, gap)
        expected = self.q.copy(), np.hstack((self.bias, self.v)), self.cov
        self._use(self._rows(span, gap, None if samples.mag is None else samples.mag[:, last - 1]))
        return Keyframe(last - 1, self.q.copy(), np.hstack((self.bias, self.v)), self.cov, *expected, transition)

    def _predict(self, span: float, gap: float) -> Floats:
        """Carry the covariance over a step, and give the transition."""
        p = self.params
        turn, noise = np.eye(len(self.cov)), np.zeros(len(self.cov))
        for u in range(self.units):
            first, sums = WIDTH * u, self._sums[u]
            rotation, push = sums[:9].reshape(3, 3), skew(sums[9:12] + [0.0, 0.0, G0 * span])
            turn[first : first + 3, first + 3 : first + 6] = -rotation
            turn[first + 6 : first + 9, first : first + 3] = -push
            turn[first + 6 : first + 9, first + 3 : first + 6] = 0.5 * push @ rotation
            blind = max(gap, sums[BLIND])
            noise[first : first + 3] = p.gyro_noise**2 * span + p.gyr_scale_sd**2 * BEND * sums[TURNED]
            noise[first : first + 3] += UNSEEN_RATE**2 * blind * max(blind, UNSEEN_TIME)
            noise[first + 3 : first + 6] = p.bias_walk**2 * span
            noise[first + 6 : first + 9] = p.acc_noise**2 * span + (UNSEEN_FORCE * max(gap, sums[PUSHED])) ** 2
        self.cov = turn @ self.cov @ turn.T
        self.cov[np.diag_indices(len(noise))] += noise
        return turn

    def _rows(self, span: float, gap: float, mag: Floats | None) -> list[ResidualRow]:
        """All that is known at a keyframe."""
        p, rows = self.params, list[ResidualRow]()
        matrices = dcm_from_quat(self.q)
        for k, link in enumerate(self.links):
            of_parent, of_child = self._forces[2 * k], self._forces[2 * k + 1]
            if link.parent == GROUND:
                of_parent = np.array([0.0, 0.0, G0])
            if gap == 0.0 and np.isfinite(of_parent).all() and np.isfinite(of_child).all():
                h = self._turning(link, -skew(of_parent), skew(of_child))
                both = 1.0 if link.parent == GROUND else 2.0
                var = both * link.force_sd**2 * max(1.0, 2.0 * link.force_time / span)
                rows.append(ResidualRow(h, of_child - of_parent, var, True))
            rows += self._axis_rows(link, matrices, max(1.0, 2.0 * link.play_time / span))
        var = p.speed_sd**2 * 2.0 * p.speed_time / span
        for u in range(self.units):
            h = np.zeros((3, len(self.cov)))
            h[:, WIDTH * u + 6 : WIDTH * u + 9] = np.eye(3)
            rows.append(ResidualRow(h, -self.v[u], var, False))
        return rows + ([] if mag is None else self._field_rows(mag, span))

    def _turning(self, link: JointLink, parent: Floats, child: Floats) -> Floats:
        """Rows that small turns of both sides move as given, (M, D)."""
        h = np.zeros((len(child), len(self.cov)))
        if link.parent != GROUND:
            h[:, WIDTH * link.parent : WIDTH * link.parent + 3] = parent
        h[:, WIDTH * link.child : WIDTH * link.child + 3] = child
        return h

    def _axis_rows(self, link: JointLink, matrices: Floats, alike: float) -> list[ResidualRow]:
        """What the axes of a joint say; `alike` keyframes in a row say the same."""
        if not link.axes.shape[1]:
            return []
        parent = np.eye(3) if link.parent == GROUND else matrices[link.parent]
        var = link.play**2 * alike
        ones, others = link.axes[0] @ parent.T, link.axes[1] @ matrices[link.child].T
        if link.joint.kind == "universal":
            axis, other = ones[0], others[0]
            turn = np.cross(axis, other)[np.newaxis]
            return [ResidualRow(self._turning(link, turn, -turn), np.array([-axis @ other]), var, True)]
        if link.joint.kind == "fixed":
            swing = 0.5 * sum((np.cross(b, a) for a, b in zip(ones, others, strict=True)), np.zeros(3))
            return [ResidualRow(self._turning(link, -np.eye(3), np.eye(3)), swing, var, True)]
        across = np.eye(3) - np.outer(ones[0], ones[0])
        return [ResidualRow(self._turning(link, -across, across), np.cross(others[0], ones[0]), var, True)]

    def _field_rows(self, mag: Floats, span: float) -> list[ResidualRow]:
        """What magnetometers (U, 3) say of the headings of neighbours: that their fields point the same way."""
        level = quat_rotate(self.q, np.nan_to_num(mag))
        size = np.hypot(level[:, 0], level[:, 1])
        var = 2.0 * self.params.field_sd**2 * max(1.0, 2.0 * self.params.field_time / span)
        rows = []
        for link in self.links:
            if link.parent != GROUND and min(size[link.parent], size[link.child]) > LEAST_FIELD:
                field, other = (complex(*level[u, :2]) for u in (link.parent, link.child))
                up = np.array([[0.0, 0.0, 1.0]])
                rows.append(
                    ResidualRow(self._turning(link, -up, up), np.array([cmath.phase(field / other)]), var, True)
                )
        return rows

    def _use(self, rows: Sequence[ResidualRow]) -> None:
        """Take up all rows at once; one that contradicts the rest counts less."""
        if not rows:
            return
        var = np.concatenate([np.full(len(row.z), self._robust(row)) for row in rows])
        h, z = np.vstack([row.h for row in rows]), np.concatenate([row.z for row in rows])
        spread = h @ self.cov
        gain = np.linalg.solve(spread @ h.T + np.diag(var), spread).T
        cov = self.cov - gain @ spread
        self.cov = 0.5 * (cov + cov.T)
        self.inject(gain @ z)

    def _robust(self, row: ResidualRow) -> float:
        if not row.robust:
            return row.var
        s = row.h @ self.cov @ row.h.T + row.var * np.eye(len(row.z))
        excess = math.sqrt(float(row.z @ np.linalg.solve(s, row.z))) / GATE
        return row.var * max(1.0, excess)

    def inject(self, error: Floats) -> None:
        """Take an error (D,) off the state."""
        unit_error = error[: WIDTH * self.units].reshape(self.units, WIDTH)
        self.q = quat_multiply(quat_from_rotvec(unit_error[:, :3]), self.q)
        self.q /= np.linalg.norm(self.q, axis=1, keepdims=True)
        self.bias = self.bias + unit_error[:, 3:6]
        self.v = self.v + unit_error[:, 6:9]
