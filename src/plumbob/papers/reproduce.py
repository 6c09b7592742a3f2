"""The papers' runs, one or all: `plumbob reproduce NAME`, and `plumbob.reproduce`."""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from plumbob.core import __version__, check
from plumbob.core.errors import DecodeError, ParameterError, unknown_name
from plumbob.core.files import write_text
from plumbob.core.series import needed
from plumbob.core.text import counted
from plumbob.fleet.workers import processes
from plumbob.papers.description import HEAD, MISSED, NO, NOT_STATED, PAPERS, YES, Outcome, shown, table
from plumbob.papers.studies import Study
from plumbob.reporting.content import LANGUAGES, Both, Table
from plumbob.reporting.page import part_links
from plumbob.reporting.report import Report

NAMES: Final = tuple(PAPERS)  # papers by the names of their rigs
STEP: Final = "step.txt"  # what a paper does, and how many steps of how many are done, while it runs
OUTCOMES: Final = "outcomes.json"
_LONGEST: Final = ("arm", "buoy", "fin", "rod", "trackball")  # side by side, those that take long begin

_RUN: Final = Both("Run", "运行条件")
_COUNTS: Final = Both("outcomes", "指标")
_ABOUT, _COMMAND, _MADE = Both("about", "内容"), Both("command", "命令"), Both("made", "生成")
DEFINITIONS: Final = (
    Both("Paper: as printed. Its method: by the paper's method, its misprints corrected. Ours: by the method that "
         "Plumbob recommends. In brackets: the bar that must be kept; ±: twice the standard error of a mean, which is "
         "allowed.",
         "论文：原文数值。按论文：改正印刷错误后按论文方法所得。本系统：Plumbob 推荐方法所得。括号内为须满足的限值；"
         "± 为均值的两倍标准误差，允许在内。"),
    Both("Reached: whether the paper's own method gives the printed figure here; not stated where it prints none. "
         "Bar: whether our own limits are kept. With: units and runs that the figure is of.",
         "达到论文值：按论文方法能否得到原文数值；原文无数值者为未给出。限值：是否满足自设限值。条件：所用单元与次数。"),
)  # fmt: skip
"""What the words of the tables of outcomes mean."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What the papers' runs gave.

    `seed`: of everything that was left to chance; `outcomes`: every figure of each paper; `folder`: where the pages and
    all files are.
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
        parts = [Report(PAPERS[name].title, tables=[table(outcomes)]) for name, outcomes in self.outcomes.items()]
        every = [outcome for paper in self.outcomes.values() for outcome in paper]
        facts = [("made by", f"plumbob {__version__}"), (Both("seed", "随机种子"), f"{self.seed}"),
                 (_COUNTS, _counted(every)), (Both("folder", "文件夹"), f"{self.folder}")]  # fmt: skip
        return Report(Both("Five papers, run again", "五篇论文的再运行"), facts=facts, parts=parts, remarks=DEFINITIONS)

    def index(self, lang: str = "en") -> Report:
        """What `index.html` has: counts, and of each paper a figure and three numbers."""
        names = Both("paper", "论文"), Both("figures", "指标"), YES, NO, NOT_STATED, MISSED
        rows = [[name, *map(str, counts(outcomes))] for name, outcomes in self.outcomes.items()]
        links = [(PAPERS[name].title, page_name(name, lang)) for name in self.outcomes]
        parts = [self._card(name, outcomes) for name, outcomes in self.outcomes.items()]
        return replace(
            self.report(), tables=[Table("", names, rows)], parts=parts, links=links, remarks=(),
            definitions=DEFINITIONS,
        )  # fmt: skip

    def _card(self, name: str, outcomes: Sequence[Outcome]) -> Report:
        study, by_key, paper = restored(self.folder, name), {o.key: o for o in outcomes}, PAPERS[name].content["paper"]
        facts = [(_ABOUT, PAPERS[name].about), (_COUNTS, _counted(outcomes)), (_MADE, study.made)]
        rows = [by_key[key].row()[:1] + by_key[key].row()[2:8] for key in paper["front"]]
        numbers = Table("", HEAD[:1] + HEAD[2:8], rows, words=(1, 5, 6))
        return Report(PAPERS[name].title, facts=facts, tables=[numbers], figures=[study.figures[paper["cover"]]])

    def text(self) -> str:
        """Every table, for a terminal."""
        return self.report().text()

    def summary(self) -> dict[str, Any]:
        """What JSON has of it."""
        papers = {name: [outcome.summary() for outcome in outcomes] for name, outcomes in self.outcomes.items()}
        items = {name: [item.summary() for item in PAPERS[name].items] for name in papers}
        return {"seed": self.seed, "version": __version__, "met": self.met, "papers": papers, "items": items}


def _counted(outcomes: Sequence[Outcome]) -> Both:
    every, yes, no, _, missed = counts(outcomes)
    en = f"{counted(every, 'figure')}: {yes} of the paper's reached by its method, {no} not; {missed} bars missed"
    return Both(en, f"共 {every} 项：按论文方法达到 {yes} 项，未达到 {no} 项；{missed} 项限值未满足")


def page_name(name: str, lang: str) -> str:
    """Name of a page in a language."""
    return f"{name}.html" if lang == "en" else f"{name}.{lang}.html"


def restored(folder: Path, name: str, seed: int | None = None) -> Study:
    """What a run of a paper kept in a folder."""
    study = Study.restored(name, folder / name, seed)
    if study is None:
        raise DecodeError(f"{folder / name} has no run of this version of Plumbob; run the paper again.")
    return study


def _first_tables(name: str, outcomes: Sequence[Outcome]) -> list[Table]:
    """Main figures, what cannot be had, and claims, items and all figures, which a page folds away."""
    main = PAPERS[name].content["paper"]["main"]
    lists = [part for part in (not_had(outcomes), claims(outcomes)) if part]
    title = Both(f"All {len(outcomes)} figures with their bars", f"全部 {len(outcomes)} 项指标及限值")
    every = replace(table(outcomes, title), detail="all")
    return [table([o for o in outcomes if o.key in main], Both("Main figures", "主要指标")), *lists, items(name), every]


def reproduce(
    *papers: str,
    seed: int = 1,
    out: str | Path | None = None,
    lang: str = "en",
    jobs: int = 2,
    render: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Reproduction:
    """Run papers whole, from emulated bytes to their tables and figures, and write a page for each.

    A run that was ended goes on with the papers that it had not done, where the folder and the seed are the same.

    Parameters
    ----------
    *papers : str
        Some of fin, buoy, trackball, arm and rod; none, or ``"all"``: all five.
    seed : int
        Of everything that is left to chance; the same seed gives the same bits on the same machine.
    out : path, optional
        Folder, made where it is not there: ``index.html``, ``outcomes.json``, a page for each paper, and a folder with
        its bytes, sessions, recordings and cards; ``reproduced`` if not given. With `render`, that of its file.
    lang : {"en", "zh"}
        Language of the pages: ``index.html``, in Chinese ``index.zh.html``, and so on.
    jobs : int
        How many papers run side by side, each in a process of its own.
    render : path, optional
        ``outcomes.json`` of a run, whose pages are written again, as in another language, without another run.
    overwrite : bool
        Whether all is run again, and files in `out` may be replaced.
    progress : callable, optional
        Called with a paper and what it does, how many steps are done, and of how many.

    Returns
    -------
    Reproduction

    Raises
    ------
    ParameterError
        If a paper is unknown, a number outside its domain, `out` beside `render`, or the folder is not empty and
        `overwrite` is false.
    MissingExtraError
        If matplotlib, which draws the pages' figures, is not installed.
    """
    chosen = _chosen(papers)
    check.one_of("lang", lang, LANGUAGES)
    for named, value, least in (("jobs", jobs, 1), ("seed", seed, 0)):
        if not isinstance(value, int) or isinstance(value, bool) or value < least:
            raise ParameterError(f"{named} must be a whole number of at least {least}, but it is {check.said(value)}.")
    needed("matplotlib.figure", "the pages' figures", "plumbob[plot]")  # now, not after minutes
    if render is not None:
        if out is not None:
            raise ParameterError("render writes pages beside their outcomes.json, and takes no out (--out).")
        file = check.path("render", render)
        seed, done = _read_outcomes(file)
        return _written({name: restored(file.parent, name, seed) for name in done}, file.parent, seed, lang)
    folder = _folder(check.path("out", out or "reproduced"), seed, overwrite=overwrite)
    studies = {} if overwrite else {n: s for n in chosen if (s := Study.restored(n, folder / n, seed)) is not None}
    _write_outcomes(Reproduction(seed, {}, folder))
    remaining = [name for name in chosen if name not in studies]
    if len(remaining) == 1:
        run_paper(remaining[0], folder, seed, progress)
    else:
        _side_by_side(remaining, folder, seed, jobs, progress)
    return _written({name: restored(folder, name, seed) for name in chosen}, folder, seed, lang)


def _write_outcomes(reproduction: Reproduction) -> None:
    text = json.dumps(reproduction.summary(), indent=1) + "\n"
    write_text(reproduction.folder / OUTCOMES, text, overwrite=True)


def _read_outcomes(file: Path) -> tuple[int, list[str]]:
    """Seed of a run, and the papers of it that are done."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        return content["seed"], [name for name in NAMES if name in content["papers"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DecodeError(f"{file} is not the {OUTCOMES} of a run of papers: {error}.") from error


