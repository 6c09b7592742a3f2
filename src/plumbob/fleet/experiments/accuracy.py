"""Accuracy on recordings with references: errors of each estimator on each trial, their means, and the tables."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from plumbob.core.text import counted
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report

Errors = dict[str, float | None]

KEYS = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg")
SHARES: Final = {
    "heading_motion": "heading, in motion",
    "heading_rest": "at rest",
    "tilt_motion": "tilt, in motion",
    "tilt_rest": "at rest",
}
"""Coverage of a claim: shares of samples whose error is within 1.96 claimed standard deviations, and their titles."""


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Errors of each estimator on each trial."""

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
                [trial, _degrees(self.trials[trial][self.against][key]), *(_signed(row.get(o)) for o in others)]
                for trial, row in excess.items()
            ]
            means = [np.mean([row[o] for row in excess.values() if o in row] or [np.nan]) for o in others]
            better = [f"{n} of {of}" for n, of in self.better(key).values()]
            rows += [["mean", _degrees(self._mean(list(excess), self.against, key)), *map(_signed, map(float, means))]]
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
