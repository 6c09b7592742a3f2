"""The second battery of faults: what nobody had in mind who wrote the filters, in brisk and slow motion and at rest.

Each fault comes in three motions, which end its name, and in lengths around the times that the code waits for. A case
whose samples could as well be those of something else says so: what is `unseen` there no filter can see.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from benchmarks.harness import fault_edits as edits
from benchmarks.harness.fault_cases import Case
from benchmarks.harness.fault_edits import Edit
from benchmarks.harness.fault_scene import LONGEST, RANGES, RATE, USUAL, Motion, Stream, record, smooth_step, swings
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, g

GROUPS: Final = {
    "S1": "fields that are wrong for a time",
    "S2": "dropouts with a wrong field behind them",
    "S3": "starts in a wrong field, judged from its end on",
    "S4": "signs and axes exchanged",
    "S5": "axes that die, stick or fade",
    "S6": "steps and ramps of the gyroscope's bias",
    "S7": "undeclared ends of range, and integers that wrap around",
    "S8": "time: clocks, rates, late and repeated samples",
    "S9": "motions: slow, coordinated and flat turns, accelerations, shocks",
}

BRISK: Final = Motion(push=partial(swings, amplitude=(3.0, 2.0, 2.5), frequency=(1.1, 0.7, 1.6)))
"""The turns of the first battery, in a hand that accelerates by 2 to 3 m/s²."""
SLOW: Final = Motion(
    amplitude=(dps(6.0), dps(5.0), dps(3.0)),
    frequency=(0.15, 0.11, 0.05),
    push=partial(swings, amplitude=(0.4, 0.3, 0.5), frequency=(0.15, 0.11, 0.13)),
)
"""A buoy: some °/s, some 0.1 m/s²."""
NONE: Final = Motion(amplitude=(0.0, 0.0, 0.0))
MOTIONS: Final = {"brisk": BRISK, "slow": SLOW, "none": NONE}
MOVING: Final = ("brisk", "slow")

_BEGIN = 30.0
_AFTER = 60.0  # s from the begin of a fault, and half as much from its end, to the end of a run at least
_NO_MAG = "without mag, "


@dataclass(frozen=True, slots=True)
class SecondCase(Case):
    """A fault of the second battery.

    Attributes
    ----------
    beside : Motion
        That of the clean run.
    mag : bool
        Whether there is a magnetometer; without one only changes of the heading are judged.
    """

    beside: Motion = USUAL
    mag: bool = True

    @property
    def judged_from(self) -> float:
        """Time from which the attitude is judged, s: a first field is as good as any other until there is another."""
        return self.end if self.begin == 0.0 else self.begin

    def stream(self) -> Stream:
        """Samples with the fault in them."""
        stream = Case.stream(self)
        stream.has_mag[:] &= self.mag
        return stream

    def clean(self) -> Stream:
        """Samples without."""
        stream = record(self.beside, LONGEST)
        stream.has_mag[:] &= self.mag
        return stream


def _case(
    name: str, group: str, what: str, edit: Edit, seconds: float, motion: Motion, *, begin: float = _BEGIN, **more: Any
) -> SecondCase:
    until = max(begin + _AFTER, begin + seconds + 0.5 * _AFTER) if math.isfinite(seconds) else begin + 1.5 * _AFTER
    length = round(until * RATE)
    return SecondCase(name, group, what, edit, begin, begin + seconds, motion, length, **{"beside": motion, **more})


def _each(
    name: str, group: str, what: str, edit: Edit, seconds: float, motions: tuple[str, ...] = tuple(MOTIONS), **more: Any
) -> Iterator[SecondCase]:
    """The same fault in several motions."""
    for motion in motions:
        yield _case(f"{name}_{motion}", group, what, edit, seconds, MOTIONS[motion], **more)


_EAST: Final = edits.add_n("mag", [30.0, 0.0, 0.0])


def _fields() -> Iterator[SecondCase]:
    for seconds in (1.0, 3.0, 10.0, 22.0, 25.0, 40.0, 60.0):
        name, what = f"field_east_{seconds:g}s", f"30 µT more eastward for {seconds:g} s, which turns north by 56°"
        yield from _each(name, "S1", what, _EAST, seconds)
    for label, words, vector in (
        ("weak", "10 µT more eastward, which turns north by 27°", [10.0, 0.0, 0.0]),
        ("down", "30 µT more downward", [0.0, 0.0, -30.0]),
        ("reversed", "40 µT more southward, so that the level part points south", [0.0, -40.0, 0.0]),
    ):
        yield from _each(f"field_{label}_20s", "S1", f"{words}, for 20 s", edits.add_n("mag", vector), 20.0)
    iron = edits.add("mag", [30.0, 0.0, 0.0])
    yield from _each("iron_20s", "S1", "30 µT more on x, which turn with the sensor, for 20 s", iron, 20.0)
    for seconds in (30.0, 60.0):
        what = f"the field turns about the vertical with 1 °/s for {seconds:g} s, and is then right again"
        yield from _each(f"field_turns_{seconds:g}s", "S1", what, edits.turn_field(dps(1.0)), seconds)


def _dropouts() -> Iterator[SecondCase]:
    for seconds in (0.14, 0.2, 0.5, 1.0, 1.5):
        edit = edits.behind_gap(round(seconds * RATE), _EAST)
        what = f"{seconds:g} s of samples are lost; in the 20 s behind them 30 µT more eastward"
        yield from _each(f"dropout_{seconds:g}s_field", "S2", what, edit, seconds + 20.0)


def _starts() -> Iterator[SecondCase]:
    for seconds in (3.0, 10.0, 20.0):
        what = f"30 µT more eastward in the first {seconds:g} s"
        yield from _each(f"start_field_{seconds:g}s", "S3", what, _EAST, seconds, begin=0.0)


def _exchanged() -> Iterator[SecondCase]:
    for triad in ("acc", "mag"):
        for seconds in (5.0, 20.0):
            what = f"all signs of {triad} are wrong for {seconds:g} s"
            yield from _each(f"sign_{triad}_{seconds:g}s", "S4", what, edits.scale(triad, -1.0), seconds)
    for triad, motions in (("gyr", MOVING), ("acc", tuple(MOTIONS)), ("mag", tuple(MOTIONS))):
        what = f"x and y of {triad} are exchanged for 20 s"
        yield from _each(f"swap_{triad}_20s", "S4", what, edits.swap(triad), 20.0, motions)


_BIT: Final = {name: end / 2.0**15 for name, end in RANGES.items()}


def _axes() -> Iterator[SecondCase]:
    for triad in RANGES:
        dies = edits.fade(triad, [0.0, 0.0, 1.0], 30.0)
        yield from _each(f"dies_{triad}_30s", "S5", f"z of {triad} goes to zero within 30 s, and stays", dies, math.inf)
        what = f"for 20 s z of {triad} repeats its last value"
        yield from _each(f"sticks_{triad}_20s", "S5", what, edits.stick(triad), 20.0)
        dither = edits.stick(triad, _BIT[triad])
        yield from _each(f"dithers_{triad}_20s", "S5", f"{what}, and its last bit flickers", dither, 20.0)
    fades = edits.fade("acc", [1.0, 1.0, 1.0], 30.0)
    yield from _each("fades_acc_30s", "S5", "acc goes to zero within 30 s, and stays", fades, math.inf)


def _biases() -> Iterator[SecondCase]:
    for size in (1.0, 2.0, 5.0, 20.0):
        what = f"the bias of gyr grows by {size:g} °/s on every axis, for good"
        yield from _each(f"bias_{size:g}dps", "S6", what, edits.add("gyr", dps(np.full(3, size))), math.inf)
    for size, seconds in ((5.0, 30.0), (1.0, 60.0)):
        what = f"the bias of gyr grows by {size:g} °/s on every axis within {seconds:g} s, for good"
        edit = edits.grow("gyr", dps(np.full(3, size)), seconds)
        yield from _each(f"ramp_{size:g}dps_{seconds:g}s", "S6", what, edit, math.inf)
    step = edits.add("gyr", [0.0, 0.0, dps(1.0)])
    what = f"{_NO_MAG}the bias of gyr grows by 1 °/s on z for 60 s"
    unseen = "a turn of 1 °/s about the vertical gives the same samples"
    yield _case("bias_1dps_no_mag_none", "S6", what, step, 60.0, NONE, mag=False, unseen=unseen)


_ENDS: Final = (
    ("gyr", "brisk", dps(100.0), "100 °/s"),
    ("gyr", "slow", dps(4.0), "4 °/s"),
    *(("acc", motion, 9.0, "9 m/s²") for motion in MOTIONS),
    *(("mag", motion, 40.0, "40 µT") for motion in MOTIONS),
)


def _ranges() -> Iterator[SecondCase]:
    for triad, motion, end, words in _ENDS:
        for name, verb, edit in (("saturates", "ends", edits.saturate), ("wraps", "wraps around", edits.wrap_around)):
            what = f"for 20 s {triad} {verb} at {words}, and no flag says so"
            yield _case(f"{name}_{triad}_20s_{motion}", "S7", what, edit(triad, end), 20.0, MOTIONS[motion])


def _times() -> Iterator[SecondCase]:
    slow = edits.slow_clock(0.5)
    yield from _each("clock_half_20s", "S8", "for 20 s the clock runs half as fast", slow, 20.0, MOVING, stamps=True)
    yield from _each("rate_10Hz_20s", "S8", "for 20 s one sample of ten comes", edits.thin(10), 20.0, MOVING)
    late = edits.late("gyr", 5)
    yield from _each("late_gyr_50ms", "S8", "gyr is 50 ms late, from 30 s on", late, math.inf, MOVING)
    for count in (3, 10, 50):
        what = f"for 20 s a block of {count} samples comes twice each second, with the same stamps"
        yield from _each(f"twice_{count}_20s", "S8", what, edits.again(count), 20.0, MOVING)


def _pulse(t: Floats, seconds: float) -> Floats:
    """From 0 to 1 within 2 s, and back."""
    return smooth_step(t, _BEGIN, _BEGIN + 2.0) - smooth_step(t, _BEGIN + seconds - 2.0, _BEGIN + seconds)


def _pulse_slope(t: Floats, seconds: float) -> Floats:
    """Derivative of the pulse, 1/s."""
    ends = (t - _BEGIN, t - (_BEGIN + seconds - 2.0))
    up, down = (0.25 * np.pi * np.sin(0.5 * np.pi * np.clip(end, 0.0, 2.0)) for end in ends)
    return np.asarray(up - down)


def turning(rate: float, seconds: float, speed: float = 0.0, *, banked: bool = False) -> Motion:
    """Level turn to the left, rad/s, at a speed, m/s: flat, or banked so that the specific force stays on z."""

    def rates(t: Floats) -> Floats:
        yaw, pull = rate * _pulse(t, seconds), speed * rate / G0 * banked
        roll, slope = -np.arctan(pull * _pulse(t, seconds)), -pull * _pulse_slope(t, seconds)
        return np.stack(
            (slope / (1.0 + (pull * _pulse(t, seconds)) ** 2), yaw * np.sin(roll), yaw * np.cos(roll)), axis=1
        )

    def push(t: Floats) -> Floats:
        yaw = rate * _pulse(t, seconds)
        heading = np.concatenate(([0.0], np.cumsum(0.5 * (yaw[1:] + yaw[:-1]) * np.diff(t))))
        left = np.stack((-np.sin(heading), np.cos(heading), np.zeros(t.size)), axis=1)
        return np.asarray(speed * yaw[:, np.newaxis] * left)

    return Motion(amplitude=NONE.amplitude, extra=rates, push=push if speed else None)


def _motions() -> Iterator[SecondCase]:
    still: dict[str, Any] = {"beside": NONE}
    slowly, words = turning(dps(1.0), 60.0), "from rest a turn of 1 °/s about the vertical for 60 s"
    yield _case("turn_1dps_60s", "S9", words, edits.nothing, 60.0, slowly, **still)
    yield _case("turn_1dps_60s_no_mag", "S9", _NO_MAG + words, edits.nothing, 60.0, slowly, mag=False, **still,
                unseen="a step of the gyroscope's bias by 1 °/s gives the same samples")  # fmt: skip
    yield _case("turn_1dps_60s_field_too", "S9", f"{words}, and the field turns with it", edits.turn_field(dps(1.0)),
                60.0, turning(dps(1.0), 60.0), **still,
                unseen="a step of the gyroscope's bias by 1 °/s gives nearly the same samples")  # fmt: skip
    for bank, seconds in ((20.0, 30.0), (45.0, 10.0), (45.0, 30.0), (45.0, 60.0)):
        motion = turning(G0 * math.tan(deg(bank)) / 20.0, seconds, 20.0, banked=True)
        what = f"a coordinated turn at 20 m/s, banked by {bank:g}°, for {seconds:g} s"
        yield _case(f"turn_banked_{bank:g}deg_{seconds:g}s", "S9", what, edits.nothing, seconds, motion, **still)
    for seconds in (10.0, 30.0):
        motion = turning(dps(6.0), seconds, 20.0)
        what = f"a flat turn of 6 °/s at 20 m/s, 2.1 m/s² inward, for {seconds:g} s"
        yield _case(f"turn_flat_{seconds:g}s", "S9", what, edits.nothing, seconds, motion, **still)
    for seconds in (10.0, 30.0):
        what = f"the body accelerates eastward with 2 m/s² for {seconds:g} s"
        yield from _each(f"accelerates_{seconds:g}s", "S9", what, edits.add_n("acc", [2.0, 0.0, 0.0]), seconds)
    what = "a shock of 100 g along x for 20 ms each second, for 20 s; acc ends at 16 g"
    yield from _each("shocks_20s", "S9", what, edits.shocks(g(100.0)), 20.0)


CASES: Final[tuple[SecondCase, ...]] = (
    *_fields(), *_dropouts(), *_starts(), *_exchanged(), *_axes(), *_biases(), *_ranges(), *_times(), *_motions(),
)  # fmt: skip
