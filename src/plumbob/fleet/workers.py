"""Who does the jobs of a batch: this process, processes of it, or the workers of a Dask cluster.

Processes and a cluster have one interface, futures as of `concurrent.futures`, and are given a few jobs at a time. Most
of a job on a short recording is Python, which holds the interpreter's lock, so that two threads take as long as one.
"""

import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import parent_process, resource_tracker
from multiprocessing.connection import wait as wait_for_some
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, Final, NamedTuple

from plumbob.core.errors import LineError, MissingExtraError, one_line
from plumbob.fleet.items import Item
from plumbob.fleet.job import BatchSettings, JobOutcome, failed, run_job
from plumbob.fleet.places import in_memory

_PATIENCE: Final = 20.0
"""Time that a process has to break off its job, s."""
_STARTING: Final = threading.Lock()
_Job = Callable[[], JobOutcome]
_Answer = Future[JobOutcome | None]
"""None where this process has to do the job."""


class _Pool(NamedTuple):
    """Who does jobs, how many at a time, the error that says that the worker of one is lost, and how that ended."""

    submit: Callable[[_Job], _Answer]
    most: int
    lost: type[Exception]
    how_lost: Callable[[_Answer], str]


def outcomes(
    settings: BatchSettings, items: Iterable[Item], out: str, jobs: int, cluster: str | None
) -> Generator[JobOutcome, None, None]:
    """Outcomes as they come, of this process, of several, or of a cluster; the job whose worker is lost has failed.

    Whoever stops early lets what runs be broken off, and nothing be half written.

    Raises
    ------
    MissingExtraError
        If a cluster needs Dask, and it is not installed.
    LineError
        If there is no scheduler at the address.
    """
    running: dict[_Answer, Item] = {}

    def finished() -> Iterator[JobOutcome]:
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            item = running.pop(future)
            if isinstance(future.exception(), pool.lost):
                how = " ".join(pool.how_lost(future).split())
                reason = f"the process that worked on it was lost: {how}; the next run tries it again."
                yield failed(settings, item, out, reason)
            else:
                yield future.result() or run_job(settings, item, out)

    with processes(jobs) if cluster is None else _cluster(cluster) as pool:
        for item in items:
            if not pool.most or in_memory(out) or in_memory(item.where):  # which no other process has
                yield run_job(settings, item, out)
            else:
                running[pool.submit(partial(run_job, settings, item, out))] = item
            while running and len(running) >= pool.most:
                yield from finished()
        while running:
            yield from finished()


@contextmanager
def _cluster(address: str) -> Iterator[_Pool]:
    """Workers of a Dask scheduler; the job of a lost one goes to another. Errors as of `outcomes`."""
    try:
        import distributed
    except ImportError as error:
        raise MissingExtraError('a cluster needs Dask; install it with: pip install "plumbob[cluster]".') from error
    untyped: Any = distributed
    try:
        client: Any = untyped.Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise LineError(f"no Dask scheduler answers at {address}: {one_line(error)}. Check the address.") from error
    with client:
        executor, most = client.get_executor(pure=False), 4 * max(1, sum(client.nthreads().values()))
        try:
            yield _Pool(executor.submit, most, untyped.KilledWorker, lambda answer: str(answer.exception()))
        finally:
            executor.shutdown(wait=False)


@contextmanager
def processes(jobs: int) -> Iterator[_Pool]:
    """Processes with a job each; none for one job at a time, or where none can be started."""
    children, most = list[_Child](), 0

    def submit(job: _Job) -> _Answer:
        try:
            data = pickle.dumps(job)
            if (child := next((child for child in children if child.answer.done()), None)) is None:
                children.append(child := _Child())
            child.answer = child.submit(_answer, data)
        except Exception:  # whatever a foreign type raises, or the system that has no room for a process
            return _done_here()
        return child.answer

    def how_lost(answer: _Answer) -> str:
        child = next(child for child in children if child.answer is answer)
        children.remove(child)
        child.shutdown()
        return _how_ended(child.process.exitcode or 0)

    try:
        if jobs > 1 and sys.executable and not getattr(sys, "frozen", False):
            with suppress(OSError, AssertionError, RuntimeError):  # the last two where this process may not have any
                for _ in range(jobs):
                    children.append(_Child())
                children[0].ready.result()
                most = jobs
        yield _Pool(submit, most, BrokenProcessPool, how_lost)
    finally:
        for child in children:
            child.process.terminate()
            child.shutdown(wait=False)
        for child in children:
            wait_for_some([child.process.sentinel], _PATIENCE)
            child.process.kill()


def _done_here() -> _Answer:
    answer: _Answer = Future()
    answer.set_result(None)
    return answer


class _Child(ProcessPoolExecutor):
    """One process, which imports this package and never the program that called it, and the answer to its last job.

    So a script needs no main guard, and a notebook or a prompt will do. A pool of several processes would be broken as
    a whole by the death of one.
    """

    process: SpawnProcess

    def __init__(self) -> None:
        context = SpawnContext()
        context.Process = self._made  # type: ignore[misc, assignment]
        super().__init__(1, context, _prepare)
        self.answer = _done_here()
        with _STARTING, _without_interrupt():
            main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
            try:
                self.ready = self.submit(os.getpid)  # the first job starts it
            finally:
                sys.modules["__main__"] = main

    def _made(self, *args: Any, **how: Any) -> SpawnProcess:
        self.process = SpawnProcess(*args, **how)
        return self.process


@contextmanager
def _without_interrupt() -> Iterator[None]:
    """Context in which Ctrl-C waits, and that of a process that is started here for good."""
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # before, because it lets Ctrl-C through
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _how_ended(code: int) -> str:
    """What an exit code says."""
    if code >= 0:
        return f"it ended with exit code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    return f"it was ended by {name}" + (", as the system does where memory runs out" if name == "SIGKILL" else "")


# In the process -------------------------------------------------------------------------------------------------------


def _prepare() -> None:
    """Leave Ctrl-C to the batch, end when it ends, and print to standard error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # on its way out it removes what is half written
    with suppress(OSError):  # the batch has no standard error
        os.dup2(2, 1)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    if (batch := parent_process()) is not None:
        batch.join()
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_PATIENCE)  # where an answer was on its way, its sender has caught that
        os._exit(128 + signal.SIGTERM)


def _answer(data: bytes) -> Any:
    """What a job gives; None where it cannot be taken, because a type is not known here."""
    try:
        try:
            job = pickle.loads(data)  # noqa: S301 - from the batch that started this process
        except Exception:  # whatever the lack of a type raises
            return None
        return job()
    except SystemExit:  # the executor would catch it, and wait for the next job
        os._exit(128 + signal.SIGTERM)
