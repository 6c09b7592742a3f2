"""Who does the jobs: this process, children of it, or the workers of a Dask cluster; few jobs wait at a time."""

import threading
from collections.abc import Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from typing import Any, Final

from plumbob.core.errors import LineError, MissingExtraError, one_line
from plumbob.fleet.child import Child, EndedError, NotTakenError
from plumbob.fleet.items import Item
from plumbob.fleet.job import JobOutcome, StoppedError, failed, run_job
from plumbob.fleet.places import in_memory
from plumbob.fleet.settings import BatchSettings

_PATIENCE: Final = 20.0
"""Time that a child has to break off its job, s."""


def here(settings: BatchSettings, items: Iterable[Item], out: str) -> Generator[JobOutcome, None, None]:
    """Outcomes of this process, one after another."""
    for item in items:
        yield run_job(settings, item, out)


def by_children(
    settings: BatchSettings, items: Iterable[Item], out: str, jobs: int
) -> Generator[JobOutcome, None, None]:
    """Outcomes of so many processes at a time, as they come; the job of one that dies has failed, and another goes on.

    Whoever stops early lets what runs be broken off, and nothing be half written.
    """
    children, waiting = _Children(settings, out), iter(items)
    pool = ThreadPoolExecutor(jobs, thread_name_prefix="plumbob-batch")
    running: set[Future[JobOutcome]] = set()
    try:
        while True:
            for item in islice(waiting, 2 * jobs - len(running)):
                running.add(pool.submit(children.run, item))
            if not running:
                return
            over, running = wait(running, return_when=FIRST_COMPLETED)
            for future in over:
                yield future.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        children.stop()
        pool.shutdown(wait=True)
        children.close()


class _Children:
    """Processes that do jobs: each thread that asks has one to itself, which is started with its first job.

    Where none can be started, or it cannot be given the recording, the thread does the job.
    """

    def __init__(self, settings: BatchSettings, out: str) -> None:
        self._settings, self._out = settings, out
        self._stop = threading.Event()
        self._all: list[Child] = []
        self._idle: list[Child] = []
        self._hopeless = False

    def run(self, item: Item) -> JobOutcome:
        """Do a job; errors as of `run_job`."""
        child = None if in_memory(self._out) or in_memory(item.where) else self._child()
        if child is None:
            return run_job(self._settings, item, self._out, self._stop)
        try:
            outcome = child.run(item)
        except NotTakenError:
            outcome = run_job(self._settings, item, self._out, self._stop)
        except EndedError as error:
            if self._stop.is_set():
                raise StoppedError from error
            reason = f"the process that worked on it {error}; the next run tries it again."
            return failed(self._settings, item, self._out, reason)
        self._idle.append(child)
        return outcome

    def stop(self) -> None:
        """Let all that run break off their jobs, and end."""
        self._stop.set()
        for child in list(self._all):
            child.stop()
        for child in list(self._all):
            child.end(_PATIENCE)

    def close(self) -> None:
        """Close the pipes; no thread is in `run` any more."""
        for child in self._all:
            child.close()

    def _child(self) -> Child | None:
        try:
            return self._idle.pop()
        except IndexError:
            return None if self._hopeless else self._started()

    def _started(self) -> Child | None:
        try:
            child = Child(self._settings, self._out)
        except OSError:
            self._hopeless = True
            return None
        self._all.append(child)
        if self._stop.is_set():  # `stop` may not have seen it
            child.stop()
        if child.ready():
            return child
        self._hopeless = True
        return None


def by_cluster(
    settings: BatchSettings, items: Iterable[Item], out: str, address: str
) -> Generator[JobOutcome, None, None]:
    """Outcomes of the workers of a Dask cluster as they come; the job of a worker that is lost goes to another one.

    Raises
    ------
    MissingExtraError
        If Dask is not installed.
    LineError
        If there is no scheduler at this address.
    """
    try:
        import distributed
    except ImportError as error:
        raise MissingExtraError('a cluster needs Dask; install it with: pip install "plumbob[cluster]".') from error
    untyped: Any = distributed
    try:
        client: Any = untyped.Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise LineError(f"no Dask scheduler answers at {address}: {one_line(error)}. Check the address.") from error
    waiting = iter(items)
    with client:
        running: dict[str, tuple[Any, Item]] = {}

        def submitted(item: Item) -> Any:
            future = client.submit(run_job, settings, item, out, pure=False)
            running[future.key] = future, item
            return future

        most = 4 * max(1, sum(client.nthreads().values()))
        over: Any = untyped.as_completed([submitted(item) for item in islice(waiting, most)], loop=client.loop)
        try:
            for future in over:
                _, item = running.pop(future.key)
                yield _outcome(future, settings, item, out)
                future.release()
                for more in islice(waiting, 1):
                    over.add(submitted(more))
        finally:
            client.cancel([future for future, _ in running.values()])


def _outcome(future: Any, settings: BatchSettings, item: Item, out: str) -> JobOutcome:
    """What a job says; a job that took several workers with it has failed."""
    from distributed import KilledWorker

    try:
        outcome: JobOutcome = future.result()
    except KilledWorker as error:
        return failed(settings, item, out, f"the workers that had it ended: {one_line(error)}")
    return outcome
