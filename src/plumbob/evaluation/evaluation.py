"""Compare an estimate with a reference: associate, align where asked, measure, and keep every decision.

One rule holds throughout: the estimate is judged as it was delivered. Whatever must be converted or aligned, frame,
declination, time, mounting or heading, is done to the reference, and the result says so.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.findings import Note, as_json, info, warning
from plumbob.core.result import Reported, plain
from plumbob.core.series import data_frame
from plumbob.core.text import counted
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.data import UNCALIBRATED, AttitudeTrack
from plumbob.evaluation import align as aligning
from plumbob.evaluation import metrics
from plumbob.evaluation.align import not_converged
from plumbob.rotations import IDENTITY, Frame, change_frame, quat_angle, quat_conjugate
from plumbob.rotations.frames import HeadingPolicy, heading_policy, turn_heading

RATE_BASELINE = 0.1  # Time over which the reference's turning is measured, s; shorter ones would measure its noise


@dataclass(frozen=True, slots=True)
class EvaluationSettings:
    """What was asked for; times in s, angles in rad, None where left to the default."""

    align: tuple[str, ...] = ()
    max_gap: float | None = None
    max_offset: float = 1.0
    declination: float | None = None
    settle: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(Reported):
    """An estimate judged by a reference.

    Attributes
    ----------
    estimate, reference : AttitudeTrack
        As they were given.
    settings : EvaluationSettings
        As they were asked for.
    match : Match
        Which samples met, and why others did not; `match.q_ref` is the reference in the estimate's frame, brought to
        its times and aligned.
    alignment : Alignment
        What was found.
    errors : mapping of str to ndarray (N,)
        Error of each quantity that may be scored, rad, at the estimate's times, wherever both are known; NaN before the
        estimate had converged. The statistics take only the rows where `match.scored`.
    stats : mapping of str to Stats
        Of each quantity that is scored.
    not_scored : mapping of str to str
        Why the others are not.
    near_gimbal : int
        Scored samples without yaw and roll, because a pitch is within `GIMBAL_GUARD` of ±90°.
    consistency : Consistency or None
        Where the estimate claims a covariance.
    reference_rate : float or None
        Rms angular rate of the reference over the scored samples, rad/s; None where it cannot be determined.
    notes : tuple of str
        What a reader should know.
    """

    estimate: AttitudeTrack
    reference: AttitudeTrack
    settings: EvaluationSettings
    match: aligning.Match
    alignment: aligning.Alignment
    errors: Mapping[str, Floats]
    stats: Mapping[str, metrics.Stats]
    not_scored: Mapping[str, str]
    near_gimbal: int
    consistency: metrics.Consistency | None
    reference_rate: float | None
    notes: tuple[Note, ...]

    def facts(self) -> Mapping[str, str]:
        """What it is, in words: scored samples and the root mean square of each error, degrees."""
        facts = {"scored": f"{int(np.count_nonzero(self.match.scored))} of {len(self.estimate)} samples"}
        facts |= {f"{name} rmse": f"{to_deg(stats.rmse):.3g}°" for name, stats in self.stats.items()}
        return facts | {"source": self.estimate.source.partition("(")[0].strip() or "not named"}

    def columns(self) -> Mapping[str, Floats]:
        """Time, and the error of each quantity that is scored, degrees, by name."""
        return {"t [s]": self.t} | {f"{name} [deg]": to_deg(error) for name, error in self.errors.items()}

    def to_frame(self) -> Any:
        """Errors as a table for pandas, a column each; MissingExtraError where pandas is not installed."""
        return data_frame(self.columns())

    def summary(self) -> dict[str, Any]:
        """Everything but the series, strictly valid for JSON: degrees, seconds, never NaN.

        Returns
        -------
        dict
            ``total_rmse_deg``, ``heading_rmse_deg``, ``inclination_rmse_deg``; one dictionary for each quantity with
            ``rmse_deg``, ``mean_deg``, ``std_deg``, ``max_abs_deg``, ``max_at_s``, ``p50_deg``, ``p95_deg``,
            ``p99_deg`` and ``count``. A quantity that is not scored is None, and ``not_scored`` says why.
        """
        a, s = self.alignment, self.settings
        time, mounting = a.time, a.mounting
        sizes = ("rmse", "mean", "std", "max_abs", "p50", "p95", "p99")
        errors: dict[str, dict[str, Any]] = {
            name: {
                **{f"{size}_deg": to_deg(getattr(stats, size)) for size in sizes},
                "max_at_s": stats.max_at, "count": stats.count,
            }
            for name, stats in self.stats.items()
        }  # fmt: skip
        return dict(plain({
            **{f"{name}_rmse_deg": errors.get(name, {}).get("rmse_deg") for name in metrics.QUANTITIES[:3]},
            **{name: errors.get(name) for name in metrics.QUANTITIES},
            "not_scored": self.not_scored,
            "samples": sample_counts(self),
            "alignment": {
                "time": time and {
                    "offset_s": time.offset, "correlation": time.correlation,
                    "rival_correlation": time.rival, "rival_offset_s": time.rival_at,
                },
                "mounting": None if mounting is None else {
                    "q_re_wxyz": mounting, "angle_deg": _deg(float(quat_angle(IDENTITY, mounting)))
                },
                "heading_deg": _deg(a.heading), "tilt_spread_deg": _deg(a.tilt_spread),
            },
            "settings": {
                "align": s.align, "max_gap_s": self.match.max_gap, "max_offset_s": s.max_offset,
                "declination_deg": _deg(s.declination), "settle_s": s.settle,
            },
            "estimate": _track(self.estimate),
            "reference": _track(self.reference),
            "flags": self.flag_counts(),
            "consistency": self.consistency,
            "reference_rate_rms_dps": None if self.reference_rate is None else to_dps(self.reference_rate),
            "notes": as_json(self.notes),
        }))  # fmt: skip

    @property
    def t(self) -> Floats:
        """Times of the estimate, s, (N,)."""
        return self.estimate.t

    @property
    def not_converged_until(self) -> float | None:
        """Time of the last sample that is left out because the estimate had not converged, s; None without one."""
        times = self.t[self.match.fate == aligning.Fate.NOT_CONVERGED]
        return float(times[-1]) if times.size else None

    def flag_counts(self) -> dict[str, int]:
        """Scored samples that carry each flag of the estimate that occurs."""
        if self.estimate.flags is None:
            return {}
        return flags.counts(self.estimate.flags[self.match.scored])


def judge(estimate: AttitudeTrack, reference: AttitudeTrack, settings: EvaluationSettings) -> Evaluation:
    """Judge an estimate by a reference; arguments, errors and result as of `plumbob.evaluate`."""
    policy = heading_policy(
        estimate.north, reference.north, aligned="heading" in settings.align, declination=settings.declination
    )
    if "mounting" in settings.align and not policy.comparable:
        raise ParameterError(f"a mounting is found from full attitudes, but {policy.reason} together with it.")
    truth = reference  # untouched to the last bit where it has the frame and the north of the estimate
    if reference.frame is not estimate.frame or policy.turn:
        q = change_frame(reference.q_nb, to=estimate.frame, from_=reference.frame)
        truth = reference.with_attitude(turn_heading(q, policy.turn, estimate.frame), frame=estimate.frame)
    early, converged = not_converged(estimate), estimate
    if early.any():  # the step or turn away from what it held before is not a motion
        converged = estimate.with_attitude(np.where(early[:, np.newaxis], np.nan, estimate.q_nb))
    time = None
    if "time" in settings.align:
        time = aligning.find_time_offset(converged, truth, max_offset=settings.max_offset, max_gap=settings.max_gap)
    offset = 0.0 if time is None else time.offset
    match = aligning.associate(estimate, truth, max_gap=settings.max_gap, settle=settings.settle, offset=offset)
    if not match.scored.any():
        raise _nothing_scored(estimate, match)
    q_est, q_ref, alignment = estimate.q_nb[match.scored], match.q_ref[match.scored], aligning.Alignment()
    if {"mounting", "heading"} <= set(settings.align):
        alignment = aligning.find_mounting_and_heading(q_est, q_ref, estimate.frame)
    elif "mounting" in settings.align:
        alignment = aligning.Alignment(mounting=aligning.find_mounting(q_est, q_ref))
    elif "heading" in settings.align:
        alignment = aligning.Alignment(heading=aligning.find_heading(q_est, q_ref, estimate.frame))
    alignment = replace(alignment, time=time)
    match = replace(match, q_ref=alignment.apply(match.q_ref, estimate.frame))
    errors = metrics.attitude_errors(converged.q_nb, match.q_ref)
    evaluation = _measured(estimate, reference, settings, match, alignment, policy, errors)
    return replace(evaluation, notes=tuple(_remarks(evaluation, policy)))


def _nothing_scored(estimate: AttitudeTrack, match: aligning.Match) -> ShapeError:
    if not_converged(estimate).all():
        return ShapeError(
            f"no sample is left to score: the filter did not converge in {len(estimate)} samples. Give it an attitude "
            "to start from (--init, Filter(..., init=...)), or a recording with an accelerometer that begins at rest."
        )
    why = "; ".join(
        f"{count} {fate.meaning}" for fate, count in match.counts().items() if fate is not aligning.Fate.SCORED
    )
    return ShapeError(f"no sample is left to score. Of {match.fate.size} samples of the estimate: {why}.")


def _measured(
    estimate: AttitudeTrack,
    reference: AttitudeTrack,
    settings: EvaluationSettings,
    match: aligning.Match,
    alignment: aligning.Alignment,
    policy: HeadingPolicy,
    errors: Mapping[str, Floats],
) -> Evaluation:
    """What the errors of all quantities say, without remarks."""
    scored = match.scored
    not_scored = dict.fromkeys(() if policy.comparable else metrics.NEEDS_HEADING, policy.reason)
    stats: dict[str, metrics.Stats] = {}
    for name in metrics.QUANTITIES:
        statistics = None if name in not_scored else metrics.Stats.from_errors(errors[name][scored], estimate.t[scored])
        if statistics is not None:
            stats[name] = statistics
        else:
            not_scored.setdefault(name, "pitch is near ±90° in every scored sample")
    claimed = estimate.cov_b if policy.comparable else None
    # of the reference, over pairs of scored samples about `RATE_BASELINE` apart
    t, rate, both = estimate.t, None, np.zeros(0, dtype=np.bool_)
    if t.size > 1:
        stride = min(t.size - 1, max(1, round(RATE_BASELINE / float(np.median(np.diff(t))))))
        both = scored[:-stride] & scored[stride:]
    if both.any():
        turns = quat_angle(match.q_ref[:-stride][both], match.q_ref[stride:][both])
        rate = float(np.sqrt(np.mean((turns / (t[stride:][both] - t[:-stride][both])) ** 2)))
    return Evaluation(
        estimate=estimate,
        reference=reference,
        settings=settings,
        match=match,
        alignment=alignment,
        errors={name: errors[name] for name in stats},
        stats=stats,
        not_scored=not_scored,
        near_gimbal=int(np.count_nonzero(np.isnan(errors["roll"][scored]))),
        consistency=None
        if claimed is None
        else metrics.consistency(estimate.q_nb[scored], match.q_ref[scored], claimed[scored]),
        reference_rate=rate,
        notes=(),
    )


_SUSPICIOUS = deg(2.0)
_EXPLAINED = 1.0 / 3.0
_PROBE = 20_000  # samples that suffice to suspect a constant
_REPEATS = 0.95
_MOSTLY = 0.5


def _remarks(e: Evaluation, policy: HeadingPolicy) -> Iterator[Note]:
    """Remarks in the order in which things were done; none where there is nothing to say."""
    align, time = e.settings.align, e.alignment.time
    beyond = e.match.counts().get(aligning.Fate.OUTSIDE, 0)
    if beyond > _MOSTLY * e.t.size:
        yield (warning("evaluation.outside", beyond=beyond, samples=e.t.size))
    if e.estimate.frame is not e.reference.frame:
        yield info("evaluation.frame_converted", reference_frame=e.reference.frame, estimate_frame=e.estimate.frame)
    if policy.note:
        yield policy.note
    if time and time.rival is not None and time.rival_at is not None and time.rival >= _REPEATS * time.correlation:
        yield (
            warning(
                "evaluation.motion_repeats",
                rival_ms=1000.0 * time.rival_at,
                rival=time.rival,
                correlation=time.correlation,
            )
        )
    if align:
        delay = ", and a delay of the filter is not in the errors" if "time" in align else ""
        yield info("evaluation.aligned", align=tuple(align), delay=delay)
    if e.near_gimbal:
        guard = f"{to_deg(metrics.GIMBAL_GUARD):.0f}°"
        yield info("evaluation.near_gimbal", near_gimbal=e.near_gimbal, guard=guard)
    free = flags.MEANING[flags.HEADING_FREE][0]
    if "heading" not in e.not_scored and e.alignment.heading is None and (count := e.flag_counts().get(free, 0)):
        samples = counted(count, "scored sample")
        yield warning("evaluation.heading_free", samples=samples, flag=free)
    if UNCALIBRATED in e.estimate.source:
        yield warning("evaluation.uncalibrated")
    if policy.comparable and not align and (constant := _constant_part(e)):
        yield constant


def _constant_part(e: Evaluation) -> Note:
    """Point at a convention, heading or mounting that explains most of the error, rather than a filter."""
    rows = np.flatnonzero(e.match.scored)
    rows = rows[:: max(1, rows.size // _PROBE)]
    q_est, q_ref = e.estimate.q_nb[rows], e.match.q_ref[rows]
    before = metrics.total_rmse(q_est, q_ref)
    if before < _SUSPICIOUS:
        return ""
    causes = [(metrics.total_rmse(q_est, q), cause) for q, cause in _explanations(e, q_est, q_ref)]
    after = min(rmse for rmse, _ in causes)
    if after >= _EXPLAINED * before:
        return ""
    alike = (1.0 + _EXPLAINED) * after + 0.1 * _SUSPICIOUS  # what explains as much is said beside it
    return warning(
        "evaluation.constant_part",
        causes=", or ".join((cause for rmse, cause in causes if rmse <= alike)),
        after_deg=to_deg(after),
        before_deg=to_deg(before),
    )


def _explanations(e: Evaluation, q_est: Floats, q_ref: Floats) -> Iterator[tuple[Floats, str]]:
    """The reference (N, 4) as it would be with a constant taken out, or had it been read otherwise; each in words."""
    frame, declared = e.estimate.frame, e.reference.frame
    with suppress(ShapeError):  # no constant is better than another, so none explains anything
        heading = aligning.Alignment(heading=aligning.find_heading(q_est, q_ref, frame))
        yield heading.apply(q_ref, frame), f"{_describe(heading)} (if it is not an error: --align heading)"
        mounting = aligning.Alignment(mounting=aligning.find_mounting(q_est, q_ref))
        yield mounting.apply(q_ref, frame), f"{_describe(mounting)} (if it is not an error: --align mounting)"
    q = change_frame(q_ref, to=declared, from_=frame)
    for order, read, columns in (("x y z w", "w x y z", [3, 0, 1, 2]), ("w x y z", "x y z w", [1, 2, 3, 0])):
        yield (
            change_frame(q[:, columns], to=frame, from_=declared),
            f"quaternions of the reference in the order {order} that were read as {read}",
        )
    yield (
        change_frame(quat_conjugate(q), to=frame, from_=declared),
        "quaternions of the reference that are the inverse, from navigation axes to those of the body",
    )
    for other in Frame:
        yield change_frame(q, to=frame, from_=other), f"a reference in {other} that was read as {declared}"


def _describe(alignment: aligning.Alignment) -> str:
    if alignment.heading is not None:
        return f"a constant heading of {to_deg(alignment.heading):+.1f}°"
    angle = to_deg(float(quat_angle(IDENTITY, alignment.mounting if alignment.mounting is not None else IDENTITY)))
    return f"a constant turn of {angle:.1f}° between the two bodies"


def _deg(angle: float | None) -> float | None:
    return None if angle is None else to_deg(angle)


def sample_counts(e: Evaluation) -> dict[str, Any]:
    """How many samples met how, and between which times, as JSON can hold them."""
    times = e.t[e.match.scored]
    exact = int(e.match.exact.sum())
    return {
        "estimate": int(e.t.size), "scored": int(times.size), "exact": exact, "interpolated": int(times.size) - exact,
        "near_gimbal": e.near_gimbal, "first_s": float(times[0]), "last_s": float(times[-1]),
        "not_converged_until_s": e.not_converged_until,
        "left_out": {fate.name.lower(): n for fate, n in e.match.counts().items() if fate is not aligning.Fate.SCORED},
    }  # fmt: skip


def _track(track: AttitudeTrack) -> dict[str, Any]:
    rate = (len(track) - 1) / float(track.t[-1] - track.t[0]) if len(track) > 1 else math.nan
    return {
        "source": track.source, "frame": str(track.frame), "north": str(track.north), "samples": len(track),
        "mean_rate_hz": rate, "first_s": float(track.t[0]), "last_s": float(track.t[-1]),
    }  # fmt: skip
