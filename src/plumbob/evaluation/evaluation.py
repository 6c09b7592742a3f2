"""Compare an estimate with a reference: associate, align where asked, measure, and keep every decision.

One rule holds throughout: the estimate is judged as it was delivered. Whatever must be converted or aligned, frame,
declination, time, mounting or heading, is done to the reference, and the result says so.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.series import data_frame
from plumbob.core.text import counted
from plumbob.core.units import deg, to_deg
from plumbob.data import UNCALIBRATED, AttitudeTrack
from plumbob.evaluation.align import (
    Alignment,
    Fate,
    Mask,
    Match,
    associate,
    find_heading,
    find_mounting,
    find_mounting_and_heading,
    find_time_offset,
    not_converged,
)
from plumbob.evaluation.judged import EvaluationSettings, JudgedTrack
from plumbob.evaluation.metrics import (
    GIMBAL_GUARD,
    NEEDS_HEADING,
    QUANTITIES,
    Consistency,
    Stats,
    attitude_errors,
    consistency,
    total_rmse,
)
from plumbob.reporting.report import Report, Reported
from plumbob.rotations import IDENTITY, Frame, change_frame, quat_angle
from plumbob.rotations.headings import HeadingPolicy, heading_policy, turn_heading

RATE_BASELINE = 0.1
"""Time over which the reference's turning is measured, s; shorter ones would measure its noise."""


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(JudgedTrack, Reported):
    """An estimate judged by a reference; see `JudgedTrack`."""

    def facts(self) -> Mapping[str, str]:
        """What it is, in words: scored samples and the root mean square of each error, degrees."""
        facts = {"scored": f"{int(np.count_nonzero(self.match.scored))} of {len(self.estimate)} samples"}
        facts |= {f"{name} rmse": f"{to_deg(stats.rmse):.3g}°" for name, stats in self.stats.items()}
        return facts | {"source": self.estimate.source.partition("(")[0] or "not named"}

    def columns(self) -> Mapping[str, Floats]:
        """Time, and the error of each quantity that is scored, degrees, by name."""
        return {"t [s]": self.t} | {f"{name} [deg]": to_deg(error) for name, error in self.errors.items()}

    def to_frame(self) -> Any:
        """Errors as a table for pandas, a column each; MissingExtraError where pandas is not installed."""
        return data_frame(self.columns())

    def summary(self) -> dict[str, Any]:
        """Everything but the series, ready for JSON: degrees, seconds, never NaN; see `evaluation.report.numbers`."""
        from plumbob.evaluation.report import numbers

        return numbers(self)

    def report(self, *, facts: Sequence[tuple[str, str]] = ()) -> Report:
        """What was found, as text, page and picture; `facts` say more of where it comes from."""
        from plumbob.evaluation.report import report

        return report(self, facts=facts)


def judge(estimate: AttitudeTrack, reference: AttitudeTrack, settings: EvaluationSettings) -> Evaluation:
    """Judge an estimate by a reference; arguments, errors and result as of `plumbob.evaluate`."""
    policy = heading_policy(
        estimate.north, reference.north, aligned="heading" in settings.align, declination=settings.declination
    )
    _refuse_blind_mounting(policy, settings)
    truth = _in_estimate_frame(estimate, reference, policy)
    time = _time_alignment(estimate, truth, settings)
    match = associate(
        estimate,
        truth,
        max_gap=settings.max_gap,
        settle=settings.settle,
        offset=0.0 if time.time is None else time.time.offset,
    )
    _refuse_empty(estimate, match)
    alignment = replace(_rotation_alignment(estimate, match, settings), time=time.time)
    match = replace(match, q_ref=alignment.apply(match.q_ref, estimate.frame))
    return _measure(estimate, reference, settings, match, alignment, policy)


def _refuse_blind_mounting(policy: HeadingPolicy, settings: EvaluationSettings) -> None:
    if "mounting" in settings.align and not policy.comparable:
        raise ParameterError(f"a mounting is found from whole attitudes, but {policy.reason} together with it.")


def _in_estimate_frame(estimate: AttitudeTrack, reference: AttitudeTrack, policy: HeadingPolicy) -> AttitudeTrack:
    """Reference in the frame and from the north of the estimate; untouched to the last bit where they agree."""
    if reference.frame is estimate.frame and not policy.turn:
        return reference
    q = change_frame(reference.q_nb, to=estimate.frame, from_=reference.frame)
    return reference.with_attitude(turn_heading(q, policy.turn, estimate.frame), frame=estimate.frame)


def _as_converged(estimate: AttitudeTrack) -> AttitudeTrack:
    """Estimate without what it holds before it has converged: the step or turn away from that is not a motion."""
    early = not_converged(estimate)
    return estimate.with_attitude(np.where(early[:, np.newaxis], np.nan, estimate.q_nb)) if early.any() else estimate


def _time_alignment(estimate: AttitudeTrack, truth: AttitudeTrack, settings: EvaluationSettings) -> Alignment:
    if "time" not in settings.align:
        return Alignment()
    offset = find_time_offset(_as_converged(estimate), truth, max_offset=settings.max_offset, max_gap=settings.max_gap)
    return Alignment(time=offset)


