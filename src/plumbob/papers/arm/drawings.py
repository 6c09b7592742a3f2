"""Figures 3 to 9 of the paper from one run through bytes, and those that the paper has not."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.arm.array.monitoring import Monitored
from plumbob.core.check import Floats
from plumbob.core.units import to_deg, to_dps
from plumbob.data.array import ImuArray
from plumbob.papers.arm.misprints import Inference
from plumbob.papers.arm.simulated import AXES, errors_deg, statistics
from plumbob.papers.arm.tables import ANGLES, PAPER, RECOVERY_WORDS, Recovery
from plumbob.papers.description import ARM
from plumbob.reporting.content import Figure
from plumbob.reporting.style import MUTED, SERIES, SHADE, SOFT, Both
from plumbob.rotations import euler_zyx_from_quat

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

TIME: Final = "time [s]"
_BLUE, _GREEN, _AMBER = SERIES[0], SERIES[2], SERIES[4]


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


_NUMBERS: Final = {False: (3, 4, 5), True: (7, 8, 9)}


def errors(run: BytesRun, *, turns: bool) -> list[Figure]:
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
        ax.set_ylabel(ARM.text("text", word=word))
        words = (("std", "标准差"), ("range", "误差范围"), ("rms", "均方根"))
        rows = [(*word, value) for word, value in zip(words, figures, strict=True)]
        _margin_notes(ax, [*rows, ("std, paper", "论文标准差", printed[axis])])
    _time_axis(panels[-1], t)


def heading(run: BytesRun) -> Figure:
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


def recovery(found: Mapping[str, Recovery]) -> Figure:
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


def inference(read: Inference) -> Figure:
    """Correction over the error, by two ways to infer from one table."""
    return ARM.figure("correction_by_the", partial(_draw_inference, read))


def _draw_inference(read: Inference, canvas: "FigureBase") -> None:
    ax = canvas.subplots()
    ax.plot(read.e, read.product, color=_BLUE, linewidth=1.2)
    ax.plot(read.e, read.mamdani, color=SERIES[1], linewidth=1.2, linestyle="--")


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


def faults(runs: Sequence[Broken]) -> Figure:
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
        ax.set_ylabel(ARM.text("s", run_what=run.what))
    _time_axis(panels[-1], runs[-1].seen.imu.t)


def _time_axis(ax: "Axes", t: Floats) -> None:
    ax.set_xlim(float(t[0]), float(np.ceil(t[-1])))
    ax.set_xlabel(TIME)


def _margin_notes(ax: "Axes", figures: Sequence[tuple[str, str, float]]) -> None:
    for line, (en, zh, value) in enumerate(figures):
        ax.text(
            1.015,
            0.95 - 0.22 * line,
            ARM.text("text_2", en=en, value=value, zh=zh),
            transform=ax.transAxes,
            va="top",
            color=MUTED,
        )
