"""The paper's page: its scheme, misprints, tables and figures in its order, and what goes beyond."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import to_deg
from plumbob.papers.arm import drawings as drawn
from plumbob.papers.arm import faults, misprints, tables, teaching
from plumbob.papers.arm.drawings import Broken, BytesRun
from plumbob.papers.arm.simulated import MOUNTS, Over, assumed_noise
from plumbob.papers.arm.tables import PAPER, WORDS
from plumbob.papers.description import ARM
from plumbob.papers.outcome import Outcome, PrintedForm
from plumbob.reporting.report import Report


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
        figures=[drawn.inference(study.read)],
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
        figures=[*([drawn.heading(run)] if turns else []), *drawn.errors(run, turns=turns)],
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
        figures=[drawn.recovery(study.recoveries)],
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
        (ARM.text("text_3", triad=_TRIADS[triad], kind=_KINDS[kind]), *values)
        for (triad, kind), values in cells.items()
    ]
    parity = [
        (f"{step:g}", f"{row.found}", f"{row.median:.1f}" if row.found else "-") for step, row in study.parity.items()
    ]
    return ARM.part(
        "breaks",
        tables=[ARM.table("test_of_the", parity), ARM.table("every_fault_of", rows)],
        figures=[drawn.faults(study.watched)],
    )
