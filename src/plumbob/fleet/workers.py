"""Who does the jobs of a batch: this process, processes of it, or the workers of a Dask cluster.

Processes and a cluster are executors as of `concurrent.futures`, and are given a few jobs at a time. Most of a job on a
short recording is Python, which holds the interpreter's lock, so that two threads take as long as one.
"""

import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from subprocess import PIPE, Popen, TimeoutExpired
from typing import Any, Final, NamedTuple

from plumbob.core.errors import LineError, MissingExtraError, one_line
from plumbob.fleet.items import Item
from plumbob.fleet.job import BatchSettings, JobOutcome, failed, run_job
from plumbob.fleet.urls import in_memory

_PATIENCE: Final = 20.0  # time that a process has to break off its job, s
_CHILD: Final[Mapping[str, Any]] = {
    "stdin": PIPE,
    "stdout": PIPE,
    "start_new_session": True,
}  # out of reach of Ctrl-C
_Job = Callable[[], JobOutcome]
_Answer = Future[JobOutcome | None]  # None where this process has to do the job


class _Pool(NamedTuple):
    """Who does jobs, how many at a time, and the error that says how the worker of one was lost."""

    submit: Callable[[_Job], _Answer]
    most: int
    lost: type[Exception]


class _LostProcessError(Exception):
    """The process of a job has ended before it answered."""


def outcomes(
    settings: BatchSettings, items: Iterable[Item], out: Path, jobs: int, cluster: str | None
) -> Generator[JobOutcome, None, None]:
    """Outcomes as they come, of this process, of several, or of a cluster; the job whose worker is lost has failed.

    Whoever stops early lets what runs be broken off, and nothing be half written.
    """
    running: dict[_Answer, Item] = {}

    def finished() -> Iterator[JobOutcome]:
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            item = running.pop(future)
            if isinstance(error := future.exception(), pool.lost):
                reason = f"the process that worked on it was lost: {one_line(error)}; the next run tries it again."
                yield failed(settings, item, out, reason)
            else:
                yield future.result() or run_job(settings, item, out)

    with processes(jobs) if cluster is None else _cluster(cluster) as pool:
        for item in items:
            if not pool.most or in_memory(item.where):  # which no other process has
                yield run_job(settings, item, out)
            else:
                running[pool.submit(partial(run_job, settings, item, out))] = item
            while running and len(running) >= pool.most:
                yield from finished()
        while running:
            yield from finished()


@contextmanager
def _cluster(address: str) -> Iterator[_Pool]:
    """Workers of a Dask scheduler; the job of a lost one goes to another."""
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
            yield _Pool(executor.submit, most, untyped.KilledWorker)
        finally:
            executor.shutdown(wait=False)


@contextmanager
def processes(jobs: int) -> Iterator[_Pool]:
    """Processes with a job each, and threads that wait for them; none for one job at a time, or where none can start.

    They import this package and never the program that called it: a script needs no main guard, a notebook will do.
    """
    idle, children, over = list[Any](), set[Any](), threading.Event()
    serving = f"import sys; sys.path[:] = {sys.path!r}; from plumbob.fleet.workers import serve; serve()"
    command = [sys.executable, "-c", serving]

    def answered(data: bytes) -> JobOutcome | None:
        try:
            child: Any = idle.pop() if idle else Popen(command, **_CHILD)
        except OSError:  # the system has no room for a process
            return None
        children.add(child)
        if over.is_set():
            child.terminate()
        try:
            pickle.dump(data, child.stdin)
            child.stdin.flush()
            outcome, error = pickle.load(child.stdout)  # noqa: S301 - from a process of this batch
        except (OSError, EOFError, pickle.UnpicklingError):
            raise _LostProcessError(_how_ended(child.wait())) from None
        idle.append(child)
        if error is not None:
            raise error
        return outcome  # type: ignore[no-any-return]

    def submit(job: _Job) -> _Answer:
        try:
            return threads.submit(answered, pickle.dumps(job))
        except Exception:  # whatever a foreign type raises
            (answer := _Answer()).set_result(None)
            return answer

    threads = ThreadPoolExecutor(jobs)
    try:
        many = jobs > 1 and sys.executable and not getattr(sys, "frozen", False)
        yield _Pool(submit, jobs if many else 0, _LostProcessError)
    finally:
        over.set()
        for child in [*children]:
            child.terminate()
        for child in [*children]:
            with suppress(TimeoutExpired):
                child.wait(_PATIENCE)
            child.kill()
        threads.shutdown(cancel_futures=True)
        for child in children:
            with suppress(OSError), child:  # closes its pipes
                pass


def _how_ended(code: int) -> str:
    """What an exit code says."""
    if code >= 0:
        return f"it ended with exit code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    return f"it was ended by {name}" + (", as the system does where memory runs out" if name == "SIGKILL" else "")


def serve() -> None:
    """Do the jobs that standard input brings, until it ends with the batch, and answer on what was standard output."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # on its way out it removes what is half written
    jobs = SimpleQueue[bytes]()
    with open(os.dup(1), "wb") as answers:  # noqa: PTH123 - a number
        os.dup2(2, 1)  # prints go to standard error
        threading.Thread(target=_listen, args=(jobs.put,), daemon=True).start()
        while True:
            pickle.dump(_answer(jobs.get()), answers)
            answers.flush()


def _listen(put: Callable[[bytes], object]) -> None:
    try:
        with open(0, "rb", closefd=False) as given:  # its own, which no other thread closes
            while True:
                put(pickle.load(given))  # noqa: S301 - from the batch that started this process
    finally:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_PATIENCE)
        os._exit(128 + signal.SIGTERM)


def _answer(data: bytes) -> tuple[JobOutcome | None, Exception | None]:
    """What a job gives, or its error; neither where it cannot be taken, because a type is not known here."""
    try:
        job = pickle.loads(data)  # noqa: S301 - from the batch that started this process
    except Exception:  # whatever the lack of a type raises
        return None, None
    try:
        return job(), None
    except Exception as error:
        error.add_note(traceback.format_exc())
        return None, error
