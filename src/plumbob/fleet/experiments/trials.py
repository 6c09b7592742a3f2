"""Accuracy on recordings with references: errors of each estimator on each trial, their means, and the tables."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob import files as io
from plumbob.core import flags
from plumbob.core.errors import ClockError, DecodeError, ParameterError, PlumbobError, ShapeError
from plumbob.core.text import counted
from plumbob.core.units import dps, to_deg
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.data.recording import Recording
from plumbob.door.evaluate import evaluate
from plumbob.evaluation.align import Fate, not_converged
from plumbob.evaluation.evaluation import Evaluation
from plumbob.evaluation.metrics import Stats, inside_claim
from plumbob.files.formats import suffixes
from plumbob.filters.offline import Stage, navigation_frame, run_stage
from plumbob.fleet.experiments.peers import PeerRun, peer_track
from plumbob.fleet.experiments.variants import SEED, changed, turning
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report
from plumbob.rotations import Frame, North

Errors = dict[str, float | None]

KEYS: Final = tuple(f"{name}_rmse_deg" for name in ("total", "heading", "inclination", "converged"))
# Coverage of a claim: shares of samples whose error is within 1.96 claimed standard deviations, and their titles.
SHARES: Final = {
    "heading_motion": "heading, in motion", "heading_rest": "at rest",
    "tilt_motion": "tilt, in motion", "tilt_rest": "at rest",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Errors of each estimator on each trial, of all samples; and totals of those not flagged as not converged."""

    # ``trials[trial][estimator][key]``, degrees; an estimator that takes no trial of a folder is not in them
    trials: dict[str, dict[str, Errors]]
    settings: dict[str, str]  # what ran, by estimator; several where recordings know different declinations
    align: tuple[str, ...]  # what was aligned before the errors were measured
    skipped: dict[str, str]  # files that are not trials, or that only some estimators can take, and why
    # peers that could not run, estimators that take no trial of a folder or leave nothing of one to score, and why
    absent: dict[str, str] = field(default_factory=dict)
    # by trial: the card that has been applied to its sensor values, or in words that none has
    calibration: dict[str, str] = field(default_factory=dict)
    # ``coverage[trial][estimator][share]`` of those that claim a covariance, `SHARES`
    coverage: dict[str, dict[str, Errors]] = field(default_factory=dict)
    folders: dict[str, list[str]] = field(default_factory=dict)  # trials of each folder
    changes: dict[str, str] = field(default_factory=dict)  # what was changed in every recording, by name, and the seed
    against: str | None = None  # estimator that the others are compared with, trial by trial

    def mean(self, folder: str | None = None) -> dict[str, Errors]:
        """Mean over the trials, or those of a folder, by estimator; None where a trial has no such error."""
        trials = self.folders[folder] if folder is not None else list(self.trials)
        return {name: {key: self._mean(trials, name, key) for key in KEYS} for name in self.settings}

    def _mean(self, trials: Sequence[str], name: str, key: str) -> float | None:
        values = [v for trial in trials if (v := self.trials[trial].get(name, {}).get(key)) is not None]
        return sum(values) / len(values) if values and len(values) == len(trials) else None

    def claims(self, folder: str | None = None) -> dict[str, dict[str, tuple[float, float] | None]]:
        """Mean and least coverage of each share over the trials that have one, by estimator that claims."""
        trials = self.folders[folder] if folder is not None else list(self.trials)
        claims: dict[str, dict[str, tuple[float, float] | None]] = {}
        for name in self.settings:
            rows = [self.coverage[trial][name] for trial in trials if name in self.coverage.get(trial, {})]
            if rows:
                claims[name] = {share: _mean_and_least([row[share] for row in rows]) for share in SHARES}
        return claims

    def differences(self, key: str = KEYS[0]) -> dict[str, dict[str, float]]:
        """By trial: how much larger the error of each other estimator is than that of `against`, degrees."""
        differences: dict[str, dict[str, float]] = {}
        for trial, errors in self.trials.items():
            base = errors.get(self.against or "", {}).get(key)
            others = {name: e[key] for name, e in errors.items() if name != self.against}
            if base is not None:
                differences[trial] = {name: value - base for name, value in others.items() if value is not None}
        return differences

    def better(self, key: str = KEYS[0]) -> dict[str, tuple[int, int]]:
        """By other estimator: in how many trials its error is less than that of `against`, and of how many."""
        rows = self.differences(key).values()
        each = {name: [row[name] for row in rows if name in row] for name in self.settings if name != self.against}
        return {name: (sum(d < 0.0 for d in ds), len(ds)) for name, ds in each.items()}

    def summary(self) -> dict[str, Any]:
        """Ready for JSON: per trial and mean, by estimator."""
        return {
            "settings": self.settings,
            "align": list(self.align),
            "changes": self.changes,
            "calibration": self.calibration,
            "trials": self.trials,
            "mean": self.mean(),
            "folders": {name: {"trials": trials, "mean": self.mean(name)} for name, trials in self.folders.items()},
            "coverage": {"trials": self.coverage, "mean_and_worst": self.claims()},
            "against": self.against,
            "differences": {key: self.differences(key) for key in KEYS},
            "better": {key: self.better(key) for key in KEYS},
            "skipped": self.skipped,
            "absent": self.absent,
        }

    def report(self) -> Report:
        """Table of the trials and their mean for each estimator, and the means beside each other."""
        parts = [Report(setting, tables=[self._errors(name)]) for name, setting in self.settings.items()]
        means = f"mean of {counted(len(self.trials), 'recording')}; {len(self.skipped)} skipped"
        remarks = [means] if self.skipped else []
        remarks += [f"skipped {name}: {why}" for name, why in self.skipped.items()]
        remarks += [f"left out: {name}: {why}" for name, why in self.absent.items()]
        tables = [*self._paired(), *self._claimed(), *self._means()]
        facts = [*self._calibrations(), ("aligned", ", ".join(self.align) or "nothing")]
        if self.changes:
            facts.append(("changed", ", ".join(f"{name} {how}".strip() for name, how in self.changes.items())))
        return Report("Accuracy", facts=facts, parts=[*parts, Report("", tables=tables, remarks=remarks)])

    def text(self) -> str:
        """Report as text."""
        return self.report().text()

    def _sets(self) -> list[tuple[str | None, str]]:
        """Folders, where there are several, and all, with what their rows are called."""
        several = [(name, name) for name in self.folders] if len(self.folders) > 1 else []
        return [*several, (None, "all" if several else "")]

    def _errors(self, name: str) -> Table:
        rows = {trial: errors[name] for trial, errors in self.trials.items() if name in errors}
        means = {f"mean {label}".strip(): self.mean(folder)[name] for folder, label in self._sets()}
        return _table("RMSE [°]", {**rows, **means})

    def _means(self) -> Iterator[Table]:
        if len(self.settings) < 2 and len(self.folders) < 2:
            return
        for folder, label in self._sets():
            trials = self.trials if folder is None else self.folders[folder]
            title = f"Mean RMSE of {counted(len(trials), 'trial')}{f', {label}' if folder else ''} [°]"
            yield _table(title, self.mean(folder))

    def _paired(self) -> Iterator[Table]:
        """Errors of one estimator, and by how much those of the others are larger, trial by trial."""
        if self.against is None:
            return
        others = [name for name in self.settings if name != self.against]
        for key in (KEYS[0], KEYS[2]):
            if not (excess := self.differences(key)):
                continue
            rows = [
                [trial, degrees(self.trials[trial][self.against][key]), *(degrees(row.get(o), "+") for o in others)]
                for trial, row in excess.items()
            ]
            means = [np.mean([row[o] for row in excess.values() if o in row] or [np.nan]) for o in others]
            more = [degrees(float(value), "+") for value in means]
            better = [f"{n} of {of}" for n, of in self.better(key).values()]
            rows += [["mean", degrees(self._mean(list(excess), self.against, key)), *more]]
            rows += [["better in", "", *better]]
            title = f"{key.partition('_')[0].capitalize()} RMSE of {self.against}, and what others have more [°]"
            yield Table(title, ["", self.against, *others], rows)

    def _claimed(self) -> Iterator[Table]:
        for folder, label in self._sets():
            claims = self.claims(folder)
            rows = [[name, *map(_share, shares.values())] for name, shares in claims.items()]
            where = f", {label}" if folder else ""
            if rows:
                title = f"Errors within 1.96 claimed sd{where}: mean of the trials (worst) [%]"
                yield Table(title, ["", *SHARES.values()], rows)

    def _calibrations(self) -> list[tuple[str, str]]:
        """Which trials had which calibration."""
        trials: dict[str, list[str]] = {}
        for trial, label in self.calibration.items():
            trials.setdefault(label, []).append(trial)
        common = len(trials) == 1
        return [("calibration", f"{label}: {'all' if common else ', '.join(names)}") for label, names in trials.items()]


