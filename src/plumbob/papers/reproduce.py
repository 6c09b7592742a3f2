"""The papers' runs, one or all: `plumbob reproduce`, and `plumbob.reproduce`."""

import json
import os
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from threading import Event, Lock
from typing import Any, Final

from plumbob.core import check
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import write_text
from plumbob.core.series import needed
from plumbob.core.text import counted
from plumbob.core.version import __version__
from plumbob.papers.outcome import CANNOT, HEAD, MISSED, PASS, SHOWN, Outcome, Paper, PaperItem, restored, table
from plumbob.papers.workspace import Work
from plumbob.reporting.content import Table
from plumbob.reporting.page import part_links
from plumbob.reporting.report import Report
from plumbob.reporting.style import LANGUAGES, Both

TITLES: Final[Mapping[str, Both]] = {
    "fin": Both(
        "Bionic fin: attitude and Allan error analysis (Ou 2017)", "仿生鳍条姿态测量及其误差分析（欧世星 2017）"
    ),
    "buoy": Both(
        "Drifting buoy: attitude of a sea-going unit (Yu 2018)", "海洋漂流浮标运动姿态测量系统（余博嵩 2018）"
    ),
    "trackball": Both("Trackball: drift of a gyroscope (Chen 2013)", "基于卡尔曼滤波的陀螺仪漂移补偿（陈晨 2013）"),
    "arm": Both("Teaching arm: six units (Huang and Jiang)", "示教机械臂多传感器姿态解算（黄洋、姜文刚）"),
    "rod": Both("Farm machine's rod: ADIS16355 (Li 2012)", "ADIS16355 在姿态测量中的应用（黎永键 2012）"),
}
NAMES: Final = tuple(TITLES)
"""Papers by the names of their rigs."""
STEP: Final = "step"
"""First word of a line by which a paper's process says how far it is."""
FOUND: Final = "found"
"""First word of the line by which it says what it found."""
_KILLED: Final = 9
_LONGEST: Final = ("arm", "buoy", "fin", "rod", "trackball")  # side by side, those that take long begin

_ABOUT: Final = Both("about", "内容")
DEFINITIONS: Final = (
    Both("Paper: as printed. Faithful: by the paper's method, its misprints corrected. Best: by the method that "
         "Plumbob recommends. In brackets: the bar that must be kept.",
         "论文：原文数值。按论文：改正印刷错误后按论文方法所得。最佳：Plumbob 推荐方法所得。括号内为须满足的限值。"),
    Both("Pass: every bar is kept. Shown: without a bar. Not reproducible: the paper's method cannot give what the "
         "paper prints.",
         "通过：满足全部限值。仅列出：无限值。无法复现：按论文方法不能得到原文数值。"),
)  # fmt: skip
"""What the words of the tables of outcomes mean."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What the papers' runs gave.

    Attributes
    ----------
    seed : int
        Of everything that was left to chance.
    outcomes : mapping of str to sequence of Outcome
        Every figure of each paper.
    folder : Path
        Where the pages and all files are.
    """

    seed: int
    outcomes: Mapping[str, Sequence[Outcome]]
    folder: Path

    @property
    def met(self) -> bool:
        """Whether every bar is met."""
        return all(outcome.met for paper in self.outcomes.values() for outcome in paper)

    def report(self) -> Report:
        """All outcomes, a part for each paper."""
        parts = [Report(TITLES[name], tables=[table(outcomes)]) for name, outcomes in self.outcomes.items()]
        facts = [("made by", f"plumbob {__version__}"), (Both("seed", "随机种子"), f"{self.seed}")]
        facts.append((Both("outcomes", "指标"), self._counts()))
        return Report(Both("Five papers, reproduced", "五篇论文的复现"), facts=facts, parts=parts, remarks=DEFINITIONS)

    def index(self) -> Report:
        """What `index.html` has: counts, then the main figures of each paper, all of them folded away."""
        names = Both("paper", "论文"), Both("figures", "指标"), PASS, SHOWN, CANNOT, MISSED
        rows = [[TITLES[name], *map(str, counts(outcomes))] for name, outcomes in self.outcomes.items()]
        parts = [
            Report(TITLES[name], facts=[(_ABOUT, ABOUT[name])], tables=_first_tables(name, outcomes))
            for name, outcomes in self.outcomes.items()
        ]
        links = [(TITLES[name], f"{name}.html") for name in self.outcomes]
        counted_up = Table("", names, rows)
        return replace(
            self.report(), tables=[counted_up], parts=parts, links=links, remarks=(), definitions=DEFINITIONS
        )

    def text(self) -> str:
        """Every table, for a terminal."""
        return self.report().text()

    def summary(self) -> dict[str, Any]:
        """What JSON has of it."""
        papers = {name: [outcome.summary() for outcome in outcomes] for name, outcomes in self.outcomes.items()}
        return {"seed": self.seed, "version": __version__, "met": self.met, "papers": papers}

    def _counts(self) -> Both:
        return _counted([outcome for outcomes in self.outcomes.values() for outcome in outcomes])


