"""The Python of a kernel: its tree, its lines, what its names mean, and its types, by annotations and as C has them."""

import ast
import functools
import inspect
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import FunctionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from plumbob.core.kernels import Kernel, bare

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


@dataclass(frozen=True)
class KernelSource:
    """A kernel as it is written."""

    func: FunctionType
    tree: ast.FunctionDef
    lines: list[str]
    first: int

    def where(self, node: ast.AST) -> str:
        """File and line of a part of it."""
        return f"{self.func.__code__.co_filename}:{self.first + getattr(node, 'lineno', 1) - 1}"

    def line(self, node: ast.stmt) -> str:
        """The first line of a statement."""
        return self.lines[node.lineno - 1].strip()

    def kernel(self, node: ast.expr) -> FunctionType | None:
        """The kernel that a name means."""
        meant = self.func.__globals__.get(node.id) if isinstance(node, ast.Name) else None
        return kernel_function(meant) if isinstance(meant, Kernel) and meant is not bare else None

    def fields(self, name: str) -> tuple[str, ...]:
        """Names of the parts of a parameter that is a named tuple."""
        kind = signature(self.func)[0].get(name)
        return kind.names if isinstance(kind, Several) else ()

    def constant(self, node: ast.expr) -> Any:
        """Value of an expression of names of modules and numbers alone; None where it is none."""
        try:
            code = compile(ast.Expression(node), self.func.__code__.co_filename, "eval")
            numbers = _Constants(self.func.__globals__, self.func.__code__.co_varnames)
            return eval(code, {"__builtins__": {}}, numbers)  # noqa: S307 - the package's own source
        except (_NoNumberError, TypeError, AttributeError, ArithmeticError):
            return None


class _NoNumberError(Exception):
    pass


class _Constants(Mapping[str, Any]):
    """Globals of a kernel, less what its variables hide."""

    def __init__(self, named: dict[str, Any], hidden: tuple[str, ...]) -> None:
        self._named, self._hidden = named, hidden

    def __getitem__(self, name: str) -> Any:
        if name in self._hidden or name not in self._named or isinstance(self._named[name], Kernel):
            raise _NoNumberError(name)
        return self._named[name]

    def __iter__(self) -> Any:
        return iter(self._named)

    def __len__(self) -> int:
        return len(self._named)


def kernel_function(kernel: Kernel[..., Any]) -> FunctionType:
    """The Python function of a kernel."""
    assert isinstance(kernel.py_func, FunctionType)
    return kernel.py_func


@functools.cache
def read_source(func: FunctionType) -> KernelSource:
    """Read the source of a kernel; that of a specialised one is its pattern's."""
    lines, first = inspect.getsourcelines(func.__code__)
    tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
    if not isinstance(tree, ast.FunctionDef):
        raise UnsupportedError(f"{func.__code__.co_filename}:{first}: no function")
    return KernelSource(func, tree, textwrap.dedent("".join(lines)).splitlines(), first)


def room_name(func: FunctionType) -> str:
    """Folder of the package in which a kernel stands."""
    return "_".join(func.__module__.split(".")[1:-1])


def name_in_c(func: FunctionType) -> str:
    """Name of a kernel in C."""
    return (func.__module__.removeprefix("plumbob.") + "." + func.__qualname__).replace(".", "_").replace("-", "_")
