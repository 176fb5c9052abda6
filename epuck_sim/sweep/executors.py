"""Pools of workers, which are executors of concurrent.futures: here, processes of this machine."""

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from multiprocessing import forkserver, resource_tracker
from typing import TYPE_CHECKING, NamedTuple

from epuck_sim.errors import EpuckSimError
from epuck_sim.util.machine import allow_files, blocked

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerContext, SpawnContext

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables that limit a library to one thread, so that workers do not compete for cores."""

PRELOADED = ["epuck_sim.sweep.worker", "epuck_sim.trial.embodied", "epuck_sim.trial.particles"]
"""Modules that the server from which local workers are forked has loaded, so that no worker loads them itself."""


class Pool(NamedTuple):
    """An executor, and what the scheduler needs to know of it."""

    executor: Executor
    slots: Callable[[], int]  # returns the number of chunks to have under way
    deaths: tuple[type[Exception], ...]  # errors that a future raises if its worker has died
    losses: tuple[type[Exception], ...] = ()
    """Errors that a future, or `slots`, raises if all workers are gone at once, which no trial can have caused."""


OpenPool = Callable[[], AbstractContextManager[Pool]]


@contextmanager
def local_pool(workers: int | None = None) -> Iterator[Pool]:
    """Yield a pool of processes, each with one thread, which end with the block, or with this process.

    If the block ends with an error, the work under way is thrown away.
    """
    workers = workers or available_cores()
    needed = 24 + 2 * workers  # of this process, and of the server
    if (allowed := allow_files(needed)) is not None:
        enough = max(1, (allowed - 24) // 2)
        raise EpuckSimError(
            f"{workers} workers need {needed} open files; allowed: {allowed}, enough for {enough} workers; "
            "ulimit -n raises it"
        )
    others = set(multiprocessing.active_children())
    with _environment(dict.fromkeys(ONE_THREAD, "1")):
        context = _context()
        # Ctrl-C while the server still loads would close what workers are about to open: wait until it has forked once
        probe = context.Process(target=str)  # which ends at once
        probe.start()
        probe.join()
        if probe.exitcode == 1:  # it imported the script again, which began the sweep, and has said what was wrong
            raise EpuckSimError('workers cannot start; a script must begin sweeps below `if __name__ == "__main__":`')
        executor = ProcessPoolExecutor(workers, mp_context=context, initializer=_end_with_parent)
        try:
            yield Pool(executor, lambda: 2 * workers, (BrokenExecutor,))
        except BaseException:
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            executor.shutdown(cancel_futures=True)  # waits: a worker that is starting needs what exit removes
            raise
        executor.shutdown()


def _context() -> "ForkServerContext | SpawnContext":
    """Return how workers are started: forked by a server that has the simulation loaded, where the system can do so.

    The server has no threads that a fork could break.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    with blocked("SIGHUP"):  # it ignores other signals by itself, and ends when no process needs it any more
        resource_tracker.ensure_running()  # later it would unblock SIGINT
    with blocked("SIGINT"):
        forkserver.ensure_running()
    return context


def available_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _end_with_parent() -> None:
    """Let this worker end when its parent does, even if that was killed."""
    parent = multiprocessing.parent_process()
    assert parent is not None  # this runs in a child

    def wait_for_parent() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait_for_parent, daemon=True).start()


@contextmanager
def _environment(settings: dict[str, str]) -> Iterator[None]:
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