def _rotation_alignment(estimate: AttitudeTrack, match: Match, settings: EvaluationSettings) -> Alignment:
    q_est, q_ref = estimate.q_nb[match.scored], match.q_ref[match.scored]
    if {"mounting", "heading"} <= set(settings.align):
        return find_mounting_and_heading(q_est, q_ref, estimate.frame)
    if "mounting" in settings.align:
        return Alignment(mounting=find_mounting(q_est, q_ref))
    if "heading" in settings.align:
        return Alignment(heading=find_heading(q_est, q_ref, estimate.frame))
    return Alignment()


def _refuse_empty(estimate: AttitudeTrack, match: Match) -> None:
    if match.scored.any():
        return
    if not_converged(estimate).all():
        raise ShapeError(
            f"no sample is left to score: the filter did not converge in {len(estimate)} samples. Give it an attitude "
            "to start from (--init, Filter(..., init=...)), or a recording with an accelerometer that begins at rest."
        )
    why = "; ".join(f"{count} {fate.meaning}" for fate, count in match.counts().items() if fate is not Fate.SCORED)
    raise ShapeError(f"no sample is left to score. Of {match.fate.size} samples of the estimate: {why}.")


def _measure(
    estimate: AttitudeTrack,
    reference: AttitudeTrack,
    settings: EvaluationSettings,
    match: Match,
    alignment: Alignment,
    policy: HeadingPolicy,
) -> Evaluation:
    scored = match.scored
    errors = attitude_errors(_as_converged(estimate).q_nb, match.q_ref)
    near_gimbal = int(np.count_nonzero(np.isnan(errors["roll"][scored])))
    not_scored = dict.fromkeys(() if policy.comparable else NEEDS_HEADING, policy.reason)
    stats: dict[str, Stats] = {}
    for name in QUANTITIES:
        statistics = None if name in not_scored else Stats.from_errors(errors[name][scored], estimate.t[scored])
        if statistics is not None:
            stats[name] = statistics
        else:
            not_scored.setdefault(name, "pitch is near ±90° in every scored sample")
    evaluation = Evaluation(
        estimate=estimate,
        reference=reference,
        settings=settings,
        match=match,
        alignment=alignment,
        errors={name: errors[name] for name in stats},
        stats=stats,
        not_scored=not_scored,
        near_gimbal=near_gimbal,
        consistency=_consistency(estimate, match, policy),
        reference_rate=_reference_rate(estimate.t, match.q_ref, scored),
        notes=(),
    )
    return replace(evaluation, notes=remarks(evaluation, policy))


def _consistency(estimate: AttitudeTrack, match: Match, policy: HeadingPolicy) -> Consistency | None:
    if estimate.cov_b is None or not policy.comparable:
        return None
    rows = match.scored
    return consistency(estimate.q_nb[rows], match.q_ref[rows], estimate.cov_b[rows])


def _reference_rate(t: Floats, q_ref: Floats, scored: Mask) -> float | None:
    """Rms rate over pairs of scored samples about `RATE_BASELINE` apart, rad/s."""
    if t.size < 2:
        return None
    stride = min(t.size - 1, max(1, round(RATE_BASELINE / float(np.median(np.diff(t))))))
    both = scored[:-stride] & scored[stride:]
    if not both.any():
        return None
    rate = quat_angle(q_ref[:-stride][both], q_ref[stride:][both]) / (t[stride:][both] - t[:-stride][both])
    return float(np.sqrt(np.mean(rate * rate)))


_SUSPICIOUS = deg(2.0)
_EXPLAINED = 1.0 / 3.0
_PROBE = 20_000  # samples that suffice to suspect a constant
_REPEATS = 0.95
_MOSTLY = 0.5


def remarks(evaluation: "Evaluation", policy: HeadingPolicy) -> tuple[str, ...]:
    """Remarks in the order in which things were done; none where there is nothing to say."""
    notes = [_outside(evaluation), _frames(evaluation), policy.note, _repeating_motion(evaluation), _fitted(evaluation)]
    notes += [_gimbal(evaluation), _free_heading(evaluation), _uncalibrated(evaluation)]
    if policy.comparable and not evaluation.settings.align:
        notes.append(_constant_part(evaluation))
    return tuple(remark for remark in notes if remark)


def _outside(e: "Evaluation") -> str:
    beyond = e.match.counts().get(Fate.OUTSIDE, 0)
    if beyond <= _MOSTLY * e.t.size:
        return ""
    return (
        f"{beyond} of {e.t.size} samples lie outside of the reference's time: the errors mean something only if the "
        "clocks of both agree"
    )


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
    samples = counted(count, "scored sample")
    return f"{samples} with {name}: the heading counts from where it began and is scored nevertheless"


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
                f"instead of {to_deg(before):.2f}°. If that constant is not an error, align it (align=, "
                f"--align {name})"
            )
    return ""


def _constants(q_est: Floats, q_ref: Floats, frame: Frame) -> list[tuple[str, Alignment]]:
    constants = []
    try:
        constants.append(("heading", Alignment(heading=find_heading(q_est, q_ref, frame))))
        constants.append(("mounting", Alignment(mounting=find_mounting(q_est, q_ref))))
    except ShapeError:  # no constant is better than another, so none explains anything
        pass
    return constants


def _describe(alignment: Alignment) -> str:
    if alignment.heading is not None:
        return f"a constant heading of {to_deg(alignment.heading):+.1f}°"
    angle = to_deg(float(quat_angle(IDENTITY, alignment.mounting if alignment.mounting is not None else IDENTITY)))
    return f"a constant turn of {angle:.1f}° between the two bodies"
