"""An evaluation as a dictionary for JSON and as a plain table; degrees and seconds, units in every name."""

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from plumbob.core.check import Floats
from plumbob.core.text import counted, listed, pair
from plumbob.core.units import to_deg, to_dps
from plumbob.evaluation.associate import Fate
from plumbob.evaluation.metrics import CONFIDENCE, DOF, QUANTITIES, Stats
from plumbob.rotations import IDENTITY, North, quat_angle

if TYPE_CHECKING:
    from plumbob.evaluation.evaluation import Evaluation

_FOOTNOTE = (
    "total, heading, inclination: magnitudes; yaw, pitch, roll: estimate minus reference; max and percentiles: of the "
    "magnitude; rmse² = mean² + std²"
)
COLUMNS = ("rmse", "mean", "std", "max", "at", "50 %", "95 %", "99 %")


def summary(e: "Evaluation") -> dict[str, Any]:
    """Numbers of an evaluation, strictly valid for JSON.

    Returns
    -------
    dict
        ``total_rmse_deg``, ``heading_rmse_deg``, ``inclination_rmse_deg``; one dictionary for each quantity with
        ``rmse_deg``, ``mean_deg``, ``std_deg``, ``max_abs_deg``, ``max_at_s``, ``p50_deg``, ``p95_deg``, ``p99_deg``
        and ``count``. A quantity that is not scored is None, and ``not_scored`` says why.
    """
    head = {f"{name}_rmse_deg": _rmse(e, name) for name in ("total", "heading", "inclination")}
    return {
        **head,
        **{name: _stats(e.stats.get(name)) for name in QUANTITIES},
        "not_scored": dict(e.not_scored),
        "samples": _samples(e),
        "alignment": _alignment(e),
        "settings": _settings(e),
        "estimate": _track(e, "estimate"),
        "reference": _track(e, "reference"),
        "flags": e.flag_counts(),
        "consistency": None if e.consistency is None else asdict(e.consistency),
        "reference_rate_rms_dps": None if e.reference_rate is None else to_dps(e.reference_rate),
        "notes": list(e.notes),
    }


def text(e: "Evaluation") -> str:
    """Plain table of at most 80 columns."""
    lines = ["Attitude error, estimate against reference", ""]
    lines += [pair(name, value) for name, value in heading_lines(e)]
    lines += ["", _row("", COLUMNS), _row("", ("deg", "deg", "deg", "deg", "s", "deg", "deg", "deg"))]
    lines += [_row(name, _cells(e.stats[name])) if name in e.stats else f"{name:<12}not scored" for name in QUANTITIES]
    lines += ["", *listed([_FOOTNOTE])]
    for reason in dict.fromkeys(e.not_scored.values()):
        names = ", ".join(name for name, why in e.not_scored.items() if why == reason)
        lines += listed([f"{names} not scored: {reason}"])
    lines += listed(e.notes)
    return "\n".join(lines)


def heading_lines(e: "Evaluation") -> list[tuple[str, str]]:
    """Facts above a table, as name and value."""
    facts = [(name, describe_track(e, name)) for name in ("estimate", "reference")]
    facts.append(("scored", describe_samples(e)))
    facts += [("left out", f"{n} {why}") for why, n in left_out(e).items()]
    facts += [("aligned", line) for line in describe_alignment(e)] or [("aligned", "nothing")]
    if e.settings.settle:
        facts.append(("settling", f"{e.settings.settle:g} s left out at the start"))
    if e.reference_rate is not None:
        facts.append(("motion", f"the reference turned at {to_dps(e.reference_rate):.3g} °/s rms"))
    if e.estimate.cov_b is not None:
        facts.append(("covariance", describe_consistency(e)))
    facts += [("flagged", f"{counted(n, 'scored sample')}: {name}") for name, n in e.flag_counts().items()]
    return facts


def left_out(e: "Evaluation") -> dict[str, int]:
    """How many samples were left out, by the reason in words."""
    until = e.not_converged_until
    found = {fate.meaning: n for fate, n in e.match.counts().items() if fate is not Fate.SCORED}
    if until is None:
        return found
    name = Fate.NOT_CONVERGED.meaning
    return {f"{why}, the last at {until:.3f} s" if why == name else why: n for why, n in found.items()}


def describe_track(e: "Evaluation", which: str) -> str:
    """Source, frame and heading reference of the estimate or the reference."""
    track = e.estimate if which == "estimate" else e.reference
    heading = "free heading" if track.north is North.FREE else f"{track.north} north"
    return f"{track.source or 'unnamed'} ({track.frame}, {heading}, {counted(len(track), 'sample')})"


def describe_samples(e: "Evaluation") -> str:
    """How many samples count, over which time, and how the reference was read."""
    samples = _samples(e)
    span = f"{samples['first_s']:.3f} to {samples['last_s']:.3f} s"
    return (
        f"{samples['scored']} of {samples['estimate']} samples, {span}; {samples['exact']} at stamps of the "
        f"reference, {samples['interpolated']} interpolated (steps up to {1e3 * e.match.max_gap:.4g} ms)"
    )


