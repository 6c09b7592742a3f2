"""Rod paper: an ADIS16355 on a rod that is moved by hand, compared with an AHRS500GA [Li2012]."""

from plumbob.papers.outcome import Paper
from plumbob.papers.rod import compared, equations, methods, page, results
from plumbob.papers.rod.items import ITEMS
from plumbob.papers.work import Work

SEEDS = 24
"""Of the table of methods; the bar is on 95 % of them."""
TRIED = 3
"""Seeds under each disturbance."""

__all__ = ["ITEMS", "run"]


def run(work: Work) -> Paper:
    """Run the paper: one recording through bytes, and its methods over many seeds."""
    step = work.steps(2 + SEEDS + TRIED)
    step("rig, recording and estimates")
    one = compared.compared(work)
    seeds = work.seeds(SEEDS)
    table = methods.measure(seeds, progress=lambda _: step("methods over seeds"))
    limits = []
    for seed in seeds[:TRIED]:
        step("what the test leaves out")
        case = methods.case(seed)
        limits.append([methods.disturbed(case, what) for what in methods.DISTURBANCES])
    step("covariance and page")
    first = methods.case(seeds[0])
    forms = equations.forms(first)
    outcomes = [
        *results.chain(one),
        *equations.formulas(work.seed),
        *equations.misprinted(table),
        *equations.numerics(forms),
        *results.through_bytes(one),
        *results.over_seeds(table),
    ]
    return Paper(report=page.page(one, table, limits, forms, equations.grown(first)), outcomes=outcomes)