def _counted(outcomes: Sequence[Outcome]) -> Both:
    every, _, _, cannot, missed = counts(outcomes)
    return Both(
        f"{counted(every, 'figure')}: {missed} missed, {cannot} not reproducible by the paper's method",
        f"共 {every} 项：{missed} 项未达标，{cannot} 项按论文方法无法复现",
    )


def _first_tables(name: str, outcomes: Sequence[Outcome]) -> list[Table]:
    """Main figures, what cannot be had, and all figures, which a page folds away."""
    why = not_had(outcomes)
    title = Both(f"All {len(outcomes)} figures with their bars", f"全部 {len(outcomes)} 项指标及限值")
    every = replace(table(outcomes, title), detail="all")
    return [main_figures(name, outcomes), *([why] if why else []), every]


def reproduce(
    *papers: str,
    seed: int = 1,
    out: str | Path = "reproduced",
    lang: str = "en",
    jobs: int = 2,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Reproduction:
    """Run papers whole, from emulated bytes to their tables and figures, and write a page for each.

    Parameters
    ----------
    *papers : str
        Some of `NAMES`; none, or ``"all"``: all five.
    seed : int
        Of everything that is left to chance; the same seed gives the same bits on the same machine.
    out : path
        Folder, made where it is not there: ``index.html``, ``outcomes.json``, a page for each paper, and a folder with
        its bytes, sessions, recordings and cards.
    lang : {"en", "zh"}
        Language of the pages.
    jobs : int
        How many papers run side by side, each in a process of its own.
    overwrite : bool
        Whether files in `out` may be replaced.
    progress : callable, optional
        Called with a paper and what it does, how many steps are done, and of how many.

    Returns
    -------
    Reproduction

    Raises
    ------
    ParameterError
        If a paper is unknown, a number outside its domain, or the folder is not empty and `overwrite` is false.
    MissingExtraError
        If matplotlib, which draws the pages' figures, is not installed.
    """
    chosen = _chosen(papers)
    check.one_of("lang", lang, LANGUAGES)
    for named, value, least in (("jobs", jobs, 1), ("seed", seed, 0)):
        if not isinstance(value, int) or isinstance(value, bool) or value < least:
            raise ParameterError(f"{named} must be a whole number of at least {least}, but it is {check.said(value)}.")
    needed("matplotlib.figure", "the pages' figures", "plumbob[plot]")  # now, not after minutes
    folder = _folder(check.path("out", out), overwrite=overwrite)
    if len(chosen) == 1:
        outcomes = {chosen[0]: run_paper(chosen[0], folder, seed, lang, progress)}
    else:
        outcomes = _side_by_side(chosen, folder, seed, lang, jobs, progress)
    reproduction = Reproduction(seed, outcomes, folder)
    reproduction.index().write_html(folder / "index.html", lang=lang, overwrite=True)
    write_text(folder / "outcomes.json", json.dumps(reproduction.summary(), indent=1) + "\n", overwrite=True)
    return reproduction


def items(paper: str) -> Sequence[PaperItem]:
    """Everything that a paper describes, states or shows, and where it is done."""
    paper_items: Sequence[PaperItem] = import_module(f"plumbob.papers.{paper}").ITEMS
    return paper_items


def _chosen(papers: Sequence[str]) -> list[str]:
    if unknown := [name for name in papers if name not in (*NAMES, "all")]:
        raise ParameterError(f"'{unknown[0]}' is not a paper; known are {', '.join(NAMES)}, or all.")
    return list(NAMES) if not papers or "all" in papers else [name for name in NAMES if name in papers]


def _folder(folder: Path, *, overwrite: bool) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        filled = any(folder.iterdir())
    except OSError as error:
        raise DecodeError(f"{folder} cannot be the folder of the pages: {error.strerror}.") from error
    if filled and not overwrite:
        raise ParameterError(
            f"{folder} is not empty; name another folder, or allow its files to be replaced (--force)."
        )
    return folder


def run_paper(name: str, folder: Path, seed: int, lang: str, progress: Progress | None) -> Sequence[Outcome]:
    """Run a paper in this process, and write its page and its outcomes."""
    subfolder = folder / name
    subfolder.mkdir(exist_ok=True)

    def on_step(what: str, done: int, of: int) -> None:
        if progress is not None:
            progress(f"{name}: {what}", done, of)

    paper: Paper = import_module(f"plumbob.papers.{name}").run(Work(subfolder, seed, on_step))
    report = paper.report
    page = replace(
        report,
        facts=[(_ABOUT, ABOUT[name]), (Both("outcomes", "指标"), _counted(paper.outcomes)), *report.facts],
        tables=[*_first_tables(name, paper.outcomes), *report.tables],
        links=[(Both("all papers", "全部论文"), "index.html"), *report.links, *part_links(report)],
        definitions=[*DEFINITIONS, *report.definitions],
    )
    page.write_html(folder / f"{name}.html", lang=lang, overwrite=True)
    return paper.outcomes


def _side_by_side(
    names: Sequence[str], folder: Path, seed: int, lang: str, jobs: int, progress: Progress | None
) -> dict[str, Sequence[Outcome]]:
    """Run each paper in a process of its own; the first that fails ends all with its error."""
    running: list[subprocess.Popen[str]] = []
    starting, ending = Lock(), Event()

    def run(name: str) -> Sequence[Outcome]:
        with starting:  # a process that starts while all are ended would be left alone
            if ending.is_set():
                return ()
            process = _alone(name, f"{folder}", f"{seed}", lang)
            running.append(process)
        return _listen(name, process, progress)

    with ThreadPoolExecutor(jobs) as pool:
        futures = {name: pool.submit(run, name) for name in sorted(names, key=_LONGEST.index)}
        try:
            for future in as_completed(futures.values()):
                future.result()
        except BaseException:
            ending.set()
            with starting:
                for process in running:
                    process.kill()
                    process.wait()
            raise
    return {name: futures[name].result() for name in names}


def _alone(*words: str) -> subprocess.Popen[str]:
    """Start a paper's process: with the modules of this one, whatever lies in the folder where it is started."""
    paths = os.pathsep.join(path or f"{Path.cwd()}" for path in sys.path)
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "plumbob.papers.standalone", *words],
        env={**os.environ, "PYTHONPATH": paths, "PYTHONIOENCODING": "utf-8"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        encoding="utf-8",
    )


