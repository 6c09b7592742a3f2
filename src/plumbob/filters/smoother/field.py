"""What the magnetometer says: the reference field, how far each field is to be believed, and the heading."""

import math
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.units import deg, dps
from plumbob.filters.smoother.inertial import LEAK, PIECE, Inertial
from plumbob.filters.smoother.keyframes import Bools, Keyframes
from plumbob.filters.smoother.model import Params
from plumbob.filters.smoother.sweeps import UNUSED
from plumbob.rotations import dcm_from_quat

TURNING: Final = dps(20.0)
"""A field that is seen while the unit turns so fast counts in full for the reference: a magnet nearby would show."""
REST_SHARE: Final = 0.8  # all rest together counts at most so much of all turning,
LEAST_TURNING: Final = 1.0
"""once there is so much of it, s."""
STEEPEST: Final = 0.05  # a field whose level part is a smaller share than this of the reference's has no direction,
LEAST_LEVEL: Final = 0.1
"""nor has one whose level part is smaller than this, µT."""
MOST_LEVEL: Final = 46.0
"""The field of no place has a larger level part, µT: 41.9 in the Andaman Sea by the WMM 2025, and a tenth,"""
WEAKEST, STRONGEST = 20.0, 75.0
"""nor another size, µT: 22.0 to 66.9, and a tenth. A unit that reads such a field is near a magnet, or carries one."""
MODES: Final = 400  # fields that are tried as a mode
WIDER: Final = 1.5  # a field may differ from the reference by this many medians of what they do, or `mag_spread`,
WIDER_SOON: Final = 2.0
"""with a lag by so many of those that are near it: a disturbance may last for most of what is known by now;"""
WIDEST: Final = 0.2
"""but not by more than this share of the field: what is farther off is another one."""
USUAL_SHARE: Final = 0.8
LEAST_NOISE: Final = 0.2
"""White noise of the field is this share of its median deviation; never less than that of `mag_noise`."""
UNTOLD: Final = 2.0  # of a stream it is so many times that
LEAST_BEND: Final = deg(1.0)
APART: Final = 3.0  # two fields are two if they are so many `mag_spread` apart;
RIVAL: Final = 0.35
"""the weaker one is a rival from this share of the weight of both on."""
IGNORED: Final = 1e-4  # a weight below this is none


@kernel
def on_earth(level: float, vertical: float) -> bool:
    """Whether the field of any place may have these parts, µT; also of arrays through ``.py_func``."""
    size2 = level * level + vertical * vertical
    return (level < MOST_LEVEL) & (size2 > WEAKEST * WEAKEST) & (size2 < STRONGEST * STRONGEST)


@dataclass(frozen=True, slots=True)
class Reference:
    """Field that belongs to the place."""

    # level, vertical: its level part, and the vertical one (up), µT
    level: float
    vertical: float
    median: float  # median deviation from it, µT
    rival: tuple[float, float] | None = None  # level and vertical part of another field that has nearly the same weight
    rival_share: float = 0.0  # share of the rival in the weight of both

    def apart(self, other: Self) -> float:
        """How far another reference lies from this one, µT."""
        return math.hypot(self.level - other.level, self.vertical - other.vertical)

    def off(self, field: Floats) -> Floats:
        """How far fields (K, 3) in navigation axes are off in size and dip, µT, whatever their direction."""
        deviation: Floats = np.hypot(np.hypot(field[:, 0], field[:, 1]) - self.level, field[:, 2] - self.vertical)
        return deviation

    def spread(self, p: Params) -> float:
        """Deviation at which a field counts with a quarter, µT."""
        wider = WIDER if p.lag is None else WIDER_SOON
        return max(p.mag_spread, min(wider * self.median, WIDEST * math.hypot(self.level, self.vertical)))

    def bend(self, p: Params) -> float:
        """Standard deviation of the direction of a field that is right in size and dip, rad."""
        return min(max(self.median / self.level, LEAST_BEND), p.mag_disturbance_sd)


