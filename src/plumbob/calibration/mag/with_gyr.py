"""Magnetometer beside a gyroscope: for motion that is too restricted to see the ellipsoid, as of a ship or a car.

Least squares of a magnetometer beside a gyroscope: one field, seen from a body that turns as the gyroscope says.

The model is ``m_k = A R_kᵀ exp(−[θ_k]×) h + b``: R_k is what the gyroscope's rates, corrected for constant errors, add
up to since the start until a delay before sample k, for magnetometers answer later than gyroscopes; h is the field's
direction in the axes of the start, and θ_k the attitude error that the gyroscope's noise has added up to. θ is a random
walk, known at some instants and linear between them; its intensity is found with it, by expectation and maximisation.
That the field is one vector says more than that its length is one number, as in [Kok2016]: an inclination of a few
degrees already separates all parameters.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob import rotations
from plumbob.calibration.autocorrelation import Alike, memory_of_each
from plumbob.calibration.ellipsoid_fit import CAUCHY, FALSE_ALARM, MAD, distortion_to_size
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, refuse
from plumbob.calibration.mag import checks
from plumbob.calibration.mag.checks import FieldEstimate
from plumbob.calibration.mag.ellipsoid import unturned
from plumbob.calibration.mag.field_gradient import PATCH, Unevenness, unevenness
from plumbob.calibration.mag.windows import by_error, floored_inverse, leaning, tightness
from plumbob.calibration.mag.with_acc import turn_angle
from plumbob.calibration.predicted import TILT_RANGE
from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError
from plumbob.core.findings import Note, info
from plumbob.core.units import dps, to_deg, to_dps

_DIRECTIONS: Final = 400


def field_start(mag: Floats, turns: Floats) -> tuple[Floats, Floats, Floats]:
    """Field's direction, A and b: the best of many directions, for each of which A and b are linear."""
    design = np.hstack((turns.reshape(-1, 9), np.ones((len(turns), 1))))
    power, cross = design.T @ design, design.T @ mag
    best: tuple[Floats, Floats, Floats] = (np.zeros(3), np.eye(3), np.zeros(3))
    least = math.inf
    k = np.arange(_DIRECTIONS) + 0.5  # spread evenly over a sphere along a spiral of golden angles
    up, angle = 1.0 - 2.0 * k / _DIRECTIONS, math.pi * (3.0 - math.sqrt(5.0)) * k
    level = np.sqrt(1.0 - up * up)
    for h in np.column_stack((level * np.cos(angle), level * np.sin(angle), up)):
        pick = np.zeros((4, 10))
        pick[:3, :9] = np.kron(h, np.eye(3))
        pick[3, 9] = 1.0
        fit, *_ = np.linalg.lstsq(pick @ power @ pick.T, pick @ cross, rcond=None)
        cost = -float(np.sum((pick @ cross) * fit))
        if cost < least and np.linalg.det(fit[:3]) > 0.0:
            best, least = (h, np.asarray(fit[:3].T, dtype=np.float64), np.asarray(fit[3], dtype=np.float64)), cost
    return best


def across(h: Floats) -> Floats:
    """Two directions across h, as columns (3, 2)."""
    return np.linalg.svd(h[np.newaxis])[2][1:].T


# A, b, two of the field's direction, twelve of the gyroscope (bias, scale and misalignment), and the delay.
PARAMETERS: Final = 27

WALK: Final = float(dps(0.005))  # of the attitude to start from, rad/√s: the noise of a good MEMS gyroscope
_TAKEN_UP: Final = 4.0  # patches whose errors are taken up: twelve parameters of the magnetometer, three axes each
_NODE: Final = 0.05  # s between attitudes at most; rotations in between are taken as one
_STEP: Final = 1.0  # s from knot to knot of the random walk
_MOST_KNOTS: Final = 120
_FIELD: Final = 14  # parameters before those of the gyroscope
_STEPS: Final = 40
_ROUNDS: Final = 12
_ENOUGH: Final = 1e-2  # of the parameters' standard deviations