def _listen(name: str, process: subprocess.Popen[str], progress: Progress | None) -> Sequence[Outcome]:
    """Hear a paper's process to its end: how far it is, what it found, or why it ended."""
    outcomes: list[Outcome] = []
    last: deque[str] = deque(maxlen=5)
    assert process.stderr is not None
    with process.stderr as lines:
        for line in lines:
            word, *args = line.rstrip("\n").split("\t")
            if word == FOUND:
                outcomes = [restored(stored) for stored in json.loads(args[0])]
            elif word != STEP:
                last.append(line)
            elif progress is not None:
                progress(args[0], int(args[1]), int(args[2]))
    if code := process.wait():
        how = f"was ended by signal {-code}" if code < 0 else f"ended with exit code {code}"
        how += ", as a system does that is short of memory; try one job" if -code == _KILLED else ""
        raise DecodeError(f"{name} {how}: {''.join(last).strip()}" if last else f"{name} {how}.")
    return outcomes


ABOUT: Final[Mapping[str, Both]] = {
    "fin": Both(
        "Three MEMS gyroscopes on a bionic fin give its yaw, pitch and roll in real time, and Allan variance gives "
        "their noise coefficients, Table 1. Both are done here, from emulated bytes of the same sensors.",
        "仿生鳍条上的三轴 MEMS 陀螺仪实时给出航向、俯仰、横滚角，并由 Allan 方差得到噪声系数（表 1）。"
        "本页由同型传感器的仿真字节流完成两者。",
    ),
    "buoy": Both(
        "The attitude unit of a drifting buoy: ellipsoid calibration, a PI filter with a gate, static test and slide. "
        "All are done here, from emulated bytes of the same sensors and of their firmware, and at sea besides.",
        "海洋漂流浮标的姿态模块：椭球拟合校准、带阀值的 PI 互补滤波、静态测试与滑动测试。"
        "本页由同型传感器及固件的仿真字节流完成全部内容，并增加海上试验。",
    ),
    "trackball": Both(
        "A drift model and a Kalman filter of one state for the rates of a trackball's gyroscope: at rest, by Allan "
        "variance, and on a turntable. All are done here, from emulated bytes of the same sensor.",
        "轨迹球陀螺仪的漂移模型与单状态卡尔曼滤波：静止、Allan 方差与转台试验。"
        "本页由同型传感器的仿真字节流完成全部内容。",
    ),
    "arm": Both(
        "Six units on a teaching arm, fuzzy-PI and a Kalman filter: attitude errors at rest, Table 1, and in a turn, "
        "Table 2. Both are done here, from emulated bytes, with noise that fits the first rows of the tables.",
        "示教机械臂上的六个传感器单元、模糊 PI 与卡尔曼滤波：静止（表 1）与转动（表 2）时的姿态误差。"
        "本页由仿真字节流完成两者，噪声按表中首行假设。",
    ),
    "rod": Both(
        "An ADIS16355 on a rod moved by hand, beside an AHRS500GA: accelerometer alone, gyroscope alone, and both "
        "fused by a Kalman filter, Figure 6. All are done here, from emulated bytes of both devices.",
        "手持杆上的 ADIS16355 与 AHRS500GA 对比：单独加速度计、单独陀螺仪及卡尔曼滤波融合（图 6）。"
        "本页由两种器件的仿真字节流完成全部内容。",
    ),
}
"""A paper in two sentences."""

