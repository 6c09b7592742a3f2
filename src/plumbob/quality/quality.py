"""Quality flags of each burst and channel in QARTOD's words: 1 pass, 2 not evaluated, 3 suspect, 4 fail, 9 missing.

The tests are those of its table for the time series of waves [CDIPWaves]: gaps, spikes, range, mean shift, acceleration
and percent of good points; and rate of change and flat line, which it has for other sensors. Thresholds that the table
leaves to the user are the ones below, which a page states beside the flags.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.time import GAP_FACTOR
from plumbob.data.imu import TRIAD_FLAGS
from plumbob.data.plausibility import STUCK_SAMPLES, stuck_runs
from plumbob.data.recording import EARTH_FIELD, STUCK_FOR

PASS, NOT_EVALUATED, SUSPECT, FAIL, MISSING = 1, 2, 3, 4, 9
MEANING: Final = {
    PASS: "pass", NOT_EVALUATED: "not evaluated", SUSPECT: "suspect", FAIL: "fail", MISSING: "missing",
}  # fmt: skip
"""Of the flags, in the words of QARTOD."""

FEWEST: Final = 50  # Samples below which nothing is evaluated
HOLE: Final = (1.0, 10.0)  # Longest time without a usable value, s: suspect above the first, fail above the second
GOOD: Final = (0.95, 0.90)
"""Share of good samples: suspect below the first, fail below the second, which [CDIPWaves] recommends."""
SPIKE: Final = 4.0  # [CDIPWaves]: standard deviations of a spike from the mean, and from both neighbours
STEP: Final = 7.0  # Standard deviations from one sample to the next that are too fast
SHARE: Final = (2e-4, 1e-2)  # share of samples that are spikes, too fast, or beyond the range: suspect, fail above
SHIFT: Final = (1.0, 1.7)  # of the mean from an eighth of a burst to the next, in its standard deviations; a step is 2
EIGHTHS: Final = 8
LONG: Final = 480.0  # In a burst of this length or longer, s, the means of its eighths are means of many waves
HARD: Final = 0.5  # [CDIPWaves]: vertical acceleration without gravity that is too large, g
FLAT: Final = (STUCK_FOR, 5.0)  # time for which all axes say the same to the last bit, s: suspect, fail from there on
CELSIUS: Final = (-40.0, 85.0)  # Temperatures that electronics are made for, °C

CHANNELS: Final = ("gyr", "acc", "mag", "temp", "attitude")  # What is judged, where a recording has it

_BEYOND: Final = {name: clipped | invalid for name, (_, clipped, invalid) in TRIAD_FLAGS.items()}
_BAD: Final = {
    "gyr": _BEYOND["gyr"] | flags.GYR_STUCK | flags.TIME_FAULT,
    "acc": _BEYOND["acc"] | flags.ACC_STUCK | flags.TIME_FAULT,
    "mag": _BEYOND["mag"] | flags.MAG_STUCK | flags.TIME_FAULT,
    "temp": 0,
    "attitude": flags.NOT_CONVERGED | flags.INCONSISTENT,
}


@dataclass(frozen=True, slots=True)
class BurstVerdict:
    """Flag of a channel in a burst."""

    flag: int  # the worst of its tests, 1, 2, 3, 4 or 9
    tests: dict[str, int] = field(default_factory=dict)  # flags of the tests, by name
    good: float = 0.0  # share of good samples, 0 to 1

    @property
    def why(self) -> str:
        """Tests that did not pass, in words."""
        return ", ".join(name for name, flag in self.tests.items() if flag in (SUSPECT, FAIL))


_PERCENT: Final = tuple(f"{100.0 * share:g} %" for share in SHARE)
THRESHOLDS: Final = (
    ("gap", "longest time without a usable value", f"> {HOLE[0]:g} s", f"> {HOLE[1]:g} s"),
    ("percent good", "samples neither absent, clipped, invalid nor stuck; attitudes that are known and trusted",
     f"< {100 * GOOD[0]:g} %", f"< {100 * GOOD[1]:g} %"),
    ("spike", f"samples more than {SPIKE:g} standard deviations off the mean and off both neighbours",
     f"> {_PERCENT[0]}", f"> {_PERCENT[1]}"),
    ("rate of change", f"steps of more than {STEP:g} standard deviations from sample to sample",
     f"> {_PERCENT[0]}", f"> {_PERCENT[1]}"),
    ("range", "samples at the end of the sensor's range or impossible; temperatures outside "
     f"{CELSIUS[0]:g} to {CELSIUS[1]:g} °C", f"> {_PERCENT[0]}", f"> {_PERCENT[1]}"),
    ("field", f"median of |mag| outside of the Earth's {EARTH_FIELD[0]:g} to {EARTH_FIELD[1]:g} µT", "outside", "-"),
    ("flat line", f"all axes the same to the last bit, in {STUCK_SAMPLES} samples or more",
     f"≥ {FLAT[0]:g} s", f"≥ {FLAT[1]:g} s"),
    ("mean shift", "change of the mean from one eighth of a burst to the next over its standard deviation, in bursts "
     f"of {LONG:g} s and more; of gyr, |acc|, |mag|, roll and pitch", f"> {SHIFT[0]:g}", f"> {SHIFT[1]:g}"),
    ("acceleration", f"samples whose vertical acceleration is beyond {HARD:g} g", "> 0", f"> {_PERCENT[1]}"),
)  # fmt: skip
"""What each test asks: name, what it looks at, and when it is suspect and when it fails."""


def verdict(
    channel: str, t: Floats, values: Floats, words: NDArray[np.uint32], span: tuple[float, float],
    vertical: Floats | None = None,
) -> BurstVerdict:  # fmt: skip
    """Judge a channel in a burst (begin and end `span`, s) by its values (N, C), SI, NaN where absent, and its flags.

    The channel ``attitude`` has roll and pitch; ``acc`` may have the vertical acceleration without gravity, m/s².
    """
    check.one_of("channel", channel, CHANNELS)
    finite = np.isfinite(values).all(axis=1)
    if not finite.any():
        return BurstVerdict(MISSING)
    at, samples, marks = t[finite], values[finite], words[finite]
    usable = (marks & np.uint32(_BAD[channel])) == 0
    step = mean = span[1] - span[0]
    if (steps := np.diff(at)).size:  # without gaps: a magnetometer may have a value in three of four samples
        step = float(np.median(steps))
        mean = float(np.mean(steps[steps <= GAP_FACTOR * step]))
    share = min(1.0, float(np.count_nonzero(usable)) * mean / max(span[1] - span[0], mean))
    if at.size < FEWEST:
        return BurstVerdict(NOT_EVALUATED, good=share)
    # the longest time without a sample beyond the usual step; the ends of the burst are edges, too
    hole = float(np.max(np.diff(np.concatenate(([span[0]], at[usable], [span[1]]))))) - step
    tests = {"gap": _above(hole, HOLE), "percent good": _above(-share, (-GOOD[0], -GOOD[1]))}
    tests |= _values(channel, samples, marks)
    if channel in _BEYOND:
        same = (samples[1:] == samples[:-1]).all(axis=1)
        # one that never changes is a simulation without noise, at rest
        flat = stuck_runs(np.append(False, same & (not same.all())))
        longest = max((float(at[stop - 1] - at[start]) for start, stop in flat), default=0.0)
        tests["flat line"] = _above(longest, FLAT, equal=True)
    if channel != "temp" and span[1] - span[0] >= LONG:
        tests["mean shift"] = _above(_shift(channel, samples), SHIFT)
    if channel == "acc" and vertical is not None and np.isfinite(vertical).any():
        hard = float(np.nanmean(np.abs(vertical) > HARD * G0))
        tests["acceleration"] = _above(hard, (0.0, SHARE[1]))
    return BurstVerdict(max(tests.values()), tests, share)


def _values(channel: str, samples: Floats, marks: NDArray[np.uint32]) -> dict[str, int]:
    """Tests of the values themselves."""
    if channel == "attitude":
        return {}
    beyond = (marks & np.uint32(_BEYOND.get(channel, 0))) != 0
    if channel == "temp":
        beyond = (samples[:, 0] < CELSIUS[0]) | (samples[:, 0] > CELSIUS[1])
    sd, off = np.std(samples, axis=0), samples - np.mean(samples, axis=0)
    limit = np.where(sd > 0.0, STEP * sd, np.inf)
    fast = float(np.mean((np.abs(np.diff(samples, axis=0)) > limit).any(axis=1)))
    # spikes stand out from the mean and from both neighbours, on the same side
    rise, fall, middle, limit = off[1:-1] - off[:-2], off[1:-1] - off[2:], off[1:-1], SPIKE * sd
    high = (middle > limit) & (rise > limit) & (fall > limit)
    low = (middle < -limit) & (rise < -limit) & (fall < -limit)
    tests = {
        "spike": _above(float(np.mean((high | low).any(axis=1))), SHARE),
        "rate of change": _above(fast, SHARE),
        "range": _above(float(np.mean(beyond)), SHARE),
    }
    if channel == "mag":
        typical = float(np.median(np.sqrt(np.sum(samples * samples, axis=1))))
        tests["field"] = PASS if EARTH_FIELD[0] <= typical <= EARTH_FIELD[1] else SUSPECT
    return tests


def _above(value: float, limits: tuple[float, float], *, equal: bool = False) -> int:
    suspect, fail = ((value >= limit if equal else value > limit) for limit in limits)
    return FAIL if fail else SUSPECT if suspect else PASS


def _shift(channel: str, samples: Floats) -> float:
    """Largest change of the mean from one eighth to the next, in standard deviations of the whole."""
    if channel not in ("gyr", "attitude"):  # one that turns in the field or leans to one side is not faulty
        samples = np.sqrt(np.sum(samples * samples, axis=1))[:, np.newaxis]
    sd = np.std(samples, axis=0)
    means = np.array([np.mean(part, axis=0) for part in np.array_split(samples, EIGHTHS)])
    steps = np.max(np.abs(np.diff(means, axis=0)), axis=0)
    return float(np.nanmax(np.divide(steps, sd, out=np.zeros_like(sd), where=sd > 0.0)))
