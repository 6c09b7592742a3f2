"""The static test of the buoy paper [Yu2018]: a unit at rest in many poses beside a reference, and its page."""

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.calibration.fit import CaptureRefusedError, Reason, mean_of_whole
from plumbob.calibration.static_periods import stills
from plumbob.core.check import Floats
from plumbob.core.files import write_text
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard
from plumbob.evaluation import evaluate
from plumbob.evaluation.evaluation import Evaluation
from plumbob.evaluation.metrics import Stats
from plumbob.filters.offline import Stage, run_stage
from plumbob.report import SERIES, SOFT, document, figure, html_table, svg
from plumbob.rotations import euler_zyx_from_quat, quat_mean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ANGLES: Final = ("yaw", "pitch", "roll")


@dataclass(frozen=True, eq=False)
class StaticTest:
    """Result of a static test of M rests.

    Attributes
    ----------
    spans : ndarray (M, 2)
        Beginning and end of each rest, s.
    before, after : Evaluation
        Tilt and compass of the means of each rest, as measured and calibrated; one sample per rest.
    """

    spans: Floats
    before: Evaluation
    after: Evaluation

    @property
    def reference(self) -> Floats:
        """Yaw, pitch and roll of the reference, (M, 3), rad; NaN where it has none."""
        return euler_zyx_from_quat(self.before.match.q_ref)

    def errors(self, which: str) -> Floats:
        """Errors of yaw, pitch and roll, (M, 3), rad, "before" or "after"; NaN where there is no reference."""
        e: Evaluation = getattr(self, which)
        nothing = np.full(len(self.spans), np.nan)
        return np.stack([e.errors[name] if name in e.stats else nothing for name in ANGLES], axis=1)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know about it, each a line."""
        removed = [
            f"heading {which}: a constant offset of {to_deg(e.alignment.heading):+.2f}° was removed"
            for which, e in (("before", self.before), ("after", self.after))
            if e.alignment.heading is not None
        ]
        made = f"after: {self.after.estimate.source}"
        return (made, *removed, *dict.fromkeys((*self.after.not_scored.values(), *self.after.notes)))

    def as_dict(self) -> dict[str, Any]:
        """Ready for JSON: degrees and seconds; None where there is no figure."""
        rows = zip(self.spans.tolist(), self.reference, self.errors("before"), self.errors("after"), strict=True)
        return {
            "rests": [
                {"from_s": first, "to_s": last, "reference_deg": _degrees(ref), **_pair(before, after)}
                for (first, last), ref, before, after in rows
            ],
            "summary": {name: _summary(self.before.stats.get(name), self.after.stats.get(name)) for name in ANGLES},
            "remarks": list(self.remarks),
        }

    def text(self) -> str:
        """Table of the rests, largest errors and root mean squares below, degrees."""
        return "\n".join(_lines(self))


def _lines(test: StaticTest) -> Iterator[str]:
    yield f"Static test, {len(test.spans)} rests: errors of attitude against the reference [°]"
    yield ""
    yield f"{'':>4}{'at, s':>8}{'reference':^24}{'error before':^24}{'error after':^24}"
    yield f"{'':12}{''.join(f'{name:>8}' for _ in range(3) for name in ANGLES)}"
    numbers = np.hstack((test.reference, test.errors("before"), test.errors("after")))
    for i, (span, row) in enumerate(zip(test.spans, numbers, strict=True), start=1):
        yield f"{i:4d}{span.mean():8.1f}{''.join(map(_cell, row.tolist()))}"
    for label, what in (("max |error|", "max_abs"), ("rms", "rmse")):
        stats = [getattr(test, which).stats.get(name) for which in ("before", "after") for name in ANGLES]
        yield f"{label:36}{''.join(_cell(math.nan if s is None else getattr(s, what)) for s in stats)}"
    yield from test.remarks


def _cell(angle: float) -> str:
    return f"{to_deg(angle):z8.2f}" if math.isfinite(angle) else f"{'-':>8}"


def _degrees(angles: Floats) -> dict[str, float | None]:
    return {n: to_deg(a) if math.isfinite(a) else None for n, a in zip(ANGLES, angles.tolist(), strict=True)}


def _pair(before: Floats, after: Floats) -> dict[str, dict[str, float | None]]:
    return {"before_deg": _degrees(before), "after_deg": _degrees(after)}


def _summary(before: Stats | None, after: Stats | None) -> dict[str, float | None]:
    both = (("before", before), ("after", after))
    return {
        f"{figure}_{label}_deg": None if s is None else to_deg(getattr(s, name))
        for figure, name in (("max", "max_abs"), ("rms", "rmse"))
        for label, s in both
    }


FEWEST: Final = 2
"""Rests that make a test: one alone shows no difference between headings."""


def static_test(
    imu: ImuData,
    reference: AttitudeTrack,
    card: CalibrationCard,
    *,
    align: Collection[str] = (),
    declination: float | None = None,
    least: float = 1.0,
) -> StaticTest:
    """Compare what accelerometer and magnetometer say at rest with a reference, before and after a calibration.

    Parameters
    ----------
    imu : ImuData
        The recording, uncalibrated, with acc and mag.
    reference : AttitudeTrack
        Attitude on the same time line.
    card : CalibrationCard
        Of the unit.
    align : collection of str
        Constants to find and remove, as in `plumbob.evaluation.evaluate`; by default none.
    declination : float, optional
        Of the place, rad, where one heading is true and the other magnetic.
    least : float
        Shortest rest, s.

    Raises
    ------
    CaptureRefusedError
        If the unit rested less than twice where the reference has an attitude.
    CalibrationError
        If the card does not fit the recording.
    FrameError, ParameterError, ShapeError
        As in `plumbob.evaluation.evaluate`.
    """
    rests = stills(imu.t, imu.usable("acc"), None if imu.gyr is None else imu.usable("gyr"), least=least)
    spans = np.array([(imu.t[rest.start], imu.t[rest.stop - 1]) for rest in rests]).reshape(-1, 2)
    means = [_mean_attitude(reference, *span) for span in spans]
    known = [i for i, mean in enumerate(means) if mean is not None]
    if len(known) < FEWEST:
        raise CaptureRefusedError(_too_few(len(rests), len(known)))
    kept, spans = [rests[i] for i in known], spans[known]
    truth = AttitudeTrack(
        t=spans.mean(axis=1),
        q_nb=np.stack([mean for mean in means if mean is not None]),
        frame=reference.frame,
        north=reference.north,
        source=reference.source,
    )
    before, after = (
        evaluate(_tilt_and_compass(used, kept, truth), truth, align=align, declination=declination)
        for used in (imu, apply_card(card, imu))
    )
    return StaticTest(spans, before, after)


def _tilt_and_compass(imu: ImuData, rests: list[slice], truth: AttitudeTrack) -> AttitudeTrack:
    """Attitude of the mean specific force and field of each rest."""
    acc, mag = (np.stack([mean_of_whole(imu.usable(name)[rest]) for rest in rests]) for name in ("acc", "mag"))
    looks = ImuData(t=truth.t, acc=acc, mag=mag, meta=replace(imu.meta, rate_nominal=None))
    return run_stage(looks, Stage("tilt_compass", {}), frame=imu.meta.frame or truth.frame)


def _mean_attitude(track: AttitudeTrack, first: float, last: float) -> Floats | None:
    """Mean attitude of a track over a time, (4,), or None where it has none."""
    q = track.q_nb[(track.t >= first) & (track.t <= last)]
    return quat_mean(q) if np.isfinite(q).all(axis=1).any() else None


def _too_few(rests: int, known: int) -> Reason:
    return Reason(
        "too-few",
        f"The unit was at rest {rests} times, {known} of them while the reference has an attitude; a static test "
        f"needs {FEWEST} at least.",
        "Let the unit rest for some seconds in each pose, and let both recordings have one time line.",
    )


_BEFORE, _AFTER = SERIES[1], SERIES[0]
_STYLE = ".scroll { margin-top: 1.75rem; }\n"
_DEFINITIONS = (
    "At each rest the means of specific force and field give roll and pitch, then the heading of the field's level "
    "part; errors are differences of ZYX Euler angles to the mean attitude of the reference over the same rest."
)


def write_static_test(
    path: str | Path, test: StaticTest, *, title: str, facts: Mapping[str, str], overwrite: bool = False
) -> None:
    """Write a self-contained page.

    Parameters
    ----------
    path : path_like
        File to write.
    test : StaticTest
        The result.
    title : str
        Of the page.
    facts : mapping of str to str
        Provenance as name and value; any text is safe.
    overwrite : bool
        Whether a file that lies there may be replaced.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """
    keys = [("before", _BEFORE, "dashed"), ("after", _AFTER, "solid")]
    drawn = figure("Errors at rest against the heading of the reference", _drawing(test), keys)
    body = ["<section>", _summary_rows(test), _remarks(test), drawn, _table(test), "</section>"]
    write_text(path, document(title, facts, body, footer=_DEFINITIONS, style=_STYLE), overwrite=overwrite)


def _drawing(test: StaticTest) -> str:
    heading = np.mod(to_deg(test.reference[:, 0]), 360.0)
    order = np.argsort(heading)

    def draw(drawn: "Figure") -> None:
        axes = drawn.subplots(3, 1, sharex=True)
        for i, (ax, name) in enumerate(zip(axes, ANGLES, strict=True)):
            ax.axhline(0.0, color=SOFT, linewidth=0.5)
            for which, colour, style in (("before", _BEFORE, "--"), ("after", _AFTER, "-")):
                error = to_deg(test.errors(which)[:, i])
                ax.plot(heading[order], error[order], style, color=colour, marker="o", markersize=2.0, linewidth=0.8)
            ax.set_ylabel(f"{name} error [°]")
        axes[-1].set_xlim(0.0, 360.0)
        axes[-1].set_xticks(range(0, 361, 45))
        axes[-1].set_xlabel("heading of the reference [°]")

    return svg(draw, height=4.2, salt="static test")


def _summary_rows(test: StaticTest) -> str:
    head = ("", "max |error| before", "max |error| after", "rms before", "rms after")
    rows = [(name, *map(_html_cell, figures.values())) for name, figures in test.as_dict()["summary"].items()]
    return html_table(f"Errors at rest [°], {len(test.spans)} rests", head, rows)


def _remarks(test: StaticTest) -> str:
    return "".join(f"<p class='note'>{escape(remark)}</p>" for remark in test.remarks)


def _table(test: StaticTest) -> str:
    head = ("rest", "at, s", *ANGLES, *(f"{name} {when}" for when in ("before", "after") for name in ANGLES))
    numbers = to_deg(np.hstack((test.reference, test.errors("before"), test.errors("after")))).tolist()
    rows = [
        (str(i), f"{span.mean():.1f}", *map(_html_cell, row))
        for i, (span, row) in enumerate(zip(test.spans, numbers, strict=True), start=1)
    ]
    return html_table("Reference attitude and errors of each rest, before and after calibration [°]", head, rows)


def _html_cell(degrees: float | None) -> str:
    return "-" if degrees is None or not math.isfinite(degrees) else f"{degrees:z.2f}"