def _written(studies: Mapping[str, Study], folder: Path, seed: int, lang: str) -> Reproduction:
    """Write the pages of studies, and what they say together."""
    outcomes: dict[str, Sequence[Outcome]] = {}
    for name, study in studies.items():
        paper = study.paper()
        report, outcomes[name] = paper.report, paper.outcomes
        made = Report(_RUN, facts=[(_COMMAND, study.command), (_MADE, study.made), *report.facts])
        report = replace(report, facts=(), parts=[*report.parts, made])
        page = replace(
            report,
            facts=[(_ABOUT, PAPERS[name].about), (_COUNTS, _counted(paper.outcomes))],
            tables=[*_first_tables(name, paper.outcomes), *report.tables],
            links=[(Both("all papers", "全部论文"), page_name("index", lang)), *report.links, *part_links(report)],
            definitions=[*DEFINITIONS, *report.definitions],
        )
        page.write_html(folder / page_name(name, lang), lang=lang, overwrite=True)
    reproduction = Reproduction(seed, outcomes, folder)
    reproduction.index(lang).write_html(folder / page_name("index", lang), lang=lang, overwrite=True)
    _write_outcomes(reproduction)
    return reproduction


def _chosen(papers: Sequence[str]) -> list[str]:
    if unknown := [name for name in papers if name not in (*NAMES, "all")]:
        raise unknown_name("paper", unknown[0], (*NAMES, "all"))
    return list(NAMES) if not papers or "all" in papers else [name for name in NAMES if name in papers]