class FieldFit(NamedTuple):
    """Fit of A, b, the field's direction, and the gyroscope's bias."""

    distortion: Floats  # (3, 3), a, unit of the measurement
    bias: Floats  # (3,), b, unit of the measurement
    covariance: Floats  # (12, 12), of b and A, row by row; samples that err alike count as fewer
    field_s: Floats  # (3,), direction of the field in the body axes of the start
    # gyr_bias, gyr_gain: (3,), of the gyroscope: ``rate = gyr_gain @ measured − gyr_bias``, rad/s
    gyr_bias: Floats
    gyr_gain: Floats
    delay: float  # of the magnetometer against the gyroscope, s
    walk: float  # intensity of the attitude's random walk, rad/√s
    turns: Floats  # (N, 3, 3), attitude of each sample: from its body axes to those of the start
    residuals: Floats  # (N, 3), residuals, unit of the measurement
    sd: float  # their standard deviation about each axis, parameters counted
    used: NDArray[np.bool_]  # (N,), false for outliers
    alike: Alike  # how many of them count as one
    field: Unevenness  # how uneven the field was, or may have been
    condition: float  # of the normal matrix of all but the random walk, scaled to a diagonal of one


def fit_turned_field(
    t: Floats, mag: Floats, gyr: Floats, seen: NDArray[np.intp], *, gyr_gain_sd: float
) -> FieldFit | None:
    """Fit the model; None where the steps do not settle.

    `mag` (M, 3), of any unit, is of the instants `seen` among t (N,); `gyr` (N, 3) is off by a constant bias and by
    `gyr_gain_sd`, the standard deviation of each entry of its gain matrix, relative to its scale. All are finite.
    """
    middle = mag.mean(axis=0)
    size = math.sqrt(float(np.mean(np.sum((mag - middle) ** 2, axis=1))))
    if not size > 0.0:
        return None
    fit = _RandomWalkFit(t, (mag - middle) / size, gyr, seen, gyr_gain_sd, size)
    if not fit.run(robust=True):
        return None
    fit.set_aside()
    return fit.result(middle, size) if fit.run() else None


