"""Magnetometer of a unit at work: hard iron, soft iron and the gyroscope's bias from hours of field and rates alone.

It is a fit by least squares of how the field turns from moment to moment.

Nobody turns a unit for its calibration while it works, and over hours neither the field's direction nor a gyroscope's
bias stays what it was. So the record is cut into windows of some seconds. Within each the field is one vector h, seen
from a body that turns as the gyroscope says: ``m = A Rᵀ h + b``. From one window to the next it walks in space, as the
place changes and the gyroscope drifts; how far is found with it, and jumps do no harm. What is known of A and b then
comes from turning, as of a field that obeys ``dm/dt = −ω × m``, without a difference of noisy samples being taken, and,
the less the field walks, from one vector in all attitudes. The gyroscope's bias walks from segment to segment.

The h form a chain, so they drop out of the normal equations by one banded matrix. The residuals of windows give the
covariance: their scores, added up over clusters [Liang1986].
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.autocorrelation import memory_of_each
from plumbob.calibration.ellipsoid_fit import CAUCHY, FALSE_ALARM, MAD, distortion_to_size
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, refuse
from plumbob.calibration.mag import checks
from plumbob.calibration.mag import windows as windowed
from plumbob.calibration.mag.checks import FieldEstimate
from plumbob.calibration.mag.with_acc import turn_angle
from plumbob.calibration.mag.with_gyr import GAIN_SD
from plumbob.calibration.predicted import TILT_RANGE
from plumbob.core.check import Floats
from plumbob.core.findings import Note, info
from plumbob.core.units import dps, to_deg, to_dps
from plumbob.rotations import skew

LENGTH: Final = 4.0  # of the windows, s
WANDER: Final = float(dps(0.05))  # change of a gyroscope's bias from one segment to the next, standard deviation, rad/s
CLUSTER: Final = 60.0  # time beyond which errors have nothing in common, s
FEWEST_WINDOWS: Final = 10

_OWN: Final = 13  # parameters of the magnetometer: A, b and the delay; the gyroscope's are its gain and bias
_ALL: Final = 25
_DISTORTION_SD: Final = 0.5  # of entries of A, the field's strength being 1: what nothing else tells must stay finite
_HARD_IRON_SD: Final = 3.0
_SIZE_SD: Final = 1e-3  # of A, whose size is taken back
_LEAST_WALK: Final = 1e-4  # of the field from window to window: a gyroscope's noise makes as much
_LAGS: Final = ((15, 6), (150, 3))  # windows, and shares of all, between which differences of fields grow by the walk
_STEPS: Final = 60
_ROUNDS: Final = 60  # of attitudes by the gyroscope's errors so far
_SWINGING: Final = 10  # rounds, after which some records swing between two answers
_ENOUGH: Final = 0.05  # of the parameters' standard deviations
_SETTLED: Final = 0.5  # of the standard deviations of all parameters together, from one round to the next
_TINY: Final = 1e-12


class InUseFit(NamedTuple):
    """Fit of A and b."""

    # distortion, bias: (3, 3), a and b, unit of the measurement
    distortion: Floats
    bias: Floats
    covariance: Floats  # (12, 12), of b and A, row by row, from what windows say differently
    fields: Floats  # (M, 3), mean measured field of each part, unit of the measurement
    residuals: Floats  # (M, 3), residuals of the fit
    used: NDArray[np.bool_]  # (M,), false for outliers
    gyr_bias: Floats  # (K, 3), of the gyroscope in each segment, rad/s
    delay: float  # of the magnetometer against the gyroscope, s
    walk: float  # how far the field walks from window to window along each axis, of its length
    windows: int  # how many there were
    condition: float  # of the normal matrix, scaled to a diagonal of one


def fit_in_use(t: Floats, mag: Floats, gyr: Floats, *, gyr_gain_sd: float) -> InUseFit | None:
    """Fit windows; None where they are too few, or the steps do not settle. The field is NaN where there is none.

    `gyr_gain_sd` is the standard deviation of each entry of the gyroscope's gain matrix, relative to its scale.
    """
    present = np.asarray(np.isfinite(mag).all(axis=1))
    edges = windowed.window_edges(t, present, LENGTH) if len(t) > 1 else np.zeros((0, 2), dtype=np.intp)
    if len(edges) < FEWEST_WINDOWS:
        return None
    middle = mag[present].mean(axis=0)
    size = math.sqrt(float(np.mean(np.sum((mag[present] - middle) ** 2, axis=1))))
    if not size > _TINY:
        return None
    scaled, parts = (mag - middle) / size, windowed.part_count(t, gyr, LENGTH)
    fit: _InUseFit | None = None
    try:
        for k in range(_ROUNDS):
            errors = windowed.Gyroscope(np.zeros((1, 3)), np.zeros((3, 3)), 0.0) if fit is None else fit.gyr
            windows = windowed.mean_windows(t, scaled, gyr, edges, LENGTH / parts, parts, errors)
            before, fit = fit, _InUseFit(windows, float(t[-1] - t[0]), gyr_gain_sd, fit)
            if not fit.run(steady=k >= _SWINGING):
                return None
            if before is not None:
                way = fit.parameters() - before.parameters()
                if math.sqrt(float(way @ fit.equations().normal @ way)) < _SETTLED:
                    return fit.result(middle, size)
            if before is not None and k >= _SWINGING:
                fit.meet(before)
        return None
    except np.linalg.LinAlgError:  # the steps led to where nothing determines the fields
        return None


class _PartNoise(NamedTuple):
    """Standard deviations about an axis, of a part and of the field's walk, and how many parts count as one."""

    part: float
    memory: float
    walk: float


