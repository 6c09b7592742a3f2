"""Accelerometer from a recording: by the means of its stretches at rest, or by slow tumbling beside a gyroscope."""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.acc import fit_accel, fit_accel_moving
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason
from plumbob.calibration.predicted import TILT_RANGE
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError
from plumbob.core.findings import info
from plumbob.data import ImuData
from plumbob.data.cards import TriadCalibration
from plumbob.quality.static_periods import stills

LEAST: Final = 1.0
"""Shortest stretch at rest that counts as a pose, s."""

FEWEST_ROWS: Final = 100
"""Samples of accelerometer and gyroscope that a capture without rests must have."""

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

    Of a unit that tumbled slowly without rests (`moving`) the gyroscope stands in for them: ParameterError where it is
    not there. The rest, and CaptureRefusedError, as in `plumbob.calibration.acc.fit_accel`.
    """
    if moving:
        return _tumbled(imu, shape, gravity, tilt_range)
    poses = poses_at_rest(imu)
    fit = fit_accel(poses.means, shape=shape, noise=poses.noise, gravity=gravity, tilt_range=tilt_range)
    remarks = [info("calibration.poses", count=len(poses.spans), shortest=_shortest(poses))]
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
    """Stretches of at least `LEAST` at rest.

    CaptureRefusedError if there are none, or the accelerometer is at the end of its range in one.
    """
    rows, gyr = _complete(imu)
    t, acc = imu.t[rows], imu.usable("acc")[rows]
    spans = stills(t, acc, gyr, least=LEAST) if t.size else []
    if not spans:
        raise CaptureRefusedError(_not_still(imu, int(t.size)))
    _refuse_clipped(imu, rows, spans)
    means = np.array([acc[span].mean(axis=0) for span in spans])
    variances = [_variance(acc[span]) for span in spans]
    temp_c = np.zeros(0) if imu.temp_c is None else np.concatenate([imu.temp_c[rows][span] for span in spans])
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


def _variance(acc: Floats) -> float:
    """Variance of the length of a pose's mean, by that of its parts: with slow noise, without tremor of hands."""
    parts = acc[: len(acc) // _PARTS * _PARTS].reshape(_PARTS, -1, 3).mean(axis=1)
    return float(np.linalg.norm(parts, axis=1).var(ddof=1)) / _PARTS


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


def _not_still(imu: ImuData, count: int) -> Reason:
    lasting = float(imu.t[-1] - imu.t[0])
    return Reason(
        "not-still",
        f"nothing in {lasting:.1f} s ({count} of {len(imu)} samples with a specific force) is at rest for {LEAST:g} s.",
        "Hold each pose for 2 s or more against something solid, and turn the unit quickly in between; or, where it "
        "tumbled slowly beside a gyroscope, ask for that with --moving.",
    )


def _shortest(poses: RestPeriods) -> float:
    return min(stop - start for start, stop in poses.spans)


def _warmed(calibration: TriadCalibration, temp_c: Floats) -> TriadCalibration:
    """Calibration that says at which temperature it was made."""
    if not temp_c.size:
        return calibration
    span = float(temp_c.min()), float(temp_c.max())
    return replace(calibration, temp_ref_c=float(temp_c.mean()), temp_span_c=span)
