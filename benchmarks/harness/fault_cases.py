"""The cases of the faults benchmark as data: name, group, what is injected, and how.

Groups F1 to F8 are kinds of fault: F1 NaN and infinity, F2 numbers far off, F3 dead and stuck sensors, F4 ends of
ranges and spikes, F5 disturbed accelerometer and magnetometer, F6 a step of the gyroscope's bias, F7 starts, F8 time.
Where not said otherwise a fault concerns all three axes and begins at 30 s.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, TypeVar

import numpy as np

from benchmarks.harness import fault_edits as edits
from benchmarks.harness.fault_edits import Edit
from benchmarks.harness.fault_scene import (
    FIELD_N,
    LENGTH,
    LONGEST,
    RANGES,
    RATE,
    USUAL,
    Motion,
    Stream,
    record,
    smooth_step,
)
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg, dps, g

ARGUMENTS: Final = "F9"
"""The group that is no damaged stream: see `benchmarks.harness.battery`."""

GROUPS: Final = {
    "F1": "NaN and infinity",
    "F2": "numbers far off, and denormal ones",
    "F3": "dead and stuck sensors",
    "F4": "ends of ranges and spikes",
    "F5": "disturbed accelerometer and magnetometer",
    "F6": "step of the gyroscope's bias",
    "F7": "starts",
    "F8": "time: stamps, gaps, order",
    ARGUMENTS: "arguments: shapes, types, constructors",
}


@dataclass(frozen=True, slots=True)
class Case:
    """One fault.

    Attributes
    ----------
    name, group : str
        As in the tables.
    what : str
        What is injected, in one line.
    edit : callable
        Edits a stream in place, given the rows from `begin` to `end`.
    begin, end : float
        When the fault acts, s; infinite where it lasts.
    motion : Motion
        How the unit turns.
    length : int
        Samples of the run before editing.
    stamps : bool
        Only the time stamps are wrong: a contender without time input cannot notice.
    unseen : str
        Why no filter can see it; empty where one can.
    """

    name: str
    group: str
    what: str
    edit: Edit
    begin: float = 30.0
    end: float = 30.0 + 1.0 / RATE
    motion: Motion = USUAL
    length: int = LENGTH
    stamps: bool = False
    unseen: str = ""

    @property
    def judged_from(self) -> float:
        """Time from which the attitude is judged, s: a start has one second."""
        return 1.0 if self.group == "F7" else self.begin

    @property
    def counted(self) -> bool:
        """False for the clean start, which the other starts are measured by."""
        return self.name != "start_clean"

    def stream(self) -> Stream:
        """Samples with the fault in them."""
        stream = record(self.motion, self.length)
        last = self.length if math.isinf(self.end) else round(self.end * RATE)
        self.edit(stream, slice(round(self.begin * RATE), last))
        return stream


AnyCase = TypeVar("AnyCase", bound=Case)


def choose(names: Sequence[str], cases: Sequence[AnyCase], groups: Mapping[str, str]) -> list[AnyCase]:
    """Cases of a battery by name or group, in their usual order.

    Raises
    ------
    ParameterError
        If there is no such case or group.
    """
    for name in names:
        if name not in groups and all(case.name != name for case in cases):
            raise ParameterError(
                f"there is no case or group '{name}'; groups are {', '.join(groups)}, and "
                "'python -m benchmarks.harness faults --list' shows the cases."
            )
    return [case for case in cases if case.name in names or case.group in names]


def listing(cases: Sequence[Case], groups: Mapping[str, str]) -> str:
    """All cases of a battery with what they inject, and why it cannot be seen, by group."""
    wide = max(25, *(len(case.name) for case in cases))
    lines = []
    for group, title in groups.items():
        lines.append(f"{group}: {title}")
        for case in (one for one in cases if one.group == group):
            lines.append(f"    {case.name:{wide}} {case.what}" + (f"; unseen: {case.unseen}" if case.unseen else ""))
    return "\n".join(lines)


def _spinning_up(t: Floats) -> Floats:
    """Between 30 s and 31 s the body's x axis turns with 3000 °/s, reached within 50 ms."""
    pulse = smooth_step(t, 30.0, 30.05) - smooth_step(t, 30.95, 31.0)
    return np.outer(pulse, [dps(3000.0), 0.0, 0.0])


