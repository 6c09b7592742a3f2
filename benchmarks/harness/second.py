"""The second battery, run: each contender on each case beside its own clean run of the same motion."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness.bar import Bar, bar_lines
from benchmarks.harness.contender import Contender
from benchmarks.harness.fault_scene import RATE, Motion, Stream
from benchmarks.harness.faults import percent, table
from benchmarks.harness.second_cases import SecondCase
from benchmarks.harness.silence import COUNTED, Claimed, Outcome, Run, Silence, judge
from plumbob.core.check import Floats
from plumbob.core.units import to_deg
from plumbob.evaluation.metrics import attitude_errors, error_quat
from plumbob.rotations import quat_conjugate, quat_multiply
from plumbob.rotations.frames import claimed_sd

BARS: Final = (("silent and wrong, though it could be seen", 0.0), ("silent and wrong at the end", 4.0),
               ("silent for more than 1 s", 8.0), ("error beyond 5 claimed sd", 5.0))  # fmt: skip
"""Shares of the cases that a good estimator stays within, percent."""


@dataclass(frozen=True, slots=True)
class Heard:
    """What a contender answered to a stream: error, degrees, and flags by sample, and what it claims."""

    error_deg: Floats
    words: NDArray[np.int64]
    claimed: Claimed | None


def listen(contender: Contender, stream: Stream, *, free: bool) -> Heard:
    """Feed a stream; a free heading counts from that of the first sample."""
    q_nb, words, cov_b, _ = contender.answer(stream)
    truth = stream.truth[stream.newest]
    if free:
        first = error_quat(q_nb[:1], truth[:1])[0] * [1.0, 0.0, 0.0, 1.0]
        q_nb = quat_multiply(quat_conjugate(first / np.linalg.norm(first)), q_nb)
    errors_of = attitude_errors(q_nb, truth)
    claimed = None
    if cov_b is not None:
        inclination, heading = claimed_sd(q_nb, cov_b)
        parts = np.stack((errors_of["heading"], errors_of["inclination"]), axis=1)
        claimed = Claimed(to_deg(parts), to_deg(np.nan_to_num(np.stack((heading, inclination), axis=1))))
    return Heard(to_deg(errors_of["total"]), words, claimed)


def compare(case: SecondCase, stream: Stream, heard: Heard, clean: Heard, alarms: int) -> Silence:
    """Judge what was heard beside the clean run."""
    excess = heard.error_deg - clean.error_deg[stream.newest]
    warned = heard.words & ~clean.words[stream.newest] & alarms
    run = Run(stream.newest / RATE, excess, warned != 0, heard.claimed)
    return judge(run, judged_from=case.judged_from)


@dataclass(frozen=True, slots=True)
class Second:
    """What became of each contender in each case.

    Attributes
    ----------
    cases : tuple of SecondCase
        What was injected.
    settings : dict
        What ran, by contender.
    found : dict
        ``found[contender][case]``.
    absent : dict
        Peers that are not installed, and why.
    """

    cases: tuple[SecondCase, ...]
    settings: dict[str, str]
    found: dict[str, dict[str, Silence]]
    absent: dict[str, str]

    def judged(self, contender: str) -> dict[str, Silence]:
        """Cases that can concern a contender."""
        found = self.found[contender]
        return {name: one for name, one in found.items() if one.by_both != Outcome.NOT_APPLICABLE}

    def bars(self, contender: str) -> list[Bar]:
        """Shares of cases beside their limits; of claims only where there are some."""
        judged = self.judged(contender)
        unseen = {case.name for case in self.cases if case.unseen}
        wrong = {name for name, one in judged.items() if one.by_both == Outcome.WRONG}
        silent = [one for one in judged.values() if one.by_both in (Outcome.SILENT, Outcome.WRONG)]
        counts = [len(wrong - unseen), len(wrong), len(silent)]
        if any(one.ratio is not None for one in judged.values()):
            counts.append(sum(one.beyond for one in judged.values()))
        shares = [100.0 * count / max(len(judged), 1) for count in counts]
        return [Bar(f"{name} [%]", share, 0.0, high) for share, (name, high) in zip(shares, BARS, strict=False)]

    def summary(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {
            "settings": self.settings,
            "score": {
                name: {
                    "cases": len(self.judged(name)),
                    "by_flags": self._counts(name, by_flags=True),
                    "by_flags_or_claims": self._counts(name),
                    "bars": [bar.summary() for bar in self.bars(name)],
                }
                for name in self.settings
            },
            "cases": {
                case.name: {
                    "group": case.group,
                    "what": case.what,
                    "unseen": case.unseen,
                    "results": {name: self.found[name][case.name].summary() for name in self.settings},
                }
                for case in self.cases
            },
            "absent": self.absent,
        }

    def _counts(self, contender: str, *, by_flags: bool = False) -> dict[str, int]:
        said = [one.by_flags if by_flags else one.by_both for one in self.judged(contender).values()]
        return {str(outcome): said.count(outcome) for outcome in COUNTED}

    def text(self) -> str:
        """Tables of the cases and the score, and the bars."""
        names = list(self.settings)
        rows = [
            [case.name + ("?" if case.unseen else ""), *(self.found[name][case.name].cell() for name in names)]
            for case in self.cases
        ]  # fmt: skip
        lines = [table(["fault", *names], rows) + _LEGEND, self._score_table()]
        for name in names:
            lines += ["", name, *bar_lines(self.bars(name))]
        lines += ["", *self.settings.values(), *(f"peer left out: {why}" for why in self.absent.values())]
        return "\n".join(lines)

    def _score_table(self) -> str:
        head = ["score", "cases", "right", "said", "silent > 1 s", "wrong", "by flags: said", "silent > 1 s", "wrong",
                "> 5 sd"]  # fmt: skip
        return table(head, [self._score_row(name) for name in self.settings])

    def _score_row(self, name: str) -> list[str]:
        judged = self.judged(name)
        both, flags = self._counts(name), self._counts(name, by_flags=True)
        counts = [*both.values(), *list(flags.values())[1:]]
        claims = [one.beyond for one in judged.values() if one.ratio is not None]
        shares = [percent(100.0 * count / max(len(judged), 1)) for count in counts]
        return [name, str(len(judged)), *shares, percent(100.0 * sum(claims) / len(claims)) if claims else "–"]


_LEGEND: Final = """

