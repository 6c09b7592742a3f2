"""Drifting buoy [Yu2018]: boot, calibration, static test, slide and sea; one unit through bytes, and many beside."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from plumbob.core.units import deg
from plumbob.papers.buoy import bench, trials
from plumbob.papers.buoy.as_printed import GATES, KP, misprints
from plumbob.papers.buoy.device import run_device
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
from plumbob.papers.buoy.outcomes import KPS, SCANNED, Results, outcomes
from plumbob.papers.buoy.page import page
from plumbob.papers.outcome import Paper, PaperItem
from plumbob.papers.workspace import Work

__all__ = ["ITEMS", "run"]


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
    results = measured(work)
    return Paper(report=page(results, work.seed), outcomes=outcomes(results))


def measured(
    work: Work, *, modules: int = MODULES, units: int = UNITS, seas: int = SEAS, offered: int = OFFERED,
    duration: float = DURATION,
) -> Results:  # fmt: skip
    """Everything that the page says; with fewer seeds and a shorter sea, s, where asked."""
    say = work.steps(6 + len(ROWS) + len(trials.STROKES))
    say("capture and calibration")
    unit = bench.calibrated(work)
    say("firmware")
    device = run_device(work, unit.paper)
    say("static test and slides")
    static, slid = bench.ring(work, unit), bench.slides(work, unit)
    say("sea")
    sailed = bench.sail(work, unit, {**trials.SEA, "smoother": bench.SMOOTHER}, duration)
    rings = {}
    for name, row in ROWS.items():
        say(f"{modules} modules: {name}")
        rings[name] = measure_ring(row, work.seeds(modules))
    slides = {}
    for speed, stroke in trials.STROKES:
        say(f"{units} units slid: {speed:g} m/s, {stroke:g} s")
        slides[speed, stroke] = trials.slide(speed, stroke, work.seeds(units))
    say(f"{seas} seas")
    sea = trials.sea(work.seeds(seas), duration)
    say("gains and misprints")
    scan = {
        pair: np.stack([trials.gain_scan(KPS, *pair, gate=gate, seed=work.seed) for gate in ("off", GATES[0])], axis=2)
        for pair in SCANNED
    }
    strongest = max(trials.gain_scan((KP,), 3.0, stroke, gate="off", seed=work.seed)[0][0] for stroke in _LONGER)
    refused = {name: measure_degenerate(name, work.seeds(offered)) for name in DEGENERATE}
    return Results(
        unit, device, static, slid, sailed, rings, refused, slides, sea, scan, strongest, misprints(), modules
    )


ITEMS: Final = (
    PaperItem(
        where="§0",
        what="tilt as a basis for quality control, calibration and compensation of sea-surface observations",
        by="`plumbob report`: tilt statistics and quality flags by burst; [sea.roll], [sea.pitch]",
    ),
    PaperItem(
        where="§0",
        what="low cost, low power, months to a year at sea",
        by="[events.idle], [log.years]; `plumbob record`",
    ),
    PaperItem(
        where="§1.1, Fig 1",
        what="body and navigation frame, roll, pitch and yaw, order Z-X-Y by the text",
        by="`src/plumbob/rotations/frames.py`; [literal.order]",
    ),
    PaperItem(
        where="(1), (4) to (6)",
        what="attitude quaternion of axis and angle, and the Euler angles of it",
        by="`src/plumbob/rotations/quaternions.py`; `src/plumbob/papers/buoy/as_printed.py`; [literal.arctan]",
    ),
    PaperItem(
        where="(2), (3)",
        what="differential equation of the quaternion, first-order Runge-Kutta",
        by="`src/plumbob/filters/integrate_first_order.py`; [literal.rows], [literal.norm], [literal.lag.172], "
        "[literal.lag.573], [literal.lag.2000]",
    ),
    PaperItem(
        where="§1.2",
        what="initial attitude from gravity and magnetic north",
        by="`src/plumbob/filters/start.py`, filter tilt_compass; [static.after.yaw]",
    ),
    PaperItem(
        where="§1.3, Fig 2",
        what="complementary filter of the three sensors",
        by="`src/plumbob/filters/mahony.py`; [kp]",
    ),
    PaperItem(
        where="§1.3",
        what="errors by vector products of gravity and of magnetic north, their sum",
        by="`src/plumbob/filters/mahony.py`; [literal.modulus]",
    ),
    PaperItem(
        where="(7)",
        what="PI regulator that corrects the rate and learns the drift",
        by="`src/plumbob/filters/mahony.py`; [literal.pole.fast], [literal.pole.slow], [literal.zero_rate]",
    ),
    PaperItem(where="§1.3", what="gains Kp 0.5 and Ki 0.03 found by tests", by="[kp], [ki], [slide.bound], [sea.roll]"),
    PaperItem(
        where="§2.1, Fig 3",
        what="hardware: MSP430F5342, sensors on SPI, Flash, UART",
        by="rigs buoy and buoy_attitude of `plumbob emulate`; [events.missed], [log.same]",
    ),
    PaperItem(
        where="§2.1",
        what="MPU6000: ranges of rate and force, low-pass at its output",
        by="`src/plumbob/protocols/catalog/mpu6000.toml` has all of them and ±16 g; "
        "`src/plumbob/simulation/presets/mpu6000.toml`",
    ),
    PaperItem(
        where="§2.1",
        what="HMC5983: ±8 Ga, 0.73 mG, 200 Hz",
        by="`src/plumbob/protocols/catalog/hmc5983.toml`; [mag.step], [literal.step]; its greatest rate is 220 Hz",
    ),
    PaperItem(where="§2.1", what="attitude stored in Flash", by="[log.same], [log.years]; `plumbob decode --ring`"),
    PaperItem(
        where="§2.2, Fig 4",
        what="main loop that polls event flags, low power between them",
        by="`src/plumbob/live/rigs/firmware.py`; [events.missed], [events.idle]",
    ),
    PaperItem(
        where="§2.2",
        what="timer of 1 ms, events of 3, 10 and 50 ms: attitude at 100 Hz, on the line at 20 Hz",
        by="[rate.sample], [rate.fuse], [rate.send], [sea.output]",
    ),
    PaperItem(
        where="§3.1",
        what="linear calibration of the accelerometer by six faces, and by an ellipsoid the same way as the "
        "magnetometer",
        by="`plumbob calibrate accel --shape six`; `plumbob calibrate accel`; [modules.level], [modules.alone]",
    ),
    PaperItem(
        where="(8) to (13)",
        what="ellipsoid of six parameters, its linear form, least squares of six readings or more",
        by="`src/plumbob/calibration/ellipsoid/ellipsoid_fit.py`; [fewest], [modules.yaw.faces]",
    ),
    PaperItem(
        where="(14)",
        what="corrected and normalised field",
        by="`src/plumbob/calibration/ellipsoid/ellipsoid_fit.py`; [literal.normalised]",
    ),
    PaperItem(
        where="§3.1",
        what="capture of one reading in each of 18 regions of attitude; readings crowded in one place give a wrong "
        "ellipsoid",
        by="[regions], [modules.yaw.pitch], [modules.yaw.roll], [modules.yaw.faces]; guided by `plumbob "
        "calibrate mag --live`; [refused.ring], [refused.unit], [refused.table]",
    ),
    PaperItem(where="Fig 5", what="field before and after the fit", by="figure 5 of the page; [modules.iron]"),
    PaperItem(
        where="§3.2, (15)",
        what="gate on the length of the specific force, ε 0.08",
        by="[gate], [literal.gate.g], [literal.gate.si], [literal.gate.rest]",
    ),
    PaperItem(
        where="§4.1, Fig 6",
        what="turntable, host program that receives, shows a model and stores, later analysis",
        by="rig ring of `plumbob emulate`; `plumbob view`, `plumbob record`, `plumbob replay`; [sea.replay]",
    ),
    PaperItem(
        where="§4.2",
        what="DCM260B as a reference at rest: 0.8° and 0.2°; 36 steps of 10° on a tilted table",
        by="`src/plumbob/simulation/presets/dcm260b.toml`; `plumbob calibrate statictest`; [static.before.yaw]",
    ),
    PaperItem(
        where="Fig 7",
        what="errors of yaw, pitch and roll before and after, within 5°",
        by="[static.after.yaw], [static.after.pitch], [static.after.roll], [static.before.pitch], [static.before.roll]",
    ),
    PaperItem(
        where="§4.2",
        what="magnetic disturbance matters more than errors of the accelerometer",
        by="[static.before.yaw], [modules.alone]",
    ),
    PaperItem(
        where="§4.3, Fig 8",
        what="slide on a level desk: 9.6° and 6.1° without the gate, 3.3° and 2.7° with it",
        by="[slide.open.roll], [slide.open.pitch], [slide.gated.roll], [slide.gated.pitch], [slide.reduction.roll], "
        "[slide.reduction.pitch], [slide.unit.roll], [slide.unit.pitch], [device.roll], [device.pitch]",
    ),
    PaperItem(where="§5", what="attitude within ±5°", by="[claim], [modules.all5]"),
)
"""Items."""
