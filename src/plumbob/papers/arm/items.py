"""Everything that the paper describes, states or shows, and where it is done."""

from typing import Final

from plumbob.papers.outcome import Item

ITEMS: Final[tuple[Item, ...]] = (
    Item(
        where="§0",
        what="teaching by hand: a program for a robot from units on an arm",
        by="`plumbob arm align`, `plumbob arm run`, `plumbob arm export`, `plumbob arm replay`; [teach.angles.rms], "
        "[teach.hand.rms], [teach.program], [teach.replay]",
    ),
    Item(
        where="§1, (1)–(3)",
        what="attitude as a quaternion, as a matrix and as Euler angles; frame 'E-N-D'",
        by="`src/plumbob/rotations/quaternions.py`; NED instead of the left-handed frame: [misprint.sign]",
    ),
    Item(
        where="(4)–(6)",
        what="roll, pitch and yaw by accelerometers and magnetometers",
        by="`src/plumbob/filters/tilt_compass.py`",
    ),
    Item(
        where="§2, Fig 1", what="structure of the whole algorithm", by="`src/plumbob/array/paper.py`, table on the page"
    ),
    Item(
        where="§2, Fig 2",
        what="six units on ± axes, the signs of both sets",
        by="`plumbob emulate arm`, `src/plumbob/array/paper.py` (sets_of); [pair.bias], [pair.noise], [pair.parity]",
    ),
    Item(
        where="(7)–(11)",
        what="roll, pitch and yaw from the combined measurements, with their noise",
        by="`src/plumbob/array/paper.py` (run), its first row",
    ),
    Item(where="(12)", what="quaternion to start from", by="`src/plumbob/filters/start.py`"),
    Item(
        where="(13), (14)",
        what="complementary filter with a gain K",
        by="`src/plumbob/filters/fuzzy_pi.py`; [gain.corner]",
    ),
    Item(
        where="(15)–(17)",
        what="errors by vector products, one for each set",
        by="`src/plumbob/array/paper.py` (error_of); formed at the predicted attitude: [misprint.late]",
    ),
    Item(
        where="(18)",
        what="fuzzy regulator of set 1, from the error and its integral",
        by="`src/plumbob/filters/fuzzy_pi.py` (regulate); [misprint.units.deg], "
        "[misprint.units.rad], [misprint.units.rad.recovery]",
    ),
    Item(
        where="(19)",
        what="PI regulator of set 2, P = 0.8, I = 0.02",
        by="`src/plumbob/array/paper.py` (law); [recovery.control]",
    ),
    Item(
        where="(20)",
        what="rate of the body as the mean of both sets, of opposite mounting",
        by="`src/plumbob/array/paper.py` (run); [misprint.raw.rate], [misprint.raw.yaw]",
    ),
    Item(
        where="(21)–(23)",
        what="state equation of the EKF on the quaternion",
        by="`src/plumbob/filters/ekf_quaternion.py` (predict)",
    ),
    Item(
        where="(24)–(27)",
        what="measurement equation: two directions of units 1 to 3",
        by="`src/plumbob/filters/ekf_quaternion.py` (correct_direction); [once.roll], [once.pitch], [once.yaw]",
    ),
    Item(
        where="§4",
        what="noise of the sensors: 0.1 mg, 0.1 °/h, 50 nT; independent",
        by="[stated.none], [stated.pi], [stated.fuzzy]",
    ),
    Item(
        where="§4",
        what="motion below 15 Hz, K = 0.8, Ts = 0.1 s, 30 s",
        by="[gain.corner], [gain.needed], [gain.nyquist], [misprint.gain], [hundred.fuzzy.yaw]",
    ),
    Item(
        where="§4",
        what="factors 3, 1, 1, universes ±6, ±3, ±9, triangles, a table of rules by experience",
        by="`src/plumbob/filters/fuzzy_pi.py`; [inference.gain], "
        "[inference.reach], [inference.apart], [recovery.fuzzy], [recovery.sum]",
    ),
    Item(
        where="§4",
        what="rules themselves",
        reason="The paper does not print its table; the page compares three that fit its words.",
    ),
    Item(
        where="§4",
        what="Q = 0.0001 I3, R = 0.001 I6, P0 = 0.001 I4",
        by="`src/plumbob/array/paper.py` (paper), and the defaults of `src/plumbob/filters/ekf_quaternion.py`",
    ),
    Item(where="Fig 3", what="errors at rest, one set without a regulator", by="Figure 3 on the page, through bytes"),
    Item(where="Fig 4", what="errors at rest with PI", by="Figure 4 on the page, through bytes"),
    Item(where="Fig 5", what="errors at rest with fuzzy-PI", by="Figure 5 on the page, through bytes"),
    Item(
        where="Table 1",
        what="standard deviations at rest, none, PI and fuzzy-PI",
        by="[static.none.roll], [static.pi.roll], [static.fuzzy.roll] and so on for pitch and yaw",
    ),
    Item(
        where="Table 1, Table 2",
        what="ranges of the errors",
        by="[static.fuzzy.range.roll], [turn.fuzzy.range.roll] and so on",
        reason="The text that is left of the paper has not the figures of this column: ours stand alone.",
    ),
    Item(
        where="§4",
        what="fuzzy-PI is better than PI at rest",
        by="[static.fuzzy_over_pi.yaw], and the control [static.control.yaw]",
    ),
    Item(where="Fig 6", what="yaw from 0° to −90°", by="Figure 6 on the page, through bytes"),
    Item(
        where="Fig 7", what="errors in the turn, one set without a regulator", by="Figure 7 on the page, through bytes"
    ),
    Item(where="Fig 8", what="errors in the turn with PI", by="Figure 8 on the page, through bytes"),
    Item(where="Fig 9", what="errors in the turn with fuzzy-PI", by="Figure 9 on the page, through bytes"),
    Item(
        where="Table 2",
        what="standard deviations in the turn",
        by="[turn.none.roll], [turn.pi.roll], [turn.fuzzy.roll] and so "
        "on; yaw with PI: [turn.pi.yaw], [iron.pi], [iron.control]",
    ),
    Item(
        where="§4",
        what="fuzzy-PI is better than PI in the turn, most of all in yaw",
        by="[turn.fuzzy_over_pi.yaw], and the control [turn.control.yaw]",
    ),
    Item(
        where="§5",
        what="quick by the rules, exact by PI",
        by="[recovery.fuzzy], [recovery.control], [recovery.sum], table of designs",
    ),
    Item(
        where="§5",
        what="six units reduce the errors of one and make it stable",
        by="[static.two.roll], [static.fuzzy.roll], [fault.rest.isolated], "
        "[fault.moving.isolated], [fault.two], [parity.0.2]",
    ),
)
