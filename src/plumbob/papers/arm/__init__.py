"""Teaching arm: six units in ± sets, fuzzy and PI laws, a Kalman filter [HuangJiang]; and what an array can do.

Both tables of the paper are of simulations. With the noise that it states, its figures would be far smaller; they come
out with a noise that is assumed, which shows that they are possible and proves nothing. One run of each figure goes
through the bytes of the rig ``arm``; the statistics over many seeds are drawn directly.
"""

from typing import Final

from plumbob.core.constants import G0
from plumbob.core.units import to_deg
from plumbob.papers.arm import faults, misprints, tables, teaching
from plumbob.papers.arm.simulated import MOUNTS, assumed_noise
from plumbob.papers.arm.tables import SEEDS
from plumbob.papers.description import ARM
from plumbob.papers.outcome import Paper
from plumbob.papers.workspace import Work
from plumbob.reporting.report import Report

FEW: Final = 100
"""Seeds of what is beside the tables; the least that a figure may have."""
WATCHED: Final = 200
"""Seeds of the fault that has bars."""
_STEPS: Final = 11


def run(work: Work) -> Paper:
    """Run the paper: bytes, tables over many seeds, misprints, recovery, faults, and a teach-in.

    Statistics take seeds 1, 2, … each; the seed of the work is that of its runs through bytes.
    """
    steps = work.steps(_STEPS)
    steps("six units through bytes")
    runs = {turns: tables.through_bytes(work, turns=turns) for turns in (False, True)}
    steps(f"Table 1 over {SEEDS} seeds")
    stats = {False: tables.measured(False, SEEDS)}
    steps(f"Table 2 over {SEEDS} seeds")
    stats[True] = tables.measured(True, SEEDS)
    of_tables = [tables.part(turns, stats[turns], runs[turns], SEEDS) for turns in (False, True)]
    steps("both at 100 Hz")
    hundred = tables.hundred(FEW, stats[True])
    steps("printed forms")
    printed = misprints.part(FEW, work.seed, stats[False], stats[True])
    steps("recovery and design of the rules")
    source = tables.source(FEW)
    steps("a unit that breaks, through bytes and moving")
    broken = [faults.broken_at_rest(work), faults.broken_in_motion(work.seed)]
    breaks = faults.part(broken, WATCHED, FEW // 10, steps)
    steps("teach-in through bytes")
    taught = teaching.part(teaching.teach(work))
    steps("page")
    report = page(work.seed, [part for part, _ in (printed, *of_tables, source, hundred, breaks, taught)])
    ordered = (*of_tables, printed, hundred, source, breaks, taught)
    return Paper(report=report, outcomes=[row for _, rows in ordered for row in rows])


def page(seed: int, parts: list[Report]) -> Report:
    """The page of the paper; its first part are Figures 1 and 2."""
    mounting = [
        (name, f"{'+−'[k > 2]}{'xyz'[k % 3]}", " ".join(f"{v:g}" for v in mount.q_bs))
        for k, (name, mount) in enumerate(MOUNTS.items())
    ]
    scheme = ARM.part("scheme", tables=[ARM.table("figure_1_parts"), ARM.table("figure_2_mounting", mounting)])
    noise = {"rest": _noise(turns=False), "turn": _noise(turns=True)}
    return ARM.part(
        "page",
        noise_fact=ARM.text("assumed_of_a_sample", **noise),
        seed=seed,
        seeds=SEEDS,
        few=FEW,
        broken=WATCHED,
        parts=[scheme, *parts],
    )


def _noise(*, turns: bool) -> str:
    noise = assumed_noise(turns)
    gyr, bias = to_deg(noise.gyr), to_deg(noise.bias)
    return f"{gyr:.2g} °/s, ±{bias:.2g} °/s, {noise.acc / G0:.2g} g, {noise.mag:g} µT"
