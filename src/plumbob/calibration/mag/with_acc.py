"""Magnetometer beside an accelerometer at rest or in slow motion: the whole matrix, its turn in the case included.

Maximum likelihood of a magnetometer beside an accelerometer: one strength of the field, and one dip.

The model is ``|u| = 1`` and ``u · down = sin(dip)``, u = M (m − b), with a full matrix M: the vertical of the
accelerometer fixes the rotation that the length of the field leaves open. That is the likelihood of [Kok2016] once the
heading of every sample, which nothing else measures, is taken out of it.

Both equations hold for the true field and vertical of a sample, of which the measured ones are noisy, and both kinds of
noise are about equal. The steps are therefore those of Gauss and Helmert, in which derivatives are taken at the
measurements as adjusted so far: taken at the measured ones, they would share their noise with the residuals, and a
capture of small tilt would be biased by as much as its standard deviation. Both noises come from the residuals. Large
residuals are weighted down as of a Cauchy distribution first; what then is an outlier is set aside, and the rest is
fitted by plain least squares.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.autocorrelation import alike
from plumbob.calibration.ellipsoid_fit import CAUCHY, FALSE_ALARM, MAD, Shape, mean_radius, to_size
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, invert, refuse
from plumbob.calibration.mag import checks
from plumbob.calibration.mag.checks import FieldEstimate
from plumbob.calibration.mag.ellipsoid import fit_mag
from plumbob.calibration.mag.field_gradient import unevenness
from plumbob.calibration.predicted import TILT_RANGE
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.findings import Note, info
from plumbob.core.text import measured
from plumbob.core.units import deg, to_deg

PARAMETERS: Final = 13  # bias, matrix and sin(dip)
_LENGTH_PARAMETERS, _DIP_PARAMETERS = 9, 4  # what the lengths tell, and what only the dip does
_ROUNDS: Final = 4
_ROUND: Final = 4
_STEPS: Final = 60
_ENOUGH: Final = 1e-3  # of the parameters' standard deviations
_MAD_EFFICIENCY: Final = 0.37  # of the median absolute deviation on normal residuals
_LEAST_SD: Final = 1e-9  # of the field, where there is no noise


class DipFit(NamedTuple):
    """Fit of M, b and the dip."""

    centre: Floats  # (3,), b, unit of the measurement
    matrix: Floats  # (3, 3), M, its inverse unit
    dip: float  # angle of the field below the horizon, rad
    covariance: Floats  # (12, 12), of centre and matrix, row by row
    dip_sd: float  # standard deviation of the dip, rad
    mag_sd: float  # standard deviation of the orthogonal distances, unit of the measurement
    # standard deviation of the vertical's direction, about each level axis, rad; 0 where the magnetometer's noise
    # explains all
    down_sd: float
    # (N, 2), orthogonal distance, unit of the measurement, and departure of the field's angle to the vertical, rad
    residuals: Floats
    used: NDArray[np.bool_]  # (N,), false for outliers
    condition: float  # of the normal matrix scaled to a diagonal of one


def fit_dip(mag: Floats, down: Floats, centre: Floats, matrix: Floats, used: NDArray[np.bool_]) -> DipFit | None:
    """Fit the joint model to the measured field (N, 3) and the unit vertical, downward; None if steps do not settle.

    It starts from a fit of the length, with any rotation, of which `used` (N,) samples are not outliers.
    """
    size = 1.0 / float(np.cbrt(abs(np.linalg.det(matrix))))
    points = (mag - centre) / size
    first = _Adjustment(points[used], down[used], _start(points[used], down[used], matrix * size))
    for _ in range(_ROUNDS):  # the weights settle with the fit
        first.run(_ROUND, robust=True)
    good = used.copy()
    good[used] = first.likely()
    if int(np.count_nonzero(good)) <= PARAMETERS:
        return None
    last = _Adjustment(points[good], down[good], first.p)
    for _ in range(_ROUNDS):
        settled = last.run(_STEPS)
    return _result(last, points, down, good, centre, size) if settled else None


def _start(points: Floats, down: Floats, matrix: Floats) -> Floats:
    """Parameters (13,) with the rotation of a linear solution or none, whichever leaves less."""
    best, least = np.zeros(PARAMETERS), np.inf
    # the rotation R that best makes ``down · R u`` one number, from the smallest singular vector of its linear form
    rows = np.column_stack((np.einsum("ni,nj->nij", down, points @ matrix.T).reshape(-1, 9), -np.ones(len(points))))
    rotation = rotation_in(np.linalg.eigh(rows.T @ rows)[1][:9, 0].reshape(3, 3))
    for turn in (np.eye(3), rotation * np.sign(np.linalg.det(rotation))):
        turned = turn @ matrix
        along = np.einsum("ni,ni->n", down, points @ turned.T)
        sine = float(np.median(along))
        cost = float(np.median(np.abs(along - sine)))
        if cost < least:
            best, least = np.concatenate((np.zeros(3), turned.ravel(), [sine])), cost
    return best


class _DistanceAndDip(NamedTuple):
    """Both equations of every sample, solved for the distance and for the dip once the distance is taken out of it.

    `left` (N, 2) is what they leave, `rows` (N, 2, 13) their derivatives by the parameters; `out` (N, 3) is the normal
    of the ellipsoid, `along` (N, 3) how the second answers to the field, orthogonal to `out`, and `level` (N, 3) how it
    answers to the vertical.
    """

    residuals: Floats
    rows: Floats
    out: Floats
    along: Floats
    level: Floats


def _equations(p: Floats, mag: Floats, down: Floats, mag_off: Floats, down_off: Floats) -> _DistanceAndDip:
    """Equations at adjusted field and vertical (N, 3), which the measured ones are off by `mag_off` and `down_off`."""
    matrix = p[3:12].reshape(3, 3)
    arm = mag - p[:3]
    u = arm @ matrix.T
    size = np.linalg.norm(u, axis=1, keepdims=True)
    n = u / size
    rows = np.zeros((len(mag), 2, PARAMETERS))
    by_mag = np.stack((n @ matrix, down @ matrix), axis=1)
    rows[:, :, :3] = -by_mag
    rows[:, :, 3:12] = (np.stack((n, down), axis=1)[:, :, :, np.newaxis] * arm[:, np.newaxis, np.newaxis]).reshape(
        -1, 2, 9
    )
    rows[:, 1, 12] = -1.0
    level = u - _dot(u, down) * down
    # [Kok2016]: without the headings
    residuals = np.hstack((size - 1.0, _dot(u, down) - p[12])) + np.einsum("nij,nj->ni", by_mag, mag_off)
    residuals[:, 1:] += _dot(level, down_off)
    slope = np.linalg.norm(by_mag[:, 0], axis=1, keepdims=True)
    out = by_mag[:, 0] / slope
    common = _dot(by_mag[:, 1], out)
    rows[:, 0] /= slope
    residuals[:, :1] /= slope
    rows[:, 1] -= common * rows[:, 0]
    residuals[:, 1:] -= common * residuals[:, :1]
    return _DistanceAndDip(residuals, rows, out, by_mag[:, 1] - common * out, level)


def _dot(a: Floats, b: Floats) -> Floats:
    """Products of rows, (N, 1)."""
    return np.asarray(np.einsum("ni,ni->n", a, b)[:, np.newaxis])


class _Adjustment:
    """Steps of Gauss and Helmert for some samples."""

    def __init__(self, mag: Floats, down: Floats, start: Floats) -> None:
        self.measured, self.p = (mag, down), start
        self.adjusted = (mag, down)
        self._update()
        self.mag_sd, self.down_sd = self._noise(robust=True)

    def run(self, steps: int, *, robust: bool = False) -> bool:
        """Take steps with the noise of the residuals so far; False where they did not settle."""
        self.mag_sd, self.down_sd = self._noise(robust=robust)
        for _ in range(steps):
            weight = np.ones(len(self.now.residuals))
            if robust:
                weight = 1.0 / (1.0 + (self._whitened() ** 2).sum(axis=1) / CAUCHY**2)  # [Holland1977]
            whitened = self._whitened() * np.sqrt(weight)[:, np.newaxis]
            rows = (self.now.rows / self._sd()[:, :, np.newaxis] * np.sqrt(weight)[:, np.newaxis, np.newaxis]).reshape(
                -1, PARAMETERS
            )
            self.normal = rows.T @ rows
            step = -np.linalg.lstsq(self.normal, rows.T @ whitened.ravel(), rcond=None)[0]
            self.p = self.p + step
            # field and vertical that fulfil both equations, as little from the measured ones as can be
            (mag, down), now = self.measured, self.now
            residuals = now.residuals + now.rows @ step
            share = residuals[:, 1:] / self._sd()[:, 1:] ** 2
            field = mag - residuals[:, :1] * now.out - self.mag_sd**2 * share * now.along
            vertical = down - self.down_sd**2 * share * now.level
            self.adjusted = (field, vertical / np.linalg.norm(vertical, axis=1, keepdims=True))
            self._update()
            if not np.isfinite(self.p).all():
                return False
            if float(step @ self.normal @ step) < _ENOUGH**2:
                return True
        return False

    def likely(self) -> NDArray[np.bool_]:
        """Samples that noise of this size explains, (N,)."""
        from scipy.stats import f

        count = len(self.now.residuals)
        free = max(1.0, _MAD_EFFICIENCY * (count - _LENGTH_PARAMETERS))
        limit = 2.0 * float(f.ppf(1.0 - FALSE_ALARM / count, 2, free))
        return np.asarray((self._whitened() ** 2).sum(axis=1) <= limit)

    def _sd(self) -> Floats:
        """Standard deviations of both equations, (N, 2)."""
        mag, down = self.mag_sd, self.down_sd
        var = mag * mag * (self.now.along**2).sum(axis=1)
        return np.stack((np.full(len(var), mag), np.sqrt(var + down * down * (self.now.level**2).sum(axis=1))), axis=1)

    def _whitened(self) -> Floats:
        return np.asarray(self.now.residuals / self._sd())

    def _update(self) -> None:
        off = (self.measured[0] - self.adjusted[0], self.measured[1] - self.adjusted[1])
        self.now = _equations(self.p, *self.adjusted, *off)

    def _noise(self, *, robust: bool) -> tuple[float, float]:
        """Standard deviations of the field, of its strength, and of the vertical, rad, by the residuals."""
        mag = max(_sd(self.now.residuals[:, 0], _LENGTH_PARAMETERS, robust), _LEAST_SD)
        var = mag * mag * float(np.mean((self.now.along**2).sum(axis=1)))
        level = float(np.mean((self.now.level**2).sum(axis=1)))
        both = _sd(self.now.residuals[:, 1], _DIP_PARAMETERS, robust)
        return mag, math.sqrt(max(0.0, both * both - var) / level)


def _sd(values: Floats, parameters: int, robust: bool) -> float:
    free = max(1, len(values) - parameters)
    if robust:
        return MAD * float(np.median(np.abs(values))) * math.sqrt(len(values) / free)
    return float(np.linalg.norm(values)) / math.sqrt(free)


def _result(
    fit: _Adjustment, points: Floats, down: Floats, used: NDArray[np.bool_], centre: Floats, size: float
) -> DipFit | None:
    """Take the scaling back."""
    sine = float(fit.p[12])
    if not (np.diag(fit.normal) > 0.0).all() or not abs(sine) < 1.0:
        return None
    covariance, condition = invert(fit.normal)
    back = np.concatenate((np.full(3, size), np.full(9, 1.0 / size)))
    cosine = math.sqrt(1.0 - sine * sine)
    none = np.zeros_like(points)
    residuals = _equations(fit.p, points, down, none, none).residuals
    residuals[used] = fit.now.residuals
    return DipFit(
        centre + size * fit.p[:3],
        fit.p[3:12].reshape(3, 3) / size,
        math.asin(sine),
        covariance[:12, :12] * np.outer(back, back),
        math.sqrt(float(covariance[12, 12])) / cosine,
        fit.mag_sd * size,
        fit.down_sd,
        residuals * [size, 1.0 / cosine],
        used,
        condition,
    )


FEWEST: Final = PARAMETERS + 1  # fewest samples or poses
UNSTEADY: Final = deg(5.0)  # scatter of the vertical above which the accelerometer did not measure gravity, rad
_GRAVITY: Final = 0.1  # departure of gravity, of itself
_SOME: Final = 20_000
_ADVICE: Final = "Hold the unit still in each attitude, or turn it slowly, and capture again."


def fit_mag_acc(mag: Floats, acc: Floats, *, strength: float | None = None, tilt_range: float = TILT_RANGE) -> Fitted:
    """Fit bias and full matrix so that the field has one strength and one dip; arguments as of `fit_mag`.

    The vertical of the accelerometer, calibrated and at rest or nearly, shows what the length of the field cannot: how
    the magnetometer is turned against it. Captures of small tilt gain too, for the dip says about the upright axis what
    the length hardly does.
    """
    checks.require_figures(strength=strength, tilt_range=tilt_range)
    mag = checks.finite_rows("mag", mag)
    acc = checks.forces(acc, len(mag))
    if len(mag) < FEWEST:
        what = f"{len(mag)} samples, but the joint fit needs {FEWEST} at least."
        refuse(Reason("too-few", what, "Hold the unit in more attitudes: 18 faces and edges, or turn it slowly."))
    force = np.linalg.norm(acc, axis=1)
    typical = float(np.median(force))
    what = f"the specific force is {typical:.3g} m/s² in the median, but gravity is {G0:.3g} m/s²."
    advice = "Check the accelerometer's unit and range, and calibrate it first."
    refuse(None if abs(typical / G0 - 1.0) <= _GRAVITY else Reason("wrong-gravity", what, advice))
    alone = fit_mag(mag, shape=Shape.ELLIPSOID, acc=acc, tilt_range=tilt_range)
    stride = -(-len(mag) // _SOME)
    points, down = mag[::stride], -(acc / force[:, np.newaxis])[::stride]
    fit = fit_dip(points, down, alone.calibration.bias, alone.calibration.matrix, alone.used[::stride])
    if fit is None:
        what = "no bias, matrix and dip fit the field and the vertical of the accelerometer."
        raise CaptureRefusedError(Reason("ill-conditioned", what, _ADVICE))
    directions, radius = (points - fit.centre) @ fit.matrix.T, mean_radius(fit.matrix)
    shared = alike(fit.residuals, directions, fit.used)
    field = unevenness(fit.residuals[:, 0], directions, fit.used, lengths=False)
    matrix, independent = to_size(fit.matrix, fit.covariance, strength)
    residuals = fit.residuals[fit.used, 0]
    covariance = field.counted(
        independent, memory=shared.memory, residuals=residuals, matrix=matrix, radius=radius, turned=False
    )
    estimate = FieldEstimate(
        matrix, fit.centre, covariance, independent * shared.memory, fit.residuals[:, 0], fit.used, radius,
        fit.condition, strength, fit.dip, tilt_range, field, shared,
    )  # fmt: skip
    scatters = f"the vertical of the accelerometer scatters by {to_deg(fit.down_sd):.2g}° about the field's dip."
    dip_sd = fit.dip_sd * math.sqrt(shared.memory + field.spread(residuals))
    return estimate.finished(
        points,
        method="magnetometer with accelerometer: ellipsoid, turn and dip, 13 parameters",
        advice="Turn the unit through all attitudes: each face and edge up.",
        reasons=(
            checks.outliers(fit.used, "Move less, and look for moving iron and switched currents nearby."),
            None if fit.down_sd <= UNSTEADY else Reason("not-still", scatters, _ADVICE),
        ),
        remarks=_remarks(fit, dip_sd),
        stride=stride,
    )


def turn_angle(matrix: Floats) -> float:
    """Angle of the rotation in a matrix (3, 3), rad."""
    return math.acos(min(1.0, max(-1.0, 0.5 * (float(np.trace(rotation_in(matrix))) - 1.0))))


def rotation_in(matrix: Floats) -> Floats:
    """Rotation (3, 3) in a matrix: the factor that is left beside a symmetric one."""
    u, _, vt = np.linalg.svd(matrix)
    return np.asarray(u @ vt)


def _remarks(fit: DipFit, dip_sd: float) -> tuple[Note, ...]:
    dip, sd = to_deg(fit.dip), to_deg(dip_sd)
    return (
        info(
            "calibration.dip_with_acc", dip=measured(dip, dip - sd, dip + sd), turn_deg=to_deg(turn_angle(fit.matrix))
        ),
        info("calibration.noise_with_acc", mag_sd=fit.mag_sd, down_sd_deg=to_deg(fit.down_sd)),
    )
