"""The fin paper [Ou2017]: attitude of a bionic fin by two MEMS gyroscopes, and their noise by Allan variance."""

from pathlib import Path
from typing import Final

import numpy as np

from plumbob.core.units import to_dps
from plumbob.papers.description import FIN
from plumbob.papers.fin import algorithm, attitude, estimation, experiment
from plumbob.papers.fin.records import COUNT, RATE
from plumbob.papers.outcome import Paper, Part
from plumbob.papers.workspace import Work
from plumbob.protocols.decode import decode
from plumbob.protocols.format_toml import find_format

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


def system(work: Work, samples: int) -> Part:
    """Sensors and rates; a record of 220 s had `samples` when it was decoded."""
    fields = {field.name: field for field in find_format("fin").bind().messages[0].fields}
    z, x = fields["gyr.z"], fields["gyr.x"]
    outcomes = FIN.rows(
        {
            "system.counts.453": 1.0 / float(to_dps(abs(z.scale))),
            "system.counts.290": 1.0 / float(to_dps(abs(x.scale))),
            "system.range.453": float(to_dps(z.full_scale)),
            "system.range.290": float(to_dps(x.full_scale)),
            "system.rate": samples / (COUNT / RATE),
            "system.samples": float(samples),
            "system.word": word(work.folder, "s16"),
            "misprint.unsigned": word(work.folder, "u16"),
        }
    )
    return FIN.part("system", tables=[FIN.table("figures_2_and")]), outcomes


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
    angles, samples = attitude.part(work, step, _SEEDS, still.recording)
    parts = [
        system(work, samples),
        angles,
        algorithm.part(work, step, _RECORDS),
        experiment.part(records),
        estimation.part(work, step, _RUNS),
    ]
    page = FIN.part("bionic_fin", seed=work.seed, parts=[report for report, _ in parts])
    return Paper(report=page, outcomes=[outcome for _, outcomes in parts for outcome in outcomes])
