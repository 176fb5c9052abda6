"""Run trials in a worker process, one after the other, each to its result or an error message.

It imports only what a simulation needs: no plots, no tables, no command line.

Compiled code cannot be interrupted. A thread checks now and then whether the trial makes progress, and ends the worker
if it does not, so that an endless loop costs a sweep only that trial. It counts processor time of the simulating
thread, so that no trial is ended because the machine sleeps or is busy; `trial_timeout_s` is wall time.
"""

import json
import math
import os
import pickle
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple, Self

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.database import RESULT, as_stored
from epuck_sim.runs.sources import own_files
from epuck_sim.runs.store import Outcome
from epuck_sim.scenario.loader import Point
from epuck_sim.trial.model import Simulated, run_trial, simulate
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.messages import describe_error, storable
from epuck_sim.util.provenance import host, versions

LIMIT_VARIABLE = "EPUCK_SIM_STEP_LIMIT_S"  # environment variable that replaces `STEP_LIMIT_S`

STEP_LIMIT_S = 60.0
"""Processor time in seconds in which a controller must return from a step: a million times what a step takes.

Measures and response curves have the same limit.
"""

SET_UP_FACTOR = 10  # limit for setting up a trial, which may compile and runs `start`, relative to that of a step
EXIT_CODE = 70  # exit code of a worker that was ended

OVERTIME_S = 1.0
"""Wall time in seconds beyond `trial_timeout_s` after which a trial that does not end itself is ended by its worker."""

SETTING_UP = (-1, -1, "controller")  # value of `AtWork` while a trial is set up

AtWork = Callable[[], tuple[int, int, str] | None]
"""Returns the robot whose code is running, or -1; the step; and which code, such as `controller`. None if unknown."""

KEPT, KEPT_BYTES = 200, 2**28
"""Largest number of simulations that a worker keeps, and of their bytes: the points of a sweep take turns."""

Key = tuple[object, ...]  # all that a simulation depends on, except the seed

_kept: dict[Key, Simulated] = {}  # simulations whose trials have ended, the most recently used one last


class Task(NamedTuple):
    """A trial to be run."""

    point: Point
    trial: int
    interpret: bool  # whether controllers run as plain Python

    @property
    def place(self) -> tuple[int, int]:
        """Numbers of point and trial."""
        return self.point.number, self.trial

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle each point once, as this takes longer than all other work for a task."""
        return _unpacked_task, (_packed(self.point), self.trial, self.interpret)


MOST_PACKED = 1000  # most points whose bytes are kept

_pickled: dict[int, tuple[Point, bytes]] = {}
"""Points and their bytes, by the point's `id`, which no other object has as long as it is kept here."""


def _packed(point: Point) -> bytes:
    if id(point) not in _pickled:
        if len(_pickled) >= MOST_PACKED:
            _pickled.clear()
        _pickled[id(point)] = point, pickle.dumps(point)
    return _pickled[id(point)][1]


_unpacked: Callable[[bytes], Point] = lru_cache(MOST_PACKED)(pickle.loads)


def _unpacked_task(packed: bytes, trial: int, interpret: bool) -> Task:
    return Task(_unpacked(packed), trial, interpret)


class TrialTimeoutError(EpuckSimError):
    """Ends a trial that takes longer than its scenario allows."""


def compile_ahead(tasks: Sequence[Task]) -> None:
    """Set up trials without running them, so that other workers find compiled code in the cache."""
    with Watchdog() as dog:
        for task in tasks:
            with suppress(BaseException):  # running the trial will show it
                scenario, seed = task.point.scenario, task.point.seed(task.trial)
                dog.begin(scenario.name)
                simulate(scenario, seed, interpret=task.interpret)


def run_chunk(tasks: Sequence[Task]) -> list[Outcome]:
    """Run the trials in order; an error in one of them becomes its outcome."""
    keys: dict[tuple[int, bool], Key] = {}
    seeds = [task.point.seed(task.trial) for task in tasks]  # at once, they take a third of the time
    with Watchdog(tasks[0].point.scenario.trial_timeout_s) as dog:
        return [_run_task(task, seed, keys, dog) for task, seed in zip(tasks, seeds, strict=True)]


