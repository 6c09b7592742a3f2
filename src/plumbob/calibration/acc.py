"""Accelerometer by gravity's length alone: from poses at rest, or from slow tumbling beside a gyroscope.

The poses need no known attitude, only many different ones: n positions on a table, or forty by hand [Tedaldi2014]. The
shape is chosen as far as the poses can tell, and what they cannot is refused or said. The length of a vector fixes no
rotation, so the matrix is symmetric, the one that turns the measured vectors least: how the axes sit in the case is a
matter of the mounting. The classic calibration holds each axis i up, f₊, and down, f₋: its bias is (f₊ + f₋)/2, its
gain (f₊ − f₋)/2 over gravity.

A logger in a hand usually has no rests. Over a window of a second or some, the gyroscope shows how the unit turned, so
that all samples can be turned to the attitude of the window's middle and averaged there. The hand's own acceleration is
a change of velocity, which an average with smooth weights hardly keeps; gravity stays. The window is then a pose. A
constant error of the gyroscope turns the samples before the middle one way and those after it the other, and cancels.
What does not cancel is the centripetal acceleration of a unit that turns about a point beside it: it has the same
direction in the case all the time, as a bias has. Nothing in the capture distinguishes it from one, so it stands in the
prediction.
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration import ellipsoid_fit
from plumbob.calibration.autocorrelation import alike
from plumbob.calibration.ellipsoid_fit import SPARE, Ellipsoid, Shape, mean_radius
from plumbob.calibration.fit import TILT, CaptureRefusedError, Fitted, Reason, grade_of, refuse
from plumbob.calibration.gyr.drift import accumulate, rotation_vectors
from plumbob.calibration.predicted import REGIONS, TILT_RANGE, filled, region_names, tilt_sd
from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import EARTH_RATE, G0, WGS84_A, WGS84_F, WGS84_GM, WGS84_GRAVITY_EQUATOR, WGS84_GRAVITY_POLE
from plumbob.core.errors import ParameterError
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import counted
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.data import ImuData
from plumbob.data.cards import UNITS, Quality, TriadCalibration
from plumbob.quality.static_periods import stills
from plumbob.rotations import quat_conjugate, quat_multiply, quat_rotate

HIGHEST = 20_000.0  # height up to which the series holds to a hundredth of the anomalies, m; and as far down


def normal_gravity(latitude: float, height: float = 0.0) -> float:
    """Gravity of the WGS 84 ellipsoid, m/s²: the closed form of Somigliana, and a series for the height [WGS84].

    By geodetic latitude, rad, and height above the ellipsoid, m; above the sea does, for the geoid's 100 m are 0.0003
    m/s². What mountains and dense rock add is left out: typically 0.0003 m/s² (0.03 mg), 0.003 m/s² at most.
    """
    if not abs(latitude) <= math.pi / 2.0:
        raise ParameterError(f"a latitude must be from −90° to 90°, but it is {to_deg(latitude):g}°.")
    if not abs(height) <= HIGHEST:
        raise ParameterError(f"the height must be within ±{HIGHEST:g} m of the ellipsoid, but it is {height:g} m.")
    polar = WGS84_A * (1.0 - WGS84_F)
    sin2 = math.sin(latitude) ** 2
    k = polar * WGS84_GRAVITY_POLE / (WGS84_A * WGS84_GRAVITY_EQUATOR) - 1.0
    eccentricity2 = WGS84_F * (2.0 - WGS84_F)
    ground = WGS84_GRAVITY_EQUATOR * (1.0 + k * sin2) / math.sqrt(1.0 - eccentricity2 * sin2)  # [WGS84] (4-1)
    m = EARTH_RATE**2 * WGS84_A**2 * polar / WGS84_GM
    slope = 1.0 + WGS84_F + m - 2.0 * WGS84_F * sin2
    return ground * (1.0 - 2.0 * slope * height / WGS84_A + 3.0 * (height / WGS84_A) ** 2)  # [WGS84] (4-3)


NEAR: Final = deg(15.0)  # how far from upright a face may be held, rad


def faces(poses: Floats) -> list[int] | None:
    """Which of six poses (6, 3) is +x, −x, +y, −y, +z, −z; None where they are not one of each within `NEAR`."""
    cosines = REGIONS[:6] @ (poses / np.linalg.norm(poses, axis=1, keepdims=True)).T
    sides = np.argmax(cosines, axis=1)
    one_each = len(poses) == 6 and len(set(sides.tolist())) == 6 and cosines.max(axis=1).min() >= math.cos(NEAR)
    return sides.tolist() if one_each else None


def six_positions(poses: Floats, *, noise: float = 0.0) -> ellipsoid_fit.NormFit | None:
    """Bias and scale by pairs of poses (6, 3), any unit; None where they are not the six faces within 15°.

    It takes faces for upright: one held at the angle θ reads low by 1 − cos θ, 1.4 % at 10°, which the shape of the
    axes does not mind. `noise` is the standard deviation of a mean; what the lengths scatter after the fit is added to
    it.
    """
    order = faces(poses)
    if order is None:
        return None
    read = poses[order].reshape(3, 2, 3)
    up, down = np.diag(read[:, 0]), np.diag(read[:, 1])
    bias, gain = 0.5 * (up + down), 0.5 * (up - down)
    ellipsoid = Ellipsoid(bias, np.diag(1.0 / gain))
    inside = ellipsoid.to_sphere(poses)
    size = np.linalg.norm(inside, axis=1)
    residuals = (size - 1.0) / (np.linalg.norm(inside @ ellipsoid.shape, axis=1) / size)  # orthogonal, to first order
    sd = math.hypot(noise, float(np.sqrt(np.mean(residuals**2))))
    variance = 0.5 * sd**2  # of half the sum, and of half the difference
    covariance = np.diag(np.concatenate((np.full(3, variance), variance / gain**4, np.zeros(3))))
    used = np.ones(6, dtype=np.bool_)
    return ellipsoid_fit.NormFit(
        Shape.AXES, ellipsoid, covariance, sd, residuals, used, 1.0, float(residuals @ residuals)
    )


SHAPES: Final = ("auto", "six", "axes", "ellipsoid")  # what can be asked for
MOST_OUTLIERS: Final = 0.1  # share of poses that may not fit the others
WRONG: Final = 0.1  # relative error of gravity's size above which the unit or the range must be wrong
LIGHTEST, HEAVIEST = G0 - 0.05, G0 + 0.035  # gravity on Earth, m/s²: of high mountains at the equator, and of the poles
FAR_SCALE: Final = 0.05  # relative error of gravity's size beyond which a remark says so: data sheets have ±1 to 3 %
CROSS_AXIS: Final = 0.01  # sensitivity across the axes where it was not fitted: data sheets have ±1 to 2 %
_SIDE: Final = 0.5  # cosine: each axis must have been up, and down, within 60°
_WRONG_UNFITTED: Final = 0.4  # before the bias is known
_SINGULAR: Final = 1e10
_RESTLESS: Final = 3.0
_NAMED: Final = 12  # poses
_WORDS: Final = {
    Shape.SPHERE: "bias and one scale, 4 parameters",
    Shape.AXES: "bias and scale, 6 parameters",
    Shape.ELLIPSOID: "bias, scale and misalignment, 9 parameters",
}
_SMALLEST: Final = {"auto": Shape.AXES, "axes": Shape.AXES, "ellipsoid": Shape.ELLIPSOID}
_ADVICE: Final = "Hold the unit still in 18 poses, each face and each edge of its case once up."


def fit_accel(
    poses: Floats, *, shape: str = "auto", noise: float = 0.0, gravity: float = G0, tilt_range: float = TILT_RANGE
) -> Fitted:
    """Fit the means of poses at rest (N, 3), m/s².

    The shape "ellipsoid" finds bias, scale and misalignment, "axes" bias and scale, as the buoy paper's fit [Yu2018],
    "six" the same by pairs of opposite faces; "auto" takes the ellipsoid where the poses determine it and contradict
    the axes. Where `noise`, the standard deviation of a mean, is known, as many poses as parameters do.
    """
    check.one_of("shape", shape, SHAPES)
    if not LIGHTEST <= gravity <= HEAVIEST:
        raise ParameterError(
            f"gravity on Earth is from {LIGHTEST:.3g} to {HEAVIEST:.3g} m/s², but it was given as {gravity:g} m/s²."
        )
    poses = check.rows("poses", poses, 3)
    refuse(*_unusable(poses, shape, noise, gravity))
    fit, why = _by_shape(poses, shape, noise)
    shared = alike(fit.residuals, fit.ellipsoid.to_sphere(poses), fit.used)
    matrix, covariance = ellipsoid_fit.scaled(fit, gravity, alike=shared.factor)
    tilt = tilt_sd(matrix, covariance, size=gravity, tilt_range=tilt_range)
    refuse(*_untrue(fit, tilt, gravity))
    residuals = np.linalg.norm((poses - fit.ellipsoid.centre) @ matrix, axis=1)[fit.used] - gravity
    calibration = TriadCalibration(
        matrix=matrix,
        bias=fit.ellipsoid.centre,
        unit_in=UNITS["acc"],
        unit_out=UNITS["acc"],
        residual_rms=float(np.sqrt(np.mean(residuals**2))),
        covariance=covariance,
        reference=gravity,
        method=f"accelerometer in {len(poses)} poses: {_WORDS[fit.shape]}{' by pairs' if shape == 'six' else ''}",
        quality=_quality(poses, fit, tilt, tilt_range),
    )
    return Fitted(calibration, poses, fit.residuals, fit.used, _remarks(fit, why, gravity, noise))


def _across(fit: ellipsoid_fit.NormFit) -> float:
    """Standard deviation of the sensitivity across the axes."""
    return float(np.sqrt(np.diag(fit.covariance)[6:].max())) * mean_radius(fit.ellipsoid.shape)


def _by_shape(poses: Floats, shape: str, noise: float) -> tuple[ellipsoid_fit.NormFit, str]:
    """Fit of the shape that is asked for, or that the poses can tell and ask for, and why it is that."""
    if shape == "six":
        fit, why = six_positions(poses, noise=noise), "asked for"
    elif shape != "auto":
        fit, why = _fit(poses, _SMALLEST[shape], noise), "asked for"
    else:
        choice = ellipsoid_fit.choose(poses)
        full = _fit(poses, Shape.ELLIPSOID, noise) if choice is None else choice.full
        # whether the poses say more of the sensitivity across the axes than a data sheet does
        if full is not None and full.condition < _SINGULAR and _across(full) < CROSS_AXIS:
            if choice is None:
                return full, "too few poses to try less"
            covariance = choice.fit.covariance.copy()  # what the smaller one has not is known as in the full one
            covariance[6:, 6:] = full.covariance[6:, 6:]
            return choice.fit._replace(covariance=covariance), choice.why
        fit, why = _fit(poses, Shape.AXES, noise), "the poses do not determine the misalignment"
    if fit is not None:
        return _doubted(fit, poses), why
    if shape != "six":
        raise CaptureRefusedError(Reason("ill-conditioned", "no ellipsoid fits the poses.", _ADVICE))
    text = f"{len(poses)} poses are not the six faces, each once up within 15°."
    advice = "Hold each face up once, exactly, and nothing else; or let the shape be chosen, which takes any poses."
    raise CaptureRefusedError(Reason("ill-conditioned", text, advice))


def _fit(poses: Floats, shape: Shape, noise: float) -> ellipsoid_fit.NormFit | None:
    """Fit from the nominal sensor, which is never far off."""
    if len(poses) < _least(shape, noise):
        return None
    start = Ellipsoid(np.zeros(3), np.eye(3) / float(np.median(np.linalg.norm(poses, axis=1))))
    return ellipsoid_fit.fit_norm(poses, shape, start, robust=len(poses) >= shape.value + SPARE, noise=noise)


def _least(shape: Shape, noise: float) -> int:
    return shape.value if noise > 0.0 else shape.value + 1


def _doubted(fit: ellipsoid_fit.NormFit, poses: Floats) -> ellipsoid_fit.NormFit:
    """Fit of the axes whose covariance counts misalignment as data sheets have it: in itself, and in what it spoils."""
    if fit.shape is Shape.ELLIPSOID:
        return fit
    rows, _ = ellipsoid_fit.linearised(poses[fit.used], fit.ellipsoid)
    spoilt = np.vstack((-np.linalg.lstsq(rows[:, :6], rows[:, 6:], rcond=None)[0], np.eye(3)))
    variance = (CROSS_AXIS / mean_radius(fit.ellipsoid.shape)) ** 2
    return fit._replace(covariance=fit.covariance + variance * spoilt @ spoilt.T)


def _unusable(poses: Floats, shape: str, noise: float, gravity: float) -> tuple[Reason | None, ...]:
    """Reasons that need no fit."""
    if not np.isfinite(poses).all():
        raise CaptureRefusedError(Reason("not-still", "a pose has no finite mean.", "Leave it out."))
    sizes = np.linalg.norm(poses, axis=1)
    wrong = wrong_gravity(float(np.median(sizes)) if sizes.size else gravity, gravity, _WRONG_UNFITTED)
    return wrong, _sides(poses, sizes), _too_few(len(poses), shape, noise)


def _too_few(count: int, shape: str, noise: float) -> Reason | None:
    if shape == "six":
        return None  # it wants six and no other, and says so
    need = _least(_SMALLEST[shape], noise)
    if count >= need:
        return None
    text = f"{counted(count, 'pose')}; {_WORDS[_SMALLEST[shape]]} need {need} at least."
    fewer = "Six faces are enough for bias and scale alone (shape axes)."
    less = f" {fewer}" if shape == "ellipsoid" and count >= Shape.AXES.value else ""
    return Reason("too-few", text, _ADVICE + less)


def _sides(poses: Floats, sizes: Floats) -> Reason | None:
    """Reason to refuse poses that left out a side of the case."""
    cosines = (poses / np.maximum(sizes, np.finfo(float).tiny)[:, np.newaxis]) @ REGIONS[:6].T
    empty = region_names(np.flatnonzero((cosines < _SIDE).all(axis=0)).tolist())
    text = f"no pose had {empty} up within 60°, so bias and scale cannot be separated there."
    advice = f"Hold the unit still with {empty} up as well, one after the other."
    return Reason("too-few-regions", text, advice) if empty else None


def wrong_gravity(size: float, gravity: float, limit: float) -> Reason | None:
    """Reason to refuse a gravity that measures `size`, m/s², and is off by more than `limit`, relative."""
    ratio = size / gravity
    guess = " That is 1 g: the values are in g." if abs(size - 1.0) < 0.1 else ""
    text = f"at rest the sensor measures {size:.4g} m/s², {ratio:.3g} times gravity ({gravity:.5f} m/s²).{guess}"
    advice = "Check the unit of the values and the range that the sensor was set to."
    return None if abs(ratio - 1.0) <= limit else Reason("wrong-gravity", text, advice)


def _untrue(fit: ellipsoid_fit.NormFit, tilt: float, gravity: float) -> tuple[Reason | None, ...]:
    """Reasons not to believe a fit."""
    out = int(np.count_nonzero(~fit.used))
    apart = f"{out} of {fit.used.size} poses do not fit the others (poses {_numbers(fit)})."
    still = "Hold the unit really still in each pose, away from engines."
    text = f"the poses leave an inclination error of {to_deg(tilt):.2g}° (1 sd); condition {fit.condition:.2g}."
    unclear = bool(not tilt <= TILT.poor or fit.condition > _SINGULAR)
    return (
        wrong_gravity(mean_radius(fit.ellipsoid.shape), gravity, WRONG),
        Reason("outliers", apart, still) if out > MOST_OUTLIERS * fit.used.size else None,
        Reason("ill-conditioned", text, _ADVICE) if unclear else None,
    )


def _quality(poses: Floats, fit: ellipsoid_fit.NormFit, tilt: float, tilt_range: float) -> Quality:
    used = int(np.count_nonzero(fit.used))
    grade = grade_of(tilt, TILT) or "poor"
    return Quality(
        grade="fair" if grade == "good" and used < fit.shape.value + SPARE else grade,
        samples=used,
        outliers=len(poses) - used,
        regions=int(np.count_nonzero(filled((poses - fit.ellipsoid.centre)[fit.used]))),
        condition=fit.condition,
        tilt_sd=tilt,
        tilt_range=tilt_range,
    )


def _remarks(fit: ellipsoid_fit.NormFit, why: str, gravity: float, noise: float) -> tuple[Note, ...]:
    notes: list[Note] = [
        info("calibration.shape", shape=_WORDS[fit.shape], why=why),
    ]
    if abs((ratio := mean_radius(fit.ellipsoid.shape) / gravity) - 1.0) > FAR_SCALE:
        notes.append(warning("calibration.far_scale", percent=100.0 * (ratio - 1.0), ratio=ratio))
    if gravity == G0:
        notes.append(info("calibration.standard_gravity"))
    if fit.shape is not Shape.ELLIPSOID:
        notes.append(info("calibration.no_misalignment", sd=to_deg(_across(fit))))
    if np.count_nonzero(fit.used) < fit.shape.value + SPARE:
        notes.append(warning("calibration.few_poses", count=len(fit.used), needed=fit.shape.value + SPARE))
    if noise > 0.0 and fit.sd > _RESTLESS * noise:
        notes.append(warning("calibration.poses_scatter", factor=fit.sd / noise))
    if not fit.used.all():
        notes.append(warning("calibration.poses_set_aside", poses=_numbers(fit), count=len(fit.used)))
    notes.append(info("calibration.gravity_length"))
    return tuple(notes)


def _numbers(fit: ellipsoid_fit.NormFit) -> str:
    out = (np.flatnonzero(~fit.used) + 1).tolist()
    return ", ".join(map(str, out[:_NAMED])) + (", …" if out[_NAMED:] else "")


LENGTHS: Final = (1.0, 2.0, 4.0, 8.0)  # windows that are tried, s; the one with the least predicted error is taken
ARM: Final = 0.2  # rms distance of the unit from the point about which a hand turns it, m: a wrist, or an elbow
MOST_TURN: Final = deg(120.0)  # turn within a window beyond which the gyroscope's own scale would count, rad
FEWEST: Final = 12  # windows
_SHARED: Final = 4.0 / 3.0  # of the variance of windows with Hann's weights that overlap by half: correlation 1/6 twice
_ROUNDS: Final = 8
_GAP: Final = 2.0  # steps by which a window may last longer than its samples say
_TUMBLED: Final = (
    "Turn the unit slowly about all its axes, each face once up, and move it as little as you can; or rest."
)


class EqualStretches(NamedTuple):
    """Stretches of equal length."""

    rows: NDArray[np.int64]  # (W, n), samples of each
    turns: Floats  # (W, n, 4), rotation of each sample's body axes to those of the middle
    weights: Floats  # (n,), Hann's, of sum 1
    rate: Floats  # (W,), mean square of the rate, rad²/s²


def fit_accel_moving(
    t: Floats, acc: Floats, gyr: Floats, *, shape: str = "auto", gravity: float = G0, tilt_range: float = TILT_RANGE
) -> Fitted:
    """Fit bias, scale and misalignment of an accelerometer that was turned slowly and never rested.

    Times increase nearly evenly; a constant bias of the rates of some °/s does no harm.
    """
    check.one_of("shape", shape, [name for name in SHAPES if name != "six"])
    fits: list[tuple[float, Fitted, float]] = []
    refused: CaptureRefusedError | None = None
    attitude = np.empty((len(t), 4))  # body to that of the first sample, by the rates alone
    accumulate(rotation_vectors(gyr, np.diff(t)), attitude)
    for length in LENGTHS:
        windows = _windows(t, gyr, attitude, length)
        if len(windows.rows) < FEWEST:
            continue
        try:
            fits.append((length, *_fit_windows(windows, acc, shape, gravity, tilt_range)))
        except CaptureRefusedError as error:
            refused = refused or error
    if not fits:
        lasting, speed = float(t[-1] - t[0]), to_dps(float(np.sqrt(np.mean(np.sum(gyr**2, axis=1)))))
        text = f"{lasting:.3g} s at {speed:.3g}°/s (rms) have fewer than {FEWEST} windows of slow turning."
        raise refused or CaptureRefusedError(Reason("too-few", text, _TUMBLED))
    length, best, _ = min(fits, key=lambda each: each[2])
    return replace(best, remarks=(info("calibration.moving", windows=len(best.used), length=length), *best.remarks))


def _windows(t: Floats, gyr: Floats, attitude: Floats, length: float) -> EqualStretches:
    """Windows without a gap that overlap by half, and in which the unit does not turn too far."""
    step = float(np.median(np.diff(t)))
    half = max(1, round(0.5 * length / step))
    middles = np.arange(half, len(t) - half, half)
    rows = middles[:, np.newaxis] + np.arange(-half, half + 1)
    speed = np.linalg.norm(gyr, axis=1)
    even = t[rows[:, -1]] - t[rows[:, 0]] < (2 * half + _GAP) * step
    slow = np.mean(speed[rows], axis=1) * length <= MOST_TURN
    rows = rows[even & slow]
    turns = quat_multiply(quat_conjugate(attitude[rows[:, half]])[:, np.newaxis], attitude[rows])
    weights = 1.0 + np.cos(np.pi * np.arange(-half, half + 1) / (half + 1.0))
    return EqualStretches(rows, turns, weights / weights.sum(), np.mean(speed[rows] ** 2, axis=1))


def _fit_windows(
    windows: EqualStretches, acc: Floats, shape: str, gravity: float, tilt_range: float
) -> tuple[Fitted, float]:
    """Fit poses, which depend a little on what is fitted, again and again until they stay; and the predicted tilt."""
    matrix, bias = np.eye(3), np.zeros(3)
    poses = _poses(windows, acc, matrix, bias)
    for _ in range(_ROUNDS):
        start = Ellipsoid(bias, np.asarray(matrix / gravity))
        fit = ellipsoid_fit.fit_norm(poses, Shape.AXES if shape == "axes" else Shape.ELLIPSOID, start)
        if fit is None:
            break
        matrix, bias = np.asarray(gravity * fit.ellipsoid.shape), fit.ellipsoid.centre
        poses = _poses(windows, acc, matrix, bias)
    fitted = fit_accel(poses, shape=shape, gravity=gravity, tilt_range=tilt_range)
    return _widened(fitted, float(np.mean(windows.rate[fitted.used])), gravity, tilt_range)


def _poses(windows: EqualStretches, acc: Floats, matrix: Floats, bias: Floats) -> Floats:
    """What the sensor would measure at rest in the attitude of each middle, (W, 3)."""
    force = quat_rotate(windows.turns, ((acc - bias) @ matrix.T)[windows.rows])
    return np.asarray(np.linalg.solve(matrix, np.einsum("n,wni->iw", windows.weights, force)).T + bias)


def _widened(fitted: Fitted, rate: float, gravity: float, tilt_range: float) -> tuple[Fitted, float]:
    """The fit with what windows share, and with the centripetal acceleration that none of them shows."""
    calibration = fitted.calibration
    unseen = 2.0 / 3.0 * rate * ARM / math.sqrt(3.0)  # the mean of −ω × (ω × l) over directions of ω, along each axis
    assert calibration.covariance is not None and calibration.quality is not None
    covariance = calibration.covariance * _SHARED
    covariance[:3, :3] += unseen**2 * np.eye(3)
    tilt = tilt_sd(calibration.matrix, covariance, size=gravity, tilt_range=tilt_range)
    grade = grade_of(tilt, TILT)
    if grade is None:
        text = f"the motion leaves an inclination error of {to_deg(tilt):.2g}° (1 sd), {_speed(rate)}."
        raise CaptureRefusedError(Reason("ill-conditioned", text, _TUMBLED))
    quality = replace(calibration.quality, tilt_sd=tilt, grade=grade)
    remark = info("calibration.centripetal", speed=_speed(rate), arm=ARM, unseen_mg=unseen / G0 * 1e3)
    method = calibration.method.replace("poses", "windows of slow tumbling")
    triad = replace(calibration, covariance=covariance, quality=quality, method=method)
    return replace(fitted, calibration=triad, remarks=(remark, *fitted.remarks)), tilt


def _speed(rate: float) -> str:
    return f"{to_dps(math.sqrt(rate)):.3g}°/s (rms)"


LEAST: Final = 1.0  # shortest stretch at rest that counts as a pose, s
FEWEST_ROWS: Final = 100  # samples of accelerometer and gyroscope that a capture without rests must have
_PARTS: Final = 4  # of a pose, whose scatter says how well its mean is known


class RestPeriods(NamedTuple):
    """Stretches at rest."""

    means: Floats  # (N, 3), mean specific force of each, m/s²
    noise: float  # standard deviation of a mean's length, m/s², by what the parts of each pose scatter
    spans: tuple[tuple[float, float], ...]  # first and last time of each, s
    temp_c: Floats  # (M,), temperatures at rest, °C; empty where unknown


def calibrate_accel(
    imu: ImuData, *, shape: str = "auto", gravity: float = G0, tilt_range: float = TILT_RANGE, moving: bool = False
) -> Fitted:
    """Fit the accelerometer of a capture by its poses at rest; a gyroscope helps to find them and is not needed.

    Of a unit that tumbled slowly without rests (`moving`) the gyroscope stands in for them. The rest as of `fit_accel`.
    """
    if moving:
        return _tumbled(imu, shape, gravity, tilt_range)
    poses = poses_at_rest(imu)
    fit = fit_accel(poses.means, shape=shape, noise=poses.noise, gravity=gravity, tilt_range=tilt_range)
    shortest = min(stop - start for start, stop in poses.spans)
    remarks = [info("calibration.poses", count=len(poses.spans), shortest=shortest)]
    for i in np.flatnonzero(~fit.used).tolist():
        remarks.append(info("calibration.pose", pose=i + 1, start=poses.spans[i][0], stop=poses.spans[i][1]))
    return replace(fit, calibration=_warmed(fit.calibration, poses.temp_c), remarks=(*remarks, *fit.remarks))


def _tumbled(imu: ImuData, shape: str, gravity: float, tilt_range: float) -> Fitted:
    """Fit of a capture without rests."""
    rows, gyr = _complete(imu)
    if gyr is None or rows.size < FEWEST_ROWS:
        raise ParameterError(
            "a capture without rests needs a gyroscope beside the accelerometer, but there are "
            f"{0 if gyr is None else rows.size} samples of both; rest in many poses instead, and leave 'moving' out."
        )
    if (clipped := int(np.count_nonzero(imu.flags[rows] & np.uint32(flags.ACC_CLIPPED | flags.GYR_CLIPPED)))) > 0:
        text = f"in {clipped} of {rows.size} samples a sensor is at the end of its range."
        raise CaptureRefusedError(Reason("clipping", text, "Turn more slowly, or set a wider range."))
    fit = fit_accel_moving(
        imu.t[rows], imu.usable("acc")[rows], gyr, shape=shape, gravity=gravity, tilt_range=tilt_range
    )
    temp_c = np.zeros(0) if imu.temp_c is None else imu.temp_c[rows]
    return replace(fit, calibration=_warmed(fit.calibration, temp_c[np.isfinite(temp_c)]))


def poses_at_rest(imu: ImuData) -> RestPeriods:
    """Stretches of at least `LEAST` at rest, in none of which the accelerometer is clipped."""
    rows, gyr = _complete(imu)
    t, acc = imu.t[rows], imu.usable("acc")[rows]
    spans = stills(t, acc, gyr, least=LEAST) if t.size else []
    if not spans:
        lasting = float(imu.t[-1] - imu.t[0])
        count = f"{t.size} of {len(imu)} samples with a specific force"
        text = f"nothing in {lasting:.1f} s ({count}) is at rest for {LEAST:g} s."
        advice = (
            "Hold each pose for 2 s or more against something solid, and turn the unit quickly in between; or, where "
            "it tumbled slowly beside a gyroscope, ask for that with --moving."
        )
        raise CaptureRefusedError(Reason("not-still", text, advice))
    _refuse_clipped(imu, rows, spans)
    means = np.array([acc[span].mean(axis=0) for span in spans])
    # of the length of a pose's mean, by that of its parts: with slow noise, without tremor of hands
    parts = [acc[span][: (span.stop - span.start) // _PARTS * _PARTS].reshape(_PARTS, -1, 3) for span in spans]
    variances = [float(np.linalg.norm(each.mean(axis=1), axis=1).var(ddof=1)) / _PARTS for each in parts]
    temps = None if imu.temp_c is None else imu.temp_c[rows]
    temp_c = np.zeros(0) if temps is None else np.concatenate([temps[span] for span in spans])
    times = tuple((float(t[span.start]), float(t[span.stop - 1])) for span in spans)
    return RestPeriods(means, float(np.sqrt(np.mean(variances))), times, temp_c[np.isfinite(temp_c)])


def _complete(imu: ImuData) -> tuple[NDArray[np.int64], Floats | None]:
    """Rows with a specific force, and the rates there; none where most of those rows have no rate."""
    valid = np.isfinite(imu.usable("acc")).all(axis=1)
    turned = valid & np.isfinite(imu.usable("gyr")).all(axis=1)
    if 2 * np.count_nonzero(turned) <= np.count_nonzero(valid):
        return np.flatnonzero(valid), None
    rows = np.flatnonzero(turned)
    return rows, imu.usable("gyr")[rows]


def _refuse_clipped(imu: ImuData, rows: NDArray[np.int64], spans: list[slice]) -> None:
    clipped = (imu.flags[rows] & np.uint32(flags.ACC_CLIPPED)) != 0
    bad = [i + 1 for i, span in enumerate(spans) if clipped[span].any()]
    if bad:
        raise CaptureRefusedError(
            Reason(
                "clipping",
                f"in {len(bad)} of {len(spans)} poses, the first being pose {bad[0]}, the accelerometer is at the end "
                f"of its range of ±{imu.meta.acc_range:.4g} m/s².",
                "Set a range beyond 1 g, or correct the range that the recording declares.",
            )
        )


def _warmed(calibration: TriadCalibration, temp_c: Floats) -> TriadCalibration:
    """Calibration that says at which temperature it was made."""
    if not temp_c.size:
        return calibration
    span = float(temp_c.min()), float(temp_c.max())
    return replace(calibration, temp_ref_c=float(temp_c.mean()), temp_span_c=span)
