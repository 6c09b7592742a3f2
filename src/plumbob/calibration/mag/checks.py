"""What the fits of a magnetometer share: arguments, the calibration they end in, reasons to refuse it, and remarks."""

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.calibration.fit import HEADING, Fitted, Reason, grade_of, reason_if, refuse
from plumbob.calibration.mag.field_gradient import Unevenness
from plumbob.calibration.predicted import filled
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
_MOST_UNEQUAL: Final = 3.0


MOST_CLIPPED: Final = 0.01  # share of clipped samples above which a capture is refused


def clipped(at_end: NDArray[np.bool_]) -> Reason | None:
    """Reason to refuse samples (N,) too many of which are at the end of the range; None where few are."""
    share = float(np.mean(at_end)) if len(at_end) else 0.0
    most = f"at most {100.0 * MOST_CLIPPED:.0f} % may be"
    what = f"{100.0 * share:.1f} % of the samples are at the end of the range; {most}."
    advice = "Choose a wider range, and remove magnets and steel from around the sensor."
    return reason_if(not share <= MOST_CLIPPED, "clipping", what, advice)


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
    return reason_if(not ratio <= _MOST_UNEQUAL, "implausible", what, advice)


def wrong_field(radius: float, strength: float | None) -> Reason | None:
    """Reason to refuse a field that measures `radius` in the sensor's own scale, µT, where it is `strength`."""
    low, high = (WEAKEST, STRONGEST) if strength is None else (0.6 * strength, 1.6 * strength)
    what = f"the field measures {radius:.3g} µT in the sensor's own scale, but {low:.3g} to {high:.3g} µT can be."
    advice = "Check the unit and the gain of the magnetometer, and that the capture was not taken beside a magnet."
    return reason_if(not low <= radius <= high, "wrong-field", what, advice)


DIP: Final = deg(60.0)  # assumed for the predicted error where nothing tells it, rad: that of Central Europe
MOST_OUTLIERS: Final = 0.1  # share of outliers above which a capture is refused
EVEN: Final = "Capture away from steel, furniture and walls, best outdoors, and turn the unit slowly about one place."

LOST: Final = deg(30.0)  # predicted error above which there is no heading, rad; thrice as much is a quarter of a turn
_LONG_MEMORY: Final = 10.0  # samples that count as one, above which it is told
_COUNTS: Final = 1.5  # predicted error over that of an even field, above which it is told
STEEL: Final = "Look for switched currents, moving iron and steel nearby."  # advice where samples do not fit each other


class Doubt(NamedTuple):
    """What is predicted, and why."""

    # sd, even: heading error, rad: of the calibration, and were the field even
    sd: float
    even: float
    field: Unevenness  # how uneven it was, or may have been
    memory: float  # how many neighbouring samples count as one
    shown: bool  # whether the residuals show that the field was uneven


class FieldEstimate(NamedTuple):
    """Result of a fit of a magnetometer."""

    # matrix, bias: (3, 3), of the calibration; bias in µT
    matrix: Floats
    bias: Floats
    covariance: Floats  # (12, 12), of bias and matrix
    residuals: Floats  # (N, ...), of the samples, in the sensor's own scale, µT
    used: NDArray[np.bool_]  # (N,), false for outliers
    radius: float  # strength of the field in the sensor's own scale, µT
    condition: float  # of the normal matrix scaled to a diagonal of one
    # strength of the field to which the matrix leads, µT; None where it keeps the sensor's scale
    strength: float | None
    solid: bool = True  # whether all axes were fitted, so that directions count

    def finished(
        self,
        measured: Floats,
        doubt: Doubt,
        *,
        tilt_range: float,
        method: str,
        reasons: Iterable[Reason | None],
        remarks: tuple[Note, ...],
        stride: int = 1,
    ) -> Fitted:
        """Fit of the measured field (N, 3), µT, every `stride`-th that there was; or the reasons to refuse it.

        Those that rest on the result count where its heading error is not beyond *poor*: else they would be of noise.
        """
        sd, used, count = doubt.sd, self.used, int(np.count_nonzero(~self.used))
        sure = self.solid and sd <= HEADING.poor
        refuse(*reasons, *((unequal(self.matrix), wrong_field(self.radius, self.strength)) if sure else ()))
        unscaled = self.strength is None and self.solid
        scale = (info("calibration.own_scale", size=self.radius),) if unscaled else ()
        thinned = (info("calibration.thinned", stride=stride),) if stride > 1 else ()
        aside = (info("calibration.set_aside", count=count, samples=len(used)),) if count else ()
        quality = Quality(
            grade=grade_of(sd, HEADING) or "poor",
            samples=int(np.count_nonzero(used)),
            outliers=count,
            regions=int(np.count_nonzero(filled((measured - self.bias)[used]))) if self.solid else None,
            condition=self.condition,
            heading_sd=sd,
            tilt_range=tilt_range,
        )
        size = (self.strength or self.radius) / self.radius
        calibration = TriadCalibration(
            matrix=self.matrix,
            bias=self.bias,
            unit_in=UNITS["mag"],
            unit_out=UNITS["mag"],
            residual_rms=float(np.sqrt(np.mean(self.residuals[used] ** 2))) * size,
            covariance=self.covariance,
            reference=self.strength,
            method=method,
            quality=quality,
        )
        told = (*remarks, *scale, *thinned, *aside, *uneven_told(doubt))
        return Fitted(calibration, measured, self.residuals, used, told)


