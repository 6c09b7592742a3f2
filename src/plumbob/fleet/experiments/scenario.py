"""Accuracy on a simulated scenario over many seeds: what a paper's test would have shown, again and again."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.text import counted
from plumbob.core.units import Quantity, given, to_deg
from plumbob.door.evaluate import evaluate
from plumbob.filters.offline import Stage, bias_beyond, make_estimator, run_stage, with_noise
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report
from plumbob.rotations import Frame
from plumbob.simulation import simulate

AXES = ("roll", "pitch", "yaw")
FIGURES = ("rmse_deg", "std_deg", "max_abs_deg")  # a std hides the constant part, but some papers give nothing else
SHOWN = ("rmse_deg", "max_abs_deg")


@dataclass(frozen=True, slots=True)
class MonteCarlo:
    """Errors per axis of each filter in each seed."""

    scenario: str  # what was simulated, with its parameters
    settings: dict[str, str]  # what ran, by filter
    # ``values[filter][axis][figure]``, one number per seed, degrees. A heading that is free has none.
    values: dict[str, dict[str, dict[str, list[float]]]]
    limit_deg: float | None = None  # error of roll and pitch, degrees, that is to be kept
    # by filter: in words, what contradicts its settings, one for each seed where something does
    warnings: dict[str, list[str]] = field(default_factory=dict)

    def largest_tilt(self, name: str) -> Floats:
        """Largest error of roll and pitch together in each seed, degrees."""
        roll, pitch = (self.values[name][axis]["max_abs_deg"] for axis in ("roll", "pitch"))
        return np.maximum(roll, pitch)

    def kept(self, name: str, limit_deg: float) -> float:
        """Share of the seeds whose roll and pitch stay within a limit."""
        return float(np.mean(self.largest_tilt(name) <= limit_deg))

    def summary(self) -> dict[str, Any]:
        """Ready for JSON: median, 95 % and maximum over the seeds beside the values themselves."""
        summary = {
            name: {axis: {f: _summary(seeds) for f, seeds in figures.items()} for axis, figures in axes.items()}
            for name, axes in self.values.items()
        }
        content: dict[str, Any] = {
            "scenario": self.scenario,
            "settings": self.settings,
            "summary": summary,
            "seeds": self.values,
            "warnings": self.warnings,
        }
        if self.limit_deg is not None:
            shares = {name: self.kept(name, self.limit_deg) for name in self.values}
            content |= {"limit_deg": self.limit_deg, "share_within_limit": shares}
        return content

    def text(self) -> str:
        """Errors over the seeds, a table for each filter."""
        head = ["", *(f"{figure} {of}" for figure in ("rms", "largest") for of in ("median", "95 %", "max"))]
        parts = []
        for name, setting in self.settings.items():
            rows = [
                [axis, *(f"{v:.3f}" for figure in SHOWN for v in _summary(figures[figure]).values())]
                for axis, figures in self.values[name].items()
            ]
            parts.append(Report(setting, tables=[Table("Error [°]", head, rows)], remarks=self._remarks(name)))
        return Report(self.scenario, parts=parts, remarks=self._ratios()).text()

    def _remarks(self, name: str) -> list[str]:
        warnings = self.warnings.get(name, [])
        count = len(next(iter(self.values[name].values()))[FIGURES[0]])
        remarks = [f"in {len(warnings)} of {count} seeds, as in the first of them: {warnings[0]}"] if warnings else []
        if self.limit_deg is None:
            return remarks
        share = 100.0 * self.kept(name, self.limit_deg)
        return [*remarks, f"roll and pitch stay within {self.limit_deg:g}° in {share:.0f} % of the seeds"]

    def _ratios(self) -> list[str]:
        """Tilt errors of the other filters beside the first one's, where a limit was asked for."""
        first, *others = self.values
        lines = []
        for name in others if self.limit_deg is not None else ():
            with np.errstate(divide="ignore", invalid="ignore"):  # ideal sensors may leave no error at all
                ratio = self.largest_tilt(name) / self.largest_tilt(first)
            figures = f"{np.median(ratio):.1f} (median over the seeds; least {ratio.min():.1f})"
            lines.append(f"largest tilt error of {name} over that of {first}: {figures}")
        return lines


def measure_scenario(
    scenario: str,
    stages: Sequence[Stage],
    *,
    frame: Frame,
    sensors: str,
    unit: str,
    seeds: Sequence[int],
    settings: Mapping[str, Any],
    settle: float | str = 0.0,
    limit: float | str | None = None,
    own_noise: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> MonteCarlo:
    """Simulate a scenario with each seed and run each filter on it.

    Parameters
    ----------
    scenario : str
        Its name; see 'plumbob list scenarios'.
    stages : sequence of Stage
        Filters with their parameters.
    frame : Frame
        Navigation frame.
    sensors, unit : str
        As in `plumbob.simulate`.
    seeds : sequence of int
        One run each.
    settings : Mapping
        Everything else that `plumbob.simulation.simulate` takes.
    settle : float or str
        Time from the start that is left out: s, or text with a unit.
    limit : float or str, optional
        Limit of roll and pitch error, as "1 deg": the share of the seeds that keep it, and how the filters compare.
    own_noise : bool
        Give each filter that takes one the noise card of the simulated unit.
    progress : callable, optional
        Called with the seeds that are done, and all.
    """
    settle, limit = given("settle", settle, Quantity.TIME) or 0.0, given("limit", limit, Quantity.ANGLE)
    values: dict[str, dict[str, dict[str, list[float]]]] = {}
    ran: dict[str, str] = {}
    warnings: dict[str, list[str]] = {}
    for done, seed in enumerate(seeds, start=1):
        run = simulate(scenario, frame=frame, sensors=sensors, unit=unit, seed=seed, **settings)
        for stage in with_noise(stages, run.noise) if own_noise else stages:
            track = run_stage(run.imu, stage, frame=frame)
            ran[stage.name] = track.source
            beyond = bias_beyond(make_estimator(stage, frame, run.imu.meta), track)
            warnings.setdefault(stage.name, []).extend(map(str, beyond))
            _append(values.setdefault(stage.name, {}), evaluate(track, run.truth, settle=settle).summary())
        if progress:
            progress(done, len(seeds))
    what = run.truth.source.rpartition(", seed")[0]
    title = f"{what}; sensors {sensors} ({unit}); {counted(len(seeds), 'seed')}; first {settle:g} s left out"
    if own_noise:
        title += "; noise cards of the units"
    return MonteCarlo(title, ran, values, None if limit is None else to_deg(limit), warnings)


def _append(by_axis: dict[str, dict[str, list[float]]], summary: Mapping[str, Any]) -> None:
    for axis in (axis for axis in AXES if summary[axis] is not None):  # a free heading has no error
        for figure in FIGURES:
            by_axis.setdefault(axis, {}).setdefault(figure, []).append(summary[axis][figure])


def _summary(seeds: Sequence[float]) -> dict[str, float]:
    return {"median": float(np.median(seeds)), "p95": float(np.percentile(seeds, 95)), "max": float(np.max(seeds))}
