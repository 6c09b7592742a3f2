"""Remarks on an evaluation: what a careful colleague would say before anybody quotes the numbers."""

from typing import TYPE_CHECKING

import numpy as np

from plumbob import flags
from plumbob.check import Floats
from plumbob.data import UNCALIBRATED
from plumbob.errors import ShapeError
from plumbob.evaluate.align import Alignment, find_heading, find_mounting
from plumbob.evaluate.headings import HeadingPolicy
from plumbob.evaluate.metrics import GIMBAL_GUARD, total_rmse
from plumbob.rotations import IDENTITY, Frame, quat_angle
from plumbob.units import deg, to_deg

if TYPE_CHECKING:
    from plumbob.evaluate.evaluation import Evaluation

_SUSPICIOUS = deg(2.0)
_EXPLAINED = 1.0 / 3.0
_PROBE = 20_000  # samples that suffice to suspect a constant
_REPEATS = 0.95


def remarks(evaluation: "Evaluation", policy: HeadingPolicy) -> tuple[str, ...]:
    """Remarks in the order in which things were done; none where there is nothing to say."""
    found = [_frames(evaluation), policy.note, _repeating_motion(evaluation), _fitted(evaluation)]
    found += [_gimbal(evaluation), _free_heading(evaluation), _uncalibrated(evaluation)]
    if policy.comparable and not evaluation.settings.align:
        found.append(_constant_part(evaluation))
    return tuple(remark for remark in found if remark)


def _frames(e: "Evaluation") -> str:
    if e.estimate.frame is e.reference.frame:
        return ""
    return f"the reference was converted from {e.reference.frame} to the estimate's frame, {e.estimate.frame}"


def _repeating_motion(e: "Evaluation") -> str:
    time = e.alignment.time
    if time is None or time.rival is None or time.rival_at is None or time.rival < _REPEATS * time.correlation:
        return ""
    return (
        f"the motion repeats: an offset of {1e3 * time.rival_at:+.0f} ms matches nearly as well "
        f"(correlation {time.rival:.3f} against {time.correlation:.3f})"
    )


def _fitted(e: "Evaluation") -> str:
    if not e.settings.align:
        return ""
    delay = ", and a delay of the filter is not in the errors" if "time" in e.settings.align else ""
    return f"{', '.join(e.settings.align)} fitted to the samples that are scored{delay}"


def _gimbal(e: "Evaluation") -> str:
    if not e.near_gimbal:
        return ""
    return (
        f"yaw and roll leave out {e.near_gimbal} scored samples with a pitch within {to_deg(GIMBAL_GUARD):.0f}° of ±90°"
    )


def _free_heading(e: "Evaluation") -> str:
    name = flags.MEANING[flags.HEADING_FREE][0]
    count = e.flag_counts().get(name, 0)
    if not count or "heading" in e.not_scored or e.alignment.heading is not None:
        return ""
    return (
        f"{count} scored samples carry {name}: their heading counts from an arbitrary zero and is scored all the same"
    )


def _uncalibrated(e: "Evaluation") -> str:
    if UNCALIBRATED not in e.estimate.source:
        return ""
    return "the estimate was made from uncalibrated sensor values, whose errors are in these figures"


def _constant_part(e: "Evaluation") -> str:
    """Point at a heading or mounting that explains most of the error: conventions or a screw, rather than a filter."""
    rows = np.flatnonzero(e.match.scored)
    rows = rows[:: max(1, rows.size // _PROBE)]
    q_est, q_ref = e.estimate.q_nb[rows], e.match.q_ref[rows]
    before = total_rmse(q_est, q_ref)
    if before < _SUSPICIOUS:
        return ""
    for name, alignment in _constants(q_est, q_ref, e.estimate.frame):
        after = total_rmse(q_est, alignment.apply(q_ref, e.estimate.frame))
        if after < _EXPLAINED * before:
            return (
                f"most of the error is {_describe(alignment)}: without it, total RMSE would be {to_deg(after):.2f}° "
                f"instead of {to_deg(before):.2f}°. If that constant is no error, align it (align=, "
                f"--align {name})"
            )
    return ""


def _constants(q_est: Floats, q_ref: Floats, frame: Frame) -> list[tuple[str, Alignment]]:
    found = []
    try:
        found.append(("heading", Alignment(heading=find_heading(q_est, q_ref, frame))))
        found.append(("mounting", Alignment(mounting=find_mounting(q_est, q_ref))))
    except ShapeError:  # no constant is better than another, so none explains anything
        pass
    return found


def _describe(alignment: Alignment) -> str:
    if alignment.heading is not None:
        return f"a constant heading of {to_deg(alignment.heading):+.1f}°"
    angle = to_deg(float(quat_angle(IDENTITY, alignment.mounting if alignment.mounting is not None else IDENTITY)))
    return f"a constant turn of {angle:.1f}° between the two bodies"
