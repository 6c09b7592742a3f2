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
from plumbob.papers.arm.page import Broken, BytesRun, Findings, report
from plumbob.papers.arm.simulated import AXES, REST, Over, assumed_noise, with_noise
from plumbob.papers.arm.tables import SCHEMES, SEEDS
from plumbob.papers.description import ARM
from plumbob.papers.outcome import Outcome, Paper
from plumbob.papers.workspace import Work
from plumbob.rotations import Frame

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
        runs, rest, turn, fast, printed, read, stated, recoveries, designs, watched, parity, every, done, FEW, SEEDS,
        WATCHED,
    )  # fmt: skip
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
    return Broken(array, monitor(array), "u3", faults.SINCE, faults.UNTIL, ARM.text("at_rest"))


def broken_in_motion(seed: int) -> Broken:
    """The same of units that turn with 60 °/s rms every other 20 s, drawn directly."""
    array, monitored, unit = faults.with_fault(seed, moving=True)
    return Broken(array, monitored, unit, faults.SINCE, faults.UNTIL, ARM.text("moving"))


def _faults() -> dict[bool, faults.Watched]:
    return {moving: faults.watched("biased", "gyr", moving=moving, seeds=WATCHED) for moving in (False, True)}


def _alarms() -> dict[bool, int]:
    """The greatest count of false alarms in three hours, of three times that."""
    return {
        moving: max(faults.false_alarms(moving=moving, seed=seed) for seed in (7, 8, 9)) for moving in (False, True)
    }


def _of_faults(detection: Mapping[bool, faults.Watched], alarms: Mapping[bool, int]) -> list[Outcome]:
    made = []
    for moving, stats in detection.items():
        values = {name: getattr(stats, name) for name in ("detected", "isolated", "median", "slow")}
        for name, value in (values | {"alarms": float(alarms[moving])}).items():
            made.append(ARM.row(f"fault.{'moving' if moving else 'rest'}.{name}", best=value))
    says, out = faults.two_units()
    made.append(ARM.row("fault.two", best=float(says and (not out))))
    return made


def _of_hundred(detection: Mapping[bool, faults.Watched]) -> list[Outcome]:
    return [
        ARM.row(f"fault.{('moving' if moving else 'rest')}.100_hz", best=stats.median)
        for moving, stats in detection.items()
    ]


def _of_parity(parity: Mapping[float, faults.Parity]) -> list[Outcome]:
    made = [ARM.row("parity.alarms", best=float(parity[0.0].found))]
    for step, test in list(parity.items())[1:]:
        made.append(ARM.row(f"parity.{step:g}", best=test.median, found=test.found))
    return made


def _of_fast(fast: Mapping[str, Over]) -> list[Outcome]:
    return [
        ARM.row(f"hundred.fuzzy.{axis}", faithful=fast["fuzzy"].std[i], best=fast["six"].std[i])
        for i, axis in enumerate(AXES)
    ]
