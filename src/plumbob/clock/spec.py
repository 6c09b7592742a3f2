"""What a format has to tell the time by."""

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from plumbob.errors import ParameterError

_LARGEST: Final = 2**30  # so that the products of both and a count's remainder stay in 64 bits
_SLOWEST, _FASTEST = 1e-3, 1e6  # Hz
_HOUR: Final = 3_600_000_000_000  # ns


@dataclass(frozen=True, slots=True)
class Counter:
    """An unsigned counter in a frame.

    Attributes
    ----------
    bits : int
        Its width, 1 to 64.
    tick_ns : Fraction, int, float or None
        Time of one count, ns; a float means the decimal number that it prints, and 1/3 must be a `Fraction`. None says
        that it counts frames.
    down : bool
        Whether it counts down.
    """

    bits: int
    tick_ns: Fraction | int | float | None = None
    down: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot be counted.

        Raises
        ------
        ParameterError
            If the width is not 1 to 64, or a tick is no plain fraction of up to an hour.
        """
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
    """What the frames of one source bring to tell the time by.

    Attributes
    ----------
    clock : Counter, optional
        Device clock: a counter with a tick.
    frames : Counter, optional
        Frame counter: a counter without.
    rate : float, optional
        Nominal rate of the frames, Hz. Without a device clock and a rate, the first half second goes into measuring it.
    frame_bytes : int, optional
        Length of a frame where all are equally long and nothing else is on the line; then a damaged frame is seen by
        the place of the next. Used only where there is no counter.
    speed : float
        How many times faster than time an emulated line runs, whose host times are stretched by it: a stall of the host
        is stretched too, and has to be waited for as much longer.
    """

    clock: Counter | None = None
    frames: Counter | None = None
    rate: float | None = None
    frame_bytes: int | None = None
    speed: float = 1.0

    def __post_init__(self) -> None:
        """Refuse counters in each other's place, and impossible rates.

        Raises
        ------
        ParameterError
            If a clock has no tick, a frame counter has one, or the rate, the length or the speed is out of range.
        """
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
