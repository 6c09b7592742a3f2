"""A unit that breaks: what the monitor of the array finds, when, and what it says without a reason."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.arm.array import monitor
from plumbob.arm.array.monitoring import Monitored
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.units import dps, to_dps
from plumbob.data import ImuData
from plumbob.data.array import ImuArray
from plumbob.door.reading import read_array
from plumbob.papers.arm.simulated import ALL, MOUNTS, REST, card, felt, time_axis, with_noise
from plumbob.papers.description import ARM
from plumbob.papers.outcome import Part
from plumbob.papers.workspace import Work
from plumbob.reporting.content import SERIES, SHADE, SOFT, Both
from plumbob.rotations.quaternions import quat_chained

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

SCALE: Final = 0.003
"""Scale errors of the units, and angles between their axes."""
KINDS: Final = ARM.texts("kinds")
STEP: Final = {"gyr": dps(0.2), "acc": 0.3, "mag": 2.0}
"""Bias of a broken axis: rad/s, m/s², µT."""
LONG: Final = 3 * 3600.0
AT_100: Final = 25
"""Arrays that are watched at 100 Hz, at most."""
_WATCHED: Final = ("detected", "isolated", "median", "slow")
DURATION: Final = 90.0
SINCE, UNTIL = 31.0, 60.0
"""When a fault begins, in the second of rest after a motion or in its middle, and when it ends, s."""

Body = dict[str, dict[str, Floats]]


def moved(seed: int, duration: float, *, moving: bool, rate: float = 10.0, units: int = 6) -> Body:
    """Values of units at rest, or turning with 60 °/s rms every other 20 s, by unit and triad; `t` and `truth` too.

    At another rate than 10 Hz the scatter of a sample is larger by its root: the noise over time is the same.
    """
    rng, count = np.random.default_rng(seed), round(duration * rate)
    t, rates = np.arange(count) / rate, np.zeros((count, 3))
    if moving:
        from scipy.signal import lfilter

        keep = np.exp(-1.0 / rate / 0.5)  # as an arm does, correlated over half a second
        on = (np.floor(t / 20.0) % 2 == 1)[:, np.newaxis]
        rates = dps(60.0) * lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=(count, 3)), axis=0) * on
    q_nb = quat_chained(rates / rate)[-count:] if moving else np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    body, mounts = felt(q_nb, rates), list(MOUNTS.values())
    signals: Body = {"truth": {"q_nb": q_nb, "t": t}}
    for u in range(units):
        of = {}
        for name, values in body.items():
            errors = np.eye(3) + SCALE * rng.normal(size=(3, 3))
            scatter = getattr(REST, name) * np.sqrt(rate / 10.0) * rng.normal(size=(count, 3))
            of[name] = (values @ mounts[u % 6].dcm) @ errors.T + scatter
        of["gyr"] = of["gyr"] + rng.uniform(-REST.bias, REST.bias, 3)
        signals[f"u{u + 1}"] = of
    return signals


def as_array(body: Body) -> ImuArray:
    """Array of `moved`."""
    t, mounts = body["truth"]["t"], list(MOUNTS.values())
    units = {name: ImuData(t, of["gyr"], of["acc"], of["mag"]) for name, of in body.items() if name != "truth"}
    noise_card = card(REST, 10.0)
    return ImuArray(units, {name: replace(mounts[k % 6], noise=noise_card) for k, name in enumerate(units)})


def broken(kind: str, triad: str, values: Floats, rows: slice, rng: np.random.Generator) -> Floats:
    """Values (N, 3) of a triad with one of `KINDS` in some rows."""
    out = values.copy()
    if kind == "frozen":
        out[rows] = values[rows.start]
    elif kind == "biased":
        out[rows, 0] += STEP[triad]
    elif kind == "scaled by 3 %":
        out[rows] *= 1.03
    elif kind == "noisy ×10":
        out[rows] += 10.0 * getattr(REST, triad) * rng.normal(size=out[rows].shape)
    elif kind == "swapped axes":
        out[rows] = values[rows][:, [1, 0, 2]]
    elif kind == "dead":
        out[rows] = np.nan
    return out


def with_fault(
    seed: int, kind: str = "biased", triad: str = "gyr", *, moving: bool, units: int = 6, rate: float = 10.0
) -> tuple[ImuArray, Monitored, str]:
    """An array of which a unit has a fault, what the monitor says, and the unit's name."""
    signals = moved(seed, DURATION, moving=moving, units=units, rate=rate)
    unit, rows = f"u{1 + seed % units}", slice(round(SINCE * rate), round(UNTIL * rate))
    signals[unit][triad] = broken(kind, triad, signals[unit][triad], rows, np.random.default_rng(10_000 + seed))
    array = as_array(signals)
    return array, monitor(array), unit


