"""The fin paper [Ou2017]: attitude of a bionic fin by two MEMS gyroscopes, and their noise by Allan variance."""

from typing import Final

from plumbob.papers.fin import algorithm, attitude, estimation, experiment, system
from plumbob.papers.outcome import Paper, PaperItem
from plumbob.papers.workspace import Work
from plumbob.reporting.report import Report
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
    return Paper(report=page, outcomes=[outcome for _, outcomes in parts for outcome in outcomes])


ITEMS: Final = (
    PaperItem(
        where="§1, Fig 1",
        what="mechanism of the fin: one DC motor and two stepper motors for speed, amplitude and twist",
        by="scenario `fin`: swing and twist as given; [axis.pitch]",
        reason="The drawing has no dimensions; its motors and linkage are not simulated, the motion that they make is.",
    ),
    PaperItem(
        where="§1",
        what="attitude against the geographic frame: yaw, pitch and roll in real time",
        by="[live.same] [swim.yaw] [swim.pitch] [swim.roll]; `record` with a filter in its session, `replay --check`",
    ),
    PaperItem(where="§1", what="ADXRS453 about z: ±300 °/s, 80 LSB/(°/s)", by="[system.counts.453] [system.range.453]"),
    PaperItem(
        where="§1",
        what="ADXRS290 about x and y: ±100 °/s, 200 LSB/(°/s), and what clips",
        by="[system.counts.290] [system.range.290] [clip.peak.x] [clip.missed]",
    ),
    PaperItem(
        where="§1",
        what="masses, packages and the resonator principle of both gyroscopes",
        reason="Properties of the parts, without any effect on a sample.",
    ),
    PaperItem(
        where="§1, Fig 2",
        what="structure of the system: sensors, signal processing, acquisition board, host",
        by="table of the chain on the page; rig `fin`; `emulate`, `record`",
    ),
    PaperItem(
        where="§1",
        what="signal processing: AD conversion and band-pass filter",
        by="[highpass.hold] [highpass.slope] [highpass.sigma]; `emulate --high-pass`, off by default",
    ),
    PaperItem(
        where="§1",
        what="signal processing: temperature compensation",
        by="[warm.x] [warm.y] [warm.z]; `emulate --warm-up`, `calibrate temperature`",
    ),
    PaperItem(
        where="§1",
        what="acquisition: 16-bit two's complement by SPI, then USB",
        by="[system.word] [misprint.unsigned]; formats `adxrs453`, `adxrs290`, `fin`",
    ),
    PaperItem(
        where="§1, §3",
        what="host: LabVIEW reads and stores TXT, MATLAB reads it back",
        by="[text.lost] [live.text]; `plumbob.write` of .txt, `read` of .txt and .lvm, `decode --out`",
    ),
    PaperItem(
        where="§2",
        what="sources of error: mounting, circuit, random errors of the gyroscopes",
        by="parameters of `simulate` and of `emulate --mount-error`; random errors [table1.N.453z]",
    ),
    PaperItem(
        where="§2, 1) 2), (1)",
        what="grouping of the samples and means of groups",
        by="[misprint.eq2.moving.slope] [misprint.eq2.disjoint.slope] [allan.last]",
    ),
    PaperItem(
        where="§2, 3), (2)",
        what="Allan variance",
        by="[allan.slope] [allan.second] [allan.direct] [allan.peer]",
    ),
    PaperItem(where="§2, 4)", what="log-log plot for every n up to N/2", by="[allan.n]; `allan --taus all`"),
    PaperItem(
        where="§2, 5), (3) (4)",
        what="quantization coefficient Q at T = √3 on slope −1",
        by="[eq3.density] [eq3.nyquist] [eq4.white] [eq4.growth] [quantised.angle] [quantised.rate] [three.Q.bias]",
    ),
    PaperItem(
        where="§2, 6), (5)",
        what='coefficient "R" at T = 1 on slope −1/2, called random walk of the rate',
        by="[name.white] [three.N.bias]",
    ),
    PaperItem(
        where="§2, 7), (6)",
        what="bias instability B on the flat",
        by="[eq6.flat] [misprint.undivided] [three.B.bias] [three.B.scatter] [length.3600]",
    ),
    PaperItem(
        where="§2, 8), (7)",
        what="range of each coefficient by the percent error, with its example of 6.299 %",
        by="[eq7] [eq7.n] [eq7.white] [eq7.disjoint] [eq7.flicker] [three.B.cover]",
    ),
    PaperItem(
        where="§3, Fig 3",
        what="experiment: fin level, motors off, warmed up, more than 100 000 samples; photograph",
        by="[system.samples] [system.rate]; scenario `static`",
    ),
    PaperItem(where="§3, Fig 4", what="Allan plot of the three axes", by="Figure 4 of the page; [allan.n]"),
    PaperItem(where="§3, Fig 5", what="Allan plot of the ADXRS453 with the fitted lines", by="Figure 5 of the page"),
    PaperItem(
        where="§3, Table 1",
        what="Q, R and B of three axes with their ranges",
        by="[table1.Q.290x] to [table1.B.453z], [interval.Q.290x] to [interval.B.453z], [unit.Q] [unit.R.453z] "
        "[unit.B.453z]; `allan --paper fin`",
    ),
    PaperItem(
        where="abstract, §3, §4",
        what="claims: quantization is least; angular rate random walk and bias instability are the main errors",
        by="[claim.290x] [claim.290y] [claim.453z]; table of the angle's errors on the page",
    ),
)
"""In the order of the paper."""
