"""Drifting buoy [Yu2018]: boot, calibration, static test, slide and sea; one unit through bytes, and many beside."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from plumbob.core.units import deg
from plumbob.papers.buoy import bench
from plumbob.papers.buoy.as_printed import GATES, KP, misprints
from plumbob.papers.buoy.bench import run_device
from plumbob.papers.buoy.modules import (
    DEGENERATE,
    WIDE_STEP,
    CaptureRow,
    by_choice,
    by_ellipsoid,
    mag_alone,
    measure_degenerate,
    measure_ring,
)
from plumbob.papers.buoy.page import KPS, SCANNED, Results, paper
from plumbob.papers.outcome import Paper
from plumbob.papers.workspace import Work

MODULES: Final = 200
UNITS: Final = 20
SEAS: Final = 3
OFFERED: Final = 50
"""How many modules are turned on the table, units slid, seas sailed, and degenerate captures offered."""
DURATION: Final = 600.0
"""Of a sea, s."""
_LONGER: Final = (0.4, 0.6, 0.8, 1.0, 1.3, 1.6)
ROWS: Final[Mapping[str, CaptureRow]] = {
    "pitch": CaptureRow("pitch"),
    "roll": CaptureRow("roll"),
    "faces": CaptureRow(),
    "pitch, chosen": CaptureRow("pitch", by_choice),
    "roll, chosen": CaptureRow("roll", by_choice),
    "faces, chosen": CaptureRow(fit=by_choice),
    "magnetometer alone": CaptureRow(fit=mag_alone),
    "tilt 40°": CaptureRow(tilt=deg(40.0)),
    "step 4.35 mG": CaptureRow(step=WIDE_STEP),
    "c 0.02": CaptureRow(c=0.02),
    "c 0.05": CaptureRow(c=0.05),
    "c 0.1": CaptureRow(c=0.1),
    "c 0.1, general": CaptureRow(c=0.1, fit=by_ellipsoid),
}
"""Rows of the table of captures and fits."""


def run(work: Work) -> Paper:
    """Run the paper."""
    return paper(measured(work), work.seed)


def measured(
    work: Work, *, modules: int = MODULES, units: int = UNITS, seas: int = SEAS, offered: int = OFFERED,
    duration: float = DURATION,
) -> Results:  # fmt: skip
    """Everything that the page says; with fewer seeds and a shorter sea, s, where asked."""
    say = work.steps(6 + len(ROWS) + len(bench.STROKES))
    say("capture and calibration")
    unit = bench.calibrated(work)
    say("firmware")
    device = run_device(work, unit.paper)
    say("static test and slides")
    static, slid = bench.ring(work, unit), bench.slides(work, unit)
    say("sea")
    sailed = bench.sail(work, unit, {**bench.SEA, "smoother": bench.SMOOTHER}, duration)
    rings = {}
    for name, row in ROWS.items():
        say(f"{modules} modules: {name}")
        rings[name] = measure_ring(row, work.seeds(modules))
    slides = {}
    for speed, stroke in bench.STROKES:
        say(f"{units} units slid: {speed:g} m/s, {stroke:g} s")
        slides[speed, stroke] = bench.slide(speed, stroke, work.seeds(units))
    say(f"{seas} seas")
    sea = bench.sea(work.seeds(seas), duration)
    say("gains and misprints")
    forms = misprints(rings["step 4.35 mG"].yaw, rings["faces"].yaw)
    scan = {
        pair: np.stack([bench.gain_scan(KPS, *pair, gate=gate, seed=work.seed) for gate in ("off", GATES[0])], axis=2)
        for pair in SCANNED
    }
    strongest = max(bench.gain_scan((KP,), 3.0, stroke, gate="off", seed=work.seed)[0][0] for stroke in _LONGER)
    refused = {name: measure_degenerate(name, work.seeds(offered)) for name in DEGENERATE}
    return Results(unit, device, static, slid, sailed, rings, refused, slides, sea, scan, strongest, forms, modules)
