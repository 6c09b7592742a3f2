"""What gyroscope and accelerometer say alone: when the unit rests, how fast it moves, its attitude but for heading."""

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.core.units import deg, dps
from plumbob.filters.smoother import model
from plumbob.filters.smoother.keyframes import LOST, Bools, Keyframes, path, sum_between
from plumbob.filters.smoother.sweeps import AGAIN, MOVING, RESTING, UNUSED, Sweep, sweep
from plumbob.filters.start import upright
from plumbob.rotations import dcm_from_quat, quat_rotate

WINDOW: Final = 3.0  # the body's speed is learned over this to both sides, s
LEAK: Final = 4.0  # velocity is integrated from the specific force with this memory, s
SLOW: Final = 4.0 * LEAK
"""Before any attitude is known, gravity is the mean force over this to both sides, s, in the gyroscope's frame."""
SPEED_TIMES: Final = 6.0  # a speed lasts for about a period of the motion: this times speed over acceleration,
SHORTEST: Final = 0.25
"""but not shorter than this, s, and not longer than `LEAK`."""
ANY_SPEED: Final = 10.0  # level speed that may be any, m/s: where no force says
REST_SPEED: Final = 0.02  # level speed at rest, m/s
FIRST_TILT: Final = 4.0  # the first tilt is that of the mean specific force over this, s;
WIDE: Final = LOST
"""its standard deviation, rad,"""
NARROW: Final = deg(5.0)
"""and that of a smoothed one that is taken for a start."""
FIRST_BIASES: Final = 1.0, dps(0.5), dps(0.1)
"""Standard deviations of the first bias, the first as a share of its prior, the others in rad/s, that are tried in turn
where nothing rests: many gyroscopes come nearly without one, and a few seconds of motion can be explained by any;"""
REST_BIAS: Final = dps(0.3)
"""at rest it is known to this."""
GIVEN: Final = deg(1.0)
"""Standard deviation of a first attitude that a user gives, rad: levels and compasses are read to a degree;"""
USUAL_SPEED: Final = 1.0
"""its tilt is less certain where it takes the mean force of the first seconds for more than this level speed, m/s,
and any other where a body gathers more within `LEAK`."""
TINY: Final = 1e-12  # of velocities that are nothing no logarithm is taken
BY_CHANCE: Final = 0.05  # and a larger one counts only where the smaller ones have less than this of its likelihood
AGAIN_BIAS: Final = dps(1.0)  # and this is what a later pass takes for it
UNSHOWN: Final = dps(0.3)
"""but of the part about the vertical of a small one: a motion that repeats, as a walk does, looks like that."""
FIXED_MATRIX: Final = 1e-2
"""Share of its prior by which scale and misalignment may move while the attitude is still far off."""
BEYOND: Final = 3.0  # a mean rate beyond this many standard deviations of the bias is a turn
REST_PER_SD: Final = 3.0
"""where each of them takes so much rest, s: a calm second or two may be a turn."""
PIECE: Final = 10.0
"""The field says whether such a piece of a recording, s, that is calm is an even turn: it then changes"""
SIZE_KEPT: Final = 0.3
"""by more than `mag_spread` from its first part to the last, and its size by less than this share of that."""
PARTS: Final = 6
"""It does so evenly: of the means of these parts none is farther from the next than this share of all these ways."""
EVEN: Final = 0.5
NO_ERROR: Final = np.zeros(9)  # scale and misalignment of a gyroscope without an error
MOST: Final = 2000  # windows that are tried as centre of a cluster