def outliers(used: NDArray[np.bool_], advice: str, most: float = MOST_OUTLIERS) -> Reason | None:
    """Reason to refuse a fit with too many outliers (N,), with what to do; None where there are few."""
    share = float(np.mean(~used))
    what = f"{100.0 * share:.0f} % of the samples do not fit the others; at most {100.0 * most:.0f} % may."
    return reason_if(not share <= most, "outliers", what, advice)


def uncertain(doubt: Doubt, advice: str) -> Reason | None:
    """Reason to refuse a fit that leaves a heading error beyond *poor*, with what to do; None where less."""
    if doubt.sd <= HEADING.poor:
        return None
    what = f"the capture leaves {heading_told(doubt.sd)}."
    return (uneven(doubt) if doubt.shown else None) or Reason("ill-conditioned", what, advice)


def uneven(doubt: Doubt) -> Reason | None:
    """Reason to refuse a heading error beyond *poor* only because of an uneven field, shown or not; None else."""
    if not doubt.even <= HEADING.poor < doubt.sd:
        return None
    if not doubt.shown:
        what = (
            "the unit turned too little to show whether the field is even, and in most rooms it is not; that leaves "
            f"{heading_told(doubt.sd)}."
        )
        return Reason(
            "too-few-regions",
            what,
            f"Keep turning it for a minute or two, through all attitudes, each several times. {EVEN}",
        )
    what = (
        "the residuals do not average out as noise does, but persist while the unit turns, as where the field "
        f"differs from place to place, or the sensor is slow; that leaves {heading_told(doubt.sd)}."
    )
    return Reason("uneven-field", what, EVEN)


def heading_told(sd: float) -> str:
    """Heading error, rad, in words."""
    return f"a heading error of {to_deg(sd):.2g}° (1 sd)" if sd < LOST else "no heading at all"


def uneven_told(doubt: Doubt) -> tuple[Note, ...]:
    """Remarks where the field differed from place to place or may have, or errors have a long memory."""
    more = doubt.sd / doubt.even if doubt.even > 0.0 else 1.0
    text = f"this makes the predicted error {more:.2g} times that of an even field."
    if doubt.shown:
        return (warning("calibration.field_uneven", effect=text),)
    remarks: list[Note] = []
    if more > _COUNTS and doubt.field.short:
        remarks.append(warning("calibration.field_short", sd=doubt.field.sd, effect=text))
    elif more > _COUNTS:
        remarks.append(warning("calibration.length_alone", sd=doubt.field.sd, effect=text))
    if doubt.memory > _LONG_MEMORY:
        remarks.append(info("calibration.autocorrelated", memory=doubt.memory))
    return tuple(remarks)


def dip_angle(field: Floats, force: Floats) -> float:
    """Dip of calibrated fields (N, 3), rad, by the specific forces (N, 3) at the same instants, which point up."""
    down = -np.sum(field * force, axis=1) / np.linalg.norm(field, axis=1) / np.linalg.norm(force, axis=1)
    return float(np.arcsin(np.clip(np.median(down), -1.0, 1.0)))
