"""Faults: what each filter and peer makes of damaged samples, stamps and starts, beside its own clean run."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness.battery import ApiVerdict, Battery, run_battery
from benchmarks.harness.contender import Contender
from benchmarks.harness.fault_cases import Case
from benchmarks.harness.fault_scene import LONGEST, RATE, USUAL, Stream, record
from benchmarks.harness.verdict import COUNTED, PASS, STRICT, Judgement, Trace, Verdict, judge
from plumbob.core.check import Floats
from plumbob.core.units import to_deg
from plumbob.rotations import quat_angle

WARM: Final = 30.0
"""Clean runs are summed up from here on, s."""


@dataclass(frozen=True, slots=True)
class Heard:
    """What a contender answered to a stream: error, degrees, and flags by sample, and its exceptions."""

    error_deg: Floats
    words: NDArray[np.int64]
    errors: tuple[str, ...]
    clear: bool


def listen(contender: Contender, stream: Stream) -> Heard:
    """Feed a stream sample by sample."""
    q_nb, words, _, errors = contender.fed(stream)
    error_deg = to_deg(quat_angle(stream.truth[stream.newest], q_nb))
    return Heard(error_deg, words, tuple(errors), all(errors.values()))


def compare(case: Case, stream: Stream, heard: Heard, clean: Heard, words: Mapping[int, str]) -> Judgement:
    """Judge what was heard beside the clean run; of the clean start the error itself is judged."""
    beside = clean.error_deg[stream.newest] if case.counted else 0.0
    excess = heard.error_deg - beside
    news = heard.words & ~clean.words[stream.origin]
    t = stream.newest / RATE
    trace = Trace(t, np.maximum(excess, 0.0), news != 0, heard.errors, heard.clear)
    found = judge(trace, begin=case.begin, end=case.end, judged_from=case.judged_from)
    if not found.flagged:
        return found
    until = math.inf if found.recover_s is None else max(case.end, case.begin) + found.recover_s
    up = int(np.bitwise_or.reduce(news[(t >= case.begin) & (t <= until)]))
    return replace(found, flags=tuple(name for bit, name in words.items() if up & bit))


@dataclass(frozen=True, slots=True)
class Score:
    """Counts of one contender."""

    cases: int
    counts: dict[Verdict, int]

    @property
    def passed(self) -> float | None:
        """Share that ends well or says so, percent; None where nothing was counted."""
        return self._share(PASS)

    @property
    def strict(self) -> float | None:
        """Share that ends well, percent."""
        return self._share(STRICT)

    def _share(self, good: Sequence[Verdict]) -> float | None:
        return 100.0 * sum(self.counts[v] for v in good) / self.cases if self.cases else None

    def summary(self) -> dict[str, Any]:
        """Ready for JSON."""
        counts = {str(verdict): count for verdict, count in self.counts.items()}
        return {"cases": self.cases, **counts, "pass_percent": self.passed, "strict_percent": self.strict}


@dataclass(frozen=True, slots=True)
class Faults:
    """Verdicts of each contender on each case.

    Attributes
    ----------
    cases : tuple of Case
        What was injected.
    settings : dict
        What ran, by contender.
    clean_rms_deg : dict
        Root mean square error of the clean runs from 30 s on, degrees.
    verdicts : dict
        ``verdicts[contender][case]``.
    batteries : dict
        Arguments, by contender; empty where they were not asked for.
    absent : dict
        Peers that are not installed, and why.
    """

    cases: tuple[Case, ...]
    settings: dict[str, str]
    clean_rms_deg: dict[str, float]
    verdicts: dict[str, dict[str, Judgement]]
    batteries: dict[str, Battery]
    absent: dict[str, str]

    def score(self, contender: str) -> Score:
        """Counts of a contender; what cannot concern it and the clean start do not count."""
        said = [self.verdicts[contender][case.name].verdict for case in self.cases if case.counted]
        counts = {verdict: said.count(verdict) for verdict in COUNTED}
        return Score(sum(counts.values()), counts)

    def summary(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {
            "settings": self.settings,
            "clean_rms_deg": {name: v if math.isfinite(v) else None for name, v in self.clean_rms_deg.items()},
            "score": {name: self.score(name).summary() for name in self.settings},
            "cases": {
                case.name: {
                    "group": case.group,
                    "what": case.what,
                    "results": {name: self.verdicts[name][case.name].summary() for name in self.settings},
                }
                for case in self.cases
            },
            "arguments": {name: battery.summary() for name, battery in self.batteries.items()},
            "absent": self.absent,
        }

    def text(self) -> str:
        """Tables of the cases, the arguments and the score."""
        parts = [self._case_table(), self._argument_table(), self._score_table()]
        lines = [*(part for part in parts if part), *(f"peer left out: {why}" for why in self.absent.values())]
        return "\n".join(lines)

    def _case_table(self) -> str:
        if not self.cases:
            return ""
        names = list(self.settings)
        rows = [
            [case.name, *(self.verdicts[name][case.name].cell() for name in names)]
            for case in self.cases
        ]  # fmt: skip
        return table(["fault", *names], rows) + _LEGEND

    def _argument_table(self) -> str:
        if not self.batteries:
            return ""
        names = list(self.batteries)
        labels = list(dict.fromkeys(label for battery in self.batteries.values() for label in battery.verdicts))
        rows = [
            [label, *(str(self.batteries[name].verdicts.get(label, "–")) for name in names)]
            for label in labels
        ]  # fmt: skip
        return table(["argument", *names], rows) + "\n"

    def _score_table(self) -> str:
        head = ["score", "clean rms", "cases", *COUNTED,
                "pass", "strict", "arguments", *(str(v) for v in ApiVerdict if not v.good)]  # fmt: skip
        rows = [self._score_row(name) for name in self.settings]
        return table(head, rows) + "\n\n" + "\n".join(self.settings.values())

    def _score_row(self, name: str) -> list[str]:
        score = self.score(name)
        battery = self.batteries.get(name)
        bad = [str(battery.count(v)) if battery else "–" for v in ApiVerdict if not v.good]
        return [
            name,
            f"{self.clean_rms_deg[name]:.3f}°",
            str(score.cases),
            *(str(count) for count in score.counts.values()),
            percent(score.passed),
            percent(score.strict),
            f"{battery.good}/{len(battery.verdicts)}" if battery else "–",
            *bad,
        ]


_LEGEND: Final = """