def _spinning_at_first(t: Floats) -> Floats:
    """300 °/s about the body's z axis from the first sample, which dies away between 4 s and 5 s."""
    return np.outer(1.0 - smooth_step(t, 4.0, 5.0), [0.0, 0.0, dps(300.0)])


_BAD: Final = {
    "nan": (math.nan, "F1", "NaN"),
    "inf": (math.inf, "F1", "infinity"),
    "huge1e30": (1e30, "F2", "1e30"),
    "huge1e300": (1e300, "F2", "1e300"),
    "zero": (0.0, "F3", "zero"),
    "denormal": (5e-324, "F2", "5e-324, the smallest number"),
    "denormal32": (1e-40, "F2", "1e-40, which float32 holds as a denormal number only"),
}


def _bad(name: str, triads: Sequence[str], seconds: float = 0.0) -> Case:
    value, group, words = _BAD[name]
    label = "all" if len(triads) > 1 else triads[0]
    length = f"{seconds:g}s" if seconds else "1"
    when = f"for {seconds:g} s" if seconds else "in one sample"
    what = f"{when} {', '.join(triads)} {'say' if len(triads) > 1 else 'says'} {words}"
    return Case(f"{name}_{label}_{length}", group, what, edits.put(value, *triads), end=30.0 + (seconds or 1.0 / RATE))


def _single_triad(triad: str) -> list[Case]:
    return [
        _bad("nan", [triad]),
        _bad("inf", [triad]),
        _bad("nan", [triad], 1.0),
        _bad("huge1e30", [triad]),
        _bad("huge1e300", [triad]),
        _bad("zero", [triad], 5.0),
        _bad("denormal", [triad]),
        _bad("denormal32", [triad]),
    ]


def _stuck(label: str, *triads: str) -> Case:
    what = f"for 10 s the last value of {', '.join(triads)} comes again and again, bit for bit"
    return Case(f"stuck_{label}_10s", "F3", what, edits.stuck(*triads), end=40.0)


_ALL: Final = ("gyr", "acc", "mag")
_SATURATED: Final = Motion(extra=_spinning_up)


_STRENGTH: Final = float(np.linalg.norm(FIELD_N))

