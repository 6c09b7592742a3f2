"""One instant of an inertial unit, as a decoder yields it and a filter takes it."""

import operator
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ParameterError, ShapeError

UNITS = {"gyr": "rad/s", "acc": "m/s2", "mag": "uT"}
_HALF = 1 << 63


class ImuSample:
    """One instant of an inertial unit.

    The nine numbers stand in one array, for then a streamed call of a filter hands over one pointer. That is why this
    is not a dataclass.

    Parameters
    ----------
    t_ns : int
        Time, ns, on any clock that runs forward.
    gyr, acc, mag : array_like (3,), optional
        Angular rate, rad/s, specific force, m/s², magnetic flux density, µT, in body axes; None is absent.
    temp_c : float, optional
        Temperature, °C.
    flags : int
        What the source knows, from `plumbob.core.flags`: ends of ranges, gaps.

    Attributes
    ----------
    values : ndarray (9,)
        gyr, acc and mag in this order, NaN where absent; read-only.

    Raises
    ------
    ClockError
        If the time is not a whole number of ns, or beyond 64 bits.
    ShapeError
        If a triad is not three numbers.
    ParameterError
        If the flags are not a word of 32 bits.
    """

    __slots__ = ("flags", "t_ns", "temp_c", "values")

    def __init__(
        self,
        t_ns: int,
        gyr: ArrayLike | None = None,
        acc: ArrayLike | None = None,
        mag: ArrayLike | None = None,
        temp_c: float | None = None,
        flags: int = 0,
    ) -> None:
        values = np.empty(9)
        _fill(values[0:3], "gyr", gyr)
        _fill(values[3:6], "acc", acc)
        _fill(values[6:9], "mag", mag)
        values.flags.writeable = False
        self.t_ns, self.values, self.temp_c, self.flags = _time(t_ns), values, temp_c, _word(flags)

    @classmethod
    def packed(cls, t_ns: int, values: ArrayLike, temp_c: float | None = None, flags: int = 0) -> Self:
        """Sample of nine numbers, gyr, acc and mag, NaN where absent."""
        nine = check.floats("values", values).copy()
        if nine.shape != (9,):
            raise ShapeError(f"values of a sample must have shape (9,), but their shape is {nine.shape}.")
        nine.flags.writeable = False
        sample = cls.__new__(cls)
        sample.t_ns, sample.values, sample.temp_c, sample.flags = _time(t_ns), nine, temp_c, _word(flags)
        return sample

    def corrected(self, values: Floats) -> "ImuSample":
        """The same sample with other values (9,), which are handed over."""
        values.flags.writeable = False
        sample = ImuSample.__new__(ImuSample)
        sample.t_ns, sample.values, sample.temp_c, sample.flags = self.t_ns, values, self.temp_c, self.flags
        return sample

    @property
    def gyr(self) -> Floats:
        """Angular rate, rad/s, (3,); NaN where absent."""
        return self.values[0:3]

    @property
    def acc(self) -> Floats:
        """Specific force, m/s², (3,); NaN where absent."""
        return self.values[3:6]

    @property
    def mag(self) -> Floats:
        """Magnetic flux density, µT, (3,); NaN where absent."""
        return self.values[6:9]

    def __repr__(self) -> str:
        triads = ", ".join(f"{name}={getattr(self, name).tolist()}" for name in ("gyr", "acc", "mag"))
        return f"ImuSample(t_ns={self.t_ns}, {triads}, temp_c={self.temp_c}, flags={self.flags})"


def _fill(place: Floats, name: str, triad: ArrayLike | None) -> None:
    if triad is None:
        place[:] = np.nan
        return
    if not (type(triad) is np.ndarray and triad.dtype == np.float64):
        triad = check.floats(name, triad)
    if triad.shape != (3,):
        raise ShapeError(f"{name} of a sample must have shape (3,), but its shape is {triad.shape}.")
    place[:] = triad


def _time(t_ns: Any) -> int:
    try:
        time = operator.index(t_ns)
    except TypeError:
        raise ClockError(f"t_ns must be a whole number of nanoseconds, but it is {t_ns!r}.") from None
    if not -_HALF <= time < _HALF:
        raise ClockError(f"t_ns must lie within ±2^63 ns, ±292 years, but it is {time}.")
    return time


def _word(flags: Any) -> int:
    try:
        word = operator.index(flags)
    except TypeError:
        raise ParameterError(
            f"flags must be a whole number, bits of plumbob.core.flags, but it is {flags!r}."
        ) from None
    if not 0 <= word < 1 << 32:
        raise ParameterError(f"flags must be a word of 32 bits, from plumbob.core.flags, but it is {word}.")
    return word
