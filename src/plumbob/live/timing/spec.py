"""What a format says of its time: counters, their rates and where they stand.

Where the numbers of a clock's state lie: whole ones in one array, real ones in another.

Kernels take the two arrays. Integers hold what must be exact for ever (counts, stamps); float64 holds times since the
first frame, which are exact to the nanosecond for 104 days and to two for 208.
"""

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from plumbob.core.errors import ParameterError

_LARGEST: Final = 2**30  # so that the products of both and a count's remainder stay in 64 bits
_SLOWEST, _FASTEST = 1e-3, 1e6  # Hz
_HOUR: Final = 3_600_000_000_000  # ns


@dataclass(frozen=True, slots=True)
class Counter:
    """An unsigned counter in a frame."""

    bits: int  # its width, 1 to 64
    # Time of one count, ns; a float means the decimal number that it prints, and 1/3 must be a `Fraction`. None says
    # that it counts frames.
    tick_ns: Fraction | int | float | None = None
    down: bool = False  # whether it counts down

    def __post_init__(self) -> None:
        """Refuse what cannot be counted."""
        if not 1 <= self.bits <= 64:
            raise ParameterError(f"a counter has 1 to 64 bits, but bits is {self.bits}.")
        tick = self.tick
        if tick is None:
            return
        if not (0 < tick <= _HOUR and tick.numerator <= _HOUR and tick.denominator <= _LARGEST):
            raise ParameterError(
                f"tick_ns must be above 0, at most an hour, with a denominator up to 2³⁰, but it is {self.tick_ns}. "
                "Give it as a Fraction of whole numbers, such as Fraction(10**9, 32768)."
            )

    @property
    def tick(self) -> Fraction | None:
        """Time of one count, exactly, ns."""
        if self.tick_ns is None:
            return None
        try:
            return Fraction(repr(self.tick_ns)) if isinstance(self.tick_ns, float) else Fraction(self.tick_ns)
        except ValueError as error:
            raise ParameterError(f"tick_ns must be a finite number, but it is {self.tick_ns}.") from error

    @property
    def modulus(self) -> int:
        """Counts in one turn. Of 64 bits the lowest 62 are looked at, which no device wears out."""
        return 1 << min(self.bits, 62)


@dataclass(frozen=True, slots=True)
class TimeSpec:
    """What the frames of one source bring to tell the time by."""

    clock: Counter | None = None  # device clock: a counter with a tick
    frames: Counter | None = None  # frame counter: a counter without
    # Nominal rate of the frames, Hz. Without a device clock and a rate, the first half second goes into measuring it.
    rate: float | None = None
    # Length of a frame where all are equally long and nothing else is on the line; then a damaged frame is seen by the
    # place of the next. Used only where there is no counter.
    frame_bytes: int | None = None
    # how many times faster than time an emulated line runs, whose host times are stretched by it: a stall of the host
    # is stretched too, and has to be waited for as much longer
    speed: float = 1.0

    def __post_init__(self) -> None:
        """Refuse counters in each other's place, and impossible rates."""
        if self.clock is not None and self.clock.tick is None:
            raise ParameterError("clock needs tick_ns, the time of one count; a counter of frames belongs in frames.")
        if self.frames is not None and self.frames.tick is not None:
            raise ParameterError("frames counts frames and has no tick_ns; a device clock belongs in clock.")
        if self.rate is not None and not _SLOWEST <= self.rate <= _FASTEST:
            raise ParameterError(f"rate must be {_SLOWEST:g} to {_FASTEST:g} Hz, but it is {self.rate:g}.")
        if self.frame_bytes is not None and self.frame_bytes < 1:
            raise ParameterError(f"frame_bytes must be at least 1, but it is {self.frame_bytes}.")
        if not 0.0 < self.speed < math.inf:
            raise ParameterError(f"speed must be positive and finite, but it is {self.speed}.")

    @property
    def mode(self) -> str:
        """Where the time comes from: ``"clock"``, ``"frames"`` or ``"host"``."""
        if self.clock is not None:
            return "clock"
        return "host" if self.frames is None else "frames"


# --- whole numbers: what does not change
MODULUS: Final = 0  # counts in one turn of the counter that gives the time; 1 where there is none
SIGN: Final = 1  # −1 for a counter that counts down
TICK_WHOLE: Final = 2  # of a count, ns, and what is beyond it, in ns / TICK_DENOMINATOR
TICK_REST: Final = 3
TICK_DENOMINATOR: Final = 4  # 0 where the counter counts frames
FRAME_MODULUS: Final = 5  # of a frame counter beside a device clock; 0 where there is none
FRAME_SIGN: Final = 6
FRAME_BYTES: Final = 7  # of a frame, where all are equally long; else 0

