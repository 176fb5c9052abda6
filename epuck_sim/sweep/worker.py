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
from typing import Any

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.compatibility import own_files
from epuck_sim.runs.records import Outcome, Task
from epuck_sim.trial.model import Simulated, run_trial, simulate
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

SETTING_UP = (-1, -1, "controller")
"""Robot and step of a trial that is set up."""

AtWork = Callable[[], tuple[int, int, str] | None]
"""Returns robot and step of the controller that is running; None while none is."""


KEPT, KEPT_BYTES = 200, 2**28
"""Most simulations that a worker keeps, and the memory that they may take: points of a sweep take turns."""

_kept: dict[tuple[object, ...], Simulated] = {}
"""Simulations whose trials have ended, the last used one last."""


def compile_ahead(tasks: Sequence[Task]) -> None:
    """Set up the trials without a step, so that other workers find compiled code in the cache."""
    with watchdog() as dog:
        for task in tasks:
            with suppress(BaseException):  # running the trial will show it
                dog.begin(task.scenario.name)
                simulate(task.scenario, task.seed, interpret=task.interpret)


def run_chunk(tasks: Sequence[Task]) -> list[Outcome]:
    """Run the trials in order; an error in one of them becomes its outcome."""
    simulations = _Simulations()
    with watchdog() as dog:
        return [_run_task(task, simulations, dog) for task in tasks]


def _run_task(task: Task, simulations: "_Simulations", dog: "Watchdog") -> Outcome:
    dog.begin(f"{task.scenario.name}: seed {task.seed}")
    try:
        simulation = simulations.begin(task)
        dog.watch_steps(getattr(simulation, "at_work", lambda: None))  # agents have none
        result, error = run_trial(simulation), None
        simulations.keep(task, simulation)
    except EpuckSimError as problem:
        result, error = None, storable(str(problem))
    except BaseException as problem:  # one trial's error, of whatever kind, must not end the others
        result, error = None, describe_error(problem)
    return make_outcome(task, result, error)


class _Simulations:
    """Simulations of a chunk's trials: those of earlier trials of the same points, started anew, or new ones."""

    def __init__(self) -> None:
        self._keys: dict[tuple[int, bool], tuple[object, ...] | None] = {}  # tasks of a point share its scenario

    def begin(self, task: Task) -> Any:
        """Return the simulation of a trial; it is kept no more, as the trial may fail."""
        scenario, own = task.scenario, (id(task.scenario), task.interpret)
        key = self._keys.get(own) or (type(scenario), scenario.model_dump_json(), own_files(scenario), task.interpret)
        self._keys[own] = key
        simulation: Any = _kept.pop(key, None)
        if simulation is not None:
            simulation.reset(task.seed)
            return simulation
        simulation = simulate(scenario, task.seed, interpret=task.interpret)
        if not hasattr(simulation, "reset") or simulation.scenario != scenario:
            self._keys[own] = None  # another model's may start once, and agents that start like robots differ by seeds
        return simulation

    def keep(self, task: Task, simulation: Any) -> None:
        """Keep the simulation of a trial that has ended, for further trials of its point."""
        key = self._keys[id(task.scenario), task.interpret]
        if key is not None:
            _kept[key] = simulation
            if len(_kept) > min(KEPT, KEPT_BYTES // max(1, task.scenario.memory_bytes)):
                del _kept[next(iter(_kept))]


def make_outcome(task: Task, result: TrialResult | None, error: str | None) -> Outcome:
    """Return the outcome of a task that this process has run, with its versions and host."""
    return Outcome(task.point, task.trial, task.seed, result, error, {**versions(), "host": host()})


class Watchdog:
    """What `watchdog` yields: it watches the setting up of each trial until it is told how to watch its steps."""

    def __init__(self, limit_s: float) -> None:
        self._name = ""
        self._trials = 0
        self._limit_s = limit_s
        self._at_work: AtWork = lambda: None
        self._cpu_s = _thread_clock()
        self.over = threading.Event()

    def begin(self, name: str) -> None:
        """Watch the setting up of another trial from now on; name: that of the trial, for the message."""
        self._name, self._at_work = name, lambda: SETTING_UP
        self._trials += 1

    def watch_steps(self, at_work: AtWork) -> None:
        """Watch the steps of the trial from now on."""
        self._at_work = at_work

    def run(self) -> None:
        """End this process if one controller stays at work for longer than the limit."""
        last: tuple[int, tuple[int, int, str] | None] = (0, None)
        since_s = self._cpu_s()
        while not self.over.wait(self._limit_s / 20):
            now = self._trials, self._at_work()
            if now != last or now[1] is None:
                last, since_s = now, self._cpu_s()
            elif self._cpu_s() - since_s > self._limit_s * (SET_UP_FACTOR if now[1] == SETTING_UP else 1):
                self._end(*now[1])

    def _end(self, robot: int, step: int, code: str) -> None:
        where = f"robot {robot}, step {step}" if step >= 0 else "at the start"
        line = f"{self._name}: {where}: its {code} has not returned for {self._limit_s:g} s; its worker is ended\n"
        try:
            os.write(sys.stderr.fileno(), line.encode())
        finally:  # whether or not there is somewhere to write to
            os._exit(EXIT_CODE)


@contextmanager
def watchdog() -> Iterator[Watchdog]:
    """Watch the trials that this thread simulates in the block."""
    dog = Watchdog(float(os.environ.get(LIMIT_VARIABLE, STEP_LIMIT_S)))
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
