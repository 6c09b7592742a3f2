"""The paper's page: its scheme, misprints, tables and figures in its order, and what goes beyond."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.arm.array.monitoring import Monitored
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import to_deg, to_dps
from plumbob.data.array import ImuArray
from plumbob.papers.arm import faults, misprints, tables, teaching
from plumbob.papers.arm.misprints import Inference
from plumbob.papers.arm.simulated import AXES, MOUNTS, Over, assumed_noise, errors_deg, statistics
from plumbob.papers.arm.tables import ANGLES, PAPER, RECOVERY_WORDS, WORDS, Recovery
from plumbob.papers.description import ARM
from plumbob.papers.outcome import Outcome, PrintedForm
from plumbob.reporting.content import Figure
from plumbob.reporting.report import Report
from plumbob.reporting.style import MUTED, SERIES, SHADE, SOFT, Both
from plumbob.rotations import euler_zyx_from_quat

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase


class BytesRun(NamedTuple):
    """One run through bytes.

    `t` (N,): s; `truth` (N, 4): attitude of the body in NED; `tracks` (N, 4): attitude by each scheme, and "six" by
    Plumbob's filter.
    """

    t: Floats
    truth: Floats
    tracks: Mapping[str, Floats]

    def errors(self, name: str) -> Floats:
        """Errors (N, 3), deg."""
        return errors_deg(self.tracks[name], self.truth)


class Broken(NamedTuple):
    """A run in which a unit's gyroscope x breaks.

    `array`: with the fault; `seen`: what the monitor says; `unit`: the broken one; `since`, `until`: when, s;
    `what`: of its panel.
    """

    array: ImuArray
    seen: Monitored
    unit: str
    since: float
    until: float
    what: Both


@dataclass(frozen=True, slots=True)
class Findings:
    """Everything that was computed.

    Attributes
    ----------
    runs : mapping of bool to BytesRun
        Through bytes, at rest and in the turn.
    rest, turn, fast : mapping of str to Over
        Statistics of each scheme over seeds: at rest, in the turn, and in the turn at 100 Hz.
    printed, read, stated
        Of `plumbob.papers.arm.misprints`: wrong forms, both inferences, and the stated noise.
    recoveries, designs
        Of `plumbob.papers.arm.tables`.
    watched, parity, every
        Of `plumbob.papers.arm.faults`: arrays to draw, the test of a pair, and every fault.
    done : Taught
        The teach-in.
    few, seeds, broken : int
        How many seeds: beside the tables, of the tables, and of the fault with bars.
    """

    runs: Mapping[bool, BytesRun]
    rest: Mapping[str, Over]
    turn: Mapping[str, Over]
    fast: Mapping[str, Over]
    printed: Mapping[str, PrintedForm]
    read: misprints.Inference
    stated: Sequence[Outcome]
    recoveries: Mapping[str, tables.Recovery]
    designs: Sequence[tuple[float, float, Over, float]]
    watched: Sequence[Broken]
    parity: Mapping[float, faults.Parity]
    every: Sequence[tuple[bool, str, str, faults.Watched]]
    done: teaching.Taught
    few: int
    seeds: int
    broken: int


def report(whole: Findings, seed: int) -> Report:
    """The page of the paper; `seed` is that of its runs through bytes."""
    return ARM.part(
        "page",
        whole=whole,
        noise_fact=ARM.text("assumed_of_a_sample", rest=_noise(False), turn=_noise(True)),
        seed=seed,
        parts=[
            _scheme(),
            _misprints(whole),
            _case(whole, turns=False),
            _case(whole, turns=True),
            _source(whole),
            _hundred(whole),
            _breaks(whole),
            teaching.part(whole.done),
        ],
    )


def _noise(turns: bool) -> str:
    noise = assumed_noise(turns)
    gyr, bias = to_deg(noise.gyr), to_deg(noise.bias)
    return f"{gyr:.2g} °/s, ±{bias:.2g} °/s, {noise.acc / G0:.2g} g, {noise.mag:g} µT"


def _scheme() -> Report:
    """Figures 1 and 2."""
    mounting = [
        (name, f"{'+−'[k > 2]}{'xyz'[k % 3]}", " ".join(f"{v:g}" for v in mount.q_bs))
        for k, (name, mount) in enumerate(MOUNTS.items())
    ]
    return ARM.part("scheme", tables=[ARM.table("figure_1_parts"), ARM.table("figure_2_mounting", mounting)])


def _misprints(study: Findings) -> Report:
    rows = [(row.what, f"{row.paper:g}", f"{row.faithful:.2g}", row.reason or "") for row in study.stated]
    return ARM.part(
        "misprints",
        read=study.read,
        tables=[ARM.table("printed_forms_computed", forms=study.printed), ARM.table("table_1_with", rows)],
        figures=[ARM.figure("correction_by_the", partial(_draw_inference, study.read))],
    )


def _three(values: Sequence[float] | Floats) -> str:
    return "/".join(f"{value:.3f}" for value in values)


def _case(study: Findings, *, turns: bool) -> Report:
    """Table 1 or 2 with its figures."""
    stats, run = (study.turn, study.runs[True]) if turns else (study.rest, study.runs[False])
    rows = [
        [
            WORDS.get(name, _COMMON),
            _three(PAPER[turns][name]) if name in PAPER[turns] else "-",
            *(_three(values) for values in (over.std, over.standard_error, over.range, over.rms)),
        ]
        for name, over in stats.items()
    ]
    return ARM.part(
        "turn" if turns else "rest",
        tables=[ARM.table("table_attitude_errors", rows, turns=1 + turns, seeds=study.seeds)],
        figures=[*([heading_figure(run)] if turns else []), *errors_figure(run, turns=turns)],
        std=stats["none"].std.mean(),
        rms=stats["none"].rms.mean(),
        ratio=(stats["fuzzy"].std / stats["pi, common start"].std).max(),
    )


_COMMON: Final = ARM.text("pi_that_starts_from")


def _source(study: Findings) -> Report:
    """Control, recovery and design."""
    starts = [
        (
            tables.RECOVERY_WORDS[name],
            *(_time(tables.recovery(scheme, angles).time) for _, angles in tables.STARTS.values()),
        )
        for name, scheme in tables.RECOVERIES.items()
    ]
    head = (ARM.text("time_to_below_0"), *(words for words, _ in tables.STARTS.values()))
    rows = [(f"{c:g}", f"{far:g}", _three(over.std), f"{time:.1f}") for c, far, over, time in study.designs]
    return ARM.part(
        "source",
        tables=[ARM.table("recovery_from_a", starts, head=head), ARM.table("design_of_the", rows, few=study.few)],
        figures=[recovery_figure(study.recoveries)],
    )


def _time(value: float) -> str:
    return f"{value:.1f}" if np.isfinite(value) else "> 120"


def _hundred(study: Findings) -> Report:
    rows = [
        (WORDS[name], _three(study.turn[name].std), _three(over.std))
        for name, over in study.fast.items()
        if name in WORDS
    ]
    return ARM.part("hundred", tables=[ARM.table("turn_seeds_at", rows, few=study.few)])


_TRIADS: Final = ARM.texts("triads")
_KINDS: Final = dict(
    zip(
        faults.KINDS,
        (
            ARM.text("frozen"),
            ARM.text("biased"),
            ARM.text("scaled_by_3"),
            ARM.text("noisy_10"),
            ARM.text("swapped_axes"),
            ARM.text("dead"),
        ),
        strict=True,
    )
)


def _breaks(study: Findings) -> Report:
    cells: dict[tuple[str, str], list[str]] = {}
    for _, triad, kind, stats in study.every:
        share = stats.detected * stats.isolated / 100.0
        cells.setdefault((triad, kind), []).extend([f"{share:.0f}", f"{stats.median:.1f}" if share else "-"])
    rows = [
        (ARM.text("triad_and_kind", triad=_TRIADS[triad], kind=_KINDS[kind]), *values)
        for (triad, kind), values in cells.items()
    ]
    parity = [
        (f"{step:g}", f"{row.found}", f"{row.median:.1f}" if row.found else "-") for step, row in study.parity.items()
    ]
    return ARM.part(
        "breaks",
        tables=[ARM.table("test_of_the", parity), ARM.table("every_fault_of", rows)],
        figures=[faults_figure(study.watched)],
    )


TIME: Final = "time [s]"
_BLUE, _GREEN, _AMBER = SERIES[0], SERIES[2], SERIES[4]


_NUMBERS: Final = {False: (3, 4, 5), True: (7, 8, 9)}


def errors_figure(run: BytesRun, *, turns: bool) -> list[Figure]:
    """Figures 3 to 5, or 7 to 9: errors over time, within the band of ± the paper's standard deviation."""
    how, made = ARM.texts("how")["turn" if turns else "rest"], []
    for number, (name, what) in zip(_NUMBERS[turns], ARM.texts("what").items(), strict=True):
        draw = partial(_draw_errors, run.t, run.errors(name), run.errors("six"), PAPER[turns][name])
        made.append(ARM.figure("errors", draw, number=number, how=how, what=what))
    return made


