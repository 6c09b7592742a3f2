"""Who does the jobs: threads of this process, or the workers of a Dask cluster; few jobs wait at a time.

The kernels, Arrow and the sums of hashes let other threads of Python run meanwhile.
"""

import threading
from collections.abc import Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from typing import Any

from plumbob.core.errors import LineError, MissingExtraError, one_line
from plumbob.fleet.items import Item
from plumbob.fleet.job import Outcome, failed, run_job
from plumbob.fleet.settings import Settings


def by_threads(settings: Settings, items: Iterable[Item], out: str, jobs: int) -> Generator[Outcome, None, None]:
    """Outcomes as they come. Whoever stops early lets what runs be broken off, and nothing be half written."""
    stop, waiting = threading.Event(), iter(items)
    pool = ThreadPoolExecutor(jobs, thread_name_prefix="plumbob-batch")
    running: set[Future[Outcome]] = set()
    try:
        while True:
            for item in islice(waiting, 2 * jobs - len(running)):
                running.add(pool.submit(run_job, settings, item, out, stop))
            if not running:
                return
            over, running = wait(running, return_when=FIRST_COMPLETED)
            for one in over:
                yield one.result()
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)


def by_cluster(settings: Settings, items: Iterable[Item], out: str, address: str) -> Generator[Outcome, None, None]:
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


def _outcome(future: Any, settings: Settings, item: Item, out: str) -> Outcome:
    """What a job says; a job that took several workers with it has failed."""
    from distributed import KilledWorker

    try:
        outcome: Outcome = future.result()
    except KilledWorker as error:
        return failed(settings, item, out, f"the workers that had it ended: {one_line(error)}")
    return outcome
