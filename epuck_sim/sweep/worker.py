"""The work of a worker process: trials, one after the other, each to its result or to the message of its error.

It imports only what a simulation needs: no plots, no tables, no command line.

Compiled code cannot be interrupted. A thread compares, now and then, which controller is running in which step, and
ends the worker if it does not return, so that an endless loop costs a sweep that trial alone. The time that counts is
processor time of the thread that simulates, so that a machine which sleeps or is busy ends nothing.
"""

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.records import Outcome, Task
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.messages import describe_error, storable
from epuck_sim.util.provenance import host, versions

LIMIT_VARIABLE = "EPUCK_SIM_STEP_LIMIT_S"
"""Environment variable that replaces `STEP_LIMIT_S`."""

STEP_LIMIT_S = 60.0
"""Processor time in seconds in which a controller must return from a step: a million times what one takes."""

SET_UP_FACTOR = 10
"""Limit for setting up a trial, which may compile and runs `start`, relative to that of a step."""

EXIT_CODE = 70
"""Exit code of a worker that was ended."""

AtWork = Callable[[], tuple[int, int] | None]
"""Returns robot and step of the controller that is running; None while none is."""


def compile_ahead(tasks: Sequence[Task]) -> None:
    """Set up the trials without a step, so that other workers find compiled code in the cache."""
    for task in tasks:
        with suppress(BaseException), watchdog(task.scenario.name):  # running the trial will show it
            simulate(task.scenario, task.seed, interpret=task.interpret)


def run_chunk(tasks: Sequence[Task]) -> list[Outcome]:
    """Run the trials in order; an error in one of them becomes its outcome."""
    return [_run_task(task) for task in tasks]


def _run_task(task: Task) -> Outcome:
    try:
        with watchdog(f"{task.scenario.name}: seed {task.seed}") as dog:
            simulation = simulate(task.scenario, task.seed, interpret=task.interpret)
            dog.watch_steps(getattr(simulation, "controller_at_work", lambda: None))  # agents have none
            result, error = run_trial(simulation), None
    except EpuckSimError as problem:
        result, error = None, storable(str(problem))
    except BaseException as problem:  # one trial's error, of whatever kind, must not end the others
        result, error = None, describe_error(problem)
    return make_outcome(task, result, error)


def make_outcome(task: Task, result: TrialResult | None, error: str | None) -> Outcome:
    """Return the outcome of a task that this process has run, with its versions and host."""
    return Outcome(task.point, task.trial, task.seed, result, error, {**versions(), "host": host()})


class Watchdog:
    """What `watchdog` yields: it watches the setting up of a trial until it is told how to watch its steps."""

    def __init__(self, name: str, limit_s: float) -> None:
        self._name = name
        self._limit_s = limit_s
        self._at_work: AtWork = lambda: (-1, -1)
        self._cpu_s = _thread_clock()
        self.over = threading.Event()

    def watch_steps(self, at_work: AtWork) -> None:
        """Watch the steps of a trial from now on."""
        self._at_work = at_work

    def run(self) -> None:
        """End this process if one controller stays at work for longer than the limit."""
        last, since_s = self._at_work(), self._cpu_s()
        while not self.over.wait(self._limit_s / 20):
            now = self._at_work()
            if now != last or now is None:
                last, since_s = now, self._cpu_s()
            elif self._cpu_s() - since_s > self._limit_s * (SET_UP_FACTOR if now == (-1, -1) else 1):
                self._end(*now)

    def _end(self, robot: int, step: int) -> None:
        where = f"robot {robot}, step {step}" if step >= 0 else "at the start"
        line = f"{self._name}: {where}: its controller has not returned for {self._limit_s:g} s; its worker is ended\n"
        try:
            os.write(sys.stderr.fileno(), line.encode())
        finally:  # whether or not there is somewhere to write to
            os._exit(EXIT_CODE)


@contextmanager
def watchdog(name: str) -> Iterator[Watchdog]:
    """Watch the trial that this thread simulates in the block.

    Args:
        name: Name of the trial, for the message.
    """
    dog = Watchdog(name, float(os.environ.get(LIMIT_VARIABLE, STEP_LIMIT_S)))
    thread = threading.Thread(target=dog.run, daemon=True)
    thread.start()
    try:
        yield dog
    finally:
        dog.over.set()
        thread.join()


def _thread_clock() -> Callable[[], float]:
    """Return a clock of the processor time of this thread, for others; of all time, where systems have none."""
    if not hasattr(time, "pthread_getcpuclockid"):
        return time.monotonic
    clock = time.pthread_getcpuclockid(threading.get_ident())
    return lambda: time.clock_gettime(clock)
