"""Teaching arm: six units in ± sets, fuzzy and PI laws, a Kalman filter [HuangJiang]; and what an array can do.

Both tables of the paper are of simulations. With the noise that it states, its figures would be far smaller; they come
out with a noise that is assumed, which shows that they are possible and proves nothing. One run of each figure goes
through the bytes of the rig ``arm``; the statistics over many seeds are drawn directly.
"""

from collections.abc import Mapping
from typing import Final

from plumbob.arm.array import monitor
from plumbob.arm.array.paper import paper
from plumbob.core.units import dps
from plumbob.data import ImuData
from plumbob.data.array import ImuArray
from plumbob.door.calibrate import read_track
from plumbob.door.reading import read_array
from plumbob.papers.arm import faults, misprints, tables, teaching
from plumbob.papers.arm.drawings import Broken, BytesRun
from plumbob.papers.arm.page import Findings, report
from plumbob.papers.arm.simulated import AXES, REST, Over, assumed_noise, with_noise
from plumbob.papers.arm.tables import ANGLES, SCHEMES, SEEDS
from plumbob.papers.outcome import Outcome, Paper, PaperItem, at_least, at_most
from plumbob.papers.workspace import Work
from plumbob.reporting.style import Both
from plumbob.rotations import Frame

__all__ = ["ITEMS", "run"]

FEW: Final = 100
"""Seeds of what is beside the tables; the least that a figure may have."""
WATCHED: Final = 200
"""Seeds of the fault that has bars."""
_STEPS: Final = 11


