"""The Python of a kernel: its tree, its lines, and what its names mean."""

import ast
import functools
import inspect
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from types import FunctionType
from typing import Any

from plumbob.core.kernels import Kernel, bare
from plumbob.core.kernels.types import Several, UnsupportedError, signature


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