def describe_alignment(e: "Evaluation") -> list[str]:
    """One line for each constant that was found."""
    a, lines = e.alignment, []
    if a.time is not None:
        later = "later" if a.time.offset >= 0.0 else "earlier"
        lines.append(
            f"time: the estimate is {abs(1e3 * a.time.offset):.3f} ms {later} (correlation {a.time.correlation:.4f})"
        )
    if a.mounting is not None:
        lines.append(
            f"mounting: {to_deg(float(quat_angle(IDENTITY, a.mounting))):.3f}°, estimate's body to reference's "
            f"wxyz {_numbers(a.mounting)}"
        )
    if a.heading is not None:
        side = "right" if a.heading >= 0.0 else "left"
        lines.append(f"heading: the estimate reads {abs(to_deg(a.heading)):.3f}° {side} of the reference's")
    if a.tilt_spread is not None:
        lines.append(f"tilt of the body varied by {to_deg(a.tilt_spread):.1f}° rms, which separates the two")
    return lines


def describe_consistency(e: "Evaluation") -> str:
    """How the error fits the claimed covariance."""
    c = e.consistency
    if e.estimate.cov_b is None:
        return "none claimed"
    if c is None:
        return f"claimed, but not judged: {e.not_scored.get('total', 'in no scored sample is it positive definite')}"
    left_out = f"; {counted(c.unusable, 'sample')} with an unusable covariance" if c.unusable else ""
    return (
        f"NEES {c.mean:.3g} on average ({DOF} expected), {100 * c.share_inside:.1f} % inside "
        f"{c.lower:.3g} to {c.upper:.3g} ({100 * CONFIDENCE:.0f} % expected){left_out}"
    )


def degrees(angle: float) -> str:
    """Angle in degrees with three decimals, or with two digits where that would show nothing."""
    value = to_deg(angle)
    return f"{value:.3f}" if value == 0.0 or abs(value) >= 0.0005 else f"{value:.0e}"


def _cells(s: Stats) -> tuple[str, ...]:
    angles = [degrees(a) for a in (s.rmse, s.mean, s.std, s.max_abs, s.p50, s.p95, s.p99)]
    return (*angles[:4], f"{s.max_at:.2f}", *angles[4:])


def _row(name: str, cells: tuple[str, ...]) -> str:
    widths = (8, 9, 8, 9, 9, 8, 8, 8)
    return f"{name:<12}" + "".join(f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))


def _numbers(values: Floats) -> str:
    return " ".join(f"{v:.5f}" for v in values)


def _rmse(e: "Evaluation", name: str) -> float | None:
    return to_deg(e.stats[name].rmse) if name in e.stats else None


def _stats(s: Stats | None) -> dict[str, Any] | None:
    if s is None:
        return None
    angles = {f"{k}_deg": to_deg(getattr(s, k)) for k in ("rmse", "mean", "std", "max_abs", "p50", "p95", "p99")}
    return {**angles, "max_at_s": s.max_at, "count": s.count}


def _samples(e: "Evaluation") -> dict[str, Any]:
    times = e.t[e.match.scored]
    exact = int(e.match.exact.sum())
    return {
        "estimate": int(e.t.size),
        "scored": int(times.size),
        "exact": exact,
        "interpolated": int(times.size) - exact,
        "near_gimbal": e.near_gimbal,
        "first_s": float(times[0]),
        "last_s": float(times[-1]),
        "not_converged_until_s": e.not_converged_until,
        "left_out": {fate.label: n for fate, n in e.match.counts().items() if fate is not Fate.SCORED},
    }


def _alignment(e: "Evaluation") -> dict[str, Any]:
    a = e.alignment
    return {
        "time": None
        if a.time is None
        else {
            "offset_s": a.time.offset,
            "correlation": a.time.correlation,
            "rival_correlation": a.time.rival,
            "rival_offset_s": a.time.rival_at,
        },
        "mounting": None
        if a.mounting is None
        else {
            "q_re_wxyz": a.mounting.tolist(),
            "angle_deg": to_deg(float(quat_angle(IDENTITY, a.mounting))),
        },
        "heading_deg": None if a.heading is None else to_deg(a.heading),
        "tilt_spread_deg": None if a.tilt_spread is None else to_deg(a.tilt_spread),
    }


def _settings(e: "Evaluation") -> dict[str, Any]:
    s = e.settings
    return {
        "align": list(s.align),
        "max_gap_s": e.match.max_gap,
        "max_offset_s": s.max_offset,
        "declination_deg": None if s.declination is None else to_deg(s.declination),
        "settle_s": s.settle,
    }


def _track(e: "Evaluation", which: str) -> dict[str, Any]:
    track = e.estimate if which == "estimate" else e.reference
    rate = (len(track) - 1) / float(track.t[-1] - track.t[0]) if len(track) > 1 else math.nan
    return {
        "source": track.source,
        "frame": str(track.frame),
        "north": str(track.north),
        "samples": len(track),
        "mean_rate_hz": rate if math.isfinite(rate) else None,
        "first_s": float(track.t[0]),
        "last_s": float(track.t[-1]),
    }
