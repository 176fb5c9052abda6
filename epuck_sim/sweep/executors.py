"""Where trials run: processes of this machine, or a Dask cluster; both are executors of concurrent.futures."""

import asyncio
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from multiprocessing import forkserver, resource_tracker
from typing import NamedTuple

from epuck_sim.errors import ClusterError

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Libraries in a worker are told by these to leave the other cores to the other workers."""

CONNECT_S = 6
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
    context = multiprocessing.get_context("forkserver")
    workers = workers or _cores()
    context.set_forkserver_preload(["epuck_sim.sweep.worker"])
    others = set(multiprocessing.active_children())
    with _environment(dict.fromkeys(ONE_THREAD, "1")):
        resource_tracker.ensure_running()  # it would lift the block
        with _deaf_to_ctrl_c():
            forkserver.ensure_running()
        # Ctrl-C while the server still loads would take from workers what they are about to open
        is_ready = context.Process(target=_do_nothing)
        is_ready.start()
        is_ready.join()
        executor = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin_worker)
        try:
            yield Pool(executor, lambda: 2 * workers, (BrokenExecutor,))
        except BaseException:
            executor.shutdown(wait=False, cancel_futures=True)
            ours = set(multiprocessing.active_children()) - others
            for process in ours:
                process.terminate()
            for process in ours:  # one that is just starting would miss what this process takes along
                process.join()
            raise
        executor.shutdown()


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """Leave Ctrl-C to this process: those started meanwhile, and theirs, never hear of it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _do_nothing() -> None:
    """Show that the server can start processes."""


def _begin_worker() -> None:
    """End when the parent does, even if it was killed."""
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
        from distributed import Client, KilledWorker, rpc  # noqa: PLC0415 an extra, and slow to import
    except ImportError as error:
        raise ClusterError("--dask needs the extra `cluster`: pip install 'epuck-sim[cluster]'") from error

    async def ask() -> None:
        async with rpc(address) as scheduler:
            await scheduler.identity()

    log = logging.getLogger("distributed")
    level = log.level
    log.setLevel(logging.CRITICAL)  # what it has to say is in our messages
    try:
        # whatever listens there may be no Dask, and hold a client's connection for ever
        asyncio.run(asyncio.wait_for(ask(), CONNECT_S))
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except Exception as error:  # of any kind: it is not known who answered
        log.setLevel(level)
        reason = str(error) or f"nothing within {CONNECT_S} s"
        raise ClusterError(f"--dask {address}: no Dask scheduler answers there: {reason}") from error
    looked, slots = -LOOK_S, 0

    def count() -> int:
        nonlocal looked, slots
        if time.monotonic() - looked > LOOK_S:
            slots = 2 * max(1, sum(client.nthreads().values()))
            looked = time.monotonic()
        return slots

    try:
        with client:
            yield Pool(client.get_executor(pure=False), count, (KilledWorker,))
    finally:
        log.setLevel(level)
