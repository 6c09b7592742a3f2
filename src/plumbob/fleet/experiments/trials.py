"""Estimators on recordings with references: one parameter set for all trials."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from plumbob import files as io
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, ShapeError
from plumbob.core.units import dps
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.data.recording import Recording
from plumbob.door.evaluate import evaluate
from plumbob.evaluation.align import Fate
from plumbob.evaluation.evaluation import Evaluation
from plumbob.evaluation.metrics import inside_claim
from plumbob.filters.offline import Stage, navigation_frame, run_stage
from plumbob.fleet.experiments.accuracy import KEYS, Accuracy, Errors
from plumbob.fleet.experiments.peers import PeerRun, peer_track
from plumbob.fleet.experiments.variants import SEED, changed, turning
from plumbob.rotations import Frame, North

Way = Callable[[ImuData, Frame], AttitudeTrack]

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
            suffixes = dict.fromkeys(suffix for kind in io.FORMATS for suffix in kind.suffixes if suffix)
            raise DecodeError(f"{place} holds no recording; known suffixes are {', '.join(suffixes)}.")
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
        Other libraries that run on the same recordings; see `plumbob.fleet.experiments.peers.peer_runs`.
    absent : Mapping, optional
        Peers that could not be made, and why; they are only listed.
    frame : Frame, optional
        Navigation frame where a recording names none.
    align : sequence of str
        Alignments to allow, as in `plumbob.evaluate`; none by default.
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
    trials: list[_Trial] = []
    for file in files:
        place = file if isinstance(file, Path) else None
        name, where = (file.name, file.name) if place is None else (place.stem, place.name)
        try:
            raw, reference = _opened(file)
            imu = _prepared(raw, reference, changes or {}, seed, calibrated)
        except ShapeError as error:
            skipped[where] = str(error)
            continue
        judge = partial(_judged, raw=raw, reference=_within(reference, imu, between), align=align)
        nav = navigation_frame(imu, frame, where=str(place or name))
        results, refused = _run(ways, imu, nav, judge, progress)
        folder = "" if place is None else place.parent.name
        trials.append(_Trial(name, where, folder, calibration_told(imu.meta.calibration), results, refused))
    if not trials:
        raise DecodeError("no recording is a trial: " + "; ".join(dict.fromkeys(skipped.values())))
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


def _opened(file: Path | Recording) -> tuple[ImuData, AttitudeTrack]:
    """Both of a recording; whatever is wrong with it, it is one to be skipped."""
    try:
        return read_trial(file)
    except PlumbobError as error:
        raise ShapeError(str(error)) from error


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
        evaluation = evaluate(track, reference, align=align)
    except ShapeError as error:
        return _Result(track.source, dict.fromkeys(KEYS), None, str(error))
    summary = evaluation.summary()
    shares = None if track.cov_b is None else _coverage(evaluation, np.interp(track.t, raw.t, turning(raw)))
    return _Result(track.source, {key: summary[key] for key in KEYS}, shares)


def _coverage(evaluation: Evaluation, rate: Floats) -> Errors:
    """Shares of samples whose error lies within what is claimed, scored or not: at rest a claim must hold too."""
    track, match = evaluation.estimate, evaluation.match
    assert track.cov_b is not None
    mask = np.isin(match.fate, (Fate.SCORED, Fate.MASKED))
    free = track.north is North.FREE
    heading, tilt = inside_claim(track.q_nb[mask], match.q_ref[mask], track.cov_b[mask], free=free)
    shares: Errors = {}
    for name, inside in (("heading", heading), ("tilt", tilt)):
        judged = name == "tilt" or "heading" in evaluation.stats
        for where, rows in (("motion", rate[mask] > RESTING), ("rest", rate[mask] <= RESTING)):
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
    folders: dict[str, list[_Trial]] = {}
    for trial in measured:
        folders.setdefault(trial.folder, []).append(trial)
    shared: dict[str, _Trial] = {}
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
                key = unused_name(before + trial.name, shared)
                shared[key] = trial
                absent |= {f"{name} ({key})": text for name, text in unscored.items()}
                held.setdefault(folder, []).append(key)
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
        held,
        changes,
        against,
    )


def unused_name(name: str, used: Mapping[str, object]) -> str:
    """The name, or with a number, so that it is not one that is used."""
    others = (f"{name} ({i})" for i in count(2))
    return next(candidate for candidate in chain([name], others) if candidate not in used)
