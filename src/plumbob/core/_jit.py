"""The one door to numba: lazy, cached by content, optional.

`njit` marks a scalar kernel without importing numba. On its first call, a kernel and those that it names are compiled
together. Four facts of numba make this file necessary: its import costs about a third of a second; its file cache does
not notice an edit in another file (so the cache folder carries a fingerprint of all kernel sources, and a kernel from
elsewhere is not cached); where that folder cannot be written it caches beside the sources, or raises (so here it falls
back to no cache); and a damaged cache file or a full disk stops the call (here it costs a compilation).

A cached kernel is unpickled, which runs whatever its file says. So the folder must be this user's, and nobody else may
write in it: it is created with mode 0700, and one that is otherwise is not used; kernels are then compiled at each run,
and one line on the logger says why.

With ``NUMBA_DISABLE_JIT=1`` in the environment, kernels run as plain Python and give the same bits; only those marked
by `njit_reassociated` may round their sums otherwise.

Compiling takes seconds, once on each machine. When it has taken one, a line on the logger ``plumbob`` says so, once in
a process; without any set-up Python prints it on standard error. ``logging.getLogger("plumbob").setLevel("ERROR")``
silences it, and ``plumbob warmup`` compiles everything beforehand.
"""

import contextlib
import functools
import hashlib
import os
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any, Generic, ParamSpec, TypeVar, cast

if sys.platform != "win32":
    import fcntl

P = ParamSpec("P")
R = TypeVar("R")

_KERNEL_SOURCES = (
    "arm/*.py", "array/*.py", "core/*.py", "rotations/*.py", "acquisition/timing/*.py", "calibration/*.py",
    "calibration/*/*.py", "filters/*.py", "filters/*/*.py", "noise/*.py", "noise/static/*.py", "protocols/checksum.py",
    "protocols/scan.py",
    "protocols/unpack.py", "papers/rod/literal.py",
)  # fmt: skip
# Where fastmath is not given, numba compiles a kernel with what its first caller has.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "forceinline": True, "fastmath": False}
# Long sums are not inlined: every caller would compile their loops again, which takes seconds.
_REASSOCIATED: dict[str, Any] = {"fastmath": {"reassoc", "nsz", "contract"}, "forceinline": False}
_COMPILING = threading.RLock()  # numba's cache folder is a global of the process


def _read_sources() -> tuple[frozenset[str], str]:
    """Files of all kernels, and a hash of their content; read at import, when it is what the memory holds."""
    root = Path(__file__).parents[1]
    paths = [path for pattern in _KERNEL_SOURCES for path in sorted(root.glob(pattern))]
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return frozenset(map(str, paths)), digest.hexdigest()[:16]


_SOURCES, _FINGERPRINT = _read_sources()


class Kernel(Generic[P, R]):
    """A scalar function that is compiled when it is first called."""

    def __init__(self, py_func: Callable[P, R], options: Mapping[str, Any] | None = None) -> None:
        self.py_func = py_func
        self.options = {**_OPTIONS, **(options or {})}
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


class _Bare(Kernel[[Any], Any]):
    """The address of an array's first number, by which a kernel indexes it like the array."""

    @property
    def compiled(self) -> Callable[[Any], Any]:
        """An intrinsic to call from a kernel."""
        if self._compiled is None:
            self._compiled = self.py_func if jit_disabled() else _address_intrinsic()
        return self._compiled