_SIGNALS: Final = [
    *(case for triad in _ALL for case in _single_triad(triad)),
    _bad("nan", _ALL, 1.0),
    _bad("zero", _ALL, 1.0),
    Case("freefall_noise_2s", "F5", "acc says its noise alone for 2 s, as in free fall", edits.free_fall, end=32.0),
    Case("gyro_saturated_1s", "F4", "the body turns with 3000 °/s about x for 1 s; gyr ends at 2000 °/s",
         edits.nothing, end=31.0, motion=_SATURATED),
    Case("acc_clip_shock_50ms", "F4", "a shock of 50 g along x for 50 ms; acc ends at 16 g",
         edits.add("acc", [g(50.0), 0.0, 0.0]), end=30.05),
    Case("gyro_glitch_fullscale_1", "F4", "gyr says its full scale on x in one sample",
         edits.put_axis("gyr", RANGES["gyr"])),
    Case("acc_glitch_fullscale_1", "F4", "acc says its full scale on x in one sample",
         edits.put_axis("acc", RANGES["acc"])),
    Case("mag_glitch_x100_1", "F4", "mag is a hundred times too large in one sample", edits.scale("mag", 100.0)),
    *(_stuck(triad, triad) for triad in _ALL),
    _stuck("all", *_ALL),
    Case("gyro_bias_step_5dps", "F6", "the bias of gyr grows by 5 °/s on every axis, for good",
         edits.add("gyr", dps(np.full(3, 5.0))), end=math.inf),
    Case("acc_lin_5ms2_10s", "F5", "the body accelerates eastward with 5 m/s² for 10 s",
         edits.add_n("acc", [5.0, 0.0, 0.0]), end=40.0),
    Case("mag_hardiron_50uT_20s", "F5", "mag is 50 µT too large on x for 20 s",
         edits.add("mag", [50.0, 0.0, 0.0]), end=50.0),
    Case("mag_parallel_gravity_5s", "F5", "the field points straight down for 5 s, its strength unchanged",
         edits.add_n("mag", [0.0, 0.0, -_STRENGTH] - FIELD_N), end=35.0),
    Case("mag_exact_antiparallel_1", "F5", "mag is exactly opposite to acc in one sample",
         edits.mag_against_acc(_STRENGTH)),
    Case("mag_skipped_30s", "F5", "samples come without mag for 30 s", edits.skip_mag, end=60.0),
    Case("dt_zero_equal_stamps_1s", "F8", "for 1 s all samples carry the stamp of the first of them",
         edits.equal_stamps, end=31.0, stamps=True),
    Case("dt_negative_step_0p5s", "F8", "the clock is set back by 0.5 s, for good; 60 s follow",
         edits.shift_stamps(-0.5), stamps=True),
    Case("dt_nan_1", "F8", "one stamp is NaN", edits.lose_stamps, stamps=True),
    Case("dt_clock_jump_1e6s", "F8", "the clock jumps ahead by 1e6 s, for good; 60 s follow",
         edits.shift_stamps(1e6), stamps=True),
    Case("gap_60s", "F8", "the samples of 60 s are lost; 60 s follow", edits.lose, end=90.0, length=LONGEST),
    Case("gap_0p5s", "F8", "the samples of 0.5 s are lost", edits.lose, end=30.5),
    Case("dt_jitter_arrival_10s", "F8", "stamps are early or late by up to half a step for 10 s",
         edits.jitter, end=40.0, stamps=True),
    Case("duplicates_5s", "F8", "for 5 s every sample comes twice with one stamp", edits.duplicate, end=35.0),
    Case("reordered_pairs_1s", "F8", "for 1 s neighbours change places, with their stamps",
         edits.swap_pairs, end=31.0),
    Case("mag10Hz_skip", "F5", "mag comes in every tenth sample for 15 s, the others come without",
         edits.slow_mag("skip"), end=45.0),
    Case("mag10Hz_nanfill", "F5", "mag comes in every tenth sample for 15 s, the others say NaN",
         edits.slow_mag("nan"), end=45.0),
    Case("mag10Hz_zerofill", "F5", "mag comes in every tenth sample for 15 s, the others say zero",
         edits.slow_mag("zero"), end=45.0),
    Case("mag10Hz_hold", "F5", "mag comes in every tenth sample for 15 s, the others repeat it",
         edits.slow_mag("hold"), end=45.0),
]  # fmt: skip


def _start(name: str, what: str, edit: Edit = edits.nothing, end: float = 1.0 / RATE, **motion: Any) -> Case:
    return Case(f"start_{name}", "F7", what, edit, begin=0.0, end=end, motion=Motion(**motion))


def _first(kind: str, triad: str) -> Case:
    value, _, words = _BAD[kind]
    triads = _ALL if triad == "all" else (triad,)
    what = f"the first sample of {', '.join(triads)} is {words}"
    return _start(f"first_{kind}_{triad}", what, edits.put(value, *triads))


_turned: Final = partial(_start, end=0.0)

_STARTS: Final = [
    _turned("clean", "level, heading zero, at rest: the start that the others are measured by"),
    *(_first(kind, triad) for triad in _ALL for kind in ("nan", "zero")),
    _first("nan", "all"),
    _turned("upside_down", "a roll of 177°", start=(0.0, 0.0, deg(177.0))),
    _turned("upside_down_exact", "a roll of 180°", start=(0.0, 0.0, math.pi)),
    _turned("pitch_90", "a pitch of 90°", start=(0.0, 0.5 * math.pi, 0.0)),
    _turned("heading_180_exact", "a yaw of 180°", start=(math.pi, 0.0, 0.0)),
    _turned("moving_300dps", "300 °/s about z from the first sample instead of rest", extra=_spinning_at_first),
    _start("in_freefall_3s", "acc says exactly zero for the first 3 s", edits.put(0.0, "acc"), 3.0),
    _start("no_mag_10s_then_mag", "a yaw of 70°, and no mag in the first 10 s", edits.skip_mag, 10.0,
           start=(deg(70.0), 0.0, 0.0)),
]  # fmt: skip

CASES: Final[tuple[Case, ...]] = (*_SIGNALS, *_STARTS)
