"""What the fits of a magnetometer share: arguments, the calibration they end in, reasons to refuse it, and remarks."""

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.calibration.autocorrelation import Alike
from plumbob.calibration.fit import HEADING, Fitted, Reason, grade_of, refuse
from plumbob.calibration.mag.field_gradient import Unevenness
from plumbob.calibration.predicted import NAMES, filled, heading_sd, region_names
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.findings import Note, info, warning
from plumbob.core.units import deg, to_deg
from plumbob.data.cards import UNITS, Quality, TriadCalibration


def finite_rows(name: str, value: ArrayLike, count: int | None = None) -> Floats:
    """Return samples (N, 3) as float64; of one length with the field where `count` is given, and all finite."""
    rows = check.rows(name, value, 3)
    if count is not None and len(rows) != count:
        raise ShapeError(f"{name} must have one row per sample of the field ({count}), but it has {len(rows)}.")
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        i = int(np.argmin(finite))
        raise ShapeError(f"{name} must be finite, but {name}[{i}] = {rows[i].tolist()}; leave such samples out.")
    return rows


def forces(value: ArrayLike, count: int) -> Floats:
    """Return specific forces (N, 3), m/s², as float64: as many as of the field, finite, and none of them zero."""
    acc = finite_rows("acc", value, count)
    nothing = ~acc.any(axis=1)
    if nothing.any():
        i = int(np.argmax(nothing))
        raise ShapeError(f"acc gives the vertical, but acc[{i}] is zero and has no direction. Leave such samples out.")
    return acc


def require_figures(
    *, strength: float | None = None, dip: float | None = None, gyr_gain_sd: float = 0.0, tilt_range: float = 0.0
) -> None:
    """Refuse a field, a gyroscope's gain or a largest inclination that cannot be; arguments as of the fits."""
    if strength is not None and not 0.0 < strength < math.inf:
        raise ParameterError(
            f"strength must be above 0 µT, but it is {strength:g} µT; leave it out where it is not known."
        )
    if dip is not None and not abs(dip) < math.pi / 2.0:
        raise ParameterError(
            f"dip must lie between -π/2 and π/2 rad, but it is {dip:g} rad; turn degrees into radians first."
        )
    if not 0.0 <= gyr_gain_sd <= 1.0:
        raise ParameterError(
            f"gyr_gain_sd must be from 0 to 1, a share of the gain, but it is {gyr_gain_sd:g}; divide percents by 100."
        )
    if not 0.0 <= tilt_range <= math.pi / 2.0:
        raise ParameterError(
            f"tilt_range must be from 0 to π/2 rad, but it is {tilt_range:g} rad; turn degrees into radians first."
        )


def with_rates(
    t: ArrayLike, mag: ArrayLike, gyr: ArrayLike, acc: ArrayLike | None
) -> tuple[Floats, Floats, Floats, Floats | None]:
    """Return time (N,), field (N, 3), rates and specific force, as float64: rates finite, of the others some."""
    t = check.column("t", t)
    if t.size:
        check.increasing_time("t", t)
    mag = check.rows("mag", mag, 3, t.size)
    gyr = finite_rows("gyr", check.rows("gyr", gyr, 3, t.size))
    if acc is None:
        return t, mag, gyr, None
    acc = check.rows("acc", acc, 3, t.size)
    if not np.isfinite(acc).all(axis=1).any():
        raise ShapeError("acc must have a finite sample at least, but it has none; leave it out.")
    return t, mag, gyr, acc


WEAKEST, STRONGEST = 15.0, 90.0  # of the Earth's field in a sensor's own scale, µT: 22 to 67 µT with a third of error
WEAKEST_LEVEL: Final = 2.0  # µT of level field, of which nobody can tell a heading
_MOST_UNEQUAL: Final = 3.0


MOST_CLIPPED: Final = 0.01  # share of clipped samples above which a capture is refused


def clipped(at_end: NDArray[np.bool_]) -> Reason | None:
    """Reason to refuse samples (N,) too many of which are at the end of the range; None where few are."""
    share = float(np.mean(at_end)) if len(at_end) else 0.0
    most = f"at most {100.0 * MOST_CLIPPED:.0f} % may be"
    what = f"{100.0 * share:.1f} % of the samples are at the end of the range; {most}."
    advice = "Choose a wider range, and remove magnets and steel from around the sensor."
    return None if share <= MOST_CLIPPED else Reason("clipping", what, advice)