@dataclass(frozen=True, slots=True)
class Speed:
    """How the body moves, at each step: level speed, m/s, for how long it lasts, s, and where no force says; (K,).

    `before` is the speed of the step itself by what comes before it, `now` that or the one by what comes behind it,
    whichever is less.
    """

    speed: Floats
    lasts: Floats
    untold: Bools
    now: Floats
    before: Floats

    def rms(self, steps: slice = slice(None)) -> float:
        """Root mean square of the level speed in some steps, m/s."""
        return math.sqrt(float(np.mean(self.speed[steps] ** 2)))

    def density(self, p: model.Params, resting: Bools) -> Floats:
        """Spectral density of the level velocity, taken for white, m²/s."""
        moving = 2.0 * self.lasts * np.maximum(self.speed, np.where(self.untold, ANY_SPEED, p.speed)) ** 2
        at_rest = np.maximum(self.lasts * self.now**2, SHORTEST * REST_SPEED**2)
        return np.where(resting, 2.0 * at_rest, moving)

    def lasting(self, step: Floats, resting: Bools) -> Floats:
        """Share of the level velocity that lasts over each step of so many s: a fast body may stay fast.

        So it counts from the mean of some seconds, which a hand, that soon comes back, does not need. Where a rest
        begins, of a train as well as of a foot, what is beyond `USUAL_SPEED` is what rests from then on.
        """
        square = np.where(self.untold, 0.0, self.speed**2)
        peaks(step, LEAK, square)
        share: Floats = np.exp(-step / LEAK * square / (square + USUAL_SPEED**2))
        begins = 1 + np.flatnonzero(resting[1:] & ~resting[:-1])
        share[begins] *= np.minimum((USUAL_SPEED / np.maximum(self.before[begins - 1], TINY)) ** 4, 1.0)
        return share


@dataclass(frozen=True, slots=True)
class Inertial:
    """Attitude without a field, whose heading drifts: the pass, where it rested, and how fast the body moved.

    `drift_sd` is the standard deviation of its bias about the vertical, rad/s, before a field shows it. Motion does
    not: the level velocity of a body swings with its tilt, and both together look like a turn. So `bias_sd` is that of
    a bias that no rest showed, rad/s; zero where one did. `prior` is the covariance (21, 21) before the first sample,
    `given_sd` the standard deviation of a tilt that was given, rad, `tilt_var` what is in doubt of it, rad², and
    `first_sd` that of the first bias that was chosen, rad/s. `began` is the scale and misalignment (9,) from which the
    passes with a field begin.
    """

    sweep: Sweep
    resting: Bools
    speed: Speed
    prior: Floats
    began: Floats
    drift_sd: float = 0.0
    bias_sd: float = 0.0
    given_sd: float = math.inf
    tilt_var: float = 0.0
    first_sd: float = 0.0


def kinds(frames: Keyframes, resting: Bools) -> NDArray[np.int64]:
    """Kind of each step."""
    return np.where(frames.gap, AGAIN, np.where(resting, RESTING, MOVING))


@dataclass(frozen=True, slots=True)
class Calm:
    """Steps around which rate and force stay as they are, (K,), and the mean rate around every step, (K, 3), rad/s.

    `turn` is how much of that may be an even turn, (K,), rad/s: only what lies along gravity, which any other turn
    would move, nothing where a field stood still, and all where one moved: a wave tilts a buoy as it accelerates it.
    """

    quiet: Bools
    mean: Floats
    turn: Floats

    def at_bias(self, p: model.Params, bias: Floats) -> Bools:
        """Steps at rest, where the bias, (3,) or (K, 3), is known."""
        resting: Bools = self.quiet & (np.linalg.norm(self.mean - bias, axis=1) < p.rest_band)
        return resting