def find_reference(
    frames: Keyframes, p: Params, field: Floats, inertial: Inertial, doubtful: Bools,
    prior: Reference | None = None, seen: float = 0.0,
) -> Reference | None:  # fmt: skip
    """The strongest mode of level and vertical field, weighed by the time that the unit turned in it.

    `frames`: steps; `p`: parameters; `field` (K, 3): mean fields of the steps in navigation axes, whatever their
    heading, µT; `inertial`: where the unit rested, and its bias; `doubtful` (K,): steps whose field is not to be used;
    `prior`: the field of the samples before, and for how long it was `seen`, s. Returns none where no field has a level
    part.
    """
    level, up = np.hypot(field[:, 0], field[:, 1]), field[:, 2]
    turning, resting = times_seen(frames, inertial.resting, inertial.sweep.bias[1:])
    weight = turning + resting
    usable = np.isfinite(level) & ~doubtful & (weight > 0.0) & on_earth.py_func(level, up)  # type: ignore[arg-type]  # whole arrays
    if not usable.any():
        return None
    points, weight = np.stack((level[usable], up[usable]), axis=1), weight[usable]
    if prior is not None:
        points = np.concatenate(([[prior.level, prior.vertical]], points))
        weight = np.concatenate(([seen], weight))
    sharpness = 1.0 / (1.5 * p.mag_spread) ** 2  # of the modes of the field, µT⁻²
    best = _field_mode(points, weight, sharpness)
    for _ in range(10):
        w = weight / (1.0 + ((points - best) ** 2).sum(axis=1) / (2.0 * p.mag_spread) ** 2) ** 2
        best = w @ points / w.sum()
    reference = Reference(float(best[0]), float(best[1]), 0.0)
    if reference.level < max(STEEPEST * math.hypot(*best), LEAST_LEVEL):
        return None
    off = reference.off(field)[~doubtful]
    off = off[np.isfinite(off)]
    reference = replace(reference, median=float(np.median(off)))
    if p.lag is not None:
        reference = replace(reference, median=weighted_median(off, 1.0 / (1.0 + (off / reference.spread(p)) ** 2) ** 2))
    return Reference(reference.level, reference.vertical, reference.median, *_rival(points, weight, best, sharpness, p))


def weighted_median(values: Floats, weight: Floats) -> float:
    """Median (K,) by weight."""
    order = np.argsort(values)
    share = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(share, 0.5 * share[-1])])


def turning_time(frames: Keyframes, bias: Floats | float, resting: Bools) -> Floats:
    """For how long the field of each step counts as one in which the unit turns, (K,), s."""
    rate = np.linalg.norm(frames.mean(frames.gyr) - bias, axis=1)
    return np.where(resting, 0.0, np.minimum(rate / TURNING, 1.0) * frames.step)


def times_seen(frames: Keyframes, resting: Bools, bias: Floats) -> tuple[Floats, Floats]:
    """For how long the field of each step counts, s, as one in which the unit turns, and as one at rest: (K,) each."""
    turning = turning_time(frames, bias, resting)
    at_rest = np.where(resting, frames.step, 0.0)
    all_turning, all_rest = float(turning.sum()), float(at_rest.sum())
    if all_turning > LEAST_TURNING and all_rest > 0.0:
        at_rest *= min(1.0, REST_SHARE * all_turning / all_rest)
    return turning, at_rest


def share_of_rest(frames: Keyframes, inertial: Inertial) -> Floats:
    """How much of each step counts for the heading, (K,): all that is seen at rest is one view of the field."""
    _, at_rest = times_seen(frames, inertial.resting, inertial.sweep.bias[1:])
    return np.where(inertial.resting, at_rest / frames.step, 1.0)


def _rival(
    points: Floats, weight: Floats, best: Floats, sharpness: float, p: Params
) -> tuple[tuple[float, float] | None, float]:
    """Another mode that is nearly as strong, and its share of both."""
    far = np.linalg.norm(points - best, axis=1) > APART * p.mag_spread
    if not far.any():
        return None, 0.0
    other = _field_mode(points[far], weight[far], sharpness)

    def strength(centre: Floats) -> float:
        return float(np.sum(weight / (1.0 + sharpness * ((points - centre) ** 2).sum(axis=1)) ** 2))

    share = strength(other) / (strength(other) + strength(best))
    return ((float(other[0]), float(other[1])), share) if share > RIVAL else (None, 0.0)


