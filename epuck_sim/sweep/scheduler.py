"""Hand trials to workers in chunks, and collect the outcomes, even if workers die.

A pool of workers has an executor of concurrent.futures; that of `local_pool` has processes on this machine. A chunk is
half a second of work, and less towards the end, so that no worker is left alone with the last trials.
"""

import math
import multiprocessing
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from heapq import heappop, heappush
from itertools import islice
from multiprocessing import forkserver, resource_tracker
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from epuck_sim.errors import ClusterError, EpuckSimError
from epuck_sim.runs.store import Outcome
from epuck_sim.sweep.worker import Task, compile_ahead, make_outcome, out_of_time, run_chunk
from epuck_sim.util.machine import allow_files, blocked
from epuck_sim.util.messages import counted, whole

if TYPE_CHECKING:
    from multiprocessing.context import ForkServerContext, SpawnContext
    from multiprocessing.synchronize import Lock

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables that limit a library to one thread, so that workers do not compete for cores."""

PRELOADED = ["epuck_sim.sweep.worker", "epuck_sim.trial.embodied", "epuck_sim.trial.particles"]
"""Modules that the server from which local workers are forked has loaded, so that no worker loads them itself."""

LIMITED = "workers cannot start: they die as they begin; give fewer --workers, or raise limits of memory and processes"


class Pool(NamedTuple):
    """An executor, and what the scheduler needs to know about it."""

    executor: Executor
    slots: Callable[[], int]  # returns the number of chunks to have in progress
    deaths: tuple[type[Exception], ...]  # errors that a future raises if its worker has died
    losses: tuple[type[Exception], ...] = ()
    """Errors that a future, or `slots`, raises if all workers are gone at once, which no trial can have caused."""


OpenPool = Callable[[], AbstractContextManager[Pool]]

Result = TypeVar("Result")


def _uninterrupted(start: Callable[[], Result]) -> Result:
    """Call `start` in a thread of its own, as Ctrl-C interrupts the main thread alone; return the result.

    A process whose start is interrupted would run on, known to nobody, and print how it fails as what it needs goes.
    """
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(start).result()


@contextmanager
def local_pool(workers: int | None = None) -> Iterator[Pool]:
    """Yield a pool of processes, each with one thread, which end with the block, or with this process.

    If the block ends with an error, work in progress is discarded.
    """
    workers = count_workers(workers)
    needed = 24 + 2 * workers  # of this process, and of the server
    if (allowed := allow_files(needed)) is not None:
        enough = f"enough for {counted((allowed - 24) // 2, 'worker')}" if allowed > 25 else "too few for any"
        said = f"{counted(workers, 'worker')} need {needed} open files; allowed: {allowed}, {enough}"
        raise EpuckSimError(f"{said}; ulimit -n raises this limit")
    others = set(multiprocessing.active_children())
    with _environment(dict.fromkeys(ONE_THREAD, "1")):
        try:
            context = _context()
            # Ctrl-C while the server still loads would close what workers are about to open: wait until it has forked
            probe = context.Process(target=str)  # which ends at once
            _uninterrupted(probe.start)
        except OSError as error:  # a socket's name is short
            needs = "the current folder and TMPDIR must be there, and TMPDIR's path be short"
            raise EpuckSimError(f"workers cannot start: {error.strerror or error}; {needs}") from error
        except EOFError as error:  # the server has died
            raise EpuckSimError(LIMITED) from error
        probe.join()
        if probe.exitcode == 1:  # it imported the script again, which began the sweep, and has said what was wrong
            main = 'below `if __name__ == "__main__":`'
            raise EpuckSimError(f"workers cannot start; a script must be a file, and begin sweeps {main}")
        hold = context.Lock()
        executor = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(hold,))
        try:
            _start(executor, workers, hold)
            yield Pool(executor, lambda: 2 * workers, (BrokenExecutor,))
        except BaseException:
            for process in set(multiprocessing.active_children()) - others:
                process.terminate()
            executor.shutdown(cancel_futures=True)  # waits: a worker that is starting needs what exit removes
            raise
        executor.shutdown()


def _start(executor: Executor, workers: int, hold: "Lock") -> None:
    """Start the workers of an executor; raise EpuckSimError if one dies as it begins: no trial is to be blamed."""
    try:
        with hold:  # all start before one works: an executor may hang if a worker dies while another starts
            begun = _uninterrupted(lambda: [executor.submit(int) for _ in range(workers)])
        for each in begun:
            each.result()
    except (BrokenExecutor, EOFError) as error:
        raise EpuckSimError(LIMITED) from error


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


def count_workers(workers: int | None) -> int:
    """Return the number of workers, by default that of cores; raise ValueError unless it is a whole number from 1."""
    return available_cores() if workers is None else whole("workers", workers)


def available_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _begin(hold: "Lock") -> None:
    """Begin a worker when its parent lets go of a lock; end it when its parent ends, even if that was killed."""
    parent = multiprocessing.parent_process()
    assert parent is not None  # this runs in a child

    def wait_for_parent() -> None:
        parent.join()
        os._exit(1)

    try:
        threading.Thread(target=wait_for_parent, daemon=True).start()
    except RuntimeError:  # a limit of memory or of processes
        os._exit(1)
    with hold:
        pass


@contextmanager
def _environment(settings: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ[name] for name in settings if name in os.environ}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name in settings:
            os.environ.pop(name, None)
        os.environ.update(before)


CHUNK_S = 0.5
"""Work in a chunk, in seconds: long compared with the milliseconds of handing it over, short compared with a run."""

LOOK_S = 3.0  # time in seconds without an ended chunk after which the scheduler checks for workers


class TaskQueue:
    """Queue of trials to run; tasks are made one by one as they are taken, so that they need no memory before."""

    def __init__(self, tasks: Iterable[Task], count: int) -> None:
        self._waiting = [(-math.inf, 0, iter(tasks))]  # a heap
        self._entries = 0
        self._returned: deque[Task] = deque()
        self._count = count
        self._lost_once: set[tuple[int, int]] = set()  # point and trial of tasks that were in progress at a death
        self._ended, self._wall_s = 0, 0.0  # number of trials that have ended, and the time that they took together

    def __len__(self) -> int:
        return self._count

    def take(self, count: int) -> list[Task]:
        """Return up to `count` tasks, or just one of those that were given back, which come first."""
        chunk = []
        if self._returned:
            chunk, count = [self._returned.popleft()], 1
        while self._waiting and len(chunk) < count:
            chunk += islice(self._waiting[0][-1], count - len(chunk))
            if len(chunk) < count:
                heappop(self._waiting)
        self._count = self._count - len(chunk) if chunk else 0
        return chunk

    def add(self, tasks: Sequence[Task], urgency: float) -> None:
        """Add further tasks, which come after the initial ones, the most urgent first."""
        self._entries += 1
        heappush(self._waiting, (-urgency, self._entries, iter(tasks)))
        self._count += len(tasks)

    def give_back(self, tasks: Sequence[Task]) -> list[Task]:
        """Queue tasks again that were lost with a worker; return those that are lost for the second time instead."""
        again = [task for task in tasks if task.place in self._lost_once]
        once = [task for task in tasks if task.place not in self._lost_once]
        self._lost_once.update(task.place for task in once)
        self._returned.extendleft(once)
        self._count += len(once)
        return again

    def note(self, outcomes: Iterable[Outcome]) -> None:
        """Record trials that have ended."""
        for outcome in outcomes:
            if outcome.wall_s is not None:  # it is not known how long others took
                self._ended += 1
                self._wall_s += outcome.wall_s

    def chunk(self, slots: int) -> int:
        """Return how many trials to hand over to one of `slots`, by the time that earlier ones have taken."""
        if not self._ended:
            return 1
        by_time = CHUNK_S * self._ended / max(self._wall_s, 1e-6)
        return max(1, min(math.floor(by_time), math.ceil(len(self) / (2 * slots))))


def schedule(queue: TaskQueue, kinds: Sequence[Task], open_pool: OpenPool) -> Generator[list[Outcome]]:
    """Yield the outcomes of all tasks as they become known, those of chunks that ended meanwhile together.

    When a worker dies, it is not known at which trial. Tasks in progress are handed over again, each in its own chunk;
    those in progress at a second death are run one at a time, and a task that kills its worker even then has failed. A
    broken pool is opened again. If all workers are lost at once, all tasks in progress are run again.
    """
    while queue:
        with open_pool() as pool:
            try:
                if kinds:  # one worker compiles all of them
                    _result(pool.executor.submit(compile_ahead, kinds), pool)
            except pool.deaths + pool.losses:
                kinds = ()  # trials will show which of them kills its worker
                continue
            lost = yield from _run_parallel(pool, queue)
        suspects = deque(queue.give_back(lost))
        while suspects:
            with open_pool() as pool:
                yield from _run_isolated(pool, suspects)


def _run_parallel(pool: Pool, queue: TaskQueue) -> Generator[list[Outcome], None, list[Task]]:
    """Yield outcomes until the queue is empty or a worker dies; return the tasks that were lost with it."""
    running: dict[Future[list[Outcome]], list[Task]] = {}
    lost: list[Task] = []
    # `concurrent.futures.wait` locks all futures: interrupted half way, it leaves locks for which the pool's thread,
    # and so the end of the process, would wait for ever
    ended: SimpleQueue[Future[list[Outcome]]] = SimpleQueue()
    try:
        while running or (queue and not lost):
            while queue and not lost and len(running) < (slots := pool.slots()):
                chunk = queue.take(queue.chunk(slots))
                try:
                    future = pool.executor.submit(run_chunk, chunk)
                except BrokenExecutor:
                    lost.extend(chunk)
                else:
                    running[future] = chunk
                    future.add_done_callback(ended.put)
            if not running:
                continue
            try:
                together = [ended.get(timeout=LOOK_S)]
            except Empty:
                pool.slots()  # raises if all workers are lost
                continue
            while not ended.empty():  # they ended while others were stored
                together.append(ended.get())
            outcomes, dead = _gather({future: running[future] for future in together}, pool)
            lost += dead
            for future in together:
                del running[future]
            queue.note(outcomes)
            if outcomes:
                yield outcomes
    except pool.losses:
        for chunk in running.values():
            queue.add(chunk, math.inf)
    return lost


def _gather(ended: dict[Future[list[Outcome]], list[Task]], pool: Pool) -> tuple[list[Outcome], list[Task]]:
    outcomes: list[Outcome] = []
    lost: list[Task] = []
    for future, chunk in ended.items():
        try:
            outcomes = [*outcomes, *_result(future, pool)]
        except pool.deaths:
            lost += chunk
    return outcomes, lost


def _run_isolated(pool: Pool, suspects: deque[Task]) -> Iterator[list[Outcome]]:
    """Yield outcomes of `suspects` until none is left or one of them kills its worker."""
    while suspects:
        try:
            future = pool.executor.submit(run_chunk, [suspects[0]])
        except BrokenExecutor:  # an idle worker has died
            return
        task, began_s = suspects.popleft(), time.monotonic()
        try:
            yield _result(future, pool)
        except pool.losses:
            suspects.appendleft(task)
            return
        except pool.deaths as death:
            timeout_s = task.point.scenario.trial_timeout_s or math.inf
            is_late = time.monotonic() - began_s > timeout_s
            alone = f"run it alone to see why, by --point {task.point.number} --trial {task.trial}"
            died = f"its worker died: {death}; {alone}, or give fewer --workers if memory has run out"
            yield [make_outcome(task, None, out_of_time(timeout_s) if is_late else died)]
            return


def _result(future: Future[Result], pool: Pool) -> Result:
    passed_on: tuple[type[Exception], ...] = (ClusterError, *pool.deaths, *pool.losses)
    try:
        while True:
            try:
                return future.result(LOOK_S)
            except TimeoutError:
                if future.done():
                    raise
                pool.slots()  # reports if there are no workers, raises if all are lost
    except passed_on:
        raise
    except CancelledError as error:
        raise ClusterError("the cluster has given up this run, or is gone") from error
    except Exception as error:  # not that of a trial, which would be an outcome
        raise ClusterError(f"a worker cannot run trials: {type(error).__name__}: {error}") from error
