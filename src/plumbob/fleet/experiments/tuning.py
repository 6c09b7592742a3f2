"""Parameters of a filter fitted to recordings with references, and what they are worth on recordings not fitted to.

The error of a set of parameters is the geometric mean over recordings of the rms error that `plumbob.evaluate` defines:
the mean of logarithms, so that a recording with large errors does not outweigh the others. It is searched in the
logarithms of the parameters by SciPy: DIRECT over the whole range, then Nelder and Mead from its best point. Nothing is
drawn at random. A search sees its own recordings alone; what was run of one is not run again for another search.

Cross-validation: the groups of recordings are dealt to folds in their order; for each fold the search sees the other
recordings only, and the errors on the fold's own are those held out. The gain is the geometric mean of the held-out
errors relative to those of the defaults, with a paired 95 % interval of Student's t over groups.
"""

import json
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core import __version__, check
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, ShapeError
from plumbob.core.files import file_sha256, write_text
from plumbob.core.params import Parameter, allowed, checked, describe, shown
from plumbob.core.result import Reported, plain
from plumbob.core.text import counted, visible
from plumbob.core.units import Quantity, given, to_deg
from plumbob.data.recording import Recording
from plumbob.door.evaluate import evaluate
from plumbob.filters import CommonParams
from plumbob.filters.known import load
from plumbob.filters.offline import Stage, navigation_frame, run_stage
from plumbob.fleet.experiments.trials import degrees, read_trial, trials_in, unused_name
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report
from plumbob.rotations import Frame

METRICS: Final = ("total", "heading", "inclination")
GROUPS: Final = ("recording", "folder", "device")
REACH: Final = 100.0  # without a range, a parameter is sought between its default over this and its default times this
NEAR_END: Final = 0.02  # a value within this share of its range, in logarithms, is at the end of the range
GLOBAL: Final = 0.6  # share of the budget that is spent on the whole range; the rest refines
STEP: Final = 0.08  # first step of the refinement, share of the range in logarithms
WORST: Final = math.pi  # error of a run that cannot be scored, rad: none is larger
LEAST: Final = 1e-9  # smallest error whose logarithm is taken, rad
# The few that matter most, of filters with gates or many parameters; of others all with a default above 0.
FEW: Final[Mapping[str, tuple[str, ...]]] = {
    "mahony": ("kp", "ki"),
    "vqf": ("tau_acc", "tau_mag"),
    "mekf": ("gyr_noise", "acc_noise", "speed", "mag_noise"),
}


@dataclass(frozen=True, slots=True)
class Range:
    """A parameter that is sought, with the ends of its range in the unit inside."""

    parameter: Parameter
    low: float
    high: float

    def value_at(self, x: float) -> float:
        """Value at a place of the range, 0 to 1, even in logarithms."""
        return float(min(self.high, max(self.low, self.low * (self.high / self.low) ** x)))

    def place(self, value: float) -> float:
        """Where a value lies in the range, 0 to 1."""
        return min(1.0, max(0.0, math.log(value / self.low) / math.log(self.high / self.low)))


@dataclass(frozen=True, slots=True)
class Tuned:
    """What was found for a parameter: values in the unit inside."""

    name: str  # of the parameter
    # default, value: of the filter, and fitted to all recordings; the default is NaN where it is off
    default: float
    value: float
    # low, high: range that was searched
    low: float
    high: float
    folds: tuple[float, ...]  # value of each fold; that they differ much says that the recordings do not determine it
    at_end: str  # "low" or "high" where the value lies at that end of its range, else empty


@dataclass(frozen=True, slots=True)
class Held:
    """Errors on a recording, degrees, and what it is."""

    # name, group: of the recording, and of what is held out together
    name: str
    group: str
    fold: int | None  # number of the fold in which it is held out, from 1; None where there are no folds
    default_deg: float  # with the filter's defaults
    tuned_deg: float | None  # held out: with parameters that were fitted without its group
    fitted_deg: float  # with parameters that were fitted to all recordings, this one too
    sha256: str | None  # of its file


