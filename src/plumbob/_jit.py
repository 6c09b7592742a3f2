"""The one door to numba: lazy, cached by content, optional.

`njit` marks a scalar kernel without importing numba. On its first call, a kernel and those that it names are compiled
together. Four facts of numba make this file necessary: its import costs about a third of a second; its file cache does
not notice an edit in another file (so the cache folder carries a fingerprint of all kernel sources, and a kernel from
elsewhere is not cached); where the folder cannot be written, it caches beside the sources, or raises (so here it falls
back to no cache); and a damaged cache file or a full disk stops the call (here it costs a compilation).

With ``NUMBA_DISABLE_JIT=1`` in the environment, kernels run as plain Python and give the same bits.
"""

import functools
import hashlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any, Generic, ParamSpec, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")

_KERNEL_SOURCES = ("constants.py", "flags.py", "_jit.py", "rotations/*.py", "filters/*.py")
_COMPILING = threading.RLock()  # numba's cache folder is a global of the process


class Kernel(Generic[P, R]):
    """A scalar function that is compiled when it is first called."""

    def __init__(self, py_func: Callable[P, R]) -> None:
        self.py_func = py_func
        self._compiled: Callable[P, R] | None = None
        functools.update_wrapper(self, py_func)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the compiled kernel, or the Python one where JIT is off."""
        return self.compiled(*args, **kwargs)

    @property
    def compiled(self) -> Callable[P, R]:
        """The function to call in a hot loop: numba's dispatcher, or the Python function where JIT is off."""
        if self._compiled is None:
            with _COMPILING:
                if self._compiled is None:
                    self._compiled = self.py_func if jit_disabled() else _compile(self)
        return self._compiled


def njit(py_func: Callable[P, R]) -> Kernel[P, R]:
    """Mark a kernel. It may call other kernels by their plain global names, and nothing else of this project."""
    return Kernel(py_func)


def specialise(loop: Kernel[..., R], name: str, **kernels: Kernel[..., Any]) -> Kernel[..., R]:
    """Return a copy of `loop` in which the given global names mean the given kernels.

    This is how one batch loop serves every filter without a function pointer: each filter's loop is compiled with that
    filter's step inlined.

    Parameters
    ----------
    loop : Kernel
        The pattern; it names its callee as a module global.
    name : str
        Name of the copy. With the names of the kernels it names the file in numba's cache, which knows a function by
        its name and its own code, not by what it calls.
    **kernels : Kernel
        What the globals mean.
    """
    pattern = cast(FunctionType, loop.py_func)
    copy = FunctionType(pattern.__code__, {**pattern.__globals__, **kernels}, name, pattern.__defaults__)
    meaning = (f"{k}={v.py_func.__module__}.{v.py_func.__qualname__}" for k, v in sorted(kernels.items()))
    copy.__qualname__ = f"{name}-{hashlib.sha256(' '.join(meaning).encode()).hexdigest()[:12]}"
    copy.__module__ = pattern.__module__
    return Kernel(copy)


def jit_disabled() -> bool:
    """True where the environment asks for plain Python."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}


def cache_folder() -> Path:
    """Folder of the compiled kernels for exactly these sources, this Python and this user."""
    base = os.environ.get("PLUMBOB_CACHE_DIR")
    if base is None:
        import platformdirs

        base = platformdirs.user_cache_dir("plumbob", appauthor=False)
    return Path(base) / f"kernels-py{sys.version_info.major}{sys.version_info.minor}-{_fingerprint()}"


def is_cold(name: str) -> bool:
    """True where the cache holds no kernel of that name yet, so that its first call will wait."""
    if jit_disabled():
        return False
    folder = cache_folder()
    return not (folder.is_dir() and any(folder.rglob(f"*.{name}-*.nbi")))


def _sources() -> dict[Path, bytes]:
    root = Path(__file__).parent
    return {path: path.read_bytes() for pattern in _KERNEL_SOURCES for path in sorted(root.glob(pattern))}


@functools.cache
def _fingerprint() -> str:
    digest = hashlib.sha256()
    for path, content in _SOURCES.items():
        digest.update(path.relative_to(Path(__file__).parent).as_posix().encode())
        digest.update(content)
    return digest.hexdigest()[:16]