ok: never more than 2° beyond the own clean run; 31°/36s: so far off, recovered so long after the fault; WRONG 9°: so
far off at the end; NaN: not finite at the end; error: a clear error, then fine; *: a flag was raised that the clean
run has not; start_clean is not compared and does not count
"""


def percent(share: float | None) -> str:
    """Share in whole percent."""
    return "–" if share is None else f"{share:.0f} %"


def table(head: list[str], rows: list[list[str]]) -> str:
    """Columns below their names, the first one to the left."""
    widths = [max(len(row[i]) for row in (head, *rows)) for i in range(len(head))]
    lines = []
    for first, *cells in (head, *rows):
        padded = (f"{cell:>{width}}" for cell, width in zip(cells, widths[1:], strict=True))
        lines.append("  ".join([f"{first:{widths[0]}}", *padded]).rstrip())
    return "\n".join(lines)


def measure_faults(
    contenders: Sequence[Contender],
    cases: Sequence[Case],
    *,
    arguments: bool = True,
    absent: Mapping[str, str] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Faults:
    """Run each contender on each case, and on a clean stream before.

    Parameters
    ----------
    contenders : sequence of Contender
        Our filters, and peers.
    cases : sequence of Case
        What to inject.
    arguments : bool
        Run the battery of arguments too (group F9).
    absent : Mapping, optional
        Peers that are not installed, and why; passed on to the tables.
    progress : callable, optional
        Called with 1 after each run.
    """
    verdicts: dict[str, dict[str, Judgement]] = {}
    batteries: dict[str, Battery] = {}
    rms: dict[str, float] = {}
    for contender in contenders:
        clean = listen(contender, record(USUAL, LONGEST))
        rms[contender.name] = float(np.sqrt(np.mean(clean.error_deg[round(WARM * RATE) :] ** 2)))
        verdicts[contender.name] = {}
        for case in cases:
            verdicts[contender.name][case.name] = _measure(contender, case, clean)
            if progress:
                progress(1)
        if arguments:
            batteries[contender.name] = run_battery(contender)
    settings = {contender.name: contender.settings for contender in contenders}
    return Faults(tuple(cases), settings, rms, verdicts, batteries, dict(absent or {}))


def _measure(contender: Contender, case: Case, clean: Heard) -> Judgement:
    if case.stamps and not contender.timed:
        return Judgement(Verdict.NOT_APPLICABLE)
    stream = case.stream()
    return compare(case, stream, listen(contender, stream), clean, contender.words)
