"""Estimators on recordings with references: one parameter set for all trials."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from plumbob import files as io
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, ShapeError
from plumbob.core.units import dps
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.data.recording import Recording
from plumbob.door.evaluate import evaluate
from plumbob.evaluation.align import Fate
from plumbob.evaluation.evaluation import Evaluation
from plumbob.evaluation.metrics import inside_claim
from plumbob.files.formats import suffixes
from plumbob.filters.offline import Stage, navigation_frame, run_stage
from plumbob.fleet.experiments.accuracy import KEYS, Accuracy, Errors
from plumbob.fleet.experiments.peers import PeerRun, peer_track
from plumbob.fleet.experiments.variants import SEED, changed, turning
from plumbob.rotations import Frame, North

RESTING: Final = dps(5.0)
"""A claim is one in motion where the mean rate of a second exceeds this, rad/s."""
ENOUGH: Final = 100
"""A share of fewer samples than this is not given."""
DECLARED: Final = "declared, no card"
"""Calibration of recordings that are said to be calibrated."""


def trials_in(*places: Path) -> list[Path]:
    """Recordings among files and in folders, in order of their names.

    Raises
    ------
    DecodeError
        If a place does not exist, or a folder holds none.
    """
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
    if not track.known.all():
        return _Result(track.source, dict.fromkeys(KEYS), None)
    try:
        evaluation = evaluate(track, reference, align=align)
    except ShapeError as error:
        return _Result(track.source, dict.fromkeys(KEYS), None, str(error))
    summary = evaluation.summary()
    return _Result(track.source, {key: summary[key] for key in KEYS}, _coverage(evaluation, raw))


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
    measured: Sequence[_Trial],
    names: Sequence[str],
    align: tuple[str, ...],
    skipped: dict[str, str],
    absent: dict[str, str],
    changes: dict[str, str],
    against: str | None,
) -> Accuracy:
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
        {name: " or ".join(labels) for name, labels in sources.items() if labels},
        align,
        skipped,
        absent,
        {key: trial.calibration for key, trial in shared.items()},
        {key: {n: r.shares for n, r in trial.results.items() if r.shares is not None} for key, trial in shared.items()},
        {folder: keys for folder in folders if (keys := [key for key, t in shared.items() if t.folder == folder])},
        changes,
        against,
    )


def unused_name(name: str, used: Mapping[str, object]) -> str:
    """The name, or with a number, so that it is not one that is used."""
    others = (f"{name} ({i})" for i in count(2))
    return next(candidate for candidate in chain([name], others) if candidate not in used)