class Watched(NamedTuple):
    """What the monitor made of many arrays with the same fault.

    `detected`, `isolated`, `again`: shares, %: with an alarm; of these, with the right unit and triad; and of all,
    taken in again; `median`, `slow`: time to the alarm, s: the median, and what 95 % stay below; NaN without an
    alarm; `wrong`: others that were left out.
    """

    detected: float
    isolated: float
    median: float
    slow: float
    wrong: int
    again: float


def watched(kind: str, triad: str, *, moving: bool, seeds: int, rate: float = 10.0) -> Watched:
    """Of `seeds` arrays."""
    delays, right, again, wrong = [], 0, 0, 0
    first, last = round(SINCE * rate), round(UNTIL * rate)
    for seed in range(seeds):
        _, monitored, unit = with_fault(seed, kind, triad, moving=moving, rate=rate)
        alarms = (monitored.imu.flags[first:last] & np.uint32(flags.UNIT_EXCLUDED | flags.CANNOT_ISOLATE)) != 0
        hits = [f for f in monitored.faults if f.begin >= SINCE - 1e-6]
        wrong += sum((f.unit, f.triad) != (unit, triad) or f.begin < SINCE - 1e-6 for f in monitored.faults)
        if not alarms.any():
            continue
        delays.append(float(np.flatnonzero(alarms)[0]) / rate)
        if hits and (hits[0].unit, hits[0].triad) == (unit, triad):
            right += 1
            again += not monitored.excluded(triad)[-1].any()
    share, detections = 100.0 / seeds, max(len(delays), 1)
    median, slow = (float(np.quantile(delays, q)) if delays else np.nan for q in (0.5, 0.95))
    return Watched(share * len(delays), 100.0 * right / detections, median, slow, wrong, share * again)


def false_alarms(*, moving: bool, seed: int = 7, duration: float = LONG) -> int:
    """How many times a unit is left out in three hours, or another duration, s, without a fault."""
    return len(monitor(as_array(moved(seed, duration, moving=moving))).faults)


def two_units() -> tuple[bool, int]:
    """Of two units with a fault: whether the monitor says that it cannot isolate it, and how many it leaves out."""
    _, monitored, _ = with_fault(0, moving=False, units=2)
    during = slice(round(SINCE * 10.0), round(UNTIL * 10.0))
    return bool((monitored.imu.flags[during] & np.uint32(flags.CANNOT_ISOLATE)).any()), len(monitored.faults)


class Parity(NamedTuple):
    """What the test of one pair of axes by its parity finds: of 200 runs, and the median time to the alarm, s."""

    found: int
    median: float


def parity_test(step_dps: float, seed: int, runs: int = 200, duration: float = 60.0) -> Parity:
    """Alarms where the mean of p = (y⁺ + y⁻)/2, forgotten exponentially by 0.1, exceeds 5 of its standard deviations.

    `step_dps`: on one of the two gyroscopes of 0.1 °/s noise at 10 Hz, deg/s, from the first sample on.
    """
    keep, count = 0.9, round(duration * 10.0)
    sd = 0.1 / np.sqrt(2.0)  # of the parity, deg/s
    limit = 5.0 * sd * np.sqrt((1.0 - keep) / (1.0 + keep))
    rng = np.random.default_rng([seed, 3])
    mean = limit / 5.0 * rng.normal(size=runs)  # it has run for long
    when = np.full(runs, np.nan)
    for k in range(count):
        mean = keep * mean + (1.0 - keep) * (0.5 * step_dps + sd * rng.normal(size=runs))
        when[np.isnan(when) & (np.abs(mean) > limit)] = k / 10.0
    has_alarm = np.isfinite(when)
    return Parity(int(has_alarm.sum()), float(np.median(when[has_alarm])) if has_alarm.any() else np.nan)


class Broken(NamedTuple):
    """A run in which a unit's gyroscope x breaks from `SINCE` to `UNTIL`.

    `array`: with the fault; `seen`: what the monitor says; `unit`: the broken one; `what`: of its panel.
    """

    array: ImuArray
    seen: Monitored
    unit: str
    what: Both


def broken_at_rest(work: Work) -> Broken:
    """Six units at rest for 90 s through bytes, where 0.2 °/s is added to what one axis was read to say."""
    still = {"turn": "0 deg", "time": f"{DURATION:g} s"}
    taken = work.recorded("arm", "watch", session=ALL, sensors="arm:rest", scenario="arm", set=still)
    array = with_noise(read_array(taken.recording, mounts="arm"), REST)
    good = array.units["u3"]
    assert good.gyr is not None
    gyr = good.gyr.copy()
    gyr[(array.t >= SINCE) & (array.t < UNTIL), 0] += STEP["gyr"]
    bad = ImuData(good.t, gyr, good.acc, good.mag, meta=good.meta)
    array = ImuArray({**array.units, "u3": bad}, array.mounts)
    return Broken(array, monitor(array), "u3", ARM.text("at_rest"))


