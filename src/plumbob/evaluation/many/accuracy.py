"""Accuracy on recordings with references: one parameter set for all trials, then means over the trials."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob import files as io
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, ShapeError
from plumbob.core.text import counted
from plumbob.core.units import dps
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.evaluation import Evaluation, Fate, evaluate
from plumbob.evaluation.many.peers import PeerRun, peer_track
from plumbob.evaluation.many.variants import SEED, changed, turning
from plumbob.evaluation.metrics import inside_claim
from plumbob.files import Recording
from plumbob.filters.offline import Stage, navigation_frame, run_stage
from plumbob.report import Report, Table
from plumbob.rotations import Frame

Errors = dict[str, float | None]
Way = Callable[[ImuData, Frame], AttitudeTrack]

KEYS = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg")
SHARES: Final = {
    "heading_motion": "heading, in motion",
    "heading_rest": "at rest",
    "tilt_motion": "tilt, in motion",
    "tilt_rest": "at rest",
}
"""Coverage of a claim: shares of samples whose error is within 1.96 claimed standard deviations, and their titles."""
RESTING: Final = dps(5.0)
"""A claim is one in motion where the mean rate of a second exceeds this, rad/s."""
ENOUGH: Final = 100
"""A share of fewer samples than this is not given."""
DECLARED: Final = "declared, no card"
"""Calibration of recordings that are said to be calibrated."""


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Errors of each estimator on each trial.

    Attributes
    ----------
    trials : dict
        ``trials[trial][estimator][key]``, degrees; an estimator that takes no trial of a folder is not in them.
    settings : dict
        What ran, by estimator; several where recordings know different declinations.
    align : tuple of str
        What was aligned before the errors were measured.
    skipped : dict
        Files that are not trials, or that only some estimators can take, and why.
    absent : dict
        Peers that could not run, estimators that take no trial of a folder or leave nothing of one to score, and why.
    calibration : dict
        By trial: the card that has been applied to its sensor values, or in words that none has.
    coverage : dict
        ``coverage[trial][estimator][share]`` of those that claim a covariance, `SHARES`.
    folders : dict
        Trials of each folder.
    changes : dict
        What was changed in every recording, by name, and the seed.
    against : str or None
        Estimator that the others are compared with, trial by trial.
    """

    trials: dict[str, dict[str, Errors]]
    settings: dict[str, str]
    align: tuple[str, ...]
    skipped: dict[str, str]
    absent: dict[str, str] = field(default_factory=dict)
    calibration: dict[str, str] = field(default_factory=dict)
    coverage: dict[str, dict[str, Errors]] = field(default_factory=dict)
    folders: dict[str, list[str]] = field(default_factory=dict)
    changes: dict[str, str] = field(default_factory=dict)
    against: str | None = None

    def mean(self, folder: str | None = None) -> dict[str, Errors]:
        """Mean over the trials, or those of a folder, by estimator; None where a trial has no such error."""
        trials = self.folders[folder] if folder is not None else list(self.trials)
        return {name: {key: self._mean(trials, name, key) for key in KEYS} for name in self.settings}

    def _mean(self, trials: Sequence[str], name: str, key: str) -> float | None:
        known = [v for trial in trials if (v := self.trials[trial].get(name, {}).get(key)) is not None]
        return sum(known) / len(known) if known and len(known) == len(trials) else None

    def claims(self, folder: str | None = None) -> dict[str, dict[str, tuple[float, float] | None]]:
        """Mean and least coverage of each share over the trials that have one, by estimator that claims."""
        trials = self.folders[folder] if folder is not None else list(self.trials)
        found: dict[str, dict[str, tuple[float, float] | None]] = {}
        for name in self.settings:
            rows = [self.coverage[trial][name] for trial in trials if name in self.coverage.get(trial, {})]
            if rows:
                found[name] = {share: _mean_and_least([row[share] for row in rows]) for share in SHARES}
        return found

    def differences(self, key: str = KEYS[0]) -> dict[str, dict[str, float]]:
        """By trial: how much larger the error of each other estimator is than that of `against`, degrees."""
        found: dict[str, dict[str, float]] = {}
        for trial, errors in self.trials.items():
            base = errors.get(self.against or "", {}).get(key)
            others = {name: e[key] for name, e in errors.items() if name != self.against}
            if base is not None:
                found[trial] = {name: value - base for name, value in others.items() if value is not None}
        return found

    def better(self, key: str = KEYS[0]) -> dict[str, tuple[int, int]]:
        """By other estimator: in how many trials its error is less than that of `against`, and of how many."""
        rows = self.differences(key).values()
        each = {name: [row[name] for row in rows if name in row] for name in self.settings if name != self.against}
        return {name: (sum(d < 0.0 for d in ds), len(ds)) for name, ds in each.items()}

    def as_dict(self) -> dict[str, Any]:
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
        parts = [Report(setting, tables=[self._own(name)]) for name, setting in self.settings.items()]
        means = f"mean of {counted(len(self.trials), 'recording')}; {len(self.skipped)} skipped"
        remarks = [means] if self.skipped else []
        remarks += [f"skipped {name}: {why}" for name, why in self.skipped.items()]
        remarks += [f"left out: {name}: {why}" for name, why in self.absent.items()]
        tables = [*self._paired(), *self._claimed(), *self._beside()]
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

    def _own(self, name: str) -> Table:
        rows = {trial: errors[name] for trial, errors in self.trials.items() if name in errors}
        means = {f"mean {told}".strip(): self.mean(folder)[name] for folder, told in self._sets()}
        return _table("RMSE [°]", {**rows, **means})

    def _beside(self) -> Iterator[Table]:
        if len(self.settings) < 2 and len(self.folders) < 2:
            return
        for folder, told in self._sets():
            trials = self.trials if folder is None else self.folders[folder]
            title = f"Mean RMSE of {counted(len(trials), 'trial')}{f', {told}' if folder else ''} [°]"
            yield _table(title, self.mean(folder))

    def _paired(self) -> Iterator[Table]:
        """Errors of one estimator, and by how much those of the others are larger, trial by trial."""
        if self.against is None:
            return
        others = [name for name in self.settings if name != self.against]
        for key in (KEYS[0], KEYS[2]):
            if not (found := self.differences(key)):
                continue
            rows = [
                [trial, _degrees(self.trials[trial][self.against][key]), *(_signed(row.get(o)) for o in others)]
                for trial, row in found.items()
            ]
            means = [np.mean([row[o] for row in found.values() if o in row] or [np.nan]) for o in others]
            better = [f"{n} of {of}" for n, of in self.better(key).values()]
            rows += [["mean", _degrees(self._mean(list(found), self.against, key)), *map(_signed, map(float, means))]]
            rows += [["better in", "", *better]]
            title = f"{key.partition('_')[0].capitalize()} RMSE of {self.against}, and what others have more [°]"
            yield Table(title, ["", self.against, *others], rows)

    def _claimed(self) -> Iterator[Table]:
        for folder, told in self._sets():
            found = self.claims(folder)
            rows = [[name, *map(_share, shares.values())] for name, shares in found.items()]
            where = f", {told}" if folder else ""
            if rows:
                title = f"Errors within 1.96 claimed sd{where}: mean of the trials (worst) [%]"
                yield Table(title, ["", *SHARES.values()], rows)

    def _calibrations(self) -> list[tuple[str, str]]:
        """Which trials had which calibration."""
        trials: dict[str, list[str]] = {}
        for trial, told in self.calibration.items():
            trials.setdefault(told, []).append(trial)
        whole = len(trials) == 1
        return [("calibration", f"{told}: {'all' if whole else ', '.join(names)}") for told, names in trials.items()]


