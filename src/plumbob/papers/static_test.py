"""The static test of the buoy paper [Yu2018]: a unit at rest in many poses beside a reference, and its page."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.calibration.calibration import capture
from plumbob.calibration.fit import CaptureRefusedError, Reason, mean_of_whole
from plumbob.core.check import Floats
from plumbob.core.errors import ShapeError
from plumbob.core.findings import warnings
from plumbob.core.result import Reported
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard
from plumbob.data.recording import Recording
from plumbob.door.estimate import opened_samples
from plumbob.door.evaluate import evaluate, opened_attitude
from plumbob.evaluation.evaluation import Evaluation
from plumbob.filters.offline import Stage, run_stage
from plumbob.quality.static_periods import stills
from plumbob.reporting.content import Table
from plumbob.reporting.evaluation import side_by_side
from plumbob.reporting.report import Report
from plumbob.rotations import euler_zyx_from_quat, quat_mean

ANGLES: Final = ("yaw", "pitch", "roll")


@dataclass(frozen=True, eq=False, repr=False)
class StaticTest(Reported):
    """Result of a static test of M rests.

    `spans` (M, 2): beginning and end of each rest, s; `before`, `after`: tilt and compass of the means of each rest, as
    measured and calibrated, one sample per rest.
    """

    spans: Floats
    before: Evaluation
    after: Evaluation

    @property
    def evaluations(self) -> Mapping[str, Evaluation]:
        """Before and after calibration."""
        return {"before": self.before, "after": self.after}

    def errors(self, which: str) -> Floats:
        """Errors of yaw, pitch and roll, (M, 3), rad, "before" or "after"; NaN where there is no reference."""
        e, nothing = self.evaluations[which], np.full(len(self.spans), np.nan)
        return np.stack([e.errors[name] if name in e.stats else nothing for name in ANGLES], axis=1)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know about it, each a line."""
        offsets = {name: e.alignment.heading for name, e in self.evaluations.items()}
        removed = [f"heading {name}: a constant offset of {to_deg(offset):+.2f}° was removed"
                   for name, offset in offsets.items() if offset is not None]  # fmt: skip
        made = f"after: {self.after.estimate.source}"
        return (made, *removed, *dict.fromkeys(map(str, (*self.after.not_scored.values(), *self.after.notes))))

    def summary(self) -> dict[str, Any]:
        """Ready for JSON: degrees and seconds; None where there is no figure."""
        of = {f"{name}_deg": angles for name, angles in self._degrees().items()}
        rests = [{"from_s": first, "to_s": last,
                  **{name: dict(zip(ANGLES, angles[i], strict=True)) for name, angles in of.items()}}
                 for i, (first, last) in enumerate(self.spans.tolist())]  # fmt: skip
        pairs = [(f"{figure}_{which}_deg", e.stats, name) for figure, name in (("max", "max_abs"), ("rms", "rmse"))
                 for which, e in self.evaluations.items()]  # fmt: skip
        angles = {angle: {key: to_deg(getattr(of[angle], name)) if angle in of else None for key, of, name in pairs}
                for angle in ANGLES}  # fmt: skip
        return {"rests": rests, "summary": angles, "remarks": list(self.remarks)}

    def facts(self) -> Mapping[str, str]:
        """Rests, and the root mean square of each error that is left, degrees."""
        errors = {name: f"{to_deg(s.rmse):.2f}°" for name in ANGLES if (s := self.after.stats.get(name))}
        return {"rests": str(len(self.spans))} | errors

    def report(self, *, facts: Sequence[tuple[str, str]] = ()) -> Report:
        """Errors of all rests, the largest and the root mean square below; `facts` say where they come from."""

        def cells(values: Sequence[float | None]) -> list[str]:
            return ["-" if value is None else f"{value:z.2f}" for value in values]

        largest = [[name, *cells([*stats.values()])] for name, stats in self.summary()["summary"].items()]
        columns = list(self._degrees().values())
        rows = [[f"{i + 1}", f"{span.mean():.1f}", *cells([value for of in columns for value in of[i]])]
                for i, span in enumerate(self.spans)]  # fmt: skip
        errors = ["", "max |e| before", "max |e| after", "rms before", "rms after"]
        head = ["rest", "at [s]", *ANGLES, "before yaw", *ANGLES[1:], "after yaw", *ANGLES[1:]]
        tables = [Table(f"Errors at rest [°], {len(self.spans)} rests", errors, largest),
                  Table("Attitude of the reference, errors before and after calibration [°]", head, rows)]  # fmt: skip
        beside = side_by_side(self.evaluations, title="Static test", facts=facts)
        return replace(beside, tables=tables, remarks=self.remarks, parts=(), definitions=_DEFINITIONS)

    def _degrees(self) -> dict[str, list[list[float | None]]]:
        """Angles of each rest, degrees, of the reference, whose heading may be free, and errors; None without any."""
        of = {"reference": euler_zyx_from_quat(self.before.match.q_ref)}
        of |= {name: self.errors(name) for name in self.evaluations}
        return {name: [[a if np.isfinite(a) else None for a in row] for row in to_deg(v).tolist()]
                for name, v in of.items()}  # fmt: skip


