"""Group F9 as data: objects given as the accelerometer sample, and what each of them can mean."""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from plumbob.check import Floats

VECTOR: Final = np.array([0.5, -1.25, 9.75])
"""m/s²; half-precision numbers hold it exactly, so that every way to write it must give the same bits."""
WHOLE: Final = np.array([1.0, -2.0, 9.0])
ABSENT: Final = np.full(3, math.nan)


@dataclass(frozen=True, slots=True)
class ApiCase:
    """One object.

    Attributes
    ----------
    name : str
        As in the tables.
    given : object
        What is handed over in place of a float64 array of shape (3,).
    means : ndarray (3,) or None
        The numbers that it stands for; None where it cannot mean three numbers.
    """

    name: str
    given: Any
    means: Floats | None


def _read_only() -> Floats:
    array = VECTOR.copy()
    array.flags.writeable = False
    return array


def _shapes() -> list[ApiCase]:
    return [
        ApiCase("shape (0,)", np.empty(0), None),
        ApiCase("shape (2,)", VECTOR[:2].copy(), None),
        ApiCase("shape (4,)", np.append(VECTOR, 1.0), None),
        ApiCase("shape (1, 3)", VECTOR[np.newaxis].copy(), None),
        ApiCase("shape (3, 1)", VECTOR[:, np.newaxis].copy(), None),
        ApiCase("numpy matrix", np.ones((1, 3)).view(np.matrix), None),
        ApiCase("nested list", [VECTOR.tolist()], None),
        ApiCase("empty list", [], None),
    ]


def _layouts() -> list[ApiCase]:
    spread = np.zeros(6)
    spread[::2] = VECTOR
    return [
        ApiCase("negative stride", VECTOR[::-1].copy()[::-1], VECTOR),
        ApiCase("every second of six", spread[::2], VECTOR),
        ApiCase("column of a Fortran table", np.asfortranarray(np.column_stack([VECTOR, VECTOR]))[:, 0], VECTOR),
        ApiCase("read-only", _read_only(), VECTOR),
        ApiCase("memoryview", VECTOR.copy().data, VECTOR),
        ApiCase("list", VECTOR.tolist(), VECTOR),
        ApiCase("tuple", tuple(VECTOR.tolist()), VECTOR),
    ]


def _types() -> list[ApiCase]:
    return [
        ApiCase("int64", WHOLE.astype(np.int64), WHOLE),
        ApiCase("float32", VECTOR.astype(np.float32), VECTOR),
        ApiCase("float16", VECTOR.astype(np.float16), VECTOR),
        ApiCase("big-endian", VECTOR.astype(">f8"), VECTOR),
        ApiCase("object", VECTOR.astype(object), VECTOR),
        ApiCase("complex", VECTOR.astype(complex), None),
        ApiCase("bool", np.array([False, False, True]), None),
        ApiCase("datetime64", np.arange(3).astype("datetime64[s]"), None),
        ApiCase("structured", np.zeros(3, dtype=[("x", "f8"), ("y", "f8")]), None),
        ApiCase("masked", np.ma.MaskedArray(VECTOR, mask=[False, True, False]), None),
        ApiCase("list of str", [str(v) for v in VECTOR.tolist()], None),
        ApiCase("str", "0.5 -1.25 9.75", None),
        ApiCase("NaN", math.nan, None),
        ApiCase("None", None, None),
    ]


API_CASES: Final[tuple[ApiCase, ...]] = (*_shapes(), *_layouts(), *_types())