class _FieldFreeEquations(NamedTuple):
    """Normal equations without the fields."""

    # normal, slope: (n, n), of the n parameters
    normal: Floats
    slope: Floats
    # steps, by_own: (W, 3), step of each field, less `by_own` times that of the parameters
    steps: Floats
    by_own: Floats
    scores: Floats  # (W, n), share of each window in the slope
    # free, sd: (W, 3), step of each field by its window alone, and its standard deviation along an axis
    free: Floats
    sd: Floats


class _InUseFit:
    """Steps of Gauss and Newton on all parameters."""

    def __init__(
        self, windows: windowed.Windows, lasting: float, gyr_gain_sd: float, before: "_InUseFit | None"
    ) -> None:
        self.windows, self.lasting, self.gyr_gain_sd = windows, lasting, gyr_gain_sd
        self.segments = windowed.segments_in(lasting)
        self.segment = windowed.segment_index(windows.start, lasting, self.segments)
        self.links = np.flatnonzero(windows.linked)
        self.priors = self._priors()
        nothing = windowed.Gyroscope(np.zeros((self.segments, 3)), np.zeros((3, 3)), 0.0)
        self.base: windowed.Gyroscope = nothing if before is None else before.gyr
        self.gyr: windowed.Gyroscope = self.base
        self.distortion: Floats = np.eye(3) if before is None else before.distortion
        self.bias: Floats = np.zeros(3) if before is None else before.bias
        inverse = np.linalg.inv(self.distortion).T  # fields of the windows by what is known of the sensors so far
        calibrated = (windows.fields - self.bias) @ inverse * windows.known[:, :, np.newaxis]
        self.h = np.einsum("wpij,wpi->wj", windows.turns, calibrated) / windows.known.sum(axis=1)[:, np.newaxis]
        self.noise: _PartNoise = (
            _PartNoise(_sd(self._misfit()[windows.known]), 1.0, 0.1) if before is None else before.noise
        )

    @property
    def size(self) -> int:
        """Number of parameters: the magnetometer's, the gyroscope's gain, and its bias of each segment."""
        return _ALL - 3 + 3 * self.segments

    def meet(self, other: "_InUseFit") -> None:
        """Go half way to another fit."""
        self.distortion, self.bias = 0.5 * (self.distortion + other.distortion), 0.5 * (self.bias + other.bias)
        mine, theirs = self.gyr, other.gyr
        self.gyr = windowed.Gyroscope(
            0.5 * (mine.bias + theirs.bias), 0.5 * (mine.gain + theirs.gain), 0.5 * (mine.delay + theirs.delay)
        )

    def run(self, *, steady: bool) -> bool:
        """Alternate between steps and, unless it is steady, the sizes of noise; False where they do not settle."""
        for k in range(_STEPS):
            system = self.equations()
            if not (np.isfinite(system.normal).all() and np.isfinite(system.slope).all()):
                return False
            step = windowed.floored_inverse(system.normal) @ system.slope
            if k < _STEPS // 3 and not steady:
                self.noise = self._noise(system)
            self._move(step, system, 1.0 if k < _STEPS // 3 else 0.5)  # some swing to and fro
            if float(step @ system.normal @ step) < _ENOUGH**2 * _ALL:
                return bool(np.linalg.det(self.distortion) > 0.0)
        return False

    def result(self, middle: Floats, size: float) -> InUseFit:
        """Take the scaling back; A comes before b in the steps, and after it in the covariance."""
        from scipy.special import chdtri

        system = self.equations()
        covariance, lengths = self._covariance(system)[:12, :12], np.linalg.norm(self.h, axis=1)
        length = float(np.median(lengths))
        # what differs from cluster to cluster averages out
        scatter = MAD * float(np.median(np.abs(lengths - length))) / max(1.0, self.lasting / CLUSTER) ** 0.5
        valid = self.windows.known
        residuals = self._misfit()[valid]
        spread = np.sqrt(np.diag(system.normal))
        order, scale = np.r_[9:12, :9], size * np.r_[np.ones(3), np.full(9, length)]
        entries = np.r_[np.zeros(3), self.distortion.ravel()]
        covariance = covariance[np.ix_(order, order)] + (scatter / length) ** 2 * np.outer(entries, entries)
        return InUseFit(
            self.distortion * size * length,
            middle + size * self.bias,
            covariance * np.outer(scale, scale),
            middle + size * self.windows.fields[valid],
            residuals * size,
            np.sum(residuals * residuals, axis=1) <= chdtri(3.0, FALSE_ALARM / len(residuals)) * self.noise.part**2,
            self.gyr.bias,
            self.gyr.delay,
            self.noise.walk / length,
            len(valid),
            float(np.linalg.cond(system.normal / np.outer(spread, spread))),
        )

    def _covariance(self, system: _FieldFreeEquations) -> Floats:
        """Covariance of the parameters: by the noise, and by how clusters of windows differ, where that is more.

        Clusters are a minute long, or shorter so that there are enough of them to tell.
        """
        inverse = windowed.floored_inverse(system.normal)
        cluster = (self.windows.start / min(CLUSTER, max(LENGTH, self.lasting / (4.0 * _ALL)))).astype(np.intp)
        sums = np.zeros((cluster.max() + 1, self.size))
        np.add.at(sums, cluster, system.scores)
        count = len(np.unique(cluster))
        spread = inverse @ sums.T * math.sqrt(count / max(1.0, count - min(_ALL, 0.5 * count)))  # [Liang1986]
        return larger(inverse, np.asarray(spread @ spread.T))

    def _priors(self) -> Floats:
        """Inverse covariance of all parameters before anything is measured."""
        precision = np.zeros((self.size, self.size))
        precision[:12, :12] = np.diag(np.repeat((_DISTORTION_SD, _HARD_IRON_SD), (9, 3)) ** -2.0)
        prior = windowed.tightness(self.gyr_gain_sd)
        precision[12, 12] = prior[12, 12]
        precision[_OWN : _OWN + 9, _OWN : _OWN + 9] = prior[3:12, 3:12]
        walk = np.eye(self.segments) - np.eye(self.segments, k=-1)
        tight = np.full(self.segments, WANDER**-2.0)
        tight[0] = prior[0, 0]
        precision[_OWN + 9 :, _OWN + 9 :] = np.kron(walk.T @ np.diag(tight) @ walk, np.eye(3))
        return precision

    def parameters(self) -> Floats:
        """What the priors hold near zero."""
        change = (self.distortion - np.eye(3)).ravel()
        return np.concatenate((change, self.bias, [self.gyr.delay], self.gyr.gain.ravel(), self.gyr.bias.ravel()))

    def _errors(self) -> Floats:
        """Bias and gain (W, 12) of the gyroscope since the attitudes were computed."""
        bias, gain = self.gyr.bias - self.base.bias, (self.gyr.gain - self.base.gain).ravel()
        return np.concatenate((bias, np.tile(gain, (self.segments, 1))), axis=1)[self.segment]

    def _body_field(self) -> Floats:
        """Field (W, P, 3) in body axes."""
        w = self.windows
        lean = np.einsum("wpij,wj->wpi", w.leans, self._errors())
        leaned = self.h[:, np.newaxis] - np.cross(lean, self.h[:, np.newaxis])
        field = np.einsum("wpij,wpj->wpi", w.turns, leaned)
        return np.asarray(field + (self.gyr.delay - self.base.delay) * np.cross(w.rates, field))

    def _misfit(self) -> Floats:
        """Residuals (W, P, 3)."""
        # departs from [Rodriguez2024]: nothing is differentiated
        return np.asarray(self.windows.fields - self._body_field() @ self.distortion.T - self.bias)

    def _noise(self, system: _FieldFreeEquations) -> _PartNoise:
        """Sizes of the noise; of the walk by the field of each window alone, less what its noise makes of it."""
        alone, noise_var = self.h + system.free, system.sd**2
        turned = np.einsum("wij,wj->wi", self.windows.leant, self._errors())
        drifted = np.concatenate((np.zeros((1, 3)), np.cumsum(turned[:-1], axis=0)))
        run = np.cumsum(~np.append(True, self.windows.linked[:-1]))
        variances = []
        lags = [max(1, min(most, len(alone) // share)) for most, share in _LAGS]
        for lag in lags:
            same = run[lag:] == run[:-lag]
            lean = (drifted[lag:] - drifted[:-lag])[same]
            step = (alone[lag:] - alone[:-lag])[same] + np.cross(lean, alone[:-lag][same])
            both = (noise_var[lag:] + noise_var[:-lag])[same]  # of its own
            beyond = (MAD * float(np.median(np.abs(step)))) ** 2 - float(np.median(both)) if same.any() else 0.0
            variances.append(max(0.0, beyond))
        walk = max(0.0, variances[1] - variances[0]) / max(1, lags[1] - lags[0])
        walk = math.sqrt(walk + _LEAST_WALK**2)
        walk, misfit = math.sqrt(self.noise.walk * walk), self._misfit()[self.windows.known]  # half way, lest it swing
        return _PartNoise(_sd(misfit), memory_of_each(misfit), walk)

    def equations(self) -> _FieldFreeEquations:
        n = self.size
        normal, scores = self.priors.copy(), np.zeros((len(self.h), n))
        residuals, body_field = self._misfit(), self._body_field()
        of_field, pull, cross = np.zeros((len(self.h), 3, 3)), np.zeros_like(self.h), np.zeros((len(self.h), 3, n))
        for segment in range(self.segments):
            here, at = np.flatnonzero(self.segment == segment), self._places(segment)
            some, scores[np.ix_(here, at)], cross[np.ix_(here, np.arange(3), at)], of_field[here], pull[here] = (
                self._of_windows(here, residuals[here], body_field[here])
            )
            normal[np.ix_(at, at)] += some
        free = np.asarray(np.linalg.solve(of_field, pull[:, :, np.newaxis])[:, :, 0], dtype=np.float64)
        sd = np.sqrt(np.einsum("wii->w", np.linalg.inv(of_field)) / 3.0)
        walks = self._walks()
        slopes, band = pull.copy(), _banded(of_field, self.links, walks.tight)
        for at, sign in ((self.links, 1.0), (self.links + 1, -1.0)):
            np.add.at(slopes, at, sign * walks.pull)
            np.add.at(cross, at, sign * walks.tight[:, np.newaxis, np.newaxis] * walks.rows)
        normal += np.einsum("l,lin,lim->nm", walks.tight, walks.rows, walks.rows)
        scores[self.links] += np.einsum("lin,li->ln", walks.rows, walks.pull)
        steps, by_own = _solved(band, slopes, cross)
        slope = scores.sum(axis=0) - np.einsum("win,wi->n", by_own, slopes) - self.priors @ self.parameters()
        normal -= np.einsum("win,wim->nm", cross, by_own)
        # A has the determinant 1, for it is the field's length that is found
        by_entry = np.linalg.inv(self.distortion).T.ravel() / 3.0
        off = float(np.linalg.slogdet(self.distortion).logabsdet) / 3.0
        normal[:9, :9] += np.outer(by_entry, by_entry) / _SIZE_SD**2
        slope[:9] -= off / _SIZE_SD**2 * by_entry
        scores -= np.einsum("win,wi->wn", by_own, pull)
        scores[self.links] -= np.einsum("lin,li->ln", by_own[self.links] - by_own[self.links + 1], walks.pull)
        return _FieldFreeEquations(normal, slope, steps, by_own, scores, free, np.asarray(sd, dtype=np.float64))

    def _of_windows(
        self, here: NDArray[np.intp], residuals: Floats, body_field: Floats
    ) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Of some windows: normal matrix, slope (n, 25) of each, and of their fields the cross terms, matrix, slope."""
        rows, back = self._rows(here, body_field)
        sd = self.noise.part
        weight = 1.0 / (self.noise.memory * sd**2 * (1.0 + np.sum(residuals * residuals, axis=2) / (CAUCHY * sd) ** 2))
        each = np.repeat(weight * self.windows.known[here], 3, axis=1)[:, :, np.newaxis]
        design, field = rows.reshape(len(here), -1, _ALL), back.reshape(len(here), -1, 3)
        design_t, field_t = np.swapaxes(design * each, 1, 2), np.swapaxes(field * each, 1, 2)
        residuals = residuals.reshape(len(here), -1, 1)
        slopes = (design_t @ residuals)[:, :, 0], (field_t @ residuals)[:, :, 0]
        return (design_t @ design).sum(axis=0), slopes[0], field_t @ design, field_t @ field, slopes[1]

    def _rows(self, here: NDArray[np.intp], body_field: Floats) -> tuple[Floats, Floats]:
        """Derivatives of what is measured by a window's parameters (n, P, 3, 25), and by its field (n, P, 3, 3)."""
        w = self.windows
        rows = np.zeros((*body_field.shape, _ALL))
        for i in range(3):
            rows[:, :, i, 3 * i : 3 * i + 3] = body_field
            rows[:, :, i, 9 + i] = 1.0
        rows[:, :, :, 12] = np.cross(w.rates[here], body_field) @ self.distortion.T
        back = self.distortion @ w.turns[here]
        by_gyr = back @ skew(self.h[here])[:, np.newaxis] @ w.leans[here]
        rows[:, :, :, _OWN : _OWN + 9] = by_gyr[:, :, :, 3:]
        rows[:, :, :, _OWN + 9 :] = by_gyr[:, :, :, :3]
        return rows, np.asarray(back)

    def _walks(self) -> "_Walks":
        """What the links add: a step of the field is zero, but for its walk."""
        before, sd = self.h[self.links], self.noise.walk
        lean = np.einsum("wij,wj->wi", self.windows.leant, self._errors())[self.links]
        step = (
            self.h[self.links + 1] - before + np.cross(lean, before)
        )  # how far the field of the place walks, in space
        tight = 1.0 / (sd**2 * (1.0 + np.sum(step * step, axis=1) / (CAUCHY * sd) ** 2))
        by_gyr = skew(self.h[self.links]) @ self.windows.leant[self.links]
        rows = np.zeros((len(self.links), 3, self.size))
        for segment in range(self.segments):
            here, at = np.flatnonzero(self.segment[self.links] == segment), self._places(segment)[_OWN:]
            rows[np.ix_(here, np.arange(3), at)] = np.concatenate((by_gyr[here, :, 3:], by_gyr[here, :, :3]), axis=2)
        return _Walks(tight, rows, tight[:, np.newaxis] * step)

    def _places(self, segment: int) -> NDArray[np.intp]:
        """Places of a window's parameters among all."""
        return np.concatenate((np.arange(_ALL - 3), _ALL - 3 + 3 * segment + np.arange(3)))

    def _move(self, step: Floats, system: _FieldFreeEquations, share: float) -> None:
        """Take a share of a step."""
        self.h = self.h + share * (system.steps - system.by_own @ step)
        step = share * step
        self.distortion = self.distortion + step[:9].reshape(3, 3)
        self.bias = self.bias + step[9:12]
        gyr = self.gyr
        self.gyr = windowed.Gyroscope(
            gyr.bias + step[_ALL - 3 :].reshape(-1, 3),
            gyr.gain + step[_OWN : _OWN + 9].reshape(3, 3),
            gyr.delay + float(step[12]),
        )


class _Walks(NamedTuple):
    """Of L links: weights (L,), derivatives (L, 3, n) by the parameters, and slopes (L, 3) of the fields."""

    tight: Floats
    rows: Floats
    pull: Floats


def _sd(residuals: Floats) -> float:
    """Standard deviation of residuals (M, 3) about an axis."""
    return max(MAD * float(np.median(np.abs(residuals))), 1e-6)


def _banded(of_field: Floats, links: NDArray[np.intp], tight: Floats) -> Floats:
    """Upper bands (4, 3 W) of the matrix of all fields: blocks of 3, joined by the links."""
    count = len(of_field)
    blocks = of_field.copy()
    for at in (links, links + 1):
        np.add.at(blocks, at, tight[:, np.newaxis, np.newaxis] * np.eye(3))
    band = np.zeros((4, 3 * count))
    for i in range(3):
        for j in range(i, 3):
            band[3 - (j - i), j::3] = blocks[:, i, j]
    joined = np.zeros((count, 3))
    joined[links + 1] = -tight[:, np.newaxis]
    band[0] = joined.ravel()
    return band


def _solved(band: Floats, pull: Floats, cross: Floats) -> tuple[Floats, Floats]:
    """Steps of all fields for their slopes (W, 3), and for the cross terms (W, 3, n)."""
    from scipy.linalg import solveh_banded

    right = np.concatenate((pull[:, :, np.newaxis], cross), axis=2)
    solution = solveh_banded(band, right.reshape(-1, right.shape[2]), check_finite=False).reshape(right.shape)
    return solution[:, :, 0], solution[:, :, 1:]


def larger(first: Floats, second: Floats) -> Floats:
    """Smallest covariance that is at least as large as both in every direction of their common axes."""
    root = np.linalg.cholesky(first)
    inside = np.linalg.solve(root, np.linalg.solve(root, second).T)
    sizes, axes = np.linalg.eigh(0.5 * (inside + inside.T))
    spread = root @ axes
    return np.asarray((spread * np.maximum(sizes, 1.0)) @ spread.T)


MOST_OUTLIERS: Final = 0.3  # a unit at work passes steel, which nobody can keep away

_ADVICE: Final = (
    "Take a longer record, in which the unit turns through all headings and leans as far as it ever does; or turn it "
    "by hand through all attitudes, and leave --in-use out."
)


def fit_mag_in_use(
    t: Floats,
    mag: Floats,
    gyr: Floats,
    *,
    acc: Floats | None = None,
    strength: float | None = None,
    dip: float | None = None,
    gyr_gain_sd: float = GAIN_SD,
    tilt_range: float = TILT_RANGE,
) -> Fitted:
    """Fit bias and full matrix so that the field turns, from moment to moment, as the gyroscope says.

    Neither need the field stay what it was, nor the gyroscope's bias: what `fit_mag_gyr` rests on, and what does not
    hold over hours of work. The idea is that of MAGYC [Rodriguez2024], but nothing is differentiated here. The
    gyroscope's bias is found every ten minutes; arguments as of `fit_mag_gyr` and `fit_mag`.
    """
    checks.require_figures(strength=strength, dip=dip, gyr_gain_sd=gyr_gain_sd, tilt_range=tilt_range)
    t, mag, gyr, acc = checks.with_rates(t, mag, gyr, acc)
    fields = mag[np.isfinite(mag).all(axis=1)]
    refuse(checks.stuck(fields) if len(fields) else None)
    fit = fit_in_use(t, mag, gyr, gyr_gain_sd=gyr_gain_sd)
    if fit is None:
        lasting, needed = float(t[-1] - t[0]) if len(t) else 0.0, FEWEST_WINDOWS * LENGTH
        if lasting < needed:
            what = f"{lasting:.3g} s of field and rates, but {needed:g} s are needed."
            raise CaptureRefusedError(Reason("too-few", what, _ADVICE))
        what = f"no bias and matrix fit how the field turned in {lasting:.3g} s, beside the rates."
        raise CaptureRefusedError(Reason("ill-conditioned", what, _ADVICE))
    matrix, covariance = distortion_to_size(fit.distortion, fit.covariance, strength)
    radius = float(np.cbrt(np.linalg.det(fit.distortion)))
    if dip is None and acc is not None:
        dip = checks.dip_angle((mag - fit.bias) @ matrix.T, acc)
    estimate = FieldEstimate(
        matrix, fit.bias, covariance, covariance, fit.residuals, fit.used, radius, fit.condition, strength,
        checks.DIP if dip is None else dip, tilt_range,
    )  # fmt: skip
    return estimate.finished(
        fit.fields,
        method="magnetometer in use, with gyroscope: the field from moment to moment",
        advice=_ADVICE,
        reasons=(checks.outliers(fit.used, checks.STEEL, MOST_OUTLIERS),),
        remarks=_remarks(fit, float(t[-1] - t[0]), strength or radius),
    )


def _remarks(fit: InUseFit, lasting: float, size: float) -> tuple[Note, ...]:
    bias = ", ".join(f"{value:.3f}" for value in to_dps(fit.gyr_bias.mean(axis=0)).tolist())
    most = to_dps(float(np.max(np.ptp(fit.gyr_bias, axis=0))))
    moved = f", which moved by {most:.2g} °/s at most" if len(fit.gyr_bias) > 1 else ""
    duration = f"{lasting / 3600.0:.3g} h" if lasting >= 3600.0 else f"{lasting / 60.0:.3g} min"
    return (
        info("calibration.in_use", windows=fit.windows, length=LENGTH, duration=duration, walk_ut=fit.walk * size),
        info(
            "calibration.in_use_gyroscope",
            bias=bias,
            moved=moved,
            turn_deg=to_deg(turn_angle(fit.distortion)),
            delay_ms=1000.0 * fit.delay,
        ),
    )