def _run_task(task: Task, seed: int, keys: dict[tuple[int, bool], Key], dog: "Watchdog") -> Outcome:
    scenario = task.point.scenario
    dog.begin(f"{scenario.name}: seed {seed}")
    try:
        simulation, key = _simulation_of(task, seed, keys)
        dog.watch_steps(_at_work(simulation))
        is_limited = scenario.trial_timeout_s is not None
        result, error = run_trial(simulation, progress=dog.check_time if is_limited else None), None
        if key is not None:
            _kept[key] = simulation
            if len(_kept) > min(KEPT, KEPT_BYTES // max(1, scenario.memory_bytes)):
                del _kept[next(iter(_kept))]
    except EpuckSimError as problem:
        result, error = None, storable(str(problem))
    except BaseException as problem:  # one trial's error, of whatever kind, must not end the others
        result, error = None, describe_error(problem)
    return make_outcome(task, result, error)


def _simulation_of(task: Task, seed: int, keys: dict[tuple[int, bool], Key]) -> tuple[Any, Key | None]:
    """Return the simulation of a trial, new or that of an earlier trial of its point after a reset, and its key.

    The simulation may be kept under the key, or must not be kept if that is None; `keys` caches those of a chunk.
    """
    scenario, own = task.point.scenario, (id(task.point), task.interpret)  # a point's tasks share it
    if own not in keys:
        keys[own] = type(scenario), scenario.model_dump_json(), own_files(scenario), task.interpret
    simulation: Any = _kept.pop(keys[own], None)  # not kept if the trial fails
    if simulation is not None:
        simulation.reset(seed)
        return simulation, keys[own]
    simulation = simulate(scenario, seed, interpret=task.interpret)
    # other models may have no reset, and agents that start like robots have another scenario for each seed
    return simulation, keys[own] if hasattr(simulation, "reset") and simulation.scenario == scenario else None


def _at_work(simulation: Any) -> AtWork:
    if hasattr(simulation, "at_work"):
        return lambda: simulation.at_work() or (-1, simulation.steps, "")
    return lambda: (-1, simulation.instants, "") if hasattr(simulation, "instants") else None


def step_limit_s() -> float:
    """Return `STEP_LIMIT_S`, or the value that the environment variable gives instead."""
    given = os.environ.get(LIMIT_VARIABLE, STEP_LIMIT_S)
    with suppress(ValueError):
        if 0.1 <= float(given) <= 1e9:
            return float(given)
    raise EpuckSimError(f"{LIMIT_VARIABLE} is {given!r}; allowed: seconds, 0.1 to 1e9")


def never_returned(robot: int, step: int, code: str, limit_s: float) -> str:
    """Return the message about a user's code that has been `AtWork` for longer than a limit."""
    where = f"robot {robot}, step {step}" if robot >= 0 else f"step {step}" if step >= 0 else "at the start"
    return f"{where}: {f'its {code}' if code else 'a measure or response curve'} has not returned for {limit_s:g} s"


def out_of_time(timeout_s: float) -> str:
    """Return the error of a trial that took longer than its scenario allows."""
    return f"has not ended within {timeout_s:g} s, its trial_timeout_s"


def make_outcome(task: Task, result: TrialResult | None, error: str | None) -> Outcome:
    """Return the outcome of a task that this process has run, with its versions and host."""
    values = [as_stored(getattr(result, name, None), kind) for name, kind in RESULT.items()]
    measured = json.dumps(result.measures) if result and result.measures else None
    events = json.dumps([event._asdict() for event in result.events]) if result and result.events else None
    return Outcome._make((*task.place, task.point.seed(task.trial), *values, error, measured, events, _provenance()))


@lru_cache
def _provenance() -> tuple[str, ...]:
    """Return versions and host, as one object for all outcomes, so that it is pickled once a chunk."""
    return (*versions().values(), host())


class Watchdog:
    """Watches the trials that this thread simulates in its block, and limits the wall time of each.

    It watches the set-up of each trial until `watch_steps` is called.
    """

    def __init__(self, timeout_s: float | None = None) -> None:
        self._name = ""
        self._trials = 0
        self._limit_s = step_limit_s()
        self._timeout_s = math.inf if timeout_s is None else timeout_s
        self._began_s = math.inf  # when the trial's steps began
        self._at_work: AtWork = lambda: None
        self._cpu_s = _thread_clock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def begin(self, name: str) -> None:
        """Watch the set-up of another trial from now on; messages give its `name`."""
        self._name, self._at_work, self._began_s = name, lambda: SETTING_UP, math.inf
        self._trials += 1

    def watch_steps(self, at_work: AtWork) -> None:
        """Watch the steps of the trial from now on."""
        self._at_work, self._began_s = at_work, time.monotonic()

    def check_time(self, _: object = None) -> None:
        """Raise TrialTimeoutError if the trial has taken too long; `run_trial` calls this as its `progress`."""
        if time.monotonic() - self._began_s > self._timeout_s:
            raise TrialTimeoutError(out_of_time(self._timeout_s))

    def _run(self) -> None:
        """End this process if a trial makes no progress for longer than the limit, or does not end in its time."""
        last: tuple[int, tuple[int, int, str] | None] = (0, None)
        since_s = self._cpu_s()
        while not self._over.wait(min(self._limit_s, self._timeout_s) / 20):
            if time.monotonic() - self._began_s > self._timeout_s + OVERTIME_S:
                self._end(out_of_time(self._timeout_s))
            now = self._trials, self._at_work()
            if now != last or now[1] is None:
                last, since_s = now, self._cpu_s()
            elif self._cpu_s() - since_s > self._limit_s * (SET_UP_FACTOR if now[1] == SETTING_UP else 1):
                self._end(never_returned(*now[1], self._limit_s))

    def _end(self, why: str) -> None:
        try:
            os.write(sys.stderr.fileno(), f"{self._name}: {why}; its worker is ended\n".encode())
        finally:  # whether or not there is somewhere to write to
            os._exit(EXIT_CODE)


def _thread_clock() -> Callable[[], float]:
    if not hasattr(time, "pthread_getcpuclockid"):
        return time.monotonic
    clock = time.pthread_getcpuclockid(threading.get_ident())
    return lambda: time.clock_gettime(clock)