def run(work: Work) -> Paper:
    """Run the paper: bytes, tables over many seeds, misprints, recovery, faults, and a teach-in.

    Parameters
    ----------
    work : Work
        Where its files go, and the seed of its runs through bytes; the statistics take seeds 1, 2, … each.
    """
    steps = work.steps(_STEPS)
    steps("six units through bytes")
    runs = {turns: through_bytes(work, turns=turns) for turns in (False, True)}
    steps(f"Table 1 over {SEEDS} seeds")
    rest = tables.measured(False, SEEDS)
    steps(f"Table 2 over {SEEDS} seeds")
    turn = tables.measured(True, SEEDS)
    outcomes = [
        outcome
        for turns, stats in ((False, rest), (True, turn))
        for outcome in tables.of_table(turns, stats, tables.least(turns, 2))
    ]
    steps("both at 100 Hz")
    few = {name: SCHEMES[name] for name in ("none", "pi", "fuzzy", "control")}
    fast = tables.measured(True, FEW, rate=100.0, schemes=few)
    steps("printed forms")
    printed, read = misprints.printed_forms(FEW, dict(rest), dict(turn)), misprints.inference()
    stated = misprints.stated(FEW)
    outcomes += [*stated, *misprints.outcomes(printed, read), *misprints.of_gain(), *misprints.once(dict(rest))]
    outcomes += [*misprints.iron(FEW), *misprints.combination(work.seed), *_of_fast(fast)]
    steps("recovery and design of the rules")
    recoveries = {name: tables.recovery(scheme) for name, scheme in tables.RECOVERIES.items()}
    designs = tables.designs(FEW)
    outcomes += tables.of_recovery(recoveries)
    steps("a unit that breaks, through bytes and moving")
    watched = [broken_at_rest(work), broken_in_motion(work.seed)]
    steps("faults at rest and in motion")
    detection, alarms = _faults(), _alarms()
    at_100 = {
        moving: faults.watched("biased", "gyr", moving=moving, seeds=FEW // 4, rate=100.0) for moving in (False, True)
    }
    outcomes += [*_of_faults(detection, alarms), *_of_hundred(at_100)]
    steps("every fault of every sensor")
    parity = {step: faults.parity_test(step, 1) for step in (0.0, 0.1, 0.2, 0.3, 0.5)}
    outcomes += _of_parity(parity)
    every = list(faults.every_fault(10))
    steps("teach-in through bytes")
    done = teaching.teach(work)
    outcomes += teaching.outcomes(done)
    steps("page")
    findings = Findings(
        runs,
        rest,
        turn,
        fast,
        printed,
        read,
        stated,
        recoveries,
        designs,
        watched,
        parity,
        every,
        done,
        FEW,
        SEEDS,
        WATCHED,
    )
    return Paper(report=report(findings, work.seed), outcomes=outcomes)


def through_bytes(work: Work, *, turns: bool) -> BytesRun:
    """One run of every scheme, and of Plumbob's filter, on what a session recorded of the rig's bytes."""
    taken = work.recorded(
        "arm",
        "turn" if turns else "rest",
        session=teaching.ALL,
        sensors="arm:turn" if turns else "arm:rest",
        scenario="arm",
        set={} if turns else {"turn": "0 deg"},
    )
    noise = assumed_noise(turns)
    array = with_noise(read_array(taken.recording, mounts="arm"), noise)
    track = read_track(taken.truth.with_stem(f"{taken.truth.stem}-u1"))  # u1 is aligned with the body
    tracks = {name: paper(array, frame=Frame.NED, scheme=scheme).q_nb for name, scheme in SCHEMES.items()}
    tracks["six"] = tables.body_attitude(array, noise)
    return BytesRun(array.t, track.q_nb, tracks)


def broken_at_rest(work: Work) -> Broken:
    """Six units at rest for 90 s through bytes, where 0.2 °/s is added to what one axis was read to say."""
    taken = work.recorded(
        "arm",
        "watch",
        session=teaching.ALL,
        sensors="arm:rest",
        scenario="arm",
        set={"turn": "0 deg", "time": f"{faults.DURATION:g} s"},
    )
    array = with_noise(read_array(taken.recording, mounts="arm"), REST)
    good = array.units["u3"]
    assert good.gyr is not None
    gyr = good.gyr.copy()
    rows = (array.t >= faults.SINCE) & (array.t < faults.UNTIL)
    gyr[rows, 0] += dps(0.2)
    bad = ImuData(good.t, gyr, good.acc, good.mag, meta=good.meta)
    array = ImuArray({**array.units, "u3": bad}, array.mounts)
    return Broken(array, monitor(array), "u3", faults.SINCE, faults.UNTIL, Both("at rest", "静止"))


def broken_in_motion(seed: int) -> Broken:
    """The same of units that turn with 60 °/s rms every other 20 s, drawn directly."""
    array, monitored, unit = faults.with_fault(seed, moving=True)
    return Broken(array, monitored, unit, faults.SINCE, faults.UNTIL, Both("moving", "运动"))


def _faults() -> dict[bool, faults.Watched]:
    return {moving: faults.watched("biased", "gyr", moving=moving, seeds=WATCHED) for moving in (False, True)}


def _alarms() -> dict[bool, int]:
    """The greatest count of false alarms in three hours, of three times that."""
    return {
        moving: max(faults.false_alarms(moving=moving, seed=seed) for seed in (7, 8, 9)) for moving in (False, True)
    }


def _of_faults(detection: Mapping[bool, faults.Watched], alarms: Mapping[bool, int]) -> list[Outcome]:
    made = []
    for moving, (en, zh), least, slow, most in (
        (False, ("at rest", "静止"), 99.0, 2.0, 0.0),
        (True, ("moving", "运动"), 95.0, 5.0, 1.0),
    ):
        case, stats = ("moving" if moving else "rest"), detection[moving]
        for key, what, chinese, unit, value, bar in (
            ("detected", "detected", "检出率", "%", stats.detected, at_least(99.0)),
            ("isolated", "isolated", "隔离率", "%", stats.isolated, at_least(least)),
            ("median", "median time", "中位时间", "s", stats.median, at_most(slow)),
            ("slow", "time that 95 % stay below", "95 % 时间", "s", stats.slow, at_most(5.0)),
            (
                "alarms",
                "false alarms in 3 h, greatest of three",
                "3 h 内误报，三次中最大",
                "",
                float(alarms[moving]),
                at_most(most),
            ),
        ):
            made.append(
                Outcome(
                    key=f"fault.{case}.{key}",
                    where="",
                    unit=unit,
                    best=value,
                    best_bar=bar,
                    what=Both(
                        f"fault of 0.2 °/s on a gyroscope axis, {en}: {what}", f"陀螺仪轴 0.2 °/s 故障，{zh}：{chinese}"
                    ),
                )
            )
    says, out = faults.two_units()
    made.append(
        Outcome(
            key="fault.two",
            where="",
            best=float(says and not out),
            best_bar=at_least(1.0),
            what=Both(
                "two sensors on an axis: says 'cannot isolate', leaves none out (1)",
                "每轴两个传感器：报告“无法隔离”且不剔除（1）",
            ),
        )
    )
    return made


def _of_hundred(detection: Mapping[bool, faults.Watched]) -> list[Outcome]:
    return [
        Outcome(
            key=f"fault.{'moving' if moving else 'rest'}.100_hz",
            where="",
            unit="s",
            best=stats.median,
            best_bar=at_most(5.0 if moving else 2.0),
            what=Both(
                f"the same at 100 Hz, {'moving' if moving else 'at rest'}: median time",
                f"同上，100 Hz，{'运动' if moving else '静止'}：中位时间",
            ),
        )
        for moving, stats in detection.items()
    ]


def _of_parity(parity: Mapping[float, faults.Parity]) -> list[Outcome]:
    made = [
        Outcome(
            key="parity.alarms",
            where="",
            best=float(parity[0.0].found),
            best_bar=at_most(0.0),
            what=Both(
                "test of the parity of a pair: false alarms in 200 × 60 s", "一对轴的奇偶检验：200 × 60 s 内误报"
            ),
        )
    ]
    for step, test in list(parity.items())[1:]:
        made.append(
            Outcome(
                key=f"parity.{step:g}",
                where="",
                unit="s",
                best=test.median,
                what=Both(
                    f"the same, step of {step:g} °/s: median time ({test.found} of 200 found)",
                    f"同上，{step:g} °/s 阶跃：中位时间（200 次检出 {test.found}）",
                ),
            )
        )
    return made


def _of_fast(fast: Mapping[str, Over]) -> list[Outcome]:
    return [
        Outcome(
            key=f"hundred.fuzzy.{axis}",
            where="",
            unit="°",
            faithful=fast["fuzzy"].std[i],
            best=fast["six"].std[i],
            what=Both(f"std in the turn at 100 Hz, fuzzy-PI, {axis}", f"100 Hz 动态标准差，模糊 PI，{ANGLES[axis].zh}"),
        )
        for i, axis in enumerate(AXES)
    ]


ITEMS: Final[tuple[PaperItem, ...]] = (
    PaperItem(
        where="§0",
        what="teaching by hand: a program for a robot from units on an arm",
        by="`plumbob arm align`, `plumbob arm run`, `plumbob arm export`, `plumbob arm replay`; [teach.angles.rms], "
        "[teach.hand.rms], [teach.program], [teach.replay]",
    ),
    PaperItem(
        where="§1, (1)–(3)",
        what="attitude as a quaternion, as a matrix and as Euler angles; frame 'E-N-D'",
        by="`src/plumbob/rotations/quaternions.py`; NED instead of the left-handed frame: [misprint.sign]",
    ),
    PaperItem(
        where="(4)–(12)",
        what="roll, pitch and yaw by accelerometers and magnetometers, of one unit and of the combined "
        "measurements with their noise; quaternion to start from",
        by="`src/plumbob/filters/tilt_compass.py`; `src/plumbob/arm/array/paper.py` (run), its first row; "
        "`src/plumbob/filters/start.py`",
    ),
    PaperItem(
        where="§2, Fig 1",
        what="structure of the whole algorithm",
        by="`src/plumbob/arm/array/paper.py`, table on the page",
    ),
    PaperItem(
        where="§2, Fig 2",
        what="six units on ± axes, the signs of both sets",
        by="`plumbob emulate arm`, `src/plumbob/arm/array/paper.py`; [pair.bias], [pair.noise], [pair.parity]",
    ),
    PaperItem(
        where="(13), (14)",
        what="complementary filter with a gain K",
        by="`src/plumbob/filters/fuzzy_pi.py`; [gain.corner]",
    ),
    PaperItem(
        where="(15)–(17)",
        what="errors by vector products, one for each set",
        by="`src/plumbob/arm/array/paper.py` (error_of); formed at the predicted attitude: [misprint.late]",
    ),
    PaperItem(
        where="(18)",
        what="fuzzy regulator of set 1, from the error and its integral",
        by="`src/plumbob/filters/fuzzy_pi.py` (regulate); [misprint.units.deg], "
        "[misprint.units.rad], [misprint.units.rad.recovery]",
    ),
    PaperItem(
        where="(19)",
        what="PI regulator of set 2, P = 0.8, I = 0.02",
        by="`src/plumbob/arm/array/paper.py` (law); [recovery.control]",
    ),
    PaperItem(
        where="(20)",
        what="rate of the body as the mean of both sets, of opposite mounting",
        by="`src/plumbob/arm/array/paper.py` (run); [misprint.raw.rate], [misprint.raw.yaw]",
    ),
    PaperItem(
        where="(21)–(27), §4",
        what="EKF on the quaternion: state equation, measurement equation of two directions of units 1 to 3, Q = "
        "0.0001 I3, R = 0.001 I6, P0 = 0.001 I4",
        by="`src/plumbob/filters/ekf_quaternion.py` (predict, correct_direction, and its defaults), "
        "`src/plumbob/arm/array/paper.py` (paper); [once.roll], [once.pitch], [once.yaw]",
    ),
    PaperItem(
        where="§4",
        what="noise of the sensors: 0.1 mg, 0.1 °/h, 50 nT; independent",
        by="[stated.none], [stated.pi], [stated.fuzzy]",
    ),
    PaperItem(
        where="§4",
        what="motion below 15 Hz, K = 0.8, Ts = 0.1 s, 30 s",
        by="[gain.corner], [gain.needed], [gain.nyquist], [misprint.gain], [hundred.fuzzy.yaw]",
    ),
    PaperItem(
        where="§4",
        what="factors 3, 1, 1, universes ±6, ±3, ±9, triangles, and a table of rules by experience",
        by="`src/plumbob/filters/fuzzy_pi.py`; [inference.gain], [inference.reach], [inference.apart], "
        "[recovery.fuzzy], [recovery.sum]",
        reason="The paper does not print its table; the page compares three that fit its words.",
    ),
    PaperItem(
        where="Fig 3–5",
        what="errors at rest: one set without a regulator, with PI, and fuzzy-PI",
        by="Figures 3 to 5 on the page, through bytes",
    ),
    PaperItem(
        where="Table 1, Table 2",
        what="standard deviations at rest and in the turn, none, PI and fuzzy-PI",
        by="[static.none.roll], [static.pi.roll], [static.fuzzy.roll], [turn.none.roll], [turn.pi.roll], "
        "[turn.fuzzy.roll] and so on for pitch and yaw; yaw in the turn with PI: [turn.pi.yaw], [iron.pi], "
        "[iron.control]",
    ),
    PaperItem(
        where="Table 1, Table 2",
        what="ranges of the errors",
        by="[static.fuzzy.range.roll], [turn.fuzzy.range.roll] and so on",
        reason="The text that is left of the paper has not the figures of this column: ours stand alone.",
    ),
    PaperItem(
        where="§4",
        what="fuzzy-PI is better than PI, at rest and in the turn, there most of all in yaw",
        by="[static.fuzzy_over_pi.yaw], [turn.fuzzy_over_pi.yaw], and the controls [static.control.yaw], "
        "[turn.control.yaw]",
    ),
    PaperItem(where="Fig 6", what="yaw from 0° to −90°", by="Figure 6 on the page, through bytes"),
    PaperItem(
        where="Fig 7–9",
        what="errors in the turn: one set without a regulator, with PI, and fuzzy-PI",
        by="Figures 7 to 9 on the page, through bytes",
    ),
    PaperItem(
        where="§5",
        what="quick by the rules, exact by PI",
        by="[recovery.fuzzy], [recovery.control], [recovery.sum], table of designs",
    ),
    PaperItem(
        where="§5",
        what="six units reduce the errors of one and make it stable",
        by="[static.two.roll], [static.fuzzy.roll], [fault.rest.isolated], "
        "[fault.moving.isolated], [fault.two], [parity.0.2]",
    ),
)