def _draw_errors(t: Floats, faithful: Floats, best: Floats, printed: Sequence[float], canvas: "FigureBase") -> None:
    panels = canvas.subplots(3, 1, sharex=True)
    limit = 1.08 * max(float(np.abs(faithful).max()), float(np.abs(best).max()), *printed)
    for axis, (ax, figures) in enumerate(zip(panels, statistics(faithful).T.tolist(), strict=True)):
        ax.axhspan(-printed[axis], printed[axis], color=SHADE, linewidth=0)
        ax.axhline(0.0, color=MUTED, linewidth=0.5)
        ax.plot(t, faithful[:, axis], color=_BLUE, linewidth=0.8)
        ax.plot(t, best[:, axis], color=_GREEN, linewidth=0.8)
        ax.set_ylim(-limit, limit)
        word = ANGLES[AXES[axis]]
        ax.set_ylabel(ARM.text("angle_in_degrees", word=word))
        words = (("std", "标准差"), ("range", "误差范围"), ("rms", "均方根"))
        rows = [(*word, value) for word, value in zip(words, figures, strict=True)]
        _margin_notes(ax, [*rows, ("std, paper", "论文标准差", printed[axis])])
    _time_axis(panels[-1], t)


def heading_figure(run: BytesRun) -> Figure:
    """Figure 6: the heading in the turn."""
    yaw = [_yaw(q_nb) for q_nb in (run.truth, run.tracks["fuzzy"], run.tracks["six"])]
    return ARM.figure("figure_6", partial(_draw_heading, run.t, yaw))