def _address_intrinsic() -> Callable[[Any], Any]:
    from numba import types
    from numba.extending import intrinsic

    def bare(_typing: Any, array: Any) -> Any:
        def load(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return context.make_array(signature.args[0])(context, builder, value=args[0]).data

        return cast(Any, types.CPointer)(array.dtype)(array), load

    return cast(Callable[[Any], Any], intrinsic(bare))


def _itself(array: Any) -> Any:
    return array


bare = _Bare(_itself)
"""Loops hand their arrays to kernels as bare addresses: numba counts references to an array in every kernel that takes
one, with atomic operations that cost as much as the arithmetic. The array must outlive the call."""


def njit(py_func: Callable[P, R]) -> Kernel[P, R]:
    """Mark a kernel. It may call other kernels by their plain global names, and nothing else of this project."""
    return Kernel(py_func)


def njit_reassociated(py_func: Callable[P, R]) -> Kernel[P, R]:
    """Mark a kernel whose sums may be taken in any order, for long sums where the last bit means nothing.

    Addition in the written order is a chain that no processor can speed up: a sum of squares takes four times as long.
    NaN and infinity keep their meaning, unlike under all of fastmath.
    """
    return Kernel(py_func, _REASSOCIATED)


def specialise(loop: Kernel[..., R], name: str, **kernels: Kernel[..., Any]) -> Kernel[..., R]:
    """Return a copy of `loop` in which the given global names mean the given kernels.

    This is how one batch loop serves every filter without a function pointer: each filter's loop is compiled with that
    filter's step inlined.

    Parameters
    ----------
    loop : Kernel
        The pattern; it names its callee as a module global.
    name : str
        Name of the copy. A hash of what the kernels are is added, for numba's cache knows a function by its name and
        its own code, not by what it calls.
    **kernels : Kernel
        What the globals mean.
    """
    pattern = cast(FunctionType, loop.py_func)
    copy = FunctionType(pattern.__code__, {**pattern.__globals__, **kernels}, name, pattern.__defaults__)
    meant = hashlib.sha256()
    for word, kernel in sorted(kernels.items()):
        callee = cast(FunctionType, kernel.py_func)
        code = callee.__code__
        meant.update(f"{word}={callee.__module__}.{callee.__qualname__} {code.co_consts}".encode() + code.co_code)
    copy.__qualname__ = f"{name}-{meant.hexdigest()[:12]}"
    copy.__module__ = pattern.__module__
    return Kernel(copy, loop.options)


def jit_disabled() -> bool:
    """True where the environment asks for plain Python."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}


def cache_folder() -> Path:
    """Folder of the compiled kernels for exactly these sources, this Python and this user."""
    base = os.environ.get("PLUMBOB_CACHE_DIR")
    if not base:
        import platformdirs

        base = platformdirs.user_cache_dir("plumbob", appauthor=False)
    return Path(base) / f"kernels-py{sys.version_info.major}{sys.version_info.minor}-{_FINGERPRINT}"


def is_cold(name: str) -> bool:
    """True where the cache holds no kernel of that name yet, so that its first call will wait."""
    if jit_disabled():
        return False
    folder = cache_folder()
    try:
        return not (folder.is_dir() and any(_trusted(folder).rglob(f"*.{name}-*.nbi")))
    except _ForeignError:
        return True


def why_no_cache() -> str | None:
    """Why compiled kernels cannot be kept for the next process; None where they can."""
    import tempfile

    try:
        folder = _own_folder()
        with tempfile.TemporaryFile(dir=folder):
            return None
    except _ForeignError as error:
        return str(error)
    except (OSError, RuntimeError):
        return f"{cache_folder()} cannot be written"


class _ForeignError(Exception):
    """Another user could put code into the cache folder."""


def _own_folder() -> Path:
    """Cache folder, created where it is missing, in which nobody but this user can write."""
    folder = cache_folder().expanduser().absolute()  # without a home this raises
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return _trusted(folder)


def _trusted(folder: Path) -> Path:
    """Return the folder; raises where another user could write in it, in a folder in it, or put one in its place."""
    if not hasattr(os, "geteuid"):
        return folder
    user, above = os.geteuid(), folder.parent.stat()
    if above.st_uid not in (0, user) or (above.st_mode & stat.S_IWOTH and not above.st_mode & stat.S_ISVTX):
        raise _ForeignError(f"{folder.parent} is another user's, or others can write in it")
    closed = not folder.stat().st_mode & 0o077  # then nobody comes to what is in it, whatever the umask made of that
    for one in (folder, *(path for path in folder.iterdir() if path.is_dir() and not closed)):
        found = one.stat()
        if found.st_uid != user or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            raise _ForeignError(f"{one} is another user's, or others can write in it")
    return folder


@functools.cache
def _say_no_cache(why: str) -> None:
    import logging

    told = "note: compiled kernels are not kept: %s, so code that others put there would be run. chmod it to 0700, or "
    logging.getLogger("plumbob").warning(told + "set PLUMBOB_CACHE_DIR to a folder of your own.", why)


def compiling(what: str) -> str:
    """Say in words why the next call waits, after which a compilation says no more of itself in this process."""
    _WAITING.said = True
    kept = f"once; it is kept in {cache_folder()}" if why_no_cache() is None else "at each run: no cache can be kept"
    return f"compiling {what} for this processor, which takes some seconds, {kept}"


class _Waiting:
    """Says once that this process compiles, when it has waited a second for that in all.

    Numba reports the begin and the end of each compilation, those of callees between those of their caller, and lets
    no two threads compile at once.
    """

    def __init__(self, patience: float = 1.0) -> None:
        self.said = False
        self._left = patience
        self._depth = 0
        self._began = 0.0
        self._alarm: threading.Timer | None = None

    def begin(self) -> None:
        self._depth += 1
        if self._depth > 1 or self.said:
            return
        self._began = time.monotonic()
        self._alarm = threading.Timer(self._left, self.say)
        self._alarm.daemon = True
        with contextlib.suppress(RuntimeError):  # no thread to be had: then it waits in silence
            self._alarm.start()

    def end(self) -> None:
        self._depth -= 1
        if self._depth == 0 and self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None
            self._left = max(0.0, self._left - (time.monotonic() - self._began))

    def say(self) -> None:
        if self.said:
            return
        self.said = True  # at once: an alarm that went off late may meet the next one
        import logging

        logging.getLogger("plumbob").warning("note: %s", compiling("Plumbob's kernels"))


_WAITING = _Waiting()


@functools.cache
def _listen() -> None:
    """Let numba report its compilations of this project's kernels."""
    event: Any = import_module("numba.core.event")  # typed in some releases only

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, found: Any) -> None:
            if found.data["dispatcher"].py_func.__module__.startswith("plumbob."):
                _WAITING.begin()

        def on_end(self, found: Any) -> None:
            if found.data["dispatcher"].py_func.__module__.startswith("plumbob."):
                _WAITING.end()

    event.register("numba:compile", Listener())


