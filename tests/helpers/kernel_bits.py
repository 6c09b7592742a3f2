"""Each kernel's C beside its Python on random and special numbers; for a process whose kernels are plain Python.

Both refuse an index outside an array; what Python refuses for another reason, C is not asked.
"""

import math

import numpy as np

from plumbob.core import kernels
from plumbob.core.kernels import emit
from plumbob.core.kernels.sources import DOUBLE, INTEGER, TRUTH, Array
from plumbob.core.kernels.translate import typed

KINDS = {"f64": np.float64, "i64": np.int64, "u64": np.uint64, "u32": np.uint32, "u8": np.uint8, "truth": np.bool_}
SPECIAL = np.array([0.0, -0.0, math.nan, 5e-324, -5e-324, 1e-300, 1e300, math.inf, -math.inf, 1.0, 2.0, -1.0])
SHAPES = (
    {1: (700,), 2: (48, 48), 3: (6, 48, 48), 4: (4, 3, 4, 3)},
    {1: (30,), 2: (40, 40), 3: (40, 40, 40), 4: (40,) * 4},
)
WILD = (0.0, 0.0, 0.05, 0.3)  # share of special numbers
REFUSED = (ZeroDivisionError, OverflowError, ValueError)


class Counted(np.ndarray):
    """An array that has no place before its first one, as none in C has."""

    def __getitem__(self, place):
        return super().__getitem__(self._checked(place))

    def __setitem__(self, place, value):
        super().__setitem__(self._checked(place), value)

    @staticmethod
    def _checked(place):
        if any(
            isinstance(one, int | np.integer) and one < 0 for one in (place if isinstance(place, tuple) else [place])
        ):
            raise IndexError(place)
        return place


def drawn(kind, rng, wild, shapes):
    """A value of a type; whole numbers are small, as they may be places in an array."""
    if kind == DOUBLE:
        return float(rng.choice(SPECIAL)) if rng.random() < wild else float(rng.normal() * 10.0 ** rng.integers(-3, 3))
    if kind in (INTEGER, TRUTH):
        return int(rng.integers(0, 5)) if kind == INTEGER else bool(rng.integers(0, 2))
    if not isinstance(kind, Array):
        items = [drawn(one, rng, wild, shapes) for one in kind.items]
        return kind.maker(*items) if kind.maker else tuple(items)
    shape = shapes[kind.axes]
    if kind.item != "f64":
        found = rng.integers(0, 6, size=shape)
        return (np.sort(found, axis=0) if rng.random() < 0.5 else found).astype(KINDS[kind.item])
    values = rng.normal(size=shape) * 10.0 ** rng.integers(-2, 2, size=shape)
    if rng.random() < 0.3:
        values = np.floor(np.abs(values) % 4.0)
    some = rng.random(shape) < wild
    values[some] = rng.choice(SPECIAL, size=some.sum())
    return values


def copied(value):
    if isinstance(value, tuple):
        items = [copied(one) for one in value]
        return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
    return value.copy().view(Counted) if isinstance(value, np.ndarray) else value


def bits(value):
    """What two values must have in common; the bits of a NaN mean nothing."""
    if isinstance(value, tuple):
        return tuple(map(bits, value))
    if isinstance(value, np.ndarray):
        return (np.where(np.isnan(value), np.nan, value) if value.dtype.kind == "f" else value).tobytes()
    value = value.item() if isinstance(value, np.generic) else value
    return value.hex() if isinstance(value, float) else value


def everything():
    """For each room how often each kernel was compared, and where the bits differ."""
    return {room: compared(funcs) for room, funcs in emit.rooms().items()}


def compared(funcs):
    """The same of some kernels."""
    counts, differ = {}, []
    for func in funcs:
        key = kernels.name_in_extension(func)
        counts[key] = 0
        for seed, wild in enumerate(WILD):
            rng = np.random.default_rng(seed)
            given = [drawn(kind, rng, wild, SHAPES[seed % 2]) for kind in typed(func)[0].values()]
            plain, compiled = copied(tuple(given)), copied(tuple(given))
            try:
                with np.errstate(all="ignore"):
                    expected = func(*plain)
            except IndexError:
                expected = IndexError
            except REFUSED:
                continue
            try:
                answer = getattr(kernels.extension(), key)(*compiled)
            except IndexError:
                answer = IndexError
            if IndexError in (answer, expected):
                if answer is not expected:
                    differ.append(f"{key}, seed {seed}: {answer}, but Python has {expected}")
                continue
            if bits((answer, compiled)) != bits((expected, plain)):
                differ.append(f"{key}, seed {seed}: {answer}, but Python has {expected}")
            counts[key] += 1
    return counts, differ