@dataclass(frozen=True, repr=False)
class Tuning(Reported):
    """Tuned parameters of a filter, and whether they can be expected to help on other recordings."""

    filter: str
    metric: str
    group_by: str
    fixed: Mapping[str, Any]  # parameters that were given and not sought
    parameters: tuple[Tuned, ...]
    recordings: tuple[Held, ...]
    folds: int  # 0 where there is one group only, so that nothing can be held out
    # geometric means: over folds and their training recordings, and over groups of what is held out
    train_default_deg: float
    train_tuned_deg: float
    held_default_deg: float | None
    held_tuned_deg: float | None
    # held-out error relative to the defaults', −0.2 for a fifth less, with its paired 95 % interval over groups
    gain: tuple[float, float, float] | None
    budget: int  # evaluations for each search, about
    runs: int  # of the filter, in all
    align: tuple[str, ...]
    skipped: Mapping[str, str]  # files that were not used, and why

    @property
    def proven(self) -> bool:
        """Whether a gain on recordings that were not fitted to is outside of its uncertainty."""
        return self.gain is not None and self.gain[2] < 0.0

    @property
    def gap(self) -> float | None:
        """Generalisation gap: by how much the gain is less on held-out recordings than on those fitted to, 0 to 1."""
        if self.gain is None:
            return None
        return self.gain[0] - (self.train_tuned_deg / self.train_default_deg - 1.0)

    @property
    def params(self) -> dict[str, Any]:
        """Fitted to all recordings, with those that were given; what `plumbob.estimate` takes as `params`."""
        return {**self.fixed, **{p.name: p.value for p in self.parameters}}

    def verdict(self) -> str:
        """What to do, in a sentence or two."""
        if self.gain is None:
            return (
                f"Nothing can be said of other recordings: there is one {self.group_by} only, and the parameters are "
                "fitted to it. Add recordings of other motions, days or units."
            )
        groups = counted(len({r.group for r in self.recordings}), self.group_by)
        if self.proven:
            return f"The gain on held-out recordings is outside of its uncertainty over {groups}."
        if self.gain[1] > 0.0:
            return f"Keep the defaults: on held-out recordings the tuned parameters are worse, over {groups}."
        return f"Keep the defaults: the gain on held-out recordings is within its uncertainty over {groups}."

    def facts(self) -> Mapping[str, str]:
        """What it is, in words."""
        return {"filter": self.filter, "recordings": str(len(self.recordings)), "verdict": self.verdict()}

    def summary(self) -> dict[str, Any]:
        """Ready for JSON: parameters in the unit inside, errors in degrees."""
        more = {"proven": self.proven, "gap": self.gap, "verdict": self.verdict(), "version": __version__}
        return {**plain(self), **more}

    def report(self) -> Report:
        """Parameters, errors on what was fitted to and on what was not, and each recording."""
        by = "" if self.group_by == "recording" else f", {self.group_by}s held out together"
        facts = [
            ("recordings", str(len(self.recordings))),
            ("error", f"{self.metric} RMSE, geometric mean over recordings"),
            ("aligned", ", ".join(self.align) or "nothing"),
            ("folds", f"{counted(self.folds, 'fold')}{by}" if self.folds else "none: nothing can be held out"),
            ("search", f"about {self.budget} evaluations for each search, {self.runs} runs of the filter"),
        ]
        if self.fixed:
            facts.append(("given", ", ".join(f"{name}={value}" for name, value in self.fixed.items())))
        ends = (
            f"{p.name} lies at the {p.at_end} end of the range that was searched: the best value may be beyond it"
            for p in self.parameters
            if p.at_end
        )
        skipped = (f"skipped {name}: {why}" for name, why in self.skipped.items())
        return Report(f"Parameters of {self.filter}", facts=facts, tables=list(self._tables()),
                      remarks=[*ends, *skipped, self.verdict()])  # fmt: skip

    def _tables(self) -> Iterator[Table]:
        declared, rows = _parameters(self.filter), []
        for p in self.parameters:
            ends = (p.default, p.value, *((min(p.folds), max(p.folds)) if p.folds else (math.nan,) * 2), p.low, p.high)
            default, value, least, most, low, high = (_text(declared[p.name], number) for number in ends)
            folds = f"{least} to {most}" if p.folds else least
            rows.append([p.name, default if p.default == p.default else "off", value, folds, f"{low} to {high}"])
        yield Table("Parameters, tuned to all recordings", ["", "default", "tuned", "in the folds", "searched"], rows)
        rows = [_compared("fitted to", self.train_default_deg, self.train_tuned_deg)]
        if self.gain is not None and self.held_default_deg is not None and self.held_tuned_deg is not None:
            held = _compared("held out", self.held_default_deg, self.held_tuned_deg)
            change, low, high = map(_percent, self.gain)
            rows += [[*held[:-1], f"{change} ({low} to {high})"], ["gap", "", "", _percent(self.gap or 0.0)]]
        title = f"{self.metric.capitalize()} RMSE, geometric mean [°]"
        yield Table(title, ["", "defaults", "tuned", "change (95 %)"], rows)
        yield Table("RMSE of each recording [°]", ["", "fold", "defaults", "held out", "fitted to all"], [
            [r.name, str(r.fold or "–"), *map(degrees, (r.default_deg, r.tuned_deg, r.fitted_deg))]
            for r in self.recordings
        ])  # fmt: skip

    def toml(self) -> str:
        """Parameter file as ``run --params`` takes it, with the report, from which the values come, in comments."""
        declared = _parameters(self.filter)
        lines = [f"tuned by plumbob {__version__}", *self.text().splitlines()]
        lines += [f"{json.dumps(r.name)}, sha256 {r.sha256 or 'not of a file'}" for r in self.recordings]
        lines = [f"# {visible(line)}".rstrip() for line in lines] + ["", f"[{self.filter}]"]
        for name, value in self.params.items():
            text = value if isinstance(value, str) else shown(declared[name], value)
            lines.append(f"{name} = {json.dumps(text)}")
        return "\n".join([*lines, ""])

    def write(self, path: str | Path, *, unproven: bool = False, overwrite: bool = False) -> Path:
        """Write the parameter file (.toml); without a gain on held-out recordings only where `unproven` is set."""
        if (path := check.path("path", path)).suffix.lower() != ".toml":
            raise ParameterError(f"a parameter file needs a name that ends in .toml, but got {path}.")
        if not (self.proven or unproven):
            raise ParameterError(f"{path} is not written. {self.verdict()} To write it anyway, give unproven.")
        return write_text(path, self.toml(), overwrite=overwrite)


