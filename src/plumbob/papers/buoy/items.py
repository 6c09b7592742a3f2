"""Everything that the buoy paper describes, states or shows [Yu2018], in its order, and where it is done."""

from typing import Final

from plumbob.papers.outcome import Item

ITEMS: Final = (
    Item(
        where="§0",
        what="tilt as a basis for quality control, calibration and compensation of sea-surface observations",
        by="`plumbob report`: tilt statistics and quality flags by burst; [sea.roll], [sea.pitch]",
    ),
    Item(
        where="§0",
        what="low cost, low power, months to a year at sea",
        by="[events.idle], [log.years]; `plumbob record`",
    ),
    Item(
        where="§1.1, Fig 1",
        what="body and navigation frame, roll, pitch and yaw, order Z-X-Y by the text",
        by="`src/plumbob/rotations/frames.py`; [literal.order]",
    ),
    Item(
        where="(1), (4) to (6)",
        what="attitude quaternion of axis and angle, and the Euler angles of it",
        by="`src/plumbob/rotations/quaternions.py`; `src/plumbob/papers/buoy/literal.py`; [literal.arctan]",
    ),
    Item(
        where="(2), (3)",
        what="differential equation of the quaternion, first-order Runge-Kutta",
        by="`src/plumbob/filters/integrate_first_order.py`; [literal.rows], [literal.norm], [literal.lag.172], "
        "[literal.lag.573], [literal.lag.2000]",
    ),
    Item(
        where="§1.2",
        what="initial attitude from gravity and magnetic north",
        by="`src/plumbob/filters/start.py`, filter tilt_compass; [static.after.yaw]",
    ),
    Item(
        where="§1.3, Fig 2",
        what="complementary filter of the three sensors",
        by="`src/plumbob/filters/mahony.py`; [kp]",
    ),
    Item(
        where="§1.3",
        what="errors by vector products of gravity and of magnetic north, their sum",
        by="`src/plumbob/filters/mahony.py`; [literal.modulus]",
    ),
    Item(
        where="(7)",
        what="PI regulator that corrects the rate and learns the drift",
        by="`src/plumbob/filters/mahony.py`; [literal.pole.fast], [literal.pole.slow], [literal.zero_rate]",
    ),
    Item(where="§1.3", what="gains Kp 0.5 and Ki 0.03 found by tests", by="[kp], [ki], [slide.bound], [sea.roll]"),
    Item(
        where="§2.1, Fig 3",
        what="hardware: MSP430F5342, sensors on SPI, Flash, UART",
        by="rigs buoy and buoy_attitude of `plumbob emulate`; [events.missed], [log.same]",
    ),
    Item(
        where="§2.1",
        what="MPU6000: ranges of rate and force, low-pass at its output",
        by="`src/plumbob/protocols/catalog/mpu6000.toml` has all of them and ±16 g; "
        "`src/plumbob/simulation/presets/mpu6000.toml`",
    ),
    Item(
        where="§2.1",
        what="HMC5983: ±8 Ga, 0.73 mG, 200 Hz",
        by="`src/plumbob/protocols/catalog/hmc5983.toml`; [mag.step], [literal.step]; its greatest rate is 220 Hz",
    ),
    Item(where="§2.1", what="attitude stored in Flash", by="[log.same], [log.years]; `plumbob decode --ring`"),
    Item(
        where="§2.2, Fig 4",
        what="main loop that polls event flags, low power between them",
        by="`src/plumbob/simulation/rigs/firmware.py`; [events.missed], [events.idle]",
    ),
    Item(
        where="§2.2",
        what="timer of 1 ms, events of 3, 10 and 50 ms: attitude at 100 Hz, on the line at 20 Hz",
        by="[rate.sample], [rate.fuse], [rate.send], [sea.output]",
    ),
    Item(
        where="§3.1",
        what="linear calibration of the accelerometer by six faces, and by an ellipsoid the same way as the "
        "magnetometer",
        by="`plumbob calibrate accel --shape six`; `plumbob calibrate accel`; [modules.level], [modules.alone]",
    ),
    Item(
        where="(8) to (13)",
        what="ellipsoid of six parameters, its linear form, least squares of six readings or more",
        by="`src/plumbob/calibration/ellipsoid/ellipsoid_fit.py`; [fewest], [modules.yaw.faces]",
    ),
    Item(
        where="(14)",
        what="corrected and normalised field",
        by="`src/plumbob/calibration/ellipsoid/ellipsoid_fit.py`; [literal.normalised]",
    ),
    Item(
        where="§3.1",
        what="capture of one reading in each of 18 regions of attitude; readings crowded in one place give a wrong "
        "ellipsoid",
        by="[regions], [modules.yaw.pitch], [modules.yaw.roll], [modules.yaw.faces]; guided by `plumbob "
        "calibrate mag --live`; [refused.ring], [refused.unit], [refused.table]",
    ),
    Item(where="Fig 5", what="field before and after the fit", by="figure 5 of the page; [modules.iron]"),
    Item(
        where="§3.2, (15)",
        what="gate on the length of the specific force, ε 0.08",
        by="[gate], [literal.gate.g], [literal.gate.si], [literal.gate.rest]",
    ),
    Item(
        where="§4.1, Fig 6",
        what="turntable, host program that receives, shows a model and stores, later analysis",
        by="rig ring of `plumbob emulate`; `plumbob view`, `plumbob record`, `plumbob replay`; [sea.replay]",
    ),
    Item(
        where="§4.2",
        what="DCM260B as a reference at rest: 0.8° and 0.2°; 36 steps of 10° on a tilted table",
        by="`src/plumbob/simulation/presets/dcm260b.toml`; `plumbob calibrate statictest`; [static.before.yaw]",
    ),
    Item(
        where="Fig 7",
        what="errors of yaw, pitch and roll before and after, within 5°",
        by="[static.after.yaw], [static.after.pitch], [static.after.roll], [static.before.pitch], [static.before.roll]",
    ),
    Item(
        where="§4.2",
        what="magnetic disturbance matters more than errors of the accelerometer",
        by="[static.before.yaw], [modules.alone]",
    ),
    Item(
        where="§4.3, Fig 8",
        what="slide on a level desk: 9.6° and 6.1° without the gate, 3.3° and 2.7° with it",
        by="[slide.open.roll], [slide.open.pitch], [slide.gated.roll], [slide.gated.pitch], [slide.reduction.roll], "
        "[slide.reduction.pitch], [slide.unit.roll], [slide.unit.pitch], [device.roll], [device.pitch]",
    ),
    Item(where="§5", what="attitude within ±5°", by="[claim], [modules.all5]"),
)
"""Items."""