def _folder(folder: Path, seed: int, *, overwrite: bool) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        filled = any(folder.iterdir())
    except OSError as error:
        raise DecodeError(f"{folder} cannot be the folder of the pages: {error.strerror}.") from error
    begun = (folder / OUTCOMES).is_file() and _read_outcomes(folder / OUTCOMES)[0] == seed
    if filled and not overwrite and not begun:
        raise ParameterError(
            f"{folder} is not empty, and not of a run of this seed; name another folder, or allow its files to be "
            "replaced (--force)."
        )
    return folder


def run_paper(name: str, folder: Path, seed: int, progress: Progress | None = None) -> None:
    """Run a paper in this process, and keep what it measured; a file says how far it is."""
    subfolder, started = folder / name, time.perf_counter()
    subfolder.mkdir(exist_ok=True)

    def on_step(what: str, done: int, of: int) -> None:
        write_text(subfolder / STEP, f"{what}\t{done}\t{of}", overwrite=True)
        if progress is not None:
            progress(f"{name}: {what}", done, of)

    study = Study(name, subfolder, seed, on_step)
    import_module(f"plumbob.papers.{name}").measure(study)
    (subfolder / STEP).unlink(missing_ok=True)
    study.save(f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC, {time.perf_counter() - started:.0f} s")


def _side_by_side(names: Sequence[str], folder: Path, seed: int, jobs: int, progress: Progress | None) -> None:
    """Run each paper in a process of its own; the first that fails ends all with its error."""
    steps: dict[str, str] = {}
    with processes(jobs) as pool:
        ordered = sorted(names, key=_LONGEST.index)
        running = {pool.submit(partial(run_paper, name, folder, seed)): name for name in ordered}  # type: ignore[arg-type]
        waiting = {*running}
        while waiting:
            done, waiting = wait(waiting, 0.5, FIRST_COMPLETED)
            for name in names if progress is not None else ():
                step = folder / name / STEP
                text = step.read_text(encoding="utf-8") if step.is_file() else ""
                if text and steps.get(name) != text:
                    steps[name], (what, at, of) = text, text.split("\t")
                    progress(f"{name}: {what}", int(at), int(of))  # type: ignore[misc]
            for future in done:
                try:
                    future.result()
                except pool.lost as error:
                    raise DecodeError(f"{running[future]} was lost: {error}; try one job.") from None


def not_had(outcomes: Sequence[Outcome]) -> Table | None:
    """Table of what is missed or cannot be reproduced, a row for each reason; None where there is nothing."""
    why: dict[Both, list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.reason is not None and not (outcome.met and outcome.reached is not False):
            why.setdefault(outcome.reason, []).append(outcome)
    rows = []
    for reason, group in why.items():
        first, more = group[0], len(group) - 1
        what = Both(f"{first.what}, and {more} more", f"{first.what.zh}，另 {more} 项") if more else first.what
        rows.append([what, first.where or "-", *first.verdict[:2], reason])
    head = (HEAD[0], HEAD[1], *HEAD[6:8], Both("why", "原因"))
    title = Both("What cannot be had as the paper prints it, and why", "无法按论文原样复现的内容及原因")
    return Table(title, head, rows, words=(1, 2, 3, 4)) if rows else None


def claims(outcomes: Sequence[Outcome]) -> Table | None:
    """Table of the numbers that the paper prints, and what became of each; None where it prints none."""
    rows = [[o.what, o.where or "-", shown(o.paper, o.digits), o.claim, o.by] for o in outcomes if o.claim is not None]
    title = Both("What became of each number of the paper", "论文数值：已复现、不成立或无法得到")
    head = (*HEAD[:2], HEAD[3], Both("claim", "结论"), HEAD[8])
    return Table(title, head, rows, words=(1, 3, 4), detail="all") if rows else None


def items(name: str) -> Table:
    """Table of what the paper describes, and what became of it."""
    rows = [[o.where, o.what, o.state, " ".join(filter(None, (o.by, o.reason)))] for o in PAPERS[name].items]
    done = f"{sum(row[2] == 'done' for row in rows)}/{len(rows)}"
    head = (HEAD[1], Both("item", "内容"), Both("state", "状态"), Both("by", "实现或原因"))
    return Table(Both(f"Items done: {done}", f"论文内容完成：{done}"), head, rows, words=(1, 2, 3), detail="all")


def counts(outcomes: Sequence[Outcome]) -> Sequence[int]:
    """Of all outcomes: how many reach the paper's figure, do not, have none to reach, and miss a bar."""
    reached = [outcome.reached for outcome in outcomes]
    return [len(outcomes), *map(reached.count, (True, False, None)), sum(not outcome.met for outcome in outcomes)]
