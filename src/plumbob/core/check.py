"""Checks of arguments: numbers, arrays, words and paths, refused with what came instead; runs of marked places."""

import sys
from collections.abc import Sequence
from numbers import Real
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core.errors import ClockError, ParameterError, PlumbobError, ShapeError, excerpt
from plumbob.core.text import closest

Floats = NDArray[np.float64]
Kind = TypeVar("Kind")


def kind(
    name: str, value: Any, expected: type[Kind], *, hint: str = "", error: type[PlumbobError] = ShapeError
) -> Kind:
    """Return `value`, refusing what is not of the expected type; the hint says how to come by one."""
    if not isinstance(value, expected):
        raise error(f"{name} must be {_a(expected)}, but it is {said(value)}.{hint and ' '}{hint}")
    return value


def said(value: Any) -> str:
    """What a value is, in a few words for a message."""
    if value is None or isinstance(value, bool | int | float | str):
        return excerpt(value) if isinstance(value, str) else repr(value)
    return _a(type(value))


def _a(type_: type) -> str:
    return f"{'an' if type_.__name__[0] in 'AEIOUaeio' else 'a'} {type_.__name__}"


def number(name: str, value: Any, unit: str) -> float:
    """Return `value` as a float, refusing what is not one real number."""
    if not isinstance(value, Real) or isinstance(value, bool):
        raise ParameterError(f"{name} must be a number of {unit}, but it is {said(value)}.")
    return float(value)


def path(name: str, value: Any) -> Path:
    """Return `value` as a path, refusing what is neither a path nor its text."""
    try:
        return Path(value)
    except TypeError:
        raise ParameterError(f"{name} must be the path of a file, or its text, but it is {said(value)}.") from None


def floats(name: str, value: ArrayLike, kinds: str = "fiu") -> Floats:
    """Return `value` as a C-contiguous float64 array, refusing masked arrays and types of other `kinds` than these."""
    masked = getattr(sys.modules.get("numpy.ma"), "MaskedArray", ())  # where nobody has loaded it, none is there
    if isinstance(value, masked) or (isinstance(value, list | tuple) and any(isinstance(v, masked) for v in value)):
        raise ShapeError(f"{name} is a masked array; fill the masked samples with NaN: {name}.filled(np.nan).")
    try:
        array: NDArray[Any] = np.asarray(value)
    except ValueError as error:
        raise ShapeError(f"{name} must be an array of numbers, but NumPy cannot make one of it: {error}") from error
    if array.dtype.kind not in kinds:
        raise ShapeError(f"{name} must hold real numbers, but its type is {array.dtype}.")
    return np.asarray(array, dtype=np.float64, order="C")


def last_axis(name: str, value: ArrayLike, size: int) -> Floats:
    """Return `value` as float64 with a last axis of `size` components and any leading shape."""
    array = floats(name, value)
    if array.ndim == 0 or array.shape[-1] != size:
        raise ShapeError(f"{name} must have shape (..., {size}), but its shape is {array.shape}.")
    return array


def rows(name: str, value: ArrayLike, columns: int, count: int | None = None) -> Floats:
    """Return `value` as a float64 table of `columns` columns and, where given, `count` rows."""
    array = floats(name, value)
    if array.ndim != 2 or array.shape[1] != columns:
        hint = f"; it looks transposed: pass {name}.T" if array.ndim == 2 and array.shape[0] == columns else ""
        raise ShapeError(f"{name} must have shape (N, {columns}), but its shape is {array.shape}{hint}.")
    if count is not None and array.shape[0] != count:
        raise ShapeError(f"{name} must have one row per time stamp ({count}), but it has {array.shape[0]}.")
    return array


def column(name: str, value: ArrayLike, count: int | None = None, kinds: str = "fiu") -> Floats:
    """Return `value` as a float64 vector and, where given, of `count` entries."""
    array = floats(name, value, kinds)
    if array.ndim != 1:
        raise ShapeError(f"{name} must have shape (N,), but its shape is {array.shape}.")
    if count is not None and array.shape[0] != count:
        raise ShapeError(f"{name} must have one entry per time stamp ({count}), but it has {array.shape[0]}.")
    return array


def bits(name: str, value: ArrayLike, count: int) -> NDArray[np.uint32]:
    """Return `value` as `count` words of 32 flags."""
    words = column(name, value, count)
    bad = ~((words >= 0.0) & (words < 2.0**32) & (words == np.floor(words)))  # NaN is bad too
    if bad.any():
        i = int(np.argmax(bad))
        raise ShapeError(f"{name}[{i}] = {words[i]:g}, but flags are whole numbers from 0 to 2³² − 1.")
    return words.astype(np.uint32)


def mask(name: str, value: ArrayLike, count: int) -> NDArray[np.bool_]:
    """Return `value` as `count` truth values; numbers must be 0 or 1."""
    marks = column(name, value, count, "fiub")
    bad = (marks != 0.0) & (marks != 1.0)
    if bad.any():
        i = int(np.argmax(bad))
        raise ShapeError(f"{name}[{i}] = {marks[i]:g}, but it must be True or False.")
    return marks.astype(np.bool_)


def increasing_time(name: str, t: Floats) -> None:
    """Refuse time stamps that are not finite or do not strictly increase."""
    if t.shape[0] == 0:
        raise ShapeError(f"{name} is empty; a recording needs at least one sample.")
    finite = np.isfinite(t)
    if not finite.all():
        i = int(np.argmin(finite))
        raise ClockError(f"{name}[{i}] = {t[i]}: time stamps must be finite.")
    rises = t[1:] > t[:-1]
    if not rises.all():
        i, count = int(np.argmin(rises)), int(np.count_nonzero(~rises))
        raise ClockError(
            f"{name} must strictly increase, but {name}[{i + 1}] = {t[i + 1]:.9f} s comes after "
            f"{name}[{i}] = {t[i]:.9f} s ({count} such places). Samples keep their order and none need be lost: "
            "plumbob.files.stamps.time_line makes an even clock of such stamps."
        )


def unit_norm(name: str, q: Floats, tolerance: float = 1e-6) -> None:
    """Refuse quaternions whose norm is not 1; rows of NaN (absent) pass."""
    with np.errstate(over="ignore"):
        norm = np.sqrt(np.sum(q * q, axis=-1))
    bad = np.abs(norm - 1.0) > tolerance
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ShapeError(
            f"{name}{list(where) or ''} has norm {norm[where]:.9g}, but a rotation needs norm 1 ± {tolerance:g}."
        )


def one_of(name: str, value: str, words: Sequence[str]) -> str:
    """Refuse a word that is not in `words`."""
    if not isinstance(value, str) or value not in words:
        raise ShapeError(f"{name} must be one of {', '.join(words)}, but it is {said(value)}.{closest(value, words)}")
    return value


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return the numbers of `array` where nobody writes any more: itself if its memory is read-only, else a copy."""
    owner: Any = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            array = array.copy()
            array.flags.writeable = False
            break
        owner = owner.base
    return array.view()  # whose flag cannot be set back, while the memory's owner is read-only


def last_marked(marks: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Row of the last mark at or before each row, (N,); −1 before the first."""
    return np.maximum.accumulate(np.where(marks, np.arange(marks.size), -1))


def runs(marks: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First place and the one after the last of each run of marked places (N,), in order."""
    edges = np.flatnonzero(np.diff(marks.astype(np.int8), prepend=0, append=0))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
