"""Who does the jobs of a batch: this process, processes of it, or the workers of a Dask cluster.

Processes and a cluster have one interface, that of `concurrent.futures`, and a few jobs wait in it at a time. Most of a
job on a short recording is Python, which holds the interpreter's lock, so that two threads take as long as one.
"""

import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from functools import partial
from itertools import islice
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from types import ModuleType
from typing import Any, Final, NamedTuple

from plumbob.core.errors import LineError, MissingExtraError, one_line
from plumbob.fleet.items import Item
from plumbob.fleet.job import BatchSettings, JobOutcome, failed, run_job
from plumbob.fleet.places import in_memory

_PATIENCE: Final = 20.0
"""Time that a process has to break off its job, s."""
_SPAWN: Final = get_context("spawn")
_STARTING: Final = threading.Lock()


class _Pool(NamedTuple):
    """Who does jobs, how many it is given at a time, and the error that says that the worker of one is lost."""

    executor: Executor
    most: int
    lost: type[Exception]


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
    if cluster is None and jobs == 1:
        yield from (run_job(settings, item, out) for item in items)
        return
    with _processes(jobs) if cluster is None else _cluster(cluster) as pool:
        waiting, running = iter(items), dict[Future[JobOutcome], Item]()
        while True:
            for item in islice(waiting, pool.most - len(running)):
                if in_memory(out) or in_memory(item.where):  # which no other process has
                    yield run_job(settings, item, out)
                else:
                    running[pool.executor.submit(run_job, settings, item, out)] = item
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                item = running.pop(future)
                try:
                    outcome = future.result()
                except pool.lost as error:
                    reason = f"the process that worked on it was lost: {one_line(error)}; the next run tries it again."
                    outcome = failed(settings, item, out, reason)
                yield outcome


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
        executor = client.get_executor(pure=False)
        try:
            yield _Pool(executor, 4 * max(1, sum(client.nthreads().values())), untyped.KilledWorker)
        finally:
            executor.shutdown(wait=False)


@contextmanager
def _processes(jobs: int) -> Iterator[_Pool]:
    executor = ProcessExecutor(jobs)
    try:
        yield _Pool(executor, 2 * jobs, LostProcessError)
    finally:
        executor.shutdown(cancel_futures=True)


class LostProcessError(Exception):
    """The process of a job has ended; the text says how."""


class ProcessExecutor(Executor):
    """Executor whose jobs each cost at most their own process: where one dies, another is started for the next job.

    The executor of the standard library is broken as a whole by such a death. Where no process can be started, or the
    job cannot be handed over, because a type is known in this process alone, a thread here does it.
    """

    def __init__(self, jobs: int) -> None:
        first = None
        if sys.platform != "win32":
            resource_tracker.ensure_running()  # not in a thread, because it allows Ctrl-C there
            first = partial(signal.pthread_sigmask, signal.SIG_BLOCK, {signal.SIGINT})
        self._threads = ThreadPoolExecutor(jobs, thread_name_prefix="plumbob-batch", initializer=first)
        self._all: list[SpawnProcess] = []
        self._idle: list[tuple[SpawnProcess, Connection]] = []
        self._ending = False
        self._hopeless = not sys.executable or getattr(sys, "frozen", False)

    def submit(self, do: Callable[..., Any], /, *args: Any, **how: Any) -> Future[Any]:
        """Let a process do it."""
        return self._threads.submit(self._done, partial(do, *args, **how))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Break off what runs, and end all processes."""
        self._ending = True
        self._threads.shutdown(wait=False, cancel_futures=cancel_futures)
        self._end()
        self._threads.shutdown(wait=wait)
        self._end()  # those that were started meanwhile

    def _end(self) -> None:
        for process in self._all:
            process.terminate()
        for process in self._all:
            process.join(_PATIENCE)
            process.kill()
            process.join()

    def _done(self, job: Callable[[], Any]) -> Any:
        try:
            data = pickle.dumps(job)
        except Exception:  # whatever a foreign type raises
            return job()
        idle = self._free()
        if self._ending:  # it may have ended the process that was about to start
            raise LostProcessError("the batch is ending")
        if idle is None:
            return job()
        process, pipe = idle
        try:
            pipe.send_bytes(data)
            kind, answer = pipe.recv()
        except (OSError, EOFError) as error:
            process.join()
            raise LostProcessError(_how_ended(process.exitcode or 0)) from error
        self._idle.append(idle)
        if kind == "raised":
            raise answer
        return answer if kind == "done" else job()

    def _free(self) -> tuple[SpawnProcess, Connection] | None:
        """A process without a job; None where none can be started."""
        with suppress(IndexError):
            return self._idle.pop()
        if not self._hopeless:
            try:
                return self._started()
            except (OSError, EOFError, AssertionError, RuntimeError):  # the last two where it may not have any
                self._hopeless = True
        return None

    def _started(self) -> tuple[SpawnProcess, Connection]:
        """Start a process that imports this package, and never the program that called it.

        So a script needs no main guard, and a notebook or a prompt will do.
        """
        pipe, inside = _SPAWN.Pipe()
        process = _SPAWN.Process(target=_serve, args=(inside,), daemon=True)
        with _STARTING:
            main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
            try:
                process.start()
            finally:
                sys.modules["__main__"] = main
        self._all.append(process)
        inside.close()
        pipe.recv()  # it is there
        return process, pipe


def _how_ended(code: int) -> str:
    """What an exit code says."""
    if code >= 0:
        return f"it ended with exit code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    return f"it was ended by {name}" + (", as the system does where memory runs out" if name == "SIGKILL" else "")


# In the process -------------------------------------------------------------------------------------------------------


def _serve(pipe: Connection) -> None:
    """Do the jobs that come, until no more can come; what is printed goes to standard error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # on its way out it removes what is half written
    with suppress(OSError):  # the batch has no standard error
        os.dup2(2, 1)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        pipe.send("ready")
        while True:
            pipe.send(_answer(pipe.recv_bytes()))
    except (EOFError, OSError, SystemExit):
        os._exit(128 + signal.SIGTERM)  # at once: to take all apart costs a tenth of a second


def _end_with_parent() -> None:
    if (batch := parent_process()) is not None:
        batch.join()
        os.kill(os.getpid(), signal.SIGTERM)


def _answer(data: bytes) -> tuple[str, Any]:
    """What a job gives or raises, with the lines where it was raised as a note."""
    try:
        job = pickle.loads(data)  # noqa: S301 - from the batch that started this process
    except Exception:  # whatever the lack of a type raises
        return "not taken", None
    try:
        return "done", job()
    except Exception as error:
        error.add_note("".join(traceback.format_exception(error)))
        return "raised", error