def trials_in(*places: Path) -> list[Path]:
    """Recordings among files and in folders, in order of their names.

    Raises
    ------
    DecodeError
        If a place does not exist, or a folder holds none.
    """
    known = [suffix for kind in io.FORMATS for suffix in kind.suffixes]
    found: list[Path] = []
    for place in places:
        if place.is_file():
            found.append(place)
            continue
        if not place.is_dir():
            raise DecodeError(f"{place} is not a folder of recordings.")
        inside = sorted(p for p in place.iterdir() if p.suffix.lower() in known)
        if not inside:
            raise DecodeError(f"{place} holds no recording; known suffixes are {', '.join(known)}.")
        found += inside
    return found


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
    progress: Callable[[int], None] | None = None,
) -> Accuracy:
    """Run each estimator on each recording that carries a reference.

    Parameters
    ----------
    files : sequence of Path or Recording
        Recordings. One without sensor data or reference, or one that some estimator cannot take, is skipped for all
        with its reason, so that every mean is over the same trials; an estimator that can take none of a folder is
        left out of that folder.
    stages : sequence of Stage
        Filters with their parameters, and the smoother.
    peers : sequence of PeerRun
        Other libraries that run on the same recordings; see `plumbob.evaluation.many.peers.peer_runs`.
    absent : Mapping, optional
        Peers that could not be made, and why; they are only listed.
    frame : Frame, optional
        Navigation frame where a recording names none.
    align : sequence of str
        Alignments to allow, as in `plumbob.evaluation.evaluate`; none by default.
    changes : Mapping, optional
        What to change in every recording first, as `plumbob.evaluation.many.changed` has it.
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
        Called with 1 after each run of an estimator on a file.

    Raises
    ------
    DecodeError
        If no file is a trial.
    ParameterError
        If `against` names no estimator that runs, or a change is not known.
    """
    ways: dict[str, Way] = {stage.name: partial(_ours, stage) for stage in stages}
    ways |= {peer.name: partial(_theirs, peer) for peer in peers}
    if against is not None and against not in ways:
        raise ParameterError(f"there is no '{against}' to compare with; these run: {', '.join(ways)}.")
    skipped: dict[str, str] = {}
    found: list[_Trial] = []
    for file in files:
        place = file if isinstance(file, Path) else None
        name, where = (file.name, file.name) if place is None else (place.stem, place.name)
        try:
            raw, reference = read_trial(file)
        except PlumbobError as error:
            skipped[where] = str(error)
            continue
        try:
            imu = _prepared(raw, reference, changes or {}, seed, calibrated)
        except ShapeError as error:
            skipped[where] = str(error)
            continue
        judge = partial(_judged, raw=raw, reference=_within(reference, imu, between), align=align)
        nav = navigation_frame(imu, frame, where=str(place or name))
        results, refused = _run(ways, imu, nav, judge, progress)
        folder = "" if place is None else place.parent.name
        found.append(_Trial(name, where, folder, calibration_told(imu.meta.calibration), results, refused))
    if not found:
        raise DecodeError("no recording is a trial: " + "; ".join(dict.fromkeys(skipped.values())))
    told = {**changes, "seed": str(seed)} if changes else {}
    return _gathered(found, list(ways), tuple(align), skipped, dict(absent or {}), told, against)