def _field_mode(points: Floats, weight: Floats, sharpness: float) -> Floats:
    """Point (2,) near which most of the weight lies."""
    return np.asarray(points[mode(points, weight, max(1, len(points) // MODES), sharpness)])


@kernel
def mode(points: Floats, weight: Floats, stride: int, sharpness: float) -> int:
    """Place of the point, of every so many, near which most of the weight lies."""
    best, most = 0, -1.0
    for i in range(0, points.shape[0], stride):
        near = 0.0
        for j in range(points.shape[0]):
            dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            off = 1.0 + sharpness * (dx * dx + dy * dy)
            near += weight[j] / (off * off)
        if near > most:
            best, most = i, near
    return best


def weights(reference: Reference, p: Params, field: Floats, doubtful: Bools, *, directed: bool) -> Floats:
    """How far each field (K, 3) is believed, 0 to 1: by size and dip, and where `directed` by direction too."""
    off2 = reference.off(field) ** 2
    if directed:  # half the chord to north: a reversed field of the right size is none
        half = reference.level * np.abs(np.sin(0.5 * np.arctan2(field[:, 0], field[:, 1])))
        off2 = off2 + half**2
    usable = np.isfinite(off2) & ~doubtful
    usable &= np.hypot(field[:, 0], field[:, 1]) > STEEPEST * reference.level
    return np.where(usable, 1.0 / (1.0 + off2 / reference.spread(p) ** 2) ** 2, 0.0)


ODDS: Final = 0  # logarithm of how much likelier than at first it is that the attitude is wrong, and not the field;
BEFORE: Final = 1  # the field for which that was weighed last, east, north and up, µT;
LASTS: Final = 4  # for how much longer fields have contradicted than agreed, s;
TILT2: Final = 5  # and variances of tilt and heading by what is in doubt, rad²
HEADING2: Final = 6
DOUBTS: Final = 7
RARE: Final = math.log(1.0 / 30.0)
"""Of so many fields that contradict one does because the attitude is wrong: a prior, which half a second outweighs;"""
SURE: Final = 8.0
"""no odds count for more than this, or the end of a fault would not be seen."""


@kernel
def contradict(doubt: Floats, field: Floats, dt: float, level: float, vertical: float, spread: float) -> float:
    """Weigh what is wrong, a field (3,) in navigation axes, µT, or the attitude that brings it there.

    A disturbance changes the size of a field by anything up to its own, a wrong attitude changes its direction alone.
    That counts each time as the field has moved by the `spread`, since a magnet that lies still says nothing new. The
    odds count in the variances of tilt and heading: dip is tilt, and azimuth as far as gravity has not corrected that.
    Returns the variance of a heading that is surely wrong, rad².
    """
    east, north, up = field[0], field[1], field[2]
    apart2, spread2, moved2 = east**2 + (north - level) ** 2 + (up - vertical) ** 2, spread * spread, 0.0
    for i in range(3):
        moved2 += (field[i] - doubt[BEFORE + i]) ** 2
    if apart2 < spread2:
        doubt[ODDS] *= math.exp(-dt / LEAK)
        doubt[LASTS] = max(doubt[LASTS] - dt, 0.0)
    else:
        doubt[LASTS] += dt
        if moved2 > spread2:
            grown = math.hypot(math.hypot(east, north), up) - math.hypot(level, vertical)
            ratio = 4.0 / math.pi * math.sqrt(apart2 / spread2) / (1.0 + grown * grown / spread2) ** 2
            doubt[ODDS] = min(max(doubt[ODDS] + math.log(ratio), 0.0), SURE)
            for i in range(3):
                doubt[BEFORE + i] = field[i]
    beyond = apart2 / (apart2 + spread2)
    share = beyond / (1.0 + math.exp(-RARE - doubt[ODDS]))
    azimuth, dip = math.atan2(east, north), math.atan2(up, math.hypot(east, north)) - math.atan2(vertical, level)
    steep, uncorrected = vertical / level, min(LEAK / max(doubt[LASTS], dt), 1.0) ** 2
    by_tilt = azimuth * steep * uncorrected / (1.0 + steep * steep * uncorrected)
    fading = math.exp(-2.0 * dt / LEAK)
    doubt[TILT2] = max(fading * doubt[TILT2], share * (dip * dip + 0.5 * by_tilt * by_tilt))
    doubt[HEADING2] = max(fading * doubt[HEADING2], share * azimuth * azimuth)
    return beyond * azimuth * azimuth  # type: ignore[no-any-return]


@kernel
def contradictions(fields: Floats, dt: Floats, level: float, vertical: float, spread: float, doubt: Floats) -> None:
    """What is in doubt behind fields (K, 3)."""
    for k in range(dt.size):
        if not math.isnan(fields[k, 0]):
            contradict(doubt, fields[k], dt[k], level, vertical, spread)


def white_noise(p: Params, reference: Reference) -> float:
    """White noise of the field, µT/√Hz, by how far the fields of the recording are off."""
    if p.lag is None:
        return p.mag_noise * min(max(USUAL_SHARE * reference.median / p.mag_noise, LEAST_NOISE), 1.0)
    return p.mag_noise * UNTOLD  # nothing later shows how large a disturbance is, or no more than the lag of it


def direction_scatter(frames: Keyframes, p: Params, reference: Reference, field: Floats, weight: Floats) -> float:
    """By how much the direction of fields (K, 3) that count scatters beyond what the deflection allows, rad.

    Of means over `PIECE`: what is faster is noise. A field that bends from place to place by so much says no more of
    the heading, however long it is seen.
    """
    piece = frames.pieces(PIECE)
    trust = weight * frames.step
    phasor = np.where(trust > 0.0, trust * np.exp(1j * np.arctan2(field[:, 0], field[:, 1])), 0.0)
    east, north, piece_trust = (np.bincount(piece, of) for of in (phasor.imag, phasor.real, trust))
    if not piece_trust.any():
        return 0.0
    square = float(np.average(np.arctan2(east, north) ** 2, weights=piece_trust))
    return math.sqrt(max(square - reference.bend(p) ** 2, 0.0))


def heading_variance(frames: Keyframes, p: Params, reference: Reference, weight: Floats) -> Floats:
    """Variance of the heading that the mean field of each step shows, rad²; beyond `UNUSED` where none does."""
    with np.errstate(divide="ignore"):
        var = white_noise(p, reference) ** 2 / reference.level**2 / frames.step / weight
    return np.where(weight > IGNORED, var, 2.0 * UNUSED)


PATCH: Final = 30.0  # the rate of the drift is sought in stretches of this, s, whose phases are their own;
PATCHES: Final = 20
SHORT: Final = 0.25  # phasors of so many seconds are taken together: the largest drift turns them by 7.5° meanwhile
MOST_DRIFT: Final = dps(30.0)
LEAST_DRIFT: Final = dps(0.1)
"""where it may be more than this, rad/s."""
DRIFTS: Final = dps(0.3)  # afterwards it may still change: standard deviation of the rate, rad/s;
DRIFT_WALK: Final = dps(0.006)
DRIFT_NOISE: Final = 0.05 * dps(0.3) ** 2
"""white noise of the heading that is integrated, rad²/s;"""
ONE_LOOK: Final = 0.03
"""and of the field's direction, rad² s."""
WIDTHS: Final = 2.0, 1.0, 0.6, 0.35, 0.25, 0.25
"""Directions further off than this, rad, lose their weight: from nearly all of them to those that agree."""
THIRDS: Final = (0.0, 0.34), (0.33, 0.67), (0.66, 1.0)


def heading_turn(frames: Keyframes, inertial: Inertial, field: Floats, weight: Floats, var: Floats) -> Floats:
    """Turn about the vertical, (K,), rad, that brings the field of an attitude without heading north, over time.

    It is a constant that drifts as the gyroscope's bias is wrong. Fields of another direction must not pull it, whether
    they come first or last: it is followed from three starts, each with weights that narrow, and the one that explains
    most stays. `var` (K,): variance of the heading that each field shows, rad².
    """
    time, dt = frames.time[1:], frames.step
    azimuth = np.where(weight > 0.0, np.arctan2(field[:, 0], field[:, 1]), 0.0)
    drift = _drift(frames, azimuth, 1.0 / var, inertial.drift_sd)
    base = drift * (time - time[0])
    turned = azimuth - base
    part = (time - time[0]) / max(time[-1] - time[0], 1e-9)
    best: Floats = np.zeros_like(dt)
    least = math.inf
    for low, high in THIRDS:
        inside = np.where((part >= low) & (part <= high), weight, 0.0)
        offset: Floats = np.full(dt.size, math.atan2(float(inside @ np.sin(turned)), float(inside @ np.cos(turned))))
        for width in WIDTHS:
            off = _wrapped(turned - offset)
            trust = weight / (1.0 + (off / width) ** 2) ** 2
            angle, offset = offset + off, np.empty(dt.size)
            follow(
                dt, angle, trust, frames.gap, DRIFTS, DRIFT_WALK, DRIFT_NOISE, ONE_LOOK, np.empty((dt.size, 10)), offset
            )
        off2 = _wrapped(turned - offset) ** 2
        cost = float(np.sum(weight * dt * off2 / (off2 + WIDTHS[-1] ** 2)))
        if cost < least:
            best, least = offset, cost
    turn: Floats = best + base
    return turn


def bias_of_drift(frames: Keyframes, inertial: Inertial, turn: Floats) -> Floats:
    """Bias, (3,), rad/s, by a drift: a slope through white noise is known to 12 `ONE_LOOK` / T³, rad²/s²."""
    dt, length = frames.step, float(frames.step.sum())
    rate = np.diff(turn, prepend=turn[0]) / dt
    rate[0] = rate[1] if rate.size > 1 else 0.0
    rate[frames.gap] = 0.0
    vertical = dcm_from_quat(inertial.sweep.q[1:])[:, 2, :]
    trust = dt * min(length**2 / (12.0 * ONE_LOOK), 1.0 / (60.0 * dps(0.05) ** 2))  # in a minute at best to 0.05 °/s
    info = np.asarray(np.linalg.inv(inertial.sweep.cov[dt.size // 2, 3:, 3:]))
    normal = info + (vertical * trust[:, np.newaxis]).T @ vertical
    return np.asarray(np.linalg.solve(normal, -vertical.T @ (trust * rate)), dtype=np.float64)


def _drift(frames: Keyframes, azimuth: Floats, precision: Floats, sd: float) -> float:
    """Rate, rad/s, at which the phasors of the field stand still longest: the peak of their periodogram.

    Weighed by the `precision` (K,) of each, 1/rad², that is a log likelihood; the prior of the rate counts with it.
    """
    if sd < LEAST_DRIFT:
        return 0.0
    since = frames.time[1:] - frames.time[1]
    length = float(since[-1])
    patches = min(max(1, int(length // PATCH)), PATCHES)
    count = max(math.ceil(length / patches / SHORT), 1)
    place = np.minimum((since / SHORT).astype(np.intp), patches * count - 1)
    phasor = precision * np.exp(1j * azimuth)
    short = np.bincount(place, phasor.real, patches * count) + 1j * np.bincount(place, phasor.imag, patches * count)
    apart = min(dps(0.05) * PATCH / min(PATCH, max(length, 1.0)), dps(0.5))
    points = max(1 << math.ceil(math.log2(2.0 * math.pi / (SHORT * apart))), count)
    rates = 2.0 * math.pi * np.fft.fftfreq(points, SHORT)
    near = np.abs(rates) <= MOST_DRIFT
    strength = np.abs(np.fft.fft(short.reshape(patches, count), points, axis=1)[:, near]).sum(axis=0)
    return float(rates[near][np.argmax(strength - 0.5 * (rates[near] / sd) ** 2)])


def _wrapped(angle: Floats) -> Floats:
    return np.arctan2(np.sin(angle), np.cos(angle))


@kernel
def follow(
    dt: Floats, angle: Floats, trust: Floats, gap: Bools, rate_sd: float, walk: float, noise: float, look: float,
    history: Floats, out: Floats,
) -> None:  # fmt: skip
    """Smooth an angle that drifts at a rate, both unknown: forward, and back by [Rauch1965]."""
    a, b, p00, p01, p11 = 0.0, 0.0, 10.0, 0.0, rate_sd * rate_sd
    n = dt.size
    for k in range(n):
        h = dt[k]
        if gap[k]:
            p00, p01 = 10.0, 0.0
        else:
            a += h * b
            p00 += 2.0 * h * p01 + h * h * p11 + noise * h
            p01 += h * p11
            p11 += walk * walk * h
        history[k, 0], history[k, 1], history[k, 2], history[k, 3], history[k, 4] = a, b, p00, p01, p11
        if trust[k] > 1e-6:
            s = p00 + look / (trust[k] * h)
            k0, k1, r = p00 / s, p01 / s, angle[k] - a
            a += k0 * r
            b += k1 * r
            p11 -= k1 * p01
            p01 -= k0 * p01
            p00 -= k0 * p00
        history[k, 5], history[k, 6], history[k, 7], history[k, 8], history[k, 9] = a, b, p00, p01, p11
    out[n - 1] = a
    for k in range(n - 2, -1, -1):
        h = dt[k + 1]
        p00, p01, p11 = history[k + 1, 2], history[k + 1, 3], history[k + 1, 4]
        d0, d1, det = a - history[k + 1, 0], b - history[k + 1, 1], p00 * p11 - p01 * p01
        u0, u1 = (p11 * d0 - p01 * d1) / det, (p00 * d1 - p01 * d0) / det
        q00, q01, q11 = history[k, 7], history[k, 8], history[k, 9]
        c00, c01 = (0.0, q01) if gap[k + 1] else (q00 + h * q01, q01)
        c10, c11 = (0.0, q11) if gap[k + 1] else (q01 + h * q11, q11)
        a = history[k, 5] + c00 * u0 + c01 * u1
        b = history[k, 6] + c10 * u0 + c11 * u1
        out[k] = a