def broken_in_motion(seed: int) -> Broken:
    """The same of units that turn with 60 °/s rms every other 20 s, drawn directly."""
    array, monitored, unit = with_fault(seed, moving=True)
    return Broken(array, monitored, unit, ARM.text("moving"))


def part(broken: Sequence[Broken], seeds: int, few: int, step: Callable[[str], None], duration: float = LONG) -> Part:
    """Faults of one axis, with bars, over `seeds`, and false alarms in three times a duration, s.

    The test of a pair; and every fault of every sensor over `few` seeds.
    """
    step("faults at rest and in motion")
    figures: dict[str, float | tuple[float | None, float]] = {}
    for moving, name in ((False, "rest"), (True, "moving")):
        stats = watched("biased", "gyr", moving=moving, seeds=seeds)
        alarms = [false_alarms(moving=moving, seed=seed, duration=duration) for seed in (7, 8, 9)]
        figures |= {f"fault.{name}.{key}": (None, getattr(stats, key)) for key in _WATCHED}
        figures[f"fault.{name}.alarms"] = None, float(max(alarms))
    says, out = two_units()
    figures["fault.two"] = None, float(says and not out)
    for moving, name in ((False, "rest"), (True, "moving")):
        at_100 = watched("biased", "gyr", moving=moving, seeds=min(seeds, AT_100), rate=100.0)
        figures[f"fault.{name}.100_hz"] = None, at_100.median
    step("every fault of every sensor")
    parity = {size: parity_test(size, 1) for size in (0.0, 0.1, 0.2, 0.3, 0.5)}
    figures["parity.alarms"] = None, float(parity[0.0].found)
    of_parity = [ARM.row(f"parity.{size:g}", best=of.median, found=of.found) for size, of in parity.items() if size]
    cells: dict[tuple[str, str], list[str]] = {}
    for moving in (False, True):
        for triad in STEP:
            for kind in KINDS:
                stats = watched(kind, triad, moving=moving, seeds=few)
                share = stats.detected * stats.isolated / 100.0
                cell = [f"{share:.0f}", f"{stats.median:.1f}" if share else "-"]
                cells.setdefault((triad, kind), []).extend(cell)
    triads = ARM.texts("triads")
    rows = [
        (ARM.text("triad_and_kind", triad=triads[triad], kind=KINDS[kind]), *values)
        for (triad, kind), values in cells.items()
    ]
    pairs = [(f"{size:g}", f"{of.found}", f"{of.median:.1f}" if of.found else "-") for size, of in parity.items()]
    report = ARM.part(
        "breaks",
        tables=[ARM.table("test_of_the", pairs), ARM.table("every_fault_of", rows)],
        figures=[ARM.figure("fault_of_0", partial(_draw, broken), height=1.4 * len(broken) + 0.4)],
    )
    return report, [*ARM.rows(figures), *of_parity]


def _draw(runs: Sequence[Broken], canvas: "FigureBase") -> None:
    """What a broken gyroscope reads beyond the rest, and when it is left out."""
    panels = canvas.subplots(len(runs), 1, sharex=True, squeeze=False)[:, 0]
    for ax, run in zip(panels, runs, strict=True):
        t, gyr = run.seen.imu.t, run.array.units[run.unit].gyr
        assert gyr is not None
        assert run.seen.imu.gyr is not None
        away = to_dps(gyr[:, 0] - (run.seen.imu.gyr @ run.array.mounts[run.unit].dcm)[:, 0])
        size = max(1, round(1.0 / float(np.median(np.diff(t)))))
        mean = np.convolve(away, np.ones(size) / size)[: t.size]
        out = run.seen.excluded("gyr")[:, run.seen.names.index(run.unit)]
        ax.fill_between(
            t, 0.0, 1.0, where=out, color=SHADE, linewidth=0, step="post", transform=ax.get_xaxis_transform()
        )
        ax.plot(t, away, color=SOFT, linewidth=0.4)
        ax.plot(t, mean, color=SERIES[0], linewidth=1.0)
        for when in (SINCE, UNTIL):
            ax.axvline(when, color=SERIES[1], linewidth=1.0, linestyle="--")
        ax.set_ylim(-0.7, 0.9)
        ax.set_ylabel(ARM.text("broken_rate", run_what=run.what))
    time_axis(panels[-1], runs[-1].seen.imu.t)