# --- whole numbers: what evolves
STARTED: Final = 8
ORIGIN: Final = 9  # host time of the first frame, ns
SHIFT: Final = 10  # added to host times, because the host's clock has been set back, ns
LATEST: Final = 11  # latest host time, ns
HOST: Final = 12  # host time of the last accepted frame, ns
COUNT: Final = 13  # of the last accepted frame
FRAME: Final = 14  # the same of the second counter
PLACE: Final = 15  # offset of the last accepted frame in the stream, bytes
REOPENED: Final = 16  # 1: the source was opened again; 2: and the host's clock is another
CHAIN: Final = 17  # frames in a row that contradict, in order among themselves
CHAIN_COUNT: Final = 18  # count of the last of them
SUSPECTS: Final = 19  # frames in a row that come later than delays explain
SUSPECT_SINCE: Final = 20  # host time since which their delay has not fallen, ns
STEP: Final = 21  # counts from the last accepted frame to this one
EXTRA: Final = 22  # time from the last accepted frame to this one, where counts do not tell, ns
STAMP: Final = 23  # time of the last accepted frame, ns
REMAINDER: Final = 24  # what was left when counts became ns, in ns / TICK_DENOMINATOR
MISSING: Final = 25  # frames lost before this one
LEARNT: Final = 26  # frames while the rate is being learnt
LEARN_SINCE: Final = 27  # host time, ns
ASIDE: Final = 28  # frames in a row that the line does not take, and host time of the first, ns
ASIDE_SINCE: Final = 29
ODD: Final = 30  # steps in a row that do not fit the pace
FRAMES: Final = 31  # how many there were, and how many of them are lost, and gaps
LOST: Final = 32
GAPS: Final = 33
INFERRED: Final = 34  # how often a delay alone was taken for time that had passed, and how much time, ns
INFERRED_NS: Final = 35
TALLY: Final = 36  # frames of each kind, in order of its bits
WHOLES: Final = TALLY + 8

# --- real numbers
TICK: Final = 0  # time of one count, nominally, ns; 0 while not known
TYPICAL: Final = 1  # time from frame to frame, ns
NOW: Final = 2  # device time of the last accepted frame: nominal, since the first, ns
FRACTION: Final = 3  # of a nanosecond that belongs to STAMP
SUSPECT_DELAY: Final = 4  # the least among the suspects, ns
LINE_X: Final = 5  # a point of the line beneath all points: device time, host time since the first frame, ns
LINE_Y: Final = 6
DRIFT: Final = 7  # host seconds per device second, less 1
PRIOR: Final = 8  # what the drift was when this line began
SINCE: Final = 9  # device time at which this line began, ns
SINCE_HOST: Final = 10  # host time of that, ns
ROUGH: Final = 11  # 1 where the tick is not known but measured in half a second
SCATTER: Final = 12  # mean height of the blocks' lowest points above the line, ns
BLOCK: Final = 13  # length of a block, ns
BLOCK_END: Final = 14  # device time, ns
BLOCK_SINCE: Final = 15  # host time of its first frame, ns
BEST_X: Final = 16  # lowest point of the block so far
BEST_Y: Final = 17
POINTS: Final = 18  # blocks that are remembered
WORST: Final = 19  # longest delay, ns
USUAL: Final = 20  # delay that is nothing special, ns
TOLD_DELAY: Final = 21  # of the last frame that the line took, ns
SPEED: Final = 22  # how many times faster than time the line runs
CAPACITY: Final = 64
BLOCK_X: Final = 23  # their lowest points
BLOCK_Y: Final = BLOCK_X + CAPACITY
HULL_X: Final = BLOCK_Y + CAPACITY  # corners of the lower hull: room to work
HULL_Y: Final = HULL_X + CAPACITY
REALS: Final = HULL_Y + CAPACITY

# --- what became of a frame
DUPLICATE: Final = 1
LATE: Final = 2
AHEAD: Final = 4
RESET: Final = 8
WRAPPED: Final = 16
SUSPECT: Final = 32
BROKEN: Final = 64
UNSURE: Final = 128
UNUSED: Final = DUPLICATE | LATE | AHEAD
