"""Types of what kernels take and give, as annotations say them and as C has them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

DOUBLE, INTEGER, WORD, TRUTH, NOTHING = "double", "int64_t", "uint64_t", "bool", "void"
ITEMS = {np.float64: "f64", np.int64: "i64", np.uint64: "u64", np.uint32: "u32", np.uint8: "u8", np.bool_: "truth"}
"""Numbers of an array, and their name in C; `kernels.h` has an array of each for one to three axes."""
LOADED = {"f64": DOUBLE, "i64": INTEGER, "u64": WORD, "u32": INTEGER, "u8": INTEGER, "truth": TRUTH}
"""What a number of an array is once it is read."""


@dataclass(frozen=True)
class Array:
    """Numbers in a row, or in rows of rows, one behind the other; `axes` is 0 where it is not known yet."""

    item: str
    axes: int = 0

    def __str__(self) -> str:
        return f"{self.item}_{self.axes}"


@dataclass(frozen=True)
class Several:
    """A tuple, or a named one."""

    items: tuple["Type", ...]
    names: tuple[str, ...] = ()
    maker: Any = None

    def __str__(self) -> str:
        return (
            self.maker.__name__ if self.maker else "t_" + "_".join(str(item).removesuffix("_t") for item in self.items)
        )

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the parts in C."""
        return self.names or tuple(f"part{i}" for i in range(len(self.items)))

    def declaration(self) -> str:
        """The struct of it."""
        parts = " ".join(f"{kind} {name};" for kind, name in zip(self.items, self.fields, strict=True))
        return f"typedef struct {{ {parts} }} {self};"


Type = str | Array | Several


class UnsupportedError(Exception):
    """What is not in the subset of Python that becomes C."""


def of_annotation(hint: Any) -> Type:
    """Type by an annotation: a number, an array of numbers, or a tuple of such."""
    if hint in (float, int, bool, type(None)):
        return {float: DOUBLE, int: INTEGER, bool: TRUTH, type(None): NOTHING}[hint]
    if get_origin(hint) in (np.ndarray, NDArray):  # an alias by itself since NumPy 2.5 on Python 3.12
        (item,) = get_args(hint) if get_origin(hint) is NDArray else get_args(get_args(hint)[1])
        if item in ITEMS:
            return Array(ITEMS[item])
    if get_origin(hint) is tuple and Ellipsis not in get_args(hint):
        return Several(tuple(map(of_annotation, get_args(hint))))
    if isinstance(hint, type) and issubclass(hint, tuple) and hasattr(hint, "_fields"):
        hints = get_type_hints(hint)
        return Several(tuple(of_annotation(hints[name]) for name in hint._fields), hint._fields, hint)
    raise UnsupportedError(
        f"{hint} is not a type of a kernel: float, int, bool, NDArray of one kind, or a tuple of these"
    )


def signature(func: Callable[..., Any]) -> tuple[dict[str, Type], Type]:
    """Types of a kernel's parameters, and of what it returns."""
    hints = get_type_hints(func)
    names = func.__code__.co_varnames[: func.__code__.co_argcount]
    missing = [name for name in (*names, "return") if name not in hints]
    try:
        if missing:
            raise UnsupportedError(f"no annotation of {', '.join(missing)}")
        return {name: of_annotation(hints[name]) for name in names}, of_annotation(hints["return"])
    except UnsupportedError as error:
        code = func.__code__
        raise UnsupportedError(f"{code.co_filename}:{code.co_firstlineno}: in {code.co_name}: {error}") from None


def joined(first: Type, second: Type) -> Type:
    """Type of a variable that is assigned both."""
    if first == second:
        return first
    for wide in (DOUBLE, INTEGER):
        if {first, second} <= {wide, INTEGER, TRUTH} and wide in (first, second):
            return wide
    if isinstance(first, Several) and isinstance(second, Several) and len(first.items) == len(second.items):
        items = tuple(joined(a, b) for a, b in zip(first.items, second.items, strict=True))
        named = first if first.maker else second
        return Several(items, named.names, named.maker)
    raise UnsupportedError(f"one name for {first} and {second}")