class _RandomWalkFit:
    """Steps of Gauss and Newton on all parameters and the knots of the random walk."""

    def __init__(
        self, t: Floats, mag: Floats, gyr: Floats, samples: NDArray[np.intp], gyr_gain_sd: float, size: float
    ) -> None:
        self.mag, self.gyr, self.size = mag, gyr[samples], size
        nodes = np.union1d(samples, np.searchsorted(t, np.arange(t[0], t[-1], _NODE)))
        self.seen, self.dt = np.searchsorted(nodes, samples), np.diff(t[nodes])[:, np.newaxis]
        q = rotations.quat_chained(0.5 * (gyr[1:] + gyr[:-1]) * np.diff(t)[:, np.newaxis])[nodes]
        self.angles = rotations.rotvec_from_quat(rotations.quat_multiply(rotations.quat_conjugate(q[:-1]), q[1:]))
        self.turned = float(np.sum(np.linalg.norm(self.angles, axis=1)))
        self.gyr_tight = tightness(gyr_gain_sd)
        self.used = np.ones(len(mag), dtype=np.bool_)
        self.gyr_errors, self.walk = np.zeros(13), WALK  # bias, what the gain matrix is more than one, delay
        count = min(_MOST_KNOTS, max(1, round((t[-1] - t[0]) / _STEP)))
        self.step = (t[-1] - t[0]) / count
        place = (t[samples] - t[0]) / self.step
        self.knot = np.minimum(place.astype(np.intp), count - 1)
        self.share = place - self.knot
        self.lean = np.zeros((count + 1, 3))
        self.changes = np.kron(np.eye(count) - np.eye(count, k=-1), np.eye(3))  # from knot to knot
        self.turns = self._turns()
        self.h, self.distortion, self.bias = field_start(mag, self.turns)
        self.sd, self.alike, self.field = self._scale(), Alike(1.0), Unevenness()

    def run(self, *, robust: bool = False) -> bool:
        """Alternate between steps and the intensity of noise and walk; False where they did not settle."""
        for _ in range(_ROUNDS):
            if not self._settle(robust):
                return False
            before = self.walk
            self.alike, self.field = self._memory()
            self.sd, self.walk = self._scale(robust=robust), self._intensity()
            if abs(self.walk / before - 1.0) < _ENOUGH:
                break
        return self._settle(robust)

    def set_aside(self) -> None:
        """Mark as outliers what noise of this size does not explain."""
        from scipy.stats import chi2

        limit = float(chi2.isf(FALSE_ALARM / len(self.mag), 3))
        self.used = (self.residuals**2).sum(axis=1) <= limit * self.sd**2

    def result(self, middle: Floats, size: float) -> FieldFit:
        """Take the scaling back; A comes before b in the steps, and after it in the covariance."""
        order = np.concatenate((np.arange(9, 12), np.arange(9)))
        normal = self.normal[:PARAMETERS, :PARAMETERS]
        spread = np.sqrt(np.diag(normal))
        return FieldFit(
            self.distortion * size,
            middle + size * self.bias,
            self.covariance[np.ix_(order, order)] * size * size,
            self.h,
            self.gyr_errors[:3],
            np.eye(3) + self._gain(),
            float(self.gyr_errors[12]),
            self.walk,
            self.now,
            self.residuals * size,
            self.sd * size,
            self.used,
            self.alike,
            self.field,
            float(np.linalg.cond(normal / np.outer(spread, spread))),
        )

    def _settle(self, robust: bool) -> bool:
        for _ in range(_STEPS):
            self._solve(robust)
            self.covariance = floored_inverse(self.normal)
            step = self.covariance @ self.slope
            if not np.isfinite(step).all():
                return False
            self.distortion = self.distortion + step[:9].reshape(3, 3)
            self.bias = self.bias + step[9:12]
            h = self.h + across(self.h) @ step[12:14]
            self.h = h / np.linalg.norm(h)
            self.gyr_errors = self.gyr_errors + step[_FIELD:PARAMETERS]
            self.lean[1:] += step[PARAMETERS:].reshape(-1, 3)
            self.turns = self._turns()
            if float(step @ self.normal @ step) < _ENOUGH**2 * PARAMETERS:
                return True
        return False

    def _turns(self) -> Floats:
        """Attitudes (M, 3, 3), and beside them how they lean by the gyroscope's errors."""
        angles = self.angles + self.angles @ self._gain().T - self.gyr_errors[:3] * self.dt
        attitude = rotations.dcm_from_quat(rotations.quat_chained(angles))
        sums = leaning(attitude, angles, self.angles, self.dt)[self.seen]
        self.now, delay = attitude[self.seen], float(self.gyr_errors[12])
        self.by_gyr = sums - by_error(self.now, delay * self.gyr, np.full((len(self.now), 1), delay))
        self.rate = self.gyr + self.gyr @ self._gain().T - self.gyr_errors[:3]
        return np.asarray(self.now @ rotations.dcm_from_quat(rotations.quat_from_rotvec(-delay * self.rate)))

    def _gain(self) -> Floats:
        return self.gyr_errors[3:12].reshape(3, 3)

    def _seen_field(self) -> Floats:
        """Field's direction in the body axes of each sample, (M, 3)."""
        share = self.share[:, np.newaxis]
        lean = (1.0 - share) * self.lean[self.knot] + share * self.lean[self.knot + 1]  # θ of each sample
        leaned = self.h - np.cross(lean, self.h)
        return np.asarray(np.einsum("nji,nj->ni", self.turns, leaned))

    @property
    def residuals(self) -> Floats:
        """Residuals (M, 3)."""
        return np.asarray(self.mag - self._seen_field() @ self.distortion.T - self.bias)  # [Kok2016]

    def _scale(self, *, robust: bool = True) -> float:
        residuals = self.residuals[self.used]
        if robust:
            return max(MAD * float(np.median(np.abs(residuals))), 1e-9)
        free = max(1, residuals.size - PARAMETERS)
        return max(math.sqrt(float(np.sum(residuals * residuals)) / free), 1e-9)

    def _memory(self) -> tuple[Alike, Unevenness]:
        """How many residuals count as one, and how uneven the field is: as it turns in body axes, all averages out."""
        fields, residuals = self._seen_field()[self.used], self.residuals[self.used]
        every = np.ones(len(fields), dtype=np.bool_)
        field = unevenness(
            residuals * self.size, fields, every, patches=self.turned / PATCH, taken_up=_TAKEN_UP, lengths=False
        )
        spread = field.spread(np.linalg.norm(residuals, axis=1) * self.size / math.sqrt(3.0))
        return Alike(memory_of_each(residuals), spread), field

    def _intensity(self) -> float:
        """Intensity of the random walk by expectation and maximisation, rad/√s."""
        change = self.changes @ self.lean[1:].ravel()
        doubt = np.sum((self.changes @ self.covariance[PARAMETERS:, PARAMETERS:]) * self.changes)
        return math.sqrt((float(change @ change) + float(doubt)) / (len(change) * self.step))  # [Dempster1977]

    def _solve(self, robust: bool) -> None:
        """Normal equations of all parameters and of the knots but the first, which the field's direction stands for."""
        knots = len(self.lean)
        normal, slope = np.zeros((PARAMETERS + 3 * knots, PARAMETERS + 3 * knots)), np.zeros(PARAMETERS + 3 * knots)
        residuals, rows = self.residuals, self._rows()
        weight = self.used / (self.sd**2 * self.alike.factor)
        if robust:
            weight = weight / (1.0 + (residuals**2).sum(axis=1) / (CAUCHY * self.sd) ** 2)  # [Holland1977]
        root = np.sqrt(weight)[:, np.newaxis]
        residuals, rows = residuals * root, rows * root[:, :, np.newaxis]
        for j in range(knots - 1):
            here = np.flatnonzero(self.knot == j)
            share, lean = self.share[here, np.newaxis, np.newaxis], rows[here, :, PARAMETERS:]
            block = np.concatenate((rows[here, :, :PARAMETERS], (1.0 - share) * lean, share * lean), axis=2)
            block = block.reshape(-1, PARAMETERS + 6)
            at = np.concatenate((np.arange(PARAMETERS), PARAMETERS + 3 * j + np.arange(6)))
            normal[np.ix_(at, at)] += block.T @ block
            slope[at] += block.T @ residuals[here].ravel()
        keep = np.delete(np.arange(len(slope)), slice(PARAMETERS, PARAMETERS + 3))
        self.normal, self.slope = normal[np.ix_(keep, keep)], slope[keep]
        # what is known before: that θ is a random walk, and how large the gyroscope's errors can be
        tight = 1.0 / (self.walk**2 * self.step)
        self.normal[PARAMETERS:, PARAMETERS:] += tight * self.changes.T @ self.changes
        self.slope[PARAMETERS:] -= tight * self.changes.T @ (self.changes @ self.lean[1:].ravel())
        gyr = slice(_FIELD, PARAMETERS)
        self.normal[gyr, gyr] += self.gyr_tight
        self.slope[gyr] -= self.gyr_tight @ self.gyr_errors

    def _rows(self) -> Floats:
        """Derivatives (M, 3, 29) by A, b, the field's direction, the gyroscope's errors, and θ."""
        field = self._seen_field()
        rows = np.zeros((len(field), 3, PARAMETERS + 3))
        for i in range(3):
            rows[:, i, 3 * i : 3 * i + 3] = field
            rows[:, i, 9 + i] = 1.0
        back = self.distortion @ np.swapaxes(self.turns, 1, 2)
        lean = back @ rotations.skew(self.h)
        rows[:, :, 12:14] = back @ across(self.h)
        rows[:, :, _FIELD : PARAMETERS - 1] = lean @ self.by_gyr
        rows[:, :, PARAMETERS - 1] = np.cross(self.rate, field) @ self.distortion.T
        rows[:, :, PARAMETERS:] = lean
        return rows


