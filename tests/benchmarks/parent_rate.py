"""Measures how many trials a second one parent can store: `python -m tests.benchmarks.parent_rate FOLDER`.

Its 64 workers are simulated: they return at once. What would be their own work is done beforehand or left out; what the
parent does for them is done and counted: making tasks, their bytes for the pipe, results from bytes, storing.
"""

import pickle
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim import TrialResult, run_sweep
from epuck_sim.sweep.scheduler import Pool
from epuck_sim.sweep.worker import Task, make_outcome, run_chunk
from tests.benchmarks.big_folders import scenario_of

WORKERS = 64

TRIAL_S = (1.0, 0.1, 0.01, 0.001)
"""Time that a trial is said to have taken, by which trials are put together in chunks of half a second."""

TRIALS = 20_000


class ReturnAtOnce(Executor):
    """Returns results without simulating, and counts the time of what only workers would have to do."""

    def __init__(self, wall_s: float) -> None:
        self._wall_s = wall_s
        self.chunks = 0
        self.spent_s = np.zeros(2)  # CPU time, and time on the wall

    def submit(self, function: Any, tasks: list[Task]) -> Future:
        future: Future = Future()
        pickle.dumps((function, tasks))
        if function is run_chunk:
            self.chunks += 1
            future.set_result(pickle.loads(self.answer(tasks)))
        else:
            future.set_result(None)
        return future

    def answer(self, tasks: list[Task]) -> bytes:
        began_s = now_s()
        result = TrialResult("thesis", 1, 60, False, 60, 0.97, 3000, 300.0, self._wall_s)
        answer = pickle.dumps([make_outcome(task, result, None) for task in tasks])
        self.spent_s += now_s() - began_s
        return answer


def now_s() -> np.ndarray:
    return np.array([time.process_time(), time.perf_counter()])


def measure(folder: Path, trial_s: float) -> tuple[float, float, float]:
    """Return trials a second of the parent's CPU time, and of time on the wall, and trials in a chunk."""
    executor = ReturnAtOnce(trial_s)

    @contextmanager
    def pool() -> Iterator[Pool]:
        yield Pool(executor, lambda: 2 * WORKERS, ())

    began_s = now_s()
    run_sweep(scenario_of(TRIALS), folder, pool)
    by_cpu, by_wall = TRIALS / (now_s() - began_s - executor.spent_s)
    return by_cpu, by_wall, TRIALS / executor.chunks


def main() -> None:
    for trial_s in TRIAL_S:
        by_cpu, by_wall, chunk = measure(Path(sys.argv[1]) / str(trial_s), trial_s)
        print(
            f"{trial_s} s a trial: {chunk:.1f} trials a chunk, "
            f"{by_cpu:,.0f} trials a CPU second, {by_wall:,.0f} a second on the wall",
            flush=True,
        )


if __name__ == "__main__":
    main()
