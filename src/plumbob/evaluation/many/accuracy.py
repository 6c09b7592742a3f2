"""Accuracy on a folder of recordings with references: one parameter set for all trials, then the mean over trials."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from plumbob import files as io
from plumbob.core.errors import DecodeError, PlumbobError, ShapeError
from plumbob.core.text import counted
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.evaluation import evaluate
from plumbob.evaluation.many.peers import PeerRun, peer_track
from plumbob.filters.offline import Stage, navigation_frame, run_stage
from plumbob.report import Report, Table
from plumbob.rotations import Frame

Errors = dict[str, float | None]
Way = Callable[[ImuData, Frame], AttitudeTrack]

KEYS = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg")


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Errors of each filter on each trial.

    Attributes
    ----------
    trials : dict
        ``trials[trial][filter][key]``, degrees.
    settings : dict
        What ran, by filter; several where recordings know different declinations.
    align : tuple of str
        What was aligned before the errors were measured.
    skipped : dict
        Files that are not trials, and why.
    absent : dict
        Peers that could not run, and why.
    calibration : dict
        By trial: the card that has been applied to its sensor values, or in words that none has.
    """

    trials: dict[str, dict[str, Errors]]
    settings: dict[str, str]
    align: tuple[str, ...]
    skipped: dict[str, str]
    absent: dict[str, str] = field(default_factory=dict)
    calibration: dict[str, str] = field(default_factory=dict)

    def mean(self) -> dict[str, Errors]:
        """Mean over the trials, by filter; None where a trial has no such error."""
        return {name: {key: self._mean(name, key) for key in KEYS} for name in self.settings}

    def _mean(self, name: str, key: str) -> float | None:
        values = [trial[name][key] for trial in self.trials.values()]
        known = [v for v in values if v is not None]
        return sum(known) / len(known) if len(known) == len(values) else None

    def as_dict(self) -> dict[str, Any]:
        """Ready for JSON: per trial and mean, by filter."""
        aligned = list(self.align)
        return {
            "settings": self.settings,
            "align": aligned,
            "calibration": self.calibration,
            "trials": self.trials,
            "mean": self.mean(),
            "skipped": self.skipped,
            "absent": self.absent,
        }

    def report(self) -> Report:
        """Table of the trials and their mean for each filter, and the means beside each other."""
        means = self.mean()
        trials = {name: {trial: errors[name] for trial, errors in self.trials.items()} for name in self.settings}
        parts = [
            Report(setting, tables=[_table("RMSE [°]", {**trials[name], "mean": means[name]})])
            for name, setting in self.settings.items()
        ]
        count = f"mean of {counted(len(self.trials), 'recording')}; {len(self.skipped)} skipped"
        remarks = [count] if self.skipped else []
        remarks += [f"skipped {name}: {why}" for name, why in self.skipped.items()]
        remarks += [f"peer left out: {name}: {why}" for name, why in self.absent.items()]
        beside = [_table(f"Mean RMSE of {counted(len(self.trials), 'trial')} [°]", means)] if len(means) > 1 else []
        facts = [*self._calibrations(), ("aligned", ", ".join(self.align) or "nothing")]
        return Report("Accuracy", facts=facts, parts=[*parts, Report("", tables=beside, remarks=remarks)])

    def text(self) -> str:
        """Report as text."""
        return self.report().text()

    def _calibrations(self) -> list[tuple[str, str]]:
        """Which trials had which calibration."""
        trials: dict[str, list[str]] = {}
        for trial, told in self.calibration.items():
            trials.setdefault(told, []).append(trial)
        whole = len(trials) == 1
        return [("calibration", f"{told}: {'all' if whole else ', '.join(names)}") for told, names in trials.items()]


def trials_in(folder: Path) -> list[Path]:
    """Files of a folder that may be recordings, in order of their names.

    Raises
    ------
    DecodeError
        If the folder does not exist or holds none.
    """
    if not folder.is_dir():
        raise DecodeError(f"{folder} is not a folder of recordings.")
    known = [suffix for kind in io.FORMATS for suffix in kind.suffixes]
    found = sorted(p for p in folder.iterdir() if p.suffix.lower() in known)
    if not found:
        raise DecodeError(f"{folder} holds no recording; known suffixes are {', '.join(known)}.")
    return found