def _yaw(q_nb: Floats) -> Floats:
    return np.asarray(to_deg(np.unwrap(euler_zyx_from_quat(q_nb)[:, 0])))


def _draw_heading(t: Floats, yaw: Sequence[Floats], canvas: "FigureBase") -> None:
    """The whole, and what it is away from the truth."""
    ax, away = canvas.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    for angle, colour, width, dash in zip(yaw, (_AMBER, _BLUE, _GREEN), (2.8, 0.9, 0.9), ("-", "-", "--"), strict=True):
        ax.plot(t, angle, color=colour, linewidth=width, linestyle=dash)
        away.plot(t, angle - yaw[0], color=colour, linewidth=width, linestyle=dash)
    ax.set_yticks((-90, -60, -30, 0))
    _time_axis(away, t)


def recovery_figure(found: Mapping[str, Recovery]) -> Figure:
    """Error over time after a start that is wrong by 10° of yaw."""
    names = list(found)
    key = [(RECOVERY_WORDS[name], SERIES[k], "solid") for k, name in enumerate(names)]
    return ARM.figure("recovery_from_10", partial(_draw_recovery, list(found.values())), lines=key)


def _draw_recovery(recoveries: Sequence[Recovery], canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    for k, run in enumerate(recoveries):
        ax.semilogy(run.t, np.maximum(run.error_deg, 1e-3), color=SERIES[k], linewidth=1.1)
    ax.axhline(0.5, color=MUTED, linewidth=0.8, linestyle="--")
    ax.set_yticks((0.01, 0.1, 1.0, 10.0), labels=("0.01", "0.1", "1", "10"))


def _draw_inference(read: Inference, canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    ax.plot(read.e, read.product, color=_BLUE, linewidth=1.2)
    ax.plot(read.e, read.mamdani, color=SERIES[1], linewidth=1.2, linestyle="--")


def faults_figure(runs: Sequence[Broken]) -> Figure:
    """What a broken gyroscope reads beyond the rest, and when it is left out."""
    return ARM.figure("fault_of_0", partial(_draw_faults, runs), height=1.4 * len(runs) + 0.4)


def _draw_faults(runs: Sequence[Broken], canvas: "FigureBase") -> None:
    panels = canvas.subplots(len(runs), 1, sharex=True, squeeze=False)[:, 0]
    for ax, run in zip(panels, runs, strict=True):
        t, unit = run.seen.imu.t, run.array.units[run.unit]
        dcm = run.array.mounts[run.unit].dcm
        assert unit.gyr is not None
        assert run.seen.imu.gyr is not None
        away = to_dps(unit.gyr[:, 0] - (run.seen.imu.gyr @ dcm)[:, 0])
        size = max(1, round(1.0 / float(np.median(np.diff(t)))))
        mean = np.convolve(away, np.ones(size) / size)[: t.size]
        out = run.seen.excluded("gyr")[:, run.seen.names.index(run.unit)]
        ax.fill_between(
            t, 0.0, 1.0, where=out, color=SHADE, linewidth=0, step="post", transform=ax.get_xaxis_transform()
        )
        ax.plot(t, away, color=SOFT, linewidth=0.4)
        ax.plot(t, mean, color=_BLUE, linewidth=1.0)
        for when in (run.since, run.until):
            ax.axvline(when, color=SERIES[1], linewidth=1.0, linestyle="--")
        ax.set_ylim(-0.7, 0.9)
        ax.set_ylabel(ARM.text("broken_rate", run_what=run.what))
    _time_axis(panels[-1], runs[-1].seen.imu.t)


def _time_axis(ax: "Axes", t: Floats) -> None:
    ax.set_xlim(float(t[0]), float(np.ceil(t[-1])))
    ax.set_xlabel(TIME)


def _margin_notes(ax: "Axes", figures: Sequence[tuple[str, str, float]]) -> None:
    for line, (en, zh, value) in enumerate(figures):
        ax.text(
            1.015,
            0.95 - 0.22 * line,
            ARM.text("margin_note", en=en, value=value, zh=zh),
            transform=ax.transAxes,
            va="top",
            color=MUTED,
        )