FEWEST: Final = 2  # rests that make a test: one alone shows no difference between headings
_DEFINITIONS: Final = (
    "At each rest the means of specific force and field give roll and pitch, then the heading of the field's level "
    "part; errors are differences of ZYX Euler angles to the mean attitude of the reference over the same rest.",
)


def static_test(
    recording: str | Path | Recording | ImuData,
    *,
    calibration: CalibrationCard | str | Path,
    reference: AttitudeTrack | str | Path | None = None,
    device: str | None = None,
    align: Sequence[str] = (),
    declination: float | str | None = None,
    profile: str | Path | None = None,
    note: Callable[[str], object] | None = None,
) -> StaticTest:
    """Static test of the buoy paper.

    The unit rests in many poses, such as 36 steps of 10 degrees on a table that stands aslant ('plumbob sim table36').
    At each rest, tilt and compass are compared with a reference, as measured and with the card.

    Parameters
    ----------
    recording : path, Recording or ImuData
        Recording with accelerometer and magnetometer, uncalibrated.
    calibration : CalibrationCard or path
        Card of the unit.
    reference : AttitudeTrack or path, optional
        Track, where the recording carries none itself.
    align : sequence of str
        Remove first: heading, mounting; by default nothing.
    declination : float or str, optional
        As of `plumbob.evaluate`.
    device, profile : optional
        As of `plumbob.calibrate`.
    note : callable, optional
        Called with what was found in files.
    """
    label, source, measured = opened_samples(recording, profile, None, load=True)
    for line in warnings(source.notes) if note is not None else ():
        note(f"{source.name}: {line}")  # type: ignore[misc]
    if source.track is None and reference is None:
        raise ShapeError(f"{label} holds no attitude to compare with; name a track or recording with --reference.")
    target = opened_attitude("reference", reference or source, None, note)
    imu, card = capture(measured, triads=("acc", "mag"), device=device).imu, CalibrationCard.of(calibration)
    rests = stills(imu.t, imu.usable("acc"), None if imu.gyr is None else imu.usable("gyr"))
    spans = np.array([(imu.t[rest.start], imu.t[rest.stop - 1]) for rest in rests]).reshape(-1, 2)
    means = [_mean_attitude(target, *span) for span in spans]
    covered = [i for i, mean in enumerate(means) if mean is not None]
    if len(covered) < FEWEST:
        raise CaptureRefusedError(
            Reason(
                "too-few",
                f"The unit was at rest {len(rests)} times, {len(covered)} of them while the reference has an attitude; "
                f"a static test needs {FEWEST} at least.",
                "Let the unit rest for some seconds in each pose, and let both recordings have one time line.",
            )
        )
    poses, spans = [rests[i] for i in covered], spans[covered]
    frame: dict[str, Any] = {"frame": target.frame, "north": target.north, "source": target.source}
    q_nb = np.stack([mean for mean in means if mean is not None])
    truth = AttitudeTrack(t=spans.mean(axis=1), q_nb=q_nb, **frame)
    looks = (_tilt_and_compass(used, poses, truth) for used in (imu, apply_card(card, imu)))
    before, after = (evaluate(look, truth, align=align, declination=declination) for look in looks)
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