def stuck(mag: Floats, title: str = "magnetometer", unit: str = "µT") -> Reason | None:
    """Reason to refuse vectors (N, 3) one or two axes of which always read the same; None where none does."""
    same = np.ptp(mag, axis=0) == 0.0
    if not same.any() or same.all():
        return None
    axes = " and ".join("xyz"[i] for i in np.flatnonzero(same))
    read = " and ".join(f"{value:.4g}" for value in mag[0, same].tolist())
    return Reason(
        "implausible",
        f"{axes} of the {title} always {'reads' if same.sum() == 1 else 'read'} {read} {unit}.",
        "That axis is defective, or a wrong column is read; look at the recording with 'plumbob info'.",
    )


def unequal(matrix: Floats) -> Reason | None:
    """Reason to refuse a matrix (3, 3) whose gains differ too much between directions."""
    gains = np.linalg.svd(matrix, compute_uv=False)
    ratio = float(gains[0] / gains[-1])
    what = f"the sensitivity would differ by a factor of {ratio:.1f} between directions."
    advice = (
        "Look for steel right beside the sensor, and for a defective axis; then capture again through all attitudes."
    )
    return None if ratio <= _MOST_UNEQUAL else Reason("implausible", what, advice)


def wrong_field(radius: float, strength: float | None, *, solid: bool = True) -> Reason | None:
    """Reason to refuse a field, or where not `solid` its level part, that measures `radius`, µT, and is `strength`."""
    low, high = (WEAKEST if solid else WEAKEST_LEVEL, STRONGEST)
    if strength is not None:
        low, high = 0.6 * strength, 1.6 * strength
    field = "field" if solid else "level field"
    what = f"the {field} measures {radius:.3g} µT in the sensor's own scale, but {low:.3g} to {high:.3g} µT can be."
    advice = "Check the unit and the gain of the magnetometer, and that the capture was not taken beside a magnet."
    return None if low <= radius <= high else Reason("wrong-field", what, advice)


DIP: Final = deg(60.0)  # assumed for the predicted error where nothing tells it, rad: that of Central Europe
MOST_OUTLIERS: Final = 0.1  # share of outliers above which a capture is refused
EVEN: Final = "Capture away from steel, furniture and walls, best outdoors, and turn the unit slowly about one place."

LOST: Final = deg(30.0)  # predicted error above which there is no heading, rad; thrice as much is a quarter of a turn
_LONG_MEMORY: Final = 10.0  # samples that count as one, above which it is told
_COUNTS: Final = 1.5  # predicted error over that of an even field, above which it is told
STEEL: Final = "Look for switched currents, moving iron and steel nearby."  # advice where samples do not fit each other