def _compile(kernel: Kernel[P, R]) -> Callable[P, R]:
    import numba

    _listen()
    func = _with_compiled_callees(cast(FunctionType, kernel.py_func))
    inside = {reached.__code__.co_filename for reached in _reachable(kernel)} <= _SOURCES
    return cast(
        Callable[P, R], (_cached(func, kernel.options) if inside else None) or numba.njit(**kernel.options)(func)
    )


def _cached(func: FunctionType, options: Mapping[str, Any]) -> Any:
    """Dispatcher with a file cache, or None where no folder can be written, or others could write in it."""
    import numba

    config: Any = numba.config
    outer = config.CACHE_DIR
    try:
        folder = _own_folder()
        config.CACHE_DIR = str(folder)
        dispatcher: Any = numba.njit(cache=True, **options)(func)
    except _ForeignError as error:
        _say_no_cache(str(error))
        return None
    except (RuntimeError, OSError):
        return None
    finally:
        config.CACHE_DIR = outer
    if not Path(dispatcher.stats.cache_path).is_relative_to(folder):
        return None  # numba went elsewhere, where there is no fingerprint
    # departs from the rule of public names only: numba offers no other place to catch what its cache raises
    if hasattr(dispatcher, "_cache"):
        dispatcher._cache = _Forgiving(dispatcher._cache)
    return dispatcher


class _Forgiving:
    """A numba cache whose damaged file or full disk costs a compilation, not the call."""

    def __init__(self, cache: Any) -> None:
        self._cache = cache

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)

    def load_overload(self, *args: Any) -> Any:
        try:
            return self._cache.load_overload(*args)
        except Exception:  # whatever unpickling a damaged file raises
            with contextlib.suppress(Exception):
                self._cache.flush()
            return None

    def save_overload(self, *args: Any) -> None:
        with contextlib.suppress(Exception), _adding_alone(Path(self._cache.cache_path)):
            self._cache.save_overload(*args)


@contextlib.contextmanager
def _adding_alone(folder: Path) -> Iterator[None]:
    """Let one process at a time add to a cache: numba numbers a file by an index that it reads and writes again.

    Two that did so at once would give two kernels one number, and the index would take one of them for the other.
    """
    descriptor = os.open(folder / ".lock", os.O_CREAT | os.O_RDWR, 0o600)
    try:
        if sys.platform != "win32":
            with contextlib.suppress(OSError):  # a disk without locks
                fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _reachable(kernel: Kernel[..., Any]) -> Iterator[FunctionType]:
    func = cast(FunctionType, kernel.py_func)
    yield func
    for callee in _callees(func).values():
        yield from _reachable(callee)


def _callees(func: FunctionType) -> dict[str, Kernel[..., Any]]:
    named = ((name, func.__globals__.get(name)) for name in func.__code__.co_names)
    return {name: value for name, value in named if isinstance(value, Kernel)}


def _with_compiled_callees(func: FunctionType) -> FunctionType:
    names = {**func.__globals__, **{name: kernel.compiled for name, kernel in _callees(func).items()}}
    bound = FunctionType(func.__code__, names, func.__name__, func.__defaults__)
    bound.__qualname__ = func.__qualname__
    bound.__module__ = func.__module__
    return bound