def tune(
    recordings: str | Path | Recording | Sequence[str | Path | Recording],
    filter: str,
    *,
    params: Collection[str] | None = None,
    fixed: Mapping[str, Any] | None = None,
    metric: str = "total",
    group_by: str = "recording",
    folds: int | None = None,
    budget: int = 60,
    frame: Frame | str | None = None,
    align: Collection[str] = (),
    settle: float | str = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> Tuning:
    """Fit parameters of a filter to recordings with references, and cross-validate what they are worth.

    Parameters
    ----------
    recordings : path, Recording, or sequence of them
        Files, folders of files, or recordings, each with sensor data and a reference. Others are skipped.
    filter : str
        Name of the filter.
    params : collection of str, optional
        What to seek: names, or ``name=LOW..HIGH`` with units; by default the few that matter most.
    fixed : Mapping, optional
        Parameters that keep a given value.
    metric : str
        Error that is to be small: "total", "heading" or "inclination", as `plumbob.evaluate` has them.
    group_by : str
        What is held out together: "recording", "folder" or "device".
    folds : int, optional
        Number of folds; by default one for each group.
    budget : int
        Evaluations for each search, about, over all its recordings.
    frame : Frame or str, optional
        Navigation frame where a recording names none.
    align : collection of str
        What is aligned before an error is measured, as `plumbob.evaluate` has it.
    settle : float or str
        Time at the start that is not judged, s.
    progress : callable, optional
        Called with the number of runs done, and of all that there will be, about.

    Returns
    -------
    Tuning

    Raises
    ------
    ParameterError
        If a setting is not known or out of range.
    DecodeError
        If no recording can be used.
    """
    check.one_of("metric", metric, METRICS)
    check.one_of("group_by", group_by, GROUPS)
    _require("budget", budget, 4)
    fixed, time = dict(fixed or {}), given("settle", settle, Quantity.TIME) or 0.0
    ranges = _ranges(filter, params, fixed)
    search = _Search(filter, metric, tuple(align), time, fixed, ranges, budget, progress)
    trials, skipped = _read(recordings, search, None if frame is None else Frame.parse(frame), group_by)
    folds_of = _deal(list(dict.fromkeys(trial.group for trial in trials)), folds)
    return _cross_validated(search, trials, folds_of, group_by=group_by, skipped=skipped)


class _TuningTrial:
    """A recording in memory, and the errors that are known of it, by place."""

    default: float

    def __init__(self, name: str, file: Path | Recording, frame: Frame | None) -> None:
        self.name = self.group = name
        self.imu, self.reference = read_trial(file)
        self.frame = navigation_frame(self.imu, frame, where=file.name)
        self.sha256 = file_sha256(file)[0] if isinstance(file, Path) and file.is_file() else None
        self.errors: dict[bytes, float] = {}


@dataclass
class _Search:
    """The search in the unit cube, on any of the recordings; what was run once is not run again."""

    filter: str
    metric: str
    align: tuple[str, ...]
    settle: float
    fixed: Mapping[str, Any]
    ranges: tuple[Range, ...]
    budget: int
    progress: Callable[[int, int], None] | None
    runs: int = 0
    most: int = 0

    def prepare(self, trial: _TuningTrial) -> None:
        """Measure the defaults; ShapeError where they cannot be scored."""
        trial.default = self._rmse(trial, {})

    def error(self, trial: _TuningTrial, x: Floats) -> float:
        """Rms error, rad, `WORST` where it cannot be scored."""
        values = {r.parameter.name: r.value_at(float(place)) for r, place in zip(self.ranges, x, strict=True)}
        try:
            return self._rmse(trial, values)
        except ShapeError:
            return WORST

    def _rmse(self, trial: _TuningTrial, values: Mapping[str, Any]) -> float:
        track = run_stage(trial.imu, Stage(self.filter, {**self.fixed, **values}), frame=trial.frame)
        scores = evaluate(track, trial.reference, align=self.align, settle=self.settle)
        if self.metric not in scores.stats:
            raise ShapeError(f"its {self.metric} error cannot be scored: {scores.not_scored[self.metric]}.")
        if not track.known.all():
            raise ShapeError("the filter with its defaults leaves attitudes that are not known.")
        return max(scores.stats[self.metric].rmse, LEAST)

    def logs(self, x: Floats, trials: Sequence[_TuningTrial]) -> Floats:
        """Logarithms of the errors (len(trials),) at a place."""
        key = x.tobytes()
        new = [trial for trial in trials if key not in trial.errors]
        for trial in new:
            trial.errors[key] = self.error(trial, x)
        self.runs += len(new)
        if self.progress is not None:
            self.progress(self.runs, max(self.runs, self.most))
        return np.log([trial.errors[key] for trial in trials])

    def best(self, trials: Sequence[_TuningTrial]) -> Floats:
        """Best place (d,) for these recordings: of DIRECT and the defaults, then refined from there."""
        from scipy.optimize import Bounds, direct, minimize

        def cost(x: Floats) -> float:
            return float(self.logs(x, trials).mean())

        default = [r.place(r.parameter.default) if _positive(r.parameter.default) else 0.0 for r in self.ranges]
        cube = Bounds(np.zeros(len(default)), np.ones(len(default)))
        coarse = direct(cost, cube, maxfun=round(GLOBAL * self.budget))
        start = min(coarse.x, np.array(default), key=cost)
        simplex = np.vstack([start, start + np.diag(np.where(start + STEP <= 1.0, STEP, -STEP))])
        remaining = max(1, self.budget - coarse.nfev)
        how: Any = {"maxfev": remaining, "initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-5}
        return np.asarray(minimize(cost, start, method="Nelder-Mead", bounds=cube, options=how).x)


def _cross_validated(
    search: _Search,
    trials: Sequence[_TuningTrial],
    folds_of: Mapping[str, int],
    *,
    group_by: str,
    skipped: Mapping[str, str],
) -> Tuning:
    """Fit to all; then, for each fold, fit to the others and judge it by its own."""
    count = len(set(folds_of.values())) if len(folds_of) > 1 else 0
    search.most = len(trials) * (1 + count) * (search.budget + 1)
    best = search.best(trials)
    fitted = to_deg(np.exp(search.logs(best, trials))).tolist()
    held_deg: dict[str, float] = {}
    places, train = [], list[tuple[float, float]]()
    for fold in range(1, count + 1):
        inside = [t for t in trials if folds_of[t.group] != fold]
        outside = [t for t in trials if folds_of[t.group] == fold]
        places.append(place := search.best(inside))
        train.append((np.log([t.default for t in inside]).mean(), search.logs(place, inside).mean()))
        held_deg |= zip((t.name for t in outside), to_deg(np.exp(search.logs(place, outside))).tolist(), strict=True)
    if not count:
        train.append((np.log([t.default for t in trials]).mean(), search.logs(best, trials).mean()))
    rows = tuple(
        Held(
            t.name,
            t.group,
            folds_of[t.group] if count else None,
            to_deg(t.default),
            held_deg.get(t.name),
            fit,
            t.sha256,
        )
        for t, fit in zip(trials, fitted, strict=True)
    )
    held_default, held_tuned, gain = _gain(rows) if count else (None, None, None)
    train_default, train_tuned = to_deg(np.exp(np.mean(train, axis=0))).tolist()
    return Tuning(
        search.filter, search.metric, group_by, search.fixed,
        tuple(_tuned(r, [float(x[i]) for x in (best, *places)]) for i, r in enumerate(search.ranges)),
        rows, count, train_default, train_tuned, held_default, held_tuned, gain,
        search.budget, search.runs, search.align, skipped,
    )  # fmt: skip


def _gain(rows: Sequence[Held]) -> tuple[float, float, tuple[float, float, float]]:
    """Held-out errors, degrees, and their change with its interval: pairs of groups, Student's t."""
    from scipy.stats import ttest_1samp

    logs = np.log([(row.default_deg, row.tuned_deg or row.default_deg) for row in rows])
    groups = np.array([row.group for row in rows])
    means = np.array([logs[groups == group].mean(axis=0) for group in dict.fromkeys(groups.tolist())])
    change = means[:, 1] - means[:, 0]
    low, high = ttest_1samp(change, 0.0).confidence_interval(0.95)
    default, tuned = np.exp(means.mean(axis=0)).tolist()
    return default, tuned, (math.expm1(change.mean()), math.expm1(low), math.expm1(high))


def _tuned(range_: Range, places: Sequence[float]) -> Tuned:
    """Of a parameter, from its places fitted to all recordings and in each fold."""
    p, x = range_.parameter, places[0]
    end = "low" if x < NEAR_END else "high" if x > 1.0 - NEAR_END else ""
    value, *folds = map(range_.value_at, places)
    default = math.nan if p.default is None else float(p.default)
    return Tuned(p.name, default, value, range_.low, range_.high, tuple(folds), end)


def _deal(groups: Sequence[str], folds: int | None) -> dict[str, int]:
    """Fold of each group, from 1, in turns."""
    if folds is None or len(groups) == 1:
        folds = len(groups)
    _require("folds", folds, min(2, len(groups)))
    if folds > len(groups):
        raise ParameterError(f"folds is {folds}, but there are only {len(groups)} to be held out.")
    return {group: i % folds + 1 for i, group in enumerate(groups)}


def _require(name: str, value: int, least: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise ParameterError(f"{name} must be a whole number of at least {least}, but got {value!r}.")


def _parameters(filter: str) -> dict[str, Parameter]:
    """Parameters of a filter, and those that every filter has."""
    return {p.name: p for p in (*describe(load(filter).Params), *describe(CommonParams))}


def _positive(value: Any) -> bool:
    return isinstance(value, float | int) and not isinstance(value, bool) and value > 0.0


def _ranges(filter: str, params: Collection[str] | None, fixed: Mapping[str, Any]) -> tuple[Range, ...]:
    """What is sought, and where."""
    declared = {p.name: p for p in describe(load(filter).Params) if not p.switch}
    if params is None:
        few = FEW.get(filter, tuple(name for name, p in declared.items() if _positive(p.default)))
        params = [name for name in few if name not in fixed]
    ranges: dict[str, Range] = {}
    for text in params.split(",") if isinstance(params, str) else params:
        name, equals, span = (part.strip() for part in text.partition("="))
        if name not in declared:
            names = ", ".join(declared) or "none"
            raise ParameterError(f"{filter} has no parameter '{name}' that could be tuned; it has {names}.")
        if name in ranges:
            raise ParameterError(f"{filter}: {name} is named twice.")
        if name in fixed:
            raise ParameterError(f"{filter}: {name} is both to be tuned and given a value. Leave one of them out.")
        ranges[name] = _range(filter, declared[name], span if equals else "")
    if not ranges:
        raise ParameterError(f"{filter} has no parameter to tune.")
    return tuple(ranges.values())


def _range(filter: str, p: Parameter, span: str) -> Range:
    """Range that is given as LOW..HIGH, or around the default."""
    if span:
        ends = span.split("..")
        if len(ends) != 2:
            raise ParameterError(f"{filter}: a range must be written as {p.name}=LOW..HIGH, but got '{span}'.")
        low, high = (checked(filter, p, end) for end in ends)
    elif _positive(p.default):
        low, high = max(p.spec.low, p.default / REACH), min(p.spec.high, p.default * REACH)
    else:
        raise ParameterError(
            f"{filter}: {p.name} is {shown(p, p.default)} by default, so that its range must be given: "
            f"{p.name}=LOW..HIGH, within {allowed(p)}."
        )
    if not (_positive(low) and _positive(high) and low < high):
        raise ParameterError(f"{filter}: the range of {p.name} must rise from above 0, but got '{span}'.")
    return Range(p, float(low), float(high))


def _read(
    recordings: str | Path | Recording | Sequence[str | Path | Recording],
    search: _Search,
    frame: Frame | None,
    group_by: str,
) -> tuple[list[_TuningTrial], dict[str, str]]:
    """Recordings that can be judged, each read once, and why others are skipped."""
    several = [recordings] if isinstance(recordings, str | Path | Recording) else list(recordings)
    trials: dict[str, _TuningTrial] = {}
    skipped: dict[str, str] = {}
    for source in several:
        for file in [source] if isinstance(source, Recording) else trials_in(check.path("recordings", source)):
            try:
                trial = _TuningTrial(unused_name(file.name, trials), file, frame)
                search.prepare(trial)
            except ParameterError:
                raise
            except (PlumbobError, OSError) as error:
                skipped[unused_name(file.name, skipped)] = str(error)
                continue
            if group_by == "device":
                trial.group = trial.imu.meta.device
            elif group_by == "folder" and isinstance(file, Path):
                trial.group = str(file.resolve().parent)
            trials[trial.name] = trial
    if not trials:
        why = "; ".join(f"{name}: {reason}" for name, reason in skipped.items())
        raise DecodeError(f"no recording with sensor data and a reference can be used. {why}".strip())
    return list(trials.values()), skipped


def _text(p: Parameter, value: float) -> str:
    """Value with three digits, as a table has it; a dash where there is none."""
    number, space, unit = shown(p, value).partition(" ")
    return "–" if math.isnan(value) else f"{float(number):.3g}{space}{unit}"


def _compared(name: str, before: float, after: float) -> list[str]:
    return [name, degrees(before), degrees(after), _percent(after / before - 1.0)]


def _percent(share: float) -> str:
    return f"{100.0 * share:+.1f} %"
