"""Rod paper: an ADIS16355 on a rod that is moved by hand, compared with an AHRS500GA [Li2012]."""

from plumbob.papers.description import ROD
from plumbob.papers.outcome import Paper
from plumbob.papers.rod import comparison, equations, methods
from plumbob.papers.workspace import Work

SEEDS = 24
"""Of the table of methods; the bar is on 95 % of them."""
TRIED = 3
"""Seeds under each disturbance."""


def run(work: Work) -> Paper:
    """Run the paper: one recording through bytes, and its methods over many seeds."""
    step = work.steps(2 + SEEDS + TRIED)
    step("rig, recording and estimates")
    recorded = comparison.compared(work)
    seeds = work.seeds(SEEDS)
    table = methods.measure(seeds, progress=lambda _: step("methods over seeds"))
    disturbed = []
    for seed in seeds[:TRIED]:
        step("what the test leaves out")
        disturbed.append(methods.disturbed(methods.case(seed)))
    step("covariance and page")
    parts = [
        comparison.system(recorded),
        equations.part(work.seed, table, methods.case(seeds[0])),
        comparison.part(recorded),
        methods.part(table),
    ]
    mounting = ROD.part("mounting", figures=[comparison.exchanged(recorded)])
    reports = [*(report for report, _ in parts), mounting, methods.limits(disturbed)]
    outcomes = [row for _, rows in parts for row in rows]
    return Paper(report=ROD.part("page", parts=reports), outcomes=outcomes)
