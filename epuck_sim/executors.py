"""Where trials run: processes of this machine, or a Dask cluster; both are executors of concurrent.futures."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from typing import NamedTuple

from epuck_sim.errors import ClusterError

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Libraries in a worker are told by these to leave the other cores to the other workers."""

CONNECT_S = 8
"""So long a cluster may take to answer."""

LOOK_S = 1.0
"""A cluster's workers are counted no more often than this."""


class Pool(NamedTuple):
    """An executor, how many chunks of work are worth having under way in it, and how it tells of a dead worker."""

    executor: Executor
    slots: Callable[[], int]
    deaths: tuple[type[Exception], ...]
    """What a future raises whose worker has died."""


OpenPool = Callable[[], AbstractContextManager[Pool]]


@contextmanager
def local_pool(workers: int | None = None) -> Iterator[Pool]:
    """Yield a pool of processes, each with one thread; they end with the block, or with this process.

    workers: how many; as many as this process may use cores if None. Where the block ends with an error, what they are
    at is thrown away.
    """
    # a server that has the simulation loaded forks the workers: it has no threads that a fork could break
    start = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
    context = multiprocessing.get_context(start)
    workers = workers or _cores()
    context.set_forkserver_preload(["epuck_sim.worker"])
    others = set(multiprocessing.active_children())
    with _environment(dict.fromkeys(ONE_THREAD, "1")):
        executor = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin_worker)
        try:
            yield Pool(executor, lambda: 2 * workers, (BrokenExecutor,))
        except BaseException:
            executor.shutdown(wait=False, cancel_futures=True)
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            raise
        executor.shutdown()


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, and end when the parent does, even if it was killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None  # this runs in a child

    def end_with_parent() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


@contextmanager
def _environment(settings: dict[str, str]) -> Iterator[None]:
    """Give new processes these variables, and this one its own again afterwards."""
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def dask_pool(address: str) -> Iterator[Pool]:
    """Yield a pool of the Dask cluster whose scheduler is at `address`, such as tcp://127.0.0.1:8786.

    Raises ClusterError where distributed is not installed or the scheduler does not answer.
    """
    try:
        from distributed import Client, KilledWorker  # noqa: PLC0415 an extra, and slow to import
    except ImportError as error:
        raise ClusterError("--dask needs the extra `cluster`: pip install 'epuck-sim[cluster]'") from error
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, TypeError, ValueError) as error:  # TimeoutError is an OSError
        raise ClusterError(f"--dask {address}: no Dask scheduler answers there: {error}") from error
    looked, slots = -LOOK_S, 0

    def count() -> int:
        nonlocal looked, slots
        if time.monotonic() - looked > LOOK_S:
            slots = 2 * max(1, sum(client.nthreads().values()))
            looked = time.monotonic()
        return slots

    with client:
        yield Pool(client.get_executor(pure=False), count, (KilledWorker,))