def _mean_and_least(shares: Sequence[float | None]) -> tuple[float, float] | None:
    present = [share for share in shares if share is not None]
    return (sum(present) / len(present), min(present)) if present else None


def degrees(value: float | None, sign: str = "") -> str:
    """Angle with three digits, degrees; a dash where there is none."""
    return "–" if value is None or np.isnan(value) else f"{value:{sign}.3f}"


def _share(pair: tuple[float, float] | None) -> str:
    return "–" if pair is None else f"{100.0 * pair[0]:.0f} ({100.0 * pair[1]:.0f})"


def _table(title: str, rows: Mapping[str, Errors]) -> Table:
    return Table(title, ["", *(key.partition("_")[0] for key in KEYS)], [
        [name, *(degrees(errors.get(key)) for key in KEYS)] for name, errors in rows.items()
    ])  # fmt: skip


RESTING: Final = dps(5.0)  # a claim is one in motion where the mean rate of a second exceeds this, rad/s
ENOUGH: Final = 100  # a share of fewer samples than this is not given
DECLARED: Final = "declared, no card"  # calibration of recordings that are said to be calibrated


def trials_in(*places: Path) -> list[Path]:
    """Recordings among files and in folders, in order of their names."""
    files: list[Path] = []
    for place in places:
        if place.is_file():
            files.append(place)
            continue
        if not place.is_dir():
            wrong = "is neither a file nor a folder" if place.exists() else "does not exist"
            raise DecodeError(f"{place} {wrong}; name recordings, or a folder of them.")
        inside = sorted(p for p in place.iterdir() if io.is_recording(p))
        if not inside:
            raise DecodeError(f"{place} holds no recording; known suffixes are {', '.join(suffixes())}.")
        files += inside
    return files


