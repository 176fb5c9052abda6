"""The work of a worker process: trials, one after the other, each to its result or to the message of its error.

It imports only what a simulation needs: no plots, no tables, no command line.
"""

from collections.abc import Sequence
from contextlib import suppress

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.records import Outcome, Task
from epuck_sim.sweep.watchdog import watchdog
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.provenance import host, versions


def compile_ahead(tasks: Sequence[Task]) -> None:
    """Set up the trials without a step, so that other workers find compiled code in the cache."""
    for task in tasks:
        with suppress(Exception), watchdog(task.scenario.name):  # running the trial will show it
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
        result, error = None, str(problem)
    except BaseException as problem:  # one trial's error, of whatever kind, must not end the others
        result, error = None, f"{type(problem).__name__}: {problem}"
    return make_outcome(task, result, error)


def make_outcome(task: Task, result: TrialResult | None, error: str | None) -> Outcome:
    """Return the outcome of a task that this process has run, with its versions and host."""
    return Outcome(task.point, task.trial, task.seed, result, error, {**versions(), "host": host()})