GAIN_SD: Final = 0.002  # standard deviation of each entry of a calibrated gyroscope's gain matrix
SHEET_GAIN_SD: Final = 0.02  # the same of one without a card: data sheets say 2 to 3 % of scale, 2 % across
LONGEST_GAP: Final = 0.5  # longest time without a rate, s
WORST_WALK: Final = float(dps(0.1))  # random walk of the attitude above which it is not the gyroscope's noise, rad/√s
_FEWEST: Final = 2 * PARAMETERS
_SOME: Final = 4000  # samples of the field; more of them share its unevenness
_ADVICE: Final = (
    "Turn through all headings, several times and both ways, and roll and pitch as far as can be: circles and figures "
    "of eight for a minute."
)
_FIRST: Final = "Calibrate the gyroscope first, scale and axes: the field cannot be known better than it turns."


def fit_mag_gyr(
    t: Floats,
    mag: Floats,
    gyr: Floats,
    *,
    acc: Floats | None = None,
    strength: float | None = None,
    gyr_gain_sd: float = GAIN_SD,
    tilt_range: float = TILT_RANGE,
) -> Fitted:
    """Fit bias and full matrix so that the field, NaN where there is none, is one vector as the gyroscope turns.

    The constant bias of the rates is found too, and how much later the field is measured; the rates' axes become those
    of the magnetometer. The mean specific force shows the vertical, and so the dip. `gyr_gain_sd` is the standard
    deviation of each entry of the gyroscope's gain matrix, relative; 0 where it is exact. The rest as of `fit_mag`.
    """
    checks.require_figures(strength=strength, gyr_gain_sd=gyr_gain_sd, tilt_range=tilt_range)
    t, mag, gyr, acc = checks.with_rates(t, mag, gyr, acc)
    present = np.flatnonzero(np.isfinite(mag).all(axis=1))
    stride = max(1, -(-len(present) // _SOME))
    samples = present[::stride]
    gap = float(np.diff(t).max()) if len(t) > 1 else 0.0
    if gap > LONGEST_GAP:
        raise CalibrationError(
            f"rates are missing for {gap:.2g} s, and the field can be followed across {LONGEST_GAP:g} s at most; "
            "cut the capture there with --from or --to, or choose another sensor than the gyroscope."
        )
    few = f"{len(samples)} samples of the field, but {_FEWEST} are needed."
    refuse(Reason("too-few", few, _ADVICE) if len(samples) < _FEWEST else unturned(mag[samples], _ADVICE))
    first = "" if gyr_gain_sd <= GAIN_SD else f"{_FIRST} "
    fit = fit_turned_field(t, mag[samples], gyr, samples, gyr_gain_sd=gyr_gain_sd)
    if fit is None or not np.linalg.det(fit.distortion) > 0.0:
        what = "no bias, matrix and field fit what magnetometer and gyroscope measured."
        raise CaptureRefusedError(Reason("ill-conditioned", what, first + _ADVICE))
    matrix, covariance = distortion_to_size(fit.distortion, fit.covariance, strength)
    radius = float(np.cbrt(np.linalg.det(fit.distortion)))
    dip = checks.DIP
    if acc is not None:  # by the mean specific force in the axes of the start
        up = np.nanmean(np.einsum("nij,nj->ni", fit.turns, acc[samples]), axis=0)
        dip = float(-np.arcsin(np.clip(up @ fit.field_s / np.linalg.norm(up), -1.0, 1.0)))
    # the field is shown to be uneven where most of it is seen, and counts
    shown = fit.alike if 2.0 * fit.field.seen**2 > fit.field.sd**2 else Alike(fit.alike.memory)
    walks = f"field and rates only agree if the attitude walks by {to_dps(fit.walk):.2g}°/√s, which no gyroscope does."
    keep = "Keep iron and magnets away, check the gyroscope's unit and range, and calibrate it first."
    estimate = FieldEstimate(
        matrix, fit.bias, covariance, covariance * fit.alike.memory / fit.alike.factor, fit.residuals, fit.used, radius,
        fit.condition, strength, dip, tilt_range, fit.field, shown,
    )  # fmt: skip
    return estimate.finished(
        mag[samples],
        method=f"magnetometer with gyroscope: one field, {PARAMETERS} parameters delay included, and random walk",
        advice=first + _ADVICE,
        reasons=(
            None if fit.walk <= WORST_WALK else Reason("magnet-moved", walks, keep),
            checks.outliers(fit.used, first + checks.STEEL),
        ),
        remarks=_remarks(fit, dip, acc is not None),
        stride=stride,
    )


def _remarks(fit: FieldFit, dip: float, measured: bool) -> tuple[Note, ...]:
    bias = ", ".join(f"{value:.3f}" for value in to_dps(fit.gyr_bias).tolist())
    turned, walk = to_deg(turn_angle(fit.distortion)), to_dps(fit.walk)
    return (
        info("calibration.with_gyroscope", bias=bias, walk_dps=walk, turn_deg=turned),
        info("calibration.mag_delay", delay_ms=1000.0 * fit.delay),
        info(f"calibration.dip_{'measured' if measured else 'assumed'}", dip_deg=to_deg(dip)),
    )