class _Result(NamedTuple):
    """What an estimator did with a trial, or why nothing of it can be scored."""

    source: str
    errors: Errors
    shares: Errors | None
    why: str = ""


class _Trial(NamedTuple):
    """A recording that is run."""

    name: str
    file: str
    folder: str
    calibration: str
    results: dict[str, _Result]
    refused: dict[str, str]


def measure_accuracy(
    files: Sequence[Path | Recording],
    stages: Sequence[Stage],
    *,
    peers: Sequence[PeerRun] = (),
    absent: Mapping[str, str] | None = None,
    frame: Frame | None = None,
    align: Sequence[str] = (),
    changes: Mapping[str, str] | None = None,
    seed: int = SEED,
    between: tuple[float, float] | None = None,
    calibrated: bool = False,
    against: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Accuracy:
    """Run filters, the smoother and other libraries on each recording that carries a reference; compare their errors.

    Parameters
    ----------
    files : sequence of Path or Recording
        Recordings, or folders of them. One without sensor data or reference, or one that some estimator cannot take, is
        skipped for all with its reason, so that every mean is over the same trials; an estimator that can take none of
        a folder is left out of that folder.
    stages : sequence of Stage
        Filters with their parameters, and the smoother.
    peers : sequence of PeerRun
        Other libraries that run on the same recordings; see `plumbob.fleet.experiments.peers.peer_runs`.
    absent : Mapping, optional
        Peers that could not be made, and why; they are only listed.
    frame : Frame, optional
        Navigation frame where a recording names none.
    align : sequence of str
        Remove offsets first, of heading, mounting or time; none by default.
    changes : Mapping, optional
        What to change in every recording first, as `plumbob.fleet.experiments.variants.changed` has it.
    seed : int
        Of what the changes draw.
    between : (float, float), optional
        Judge only samples that lie between these times after the first sample, s.
    calibrated : bool
        Recordings that name no calibration card come from calibrated units: claims do not count what a data sheet
        allows an uncalibrated part.
    against : str, optional
        Estimator that the others are compared with, trial by trial.
    progress : callable, optional
        Called with the runs of an estimator on a file that are done, and all.

    Raises
    ------
    DecodeError
        If no file is a trial.
    ParameterError
        If `against` names no estimator that runs, or a change is not known.
    """
    ways: dict[str, Callable[..., AttitudeTrack]] = {stage.name: partial(run_stage, stage=stage) for stage in stages}
    ways |= {peer.name: partial(peer_track, peer) for peer in peers}
    if against is not None and against not in ways:
        raise ParameterError(f"there is no '{against}' to compare with; these run: {', '.join(ways)}.")
    skipped: dict[str, str] = {}
    trials: list[_Trial] = []
    for number, file in enumerate(files):
        place = file if isinstance(file, Path) else None
        name, where = (file.name, file.name) if place is None else (place.stem, place.name)
        try:
            raw, reference, imu = _prepared(file, changes or {}, seed, calibrated)
        except ShapeError as error:
            skipped[where] = str(error)
            continue
        reference = _within(reference, imu, between)
        nav = navigation_frame(imu, frame, where=str(place or name))
        folder = "" if place is None else place.parent.name
        trial = _Trial(name, where, folder, calibration_told(imu.meta.calibration), {}, {})
        for at, (estimator, way) in enumerate(ways.items(), start=1):
            try:
                trial.results[estimator] = _judged(way(imu=imu, frame=nav), raw, reference, align)
            except ShapeError as error:
                trial.refused[estimator] = str(error)
            if progress:
                progress(number * len(ways) + at, len(files) * len(ways))
        trials.append(trial)
    if not trials:
        raise DecodeError("no recording can be a trial: " + "; ".join(dict.fromkeys(skipped.values())))
    applied = {**changes, "seed": str(seed)} if changes else {}
    return _gathered(trials, list(ways), tuple(align), skipped, dict(absent or {}), applied, against)


def read_trial(file: Path | Recording) -> tuple[ImuData, AttitudeTrack]:
    """Sensor data and reference of a recording."""
    recording = file if isinstance(file, Recording) else io.read(file)
    if recording.imu is None or recording.track is None:
        raise DecodeError("it does not hold both sensor data and a reference")
    return recording.imu, recording.track


def _prepared(
    file: Path | Recording, changes: Mapping[str, str], seed: int, calibrated: bool
) -> tuple[ImuData, AttitudeTrack, ImuData]:
    """Samples and reference of a recording, and the samples as the estimators get them; ShapeError to skip it."""
    try:
        raw, reference = read_trial(file)
    except PlumbobError as error:
        raise ShapeError(str(error)) from error
    imu = changed(raw, reference, changes, seed=seed)
    if calibrated and imu.meta.calibration is None:
        imu = imu.corrected(meta=replace(imu.meta, calibration=DECLARED))
    return raw, reference, imu


def _within(reference: AttitudeTrack, imu: ImuData, between: tuple[float, float] | None) -> AttitudeTrack:
    """Reference that is known only between two times after the first sample, s."""
    if between is None:
        return reference
    begin, end = (float(imu.t[0]) + time for time in between)
    inside = (reference.t >= begin) & (reference.t <= end)
    return reference.with_attitude(np.where(inside[:, np.newaxis], reference.q_nb, np.nan))


def _judged(track: AttitudeTrack, raw: ImuData, reference: AttitudeTrack, align: Sequence[str]) -> _Result:
    """Errors on one trial; none where an attitude is not finite, because a mean over the others would hide it."""
    errors: Errors = dict.fromkeys(KEYS)
    if not track.known.all():
        return _Result(track.source, errors, None)
    every = replace(track, flags=None if track.flags is None else track.flags & ~np.uint32(flags.NOT_CONVERGED))
    try:
        evaluation = evaluate(every, reference, align=align)
    except (ClockError, ParameterError, ShapeError) as error:
        return _Result(track.source, errors, None, str(error))
    summary = evaluation.summary()
    errors |= {key: summary[key] for key in KEYS[:3]}
    converged = evaluation.match.scored & ~not_converged(track)
    if (total := evaluation.errors.get("total")) is not None:
        stats = Stats.from_errors(total[converged], track.t[converged])
        errors[KEYS[3]] = None if stats is None else to_deg(stats.rmse)
    return _Result(track.source, errors, _coverage(evaluation, raw))


def _coverage(evaluation: Evaluation, raw: ImuData) -> Errors | None:
    """Shares of samples whose error lies within what is claimed, scored or not: at rest a claim must hold too."""
    track, match = evaluation.estimate, evaluation.match
    if track.cov_b is None:
        return None
    mask = np.isin(match.fate, (Fate.SCORED, Fate.MASKED))
    moving = np.interp(track.t, raw.t, turning(raw))[mask] > RESTING
    free = track.north is North.FREE
    heading, tilt = inside_claim(track.q_nb[mask], match.q_ref[mask], track.cov_b[mask], free=free)
    shares: Errors = {}
    for name, inside in (("heading", heading), ("tilt", tilt)):
        judged = name == "tilt" or "heading" in evaluation.stats
        for where, rows in (("motion", moving), ("rest", ~moving)):
            enough = judged and np.count_nonzero(rows) >= ENOUGH
            shares[f"{name}_{where}"] = float(np.mean(inside[rows])) if enough else None
    return shares


def _gathered(
    measured: Sequence[_Trial], names: Sequence[str], align: tuple[str, ...], skipped: dict[str, str],
    absent: dict[str, str], changes: dict[str, str], against: str | None,
) -> Accuracy:  # fmt: skip
    """Trials that all can take who take any of their folder."""
    folders = dict.fromkeys(trial.folder for trial in measured)
    shared: dict[str, _Trial] = {}
    for folder in folders:
        trials = [trial for trial in measured if trial.folder == folder]
        before = f"{folder}/" if len(folders) > 1 else ""
        none = [name for name in names if all(name in trial.refused for trial in trials)]
        for name in none:
            absent[f"{name} ({folder})" if before else name] = trials[0].refused[name]
        for trial in trials:
            unscored = {name: result.why for name, result in trial.results.items() if result.why}
            refused = {name: text for name, text in trial.refused.items() if name not in none}
            if refused or len(unscored) == len(trial.results):
                why = [f"{name}: {text}" for name, text in (refused or unscored).items()]
                skipped[before + trial.file] = "; ".join(why)
                continue
            key = unused_name(before + trial.name, shared)
            shared[key] = trial
            absent |= {f"{name} ({key})": text for name, text in unscored.items()}
    if not shared:
        raise DecodeError("no trial is one that every estimator can take. " + "; ".join(skipped.values()))
    sources = {n: dict.fromkeys(t.results[n].source for t in shared.values() if n in t.results) for n in names}
    return Accuracy(
        {key: {name: result.errors for name, result in trial.results.items()} for key, trial in shared.items()},
        {name: " or ".join(labels) for name, labels in sources.items() if labels}, align, skipped, absent,
        {key: trial.calibration for key, trial in shared.items()},
        {key: {n: r.shares for n, r in trial.results.items() if r.shares is not None} for key, trial in shared.items()},
        {folder: keys for folder in folders if (keys := [key for key, t in shared.items() if t.folder == folder])},
        changes, against,
    )  # fmt: skip


def unused_name(name: str, used: Mapping[str, object]) -> str:
    """The name, or with a number, so that it is not one that is used."""
    others = (f"{name} ({i})" for i in count(2))
    return next(candidate for candidate in chain([name], others) if candidate not in used)