def read_trial(file: Path | Recording) -> tuple[ImuData, AttitudeTrack]:
    """Sensor data and reference of a recording.

    Raises
    ------
    DecodeError
        If it does not hold both.
    """
    recording = file if isinstance(file, Recording) else io.read(file)
    if recording.imu is None or recording.track is None:
        raise DecodeError("it does not hold both sensor data and a reference")
    return recording.imu, recording.track


def _ours(stage: Stage, imu: ImuData, frame: Frame) -> AttitudeTrack:
    return run_stage(imu, stage, frame=frame)


def _theirs(peer: PeerRun, imu: ImuData, frame: Frame) -> AttitudeTrack:
    return peer_track(peer, imu, frame=frame)


def _prepared(
    imu: ImuData, reference: AttitudeTrack, changes: Mapping[str, str], seed: int, calibrated: bool
) -> ImuData:
    """Samples as the estimators get them."""
    imu = changed(imu, reference, changes, seed=seed)
    if not calibrated or imu.meta.calibration is not None:
        return imu
    return imu.corrected(meta=replace(imu.meta, calibration=DECLARED))


def _run(
    ways: Mapping[str, Way],
    imu: ImuData,
    frame: Frame,
    judge: Callable[[AttitudeTrack], _Result],
    progress: Callable[[int], None] | None,
) -> tuple[dict[str, _Result], dict[str, str]]:
    """What each estimator made of a trial, and why some refused it."""
    results, refused = {}, {}
    for name, way in ways.items():
        try:
            results[name] = judge(way(imu, frame))
        except ShapeError as error:
            refused[name] = str(error)
        if progress:
            progress(1)
    return results, refused


def _within(reference: AttitudeTrack, imu: ImuData, between: tuple[float, float] | None) -> AttitudeTrack:
    """Reference that is known only between two times after the first sample, s."""
    if between is None:
        return reference
    begin, end = (float(imu.t[0]) + time for time in between)
    inside = (reference.t >= begin) & (reference.t <= end)
    return reference.with_attitude(np.where(inside[:, np.newaxis], reference.q_nb, np.nan))