def calm(frames: Keyframes, p: model.Params) -> Calm:
    """Find the calm steps: the window reaches to both sides, and one with a gap in it is not calm."""
    usual = float(np.median(frames.step))
    width = max(3, round(p.rest_time / usual) | 1)
    rate, force = frames.mean(frames.gyr), frames.mean(frames.acc)
    i = np.arange(len(rate))
    low, high = np.maximum(i - width // 2, 0), np.minimum(i + width // 2 + 1, len(rate))
    means, quiet = list[Floats](), sum_between(frames.gap.astype(np.float64), low, high) == 0.0
    for values, most in ((rate, p.rest_rate), (force, p.rest_force)):
        means.append(sum_between(values, low, high, mean=True))
        deviation = np.empty(len(values))
        farthest(values, means[-1], low, high, deviation)
        quiet &= deviation < most
    mean, up = means
    turning, still, moved = _turned_field(frames, p, quiet)
    along = (mean * up).sum(axis=1) / np.maximum(np.linalg.norm(up, axis=1), 1e-9)
    turn = np.where(moved, np.linalg.norm(mean, axis=1), np.where(still, 0.0, along))
    return Calm(quiet & ~turning & ~model.hides_rest(p, frames.digit), mean, turn)


@kernel
def farthest(values: Floats, mean: Floats, low: NDArray[np.int64], high: NDArray[np.int64], out: Floats) -> None:
    """How far values (K, 3) of a window around each, from row `low` to before row `high`, are from its mean, (K,)."""
    for k in range(out.size):
        most = 0.0
        for i in range(low[k], high[k]):
            for axis in range(3):
                most = max(most, abs(values[i, axis] - mean[k, axis]))
        out[k] = most


def _turned_field(frames: Keyframes, p: model.Params, quiet: Bools) -> tuple[Bools, Bools, Bools]:
    """Calm steps around which the field turns in the body, as a bias never does; where it stands still; and moves."""
    turning, still, moved = np.zeros_like(quiet), np.zeros_like(quiet), np.zeros_like(quiet)
    piece = frames.pieces(PIECE)
    half, count = max(1, round(p.rest_time / float(np.median(frames.step))) // 2), np.cumsum(np.append(0, quiet))
    i = np.arange(quiet.size)  # all steps of the windows around calm ones
    around = count[np.minimum(i + half + 1, quiet.size)] > count[np.maximum(i - half, 0)]
    has_field = np.concatenate(([False], np.repeat(around, np.diff(frames.first)))) & np.isfinite(frames.mag[:, 0])
    rows = np.flatnonzero(has_field)
    for number in np.unique(piece[quiet]):
        low, high = frames.first[np.searchsorted(piece, number)], frames.first[np.searchsorted(piece, number, "right")]
        fields = frames.mag[rows[np.searchsorted(rows, low) : np.searchsorted(rows, high)]]
        if (part := len(fields) // PARTS) > 0:
            means = fields[: PARTS * part].reshape(PARTS, part, 3).mean(axis=1)
            change, grown = np.linalg.norm(means[-1] - means[0]), np.linalg.norm(means[-1]) - np.linalg.norm(means[0])
            ways = np.linalg.norm(np.diff(means, axis=0), axis=1)
            as_a_turn = abs(grown) < SIZE_KEPT * change and ways.max() < EVEN * ways.sum()
            swung = np.linalg.norm(means - means[0], axis=1).max()  # on waves it comes back
            turning[piece == number] = change > p.mag_spread and as_a_turn
            still[piece == number] = swung <= p.mag_spread
            moved[piece == number] = swung > p.mag_spread
    return quiet & turning, quiet & still, quiet & moved


def first_rest(windows: Calm, p: model.Params, step: Floats) -> tuple[Bools, Floats]:
    """Steps at rest, and the bias that they show, before any is known.

    A slow even turn is as calm as rest, but its rate is its own; the rate at rest is the same bias every time. So rest
    is where the mean rate belongs to the strongest cluster of all calm ones, weighed by how unlikely a turn is.
    """
    quiet, mean = windows.quiet, windows.mean
    if not quiet.any():
        return quiet, np.zeros(3)
    rates = mean[quiet]
    stride = max(1, len(rates) // MOST)
    tried = rates[::stride]
    count = np.zeros(len(tried), dtype=np.int64)
    neighbours(rates, tried, p.rest_band, count)
    likely = count * np.exp(-0.5 * (windows.turn[quiet][::stride] / p.bias_start) ** 2)
    bias = tried[np.argmax(likely)]
    for _ in range(3):
        bias = rates[np.linalg.norm(rates - bias, axis=1) < p.rest_band].mean(axis=0)
    resting = windows.at_bias(p, bias)
    most = min(BEYOND, float(step[resting].sum()) / REST_PER_SD)
    shown = float(step[resting & (windows.turn == 0.0)].sum())  # by a field that stood still
    if shown < p.rest_time and abs(np.median(windows.turn[resting])) > most * p.bias_start:
        return np.zeros_like(quiet), np.zeros(3)
    return resting, np.median(mean[resting], axis=0)


@kernel
def neighbours(points: Floats, centres: Floats, within: float, count: NDArray[np.int64]) -> None:
    """Count the points (n, 3) that lie within a distance of each centre (m, 3)."""
    for i in range(centres.shape[0]):
        for j in range(points.shape[0]):
            dx, dy, dz = (
                points[j, 0] - centres[i, 0],
                points[j, 1] - centres[i, 1],
                points[j, 2] - centres[i, 2],
            )
            if dx * dx + dy * dy + dz * dz <= within * within:
                count[i] += 1


@kernel
def leaky(dt: Floats, force: Floats, memory: float, out: Floats) -> None:
    """A level force integrated with a memory."""
    for axis in range(2):
        v = 0.0
        for k in range(dt.size):
            v = v * math.exp(-dt[k] / memory) + dt[k] * force[k, axis]
            out[k, axis] = v


@kernel
def peaks(dt: Floats, memory: float, square: Floats) -> None:
    """The largest of all squares up to each, where they fade with a memory."""
    for k in range(1, dt.size):
        square[k] = max(square[k], square[k - 1] * math.exp(-dt[k] / memory))


def level_speed(frames: Keyframes, force: Floats, *, sure: bool = True) -> Speed:
    """How fast the body moves, by its level specific force (K, 2).

    Where the bias may be any, it is `sure` of nothing that lasts: what is integrated from both sides leaves that out,
    or a wrong bias would be explained by a fast body.
    """
    dt, untold = frames.step, frames.untold
    force = np.where(untold[:, np.newaxis], 0.0, force)
    velocity, back = np.zeros((dt.size, 2)), np.zeros((dt.size, 2))
    leaky(dt, force, LEAK, velocity)
    leaky(dt[::-1].copy(), -force[::-1], LEAK, back)
    back = back[::-1]
    before = np.sqrt(0.5 * (velocity**2).sum(axis=1))
    now = np.minimum(before, np.sqrt(0.5 * (back**2).sum(axis=1)))
    if not sure:
        velocity = 0.5 * (velocity + back)
    middle = frames.middle
    low, high = np.searchsorted(middle, middle - WINDOW), np.searchsorted(middle, middle + WINDOW, side="right")

    def rms(values: Floats) -> Floats:
        square = sum_between(0.5 * (values**2).sum(axis=1) * dt, low, high)
        return np.sqrt(square / sum_between(dt, low, high))

    speed, acceleration = rms(velocity), rms(force)
    lasts = np.clip(SPEED_TIMES * speed / np.maximum(acceleration, 1e-3), SHORTEST, LEAK)
    return Speed(speed, lasts, untold, now, before)


def first_speed(frames: Keyframes, rate: Floats, *, sure: bool) -> Speed:
    """Speed before any attitude is known: in the frame to which rates (N, 3) lead gravity is a slow mean."""
    free = np.empty((frames.t.size, 4))
    path(frames.t, rate, free)
    force = frames.mean(quat_rotate(free, frames.acc))
    middle = frames.middle
    slow = SLOW if sure else LEAK
    low, high = np.searchsorted(middle, middle - slow), np.searchsorted(middle, middle + slow, side="right")
    force = force - sum_between(force, low, high, mean=True)
    xy, yz = (level_speed(frames, of, sure=sure) for of in (force[:, :2], force[:, 1:]))
    speed, now, before = (np.maximum(getattr(xy, name), getattr(yz, name)) for name in ("speed", "now", "before"))
    return replace(xy, speed=speed, lasts=np.full(middle.size, 0.5), now=now, before=before)


def first_tilt(frames: Keyframes, start: int, rate: Floats) -> Floats:
    """Attitude (4,) at a keyframe, of any heading, from the mean force of the next seconds where rates (N, 3) lead."""
    ends = np.flatnonzero(frames.gap[start:])
    last = frames.first[start + ends[0]] if ends.size else frames.t.size - 1
    i = frames.first[start]
    j = max(min(int(np.searchsorted(frames.t, frames.t[i] + FIRST_TILT)), int(last) + 1), int(i) + 1)
    t, free = frames.t[i:j], np.empty((j - i, 4))
    path(t, rate[i:j], free)
    x = (t - t[0]) / max(t[-1] - t[0], 1e-9)
    weight = np.minimum(1.0, 4.0 * np.minimum(x, 1.0 - x) + 1e-3)  # what moves at the ends counts less
    force = weight @ quat_rotate(free, frames.acc[i:j])
    return np.array(upright(1.0, *(force / max(float(np.linalg.norm(force)), TINY)).tolist()))


class Given(NamedTuple):
    """A given attitude (4,) at the first sample, body to ENU, and whether its heading is meant.

    Behind a jump of the bias the passes begin from this one, (3,), rad/s, where nothing rests.
    """

    q: Floats
    headed: bool
    bias: Floats | None = None


def given_sd(q: Floats, measured: Floats, lasted: float) -> tuple[float, float]:
    """Standard deviation of a given tilt, rad, where the mean force of so many seconds shows another one, (4,) both.

    What it takes for a level velocity may be gravity. It yields the more, the longer that lasts; what it has not
    yielded yet is returned too, as the variance, rad², that is in doubt until then.
    """
    cosine = float(dcm_from_quat(q)[2] @ dcm_from_quat(measured)[2])
    beyond2 = max((G0 * lasted) ** 2 * (1.0 - max(cosine, 0.0) ** 2) - USUAL_SPEED**2, 0.0) / G0**2
    yielded = beyond2 / FIRST_TILT**2
    return math.sqrt(GIVEN**2 + yielded), beyond2 / max(lasted, 1e-3) ** 2 - yielded


def narrowed(p0: Floats, tilt: float) -> Floats:
    """First covariance where the tilt is known to this, rad."""
    p0 = p0.copy()
    for i in (model.TH, model.TH + 1):
        p0[i, i] = min(p0[i, i], tilt**2)
    return p0


def known_along(p0: Floats, bias: Floats, axis: Floats, other: Floats, sd: float) -> tuple[Floats, Floats]:
    """First covariance and bias (3,) where that along an axis (3,) of the body is another's, known to `sd`, rad/s."""
    p0, place = p0.copy(), slice(model.B, model.B + 3)
    p0[place, place] -= (axis @ p0[place, place] @ axis - sd**2) * np.outer(axis, axis)
    return p0, bias - axis * float(axis @ (bias - other))


@dataclass(frozen=True, slots=True)
class Beginning:
    """What the first pass begins with, whatever scale the gyroscope may have; `level` makes the passes from it.

    Steps at rest, (K,); attitudes (K + 1, 4) at the starts; the bias (3,), rad/s, with the standard deviations that are
    tried for it, rad/s; the first speed; standard deviation of the first tilt, rad, and what is in doubt of it, rad².
    `bias_sd` is that of `Inertial` where rest, or what came before, shows the bias, else None; `drift_sd` is None where
    the passes say. `unit` is what the unit's card leaves (12, 12).
    """

    frames: Keyframes
    resting: Bools
    tilt: Floats
    bias: Floats
    first_sds: tuple[float, ...]
    speed: Speed
    tilt_sd: float
    tilt_var: float
    bias_sd: float | None
    drift_sd: float | None
    unit: Floats | None
    matrix: Floats

    @classmethod
    def from_frames(
        cls, frames: Keyframes, p: model.Params, prior: tuple[Floats, float] | None = None, unit: Floats | None = None,
        given: Given | None = None, *, any_bias: bool = False, before: tuple[Floats, Floats] | None = None,
        matrix: Floats = NO_ERROR,
    ) -> Self:  # fmt: skip
        """Of a recording, or a stretch of one.

        `prior` is the bias (3,), rad/s, that the samples before showed, with what no rest showed of it, and `unit` what
        the unit's card leaves (12, 12). With `any_bias`, large ones are as likely as small ones. `before` is the bias,
        and its covariance, that what came before has shown: it counts where nothing rests. `matrix` is the scale and
        misalignment (9,) that it has shown of a unit as delivered.
        """
        windows = calm(frames, p)
        if prior is None:
            resting, bias = first_rest(windows, p, frames.step)
        else:
            resting, bias = windows.at_bias(p, prior[0]), prior[0]
        rested = bool(resting.any())
        before = before if prior is None and not rested else None
        if given is not None and given.bias is not None and not rested:
            bias = given.bias
        if before is not None:
            bias, resting = before[0], windows.at_bias(p, before[0])
        tilt, rate = np.zeros((frames.first.size, 4)), frames.gyr - bias - frames.gyr @ matrix.reshape(3, 3).T
        for start in frames.starts:
            tilt[start] = first_tilt(frames, start, rate)
        tilt_sd, tilt_var = math.inf, 0.0
        if given is not None:
            end = frames.time[frames.starts[1] - 1] if frames.gap.any() else frames.t[-1]
            tilt_sd, tilt_var = given_sd(given.q, tilt[0], min(FIRST_TILT, float(end - frames.t[0])))
            tilt[0] = given.q
        bias_sd: float | None = 0.0 if prior is None or rested else prior[1]
        drift_sd: float | None = None
        sds: tuple[float, ...] = (REST_BIAS,)
        if before is not None:
            drift_sd = math.sqrt(float(np.trace(before[1])) / 3.0)
            sds = (drift_sd,)
        elif prior is None and not rested:
            bias_sd, sds = None, (FIRST_BIASES[0] * p.bias_start, *(() if any_bias else FIRST_BIASES[1:]))
        speed = first_speed(frames, rate, sure=bias_sd is not None)
        return cls(frames, resting, tilt, bias, sds, speed, tilt_sd, tilt_var, bias_sd, drift_sd, unit, matrix)

    def level(self, p: model.Params, *first_sds: float) -> Inertial:
        """Attitude whose heading counts from nothing or from a given one, by the first bias that leaves least velocity.

        Two passes, the other from the smoothed start of the first, which hardly moves scale and misalignment. Where
        little is known of these both seek them, at the first speed: what they explain would be taken for speed. The
        first is tried with each standard deviation of the bias, from the largest on; these take the place of its own.
        """
        frames, resting, speed, spreads = self.frames, self.resting, self.speed, first_sds or self.first_sds
        kind, unused = kinds(frames, resting), np.full(frames.gap.size, 2.0 * UNUSED)
        noise, start, chosen, spread2 = model.ModelVariances.from_params(p, 0.0), self.tilt.copy(), 0.0, 0.0
        bias, free, sure = self.bias, p.gyr_scale > model.Params().gyr_scale, self.bias_sd is not None
        began = self.matrix if free else NO_ERROR
        for wide, matrix in ((WIDE, 1.0 if free else FIXED_MATRIX), (NARROW, 1.0)):
            density, tried = speed.density(p, resting), list[Sweep]()
            lasting = speed.lasting(frames.step, resting) if sure else np.ones(kind.size)
            for bias_sd in spreads if wide == WIDE else (min(chosen, AGAIN_BIAS),):
                p0 = model.start_covariance(
                    p,
                    tilt=wide,
                    heading=model.FREE_HEADING,
                    bias=bias_sd,
                    rigid=not free,
                    matrix=matrix,
                    unit=self.unit,
                )
                first = narrowed(p0, self.tilt_sd)
                if wide == NARROW and not sure and chosen < AGAIN_BIAS:
                    first, bias = known_along(first, bias, dcm_from_quat(start[:1])[0, 2], self.bias, UNSHOWN)
                p0[model.TH + 2, model.TH + 2] = math.pi**2  # behind a gap it may be any, but for what bridges that
                estimate = sweep(
                    frames, kind, density, lasting, unused, start, bias, began, p0, noise, first=first,
                    covariance=wide == NARROW,
                )  # fmt: skip
                tried.append(estimate)
            if wide == WIDE:
                # How fast the body moves may be any: then −2 log p is n log Σ r²/s + Σ log s, of n velocities
                squares, logs = np.array([each.moved for each in tried]).T
                unlikely = float(np.sum(frames.step / speed.lasts)) * np.log(np.maximum(squares, TINY)) + logs
                odds = np.exp(-0.5 * (unlikely - unlikely.min()))
                k = int(np.flatnonzero(odds > BY_CHANCE)[-1])
                spread2, chosen, estimate = float(odds @ np.square(spreads) / odds.sum()), spreads[k], tried[k]
            if not free or wide == NARROW:
                speed = level_speed(frames, estimate.force[:, :2], sure=sure)
            start[frames.starts], bias = estimate.q[frames.starts], estimate.bias[0]
            if self.tilt_sd < NARROW:
                start[0] = self.tilt[0]
        if self.bias_sd is not None:
            drift_sd, bias_sd = self.drift_sd or _vertical_sd(estimate), self.bias_sd
        else:
            level_bias = dcm_from_quat(estimate.q[:1])[0, :2] @ estimate.bias[0]
            # its part about the vertical is as large as the others
            least = max(model.BIAS_REPEATS, math.sqrt(0.5 * float(level_bias @ level_bias)))
            drift_sd, bias_sd = max(chosen, least), max(math.sqrt(spread2), least)
        return Inertial(
            estimate, resting, speed, p0, began, drift_sd, bias_sd, self.tilt_sd, self.tilt_var, chosen
        )  # fmt: skip


def _vertical_sd(estimate: Sweep) -> float:
    """Standard deviation of the bias about the vertical, rad/s: the median over a pass."""
    vertical = dcm_from_quat(estimate.q)[:, 2, :]
    return math.sqrt(float(np.median(np.einsum("ki,kij,kj->k", vertical, estimate.cov[:, 3:, 3:], vertical))))