right: never more than 2° beyond the own clean run; said 9°: so far off, but not for 1 s without a warning or a claim;
9°/3s: so far off, and for so long without; WRONG 9°: so far off at the end, without; 7σ: an error of so many claimed
standard deviations for 0.1 s; fault?: no filter can see it, --list says why

of all cases: right, said, silent for more than 1 s, silent and wrong at the end, by flags or claims and by flags alone
"""


def measure_second(
    contenders: Sequence[Contender],
    cases: Sequence[SecondCase],
    *,
    absent: Mapping[str, str] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Second:
    """Run each contender on each case, and on a clean stream of the same motion.

    Parameters
    ----------
    contenders : sequence of Contender
        Our filters, and peers.
    cases : sequence of SecondCase
        What to inject.
    absent : Mapping, optional
        Peers that are not installed, and why; passed on to the tables.
    progress : callable, optional
        Called with 1 after each run.
    """
    found: dict[str, dict[str, Silence]] = {}
    for contender in contenders:
        clean: dict[tuple[Motion, bool], Heard] = {}
        found[contender.name] = {}
        for case in cases:
            key = (case.beside, case.mag)
            if key not in clean:
                clean[key] = listen(contender, case.clean(), free=not case.mag)
            found[contender.name][case.name] = _measure(contender, case, clean[key])
            if progress:
                progress(1)
    settings = {contender.name: contender.settings for contender in contenders}
    return Second(tuple(cases), settings, found, dict(absent or {}))


def _measure(contender: Contender, case: SecondCase, clean: Heard) -> Silence:
    if case.stamps and not contender.timed:
        return Silence(Outcome.NOT_APPLICABLE, Outcome.NOT_APPLICABLE)
    stream = case.stream()
    return compare(case, stream, listen(contender, stream, free=not case.mag), clean, contender.alarms)
