"""The fin paper [Ou2017]: attitude of a bionic fin by two MEMS gyroscopes, and their noise by Allan variance."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from plumbob.core.units import to_dps
from plumbob.papers.description import FIN
from plumbob.papers.fin import algorithm, attitude, chain, estimation, experiment
from plumbob.papers.fin.records import COUNT, RATE
from plumbob.papers.outcome import Outcome, Paper
from plumbob.papers.workspace import Work
from plumbob.protocols.decode import decode
from plumbob.protocols.field import Field
from plumbob.protocols.find import find_format
from plumbob.reporting.report import Report

_WORD: Final = """\
kind = "plumbob format"
version = 1
name = "word"
title = "rate word of the ADXRS453, read as {type}"
byte_order = "big"
[frame]
length = 2
[[field]]
name = "gyr.z"
type = "{type}"
unit = "deg/s"
counts = 80
"""


def word(folder: Path, kind: str) -> float:
    """Rate of the word 0xFFFF read as ``s16`` or ``u16``, °/s, by a format of your own."""
    file = folder / f"word-{kind}.toml"
    file.write_text(_WORD.format(type=kind), encoding="utf-8")
    frames = decode(b"\xff\xff", file).frames["word"]
    return float(to_dps(np.asarray(frames.columns["gyr.z"])[0]))


def system(work: Work, samples: int) -> tuple[Report, Sequence[Outcome]]:
    """Part of the page, and its outcomes.

    Parameters
    ----------
    work : Work
        Of the run.
    samples : int
        That a record of 220 s had when it was decoded.
    """
    fields = {field.name: field for field in find_format("fin").bind().messages[0].fields}
    z, x = fields["gyr.z"], fields["gyr.x"]
    signed, unsigned = word(work.folder, "s16"), word(work.folder, "u16")
    outcomes = [
        FIN.row("system.counts.453", faithful=_counts(z)),
        FIN.row("system.counts.290", faithful=_counts(x)),
        FIN.row("system.range.453", faithful=float(to_dps(z.full_scale))),
        FIN.row("system.range.290", faithful=float(to_dps(x.full_scale))),
        FIN.row("system.rate", faithful=samples / (COUNT / RATE)),
        FIN.row("system.samples", faithful=float(samples)),
        FIN.row("system.word", faithful=signed),
        FIN.row("misprint.unsigned", faithful=unsigned),
    ]
    return FIN.part("system", tables=[FIN.table("figures_2_and")]), outcomes


def _counts(field: Field) -> float:
    return 1.0 / float(to_dps(abs(field.scale)))


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
    angles, samples = attitude.part(work, step, _SEEDS)
    step("clipping")
    angles.append(chain.clipping(work))
    step("high-pass")
    angles.append(chain.high_pass(work, still.recording))
    step("temperature compensation")
    angles.append(chain.temperature(work))
    parts = [
        system(work, samples),
        (FIN.part("attitude", parts=[report for report, _ in angles]), [row for _, rows in angles for row in rows]),
        algorithm.part(work, step, _RECORDS),
        experiment.part(records),
        estimation.part(work, step, _RUNS),
    ]
    page = FIN.part("bionic_fin", seed=work.seed, parts=[report for report, _ in parts])
    return Paper(report=page, outcomes=[outcome for _, outcomes in parts for outcome in outcomes])
