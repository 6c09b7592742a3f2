"""What every fit of a magnetometer ends in: the calibration, the reasons that all share, and the remarks."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calib.ellipsoid.alike import Alike
from plumbob.calib.grades import HEADING, grade_of
from plumbob.calib.refusal import Reason
from plumbob.calib.regions import filled
from plumbob.cards import UNITS, Quality, TriadCalibration
from plumbob.check import Floats
from plumbob.units import deg, to_deg

DIP: Final = deg(60.0)
"""Dip that is assumed for the predicted heading error where nothing tells it, rad: that of Central Europe."""

MOST_OUTLIERS: Final = 0.1
"""Share of outliers above which a capture is refused."""

EVEN: Final = "Capture away from steel, furniture and walls, best outdoors, and turn the unit slowly about one place."
"""Advice where the field differed from place to place."""

LOST: Final = deg(30.0)
"""Predicted heading error from which on there is no heading, rad: three of it are a quarter of a turn."""

_LONG_MEMORY: Final = 10.0  # samples that count as one from which on it is told

STEEL: Final = "Look for switched currents, moving iron and steel nearby."
"""Advice where samples do not fit each other."""


def calibration_of(
    *,
    matrix: Floats,
    bias: Floats,
    covariance: Floats,
    residuals: Floats,
    used: NDArray[np.bool_],
    radius: float,
    strength: float | None,
    method: str,
    condition: float,
    heading_sd: float,
    tilt_range: float,
    directions: Floats | None = None,
) -> TriadCalibration:
    """Calibration of a magnetometer.

    Parameters
    ----------
    matrix, bias, covariance : ndarray (3, 3), (3,), (12, 12)
        Of the calibration.
    residuals : ndarray (N, ...)
        What the fit leaves, in the sensor's own scale, µT.
    used : ndarray (N,) of bool
        False for outliers.
    radius : float
        Strength of the field in the sensor's own scale, µT.
    strength : float or None
        Strength that it was scaled to, µT.
    method : str
        How it was found.
    condition, heading_sd, tilt_range : float
        Of the `Quality`.
    directions : ndarray (N, 3), optional
        Measured field from its centre, where directions count.
    """
    return TriadCalibration(
        matrix=matrix,
        bias=bias,
        unit_in=UNITS["mag"],
        unit_out=UNITS["mag"],
        residual_rms=float(np.sqrt(np.mean(residuals[used] ** 2))) * (strength or radius) / radius,
        covariance=covariance,
        reference=strength,
        method=method,
        quality=Quality(
            grade=grade_of(heading_sd, HEADING) or "poor",
            samples=int(np.count_nonzero(used)),
            outliers=int(np.count_nonzero(~used)),
            regions=None if directions is None else int(np.count_nonzero(filled(directions[used]))),
            condition=condition,
            heading_sd=heading_sd,
            tilt_range=tilt_range,
        ),
    )


def outliers(used: NDArray[np.bool_], advice: str) -> Reason | None:
    """Reason to refuse a fit with too many outliers (N,), with what to do; None where there are few."""
    share = float(np.mean(~used))
    if share <= MOST_OUTLIERS:
        return None
    what = f"{100.0 * share:.0f} % of the samples do not fit the others; {100.0 * MOST_OUTLIERS:.0f} % may."
    return Reason("outliers", what, advice)


def uncertain(sd: float, shared: Alike, advice: str) -> Reason | None:
    """Reason to refuse a fit that leaves a heading error, rad, beyond *poor*, with what to do; None where less."""
    if sd <= HEADING.poor:
        return None
    what = f"the capture leaves {heading_told(sd)}."
    return uneven(sd, shared) or Reason("ill-conditioned", what, advice)


def where_known(sd: float, *reasons: Reason | None) -> tuple[Reason | None, ...]:
    """Reasons that rest on the result; none where its heading error, rad, is beyond *poor*: they would tell noise."""
    return reasons if sd <= HEADING.poor else ()


def uneven(sd: float, shared: Alike) -> Reason | None:
    """Reason to refuse a heading error, rad, beyond *poor* only because errors do not average out; None else."""
    if not sd / math.sqrt(shared.factor) <= HEADING.poor < sd:
        return None
    what = (
        "what the fit leaves does not average out as noise does, but stays while the unit turns, as where the field "
        f"differs from place to place, or the sensor is slow; that leaves {heading_told(sd)}."
    )
    return Reason("uneven-field", what, EVEN)


def heading_told(sd: float) -> str:
    """Heading error, rad, in words."""
    return f"a heading error of {to_deg(sd):.2g}° (1 sd)" if sd < LOST else "no heading at all"


def uneven_told(shared: Alike) -> tuple[str, ...]:
    """Remark where the field differed from place to place, or errors have a long memory."""
    if shared.unevenness <= shared.memory:
        told = (
            f"What the fit leaves has a memory: {shared.memory:.0f} neighbouring samples count as one. Filters, drifts "
            "and uneven fields make one.",
        )
        return told if shared.memory > _LONG_MEMORY else ()
    return (
        "UNEVEN: what the fit leaves stays while the unit turns, as where the field differs from place to place; the "
        f"predicted errors are {math.sqrt(shared.unevenness / shared.memory):.2g} times as large for it. {EVEN}",
    )


def own_scale(strength: float | None, size: float) -> tuple[str, ...]:
    """Remark where the strength of the field was not given, and is `size`, µT, by the sensor."""
    if strength is not None:
        return ()
    return (f"Field strength: {size:.4g} µT, the sensor's own scale; only the directions are calibrated.",)


def thinned(stride: int) -> tuple[str, ...]:
    """Remark where not every sample was fitted."""
    return (f"One of every {stride} samples was fitted.",) if stride > 1 else ()


def set_aside(used: NDArray[np.bool_]) -> tuple[str, ...]:
    """Remark on outliers (N,)."""
    count = int(np.count_nonzero(~used))
    return (f"{count} of {len(used)} samples were set aside as outliers.",) if count else ()


def dip_of(field: Floats, force: Floats) -> float:
    """Dip of calibrated fields (N, 3), rad, by the specific forces (N, 3) at the same instants, which point up."""
    down = -np.sum(field * force, axis=1) / np.linalg.norm(field, axis=1) / np.linalg.norm(force, axis=1)
    return float(np.arcsin(np.clip(np.median(down), -1.0, 1.0)))
