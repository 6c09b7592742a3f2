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
        where="(4)–(12)",
        what="roll, pitch and yaw by accelerometers and magnetometers, of one unit and of the combined "
        "measurements with their noise; quaternion to start from",
        by="`src/plumbob/filters/tilt_compass.py`; `src/plumbob/array/paper.py` (run), its first row; "
        "`src/plumbob/filters/start.py`",
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
        where="(21)–(27), §4",
        what="EKF on the quaternion: state equation, measurement equation of two directions of units 1 to 3, Q = "
        "0.0001 I3, R = 0.001 I6, P0 = 0.001 I4",
        by="`src/plumbob/filters/ekf_quaternion.py` (predict, correct_direction, and its defaults), "
        "`src/plumbob/array/paper.py` (paper); [once.roll], [once.pitch], [once.yaw]",
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
        what="factors 3, 1, 1, universes ±6, ±3, ±9, triangles, and a table of rules by experience",
        by="`src/plumbob/filters/fuzzy_pi.py`; [inference.gain], [inference.reach], [inference.apart], "
        "[recovery.fuzzy], [recovery.sum]",
        reason="The paper does not print its table; the page compares three that fit its words.",
    ),
    Item(
        where="Fig 3–5",
        what="errors at rest: one set without a regulator, with PI, and fuzzy-PI",
        by="Figures 3 to 5 on the page, through bytes",
    ),
    Item(
        where="Table 1, Table 2",
        what="standard deviations at rest and in the turn, none, PI and fuzzy-PI",
        by="[static.none.roll], [static.pi.roll], [static.fuzzy.roll], [turn.none.roll], [turn.pi.roll], "
        "[turn.fuzzy.roll] and so on for pitch and yaw; yaw in the turn with PI: [turn.pi.yaw], [iron.pi], "
        "[iron.control]",
    ),
    Item(
        where="Table 1, Table 2",
        what="ranges of the errors",
        by="[static.fuzzy.range.roll], [turn.fuzzy.range.roll] and so on",
        reason="The text that is left of the paper has not the figures of this column: ours stand alone.",
    ),
    Item(
        where="§4",
        what="fuzzy-PI is better than PI, at rest and in the turn, there most of all in yaw",
        by="[static.fuzzy_over_pi.yaw], [turn.fuzzy_over_pi.yaw], and the controls [static.control.yaw], "
        "[turn.control.yaw]",
    ),
    Item(where="Fig 6", what="yaw from 0° to −90°", by="Figure 6 on the page, through bytes"),
    Item(
        where="Fig 7–9",
        what="errors in the turn: one set without a regulator, with PI, and fuzzy-PI",
        by="Figures 7 to 9 on the page, through bytes",
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