def measure_accuracy(
    files: Sequence[Path],
    stages: Sequence[Stage],
    *,
    peers: Sequence[PeerRun] = (),
    absent: Mapping[str, str] | None = None,
    frame: Frame | None = None,
    align: Sequence[str] = (),
    progress: Callable[[int], None] | None = None,
) -> Accuracy:
    """Run each filter on each recording that carries a reference.

    Parameters
    ----------
    files : sequence of Path
        Recordings; a file without sensor data or reference, or one that some filter cannot take, is skipped for all
        with its reason, so that every mean is over the same trials.
    stages : sequence of Stage
        Filters with their parameters.
    peers : sequence of PeerRun
        Other libraries that run on the same recordings; see `plumbob.evaluation.many.peers.peer_runs`.
    absent : Mapping, optional
        Peers that could not be made, and why; they are only listed.
    frame : Frame, optional
        Navigation frame where a recording names none.
    align : sequence of str
        Alignments to allow, as in `plumbob.evaluation.evaluate`; none by default.
    progress : callable, optional
        Called with 1 after each run of a filter or peer on a file.

    Raises
    ------
    DecodeError
        If no file is a trial.
    """
    ways: dict[str, Way] = {stage.name: partial(_ours, stage) for stage in stages}
    ways |= {peer.name: partial(_theirs, peer) for peer in peers}
    trials: dict[str, dict[str, Errors]] = {}
    sources: dict[str, list[str]] = {name: [] for name in ways}
    skipped: dict[str, str] = {}
    calibration: dict[str, str] = {}
    for path in files:
        try:
            imu, reference = read_trial(path)
        except PlumbobError as error:
            skipped[path.name] = str(error)
            continue
        nav = navigation_frame(imu, frame, where=str(path))
        try:
            tracks = _run(ways, imu, nav, progress)
        except ShapeError as error:
            skipped[path.name] = str(error)
            continue
        calibration[path.stem] = calibration_told(imu.meta.calibration)
        trials[path.stem] = {name: _errors(track, reference, align) for name, track in tracks.items()}
        for name, track in tracks.items():
            sources[name].append(track.source)
    if not trials:
        raise DecodeError("no file holds both sensor data and a reference. " + "; ".join(skipped.values()))
    told = {name: " or ".join(dict.fromkeys(all_)) for name, all_ in sources.items()}
    return Accuracy(trials, told, tuple(align), skipped, dict(absent or {}), calibration)


def read_trial(path: Path) -> tuple[ImuData, AttitudeTrack]:
    """Sensor data and reference of a recording.

    Raises
    ------
    DecodeError
        If it does not hold both.
    """
    recording = io.read(path)
    if recording.imu is None or recording.track is None:
        raise DecodeError("it does not hold both sensor data and a reference")
    return recording.imu, recording.track


def _ours(stage: Stage, imu: ImuData, frame: Frame) -> AttitudeTrack:
    return run_stage(imu, stage, frame=frame)


def _theirs(peer: PeerRun, imu: ImuData, frame: Frame) -> AttitudeTrack:
    return peer_track(peer, imu, frame=frame)


def _run(
    ways: Mapping[str, Way], imu: ImuData, frame: Frame, progress: Callable[[int], None] | None
) -> dict[str, AttitudeTrack]:
    tracks = {}
    for name, way in ways.items():
        tracks[name] = way(imu, frame)
        if progress:
            progress(1)
    return tracks


def _errors(track: AttitudeTrack, reference: AttitudeTrack, align: Sequence[str]) -> Errors:
    """Errors on one trial; none where an attitude is not finite, because a mean over the others would hide it."""
    if not track.known.all():
        return dict.fromkeys(KEYS)
    summary = evaluate(track, reference, align=align).summary()
    return {key: summary[key] for key in KEYS}


def _table(title: str, rows: Mapping[str, Errors]) -> Table:
    cells = [[name, *("–" if e[key] is None else f"{e[key]:.3f}" for key in KEYS)] for name, e in rows.items()]
    return Table(title, ["", "total", "heading", "inclination"], cells)
