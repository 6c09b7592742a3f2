"""Accelerometer from slow tumbling without rests, beside a gyroscope: what a logger in a hand usually has.

Over a window of a second or some, the gyroscope shows how the unit turned, so that all samples can be turned to the
attitude of the window's middle and averaged there. The hand's own acceleration is a change of velocity, which an
average with smooth weights hardly keeps; gravity stays. The window is then a pose, and poses are fitted by their
length. A constant error of the gyroscope turns the samples before the middle one way and those after it the other, and
cancels.

What does not cancel is the centripetal acceleration of a unit that turns about a point beside it: it has the same
direction in the case all the time, as a bias has. Nothing in the capture distinguishes it from one, so it stands in the
prediction.
"""

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.acc.poses import SHAPES, fit_accel
from plumbob.calibration.ellipsoid.ellipsoid_fit import Ellipsoid, Shape, fit_norm
from plumbob.calibration.fit import TILT, CaptureRefusedError, Fitted, Reason, grade_of
from plumbob.calibration.gyr.drift import accumulate, rotation_vectors
from plumbob.calibration.predicted import TILT_RANGE, tilt_sd
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.rotations import quat_conjugate, quat_multiply, quat_rotate

LENGTHS: Final = (1.0, 2.0, 4.0, 8.0)
"""Windows that are tried, s; the one with the least predicted error is taken."""

ARM: Final = 0.2
"""Distance of the unit from the point about which a hand turns it, root mean square, m: a wrist, or an elbow."""

MOST_TURN: Final = deg(120.0)
"""Turn within a window beyond which the gyroscope's own scale would count, rad."""

FEWEST: Final = 12
"""Windows."""

_SHARED: Final = 4.0 / 3.0  # of the variance of windows with Hann's weights that overlap by half: correlation 1/6 twice
_ROUNDS: Final = 8
_GAP: Final = 2.0  # steps by which a window may last longer than its samples say
_ADVICE: Final = (
    "Turn the unit slowly about all its axes, each face once up, and move it as little as you can; or rest."
)


class EqualStretches(NamedTuple):
    """Stretches of equal length.

    Attributes
    ----------
    rows : ndarray (W, n) of int64
        Samples of each.
    turns : ndarray (W, n, 4)
        Rotation of each sample's body axes to those of the middle.
    weights : ndarray (n,)
        Hann's, of sum 1.
    rate : ndarray (W,)
        Mean square of the rate, rad²/s².
    """

    rows: NDArray[np.int64]
    turns: Floats
    weights: Floats
    rate: Floats


def fit_accel_moving(
    t: Floats,
    acc: Floats,
    gyr: Floats,
    *,
    shape: str = "auto",
    gravity: float = G0,
    tilt_range: float = TILT_RANGE,
) -> Fitted:
    """Fit bias, scale and misalignment of an accelerometer that was turned slowly and never rested.

    Parameters
    ----------
    t : ndarray (N,)
        Time, s, increasing and nearly even.
    acc : ndarray (N, 3)
        Specific force as measured, m/s², finite.
    gyr : ndarray (N, 3)
        Rates, rad/s, finite; a constant bias of some °/s does no harm.
    shape, gravity, tilt_range
        As of `plumbob.calibration.acc.poses.fit_accel`.

    Raises
    ------
    CaptureRefusedError
        If the capture cannot determine the calibration, with the reasons.
    """
    check.one_of("shape", shape, [name for name in SHAPES if name != "six"])
    fits: list[tuple[float, Fitted]] = []
    refused: CaptureRefusedError | None = None
    attitude = _attitude(t, gyr)
    for length in LENGTHS:
        windows = _windows(t, gyr, attitude, length)
        if len(windows.rows) < FEWEST:
            continue
        try:
            fits.append((length, _fit(windows, acc, shape, gravity, tilt_range)))
        except CaptureRefusedError as error:
            refused = refused or error
    if not fits:
        raise refused or CaptureRefusedError(_too_fast(t, gyr))
    length, best = min(fits, key=_predicted)
    note = f"Never at rest: {len(best.used)} windows of {length:g} s stand for poses, turned together by the gyroscope."
    return replace(best, remarks=(note, *best.remarks))


def _predicted(pair: tuple[float, Fitted]) -> float:
    quality = pair[1].calibration.quality
    return math.inf if quality is None or quality.tilt_sd is None else quality.tilt_sd


def _attitude(t: Floats, gyr: Floats) -> Floats:
    """Attitude of each sample (N, 4), body to that of the first, by the rates alone."""
    q = np.empty((len(t), 4))
    accumulate(rotation_vectors(gyr, np.diff(t)), q)
    return q


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


def _fit(windows: EqualStretches, acc: Floats, shape: str, gravity: float, tilt_range: float) -> Fitted:
    """Fit poses, which depend a little on what is fitted: again and again until they stay."""
    matrix, bias = np.eye(3), np.zeros(3)
    poses = _poses(windows, acc, matrix, bias)
    for _ in range(_ROUNDS):
        start = Ellipsoid(bias, np.asarray(matrix / gravity))
        fit = fit_norm(poses, Shape.AXES if shape == "axes" else Shape.ELLIPSOID, start)
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


def _widened(fitted: Fitted, rate: float, gravity: float, tilt_range: float) -> Fitted:
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
        raise CaptureRefusedError(Reason("ill-conditioned", text, _ADVICE))
    quality = replace(calibration.quality, tilt_sd=tilt, grade=grade)
    remark = (
        f"The unit turned with {_speed(rate)}; about a point {ARM:g} m away that is an acceleration of "
        f"{unseen / G0 * 1e3:.2g} mg along each axis, which looks like a bias and is in the prediction."
    )
    method = calibration.method.replace("poses", "windows of slow tumbling")
    triad = replace(calibration, covariance=covariance, quality=quality, method=method)
    return replace(fitted, calibration=triad, remarks=(remark, *fitted.remarks))


def _speed(rate: float) -> str:
    return f"{to_dps(math.sqrt(rate)):.3g}°/s (rms)"


def _too_fast(t: Floats, gyr: Floats) -> Reason:
    lasting, speed = float(t[-1] - t[0]), to_dps(float(np.sqrt(np.mean(np.sum(gyr**2, axis=1)))))
    text = f"{lasting:.3g} s at {speed:.3g}°/s (rms) have fewer than {FEWEST} windows of slow turning."
    return Reason("too-few", text, _ADVICE)
