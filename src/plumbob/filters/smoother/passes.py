"""The passes over a recording: inertial, a field that turns with the sensor, its heading, and all sensors twice."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg
from plumbob.filters.smoother.field import (
    APART,
    DOUBTS,
    Reference,
    bias_of_drift,
    contradictions,
    direction_scatter,
    find_reference,
    heading_turn,
    heading_variance,
    share_of_rest,
    weights,
)
from plumbob.filters.smoother.inertial import (
    AGAIN_BIAS,
    BY_CHANCE,
    NO_ERROR,
    PIECE,
    USUAL_SPEED,
    Beginning,
    Given,
    Inertial,
    calm,
    kinds,
    known_along,
    level_speed,
    narrowed,
)
from plumbob.filters.smoother.keyframes import CORRELATED, Bools, Keyframes, between
from plumbob.filters.smoother.model import (
    BIAS_REPEATS,
    B,
    M,
    ModelVariances,
    Params,
    as_delivered,
    hides_rest,
    may_be_delivered,
    start_covariance,
)
from plumbob.filters.smoother.sensor_fixed_field import Attached, attached_field
from plumbob.filters.smoother.sweeps import Sweep, sweep
from plumbob.rotations import Frame, dcm_from_quat
from plumbob.rotations.frames import turn_heading

AGAIN_TILT, AGAIN_HEADING = deg(3.0), deg(30.0)
"""Standard deviations of a smoothed attitude that is taken for a start, rad."""
PASSES: Final = 2
DECISIVE: Final = -math.log(BY_CHANCE)  # logarithm of odds that decide
UNLIKELY, NEVER = 7.81, 16.27
"""Squares of three scales that one unit in twenty exceeds, and one in a thousand, in their variance."""
CLEARER: Final = 0.5  # a recording has shown a parameter if its standard deviation is at most this share of what it was
UNEVEN: Final = 1.0  # a field of the unit is known to this, µT: an uneven field of the place looks like one
SURELY: Final = 3.0  # fields that are not believed for so long, s, may say that the bias has jumped;
LATELY: Final = 15.0
"""it is sought in no more than this, s."""
DISBELIEVED, BELIEVED = 0.25, 0.5
"""The last seconds contradict what came before if their fields are believed less than this; else more;"""
FASTER, SLOWER = 1.5, 0.5
"""and if the body seems to move so many times faster than before, but by these seconds alone not by so much."""
NOT_GRAVITY: Final = 0.5 * G0
"""Over a `PIECE` the mean specific force differs by less than this from gravity, m/s², also where peaks are cut off."""
LONGEST_SEEN: Final = 300.0
"""A field that was seen for long counts as if for this, s, so that another one can follow it."""


@dataclass(frozen=True, slots=True)
class Known:
    """What is known before a recording, or a stretch of one, is smoothed."""

    # (12, 12), what the unit's card leaves of bias, rad/s, and matrix of the gyroscope: their covariance
    unit: Floats | None = None
    # (3,), bias of the gyroscope at the end of the stretch before, rad/s, and what no rest showed of it
    bias: tuple[Floats, float] | None = None
    reference: Reference | None = None  # the field of the place in the stretches before
    weight: float = 0.0  # weight of that, s of turning in it
    start: Given | None = None  # the first attitude
    any_bias: bool = False  # whether the bias has jumped: large ones are then as likely as small ones
    # (3,), bias where the stretch begins, rad/s, and its covariance, by nothing but what came before
    before: tuple[Floats, Floats] | None = None
    delivered: float = 0.0  # logarithm of the odds that the unit is as delivered, by what came before
    matrix: Floats | None = None  # (9,), and the scale and misalignment that it has shown then

    def after(self, smoothed: "Smoothed") -> "Known":
        """What is known after a stretch."""
        weight = max(self.weight, float(smoothed.frames.step @ smoothed.weight))
        return replace(
            self,
            bias=(smoothed.sweep.bias[-1], smoothed.bias_sd),
            reference=smoothed.reference or self.reference,
            weight=min(weight, LONGEST_SEEN),
            delivered=smoothed.delivered,
            matrix=smoothed.sweep.matrix,
        )


@dataclass(frozen=True, slots=True)
class Smoothed:
    """What the smoother found, at the keyframes."""

    frames: Keyframes  # samples and steps
    sweep: Sweep  # the last pass
    resting: Bools  # (K,), steps at rest
    reference: Reference | None  # the field of the place; None where no field gives the heading
    weight: Floats  # (K,), how far the field of each step was believed
    attached: Attached | None  # field that turns with the sensor
    prior: Floats  # (21, 21), covariance that the last pass began with
    began: Floats  # (9,), and scale and misalignment
    doubt: Floats  # (7,), what contradicts the last attitude: see `contradict`
    # by how much the heading would be another one if the reference's rival were the field of the place, rad
    rival_turn: float = 0.0
    iron_turn: float = 0.0  # and by how much, if a small field that seems to turn with the unit were taken off
    scatter: float = 0.0  # by how much the direction of the field scatters beyond what was expected of it, rad
    bias_sd: float = 0.0  # standard deviation of a bias about the vertical that neither rest nor field showed, rad/s
    tilt_var: float = 0.0  # variance of the tilt, rad², by what contradicts a given one and is too short to decide
    delivered: float = 0.0  # logarithm of the odds that the unit is as delivered, and not calibrated
    start: Given | None = None  # behind a jump of the bias: the first attitude, and the bias from then on

    @property
    def learned(self) -> "Learned":
        """What the recording showed of the gyroscope.

        What it left about as unknown as it was, stays as it was: a guess within its prior would mislead the next one.
        """
        cov, prior = self.sweep.unit_cov.copy(), self.prior[M:, M:]
        blind = np.diag(cov)[3:] > (CLEARER**2) * np.diag(prior)
        matrix = np.where(blind, 0.0, self.sweep.matrix).reshape(3, 3)
        place = 3 + np.flatnonzero(blind)
        cov[place, :], cov[:, place] = 0.0, 0.0
        cov[place, place] = np.diag(prior)[place - 3]
        return Learned(matrix, cov, self.sweep.bias[-1].copy())

    @property
    def weightless(self) -> Bools:
        """Steps in whose piece of the recording the mean force in navigation axes is not gravity, (K,).

        Over ten seconds a level speed that is bounded leaves nothing else: free fall, a centrifuge, a wrong attitude.
        """
        piece, dt = self.frames.pieces(PIECE), np.where(self.frames.gap, 0.0, self.frames.step)
        length = np.bincount(piece, dt)
        total = np.stack([np.bincount(piece, dt * of) for of in self.sweep.force.T], axis=1)
        off = np.linalg.norm(total / np.maximum(length, 1e-9)[:, np.newaxis] - [0.0, 0.0, G0], axis=1)
        return np.asarray(((off > NOT_GRAVITY) & (length > 0.5 * PIECE))[piece])

    @property
    def heading_var(self) -> float:
        """Variance of the heading, rad², by what may be otherwise: the field of the place, and one of the unit."""
        share = 0.0 if self.reference is None else self.reference.rival_share
        return share * self.rival_turn**2 + self.iron_turn**2 + self.scatter**2


class Learned(NamedTuple):
    """Scale and misalignment of a gyroscope (3, 3), the covariance (12, 12) of bias and these, and its last bias."""

    matrix: Floats
    cov: Floats
    bias: Floats


def smooth(frames: Keyframes, p: Params, prior: Known) -> Smoothed:
    """Smooth a recording, or a stretch of one that others came before.

    A unit without a card is taken for a calibrated one, unless what it does says that it is as delivered.
    """
    behind = prior.start if prior.start is not None and prior.start.bias is not None else None
    if prior.unit is not None:
        sd = math.sqrt(float(np.trace(prior.unit[:3, :3])) / 3.0 + BIAS_REPEATS**2)
        p = p if prior.any_bias or behind else p._replace(bias_start=min(p.bias_start, sd))
    elif hides_rest(p, frames.digit):  # what is cut off is as good as noise that lasts as long as rates stay alike
        p = as_delivered(p)._replace(gyr_noise=math.hypot(p.gyr_noise, frames.digit * math.sqrt(CORRELATED / 12.0)))
    elif prior.delivered > DECISIVE:
        p = as_delivered(p)
    together = frames.drifting().together()
    begins = partial(
        Beginning.from_frames, together, prior=prior.bias, unit=prior.unit, given=prior.start, any_bias=prior.any_bias,
        before=prior.before, matrix=NO_ERROR if prior.matrix is None else prior.matrix,
    )  # fmt: skip
    begin = begins(p=p)
    inertial = begin.level(p)
    if behind and begin.resting.any() and inertial.speed.rms() > USUAL_SPEED:
        moving = begins(p=p._replace(rest_rate=0.0))
        if (other := moving.level(p)).speed.rms() < SLOWER * inertial.speed.rms():  # a slow turn looked like a rest
            begin, inertial = moving, other
    smoothed = _with_all(p, prior, begin, inertial)
    if prior.unit is not None or not may_be_delivered(p):
        smoothed = replace(smoothed, delivered=prior.delivered)
    else:
        smoothed = replace(smoothed, delivered=_delivered_odds(smoothed, p))
        if smoothed.delivered >= -DECISIVE or inertial.speed.rms() > USUAL_SPEED:  # or gravity is taken for speed
            smoothed = _as_it_is(p, prior, begin, inertial, smoothed)
    return replace(smoothed, frames=frames, start=behind and behind._replace(bias=smoothed.sweep.bias[0]))


def _as_it_is(p: Params, prior: Known, begin: Beginning, inertial: Inertial, calibrated: Smoothed) -> Smoothed:
    """The same of a unit as delivered, where its scales say that it is one.

    They are asked without the field, whatever a calibrated unit makes of it, then with it. The speed of the body tells
    as much: a wrong scale turns gravity into one, and no hand is slowed to half of it by a scale; a walk, a wave or an
    arm that is guided say wrong things of a scale without a field. There the speed alone decides, and everywhere if it
    is beyond the usual. The scale that slows a body so is where the passes with a field begin: from none these would
    take the same turns of gravity for speed.
    """
    wide = as_delivered(p)
    other = begin.level(wide, inertial.first_sd)
    slower = other.speed.rms() < SLOWER * inertial.speed.rms()
    beyond = calibrated.delivered > 0.0 and not _is_of_a_unit(calibrated.sweep, p, UNLIKELY)
    misled = slower and inertial.speed.rms() > USUAL_SPEED
    least = -math.inf if misled else 0.0 if slower or beyond else DECISIVE
    odds = max(_delivered_odds(other, p), calibrated.delivered)
    possible = _is_of_a_unit(other.sweep, wide, UNLIKELY)
    if possible and odds > least and (slower or calibrated.reference is not None):
        smoothed = _with_all(wide, prior, begin, replace(other, began=other.sweep.matrix) if slower else other)
        odds, possible = _delivered_odds(smoothed, p), _is_of_a_unit(smoothed.sweep, wide, NEVER)
        lost = smoothed.reference is None and calibrated.reference is not None
        if possible and odds > least and not lost:
            return replace(smoothed, delivered=odds)
    return replace(calibrated, delivered=min(calibrated.delivered, DECISIVE) if possible else -DECISIVE)


def _with_all(p: Params, prior: Known, begin: Beginning, inertial: Inertial) -> Smoothed:
    """Smooth with the field too, where one gives the heading, from the passes without it."""
    frames = begin.frames
    if np.isfinite(frames.mag[:, 0]).any():
        field = inertial.sweep.field
        headed = _headed(frames, p, inertial, field, np.zeros(frames.gap.size, dtype=bool), prior)
        attached = attached_field(frames, *_attitude_paths(frames, inertial, headed))
        if attached.present:
            frames = frames.without(attached.field)
            field = _mean_field(frames, inertial.sweep, inertial.resting)
            headed = _headed(frames, p, inertial, field, attached.doubtful, prior)
        if headed is not None:
            smoothed = _with_field(frames, p, inertial, field, headed, attached, prior)
            return replace(smoothed, iron_turn=_iron_turn(frames, p, inertial, headed, attached, prior))
    return Smoothed(
        frames, inertial.sweep, inertial.resting, None, np.zeros(frames.gap.size), None, inertial.prior,
        inertial.began, np.zeros(DOUBTS), bias_sd=inertial.bias_sd, tilt_var=inertial.tilt_var,
    )  # fmt: skip


def _delivered_odds(of: Inertial | Smoothed, p: Params) -> float:
    """Logarithm of the odds that a unit is as delivered and not calibrated, by a pass's scales [Jeffreys1961].

    What the recording says is the posterior without the prior of that pass. Angles between axes are not asked: soft
    iron looks alike.
    """
    variance, before = np.diag(of.sweep.unit_cov)[3::4], np.diag(of.prior)[M::4]
    said = of.sweep.matrix[::4] / variance - of.began[::4] / before
    sd = np.array([[p.gyr_scale], [as_delivered(p).gyr_scale]])
    precision = 1.0 / variance + sd**-2 - 1.0 / before
    evidence = np.sum(said**2 / precision - np.log(precision * sd**2), axis=1)
    return 0.5 * float(evidence[1] - evidence[0])


def _is_of_a_unit(sweep: Sweep, p: Params, unlikely: float) -> bool:
    """Whether the scale that a pass found is one that such units have, by its square in their variance.

    On waves the body's way goes with its tilt, and hides that: a scale of some ten per cent seems to take it away.
    """
    scale = sweep.matrix[::4]
    return bool(scale @ scale < unlikely * p.gyr_scale**2)


def smooth_lately(frames: Keyframes, p: Params, prior: Known) -> Smoothed:
    """Smooth a recording, or no more than its last seconds, where the bias has become another one before these.

    What came before then contradicts gravity and field of these seconds, and they alone do neither. A foreign field
    does not change how fast the body seems to move, and hard motion not the field. What came before says at which
    attitude they begin.
    """
    smoothed = smooth(frames, p, prior)
    if (reference := smoothed.reference) is None or (n := _disbelieved(smoothed)) == 0:
        return smoothed
    before, lately = slice(0, -n), slice(frames.gap.size - n, None)
    fast = max(FASTER * _speed(smoothed, before), USUAL_SPEED)
    if believed(smoothed, before) < BELIEVED or _speed(smoothed, lately) < fast:
        return smoothed
    last = smooth(frames.part(before), p, prior).sweep.last
    start = Given(last.attitude, headed=True, bias=last.state[B : B + 3])
    other = smooth(frames.part(lately), p, replace(prior, any_bias=True, start=start))
    if other.reference is None or other.reference.apart(reference) > APART * p.mag_spread:
        return smoothed
    agrees = believed(other) > BELIEVED and _speed(other) < SLOWER * _speed(smoothed, lately)
    return other if agrees else smoothed


def _disbelieved(smoothed: Smoothed) -> int:
    """How many steps at the end have fields that are not believed, from where belief ends [Page1954]; none if few."""
    step = smoothed.frames.step[::-1]
    length = np.cumsum(step)
    against = np.cumsum(step * (BELIEVED - smoothed.weight[::-1]))
    k = int(np.argmax(np.where(length <= LATELY, against, -math.inf)))
    enough = SURELY <= length[k] <= length[-1] - SURELY and against[k] >= (BELIEVED - DISBELIEVED) * length[k]
    return k + 1 if enough else 0


def believed(smoothed: Smoothed, steps: slice = slice(None)) -> float:
    """How far the fields of some steps were believed, 0 to 1."""
    dt = smoothed.frames.step[steps]
    return float(dt @ smoothed.weight[steps] / max(dt.sum(), 1e-9))


def _speed(smoothed: Smoothed, steps: slice = slice(None)) -> float:
    """Root mean square of the level speed in some steps, m/s."""
    return level_speed(smoothed.frames, smoothed.sweep.force[:, :2]).rms(steps)


class _Headed(NamedTuple):
    """The field of the place, and the turn about the vertical that brings it north at each step, (K,), rad."""

    reference: Reference
    turn: Floats


def _headed(
    frames: Keyframes, p: Params, inertial: Inertial, field: Floats, doubtful: Bools, prior: Known
) -> _Headed | None:
    """Heading of an attitude without one, by fields (K, 3) in its axes; None where no field gives any."""
    if (reference := find_reference(frames, p, field, inertial, doubtful, prior.reference, prior.weight)) is None:
        return None
    weight = weights(reference, p, field, doubtful, directed=False) * share_of_rest(frames, inertial)
    return _Headed(
        reference, heading_turn(frames, inertial, field, weight, heading_variance(frames, p, reference, weight))
    )


def _attitude_paths(frames: Keyframes, inertial: Inertial, headed: _Headed | None) -> Iterator[Floats]:
    """Attitudes halfway to every sample, (N, 4): the one without heading, and one whose heading follows the field.

    An unknown vertical bias turns a field of the place in the first, and what turns evenly in a few seconds looks like
    a field of the sensor; and the second follows a field of the sensor.
    """
    q = _halfway(at_samples(frames, inertial.sweep, inertial.resting))
    yield q
    if headed is not None:
        yield turn_heading(q, -np.interp(frames.t, frames.middle, headed.turn), Frame.ENU)


def _halfway(q: Floats) -> Floats:
    """Attitudes (N, 4) halfway from the sample before, to which a sample belongs; the first has none before it."""
    both = np.concatenate((2.0 * q[:1], q[:-1] + q[1:]))
    return np.asarray(both / np.linalg.norm(both, axis=1, keepdims=True))


def _with_field(
    frames: Keyframes,
    p: Params,
    inertial: Inertial,
    field: Floats,
    headed: _Headed,
    attached: Attached,
    prior: Known,
) -> Smoothed:
    """All sensors, from the attitude without heading and the heading that the field gives it."""
    reference, turn = headed
    by = np.concatenate((turn[:1], turn))
    q = turn_heading(inertial.sweep.q, -by, Frame.ENU)
    free, field = field, np.stack((*_turn_level(turn, field), field[:, 2]), axis=1)
    bias = inertial.sweep.bias + bias_of_drift(frames, inertial, turn)
    speed, resting, estimate = inertial.speed, inertial.resting, inertial.sweep
    p0 = start_covariance(p, tilt=AGAIN_TILT, heading=AGAIN_HEADING, bias=AGAIN_BIAS, rigid=False, unit=prior.unit)
    still, first = calm(frames, p), narrowed(p0, inertial.given_sd)
    for remaining in range(PASSES, 0, -1):
        latest = Inertial(estimate, resting, speed, p0, inertial.began)
        reference = (
            find_reference(frames, p, field, latest, attached.doubtful, prior.reference, prior.weight) or reference
        )
        weight = weights(reference, p, field, attached.doubtful, directed=True)
        resting = still.at_bias(p, bias[1:])
        var = heading_variance(frames, p, reference, weight)
        noise = ModelVariances.from_params(p, reference.bend(p))
        kind, density = kinds(frames, resting), speed.density(p, resting)
        begin, began = bias[0], first
        if inertial.bias_sd > 0.0 and inertial.drift_sd < AGAIN_BIAS:
            up = dcm_from_quat(q[:1])[0, 2]
            # Only the field shows the part along `up`. A pass that began with what the field showed the one before
            # would count it twice, and what is known of a gyroscope never: a turning field would be followed.
            began, begin = known_along(first, begin, up, inertial.sweep.bias[0], inertial.drift_sd)
        estimate = sweep(
            frames, kind, density, speed.lasting(frames.step, resting), var, q, begin, inertial.began, p0, noise,
            first=began, covariance=remaining == 1 and p.lag is None,  # else only the end counts
        )  # fmt: skip
        speed, q, bias, field = level_speed(frames, estimate.force[:, :2]), estimate.q, estimate.bias, estimate.field
    rival_turn = _rival_turn(frames, p, inertial, free, reference)
    scatter = direction_scatter(frames, p, reference, estimate.field, weight)
    doubt = np.zeros(DOUBTS)
    contradictions(estimate.field, frames.step, reference.level, reference.vertical, reference.spread(p), doubt)
    return Smoothed(
        frames, estimate, resting, reference, weight, attached, p0, inertial.began, doubt, rival_turn, scatter=scatter,
        bias_sd=inertial.bias_sd, tilt_var=inertial.tilt_var,
    )  # fmt: skip


def _iron_turn(frames: Keyframes, p: Params, inertial: Inertial, headed: _Headed, fit: Attached, prior: Known) -> float:
    """Root mean square, rad, by which the heading changes if a small field of the unit is taken off."""
    if fit.iron.any():
        return UNEVEN / headed.reference.level
    if not fit.suspect.any():
        return 0.0
    freed = frames.without(np.tile(fit.suspect, (frames.gap.size, 1)))
    field = _mean_field(freed, inertial.sweep, inertial.resting)
    if (other := _headed(freed, p, inertial, field, fit.doubtful, prior)) is None:
        return 0.0
    change = 2.0 * np.sin(0.5 * (other.turn - headed.turn))
    return math.sqrt(float(np.mean(change**2)))


def _rival_turn(frames: Keyframes, p: Params, inertial: Inertial, field: Floats, reference: Reference) -> float:
    """Azimuth, rad, of the rival's fields where the heading is that of the reference's alone.

    Any where only samples before this stretch had the rival.
    """
    if reference.rival is None:
        return 0.0
    near = Reference(*reference.rival, 0.0).off(field) < p.mag_spread
    if not near.any():
        return math.pi
    alone = weights(replace(reference, median=0.0), p, field, near, directed=False)
    east, north = _turn_level(
        heading_turn(frames, inertial, field, alone, heading_variance(frames, p, reference, alone)), field
    )
    return abs(math.atan2(float(east[near].sum()), float(north[near].sum())))


def _turn_level(by: Floats, field: Floats) -> tuple[Floats, Floats]:
    """Level part of fields turned about the vertical."""
    c, s = np.cos(by), np.sin(by)
    return c * field[:, 0] - s * field[:, 1], s * field[:, 0] + c * field[:, 1]


def rates(frames: Keyframes, estimate: Sweep) -> Floats:
    """Corrected rates of the samples, rad/s, (N, 3)."""
    place = np.repeat(np.arange(frames.gap.size), np.diff(frames.first))
    bias = estimate.bias[np.concatenate(([0], place))]
    rate: Floats = frames.gyr - bias - frames.gyr @ estimate.matrix.reshape(3, 3).T
    return rate


def at_samples(frames: Keyframes, estimate: Sweep, resting: Bools, rate: Floats | None = None) -> Floats:
    """Attitude at every sample, (N, 4); `rate` are its `rates`, where they are at hand."""
    return between(frames, ~resting & ~frames.gap, estimate.q, rates(frames, estimate) if rate is None else rate)


def _mean_field(frames: Keyframes, estimate: Sweep, resting: Bools) -> Floats:
    """Mean field of each step in navigation axes, (K, 3), NaN where there was none."""
    middle = _halfway(at_samples(frames, estimate, resting))[1:]
    has_field = np.isfinite(frames.mag[1:, 0])
    field = (dcm_from_quat(middle) @ np.where(has_field[:, np.newaxis], frames.mag[1:], 0.0)[:, :, np.newaxis])[:, :, 0]
    start = frames.first[:-1]
    count = np.add.reduceat(has_field.astype(float), start)
    total = np.add.reduceat(field * has_field[:, np.newaxis], start, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean: Floats = total / count[:, np.newaxis]
    mean[frames.gap] = np.nan
    return mean
