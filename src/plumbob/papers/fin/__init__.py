"""The fin paper [Ou2017]: attitude of a bionic fin by two MEMS gyroscopes, and their noise by Allan variance."""

from typing import Final

from plumbob.papers.fin import algorithm, attitude, estimation, experiment, system
from plumbob.papers.fin.items import ITEMS
from plumbob.papers.outcome import Paper
from plumbob.papers.work import Work
from plumbob.reporting import Report
from plumbob.reporting.style import Both

__all__ = ["ITEMS", "run"]

_STEPS: Final = 12
_RUNS: Final = 180
"""Records of the three regimes."""
_RECORDS: Final = 400
"""Of white noise for the scatter of σ."""
_SEEDS: Final = 9
"""Swims with noise."""


def run(work: Work) -> Paper:
    """Run the paper whole: system, attitude, algorithm, experiment, estimators."""
    step = work.steps(_STEPS)
    records, still = experiment.static_records(work, step)
    angles, of_angles, swum = attitude.part(work, step, still.recording, _SEEDS)
    parts = [
        system.part(work, swum.samples),
        (angles, of_angles),
        algorithm.part(work, step, _RECORDS),
        experiment.part(records),
        estimation.part(work, step, _RUNS),
    ]
    title = Both(
        "Bionic fin: attitude and Allan error analysis (Ou 2017)", "仿生鳍条姿态测量及其误差分析（欧世星 2017）"
    )
    facts = [
        (
            Both("paper", "论文"),
            Both(
                "Ou, Wang, Tan and Guo, Computer Measurement & Control, 2017",
                "欧世星、王光明、谭晓朋、郭晓俊，计算机测量与控制，2017",
            ),
        ),
        (
            Both("sensors", "传感器"),
            Both(
                "ADXRS453 about z, ADXRS290 about x and y, 500 Hz, 220 s",
                "ADXRS453（z）、ADXRS290（x、y），500 Hz，220 s",
            ),
        ),
        (Both("seed", "随机种子"), f"{work.seed}"),
    ]
    page = Report(title, facts=facts, parts=[report for report, _ in parts])
    return Paper(report=page, outcomes=[one for _, found in parts for one in found])
