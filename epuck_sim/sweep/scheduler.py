"""Hands trials to workers in chunks and gathers the outcomes, whatever becomes of a worker.

A chunk is half a second of work, less towards the end, so that no worker is left alone with the last ones.
"""

import math
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from contextlib import suppress
from typing import TypeVar

from epuck_sim.errors import ClusterError
from epuck_sim.runs.records import Outcome, Task
from epuck_sim.sweep.executors import OpenPool, Pool
from epuck_sim.sweep.worker import compile_ahead, make_outcome, run_chunk

Result = TypeVar("Result")

CHUNK_S = 0.5
"""So much work is handed over at once: long beside the milliseconds that this costs, short beside a run."""


class ChunkSizer:
    """How many trials make a chunk, from how long those before have taken."""

    def __init__(self) -> None:
        self._trials = 0
        self._wall_s = 0.0

    def note(self, outcomes: Iterable[Outcome]) -> None:
        """Take note of trials that have ended."""
        for each in outcomes:
            self._trials += 1
            self._wall_s += each.result.wall_s if each.result else 0.0

    def chunk(self, waiting: int, slots: int) -> int:
        """Return how many of the `waiting` trials to hand over to one of `slots`."""
        if not self._trials:
            return 1
        by_time = CHUNK_S * self._trials / max(self._wall_s, 1e-6)
        return max(1, min(math.floor(by_time), math.ceil(waiting / (2 * slots))))


def run_tasks(tasks: Iterable[Task], open_pool: OpenPool) -> Generator[Outcome]:
    """Yield the outcome of every task as it is known.

    Where a worker dies, nobody knows at which trial. Those that were under way are handed over again, each by itself;
    those that are under way at a death once more are run one at a time, and one that takes its worker along even then
    has failed. A broken pool is opened anew.
    Raises ClusterError where the pool cannot be opened, cannot run trials, or is gone.
    """
    waiting, pace = deque(tasks), ChunkSizer()
    lost_before: set[tuple[int, int]] = set()
    while waiting:
        with open_pool() as pool:
            lost = yield from _run_parallel(pool, waiting, pace, lost_before)
        suspects = deque(task for task in lost if task[:2] in lost_before)
        waiting.extendleft(task for task in lost if task[:2] not in lost_before)
        lost_before.update(task[:2] for task in lost)
        while suspects:
            with open_pool() as pool:
                yield from _run_isolated(pool, suspects)


def _run_parallel(
    pool: Pool, waiting: deque[Task], pace: ChunkSizer, lost_before: set[tuple[int, int]]
) -> Generator[Outcome, None, list[Task]]:
    """Yield outcomes until nothing is left in `waiting` or a worker dies; return what was lost with it.

    lost_before: the point and trial of tasks that were lost with a worker already; each is a chunk by itself.
    """
    _prepare(pool, waiting)
    running: dict[Future[list[Outcome]], list[Task]] = {}
    lost: list[Task] = []
    while running or (waiting and not lost):
        while waiting and not lost and len(running) < (slots := pool.slots()):
            size = 1 if waiting[0][:2] in lost_before else pace.chunk(len(waiting), slots)
            chunk = [waiting.popleft() for _ in range(size)]
            try:
                running[pool.executor.submit(run_chunk, chunk)] = chunk
            except BrokenExecutor:
                lost.extend(chunk)
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            chunk = running.pop(future)
            try:
                outcomes = _result(future, pool)
            except pool.deaths:
                lost.extend(chunk)
                continue
            pace.note(outcomes)
            yield from outcomes
    return lost


def _prepare(pool: Pool, waiting: Iterable[Task]) -> None:
    """Have one worker compile what all need; if it dies over that, trials will show which of them it was."""
    kinds = {task.scenario.compiled: task for task in waiting}
    with suppress(*pool.deaths):
        _result(pool.executor.submit(compile_ahead, list(kinds.values())), pool)


def _run_isolated(pool: Pool, suspects: deque[Task]) -> Iterator[Outcome]:
    """Yield outcomes of `suspects` until nothing is left or one of them takes its worker along."""
    while suspects:
        try:
            future = pool.executor.submit(run_chunk, [suspects[0]])
        except BrokenExecutor:  # a worker that had nothing to do
            return
        task = suspects.popleft()
        try:
            yield from _result(future, pool)
        except pool.deaths as death:
            yield make_outcome(task, None, f"its worker died: {death}")
            return


def _result(future: Future[Result], pool: Pool) -> Result:
    try:
        return future.result()
    except pool.deaths:
        raise
    except CancelledError as error:
        raise ClusterError("the cluster has given up this run, or is gone") from error
    except Exception as error:  # not of a trial: those are outcomes
        raise ClusterError(f"a worker cannot run trials: {type(error).__name__}: {error}") from error