MAIN: Final[Mapping[str, Sequence[str]]] = {
    "fin": (
        *(f"table1.{term}.{axis}" for term in "QNB" for axis in ("290x", "290y", "453z")), "eq7", "swim.yaw",
    ),
    "buoy": (
        "static.after.yaw", "static.after.pitch", "static.after.roll", "slide.open.roll", "slide.open.pitch",
        "slide.gated.roll", "slide.gated.pitch", "slide.reduction.roll", "slide.reduction.pitch", "claim",
    ),
    "trackball": (
        "drift.k_t", "rest.after", "allan.ratio.0.1", "allan.ratio.1", "allan.ratio.10", "allan.ratio.50", "ramp.rms",
        "hold.rms",
    ),
    "arm": tuple(
        f"{test}.{way}.{angle}" for test in ("static", "turn") for way in ("none", "pi", "fuzzy")
        for angle in ("roll", "pitch", "yaw")
    ),
    "rod": (
        "accel.early", "accel.late", "gyro.largest", "fused.kept", "fused.worst", "bytes.ahrs.roll",
        "bytes.ahrs.pitch", "drift.ratio",
    ),
}  # fmt: skip
"""Keys of the outcomes by which a paper is known."""


def main_figures(name: str, outcomes: Sequence[Outcome]) -> Table:
    """Table of a paper's main outcomes, with a word for each verdict."""
    by_key = {outcome.key: outcome for outcome in outcomes}
    rows = [[*by_key[key].row()[:-1], by_key[key].word] for key in MAIN[name] if key in by_key]
    return Table(Both("Main figures", "主要指标"), HEAD, rows, words=(1, 2, 6))


def not_had(outcomes: Sequence[Outcome]) -> Table | None:
    """Table of what is missed or cannot be reproduced, a row for each reason; None where there is nothing."""
    why: dict[Both, list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.reason is not None and not (outcome.met and outcome.reproducible):
            why.setdefault(outcome.reason, []).append(outcome)
    rows = []
    for reason, group in why.items():
        first, more = group[0], len(group) - 1
        what = Both(f"{first.what}, and {more} more", f"{first.what.zh}，另 {more} 项") if more else first.what
        rows.append([first.where or "-", what, first.word, reason])
    head = (HEAD[0], HEAD[1], HEAD[6], Both("why", "原因"))
    title = Both("What cannot be had as the paper prints it, and why", "无法按论文原样复现的内容及原因")
    return Table(title, head, rows, words=(1, 2, 3)) if rows else None


def counts(outcomes: Sequence[Outcome]) -> Sequence[int]:
    """Of all outcomes: how many pass, are shown without a bar, are not reproducible, and are missed."""
    words = [outcome.word for outcome in outcomes]
    return [len(words), *(words.count(word) for word in (PASS, SHOWN, CANNOT, MISSED))]
