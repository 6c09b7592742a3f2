"""Kernels: scalar functions in a subset of Python, of which C is made when Plumbob is built.

`kernel` marks one. Called from Python it runs in C, `plumbob._kernels`; with ``PLUMBOB_KERNELS=python`` in the
environment, or where no C could be built, as the Python that it is, which gives the same bits some hundred times
slower. In a checkout an edit is noticed by the content of the sources, and C is made again before a kernel runs.

`translate` says what the subset is; ``python -m plumbob.core.kernels build`` makes the extension.
"""

import functools
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, Generic, ParamSpec, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")

PACKAGE = Path(__file__).parents[2]
STAMP = PACKAGE / "_kernels.json"  # which sources the extension beside it was made of, and a hash of their content
CHECKOUT = PACKAGE.parents[1]


class Kernel(Generic[P, R]):
    """A scalar function that runs in C."""

    def __init__(self, py_func: Callable[P, R]) -> None:
        self.py_func = py_func
        self._compiled: Callable[P, R] | None = None
        functools.update_wrapper(self, py_func)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run it; arrays whose numbers do not stand one behind the other are copied, and written back."""
        try:
            return self.compiled(*args, **kwargs)
        except ValueError:
            copies = tuple(map(_in_a_row, args))
            if all(copy is given for copy, given in zip(copies, args, strict=True)):
                raise
        answer = self.compiled(*copies, **kwargs)
        for given, copy in zip(args, copies, strict=True):
            _write_back(given, copy)
        return answer

    @property
    def compiled(self) -> Callable[P, R]:
        """The function to call in a hot loop: C, or the Python function where that is all there is."""
        if self._compiled is None:
            self._compiled = self.py_func if is_plain() else _in_c(self.py_func)
        return self._compiled


def _in_a_row(value: Any) -> Any:
    """An array, or those of a tuple, with numbers that stand one behind the other."""
    if isinstance(value, tuple):
        items = [_in_a_row(item) for item in value]
        if all(item is before for item, before in zip(items, value, strict=True)):
            return value
        return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
    if not hasattr(value, "flags") or value.flags.c_contiguous:
        return value
    copy = value.copy()
    copy.flags.writeable = value.flags.writeable
    return copy


def _write_back(given: Any, copy: Any) -> None:
    """Bring what a kernel wrote into a copy to where it was given."""
    if isinstance(given, tuple):
        for part, copied in zip(given, copy, strict=True):
            _write_back(part, copied)
    elif copy is not given and given.flags.writeable:
        given[...] = copy


def kernel(py_func: Callable[P, R]) -> Kernel[P, R]:
    """Mark a kernel. It may call other kernels by their plain global names, and nothing else of this project."""
    return Kernel(py_func)


def wide(loop: Kernel[P, R]) -> Kernel[P, R]:
    """Mark a kernel that sums long arrays in lanes: C also has a form for processors with AVX2, of the same bits."""
    loop.py_func.__dict__["is_wide"] = True
    return loop


def _itself(array: Any) -> Any:
    return array


bare = Kernel(_itself)  # numbers of an array in a row, which a kernel hands to one that counts them itself


def specialise(loop: Kernel[..., R], name: str, *, inline: bool = False, **kernels: Kernel[..., Any]) -> Kernel[..., R]:
    """Return a copy of `loop`, called `name` as C has it, in which the given global names mean the given kernels.

    This is how one batch loop serves every filter without a function pointer: each filter's loop has that filter's step
    inlined. `inline` all that it calls: worth the time of a compiler for a loop that runs often.
    """
    pattern = cast(FunctionType, loop.py_func)
    copy = FunctionType(pattern.__code__, {**pattern.__globals__, **kernels}, name, pattern.__defaults__)
    copy.__annotations__ = pattern.__annotations__
    copy.__qualname__ = name
    copy.__module__ = pattern.__module__
    copy.__dict__["is_inlined"] = inline
    return Kernel(copy)


def is_plain() -> bool:
    """True where the environment asks for plain Python."""
    return os.environ.get("PLUMBOB_KERNELS", "") == "python"


def name_in_extension(func: Callable[..., Any]) -> str:
    """Name of a kernel in the extension."""
    return f"{func.__module__}.{func.__qualname__}"


def content_hash(files: list[str]) -> str:
    """Hash of the content of files of the package."""
    digest = hashlib.sha256()
    for name in files:
        digest.update(name.encode() + b"\0" + (PACKAGE / name).read_bytes())
    return digest.hexdigest()


def is_fresh() -> bool:
    """Whether the extension was made of the sources that are there."""
    try:
        stamp = json.loads(STAMP.read_text(encoding="utf-8"))
        return bool(content_hash(stamp["files"]) == stamp["hash"])
    except (OSError, ValueError, KeyError):
        return False


@functools.cache
def extension() -> ModuleType | None:
    """The kernels in C, made again in a checkout whose sources were edited; None and a warning where there are none."""
    if not is_fresh() and not _build():
        _warn("are not built, or from other sources")
        return None
    try:
        return import_module("plumbob._kernels")
    except ImportError as error:
        _warn(f"cannot be loaded ({error})")
        return None


def is_checkout() -> bool:
    """Whether the package stands among what builds it."""
    return (CHECKOUT / "pyproject.toml").is_file() and (CHECKOUT / "hatch_build.py").is_file()


def _build() -> bool:
    """Build in a checkout; whether that went well."""
    if not is_checkout():
        return False
    words = [sys.executable, "-m", "plumbob.core.kernels", "build"]
    places = os.pathsep.join(filter(None, (str(PACKAGE.parent), os.environ.get("PYTHONPATH"))))
    env = {**os.environ, "PLUMBOB_KERNELS": "python", "PYTHONPATH": places}
    done = subprocess.run(words, env=env, capture_output=True, check=False)
    if done.returncode:
        sys.stderr.write(done.stderr.decode(errors="replace"))
    return done.returncode == 0 and is_fresh()


def _warn(why: str) -> None:
    import logging

    logging.getLogger("plumbob").warning(
        "note: Plumbob's kernels in C %s, so they run as Python: the same numbers, some hundred times slower. Install "
        "a C compiler, or ziglang from PyPI, and install Plumbob again.", why
    )  # fmt: skip


def _in_c(func: Callable[P, R]) -> Callable[P, R]:
    """A kernel's function in the extension; what it returns as a named tuple becomes one."""
    function = getattr(extension(), name_in_extension(func), None)
    if function is None:
        return func
    answer = func.__annotations__.get("return")
    if isinstance(answer, type) and issubclass(answer, tuple):
        return lambda *args, **kwargs: cast(R, answer(*function(*args, **kwargs)))
    return cast(Callable[P, R], function)
