"""Rod paper: an ADIS16355 on a rod that is moved by hand, compared with an AHRS500GA [Li2012]."""

from typing import Final

import numpy as np

from plumbob.core.units import to_deg
from plumbob.papers.description import ROD
from plumbob.papers.outcome import Outcome, Paper, at_most
from plumbob.papers.rod import comparison as compared
from plumbob.papers.rod import equations, methods, page
from plumbob.papers.rod.comparison import Compared, budget
from plumbob.papers.rod.methods import MethodScores
from plumbob.papers.workspace import Work
from plumbob.protocols.format_toml import device
from plumbob.rotations import euler_zyx_from_quat, quat_from_euler_zyx, wrap
from plumbob.simulation.presets import draw_module

BASE: Final = 0.61035e-3
"""Time base of the register SMPL_PRD, s, which the catalogue states in words."""


def chain(run: Compared) -> list[Outcome]:
    """Figures of the measuring system: rates, packets, accuracy of the reference."""
    reset = next(register.reset for register in device("adis16355").registers if register.name == "SMPL_PRD")
    assert reset is not None
    packet = device("ahrs500ga")
    first = next(field.at for field in packet.messages[0].fields if field.name == "roll")
    step = float(np.median(np.diff(run.t)))
    heading, tilt = reference_rms()
    return [
        ROD.row("chain.sps", faithful=1.0 / (BASE * (reset + 1))),
        ROD.row("ref.heading", faithful=heading),
        ROD.row("ref.tilt", faithful=tilt),
        ROD.row("chain.ahrs_rate", faithful=1.0 / step),
        ROD.row("chain.packet", faithful=float(packet.messages[0].length)),
        ROD.row("chain.first", faithful=first + 1.0),
        ROD.row("chain.synchronous", faithful=100.0 * float(np.isfinite(run.ahrs).all(axis=1).mean())),
        ROD.row("chain.step", faithful=step),
        ROD.row("chain.duration", faithful=float(run.t[-1]) + step),
    ]


def reference_rms(count: int = 400) -> tuple[float, float]:
    """Root mean square errors, °, of the heading and of the tilt that the emulated reference gives in runs of 60 s."""
    errors = draw_module("ahrs500ga", 1).attitude
    assert errors is not None
    at = np.tile([0.3, -0.1, 0.2], (60, 1))
    q_nb = quat_from_euler_zyx(at)
    every = np.array(
        [wrap(errors.said(q_nb, seed=seed, rate=1.0) - euler_zyx_from_quat(q_nb)) for seed in range(count)]
    )
    heading, *tilts = to_deg(np.sqrt((every**2).mean(axis=(0, 1))))
    return float(heading), float(np.sqrt(np.mean(np.square(tilts))))


def through_bytes(run: Compared) -> list[Outcome]:
    """What the paper's comparison gives on the recording, and what it is made of."""
    faithful, best = ({part.name[:]: part for part in budget(run, key)} for key in ("ekf7", "smoother"))
    names = list(faithful)
    outcomes = []
    for i, axis in enumerate(("roll", "pitch")):
        for key, name in (("ahrs", names[0]), ("truth", names[2])):
            values = (float(budgets[name].largest[i]) for budgets in (faithful, best))
            outcomes.append(ROD.row(f"bytes.{key}.{axis}", faithful=next(values), best=next(values)))
    for key in ("accel", "gyro"):
        size = float(np.abs(run.errors(run.tracks[key], run.truth.q_nb)).max())
        outcomes.append(ROD.row(f"bytes.{key}", faithful=size))
    for key, name in zip(("reference", "own", "mounted"), names[3:], strict=True):
        values = (
            100.0 * float((budgets[name].rms ** 2).sum() / (budgets[names[0]].rms ** 2).sum())
            for budgets in (faithful, best)
        )
        outcomes.append(ROD.row(f"bytes.share.{key}", faithful=next(values), best=next(values)))
    assert run.truth.bias_b is not None
    late = run.t > run.t[-1] - 100.0
    bias_error = to_deg(np.sqrt(((run.bias - run.truth.bias_b)[late] ** 2).mean()))
    was = to_deg(np.sqrt((run.truth.bias_b[late] ** 2).mean()))
    outcomes.append(ROD.row("bytes.bias", faithful=float(bias_error), faithful_bar=at_most(float(was)), was=was))
    return outcomes


def over_seeds(table: MethodScores) -> list[Outcome]:
    """The paper's claims over many seeds, with the bars."""
    return [*_alone(table), *_fused(table), *_switches(table)]


def _alone(table: MethodScores) -> list[Outcome]:
    """Each sensor alone, as the paper shows it."""
    late = [float(score.late.max()) for score in table.scores["accel"]]
    gyro = table.largest("gyro")
    return [
        ROD.row("accel.early", faithful=float(table.early("accel").max())),
        ROD.row("accel.late", faithful=min(late)),
        ROD.row("gyro.largest", faithful=float(gyro.mean())),
        ROD.row("gyro.kept", faithful=float(table.largest("gyro_kept").min())),
        ROD.row("gyro.beyond", faithful=100.0 * float(np.mean(gyro > 5.0))),
    ]


def _fused(table: MethodScores) -> list[Outcome]:
    """Both fused, within ±1° and against the gyroscope alone."""
    gyro, soft, smooth = (table.largest(key) for key in ("gyro", "ekf7", "smoother"))
    return [
        ROD.row("fused.kept", faithful=100.0 * table.pass_rate("ekf7"), best=100.0 * table.pass_rate("smoother")),
        ROD.row("fused.equations", faithful=100.0 * table.pass_rate("r01")),
        ROD.row("fused.causal", best=100.0 * table.pass_rate("mekf_card")),
        *(
            ROD.row(f"fused.{axis}.{part}", faithful=float(of("ekf7")[i]), best=float(of("smoother")[i]))
            for i, axis in enumerate(("roll", "pitch"))
            for part, of in (("early", table.early), ("late", table.late))
        ),
        ROD.row("fused.worst", faithful=float(soft.max()), best=float(smooth.max())),
        ROD.row("fused.rms", faithful=table.rms("ekf7"), best=table.rms("smoother")),
        ROD.row("drift.ratio", faithful=float(np.median(gyro / soft)), best=float(np.median(gyro / smooth))),
    ]


def _switches(table: MethodScores) -> list[Outcome]:
    """The switch at rest: hard as the paper's, and soft."""
    soft = table.largest("ekf7")
    return [
        ROD.row("switch.jump", faithful=max(table.jumps["ekf7"])),
        ROD.row("switch.hard.jump", faithful=max(table.jumps["hard"]), best=max(table.jumps["ekf7"])),
        *(
            ROD.row(f"switch.{key}", faithful=float(table.largest(key).mean()), best=float(soft.mean()))
            for key in ("hard", "hard_reset", "narrow", "narrow_reset")
        ),
    ]


SEEDS = 24
"""Of the table of methods; the bar is on 95 % of them."""
TRIED = 3
"""Seeds under each disturbance."""


def run(work: Work) -> Paper:
    """Run the paper: one recording through bytes, and its methods over many seeds."""
    step = work.steps(2 + SEEDS + TRIED)
    step("rig, recording and estimates")
    experiment = compared.compared(work)
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
        *chain(experiment),
        *equations.formulas(work.seed),
        *equations.misprinted(table),
        *equations.numerics(forms),
        *through_bytes(experiment),
        *over_seeds(table),
    ]
    return Paper(report=page.page(experiment, table, limits, forms, equations.grown(first)), outcomes=outcomes)
