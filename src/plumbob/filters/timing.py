"""Time steps of samples that arrive in order, mostly.

Steps are differences of integer nanoseconds, so that cutting a recording in chunks keeps every bit; the state is all
float64, which holds a time of today only as whole seconds and nanoseconds apart. A sample that is not later than the
last one taken is late and not used. Only when `RISING` samples in a row are late, but in order among themselves, has
the source's clock been set back, and the filter follows it.
"""

from typing import Final

from plumbob._jit import njit
from plumbob.check import Floats
from plumbob.filters.layout import CLOCK, COUNT

RISING: Final = 3.0
LATE: Final = -1.0
"""Step of a sample that must not be used."""

_LAST: Final = CLOCK
_FIRST_LATE: Final = CLOCK + 2
_LAST_LATE: Final = CLOCK + 4
_COUNT: Final = CLOCK + 6
_SECOND: Final = 1_000_000_000


@njit
def _since(x: Floats, place: int, t_ns: int) -> float:
    whole = (t_ns // _SECOND - int(x[place])) * _SECOND
    return (whole + (t_ns % _SECOND - int(x[place + 1]))) / 1e9


@njit
def _remember(x: Floats, place: int, t_ns: int) -> None:
    x[place], x[place + 1] = float(t_ns // _SECOND), float(t_ns % _SECOND)


@njit
def tick(x: Floats, t_ns: int) -> float:
    """Step to a sample at t_ns, s; 0 for the first, and `LATE` for one that must not be used."""
    dt = _since(x, _LAST, t_ns)
    if dt > 0.0 or x[COUNT] == 0.0:
        _remember(x, _LAST, t_ns)
        x[_COUNT] = 0.0
        return dt if x[COUNT] > 0.0 else 0.0
    behind = _since(x, _LAST_LATE, t_ns)
    if x[_COUNT] == 0.0 or not behind > 0.0:
        _remember(x, _FIRST_LATE, t_ns)
        x[_COUNT] = 0.0
    _remember(x, _LAST_LATE, t_ns)
    x[_COUNT] += 1.0
    if x[_COUNT] < RISING:
        return LATE
    _remember(x, _LAST, t_ns)
    x[_COUNT] = 0.0
    return _since(x, _FIRST_LATE, t_ns) + behind  # what the late ones did not turn is made up for
