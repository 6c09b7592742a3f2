"""Accuracy on a folder of recordings with references: one parameter set for all trials, then the mean over trials."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from plumbob import io
from plumbob.errors import DecodeError, PlumbobError, ShapeError
from plumbob.evaluate import evaluate
from plumbob.pipeline import Stage, estimate, navigation_frame
from plumbob.rotations import Frame

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
        Files that are no trial, and why.
    """

    trials: dict[str, dict[str, dict[str, float | None]]]
    settings: dict[str, str]
    align: tuple[str, ...]
    skipped: dict[str, str]

    def mean(self) -> dict[str, dict[str, float | None]]:
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
            "trials": self.trials,
            "mean": self.mean(),
            "skipped": self.skipped,
        }

    def text(self) -> str:
        """Table of the trials and their mean, per filter."""
        width = max(len(name) for name in (*self.trials, "mean"))
        lines = []
        for name, setting in self.settings.items():
            aligned = f"aligned first: {', '.join(self.align) or 'nothing'}"
            lines += [setting, aligned, f"{'RMSE in degrees':{width}}  {'total':>9} {'heading':>9} {'incl.':>9}"]
            lines += [_row(trial, width, errors[name]) for trial, errors in self.trials.items()]
            lines += [_row("mean", width, self.mean()[name]), ""]
        if self.skipped:
            lines += [f"mean of {len(self.trials)} recordings; {len(self.skipped)} skipped"]
        lines += [f"skipped {name}: {why}" for name, why in self.skipped.items()]
        return "\n".join(lines).rstrip()


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
    frame: Frame | None = None,
    align: Sequence[str] = (),
    progress: Callable[[int], None] | None = None,
) -> Accuracy:
    """Run each filter on each recording that carries a reference.

    Parameters
    ----------
    files : sequence of Path
        Recordings; a file without sensor data or reference is skipped with its reason.
    stages : sequence of Stage
        Filters with their parameters.
    frame : Frame, optional
        Navigation frame where a recording names none.
    align : sequence of str
        Alignments to allow, as in `plumbob.evaluate.evaluate`; none by default.
    progress : callable, optional
        Called with 1 after each file.

    Raises
    ------
    DecodeError
        If no file is a trial.
    """
    trials: dict[str, dict[str, dict[str, float | None]]] = {}
    settings: dict[str, list[str]] = {}
    skipped: dict[str, str] = {}
    for path in files:
        try:
            recording = io.read(path)
        except PlumbobError as error:
            skipped[path.name] = str(error)
            continue
        finally:
            if progress:
                progress(1)
        if recording.imu is None or recording.track is None:
            skipped[path.name] = "it does not hold both sensor data and a reference"
            continue
        nav = navigation_frame(recording.imu, frame, where=str(path))
        trials[path.stem] = {}
        for stage in stages:
            try:
                track = estimate(recording.imu, stage, frame=nav)
            except ShapeError as error:
                skipped[path.name] = str(error)
                trials.pop(path.stem, None)
                break
            settings.setdefault(stage.name, []).append(track.source)
            summary = evaluate(track, recording.track, align=align).summary()
            trials[path.stem][stage.name] = {key: summary[key] for key in KEYS}
    if not trials:
        raise DecodeError("no file holds both sensor data and a reference. " + "; ".join(skipped.values()))
    told = {name: " or ".join(dict.fromkeys(sources)) for name, sources in settings.items()}
    return Accuracy(trials, told, tuple(align), skipped)


def _row(name: str, width: int, errors: dict[str, float | None]) -> str:
    cells = " ".join(f"{'–':>9}" if errors[key] is None else f"{errors[key]:9.3f}" for key in KEYS)
    return f"{name:{width}}  {cells}"