def _judged(track: AttitudeTrack, *, raw: ImuData, reference: AttitudeTrack, align: Sequence[str]) -> _Result:
    """Errors on one trial; none where an attitude is not finite, because a mean over the others would hide it."""
    if not track.known.all():
        return _Result(track.source, dict.fromkeys(KEYS), None)
    try:
        found = evaluate(track, reference, align=align)
    except ShapeError as error:
        return _Result(track.source, dict.fromkeys(KEYS), None, str(error))
    summary = found.summary()
    shares = None if track.cov_b is None else _coverage(found, np.interp(track.t, raw.t, turning(raw)))
    return _Result(track.source, {key: summary[key] for key in KEYS}, shares)


def _coverage(found: Evaluation, rate: Floats) -> Errors:
    """Shares of samples whose error lies within what is claimed, scored or not: at rest a claim must hold too."""
    track, match = found.estimate, found.match
    assert track.cov_b is not None
    known = np.isin(match.fate, (Fate.SCORED, Fate.MASKED))
    heading, tilt = inside_claim(track.q_nb[known], match.q_ref[known], track.cov_b[known])
    shares: Errors = {}
    for name, inside in (("heading", heading), ("tilt", tilt)):
        judged = name == "tilt" or "heading" in found.stats
        for where, rows in (("motion", rate[known] > RESTING), ("rest", rate[known] <= RESTING)):
            enough = judged and np.count_nonzero(rows) >= ENOUGH
            shares[f"{name}_{where}"] = float(np.mean(inside[rows])) if enough else None
    return shares


def _gathered(
    found: Sequence[_Trial],
    names: Sequence[str],
    align: tuple[str, ...],
    skipped: dict[str, str],
    absent: dict[str, str],
    changes: dict[str, str],
    against: str | None,
) -> Accuracy:
    """Trials that all can take who take any of their folder."""
    folders: dict[str, list[_Trial]] = {}
    for trial in found:
        folders.setdefault(trial.folder, []).append(trial)
    kept: dict[str, _Trial] = {}
    held: dict[str, list[str]] = {}
    for folder, trials in folders.items():
        none = [name for name in names if all(name in trial.refused for trial in trials)]
        for name in none:
            absent[f"{name} ({folder})" if len(folders) > 1 else name] = trials[0].refused[name]
        for trial in trials:
            before = f"{folder}/" if len(folders) > 1 else ""
            unscored = {name: result.why for name, result in trial.results.items() if result.why}
            refused = {name: text for name, text in trial.refused.items() if name not in none}
            if refused or len(unscored) == len(trial.results):
                why = [f"{name}: {text}" for name, text in (refused or unscored).items()]
                skipped[before + trial.file] = "; ".join(why)
            else:
                key = _unused(before + trial.name, kept)
                kept[key] = trial
                absent |= {f"{name} ({key})": text for name, text in unscored.items()}
                held.setdefault(folder, []).append(key)
    if not kept:
        raise DecodeError("no trial is one that every estimator can take. " + "; ".join(skipped.values()))
    sources = {n: dict.fromkeys(t.results[n].source for t in kept.values() if n in t.results) for n in names}
    return Accuracy(
        {key: {name: result.errors for name, result in trial.results.items()} for key, trial in kept.items()},
        {name: " or ".join(told) for name, told in sources.items() if told},
        align,
        skipped,
        absent,
        {key: trial.calibration for key, trial in kept.items()},
        {key: {n: r.shares for n, r in trial.results.items() if r.shares is not None} for key, trial in kept.items()},
        held,
        changes,
        against,
    )


def _unused(name: str, used: Mapping[str, object]) -> str:
    """The name, or with a number, so that it is not one that is used."""
    others = (f"{name} ({i})" for i in count(2))
    return next(one for one in chain([name], others) if one not in used)


def _mean_and_least(shares: Sequence[float | None]) -> tuple[float, float] | None:
    known = [share for share in shares if share is not None]
    return (sum(known) / len(known), min(known)) if known else None


def _degrees(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"


def _signed(value: float | None) -> str:
    return "–" if value is None or np.isnan(value) else f"{value:+.3f}"


def _share(pair: tuple[float, float] | None) -> str:
    return "–" if pair is None else f"{100.0 * pair[0]:.0f} ({100.0 * pair[1]:.0f})"


def _table(title: str, rows: Mapping[str, Errors]) -> Table:
    return Table(title, ["", *(key.partition("_")[0] for key in KEYS)], [
        [name, *(_degrees(errors.get(key)) for key in KEYS)] for name, errors in rows.items()
    ])  # fmt: skip