class FieldEstimate(NamedTuple):
    """Result of a fit of a magnetometer, and what its covariance rests on."""

    # matrix, bias: (3, 3), of the calibration; bias in µT
    matrix: Floats
    bias: Floats
    covariance: Floats  # (12, 12), of bias and matrix
    even: Floats  # (12, 12), the same, were the field even
    residuals: Floats  # (N, ...), of the samples, in the sensor's own scale, µT
    used: NDArray[np.bool_]  # (N,), false for outliers
    radius: float  # strength of the field in the sensor's own scale, µT
    condition: float  # of the normal matrix scaled to a diagonal of one
    # strength of the field to which the matrix leads, µT; None where it keeps the sensor's scale
    strength: float | None
    dip: float  # of the field for which the heading error is predicted, rad
    tilt_range: float  # inclination up to which it is, rad
    field: Unevenness = Unevenness()  # how uneven the field was, or may have been
    alike: Alike = Alike(1.0)  # how many samples count as one; more by what stays than as neighbours shows a field
    axes: tuple[int, ...] = (0, 1, 2)  # that were fitted

    def finished(
        self,
        measured: Floats,
        *,
        method: str,
        advice: str,
        reasons: Iterable[Reason | None],
        remarks: tuple[Note, ...],
        alone: bool = False,
        stride: int = 1,
    ) -> Fitted:
        """Fit of the measured field (N, 3), µT, every `stride`-th that there was; or the reasons to refuse it.

        Those that rest on the result count where its heading error is not beyond *poor*: else they would be of noise.
        `alone`: by the field's directions, no other sensor helped; `advice` says what else would make it better.
        """
        strength, used, count = self.strength or self.radius, self.used, int(np.count_nonzero(~self.used))
        sd, even = (
            heading_sd(self.matrix, covariance, size=strength, dip=self.dip, tilt_range=self.tilt_range)
            for covariance in (self.covariance, self.even)
        )
        directions, solid = (measured - self.bias)[used], len(self.axes) == len(self.bias)
        if sd <= HEADING.poor:
            fitted = self.matrix[np.ix_(self.axes, self.axes)]
            refuse(*reasons, unequal(fitted), wrong_field(self.radius, self.strength, solid=solid))
        else:
            refuse(*reasons, self.uncertain(sd, even, advice, directions if alone else None))
        scale = (info("calibration.own_scale", size=self.radius),) if self.strength is None and solid else ()
        thinned = (info("calibration.thinned", stride=stride),) if stride > 1 else ()
        aside = (info("calibration.set_aside", count=count, samples=len(used)),) if count else ()
        quality = Quality(
            grade=grade_of(sd, HEADING) or "poor",
            samples=int(np.count_nonzero(used)),
            outliers=count,
            regions=int(np.count_nonzero(filled(directions))) if solid else None,
            condition=self.condition,
            heading_sd=sd,
            tilt_range=self.tilt_range,
        )
        calibration = TriadCalibration(
            matrix=self.matrix,
            bias=self.bias,
            unit_in=UNITS["mag"],
            unit_out=UNITS["mag"],
            residual_rms=float(np.sqrt(np.mean(self.residuals[used] ** 2))) * strength / self.radius,
            covariance=self.covariance,
            reference=self.strength,
            method=method,
            quality=quality,
        )
        unevenness = self._unevenness(sd / even if even > 0.0 else 1.0)
        return Fitted(calibration, measured, self.residuals, used, (*remarks, *scale, *thinned, *aside, *unevenness))

    def uncertain(self, sd: float, even: float, advice: str, directions: Floats | None) -> Reason:
        """Reason to refuse a heading error of `sd`, rad, beyond *poor*, that an even field would leave `even` of.

        Of a magnetometer alone, the `directions` (N, 3) of its field explain it.
        """
        error = f"a heading error of {to_deg(sd):.2g}° (1 sd)" if sd < LOST else "no heading at all"
        if even <= HEADING.poor and self.alike.unevenness > self.alike.memory:
            what = (
                "the residuals do not average out as noise does, but persist while the unit turns, as where the field "
                f"differs from place to place, or the sensor is slow; that leaves {error}."
            )
            return Reason("uneven-field", what, EVEN)
        if directions is None:
            return Reason("ill-conditioned", f"the capture leaves {error}.", advice)
        if not even <= HEADING.poor:
            return Reason("too-few-regions", f"the capture leaves {error}; {regions_seen(directions)}.", advice)
        what = (
            "the unit turned too little to show whether the field is even, and in most rooms it is not; that leaves "
            f"{error}."
        )
        longer = f"Keep turning it for a minute or two, through all attitudes, each several times. {EVEN}"
        return Reason("too-few-regions", what, longer)

    def _unevenness(self, more: float) -> tuple[Note, ...]:
        """Remarks where the field differed from place to place or may have, or errors have a long memory.

        `more` is the predicted error over that of an even field.
        """
        text = f"this makes the predicted error {more:.2g} times that of an even field."
        if self.alike.unevenness > self.alike.memory:
            return (warning("calibration.field_uneven", effect=text),)
        code = "calibration.field_short" if self.field.short else "calibration.length_alone"
        counts = (warning(code, sd=self.field.sd, effect=text),) if more > _COUNTS else ()
        lasting = self.alike.memory > _LONG_MEMORY
        return (*counts, *((info("calibration.autocorrelated", memory=self.alike.memory),) if lasting else ()))


def regions_seen(directions: Floats) -> str:
    """How many of the 18 directions were seen, by vectors (N, 3) from the centre, and which were not, in words."""
    empty = np.flatnonzero(filled(directions) == 0).tolist()
    text = f"{len(NAMES) - len(empty)} of {len(NAMES)} directions were seen"
    return f"{text}, missing {region_names(empty)}" if empty else text


def outliers(used: NDArray[np.bool_], advice: str, most: float = MOST_OUTLIERS) -> Reason | None:
    """Reason to refuse a fit with too many outliers (N,), with what to do; None where there are few."""
    share = float(np.mean(~used))
    what = f"{100.0 * share:.0f} % of the samples do not fit the others; at most {100.0 * most:.0f} % may."
    return None if share <= most else Reason("outliers", what, advice)


def dip_angle(field: Floats, force: Floats, fewest: int = 1) -> float | None:
    """Dip of calibrated fields (N, 3), rad, by the specific forces (N, 3) at the same instants, which point up.

    None where fewer than `fewest` rows tell it: those in which both are finite, and the force is not zero.
    """
    tells = np.isfinite(field).all(axis=1) & np.isfinite(force).all(axis=1) & force.any(axis=1)
    if np.count_nonzero(tells) < fewest:
        return None
    field, force = field[tells], force[tells]
    down = -np.sum(field * force, axis=1) / np.linalg.norm(field, axis=1) / np.linalg.norm(force, axis=1)
    return float(np.arcsin(np.clip(np.median(down), -1.0, 1.0)))
